//! `skyloop catalog synth`: a synthetic population with the mix of the real one, for scale tests.

use crate::cli::common::Force;
use anyhow::{Context, bail};
use clap::Args as ClapArgs;
use hifitime::Epoch;
use skyloop::effect::counted;
use skyloop::orbit::path_text;
use skyloop::orbit::synth::{CLASSES, MAX_OBJECTS, Synthetic, population};
use skyloop::orbit::time::{parse_utc, utc_text};
use skyloop::orbit::{Format, Listing, Mark, NO_MARK, Record, files, write};
use skyloop::output::{may_replace, remove_file, write_text};
use skyloop::sky::bodies::Bodies;
use skyloop_firmware_sim::console::say;
use skyloop_firmware_sim::text::whole;
use std::fmt::Write;
use std::path::{Path, PathBuf};

#[derive(ClapArgs)]
pub struct Args {
    /// Number of objects, 1 to 10,000,000
    #[arg(long, value_name = "N", value_parser = whole(1..=10_000_000u32), allow_hyphen_values = true)]
    objects: u32,
    /// Seed of the population: the same number gives the same objects
    #[arg(
        long,
        value_name = "N",
        default_value_t = 1,
        value_parser = whole(0..=u64::MAX),
        allow_hyphen_values = true
    )]
    seed: u64,
    /// Epoch; the element sets are of the day before it
    #[arg(long, value_name = "UTC", value_parser = parse_utc, default_value = "2026-06-01T00:00:00Z")]
    epoch: Epoch,
    /// Folder for a population file and its element files by size, or one element file: .tle, .3le,
    /// .kvn, .xml, .json or .csv [default: only print the counts]
    #[arg(long, value_name = "FOLDER|FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

const POPULATION: &str = "population.toml";
/// Mark of a population file.
const MARK: Mark = &["# A made-up population:"];
/// The greatest catalogue number of a TLE: `Z9999`.
const LARGEST_ALPHA5: u32 = 339_999;
/// Years whose epochs, and the day before, fit in a TLE.
const TLE_YEARS: std::ops::RangeInclusive<i32> = 1958..=2056;
/// Upper limits of size classes, m.
const SIZES_M: [f64; 8] = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0];
/// File extensions and their formats.
const ENDS: [(&str, Format); 6] = [
    ("tle", Format::Tle),
    ("3le", Format::ThreeLine),
    ("kvn", Format::OmmKvn),
    ("xml", Format::OmmXml),
    ("json", Format::OmmJson),
    ("csv", Format::OmmCsv),
];

/// Number of objects for the estimate of a file's size.
const FEW: usize = 1000;

pub fn run(args: Args) -> anyhow::Result<()> {
    debug_assert!(args.objects as usize <= MAX_OBJECTS);
    Bodies::at(args.epoch).with_context(|| format!("--epoch {}", utc_text(args.epoch)))?;
    let target = args.out.as_deref().map(Target::of).transpose()?;
    if let Some(Target::File(file, format)) = &target {
        fits(file, *format, &args)?;
    }
    let all = population(args.objects as usize, args.seed, args.epoch);
    let mut text = counts(&all);
    match target {
        None => {}
        Some(Target::Folder(out)) => {
            text += &folder(out, &all, args.epoch, args.force.force)?;
        }
        Some(Target::File(out, format)) => {
            let records: Vec<Record> = all.iter().map(Synthetic::record).collect();
            elements(out, &records, format, args.epoch, args.force.force)?;
            text += &format!("wrote {}\n", path_text(out));
        }
    }
    say(text)?;
    Ok(())
}

enum Target<'a> {
    Folder(&'a Path),
    File(&'a Path, Format),
}

impl Target<'_> {
    fn of(out: &Path) -> anyhow::Result<Target<'_>> {
        let Some(end) = out.extension() else {
            return Ok(Target::Folder(out));
        };
        let known = ENDS.iter().find(|(known, _)| end == *known);
        let Some((_, format)) = known else {
            let ends = ENDS.map(|(end, _)| format!(".{end}")).join(", ");
            bail!(
                "--out {}: a file is named by its format ({ends}), a folder has no dot in its name",
                path_text(out)
            );
        };
        Ok(Target::File(out, *format))
    }
}

/// Refuses a file that would be too long to read again. Its length is estimated from the first
/// objects, which are the same for any number of objects.
fn fits(file: &Path, format: Format, args: &Args) -> anyhow::Result<()> {
    let few = population(FEW.min(args.objects as usize), args.seed, args.epoch);
    let records: Vec<Record> = few.iter().map(Synthetic::record).collect();
    let bytes = write(&records, format, args.epoch).map_or(0, |written| written.text.len());
    let expected = bytes as f64 / few.len() as f64 * f64::from(args.objects);
    let all = counted(args.objects as usize, "object");
    let what = format!("--out {}: {all}", path_text(file));
    // Names and numbers of the last objects are longer than those of the first.
    super::fits(&what, format, expected * 1.02, "write a folder, or .csv")
}

fn counts(all: &[Synthetic]) -> String {
    let mut text = String::new();
    for class in CLASSES {
        let count = all.iter().filter(|one| one.class == class).count();
        let _ = writeln!(text, "{:<18} {count:>9}", class.name);
    }
    text + &format!("{}\n", counted(all.len(), "object"))
}

fn class_file(to_m: f64, end: &str) -> String {
    format!("below-{to_m}-m.{end}")
}

/// The files of an older population in a folder.
///
/// Errors: the folder cannot be listed, or has other content, which a scene with this folder would
/// read as a part of the population; without `force`: skyloop did not write the files.
fn older(folder: &Path, force: bool) -> anyhow::Result<Vec<PathBuf>> {
    let mut own = vec![POPULATION.to_string()];
    own.extend(SIZES_M.iter().map(|to_m| class_file(*to_m, "3le")));
    own.extend(SIZES_M.iter().map(|to_m| class_file(*to_m, "csv")));
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let Listing { files, others } = files(folder).with_context(|| path_text(folder))?;
    let is_own = |file: &Path| {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        own.iter().any(|own| *own == name)
    };
    let foreign = files.iter().find(|file| !is_own(file));
    if let Some(foreign) = others.first().or(foreign) {
        bail!(
            "--out {}: holds {}, which is of no population; name a folder that is new, empty or holds a population alone, \
             which is replaced",
            path_text(folder),
            path_text(foreign)
        );
    }
    let others = own.iter().skip(1).map(|name| (name.as_str(), NO_MARK));
    let others: Vec<_> = others.collect();
    may_replace(folder, (POPULATION, MARK), &others, force)?;
    Ok(files)
}

/// Writes a population file and one file of elements for each size class, in place of an older
/// population.
fn folder(folder: &Path, all: &[Synthetic], epoch: Epoch, force: bool) -> anyhow::Result<String> {
    for file in older(folder, force)? {
        remove_file(&file)?;
    }
    let largest = all.iter().map(|one| one.elements.norad).max();
    let year = utc_text(epoch).get(..4).and_then(|year| year.parse().ok());
    let is_year = year.is_some_and(|year| TLE_YEARS.contains(&year));
    let fits = largest.is_none_or(|largest| largest <= LARGEST_ALPHA5) && is_year;
    let (format, end) = if fits {
        (Format::ThreeLine, "3le")
    } else {
        (Format::OmmCsv, "csv")
    };
    let mut toml = format!(
        "{} {}, element sets of the day before {}.\n# A file a size class; its sphere shines as its objects do on average.\n",
        MARK[0],
        counted(all.len(), "object"),
        utc_text(epoch)
    );
    let mut from_m = 0.0;
    for to_m in SIZES_M {
        let within = |one: &&Synthetic| (from_m..to_m).contains(&one.diameter_m);
        let of: Vec<&Synthetic> = all.iter().filter(within).collect();
        from_m = to_m;
        if of.is_empty() {
            continue;
        }
        let name = class_file(to_m, end);
        let records: Vec<Record> = of.iter().map(|one| one.record()).collect();
        elements(&folder.join(&name), &records, format, epoch, false)?;
        // Light is proportional to the square of the diameter.
        let squares: f64 = of.iter().map(|one| one.diameter_m * one.diameter_m).sum();
        let diameter_m = (squares / of.len() as f64).sqrt();
        let _ = write!(
            toml,
            "\n[[objects]]\nfiles = [{name:?}]\nsphere = {{ diameter_m = {diameter_m:.4} }}\n"
        );
    }
    let file = folder.join(POPULATION);
    write_text(&file, &toml, MARK, false)?;
    Ok(format!(
        "wrote {}\nin a scene: [objects] population = {:?}, exposures near {}\n",
        path_text(folder),
        path_text(&file),
        utc_text(epoch)
    ))
}

/// Writes one file of elements; fails if any cannot be written.
fn elements(
    file: &Path,
    records: &[Record],
    format: Format,
    epoch: Epoch,
    force: bool,
) -> anyhow::Result<()> {
    let written = write(records, format, epoch).unwrap_or_default();
    if let Some(first) = written.left_out.first() {
        bail!(
            "{}: {} of {} cannot be written as {format}: {first}; write .csv",
            path_text(file),
            written.left_out.len(),
            counted(records.len(), "object")
        );
    }
    write_text(file, &written.text, NO_MARK, force)?;
    Ok(())
}
