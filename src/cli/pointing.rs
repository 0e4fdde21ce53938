//! Where a camera looks, as `render` and `passes` are told on the command line.

use super::render::Numbers;
use anyhow::{Context, bail};
use clap::Args;
use hifitime::Epoch;
use skyloop::attitude::{Attitude, VehicleState};
use skyloop::camera::Camera;
use skyloop::config::{Sequence, TimedAttitude};

/// One of three ways to say it.
#[derive(Args)]
pub struct Pointing {
    /// Unit quaternion x,y,z,w from ICRF to body, scalar last, at the first instant
    #[arg(
        long,
        value_name = "x,y,z,w",
        allow_hyphen_values = true,
        group = "fixed",
        conflicts_with_all = ["radec", "nadir"]
    )]
    attitude: Option<Numbers<4>>,
    /// The boresight's right ascension and declination (ICRF), and the position angle of what is up in the image (-Y), from north
    /// through east; deg, at the first instant
    #[arg(
        long,
        value_name = "RA,DEC,ROLL",
        allow_hyphen_values = true,
        group = "fixed",
        conflicts_with = "nadir"
    )]
    radec: Option<Numbers<3>>,
    /// +Z to the Earth's centre, +X towards the velocity
    #[arg(long)]
    nadir: bool,
    /// Body rates in deg/s, body axes, from the first instant on
    #[arg(
        long,
        value_name = "wx,wy,wz",
        allow_hyphen_values = true,
        requires = "fixed"
    )]
    rates: Option<Numbers<3>>,
}

impl Pointing {
    /// One exposure of `camera` that looks there from `epoch` on; nothing where nothing is said.
    pub fn sequence(&self, epoch: Epoch, camera: &Camera) -> anyhow::Result<Option<Sequence>> {
        let attitude = match (self.attitude, self.radec) {
            (Some(Numbers(q)), _) => Some(Attitude::from_xyzw(q).context("--attitude")?),
            (None, Some(Numbers(angles))) => Some(looking(angles, camera)?),
            (None, None) if self.nadir => None,
            (None, None) => return Ok(None),
        };
        let rates = self.rates.map_or([0.0; 3], |Numbers(rates)| rates);
        let rates = rates.map(f64::to_radians);
        let q = attitude.unwrap_or(Attitude::identity()).xyzw();
        VehicleState::new(0, epoch, q, rates, None).context("--rates (deg/s)")?;
        let attitude = attitude.map(|attitude| TimedAttitude { epoch, attitude });
        Ok(Some(Sequence {
            epoch,
            frames: 1,
            period_s: 1.0,
            attitudes: attitude.into_iter().collect(),
            attitude_file: None,
            rates,
        }))
    }
}

/// The body's attitude in which the camera's boresight is there.
fn looking([ra, dec, roll]: [f64; 3], camera: &Camera) -> anyhow::Result<Attitude> {
    if !(-90.0..=90.0).contains(&dec) || ra.abs() > 360.0 || roll.abs() > 360.0 {
        bail!(
            "--radec {ra},{dec},{roll}: must be RA -360 to 360, DEC -90 to 90, ROLL -360 to 360; the option is in deg"
        );
    }
    let [ra, dec, roll] = [ra, dec, roll].map(f64::to_radians);
    let camera_attitude = Attitude::towards(ra, dec, roll);
    Ok(camera_attitude.then(&camera.mounting.inverse()))
}
