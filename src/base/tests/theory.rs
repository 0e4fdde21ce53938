//! Poisson's distribution by its formula.

/// Poisson's probabilities from `first` on, until less than 10^-17 remains.
pub struct Theory {
    pub first: usize,
    pub probability: Vec<f64>,
}

impl Theory {
    pub fn of(mean: f32) -> Theory {
        let mean = f64::from(mean);
        let reach = 9.0 * mean.sqrt() + 40.0;
        let (first, last) = ((mean - reach).max(0.0) as usize, (mean + reach) as usize);
        // P(k) = exp(k ln m - m - ln k!), scaled to 1: large means lose the exponent's last digits.
        let log = |k: usize| k as f64 * mean.ln() - mean - libm::lgamma(k as f64 + 1.0);
        let mut probability: Vec<f64> = (first..=last).map(|k| log(k).exp()).collect();
        let all: f64 = probability.iter().sum();
        let lost = 4.0 * f64::EPSILON * mean * (mean + 3.0).ln();
        assert!((all - 1.0).abs() < 1e-12 + lost, "{mean}: {all}");
        probability.iter_mut().for_each(|p| *p /= all);
        Theory { first, probability }
    }
}
