//! The effects, from light to digital numbers. A new one is a file here, a row in [`EFFECTS`] and
//! an [`EffectId`].

mod area;
mod background;
mod cause;
mod dark;
mod dead;
mod distortion;
mod drift;
mod earth;
mod frame_transfer;
mod full_well;
mod limb;
mod moon;
mod nonlinearity;
mod planets;
mod point;
mod radiation;
mod read;
mod readout;
mod response;
mod rolling;
mod shot;
mod smear;
mod starlight;
mod stuck;
mod veil;
mod vignetting;
mod zodiacal;

pub use cause::{counted, three_digits};

use crate::fidelity::Fidelity;
use crate::frame::{Charge, Tile};
use crate::scene::{EffectId, EffectSet, Found, Kind, Scene, Surroundings, View, World};
use std::borrow::Cow;
use std::ops::Deref;
use std::sync::LazyLock;

/// Every effect, in physical order.
pub const EFFECTS: &[Effect] = &[
    distortion::DISTORTION,
    drift::ABERRATION_DRIFT,
    smear::SMEAR,
    rolling::ROLLING_SHUTTER,
    vignetting::VIGNETTING,
    point::STARS,
    point::RSOS,
    zodiacal::ZODIACAL_LIGHT,
    starlight::STARLIGHT,
    planets::PLANETS,
    moon::THE_MOON,
    earth::EARTH,
    limb::LIMB,
    veil::SUNLIGHT,
    veil::MOONGLOW,
    veil::EARTHSHINE,
    response::PIXEL_RESPONSE,
    frame_transfer::FRAME_TRANSFER,
    dark::DARK_CURRENT,
    shot::SHOT_NOISE,
    radiation::RADIATION,
    full_well::FULL_WELL,
    dead::DEAD_PIXELS,
    nonlinearity::NON_LINEARITY,
    read::READ_NOISE,
    readout::READOUT,
    stuck::STUCK_PIXELS,
];

/// An effect between the sky and the digital numbers.
pub struct Effect {
    /// Its row in [`EFFECTS`].
    pub id: EffectId,
    /// Name, as plans and labels give it.
    pub name: &'static str,
    /// Its stage in the chain.
    pub stage: Stage,
    /// Whether it draws random numbers.
    pub random: bool,
    /// How it is assessed.
    pub assess: Assess,
    /// How to find its light before the camera, of an area source.
    pub area: Option<Kind>,
}

impl Effect {
    /// An effect that shapes images.
    const fn images(
        id: EffectId,
        name: &'static str,
        assess: AssessImages,
        change: BoundChange,
    ) -> Effect {
        Effect::of(id, name, Stage::Images, Assess::Images(assess, change))
    }

    /// An effect that adds or removes expected electrons.
    const fn light(id: EffectId, name: &'static str, assess: AssessPixels) -> Effect {
        Effect::of(id, name, Stage::Light, Assess::Pixels(assess))
    }

    /// An effect on drawn electrons.
    const fn charge(id: EffectId, name: &'static str, assess: AssessPixels) -> Effect {
        Effect::of(id, name, Stage::Charge, Assess::Pixels(assess))
    }

    /// An effect that makes or changes digital numbers.
    const fn of_dn(id: EffectId, name: &'static str, assess: AssessPixels) -> Effect {
        Effect::of(id, name, Stage::Dn, Assess::Pixels(assess))
    }

    const fn of(id: EffectId, name: &'static str, stage: Stage, judge: Assess) -> Effect {
        Effect {
            id,
            name,
            stage,
            random: false,
            assess: judge,
            area: None,
        }
    }

    /// An area source, with the function that finds its light, and why no pixel is lit if none is
    /// though light was found.
    const fn found_by(
        mut self,
        radiance: fn(&World, &View, &Surroundings) -> Found,
        unlit: &'static str,
    ) -> Effect {
        self.area = Some(Kind {
            effect: self.id,
            radiance,
            unlit,
        });
        self
    }

    /// The same, with random numbers.
    const fn random(mut self) -> Effect {
        self.random = true;
        self
    }

    /// Whether it moves images; its effect on pixels follows from that.
    pub fn moves_images(&self) -> bool {
        self.stage == Stage::Images && self.id != EffectId::Vignetting
    }

    /// Whether its random numbers are drawn with the scene. Its error is then that of this frame,
    /// not an rms.
    pub fn is_foreseen(&self) -> bool {
        self.id == EffectId::Radiation
    }
}

/// The area sources, in physical order.
pub fn area_kinds() -> impl Iterator<Item = Kind> {
    EFFECTS.iter().filter_map(|effect| effect.area)
}

/// The name of an effect, as plans and labels give it.
pub fn name_of(effect: EffectId) -> &'static str {
    EFFECTS[effect as usize].name
}

/// How an effect is assessed.
pub enum Assess {
    /// It shapes the images of sources. Assessed before they are formed, with the effects that
    /// shape them already; its change is bounded when they are.
    Images(AssessImages, BoundChange),
    /// It works on pixels.
    Pixels(AssessPixels),
}

/// The assessment of an effect that shapes images, given those that shape them already.
pub type AssessImages = fn(&View, &EffectSet, &Fidelity) -> Assessment<'static>;

/// The assessment of an effect on pixels, and its pass over them.
pub type AssessPixels = for<'s> fn(&'s Scene, &Fidelity) -> (Assessment<'s>, Pass<'s>);

/// A bound of the final change without an effect, from the formed images and its earlier
/// assessment.
pub type BoundChange = fn(&Scene, &ErrorBound) -> ErrorBound;

/// The chain's stages, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Shapes the images of sources.
    Images,
    /// Adds or removes expected electrons.
    Light,
    /// Turns expected electrons into drawn ones, moves or clips them.
    Charge,
    /// Turns electrons into digital numbers, or changes those.
    Dn,
}

/// The assessment of an effect.
pub struct Assessment<'s> {
    /// What in the scene needs it, or why nothing does.
    pub because: Cow<'static, str>,
    /// Bound of the error without it.
    pub error: LazyBound<'s>,
    /// Change without it in the drawn electrons of one pixel, or of all together, beyond the
    /// expectation of a pixel in `error`, e-. It runs if either exceeds the tolerance.
    pub drawn_e: f64,
    /// Estimated time, ms on one core.
    pub estimated_ms: f64,
}

/// An error bound: known, or computed on first use. Not computed in a frame if `drawn_e` decides.
pub enum LazyBound<'s> {
    /// Known.
    Known(ErrorBound),
    /// Computed on first use.
    Lazy(LazyLock<ErrorBound, Box<dyn FnOnce() -> ErrorBound + Send + 's>>),
}

impl<'s> LazyBound<'s> {
    /// The bound for a pixel (e-) that `e` computes.
    fn of(e: impl FnOnce() -> f64 + Send + 's) -> LazyBound<'s> {
        LazyBound::Lazy(LazyLock::new(Box::new(|| ErrorBound::of_pixel(e()))))
    }
}

impl From<ErrorBound> for LazyBound<'_> {
    fn from(bound: ErrorBound) -> Self {
        LazyBound::Known(bound)
    }
}

impl Deref for LazyBound<'_> {
    type Target = ErrorBound;

    fn deref(&self) -> &ErrorBound {
        match self {
            LazyBound::Known(bound) => bound,
            LazyBound::Lazy(loss) => loss,
        }
    }
}

/// Bound of the final error without an effect, after all later effects in the chain, such as full
/// wells. For effects on digital numbers, in electrons of those.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ErrorBound {
    /// Greatest change of a pixel, e-: of its expectation without particles, or rms if the effect
    /// is random.
    pub e: f64,
    /// Greatest change of an image's centroid or of an end of its track, px.
    pub px: f64,
}

/// What an effect does where it runs.
pub enum Pass<'s> {
    /// Nothing: it has shaped the images.
    Images,
    /// Works on each pixel, or run of pixels, by itself.
    Pixels(Box<dyn Fn(&mut Tile<'_>) + Send + Sync + 's>),
    /// Works on each band of rows by itself.
    Tile(Box<dyn Fn(&mut Tile<'_>) + Send + Sync + 's>),
    /// Works on the whole frame's charge at once.
    Frame(Box<dyn Fn(&mut Charge<'_>) + Send + Sync + 's>),
}

impl Pass<'_> {
    /// Does nothing.
    pub fn idle() -> Self {
        Pass::Pixels(Box::new(|_| {}))
    }
}

/// The decision about an effect.
pub enum Decision<'s> {
    /// It is switched off.
    Off {
        /// Why not.
        why: &'static str,
    },
    /// It does not run.
    Skip {
        /// Why not.
        why: Cow<'static, str>,
    },
    /// It runs.
    Run {
        /// What it does.
        pass: Pass<'s>,
        /// Why it is needed.
        because: Cow<'static, str>,
        /// What it is expected to take, ms on one core.
        estimated_ms: f64,
    },
}

impl<'s> Assessment<'s> {
    /// An error bound without it, no further change of drawn electrons, and its estimated time.
    fn new(
        because: impl Into<Cow<'static, str>>,
        error: impl Into<LazyBound<'s>>,
        price_ms: f64,
    ) -> Assessment<'s> {
        Assessment {
            because: because.into(),
            error: error.into(),
            drawn_e: 0.0,
            estimated_ms: price_ms,
        }
    }

    /// The effect is not needed: nothing changes without it.
    pub fn none(why: impl Into<Cow<'static, str>>) -> Assessment<'s> {
        Assessment::new(why, ErrorBound::default(), 0.0)
    }

    /// It changes a pixel by at most `e` electrons, and takes `ns` a pixel.
    fn of_pixels(
        scene: &Scene,
        because: impl Into<Cow<'static, str>>,
        e: f64,
        ns: f64,
    ) -> Assessment<'s> {
        let pixels = scene.view.camera.detector.pixels() as f64;
        Assessment::new(because, ErrorBound::of_pixel(e), pixels * ns * 1e-6)
    }

    /// The same without a borrow of the scene.
    pub fn into_owned<'t>(self) -> Assessment<'t> {
        Assessment {
            drawn_e: self.drawn_e,
            ..Assessment::new(self.because, *self.error, self.estimated_ms)
        }
    }

    /// Whether the error without it is within the tolerances.
    pub fn is_within(&self, fidelity: &Fidelity) -> bool {
        // The error last: it may not be computed yet.
        self.drawn_e <= fidelity.skip_e && self.error.is_within(fidelity)
    }

    /// Whether nothing changes without it.
    pub fn is_none(&self) -> bool {
        self.drawn_e == 0.0 && *self.error == ErrorBound::default()
    }
}

impl ErrorBound {
    /// The bound for a pixel (e-); no image moves.
    fn of_pixel(e: f64) -> ErrorBound {
        ErrorBound { e, px: 0.0 }
    }

    /// Whether it is within the tolerances.
    pub fn is_within(&self, fidelity: &Fidelity) -> bool {
        self.px <= fidelity.skip_px && self.e <= fidelity.skip_e
    }
}

impl std::fmt::Display for ErrorBound {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            ErrorBound { e, px: 0.0 } => write!(f, "{e:.3e} e-"),
            ErrorBound { e: 0.0, px } => write!(f, "{px:.3e} px"),
            ErrorBound { e, px } => write!(f, "{px:.3e} px, {e:.3e} e-"),
        }
    }
}
