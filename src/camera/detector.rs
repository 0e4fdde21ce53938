//! The detector: pixels, noise and digits.

/// A detector with a linear response.
#[derive(Debug, Clone, PartialEq)]
pub struct Detector {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Pixel pitch, m.
    pub pitch_m: f64,
    /// Electrons a photon, averaged over the band (1).
    pub quantum_efficiency: f64,
    /// Dark current, e-/s a pixel.
    pub dark_e_s: f64,
    /// Read noise, e- rms.
    pub read_noise_e: f64,
    /// Full well, e-.
    pub full_well_e: f64,
    /// Gain, e-/DN: electrons are divided by it (the paper's "eDN").
    pub gain_e_per_dn: f64,
    /// What the converter gives for no charge, DN.
    pub offset_dn: f64,
    /// Bits of the converter.
    pub bits: u8,
}

impl Detector {
    /// Pixels.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// Expected dark charge of a pixel in an exposure, e-.
    pub fn dark_e(&self, exposure_s: f64) -> f64 {
        self.dark_e_s * exposure_s
    }

    /// The largest digital number, `2^bits - 1`.
    pub fn max_dn(&self) -> u16 {
        (u32::from(u16::MAX) >> (16 - u32::from(self.bits.min(16)))) as u16
    }

    /// The digital number at which a pixel saturates: its full well, or full scale where that comes first.
    pub fn saturation_dn(&self) -> u16 {
        let full_well = self.full_well_e / self.gain_e_per_dn + self.offset_dn;
        (full_well.round() as u16).min(self.max_dn())
    }

    /// Variance that rounding to whole digits adds, e-^2: `gain^2 / 12`.
    pub fn quantisation_variance(&self) -> f64 {
        self.gain_e_per_dn * self.gain_e_per_dn / 12.0
    }

    /// The edge of the detector, every pixel included, widened by `margin_px`: points (px) some sixteenth of a side apart.
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

    /// Whether a position lies on the detector, pixel edges included on the lower side.
    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        (-0.5..self.width as f64 - 0.5).contains(&x)
            && (-0.5..self.height as f64 - 0.5).contains(&y)
    }
}

#[cfg(test)]
mod tests {
    use crate::camera::Camera;
    use crate::load::Folder;

    #[test]
    fn a_frame_holds_its_lower_edges_and_not_its_upper_ones() {
        // 1280 x 1024 pixels; a pixel reaches half its width beyond its centre.
        let camera = Camera::load("cots-wide", &Folder::current()).unwrap();
        let inside = |x, y| camera.detector.contains([x, y]);
        assert!(inside(-0.5, -0.5) && inside(1279.499, 1023.499));
        assert!(!inside(-0.501, 0.0) && !inside(0.0, -0.501));
        assert!(!inside(1279.5, 0.0) && !inside(0.0, 1023.5));
        assert!(!inside(f64::NAN, 0.0));
    }
}
