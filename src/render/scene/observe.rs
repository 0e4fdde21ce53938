//! Builds a [`View`]: finds the stars, objects, planets and the Moon that may be in the field, and
//! their light.

use super::area::kind::{Kind, areas};
use super::effect_set::EffectSet;
use super::exposure::Exposure;
use super::observable::{Unobservable, shutter, turn_at};
use super::planets::{planets, the_moon};
use super::solar_system::SeenSun;
use super::source::{Body, Candidate, Hidden};
use super::view::{Faint, Unknown, View};
use super::world::World;
use crate::attitude::VehicleState;
use crate::camera::{Camera, SUN_MAGNITUDE, Side};
use crate::fidelity::Fidelity;
use crate::footprint::Footprint;
use crate::sky::apparent::Observer;
use crate::sky::bodies::AU_M;
use crate::sky::field::{Excluded, Field};
use crate::sky::moon::MoonDisc;
use crate::sky::population::SeenObject;
use crate::sky::shadow::Earth;
use crate::sky::star_field::SeenStar;
use crate::track::rule::fewest_points;
use nalgebra::Vector3;
use rayon::iter::Either;
use rayon::prelude::*;
use skyloop_base::abort::WorkLimit;
use skyloop_base::rng::NoiseKey;
use skyloop_orbit::sgp4_batch::Level;
use std::sync::Arc;

/// Least number of sources for a task.
const MIN_SOURCES: usize = 128;

/// Number of the Moon and the planets.
const MOON_AND_PLANETS: usize = 8;

/// The view of `camera` on `vehicle` during `exposure`, without area sources ([`add_areas`]). Stars
/// and objects too `faint` even in full light are left out.
///
/// Fails if the exposure time is invalid, the epoch lies outside the ephemerides, the body turns
/// further than [`MAX_TURN`](super::MAX_TURN), or the observer's propagated state leaves its range
/// or enters the Moon.
pub fn build_view(
    world: &World,
    camera: &Arc<Camera>,
    vehicle: &VehicleState,
    exposure: Exposure,
    fidelity: &Fidelity,
    key: NoiseKey,
    faint: Faint,
) -> Result<View, Unobservable> {
    let open_s = exposure.duration_s + camera.readout_s();
    let turn = turn_at(vehicle.rates, open_s)?;
    let shutter = shutter(vehicle, &Exposure::around(exposure.mid, open_s))?;
    let change = |observer: &Observer| {
        let change = observer.velocity_m_s - shutter[1].velocity_m_s;
        if world.corrections.aberration {
            change
        } else {
            Vector3::zeros()
        }
    };
    let mut view = View {
        exposure,
        open_s,
        turn,
        velocity_change_m_s: [change(&shutter[0]), change(&shutter[2])],
        vehicle: vehicle.at(exposure.mid),
        camera: camera.clone(),
        scale_and_corner_px: camera.scale_and_corner_px(),
        key,
        level: Some(Level::best()),
        limit: WorkLimit::default(),
        still_in_flood: false,
        observer: shutter[1],
        candidates: Vec::new(),
        moon: (Vector3::zeros(), 1.0),
        sun: SeenSun::default(),
        areas: Vec::new(),
        objects: world.population.objects().len(),
        unseen: Vec::new(),
        unknown: Unknown::default(),
        own_motion: 0.0,
        pointings: Vec::new(),
        sides: Vec::new(),
        window: (fidelity.psf_loss, Footprint::window(camera, fidelity)),
    };
    const EIGHTHS: u8 = 8;
    let eighths = (0..=EIGHTHS).map(|i| f64::from(i) / f64::from(EIGHTHS));
    let times = eighths
        .chain(fewest_points())
        .map(|part| (part - 0.5) * open_s);
    view.pointings = times.map(|dt_s| (dt_s, view.pointing(dt_s))).collect();
    find_candidates(&mut view, world, &shutter, fidelity, &faint);
    view.sun = seen_sun(&view, world);
    view.own_motion = greatest_own_motion(&view.candidates);
    Ok(view)
}

/// Finds the candidates of a view.
fn find_candidates(
    view: &mut View,
    world: &World,
    shutter: &[Observer; 3],
    fidelity: &Fidelity,
    faint: &Faint,
) {
    let axis = view.pointing(0.0).matrix().transpose() * Vector3::z();
    let reach_px = view.camera.optics.psf.reach_px(fidelity.psf_loss);
    let cone = view.camera.cone_rad(reach_px) + view.turn / 2.0;

    let moon = MoonDisc::seen_by(&shutter[1], &world.corrections);
    view.moon = (moon.direction, libm::cos(moon.angular_radius));
    let to_icrf = view.pointing(0.0).matrix().transpose();
    let sides = view.camera.sides(reach_px).into_iter().map(|side| Side {
        inward: to_icrf * side.inward,
        beyond: side.beyond + view.turn / 2.0,
    });
    let field = Field {
        axis,
        angle: cone,
        sides: &sides.collect::<Vec<_>>(),
        shutter,
        reach_m: reach_m(view, faint),
    };
    let objects = || {
        let population = &world.population;
        population.in_field(&field, &world.corrections, fidelity.orbits)
    };
    let others = || {
        let stars = &world.stars;
        let stars = stars.in_cone(&axis, cone, &shutter[1], &world.corrections);
        (stars, the_moon(view, &moon, world, shutter, &axis, cone))
    };
    let (seen, (stars, the_moon)) = rayon::join(objects, others);
    let earth = Earth::at(view.exposure.mid);
    view.sides = field.star_side_bounds();
    // Allocated once, with capacity for all kinds.
    let mut candidates = Vec::with_capacity(stars.len() + seen.objects.len() + MOON_AND_PLANETS);
    let stars = stars.into_par_iter().with_min_len(MIN_SOURCES);
    candidates.par_extend(stars.map(|star| seen_star(view, star, &earth, &shutter[1])));
    let faintest_e = faint.star_snr * noise_e(view, faint.floor_e);
    candidates.retain(|star| star.clear_e >= faintest_e);
    let (bright, too_faint) = rsos(view, seen.objects, faint);
    candidates.extend(bright);
    candidates.extend(planets(view, world, shutter, &axis, cone));
    candidates.extend(the_moon);
    view.candidates = candidates;
    view.unseen = seen.excluded;
    view.unseen.extend(too_faint);
    view.unknown = Unknown {
        count: seen.unknown,
        notices: seen.notices,
    };
}

/// The view with the area sources of those `kinds`, and without the sources of effects that do not
/// run.
pub fn add_areas(
    mut view: View,
    world: &World,
    kinds: impl Iterator<Item = Kind>,
    runs: &EffectSet,
) -> View {
    view.candidates
        .retain(|candidate| runs.has(candidate.body.effect()));
    view.own_motion = greatest_own_motion(&view.candidates);
    view.areas = areas(&view, world, kinds, runs);
    view
}

fn greatest_own_motion(candidates: &[Candidate]) -> f64 {
    let motions = candidates.iter().map(|candidate| candidate.own_motion);
    motions.fold(0.0, f64::max)
}

/// The Sun as the observer of a view sees it.
fn seen_sun(view: &View, world: &World) -> SeenSun {
    let sun_m = view.observer.sun_m(&world.corrections);
    let boresight = view.pointing(0.0).matrix().transpose() * Vector3::z();
    let angle = libm::atan2(boresight.cross(&sun_m).norm(), boresight.dot(&sun_m));
    // An observer without an orbit is at the Earth's centre; the Earth is transparent.
    let lit = view.vehicle.orbit.map_or(1.0, |state| {
        let earth = Earth::at(view.exposure.mid);
        earth.illumination(state.position_m, view.observer.bodies.sun_apparent_m())
    });
    let optics = &view.camera.optics;
    SeenSun {
        angle,
        lit,
        irradiance: optics.band.sun_irradiance() * AU_M * AU_M / sun_m.norm_squared(),
        excluded: lit > 0.0 && angle < optics.stray.sun_exclusion,
    }
}

fn seen_star(view: &View, star: SeenStar, earth: &Earth, observer: &Observer) -> Candidate {
    let clear_e = view.electrons(star.band_mag);
    let hidden = view.hidden(&star.direction, earth, observer);
    Candidate::new(Body::Star(star), clear_e, 1.0, hidden)
}

/// Splits objects into those bright enough for an image, and the others.
fn rsos(
    view: &View,
    objects: Vec<Arc<SeenObject>>,
    faint: &Faint,
) -> (Vec<Candidate>, Vec<(usize, Excluded)>) {
    let noise_e = noise_e(view, faint.floor_e);
    let sorted_out = objects
        .into_par_iter()
        .with_min_len(MIN_SOURCES)
        .map(|object| {
            let index = object.index;
            let candidate = rso(view, object);
            let is_unlit = candidate.electrons() <= 0.0;
            let min_snr = if is_unlit { faint.unlit_snr } else { faint.snr };
            if candidate.clear_e <= min_snr * noise_e {
                Either::Right((index, Excluded::TooFaint))
            } else {
                Either::Left(candidate)
            }
        });
    sorted_out.partition_map(|either| either)
}

fn rso(view: &View, object: Arc<SeenObject>) -> Candidate {
    let hidden = if object.occulted {
        Some(Hidden::ByEarth)
    } else {
        (object.illumination <= 0.0).then_some(Hidden::InShadow)
    };
    let (clear_e, light) = (view.electrons(object.mag), object.illumination);
    Candidate::new(Body::Rso(object), clear_e, light, hidden)
}

/// Lower bound of the light whose signal-to-noise ratio is 1, if every pixel has noise of
/// `floor_e`, e-. The ratio of N electrons is at most `N (sum s^2)^(1/2) / floor`, times the
/// response. An image that moves along with the readout has up to l times the light, but no pixel
/// is open for longer than the exposure or has a greater share than the peak p: `sum s^2 <= p l`.
fn noise_e(view: &View, floor_e: f64) -> f64 {
    let response = 1.0 + view.camera.detector.pattern.worst_response();
    let longest = if view.exposure.duration_s > 0.0 {
        view.open_s / view.exposure.duration_s
    } else {
        1.0
    };
    let psf = &view.camera.optics.psf;
    let squares = (psf.sharpness() * longest * longest).min(psf.peak() * longest);
    floor_e / (squares.sqrt() * response)
}

/// The distance beyond which 1 m^2/sr of reflective area is too faint, m. Clark et al. 2021, Eqs.
/// (2), (9), (11), with E_sun of the Sun's light: `N = E_sun A (au / d_sun d)^2`. Nothing is nearer
/// to the Sun than 0.98 au.
fn reach_m(view: &View, faint: &Faint) -> f64 {
    const NEAREST: f64 = 0.98;
    let faintest_e = faint.snr * noise_e(view, faint.floor_e);
    (view.electrons(SUN_MAGNITUDE) / faintest_e).sqrt() / NEAREST
}
