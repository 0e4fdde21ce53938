//! The tolerances of a frame, in its label.

use crate::fidelity::{Fidelity, Value};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// A preset, and the tolerances that differ from it.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FidelityLabel {
    /// The preset.
    pub preset: &'static str,
    /// Their values.
    #[serde(flatten)]
    #[schemars(with = "BTreeMap<String, serde_json::Value>")]
    pub tolerances: BTreeMap<&'static str, Value>,
}

impl From<&Fidelity> for FidelityLabel {
    fn from(fidelity: &Fidelity) -> Self {
        let (preset, tolerances) = fidelity.nearest_preset();
        FidelityLabel {
            preset,
            tolerances: tolerances.into_iter().collect(),
        }
    }
}
