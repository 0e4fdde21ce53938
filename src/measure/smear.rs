//! The cost of smear: moving stars against the same stars at rest.

use super::population::scene_with_population;
use super::ratio::{MS, Row, row};
use nalgebra::Vector3;
use skyloop_base::load::{ConfigError, Folder};
use skyloop_render::attitude::VehicleState;
use skyloop_render::camera::Camera;
use skyloop_render::engine::Emulator;
use skyloop_render::fidelity::Fidelity;
use skyloop_render::scene::{EffectId, EffectSet, Source, View, build_scene};
use std::hint::black_box;

/// Number of stars, and length (px) of their tracks.
const STARS: usize = 300;
const LENGTH_PX: f64 = 50.0;
/// Angle (rad) of the tracks from the columns to the rows: along neither.
const SLOPE: f64 = 0.5;
const ROUNDS: usize = 41;
/// Rows that are drawn together, all bands into the same charge, as in the renderer.
const BAND: usize = 32;

/// Stars of the catalogue in a rotating camera of 1024 x 1024 pixels.
struct Stars {
    view: View,
    simulated: EffectSet,
    fidelity: Fidelity,
    electrons: Vec<f32>,
}

/// Cost of smeared stars over stars at rest: tracks, footprints, signal-to-noise ratios, light on
/// pixels. The limit is a factor of 4.
///
/// Errors: the built-in scene or camera cannot be read.
pub(crate) fn smear() -> Result<Row, ConfigError> {
    let mut stars = Stars::new()?;
    let moving = stars.simulated;
    let still = moving.without(EffectId::Smear);
    let views = |view: &View| vec![view.clone(); ROUNDS];
    let (mut first, mut second) = (views(&stars.view), views(&stars.view));
    let mut take = |simulated: EffectSet, views: &mut Vec<View>| {
        if let Some(view) = views.pop() {
            stars.take(view, simulated);
        }
    };
    let take = std::cell::RefCell::new(&mut take);
    let row = row(
        format!("{STARS} stars of {LENGTH_PX} px, smeared"),
        "the same, still",
        None,
        ROUNDS,
        [MS; 2],
        |_| take.borrow_mut()(moving, &mut first),
        |_| take.borrow_mut()(still, &mut second),
    );
    Ok(row.at_most(4.0))
}

impl Stars {
    fn new() -> Result<Stars, ConfigError> {
        let (mut config, mut vehicle) = scene_with_population(0)?;
        config.camera = Camera::load("rigel-l", &Folder::current())?;
        let emulator = Emulator::new(&mut config);
        let camera = emulator.camera();
        vehicle.rates = rates(&camera);
        let scene = |vehicle: &VehicleState| emulator.scene(&camera, vehicle, 0, &emulator.choice);
        let scene = scene(&vehicle).map_err(|error| ConfigError::Orbit(error.to_string()))?;
        let is_whole = |source: &&Source| {
            let inside = |at: [f64; 2]| camera.detector.contains(at);
            source.body.identity().0 == "star" && inside(source.start) && inside(source.end)
        };
        let whole = scene.sources.iter().filter(is_whole);
        let whole: Vec<_> = whole
            .map(|source| source.body.identity())
            .take(STARS)
            .collect();
        let mut view = scene.view;
        view.areas.clear();
        view.candidates
            .retain(|candidate| whole.contains(&candidate.body.identity()));
        Ok(Stars {
            electrons: vec![0.0; camera.detector.width * BAND],
            view,
            simulated: EffectSet::default()
                .with(EffectId::Stars)
                .with(EffectId::Smear),
            fidelity: *emulator.fidelity(),
        })
    }

    fn take(&mut self, view: View, simulated: EffectSet) {
        let [width, height] = [view.camera.detector.width, view.camera.detector.height];
        let scene = build_scene(view, simulated, &self.fidelity);
        for first in (0..height).step_by(BAND) {
            let rows = first..(first + BAND).min(height);
            for source in &scene.sources {
                let (e, level) = (source.electrons, scene.view.level);
                let pixels = &mut self.electrons;
                source
                    .footprint
                    .light(level, e, rows.clone(), width, pixels);
            }
        }
        black_box((&self.electrons, &scene));
    }
}

/// The body rates (rad/s) for tracks of this length in an exposure.
fn rates(camera: &Camera) -> Vector3<f64> {
    let turn = LENGTH_PX / (camera.optics.focal_px * camera.exposure_s);
    let (sin, cos) = libm::sincos(SLOPE);
    camera
        .mounting
        .inverse()
        .rotate(&Vector3::new(turn * sin, turn * cos, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_have_the_configured_number_and_track_length() {
        let Stars {
            view,
            simulated,
            fidelity,
            ..
        } = Stars::new().unwrap();
        let scene = build_scene(view, simulated, &fidelity);
        assert_eq!(scene.sources.len(), STARS);
        for source in &scene.sources {
            // The field is 21 deg wide: the plane's scale grows with the tangent.
            let off = source.length_px() / LENGTH_PX - 1.0;
            assert!(off.abs() < 0.08, "{off}");
        }
    }
}
