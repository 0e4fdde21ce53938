//! Loads text files: folders on disk or built in, checked TOML, errors that name file, key, value
//! and allowed range. Unknown keys are refused.

mod check;
mod document;
mod embedded;
mod error;
mod fixed;
mod folder;
mod limits;
pub mod orbits;
mod report;
mod rules;
mod schema;
mod syntax;
mod table;
mod time;
mod units;
mod words;

pub use check::Check;
pub use embedded::EXAMPLE_CAMERA;
pub use embedded::{CAMERAS, DEFAULT_SCENE, DEFAULT_TOML};
pub use error::ConfigError;
pub use fixed::Fixed;
pub use folder::Folder;
pub use limits::{Allowed, END, Kind, Limit};
pub use report::{Noticed, read, read_noticed};
pub use schema::schema_of;
pub use table::{
    TextOrList, named_tables, some_table, some_tables, some_word, table, tables, word,
};
pub use time::RawTime;
pub use words::{MEANT, advice, nearest, one_of};

/// Compares schemas with loaders, for tests of the crates that read files.
#[cfg(any(test, feature = "test-support"))]
pub use limits::tests::{agree, both};
