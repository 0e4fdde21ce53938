//! The side of a cylinder or a cone: a ring of narrow plates around an axis.

use super::surface::Surface;
use nalgebra::Vector3;
use std::f64::consts::{PI, TAU};

/// A band of surface whose normals go around `axis`, all with the same elevation above the plane
/// perpendicular to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ring {
    /// Unit vectors: two across the axis, and the axis.
    frame: [Vector3<f64>; 3],
    /// Cosine and sine of the normals' elevation towards the axis.
    elevation: [f64; 2],
    /// Area, m^2.
    pub area_m2: f64,
}

/// `mean + cos cos(phi) + sin sin(phi)`: the cosine between a direction and the normals of a ring.
#[derive(Debug, Clone, Copy)]
struct Wave {
    mean: f64,
    cos: f64,
    sin: f64,
}

/// A part of the ring: first and last azimuth, rad.
type Arc = [f64; 2];

/// Points of the search for the lobe on an arc.
const SEARCHED: usize = 48;
/// Steps of the sum over the arc that reflects light into the lobe: within 1e-4 of the integral.
const STEPS: usize = 96;
/// Halvings of the search for the edge of the lobe.
const HALVINGS: usize = 40;

impl Ring {
    /// Around `axis` (unit vector), with the elevation of the normals towards it (rad).
    pub fn new(axis: Vector3<f64>, elevation: f64, area_m2: f64) -> Ring {
        let away = if axis.z.abs() < 0.9 {
            Vector3::z()
        } else {
            Vector3::x()
        };
        let first = axis.cross(&away).normalize();
        Ring {
            frame: [first, axis.cross(&first), axis],
            elevation: [libm::cos(elevation), libm::sin(elevation)],
            area_m2,
        }
    }

    /// Eq. (6), m^2/sr, for the unit vectors to the Sun and to the sensor and the Sun's angular
    /// radius (rad): the integral of [`Surface::reflected`] over the ring. The diffuse part is
    /// in closed form; the specular part is summed over the arc whose lobes contain the sensor.
    pub fn reflective_area(
        &self,
        surface: &Surface,
        sun: &Vector3<f64>,
        seen: &Vector3<f64>,
        sun_radius: f64,
    ) -> f64 {
        let apart = sun.dot(seen);
        let (sun, seen) = (self.wave(sun), self.wave(seen));
        let lobe = surface.lobe.cap(sun_radius);
        let cos_apart = |phi: f64| 2.0 * sun.at(phi) * seen.at(phi) - apart;
        let mut sum = 0.0;
        for arc in lit_and_seen(&sun, &seen) {
            sum += surface.diffuse * product(&sun, &seen, arc) / PI;
            if surface.specular > 0.0 {
                let back = lobe.density(-apart);
                if back > 0.0 {
                    sum += surface.specular * back * product(&sun, &Wave::ONE, arc);
                }
                for [from, to] in where_above(lobe.cos_edge(), arc, cos_apart) {
                    let step = (to - from) / STEPS as f64;
                    let middles = (0..STEPS).map(|i| from + (i as f64 + 0.5) * step);
                    let light = middles.map(|phi| sun.at(phi) * lobe.density(cos_apart(phi)));
                    sum += surface.specular * light.sum::<f64>() * step;
                }
            }
        }
        surface.reflectance * self.area_m2 / TAU * sum
    }

    fn wave(&self, direction: &Vector3<f64>) -> Wave {
        let [x, y, z] = self.frame.map(|axis| axis.dot(direction));
        let [across, along] = self.elevation;
        Wave {
            mean: along * z,
            cos: across * x,
            sin: across * y,
        }
    }
}

impl Wave {
    const ONE: Wave = Wave {
        mean: 1.0,
        cos: 0.0,
        sin: 0.0,
    };

    fn at(&self, phi: f64) -> f64 {
        let (sin, cos) = libm::sincos(phi);
        self.mean + self.cos * cos + self.sin * sin
    }

    /// Middle and half width of the arc with positive values, if there is one.
    fn positive(&self) -> Option<[f64; 2]> {
        let amplitude = libm::hypot(self.cos, self.sin);
        if self.mean <= -amplitude {
            return None;
        }
        let half = if self.mean >= amplitude {
            PI
        } else {
            libm::acos(-self.mean / amplitude)
        };
        Some([libm::atan2(self.sin, self.cos), half])
    }
}

/// The arcs on which both are positive: none, one or two.
fn lit_and_seen(sun: &Wave, seen: &Wave) -> Vec<Arc> {
    let (Some([sun, sun_half]), Some([seen, seen_half])) = (sun.positive(), seen.positive()) else {
        return Vec::new();
    };
    // The second arc, shifted by whole turns, intersected with the first.
    let turns = [-2.0, -1.0, 0.0, 1.0, 2.0].map(|turn| seen + turn * TAU);
    let cut = turns.map(|middle| {
        [
            (sun - sun_half).max(middle - seen_half),
            (sun + sun_half).min(middle + seen_half),
        ]
    });
    cut.into_iter().filter(|[from, to]| from < to).collect()
}

/// The integral of a product over an arc. At least 0, since both are positive there.
fn product(a: &Wave, b: &Wave, [from, to]: Arc) -> f64 {
    let antiderivative = |phi: f64| {
        let (sin, cos) = libm::sincos(phi);
        a.mean * b.mean * phi + (a.mean * b.cos + a.cos * b.mean) * sin
            - (a.mean * b.sin + a.sin * b.mean) * cos
            + a.cos * b.cos * (phi + sin * cos) / 2.0
            + a.sin * b.sin * (phi - sin * cos) / 2.0
            + (a.cos * b.sin + a.sin * b.cos) * sin * sin / 2.0
    };
    (antiderivative(to) - antiderivative(from)).max(0.0)
}

/// The parts of an arc on which `f`, which has few maxima, is above `level`.
fn where_above(level: f64, [from, to]: Arc, f: impl Fn(f64) -> f64) -> Vec<Arc> {
    let at = |i: usize| from + (to - from) * i as f64 / SEARCHED as f64;
    let values: Vec<f64> = (0..=SEARCHED).map(|i| f(at(i))).collect();
    let edge = |mut below: f64, mut above: f64| {
        for _ in 0..HALVINGS {
            let middle = 0.5 * (below + above);
            if f(middle) > level {
                above = middle;
            } else {
                below = middle;
            }
        }
        above
    };
    let mut found: Vec<Arc> = Vec::new();
    let mut add = |part: Arc| match found.last_mut() {
        Some(last) if last[1] >= part[0] => last[1] = last[1].max(part[1]),
        _ => found.push(part),
    };
    for i in 0..SEARCHED {
        let (left, right) = (values[i] > level, values[i + 1] > level);
        match (left, right) {
            (true, true) => add([at(i), at(i + 1)]),
            (true, false) => add([at(i), edge(at(i + 1), at(i))]),
            (false, true) => add([edge(at(i), at(i + 1)), at(i + 1)]),
            // A peak narrower than a step lies next to the highest of three values.
            (false, false) => {
                let highest = values[i].max(values[i + 1]);
                let before = i.checked_sub(1).and_then(|i| values.get(i));
                let neighbours = [before, values.get(i + 2)];
                if (neighbours.into_iter().flatten()).all(|value| *value <= highest) {
                    let peak = peak(at(i), at(i + 1), &f);
                    if f(peak) > level {
                        add([edge(at(i), peak), edge(at(i + 1), peak)]);
                    }
                }
            }
        }
    }
    found
}

/// The maximum of `f` between two azimuths: golden section.
fn peak(mut from: f64, mut to: f64, f: impl Fn(f64) -> f64) -> f64 {
    const SECTION: f64 = 0.618_033_988_749_894_8;
    for _ in 0..HALVINGS {
        let (left, right) = (to - SECTION * (to - from), from + SECTION * (to - from));
        if f(left) > f(right) {
            to = right;
        } else {
            from = left;
        }
    }
    0.5 * (from + to)
}
