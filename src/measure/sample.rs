//! The times of a measurement's rounds, and their quantiles.

/// A time.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Cost {
    /// Median, ms on one core.
    pub ms: f64,
    /// Its standard error by the spread of the rounds, ms.
    pub error_ms: f64,
}

/// Values in rising order.
pub(super) struct Sample(Vec<f64>);

impl Sample {
    pub fn new(values: impl IntoIterator<Item = f64>) -> Sample {
        let mut values = Vec::from_iter(values);
        values.sort_by(f64::total_cmp);
        Sample(values)
    }

    /// Quantile by nearest rank; NaN without values.
    pub fn quantile(&self, part: f64) -> f64 {
        let rank = (part * self.0.len() as f64).ceil() as usize;
        let at = self.0.get(rank.saturating_sub(1));
        at.copied().unwrap_or(f64::NAN)
    }

    /// The median, and its standard error from the quartiles: in a normal distribution they are
    /// 1.35 standard deviations apart, and the median's error is 1.25 times the mean's.
    pub fn median(&self) -> Cost {
        let deviation = (self.quantile(0.75) - self.quantile(0.25)) / 1.35;
        Cost {
            ms: self.quantile(0.5),
            error_ms: 1.25 * deviation / (self.0.len() as f64).sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_independent_of_the_order() {
        let of = |values: &[f64], parts: &[f64]| -> Vec<f64> {
            let sample = Sample::new(values.iter().copied());
            parts.iter().map(|part| sample.quantile(*part)).collect()
        };
        // X-Val: by hand.
        let parts = [0.0, 0.25, 0.5, 0.75, 1.0];
        let five = of(&[30.0, 10.0, 50.0, 20.0, 40.0], &parts);
        assert_eq!(five, [10.0, 20.0, 30.0, 40.0, 50.0]);
        let hundred: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!(of(&hundred, &[0.5, 0.99]), [50.0, 99.0]);
        assert_eq!(of(&hundred[..10], &[0.99]), [10.0]);
        assert!(of(&[], &[0.5])[0].is_nan());
    }

    #[test]
    fn error_of_the_median_follows_from_the_quartiles() {
        // X-Val: by hand: quartiles 2 and 6 of eight values.
        let Cost { ms, error_ms } = Sample::new((1..=8).map(f64::from)).median();
        assert_eq!(ms, 4.0);
        assert!((error_ms - 1.25 * 4.0 / 1.35 / 8f64.sqrt()).abs() < 1e-12);
    }
}
