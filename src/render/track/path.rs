//! The path of an image through a piece of its track, interpolated between known places.

use super::sample::Place;

/// Greatest error of a path at the place where it is checked, px.
const BESIDE_PX: f64 = 1e-6;
/// The part of the time at which it is checked: the middle of the first quarter.
const LOOK: f64 = 0.125;

/// The polynomials of fourth degree through five places a quarter of the time apart, by Newton's
/// differences: columns, rows, light.
pub struct Path([[f64; 5]; 3]);

impl Path {
    /// Through the places `known` at start, middle and end and two more; none if it misses a
    /// further place by more than `beside` px (or that part of its light).
    pub fn through(
        known: [Place; 3],
        position: impl Fn(f64) -> Option<Place>,
        beside: f64,
    ) -> Option<Path> {
        let [start, middle, end] = known;
        let places = [start, position(0.25)?, middle, position(0.75)?, end];
        let way =
            Path([0, 1, 2].map(|k| differences(places.map(|position| figures(&position)[k]))));
        let (told, true_one) = (way.at(LOOK), position(LOOK)?);
        let beside = beside.min(BESIDE_PX);
        let follows = distance(told.at, true_one.at) <= beside
            && (told.light - true_one.light).abs() <= beside * true_one.light;
        follows.then_some(way)
    }

    /// The place at a part (0..1) of the time.
    #[inline]
    pub fn at(&self, part: f64) -> Place {
        let s = 4.0 * part;
        let figure = |d: &[f64; 5]| {
            let third = d[3] + (s - 3.0) * d[4];
            let second = d[2] + (s - 2.0) * third;
            d[0] + s * (d[1] + (s - 1.0) * second)
        };
        let [x, y, light] = &self.0;
        Place {
            at: [figure(x), figure(y)],
            light: figure(light),
        }
    }
}

fn figures(position: &Place) -> [f64; 3] {
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

pub fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(b[0] - a[0], b[1] - a[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn way(position: impl Fn(f64) -> Option<Place>) -> Option<Path> {
        let known = [0.0, 0.5, 1.0].map(|t| position(t).unwrap());
        Path::through(known, position, 1e-6)
    }

    #[test]
    fn what_is_smooth_is_followed_and_what_is_not_is_none() {
        let smooth = |t: f64| {
            let at = [3.0 + 50.0 * t - t.powi(4), 7.0 + t * t * t];
            Some(Place {
                at,
                light: 1.0 - 0.1 * t,
            })
        };
        let found = way(smooth).unwrap();
        for i in 0..=20 {
            let t = f64::from(i) / 20.0;
            let (told, truth) = (found.at(t), smooth(t).unwrap());
            assert!(distance(told.at, truth.at) < 1e-12, "{t}");
            assert!((told.light - truth.light).abs() < 1e-14);
        }
        let lit = |t: f64, light: f64| {
            Some(Place {
                at: [50.0 * t, 0.0],
                light,
            })
        };
        assert!(way(|t| lit(t, 1.0)).is_some());
        // Light that breaks off, a jump, and a place behind the camera.
        assert!(way(|t| lit(t, 1.0 - 0.1 * (t - 0.6).max(0.0))).is_none());
        assert!(way(|t| lit(t + f64::from(t > 0.7), 1.0)).is_none());
        assert!(way(|t| if t == 0.25 { None } else { lit(t, 1.0) }).is_none());
    }
}
