//! Objects in the field that labels do not list as such: who, and why.

use crate::scene::{Body, Scene, World};
use crate::sky::field::Unseen;
use std::collections::BTreeMap;

/// Such objects that a label lists.
pub const MOST_UNSEEN: usize = 10_000;

/// Their ids, in the population's order, by why; and how many are left out, for there are more than [`MOST_UNSEEN`].
pub fn listed(
    scene: &Scene,
    world: &World,
    label_snr: f64,
) -> (BTreeMap<&'static str, Vec<String>>, usize) {
    // Some are too faint to be drawn, others are drawn and too faint to be listed.
    let drawn = scene
        .sources
        .iter()
        .filter_map(|source| match &source.body {
            Body::Rso(object) if !super::is_listed(source, label_snr) => {
                Some((object.index, Unseen::TooFaint))
            }
            _ => None,
        });
    let mut unseen: Vec<(usize, Unseen)> = scene.view.unseen.clone();
    unseen.extend(drawn);
    unseen.sort_unstable();
    let left_out = unseen.len().saturating_sub(MOST_UNSEEN);
    let mut listed: BTreeMap<_, Vec<String>> = BTreeMap::new();
    for (index, why) in unseen.into_iter().take(MOST_UNSEEN) {
        let id = world.population.objects()[index].id.clone();
        listed.entry(said(why)).or_default().push(id);
    }
    (listed, left_out)
}

fn said(why: Unseen) -> &'static str {
    match why {
        Unseen::BehindEarth => "behind the Earth",
        Unseen::TooFaint => "too faint",
    }
}
