//! What the flight computer is to do.

use std::time::Duration;

use hifitime::Epoch;
use skyloop_orbit::time::seconds;

use skyloop_protocols::{Attitude, OrbitState, Output, Positions};

use crate::pointing::Pointing;
use crate::profile::{OrbitSource, Profile, ProfileError};

/// What the flight computer is to do.
#[derive(Clone)]
pub struct Mission {
    /// Time of the first attitude: in stepped mode the middle of the first exposure.
    pub start: Epoch,
    /// Step between the times of two attitudes in stepped mode, s, above 0.
    pub period_s: f64,
    /// Frames to ask for or, by the wall clock, to wait for.
    pub frames: u32,
    /// Where to point.
    pub profile: Profile,
    /// Where to be. Without it no position is sent.
    pub orbit: Option<OrbitSource>,
    /// How long to wait for a whole frame; also for the first answer.
    pub timeout: Duration,
    /// What sets the pace.
    pub pace: Pace,
    /// What of each frame the emulator is asked to send; without it, what it is configured to.
    pub output: Option<Output>,
    /// Where windows are asked for; without it, where the emulator is configured to cut them.
    pub positions: Option<Positions>,
}

impl Mission {
    /// The time of attitude number `step` in stepped mode.
    #[must_use]
    pub fn epoch(&self, step: u32) -> Epoch {
        self.start + seconds(f64::from(step) * self.period_s)
    }

    /// The attitude message for `epoch`.
    ///
    /// # Errors
    /// [`ProfileError`]: no attitude, or no state.
    pub fn attitude(&self, sequence: u32, epoch: Epoch) -> Result<Attitude, ProfileError> {
        let orbit = self.orbit.as_ref();
        let pointing = self.profile.at(epoch, orbit)?;
        self.message(sequence, epoch, &pointing)
    }

    /// The attitude message for `epoch` of a body that points so, whatever the profile says.
    ///
    /// # Errors
    /// [`ProfileError::Orbit`]: no state.
    pub fn message(
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

/// What sets the pace of the attitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// The next attitude leaves when the last one's frame is in.
    Stepped {
        /// Attitudes a second at most, Hz, above 0.
        most_hz: Option<f64>,
    },
    /// Attitudes leave by the wall clock, their time running on from [`Mission::start`]; frames come as they come.
    Wall {
        /// Attitudes a second, Hz, above 0.
        rate_hz: f64,
    },
    /// No attitudes leave: frames come as another client has them made.
    Listen,
}
