//! `skyloop-fc` as a person runs it.

mod common;

use std::net::UdpSocket;
use std::path::PathBuf;
use std::process::{Command, Output};
use std::thread::spawn;
use std::time::Duration;

use common::emulator::Emulator;

fn skyloop_fc(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_skyloop-fc"))
        .args(arguments)
        .output()
        .unwrap()
}

fn error_of(arguments: &[&str]) -> String {
    let output = skyloop_fc(arguments);
    assert!(!output.status.success(), "{arguments:?}");
    let error = String::from_utf8(output.stderr).unwrap();
    let line = error.lines().next().unwrap_or_default();
    let half: String = line.chars().skip(line.chars().count() / 2).collect();
    assert_eq!(line.matches(&half).count(), 1, "told twice: {line}");
    error
}

/// A file for one test, named after it.
fn file(name: &str, text: &str) -> String {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

/// A circular equatorial orbit of 7000 km, a minute of it.
fn oem(name: &str) -> String {
    let mut text = String::from(
        "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2019-06-15T00:00:00\nORIGINATOR = TEST\nMETA_START\n\
         OBJECT_NAME = TESTSAT\nOBJECT_ID = 2019-001A\nCENTER_NAME = EARTH\nREF_FRAME = GCRF\nTIME_SYSTEM = UTC\n\
         START_TIME = 2019-06-15T23:35:30\nSTOP_TIME = 2019-06-15T23:36:30\nMETA_STOP\n",
    );
    // Mean motion at 7000 km, rad/s.
    let rate = 1.078_007_6e-3_f64;
    for second in 0..=60 {
        let (minute, seconds) = (35 + (30 + second) / 60, (30 + second) % 60);
        let (sin, cos) = (rate * f64::from(second)).sin_cos();
        let (x, y, vx, vy) = (
            7000.0 * cos,
            7000.0 * sin,
            -7000.0 * rate * sin,
            7000.0 * rate * cos,
        );
        text += &format!(
            "2019-06-15T23:{minute}:{seconds:02}.000 {x:.6} {y:.6} 0.0 {vx:.9} {vy:.9} 0.0\n"
        );
    }
    file(name, &text)
}

#[test]
fn a_run_over_udp_prints_its_table() {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let link = format!("udp://{}", socket.local_addr().unwrap());
    socket
        .set_read_timeout(Some(Duration::from_secs(10)))
        .unwrap();
    let thread = spawn(move || {
        let mut emulator = Emulator::new(|_, _| {});
        let mut buffer = [0; 2048];
        // Ends when nothing has come for the time-out.
        while let Ok((length, client)) = socket.recv_from(&mut buffer) {
            for answer in emulator.answer(&buffer[..length]) {
                socket.send_to(&answer, client).unwrap();
            }
        }
        emulator
    });
    let orbit = format!("{}:testsat", oem("run.oem"));
    let epoch = ["--epoch", "2019-06-15T23:35:50", "--frames", "3"];
    let nadir =
        skyloop_fc(&[&["--link", &link, "--orbit", &orbit, "--nadir"], &epoch[..]].concat());
    let hold = [
        "--hold",
        "-0.070834,-0.644137,0.733522,-0.204975",
        "--rate",
        "100",
    ];
    let hold = skyloop_fc(&[&["--link", &link], &hold[..], &epoch[..]].concat());
    let limb = ["--limb-stare", "80,-90", "--orbit", &orbit];
    let limb = skyloop_fc(&[&["--link", &link], &limb[..], &epoch[..]].concat());
    let scan = ["--scan", "0,0,0,1,2,1.5,x"];
    let scan = skyloop_fc(&[&["--link", &link], &scan[..], &epoch[..]].concat());
    let verdicts = file("verdicts.xml", "");
    let limits = [
        "--max-missed",
        "1000",
        "--max-centroid-rms",
        "1e-9",
        "--junit",
        &verdicts,
    ];
    let broken = ["--hold", "0,0,0,1"];
    let broken = skyloop_fc(&[&["--link", &link], &broken[..], &limits[..], &epoch[..]].concat());
    assert_eq!(broken.status.code(), Some(1));
    let table = String::from_utf8_lossy(&broken.stdout);
    for line in [
        "kept: bright labelled objects missed: 0, within 1000",
        "broken: centroids: rms 0.0",
    ] {
        assert!(table.contains(line), "no {line:?} in {table}");
    }
    let verdicts = std::fs::read_to_string(verdicts).unwrap();
    assert!(
        verdicts.contains("tests=\"3\" failures=\"1\""),
        "{verdicts}"
    );
    for output in [&nadir, &hold, &limb, &scan] {
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(
            output.status.success(),
            "{text} {}",
            String::from_utf8_lossy(&output.stderr)
        );
        assert!(
            text.contains("3 of 3 whole, 0 lost") && text.contains("residual         rms 0.0"),
            "{text}"
        );
    }
    let attitudes = thread.join().unwrap().attitudes;
    assert_eq!(attitudes.len(), 15);
    // Above the equator the nadir attitude turns about -Y once an orbit.
    assert!(
        (attitudes[0].1.rates_rad_s[1] + 1.078e-3).abs() < 1e-6,
        "{:?}",
        attitudes[0].1
    );
    assert!(attitudes[0].1.state.is_some() && attitudes[3].1.state.is_none());
    // Whatever the azimuth, a limb stare turns once an orbit.
    let limb = nalgebra::Vector3::from(attitudes[6].1.rates_rad_s);
    assert!((limb.norm() - 1.078e-3).abs() < 1e-5, "{limb}");
    // X-Val: 1.5 deg/s for 1 s: q = [-sin(0.75 deg), 0, 0, cos(0.75 deg)].
    let scanned = attitudes[11].1;
    assert!((scanned.q_icrf_to_body[0] + 0.75_f64.to_radians().sin()).abs() < 1e-12);
    assert!((scanned.rates_rad_s[0] - 1.5_f64.to_radians()).abs() < 1e-12);
}

/// A process that does not outlive its test.
struct Running(std::process::Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
#[cfg(unix)]
fn a_signal_ends_a_run_with_its_report() {
    for signal in ["-INT", "-TERM", "-HUP"] {
        ends_with_its_report(signal);
    }
}

#[cfg(unix)]
fn ends_with_its_report(signal: &str) {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let link = format!("udp://{}", socket.local_addr().unwrap());
    let mut emulator = Emulator::new(|_, _| {});
    // Whatever started the tests may ignore it.
    let child = Command::new("env")
        .args(["--default-signal=HUP", env!("CARGO_BIN_EXE_skyloop-fc")])
        .args(["--link", &link, "--epoch", "2019-06-15T23:35:50"])
        .args(["--hold", "0,0,0,1", "--frames", "1000000"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut running = Running(child);
    socket
        .set_read_timeout(Some(Duration::from_secs(10)))
        .unwrap();
    let mut buffer = [0; 2048];
    // Three frames, then the signal; the second Reset ends the exchange.
    while emulator.resets < 2 {
        let (length, client) = socket.recv_from(&mut buffer).expect("it goes on, or ends");
        let before = emulator.attitudes.len();
        for answer in emulator.answer(&buffer[..length]) {
            socket.send_to(&answer, client).unwrap();
        }
        if before == 2 && emulator.attitudes.len() == 3 {
            let pid = running.0.id().to_string();
            let kill = Command::new("kill").args([signal, &pid]).status();
            assert!(kill.unwrap().success());
        }
    }
    let ended = running.0.wait().unwrap();
    assert!(!ended.success(), "not all frames came");
    let text = std::io::read_to_string(running.0.stdout.take().unwrap()).unwrap();
    let error = std::io::read_to_string(running.0.stderr.take().unwrap()).unwrap();
    assert!(error.contains("stopped after"), "{error}");
    assert!(text.contains("of 1000000 whole, 0 lost"), "{text}");
}

#[test]
fn numbers_out_of_range_are_refused_as_usage() {
    let base = ["--link", "udp://127.0.0.1:9", "--hold", "0,0,0,1", "--wall"];
    for (option, range) in [
        ("--period", "0.000001 to 1000000 s"),
        ("--rate", "0.000001 to 100000 Hz"),
        ("--timeout", "0.001 to 1000000 s"),
        ("--focal-px", "1 to 10000000 px"),
        ("--frames", "whole number from 1 to"),
    ] {
        for value in ["0", "-1", "1e300"] {
            let output = skyloop_fc(&[&base[..], &[option, value]].concat());
            let error = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(2), "{option} {value}: {error}");
            let told = option == "--frames" && value != "0" || error.contains(range);
            assert!(
                told && error.contains(option) && error.len() < 250,
                "{error}"
            );
        }
    }
}

#[test]
fn errors_say_what_to_do() {
    let base = [
        "--link",
        "udp://127.0.0.1:9",
        "--epoch",
        "2019-06-15T23:35:50",
        "--timeout",
        "0.2",
    ];
    let with = |more: &[&str]| error_of(&[&base[..], more].concat());
    let hold = ["--hold", "0,0,0,1"];
    let orbit = oem("errors.oem");
    let pick = format!("{orbit}:OTHER");
    // X-Val: Vallado et al. 2006, AIAA 2006-6753, verification set 00005, of the year 2000.
    let old = file(
        "old.3le",
        "VANGUARD 1\n1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753\n\
         2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667\n",
    );
    let bad_list = file(
        "attitudes.txt",
        "2019-06-15T23:35:50 0 0 0 1\nnow 0 0 0 1\n",
    );
    let spinner = file(
        "spinner.aem",
        "CCSDS_AEM_VERS = 2.0\nMETA_START\nOBJECT_ID = A\nREF_FRAME_A = ICRF\nREF_FRAME_B = SC_BODY_1\nTIME_SYSTEM = UTC\n\
         START_TIME = 2019-06-15T23:35:50\nSTOP_TIME = 2019-06-15T23:35:59\nATTITUDE_TYPE = SPIN\nMETA_STOP\n",
    );
    let still = std::fs::read_to_string(&spinner)
        .unwrap()
        .replace("SPIN", "QUATERNION");
    let still = file(
        "still.aem",
        &(still + "2019-06-15T23:35:50 0 0 0 1\n2019-06-15T23:35:51 0 0 0 1\n"),
    );
    let short_list = file(
        "short.txt",
        "2019-06-15T23:35:50 0 0 0 1\n2019-06-15T23:35:51 0 0 0 1\n",
    );
    for (arguments, part) in [
        (&hold[..], "is an emulator (skyloop run) listening"),
        (&["--hold", "0,0,0,2"], "norm is 2"),
        (&["--slew", "0,0,0,1,5"], "5 numbers where 7 belong"),
        (&["--nadir"], "--orbit"),
        (&["--limb-stare", "80"], "--orbit"),
        (
            &["--limb-stare", "80,nan", "--orbit", &orbit],
            "\"nan\" is no finite number: give KM or KM,AZIMUTH_DEG",
        ),
        (
            &["--limb-stare", "-5", "--orbit", &orbit],
            "the height is -5; it must be 0 to 10000 km",
        ),
        (
            &["--limb-stare", "900", "--orbit", &orbit],
            "no limb at 900 km at 2019-06-15T23:35:50",
        ),
        (
            &["--scan", "0,0,0,1,10"],
            "5 numbers where 6 belong: give x,y,z,w,DEG,RATE",
        ),
        (&["--scan", "0,0,0,1,nan,1"], "\"nan\" is no finite number"),
        (
            &["--scan", "0,0,0,1,10,0"],
            "the rate is 0; it must be above 0, at most 360 deg/s",
        ),
        (&["--hold", "0,0,0,1", "--loop"], "add --wall"),
        (
            &["--hold", "0,0,0,1", "--loop", "--wall"],
            "--loop needs --focal-px",
        ),
        (
            &["--hold", "0,0,0,1", "--focal-px", "500"],
            "leave it out, or add --loop",
        ),
        (
            &["--hold", "0,0,0,1", "--drift", "0,0,0.01"],
            "leave it out, or add --loop",
        ),
        (
            &["--listen"],
            "'--epoch <UTC>' cannot be used with '--listen'",
        ),
        (
            &["--hold", "0,0,0,1", "--max-error", "10"],
            "--max-error is for a closed loop only: leave it out, or add --loop",
        ),
        (
            &["--hold", "0,0,0,1", "--loop", "--wall", "--max-error", "0"],
            "it must be 0.001 to 648000 arcsec",
        ),
        (
            &["--slew", "0,0,0,1,0,0,1", "--loop", "--wall"],
            "give it by --hold x,y,z,w",
        ),
        (
            &[
                "--hold", "0,0,0,1", "--loop", "--wall", "--output", "labels",
            ],
            "choose windows, compressed or frame",
        ),
        (
            &["--hold", "0,0,0,1", "--drift", "0.01,0.02"],
            "2 numbers where 3 belong: give x,y,z in deg/s",
        ),
        (
            &["--hold", "0,0,0,1", "--drift", "0,0,0.2"],
            "each must be -0.1 to 0.1 deg/s",
        ),
        (
            &["--hold", "0,0,0,1", "--drift", "0,nan,0"],
            "\"nan\" is no finite number",
        ),
        (
            &["--nadir", "--orbit", "tests"],
            "--orbit tests is a folder: name one file in it, as tests/FILE or tests/FILE:NAME",
        ),
        (
            &["--nadir", "--orbit", "no-such-file.oem"],
            "no-such-file.oem: No such file or directory (os error 2); --orbit takes a TLE, 3LE, OMM or OEM file",
        ),
        (
            &["--attitudes", "no-such-file.txt"],
            "--attitudes takes a text file of lines UTC x y z w",
        ),
        (
            &["--nadir", "--orbit", &pick],
            "no object called \"OTHER\"; it has 2019-001A (TESTSAT)",
        ),
        (
            &["--nadir", "--orbit", &orbit, "--period", "10"],
            "outside its ephemeris",
        ),
        (
            &["--nadir", "--orbit", "/dev/zero"],
            "cannot read the orbit file /dev/zero: this is a device or a socket",
        ),
        (
            &["--nadir", "--orbit", &old],
            "NORAD 5 (VANGUARD 1): old elements: 1 of 1 are more than 14 days",
        ),
        (
            &["--attitudes", "/dev/zero"],
            "this is a device or a socket",
        ),
        (
            &["--attitudes", &spinner],
            "spinner.aem:9: ATTITUDE_TYPE 'SPIN'",
        ),
        (
            &["--attitudes", &still],
            "covers 2019-06-15T23:35:50.000Z to 2019-06-15T23:35:51.000Z",
        ),
        (&["--attitudes", &bad_list], "attitudes.txt:2: \"now\""),
        (
            &["--attitudes", &short_list],
            "give attitudes on both sides of every frame",
        ),
        (
            &["--hold", "0,0,0,1", "--junit", "no/such.xml"],
            "cannot write no/such.xml: its folder does not exist: make it first",
        ),
        (
            &[
                "--hold", "0,0,0,1", "--junit", &orbit, "--orbit", &orbit, "--force",
            ],
            "this run reads this file",
        ),
        (&["--hold", "0,0,0,1", "--frames", "0"], "--frames"),
        (&["--hold", "0,0,0,1", "--nadir"], "cannot be used with"),
        (&[], "required"),
    ] {
        let error = with(arguments);
        assert!(error.contains(part), "{arguments:?}: {error}");
    }
    let error = error_of(&[
        "--link",
        "can0",
        "--hold",
        "0,0,0,1",
        "--epoch",
        "2019-06-15T23:35:50",
    ]);
    assert!(error.contains("names no link"), "{error}");
    let error = error_of(&["--link", "udp://127.0.0.1:9", "--hold", "0,0,0,1"]);
    assert!(error.contains("--epoch"), "{error}");
}
