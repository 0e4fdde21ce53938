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
    /// Its name in plans and labels.
    pub name: &'static str,
    /// Its stage in the chain.
    pub stage: Stage,
    /// Whether it draws random numbers.
    pub random: bool,
    /// How it is assessed.
    pub assess: Assess,
    /// For an area source: the function that finds its light.
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

    /// An effect on randomly drawn electrons.
    const fn charge(id: EffectId, name: &'static str, assess: AssessPixels) -> Effect {
        Effect::of(id, name, Stage::Charge, Assess::Pixels(assess))
    }

    /// An effect that makes or changes digital numbers.
    const fn of_dn(id: EffectId, name: &'static str, assess: AssessPixels) -> Effect {
        Effect::of(id, name, Stage::Dn, Assess::Pixels(assess))
    }

    const fn of(id: EffectId, name: &'static str, stage: Stage, assess: Assess) -> Effect {
        Effect {
            id,
            name,
            stage,
            random: false,
            assess,
            area: None,
        }
    }

    /// Makes it an area source. `radiance` finds its light; `unlit` is the reason if that light
    /// reaches no pixel.
    const fn area_source(
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

    /// Whether it moves images.
    pub fn moves_images(&self) -> bool {
        self.stage == Stage::Images && self.id != EffectId::Vignetting
    }

    /// Whether its random numbers are drawn with the scene. Its error is then the error of this
    /// frame, not an rms.
    pub fn is_drawn_with_scene(&self) -> bool {
        self.id == EffectId::Radiation
    }
}

/// The area sources, in physical order.
pub fn area_kinds() -> impl Iterator<Item = Kind> {
    EFFECTS.iter().filter_map(|effect| effect.area)
}

/// The name of an effect in plans and labels.
pub fn name_of(effect: EffectId) -> &'static str {
    EFFECTS[effect as usize].name
}

/// How an effect is assessed.
pub enum Assess {
    /// It shapes the images of sources. It is assessed before they are formed, given the earlier
    /// effects that shape them. Its change is bounded afterwards.
    Images(AssessImages, BoundChange),
    /// It works on pixels.
    Pixels(AssessPixels),
}

/// The assessment of an effect that shapes images, given the earlier effects that run.
pub(crate) type AssessImages = fn(&View, &EffectSet, &Fidelity) -> Assessment<'static>;

/// The assessment of an effect on pixels, and its pass over them.
pub(crate) type AssessPixels = for<'s> fn(&'s Scene, &Fidelity) -> (Assessment<'s>, Pass<'s>);

/// Bound of the final change without an effect, from the formed images and its assessment.
pub type BoundChange = fn(&Scene, &ErrorBound) -> ErrorBound;

/// The chain's stages, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Shapes the images of sources.
    Images,
    /// Adds or removes expected electrons.
    Light,
    /// Draws electrons from their expectation, moves or clips them.
    Charge,
    /// Turns electrons into digital numbers, or changes digital numbers.
    Dn,
}

/// The assessment of an effect.
pub struct Assessment<'s> {
    /// Why the scene needs it, or why not.
    pub because: Cow<'static, str>,
    /// Bound of the error without it.
    pub error: LazyBound<'s>,
    /// Change of the randomly drawn electrons without it, of one pixel or of the frame, e-. `error`
    /// covers expectations only. The effect runs if either exceeds the tolerance.
    pub drawn_e: f64,
    /// Estimated time, ms on one core.
    pub estimated_ms: f64,
}

/// An error bound: known, or computed on first use. A frame does not compute it if `drawn_e`
/// decides.
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
            LazyBound::Lazy(bound) => bound,
        }
    }
}

/// Bound of the final error without an effect, after all later effects of the chain. Errors of
/// digital numbers are converted to electrons.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ErrorBound {
    /// Greatest change of a pixel, e-: of its expectation without particles, or rms if the effect
    /// is random.
    pub e: f64,
    /// Greatest change of an image's centroid or of an end of its track, px.
    pub px: f64,
}

/// The work of an effect that runs.
pub enum Pass<'s> {
    /// None: it has shaped the images.
    Images,
    /// Processes each pixel, or run of pixels, independently.
    Pixels(Box<dyn Fn(&mut Tile<'_>) + Send + Sync + 's>),
    /// Processes each band of rows independently.
    Tile(Box<dyn Fn(&mut Tile<'_>) + Send + Sync + 's>),
    /// Processes the charge of the whole frame at once.
    Frame(Box<dyn Fn(&mut Charge<'_>) + Send + Sync + 's>),
}

impl Pass<'_> {
    /// Does nothing.
    pub(crate) fn idle() -> Self {
        Pass::Pixels(Box::new(|_| {}))
    }
}

/// The decision about an effect.
pub enum Decision<'s> {
    /// It is switched off.
    Off {
        /// The reason.
        why: &'static str,
    },
    /// It does not run.
    Skip {
        /// The reason.
        why: Cow<'static, str>,
    },
    /// It runs.
    Run {
        /// Its work.
        pass: Pass<'s>,
        /// Why it is needed.
        because: Cow<'static, str>,
        /// Estimated time, ms on one core.
        estimated_ms: f64,
    },
}

impl<'s> Assessment<'s> {
    /// An effect with this error bound and this estimated time, and no further change of drawn
    /// electrons.
    fn new(
        because: impl Into<Cow<'static, str>>,
        error: impl Into<LazyBound<'s>>,
        estimated_ms: f64,
    ) -> Assessment<'s> {
        Assessment {
            because: because.into(),
            error: error.into(),
            drawn_e: 0.0,
            estimated_ms,
        }
    }

    /// An effect that is not needed: nothing changes without it.
    pub fn none(why: impl Into<Cow<'static, str>>) -> Assessment<'s> {
        Assessment::new(why, ErrorBound::default(), 0.0)
    }

    /// An effect that changes a pixel by at most `e` electrons and takes `ns` for each pixel.
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
    pub(crate) fn into_owned<'t>(self) -> Assessment<'t> {
        Assessment {
            drawn_e: self.drawn_e,
            ..Assessment::new(self.because, *self.error, self.estimated_ms)
        }
    }

    /// Whether the error without it is within the tolerances.
    pub(crate) fn is_within(&self, fidelity: &Fidelity) -> bool {
        // `error` may still have to be computed: it is checked last.
        self.drawn_e <= fidelity.skip_e && self.error.is_within(fidelity)
    }

    /// Whether nothing changes without it.
    pub(crate) fn is_none(&self) -> bool {
        self.drawn_e == 0.0 && *self.error == ErrorBound::default()
    }
}

impl ErrorBound {
    /// The bound for a pixel (e-); no image moves.
    fn of_pixel(e: f64) -> ErrorBound {
        ErrorBound { e, px: 0.0 }
    }

    /// Whether it is within the tolerances.
    pub(crate) fn is_within(&self, fidelity: &Fidelity) -> bool {
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
