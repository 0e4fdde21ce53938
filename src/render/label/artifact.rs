//! Image artifacts that are not light: charge of particles, and defective pixels.

use super::rounded::{e4, e6};
use super::visible::{VISIBLE_SNR, too_faint};
use crate::camera::Detector;
use crate::scene::{EffectId, Scene, expected_e, struck_e};
use schemars::JsonSchema;
use serde::Serialize;
use std::cmp::Ordering;

/// The charge of a particle, or a defective pixel.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ArtifactLabel {
    /// `radiation` or `defect`.
    #[schemars(extend("enum" = [RADIATION, DEFECT]))]
    pub kind: &'static str,
    /// `particle n`, counted from 1 in each frame; or `dead`, `stuck` or `hot` with column and row.
    pub id: String,
    /// Centroid of the charge, or the pixel, column.
    #[serde(serialize_with = "e6")]
    pub x_px: f64,
    /// Centroid of the charge, or the pixel, row.
    #[serde(serialize_with = "e6")]
    pub y_px: f64,
    /// Charge on the detector; of a hot pixel the expected excess, of a stuck pixel the charge of
    /// its value.
    #[serde(serialize_with = "e4")]
    pub electrons: f64,
    /// Signal-to-noise ratio over its pixels.
    #[serde(serialize_with = "e4")]
    pub snr: f64,
    /// Always true.
    pub in_frame: bool,
    /// Whether the signal-to-noise ratio is at least [`VISIBLE_SNR`].
    pub visible: bool,
    /// Reason if it is not visible.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// `[column, row, electrons]` of each pixel, in whole electrons.
    pub pixels: Vec<[i64; 3]>,
}

/// Kinds of artifacts.
const RADIATION: &str = "radiation";
const DEFECT: &str = "defect";

/// Most particles and defects that a label lists: 2 MB of text.
pub const MAX_ARTIFACTS: usize = 10_000;

/// Most pixels of all listed artifacts, except that one particle is always listed: 4 MB of text.
pub const MAX_ARTIFACT_PIXELS: usize = 200_000;

/// The particles and defects of a label.
#[derive(Debug, Default)]
pub(crate) struct Artifacts {
    /// Those with the highest signal-to-noise ratios.
    pub listed: Vec<ArtifactLabel>,
    /// Number of the others.
    pub left_out: usize,
    /// The greatest signal-to-noise ratio of the others.
    pub left_out_snr: Option<f64>,
}

/// The particles and defects of `scene` with a signal-to-noise ratio of at least `min_snr`. Beyond
/// [`MAX_ARTIFACTS`] or [`MAX_ARTIFACT_PIXELS`], those with the highest ratios.
pub(crate) fn artifacts(scene: &Scene, min_snr: f64) -> Artifacts {
    let pixels = Pixels::new(scene);
    let mut strongest = Strongest::default();
    pixels.particles(|artifact| strongest.add(artifact, min_snr));
    pixels.defects(|artifact| strongest.add(artifact, min_snr));
    strongest.cut();
    strongest.cut_pixels(|artifact| pixels.count(artifact));
    strongest.found.sort_unstable_by_key(|(number, _)| *number);
    let found = strongest.found.iter();
    let listed = found.map(|(_, artifact)| pixels.label(artifact));
    Artifacts {
        listed: listed.collect(),
        left_out: strongest.left_out,
        left_out_snr: (strongest.left_out > 0).then_some(strongest.left_out_snr),
    }
}

/// A particle or a defect without its text: a detector may have millions of them.
#[derive(Debug, Clone, Copy)]
enum Found {
    /// With its index in the scene's particles.
    Particle { index: usize, snr: f64 },
    /// With its name, row-major index and equivalent charge.
    Defect {
        name: &'static str,
        pixel: u32,
        electrons: f64,
        snr: f64,
    },
}

impl Found {
    fn snr(&self) -> f64 {
        let (Found::Particle { snr, .. } | Found::Defect { snr, .. }) = self;
        *snr
    }
}

/// The [`MAX_ARTIFACTS`] added artifacts with the highest signal-to-noise ratios, numbered in the
/// order of addition.
#[derive(Debug, Default)]
struct Strongest {
    added: usize,
    found: Vec<(usize, Found)>,
    left_out: usize,
    left_out_snr: f64,
}

impl Strongest {
    fn add(&mut self, artifact: Found, min_snr: f64) {
        if artifact.snr() >= min_snr {
            self.found.push((self.added, artifact));
            self.added += 1;
        }
        if self.found.len() == 2 * MAX_ARTIFACTS {
            self.cut();
        }
    }

    /// Drops the weakest beyond the limit; of equal ones the last.
    fn cut(&mut self) {
        if self.found.len() <= MAX_ARTIFACTS {
            return;
        }
        self.found
            .select_nth_unstable_by(MAX_ARTIFACTS, stronger_first);
        self.leave_out_from(MAX_ARTIFACTS);
    }

    /// The same for the limit of pixels.
    fn cut_pixels(&mut self, pixels: impl Fn(&Found) -> usize) {
        let count = |(_, artifact): &(usize, Found)| pixels(artifact);
        if self.found.iter().map(count).sum::<usize>() <= MAX_ARTIFACT_PIXELS {
            return;
        }
        self.found.sort_unstable_by(stronger_first);
        let mut sum = 0;
        let mut fits = |artifact: &(usize, Found)| {
            sum += count(artifact);
            sum <= MAX_ARTIFACT_PIXELS
        };
        let fit = self
            .found
            .iter()
            .take_while(|artifact| fits(artifact))
            .count();
        self.leave_out_from(fit.max(1));
    }

    fn leave_out_from(&mut self, first: usize) {
        for (_, artifact) in self.found.drain(first..) {
            self.left_out += 1;
            self.left_out_snr = self.left_out_snr.max(artifact.snr());
        }
    }
}

/// The stronger first; of equal ones the first.
fn stronger_first((i, a): &(usize, Found), (j, b): &(usize, Found)) -> Ordering {
    b.snr().total_cmp(&a.snr()).then(i.cmp(j))
}

/// The detector's pixels with the effects of this frame.
struct Pixels<'a> {
    scene: &'a Scene,
    detector: &'a Detector,
    /// Variance without shot noise of the charge, e-^2.
    floor: f64,
}

impl<'a> Pixels<'a> {
    fn new(scene: &'a Scene) -> Self {
        let detector = &scene.view.camera.detector;
        let read = (scene.simulated).only_with(EffectId::ReadNoise, detector.read_noise_e);
        Pixels {
            scene,
            detector,
            floor: read * read + detector.quantisation_variance(),
        }
    }

    /// Noise variance of a pixel that expects `e`, e-^2.
    fn variance(&self, e: f64) -> f64 {
        self.floor + self.scene.simulated.only_with(EffectId::ShotNoise, e)
    }

    fn count(&self, found: &Found) -> usize {
        match found {
            Found::Particle { index, .. } => self.scene.events[*index].pixels.len(),
            Found::Defect { .. } => 1,
        }
    }

    fn position(&self, pixel: u32) -> [i64; 2] {
        let (pixel, width) = (i64::from(pixel), self.detector.width as i64);
        [pixel % width, pixel / width]
    }

    /// Particles as drawn: `snr^2 = sum e^2 / (b + read^2 + gain^2 / 12)`, b the background.
    fn particles(&self, mut add: impl FnMut(Found)) {
        let events = self.scene.events.iter().enumerate();
        for (index, event) in events.take_while(|_| !self.scene.is_cancelled()) {
            let part = |(pixel, electrons): &(u32, u32)| {
                let background = self.scene.background_of(*pixel as usize);
                f64::from(*electrons).powi(2) / self.variance(background)
            };
            let snr = event.pixels.iter().map(part).sum::<f64>().sqrt();
            add(Found::Particle { index, snr });
        }
    }

    /// Expected charge of `pixels`, that of particles included, e-.
    fn held_e(&self, pixels: &'a [u32]) -> impl Iterator<Item = f64> {
        let expected = expected_e(self.scene, pixels).into_iter();
        let struck = struck_e(self.scene, pixels);
        expected.zip(struck).map(|(e, more)| e + more)
    }

    /// Defects by the charge that they change: for dead and stuck pixels the charge held, for hot
    /// pixels the excess.
    fn defects(&self, mut found: impl FnMut(Found)) {
        let (simulated, detector) = (&self.scene.simulated, self.detector);
        let (pattern, seconds) = (&detector.pattern, self.scene.view.exposure.duration_s);
        let mut add = |name: &'static str, pixel: u32, electrons: f64, change: f64, held: f64| {
            let snr = change.abs() / self.variance(held).max(f64::MIN_POSITIVE).sqrt();
            found(Found::Defect {
                name,
                pixel,
                electrons,
                snr,
            });
        };
        if simulated.has(EffectId::DeadPixels) && !self.scene.is_cancelled() {
            for (pixel, held) in pattern.dead().iter().zip(self.held_e(pattern.dead())) {
                add("dead", *pixel, 0.0, held, held);
            }
        }
        if simulated.has(EffectId::StuckPixels) && !self.scene.is_cancelled() {
            let stands_for = f64::from(detector.stuck_dn) - detector.offset_dn;
            let electrons = stands_for * detector.gain_e_per_dn;
            for (pixel, held) in pattern.stuck().iter().zip(self.held_e(pattern.stuck())) {
                add("stuck", *pixel, electrons, electrons - held, held);
            }
        }
        if simulated.has(EffectId::DarkCurrent) {
            for (pixel, excess) in pattern
                .hot()
                .iter()
                .take_while(|_| !self.scene.is_cancelled())
            {
                let excess = f64::from(*excess) * seconds;
                let held = self.scene.background_of(*pixel as usize);
                let blind = (simulated.has(EffectId::DeadPixels)
                    && pattern.dead().binary_search(pixel).is_ok())
                    || (simulated.has(EffectId::StuckPixels)
                        && pattern.stuck().binary_search(pixel).is_ok());
                if !blind {
                    add("hot", *pixel, excess, excess, held);
                }
            }
        }
    }

    fn label(&self, found: &Found) -> ArtifactLabel {
        match *found {
            Found::Particle { index, snr } => {
                let event = &self.scene.events[index];
                let (mut sum, mut moment) = (0.0, [0.0; 2]);
                let mut pixels = Vec::with_capacity(event.pixels.len());
                for (pixel, electrons) in &event.pixels {
                    let ([x, y], e) = (self.position(*pixel), f64::from(*electrons));
                    sum += e;
                    moment = [moment[0] + e * x as f64, moment[1] + e * y as f64];
                    pixels.push([x, y, i64::from(*electrons)]);
                }
                let (id, centre) = (format!("particle {}", index + 1), moment.map(|m| m / sum));
                artifact(RADIATION, id, centre, sum, snr, pixels)
            }
            Found::Defect {
                name,
                pixel,
                electrons,
                snr,
            } => {
                let [x, y] = self.position(pixel);
                let (id, centre) = (format!("{name} {x},{y}"), [x as f64, y as f64]);
                let pixels = vec![[x, y, electrons.round() as i64]];
                artifact(DEFECT, id, centre, electrons, snr, pixels)
            }
        }
    }
}

fn artifact(
    kind: &'static str,
    id: String,
    [x_px, y_px]: [f64; 2],
    electrons: f64,
    snr: f64,
    pixels: Vec<[i64; 3]>,
) -> ArtifactLabel {
    let visible = snr >= VISIBLE_SNR;
    ArtifactLabel {
        kind,
        id,
        x_px,
        y_px,
        electrons,
        snr,
        in_frame: true,
        visible,
        reason: (!visible).then(|| too_faint("", snr)),
        pixels,
    }
}
