//! A plot of dots by two positive values, on logarithmic axes; a line joins the best of them.

use super::chart::{AMBER, Axis, BLUE, CHARACTER_PX, Chart, Drawn, font, svg};
use super::folder::{Folder, OutputError};
use plotters::prelude::*;
use skyloop_base::range::nearest;
use std::io::{self, Write};
use std::ops::Range;
use std::path::Path;

/// Dots by two values.
pub struct Scatter {
    /// Its title.
    pub title: String,
    /// The names of the horizontal and the vertical axis.
    pub axes: [&'static str; 2],
    /// The dots. If names overlap, the first ones are drawn.
    pub dots: Vec<Dot>,
    /// A limit on the horizontal axis, drawn as a vertical line, and its name.
    pub limit: Option<(f64, String)>,
}

/// A dot.
#[derive(Clone)]
pub struct Dot {
    /// Its values, 0 or more; a second value of 0 is drawn on the lowest line. A dot with a value
    /// that is not finite is not drawn.
    pub at: [f64; 2],
    /// Its name; may be empty.
    pub name: String,
    /// Whether it is drawn large.
    pub is_large: bool,
    /// Whether it is one of the best dots, which a line joins.
    pub is_front: bool,
}

const LIMIT: RGBColor = RGBColor(220, 90, 90);
/// Height of a name, and the space between it and its dot, px.
const NAME_PX: i32 = 13;
const GAP_PX: i32 = 8;
/// Vertical shifts of a name in the search for a free position, px.
const SHIFTS: [i32; 9] = [0, -11, 11, -22, 22, -33, 33, -44, 44];

/// Writes a plot as SVG into `dir`, which is created if needed.
///
/// Errors: the folder or the file cannot be written.
pub fn write_scatter(dir: &Path, name: &str, plot: &Scatter) -> Result<(), OutputError> {
    Folder::shared(dir)?.write(name, |out| out.write_all(plot.svg()?.as_bytes()))
}

/// A range that contains all positive `values`, with a margin.
fn range(values: impl Iterator<Item = f64>, room: f64) -> Range<f64> {
    let above = values.filter(|value| *value > 0.0);
    let [low, high] = above.fold([f64::MAX, 0.0f64], |[low, high], value| {
        [low.min(value), high.max(value)]
    });
    if low > high {
        return 0.1..10.0;
    }
    let [low, high] =
        [low / room, high * room].map(|end| nearest(end, f64::MIN_POSITIVE..=f64::MAX));
    low..high
}

/// Values with grid lines: 1, 2 and 5 times powers of ten; only powers of ten if the range exceeds
/// two decades.
fn ticks(range: &Range<f64>) -> Vec<f64> {
    let [low, high] = [range.start, range.end].map(|end| libm::log10(end).floor() as i32);
    let factors: &[f64] = if high - low <= 2 {
        &[1.0, 2.0, 5.0]
    } else {
        &[1.0]
    };
    let all = (low..=high).flat_map(|power| factors.iter().map(move |f| f * 10f64.powi(power)));
    all.filter(|value| range.contains(value)).collect()
}

/// A value with few digits.
fn text(value: f64) -> String {
    match value {
        value if (1e-3..1e4).contains(&value) => format!("{}", (value * 1e6).round() / 1e6),
        value => format!("{value:.0e}"),
    }
}

impl Scatter {
    fn svg(&self) -> io::Result<String> {
        let is_finite = |dot: &&Dot| dot.at.iter().all(|value| value.is_finite());
        let mut dots: Vec<Dot> = self.dots.iter().filter(is_finite).cloned().collect();
        let limit = self.limit.iter().map(|(value, _)| *value);
        let across = range(dots.iter().map(|dot| dot.at[0]).chain(limit), 1.15);
        let above = range(dots.iter().map(|dot| dot.at[1]), 1.5);
        // Dots at 0 are on their own grid line below the others.
        let floor = above.start / 1.5;
        for dot in &mut dots {
            dot.at = [dot.at[0].max(across.start), dot.at[1].max(floor)];
        }
        let [marks_across, marks_above] = [&across, &above].map(ticks);
        let (ends, bottom) = (across.clone(), floor / 1.2);
        let across = Axis {
            name: self.axes[0],
            range: LogCoord::from(across.log_scale()),
            marks: marks_across,
            label: &|value| text(*value),
        };
        let upwards = Axis {
            name: self.axes[1],
            range: LogCoord::from((bottom..above.end).log_scale()),
            marks: [vec![floor], marks_above].concat(),
            label: &|value| {
                if *value == floor {
                    "0".to_string()
                } else {
                    text(*value)
                }
            },
        };
        svg(&self.title, across, upwards, &[], |chart| {
            if let Some((value, name)) = &self.limit {
                let x = value.max(ends.start);
                let line = [(x, bottom), (x, above.end)];
                chart.draw_series([PathElement::new(line, LIMIT)])?;
                let name = Text::new(name.clone(), (4, 4), font(LIMIT));
                chart.draw_series([EmptyElement::at(line[1]) + name])?;
            }
            draw_front(chart, &dots)?;
            draw_dots(chart, &dots)
        })
    }
}

impl Dot {
    fn position(&self) -> (f64, f64) {
        self.at.into()
    }

    fn color(&self) -> RGBColor {
        if self.is_front { AMBER } else { BLUE }
    }
}

fn draw_front<X, Y>(chart: &mut Chart<'_, '_, X, Y>, dots: &[Dot]) -> Drawn
where
    X: Ranged<ValueType = f64>,
    Y: Ranged<ValueType = f64>,
{
    let front = dots.iter().filter(|dot| dot.is_front);
    let mut front: Vec<(f64, f64)> = front.map(Dot::position).collect();
    front.sort_by(|a, b| a.0.total_cmp(&b.0));
    chart.draw_series([PathElement::new(front, AMBER)])?;
    Ok(())
}

/// Draws the dots, and the names for which there is a free position next to the dot.
fn draw_dots<X, Y>(chart: &mut Chart<'_, '_, X, Y>, dots: &[Dot]) -> Drawn
where
    X: Ranged<ValueType = f64>,
    Y: Ranged<ValueType = f64>,
{
    let circle = |dot: &Dot| {
        let radius = if dot.is_large { 5 } else { 2 };
        Circle::new(dot.position(), radius, dot.color().filled())
    };
    chart.draw_series(dots.iter().map(circle))?;
    let (columns, rows) = chart.plotting_area().get_pixel_range();
    let taken = dots.iter().map(|dot| {
        let (x, y) = chart.backend_coord(&dot.position());
        [x - 4..x + 4, y - 4..y + 4]
    });
    let mut taken: Vec<[Range<i32>; 2]> = taken.collect();
    for dot in dots.iter().filter(|dot| !dot.name.is_empty()) {
        let (x, y) = chart.backend_coord(&dot.position());
        let width = CHARACTER_PX * dot.name.chars().count() as i32;
        let area = |(dx, dy): (i32, i32)| [x + dx..x + dx + width, y + dy..y + dy + NAME_PX];
        let is_free = |at: &(i32, i32)| {
            let area = area(*at);
            let is_inside = [&columns, &rows]
                .into_iter()
                .zip(&area)
                .all(|(all, part)| all.start < part.start && part.end < all.end);
            is_inside && !taken.iter().any(|other| meet(other, &area))
        };
        let mut places = SHIFTS.into_iter().flat_map(|shift| {
            let dy = shift - NAME_PX / 2;
            [(GAP_PX, dy), (-GAP_PX - width, dy)]
        });
        if let Some(place) = places.find(is_free) {
            taken.push(area(place));
            let name = Text::new(dot.name.clone(), place, font(dot.color()));
            chart.draw_series([EmptyElement::at(dot.position()) + name])?;
        }
    }
    Ok(())
}

/// Whether two rectangles, each of columns and rows, have a pixel in common.
fn meet(a: &[Range<i32>; 2], b: &[Range<i32>; 2]) -> bool {
    (a.iter().zip(b)).all(|(a, b)| a.start < b.end && b.start < a.end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_logarithmic() {
        assert_eq!(range([4.0, 100.0, 0.0].into_iter(), 2.0), 2.0..200.0);
        let all = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0];
        assert_eq!(ticks(&(1.0..100.1)), all);
        assert_eq!(ticks(&(1e-3..1e3 + 1.0)).len(), 7);
        // Without values the plot has a default range.
        assert_eq!(range([].into_iter(), 2.0), 0.1..10.0);
        assert_eq!([0.05, 20.0, 1e-6].map(text), ["0.05", "20", "1e-6"]);
    }

    #[test]
    fn finite_dots_and_their_names_are_drawn() {
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
        let text = plot.svg().unwrap();
        let circles = |color| {
            let lines = text.lines().filter(|line| line.starts_with("<circle"));
            lines.filter(|line| line.contains(color)).count()
        };
        assert_eq!((circles("#FFC850"), circles("#6E8CBE")), (2, 2));
        for name in ["title", "ms", "e-", "a", "b", "c", "d", "limit"] {
            assert!(text.contains(&format!(">\n{name}\n<")), "{name}: {text}");
        }
        assert!(!text.contains(">\ne\n<"), "{text}");
        // Dots in one place have their names side by side.
        let place = |name| {
            let (head, _) = text.split_once(&format!(">\n{name}\n<")).unwrap();
            let (_, attributes) = head.rsplit_once("<text").unwrap();
            let attributes = attributes.split(' ');
            let place = attributes.filter(|part| part.starts_with("x=") || part.starts_with("y="));
            place.collect::<Vec<_>>()
        };
        assert_ne!(place("b"), place("c"));
    }
}
