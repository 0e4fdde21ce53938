//! Two pieces of work timed alternately, so that other load on the machine affects both alike.

use super::sample::Sample;
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::Serialize;
use skyloop_base::load::ConfigError;
use skyloop_live::host;
use skyloop_orbit::sgp4_batch::Level;
use std::fmt;
use std::time::Instant;

/// Nanoseconds per millisecond: the divisor of rows in ms.
pub(super) const MS: usize = 1_000_000;

/// Measurements of one run.
pub trait Report: Serialize + fmt::Display + Sized {
    /// Number of parts of [`Report::measure`].
    const PARTS: u32;

    /// Measures; `on_part` is called at the start of each part.
    ///
    /// Errors: the built-in scene or a built-in camera cannot be read.
    fn measure(on_part: impl FnMut(&str)) -> Result<Self, ConfigError>;

    /// The limits that are not met, one per line.
    fn broken(&self) -> Vec<String>;
}

/// The machine, as in reports.
#[derive(Debug, Clone, Serialize)]
pub struct Machine {
    /// The processor, as the system names it.
    pub cpu: String,
    /// Number of threads available to the process.
    pub threads: usize,
    /// Its load over the last minute, before the measurement.
    pub load: Option<f64>,
    /// Vector instructions.
    pub level: String,
}

impl Machine {
    /// This machine, now.
    pub fn this() -> Machine {
        Machine {
            cpu: host::processor(),
            threads: rayon::current_num_threads(),
            load: host::load().map(|[minute, _]| minute),
            level: Level::best().to_string(),
        }
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let load = self
            .load
            .map_or("unknown".to_string(), |load| format!("{load:.2}"));
        let Machine {
            cpu,
            threads,
            level,
            ..
        } = self;
        write!(f, "{cpu}, {threads} threads, load {load}, {level}")
    }
}

/// Comparison of two pieces of work.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// The work.
    pub work: String,
    /// The work that it is compared with.
    pub against: &'static str,
    /// Median, in the unit of its table.
    pub time: f64,
    /// Median of the other.
    pub against_time: f64,
    /// Median over the rounds of `against_time` / `time`.
    pub ratio: f64,
    /// The first and third quartile of the ratios.
    pub spread: [f64; 2],
    /// Required minimum of the ratio, if it has one.
    pub least: Option<f64>,
    /// Permitted maximum, if there is one; then the ratio is inverse: `time` / `against_time`.
    pub most: Option<f64>,
}

impl Row {
    /// Whether the ratio is within its limits.
    pub(crate) fn is_met(&self) -> bool {
        self.least.is_none_or(|least| self.ratio >= least)
            && self.most.is_none_or(|most| self.ratio <= most)
    }

    /// The same with the inverse ratio, which is at most `most`.
    pub(super) fn at_most(self, most: f64) -> Row {
        let [low, high] = self.spread;
        Row {
            ratio: 1.0 / self.ratio,
            spread: [1.0 / high, 1.0 / low],
            least: None,
            most: Some(most),
            ..self
        }
    }

    fn limit(&self) -> Option<String> {
        let least = self.least.map(|least| format!(">= {least}"));
        least.or(self.most.map(|most| format!("<= {most}")))
    }

    /// A line about a limit that is not met.
    pub fn broken(&self) -> Option<String> {
        let limit = self.limit().filter(|_| !self.is_met())?;
        Some(format!(
            "{}: {:.1} x is not {limit} x",
            self.work, self.ratio
        ))
    }

    /// Header of rows whose times are in `unit`, such as `ns an object`.
    pub(super) fn head(unit: &str) -> String {
        format!(
            "{:<38}{unit:>14}  {:<26}{:>9}{:>9}  {:<14}{:>8}",
            "work", "against", "", "ratio", "quartiles", "promised"
        )
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let limit = self.limit().unwrap_or_default();
        let spread = format!("{:.1} to {:.1}", self.spread[0], self.spread[1]);
        write!(
            f,
            "{:<38}{:>14.2}  {:<26}{:>9.1}{:>7.1} x  {spread:<14}{limit:>8}{}",
            self.work,
            self.time,
            self.against,
            self.against_time,
            self.ratio,
            mark(self.is_met())
        )
    }
}

pub(super) fn mark(is_met: bool) -> &'static str {
    if is_met { "" } else { "  NOT met" }
}

pub(super) fn with_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    match ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(work),
        Err(_) => work(),
    }
}

/// Pools of two threads and of one; none if the system refuses threads.
pub(super) fn pools() -> Option<[ThreadPool; 2]> {
    let pool = |threads| ThreadPoolBuilder::new().num_threads(threads).build();
    Some([pool(2).ok()?, pool(1).ok()?])
}

pub(super) fn ns(work: impl FnOnce()) -> f64 {
    let started = Instant::now();
    work();
    started.elapsed().as_nanos() as f64
}

/// Times two pieces of work alternately, `rounds` times. Each time in ns is divided by its `of`: a
/// number of objects, or the ns of a unit.
pub(super) fn row(
    work: String,
    against: &'static str,
    least: Option<f64>,
    rounds: usize,
    of: [usize; 2],
    mut ours: impl FnMut(usize),
    mut theirs: impl FnMut(usize),
) -> Row {
    let times = (0..rounds).map(|round| {
        [
            ns(|| ours(round)) / of[0] as f64,
            ns(|| theirs(round)) / of[1] as f64,
        ]
    });
    row_of(work, against, least, times.collect())
}

fn row_of(
    work: String,
    against: &'static str,
    least: Option<f64>,
    mut times: Vec<[f64; 2]>,
) -> Row {
    // In the first rounds caches are filled and processor clocks rise.
    times.drain(..times.len() / 5);
    let of = |figure: fn(&[f64; 2]) -> f64| Sample::new(times.iter().map(figure));
    let ratio = of(|[ours, theirs]| theirs / ours);
    Row {
        work,
        against,
        time: of(|round| round[0]).quantile(0.5),
        against_time: of(|round| round[1]).quantile(0.5),
        ratio: ratio.quantile(0.5),
        spread: [0.25, 0.75].map(|part| ratio.quantile(part)),
        least,
        most: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(ratio: f64, least: Option<f64>, most: Option<f64>) -> Row {
        Row {
            work: "stars".to_string(),
            against: "sand",
            time: 3.0,
            against_time: 3.0 * ratio,
            ratio,
            spread: [ratio / 2.0, ratio * 2.0],
            least,
            most,
        }
    }

    #[test]
    fn limit_is_met_up_to_its_value() {
        for (ratio, least, most, is_met) in [
            (8.0, Some(8.0), None, true),
            (7.99, Some(8.0), None, false),
            (800.0, Some(8.0), None, true),
            (4.0, None, Some(4.0), true),
            (4.01, None, Some(4.0), false),
            (0.1, None, Some(4.0), true),
            (0.1, None, None, true),
            (f64::NAN, Some(8.0), None, false),
            (f64::NAN, None, Some(4.0), false),
        ] {
            let row = of(ratio, least, most);
            assert_eq!(row.is_met(), is_met, "{ratio} {least:?} {most:?}");
            assert_eq!(row.broken().is_none(), is_met, "{ratio} {least:?} {most:?}");
            assert_eq!(row.to_string().ends_with("NOT met"), !is_met);
        }
    }

    #[test]
    fn missed_limit_names_work_ratio_and_limit() {
        let broken = |least, most| of(5.0, least, most).broken();
        assert_eq!(
            broken(Some(8.0), None).as_deref(),
            Some("stars: 5.0 x is not >= 8 x")
        );
        assert_eq!(
            broken(None, Some(4.0)).as_deref(),
            Some("stars: 5.0 x is not <= 4 x")
        );
    }

    #[test]
    fn at_most_inverts_the_ratio_and_its_quartiles() {
        let row = of(0.5, Some(9.0), None).at_most(4.0);
        // X-Val: by hand, of 0.5 with quartiles 0.25 and 1.
        assert_eq!((row.ratio, row.spread), (2.0, [1.0, 4.0]));
        assert_eq!((row.least, row.most), (None, Some(4.0)));
        // The times do not change.
        assert_eq!((row.time, row.against_time), (3.0, 1.5));
        assert!(row.is_met());
        assert!(!of(0.2, None, None).at_most(4.0).is_met());
    }

    #[test]
    fn both_works_run_and_are_timed_in_every_round() {
        // Each work counts its calls and sleeps for its time.
        let (mut ours, mut theirs) = (0, 0);
        let sleep = |ms| std::thread::sleep(std::time::Duration::from_millis(ms));
        let row = row(
            "stars".to_string(),
            "sand",
            Some(1.5),
            10,
            [1_000_000, 500_000],
            |_| {
                ours += 1;
                sleep(2);
            },
            |_| {
                theirs += 1;
                sleep(4);
            },
        );
        assert_eq!((ours, theirs), (10, 10));
        // X-Val: sleeps are never shorter: 2 ns for each of a million, 8 ns for each of half as
        // many.
        assert!(row.time >= 2.0 && row.against_time >= 8.0, "{row}");
        assert_eq!((row.least, row.most), (Some(1.5), None));
    }

    #[test]
    fn row_has_medians_and_quartiles_after_the_warm_up() {
        let later = [[2.0, 8.0], [1.0, 5.0], [4.0, 12.0], [2.0, 4.0], [3.0, 3.0]];
        let times = [vec![[1e9, 1.0]], later.to_vec()].concat();
        let row = row_of("stars".to_string(), "sand", None, times);
        // X-Val: by hand: ratios of 4, 5, 3, 2 and 1.
        assert_eq!((row.time, row.against_time), (2.0, 5.0));
        assert_eq!((row.ratio, row.spread), (3.0, [2.0, 4.0]));
    }
}
