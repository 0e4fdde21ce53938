//! A report as a table, and as CSV.

use super::{Report, Row};
use std::fmt;

const HEAD: &str = "setting,knob,value,centroid_bias_mpx,centroid_rms_mpx,photometry_ppm,background_e,frame_rms_e,worst_e,p50_ms,p99_ms,is_front,beaten_by";

impl Report {
    /// Comma-separated values, one line per setting.
    pub fn csv(&self) -> String {
        let line = |row: &Row| {
            let errors = &row.errors;
            let value = row.value.map_or(String::new(), |value| value.to_string());
            format!(
                "{},{},{value},{:e},{:e},{:e},{:e},{:e},{:e},{:.4},{:.4},{},{}\n",
                row.setting,
                row.tolerance.unwrap_or_default(),
                errors.centroid_bias_mpx,
                errors.centroid_rms_mpx,
                errors.photometry_ppm,
                errors.background_e,
                errors.frame_rms_e,
                errors.worst_e,
                row.p50_ms,
                row.p99_ms,
                row.is_front,
                row.beaten_by.as_deref().unwrap_or_default()
            )
        };
        let lines: String = self.rows.iter().map(line).collect();
        format!("{HEAD}\n{lines}")
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}; {}: errors of {} frames against reference, times of {} rounds",
            self.machine, self.camera, self.frames, self.rounds
        )?;
        writeln!(
            f,
            "\n{:<24}{:>9}{:>9}{:>11}{:>12}{:>10}{:>10}{:>9}{:>9}  ",
            "setting",
            "bias",
            "rms",
            "photometry",
            "background",
            "frame rms",
            "worst",
            "p50",
            "p99"
        )?;
        writeln!(
            f,
            "{:<24}{:>9}{:>9}{:>11}{:>12}{:>10}{:>10}{:>9}{:>9}",
            "", "mpx", "mpx", "ppm", "e-", "e-", "e-", "ms", "ms"
        )?;
        for row in &self.rows {
            let errors = &row.errors;
            let mark = match (&row.beaten_by, row.is_front) {
                (Some(other), _) => format!("beaten by {other}"),
                (None, true) => "front".to_string(),
                (None, false) => String::new(),
            };
            let line = format!(
                "{:<24}{:>9}{:>9}{:>11}{:>12}{:>10}{:>10}{:>9.2}{:>9.2}  {mark}",
                row.setting,
                three_digits(errors.centroid_bias_mpx),
                three_digits(errors.centroid_rms_mpx),
                three_digits(errors.photometry_ppm),
                three_digits(errors.background_e),
                three_digits(errors.frame_rms_e),
                three_digits(errors.worst_e),
                row.p50_ms,
                row.p99_ms
            );
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

/// A number of any size with three digits.
fn three_digits(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_string(),
        size if !(1e-3..1e5).contains(&size) => format!("{value:.1e}"),
        size => {
            let before = libm::log10(size).floor() as i32;
            let after = (2 - before).max(0) as usize;
            format!("{value:.after$}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Machine;
    use crate::cost::row::rows;
    use crate::cost::{Sums, settings};

    #[test]
    fn numbers_have_three_digits() {
        let texts = [0.0, 0.05, 12.345, 123.4, 12_345.6, 1.2e-7, -0.5].map(three_digits);
        assert_eq!(
            texts,
            ["0", "0.0500", "12.3", "123", "12346", "1.2e-7", "-0.500"]
        );
    }

    #[test]
    fn lines_have_as_many_values_as_the_header() {
        let settings = settings();
        let count = settings.len();
        let report = Report {
            camera: "none".to_string(),
            frames: 1,
            rounds: 1,
            machine: Machine::this(),
            rows: rows(
                settings,
                &vec![Sums::default(); count],
                &vec![vec![1.0]; count],
            ),
        };
        let csv = report.csv();
        assert_eq!(csv.lines().count(), count + 1);
        for line in csv.lines() {
            assert_eq!(line.split(',').count(), HEAD.split(',').count(), "{line}");
        }
        for row in &report.rows {
            assert!(report.to_string().contains(&row.setting), "{}", row.setting);
        }
    }
}
