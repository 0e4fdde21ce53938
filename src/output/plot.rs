//! A plot of magnitude against time, bright magnitudes at the top.

use super::chart::{Axis, Chart, Drawn, svg};
use hifitime::{Epoch, Unit};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use skyloop_orbit::time::{utc_duration, utc_text};
use std::io;

/// A curve of the plot.
pub(crate) struct Curve {
    /// Its name on the plot.
    pub name: &'static str,
    /// Its colour.
    pub color: RGBColor,
    /// One value per epoch; the line is broken at missing values.
    pub values: Vec<Option<f64>>,
}

/// Largest absolute magnitude that is drawn. Far above it, rounding makes successive labels equal.
const MAX_MAG: f64 = 1e6;
/// Approximate number of labels per axis.
const TICKS: f64 = 8.0;
/// Steps between the labels of a time axis, s, that divide minutes, hours or days.
const TIME_STEPS: &[f64] = &[
    1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 120.0, 300.0, 600.0, 900.0, 1800.0, 3600.0, 7200.0,
    10_800.0, 21_600.0, 43_200.0, 86_400.0,
];

/// The plot as SVG, with its `curves` in drawing order. `epochs` are in ascending order.
pub(crate) fn magnitudes(title: &str, epochs: &[Epoch], curves: &[Curve]) -> io::Result<String> {
    let start = epochs.first().copied().unwrap_or_default();
    let seconds: Vec<f64> = epochs.iter().map(|t| (*t - start).to_seconds()).collect();
    let span_s = seconds.last().copied().unwrap_or(0.0);
    let (ticks, decimals) = time_ticks(start, span_s);
    // A single instant is in the middle.
    let ends = if span_s > 0.0 { 0.0..span_s } else { -1.0..1.0 };
    let [bright, faint] = range(curves);
    let day = utc_text(start);
    let across = Axis {
        name: &format!("UTC, from {}", day.split('T').next().unwrap_or_default()),
        range: RangedCoordf64::from(ends),
        marks: ticks,
        label: &|s| time_of_day(start + Unit::Second * *s, decimals),
    };
    let range = RangedCoordf64::from(faint..bright);
    let upwards = Axis {
        name: "magnitude",
        marks: range.key_points(TICKS as usize),
        range,
        label: &|mag| format!("{mag:.2}"),
    };
    let names: Vec<_> = curves.iter().map(|one| (one.name, one.color)).collect();
    svg(title, across, upwards, &names, |chart| {
        (curves.iter()).try_for_each(|curve| draw(chart, curve, &seconds))
    })
}

/// Minimum and maximum value with a margin, never equal.
fn range(curves: &[Curve]) -> [f64; 2] {
    let values = curves
        .iter()
        .flat_map(|curve| curve.values.iter().flatten());
    let values = values.filter(|value| is_drawn(**value));
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
        [low.min(*v), high.max(*v)]
    });
    if low > high {
        return [0.0, 1.0];
    }
    let room = (0.05 * (high - low)).max(0.05);
    [low - room, high + room]
}

fn is_drawn(magnitude: f64) -> bool {
    magnitude.abs() <= MAX_MAG
}

/// Joins successive values by lines; a value without neighbours is a dot.
fn draw<X, Y>(chart: &mut Chart<'_, '_, X, Y>, curve: &Curve, seconds: &[f64]) -> Drawn
where
    X: Ranged<ValueType = f64>,
    Y: Ranged<ValueType = f64>,
{
    let style = curve.color.stroke_width(2);
    let points: Vec<_> = seconds
        .iter()
        .copied()
        .zip(
            curve
                .values
                .iter()
                .map(|value| value.filter(|v| is_drawn(*v))),
        )
        .collect();
    let runs = points.split(|(_, value)| value.is_none());
    for run in runs.filter(|run| !run.is_empty()) {
        let run = run.iter().filter_map(|(s, value)| Some((*s, (*value)?)));
        let run: Vec<(f64, f64)> = run.collect();
        let element = match run[..] {
            [alone] => Circle::new(alone, 2, style.filled()).into_dyn(),
            _ => PathElement::new(run, style).into_dyn(),
        };
        chart.draw_series([element])?;
    }
    Ok(())
}

/// The smallest 1, 2 or 5 times a power of ten that is at least `step`.
fn nice(step: f64) -> f64 {
    let power = libm::pow(10.0, libm::log10(step).floor());
    let factor = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|f| f * power >= step * (1.0 - 1e-9));
    factor.unwrap_or(10.0) * power
}

/// The labelled times in seconds after `start`, at full seconds, minutes, hours or days, and the
/// decimals of their seconds.
fn time_ticks(start: Epoch, span_s: f64) -> (Vec<f64>, usize) {
    if span_s <= 0.0 {
        return (vec![0.0], 3);
    }
    let target = span_s / TICKS;
    let step = match TIME_STEPS.iter().find(|step| **step >= target) {
        Some(step) if target > 0.5 => *step,
        Some(_) => nice(target),
        None => nice(target / 86_400.0) * 86_400.0,
    };
    let before = utc_seconds_of_day(start);
    let (first, last) = (
        (before / step - 1e-9).ceil() as i64,
        ((before + span_s) / step + 1e-9).floor() as i64,
    );
    let ticks = (first..=last).map(|i| i as f64 * step - before);
    let decimals = (-libm::log10(step).floor()).max(0.0) as usize;
    (ticks.collect(), decimals)
}

fn utc_seconds_of_day(epoch: Epoch) -> f64 {
    const SECOND_NS: i128 = 1_000_000_000;
    let ns = utc_duration(epoch).total_nanoseconds();
    let seconds = ns.div_euclid(SECOND_NS).rem_euclid(86_400);
    // Exact for whole seconds.
    seconds as f64 + ns.rem_euclid(SECOND_NS) as f64 * 1e-9
}

/// `23:35:50`, with decimals of the second.
fn time_of_day(epoch: Epoch, decimals: usize) -> String {
    let s = utc_seconds_of_day(epoch);
    let scale = 10f64.powi(decimals as i32);
    let s = (s * scale).round() / scale % 86_400.0;
    let (h, m) = ((s / 3600.0).floor(), (s / 60.0).floor() % 60.0);
    let width = if decimals > 0 { 3 + decimals } else { 2 };
    format!(
        "{h:02.0}:{m:02.0}:{:0width$.decimals$}",
        s - h * 3600.0 - m * 60.0
    )
}

#[cfg(test)]
mod tests {
    use super::super::chart::AMBER;
    use super::*;
    use skyloop_orbit::time::parse_utc;

    #[test]
    fn ticks_are_full_units_of_the_day() {
        let start = parse_utc("2019-06-15T23:59:50.250").unwrap();
        let texts = |span_s| -> Vec<String> {
            let (ticks, decimals) = time_ticks(start, span_s);
            let text = |s: &f64| time_of_day(start + Unit::Second * *s, decimals);
            ticks.iter().map(text).collect()
        };
        assert_eq!(texts(30.0)[..3], ["23:59:55", "00:00:00", "00:00:05"]);
        assert_eq!(texts(0.8)[..2], ["23:59:50.3", "23:59:50.4"]);
        assert_eq!(texts(86_400.0)[0], "00:00:00");
        assert_eq!(texts(0.0), ["23:59:50.250"]);
        let first = time_ticks(start, 30.0).0[0];
        assert!((first - 4.75).abs() < 1e-6, "{first}");
        assert!(time_ticks(start, 1e7).0.len() < 20);
        assert_eq!([0.013, 0.02, 0.3, 7.0].map(nice), [0.02, 0.02, 0.5, 10.0]);
    }

    #[test]
    fn curves_break_at_missing_values_and_bright_is_up() {
        let start = parse_utc("2019-06-15T00:00:00").unwrap();
        let epochs = [0.0, 1.0, 2.0, 3.0, 4.0].map(|s| start + Unit::Second * s);
        let curve = Curve {
            name: "curve",
            color: AMBER,
            values: vec![Some(5.0), Some(4.0), None, Some(6.0), None],
        };
        let text = magnitudes("a <b>", &epochs, &[curve]).unwrap();
        assert!(
            text.contains("a &lt;b&gt;") && text.contains(">\nmagnitude\n<"),
            "{text}"
        );
        let drawn = |tag: &'static str| {
            text.lines()
                .filter(move |line| line.starts_with(tag) && line.contains("#FFC850"))
        };
        let line = drawn("<polyline").next().unwrap();
        let (_, points) = line.split_once("points=\"").unwrap();
        let y: Vec<i32> = points
            .split_whitespace()
            .filter_map(|point| point.split_once(',')?.1.parse().ok())
            .collect();
        assert!(y.len() == 2 && y[1] < y[0], "{line}");
        assert_eq!(
            (drawn("<polyline").count(), drawn("<circle").count()),
            (1, 1)
        );
        // Empty input, and values that cannot be drawn.
        assert!(magnitudes("nothing", &[], &[]).is_ok());
        let extreme = [f64::MAX, -f64::MAX, f64::INFINITY, f64::NAN, 1e17].map(Some);
        let curve = Curve {
            name: "curve",
            color: AMBER,
            values: extreme.to_vec(),
        };
        let text = magnitudes("extreme", &epochs, &[curve]).unwrap();
        let is_curve = |line: &str| line.starts_with("<polyline") && line.contains("#FFC850");
        assert!(!text.lines().any(is_curve), "{text}");
        assert!(!text.contains("NaN"), "{text}");
    }
}
