//! Generates all descriptions and codecs of the native packets from `packets.toml` and
//! `vectors.toml`.
//!
//! [`outputs`] makes the files in memory; `cargo run -p skyloop-schema` writes them, and a test
//! compares them with the committed files. Each output has its own module.

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

/// The comment in the first line of every generated file.
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
/// The file cannot be read; the error names it.
pub fn read(path: impl AsRef<Path>) -> Result<String, String> {
    let path = protocols().join(path);
    std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))
}

/// Path below `protocols/` and text of every generated file.
///
/// # Errors
/// A fault in the two descriptions.
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
