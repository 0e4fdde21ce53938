//! Zodiacal light: sunlight scattered by interplanetary dust.
//!
//! Reference: Levasseur-Regourd & Dumont 1980 (A&A 84, 277) at 500 nm, as completed in Table 16 of
//! Leinert et al. 1998 (A&AS 127, 1), in S10: one star of V = 10 with the Sun's spectrum per square
//! degree; 60 at the ecliptic's poles. By longitude from the Sun and latitude, ecliptic of J2000.0.
//! Values as in PyPI `dorado-sensitivity` 0.4.0; PyPI `EXOSIMS` 3.6.6 has the paper's Table 17, the
//! same in SI.
//!
//! Validity: the table is accurate to some 10 % at 1 au; [`distance_factor`] corrects for other
//! distances. The annual change, up to 10 % at high latitudes (the dust is inclined to the ecliptic
//! by 1.5 degrees), and the colour (2 % redder than the Sun in V) are omitted.
//!
//! Between the nodes, with `l` the longitude from the Sun, `b` the latitude, symmetric in both,
//!
//! ```text
//! S10 = 2^r(l, b) / (e^2)^(p/2),   e^2 = 2 (1 - cos b cos l) + q sin^2 b
//! ```
//!
//! where `e` is the elongation, stretched toward the poles, `p` = 2.25, `q` = 2.2, and `r` the
//! bicubic Hermite polynomial through the table: exact at the nodes and smooth over the whole sky
//! (C1). Nearer to the Sun than the table (15 degrees), `r` is constant, so the power law
//! continues. The table's own exponents there are 2.0 in the ecliptic and 2.3 across it.

use std::sync::LazyLock;

use nalgebra::Vector3;

use super::bicubic::Bicubic;
use super::bodies::AU_M;
use super::ecliptic;

/// Magnitude per square arc second of 1 S10: `10 + 2.5 log10(3600^2)`.
pub(crate) const S10_MAG: f64 = 27.781_512_503_836_436;

const LONGITUDES_DEG: [f64; 19] = [
    0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 60.0, 75.0, 90.0, 105.0, 120.0,
    135.0, 150.0, 165.0, 180.0,
];
const LATITUDES_DEG: [f64; 11] = [
    0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 45.0, 60.0, 75.0, 90.0,
];
/// S10 by longitude (rows) and latitude; 0: too close to the Sun.
const TABLE: [[f64; 11]; 19] = [
    [
        0.0, 0.0, 0.0, 2450.0, 1260.0, 770.0, 500.0, 215.0, 117.0, 78.0, 60.0,
    ],
    [
        0.0, 0.0, 0.0, 2300.0, 1200.0, 740.0, 490.0, 212.0, 117.0, 78.0, 60.0,
    ],
    [
        0.0, 0.0, 3700.0, 1930.0, 1070.0, 675.0, 460.0, 206.0, 116.0, 78.0, 60.0,
    ],
    [
        9000.0, 5300.0, 2690.0, 1450.0, 870.0, 590.0, 410.0, 196.0, 114.0, 78.0, 60.0,
    ],
    [
        5000.0, 3500.0, 1880.0, 1100.0, 710.0, 495.0, 355.0, 185.0, 110.0, 77.0, 60.0,
    ],
    [
        3000.0, 2210.0, 1350.0, 860.0, 585.0, 425.0, 320.0, 174.0, 106.0, 76.0, 60.0,
    ],
    [
        1940.0, 1460.0, 955.0, 660.0, 480.0, 365.0, 285.0, 162.0, 102.0, 74.0, 60.0,
    ],
    [
        1290.0, 990.0, 710.0, 530.0, 400.0, 310.0, 250.0, 151.0, 98.0, 73.0, 60.0,
    ],
    [
        925.0, 735.0, 545.0, 415.0, 325.0, 264.0, 220.0, 140.0, 94.0, 72.0, 60.0,
    ],
    [
        710.0, 570.0, 435.0, 345.0, 278.0, 228.0, 195.0, 130.0, 91.0, 70.0, 60.0,
    ],
    [
        395.0, 345.0, 275.0, 228.0, 190.0, 163.0, 143.0, 105.0, 81.0, 67.0, 60.0,
    ],
    [
        264.0, 248.0, 210.0, 177.0, 153.0, 134.0, 118.0, 91.0, 73.0, 64.0, 60.0,
    ],
    [
        202.0, 196.0, 176.0, 151.0, 130.0, 115.0, 103.0, 81.0, 67.0, 62.0, 60.0,
    ],
    [
        166.0, 164.0, 154.0, 133.0, 117.0, 104.0, 93.0, 75.0, 64.0, 60.0, 60.0,
    ],
    [
        147.0, 145.0, 138.0, 120.0, 108.0, 98.0, 88.0, 70.0, 60.0, 58.0, 60.0,
    ],
    [
        140.0, 139.0, 130.0, 115.0, 105.0, 95.0, 86.0, 70.0, 60.0, 57.0, 60.0,
    ],
    [
        140.0, 139.0, 129.0, 116.0, 107.0, 99.0, 91.0, 75.0, 62.0, 56.0, 60.0,
    ],
    [
        153.0, 150.0, 140.0, 129.0, 118.0, 110.0, 102.0, 81.0, 64.0, 56.0, 60.0,
    ],
    [
        180.0, 166.0, 152.0, 139.0, 127.0, 116.0, 105.0, 82.0, 65.0, 56.0, 60.0,
    ],
];
/// `p / 2` of the module documentation.
const HALF_POWER: f64 = 1.125;
/// `q` of the module documentation.
const STRETCH: f64 = 2.2;
/// Minimum of `e^2`: within the Sun's disc (16 arcmin) the light is constant.
const MIN_SQUARE: f64 = 2.2e-5;

/// The table's innermost node in the ecliptic, whose `r` is used nearer to the Sun.
const NEXT_TO_THE_SUN: (usize, usize) = (3, 0);

static RESIDUAL: LazyLock<Bicubic> = LazyLock::new(residual);

/// Zodiacal light with the Sun in one direction, at 1 au.
#[derive(Debug, Clone, Copy)]
pub struct ZodiacalLight {
    /// Cosine and sine of the Sun's ecliptic longitude.
    sun: [f64; 2],
    residual: &'static Bicubic,
}

impl ZodiacalLight {
    /// With the Sun in direction `sun` (any length, ICRF); at the ecliptic's pole, and for an
    /// invalid direction, at longitude 0.
    pub fn new(sun: &Vector3<f64>) -> ZodiacalLight {
        let sun = ecliptic::from_icrf(sun);
        let length = (sun.x * sun.x + sun.y * sun.y).sqrt();
        let sun = [sun.x / length, sun.y / length];
        let is_somewhere = length > 0.0 && sun.iter().all(|part| part.is_finite());
        ZodiacalLight {
            sun: if is_somewhere { sun } else { [1.0, 0.0] },
            residual: &RESIDUAL,
        }
    }

    /// Surface brightness in `direction` (unit vector, ICRF), S10; NaN for an invalid direction.
    /// Takes some 50 ns.
    pub fn s10(&self, direction: &Vector3<f64>) -> f64 {
        let v = ecliptic::from_icrf(direction);
        let [cos, sin] = self.sun;
        let (toward_sun, across) = (cos * v.x + sin * v.y, cos * v.y - sin * v.x);
        let longitude = libm::atan2(across.abs(), toward_sun);
        let latitude = libm::atan(v.z.abs() / (v.x * v.x + v.y * v.y).sqrt());
        // e^p from e^2: p / 2 is 1 + 1/8.
        let square = elongation_square(toward_sun, v.z);
        let power = square * square.sqrt().sqrt().sqrt();
        libm::exp2(self.residual.at(longitude, latitude)) / power
    }
}

/// Factor of the light for an observer at `sun_distance_m` (m) from the Sun: the power -2.3 that
/// Helios measured from 0.3 to 1 au (Leinert et al. 1981, A&A 103, 177). NaN for a negative
/// distance.
pub fn distance_factor(sun_distance_m: f64) -> f64 {
    libm::pow(sun_distance_m / AU_M, -2.3)
}

/// `e^2` from the components toward the Sun's longitude and toward the pole.
fn elongation_square(toward_sun: f64, up: f64) -> f64 {
    (2.0 * (1.0 - toward_sun) + STRETCH * up * up).max(MIN_SQUARE)
}

/// `r` by longitude from the Sun and latitude (rad).
fn residual() -> Bicubic {
    let longitudes = LONGITUDES_DEG.map(f64::to_radians);
    let latitudes = LATITUDES_DEG.map(f64::to_radians);
    let value = |i: usize, j: usize| {
        let (i, j) = if TABLE[i][j] > 0.0 {
            (i, j)
        } else {
            NEXT_TO_THE_SUN
        };
        let (sin, cos) = libm::sincos(latitudes[j]);
        let square = elongation_square(cos * libm::cos(longitudes[i]), sin);
        libm::log2(TABLE[i][j]) + HALF_POWER * libm::log2(square)
    };
    // Over the pole the light continues at the opposite longitude. It is smooth there if its slope
    // varies as the cosine of longitude.
    let tilt = (value(18, 9) - value(0, 9)) / (2.0 * (latitudes[10] - latitudes[9]));
    Bicubic::new(
        longitudes.to_vec(),
        latitudes.to_vec(),
        value,
        |longitude| [tilt * libm::cos(longitude), -tilt * libm::sin(longitude)],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sky::starlight::tests::assert_smooth;

    /// The direction at ecliptic longitude and latitude (deg).
    fn at(longitude_deg: f64, latitude_deg: f64) -> Vector3<f64> {
        let (l, b) = (longitude_deg.to_radians(), latitude_deg.to_radians());
        ecliptic::to_icrf(&Vector3::new(b.cos() * l.cos(), b.cos() * l.sin(), b.sin()))
    }

    fn s10(direction: &Vector3<f64>, sun: &Vector3<f64>) -> f64 {
        ZodiacalLight::new(sun).s10(direction)
    }

    #[test]
    fn nodes_are_exact_in_all_four_quadrants() {
        let sun_deg = 217.3;
        let sun = at(sun_deg, 0.0);
        for (i, row) in TABLE.iter().enumerate() {
            for (j, &value) in row.iter().enumerate().filter(|(_, value)| **value > 0.0) {
                for (side, up) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
                    let v = at(sun_deg + side * LONGITUDES_DEG[i], up * LATITUDES_DEG[j]);
                    assert!((s10(&v, &sun) / value - 1.0).abs() < 1e-9, "{i} {j}");
                }
            }
        }
    }

    #[test]
    fn brightness_is_as_published() {
        assert!((S10_MAG - 10.0 - 2.5 * (3600.0_f64 * 3600.0).log10()).abs() < 1e-12);
        let sun = at(0.0, 0.0);
        let magnitude = |l: f64, b: f64| S10_MAG - 2.5 * s10(&at(l, b), &sun).log10();
        // X-Val: 23.3 mag per square arc second at the pole, 22.1 opposite the Sun (STIS Instrument
        // Handbook, chapter 6: "low" and "high").
        assert!((magnitude(0.0, 90.0) - 23.3).abs() < 0.05);
        assert!((magnitude(180.0, 0.0) - 22.1).abs() < 0.1);
        // X-Val: Table 17 of Leinert et al. 1998 in 1e-8 W/m^2/sr/um at 500 nm, where 1 S10 is 1.28
        // (their Table 2): both are rounded.
        for (l, b, value) in [
            (90.0, 0.0, 259.0),
            (15.0, 0.0, 11500.0),
            (0.0, 15.0, 3140.0),
            (45.0, 30.0, 250.0),
            (135.0, 60.0, 77.0),
            (165.0, 5.0, 192.0),
            (75.0, 75.0, 82.0),
            (0.0, 90.0, 77.0),
        ] {
            let ours = 1.28 * s10(&at(l, b), &sun);
            assert!(
                (ours / value - 1.0).abs() < 0.012,
                "{l} {b}: {ours} {value}"
            );
        }
    }

    /// The polynomial does not overshoot between the nodes.
    #[test]
    fn values_between_nodes_stay_within_their_range() {
        let sun = at(0.0, 0.0);
        for i in 0..18 {
            for j in 0..10 {
                let corners = [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)];
                let corners = corners.map(|(i, j)| TABLE[i][j]);
                if corners.contains(&0.0) {
                    continue;
                }
                let middle = |nodes: &[f64], k: usize| (nodes[k] + nodes[k + 1]) / 2.0;
                let v = at(middle(&LONGITUDES_DEG, i), middle(&LATITUDES_DEG, j));
                let (low, high) = corners
                    .iter()
                    .fold((f64::MAX, 0.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
                let value = s10(&v, &sun);
                assert!(
                    (0.97 * low..1.03 * high).contains(&value),
                    "{i} {j}: {value}"
                );
            }
        }
    }

    /// In all directions, over the nodes, the pole and near the Sun.
    #[test]
    fn zodiacal_light_is_smooth_over_the_sky() {
        let sun = at(0.0, 0.0);
        // Circles through the pole, and tilted ones.
        let circles = (0..40).map(f64::from).flat_map(|k| {
            [
                (at(k * 4.5, 0.0), at(0.0, 90.0)),
                (at(90.0, 3.0 + 2.0 * k), at(0.0, 1.0 + 2.0 * k)),
            ]
        });
        let circles: Vec<_> = circles.collect();
        // Within 8 degrees of the Sun the power law itself is steep.
        assert_smooth(&circles, |v| v.dot(&sun) < 0.99, |v| s10(v, &sun).ln());
    }

    #[test]
    fn light_increases_toward_the_sun_and_stays_finite() {
        let sun = at(40.0, 0.0);
        for (side, up) in [(1.0, 0.0), (0.0, 1.0), (0.6, 0.8)] {
            let mut last = 0.0;
            for elongation_deg in [30.0, 20.0, 15.0, 12.0, 10.0, 7.0, 5.0, 3.0, 1.0, 0.5] {
                let v = at(40.0 + side * elongation_deg, up * elongation_deg);
                let value = s10(&v, &sun);
                assert!(value > last, "{elongation_deg}: {value}");
                last = value;
            }
        }
        assert!(s10(&sun, &sun).is_finite() && s10(&sun, &sun) >= s10(&at(40.3, 0.0), &sun));
        assert!((distance_factor(AU_M) - 1.0).abs() < 1e-12);
        assert!(distance_factor(0.9833 * AU_M) > 1.03);
    }
}
