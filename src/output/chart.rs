//! Plots as SVG: a title, a grid with labels, and curves or dots.

use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint};
use plotters::prelude::*;
use skyloop_orbit::{Mark, printable_line};
use std::io;
use std::ops::Range;

/// The mark of a plot written by skyloop.
pub const SVG_MARK: Mark = &["<!-- Software: skyloop -->"];

/// Width and height, px.
const SIZE: (u32, u32) = (1000, 560);
/// Space around the chart, px.
const MARGIN: i32 = 12;
const GROUND: RGBColor = RGBColor(12, 14, 20);
const GRID: RGBColor = RGBColor(40, 44, 54);
const INK: RGBColor = RGBColor(210, 214, 220);
pub(crate) const AMBER: RGBColor = RGBColor(255, 200, 80);
pub(crate) const BLUE: RGBColor = RGBColor(110, 140, 190);

/// Width of a character in [`font`], px.
pub(crate) const CHARACTER_PX: i32 = 7;

/// Text in one colour.
pub(crate) fn font(color: RGBColor) -> TextStyle<'static> {
    ("monospace", 15).into_font().color(&color)
}

/// An axis: its name, its range, the values with grid lines, and their labels.
pub(crate) struct Axis<'t, R> {
    pub name: &'t str,
    pub range: R,
    pub marks: Vec<f64>,
    pub label: &'t dyn Fn(&f64) -> String,
}

/// A range with grid lines at given values.
pub(crate) struct Marked<R>(R, Vec<f64>);

impl<R: Ranged<ValueType = f64>> Ranged for Marked<R> {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        self.0.map(value, limit)
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        self.1.clone()
    }

    fn range(&self) -> Range<f64> {
        self.0.range()
    }
}

/// The plot's area, with a grid.
pub(crate) type Chart<'a, 'b, X, Y> =
    ChartContext<'a, SVGBackend<'b>, Cartesian2d<Marked<X>, Marked<Y>>>;
/// The result of drawing.
pub(crate) type Drawn = Result<(), DrawingAreaErrorKind<io::Error>>;

/// The text of an SVG file: axes under a title, the drawing by `draw`, and the names of curves,
/// each in its colour, in the lower right corner.
pub(crate) fn svg<X, Y>(
    title: &str,
    across: Axis<'_, X>,
    upwards: Axis<'_, Y>,
    names: &[(&str, RGBColor)],
    draw: impl FnOnce(&mut Chart<'_, '_, X, Y>) -> Drawn,
) -> io::Result<String>
where
    X: Ranged<ValueType = f64>,
    Y: Ranged<ValueType = f64>,
{
    let mut text = format!("{}\n", SVG_MARK[0]);
    let drawn = || -> Drawn {
        let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        root.fill(&GROUND)?;
        let mut chart = ChartBuilder::on(&root)
            .caption(printable_line(title), font(INK))
            .margin(MARGIN)
            // Room for half of the last label of a time axis.
            .margin_right(3 * MARGIN)
            .x_label_area_size(45)
            .y_label_area_size(80)
            .build_cartesian_2d(
                Marked(across.range, across.marks),
                Marked(upwards.range, upwards.marks),
            )?;
        chart
            .configure_mesh()
            .axis_style(INK)
            .bold_line_style(GRID)
            .light_line_style(TRANSPARENT)
            .label_style(font(INK))
            .x_desc(across.name)
            .y_desc(upwards.name)
            .x_label_formatter(across.label)
            .y_label_formatter(upwards.label)
            .draw()?;
        draw(&mut chart)?;
        let (mut x, y) = (SIZE.0 as i32 - MARGIN, SIZE.1 as i32 - 2 * MARGIN);
        for (name, color) in names.iter().rev() {
            x -= CHARACTER_PX * name.len() as i32;
            root.draw(&Text::new(*name, (x, y), font(*color)))?;
            x -= 2 * MARGIN;
        }
        root.present()
    };
    drawn().map_err(io::Error::other)?;
    Ok(text)
}
