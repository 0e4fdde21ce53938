//! The table `[run]`: links, clock and limits of a live run.

use super::fidelity;
use crate::realtime::Requested;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};
use skyloop_base::load::Allowed::{Count, Form, Number, Word};
use skyloop_base::load::{Check, ConfigError, END, Limit, TextOrList, one_of, word};
use skyloop_link::{self as link, LINKS};
use skyloop_protocols::Output;
use skyloop_protocols::output::MAX_WINDOW;
use skyloop_render::fidelity::Coarser;
use std::net::{Ipv4Addr, SocketAddr};
use std::ops::RangeInclusive;
use std::time::Duration;

/// Links, clock and limits of a live run.
#[derive(Debug, Clone)]
pub struct Run {
    /// Links, as URLs.
    pub links: Vec<String>,
    /// Content of frames until a client changes it.
    pub output: Output,
    /// Source of the time.
    pub clock: Clock,
    /// Source of triggers.
    pub trigger: Trigger,
    /// Silence (s) of a client after which another may take over its exchange.
    pub idle_s: f64,
    /// Deadline: time (s) from the end of the exposure until the frame has left; default: one
    /// period of the camera.
    pub latency_s: Option<f64>,
    /// Delay of the device.
    pub delay: Delay,
    /// Action if a frame would miss its deadline.
    pub on_overrun: OnOverrun,
    /// Steps of coarser rendering.
    pub coarsen: Vec<Coarser>,
    /// Limit of the work on a frame, s of one core per megapixel; smaller frames count as one
    /// megapixel.
    pub work_limit_s: f64,
    /// Use of old attitudes.
    pub staleness: Staleness,
    /// Use of attitudes earlier than the last one.
    pub out_of_order: OutOfOrder,
    /// Silence (s) of the client after which the external clock no longer follows it.
    pub holdover_s: f64,
    /// Address for metrics, if any.
    pub metrics: Option<String>,
    /// Real-time settings.
    pub realtime: Requested,
}

/// Action if a frame would miss its deadline (wall and external clock).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum OnOverrun {
    /// Send it late.
    #[default]
    Late,
    /// Send no frame.
    Drop,
    /// Render with larger tolerances.
    Coarsen,
}

/// Source of the time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Clock {
    /// One frame for each attitude or trigger, at its time.
    Stepped,
    /// Frames at the camera's rate, by this machine's clock.
    Wall,
    /// Frames at the camera's rate, or at triggers, by the client's clock.
    External,
}

/// Source of triggers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Trigger {
    /// An attitude (stepped), or the camera's rate.
    #[default]
    Own,
    /// Trigger packets.
    Packet,
}

/// Delay of the device.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Delay {
    /// Shortest time from the end of the exposure to the first packet, s.
    pub delay_s: f64,
    /// Random addition, uniform from 0 to this for each frame, s.
    pub jitter_s: f64,
}

/// Limit of an attitude's age, and the action beyond it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Staleness {
    /// Age in the middle of an exposure above which an attitude is stale, s.
    pub limit_s: f64,
    /// Action if it is stale.
    pub then: OnStale,
}

/// Action if an attitude is stale. Labels and packets report it in any case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum OnStale {
    /// Propagate by its rates.
    #[default]
    Extrapolate,
    /// Stop the body at the limit.
    Hold,
    /// Stop the body at the limit, and mark the frame as invalid.
    Invalid,
}

/// Action for an attitude earlier than the last one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum OutOfOrder {
    /// Reject it.
    #[default]
    Refuse,
    /// Use it for exposures between others.
    Use,
}

impl Default for Run {
    fn default() -> Run {
        let raw = RawRun::default();
        Run {
            links: vec![DEFAULT_LINK.to_string()],
            output: Output::default(),
            clock: raw.clock,
            trigger: raw.trigger,
            idle_s: raw.idle_s,
            latency_s: raw.latency_s,
            delay: Delay::default(),
            on_overrun: raw.on_overrun,
            coarsen: Vec::new(),
            work_limit_s: raw.work_limit_s,
            staleness: Staleness {
                limit_s: raw.stale_s,
                then: raw.on_stale,
            },
            out_of_order: raw.out_of_order,
            holdover_s: raw.holdover_s,
            metrics: None,
            realtime: Requested::default(),
        }
    }
}

impl Run {
    /// Keys that are set but have no effect with the stepped clock.
    pub fn idle_in_step(&self) -> Vec<&'static str> {
        let set = [
            (self.delay.delay_s > 0.0, "run.delay_s"),
            (self.delay.jitter_s > 0.0, "run.jitter_s"),
            (self.latency_s.is_some(), "run.latency_s"),
            (self.on_overrun != OnOverrun::default(), "run.on_overrun"),
        ];
        let idle = set.into_iter().filter(|(is_set, _)| *is_set);
        idle.map(|(_, name)| name).collect()
    }
}

impl Delay {
    /// Earliest time from the end of the exposure until a frame leaves, for a camera (0 is the
    /// first). It is the same for the same frame in every run.
    pub fn of(&self, camera: u32, frame: u32) -> Duration {
        // SplitMix64 (Steele, Lea and Flood 2014) of both numbers.
        let mut word = (u64::from(camera) << 32 | u64::from(frame))
            .wrapping_add(1)
            .wrapping_mul(0x9E37_79B9_7F4A_7C15);
        word = (word ^ word >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        word = (word ^ word >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        let share = ((word ^ word >> 31) >> 11) as f64 / (1u64 << 53) as f64;
        Duration::from_secs_f64(self.delay_s + self.jitter_s * share)
    }
}

/// Priorities of SCHED_FIFO, see sched(7).
const PRIORITIES: RangeInclusive<f64> = 1.0..=99.0;

pub(super) const LIMITS: &[Limit] = &[
    ("run.latency_s", Number(1e-6..=1e6)),
    ("run.idle_s", Number(0.0..=1e6)),
    ("run.delay_s", Number(0.0..=60.0)),
    ("run.jitter_s", Number(0.0..=60.0)),
    ("run.work_limit_s", Number(0.01..=1e6)),
    ("run.stale_s", Number(0.0..=1e6)),
    ("run.holdover_s", Number(1e-3..=1e6)),
    ("run.window_px", Number(1.0..=MAX_WINDOW as f64)),
    ("run.priority", Number(PRIORITIES)),
    ("run.cpus[]", Number(0.0..=u32::MAX as f64)),
    ("run.coarsen", Count(1..=usize::MAX)),
    ("run.coarsen[]", Form(fidelity::step_form)),
    ("run.link", Count(1..=usize::MAX)),
    ("run.link", Form(link_form)),
    ("run.link[]", Form(link_form)),
    ("run.metrics", Form(metrics_form)),
    ("run.output", Word(levels)),
];

/// URLs of links. Targets and options are checked when the link is opened.
pub(super) fn link_form() -> String {
    let schemes: Vec<&str> = LINKS.iter().map(|link| link.scheme).collect();
    format!("^({})://", schemes.join("|"))
}

/// A port, or an address and a port.
fn metrics_form() -> String {
    let port = "0*(6553[0-5]|655[0-2][0-9]|65[0-4][0-9]{2}|6[0-4][0-9]{3}|[1-5]?[0-9]{1,4})";
    let part = "(25[0-5]|2[0-4][0-9]|1[0-9]{2}|[1-9]?[0-9])";
    // `::` replaces one or more of eight groups (RFC 4291, 2.2).
    let group = "[0-9A-Fa-f]{1,4}";
    let mut groups = vec![
        format!("({group}:){{7}}{group}"),
        format!("({group}:){{1,7}}:"),
        format!(":((:{group}){{1,7}}|:)"),
    ];
    groups
        .extend((1..=6).map(|rest| format!("({group}:){{1,{}}}(:{group}){{1,{rest}}}", 7 - rest)));
    let groups = groups.join("|");
    format!(r"^({port}|{part}(\.{part}){{3}}:{port}|\[({groups})\]:{port}){END}")
}

/// The address of `run.metrics`. IPv6 addresses have no zone and no IPv4 part. A port alone is a
/// port of 127.0.0.1.
pub fn metrics_address(text: &str) -> Option<SocketAddr> {
    if text.contains(['+', '%']) || (text.starts_with('[') && text.contains('.')) {
        return None;
    }
    let port = |port| SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    let given = text.parse::<u16>().map(port);
    given.or_else(|_| text.parse()).ok()
}

fn levels() -> Vec<&'static str> {
    Output::PRESETS.map(|(name, ..)| name).to_vec()
}

const DEFAULT_LINK: &str = "udp://127.0.0.1:4810";

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RawRun {
    /// Link to the flight computer, or a list of links with roles
    link: OneOrMore,
    /// Content of frames until a client changes it. frame: pixels and label text; compressed:
    /// compressed pixels and label text; windows: windows and objects; labels: only objects
    output: String,
    /// Number of windows, around the brightest stars
    windows: u8,
    /// Width and height of a window, px
    window_px: u8,
    /// Number of objects in Objects packets, the brightest
    objects: u16,
    /// stepped: one frame for each attitude; wall: the camera's rate by this machine's clock;
    /// external: the camera's rate by the client's clock, as estimated from its attitudes
    #[serde(deserialize_with = "word")]
    clock: Clock,
    /// Source of triggers. own: an attitude, or the camera's rate; packet: Trigger packets (stepped
    /// and external)
    #[serde(deserialize_with = "word")]
    trigger: Trigger,
    /// Silence of the client after which another client may take over, s
    idle_s: f64,
    /// Deadline: time from the end of the exposure until the whole frame has left, s; default: one
    /// period of the camera
    latency_s: Option<f64>,
    /// Delay of the device: shortest time from the end of the exposure to the first packet, s
    /// (wall, external)
    delay_s: f64,
    /// Random addition to delay_s, uniform from 0 to this for each frame, s
    jitter_s: f64,
    /// If a frame would miss its deadline. late: send it late; drop: send no frame; coarsen: render
    /// with larger tolerances
    #[serde(deserialize_with = "word")]
    on_overrun: OnOverrun,
    /// Steps of coarsen, applied until the frame is in time: presets, or keys of fidelity such as
    /// "wing_e = 0.5"; no step makes a tolerance smaller
    coarsen: Vec<String>,
    /// Limit of the estimated work on a frame, s of one core per megapixel; smaller frames count as
    /// one megapixel
    work_limit_s: f64,
    /// Age above which an attitude is stale in the middle of an exposure, s; one that lies further
    /// ahead counts as future
    stale_s: f64,
    /// If the attitude is stale. extrapolate: propagate by its rates; hold: stop the body at the
    /// limit; invalid: stop it and mark the frame
    #[serde(deserialize_with = "word")]
    on_stale: OnStale,
    /// Attitudes earlier than the last one. refuse: reject them; use: use them for exposures
    /// between others
    #[serde(deserialize_with = "word")]
    out_of_order: OutOfOrder,
    /// Silence of the client after which its clock is no longer followed, s (external)
    holdover_s: f64,
    /// Address for Prometheus metrics, such as "127.0.0.1:9464"
    metrics: Option<String>,
    /// Real-time priority (SCHED_FIFO) of the emulator's threads; the log reports whether it was
    /// granted
    priority: Option<i64>,
    /// Lock the process in memory (mlockall); the log reports whether it was granted
    lock_memory: bool,
    /// Processors to run on, such as [0, 1]; an empty list is all
    cpus: Vec<i64>,
}

/// One text, or an array of them.
#[derive(JsonSchema)]
#[schemars(untagged)]
pub(super) enum OneOrMore {
    One(String),
    More(Vec<String>),
}

impl<'de> Deserialize<'de> for OneOrMore {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(TextOrList {
            expected: "a link or a list of links, such as \"udp://127.0.0.1:4810\"",
            text: OneOrMore::One,
            number: None,
            list: OneOrMore::More,
        })
    }
}

impl OneOrMore {
    pub(super) fn validate(self, key: &str, check: &Check) -> Result<Vec<String>, ConfigError> {
        let of_scheme = |key: &str, link: &str| {
            let checked = link::check_scheme(link);
            checked.map_err(|error| check.explain(key, error))
        };
        match self {
            OneOrMore::One(link) => of_scheme(key, &link).map(|()| vec![link]),
            OneOrMore::More(links) if links.is_empty() => {
                Err(check.refuse(key, "[]", "at least one link"))
            }
            OneOrMore::More(links) => {
                let mut all = links.iter().enumerate();
                all.try_for_each(|(i, link)| of_scheme(&format!("{key}[{i}]"), link))?;
                Ok(links)
            }
        }
    }
}

impl Default for RawRun {
    fn default() -> Self {
        let output = Output::default();
        RawRun {
            link: OneOrMore::One(DEFAULT_LINK.to_string()),
            output: "frame".to_string(),
            windows: output.windows,
            window_px: output.window_size,
            objects: output.objects,
            clock: Clock::Stepped,
            trigger: Trigger::default(),
            idle_s: 5.0,
            latency_s: None,
            delay_s: 0.0,
            jitter_s: 0.0,
            on_overrun: OnOverrun::default(),
            coarsen: vec!["fast".to_string()],
            work_limit_s: 2.0,
            stale_s: 1.0,
            on_stale: OnStale::default(),
            out_of_order: OutOfOrder::default(),
            holdover_s: 2.0,
            metrics: None,
            priority: None,
            lock_memory: false,
            cpus: Vec::new(),
        }
    }
}

impl RawRun {
    pub(super) fn validate(self, check: &Check) -> Result<Run, ConfigError> {
        let links = self.link.validate("run.link", check)?;
        let preset = Output::preset(&self.output).ok_or_else(|| {
            check.refuse(
                "run.output",
                format!("{:?}", self.output),
                one_of(&levels()),
            )
        })?;
        check.limit(LIMITS, "run.window_px", f64::from(self.window_px))?;
        if (self.clock, self.trigger) == (Clock::Wall, Trigger::Packet) {
            let reason = "\"packet\" needs the client's time, and run.clock is \"wall\": make that \"external\" or \"stepped\", or leave run.trigger \
                          out and send SingleShot";
            return Err(check.explain("run.trigger", reason).needs(&["run.clock"]));
        }
        let latency_s = self
            .latency_s
            .map(|latency_s| check.limit(LIMITS, "run.latency_s", latency_s));
        Ok(Run {
            links,
            output: Output {
                windows: self.windows,
                window_size: self.window_px,
                objects: self.objects,
                ..preset
            },
            clock: self.clock,
            trigger: self.trigger,
            idle_s: check.limit(LIMITS, "run.idle_s", self.idle_s)?,
            latency_s: latency_s.transpose()?,
            delay: Delay {
                delay_s: check.limit(LIMITS, "run.delay_s", self.delay_s)?,
                jitter_s: check.limit(LIMITS, "run.jitter_s", self.jitter_s)?,
            },
            on_overrun: self.on_overrun,
            coarsen: fidelity::steps(&self.coarsen, check)?,
            work_limit_s: check.limit(LIMITS, "run.work_limit_s", self.work_limit_s)?,
            staleness: Staleness {
                limit_s: check.limit(LIMITS, "run.stale_s", self.stale_s)?,
                then: self.on_stale,
            },
            out_of_order: self.out_of_order,
            holdover_s: check.limit(LIMITS, "run.holdover_s", self.holdover_s)?,
            metrics: self
                .metrics
                .map(|text| listening(text, check))
                .transpose()?,
            realtime: Requested {
                priority: self
                    .priority
                    .map(|priority| priority_of(priority, check))
                    .transpose()?,
                lock_memory: self.lock_memory,
                cpus: processors(&self.cpus, check)?,
            },
        })
    }
}

fn listening(text: String, check: &Check) -> Result<String, ConfigError> {
    match metrics_address(&text) {
        Some(_) => Ok(text),
        None => {
            let allowed = "an address and a port, such as \"127.0.0.1:9464\" or \"[::1]:9464\", or a port alone";
            Err(check.refuse("run.metrics", format!("{text:?}"), allowed))
        }
    }
}

/// Processor numbers; the system checks later whether the processors exist.
fn processors(numbers: &[i64], check: &Check) -> Result<Vec<usize>, ConfigError> {
    let number = |(i, number): (usize, &i64)| {
        let key = format!("run.cpus[{i}]");
        check.limit(LIMITS, &key, *number as f64)?;
        Ok(*number as usize)
    };
    numbers.iter().enumerate().map(number).collect()
}

fn priority_of(priority: i64, check: &Check) -> Result<u8, ConfigError> {
    let allowed = u8::try_from(priority)
        .ok()
        .filter(|priority| PRIORITIES.contains(&f64::from(*priority)));
    allowed.ok_or_else(|| {
        let [min, max] = [PRIORITIES.start(), PRIORITIES.end()];
        check.refuse(
            "run.priority",
            priority.to_string(),
            format!("a priority of SCHED_FIFO, {min} to {max}"),
        )
    })
}
