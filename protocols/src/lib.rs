//! Wire formats of skyloop, shared by the emulator and by flight software.
//!
//! `no_std`, no allocation, no dependencies, no `unsafe`. Every byte is described in `docs/icd.md`;
//! `vectors/golden.txt` holds one packet of every kind. Codes, messages, their readers and writers
//! are generated from `schema/packets.toml`; the rules between fields are written by hand. The
//! modules in reading order:
//!
//! 1. [`time`]: the CCSDS time code of every packet.
//! 2. [`packet`]: the space packet around every message: headers, version, CRC.
//! 3. [`command`]: packets of a flight computer. [`reply`]: packets of the emulator.
//! 4. [`output`]: selection of the parts of a frame; [`pixels`]: pixels and labels divided into
//!    packets; [`rice`]: compression of pixels.
//! 5. [`fault`]: injected faults of the line.
//! 6. [`counters`], [`sequence`], [`credit`]: counters and flow control of both ends.
//! 7. [`slip`]: packets on a serial line. [`can`]: packets on a CAN bus. [`crc`]: the checksums.
//! 8. [`personality`]: the table of wire formats.
//!
//! ```
//! use skyloop_protocols::{Command, WireTime, packet::MAX_PACKET};
//!
//! let mut buffer = [0; MAX_PACKET];
//! let length = Command::Ping.encode(7, WireTime(0), &mut buffer)?;
//! let (header, command) = Command::decode(&buffer[..length])?;
//! assert_eq!((header.sequence_count, command), (7, Command::Ping));
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]

mod frame;
#[rustfmt::skip]
mod generated;
mod parts;
mod rules;
mod table;
mod wire;

pub mod can;
pub mod command;
pub mod counters;
pub mod crc;
pub mod credit;
pub mod error;
pub mod fault;
pub mod output;
pub mod packet;
pub mod personality;
pub mod pixels;
pub mod reply;
pub mod rice;
pub mod sequence;
pub mod slip;
pub mod time;

pub use command::{Attitude, Command, OrbitState};
pub use counters::Counters;
pub use error::{DecodeError, EncodeError, Reason};
pub use fault::{Direction, Fault, FaultKind};
pub use output::{LabelLevel, Output, PixelLevel, Positions};
pub use packet::{Header, MAX_PACKET, apid};
pub use personality::{PERSONALITIES, Personality};
pub use reply::{
    Ack, AttitudeSource, Challenge, CompressedBlock, FrameEnd, FrameHeader, LabelPart, Mode, Nack,
    ObjectPart, ObjectRecord, Overrun, Packing, PixelBlock, Reply, Status, SyncState, Timing,
    WindowBlock, Withheld,
};
pub use time::WireTime;
