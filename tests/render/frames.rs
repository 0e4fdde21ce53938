//! Frames and labels are identical bytes with vector instructions or without, fused or pass by
//! pass, on one thread or several. Frames match their recorded checksums.

use std::path::Path;

use skyloop::config::Config;
use skyloop::engine::{Emulator, ExposedFrame};
use skyloop::flight;
use skyloop::orbit::sgp4_batch::Level;
use skyloop_protocols::crc::Crc32;

/// CRC-32 of the pixels, as big-endian 16-bit numbers, of frames of the scenes in `configs/scenes`.
const CHECKSUMS: &str = include_str!("../reference/frames.csv");
/// The first frame of each scene, and its last one below this number.
const MAX_FRAMES: u32 = 5;

/// Those frames with their labels and numbers.
fn expose_scene(scene: &Path, level: Option<Level>, keep: bool) -> Vec<(u32, ExposedFrame)> {
    let mut config = Config::load(scene).unwrap();
    let mission = flight::mission(&config).unwrap();
    let mut emulator = Emulator::new(&mut config);
    (emulator.level, emulator.keep_expected) = (level, keep);
    let mut numbers = vec![0, mission.frames.min(MAX_FRAMES) - 1];
    numbers.dedup();
    let expose_scene = numbers.into_iter().map(|number| {
        let vehicle = flight::vehicle(&mission, number).unwrap();
        let exposed = emulator.expose(&vehicle, 0).unwrap();
        // A frame rendered into a reused buffer contains nothing of the earlier one.
        let again = emulator.expose(&vehicle, 0).unwrap().frame;
        assert!(again.dn == exposed.frame.dn);
        emulator.recycle(again);
        (number, exposed)
    });
    expose_scene.collect()
}

fn name(scene: &Path) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/scenes");
    scene.strip_prefix(folder).unwrap().display().to_string()
}

fn in_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap().install(work)
}

/// The parts of two labels from the first differing character on; none where they are equal.
fn differing(a: &str, b: &str) -> Option<[String; 2]> {
    const EXCERPT: usize = 80;
    let alike = a.chars().zip(b.chars()).take_while(|(a, b)| a == b).count();
    let rest = [a, b].map(|text| text.chars().skip(alike).take(EXCERPT).collect());
    (a != b).then_some(rest)
}

#[test]
fn frames_match_checksums_at_any_level_threads_and_fusing() {
    let mut table = String::from("scene,frame,pixels_crc32\n");
    for scene in crate::scenes::scenes() {
        let plain = in_threads(1, || expose_scene(&scene, None, false));
        let levels = Level::available().into_iter().map(Some);
        for (level, keep, threads) in levels.map(|level| (level, false, 1)).chain([
            (Some(Level::best()), true, 1),
            (Some(Level::best()), false, 3),
        ]) {
            let others = in_threads(threads, || expose_scene(&scene, level, keep));
            for ((number, a), (_, b)) in plain.iter().zip(&others) {
                let what = format!(
                    "{}, frame {number}, {level:?}, {threads} threads",
                    name(&scene)
                );
                assert!(a.frame.dn == b.frame.dn, "{what}");
                // Labels contain no measured time: their prices depend on the scene.
                assert_eq!(differing(&a.json, &b.json), None, "{what}");
            }
        }
        for (number, exposed) in plain {
            let crc = Crc32::new().update_pixels(&exposed.frame.dn).finish();
            table += &format!("{},{number},{crc:08x}\n", name(&scene));
        }
    }
    let known = CHECKSUMS.lines().filter(|line| !line.starts_with('#'));
    let known: Vec<&str> = known.skip(1).collect();
    let made: Vec<&str> = table.lines().skip(1).collect();
    if cfg!(all(
        target_arch = "x86_64",
        target_os = "linux",
        target_env = "gnu"
    )) {
        assert!(
            made == known,
            "pixels have changed. If they were meant to, tests/reference/frames.csv is now, below its first lines:\n{table}"
        );
    } else {
        println!("not compared: the checksums are those of x86_64-unknown-linux-gnu");
    }
}
