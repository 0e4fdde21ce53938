//! The entries of the embedded catalogue: positions, colours and V magnitudes.

use crate::matching::{Blends, Matching, Neighbours, PHOTOMETER_ARCSEC};
use crate::photometry::{ColourTable, Origin, VFromHp};
use crate::read::{Bsc, Hip, Key, MAS, Supplement, TO_J2000_YR, ra_dec, triad};
use anyhow::{Context, Result};
use std::collections::BTreeMap;

/// Faintest Hp of entries without an HR.
pub const FAINTEST_HP: f64 = 9.0;

/// Hp is wrong for brighter stars: Sirius has Hp -1.09 and V -1.46.
const SATURATED_HP: f64 = 0.0;

/// A star of the output.
pub struct Entry {
    pub hip: u32,
    pub hr: u16,
    pub ra_rad: f64,
    pub dec_rad: f64,
    pub parallax_mas: f64,
    pub pm_ra_mas: f64,
    pub pm_dec_mas: f64,
    pub v: f64,
    pub b_v: f64,
}

/// Origin of V.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum VOrigin {
    /// V of the Bright Star Catalogue.
    Bsc,
    /// V of the Bright Star Catalogue, since Hp is mixed with that of a neighbour.
    BscForMixedHp,
    /// V of the Bright Star Catalogue, since the star is too bright for Hp.
    BscForSaturatedHp,
    /// V of the supplement.
    Supplement,
    /// Hp: no HR.
    HpNoHr,
    /// Hp: the entry has several HR.
    HpSeveralHr,
    /// Hp: V of the BSC differs by more than the colour allows.
    HpDisagrees,
    /// Hp: another entry is within the photometer's field, and V of the BSC may be that of both.
    HpCloseNeighbour,
}

/// Statistics of the decisions.
#[derive(Default)]
pub struct Tally {
    pub v_origins: BTreeMap<VOrigin, usize>,
    /// Counts of B-V: measured, from V-I, median.
    pub colours: [usize; 3],
    /// Omitted entries without a V, whose Hp is a neighbour's light: HIP, Hp.
    pub dropped: Vec<(u32, f64)>,
    /// Entries whose V from Hp disagrees with the BSC: HR, HIP, V of the BSC, V from Hp.
    pub disagree: Vec<(u16, u32, f64, f64)>,
    pub negative_parallaxes: usize,
}

/// The inputs, read and matched.
pub struct Sky<'a> {
    pub stars: &'a [Hip],
    pub bsc: &'a [Bsc],
    pub supplement: &'a [Supplement],
    pub neighbours: &'a Neighbours,
    pub blends: &'a Blends,
    pub matching: &'a Matching,
    pub to_v: &'a VFromHp,
    pub colours: &'a ColourTable,
}

impl Sky<'_> {
    /// The entries by HIP, followed by HR entries without HIP.
    pub fn entries(&self) -> Result<(Vec<Entry>, Tally)> {
        let mut tally = Tally::default();
        let mut entries = Vec::new();
        for (k, star) in self.stars.iter().enumerate() {
            let group = self.matching.groups.get(&k);
            if star.hp > FAINTEST_HP && group.is_none() {
                continue;
            }
            let principal = group.map(|members| &self.bsc[members[0]]);
            let several = group.is_some_and(|members| members.len() > 1);
            let Some((v, origin)) = self.v(k, principal, several) else {
                tally.dropped.push((star.hip, star.hp));
                continue;
            };
            *tally.v_origins.entry(origin).or_default() += 1;
            if let (VOrigin::HpDisagrees, Some(bright)) = (origin, principal) {
                tally.disagree.push((bright.hr, star.hip, bright.v, v));
            }
            let (b_v, from) = self.colours.b_v(star);
            tally.colours[match from {
                Origin::Measured => 0,
                Origin::FromVI => 1,
                Origin::Median => 2,
            }] += 1;
            tally.negative_parallaxes += usize::from(star.parallax_mas < 0.0);
            entries.push(Entry {
                hip: star.hip,
                hr: principal.map_or(0, |bright| bright.hr),
                ra_rad: star.ra_rad,
                dec_rad: star.dec_rad,
                parallax_mas: star.parallax_mas.max(0.0),
                pm_ra_mas: star.pm_ra_mas,
                pm_dec_mas: star.pm_dec_mas,
                v,
                b_v,
            });
        }
        entries.sort_by_key(|entry| entry.hip);
        for (b, _) in &self.matching.alone {
            entries.push(self.alone(&self.bsc[*b])?);
        }
        Ok((entries, tally))
    }

    /// V of entry `k`; none where the entry has only its neighbour's light.
    fn v(&self, k: usize, principal: Option<&Bsc>, several: bool) -> Option<(f64, VOrigin)> {
        let star = &self.stars[k];
        let by_hp = self.to_v.v(star);
        let key = Key::Hip(star.hip);
        let supplied = self.supplement.iter().find(|row| row.key == key);
        if let Some(v) = supplied.and_then(|row| row.v) {
            return Some((v, VOrigin::Supplement));
        }
        Some(match principal {
            None if self.blends.shadow[k] => return None,
            None => (by_hp, VOrigin::HpNoHr),
            Some(bright) if self.blends.mixed[k] => (bright.v, VOrigin::BscForMixedHp),
            Some(bright) if star.hp < SATURATED_HP => (bright.v, VOrigin::BscForSaturatedHp),
            Some(_) if several => (by_hp, VOrigin::HpSeveralHr),
            Some(bright) if (bright.v - by_hp).abs() > self.to_v.tolerance(star) => {
                (by_hp, VOrigin::HpDisagrees)
            }
            Some(_) if self.has_close_neighbour(k) => (by_hp, VOrigin::HpCloseNeighbour),
            Some(bright) => (bright.v, VOrigin::Bsc),
        })
    }

    /// Whether another entry of the catalogue is within the photometer's field.
    fn has_close_neighbour(&self, k: usize) -> bool {
        let neighbours = self.neighbours.of(k, PHOTOMETER_ARCSEC);
        neighbours.iter().any(|&j| self.stars[j].hp <= FAINTEST_HP)
    }

    /// A Bright Star without Hipparcos entry, moved from J2000 to the catalogue's epoch.
    fn alone(&self, bright: &Bsc) -> Result<Entry> {
        let key = Key::Hr(bright.hr);
        let row = self.supplement.iter().find(|row| row.key == key);
        let [ra, dec, pm_ra, pm_dec, parallax, b_v] =
            row.and_then(|row| row.place).with_context(|| {
                format!(
                    "HR {} has no entry and no place in the supplement",
                    bright.hr
                )
            })?;
        let (e, n, u) = triad(ra, dec);
        let at_epoch = (u - TO_J2000_YR * MAS * (pm_ra * e + pm_dec * n)).normalize();
        let (ra_rad, dec_rad) = ra_dec(&at_epoch);
        Ok(Entry {
            hip: 0,
            hr: bright.hr,
            ra_rad,
            dec_rad,
            parallax_mas: parallax,
            pm_ra_mas: pm_ra,
            pm_dec_mas: pm_dec,
            v: row.and_then(|row| row.v).unwrap_or(bright.v),
            b_v,
        })
    }
}
