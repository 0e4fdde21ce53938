//! Recordings of the packets that the emulator receives and sends, with times. A thread writes the
//! file, so a slow disk does not delay the run. No packet is omitted.

mod bus;
pub mod candump;
mod difference;
mod origin;
pub mod pcapng;
mod place;
mod recording;
pub mod replay;
mod silence;

use super::error::LinkError;
use super::inbox::{Inbound, Observer};
use super::outbox::{Outbound, Outbox};
use super::wire::{Closed, Wire};
pub use origin::Origin;
use skyloop_orbit::path_text;
use skyloop_orbit::{Mark, NO_MARK, OutputFile};
use skyloop_protocols::can::CanFrame;
use skyloop_protocols::{Direction, FaultKind};
use std::borrow::Cow;
use std::collections::VecDeque;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use thiserror::Error;

/// One packet, or CAN frame, of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Record<P> {
    /// Time of arrival or of queueing to the link, since 1970.
    pub at: Duration,
    /// Towards the emulator or from it.
    pub direction: Direction,
    /// Index of the link in the run.
    pub link: u32,
    /// Number of its exchange.
    pub exchange: u32,
    /// Whether a poll found the queue empty before this packet. The emulator may have done other
    /// work in between.
    pub first: bool,
    /// Number of frames rendered before the emulator took this packet (inbound only). `None`: not
    /// recorded; a replay assumes that no frame was being rendered.
    pub made: Option<u32>,
    /// The packet, or the frame.
    pub item: P,
}

impl<P> Record<P> {
    /// A record of link 0 and exchange 0, without data on frames and polls.
    fn plain(at: Duration, direction: Direction, item: P) -> Record<P> {
        Record {
            at,
            direction,
            link: 0,
            exchange: 0,
            first: false,
            made: None,
            item,
        }
    }
}

/// Mark of a packet recording: section header and program name of pcapng. CAN logs have none.
const MARK: Mark = &["\n\r\r\n", "skyloop "];
/// Maximum number of records in the queue; beyond it the run waits.
const QUEUE: usize = 4096;
/// Interval of flushes to the file.
const FLUSH: Duration = Duration::from_secs(1);

/// Why a recording failed or is incomplete.
#[derive(Debug, Error)]
pub enum CaptureError {
    /// The file cannot be created.
    #[error("--capture {file}: {source}{}", remedy_of(source))]
    Create {
        /// As given.
        file: String,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The file could not be written to its end.
    #[error(
        "capture {file}: {source}: the recording is incomplete, {lost} of its records are missing; make room and run again"
    )]
    Write {
        /// As given.
        file: String,
        /// Error of the system.
        source: std::io::Error,
        /// Records that were not written.
        lost: u64,
    },
    /// The file cannot be read.
    #[error("{file}: {source}; check the path")]
    Read {
        /// As given.
        file: String,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The file is not a recording.
    #[error("{file}: {reason}")]
    Format {
        /// As given.
        file: String,
        /// Position and problem.
        reason: String,
    },
}

/// Remedy for an output file that cannot be opened; skyloop's own refusals contain theirs.
pub fn remedy_of(error: &std::io::Error) -> &'static str {
    match error.kind() {
        std::io::ErrorKind::InvalidInput => "",
        _ => "; check that its folder exists, may be written and has room",
    }
}

/// A recording in progress.
pub struct Capture {
    queue: SyncSender<Message>,
    thread: Option<JoinHandle<Result<u64, CaptureError>>>,
    clock: WallTime,
    file: OutputFile,
    name: String,
    /// The links of a packet recording; `None` for CAN frames.
    links: Option<Vec<String>>,
}

/// A message to the writing thread.
enum Message {
    /// One record in the file's format.
    Record(Vec<u8>),
    /// The run has ended.
    End,
}

/// Converts instants to wall clock time. Does not jump when the wall clock is set.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WallTime {
    zero: Instant,
    unix: Duration,
}

impl WallTime {
    /// Reads the wall clock once, now.
    pub fn now() -> WallTime {
        WallTime {
            zero: Instant::now(),
            unix: SystemTime::now()
                .duration_since(UNIX_EPOCH)
                .unwrap_or_default(),
        }
    }

    /// Time of `instant` since 1970.
    pub fn of(&self, instant: Instant) -> Duration {
        match instant.checked_duration_since(self.zero) {
            Some(since) => self.unix + since,
            None => self.unix.saturating_sub(self.zero - instant),
        }
    }
}

impl Capture {
    /// Opens `file` for a recording; only [`Capture::begin`] replaces its contents. `force` allows
    /// a file that skyloop did not write.
    fn create(
        file: &Path,
        force: bool,
        links: Option<Vec<String>>,
    ) -> Result<Capture, CaptureError> {
        let name = path_text(file);
        let failed = |source| CaptureError::Create {
            file: name.clone(),
            source,
        };
        let mark = if links.is_some() { MARK } else { NO_MARK };
        let output = OutputFile::open(file, mark, force).map_err(failed)?;
        let to = output.file().map_err(failed)?;
        let (queue, records) = sync_channel(QUEUE);
        let thread = std::thread::Builder::new()
            .name("capture".to_string())
            .spawn({
                let name = name.clone();
                move || write(name, to, &records)
            })
            .map_err(failed)?;
        Ok(Capture {
            queue,
            thread: Some(thread),
            clock: WallTime::now(),
            file: output,
            name,
            links,
        })
    }

    /// Records packets of these links in `file` (pcapng).
    pub fn packets(file: &Path, force: bool, links: &[String]) -> Result<Capture, CaptureError> {
        Capture::create(file, force, Some(links.to_vec()))
    }

    /// Records CAN frames in `file` (candump log format); the [`Recorder`] receives them.
    pub fn frames(file: &Path, force: bool) -> Result<Capture, CaptureError> {
        Capture::create(file, force, None)
    }

    /// Begins the recording and replaces the file. A packet recording starts with `origin`; the
    /// candump format has no field for it.
    pub fn begin(&mut self, origin: &Origin) -> Result<(), CaptureError> {
        let links = self.links.as_ref();
        let head = links.map(|links| pcapng::head(links, &origin.to_lines()));
        let begun = self.file.write(&head.unwrap_or_default());
        begun.map_err(|source| CaptureError::Create {
            file: self.name.clone(),
            source,
        })
    }

    /// A handle for another thread to add records.
    pub fn recorder(&self) -> Recorder {
        Recorder {
            queue: self.queue.clone(),
            clock: self.clock,
        }
    }

    /// Records the packets of `wire` in both directions, as link number `link`.
    pub fn tap(&self, wire: &mut Wire, link: u32) {
        wire.inbox.observe(Box::new(Tap {
            link,
            made: AtomicU32::new(0),
            recorder: self.recorder(),
        }));
        let to = std::mem::replace(&mut wire.outbox, Box::new(Closed));
        wire.outbox = Box::new(TappedOutbox {
            to,
            link,
            recorder: self.recorder(),
        });
    }

    /// Ends the recording; returns its number of records.
    pub fn finish(mut self) -> Result<u64, CaptureError> {
        // A thread that has ended returns its error below.
        let _ = self.queue.send(Message::End);
        let ended = self.thread.take().map(JoinHandle::join);
        let ended = ended.and_then(Result::ok).unwrap_or(Ok(0));
        if ended.is_err() {
            self.file.discard_empty();
        }
        ended
    }
}

/// Adds records to a recording.
#[derive(Clone)]
pub struct Recorder {
    queue: SyncSender<Message>,
    clock: WallTime,
}

impl Recorder {
    /// Records one line of a log of CAN frames.
    pub(crate) fn frame(&self, instant: Instant, direction: Direction, frame: &CanFrame) {
        let record = Record::plain(self.clock.of(instant), direction, *frame);
        self.send(candump::line(&record).into_bytes());
    }

    fn send(&self, record: Vec<u8>) {
        // The writer runs until the recording ends.
        let _ = self.queue.send(Message::Record(record));
    }
}

/// Records the packets received over one link.
struct Tap {
    link: u32,
    /// Frames rendered so far.
    made: AtomicU32,
    recorder: Recorder,
}

impl Observer for Tap {
    fn taken(&self, inbound: &Inbound, first: bool) {
        self.recorder.send(pcapng::block(&Record {
            at: self.recorder.clock.of(inbound.arrived),
            direction: Direction::In,
            link: self.link,
            exchange: inbound.exchange,
            first,
            made: Some(self.made.load(Ordering::Relaxed)),
            item: inbound.packet.clone(),
        }));
    }

    fn making(&self, is: bool) {
        self.made.fetch_add(u32::from(!is), Ordering::Relaxed);
    }
}

/// Forwards to an outbox and records the accepted packets.
struct TappedOutbox {
    to: Box<dyn Outbox>,
    link: u32,
    recorder: Recorder,
}

impl Outbox for TappedOutbox {
    fn offer(&mut self, what: Outbound) -> Result<Option<Outbound>, LinkError> {
        let packet = match &what {
            Outbound::Packet { exchange, packet } => Some((*exchange, packet.clone())),
            Outbound::Release { .. } => None,
        };
        let at = self.recorder.clock.of(Instant::now());
        let back = self.to.offer(what)?;
        if let (None, Some((exchange, item))) = (&back, packet) {
            self.recorder.send(pcapng::block(&Record {
                link: self.link,
                exchange,
                ..Record::plain(at, Direction::Out, item)
            }));
        }
        Ok(back)
    }

    fn injects(&self, kind: FaultKind) -> Result<(), Cow<'static, str>> {
        self.to.injects(kind)
    }
}

/// Counts the written bytes.
struct Counted<W> {
    to: W,
    bytes: u64,
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.to.write(bytes)?;
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.to.flush()
    }
}

/// Writes records until the end. After an error the rest are only counted; the run continues.
fn write(file: String, to: impl Write, records: &Receiver<Message>) -> Result<u64, CaptureError> {
    let mut to = BufWriter::with_capacity(1 << 16, Counted { to, bytes: 0 });
    // End offsets of the incompletely written records, and of the last record.
    let (mut ends, mut end) = (VecDeque::new(), 0);
    let (mut taken, mut failed) = (0, None);
    let mut flushed = Instant::now();
    loop {
        let mut done = Ok(());
        let mut is_over = false;
        match records.recv_timeout(FLUSH) {
            Ok(Message::Record(record)) => {
                taken += 1;
                end += record.len() as u64;
                if failed.is_none() {
                    ends.push_back(end);
                    done = to.write_all(&record);
                }
            }
            Ok(Message::End) | Err(RecvTimeoutError::Disconnected) => is_over = true,
            Err(RecvTimeoutError::Timeout) => {}
        }
        if failed.is_none() && done.is_ok() && (is_over || flushed.elapsed() >= FLUSH) {
            done = to.flush();
            flushed = Instant::now();
        }
        let written = to.get_ref().bytes;
        while ends.front().is_some_and(|end| *end <= written) {
            ends.pop_front();
        }
        if let Err(error) = done {
            tracing::warn!(
                "cannot write the capture to {file} any more ({error}): the run continues without it"
            );
            failed = Some((error, taken - ends.len() as u64));
        }
        if is_over {
            // Dropping `to` would retry the unwritten bytes.
            let _ = to.into_parts();
            return match failed {
                None => Ok(taken),
                Some((source, written)) => Err(CaptureError::Write {
                    file,
                    source,
                    lost: taken - written,
                }),
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A disk with room for `0` bytes.
    struct Disk(usize);

    impl Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            let room = bytes.len().min(self.0);
            if room == 0 {
                return Err(std::io::ErrorKind::StorageFull.into());
            }
            self.0 -= room;
            Ok(room)
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn full_disk_is_reported_at_the_end() {
        let (queue, records) = sync_channel(QUEUE);
        for _ in 0..10 {
            queue.send(Message::Record(vec![0; 100])).unwrap();
        }
        drop(queue);
        let error = write("run.pcapng".into(), Disk(450), &records).unwrap_err();
        let text = error.to_string();
        for word in ["run.pcapng", "6 of its records", "make room"] {
            assert!(text.contains(word), "no {word:?} in {text}");
        }
    }

    #[test]
    fn wall_time_converts_instants_before_and_after_its_zero() {
        let clock = WallTime::now();
        let second = Duration::from_secs(1);
        let later = clock.of(clock.zero + second);
        assert_eq!(later - clock.of(clock.zero), second);
        assert_eq!(clock.of(clock.zero - second) + second, clock.unix);
    }
}
