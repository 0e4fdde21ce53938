//! `loopback` and `render`: files and tables.

use crate::{Folder, STATE, camera, has, render, repository};
use skyloop::link::LINKS;

#[test]
fn loopback_over_each_link_writes_the_frames_of_render_and_a_table() {
    // CAN interfaces are tested by `tests/vcan/run`, whose kernel has CAN.
    let links = LINKS.iter().map(|link| link.scheme);
    let links: Vec<&str> = links.filter(|scheme| *scheme != "can").collect();
    let scene = "rcm-2019-06-15/scene.toml";
    same_over(
        &links,
        scene,
        "fai-nir",
        "RSOs labelled                     6",
    );
    // A rolling shutter and fixed-pattern noise: the same bytes on each link.
    let none = "RSOs labelled                     0";
    same_over(
        &["memory", "udp"],
        "rolling-slew.toml",
        "cmos-rolling",
        none,
    );
}

/// Asserts that two frames of a scene over each of these links equal the files of `render`, and
/// that the table names the camera and has `row`.
fn same_over(links: &[&str], scene: &str, camera: &str, row: &str) {
    let here = Folder::new();
    let scene = repository(&format!("configs/scenes/{scene}"));
    let flags = format!("--frames 2 --scene {scene}");
    here.run(&format!("render --out offline {flags}")).exits(0);
    for link in links {
        let words = format!("loopback --link {link} --out {link} {flags}");
        here.run(&words).exits(0).lacks("WARN").prints(&[
            &format!("2 frames of {camera} over "),
            "frames                            2",
            "render time p50 / p99 / max",
            "attitude to last block p50 / p99",
            "stars labelled",
            row,
            "centroids, measured - labelled    rms 0.",
        ]);
        let is_same = here.contents(link) == here.contents("offline");
        assert!(is_same, "the same bytes of {camera} over {link}");
    }
    let frame = |n: u32| ["", "_preview"].map(|end| format!("frame_0000{n}{end}.png"));
    let mut expected = [frame(0), frame(1)].concat();
    expected.extend(["contact_sheet.png", "labels.jsonl"].map(String::from));
    expected.extend(["frame_00000.fits", "frame_00001.fits"].map(String::from));
    expected.sort();
    assert_eq!(here.names("offline"), expected);
}

/// A detector of 4096 cm^2 for 100 s: 1.8 particles/(cm^2 s) far from the Earth's field are seven
/// times the limit.
#[test]
fn too_many_particles_cause_one_warning() {
    let large = [
        ("focal_length_mm", "5000.0"),
        ("principal_px", "[319.5, 319.5]"),
        ("width_px", "640"),
        ("height_px", "640"),
        ("pixel_um", "1000.0"),
        ("exposure_s", "100.0"),
        ("rate_hz", "0.01"),
    ];
    let table = "[radiation]\nflux_cm2_s = \"orbit\"\nthickness_um = 10.0\n";
    let here = Folder::with(&[("large.toml", &(camera("fai-630", &large) + table))]);
    let ended = here.run(&render("--camera large.toml --frames 2")).exits(0);
    // 1.8 * 4096 * 100 - 1e5.
    let warning = "frame 0: 637280 more particles than can be drawn";
    ended.logs(&[warning]).logs_lines(1);
    let labels = here.read("o/labels.jsonl");
    assert_eq!(labels.matches("\"particles_left_out\":637300.0").count(), 2);
}

#[test]
fn render_twice_gives_the_same_bytes_and_another_seed_another_noise() {
    let here = Folder::new();
    let scene = repository("configs/scenes/rcm-2019-06-15/scene.toml");
    for words in ["one", "two", "seed --seed 2"] {
        let render = format!("render --frames 2 --scene {scene} --out {words}");
        here.run(&render).exits(0);
    }
    assert!(here.contents("one") == here.contents("two"));
    // PNG files have only pixels; FITS files of other seeds differ in their header anyway.
    let picture = |out: &str| std::fs::read(here.join(out).join("frame_00000.png")).unwrap();
    assert!(picture("one") != picture("seed"));
}

#[test]
fn an_object_in_two_files_is_rendered_once_with_a_notice() {
    let oem = |name: &str| repository(&format!("configs/scenes/rcm-2019-06-15/{name}-B.oem"));
    let (orbit, object) = (oem("cassiope"), oem("rcm-2"));
    let words = render(&format!("--orbit {orbit} --rso {object} --rso {object}"));
    let ended = Folder::new().run(&words).exits(0);
    let ended = ended.prints(&["1 (1 visible)"]);
    ended.logs(&[&format!("is in {object}: keep one")]);
}

#[test]
fn without_noise_the_expected_electrons_are_written_too() {
    let here = Folder::new();
    here.run(&render("--no-noise --rates 0.5,-1,2")).exits(0);
    let electrons = std::fs::read(here.join("o/frame_00000_electrons.fits")).unwrap();
    // X-Val: FITS standard 4.0, table 8: BITPIX -32 is IEEE single precision.
    let header = String::from_utf8_lossy(&electrons[..2880]);
    has(&header, &["BITPIX  =                  -32"]);
    let label = &here.labels("o")[0];
    for (axis, degrees) in [0.5_f64, -1.0, 2.0].into_iter().enumerate() {
        let rate = label["rates_rad_s"][axis].as_f64().unwrap();
        assert!((rate - degrees.to_radians()).abs() < 1e-8, "{rate}");
    }
}

/// A synthetic element set with its checksums.
fn elements(number: u32) -> [String; 2] {
    [
        format!("1 {number}U 19001A   19166.50000000  .00000100  00000-0  10000-4 0  999"),
        format!("2 {number}  97.5000 120.0000 0010000  90.0000 270.0000 15.20000000  100"),
    ]
    .map(|line| {
        // The checksum: digits, a minus counting one, modulo ten.
        let digit = |c: char| c.to_digit(10).unwrap_or((c == '-').into());
        let sum: u32 = line.chars().map(digit).sum();
        format!("{line:<68}{}", sum % 10)
    })
}

#[test]
fn a_bad_checksum_is_reported_with_file_and_line_and_the_rest_loads() {
    let ([a1, a2], [b1, b2]) = (elements(90001), elements(90002));
    let damaged = a2.replace("97.5000", "98.5000");
    let here = Folder::with(&[("sky.tle", &format!("{a1}\n{damaged}\n{b1}\n{b2}\n"))]);
    let ended = here.run(&render(&format!("--state {STATE} --rso sky.tle")));
    let ended = ended.exits(0).logs(&["sky.tle:2: ", "checksum"]);
    // The other set is valid.
    assert!(!ended.log.contains("90002"), "{}", ended.log);

    here.write("sky.tle", format!("{a1}\n{damaged}\n"));
    let refused = here.run(&render("--orbit sky.tle")).exits(1);
    refused.logs(&["sky.tle:2: ", "checksum"]);
}

#[test]
fn a_reader_of_the_table_that_leaves_early_is_no_error() {
    use std::process::{Command, Stdio};
    let here = Folder::new();
    let mut command = Command::new(env!("CARGO_BIN_EXE_skyloop"));
    let command = command.args(["loopback", "--frames", "1"]);
    let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.current_dir(&here).spawn().unwrap();
    drop(child.stdout.take());
    crate::Outcome::of("loopback", child.wait_with_output().unwrap()).quiet();
    assert_eq!(here.names("skyloop-out").len(), 5);
}
