//! What all plots have: their size and colours, lines with labels across and upwards, the frame, and words around it.

use super::canvas::{Canvas, text_size};
use embedded_graphics::mono_font::ascii::{FONT_6X10, FONT_9X15};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::{Line, PrimitiveStyle};

pub const SIZE: [u32; 2] = [1000, 560];
/// Left, top, right and lower edge of the axes, px.
pub const FRAME: [i32; 4] = [80, 60, 975, 490];
pub const GROUND: Rgb888 = Rgb888::new(12, 14, 20);
pub const INK: Rgb888 = Rgb888::new(210, 214, 220);
const GRID: Rgb888 = Rgb888::new(40, 44, 54);

/// A straight line.
pub fn line(canvas: &mut Canvas, a: [i32; 2], b: [i32; 2], color: Rgb888, weight: u32) {
    let style = PrimitiveStyle::with_stroke(color, weight);
    let line = Line::new(Point::new(a[0], a[1]), Point::new(b[0], b[1]));
    // A canvas takes everything.
    let Ok(()) = line.into_styled(style).draw(canvas);
}

/// A line upwards at `x`, px, and its label below.
pub fn mark_across(canvas: &mut Canvas, x: f64, label: &str) {
    let [_, top, _, bottom] = FRAME;
    let x = x.round() as i32;
    line(canvas, [x, top], [x, bottom], GRID, 1);
    let width = text_size(label, &FONT_6X10).width as i32;
    canvas.text(
        label,
        Point::new(x - width / 2, bottom + 8),
        &FONT_6X10,
        INK,
    );
}

/// A line across at `y`, px, and its label on the left.
pub fn mark_upwards(canvas: &mut Canvas, y: f64, label: &str) {
    let [left, _, right, _] = FRAME;
    let y = y.round() as i32;
    line(canvas, [left, y], [right, y], GRID, 1);
    let width = text_size(label, &FONT_6X10).width as i32;
    canvas.text(label, Point::new(left - 6 - width, y - 5), &FONT_6X10, INK);
}

/// The frame, the title above it, and what goes across and upwards.
pub fn frame(canvas: &mut Canvas, title: &str, [across, upwards]: [&str; 2]) {
    let [left, top, right, bottom] = FRAME;
    for (a, b) in [
        ([left, top], [right, top]),
        ([left, bottom], [right, bottom]),
        ([left, top], [left, bottom]),
        ([right, top], [right, bottom]),
    ] {
        line(canvas, a, b, INK, 1);
    }
    canvas.text(title, Point::new(left, 12), &FONT_9X15, INK);
    canvas.text(upwards, Point::new(12, top - 20), &FONT_6X10, INK);
    canvas.text(across, Point::new(left, bottom + 30), &FONT_6X10, INK);
}
