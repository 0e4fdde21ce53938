//! The catalogue as one camera sees it: directions for the field test, magnitudes in the camera's band.

use super::apparent::{Corrections, Observer, Sight, StarPlace, catalogue_direction};
use super::catalog::{Catalog, Star};
use crate::camera::Band;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::HashMap;
use std::f64::consts::PI;

/// How far (rad) a star may stand from its catalogue direction: Barnard's star moves 0.32 degrees in the 110
/// years to 2100; aberration adds up to 26 arcsec, deflection at most 6 (close behind the Sun), parallax at most 0.8.
const WANDER: f64 = 0.35 * std::f64::consts::PI / 180.0;

/// Stars with what does not change from frame to frame.
#[derive(Debug)]
pub struct StarField {
    catalog: Catalog,
    /// Unit vectors at the catalogue's epoch, ICRS.
    directions: Vec<Vector3<f64>>,
    groups: Vec<Group>,
    /// Magnitudes in the camera's band.
    band_mags: Vec<f64>,
    /// See [`Band::wavelength_ratio`].
    wavelength_ratios: Vec<f64>,
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
    /// Mean wavelength of its light in the band, over the band's reference.
    pub wavelength_ratio: f64,
}

/// Stars that stand together.
const GROUP: usize = 64;
/// Groups are cut from strips of the sky of this height (1, along the pole's axis), in which stars follow each other by right ascension: of 78,000 stars
/// those are as wide as some 7 deg.
const STRIP: f64 = 0.08;

/// Stars that stand together, and a cone around them.
#[derive(Debug)]
struct Group {
    axis: Vector3<f64>,
    /// Half the cone's angle, rad.
    angle: f64,
    /// Indices into the catalogue.
    stars: Vec<u32>,
}

impl Group {
    fn of(stars: &[u32], directions: &[Vector3<f64>]) -> Group {
        let direction = |star: &u32| directions[*star as usize];
        let sum: Vector3<f64> = stars.iter().map(direction).sum();
        let axis = sum.try_normalize(0.0).unwrap_or_else(Vector3::z);
        let angles = stars.iter().map(|star| direction(star).angle(&axis));
        Group {
            axis,
            // What rounding takes of the arc cosine near 1, too.
            angle: angles.fold(0.0, f64::max) + 1e-7,
            stars: stars.to_vec(),
        }
    }

    /// Those of all stars.
    fn all(directions: &[Vector3<f64>]) -> Vec<Group> {
        let strip = |star: &u32| (directions[*star as usize].z / STRIP).floor();
        let around = |star: &u32| {
            let direction = directions[*star as usize];
            libm::atan2(direction.y, direction.x)
        };
        let mut order: Vec<u32> = (0..directions.len() as u32).collect();
        order.sort_by(|a, b| {
            let strips = strip(a).total_cmp(&strip(b));
            strips.then_with(|| around(a).total_cmp(&around(b)))
        });
        let groups = order.par_chunks(GROUP);
        groups.map(|stars| Group::of(stars, directions)).collect()
    }
}

impl StarField {
    /// Prepares `catalog` for `band`; without `colour` the band magnitude is V, and all light has the Sun's colour.
    pub fn new(catalog: Catalog, band: &Band, colour: bool) -> StarField {
        let v_band = Band::named("v");
        // Colours are given to a thousandth or so: far fewer than stars.
        let mut terms = HashMap::new();
        let mut band_mag = |star: &Star| match &v_band {
            Some(v_band) if colour => {
                star.v_mag
                    + *terms
                        .entry(star.b_v.to_bits())
                        .or_insert_with(|| band.colour_term(star.b_v, v_band))
            }
            _ => star.v_mag,
        };
        let wavelength_ratio = |star: &Star| match colour {
            true => band.wavelength_ratio(star.b_v),
            false => 1.0,
        };
        let directions = catalog.stars().iter();
        let directions: Vec<Vector3<f64>> = directions
            .map(|star| catalogue_direction(&place(star)))
            .collect();
        StarField {
            wavelength_ratios: catalog.stars().iter().map(wavelength_ratio).collect(),
            groups: Group::all(&directions),
            directions,
            band_mags: catalog.stars().iter().map(&mut band_mag).collect(),
            catalog,
        }
    }

    /// The catalogue.
    pub fn catalog(&self) -> &Catalog {
        &self.catalog
    }

    /// The stars within `angle` (rad) of `axis` (unit vector, ICRF), apparent to `observer`, in catalogue order.
    pub fn in_cone(
        &self,
        axis: &Vector3<f64>,
        angle: f64,
        observer: &Observer,
        corrections: &Corrections,
    ) -> Vec<SeenStar> {
        // In all directions, whatever rounding makes of products of unit vectors.
        let least = |angle: f64| if angle < PI { libm::cos(angle) } else { -2.0 };
        let nearest = least(angle + WANDER);
        let near = |group: &&Group| group.axis.dot(axis) >= least(angle + WANDER + group.angle);
        let groups: Vec<&Group> = self.groups.iter().filter(near).collect();
        let stars = groups.into_par_iter().flat_map_iter(|group| &group.stars);
        let stars = stars.map(|star| *star as usize);
        let stars = stars.filter(|star| self.directions[*star].dot(axis) >= nearest);
        let sight = Sight::of(observer, corrections);
        let seen = stars.map(|index| SeenStar {
            index,
            direction: sight.of_star(
                &place(&self.catalog.stars()[index]),
                &self.directions[index],
            ),
            band_mag: self.band_mags[index],
            wavelength_ratio: self.wavelength_ratios[index],
        });
        let mut seen: Vec<SeenStar> = seen.collect();
        seen.par_sort_unstable_by_key(|star| star.index);
        seen
    }
}

fn place(star: &Star) -> StarPlace {
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
    fn groups_leave_nobody_out() {
        let catalog = Catalog::embedded(Selection::Hipparcos);
        let band = Band::named("v").unwrap();
        let field = StarField::new(catalog, &band, false);
        let grouped = field.groups.iter().flat_map(|group| &group.stars);
        assert_eq!(grouped.count(), field.directions.len());
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
                let (all, reach) = (0..field.directions.len(), angle + WANDER);
                let near =
                    all.filter(|i| reach >= PI || field.directions[*i].dot(&axis) >= reach.cos());
                assert_eq!(seen, near.collect::<Vec<_>>(), "{axis:?} {angle}");
            }
        }
    }
}
