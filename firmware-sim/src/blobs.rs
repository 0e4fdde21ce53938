//! Blobs: 8-connected pixels above the threshold, split where stars merge.

use crate::signal::Signal;

/// Noise of the smoothed image over the noise of a pixel: root of the sum of squared weights, 6/16.
const SMOOTHED_NOISE: f32 = 0.375;
/// Larger blobs are stray light or a damaged frame, not stars.
const MAX_PIXELS: usize = 50_000;
/// Maximum number of stars in one blob.
const MAX_PEAKS: usize = 32;

pub(crate) struct Blob {
    /// From 1.
    id: u32,
    pub(crate) pixels: Vec<usize>,
}

pub(crate) struct Blobs {
    pub(crate) list: Vec<Blob>,
    /// Blob id of each pixel, 0 for none.
    owner: Vec<u32>,
}

impl Blobs {
    /// Finds pixels whose smoothed signal exceeds `threshold` times its noise.
    pub(crate) fn find(signal: &Signal, threshold: f32) -> Self {
        let smoothed = signal.smoothed();
        let above =
            |index: usize| smoothed[index] > threshold * SMOOTHED_NOISE * signal.sigma[index];
        let mut blobs = Self {
            list: Vec::new(),
            owner: vec![0; smoothed.len()],
        };
        let mut seen = vec![false; smoothed.len()];
        for seed in 0..smoothed.len() {
            if seen[seed] || !above(seed) {
                continue;
            }
            seen[seed] = true;
            let mut connected = vec![seed];
            let mut next = 0;
            while let Some(&index) = connected.get(next) {
                next += 1;
                for neighbour in signal.around(index, 1) {
                    if !seen[neighbour] && above(neighbour) {
                        seen[neighbour] = true;
                        connected.push(neighbour);
                    }
                }
            }
            if connected.len() <= MAX_PIXELS {
                blobs.split(signal, &smoothed, connected);
            }
        }
        blobs
    }

    pub(crate) fn is_free_for(&self, index: usize, blob: &Blob) -> bool {
        let owner = self.owner[index];
        owner == 0 || owner == blob.id
    }

    /// Splits connected pixels into one blob for each peak. Each pixel joins the nearest peak.
    fn split(&mut self, signal: &Signal, smoothed: &[f32], connected: Vec<usize>) {
        let peaks = peaks(signal, smoothed, &connected);
        if peaks.len() < 2 {
            return self.add(connected);
        }
        let mut parts = vec![Vec::new(); peaks.len()];
        for index in connected {
            let distance = |part: &usize| squared_distance(signal, index, peaks[*part]);
            let nearest = (0..peaks.len()).min_by_key(distance);
            parts[nearest.unwrap_or(0)].push(index);
        }
        parts.into_iter().for_each(|part| self.add(part));
    }

    fn add(&mut self, pixels: Vec<usize>) {
        let id = self.list.len() as u32 + 1;
        for index in &pixels {
            self.owner[*index] = id;
        }
        self.list.push(Blob { id, pixels });
    }
}

fn squared_distance(signal: &Signal, a: usize, b: usize) -> usize {
    let width = signal.width;
    let (dx, dy) = (
        (a % width).abs_diff(b % width),
        (a / width).abs_diff(b / width),
    );
    dx * dx + dy * dy
}

/// Distinct peaks of connected pixels, highest first. Between a peak and every higher one, the
/// signal falls below three quarters of the lower peak, and by more than the noise.
fn peaks(signal: &Signal, smoothed: &[f32], connected: &[usize]) -> Vec<usize> {
    const VALLEY: f32 = 0.75;
    const SIGNIFICANT: f32 = 4.0;
    let is_top = |&index: &usize| {
        let mut around = signal.around(index, 1);
        around.all(|other| smoothed[other] <= smoothed[index])
    };
    let mut tops: Vec<usize> = connected.iter().copied().filter(is_top).collect();
    tops.sort_by(|a, b| smoothed[*b].total_cmp(&smoothed[*a]));
    let mut peaks: Vec<usize> = Vec::new();
    for top in tops {
        let height = smoothed[top];
        let noise = SMOOTHED_NOISE * (signal.sigma[top].powi(2) + height.max(0.0)).sqrt();
        let stands_apart = |&peak: &usize| {
            let between = signal.between(top, peak).map(|index| smoothed[index]);
            let lowest = between.fold(height, f32::min);
            lowest < VALLEY * height && height - lowest > SIGNIFICANT * noise
        };
        if peaks.len() < MAX_PEAKS && peaks.iter().all(stands_apart) {
            peaks.push(top);
        }
    }
    peaks
}
