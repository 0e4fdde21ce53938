//! What accuracy is asked for, as bounds of errors in field units; never a "quality" from 1 to 10.

/// Error tolerances of the renderer. Each bounds one error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fidelity {
    /// Share of a point source's light that may fall outside its stamp (1).
    pub psf_loss: f64,
    /// So much of its light (e-) may fall outside in any case where its wings are narrow, up to a ten thousandth.
    pub loss_e: f64,
    /// Of wide wings only what brings a pixel at least this (e-) is drawn where it falls; the rest of their light is laid
    /// evenly over the pixels that are drawn, and brings each less than twice as much.
    pub wing_e: f64,
    /// Panels of a smeared track may be this long, in units of the PSF's sigma, whatever the source's light. A panel is
    /// integrated by two Gauss points, so the profile errs by at most `step^4 / 4320 * 1.4` of the streak's height, at its
    /// ends: 2e-5 at 0.5. Light and centroid are kept whatever the step.
    pub track_step_sigma: f64,
    /// Panels are longer, up to one sigma, and short tracks are points, where the profile still errs by no more than this (e-).
    pub track_e: f64,
    /// Area light runs in straight lines between places at which it is worked out where that errs by no more than this (e-) and
    pub area_e: f64,
    /// this part of it (1).
    pub area_part: f64,
    /// Draws of shot noise are within this total-variation distance of Poisson's (1).
    pub poisson_tv: f64,
    /// An effect without which no pixel's expected electrons change by more than this (e-) is skipped.
    pub skip_e: f64,
    /// Light of an area that brings no pixel more than that is skipped where all of it has no more than this signal-to-noise ratio (1).
    pub skip_snr: f64,
    /// An effect without which no image moves by more than this (px) is skipped; so is a source's own motion.
    pub skip_px: f64,
    /// How the orbits of objects are worked out.
    pub orbits: Orbits,
}

/// How the orbits of objects are worked out. The frames are the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Orbits {
    /// From frame to frame who may be in the field is told from positions between knots, within centimetres; who is, by SGP4.
    #[default]
    Tracked,
    /// Everybody by SGP4, in lanes.
    Exact,
    /// Everybody by the scalar SGP4, one after another.
    Scalar,
}

impl Fidelity {
    /// For live frames: errors far below the noise of any frame.
    pub const REALTIME: Fidelity = Fidelity {
        psf_loss: 1e-6,
        loss_e: 1e-3,
        wing_e: 0.02,
        track_step_sigma: 0.5,
        track_e: 0.01,
        area_e: 0.02,
        area_part: 5e-4,
        poisson_tv: 1e-4,
        skip_e: 0.05,
        skip_snr: 0.05,
        skip_px: 1e-3,
        orbits: Orbits::Tracked,
    };
    /// The slow, obvious path that also serves the tests as truth.
    pub const REFERENCE: Fidelity = Fidelity {
        psf_loss: 1e-12,
        loss_e: 0.0,
        wing_e: 1e-3,
        track_step_sigma: 0.1,
        track_e: 0.0,
        area_e: 1e-3,
        area_part: 1e-6,
        poisson_tv: 1e-6,
        skip_e: 0.0,
        skip_snr: 0.0,
        skip_px: 0.0,
        orbits: Orbits::Scalar,
    };

    /// The share (1) of the light of a source of so many `electrons` that may fall outside its stamp, where its wings are narrow.
    pub fn loss(&self, electrons: f64) -> f64 {
        const MOST: f64 = 1e-4;
        match self.loss_e > 0.0 {
            true => (self.loss_e / electrons).min(MOST).max(self.psf_loss),
            false => self.psf_loss,
        }
    }

    /// Length of a panel in units of the PSF's sigma, for a streak whose pixels get `height_e` (e-) at most:
    /// `step^4 / 4320 * 1.4 height_e = track_e`.
    pub fn step_sigma(&self, height_e: f64) -> f64 {
        let step = (self.track_e * 4320.0 / (1.4 * height_e)).sqrt().sqrt();
        step.max(self.track_step_sigma)
            .min(LONGEST_STEP_SIGMA.max(self.track_step_sigma))
    }

    /// Length of a track, in units of the PSF's sigma, for which one point stands: its profile, curved by `height_e / sigma^2` at most, errs
    /// by `step^2 / 24 height_e = track_e`.
    pub fn point_sigma(&self, height_e: f64) -> f64 {
        (self.track_e * 24.0 / height_e)
            .sqrt()
            .min(LONGEST_STEP_SIGMA)
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
    ("realtime", Fidelity::REALTIME),
    ("reference", Fidelity::REFERENCE),
];

/// What a run wants of the effects, whatever its scenes call for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Choice {
    /// Whether effects that draw random numbers run.
    pub noise: bool,
    /// Names of the effects that are switched off.
    pub off: Vec<&'static str>,
    /// Whether effects run that a scene does not call for.
    pub all: bool,
}

impl Default for Choice {
    fn default() -> Self {
        Choice {
            noise: true,
            off: Vec::new(),
            all: false,
        }
    }
}
