//! A port on a slow line to the flight computer, with one interruption.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use skyloop_firmware_sim::port::{Port, PortError};

/// Delivers packets one after the other; the emulator's queue is in front of it.
pub struct Slow<P> {
    port: P,
    airtime: Duration,
    /// Number of packets before the interruption, and its duration.
    interruption: (usize, Duration),
    queue: VecDeque<Vec<u8>>,
    /// Arrival time of the first packet, or the time when the line became free.
    due: Instant,
    arrived: usize,
}

impl<P> Slow<P> {
    pub fn new(port: P, airtime: Duration, interruption: (usize, Duration)) -> Self {
        Self {
            port,
            airtime,
            interruption,
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
                if self.arrived == self.interruption.0 {
                    self.due += self.interruption.1;
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
