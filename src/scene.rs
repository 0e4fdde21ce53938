//! The scene: everything that one exposure sees, worked out once and only read afterwards.

use crate::attitude::{Attitude, AttitudeError, VehicleState, check_orbit};
use crate::camera::Camera;
use crate::fidelity::Fidelity;
use crate::footprint::Footprint;
use crate::rng::NoiseKey;
use crate::sky::apparent::Observer;
use crate::sky::bodies::{Bodies, EpochOutOfRange};
use crate::sky::photometry::photon_irradiance;
use crate::sky::population::SeenObject;
use crate::sky::shadow::Earth;
use crate::sky::star_field::SeenStar;
use crate::sky::{Corrections, Population, StarField};
use crate::track::Track;
use hifitime::{Epoch, Unit};
use nalgebra::Vector3;
use rayon::prelude::*;
use skyloop_orbit::time::utc_text;
use skyloop_orbit::{OrbitError, StateVector};
use std::sync::Arc;
use thiserror::Error;

/// What does not change from frame to frame.
#[derive(Debug)]
pub struct World {
    /// The stars.
    pub stars: StarField,
    /// The objects in orbit.
    pub population: Population,
    /// What moves directions.
    pub corrections: Corrections,
}

/// An exposure's three instants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// Shutter opens.
    pub start: Epoch,
    /// The middle, which attitude and state hold for.
    pub mid: Epoch,
    /// Shutter closes.
    pub end: Epoch,
    /// Exposure time, s.
    pub duration_s: f64,
}

impl Exposure {
    /// The exposure of `duration_s` around `mid`.
    pub fn around(mid: Epoch, duration_s: f64) -> Exposure {
        let half = Unit::Second * (duration_s / 2.0);
        Exposure {
            start: mid - half,
            mid,
            end: mid + half,
            duration_s,
        }
    }
}

/// What a source is.
#[derive(Debug, Clone)]
pub enum Body {
    /// A star of the catalogue.
    Star(SeenStar),
    /// A resident space object.
    Rso(Box<SeenObject>),
}

/// Why no light of a source arrives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hidden {
    /// The Earth stands before it.
    ByEarth,
    /// It is in the Earth's umbra.
    InShadow,
}

/// Furthest that the body may turn during one exposure, rad: a streak then crosses most fields. Time grows with
/// the streaks' length: at the limit a frame of 256 x 256 pixels takes over a second.
pub const MAX_TURN: f64 = 1.0;

/// Why there is no scene.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Unobservable {
    /// The ephemerides do not reach the epoch.
    #[error(transparent)]
    Epoch(#[from] EpochOutOfRange),
    /// The body turns too far.
    #[error(
        "the body turns {turn_deg:.1} deg during the exposure of {exposure_s} s: at most {:.1} deg are shown; \
         lower the rates or the exposure",
        MAX_TURN.to_degrees()
    )]
    Turn {
        /// How far, deg.
        turn_deg: f64,
        /// The exposure time, s.
        exposure_s: f64,
    },
    /// The state, carried on by its orbit, has left the range of observers.
    #[error("state carried on to {}: {source}", utc_text(*epoch))]
    State {
        /// An instant of the exposure.
        epoch: Epoch,
        /// What is wrong with it there.
        source: AttitudeError,
    },
}

/// How far (rad) a body of these rates (rad/s) turns during an exposure of `exposure_s`, if that can be shown.
pub fn turn_at(rates: Vector3<f64>, exposure_s: f64) -> Result<f64, Unobservable> {
    let turn = rates.norm() * exposure_s;
    if turn > MAX_TURN {
        let turn_deg = turn.to_degrees();
        return Err(Unobservable::Turn {
            turn_deg,
            exposure_s,
        });
    }
    Ok(turn)
}

/// The observer at start, mid and end of an exposure. The Earth and the Sun are taken at mid, for which they are asked.
pub fn shutter(vehicle: &VehicleState, exposure: &Exposure) -> Result<[Observer; 3], Unobservable> {
    let centre = StateVector {
        position_m: Vector3::zeros(),
        velocity_m_s: Vector3::zeros(),
    };
    let bodies = Bodies::at(exposure.mid)?;
    let at = |epoch: Epoch| -> Result<Observer, Unobservable> {
        let orbit = vehicle.at(epoch).orbit;
        if let Some(state) = &orbit {
            check_orbit(state).map_err(|source| Unobservable::State { epoch, source })?;
        }
        let state = orbit.unwrap_or(centre);
        Ok(Observer {
            epoch,
            position_m: state.position_m,
            velocity_m_s: state.velocity_m_s,
            bodies,
        })
    };
    Ok([at(exposure.start)?, at(exposure.mid)?, at(exposure.end)?])
}

/// A point source in the field.
#[derive(Debug, Clone)]
pub struct Source {
    /// What it is.
    pub body: Body,
    /// Its image at the exposure's start (or where it comes before the camera), px.
    pub start: [f64; 2],
    /// Its image at the exposure's end (or where it goes behind the camera), px.
    pub end: [f64; 2],
    /// Flux-weighted centre of all its light, px.
    pub centroid: [f64; 2],
    /// Its share on each pixel.
    pub footprint: Footprint,
    /// Expected electrons of the whole exposure, on and off the detector.
    pub electrons: f64,
    /// Why there are none.
    pub hidden: Option<Hidden>,
    /// Signal-to-noise ratio on the detector.
    pub snr: f64,
    /// The same, were it neither hidden nor shaded: what decides whether labels list it.
    pub clear_snr: f64,
}

/// Everything that one exposure sees.
#[derive(Debug)]
pub struct Scene {
    /// When.
    pub exposure: Exposure,
    /// The vehicle in the middle of the exposure.
    pub vehicle: VehicleState,
    /// ICRF to camera in the middle of the exposure.
    pub pointing: Attitude,
    /// The camera, with what was commanded of it.
    pub camera: Arc<Camera>,
    /// What all noise is keyed by.
    pub key: NoiseKey,
    /// Whether noise is drawn.
    pub noise: bool,
    /// Stars in catalogue order, then objects in the population's.
    pub sources: Vec<Source>,
    /// Objects whose orbit has no answer at this time.
    pub unknown: Vec<OrbitError>,
}

impl Scene {
    /// What `camera` on `vehicle` sees during `exposure`.
    ///
    /// Fails only where the epoch lies outside the ephemerides, the body turns further than [`MAX_TURN`], or the
    /// observer's state, carried through the exposure, leaves its range.
    pub fn observe(
        world: &World,
        camera: &Arc<Camera>,
        vehicle: &VehicleState,
        exposure: Exposure,
        fidelity: &Fidelity,
        key: NoiseKey,
        noise: bool,
    ) -> Result<Scene, Unobservable> {
        let turn = turn_at(vehicle.rates, exposure.duration_s)?;
        let motion = Motion {
            vehicle: vehicle.at(exposure.mid),
            camera,
            exposure,
            fidelity,
        };
        let shutter = shutter(vehicle, &exposure)?;
        let pointing = motion.pointing(0.5);
        let axis = pointing.matrix().transpose() * Vector3::z();
        let reach_px = camera.optics.psf.reach_px(fidelity.psf_loss);
        let cone = camera.cone_rad(reach_px) + turn / 2.0;

        let stars = world
            .stars
            .in_cone(&axis, cone, &shutter[1], &world.corrections);
        let earth = Earth::at(exposure.mid);
        let mut sources: Vec<Source> = stars
            .into_par_iter()
            .filter_map(|star| motion.star(star, &earth, &shutter[1]))
            .collect();
        let (objects, unknown) =
            world
                .population
                .in_cone(&axis, cone, &shutter, &world.corrections);
        sources.par_extend(
            objects
                .into_par_iter()
                .filter_map(|object| motion.rso(object)),
        );
        Ok(Scene {
            exposure,
            vehicle: motion.vehicle,
            pointing,
            camera: camera.clone(),
            key,
            noise,
            sources,
            unknown,
        })
    }

    /// Expected background of a pixel, from no star and no object, averaged over the frame, e-.
    pub fn background_e(&self) -> f64 {
        background_e(&self.camera, &self.exposure)
    }
}

/// So far the dark charge alone, e-.
fn background_e(camera: &Camera, exposure: &Exposure) -> f64 {
    camera.detector.dark_e(exposure.duration_s)
}

/// The vehicle and the camera on it while the shutter is open.
struct Motion<'a> {
    /// At mid-exposure.
    vehicle: VehicleState,
    camera: &'a Camera,
    exposure: Exposure,
    fidelity: &'a Fidelity,
}

impl Motion<'_> {
    /// ICRF to camera at a part of the exposure (0: start, 1: end).
    fn pointing(&self, part: f64) -> Attitude {
        let dt_s = (part - 0.5) * self.exposure.duration_s;
        self.vehicle
            .attitude
            .turned(&self.vehicle.rates, dt_s)
            .then(&self.camera.mounting)
    }

    fn star(&self, star: SeenStar, earth: &Earth, observer: &Observer) -> Option<Source> {
        let behind_earth = earth.occults_direction(observer.position_m, star.direction);
        let hidden = behind_earth.then_some(Hidden::ByEarth);
        let band_mag = star.band_mag;
        self.source(Body::Star(star), |_| star.direction, band_mag, 1.0, hidden)
    }

    fn rso(&self, object: SeenObject) -> Option<Source> {
        let hidden = if object.occulted {
            Some(Hidden::ByEarth)
        } else {
            (object.illumination <= 0.0).then_some(Hidden::InShadow)
        };
        let object = Box::new(object);
        let (mag, light) = (object.mag, object.illumination);
        let lines = object.clone();
        self.source(
            Body::Rso(object),
            move |part| lines.line_m(part),
            mag,
            light,
            hidden,
        )
    }

    /// The source whose apparent vector at a part of the exposure is `line`; none if nothing of it can
    /// touch the detector.
    fn source(
        &self,
        body: Body,
        line: impl Fn(f64) -> Vector3<f64>,
        band_mag: f64,
        light: f64,
        hidden: Option<Hidden>,
    ) -> Option<Source> {
        let optics = &self.camera.optics;
        // Pieces that turn by less than 3 degrees each are nearly straight.
        let swing = line(0.0).angle(&line(0.5)) + line(0.5).angle(&line(1.0));
        let turn = self.vehicle.rates.norm() * self.exposure.duration_s + swing;
        let pieces = (turn / 0.05).ceil().clamp(2.0, 1e4) as usize;
        let track = Track::sample(
            |part| optics.project(&self.pointing(part).rotate(&line(part))),
            pieces,
            optics.psf.sigma_px,
            &Footprint::window(self.camera, self.fidelity),
            self.fidelity,
        )?;
        let footprint = Footprint::new(&track, self.camera, self.fidelity);
        let centroid = track.centroid();
        if footprint.shares().is_empty() && !self.camera.detector.contains(centroid) {
            return None;
        }
        // Clark et al. 2021, Eqs. (2), (11), before the division by the gain:
        // N = E_obj QE tau A_app t_int, with E_obj = E_zero 10^(-0.4 m).
        let per_second = self.camera.electrons_per_second_at_zero();
        let clear = photon_irradiance(per_second, band_mag) * self.exposure.duration_s;
        let electrons = if hidden.is_some() { 0.0 } else { clear * light };
        Some(Source {
            snr: self.snr(&footprint, electrons),
            clear_snr: self.snr(&footprint, clear),
            body,
            start: track.start,
            end: track.end,
            centroid,
            footprint,
            electrons,
            hidden,
        })
    }

    /// `sqrt(sum s^2 / (s + b + read^2))` over the pixels: the best that any weighting of them can reach.
    fn snr(&self, footprint: &Footprint, electrons: f64) -> f64 {
        let detector = &self.camera.detector;
        let read = detector.read_noise_e;
        let floor = background_e(self.camera, &self.exposure) + read * read;
        let sum: f64 = footprint
            .shares()
            .iter()
            .map(|share| f64::from(*share) * electrons)
            .filter(|s| *s > 0.0)
            .map(|s| s * s / (s + floor))
            .sum();
        // An empty sum is -0.
        sum.abs().sqrt()
    }
}
