//! The emulator's end of an open link.

use super::error::LinkError;
use super::inbox::{Inbound, Inbox, Observer};
use super::outbox::{Outbound, Outbox};
use super::tally::{Airtime, Standstill, Tally};
use super::tx_complete::Unsent;
use skyloop_protocols::MAX_PACKET;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How long the end of a run waits for its threads to let go.
const PARTING: Duration = Duration::from_millis(100);

/// The emulator's end of an open link.
pub struct Wire {
    /// Where it listens, for people.
    pub address: String,
    /// What arrives.
    pub inbox: Inbox,
    /// What leaves.
    pub outbox: Box<dyn Outbox>,
    /// What the link counts.
    pub tally: Arc<Tally>,
    /// How long one packet takes, where the line is what limits; none where it is not.
    pub airtime: Option<Airtime>,
    /// The sending thread, if there is one; it ends when the outbox is dropped and its queue is
    /// empty.
    pub sender: Option<JoinHandle<()>>,
}

/// Notes that a client has come.
struct ClientSeen {
    is_valid: fn(&[u8]) -> bool,
    seen: Arc<AtomicBool>,
}

impl Observer for ClientSeen {
    fn taken(&self, inbound: &Inbound, _: bool) {
        if (self.is_valid)(&inbound.packet) {
            self.seen.store(true, Ordering::Relaxed);
        }
    }
}

impl Wire {
    /// A link without a rate of its own and without a thread that sends.
    pub(super) fn new(
        address: String,
        inbox: Inbox,
        outbox: impl Outbox + 'static,
        tally: Arc<Tally>,
    ) -> Wire {
        Wire {
            address,
            inbox,
            outbox: Box::new(outbox),
            tally,
            airtime: None,
            sender: None,
        }
    }

    /// How long the longest packet takes, where that is known.
    pub fn packet_airtime(&self) -> Duration {
        let airtime = self.airtime.as_ref();
        airtime.map_or(Duration::ZERO, |airtime| airtime(MAX_PACKET))
    }

    /// Sets `seen` when a valid packet of a client comes, as `is_valid` says.
    pub fn note_client(&mut self, is_valid: fn(&[u8]) -> bool, seen: &Arc<AtomicBool>) {
        self.inbox.observe(Box::new(ClientSeen {
            is_valid,
            seen: seen.clone(),
        }));
    }

    /// Lets what is queued leave, until `standstill` is over; what is left then is lost.
    pub fn close(&mut self, mut standstill: Standstill) {
        // Without an outbox the sender ends when its queue is empty.
        self.outbox = Box::new(Closed);
        let Some(sender) = self.sender.take() else {
            return;
        };
        while !sender.is_finished() && !standstill.is_over() {}
        let why = standstill.why(self.airtime.as_ref());
        let left = self.tally.give_up(why);
        if left > 0 {
            let why = match why {
                Unsent::HeldBack => "a fault holds packets back",
                Unsent::NotProved => "the client has not proved its address",
                Unsent::RunEnded => "the run ends before the link has carried them",
                _ => "the client has not read them",
            };
            tracing::warn!(
                "{}: {left} packets are lost (lost_outbound): {why}",
                self.address
            );
        }
        // What stands before the link lets go of it now, and the link of what it made: its name.
        let given_up = Instant::now();
        while !sender.is_finished() && given_up.elapsed() < PARTING {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// The outbox of a closed wire.
pub(super) struct Closed;

impl Outbox for Closed {
    fn offer(&mut self, _: Outbound) -> Result<Option<Outbound>, LinkError> {
        Err(LinkError::Closed("closed".to_string()))
    }
}
