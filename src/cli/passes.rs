//! `skyloop passes`: objects that cross the camera's field, with times and magnitudes.

use super::common::{
    Records, not_itself, progress, scene, scene_name, warn_of_observer, warn_of_old,
};
use super::interval::Interval;
use super::lightcurve::find;
use super::pointing::{Place, Pointing};
use anyhow::{Context, anyhow, bail};
use clap::Args as ClapArgs;
use hifitime::Unit;
use skyloop::config::{Config, LookAt, Observer, Target};
use skyloop::flight::{self, Flight, FlightError};
use skyloop::load::orbits;
use skyloop::orbit::time::{leap_seconds, utc_text};
use skyloop::output::passes::{Row, Searched, csv, json, table};
use skyloop::passes::{NoPasses, Passes, Search, passes};
use skyloop_firmware_sim::console::{say, write_out};
use skyloop_firmware_sim::profile::ProfileError;
use skyloop_firmware_sim::text::number;
use std::io::Write;
use std::path::PathBuf;

#[derive(ClapArgs)]
pub struct Args {
    /// Scene file with [objects], an [observer] and attitudes [default: the built-in FAI on
    /// CASSIOPE, 15 June 2019]
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    interval: Interval,
    #[command(flatten)]
    pointing: Pointing,
    #[command(flatten)]
    place: Place,
    /// Only this object: name, id or number in its file
    #[arg(long, value_name = "NAME")]
    object: Option<String>,
    /// Omit passes that never reach this magnitude
    #[arg(long, value_name = "MAG", value_parser = number, allow_hyphen_values = true)]
    mag_limit: Option<f64>,
    /// Passes longer than this are never missed, s
    #[arg(
        long,
        value_name = "S",
        default_value_t = 0.05,
        value_parser = number,
        allow_hyphen_values = true
    )]
    shortest: f64,
    #[command(flatten)]
    records: Records,
    /// Print JSON instead of a table
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print CSV instead of a table
    #[arg(long)]
    csv: bool,
}

const MAX_DAYS: f64 = 31.0;

pub fn run(args: Args) -> anyhow::Result<()> {
    let mut config = scene(args.scene.as_deref())?;
    let name = scene_name(args.scene.as_deref());
    let search = search(&args, &config, &name)?;
    let flight = vehicle(&args, &mut config, &search, &name)?;
    args.records.settle(&config)?;
    if let Some(selected) = &args.object {
        let index = find(&config.objects, selected, &name)?;
        config.objects = vec![config.objects.swap_remove(index)];
    }
    let population = config.take_population();
    if population.objects().is_empty() {
        bail!("{name}: has no objects: name their files in [objects] files or population");
    }
    let middle = search.from + (search.to - search.from) * 0.5;
    warn_of_old(population.objects(), middle);
    const PARTS: u32 = 1000;
    let bar = progress(PARTS, "per mille");
    let corrections = &config.sky.corrections;
    let found = passes(
        &search,
        &flight,
        &config.camera,
        &population,
        corrections,
        |part| bar.set_position((part * f64::from(PARTS)) as u64),
    );
    bar.finish_and_clear();
    let Passes {
        passes,
        unknown,
        unpointed,
    } = found.map_err(|error| anyhow!("{name}: {error}{}", remedy(&error)))?;
    let all = passes.len();
    let bright = passes.iter().filter(|pass| {
        let peak = pass.brightest.as_ref().and_then(|at| at.point.band_mag());
        (args.mag_limit).is_none_or(|limit| peak.is_some_and(|mag| mag <= limit))
    });
    let rows: Vec<Row> = bright
        .map(|pass| Row::new(pass, &population.objects()[pass.index]))
        .collect();
    let unpointed = unpointed.into_iter().map(|times| times.map(utc_text));
    let not_searched: Vec<[String; 2]> = unpointed.collect();
    warn_of_gaps(&not_searched);
    let all_unknown = unknown.len() == population.objects().len() && passes.is_empty();
    warn_of_unknown(unknown.values(), all_unknown);
    let searched = Searched {
        scene: name,
        from: utc_text(search.from),
        to: utc_text(search.to),
        objects: population.objects().len(),
        fainter: all - rows.len(),
        without_state: unknown.into_keys().collect(),
        not_searched,
        leap_seconds: leap_seconds(search.from, search.to),
    };
    print(&args, &searched, &rows)
}

fn print(args: &Args, searched: &Searched, rows: &[Row]) -> anyhow::Result<()> {
    let line = searched.line(rows.len());
    if args.json {
        say(json(searched, rows))?;
    } else if args.csv {
        write_out(csv(rows))?;
        // Standard output has only rows.
        let _ = writeln!(std::io::stderr(), "{line}");
    } else if rows.is_empty() {
        say(format_args!("{line}\n"))?;
    } else {
        say(format_args!("{}{line}\n", table(rows)))?;
    }
    Ok(())
}

fn warn_of_gaps(not_searched: &[[String; 2]]) {
    if not_searched.is_empty() {
        return;
    }
    let times = not_searched.iter().take(5);
    let times = times.map(|[from, to]| format!("{from} to {to}"));
    let more = match not_searched.len() {
        ..=5 => String::new(),
        count => format!(" and {} more times", count - 5),
    };
    let times = times.collect::<Vec<_>>().join(", ");
    tracing::warn!("not searched, since the pointing has no direction: {times}{more}");
}

fn warn_of_unknown<'a>(reasons: impl ExactSizeIterator<Item = &'a String>, all_unknown: bool) {
    if all_unknown {
        tracing::warn!(
            "no object has states through all of the search, and none passes: choose --from and --to within what their orbits cover"
        );
    }
    let more = reasons.len().saturating_sub(5);
    reasons
        .take(5)
        .for_each(|reason| tracing::warn!("{reason}"));
    if more > 0 {
        tracing::warn!("{more} more without a state");
    }
}

/// The remedy if the scene's attitudes or orbit end.
fn remedy(error: &NoPasses) -> &'static str {
    match error {
        NoPasses::Flight(FlightError::Profile(ProfileError::OutsideList(_))) => {
            "; or choose --from and --to within what is known, or give --attitude, --radec or --nadir"
        }
        NoPasses::Flight(FlightError::Profile(ProfileError::Orbit { .. })) => {
            "; or choose --from and --to within what is known, or give the observer's --orbit or --state"
        }
        NoPasses::Flight(FlightError::Profile(ProfileError::NoPlane { .. })) => {
            "; give --attitude or --radec"
        }
        _ => "",
    }
}

fn search(args: &Args, config: &Config, scene: &str) -> anyhow::Result<Search> {
    let [from, to] = args.interval.ends(config.sequence.as_ref(), scene)?;
    let days = (to - from).to_unit(Unit::Day);
    let ends = format!("--from {}, --to {}", utc_text(from), utc_text(to));
    if days <= 0.0 {
        bail!("{ends}: the end must lie after the start");
    }
    if days > MAX_DAYS {
        bail!("{ends}: these are {days:.1} days, at most {MAX_DAYS} are searched");
    }
    if !(1e-3..=10.0).contains(&args.shortest) {
        bail!(
            "--shortest {}: must be a number of seconds from 0.001 to 10",
            args.shortest
        );
    }
    Ok(Search {
        from,
        to,
        shortest_s: args.shortest,
    })
}

/// Position and pointing of the vehicle: from the options, else from the scene.
fn vehicle(
    args: &Args,
    config: &mut Config,
    search: &Search,
    scene: &str,
) -> anyhow::Result<Flight> {
    let mut findings = orbits::Findings::default();
    let given = args.place.observer(&mut findings)?;
    config.rejected.extend(findings.rejected);
    config.notices.extend(findings.notices);
    // The state of a scene holds at its first exposure, --state at --from.
    let first_exposure = config.sequence.as_ref().map(|sequence| sequence.epoch);
    let (observer, state_epoch) = match given {
        Some(given) => (Some(given), search.from),
        None => {
            let epoch = first_exposure.unwrap_or(search.from);
            (config.observer.take(), epoch)
        }
    };
    let Some(observer) = observer else {
        bail!(
            "{scene}: no observer: set one with [observer] orbit = \"FILE:NAME\", or give --orbit or --state"
        );
    };
    if let Some(sequence) = args.pointing.sequence(search.from, config)? {
        config.sequence = Some(sequence);
    }
    if let Observer::Object(object) = &observer {
        warn_of_observer(object, [search.from, search.to]);
        if let Some(selected) = &args.object {
            let index = find(&config.objects, selected, scene)?;
            not_itself(object, &config.objects[index])?;
        }
    }
    let orbit = flight::orbit(&observer, state_epoch);
    let Some(sequence) = &config.sequence else {
        bail!(
            "{scene}: no attitude: add a [sequence], or give --attitude x,y,z,w, --radec RA,DEC,ROLL, --nadir or --look-at TARGET"
        );
    };
    let profile = flight::profile(sequence, &config.camera, config.sky.corrections);
    let profile = profile.with_context(|| scene.to_string())?;
    let target = match &sequence.look_at {
        Some(LookAt {
            target: Target::Object(object),
            ..
        }) => Some((**object).clone()),
        _ => None,
    };
    Ok(Flight {
        profile,
        orbit,
        target,
    })
}
