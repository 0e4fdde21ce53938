//! Lines of sight through the atmosphere, in the plane of the observer's zenith and the line.
//!
//! Stretched space has a spherical Earth (see [`Earth`](crate::sky::shadow::Earth)). A line passes
//! the centre at the distance `p`; a point of it lies at `s` from its nearest one, at the radius
//! `r^2 = p^2 + s^2`.

use super::air::TOP_M;
use crate::sky::shadow::EARTH_RADIUS_M;

/// Where a line of sight leads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sight {
    /// To the ground, which it meets at this cosine of the zenith distance (0: the horizon, 1:
    /// straight down).
    Ground(f64),
    /// Past the Earth, this far (m) above the ground at its lowest.
    Past(f64),
    /// Upwards, from an observer inside the atmosphere, at this cosine of the zenith distance.
    Up(f64),
    /// To space.
    Away,
}

/// A line of sight: its distance from the centre, and the part of it that lies in the atmosphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    pub sight: Sight,
    /// m.
    pub p: f64,
    /// Cosine and sine of the angle between the line and the observer's zenith.
    pub cos: f64,
    pub sin: f64,
    /// From here, along the line, to there, m.
    pub from: f64,
    pub to: f64,
}

/// A point of a line: where, how much of the line it stands for, and its altitude, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    pub s: f64,
    pub length: f64,
    pub altitude: f64,
}

/// How much closer the points of a line lie where the air is densest than where it is thin.
const CROWDING: f64 = 4.5;

impl Sight {
    /// Of a line from an observer at `radius` (m), at cosine `cos` of its zenith distance.
    pub fn of(radius: f64, cos: f64, sin: f64) -> Sight {
        let p = radius * sin;
        if cos < 0.0 && p < EARTH_RADIUS_M {
            let part = p / EARTH_RADIUS_M;
            return Sight::Ground(((1.0 - part) * (1.0 + part)).sqrt());
        }
        let inside = radius < EARTH_RADIUS_M + TOP_M;
        match cos < 0.0 {
            true if p - EARTH_RADIUS_M < TOP_M => Sight::Past(p - EARTH_RADIUS_M),
            false if inside => Sight::Up(cos),
            _ => Sight::Away,
        }
    }

    /// The line of this sight from an observer at `radius` (m).
    pub fn line(self, radius: f64) -> Line {
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
    /// The point of the line that stands for its place: on the ground, the lowest, or where it
    /// leaves the atmosphere.
    pub fn position(&self) -> f64 {
        match self.sight {
            Sight::Past(_) => 0.0,
            _ => self.to,
        }
    }

    /// The line in at most `count` parts, the observer's first. They lie closest where the air is
    /// densest: at the lowest point.
    pub fn steps(&self, count: usize) -> impl Iterator<Item = Step> + '_ {
        let reach = self.from.abs().max(self.to.abs()).max(1.0);
        let span = self.to - self.from;
        let whole = libm::exp(CROWDING);
        let (spread, sinh) = (whole - 1.0, (whole - 1.0 / whole) / 2.0);
        // Of the lowest point, sinh(w) opens to both sides; of the ground and the observer's own
        // place, exp(w) - 1 to one. `e` is exp(w).
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

/// Half the chord that a sphere of `radius` cuts from a line at the distance `p` from its centre,
/// m.
pub fn half_chord(radius: f64, p: f64) -> f64 {
    ((radius - p) * (radius + p)).max(0.0).sqrt()
}
