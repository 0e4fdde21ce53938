//! `skyloop plan`: effects that a frame simulates or skips, with reasons, errors and times.

use super::common::{Records, mission, progress, say_json, scene, scene_name, warn_of_old};
use super::pointing::Pointing;
use anyhow::{Context, bail};
use clap::Args as ClapArgs;
use serde::Serialize;
use skyloop::camera::Camera;
use skyloop::config::Sequence;
use skyloop::effect::{EFFECTS, three_digits};
use skyloop::engine::Emulator;
use skyloop::fidelity::Choice;
use skyloop::flight;
use skyloop::label::EffectLabel;
use skyloop::load::Folder;
use skyloop::measure::Bench;
use skyloop::orbit::time::utc_text;
use skyloop_firmware_sim::console::say;
use skyloop_firmware_sim::text::whole;
use std::path::PathBuf;

#[derive(ClapArgs)]
pub struct Args {
    /// Scene file with a [sequence] [default: the built-in FAI on CASSIOPE, 15 June 2019]
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    /// Camera instead of the scene's: a built-in camera or a camera file
    #[arg(long, value_name = "NAME|FILE")]
    camera: Option<String>,
    /// Frame of the sequence, from 0
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = whole(0..=u32::MAX), allow_negative_numbers = true)]
    frame: u32,
    #[command(flatten)]
    pointing: Pointing,
    /// Render the frame, and print measured errors and times next to the declared ones (takes
    /// seconds, or minutes for slow frames)
    #[arg(long)]
    measure: bool,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    records: Records,
}

#[derive(Serialize)]
struct Report {
    /// File, or the name of the built-in scene.
    scene: String,
    camera: String,
    frame: u32,
    epoch_mid: String,
    tolerances: Tolerances,
    effects: Vec<Line>,
}

#[derive(Serialize)]
struct Tolerances {
    skip_e: f64,
    skip_snr: f64,
    skip_px: f64,
}

#[derive(Serialize)]
struct Line {
    #[serde(flatten)]
    verdict: EffectLabel,
    /// Whether its errors are rms values, because the effect is random.
    rms: bool,
    /// Whether its error in px, and not in e-, decides whether the effect runs.
    #[serde(skip)]
    by_px: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    measured_error_e: Option<f64>,
    /// For effects with errors in px.
    #[serde(skip_serializing_if = "Option::is_none")]
    measured_error_px: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    measured_ms: Option<f64>,
}

pub fn run(args: Args) -> anyhow::Result<()> {
    let mut config = scene(args.scene.as_deref())?;
    args.records.settle(&config)?;
    if let Some(camera) = &args.camera {
        config.camera = Camera::load(camera, &Folder::current())?;
    }
    if let Some(sequence) = &config.sequence
        && let Some(pointing) = args.pointing.sequence(sequence.epoch, &config)?
    {
        config.sequence = Some(Sequence {
            frames: sequence.frames,
            period_s: sequence.period_s,
            ..pointing
        });
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
    warn_of_old(emulator.world().population.objects(), bench.vehicle.epoch);
    let fidelity = emulator.fidelity();
    let report = Report {
        scene: scene_name(args.scene.as_deref()),
        camera: bench.camera.name.clone(),
        frame: args.frame,
        epoch_mid: utc_text(bench.vehicle.epoch),
        tolerances: Tolerances {
            skip_e: fidelity.skip_e,
            skip_snr: fidelity.skip_snr,
            skip_px: fidelity.skip_px,
        },
        effects: lines(&bench, args.measure)?,
    };
    if args.json {
        return say_json(&report);
    }
    say(report.table())?;
    Ok(())
}

fn lines(bench: &Bench<'_>, measure: bool) -> anyhow::Result<Vec<Line>> {
    let choice = &bench.emulator.choice;
    let verdicts = EFFECTS.iter().zip(bench.verdicts(choice)?);
    let lines = verdicts.map(|(effect, verdict)| Line {
        rms: effect.random && !effect.is_drawn_with_scene(),
        by_px: effect.moves_images() && verdict.error_px.is_some_and(|px| px > 0.0),
        verdict,
        measured_error_e: None,
        measured_error_px: None,
        measured_ms: None,
    });
    let mut lines: Vec<Line> = lines.collect();
    if !measure {
        return Ok(lines);
    }
    let bar = progress(EFFECTS.len() as u32, "effects measured");
    bar.set_message("times");
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let costs = single
        .context("a pool of one thread to measure in")?
        .install(|| bench.costs(choice))?;
    let all = Choice {
        all: true,
        ..choice.clone()
    };
    for ((line, effect), cost) in lines.iter_mut().zip(EFFECTS).zip(costs) {
        bar.set_message(effect.name);
        line.measured_error_e = Some(bench.error_e(effect, &all)?);
        if line.by_px {
            line.measured_error_px = Some(bench.error_px(effect, &all)?);
        }
        line.measured_ms = line.verdict.run.then_some(cost.ms);
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(lines)
}

impl Line {
    /// The declared and the measured error, in the unit that decides.
    fn errors(&self) -> (String, Option<String>) {
        let rms = if self.rms { " rms" } else { "" };
        let e = |e: f64| format!("{} e-{rms}", three_digits(e));
        let px = |px: f64| format!("{} px", three_digits(px));
        let EffectLabel {
            error_e, error_px, ..
        } = self.verdict;
        let (declared, measured) = if self.by_px {
            (error_px.map(px), self.measured_error_px.map(px))
        } else {
            (error_e.map(e), self.measured_error_e.map(e))
        };
        (declared.unwrap_or_default(), measured)
    }
}

impl Report {
    fn table(&self) -> String {
        let Report { frame, scene, .. } = self;
        let Tolerances {
            skip_e,
            skip_snr,
            skip_px,
        } = self.tolerances;
        let mut text = format!(
            "frame {frame} of {scene}, {}, middle {}\n\
             skipped: effects that move images by at most {skip_px} px, or, if they move none, change no pixel by more than {skip_e} e-\n\
             and add no more electrons in total; light of the whole field also if all of it is below the noise (snr {skip_snr})\n",
            self.camera, self.epoch_mid
        );
        let measured = self
            .effects
            .iter()
            .any(|line| line.measured_error_e.is_some());
        text += &format!("  {:<18} {:<5} {:>17}", "effect", "", "error if skipped");
        if measured {
            text += &format!(" {:>14}", "measured error");
        }
        text += &format!(" {:>10}", "price");
        if measured {
            text += &format!(" {:>13}", "measured time");
        }
        text += "  because\n";
        let ms = |ms: Option<f64>| ms.map_or("-".to_string(), |ms| format!("{ms:.3} ms"));
        for line in &self.effects {
            let verdict = &line.verdict;
            let run = if verdict.run { "run" } else { "skip" };
            let (declared, found) = line.errors();
            text += &format!("  {:<18} {run:<5} {declared:>17}", verdict.effect);
            if let Some(found) = found {
                text += &format!(" {found:>14}");
            }
            text += &format!(" {:>10}", ms(verdict.price_ms));
            if measured {
                text += &format!(" {:>13}", ms(line.measured_ms));
            }
            text += &format!("  {}\n", verdict.why);
        }
        let prices = self.effects.iter().filter_map(|line| line.verdict.price_ms);
        text += &format!("  {:.2} ms on one core in all", prices.sum::<f64>());
        if measured {
            let times = self.effects.iter().filter_map(|line| line.measured_ms);
            text += &format!(", measured {:.2} ms", times.sum::<f64>());
        }
        text + "\n"
    }
}
