//! Plan of a run of the flight computer.

use std::time::Duration;

use hifitime::Epoch;
use skyloop_orbit::time::seconds;

use skyloop_protocols::{Attitude, OrbitState, Output, Positions};

use crate::pointing::Pointing;
use crate::profile::{OrbitSource, Profile, ProfileError};

/// Plan of a run.
#[derive(Clone)]
pub struct Mission {
    /// Time of the first attitude: in stepped mode the middle of the first exposure.
    pub start: Epoch,
    /// Step between the times of two attitudes in stepped mode, s, above 0.
    pub period_s: f64,
    /// Number of frames to request (stepped mode) or to receive (wall clock).
    pub frames: u32,
    /// Attitude profile.
    pub profile: Profile,
    /// Orbit. Without it no position is sent.
    pub orbit: Option<OrbitSource>,
    /// Time-out of a complete frame and of the first reply.
    pub timeout: Duration,
    /// Timing of the attitudes.
    pub pace: Pace,
    /// Requested content of frames; none: the emulator's configuration.
    pub output: Option<Output>,
    /// Requested window positions; none: the emulator's configuration.
    pub positions: Option<Positions>,
}

impl Mission {
    /// Time of attitude number `step` in stepped mode.
    #[must_use]
    pub fn epoch(&self, step: u32) -> Epoch {
        self.start + seconds(f64::from(step) * self.period_s)
    }

    /// Attitude message for `epoch`.
    ///
    /// # Errors
    /// [`ProfileError`]: no attitude, or no state.
    pub fn attitude(&self, sequence: u32, epoch: Epoch) -> Result<Attitude, ProfileError> {
        let orbit = self.orbit.as_ref();
        let pointing = self.profile.at(epoch, orbit)?;
        self.message(sequence, epoch, &pointing)
    }

    /// Attitude message for `epoch` with this pointing instead of the profile's.
    ///
    /// # Errors
    /// [`ProfileError::Orbit`]: no state.
    pub(crate) fn message(
        &self,
        sequence: u32,
        epoch: Epoch,
        pointing: &Pointing,
    ) -> Result<Attitude, ProfileError> {
        let orbit = self.orbit.as_ref();
        let state = orbit.map(|orbit| orbit(epoch)).transpose();
        let state = state.map_err(|source| ProfileError::Orbit { epoch, source })?;
        let q = pointing.attitude.as_vector();
        Ok(Attitude {
            sequence,
            q_icrf_to_body: [q.x, q.y, q.z, q.w],
            rates_rad_s: pointing.rates_rad_s.into(),
            state: state.map(|state| OrbitState {
                position_m: state.position_m.into(),
                velocity_m_s: state.velocity_m_s.into(),
            }),
        })
    }
}

/// Timing of the attitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// Each attitude is sent after the previous one's frame.
    Stepped {
        /// Maximum rate of attitudes, Hz, above 0.
        most_hz: Option<f64>,
    },
    /// Attitudes are sent by the wall clock, with time from [`Mission::start`] on; frames are
    /// received at any time.
    Wall {
        /// Rate of attitudes, Hz, above 0.
        rate_hz: f64,
    },
    /// No attitudes: receives the frames of another client.
    Listen,
}
