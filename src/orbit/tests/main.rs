//! Tests of the orbit crate.

mod batch_catalogues;
mod batch_edges;
mod batch_identity;
mod conversions;
mod element_files;
mod ephemeris_messages;
mod ephemeris_references;
mod fixed_columns;
mod frames;
mod messages;
mod mixed_files;
mod odd_files;
mod omm_files;
mod sgp4_verification;
mod support;
mod synth;
mod tracks;
mod two_body;
