//! Recovery of lost and reordered packets: requested again until every frame is complete.

use std::ops::ControlFlow;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::common::emulator::Emulator;
use crate::common::loops::{by_wall, computer, mission, over_memory, over_udp, within};
use crate::common::lossy::Lossy;
use crate::common::slow::Slow;
use crate::common::{Field, Noise};
use skyloop_firmware_sim::event::Event;
use skyloop_firmware_sim::mission::Mission;
use skyloop_firmware_sim::port::{Port, PortError};
use skyloop_firmware_sim::report::Report;
use skyloop_firmware_sim::udp::UdpPort;
use skyloop_protocols::packet::identify;
use skyloop_protocols::{LabelLevel, Output, PixelLevel, apid};

fn run(
    (port, thread): (impl Port + Send + 'static, JoinHandle<Emulator>),
    mission: Mission,
) -> (Report, Emulator) {
    let report = crate::common::loops::run_and_print(computer(port, mission));
    (report.unwrap(), thread.join().unwrap())
}

const SMALL: Field = Field {
    width: 128,
    height: 96,
    ..Field::USUAL
};

/// Runs over a link that loses and swaps packets.
fn lossy_run(output: Output, frames: u32, field: Field, seed: u64) -> (Report, Emulator) {
    let mut emulator = Emulator::new(|_, _| {});
    emulator.field = field;
    let (port, thread) = over_memory(emulator);
    let mission = Mission {
        output: Some(output),
        ..mission(frames)
    };
    let port = Lossy::new(port, seed, [0.05, 0.05, 0.0]);
    run((port, thread), mission)
}

#[test]
fn every_frame_is_complete_at_every_level() {
    // The largest frame has some 140 blocks and the labels; the window is 64.
    let large = Field {
        width: 512,
        height: 256,
        ..SMALL
    };
    for (seed, frames, field, pixels, labels) in [
        (1, 30, SMALL, PixelLevel::Frame, LabelLevel::Text),
        (2, 30, SMALL, PixelLevel::Compressed, LabelLevel::Text),
        (3, 30, SMALL, PixelLevel::Windows, LabelLevel::Objects),
        (4, 30, SMALL, PixelLevel::None, LabelLevel::Objects),
        (9, 6, large, PixelLevel::Frame, LabelLevel::Text),
    ] {
        let output = Output {
            pixels,
            labels,
            ..Output::default()
        };
        let (report, emulator) = lossy_run(output, frames, field, seed);
        assert_eq!((report.frames, report.lost), (frames, 0), "{output:?}");
        let (recovered, resent) = (report.assembly.recovered, emulator.resent as u64);
        let fits = match frames {
            6 => recovered > 20,
            _ => (1..=resent).contains(&recovered),
        };
        assert!(fits, "{output:?}: {recovered} of {resent}");
        assert_eq!(report.totals.missed, 0);
    }
}

#[test]
fn any_single_lost_packet_is_recovered() {
    // Header, a block, end, first block, last label part: each lost in one frame.
    let emulator = Emulator::new(|attitude, packets| {
        let end = packets.len() - 1;
        if let Some(index) = [0, 3, end, 1, end - 1].get(attitude as usize) {
            packets.remove(*index);
        }
    });
    let begin = Instant::now();
    let (report, emulator) = run(over_memory(emulator), mission(6));
    assert_eq!((report.frames, report.lost), (6, 0));
    // On a busy machine some requests are superfluous.
    assert!(report.assembly.recovered >= 5);
    assert!((5..40).contains(&emulator.resent));
    assert!(begin.elapsed() < mission(6).timeout, "before the time-out");
}

#[test]
fn attitudes_without_a_reply_are_repeated_unchanged() {
    // The frame of the first copy is lost, or arrives with the second's as a duplicate.
    for dropped in [true, false] {
        let mut emulator = Emulator::new(|_, _| {});
        let first: fn(usize, u32) -> bool = |copy, attitude| attitude == 3 && copy == 0;
        if dropped {
            emulator.drops = first;
        } else {
            emulator.delays = first;
        }
        let (report, Emulator { attitudes, .. }) = run(over_memory(emulator), mission(6));
        assert_eq!((report.frames, report.lost, report.late), (6, 0, 0));
        assert!(dropped || report.recovery.duplicates >= 1);
        assert_eq!(report.recovery.attitudes as usize, attitudes.len() - 6);
        let mut copies = attitudes.iter().filter(|(_, copy)| copy.sequence == 3);
        let (first, again) = (copies.next().unwrap(), copies.next().unwrap());
        assert_eq!((first.0.time, first.1), (again.0.time, again.1));
        assert_ne!(first.0.sequence_count, again.0.sequence_count);
    }
}

#[test]
fn emulators_without_resend_get_one_request() {
    let mut emulator = Emulator::new(|attitude, packets| {
        if attitude < 3 {
            packets.remove(2);
        }
    });
    emulator.resends = false;
    let (report, _) = run(over_memory(emulator), within(Duration::from_secs(1), 4));
    assert_eq!((report.frames, report.lost), (1, 3));
    assert!((1..4).contains(&report.recovery.requested), "{report}");
    assert_eq!(report.nack_count, 0, "a late request counts as no refusal");
}

#[test]
fn wall_clock_frames_are_recovered_while_others_arrive() {
    let (port, thread) = over_memory(Emulator::new(|_, _| {}));
    let port = Lossy::new(port, 4, [0.03, 0.05, 0.0]);
    let (report, _) = run((port, thread), by_wall(10.0, 40));
    // Lost attitudes and entirely lost frames are not recovered.
    assert!(report.frames >= 34, "{report}");
    assert!(report.assembly.recovered > 10, "{report}");
}

#[test]
fn truncated_udp_packets_are_recovered_both_ways() {
    let recovers = |seed| {
        let mut emulator = Emulator::new(|_, _| {});
        emulator.expects_damage = true;
        let (address, thread) = over_udp(emulator, Duration::from_secs(3));
        let port = UdpPort::connect(address).unwrap();
        let seed = Noise::new(seed).bits();
        let port = Lossy::new(port, seed, [0.0, 0.0, 0.1]);
        let (report, emulator) = run((port, thread), mission(40));
        assert_eq!((report.frames, report.lost, report.refused), (40, 0, 0));
        let damaged = report.recovery.damaged;
        assert!(damaged > 0 && damaged <= emulator.damaged, "{report}");
        assert_eq!(report.nack_count, 0, "damage is no refusal");
    };
    // Most of the time is waiting.
    std::thread::scope(|scope| {
        for seed in 70..73 {
            scope.spawn(move || recovers(seed));
        }
    });
}

/// A line of 9600 baud, or one that damages every attitude sent.
struct Line<P> {
    port: P,
    damages: bool,
}

impl<P: Port> Port for Line<P> {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        let mut packet = packet.to_vec();
        let is_attitude = identify(&packet).is_some_and(|(apid, _)| apid == apid::ATTITUDE);
        if is_attitude && self.damages {
            packet[20] ^= 1;
        }
        self.port.send(&packet)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        self.port.recv(timeout)
    }

    fn airtime(&self, bytes: usize) -> Duration {
        if self.damages {
            Duration::ZERO
        } else {
            Duration::from_secs(bytes as u64) * 10 / 9600
        }
    }
}

#[test]
fn attitudes_damaged_every_time_count_as_refused() {
    let mut emulator = Emulator::new(|_, _| {});
    emulator.expects_damage = true;
    let (port, thread) = over_memory(emulator);
    let damages = true;
    let (report, emulator) = run((Line { port, damages }, thread), mission(2));
    assert_eq!((report.frames, report.lost, report.refused), (0, 0, 2));
    assert!((4..100).contains(&emulator.damaged), "{}", emulator.damaged);
    assert!(report.nacks[0].detail.contains("damaged"), "{report}");
}

#[test]
fn interruptions_of_the_line_are_no_loss() {
    // 0.5 s for a frame, with an interruption of 0.4 s at its beginning, middle and end.
    for before in [10, 40, 70] {
        let mut emulator = Emulator::new(|_, _| {});
        emulator.field = Field::USUAL;
        let (port, thread) = over_memory(emulator);
        let interruption = (before, Duration::from_millis(400));
        let port = Slow::new(port, Duration::from_millis(6), interruption);
        let (report, emulator) = run((port, thread), mission(2));
        assert_eq!((report.frames, report.lost), (2, 0));
        let recovery = (emulator.resent, report.recovery.requested);
        assert_eq!(recovery, (0, 0), "{before}");
        assert_eq!(report.missing_packets, 0);
    }
}

#[test]
fn losses_on_slow_lines_name_the_cause() {
    let windows = Output {
        pixels: PixelLevel::Windows,
        labels: LabelLevel::Objects,
        ..Output::default()
    };
    let longer = "choose --output windows or labels, or a longer --timeout";
    for (output, remedy) in [
        (Output::default(), longer),
        (windows, "choose fewer --windows and --objects"),
    ] {
        let mut emulator = Emulator::new(|_, packets| packets.truncate(3));
        emulator.resends = false;
        let (port, thread) = over_memory(emulator);
        let short = Mission {
            output: Some(output),
            ..within(Duration::from_millis(300), 1)
        };
        let mut lost = Vec::new();
        let damages = false;
        let flown = computer(Line { port, damages }, short).run(|event| {
            if let Event::Lost { loss, .. } = event {
                lost.push(loss.to_string());
            }
            ControlFlow::Continue(())
        });
        flown.unwrap();
        thread.join().unwrap();
        let slow = lost[0].contains("on this line, and the time-out is 0.3 s");
        assert!(slow && lost[0].contains(remedy), "{lost:?}");
    }
}
