//! The error tolerances of the renderer, their presets, and the knobs that set them.

use super::orbits::Orbits;
use super::value::Allowed::{self, Numbers, Words};
use super::value::{Setting, Value};
use skyloop_base::range::nearest;
use std::f64::consts::TAU;

/// One tolerance: what a configuration may set.
#[derive(Debug)]
pub struct Tolerance {
    /// Its key.
    pub name: &'static str,
    /// The unit of its value.
    pub unit: &'static str,
    /// What it bounds.
    pub bounds: &'static str,
    /// The greatest error by a value, in that unit or as `bounds` has it; 0 of methods that change
    /// nothing.
    pub bound: fn(f64) -> f64,
    /// What it may be.
    pub allowed: Allowed,
    /// Whether frames depend on it.
    pub is_seen: bool,
    /// Its value.
    pub get: fn(&Fidelity) -> Value,
    /// Turns it; a value of another kind does nothing.
    pub set: fn(&mut Fidelity, Value),
}

impl Tolerance {
    /// The knob called `name`.
    pub fn named(name: &str) -> Option<&'static Tolerance> {
        TOLERANCES.iter().find(|tolerance| tolerance.name == name)
    }

    /// Whether a frame by the one value is coarser or faster than by the other: a greater
    /// tolerance, or a method that stands before.
    pub fn is_coarser(&self, one: Value, other: Value) -> bool {
        match (one, other, self.allowed) {
            (Value::Number(one), Value::Number(other), _) => one > other,
            (Value::Word(one), Value::Word(other), Allowed::Words(words)) => {
                let place = |word| words.iter().position(|other| *other == word);
                place(one) < place(other)
            }
            _ => false,
        }
    }

    /// Whether two settings have it in common.
    pub fn is_same(&self, a: &Fidelity, b: &Fidelity) -> bool {
        (self.get)(a) == (self.get)(b)
    }
}

/// Makes of each row a field of [`Fidelity`], its value in each preset, and its [`Knob`].
macro_rules! tolerances {
    ($($(#[$doc:meta])* $name:ident: $type:ty, $unit:literal, $allowed:expr,
       [$fast:expr, $realtime:expr, $reference:expr], $seen:literal, $bound:expr, $bounds:literal;)*) => {
        /// Error tolerances of the renderer. Each bounds one error.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct Fidelity {
            $($(#[$doc])* pub $name: $type,)*
        }

        impl Fidelity {
            /// For frames that must be there in time: errors that a detector's noise hides.
            pub const FAST: Fidelity = Fidelity { $($name: $fast,)* };
            /// For live frames: errors far below the noise of any frame.
            pub const REALTIME: Fidelity = Fidelity { $($name: $realtime,)* };
            /// The slow, obvious path that also serves the tests as truth.
            pub const REFERENCE: Fidelity = Fidelity { $($name: $reference,)* };
        }

        /// All knobs.
        pub const TOLERANCES: &[Tolerance] = &[$(Tolerance {
            name: stringify!($name),
            unit: $unit,
            bounds: $bounds,
            bound: $bound,
            allowed: $allowed,
            is_seen: $seen,
            get: |fidelity| fidelity.$name.value(),
            set: |fidelity, value| {
                if let Some(value) = Setting::of(value) {
                    fidelity.$name = value;
                }
            },
        },)*];
    };
}

/// A bound that is the value.
fn itself(value: f64) -> f64 {
    value
}

/// What panels of so many sigmas make of a streak's profile at most, as a part of its height.
fn profile(step: f64) -> f64 {
    1.4 * step.powi(4) / 4320.0
}

/// A bound of area light that is accepted where lines across nine places miss twice the value
/// (`scene::area`). Of an even bend they then miss that between two neighbours. Of a kink of slope
/// D at d from one of them, h apart, the test sees `D d / 2`, and lines miss `D d (h - d) / h`: up
/// to four times the value, and across and down twice that.
fn at_kinks(value: f64) -> f64 {
    8.0 * value
}

// Name and type, unit, what it may be, its values in `fast`, `realtime` and `reference`, whether
// frames show it, the error that a value stands for, of what.
tolerances! {
    /// Share of a point source's light that may fall outside its stamp (1).
    psf_loss: f64, "1", Numbers([1e-12, 0.01]), [1e-4, 1e-6, 1e-12], true, itself,
        "fraction of the light of a source that is lost outside its stamp";
    /// So much of its light (e-) may fall outside in any case where its wings are narrow, up to a
    /// ten thousandth.
    loss_e: f64, "e-", Numbers([0.0, 1e3]), [0.05, 1e-3, 0.0], true, itself,
        "light of a source that may always be lost outside its stamp, at most 1e-4 of it";
    /// Of wide wings only what brings a pixel at least this (e-) is drawn where it falls; the rest
    /// of their light is laid evenly over the pixels that are drawn, and brings each less than
    /// twice as much.
    wing_e: f64, "e-", Numbers([1e-3, 1e3]), [0.2, 0.02, 1e-3], true, |wing_e| 2.0 * wing_e,
        "half the error of a pixel's light in the wide wings of a source";
    /// Panels of a smeared track may be this long, in units of the PSF's sigma, whatever the
    /// source's light. A panel is integrated by two Gauss points, so the profile errs by at most
    /// `step^4 / 4320 * 1.4` of the streak's height, at its ends: 2e-5 at 0.5. Of a Gaussian that
    /// is the same everywhere fewer points tell as much (`track::rule`). Light and centroid are
    /// kept whatever the step.
    track_step_sigma: f64, "sigma", Numbers([0.02, 1.0]), [1.0, 0.5, 0.1], true, profile,
        "step along a streak; the relative error of its profile is step^4 / 3086";
    /// Panels are longer, up to one sigma, and short tracks are points, where the profile still
    /// errs by no more than this (e-).
    track_e: f64, "e-", Numbers([0.0, 1e3]), [0.1, 0.01, 0.0], true, itself,
        "light of a streak on a pixel below which its panels are longer, or it is drawn as a point";
    /// Area light runs in straight lines between places at which it is worked out where its bend
    /// makes that err by no more than this (e-) and
    area_e: f64, "e-", Numbers([1e-4, 1e3]), [0.2, 0.02, 1e-3], true, at_kinks,
        "error of a pixel's area light from interpolation, added to area_part; up to 8 times as large at kinks and in thin layers";
    /// this part of it (1).
    area_part: f64, "1", Numbers([1e-7, 0.1]), [5e-3, 5e-4, 1e-6], true, at_kinks,
        "relative error of that light, with the same factor of up to 8";
    /// Draws of shot noise are within this total-variation distance of Poisson's (1), up to 2^20 e-
    /// a pixel.
    poisson_tv: f64, "1", Numbers([1e-6, 0.01]), [5e-4, 1e-4, 1e-6], true, itself,
        "total-variation distance between shot noise and Poisson's distribution, up to 10^6 e- per pixel";
    /// An effect without which no pixel's expected electrons change by more than this (e-) is
    /// skipped.
    skip_e: f64, "e-", Numbers([0.0, 1e6]), [0.5, 0.05, 0.0], true, itself,
        "change of a pixel's expected electrons by a skipped effect";
    /// Light of an area that brings no pixel more than that is skipped where all of it has no more
    /// than this signal-to-noise ratio (1).
    skip_snr: f64, "1", Numbers([0.0, 10.0]), [0.5, 0.05, 0.0], true, itself,
        "signal-to-noise ratio of skipped area light, and of an object without an image";
    /// A star has no image where its light has no more than this signal-to-noise ratio (1), were
    /// there no noise but that of reading; nor do labels list it.
    star_snr: f64, "1", Numbers([0.0, 10.0]), [0.5, 0.0, 0.0], true, itself,
        "signal-to-noise ratio, with read noise alone, of a star without an image; labelled stars have images";
    /// An effect without which no image moves by more than this (px) is skipped; so is a source's
    /// own motion.
    skip_px: f64, "px", Numbers([0.0, 1.0]), [0.01, 1e-3, 0.0], true, itself,
        "error of the position of an image, or of an end of its track";
    /// How the orbits of objects are worked out.
    orbits: Orbits, "method", Words(Orbits::WORDS), [Orbits::Tracked, Orbits::Tracked, Orbits::Scalar], false, |_| 1e-6,
        "propagation of orbits; positions of images differ by rounding, 1e-6 px";
}

impl Fidelity {
    /// The share (1) of the light of a source of so many `electrons` that may fall outside its
    /// stamp, where its wings are narrow.
    pub fn bound(&self, electrons: f64) -> f64 {
        const MAX: f64 = 1e-4;
        if self.loss_e > 0.0 {
            (self.loss_e / electrons).min(MAX).max(self.psf_loss)
        } else {
            self.psf_loss
        }
    }

    /// Length of a panel in units of the PSF's sigma, for a streak whose pixels get `height_e` (e-)
    /// at most: `step^4 / 4320 * 1.4 height_e = track_e`.
    pub fn step_sigma(&self, height_e: f64) -> f64 {
        let step = (self.track_e * 4320.0 / (1.4 * height_e)).sqrt().sqrt();
        step.max(self.track_step_sigma)
            .min(LONGEST_STEP_SIGMA.max(self.track_step_sigma))
    }

    /// What a Gaussian may collect too much or too little along a track of `length` sigmas, in
    /// parts of what it collects of one without ends, for a source whose pixels would get
    /// `height_e` (e-) at most if it stood still. Of a streak they get `q / (1 + q^2)^(1/2)` of the
    /// former at least, and `1 / q` of the latter at most:
    ///
    /// ```text
    /// error = max(step^4 / 3086 q / (1 + q^2)^(1/2), track_e / height_e q),   q = length / (2 pi)^(1/2)
    /// ```
    pub fn streak_error(&self, length: f64, height_e: f64) -> f64 {
        // What this stands for is below a hundredth of a streak's height.
        const MAX: f64 = 5e-4;
        let q = length / TAU.sqrt();
        let part = profile(self.track_step_sigma) * q / (1.0 + q * q).sqrt();
        part.max((self.track_e / height_e * q).min(MAX))
    }

    /// Length of a track, in units of the PSF's sigma, for which one point stands: its profile,
    /// curved by `height_e / sigma^2` at most, errs by `step^2 / 24 height_e = track_e`.
    pub fn point_sigma(&self, height_e: f64) -> f64 {
        (self.track_e * 24.0 / height_e)
            .sqrt()
            .min(LONGEST_STEP_SIGMA)
    }

    /// The preset that it is nearest to, by the number of knobs that differ, and those; of knobs
    /// that frames show.
    pub fn told(&self) -> (&'static str, Vec<(&'static str, Value)>) {
        let differing = |preset: &Fidelity| -> Vec<(&'static str, Value)> {
            let tolerances = TOLERANCES.iter();
            let differing = tolerances
                .filter(|tolerance| tolerance.is_seen && !tolerance.is_same(self, preset));
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

    /// With every tolerance brought into the range of its [`Knob`]; what is no number becomes the
    /// least.
    pub fn within_ranges(mut self) -> Fidelity {
        for tolerance in TOLERANCES {
            if let (Numbers([least, most]), Value::Number(given)) =
                (tolerance.allowed, (tolerance.get)(&self))
            {
                (tolerance.set)(&mut self, Value::Number(nearest(given, least..=most)));
            }
        }
        self
    }

    /// The preset called `name`.
    pub fn preset(name: &str) -> Option<Fidelity> {
        PRESETS.iter().find(|(n, _)| *n == name).map(|(_, f)| *f)
    }
}

/// Longest panel for which the error of the sum is told by its first term.
const LONGEST_STEP_SIGMA: f64 = 1.0;

/// The named presets.
pub const PRESETS: &[(&str, Fidelity)] = &[
    ("fast", Fidelity::FAST),
    ("realtime", Fidelity::REALTIME),
    ("reference", Fidelity::REFERENCE),
];
