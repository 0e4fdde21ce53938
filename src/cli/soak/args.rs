//! The arguments of `skyloop soak`.

use crate::cli::common::{Force, Orbits, Records, levels};
use clap::Args as ClapArgs;
use skyloop::soak::Limits;
use skyloop_firmware_sim::text::decimal;
use std::path::{Path, PathBuf};

#[derive(ClapArgs)]
pub struct Args {
    /// Run file with a [sequence]; the run uses its first attitude and rates; its clock is wall or
    /// external
    #[arg(long, value_name = "FILE")]
    pub config: PathBuf,
    /// Duration in minutes
    #[arg(long, value_name = "M", default_value_t = 1.0, value_parser = decimal(0.001..=100_000.0), allow_negative_numbers = true)]
    pub minutes: f64,
    /// Maximum fraction of exposures whose frame misses its deadline
    #[arg(long, value_name = "SHARE", default_value_t = 1e-3, value_parser = decimal(0.0..=1.0), allow_negative_numbers = true)]
    max_miss_rate: f64,
    /// Maximum 99th percentile from the trigger to the client's last packet. The trigger is the end
    /// of the exposure, or the arrival of its attitude if later; an incomplete frame counts as
    /// infinite [default: no limit]
    #[arg(long, value_name = "X", value_parser = decimal(0.001..=1e6), allow_negative_numbers = true)]
    max_p99_ms: Option<f64>,
    /// Maximum growth of memory, as a fraction, from a fifth of the run (at most a minute) to its
    /// end [default: no limit]
    #[arg(long, value_name = "SHARE", value_parser = decimal(0.0..=1e6), allow_negative_numbers = true)]
    max_growth: Option<f64>,
    /// Link between emulator and client: memory, udp, serial, pty, can or slcan, as in `loopback`
    #[arg(long, default_value = "udp")]
    pub link: String,
    /// Content of frames [default: the file's]
    #[arg(long, value_name = "LEVEL", value_parser = levels())]
    pub output: Option<String>,
    /// Attitudes per second [default: two per frame]
    #[arg(long, value_name = "HZ", value_parser = decimal(1e-3..=1e5), allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// Write the verdicts as JUnit XML
    #[arg(long, value_name = "FILE")]
    pub junit: Option<PathBuf>,
    /// Write the whole report as JSON
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Address for Prometheus metrics, such as 127.0.0.1:9464 [default: the file's, else none]
    #[arg(long, value_name = "ADDRESS")]
    pub metrics: Option<String>,
    #[command(flatten)]
    pub force: Force,
    #[command(flatten)]
    pub records: Records,
    #[command(flatten)]
    pub orbits: Orbits,
}

impl Args {
    /// Input and output files, by the names of their options.
    pub fn files(&self) -> Vec<(&'static str, &Path)> {
        let outputs = [("--junit", &self.junit), ("--json", &self.json)];
        let outputs = outputs
            .into_iter()
            .filter_map(|(name, file)| Some((name, file.as_deref()?)));
        std::iter::once(("--config", self.config.as_path()))
            .chain(outputs)
            .collect()
    }

    /// The limits of the run.
    pub fn limits(&self) -> Limits {
        Limits {
            max_miss_rate: self.max_miss_rate,
            max_p99_ms: self.max_p99_ms,
            max_growth: self.max_growth,
        }
    }

    /// The limits that are checked, by the names of their verdicts.
    pub fn checks(&self) -> Vec<&'static str> {
        let checks = [
            ("deadlines", true),
            ("p99", self.max_p99_ms.is_some()),
            ("memory", self.max_growth.is_some()),
        ];
        let set = checks.iter().filter(|(_, is_set)| *is_set);
        set.map(|(name, _)| *name).collect()
    }
}
