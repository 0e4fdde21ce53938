//! The band a camera sees, its photometric zero point and the colour of stars in it.

use skyloop_base::range::nearest;
use std::f64::consts::LN_10;

/// Apparent magnitude of the Sun in every band of this system (Clark et al. 2021, below Eq. (11)).
pub const SUN_MAGNITUDE: f64 = -26.73;
/// Planck constant times speed of light, J m (exact by SI 2019).
const H_C: f64 = 6.626_070_15e-34 * 299_792_458.0;
/// Second radiation constant `h c / k`, m K.
const C2: f64 = 1.438_776_877e-2;
/// The Sun's B-V (Ramirez et al. 2012): for a star of this colour, band magnitude minus V is that
/// of the Sun.
const SUN_B_V: f64 = 0.653;

/// Relative response to photons by wavelength, with a peak of 1. Quantum efficiency and
/// transmission are separate factors.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    name: String,
    /// Wavelength (m) and response at equal steps.
    samples: Vec<(f64, f64)>,
    step_m: f64,
    /// Photon rate of a black body of the Sun's colour in the band.
    sun_photons: f64,
    /// ph/s/m^2 of magnitude 0.
    zero_point: f64,
    /// Mean wavelength (m) of a star's photons at equal steps of B-V.
    mean_wavelengths: Vec<f64>,
}

/// Range of B-V with a black-body temperature (see [`temperature`]), and the number of steps in the
/// table of mean wavelengths.
const B_V: [f64; 2] = [-0.4, 2.0];
const B_V_STEPS: usize = 48;

/// Range of the tabulated solar spectrum, widened for rounding of nanometres, and the narrowest
/// band, m.
const SPECTRUM_M: [f64; 2] = [299.9e-9, 1200.1e-9];
const NARROWEST_M: f64 = 1e-12;

/// Johnson V, energy response as Bessell 1990 (PASP 102, 1181, Table 2), 470 to 700 nm each 10 nm.
const V: &[f64] = &[
    0.000, 0.030, 0.163, 0.458, 0.780, 0.967, 1.000, 0.973, 0.898, 0.792, 0.684, 0.574, 0.461,
    0.359, 0.270, 0.197, 0.135, 0.081, 0.045, 0.025, 0.017, 0.013, 0.009, 0.000,
];
/// A front-illuminated silicon sensor behind glass, 350 to 1050 nm each 50 nm: an assumed typical
/// shape.
const SILICON: &[f64] = &[
    0.00, 0.30, 0.60, 0.80, 0.93, 1.00, 0.98, 0.92, 0.83, 0.70, 0.55, 0.40, 0.25, 0.10, 0.00,
];

impl Band {
    /// Bands with a name.
    pub(crate) const NAMES: [&str; 2] = ["v", "silicon"];

    /// Full response between two wavelengths (m), limited to 300 to 1200 nm and at least a
    /// picometre wide.
    pub fn top_hat(from_m: f64, to_m: f64) -> Band {
        let [first_m, last_m] = SPECTRUM_M;
        let from_m = nearest(from_m, first_m..=last_m - NARROWEST_M);
        let to_m = nearest(to_m, from_m + NARROWEST_M..=last_m);
        let name = format!("{:.0}-{:.0} nm", from_m * 1e9, to_m * 1e9);
        Band::sampled(name, from_m, to_m, |_| 1.0)
    }

    /// `"v"` (Bessell 1990) or `"silicon"` (350 to 1050 nm, a typical sensor).
    pub fn named(name: &str) -> Option<Band> {
        let table = |table: &'static [f64], from_nm: f64, step_nm: f64| {
            move |m: f64| linear(table, (m * 1e9 - from_nm) / step_nm)
        };
        match name {
            "v" => Some(Band::sampled(
                name.into(),
                470e-9,
                700e-9,
                // The table is per energy; a photon of wavelength w carries hc/w. Its peak is at
                // 530 nm.
                |m| table(V, 470.0, 10.0)(m) * 530e-9 / m,
            )),
            "silicon" => Some(Band::sampled(
                name.into(),
                350e-9,
                1050e-9,
                table(SILICON, 350.0, 50.0),
            )),
            _ => None,
        }
    }

    fn sampled(name: String, from_m: f64, to_m: f64, response: impl Fn(f64) -> f64) -> Band {
        // Midpoints of steps of at most 2 nm; the spectrum itself is tabulated each 10 nm.
        let steps = (((to_m - from_m) / 2e-9).ceil() as usize).max(16);
        let step_m = (to_m - from_m) / steps as f64;
        let samples = (0..steps)
            .map(|i| from_m + (i as f64 + 0.5) * step_m)
            .map(|wavelength| (wavelength, response(wavelength)))
            .collect();
        let mut band = Band {
            name,
            samples,
            step_m,
            sun_photons: 1.0,
            zero_point: 0.0,
            mean_wavelengths: Vec::new(),
        };
        band.sun_photons = band.black_body_photons(temperature(SUN_B_V));
        band.zero_point = band.sun_irradiance() * libm::pow(10.0, 0.4 * SUN_MAGNITUDE);
        let step = (B_V[1] - B_V[0]) / B_V_STEPS as f64;
        band.mean_wavelengths = (0..=B_V_STEPS)
            .map(|i| band.mean_wavelength_m(temperature(B_V[0] + i as f64 * step)))
            .collect();
        band
    }

    /// Its name in labels and FITS headers.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// `E_zero` of Clark et al. 2021, Eq. (1): photon irradiance of magnitude 0, ph/s/m^2, from the
    /// solar spectrum over the band and the Sun's magnitude: `E_sun 10^(0.4 m_sun)`.
    pub fn zero_point(&self) -> f64 {
        self.zero_point
    }

    /// `E_sun`: photon irradiance of the Sun at 1 au in the band, ph/s/m^2.
    pub fn sun_irradiance(&self) -> f64 {
        self.sun_spectrum().map(|(_, photons)| photons).sum()
    }

    /// The parts of [`Band::sun_irradiance`]: wavelength (m) and photon irradiance (ph/s/m^2) of
    /// each step of the band.
    pub(crate) fn sun_spectrum(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let photons = |(w, r): &(f64, f64)| (*w, r * solar_irradiance(*w) * w / H_C * self.step_m);
        self.samples.iter().map(photons)
    }

    /// The response to a photon of a wavelength (m), 0..1, constant within a step; 0 outside the
    /// band.
    pub fn response(&self, wavelength_m: f64) -> f64 {
        let from_m = self
            .samples
            .first()
            .map_or(0.0, |(w, _)| w - self.step_m / 2.0);
        let step = ((wavelength_m - from_m) / self.step_m).floor();
        let sample = (step >= 0.0).then(|| self.samples.get(step as usize));
        sample.flatten().map_or(0.0, |(_, r)| *r)
    }

    /// Band magnitude minus V of a star of colour B-V, relative to the Sun: black bodies at the
    /// colour's temperature. Error against real spectra a few 0.01 mag for B to K stars, more for
    /// M.
    pub fn colour_term(&self, b_v: f64, v_band: &Band) -> f64 {
        let t = temperature(b_v);
        let in_band = self.black_body_photons(t) / self.sun_photons;
        let in_v = v_band.black_body_photons(t) / v_band.sun_photons;
        -2.5 / LN_10 * libm::log(in_band / in_v)
    }

    /// Mean wavelength of the photons of a star of colour B-V in the band, relative to the band's
    /// reference: a star of the Sun's colour. Linear interpolation in steps of 0.05 mag errs by
    /// less than 1e-4.
    pub fn wavelength_ratio(&self, b_v: f64) -> f64 {
        let at = |b_v: f64| {
            let part = (b_v.clamp(B_V[0], B_V[1]) - B_V[0]) / (B_V[1] - B_V[0]);
            linear(&self.mean_wavelengths, part * B_V_STEPS as f64)
        };
        at(b_v) / at(SUN_B_V)
    }

    /// The least and the greatest [`Band::wavelength_ratio`] of any star.
    pub fn wavelength_ratios(&self) -> [f64; 2] {
        [self.wavelength_ratio(B_V[0]), self.wavelength_ratio(B_V[1])]
    }

    /// The reference wavelength (m): the mean of the photons of a star of the Sun's colour.
    pub fn reference_m(&self) -> f64 {
        self.mean_wavelength_m(temperature(SUN_B_V))
    }

    /// Wavelengths in units of the reference, and the photons at each (any unit) from a star of the
    /// Sun's colour.
    pub(crate) fn spectrum(&self) -> Vec<(f64, f64)> {
        let (reference, t) = (self.reference_m(), temperature(SUN_B_V));
        let part = |(w, r): &(f64, f64)| (w / reference, r * planck(*w, t));
        self.samples.iter().map(part).collect()
    }

    fn mean_wavelength_m(&self, t: f64) -> f64 {
        let (mut photons, mut moment) = (0.0, 0.0);
        for (w, r) in &self.samples {
            let part = r * planck(*w, t);
            photons += part;
            moment += part * w;
        }
        moment / photons
    }

    /// Photon rate of a black body in the band, arbitrary unit:
    /// `sum R lambda^-4 / (exp(c2 / lambda T) - 1)`.
    fn black_body_photons(&self, t: f64) -> f64 {
        let photons = |(w, r): &(f64, f64)| r / (w * 1e6).powi(4) / libm::expm1(C2 / (w * t));
        self.samples.iter().map(photons).sum::<f64>() * self.step_m
    }
}

/// Photons of a black body at a wavelength (m), arbitrary unit. Pixels depend on it, so it must be
/// the same on every platform.
fn planck(w: f64, t: f64) -> f64 {
    let um = w * 1e6;
    1.0 / (um * um * um * um) / libm::expm1(C2 / (w * t))
}

/// Effective temperature (K) from colour, Ballesteros 2012 (EPL 97, 34008), Eq. (14); B-V limited
/// to the fitted range -0.4..2.0.
fn temperature(b_v: f64) -> f64 {
    let c = 0.92 * b_v.clamp(-0.4, 2.0);
    4600.0 * (1.0 / (c + 1.70) + 1.0 / (c + 0.62))
}

/// Solar spectral irradiance at 1 au, W/m^2 per m of wavelength, linear between the table's nodes.
fn solar_irradiance(wavelength_m: f64) -> f64 {
    linear(SOLAR, (wavelength_m * 1e9 - 300.0) / 10.0) * 1e9
}

fn linear(table: &[f64], at: f64) -> f64 {
    if at < 0.0 || at > (table.len() - 1) as f64 {
        return 0.0;
    }
    let i = (at as usize).min(table.len() - 2);
    table[i] + (table[i + 1] - table[i]) * (at - i as f64)
}

/// Extraterrestrial solar spectrum of ASTM G173-03 (SMARTS 2.9.2; 1348 W/m^2 over 280 to 4000 nm),
/// averaged over 10 nm, W/m^2/nm, 300 to 1200 nm each 10 nm.
const SOLAR: &[f64] = &[
    0.5254, 0.6450, 0.7200, 0.9893, 0.9469, 0.9944, 0.9761, 1.1510, 1.0872, 1.0586, 1.5041, 1.7068,
    1.7398, 1.5629, 1.8263, 1.9906, 2.0414, 1.9993, 2.0404, 1.8918, 1.9192, 1.9246, 1.8188, 1.8737,
    1.8652, 1.8669, 1.8330, 1.8366, 1.8366, 1.7782, 1.7669, 1.7285, 1.6856, 1.6586, 1.6299, 1.5828,
    1.5146, 1.5315, 1.4913, 1.4625, 1.4227, 1.3933, 1.3509, 1.3270, 1.2900, 1.2780, 1.2565, 1.2137,
    1.1967, 1.1650, 1.1368, 1.1148, 1.0816, 1.0594, 1.0419, 0.9789, 0.9965, 0.9497, 0.9475, 0.9330,
    0.9154, 0.8993, 0.8767, 0.8672, 0.8397, 0.8226, 0.8010, 0.7850, 0.7740, 0.7604, 0.7406, 0.7232,
    0.7034, 0.6906, 0.6756, 0.6602, 0.6455, 0.6265, 0.6156, 0.5983, 0.5902, 0.5849, 0.5740, 0.5645,
    0.5519, 0.5478, 0.5349, 0.5274, 0.5140, 0.5088, 0.4967,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_point_of_v_matches_the_published_one() {
        // X-Val: Bessell, Castelli & Plez 1998 (A&A 333, 231), Table A2: V = 0 is 3.631e-9
        // erg/s/cm^2/A, which through the response to photons is 8.652e9 ph/s/m^2. On that scale
        // the Sun has -26.76 (Willmer 2018, ApJS 236, 47), here the paper's -26.73. Weighted by
        // energy it would be 3.8 % more.
        let published = 8.652e9 * 10f64.powf(0.4 * (26.76 - 26.73));
        let zero = Band::named("v").unwrap().zero_point();
        assert!((zero / published - 1.0).abs() < 0.01, "{zero:e}");
    }

    #[test]
    fn zero_points_are_additive_over_the_band() {
        let zero = |a: f64, b: f64| Band::top_hat(a * 1e-9, b * 1e-9).zero_point();
        assert!((zero(629.0, 631.0) / zero(628.0, 632.0) - 0.5).abs() < 1e-4);
        assert!(
            (zero(650.0, 1100.0) / (zero(650.0, 800.0) + zero(800.0, 1100.0)) - 1.0).abs() < 1e-4
        );
        // X-Val: the same table's 0.5 nm original integrated over 650-1100 nm: 1.90980e21 ph/s/m^2
        // from the Sun.
        let sun = zero(650.0, 1100.0) / 10f64.powf(0.4 * SUN_MAGNITUDE);
        assert!((sun / 1.90980e21 - 1.0).abs() < 1e-3);
    }

    #[test]
    fn red_stars_are_brighter_in_the_red() {
        let v = Band::named("v").unwrap();
        let nir = Band::top_hat(650e-9, 1100e-9);
        assert!(nir.colour_term(SUN_B_V, &v).abs() < 1e-12);
        assert!(nir.colour_term(1.5, &v) < -0.8 && nir.colour_term(-0.2, &v) > 0.4);
        assert!(v.colour_term(1.5, &v).abs() < 1e-12);
    }

    #[test]
    fn red_stars_have_longer_mean_wavelengths() {
        let nir = Band::top_hat(650e-9, 1100e-9);
        assert!((nir.wavelength_ratio(SUN_B_V) - 1.0).abs() < 1e-15);
        // X-Val: numpy 2.4.6, 200,001 points of Planck's law in photons at 5767.48 K (B-V 0.653):
        // 857.72 nm over 650-1100 nm.
        assert!((nir.reference_m() * 1e9 - 857.72).abs() < 0.05);
        let [blue, red] = nir.wavelength_ratios();
        assert!(blue < 0.99 && red > 1.02, "{blue} {red}");
        // Interpolation against the integral.
        for b_v in [-0.37, 0.12, 0.611, 1.33, 1.98] {
            let exact = nir.mean_wavelength_m(temperature(b_v)) / nir.reference_m();
            assert!((nir.wavelength_ratio(b_v) - exact).abs() < 1e-4);
        }
        // A narrow band has one wavelength.
        let line = Band::top_hat(629e-9, 631e-9);
        assert!((line.reference_m() * 1e9 - 630.0).abs() < 0.01);
        assert!((line.wavelength_ratio(1.9) - 1.0).abs() < 1e-5);
    }
}
