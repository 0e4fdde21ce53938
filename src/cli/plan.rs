//! `skyloop plan`: what a frame of a scene would simulate and what not, why, what that costs and what it saves.

use super::mission;
use anyhow::{Context, bail};
use clap::Args as ClapArgs;
use serde::Serialize;
use skyloop::camera::Camera;
use skyloop::config::Config;
use skyloop::effect::EFFECTS;
use skyloop::engine::Emulator;
use skyloop::flight;
use skyloop::label::EffectLabel;
use skyloop::load::Folder;
use skyloop::measure::Bench;
use skyloop::orbit::time::utc_text;
use skyloop::plan::Plan;
use skyloop_firmware_sim::console::say;
use std::path::PathBuf;

/// Arguments of `skyloop plan`.
#[derive(ClapArgs)]
pub struct Args {
    /// Scene file with a [sequence] [default: the built-in FAI on CASSIOPE, 15 June 2019]
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    /// Another camera than the scene's: a built-in camera or a camera file
    #[arg(long, value_name = "NAME|FILE")]
    camera: Option<String>,
    /// Which frame of the sequence, from 0
    #[arg(long, value_name = "N", default_value_t = 0)]
    frame: u32,
    /// Render the frame, and set measured errors and times beside the declared ones (takes seconds, for slow frames minutes)
    #[arg(long)]
    measure: bool,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// A line of the plan.
#[derive(Serialize)]
struct Line {
    #[serde(flatten)]
    verdict: EffectLabel,
    #[serde(skip_serializing_if = "Option::is_none")]
    measured_error_e: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    measured_ms: Option<f64>,
}

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<()> {
    let mut config = match &args.scene {
        Some(scene) => Config::load(scene)?,
        None => Config::builtin()?,
    };
    if let Some(camera) = &args.camera {
        config.camera = Camera::load(camera, &Folder::current())?;
    }
    let mission = mission(&config, args.scene.as_deref())?;
    if args.frame >= mission.frames {
        let last = mission.frames - 1;
        bail!("--frame {}: the scene has frames 0 to {last}", args.frame);
    }
    let emulator = Emulator::new(&mut config);
    let bench = Bench {
        emulator: &emulator,
        camera: emulator.camera(),
        vehicle: flight::vehicle(&mission, args.frame)?,
    };
    let lines = lines(&bench, args.measure)?;
    if args.json {
        return Ok(say(format_args!(
            "{}\n",
            serde_json::to_string_pretty(&lines)?
        ))?);
    }
    let fidelity = emulator.fidelity();
    let head = format!(
        "frame {} of {}, {}, middle {}\nskipped: what changes no pixel by more than {} e- and moves no image by more than {} px",
        args.frame,
        args.scene.map_or("the built-in scene".to_string(), |s| s
            .display()
            .to_string()),
        bench.camera.name,
        utc_text(bench.vehicle.epoch),
        fidelity.skip_e,
        fidelity.skip_px,
    );
    say(format_args!("{head}\n{}", table(&lines)))?;
    Ok(())
}

fn lines(bench: &Bench<'_>, measure: bool) -> anyhow::Result<Vec<Line>> {
    let (emulator, choice) = (bench.emulator, &bench.emulator.choice);
    let scene = emulator.scene(&bench.camera, &bench.vehicle, 0, choice)?;
    let plan = Plan::new(&scene, emulator.fidelity(), choice);
    let mut lines: Vec<Line> = plan
        .steps
        .iter()
        .map(|step| Line {
            verdict: EffectLabel::new(step),
            measured_error_e: None,
            measured_ms: None,
        })
        .collect();
    if measure {
        let single = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let times = single
            .context("a pool of one thread to measure in")?
            .install(|| bench.times_ms(choice))?;
        let all = skyloop::fidelity::Choice {
            all: true,
            ..choice.clone()
        };
        for ((line, effect), ms) in lines.iter_mut().zip(EFFECTS).zip(times) {
            line.measured_error_e = Some(bench.error_e(effect, &all)?);
            line.measured_ms = line.verdict.run.then_some(ms);
        }
    }
    Ok(lines)
}

/// The plan as columns.
fn table(lines: &[Line]) -> String {
    let measured = lines.iter().any(|line| line.measured_error_e.is_some());
    let mut text = format!("  {:<18} {:<5} {:>17}", "effect", "", "error if skipped");
    if measured {
        text += &format!(" {:>12}", "measured");
    }
    text += &format!(" {:>10}", "price");
    if measured {
        text += &format!(" {:>10}", "measured");
    }
    text += "  because\n";
    for line in lines {
        let verdict = &line.verdict;
        let error = if verdict.error_px > 0.0 {
            format!("{} px", short(verdict.error_px))
        } else {
            format!("{} e-", short(verdict.error_e))
        };
        let run = if verdict.run { "run" } else { "skip" };
        text += &format!("  {:<18} {run:<5} {error:>17}", verdict.effect);
        let ms = |ms: Option<f64>| ms.map_or("-".to_string(), |ms| format!("{ms:.3} ms"));
        if let Some(e) = line.measured_error_e {
            text += &format!(" {:>12}", format!("{} e-", short(e)));
        }
        text += &format!(" {:>10}", ms(verdict.price_ms));
        if measured {
            text += &format!(" {:>10}", ms(line.measured_ms));
        }
        text += &format!("  {}\n", verdict.why);
    }
    let price: f64 = lines.iter().filter_map(|line| line.verdict.price_ms).sum();
    let times = lines.iter().filter_map(|line| line.measured_ms);
    text += &format!("  {price:.2} ms on one core in all");
    if measured {
        text += &format!(", measured {:.2} ms", times.sum::<f64>());
    }
    text + "\n"
}

/// Three digits.
fn short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_string(),
        1e-3..1e5 => {
            let decimals = (2 - value.abs().log10().floor() as i32).max(0) as usize;
            format!("{value:.decimals$}")
        }
        _ => format!("{value:.2e}"),
    }
}
