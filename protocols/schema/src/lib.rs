//! Everything that describes the native packets, written from one description: `packets.toml` and `vectors.toml`.
//!
//! [`outputs`] makes the files in memory; `cargo run -p skyloop-schema` writes them, and a test of
//! this crate compares them with the committed files. Each output has a module of its own.

mod bytes;
mod c;
mod dbc;
mod encode;
mod icd;
mod mistake;
mod model;
mod query;
mod rice;
mod rust;
mod text;
mod vectors;
mod xtce;

use std::path::{Path, PathBuf};

/// The note in the first line of every written file, after the sign of a comment.
pub const NOTE: &str =
    "Generated from protocols/schema by `cargo run -p skyloop-schema`: do not edit.";

/// The folder `protocols/`.
pub fn protocols() -> PathBuf {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    own.parent().unwrap_or(own).to_path_buf()
}

/// Reads a file below `protocols/`.
///
/// # Errors
/// Names the file.
pub fn read(path: impl AsRef<Path>) -> Result<String, String> {
    let path = protocols().join(path);
    std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))
}

/// Path below `protocols/` and text of every file, as the two descriptions ask for it.
///
/// # Errors
/// What in the descriptions does not make sense.
pub fn outputs() -> Result<Vec<(String, String)>, String> {
    let schema = model::Schema::parse(&read("schema/packets.toml")?)?;
    let vectors = vectors::Vectors::parse(&schema, &read("schema/vectors.toml")?)
        .map_err(|error| format!("vectors.toml: {error}"))?;
    let icd = icd::write(&schema, &vectors, &read("docs/icd.md")?)?;
    let files = [
        ("docs/icd.md", icd),
        ("docs/skyloop.xtce.xml", xtce::write(&schema)),
        ("docs/skyloop.dbc", dbc::write(&schema)),
        ("include/skyloop.h", c::header(&schema)?),
        ("vectors/golden.txt", vectors.text()),
        ("vectors/golden.h", c::vectors::write(&schema, &vectors)?),
    ];
    let files = files.map(|(path, text)| (path.to_owned(), text));
    Ok(files.into_iter().chain(rust::files(&schema)).collect())
}
