//! What one link has brought, brought again to another emulator of the same process.

use super::{Inbound, Intake, LinkError, Outbound, Outbox, Tally, Wire, inbox::inbox};
use std::sync::Arc;

/// Where it comes in, and the end of the emulator that hears it; what that one answers is heard by nobody.
pub(crate) fn relay() -> (Relay, Wire) {
    let tally = Arc::new(Tally::default());
    let (intake, inbox) = inbox(tally.clone());
    let wire = Wire {
        address: "the first camera's link".to_string(),
        inbox,
        outbox: Box::new(Unheard),
        tally,
        airtime: None,
        sender: None,
    };
    (Relay(intake), wire)
}

/// Where packets come in.
pub(crate) struct Relay(Intake);

impl Relay {
    /// Brings a packet, as it came.
    pub fn bring(&self, inbound: &Inbound) {
        // One that has gone hears nothing.
        let _ = self.0.push(inbound.clone());
    }
}

struct Unheard;

impl Outbox for Unheard {
    fn offer(&mut self, _: Outbound) -> Result<Option<Outbound>, LinkError> {
        Ok(None)
    }
}
