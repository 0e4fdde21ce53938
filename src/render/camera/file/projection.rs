//! `[optics.projection]` of a camera file.

use super::angles::FIELD;
use crate::camera::{Detector, Model, Optics, Projection};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;
use skyloop_base::load::Allowed::{Count, Needs, Number};
use skyloop_base::load::{Allowed, Check, ConfigError, Fixed, Kind, Limit, one_of};

#[derive(Deserialize, Default, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawProjection {
    /// Projection model; fisheye is equidistant; default: pinhole
    model: Option<String>,
    /// Radial coefficients as in OpenCV: [k1, k2, k3], of a fisheye [k1, k2, k3, k4]; the highest
    /// orders may be left out
    k: Option<Vec<f64>>,
    /// Tangential coefficients as in OpenCV: [p1, p2]
    p: Option<Fixed<f64, 2>>,
    /// Factor of the coefficients; default: 1
    strength: Option<f64>,
}

pub(crate) const LIMITS: &[Limit] = &[
    ("optics.projection.k", Count(1..=usize::MAX)),
    ("optics.projection.k[]", Number(-1e6..=1e6)),
    ("optics.projection.p[]", Number(-1e6..=1e6)),
    ("optics.projection.strength", Number(0.0..=100.0)),
    ("optics.projection", Allowed::Kind("model", &MODELS)),
    ("optics.projection", Needs(["k", "model"])),
    ("optics.projection", Needs(["p", "model"])),
    ("optics.projection", Needs(["strength", "model"])),
];

/// The key that determines which other keys are valid.
const MODEL: &[&str] = &["optics.projection.model"];

/// Models, their required keys, and their optional keys.
const MODELS: [Kind; 3] = [
    ("pinhole", &[], &[]),
    ("brown-conrady", &["k"], &["p", "strength"]),
    ("fisheye", &["k"], &["strength"]),
];

/// Greatest margin (px) around the detector that a projection must cover: light from beyond is
/// faint.
const MAX_MARGIN_PX: f64 = 64.0;

impl RawProjection {
    /// The polynomial's coefficients; missing ones of the highest orders are 0.
    fn coefficients<const N: usize>(
        &self,
        strength: f64,
        check: &Check,
    ) -> Result<[f64; N], ConfigError> {
        let key = "optics.projection.k";
        let names = ["k1", "k2", "k3", "k4"][..N].join(", ");
        let given = self.k.as_deref().unwrap_or_default();
        if !(1..=N).contains(&given.len()) {
            let mut allowed = format!("1 to {N} numbers, {names}");
            if N == 3 {
                allowed += ": OpenCV's order is k1, k2, p1, p2, k3, and its p1, p2 are optics.projection.p";
            }
            let error = check.refuse(key, format!("{given:?}"), allowed);
            return Err(error.needs(MODEL));
        }
        let mut k = [0.0; N];
        for (i, given) in given.iter().enumerate() {
            k[i] = strength * check.limit(LIMITS, &format!("{key}[{i}]"), *given)?;
        }
        Ok(k)
    }

    /// Refuses an empty table.
    pub fn not_empty(self, check: &Check) -> Result<Self, ConfigError> {
        match (&self.model, &self.k, &self.p, self.strength) {
            (None, None, None, None) => {
                let reason = "is empty: name its model, or leave it out for a pinhole's";
                Err(check
                    .explain("optics.projection", reason)
                    .needs(&["optics.projection"]))
            }
            _ => Ok(self),
        }
    }

    pub fn validate(&self, check: &Check) -> Result<Projection, ConfigError> {
        let strength = self.strength.unwrap_or(1.0);
        let strength = check.limit(LIMITS, "optics.projection.strength", strength)?;
        self.of_strength(strength, check)
    }

    /// The projection with its coefficients multiplied by `strength`.
    fn of_strength(&self, strength: f64, check: &Check) -> Result<Projection, ConfigError> {
        let model = self.model.as_deref().unwrap_or("pinhole");
        Ok(Projection::new(match model {
            "pinhole" => Model::Pinhole,
            "brown-conrady" => {
                let p = self.p.map_or([0.0; 2], |Fixed(p)| p);
                let p = check.each_limit(LIMITS, "optics.projection.p", p)?;
                Model::BrownConrady {
                    k: self.coefficients(strength, check)?,
                    p: p.map(|p| strength * p),
                }
            }
            "fisheye" => Model::Fisheye {
                k: self.coefficients(strength, check)?,
            },
            other => {
                let known = MODELS.each_ref().map(|(name, ..)| *name);
                let given = format!("{other:?}");
                return Err(check.refuse("optics.projection.model", given, one_of(&known)));
            }
        }))
    }

    /// Refuses a projection that folds inside the detector, or so near that light from there falls
    /// on it.
    pub fn check_folds(
        &self,
        optics: &Optics,
        detector: &Detector,
        check: &Check,
    ) -> Result<(), ConfigError> {
        // Beyond this reach lies less than a millionth of a source's light, or only faint wings.
        let margin_px = optics.psf.reach_px(1e-6).min(MAX_MARGIN_PX);
        let distance = |[x, y]: [f64; 2]| {
            let [cx, cy] = optics.principal_px;
            libm::hypot(x - cx, y - cy)
        };
        let unseen = |optics: &Optics| {
            let edge = detector.edge(margin_px).filter(|at| !optics.sees(*at));
            edge.map(distance).reduce(f64::max)
        };
        let Some(furthest) = unseen(optics) else {
            return Ok(());
        };
        let end = optics.projection.end_rad().to_degrees();
        let strength = self.strength.unwrap_or(1.0);
        let (key, given) = self.largest_coefficients();
        // In hundredths, so that the advised value works as printed.
        let weaker = |part: u32| f64::from(part) * strength / 100.0;
        let holds = |part: u32| -> Result<bool, ConfigError> {
            let mut optics = optics.clone();
            optics.projection = self.of_strength(weaker(part), check)?;
            Ok(unseen(&optics).is_none())
        };
        let (mut flat, mut folded) = (0, 100);
        while folded - flat > 1 {
            let middle = (flat + folded) / 2;
            if holds(middle)? {
                flat = middle;
            } else {
                folded = middle;
            }
        }
        let remedy = match flat {
            0 => "lengthen optics.focal_length_mm, or check the coefficients".to_string(),
            _ => format!(
                "optics.projection.strength = {:?} would do, or coefficients nearer to 0",
                weaker(flat)
            ),
        };
        let allowed = format!(
            "a map that does not fold over on the detector nor within {margin_px:.1} px of it: this one ends at \
             {end:.2} deg from the boresight, the detector {furthest:.0} px from the principal point; {remedy} (they are for coordinates in focal lengths)"
        );
        Err(check.refuse(&key, given, allowed).needs(FIELD))
    }

    /// Warns of coefficients that move images far from their ideal positions.
    pub fn check_size(&self, optics: &Optics, detector: &Detector, check: &Check) {
        let ideal = Optics {
            projection: optics.projection.ideal(),
            ..optics.clone()
        };
        let (mut max, mut field) = (0.0f64, 0.0f64);
        for at in detector.edge(0.0) {
            let seen = optics.direction(at);
            max = max.max(seen.angle(&ideal.direction(at)).to_degrees());
            field = field.max(seen.angle(&Vector3::z()).to_degrees());
        }
        // The barrel distortion that turns a pinhole into an equidistant fisheye is 0.36 of a field
        // of 90 deg.
        if max > field / 2.0 {
            let (key, given) = self.largest_coefficients();
            check.notice(format_args!(
                "{key} = {given}: at the detector's edge it sees {max:.2} deg away from where it would without distortion, in a field of \
                 {field:.2} deg from the boresight: are they for coordinates in focal lengths?",
            ));
        }
    }

    /// The coefficients that probably distort most, as key and value.
    fn largest_coefficients(&self) -> (String, String) {
        match &self.k {
            Some(k) if self.p.is_none() || k.iter().any(|k| *k != 0.0) => self.given("k"),
            _ if self.p.is_some() => self.given("p"),
            _ => self.given("model"),
        }
    }

    /// A key by its full name, and its given value.
    fn given(&self, key: &str) -> (String, String) {
        let value = match key {
            "k" => self.k.as_ref().map(|k| format!("{k:?}")),
            "p" => self.p.map(|Fixed(p)| format!("{p:?}")),
            "strength" => self.strength.map(|strength| format!("{strength:?}")),
            _ => self.model.as_ref().map(|model| format!("{model:?}")),
        };
        let value = value.unwrap_or_default();
        (format!("optics.projection.{key}"), value)
    }
}
