//! A plot of dots by two values that are above 0, on logarithmic axes; the best of them joined by a line.

use super::axes::{FRAME, GROUND, SIZE, frame, line, mark_across, mark_upwards};
use super::canvas::{Canvas, text_size};
use super::folder::{Folder, OutputError};
use super::png;
use crate::range::nearest;
use embedded_graphics::mono_font::ascii::FONT_6X10;
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::Rectangle;
use image::RgbImage;
use std::path::Path;

/// Dots by two values.
pub struct Scatter {
    /// Above it.
    pub title: String,
    /// What the axes are: across, and upwards.
    pub axes: [&'static str; 2],
    /// The dots; those that are named first win where names are crowded.
    pub dots: Vec<Dot>,
    /// A limit across, and what it is called.
    pub limit: Option<(f64, String)>,
}

/// A dot.
pub struct Dot {
    /// Its values, 0 or more; 0 upwards stands on the lowest line.
    pub at: [f64; 2],
    /// What it is called; nothing: it has no name.
    pub name: String,
    /// Whether it is drawn large.
    pub is_large: bool,
    /// Whether the line joins it.
    pub is_front: bool,
}

const FRONT: Rgb888 = Rgb888::new(255, 200, 80);
const OTHER: Rgb888 = Rgb888::new(110, 140, 190);
const LIMIT: Rgb888 = Rgb888::new(220, 90, 90);
/// Heights that a name is moved by to find its place, px.
const SHIFTS: [i32; 9] = [0, -11, 11, -22, 22, -33, 33, -44, 44];

/// Writes a plot into `dir`, which is made if it does not exist.
///
/// Errors: the folder or the file cannot be written.
pub fn write_scatter(dir: &Path, name: &str, plot: &Scatter) -> Result<(), OutputError> {
    let picture = plot.draw();
    Folder::shared(dir)?.write(name, |out| png::write_rgb(out, &picture))
}

/// A logarithmic axis: from which value to which.
struct Axis {
    ends: [f64; 2],
    px: [i32; 2],
}

impl Axis {
    /// One that holds all `values` above 0, with some room.
    fn of(values: impl Iterator<Item = f64>, px: [i32; 2], room: f64) -> Axis {
        let above = values.filter(|value| *value > 0.0 && value.is_finite());
        let [low, high] = above.fold([f64::MAX, 0.0f64], |[low, high], value| {
            [low.min(value), high.max(value)]
        });
        let ends = if low > high {
            [0.1, 10.0]
        } else {
            // Powers of ten are counted between them.
            [low / room, high * room].map(|end| nearest(end, f64::MIN_POSITIVE..=f64::MAX))
        };
        Axis { ends, px }
    }

    fn place(&self, value: f64) -> f64 {
        let [low, high] = self.ends.map(libm::log);
        let part = (libm::log(value.max(self.ends[0])) - low) / (high - low);
        let [from, to] = self.px.map(f64::from);
        from + part * (to - from)
    }

    /// Values to be marked: 1, 2 and 5 times powers of ten, or these alone where they are many.
    fn ticks(&self) -> Vec<f64> {
        let [low, high] = self.ends.map(|end| libm::log10(end).floor() as i32);
        let factors: &[f64] = if high - low <= 2 {
            &[1.0, 2.0, 5.0]
        } else {
            &[1.0]
        };
        let all = (low..=high).flat_map(|power| factors.iter().map(move |f| f * 10f64.powi(power)));
        all.filter(|value| (self.ends[0]..=self.ends[1]).contains(value))
            .collect()
    }
}

/// A value in few digits.
fn text(value: f64) -> String {
    match value {
        value if (1e-3..1e4).contains(&value) => format!("{}", (value * 1e6).round() / 1e6),
        value => format!("{value:.0e}"),
    }
}

impl Scatter {
    /// The picture.
    pub fn draw(&self) -> RgbImage {
        let [left, top, right, bottom] = FRAME;
        let mut canvas = Canvas::filled(SIZE[0], SIZE[1], GROUND);
        let limit = self.limit.iter().map(|(value, _)| *value);
        let across = Axis::of(
            self.dots.iter().map(|dot| dot.at[0]).chain(limit),
            [left, right],
            1.15,
        );
        let upwards = Axis::of(
            self.dots.iter().map(|dot| dot.at[1]),
            [bottom - 24, top],
            1.5,
        );
        for value in across.ticks() {
            mark_across(&mut canvas, across.place(value), &text(value));
        }
        let floor = (f64::from(bottom - 8), "0".to_string());
        let ticks = upwards.ticks().into_iter();
        let ticks = ticks.map(|value| (upwards.place(value), text(value)));
        for (at, text) in ticks.chain([floor]) {
            mark_upwards(&mut canvas, at, &text);
        }
        let place = |dot: &Dot| {
            let [x, y] = dot.at;
            let y = if y > 0.0 {
                upwards.place(y)
            } else {
                f64::from(bottom - 8)
            };
            [across.place(x), y]
        };
        if let Some((value, name)) = &self.limit {
            let [at, _] = pixel([across.place(*value), 0.0]);
            line(&mut canvas, [at, top], [at, bottom], LIMIT, 1);
            canvas.text(name, Point::new(at + 4, top + 4), &FONT_6X10, LIMIT);
        }
        self.front(&mut canvas, place);
        self.dots(&mut canvas, place);
        frame(&mut canvas, &self.title, self.axes);
        canvas.0
    }

    /// The line through the best.
    fn front(&self, canvas: &mut Canvas, place: impl Fn(&Dot) -> [f64; 2]) {
        let front = self.dots.iter().filter(|dot| dot.is_front);
        let mut front: Vec<[f64; 2]> = front.map(place).collect();
        front.sort_by(|a, b| a[0].total_cmp(&b[0]));
        for ends in front.windows(2) {
            let [a, b] = [ends[0], ends[1]].map(pixel);
            line(canvas, a, b, FRONT, 1);
        }
    }

    /// The dots, and the names that find a place.
    fn dots(&self, canvas: &mut Canvas, place: impl Fn(&Dot) -> [f64; 2]) {
        let color = |dot: &Dot| if dot.is_front { FRONT } else { OTHER };
        for dot in &self.dots {
            let radius = if dot.is_large { 4.0 } else { 1.5 };
            canvas.ring(place(dot), radius, 2.0, color(dot), false);
        }
        let taken = self.dots.iter().map(|dot| {
            let [x, y] = pixel(place(dot));
            Rectangle::new(Point::new(x - 4, y - 4), Size::new(8, 8))
        });
        let mut taken: Vec<Rectangle> = taken.collect();
        for dot in self.dots.iter().filter(|dot| !dot.name.is_empty()) {
            let [x, y] = pixel(place(dot));
            let size = text_size(&dot.name, &FONT_6X10);
            let places = SHIFTS.iter().flat_map(|shift| {
                let y = y - 5 + shift;
                [
                    Point::new(x + 8, y),
                    Point::new(x - 8 - size.width as i32, y),
                ]
            });
            let mut areas = places.map(|at| Rectangle::new(at, size));
            let free = |area: &Rectangle| {
                let inside = area.top_left.x > FRAME[0] && area.top_left.y > FRAME[1];
                let [right, bottom] = [0, 1].map(|k| {
                    let end = area.top_left + area.size;
                    if k == 0 { end.x } else { end.y }
                });
                let meets = |other: &Rectangle| !other.intersection(area).is_zero_sized();
                inside && right < FRAME[2] && bottom < FRAME[3] && !taken.iter().any(meets)
            };
            if let Some(area) = areas.find(free) {
                canvas.text(&dot.name, area.top_left, &FONT_6X10, color(dot));
                taken.push(area);
            }
        }
    }
}

/// The pixel at a place; one far off the picture for what lies further, or nowhere.
fn pixel(at: [f64; 2]) -> [i32; 2] {
    const OUTSIDE: f64 = -1e4;
    at.map(|px| match px.is_nan() {
        true => OUTSIDE as i32,
        false => px.round().clamp(OUTSIDE, -OUTSIDE) as i32,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_go_by_powers() {
        let axis = Axis::of([1.0, 100.0, 0.0].into_iter(), [0, 200], 1.0);
        assert_eq!(
            [1.0, 10.0, 100.0, 0.0].map(|v| axis.place(v).round()),
            [0.0, 100.0, 200.0, 0.0]
        );
        assert_eq!(axis.ticks(), [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0]);
        let wide = Axis::of([1e-3, 1e3].into_iter(), [0, 200], 1.0);
        assert_eq!(wide.ticks().len(), 7);
        // Without values there is still a picture.
        let nothing = Axis::of([].into_iter(), [0, 200], 1.0);
        assert!(nothing.place(1.0).is_finite());
        assert_eq!([0.05, 20.0, 1e-6].map(text), ["0.05", "20", "1e-6"]);
    }

    #[test]
    fn dots_and_names_are_drawn_whatever_their_values() {
        let dot = |at, name: &str, is_front| Dot {
            at,
            name: name.to_string(),
            is_large: is_front,
            is_front,
        };
        let plot = Scatter {
            title: "title".to_string(),
            axes: ["ms", "e-"],
            dots: vec![
                dot([1.0, 10.0], "a", true),
                dot([2.0, 1.0], "b", true),
                dot([2.0, 1.0], "c", false),
                dot([3.0, 0.0], "d", false),
                dot([f64::NAN, f64::INFINITY], "e", false),
            ],
            limit: Some((1.5, "limit".to_string())),
        };
        let picture = plot.draw();
        let has = |color: Rgb888| {
            let wanted = [color.r(), color.g(), color.b()];
            picture.pixels().any(|pixel| pixel.0 == wanted)
        };
        assert!(has(FRONT) && has(OTHER) && has(LIMIT));
    }
}
