//! Metrics of a run for Prometheus, over HTTP on a separate thread.
//!
//! The run publishes its metrics ten times a second and never waits; a request gets the last ones.
//! By default only this machine can connect. There is no password, and no write access.

mod http;
mod page;
mod text;

use crate::timing::Latencies;
use skyloop_config::metrics_address;
use std::collections::VecDeque;
use std::io;
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{JoinHandle, ScopedJoinHandle};
use std::time::Duration;

/// The metrics of a run at one instant.
#[derive(Debug, Clone, Default)]
pub struct Snapshot {
    frames: u64,
    missed: u64,
    incomplete: u64,
    stages: Vec<Stage>,
    /// Requests for frames of the link.
    pub requested: usize,
    /// Frames of the link whose last packet was sent.
    pub delivered: usize,
    /// Frames of the link that were not sent completely, by cause.
    pub withheld: Vec<(&'static str, usize)>,
    /// The link, if there are several.
    pub link: Option<String>,
    /// Metrics of the other links, without counters and clock.
    pub further: Vec<Snapshot>,
    /// Counters of the run by name, as its `Status` has them: modulo 2^32.
    pub counters: Vec<(&'static str, u32)>,
    /// Age of the last frame's attitude in the middle of its exposure, s.
    pub attitude_age_s: Option<f64>,
    /// First instant, middle and last instant of the last frame's exposure, s since 1970, UTC.
    pub exposure_s: Option<[f64; 3]>,
    /// The client's clock minus this machine's, s.
    pub clock_offset_s: Option<f64>,
    /// Synchronization state, as its code on the wire.
    pub sync: Option<u8>,
    /// Time from the last frame's end to its deadline, s; below 0: late.
    pub deadline_spare_s: Option<f64>,
}

/// Histogram of one stage: counts within each of [`BOUNDS`], total count, and sum.
#[derive(Debug, Clone)]
struct Stage {
    name: &'static str,
    within: [u64; BOUNDS.len()],
    count: u64,
    sum: Duration,
}

/// Upper bounds of the buckets, and how they are written (s).
const BOUNDS: [(Duration, &str); 16] = [
    (Duration::from_micros(100), "0.0001"),
    (Duration::from_micros(200), "0.0002"),
    (Duration::from_micros(500), "0.0005"),
    (Duration::from_millis(1), "0.001"),
    (Duration::from_millis(2), "0.002"),
    (Duration::from_millis(5), "0.005"),
    (Duration::from_millis(10), "0.01"),
    (Duration::from_millis(20), "0.02"),
    (Duration::from_millis(50), "0.05"),
    (Duration::from_millis(100), "0.1"),
    (Duration::from_millis(200), "0.2"),
    (Duration::from_millis(500), "0.5"),
    (Duration::from_secs(1), "1"),
    (Duration::from_secs(2), "2"),
    (Duration::from_secs(5), "5"),
    (Duration::from_secs(10), "10"),
];

impl Snapshot {
    /// The metrics of the frames so far. The caller adds counters and the last frame.
    #[must_use]
    pub fn of(latencies: &Latencies) -> Self {
        let stages = latencies.stages().map(|(name, times)| Stage {
            name,
            within: BOUNDS.map(|(bound, _)| times.within(bound)),
            count: times.count(),
            sum: times.sum(),
        });
        Self {
            frames: latencies.frames,
            missed: latencies.missed,
            incomplete: latencies.incomplete,
            stages: stages.into(),
            ..Self::default()
        }
    }
}

/// Where a camera publishes its metrics; clones share it.
#[derive(Debug, Clone, Default)]
pub struct Metrics {
    /// Name of a further camera.
    head: Option<Arc<str>>,
    slot: Arc<Mutex<Arc<Snapshot>>>,
}

impl Metrics {
    /// Metrics of a further camera.
    #[must_use]
    pub fn of_head(name: &str) -> Self {
        Self {
            head: Some(name.into()),
            ..Self::default()
        }
    }

    /// Publishes a snapshot, unless the previous one is being read.
    pub fn publish(&self, snapshot: Snapshot) {
        let snapshot = Arc::new(snapshot);
        // A real-time thread does not wait for others.
        if let Ok(mut slot) = self.slot.try_lock() {
            *slot = snapshot;
        }
    }

    fn last(&self) -> Arc<Snapshot> {
        match self.slot.lock() {
            Ok(slot) => Arc::clone(&slot),
            // The lock guards only an assignment, so the value is valid after a panic, too.
            Err(poisoned) => Arc::clone(&poisoned.into_inner()),
        }
    }
}

/// Maximum number of connections. One more replaces the oldest, preferably one without a request.
const MAX_CONNECTIONS: usize = 32;
/// Threads at most: those of closed connections take a moment to end.
const MAX_THREADS: usize = 2 * MAX_CONNECTIONS;
/// Interval at which the thread checks for connections and for `stop`.
const POLL: Duration = Duration::from_millis(50);
/// Wait for threads of closed connections.
const THREAD_END_WAIT: Duration = Duration::from_millis(1);

/// The HTTP thread; dropping this value ends it.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Its address, with the actual port if 0 was requested.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // The thread has ended, even if it panicked.
            let _ = thread.join();
        }
    }
}

/// Serves the metrics of all `cameras` at `http://ADDRESS/metrics`; `address` is `127.0.0.1:9464`,
/// `[::1]:9464`, or a port alone, on 127.0.0.1.
///
/// Each of at most 32 connections has a thread; one more closes the oldest, so that idle
/// connections block no request. Errors: `address` is invalid, or the system refuses it, with the
/// remedy.
pub fn serve(address: &str, cameras: Vec<Metrics>) -> io::Result<Server> {
    let refused =
        |kind, why: String| Err(io::Error::new(kind, format!("metrics at {address}: {why}")));
    let Some(requested) = metrics_address(address) else {
        let why = "not an address: write for example 127.0.0.1:9464, or a port alone";
        return refused(io::ErrorKind::InvalidInput, why.to_string());
    };
    let listener = match TcpListener::bind(requested) {
        Ok(listener) => listener,
        Err(error) => return refused(error.kind(), format!("{error}; {}", remedy(error.kind()))),
    };
    // Non-blocking, so that the thread can check `stop`.
    listener.set_nonblocking(true)?;
    let address = listener.local_addr()?;
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    let thread = std::thread::Builder::new().name("metrics".to_string());
    let thread = thread.spawn(move || answer_all(&listener, &cameras, &stopped))?;
    Ok(Server {
        address,
        stop,
        thread: Some(thread),
    })
}

fn remedy(kind: io::ErrorKind) -> &'static str {
    match kind {
        io::ErrorKind::AddrInUse => "choose another port, or 0 for a free one",
        io::ErrorKind::PermissionDenied => "choose a port from 1024 on",
        _ => "choose an address of this machine, such as 127.0.0.1:9464",
    }
}

/// Answers connections until `stop` is set.
fn answer_all(listener: &TcpListener, cameras: &[Metrics], stop: &AtomicBool) {
    let page = || {
        let snapshots = cameras
            .iter()
            .map(|camera| (camera.head.clone(), camera.last()));
        text::page(&snapshots.collect::<Vec<_>>())
    };
    let page = &page;
    let mut open: VecDeque<Connection> = VecDeque::new();
    std::thread::scope(|scope| {
        let mut threads = Vec::new();
        while !stop.load(Ordering::Relaxed) {
            threads.retain(|thread: &ScopedJoinHandle<'_, ()>| !thread.is_finished());
            if threads.len() >= MAX_THREADS {
                std::thread::sleep(THREAD_END_WAIT);
                continue;
            }
            let stream = match listener.accept() {
                Ok((stream, _)) => stream,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    wait_for_connection(listener);
                    continue;
                }
                // The client has gone, or the system lacks resources.
                Err(_) => {
                    std::thread::sleep(POLL);
                    continue;
                }
            };
            open.retain(|connection| !connection.state.is_over());
            if open.len() >= MAX_CONNECTIONS {
                let silent = open.iter().position(|one| !one.state.has_requested());
                let oldest = open.remove(silent.unwrap_or(0));
                oldest.into_iter().for_each(Connection::close);
            }
            // Without a handle or a thread the connection is closed.
            let Ok(connection) = Connection::of(&stream) else {
                continue;
            };
            let state = Arc::clone(&connection.state);
            let answer = move || {
                // The client may close early.
                let _ = http::answer(stream, page, &state);
                state.end();
            };
            if let Ok(thread) = std::thread::Builder::new().spawn_scoped(scope, answer) {
                threads.push(thread);
                open.push_back(connection);
            }
        }
        open.into_iter().for_each(Connection::close);
    });
}

/// Waits for a connection, at most [`POLL`]. The system queues 128; further ones retry after 1 s.
#[cfg(target_os = "linux")]
fn wait_for_connection(listener: &TcpListener) {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let wait = Timespec {
        tv_sec: 0,
        tv_nsec: i64::from(POLL.subsec_nanos()),
    };
    if poll(&mut [PollFd::new(listener, PollFlags::IN)], Some(&wait)).is_err() {
        std::thread::sleep(POLL);
    }
}

#[cfg(not(target_os = "linux"))]
fn wait_for_connection(_: &TcpListener) {
    std::thread::sleep(POLL);
}

struct Connection {
    /// A second handle, to close the connection while its thread waits.
    stream: TcpStream,
    state: Arc<http::State>,
}

impl Connection {
    fn of(stream: &TcpStream) -> io::Result<Self> {
        Ok(Self {
            stream: stream.try_clone()?,
            state: Arc::default(),
        })
    }

    /// Closes the connection at once, and wakes its thread.
    fn close(self) {
        self.state.end();
        // The other end may have closed it.
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn address_defaults_to_this_machine() {
        for (text, expected) in [
            ("9464", Some("127.0.0.1:9464")),
            ("0.0.0.0:80", Some("0.0.0.0:80")),
            ("[::1]:9", Some("[::1]:9")),
            ("65536", None),
            ("", None),
            ("localhost:9464", None),
            ("127.0.0.1", None),
        ] {
            let found = metrics_address(text).map(|address| address.to_string());
            assert_eq!(found.as_deref(), expected, "{text}");
        }
    }

    #[test]
    fn refused_address_is_reported_with_the_remedy() {
        let first = serve("0", Vec::new()).unwrap();
        let address = first.address().to_string();
        let error = serve(&address, Vec::new()).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::AddrInUse);
        let text = error.to_string();
        assert!(
            text.contains(&address) && text.contains("another port"),
            "{text}"
        );
        // X-Val: RFC 5737: addresses for documentation, which no machine has.
        for (wrong, word) in [
            ("nowhere", "not an address"),
            ("192.0.2.1:80", "of this machine"),
        ] {
            let text = serve(wrong, Vec::new()).unwrap_err().to_string();
            assert!(text.contains(wrong) && text.contains(word), "{text}");
        }
        // Dropping the handle frees the address.
        drop(first);
        assert!(serve(&address, Vec::new()).is_ok());
    }

    #[test]
    fn publishing_does_not_wait_for_readers() {
        let metrics = Metrics::default();
        let snapshot = |frames| Snapshot {
            frames,
            ..Snapshot::default()
        };
        metrics.publish(snapshot(1));
        let fetching = metrics.slot.lock().unwrap();
        metrics.publish(snapshot(2));
        drop(fetching);
        assert_eq!(metrics.last().frames, 1);
        metrics.clone().publish(snapshot(3));
        assert_eq!(metrics.last().frames, 3);
    }
}
