//! `[optics.projection]` of a camera file.

use crate::camera::{Detector, Model, Optics, Projection};
use crate::load::{Check, ConfigError};
use serde::Deserialize;

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub struct RawProjection {
    model: Option<String>,
    k: Option<Vec<f64>>,
    p: Option<[f64; 2]>,
    strength: Option<f64>,
}

/// Furthest (px) beyond the detector that a projection must reach: light from there is faint.
const MOST_MARGIN_PX: f64 = 64.0;

impl RawProjection {
    /// A polynomial has most three or four coefficients; those left out are 0.
    fn coefficients<const N: usize>(&self, check: &Check) -> Result<[f64; N], ConfigError> {
        let given = self.k.as_deref().unwrap_or_default();
        if given.len() > N {
            let allowed = format!("at most {N} numbers");
            return Err(check.refuse("optics.projection.k", format!("{given:?}"), allowed));
        }
        let mut k = [0.0; N];
        for (k, given) in k.iter_mut().zip(given) {
            *k = check.range("optics.projection.k", *given, -1e6..=1e6)?;
        }
        let strength = self.strength(check)?;
        Ok(k.map(|k| strength * k))
    }

    fn strength(&self, check: &Check) -> Result<f64, ConfigError> {
        let strength = self.strength.unwrap_or(1.0);
        check.range("optics.projection.strength", strength, 0.0..=100.0)
    }

    pub fn validate(&self, check: &Check) -> Result<Projection, ConfigError> {
        let model = self.model.as_deref().unwrap_or("pinhole");
        let unused = match model {
            "pinhole" if self.k.is_some() => Some("k"),
            "pinhole" | "fisheye" if self.p.is_some() => Some("p"),
            "pinhole" if self.strength.is_some() => Some("strength"),
            _ => None,
        };
        if let Some(key) = unused {
            let reason = format!("no key of model {model:?}");
            return Err(check.explain(&format!("optics.projection.{key}"), reason));
        }
        Ok(Projection::new(match model {
            "pinhole" => Model::Pinhole,
            "brown-conrady" => {
                let strength = self.strength(check)?;
                let p = self.p.unwrap_or_default();
                for p in p {
                    check.range("optics.projection.p", p, -1e6..=1e6)?;
                }
                Model::BrownConrady {
                    k: self.coefficients(check)?,
                    p: p.map(|p| strength * p),
                }
            }
            "fisheye" => Model::Fisheye {
                k: self.coefficients(check)?,
            },
            other => {
                let allowed = "one of \"pinhole\", \"brown-conrady\", \"fisheye\"";
                return Err(check.refuse("optics.projection.model", format!("{other:?}"), allowed));
            }
        }))
    }

    /// Refuses a projection that ends inside the detector, or so near that light from there falls on it.
    pub fn check_folds(
        &self,
        optics: &Optics,
        detector: &Detector,
        check: &Check,
    ) -> Result<(), ConfigError> {
        // What a source leaves outside of that is below a millionth of its light, or far out in faint wings.
        let margin_px = optics.psf.reach_px(1e-6).min(MOST_MARGIN_PX);
        let distance = |[x, y]: [f64; 2]| {
            let [cx, cy] = optics.principal_px;
            (x - cx).hypot(y - cy)
        };
        let unseen = detector
            .edge(margin_px)
            .filter(|pixel| !optics.sees(*pixel));
        let Some(furthest) = unseen.map(distance).reduce(f64::max) else {
            return Ok(());
        };
        let end = optics.projection.end_rad().to_degrees();
        let allowed = format!(
            "a map that does not fold over on the detector nor within {margin_px:.1} px of it: this one ends at \
             {end:.2} deg from the boresight, the detector {furthest:.0} px from the principal point"
        );
        let key = |name: &str| format!("optics.projection.{name}");
        Err(match (&self.k, &self.p) {
            (Some(k), _) => check.refuse(&key("k"), format!("{k:?}"), allowed),
            (None, Some(p)) => check.refuse(&key("p"), format!("{p:?}"), allowed),
            (None, None) => check.refuse(&key("model"), format!("{:?}", self.model), allowed),
        })
    }
}
