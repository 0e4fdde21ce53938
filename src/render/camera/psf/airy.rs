//! Diffraction by a round aperture with a round central obscuration, averaged over the light of a
//! band.
//!
//! Born & Wolf, Principles of Optics, 8.6.2: with `x = pi r / (lambda N)`, N the focal ratio and
//! `e` the obscured part of the diameter,
//! `I(x) = ((2 J1(x) / x - e^2 2 J1(e x) / (e x)) / (1 - e^2))^2`, with
//! `int I x dx = 2 / (1 - e^2)`. Far out `J1(x)^2` averages to `1 / (pi x)`, and the light outside
//! of `x` to `2 / (pi (1 - e) x)`. Unit of width: `lambda N` at the band's reference wavelength.

use super::circular::Quadrant;
use skyloop_base::range::nearest;
use std::f64::consts::PI;

/// Parameters and table of a band's diffraction.
#[derive(Debug, PartialEq)]
pub struct Airy {
    obscuration: f64,
    /// Half the width at half maximum.
    half_width: f64,
    table: Quadrant,
}

/// The encircled energy of one wavelength, at equal steps of `x`.
struct Energy {
    obscuration: f64,
    values: Vec<f64>,
}

/// Step of that table in `x`.
const STEP: f64 = 0.05;
/// Greatest number of wavelengths that represent a band.
const WAVELENGTHS: usize = 48;

impl Airy {
    /// `band`: wavelengths in units of the reference and the light of each (any unit); invalid
    /// entries are ignored. The obscuration is limited to 0 to 0.9.
    pub fn new(obscuration: f64, band: &[(f64, f64)]) -> Airy {
        let obscuration = nearest(obscuration, 0.0..=0.9);

        let is_light = |(ratio, light): &&(f64, f64)| {
            *ratio > 0.0 && *light >= 0.0 && ratio.is_finite() && light.is_finite()
        };
        let band: Vec<(f64, f64)> = band.iter().filter(is_light).copied().collect();
        let rings = rings(obscuration);
        let mono = Energy::new(obscuration, PI * rings);
        let colours = thinned(&band);
        let energy = |r: f64| -> f64 {
            let part = |&(ratio, light): &(f64, f64)| light * mono.at(PI * r / ratio);
            colours.iter().map(part).sum()
        };
        // Tabulated, because [`Quadrant`] needs a million values of the mean over the band.
        let knee = (rings / 2.5).clamp(6.0, 16.0);
        let steps = (48.0 * knee) as usize;
        let profile = Profile::new(knee, 8 * steps, energy);
        let intensity = |r: f64| -> f64 {
            let part = |&(ratio, light): &(f64, f64)| {
                light * intensity(obscuration, PI * r / ratio) / (ratio * ratio)
            };
            colours.iter().map(part).sum()
        };
        let (mut low, mut high) = (0.0, 2.0);
        let half = intensity(0.0) / 2.0;
        for _ in 0..50 {
            let mid = (low + high) / 2.0;
            if intensity(mid) > half {
                low = mid
            } else {
                high = mid
            }
        }
        Airy {
            obscuration,
            half_width: low,
            table: Quadrant::new(knee, steps, |r| profile.at(r)),
        }
    }

    /// The table of its light.
    pub fn table(&self) -> &Quadrant {
        &self.table
    }

    /// Half its width at half maximum.
    pub(crate) fn half_width(&self) -> f64 {
        self.half_width
    }

    /// A radius outside of which less than `loss` of the light falls.
    pub(crate) fn reach(&self, loss: f64) -> f64 {
        // The light outside oscillates around its mean by a part that falls with r. As no more
        // than all light is outside, 1.3 times the mean bounds it.
        1.3 * 2.0 / (PI * PI * (1.0 - self.obscuration) * loss)
    }

    /// A radius outside of which the light per unit area, averaged over rings, is below `share`.
    pub(crate) fn faint(&self, share: f64) -> f64 {
        libm::cbrt(1.0 / (PI * PI * PI * (1.0 - self.obscuration) * share))
    }
}

/// Radius (in units of the width) up to which rings are resolved: the brightest ring beyond is
/// below 1e-5 of the peak. On average rings have `4 (1 + sqrt e)^2 / (pi x^3 (1 - e^2)^2)` of the
/// peak.
fn rings(e: f64) -> f64 {
    let height = 4.0 * (1.0 + e.sqrt()).powi(2) / (PI * (1.0 - e * e).powi(2));
    libm::cbrt(height / 1e-5) / PI
}

/// `I(x)`, 1 at the centre.
fn intensity(e: f64, x: f64) -> f64 {
    // 2 J1(x) / x; its limit at 0 is 1.
    let jinc = |x: f64| if x < 1e-4 { 1.0 } else { 2.0 * libm::j1(x) / x };
    let amplitude = (jinc(x) - e * e * jinc(e * x)) / (1.0 - e * e);
    amplitude * amplitude
}

impl Energy {
    fn new(obscuration: f64, to: f64) -> Energy {
        // Simpson's rule over each step.
        let norm = (1.0 - obscuration * obscuration) / 2.0;
        let flux = |x: f64| norm * intensity(obscuration, x) * x;
        let steps = (to / STEP).ceil() as usize + 4;
        let (mut sum, mut values) = (0.0, vec![0.0]);
        let mut from = flux(0.0);
        for i in 0..steps {
            let x = i as f64 * STEP;
            let past = flux(x + STEP);
            sum += STEP / 6.0 * (from + 4.0 * flux(x + STEP / 2.0) + past);
            values.push(sum);
            from = past;
        }
        Energy {
            obscuration,
            values,
        }
    }

    /// `E(x)`: from the table, and far out the mean over the rings, blended over the table's outer
    /// third.
    fn at(&self, x: f64) -> f64 {
        let end = (self.values.len() - 3) as f64 * STEP;
        let mean = 1.0 - 2.0 / (PI * (1.0 - self.obscuration) * x.max(1e-9));
        if x >= end {
            return mean;
        }
        let exact = cubic(&self.values, x / STEP);
        let blend = ((x / end - 2.0 / 3.0) * 3.0).max(0.0);
        exact + (mean - exact) * blend * blend * (3.0 - 2.0 * blend)
    }
}

/// The encircled energy of the whole band on nodes like those of [`Quadrant`].
struct Profile {
    knee: f64,
    values: Vec<f64>,
}

impl Profile {
    fn new(knee: f64, steps: usize, energy: impl Fn(f64) -> f64) -> Profile {
        let mut values: Vec<f64> = (0..steps)
            .map(|k| energy(knee * k as f64 / (steps - k) as f64))
            .collect();
        values.push(1.0);
        Profile { knee, values }
    }

    fn at(&self, r: f64) -> f64 {
        cubic(
            &self.values,
            (self.values.len() - 1) as f64 * (r / (self.knee + r)),
        )
    }
}

/// Lagrange's cubic through the four values around the index `at`.
fn cubic(values: &[f64], at: f64) -> f64 {
    let first = (at as usize).saturating_sub(1).min(values.len() - 4);
    let t = at - first as f64;
    let (t1, t2, t3) = (t - 1.0, t - 2.0, t - 3.0);
    match values.get(first..first + 4) {
        Some([a, b, c, d]) => {
            -a * t1 * t2 * t3 / 6.0 + b * t * t2 * t3 / 2.0 - c * t * t1 * t3 / 2.0
                + d * t * t1 * t2 / 6.0
        }
        _ => 0.0,
    }
}

/// Neighbouring wavelengths merged to at most [`WAVELENGTHS`], their light normalised to 1.
fn thinned(band: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let total: f64 = band.iter().map(|(_, light)| light).sum();
    band.chunks(band.len().div_ceil(WAVELENGTHS).max(1))
        .map(|chunk| {
            let light: f64 = chunk.iter().map(|(_, light)| light).sum();
            let mean = chunk
                .iter()
                .map(|(ratio, light)| ratio * light)
                .sum::<f64>();
            (mean / light.max(f64::MIN_POSITIVE), light / total)
        })
        .filter(|(_, light)| *light > 0.0)
        .collect()
}
