//! The catalogue as one camera sees it: directions for the field test, magnitudes in the camera's band.

use super::apparent::{Corrections, Observer, StarPlace, catalogue_direction, star_direction};
use super::catalog::{Catalog, Star};
use crate::camera::Band;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::HashMap;

/// How far (rad) a star may stand from its catalogue direction: Barnard's star moves 0.32 degrees in the 110
/// years to 2100; aberration adds up to 26 arcsec, deflection at most 6 (close behind the Sun), parallax at most 0.8.
const WANDER: f64 = 0.35 * std::f64::consts::PI / 180.0;

/// Stars with what does not change from frame to frame.
#[derive(Debug)]
pub struct StarField {
    catalog: Catalog,
    /// Unit vectors at the catalogue's epoch, ICRS.
    directions: Vec<Vector3<f64>>,
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

/// Stars that one thread looks at at least.
const TASK: usize = 4096;

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
        StarField {
            wavelength_ratios: catalog.stars().iter().map(wavelength_ratio).collect(),
            directions: catalog
                .stars()
                .iter()
                .map(|s| catalogue_direction(&place(s)))
                .collect(),
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
        let nearest = (angle + WANDER).min(std::f64::consts::PI).cos();
        self.directions
            .par_iter()
            .enumerate()
            .with_min_len(TASK)
            .filter(|(_, direction)| direction.dot(axis) >= nearest)
            .map(|(index, _)| SeenStar {
                index,
                direction: star_direction(
                    &place(&self.catalog.stars()[index]),
                    observer,
                    corrections,
                ),
                band_mag: self.band_mags[index],
                wavelength_ratio: self.wavelength_ratios[index],
            })
            .collect()
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
