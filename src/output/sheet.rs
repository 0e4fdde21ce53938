//! The contact sheet: up to twelve annotated frames of a run in one picture.

use super::canvas::{Canvas, text_size};
use super::panel::{self, HIDDEN, PLANET, RINGED, RSO, STAR};
use embedded_graphics::mono_font::iso_8859_1::{FONT_7X13, FONT_7X13_BOLD, FONT_9X18_BOLD};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use image::RgbImage;
use image::imageops::replace;
use skyloop_render::camera::Camera;
use skyloop_render::frame::Frame;
use skyloop_render::label::Label;

const PANELS: u32 = 12;
const COLUMNS: usize = 4;
/// Space around a panel, px.
const MARGIN: u32 = 12;
/// Height of the title above all panels and of the caption below each, px.
const TITLE: u32 = 64;
const CAPTION: u32 = 38;
/// Minimum width of a panel's cell, for its caption, px.
const CAPTION_WIDTH: u32 = 400;
/// Width of a ring of the legend, px.
const RING: i32 = 20;

const PAPER: Rgb888 = Rgb888::new(16, 18, 24);
const INK: Rgb888 = Rgb888::new(235, 238, 245);
const PALE: Rgb888 = Rgb888::new(160, 168, 182);

/// Collects the panels of a run: equidistant frames, with the first and the last one.
#[derive(Debug)]
pub(crate) struct ContactSheet {
    frames: u32,
    seen: u32,
    title: String,
    panels: Vec<Panel>,
}

#[derive(Debug)]
struct Panel {
    picture: RgbImage,
    heading: String,
    content: String,
}

impl ContactSheet {
    /// For a run of `frames` frames.
    pub fn new(frames: u32) -> ContactSheet {
        ContactSheet {
            frames,
            seen: 0,
            title: String::new(),
            panels: Vec::new(),
        }
    }

    /// Counts the next frame of the run, and stores its panel if it is selected.
    pub fn add(&mut self, camera: &Camera, label: &Label, frame: &Frame) {
        if chosen(self.seen, self.frames) {
            self.title = format!("skyloop   {}   seed {}", label.camera, label.seed);
            self.panels.push(Panel {
                picture: panel::draw(camera, label, frame),
                heading: format!("frame {}   {}", label.frame, shown_time(&label.epoch_mid)),
                content: content(label),
            });
        }
        self.seen += 1;
    }

    /// The sheet; none without a panel.
    pub fn draw(&self) -> Option<RgbImage> {
        let widest = self.panels.iter().map(|p| p.picture.width()).max()?;
        let highest = self.panels.iter().map(|p| p.picture.height()).max()?;
        let columns = columns(self.panels.len());
        let rows = self.panels.len().div_ceil(columns);
        let cell = Size::new(
            widest.max(CAPTION_WIDTH) + MARGIN,
            highest + CAPTION + MARGIN,
        );
        let (shown, seen) = (self.panels.len(), self.seen);
        let title = format!("{}   {shown} of {seen} frames", self.title);
        let legend = legend();
        let widths = [
            columns as u32 * cell.width,
            text_size(&title, &FONT_9X18_BOLD).width + MARGIN,
            legend.iter().map(|(.., text)| key_width(text)).sum(),
        ];
        let mut canvas = Canvas::filled(
            widths.into_iter().max()? + MARGIN,
            rows as u32 * cell.height + TITLE + MARGIN,
            PAPER,
        );
        let mut at = Point::new(MARGIN as i32, 10);
        canvas.text(&title, at, &FONT_9X18_BOLD, INK);
        at.y = 38;
        for (color, broken, text) in legend {
            let centre = [f64::from(at.x) + 7.0, f64::from(at.y) + 7.0];
            canvas.ring(centre, 6.0, 1.6, color, broken);
            canvas.text(&text, at + Point::new(RING, 0), &FONT_7X13, PALE);
            at.x += key_width(&text) as i32;
        }
        for (i, panel) in self.panels.iter().enumerate() {
            let corner = Point::new(
                (MARGIN + (i % columns) as u32 * cell.width) as i32,
                (TITLE + (i / columns) as u32 * cell.height) as i32,
            );
            replace(
                &mut canvas.0,
                &panel.picture,
                corner.x.into(),
                corner.y.into(),
            );
            let below = corner + Point::new(0, panel.picture.height() as i32 + 5);
            canvas.text(&panel.heading, below, &FONT_7X13_BOLD, INK);
            canvas.text(&panel.content, below + Point::new(0, 15), &FONT_7X13, PALE);
        }
        Some(canvas.0)
    }
}

/// The rings of panels: colour, whether the ring is dashed, and its meaning.
fn legend() -> [(Rgb888, bool, String); 4] {
    let star = format!("star (the brightest {RINGED} of a frame)");
    [
        (STAR, false, star),
        (RSO, false, "RSO".to_string()),
        (HIDDEN, true, "RSO, not visible".to_string()),
        (PLANET, false, "Moon, planet".to_string()),
    ]
}

/// Width of a ring of the legend with its text and the space to the next, px.
fn key_width(text: &str) -> u32 {
    RING as u32 + text_size(text, &FONT_7X13).width + MARGIN
}

/// Whether frame `i` of `frames` is selected: equidistant from the first to the last, rounded; all
/// if there are at most [`PANELS`].
fn chosen(i: u32, frames: u32) -> bool {
    if frames <= PANELS {
        return i < PANELS;
    }
    let (i, last, steps) = (u64::from(i), u64::from(frames - 1), u64::from(PANELS - 1));
    (0..=steps).any(|step| (step * last + steps / 2) / steps == i)
}

/// The squarest grid with at most [`COLUMNS`] columns.
fn columns(panels: usize) -> usize {
    (1..COLUMNS)
        .find(|columns| columns * columns >= panels)
        .unwrap_or(COLUMNS)
}

/// `2019-06-15T23:35:50.000Z` with milliseconds.
fn shown_time(utc: &str) -> String {
    let (day, time) = utc
        .trim_end_matches('Z')
        .split_once('T')
        .unwrap_or((utc, ""));
    let time: String = time.chars().take(12).collect();
    format!("{day} {time} UTC")
}

fn content(label: &Label) -> String {
    if let Some(light) = label.flooded_by {
        return format!("full of light: {light}");
    }
    let count = |kind, visible| {
        let those = label
            .objects
            .iter()
            .filter(|o| o.kind == kind && o.in_frame && o.visible == visible);
        those.count()
    };
    let (stars, rsos, hidden) = (count("star", true), count("rso", true), count("rso", false));
    let plural = |n: usize, what| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
    let mut text = format!("{}, {} visible", plural(stars, "star"), plural(rsos, "RSO"));
    if hidden > 0 {
        text += &format!(", {} not", plural(hidden, "RSO"));
    }
    if count("moon", true) > 0 {
        text += ", the Moon";
    }
    match count("planet", true) {
        0 => {}
        planets => text += &format!(", {}", plural(planets, "planet")),
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_spread_over_the_run() {
        let of = |frames: u32| -> Vec<u32> { (0..frames).filter(|i| chosen(*i, frames)).collect() };
        assert_eq!(of(3), [0, 1, 2]);
        assert_eq!(of(12).len(), 12);
        assert_eq!(of(50), [0, 4, 9, 13, 18, 22, 27, 31, 36, 40, 45, 49]);
        for frames in 1..400 {
            let shown = of(frames);
            assert_eq!(shown.len(), frames.min(PANELS) as usize);
            assert_eq!((shown[0], shown[shown.len() - 1]), (0, frames - 1));
        }
        // More frames than announced.
        assert!(!chosen(50, 50) && !chosen(12, 0) && chosen(11, 3));
    }

    #[test]
    fn grid_is_nearly_square_up_to_four_columns() {
        let grids = [1, 2, 4, 5, 9, 10, 12].map(columns);
        assert_eq!(grids, [1, 2, 2, 3, 3, 4, 4]);
    }

    #[test]
    fn caption_has_milliseconds() {
        assert_eq!(
            shown_time("2019-06-15T23:35:50.123456789Z"),
            "2019-06-15 23:35:50.123 UTC"
        );
    }
}
