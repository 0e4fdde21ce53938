//! The embedded star catalogue: Hipparcos-2 to Hp 9 and the whole Bright Star Catalogue.
//!
//! `cargo run --example build_catalog` builds it from `hip2.dat` (van Leeuwen 2007) and the Bright
//! Star Catalogue (Hoffleit and Warren 1991); with `--check` it compares the result with the stored
//! files. It holds 78,367 entries: 78,340 of Hipparcos (Hp <= 9, or fainter with an HR number) and
//! 27 of the Bright Star Catalogue alone. The two sources are merged by these rules:
//!
//! - **Names.** All 9,096 HR numbers have an entry. 8,998 are matched one to one, at J2000 and
//!   within 20 arcsec (median 1.3; the Bright Star Catalogue resolves right ascension to 5.4
//!   arcsec). 71 more are within 25 arcsec of a matched entry that contains their light, such as
//!   both stars of gamma Leo: they are names of that entry. 27 have no match with their light. 24
//!   of them have no entry within 25 arcsec (xi UMa, xi Sco, eta Car, gamma1 Vel, sigma Ori E,
//!   ...). Mizar B and p Eri B, 14 and 11 arcsec from their primaries, are missing in the primary's
//!   Hp. Theta1 Ori B is among entries with mixed Hp. Positions and motions of the 27 are
//!   Tycho-2's, to 0.2 arcsec.
//! - **V** of an entry with an HR is the Bright Star Catalogue's (8,538 entries). V is computed
//!   from Hp in three cases. The entry has several HR (69). The two differ by more than 0.1 mag, or
//!   0.3 mag beyond V-I = 2 (272: variables such as T CrB, listed at its outburst, and magnitudes
//!   of close pairs). Another entry is within 30 arcsec (104). Sirius and Canopus have the Bright
//!   Star Catalogue's: the photometer saturates for stars brighter than Hp 0. Without an HR, V is
//!   computed from Hp: with x = V-I - 1, V-I not below -0.3, `V = Hp - 0.15655 - 0.03839 x +
//!   0.13310 x^2 + 0.00487 x^3 - 0.00813 x^4 - 0.00330 x^5` up to V-I = 3, fitted to 7,135 single
//!   stars, rms 0.019 mag where V-I < 1.6. Beyond, V-Hp rises by 0.46 mag per magnitude of V-I.
//! - **No light counts twice.** Hipparcos measured some close pairs in one field of its photometer,
//!   so both entries have the sum: sigma Ori D is listed as Hp 3.71. Of such pairs, those with an
//!   HR take the Bright Star Catalogue's V (11, and alpha Cen B and alpha1 CVn), eight Tycho's, and
//!   one the literature's. 18 faint ones without any other V (Hp 6.9 to 8.9) are omitted, since
//!   their light is in the neighbour's.
//! - **B-V** is as measured (77,304). Where its error is 0.2 mag or more (estimates, up to 5.5 for
//!   red stars) it follows from V-I by the medians of well measured stars (943); 93 entries without
//!   any colour take the median star's, 0.55.
//! - Negative parallaxes (1,319, noise) are set to 0.
//!
//! `stars.bin` is, little-endian, `SKYCAT01`, a u32 count and a record of 25 bytes per entry: HIP
//! u24, HR u16, right ascension u32 and declination i32 in 2^-32 of a turn (0.30 mas), parallax u16
//! in 0.0125 mas, proper motion in right ascension (times cos Dec) and declination i24 in 0.01
//! mas/yr, V and B-V i16 in 0.001 mag. `names.tsv` gives, for each HR that has a name or belongs to
//! another HR's entry: HR, HR of the entry, names separated by semicolons.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

const STARS: &[u8] = include_bytes!("data/stars.bin");
const NAMES: &str = include_str!("data/names.tsv");

/// Bytes before the first record: signature and count.
const HEADER: usize = 12;
const RECORD: usize = 25;

/// One milliarcsecond, rad.
const MAS: f64 = PI / 648_000_000.0;

/// One entry of the catalogue: ICRS, epoch J1991.25.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Star {
    /// Hipparcos number; 0: none.
    pub hip: u32,
    /// Principal number in the Bright Star Catalogue; 0: none.
    pub hr: u16,
    /// Right ascension, rad, in [0, 2 pi).
    pub ra_rad: f64,
    /// Declination, rad.
    pub dec_rad: f64,
    /// Parallax, rad; 0 if not measured.
    pub parallax_rad: f64,
    /// Proper motion in right ascension times cos(Dec), rad per Julian year.
    pub pm_ra_cosdec_rad_yr: f64,
    /// Proper motion in declination, rad per Julian year.
    pub pm_dec_rad_yr: f64,
    /// Johnson V, mag, of all the light of this entry.
    pub v_mag: f64,
    /// Johnson B-V, mag, in [-0.4, 3.8].
    pub b_v: f64,
}

/// Subset of the catalogue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Selection {
    /// All 78,367 entries. In a configuration: `hipparcos`.
    #[default]
    Hipparcos,
    /// The 9,025 entries with an HR number. In a configuration: `bsc`.
    Bsc,
}

/// The catalogue in memory.
#[derive(Debug, Clone)]
pub struct Catalog {
    /// By HIP; entries without a HIP follow, by HR.
    stars: Vec<Star>,
    /// All names of the entry with this principal HR, in label form.
    names: HashMap<u16, Vec<String>>,
}

impl Catalog {
    /// The catalogue embedded in the program.
    pub fn embedded(selection: Selection) -> Catalog {
        let stars = STARS
            .get(HEADER..)
            .unwrap_or_default()
            .chunks_exact(RECORD)
            .map(decode)
            .filter(|star| selection == Selection::Hipparcos || star.hr != 0)
            .collect();
        Catalog {
            stars,
            names: read_names(),
        }
    }

    /// All entries, by HIP; those without a HIP follow, by HR.
    pub fn stars(&self) -> &[Star] {
        &self.stars
    }

    /// `HIP 80351`, or `HR 4375` where there is no Hipparcos number.
    pub fn id(&self, star: &Star) -> String {
        let (catalogue, number) = match star.hip {
            0 => ("HR", u32::from(star.hr)),
            hip => ("HIP", hip),
        };
        // Without `format!`, for speed: a frame has thousands of ids.
        let (mut digits, mut first, mut rest) = ([b'0'; 10], 10, number);
        while rest > 0 || first == digits.len() {
            first -= 1;
            digits[first] += (rest % 10) as u8;
            rest /= 10;
        }
        let mut id = String::with_capacity("HIP 120000".len());
        id.push_str(catalogue);
        id.push(' ');
        id.push_str(str::from_utf8(&digits[first..]).unwrap_or_default());
        id
    }

    /// All HR numbers, the principal one first, then Bayer and Flamsteed designations and the
    /// proper name: `HR 4057`, `HR 4058`, `gamma1 Leo`, `41 Leo`, `Algieba`, `gamma2 Leo`. Empty
    /// without an HR.
    pub fn names(&self, star: &Star) -> Vec<String> {
        match (star.hr, self.names.get(&star.hr)) {
            (0, _) => Vec::new(),
            (_, Some(names)) => names.clone(),
            (hr, None) => vec![format!("HR {hr}")],
        }
    }
}

fn read_names() -> HashMap<u16, Vec<String>> {
    let rows: Vec<(u16, u16, &str)> = NAMES.lines().filter_map(name_row).collect();
    let mut names: HashMap<u16, Vec<String>> = HashMap::new();
    for &(_, entry, _) in &rows {
        names
            .entry(entry)
            .or_insert_with(|| vec![format!("HR {entry}")]);
    }
    for &(hr, entry, _) in rows.iter().filter(|(hr, entry, _)| hr != entry) {
        names.entry(entry).or_default().push(format!("HR {hr}"));
    }
    // The principal star's designations come first.
    let (principal, further): (Vec<_>, Vec<_>) =
        rows.iter().partition(|(hr, entry, _)| hr == entry);
    for (_, entry, designations) in principal.into_iter().chain(further) {
        let known = names.entry(entry).or_default();
        for name in designations.split(';').filter(|name| !name.is_empty()) {
            if !known.iter().any(|k| k == name) {
                known.push(name.to_owned());
            }
        }
    }
    names
}

/// One line of `names.tsv`; none for its heading.
fn name_row(line: &'static str) -> Option<(u16, u16, &'static str)> {
    let mut cells = line.split('\t');
    Some((
        cells.next()?.parse().ok()?,
        cells.next()?.parse().ok()?,
        cells.next()?,
    ))
}

/// One record of `stars.bin`.
fn decode(record: &[u8]) -> Star {
    let turn = TAU / 4_294_967_296.0;
    Star {
        hip: unsigned(record, 0, 3),
        hr: unsigned(record, 3, 2) as u16,
        ra_rad: f64::from(unsigned(record, 5, 4)) * turn,
        dec_rad: f64::from(signed(record, 9, 4)) * turn,
        parallax_rad: f64::from(unsigned(record, 13, 2)) * 0.0125 * MAS,
        pm_ra_cosdec_rad_yr: f64::from(signed(record, 15, 3)) * 0.01 * MAS,
        pm_dec_rad_yr: f64::from(signed(record, 18, 3)) * 0.01 * MAS,
        v_mag: f64::from(signed(record, 21, 2)) / 1000.0,
        b_v: f64::from(signed(record, 23, 2)) / 1000.0,
    }
}

/// `len` bytes from `at`, little-endian.
fn unsigned(record: &[u8], at: usize, len: usize) -> u32 {
    let bytes = record.get(at..at + len).unwrap_or_default();
    bytes
        .iter()
        .rev()
        .fold(0, |value, &byte| value << 8 | u32::from(byte))
}

/// As `unsigned`, in two's complement.
fn signed(record: &[u8], at: usize, len: usize) -> i32 {
    let unused = 32 - 8 * len as u32;
    ((unsigned(record, at, len) << unused) as i32) >> unused
}
