//! The detector: pixels, noise and conversion to digital numbers.

use super::pattern::Pattern;
use std::sync::Arc;

/// Treatment of charge above full well.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Blooming {
    /// It is lost, as with anti-blooming drains.
    None,
    /// It overflows to neighbours in its column.
    Column,
}

/// A detector, at its temperature.
#[derive(Debug, Clone, PartialEq)]
pub struct Detector {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Pixel pitch, m.
    pub pitch_m: f64,
    /// Electrons per photon, averaged over the band (1).
    pub quantum_efficiency: f64,
    /// Mean dark current of a pixel without hot pixels, e-/s.
    pub dark_e_s: f64,
    /// Read noise, e- rms.
    pub read_noise_e: f64,
    /// Full well, e-.
    pub full_well_e: f64,
    /// Treatment of charge above it.
    pub blooming: Blooming,
    /// Share of the signal that is missing at full well (1); see `effect`, non-linearity.
    pub nonlinearity: f64,
    /// Gain, e-/DN: electrons are divided by it (the paper's "eDN").
    pub gain_e_per_dn: f64,
    /// Value of a pixel without charge, DN.
    pub offset_dn: f64,
    /// Bits of the converter.
    pub bits: u8,
    /// Value of a stuck pixel, DN.
    pub stuck_dn: u16,
    /// Differences from pixel to pixel.
    pub pattern: Arc<Pattern>,
}

impl Detector {
    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// Factor of the dark current `warmer_k` above its reference, for a doubling each `doubling_k`:
    /// `dark(T) = dark(T_ref) 2^((T - T_ref) / T_double)`. This approximates, near one temperature,
    /// `T^1.5 exp(-E_gap / 2 k T)` (Janesick 2001, ch. 7), which doubles in 8 K at 20 deg C and in
    /// 6 K at -20. Where diffusion from the bulk prevails, at high temperature, it is
    /// `exp(-E_gap / k T)`, twice as fast (Widenhorn et al. 2002, Proc. SPIE 4669, 193).
    pub(crate) fn dark_growth(warmer_k: f64, doubling_k: f64) -> f64 {
        libm::exp2(warmer_k / doubling_k)
    }

    /// Expected dark charge of a pixel in an exposure, averaged over the detector, e-.
    pub fn dark_e(&self, exposure_s: f64) -> f64 {
        self.pattern.dark_mean_e_s() * exposure_s
    }

    /// The charge that is read for a held charge `e` (e-): `e (1 - a e / full well)`, with the
    /// fraction `a` missing at full well. This is the first non-linear term of a source follower
    /// whose gain falls with its signal (Janesick 2007, Photon Transfer, ch. 7). It rises up to
    /// full well for `a` up to 1/2; above full well it is linear.
    pub fn response_e(&self, e: f64) -> f64 {
        e * (1.0 - self.nonlinearity * (e / self.full_well_e).clamp(0.0, 1.0))
    }

    /// The charge (e-) at the converter's largest number.
    pub(crate) fn converter_reach_e(&self) -> f64 {
        (f64::from(self.max_dn()) - self.offset_dn) * self.gain_e_per_dn
    }

    /// A warning if the converter saturates before the pixels.
    pub fn converter_clips_first(&self) -> Option<String> {
        let reach = self.converter_reach_e();
        (self.response_e(self.full_well_e) > reach).then(|| {
            format!(
                "above the ADC's range of {reach:.0} e- ((2^adc_bits - 1 - offset_dn) gain_e_per_dn): DN clip before \
                 pixels reach full well; if that is intended, set adc_clips_first = true"
            )
        })
    }

    /// The largest digital number, `2^bits - 1`.
    pub fn max_dn(&self) -> u16 {
        (u32::from(u16::MAX) >> (16 - u32::from(self.bits.min(16)))) as u16
    }

    /// The digital number at which a pixel saturates: at full well, or at full scale if that is
    /// reached first.
    pub fn saturation_dn(&self) -> u16 {
        let full_well = self.response_e(self.full_well_e) / self.gain_e_per_dn + self.offset_dn;
        (full_well.round() as u16).min(self.max_dn())
    }

    /// Variance of rounding to whole DN, e-^2: `gain^2 / 12`.
    pub fn quantisation_variance(&self) -> f64 {
        self.gain_e_per_dn * self.gain_e_per_dn / 12.0
    }

    /// Points (px) on the outer edge of the detector, widened by `margin_px`: a sixteenth of a side
    /// apart.
    pub fn edge(&self, margin_px: f64) -> impl Iterator<Item = [f64; 2]> {
        const PARTS: usize = 16;
        let low = -0.5 - margin_px;
        let [width, height] =
            [self.width, self.height].map(|pixels| pixels as f64 + 2.0 * margin_px);
        (0..=PARTS)
            .map(|i| i as f64 / PARTS as f64)
            .flat_map(move |t| {
                let (x, y) = (low + t * width, low + t * height);
                [[x, low], [x, low + height], [low, y], [low + width, y]]
            })
    }

    /// The outer corners of the corner pixels, px.
    pub(super) fn corners(&self) -> [[f64; 2]; 4] {
        let [w, h] = self.sides().map(|pixels| pixels - 0.5);
        [[-0.5, -0.5], [w, -0.5], [-0.5, h], [w, h]]
    }

    /// Columns and rows.
    pub fn sides(&self) -> [f64; 2] {
        [self.width as f64, self.height as f64]
    }

    /// Whether a position lies on the detector. Its edges at -0.5 belong to it, the others do not.
    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        (-0.5..self.width as f64 - 0.5).contains(&x)
            && (-0.5..self.height as f64 - 0.5).contains(&y)
    }
}

#[cfg(test)]
mod tests {
    use crate::camera::Camera;
    use skyloop_base::load::Folder;

    #[test]
    fn frame_includes_its_lower_edges_only() {
        // 1280 x 1024 pixels; a pixel reaches half its width beyond its centre.
        let camera = Camera::load("cots-wide", &Folder::current()).unwrap();
        let inside = |x, y| camera.detector.contains([x, y]);
        assert!(inside(-0.5, -0.5) && inside(1279.499, 1023.499));
        assert!(!inside(-0.501, 0.0) && !inside(0.0, -0.501));
        assert!(!inside(1279.5, 0.0) && !inside(0.0, 1023.5));
        assert!(!inside(f64::NAN, 0.0));
    }

    #[test]
    fn response_is_nonlinear_as_configured_and_monotonic() {
        let mut detector = Camera::load("cots-wide", &Folder::current())
            .unwrap()
            .detector;
        assert_eq!(detector.response_e(5000.0), 5000.0);
        for share in [0.01, 0.2, 0.5] {
            detector.nonlinearity = share;
            let full = detector.full_well_e;
            assert!((detector.response_e(full) / full - (1.0 - share)).abs() < 1e-12);
            let steps: Vec<f64> = (0..=100).map(|i| full * f64::from(i) / 100.0).collect();
            assert!(steps.is_sorted_by(|a, b| detector.response_e(*a) < detector.response_e(*b)));
        }
        // Negative values, from read noise, stay linear.
        assert_eq!(detector.response_e(-3.0), -3.0);
    }

    #[test]
    fn early_converter_saturation_is_reported() {
        let mut detector = Camera::load("cots-wide", &Folder::current())
            .unwrap()
            .detector;
        assert_eq!(detector.converter_clips_first(), None);
        // (4095 - 32) 2.6 = 10563.8.
        detector.full_well_e = 10_600.0;
        assert!(
            detector
                .converter_clips_first()
                .unwrap()
                .contains("10564 e-")
        );
        detector.nonlinearity = 0.01;
        assert_eq!(detector.converter_clips_first(), None);
    }
}
