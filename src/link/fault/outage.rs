//! Outages: faults of one kind, in any direction, that take the whole link down.

use super::injection::{Event, Injection};
use skyloop_protocols::FaultKind;

/// Tracks the faults of one kind.
#[derive(Debug)]
pub(super) struct Outage {
    kind: FaultKind,
    /// Number of active rules of both directions.
    in_force: u32,
}

/// A change of the link's state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Change {
    Lost,
    Back,
}

impl Outage {
    pub fn of(kind: FaultKind) -> Outage {
        Outage { kind, in_force: 0 }
    }

    /// Processes the next injection.
    pub fn observe(&mut self, injection: &Injection) -> Option<Change> {
        match injection.event {
            Event::Begins(_) if injection.kind == self.kind => {
                self.in_force += 1;
                (self.in_force == 1).then_some(Change::Lost)
            }
            Event::Ends if injection.kind == self.kind => {
                self.in_force -= 1;
                (self.in_force == 0).then_some(Change::Back)
            }
            _ => None,
        }
    }
}

/// Injections of both directions in order of time; at equal times, a beginning comes before an end.
pub(super) fn in_order(mut a: Vec<Injection>, b: Vec<Injection>) -> Vec<Injection> {
    a.extend(b);
    a.sort_by_key(|injection| (injection.at, injection.event == Event::Ends));
    a
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::Direction;
    use std::time::Duration;

    /// A rule of one direction, in force from and until these seconds.
    fn rule(direction: Direction, [from, until]: [u64; 2]) -> Vec<Injection> {
        let turns = [(from, Event::Begins(1.0)), (until, Event::Ends)];
        let injection = |(at, event)| Injection {
            at: Duration::from_secs(at),
            direction,
            kind: FaultKind::Down,
            event,
        };
        turns.map(injection).to_vec()
    }

    #[test]
    fn link_is_back_when_both_directions_are() {
        for (inbound, outbound, lost_and_back) in [
            ([1, 3], [1, 3], &[1, 3][..]),
            ([1, 3], [2, 5], &[1, 5]),
            ([1, 3], [3, 4], &[1, 4]),
            ([1, 4], [2, 3], &[1, 4]),
            ([1, 2], [3, 4], &[1, 2, 3, 4]),
        ] {
            let mut outage = Outage::of(FaultKind::Down);
            let events = in_order(rule(Direction::In, inbound), rule(Direction::Out, outbound));
            let changes: Vec<_> = events
                .iter()
                .filter_map(|event| Some((event.at.as_secs(), outage.observe(event)?)))
                .collect();
            let kinds = [Change::Lost, Change::Back].into_iter().cycle();
            let expected: Vec<_> = lost_and_back.iter().copied().zip(kinds).collect();
            assert_eq!(changes, expected, "{inbound:?} {outbound:?}");
        }
    }
}
