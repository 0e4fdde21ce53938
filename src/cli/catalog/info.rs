//! `skyloop catalog info`: the objects of files by kind of orbit, or one object.

use super::source::{readable, sources};
use crate::cli::common::{Records, say_json};
use anyhow::{anyhow, bail};
use clap::Args as ClapArgs;
use serde::Serialize;
use skyloop::effect::counted;
use skyloop::load::orbits::passed_over;
use skyloop::orbit::elements::Elements;
use skyloop::orbit::time::utc_text;
use skyloop::orbit::{Loaded, Object, Orbit, Regime, United, path_text, unite};
use skyloop_firmware_sim::console::say;
use std::path::PathBuf;

#[derive(ClapArgs)]
pub struct Args {
    /// Orbit files, or folders of them
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Report only this object: name, id or number
    #[arg(long, value_name = "NAME")]
    object: Option<String>,
    /// Print JSON instead of a table, with every object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    records: Records,
}

/// Maximum number of objects listed in addition to the counts; JSON has all.
const LISTED: usize = 40;

#[derive(Serialize)]
struct Line {
    id: String,
    names: Vec<String>,
    /// LEO, MEO, GEO, HEO or beyond GEO; none for an ephemeris.
    regime: Option<String>,
    deep: Option<bool>,
    sets: usize,
    /// Epoch of the last set, to which all following values belong; the start of an ephemeris.
    epoch: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    until: Option<String>,
    period_min: Option<f64>,
    perigee_km: Option<f64>,
    apogee_km: Option<f64>,
    inclination_deg: Option<f64>,
    eccentricity: Option<f64>,
    bstar: Option<f64>,
}

pub fn run(args: Args) -> anyhow::Result<()> {
    let all = objects(&args)?;
    let lines = match &args.object {
        Some(name) => {
            let found = all.find(Some(name.as_str()));
            vec![Line::of(
                found.map_err(|why| anyhow!("--object {name}: {why}"))?,
            )]
        }
        None => all.objects.iter().map(Line::of).collect(),
    };
    if args.json {
        return say_json(&lines);
    }
    let mut text = String::new();
    if args.object.is_none() {
        text += &counts(&all.objects);
    }
    if lines.len() <= LISTED {
        text += HEAD;
        text.extend(lines.iter().map(Line::row));
    } else {
        text += "--json lists every object, --object NAME reports one\n";
    }
    say(text)?;
    Ok(())
}

/// The objects of all files; sets of one object are merged.
fn objects(args: &Args) -> anyhow::Result<Loaded> {
    let mut rejected = Vec::new();
    let mut all = Vec::new();
    let mut foreign = Vec::new();
    for source in sources(&args.files, &mut foreign)? {
        let file = path_text(&source.file);
        let Some(contents) = readable(source, &mut rejected, &mut foreign)? else {
            continue;
        };
        for assumed in &contents.assumed {
            tracing::warn!("{assumed}");
        }
        all.push(contents.into_source(file, 0));
    }
    let United {
        objects, refused, ..
    } = unite(all);
    rejected.extend(refused.iter().map(|(_, refused)| refused.to_string()));
    args.records.settle_lines(&rejected)?;
    if let Some(line) = passed_over(&foreign) {
        tracing::warn!("{line}");
    }
    if objects.is_empty() {
        bail!("no object in any of the files");
    }
    Ok(Loaded {
        objects,
        ..Loaded::default()
    })
}

fn counts(objects: &[Object]) -> String {
    let sets: Vec<&Elements> = objects.iter().filter_map(last_set).collect();
    let mut text = counted(objects.len(), "object") + "\n";
    let mut row = |name: &str, count: usize| {
        let share = 100.0 * count as f64 / objects.len() as f64;
        text += &format!("  {name:<22} {count:>8} {share:>6.2} %\n");
    };
    for regime in Regime::ALL {
        let count = sets.iter().filter(|set| set.regime() == regime).count();
        row(&regime.to_string(), count);
    }
    let deep = sets.iter().filter(|set| set.is_deep()).count();
    row("near (SGP4)", sets.len() - deep);
    row("deep (SDP4)", deep);
    row("with an ephemeris", objects.len() - sets.len());
    let beyond = sets.iter().filter(|set| set.norad > 99_999).count();
    row("numbers beyond 99999", beyond);
    let several = |object: &&Object| matches!(&object.orbit, Orbit::Elements(_, others) if !others.is_empty());
    row(
        "several element sets",
        objects.iter().filter(several).count(),
    );
    let epochs = sets.iter().map(|set| set.epoch);
    if let (Some(first), Some(last)) = (epochs.clone().min(), epochs.max()) {
        text += &format!("  epochs {} to {}\n", utc_text(first), utc_text(last));
    }
    text
}

fn last_set(object: &Object) -> Option<&Elements> {
    match &object.orbit {
        Orbit::Elements(set, others) => [set].into_iter().chain(others).max_by_key(|set| set.epoch),
        Orbit::Ephemeris(_) => None,
    }
}

const HEAD: &str = "  number or id  regime       period min  perigee km   apogee km  incl. deg  eccentricity  epoch                     name\n";

impl Line {
    fn of(object: &Object) -> Line {
        let set = last_set(object);
        let sets = match &object.orbit {
            Orbit::Elements(_, others) => 1 + others.len(),
            Orbit::Ephemeris(_) => 0,
        };
        let covers = match &object.orbit {
            Orbit::Ephemeris(ephemeris) => ephemeris.interval(),
            Orbit::Elements(..) => None,
        };
        let epoch = set.map(|set| set.epoch).or(covers.map(|(start, _)| start));
        Line {
            id: object.id.clone(),
            names: object.names.clone(),
            regime: set.map(|set| set.regime().to_string()),
            deep: set.map(Elements::is_deep),
            sets,
            epoch: epoch.map(utc_text),
            until: covers.map(|(_, stop)| utc_text(stop)),
            period_min: set.map(Elements::period_min),
            perigee_km: set.map(|set| set.heights_km()[0]),
            apogee_km: set.map(|set| set.heights_km()[1]),
            inclination_deg: set.map(|set| set.inclination.to_degrees()),
            eccentricity: set.map(|set| set.eccentricity),
            bstar: set.map(|set| set.drag),
        }
    }

    fn row(&self) -> String {
        let number = |value: Option<f64>, digits: usize| match value {
            Some(value) => format!("{value:.digits$}"),
            None => "-".to_string(),
        };
        let id = self.id.strip_prefix("NORAD ").unwrap_or(&self.id);
        let epoch = match (&self.epoch, &self.until) {
            (Some(start), Some(stop)) => format!("{start} to {stop}"),
            (Some(epoch), None) => epoch.clone(),
            (None, _) => "-".to_string(),
        };
        let line = format!(
            "  {id:<13} {:<11} {:>11} {:>11} {:>11} {:>10} {:>13}  {epoch:<25} {}",
            self.regime.as_deref().unwrap_or("ephemeris"),
            number(self.period_min, 2),
            number(self.perigee_km, 1),
            number(self.apogee_km, 1),
            number(self.inclination_deg, 4),
            number(self.eccentricity, 7),
            self.names.join(", "),
        );
        line.trim_end().to_string() + "\n"
    }
}
