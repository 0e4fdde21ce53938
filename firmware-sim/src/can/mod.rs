//! CAN buses for both ends of the cable: SocketCAN, or a LAWICEL-style adapter on a serial line.
//!
//! 1. [`CanBus`]: the interface of a bus, implemented by [`socket`] and [`slcan`].
//! 2. [`settings`]: a bus by its address. [`pacing`]: the spacing of its frames.
//! 3. [`carrier`]: threads between a bus and whole packets. [`port`]: the flight computer's end.

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

/// Result of sending a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sending {
    /// The bus has accepted the frame.
    Sent,
    /// The transmit queue is full: offer the same frame again later.
    Full,
}

/// A bus. Errors of its methods mean that the bus is gone. Errors on the bus arrive as frames with
/// [`CanFrame::error`].
pub trait CanBus: Send {
    /// Sends a frame; blocks only briefly.
    fn send(&mut self, frame: &CanFrame) -> io::Result<Sending>;

    /// Waits for the next frame, at most for `timeout`.
    fn recv(&mut self, timeout: Duration) -> io::Result<Option<CanFrame>>;

    /// A second handle for another thread. One handle sends, the other receives.
    ///
    /// # Errors
    /// The system gives no second handle.
    fn share(&self) -> io::Result<Box<dyn CanBus>>;

    /// Restarts a controller after [`Trouble::BusOff`], by the handle that sends.
    /// [`Sending::Full`]: try again later. A kernel interface restarts by itself (`restart-ms`).
    fn restart(&mut self) -> io::Result<Sending> {
        Ok(Sending::Sent)
    }

    /// Number of invalid frames since the last call.
    fn garbled(&mut self) -> u32 {
        0
    }
}

/// Reopens a bus.
pub type Opener = Box<dyn FnMut() -> Result<Box<dyn CanBus>, Refusal> + Send>;

/// Opens a bus by its settings.
pub type OpenBus = fn(&Settings) -> Result<Box<dyn CanBus>, Refusal>;

/// Opens a bus; the returned opener reopens it.
///
/// # Errors
/// There is no such bus, or it cannot be opened.
pub fn open(open: OpenBus, settings: &Settings) -> Result<(Box<dyn CanBus>, Opener), Refusal> {
    let bus = open(settings)?;
    let settings = settings.clone();
    Ok((bus, Box::new(move || open(&settings))))
}

/// Meaning of an error frame (Linux: `can/error.h`; the class is in the identifier).
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

    /// The error frame of this kind.
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

    /// Meaning of `frame`, if it is an error frame.
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
