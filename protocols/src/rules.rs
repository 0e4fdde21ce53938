//! Checks of the values of fields.

use crate::error::DecodeError;

/// Refuses a field that breaks its rule.
pub(crate) fn rule(
    holds: bool,
    field: &'static str,
    rule: &'static str,
) -> Result<(), DecodeError> {
    if holds {
        Ok(())
    } else {
        Err(DecodeError::BadValue { field, rule })
    }
}

/// Refuses anything but finite numbers above zero. The receiver may have a narrower range, which
/// `text` then states.
pub(crate) fn positive(
    field: &'static str,
    value: f64,
    text: &'static str,
) -> Result<(), DecodeError> {
    rule(value.is_finite() && value > 0.0, field, text)
}

/// Refuses NaN and infinity in an attitude.
pub(crate) fn finite(field: &'static str, numbers: &[f64]) -> Result<(), DecodeError> {
    if numbers.iter().all(|number| number.is_finite()) {
        Ok(())
    } else {
        Err(DecodeError::NotFinite { field })
    }
}
