//! Objects before the camera that have no image: who, and why.

use crate::scene::{View, World};
use crate::sky::field::Unseen;
use std::collections::BTreeMap;

/// Objects without an image that a label lists.
pub const MOST_UNSEEN: usize = 10_000;

/// Their ids, in the population's order, by why; at most [`MOST_UNSEEN`].
pub fn listed(view: &View, world: &World) -> BTreeMap<&'static str, Vec<String>> {
    let mut listed: BTreeMap<_, Vec<String>> = BTreeMap::new();
    for (index, why) in view.unseen.iter().take(MOST_UNSEEN) {
        let id = world.population.objects()[*index].id.to_string();
        listed.entry(said(*why)).or_default().push(id);
    }
    listed
}

/// How many are not listed, where there are more.
pub fn left_out(view: &View) -> Option<usize> {
    let left_out = view.unseen.len().saturating_sub(MOST_UNSEEN);
    (left_out > 0).then_some(left_out)
}

fn said(why: Unseen) -> &'static str {
    match why {
        Unseen::BehindEarth => "behind the Earth",
        Unseen::TooFaint => "too faint",
    }
}
