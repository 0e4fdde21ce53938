//! `loopback` and `render`: files and tables.

use crate::{Folder, STATE, camera, has, render, repository};

#[test]
fn loopback_over_each_link_writes_the_same_frames_and_a_table() {
    let links = ["memory", "udp", "serial", "slcan", "pty"];
    let here_too = |link: &&str| *link != "pty" || cfg!(target_os = "linux");
    let links: Vec<&str> = links.into_iter().filter(here_too).collect();
    let objects = "RSOs labelled                     6";
    same_over(&links, "", "fai-nir", objects);
    // Rows exposed in turn, a fixed pattern: the same octets whatever carries them.
    let scene = repository("configs/scenes/rolling-slew.toml");
    let none = "RSOs labelled                     0";
    same_over(
        &["memory", "udp"],
        &format!("--scene {scene}"),
        "cmos-rolling",
        none,
    );
}

/// Two frames over each of these links are the same files, octet for octet, and the table names the
/// camera and has `row`.
fn same_over(links: &[&str], flags: &str, camera: &str, row: &str) {
    let here = Folder::new();
    for link in links {
        let words = format!("loopback --link {link} --frames 2 --out {link} {flags}");
        here.run(&words).exits(0).lacks("WARN").prints(&[
            &format!("2 frames of {camera} over "),
            "frames                            2",
            "render time p50 / p99 / max",
            "attitude to last block p50 / p99",
            "stars labelled",
            row,
            "centroids, measured - labelled    rms 0.",
        ]);
        let is_same = here.contents(link) == here.contents("memory");
        assert!(is_same, "the same octets of {camera} over {link}");
    }
    let expected = [
        "contact_sheet.png",
        "frame_00000.fits",
        "frame_00000.png",
        "frame_00000_preview.png",
        "frame_00001.fits",
        "frame_00001.png",
        "frame_00001_preview.png",
        "labels.jsonl",
    ];
    assert_eq!(here.names("memory"), expected);
}

/// A detector of 4096 cm^2 for 100 s: 1.8 particles a square centimetre and second far from the
/// Earth's field are seven times the most.
#[test]
fn particles_that_are_too_many_are_warned_of_once() {
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
fn render_twice_gives_the_same_octets_and_those_of_loopback() {
    let here = Folder::new();
    let scene = repository("configs/scenes/rcm-2019-06-15/scene.toml");
    let render = format!("render --frames 2 --scene {scene}");
    for words in [
        format!("{render} --out one"),
        format!("{render} --out two"),
        "loopback --frames 2 --out wire".to_string(),
        format!("{render} --seed 2 --out seed"),
    ] {
        here.run(&words).exits(0);
    }
    let one = here.contents("one");
    assert!(one == here.contents("two"));
    assert!(one == here.contents("wire"), "offline and over a wire");
    // The picture has the pixels alone; the seed in the header tells any two FITS apart.
    let [picture, other] = ["one", "seed"].map(|out| here.join(out).join("frame_00000.png"));
    let [picture, other] = [picture, other].map(|file| std::fs::read(file).unwrap());
    assert!(picture != other, "another seed, other noise");
}

#[test]
fn an_object_in_two_files_is_shown_once_and_said_so() {
    let oem = |name: &str| repository(&format!("configs/scenes/rcm-2019-06-15/{name}-B.oem"));
    let (orbit, object) = (oem("cassiope"), oem("rcm-2"));
    let words = render(&format!("--orbit {orbit} --rso {object} --rso {object}"));
    let ended = Folder::new()
        .run(&words)
        .exits(0)
        .prints(&["1 (1 visible)"]);
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

/// A made-up element set, with its checksums.
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
    assert!(
        !ended.log.contains("90002"),
        "the other one is sound: {}",
        ended.log
    );

    here.write("sky.tle", format!("{a1}\n{damaged}\n"));
    let refused = here.run(&render("--orbit sky.tle")).exits(1);
    refused.logs(&["sky.tle:2: ", "checksum"]);
}

#[test]
fn a_reader_of_the_table_that_leaves_early_is_no_error() {
    use std::process::{Command, Stdio};
    let here = Folder::new();
    let mut command = Command::new(env!("CARGO_BIN_EXE_skyloop"));
    let command = command
        .args(["loopback", "--frames", "1"])
        .current_dir(&here);
    let mut child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    crate::Outcome::of("loopback", child.wait_with_output().unwrap()).quiet();
    assert_eq!(here.names("skyloop-out").len(), 5);
}
