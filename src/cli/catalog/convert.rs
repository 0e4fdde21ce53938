//! `skyloop catalog convert`: element sets in another format.

use super::super::{Force, Records, is_stdout};
use super::source::{readable, shown, sources};
use anyhow::{Context, anyhow, bail};
use clap::Args as ClapArgs;
use clap::builder::PossibleValuesParser;
use hifitime::Epoch;
use skyloop::effect::counted;
use skyloop::load::orbits::passed_over;
use skyloop::orbit::path_text;
use skyloop::orbit::{Format, NO_MARK, write, write_file};
use skyloop_firmware_sim::console::{say, write_out};
use std::path::PathBuf;

/// Arguments of `skyloop catalog convert`.
#[derive(ClapArgs)]
pub struct Args {
    /// Files of element sets, or folders of them
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// The format to write
    #[arg(long, value_name = "FORMAT", value_parser = formats())]
    to: String,
    /// The file to write [default: standard output, as `-`]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    records: Records,
}

/// The formats that hold element sets.
fn formats() -> PossibleValuesParser {
    let formats = Format::ALL
        .into_iter()
        .filter(|format| !format.is_ephemeris());
    PossibleValuesParser::new(formats.map(Format::name))
}

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<()> {
    let format = Format::ALL
        .into_iter()
        .find(|format| format.name() == args.to);
    let mut lost = Vec::new();
    let mut records = Vec::new();
    let mut foreign = Vec::new();
    for source in sources(&args.files, &mut foreign)? {
        let file = shown(&source.file);
        if let Some(contents) = readable(source, &mut lost, &mut foreign)? {
            for object in &contents.ephemerides {
                lost.push(format!(
                    "{file}: {} has an ephemeris, which no mean elements can be read from",
                    object.label()
                ));
            }
            for assumed in &contents.assumed {
                tracing::warn!("{assumed}");
            }
            records.extend(contents.records);
        }
    }
    let written = format.and_then(|format| Some((format, write(&records, format, now())?)));
    let (format, written) = written.ok_or_else(|| anyhow!("--to {}: no such format", args.to))?;
    let count = records.len() - written.left_out.len();
    lost.extend(written.left_out);
    args.records.settle_lines("left out", &lost)?;
    args.records.settle_lines("changed", &written.changed)?;
    if let Some(line) = passed_over(&foreign) {
        tracing::warn!("{line}");
    }
    if count == 0 {
        bail!("no element set to write as {}: see above", args.to);
    }
    if written.rounded > 0 {
        let sets = counted(written.rounded, "element set");
        tracing::warn!("{sets} rounded to the digits that {} has", args.to);
    }
    let sets = counted(count, "element set");
    let remedy = "convert the files one by one into a folder, or --to omm-csv";
    super::fits(&sets, format, written.text.len() as f64, remedy)?;
    match args.out.as_deref().filter(|out| !is_stdout(out)) {
        None => write_out(&written.text)?,
        Some(out) => {
            let force = args.force.force;
            write_file(out, &written.text, NO_MARK, force).with_context(|| path_text(out))?;
            say(format_args!("wrote {sets} to {}\n", path_text(out)))?;
        }
    }
    Ok(())
}

/// The time of the computer's clock, which goes into messages that say when they were made.
fn now() -> Epoch {
    let now = Epoch::now().unwrap_or_else(|_| Epoch::from_unix_seconds(0.0));
    Epoch::from_unix_seconds(now.to_unix_seconds().floor())
}
