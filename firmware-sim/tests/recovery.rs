//! Packets lost and reordered on the way: asked for again until every frame is whole.

use std::ops::ControlFlow;
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

fn fly(port: impl Port + Send + 'static, mission: Mission) -> Report {
    crate::common::loops::fly(computer(port, mission)).unwrap()
}

const SMALL: Field = Field {
    width: 128,
    height: 96,
    ..Field::USUAL
};

/// Flies over a link that loses and swaps packets.
fn lossy_flight(output: Output, frames: u32, field: Field, seed: u64) -> (Report, Emulator) {
    let mut emulator = Emulator::new(|_, _| {});
    emulator.field = field;
    let (port, thread) = over_memory(emulator);
    let mission = Mission {
        output: Some(output),
        ..mission(frames)
    };
    let report = fly(Lossy::new(port, seed, [0.05, 0.05, 0.0]), mission);
    (report, thread.join().unwrap())
}

#[test]
fn every_frame_comes_whole_at_every_level() {
    // Of the largest some 140 blocks and the labels; the window is 64.
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
        let (report, emulator) = lossy_flight(output, frames, field, seed);
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
fn every_packet_of_a_frame_can_be_lost_alone() {
    // The header, a block, the end, the first block, the last label part: each of them once.
    let emulator = Emulator::new(|attitude, packets| {
        let end = packets.len() - 1;
        if let Some(place) = [0, 3, end, 1, end - 1].get(attitude as usize) {
            packets.remove(*place);
        }
    });
    let (port, thread) = over_memory(emulator);
    let begin = Instant::now();
    let report = fly(port, mission(6));
    assert_eq!((report.frames, report.lost), (6, 0));
    // On a busy machine some are asked for in vain.
    assert!(report.assembly.recovered >= 5);
    assert!((5..40).contains(&thread.join().unwrap().resent));
    assert!(begin.elapsed() < mission(6).timeout, "before the time-out");
}

#[test]
fn an_attitude_of_which_nothing_comes_is_sent_again_as_it_was() {
    // The frame of the first copy vanishes, or comes with the second's: a duplicate then, and no harm.
    for swallowed in [true, false] {
        let mut emulator = Emulator::new(|_, _| {});
        let first: fn(usize, u32) -> bool = |copy, attitude| attitude == 3 && copy == 0;
        if swallowed {
            emulator.swallows = first
        } else {
            emulator.delays = first
        }
        let (port, thread) = over_memory(emulator);
        let report = fly(port, mission(6));
        let attitudes = thread.join().unwrap().attitudes;
        assert_eq!((report.frames, report.lost, report.late), (6, 0, 0));
        assert!(swallowed || report.recovery.duplicates >= 1);
        assert_eq!(report.recovery.attitudes as usize, attitudes.len() - 6);
        let mut copies = attitudes.iter().filter(|(_, copy)| copy.sequence == 3);
        let (first, again) = (copies.next().unwrap(), copies.next().unwrap());
        assert_eq!((first.0.time, first.1), (again.0.time, again.1));
        assert_ne!(first.0.sequence_count, again.0.sequence_count);
    }
}

#[test]
fn an_emulator_without_resend_is_asked_once() {
    let mut emulator = Emulator::new(|attitude, packets| {
        if attitude < 3 {
            packets.remove(2);
        }
    });
    emulator.resends = false;
    let (port, thread) = over_memory(emulator);
    let report = fly(port, within(Duration::from_secs(1), 4));
    thread.join().unwrap();
    assert_eq!((report.frames, report.lost), (1, 3));
    assert!((1..4).contains(&report.recovery.requested), "{report}");
    assert_eq!(report.nack_count, 0, "a request too late is no refusal");
}

#[test]
fn by_the_wall_clock_frames_are_mended_while_others_come() {
    let (port, thread) = over_memory(Emulator::new(|_, _| {}));
    let report = fly(Lossy::new(port, 4, [0.03, 0.05, 0.0]), by_wall(10.0, 40));
    thread.join().unwrap();
    // An attitude or a whole frame that is lost is not made up for.
    assert!(report.frames >= 34, "{report}");
    assert!(report.assembly.recovered > 10, "{report}");
}

#[test]
fn udp_with_packets_cut_short_both_ways() {
    for seed in 70..73 {
        let mut emulator = Emulator::new(|_, _| {});
        emulator.expects_damage = true;
        let (address, thread) = over_udp(emulator, Duration::from_secs(3));
        let port = UdpPort::connect(address).unwrap();
        let seed = Noise::new(seed).bits();
        let report = fly(Lossy::new(port, seed, [0.0, 0.0, 0.1]), mission(40));
        let emulator = thread.join().unwrap();
        assert_eq!((report.frames, report.lost, report.refused), (40, 0, 0));
        let damaged = report.recovery.damaged;
        assert!(damaged > 0 && damaged <= emulator.damaged, "{report}");
        assert_eq!(report.nack_count, 0, "damage is no refusal");
    }
}

/// A line of 9600 baud; it may harm every attitude on its way out.
struct Line<P> {
    port: P,
    spoils: bool,
}

impl<P: Port> Port for Line<P> {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        let mut packet = packet.to_vec();
        let is_attitude = identify(&packet).is_some_and(|(apid, _)| apid == apid::ATTITUDE);
        if is_attitude && self.spoils {
            packet[20] ^= 1;
        }
        self.port.send(&packet)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        self.port.recv(timeout)
    }

    fn airtime(&self, bytes: usize) -> Duration {
        if self.spoils {
            Duration::ZERO
        } else {
            Duration::from_secs(bytes as u64) * 10 / 9600
        }
    }
}

#[test]
fn an_attitude_damaged_every_time_counts_as_refused_in_the_end() {
    let mut emulator = Emulator::new(|_, _| {});
    emulator.expects_damage = true;
    let (port, thread) = over_memory(emulator);
    let spoils = true;
    let report = fly(Line { port, spoils }, mission(2));
    let emulator = thread.join().unwrap();
    assert_eq!((report.frames, report.lost, report.refused), (0, 0, 2));
    assert!((4..100).contains(&emulator.damaged), "{}", emulator.damaged);
    assert!(report.nacks[0].detail.contains("damaged"), "{report}");
}

#[test]
fn a_rest_of_the_line_is_no_loss() {
    // 0.5 s for a frame, and 0.4 s of rest when it has begun, has half come, is all but here.
    for before in [10, 40, 70] {
        let mut emulator = Emulator::new(|_, _| {});
        emulator.field = Field::USUAL;
        let (port, thread) = over_memory(emulator);
        let rest = (before, Duration::from_millis(400));
        let report = fly(Slow::new(port, Duration::from_millis(6), rest), mission(2));
        let emulator = thread.join().unwrap();
        assert_eq!((report.frames, report.lost), (2, 0));
        assert_eq!(
            (emulator.resent, report.recovery.requested),
            (0, 0),
            "{before}"
        );
        assert_eq!(report.missing_packets, 0);
    }
}

#[test]
fn a_loss_on_a_line_too_slow_for_the_frame_says_so() {
    let windows = Output {
        pixels: PixelLevel::Windows,
        labels: LabelLevel::Objects,
        ..Output::default()
    };
    let longer = "choose --output windows or labels, or a longer --timeout";
    for (output, remedy) in [
        (Output::default(), longer),
        (windows, "ask for fewer --windows and --objects"),
    ] {
        let mut emulator = Emulator::new(|_, packets| packets.truncate(3));
        emulator.resends = false;
        let (port, thread) = over_memory(emulator);
        let short = Mission {
            output: Some(output),
            ..within(Duration::from_millis(300), 1)
        };
        let mut lost = Vec::new();
        let spoils = false;
        let flown = computer(Line { port, spoils }, short).run(|event| {
            if let Event::Lost { loss, .. } = event {
                lost.push(loss.to_string());
            }
            ControlFlow::Continue(())
        });
        flown.unwrap();
        thread.join().unwrap();
        let slow = lost[0].contains("on this line and is waited for 0.3 s");
        assert!(slow && lost[0].contains(remedy), "{lost:?}");
    }
}
