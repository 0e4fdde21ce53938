//! The JSON Schema of a label's text.

use super::artifact::ArtifactLabel;
use super::frame::Label;
use super::object::ObjectLabel;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema, json_schema};

/// An entry of the label's array of objects.
#[derive(JsonSchema)]
#[serde(untagged)]
#[allow(dead_code, reason = "its schema is used, not its values")]
enum Listed {
    Source(Box<ObjectLabel>),
    Spot(ArtifactLabel),
}

/// The schema (draft 2020-12) of a line of `labels.jsonl`. Labels may get new members later:
/// unknown ones are valid.
pub fn schema() -> Schema {
    let settings = SchemaSettings::draft2020_12().for_serialize();
    let mut generator = settings.into_generator();
    let listed = generator.subschema_for::<Listed>();
    // Members without a derived type: code writes the objects, the output the files, the server the
    // times.
    let own = [
        (
            "objects",
            json_schema!({ "description": "Objects in the frame", "type": "array", "items": listed }),
        ),
        (
            "files",
            json_schema!({ "description": "File names of the frame, in labels.jsonl", "type": "array", "items": { "type": "string" } }),
        ),
        (
            "timing",
            json_schema!({ "description": "Times of the frame, in live runs", "type": "object" }),
        ),
    ];
    let mut schema = generator.into_root_schema_for::<Label>();
    schema.insert("title".to_string(), "skyloop label".into());
    if let Some(properties) = schema
        .get_mut("properties")
        .and_then(|value| value.as_object_mut())
    {
        properties.extend(own.map(|(name, schema)| (name.to_string(), schema.into())));
    }
    if let Some(required) = schema
        .get_mut("required")
        .and_then(|value| value.as_array_mut())
    {
        required.push("objects".into());
    }
    schema
}
