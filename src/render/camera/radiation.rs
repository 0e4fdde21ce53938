//! Charged particles through the sensitive layer: straight tracks that deposit charge in every
//! crossed pixel.
//!
//! The charge of a track of length x is drawn from Moyal's form of Landau's distribution (Moyal
//! 1955, Phil. Mag. 46, 263) about the most probable loss (Particle Data Group, Review of Particle
//! Physics 2022, Eqs. 34.7, 34.12):
//!
//! ```text
//! loss  = loss_p + xi M,   M = -ln N(0, 1)^2
//! loss_p = xi (ln(2 m c^2 (beta gamma)^2 / I) + ln(xi / I) + 0.200 - beta^2 - delta)
//! xi    = (0.307075 / 2) <Z/A> density x / beta^2   MeV
//! charge = loss / 3.65 eV             (Janesick 2001, Scientific Charge-Coupled Devices)
//! ```
//!
//! Validity: singly charged particles from some 50 MeV a nucleon up, which lose little of their
//! energy. 534 +- 117 MeV, the typical energy at the Hubble's imagers (Miles et al. 2021, ApJ 918,
//! 86), gives 75 e- per um of 10 um as the most probable and 86 on average. Bethe's formula (Eq.
//! 34.5) has an average of 139: the difference is rare fast electrons, most of which leave so thin
//! a layer. Moyal's tail does not contain them. Layers below 50 um scatter more than Landau's
//! theory (Bichsel 1988, Rev. Mod. Phys. 60, 663: the width is too small by a factor up to 2).
//! Trapped protons of the South Atlantic Anomaly are slower, but all have the file's energy here:
//! at 100 MeV they would leave 2.7 times the charge. Secondaries, showers and stopping particles
//! are omitted.

use super::detector::Detector;
use skyloop_base::range::nearest;
use skyloop_base::rng::{NoiseKey, PixelStream};

/// Greatest expected number of events in one exposure.
pub(crate) const MAX_EVENTS: f64 = 1e5;
/// Greatest expected number of pixel computations for the particles of one exposure: some seconds.
pub(crate) const MAX_WORK: f64 = 1e8;
/// Greatest expected number of pixel computations for one particle.
pub const MAX_WORK_AN_EVENT: f64 = 1e6;

/// Random stream of the particles of a frame.
const STREAM: u8 = 3;
/// Energy of one electron-hole pair in silicon, eV.
const PAIR_EV: f64 = 3.65;

/// Particle flux.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Flux {
    /// Through a square centimetre of the detector per second, both directions.
    Fixed(f64),
    /// By the observer's position: see `sky::radiation`.
    ByOrbit,
}

/// Radiation parameters of the camera file.
#[derive(Debug, Clone, PartialEq)]
pub struct Radiation {
    /// Particle flux.
    pub flux: Flux,
    /// Depth from which charge is collected, um.
    pub thickness_um: f64,
    /// Kinetic energy of the particles, MeV; they are protons.
    pub energy_mev: f64,
    /// Sigma of the charge's sideways diffusion, um.
    pub diffusion_um: f64,
    /// Time outside the exposure in which charge is in the pixels or their store, s.
    pub readout_s: f64,
}

/// One particle's charge.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// `(row-major index, e-)` of every pixel with at least one whole electron, in order.
    pub pixels: Vec<(u32, u32)>,
}

impl Event {
    /// All its charge on the detector, e-.
    pub fn electrons(&self) -> f64 {
        self.pixels.iter().map(|(_, e)| f64::from(*e)).sum()
    }
}

impl Radiation {
    /// Particles expected in an exposure of `exposure_s` at `flux` (1/cm^2/s):
    /// `flux area (exposure + readout)`.
    pub fn expected_events(&self, detector: &Detector, flux: f64, exposure_s: f64) -> f64 {
        let pitch_cm = detector.pitch_m * 100.0;
        flux * detector.pixels() as f64 * pitch_cm * pitch_cm * (exposure_s + self.readout_s)
    }

    /// Mean number of pixel computations for one particle: its track is `pi / 2 thickness` long in
    /// the plane.
    pub(crate) fn work_an_event(&self, detector: &Detector) -> f64 {
        let [track, sigma] =
            [self.thickness_um, self.diffusion_um].map(|um| um * 1e-6 / detector.pitch_m);
        let track = std::f64::consts::FRAC_PI_2 * track;
        if sigma == 0.0 {
            return 1.0 + 2.0 * track;
        }
        let [wide, high] =
            [detector.width, detector.height].map(|size| (10.0 * sigma + 2.0).min(size as f64));
        (1.0 + track / step_px(sigma)) * wide * high
    }

    /// Greatest expected number of particles in an exposure.
    pub fn max_events(&self, detector: &Detector) -> f64 {
        MAX_EVENTS.min(MAX_WORK / self.work_an_event(detector))
    }

    /// The particles of one exposure: a Poisson number about `expected`, each keyed by its own
    /// index. `expected` is limited to [`Radiation::max_events`]: the anomaly reaches that in
    /// exposures of hours.
    pub fn events(&self, detector: &Detector, expected: f64, key: NoiseKey) -> Vec<Event> {
        self.each_event(detector, expected, key).collect()
    }

    /// The iterator of [`Radiation::events`].
    pub(crate) fn each_event(
        &self,
        detector: &Detector,
        expected: f64,
        key: NoiseKey,
    ) -> impl Iterator<Item = Event> {
        let expected = nearest(expected, 0.0..=self.max_events(detector));
        let count = PixelStream::new(key, STREAM, 0).poisson(expected) as u32;
        let events = (1..=count).map(move |index| self.event(detector, key, index));
        events.filter(|event| !event.pixels.is_empty())
    }

    /// One particle of an isotropic flux. The direction through a plane has the density
    /// `2 cos(theta)`.
    fn event(&self, detector: &Detector, key: NoiseKey, index: u32) -> Event {
        let mut stream = PixelStream::new(key, STREAM, index);
        let (w, h) = (detector.width as f64, detector.height as f64);
        // At half depth, px from the detector's corner: the middle of a track is on the detector.
        let middle = [stream.uniform() * w, stream.uniform() * h];
        let cos = libm::sqrt(stream.uniform());
        let azimuth = std::f64::consts::TAU * stream.uniform();
        let depth_px = self.thickness_um * 1e-6 / detector.pitch_m;
        let half = depth_px * libm::sqrt(1.0 - cos * cos) / cos / 2.0;
        let (dx, dy) = (half * libm::cos(azimuth), half * libm::sin(azimuth));
        // The part of -1..1 inside the detector: a grazing track ends at the edges.
        let inside = |at: f64, step: f64, size: f64| {
            if step == 0.0 {
                return 1.0;
            }
            (if step > 0.0 {
                (size - at) / step
            } else {
                -at / step
            })
            .min(1.0)
        };
        let [x, y] = middle;
        let to = inside(x, dx, w).min(inside(y, dy, h));
        let from = -inside(x, -dx, w).min(inside(y, -dy, h));
        let ends = [from, to].map(|part| [x + part * dx, y + part * dy]);
        let length_um = self.thickness_um / cos * (to - from) / 2.0;
        let charge = self.charge_e(length_um, stream.normal());
        let shares = self.shares(detector, ends);
        Event {
            pixels: whole_electrons(&shares, charge),
        }
    }

    /// Charge (e-) of a track of `length_um`, from a standard normal draw.
    pub fn charge_e(&self, length_um: f64, normal: f64) -> f64 {
        let (most_probable_ev, xi_ev) = self.loss_ev(length_um);
        let moyal = -libm::log((normal * normal).max(f64::MIN_POSITIVE));
        (most_probable_ev + xi_ev * moyal).max(0.0) / PAIR_EV
    }

    /// Most probable loss and xi of a track of `length_um` in silicon, eV.
    fn loss_ev(&self, length_um: f64) -> (f64, f64) {
        // MeV: masses of proton and electron (CODATA 2018). Silicon: Particle Data Group, Atomic
        // and Nuclear Properties.
        const PROTON: f64 = 938.272;
        const ELECTRON_EV: f64 = 0.510_999e6;
        const EXCITATION_EV: f64 = 173.0;
        let gamma = 1.0 + self.energy_mev / PROTON;
        let beta2 = 1.0 - 1.0 / (gamma * gamma);
        let bg2 = gamma * gamma - 1.0;
        // K / 2 in eV cm^2/mol, <Z/A> in mol/g, density in g/cm^3, um in cm.
        let xi = 0.307_075e6 / 2.0 * 0.49848 * 2.329 * length_um * 1e-4 / beta2;
        let logs =
            libm::log(2.0 * ELECTRON_EV * bg2 / EXCITATION_EV) + libm::log(xi / EXCITATION_EV);
        let most_probable = xi * (logs + 0.200 - beta2 - density_effect(libm::log10(bg2) / 2.0));
        (most_probable.max(0.0), xi)
    }

    /// The share of a track's charge in each pixel. The ends are in px from the corner.
    fn shares(&self, detector: &Detector, [a, b]: [[f64; 2]; 2]) -> Vec<(u32, f64)> {
        let sigma = self.diffusion_um * 1e-6 / detector.pitch_m;
        let mut shares: Vec<(u32, f64)> = Vec::new();
        if sigma == 0.0 {
            crossed(detector, a, b, |pixel, part| shares.push((pixel, part)));
        } else {
            let length = libm::hypot(b[0] - a[0], b[1] - a[1]);
            let points = libm::ceil(length / step_px(sigma)).clamp(1.0, 1e5);
            for i in 0..points as usize {
                let part = (i as f64 + 0.5) / points;
                let at = [0, 1].map(|k| a[k] + part * (b[k] - a[k]));
                diffused(detector, at, sigma, |pixel, share| {
                    shares.push((pixel, share / points));
                });
            }
        }
        shares.sort_by_key(|(pixel, _)| *pixel);
        shares.dedup_by(|next, last| {
            let same = next.0 == last.0;
            if same {
                last.1 += next.1;
            }
            same
        });
        shares
    }
}

/// Distance of the points of a track whose charge diffuses by `sigma` (px): a quarter of that, but
/// at least a twentieth of a pixel.
fn step_px(sigma: f64) -> f64 {
    0.25 * sigma.max(0.2)
}

/// Sternheimer's density effect at `x = log10(beta gamma)`, in silicon: the constants of
/// Sternheimer, Berger and Seltzer 1984 (Atomic Data and Nuclear Data Tables 30, 261), scaled to
/// 2.329 g/cm^3 as in the Particle Data Group's table of muons in silicon.
fn density_effect(x: f64) -> f64 {
    const LN_100: f64 = 4.605_170_186;
    if x < 0.2015 {
        0.14 * libm::pow(10.0, 2.0 * (x - 0.2015))
    } else {
        let bend = 0.14921 * libm::pow((2.8716 - x).max(0.0), 3.2546);
        LN_100 * x - 4.4355 + bend
    }
}

/// The pixels on the line from `a` to `b` (px from the corner), with the part of its length in
/// each.
fn crossed(detector: &Detector, a: [f64; 2], b: [f64; 2], mut each: impl FnMut(u32, f64)) {
    let d = [b[0] - a[0], b[1] - a[1]];
    let mut cuts = vec![0.0, 1.0];
    for k in 0..2 {
        let (low, high) = (a[k].min(b[k]), a[k].max(b[k]));
        let mut edge = libm::floor(low) + 1.0;
        while edge < high {
            cuts.push((edge - a[k]) / d[k]);
            edge += 1.0;
        }
    }
    cuts.sort_by(f64::total_cmp);
    for pair in cuts.windows(2) {
        let middle = (pair[0] + pair[1]) / 2.0;
        let at = [0, 1].map(|k| a[k] + middle * d[k]);
        each(pixel_at(detector, at), pair[1] - pair[0]);
    }
}

/// A point's charge after diffusion: a Gaussian over the pixels within five sigma. Charge beyond
/// the detector is lost.
fn diffused(detector: &Detector, at: [f64; 2], sigma: f64, mut each: impl FnMut(u32, f64)) {
    let reach = 5.0 * sigma;
    let below =
        |edge: f64, k: usize| 0.5 * libm::erfc((at[k] - edge) / (sigma * std::f64::consts::SQRT_2));
    let range = |k: usize, size: usize| {
        let first = (at[k] - reach).max(0.0) as usize;
        first..((at[k] + reach) as usize).saturating_add(1).min(size)
    };
    for row in range(1, detector.height) {
        let down = below(row as f64 + 1.0, 1) - below(row as f64, 1);
        for column in range(0, detector.width) {
            let across = below(column as f64 + 1.0, 0) - below(column as f64, 0);
            each((row * detector.width + column) as u32, down * across);
        }
    }
}

fn pixel_at(detector: &Detector, [x, y]: [f64; 2]) -> u32 {
    let column = (x.max(0.0) as usize).min(detector.width - 1);
    let row = (y.max(0.0) as usize).min(detector.height - 1);
    (row * detector.width + column) as u32
}

/// `charge` in whole electrons over the shares. Each remainder is carried to the next pixel, so
/// that the sum is exact.
fn whole_electrons(shares: &[(u32, f64)], charge: f64) -> Vec<(u32, u32)> {
    let (mut sum, mut given) = (0.0, 0.0);
    let mut pixels = Vec::with_capacity(shares.len());
    for (pixel, share) in shares {
        sum += share * charge;
        let electrons = libm::round(sum) - given;
        if electrons >= 1.0 {
            pixels.push((*pixel, electrons as u32));
            given += electrons;
        }
    }
    pixels
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use skyloop_base::load::Folder;

    const PLAIN: Radiation = Radiation {
        flux: Flux::Fixed(1.0),
        thickness_um: 10.0,
        energy_mev: 534.0,
        diffusion_um: 0.0,
        readout_s: 0.0,
    };

    fn key(sequence: u32) -> NoiseKey {
        NoiseKey {
            seed: 5,
            sequence,
            repeat: 0,
        }
    }

    fn detector() -> Detector {
        Camera::load("fai-nir", &Folder::current())
            .unwrap()
            .detector
    }

    #[test]
    fn loss_matches_the_particle_data_group() {
        let (loss, xi) = PLAIN.loss_ev(10.0);
        // By hand from Eq. 34.12: gamma 1.5691, beta^2 0.5938; 9.063 + 0.551 + 0.2 - 0.594 - 0.081
        // = 9.139 times 300.2 eV.
        assert!((xi - 300.1).abs() < 0.5, "{xi}");
        assert!((loss / 2743.5 - 1.0).abs() < 0.001, "{loss}");
        // X-Val: PDG Eq. 34.13, where the density effect is complete: xi (ln(2 m c^2 xi / (31.05
        // eV)^2) + 0.200), 84.2 keV in 300 um; at the minimum it is some 7 % less.
        let fast = Radiation {
            energy_mev: 1e6,
            ..PLAIN
        };
        assert!((fast.loss_ev(300.0).0 / 84.2e3 - 1.0).abs() < 0.002);
        let minimum = Radiation {
            energy_mev: 3000.0,
            ..PLAIN
        };
        assert!((77e3..79.5e3).contains(&minimum.loss_ev(300.0).0));
        // Mean of Moyal's distribution: Euler's constant + ln 2.
        let n = 100_000;
        let charge: f64 = (0..n)
            .map(|i| PLAIN.charge_e(10.0, PixelStream::new(key(1), 9, i).normal()))
            .sum();
        let mean = (loss + xi * (0.577_215_664_9 + std::f64::consts::LN_2)) / PAIR_EV;
        // Variance of Moyal's: pi^2 / 2.
        let error = xi / PAIR_EV * (4.934_802_2 / f64::from(n)).sqrt();
        assert!((charge / f64::from(n) - mean).abs() < 5.0 * error);
    }

    #[test]
    fn track_is_split_by_its_length_in_each_pixel() {
        let detector = detector();
        let mut parts = Vec::new();
        // From (0.5, 0.25) to (2.5, 1.25): it leaves column 0 at a quarter, column 1 and row 0 at
        // three quarters of its length.
        crossed(&detector, [0.5, 0.25], [2.5, 1.25], |pixel, part| {
            if part > 0.0 {
                parts.push((pixel, part));
            }
        });
        let width = detector.width as u32;
        let expected = [(0, 0.25), (1, 0.5), (width + 2, 0.25)];
        assert_eq!(parts.len(), 3, "{parts:?}");
        for ((pixel, part), (at, length)) in parts.iter().zip(expected) {
            assert!(*pixel == at && (part - length).abs() < 1e-12, "{parts:?}");
        }
    }

    #[test]
    fn charge_is_conserved_and_stays_on_the_detector() {
        let detector = detector();
        for diffusion_um in [0.0, 6.0, 60.0] {
            let radiation = Radiation {
                diffusion_um,
                thickness_um: 100.0,
                ..PLAIN
            };
            let ends = [[120.3, 200.7], [124.9, 203.1]];
            let shares = radiation.shares(&detector, ends);
            let sum: f64 = shares.iter().map(|(_, share)| share).sum();
            // Five sigma on each side contain all but 6e-7 per axis.
            assert!((sum - 1.0).abs() < 3e-6, "{diffusion_um}: {sum}");
            let whole = whole_electrons(&shares, 4321.7);
            let total: u32 = whole.iter().map(|(_, e)| e).sum();
            assert!((f64::from(total) - 4321.7).abs() <= 1.0);
            assert!(whole.is_sorted_by_key(|(pixel, _)| *pixel));
        }
        let events = PLAIN.events(&detector, 2000.0, key(3));
        for event in &events {
            let last = event.pixels.last().unwrap();
            assert!((last.0 as usize) < detector.pixels());
            assert!(event.pixels.iter().all(|(_, e)| *e > 0));
        }
        assert!(events.iter().any(|event| event.pixels.len() > 1));
    }

    /// Over 10^4 frames: the number is within Poisson's error, and mean length and directions match
    /// an isotropic flux.
    #[test]
    fn rate_matches_the_configuration() {
        let detector = detector();
        let radiation = Radiation {
            readout_s: 0.05,
            ..PLAIN
        };
        // 0.443 cm^2 at 20 /cm^2/s for 0.15 s: 1.33 a frame.
        let expected = radiation.expected_events(&detector, 20.0, 0.1);
        assert!((expected - 20.0 * 0.6656f64.powi(2) * 0.15).abs() < 1e-9);
        let (mut events, mut squares, mut charge) = (0.0, 0.0, 0.0);
        for sequence in 0..10_000 {
            let frame = radiation.events(&detector, expected, key(sequence));
            events += frame.len() as f64;
            squares += (frame.len() as f64).powi(2);
            charge += frame.iter().map(Event::electrons).sum::<f64>();
        }
        let all = expected * 1e4;
        assert!((events - all).abs() < 4.0 * all.sqrt(), "{events} of {all}");
        // Poisson: the variance is the mean; it scatters by sqrt((2 m^2 + m) / n).
        let variance = squares / 1e4 - (events / 1e4).powi(2);
        let error = ((2.0 * expected * expected + expected) / 1e4).sqrt();
        assert!((variance - expected).abs() < 4.0 * error, "{variance}");
        // Isotropic: over the density 2 cos, 1 / cos has the mean 2, and so has ln(1 / cos) / cos.
        // With a = 9.139 of the most probable loss of 10 um (see above) and Moyal's mean, the
        // charge is (2 a + 2 + 2 * 1.270) / (2 a + 2 ln 2) = 1.160 of that of 20 um. A beam would
        // give 0.53, a density 3 cos^2 0.83.
        let mean = charge / events / PLAIN.charge_e(20.0, 1.0);
        assert!((mean / 1.160 - 1.0).abs() < 0.05, "{mean}");
    }

    #[test]
    fn events_depend_on_the_key() {
        let detector = detector();
        let draw = |sequence| PLAIN.events(&detector, 30.0, key(sequence));
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1), draw(2));
        // The first events are the same for a greater number.
        let (few, many) = (PLAIN.events(&detector, 5.0, key(1)), draw(1));
        assert!(few.len() < many.len() && few[..] == many[..few.len()]);
    }
}
