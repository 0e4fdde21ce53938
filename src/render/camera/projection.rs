//! From direction to the detector plane, in units of the focal length, and back.
//!
//! Pinhole: `(x, y) = (X, Y) / Z`. Brown-Conrady (Brown 1966, Photogrammetric Engineering 32, 444),
//! in OpenCV's form, with `r^2 = x^2 + y^2`:
//! `x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)`,
//! `y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y`. Fisheye, equidistant
//! (Kannala & Brandt 2006, PAMI 28, 1335), in OpenCV's form, with `t` the angle from the boresight:
//! `r' = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8)`, along the azimuth of the direction.
//!
//! The polynomials have a turning point. The model ends there: directions further out have no
//! image, and pixels beyond the image of that fold have no direction. The inverse is by Newton's
//! method, to 1e-13 of the focal length.

use nalgebra::Vector3;
use std::f64::consts::PI;

/// A projection and its valid range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Projection {
    model: Model,
    /// End of the valid range: tangent of the angle from the boresight (Brown-Conrady), or the
    /// angle (fisheye, rad).
    end: f64,
}

/// The equations of a projection.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Model {
    /// Straight lines stay straight.
    Pinhole,
    /// A pinhole with radial and tangential distortion.
    BrownConrady {
        /// Radial: k1, k2, k3.
        k: [f64; 3],
        /// Tangential: p1, p2.
        p: [f64; 2],
    },
    /// Equidistant in angle, with radial distortion.
    Fisheye {
        /// Radial: k1 to k4.
        k: [f64; 4],
    },
}

/// Directions nearer than this to the plane of the aperture (sine of the angle) have no image
/// behind a pinhole.
const GRAZING: f64 = 1e-6;
/// Greatest number of Newton steps: some twenty near the fold, else five.
const MAX_STEPS: usize = 60;

impl Projection {
    /// The pinhole.
    pub const PINHOLE: Projection = Projection {
        model: Model::Pinhole,
        end: f64::INFINITY,
    };

    /// The projection by `model`; Brown-Conrady without distortion becomes the pinhole.
    pub fn new(model: Model) -> Projection {
        let none = Model::BrownConrady {
            k: [0.0; 3],
            p: [0.0; 2],
        };
        let model = if model == none { Model::Pinhole } else { model };
        let end = match &model {
            Model::Pinhole => f64::INFINITY,
            Model::BrownConrady { k, p } => first_fold(k, p),
            Model::Fisheye { k } => first_turn(k),
        };
        Projection { model, end }
    }

    /// Its equations.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The same without its coefficients.
    pub fn ideal(&self) -> Projection {
        match self.model {
            Model::Pinhole | Model::BrownConrady { .. } => Projection::PINHOLE,
            // Its radius grows up to pi.
            Model::Fisheye { .. } => Projection {
                model: Model::Fisheye { k: [0.0; 4] },
                end: PI,
            },
        }
    }

    /// Whether it has no distortion.
    pub fn is_ideal(&self) -> bool {
        match self.model {
            Model::Pinhole => true,
            Model::BrownConrady { k, p } => k == [0.0; 3] && p == [0.0; 2],
            Model::Fisheye { k } => k == [0.0; 4],
        }
    }

    /// The greatest angle from the boresight that has an image, rad.
    pub fn end_rad(&self) -> f64 {
        match self.model {
            Model::Fisheye { .. } => self.end,
            _ => libm::atan(self.end),
        }
    }

    /// The image of a direction (any length, camera axes), in focal lengths from the principal
    /// point; none of an invalid direction.
    pub fn image(&self, direction: &Vector3<f64>) -> Option<[f64; 2]> {
        let [x, y, z] = [direction.x, direction.y, direction.z];
        if let Model::Fisheye { k } = &self.model {
            let across = libm::hypot(x, y);
            let angle = libm::atan2(across, z);
            if across == 0.0 {
                return (z > 0.0).then_some([0.0; 2]);
            }
            let radius = angle * even(k, angle * angle).0;
            let seen = angle < self.end && across.is_finite();
            return seen.then_some([radius * (x / across), radius * (y / across)]);
        }
        // False for NaN.
        let is_before = z > GRAZING * direction.norm();
        if !is_before {
            return None;
        }
        let at = [x / z, y / z];
        match &self.model {
            Model::BrownConrady { k, p } => {
                (libm::hypot(at[0], at[1]) < self.end).then(|| distorted(k, p, at).0)
            }
            _ => Some(at),
        }
    }

    /// The solid angle (sr) of a square whose sides are one focal length, at the scale of a
    /// direction (unit vector, camera axes): `cos^3` for a pinhole, divided by the area factor of
    /// the distortion; `sin(a) / (r dr/da)` for a fisheye.
    pub fn solid_angle(&self, direction: &Vector3<f64>) -> f64 {
        let z = direction.z;
        match &self.model {
            Model::Pinhole => z * z * z,
            Model::BrownConrady { k, p } => {
                let (_, [a, b, c]) = distorted(k, p, [direction.x / z, direction.y / z]);
                z * z * z / (a * c - b * b)
            }
            Model::Fisheye { k } => {
                let across = libm::hypot(direction.x, direction.y);
                let (radius, slope) = radius_of(k, libm::atan2(across, z));
                if radius > 0.0 {
                    across / (radius * slope)
                } else {
                    1.0
                }
            }
        }
    }

    /// The unit direction (camera axes) of an image at `at`, in focal lengths from the principal
    /// point: the inverse of [`Projection::image`]. None beyond the model's end.
    pub fn direction(&self, at: [f64; 2]) -> Option<Vector3<f64>> {
        match &self.model {
            Model::Pinhole => Vector3::new(at[0], at[1], 1.0)
                .try_normalize(0.0)
                .filter(|direction| direction.z > 0.0),
            Model::BrownConrady { k, p } => {
                let [x, y] = undistorted(k, p, at, self.end)?;
                Some(Vector3::new(x, y, 1.0).normalize())
            }
            Model::Fisheye { k } => {
                let radius = libm::hypot(at[0], at[1]);
                if radius == 0.0 {
                    return Some(Vector3::z());
                }
                let angle = angle_of(k, radius, self.end)?;
                let (sin, cos) = libm::sincos(angle);
                Some(Vector3::new(
                    sin * at[0] / radius,
                    sin * at[1] / radius,
                    cos,
                ))
            }
        }
    }
}

/// `1 + k1 s + k2 s^2 + ...` and its derivative by s, by Horner's rule.
fn even(k: &[f64], s: f64) -> (f64, f64) {
    let (mut value, mut slope) = (0.0, 0.0);
    for k in k.iter().rev() {
        slope = slope * s + value;
        value = value * s + k;
    }
    (1.0 + s * value, value + s * slope)
}

/// The Brown-Conrady image of a pinhole point, and its derivatives
/// `[dx'/dx, dx'/dy = dy'/dx, dy'/dy]`.
fn distorted(k: &[f64; 3], [p1, p2]: &[f64; 2], [x, y]: [f64; 2]) -> ([f64; 2], [f64; 3]) {
    let s = x * x + y * y;
    let (radial, slope) = even(k, s);
    let image = [
        x * radial + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
        y * radial + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
    ];
    let derivatives = [
        radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
        2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y,
        radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
    ];
    (image, derivatives)
}

/// The greatest radius within which the Brown-Conrady map has no fold, up to 10,000 (89.99 deg).
///
/// Its matrix of derivatives is symmetric and starts as the unit matrix. While both eigenvalues are
/// positive, the map is the gradient of a convex function, and no two points have the same image.
/// Radii grow geometrically, since large coefficients of narrow fields cause folds at small radii.
fn first_fold(k: &[f64; 3], p: &[f64; 2]) -> f64 {
    const FURTHEST: f64 = 1e4;
    const NEAREST: f64 = 1e-8;
    let azimuths = if *p == [0.0; 2] { 1 } else { 72 };
    let folds = |radius: f64| {
        (0..azimuths).any(|i| {
            let (sin, cos) = libm::sincos(2.0 * PI * f64::from(i) / f64::from(azimuths));
            let (_, [a, b, c]) = distorted(k, p, [radius * cos, radius * sin]);
            a * c - b * b <= 0.0 || a + c <= 0.0
        })
    };
    let mut radius = 0.0;
    while radius < FURTHEST {
        let next = (1.002 * radius).max(NEAREST);
        if folds(next) {
            return bisect(radius, next, folds);
        }
        radius = next;
    }
    FURTHEST
}

/// The greatest angle (rad) up to which a fisheye's radius grows, at most pi.
fn first_turn(k: &[f64; 4]) -> f64 {
    let falls = |angle: f64| radius_of(k, angle).1 <= 0.0;
    let steps = 3000;
    let angle = |i: u32| PI * f64::from(i) / f64::from(steps);
    (1..=steps)
        .find(|i| falls(angle(*i)))
        .map_or(PI, |i| bisect(angle(i - 1), angle(i), falls))
}

/// The value between `low` and `high` at which `beyond` becomes true.
fn bisect(mut low: f64, mut high: f64, beyond: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..60 {
        let mid = (low + high) / 2.0;
        if beyond(mid) {
            high = mid;
        } else {
            low = mid;
        }
    }
    low
}

/// A fisheye's radius at an angle, and its derivative.
fn radius_of(k: &[f64; 4], angle: f64) -> (f64, f64) {
    let s = angle * angle;
    let (value, slope) = even(k, s);
    (angle * value, value + 2.0 * s * slope)
}

/// The pinhole point of a Brown-Conrady image, within `end`.
fn undistorted(k: &[f64; 3], p: &[f64; 2], at: [f64; 2], end: f64) -> Option<[f64; 2]> {
    let miss = |image: [f64; 2]| [at[0] - image[0], at[1] - image[1]];
    let size = |[x, y]: [f64; 2]| libm::hypot(x, y);
    let start = (0.9 * end / size(at).max(1e-300)).min(1.0);
    let mut point = at.map(|c| c * start);
    let (image, mut derivatives) = distorted(k, p, point);
    let mut left = miss(image);
    for _ in 0..MAX_STEPS {
        let [a, b, c] = derivatives;
        let det = a * c - b * b;
        let step = [
            (c * left[0] - b * left[1]) / det,
            (a * left[1] - b * left[0]) / det,
        ];
        if size(step) <= 1e-15 * (1.0 + size(point)) {
            break;
        }
        // Halve the step while it leaves the valid range or does not help.
        let better = (0..40)
            .map(|halvings| 0.5f64.powi(halvings))
            .find_map(|part| {
                let tried = [point[0] + part * step[0], point[1] + part * step[1]];
                let (image, derivatives) = distorted(k, p, tried);
                let left_then = miss(image);
                let helps = size(tried) < end && size(left_then) < size(left);
                helps.then_some((tried, derivatives, left_then))
            });
        let Some(next) = better else {
            break;
        };
        (point, derivatives, left) = next;
    }
    (size(left) <= 1e-13 * (1.0 + size(at))).then_some(point)
}

/// The angle (rad) below `end` of a fisheye's radius: Newton's method within a bracket.
fn angle_of(k: &[f64; 4], radius: f64, end: f64) -> Option<f64> {
    // Next to the fold radii differ in the last digits only.
    let max = radius_of(k, end).0 * (1.0 + 4.0 * f64::EPSILON);
    if radius.is_nan() || radius > max {
        return None;
    }
    let (mut low, mut high) = (0.0, end);
    let mut angle = radius.min(end / 2.0);
    for _ in 0..MAX_STEPS {
        let (value, slope) = radius_of(k, angle);
        if value < radius {
            low = angle;
        } else {
            high = angle;
        }
        let newton = angle + (radius - value) / slope;
        let next = if newton > low && newton < high {
            newton
        } else {
            (low + high) / 2.0
        };
        if (next - angle).abs() <= 1e-15 * (1.0 + angle) {
            return Some(next);
        }
        angle = next;
    }
    Some(angle)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lenses with distortion as in real cameras, and harder ones.
    fn lenses() -> Vec<Projection> {
        let brown = |k, p| Projection::new(Model::BrownConrady { k, p });
        let fisheye = |k| Projection::new(Model::Fisheye { k });
        vec![
            Projection::PINHOLE,
            brown([-0.28, 0.09, -0.01], [3e-4, -2e-4]),
            brown([0.12, 0.3, 0.0], [-1e-3, 2e-3]),
            brown([-0.4, 0.0, 0.0], [0.0, 0.0]),
            brown([0.0; 3], [0.02, -0.01]),
            fisheye([0.0; 4]),
            fisheye([-0.02, 3e-3, -8e-4, 4e-5]),
            fisheye([0.05, -0.01, 0.0, 0.0]),
        ]
    }

    #[test]
    fn inverse_matches_forward_up_to_the_models_end() {
        for lens in lenses() {
            // 3,000 px: about the longest focal length of a star tracker.
            let pixel = 1.0 / 3000.0;
            let max = lens.end_rad().min(1.4_f64.max(lens.end_rad() * 0.999));
            for i in 1..=400 {
                let angle = max * f64::from(i) / 400.0 * 0.9999;
                for azimuth in [0.0, 0.7, 2.0, 3.3, 4.9] {
                    let (sin, cos) = f64::sin_cos(angle);
                    let truth = Vector3::new(sin * f64::cos(azimuth), sin * f64::sin(azimuth), cos);
                    let Some(at) = lens.image(&truth) else {
                        panic!("{lens:?} {angle}");
                    };
                    if libm::hypot(at[0], at[1]) > 20.0 {
                        continue;
                    }
                    let back = lens
                        .direction(at)
                        .unwrap_or_else(|| panic!("{lens:?} {angle}"));
                    let again = lens.image(&back).unwrap();
                    let miss = (again[0] - at[0]).hypot(again[1] - at[1]);
                    assert!(miss < 1e-6 * pixel, "{lens:?} {angle} {miss:e}");
                    // Close to the fold the position determines the angle to half its digits only.
                    if angle < 0.99 * max {
                        assert!((back - truth).norm() < 1e-11, "{lens:?} {angle}");
                    }
                }
            }
        }
    }

    #[test]
    fn beyond_the_fold_there_is_no_image_and_no_direction() {
        // x (1 - 0.4 x^2) turns around at x = 1 / sqrt(1.2), where it is 2/3 of that.
        let lens = Projection::new(Model::BrownConrady {
            k: [-0.4, 0.0, 0.0],
            p: [0.0; 2],
        });
        let fold = 1.0 / 1.2f64.sqrt();
        assert!((lens.end_rad() - fold.atan()).abs() < 1e-12);
        let image = |x: f64| lens.image(&Vector3::new(x, 0.0, 1.0));
        assert!(image(0.999 * fold).is_some() && image(1.001 * fold).is_none());
        let edge = 2.0 / 3.0 * fold;
        assert!(lens.direction([0.0, 0.999 * edge]).is_some());
        assert!(lens.direction([0.0, 1.001 * edge]).is_none());
        // t (1 - 0.1 t^2) turns around at t = 1 / sqrt(0.3).
        let lens = Projection::new(Model::Fisheye {
            k: [-0.1, 0.0, 0.0, 0.0],
        });
        let fold = 1.0 / 0.3f64.sqrt();
        assert!((lens.end_rad() - fold).abs() < 1e-12);
        let image = |t: f64| lens.image(&Vector3::new(0.0, f64::sin(t), f64::cos(t)));
        assert!(image(0.999 * fold).is_some() && image(1.001 * fold).is_none());
        assert!(lens.direction([0.667 * fold, 0.0]).is_none());
    }

    #[test]
    fn only_a_fisheye_has_images_from_behind() {
        let lens = Projection::new(Model::Fisheye { k: [0.0; 4] });
        let back = Vector3::new(0.1, 0.0, -1.0);
        // X-Val: by hand, the angle from the boresight is pi - atan(0.1) = 3.0419240.
        let [x, y] = lens.image(&back).unwrap();
        assert!((x - 3.041_924_0).abs() < 1e-7 && y == 0.0);
        assert!(Projection::PINHOLE.image(&back).is_none());
        assert_eq!(lens.image(&Vector3::z()), Some([0.0; 2]));
        assert_eq!(lens.image(&-Vector3::z()), None);
    }

    #[test]
    fn lens_without_coefficients_is_ideal() {
        for lens in lenses() {
            assert!(lens.ideal().is_ideal());
            let fisheye = matches!(lens.model(), Model::Fisheye { .. });
            let at = lens.ideal().image(&Vector3::new(1.0, 0.0, 1.0)).unwrap()[0];
            let expected = if fisheye { PI / 4.0 } else { 1.0 };
            assert!((at - expected).abs() < 1e-15);
        }
    }
}
