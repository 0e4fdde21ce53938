//! Time since the epochs, and the secular motion that near-Earth and deep-space orbits share.

use super::constants::ModelConstants;
use super::lanes::{BLOCK, Lanes, Part, Row};
use crate::elements::Elements;
use crate::time::DAY_NS;
use pulp::Simd;

/// Minutes of a day.
const DAY_MIN: f64 = 1440.0;

/// An instant: days since 1900-01-01T00:00 TAI, and minutes of the day. The difference of two loses
/// no digits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Instant {
    day: f64,
    minute: f64,
}

impl Instant {
    pub fn of(t: hifitime::Epoch) -> Instant {
        let ns = t.to_tai_duration().total_nanoseconds();
        let of = |day: i64, ns: i64| Instant {
            day: day as f64,
            minute: ns as f64 / 60e9,
        };
        // 64 bits serve up to the year 2192, and take a tenth of the time.
        match i64::try_from(ns) {
            Ok(ns) => of(ns.div_euclid(DAY_NS as i64), ns.rem_euclid(DAY_NS as i64)),
            Err(_) => of(ns.div_euclid(DAY_NS) as i64, ns.rem_euclid(DAY_NS) as i64),
        }
    }
}

/// An instant for each slot of a block.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Instants {
    pub count: usize,
    day: Row,
    minute: Row,
}

impl Instants {
    /// These instants; the first also fills the remaining slots.
    pub fn of(all: &[hifitime::Epoch]) -> Instants {
        let first = all.first().map_or(NO_INSTANT, |t| Instant::of(*t));
        let mut instants = Instants {
            count: all.len(),
            day: [first.day; BLOCK],
            minute: [first.minute; BLOCK],
        };
        let rows = instants.day.iter_mut().zip(&mut instants.minute);
        for ((day, minute), t) in rows.zip(all).skip(1) {
            let instant = Instant::of(*t);
            (*day, *minute) = (instant.day, instant.minute);
        }
        instants
    }
}

/// Fills unused slots.
const NO_INSTANT: Instant = Instant {
    day: 0.0,
    minute: 0.0,
};

/// The requested time.
#[derive(Clone, Copy, Debug)]
pub(crate) enum When {
    /// One instant.
    At(Instant),
    /// Minutes after each object's epoch.
    After(f64),
}

/// Epochs, secular rates and drag of a block; rad, rad/min.
#[derive(Clone, Debug, Default)]
pub(crate) struct Secular {
    day: Row,
    minute: Row,
    pub mean_anomaly: Row,
    pub mean_anomaly_dot: Row,
    pub perigee: Row,
    pub perigee_dot: Row,
    node: Row,
    node_dot: Row,
    /// k0, rad/min^2.
    node_drag: Row,
    pub eccentricity: Row,
    pub c1: Row,
    pub c4: Row,
    /// n0" k1, rad/min^2.
    pub mean_motion_k1: Row,
}

impl Secular {
    pub fn set(&mut self, i: usize, elements: &Elements, constants: &ModelConstants) {
        let epoch = Instant::of(elements.epoch);
        let mean = &constants.orbit;
        (self.day[i], self.minute[i]) = (epoch.day, epoch.minute);
        self.mean_anomaly[i] = mean.mean_anomaly;
        self.mean_anomaly_dot[i] = constants.mean_anomaly_dot;
        self.perigee[i] = mean.perigee;
        self.perigee_dot[i] = constants.perigee_dot;
        self.node[i] = mean.node;
        self.node_dot[i] = constants.node_dot;
        self.node_drag[i] = constants.k0;
        self.eccentricity[i] = mean.eccentricity;
        self.c1[i] = constants.c1;
        self.c4[i] = constants.c4;
        self.mean_motion_k1[i] = mean.mean_motion * constants.k1;
    }

    /// Minutes from each epoch.
    #[inline(always)]
    pub fn minutes<S: Simd>(&self, part: Part<S>, when: When) -> Lanes<S> {
        match when {
            When::At(Instant { day, minute }) => {
                self.since_epochs(part, part.splat(day), part.splat(minute))
            }
            When::After(minutes) => part.splat(minutes),
        }
    }

    /// Minutes from the epoch of the broadcast object to the instant of each slot.
    #[inline(always)]
    pub fn minutes_to<S: Simd>(&self, part: Part<S>, instants: &Instants) -> Lanes<S> {
        let Instants { day, minute, .. } = instants;
        self.since_epochs(part, part.each(day), part.each(minute))
    }

    #[inline(always)]
    fn since_epochs<S: Simd>(&self, part: Part<S>, day: Lanes<S>, minute: Lanes<S>) -> Lanes<S> {
        let days = day - part.load(&self.day);
        days.mul_add(part.splat(DAY_MIN), minute - part.load(&self.minute))
    }

    /// p22 = node + node_dot t + k0 t^2.
    #[inline(always)]
    pub fn node_at<S: Simd>(&self, part: Part<S>, t: Lanes<S>) -> Lanes<S> {
        let linear = part.load(&self.node_dot).mul_add(t, part.load(&self.node));
        part.load(&self.node_drag).mul_add(t * t, linear)
    }

    /// p23 = perigee + perigee_dot t.
    #[inline(always)]
    pub fn perigee_at<S: Simd>(&self, part: Part<S>, t: Lanes<S>) -> Lanes<S> {
        let rate = part.load(&self.perigee_dot);
        rate.mul_add(t, part.load(&self.perigee))
    }

    /// p24 = M + M_dot t.
    #[inline(always)]
    pub fn mean_anomaly_at<S: Simd>(&self, part: Part<S>, t: Lanes<S>) -> Lanes<S> {
        let rate = part.load(&self.mean_anomaly_dot);
        rate.mul_add(t, part.load(&self.mean_anomaly))
    }
}
