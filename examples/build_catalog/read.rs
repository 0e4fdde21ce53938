//! Reads the three inputs: Hipparcos-2, the Bright Star Catalogue and the committed supplement.

use anyhow::{Context, Result, bail};
use nalgebra::Vector3;

/// One milliarcsecond, rad.
pub const MAS: f64 = std::f64::consts::PI / 648_000_000.0;

/// Years from the epoch of Hipparcos, J1991.25, to J2000.
pub const TO_J2000_YR: f64 = 8.75;

/// One row of `hip2.dat` (van Leeuwen 2007, "Hipparcos, the New Reduction of the Raw Data").
pub struct Hip {
    pub hip: u32,
    /// Solution type of the new reduction: 10 d + s, where d = 1 or 5 is a double star and 9 one of
    /// several entries.
    pub solution: u32,
    /// Number of components in the entry.
    pub components: u32,
    pub ra_rad: f64,
    pub dec_rad: f64,
    pub parallax_mas: f64,
    pub pm_ra_mas: f64,
    pub pm_dec_mas: f64,
    pub hp: f64,
    /// Scatter of Hp over the mission, mag.
    pub hp_scatter: f64,
    /// 0: constant, 1: amplitude above 0.6 mag, 2: smaller amplitude.
    pub variability: u32,
    pub b_v: f64,
    pub b_v_error: f64,
    pub v_i: f64,
}

impl Hip {
    /// The direction `years` after J1991.25, without parallax.
    pub fn direction(&self, years: f64) -> Vector3<f64> {
        let (e, n, u) = triad(self.ra_rad, self.dec_rad);
        (u + years * MAS * (self.pm_ra_mas * e + self.pm_dec_mas * n)).normalize()
    }

    /// Whether any colour was measured; else all three columns are 0.
    pub fn has_colour(&self) -> bool {
        self.b_v != 0.0 || self.b_v_error != 0.0 || self.v_i != 0.0
    }
}

/// One row of xplanet's `BSC`.
pub struct Bsc {
    pub hr: u16,
    /// Unit vector, ICRS, J2000; the file gives right ascension to 0.0001 h, 5.4 arcsec.
    pub direction: Vector3<f64>,
    pub v: f64,
    /// Flamsteed number, Bayer letter and constellation, as printed: ` 41Gam1Leo`.
    pub designation: String,
}

/// One row of `supplement.tsv`: data that the two catalogues lack.
pub struct Supplement {
    pub key: Key,
    /// RA and Dec (rad, J2000), proper motion (mas/yr), parallax (mas), B-V; absent for HIP rows.
    pub place: Option<[f64; 6]>,
    pub v: Option<f64>,
}

#[derive(Clone, Copy, PartialEq)]
pub enum Key {
    Hr(u16),
    Hip(u32),
}

/// Unit vectors to the east, to the north and outwards at (ra, dec).
pub fn triad(ra: f64, dec: f64) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
    let ((sa, ca), (sd, cd)) = (ra.sin_cos(), dec.sin_cos());
    (
        Vector3::new(-sa, ca, 0.0),
        Vector3::new(-sd * ca, -sd * sa, cd),
        Vector3::new(cd * ca, cd * sa, sd),
    )
}

/// RA in [0, 2 pi) and Dec of a direction, rad.
pub fn ra_dec(u: &Vector3<f64>) -> (f64, f64) {
    let ra = u.y.atan2(u.x).rem_euclid(std::f64::consts::TAU);
    (ra, u.z.atan2(u.x.hypot(u.y)))
}

/// Reads `hip2.dat`.
pub fn hipparcos(text: &str) -> Result<Vec<Hip>> {
    let row = |line: &str| -> Result<Hip> {
        let fields: Vec<&str> = line.split_whitespace().collect();
        if fields.len() != 41 {
            bail!("{} fields instead of 41", fields.len());
        }
        let real = |k: usize| -> Result<f64> {
            let text = fields[k];
            text.parse()
                .with_context(|| format!("field {}: {text:?}", k + 1))
        };
        let whole = |k: usize| real(k).map(|x| x as u32);
        Ok(Hip {
            hip: whole(0)?,
            solution: whole(1)?,
            components: whole(3)?,
            ra_rad: real(4)?,
            dec_rad: real(5)?,
            parallax_mas: real(6)?,
            pm_ra_mas: real(7)?,
            pm_dec_mas: real(8)?,
            hp: real(19)?,
            hp_scatter: real(21)?,
            variability: whole(22)?,
            b_v: real(23)?,
            b_v_error: real(24)?,
            v_i: real(25)?,
        })
    };
    rows(text, row)
}

/// Reads xplanet's `BSC`: fixed columns Dec (deg), RA (h), V, designation, HR, HD, SAO.
pub fn bright_stars(text: &str) -> Result<Vec<Bsc>> {
    let row = |line: &str| -> Result<Bsc> {
        let column = |a: usize, b: usize| -> Result<&str> {
            line.get(a..b)
                .with_context(|| format!("no columns {a} to {b}"))
        };
        let real = |a, b| -> Result<f64> { Ok(column(a, b)?.trim().parse()?) };
        let (ra, dec) = ((15.0 * real(8, 16)?).to_radians(), real(0, 8)?.to_radians());
        Ok(Bsc {
            hr: column(35, 40)?.trim().parse()?,
            direction: triad(ra, dec).2,
            v: real(16, 22)?,
            designation: column(24, 34)?.to_owned(),
        })
    };
    let mut stars = rows(text, row)?;
    stars.sort_by_key(|star| star.hr);
    Ok(stars)
}

/// Reads `supplement.tsv`.
pub fn supplement(text: &str) -> Result<Vec<Supplement>> {
    let row = |line: &str| -> Result<Supplement> {
        let cells: Vec<&str> = line.split('\t').collect();
        let [key, place @ .., v, b_v, _origin] = &cells[..] else {
            bail!("{} cells instead of 9", cells.len());
        };
        let key = match key.split_once(' ') {
            Some(("HR", n)) => Key::Hr(n.parse()?),
            Some(("HIP", n)) => Key::Hip(n.parse()?),
            _ => bail!("key {key:?} is neither HR nor HIP"),
        };
        let place = match place {
            ["-", ..] => None,
            [ra, dec, pm_ra, pm_dec, parallax] => Some([
                ra.parse::<f64>()?.to_radians(),
                dec.parse::<f64>()?.to_radians(),
                pm_ra.parse()?,
                pm_dec.parse()?,
                parallax.parse()?,
                b_v.parse()?,
            ]),
            _ => bail!("{} cells instead of 9", cells.len()),
        };
        let v = (*v != "-").then(|| v.parse()).transpose()?;
        Ok(Supplement { key, place, v })
    };
    rows(text, row)
}

/// Reads `proper_names.tsv`: HIP and name.
pub fn proper_names(text: &str) -> Result<Vec<(u32, String)>> {
    rows(text, |line| {
        let (hip, name) = line.split_once('\t').context("no tab")?;
        Ok((hip.parse()?, name.to_owned()))
    })
}

/// Reads every line with `row`, except comments, blank lines and the BSC's end mark.
fn rows<T>(text: &str, row: impl Fn(&str) -> Result<T>) -> Result<Vec<T>> {
    text.lines()
        .enumerate()
        .filter(|(_, line)| !line.starts_with('#') && line.len() > 3)
        .map(|(n, line)| row(line).with_context(|| format!("line {}", n + 1)))
        .collect()
}
