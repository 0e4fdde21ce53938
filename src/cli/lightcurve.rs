//! `skyloop lightcurve`: the magnitude of an object against time, for an observer in orbit.

use super::common::{
    Force, Records, not_itself, progress, scene, scene_name, warn_of_observer, warn_of_old,
};
use super::interval::Interval;
use anyhow::{anyhow, bail};
use clap::Args as ClapArgs;
use skyloop::config::{Config, Observer};
use skyloop::effect::counted;
use skyloop::light_curve::{NoLightCurve, Point, Span, point};
use skyloop::orbit::path_text;
use skyloop::orbit::time::utc_text;
use skyloop::orbit::{Loaded, Object, OrbitError};
use skyloop::output::{may_replace_light_curve, write_light_curve};
use skyloop_firmware_sim::console::{printable_line, say};
use skyloop_firmware_sim::text::number;
use std::collections::BTreeMap;
use std::path::PathBuf;

#[derive(ClapArgs)]
pub struct Args {
    /// Scene file with [objects] and an [observer] [default: the built-in FAI on CASSIOPE, 15 June
    /// 2019]
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    /// Object: name, id or number in its file
    #[arg(long, value_name = "NAME")]
    object: String,
    #[command(flatten)]
    interval: Interval,
    /// Seconds from one instant to the next [default: the scene's period]
    #[arg(long, value_name = "S", value_parser = number, allow_hyphen_values = true)]
    step: Option<f64>,
    /// Duration in s over which light is averaged around each instant; 0 for none [default: the
    /// camera's exposure time]
    #[arg(long, value_name = "S", value_parser = number, allow_hyphen_values = true)]
    exposure: Option<f64>,
    /// Folder for lightcurve.csv and lightcurve.svg, created if needed
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    records: Records,
}

const MAX_POINTS: f64 = 1e6;

pub fn run(args: Args) -> anyhow::Result<()> {
    let mut config = scene(args.scene.as_deref())?;
    args.records.settle(&config)?;
    let name = scene_name(args.scene.as_deref());
    let span = span(&args, &config, &name)?;
    let observer = config.observer.take();
    if let Some(Observer::State(_)) = observer {
        bail!(
            "{name}: [observer] state: a light curve needs an orbit of the observer, [observer] orbit = \"FILE:NAME\""
        );
    }
    let Some(Observer::Object(observer)) = observer else {
        bail!("{name}: no observer: set one with [observer] orbit = \"FILE:NAME\"");
    };
    may_replace_light_curve(&args.out, args.force.force)?;
    let population = config.take_population();
    let index = find(population.objects(), &args.object, &name)?;
    let object = &population.objects()[index];
    not_itself(&observer, object)?;
    let last = span.epochs().last().unwrap_or(span.from);
    warn_of_observer(&observer, [span.from, last]);
    warn_of_old(&population.objects()[index..=index], span.from);
    let bar = progress(span.points, "points");
    let mut points = Vec::new();
    for epoch in span.epochs() {
        let corrections = &config.sky.corrections;
        let seen = point(
            &population,
            index,
            &observer,
            corrections,
            epoch,
            span.exposure_s,
        );
        let seen =
            seen.map_err(|error| anyhow!("{name}: {error}{}", remedy(&error, &span, &points)))?;
        points.push(seen);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let title = format!("{} seen from {}", object.label(), observer.label());
    write_light_curve(&args.out, &title, &points)?;
    let what = summary(&points);
    say(format_args!(
        "{title}, of {}: {} from {} to {}, {what}\nwrote {}\n",
        counted(population.objects().len(), "object"),
        counted(points.len(), "instant"),
        utc_text(span.from),
        points
            .last()
            .map_or(String::new(), |last| utc_text(last.epoch)),
        path_text(&args.out)
    ))?;
    Ok(())
}

/// Number of instants with light, magnitudes, and reasons for the others.
fn summary(points: &[Point]) -> String {
    let mags = points.iter().filter_map(|point| point.band_mag());
    let (count, brightest, faintest) = mags.fold(
        (0, f64::INFINITY, f64::NEG_INFINITY),
        |(n, low, high), mag| (n + 1, low.min(mag), high.max(mag)),
    );
    let causes = causes(points);
    match (count, causes.as_str()) {
        (0, _) => format!("no light of it arrives: {causes}"),
        (_, "") => {
            format!("light arrives at {count} of them, magnitude {brightest:.2} to {faintest:.2}")
        }
        _ => format!(
            "light arrives at {count} of them, magnitude {brightest:.2} to {faintest:.2}; no light at the others: {causes}"
        ),
    }
}

/// Reasons without light, with the number of instants: `3 behind the Earth, 1 in the Earth's
/// shadow`.
fn causes(points: &[Point]) -> String {
    let mut counts = BTreeMap::new();
    for point in points.iter().filter(|point| !point.reason().is_empty()) {
        *counts.entry(point.reason()).or_insert(0) += 1;
    }
    let counts = counts.iter().map(|(why, count)| format!("{count} {why}"));
    counts.collect::<Vec<_>>().join(", ")
}

/// The remedy if the ephemeris ends after `points`. Each instant needs the orbit for half an
/// exposure before and after it.
fn remedy(error: &NoLightCurve, span: &Span, points: &[Point]) -> String {
    if !matches!(
        error,
        NoLightCurve::Orbit(OrbitError::OutsideInterval { .. })
    ) {
        return String::new();
    }
    let open = format!(
        " (an instant reaches half of --exposure {} before and after itself)",
        span.exposure_s
    );
    match points.last() {
        Some(last) => format!("{open}; --to {} works", utc_text(last.epoch)),
        None => format!("{open}; give another --from"),
    }
}

/// The instants; by default those of the scene's sequence.
fn span(args: &Args, config: &Config, scene: &str) -> anyhow::Result<Span> {
    let sequence = config.sequence.as_ref();
    let [from, to] = args.interval.ends(sequence, scene)?;
    let step_s = args
        .step
        .or(sequence.map(|s| s.period_s))
        .ok_or_else(|| Interval::missing(scene, "--step S"))?;
    if !(1e-6..=1e6).contains(&step_s) {
        bail!("--step {step_s}: must be a number of seconds from 1e-6 to 1e6");
    }
    let exposure_s = args.exposure.unwrap_or(config.camera.exposure_s);
    if !(0.0..=1e4).contains(&exposure_s) {
        bail!("--exposure {exposure_s}: must be a number of seconds from 0 to 10000");
    }
    let length_s = (to - from).to_seconds();
    let named = |option: &str, given: bool, value: String| {
        if given {
            format!("{option} {value}")
        } else {
            format!("{option} {value} (the scene's)")
        }
    };
    let ends = [
        named("--from", args.interval.from.is_some(), utc_text(from)),
        named("--to", args.interval.to.is_some(), utc_text(to)),
    ];
    let ends = ends.join(", ");
    if length_s < 0.0 {
        bail!("{ends}: the end lies before the start; give --from and --to in their order");
    }
    // The last instant counts in spite of rounding in the division.
    let points = (length_s / step_s * (1.0 + 1e-12)).floor() + 1.0;
    if points > MAX_POINTS {
        let step = named("--step", args.step.is_some(), step_s.to_string());
        bail!(
            "{step}, {ends}: these are {points:.0} points, at most {MAX_POINTS:.0} are written; enlarge --step"
        );
    }
    Ok(Span {
        from,
        step_s,
        points: points as u32,
        exposure_s,
    })
}

/// The object with this name.
pub(super) fn find(objects: &[Object], name: &str, scene: &str) -> anyhow::Result<usize> {
    if objects.is_empty() {
        bail!("{scene}: has no objects: name their files in [objects] files or population");
    }
    let all = Loaded {
        objects: objects.to_vec(),
        ..Loaded::default()
    };
    let found = all
        .find(Some(name))
        .map_err(|why| anyhow!("--object {}: {why}", printable_line(name)))?;
    let index = objects.iter().position(|object| object.id == found.id);
    index.ok_or_else(|| anyhow!("--object {}: no such object", printable_line(name)))
}
