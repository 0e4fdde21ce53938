//! The catalogue for one camera: directions for the field test, magnitudes in the camera's band.

use super::apparent::{Corrections, Observer, Sight, StarMotion, StarPlace};
use super::catalog::{Catalog, Star};
use crate::camera::Band;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::f64::consts::PI;
use std::ops::Range;

/// Greatest angle (rad) of a star from its catalogue direction: Barnard's star moves 0.32 degrees
/// in the 110 years to 2100; aberration adds up to 26 arcsec, deflection at most 6 (close behind
/// the Sun), parallax at most 0.8.
const MAX_SHIFT: f64 = 0.35 * std::f64::consts::PI / 180.0;

/// Stars with their data that are the same in all frames.
#[derive(Debug)]
pub struct StarField {
    catalog: Catalog,
    /// Group by group, since frames read whole groups.
    entries: Vec<Entry>,
    groups: Vec<Group>,
}

/// The data of a star that frames read.
#[derive(Debug)]
struct Entry {
    /// Index into the catalogue.
    index: u32,
    motion: StarMotion,
    /// Magnitude in the camera's band.
    band_mag: f64,
    /// See [`Band::wavelength_ratio`].
    wavelength_ratio: f64,
}

/// A star in the field.
#[derive(Debug, Clone, Copy)]
pub struct SeenStar {
    /// Index into the catalogue.
    pub index: usize,
    /// Apparent direction, unit vector, ICRF.
    pub direction: Vector3<f64>,
    /// Magnitude in the camera's band.
    pub band_mag: f64,
    /// Mean wavelength of its light in the band, relative to the band's reference.
    pub wavelength_ratio: f64,
}

/// Stars of a group.
const GROUP: usize = 64;
/// Minimum number of stars per parallel task.
const TASK: usize = 64;
/// Height, in sin(declination), of the strips of the sky that are cut into groups. In a strip stars
/// are ordered by right ascension; with 78,000 stars a group is some 7 deg wide.
const STRIP: f64 = 0.08;

/// Neighbouring stars, and a cone around them.
#[derive(Debug)]
struct Group {
    axis: Vector3<f64>,
    /// Half the cone's angle, rad, its cosine and its sine.
    angle: f64,
    cos: f64,
    sin: f64,
    /// Their range in the entries.
    entries: Range<usize>,
}

impl Group {
    fn of(stars: &[Entry], from: usize) -> Group {
        let sum: Vector3<f64> = stars.iter().map(|star| star.motion.direction).sum();
        let axis = sum.try_normalize(0.0).unwrap_or_else(Vector3::z);
        let angles = stars.iter().map(|star| star.motion.direction.angle(&axis));
        // A margin for rounding of the arc cosine near 1.
        let angle = angles.fold(0.0, f64::max) + 1e-7;
        let (sin, cos) = libm::sincos(angle);
        Group {
            axis,
            angle,
            cos,
            sin,
            entries: from..from + stars.len(),
        }
    }

    /// The groups of all stars, in their [`order`].
    fn all(stars: &[Entry]) -> Vec<Group> {
        let groups = stars.par_chunks(GROUP).enumerate();
        groups
            .map(|(i, stars)| Group::of(stars, i * GROUP))
            .collect()
    }
}

/// The indices in an order in which consecutive stars are neighbours: strip by strip, and by right
/// ascension in each.
fn order(stars: &[StarMotion]) -> Vec<u32> {
    let key = |(index, star): (usize, &StarMotion)| {
        let at = &star.direction;
        (
            (at.z / STRIP).floor(),
            libm::atan2(at.y, at.x),
            index as u32,
        )
    };
    let mut keys: Vec<(f64, f64, u32)> = stars.iter().enumerate().map(key).collect();
    keys.sort_unstable_by(|a, b| {
        let places = a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1));
        places.then(a.2.cmp(&b.2))
    });
    keys.into_iter().map(|(_, _, index)| index).collect()
}

impl StarField {
    /// Prepares `catalog` for `band`. Without `colour` the band magnitude is V, and all light has
    /// the Sun's colour.
    pub fn new(catalog: Catalog, band: &Band, colour: bool) -> StarField {
        let v_band = Band::named("v");
        let stars = catalog.stars();
        // The catalogue's B-V has steps of 0.001 mag: there are far fewer colours than stars.
        let terms: HashMap<u64, f64> = match &v_band {
            Some(v_band) if colour => {
                let colours: HashSet<u64> = stars.iter().map(|star| star.b_v.to_bits()).collect();
                let term = |bits| (bits, band.colour_term(f64::from_bits(bits), v_band));
                colours.into_par_iter().map(term).collect()
            }
            _ => HashMap::new(),
        };
        let band_mag = |star: &Star| {
            let term = terms.get(&star.b_v.to_bits());
            star.v_mag + term.copied().unwrap_or_default()
        };
        let wavelength_ratio = |star: &Star| {
            if colour {
                band.wavelength_ratio(star.b_v)
            } else {
                1.0
            }
        };
        let places = stars.par_iter().map(position);
        let motions: Vec<StarMotion> = places.map(|position| StarMotion::of(&position)).collect();
        let entry = |index: u32| {
            let star = &stars[index as usize];
            Entry {
                index,
                motion: motions[index as usize],
                band_mag: band_mag(star),
                wavelength_ratio: wavelength_ratio(star),
            }
        };
        let entries: Vec<Entry> = order(&motions).into_par_iter().map(entry).collect();
        StarField {
            groups: Group::all(&entries),
            entries,
            catalog,
        }
    }

    /// The catalogue.
    pub fn catalog(&self) -> &Catalog {
        &self.catalog
    }

    /// Number of stars with at most this magnitude in the band.
    pub(crate) fn brighter_than(&self, band_mag: f64) -> usize {
        let stars = self.entries.iter();
        stars.filter(|star| star.band_mag <= band_mag).count()
    }

    /// The stars within `angle` (rad) of `axis` (unit vector, ICRF), as seen by `observer`, in
    /// catalogue order.
    pub fn in_cone(
        &self,
        axis: &Vector3<f64>,
        angle: f64,
        observer: &Observer,
        corrections: &Corrections,
    ) -> Vec<SeenStar> {
        let reach = angle + MAX_SHIFT;
        let (sin, cos) = libm::sincos(reach);
        // All directions, regardless of rounding in products of unit vectors.
        let nearest = if reach < PI { cos } else { -2.0 };
        let near = |group: &&Group| {
            // The cosine of the sum of both angles.
            reach + group.angle >= PI
                || group.axis.dot(axis) >= cos * group.cos - sin * group.sin - 1e-15
        };
        let entries = self.groups.iter().filter(near).flat_map(|group| {
            let entries = self.entries.get(group.entries.clone()).unwrap_or_default();
            entries.iter()
        });
        let mut near: Vec<(u32, &Entry)> = entries
            .filter(|star| star.motion.direction.dot(axis) >= nearest)
            .map(|star| (star.index, star))
            .collect();
        near.sort_unstable_by_key(|(index, _)| *index);
        let sight = Sight::of(observer, corrections);
        let stars = near.par_iter().with_min_len(TASK);
        let seen = stars.map(|(index, star)| SeenStar {
            index: *index as usize,
            direction: sight.of_star(&star.motion),
            band_mag: star.band_mag,
            wavelength_ratio: star.wavelength_ratio,
        });
        seen.collect()
    }
}

fn position(star: &Star) -> StarPlace {
    StarPlace {
        ra_rad: star.ra_rad,
        dec_rad: star.dec_rad,
        parallax_rad: star.parallax_rad,
        pm_ra_cosdec_rad_yr: star.pm_ra_cosdec_rad_yr,
        pm_dec_rad_yr: star.pm_dec_rad_yr,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sky::bodies::Bodies;
    use crate::sky::catalog::Selection;
    use hifitime::Epoch;

    #[test]
    fn cones_contain_all_of_their_stars() {
        let catalog = Catalog::embedded(Selection::Hipparcos);
        let band = Band::named("v").unwrap();
        let field = StarField::new(catalog, &band, false);
        let grouped = field.groups.iter().flat_map(|group| group.entries.clone());
        assert!(grouped.eq(0..field.entries.len()));
        let mut directions = vec![Vector3::zeros(); field.catalog.stars().len()];
        for star in &field.entries {
            directions[star.index as usize] = star.motion.direction;
        }
        let epoch = Epoch::from_gregorian_utc_at_midnight(2026, 6, 1);
        let observer = Observer {
            epoch,
            position_m: Vector3::zeros(),
            velocity_m_s: Vector3::zeros(),
            bodies: Bodies::at(epoch).unwrap(),
        };
        let poles = [Vector3::z(), -Vector3::z(), Vector3::x(), -Vector3::x()];
        let others = (1..20).map(|i| {
            let i = f64::from(i);
            Vector3::new((7.0 * i).sin(), (3.0 * i).cos(), (2.0 * i).sin()).normalize()
        });
        for axis in poles.into_iter().chain(others) {
            for angle in [1e-4, 0.03, 0.2, 1.0, 1.6, 3.0, 3.2] {
                let seen = field.in_cone(&axis, angle, &observer, &Corrections::NONE);
                let seen: Vec<usize> = seen.iter().map(|star| star.index).collect();
                let (all, reach) = (0..directions.len(), angle + MAX_SHIFT);
                let near = all.filter(|i| reach >= PI || directions[*i].dot(&axis) >= reach.cos());
                assert_eq!(seen, near.collect::<Vec<_>>(), "{axis:?} {angle}");
            }
        }
    }
}
