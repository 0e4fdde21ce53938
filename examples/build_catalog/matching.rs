//! Matches Hipparcos entries with Bright Stars and their light.

use crate::photometry::{VFromHp, sum_mag};
use crate::read::{Bsc, Hip, TO_J2000_YR};
use nalgebra::Vector3;
use std::collections::BTreeMap;

const ARCSEC: f64 = std::f64::consts::PI / 648_000.0;

/// Largest distance between a Bright Star and its entry. It is above the 16 arcsec of 61 Cygni A
/// from its position in the BSC, and below the 29 arcsec of sigma Ori E from the nearest entry.
const SAME_ARCSEC: f64 = 20.0;
/// Largest distance at which a further Bright Star becomes another name of the entry.
const NAME_ARCSEC: f64 = 25.0;
/// Distance from which Hipparcos resolves companions: the entry may lack their light.
const APART_ARCSEC: f64 = 10.0;
/// Largest distance at which an entry's light can reach the photometer at another one (field of 38
/// arcsec).
pub const PHOTOMETER_ARCSEC: f64 = 30.0;

/// Entries in bands of declination, for finding neighbours.
pub struct Neighbours {
    directions: Vec<Vector3<f64>>,
    bands: BTreeMap<i32, Vec<usize>>,
}

impl Neighbours {
    const BAND: f64 = 40.0 * ARCSEC;

    /// Entries at J2000.
    pub fn new(stars: &[Hip]) -> Neighbours {
        let directions: Vec<_> = stars.iter().map(|s| s.direction(TO_J2000_YR)).collect();
        let mut bands: BTreeMap<i32, Vec<usize>> = BTreeMap::new();
        for (k, u) in directions.iter().enumerate() {
            bands.entry(band(u)).or_default().push(k);
        }
        Neighbours { directions, bands }
    }

    /// (distance in arcsec, index) of the entries within `radius` (arcsec, at most 40) of `u`,
    /// nearest first.
    pub fn near(&self, u: &Vector3<f64>, radius: f64) -> Vec<(f64, usize)> {
        let centre = band(u);
        let mut found: Vec<(f64, usize)> = self
            .bands
            .range(centre - 1..=centre + 1)
            .flat_map(|(_, members)| members)
            .map(|&k| (arcsec(&self.directions[k], u), k))
            .filter(|(distance, _)| *distance <= radius)
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found
    }

    /// The other entries within `radius` (arcsec) of entry `k`.
    pub fn of(&self, k: usize, radius: f64) -> Vec<usize> {
        let near = self.near(&self.directions[k], radius);
        near.into_iter().map(|n| n.1).filter(|&j| j != k).collect()
    }
}

fn band(u: &Vector3<f64>) -> i32 {
    (u.z.asin() / Neighbours::BAND).floor() as i32
}

/// The angle between two directions, arcsec (small angles).
fn arcsec(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    (a - b).norm() / ARCSEC
}

/// Entries whose Hp is mixed with that of a neighbouring entry.
pub struct Blends {
    /// For each entry, whether its Hp includes light of a neighbouring entry, or the reverse.
    pub mixed: Vec<bool>,
    /// For each entry, whether it is the fainter of such a pair: its Hp may be its neighbour's.
    pub shadow: Vec<bool>,
}

impl Blends {
    /// A one-component entry under a double-star solution (15) was measured in the same photometer
    /// field as its neighbour. The shadow of such a pair is the entry with the larger scatter of Hp
    /// from scan to scan. Sigma Ori D has Hp 3.71, near sigma Ori AB with 3.68, but its magnitude
    /// is 6.8.
    pub fn new(stars: &[Hip], neighbours: &Neighbours) -> Blends {
        let mut blends = Blends {
            mixed: vec![false; stars.len()],
            shadow: vec![false; stars.len()],
        };
        let joint = |s: &Hip| s.solution == 15 && s.components == 1;
        for (k, star) in stars.iter().enumerate().filter(|(_, s)| s.hp <= 9.0) {
            for j in neighbours.of(k, PHOTOMETER_ARCSEC) {
                let other = &stars[j];
                let fainter = star.hp_scatter > other.hp_scatter.max(0.04);
                if other.hp <= 9.0
                    && (joint(star) || joint(other))
                    && fainter
                    && star.hp >= other.hp - 0.1
                {
                    blends.shadow[k] = true;
                    blends.mixed[k] = true;
                    blends.mixed[j] = true;
                }
            }
        }
        blends
    }
}

/// Bright Stars by Hipparcos entry.
pub struct Matching {
    /// Entry to its Bright Stars, the principal one (brightest, then lowest HR) first.
    pub groups: BTreeMap<usize, Vec<usize>>,
    /// Bright Stars that need their own entry: far from any entry, or too bright to be part of one.
    pub alone: Vec<(usize, Why)>,
    /// Distance of each one-to-one pair, arcsec.
    pub distances: Vec<f64>,
}

#[derive(Clone, Copy, PartialEq)]
pub enum Why {
    /// No entry within 25 arcsec.
    NoEntry,
    /// The nearby entry is too faint to include its light.
    FluxExcludesIt,
}

impl Matching {
    /// First pairs stars and entries one to one, in order of distance and difference in magnitude.
    /// Then adds further stars as names, and removes those that the flux of the entry excludes.
    pub fn new(
        stars: &[Hip],
        bsc: &[Bsc],
        neighbours: &Neighbours,
        blends: &Blends,
        to_v: &VFromHp,
    ) -> Matching {
        let mut pairs = Vec::new();
        for (b, bright) in bsc.iter().enumerate() {
            for (distance, k) in neighbours.near(&bright.direction, SAME_ARCSEC) {
                // Scales: the BSC's positional error, and a typical difference of close pairs, mag.
                let cost = distance / 2.0 + (bright.v - to_v.v(&stars[k])).abs() / 0.3;
                pairs.push((cost, b, k, distance));
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));

        let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        let mut taken = vec![false; bsc.len()];
        let mut distances = Vec::new();
        for (_, b, k, distance) in pairs {
            if !taken[b] && !groups.contains_key(&k) {
                taken[b] = true;
                groups.insert(k, vec![b]);
                distances.push(distance);
            }
        }

        let mut alone = Vec::new();
        for b in (0..bsc.len()).filter(|&b| !taken[b]) {
            let near = neighbours.near(&bsc[b].direction, NAME_ARCSEC);
            match near.into_iter().find(|(_, k)| groups.contains_key(k)) {
                Some((_, k)) => groups.entry(k).or_default().push(b),
                None => alone.push((b, Why::NoEntry)),
            }
        }

        for (&k, members) in &mut groups {
            members.sort_by(|&a, &b| bsc[a].v.total_cmp(&bsc[b].v).then(a.cmp(&b)));
            let principal = &bsc[members[0]];
            let v = to_v.v(&stars[k]);
            let excluded = |b: usize| {
                let apart = arcsec(&principal.direction, &bsc[b].direction) >= APART_ARCSEC;
                let like_the_principal = (principal.v - v).abs() <= to_v.tolerance(&stars[k]);
                blends.mixed[k]
                    || (apart
                        && like_the_principal
                        && v - sum_mag([principal.v, bsc[b].v]) >= to_v.tolerance(&stars[k]))
            };
            let (out, members_left) = members[1..].iter().partition(|&&b| excluded(b));
            let (out, members_left): (Vec<usize>, Vec<usize>) = (out, members_left);
            members.truncate(1);
            members.extend(members_left);
            alone.extend(out.into_iter().map(|b| (b, Why::FluxExcludesIt)));
        }
        alone.sort_by_key(|a| a.0);
        Matching {
            groups,
            alone,
            distances,
        }
    }
}
