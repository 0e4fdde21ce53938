//! Builds a [`Scene`] in stages. A frame that is cancelled or exceeds its work limit ends before
//! the next stage, and within long stages.

use super::area::area_light::AreaLight;
use super::area::full::Full;
use super::area::image::lit_by;
use super::area::together::TotalAreaLight;
use super::blooming::BloomingColumns;
use super::bounds;
use super::bounds::brightest::stars_and_all_lit_e;
use super::charge::spilling_e;
use super::content::Scene;
use super::effect_set::{EffectId, EffectSet};
use super::imaging::Imaging;
use super::lit::Lit;
use super::signal::{Buffers, Noise};
use super::source::Source;
use super::struck::Struck;
use super::transfer_smear;
use super::view::View;
use crate::camera::Flux;
use crate::fidelity::Fidelity;
use crate::sky::radiation;
use rayon::prelude::*;

/// The stages after image formation; each uses the results of earlier ones.
const STAGES: [fn(&mut Scene); 5] = [
    add_areas_up,
    find_snr,
    draw_particles,
    find_brightest,
    find_blooming,
];

/// Time of a particle, and of a pixel that its charge diffuses to, for each step of its track, ns.
const EVENT_NS: f64 = 1000.0;
const DIFFUSED_NS: f64 = 45.0;

/// Forms all images of a view. Once the view's work limit is over, the scene is incomplete and must
/// not be used.
pub fn build_scene(view: View, simulated: EffectSet, fidelity: &Fidelity) -> Scene {
    let (sources, areas) = rayon::join(
        || images(&view, &simulated, fidelity),
        || area_lights(&view, &simulated, fidelity),
    );
    let struck = Struck::of(&[], &view.camera.detector, &view.limit);
    let mut scene = Scene {
        view,
        simulated,
        sources,
        areas,
        areas_light: TotalAreaLight::default(),
        peaks_e: Vec::new(),
        stars_e: Vec::new(),
        transfer_smear_e: Vec::new(),
        events: Vec::new(),
        struck,
        particles_left_out: 0.0,
        blooming: BloomingColumns::default(),
        spilling_e: Vec::new(),
        fidelity: *fidelity,
    };
    for stage in STAGES {
        if !scene.view.limit.is_over() {
            stage(&mut scene);
        }
    }
    scene
}

fn add_areas_up(scene: &mut Scene) {
    let pixels = scene.sources.iter();
    let pixels = pixels.map(|source| source.footprint.shares().len());
    scene.areas_light = TotalAreaLight::of(&scene.areas, &scene.view, pixels.sum());
    let together = scene.areas_light.light().into_iter().map(Lit::from);
    let lights = scene.sources.iter().map(Lit::from).chain(together);
    scene.transfer_smear_e = transfer_smear::transfer_smear_e(&scene.view, lights);
}

fn find_snr(scene: &mut Scene) {
    let transfer_smear_e =
        (scene.simulated).only_with(EffectId::FrameTransfer, &scene.transfer_smear_e[..]);
    let noise = Noise::new(
        &scene.view,
        &scene.simulated,
        transfer_smear_e,
        &scene.areas_light,
    );
    let limit = &scene.view.limit;
    let sources = scene.sources.par_iter_mut().filter(|_| !limit.is_over());
    sources.for_each_init(Buffers::default, |buffers, source| {
        let mut snr = |e: f64| noise.snr(&source.footprint, e, buffers);
        source.clear_snr = snr(source.clear_e);
        source.snr = if source.electrons == source.clear_e {
            source.clear_snr
        } else {
            snr(source.electrons)
        };
    });
}

/// Draws the particles of this exposure, and counts those beyond the limit. Without an orbit the
/// flux is that of free space.
fn draw_particles(scene: &mut Scene) {
    let Scene {
        view, simulated, ..
    } = scene;
    let camera = &view.camera;
    let particles = camera.radiation.as_ref();
    let Some(particles) =
        particles.filter(|_| simulated.has(EffectId::Radiation) && simulated.noise)
    else {
        return;
    };
    let flux = match particles.flux {
        Flux::Fixed(flux) => flux,
        Flux::ByOrbit => view.vehicle.orbit.map_or(radiation::FREE_SPACE, |state| {
            radiation::flux(&state.position_m, view.exposure.mid)
        }),
    };
    let expected = particles.expected_events(&camera.detector, flux, view.exposure.duration_s);
    let max_events = particles.max_events(&camera.detector);
    scene.particles_left_out = (expected - max_events).max(0.0);
    let pixels = particles.work_an_event(&camera.detector);
    let event_ns = EVENT_NS + pixels * DIFFUSED_NS;
    view.limit.spend(expected.min(max_events) * event_ns);
    let events = particles.each_event(&camera.detector, expected, view.key);
    let events = events.take_while(|_| !view.limit.is_over());
    scene.events = events.collect();
    scene.struck = Struck::of(&scene.events, &camera.detector, &view.limit);
}

fn find_brightest(scene: &mut Scene) {
    [scene.stars_e, scene.peaks_e] = stars_and_all_lit_e(scene);
}

fn find_blooming(scene: &mut Scene) {
    scene.blooming = bounds::find_blooming(scene);
    scene.spilling_e = spilling_e(scene);
}

/// The images of sources that touch the detector.
fn images(view: &View, simulated: &EffectSet, fidelity: &Fidelity) -> Vec<Source> {
    let imaging = Imaging {
        view,
        simulated,
        fidelity,
    };
    let images = view.candidates.par_iter().map(|candidate| {
        let shines = simulated.has(candidate.body.effect());
        shines.then(|| imaging.image(candidate))?
    });
    // Collected in place first: moving large sources between growing lists is slow.
    let images: Vec<Option<Source>> = images.collect();
    // Compacted in place: `flatten` would copy them into a second list.
    #[expect(clippy::filter_map_identity)]
    let sources = images.into_iter().filter_map(|image| image);
    sources.collect()
}

/// The light of area sources.
fn area_lights(view: &View, simulated: &EffectSet, fidelity: &Fidelity) -> Vec<AreaLight> {
    let full = Full::of(view, view.areas.iter(), simulated, fidelity);
    let areas = view.areas.par_iter();
    let areas = areas.filter(|area| simulated.has(area.effect));
    let lights = areas.map(|area| lit_by(view, area, simulated, &full, fidelity));
    lights.collect()
}
