//! Times of an object in the field: a time interval is bisected if the image, at its highest
//! possible speed, may reach the edge.

use super::field::Field;
use super::known::{self, NoState};
use super::observer_track::{ObserverTrack, Step};
use super::request::{NoPasses, Search};
use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop_orbit::{Object, StateVector};
use skyloop_render::camera::Camera;
use skyloop_render::light_curve::why_dark;
use skyloop_render::scene::Hidden;
use skyloop_render::sky::Corrections;
use skyloop_render::sky::apparent::object_direction;
use skyloop_render::sky::population::OWN_VEHICLE_M;
use std::cell::OnceCell;
use std::f64::consts::PI;

/// Entries and exits are bisected to this, s.
const FINE_S: f64 = 1e-3;
/// Largest change of direction by light time and aberration, rad: 16 km/s over c each, rounded up.
const DIRECTION_MARGIN: f64 = 2e-4;
/// Golden section, for minima.
const SECTION: f64 = 0.618_033_988_749_894_9;

/// Search for one object.
pub(super) struct ObjectSearch<'a> {
    pub(super) observer_track: &'a ObserverTrack<'a>,
    pub(super) field: &'a Field<'a>,
    pub(super) camera: &'a Camera,
    pub(super) corrections: &'a Corrections,
    pub(super) object: &'a Object,
    /// Reason of its first missing state.
    pub(super) lost: OnceCell<String>,
}

/// Appearance of an object at an instant.
pub(super) struct Sight {
    /// Image, px, on the detector or outside; none where the optics give none.
    pub(super) image_px: Option<[f64; 2]>,
    /// Whether the image is on the detector.
    pub(super) inside: bool,
    /// Angle from the boresight, rad.
    pub(super) off_axis: f64,
    /// Range, m.
    pub(super) range_m: f64,
    /// Why it is dark, if it is.
    pub(super) hidden: Option<Hidden>,
}

/// A time interval (s), and whether the object is in the field throughout.
struct Piece {
    start_s: f64,
    end_s: f64,
    inside: bool,
}

impl ObjectSearch<'_> {
    /// Intervals in the field, s since the beginning; only `steps` are searched.
    pub(super) fn crossings(
        &self,
        steps: &[usize],
        search: &Search,
    ) -> Result<Vec<[f64; 2]>, NoPasses> {
        let mut crossings = Vec::new();
        let begins = steps.first() == Some(&0) && self.is_inside(0.0)?;
        let mut entered = begins.then_some(0.0);
        let mut known = (0.0, begins);
        let mut add = |piece: Piece| -> Result<(), NoPasses> {
            if piece.inside != known.1 {
                let at = self.edge_between(known, piece.start_s)?;
                match entered.take() {
                    None => entered = Some(at),
                    Some(start) => crossings.push([start, at]),
                }
            }
            known = (piece.end_s, piece.inside);
            Ok(())
        };
        for (i, number) in steps.iter().enumerate() {
            let step = &self.observer_track.steps[*number];
            self.pieces(step, search.shortest_s, &mut add)?;
            // A step without the object follows, or the end of the search.
            let last = *number + 1 == self.observer_track.steps.len();
            if last || steps.get(i + 1) != Some(&(number + 1)) {
                add(Piece {
                    start_s: step.end_s,
                    end_s: step.end_s,
                    inside: last && self.is_inside(step.end_s)?,
                })?;
            }
        }
        crossings.extend(entered.map(|start| [start, search.length_s()]));
        Ok(crossings)
    }

    /// Bisects a step into pieces, in order of time.
    fn pieces(
        &self,
        step: &Step,
        shortest_s: f64,
        take: &mut impl FnMut(Piece) -> Result<(), NoPasses>,
    ) -> Result<(), NoPasses> {
        let mut left = vec![[step.start_s, step.end_s]];
        while let Some([start_s, end_s]) = left.pop() {
            let mid_s = (start_s + end_s) / 2.0;
            match self.throughout(step, mid_s, (end_s - start_s) / 2.0)? {
                Some(inside) => take(Piece {
                    start_s,
                    end_s,
                    inside,
                })?,
                None if end_s - start_s <= shortest_s => take(Piece {
                    start_s: mid_s,
                    end_s: mid_s,
                    inside: self.is_inside(mid_s)?,
                })?,
                None => left.extend([[mid_s, end_s], [start_s, mid_s]]),
            }
        }
        Ok(())
    }

    /// Whether it is in the field for `half_s` before and after an instant; none where that, or the
    /// availability of states, may change.
    fn throughout(&self, step: &Step, t_s: f64, half_s: f64) -> Result<Option<bool>, NoPasses> {
        let epoch = self.observer_track.epoch(t_s);
        let state = match self.state(step, epoch) {
            Ok(state) => state,
            Err(error) => {
                let (object, rotation) = (self.object, &step.rotation);
                let near = known::may_have_near(object, &error, epoch, half_s, rotation);
                return Ok((!near).then_some(false));
            }
        };
        let vehicle = self.observer_track.vehicle(t_s)?;
        let observer = step.state(t_s);
        let line = state.position_m - observer.position_m;
        let range = line.norm();
        // Along a path w the line turns by up to asin(w / range) <= pi w / range.
        let path = (state.velocity_m_s - observer.velocity_m_s).norm() * half_s;
        let sweep = PI * path / range.max(1e-3) + step.rate * half_s + 2.0 * DIRECTION_MARGIN;
        if range < OWN_VEHICLE_M || sweep > PI {
            return Ok(None);
        }
        let seen = vehicle
            .attitude
            .then(&self.camera.mounting)
            .rotate(&(line / range));
        if self.field.to_edge(&seen) <= sweep {
            return Ok(None);
        }
        let inside = self.field.image_px(&seen).is_some();
        // In the field in the middle but not at an end: there is no state at that end.
        let known = !inside || (self.is_inside(t_s - half_s)? && self.is_inside(t_s + half_s)?);
        Ok(known.then_some(inside))
    }

    fn state(&self, step: &Step, epoch: Epoch) -> Result<StateVector, NoState> {
        let state = known::state(self.object, epoch, &step.rotation);
        state.inspect_err(|error| self.lose(error))
    }

    pub(super) fn lose(&self, why: &impl ToString) {
        self.lost.get_or_init(|| why.to_string());
    }

    /// The instant at which the object crosses the edge, on the inner side.
    fn edge_between(&self, (known_s, inside): (f64, bool), other_s: f64) -> Result<f64, NoPasses> {
        let holds = |t_s: f64| Ok(self.is_inside(t_s)? == inside);
        let [before, after] = bisect([known_s, other_s], holds)?;
        Ok(if inside { before } else { after })
    }

    fn is_inside(&self, t_s: f64) -> Result<bool, NoPasses> {
        Ok(self.sight(t_s)?.is_some_and(|sight| sight.inside))
    }

    /// The appearance at an instant; none without a state, or for the observer itself.
    pub(super) fn sight(&self, t_s: f64) -> Result<Option<Sight>, NoPasses> {
        let step = self.observer_track.at(t_s);
        let observer = step.observer(self.observer_track.epoch(t_s), t_s);
        let state = |epoch| self.state(step, epoch);
        let Ok(seen) = object_direction(state, &observer, self.corrections) else {
            return Ok(None);
        };
        if seen.range_m < OWN_VEHICLE_M {
            return Ok(None);
        }
        let pointing = self
            .observer_track
            .vehicle(t_s)?
            .attitude
            .then(&self.camera.mounting);
        let direction = pointing.rotate(&seen.direction);
        let sun_m = observer.bodies.sun_apparent_m();
        let occulted = step.earth.occults(observer.position_m, seen.seen_at_m);
        Ok(Some(Sight {
            image_px: self.camera.optics.project(&direction),
            inside: self.field.image_px(&direction).is_some(),
            off_axis: direction.angle(&Vector3::z()),
            range_m: seen.range_m,
            hidden: why_dark(occulted, step.earth.illumination(seen.seen_at_m, sun_m)),
        }))
    }

    /// The instant between both `ends` with the least value of a quantity that has one minimum.
    pub(super) fn least(
        &self,
        ends: [f64; 2],
        of: impl Fn(&Sight) -> f64,
    ) -> Result<f64, NoPasses> {
        let value = |t_s| -> Result<f64, NoPasses> {
            Ok(self.sight(t_s)?.map_or(f64::INFINITY, |sight| of(&sight)))
        };
        let [mut low, mut high] = ends;
        while high - low > FINE_S {
            let reach = SECTION * (high - low);
            let (first, second) = (high - reach, low + reach);
            if value(first)? < value(second)? {
                high = second
            } else {
                low = first
            }
        }
        // The minimum may be at an end.
        let mut best = (low + high) / 2.0;
        for end in ends {
            if value(end)? < value(best)? {
                best = end;
            }
        }
        Ok(best)
    }

    /// The instant at which the reason for darkness changes from `before`.
    pub(super) fn change(&self, span: [f64; 2], before: Option<Hidden>) -> Result<f64, NoPasses> {
        let holds = |t_s: f64| Ok(self.sight(t_s)?.is_some_and(|sight| sight.hidden == before));
        let [low, high] = bisect(span, holds)?;
        Ok((low + high) / 2.0)
    }
}

/// The change of a condition that holds at the start of a time span: the instants before and after.
fn bisect(
    [mut low, mut high]: [f64; 2],
    holds: impl Fn(f64) -> Result<bool, NoPasses>,
) -> Result<[f64; 2], NoPasses> {
    while high - low > FINE_S {
        let mid = (low + high) / 2.0;
        if holds(mid)? {
            low = mid;
        } else {
            high = mid;
        }
    }
    Ok([low, high])
}
