//! The brightness of one object over time for an observer in orbit, without camera and frame.

use crate::attitude::{Attitude, VehicleState};
use crate::label::why_hidden;
use crate::scene::{Exposure, Hidden, Unobservable, shutter};
use crate::sky::population::OWN_VEHICLE_M;
use crate::sky::shadow::Earth;
use crate::sky::{Corrections, Population};
use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop_orbit::time::{seconds, utc_text};
use skyloop_orbit::{Object, OrbitError, StateVector};
use thiserror::Error;

/// An object at one instant.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Middle of the exposure.
    pub epoch: Epoch,
    /// Mean magnitude over the exposure by Eq. (9), in full sunlight. Infinite without reflected
    /// light, or if the object is the observer itself.
    pub mag: f64,
    /// Distance from the observer, m.
    pub range_m: f64,
    /// Angle Sun - object - observer, rad.
    pub phase: f64,
    /// Visible fraction of the Sun's disc at the object, 0..1.
    pub illumination: f64,
    /// Why no light arrives, if none does.
    pub hidden: Option<Hidden>,
}

/// The instants of a light curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// The first.
    pub from: Epoch,
    /// Time step, s.
    pub step_s: f64,
    /// Number of instants.
    pub points: u32,
    /// Averaging time around each instant, s.
    pub exposure_s: f64,
}

/// Reasons why there is no light curve.
#[derive(Debug, Error)]
pub enum NoLightCurve {
    /// Observer or object has no state.
    #[error(transparent)]
    Orbit(#[from] OrbitError),
    /// The observer is inside the Earth.
    #[error(
        "the observer {observer} is below the ground (WGS84) at {}: must be above it; check orbit, units and epochs",
        utc_text(*epoch)
    )]
    BelowGround {
        /// The observer's label.
        observer: String,
        /// The instant.
        epoch: Epoch,
    },
    /// The state or the epoch is not observable.
    #[error(transparent)]
    Unobservable(#[from] Unobservable),
}

impl Point {
    /// Magnitude of the arriving light, if any. Objects have the Sun's colour: it is the same in
    /// any band.
    pub fn band_mag(&self) -> Option<f64> {
        let seen = self.reason().is_empty() && self.illumination > 0.0;
        seen.then(|| self.mag - 2.5 * libm::log10(self.illumination))
    }

    /// Why no light arrives; empty if some does.
    pub fn reason(&self) -> &'static str {
        match self.hidden {
            _ if self.range_m < OWN_VEHICLE_M => "at the observer itself",
            Some(hidden) => why_hidden(hidden),
            None if self.mag.is_finite() => "",
            None => "reflects nothing this way",
        }
    }
}

impl Span {
    /// Its instants.
    pub fn epochs(&self) -> impl Iterator<Item = Epoch> {
        let Span { from, step_s, .. } = *self;
        (0..self.points).map(move |i| from + seconds(step_s * f64::from(i)))
    }
}

/// The object of that index as `observer` sees it at `epoch`, its light averaged over `exposure_s`.
pub fn point(
    population: &Population,
    index: usize,
    observer: &Object,
    corrections: &Corrections,
    epoch: Epoch,
    exposure_s: f64,
) -> Result<Point, NoLightCurve> {
    let earth = Earth::at(epoch);
    let state = observer.state(epoch)?;
    if earth.contains(state.position_m) {
        let observer = observer.label();
        return Err(NoLightCurve::BelowGround { observer, epoch });
    }
    point_from(population, index, state, corrections, epoch, exposure_s)
}

/// [`point`] for an observer at `state`.
pub fn point_from(
    population: &Population,
    index: usize,
    state: StateVector,
    corrections: &Corrections,
    epoch: Epoch,
    exposure_s: f64,
) -> Result<Point, NoLightCurve> {
    let earth = Earth::at(epoch);
    let vehicle = VehicleState {
        sequence: 0,
        epoch,
        attitude: Attitude::identity(),
        rates: Vector3::zeros(),
        orbit: Some(state),
    };
    let shutter = shutter(&vehicle, &Exposure::around(epoch, exposure_s))?;
    let seen = population.see(index, &earth, &shutter, corrections)?;
    Ok(Point {
        epoch,
        mag: if seen.apparent.range_m < OWN_VEHICLE_M {
            f64::INFINITY
        } else {
            seen.mag
        },
        range_m: seen.apparent.range_m,
        phase: seen.phase,
        illumination: seen.illumination,
        hidden: why_dark(seen.occulted, seen.illumination),
    })
}

/// Why no light arrives from an object that the Earth occults, or that sees this fraction of the
/// Sun's disc.
pub fn why_dark(occulted: bool, illumination: f64) -> Option<Hidden> {
    if occulted {
        Some(Hidden::ByEarth)
    } else {
        (illumination <= 0.0).then_some(Hidden::InShadow)
    }
}
