//! Detects lasting faults that stop all packets: a client times out before one arrives.

use super::plan::name;
use super::rule::Rule;
use skyloop_protocols::can::isotp::Parameters;
use skyloop_protocols::{Direction, FaultKind};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Below this probability of a packet to pass, a direction counts as stopped. A client repeats a
/// command some 20 times: 2 % of such runs would get one through.
const MIN_CHANCE: f64 = 1e-3;
/// Jitter above which CAN frames, 0.1 to 1 ms apart, arrive in random order.
const MAX_SPACING: Duration = Duration::from_millis(10);

/// Maximum time between the frames of an attitude on CAN (N_Cr).
const MAX_SPREAD: Duration = Duration::from_micros(Parameters::FD.timeout_us);

/// A fault that lasts this much longer counts as endless: the flight computer times out after 30 s
/// without an answer (`TIMEOUT` in `flight`).
const LASTING: Duration = Duration::from_secs(30);

/// A fault that stops all packets.
#[derive(Debug, Clone, PartialEq)]
pub struct Stop {
    /// Its kind and direction, such as `stuck, out`.
    pub fault: String,
    /// Number of affected packets.
    pub packets: u64,
    /// Its remaining time when the last of them came; `None`: it has no end.
    pub lasts: Option<Duration>,
}

/// The fault that stops one direction: its kind and remaining time.
type Cause = (FaultKind, Option<Duration>);

/// Requirements of a client to get frames.
#[derive(Debug, Clone, Copy)]
pub struct Needs {
    /// Maximum sum of the delays in both directions.
    pub timeout: Duration,
    /// Whether each frame has packets of maximum length.
    pub long_packets: bool,
}

/// Effects of lasting faults on the items of one direction, since they were last taken.
#[derive(Debug, Default)]
pub(super) struct LastingEffects {
    /// Main cause and number of stopped items. The first entry is for the packet of each item, the
    /// second for a packet of maximum length in its place.
    lost: [Option<(Cause, u64)>; 2],
    late: Late,
}

/// Mean delay of items, their number, and its main cause.
type Late = (Duration, u64, Option<Cause>);

/// Mean delay by a fault, s: jitter is uniform from 0 to its value.
fn late_s(rule: &Rule) -> f64 {
    match rule.fault.kind {
        FaultKind::Delay => rule.fault.value,
        FaultKind::Jitter => rule.fault.value / 2.0,
        _ => 0.0,
    }
}

impl LastingEffects {
    /// Adds an item that arrives at `now` under `rules`.
    pub fn observe(&mut self, rules: &[Rule], item: Shape, longest: Shape, now: Duration) {
        let lasts = |rule: &Rule| rule.until.map(|until| until.saturating_sub(now));
        let is_endless = |rule: &&Rule| lasts(rule).is_none_or(|lasts| lasts >= LASTING);
        let endless = rules
            .iter()
            .filter(|rule| rule.is_on(now))
            .filter(is_endless);
        let mean_s: f64 = endless.clone().map(late_s).sum();
        if mean_s > 0.0 {
            let latest = |a: &&Rule, b: &&Rule| late_s(a).total_cmp(&late_s(b));
            let largest = endless.clone().max_by(latest);
            let cause = largest.map(|rule| (rule.fault.kind, lasts(rule)));
            self.late = (Duration::from_secs_f64(mean_s), self.late.1 + 1, cause);
        }
        for (shape, lost) in [item, longest].into_iter().zip(&mut self.lost) {
            let chances = endless
                .clone()
                .map(|rule| (chance(rule, shape), (rule.fault.kind, lasts(rule))));
            let all: f64 = chances.clone().map(|(chance, _)| chance).product();
            let smallest = chances.min_by(|a, b| a.0.total_cmp(&b.0));
            if let (true, Some((_, cause))) = (all < MIN_CHANCE, smallest) {
                *lost = Some((cause, lost.map_or(0, |(_, count)| count) + 1));
            }
        }
    }
}

/// Number and length of the items of a packet.
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    /// Number of items; on CAN: frames.
    pub items: usize,
    /// Bytes of each.
    pub bytes: usize,
    /// Whether they must arrive once and in order, as in ISO-TP (ISO 15765-2, 9.8.3). Others must
    /// arrive within `MAX_SPREAD`.
    pub in_order: bool,
}

impl Shape {
    /// A packet in one item.
    pub fn one(bytes: usize) -> Shape {
        Shape {
            items: 1,
            bytes,
            in_order: true,
        }
    }
}

/// Probability that a packet passes a rule undamaged.
fn chance(rule: &Rule, packet: Shape) -> f64 {
    let (value, n) = (rule.fault.value, packet.items as f64);
    match rule.fault.kind {
        FaultKind::Stuck | FaultKind::Down | FaultKind::BusOff => 0.0,
        FaultKind::Drop | FaultKind::Overrun | FaultKind::Truncate => libm::pow(1.0 - value, n),
        FaultKind::BitFlips => libm::pow(1.0 - value, 8.0 * packet.bytes as f64 * n),
        FaultKind::Duplicate | FaultKind::Reorder if packet.in_order => {
            libm::pow(1.0 - value, n - 1.0)
        }
        // n items in random order are in order with probability 1 / n!.
        FaultKind::Jitter if packet.in_order && value > MAX_SPACING.as_secs_f64() => {
            1.0 / libm::tgamma(n + 1.0)
        }
        // All other items must arrive within `MAX_SPREAD` before or after the first.
        FaultKind::Jitter if !packet.in_order => {
            let chance = (2.0 * MAX_SPREAD.as_secs_f64() / value).min(1.0);
            libm::pow(chance, n - 1.0)
        }
        _ => 1.0,
    }
}

/// Packets affected by a fault.
#[derive(Debug, Clone, Copy)]
struct Affected {
    packets: u64,
    /// Arrival of the last of them.
    at: Instant,
    /// Remaining time of the fault then; `None`: it has no end.
    lasts: Option<Duration>,
}

impl Affected {
    /// Whether the last of them came after `since`, and the fault is active at `now`.
    fn counts(&self, since: Instant, now: Instant) -> bool {
        let ended = |lasts| now.saturating_duration_since(self.at) >= lasts;
        self.at > since && !self.lasts.is_some_and(ended)
    }
}

/// Stopped packets of both directions.
#[derive(Debug, Default)]
pub(super) struct Stopped {
    /// By length (maximum: true), direction (out: true) and kind.
    lost: BTreeMap<(bool, bool, &'static str), Affected>,
    /// Mean delay of packets in and out, and its main cause.
    late: [Option<(Duration, FaultKind, Affected)>; 2],
}

impl Stopped {
    /// Adds the effects on one direction.
    pub fn add(&mut self, direction: Direction, seen: LastingEffects) {
        let out = direction == Direction::Out;
        let affected = |before: u64, count, lasts| Affected {
            packets: before + count,
            at: Instant::now(),
            lasts,
        };
        for (is_long, seen) in [false, true].into_iter().zip(seen.lost) {
            if let Some(((kind, lasts), count)) = seen {
                let key = (is_long, out, name(kind));
                let before = self.lost.get(&key).map_or(0, |before| before.packets);
                self.lost.insert(key, affected(before, count, lasts));
            }
        }
        if let (delay, count, Some((kind, lasts))) = seen.late {
            let late = &mut self.late[usize::from(out)];
            let before = late.map_or(0, |(_, _, before)| before.packets);
            *late = Some((delay, kind, affected(before, count, lasts)));
        }
    }

    /// The fault that stops a direction. `None` if it affected no packet after `since`, or has
    /// ended at `now`.
    pub fn since(&self, since: Instant, now: Instant, needs: &Needs) -> Option<Stop> {
        let name_of = |out: bool| if out { "out" } else { "in" };
        let is_needed = |is_long: bool, out: bool| !is_long || (out && needs.long_packets);
        let mut lost = self.lost.iter();
        let stops = lost.find(|((is_long, out, _), affected)| {
            is_needed(*is_long, *out) && affected.counts(since, now)
        });
        if let Some(((_, out, name), affected)) = stops {
            return Some(Stop {
                fault: format!("{name}, {}", name_of(*out)),
                packets: affected.packets,
                lasts: affected.lasts,
            });
        }
        let late = self.late;
        let late = late.map(|late| late.filter(|(_, _, affected)| affected.counts(since, now)));
        let [late_in, late_out] = late.map(|late| late.map_or(Duration::ZERO, |(delay, ..)| delay));
        if late_in + late_out < needs.timeout {
            return None;
        }
        let out = late_out > late_in;
        let (_, kind, affected) = late[usize::from(out)]?;
        Some(Stop {
            fault: format!("{}, {}", name(kind), name_of(out)),
            packets: affected.packets,
            lasts: affected.lasts,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::Fault;

    fn rule(kind: FaultKind, value: f64, until: Option<Duration>) -> Rule {
        let fault = Fault {
            kind,
            direction: Direction::Out,
            value,
            seconds: 0.0,
        };
        Rule::new(fault, 1, 0, Duration::ZERO, until)
    }

    fn needs(long_packets: bool) -> Needs {
        Needs {
            timeout: Duration::from_secs(30),
            long_packets,
        }
    }

    /// X-Val, by hand: 1400 bytes are 11,200 bits, exp(-11.2) = 1.4e-5 and exp(-5.6) = 3.7e-3; 23
    /// CAN frames of 64 bytes have 11,776 bits; 0.7^23 = 2.7e-4, 0.8^23 = 5.9e-3, 0.7^22 = 3.9e-4;
    /// 1 / 7! = 2e-4, 1 / 6! = 1.4e-3.
    #[test]
    fn lasting_fault_that_passes_under_one_packet_in_1000_stops_the_line() {
        use FaultKind::*;
        let [end, late] = [9, 100_000].map(|s| Some(Duration::from_secs(s)));
        // docs/how-to/run.md: a fault of 30 s or longer counts as endless.
        let [short, long] = [29_999, 30_000].map(|ms| Some(Duration::from_millis(ms)));
        for (kind, value, until, bytes, items, long_packets, stops) in [
            (Stuck, 1.0, None, 18, 1, false, true),
            (Stuck, 1.0, end, 18, 1, false, false),
            (Stuck, 1.0, late, 18, 1, false, true),
            (Stuck, 1.0, short, 18, 1, false, false),
            (Stuck, 1.0, long, 18, 1, false, true),
            (Drop, 1.0, late, 18, 1, false, true),
            (Down, 1.0, None, 18, 1, false, true),
            (BusOff, 1.0, None, 18, 1, false, true),
            (Drop, 1.0, None, 18, 1, false, true),
            (Drop, 0.998, None, 18, 1, false, false),
            (Drop, 0.9995, None, 18, 1, false, true),
            (Drop, 0.3, None, 64, 23, false, true),
            (Drop, 0.2, None, 64, 23, false, false),
            (Overrun, 1.0, None, 18, 1, false, true),
            (Truncate, 1.0, None, 18, 1, false, true),
            (BitFlips, 1e-3, None, 1400, 1, false, true),
            (BitFlips, 1e-3, end, 1400, 1, false, false),
            (BitFlips, 5e-4, None, 1400, 1, false, false),
            (BitFlips, 1e-3, None, 126, 1, true, true),
            (BitFlips, 5e-4, None, 126, 1, true, false),
            (BitFlips, 1e-3, None, 126, 1, false, false),
            (BitFlips, 1e-3, None, 64, 23, false, true),
            (Duplicate, 1.0, None, 1400, 1, false, false),
            (Duplicate, 0.3, None, 64, 23, false, true),
            (Reorder, 1.0, None, 1400, 1, false, false),
            (Reorder, 1.0, None, 64, 2, false, true),
            (Jitter, 59.9, None, 1400, 1, false, false),
            (Jitter, 0.02, None, 64, 7, false, true),
            (Jitter, 0.02, None, 64, 6, false, false),
            // 15 frames of an attitude, in any order within 1 s.
            (Jitter, 60.0, None, 8, 15, false, true),
            (Jitter, 2.0, None, 8, 15, false, false),
            (Reorder, 1.0, None, 8, 15, false, false),
            (BitFlips, 1e-2, None, 8, 15, false, true),
            (BitFlips, 1e-3, None, 8, 15, false, false),
        ] {
            let mut lasting = LastingEffects::default();
            let begin = Instant::now();
            let shape = Shape {
                items,
                bytes,
                in_order: items != 15,
            };
            let rules = [rule(kind, value, until)];
            lasting.observe(&rules, shape, Shape::one(1400), Duration::ZERO);
            let mut stopped = Stopped::default();
            stopped.add(Direction::Out, lasting);
            let needs = needs(long_packets);
            let expected = stops.then(|| Stop {
                fault: format!("{}, out", name(kind)),
                packets: 1,
                lasts: until,
            });
            let case = format!("{kind:?} {value} {until:?} {bytes} x {items} {long_packets}");
            let now = Instant::now();
            assert_eq!(stopped.since(begin, now, &needs), expected, "{case}");
            assert_eq!(stopped.since(now, now, &needs), None, "{case}");
            // An ended fault stops nothing.
            let over = now + until.unwrap_or_default();
            let lasts = expected.filter(|_| until.is_none());
            assert_eq!(stopped.since(begin, over, &needs), lasts, "{case}");
        }
    }

    #[test]
    fn delays_of_both_directions_add_up() {
        use FaultKind::{Delay, Jitter};
        // Duration of the inbound fault, s, and time of the check, s.
        for (delays, for_s, after_s, fault) in [
            ([(Delay, 0.0), (Delay, 29.9)], None, 0, None),
            ([(Delay, 0.0), (Delay, 30.0)], None, 0, Some("delay, out")),
            ([(Delay, 16.0), (Delay, 14.0)], None, 0, Some("delay, in")),
            ([(Delay, 16.0), (Delay, 13.0)], None, 0, None),
            (
                [(Delay, 20.0), (Delay, 15.0)],
                Some(60),
                59,
                Some("delay, in"),
            ),
            ([(Delay, 20.0), (Delay, 15.0)], Some(60), 61, None),
            (
                [(Delay, 15.0), (Delay, 30.0)],
                Some(60),
                61,
                Some("delay, out"),
            ),
            // Uniform from 0 to the value: half of it on average.
            ([(Jitter, 60.0), (Delay, 0.0)], None, 0, Some("jitter, in")),
            ([(Delay, 0.0), (Jitter, 59.9)], None, 0, None),
            (
                [(Delay, 14.0), (Jitter, 32.0)],
                None,
                0,
                Some("jitter, out"),
            ),
        ] {
            let (mut stopped, begin) = (Stopped::default(), Instant::now());
            let directions = [(Direction::In, for_s), (Direction::Out, None)];
            for ((direction, for_s), (kind, value)) in directions.into_iter().zip(delays) {
                let mut lasting = LastingEffects::default();
                let rules = [rule(kind, value, for_s.map(Duration::from_secs))];
                lasting.observe(&rules, Shape::one(18), Shape::one(18), Duration::ZERO);
                stopped.add(direction, lasting);
            }
            let now = begin + Duration::from_secs(after_s);
            let found = stopped.since(begin, now, &needs(false));
            let case = format!("{delays:?} {for_s:?} {after_s}");
            assert_eq!(found.map(|stop| stop.fault).as_deref(), fault, "{case}");
            let later = Instant::now();
            assert_eq!(stopped.since(later, later, &needs(false)), None, "{case}");
        }
    }
}
