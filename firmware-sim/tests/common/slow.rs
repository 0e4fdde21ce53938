//! A port on a line that takes its time for each packet to the flight computer, and rests once on the way.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use skyloop_firmware_sim::port::{Port, PortError};

/// Brings packets one after the other; the emulator's queue lies before it.
pub struct Slow<P> {
    port: P,
    /// Time on the line of each packet.
    airtime: Duration,
    /// How many packets come before the rest, and how long that is.
    rest: (usize, Duration),
    /// Packets under way.
    queue: VecDeque<Vec<u8>>,
    /// When the first of them arrives, or when the line was free.
    due: Instant,
    arrived: usize,
}

impl<P> Slow<P> {
    pub fn new(port: P, airtime: Duration, rest: (usize, Duration)) -> Self {
        Self {
            port,
            airtime,
            rest,
            queue: VecDeque::new(),
            due: Instant::now(),
            arrived: 0,
        }
    }
}

impl<P: Port> Port for Slow<P> {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        self.port.send(packet)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        let deadline = Instant::now() + timeout;
        loop {
            let now = Instant::now();
            let next = if self.queue.is_empty() {
                deadline
            } else {
                self.due.min(deadline)
            };
            if let Some(packet) = self.port.recv(next.saturating_duration_since(now))? {
                if self.queue.is_empty() {
                    self.due = self.due.max(Instant::now()) + self.airtime;
                }
                self.queue.push_back(packet);
            } else if self.due <= Instant::now()
                && let Some(packet) = self.queue.pop_front()
            {
                self.arrived += 1;
                if self.arrived == self.rest.0 {
                    self.due += self.rest.1;
                }
                if !self.queue.is_empty() {
                    self.due += self.airtime;
                }
                return Ok(Some(packet));
            } else if deadline <= Instant::now() {
                return Ok(None);
            }
        }
    }
}
