//! A realistic synthetic population for scale tests. An object's class ([`CLASSES`]) follows from
//! its index, its orbit and size from index and seed. The same arguments always give the same
//! objects.

mod classes;
mod draw;

pub use classes::{CLASSES, Class};

use crate::Theory;
use crate::elements::{EARTH_RADIUS_M, Elements};
use crate::time::utc_days_since_j2000;
use crate::{Object, Record};
use classes::{Drag, Inclination, Orbit, Size};
use draw::{Draw, GOLDEN};
use hifitime::{Epoch, Unit};
use std::f64::consts::{PI, TAU};

/// The catalogue number of the first object, beyond those assigned so far. 209,999 objects fit into
/// TLE from there.
pub const FIRST_NUMBER: u32 = 130_001;

/// Largest population: catalogue numbers have nine digits.
pub const MAX_OBJECTS: usize = (999_999_999 - FIRST_NUMBER) as usize;

/// km^3/s^2, WGS72.
const GRAVITY: f64 = 398_600.8;
/// The largest fragment, m.
const LARGEST_FRAGMENT_M: f64 = 3.0;
/// Inclination of the Laplace plane at the geostationary orbit, deg (Allan and Cook 1964, Proc. R.
/// Soc. A 280, 97).
const LAPLACE_DEG: f64 = 7.4;

/// A synthetic object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Synthetic {
    /// Its orbit. Its number is [`FIRST_NUMBER`] plus its index.
    pub elements: Elements,
    /// Its class.
    pub class: &'static Class,
    /// Diameter of its sphere, m.
    pub diameter_m: f64,
}

impl Synthetic {
    /// Its element set.
    pub fn record(&self) -> Record {
        Record {
            line: 0,
            name: self.name(),
            designator: String::new(),
            classification: 'U',
            ephemeris_type: 0,
            theory: Theory::default(),
            element_set: 1,
            revolution: 0,
            mean_motion_dot: 0.0,
            mean_motion_ddot: 0.0,
            elements: self.elements,
        }
    }

    /// The object as loaded from a file of element sets.
    pub fn object(&self) -> Object {
        Object {
            id: format!("NORAD {}", self.elements.norad),
            names: vec![self.name()],
            identity: crate::Identity::of_set(self.elements.norad, "", ""),
            orbit: crate::Orbit::Elements(self.elements, Vec::new()),
        }
    }

    /// Its name: class and number.
    pub fn name(&self) -> String {
        format!("{} {}", self.class.name, self.elements.norad)
    }
}

/// The first objects, up to [`MAX_OBJECTS`]. Their elements are up to a day older than `epoch`, and
/// SGP4 has a state of each at that time.
pub fn population(objects: usize, seed: u64, epoch: Epoch) -> Vec<Synthetic> {
    let objects = objects.min(MAX_OBJECTS) as u64;
    (0..objects).map(|i| object(i, seed, epoch)).collect()
}

fn object(index: u64, seed: u64, epoch: Epoch) -> Synthetic {
    let class = class_at(index);
    let mut draw = Draw::new(seed, index);
    let (semi_major_km, eccentricity) = orbit(&class.orbit, &mut draw);
    let (inclination, node) = plane(&class.inclination, semi_major_km, epoch, &mut draw);
    let elements = Elements {
        norad: FIRST_NUMBER + index as u32,
        epoch: epoch - Unit::Second * (86_400.0 * draw.uniform()),
        inclination,
        node,
        eccentricity,
        perigee: draw.angle(),
        mean_anomaly: draw.angle(),
        // n = sqrt(mu / a^3)
        mean_motion: 60.0 * libm::sqrt(GRAVITY / (semi_major_km * semi_major_km * semi_major_km)),
        drag: match class.drag {
            Drag::None => 0.0,
            Drag::Of(size, negative) => {
                let size = draw.log_normal(size);
                if draw.uniform() < negative {
                    -size
                } else {
                    size
                }
            }
        },
    };
    let diameter_m = match class.size {
        Size::Whole(median, sigma) => draw.log_normal((median, sigma)),
        // N(> d) / N = (d / least)^-1.6
        Size::Fragments(least) => {
            (least * libm::pow(draw.uniform(), -1.0 / 1.6)).min(LARGEST_FRAGMENT_M)
        }
    };
    Synthetic {
        elements,
        class,
        diameter_m,
    }
}

/// The class of an index. Multiples of the golden ratio, modulo 1, fill the interval evenly. So
/// classes mix, and their shares hold to within a few objects for every population.
fn class_at(index: u64) -> &'static Class {
    let fraction = index.wrapping_mul(GOLDEN) >> 11;
    let mut left = 1000.0 * fraction as f64 / (1u64 << 53) as f64;
    for class in CLASSES {
        left -= class.share;
        if left < 0.0 {
            return class;
        }
    }
    &CLASSES[0]
}

/// Semi-major axis (km) and eccentricity.
fn orbit(orbit: &Orbit, draw: &mut Draw) -> (f64, f64) {
    const RADIUS_KM: f64 = EARTH_RADIUS_M / 1e3;
    match orbit {
        Orbit::Round(height_km, eccentricity) => (
            RADIUS_KM + draw.between(*height_km),
            draw.log_normal(*eccentricity),
        ),
        Orbit::Long(semi_major_km, perigee_km) => {
            let semi_major_km = draw.between(*semi_major_km);
            let perigee_km = RADIUS_KM + draw.between(*perigee_km);
            (semi_major_km, 1.0 - perigee_km / semi_major_km)
        }
    }
}

/// A draw from weighted normal bands: weight, mean, sigma.
fn banded(bands: &[(f64, f64, f64)], draw: &mut Draw) -> f64 {
    let all: f64 = bands.iter().map(|(weight, ..)| weight).sum();
    let mut left = all * draw.uniform();
    let mut band = (0.0, 0.0);
    for (weight, mean, sigma) in bands {
        band = (*mean, *sigma);
        left -= weight;
        if left < 0.0 {
            break;
        }
    }
    band.0 + band.1 * draw.normal()
}

/// Inclination and node, rad.
fn plane(
    inclination: &Inclination,
    semi_major_km: f64,
    epoch: Epoch,
    draw: &mut Draw,
) -> (f64, f64) {
    match inclination {
        Inclination::Bands(bands) => {
            let degrees = banded(bands, draw);
            (degrees.abs().to_radians(), draw.angle())
        }
        // cos i = -(a / 12352 km)^(7/2): the node turns 360 deg a year (Boain 2004, AAS 04-108).
        Inclination::SunSynchronous(sigma, nodes_h) => {
            let cos = -libm::pow(semi_major_km / 12_352.0, 3.5);
            let spread = (sigma * draw.normal()).to_radians();
            let node = match nodes_h {
                [] => draw.angle(),
                // W = L + (t - 12 h) 15 deg / h, with the mean Sun's
                // L = 280.460 deg + 0.9856474 deg a day from J2000 (Astronomical Almanac, C5).
                nodes_h => {
                    let days = utc_days_since_j2000(epoch);
                    let sun_deg = 280.460 + 0.985_647_4 * days;
                    let node_deg = sun_deg + 15.0 * (banded(nodes_h, draw) - 12.0);
                    node_deg.rem_euclid(360.0).to_radians()
                }
            };
            (libm::acos(cos) + spread, node)
        }
        // The Laplace plane's node is the vernal equinox: its pole is L = (0, -sin l, cos l). The
        // orbit's pole h is the Earth's, p = (0, 0, 1), rotated about L: h = p cos + (L x p) sin +
        // L (L . p) (1 - cos).
        Inclination::Abandoned => {
            let (sin_l, cos_l) = libm::sincos(LAPLACE_DEG.to_radians());
            let (sin, cos) = libm::sincos(draw.angle());
            let x = -sin_l * sin;
            let y = -sin_l * cos_l * (1.0 - cos);
            let z = cos + cos_l * cos_l * (1.0 - cos);
            // h = (sin i sin W, -sin i cos W, cos i)
            let node = libm::atan2(x, -y).rem_euclid(TAU);
            (libm::acos(z.clamp(-1.0, 1.0)).clamp(0.0, PI), node)
        }
    }
}
