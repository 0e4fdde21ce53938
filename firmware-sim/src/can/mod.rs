//! CAN buses for both ends of the cable, through the kernel's SocketCAN or through a LAWICEL-style
//! adapter on a serial line, at the rate of the bus.
//!
//! 1. [`CanBus`]: what a bus can do. [`socket`] and [`slcan`] are the two there are.
//! 2. [`settings`]: what a link's address says about a bus. [`pacing`]: how fast its frames may follow each other.
//! 3. [`carrier`]: the threads between a bus and whole packets. [`port`]: the flight computer's end of them.

pub mod carrier;
pub mod pacing;
pub mod port;
pub mod settings;
pub mod slcan;
pub mod socket;

pub use crate::port::Refusal;
use settings::Settings;
use skyloop_protocols::can::CanFrame;
use skyloop_protocols::can::frame::{MAX_CLASSIC_DATA, MAX_DATA};
use std::io;
use std::time::Duration;

/// What became of a frame that was to be sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sending {
    /// The bus has taken it.
    Sent,
    /// The transmit queue is full: offer the same frame again later.
    Full,
}

/// A bus. Its errors mean that it is gone; errors on the bus come as frames with
/// [`CanFrame::error`].
pub trait CanBus: Send {
    /// Sends a frame, without waiting for long.
    fn send(&mut self, frame: &CanFrame) -> io::Result<Sending>;

    /// Waits for the next frame, `timeout` at most; `None` if none came.
    fn recv(&mut self, timeout: Duration) -> io::Result<Option<CanFrame>>;

    /// The same bus for another thread. One of the two sends, the other receives.
    ///
    /// # Errors
    /// The system gives no second handle.
    fn share(&self) -> io::Result<Box<dyn CanBus>>;

    /// Puts a controller back on the bus after [`Trouble::BusOff`], by the handle that sends.
    /// [`Sending::Full`]: try again later. A kernel's interface restarts by itself (`restart-ms`).
    fn restart(&mut self) -> io::Result<Sending> {
        Ok(Sending::Sent)
    }

    /// What has come since the last call and was no frame.
    fn garbled(&mut self) -> u32 {
        0
    }
}

/// Opens a bus, and opens it again when it has gone.
pub type Opener = Box<dyn FnMut() -> Result<Box<dyn CanBus>, Refusal> + Send>;

/// Opens a bus by its settings.
pub type OpenBus = fn(&Settings) -> Result<Box<dyn CanBus>, Refusal>;

/// Opens a bus now; the opener opens it again.
///
/// # Errors
/// There is no such bus, or it is not to be had.
pub fn open(open: OpenBus, settings: &Settings) -> Result<(Box<dyn CanBus>, Opener), Refusal> {
    let bus = open(settings)?;
    let settings = settings.clone();
    Ok((bus, Box::new(move || open(&settings))))
}

/// What an error frame says of the bus (Linux: `can/error.h`; the class is in the identifier).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trouble {
    /// The controller has left the bus: too many errors.
    BusOff,
    /// The controller is on the bus again.
    Restarted,
    /// Any other error.
    Error,
}

impl Trouble {
    const BUS_OFF: u32 = 0x40;
    const RESTARTED: u32 = 0x100;
    const PROTOCOL: u32 = 0x8;

    /// The error frame that tells it.
    #[must_use]
    pub const fn frame(self) -> CanFrame {
        CanFrame {
            id: match self {
                Trouble::BusOff => Trouble::BUS_OFF,
                Trouble::Restarted => Trouble::RESTARTED,
                Trouble::Error => Trouble::PROTOCOL,
            },
            extended: false,
            fd: false,
            brs: false,
            remote: false,
            error: true,
            len: MAX_CLASSIC_DATA as u8,
            data: [0; MAX_DATA],
        }
    }

    /// What `frame` tells, if it is an error frame.
    #[must_use]
    pub fn of(frame: &CanFrame) -> Option<Trouble> {
        match frame.id {
            _ if !frame.error => None,
            class if class & Trouble::BUS_OFF != 0 => Some(Trouble::BusOff),
            class if class & Trouble::RESTARTED != 0 => Some(Trouble::Restarted),
            _ => Some(Trouble::Error),
        }
    }
}
