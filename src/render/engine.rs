//! The engine: one vehicle state in, one labelled frame out.

mod exposed;
mod setup;

pub use exposed::{ExposedFrame, FrameInfo, FrameObserver};
pub use setup::{Setup, Sky};

use crate::attitude::VehicleState;
use crate::camera::Camera;
use crate::effect::area_kinds;
use crate::fidelity::{Choice, Fidelity};
use crate::frame::{Frame, Memory};
use crate::label::{Label, ObjectLabel};
use crate::plan::{Plan, allowed, simulated_at};
use crate::render::render;
use crate::render_pool;
use crate::scene::{
    EffectId, Exposure, Faint, OBJECT_NS, Scene, Unobservable, World, add_areas, build_scene,
    build_view, is_flooded,
};
use crate::sky::StarField;
use crate::sky::atmosphere::Atmosphere;
use crate::sky::catalog::Catalog;
use crate::sky::starlight::StarLight;
use hifitime::{Epoch, Unit};
use rayon::ThreadPool;
use skyloop_base::abort::{Abort, WorkLimit};
use skyloop_base::rng::NoiseKey;
use skyloop_orbit::Ages;
use skyloop_orbit::sgp4_batch::Level;
use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

/// Capacity of a label's text, bytes: enough for most labels, to avoid reallocation. Untouched
/// memory is not resident.
const LABEL: usize = 2 << 20;

/// A frame is refused at once if its estimated work exceeds the limit by this factor. Otherwise the
/// actual work is counted: estimates are up to 12 times too high for edges outside the field or
/// full of light.
const REFUSAL_FACTOR: f64 = 40.0;

/// Greatest number of threads to warm up.
const LEADERS: usize = 4;

/// The emulated camera under its sky.
#[derive(Debug)]
pub struct Emulator {
    world: World,
    sky: Sky,
    camera: Arc<Camera>,
    fidelity: Fidelity,
    seed: u64,
    label_snr: f64,
    /// Which effects may run.
    pub choice: Choice,
    /// Whether frames include the expected electrons and the charge.
    pub keep_expected: bool,
    /// The vector instructions for pixels; none for the scalar code. The result is the same.
    pub level: Option<Level>,
    /// Memory of earlier frames.
    memory: Memory,
    /// Memory of an earlier label: its objects and its text.
    label: (Vec<ObjectLabel>, String),
    /// Work limit of a frame, s on one core per megapixel; frames below a megapixel have the limit
    /// of one. None for no limit.
    pub work_limit_s: Option<f64>,
    /// Cancels the current frame, from another thread.
    pub abort: Abort,
    /// Threads of its own for frames; none: rayon's, which all emulators of a process share.
    pub pool: Option<Arc<ThreadPool>>,
    /// The policy applied because the frame would have been late, for labels.
    pub overrun: Option<&'static str>,
    next_frame: u32,
    rejected_records: u32,
    /// The epoch of the last check of element set ages, and whether old ones were reported.
    ages: (Option<Epoch>, bool),
}

impl Emulator {
    /// The emulator of `setup`. Tolerances are limited to their ranges
    /// ([`Fidelity::within_ranges`]); a `label_snr` that is NaN or negative lists all objects.
    pub fn new(setup: impl Into<Setup>) -> Emulator {
        let setup: Setup = setup.into();
        let starlight = Arc::new(StarLight::new(setup.sky.selection));
        Emulator::of(setup, starlight)
    }

    /// The emulator of a further camera of the same vehicle, number `number` from 1 on. It shares
    /// the threads and the objects, whose orbits are computed once, and has its own noise.
    pub fn further_camera(&self, camera: &Camera, number: u64) -> Emulator {
        let setup = Setup {
            camera: camera.clone(),
            fidelity: self.fidelity,
            choice: self.choice.clone(),
            seed: self.seed.wrapping_add(number),
            label_snr: self.label_snr,
            sky: self.sky,
            population: self.world.population.clone(),
            rejected_records: self.rejected_records,
        };
        Emulator {
            pool: self.pool.clone(),
            ..Emulator::of(setup, self.world.starlight.clone())
        }
    }

    fn of(setup: Setup, starlight: Arc<StarLight>) -> Emulator {
        let (sky, population) = (setup.sky, setup.population);
        let camera = Arc::new(setup.camera);
        let band = &camera.optics.band;
        // The slowest parts of the start, in parallel.
        let (stars, ()) = rayon::join(
            || StarField::new(Catalog::embedded(sky.selection), band, sky.colour),
            || population.compute_tracks(),
        );
        let world = World {
            stars,
            atmosphere: Arc::new(Atmosphere::of(band)),
            starlight,
            population,
            corrections: sky.corrections,
        };
        Emulator {
            world,
            sky,
            camera,
            fidelity: setup.fidelity.within_ranges(),
            seed: setup.seed,
            label_snr: setup.label_snr.max(0.0),
            choice: setup.choice,
            keep_expected: false,
            level: Some(Level::best()),
            memory: Memory::default(),
            label: Default::default(),
            work_limit_s: None,
            abort: Abort::default(),
            pool: None,
            overrun: None,
            next_frame: 0,
            rejected_records: setup.rejected_records,
            ages: (None, false),
        }
    }

    /// The data that does not change from frame to frame.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// The camera with its present settings.
    pub fn camera(&self) -> Arc<Camera> {
        self.camera.clone()
    }

    /// The camera's settings. Values outside the limits of camera files give meaningless frames or
    /// [`Unobservable`], but no panic.
    pub fn camera_mut(&mut self) -> &mut Camera {
        Arc::make_mut(&mut self.camera)
    }

    /// Whether there are objects; these need an observer's position.
    pub fn has_objects(&self) -> bool {
        !self.world.population.objects().is_empty()
    }

    /// Records of the configured orbit files that were refused.
    pub fn rejected_records(&self) -> u32 {
        self.rejected_records
    }

    /// Sets the number of the next frame.
    pub fn number_next(&mut self, number: u32) {
        self.next_frame = number;
    }

    /// Number of the next frame.
    pub fn next_frame(&self) -> u32 {
        self.next_frame
    }

    /// The frame of an exposure around `vehicle`'s epoch. `repeat` is the number of earlier frames
    /// of the same attitude message; the same number gives the same noise.
    ///
    /// Fails only where [`Emulator::scene`] does.
    pub fn expose(
        &mut self,
        vehicle: &VehicleState,
        repeat: u32,
    ) -> Result<ExposedFrame, Unobservable> {
        self.expose_observed(&(), &self.camera(), vehicle, repeat)
    }

    /// [`Emulator::expose`] with other settings of the camera and an `observer`. Fails with
    /// [`Unobservable::Abandoned`] once [`Emulator::abort`] is set.
    pub fn expose_observed(
        &mut self,
        observer: &dyn FrameObserver,
        camera: &Arc<Camera>,
        vehicle: &VehicleState,
        repeat: u32,
    ) -> Result<ExposedFrame, Unobservable> {
        // The log's span is carried to another thread.
        let span = tracing::Span::current();
        let pool = self.pool.clone();
        let mut make = || {
            render_pool::together(|| span.in_scope(|| self.made(observer, camera, vehicle, repeat)))
        };
        let made = match pool {
            Some(pool) => pool.install(make),
            None => make(),
        };
        // An abandoned frame has a number too: later numbers do not depend on its progress.
        if matches!(made, Ok(_) | Err(Unobservable::Abandoned)) {
            self.next_frame = self.next_frame.wrapping_add(1);
        }
        made
    }

    fn made(
        &mut self,
        observer: &dyn FrameObserver,
        camera: &Arc<Camera>,
        vehicle: &VehicleState,
        repeat: u32,
    ) -> Result<ExposedFrame, Unobservable> {
        let started = Instant::now();
        let scene = self.scene(camera, vehicle, repeat, &self.choice)?;
        let scene = scene.unless_cancelled()?;
        let plan = Plan::new(&scene, &self.fidelity, &self.choice);
        if scene.is_cancelled() {
            drop(plan);
            return Err(scene.abandon());
        }
        if self.next_frame == 0 {
            plan.log();
        }
        let (number, memory) = (self.next_frame, &mut self.memory);
        let (objects, mut text) = std::mem::take(&mut self.label);
        text.clear();
        text.reserve(LABEL);
        // The label first, on all threads: a frame's header contains its length, so no packet is
        // sent before. Then bands are sent while others are rendered.
        let world = &self.world;
        let mut label = Label::new_in(objects, number, &scene, &plan, world, self.label_snr);
        label.overrun = self.overrun;
        let json = Arc::new(label.to_json_in(text));
        if scene.is_cancelled() {
            drop(plan);
            return Err(scene.abandon());
        }
        // To compute error bounds for the label, images may be formed again.
        if scene.view.limit.is_exceeded() {
            return Err(scene.view.too_much(self.limit_s(camera)?));
        }
        observer.labelled(FrameInfo {
            number,
            json: json.clone(),
            exposure: scene.view.exposure,
            camera: camera.clone(),
            key: scene.view.key,
        });
        let done = |first, dn: &[u16]| observer.rows_done(first, dn);
        let frame = render(&plan, &scene, self.level, self.keep_expected, memory, &done);
        drop(plan);
        let scene = scene.unless_cancelled()?;
        Ok(ExposedFrame {
            number,
            frame,
            label,
            json,
            exposure: scene.view.exposure,
            camera: camera.clone(),
            key: scene.view.key,
            unknown: scene.view.unknown,
            render_time: started.elapsed(),
            population: self.world.population.objects().len(),
            old: self.old(vehicle.epoch),
        })
    }

    /// Renders and discards frames, to prepare orbit tracks, memory and threads for the first real
    /// frame. Each of the first few threads leads one frame with the others and one alone, because
    /// later any thread may lead, with or without help. The first frame, which prepares the orbits,
    /// uses all threads.
    pub fn warm_up(&mut self, vehicle: &VehicleState) {
        let (next_frame, ages) = (self.next_frame, self.ages);
        let leaders = 0..rayon::current_num_threads().min(LEADERS);
        let leads = leaders.flat_map(|leader| [(leader, false), (leader, true)]);
        for (repeat, (leader, alone)) in (0..).zip(leads) {
            // Not number 0, whose plan is logged.
            self.next_frame = next_frame.max(1);
            let exposed = render_pool::run_on(leader, alone, || self.expose(vehicle, repeat));
            if let Some(Ok(exposed)) = exposed {
                self.take_back(exposed);
            }
        }
        (self.next_frame, self.ages) = (next_frame, ages);
        rayon::broadcast(|thread| (thread.index() < LEADERS).then(reserve));
    }

    /// Reuses the memory of an exposed frame for the next.
    pub fn take_back(&mut self, exposed: ExposedFrame) {
        self.recycle(exposed.frame);
        // A text that is still in use is not reused.
        let text = Arc::into_inner(exposed.json).unwrap_or_default();
        let mut objects = exposed.label.objects.sources;
        objects.clear();
        self.label = (objects, text);
    }

    /// Reuses the memory of a frame.
    pub fn recycle(&mut self, frame: Frame) {
        self.memory.recycle(frame);
    }

    /// The ages of element sets, if most are old. Reported once; checked after each day of scene
    /// time.
    fn old(&mut self, at: Epoch) -> Option<Ages> {
        let (checked, is_reported) = self.ages;
        let is_near = |checked: Epoch| (checked - at).abs() < Unit::Day * 1;
        if is_reported || checked.is_some_and(is_near) {
            return None;
        }
        let ages = Ages::of(self.world.population.objects(), at).filter(Ages::are_old);
        self.ages = (Some(at), ages.is_some());
        ages
    }

    /// The scene of an exposure around `vehicle`'s epoch, with the effects that `choice` allows.
    ///
    /// Fails if [`build_view`] does, and if the work exceeds [`Emulator::work_limit_s`]. If area
    /// light fills every pixel, a frame over the limit is rendered without motion.
    pub fn scene(
        &self,
        camera: &Arc<Camera>,
        vehicle: &VehicleState,
        repeat: u32,
        choice: &Choice,
    ) -> Result<Scene, Unobservable> {
        let key = NoiseKey {
            seed: self.seed,
            sequence: vehicle.sequence,
            repeat,
        };
        let limit_s = self.limit_s(camera)?;
        let exposure = Exposure::around(vehicle.epoch, camera.exposure_s);
        let faint = self.faint(camera, choice);
        let (world, fidelity) = (&self.world, &self.fidelity);
        let mut view = build_view(world, camera, vehicle, exposure, fidelity, key, faint)?;
        view.level = self.level;
        let mut view = add_areas(view, world, area_kinds(), &allowed(choice));
        loop {
            view.limit = WorkLimit::new(limit_s, self.abort.clone());
            view.limit.spend(view.search_ns());
            let (simulated, estimated_ms) = simulated_at(&view, fidelity, choice);
            let estimated_s = estimated_ms * 1e-3 / REFUSAL_FACTOR;
            let too_much = view.too_much(limit_s);
            let is_exceeded = limit_s.is_some_and(|limit_s| estimated_s > limit_s);
            if !is_exceeded {
                let scene = build_scene(view, simulated, fidelity);
                if !scene.view.limit.is_exceeded() {
                    tracing::debug!(
                        "images and light: {:.3} s on one core",
                        scene.view.limit.spent_s()
                    );
                    return Ok(scene);
                }
                view = scene.view;
            }
            if view.still_in_flood || view.limit.is_cancelled() {
                return Err(too_much);
            }
            // If light fills every pixel, motion is visible only in the expected electrons of a
            // frame without noise.
            view.limit = WorkLimit::new(limit_s, self.abort.clone());
            view.limit.spend(view.search_ns());
            if !choice.noise || !is_flooded(&view, &allowed(choice), fidelity) {
                return Err(too_much);
            }
            view.still_in_flood = true;
        }
    }

    /// The work limit of a frame, s on one core. Fails if the search for objects exceeds it.
    fn limit_s(&self, camera: &Camera) -> Result<Option<f64>, Unobservable> {
        let Some(limit_s) = self.work_limit_s else {
            return Ok(None);
        };
        let limit_s = limit_s * (camera.detector.pixels() as f64 * 1e-6).max(1.0);
        let sources = self.world.population.objects().len();
        if sources as f64 * OBJECT_NS * 1e-9 <= limit_s {
            return Ok(Some(limit_s));
        }
        Err(Unobservable::TooMuchWork {
            sources,
            length_px: 0.0,
            exposure_s: camera.exposure_s,
            limit_s,
        })
    }

    /// The signal-to-noise ratios, with read noise and quantisation, below which sources have no
    /// image. Sources that labels list have one.
    fn faint(&self, camera: &Camera, choice: &Choice) -> Faint {
        let read_e = allowed(choice).only_with(EffectId::ReadNoise, camera.detector.read_noise_e);
        Faint {
            snr: self.fidelity.skip_snr.min(self.label_snr),
            unlit_snr: self.label_snr,
            star_snr: self.fidelity.star_snr.min(self.label_snr),
            floor_e: libm::hypot(read_e, camera.detector.quantisation_variance().sqrt()),
        }
    }

    /// The error tolerances.
    pub fn fidelity(&self) -> &Fidelity {
        &self.fidelity
    }

    /// Sets the tolerances from the next frame on, each limited to its range
    /// ([`Fidelity::within_ranges`]).
    pub fn set_fidelity(&mut self, fidelity: Fidelity) {
        self.fidelity = fidelity.within_ranges();
    }
}

/// Allocates memory on this thread, touches it and frees it. The allocator keeps it for frames with
/// more in view: in glibc a freed block of 4 MiB raises the thresholds for returning memory to the
/// system to 4 and 8 MiB (`M_MMAP_THRESHOLD` and `M_TRIM_THRESHOLD` in mallopt(3)).
fn reserve() {
    const LARGE: [usize; 6] = [4096, 2048, 1024, 512, 256, 128];
    const SMALL: [usize; 64] = [64; 64];
    let touched = |kilo| vec![1u8; kilo << 10];
    drop(black_box((LARGE.map(touched), SMALL.map(touched))));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sky::Corrections;
    use crate::sky::catalog::Selection;
    use crate::sky::photometry::Sphere;
    use crate::sky::population::{Appearances, Population};
    use skyloop_base::load::Folder;

    /// All cameras share one population and one starlight.
    #[test]
    fn cameras_of_one_vehicle_share_the_sky() {
        let camera = Camera::load("rigel-l", &Folder::current()).unwrap();
        let sky = Sky {
            selection: Selection::Bsc,
            corrections: Corrections::default(),
            colour: true,
        };
        let first = Emulator::new(Setup {
            camera: camera.clone(),
            fidelity: Fidelity::REALTIME,
            choice: Choice::default(),
            seed: 1,
            label_snr: 1.0,
            sky,
            population: Arc::new(Population::new(
                Vec::new(),
                Sphere::default(),
                Appearances::new(),
            )),
            rejected_records: 0,
        });
        let second = first.further_camera(&camera, 1);
        let [a, b] = [&first.world, &second.world];
        assert!(Arc::ptr_eq(&a.population, &b.population));
        assert!(Arc::ptr_eq(&a.starlight, &b.starlight));
        assert_ne!(first.seed, second.seed);
    }
}
