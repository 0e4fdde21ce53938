//! `--budget-ms`: tolerances for a time budget, by a measurement at the start of a run.

use super::common::progress;
use anyhow::{Context, bail};
use hifitime::Epoch;
use skyloop::attitude::VehicleState;
use skyloop::engine::Emulator;
use skyloop::fidelity::TOLERANCES;
use skyloop::measure::cost::{Chosen, Effort, Report, Unmeasured};
use skyloop_firmware_sim::console::say;
use skyloop_firmware_sim::text::decimal;
use std::ops::{ControlFlow, RangeInclusive};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The time budget of a frame.
#[derive(clap::Args)]
pub(super) struct Budget {
    /// Measure the settings of `fidelity` at the start, and use the most accurate one whose 99th
    /// percentile is within this time
    #[arg(long, value_name = "MS", value_parser = decimal(BUDGETS_MS), allow_hyphen_values = true)]
    budget_ms: Option<f64>,
}

/// Number of measured frames, and limits of the measurement.
pub(super) const FRAMES: u32 = 3;
const EFFORT: Effort = Effort {
    rounds: 101,
    limit: Duration::from_secs(10),
    one_core: false,
};

/// Permitted budgets, ms.
pub(super) const BUDGETS_MS: RangeInclusive<f64> = 1e-3..=1e6;

impl Budget {
    /// Sets the best tolerances of `emulator` for the frames of `vehicles`, which are computed only
    /// if there is a budget. Returns the choice as text; empty without a budget or if `stop` ends
    /// the measurement.
    pub fn settle(
        &self,
        emulator: &mut Emulator,
        stop: &AtomicBool,
        vehicles: impl FnOnce() -> anyhow::Result<Vec<VehicleState>>,
    ) -> anyhow::Result<String> {
        let Some(budget_ms) = self.budget_ms else {
            return Ok(String::new());
        };
        let bar = progress(1, "frames and rounds of --budget-ms");
        let measured = Report::measure(emulator, &vehicles()?, EFFORT, |done, all| {
            bar.set_length(all as u64);
            bar.set_position(done as u64);
            if stop.load(Ordering::Relaxed) {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        bar.finish_and_clear();
        let report = match measured {
            // `stop` also ends the run that follows.
            Err(Unmeasured::Stopped) => return Ok(String::new()),
            measured => measured?,
        };
        let Some(chosen) = report.chosen(budget_ms) else {
            bail!(
                "--budget-ms {budget_ms}: no setting was measured: please report it with the command you gave"
            );
        };
        emulator.set_fidelity(chosen.row.fidelity);
        let text = chosen_text(budget_ms, &chosen);
        if !chosen.fits {
            tracing::warn!("--budget-ms {budget_ms}: {}", text.trim_end());
            return Ok(String::new());
        }
        Ok(text)
    }
}

/// The choice as text, with its form in a configuration file.
pub(super) fn chosen_text(budget_ms: f64, chosen: &Chosen<'_>) -> String {
    let row = chosen.row;
    let mut text = format!(
        "fidelity for {budget_ms} ms: {}, p50 {:.2} ms, p99 {:.2} ms, rms {:.2e} e- a pixel against reference (fidelity = {})",
        row.setting,
        row.p50_ms,
        row.p99_ms,
        row.errors.frame_rms_e,
        in_file(chosen)
    );
    if !chosen.fits {
        text += "\nno setting is within the budget, this is the fastest: raise --budget-ms, switch off slow effects (`skyloop plan --measure` has their times), \
                 use a smaller detector or fewer stars (sky.catalog), or use a faster machine";
    }
    text + "\n"
}

/// The setting as the value of the key `fidelity`.
fn in_file(chosen: &Chosen<'_>) -> String {
    let row = chosen.row;
    match (row.tolerance, row.value) {
        (Some(tolerance), Some(value)) => {
            let is_word = TOLERANCES.iter().any(|other| {
                other.name == tolerance
                    && matches!(other.allowed, skyloop::fidelity::Allowed::Words(_))
            });
            let value = if is_word {
                format!("{:?}", value.to_string())
            } else {
                value.to_string()
            };
            format!("{{ preset = \"realtime\", {tolerance} = {value} }}")
        }
        _ => format!("{:?}", row.setting),
    }
}

/// States for a measurement with unknown pointing: along the six axes, at rest, now.
pub(super) fn states_along_axes() -> anyhow::Result<Vec<VehicleState>> {
    say(format_args!(
        "--budget-ms: without a [sequence] the pointing is not known: measured at the Earth's centre with body +Z along each of the six ICRF axis directions, without rotation\n"
    ))?;
    let epoch = Epoch::now().context("the system's time")?;
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let turns = [
        [0.0, 0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0, 0.0],
        [half, 0.0, 0.0, half],
        [-half, 0.0, 0.0, half],
        [0.0, half, 0.0, half],
        [0.0, -half, 0.0, half],
    ];
    let vehicles = turns
        .into_iter()
        .map(|q| VehicleState::new(0, epoch, q, [0.0; 3], None));
    vehicles
        .collect::<Result<_, _>>()
        .context("an attitude to measure at")
}
