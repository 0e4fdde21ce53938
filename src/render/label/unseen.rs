//! Objects in the field that labels do not list, with the reason.

use super::visible::is_listed;
use crate::scene::{Body, Scene, World};
use crate::sky::field::Excluded;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Most such objects that a label lists.
pub const MAX_EXCLUDED: usize = 10_000;

/// Minimum number of ids that one thread copies.
const TASK: usize = 64;

/// Unlisted objects by reason.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Listed {
    /// Ids, in the population's order, at most [`MAX_EXCLUDED`] in all.
    pub ids: BTreeMap<&'static str, Vec<String>>,
    /// Number of such objects, with or without an id here.
    pub counts: BTreeMap<&'static str, usize>,
    /// Number of such objects without an id here.
    pub left_out: usize,
}

/// The objects in the field of `scene` that are not listed.
pub(crate) fn listed(scene: &Scene, world: &World, label_snr: f64) -> Listed {
    // Some objects are too faint to be drawn, others are drawn and too faint to be listed.
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

/// At most `max` of the unlisted objects. If there are more, each reason gets an equal share of the
/// list, and unused shares go to the other reasons.
fn bounded(
    unseen: &[(usize, Excluded)],
    max: usize,
    id: impl Fn(usize) -> String + Sync,
) -> Listed {
    let mut by_reason: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (index, why) in unseen {
        by_reason.entry(reason(*why)).or_default().push(*index);
    }
    let mut listed = Listed {
        left_out: unseen.len().saturating_sub(max),
        ..Listed::default()
    };
    let mut reasons: Vec<(&str, Vec<usize>)> = by_reason.into_iter().collect();
    reasons.sort_by_key(|(_, indices)| indices.len());
    let (mut room, mut left) = (max, reasons.len());
    for (why, indices) in reasons {
        let share = indices.len().min(room / left);
        (room, left) = (room - share, left - 1);
        listed.counts.insert(why, indices.len());
        // Ids are scattered in memory: several threads hide the latency.
        let ids = indices[..share].par_iter().with_min_len(TASK);
        listed
            .ids
            .insert(why, ids.map(|index| id(*index)).collect());
    }
    listed
}

fn reason(why: Excluded) -> &'static str {
    match why {
        Excluded::BehindEarth => "behind the Earth",
        Excluded::TooFaint => "too faint",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lists_are_shared_equally_by_reason() {
        // X-Val: by hand: each reason has 5 of 10 entries; unused ones go to the other reason.
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
