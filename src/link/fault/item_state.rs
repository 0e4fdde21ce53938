//! Effect of one rule on one item.

use super::injection::Damage;
use super::line::Order;
use super::rule::Rule;
use skyloop_base::rng::PixelStream;
use skyloop_protocols::FaultKind;
use std::time::Duration;

/// Order of application: faults of the line, then delays, then faults of the receiver.
pub(super) const ORDER: [FaultKind; 11] = [
    FaultKind::BusOff,
    FaultKind::Down,
    FaultKind::Stuck,
    FaultKind::Drop,
    FaultKind::Truncate,
    FaultKind::BitFlips,
    FaultKind::Duplicate,
    FaultKind::Delay,
    FaultKind::Jitter,
    FaultKind::Reorder,
    FaultKind::Overrun,
];

/// An item to which rules are applied.
pub(super) struct ItemState {
    pub bytes: Vec<u8>,
    pub later: Duration,
    pub twice: bool,
    pub order: Order,
}

impl ItemState {
    pub fn of(bytes: Vec<u8>) -> ItemState {
        ItemState {
            bytes,
            later: Duration::ZERO,
            twice: false,
            order: Order::Sequential,
        }
    }

    /// Applies one rule; returns the damage, if any.
    pub fn apply(&mut self, rule: &mut Rule) -> Option<Damage> {
        let mut random = rule.draw();
        let value = rule.fault.value;
        let is_hit = random.uniform() < value;
        match rule.fault.kind {
            FaultKind::BitFlips => {
                let bits = flips(&mut random, value, 8 * self.bytes.len());
                for bit in &bits {
                    self.bytes[bit / 8] ^= 0x80 >> (bit % 8);
                }
                return (!bits.is_empty()).then_some(Damage::Bits(bits));
            }
            FaultKind::Delay => {
                let later = Duration::from_secs_f64(value);
                self.later += later;
                return Some(Damage::Later(later));
            }
            FaultKind::Jitter => {
                let later = Duration::from_secs_f64(value * random.uniform());
                self.later += later;
                self.order = Order::Free;
                return Some(Damage::Later(later));
            }
            _ if !is_hit => return None,
            FaultKind::Truncate => {
                let max_length = self.bytes.len().saturating_sub(1).max(1);
                let left = 1 + (random.uniform() * max_length as f64) as usize;
                self.bytes.truncate(left.min(max_length));
                return Some(Damage::CutTo(self.bytes.len()));
            }
            FaultKind::Duplicate => self.twice = true,
            FaultKind::Reorder => self.order = Order::Swapped,
            // All other kinds lose the item (`is_loss`).
            _ => {}
        }
        Some(Damage::ByKind)
    }
}

pub(super) fn is_loss(kind: FaultKind) -> bool {
    use FaultKind::{BusOff, Down, Drop, Overrun, Stuck};
    matches!(kind, BusOff | Down | Stuck | Drop | Overrun)
}

pub(super) fn is_damage(kind: FaultKind) -> bool {
    matches!(kind, FaultKind::Truncate | FaultKind::BitFlips)
}

/// Indices of the inverted bits, each with `probability`. The gaps are geometric (Devroye 1986,
/// X.2), so one draw per inverted bit is enough.
fn flips(random: &mut PixelStream, probability: f64, bits: usize) -> Vec<usize> {
    if probability >= 1.0 {
        return (0..bits).collect();
    }
    if probability <= 0.0 {
        return Vec::new();
    }
    let mut found = Vec::new();
    let mut next = 0.0;
    loop {
        next += libm::floor(libm::log(random.uniform()) / libm::log1p(-probability));
        if next >= bits as f64 {
            return found;
        }
        found.push(next as usize);
        next += 1.0;
    }
}
