//! `skyloop cost`: times and errors of each setting of the tolerances.

use super::budget::{BUDGETS_MS, chosen_text};
use super::common::{Force, Records, mission, progress, say_json, scene, scene_name, warn_of_old};
use clap::Args as ClapArgs;
use serde::Serialize;
use skyloop::attitude::VehicleState;
use skyloop::engine::Emulator;
use skyloop::flight;
use skyloop::measure::cost::{Effort, ROUNDS, Report, Row};
use skyloop::orbit::path_text;
use skyloop::output::{
    Dot, SVG_MARK, Scatter, make_folder, may_replace, write_scatter, write_text,
};
use skyloop_firmware_sim::console::say;
use skyloop_firmware_sim::mission::Mission;
use skyloop_firmware_sim::text::{decimal, whole};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Duration;

#[derive(ClapArgs)]
pub struct Args {
    /// Scene file with a [sequence] [default: the built-in FAI on CASSIOPE, 15 June 2019]
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    /// Name the most accurate setting whose 99th percentile is within this time
    #[arg(long, value_name = "MS", value_parser = decimal(BUDGETS_MS), allow_hyphen_values = true)]
    budget_ms: Option<f64>,
    /// Number of frames, spread over the sequence, on which errors are measured
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = whole(1..=1000u32), allow_negative_numbers = true)]
    frames: u32,
    /// Maximum number of timed rounds; none begins after two minutes
    #[arg(long, value_name = "N", default_value_t = ROUNDS as u32, value_parser = whole(1..=100_000u32), allow_negative_numbers = true)]
    rounds: u32,
    /// Render on one thread, and report its share of the processor: for machines with other load
    #[arg(long)]
    one_core: bool,
    /// Folder for cost.csv and cost.svg, created if needed
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    records: Records,
}

/// No further rounds after this time.
const LIMIT: Duration = Duration::from_secs(120);
const LINES: &str = "cost.csv";
const PICTURE: &str = "cost.svg";
/// Start of the table's header.
const HEAD: &str = "setting,knob,value,";

#[derive(Serialize)]
struct Whole<'a> {
    scene: &'a str,
    #[serde(flatten)]
    report: &'a Report,
    budget_ms: Option<f64>,
    chosen: Option<&'a str>,
    fits: Option<bool>,
}

pub fn run(args: Args) -> anyhow::Result<()> {
    let mut config = scene(args.scene.as_deref())?;
    args.records.settle(&config)?;
    let mission = mission(&config, args.scene.as_deref())?;
    if let Some(dir) = &args.out {
        make_folder(dir)?;
        let picture = (PICTURE, SVG_MARK);
        may_replace(dir, (LINES, &[HEAD]), &[picture], args.force.force)?;
    }
    let vehicles = spread(&mission, args.frames)?;
    let mut emulator = Emulator::new(&mut config);
    if let Some(first) = vehicles.first() {
        warn_of_old(emulator.world().population.objects(), first.epoch);
    }
    let effort = Effort {
        rounds: args.rounds as usize,
        limit: LIMIT,
        one_core: args.one_core,
    };
    let bar = progress(1, "frames and rounds");
    let report = Report::measure(&mut emulator, &vehicles, effort, |done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
        ControlFlow::Continue(())
    })?;
    bar.finish_and_clear();
    let name = scene_name(args.scene.as_deref());
    let chosen = args.budget_ms.and_then(|budget| report.chosen(budget));
    if args.json {
        let whole = Whole {
            scene: &name,
            report: &report,
            budget_ms: args.budget_ms,
            chosen: chosen.map(|chosen| chosen.row.setting.as_str()),
            fits: chosen.map(|chosen| chosen.fits),
        };
        say_json(&whole)?;
    } else {
        say(format_args!("{report}"))?;
        if let (Some(budget), Some(chosen)) = (args.budget_ms, &chosen) {
            say(format_args!("\n{}", chosen_text(budget, chosen)))?;
        }
    }
    if let Some(dir) = &args.out {
        write_text(&dir.join(LINES), &report.csv(), &[HEAD], args.force.force)?;
        write_scatter(dir, PICTURE, &plot(&report, &name, args.budget_ms))?;
        if !args.json {
            say(format_args!("wrote {}\n", path_text(dir)))?;
        }
    }
    Ok(())
}

/// The states of at most `max` frames, spread evenly over a mission.
pub(super) fn spread(mission: &Mission, max: u32) -> anyhow::Result<Vec<VehicleState>> {
    let count = max.min(mission.frames);
    let last = u64::from(mission.frames.saturating_sub(1));
    let number = |i: u32| match count {
        0 | 1 => 0,
        _ => (u64::from(i) * last / u64::from(count - 1)) as u32,
    };
    let vehicles = (0..count).map(|i| flight::vehicle(mission, number(i)));
    Ok(vehicles.collect::<Result<_, _>>()?)
}

fn plot(report: &Report, scene: &str, budget_ms: Option<f64>) -> Scatter {
    // A setting with the errors of a preset needs no name, unless the line joins it.
    let presets = || report.rows.iter().filter(|row| row.tolerance.is_none());
    let is_named = |row: &Row| {
        row.tolerance.is_none() || row.is_front || !presets().any(|preset| preset.is_alike(row))
    };
    let dot = |row: &Row| Dot {
        at: [row.p50_ms, row.errors.frame_rms_e],
        name: if is_named(row) {
            row.setting.clone()
        } else {
            String::new()
        },
        is_large: row.tolerance.is_none(),
        is_front: row.is_front,
    };
    Scatter {
        title: format!("{scene}, {}", report.camera),
        axes: [
            "median time of a frame, ms; the line joins what no setting beats in both",
            "rms of pixels against reference, e-",
        ],
        dots: report.rows.iter().map(dot).collect(),
        limit: budget_ms.map(|ms| (ms, format!("budget {ms} ms"))),
    }
}
