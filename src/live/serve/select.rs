//! Selection of the brightest objects and of windows around the brightest stars, for slow links.

use skyloop_protocols::reply::ID_LENGTH;
use skyloop_protocols::{ObjectRecord, Positions};
use skyloop_render::engine::ExposedFrame;
use skyloop_render::label::ObjectLabel;

/// Stars and RSOs whose centroid is in the frame, sorted by brightness. The Moon, planets,
/// particles and defects are only in the label's text.
fn by_brightness(
    exposed: &ExposedFrame,
    wanted: impl Fn(&ObjectLabel) -> bool,
) -> Vec<&ObjectLabel> {
    let objects = exposed.label.objects.sources.iter();
    let mut objects: Vec<&ObjectLabel> = objects
        .filter(|object| object.in_frame && object.planet.is_none() && wanted(object))
        .collect();
    objects.sort_by(|a, b| b.electrons.total_cmp(&a.electrons));
    objects
}

/// Records of the `max` brightest objects in the frame.
pub(super) fn brightest_objects(exposed: &ExposedFrame, max: u16) -> Vec<u8> {
    by_brightness(exposed, |_| true)
        .into_iter()
        .take(usize::from(max))
        .flat_map(|object| record(object).to_bytes())
        .collect()
}

fn record(object: &ObjectLabel) -> ObjectRecord {
    let mut id = [0; ID_LENGTH];
    for (byte, character) in id.iter_mut().zip(object.id.bytes()) {
        *byte = character;
    }
    ObjectRecord {
        is_rso: object.rso.is_some(),
        in_frame: object.in_frame,
        visible: object.visible,
        id,
        x_px: object.x_px,
        y_px: object.y_px,
        dx_px: (object.x1_px - object.x0_px) as f32,
        dy_px: (object.y1_px - object.y0_px) as f32,
        mag: object.mag as f32,
        snr: object.snr as f32,
        electrons: object.electrons as f32,
    }
}

/// First pixels (column, row) of windows of `size` columns and rows: around `positions`, or around
/// the `max` brightest stars. Each lies inside the frame: near an edge it is shifted.
pub(super) fn windows(
    exposed: &ExposedFrame,
    size: u8,
    max: u8,
    positions: Option<&Positions>,
) -> Vec<[u16; 2]> {
    let detector = &exposed.camera.detector;
    let first = |centre: f64, pixels: usize| {
        let last = pixels as f64 - f64::from(size);
        (centre.round() - f64::from(size / 2)).clamp(0.0, last.max(0.0)) as u16
    };
    let corner = |x: f64, y: f64| [first(x, detector.width), first(y, detector.height)];
    match positions {
        Some(positions) => {
            let centres = positions.centres().iter();
            let centres = centres.map(|[column, row]| corner(f64::from(*column), f64::from(*row)));
            centres.collect()
        }
        None => {
            let stars = by_brightness(exposed, |object| object.rso.is_none()).into_iter();
            let stars = stars.take(usize::from(max));
            stars.map(|star| corner(star.x_px, star.y_px)).collect()
        }
    }
}
