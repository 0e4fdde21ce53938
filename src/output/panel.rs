//! One panel of the contact sheet: a stretched frame with its stars and RSOs ringed and named.

use super::canvas::{Canvas, text_size};
use super::names::shown;
use super::stretch::{Levels, Stretch, panel_size, scaled};
use embedded_graphics::mono_font::MonoFont;
use embedded_graphics::mono_font::iso_8859_1::{FONT_6X12, FONT_7X13_BOLD};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use embedded_graphics::primitives::Rectangle;
use image::{Rgb, RgbImage};
use skyloop_render::camera::Camera;
use skyloop_render::frame::Frame;
use skyloop_render::label::{Label, ObjectLabel};

/// Stars.
pub(crate) const STAR: Rgb888 = Rgb888::new(110, 190, 255);
/// Visible RSOs.
pub(crate) const RSO: Rgb888 = Rgb888::new(255, 170, 50);
/// The Moon and planets.
pub(crate) const PLANET: Rgb888 = Rgb888::new(150, 230, 150);
/// RSOs that are not visible.
pub(crate) const HIDDEN: Rgb888 = Rgb888::new(255, 110, 150);

/// Number of named stars, brightest first.
const NAMED: usize = 12;
/// Number of ringed stars, brightest first.
pub(crate) const RINGED: usize = 60;
/// Space around an object's track in its ring, px of the panel.
const MARK_MARGIN: f64 = 7.0;

struct Mark {
    centre: [f64; 2],
    radius: f64,
    color: Rgb888,
    broken: bool,
    text: Option<String>,
    /// Whether the name is drawn even if it covers another.
    must: bool,
}

impl Mark {
    fn area(&self) -> Rectangle {
        let centre = Point::new(self.centre[0].round() as i32, self.centre[1].round() as i32);
        Rectangle::with_center(centre, Size::new_equal(2 * self.radius.ceil() as u32 + 1))
    }

    fn font(&self) -> &'static MonoFont<'static> {
        if self.must {
            &FONT_7X13_BOLD
        } else {
            &FONT_6X12
        }
    }
}

/// The frame's picture with its marks.
pub(crate) fn draw(camera: &Camera, label: &Label, frame: &Frame) -> RgbImage {
    let from = [frame.width, frame.height];
    let to = panel_size(from);
    let scale = [to[0] as f64 / from[0] as f64, to[1] as f64 / from[1] as f64];
    let values = scaled(&frame.dn, from, to);
    // A panel's pixel is the mean of several camera pixels, which reduces its noise.
    let averaged = 1.0 / (scale[0] * scale[1]).min(1.0);
    let stretch = Stretch::new(Levels::of(camera, label), values.iter().copied(), averaged);
    let image = RgbImage::from_fn(to[0] as u32, to[1] as u32, |x, y| {
        let value = values[y as usize * to[0] + x as usize];
        Rgb([stretch.grey(f64::from(value)); 3])
    });
    let mut canvas = Canvas(image);
    let marks = marks(label, scale);
    for mark in &marks {
        let weight = if mark.text.is_some() { 1.6 } else { 0.8 };
        canvas.ring(mark.centre, mark.radius, weight, mark.color, mark.broken);
    }
    for (mark, area) in place_names(&marks, canvas.bounding_box()) {
        let text = mark.text.as_deref().unwrap_or_default();
        canvas.text_on_shade(text, area, mark.font(), mark.color);
    }
    canvas.0
}

/// RSOs first, then the Moon and planets: their names are placed before those of stars.
fn marks(label: &Label, scale: [f64; 2]) -> Vec<Mark> {
    let in_frame = |kind| {
        label
            .objects
            .iter()
            .filter(move |object| object.kind == kind && object.in_frame)
    };
    let mut stars: Vec<&ObjectLabel> = in_frame("star").filter(|star| star.visible).collect();
    stars.sort_by(|a, b| b.electrons.total_cmp(&a.electrons));
    let rsos = in_frame("rso").map(|object| rso_mark(object, scale));
    let stars = stars.iter().take(RINGED).enumerate().map(|(i, star)| Mark {
        text: (i < NAMED).then(|| shown(star).to_string()),
        ..mark(star, scale, STAR)
    });
    let planets = ["moon", "planet"].into_iter().flat_map(in_frame);
    let planets = planets.map(|body| Mark {
        text: Some(shown(body).to_string()),
        must: true,
        ..mark(body, scale, PLANET)
    });
    rsos.chain(planets).chain(stars).collect()
}

fn rso_mark(object: &ObjectLabel, scale: [f64; 2]) -> Mark {
    let name = shown(object);
    let text = match &object.reason {
        Some(reason) => {
            let short = reason.split(':').next().unwrap_or(reason);
            format!("{name} ({short})")
        }
        None => name.to_string(),
    };
    let color = if object.visible { RSO } else { HIDDEN };
    let plain = mark(object, scale, color);
    Mark {
        radius: plain.radius + 3.0,
        broken: !object.visible,
        text: Some(text),
        must: true,
        ..plain
    }
}

fn mark(object: &ObjectLabel, scale: [f64; 2], color: Rgb888) -> Mark {
    let track = [
        (object.x1_px - object.x0_px) * scale[0],
        (object.y1_px - object.y0_px) * scale[1],
    ];
    Mark {
        // The centre of the first pixel is (0, 0) in both pictures.
        centre: [
            (object.x_px + 0.5) * scale[0] - 0.5,
            (object.y_px + 0.5) * scale[1] - 0.5,
        ],
        radius: MARK_MARGIN + (libm::hypot(track[0], track[1]) / 2.0).min(200.0),
        color,
        broken: false,
        text: None,
        must: false,
    }
}

/// Positions of names: on the side of their ring with the least overlap; a star's name that would
/// cover another one is omitted.
fn place_names(marks: &[Mark], panel: Rectangle) -> Vec<(&Mark, Rectangle)> {
    let mut placed: Vec<(&Mark, Rectangle)> = Vec::new();
    for mark in marks {
        let Some(text) = &mark.text else { continue };
        let names_under =
            |area: &Rectangle| -> u32 { placed.iter().map(|(_, other)| common(area, other)).sum() };
        // Its own ring counts too: near the panel's edge a name may be moved onto it.
        let cost = |area: &Rectangle| {
            let rings = marks.iter().map(|other| common(area, &other.area()));
            10 * names_under(area) + rings.sum::<u32>()
        };
        let best = sides(mark, text_size(text, mark.font()), panel)
            .into_iter()
            .min_by_key(cost);
        if let Some(area) = best.filter(|area| mark.must || names_under(area) == 0) {
            placed.push((mark, area));
        }
    }
    placed
}

/// Right, left, above and below the ring, moved into the panel.
fn sides(mark: &Mark, size: Size, panel: Rectangle) -> [Rectangle; 4] {
    let (w, h) = (size.width as i32, size.height as i32);
    let [x, y] = mark.centre.map(|c| c.round() as i32);
    let gap = mark.radius.ceil() as i32 + 2;
    let room = panel.size;
    let last = Point::new(room.width as i32 - w, room.height as i32 - h);
    [
        Point::new(x + gap, y - h / 2),
        Point::new(x - gap - w, y - h / 2),
        Point::new(x - w / 2, y - gap - h),
        Point::new(x - w / 2, y + gap),
    ]
    .map(|corner| {
        let inside = corner.component_min(last).component_max(Point::zero());
        Rectangle::new(inside, size)
    })
}

/// Common area of two rectangles, px.
fn common(a: &Rectangle, b: &Rectangle) -> u32 {
    let size = a.intersection(b).size;
    size.width * size.height
}
