//! Labels: the exact content of a frame, one JSON object each. Field names are a contract:
//! `docs/explanation/labels.md`.

mod coordinates;
mod empty;
mod fidelity;
mod frame;
mod object;
mod objects;
mod rounded;
mod schema;
mod spot;
mod text;
mod unseen;
mod visible;
mod wanderer;

pub use fidelity::FidelityLabel;
pub use frame::{EffectLabel, Label};
pub use object::{ObjectLabel, RsoLabel};
pub use objects::Objects;
pub use schema::schema;
pub use spot::{MOST_SPOT_PIXELS, MOST_SPOTS, SpotLabel};
pub use unseen::MOST_UNSEEN;
pub use visible::{VISIBLE_SNR, why_hidden};
pub use wanderer::WandererLabel;
