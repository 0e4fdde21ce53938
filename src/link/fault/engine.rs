//! The fault engine of one direction, without a clock or a wire of its own.

use super::injection::{Event, Injection};
use super::item_state::{ItemState, ORDER, is_loss};
use super::line::{Line, Order};
use super::rule::Rule;
use super::stopped::{LastingEffects, Shape};
use skyloop_protocols::{Direction, Fault, FaultKind, MAX_PACKET};
use std::time::Duration;

/// A packet or CAN frame that faults can affect.
pub(super) trait Damageable: Clone {
    /// Its bytes; `None` if it is never affected.
    fn bytes(&self) -> Option<&[u8]>;
    /// The same item with other bytes, at most as many.
    fn with_bytes(self, bytes: Vec<u8>) -> Self;
    /// Its description in the log: members of a JSON object.
    fn members(&self) -> String;
    /// Shape of the packet that starts with this item; `bytes` is the length of the item.
    fn packet(&self, bytes: usize) -> Shape {
        Shape::one(bytes)
    }
    /// Shape of the longest packet.
    fn longest(&self) -> Shape {
        self.packet(MAX_PACKET)
    }
}

/// Result of a push.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Pushed {
    /// The item will leave, perhaps damaged.
    Taken,
    /// The item is lost to a fault of this kind.
    Lost(FaultKind),
    /// The delay line is full.
    Full,
}

/// The faults of one direction. All times count from the engine's zero; `now` never decreases.
pub(super) struct Faults<T> {
    direction: Direction,
    rules: Vec<Rule>,
    line: Line<T>,
    /// Number of items so far.
    number: u64,
    /// Number of live faults so far.
    live: u32,
    injected: Vec<Injection>,
    lasting: LastingEffects,
}

impl<T: Damageable> Faults<T> {
    /// The rules of `direction` out of `rules`.
    pub fn new(direction: Direction, rules: &[Rule]) -> Faults<T> {
        let own = |rule: &&Rule| rule.fault.direction == direction;
        Faults {
            direction,
            rules: rules.iter().filter(own).cloned().collect(),
            line: Line::new(),
            number: 0,
            live: 0,
            injected: Vec::new(),
            lasting: LastingEffects::default(),
        }
    }

    /// Replaces the active faults of the same kind by `fault`; value 0 only ends them.
    pub fn switch(&mut self, fault: Fault, now: Duration) {
        self.turn(now);
        let same = |rule: &&mut Rule| rule.fault.kind == fault.kind && rule.is_on(now);
        for rule in self.rules.iter_mut().filter(same) {
            rule.until = Some(now);
        }
        if fault.value > 0.0 {
            self.rules.push(Rule::live(fault, now, self.live));
            self.live = self.live.wrapping_add(1);
        }
        self.turn(now);
    }

    /// Adds an item and applies the active faults.
    pub fn push(&mut self, item: T, now: Duration) -> Pushed {
        self.turn(now);
        if !self.has_room() {
            return Pushed::Full;
        }
        let Some(bytes) = item.bytes().map(<[u8]>::to_vec) else {
            self.line.put(item, now, Order::Sequential);
            return Pushed::Taken;
        };
        self.observe(&item, now);
        let number = self.number;
        self.number += 1;
        let mut state = ItemState::of(bytes.clone());
        for kind in ORDER {
            let on = |rule: &&mut Rule| rule.fault.kind == kind && rule.is_on(now);
            for rule in self.rules.iter_mut().filter(on) {
                let Some(damage) = state.apply(rule) else {
                    continue;
                };
                self.injected.push(Injection {
                    at: now,
                    direction: self.direction,
                    kind,
                    event: Event::Item {
                        number,
                        length: bytes.len(),
                        members: item.members(),
                        damage,
                    },
                });
                if is_loss(kind) {
                    return Pushed::Lost(kind);
                }
            }
        }
        let due = now + state.later;
        let item = if state.bytes == bytes {
            item
        } else {
            item.with_bytes(state.bytes)
        };
        if state.twice {
            self.line.put(item.clone(), due, state.order);
        }
        self.line.put(item, due, state.order);
        Pushed::Taken
    }

    /// Adds an item that no fault affects. Delayed items before it still leave first.
    pub fn pass(&mut self, item: T, now: Duration) -> Pushed {
        self.turn(now);
        if !self.has_room() {
            return Pushed::Full;
        }
        self.number += 1;
        self.line.put(item, now, Order::Sequential);
        Pushed::Taken
    }

    pub fn pop_due(&mut self, now: Duration) -> Option<T> {
        self.turn(now);
        self.line.pop_due(now)
    }

    /// When to poll again: an item leaves, or a rule begins or ends.
    pub fn next_due(&self) -> Option<Duration> {
        let turns = self.rules.iter().filter_map(Rule::next_turn);
        self.line.next_due().into_iter().chain(turns).min()
    }

    /// Whether another item and its duplicate fit.
    pub fn has_room(&self) -> bool {
        self.line.room() >= 2
    }

    pub fn line(&self) -> &Line<T> {
        &self.line
    }

    /// Takes the injections since the last call.
    pub fn injected(&mut self) -> Vec<Injection> {
        std::mem::take(&mut self.injected)
    }

    /// Counts the effect of lasting faults on an item, accepted or not.
    pub fn observe(&mut self, item: &T, now: Duration) {
        if let Some(bytes) = item.bytes().map(<[u8]>::len) {
            let (packet, longest) = (item.packet(bytes), item.longest());
            self.lasting.observe(&self.rules, packet, longest, now);
        }
    }

    /// Takes the effects of lasting faults since the last call.
    pub fn lasting(&mut self) -> LastingEffects {
        std::mem::take(&mut self.lasting)
    }

    /// Records the rules that have begun or ended by `now`.
    pub fn turn(&mut self, now: Duration) {
        for rule in &mut self.rules {
            while let Some((at, ends)) = rule.take_turn(now) {
                self.injected.push(Injection {
                    at,
                    direction: self.direction,
                    kind: rule.fault.kind,
                    event: if ends {
                        Event::Ends
                    } else {
                        Event::Begins(rule.fault.value)
                    },
                });
            }
        }
        self.rules.retain(|rule| !rule.is_over());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::injection::Damage;

    impl Damageable for Vec<u8> {
        fn bytes(&self) -> Option<&[u8]> {
            // An empty one stands for an item that is no packet.
            (!self.is_empty()).then_some(self)
        }

        fn with_bytes(self, bytes: Vec<u8>) -> Vec<u8> {
            bytes
        }

        fn members(&self) -> String {
            String::new()
        }
    }

    const LENGTH: usize = 126;

    fn fault(kind: FaultKind, value: f64, seconds: f64) -> Fault {
        let direction = Direction::In;
        Fault {
            kind,
            direction,
            value,
            seconds,
        }
    }

    fn always(kind: FaultKind, value: f64, seed: u64) -> Rule {
        Rule::new(fault(kind, value, 0.0), seed, 0, Duration::ZERO, None)
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    /// Item `i`: its number in every pair of bytes.
    fn item(i: u16) -> Vec<u8> {
        i.to_be_bytes().repeat(LENGTH / 2)
    }

    /// Pushes `n` items, one per millisecond: items out, injections, losses.
    fn run(rules: &[Rule], n: u16) -> (Vec<Vec<u8>>, Vec<Injection>, Vec<FaultKind>) {
        let mut faults = Faults::new(Direction::In, rules);
        let (mut out, mut lost) = (Vec::new(), Vec::new());
        for i in 0..n {
            let now = ms(u64::from(i));
            match faults.push(item(i), now) {
                Pushed::Taken => {}
                Pushed::Lost(kind) => lost.push(kind),
                Pushed::Full => panic!("the line is full"),
            }
            out.extend(std::iter::from_fn(|| faults.pop_due(now)));
        }
        out.extend(std::iter::from_fn(|| faults.pop_due(ms(1_000_000))));
        (out, faults.injected(), lost)
    }

    /// Kinds of damage.
    fn damages(injected: &[Injection]) -> impl Iterator<Item = &Damage> {
        injected.iter().filter_map(|one| match &one.event {
            Event::Item { damage, .. } => Some(damage),
            _ => None,
        })
    }

    /// Whether `count` of `n` trials fits `probability` within five standard errors.
    fn fits(count: usize, n: usize, probability: f64) -> bool {
        let mean = n as f64 * probability;
        (count as f64 - mean).abs() < 5.0 * (mean * (1.0 - probability)).sqrt()
    }

    #[test]
    fn losses_have_their_probability_and_are_logged() {
        for (kind, probability, n) in [
            (FaultKind::Drop, 0.05, 20_000),
            (FaultKind::Overrun, 0.05, 20_000),
            (FaultKind::Stuck, 1.0, 50),
            (FaultKind::Down, 1.0, 50),
            (FaultKind::BusOff, 1.0, 50),
        ] {
            let (out, injected, lost) = run(&[always(kind, probability, 7)], n);
            let fits = probability == 1.0 || fits(lost.len(), n.into(), probability);
            assert!(fits, "{kind:?}: {}", lost.len());
            assert_eq!(out.len() + lost.len(), usize::from(n), "{kind:?}");
            assert_eq!(damages(&injected).count(), lost.len(), "{kind:?}");
            assert!(lost.iter().all(|one| *one == kind), "{kind:?}");
            assert_eq!(out.is_empty(), probability == 1.0, "{kind:?}");
        }
    }

    #[test]
    fn bit_flips_have_their_probability_at_all_positions() {
        const N: u16 = 10_000;
        let (out, injected, _) = run(&[always(FaultKind::BitFlips, 1e-3, 3)], N);
        let mut positions = [0_usize; 8 * LENGTH];
        for (i, damaged) in (0..N).zip(&out) {
            for (byte, (is, was)) in damaged.iter().zip(item(i)).enumerate() {
                for bit in (0..8).filter(|bit| (is ^ was) & (0x80 >> bit) != 0) {
                    positions[8 * byte + bit] += 1;
                }
            }
        }
        let all: usize = positions.iter().sum();
        assert!(fits(all, positions.len() * usize::from(N), 1e-3), "{all}");
        // Chi-square of n positions: mean n, standard deviation sqrt(2 n).
        let expected = f64::from(N) * 1e-3;
        let chi2 = positions.map(|n| (n as f64 - expected).powi(2) / expected);
        let (chi2, n) = (chi2.iter().sum::<f64>(), positions.len() as f64);
        assert!((chi2 - n).abs() < 5.0 * (2.0 * n).sqrt(), "{chi2}");
        // The log lists each of them.
        let logged = damages(&injected).map(|damage| match damage {
            Damage::Bits(bits) => bits.len(),
            other => panic!("{other:?}"),
        });
        assert_eq!(logged.sum::<usize>(), all);
        let (out, ..) = run(&[always(FaultKind::BitFlips, 1.0, 3)], 2);
        assert!(out[1].iter().zip(item(1)).all(|(is, was)| *is == !was));
    }

    #[test]
    fn duplicates_truncations_and_swaps() {
        let (out, ..) = run(&[always(FaultKind::Duplicate, 1.0, 1)], 3);
        assert_eq!(out, [0, 0, 1, 1, 2, 2].map(item));
        let (out, injected, _) = run(&[always(FaultKind::Truncate, 1.0, 1)], 2000);
        let lengths = || out.iter().map(Vec::len);
        assert_eq!(
            (lengths().min(), lengths().max()),
            (Some(1), Some(LENGTH - 1))
        );
        assert!(out.iter().zip(0..).all(|(cut, i)| item(i).starts_with(cut)));
        assert_eq!(damages(&injected).count(), 2000);
        let (out, injected, _) = run(&[always(FaultKind::Reorder, 0.2, 1)], 2000);
        let number = |item: &Vec<u8>| u16::from_be_bytes([item[0], item[1]]);
        let mut numbers: Vec<u16> = out.iter().map(number).collect();
        let swapped = numbers.windows(2).filter(|pair| pair[1] < pair[0]).count();
        // The second of two hits in a row overtakes the first: 0.2 / 1.2 of all are swapped.
        assert!(fits(swapped, 2000, 0.2 / 1.2), "{swapped}");
        assert!(fits(damages(&injected).count(), 2000, 0.2));
        numbers.sort_unstable();
        assert!(numbers.into_iter().eq(0..2000), "none is lost");
    }

    #[test]
    fn delay_preserves_the_order_and_jitter_does_not() {
        let rules = [always(FaultKind::Delay, 0.02, 1)];
        let mut faults = Faults::new(Direction::In, &rules);
        assert_eq!(faults.push(item(1), ms(5)), Pushed::Taken);
        assert_eq!(faults.next_due(), Some(ms(25)));
        assert_eq!((faults.pop_due(ms(24)), faults.line().len()), (None, 1));
        assert_eq!(faults.pop_due(ms(25)), Some(item(1)));
        let (out, injected, _) = run(&[always(FaultKind::Jitter, 0.02, 1)], 1000);
        let late = damages(&injected).map(|damage| match damage {
            Damage::Later(by) => by.as_secs_f64(),
            other => panic!("{other:?}"),
        });
        let late: Vec<f64> = late.collect();
        let mean = late.iter().sum::<f64>() / 1000.0;
        // Uniform: standard deviation 20 ms / sqrt(12).
        assert!((mean - 0.01).abs() < 5.0 * 0.02 / 12f64.sqrt() / 1000f64.sqrt());
        assert!(late.iter().all(|by| (0.0..0.02).contains(by)));
        assert!(out.into_iter().ne((0..1000).map(item)));
    }

    #[test]
    fn a_run_repeats_with_its_seed_and_differs_with_another() {
        let run = |seed| {
            let faults = [
                (FaultKind::Drop, 0.05),
                (FaultKind::BitFlips, 1e-4),
                (FaultKind::Jitter, 0.01),
            ];
            run(&faults.map(|(kind, value)| always(kind, value, seed)), 500)
        };
        assert_eq!(run(5), run(5));
        assert_ne!(run(5).0, run(6).0);
    }

    #[test]
    fn rules_begin_and_end_on_time() {
        let from = Duration::from_micros(10_500);
        let rule = Rule::new(fault(FaultKind::Down, 1.0, 0.0), 1, 0, from, Some(ms(20)));
        let (out, mut injected, lost) = run(&[rule], 30);
        // Items of 11 to 19 ms are lost.
        assert_eq!((out.len(), lost.len()), (21, 9));
        injected.retain(|injection| !matches!(injection.event, Event::Item { .. }));
        let turns: Vec<_> = injected
            .into_iter()
            .map(|one| (one.at, one.event))
            .collect();
        assert_eq!(turns, [(from, Event::Begins(1.0)), (ms(20), Event::Ends)]);
    }

    #[test]
    fn live_faults_replace_faults_of_their_kind() {
        let mut faults = Faults::new(Direction::In, &[always(FaultKind::Drop, 1.0, 1)]);
        assert_eq!(faults.push(item(0), ms(0)), Pushed::Lost(FaultKind::Drop));
        faults.switch(fault(FaultKind::Drop, 0.0, 0.0), ms(1));
        assert_eq!(faults.push(item(1), ms(1)), Pushed::Taken);
        faults.switch(fault(FaultKind::Down, 1.0, 0.005), ms(2));
        assert_eq!(faults.push(item(2), ms(6)), Pushed::Lost(FaultKind::Down));
        assert_eq!(faults.push(item(3), ms(7)), Pushed::Taken, "it has ended");
    }

    #[test]
    fn items_without_bytes_are_unaffected_and_stay_in_order() {
        let mut faults = Faults::new(Direction::In, &[always(FaultKind::Delay, 0.02, 1)]);
        faults.push(item(1), ms(0));
        faults.push(Vec::new(), ms(1));
        faults.switch(fault(FaultKind::Drop, 1.0, 0.0), ms(1));
        faults.push(Vec::new(), ms(2));
        assert_eq!(faults.pop_due(ms(19)), None);
        let out: Vec<_> = std::iter::from_fn(|| faults.pop_due(ms(20))).collect();
        assert_eq!(out, [item(1), vec![], vec![]]);
    }

    #[test]
    fn full_line_accepts_nothing() {
        let mut faults = Faults::new(Direction::In, &[always(FaultKind::Delay, 1.0, 1)]);
        let taken = (0..).take_while(|i| faults.push(item(*i), ms(0)) == Pushed::Taken);
        // One position is reserved for a duplicate.
        assert_eq!(taken.count(), super::super::line::CAPACITY - 1);
        assert_eq!(faults.push(item(9), ms(0)), Pushed::Full);
        assert_eq!(faults.pop_due(ms(1000)), Some(item(0)));
        assert_eq!(faults.push(item(9), ms(1000)), Pushed::Taken);
    }
}
