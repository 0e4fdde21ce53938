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

/// A request to the link.
#[derive(Debug, Clone)]
pub enum Outbound {
    /// Send this packet, if its exchange is still current.
    Packet {
        /// Number of its exchange.
        exchange: u32,
        /// The packet.
        packet: Bytes,
    },
    /// End the exchange, unless its client has sent something since.
    Release {
        /// Number of the exchange.
        exchange: u32,
        /// When the client requested it.
        requested: Instant,
    },
}

/// Prefix of the reason in the answer to a refused fault.
pub const FAULT_REFUSED: &str = "Fault: ";

const NO_FAULTS: &str =
    "no faults are injected here: start the emulator with --faults or --fault-log";

/// The queue to a link.
pub trait Outbox: Send {
    /// Queues `item`; returns it if the queue is full. Fails only by [`LinkError::Closed`].
    fn offer(&mut self, item: Outbound) -> Result<Option<Outbound>, LinkError>;

    /// Checks that clients can switch faults of this kind; the error has reason and remedy.
    fn injects(&self, _: FaultKind) -> Result<(), Cow<'static, str>> {
        Err(NO_FAULTS.into())
    }
}

/// Queues an item without waiting.
type TrySend = dyn Fn(Outbound) -> Result<(), TrySendError<Outbound>> + Send;

/// The emulator's end of a queue.
pub(super) struct QueueOutbox {
    try_send: Box<TrySend>,
    tally: Arc<Tally>,
    address: String,
    /// Whether clients can replace each other; else releases are ignored.
    pub releases: bool,
    /// Checks that clients can switch faults of a kind; the error has reason and remedy.
    pub injects: fn(FaultKind) -> Result<(), &'static str>,
    /// Called after each item, and when the emulator closes its end.
    pub wake: Box<dyn Fn() + Send>,
}

/// Both ends of the queue of the link at `address`.
pub(super) fn queue(address: &str, tally: &Arc<Tally>) -> (QueueOutbox, Receiver<Outbound>) {
    let (queue, departures) = sync_channel(QUEUE);
    let try_send = move |what| queue.try_send(what);
    (QueueOutbox::new(address, tally, try_send), departures)
}

impl QueueOutbox {
    /// The end of a queue that `try_send` fills.
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
    fn offer(&mut self, item: Outbound) -> Result<Option<Outbound>, LinkError> {
        let is_packet = matches!(item, Outbound::Packet { .. });
        if !is_packet && !self.releases {
            return Ok(None);
        }
        let try_send = || (self.try_send)(item);
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
            Err(TrySendError::Full(item)) => Ok(Some(item)),
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
