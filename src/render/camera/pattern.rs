//! The fixed pattern of a detector: manufacturing differences of its pixels, equal in every frame.
//!
//! Its only key is the camera's serial number, not the run's seed; threads and platform do not
//! change it. Per pixel:
//!
//! ```text
//! response  g = max(0, 1 + prnu N(0, 1))                          mean 1, EMVA 1288 rel. 4.0
//! dark      d = dark exp(s N(0, 1) - s^2 / 2) + excess            s^2 = ln(1 + sigma^2)
//! excess      = -hot ln U with probability hot_fraction, else 0   exponential, mean `hot`
//! ```
//!
//! The mean of the lognormal factor is 1.
//!
//! Dark currents have a skewed, near lognormal distribution with a tail of hot pixels (Baer 2006,
//! Proc. SPIE 6068, 606805). The excess from displacement damage is assumed exponential, after the
//! tails of irradiated sensors (Virmontois et al. 2010, IEEE TNS 57, 3101).

use skyloop_base::range::nearest;
use skyloop_base::rng::{NoiseKey, PixelStream};
use std::fmt;

/// Statistics of a pattern. Currents hold at the detector's temperature.
#[derive(Debug, Clone, PartialEq)]
pub struct PatternStats {
    /// The camera's serial number.
    pub serial: u64,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Sigma of the relative response (1).
    pub prnu: f64,
    /// Mean dark current of a pixel without hot pixels, e-/s.
    pub dark_e_s: f64,
    /// Sigma of the relative dark current (1).
    pub dark_nonuniformity: f64,
    /// Share of the pixels that are hot (1).
    pub hot_fraction: f64,
    /// Mean excess of a hot pixel, e-/s.
    pub hot_e_s: f64,
    /// Share of the pixels that are dead (1).
    pub dead_fraction: f64,
    /// Further dead pixels, `[column, row]`.
    pub dead_px: Vec<[u32; 2]>,
    /// Share of the pixels that are stuck (1).
    pub stuck_fraction: f64,
    /// Further stuck pixels, `[column, row]`.
    pub stuck_px: Vec<[u32; 2]>,
}

/// The pattern. Maps without differences stay empty. Pixels by row-major index.
#[derive(Clone, PartialEq, Default)]
pub struct Pattern {
    /// Relative response of every pixel (1); empty: 1 everywhere.
    response: Vec<f32>,
    /// Dark current of every pixel, e-/s; empty: the same everywhere.
    dark_e_s: Vec<f32>,
    /// Hot pixels in order, with their excess, e-/s.
    hot: Vec<(u32, f32)>,
    /// Dead pixels in order.
    dead: Vec<u32>,
    /// Stuck pixels in order.
    stuck: Vec<u32>,
    /// Largest `|response - 1|` (1).
    worst_response: f64,
    /// Dark current, e-/s: minimum, mean and maximum.
    dark_min_e_s: f64,
    dark_mean_e_s: f64,
    dark_max_e_s: f64,
    /// Dark current of the hottest pixel of each column; empty: the same everywhere.
    hottest_e_s: Vec<f32>,
}

/// Random streams of the pattern, distinct from those of a frame's effects.
const RESPONSE: u8 = 240;
const DARK: u8 = 241;
const HOT: u8 = 242;
const DEAD: u8 = 243;
const STUCK: u8 = 244;

impl PatternStats {
    /// The same, with every number limited to 0 to 1e30: single precision holds it.
    fn bounded(&self) -> PatternStats {
        const MAX: f64 = 1e30;
        let bounded = |value: f64| nearest(value, 0.0..=MAX);
        PatternStats {
            prnu: bounded(self.prnu),
            dark_e_s: bounded(self.dark_e_s),
            dark_nonuniformity: bounded(self.dark_nonuniformity),
            hot_fraction: bounded(self.hot_fraction),
            hot_e_s: bounded(self.hot_e_s),
            dead_fraction: bounded(self.dead_fraction),
            stuck_fraction: bounded(self.stuck_fraction),
            ..self.clone()
        }
    }
}

impl Pattern {
    /// Draws the pattern. Statistics are limited to 0 to 1e30; NaN counts as 0.
    pub fn new(stats: &PatternStats) -> Pattern {
        let stats = &stats.bounded();
        let pixels = (stats.width * stats.height) as u32;
        let key = NoiseKey {
            seed: stats.serial,
            sequence: 0,
            repeat: 0,
        };
        let chosen = |stream: u8, fraction: f64, listed: &[[u32; 2]]| {
            let mut chosen: Vec<u32> = listed
                .iter()
                .map(|[column, row]| row * stats.width as u32 + column)
                .collect();
            if fraction > 0.0 {
                let drawn = |pixel: &u32| PixelStream::new(key, stream, *pixel).uniform();
                chosen.extend((0..pixels).filter(|pixel| drawn(pixel) < fraction));
            }
            chosen.sort_unstable();
            chosen.dedup();
            chosen
        };
        let response: Vec<f32> = (0..if stats.prnu > 0.0 { pixels } else { 0 })
            .map(|pixel| {
                let draw = PixelStream::new(key, RESPONSE, pixel).normal();
                (1.0 + stats.prnu * draw).max(0.0) as f32
            })
            .collect();
        let hot: Vec<(u32, f32)> = if stats.hot_e_s > 0.0 {
            chosen(HOT, stats.hot_fraction, &[])
                .into_iter()
                .map(|pixel| {
                    let mut stream = PixelStream::new(key, HOT, pixel);
                    // The first number selected the pixel.
                    stream.uniform();
                    let excess = -stats.hot_e_s * libm::log(stream.uniform());
                    (pixel, excess as f32)
                })
                .collect()
        } else {
            Vec::new()
        };
        let dark_e_s = dark_map(stats, key, pixels, &hot);
        let mean = dark_e_s.iter().map(|d| f64::from(*d)).sum::<f64>() / f64::from(pixels.max(1));
        let uniform = dark_e_s.is_empty();
        let coldest = dark_e_s.iter().copied().reduce(f32::min);
        let mut hottest_e_s = vec![0.0f32; if uniform { 0 } else { stats.width }];
        for row in dark_e_s.chunks(stats.width.max(1)) {
            let columns = hottest_e_s.iter_mut().zip(row);
            columns.for_each(|(max, dark)| *max = max.max(*dark));
        }
        let max = hottest_e_s.iter().copied().fold(0.0, f32::max);
        Pattern {
            worst_response: response
                .iter()
                .map(|g| (f64::from(*g) - 1.0).abs())
                .fold(0.0, f64::max),
            dark_min_e_s: coldest.map_or(stats.dark_e_s, f64::from),
            dark_mean_e_s: if uniform { stats.dark_e_s } else { mean },
            dark_max_e_s: if uniform { stats.dark_e_s } else { max.into() },
            dead: chosen(DEAD, stats.dead_fraction, &stats.dead_px),
            stuck: chosen(STUCK, stats.stuck_fraction, &stats.stuck_px),
            response,
            dark_e_s,
            hottest_e_s,
            hot,
        }
    }

    /// Relative response of every pixel, row-major (1); none if all are equal.
    pub(crate) fn response(&self) -> Option<&[f32]> {
        (!self.response.is_empty()).then_some(&self.response)
    }

    /// Relative response of one pixel (1).
    pub fn response_of(&self, pixel: usize) -> f64 {
        self.response.get(pixel).map_or(1.0, |g| f64::from(*g))
    }

    /// Largest `|response - 1|` (1).
    pub fn worst_response(&self) -> f64 {
        self.worst_response
    }

    /// Dark current of every pixel, row-major, with hot pixels, e-/s; none if all are equal.
    pub(crate) fn dark_e_s(&self) -> Option<&[f32]> {
        (!self.dark_e_s.is_empty()).then_some(&self.dark_e_s)
    }

    /// Dark current of one pixel, e-/s.
    pub fn dark_e_s_of(&self, pixel: usize) -> f64 {
        self.dark_e_s
            .get(pixel)
            .map_or(self.dark_mean_e_s, |d| f64::from(*d))
    }

    /// Dark current of the coldest pixel, e-/s.
    pub(crate) fn dark_min_e_s(&self) -> f64 {
        self.dark_min_e_s
    }

    /// Mean dark current, with hot pixels, e-/s.
    pub fn dark_mean_e_s(&self) -> f64 {
        self.dark_mean_e_s
    }

    /// Dark current of the hottest pixel, e-/s.
    pub fn dark_max_e_s(&self) -> f64 {
        self.dark_max_e_s
    }

    /// Dark current of the hottest pixel of a column, e-/s.
    pub(crate) fn dark_max_of_column(&self, column: usize) -> f64 {
        self.hottest_e_s
            .get(column)
            .map_or(self.dark_max_e_s, |d| f64::from(*d))
    }

    /// Hot pixels in order, with their excess, e-/s.
    pub fn hot(&self) -> &[(u32, f32)] {
        &self.hot
    }

    /// Dead pixels in order: they have no charge.
    pub fn dead(&self) -> &[u32] {
        &self.dead
    }

    /// Stuck pixels in order: they have a constant value.
    pub fn stuck(&self) -> &[u32] {
        &self.stuck
    }
}

/// Dark current of every pixel; empty if all are equal.
fn dark_map(stats: &PatternStats, key: NoiseKey, pixels: u32, hot: &[(u32, f32)]) -> Vec<f32> {
    let spread = stats.dark_nonuniformity > 0.0 && stats.dark_e_s > 0.0;
    if !spread && hot.is_empty() {
        return Vec::new();
    }
    let variance = libm::log1p(stats.dark_nonuniformity * stats.dark_nonuniformity);
    let sigma = libm::sqrt(variance);
    let mut map: Vec<f32> = (0..pixels)
        .map(|pixel| {
            if !spread {
                return stats.dark_e_s as f32;
            }
            let draw = PixelStream::new(key, DARK, pixel).normal();
            (stats.dark_e_s * libm::exp(sigma * draw - variance / 2.0)) as f32
        })
        .collect();
    for (pixel, excess) in hot {
        map[*pixel as usize] += excess;
    }
    map
}

impl fmt::Debug for Pattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (hot, dead, stuck) = (self.hot.len(), self.dead.len(), self.stuck.len());
        write!(f, "Pattern({hot} hot, {dead} dead, {stuck} stuck)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: PatternStats = PatternStats {
        serial: 7,
        width: 500,
        height: 400,
        prnu: 0.0,
        dark_e_s: 40.0,
        dark_nonuniformity: 0.0,
        hot_fraction: 0.0,
        hot_e_s: 0.0,
        dead_fraction: 0.0,
        dead_px: Vec::new(),
        stuck_fraction: 0.0,
        stuck_px: Vec::new(),
    };
    const N: f64 = 200_000.0;

    fn mean_and_sigma(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
        let n = values.clone().count() as f64;
        let mean = values.clone().sum::<f64>() / n;
        (
            mean,
            (values.map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt(),
        )
    }

    #[test]
    fn maps_without_differences_are_not_made() {
        let pattern = Pattern::new(&PLAIN);
        assert!(pattern.response().is_none() && pattern.dark_e_s().is_none());
        assert!(pattern.hot().is_empty() && pattern.dead().is_empty());
        assert_eq!(
            [
                pattern.dark_min_e_s(),
                pattern.dark_mean_e_s(),
                pattern.dark_max_e_s()
            ],
            [40.0; 3]
        );
        assert_eq!(
            (pattern.response_of(9), pattern.dark_e_s_of(9)),
            (1.0, 40.0)
        );
    }

    #[test]
    fn response_and_dark_current_have_the_configured_moments() {
        let (prnu, spread, share, hot_e_s) = (0.02, 0.4, 0.01, 900.0);
        let pattern = Pattern::new(&PatternStats {
            prnu,
            dark_nonuniformity: spread,
            hot_fraction: share,
            hot_e_s,
            ..PLAIN
        });
        let (mean, sigma) =
            mean_and_sigma(pattern.response().unwrap().iter().map(|g| f64::from(*g)));
        assert!((mean - 1.0).abs() < 5.0 * prnu / N.sqrt(), "{mean}");
        assert!((sigma / prnu - 1.0).abs() < 5.0 / (2.0 * N).sqrt());
        let worst = pattern.response().unwrap().iter();
        let worst = worst.fold(0.0, |a: f64, g| a.max((f64::from(*g) - 1.0).abs()));
        assert_eq!(pattern.worst_response(), worst);

        let count = pattern.hot().len() as f64;
        assert!((count - share * N).abs() < 5.0 * (share * N).sqrt());
        let (excess, scatter) = mean_and_sigma(pattern.hot().iter().map(|(_, e)| f64::from(*e)));
        // Mean and sigma of an exponential are the same; its kurtosis is 9.
        assert!((excess / hot_e_s - 1.0).abs() < 5.0 / count.sqrt());
        assert!((scatter / hot_e_s - 1.0).abs() < 5.0 * (2.0 / count).sqrt());

        let is_hot = |i: &usize| {
            pattern
                .hot()
                .binary_search_by_key(&(*i as u32), |h| h.0)
                .is_ok()
        };
        let cool = (0..N as usize).filter(|i| !is_hot(i));
        let (dark, width) = mean_and_sigma(cool.map(|i| pattern.dark_e_s_of(i)));
        assert!((dark / 40.0 - 1.0).abs() < 5.0 * spread / N.sqrt());
        // The lognormal's kurtosis at 0.4 is 6.3: its sigma scatters by sqrt((k - 1) / 4 n).
        assert!((width / 40.0 / spread - 1.0).abs() < 5.0 * (5.3 / 4.0 / N).sqrt());
        let hottest = (0..N as usize).map(|i| pattern.dark_e_s_of(i));
        assert_eq!(pattern.dark_max_e_s(), hottest.clone().fold(0.0, f64::max));
        assert_eq!(pattern.dark_min_e_s(), hottest.fold(f64::MAX, f64::min));
    }

    #[test]
    fn pattern_depends_on_the_serial_number() {
        let stats = PatternStats {
            prnu: 0.3,
            dead_fraction: 0.001,
            stuck_fraction: 0.002,
            dead_px: vec![[499, 399], [0, 0]],
            stuck_px: vec![[3, 1]],
            ..PLAIN
        };
        let pattern = Pattern::new(&stats);
        assert_eq!(pattern, Pattern::new(&stats));
        let other = Pattern::new(&PatternStats { serial: 8, ..stats });
        assert_ne!(pattern.response(), other.response());
        assert_ne!(pattern.dead(), other.dead());
        // Listed pixels are always included.
        for pattern in [&pattern, &other] {
            assert!(
                [0, 199_999]
                    .iter()
                    .all(|pixel| pattern.dead().contains(pixel))
            );
            assert!(pattern.stuck().contains(&503));
            assert!(pattern.dead().is_sorted() && pattern.stuck().is_sorted());
            assert!((100..300).contains(&pattern.dead().len()));
            assert!((300..500).contains(&pattern.stuck().len()));
            // Clipped at 0: no pixel has a negative response.
            assert!(pattern.response().unwrap().iter().all(|g| *g >= 0.0));
            assert!(pattern.response().unwrap().contains(&0.0));
        }
    }
}
