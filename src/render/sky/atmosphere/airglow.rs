//! Airglow: light emitted by layers of the upper atmosphere.
//!
//! The emission of each layer by altitude is a Chapman layer (as in Chamberlain 1961, Physics of
//! the Aurora and Airglow),
//!
//! ```text
//! e(h) = I / (e H) exp(1 - y - exp(-y)),   y = (h - h0) / H
//! ```
//!
//! `I` its column brightness in the zenith, `h0` its peak, `H` its scale height; the width at half
//! maximum is 2.45 H. Brightness is in Rayleigh: 1 R is 1e10 / (4 pi) ph/s/m^2/sr.
//!
//! The values are means of quiet nights at a low latitude and medium solar activity (Paranal, 130
//! solar flux units); single nights often have half or double. Variation by day, twilight and
//! latitude, and aurora are omitted: the day's airglow is brighter (the lines of oxygen ten- to
//! hundredfold), but the daylit sky behind it is much brighter.

use crate::camera::Band;
use std::f64::consts::{E, PI};

/// One Rayleigh, ph/s/m^2/sr.
pub(crate) const RAYLEIGH: f64 = 1e10 / (4.0 * PI);

/// Altitude and thickness of a layer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layer {
    /// Altitude of the peak, m.
    pub peak_m: f64,
    /// Scale height, m.
    pub scale_m: f64,
}

/// Hydroxyl, and the continuum, for which Noll et al. 2012 assume the same height: 87 km, 8 to 9 km
/// wide (Dunker 2018, Ann. Geophys. 36: the commonly assumed 87 km and 8 km; 8.4 km).
const HYDROXYL: Layer = Layer {
    peak_m: 87e3,
    scale_m: 3.4e3,
};
/// Molecular oxygen: 94 +- 1 km (Watanabe et al. 1981, J. Geophys. Res. 86, 5768, from rockets);
/// its width is assumed to be hydroxyl's.
const OXYGEN_MOLECULES: Layer = Layer {
    peak_m: 94e3,
    scale_m: 3.8e3,
};
/// Sodium: near 92 km (Mende et al. 1993, J. Geophys. Res. 98, 19117, from a shuttle at the limb).
const SODIUM: Layer = Layer {
    peak_m: 92e3,
    scale_m: 3.6e3,
};
/// The green line of atomic oxygen: 97 km ("Intensity profiles of the 6300-A and 5577-A O I lines
/// in the night airglow", J. Geophys. Res. 1968, from rockets); its width is assumed to be
/// hydroxyl's. A tenth of it, in the F layer, is omitted.
const GREEN: Layer = Layer {
    peak_m: 97e3,
    scale_m: 3.8e3,
};
/// The red lines: 245 km, in the F layer, by the same rockets; some 100 km wide.
const RED: Layer = Layer {
    peak_m: 245e3,
    scale_m: 40e3,
};

/// A line or a band: wavelength in air (nm), zenith brightness outside the atmosphere (R), layer.
///
/// Atoms: PALACE v1.0 (Noll et al. 2025, Geosci. Model Dev. 18, 4353), reference intensities.
/// Molecular oxygen: its (0-1) band by the same model, 344 R; the (0-0) band, which never reaches
/// ground, is 18.65 times as bright by the Einstein coefficients of HITRAN 2020.
const LINES: [(f64, f64, Layer); 10] = [
    (557.7, 163.0, GREEN),
    (589.0, 23.5, SODIUM),
    (589.6, 13.4, SODIUM),
    (630.0, 123.0, RED),
    (636.4, 41.0, RED),
    (656.3, 5.3, RED),
    (762.0, 6420.0, OXYGEN_MOLECULES),
    (777.4, 16.0, RED),
    (844.7, 6.7, RED),
    (864.5, 344.0, OXYGEN_MOLECULES),
];

/// Lines of hydroxyl, R in each 10 nm from 600 nm on, in the zenith outside the lower atmosphere:
/// the lines of ESO's sky model (Noll et al. 2012, A&A 543, A92, after Hanuschik 2003, Cosby et al.
/// 2006, Rousselot et al. 2000) in PyPI moons1d 1.0.3, divided by its transmission; without the
/// lines above. tests/reference/airglow.py computes them.
const HYDROXYL_FROM_NM: f64 = 600.0;
const HYDROXYL_R: [f64; 52] = [
    4.0, 10.0, 46.0, 19.0, 17.0, 50.0, 8.0, 3.0, 73.0, 71.0, 22.0, 14.0, 179.0, 197.0, 98.0, 101.0,
    110.0, 320.0, 329.0, 377.0, 143.0, 32.0, 154.0, 390.0, 482.0, 142.0, 10.0, 463.0, 740.0, 657.0,
    216.0, 65.0, 27.0, 909.0, 708.0, 479.0, 245.0, 1089.0, 903.0, 1377.0, 1163.0, 1462.0, 2713.0,
    1617.0, 1696.0, 562.0, 130.0, 2031.0, 2885.0, 2725.0, 1734.0, 262.0,
];

/// The continuum: wavelength (nm) and brightness relative to 543 nm (Noll et al. 2012, very
/// uncertain below 400 and above 900 nm).
const CONTINUUM: [(f64, f64); 21] = [
    (300.0, 0.92),
    (369.0, 0.92),
    (387.0, 0.65),
    (420.0, 0.69),
    (450.0, 0.70),
    (480.0, 0.79),
    (510.0, 0.79),
    (543.0, 1.00),
    (575.0, 1.41),
    (608.0, 1.40),
    (642.0, 1.18),
    (675.0, 1.14),
    (720.0, 1.32),
    (767.0, 1.64),
    (820.0, 2.57),
    (858.0, 3.56),
    (872.0, 3.76),
    (1032.0, 5.32),
    (1082.0, 6.47),
    (1124.0, 3.80),
    (1208.0, 2.57),
];
/// The continuum at 543 nm, R/nm: 79.8 ph/s/m^2/um/arcsec^2 at 130 solar flux units, with 0.018704
/// ph/s/m^2/arcsec^2 per Rayleigh.
const CONTINUUM_R_NM: f64 = 79.8 / 0.018_704 * 1e-3;

/// The airglow in a band.
#[derive(Debug, Clone, PartialEq)]
pub struct Airglow {
    /// Each layer with light in the band, and its zenith brightness there, ph/s/m^2/sr.
    layers: Vec<(Layer, f64)>,
}

impl Airglow {
    /// In `band`, with each line weighted by the band's response.
    pub(crate) fn of(band: &Band) -> Airglow {
        let lines = LINES.iter().map(|&(nm, rayleigh, layer)| {
            let response = band.response(nm * 1e-9);
            (layer, rayleigh * response)
        });
        let hydroxyl = HYDROXYL_R.iter().enumerate().map(|(i, rayleigh)| {
            let from_nm = HYDROXYL_FROM_NM + 10.0 * i as f64;
            let parts = (0..10).map(|k| band.response((from_nm + k as f64 + 0.5) * 1e-9));
            rayleigh / 10.0 * parts.sum::<f64>()
        });
        let continuum = (3000..12_000).map(|k| {
            let nm = (f64::from(k) + 0.5) / 10.0;
            CONTINUUM_R_NM * continuum(nm) * band.response(nm * 1e-9) / 10.0
        });
        let broad: f64 = hydroxyl.sum::<f64>() + continuum.sum::<f64>();
        let mut layers: Vec<(Layer, f64)> = Vec::new();
        for (layer, rayleigh) in lines.chain([(HYDROXYL, broad)]) {
            let brightness = rayleigh * RAYLEIGH;
            match layers.iter_mut().find(|(at, _)| *at == layer) {
                Some((_, sum)) => *sum += brightness,
                None if brightness > 0.0 => layers.push((layer, brightness)),
                None => {}
            }
        }
        Airglow { layers }
    }

    /// Brightness in the zenith from below all layers, ph/s/m^2/sr.
    pub fn zenith(&self) -> f64 {
        self.layers.iter().map(|(_, brightness)| brightness).sum()
    }

    /// Emission per metre of a line of sight at an altitude (m), ph/s/m^2/sr/m.
    pub fn emission(&self, altitude_m: f64) -> f64 {
        let one = |(layer, brightness): &(Layer, f64)| {
            let y = (altitude_m - layer.peak_m) / layer.scale_m;
            // Far below the peak exp(-y) overflows, and the emission is 0.
            if y < -6.0 {
                return 0.0;
            }
            brightness / (E * layer.scale_m) * libm::exp(1.0 - y - libm::exp(-y))
        };
        self.layers.iter().map(one).sum()
    }
}

/// The continuum relative to 543 nm, linear between its points.
fn continuum(nm: f64) -> f64 {
    let next = CONTINUUM.partition_point(|(at, _)| *at < nm);
    match (
        next.checked_sub(1).and_then(|i| CONTINUUM.get(i)),
        CONTINUUM.get(next),
    ) {
        (Some((x0, y0)), Some((x1, y1))) => y0 + (y1 - y0) * (nm - x0) / (x1 - x0),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zenith_r(from_nm: f64, to_nm: f64) -> f64 {
        Airglow::of(&Band::top_hat(from_nm * 1e-9, to_nm * 1e-9)).zenith() / RAYLEIGH
    }

    #[test]
    fn narrow_bands_contain_their_lines() {
        // X-Val: the red line of 123 R and 2 nm of hydroxyl and continuum, 1.25 * 4.27 R/nm.
        let red = zenith_r(629.0, 631.0);
        assert!((red - 123.0 - 4.0 - 11.0).abs() < 3.0, "{red}");
        let green = zenith_r(556.5, 558.5);
        assert!((green - 163.0 - 10.0).abs() < 3.0, "{green}");
        // X-Val: the A band from Einstein coefficients, 344 R * 18.65 = 6.4 kR; hydroxyl and
        // continuum add 0.2 kR.
        let a_band = zenith_r(759.0, 771.0);
        assert!((6300.0..6800.0).contains(&a_band), "{a_band}");
        // Between the lines there is the continuum.
        assert!(zenith_r(535.0, 545.0) < 50.0);
    }

    #[test]
    fn hydroxyl_dominates_the_near_infrared() {
        // X-Val: the lines of ESO's sky model over its transmission, 650 to 1100 nm: 28.5 kR
        // (tests/reference/airglow.py), without the A band and the continuum (6 to 7 kR).
        let all = zenith_r(650.0, 1100.0);
        assert!(
            (all / (28_500.0 + 6420.0 + 6700.0) - 1.0).abs() < 0.05,
            "{all}"
        );
    }

    #[test]
    fn layers_have_their_brightness_and_peak_altitude() {
        let airglow = Airglow::of(&Band::top_hat(650e-9, 1100e-9));
        let step = 100.0;
        let column: f64 = (0..8_000)
            .map(|k| airglow.emission((k as f64 + 0.5) * step) * step)
            .sum();
        assert!((column / airglow.zenith() - 1.0).abs() < 1e-4);
        let peak = (0..8_000)
            .map(|k| k as f64 * step)
            .max_by(|a, b| airglow.emission(*a).total_cmp(&airglow.emission(*b)));
        assert!((86e3..90e3).contains(&peak.unwrap()), "{peak:?}");
        let red = Airglow::of(&Band::top_hat(629e-9, 631e-9));
        assert!(red.emission(245e3) > 10.0 * red.emission(150e3));
        assert_eq!(red.emission(0.0), 0.0);
    }
}
