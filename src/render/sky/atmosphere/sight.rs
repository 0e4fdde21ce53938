//! Lines of sight through the atmosphere, in the plane of the observer's zenith and the line.
//!
//! Stretched space has a spherical Earth (see [`Earth`](crate::sky::shadow::Earth)). A line has the
//! distance `p` from the centre; a point at the distance `s` along it from its point nearest to the
//! centre has the radius `r^2 = p^2 + s^2`.

use super::air::TOP_M;
use crate::sky::shadow::EARTH_RADIUS_M;

/// The kind of a line of sight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sight {
    /// To the ground, with this cosine of the zenith distance there (0: the horizon, 1: straight
    /// down).
    Ground(f64),
    /// Past the Earth, with this lowest altitude (m).
    Past(f64),
    /// Upwards, from an observer inside the atmosphere, at this cosine of the zenith distance.
    Up(f64),
    /// To space.
    Away,
}

/// A line of sight: its distance from the centre, and its part in the atmosphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Line {
    pub sight: Sight,
    /// m.
    pub p: f64,
    /// Cosine and sine of the angle between the line and the observer's zenith.
    pub cos: f64,
    pub sin: f64,
    /// Ends of the part in the atmosphere along the line, m.
    pub from: f64,
    pub to: f64,
}

/// A point of a line: its position, the length that it represents, and its altitude, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    pub s: f64,
    pub length: f64,
    pub altitude: f64,
}

/// A line's widest spacing of points is about `exp(CROWDING)` times its narrowest.
const CROWDING: f64 = 4.5;

impl Sight {
    /// For a line from an observer at `radius` (m), by cosine and sine of its zenith distance.
    pub(crate) fn of(radius: f64, cos: f64, sin: f64) -> Sight {
        let p = radius * sin;
        if cos < 0.0 && p < EARTH_RADIUS_M {
            let part = p / EARTH_RADIUS_M;
            return Sight::Ground(((1.0 - part) * (1.0 + part)).sqrt());
        }
        let inside = radius < EARTH_RADIUS_M + TOP_M;
        if cos < 0.0 && p - EARTH_RADIUS_M < TOP_M {
            Sight::Past(p - EARTH_RADIUS_M)
        } else if cos >= 0.0 && inside {
            Sight::Up(cos)
        } else {
            Sight::Away
        }
    }

    /// The line of this sight from an observer at `radius` (m).
    pub(crate) fn line(self, radius: f64) -> Line {
        let p = match self {
            Sight::Ground(cos) => EARTH_RADIUS_M * ((1.0 - cos) * (1.0 + cos)).sqrt(),
            Sight::Past(altitude) => EARTH_RADIUS_M + altitude,
            Sight::Up(cos) => radius * ((1.0 - cos) * (1.0 + cos)).sqrt(),
            Sight::Away => radius,
        };
        let sin = (p / radius).min(1.0);
        let down = ((1.0 - sin) * (1.0 + sin)).sqrt();
        let cos = match self {
            Sight::Up(cos) => cos,
            _ => -down,
        };
        let top = half_chord(EARTH_RADIUS_M + TOP_M, p);
        let from = (radius * cos).max(-top);
        let to = match self {
            Sight::Ground(cos) => -EARTH_RADIUS_M * cos,
            Sight::Past(_) | Sight::Up(_) => top,
            Sight::Away => from,
        };
        Line {
            sight: self,
            p,
            cos,
            sin,
            from,
            to: to.max(from),
        }
    }
}

impl Line {
    /// `s` (m) of the line's reference point: on the ground, the lowest point, or the far end of
    /// the atmosphere.
    pub fn position(&self) -> f64 {
        match self.sight {
            Sight::Past(_) => 0.0,
            _ => self.to,
        }
    }

    /// The line in `count` parts, from the observer on. They are shortest in the densest air, at
    /// the lowest point.
    pub fn steps(&self, count: usize) -> impl Iterator<Item = Step> + '_ {
        let reach = self.from.abs().max(self.to.abs()).max(1.0);
        let span = self.to - self.from;
        let whole = libm::exp(CROWDING);
        let (spread, sinh) = (whole - 1.0, (whole - 1.0 / whole) / 2.0);
        // For equal steps of w, points lie at sinh(w) on both sides of a lowest point, else at
        // exp(w) - 1 from the ground or the observer. `e` is exp(w).
        let at = move |e: f64| match self.sight {
            Sight::Past(_) => reach * ((e - 1.0 / e) / 2.0) / sinh,
            Sight::Up(_) => self.from + span * (e - 1.0) / spread,
            Sight::Ground(_) | Sight::Away => self.to - span * (e - 1.0) / spread,
        };
        let position = move |s: f64| libm::asinh(s / reach * sinh);
        let [first, last] = match self.sight {
            Sight::Past(_) => [position(self.from), position(self.to)],
            Sight::Up(_) => [0.0, CROWDING],
            Sight::Ground(_) | Sight::Away => [CROWDING, 0.0],
        };
        let half_step = libm::exp((last - first) / (2 * count) as f64);
        let mut e = libm::exp(first);
        let mut edge = at(e);
        (0..count).map(move |_| {
            e *= half_step;
            let s = at(e);
            e *= half_step;
            let next = at(e);
            let length = next - edge;
            edge = next;
            let radius = (self.p * self.p + s * s).sqrt();
            Step {
                s,
                length,
                altitude: radius - EARTH_RADIUS_M,
            }
        })
    }
}

/// Half the chord of a sphere of `radius` on a line at the distance `p` from its centre, m.
pub(crate) fn half_chord(radius: f64, p: f64) -> f64 {
    ((radius - p) * (radius + p)).max(0.0).sqrt()
}
