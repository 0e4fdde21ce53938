//! Frames and their labels are the same bytes, whatever works them out: vector instructions or none, fused or pass by pass, one thread or
//! several; and frames are the same as when their checksums were written down.

use std::path::Path;

use skyloop::config::Config;
use skyloop::engine::{Emulator, ExposedFrame};
use skyloop::flight;
use skyloop::orbit::sgp4_batch::Level;
use skyloop_protocols::crc::Crc32;

/// CRC-32 of the pixels, each as a big-endian number of 16 bits, of frames of the scenes in `configs/scenes`.
const CHECKSUMS: &str = include_str!("../reference/frames.csv");
/// Of each scene its first frame, and the last of at most so many.
const MAX_FRAMES: u32 = 5;

/// Those frames with their labels, and their numbers.
fn shots(scene: &Path, level: Option<Level>, keep: bool) -> Vec<(u32, ExposedFrame)> {
    let mut config = Config::load(scene).unwrap();
    let mission = flight::mission(&config).unwrap();
    let mut emulator = Emulator::new(&mut config);
    (emulator.level, emulator.keep_expected) = (level, keep);
    let mut numbers = vec![0, mission.frames.min(MAX_FRAMES) - 1];
    numbers.dedup();
    let shots = numbers.into_iter().map(|number| {
        let vehicle = flight::vehicle(&mission, number).unwrap();
        let exposed = emulator.expose(&vehicle, 0).unwrap();
        // A frame that is made in the memory of another has nothing of it.
        let again = emulator.expose(&vehicle, 0).unwrap().frame;
        assert!(again.dn == exposed.frame.dn);
        emulator.recycle(again);
        (number, exposed)
    });
    shots.collect()
}

fn name(scene: &Path) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/scenes");
    scene.strip_prefix(folder).unwrap().display().to_string()
}

fn in_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap().install(work)
}

/// What each of two labels has from the first character on in which they differ; none where they do not.
fn differing(a: &str, b: &str) -> Option<[String; 2]> {
    const TOLD: usize = 80;
    let alike = a.chars().zip(b.chars()).take_while(|(a, b)| a == b).count();
    let rest = [a, b].map(|text| text.chars().skip(alike).take(TOLD).collect());
    (a != b).then_some(rest)
}

#[test]
fn levels_threads_and_fusing_give_the_same_bytes_and_those_written_down() {
    let mut table = String::from("scene,frame,pixels_crc32\n");
    for scene in crate::scenes::scenes() {
        let plain = in_threads(1, || shots(&scene, None, false));
        let ways = Level::available().into_iter().map(Some);
        for (level, keep, threads) in ways.map(|level| (level, false, 1)).chain([
            (Some(Level::best()), true, 1),
            (Some(Level::best()), false, 3),
        ]) {
            let others = in_threads(threads, || shots(&scene, level, keep));
            for ((number, a), (_, b)) in plain.iter().zip(&others) {
                let what = format!(
                    "{}, frame {number}, {level:?}, {threads} threads",
                    name(&scene)
                );
                assert!(a.frame.dn == b.frame.dn, "{what}");
                // Labels tell no time that was measured: their prices are of the scene.
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
