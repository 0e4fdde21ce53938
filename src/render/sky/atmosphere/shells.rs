//! Airglow along lines of sight, by shells.

use super::air::Air;
use super::airglow::Airglow;
use super::curve::Curve;
use super::sight::{Line, Sight, half_chord};
use crate::sky::shadow::EARTH_RADIUS_M;

/// Sets of airglow shells: lowest altitude (m), thickness (m) and number; thin around the layers of
/// the mesopause, thick above.
const SHELLS: [(f64, f64, usize); 3] = [(60e3, 1e3, 15), (75e3, 0.25e3, 160), (115e3, 13e3, 45)];

/// The airglow in shells.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Shells {
    /// Radius (m) of the lowest shell's inner side.
    foot: f64,
    /// Outer radius (m) and emission per metre, ph/s/m^2/sr/m, of each shell.
    shells: Vec<(f64, f64)>,
}

impl Shells {
    pub fn of(airglow: &Airglow) -> Shells {
        let edges = SHELLS.iter().flat_map(|&(from, step, count)| {
            (1..=count).map(move |k| (from + k as f64 * step, step))
        });
        let shell =
            |(top, step): (f64, f64)| (EARTH_RADIUS_M + top, airglow.emission(top - step / 2.0));
        Shells {
            foot: EARTH_RADIUS_M + SHELLS[0].0,
            shells: edges.map(shell).collect(),
        }
    }

    /// Airglow along a line from an observer at `radius` (m), ph/s/m^2/sr, from both sides of the
    /// lowest point. Light from the far side is dimmed by all air of the line.
    pub fn along(&self, line: &Line, radius: f64, air: &Air, passed: &Curve) -> f64 {
        let before = || self.between(line.p, [0.0, radius]);
        match line.sight {
            Sight::Ground(_) | Sight::Away => before(),
            Sight::Past(altitude_m) => {
                let grazing = air.column(altitude_m, 0.0);
                let behind = passed.at(2.0 * grazing);
                before() + behind * self.between(line.p, [0.0, f64::INFINITY])
            }
            Sight::Up(_) => self.between(line.p, [radius, f64::INFINITY]),
        }
    }

    /// Emission between two radii (m) on one side of a line at the distance `p` (m) from the
    /// centre: each shell's emission times its chord.
    fn between(&self, p: f64, [from, to]: [f64; 2]) -> f64 {
        let from = from.max(p).max(self.foot);
        let first = self.shells.partition_point(|(outer, _)| *outer <= from);
        let (mut sum, mut inner) = (0.0, half_chord(from, p));
        for (outer, emission) in &self.shells[first..] {
            if *outer >= to {
                return sum + emission * (half_chord(to.max(from), p) - inner);
            }
            let chord = half_chord(*outer, p);
            sum += emission * (chord - inner);
            inner = chord;
        }
        sum
    }
}
