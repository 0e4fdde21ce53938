//! A pass of an object through the field: entry, exit, extremes, light.

use super::request::{NoPasses, Search};
use super::search::{ObjectSearch, Sight};
use hifitime::Epoch;
use skyloop_render::light_curve::{NoLightCurve, Point, point_from};
use skyloop_render::scene::Hidden;
use skyloop_render::sky::Population;

/// Interval of the samples for minima and for darkness, s.
const SAMPLE_S: f64 = 1.0;
/// Largest number of these samples.
const MAX_SAMPLES: f64 = 1000.0;
/// Largest number of samples of the brightness.
const MAX_LIGHTS: f64 = 100.0;
/// Time base of an image's rate, s.
const RATE_S: f64 = 0.01;
/// Without a state at an end of a pass, light is computed this far inside the pass, s.
const WITHIN_S: f64 = 1e-3;

/// A pass of an object through the field.
#[derive(Debug, Clone)]
pub struct Pass {
    /// Index into the population.
    pub index: usize,
    /// Entry into the field.
    pub entry: PassInstant,
    /// Exit from the field.
    pub exit: PassInstant,
    /// Nearest to the boresight.
    pub nearest: PassInstant,
    /// At the greatest brightness; none where no light arrives.
    pub brightest: Option<PassInstant>,
    /// Time and value of the least range, m.
    pub closest: (Epoch, f64),
    /// Rate of the image nearest to the boresight, px/s.
    pub rate_px_s: f64,
    /// Intervals with and without light.
    pub lit: Vec<Lit>,
    /// Whether it is in the field at the start of the search.
    pub in_field_at_start: bool,
    /// Whether it is in the field at the end of the search.
    pub in_field_at_end: bool,
}

/// An object at an instant of its pass.
#[derive(Debug, Clone)]
pub struct PassInstant {
    /// Its light.
    pub point: Point,
    /// Position of the image on the detector, px.
    pub position_px: [f64; 2],
    /// Angle from the boresight, rad.
    pub off_axis: f64,
}

/// An interval of a pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lit {
    /// Start.
    pub from: Epoch,
    /// End.
    pub to: Epoch,
    /// Why no light arrives; none where light arrives.
    pub hidden: Option<Hidden>,
}

impl ObjectSearch<'_> {
    /// The pass between two instants, s; none without a state between them.
    pub(super) fn pass(
        &self,
        population: &Population,
        index: usize,
        [start, end]: [f64; 2],
        search: &Search,
    ) -> Result<Option<Pass>, NoPasses> {
        let samples = ((end - start) / SAMPLE_S).ceil().clamp(4.0, MAX_SAMPLES);
        let times = |count: f64| {
            (0..=count as usize).map(move |i| start + (end - start) * i as f64 / count)
        };
        let mut seen: Vec<(f64, Sight)> = Vec::new();
        for t_s in times(samples) {
            seen.extend(self.sight(t_s)?.map(|sight| (t_s, sight)));
        }
        let reach = (end - start) / samples;
        let least = |of: &dyn Fn(&Sight) -> f64| -> Result<f64, NoPasses> {
            let best = seen.iter().min_by(|a, b| of(&a.1).total_cmp(&of(&b.1)));
            let near = best.map_or(start, |(t_s, _)| *t_s);
            self.least([(near - reach).max(start), (near + reach).min(end)], of)
        };
        let instant = |t_s: f64| self.instant(population, index, t_s);
        let nearest_s = least(&|sight| sight.off_axis)?;
        let closest_s = least(&|sight| sight.range_m)?;
        // The edge is known to a millisecond, and may be the last instant with a state.
        let within = |t_s: f64| -> Result<Option<PassInstant>, NoPasses> {
            let inner_s = (t_s.max(start + WITHIN_S)).min(end - WITHIN_S);
            Ok(match instant(t_s)? {
                None if end - start > 2.0 * WITHIN_S => instant(inner_s)?,
                one => one,
            })
        };
        let (Some(entry), Some(exit), Some(nearest), Some(closest)) = (
            within(start)?,
            within(end)?,
            within(nearest_s)?,
            self.sight(closest_s)?,
        ) else {
            return Ok(None);
        };
        let mut brightest: Option<PassInstant> = None;
        let magnitude = |one: &PassInstant| one.point.band_mag().unwrap_or(f64::INFINITY);
        for t_s in times(samples.min(MAX_LIGHTS)).chain([nearest_s, closest_s]) {
            // The slow computation of light is skipped in the dark.
            let dark = |sight: Sight| sight.hidden.is_some();
            if !self.sight(t_s)?.is_none_or(dark)
                && let Some(one) = instant(t_s)?
                && magnitude(&one) < brightest.as_ref().map_or(f64::INFINITY, magnitude)
            {
                brightest = Some(one);
            }
        }
        Ok(Some(Pass {
            index,
            entry,
            exit,
            nearest,
            brightest,
            closest: (self.observer_track.epoch(closest_s), closest.range_m),
            rate_px_s: self.rate_px_s(nearest_s, [start, end])?,
            lit: self.lit(&seen, [start, end])?,
            in_field_at_start: start <= 0.0,
            in_field_at_end: end >= search.length_s(),
        }))
    }

    fn instant(
        &self,
        population: &Population,
        index: usize,
        t_s: f64,
    ) -> Result<Option<PassInstant>, NoPasses> {
        let Some(sight) = self.sight(t_s)? else {
            return Ok(None);
        };
        let light = |exposure_s: f64| {
            point_from(
                population,
                index,
                self.observer_track.at(t_s).state(t_s),
                self.corrections,
                self.observer_track.epoch(t_s),
                exposure_s,
            )
        };
        let point = match light(self.camera.exposure_s) {
            // States end within the exposure: use the instant alone.
            Err(NoLightCurve::Orbit(_)) => light(0.0),
            known => known,
        };
        match point {
            Ok(point) => Ok(sight.image_px.map(|position_px| PassInstant {
                point,
                position_px,
                off_axis: sight.off_axis,
            })),
            Err(NoLightCurve::Orbit(error)) => {
                self.lose(&error);
                Ok(None)
            }
            Err(error) => Err(error.into()),
        }
    }

    fn rate_px_s(&self, t_s: f64, [start, end]: [f64; 2]) -> Result<f64, NoPasses> {
        let before = (t_s - RATE_S / 2.0).max(start);
        let after = (t_s + RATE_S / 2.0).min(end);
        if after <= before {
            return Ok(0.0);
        }
        let [before_px, after_px] = [self.sight(before)?, self.sight(after)?]
            .map(|one| one.and_then(|sight| sight.image_px));
        let (Some(a), Some(b)) = (before_px, after_px) else {
            return Ok(0.0);
        };
        Ok(libm::hypot(b[0] - a[0], b[1] - a[1]) / (after - before))
    }

    /// Intervals of a pass with light, and with one reason for darkness each.
    fn lit(&self, seen: &[(f64, Sight)], [start, end]: [f64; 2]) -> Result<Vec<Lit>, NoPasses> {
        let mut parts = Vec::new();
        let mut from = start;
        let mut part = |to: f64, hidden| {
            parts.push(Lit {
                from: self.observer_track.epoch(from),
                to: self.observer_track.epoch(to),
                hidden,
            });
            from = to;
        };
        for pair in seen.windows(2) {
            let [(a_s, a), (b_s, b)] = pair else {
                continue;
            };
            if a.hidden != b.hidden {
                part(self.change([*a_s, *b_s], a.hidden)?, a.hidden);
            }
        }
        if let Some((_, last)) = seen.last() {
            part(end, last.hidden);
        }
        Ok(parts)
    }
}
