//! V from the Hipparcos band, and B-V where the catalogue has no reliable one.

use crate::read::Hip;
use nalgebra::{SMatrix, SVector};

/// Degree of the polynomial in V-I plus one.
const TERMS: usize = 6;

/// Reddest V-I of the calibration stars.
const CALIBRATED: f64 = 3.6;
/// V-I range of the polynomial; below it the value at its lower end is used.
const V_I_RANGE: (f64, f64) = (-0.3, 3.0);
/// Slope of V-Hp above that range, mag per mag of V-I, up to V-I = 5.6. It is from V in the
/// Hipparcos catalogue of 1997 for 45 red stars with V-I from 4.2 to 5.5.
const RED_SLOPE: f64 = 0.46;
const REDDEST: f64 = 5.6;

/// V-Hp as a polynomial in (V-I) - 1, and the quality of the fit.
pub struct VFromHp {
    pub coefficients: [f64; TERMS],
    pub used: usize,
    /// Scatter of the used stars bluer than V-I = 1.6, mag.
    pub rms: f64,
    /// V-I of stars without any colour: the median of the catalogue.
    median_v_i: f64,
}

impl VFromHp {
    /// V = Hp, for the first matching.
    pub fn identity() -> VFromHp {
        VFromHp {
            coefficients: [0.0; TERMS],
            used: 0,
            rms: 0.0,
            median_v_i: 0.6,
        }
    }

    /// V from Hp and V-I.
    pub fn v(&self, star: &Hip) -> f64 {
        let v_i = if star.has_colour() {
            star.v_i
        } else {
            self.median_v_i
        };
        let red = (v_i.min(REDDEST) - V_I_RANGE.1).max(0.0);
        star.hp + self.polynomial(v_i.clamp(V_I_RANGE.0, V_I_RANGE.1)) + RED_SLOPE * red
    }

    fn polynomial(&self, v_i: f64) -> f64 {
        let terms = self.coefficients.iter().zip(powers(v_i));
        terms.map(|(c, x)| c * x).sum()
    }

    /// Largest difference (mag) between V of the Bright Star Catalogue and V from Hp that colour
    /// explains. It is five times the rms, and three times as much where V-I is missing, or redder
    /// than that of constant stars.
    pub fn tolerance(&self, star: &Hip) -> f64 {
        if star.has_colour() && star.v_i <= 2.0 {
            0.1
        } else {
            0.3
        }
    }

    /// Weighted least squares over pairs (star, V), clipped at four sigma, iterated.
    pub fn fit(pairs: &[(&Hip, f64)], median_v_i: f64) -> VFromHp {
        let mut fit = VFromHp {
            coefficients: [0.0; TERMS],
            used: 0,
            rms: 0.0,
            median_v_i,
        };
        for round in 0..12 {
            let mut normal = SMatrix::<f64, TERMS, TERMS>::zeros();
            let mut right = SVector::<f64, TERMS>::zeros();
            let (mut used, mut blue, mut squares) = (0, 0, 0.0);
            for (star, v) in pairs.iter().filter(|(star, _)| star.v_i <= CALIBRATED) {
                let (sigma, p) = (sigma(star.v_i), SVector::from(powers(star.v_i)));
                let residual = v - star.hp - fit.polynomial(star.v_i);
                if round > 0 && residual.abs() > 4.0 * sigma {
                    continue;
                }
                normal += p * p.transpose() / (sigma * sigma);
                right += p * (v - star.hp) / (sigma * sigma);
                used += 1;
                if star.v_i < 1.6 {
                    blue += 1;
                    squares += residual * residual;
                }
            }
            if let Some(factor) = normal.cholesky() {
                // Rounded to 1e-5 mag, so that the printed coefficients are those in use.
                fit.coefficients = factor.solve(&right).map(|c| (c * 1e5).round() / 1e5).into();
            }
            (fit.used, fit.rms) = (used, (squares / f64::from(blue.max(1))).sqrt());
        }
        fit
    }
}

/// Expected scatter of V-Hp: photometric for ordinary colours, larger for variable red giants.
fn sigma(v_i: f64) -> f64 {
    0.018 + 0.05 * (v_i - 1.6).max(0.0)
}

fn powers(v_i: f64) -> [f64; TERMS] {
    std::array::from_fn(|k| (v_i.max(V_I_RANGE.0) - 1.0).powi(k as i32))
}

/// Largest error of a measured B-V, mag; a larger one marks an estimate in steps of 0.1 mag.
pub const B_V_ERROR_LIMIT: f64 = 0.2;

/// B-V as a function of V-I: medians of well measured stars in bins of 0.1 mag.
pub struct ColourTable {
    /// (V-I, B-V), ascending.
    knots: Vec<(f64, f64)>,
    median: (f64, f64),
}

impl ColourTable {
    pub fn new(stars: &[Hip]) -> ColourTable {
        let good: Vec<&Hip> = stars
            .iter()
            .filter(|s| s.hp <= 9.0 && s.b_v_error > 0.0 && s.b_v_error < 0.03)
            .collect();
        let knots = (-3..48)
            .filter_map(|bin| {
                let inside = |s: &&&Hip| (s.v_i * 10.0 - f64::from(bin)).abs() <= 0.5;
                let mut colours: Vec<f64> = good.iter().filter(inside).map(|s| s.b_v).collect();
                (colours.len() >= 3).then(|| (0.1 * f64::from(bin), median(&mut colours)))
            })
            .collect();
        let mut both: [Vec<f64>; 2] = [vec![], vec![]];
        for star in good {
            both[0].push(star.v_i);
            both[1].push(star.b_v);
        }
        let [v_i, b_v] = &mut both;
        ColourTable {
            knots,
            median: (median(v_i), median(b_v)),
        }
    }

    /// Median V-I of the stars down to Hp 9.
    pub fn median_v_i(&self) -> f64 {
        self.median.0
    }

    /// Median B-V of the stars down to Hp 9.
    pub fn median_b_v(&self) -> f64 {
        self.median.1
    }

    /// B-V: as measured; from V-I where it is an estimate; the median without a colour.
    pub fn b_v(&self, star: &Hip) -> (f64, Origin) {
        if !star.has_colour() {
            (self.median.1, Origin::Median)
        } else if star.b_v_error < B_V_ERROR_LIMIT {
            (star.b_v, Origin::Measured)
        } else {
            (self.interpolate(star.v_i), Origin::FromVI)
        }
    }

    fn interpolate(&self, v_i: f64) -> f64 {
        let after = self.knots.partition_point(|knot| knot.0 <= v_i);
        let knot = |k: usize| self.knots[k.min(self.knots.len() - 1)];
        let ((x0, y0), (x1, y1)) = (knot(after.saturating_sub(1)), knot(after));
        if x1 > x0 && v_i > x0 {
            y0 + (y1 - y0) * (v_i - x0) / (x1 - x0)
        } else {
            y0
        }
    }
}

/// Origin of B-V.
#[derive(Clone, Copy, PartialEq)]
pub enum Origin {
    Measured,
    FromVI,
    Median,
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The magnitude of the sum of several stars' light.
pub fn sum_mag(mags: impl IntoIterator<Item = f64>) -> f64 {
    let flux: f64 = mags.into_iter().map(|m| 10f64.powf(-0.4 * m)).sum();
    -2.5 * flux.log10()
}
