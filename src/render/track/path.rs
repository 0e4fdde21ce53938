//! The path of an image through a piece of its track, interpolated between known positions.

use super::sample::Place;

/// Greatest error of a path at its check point, px.
const TOLERANCE_PX: f64 = 1e-6;
/// The check point, as a part of the time: the middle of the first quarter.
const CHECK: f64 = 0.125;

/// The polynomials of fourth degree through five positions a quarter of the time apart, by Newton's
/// differences: columns, rows, light.
pub(crate) struct Path([[f64; 5]; 3]);

impl Path {
    /// Through the positions `known` at start, middle and end and two more. None if it misses the
    /// check point by more than `tolerance` px, or its light by more than that fraction.
    pub fn through(
        known: [Place; 3],
        position: impl Fn(f64) -> Option<Place>,
        tolerance: f64,
    ) -> Option<Path> {
        let [start, middle, end] = known;
        let places = [start, position(0.25)?, middle, position(0.75)?, end];
        let path = Path([0, 1, 2].map(|k| differences(places.map(|place| values(&place)[k]))));
        let (found, exact) = (path.at(CHECK), position(CHECK)?);
        let tolerance = tolerance.min(TOLERANCE_PX);
        let follows = distance(found.at, exact.at) <= tolerance
            && (found.light - exact.light).abs() <= tolerance * exact.light;
        follows.then_some(path)
    }

    /// The position at a part (0..1) of the time.
    #[inline]
    pub fn at(&self, part: f64) -> Place {
        let s = 4.0 * part;
        let value = |d: &[f64; 5]| {
            let third = d[3] + (s - 3.0) * d[4];
            let second = d[2] + (s - 2.0) * third;
            d[0] + s * (d[1] + (s - 1.0) * second)
        };
        let [x, y, light] = &self.0;
        Place {
            at: [value(x), value(y)],
            light: value(light),
        }
    }
}

fn values(position: &Place) -> [f64; 3] {
    [position.at[0], position.at[1], position.light]
}

/// Divided differences of values at 0, 1, 2, 3, 4.
fn differences(values: [f64; 5]) -> [f64; 5] {
    let mut d = values;
    for order in 1..d.len() {
        for i in (order..d.len()).rev() {
            d[i] = (d[i] - d[i - 1]) / order as f64;
        }
    }
    d
}

pub(crate) fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(b[0] - a[0], b[1] - a[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(position: impl Fn(f64) -> Option<Place>) -> Option<Path> {
        let known = [0.0, 0.5, 1.0].map(|t| position(t).unwrap());
        Path::through(known, position, 1e-6)
    }

    #[test]
    fn only_smooth_motion_has_a_path() {
        let smooth = |t: f64| {
            let at = [3.0 + 50.0 * t - t.powi(4), 7.0 + t * t * t];
            Some(Place {
                at,
                light: 1.0 - 0.1 * t,
            })
        };
        let found = path(smooth).unwrap();
        for i in 0..=20 {
            let t = f64::from(i) / 20.0;
            let (at, exact) = (found.at(t), smooth(t).unwrap());
            assert!(distance(at.at, exact.at) < 1e-12, "{t}");
            assert!((at.light - exact.light).abs() < 1e-14);
        }
        let moving = |t: f64, light: f64| {
            Some(Place {
                at: [50.0 * t, 0.0],
                light,
            })
        };
        assert!(path(|t| moving(t, 1.0)).is_some());
        // A kink of the light, a jump, and a position behind the camera.
        assert!(path(|t| moving(t, 1.0 - 0.1 * (t - 0.6).max(0.0))).is_none());
        assert!(path(|t| moving(t + f64::from(t > 0.7), 1.0)).is_none());
        assert!(path(|t| if t == 0.25 { None } else { moving(t, 1.0) }).is_none());
    }
}
