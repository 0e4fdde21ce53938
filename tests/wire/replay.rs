//! A recorded run is fed to an emulator again: the same, or the first difference named.

use crate::support::client::packet;
use crate::support::line::{Line, UdpLine, is_challenge};
use crate::support::{EPOCH, Running, TIMEOUT, attitude, fault, later, options, scene};
use skyloop::config::{Clock, Config};
use skyloop::engine::Emulator;
use skyloop::link::capture::replay::{Progress, Replay, Same, load};
use skyloop::link::capture::{Capture, Origin};
use skyloop::link::fault::{Book, Plan, wrap};
use skyloop::link::{self, Wire};
use skyloop::serve::Server;
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::sequence::SequenceCounts;
use skyloop_protocols::{Command, Counters, Direction, FaultKind, MAX_PACKET, Reason, Reply};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Everything that a bad line does, both ways.
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

/// Attitudes that the client sends.
const ATTITUDES: u32 = 40;

/// The built-in scene on a detector of 64 x 64 pixels.
pub fn small() -> Config {
    let mut config = scene();
    (config.camera.detector.width, config.camera.detector.height) = (64, 64);
    config
}

/// Records in `file` what passes these links, which have these names.
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

/// An emulator at a UDP port with the faults of `plan`, if any, which is recorded in `file`; a
/// client's end.
fn recorded(file: &Path, plan: Option<(&Plan, &Arc<Mutex<Book>>)>) -> (Running, UdpLine, Capture) {
    let mut wire = link::open("udp://127.0.0.1:0", &options(5.0)).unwrap();
    let line = UdpLine::to(&wire.address);
    if let Some((plan, book)) = plan {
        wire = wrap(wire, plan, &NATIVE, book).unwrap();
    }
    let capture = recorder(file, &[wire.address.clone()], [&mut wire]);
    (Running::start(small(), Clock::Stepped, wire), line, capture)
}

/// Likewise at two ports, one for truth and labels, one for pixels.
fn two_recorded(file: &Path) -> (Running, [UdpLine; 2], Capture) {
    let urls = ["truth+labels", "pixels"].map(|roles| format!("udp://127.0.0.1:0?roles={roles}"));
    let mut links = link::open_all(&urls, &options(5.0)).unwrap();
    let lines = [0, 1].map(|at: usize| UdpLine::to(&links[at].0.address));
    let capture = recorder(file, &urls, links.iter_mut().map(|(wire, _)| wire));
    let emulator = Running::at(small(), Clock::Stepped, links);
    (emulator, lines, capture)
}

/// A run over a bad line, recorded in `file`: its counters, and what the line did.
fn record(file: &Path) -> (Counters, u64) {
    let plan = Plan::parse("faults.toml", BAD_LINE, false).unwrap();
    let book = Arc::new(Mutex::new(Book::default()));
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
        // Now and then the client runs ahead.
        if i % 8 < 5 {
            let quiet = Duration::from_millis(30);
            while let Some(packet) = line.recv(quiet) {
                let header = Reply::decode(&packet);
                delivered += u32::from(matches!(header, Ok((_, Reply::FrameHeader(_)))));
            }
        }
    }
    while line.recv(Duration::from_millis(500)).is_some() {}
    let counters = emulator.end();
    assert!(delivered > 0);
    let written = capture.finish().unwrap();
    assert!(written > u64::from(counters.frames_delivered));
    let injected = book.lock().unwrap().total();
    (counters, injected)
}

/// What comes of a recording with this configuration.
pub fn replay(file: &Path, mut config: Config) -> Progress {
    let (links, replay) = Replay::of(load(file, &NATIVE).unwrap(), &NATIVE);
    let output = config.run.output;
    let emulator = Emulator::new(&mut config);
    let mut server = Server::new(emulator, links, output, Clock::Stepped, &NATIVE);
    let started = Instant::now();
    std::thread::scope(|scope| {
        let serving = scope.spawn(|| server.run(replay.over(), None, |_| {}));
        while !serving.is_finished() {
            std::thread::sleep(Duration::from_millis(1));
            if started.elapsed() > TIMEOUT {
                replay.give_up();
            }
        }
        assert_ne!(serving.join().unwrap(), skyloop::serve::Ended::Panicked);
    });
    replay.progress()
}

/// A recording comes again as it was; so many packets, and its frames.
#[track_caller]
fn is_same(file: &Path) -> Progress {
    let same = replay(file, small());
    assert_eq!(same.difference, None);
    same
}

/// A recording of which the first packet that `choose` takes is altered, by the octet that it says,
/// differs in these words.
#[track_caller]
fn differs(file: &Path, says: &[&str], choose: impl Fn(&Reply<'_>) -> Option<usize>) {
    let mut bytes = std::fs::read(file).unwrap();
    let events = load(file, &NATIVE).unwrap().events;
    let place = events.iter().find_map(|event| {
        let (_, reply) = Reply::decode(&event.item).ok()?;
        Some((event.item.clone(), choose(&reply)?))
    });
    let (packet, byte) = place.expect("there is such a packet");
    let mut windows = bytes.windows(packet.len());
    let at = windows.position(|window| window == &packet[..]).unwrap();
    bytes[at + byte] ^= 1;
    let corrupted = file.with_file_name("spoilt.pcapng");
    std::fs::write(&corrupted, bytes).unwrap();
    has(&replay(&corrupted, small()).difference.unwrap(), says);
}

#[track_caller]
fn has(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "no {word:?} in {text}");
    }
}

#[test]
fn a_run_over_a_bad_line_comes_again_octet_for_octet() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.pcapng");
    let (counters, injected) = record(&file);
    assert!(injected > 50, "{injected}");
    assert!(
        counters.bad_crc > 0 && counters.sequence_gaps > 0,
        "{counters:?}"
    );
    assert!(counters.frames_delivered > ATTITUDES / 2, "{counters:?}");
    let same = is_same(&file);
    let whole = same.frames.iter().filter(|frame| frame.whole).count();
    assert_eq!(whole as u32, counters.frames_delivered);
    println!(
        "{injected} faults, {whole} frames, {} packets the same",
        same.packets
    );
    // The hashes tell frames apart and repeat.
    assert_eq!(replay(&file, small()).frames, same.frames);
    let hashes: BTreeSet<u32> = same.frames.iter().map(|frame| frame.crc32).collect();
    assert_eq!(hashes.len(), same.frames.len());

    // Another seed: named by field and both values.
    let mut other = small();
    other.seed += 1;
    let difference = replay(&file, other).difference.unwrap();
    has(
        &difference,
        &["FrameHeader of frame 0", "seed: recorded 1, replayed 2"],
    );
    // A pixel: of the third block, whose octets start after 15 of header and 15 of layout.
    let says = [
        "PixelBlock 1 of frame 3",
        "pixel (column ",
        "recorded ",
        "replayed ",
    ];
    differs(&file, &says, |reply| match reply {
        Reply::PixelBlock(block) if block.frame == 3 && block.index == 1 => Some(15 + 15 + 201),
        _ => None,
    });
    let says = ["Labels 4 of frame 2: text from its byte 40"];
    differs(&file, &says, |reply| match reply {
        Reply::Labels(part) if part.frame == 2 && part.part == 4 => Some(15 + 8 + 40),
        _ => None,
    });
}

/// What a client has to say before anything comes over its link.
fn says(line: &mut UdpLine, commands: &[Command]) {
    for (count, command) in (0..).zip(commands) {
        line.send(&packet(command, count, EPOCH));
    }
}

/// Takes the Challenge and sends it back: no frame is sent before.
fn return_challenge(line: &mut UdpLine) {
    line.0.set_read_timeout(Some(TIMEOUT)).unwrap();
    let mut buffer = [0; MAX_PACKET];
    let length = line.0.recv(&mut buffer).expect("a Challenge comes");
    assert!(is_challenge(&buffer[..length]));
    line.send(&buffer[..length]);
}

#[test]
fn several_links_are_replayed_together() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.pcapng");
    let (emulator, mut lines, capture) = two_recorded(&file);
    let grant = Command::Credit { packets: 100_000 };
    says(&mut lines[1], &[grant, Command::Ping]);
    assert!(lines[1].recv(TIMEOUT).is_some(), "the Ping's Ack");
    says(&mut lines[0], &[grant]);
    return_challenge(&mut lines[0]);
    for i in 0..3 {
        says(&mut lines[0], &[Command::Attitude(attitude(i))]);
        emulator.exposed();
    }
    for line in &mut lines {
        while line.recv(Duration::from_millis(200)).is_some() {}
    }
    assert_eq!(emulator.end().frames_delivered, 3);
    capture.finish().unwrap();
    // A frame's pixels went over one link, its labels over the other.
    let frames = is_same(&file).frames;
    let has = |number, link| {
        let is_it = |frame: &Same| (frame.frame, frame.link, frame.whole) == (number, link, true);
        frames.iter().any(is_it)
    };
    assert!((0..3).all(|i| has(i, 0) && has(i, 1)), "{frames:?}");
}

/// Sends a command and awaits the reason of its refusal; none if it is obeyed.
fn refused(line: &mut UdpLine, count: u16, command: &Command) -> Option<(Reason, String)> {
    line.send(&packet(command, count, EPOCH));
    let packet = line.recv(TIMEOUT).expect("an answer");
    match Reply::decode(&packet).unwrap().1 {
        Reply::Nack(nack) => Some((nack.reason, nack.detail.to_string())),
        Reply::Ack(_) => None,
        other => panic!("{other:?}"),
    }
}

/// Bus-off is refused on UDP, and a delay where no faults are injected. Acks follow.
#[test]
fn refused_faults_are_refused_again() {
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
        assert_eq!(is_same(&file).packets, 3);
    }
}

/// The answer names the link of the truth, which has another address in a replay.
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
    assert_eq!(is_same(&file).packets, 2);
    // All else is: what it answers, its words.
    for (byte, says) in [(15 + 3, "sequence_count"), (15 + 8, "detail")] {
        differs(&file, &[says], |reply| {
            matches!(reply, Reply::Nack(_)).then_some(byte)
        });
    }
}

/// The client takes 5 packets of a frame and stands still; 2 s later the frame is given up. Another one
/// follows.
#[test]
fn a_frame_that_was_given_up_is_given_up_again() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.pcapng");
    let (emulator, mut line, capture) = recorded(&file, None);
    says(&mut line, &[Command::Credit { packets: 5 }]);
    return_challenge(&mut line);
    says(&mut line, &[Command::Attitude(attitude(0))]);
    emulator.exposed();
    says(&mut line, &[Command::Credit { packets: 50_000 }]);
    says(&mut line, &[Command::Attitude(attitude(1))]);
    emulator.exposed();
    while line.recv(Duration::from_millis(200)).is_some() {}
    emulator.ends_with(&[("frames_abandoned", 1), ("frames_delivered", 1)]);
    capture.finish().unwrap();
    let same = is_same(&file);
    let frames = same.frames.iter().map(|frame| (frame.frame, frame.whole));
    assert_eq!(frames.collect::<Vec<_>>(), [(0, false), (1, true)]);
    // A sequence count that nothing explains is named: of the header, whose last octet of the count is
    // the fourth.
    let says = ["PixelBlock 0 of frame 1", "header octet 3"];
    differs(&file, &says, |reply| match reply {
        Reply::PixelBlock(block) if block.frame == 1 && block.index == 0 => Some(3),
        _ => None,
    });
}
