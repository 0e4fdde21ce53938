//! A thread that reads packets into a bounded queue.
//!
//! It reads while the flight computer is busy, so that the buffers of sockets and UARTs do not
//! overflow. A wait for the queue is precise to some 0.1 ms; a socket's time-out depends on system
//! ticks of up to 10 ms.

use std::io::{self, ErrorKind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Capacity of the queue in packets: many credit windows.
const QUEUE: usize = 1024;
/// Time-out of a source, after which the thread checks its stop flag.
pub(crate) const READ_TIMEOUT: Duration = Duration::from_millis(20);

#[derive(Debug)]
pub(crate) struct Reader {
    packets: Receiver<Vec<u8>>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<io::Error>>,
}

#[derive(Debug, Default)]
struct Shared {
    stop: AtomicBool,
    dropped: AtomicU64,
}

pub(crate) struct PacketSink {
    queue: SyncSender<Vec<u8>>,
    shared: Arc<Shared>,
}

impl PacketSink {
    /// Queues a packet. With a full queue it is dropped and counted.
    pub(crate) fn take(&self, packet: &[u8]) {
        // Without a flight computer the thread is about to stop.
        if let Err(TrySendError::Full(_)) = self.queue.try_send(packet.to_vec()) {
            self.lose(1);
        }
    }

    /// Counts damaged or missing packets.
    pub(crate) fn lose(&self, packets: u32) {
        let dropped = &self.shared.dropped;
        dropped.fetch_add(packets.into(), Ordering::Relaxed);
    }
}

impl Reader {
    /// Starts the thread. `source` waits at most [`READ_TIMEOUT`] and passes its packets to the
    /// sink. Its errors end the link, except temporary ones.
    pub(crate) fn start(
        name: &str,
        mut source: impl FnMut(&PacketSink) -> io::Result<()> + Send + 'static,
    ) -> io::Result<Reader> {
        let shared = Arc::new(Shared::default());
        let (queue, packets) = sync_channel(QUEUE);
        let sink = PacketSink {
            queue,
            shared: Arc::clone(&shared),
        };
        let thread = std::thread::Builder::new()
            .name(name.into())
            .spawn(move || {
                while !sink.shared.stop.load(Ordering::Relaxed) {
                    match source(&sink) {
                        Err(error) if !is_temporary(&error) => return error,
                        _ => {}
                    }
                }
                ErrorKind::BrokenPipe.into()
            })?;
        Ok(Reader {
            packets,
            shared,
            thread: Some(thread),
        })
    }

    pub(crate) fn recv(&mut self, timeout: Duration) -> io::Result<Option<Vec<u8>>> {
        match self.packets.recv_timeout(timeout) {
            Ok(packet) => Ok(Some(packet)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => {
                let ended = self.thread.take().and_then(|thread| thread.join().ok());
                Err(ended.unwrap_or_else(|| ErrorKind::BrokenPipe.into()))
            }
        }
    }

    /// Packets damaged, or dropped by a full queue or socket.
    pub(crate) fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }
}

/// Whether reading can go on. A refused connection belongs to an earlier datagram to a closed port.
fn is_temporary(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::TimedOut
            | ErrorKind::Interrupted
            | ErrorKind::WouldBlock
            | ErrorKind::ConnectionRefused
    )
}

impl Drop for Reader {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // It ends within a read time-out; its error no longer matters.
            let _ = thread.join();
        }
    }
}
