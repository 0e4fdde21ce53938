//! Ports that lose and reorder packets, or cut them short, both ways, the same ones in every run.

use std::time::Duration;

use skyloop_firmware_sim::port::{Port, PortError};

use super::Noise;

/// Loses, and swaps with the next, each with this probability.
pub struct Lossy<P> {
    port: P,
    noise: Noise,
    loss: f64,
    swap: f64,
    held_out: Option<Vec<u8>>,
    held_in: Option<Vec<u8>>,
    /// What was held and comes next.
    overtaken: Option<Vec<u8>>,
}

impl<P> Lossy<P> {
    pub fn new(port: P, seed: u64, loss: f64, swap: f64) -> Self {
        Self {
            port,
            noise: Noise::new(seed),
            loss,
            swap,
            held_out: None,
            held_in: None,
            overtaken: None,
        }
    }
}

impl<P: Port> Port for Lossy<P> {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        let (lost, swapped) = (
            self.noise.uniform() < self.loss,
            self.noise.uniform() < self.swap,
        );
        if lost {
            return Ok(());
        }
        if swapped && self.held_out.is_none() {
            self.held_out = Some(packet.to_vec());
            return Ok(());
        }
        self.port.send(packet)?;
        match self.held_out.take() {
            Some(held) => self.port.send(&held),
            None => Ok(()),
        }
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        // What no later packet overtakes comes all the same.
        if let Some(held) = self.held_out.take() {
            self.port.send(&held)?;
        }
        if let Some(held) = self.overtaken.take() {
            return Ok(Some(held));
        }
        loop {
            let Some(packet) = self.port.recv(timeout)? else {
                return Ok(self.held_in.take());
            };
            if self.noise.uniform() < self.loss {
                continue;
            }
            if self.held_in.is_none() && self.noise.uniform() < self.swap {
                self.held_in = Some(packet);
                continue;
            }
            self.overtaken = self.held_in.take();
            return Ok(Some(packet));
        }
    }
}

/// Cuts packets short, each with this probability, to any length.
pub struct Truncating<P> {
    port: P,
    noise: Noise,
    probability: f64,
}

impl<P> Truncating<P> {
    pub fn new(port: P, seed: u64, probability: f64) -> Self {
        Self {
            port,
            noise: Noise::new(seed),
            probability,
        }
    }

    fn cut<'a>(&mut self, packet: &'a [u8]) -> &'a [u8] {
        if self.noise.uniform() >= self.probability {
            return packet;
        }
        let most = packet.len() - 1;
        &packet[..1 + (self.noise.uniform() * most as f64) as usize]
    }
}

impl<P: Port> Port for Truncating<P> {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        let packet = self.cut(packet);
        self.port.send(packet)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        let packet = self.port.recv(timeout)?;
        Ok(packet.map(|packet| self.cut(&packet).to_vec()))
    }
}
