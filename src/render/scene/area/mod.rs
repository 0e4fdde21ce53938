//! Area sources: light that comes from all over the field, as a radiance of each direction, laid on the pixels.

mod background;
mod blur;
mod change;
mod earth;
mod full;
mod horizon;
mod kinds;
mod known;
mod lay;
mod light;
mod limb;
mod lines;
mod near;
mod patch;
mod plane;
mod runs;
mod sampled;
mod together;
mod veil;

pub use full::Full;
pub use kinds::{KINDS, Kind};
pub use light::Light;
pub use together::Together;

use crate::fidelity::Fidelity;
use crate::scene::{EffectId, EffectSet, View, World, flooding_e};
use crate::sky::atmosphere::Limb;
use crate::sky::shadow::Earth;
pub use blur::{BLURRED_NS, SPREAD_NS};
pub use sampled::EDGE_NS;

pub(super) use lay::{AREA_LOOK_NS, panels};
pub(super) use sampled::{STEPS_PX, most_steps};

use super::CELL;
use blur::Blur;
use horizon::Horizon;
use kinds::Found;
use nalgebra::Vector3;
use plane::Plane;
use skyloop_orbit::sgp4_batch::Level;
use std::borrow::Cow;
use std::cell::OnceCell;
use std::fmt::Debug;
use std::ops::AddAssign;
use std::sync::Arc;

/// Places along a side of the field at which a radiance is looked at before it is laid on pixels.
const PLACES: usize = 4;

/// Why an observer without an orbit sees no Earth.
const NO_ORBIT: &str =
    "the observer has no orbit (observer.orbit), and sees no Earth from its centre";

/// Why a body is not in the field whose limb is at least so many rad from it.
fn not_in_field(body: &str, nearest: f64) -> Cow<'static, str> {
    format!("{body} is {:.1} deg from the field", nearest.to_degrees()).into()
}

/// Light that depends on its direction alone.
pub trait Radiance: Debug + Send + Sync {
    /// Photons in the band from a direction (unit vector, ICRF) at mid-exposure, ph/s/m^2/sr; of what optics scatter ([`Radiance::is_of_pixels`]),
    /// e-/s on a pixel that looks there. Where it [is hidden](Radiance::is_hidden_inside), as if it were not.
    fn toward(&self, direction: &Vector3<f64>) -> f64;

    /// Whether nothing shines inside of its edge, and all else is so even that a pixel has the light of its middle.
    fn is_hidden_inside(&self) -> bool {
        false
    }

    /// The light that comes from a direction, if it is not hidden.
    fn seen(&self, direction: &Vector3<f64>) -> f64 {
        let edge = self.edge().filter(|_| self.is_hidden_inside());
        if edge.is_some_and(|edge| edge.angle(direction) < 0.0) {
            0.0
        } else {
            self.toward(direction)
        }
    }

    /// The edge in the field at which it jumps, if there may be one.
    fn edge(&self) -> Option<&dyn Edge> {
        None
    }

    /// Angular velocity (rad/s) of its pattern against ICRF.
    fn turning(&self) -> Vector3<f64> {
        Vector3::zeros()
    }

    /// Its smallest detail (rad), but for edges: what places so far apart do not tell of, it has not.
    fn detail(&self) -> f64 {
        0.0
    }

    /// Whether pixels get it whatever their solid angle and what the optics let pass.
    fn is_of_pixels(&self) -> bool {
        false
    }
}

/// Where light jumps.
pub trait Edge {
    /// The angle (rad) of a direction from it: positive outside, negative inside.
    fn angle(&self, direction: &Vector3<f64>) -> f64;

    /// Its radius (rad), of the circle that it nearly is.
    fn radius(&self) -> f64;
}

/// An area source before the camera, before its light is laid on pixels.
#[derive(Debug, Clone)]
pub struct Area {
    /// What it is.
    pub kind: &'static Kind,
    /// Its light, or why there is none.
    pub radiance: Found,
    /// Twice its light in that pixel that gets most of it, of some all over the field, e-.
    pub peak_e: f64,
}

impl Area {
    /// Whether there may be an edge of it in the field.
    pub fn has_edges(&self) -> bool {
        matches!(&self.radiance, Ok(radiance) if radiance.edge().is_some())
    }

    /// How many places are looked at on a way of so many px, beside its middle.
    pub fn looks_on(&self, way_px: f64) -> usize {
        let panels = self.radiance.as_ref().map(|of| panels(of.as_ref(), way_px));
        2 * panels.unwrap_or(0)
    }

    /// Its smallest detail, rad; without light none is smaller than infinitely large.
    pub fn detail(&self) -> f64 {
        let radiance = self.radiance.as_ref();
        radiance.map_or(f64::INFINITY, |radiance| radiance.detail())
    }

    /// How fast (rad/s) it moves by itself, whether it has an edge in the field or only grows fainter across it.
    pub fn swing(&self) -> f64 {
        let radiance = self.radiance.as_ref();
        radiance.map_or(0.0, |radiance| radiance.turning().norm())
    }
}

/// The light of an area source on the pixels.
#[derive(Debug)]
pub struct AreaLight {
    /// What it is.
    pub kind: &'static Kind,
    /// Why there is none.
    pub dark: Option<Cow<'static, str>>,
    /// On the pixels; none where it is too faint for any.
    light: Option<Light>,
    /// No pixel of a column of cells (`brightest`) gets less than this, nor more, e-.
    ends: Vec<[f32; 2]>,
    /// Electrons on all pixels.
    pub electrons: f64,
    /// The most in a pixel, e-.
    pub most_e: f64,
    /// Whether all of it is lost in noise.
    pub is_thin: bool,
    /// What was asked to lay it.
    pub asked: Asked,
}

impl AreaLight {
    /// On the pixels; none where it is too faint for any.
    pub fn light(&self) -> Option<&Light> {
        self.light.as_ref()
    }

    /// On each pixel, row by row, e-; empty where it is too faint for any.
    pub fn e(&self) -> &[f32] {
        self.light().map(Light::e).unwrap_or_default()
    }

    /// How many pixels straight lines do not fill.
    pub fn uneven(&self) -> usize {
        self.light().map_or(0, Light::uneven)
    }

    /// Adds its light on the pixels from `first` on, by row-major index, to `electrons`.
    pub fn add_to(&self, level: Option<Level>, first: usize, electrons: &mut [f32]) {
        if let Some(light) = &self.light {
            light.add_to(level, first, electrons);
        }
    }

    /// No pixel gets more than this, e-, for each column of cells (`brightest`).
    pub(super) fn most_of_columns(&self) -> Vec<f64> {
        self.ends.iter().map(|[_, most]| f64::from(*most)).collect()
    }

    /// No pixel of a column of cells gets less than this, e-; nothing where it is too faint for any.
    pub(super) fn floor_e(&self) -> impl Iterator<Item = f32> {
        self.ends.iter().map(|[least, _]| *least)
    }
}

/// How often was asked what it takes to lay light on pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Asked {
    /// For the radiance of a direction, once a place.
    pub lights: usize,
    /// The same again, for the way of what moves.
    pub smeared: usize,
    /// For its angle from an edge.
    pub edges: usize,
    /// For the light that a pixel gives to another.
    pub spreads: usize,
}

impl AddAssign for Asked {
    fn add_assign(&mut self, other: Asked) {
        self.lights += other.lights;
        self.smeared += other.smeared;
        self.edges += other.edges;
        self.spreads += other.spreads;
    }
}

/// Above this (m) the air's light is left out where the field sees nothing lower: of the highest layer, at 250 km, a thousandth is up there.
const AIR_M: f64 = 400e3;

/// The Earth and its air around the observer.
#[derive(Debug)]
pub struct Surroundings {
    /// The Earth; none for an observer without an orbit.
    horizon: Option<Horizon>,
    limb: OnceCell<Option<Arc<Limb>>>,
}

impl Surroundings {
    fn of(view: &View) -> Surroundings {
        Surroundings {
            horizon: Horizon::of(view),
            limb: OnceCell::new(),
        }
    }

    /// Its air, where some of it may be in the field: worked out for the first that asks.
    fn limb(&self, world: &World, view: &View) -> Option<Arc<Limb>> {
        let near = |horizon: &&Horizon| horizon.nearest() < horizon.height_of(AIR_M);
        let find = || {
            self.horizon.as_ref().filter(near)?;
            let sun_m = view.observer.bodies.sun_apparent_m();
            let earth = Earth::at(view.exposure.mid);
            Limb::new(&world.atmosphere, view.observer.position_m, sun_m, earth).map(Arc::new)
        };
        self.limb.get_or_init(find).clone()
    }
}

impl View {
    /// What is before the camera, of those whose effect `runs`.
    pub(super) fn areas(&self, world: &World, runs: &EffectSet) -> Vec<Area> {
        let ideal = Plane::new(self, &EffectSet::default(), Vector3::zeros());
        let around = Surroundings::of(self);
        let kinds = KINDS.iter().filter(|kind| runs.has(kind.effect));
        let kinds = kinds.map(|kind| {
            let radiance = (kind.radiance)(world, self, &around);
            let peak_e = match &radiance {
                Ok(radiance) => 2.0 * self.looked_at(radiance.as_ref(), &ideal),
                Err(_) => 0.0,
            };
            Area {
                kind,
                radiance,
                peak_e,
            }
        });
        kinds.collect()
    }

    /// The most light (e-) of a pixel, of some all over the field.
    fn looked_at(&self, radiance: &dyn Radiance, plane: &Plane<'_>) -> f64 {
        let [columns, rows] = self.camera.detector.sides();
        let (scale_e, sky) = (self.area_scale_e(radiance), plane.to_sky(0.0));
        let part = |i: usize| i as f64 / (PLACES - 1) as f64;
        let places = (0..PLACES * PLACES).map(|i| {
            let at = [
                part(i % PLACES) * (columns - 1.0),
                part(i / PLACES) * (rows - 1.0),
            ];
            plane.taken(at).map_or(0.0, |(seen, taken)| {
                lay::light(radiance, &(sky * seen), taken) * scale_e
            })
        });
        places.fold(0.0, f64::max)
    }

    /// Clark et al. 2021, Eq. (5), before the division by the gain: `N = E QE tau A_app t_int`, of a radiance of 1.
    fn area_scale_e(&self, radiance: &dyn Radiance) -> f64 {
        let (camera, seconds) = (&self.camera, self.exposure.duration_s);
        if radiance.is_of_pixels() {
            return seconds;
        }
        let optics = &camera.optics;
        camera.detector.quantum_efficiency
            * optics.transmission
            * optics.aperture_area_m2()
            * seconds
    }

    /// Whether so much light (e-) on every pixel, or less, is within the tolerance, and all of it together is lost in noise. No weighting of the
    /// pixels has a greater signal-to-noise ratio than
    ///
    /// ```text
    /// snr^2 = sum e^2 / (e + read^2 + gain^2 / 12)
    /// ```
    fn is_too_thin(&self, e: f64, simulated: &EffectSet, fidelity: &Fidelity) -> bool {
        let detector = &self.camera.detector;
        let read_e = simulated.only_with(EffectId::ReadNoise, detector.read_noise_e);
        let noise = e + read_e * read_e + detector.quantisation_variance();
        let snr = (detector.pixels() as f64 * e * e / noise.max(f64::MIN_POSITIVE)).sqrt();
        e <= fidelity.skip_e && snr <= fidelity.skip_snr
    }

    /// Whether dark current alone, or area light alone, fills every pixel of a frame with those effects.
    pub fn is_flooded(&self, simulated: &EffectSet, fidelity: &Fidelity) -> bool {
        let detector = &self.camera.detector;
        let dark_e = detector.pattern.dark_min_e_s() * self.exposure.duration_s;
        let is_dark = simulated.has(EffectId::FullWell)
            && simulated.has(EffectId::DarkCurrent)
            && dark_e >= flooding_e(detector);
        is_dark || Full::is_all(self, simulated, fidelity)
    }

    /// The light of an area source on the pixels of a frame with those effects, of which area light fills some.
    pub fn lit_by(
        &self,
        area: &Area,
        simulated: &EffectSet,
        full: &Full,
        fidelity: &Fidelity,
    ) -> AreaLight {
        let none = |dark: Option<Cow<'static, str>>| AreaLight {
            kind: area.kind,
            dark,
            light: None,
            ends: Vec::new(),
            electrons: 0.0,
            most_e: area.peak_e,
            is_thin: true,
            asked: Asked::default(),
        };
        let radiance = match &area.radiance {
            Ok(radiance) => radiance.as_ref(),
            Err(why) => return none(Some(why.clone())),
        };
        if radiance.edge().is_none() && self.is_too_thin(area.peak_e, simulated, fidelity) {
            return none(None);
        }
        let plane = Plane::new(self, simulated, radiance.turning());
        let blur = Blur::new(
            &self.camera,
            area.peak_e,
            radiance.edge().is_some(),
            fidelity,
        );
        let (light, asked) = lay::lay(
            radiance,
            &plane,
            &blur,
            self.area_scale_e(radiance),
            full,
            fidelity,
        );
        let electrons = light.sum();
        if electrons == 0.0 {
            return none(Some(area.kind.unlit.into()));
        }
        let ends = light.ends_of(CELL);
        let most = ends.iter().map(|[_, most]| *most);
        let most_e = f64::from(most.fold(0.0, f32::max));
        AreaLight {
            kind: area.kind,
            dark: None,
            light: Some(light),
            ends,
            electrons,
            most_e,
            is_thin: self.is_too_thin(most_e, simulated, fidelity),
            asked,
        }
    }
}
