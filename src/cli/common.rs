//! Options and helpers that several commands share.

use anyhow::{Context, bail};
use clap::builder::PossibleValuesParser;
use hifitime::Epoch;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use skyloop::config::{Config, Observer};
use skyloop::effect::counted;
use skyloop::flight;
use skyloop::load::orbits::{report_shared_names, several_sets, shared_names};
use skyloop::orbit::path_text;
use skyloop::orbit::{Ages, Object, is_same};
use skyloop_firmware_sim::console::say;
use skyloop_firmware_sim::mission::Mission;
use skyloop_protocols::Output;
use std::path::Path;

/// The scene of a file, or the built-in one.
pub fn scene(file: Option<&Path>) -> anyhow::Result<Config> {
    Ok(match file {
        Some(file) => Config::load(file)?,
        None => Config::builtin()?,
    })
}

/// The name of a scene in messages: its file.
pub fn scene_name(file: Option<&Path>) -> String {
    file.map_or("the built-in scene".to_string(), path_text)
}

/// Method of orbit propagation.
#[derive(clap::Args, Default)]
pub struct Orbits {
    /// Run SGP4 for every object in every frame, not only for candidates in the field; frames and
    /// labels are the same
    #[arg(long)]
    exact: bool,
}

impl Orbits {
    pub fn settle(&self, config: &mut Config) {
        if self.exact {
            config.fidelity.orbits = skyloop::fidelity::Orbits::Exact;
        }
    }
}

/// Treatment of unusable records of orbit files.
#[derive(clap::Args, Default)]
pub struct Records {
    /// Fail if an orbit file or one of its records is unusable; without it, unusable records are
    /// skipped
    #[arg(long)]
    strict: bool,
}

/// Treatment of existing files that skyloop did not write.
#[derive(clap::Args)]
pub struct Force {
    /// Overwrite output files even if skyloop did not write them
    #[arg(long)]
    pub force: bool,
}

/// Prints a report as JSON.
pub fn say_json(report: &impl Serialize) -> anyhow::Result<()> {
    say(format_args!("{}\n", serde_json::to_string_pretty(report)?))?;
    Ok(())
}

/// Whether the name of an output stands for standard output.
pub fn is_stdout(path: &Path) -> bool {
    path == Path::new("-")
}

/// Maximum number of records that are listed.
pub const NAMED: usize = 10;

/// The error of a run in which a thread has panicked.
pub const PANICKED: &str =
    "a thread of the run has panicked: please report it with the command you gave";

impl Records {
    /// Logs the refused records of a scene's orbit files; an error with `--strict`.
    pub fn settle(&self, config: &Config) -> anyhow::Result<()> {
        self.settle_lines(&config.rejected)?;
        for line in &config.notices {
            tracing::warn!("{line}");
        }
        let shared = shared_names(&config.objects);
        let lines = several_sets(&config.objects).into_iter();
        for line in lines.chain(report_shared_names(&shared)) {
            tracing::warn!("{line}");
        }
        Ok(())
    }

    /// As [`Records::settle`], for refused records that belong to no scene.
    pub fn settle_lines(&self, rejected: &[String]) -> anyhow::Result<()> {
        let mut lines: Vec<String> = rejected.iter().take(NAMED).cloned().collect();
        if let Some(others @ 1..) = rejected.len().checked_sub(NAMED) {
            lines.push(format!(
                "{others} more; skyloop catalog check FILE lists all"
            ));
        }
        if self.strict && !rejected.is_empty() {
            bail!(
                "--strict: {} of orbit files cannot be used:\n  {}",
                counted(rejected.len(), "record"),
                lines.join("\n  ")
            );
        }
        for line in lines {
            tracing::warn!("refused: {line}");
        }
        Ok(())
    }
}

/// Warns if most element sets are too old or too new.
pub fn warn_of_old(objects: &[Object], at: Epoch) {
    if let Some(ages) = Ages::of(objects, at).filter(Ages::are_old) {
        tracing::warn!("{ages}");
    }
}

/// Warns if the observer's element sets are too old or too new for either of the `ends` of a run.
pub fn warn_of_observer(observer: &Object, ends: [Epoch; 2]) {
    let at = |end| Ages::of(std::slice::from_ref(observer), end).filter(Ages::are_old);
    if let Some(ages) = ends.into_iter().find_map(at) {
        tracing::warn!("the observer, {}: {ages}", observer.label());
    }
}

/// Refuses the observer as its own target.
pub fn not_itself(observer: &Object, object: &Object) -> anyhow::Result<()> {
    if is_same(observer, object) {
        anyhow::bail!("--object {}: that is the observer itself", object.label());
    }
    Ok(())
}

/// The mission of a configuration; an error names the scene file that it comes from.
pub fn mission(config: &Config, scene: Option<&Path>) -> anyhow::Result<Mission> {
    let mission = match (flight::mission(config), scene) {
        (mission, Some(scene)) => mission.with_context(|| path_text(scene))?,
        (mission, None) => mission?,
    };
    if let Some(Observer::Object(observer)) = &config.observer {
        let last = mission.epoch(mission.frames.saturating_sub(1));
        warn_of_observer(observer, [mission.start, last]);
    }
    Ok(mission)
}

/// The names of output levels.
pub fn levels() -> PossibleValuesParser {
    PossibleValuesParser::new(Output::PRESETS.map(|(name, ..)| name))
}

/// `output` at the level `name`, if one is given.
pub fn with_level(output: Output, name: Option<&str>) -> Output {
    let preset = name.and_then(Output::preset);
    preset.map_or(output, |preset| Output {
        pixels: preset.pixels,
        labels: preset.labels,
        ..output
    })
}

/// A progress bar; nothing is drawn if standard error is no terminal.
pub fn progress(steps: u32, what: &str) -> ProgressBar {
    let template = format!("{{bar:40}} {{pos}}/{{len}} {what}  {{msg}}");
    let style = ProgressStyle::with_template(&template);
    ProgressBar::new(u64::from(steps))
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
