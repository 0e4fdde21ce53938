//! A port that loses, reorders and truncates packets both ways, reproducibly.

use std::time::Duration;

use skyloop_firmware_sim::port::{Port, PortError};

use super::Noise;

/// Loses packets, swaps them with the next one, or truncates them to any length, each with its
/// probability.
pub struct Lossy<P> {
    port: P,
    noise: Noise,
    loss: f64,
    swap: f64,
    cut: f64,
    held_out: Option<Vec<u8>>,
    held_in: Option<Vec<u8>>,
    /// A swapped packet, due next.
    due: Option<Vec<u8>>,
}

impl<P> Lossy<P> {
    pub fn new(port: P, seed: u64, [loss, swap, cut]: [f64; 3]) -> Self {
        Self {
            port,
            noise: Noise::new(seed),
            loss,
            swap,
            cut,
            held_out: None,
            held_in: None,
            due: None,
        }
    }

    fn happens(&mut self, probability: f64) -> bool {
        self.noise.uniform() < probability
    }

    fn cut<'a>(&mut self, packet: &'a [u8]) -> &'a [u8] {
        if !self.happens(self.cut) {
            return packet;
        }
        let max = packet.len().saturating_sub(1);
        &packet[..1 + (self.noise.uniform() * max as f64) as usize]
    }
}

impl<P: Port> Port for Lossy<P> {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        let (lost, swapped) = (self.happens(self.loss), self.happens(self.swap));
        let packet = self.cut(packet);
        if lost {
            return Ok(());
        }
        if swapped && self.held_out.is_none() {
            self.held_out = Some(packet.to_vec());
            return Ok(());
        }
        self.port.send(packet)?;
        let held = self.held_out.take();
        held.map_or(Ok(()), |held| self.port.send(&held))
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        // A swapped packet is sent even without a later one.
        if let Some(held) = self.held_out.take() {
            self.port.send(&held)?;
        }
        if let Some(held) = self.due.take() {
            return Ok(Some(held));
        }
        loop {
            let Some(packet) = self.port.recv(timeout)? else {
                return Ok(self.held_in.take());
            };
            if self.happens(self.loss) {
                continue;
            }
            let packet = self.cut(&packet).to_vec();
            if self.held_in.is_none() && self.happens(self.swap) {
                self.held_in = Some(packet);
                continue;
            }
            self.due = self.held_in.take();
            return Ok(Some(packet));
        }
    }
}
