//! Start and end, as options of `passes` and `lightcurve`.

use anyhow::{Error, anyhow};
use hifitime::Epoch;
use skyloop::config::Sequence;
use skyloop::orbit::time::{parse_utc, seconds};

#[derive(clap::Args)]
pub struct Interval {
    /// First instant [default: the scene's first exposure]
    #[arg(long, value_name = "UTC", value_parser = parse_utc)]
    pub from: Option<Epoch>,
    /// Last instant [default: the scene's last exposure]
    #[arg(long, value_name = "UTC", value_parser = parse_utc)]
    pub to: Option<Epoch>,
}

impl Interval {
    /// The first and the last instant; by default those of the scene's sequence.
    pub fn ends(&self, sequence: Option<&Sequence>, scene: &str) -> anyhow::Result<[Epoch; 2]> {
        let last = |s: &Sequence| s.epoch + seconds(s.period_s * f64::from(s.frames - 1));
        let from = self.from.or(sequence.map(|s| s.epoch));
        let to = self.to.or(sequence.map(last));
        let from = from.ok_or_else(|| Interval::missing(scene, "--from UTC"))?;
        let to = to.ok_or_else(|| Interval::missing(scene, "--to UTC"))?;
        Ok([from, to])
    }

    /// The error of an option that neither the command line nor the scene gives.
    pub fn missing(scene: &str, option: &str) -> Error {
        anyhow!("{scene}: no [sequence] to take it from: give {option}")
    }
}
