//! Positions of a whole catalogue from frame to frame, within centimetres, in a tenth of the time
//! of SGP4.
//!
//! ```text
//! t -> blocks that cannot have reached the cone: skipped
//!   -> blocks whose segment contains t: its cubic
//!   -> others: SGP4; in each frame a share of them gets a segment
//! ```
//!
//! A segment is a cubic through four positions within [`SEGMENT_S`], including its ends. Velocities
//! are not used, since SGP4's velocity under drag is not the derivative of its position. The error
//! is largest at the middle, where a fifth position checks it. An object with an error above
//! [`TOLERANCE_KM`] there, or with a failure at any of the five, is propagated in every frame. With
//! rounded coefficients positions are within [`BOUND_KM`]. They select candidates, whose states
//! come from SGP4.

use crate::StateVector;
use crate::cone::{ClearUntil, Cone, FASTEST_KM_S, Moved};
use crate::elements::{Elements, ModelError};
use crate::sgp4_batch::{BLOCK, Batch, BlockStates, Level, Requested, Row};
use hifitime::{Duration, Epoch};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// Length of a segment, s.
pub const SEGMENT_S: i64 = 20;
/// Largest error of a cubic at its middle, km. On a circular orbit (radius r, rate w) the error is
/// r (w h)^4 / 96, h half a segment: 1.1 mm at a height of 500 km.
pub const TOLERANCE_KM: f64 = 1e-5;
/// Largest error of positions, km: twice the tolerance, plus coefficients rounded to 24 bits (6e-8
/// of the path in half a segment, 110 km at 11 km/s).
pub const BOUND_KM: f64 = 3e-5;

/// Blocks of a work item.
const CHUNK: usize = 32;
/// Frames within which every block gets a segment.
const TURNS: usize = 16;
/// A segment takes five propagations. It pays only where frames are at most 1/`WORTH` of it apart.
const WORTH: i64 = 8;

/// A catalogue with its segments.
#[derive(Debug, Default)]
pub struct Tracks {
    batch: Batch,
    /// Whether every position is computed by SGP4.
    pub exact: bool,
    watches: Vec<Watch>,
    segments: Vec<Segment>,
    moved: Moved,
    last: Option<i64>,
    frame: usize,
}

/// Positions of a block at an instant, TEME.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Places<'a> {
    /// x, y, z, km, within [`BOUND_KM`]; 0 for failed objects.
    pub position_km: [Row; 3],
    /// 0, or SGP4's failure code, see [`States::get`](crate::sgp4_batch::States::get).
    pub code: [u8; BLOCK],
    /// Indices in the catalogue, or [`NO_OBJECT`](crate::sgp4_batch::NO_OBJECT).
    pub objects: &'a [u32],
}

/// A search among the positions of a catalogue.
pub trait Look: Sync {
    /// Result for an object.
    type Found: Send;

    /// Objects outside of this cone are not searched for.
    fn cone(&self) -> &Cone;

    /// Adds the results for a block. Returns whether any of its objects may be in the cone.
    /// Inlined, it uses the vector instructions of the catalogue's level.
    fn look(&self, places: &Places<'_>, found: &mut Vec<Self::Found>) -> bool;
}

/// Decides whether a block's segment is read.
#[derive(Clone, Debug)]
struct Watch {
    /// Middle of the segment, ns since 1900 TAI, or [`NEVER`].
    middle_ns: i64,
    clear_until: ClearUntil,
}

/// A segment of a block's paths. The order of fields puts each row into one cache line.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
struct Segment {
    /// At the middle, km.
    middle_km: [Row; 3],
    /// Factors of s, s^2 and s^3, km, with the time s from the middle in half segments.
    rates_km: [[Rates; 3]; 3],
    /// Codes of objects that fail over the whole segment; their positions are 0.
    code: [u8; BLOCK],
    /// Objects that are propagated by SGP4 in every frame.
    uses_sgp4: [bool; BLOCK],
    /// Whether no object fails or is faster than [`FASTEST_KM_S`].
    is_calm: bool,
}

// Reading all segments from memory dominates the time of a frame.
const _: () = assert!(size_of::<Segment>() == 512);

/// Middle of a missing segment.
const NEVER: i64 = i64::MIN;

/// A coefficient for each object of a block, km.
type Rates = [f32; BLOCK];

/// Instants of the positions that fit and check a segment.
const INSTANTS: usize = 5;

/// Half a segment, ns.
const HALF_NS: i64 = SEGMENT_S * 500_000_000;

/// Times of a frame, the same for all blocks.
#[derive(Clone, Copy)]
struct Frame {
    t: Epoch,
    ns: i64,
    /// The previous frame, if it is near enough for segments to pay.
    last: Option<i64>,
    /// Blocks whose number modulo [`TURNS`] is this get a segment.
    turn: usize,
}

impl Tracks {
    /// Reads a catalogue.
    ///
    /// # Errors
    ///
    /// The first element set that SGP4 cannot start from.
    pub fn new(sets: &[Elements]) -> Result<Tracks, ModelError> {
        let batch = Batch::new(sets)?;
        Ok(Tracks {
            batch,
            ..Tracks::default()
        })
    }

    /// Number of objects.
    pub fn len(&self) -> usize {
        self.batch.len()
    }

    /// Whether there are no objects.
    pub fn is_empty(&self) -> bool {
        self.batch.is_empty()
    }

    /// Sets the vector instructions; portable ones where the processor lacks them.
    pub fn set_level(&mut self, level: Level) {
        self.batch.set_level(level);
    }

    /// Memory of the catalogue, bytes.
    pub fn bytes(&self) -> usize {
        self.batch.bytes()
            + self.segments.capacity() * size_of::<Segment>()
            + self.watches.capacity() * size_of::<Watch>()
    }

    /// Calls `each` with SGP4's states of each object in turn, at the same `N` instants (`N` is at
    /// most [`BLOCK`]): TEME, m and m/s, or the failure code.
    pub fn states_at<const N: usize>(
        &self,
        objects: &[usize],
        when: &[Epoch; N],
        each: impl FnMut([Result<StateVector, u8>; N]),
    ) {
        self.batch.states_at(objects, when, each);
    }

    /// The results of `look` at `t`, in the order of blocks.
    pub fn at<L: Look>(&mut self, t: Epoch, look: &L) -> Vec<L::Found> {
        let ns = t.to_tai_duration().total_nanoseconds() as i64;
        let near = |last: &i64| (ns - last).abs() <= 2 * HALF_NS / WORTH;
        let frame = Frame {
            t,
            ns,
            last: self.last.filter(near),
            turn: self.frame % TURNS,
        };
        (self.last, self.frame) = (Some(ns), self.frame.wrapping_add(1));
        self.batch.advance_to(t);
        self.moved.add_motion(look.cone(), ns);
        let blocks = self.batch.blocks();
        self.segments.resize(blocks, Segment::NONE);
        self.watches.resize(blocks, Watch::NONE);
        let (batch, exact, moved) = (&self.batch, self.exact, &self.moved);
        let segments = self.segments.par_chunks_mut(CHUNK);
        let chunks = segments.zip(self.watches.par_chunks_mut(CHUNK)).enumerate();
        let found = chunks.map(|(chunk, (segments, watches))| {
            let first = chunk * CHUNK;
            let (mut requested, mut begun) = (Vec::new(), Vec::new());
            for (i, watch) in watches.iter_mut().enumerate() {
                if exact {
                    watch.middle_ns = NEVER;
                } else if !watch.holds(ns) && frame.is_due(first + i, watch) {
                    begun.push(i);
                    requested.extend(watch.begin(first + i, ns));
                }
            }
            if !requested.is_empty() {
                let mut states = vec![BlockStates::NONE; requested.len()];
                batch.blocks_requested(&requested, &mut states);
                let (states, _) = states.as_chunks::<INSTANTS>();
                for (i, states) in begun.into_iter().zip(states) {
                    segments[i].fit(states);
                    if !segments[i].is_calm {
                        watches[i].clear_until = ClearUntil::NONE;
                    }
                }
            }
            let mut found = Vec::new();
            batch.level().run(Chunk {
                batch,
                first,
                watches,
                segments,
                frame,
                moved,
                look,
                found: &mut found,
            });
            found
        });
        let found: Vec<Vec<L::Found>> = found.collect();
        found.into_iter().flatten().collect()
    }
}

/// Blocks of a work item.
struct Chunk<'a, L: Look> {
    batch: &'a Batch,
    first: usize,
    watches: &'a mut [Watch],
    segments: &'a [Segment],
    frame: Frame,
    moved: &'a Moved,
    look: &'a L,
    found: &'a mut Vec<L::Found>,
}

impl<L: Look> WithSimd for Chunk<'_, L> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Frame { t, ns, .. } = self.frame;
        let (cone, moved) = (self.look.cone(), self.moved);
        let held = self.watches.iter().filter(|w| w.holds(ns)).count();
        // Many blocks together take less time than the same blocks one by one.
        let mut all = Vec::new();
        if 2 * held < self.segments.len() {
            all.resize_with(self.segments.len(), BlockStates::default);
            self.batch.blocks_at_epoch(self.first, t, &mut all);
        }
        for (i, watch) in self.watches.iter_mut().enumerate() {
            let holds = watch.holds(ns);
            if holds && watch.clear_until.lasts(moved, cone) {
                continue;
            }
            let segment = &self.segments[i];
            let mut places = Places {
                position_km: [[0.0; BLOCK]; 3],
                code: segment.code,
                objects: self.batch.objects_of(self.first + i),
            };
            if holds {
                segment.positions(ns, watch.middle_ns, &mut places.position_km);
            }
            if !holds || segment.uses_sgp4.contains(&true) {
                let mut one = [const { BlockStates::NONE }];
                let states = match all.get(i) {
                    Some(states) => states,
                    None => {
                        self.batch.blocks_at_epoch(self.first + i, t, &mut one);
                        &one[0]
                    }
                };
                for k in (0..BLOCK).filter(|&k| !holds || segment.uses_sgp4[k]) {
                    for (row, new) in places.position_km.iter_mut().zip(&states.position_km) {
                        row[k] = new[k];
                    }
                    places.code[k] = states.code[k] as u8;
                }
            }
            let any_inside = self.look.look(&places, self.found);
            watch.clear_until = if holds && segment.is_calm && !any_inside {
                ClearUntil::of(&places.position_km, cone, 2.0 * BOUND_KM, moved)
            } else {
                ClearUntil::NONE
            };
        }
    }
}

impl Frame {
    /// Whether a block gets a new segment now: its last one has just ended, or this is its turn.
    fn is_due(&self, block: usize, watch: &Watch) -> bool {
        self.last
            .is_some_and(|last| watch.holds(last) || block % TURNS == self.turn)
    }
}

impl Watch {
    const NONE: Watch = Watch {
        middle_ns: NEVER,
        clear_until: ClearUntil::NONE,
    };

    /// Whether the segment contains an instant.
    fn holds(&self, ns: i64) -> bool {
        self.middle_ns != NEVER && (ns - self.middle_ns).abs() <= HALF_NS
    }

    /// Begins the segment of `block` that contains `ns`, and returns the requests for it.
    fn begin(&mut self, block: usize, ns: i64) -> [Requested; INSTANTS] {
        // The golden section distributes the starts of any number of blocks evenly.
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let phase = ((block as f64 * GOLDEN).fract() * (2 * HALF_NS) as f64) as i64;
        let start = (ns - phase).div_euclid(2 * HALF_NS) * (2 * HALF_NS) + phase;
        let middle = start + HALF_NS;
        self.middle_ns = middle;
        [-HALF_NS, -HALF_NS / 2, 0, HALF_NS / 2, HALF_NS].map(|offset| {
            let t = Duration::from_total_nanoseconds(i128::from(middle + offset));
            Requested::of(block, Epoch::from_tai_duration(t))
        })
    }
}

impl Segment {
    const NONE: Segment = Segment {
        middle_km: [[0.0; BLOCK]; 3],
        rates_km: [[[0.0; BLOCK]; 3]; 3],
        code: [0; BLOCK],
        uses_sgp4: [false; BLOCK],
        is_calm: false,
    };

    /// Fits and checks the cubics.
    fn fit(&mut self, [a, b, m, c, d]: &[BlockStates; INSTANTS]) {
        let mut fits = [true; BLOCK];
        let mut speed2 = [0.0; BLOCK];
        for axis in 0..3 {
            for (i, fits) in fits.iter_mut().enumerate() {
                let x = |states: &BlockStates| states.position_km[axis][i];
                // x = p0 + p1 s + p2 s^2 + p3 s^3 through s = -1, -1/2, 1/2, 1
                let (outer, inner) = ((x(a) + x(d)) / 2.0, (x(b) + x(c)) / 2.0);
                let p2 = (outer - inner) / 0.75;
                let (outer_odd, inner_odd) = ((x(d) - x(a)) / 2.0, x(c) - x(b));
                let p3 = (outer_odd - inner_odd) / 0.75;
                let p0 = outer - p2;
                self.middle_km[axis][i] = p0;
                for (rate, p) in self.rates_km.iter_mut().zip([outer_odd - p3, p2, p3]) {
                    rate[axis][i] = p as f32;
                }
                *fits &= (p0 - x(m)).abs() <= TOLERANCE_KM;
                // |dx/ds| <= |p1| + 2 |p2| + 3 |p3|
                let steepest = (outer_odd - p3).abs() + 2.0 * p2.abs() + 3.0 * p3.abs();
                speed2[i] += steepest * steepest;
            }
        }
        for (i, fits) in fits.into_iter().enumerate() {
            let code = |states: &BlockStates| states.code[i] as u8;
            let same = [a, b, c, d].iter().all(|s| code(s) == code(m));
            self.code[i] = if same { code(m) } else { 0 };
            self.uses_sgp4[i] = !same || !fits;
        }
        // km in half a segment
        let fastest = FASTEST_KM_S * (SEGMENT_S as f64 / 2.0);
        self.is_calm = self.code == [0; BLOCK]
            && self.uses_sgp4 == [false; BLOCK]
            && speed2.iter().all(|speed2| *speed2 <= fastest * fastest);
    }

    /// Evaluates the cubics at an instant.
    #[inline(always)]
    fn positions(&self, ns: i64, middle_ns: i64, position_km: &mut [Row; 3]) {
        let s = ((ns - middle_ns) as f64 / HALF_NS as f64) as f32;
        // x = p0 + s (p1 + s (p2 + s p3)). The compiler vectorises one loop, but not three of eight
        // steps.
        let [p1, p2, p3] = self.rates_km.each_ref().map(|rates| rates.as_flattened());
        let positions = position_km.as_flattened_mut().iter_mut();
        let positions = positions.zip(self.middle_km.as_flattened());
        for ((position, middle), ((p1, p2), p3)) in positions.zip(p1.iter().zip(p2).zip(p3)) {
            *position = middle + f64::from(s * (p1 + s * (p2 + s * p3)));
        }
    }
}
