//! Labels: the exact content of a frame, one JSON object each. Field names are a contract:
//! `docs/explanation/labels.md`.

mod artifact;
mod coordinates;
mod empty;
mod fidelity;
mod frame;
mod object;
mod objects;
mod planet;
mod rounded;
mod schema;
mod text;
mod unseen;
mod visible;

pub use artifact::{ArtifactLabel, MAX_ARTIFACT_PIXELS, MAX_ARTIFACTS};
pub use fidelity::FidelityLabel;
pub use frame::{EffectLabel, Label};
pub use object::{ObjectLabel, RsoLabel};
pub use objects::Objects;
pub use planet::PlanetLabel;
pub use schema::schema;
pub use unseen::MAX_EXCLUDED;
pub use visible::{VISIBLE_SNR, why_hidden};
