//! Finds the Moon and the planets in the field.

use super::disc::LargeDisc;
use super::moonlight::Arriving;
use super::solar_system::{MOON, VisiblePlanet};
use super::source::{Body, Candidate, Hidden};
use super::view::View;
use super::world::World;
use crate::sky::Observer;
use crate::sky::moon::MoonDisc;
use crate::sky::photometry::{phase_angle, photon_irradiance};
use crate::sky::planets::{Planet, seen_by};
use crate::sky::shadow::Earth;
use nalgebra::Vector3;

/// Side of the squares of a resolved disc, in core widths of the point spread function. The sum of
/// Gaussians one width apart ripples by less than 1e-8.
const ELEMENT: f64 = 1.0;
/// Greatest side of a square, px.
const WIDEST_PX: f64 = 0.7;
/// Least number of cells on a side for the centre of the light and the part hidden by the Earth:
/// independent of the camera.
const MIN_CELLS: f64 = 24.0;
/// A disc of more squares on a side is rasterized like an area source.
const MAX_ELEMENTS: f64 = 600.0;
/// Cost of rasterizing a disc, as a number of points: a constant, and one for so many pixels.
const AREA_POINTS: usize = 10_000;
const PIXELS_A_POINT: usize = 42;

/// Range (m) and phase angle (rad) of a body at `body_m` from the observer.
fn geometric(observer: &Observer, body_m: &Vector3<f64>) -> (f64, f64) {
    let to_sun = observer.bodies.sun_geocentric_m - observer.position_m - body_m;
    let phase = phase_angle(&to_sun.normalize(), &-body_m.normalize());
    (body_m.norm(), phase)
}

/// The Moon, if it may be in the cone of `angle` (rad) around `axis`.
pub(crate) fn the_moon(
    view: &View,
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
    let earth = Earth::at(view.exposure.mid);
    let squares = squares(view, disc);
    let count = squares.clamp(MIN_CELLS, MAX_ELEMENTS);
    let of_cells = |count: f64| Arriving::of(disc, count as usize, &earth, &shutter[1]);
    let arriving = of_cells(count);
    let visible = arriving.light / f64::max(arriving.all, f64::MIN_POSITIVE);
    let centre = arriving.centre().unwrap_or(disc.direction);
    let is_large = squares > MAX_ELEMENTS;
    let elements = match squares {
        _ if squares <= 1.0 || is_large => Vec::new(),
        _ if squares < MIN_CELLS => of_cells(squares).elements(&centre),
        _ => arriving.elements(&centre),
    };
    let off = centre - disc.direction;
    let appears =
        |observer: &Observer| (observer.moon_m(&world.corrections).normalize() + off).normalize();
    let directions = [appears(&shutter[0]), centre, appears(&shutter[2])];
    let mag = disc.magnitude();
    let clear_e = view.electrons(mag);
    let area = is_large.then(|| {
        let large = LargeDisc {
            disc: *disc,
            observer: shutter[1],
            earth,
            behind: arriving.behind,
            irradiance: photon_irradiance(view.camera.optics.band.zero_point(), mag),
            turning: directions[0].cross(&directions[2]) / view.open_s.max(f64::MIN_POSITIVE),
        };
        let square_px = 2.0 * disc.angular_radius * view.scale_and_corner_px.0 / count;
        let max_e = clear_e * arriving.brightest() / f64::max(arriving.all, f64::MIN_POSITIVE);
        large.area(2.0 * max_e / (square_px * square_px))
    });
    let points = match area {
        Some(_) => AREA_POINTS + view.camera.detector.pixels() / PIXELS_A_POINT,
        None => elements.len().max(1),
    };
    let moon_m = shutter[1].bodies.moon_geocentric_m - shutter[1].position_m;
    let (range_m, phase) = geometric(&shutter[1], &moon_m);
    let seen = VisiblePlanet {
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
    let body = Body::Planet(Box::new(seen));
    Some(Candidate::new(body, clear_e, visible, hidden))
}

/// The planets that may be in the cone of `angle` (rad) around `axis`, as points.
pub(crate) fn planets(
    view: &View,
    world: &World,
    shutter: &[Observer; 3],
    axis: &Vector3<f64>,
    angle: f64,
) -> Vec<Candidate> {
    let seen = seen_by(&shutter[1], &world.corrections);
    let nearest = libm::cos(angle.min(std::f64::consts::PI));
    let near = |planet: &Planet| planet.direction.dot(axis) >= nearest;
    if !seen.iter().any(near) {
        return Vec::new();
    }
    let ends = [0, 2].map(|i: usize| seen_by(&shutter[i], &world.corrections));
    let earth = Earth::at(view.exposure.mid);
    let rows = seen.iter().zip(ends[0].iter().zip(&ends[1]));
    let rows = rows.filter(|(planet, _)| near(planet) && planet.magnitude.is_finite());
    let candidates = rows.map(|(planet, (start, end))| {
        let (range_m, phase) = geometric(&shutter[1], &planet.geometric_m);
        let body = VisiblePlanet {
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
        let clear_e = view.electrons(body.mag);
        let hidden = view.hidden(&planet.direction, &earth, &shutter[1]);
        Candidate::new(Body::Planet(Box::new(body)), clear_e, 1.0, hidden)
    });
    candidates.collect()
}

/// Number of squares on a side of a disc; 1 if it is smaller than a pixel.
fn squares(view: &View, disc: &MoonDisc) -> f64 {
    let side_px = 2.0 * disc.angular_radius * view.scale_and_corner_px.0;
    if side_px <= 1.0 {
        return 1.0;
    }
    let core_px = view.camera.optics.psf.core_px();
    (side_px / (ELEMENT * core_px).min(WIDEST_PX)).ceil()
}
