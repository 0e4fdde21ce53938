//! A plot of magnitudes over time: bright is up.

use super::axes::{FRAME, GROUND, SIZE, frame, line, mark_across, mark_upwards};
use super::canvas::{Canvas, text_size};
use embedded_graphics::mono_font::ascii::FONT_6X10;
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use hifitime::{Epoch, Unit};
use image::RgbImage;
use skyloop_orbit::time::{utc_duration, utc_text};

/// Values over time.
pub struct Plot {
    /// Above it.
    pub title: String,
    /// What the values are.
    pub value: &'static str,
    /// When, rising.
    pub epochs: Vec<Epoch>,
    /// Drawn in this order.
    pub series: Vec<Series>,
}

/// A line of the plot.
pub struct Series {
    /// As the legend says it.
    pub name: &'static str,
    /// Its colour.
    pub color: Rgb888,
    /// One an epoch; none breaks the line.
    pub values: Vec<Option<f64>>,
}

/// About as many labels an axis.
const TICKS: f64 = 8.0;
/// Steps between the labels of a time axis, s, that divide minutes, hours and days.
const TIME_STEPS: &[f64] = &[
    1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 120.0, 300.0, 600.0, 900.0, 1800.0, 3600.0, 7200.0,
    10_800.0, 21_600.0, 43_200.0, 86_400.0,
];

impl Plot {
    /// The picture.
    pub fn draw(&self) -> RgbImage {
        let mut canvas = Canvas::filled(SIZE[0], SIZE[1], GROUND);
        let start = self.epochs.first().copied().unwrap_or_default();
        let seconds: Vec<f64> = self
            .epochs
            .iter()
            .map(|t| (*t - start).to_seconds())
            .collect();
        let span_s = seconds.last().copied().unwrap_or(0.0);
        let [low, high] = self.range();
        let [left, top, right, bottom] = FRAME;
        // A single instant stands in the middle.
        let x = |s: f64| {
            let share = if span_s > 0.0 { s / span_s } else { 0.5 };
            f64::from(left) + share * f64::from(right - left)
        };
        // Brighter is smaller, and up.
        let y = |v: f64| f64::from(top) + (v - low) / (high - low) * f64::from(bottom - top);

        for tick in ticks(low, high, nice((high - low) / TICKS)) {
            mark_upwards(&mut canvas, y(tick.value), &tick.text);
        }
        for (s, text) in time_ticks(start, span_s) {
            mark_across(&mut canvas, x(s), &text);
        }
        for series in &self.series {
            self.curve(&mut canvas, series, &seconds, &x, &y);
        }
        let day = utc_text(start);
        let day = day.split('T').next().unwrap_or_default();
        let across = format!("UTC, from {day}");
        frame(&mut canvas, &self.title, [&across, self.value]);
        self.legend(&mut canvas);
        canvas.0
    }

    /// The least and the greatest value, with some room, and never the same.
    fn range(&self) -> [f64; 2] {
        let values = self
            .series
            .iter()
            .flat_map(|series| series.values.iter().flatten());
        let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
            [low.min(*v), high.max(*v)]
        });
        if low > high {
            return [0.0, 1.0];
        }
        let room = (0.05 * (high - low)).max(0.05);
        [low - room, high + room]
    }

    /// A line from value to value, and a dot where one stands alone.
    fn curve(
        &self,
        canvas: &mut Canvas,
        series: &Series,
        seconds: &[f64],
        x: &impl Fn(f64) -> f64,
        y: &impl Fn(f64) -> f64,
    ) {
        let at = |i: usize| -> Option<[i32; 2]> {
            let value = series.values.get(i).copied().flatten()?;
            Some([x(*seconds.get(i)?).round() as i32, y(value).round() as i32])
        };
        for i in 0..seconds.len() {
            let Some(here) = at(i) else { continue };
            let before = i.checked_sub(1).and_then(&at);
            match (before, at(i + 1)) {
                (None, None) => {
                    let [x, y] = here.map(f64::from);
                    canvas.ring([x, y], 1.0, 2.0, series.color, false);
                }
                (_, Some(next)) => line(canvas, here, next, series.color, 2),
                _ => {}
            }
        }
    }

    /// The names of the series, on the right above the frame.
    fn legend(&self, canvas: &mut Canvas) {
        let [_, top, mut edge, _] = FRAME;
        for series in self.series.iter().rev() {
            edge -= text_size(series.name, &FONT_6X10).width as i32;
            let at = Point::new(edge, top - 20);
            canvas.text(series.name, at, &FONT_6X10, series.color);
            edge -= 20;
        }
    }
}

struct Tick {
    value: f64,
    text: String,
}

/// 1, 2 or 5 times a power of ten, at least `step`.
fn nice(step: f64) -> f64 {
    let power = libm::pow(10.0, libm::log10(step).floor());
    let factor = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|f| f * power >= step * (1.0 - 1e-9));
    factor.unwrap_or(10.0) * power
}

/// The multiples of `step` between two values, with as many decimals as it has.
fn ticks(low: f64, high: f64, step: f64) -> Vec<Tick> {
    let decimals = (-libm::log10(step).floor()).max(0.0) as usize;
    let (first, last) = ((low / step).ceil() as i64, (high / step).floor() as i64);
    let tick = |i: i64| {
        let value = i as f64 * step;
        Tick {
            value,
            text: format!("{value:.decimals$}"),
        }
    };
    (first..=last).map(tick).collect()
}

/// Seconds after `start` and the time of day there, at full seconds, minutes, hours or days.
fn time_ticks(start: Epoch, span_s: f64) -> Vec<(f64, String)> {
    if span_s <= 0.0 {
        return vec![(0.0, time_of_day(start, 3))];
    }
    let wanted = span_s / TICKS;
    let step = match TIME_STEPS.iter().find(|step| **step >= wanted) {
        Some(step) if wanted > 0.5 => *step,
        Some(_) => nice(wanted),
        None => nice(wanted / 86_400.0) * 86_400.0,
    };
    let decimals = (-libm::log10(step).floor()).max(0.0) as usize;
    let before = utc_seconds_of_day(start);
    let (first, last) = (
        (before / step - 1e-9).ceil() as i64,
        ((before + span_s) / step + 1e-9).floor() as i64,
    );
    (first..=last)
        .map(|i| {
            let s = i as f64 * step - before;
            (s, time_of_day(start + Unit::Second * s, decimals))
        })
        .collect()
}

/// Seconds of UTC since midnight.
fn utc_seconds_of_day(epoch: Epoch) -> f64 {
    const SECOND_NS: i128 = 1_000_000_000;
    let ns = utc_duration(epoch).total_nanoseconds();
    let seconds = ns.div_euclid(SECOND_NS).rem_euclid(86_400);
    // Exact where it is whole.
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
    use super::*;
    use skyloop_orbit::time::parse_utc;

    #[test]
    fn ticks_are_round() {
        assert_eq!([0.013, 0.02, 0.3, 7.0].map(nice), [0.02, 0.02, 0.5, 10.0]);
        let texts: Vec<String> = ticks(-0.12, 0.31, 0.1)
            .into_iter()
            .map(|t| t.text)
            .collect();
        assert_eq!(texts, ["-0.1", "0.0", "0.1", "0.2", "0.3"]);
    }

    #[test]
    fn times_are_full_units_of_the_day() {
        let start = parse_utc("2019-06-15T23:59:50.250").unwrap();
        let texts = |span_s| -> Vec<String> {
            time_ticks(start, span_s)
                .into_iter()
                .map(|(_, text)| text)
                .collect()
        };
        assert_eq!(texts(30.0)[..3], ["23:59:55", "00:00:00", "00:00:05"]);
        assert_eq!(texts(0.8)[..2], ["23:59:50.3", "23:59:50.4"]);
        assert_eq!(texts(86_400.0)[0], "00:00:00");
        assert_eq!(texts(0.0), ["23:59:50.250"]);
        let (first, _) = time_ticks(start, 30.0)[0];
        assert!((first - 4.75).abs() < 1e-6, "{first}");
        assert!(time_ticks(start, 1e7).len() < 20);
    }
}
