//! Airglow along lines of sight, by shells.

use super::sight::{Line, Sight, half_chord};
use super::{Airglow, Atmosphere};
use crate::sky::shadow::EARTH_RADIUS_M;

/// Shells of airglow, m: thin ones around the layers of the mesopause, thick ones above.
const SHELLS: [(f64, f64, usize); 3] = [(60e3, 1e3, 15), (75e3, 0.25e3, 160), (115e3, 13e3, 45)];

/// The airglow in shells.
#[derive(Debug, Clone, PartialEq)]
pub struct Shells {
    /// Radius (m) of the lowest shell's foot.
    foot: f64,
    /// Of each shell its outer radius (m) and what a metre of it gives, ph/s/m^2/sr/m.
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

    /// Airglow along a line from an observer at `radius` (m), ph/s/m^2/sr: each shell's emission times the chords that it cuts before and
    /// behind the lowest point; what lies behind is dimmed by all the air on the way.
    pub fn along(&self, line: &Line, radius: f64, atmosphere: &Atmosphere) -> f64 {
        let behind = match line.sight {
            Sight::Ground(_) | Sight::Away => 0.0,
            Sight::Past(altitude_m) => {
                let grazing = atmosphere.air.column(altitude_m, 0.0);
                atmosphere.passed.at(2.0 * grazing)
            }
            Sight::Up(_) => 1.0,
        };
        // Before and behind: a shell around the observer is cut from where he stands on.
        let own = half_chord(radius, line.p);
        let is_up = matches!(line.sight, Sight::Up(_));
        let chords = |edge: f64| {
            let chord = half_chord(edge, line.p);
            if is_up {
                [own, chord.max(own)]
            } else {
                [chord.min(own), chord]
            }
        };
        let mut sum = 0.0;
        let mut inner = chords(self.foot);
        for (outer, emission) in &self.shells {
            let outer = chords(*outer);
            sum += emission * ((outer[0] - inner[0]) + behind * (outer[1] - inner[1]));
            inner = outer;
        }
        sum
    }
}
