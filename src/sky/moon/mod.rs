//! The Moon: where it is ([`Bodies`](super::bodies::Bodies) holds its place), how bright it is.

pub(super) mod series;
