//! Orbit times of a catalogue: the batch against the scalar SGP4, threads, tracks, and the whole
//! step of a camera.
//!
//! All ratios of a report are from one run, measured alternately, so that other load affects both
//! sides alike.

mod step;
mod table;

use super::ratio::{Machine, Row, ns, pools, row, with_threads};
use super::sample::Sample;
use hifitime::{Epoch, Unit};
use serde::Serialize;
use skyloop_base::load::ConfigError;
use skyloop_orbit::cone::Cone;
use skyloop_orbit::elements::Elements;
use skyloop_orbit::sgp4;
use skyloop_orbit::sgp4_batch::{Batch, Level, States};
use skyloop_orbit::synth::{Synthetic, population};
use skyloop_orbit::tracks::{Look, Places, Tracks};
use skyloop_render::render_pool;
use std::f64::consts::PI;
use std::hint::black_box;

/// Objects of the separately measured steps.
const OBJECTS: usize = 20_000;
/// Objects of the whole step.
const CATALOGUE: usize = 200_000;
/// One in this many objects is in deep space in the mixed catalogue.
const DEEP: usize = 10;
/// Consecutive calls of the batch in a round: about as long as one of the scalar SGP4.
const CALLS: usize = 10;
/// The same for two threads against one: far longer than a scheduler takes to separate them.
const LONG: usize = 100;
const ROUNDS: usize = 31;
/// Frames of the whole step, a tenth of a second apart, after those that build segments.
const FRAMES: usize = 300;
const WARM: usize = 40;
/// Limits of the whole step: 99th percentile of the time, ms, and memory per object, B.
const MAX_MS: f64 = 10.0;
const MAX_BYTES: f64 = 700.0;
/// Longest period of a near-Earth orbit, min.
const NEAR_MIN: f64 = 225.0;

/// Measurements.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// The machine.
    #[serde(flatten)]
    pub machine: Machine,
    /// Comparisons.
    pub rows: Vec<Row>,
    /// The whole step.
    pub step: Step,
    /// Times by number of objects.
    pub scale: Vec<Scale>,
}

/// A camera's whole step: candidates of a catalogue, visible objects, and the label's text.
#[derive(Debug, Clone, Serialize)]
pub struct Step {
    /// Objects.
    pub objects: usize,
    /// Frames.
    pub frames: usize,
    /// Median of the frames' times, ms.
    pub p50_ms: f64,
    /// Their 99th percentile, ms.
    pub p99_ms: f64,
    /// Time of the first frame, with SGP4 for all objects, ms.
    pub first_ms: f64,
    /// Median with SGP4 for all objects in every frame, ms.
    pub exact_p50_ms: f64,
    /// Candidates, unseen and labelled objects of a frame, on average.
    pub found: [f64; 3],
    /// Memory per object, bytes, with its name.
    #[serde(rename = "octets")]
    pub bytes: f64,
}

/// Time per object, by the number of objects.
#[derive(Debug, Clone, Serialize)]
pub struct Scale {
    /// Objects.
    pub objects: usize,
    /// By SGP4, all threads, ns per object.
    pub exact_ns: f64,
    /// By tracks, all threads, ns per object.
    pub tracked_ns: f64,
}

impl super::Report for Report {
    const PARTS: u32 = 7;

    fn measure(mut on_part: impl FnMut(&str)) -> Result<Report, ConfigError> {
        let machine = Machine::this();
        let mut rows = Vec::new();
        let epoch = Epoch::from_gregorian_utc_at_midnight(2026, 1, 1);
        let made = population(OBJECTS * 2, 1, epoch);
        let near: Vec<Elements> = orbits(&made, true).take(OBJECTS).collect();
        let mut mixed: Vec<Elements> = orbits(&made, true).take(OBJECTS - OBJECTS / DEEP).collect();
        mixed.extend(orbits(&made, false).take(OBJECTS / DEEP));
        on_part("batch against the scalar SGP4");
        for level in Level::available() {
            let min_ratios = match level {
                Level::Avx512 => [Some(12.0), Some(8.0)],
                Level::Avx2 => [Some(6.0), None],
                Level::Portable | Level::Neon => [None; 2],
            };
            rows.push(with_threads(1, || {
                batch(&near, "near Earth", level, epoch, min_ratios[0])
            }));
            rows.push(with_threads(1, || {
                batch(&mixed, "10 % deep space", level, epoch, min_ratios[1])
            }));
        }
        on_part("threads and tracks");
        rows.extend(threads(&near, epoch));
        rows.push(with_threads(1, || tracks(&near, epoch)));
        let sizes = [1_000, 10_000, 100_000, 1_000_000];
        let scale = sizes.map(|objects| {
            on_part(&format!("{objects} objects"));
            scaled(objects, epoch)
        });
        on_part("whole steps");
        Ok(Report {
            machine,
            rows,
            step: step::measure()?,
            scale: scale.into(),
        })
    }

    fn broken(&self) -> Vec<String> {
        let Step { p99_ms, bytes, .. } = self.step;
        let rows = self.rows.iter().filter_map(Row::broken);
        let step = (p99_ms > MAX_MS)
            .then(|| format!("the whole step: p99 {p99_ms:.1} ms is above {MAX_MS} ms"));
        let memory = (bytes > MAX_BYTES)
            .then(|| format!("memory: {bytes:.0} B an object are more than {MAX_BYTES} B"));
        rows.chain(step).chain(memory).collect()
    }
}

/// The near-Earth orbits of a population, or the others.
fn orbits(made: &[Synthetic], near: bool) -> impl Iterator<Item = Elements> {
    let is_near = |elements: &Elements| {
        let period_min = std::f64::consts::TAU / elements.mean_motion;
        // SGP4 decides by Brouwer's mean motion, which differs by some 1e-3.
        period_min < NEAR_MIN * 0.99
    };
    let all = made.iter().map(|one| one.elements);
    all.filter(move |elements| is_near(elements) == near)
}

/// The batch on one thread, one epoch per call, against the `sgp4` crate.
fn batch(sets: &[Elements], what: &str, level: Level, epoch: Epoch, min: Option<f64>) -> Row {
    let scalar: Vec<(sgp4::Constants, f64)> = sets
        .iter()
        .filter_map(|set| Some((set.constants().ok()?, set.minutes_to(epoch))))
        .collect();
    let mut batch = Batch::new(sets).unwrap_or_default();
    batch.set_level(level);
    let mut states = States::default();
    let later = |round: usize| 0.1 * round as f64;
    row(
        format!("{what}, {level}"),
        "sgp4 crate",
        min,
        ROUNDS,
        [sets.len() * CALLS, sets.len()],
        |round| {
            for call in 0..CALLS {
                let t = epoch + Unit::Minute * later(round * CALLS + call);
                batch.propagate(t, &mut states);
            }
        },
        |round| {
            for (constants, minutes) in &scalar {
                let at = sgp4::MinutesSinceEpoch(minutes + later(round));
                black_box(constants.propagate(at).ok());
            }
        },
    )
}

fn threads(sets: &[Elements], epoch: Epoch) -> Option<Row> {
    let mut batch = Batch::new(sets).unwrap_or_default();
    let mut other = batch.clone();
    let (mut states, mut others) = (States::default(), States::default());
    let [two, one] = pools()?;
    let at = |call: usize| epoch + Unit::Second * (call as f64);
    let calls = |round: usize| round * LONG..(round + 1) * LONG;
    Some(row(
        "near Earth, 2 threads".to_string(),
        "1 thread",
        Some(1.7),
        ROUNDS,
        [sets.len() * LONG; 2],
        |round| {
            let all = || calls(round).for_each(|call| batch.propagate(at(call), &mut states));
            two.install(|| render_pool::together(all))
        },
        |round| {
            one.install(|| calls(round).for_each(|call| other.propagate(at(call), &mut others)))
        },
    ))
}

/// Reads every position and finds nothing.
struct FindNothing(Cone);

impl FindNothing {
    /// With a cone of all directions: no object is skipped.
    fn everywhere() -> FindNothing {
        FindNothing(Cone::new([0.0; 3], [0.0, 0.0, 1.0], PI, 0.0))
    }
}

impl Look for FindNothing {
    type Found = ();

    fn cone(&self) -> &Cone {
        &self.0
    }

    #[inline(always)]
    fn look(&self, places: &Places<'_>, found: &mut Vec<()>) -> bool {
        let places = places.position_km.as_flattened().iter();
        if places.fold(false, |any, km| any | (*km > 1e12)) {
            found.push(());
        }
        true
    }
}

/// Tracks in consecutive frames of 0.1 s, with their new segments, against SGP4 of all objects.
fn tracks(sets: &[Elements], epoch: Epoch) -> Row {
    let mut tracks = Tracks::new(sets).unwrap_or_default();
    let mut exact = Tracks::new(sets).unwrap_or_default();
    exact.exact = true;
    let at = |frame: usize| epoch + Unit::Second * (0.1 * frame as f64);
    for frame in 0..WARM {
        tracks.at(at(frame), &FindNothing::everywhere());
    }
    // A round is as long as a segment, so that it builds each segment once.
    let frames = 10 * skyloop_orbit::tracks::SEGMENT_S as usize;
    let exact_frames = 20;
    row(
        "tracks, frames of 0.1 s back to back".to_string(),
        "own SGP4 of every object",
        Some(8.0),
        ROUNDS,
        [sets.len() * frames, sets.len() * exact_frames],
        |round| {
            for frame in 0..frames {
                black_box(tracks.at(
                    at(WARM + round * frames + frame),
                    &FindNothing::everywhere(),
                ));
            }
        },
        |round| {
            for frame in 0..exact_frames {
                black_box(exact.at(at(round * exact_frames + frame), &FindNothing::everywhere()));
            }
        },
    )
}

/// Time per object in a catalogue of this size.
fn scaled(objects: usize, epoch: Epoch) -> Scale {
    let sets: Vec<Elements> = population(objects, 1, epoch)
        .iter()
        .map(|one| one.elements)
        .collect();
    let mut tracks = Tracks::new(&sets).unwrap_or_default();
    let at = |frame: usize| epoch + Unit::Second * (0.1 * frame as f64);
    let rounds = (2_000_000 / objects).clamp(9, 500);
    let mut median = |exact: bool| {
        tracks.exact = exact;
        let warm = if exact { 2 } else { WARM };
        let times = (0..warm + rounds)
            .map(|frame| ns(|| drop(tracks.at(at(frame), &FindNothing::everywhere()))));
        Sample::new(times.skip(warm)).quantile(0.5) / objects as f64
    };
    Scale {
        objects,
        exact_ns: median(true),
        tracked_ns: median(false),
    }
}
