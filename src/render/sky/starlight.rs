//! Combined light of all stars too faint for the catalogue.
//!
//! `data/starlight.csv` holds their mean surface brightness in S10 (stars of V = 10 a square
//! degree) every 30 degrees of galactic longitude and 5 to 15 of latitude, for each selection of
//! the catalogue; its logarithm is interpolated smoothly (C1). The table excludes the stars of the
//! catalogue, so no light counts twice. `tests/reference/starlight.py` computes the table:
//!
//! - to V = 11 from the stars themselves (Hipparcos and Tycho, complete there);
//! - beyond by the ratio to the light of V 10 to 11 in the star counts of Bahcall & Soneira 1980
//!   (ApJS 44, 73, Eq. B1), from 20 degrees of latitude on. Nearer to the plane the ratio is that
//!   at 20 degrees, times one factor that gives the whole sky the light of all counts to V = 25.
//!
//! Validity: some 20 %, and no structure finer than the table's; the part beyond V = 11 (60 % of
//! the light) is a model. With the catalogue the mean is 106 S10 over the sky, and 36 and 43 at the
//! poles, where the model SKY (Wainscoat et al. 1992) has 38 (Leinert et al. 1998, A&AS 127, 1,
//! Table 24). Starlight scattered by dust (diffuse galactic light, a further 10 to 30 %) and
//! galaxies (1 S10) are omitted.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};

use super::bicubic::Bicubic;
use super::catalog::Selection;

const TABLE: &str = include_str!("data/starlight.csv");
const ROWS: usize = 19;
const COLUMNS: usize = 12;
/// Longitude from one column to the next, rad.
const STEP: f64 = TAU / COLUMNS as f64;

/// ICRF to galactic axes (ESA 1997, The Hipparcos and Tycho Catalogues, vol. 1, Eq. 1.5.11).
const GALACTIC: Matrix3<f64> = Matrix3::new(
    -0.054_875_560_4,
    -0.873_437_090_2,
    -0.483_835_015_5,
    0.494_109_427_9,
    -0.444_829_630_0,
    0.746_982_244_5,
    -0.867_666_149_0,
    -0.198_076_373_4,
    0.455_983_776_2,
);

/// The light of the stars below the limit of one selection of the catalogue.
#[derive(Debug, Clone)]
pub struct StarLight {
    /// log2(S10) by galactic longitude and latitude, rad.
    log: Bicubic,
}

impl StarLight {
    /// For a sky with the stars of `selection`.
    pub fn new(selection: Selection) -> Self {
        let skipped = match selection {
            Selection::Hipparcos => 0,
            Selection::Bsc => ROWS,
        };
        let rows: Vec<Vec<f64>> = rows().skip(skipped).take(ROWS).collect();
        let latitudes = rows.iter().map(|row| row[0].to_radians()).collect();
        // Three more columns for periodic interpolation: -30, 360 and 390 degrees.
        let longitudes = (0..COLUMNS + 3).map(|i| (i as f64 - 1.0) * STEP).collect();
        let value = |i: usize, j: usize| libm::log2(rows[j][1 + (i + COLUMNS - 1) % COLUMNS]);
        StarLight {
            log: Bicubic::new(longitudes, latitudes, value, |_| [0.0, 0.0]),
        }
    }

    /// Surface brightness in `direction` (unit vector, ICRF), S10; NaN for an invalid direction.
    /// Takes some 50 ns.
    pub fn s10(&self, direction: &Vector3<f64>) -> f64 {
        let g = GALACTIC * direction;
        let longitude = libm::atan2(g.y, g.x);
        let longitude = if longitude < 0.0 {
            longitude + TAU
        } else {
            longitude
        };
        let latitude = libm::atan(g.z / (g.x * g.x + g.y * g.y).sqrt());
        libm::exp2(self.log.at(longitude, latitude))
    }
}

/// Latitude (deg) and S10 by longitude, for each row of the table.
fn rows() -> impl Iterator<Item = Vec<f64>> {
    TABLE
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            line.split(',')
                .filter_map(|cell| cell.parse().ok())
                .collect()
        })
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use std::f64::consts::PI;

    use crate::sky::apparent::{StarPlace, catalogue_direction};
    use crate::sky::catalog::Catalog;

    /// The direction at galactic longitude and latitude (deg).
    fn at(longitude_deg: f64, latitude_deg: f64) -> Vector3<f64> {
        let (l, b) = (longitude_deg.to_radians(), latitude_deg.to_radians());
        GALACTIC.transpose() * Vector3::new(b.cos() * l.cos(), b.cos() * l.sin(), b.sin())
    }

    /// Asserts that neither value nor slope of `log` jumps along great circles, each from a start
    /// towards a side: a difference from curvature shrinks with the step, a jump does not. `checks`
    /// selects the directions to check.
    pub(crate) fn assert_smooth(
        circles: &[(Vector3<f64>, Vector3<f64>)],
        checks: impl Fn(&Vector3<f64>) -> bool,
        log: impl Fn(&Vector3<f64>) -> f64,
    ) {
        let jump = |step: f64| {
            let mut worst = 0.0_f64;
            for (start, side) in circles {
                let side = (side - start * side.dot(start)).normalize();
                let go = |t: f64| start * t.cos() + side * t.sin();
                let places = (0..3600).map(|n| f64::from(n) * PI / 1800.0);
                for t in places.filter(|t| checks(&go(*t))) {
                    let [a, b, c] = [t - step, t, t + step].map(|t| log(&go(t)));
                    worst = worst.max(((c - b) - (b - a)).abs() / step);
                }
            }
            worst
        };
        let (coarse, fine) = (jump(1e-5), jump(1e-6));
        assert!(coarse < 3e-3 && fine < 3e-4, "{coarse} {fine}");
    }

    /// Mean over the sky between two galactic latitudes (deg).
    fn mean(light: &StarLight, low: f64, high: f64) -> f64 {
        let (mut sum, mut all) = (0.0, 0.0);
        for i in 0..200 {
            let latitude = low + (high - low) * (f64::from(i) + 0.5) / 200.0;
            for k in 0..120 {
                let weight = latitude.to_radians().cos();
                sum += light.s10(&at(f64::from(k) * 3.0, latitude)) * weight;
                all += weight;
            }
        }
        sum / all
    }

    /// S10 of the catalogue's stars between two galactic latitudes (deg).
    fn catalogued(selection: Selection, low: f64, high: f64) -> f64 {
        let (low, high) = (low.to_radians().sin(), high.to_radians().sin());
        let catalog = Catalog::embedded(selection);
        let light = catalog.stars().iter().filter_map(|star| {
            let position = StarPlace {
                ra_rad: star.ra_rad,
                dec_rad: star.dec_rad,
                parallax_rad: 0.0,
                pm_ra_cosdec_rad_yr: 0.0,
                pm_dec_rad_yr: 0.0,
            };
            let z = (GALACTIC * catalogue_direction(&position)).z;
            (low..=high)
                .contains(&z)
                .then(|| 10f64.powf(-0.4 * (star.v_mag - 10.0)))
        });
        let square_degrees = TAU * (high - low) * (180.0 / PI).powi(2);
        light.sum::<f64>() / square_degrees
    }

    #[test]
    fn table_is_complete() {
        let rows: Vec<Vec<f64>> = rows().collect();
        assert_eq!(rows.len(), 2 * ROWS);
        for row in &rows {
            assert_eq!(row.len(), 1 + COLUMNS);
            assert!(row[1..].iter().all(|s10| (5.0..500.0).contains(s10)));
        }
        for half in rows.chunks(ROWS) {
            assert!(half.is_sorted_by(|a, b| a[0] < b[0]));
            assert_eq!((half[0][0], half[ROWS - 1][0]), (-90.0, 90.0));
        }
        // Interpolation is exact at its nodes.
        let light = StarLight::new(Selection::Bsc);
        let value = light.s10(&at(60.0, -20.0));
        assert!((value / rows[ROWS + 5][3] - 1.0).abs() < 1e-6, "{value}");
    }

    #[test]
    fn galactic_axes_match_the_published_ones() {
        // X-Val: galactic pole at RA 192.85948, Dec 27.12825 deg; centre at 266.40500, -28.93617
        // (ESA 1997, vol. 1, section 1.5.3).
        for (ra, dec, v) in [
            (192.859_48_f64, 27.128_25_f64, at(0.0, 90.0)),
            (266.405_00, -28.936_17, at(0.0, 0.0)),
        ] {
            let (ra, dec) = (ra.to_radians(), dec.to_radians());
            let direction = Vector3::new(dec.cos() * ra.cos(), dec.cos() * ra.sin(), dec.sin());
            assert!((direction - v).norm() < 1e-6, "{v}");
        }
    }

    /// For any selection, catalogue and fainter light together are all the starlight.
    #[test]
    fn total_starlight_is_as_published_for_each_selection() {
        let totals = [Selection::Hipparcos, Selection::Bsc].map(|selection| {
            let light = StarLight::new(selection);
            mean(&light, -90.0, 90.0) + catalogued(selection, -90.0, 90.0)
        });
        // X-Val: 102 S10: 89 of V 4 to 25 by the counts N(V) in starlight.py, 13 of brighter stars,
        // by the catalogue itself.
        for total in totals {
            assert!((total / 102.0 - 1.0).abs() < 0.1, "{totals:?}");
        }
        assert!((totals[0] / totals[1] - 1.0).abs() < 0.02, "{totals:?}");
        // The same from the plane to the poles.
        for (low, high) in [
            (-75.0, -45.0),
            (-45.0, -10.0),
            (-10.0, 10.0),
            (10.0, 45.0),
            (45.0, 75.0),
        ] {
            let [a, b] = [Selection::Hipparcos, Selection::Bsc].map(|selection| {
                mean(&StarLight::new(selection), low, high) + catalogued(selection, low, high)
            });
            assert!((a / b - 1.0).abs() < 0.05, "{low} {high}: {a} {b}");
        }
    }

    #[test]
    fn pole_and_plane_are_as_bright_as_published() {
        let light = StarLight::new(Selection::Hipparcos);
        // X-Val: SKY's prediction at the north pole, 250e-9 W/m^2/sr at 0.55 um, 23.83 mag per
        // square arc second or 38 S10 with the bright stars (Leinert et al. 1998, Table 24;
        // Wainscoat et al. 1992).
        let pole = (mean(&light, 75.0, 90.0) + mean(&light, -90.0, -75.0)) / 2.0
            + (catalogued(Selection::Hipparcos, 75.0, 90.0)
                + catalogued(Selection::Hipparcos, -90.0, -75.0))
                / 2.0;
        assert!((pole / 38.0 - 1.0).abs() < 0.25, "{pole}");
        // The Milky Way is brightest in Sagittarius and faint opposite to the centre; dust hides
        // stars to the north of the centre.
        assert!(light.s10(&at(0.0, -5.0)) > 2.0 * light.s10(&at(180.0, -5.0)));
        assert!(light.s10(&at(0.0, -10.0)) > 1.5 * light.s10(&at(0.0, 10.0)));
        let plane = mean(&light, -5.0, 5.0);
        assert!((100.0..300.0).contains(&plane), "{plane}");
    }

    #[test]
    fn starlight_is_smooth_over_the_sky() {
        let light = StarLight::new(Selection::Hipparcos);
        let circles = (0..40).map(f64::from).flat_map(|k| {
            [
                (at(k * 9.0, 0.0), at(0.0, 90.0)),
                (at(10.0 * k, 3.0 + 2.0 * k), at(0.0, 1.0 + 2.0 * k)),
            ]
        });
        let circles: Vec<_> = circles.collect();
        assert_smooth(&circles, |_| true, |v| light.s10(v).ln());
    }
}
