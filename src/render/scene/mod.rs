//! The scene: everything that one exposure sees, worked out once and only read afterwards.
//!
//! First the [`View`], what stands before the camera; then, with the effects that the frame has ([`EffectSet`]), the
//! image of every source on the detector.

mod area;
mod brightest;
mod change;
mod collected;
mod compared;
mod disc;
mod effect_set;
mod expected;
mod flood;
mod imaging;
mod lit;
mod observable;
mod signal;
mod spill;
mod stages;
mod struck;
mod sun;
mod trail;
mod view;
mod wanderer;
mod work;

use wanderer::Element;

pub use area::{Area, AreaLight, Asked, BLURRED_NS, EDGE_NS, Edge, Full, KINDS, Kind, Light};
pub use area::{Radiance, SPREAD_NS, Together};
pub use brightest::CELL;
pub use change::{Change, Image, STEEPEST, STEEPEST_STREAK};
pub use compared::{Compared, Peak};
pub use effect_set::{EffectId, EffectSet};
pub use lit::Lit;
pub(crate) use observable::two_figures;
pub use observable::{MAX_TURN, Unobservable, above_the_moon, shutter, turn_at};
pub use spill::{Spill, drawn_e, flooding_e};
pub use struck::Struck;
pub use sun::SeenSun;
pub use view::{Candidate, Faint, OBJECT_NS, Unknown, View};
pub use wanderer::{MOON, SeenWanderer};
pub use work::{Work, still_ms};

use crate::attitude::angle_between;
use crate::camera::Event;
use crate::fidelity::Fidelity;
use crate::footprint::Footprint;
use crate::lanes;
use crate::sky::atmosphere::Atmosphere;
use crate::sky::population::SeenObject;
use crate::sky::star_field::SeenStar;
use crate::sky::starlight::StarLight;
use crate::sky::{Corrections, Population, StarField};
use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop_orbit::time::seconds;
use std::sync::Arc;

/// What does not change from frame to frame.
#[derive(Debug)]
pub struct World {
    /// The stars.
    pub stars: StarField,
    /// The light of fainter ones.
    pub starlight: Arc<StarLight>,
    /// The Earth's air in the camera's band.
    pub atmosphere: Arc<Atmosphere>,
    /// The objects in orbit.
    pub population: Arc<Population>,
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
    /// The exposure of `duration_s` around `mid`, its ends to the nearest nanosecond; of what is no number they are the middle.
    pub fn around(mid: Epoch, duration_s: f64) -> Exposure {
        let half = seconds(duration_s / 2.0);
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
    Rso(Arc<SeenObject>),
    /// The Moon or a planet.
    Wanderer(Box<SeenWanderer>),
}

impl Body {
    /// The effect that its kind is.
    pub fn effect(&self) -> EffectId {
        match self {
            Body::Star(_) => EffectId::Stars,
            Body::Rso(_) => EffectId::Rsos,
            Body::Wanderer(body) if body.is_moon() => EffectId::Moon,
            Body::Wanderer(_) => EffectId::Planets,
        }
    }

    /// Mean wavelength of its light over the band's reference: all but stars shine by the Sun's.
    pub fn wavelength_ratio(&self) -> f64 {
        match self {
            Body::Star(star) => star.wavelength_ratio,
            Body::Rso(_) | Body::Wanderer(_) => 1.0,
        }
    }

    /// Its apparent vector (ICRF axes, any length) at a part of the view's time (0: its start, 1: its end); of stars
    /// that at mid-exposure.
    pub fn line(&self, part: f64) -> Vector3<f64> {
        match self {
            Body::Star(star) => star.direction,
            Body::Rso(object) => object.line_m(part),
            Body::Wanderer(body) => body.direction(part),
        }
    }

    /// The angle (rad) that it moves through by itself in that time.
    fn swing(&self) -> f64 {
        match self {
            Body::Star(_) => 0.0,
            Body::Rso(_) | Body::Wanderer(_) => {
                let line = |part: f64| self.line(part);
                let [start, mid, end] = [0.0, 0.5, 1.0].map(line);
                angle_between(&start, &mid) + angle_between(&mid, &end)
            }
        }
    }

    /// What tells it from all others.
    pub fn identity(&self) -> (&'static str, usize) {
        match self {
            Body::Star(star) => ("star", star.index),
            Body::Rso(object) => ("rso", object.index),
            Body::Wanderer(body) => (body.name, 0),
        }
    }

    /// What its disc is cut into; nothing of what is a point.
    fn elements(&self) -> &[Element] {
        match self {
            Body::Wanderer(body) => &body.elements,
            Body::Star(_) | Body::Rso(_) => &[],
        }
    }

    /// Its light by direction, where it is too large for elements.
    fn area(&self) -> Option<&Area> {
        match self {
            Body::Wanderer(body) => body.area.as_ref(),
            Body::Star(_) | Body::Rso(_) => None,
        }
    }

    /// How many points its image is made of, or would be in the same time.
    pub fn points(&self) -> usize {
        match self {
            Body::Wanderer(body) => body.points,
            Body::Star(_) | Body::Rso(_) => 1,
        }
    }
}

/// Why no light of a source arrives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hidden {
    /// The Earth stands before it.
    ByEarth,
    /// The Moon stands before it.
    ByMoon,
    /// It is in the Earth's umbra.
    InShadow,
}

/// A point source in the field.
#[derive(Debug, Clone)]
pub struct Source {
    /// What it is.
    pub body: Body,
    /// Its image when its row opens (or where it comes before the camera), px.
    pub start: [f64; 2],
    /// Its image when its row closes (or where it goes behind the camera), px.
    pub end: [f64; 2],
    /// Flux-weighted centre of all its light, px.
    pub centroid: [f64; 2],
    /// Its share on each pixel.
    pub footprint: Footprint,
    /// Electrons that all the light which arrives at the aperture in the exposure would give.
    pub arriving_e: f64,
    /// Expected electrons of the whole exposure, on and off the detector: of the light that optics and shutter let pass.
    pub electrons: f64,
    /// The same, were it neither hidden nor shaded.
    pub clear_e: f64,
    /// Why there are none.
    pub hidden: Option<Hidden>,
    /// Signal-to-noise ratio on the detector.
    pub snr: f64,
    /// The same, were it neither hidden nor shaded: what decides whether labels list it.
    pub clear_snr: f64,
}

impl Source {
    /// The way (px) of its image from where it starts through its centre to where it ends.
    pub fn length_px(&self) -> f64 {
        let way = |a: [f64; 2], b: [f64; 2]| libm::hypot(a[0] - b[0], a[1] - b[1]);
        way(self.start, self.centroid) + way(self.centroid, self.end)
    }
}

/// Everything that one exposure sees.
#[derive(Debug)]
pub struct Scene {
    /// What stands before the camera.
    pub view: View,
    /// Which effects the frame has.
    pub simulated: EffectSet,
    /// The images that touch the detector, in the view's order.
    pub sources: Vec<Source>,
    /// The light of area sources, in the order of their effects.
    pub areas: Vec<AreaLight>,
    /// Their light together.
    areas_light: Together,
    /// No pixel turns more light than this into charge, for each column of cells (`brightest`), e-.
    peaks_e: Vec<f64>,
    /// The same of stars alone.
    stars_e: Vec<f64>,
    /// What frame transfer adds to each pixel of a column, e-, a value a column; empty where charge is not shifted
    /// through light.
    pub trail_e: Vec<f64>,
    /// The particles that cross the detector.
    pub events: Vec<Event>,
    /// The charge that they leave together.
    pub struck: Struck,
    /// How many more would cross it on average: no more are drawn than a frame has time for.
    pub particles_left_out: f64,
    /// What fills up and spills.
    pub spill: Spill,
    /// The light on columns that may fill up, e-.
    spilling_e: Vec<Vec<f64>>,
    /// What its images were made to.
    fidelity: Fidelity,
}

impl Scene {
    /// Whether every pixel that a source lights is full: such have no signal-to-noise ratio.
    pub fn fills_all(&self, source: &Source) -> bool {
        let full_e = signal::full_e(&self.view.camera.detector, &self.simulated);
        // A disc may find its pixels full of other light.
        let fills = || {
            let most = lanes::greatest(source.footprint.shares());
            source.body.points() > 1 || source.electrons * f64::from(most) >= full_e
        };
        source.electrons > 0.0 && source.clear_snr == 0.0 && fills()
    }

    /// Expected background of a pixel, on which no star and no object shines, averaged over the frame, e-.
    pub fn background_e(&self) -> f64 {
        let areas: f64 = self.areas.iter().map(|area| area.electrons).sum();
        self.dark_e() + self.mean_trail_e() + areas / self.view.camera.detector.pixels() as f64
    }

    /// What frame transfer adds to a pixel, averaged over the columns, e-.
    fn mean_trail_e(&self) -> f64 {
        self.trail().iter().sum::<f64>() / self.trail().len().max(1) as f64
    }

    /// The tolerances that it was made to.
    pub fn fidelity(&self) -> &Fidelity {
        &self.fidelity
    }

    /// Expected dark charge of a pixel, as far as it is simulated, e-.
    pub fn dark_e(&self) -> f64 {
        background_e(&self.view, &self.simulated)
    }

    /// The columns' trails, as far as they are simulated.
    fn trail(&self) -> &[f64] {
        (self.simulated).only_with(EffectId::FrameTransfer, &self.trail_e[..])
    }
}

/// The dark charge, e-.
fn background_e(view: &View, simulated: &EffectSet) -> f64 {
    if !simulated.has(EffectId::DarkCurrent) {
        return 0.0;
    }
    view.camera.detector.dark_e(view.exposure.duration_s)
}
