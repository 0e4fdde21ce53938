//! Several links, each with its roles: attitudes on one, pixels and labels from others.

mod common;

use std::ops::ControlFlow;
use std::sync::mpsc::channel;
use std::thread::{JoinHandle, spawn};
use std::time::Duration;

use common::emulator::Emulator;
use common::loops::mission;
use common::lossy::Lossy;
use skyloop_firmware_sim::event::{Event, Loss};
use skyloop_firmware_sim::flight_computer::FlightComputer;
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::port::{ChannelPort, Port};
use skyloop_firmware_sim::report::Report;
use skyloop_firmware_sim::roles::Roles;
use skyloop_protocols::{Command, LabelLevel, Output, PixelLevel};

fn roles(text: &str) -> Roles {
    Roles::split(&format!("?roles={text}")).unwrap().1
}

/// A link's end in the emulator: how it sends there.
type Outlet = std::sync::mpsc::Sender<Vec<u8>>;

/// An emulator with several links: one small emulator each, which all see every attitude.
fn over_memory(
    names: &[&str],
    alter: impl Fn(usize, &mut Emulator),
) -> (Vec<(ChannelPort, Roles)>, JoinHandle<Vec<Emulator>>) {
    let (inlet, inbound) = channel::<(usize, Vec<u8>)>();
    let mut ends: Vec<(Emulator, Roles, Outlet)> = Vec::new();
    let mut ports = Vec::new();
    for (at, name) in names.iter().enumerate() {
        let roles = roles(name);
        let (outlet, from_emulator) = channel();
        let (to_emulator, packets) = channel::<Vec<u8>>();
        let inlet = inlet.clone();
        // Ends when the flight computer hangs up.
        spawn(move || {
            for packet in packets {
                let _ = inlet.send((at, packet));
            }
        });
        let mut emulator = Emulator::new(|_, _| {});
        emulator.brings = (roles.pixels, roles.labels);
        alter(at, &mut emulator);
        ends.push((emulator, roles, outlet));
        ports.push((ChannelPort::new(to_emulator, from_emulator), roles));
    }
    drop(inlet);
    let thread = spawn(move || {
        for (at, packet) in inbound {
            let (_, command) = Command::decode(&packet).unwrap();
            let everywhere = matches!(command, Command::Attitude(_));
            assert!(!everywhere || ends[at].1.truth, "an attitude off the truth");
            for (to, (emulator, roles, outlet)) in ends.iter_mut().enumerate() {
                let concerned = if everywhere {
                    roles.pixels || roles.labels
                } else {
                    to == at
                };
                if concerned {
                    for answer in emulator.answer(&packet) {
                        // The flight computer may have gone.
                        let _ = outlet.send(answer);
                    }
                }
            }
        }
        ends.into_iter().map(|(emulator, ..)| emulator).collect()
    });
    (ports, thread)
}

/// Flies; gives the report, and of each frame the number, pixels and label text.
fn fly<P: Port>(links: Vec<(P, Roles)>, mission: Mission) -> (Report, Vec<Seen>) {
    let mut seen = Vec::new();
    let report = FlightComputer::on_links(links, mission).run(|event| {
        match event {
            Event::Frame {
                frame,
                labels,
                detections,
                ..
            } => seen.push(Seen {
                attitude: frame.header.attitude_sequence,
                pixels: frame.pixels().to_vec(),
                text: labels.unwrap_or_default().to_string(),
                objects: frame.objects(detections).unwrap().len(),
            }),
            Event::Tick | Event::Progress => {}
            other => println!("{other:?}"),
        }
        ControlFlow::Continue(())
    });
    let report = report.unwrap();
    println!("{report}");
    (report, seen)
}

#[derive(Debug, PartialEq)]
struct Seen {
    attitude: u32,
    pixels: Vec<u16>,
    text: String,
    objects: usize,
}

#[test]
fn pixels_and_labels_of_a_frame_come_over_different_links() {
    let (port, thread) = common::loops::over_memory(Emulator::new(|_, _| {}));
    let (whole, expected) = fly(vec![(port, Roles::ALL)], mission(5));
    thread.join().unwrap();
    for names in [
        &["truth", "pixels", "labels"][..],
        &["truth+labels", "pixels"],
        &["labels", "pixels", "truth"],
        &["pixels+labels", "truth"],
    ] {
        let (links, thread) = over_memory(names, |_, _| {});
        let (report, seen) = fly(links, mission(5));
        assert_eq!(seen, expected, "{names:?}");
        assert_eq!((report.frames, report.lost, report.refused), (5, 0, 0));
        assert_eq!(report.totals.matched, whole.totals.matched);
        assert_eq!(report.missing_packets, 0);
        for emulator in thread.join().unwrap() {
            assert_eq!(
                emulator.resets, 2,
                "{names:?}: every link is opened and freed"
            );
        }
    }
}

#[test]
fn each_link_is_asked_for_its_share_of_the_output() {
    let output = Output {
        pixels: PixelLevel::Windows,
        labels: LabelLevel::Objects,
        ..Output::default()
    };
    let (links, thread) = over_memory(&["truth", "pixels", "labels"], |_, _| {});
    let wanted = Mission {
        output: Some(output),
        ..mission(3)
    };
    let (report, seen) = fly(links, wanted);
    assert_eq!((report.frames, report.contents.windows), (3, 60));
    assert!(seen.iter().all(|frame| frame.objects == 12), "{seen:?}");
    assert_eq!(report.totals.matched, 36);
    let asked: Vec<Output> = thread.join().unwrap().iter().map(|e| e.output).collect();
    assert_eq!(
        asked[0],
        Output::default(),
        "the truth's link brings no frames"
    );
    assert_eq!(
        (asked[1].pixels, asked[1].labels),
        (PixelLevel::Windows, LabelLevel::None)
    );
    assert_eq!(
        (asked[2].pixels, asked[2].labels),
        (PixelLevel::None, LabelLevel::Objects)
    );

    // Labels alone: the link for pixels brings nothing, and is not waited for.
    let (links, thread) = over_memory(&["truth+labels", "pixels"], |_, _| {});
    let wanted = Mission {
        output: Some(Output {
            pixels: PixelLevel::None,
            ..output
        }),
        ..mission(3)
    };
    let (report, _) = fly(links, wanted);
    assert_eq!((report.frames, report.contents.objects), (3, 36));
    thread.join().unwrap();
}

#[test]
fn frames_that_two_links_bring_count_once() {
    let (links, thread) = over_memory(&["truth+pixels+labels", "pixels+labels"], |_, _| {});
    let (report, seen) = fly(links, mission(5));
    assert_eq!((report.frames, seen.len(), report.late), (5, 5, 0));
    // The second copy of the last frame may be on its way at the end.
    assert!(report.recovery.duplicates >= 4, "{report}");
    thread.join().unwrap();
}

#[test]
fn a_part_that_does_not_come_loses_the_frame_and_no_other() {
    let (links, thread) = over_memory(&["truth", "pixels", "labels"], |at, emulator| {
        if at == 2 {
            emulator.resends = false;
            emulator.mischief = |attitude, packets| {
                if attitude == 1 {
                    packets.clear();
                }
            };
        }
    });
    let short = Mission {
        timeout: Duration::from_secs(1),
        ..mission(3)
    };
    let mut lost = Vec::new();
    let report = FlightComputer::on_links(links, short).run(|event| {
        if let Event::Lost { sequence, loss } = event {
            assert!(
                matches!(
                    loss,
                    Loss::TimedOut {
                        progress: Some(_),
                        cause: None
                    }
                ),
                "{loss:?}"
            );
            lost.push(sequence);
        }
        ControlFlow::Continue(())
    });
    let report = report.unwrap();
    assert_eq!((report.frames, report.lost, lost), (2, 1, vec![1]));
    assert!(report.assembly.incomplete >= 1);
    thread.join().unwrap();
}

#[test]
fn parts_of_different_skies_are_no_frame() {
    let (links, thread) = over_memory(&["truth", "pixels", "labels"], |at, emulator| {
        if at == 2 {
            emulator.field.background_e += 40.0;
        }
    });
    let short = Mission {
        timeout: Duration::from_secs(1),
        ..mission(2)
    };
    let report = FlightComputer::on_links(links, short)
        .run(|_| ControlFlow::Continue(()))
        .unwrap();
    assert_eq!((report.frames, report.lost), (0, 2));
    assert!(report.assembly.incomplete >= 2, "{:?}", report.assembly);
    thread.join().unwrap();
}

#[test]
fn a_part_of_which_nothing_came_is_asked_for_when_the_other_has_come() {
    let (links, thread) = over_memory(&["truth", "pixels", "labels"], |at, emulator| {
        if at == 2 {
            emulator.mischief = |attitude, packets| {
                if attitude == 1 {
                    packets.clear();
                }
            };
        }
    });
    let (report, seen) = fly(links, mission(3));
    thread.join().unwrap();
    assert_eq!((report.frames, report.lost, seen.len()), (3, 0, 3));
    assert!(report.recovery.asked >= 1, "{report}");
}

#[test]
fn every_link_mends_its_own_losses() {
    let (links, thread) = over_memory(&["truth", "pixels", "labels"], |_, _| {});
    let links = (1..)
        .zip(links)
        .map(|(seed, (port, roles))| (Lossy::new(port, seed, 0.05, 0.05), roles));
    let (report, _) = fly(links.collect(), mission(30));
    let ends = thread.join().unwrap();
    assert_eq!((report.frames, report.lost), (30, 0));
    assert!(ends[1].resent > 0 && ends[2].resent > 0);
    assert_eq!(ends[0].resent, 0);
}

#[test]
fn by_the_wall_clock_the_parts_find_each_other() {
    let (links, thread) = over_memory(&["truth", "pixels", "labels"], |_, _| {});
    let wall = Mission {
        pace: Pace::Wall { rate_hz: 20.0 },
        ..mission(10)
    };
    let (report, seen) = fly(links, wall);
    assert_eq!((report.frames, report.lost), (10, 0));
    assert!(
        seen.iter()
            .all(|frame| !frame.pixels.is_empty() && !frame.text.is_empty())
    );
    thread.join().unwrap();
}

#[test]
fn links_that_leave_a_role_out_are_refused() {
    for (names, part) in [
        (&["pixels", "labels"][..], "no link has the role truth"),
        (&["truth"], "no link has the role pixels or labels"),
        (&[], "no link has the role truth"),
    ] {
        let (links, thread) = over_memory(names, |_, _| {});
        let flown = FlightComputer::on_links(links, mission(1)).run(|_| ControlFlow::Continue(()));
        let error = flown.unwrap_err().to_string();
        assert!(
            error.contains(part) && error.contains("add it to the roles="),
            "{error}"
        );
        thread.join().unwrap();
    }
}

/// What is told of a run on links whose roles here are not the emulator's.
fn told(emulators: &[&str], ours: &[&str], output: Option<Output>) -> Vec<String> {
    let (links, thread) = over_memory(emulators, |_, _| {});
    let links = links.into_iter().zip(ours);
    let links = links.map(|((port, _), ours)| (port, roles(ours)));
    let short = Mission {
        timeout: Duration::from_millis(500),
        output,
        ..mission(1)
    };
    let mut told = Vec::new();
    let flown = FlightComputer::on_links(links.collect(), short).run(|event| {
        match event {
            Event::Lost { loss, .. } => told.push(loss.to_string()),
            Event::Problem(problem) => told.push(problem),
            _ => {}
        }
        ControlFlow::Continue(())
    });
    flown.unwrap();
    thread.join().unwrap();
    told
}

#[test]
fn roles_that_differ_at_both_ends_are_named_in_the_loss() {
    let lost = told(
        &["truth", "pixels+labels"],
        &["truth+pixels", "labels"],
        None,
    );
    assert!(
        lost[0].contains(
            "pixels come on a link (here roles=labels) and not on a link (here roles=truth+pixels)"
        ) && lost[0].contains("give a link roles=pixels+labels and a link roles=truth, or"),
        "{lost:?}"
    );
    // Where each link is told what to bring, the one that should bring the pixels brings nothing.
    let lost = told(
        &["truth", "pixels+labels"],
        &["truth+pixels", "labels"],
        Some(Output::default()),
    );
    let nothing = "nothing of a frame has come on a link (here roles=truth+pixels)";
    assert!(lost[0].contains(nothing), "{lost:?}");
    // Frames that are whole without their pixels.
    let problems = told(
        &["truth+pixels", "labels"],
        &["truth", "pixels+labels"],
        None,
    );
    assert!(
        problems[0].contains("pixels come on a link (here roles=truth) and not on"),
        "{problems:?}"
    );
}

#[test]
fn pixels_asked_for_that_no_link_brings_are_told_in_one_line() {
    let windows = Output {
        pixels: PixelLevel::Windows,
        labels: LabelLevel::Objects,
        ..Output::default()
    };
    // The roles here leave pixels out, or those of the emulator's end do, or none.
    for (ours, brings, warned) in [
        ("truth+labels", true, true),
        ("truth+pixels+labels", false, true),
        ("truth+pixels+labels", true, false),
    ] {
        let mut emulator = Emulator::new(|_, _| {});
        emulator.brings = (brings, true);
        let (port, thread) = common::loops::over_memory(emulator);
        let mission = Mission {
            output: Some(windows),
            ..mission(2)
        };
        let (report, _) = fly(vec![(port, roles(ours))], mission);
        thread.join().unwrap();
        assert_eq!(report.frames, 2);
        let line =
            format!("asked for windows, but no link brings pixels: here a link roles={ours}; ");
        let told = report
            .to_string()
            .lines()
            .filter(|text| text.contains(&line))
            .count();
        assert_eq!(told, usize::from(warned), "{report}");
    }
}
