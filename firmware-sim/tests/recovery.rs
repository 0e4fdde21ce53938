//! Packets lost and reordered on the way: asked for again until every frame is whole.

mod common;

use std::net::UdpSocket;
use std::ops::ControlFlow;
use std::thread::{JoinHandle, spawn};
use std::time::Duration;

use common::emulator::Emulator;
use common::loops::{mission, over_memory};
use common::lossy::{Lossy, Truncating};
use common::slow::Slow;
use common::{Field, Noise};
use skyloop_firmware_sim::event::Event;
use skyloop_firmware_sim::flight_computer::FlightComputer;
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::port::{Port, PortError};
use skyloop_firmware_sim::report::Report;
use skyloop_firmware_sim::udp::UdpPort;
use skyloop_protocols::packet::identify;
use skyloop_protocols::{LabelLevel, Output, PixelLevel, apid};

/// Flies, and prints all that goes wrong.
fn fly(port: impl Port, mission: Mission) -> Report {
    let report = FlightComputer::new(port, mission).run(|event| {
        match event {
            Event::Frame { .. } | Event::Tick | Event::Progress => {}
            other => println!("{other:?}"),
        }
        ControlFlow::Continue(())
    });
    let report = report.unwrap();
    println!("{report}");
    report
}

fn lossy_flight(output: Output, frames: u32, field: Field, seed: u64) -> (Report, Emulator) {
    let mut emulator = Emulator::new(|_, _| {});
    emulator.field = field;
    let (port, thread) = over_memory(emulator);
    let mission = Mission {
        output: Some(output),
        ..mission(frames)
    };
    let report = fly(Lossy::new(port, seed, 0.05, 0.05), mission);
    (report, thread.join().unwrap())
}

const SMALL: Field = Field {
    width: 128,
    height: 96,
    psf_px: 0.7,
    background_e: 40.0,
    read_noise_e: 8.0,
    gain_e_per_dn: 4.0,
    offset_dn: 100.0,
    bits: 12,
};

#[test]
fn every_frame_comes_whole_at_every_level() {
    for (seed, (pixels, labels)) in (1..).zip([
        (PixelLevel::Frame, LabelLevel::Text),
        (PixelLevel::Compressed, LabelLevel::Text),
        (PixelLevel::Windows, LabelLevel::Objects),
        (PixelLevel::None, LabelLevel::Objects),
    ]) {
        let output = Output {
            pixels,
            labels,
            ..Output::default()
        };
        let (report, emulator) = lossy_flight(output, 30, SMALL, seed);
        assert_eq!((report.frames, report.lost), (30, 0), "{output:?}");
        let recovered = report.assembly.recovered;
        assert!(
            recovered > 0 && recovered <= emulator.resent as u64,
            "{output:?}: {recovered} of {}",
            emulator.resent
        );
        assert_eq!(report.totals.missed, 0);
    }
}

#[test]
fn frames_larger_than_the_window_come_whole() {
    // 131,072 pixels: some 140 blocks and the labels; the window is 64.
    let field = Field {
        width: 512,
        height: 256,
        ..SMALL
    };
    let (report, _) = lossy_flight(Output::default(), 6, field, 9);
    assert_eq!((report.frames, report.lost), (6, 0));
    assert!(report.assembly.recovered > 20);
}

#[test]
fn every_packet_of_a_frame_can_be_lost_alone() {
    // The header, a block, the end, the first block, the last label part: each of them once.
    let emulator = Emulator::new(|attitude, packets| {
        let place = match attitude {
            0 => 0,
            1 => 3,
            2 => packets.len() - 1,
            3 => 1,
            4 => packets.len() - 2,
            _ => return,
        };
        packets.remove(place);
    });
    let (port, thread) = over_memory(emulator);
    let begin = std::time::Instant::now();
    let report = fly(port, mission(6));
    assert_eq!((report.frames, report.lost), (6, 0));
    // On a busy machine some are asked for in vain.
    assert!(report.assembly.recovered >= 5);
    assert!((5..40).contains(&thread.join().unwrap().resent));
    assert!(begin.elapsed() < mission(6).timeout, "before the time-out");
}

#[test]
fn an_attitude_of_which_nothing_comes_is_sent_again_as_it_was() {
    // The frame of the first copy vanishes.
    let mut emulator = Emulator::new(|_, _| {});
    emulator.swallows = |copy, attitude| attitude == 3 && copy == 0;
    let (port, thread) = over_memory(emulator);
    let report = fly(port, mission(6));
    let attitudes = thread.join().unwrap().attitudes;
    assert_eq!((report.frames, report.lost), (6, 0));
    assert_eq!(report.recovery.attitudes as usize, attitudes.len() - 6);
    let mut copies = attitudes.iter().filter(|(_, copy)| copy.sequence == 3);
    let (first, again) = (copies.next().unwrap(), copies.next().unwrap());
    assert_eq!((first.0.time, first.1), (again.0.time, again.1));
    assert_ne!(first.0.sequence_count, again.0.sequence_count);
}

#[test]
fn a_frame_that_comes_twice_is_a_duplicate_and_no_harm() {
    // The first copy's frame comes with the second's.
    let mut emulator = Emulator::new(|_, _| {});
    emulator.delays = |copy, attitude| attitude == 3 && copy == 0;
    let (port, thread) = over_memory(emulator);
    let report = fly(port, mission(6));
    thread.join().unwrap();
    assert_eq!((report.frames, report.lost, report.late), (6, 0, 0));
    assert!(report.recovery.duplicates >= 1);
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
    let short = Mission {
        timeout: Duration::from_secs(1),
        ..mission(4)
    };
    let report = fly(port, short);
    thread.join().unwrap();
    assert_eq!((report.frames, report.lost), (1, 3));
    assert!((1..4).contains(&report.recovery.asked), "{report}");
    assert_eq!(report.nack_count, 0, "a request too late is no refusal");
}

#[test]
fn by_the_wall_clock_frames_are_mended_while_others_come() {
    let (port, thread) = over_memory(Emulator::new(|_, _| {}));
    let wall = Mission {
        pace: Pace::Wall { rate_hz: 10.0 },
        ..mission(40)
    };
    let report = fly(Lossy::new(port, 4, 0.03, 0.05), wall);
    thread.join().unwrap();
    // An attitude or a whole frame that is lost is not made up for.
    assert!(report.frames >= 34, "{report}");
    assert!(report.assembly.recovered > 10, "{report}");
}

/// An emulator on UDP; it ends when the flight computer has been silent for three seconds.
fn over_udp(mut emulator: Emulator) -> (UdpPort, JoinHandle<Emulator>) {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = socket.local_addr().unwrap();
    let timeout = Duration::from_secs(3);
    socket.set_read_timeout(Some(timeout)).unwrap();
    let thread = spawn(move || {
        let mut buffer = [0; 2048];
        while let Ok((length, client)) = socket.recv_from(&mut buffer) {
            for answer in emulator.answer(&buffer[..length]) {
                socket.send_to(&answer, client).unwrap();
            }
        }
        emulator
    });
    (UdpPort::connect(address).unwrap(), thread)
}

#[test]
fn udp_with_packets_cut_short_both_ways() {
    for seed in 0..3 {
        let mut emulator = Emulator::new(|_, _| {});
        emulator.expects_damage = true;
        let (port, thread) = over_udp(emulator);
        let seed = Noise::new(70 + seed).bits();
        let report = fly(Truncating::new(port, seed, 0.1), mission(40));
        let emulator = thread.join().unwrap();
        assert_eq!((report.frames, report.lost, report.refused), (40, 0, 0));
        let damaged = report.recovery.damaged;
        assert!(damaged > 0 && damaged <= emulator.damaged, "{report}");
        assert_eq!(report.nack_count, 0, "damage is no refusal");
    }
}

/// Harms every copy of every attitude on its way out.
struct Spoiling<P>(P);

impl<P: Port> Port for Spoiling<P> {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        let mut packet = packet.to_vec();
        if identify(&packet).map(|(apid, _)| apid) == Some(apid::ATTITUDE) {
            packet[20] ^= 1;
        }
        self.0.send(&packet)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        self.0.recv(timeout)
    }
}

#[test]
fn an_attitude_damaged_every_time_counts_as_refused_in_the_end() {
    let mut emulator = Emulator::new(|_, _| {});
    emulator.expects_damage = true;
    let (port, thread) = over_memory(emulator);
    let report = fly(Spoiling(port), mission(2));
    let emulator = thread.join().unwrap();
    assert_eq!((report.frames, report.lost, report.refused), (0, 0, 2));
    assert!((4..100).contains(&emulator.damaged), "{}", emulator.damaged);
    assert!(report.nacks[0].detail.contains("damaged"), "{report}");
}

#[test]
fn udp_with_loss_and_reordering_both_ways() {
    let (port, thread) = over_udp(Emulator::new(|_, _| {}));
    let seed = Noise::new(7).bits();
    let report = fly(Lossy::new(port, seed, 0.05, 0.05), mission(40));
    thread.join().unwrap();
    assert_eq!((report.frames, report.lost), (40, 0));
}

#[test]
fn a_rest_of_the_line_is_no_loss() {
    // 0.5 s for a frame, and 0.4 s of rest when it has begun, has half come, is all but here.
    for before in [10, 40, 70] {
        let field = Field {
            width: 256,
            height: 256,
            ..SMALL
        };
        let mut emulator = Emulator::new(|_, _| {});
        emulator.field = field;
        let (port, thread) = over_memory(emulator);
        let rest = (before, Duration::from_millis(400));
        let port = Slow::new(port, Duration::from_millis(6), rest);
        let report = fly(port, mission(2));
        let emulator = thread.join().unwrap();
        assert_eq!((report.frames, report.lost), (2, 0));
        assert_eq!((emulator.resent, report.recovery.asked), (0, 0), "{before}");
        assert_eq!(report.missing_packets, 0);
    }
}

/// A port on a line of 9600 baud.
struct Line<P>(P);

impl<P: Port> Port for Line<P> {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        self.0.send(packet)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        self.0.recv(timeout)
    }

    fn airtime(&self, octets: usize) -> Duration {
        Duration::from_secs(octets as u64) * 10 / 9600
    }
}

#[test]
fn a_loss_on_a_line_too_slow_for_the_frame_says_so() {
    for (output, remedy) in [
        (
            Output::default(),
            "choose --output windows or labels, or a longer --timeout",
        ),
        (
            Output {
                pixels: PixelLevel::Windows,
                labels: LabelLevel::Objects,
                ..Output::default()
            },
            "ask for fewer --windows and --objects",
        ),
    ] {
        let mut emulator = Emulator::new(|_, packets| packets.truncate(3));
        emulator.resends = false;
        let (port, thread) = over_memory(emulator);
        let short = Mission {
            timeout: Duration::from_millis(300),
            output: Some(output),
            ..mission(1)
        };
        let mut lost = Vec::new();
        let flown = FlightComputer::new(Line(port), short).run(|event| {
            if let Event::Lost { loss, .. } = event {
                lost.push(loss.to_string());
            }
            ControlFlow::Continue(())
        });
        flown.unwrap();
        thread.join().unwrap();
        assert!(
            lost[0].contains("on this line and is waited for 0.3 s") && lost[0].contains(remedy),
            "{lost:?}"
        );
    }
}
