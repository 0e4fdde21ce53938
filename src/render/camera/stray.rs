//! Light from outside of the image, scattered onto the detector by the optics and the baffle.
//!
//! The point-source transmittance (PST) is the irradiance on the detector over that on the
//! aperture, by the angle of the source from the boresight; it includes the optics' transmission.
//! Scattered light is a uniform veil on the detector:
//!
//! ```text
//! veil = E PST(angle) A_pixel QE     [e-/s]
//! ```
//!
//! The definition is from Breault 1995, Handbook of Optics, ch. 38. Between the points of its table
//! the logarithm of the PST follows monotone cubics (Fritsch & Carlson 1980, SIAM J. Numer. Anal.
//! 17, 238), smooth and without overshoot; beyond them it is constant.

/// Stray light of the optics, and the Sun's exclusion angle.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Stray {
    /// Angle (rad, rising), logarithm of the PST, and its slope there (1/rad).
    points: Vec<[f64; 3]>,
    /// Angle from the boresight (rad) within which the Sun saturates the frame.
    pub sun_exclusion: f64,
}

impl Stray {
    /// From angles (rad, rising) and the PST (above 0, at most 1) at each; an empty table means no
    /// stray light.
    pub fn new(table: &[[f64; 2]], sun_exclusion: f64) -> Stray {
        let mut points: Vec<[f64; 3]> = table
            .iter()
            .map(|[angle, pst]| [*angle, libm::log(pst.max(f64::MIN_POSITIVE)), 0.0])
            .collect();
        let chords: Vec<f64> = points
            .windows(2)
            .map(|pair| (pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0]))
            .collect();
        // Slope 0 at the ends, where constants follow, and where the chords change sign; else the
        // chords' harmonic mean, which is within the region of Fritsch & Carlson.
        for (point, pair) in points.iter_mut().skip(1).zip(chords.windows(2)) {
            if pair[0] * pair[1] > 0.0 {
                point[2] = 2.0 * pair[0] * pair[1] / (pair[0] + pair[1]);
            }
        }
        Stray {
            points,
            sun_exclusion,
        }
    }

    /// Whether the optics scatter any light.
    pub(crate) fn scatters(&self) -> bool {
        !self.points.is_empty()
    }

    /// The point-source transmittance for a source at `angle` (rad) from the boresight (1).
    pub fn pst(&self, angle: f64) -> f64 {
        let next = self.points.partition_point(|[at, ..]| *at < angle);
        let log = match (
            next.checked_sub(1).and_then(|i| self.points.get(i)),
            self.points.get(next),
        ) {
            (Some([x0, y0, s0]), Some([x1, y1, s1])) => {
                let h = x1 - x0;
                let t = (angle - x0) / h;
                let u = 1.0 - t;
                // Hermite's cubic.
                u * u * (1.0 + 2.0 * t) * y0
                    + t * t * (3.0 - 2.0 * t) * y1
                    + t * u * h * (u * s0 - t * s1)
            }
            (Some([_, y, _]), None) | (None, Some([_, y, _])) => *y,
            (None, None) => return 0.0,
        };
        libm::exp(log)
    }

    /// The veil (e-/s per pixel) of a source with `irradiance` (ph/s/m^2 in the band) on the
    /// aperture, `angle` (rad) from the boresight, on pixels of `pitch_m` with
    /// `quantum_efficiency`.
    pub(crate) fn veil_e_s(
        &self,
        irradiance: f64,
        angle: f64,
        pitch_m: f64,
        quantum_efficiency: f64,
    ) -> f64 {
        irradiance * self.pst(angle) * pitch_m * pitch_m * quantum_efficiency
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stray(points: &[[f64; 2]]) -> Stray {
        let rad: Vec<[f64; 2]> = points
            .iter()
            .map(|[deg, p]| [deg.to_radians(), *p])
            .collect();
        Stray::new(&rad, 0.5)
    }

    #[test]
    fn table_is_interpolated_monotonically() {
        let points = [[15.0, 1e-3], [30.0, 1e-6], [60.0, 1e-8], [90.0, 2e-8]];
        let table = stray(&points);
        let at = |deg: f64| table.pst(deg.to_radians());
        for [deg, pst] in points {
            assert!((at(deg) / pst - 1.0).abs() < 1e-12, "{deg}");
        }
        assert_eq!((at(0.0), at(180.0)), (at(15.0), at(90.0)));
        // Between two points it lies between their values, and rises or falls as they do.
        for k in 150..900 {
            let (a, b) = (at(f64::from(k) / 10.0), at(f64::from(k + 1) / 10.0));
            assert!(if k < 600 { b <= a } else { b >= a }, "{k}");
            // Smooth: no step of more than a fifth in a tenth of a degree.
            assert!((b / a).ln().abs() < 0.2, "{k}");
        }
        // X-Val: by hand: halfway on a constant slope the geometric mean.
        let even = stray(&[[0.0, 1e-2], [10.0, 1e-3], [20.0, 1e-4], [30.0, 1e-5]]);
        assert!((even.pst(15f64.to_radians()) / 10f64.powf(-3.5) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn veil_is_irradiance_times_area() {
        let table = stray(&[[20.0, 1e-6]]);
        // X-Val: by hand: 2e21 ph/s/m^2 * 1e-6 * (18e-6 m)^2 * 0.5 = 3.24e5 e-/s.
        assert!((table.veil_e_s(2e21, 1.0, 18e-6, 0.5) / 3.24e5 - 1.0).abs() < 1e-12);
        assert_eq!(Stray::default().veil_e_s(2e21, 1.0, 18e-6, 0.5), 0.0);
        assert!(table.scatters() && !Stray::default().scatters());
    }
}
