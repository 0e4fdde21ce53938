//! JSON Schemas of files.

use super::limits::{self, Limit};
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};

/// The JSON Schema (draft 2020-12) of a file that is read as `Raw`, with the limits of its values.
pub fn schema_of<Raw: JsonSchema>(title: &str, limits: &[&[Limit]]) -> Schema {
    let generator = SchemaSettings::draft2020_12().into_generator();
    let mut schema = generator.into_root_schema_for::<Raw>();
    limits::bound_integers(schema.ensure_object().values_mut());
    for limits in limits {
        limits::apply(&mut schema, limits);
    }
    schema.insert("title".to_string(), title.into());
    schema
}
