//! `skyloop-fc` as a process.

use std::net::UdpSocket;
use std::path::PathBuf;
use std::process::{Command, Output};
use std::time::Duration;

use crate::common::emulator::Emulator;
use crate::common::loops::over_udp;

/// Runs the program; arguments must not contain blanks.
pub fn skyloop_fc(arguments: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_skyloop-fc"))
        .args(arguments.split_whitespace())
        .output()
        .unwrap()
}

fn error_of(arguments: &str) -> String {
    let output = skyloop_fc(arguments);
    assert!(!output.status.success(), "{arguments}");
    let error = String::from_utf8(output.stderr).unwrap();
    let line = error.lines().next().unwrap_or_default();
    let half: String = line.chars().skip(line.chars().count() / 2).collect();
    assert_eq!(line.matches(&half).count(), 1, "repeated: {line}");
    error
}

fn file(name: &str, text: &str) -> String {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

/// One minute of a circular equatorial orbit of 7000 km.
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
        let [x, y] = [cos, sin].map(|of| 7000.0 * of);
        let (vx, vy) = (-rate * y, rate * x);
        text += &format!(
            "2019-06-15T23:{minute}:{seconds:02}.000 {x:.6} {y:.6} 0.0 {vx:.9} {vy:.9} 0.0\n"
        );
    }
    file(name, &text)
}

#[test]
fn a_run_over_udp_prints_its_table() {
    // The emulator ends after this silence.
    let (address, thread) = over_udp(Emulator::new(|_, _| {}), Duration::from_secs(10));
    let base = format!("--link udp://{address} --epoch 2019-06-15T23:35:50 --frames 3");
    let orbit = oem("run.oem");
    for options in [
        format!("--orbit {orbit}:testsat --nadir"),
        "--hold -0.070834,-0.644137,0.733522,-0.204975 --rate 100".into(),
        format!("--limb-stare 80,-90 --orbit {orbit}"),
        "--scan 0,0,0,1,2,1.5,x".into(),
    ] {
        let output = skyloop_fc(&format!("{base} {options}"));
        let text = String::from_utf8_lossy(&output.stdout);
        let error = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{text} {error}");
        for part in ["3 of 3 whole, 0 lost", "residual         rms 0.0"] {
            assert!(text.contains(part), "{text}");
        }
    }
    let junit = file("verdicts.xml", "");
    let limits = "--max-missed 1000 --max-centroid-rms 1e-9";
    let broken = skyloop_fc(&format!("{base} --hold 0,0,0,1 {limits} --junit {junit}"));
    assert_eq!(broken.status.code(), Some(1));
    let table = String::from_utf8_lossy(&broken.stdout);
    for line in [
        "passed: bright labelled objects missed: 0, within 1000",
        "failed: centroids: rms 0.0",
    ] {
        assert!(table.contains(line), "no {line:?} in {table}");
    }
    let verdicts = std::fs::read_to_string(junit).unwrap();
    let counts = "tests=\"3\" failures=\"1\"";
    assert!(verdicts.contains(counts), "{verdicts}");

    let attitudes = thread.join().unwrap().attitudes;
    let attitudes: Vec<_> = attitudes.iter().map(|(_, attitude)| attitude).collect();
    assert_eq!(attitudes.len(), 15);
    // Above the equator the nadir attitude rotates about -Y once per orbit.
    let nadir = attitudes[0].rates_rad_s[1];
    assert!((nadir + 1.078e-3).abs() < 1e-6, "{nadir}");
    assert!(attitudes[0].state.is_some() && attitudes[3].state.is_none());
    // At any azimuth a limb stare rotates once per orbit.
    let limb = nalgebra::Vector3::from(attitudes[6].rates_rad_s);
    assert!((limb.norm() - 1.078e-3).abs() < 1e-5, "{limb}");
    // X-Val: 1.5 deg/s for 1 s: q = [-sin(0.75 deg), 0, 0, cos(0.75 deg)].
    let scanned = attitudes[11];
    assert!((scanned.q_icrf_to_body[0] + 0.75_f64.to_radians().sin()).abs() < 1e-12);
    assert!((scanned.rates_rad_s[0] - 1.5_f64.to_radians()).abs() < 1e-12);
}

/// A process that ends with its test.
struct Running(std::process::Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
#[cfg(unix)]
fn signals_end_a_run_with_its_report() {
    for signal in ["-INT", "-TERM", "-HUP"] {
        assert_report_after(signal);
    }
}

#[cfg(unix)]
fn assert_report_after(signal: &str) {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let link = format!("udp://{}", socket.local_addr().unwrap());
    let mut emulator = Emulator::new(|_, _| {});
    // The parent process may ignore SIGHUP.
    let child = Command::new("env")
        .args(["--default-signal=HUP", env!("CARGO_BIN_EXE_skyloop-fc")])
        .args(["--link", &link, "--epoch", "2019-06-15T23:35:50"])
        .args(["--hold", "0,0,0,1", "--frames", "1000000"])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn();
    let mut running = Running(child.unwrap());
    let timeout = Some(Duration::from_secs(10));
    socket.set_read_timeout(timeout).unwrap();
    let mut buffer = [0; 2048];
    // The signal follows three frames; the second Reset ends the exchange.
    while emulator.resets < 2 {
        let (length, client) = socket
            .recv_from(&mut buffer)
            .expect("the run continues or ends");
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
fn numbers_out_of_range_are_usage_errors() {
    for (option, range) in [
        ("--period", "0.000001 to 1000000 s"),
        ("--rate", "0.000001 to 100000 Hz"),
        ("--timeout", "0.001 to 1000000 s"),
        ("--focal-px", "1 to 10000000 px"),
        ("--frames", "whole number from 1 to"),
    ] {
        for value in ["0", "-1", "1e300", "nan", "soon"] {
            let base = "--link udp://127.0.0.1:9 --hold 0,0,0,1 --wall";
            let output = skyloop_fc(&format!("{base} {option} {value}"));
            let error = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(2), "{option} {value}: {error}");
            let stated = option == "--frames" && value != "0" || error.contains(range);
            assert!(stated && error.contains(option), "{error}");
            assert!(error.len() < 250, "{error}");
        }
    }
}

/// Options, with `ORBIT` for an orbit file, and part of the error.
const REFUSED: [&str; 35] = [
    "--hold 0,0,0,1 => is an emulator (skyloop run) listening",
    "--hold 0,0,0,2 => norm is 2",
    "--slew 0,0,0,1,5 => 5 numbers where 7 belong",
    "--nadir => --orbit",
    "--limb-stare 80 => --orbit",
    "--limb-stare -5 --orbit ORBIT => must be 0 to 10000 km",
    "--limb-stare 900 --orbit ORBIT => no limb at 900 km at 2019-06-15T23:35:50",
    "--scan 0,0,0,1,10,0 => the rate is 0; it must be above 0, at most 360 deg/s",
    "--hold 0,0,0,1 --loop => add --wall",
    "--hold 0,0,0,1 --loop --wall => --loop needs --focal-px",
    "--hold 0,0,0,1 --focal-px 500 => leave it out, or add --loop",
    "--hold 0,0,0,1 --drift 0,0,0.01 => leave it out, or add --loop",
    "--hold 0,0,0,1 --max-error 10 => --max-error is for a closed loop only",
    "--hold 0,0,0,1 --max-error 0 => it must be 0.001 to 648000 arcsec",
    "--slew 0,0,0,1,0,0,1 --loop --wall => give it by --hold x,y,z,w",
    "--hold 0,0,0,1 --loop --wall --output labels => choose windows, compressed or frame",
    "--hold 0,0,0,1 --drift 0.01,0.02 => 2 numbers where 3 belong: give x,y,z in deg/s",
    "--hold 0,0,0,1 --drift 0,0,0.2 => each must be -0.1 to 0.1 deg/s",
    "--hold 0,0,0,1 --drift 0,nan,0 => \"nan\" is no finite number",
    "--listen => '--epoch <UTC>' cannot be used with '--listen'",
    "--nadir --orbit tests => is a folder: name one file in it, as tests/FILE or tests/FILE:NAME",
    "--nadir --orbit none.oem => none.oem: No such file or directory (os error 2); --orbit takes a",
    "--attitudes none.txt => --attitudes takes a text file of lines UTC x y z w",
    "--nadir --orbit ORBIT:OTHER => no object called \"OTHER\"; it has 2019-001A (TESTSAT)",
    "--nadir --orbit ORBIT --period 10 => outside its ephemeris",
    "--nadir --orbit /dev/zero => cannot read the orbit file /dev/zero: this is a device",
    "--attitudes /dev/zero => this is a device or a socket",
    "--hold 0,0,0,1 --junit no/such.xml => cannot write no/such.xml: its folder does not exist",
    "--hold 0,0,0,1 --junit ORBIT --orbit ORBIT --force => this run reads this file",
    "--hold 0,0,0,1 --frames 0 => --frames",
    "--hold 0,0,0,1 --nadir => cannot be used with",
    "--hold 0,0,0,1 --pause 1 => AFTER:S",
    "--hold 0,0,0,1 --fault drop => KIND:in|out:VALUE",
    "--hold 0,0,0,1 --link can0 => names no link",
    " => required",
];

/// Options with a file's name, its content, and part of the error.
const REFUSED_FILES: [[&str; 3]; 5] = [
    [
        // X-Val: Vallado et al. 2006, AIAA 2006-6753, verification set 00005, of the year 2000.
        "--nadir --orbit old.3le",
        "VANGUARD 1\n1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753\n\
         2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667\n",
        "NORAD 5 (VANGUARD 1): old elements: 1 of 1 are more than 14 days",
    ],
    [
        "--attitudes attitudes.txt",
        "2019-06-15T23:35:50 0 0 0 1\nnow 0 0 0 1\n",
        "attitudes.txt:2: \"now\"",
    ],
    [
        "--attitudes short.txt",
        "2019-06-15T23:35:50 0 0 0 1\n2019-06-15T23:35:51 0 0 0 1\n",
        "give attitudes on both sides of every frame",
    ],
    [
        "--attitudes spinner.aem",
        "ATTITUDE_TYPE = SPIN\nMETA_STOP\n",
        "spinner.aem:9: ATTITUDE_TYPE 'SPIN'",
    ],
    [
        "--attitudes still.aem",
        "ATTITUDE_TYPE = QUATERNION\nMETA_STOP\n2019-06-15T23:35:50 0 0 0 1\n\
         2019-06-15T23:35:51 0 0 0 1\n",
        "covers 2019-06-15T23:35:50.000Z to 2019-06-15T23:35:51.000Z",
    ],
];

const AEM: &str = "CCSDS_AEM_VERS = 2.0\nMETA_START\nOBJECT_ID = A\nREF_FRAME_A = ICRF\nREF_FRAME_B = SC_BODY_1\n\
                   TIME_SYSTEM = UTC\nSTART_TIME = 2019-06-15T23:35:50\nSTOP_TIME = 2019-06-15T23:35:59\n";

#[test]
fn errors_name_a_remedy() {
    let base = "--link udp://127.0.0.1:9 --epoch 2019-06-15T23:35:50 --timeout 0.2";
    let orbit = oem("errors.oem");
    let options = REFUSED.map(|row| {
        let (options, part) = row.split_once(" => ").unwrap();
        (options.replace("ORBIT", &orbit), part)
    });
    let files = REFUSED_FILES.map(|[options, text, part]| {
        let (options, name) = options.rsplit_once(' ').unwrap();
        let head = if name.ends_with(".aem") { AEM } else { "" };
        let path = file(name, &format!("{head}{text}"));
        (format!("{options} {path}"), part)
    });
    for (options, part) in options.iter().chain(&files) {
        let error = error_of(&format!("{base} {options}"));
        assert!(error.contains(part), "{options}: {error}");
    }
    let error = error_of("--link udp://127.0.0.1:9 --hold 0,0,0,1");
    assert!(error.contains("--epoch"), "{error}");
}
