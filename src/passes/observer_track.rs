//! The observer's path in steps: position and attitude at every instant, interpolated instead of
//! computed from orbit and sidereal time.

use super::request::NoPasses;
use hifitime::Epoch;
use nalgebra::{Matrix3, Vector3};
use skyloop_config::flight::Flight;
use skyloop_orbit::time::seconds;
use skyloop_orbit::{StateVector, frames};
use skyloop_render::attitude::VehicleState;
use skyloop_render::scene::{Exposure, shutter};
use skyloop_render::sky::apparent::Observer;
use skyloop_render::sky::population::Shutter;
use skyloop_render::sky::shadow::Earth;

/// Knots of the polynomial of a step. With knots 2.5 s apart, its error is 1e-7 m in a low orbit.
const KNOTS: usize = 5;

/// The observer's path during a search.
pub(super) struct ObserverTrack<'a> {
    flight: &'a Flight,
    from: Epoch,
    step_s: f64,
    pub(super) steps: Vec<Step>,
}

/// The observer's path during a step.
pub(super) struct Step {
    /// Seconds since the search began.
    pub(super) start_s: f64,
    pub(super) end_s: f64,
    /// Start, middle and end of the step.
    pub(super) shutter: Shutter,
    pub(super) vehicle: VehicleState,
    /// Largest rotation rate of the body, rad/s.
    pub(super) rate: f64,
    /// TEME to GCRF in the middle; it is constant over seconds.
    pub(super) rotation: Matrix3<f64>,
    /// The Earth in the middle.
    pub(super) earth: Earth,
    knots: [StateVector; KNOTS],
}

impl<'a> ObserverTrack<'a> {
    /// Covers `length_s` from `from` on in steps of up to `step_s`; rates are sampled every
    /// `sample_s`.
    pub(super) fn new(
        flight: &'a Flight,
        from: Epoch,
        length_s: f64,
        step_s: f64,
        sample_s: f64,
    ) -> Result<Self, NoPasses> {
        let count = (length_s / step_s).ceil().max(1.0);
        let step_s = length_s / count;
        let mut observer_track = Self {
            flight,
            from,
            step_s,
            steps: Vec::new(),
        };
        for number in 0..count as usize {
            let step = observer_track.step(number as f64 * step_s, sample_s)?;
            observer_track.steps.push(step);
        }
        Ok(observer_track)
    }

    /// The instant `t_s` after the beginning.
    pub(super) fn epoch(&self, t_s: f64) -> Epoch {
        self.from + seconds(t_s)
    }

    /// The step of an instant; the last step ends with the search.
    pub(super) fn at(&self, t_s: f64) -> &Step {
        let number = (t_s / self.step_s) as usize;
        &self.steps[number.min(self.steps.len() - 1)]
    }

    pub(super) fn vehicle(&self, t_s: f64) -> Result<VehicleState, NoPasses> {
        let state = self.at(t_s).state(t_s);
        Ok(self.flight.vehicle(self.epoch(t_s), state)?)
    }

    fn step(&self, start_s: f64, sample_s: f64) -> Result<Step, NoPasses> {
        let length_s = self.step_s;
        let mid = self.epoch(start_s + length_s / 2.0);
        let fraction = |k: usize| k as f64 / (KNOTS - 1) as f64;
        let mut knots = [self.flight.state(mid)?; KNOTS];
        for (k, knot) in knots.iter_mut().enumerate() {
            *knot = (self.flight).state(self.epoch(start_s + length_s * fraction(k)))?;
        }
        let earth = Earth::at(mid);
        let vehicle = self.flight.vehicle(mid, knots[KNOTS / 2])?;
        let mut step = Step {
            start_s,
            end_s: start_s + length_s,
            shutter: shutter(&vehicle, &Exposure::around(mid, length_s))?,
            vehicle,
            rate: 0.0,
            rotation: frames::teme_to_gcrf(mid),
            earth,
            knots,
        };
        if earth.contains(step.vehicle_m()) {
            return Err(NoPasses::BelowGround { epoch: mid });
        }
        let samples = (length_s / sample_s).ceil() as usize;
        for sample in 0..=samples {
            let t_s = start_s + length_s * sample as f64 / samples as f64;
            let vehicle = self.flight.vehicle(self.epoch(t_s), step.state(t_s))?;
            step.rate = step.rate.max(vehicle.rates.norm());
        }
        Ok(step)
    }
}

impl Step {
    fn vehicle_m(&self) -> Vector3<f64> {
        self.knots[KNOTS / 2].position_m
    }

    /// The observer's state by Lagrange's polynomial through the knots.
    pub(super) fn state(&self, t_s: f64) -> StateVector {
        let x = (t_s - self.start_s) / (self.end_s - self.start_s) * (KNOTS - 1) as f64;
        let mut state = StateVector {
            position_m: Vector3::zeros(),
            velocity_m_s: Vector3::zeros(),
        };
        for (i, knot) in self.knots.iter().enumerate() {
            let others = (0..KNOTS).filter(|j| *j != i);
            let weight: f64 = others
                .map(|j| (x - j as f64) / (i as f64 - j as f64))
                .product();
            state.position_m += knot.position_m * weight;
            state.velocity_m_s += knot.velocity_m_s * weight;
        }
        state
    }

    pub(super) fn observer(&self, epoch: Epoch, t_s: f64) -> Observer {
        let state = self.state(t_s);
        let middle_s = (self.start_s + self.end_s) / 2.0;
        Observer {
            epoch,
            position_m: state.position_m,
            velocity_m_s: state.velocity_m_s,
            bodies: self.shutter[1].bodies.after(t_s - middle_s),
        }
    }
}
