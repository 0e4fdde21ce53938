//! A circular Gaussian. It is the product of one Gaussian a coordinate, and so is its integral over a pixel.

/// A circular Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gaussian {
    /// Standard deviation, px.
    pub sigma_px: f64,
}

impl Gaussian {
    /// Half the side (px) of the square outside of which less than `loss` of the light falls:
    /// two coordinates, two tails each, every tail below `exp(-k^2 / 2) / 2` at k sigma.
    pub fn reach_px(&self, loss: f64) -> f64 {
        self.sigma_px * (-2.0 * (loss / 2.0).ln()).sqrt()
    }

    /// Share of the light that falls between the lower edges of the pixels `edges` along one axis, for a source at `at` (px):
    /// `(erf((i + 1/2 - x) / (sqrt 2 sigma)) - erf((i - 1/2 - x) / (sqrt 2 sigma))) / 2`.
    /// The share of a pixel is the product over both axes.
    pub fn shares(&self, at: f64, mut edges: impl Iterator<Item = i64>, out: &mut Vec<f64>) {
        out.clear();
        let scale = 1.0 / (std::f64::consts::SQRT_2 * self.sigma_px);
        let edge = |i: i64| libm::erf((i as f64 - 0.5 - at) * scale);
        let Some(mut below) = edges.next().map(edge) else {
            return;
        };
        out.extend(edges.map(|i| {
            let above = edge(i);
            let share = 0.5 * (above - below);
            below = above;
            share
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shares_keep_light_and_centre() {
        for sigma_px in [0.05, 0.3, 0.7, 2.5] {
            for at in [0.0, 0.1, 0.5, -0.31] {
                let psf = Gaussian { sigma_px };
                let mut shares = Vec::new();
                let range = -40..41;
                psf.shares(at, range.start..=range.end, &mut shares);
                let total: f64 = shares.iter().sum();
                assert!((total - 1.0).abs() < 1e-12);
                // The centre of light on pixels equals the source's for a band-limited PSF only.
                if sigma_px >= 0.7 {
                    let centre: f64 = range.zip(&shares).map(|(i, s)| i as f64 * s).sum();
                    assert!((centre - at).abs() < 1e-4, "{sigma_px} {at} {centre}");
                }
            }
        }
    }

    #[test]
    fn less_than_the_loss_falls_outside_the_reach() {
        let psf = Gaussian { sigma_px: 0.7 };
        for loss in [1e-3, 1e-6, 1e-9] {
            let k = psf.reach_px(loss) / psf.sigma_px;
            let inside = libm::erf(k / std::f64::consts::SQRT_2).powi(2);
            assert!(1.0 - inside < 2.0 * loss && 1.0 - inside > 0.01 * loss);
        }
    }
}
