//! What stands before the camera during one exposure: directions and light, before the optics make images of them.

use super::area::{AREA_LOOK_NS, STEPS_PX, most_steps};
use super::observable::{Unobservable, shutter, turn_at};
use super::{Area, Body, EffectSet, Exposure, Hidden, SeenSun, World};
use crate::attitude::{Attitude, VehicleState};
use crate::camera::{Camera, SUN_MAGNITUDE, Side, Stamp};
use crate::fidelity::Fidelity;
use crate::footprint::{Footprint, Light};
use crate::sky::apparent::Observer;
use crate::sky::bodies::LIGHT_M_S;
use crate::sky::field::{Field, Unseen};
use crate::sky::moon::MoonDisc;
use crate::sky::photometry::photon_irradiance;
use crate::sky::population::SeenObject;
use crate::sky::shadow::Earth;
use crate::sky::star_field::SeenStar;
use crate::track::Window;
use crate::track::rule::fewest_points;
use nalgebra::Vector3;
use rayon::iter::Either;
use rayon::prelude::*;
use skyloop_base::abort::WorkLimit;
use skyloop_base::rng::NoiseKey;
use skyloop_orbit::OrbitError;
use skyloop_orbit::sgp4_batch::Level;
use std::sync::Arc;

/// Sources that one thread looks at at least.
const FEW: usize = 128;

/// The Moon and the planets.
const WANDERERS: usize = 8;

/// A point source near the field, before its image is made.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// What it is.
    pub body: Body,
    /// Electrons that all its light in the exposure would give, were it neither hidden nor shaded.
    pub clear_e: f64,
    /// The part of that light which arrives (1).
    pub light: f64,
    /// Why none does.
    pub hidden: Option<Hidden>,
    /// The angle (rad) that it moves through by itself.
    pub(super) swing: f64,
}

impl Candidate {
    /// A body of so much light, and the part of it that arrives.
    pub(super) fn new(body: Body, clear_e: f64, light: f64, hidden: Option<Hidden>) -> Candidate {
        Candidate {
            swing: body.swing(),
            body,
            clear_e,
            light,
            hidden,
        }
    }

    /// How much of its light is to be spread, and of which colour: objects shine by the Sun's.
    pub fn shine(&self) -> Light {
        Light {
            electrons: self.clear_e,
            wavelength_ratio: self.body.wavelength_ratio(),
        }
    }

    /// Electrons that its light gives.
    pub fn electrons(&self) -> f64 {
        match self.hidden {
            Some(_) => 0.0,
            None => self.clear_e * self.light,
        }
    }
}

/// What stands before the camera during one exposure.
#[derive(Debug, Clone)]
pub struct View {
    /// When.
    pub exposure: Exposure,
    /// From the first row's opening to the last row's closing, around the middle of the exposure, s.
    pub open_s: f64,
    /// How far the body turns in that time, rad.
    pub turn: f64,
    /// How much the observer's velocity, as far as it aberrates, differs at the start and at the end of that time from
    /// that at mid-exposure, m/s.
    pub velocity_change_m_s: [Vector3<f64>; 2],
    /// The vehicle in the middle of the exposure.
    pub vehicle: VehicleState,
    /// The camera, with what was commanded of it.
    pub camera: Arc<Camera>,
    /// Its [`Camera::scale_and_corner_px`].
    pub scale_and_corner_px: (f64, f64),
    /// What all noise is keyed by.
    pub key: NoiseKey,
    /// The vector instructions that streaks are drawn with; none: pixel by pixel. All give the same.
    pub level: Option<Level>,
    /// What the work on the frame may cost: once it is over, sources have no image.
    pub limit: WorkLimit,
    /// Whether every pixel is full of light whatever moves, and the frame would cost too much: then nothing moves.
    pub still_in_flood: bool,
    /// Who looks, in the middle of the exposure: without an orbit, from the Earth's centre.
    pub observer: Observer,
    /// Stars in catalogue order, then objects in the population's, planets, the Moon.
    pub candidates: Vec<Candidate>,
    /// The direction of the Moon's centre (unit vector, ICRF), and the cosine of its radius.
    pub(super) moon: (Vector3<f64>, f64),
    /// The Sun.
    pub sun: SeenSun,
    /// Area sources, in the order of their effects.
    pub areas: Vec<Area>,
    /// How many objects the scene has, before the camera or not.
    pub objects: usize,
    /// Objects before the camera that need no image, by their indices, and why.
    pub unseen: Vec<(usize, Unseen)>,
    /// Objects whose orbit has no answer at this time.
    pub unknown: Unknown,
    /// The greatest swing of a candidate, rad.
    swing: f64,
    /// Where the camera points when tracks ask for it most, by the time from mid-exposure, s.
    pointings: Vec<(f64, Attitude)>,
    /// What stars stand between whose image may touch the detector: normals, and the least products with them.
    sides: Vec<(Vector3<f64>, f64)>,
    /// Where light matters that is lost up to that share of a source's (1).
    window: (f64, Window),
}

/// What is too faint for an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Faint {
    /// What has no more than this signal-to-noise ratio (1),
    pub snr: f64,
    /// or than this where none of its light arrives, and it is in full light that the ratio is meant,
    pub unlit_snr: f64,
    /// and of stars what has less than this,
    pub star_snr: f64,
    /// in noise that every pixel has, whatever it shows, e-.
    pub floor_e: f64,
}

/// Objects whose orbit has no answer.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Unknown {
    /// How many.
    pub count: usize,
    /// Why, of those of whom that has not been said before.
    pub news: Vec<OrbitError>,
}

/// ns of an object in the search for those in the field, of one that is there, and of one there that is seen: three places and its light, bounds and label.
pub const OBJECT_NS: f64 = 700.0;
const IN_FIELD_NS: f64 = 300.0;
const SEEN_NS: f64 = 5000.0;

impl View {
    /// What `camera` on `vehicle` has before it during `exposure`, but for area sources ([`View::where_shine`]). Stars and objects that are
    /// too `faint`, even in full light, have no image.
    ///
    /// Fails only where the exposure time is none, the epoch lies outside the ephemerides, the body turns further than [`MAX_TURN`](super::MAX_TURN), or the
    /// observer's state, carried through the exposure, leaves its range or comes into the Moon.
    pub fn new(
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
            match world.corrections.aberration {
                true => change,
                false => Vector3::zeros(),
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
            swing: 0.0,
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
        let axis = view.pointing(0.0).matrix().transpose() * Vector3::z();
        let reach_px = camera.optics.psf.reach_px(fidelity.psf_loss);
        let cone = camera.cone_rad(reach_px) + turn / 2.0;

        let moon = MoonDisc::seen_by(&shutter[1], &world.corrections);
        view.moon = (moon.direction, libm::cos(moon.angular_radius));
        let to_icrf = view.pointing(0.0).matrix().transpose();
        let sides = camera.sides(reach_px).into_iter().map(|side| Side {
            inward: to_icrf * side.inward,
            beyond: side.beyond + turn / 2.0,
        });
        let field = Field {
            axis,
            angle: cone,
            sides: &sides.collect::<Vec<_>>(),
            shutter: &shutter,
            reach_m: view.reach_m(&faint),
        };
        let objects = || {
            let population = &world.population;
            population.in_field(&field, &world.corrections, fidelity.orbits)
        };
        let others = || {
            let stars = &world.stars;
            let stars = stars.in_cone(&axis, cone, &shutter[1], &world.corrections);
            (stars, view.the_moon(&moon, world, &shutter, &axis, cone))
        };
        let (seen, (stars, the_moon)) = rayon::join(objects, others);
        let earth = Earth::at(exposure.mid);
        view.sides = field.still_sides();
        // All in their places, and with room for those that follow.
        let mut candidates = Vec::with_capacity(stars.len() + seen.objects.len() + WANDERERS);
        let stars = stars.into_par_iter().with_min_len(FEW);
        candidates.par_extend(stars.map(|star| view.star(star, &earth, &shutter[1])));
        let faintest_e = faint.star_snr * view.noise_e(faint.floor_e);
        candidates.retain(|star| star.clear_e >= faintest_e);
        let (bright, too_faint) = view.rsos(seen.objects, &faint);
        candidates.extend(bright);
        candidates.extend(view.planets(world, &shutter, &axis, cone));
        candidates.extend(the_moon);
        view.candidates = candidates;
        view.unseen = seen.unseen;
        view.unseen.extend(too_faint);
        view.unknown = Unknown {
            count: seen.unknown,
            news: seen.news,
        };
        view.sun = SeenSun::of(world, &view);
        view.swing = view.greatest_swing();
        Ok(view)
    }

    /// With area sources, and without the sources of effects that do not run.
    pub fn where_shine(mut self, world: &World, runs: &EffectSet) -> View {
        self.candidates
            .retain(|candidate| runs.has(candidate.body.effect()));
        self.swing = self.greatest_swing();
        self.areas = self.areas(world, runs);
        self
    }

    fn greatest_swing(&self) -> f64 {
        let swings = self.candidates.iter().map(|candidate| candidate.swing);
        swings.fold(0.0, f64::max)
    }

    /// Work of the search for objects in the field, ns.
    pub fn search_ns(&self) -> f64 {
        let is_rso = |candidate: &&Candidate| matches!(candidate.body, Body::Rso(_));
        let seen = self.candidates.iter().filter(is_rso).count() as f64;
        self.objects as f64 * OBJECT_NS + self.unseen.len() as f64 * IN_FIELD_NS + seen * SEEN_NS
    }

    /// That it costs more than the limit (s on one core).
    pub fn too_much(&self, limit_s: Option<f64>) -> Unobservable {
        Unobservable::TooMuchWork {
            sources: self.candidates.len(),
            length_px: self.longest_path_px(),
            exposure_s: self.exposure.duration_s,
            limit_s: limit_s.unwrap_or(f64::INFINITY),
        }
    }

    /// Whether the image of a candidate may touch the detector, as far as its direction tells.
    pub(super) fn may_hold(&self, candidate: &Candidate) -> bool {
        let (mut sides, optics) = (self.sides.iter(), &self.camera.optics);
        match &candidate.body {
            Body::Star(star) => sides.all(|(inward, least)| star.direction.dot(inward) >= *least),
            Body::Rso(_) => true,
            Body::Wanderer(body) => {
                // Its disc, whose light is centred beside the middle, and wings that are drawn further than those of stars.
                let wings = 2.0 * optics.psf.reach_px(f64::EPSILON) / optics.focal_px;
                let reach = 2.0 * body.angular_radius + candidate.swing + wings;
                sides.all(|(inward, least)| {
                    libm::asin(body.centre.dot(inward).clamp(-1.0, 1.0)) + reach
                        >= libm::asin(*least)
                })
            }
        }
    }

    /// ICRF to camera, `dt_s` after mid-exposure.
    pub fn pointing(&self, dt_s: f64) -> Attitude {
        if let Some((_, known)) = self.pointings.iter().find(|(t, _)| *t == dt_s) {
            return *known;
        }
        self.vehicle
            .attitude
            .turned(&self.vehicle.rates, dt_s)
            .then(&self.camera.mounting)
    }

    /// By how much aberration moves a star (rad, ICRF axes) from its direction at mid-exposure, at a part of the view's
    /// time (0: its start, 1: its end). First order in v / c: `du = (dv - (dv . u) u) / c`; dv runs through start, mid and end.
    pub fn aberration_drift(&self, star: &Vector3<f64>, part: f64) -> Vector3<f64> {
        let [start, end] = &self.velocity_change_m_s;
        let dv = start * ((2.0 * part - 1.0) * (part - 1.0)) + end * (part * (2.0 * part - 1.0));
        (dv - star * dv.dot(star)) / LIGHT_M_S
    }

    /// A bound (px) of the way of an image on the detector in `seconds` of the view's time: a turn across the boresight
    /// moves images by the scale of the plane, one about it by their distance from it.
    pub fn longest_track_px(&self, seconds: f64) -> f64 {
        let turn = self.camera.mounting.rotate(&self.vehicle.rates) * seconds;
        // What turns unevenly turns by no more than all of it, and by little more than twice the mean.
        let share = match seconds < self.open_s {
            true => (2.0 * seconds / self.open_s).min(1.0),
            false => 1.0,
        };
        let own = self.swing * share;
        let (scale, furthest) = self.scale_and_corner_px;
        (libm::hypot(turn.x, turn.y) + own) * scale + turn.z.abs() * furthest
    }

    /// A bound (e-) of the pixel that the most light falls on, of each source that part which `part` says of its direction
    /// (camera axes): twice that of the brightest source, for what stands beside it.
    pub fn brightest_px_e(&self, part: impl Fn(&Vector3<f64>) -> f64) -> f64 {
        let camera = &self.camera;
        let psf = camera.optics.psf_at(camera.optics.principal_px, 1.0);
        let share = psf.on_pixel([0.0; 2], &mut Stamp::default());
        let pointing = self.pointing(0.0);
        let widest = (camera.cone_rad(psf.core_px() * 5.0) + self.turn).min(std::f64::consts::PI);
        let edge = libm::cos(widest);
        let mut most = 0.0f64;
        for candidate in &self.candidates {
            let e = candidate.electrons();
            // Few are brighter than all before them.
            if e > most {
                let seen = pointing.rotate(&candidate.body.line(0.5)).normalize();
                if seen.z >= edge - candidate.swing {
                    most = most.max(e * part(&seen));
                }
            }
        }
        2.0 * most * share
    }

    /// How far (px) the edges of area light move by themselves in `seconds`, at most.
    pub fn areas_swing_px(&self, seconds: f64) -> f64 {
        let swings = self.areas.iter().map(|area| area.swing());
        swings.fold(0.0, f64::max) * seconds * self.scale_and_corner_px.0
    }

    /// How far (px) images and the edges of area light move in the exposure, at most.
    pub fn longest_path_px(&self) -> f64 {
        let seconds = self.exposure.duration_s;
        self.longest_track_px(seconds) + self.areas_swing_px(seconds)
    }

    /// What smearing area light takes, about, ms: edges are taken to run once across the field.
    pub fn areas_smear_ms(&self) -> f64 {
        // What an edge crosses, and what is near it: of what moves by less than a pixel only the first is looked at again.
        const EDGE_PX: f64 = 1.5;
        const LIMB_PX: f64 = 8.0;
        const STEP_NS: f64 = 200.0;
        // Places a pixel at which even light is looked at.
        const PLACES: f64 = 0.01;
        // Looks at each pixel of light with details below FEW_PX, for each look that its panels begin with.
        const HALVED: f64 = 6.0;
        const FEW_PX: f64 = 32.0;
        let edged = self.areas.iter().filter(|area| area.has_edges());
        let px = self.longest_path_px();
        let pixels = self.camera.detector.pixels();
        let steps = (STEPS_PX * px + 1.0).min(most_steps(pixels) as f64);
        let [columns, rows] = self.camera.detector.sides();
        let near_px = if px > 1.0 { LIMB_PX } else { EDGE_PX };
        let smeared = ((near_px + px) * (columns + rows)).min(pixels as f64);
        let looks = self.areas.iter().map(|area| {
            let is_fine = !area.has_edges() && area.detail() * self.scale_and_corner_px.0 < FEW_PX;
            area.looks_on(px) as f64 * if is_fine { HALVED } else { PLACES }
        });
        let looking = pixels as f64 * looks.sum::<f64>() * AREA_LOOK_NS;
        (edged.count() as f64 * smeared * steps * STEP_NS + looking) * 1e-6
    }

    /// About the most area light of a pixel, e-.
    pub fn areas_peak_e(&self) -> f64 {
        self.areas.iter().map(|area| area.peak_e).sum()
    }

    /// The part of the detector plane whose light matters.
    pub(super) fn window(&self, fidelity: &Fidelity) -> Window {
        match self.window {
            (loss, window) if loss == fidelity.psf_loss => window,
            _ => Footprint::window(&self.camera, fidelity),
        }
    }

    fn star(&self, star: SeenStar, earth: &Earth, observer: &Observer) -> Candidate {
        let clear_e = self.electrons(star.band_mag);
        let hidden = self.hidden(&star.direction, earth, observer);
        Candidate::new(Body::Star(star), clear_e, 1.0, hidden)
    }

    /// Of these objects those that are bright enough for an image, and the others.
    fn rsos(
        &self,
        objects: Vec<Arc<SeenObject>>,
        faint: &Faint,
    ) -> (Vec<Candidate>, Vec<(usize, Unseen)>) {
        let noise_e = self.noise_e(faint.floor_e);
        let sorted_out = objects.into_par_iter().with_min_len(FEW).map(|object| {
            let index = object.index;
            let candidate = self.rso(object);
            let is_unlit = candidate.electrons() <= 0.0;
            let least = if is_unlit { faint.unlit_snr } else { faint.snr };
            match candidate.clear_e <= least * noise_e {
                true => Either::Right((index, Unseen::TooFaint)),
                false => Either::Left(candidate),
            }
        });
        sorted_out.partition_map(|either| either)
    }

    fn rso(&self, object: Arc<SeenObject>) -> Candidate {
        let hidden = if object.occulted {
            Some(Hidden::ByEarth)
        } else {
            (object.illumination <= 0.0).then_some(Hidden::InShadow)
        };
        let (clear_e, light) = (self.electrons(object.mag), object.illumination);
        Candidate::new(Body::Rso(object), clear_e, light, hidden)
    }

    /// The light (e-) of an exposure that has a signal-to-noise ratio of 1 at most, where every pixel has noise of `floor_e`: N electrons have
    /// `N (sum s^2)^(1/2) / floor` at most, as pixels respond. An image that runs along with the rows' readout has l times the light, for as long as that
    /// takes; but no pixel is open for longer than the exposure, or has more of it than the peak p: `sum s^2 <= p l`.
    fn noise_e(&self, floor_e: f64) -> f64 {
        let response = 1.0 + self.camera.detector.pattern.worst_response();
        let longest = match self.exposure.duration_s > 0.0 {
            true => self.open_s / self.exposure.duration_s,
            false => 1.0,
        };
        let psf = &self.camera.optics.psf;
        let squares = (psf.sharpness() * longest * longest).min(psf.peak() * longest);
        floor_e / (squares.sqrt() * response)
    }

    /// The distance (m) from which 1 m^2/sr of reflective area is too faint. Eqs. (2), (9), (11), with E_sun those of the Sun's own light:
    /// `N = E_sun A (au / d_sun d)^2`. Nothing is nearer to the Sun than 0.98 au.
    fn reach_m(&self, faint: &Faint) -> f64 {
        const NEAREST: f64 = 0.98;
        let faintest_e = faint.snr * self.noise_e(faint.floor_e);
        (self.electrons(SUN_MAGNITUDE) / faintest_e).sqrt() / NEAREST
    }

    /// Clark et al. 2021, Eqs. (2), (11), before the division by the gain:
    /// `N = E_obj QE tau A_app t_int`, with `E_obj = E_zero 10^(-0.4 m)`.
    pub(super) fn electrons(&self, band_mag: f64) -> f64 {
        let per_second = self.camera.electrons_per_second_at_zero();
        photon_irradiance(per_second, band_mag) * self.exposure.duration_s
    }
}
