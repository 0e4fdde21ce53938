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

/// Wait for the threads of a link at the end of a run.
const END_WAIT: Duration = Duration::from_millis(100);

/// The emulator's end of an open link.
pub struct Wire {
    /// Its address for messages.
    pub address: String,
    /// Received packets.
    pub inbox: Inbox,
    /// Packets to send.
    pub outbox: Box<dyn Outbox>,
    /// Counters of the link.
    pub tally: Arc<Tally>,
    /// Airtime of a packet, if the line has a limited rate.
    pub airtime: Option<Airtime>,
    /// The sending thread, if any. It ends when the outbox is dropped and its queue is empty.
    pub sender: Option<JoinHandle<()>>,
}

/// Notes the first valid packet of a client.
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
    /// A link without a limited rate and without a sending thread.
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

    /// Airtime of the longest packet; 0 if the rate is not limited.
    pub fn packet_airtime(&self) -> Duration {
        let airtime = self.airtime.as_ref();
        airtime.map_or(Duration::ZERO, |airtime| airtime(MAX_PACKET))
    }

    /// Sets `seen` when a client sends a valid packet (`is_valid`).
    pub fn note_client(&mut self, is_valid: fn(&[u8]) -> bool, seen: &Arc<AtomicBool>) {
        self.inbox.observe(Box::new(ClientSeen {
            is_valid,
            seen: seen.clone(),
        }));
    }

    /// Waits for queued packets to leave until `standstill` ends; the remaining ones are lost.
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
        // The threads now end and close the link, which removes its name: wait for them briefly.
        let given_up = Instant::now();
        while !sender.is_finished() && given_up.elapsed() < END_WAIT {
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
