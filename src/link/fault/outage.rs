//! What takes the whole line out of action: whether it is, and when that ends, whatever directions and rules it has.

use super::engine::{Injection, What};
use skyloop_protocols::FaultKind;

/// Follows the faults of one kind that lets nothing pass.
#[derive(Debug)]
pub(super) struct Outage {
    kind: FaultKind,
    /// Rules in force, of both directions.
    in_force: u32,
}

/// What has changed.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Change {
    Lost,
    Back,
}

impl Outage {
    pub fn of(kind: FaultKind) -> Outage {
        Outage { kind, in_force: 0 }
    }

    /// Whether the line is out of action.
    pub fn is_on(&self) -> bool {
        self.in_force > 0
    }

    /// Sees what happened next.
    pub fn see(&mut self, injection: &Injection) -> Option<Change> {
        if injection.kind != self.kind {
            return None;
        }
        let before = self.is_on();
        match injection.what {
            // Value 0 lets everything pass.
            What::Begins(value) if value > 0.0 => self.in_force += 1,
            What::Ends(value) if value > 0.0 => self.in_force = self.in_force.saturating_sub(1),
            _ => {}
        }
        match (before, self.is_on()) {
            (false, true) => Some(Change::Lost),
            (true, false) => Some(Change::Back),
            _ => None,
        }
    }
}

/// What both directions have injected, in order; what begins where another ends comes first.
pub(super) fn in_order(mut a: Vec<Injection>, b: Vec<Injection>) -> Vec<Injection> {
    a.extend(b);
    a.sort_by_key(|injection| (injection.at, matches!(injection.what, What::Ends(_))));
    a
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::Direction;
    use std::time::Duration;

    /// A rule of one direction, from and until s, as it is told.
    fn rule(direction: Direction, value: f64, from: u64, until: u64) -> Vec<Injection> {
        let told = |at, what| Injection {
            at: Duration::from_secs(at),
            direction,
            kind: FaultKind::Down,
            what,
        };
        vec![
            told(from, What::Begins(value)),
            told(until, What::Ends(value)),
        ]
    }

    /// When a line with these two rules is lost and comes back.
    fn changes(a: Vec<Injection>, b: Vec<Injection>) -> Vec<(u64, Change)> {
        let mut outage = Outage::of(FaultKind::Down);
        let events = in_order(a, b);
        let changes = events.iter().filter_map(|injection| {
            let change = outage.see(injection)?;
            Some((injection.at.as_secs(), change))
        });
        changes.collect()
    }

    #[test]
    fn a_line_is_back_when_both_directions_are() {
        use Direction::{In, Out};
        let once = |from, until| vec![(from, Change::Lost), (until, Change::Back)];
        assert_eq!(changes(rule(In, 1.0, 1, 2), vec![]), once(1, 2));
        assert_eq!(
            changes(rule(In, 1.0, 1, 3), rule(Out, 1.0, 1, 3)),
            once(1, 3)
        );
        assert_eq!(
            changes(rule(In, 1.0, 1, 3), rule(Out, 1.0, 2, 5)),
            once(1, 5)
        );
        assert_eq!(
            changes(rule(In, 1.0, 1, 3), rule(Out, 1.0, 3, 4)),
            once(1, 4)
        );
        let twice = changes(rule(In, 1.0, 1, 2), rule(Out, 1.0, 3, 4));
        assert_eq!(twice.len(), 4);
        assert_eq!(
            changes(rule(In, 1.0, 1, 4), rule(Out, 0.0, 2, 3)),
            once(1, 4)
        );
        assert_eq!(changes(rule(In, 0.0, 1, 2), vec![]), []);
    }
}
