//! The error tolerances of the renderer, their presets, and the table that describes them.

use super::orbits::Orbits;
use super::value::Allowed::{self, Numbers, Words};
use super::value::{Setting, Value};
use skyloop_base::range::nearest;
use std::f64::consts::TAU;

/// Description of one tolerance.
#[derive(Debug)]
pub struct Tolerance {
    /// Its key.
    pub name: &'static str,
    /// The unit of its value.
    pub unit: &'static str,
    /// Description of the bounded error.
    pub bounds: &'static str,
    /// The greatest error for a value, in that unit or as stated in `bounds`.
    pub bound: fn(f64) -> f64,
    /// Its permitted values.
    pub allowed: Allowed,
    /// Whether it changes frames visibly.
    pub changes_frames: bool,
    /// Reads its value.
    pub get: fn(&Fidelity) -> Value,
    /// Sets its value; a value of another kind is ignored.
    pub set: fn(&mut Fidelity, Value),
}

impl Tolerance {
    /// The tolerance called `name`.
    pub fn named(name: &str) -> Option<&'static Tolerance> {
        TOLERANCES.iter().find(|tolerance| tolerance.name == name)
    }

    /// Whether `one` renders coarser or faster than `other`: a greater tolerance, or a method
    /// listed earlier.
    pub(crate) fn is_coarser(&self, one: Value, other: Value) -> bool {
        match (one, other, self.allowed) {
            (Value::Number(one), Value::Number(other), _) => one > other,
            (Value::Word(one), Value::Word(other), Allowed::Words(words)) => {
                let index = |word| words.iter().position(|other| *other == word);
                index(one) < index(other)
            }
            _ => false,
        }
    }

    /// Whether two settings have the same value of it.
    pub fn is_same(&self, a: &Fidelity, b: &Fidelity) -> bool {
        (self.get)(a) == (self.get)(b)
    }
}

/// Turns each row into a field of [`Fidelity`], its value in each preset, and its [`Tolerance`].
macro_rules! tolerances {
    ($($(#[$doc:meta])* $name:ident: $type:ty, $unit:literal, $allowed:expr,
       [$fast:expr, $realtime:expr, $reference:expr], $seen:literal, $bound:expr, $bounds:literal;)*) => {
        /// Error tolerances of the renderer. Each bounds one error.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Fidelity {
            $($(#[$doc])* pub $name: $type,)*
        }

        impl Fidelity {
            /// For frames with a deadline: errors below a detector's noise.
            pub const FAST: Fidelity = Fidelity { $($name: $fast,)* };
            /// For live frames: errors far below the noise of any frame.
            pub const REALTIME: Fidelity = Fidelity { $($name: $realtime,)* };
            /// The slow, direct method that the tests use as truth.
            pub const REFERENCE: Fidelity = Fidelity { $($name: $reference,)* };
        }

        /// All tolerances.
        pub const TOLERANCES: &[Tolerance] = &[$(Tolerance {
            name: stringify!($name),
            unit: $unit,
            bounds: $bounds,
            bound: $bound,
            allowed: $allowed,
            changes_frames: $seen,
            get: |fidelity| fidelity.$name.value(),
            set: |fidelity, value| {
                if let Some(value) = Setting::of(value) {
                    fidelity.$name = value;
                }
            },
        },)*];
    };
}

/// For a tolerance that is itself the error bound.
fn itself(value: f64) -> f64 {
    value
}

/// Greatest relative error of a streak's profile with panels of `step` sigmas.
fn profile(step: f64) -> f64 {
    1.4 * step.powi(4) / 4320.0
}

/// Error bound of area light. Interpolation is accepted where lines over nine positions err by at
/// most twice the value (`scene::area`). For a constant curvature lines between neighbours then err
/// by the value. Near a kink of slope D, at distance d from one of two positions h apart, the test
/// measures `D d / 2` and lines err by `D d (h - d) / h`: up to four times the value, and twice
/// that in two dimensions.
fn at_kinks(value: f64) -> f64 {
    8.0 * value
}

// Name and type, unit, permitted values, values in `fast`, `realtime` and `reference`, visibility
// in frames, error bound of a value, description of that error.
tolerances! {
    /// Share of a point source's light that may fall outside its stamp (1).
    psf_loss: f64, "1", Numbers([1e-12, 0.01]), [1e-4, 1e-6, 1e-12], true, itself,
        "fraction of the light of a source that is lost outside its stamp";
    /// Light (e-) of a source with narrow wings that may always fall outside its stamp, up to 1e-4
    /// of its light.
    loss_e: f64, "e-", Numbers([0.0, 1e3]), [0.05, 1e-3, 0.0], true, itself,
        "light of a source that may always be lost outside its stamp, at most 1e-4 of it";
    /// Wide wings are drawn where they give a pixel at least this (e-). The rest of their light is
    /// spread evenly over the drawn pixels and gives each less than twice this value.
    wing_e: f64, "e-", Numbers([1e-3, 1e3]), [0.2, 0.02, 1e-3], true, |wing_e| 2.0 * wing_e,
        "half the error of a pixel's light in the wide wings of a source";
    /// Length of the panels of a smeared track, in units of the PSF's sigma, for any brightness. A
    /// panel is integrated by two Gauss points, so the profile errs by at most `step^4 / 4320 *
    /// 1.4` of the streak's height, at its ends: 2e-5 at 0.5. For a Gaussian that is the same
    /// everywhere fewer points are as exact (`track::rule`). Light and centroid are exact for any
    /// step.
    track_step_sigma: f64, "sigma", Numbers([0.02, 1.0]), [1.0, 0.5, 0.1], true, profile,
        "step along a streak; the relative error of its profile is step^4 / 3086";
    /// Panels are lengthened up to one sigma, and short tracks are drawn as points, as long as the
    /// profile errs by no more than this (e-).
    track_e: f64, "e-", Numbers([0.0, 1e3]), [0.1, 0.01, 0.0], true, itself,
        "light of a streak on a pixel below which its panels are longer, or it is drawn as a point";
    /// Area light is interpolated linearly between computed positions where its curvature makes the
    /// error at most this (e-) plus `area_part` of the light.
    area_e: f64, "e-", Numbers([1e-4, 1e3]), [0.2, 0.02, 1e-3], true, at_kinks,
        "error of a pixel's area light from interpolation, added to area_part; up to 8 times as large at kinks and in thin layers";
    /// The part (1) of the light in the tolerance of `area_e`.
    area_part: f64, "1", Numbers([1e-7, 0.1]), [5e-3, 5e-4, 1e-6], true, at_kinks,
        "relative error of that light, with the same factor of up to 8";
    /// Total-variation distance (1) of shot noise from a Poisson distribution, up to 2^20 e- per
    /// pixel.
    poisson_tv: f64, "1", Numbers([1e-6, 0.01]), [5e-4, 1e-4, 1e-6], true, itself,
        "total-variation distance between shot noise and Poisson's distribution, up to 10^6 e- per pixel";
    /// An effect is skipped if no pixel's expected electrons change by more than this (e-).
    skip_e: f64, "e-", Numbers([0.0, 1e6]), [0.5, 0.05, 0.0], true, itself,
        "change of a pixel's expected electrons by a skipped effect";
    /// Area light that gives no pixel more than `skip_e` is skipped if its total signal-to-noise
    /// ratio is no more than this (1).
    skip_snr: f64, "1", Numbers([0.0, 10.0]), [0.5, 0.05, 0.0], true, itself,
        "signal-to-noise ratio of skipped area light, and of an object without an image";
    /// A star has no image if its signal-to-noise ratio with read noise alone is no more than this
    /// (1); labels do not list it either.
    star_snr: f64, "1", Numbers([0.0, 10.0]), [0.5, 0.0, 0.0], true, itself,
        "signal-to-noise ratio, with read noise alone, of a star without an image; labelled stars have images";
    /// An effect is skipped if no image moves by more than this (px); so is a source's own motion.
    skip_px: f64, "px", Numbers([0.0, 1.0]), [0.01, 1e-3, 0.0], true, itself,
        "error of the position of an image, or of an end of its track";
    /// Method of orbit propagation.
    orbits: Orbits, "method", Words(Orbits::WORDS), [Orbits::Tracked, Orbits::Tracked, Orbits::Scalar], false, |_| 1e-6,
        "propagation of orbits; positions of images differ by rounding, 1e-6 px";
}

impl Fidelity {
    /// The share (1) of the light of a source of `electrons` that may fall outside its stamp, if
    /// its wings are narrow.
    pub fn loss(&self, electrons: f64) -> f64 {
        const MAX: f64 = 1e-4;
        if self.loss_e > 0.0 {
            (self.loss_e / electrons).min(MAX).max(self.psf_loss)
        } else {
            self.psf_loss
        }
    }

    /// Length of a panel in units of the PSF's sigma, for a streak whose pixels get `height_e` (e-)
    /// at most: `step^4 / 4320 * 1.4 height_e = track_e`.
    pub(crate) fn step_sigma(&self, height_e: f64) -> f64 {
        let step = (self.track_e * 4320.0 / (1.4 * height_e)).sqrt().sqrt();
        step.max(self.track_step_sigma)
            .min(LONGEST_STEP_SIGMA.max(self.track_step_sigma))
    }

    /// Permitted error of the light that a Gaussian collects from a track of `length` sigmas,
    /// relative to an endless track, for a source whose still image has at most `height_e` (e-) per
    /// pixel. A streak's pixels get at least `q / (1 + q^2)^(1/2)` of the endless track's light,
    /// and at most `1 / q` of the still image's:
    ///
    /// ```text
    /// error = max(step^4 / 3086 q / (1 + q^2)^(1/2), track_e / height_e q)
    /// q = length / (2 pi)^(1/2)
    /// ```
    pub(crate) fn streak_error(&self, length: f64, height_e: f64) -> f64 {
        // The value of profile() at its longest step is below a hundredth of a streak's height.
        const MAX: f64 = 5e-4;
        let q = length / TAU.sqrt();
        let part = profile(self.track_step_sigma) * q / (1.0 + q * q).sqrt();
        part.max((self.track_e / height_e * q).min(MAX))
    }

    /// Longest track, in units of the PSF's sigma, that is drawn as one point: its profile, with a
    /// curvature of at most `height_e / sigma^2`, errs by `step^2 / 24 height_e = track_e`.
    pub(crate) fn point_sigma(&self, height_e: f64) -> f64 {
        (self.track_e * 24.0 / height_e)
            .sqrt()
            .min(LONGEST_STEP_SIGMA)
    }

    /// The preset with the fewest differing tolerances, and those with their values. Counts only
    /// tolerances that are visible in frames.
    pub fn nearest_preset(&self) -> (&'static str, Vec<(&'static str, Value)>) {
        let differing = |preset: &Fidelity| -> Vec<(&'static str, Value)> {
            let tolerances = TOLERANCES.iter();
            let differing = tolerances
                .filter(|tolerance| tolerance.changes_frames && !tolerance.is_same(self, preset));
            differing
                .map(|tolerance| (tolerance.name, (tolerance.get)(self)))
                .collect()
        };
        let all = PRESETS
            .iter()
            .map(|(name, preset)| (*name, differing(preset)));
        all.min_by_key(|(_, tolerances)| tolerances.len())
            .unwrap_or_default()
    }

    /// With every tolerance limited to the range of its [`Tolerance`]; NaN becomes the minimum.
    pub fn within_ranges(mut self) -> Fidelity {
        for tolerance in TOLERANCES {
            if let (Numbers([min, max]), Value::Number(given)) =
                (tolerance.allowed, (tolerance.get)(&self))
            {
                (tolerance.set)(&mut self, Value::Number(nearest(given, min..=max)));
            }
        }
        self
    }

    /// The preset called `name`.
    pub fn preset(name: &str) -> Option<Fidelity> {
        PRESETS.iter().find(|(n, _)| *n == name).map(|(_, f)| *f)
    }
}

/// Longest panel for which the first term of the error series suffices.
const LONGEST_STEP_SIGMA: f64 = 1.0;

/// The named presets.
pub const PRESETS: &[(&str, Fidelity)] = &[
    ("fast", Fidelity::FAST),
    ("realtime", Fidelity::REALTIME),
    ("reference", Fidelity::REFERENCE),
];
