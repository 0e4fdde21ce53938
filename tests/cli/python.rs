//! The Python client, `examples/client.py`: with every built-in camera, with losses, and at a
//! camera's full rate.
#![cfg(unix)]

use crate::run::Process;
use crate::support::always;
use crate::{EPOCH, Folder, Outcome, Q, camera, has, repository, repository_text};
use skyloop::load::CAMERAS;
use skyloop_protocols::MAX_PACKET;
use skyloop_protocols::apid::{FRAME_END, FRAME_HEADER, LABELS, PIXEL_BLOCK, STATUS};
use skyloop_protocols::packet::{HEADER_LENGTH, identify, reseal};
use std::net::UdpSocket;
use std::path::Path;
use std::process::Command;

/// The client's state, km and km/s.
const STATE: &str = "-4340.768444,848.975278,-5362.534303,5.544406469,-3.022740430,-4.386550226";

/// The emulator of a run file whose keys before `[run]` are `keys`.
fn emulator(here: &Folder, keys: &str, run: &str, flags: &str) -> Process {
    let link = if run.contains("link = ") {
        ""
    } else {
        "link = \"udp://127.0.0.1:0\"\n"
    };
    here.write("run.toml", format!("{keys}\n[run]\n{link}{run}\n"));
    Process::listening(here, &format!("run --config run.toml {flags}"))
}

/// Runs the client at an address.
fn client_at(here: &Folder, address: &str, flags: &str) -> Outcome {
    let mut command = Command::new("python3");
    command
        .arg(repository("examples/client.py"))
        .current_dir(here);
    command
        .args(["--address", address])
        .args(flags.split_whitespace());
    let output = command.output();
    let output = output.expect("python3 runs: apt-get install python3-minimal");
    Outcome::of(&format!("client.py {address} {flags}"), output)
}

/// Runs the client of an emulator.
fn client(here: &Folder, process: &Process, flags: &str) -> Outcome {
    client_at(here, process.address.strip_prefix("udp://").unwrap(), flags)
}

#[test]
#[ignore = "tools: needs python3; tests/run all runs it"]
fn tools_the_client_gets_whole_frames_at_every_output_level() {
    let here = Folder::new();
    for level in ["frame", "compressed", "windows", "labels"] {
        let output = format!("--output {level}");
        let process = emulator(&here, "camera = \"fai-nir\"", "", &output);
        let ended = client(&here, &process, "--frames 2").exits(0).lacks("lost");
        process.end_by("-INT");
        let frames = ended.all().matches(" bits, ").count();
        assert_eq!(frames, 2, "{level}: {}", ended.all());
    }
}

#[test]
#[ignore = "tools: needs python3; tests/run all runs it"]
fn tools_the_client_refuses_wrong_addresses_in_one_line() {
    let here = Folder::new();
    for address in "127.0.0.1 127.0.0.1: 127.0.0.1:x 127.0.0.1:70000 foo.invalid:1".split(' ') {
        let refused = client_at(&here, address, "");
        assert_ne!(refused.code, Some(0), "{}", refused.all());
        refused.logs_lines(1).logs(&[address, "HOST:PORT"]);
    }
    let help = client_at(&here, "127.0.0.1:1", "--help").exits(0);
    help.says(&["HOST:PORT", "127.0.0.1:4810"]);
}

/// Columns, rows and pixels of a PGM picture with two bytes a pixel.
fn pgm(file: &Path) -> (u32, u32, Vec<u16>) {
    let bytes = std::fs::read(file).unwrap();
    let end = bytes.iter().position(|byte| *byte == b'\n').unwrap();
    let head = std::str::from_utf8(&bytes[..end]).unwrap();
    let numbers: Vec<u32> = head
        .split(' ')
        .skip(1)
        .map(|n| n.parse().unwrap())
        .collect();
    let (pairs, rest) = bytes[end + 1..].as_chunks();
    assert!(rest.is_empty());
    let pixels = pairs.iter().map(|pair| u16::from_be_bytes(*pair));
    (numbers[0], numbers[1], pixels.collect())
}

/// Compares with `skyloop render`, which has no link.
#[test]
#[ignore = "tools: needs python3; tests/run all runs it"]
fn tools_the_client_gets_the_frames_of_every_built_in_camera() {
    let here = Folder::new();
    for &camera in CAMERAS {
        let process = emulator(&here, &format!("camera = {camera:?}"), "", "");
        let ended = client(&here, &process, "--out got-").exits(0);
        assert!(ended.out.starts_with("got-00000: "), "{}", ended.all());
        process.end_by("-INT").exits(0);
        let vehicle = format!("--epoch {EPOCH} --attitude={Q} --state={STATE}");
        here.run(&format!(
            "render --camera {camera} {vehicle} --out rendered"
        ))
        .exits(0);
        let rendered = image::open(here.join("rendered/frame_00000.png")).unwrap();
        let rendered = rendered.into_luma16();
        let (width, height, pixels) = pgm(&here.join("got-00000.pgm"));
        assert_eq!((width, height), rendered.dimensions(), "{camera}");
        assert!(pixels == *rendered.as_raw(), "{camera}");
    }
}

#[test]
#[ignore = "tools: needs python3; tests/run all runs it"]
fn tools_the_client_requests_lost_damaged_and_late_frames_again() {
    // Minimum numbers of repeated requests and of damaged packets among 3,900.
    let drop = [("in", "drop", 0.05), ("out", "drop", 0.05)];
    // 1,400 bytes: one packet in 9 to the client is damaged, one in 50 to the emulator.
    let flips = [("in", "bit_flips", 1e-4), ("out", "bit_flips", 1e-5)];
    let late = [
        ("out", "reorder", 0.02),
        ("out", "jitter", 0.05),
        ("out", "truncate", 0.02),
    ];
    for (faults, again, damaged) in [(&drop[..], 20, 0), (&flips, 100, 100), (&late, 1, 20)] {
        let fault = |(direction, kind, value): &(&str, &str, f64)| always(direction, kind, *value);
        let text: String = faults.iter().map(fault).collect();
        let here = Folder::with(&[("faults.toml", &text)]);
        let process = emulator(&here, "camera = \"rigel-l\"", "", "--faults faults.toml");
        let printed = client(&here, &process, "--frames 3").exits(0).all();
        let table = process.end_by("-INT").prints(&["resent_blocks"]).out;
        // The client checks the pixels by the checksum of each frame.
        let frames = printed.matches("1024 x 1024 pixels of 12 bits").count();
        assert_eq!(frames, 3, "{faults:?}: {printed}{table}");
        // Printed each second after a change, and at the end: a frame can follow the last line.
        let mut lines = printed.lines();
        let losses = lines.rfind(|line| line.contains("requested again"));
        let numbers = losses.unwrap_or_default().split(' ');
        let numbers: Vec<i64> = numbers.filter_map(|word| word.parse().ok()).collect();
        let [found_again, found_damaged, _] = numbers[..] else {
            panic!("{printed}");
        };
        // Differences of counters do not wrap: at most the number of packets for each frame.
        assert!((again..20_000).contains(&found_again), "{printed}");
        assert!((damaged..20_000).contains(&found_damaged), "{printed}");
    }
}

/// In each case the client ends the exchange, so the emulator ends without a warning about unread
/// packets.
#[test]
#[ignore = "tools: needs python3; tests/run all runs it"]
fn tools_the_client_ends_with_a_reason_without_frames() {
    for (run, flags, says) in [
        (
            "clock = \"wall\"\noutput = \"labels\"\nlink = \"udp://127.0.0.1:0?rate_mbit=1\"",
            "",
            "whole frames with label text (Output) are refused",
        ),
        (
            "trigger = \"packet\"",
            "--timeout 6",
            "Status gives as the reason (withheld): no Trigger, and run.trigger is packet",
        ),
    ] {
        let here = Folder::new();
        let process = emulator(&here, "camera = \"fai-nir\"", run, "");
        let ended = client(&here, &process, flags).says(&[says]);
        assert_ne!(ended.code, Some(0), "{}", ended.all());
        let ended = process.end_by("-INT").exits(0);
        assert!(!ended.log.contains("has not read"), "{}", ended.log);
        assert!(!ended.out.contains("lost_outbound"), "{}", ended.out);
    }
}

/// The address of a proxy of the emulator at `address`. The client gets the packets that `change`
/// makes of each.
fn proxy(
    address: &str,
    mut change: impl FnMut(Vec<u8>) -> Vec<Vec<u8>> + Send + 'static,
) -> String {
    let near = UdpSocket::bind("127.0.0.1:0").unwrap();
    let far = UdpSocket::bind("127.0.0.1:0").unwrap();
    far.connect(address).unwrap();
    let place = near.local_addr().unwrap().to_string();
    let [client, emulator] = [&near, &far].map(|socket| socket.try_clone().unwrap());
    let (sender, senders) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let mut buffer = [0; MAX_PACKET];
        while let Ok((length, from)) = client.recv_from(&mut buffer) {
            let _ = (sender.send(from), emulator.send(&buffer[..length]));
        }
    });
    std::thread::spawn(move || {
        let client = senders.recv().unwrap();
        let mut buffer = [0; MAX_PACKET];
        while let Ok(length) = far.recv(&mut buffer) {
            for packet in change(buffer[..length].to_vec()) {
                let _ = near.send_to(&packet, client);
            }
        }
    });
    place
}

/// The proxy changes the `pixels_crc32` of each FrameEnd (ICD, section 3.12). After ten of them it
/// forwards nothing.
#[test]
#[ignore = "tools: needs python3; tests/run all runs it"]
fn tools_the_client_ends_if_every_pixel_checksum_is_wrong() {
    let here = Folder::new();
    let process = emulator(&here, "camera = \"fai-nir\"", "", "");
    let mut ends = 0;
    let address = process.address.strip_prefix("udp://").unwrap();
    let address = proxy(address, move |mut packet| {
        if matches!(identify(&packet), Some((FRAME_END, _))) {
            packet[HEADER_LENGTH + 4] ^= 1; // after the number of the frame
            reseal(&mut packet);
            ends += 1;
        }
        if ends < 10 { vec![packet] } else { Vec::new() }
    });
    let ended = client_at(&here, &address, "--timeout 3");
    process.end_by("-INT");
    assert_ne!(ended.code, Some(0), "{}", ended.all());
    ended.says(&["frame 0: ", "CRC-32", "(pixels_crc32), 3 times"]);
    assert!(!here.join("frame-00000.pgm").exists());
}

/// The proxy holds a frame after two blocks of pixels, as slow rendering does, until a Status
/// comes.
#[test]
#[ignore = "tools: needs python3; tests/run all runs it"]
fn tools_the_client_requests_no_packets_before_they_are_sent() {
    let small = [("width_px", "64"), ("height_px", "64")];
    let here = Folder::with(&[("small.toml", &camera("rigel-l", &small))]);
    let process = emulator(&here, "camera = \"small.toml\"", "", "");
    let (mut blocks, mut sent, mut held) = (0, 0_u32, Vec::new());
    let address = process.address.strip_prefix("udp://").unwrap();
    let address = proxy(address, move |mut packet| {
        let apid = identify(&packet).unwrap().0;
        let is_status = apid == STATUS;
        let is_of_frame = [FRAME_HEADER, PIXEL_BLOCK, LABELS, FRAME_END].contains(&apid);
        if blocks == 2 && is_of_frame {
            held.push(packet);
            return Vec::new();
        }
        sent += u32::from(is_of_frame);
        blocks += u32::from(apid == PIXEL_BLOCK);
        if is_status {
            let packets_sent = HEADER_LENGTH + 41; // ICD, section 3.6
            packet[packets_sent..packets_sent + 4].copy_from_slice(&sent.to_be_bytes());
            reseal(&mut packet);
        }
        let mut packets = vec![packet];
        if is_status && blocks == 2 {
            blocks += 1;
            packets.append(&mut held);
        }
        packets
    });
    let ended = client_at(&here, &address, "").exits(0).lacks("lost");
    process.end_by("-INT");
    ended.says(&["64 x 64 pixels"]);
}

/// 24,000 packets a second.
#[test]
#[ignore = "tools: needs python3; tests/run all runs it"]
fn tools_the_client_takes_large_frames_at_four_a_second() {
    let large = [
        ("width_px", "2048"),
        ("height_px", "2048"),
        ("rate_hz", "4.0"),
    ];
    let here = Folder::with(&[("large.toml", &camera("rigel-l", &large))]);
    let keys = "camera = \"large.toml\"\nfidelity = \"fast\"";
    let process = emulator(&here, keys, "clock = \"wall\"", "");
    let printed = client(&here, &process, "--frames 4 --wall 4")
        .exits(0)
        .all();
    process.end_by("-INT");
    let frames = printed.matches("2048 x 2048 pixels").count();
    assert_eq!(frames, 4, "{printed}");
}

#[test]
fn the_guide_has_an_excerpt_of_the_client() {
    let guide = repository_text("docs/how-to/write-a-client.md");
    let mut blocks = guide.split("```python\n").skip(1);
    let (block, rest) = blocks.next().unwrap().split_once("```").unwrap();
    has(&repository_text("examples/client.py"), &[block]);
    assert!(block.lines().count() > 10 && blocks.next().is_none());
    has(rest, &["examples/client.py"]);
}
