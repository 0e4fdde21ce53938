//! A setting's errors and times, and its rank among the others.

use super::errors::{Errors, Sums};
use super::setting::Setting;
use crate::sample::Sample;
use serde::Serialize;
use skyloop_render::fidelity::{Fidelity, Value};

/// A measured setting.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The preset's name, or the changed tolerance and its value.
    pub setting: String,
    /// The tolerance that differs from `realtime`.
    #[serde(rename = "knob")]
    pub tolerance: Option<&'static str>,
    /// Its value.
    pub value: Option<Value>,
    /// All its tolerances.
    #[serde(skip)]
    pub fidelity: Fidelity,
    /// Its errors.
    #[serde(flatten)]
    pub errors: Errors,
    /// Median of the times of its frames, ms.
    pub p50_ms: f64,
    /// 99th percentile of these times, ms; for fewer than 100 rounds the maximum.
    pub p99_ms: f64,
    /// Whether it is on the Pareto front: no other is as fast and as accurate, except by chance.
    pub is_front: bool,
    /// A faster and more accurate setting, by more than chance.
    pub beaten_by: Option<String>,
}

impl Row {
    /// Whether the errors of pixels equal those of another setting.
    pub fn is_alike(&self, other: &Row) -> bool {
        !is_closer(&self.errors, &other.errors) && !is_closer(&other.errors, &self.errors)
    }
}

/// Smaller differences of errors are rounding: relative, and in electrons.
const ROUNDING: [f64; 2] = [1e-3, 1e-6];
/// Significant differences of times: in standard errors, and relative to the time.
const SIGMAS: f64 = 3.0;
const SMALL: f64 = 0.01;

/// The rows of `settings`, with their summed errors and their frame times (ms) by round.
pub(crate) fn rows(settings: Vec<Setting>, sums: &[Sums], times: &[Vec<f64>]) -> Vec<Row> {
    let row = |((setting, sums), times): ((Setting, &Sums), &Vec<f64>)| {
        let sample = Sample::new(times.iter().copied());
        let (tolerance, value) = setting.moved.unzip();
        Row {
            setting: setting.name,
            tolerance,
            value,
            fidelity: setting.fidelity,
            errors: sums.errors(),
            p50_ms: sample.quantile(0.5),
            p99_ms: sample.quantile(0.99),
            is_front: false,
            beaten_by: None,
        }
    };
    let mut rows: Vec<Row> = settings.into_iter().zip(sums).zip(times).map(row).collect();
    let front = front(&rows, times);
    let beaten: Vec<Option<String>> = (0..rows.len())
        .map(|i| {
            let better = |j: &usize| {
                is_closer(&rows[*j].errors, &rows[i].errors) && is_faster(&times[*j], &times[i])
            };
            // Of several, the one closest to the reference.
            let all = (0..rows.len()).filter(better);
            let rms = |j: &usize| rows[*j].errors.frame_rms_e;
            let best = all.min_by(|a, b| rms(a).total_cmp(&rms(b)));
            best.map(|j| rows[j].setting.clone())
        })
        .collect();
    for ((row, is_front), beaten_by) in rows.iter_mut().zip(front).zip(beaten) {
        row.is_front = is_front;
        row.beaten_by = beaten_by;
    }
    rows
}

/// Whether pixels have smaller errors, by more than rounding.
pub(crate) fn is_closer(a: &Errors, b: &Errors) -> bool {
    let [of_size, e] = ROUNDING;
    a.frame_rms_e < b.frame_rms_e * (1.0 - of_size) - e
}

/// Whether frames are faster, by the differences in each round.
fn is_faster(a: &[f64], b: &[f64]) -> bool {
    let min = SMALL * Sample::new(b.iter().copied()).quantile(0.5);
    let by = Sample::new(a.iter().zip(b).map(|(a, b)| b - a)).median();
    by.ms > (SIGMAS * by.error_ms).max(min)
}

/// Which rows are on the Pareto front of time and rms. Of rows that differ only by chance, the
/// first counts.
fn front(rows: &[Row], times: &[Vec<f64>]) -> Vec<bool> {
    let dominates = |j: usize, i: usize| {
        let closer = |a: usize, b: usize| is_closer(&rows[a].errors, &rows[b].errors);
        let faster = |a: usize, b: usize| is_faster(&times[a], &times[b]);
        !closer(i, j) && !faster(i, j) && (j < i || closer(j, i) || faster(j, i))
    };
    (0..rows.len())
        .map(|i| !(0..rows.len()).any(|j| j != i && dominates(j, i)))
        .collect()
}

#[cfg(test)]
pub(super) use tests::made;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::setting::settings;

    /// Rows of the presets with these times (ms) and errors of pixels (e-).
    pub(crate) fn made(of: [(f64, f64); 3]) -> Vec<Row> {
        let presets = settings().into_iter().take(3).collect();
        // 2 % take 1.5 times as long.
        let times = of.map(|(ms, _)| {
            (0..100)
                .map(|i| if i < 2 { 1.5 * ms } else { ms })
                .collect()
        });
        let sums = of.map(|(_, e)| Sums::of_pixels(e));
        rows(presets, &sums, &times)
    }

    #[test]
    fn front_has_undominated_rows_and_one_of_equal_ones() {
        let of = |of| -> Vec<(bool, Option<String>)> {
            let rows = made(of).into_iter();
            rows.map(|row| (row.is_front, row.beaten_by)).collect()
        };
        let (front, same) = ((true, None), (false, None));
        let beaten = (false, Some("realtime".to_string()));
        let all = of([(1.0, 3.0), (2.0, 2.0), (3.0, 0.0)]);
        assert_eq!(all, [front.clone(), front.clone(), front.clone()]);
        let one = of([(2.5, 3.0), (2.0, 2.0), (3.0, 2.0)]);
        assert_eq!(one, [beaten, front.clone(), same.clone()]);
        let twins = of([(2.0, 2.0), (2.001, 2.0), (3.0, 1.0)]);
        assert_eq!(twins, [front.clone(), same, front]);
    }

    #[test]
    fn differences_by_chance_are_not_faster() {
        let times = |by: f64| -> Vec<f64> {
            // X-Val: quartiles 0.5 apart, 40 rounds: a median's standard error is 1.25 * 0.5 / 1.35
            // / 40^(1/2) = 0.07.
            (0..40)
                .map(|i| 10.0 + by + f64::from(i % 4) * 0.25)
                .collect()
        };
        assert!(is_faster(&times(0.0), &times(0.5)));
        assert!(!is_faster(&times(0.0), &times(0.05)));
        let shuffled: Vec<f64> = times(0.0).into_iter().rev().collect();
        assert!(!is_faster(&shuffled, &times(0.1)));
    }
}
