//! Replay of recorded runs: equal, or with the first difference named.

use crate::support::client::packet;
use crate::support::line::{Line, UdpLine, is_challenge};
use crate::support::{
    EPOCH, Running, TIMEOUT, attitude, await_that, emulator, fault, later, options, scene,
};
use skyloop::config::{Clock, Config};
use skyloop::link::capture::replay::{Progress, Replay, Same, load};
use skyloop::link::capture::{Capture, Origin};
use skyloop::link::fault::{FaultLog, Plan, wrap};
use skyloop::link::{self, Wire};
use skyloop::serve::Server;
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::sequence::SequenceCounts;
use skyloop_protocols::{
    Command, Counters, Direction, FaultKind, MAX_PACKET, Reason, Reply, Status,
};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;

const BAD_LINE: &str = r#"
seed = 11
faults = [
    { direction = "in", kind = "drop", value = 0.05 },
    { direction = "in", kind = "bit_flips", value = 2e-4 },
    { direction = "in", kind = "reorder", value = 0.05 },
    { direction = "in", kind = "duplicate", value = 0.05 },
    { direction = "out", kind = "drop", value = 0.05 },
    { direction = "out", kind = "bit_flips", value = 1e-5 },
    { direction = "out", kind = "jitter", value = 0.002 },
]
"#;

const ATTITUDES: u32 = 40;

/// The built-in scene on a detector of 64 x 64 pixels.
pub fn small() -> Config {
    let mut config = scene();
    (config.camera.detector.width, config.camera.detector.height) = (64, 64);
    config
}

/// Records the traffic of these links in `file`, under these names.
fn recorder<'w>(
    file: &Path,
    names: &[String],
    wires: impl IntoIterator<Item = &'w mut Wire>,
) -> Capture {
    let mut capture = Capture::packets(file, false, names).unwrap();
    capture.begin(&Origin::default()).unwrap();
    for (number, wire) in (0..).zip(wires) {
        capture.tap(wire, number);
    }
    capture
}

/// An emulator at a UDP port with the faults of `plan`, if any, recorded in `file`; and a client's
/// end.
fn recorded(
    file: &Path,
    plan: Option<(&Plan, &Arc<Mutex<FaultLog>>)>,
) -> (Running, UdpLine, Capture) {
    let mut wire = link::open("udp://127.0.0.1:0", &options(5.0)).unwrap();
    let line = UdpLine::to(&wire.address);
    if let Some((plan, book)) = plan {
        wire = wrap(wire, plan, &NATIVE, book).unwrap();
    }
    let capture = recorder(file, &[wire.address.clone()], [&mut wire]);
    (Running::start(small(), Clock::Stepped, wire), line, capture)
}

/// The same at two ports, one for truth and labels, one for pixels.
fn two_recorded(file: &Path) -> (Running, [UdpLine; 2], Capture) {
    let urls = ["truth+labels", "pixels"].map(|roles| format!("udp://127.0.0.1:0?roles={roles}"));
    let mut links = link::open_all(&urls, &options(5.0)).unwrap();
    let lines = [0, 1].map(|at: usize| UdpLine::to(&links[at].0.address));
    let capture = recorder(file, &urls, links.iter_mut().map(|(wire, _)| wire));
    let emulator = Running::at(small(), Clock::Stepped, links);
    (emulator, lines, capture)
}

/// Records a run over a bad line in `file`. Returns its counters and the number of faults.
fn record(file: &Path) -> (Counters, u64) {
    let plan = Plan::parse("faults.toml", BAD_LINE, false).unwrap();
    let book = Arc::new(Mutex::new(FaultLog::default()));
    let (emulator, mut line, capture) = recorded(file, Some((&plan, &book)));
    let mut counts = SequenceCounts::new();
    let mut send = |line: &mut UdpLine, command: Command, time| {
        line.send(&packet(&command, counts.next(command.apid()), time));
    };
    let mut delivered = 0;
    for i in 0..ATTITUDES {
        let time = later(EPOCH, f64::from(i) / 10.0);
        // Lost grants are repeated.
        send(&mut line, Command::Credit { packets: 1_000_000 }, time);
        if i == 20 {
            send(&mut line, Command::Exposure { seconds: 0.05 }, time);
        }
        if i == 30 {
            send(&mut line, Command::Ping, time);
        }
        send(&mut line, Command::Attitude(attitude(i)), time);
        // Sometimes the client does not wait for frames.
        if i % 8 < 5 {
            let quiet = Duration::from_millis(30);
            while let Some(packet) = line.recv(quiet) {
                let header = Reply::decode(&packet);
                delivered += u32::from(matches!(header, Ok((_, Reply::FrameHeader(_)))));
            }
        }
    }
    await_that("all attitudes have their frames", || {
        send(&mut line, Command::Ping, later(EPOCH, 10.0));
        let mut are_over = false;
        while let Some(packet) = line.recv(Duration::from_millis(100)) {
            if let Ok((_, Reply::Status(Status { counters, .. }))) = Reply::decode(&packet) {
                let over = counters.frames_delivered + counters.frames_abandoned;
                are_over = over == counters.attitudes;
            }
        }
        are_over
    });
    let counters = emulator.end();
    assert!(delivered > 0);
    let written = capture.finish().unwrap();
    assert!(written > u64::from(counters.frames_delivered));
    let injected = book.lock().unwrap().total();
    (counters, injected)
}

/// Replays a recording with this configuration.
pub fn replay(file: &Path, mut config: Config) -> Progress {
    let (links, replay) = Replay::of(load(file, &NATIVE).unwrap(), &NATIVE);
    let output = config.run.output;
    let emulator = emulator(&mut config);
    let mut server = Server::new(emulator, links, output, Clock::Stepped, &NATIVE);
    std::thread::scope(|scope| {
        let serving = scope.spawn(|| server.run(replay.over(), None, |_| {}));
        while !serving.is_finished() {
            std::thread::sleep(Duration::from_millis(1));
            if replay.still() > TIMEOUT {
                replay.give_up();
            }
        }
        assert_ne!(serving.join().unwrap(), skyloop::serve::Ended::Panicked);
    });
    replay.progress()
}

/// Requires a replay equal to its recording.
#[track_caller]
fn assert_same(file: &Path) -> Progress {
    let same = replay(file, small());
    assert_eq!(same.difference, None);
    same
}

/// Changes one byte in the first packet that `choose` selects, and requires these words in the
/// reported difference.
#[track_caller]
fn assert_differs(file: &Path, words: &[&str], choose: impl Fn(&Reply<'_>) -> Option<usize>) {
    let mut bytes = std::fs::read(file).unwrap();
    let events = load(file, &NATIVE).unwrap().events;
    let chosen = events.iter().find_map(|event| {
        let (_, reply) = Reply::decode(&event.item).ok()?;
        Some((event.item.clone(), choose(&reply)?))
    });
    let (packet, byte) = chosen.expect("there is such a packet");
    let mut windows = bytes.windows(packet.len());
    let at = windows.position(|window| window == &packet[..]).unwrap();
    bytes[at + byte] ^= 1;
    let corrupted = file.with_file_name("corrupted.pcapng");
    std::fs::write(&corrupted, bytes).unwrap();
    assert_words(&replay(&corrupted, small()).difference.unwrap(), words);
}

#[track_caller]
fn assert_words(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "no {word:?} in {text}");
    }
}

#[test]
fn runs_over_a_bad_line_are_replayed_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.pcapng");
    let (counters, injected) = record(&file);
    assert!(injected > 50, "{injected}");
    assert!(
        counters.bad_crc > 0 && counters.sequence_gaps > 0,
        "{counters:?}"
    );
    assert!(counters.frames_delivered > ATTITUDES / 2, "{counters:?}");
    let same = assert_same(&file);
    let whole = same.frames.iter().filter(|frame| frame.whole).count();
    assert_eq!(whole as u32, counters.frames_delivered);
    println!(
        "{injected} faults, {whole} frames, {} packets the same",
        same.packets
    );
    // Hashes distinguish frames and are reproducible.
    assert_eq!(replay(&file, small()).frames, same.frames);
    let hashes: BTreeSet<u32> = same.frames.iter().map(|frame| frame.crc32).collect();
    assert_eq!(hashes.len(), same.frames.len());

    // Another seed: named by field and both values.
    let mut other = small();
    other.seed += 1;
    let difference = replay(&file, other).difference.unwrap();
    assert_words(
        &difference,
        &["FrameHeader of frame 0", "seed: recorded 1, replayed 2"],
    );
    // A pixel of the third block, whose bytes start after 15 of header and 15 of layout.
    let words = [
        "PixelBlock 1 of frame 3",
        "pixel (column ",
        "recorded ",
        "replayed ",
    ];
    assert_differs(&file, &words, |reply| match reply {
        Reply::PixelBlock(block) if block.frame == 3 && block.index == 1 => Some(15 + 15 + 201),
        _ => None,
    });
    let words = ["Labels 4 of frame 2: text from its byte 40"];
    assert_differs(&file, &words, |reply| match reply {
        Reply::Labels(part) if part.frame == 2 && part.part == 4 => Some(15 + 8 + 40),
        _ => None,
    });
}

fn send_all(line: &mut UdpLine, commands: &[Command]) {
    for (count, command) in (0..).zip(commands) {
        line.send(&packet(command, count, EPOCH));
    }
}

/// Returns the Challenge, because no frame is sent before.
fn return_challenge(line: &mut UdpLine) {
    line.0.set_read_timeout(Some(TIMEOUT)).unwrap();
    let mut buffer = [0; MAX_PACKET];
    let length = line.0.recv(&mut buffer).expect("a Challenge");
    assert!(is_challenge(&buffer[..length]));
    line.send(&buffer[..length]);
}

#[test]
fn several_links_are_replayed_together() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.pcapng");
    let (emulator, mut lines, capture) = two_recorded(&file);
    let grant = Command::Credit { packets: 100_000 };
    send_all(&mut lines[1], &[grant, Command::Ping]);
    assert!(lines[1].recv(TIMEOUT).is_some(), "the Ping's Ack");
    send_all(&mut lines[0], &[grant]);
    return_challenge(&mut lines[0]);
    for i in 0..3 {
        send_all(&mut lines[0], &[Command::Attitude(attitude(i))]);
        emulator.exposed();
    }
    for line in &mut lines {
        while line.recv(Duration::from_millis(200)).is_some() {}
    }
    assert_eq!(emulator.end().frames_delivered, 3);
    capture.finish().unwrap();
    // A frame's pixels went over one link, its labels over the other.
    let frames = assert_same(&file).frames;
    let has = |number, link| {
        let is_it = |frame: &Same| (frame.frame, frame.link, frame.whole) == (number, link, true);
        frames.iter().any(is_it)
    };
    assert!((0..3).all(|i| has(i, 0) && has(i, 1)), "{frames:?}");
}

/// Sends a command and returns the reason of its refusal, if any.
fn refused(line: &mut UdpLine, count: u16, command: &Command) -> Option<(Reason, String)> {
    line.send(&packet(command, count, EPOCH));
    let packet = line.recv(TIMEOUT).expect("an answer");
    match Reply::decode(&packet).unwrap().1 {
        Reply::Nack(nack) => Some((nack.reason, nack.detail.to_string())),
        Reply::Ack(_) => None,
        other => panic!("{other:?}"),
    }
}

/// Bus-off is refused on UDP, and a delay without fault injection. Acks follow.
#[test]
fn refused_faults_are_refused_in_the_replay() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, book) = (Plan::default(), Arc::default());
    for injected in [false, true] {
        let file = folder.path().join(format!("{injected}.pcapng"));
        let faults = injected.then_some((&plan, &book));
        let (emulator, mut line, capture) = recorded(&file, faults);
        let fault = |kind| fault(kind, Direction::Out, 0.0, 0.0);
        let delay = refused(&mut line, 0, &fault(FaultKind::Delay));
        assert_eq!(delay.is_some(), !injected, "{delay:?}");
        let off = refused(&mut line, 1, &fault(FaultKind::BusOff)).unwrap();
        assert_eq!(off.0, Reason::NotSupported);
        assert_eq!(off.1.contains("use down"), injected, "{off:?}");
        let exposure = Command::Exposure { seconds: 0.05 };
        assert_eq!(refused(&mut line, 2, &exposure), None);
        emulator.end();
        capture.finish().unwrap();
        assert_eq!(assert_same(&file).packets, 3);
    }
}

/// The reply names the truth link, which has another address in a replay.
#[test]
fn addresses_in_refusals_are_not_compared() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.pcapng");
    let (emulator, [_, mut line], capture) = two_recorded(&file);
    let (reason, detail) = refused(&mut line, 0, &Command::SingleShot).unwrap();
    assert_eq!(reason, Reason::NotSupported);
    assert!(detail.contains("send them over udp://"), "{detail}");
    assert_eq!(refused(&mut line, 1, &Command::Reset), None);
    emulator.end();
    capture.finish().unwrap();
    assert_eq!(assert_same(&file).packets, 2);
    // Other fields are compared: the sequence count, the text.
    for (byte, words) in [(15 + 3, "sequence_count"), (15 + 8, "detail")] {
        assert_differs(&file, &[words], |reply| {
            matches!(reply, Reply::Nack(_)).then_some(byte)
        });
    }
}

/// The client takes 5 packets of a frame; after 2 s the frame is abandoned. Another one follows.
#[test]
fn abandoned_frames_are_abandoned_in_the_replay() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.pcapng");
    let (emulator, mut line, capture) = recorded(&file, None);
    send_all(&mut line, &[Command::Credit { packets: 5 }]);
    return_challenge(&mut line);
    send_all(&mut line, &[Command::Attitude(attitude(0))]);
    emulator.exposed();
    send_all(&mut line, &[Command::Credit { packets: 50_000 }]);
    send_all(&mut line, &[Command::Attitude(attitude(1))]);
    emulator.exposed();
    while line.recv(Duration::from_millis(200)).is_some() {}
    emulator.ends_with(&[("frames_abandoned", 1), ("frames_delivered", 1)]);
    capture.finish().unwrap();
    let same = assert_same(&file);
    let frames = same.frames.iter().map(|frame| (frame.frame, frame.whole));
    assert_eq!(frames.collect::<Vec<_>>(), [(0, false), (1, true)]);
    // An unexplained sequence count is named; the fourth byte of the header is its last byte.
    let words = ["PixelBlock 0 of frame 1", "header octet 3"];
    assert_differs(&file, &words, |reply| match reply {
        Reply::PixelBlock(block) if block.frame == 1 && block.index == 0 => Some(3),
        _ => None,
    });
}
