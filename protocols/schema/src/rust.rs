//! The generated Rust: nothing yet.
use crate::model::Schema;

/// The files.
///
/// # Errors
/// None.
pub fn files(_schema: &Schema) -> Result<Vec<(String, String)>, String> {
    Ok(Vec::new())
}
