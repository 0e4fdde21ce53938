//! The whole flight computer against a small emulator in a thread, over memory and over UDP, on good and on bad days.

mod common;

use std::net::UdpSocket;
use std::ops::ControlFlow;
use std::sync::mpsc::channel;
use std::thread::spawn;
use std::time::Duration;

use common::Field;
use common::emulator::Emulator;
use common::loops::{mission, over_memory, start};
use skyloop_firmware_sim::event::{Event, Loss};
use skyloop_firmware_sim::flight_computer::{FlightComputer, RunError};
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::port::{ChannelPort, Port};
use skyloop_firmware_sim::profile::Profile;
use skyloop_firmware_sim::report::Report;
use skyloop_firmware_sim::time::to_epoch;
use skyloop_firmware_sim::udp::UdpPort;
use skyloop_protocols::{Direction, Fault, FaultKind, Reason};

/// Runs a mission; gives the report and what happened, a word a piece.
fn fly(port: impl Port, mission: Mission) -> (Report, Vec<String>) {
    let mut told = Vec::new();
    let report = FlightComputer::new(port, mission).run(|event| {
        told.push(match event {
            Event::Frame {
                frame,
                labels,
                score,
                ..
            } => {
                assert!(labels.is_some() && score.is_some());
                format!("frame {}", frame.header.attitude_sequence)
            }
            Event::Lost {
                sequence,
                loss: Loss::Damaged(_),
            } => format!("damaged {sequence}"),
            Event::Lost { sequence, loss } => format!("lost {sequence}: {loss}"),
            Event::Nack(nack) => format!("nack: {}", nack.detail),
            Event::Problem(problem) => problem,
            Event::Tick | Event::Progress => return ControlFlow::Continue(()),
        });
        ControlFlow::Continue(())
    });
    (report.unwrap(), told)
}

#[test]
fn an_orbit_that_ends_cuts_the_run_short_and_keeps_its_report() {
    let (port, thread) = over_memory(Emulator::new(|_, _| {}));
    let last = start() + hifitime::Duration::from_seconds(1.1);
    let gap = start() + hifitime::Duration::from_seconds(1.9);
    let whole = mission(5);
    let orbit = whole.orbit.clone().unwrap();
    // Frames at 0, 0.5, 1 s; none at 1.5 s. What lies at both ends is known before.
    let gapped = Mission {
        orbit: Some(std::sync::Arc::new(move |t| {
            if last < t && t < gap {
                return Err("it has a gap".into());
            }
            orbit(t)
        })),
        ..whole
    };
    let flown = FlightComputer::new(port, gapped).run(|_| ControlFlow::Continue(()));
    let Err(RunError::CutShort { report, source }) = flown else {
        panic!("the run is cut short");
    };
    assert_eq!((report.frames, report.requested), (3, 5));
    assert_eq!(report.status.unwrap().counters.attitudes, 3);
    assert!(source.to_string().contains("it has a gap"), "{source}");
    assert_eq!(thread.join().unwrap().resets, 2, "at both ends");
}

#[test]
fn a_good_day() {
    let (port, thread) = over_memory(Emulator::new(|_, _| {}));
    let (report, told) = fly(port, mission(6));
    let emulator = thread.join().unwrap();
    assert_eq!(
        told,
        (0..6).map(|n| format!("frame {n}")).collect::<Vec<_>>()
    );
    assert_eq!(
        (report.frames, report.lost, report.refused, report.late),
        (6, 0, 0, 0)
    );
    assert_eq!(report.latencies.count(), 6);
    assert_eq!(
        report.status.map(|status| status.counters.attitudes),
        Some(6)
    );
    let residual = report.totals.residual().unwrap();
    println!("{report}");
    assert!(
        residual.rms_px < 0.05 && residual.count > 150,
        "{residual:?}"
    );
    assert_eq!(
        (report.totals.missed, report.totals.matched),
        (0, report.totals.stars)
    );

    for (number, (header, attitude)) in emulator.attitudes.iter().enumerate() {
        let expected = start() + hifitime::Duration::from_seconds(0.5 * number as f64);
        assert_eq!(
            (to_epoch(header.time), attitude.sequence),
            (expected, number as u32)
        );
        // X-Val: dR/dt = -[w x] R about +Y at 0.01 rad/s: q = [0, -sin(0.0025 n), 0, cos(0.0025 n)].
        let half = 0.0025 * number as f64;
        assert!((attitude.q_icrf_to_body[1] + half.sin()).abs() < 1e-12);
        assert!((attitude.q_icrf_to_body[3] - half.cos()).abs() < 1e-12);
        assert_eq!(attitude.rates_rad_s, [0.0, 0.01, 0.0]);
        assert_eq!(attitude.state.unwrap().position_m, [7.0e6, 0.0, 0.0]);
    }
}

#[test]
fn a_bad_day_loses_frames_and_nothing_else() {
    let mut emulator = Emulator::new(|attitude, packets| match attitude {
        // A lost block, a lost header, nothing at all, one damaged bit.
        1 => drop(packets.remove(5)),
        2 => drop(packets.remove(0)),
        3 => packets.clear(),
        4 => packets[3][40] ^= 1,
        // Everything twice and backwards, with rubbish between.
        6 => {
            packets.extend(packets.clone());
            packets.reverse();
            packets.insert(3, b"rubbish".to_vec());
            packets.insert(7, vec![0xFF; 1400]);
            packets.insert(9, Vec::new());
        }
        // A block whose pixels are not those of the header's checksum.
        7 => {
            packets[2][100] ^= 1;
            skyloop_protocols::packet::reseal(&mut packets[2]);
        }
        _ => {}
    });
    emulator.refuses = |attitude| attitude == 5;
    emulator.resends = false;
    let (port, thread) = over_memory(emulator);
    let impatient = Mission {
        timeout: Duration::from_secs(1),
        ..mission(9)
    };
    let (report, told) = fly(port, impatient);
    thread.join().unwrap();
    let short: Vec<&str> = told
        .iter()
        .map(|line| line.split(':').next().unwrap())
        .collect();
    let expected = [
        "frame 0",
        "lost 1",
        "lost 2",
        "lost 3",
        "lost 4",
        "nack",
        "frame 6",
        "damaged 7",
        "frame 8",
    ];
    assert_eq!(short, expected, "{told:?}");
    assert!(
        told[1].contains("pixel blocks") && told[5].contains("as the test asks"),
        "{told:?}"
    );
    assert_eq!((report.frames, report.lost, report.refused), (3, 5, 1));
    assert_eq!(
        (report.nack_count, report.nacks[0].reason),
        (1, Reason::TimeBackwards)
    );
    // Attitude 4 was sent again, and its frame damaged again.
    assert!(report.undecodable >= 4, "{report}");
    assert!(
        report.missing_packets > 0 && report.assembly.duplicates > 0,
        "{report}"
    );
    assert_eq!(report.assembly.bad_pixels, 1);
}

#[test]
fn credit_paces_frames_larger_than_the_window_and_recovers_when_a_window_is_lost() {
    let mut emulator = Emulator::new(|attitude, packets| {
        if attitude == 1 {
            // More than a window vanishes: sent and paid for, but never seen.
            for packet in packets.iter_mut().take(70) {
                packet.clear();
            }
        }
    });
    // 131,072 pixels: some 140 blocks and the labels.
    emulator.field = Field {
        width: 512,
        height: 256,
        ..Field::default()
    };
    emulator.resends = false;
    let (port, thread) = over_memory(emulator);
    let (report, told) = fly(
        port,
        Mission {
            timeout: Duration::from_secs(4),
            ..mission(4)
        },
    );
    thread.join().unwrap();
    println!("{told:?}");
    assert_eq!((report.frames, report.lost), (3, 1));
}

#[test]
fn udp_carries_the_loop() {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = socket.local_addr().unwrap();
    socket
        .set_read_timeout(Some(Duration::from_secs(3)))
        .unwrap();
    let thread = spawn(move || {
        let mut emulator = Emulator::new(|_, _| {});
        emulator.field = Field {
            width: 512,
            height: 256,
            ..Field::default()
        };
        let mut buffer = [0; 2048];
        // Ends when the flight computer has been silent for the time-out.
        while let Ok((length, client)) = socket.recv_from(&mut buffer) {
            for answer in emulator.answer(&buffer[..length]) {
                socket.send_to(&answer, client).unwrap();
            }
        }
    });
    let (report, told) = fly(UdpPort::connect(address).unwrap(), mission(3));
    thread.join().unwrap();
    assert_eq!(
        (report.frames, report.lost, report.missing_packets),
        (3, 0, 0),
        "{told:?}"
    );
}

/// Flies 8 attitudes at 20 Hz by the wall clock against an emulator of small frames; its report and what was told.
fn by_the_wall_clock(mut emulator: Emulator) -> (Emulator, Report, Vec<String>) {
    emulator.field = Field {
        width: 64,
        height: 64,
        ..Field::default()
    };
    let (port, thread) = over_memory(emulator);
    let wall = Mission {
        pace: Pace::Wall { rate_hz: 20.0 },
        timeout: Duration::from_secs(5),
        ..mission(8)
    };
    let (report, told) = fly(port, wall);
    (thread.join().unwrap(), report, told)
}

#[test]
fn by_the_wall_clock_attitudes_leave_in_order_and_skipped_frames_are_counted() {
    let (emulator, report, told) = by_the_wall_clock(Emulator::new(|attitude, packets| {
        if attitude % 4 == 2 {
            packets.clear();
        }
    }));
    assert_eq!(report.frames + report.lost, 8, "{told:?}");
    assert!(
        report.lost >= 1 && told.iter().any(|line| line.contains("went on to the next")),
        "{told:?}"
    );
    let left = periods(&emulator, 20.0);
    assert!((0.0..20.0).contains(&left[0]), "{left:?}");
    assert!(left.windows(2).all(|pair| pair[0] < pair[1]), "{left:?}");
}

#[test]
#[ignore = "timed: tests/run has it run with nothing beside it; cargo test -- --ignored timed"]
fn timed_attitudes_leave_at_their_rate() {
    let (emulator, ..) = by_the_wall_clock(Emulator::new(|_, _| {}));
    let left = periods(&emulator, 20.0);
    let mut spacings: Vec<f64> = left.windows(2).map(|pair| pair[1] - pair[0]).collect();
    spacings.sort_by(f64::total_cmp);
    assert!(spacings[spacings.len() / 2] < 2.0, "{left:?}");
}

#[test]
fn by_the_wall_clock_the_attitudes_of_a_pause_are_passed_over() {
    let (port, thread) = over_memory(Emulator::new(|_, _| {}));
    let wall = Mission {
        pace: Pace::Wall { rate_hz: 20.0 },
        ..mission(6)
    };
    let mut pause = Some(Duration::from_millis(180));
    let report = FlightComputer::new(port, wall).run(|event| {
        // 3.6 periods, once.
        if matches!(event, Event::Frame { .. }) {
            pause.take().into_iter().for_each(std::thread::sleep);
        }
        ControlFlow::Continue(())
    });
    assert_eq!(report.unwrap().frames, 6);
    let emulator = thread.join().unwrap();
    let left = periods(&emulator, 20.0);
    let over = |pair: &[f64]| pair[1] - pair[0] > 2.5;
    assert!(left.windows(2).any(over), "{left:?}");
}

/// When the attitudes left by their own times, in periods from the start. None left before its number of periods, and
/// no two in the same period: neither faster than the rate, nor in a burst.
fn periods(emulator: &Emulator, rate_hz: f64) -> Vec<f64> {
    let mut left: Vec<f64> = Vec::new();
    for (header, attitude) in &emulator.attitudes {
        let at = (to_epoch(header.time) - start()).to_seconds() * rate_hz;
        // A nanosecond lost on the wire is not early.
        assert!(
            at > f64::from(attitude.sequence) - 1e-6,
            "{at}: {attitude:?}"
        );
        let before = left.last().map_or(-1.0, |at| at.floor());
        assert!(at.floor() > before, "{at} after {left:?}");
        left.push(at);
    }
    left
}

#[test]
fn errors_that_end_a_run_say_what_to_do() {
    let silent = || {
        let (to_emulator, inbound) = channel();
        let (outbound, from_emulator) = channel();
        (
            ChannelPort::new(to_emulator, from_emulator),
            inbound,
            outbound,
        )
    };
    let run = |mission: Mission| {
        let (port, _inbound, _outbound) = silent();
        FlightComputer::new(port, mission)
            .run(|_| ControlFlow::Continue(()))
            .unwrap_err()
    };
    let error = run(Mission {
        timeout: Duration::from_millis(300),
        ..mission(1)
    });
    assert!(
        matches!(error, RunError::NoAnswer { .. }) && error.to_string().contains("skyloop run"),
        "{error}"
    );
    let error = run(Mission {
        period_s: f64::NAN,
        ..mission(1)
    });
    assert!(error.to_string().contains("the period is NaN"), "{error}");
    let error = run(Mission {
        profile: Profile::Nadir,
        orbit: None,
        ..mission(1)
    });
    assert!(error.to_string().contains("--orbit"), "{error}");
    let error = run(Mission {
        orbit: Some(std::sync::Arc::new(|_| Err("decayed".into()))),
        ..mission(1)
    });
    assert!(error.to_string().contains("decayed"), "{error}");

    let (port, inbound, _outbound) = silent();
    drop(inbound);
    let error = FlightComputer::new(port, mission(1))
        .run(|_| ControlFlow::Continue(()))
        .unwrap_err();
    assert!(matches!(error, RunError::Port(_)), "{error}");
}

#[test]
fn a_watcher_may_break_the_run_off_while_nothing_happens() {
    let after_a_second = || {
        let begin = std::time::Instant::now();
        move |_: Event<'_>| match begin.elapsed() > Duration::from_secs(1) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    };
    let patient = Mission {
        timeout: Duration::from_secs(3600),
        ..mission(3)
    };
    // Nobody answers the Reset.
    let (to_emulator, _inbound) = channel();
    let (_outbound, from_emulator) = channel();
    let port = ChannelPort::new(to_emulator, from_emulator);
    let report = FlightComputer::new(port, patient.clone()).run(after_a_second());
    assert_eq!(report.unwrap().frames, 0);
    // No frame comes; an hour between two attitudes, by either clock.
    for (mischief, pace) in [
        (true, Pace::Stepped { most_hz: None }),
        (
            false,
            Pace::Stepped {
                most_hz: Some(1.0 / 3600.0),
            },
        ),
        (
            true,
            Pace::Wall {
                rate_hz: 1.0 / 3600.0,
            },
        ),
    ] {
        let (port, thread) = over_memory(Emulator::new(match mischief {
            true => |_, packets| packets.clear(),
            false => |_, _| {},
        }));
        let mission = Mission {
            pace,
            ..patient.clone()
        };
        let report = FlightComputer::new(port, mission).run(after_a_second());
        assert_eq!(report.unwrap().lost, 0, "{pace:?}");
        assert_eq!(thread.join().unwrap().resets, 2, "{pace:?}");
    }
}

#[test]
fn a_watcher_may_break_the_run_off() {
    let (port, thread) = over_memory(Emulator::new(|_, _| {}));
    let report = FlightComputer::new(port, mission(50))
        .run(|event| match event {
            Event::Frame { .. } => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        })
        .unwrap();
    thread.join().unwrap();
    assert_eq!((report.requested, report.frames), (50, 1));
}

#[test]
fn faults_begin_before_the_first_attitude_and_a_refusal_ends_the_run() {
    let fault = |kind, value| Fault {
        kind,
        direction: Direction::Out,
        value,
        seconds: 2.0,
    };
    let faults = vec![fault(FaultKind::Drop, 0.05), fault(FaultKind::Down, 1.0)];
    let (port, thread) = over_memory(Emulator::new(|_, _| {}));
    let flown = FlightComputer::new(port, mission(2)).with_faults(faults.clone());
    let report = flown.run(|_| ControlFlow::Continue(())).unwrap();
    assert_eq!(report.frames, 2);
    let begun = thread.join().unwrap().faults;
    assert_eq!(begun, faults.iter().map(|f| (*f, 0)).collect::<Vec<_>>());

    let mut emulator = Emulator::new(|_, _| {});
    emulator.refuses_faults = true;
    let (port, thread) = over_memory(emulator);
    let flown = FlightComputer::new(port, mission(2)).with_faults(faults);
    let error = flown.run(|_| ControlFlow::Continue(())).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("refuses the fault: no faults here"),
        "{error}"
    );
    let emulator = thread.join().unwrap();
    // It frees the emulator.
    assert_eq!((emulator.attitudes.len(), emulator.resets), (0, 2));
}
