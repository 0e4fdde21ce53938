//! Synthetic star fields: pixel-integrated Gaussians with simple deterministic noise.

pub mod emulator;
pub mod loops;
pub mod lossy;
pub mod slow;
pub mod wire;

use skyloop_firmware_sim::image::Image;

/// A star: centre, px, and signal, e-.
#[derive(Clone, Copy, Debug)]
pub struct Star {
    pub x: f64,
    pub y: f64,
    pub electrons: f64,
}

#[derive(Clone, Copy, Debug)]
pub struct Field {
    pub width: usize,
    pub height: usize,
    pub psf_px: f64,
    pub background_e: f64,
    pub read_noise_e: f64,
    pub gain_e_per_dn: f64,
    pub offset_dn: f64,
    pub bits: u8,
}

impl Default for Field {
    fn default() -> Self {
        Self::USUAL
    }
}

impl Field {
    pub const USUAL: Self = Self {
        width: 256,
        height: 256,
        psf_px: 0.7,
        background_e: 40.0,
        read_noise_e: 8.0,
        gain_e_per_dn: 4.0,
        offset_dn: 100.0,
        bits: 12,
    };

    pub fn full_scale_dn(&self) -> u16 {
        u16::MAX >> (16 - self.bits)
    }

    /// Expected electrons of stars that move by (dx, dy) px during the exposure.
    pub fn electrons(&self, stars: &[Star], (dx, dy): (f64, f64)) -> Vec<f64> {
        let mut electrons = vec![self.background_e; self.width * self.height];
        let steps = (8.0 * dx.hypot(dy)).ceil().max(1.0);
        for star in stars {
            let light = star.electrons / steps;
            for step in 0..steps as usize {
                let along = (step as f64 + 0.5) / steps - 0.5;
                let (x, y) = (star.x + along * dx, star.y + along * dy);
                self.add(&mut electrons, x, y, light);
            }
        }
        electrons
    }

    fn add(&self, electrons: &mut [f64], x: f64, y: f64, light: f64) {
        let reach = (8.0 * self.psf_px).ceil();
        let range = |c: f64, end: usize| {
            ((c - reach).max(0.0) as usize)
                ..(((c + reach).max(-1.0) as isize + 1).clamp(0, end as isize) as usize)
        };
        for row in range(y, self.height) {
            let share_y = pixel_share(row as f64 - y, self.psf_px);
            for column in range(x, self.width) {
                electrons[row * self.width + column] +=
                    light * share_y * pixel_share(column as f64 - x, self.psf_px);
            }
        }
    }

    /// DN with shot noise (as normal noise), read noise and rounding.
    pub fn expose(&self, electrons: &[f64], noise: &mut Noise) -> Vec<u16> {
        let dn = electrons.iter().map(|e| {
            let e = e + noise.normal() * (e.max(0.0) + self.read_noise_e.powi(2)).sqrt();
            (e / self.gain_e_per_dn + self.offset_dn)
                .round()
                .clamp(0.0, f64::from(self.full_scale_dn())) as u16
        });
        dn.collect()
    }

    pub fn image<'a>(&self, frame: u32, pixels: &'a [u16]) -> Image<'a> {
        Image {
            frame,
            width: self.width,
            height: self.height,
            pixels,
            gain_e_per_dn: self.gain_e_per_dn,
            offset_dn: self.offset_dn,
            full_scale_dn: self.full_scale_dn(),
        }
    }

    /// Signal to noise by the label's definition, sqrt(sum s^2 / (s + b + read^2)), of a star far
    /// from the frame's edge.
    pub fn snr(&self, star: Star) -> f64 {
        let small = Self {
            background_e: 0.0,
            width: 33,
            height: 33,
            ..*self
        };
        let middle = Star {
            x: 16.0 + star.x.fract(),
            y: 16.0 + star.y.fract(),
            ..star
        };
        let alone = small.electrons(&[middle], (0.0, 0.0));
        let variance = |s: f64| s + self.background_e + self.read_noise_e.powi(2);
        let squares = alone.iter().map(|s| s * s / variance(*s));
        squares.sum::<f64>().sqrt()
    }

    /// Stars of equal brightness on a jittered grid, isolated from each other and from the edges.
    pub fn grid(&self, spacing: usize, electrons: f64, noise: &mut Noise) -> Vec<Star> {
        let mut stars = Vec::new();
        for row in (spacing..self.height - spacing / 2).step_by(spacing) {
            for column in (spacing..self.width - spacing / 2).step_by(spacing) {
                let [x, y] = [column, row].map(|at| at as f64 + noise.uniform() - 0.5);
                stars.push(Star { x, y, electrons });
            }
        }
        stars
    }
}

/// Integral of a unit Gaussian over a pixel with its centre `d` from the mean, by Simpson's rule
/// with 16 intervals.
fn pixel_share(d: f64, sigma: f64) -> f64 {
    const INTERVALS: usize = 16;
    let density =
        |t: f64| (-0.5 * (t / sigma).powi(2)).exp() / (sigma * (2.0 * std::f64::consts::PI).sqrt());
    let h = 1.0 / INTERVALS as f64;
    let term = |i: usize| {
        let weight = match i {
            0 | INTERVALS => 1.0,
            _ => 2.0 + 2.0 * (i % 2) as f64,
        };
        weight * density(d - 0.5 + i as f64 * h)
    };
    (0..=INTERVALS).map(term).sum::<f64>() * h / 3.0
}

/// Xorshift generator, equal on every machine.
#[derive(Clone, Debug)]
pub struct Noise(u64);

impl Noise {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub fn bits(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    /// In [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Standard normal, by the Box-Muller transform.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (2.0 * std::f64::consts::PI * self.uniform()).cos()
    }
}
