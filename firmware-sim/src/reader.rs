//! A thread that reads packets as they come, and the bounded queue that they wait in.
//!
//! It reads on while the flight computer thinks, so that neither a socket's buffer nor a UART's ever fills up; and to
//! wait for a queue is precise to some 0.1 ms, where a socket's time-out goes by the system's ticks of up to 10 ms.

use std::io::{self, ErrorKind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Packets that the queue holds: many credit windows.
const QUEUE: usize = 1024;
/// How long a source may wait before the thread looks whether it should end.
pub(crate) const READ_TIMEOUT: Duration = Duration::from_millis(20);

/// The queue's end that the flight computer holds.
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

/// The queue's end that the thread holds.
pub(crate) struct Intake {
    queue: SyncSender<Vec<u8>>,
    shared: Arc<Shared>,
}

impl Intake {
    /// Queues a packet; drops and counts it if the queue is full.
    pub(crate) fn take(&self, packet: &[u8]) {
        // Once the flight computer has gone, the thread is about to be stopped.
        if let Err(TrySendError::Full(_)) = self.queue.try_send(packet.to_vec()) {
            self.lose(1);
        }
    }

    /// Counts packets that came damaged, or not at all.
    pub(crate) fn lose(&self, packets: u32) {
        let dropped = &self.shared.dropped;
        dropped.fetch_add(packets.into(), Ordering::Relaxed);
    }
}

impl Reader {
    /// Starts the thread. `source` waits for what comes, [`READ_TIMEOUT`] at most, and gives it to the intake; its
    /// errors end the link, but for those that pass.
    pub(crate) fn start(
        name: &str,
        mut source: impl FnMut(&Intake) -> io::Result<()> + Send + 'static,
    ) -> io::Result<Reader> {
        let shared = Arc::new(Shared::default());
        let (queue, packets) = sync_channel(QUEUE);
        let intake = Intake {
            queue,
            shared: Arc::clone(&shared),
        };
        let thread = std::thread::Builder::new()
            .name(name.into())
            .spawn(move || {
                while !intake.shared.stop.load(Ordering::Relaxed) {
                    match source(&intake) {
                        Err(error) if !is_passing(&error) => return error,
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

    /// The next packet; none within `timeout`.
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

    /// Packets that came damaged, or found no room in the queue or the socket.
    pub(crate) fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }
}

/// Whether reading may go on after it. A refused connection answers an earlier datagram that met nobody.
fn is_passing(error: &io::Error) -> bool {
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
            // It ends within a read time-out; how it ended does not matter any more.
            let _ = thread.join();
        }
    }
}
