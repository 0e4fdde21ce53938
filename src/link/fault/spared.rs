//! Answers to commands that switch faults pass all faults, so that a client learns the result.

use skyloop_protocols::packet::{apid, identify};
use skyloop_protocols::{Personality, Reply};
use std::collections::VecDeque;

/// Commands whose answer is remembered at once; of more, the oldest are forgotten.
const MAX: usize = 64;

/// Commands that have passed and whose answer has not: APID and sequence count.
#[derive(Debug, Default)]
pub(super) struct Spared(VecDeque<(u16, u16)>);

impl Spared {
    /// A command has passed: the next answer to it is spared.
    pub fn remember(&mut self, apid: u16, count: u16) {
        if self.0.len() >= MAX {
            self.0.pop_front();
        }
        self.0.push_back((apid, count));
    }

    /// Whether a packet is the answer to such a command.
    pub fn is_spared(&mut self, personality: &Personality, packet: Option<&[u8]>) -> bool {
        let answers = |packet: &&[u8]| {
            identify(packet).is_some_and(|(kind, _)| matches!(kind, apid::ACK | apid::NACK))
        };
        let Some(packet) = packet.filter(|packet| !self.0.is_empty() && answers(packet)) else {
            return false;
        };
        match (personality.decode_reply)(packet) {
            Ok((_, Reply::Ack(ack))) => self.is_answered(ack.apid, ack.sequence_count),
            Ok((_, Reply::Nack(nack))) => self.is_answered(nack.apid, nack.sequence_count),
            _ => false,
        }
    }

    /// Whether a command waits for its answer, which this is.
    pub fn is_answered(&mut self, apid: u16, count: u16) -> bool {
        let place = self.0.iter().position(|known| *known == (apid, count));
        place.and_then(|place| self.0.remove(place)).is_some()
    }
}
