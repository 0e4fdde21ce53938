//! A scene is made in stages. Before each of them, and within those that take long, a frame that is cancelled or has cost too much is given up.

use super::signal::{Held, Noise};
use super::{
    AreaLight, EffectId, EffectSet, Full, Lit, Scene, Source, Spill, Struck, Together,
    Unobservable, View, trail,
};
use crate::camera::Flux;
use crate::fidelity::Fidelity;
use crate::sky::radiation;
use rayon::prelude::*;

/// What follows the images, each from what those before it have found.
const STAGES: [fn(&mut Scene); 5] = [
    Scene::add_areas_up,
    Scene::find_snr,
    Scene::draw_particles,
    Scene::find_brightest,
    Scene::find_spill,
];

/// ns of a particle, and of a pixel at a step of its track that its charge diffuses to.
const EVENT_NS: f64 = 1000.0;
const DIFFUSED_NS: f64 = 45.0;

impl Scene {
    /// The images of all that is in view. Once the view's limit is over, it is incomplete and must not be used.
    pub fn new(view: View, simulated: EffectSet, fidelity: &Fidelity) -> Scene {
        let (sources, areas) = rayon::join(
            || images(&view, &simulated, fidelity),
            || areas(&view, &simulated, fidelity),
        );
        let struck = Struck::of(&[], &view.camera.detector, &view.limit);
        let mut scene = Scene {
            view,
            simulated,
            sources,
            areas,
            areas_light: Together::default(),
            peaks_e: Vec::new(),
            stars_e: Vec::new(),
            trail_e: Vec::new(),
            events: Vec::new(),
            struck,
            particles_left_out: 0.0,
            spill: Spill::default(),
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

    /// Whether its frame is cancelled: what is computed from then on is incomplete, and must not be used.
    pub fn is_cancelled(&self) -> bool {
        self.view.limit.is_cancelled()
    }

    /// Fails if its frame is cancelled.
    pub fn unless_cancelled(self) -> Result<Scene, Unobservable> {
        match self.is_cancelled() {
            true => Err(self.abandon()),
            false => Ok(self),
        }
    }

    /// Frees its memory on a thread of its own, and reports its frame as abandoned. Freeing 10,000 sources takes 50 ms. A thread of the pool would
    /// delay the end of the frame, which waits for all of those.
    pub fn abandon(self) -> Unobservable {
        let freed = std::thread::Builder::new().name("free".to_string());
        // Without a thread it is freed here.
        let _ = freed.spawn(move || drop(self));
        Unobservable::Abandoned
    }

    fn add_areas_up(&mut self) {
        let pixels = self.sources.iter();
        let pixels = pixels.map(|source| source.footprint.shares().len());
        self.areas_light = Together::of(&self.areas, &self.view, pixels.sum());
        let together = self.areas_light.light().into_iter().map(Lit::from);
        let lights = self.sources.iter().map(Lit::from).chain(together);
        self.trail_e = trail::trail_e(&self.view, lights);
    }

    fn find_snr(&mut self) {
        let trail_e = (self.simulated).only_with(EffectId::FrameTransfer, &self.trail_e[..]);
        let noise = Noise::new(&self.view, &self.simulated, trail_e, &self.areas_light);
        let limit = &self.view.limit;
        let sources = self.sources.par_iter_mut().filter(|_| !limit.is_over());
        sources.for_each_init(Held::default, |held, source| {
            let mut snr = |e: f64| noise.snr(&source.footprint, e, held);
            source.clear_snr = snr(source.clear_e);
            source.snr = if source.electrons == source.clear_e {
                source.clear_snr
            } else {
                snr(source.electrons)
            };
        });
    }

    /// Draws the particles of this exposure, and counts those that are left out. Without an orbit the observer counts as far outside the Earth's field.
    fn draw_particles(&mut self) {
        let Scene {
            view, simulated, ..
        } = self;
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
        let most = particles.most_events(&camera.detector);
        self.particles_left_out = (expected - most).max(0.0);
        let pixels = particles.work_an_event(&camera.detector);
        let event_ns = EVENT_NS + pixels * DIFFUSED_NS;
        view.limit.spend(expected.min(most) * event_ns);
        let events = particles.each_event(&camera.detector, expected, view.key);
        let events = events.take_while(|_| !view.limit.is_over());
        self.events = events.collect();
        self.struck = Struck::of(&self.events, &camera.detector, &view.limit);
    }

    fn find_brightest(&mut self) {
        [self.stars_e, self.peaks_e] = self.stars_and_all_lit_e();
    }

    fn find_spill(&mut self) {
        self.spill = Spill::of(self);
        self.spilling_e = self.spilling_e();
    }
}

/// The images of sources that touch the detector.
fn images(view: &View, simulated: &EffectSet, fidelity: &Fidelity) -> Vec<Source> {
    let images = view.candidates.par_iter().map(|candidate| {
        let shines = simulated.has(candidate.body.effect());
        shines.then(|| view.image(candidate, simulated, fidelity))?
    });
    // In their places first: a source is large to be moved from one growing list to another.
    let images: Vec<Option<Source>> = images.collect();
    // Those that there are close up where they lie: `flatten` would copy them into a second list.
    #[expect(clippy::filter_map_identity)]
    let sources = images.into_iter().filter_map(|image| image);
    sources.collect()
}

/// The light of area sources.
fn areas(view: &View, simulated: &EffectSet, fidelity: &Fidelity) -> Vec<AreaLight> {
    let full = Full::of(view, view.areas.iter(), simulated, fidelity);
    let areas = view.areas.par_iter();
    let areas = areas.filter(|area| simulated.has(area.kind.effect));
    let lights = areas.map(|area| view.lit_by(area, simulated, &full, fidelity));
    lights.collect()
}
