//! The live run: packets from the wire become vehicle states, rendered frames become packets.
//!
//! `server` drives the parts in `state`, on one thread: receive, deliver, expose. `render_thread`
//! renders on another, and the links have threads of their own. So packets are exchanged during
//! rendering, and a frame is sent while it and the next one are rendered. With the stepped clock,
//! frames are rendered and sent one after the other: such a run depends only on the packets and on
//! the number of frames before.

mod budget;
mod channel;
mod client;
mod clock;
mod commands;
mod delivery;
mod diagnosis;
mod exchange;
mod exposure;
mod followers;
mod frame_job;
mod frame_packets;
mod frame_pool;
mod frame_queue;
mod handlers;
mod history;
mod in_flight;
mod label_timing;
mod late_policy;
mod pack;
mod packet_sizes;
mod reasons;
mod receive;
mod refusal;
mod render_thread;
mod report_log;
mod select;
mod server;
mod session;
mod state;
mod status;
mod telemetry;
mod transmit;

pub use server::{Ended, Server};
pub use telemetry::{OnFrameSent, SentFrame};
