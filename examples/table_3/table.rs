//! Table 3 of Clark et al. 2021 (Sensors 21, 7868), with skyloop's times and the published ones.

use super::sequence::{PERIOD_S, SequenceTimes, catalogue, render};
use anyhow::Context;
use clap::Parser;
use skyloop::effect::counted;
use skyloop::measure::Machine;
use skyloop::stats::times;
use skyloop_firmware_sim::text::whole;
use std::fmt::Write;
use std::io;
use std::path::PathBuf;

/// The published table: simulator, images, total (s), average time per image (s).
const PUBLISHED: [(&str, u32, &str, &str); 4] = [
    ("SBOIS", 200, "67", "0.34"),
    ("STK-EOIR", 200, "681", "3.4"),
    ("SBOIS", 1000, "280", "0.28"),
    ("STK-EOIR", 1000, "3322", "3.3"),
];
/// Lengths of the table's sequences.
const IMAGES: [u32; 2] = [200, 1000];

/// Render and write the sequences of the paper's Table 3, and print their times with the paper's.
#[derive(Parser)]
#[command(name = "table_3")]
pub struct Args {
    /// Objects from a TLE, 3LE, OMM or OEM file, or a folder of them [default: 20,000 made-up ones]
    #[arg(long, value_name = "FILE")]
    tle: Option<String>,
    /// One sequence of so many images, 1 to 10,000 [default: two, of 200 and of 1,000]
    #[arg(long, value_name = "N", value_parser = whole(1..=10_000u32), allow_hyphen_values = true)]
    images: Option<u32>,
    /// Folder for frames and labels, with a folder for each sequence
    /// [default: a temporary one, removed at the end]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Renders the requested sequences; `say` receives each text at once.
///
/// # Errors
///
/// Objects cannot be read, or files cannot be written.
pub fn print(args: &Args, mut say: impl FnMut(&str) -> io::Result<()>) -> anyhow::Result<()> {
    let objects = catalogue(args.tle.as_deref())?;
    let temporary;
    let folder = match &args.out {
        Some(out) => out.as_path(),
        None => {
            temporary = tempfile::tempdir().context(
                "cannot make a temporary folder for the images; name one that you may write to: --out DIR",
            )?;
            temporary.path()
        }
    };
    say(&head(args, objects.len()))?;
    let lengths = args.images.map_or(IMAGES.to_vec(), |images| vec![images]);
    for images in lengths {
        let took = render(&objects, images, &folder.join(format!("{images}-images")))?;
        say(&rows(&took))?;
    }
    Ok(())
}

/// The setup, and the names of the columns.
fn head(args: &Args, objects: usize) -> String {
    let whose = match &args.tle {
        Some(file) => format!("{} of {file}", counted(objects, "object")),
        None => format!("{objects} made-up objects"),
    };
    let into = match &args.out {
        Some(out) => out.display().to_string(),
        None => "a temporary folder".to_string(),
    };
    format!(
        "Clark et al. 2021 (Sensors 21, 7868), Table 3: what sequences of images with labels take.\n\
         Ours: the built-in scene (FAI on CASSIOPE, 256 x 256, stars to Hp 9) with {whose}, spheres of 10 m;\n\
         an image every {PERIOD_S} s with the attitude held, since the paper gives no cadence; FITS, PNG and labels\n\
         written into {into}. On {}.\n\
         The paper's: as published, on another machine.\n\n\
         {:<12}{:>8}{:>12}{:>14}\n",
        Machine::this(),
        "",
        "images",
        "total, s",
        "s an image"
    )
}

/// Rows of a sequence and of the published ones with its length, or of all if there are none.
fn rows(took: &SequenceTimes) -> String {
    let images = took.images;
    let each_s = took.total_s / f64::from(images);
    let row = |name: &str, images: u32, total: &str, each: &str| {
        format!("{name:<12}{images:>8}{total:>12}{each:>14}\n")
    };
    let (total, each) = (format!("{:.2}", took.total_s), format!("{each_s:.4}"));
    let mut text = row("skyloop", images, &total, &each);
    let as_long = IMAGES.contains(&images);
    for (name, of, total, each) in PUBLISHED {
        if of == images || !as_long {
            text += &row(name, of, total, each);
        }
    }
    let stats = &took.stats;
    let mean = |count: usize| count as f64 / f64::from(images);
    let _ = writeln!(
        text,
        "  ours: ready in {:.2} s; rendered in {} (p50 / p99 / max), the rest is writing; labels an image: {:.0} stars, {:.1} objects\n",
        took.ready_s,
        times(&stats.render, &[0.5, 0.99, 1.0]),
        mean(stats.stars),
        mean(stats.rsos),
    );
    text
}
