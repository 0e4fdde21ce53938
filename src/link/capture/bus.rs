//! Recording of a CAN bus: frames as the link reads and sends them.

use super::Recorder;
use skyloop_firmware_sim::can::{CanBus, Sending};
use skyloop_protocols::Direction;
use skyloop_protocols::can::CanFrame;
use std::io;
use std::time::{Duration, Instant};

struct TappedBus {
    bus: Box<dyn CanBus>,
    recorder: Recorder,
}

impl Recorder {
    /// Records what is read from an open bus and sent on it.
    pub fn around(&self, bus: Box<dyn CanBus>) -> Box<dyn CanBus> {
        Box::new(TappedBus {
            bus,
            recorder: self.clone(),
        })
    }
}

impl CanBus for TappedBus {
    fn send(&mut self, frame: &CanFrame) -> io::Result<Sending> {
        let now = Instant::now();
        let sending = self.bus.send(frame)?;
        if sending == Sending::Sent {
            self.recorder.frame(now, Direction::Out, frame);
        }
        Ok(sending)
    }

    fn recv(&mut self, timeout: Duration) -> io::Result<Option<CanFrame>> {
        let frame = self.bus.recv(timeout)?;
        if let Some(frame) = &frame {
            self.recorder.frame(Instant::now(), Direction::In, frame);
        }
        Ok(frame)
    }

    fn share(&self) -> io::Result<Box<dyn CanBus>> {
        Ok(self.recorder.around(self.bus.share()?))
    }

    fn restart(&mut self) -> io::Result<Sending> {
        self.bus.restart()
    }

    fn garbled(&mut self) -> u32 {
        self.bus.garbled()
    }
}
