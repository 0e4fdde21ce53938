//! The light of the Moon's disc, reduced by the Earth and its shadow.

use super::solar_system::Element;
use crate::sky::Observer;
use crate::sky::moon::{Cell, MoonDisc};
use crate::sky::shadow::Earth;
use nalgebra::Vector3;

/// Beyond this angle from the anti-Sun (rad) no part of the Moon is in the Earth's shadow: penumbra
/// and the Moon's radius reach 1.6 deg.
const ECLIPSED: f64 = 0.03;

/// The light of a disc that arrives at the observer.
pub(crate) struct Arriving {
    /// The light of all its cells in full sunlight, and the arriving part.
    pub all: f64,
    pub light: f64,
    /// Direction and light of the cells whose light arrives.
    pub lit: Vec<(Vector3<f64>, f64)>,
    /// Whether the Earth hides some cells.
    pub behind: bool,
}

impl Arriving {
    /// Evaluates `count` x `count` cells of the disc.
    pub fn of(disc: &MoonDisc, count: usize, earth: &Earth, observer: &Observer) -> Arriving {
        let [mut all, mut light] = [0.0; 2];
        let (mut lit, mut behind) = (Vec::new(), false);
        for Cell { direction, share } in disc.cells(count) {
            all += share;
            if earth.occults_direction(observer.position_m, direction) {
                behind = true;
                continue;
            }
            let arrives = share * sunlit(&direction, disc, earth, observer);
            if arrives > 0.0 {
                light += arrives;
                lit.push((direction, arrives));
            }
        }
        Arriving {
            all,
            light,
            lit,
            behind,
        }
    }

    /// The centre of the light that arrives: unit vector.
    pub fn centre(&self) -> Option<Vector3<f64>> {
        let sum: Vector3<f64> = self.lit.iter().map(|(at, share)| at * *share).sum();
        sum.try_normalize(0.0)
    }

    /// The greatest light of a cell.
    pub(crate) fn brightest(&self) -> f64 {
        let shares = self.lit.iter().map(|(_, share)| *share);
        shares.fold(0.0, f64::max)
    }

    /// Its lit cells as points around a centre.
    pub fn elements(&self, centre: &Vector3<f64>) -> Vec<Element> {
        let element = |(at, share): &(Vector3<f64>, f64)| Element {
            offset: at - centre,
            share: share / self.light,
        };
        self.lit.iter().map(element).collect()
    }
}

/// The part of the Sun's disc that is visible from a point of the Moon's surface past the Earth;
/// `at` is the direction of that point from the observer.
pub(crate) fn sunlit(
    at: &Vector3<f64>,
    disc: &MoonDisc,
    earth: &Earth,
    observer: &Observer,
) -> f64 {
    let moon_m = observer.bodies.moon_geocentric_m;
    let sun_m = observer.bodies.sun_apparent_m();
    if (-moon_m).angle(&sun_m) > ECLIPSED {
        return 1.0;
    }
    let across_m = (at - disc.direction * at.dot(&disc.direction)) * disc.distance_m;
    earth.illumination(moon_m + across_m, sun_m)
}

/// The fraction of the Moon's light that arrives past the Earth and its shadow, to 0.01.
pub fn moons_light(disc: &MoonDisc, earth: &Earth, observer: &Observer) -> f64 {
    const SIDE: usize = 12;
    let far = earth.limb_angle(observer.position_m, &disc.direction) > 2.0 * disc.angular_radius;
    let eclipsed = (-observer.bodies.moon_geocentric_m).angle(&observer.bodies.sun_apparent_m());
    if far && eclipsed > ECLIPSED {
        return 1.0;
    }
    let arriving = Arriving::of(disc, SIDE, earth, observer);
    arriving.light / f64::max(arriving.all, f64::MIN_POSITIVE)
}
