//! Times with a pointing direction: a target object may have no states.

use super::request::Search;
use hifitime::{Epoch, Unit};
use skyloop_config::flight::Flight;
use skyloop_orbit::Object;
use skyloop_orbit::time::seconds;
use skyloop_render::sky::bodies::LIGHT_M_S;

/// Ends of parts are bisected to this, s.
const FINE_S: f64 = 1e-3;

/// Light time from 3e6 km, twice the radius of the largest orbits about the Earth, s.
const LONGEST_LIGHT_TIME_S: f64 = 10.0;

/// Iterations of the light time; each changes it by less than 1e-4.
const LIGHT_TIME_STEPS: usize = 4;

/// The parts of a search, at least a millisecond long, with an attitude of the vehicle. Tested
/// every `step_s`, and in each gap of the target's states.
pub(super) fn parts(search: &Search, flight: &Flight, step_s: f64) -> Vec<Search> {
    let has = |epoch: Epoch| {
        let state = flight.state(epoch);
        state.is_ok_and(|state| flight.vehicle(epoch, state).is_ok())
    };
    let Some(Search { from, to, .. }) = with_target(search, flight) else {
        return Vec::new();
    };
    let mut parts = Vec::new();
    let mut near_gaps = near_gaps(search, flight).into_iter().peekable();
    let (mut last, mut had) = (from, has(from));
    let mut start = had.then_some(last);
    while last < to {
        let next = (last + seconds(step_s)).min(to);
        let next = near_gaps.next_if(|at| *at <= next).unwrap_or(next);
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
    parts.extend(start.map(|start| [start, to]));
    let is_long = |[from, to]: &[Epoch; 2]| *to - *from > seconds(FINE_S);
    let parts = parts.into_iter().filter(is_long);
    let parts = parts.map(|[from, to]| Search {
        from,
        to,
        ..*search
    });
    parts.collect()
}

/// The part of a search in which the target may have a state, or its light may arrive; none if
/// there is none.
fn with_target(search: &Search, flight: &Flight) -> Option<Search> {
    let Some(target) = &flight.target else {
        return Some(*search);
    };
    let (first, last) = target.span()?;
    let part = Search {
        from: search.from.max(first),
        to: search.to.min(last + seconds(LONGEST_LIGHT_TIME_S)),
        ..*search
    };
    (part.from < part.to).then_some(part)
}

/// Instants of a search, in order, at which the target's states, or their light, begin and end.
fn near_gaps(search: &Search, flight: &Flight) -> Vec<Epoch> {
    let Some(target) = &flight.target else {
        return Vec::new();
    };
    let middles = target.span_middles().into_iter();
    let all = middles.flat_map(|at| [Some(at), arrival(at, target, flight)]);
    let is_inside = |at: &Epoch| *at > search.from && *at < search.to;
    let mut inside: Vec<Epoch> = all.flatten().filter(is_inside).collect();
    inside.sort_unstable();
    inside
}

/// Arrival of light that leaves a target at an instant: t = left + |r(t) - r_observer(t)| / c, by
/// iteration.
fn arrival(left: Epoch, target: &Object, flight: &Flight) -> Option<Epoch> {
    let position = |at| target.state(at).ok().map(|state| state.position_m);
    let nearby = [1.0, -1.0]
        .into_iter()
        .find_map(|s| position(left + seconds(s)));
    let mut at = left;
    for _ in 0..LIGHT_TIME_STEPS {
        let line = position(at).or(nearby)? - flight.state(at).ok()?.position_m;
        at = left + seconds(line.norm() / LIGHT_M_S);
    }
    Some(at)
}

/// First or last instant with an attitude between two instants, of which one has one; by bisection.
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

/// The intervals between the parts of a search.
pub(super) fn gaps(search: &Search, parts: &[Search]) -> Vec<[Epoch; 2]> {
    let starts = [search.from]
        .into_iter()
        .chain(parts.iter().map(|part| part.to));
    let ends = parts.iter().map(|part| part.from).chain([search.to]);
    let gaps = starts.zip(ends).map(|(start, end)| [start, end]);
    gaps.filter(|[start, end]| *end - *start > Unit::Second * 0.0)
        .collect()
}
