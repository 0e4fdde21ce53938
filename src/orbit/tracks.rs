//! The whole catalogue from frame to frame: where everything is, within centimetres, in a tenth of the time that it takes to ask anew.
//!
//! ```text
//! t -> blocks of which nobody can have come into the cone that is looked into: nothing
//!   -> blocks whose segment holds t: its cubic
//!   -> others: SGP4; a share of them gets a segment, so that no frame pays for all
//! ```
//!
//! A segment is [`SEGMENT_S`] of a block's positions: the cubic through four instants, its ends among them. SGP4's velocity is not the
//! derivative of its position under drag: positions alone are laid through. A fifth instant, the middle, where cubic and orbit are
//! furthest apart, is the proof: an object that is off by more than [`TOLERANCE_KM`] there, or fails at any of the five, is asked
//! anew every time. With the rounding of coefficients the positions are within [`BOUND_KM`]. They decide who may be in the field; who is, is asked of SGP4 itself.

use crate::StateVector;
use crate::cone::{Cone, FASTEST_KM_S, Leeway, Moved};
use crate::elements::{Elements, ModelError};
use crate::sgp4_batch::{Asked, BLOCK, Batch, BlockStates, Level, Row};
use hifitime::{Duration, Epoch};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

/// How long a cubic holds, s.
pub const SEGMENT_S: i64 = 20;
/// The cubic may be off by this in the middle, km: 1.3 m times (rate/0.07 deg/s)^4 of a circular orbit, see below.
pub const TOLERANCE_KM: f64 = 1e-5;
/// What is off at most, km: twice the tolerance, and the rounding of coefficients to 24 bits (6e-8 of the way in half a segment, 110 km at
/// 11 km/s).
pub const BOUND_KM: f64 = 3e-5;

/// Blocks of a task.
const CHUNK: usize = 32;
/// Every so many frames a block without a segment gets one.
const TURNS: usize = 16;
/// A segment takes five propagations: where frames are further apart than this part of it, it is not worth it.
const WORTH: i64 = 8;

/// A catalogue on its way.
#[derive(Debug, Default)]
pub struct Tracks {
    batch: Batch,
    /// Whether every position is asked of SGP4.
    pub exact: bool,
    watches: Vec<Watch>,
    segments: Vec<Segment>,
    moved: Moved,
    last: Option<i64>,
    frame: usize,
}

/// Where the objects of a block are at an instant, TEME.
#[derive(Clone, Debug)]
#[repr(align(64))]
pub struct Places<'a> {
    /// x, y, z, km, within [`BOUND_KM`]; 0 of those that have none.
    pub position_km: [Row; 3],
    /// 0, or SGP4's code of a failure, see [`States::get`](crate::sgp4_batch::States::get).
    pub code: [u8; BLOCK],
    /// Which objects of the catalogue they are, [`NOBODY`](crate::sgp4_batch::NOBODY) where the block is filled up.
    pub objects: &'a [u32],
}

/// What is looked for among the places of a catalogue.
pub trait Look: Sync {
    /// What is found.
    type Found: Send;

    /// Nobody outside of it is looked for.
    fn cone(&self) -> &Cone;

    /// Puts down what is found of a block; whether anybody of it may be in the cone. Inlined, it is done with the vector instructions that the
    /// catalogue is worked out with.
    fn look(&self, places: &Places<'_>, found: &mut Vec<Self::Found>) -> bool;
}

/// What is known of a block before its segment is read.
#[derive(Clone, Debug)]
struct Watch {
    /// The segment's middle, ns since 1900 TAI; [`NEVER`] before there is one.
    middle_ns: i64,
    leeway: Leeway,
}

/// A stretch of a block's ways: numbers first, so that none of their rows lies in two lines of the cache.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
struct Segment {
    /// In the middle, km.
    middle_km: [Row; 3],
    /// Times half segments since then, their squares and their cubes, km.
    rates_km: [[Rates; 3]; 3],
    /// Codes of those that fail all through; their positions are 0.
    code: [u8; BLOCK],
    /// For whom it does not hold: SGP4 is asked.
    asks: [bool; BLOCK],
    /// Whether all have places all through, and none is faster than [`FASTEST_KM_S`].
    is_calm: bool,
}

// Frames take as long as memory takes to tell of all segments.
const _: () = assert!(size_of::<Segment>() == 512);

/// No segment is near to that.
const NEVER: i64 = i64::MIN;

/// A coefficient of each object of a block, km.
type Rates = [f32; BLOCK];

/// At which a segment is laid and proved.
const INSTANTS: usize = 5;

/// Half a segment, ns.
const HALF_NS: i64 = SEGMENT_S * 500_000_000;

/// What is asked of all blocks alike.
#[derive(Clone, Copy)]
struct Frame {
    t: Epoch,
    ns: i64,
    /// When was asked before, if that is so near that segments are worth it.
    last: Option<i64>,
    /// Whose turn it is.
    turn: usize,
}

impl Tracks {
    /// Of the element sets, in their order.
    ///
    /// Errors: the first set that the model cannot start from.
    pub fn new(sets: &[Elements]) -> Result<Tracks, ModelError> {
        let batch = Batch::new(sets)?;
        Ok(Tracks {
            watches: Vec::new(),
            segments: Vec::new(),
            moved: Moved::default(),
            exact: false,
            last: None,
            frame: 0,
            batch,
        })
    }

    /// How many objects there are.
    pub fn len(&self) -> usize {
        self.batch.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.batch.is_empty()
    }

    /// Which instructions are used.
    pub fn level(&self) -> Level {
        self.batch.level()
    }

    /// Uses these instructions; the portable ones where the processor lacks them.
    pub fn set_level(&mut self, level: Level) {
        self.batch.set_level(level);
    }

    /// Octets of memory that the catalogue takes.
    pub fn octets(&self) -> usize {
        self.batch.octets()
            + self.segments.capacity() * size_of::<Segment>()
            + self.watches.capacity() * size_of::<Watch>()
    }

    /// Calls `each` with the states of some objects by SGP4, in that order, each at the same `N` instants, up to [`BLOCK`]: TEME, m and m/s, or
    /// the code of a failure.
    pub fn states_at<const N: usize>(
        &self,
        objects: &[usize],
        when: &[Epoch; N],
        each: impl FnMut([Result<StateVector, u8>; N]),
    ) {
        self.batch.states_at(objects, when, each);
    }

    /// What `look` finds at `t`, in the order of blocks.
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
        self.moved.on_to(look.cone(), ns);
        // An exact catalogue has blocks whose segments never hold.
        let blocks = self.batch.blocks();
        self.segments.resize(blocks, Segment::NONE);
        self.watches.resize(blocks, Watch::NONE);
        let (batch, exact, moved) = (&self.batch, self.exact, &self.moved);
        let segments = self.segments.par_chunks_mut(CHUNK);
        let chunks = segments.zip(self.watches.par_chunks_mut(CHUNK)).enumerate();
        let found = chunks.map(|(chunk, (segments, watches))| {
            let first = chunk * CHUNK;
            let (mut asked, mut begun) = (Vec::new(), Vec::new());
            for (i, watch) in watches.iter_mut().enumerate() {
                if exact {
                    watch.middle_ns = NEVER;
                } else if !watch.holds(ns) && frame.is_due(first + i, watch) {
                    begun.push(i);
                    asked.extend(watch.begin(first + i, ns));
                }
            }
            if !asked.is_empty() {
                let mut states = vec![BlockStates::NONE; asked.len()];
                batch.blocks_asked(&asked, &mut states);
                let (states, _) = states.as_chunks::<INSTANTS>();
                for (i, states) in begun.into_iter().zip(states) {
                    segments[i].lay(states);
                    if !segments[i].is_calm {
                        watches[i].leeway = Leeway::NONE;
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

/// Some blocks, looked at one after another.
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
        // Many blocks at a time take less time than one by one.
        let mut all = Vec::new();
        if 2 * held < self.segments.len() {
            all.resize_with(self.segments.len(), BlockStates::default);
            self.batch.blocks_at_epoch(self.first, t, &mut all);
        }
        for (i, watch) in self.watches.iter_mut().enumerate() {
            let holds = watch.holds(ns);
            if holds && watch.leeway.lasts(moved, cone) {
                continue;
            }
            let segment = &self.segments[i];
            let mut places = Places {
                position_km: [[0.0; BLOCK]; 3],
                code: segment.code,
                objects: self.batch.objects_of(self.first + i),
            };
            if holds {
                segment.place(ns, watch.middle_ns, &mut places.position_km);
            }
            if !holds || segment.asks.contains(&true) {
                let mut one = [const { BlockStates::NONE }];
                let states = match all.get(i) {
                    Some(states) => states,
                    None => {
                        self.batch.blocks_at_epoch(self.first + i, t, &mut one);
                        &one[0]
                    }
                };
                for k in (0..BLOCK).filter(|&k| !holds || segment.asks[k]) {
                    for (row, new) in places.position_km.iter_mut().zip(&states.position_km) {
                        row[k] = new[k];
                    }
                    places.code[k] = states.code[k] as u8;
                }
            }
            let met = self.look.look(&places, self.found);
            watch.leeway = match holds && segment.is_calm && !met {
                true => Leeway::of(&places.position_km, cone, 2.0 * BOUND_KM, moved),
                false => Leeway::NONE,
            };
        }
    }
}

impl Frame {
    /// Whether a block is to get a segment now: where it had one until now, or it is its turn.
    fn is_due(&self, block: usize, watch: &Watch) -> bool {
        self.last
            .is_some_and(|last| watch.holds(last) || block % TURNS == self.turn)
    }
}

impl Watch {
    const NONE: Watch = Watch {
        middle_ns: NEVER,
        leeway: Leeway::NONE,
    };

    /// Whether the segment holds then.
    fn holds(&self, ns: i64) -> bool {
        self.middle_ns != NEVER && (ns - self.middle_ns).abs() <= HALF_NS
    }

    /// Begins the segment of `block` that holds `ns`, one block after another; at which instants it asks for the block.
    fn begin(&mut self, block: usize, ns: i64) -> [Asked; INSTANTS] {
        // The golden section spreads any number of blocks evenly.
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let phase = ((block as f64 * GOLDEN).fract() * (2 * HALF_NS) as f64) as i64;
        let start = (ns - phase).div_euclid(2 * HALF_NS) * (2 * HALF_NS) + phase;
        let middle = start + HALF_NS;
        self.middle_ns = middle;
        [-HALF_NS, -HALF_NS / 2, 0, HALF_NS / 2, HALF_NS].map(|offset| {
            let t = Duration::from_total_nanoseconds(i128::from(middle + offset));
            Asked::of(block, Epoch::from_tai_duration(t))
        })
    }
}

impl Segment {
    const NONE: Segment = Segment {
        middle_km: [[0.0; BLOCK]; 3],
        rates_km: [[[0.0; BLOCK]; 3]; 3],
        code: [0; BLOCK],
        asks: [false; BLOCK],
        is_calm: false,
    };

    /// Lays it through those states.
    fn lay(&mut self, [a, b, m, c, d]: &[BlockStates; INSTANTS]) {
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
            self.asks[i] = !same || !fits;
        }
        // km in half a segment
        let fastest = FASTEST_KM_S * (SEGMENT_S as f64 / 2.0);
        self.is_calm = self.code == [0; BLOCK]
            && self.asks == [false; BLOCK]
            && speed2.iter().all(|speed2| *speed2 <= fastest * fastest);
    }

    /// Where everybody is, as far as it holds.
    #[inline(always)]
    fn place(&self, ns: i64, middle_ns: i64, position_km: &mut [Row; 3]) {
        let s = ((ns - middle_ns) as f64 / HALF_NS as f64) as f32;
        // x = p0 + s (p1 + s (p2 + s p3)), in one loop: that is worked out in lanes, three of eight places each may not be.
        let [p1, p2, p3] = self.rates_km.each_ref().map(|rates| rates.as_flattened());
        let places = position_km.as_flattened_mut().iter_mut();
        let places = places.zip(self.middle_km.as_flattened());
        for ((place, middle), ((p1, p2), p3)) in places.zip(p1.iter().zip(p2).zip(p3)) {
            *place = middle + f64::from(s * (p1 + s * (p2 + s * p3)));
        }
    }
}
