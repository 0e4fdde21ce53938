//! `[optics.vignetting]` of a camera file.

use super::angles::{FIELD_DEG, rising_angles};
use crate::camera::Vignetting;
use schemars::JsonSchema;
use serde::Deserialize;
use skyloop_base::load::Allowed::{Count, NotBoth, Number};
use skyloop_base::load::{Check, ConfigError, Fixed, Limit};

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawVignetting {
    /// Light falls with the fourth power of the cosine of the field angle
    cos4: Option<bool>,
    /// [[angle, transmission], ...]: linear between, constant beyond (deg)
    table: Option<Vec<Fixed<f64, 2>>>,
}

pub(crate) const LIMITS: &[Limit] = &[
    ("optics.vignetting.table[][0]", Number(FIELD_DEG)),
    ("optics.vignetting.table[][1]", Number(0.0..=1.0)),
    ("optics.vignetting.table", Count(1..=usize::MAX)),
    ("optics.vignetting", NotBoth(["cos4", "table"])),
];

impl RawVignetting {
    /// The last angle of the table, deg, if it has several points.
    pub fn last_angle_deg(&self) -> Option<f64> {
        let table = self.table.as_ref().filter(|t| t.len() > 1)?;
        table.last().map(|Fixed([deg, _])| *deg)
    }

    pub fn validate(self, check: &Check) -> Result<Vignetting, ConfigError> {
        if self.cos4.is_none() && self.table.is_none() {
            let reason = "is empty: set cos4 = true or table = [[angle, transmission], ...], or leave it out";
            return Err(check.explain("optics.vignetting", reason));
        }
        let key = "optics.vignetting.table";
        let table = self.table.map(Fixed::all);
        if let Some(table) = &table {
            if table.is_empty() {
                return Err(check.refuse(key, "[]", "at least one [angle, transmission]"));
            }
            rising_angles(key, table, LIMITS, check)?;
        }
        Ok(match (self.cos4, table) {
            (_, Some(table)) => {
                let rad = table.into_iter().map(|[deg, t]| [deg.to_radians(), t]);
                Vignetting::Table(rad.collect())
            }
            (Some(true), None) => Vignetting::Cos4,
            _ => Vignetting::None,
        })
    }
}
