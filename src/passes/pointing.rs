//! When the pointing has a direction: an object that it follows may have no states.

use super::Search;
use crate::flight::Flight;
use crate::sky::bodies::LIGHT_M_S;
use hifitime::{Epoch, Unit};
use skyloop_orbit::Object;
use skyloop_orbit::time::seconds;

/// Ends of a part are bisected down to this, s.
const FINE_S: f64 = 1e-3;

/// Light times change by less than 1e-4 of themselves with each of these.
const LIGHT_TIME_STEPS: usize = 4;

/// The parts of a search, at least a millisecond long, in which the vehicle has an attitude, looked at every `step_s` and in each gap of the states
/// of its target, however short.
pub(super) fn parts(search: &Search, flight: &Flight, step_s: f64) -> Vec<Search> {
    let has = |epoch: Epoch| {
        let state = flight.state(epoch);
        state.is_ok_and(|state| flight.vehicle(epoch, state).is_ok())
    };
    let mut parts = Vec::new();
    let mut in_gaps = in_gaps(search, flight).into_iter().peekable();
    let (mut last, mut had) = (search.from, has(search.from));
    let mut start = had.then_some(last);
    while last < search.to {
        let next = (last + seconds(step_s)).min(search.to);
        let next = in_gaps.next_if(|at| *at <= next).unwrap_or(next);
        let has_next = has(next);
        if has_next != had {
            let edge = edge([last, next], had, &has);
            match start.take() {
                None => start = Some(edge),
                Some(from) => parts.push([from, edge]),
            }
        }
        (last, had) = (next, has_next);
    }
    parts.extend(start.map(|from| [from, search.to]));
    let is_long = |[from, to]: &[Epoch; 2]| *to - *from > seconds(FINE_S);
    let parts = parts.into_iter().filter(is_long);
    let parts = parts.map(|[from, to]| Search {
        from,
        to,
        ..*search
    });
    parts.collect()
}

/// Instants of a search, in order, at which the target has no state, or had none when its light left it.
fn in_gaps(search: &Search, flight: &Flight) -> Vec<Epoch> {
    let Some(target) = &flight.target else {
        return Vec::new();
    };
    let gaps = target.gaps().into_iter();
    let all = gaps.flat_map(|gap| [Some(gap), seen(gap, target, flight)]);
    let is_inside = |at: &Epoch| *at > search.from && *at < search.to;
    let mut inside: Vec<Epoch> = all.flatten().filter(is_inside).collect();
    inside.sort_unstable();
    inside
}

/// When the light that leaves a target in a short gap of its states arrives: t = gap + |r(t) - r_observer(t)| / c, by iteration.
fn seen(gap: Epoch, target: &Object, flight: &Flight) -> Option<Epoch> {
    let place = |at| target.state(at).ok().map(|state| state.position_m);
    let beside = [1.0, -1.0]
        .into_iter()
        .find_map(|s| place(gap + seconds(s)));
    let mut at = gap;
    for _ in 0..LIGHT_TIME_STEPS {
        let line = place(at).or(beside)? - flight.state(at).ok()?.position_m;
        at = gap + seconds(line.norm() / LIGHT_M_S);
    }
    Some(at)
}

/// The instant between two, of which one has an attitude, at which that changes: of those bisected the last that has one.
fn edge([mut low, mut high]: [Epoch; 2], had: bool, has: &impl Fn(Epoch) -> bool) -> Epoch {
    while high - low > seconds(FINE_S) {
        let middle = low + (high - low) * 0.5;
        if has(middle) == had {
            low = middle;
        } else {
            high = middle;
        }
    }
    if had { low } else { high }
}

/// First and last instants of what lies between the parts of a search.
pub(super) fn gaps(search: &Search, parts: &[Search]) -> Vec<[Epoch; 2]> {
    let starts = [search.from]
        .into_iter()
        .chain(parts.iter().map(|part| part.to));
    let ends = parts.iter().map(|part| part.from).chain([search.to]);
    let gaps = starts.zip(ends).map(|(start, end)| [start, end]);
    gaps.filter(|[start, end]| *end - *start > Unit::Second * 0.0)
        .collect()
}
