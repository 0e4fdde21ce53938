//! Wrong inputs: one clear line each, that names what, where and the remedy; nothing is written.

use crate::{EPOCH, Q, STATE, repository, skyloop};
use std::net::UdpSocket;

/// The first line on standard error of a command that fails; `words` must be in it.
fn refuses(flags: &[&str], words: &[&str]) {
    let here = tempfile::tempdir().unwrap();
    for (name, text) in [
        ("key.toml", "seed = 1\nsead = 3\n"),
        ("range.toml", "label_snr = -3\n"),
        ("seed.toml", "seed = 1\n"),
        ("clock.toml", "[run]\nclock = \"sundial\"\n"),
        ("camera.toml", "camera = \"nope\"\n"),
        ("time.toml", "[sequence]\nepoch = 5\n"),
        ("words.toml", "seed = 1\ncamera = rigel-l\n"),
        (
            "surplus.toml",
            "[sequence]\nepoch = \"2019-06-15T00:00:00Z\"\nframes = 1\nperiod_s = 1\n\
             attitudes = [{ q = [0, 0, 0, 1, 0] }]\n",
        ),
        (
            "rates.toml",
            "[sequence]\nepoch = \"2019-06-15T00:00:00Z\"\nframes = 1\nperiod_s = 1\n\
             attitudes = [{ q = [0, 0, 0, 1] }]\nrates_deg_s = [0, 0, 0, 0.1]\n",
        ),
        ("file", ""),
        (
            "metres.oem",
            "CCSDS_OEM_VERS = 2.0\nMETA_START\nOBJECT_NAME = X\nOBJECT_ID = X\nCENTER_NAME = EARTH\n\
             REF_FRAME = GCRF\nTIME_SYSTEM = UTC\nSTART_TIME = 2019-06-15T00:00:00\n\
             STOP_TIME = 2019-06-16T00:00:00\nMETA_STOP\n2019-06-15T00:00:00 7000000 0 0 0 7500 0\n",
        ),
    ] {
        std::fs::write(here.path().join(name), text).unwrap();
    }
    let slow = std::fs::read_to_string(repository("configs/cameras/fai-nir.toml")).unwrap();
    let slow = slow
        .replace("exposure_s = 0.1", "exposure_s = 3400.0")
        .replace("rate_hz = 1.0", "rate_hz = 0.0002");
    std::fs::write(here.path().join("slow.toml"), slow).unwrap();
    std::fs::write(here.path().join("binary"), b"\x7fELF\0\x01\xff").unwrap();
    let failed = skyloop(here.path()).args(flags).assert().failure();
    let log = String::from_utf8(failed.get_output().stderr.clone()).unwrap();
    let line = log.lines().next().unwrap_or_default();
    assert!(line.starts_with("error: "), "{flags:?}: {log}");
    for word in words {
        assert!(log.contains(word), "{flags:?}: no {word:?} in {log}");
    }
    // A wrong flag names the help, several faults of a file are a line each; all else is one line.
    if !log.contains("--help") && !log.contains(" faults:\n") {
        assert_eq!(log.lines().count(), 1, "{flags:?}: {log}");
    }
    let half: String = line.chars().skip(line.chars().count() / 2).collect();
    assert!(
        half.len() < 20 || line.matches(&half).count() == 1,
        "told twice: {line}"
    );
    assert!(
        !here.path().join("o").exists(),
        "{flags:?}: nothing may be written"
    );
}

/// `render` with the usual epoch and attitude, and `flags`.
fn render(flags: &[&str], words: &[&str]) {
    let usual = ["render", "--epoch", EPOCH, "--attitude", Q, "--out", "o"];
    refuses(&[&usual[..], flags].concat(), words);
}

#[test]
fn attitudes() {
    let with = |q, words: &[&str]| {
        refuses(
            &["render", "--epoch", EPOCH, "--out", "o", "--attitude", q],
            words,
        );
    };
    with(
        "0,0,0,1.1",
        &[
            "--attitude",
            "[0.0, 0.0, 0.0, 1.1]",
            "norm 1.100000",
            "unit quaternion",
        ],
    );
    with(
        "0,0,0,1.0011",
        &["--attitude", "norm 1.001100", "unit quaternion"],
    );
    with("0,0,0,nan", &["--attitude", "0,0,0,nan", "finite"]);
    with("0,0,1", &["--attitude", "4 numbers", "not 3"]);
    render(
        &["--rates", "0,0,1e9"],
        &["--rates (deg/s)", "at most 628.4 rad/s"],
    );
    // Refused before the folder is touched, though only the camera's exposure of 0.1 s makes it too much.
    render(
        &["--rates", "9000,0,0"],
        &["turns 900.0 deg", "57.3 deg", "lower the rates"],
    );
    render(
        &["--state", "7000000,0,0,0,7500,0"],
        &[
            "--state 7000000,0,0,0,7500,0: 7000000.0 km from the Earth's centre at 7500.000 km/s",
            "6356 to 4000000 km",
            "at most 100 km/s",
            "it is in km and km/s",
        ],
    );
    // At rest at mid-exposure it has come through the ground within the 1700 s before.
    render(
        &["--camera", "slow.toml", "--state", "6400,0,0,0,0,0"],
        &[
            "carried on to 2019-06-15T23:07:30",
            "from the Earth's centre",
        ],
    );
    with("0,0,0,1,0", &["--attitude", "4 numbers", "not 5"]);
    with("0,0,zero,1", &["--attitude", "4 numbers"]);
}

#[test]
fn epochs() {
    for epoch in ["yesterday", "2019-13-45T00:00:00Z", "", "2019"] {
        refuses(
            &["render", "--attitude", Q, "--out", "o", "--epoch", epoch],
            &["--epoch", epoch, "UTC", "2019-06-15T23:35:50"],
        );
    }
    refuses(&["render", "--attitude", Q, "--out", "o"], &["--epoch"]);
}

#[test]
fn rates_and_states() {
    render(&["--rates", "1,2"], &["--rates", "3 numbers", "not 2"]);
    render(&["--rates", "1,2,inf"], &["--rates", "finite"]);
    render(&["--rates", "1,2,1e9"], &["rates", "628.4 rad/s"]);
    render(
        &["--state", "7000,0,0,0,7.5"],
        &["--state", "6 numbers", "not 5"],
    );
    render(
        &["--state", "6000,0,0,0,7.5,0"],
        &["--state 6000,", "6000.0 km from", "must be 6356 to"],
    );
    render(
        &["--state", STATE, "--orbit", "x.tle"],
        &["--state", "--orbit"],
    );
}

#[test]
fn cameras_numbers_and_folders() {
    render(
        &["--camera", "nope"],
        &[
            "nope",
            "No such file",
            "fai-nir, fai-630, rigel-l, cots-wide, cmos-rolling, ccd-transfer, all-sky",
        ],
    );
    render(&["--camera", "fai_nri"], &["did you mean fai-nir?"]);
    render(&["--frames", "0"], &["--frames", "0", "1 to 1000000"]);
    render(&["--period", "-1"], &["--period", "seconds"]);
    render(&["--label-snr", "nan"], &["--label-snr", "0 to 1e9"]);
    for out in ["file", "file/inside"] {
        refuses(
            &["render", "--epoch", EPOCH, "--attitude", Q, "--out", out],
            &[out, "choose another output folder"],
        );
    }
    refuses(
        &["loopback", "--frames", "1", "--out", "file"],
        &["file", "choose another output folder"],
    );
}

#[test]
fn objects_and_orbits() {
    let oem = |name: &str| repository(&format!("configs/scenes/rcm-2019-06-15/{name}-B.oem"));
    render(
        &["--rso", &oem("rcm-1")],
        &["observer", "--state or --orbit"],
    );
    render(
        &["--rso", "none.tle", "--state", STATE],
        &["none.tle", "No such file", "check the path"],
    );
    let named = format!("{}:RCM-1", oem("rcm-1"));
    render(
        &["--rso", &named, "--state", STATE],
        &["whole files", "rcm-1-B.oem"],
    );
    render(
        &["--rso", "metres.oem", "--state", STATE],
        &["metres.oem", "no usable object", "km and km/s"],
    );
    render(
        &["--orbit", "none.tle"],
        &["none.tle", "No such file", "check the path"],
    );
    render(
        &["--orbit", &format!("{}:IKAROS", oem("cassiope"))],
        &["cassiope-B.oem", "IKAROS", "2013-055A"],
    );
    refuses(
        &[
            "render",
            "--epoch",
            "2020-06-15T23:35:50Z",
            "--attitude",
            Q,
            "--out",
            "o",
            "--orbit",
            &oem("cassiope"),
        ],
        &[
            "CASSIOPE",
            "2020-06-15T23:35:50.000Z",
            "outside its ephemeris",
            "covers 2019-06-15T23:35:30",
        ],
    );
}

#[test]
fn epochs_beyond_the_series() {
    refuses(
        &[
            "render",
            "--attitude",
            Q,
            "--out",
            "o",
            "--epoch",
            "1850-01-01T00:00:00Z",
        ],
        &["1850-01-01", "1900 to 2100", "choose an epoch inside"],
    );
}

#[test]
fn scenes() {
    let scene = |file, words: &[&str]| refuses(&["render", "--out", "o", "--scene", file], words);
    scene(
        "key.toml",
        &["key.toml:2:1: sead: unknown key `sead`: did you mean `seed`?"],
    );
    scene(
        "range.toml",
        &["range.toml", "label_snr = -3", "must be 0 to"],
    );
    scene(
        "clock.toml",
        &[
            "clock.toml:2:9: run.clock: ",
            "sundial",
            "must be one of \"stepped\", \"wall\", \"external\", not \"sundial\"",
        ],
    );
    scene("camera.toml", &["nope", "fai-nir"]);
    scene("none.toml", &["none.toml", "No such file"]);
    scene("binary", &["binary", "not a text file"]);
    scene(
        "seed.toml",
        &["seed.toml", "[sequence]", "configs/default.toml"],
    );
    scene(
        "time.toml",
        &["time.toml:2:9: sequence.epoch: ", "2019-06-15T23:35:50"],
    );
    scene(
        "words.toml",
        &[
            "words.toml:2:10: not TOML: ",
            "camera = rigel-l: texts stand in quotes, camera = \"rigel-l\"",
        ],
    );
    scene(
        "surplus.toml",
        &["surplus.toml:5:20: sequence.attitudes[0].q: must have 4 values, not 5"],
    );
    scene(
        "rates.toml",
        &["rates.toml:6:15: sequence.rates_deg_s: must have 3 values, not 4"],
    );
    // The attitudes of the scene cover 25 s: 51 frames at 2 Hz.
    let known = repository("configs/scenes/rcm-2019-06-15/scene.toml");
    let beyond = [
        "scene.toml: ",
        "2019-06-15T23:36:15.5",
        "covers 2019-06-15T23:35:50.000Z to 2019-06-15T23:36:15.000Z",
    ];
    refuses(
        &["render", "--out", "o", "--frames", "52", "--scene", &known],
        &beyond,
    );
    refuses(&["loopback", "--out", "o", "--frames", "52"], &beyond[1..]);
}

#[test]
fn links() {
    let link = |url: &str, words: &[&str]| {
        refuses(&["run", "--config", "seed.toml", "--link", url], words);
    };
    link(
        "tcp://127.0.0.1:1",
        &[
            "tcp://127.0.0.1:1",
            "unknown scheme",
            "udp://127.0.0.1:4810",
        ],
    );
    link(
        "nonsense",
        &["nonsense", "no scheme", "udp://127.0.0.1:4810"],
    );
    link("udp://nohost", &["udp://nohost", "address and a port"]);
    link(
        "udp://127.0.0.1:0?rate=1",
        &["unknown option \"rate\"", "rate_mbit, proof, roles"],
    );
    link(
        "udp://127.0.0.1:0?rate_mbit=fast",
        &["rate_mbit", "fast", "0.01 to 100000"],
    );
    link(
        "udp://127.0.0.1:0?rate_mbit=1&rate_mbit=2",
        &["\"rate_mbit\" is given twice"],
    );
    link(
        "serial:///dev/nosuch",
        &[
            "serial:///dev/nosuch",
            "No such file",
            "check that the device exists",
        ],
    );
    link(
        "serial:///dev/nosuch?baud=fast",
        &["baud", "fast", "whole number"],
    );
    link("memory://", &["memory", "loopback"]);
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let url = format!("udp://{}", taken.local_addr().unwrap());
    link(&url, &[&url, "in use", "choose a free port"]);
    refuses(
        &["loopback", "--link", "pigeon"],
        &["pigeon", "memory, udp, serial"],
    );
    refuses(
        &["loopback", "--link", "memory?baud=1"],
        &["unknown option \"baud\"", "memory has roles"],
    );
    refuses(
        &["run", "--config", "none.toml"],
        &["none.toml", "No such file"],
    );
}

#[test]
#[cfg(unix)]
fn serial_ports() {
    let link = |url: &str, words: &[&str]| {
        refuses(&["run", "--config", "seed.toml", "--link", url], words);
    };
    for baud in ["0", "9599", "3000001"] {
        link(
            &format!("serial:///dev/nosuch?baud={baud}"),
            &["baud = ", baud, "must be 9600 to 3000000"],
        );
    }
    let no_port = "this is no serial port: name a device";
    link("serial://file", &["serial://file", no_port]);
    link("serial:///dev", &["serial:///dev", no_port]);
    // X-Val: the options of a port without privileges are those of chmod(1), which root ignores; a device of another
    // kind is refused to everybody.
    link(
        "serial:///dev/null",
        &["serial:///dev/null", "this is no serial port"],
    );
    let (_near, far) = serialport::TTYPort::pair().unwrap();
    let device = serialport::SerialPort::name(&far).unwrap();
    drop(far);
    let _user = crate::support::line::open_port(&device, 9600);
    link(
        &format!("serial://{device}"),
        &[&device, "another program has it open"],
    );
}

/// Root may open everything: then the program runs as another user.
#[test]
#[cfg(unix)]
fn a_port_that_is_not_permitted() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    use std::os::unix::process::CommandExt;
    const NOBODY: u32 = 65_534;
    let here = tempfile::tempdir().unwrap();
    let (_near, far) = serialport::TTYPort::pair().unwrap();
    let device = serialport::SerialPort::name(&far).unwrap();
    let permit = |path: &std::path::Path, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    };
    permit(device.as_ref(), 0o000);
    permit(here.path(), 0o755);
    let program = here.path().join("skyloop");
    // Where it is, that user may not be let in.
    let built = env!("CARGO_BIN_EXE_skyloop");
    std::fs::hard_link(built, &program)
        .or_else(|_| std::fs::copy(built, &program).map(drop))
        .unwrap();
    let config = here.path().join("seed.toml");
    std::fs::write(&config, "seed = 1\n").unwrap();
    let mut command = std::process::Command::new(&program);
    command.args(["run", "--config", "seed.toml", "--link"]);
    command.arg(format!("serial://{device}"));
    command.current_dir(here.path());
    if here.path().metadata().unwrap().uid() == 0 {
        command.uid(NOBODY).gid(NOBODY);
    }
    let output = command.output().unwrap();
    let log = String::from_utf8(output.stderr).unwrap();
    assert_eq!(
        (output.status.code(), log.lines().count()),
        (Some(1), 1),
        "{log}"
    );
    for word in [&device, "you may not use the device: join the group"] {
        assert!(log.contains(word), "no {word:?} in {log}");
    }
}

#[test]
fn buses() {
    let link = |url: &str, words: &[&str]| {
        refuses(&["run", "--config", "seed.toml", "--link", url], words);
    };
    // A kernel without CAN says that, one with CAN misses the interface.
    let mend = match std::path::Path::new("/proc/net/can").exists() {
        true => "ip link add dev nosuchcan0 type vcan",
        false => "use slcan",
    };
    link("can://nosuchcan0", &["can://nosuchcan0", mend]);
    refuses(
        &["loopback", "--link", "can?bitrate=0"],
        &["bitrate = 0", "10000 to 1000000"],
    );
    link("can://", &["names no interface"]);
    link(
        "can://vcan0?baud=9600",
        &["unknown option \"baud\"", "bitrate, fd, load, roles"],
    );
    link(
        "can://vcan0?fd=9000000",
        &["fd = 9000000", "500000 (the bitrate) to 8000000"],
    );
    link("can://vcan0?load=2", &["load = \"2\"", "0.01 to 1"]);
    link(
        "slcan:///dev/nosuch",
        &[
            "slcan:///dev/nosuch",
            "No such file",
            "check that the device exists",
        ],
    );
    link(
        "slcan:///dev/nosuch?bitrate=33333",
        &["bitrate = 33333", "125000, 250000"],
    );
    link(
        "slcan:///dev/nosuch?fd=3000000",
        &["fd = 3000000", "2000000, 4000000"],
    );
}

#[test]
#[cfg(target_os = "linux")]
fn pseudo_terminals() {
    let link = |url: &str, words: &[&str]| {
        refuses(&["run", "--config", "seed.toml", "--link", url], words);
    };
    link("pty://", &["pty://", "no name for the client to open"]);
    link("pty://file", &["pty://file", "choose another name"]);
    link(
        "pty://no/such",
        &["pty://no/such", "a folder that you may write"],
    );
    link("pty://p?baud=300", &["baud = 300", "9600 to 3000000"]);
    refuses(&["pty", "a", "file"], &["file", "choose another name"]);
    refuses(&["pty", "a", "a"], &["link a", "choose another name"]);
    refuses(
        &["pty", "a", "b", "--baud", "300"],
        &["--baud", "300", "9600 to 3000000"],
    );
}
