//! The emulator on the wire, with a client based on `skyloop-protocols` alone.

#[path = "../support/flight.rs"]
mod flight;
#[path = "../support/mod.rs"]
mod support;
#[path = "../support/table.rs"]
mod table;

mod abandoned;
mod bad_packets;
mod bus_faults;
#[cfg(unix)]
mod can;
mod content;
mod counted;
mod end;
mod exchange;
mod faults;
mod heads;
mod levels;
mod live;
mod on_can;
mod overrun;
mod pacing;
mod proof;
mod reasons;
mod refusals;
mod replay;
mod replay_on_can;
mod roles;
mod slow_line;
mod steering;
mod unread;
mod withheld;
