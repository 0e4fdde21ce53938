//! Memory allocations of a frame. Its pixels allocate nothing from the second frame on; scene, plan
//! and label stay within the limits below.
//!
//! Counted on one thread, which then makes the whole frame. With several threads, each allocates a
//! band's charge in the first frame in which it gets a band.

use allocation_counter::measure;
use skyloop::attitude::VehicleState;
use skyloop::camera::Camera;
use skyloop::config::Config;
use skyloop::effect::{Decision, Pass};
use skyloop::engine::Emulator;
use skyloop::flight;
use skyloop::frame::Memory;
use skyloop::kernels::pack_12;
use skyloop::load::Folder;
use skyloop::orbit::sgp4_batch::Level;
use skyloop::orbit::synth::population;
use skyloop::plan::Plan;
use skyloop::render::render;
use skyloop_protocols::pixels::{pack, packed_length, pixels_per_block};
use skyloop_protocols::{MAX_PACKET, Packing};

/// Objects added to the built-in scene, as in `skyloop bench frame`.
const OBJECTS: usize = 20_000;
/// Margin for other machines and builds.
const MARGIN: f64 = 1.2;

/// A camera, its full well (e-) if changed, and the allocations of scene, plan and label: calls and
/// bytes, as measured on x86-64.
struct Case {
    camera: &'static str,
    full_well_e: Option<f64>,
    calls: u64,
    bytes: u64,
}

const CASES: [Case; 3] = [
    case("rigel-l", None, [11_300, 6_320_000]),
    case("fai-nir", None, [18_600, 8_220_000]),
    // Charge blooms along columns, so the whole frame is needed at once.
    case("ccd-transfer", Some(5000.0), [7_150, 15_110_000]),
];

const fn case(camera: &'static str, full_well_e: Option<f64>, [calls, bytes]: [u64; 2]) -> Case {
    Case {
        camera,
        full_well_e,
        calls,
        bytes,
    }
}

/// The built-in scene with many objects, and its first vehicle.
fn scene_of(case: &Case) -> (Emulator, VehicleState) {
    let mut config = Config::builtin().unwrap();
    let vehicle = flight::vehicle(&flight::mission(&config).unwrap(), 0).unwrap();
    let synthetic = population(OBJECTS, 1, vehicle.epoch);
    config
        .objects
        .extend(synthetic.iter().map(|one| one.object()));
    config.camera = Camera::load(case.camera, &Folder::current()).unwrap();
    let detector = &mut config.camera.detector;
    detector.full_well_e = case.full_well_e.unwrap_or(detector.full_well_e);
    (Emulator::new(&mut config), vehicle)
}

fn on_one_thread<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1);
    pool.build().unwrap().install(work)
}

#[test]
fn pixels_allocate_nothing_from_the_second_frame_on() {
    for case in &CASES {
        let (emulator, vehicle) = scene_of(case);
        let (camera, choice) = (emulator.camera(), &emulator.choice);
        let scene = emulator.scene(&camera, &vehicle, 0, choice).unwrap();
        on_one_thread(|| {
            let plan = Plan::new(&scene, emulator.fidelity(), choice);
            let runs = |name: &str| {
                let mut steps = plan.steps.iter().filter(|step| step.effect.name == name);
                steps.any(|step| matches!(step.decision, Decision::Run { .. }))
            };
            for name in [
                "stars",
                "rsos",
                "zodiacal light",
                "shot noise",
                "read noise",
            ] {
                assert!(runs(name), "{}: {name}", case.camera);
            }
            let is_whole = plan.steps.iter().any(|step| match &step.decision {
                Decision::Run { pass, .. } => matches!(pass, Pass::Frame(_)),
                _ => false,
            });
            assert_eq!(is_whole, case.full_well_e.is_some(), "{}", case.camera);
            let packing = Packing::for_bits(camera.detector.bits);
            let level = Some(Level::best());
            let (mut memory, mut packed) = (Memory::default(), [0; MAX_PACKET]);
            let mut frame = || {
                let frame = render(&plan, &scene, level, false, &mut memory, &|_, _| {});
                for pixels in frame.dn.chunks(pixels_per_block(packing)) {
                    let data = &mut packed[..packed_length(packing, pixels.len())];
                    match packing {
                        Packing::Bits12 => pack_12(level, pixels, data),
                        Packing::Bits16 => pack(packing, pixels, data).unwrap(),
                    }
                }
                memory.recycle(frame);
            };
            // The first frame allocates its buffers.
            assert!(measure(&mut frame).count_total > 0);
            for number in 1..4 {
                let requested = measure(&mut frame);
                assert_eq!(
                    requested.count_total, 0,
                    "{}, {number}: {requested:?}",
                    case.camera
                );
            }
        });
    }
}

#[test]
fn scene_plan_and_label_allocations_are_limited() {
    for case in &CASES {
        let (mut emulator, vehicle) = scene_of(case);
        let (first, second) = on_one_thread(|| {
            let mut frame = || {
                let exposed = emulator.expose(&vehicle, 0).unwrap();
                emulator.take_back(exposed);
            };
            (measure(&mut frame), measure(&mut frame))
        });
        let (calls, bytes) = (second.count_total, second.bytes_total);
        let measured = format!("{}: {calls} calls, {bytes} bytes", case.camera);
        println!("{measured}");
        assert!(calls as f64 <= MARGIN * case.calls as f64, "{measured}");
        assert!(bytes as f64 <= MARGIN * case.bytes as f64, "{measured}");
        // Only the pixel buffers of the first frame stay allocated.
        assert!(
            first.bytes_current > 0 && second.bytes_current == 0,
            "{measured}"
        );
    }
}
