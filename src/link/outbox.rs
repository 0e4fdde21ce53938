//! The bounded queue from the emulator to the thread of a link.

use super::error::LinkError;
use super::inbox::QUEUE;
use super::tally::Tally;
use bytes::Bytes;
use skyloop_protocols::FaultKind;
use std::borrow::Cow;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TrySendError, sync_channel};
use std::time::Instant;

/// Something for the link to do.
#[derive(Debug, Clone)]
pub enum Outbound {
    /// Send this packet, if its exchange still stands.
    Packet {
        /// Which exchange it answers.
        exchange: u32,
        /// The packet.
        packet: Bytes,
    },
    /// End the exchange, unless its client has sent something since.
    Release {
        /// Which exchange.
        exchange: u32,
        /// When the client asked for it.
        requested: Instant,
    },
}

/// What stands before the reason in the answer to a fault that is refused.
pub const FAULT_REFUSED: &str = "Fault: ";

/// Why a link injects no faults.
const NO_FAULTS: &str =
    "no faults are injected here: start the emulator with --faults or --fault-log";

/// The queue to a link.
pub trait Outbox: Send {
    /// Queues `what`; gives it back if the queue is full. Fails only by [`LinkError::Closed`].
    fn offer(&mut self, what: Outbound) -> Result<Option<Outbound>, LinkError>;

    /// Whether faults of this kind can be switched live; else why not, and the remedy.
    fn injects(&self, _: FaultKind) -> Result<(), Cow<'static, str>> {
        Err(NO_FAULTS.into())
    }
}

/// Queues an item without waiting.
type TrySend = dyn Fn(Outbound) -> Result<(), TrySendError<Outbound>> + Send;

/// The emulator's end.
pub(super) struct QueueOutbox {
    try_send: Box<TrySend>,
    tally: Arc<Tally>,
    address: String,
    /// Whether clients follow each other: a link with a single client has nothing to release.
    pub releases: bool,
    /// Whether faults of a kind can be switched live; else why not, and the remedy.
    pub injects: fn(FaultKind) -> Result<(), &'static str>,
    /// Called after each packet, and when the emulator drops its end.
    pub wake: Box<dyn Fn() + Send>,
}

/// Both ends of the queue of the link at `address`.
pub(super) fn queue(address: &str, tally: &Arc<Tally>) -> (QueueOutbox, Receiver<Outbound>) {
    let (queue, departures) = sync_channel(QUEUE);
    let try_send = move |what| queue.try_send(what);
    (QueueOutbox::new(address, tally, try_send), departures)
}

impl QueueOutbox {
    /// The end of a queue into which `try_send` puts items.
    pub fn new(
        address: &str,
        tally: &Arc<Tally>,
        try_send: impl Fn(Outbound) -> Result<(), TrySendError<Outbound>> + Send + 'static,
    ) -> QueueOutbox {
        QueueOutbox {
            try_send: Box::new(try_send),
            tally: tally.clone(),
            address: address.to_string(),
            releases: true,
            injects: |_| Err(NO_FAULTS),
            wake: Box::new(|| ()),
        }
    }
}

impl Outbox for QueueOutbox {
    fn offer(&mut self, what: Outbound) -> Result<Option<Outbound>, LinkError> {
        let is_packet = matches!(what, Outbound::Packet { .. });
        if !is_packet && !self.releases {
            return Ok(None);
        }
        let try_send = || (self.try_send)(what);
        let sent = if is_packet {
            self.tally.queue(try_send)
        } else {
            try_send()
        };
        match sent {
            Ok(()) => {
                (self.wake)();
                Ok(None)
            }
            Err(TrySendError::Full(what)) => Ok(Some(what)),
            Err(TrySendError::Disconnected(_)) => Err(LinkError::Closed(self.address.clone())),
        }
    }

    fn injects(&self, kind: FaultKind) -> Result<(), Cow<'static, str>> {
        (self.injects)(kind).map_err(Cow::from)
    }
}

impl Drop for QueueOutbox {
    fn drop(&mut self) {
        (self.wake)();
    }
}
