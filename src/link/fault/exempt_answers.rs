//! No fault affects answers to commands that switch faults, so that a client gets the result.

use skyloop_protocols::packet::{apid, identify};
use skyloop_protocols::{Personality, Reply};
use std::collections::VecDeque;

/// Maximum number of stored commands; beyond it the oldest are dropped.
const MAX: usize = 64;

/// Commands without an answer yet: APID and sequence count.
#[derive(Debug, Default)]
pub(super) struct ExemptAnswers(VecDeque<(u16, u16)>);

impl ExemptAnswers {
    /// Adds a command: the next answer to it is exempt.
    pub fn add(&mut self, apid: u16, count: u16) {
        if self.0.len() >= MAX {
            self.0.pop_front();
        }
        self.0.push_back((apid, count));
    }

    /// Whether a packet is the answer to such a command.
    pub fn is_exempt(&mut self, personality: &Personality, packet: Option<&[u8]>) -> bool {
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

    /// Whether this is the answer to a stored command, which is removed.
    pub fn is_answered(&mut self, apid: u16, count: u16) -> bool {
        let index = self.0.iter().position(|known| *known == (apid, count));
        index.and_then(|index| self.0.remove(index)).is_some()
    }
}
