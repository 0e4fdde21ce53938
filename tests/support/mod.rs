//! A real emulator in a thread, and a client that uses only `skyloop-protocols`.
#![allow(dead_code, reason = "each test program uses its own part of this")]

pub mod client;
pub mod line;

use client::Client;
use line::{Line, MemoryLine, PtyLine, UdpLine};
use skyloop::config::{Clock, Config};
use skyloop::engine::{Emulator, ExposedFrame};
use skyloop::link::{self, Inbound, Observer, Roles, Wire};
use skyloop::metrics::{self, Metrics};
use skyloop::serve::{Ended, Server};
use skyloop::stats::RunStats;
use skyloop_protocols::personality::{NATIVE, Personality};
use skyloop_protocols::{
    Attitude, Command, Counters, Direction, Fault, FaultKind, OrbitState, Output, WireTime,
};
use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longest wait of a test, with a wide margin.
pub const TIMEOUT: Duration = Duration::from_secs(20);

/// 2019-06-15T23:35:50 UTC, the first epoch of the built-in scene.
// X-Val: the worked example of protocols/docs/icd.md, bytes 6-13.
pub const EPOCH: WireTime = WireTime(0x7397_df7b_0000_0000);
/// Attitude at that epoch.
// X-Val: the touchstone of the conventions, RA 248.112 Dec +9.215 degrees.
pub const Q: [f64; 4] = [-0.070834, -0.644137, 0.733522, -0.204975];

/// `s` seconds after `time`.
pub fn later(time: WireTime, s: f64) -> WireTime {
    WireTime(
        time.0
            .wrapping_add_signed((s * 2f64.powi(32)).round() as i64),
    )
}

/// The vehicle at [`EPOCH`], at rest, with CASSIOPE's state.
pub fn attitude(sequence: u32) -> Attitude {
    Attitude {
        sequence,
        q_icrf_to_body: Q,
        rates_rad_s: [0.0; 3],
        // X-Val: the worked example of protocols/docs/icd.md, bytes 76-123.
        state: Some(OrbitState {
            position_m: [-4340768.444, 848975.278, -5362534.303],
            velocity_m_s: [5544.406469, -3022.740430, -4386.550226],
        }),
    }
}

/// An attitude that is refused: its quaternion has no norm.
pub fn bad_attitude(sequence: u32) -> Attitude {
    Attitude {
        q_icrf_to_body: [0.0; 4],
        ..attitude(sequence)
    }
}

/// The wire time of this machine's clock.
pub fn system_time() -> WireTime {
    let since_1970 = std::time::SystemTime::now()
        .duration_since(std::time::UNIX_EPOCH)
        .unwrap();
    // X-Val: 4,383 days from 1958 to 1970 (as in the ICD), and TAI - UTC = 37 s since 2017.
    let tai = since_1970 + Duration::from_secs(4_383 * 86_400 + 37);
    WireTime::from_tai_nanoseconds(tai.as_nanos() as u64).unwrap()
}

/// An emulator with its own threads: others of this process do not wait for its frames.
pub fn emulator(config: &mut Config) -> Emulator {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2);
    let mut emulator = Emulator::new(config);
    emulator.pool = Some(Arc::new(pool.build().unwrap()));
    emulator
}

/// An emulator that serves in a thread of its own.
pub struct Running {
    pub shots: Receiver<ExposedFrame>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Server>>,
    activity: Arc<Activity>,
}

/// What the server does, as its first link observes it.
#[derive(Default)]
struct Activity {
    is_rendering: AtomicBool,
    /// Number of rounds of the server in which no packet waited.
    rounds: AtomicU32,
}

struct Activities(Arc<Activity>);

impl Observer for Activities {
    fn taken(&self, _: &Inbound, _: bool) {}

    fn empty(&self) {
        self.0.rounds.fetch_add(1, Ordering::SeqCst);
    }

    fn making(&self, is: bool) {
        self.0.is_rendering.store(is, Ordering::SeqCst);
    }
}

impl Running {
    /// Runs the emulator of `config` on a link.
    pub fn start(config: Config, clock: Clock, wire: Wire) -> Running {
        Running::at(config, clock, vec![(wire, Roles::ALL)])
    }

    /// Runs the emulator of `config` on several links.
    pub fn at(config: Config, clock: Clock, links: Vec<(Wire, Roles)>) -> Running {
        Running::prepared(config, clock, links, |_| {})
    }

    /// Likewise; `prepare` configures the server before it runs.
    pub fn prepared(
        config: Config,
        clock: Clock,
        links: Vec<(Wire, Roles)>,
        prepare: impl FnOnce(&mut Server) + Send + 'static,
    ) -> Running {
        Running::speaking(&NATIVE, config, clock, links, prepare)
    }

    /// Likewise, with a wire format.
    pub fn speaking(
        personality: &'static Personality,
        mut config: Config,
        clock: Clock,
        mut links: Vec<(Wire, Roles)>,
        prepare: impl FnOnce(&mut Server) + Send + 'static,
    ) -> Running {
        let activity = Arc::new(Activity::default());
        let observer = Box::new(Activities(activity.clone()));
        links[0].0.inbox.observe(observer);
        let stop = Arc::new(AtomicBool::new(false));
        let (to_test, shots) = channel();
        let (ready, is_ready) = channel();
        let stopped = stop.clone();
        let thread = std::thread::spawn(move || {
            let output = config.run.output;
            let emulator = emulator(&mut config);
            let mut server = Server::new(emulator, links, output, clock, personality);
            server.set_run(&config.run);
            prepare(&mut server);
            let _ = ready.send(());
            // The client may disconnect before the run ends.
            let ended = server.run(&stopped, None, |exposed| {
                let _ = to_test.send(exposed.clone());
            });
            assert_ne!(ended, Ended::Panicked);
            server
        });
        // Loading the star catalogue must not count for the time-outs of tests.
        is_ready
            .recv_timeout(TIMEOUT)
            .expect("the emulator is ready");
        Running {
            shots,
            stop,
            thread: Some(thread),
            activity,
        }
    }

    /// Whether a frame is being rendered.
    pub fn is_rendering(&self) -> bool {
        self.activity.is_rendering.load(Ordering::SeqCst)
    }

    /// Waits until the server has done all that is due now: it has completed a round.
    pub fn await_round(&self) {
        let rounds = || self.activity.rounds.load(Ordering::SeqCst);
        let first = rounds();
        await_that("a round of the server", || {
            std::thread::sleep(Duration::from_millis(1));
            rounds().wrapping_sub(first) >= 2
        });
    }

    /// Ends the run as `skyloop run` does and returns its counters.
    pub fn end(self) -> Counters {
        self.measured().1
    }

    /// Ends the run and asserts that its counters have these values.
    #[track_caller]
    pub fn ends_with(self, expected: &[(&str, u32)]) {
        client::counted(&self.end(), expected);
    }

    /// Ends the run and returns its statistics and counters.
    pub fn measured(mut self) -> (RunStats, Counters) {
        self.stop.store(true, Ordering::Relaxed);
        let server = self.thread.take().unwrap().join().expect("no panic");
        server.close()
    }

    /// The next frame that was delivered or abandoned.
    pub fn exposed(&self) -> ExposedFrame {
        self.shots.recv_timeout(TIMEOUT).expect("a frame in time")
    }
}

impl Drop for Running {
    /// Stops the emulator, which must end without an error.
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let Some(thread) = self.thread.take() else {
            return;
        };
        let ended = thread.join();
        if !std::thread::panicking() {
            ended.expect("no panic");
        }
    }
}

/// The built-in scene.
pub fn scene() -> Config {
    Config::builtin().unwrap()
}

/// The built-in scene with a camera of 64 x 64 pixels and 10 ms exposure at `rate_hz`.
pub fn quick(rate_hz: f64) -> Config {
    let mut config = scene();
    config.camera.detector.width = 64;
    config.camera.detector.height = 64;
    config.camera.exposure_s = EXPOSURE_S;
    config.camera.rate_hz = rate_hz;
    config
}

/// Exposure of that camera, s.
pub const EXPOSURE_S: f64 = 0.01;

/// From one time to another, s.
pub fn seconds(from: WireTime, to: WireTime) -> f64 {
    to.0.wrapping_sub(from.0) as i64 as f64 / 2f64.powi(32)
}

pub fn options(idle_s: f64) -> link::Options {
    link::Options {
        idle: Duration::from_secs_f64(idle_s),
        personality: &NATIVE,
        bus: None,
    }
}

/// An emulator of `config` on each of the links with a client's end, by name.
pub fn on_every_link(
    config: fn() -> Config,
    clock: Clock,
) -> Vec<(&'static str, Running, Box<dyn Line>)> {
    let (udp, line) = on_udp(config(), clock, 5.0);
    let (memory, memory_line) = on_memory(config(), clock);
    let (serial, serial_line) = on_serial(config(), clock);
    vec![
        ("udp", udp, Box::new(line)),
        ("memory", memory, Box::new(memory_line)),
        ("serial", serial, Box::new(serial_line)),
    ]
}

/// An emulator at a free UDP port.
pub fn on_udp(config: Config, clock: Clock, idle_s: f64) -> (Running, UdpLine) {
    let wire = link::open("udp://127.0.0.1:0", &options(idle_s)).unwrap();
    let line = UdpLine::to(&wire.address);
    (Running::start(config, clock, wire), line)
}

/// An emulator at the in-process link.
pub fn on_memory(config: Config, clock: Clock) -> (Running, MemoryLine) {
    let (wire, port) = link::loopback("memory", &options(5.0)).unwrap();
    (Running::start(config, clock, wire), MemoryLine(port))
}

/// An emulator at one end of a pseudo-terminal, opened by its path.
pub fn on_serial(config: Config, clock: Clock) -> (Running, PtyLine) {
    let (line, device) = PtyLine::new();
    let wire = link::open(&format!("serial://{device}?baud=921600"), &options(5.0)).unwrap();
    (Running::start(config, clock, wire), line)
}

/// An emulator at the in-process link, and its client.
pub fn memory_client(config: Config, clock: Clock) -> (Running, Client<MemoryLine>) {
    let (emulator, line) = on_memory(config, clock);
    (emulator, Client::new(line))
}

/// An emulator at a free UDP port, and its client.
pub fn udp_client(config: Config, clock: Clock, idle_s: f64) -> (Running, Client<UdpLine>) {
    let (emulator, line) = on_udp(config, clock, idle_s);
    (emulator, Client::new(line))
}

/// An emulator at a pseudo-terminal, and its client.
pub fn serial_client(config: Config, clock: Clock) -> (Running, Client<PtyLine>) {
    let (emulator, line) = on_serial(config, clock);
    (emulator, Client::new(line))
}

/// An emulator with a UDP port for each of these roles, each with a client.
pub fn role_clients<const N: usize>(
    config: Config,
    clock: Clock,
    roles: [&str; N],
    idle_s: f64,
) -> (Running, [Client<UdpLine>; N]) {
    let urls = roles.map(|roles| format!("udp://127.0.0.1:0?roles={roles}"));
    let links = link::open_all(&urls, &options(idle_s)).unwrap();
    let client = |at: usize| Client::new(UdpLine::to(&links[at].0.address));
    let clients = std::array::from_fn(client);
    (Running::at(config, clock, links), clients)
}

/// A link at a new pseudo-terminal, the folder of its name, and the name for clients.
pub fn on_pty(options: &link::Options, baud: u32) -> (Wire, tempfile::TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("tracker").display().to_string();
    let wire = link::open(&format!("pty://{name}?baud={baud}"), options).unwrap();
    (wire, folder, name)
}

/// The built-in scene at this output level.
pub fn scene_at(level: &str) -> Config {
    let mut config = scene();
    config.run.output = Output::preset(level).unwrap();
    config
}

/// A fault for so many seconds; 0: until another command ends it.
pub fn fault(kind: FaultKind, direction: Direction, value: f64, seconds: f64) -> Command {
    Command::Fault(Fault {
        kind,
        direction,
        value,
        seconds,
    })
}

/// The schedule of a fault during the whole run.
pub fn always(direction: &str, kind: &str, value: f64) -> String {
    format!("[[faults]]\ndirection = \"{direction}\"\nkind = \"{kind}\"\nvalue = {value:?}\n")
}

/// Polls until `done`, for at most [`TIMEOUT`].
pub fn await_that(what: &str, mut done: impl FnMut() -> bool) {
    let started = Instant::now();
    while !done() {
        assert!(started.elapsed() < TIMEOUT, "waited too long for: {what}");
    }
}

/// An emulator at `wire` with a page of metrics, and the page's server.
pub fn with_metrics(config: Config, clock: Clock, wire: Wire) -> (Running, metrics::Server) {
    let page = Metrics::default();
    let serving = metrics::serve("0", vec![page.clone()]).unwrap();
    let prepare = |server: &mut Server| server.set_metrics(page);
    let links = vec![(wire, Roles::ALL)];
    (Running::prepared(config, clock, links, prepare), serving)
}

/// The samples of a run's page of metrics by name.
pub fn fetched(from: SocketAddr) -> BTreeMap<String, f64> {
    let mut stream = TcpStream::connect(from).unwrap();
    stream.set_read_timeout(Some(TIMEOUT)).unwrap();
    stream
        .write_all(b"GET /metrics HTTP/1.1\r\nHost: here\r\n\r\n")
        .unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let (head, page) = answer.split_once("\r\n\r\n").unwrap();
    assert!(head.starts_with("HTTP/1.1 200"), "{head}");
    let samples = page.lines().filter(|line| !line.starts_with('#'));
    let sample = |line: &str| {
        let (name, value) = line.rsplit_once(' ').unwrap();
        (name.to_string(), value.parse().unwrap())
    };
    samples.map(sample).collect()
}
