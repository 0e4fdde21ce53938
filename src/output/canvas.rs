//! A picture to draw on: smooth rings, and text by `embedded-graphics`.

use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::Rectangle;
use embedded_graphics::text::{Baseline, Text};
use image::{Rgb, RgbImage};
use std::convert::Infallible;

/// A colour picture.
#[derive(Debug, Clone)]
pub(crate) struct Canvas(pub RgbImage);

/// Number of dashes of a broken ring.
const DASHES: f64 = 8.0;

impl Canvas {
    /// A picture of one colour.
    pub fn filled(width: u32, height: u32, color: Rgb888) -> Canvas {
        let rgb = Rgb([color.r(), color.g(), color.b()]);
        Canvas(RgbImage::from_pixel(width, height, rgb))
    }

    /// A ring with smooth edges; `weight` is its line width, px; `broken` draws dashes.
    pub fn ring(
        &mut self,
        [x, y]: [f64; 2],
        radius: f64,
        weight: f64,
        color: Rgb888,
        broken: bool,
    ) {
        let reach = radius + weight;
        if !(x + y + reach).is_finite() {
            return;
        }
        let pixels = |middle: f64, end: u32| {
            let [first, last] = [middle - reach, middle + reach]
                .map(|at| at.floor().clamp(0.0, f64::from(end)) as u32);
            first..end.min(last + 2)
        };
        let (columns, rows) = (pixels(x, self.0.width()), pixels(y, self.0.height()));
        for (px, py) in rows.flat_map(|py| columns.clone().map(move |px| (px, py))) {
            let (dx, dy) = (f64::from(px) - x, f64::from(py) - y);
            let turn = libm::atan2(dy, dx) / std::f64::consts::TAU;
            if broken && (turn * DASHES).rem_euclid(1.0) > 0.6 {
                continue;
            }
            let from_line = (libm::hypot(dx, dy) - radius).abs();
            self.blend(
                px.into(),
                py.into(),
                color,
                (0.5 + weight / 2.0 - from_line).clamp(0.0, 1.0),
            );
        }
    }

    /// Text with its upper left corner at `at`.
    pub fn text(&mut self, text: &str, at: Point, font: &MonoFont<'_>, color: Rgb888) {
        let style = MonoTextStyle::new(font, color);
        let Ok(_) = Text::with_baseline(text, at, style, Baseline::Top).draw(self);
    }

    /// Text on a darkened box of its size, readable on any background.
    pub fn text_on_shade(
        &mut self,
        text: &str,
        area: Rectangle,
        font: &MonoFont<'_>,
        color: Rgb888,
    ) {
        for point in area.points() {
            self.blend(point.x.into(), point.y.into(), Rgb888::BLACK, 0.55);
        }
        self.text(text, area.top_left + Point::new(1, 0), font, color);
    }

    fn blend(&mut self, x: i64, y: i64, color: Rgb888, share: f64) {
        let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else {
            return;
        };
        if let Some(pixel) = self.0.get_pixel_mut_checked(x, y) {
            for (old, new) in pixel.0.iter_mut().zip([color.r(), color.g(), color.b()]) {
                *old = (f64::from(*old) * (1.0 - share) + f64::from(new) * share).round() as u8;
            }
        }
    }
}

/// Size of one line of text with its box.
pub(crate) fn text_size(text: &str, font: &MonoFont<'_>) -> Size {
    let advance = font.character_size.width + font.character_spacing;
    Size::new(
        text.chars().count() as u32 * advance + 2,
        font.character_size.height,
    )
}

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        Size::new(self.0.width(), self.0.height())
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(
        &mut self,
        pixels: I,
    ) -> Result<(), Infallible> {
        for Pixel(at, color) in pixels {
            self.blend(at.x.into(), at.y.into(), color, 1.0);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rings_at_invalid_or_distant_positions_draw_nothing() {
        let blank = Canvas::filled(8, 8, Rgb888::BLACK);
        for x in [f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1e300, -1e300] {
            for at in [[x, 4.0], [4.0, x]] {
                let mut canvas = blank.clone();
                canvas.ring(at, 2.0, 1.0, Rgb888::WHITE, false);
                assert_eq!(canvas.0, blank.0, "{at:?}");
            }
        }
        let mut canvas = blank.clone();
        canvas.ring([4.0, 4.0], 2.0, 1.0, Rgb888::WHITE, false);
        assert_eq!(canvas.0.get_pixel(6, 4).0, [255; 3]);
        assert_eq!(canvas.0.get_pixel(4, 4).0, [0; 3]);
    }
}
