//! Everything that describes the native packets, written from one description: `packets.toml` and `vectors.toml`.
//!
//! [`outputs`] makes the files in memory; `cargo run -p skyloop-schema` writes them, and a test of this crate compares them
//! with what is committed. A file an output: [`icd`], [`xtce`], [`dbc`], [`c`], [`rust`], [`vectors`].

pub mod bytes;
pub mod c;
pub mod dbc;
pub mod encode;
pub mod icd;
pub mod model;
pub mod query;
pub mod rice;
pub mod rust;
pub mod vectors;
pub mod xtce;

use std::path::{Path, PathBuf};

/// What the first line of every written file says, after the sign of a comment.
pub const NOTE: &str =
    "Generated from protocols/schema by `cargo run -p skyloop-schema`: do not edit.";

/// One file: its path below `protocols/` and its text.
#[derive(Debug)]
pub struct Output {
    /// Path below `protocols/`.
    pub path: PathBuf,
    /// All of it.
    pub text: String,
}

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

/// Every file, as the two descriptions ask for it.
///
/// # Errors
/// What in the descriptions does not make sense.
pub fn outputs() -> Result<Vec<Output>, String> {
    let schema = model::Schema::parse(&read("schema/packets.toml")?)?;
    let vectors = vectors::Vectors::parse(&schema, &read("schema/vectors.toml")?)?;
    let mut files = vec![
        (
            "docs/icd.md".to_owned(),
            icd::write(&schema, &vectors, &read("docs/icd.md")?)?,
        ),
        ("docs/skyloop.xtce.xml".to_owned(), xtce::write(&schema)),
        ("docs/skyloop.dbc".to_owned(), dbc::write(&schema)),
        ("include/skyloop.h".to_owned(), c::header(&schema)?),
        ("vectors/golden.txt".to_owned(), vectors.text()),
        (
            "vectors/golden.h".to_owned(),
            c::vectors::write(&schema, &vectors)?,
        ),
    ];
    files.extend(rust::files(&schema)?);
    let output = |(path, text): (String, String)| Output {
        path: path.into(),
        text,
    };
    Ok(files.into_iter().map(output).collect())
}
