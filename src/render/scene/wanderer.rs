//! The Moon and the planets before the camera.

use super::disc::LargeDisc;
use super::view::{Candidate, View};
use super::{Area, Body, Hidden, World};
use crate::sky::Observer;
use crate::sky::apparent::parabola;
use crate::sky::moon::{Cell, MoonDisc};
use crate::sky::photometry::{phase_angle, photon_irradiance};
use crate::sky::planets;
use crate::sky::shadow::Earth;
use nalgebra::Vector3;

/// A resolved disc is cut into squares of this side, in widths of the core of what a point is spread over: Gaussians that are a width apart ripple by
/// less than 1e-8.
const ELEMENT: f64 = 1.0;
/// No square is wider than this, px.
const WIDEST_PX: f64 = 0.7;
/// Cells on a side, at least, from which the centre of the light and what the Earth takes are summed: they do not depend on the camera.
const LEAST_CELLS: f64 = 24.0;
/// A disc that asks for more squares than this on a side is laid on the pixels as areas are.
const MOST_ELEMENTS: f64 = 600.0;
/// Points that take as long as laying a disc on no pixels, and pixels for each further one.
const AREA_POINTS: usize = 10_000;
const PIXELS_A_POINT: usize = 42;
/// Farther (rad) than this from the anti-Sun no part of the Moon is in the Earth's shadow: penumbra and the Moon's radius reach 1.6 deg.
const ECLIPSED: f64 = 0.03;

/// A body of the solar system as the view's observer sees it.
#[derive(Debug, Clone)]
pub struct SeenWanderer {
    /// Its name.
    pub name: &'static str,
    /// Where its light's centre appears at the start, the middle and the end of the view's time: unit vectors, ICRF.
    pub directions: [Vector3<f64>; 3],
    /// Where the centre of its disc appears at the middle of the view's time: unit vector, ICRF.
    pub centre: Vector3<f64>,
    /// V magnitude of all of it, in full sunlight.
    pub mag: f64,
    /// Angle Sun - body - observer at the middle of the view's time, geometric: without light time and aberration, rad.
    pub phase: f64,
    /// From the observer, m, geometric likewise.
    pub range_m: f64,
    /// Angular radius, rad. Planets are drawn as points all the same.
    pub angular_radius: f64,
    /// What it is cut into where it is larger than a pixel; else nothing.
    pub elements: Vec<Element>,
    /// Its light by direction, where it is too large for them.
    pub area: Option<Area>,
    /// How many points its image is made of, or would be in the same time.
    pub points: usize,
}

/// Range (m) and phase angle (rad) of a body, `body_m` from the observer.
fn geometric(observer: &Observer, body_m: &Vector3<f64>) -> (f64, f64) {
    let to_sun = observer.bodies.sun_geocentric_m - observer.position_m - body_m;
    let phase = phase_angle(&to_sun.normalize(), &-body_m.normalize());
    (body_m.norm(), phase)
}

/// A small part of a disc.
#[derive(Debug, Clone, Copy)]
pub struct Element {
    /// From the direction of the light's centre, across it (rad).
    pub offset: Vector3<f64>,
    /// Its part of the light that arrives (1).
    pub share: f64,
}

impl SeenWanderer {
    /// Its direction (any length) at a part of the view's time, by the parabola through start, mid and end.
    pub fn direction(&self, part: f64) -> Vector3<f64> {
        parabola(&self.directions, part)
    }

    /// Kind of the Moon.
    pub const MOON_KIND: &'static str = "moon";
    /// Kind of a planet.
    pub const PLANET_KIND: &'static str = "planet";

    /// What it is: `moon` or `planet`.
    pub fn kind(&self) -> &'static str {
        if self.is_moon() {
            Self::MOON_KIND
        } else {
            Self::PLANET_KIND
        }
    }

    /// Whether it is the Moon.
    pub fn is_moon(&self) -> bool {
        self.name == MOON
    }
}

/// The Moon's name.
pub const MOON: &str = "Moon";

/// The light of a disc that arrives.
struct Arriving {
    /// Of all its cells, in full sunlight, and what arrives of that.
    all: f64,
    light: f64,
    /// Direction and light of the cells from which some arrives.
    lit: Vec<(Vector3<f64>, f64)>,
    /// Whether the Earth hides some.
    behind: bool,
}

impl Arriving {
    /// By so many cells on a side.
    fn of(disc: &MoonDisc, count: usize, earth: &Earth, observer: &Observer) -> Arriving {
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

    /// The centre of what arrives: unit vector.
    fn centre(&self) -> Option<Vector3<f64>> {
        let sum: Vector3<f64> = self.lit.iter().map(|(at, share)| at * *share).sum();
        sum.try_normalize(0.0)
    }

    /// Its cells as points around a centre.
    fn elements(&self, centre: &Vector3<f64>) -> Vec<Element> {
        let element = |(at, share): &(Vector3<f64>, f64)| Element {
            offset: at - centre,
            share: share / self.light,
        };
        self.lit.iter().map(element).collect()
    }
}

impl View {
    /// The Moon, if it may be in the cone of `angle` (rad) around `axis`.
    pub(super) fn the_moon(
        &self,
        disc: &MoonDisc,
        world: &World,
        shutter: &[Observer; 3],
        axis: &Vector3<f64>,
        angle: f64,
    ) -> Option<Candidate> {
        let reach = (angle + disc.angular_radius).min(std::f64::consts::PI);
        if disc.direction.dot(axis) < libm::cos(reach) {
            return None;
        }
        let earth = Earth::at(self.exposure.mid);
        let squares = self.squares(disc);
        let count = squares.clamp(LEAST_CELLS, MOST_ELEMENTS);
        let of_cells = |count: f64| Arriving::of(disc, count as usize, &earth, &shutter[1]);
        let arriving = of_cells(count);
        let visible = arriving.light / f64::max(arriving.all, f64::MIN_POSITIVE);
        let centre = arriving.centre().unwrap_or(disc.direction);
        let is_large = squares > MOST_ELEMENTS;
        let elements = match squares {
            _ if squares <= 1.0 || is_large => Vec::new(),
            _ if squares < LEAST_CELLS => of_cells(squares).elements(&centre),
            _ => arriving.elements(&centre),
        };
        let off = centre - disc.direction;
        let appears = |observer: &Observer| {
            (observer.moon_m(&world.corrections).normalize() + off).normalize()
        };
        let directions = [appears(&shutter[0]), centre, appears(&shutter[2])];
        let mag = disc.magnitude();
        let clear_e = self.electrons(mag);
        let area = is_large.then(|| {
            let large = LargeDisc {
                disc: *disc,
                observer: shutter[1],
                earth,
                behind: arriving.behind,
                irradiance: photon_irradiance(self.camera.optics.band.zero_point(), mag),
                turning: directions[0].cross(&directions[2]) / self.open_s.max(f64::MIN_POSITIVE),
            };
            // That of the brightest square, on as much of a pixel as it is.
            let shares = arriving.lit.iter().map(|(_, share)| *share);
            let brightest = shares.fold(0.0, f64::max);
            let square_px = 2.0 * disc.angular_radius * self.scale_and_corner_px.0 / count;
            let most_e = clear_e * brightest / f64::max(arriving.all, f64::MIN_POSITIVE);
            large.area(2.0 * most_e / (square_px * square_px))
        });
        let points = match area {
            Some(_) => AREA_POINTS + self.camera.detector.pixels() / PIXELS_A_POINT,
            None => elements.len().max(1),
        };
        let moon_m = shutter[1].bodies.moon_geocentric_m - shutter[1].position_m;
        let (range_m, phase) = geometric(&shutter[1], &moon_m);
        let seen = SeenWanderer {
            name: MOON,
            directions,
            centre: disc.direction,
            mag,
            phase,
            range_m,
            angular_radius: disc.angular_radius,
            elements,
            area,
            points,
        };
        let hidden = match (visible > 0.0, arriving.behind) {
            (true, _) => None,
            (false, true) => Some(Hidden::ByEarth),
            (false, false) => Some(Hidden::InShadow),
        };
        let body = Body::Wanderer(Box::new(seen));
        Some(Candidate::new(body, clear_e, visible, hidden))
    }

    /// The planets that may be in the cone of `angle` (rad) around `axis`: points.
    pub(super) fn planets(
        &self,
        world: &World,
        shutter: &[Observer; 3],
        axis: &Vector3<f64>,
        angle: f64,
    ) -> Vec<Candidate> {
        let seen = planets::seen_by(&shutter[1], &world.corrections);
        let nearest = libm::cos(angle.min(std::f64::consts::PI));
        let near = |planet: &planets::Planet| planet.direction.dot(axis) >= nearest;
        if !seen.iter().any(near) {
            return Vec::new();
        }
        let ends = [0, 2].map(|i: usize| planets::seen_by(&shutter[i], &world.corrections));
        let earth = Earth::at(self.exposure.mid);
        let rows = seen.iter().zip(ends[0].iter().zip(&ends[1]));
        let rows = rows.filter(|(planet, _)| near(planet) && planet.magnitude.is_finite());
        let candidates = rows.map(|(planet, (start, end))| {
            let (range_m, phase) = geometric(&shutter[1], &planet.geometric_m);
            let body = SeenWanderer {
                name: planet.name,
                directions: [start.direction, planet.direction, end.direction],
                centre: planet.direction,
                mag: planet.magnitude,
                phase,
                range_m,
                angular_radius: planet.angular_radius,
                elements: Vec::new(),
                area: None,
                points: 1,
            };
            let clear_e = self.electrons(body.mag);
            let hidden = self.hidden(&planet.direction, &earth, &shutter[1]);
            Candidate::new(Body::Wanderer(Box::new(body)), clear_e, 1.0, hidden)
        });
        candidates.collect()
    }

    /// What stands before a direction at infinity.
    pub(super) fn hidden(
        &self,
        direction: &Vector3<f64>,
        earth: &Earth,
        observer: &Observer,
    ) -> Option<Hidden> {
        if earth.occults_direction(observer.position_m, *direction) {
            return Some(Hidden::ByEarth);
        }
        let [toward, reach] = [self.moon.0.dot(direction), self.moon.1];
        (toward > reach).then_some(Hidden::ByMoon)
    }

    /// How many squares on a side a disc asks for; 1 of one smaller than a pixel.
    fn squares(&self, disc: &MoonDisc) -> f64 {
        let side_px = 2.0 * disc.angular_radius * self.scale_and_corner_px.0;
        if side_px <= 1.0 {
            return 1.0;
        }
        let core_px = self.camera.optics.psf.core_px();
        (side_px / (ELEMENT * core_px).min(WIDEST_PX)).ceil()
    }
}

/// The part of the Sun's disc that the Moon's surface sees past the Earth, in a direction from the observer.
pub(super) fn sunlit(
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

/// The part of the Moon's light that arrives: what neither the Earth nor its shadow takes, to a hundredth.
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
