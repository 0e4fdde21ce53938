//! Objects in the field that labels do not list as such: who, and why.

use super::visible::is_listed;
use crate::scene::{Body, Scene, World};
use crate::sky::field::Excluded;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Such objects that a label lists.
pub const MAX_EXCLUDED: usize = 10_000;

/// Ids that one thread copies at least.
const TASK: usize = 64;

/// Such objects by why they are not seen.
#[derive(Debug, Default, PartialEq)]
pub struct Listed {
    /// Ids, in the population's order, at most [`MOST_UNSEEN`] in all.
    pub ids: BTreeMap<&'static str, Vec<String>>,
    /// How many there are, listed or not.
    pub counts: BTreeMap<&'static str, usize>,
    /// How many are not listed.
    pub left_out: usize,
}

/// Who in the field of `scene` is not listed as an object.
pub fn listed(scene: &Scene, world: &World, label_snr: f64) -> Listed {
    // Some are too faint to be drawn, others are drawn and too faint to be listed.
    let drawn = scene
        .sources
        .iter()
        .filter_map(|source| match &source.body {
            Body::Rso(object) if !is_listed(source, scene, label_snr) => {
                Some((object.index, Excluded::TooFaint))
            }
            _ => None,
        });
    let mut unseen: Vec<(usize, Excluded)> = scene.view.unseen.clone();
    unseen.extend(drawn);
    unseen.sort_unstable();
    let objects = world.population.objects();
    bounded(&unseen, MAX_EXCLUDED, |index| objects[index].id.clone())
}

/// At most `most` of those that are not seen. Where there are more, each reason has an equal part
/// of the list, and what one does not need goes to the others.
fn bounded(
    unseen: &[(usize, Excluded)],
    most: usize,
    id: impl Fn(usize) -> String + Sync,
) -> Listed {
    let mut by_reason: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (index, why) in unseen {
        by_reason.entry(said(*why)).or_default().push(*index);
    }
    let mut listed = Listed {
        left_out: unseen.len().saturating_sub(most),
        ..Listed::default()
    };
    let mut reasons: Vec<(&str, Vec<usize>)> = by_reason.into_iter().collect();
    reasons.sort_by_key(|(_, indices)| indices.len());
    let (mut room, mut left) = (most, reasons.len());
    for (why, indices) in reasons {
        let share = indices.len().min(room / left);
        (room, left) = (room - share, left - 1);
        listed.counts.insert(why, indices.len());
        // Each id lies somewhere else in memory: two threads wait for two at a time.
        let ids = indices[..share].par_iter().with_min_len(TASK);
        listed
            .ids
            .insert(why, ids.map(|index| id(*index)).collect());
    }
    listed
}

fn said(why: Excluded) -> &'static str {
    match why {
        Excluded::BehindEarth => "behind the Earth",
        Excluded::TooFaint => "too faint",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_too_many_each_reason_has_its_part() {
        // X-Val: by hand: of 10 places 5 are for each reason; what is not needed goes to the other.
        for (behind, faint, listed) in [
            (20, 3, [7, 3]),
            (20, 30, [5, 5]),
            (2, 30, [2, 8]),
            (4, 6, [4, 6]),
        ] {
            let behind_earth = (0..behind).map(|i| (i, Excluded::BehindEarth));
            let too_faint = (behind..behind + faint).map(|i| (i, Excluded::TooFaint));
            let all: Vec<_> = behind_earth.chain(too_faint).collect();
            let found = bounded(&all, 10, |index| index.to_string());
            let (ids, counts) = (&found.ids, &found.counts);
            assert_eq!(
                [ids["behind the Earth"].len(), ids["too faint"].len()],
                listed
            );
            assert_eq!(
                [counts["behind the Earth"], counts["too faint"]],
                [behind, faint]
            );
            assert_eq!(found.left_out, (behind + faint).saturating_sub(10));
            assert_eq!(ids["too faint"][0], behind.to_string());
        }
        assert_eq!(bounded(&[], 10, |_| String::new()), Listed::default());
    }
}
