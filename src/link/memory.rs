//! The in-process link: two queues.

use super::error::OpenError;
use super::inbox::{Inbound, InboxSender, QUEUE, inbox};
use super::kind::{BothEnds, Link, Options};
use super::outbox::{Outbound, QueueOutbox};
use super::tally::{Tally, count};
use super::wire::Wire;
use skyloop_firmware_sim::address::Address;
use skyloop_firmware_sim::port::{Port, PortError};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, TrySendError, sync_channel};
use std::time::{Duration, Instant};

/// Links within one process.
pub(crate) const MEMORY: Link = Link {
    scheme: "memory",
    example: "memory (loopback only)",
    is_bus: false,
    keys: &[],
    open: refuse_open,
    loopback,
};

fn refuse_open(_: &Address, _: &Options) -> Result<Wire, OpenError> {
    let reason = "the memory link joins two ends of one process: it works in `loopback` only";
    Err(reason.to_string().into())
}

fn loopback(_: &Address, _: &Options) -> Result<BothEnds, OpenError> {
    let tally = Arc::new(Tally::default());
    let (to_emulator, inbox) = inbox(tally.clone());
    let (queue, from_emulator) = sync_channel(QUEUE);
    let counted = tally.clone();
    let try_send = move |item: Outbound| {
        let bytes = match &item {
            Outbound::Packet { packet, .. } => Some(packet.len()),
            Outbound::Release { .. } => None,
        };
        let sent = queue.try_send(item);
        if matches!(sent, Err(TrySendError::Full(_))) {
            return sent;
        }
        if let Some(bytes) = bytes {
            // A queued packet counts as sent. If the client has closed, it is lost; the inbox
            // reports the end.
            match sent {
                Ok(()) => counted.moved(bytes),
                Err(_) => count(&counted.lost),
            }
            counted.done();
        }
        Ok(())
    };
    let outbox = QueueOutbox::new("memory", &tally, try_send);
    let port = MemoryPort {
        to_emulator,
        from_emulator,
    };
    let wire = Wire::new("memory".to_string(), inbox, outbox, tally);
    Ok((wire, Box::new(port)))
}

/// The flight computer's end.
struct MemoryPort {
    to_emulator: InboxSender,
    from_emulator: Receiver<Outbound>,
}

impl Port for MemoryPort {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        let taken = self
            .to_emulator
            .push(Inbound::new(0, packet, Instant::now()));
        taken.map_err(|_| PortError::Closed)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        let deadline = Instant::now() + timeout;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            match self.from_emulator.recv_timeout(left) {
                Ok(Outbound::Packet { packet, .. }) => return Ok(Some(packet.to_vec())),
                Ok(Outbound::Release { .. }) => {}
                Err(RecvTimeoutError::Timeout) => return Ok(None),
                Err(RecvTimeoutError::Disconnected) => return Err(PortError::Closed),
            }
        }
    }
}
