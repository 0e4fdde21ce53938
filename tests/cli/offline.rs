//! `loopback` and `render`: files and tables.

use crate::{EPOCH, Q, STATE, contents, names, repository, skyloop};

#[test]
fn loopback_over_each_link_writes_the_same_frames_and_a_table() {
    let links = ["memory", "udp", "serial", "slcan", "pty"];
    let here_too = |link: &&str| *link != "pty" || cfg!(target_os = "linux");
    let links: Vec<&str> = links.into_iter().filter(here_too).collect();
    same_over(
        &links,
        &[],
        "fai-nir",
        "RSOs labelled                     6",
    );
    // Rows exposed in turn, a fixed pattern: the same octets whatever carries them.
    let scene = repository("configs/scenes/rolling-slew.toml");
    same_over(
        &["memory", "udp"],
        &["--scene", &scene],
        "cmos-rolling",
        "RSOs labelled                     0",
    );
}

/// Two frames over each of these links are the same files, octet for octet, and the table names the camera and has `row`.
fn same_over(links: &[&str], flags: &[&str], camera: &str, row: &str) {
    let here = tempfile::tempdir().unwrap();
    let mut made = Vec::new();
    for link in links {
        let done = skyloop(here.path())
            .args(["loopback", "--link", link, "--frames", "2", "--out", link])
            .args(flags)
            .assert()
            .success();
        let table = String::from_utf8(done.get_output().stdout.clone()).unwrap();
        let log = String::from_utf8_lossy(&done.get_output().stderr);
        assert!(!log.contains("WARN"), "{link}: {log}");
        for row in [
            &format!("2 frames of {camera} over "),
            "frames                            2",
            "render time p50 / p99 / max",
            "attitude to last block p50 / p99",
            "stars labelled",
            row,
            "centroids, measured - labelled    rms 0.",
        ] {
            assert!(table.contains(row), "{link}: no {row:?} in\n{table}");
        }
        made.push(contents(&here.path().join(link)));
    }
    let files = names(&here.path().join("memory"));
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
    assert_eq!(files, expected);
    assert!(
        made.iter().all(|files| *files == made[0]),
        "the same octets of {camera} over each link"
    );
}

/// A detector of 4096 cm^2 for 100 s: 1.8 particles a square centimetre and second far from the Earth's field are seven times the most.
#[test]
fn particles_that_are_too_many_are_warned_of_once() {
    let here = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(repository("configs/cameras/fai-630.toml")).unwrap();
    let set = |text: String, key: &str, value: &str| {
        let line = text.lines().find(|line| line.starts_with(key)).unwrap();
        text.replace(line, &format!("{key} = {value}"))
    };
    let keys = [
        ("focal_length_mm", "5000.0"),
        ("principal_px", "[319.5, 319.5]"),
        ("width_px", "640"),
        ("height_px", "640"),
        ("pixel_um", "1000.0"),
        ("exposure_s", "100.0"),
        ("rate_hz", "0.01"),
    ];
    let text = keys
        .iter()
        .fold(text, |text, (key, value)| set(text, key, value));
    let table = "[radiation]\nflux_cm2_s = \"orbit\"\nthickness_um = 10.0\n";
    std::fs::write(here.path().join("large.toml"), text + table).unwrap();
    let flags = [
        "render",
        "--camera",
        "large.toml",
        "--epoch",
        EPOCH,
        "--attitude",
        Q,
    ];
    let done = skyloop(here.path())
        .args(flags)
        .args(["--frames", "2", "--out", "o"])
        .assert()
        .success();
    let log = String::from_utf8_lossy(&done.get_output().stderr);
    // 1.8 * 4096 * 100 - 1e5.
    let warning = "frame 0: 637280 more particles than can be drawn";
    assert_eq!(log.matches(warning).count(), 1, "{log}");
    assert_eq!(log.lines().count(), 1, "{log}");
    let labels = std::fs::read_to_string(here.path().join("o/labels.jsonl")).unwrap();
    assert_eq!(labels.matches("\"particles_left_out\":637300.0").count(), 2);
}

#[test]
fn render_twice_gives_the_same_octets_and_those_of_loopback() {
    let here = tempfile::tempdir().unwrap();
    let scene = repository("configs/scenes/rcm-2019-06-15/scene.toml");
    for out in ["one", "two"] {
        skyloop(here.path())
            .args(["render", "--frames", "2", "--scene", &scene, "--out", out])
            .assert()
            .success();
    }
    skyloop(here.path())
        .args(["loopback", "--frames", "2", "--out", "wire"])
        .assert()
        .success();
    let one = contents(&here.path().join("one"));
    assert!(one == contents(&here.path().join("two")));
    assert!(
        one == contents(&here.path().join("wire")),
        "offline and over a wire"
    );
    skyloop(here.path())
        .args([
            "render", "--frames", "2", "--seed", "2", "--scene", &scene, "--out", "seed",
        ])
        .assert()
        .success();
    let other = contents(&here.path().join("seed"));
    // The picture has the pixels alone; the seed in the header tells any two FITS apart.
    let pixels = |files: &[(String, Vec<u8>)]| {
        let picture = files.iter().find(|(name, _)| name == "frame_00000.png");
        picture.unwrap().1.clone()
    };
    assert!(pixels(&one) != pixels(&other), "another seed, other noise");
}

#[test]
fn an_object_in_two_files_is_shown_once_and_said_so() {
    let here = tempfile::tempdir().unwrap();
    let oem = |name: &str| repository(&format!("configs/scenes/rcm-2019-06-15/{name}-B.oem"));
    let done = skyloop(here.path())
        .args(["render", "--epoch", EPOCH, "--attitude", Q, "--out", "o"])
        .args([
            "--orbit",
            &oem("cassiope"),
            "--rso",
            &oem("rcm-2"),
            "--rso",
            &oem("rcm-2"),
        ])
        .assert()
        .success();
    let output = done.get_output();
    let (table, log) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    assert!(table.contains("1 (1 visible)"), "{table}");
    assert!(
        log.contains(&format!("is in {}: keep one", oem("rcm-2"))),
        "{log}"
    );
}

#[test]
fn without_noise_the_expected_electrons_are_written_too() {
    let here = tempfile::tempdir().unwrap();
    skyloop(here.path())
        .args([
            "render",
            "--epoch",
            EPOCH,
            "--attitude",
            Q,
            "--no-noise",
            "--rates",
            "0.5,-1,2",
            "--out",
            "o",
        ])
        .assert()
        .success();
    let electrons = std::fs::read(here.path().join("o/frame_00000_electrons.fits")).unwrap();
    let header = String::from_utf8_lossy(&electrons[..2880]).into_owned();
    // X-Val: FITS standard 4.0, table 8: BITPIX -32 is IEEE single precision.
    assert!(
        header.contains("BITPIX  =                  -32"),
        "{header}"
    );
    let labels = std::fs::read_to_string(here.path().join("o/labels.jsonl")).unwrap();
    let label: serde_json::Value = serde_json::from_str(&labels).unwrap();
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
        let sum: u32 = line
            .chars()
            .map(|c| c.to_digit(10).unwrap_or((c == '-').into()))
            .sum();
        format!("{line:<68}{}", sum % 10)
    })
}

#[test]
fn a_bad_checksum_is_reported_with_file_and_line_and_the_rest_loads() {
    let here = tempfile::tempdir().unwrap();
    let ([a1, a2], [b1, b2]) = (elements(90001), elements(90002));
    let damaged = a2.replace("97.5000", "98.5000");
    std::fs::write(
        here.path().join("sky.tle"),
        format!("{a1}\n{damaged}\n{b1}\n{b2}\n"),
    )
    .unwrap();
    let flags = [
        "render",
        "--epoch",
        EPOCH,
        "--attitude",
        Q,
        "--state",
        STATE,
        "--rso",
        "sky.tle",
    ];
    let done = skyloop(here.path())
        .args(flags)
        .args(["--out", "o"])
        .assert()
        .success();
    let log = String::from_utf8(done.get_output().stderr.clone()).unwrap();
    assert!(
        log.contains("sky.tle:2: ") && log.contains("checksum"),
        "{log}"
    );
    assert!(!log.contains("90002"), "the other one is sound: {log}");

    std::fs::write(here.path().join("sky.tle"), format!("{a1}\n{damaged}\n")).unwrap();
    let flags = [
        "render",
        "--epoch",
        EPOCH,
        "--attitude",
        Q,
        "--orbit",
        "sky.tle",
        "--out",
        "o",
    ];
    let failed = skyloop(here.path()).args(flags).assert().failure();
    let log = String::from_utf8(failed.get_output().stderr.clone()).unwrap();
    assert!(
        log.contains("sky.tle:2: ") && log.contains("checksum"),
        "{log}"
    );
}

#[test]
fn a_reader_of_the_table_that_leaves_early_is_no_error() {
    let here = tempfile::tempdir().unwrap();
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_skyloop"))
        .args(["loopback", "--frames", "1"])
        .current_dir(here.path())
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let ended = child.wait_with_output().unwrap();
    let log = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success() && log.is_empty(), "{log}");
    assert_eq!(names(&here.path().join("skyloop-out")).len(), 5);
}
