//! Element sets for the tests.

use hifitime::Epoch;
use skyloop_orbit::Checksum;
use skyloop_orbit::elements::Elements;
use skyloop_orbit::time::parse_utc;
use skyloop_orbit::{Orbit, load};
use std::f64::consts::PI;
use std::io::Write;
use std::path::PathBuf;

/// A verification case of AIAA 2006-6753.
pub struct Case {
    pub name: String,
    pub set: Elements,
    /// Minutes, x, y, z (km), vx, vy, vz (km/s), TEME.
    pub vectors: Vec<[f64; 7]>,
    /// Minutes and the error code of PyPI sgp4.
    pub codes: Vec<(f64, u8)>,
}

/// All verification cases. Checksums and fields that SGP4 does not use are ignored.
pub fn verification() -> Vec<Case> {
    // X-Val: SGP4-VER.TLE and tcppver.out, taken from PyPI sgp4 by data/make_references.py.
    let text = include_str!("../data/sgp4_verification.txt");
    let mut cases: Vec<Case> = Vec::new();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    while let Some(line) = lines.next() {
        if line.starts_with('1') {
            let line2 = lines.next().unwrap();
            cases.push(Case {
                name: line2[2..7].trim().to_owned(),
                set: Elements::parse(line, line2, Checksum::Ignored).unwrap(),
                vectors: Vec::new(),
                codes: Vec::new(),
            });
            continue;
        }
        let case = cases.last_mut().unwrap();
        match line.trim().strip_prefix("c ") {
            None => case.vectors.push(numbers(line).try_into().unwrap()),
            Some(codes) => case.codes = self::codes(codes),
        }
    }
    cases
}

/// Parses `0.0 5.0 11x0 2x6`: first step, distance of steps, runs.
fn codes(text: &str) -> Vec<(f64, u8)> {
    let mut words = text.split_whitespace();
    let start: f64 = words.next().unwrap().parse().unwrap();
    let step: f64 = words.next().unwrap().parse().unwrap();
    let codes = words.flat_map(|run| {
        let (steps, code) = run.split_once('x').unwrap();
        std::iter::repeat_n(code.parse::<u8>().unwrap(), steps.parse().unwrap())
    });
    let at = |(i, code)| (start + i as f64 * step, code);
    codes.enumerate().map(at).collect()
}

/// A made-up element set of a kind, and PyPI sgp4's error codes at [`DAYS`].
pub struct Synthetic {
    pub kind: &'static str,
    pub set: Elements,
    pub codes: Vec<u8>,
}

/// Days from the epoch with known error codes of made-up sets.
pub const DAYS: [f64; 11] = [
    -36525.0, -365.0, -30.0, -7.0, -1.0, 0.0, 1.0, 7.0, 30.0, 365.0, 36525.0,
];

/// The kind of orbits that reach into the Earth's core.
pub const CORE: &str = "beside the Earth's centre";

/// Made-up sets of every kind of orbit in SGP4.
pub fn synthetic() -> Vec<Synthetic> {
    // X-Val: data/make_batch_references.py: random sets, with error codes of PyPI sgp4 2.27.
    let text = include_str!("../data/synthetic_elements.txt");
    let (head, rows) = text.split_at(text.match_indices('\n').nth(2).unwrap().0 + 1);
    let days: Vec<f64> = numbers(&head.lines().last().unwrap().split('.').next().unwrap()[1..]);
    assert_eq!(days, DAYS);

    let mut kind = "";
    let mut sets = Vec::new();
    for line in rows.lines() {
        if let Some(name) = line.strip_prefix("# ") {
            kind = name;
            continue;
        }
        let (epoch, rest) = line.split_once(' ').unwrap();
        let (elements, codes) = rest.rsplit_once(' ').unwrap();
        let [
            inclination,
            node,
            eccentricity,
            perigee,
            mean_anomaly,
            revolutions,
            drag,
        ] = numbers(elements).try_into().unwrap();
        sets.push(Synthetic {
            kind,
            set: Elements {
                norad: sets.len() as u32,
                epoch: parse_utc(epoch).unwrap(),
                inclination: f64::to_radians(inclination),
                node: f64::to_radians(node),
                eccentricity,
                perigee: f64::to_radians(perigee),
                mean_anomaly: f64::to_radians(mean_anomaly),
                mean_motion: revolutions * (PI / 720.0),
                drag,
            },
            codes: codes.bytes().map(|code| code - b'0').collect(),
        });
    }
    sets
}

/// Environment variable with the folder of public catalogues.
pub const FOLDER: &str = "SKYLOOP_CATALOGUES";

/// Prints a test that was skipped, even where the test harness captures output.
pub fn not_tested(test: &str) {
    let _ = writeln!(std::io::stderr(), "NOT TESTED: {test}");
}

/// The public catalogues, by name, with their element sets. They are in the folder
/// `SKYLOOP_CATALOGUES`, or in `../shared/data/tle` next to the repository. An empty folder is
/// reported; a named one must not be empty.
pub fn catalogues() -> Vec<(String, Vec<Elements>)> {
    let named = std::env::var_os(FOLDER);
    let folder = match &named {
        Some(folder) => PathBuf::from(folder),
        None => PathBuf::from(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../../shared/data/tle"
        )),
    };
    let entries = std::fs::read_dir(&folder).into_iter().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| {
        path.extension()
            .is_some_and(|end| end == "tle" || end == "3le")
    });
    paths.sort();
    if paths.is_empty() {
        let folder = folder.display();
        let remedy = format!(
            "no public catalogue (*.tle, *.3le) in {folder}: save some there, or name a folder that has some in {FOLDER}"
        );
        assert!(named.is_none(), "{remedy}, or unset it");
        not_tested(&remedy);
    }
    let read = |path: PathBuf| {
        let loaded = load(&path).unwrap();
        let sets = loaded
            .objects
            .into_iter()
            .flat_map(|object| match object.orbit {
                Orbit::Elements(set, others) => std::iter::once(set).chain(others).collect(),
                Orbit::Ephemeris(_) => Vec::new(),
            });
        (
            path.file_name().unwrap().display().to_string(),
            sets.collect(),
        )
    };
    paths.into_iter().map(read).collect()
}

/// PyPI sgp4's error codes of a public catalogue.
pub struct Codes {
    pub catalogue: &'static str,
    pub sets: usize,
    /// Days from each epoch, and the code of each set.
    pub days: Vec<(f64, Vec<u8>)>,
}

/// The codes of all catalogues.
pub fn catalogue_codes() -> Vec<Codes> {
    // X-Val: data/make_catalogue_codes.py: PyPI sgp4 2.27.
    let text = include_str!("../data/catalogue_codes.txt");
    // All of these days are covered, also those without a failure.
    const DAYS: [f64; 9] = [-365.0, -30.0, -7.0, -1.0, 0.0, 1.0, 7.0, 30.0, 365.0];
    let mut all: Vec<Codes> = Vec::new();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        if let Some(head) = line.strip_prefix("= ") {
            let (catalogue, sets) = head.split_once(' ').unwrap();
            let sets = sets.parse().unwrap();
            all.push(Codes {
                catalogue,
                sets,
                days: DAYS.map(|days| (days, vec![0; sets])).into(),
            });
            continue;
        }
        let mut words = line.split(' ');
        let days: f64 = words.next().unwrap().parse().unwrap();
        let code = words.next().unwrap().parse().unwrap();
        let days_of_all = &mut all.last_mut().unwrap().days;
        let (_, codes) = days_of_all
            .iter_mut()
            .find(|(one, _)| *one == days)
            .unwrap();
        for index in words {
            codes[index.parse::<usize>().unwrap()] = code;
        }
    }
    all
}

/// The epoch of sets that a test makes.
pub fn epoch() -> Epoch {
    parse_utc("2026-07-11T00:00:00Z").unwrap()
}

fn numbers(line: &str) -> Vec<f64> {
    let words = line.split_whitespace();
    words.map(|word| word.parse().unwrap()).collect()
}
