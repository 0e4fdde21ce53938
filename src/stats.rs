//! What a run measured: times as percentiles, counts, and the table at its end.

use crate::engine::Shot;
use std::collections::BTreeSet;
use std::time::Duration;

/// Durations of one kind.
#[derive(Debug, Clone, Default)]
pub struct Times(Vec<Duration>);

impl Times {
    /// Adds one.
    pub fn add(&mut self, time: Duration) {
        self.0.push(time);
    }

    /// The `p`-th quantile (0..1) by nearest rank, ms; none without a sample.
    pub fn quantile_ms(&self, p: f64) -> Option<f64> {
        let mut sorted = self.0.clone();
        sorted.sort_unstable();
        let rank = (p * sorted.len() as f64).ceil() as usize;
        sorted
            .get(rank.max(1) - 1)
            .map(|time| time.as_secs_f64() * 1e3)
    }
}

/// What was rendered.
#[derive(Debug, Clone, Default)]
pub struct RunStats {
    /// Frames.
    pub frames: u32,
    /// From the vehicle's state to pixels and label.
    pub render: Times,
    /// From the attitude's arrival to its last packet on the link.
    pub answer: Times,
    /// Stars labelled, summed over the frames.
    pub stars: usize,
    /// RSOs labelled, summed over the frames.
    pub rsos: usize,
    /// RSOs visible, summed over the frames.
    pub rsos_visible: usize,
}

impl RunStats {
    /// Books one shot.
    pub fn add(&mut self, shot: &Shot) {
        self.frames += 1;
        self.render.add(shot.render_time);
        for object in &shot.label.objects {
            if object.rso.is_none() {
                self.stars += 1;
            } else {
                self.rsos += 1;
                self.rsos_visible += usize::from(object.visible);
            }
        }
    }

    /// The rows that every run's table starts with.
    pub fn rows(&self) -> Vec<(String, String)> {
        let per_frame = |n: usize| n as f64 / f64::from(self.frames.max(1));
        let mut rows = vec![
            row("frames", self.frames.to_string()),
            row(
                "render time p50 / p99 / max",
                times(&self.render, &[0.5, 0.99, 1.0]),
            ),
        ];
        rows.push(row(
            "stars labelled",
            format!("{} ({:.0} a frame)", self.stars, per_frame(self.stars)),
        ));
        rows.push(row(
            "RSOs labelled",
            format!("{} ({} visible)", self.rsos, self.rsos_visible),
        ));
        rows
    }
}

/// Objects that could not be shown because their orbit had no state at a frame.
#[derive(Debug, Clone, Default)]
pub struct Absent {
    /// How many, summed over the frames.
    pub count: u32,
    named: BTreeSet<String>,
}

impl Absent {
    /// Objects that are named in the log; of more, only their number.
    const NAMED: usize = 5;

    /// Counts those of a shot, and names each in the log once.
    pub fn report(&mut self, shot: &Shot) {
        self.count = self.count.wrapping_add(shot.unknown.len() as u32);
        let mut more = 0;
        for error in &shot.unknown {
            if !self.named.insert(error.object().to_string()) {
                continue;
            }
            if self.named.len() <= Self::NAMED {
                tracing::warn!("frame {}: not shown: {error}", shot.number);
            } else {
                more += 1;
            }
        }
        if more > 0 {
            tracing::warn!(
                "frame {}: {more} more objects have no state and are not shown",
                shot.number
            );
        }
    }
}

/// A row of a table.
pub fn row(name: &str, value: String) -> (String, String) {
    (name.to_string(), value)
}

/// Quantiles as text: `1.23 / 4.56 ms`.
pub fn times(times: &Times, quantiles: &[f64]) -> String {
    let values: Option<Vec<String>> = quantiles
        .iter()
        .map(|p| times.quantile_ms(*p).map(|ms| format!("{ms:.2}")))
        .collect();
    values.map_or("none".to_string(), |values| {
        format!("{} ms", values.join(" / "))
    })
}

/// Rows as text, the names in one column.
pub fn table(rows: &[(String, String)]) -> String {
    let width = rows
        .iter()
        .map(|(name, _)| name.chars().count())
        .max()
        .unwrap_or(0);
    rows.iter()
        .map(|(name, value)| format!("  {name:width$}  {value}\n"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_nearest_rank() {
        let mut times = Times::default();
        assert_eq!(times.quantile_ms(0.5), None);
        for ms in (1..=100).rev() {
            times.add(Duration::from_millis(ms));
        }
        let at = |p| times.quantile_ms(p).unwrap();
        assert_eq!(
            (at(0.0), at(0.5), at(0.99), at(1.0)),
            (1.0, 50.0, 99.0, 100.0)
        );
    }
}
