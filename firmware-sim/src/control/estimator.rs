//! Estimates the rotation of the body between two frames from their centroids.
//!
//! 1. The shift on which most of the brightest stars agree gives a first alignment.
//! 2. Nearest pairs are matched, each star once.
//! 3. Weighted least squares fit three angles by the pinhole model. Outliers are removed, and the
//!    fit is repeated.
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::matching::{pairs, shift};
use crate::detector::{Detection, Detections};
use crate::pointing::turn;

/// Smallest number of matched stars for an estimate.
pub const MIN_STARS: usize = 4;

/// Camera model: boresight +Z, columns along +X, rows along +Y, no distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pinhole {
    /// Focal length over pixel pitch, px.
    pub focal_px: f64,
    /// Boresight in the frame, px; (0, 0) is the centre of the first pixel.
    pub centre_px: [f64; 2],
}

impl Pinhole {
    /// A camera with its boresight in the middle of a frame of this size.
    #[must_use]
    pub(crate) fn centred(focal_px: f64, size: [u16; 2]) -> Self {
        let centre_px = size.map(|pixels| (f64::from(pixels) - 1.0) / 2.0);
        Self {
            focal_px,
            centre_px,
        }
    }

    /// Direction of a point in the frame, camera axes, not normalized.
    #[must_use]
    pub(crate) fn direction(&self, [x_px, y_px]: [f64; 2]) -> Vector3<f64> {
        let [x, y] = self.centre_px;
        Vector3::new((x_px - x) / self.focal_px, (y_px - y) / self.focal_px, 1.0)
    }

    /// Position of a direction in the frame, px; `None` behind the camera.
    #[must_use]
    pub(crate) fn project(&self, direction: &Vector3<f64>) -> Option<[f64; 2]> {
        let [x, y] = self.centre_px;
        let scale = self.focal_px / direction.z;
        (direction.z > 0.0).then(|| [x + scale * direction.x, y + scale * direction.y])
    }
}

/// A star in a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Star {
    /// Column and row, px.
    pub at_px: [f64; 2],
    /// Signal to noise.
    pub snr: f64,
}

impl Star {
    /// Detections not cut by the frame's edge, brightest first.
    pub(super) fn of_all(detections: &Detections) -> Vec<Self> {
        /// Further stars cost time and add little.
        const MAX: usize = 300;
        let whole = detections.list().iter().filter(|found| !found.edge);
        let star = |found: &Detection| Self {
            at_px: [found.x_px, found.y_px],
            snr: found.snr,
        };
        whole.map(star).take(MAX).collect()
    }

    /// Variance of the centroid, px^2: noise (1 px over the signal to noise) and pixel grid.
    fn variance(&self) -> f64 {
        const GRID_PX: f64 = 0.03;
        GRID_PX * GRID_PX + 1.0 / (self.snr * self.snr).max(1e-3)
    }
}

/// Estimated rotation of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Rotation vector from the reference to the current frame, body axes, rad.
    pub turned_rad: Vector3<f64>,
    /// Number of stars used.
    pub stars: usize,
    /// Weighted rms distance between seen and predicted positions, px.
    pub residual_px: f64,
}

/// Direction of a reference star, the reference star, and the star matched to it.
type Pair<'a> = (Vector3<f64>, &'a Star, &'a Star);

/// Rotation since `reference`, given the stars `seen` now, both brightest first. `guess` (rad) may
/// be wrong by some 100 px. `None` if fewer than [`MIN_STARS`], or fewer than a quarter of the
/// shorter list, agree.
#[must_use]
pub fn estimate(
    pinhole: &Pinhole,
    reference: &[Star],
    seen: &[Star],
    guess: Vector3<f64>,
) -> Option<Estimate> {
    /// Matching radii, px: after the shift, then after each fit.
    const RADII_PX: [f64; 3] = [3.0, 1.5, 1.5];
    let directions = reference.iter();
    let directions = directions.map(|star| pinhole.direction(star.at_px));
    let directions: Vec<_> = directions.collect();
    let seen_px: Vec<_> = seen.iter().map(|star| star.at_px).collect();
    let expected = |turned: &UnitQuaternion<f64>| -> Vec<Option<[f64; 2]>> {
        let places = directions.iter();
        places.map(|of| pinhole.project(&(turned * of))).collect()
    };
    let mut turned = turn(guess);
    let [dx, dy] = shift(&expected(&turned), &seen_px)?;
    // In the middle of the frame a rotation about +Y by a moves stars by a towards -X.
    let by_shift = Vector3::new(dy, -dx, 0.0) / pinhole.focal_px;
    turned = turn(by_shift) * turned;
    let mut inliers = Vec::new();
    for radius_px in RADII_PX {
        let matched = pairs(&expected(&turned), &seen_px, radius_px).into_iter();
        let matched = matched.map(|(of, to)| (directions[of], &reference[of], &seen[to]));
        (turned, inliers) = fit(pinhole, turned, matched.collect())?;
    }
    if inliers.len() < MIN_STARS.max(reference.len().min(seen.len()) / 4) {
        return None;
    }
    let (mut sum, mut weights) = (0.0, 0.0);
    for pair in &inliers {
        let weight = weight(pair);
        sum += weight * residual(pinhole, &turned, pair)?.norm_squared();
        weights += weight;
    }
    Some(Estimate {
        turned_rad: -turned.scaled_axis(),
        stars: inliers.len(),
        residual_px: (sum / weights).sqrt(),
    })
}

/// Fits the rotation to the pairs, starting from `turned`. Returns it with the inliers.
fn fit<'a>(
    pinhole: &Pinhole,
    mut turned: UnitQuaternion<f64>,
    pairs: Vec<Pair<'a>>,
) -> Option<(UnitQuaternion<f64>, Vec<Pair<'a>>)> {
    const ROUNDS: usize = 3;
    /// An outlier exceeds this number of medians (1 in 5,000 for normal errors) and
    /// [`TOLERATED_PX`]. Outliers are removed before the first step too: a bright false star would
    /// bias it.
    const MEDIANS: f64 = 3.5;
    const TOLERATED_PX: f64 = 0.1;
    let mut inliers = Vec::new();
    for _ in 0..ROUNDS {
        let off =
            |pair: &Pair<'_>| residual(pinhole, &turned, pair).map_or(f64::INFINITY, |m| m.norm());
        let mut all: Vec<f64> = pairs.iter().map(off).collect();
        all.sort_by(f64::total_cmp);
        let median = all.get(all.len() / 2)?;
        let limit = (MEDIANS * median).max(TOLERATED_PX);
        let agrees = |pair: &Pair<'_>| off(pair) <= limit;
        inliers = pairs.iter().copied().filter(agrees).collect();
        if inliers.len() < MIN_STARS {
            return None;
        }
        turned = turn(step(pinhole, &turned, &inliers)?) * turned;
    }
    Some((turned, inliers))
}

/// One Gauss-Newton step: the small rotation that minimizes the residuals, rad.
fn step(
    pinhole: &Pinhole,
    turned: &UnitQuaternion<f64>,
    pairs: &[Pair<'_>],
) -> Option<Vector3<f64>> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for pair in pairs {
        let direction = turned * pair.0;
        let (u, v) = (direction.x / direction.z, direction.y / direction.z);
        let off = residual(pinhole, turned, pair)?;
        let weight = weight(pair);
        // A rotation d of the body changes a direction r to r - d x r.
        let rows = [
            (Vector3::new(u * v, -1.0 - u * u, v), off.x),
            (Vector3::new(1.0 + v * v, -u * v, -u), off.y),
        ];
        for (row, off_px) in rows {
            let row = row * pinhole.focal_px;
            normal += row * row.transpose() * weight;
            right += row * (off_px * weight);
        }
    }
    let step = normal.cholesky()?.solve(&right);
    step.norm_squared().is_finite().then_some(step)
}

/// Residual: seen minus predicted position, px.
fn residual(
    pinhole: &Pinhole,
    turned: &UnitQuaternion<f64>,
    (direction, _, seen): &Pair<'_>,
) -> Option<nalgebra::Vector2<f64>> {
    let [x, y] = pinhole.project(&(turned * direction))?;
    let [seen_x, seen_y] = seen.at_px;
    Some(nalgebra::Vector2::new(seen_x - x, seen_y - y))
}

/// Weight of a pair, 1 / px^2.
fn weight((_, of, to): &Pair<'_>) -> f64 {
    1.0 / (of.variance() + to.variance())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::tests::{Noise, Sky};

    const PINHOLE: Pinhole = Pinhole {
        focal_px: 1000.0,
        centre_px: [255.5, 191.5],
    };
    const SIZE: [u16; 2] = [512, 384];

    fn stars(sky: &Sky, turned: Vector3<f64>, noise: &mut Noise) -> Vec<Star> {
        sky.stars(&PINHOLE, SIZE, &turn(turned), noise)
    }

    #[test]
    fn small_rotations_are_estimated_to_well_below_centroid_noise() {
        let mut noise = Noise(7);
        let sky = Sky::around(&PINHOLE, SIZE, 60, &mut noise);
        let (mut across, mut roll, mut count) = (0.0, 0.0, 0.0);
        for index in 0..40 {
            let direction = Vector3::new(noise.normal(), noise.normal(), noise.normal());
            // From 0 to 30 px.
            let turned = direction.normalize() * (f64::from(index) * 0.75e-3);
            let reference = stars(&sky, Vector3::zeros(), &mut noise);
            let seen = stars(&sky, turned, &mut noise);
            let found = estimate(&PINHOLE, &reference, &seen, Vector3::zeros()).unwrap();
            let off = (found.turned_rad - turned) * PINHOLE.focal_px;
            across += off.xy().norm_squared();
            roll += off.z * off.z;
            count += 1.0;
            assert!(found.stars > 40, "{found:?}");
        }
        // A centroid has an error of 0.05 px along each axis (X-Val: signal to noise of 20), a pair
        // of 0.071. Over the square root of 50 stars: 0.010 px about X and Y each, 0.014 together.
        // Roll is some three times worse, because stars lie within a third of the focal length from
        // the centre, 0.17 of it on average.
        let (across, roll) = (f64::sqrt(across / count), f64::sqrt(roll / count));
        println!("across {across:.4} px, about the boresight {roll:.4} px");
        assert!(across < 0.02 && roll < 0.08, "{across} {roll}");
    }

    #[test]
    fn noiseless_estimates_are_exact_for_distant_guesses() {
        let mut noise = Noise(3);
        let sky = Sky::around(&PINHOLE, SIZE, 60, &mut noise);
        let mut still = Noise(0);
        let reference = stars(&sky, Vector3::zeros(), &mut still);
        for (turned, guess) in [
            (Vector3::new(1e-3, -2e-3, 3e-3), Vector3::zeros()),
            (Vector3::new(0.05, 0.04, 0.002), Vector3::zeros()),
            (Vector3::new(0.11, 0.12, 0.02), Vector3::new(0.1, 0.1, 0.02)),
        ] {
            let seen = stars(&sky, turned, &mut still);
            let found = estimate(&PINHOLE, &reference, &seen, guess).unwrap();
            assert!((found.turned_rad - turned).norm() < 1e-9, "{found:?}");
            assert!(found.residual_px < 1e-6);
        }
    }

    #[test]
    fn false_stars_do_not_bias_the_estimate() {
        let mut noise = Noise(11);
        let sky = Sky::around(&PINHOLE, SIZE, 40, &mut noise);
        let turned = Vector3::new(2e-3, 1e-3, -1e-3);
        let mut reference = stars(&sky, Vector3::zeros(), &mut noise);
        let mut seen = stars(&sky, turned, &mut noise);
        // Ten bright hot pixels at fixed positions, ten stray lights different in each frame, two
        // stars missing.
        for index in 0..10 {
            let hot = Star {
                at_px: [40.0 * f64::from(index) + 30.0, 170.0],
                snr: 100.0,
            };
            let mut stray = || Star {
                at_px: [500.0 * noise.uniform(), 380.0 * noise.uniform()],
                snr: 30.0,
            };
            reference.insert(0, hot);
            reference.push(stray());
            seen.insert(0, hot);
            seen.push(stray());
        }
        seen.remove(20);
        seen.remove(25);
        let found = estimate(&PINHOLE, &reference, &seen, Vector3::zeros()).unwrap();
        let off_px = (found.turned_rad - turned).xy().norm() * PINHOLE.focal_px;
        assert!(off_px < 0.05, "{off_px} px: {found:?}");
    }

    #[test]
    fn too_few_or_different_stars_give_no_estimate() {
        let mut noise = Noise(5);
        let sky = Sky::around(&PINHOLE, SIZE, 40, &mut noise);
        let other = Sky::around(&PINHOLE, SIZE, 40, &mut noise);
        let reference = stars(&sky, Vector3::zeros(), &mut noise);
        let none = Vector3::zeros();
        for seen in [&[][..], &reference[..3], &stars(&other, none, &mut noise)] {
            assert_eq!(estimate(&PINHOLE, &reference, seen, none), None);
        }
        assert!(estimate(&PINHOLE, &reference, &reference[..4], none).is_some());
        assert_eq!(estimate(&PINHOLE, &[], &reference, none), None);
    }
}
