//! The flight computer against a small emulator in a thread, over memory and UDP, with and without
//! faults.

use std::ops::ControlFlow;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::common::Field;
use crate::common::emulator::Emulator;
use crate::common::loops::{
    ChannelPort, by_wall, computer, mission, over_memory, over_udp, start, within,
};
use skyloop_firmware_sim::event::{Event, Loss};
use skyloop_firmware_sim::flight_computer::RunError;
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::port::Port;
use skyloop_firmware_sim::profile::Profile;
use skyloop_firmware_sim::report::Report;
use skyloop_firmware_sim::time::to_epoch;
use skyloop_firmware_sim::udp::UdpPort;
use skyloop_protocols::{Direction, Fault, FaultKind, Reason};

/// 131,072 pixels: some 140 blocks and the labels, more than the window of 64.
const LARGE: Field = Field {
    width: 512,
    height: 256,
    ..Field::USUAL
};

/// Runs a mission. Returns the report, one line for each event, and the emulator.
fn run(
    (port, thread): (impl Port + Send + 'static, JoinHandle<Emulator>),
    mission: Mission,
) -> (Report, Vec<String>, Emulator) {
    let mut events = Vec::new();
    let report = computer(port, mission).run(|event| {
        events.push(match event {
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
    (report.unwrap(), events, thread.join().unwrap())
}

#[test]
fn runs_cut_short_by_the_orbit_have_a_report() {
    let (port, thread) = over_memory(Emulator::new(|_, _| {}));
    let after = |seconds| start() + hifitime::Duration::from_seconds(seconds);
    let whole = mission(5);
    let orbit = whole.orbit.clone().unwrap();
    // Frames at 0, 0.5, 1 s; none at 1.5 s. The run checks both ends in advance.
    let gapped = Mission {
        orbit: Some(std::sync::Arc::new(move |t| {
            if after(1.1) < t && t < after(1.9) {
                return Err("it has a gap".into());
            }
            orbit(t)
        })),
        ..whole
    };
    let flown = crate::common::loops::run_and_print(computer(port, gapped));
    let Err(RunError::CutShort { report, source }) = flown else {
        panic!("the run is cut short");
    };
    assert_eq!((report.frames, report.requested), (3, 5));
    assert_eq!(report.status.unwrap().counters.attitudes, 3);
    assert!(source.to_string().contains("it has a gap"), "{source}");
    assert_eq!(thread.join().unwrap().resets, 2, "at both ends");
}

#[test]
fn undisturbed_runs_lose_nothing() {
    let emulator = Emulator::new(|_, _| {});
    let (report, events, emulator) = run(over_memory(emulator), mission(6));
    println!("{report}");
    let frames: Vec<String> = (0..6).map(|n| format!("frame {n}")).collect();
    assert_eq!(events, frames);
    let counts = (report.frames, report.lost, report.refused, report.late);
    assert_eq!(counts, (6, 0, 0, 0));
    assert_eq!(report.latencies.count(), 6);
    assert_eq!(report.status.unwrap().counters.attitudes, 6);
    let (totals, residual) = (&report.totals, report.totals.residual().unwrap());
    assert!(residual.rms_px < 0.05, "{residual:?}");
    assert!(residual.count > 150, "{residual:?}");
    assert_eq!((totals.missed, totals.matched), (0, totals.stars));
    for (number, (header, attitude)) in (0..).zip(&emulator.attitudes) {
        let expected = start() + hifitime::Duration::from_seconds(0.5 * f64::from(number));
        assert_eq!(to_epoch(header.time), expected);
        assert_eq!(attitude.sequence, number);
        // X-Val: dR/dt = -[w x] R about +Y at 0.01 rad/s:
        // q = [0, -sin(0.0025 n), 0, cos(0.0025 n)].
        let half = 0.0025 * f64::from(number);
        assert!((attitude.q_icrf_to_body[1] + half.sin()).abs() < 1e-12);
        assert!((attitude.q_icrf_to_body[3] - half.cos()).abs() < 1e-12);
        assert_eq!(attitude.rates_rad_s, [0.0, 0.01, 0.0]);
        assert_eq!(attitude.state.unwrap().position_m, [7.0e6, 0.0, 0.0]);
    }
}

#[test]
fn faults_lose_frames_and_nothing_else() {
    let mut emulator = Emulator::new(|attitude, packets| match attitude {
        // A lost block, a lost header, nothing at all, one damaged bit.
        1 => drop(packets.remove(5)),
        2 => drop(packets.remove(0)),
        3 => packets.clear(),
        4 => packets[3][40] ^= 1,
        // Everything twice, in reverse order, with invalid packets between.
        6 => {
            packets.extend(packets.clone());
            packets.reverse();
            packets.insert(3, b"rubbish".to_vec());
            packets.insert(7, vec![0xFF; 1400]);
            packets.insert(9, Vec::new());
        }
        // Pixels that do not match the checksum.
        7 => {
            packets[2][100] ^= 1;
            skyloop_protocols::packet::reseal(&mut packets[2]);
        }
        _ => {}
    });
    emulator.refuses = |attitude| attitude == 5;
    emulator.resends = false;
    let mission = within(Duration::from_secs(1), 9);
    let (report, events, _) = run(over_memory(emulator), mission);
    let expected = [
        "frame 0",
        "lost 1: ",
        "lost 2: ",
        "lost 3: ",
        "lost 4: ",
        "nack: as the test asks",
        "frame 6",
        "damaged 7",
        "frame 8",
    ];
    assert_eq!(events.len(), expected.len(), "{events:?}");
    for (line, begins) in events.iter().zip(expected) {
        assert!(line.starts_with(begins), "{line}, not {begins}: {events:?}");
    }
    assert!(events[1].contains("pixel blocks"), "{events:?}");
    assert_eq!((report.frames, report.lost, report.refused), (3, 5, 1));
    assert_eq!(report.nack_count, 1);
    assert_eq!(report.nacks[0].reason, Reason::TimeBackwards);
    // Attitude 4 was repeated, and its frame damaged again.
    assert!(report.undecodable >= 4, "{report}");
    assert!(report.missing_packets > 0, "{report}");
    assert!(report.assembly.duplicates > 0, "{report}");
    assert_eq!(report.assembly.bad_pixels, 1);
}

#[test]
fn credit_recovers_after_the_loss_of_a_window() {
    // More than a window is lost: sent for credit, but never received.
    let mut emulator = Emulator::new(|attitude, packets| {
        let lost = usize::from(attitude == 1) * 70;
        packets.iter_mut().take(lost).for_each(Vec::clear);
    });
    emulator.field = LARGE;
    emulator.resends = false;
    let mission = within(Duration::from_secs(4), 4);
    let (report, events, _) = run(over_memory(emulator), mission);
    assert_eq!((report.frames, report.lost), (3, 1), "{events:?}");
}

#[test]
fn udp_carries_the_loop() {
    let mut emulator = Emulator::new(|_, _| {});
    emulator.field = LARGE;
    let (address, thread) = over_udp(emulator, Duration::from_secs(3));
    let port = UdpPort::connect(address).unwrap();
    let (report, events, _) = run((port, thread), mission(3));
    let counts = (report.frames, report.lost, report.missing_packets);
    assert_eq!(counts, (3, 0, 0), "{events:?}");
}

/// Runs 8 attitudes at 20 Hz by the wall clock against an emulator of small frames. Returns
/// its report and events, and the emulator.
fn run_by_the_wall_clock(mut emulator: Emulator) -> (Report, Vec<String>, Emulator) {
    (emulator.field.width, emulator.field.height) = (64, 64);
    let mission = Mission {
        timeout: Duration::from_secs(5),
        ..by_wall(20.0, 8)
    };
    run(over_memory(emulator), mission)
}

#[test]
fn wall_clock_attitudes_keep_their_order_and_skipped_frames_are_counted() {
    let (report, events, emulator) = run_by_the_wall_clock(Emulator::new(|attitude, packets| {
        if attitude % 4 == 2 {
            packets.clear();
        }
    }));
    assert_eq!(report.frames + report.lost, 8, "{events:?}");
    let skipped = events
        .iter()
        .any(|line| line.contains("went on to the next"));
    assert!(report.lost >= 1 && skipped, "{events:?}");
    let left = periods(&emulator, 20.0);
    assert!((0.0..20.0).contains(&left[0]), "{left:?}");
    assert!(left.windows(2).all(|pair| pair[0] < pair[1]), "{left:?}");
}

#[test]
#[ignore = "timed: tests/run all runs it alone; cargo test -- --ignored timed_"]
fn timed_attitudes_are_sent_at_their_rate() {
    let (.., emulator) = run_by_the_wall_clock(Emulator::new(|_, _| {}));
    let left = periods(&emulator, 20.0);
    let mut spacings: Vec<f64> = left.windows(2).map(|pair| pair[1] - pair[0]).collect();
    spacings.sort_by(f64::total_cmp);
    assert!(spacings[spacings.len() / 2] < 2.0, "{left:?}");
}

#[test]
fn wall_clock_attitudes_in_a_delay_are_skipped() {
    let (port, thread) = over_memory(Emulator::new(|_, _| {}));
    let mut pause = Some(Duration::from_millis(180));
    let report = computer(port, by_wall(20.0, 6)).run(|event| {
        // 3.6 periods, once.
        if matches!(event, Event::Frame { .. }) {
            pause.take().into_iter().for_each(std::thread::sleep);
        }
        ControlFlow::Continue(())
    });
    assert_eq!(report.unwrap().frames, 6);
    let left = periods(&thread.join().unwrap(), 20.0);
    let over = |pair: &[f64]| pair[1] - pair[0] > 2.5;
    assert!(left.windows(2).any(over), "{left:?}");
}

/// Times of the attitudes, in periods from the start. No attitude is sent before its period, and no
/// two in one period: neither above the rate nor in a burst.
fn periods(emulator: &Emulator, rate_hz: f64) -> Vec<f64> {
    let mut left: Vec<f64> = Vec::new();
    for (header, attitude) in &emulator.attitudes {
        let at = (to_epoch(header.time) - start()).to_seconds() * rate_hz;
        // The wire time may be rounded down by a nanosecond.
        let earliest = f64::from(attitude.sequence) - 1e-6;
        assert!(at > earliest, "{at}: {attitude:?}");
        let before = left.last().map_or(-1.0, |at| at.floor());
        assert!(at.floor() > before, "{at} after {left:?}");
        left.push(at);
    }
    left
}

#[test]
fn errors_that_end_a_run_name_a_remedy() {
    let nowhere = Mission {
        profile: Profile::Nadir,
        orbit: None,
        ..mission(1)
    };
    let timeless = Mission {
        period_s: f64::NAN,
        ..mission(1)
    };
    let decayed = Mission {
        orbit: Some(std::sync::Arc::new(|_| Err("decayed".into()))),
        ..mission(1)
    };
    for (mission, says) in [
        (within(Duration::from_millis(300), 1), "skyloop run"),
        (timeless, "the period is NaN"),
        (nowhere, "--orbit"),
        (decayed, "decayed"),
    ] {
        let (port, _inbound, _outbound) = ChannelPort::new();
        let error = crate::common::loops::run_and_print(computer(port, mission)).unwrap_err();
        assert!(error.to_string().contains(says), "{says}: {error}");
    }
    let (port, inbound, _outbound) = ChannelPort::new();
    drop(inbound);
    let error = crate::common::loops::run_and_print(computer(port, mission(1))).unwrap_err();
    assert!(matches!(error, RunError::Port(_)), "{error}");
}

#[test]
fn watchers_can_stop_an_idle_run() {
    let after_a_second = || {
        let begin = Instant::now();
        move |_: Event<'_>| {
            if begin.elapsed() > Duration::from_secs(1) {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        }
    };
    let unlimited = within(Duration::from_secs(3600), 3);
    // The Reset has no reply.
    let (port, _inbound, _outbound) = ChannelPort::new();
    let report = computer(port, unlimited.clone()).run(after_a_second());
    assert_eq!(report.unwrap().frames, 0);
    // No frame comes; an hour between two attitudes, in both modes.
    let hourly = 1.0 / 3600.0;
    for (brings, most_hz, is_wall) in [
        (false, None, false),
        (true, Some(hourly), false),
        (false, None, true),
    ] {
        let (port, thread) = over_memory(Emulator::new(if brings {
            |_, _| {}
        } else {
            |_, packets| packets.clear()
        }));
        let pace = if is_wall {
            Pace::Wall { rate_hz: hourly }
        } else {
            Pace::Stepped { most_hz }
        };
        let mission = Mission {
            pace,
            ..unlimited.clone()
        };
        let report = computer(port, mission).run(after_a_second());
        assert_eq!(report.unwrap().lost, 0, "{pace:?}");
        assert_eq!(thread.join().unwrap().resets, 2, "{pace:?}");
    }
}

#[test]
fn faults_start_before_the_first_attitude_and_a_refusal_ends_the_run() {
    let faults = [(FaultKind::Drop, 0.05), (FaultKind::Down, 1.0)].map(|(kind, value)| Fault {
        kind,
        direction: Direction::Out,
        value,
        seconds: 2.0,
    });
    for refuses in [false, true] {
        let mut emulator = Emulator::new(|_, _| {});
        emulator.refuses_faults = refuses;
        let (port, thread) = over_memory(emulator);
        let flown = computer(port, mission(2)).with_faults(faults.to_vec());
        let flown = crate::common::loops::run_and_print(flown);
        let emulator = thread.join().unwrap();
        // The run frees the emulator.
        assert_eq!(emulator.resets, 2);
        match flown {
            Ok(report) => {
                assert!(!refuses && report.frames == 2);
                assert_eq!(emulator.faults, faults.map(|fault| (fault, 0)));
            }
            Err(error) => {
                let says = "refuses the fault: no faults here";
                assert!(refuses && error.to_string().contains(says), "{error}");
                assert_eq!(emulator.attitudes.len(), 0);
            }
        }
    }
}
