//! Wrong inputs: one line each with the fault, its position and the remedy; nothing is written.

use crate::{EPOCH, Folder, Outcome, Q, STATE, camera, repository};
use std::net::UdpSocket;

/// A folder with configurations, most of which have a fault.
fn folder() -> Folder {
    let sequence = "[sequence]\nepoch = \"2019-06-15T00:00:00Z\"\nframes = 1\nperiod_s = 1\n";
    let surplus = format!("{sequence}attitudes = [{{ q = [0, 0, 0, 1, 0] }}]\n");
    let rates =
        format!("{sequence}attitudes = [{{ q = [0, 0, 0, 1] }}]\nrates_deg_s = [0, 0, 0, 0.1]\n");
    let here = Folder::with(&[
        ("key.toml", "seed = 1\nsead = 3\n"),
        ("range.toml", "label_snr = -3\n"),
        ("seed.toml", "seed = 1\n"),
        ("clock.toml", "[run]\nclock = \"sundial\"\n"),
        ("camera.toml", "camera = \"nope\"\n"),
        ("time.toml", "[sequence]\nepoch = 5\n"),
        ("words.toml", "seed = 1\ncamera = rigel-l\n"),
        ("surplus.toml", &surplus),
        ("rates.toml", &rates),
        ("file", ""),
        (
            "metres.oem",
            "CCSDS_OEM_VERS = 2.0\nMETA_START\nOBJECT_NAME = X\nOBJECT_ID = X\nCENTER_NAME = EARTH\n\
             REF_FRAME = GCRF\nTIME_SYSTEM = UTC\nSTART_TIME = 2019-06-15T00:00:00\n\
             STOP_TIME = 2019-06-16T00:00:00\nMETA_STOP\n2019-06-15T00:00:00 7000000 0 0 0 7500 0\n",
        ),
    ]);
    let slow = camera(
        "fai-nir",
        &[("exposure_s", "3400.0"), ("rate_hz", "0.0002")],
    );
    here.write("slow.toml", slow);
    here.write("binary", b"\x7fELF\0\x01\xff");
    here
}

/// Asserts that each row of the table, after `before`, is refused.
#[track_caller]
fn refuses(before: &str, table: &str) {
    folder().refuses(before, table);
}

#[test]
fn attitudes_and_epochs() {
    refuses(
        &format!("render --epoch {EPOCH} --out o --attitude"),
        "0,0,0,1.1    | --attitude | [0.0, 0.0, 0.0, 1.1] | norm 1.100000 | unit quaternion
         0,0,0,1.0011 | --attitude | norm 1.001100 | unit quaternion
         0,0,0,nan    | --attitude | 0,0,0,nan | finite
         0,0,1        | --attitude | 4 numbers | not 3
         0,0,0,1,0    | --attitude | 4 numbers | not 5
         0,0,zero,1   | --attitude | 4 numbers",
    );
    refuses(
        &format!("render --attitude {Q} --out o"),
        "--epoch=yesterday            | --epoch | yesterday | UTC | 2019-06-15T23:35:50
         --epoch=2019-13-45T00:00:00Z | --epoch | 2019-13-45T00:00:00Z | UTC | 2019-06-15T23:35:50
         --epoch=                     | --epoch | UTC | 2019-06-15T23:35:50
         --epoch=2019                 | --epoch | 2019 | UTC | 2019-06-15T23:35:50
         --epoch=1850-01-01T00:00:00Z | 1850-01-01 | 1900 to 2100 | choose an epoch inside
         --frames 1                   | --epoch",
    );
}

/// Refused before the folder is written, even if only the camera's exposure exceeds the limit: a
/// turn by 900 deg in 0.1 s, or a path through the ground in the 1700 s before.
#[test]
fn rates_and_states() {
    refuses(
        &crate::render(""),
        &format!(
            "--rates 0,0,1e9  | --rates (deg/s) | at most 628.4 rad/s
             --rates 1,2      | --rates | 3 numbers | not 2
             --rates 1,2,inf  | --rates | finite
             --rates 9000,0,0 | turns 900.0 deg | 57.3 deg | lower the rates
             --state 7000000,0,0,0,7500,0
             | --state 7000000,0,0,0,7500,0: 7000000.0 km from the Earth's centre at 7500.000 km/s
             | 6356 to 4000000 km | at most 100 km/s | it is in km and km/s
             --state 6000,0,0,0,7.5,0 | --state 6000, | 6000.0 km from | must be 6356 to
             --state 7000,0,0,0,7.5   | --state | 6 numbers | not 5
             --state {STATE} --orbit x.tle | --state | --orbit
             --camera slow.toml --state 6400,0,0,0,0,0
             | propagated to 2019-06-15T23:07:30 | from the Earth's centre"
        ),
    );
}

#[test]
fn cameras_numbers_and_folders() {
    refuses(
        &crate::render(""),
        "--camera nope    | nope | No such file
         | fai-nir, fai-630, rigel-l, cots-wide, cmos-rolling, ccd-transfer, all-sky
         --camera fai_nri | did you mean fai-nir?
         --frames 0       | --frames | 0 | 1 to 1000000
         --period -1      | --period | 0.000001 to 1000000
         --label-snr nan  | --label-snr | 0 to 1000000000",
    );
    let render = format!("render --epoch {EPOCH} --attitude {Q} --out");
    refuses(
        "",
        &format!(
            "{render} file                 | file | choose another output folder
             {render} file/inside          | file/inside | choose another output folder
             loopback --frames 1 --out file | file | choose another output folder"
        ),
    );
}

#[test]
fn objects_and_orbits() {
    let scene = repository("configs/scenes/rcm-2019-06-15");
    refuses(
        "render --out o",
        &format!(
            "--epoch {EPOCH} --attitude {Q} --rso {scene}/rcm-1-B.oem | observer | --state or --orbit
             --epoch {EPOCH} --attitude {Q} --rso none.tle --state {STATE}
             | none.tle | No such file | check the path
             --epoch {EPOCH} --attitude {Q} --rso {scene}/rcm-1-B.oem:RCM-1 --state {STATE}
             | whole files | rcm-1-B.oem
             --epoch {EPOCH} --attitude {Q} --rso metres.oem --state {STATE}
             | metres.oem | no usable object | km and km/s
             --epoch {EPOCH} --attitude {Q} --orbit none.tle | none.tle | No such file | check the path
             --epoch {EPOCH} --attitude {Q} --orbit {scene}/cassiope-B.oem:IKAROS
             | cassiope-B.oem | IKAROS | 2013-055A
             --epoch 2020-06-15T23:35:50Z --attitude {Q} --orbit {scene}/cassiope-B.oem
             | CASSIOPE | 2020-06-15T23:35:50.000Z | outside its ephemeris
             | covers 2019-06-15T23:35:30"
        ),
    );
}

/// The attitudes of the built-in scene cover 25 s: 51 frames at 2 Hz.
#[test]
fn scenes() {
    let known = repository("configs/scenes/rcm-2019-06-15/scene.toml");
    refuses(
        "render --out o --scene",
        &format!(
            "key.toml    | key.toml:2:1: sead: unknown key `sead`: did you mean `seed`?
             range.toml  | range.toml | label_snr = -3 | must be 0 to
             clock.toml  | clock.toml:2:9: run.clock: | sundial
             | must be one of \"stepped\", \"wall\", \"external\", not \"sundial\"
             camera.toml | nope | fai-nir
             none.toml   | none.toml | No such file
             binary      | binary | not a text file
             seed.toml   | seed.toml | [sequence] | configs/default.toml
             time.toml   | time.toml:2:9: sequence.epoch: | 2019-06-15T23:35:50
             words.toml  | words.toml:2:10: not TOML:
             | camera = rigel-l: texts stand in quotes, camera = \"rigel-l\"
             surplus.toml
             | surplus.toml:5:20: sequence.attitudes[0].q: must have 4 values, not 5
             rates.toml  | rates.toml:6:15: sequence.rates_deg_s: must have 3 values, not 4
             {known} --frames 52 | scene.toml: | 2019-06-15T23:36:15.5
             | covers 2019-06-15T23:35:50.000Z to 2019-06-15T23:36:15.000Z"
        ),
    );
    refuses(
        "",
        "loopback --out o --frames 52 | 2019-06-15T23:36:15.5
         | covers 2019-06-15T23:35:50.000Z to 2019-06-15T23:36:15.000Z
         run --config none.toml       | none.toml | No such file",
    );
}

#[test]
fn links() {
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let taken = format!("udp://{}", taken.local_addr().unwrap());
    refuses(
        "run --config seed.toml --link",
        &format!(
            "tcp://127.0.0.1:1 | tcp://127.0.0.1:1 | unknown scheme | udp://127.0.0.1:4810
             nonsense          | nonsense | no scheme | udp://127.0.0.1:4810
             memory://         | memory | loopback
             udp://nohost      | udp://nohost | address and a port
             {taken}           | {taken} | in use | choose a free port
             udp://127.0.0.1:0?rate=1         | unknown option \"rate\" | rate_mbit, proof, roles
             udp://127.0.0.1:0?rate_mbit=fast | rate_mbit | fast | 0.01 to 100000
             udp://127.0.0.1:0?rate_mbit=1&rate_mbit=2 | \"rate_mbit\" is given twice
             serial:///dev/nosuch
             | serial:///dev/nosuch | No such file | check that the device exists
             serial:///dev/nosuch?baud=fast   | baud | fast | whole number"
        ),
    );
    refuses(
        "loopback --link",
        "pigeon        | pigeon | memory, udp, serial
         memory?baud=1 | unknown option \"baud\" | memory has roles
         can?bitrate=0 | bitrate = 0 | 10000 to 1000000",
    );
}

/// Permissions of ports do not apply to root; devices of another kind are always refused.
#[test]
#[cfg(unix)]
fn serial_ports() {
    let (_near, far) = serialport::TTYPort::pair().unwrap();
    let device = serialport::SerialPort::name(&far).unwrap();
    drop(far);
    let _user = crate::support::line::open_port(&device, 9600);
    refuses(
        "run --config seed.toml --link",
        &format!(
            "serial:///dev/nosuch?baud=0    | baud = | 0 | must be 9600 to 3000000
             serial:///dev/nosuch?baud=9599 | baud = | 9599 | must be 9600 to 3000000
             serial:///dev/nosuch?baud=3000001 | baud = | 3000001 | must be 9600 to 3000000
             serial://file      | serial://file | this is no serial port: name a device
             serial:///dev      | serial:///dev | this is no serial port: name a device
             serial:///dev/null | serial:///dev/null | this is no serial port
             serial://{device}  | {device} | another program has it open"
        ),
    );
}

/// Root may open every port, so the program runs as another user.
#[test]
#[cfg(unix)]
fn a_port_that_is_not_permitted() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    use std::os::unix::process::CommandExt;
    const OTHER_USER: u32 = 65_534;
    let here = Folder::with(&[("seed.toml", "seed = 1\n")]);
    let (_near, far) = serialport::TTYPort::pair().unwrap();
    let device = serialport::SerialPort::name(&far).unwrap();
    let permit = |path: &std::path::Path, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    };
    permit(device.as_ref(), 0o000);
    permit(&here, 0o755);
    let program = here.join("skyloop");
    // The other user may lack access to the original's folder.
    let built = env!("CARGO_BIN_EXE_skyloop");
    std::fs::hard_link(built, &program)
        .or_else(|_| std::fs::copy(built, &program).map(drop))
        .unwrap();
    let mut command = std::process::Command::new(&program);
    let link = format!("serial://{device}");
    command.args(["run", "--config", "seed.toml", "--link", &link]);
    command.current_dir(&here);
    if here.metadata().unwrap().uid() == 0 {
        command.uid(OTHER_USER).gid(OTHER_USER);
    }
    let refused = Outcome::of(&link, command.output().unwrap());
    refused
        .exits(1)
        .logs_lines(1)
        .logs(&[&device, "you may not use the device: join the group"]);
}

#[test]
fn buses() {
    // A kernel without CAN reports that; a kernel with CAN reports the missing interface.
    let remedy = if std::path::Path::new("/proc/net/can").exists() {
        "ip link add dev nosuchcan0 type vcan"
    } else {
        "use slcan"
    };
    refuses(
        "run --config seed.toml --link",
        &format!(
            "can://nosuchcan0       | can://nosuchcan0 | {remedy}
             can://                 | names no interface
             can://vcan0?baud=9600  | unknown option \"baud\" | bitrate, fd, load, roles
             can://vcan0?fd=9000000 | fd = 9000000 | 500000 (the bitrate) to 8000000
             can://vcan0?load=2     | load = 2 | 0.01 to 1
             slcan:///dev/nosuch
             | slcan:///dev/nosuch | No such file | check that the device exists
             slcan:///dev/nosuch?bitrate=33333 | bitrate = 33333 | 125000, 250000
             slcan:///dev/nosuch?fd=3000000    | fd = 3000000 | 2000000, 4000000"
        ),
    );
}

#[test]
#[cfg(target_os = "linux")]
fn pseudo_terminals() {
    refuses(
        "run --config seed.toml --link",
        "pty://           | pty:// | no name for the client to open
         pty://file       | pty://file | choose another name
         pty://no/such    | pty://no/such | a folder that you may write
         pty://p?baud=300 | baud = 300 | 9600 to 3000000",
    );
    refuses(
        "pty a",
        "file         | file | choose another name
         a            | link a | choose another name
         b --baud 300 | --baud | 300 | 9600 to 3000000",
    );
}
