//! What is in a frame and is no light: the charge of particles, and pixels that are not as they should be.

use super::{VISIBLE_SNR, e4, e6};
use crate::camera::Detector;
use crate::scene::Scene;
use serde::Serialize;

/// A particle's charge, or a defective pixel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SpotLabel {
    /// `radiation` or `defect`.
    pub kind: &'static str,
    /// `particle n`, counted from 1 in each frame; or `dead`, `stuck` or `hot` with column and row.
    pub id: String,
    /// Centre of the charge; of a pixel, its own. Column.
    #[serde(serialize_with = "e6")]
    pub x_px: f64,
    /// Row.
    #[serde(serialize_with = "e6")]
    pub y_px: f64,
    /// All its charge on the detector; what a hot pixel's excess expects; what a stuck pixel's digit stands for.
    #[serde(serialize_with = "e4")]
    pub electrons: f64,
    /// By how much it stands out of the noise of its pixels, in sigmas.
    #[serde(serialize_with = "e4")]
    pub snr: f64,
    /// Always: it is on the detector.
    pub in_frame: bool,
    /// Of a signal-to-noise ratio of at least [`VISIBLE_SNR`].
    pub visible: bool,
    /// Why it is not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// `[column, row, electrons]` of its pixels, whole electrons.
    pub pixels: Vec<[i64; 3]>,
}

/// The particles and defects of `scene` that stand out by at least `least_snr`.
pub fn spots(scene: &Scene, least_snr: f64) -> Vec<SpotLabel> {
    let pixels = Pixels::new(scene);
    let mut spots = pixels.particles();
    spots.extend(pixels.defects());
    spots.retain(|spot| spot.snr >= least_snr);
    spots
}

/// The detector's pixels as this frame has them.
struct Pixels<'a> {
    scene: &'a Scene,
    detector: &'a Detector,
    /// Variance beside the charge's own, e-^2.
    floor: f64,
}

impl<'a> Pixels<'a> {
    fn new(scene: &'a Scene) -> Self {
        let detector = &scene.view.camera.detector;
        let read = if scene.simulated.read {
            detector.read_noise_e
        } else {
            0.0
        };
        Pixels {
            scene,
            detector,
            floor: read * read + detector.quantisation_variance(),
        }
    }

    /// Noise variance of a pixel that expects `e`, e-^2.
    fn variance(&self, e: f64) -> f64 {
        self.floor + if self.scene.simulated.shot { e } else { 0.0 }
    }

    fn place(&self, pixel: u32) -> [i64; 2] {
        let (pixel, width) = (i64::from(pixel), self.detector.width as i64);
        [pixel % width, pixel / width]
    }

    /// Particles as they were drawn: `snr^2 = sum e^2 / (b + read^2 + gain^2 / 12)`, b the background.
    fn particles(&self) -> Vec<SpotLabel> {
        let label = |(index, event): (usize, &crate::camera::Event)| {
            let (mut sum, mut moment, mut snr2) = (0.0, [0.0; 2], 0.0);
            let mut pixels = Vec::with_capacity(event.pixels.len());
            for (pixel, electrons) in &event.pixels {
                let ([x, y], e) = (self.place(*pixel), f64::from(*electrons));
                sum += e;
                moment = [moment[0] + e * x as f64, moment[1] + e * y as f64];
                snr2 += e * e / self.variance(self.scene.background_of(*pixel as usize));
                pixels.push([x, y, i64::from(*electrons)]);
            }
            let id = format!("particle {}", index + 1);
            let centre = moment.map(|m| m / sum);
            spot("radiation", id, centre, sum, snr2.sqrt(), pixels)
        };
        self.scene.events.iter().enumerate().map(label).collect()
    }

    /// What `pixels` expect, and what particles leave in them, e-.
    fn held_e(&self, pixels: &[u32]) -> Vec<f64> {
        let expected = self.scene.expected_e(pixels).into_iter();
        let struck = self.scene.struck_e(pixels);
        expected.zip(struck).map(|(e, more)| e + more).collect()
    }

    /// Defects by what they change of what their pixels would give: dead and stuck ones of all that they hold, hot ones
    /// of the charge that is too much.
    fn defects(&self) -> Vec<SpotLabel> {
        let (simulated, detector) = (&self.scene.simulated, self.detector);
        let (pattern, seconds) = (&detector.pattern, self.scene.view.exposure.duration_s);
        let mut defects = Vec::new();
        let mut add = |name: &str, pixel: u32, electrons: f64, change: f64, held: f64| {
            let [x, y] = self.place(pixel);
            let snr = change.abs() / self.variance(held).max(f64::MIN_POSITIVE).sqrt();
            let (id, centre) = (format!("{name} {x},{y}"), [x as f64, y as f64]);
            let pixels = vec![[x, y, electrons.round() as i64]];
            defects.push(spot("defect", id, centre, electrons, snr, pixels));
        };
        if simulated.dead {
            for (pixel, held) in pattern.dead().iter().zip(self.held_e(pattern.dead())) {
                add("dead", *pixel, 0.0, held, held);
            }
        }
        if simulated.stuck {
            let stands_for = f64::from(detector.stuck_dn) - detector.offset_dn;
            let electrons = stands_for * detector.gain_e_per_dn;
            for (pixel, held) in pattern.stuck().iter().zip(self.held_e(pattern.stuck())) {
                add("stuck", *pixel, electrons, electrons - held, held);
            }
        }
        if simulated.dark {
            for (pixel, excess) in pattern.hot() {
                let excess = f64::from(*excess) * seconds;
                let held = self.scene.background_of(*pixel as usize);
                let blind = (simulated.dead && pattern.dead().binary_search(pixel).is_ok())
                    || (simulated.stuck && pattern.stuck().binary_search(pixel).is_ok());
                if !blind {
                    add("hot", *pixel, excess, excess, held);
                }
            }
        }
        defects
    }
}

fn spot(
    kind: &'static str,
    id: String,
    [x_px, y_px]: [f64; 2],
    electrons: f64,
    snr: f64,
    pixels: Vec<[i64; 3]>,
) -> SpotLabel {
    let visible = snr >= VISIBLE_SNR;
    SpotLabel {
        kind,
        id,
        x_px,
        y_px,
        electrons,
        snr,
        in_frame: true,
        visible,
        reason: (!visible).then(|| super::too_faint("", snr)),
        pixels,
    }
}
