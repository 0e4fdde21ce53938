//! Age of element sets at a requested epoch. SGP4 is accurate for days.

use crate::Object;
use crate::time::utc_text;
use hifitime::{Epoch, Unit};
use std::fmt;

/// An element set is old at an instant farther than this from its epoch, days.
pub const FRESH_DAYS: f64 = 14.0;

/// Ages of the nearest element sets at an instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Ages {
    /// The instant.
    pub at: Epoch,
    /// Number of objects with element sets.
    pub sets: usize,
    /// Number of objects whose nearest set is more than [`FRESH_DAYS`] away.
    pub old: usize,
    /// Median age, days.
    pub median_days: f64,
    /// Largest age, days.
    pub worst_days: f64,
}

impl Ages {
    /// Ages for these objects; none if no object has element sets.
    pub fn of(objects: &[Object], at: Epoch) -> Option<Ages> {
        let age = |object: &Object| {
            let days = object
                .sets()
                .map(|set| (set.epoch - at).abs().to_unit(Unit::Day));
            days.min_by(f64::total_cmp)
        };
        let mut days: Vec<f64> = objects.iter().filter_map(age).collect();
        let middle = days.len() / 2;
        let (_, median_days, _) =
            (!days.is_empty()).then(|| days.select_nth_unstable_by(middle, f64::total_cmp))?;
        Some(Ages {
            at,
            median_days: *median_days,
            worst_days: days.iter().copied().fold(0.0, f64::max),
            old: days.iter().filter(|days| **days > FRESH_DAYS).count(),
            sets: days.len(),
        })
    }

    /// Whether more than half of the sets are too old for a usable position.
    pub fn are_old(&self) -> bool {
        2 * self.old > self.sets
    }
}

impl fmt::Display for Ages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "old elements: {} of {} are more than {FRESH_DAYS} days from {} (median {:.1}, worst {:.1}): low orbits are off \
             by more km with every day, and may be anywhere on their orbit after some weeks; use element sets of that time",
            self.old,
            self.sets,
            utc_text(self.at),
            self.median_days,
            self.worst_days
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synth::population;

    #[test]
    fn more_than_half_must_be_old() {
        let epoch = Epoch::from_gregorian_utc_at_midnight(2026, 6, 1);
        // Element sets of the day before.
        let objects: Vec<Object> = population(101, 1, epoch)
            .iter()
            .map(|one| one.object())
            .collect();
        let at = |days: f64| Ages::of(&objects, epoch + Unit::Day * days).unwrap();
        for (days, old) in [
            (0.0, false),
            (-13.0, false),
            (12.9, false),
            (14.1, true),
            (-15.1, true),
        ] {
            assert_eq!(at(days).are_old(), old, "{days}");
        }
        let late = at(100.0);
        assert_eq!((late.sets, late.old), (101, 101));
        assert!(
            (100.0..101.0).contains(&late.median_days) && late.worst_days <= 101.0,
            "{late:?}"
        );
        assert!(late.worst_days > late.median_days);
        let text = late.to_string();
        for word in [
            "101 of 101",
            "14 days from 2026-09-09T00:00:00.000Z",
            "median 100.",
        ] {
            assert!(text.contains(word), "{text}");
        }
        // Fresh sets for one more than half of the objects.
        let mut mixed = objects.clone();
        let fresh = population(101, 1, late.at);
        for (object, fresh) in mixed.iter_mut().zip(fresh).take(51) {
            object.join(fresh.object());
        }
        let mixed = Ages::of(&mixed, late.at).unwrap();
        assert_eq!((mixed.old, mixed.are_old()), (50, false));
        assert_eq!(Ages::of(&[], epoch), None);
    }
}
