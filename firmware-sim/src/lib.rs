//! A mock flight computer for skyloop's emulator.
//!
//! Its inputs are an orbit, an attitude profile, and the packets received. One frame passes the
//! modules in this order:
//!
//! ```text
//! profile + orbit -> Attitude -> port ... port -> reassembly -> detector -> score
//! ```
//!
//! In a closed loop ([`control`]) a simulated body drifts and is steered by the detections:
//!
//! ```text
//! body -> Attitude -> port ... port -> reassembly -> detector -> estimator -> law -> body
//! ```
//!
//! Labels arrive on the same wire as pixels, but stay sealed in [`received::ReceivedFrame`] until
//! the detections of that frame are fixed; [`received::ReceivedFrame::labels`] opens them.
//!
//! [`flight_computer`] runs the mission; the binary `skyloop-fc` is its command line. Conventions
//! are those of the wire: Hamilton quaternions `[x, y, z, w]`, ICRF to body; pixel (0, 0) is the
//! centre of the first pixel.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod address;
pub mod attitude_list;
mod background;
mod blobs;
pub mod burst;
pub mod can;
pub mod cause;
pub mod console;
pub mod contents;
pub mod control;
pub mod datagram;
pub mod detector;
mod earth;
pub mod event;
mod exchange;
pub mod flight_computer;
pub mod image;
mod join;
mod junit;
pub mod link;
mod links;
pub mod mission;
mod pacing;
pub mod pointing;
pub mod port;
pub mod profile;
mod reader;
pub mod reassembly;
pub mod received;
mod recovery;
pub mod report;
pub mod roles;
pub mod score;
pub mod serial;
mod signal;
pub mod text;
pub mod time;
pub mod times;
pub mod timings;
pub mod udp;
pub mod verdict;
