//! Position and pointing of a camera, as options of `render`, `plan` and `passes`.

use super::numbers::Numbers;
use anyhow::{Context, anyhow};
use clap::Args;
use clap::builder::PossibleValuesParser;
use hifitime::Epoch;
use skyloop::attitude::{Attitude, VehicleState};
use skyloop::config::{
    Config, LookAt, Observer, Sequence, Target, TimedAttitude, Up, attitude_of_radec,
};
use skyloop::load::{Folder, orbits};
use skyloop_firmware_sim::text::number;

#[derive(Args)]
pub struct Place {
    /// State of the observer at the first instant, in km and km/s, GCRF, instead of a scene's
    /// observer; propagated by two-body motion with J2
    #[arg(
        long,
        value_name = "x,y,z,vx,vy,vz",
        allow_hyphen_values = true,
        conflicts_with = "orbit"
    )]
    state: Option<Numbers<6>>,
    /// Observer's orbit from a TLE, 3LE, OMM or OEM file, instead of a scene's observer
    #[arg(long, value_name = "FILE[:NAME]")]
    orbit: Option<String>,
}

impl Place {
    /// The observer, if one is given; refused records of its file are added to `findings`. Errors
    /// about `--state` have its units.
    pub fn observer(&self, findings: &mut orbits::Findings) -> anyhow::Result<Option<Observer>> {
        if let Some(selector) = &self.orbit {
            let object = orbits::one(&Folder::current(), selector, findings).context("--orbit")?;
            return Ok(Some(Observer::Object(Box::new(object))));
        }
        let state = self.state.map(|Numbers(state)| Observer::at_km(state));
        let state = state.transpose();
        state.map_err(|why| anyhow!("--state {why}"))
    }
}

#[derive(Args)]
pub struct Pointing {
    /// Unit quaternion x,y,z,w from ICRF to body, scalar last, at the first instant
    #[arg(
        long,
        value_name = "x,y,z,w",
        allow_hyphen_values = true,
        conflicts_with_all = ["radec", "nadir", "look_at"]
    )]
    attitude: Option<Numbers<4>>,
    /// Right ascension and declination of the boresight (ICRF) and position angle of image up (-Y),
    /// from north through east, at the first instant, deg
    #[arg(
        long,
        value_name = "RA,DEC,ROLL",
        allow_hyphen_values = true,
        conflicts_with_all = ["nadir", "look_at"]
    )]
    radec: Option<Numbers<3>>,
    /// +Z to the Earth's centre, +X towards the velocity
    #[arg(long, conflicts_with = "look_at")]
    nadir: bool,
    /// Point the boresight at a target and follow it: Sun, Moon, a planet, name or number of an
    /// object, limb:HEIGHT_KM[,AZIMUTH_DEG], velocity, or RA,DEC in deg
    #[arg(long, value_name = "TARGET", allow_hyphen_values = true)]
    look_at: Option<String>,
    /// With --look-at: reference direction for image up (-Y) [default: north; zenith for limb and
    /// velocity]
    #[arg(long, value_name = "WHAT", requires = "look_at", value_parser = PossibleValuesParser::new(Up::ALL.map(|(name, _)| name)))]
    up: Option<String>,
    /// With --look-at: position angle of -Y from that direction, in the sense from north through
    /// east, deg
    #[arg(long, value_name = "DEG", requires = "look_at", value_parser = number, allow_hyphen_values = true)]
    roll: Option<f64>,
    /// With --attitude or --radec: body rates in deg/s, body axes, from the first instant on
    #[arg(long, value_name = "wx,wy,wz", allow_hyphen_values = true)]
    rates: Option<Numbers<3>>,
}

impl Pointing {
    /// One exposure with this pointing from `epoch` on, for the camera and the objects of `config`;
    /// `None` without any of the options.
    pub fn sequence(&self, epoch: Epoch, config: &Config) -> anyhow::Result<Option<Sequence>> {
        let look_at = self.target(config)?;
        let attitude = match (self.attitude, self.radec) {
            (Some(Numbers(q)), _) => Some(Attitude::from_xyzw(q).context("--attitude")?),
            (None, Some(Numbers(angles))) => Some(
                attitude_of_radec(angles, &config.camera)
                    .map_err(|why| anyhow!("--radec {why}"))?,
            ),
            (None, None) => None,
        };
        if self.rates.is_some() && attitude.is_none() {
            return Err(anyhow!(
                "--rates: the rates of an attitude that --attitude or --radec gives; --nadir and --look-at have their own: leave --rates out"
            ));
        }
        if attitude.is_none() && look_at.is_none() && !self.nadir {
            return Ok(None);
        }
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
            look_at,
            attitude_file: None,
            rates,
        }))
    }

    fn target(&self, config: &Config) -> anyhow::Result<Option<LookAt>> {
        let Some(text) = &self.look_at else {
            // `requires` of clap has no effect if another option excludes the required one.
            if self.up.is_some() || self.roll.is_some() {
                return Err(anyhow!(
                    "--up and --roll are rules of --look-at: give that, or leave them out"
                ));
            }
            return Ok(None);
        };
        let target = Target::parse(text, &config.objects);
        let target = target.map_err(|why| anyhow!("--look-at: {why}"))?;
        let roll = self.roll.unwrap_or(0.0);
        if roll.abs() > 360.0 {
            return Err(anyhow!("--roll {roll}: must be -360 to 360 deg"));
        }
        let named = |name: &String| Up::ALL.into_iter().find(|(known, _)| known == name);
        let up = self.up.as_ref().and_then(named).map(|(_, up)| up);
        Ok(Some(LookAt::new(target, up, roll.to_radians())))
    }
}
