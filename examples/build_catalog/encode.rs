//! The contents of `stars.bin` and `names.tsv`; `src/render/sky/catalog.rs` documents and reads
//! them.

use crate::entries::Entry;
use crate::matching::Matching;
use crate::read::Bsc;
use anyhow::{Context, Result, bail};
use std::f64::consts::TAU;

/// `stars.bin`.
pub fn stars(entries: &[Entry]) -> Result<Vec<u8>> {
    let mut bytes = b"SKYCAT01".to_vec();
    bytes.extend(u32::try_from(entries.len())?.to_le_bytes());
    for entry in entries {
        record(entry, &mut bytes).with_context(|| format!("HIP {} HR {}", entry.hip, entry.hr))?;
    }
    Ok(bytes)
}

fn record(entry: &Entry, bytes: &mut Vec<u8>) -> Result<()> {
    let turn = |angle: f64| (angle / TAU * 4_294_967_296.0).round() as i64;
    bytes.extend(&entry.hip.to_le_bytes()[..3]);
    bytes.extend(entry.hr.to_le_bytes());
    bytes.extend((turn(entry.ra_rad) as u32).to_le_bytes());
    bytes.extend((turn(entry.dec_rad) as i32).to_le_bytes());
    bytes.extend(unit(entry.parallax_mas, 0.0125, 0, 65_535)?.to_le_bytes()[..2].iter());
    for pm in [entry.pm_ra_mas, entry.pm_dec_mas] {
        bytes.extend(unit(pm, 0.01, -(1 << 23), (1 << 23) - 1)?.to_le_bytes()[..3].iter());
    }
    for mag in [entry.v, entry.b_v] {
        bytes.extend(unit(mag, 0.001, -32_768, 32_767)?.to_le_bytes()[..2].iter());
    }
    Ok(())
}

fn unit(value: f64, unit: f64, min: i32, max: i32) -> Result<i32> {
    let scaled = (value / unit).round();
    if !(f64::from(min)..=f64::from(max)).contains(&scaled) {
        bail!("{value} does not fit units of {unit}");
    }
    Ok(scaled as i32)
}

/// `names.tsv`: one line for each HR that has a name, or whose entry is that of another HR.
pub fn names(
    bsc: &[Bsc],
    matching: &Matching,
    proper: &[(u32, String)],
    hips: &[u32],
) -> Result<String> {
    let mut principal: Vec<usize> = (0..bsc.len()).collect();
    let mut proper_of = vec![None; bsc.len()];
    for (&k, members) in &matching.groups {
        for &b in members {
            principal[b] = members[0];
        }
        proper_of[members[0]] = proper.iter().find(|row| row.0 == hips[k]).map(|row| &row.1);
    }
    let placed = proper_of.iter().flatten().count();
    if placed != proper.len() {
        bail!(
            "{placed} of {} proper names have a Bright Star",
            proper.len()
        );
    }
    let mut text = String::from("# HR\tHR of the entry\tnames\n");
    for (b, star) in bsc.iter().enumerate() {
        let mut names = designations(&star.designation)?;
        names.extend(proper_of[b].cloned());
        if principal[b] != b || !names.is_empty() {
            let row = format!(
                "{}\t{}\t{}\n",
                star.hr,
                bsc[principal[b]].hr,
                names.join(";")
            );
            text.push_str(&row);
        }
    }
    Ok(text)
}

/// ` 41Gam1Leo` becomes `gamma1 Leo` and `41 Leo`.
fn designations(printed: &str) -> Result<Vec<String>> {
    let part = |a: usize, b: usize| printed.get(a..b).unwrap_or("").trim();
    let (flamsteed, letter, index, constellation) =
        (part(0, 3), part(3, 6), part(6, 7), part(7, 10));
    let mut names = Vec::new();
    if !letter.is_empty() {
        let greek = GREEK
            .iter()
            .find(|name| {
                name.get(..letter.len())
                    .is_some_and(|n| n.eq_ignore_ascii_case(letter))
            })
            .with_context(|| format!("no Greek letter {letter:?} in {printed:?}"))?;
        names.push(format!("{greek}{index} {constellation}"));
    }
    if !flamsteed.is_empty() {
        names.push(format!("{flamsteed} {constellation}"));
    }
    Ok(names)
}

/// The Greek alphabet; the BSC prints up to three letters of each.
const GREEK: [&str; 24] = [
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa",
    "lambda", "mu", "nu", "xi", "omicron", "pi", "rho", "sigma", "tau", "upsilon", "phi", "chi",
    "psi", "omega",
];
