//! Several links, each with its roles: attitudes on one, pixels and labels from others.

use std::ops::ControlFlow;
use std::sync::mpsc::{Sender, channel};
use std::thread::{JoinHandle, spawn};
use std::time::Duration;

use crate::common::emulator::Emulator;
use crate::common::loops::{ChannelPort, by_wall, mission, on_links, within};
use crate::common::lossy::Lossy;
use skyloop_firmware_sim::event::{Event, Loss};
use skyloop_firmware_sim::mission::Mission;
use skyloop_firmware_sim::port::Port;
use skyloop_firmware_sim::report::Report;
use skyloop_firmware_sim::roles::Roles;
use skyloop_protocols::{Command, LabelLevel, Output, PixelLevel};

type Links = Vec<(ChannelPort, Roles)>;

fn roles(text: &str) -> Roles {
    Roles::parse(text).unwrap()
}

/// An emulator with several links: one small emulator each, which all see every attitude.
fn over_memory(
    names: &[&str],
    alter: impl Fn(usize, &mut Emulator),
) -> (Links, JoinHandle<Vec<Emulator>>) {
    let (inlet, inbound) = channel::<(usize, Vec<u8>)>();
    let mut ends: Vec<(Emulator, Roles, Sender<Vec<u8>>)> = Vec::new();
    let mut ports = Vec::new();
    for (at, name) in names.iter().enumerate() {
        let roles = roles(name);
        let (port, packets, outlet) = ChannelPort::new();
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
        ports.push((port, roles));
    }
    drop(inlet);
    let thread = spawn(move || {
        for (at, packet) in inbound {
            let (_, command) = Command::decode(&packet).unwrap();
            let everywhere = matches!(command, Command::Attitude(_));
            assert!(!everywhere || ends[at].1.truth, "an attitude off the truth");
            for (to, (emulator, roles, outlet)) in ends.iter_mut().enumerate() {
                let concerned = if everywhere {
                    roles.bring_frames()
                } else {
                    to == at
                };
                let answers = concerned.then(|| emulator.answer(&packet));
                for answer in answers.into_iter().flatten() {
                    // The flight computer may have gone.
                    let _ = outlet.send(answer);
                }
            }
        }
        ends.into_iter().map(|(emulator, ..)| emulator).collect()
    });
    (ports, thread)
}

/// On links for truth, pixels and labels.
const THREE: &[&str] = &["truth", "pixels", "labels"];

/// What is seen of a frame: number of the attitude, pixels, label text, number of objects.
type Seen = (u32, Vec<u16>, String, usize);

/// Flies; gives the report and what is seen of each frame.
fn fly<P: Port + Send + 'static>(links: Vec<(P, Roles)>, mission: Mission) -> (Report, Vec<Seen>) {
    let mut seen = Vec::new();
    let report = on_links(links, mission).run(|event| {
        match event {
            Event::Frame {
                frame,
                labels,
                detections,
                ..
            } => seen.push((
                frame.header.attitude_sequence,
                frame.pixels().to_vec(),
                labels.unwrap_or_default().to_string(),
                frame.objects(detections).unwrap().len(),
            )),
            Event::Tick | Event::Progress => {}
            other => println!("{other:?}"),
        }
        ControlFlow::Continue(())
    });
    let report = report.unwrap();
    println!("{report}");
    (report, seen)
}

const WINDOWS: Output = Output {
    pixels: PixelLevel::Windows,
    labels: LabelLevel::Objects,
    window_size: 11,
    windows: 20,
    objects: 12,
};

fn asking(output: Output, frames: u32) -> Mission {
    Mission {
        output: Some(output),
        ..mission(frames)
    }
}

#[test]
fn pixels_and_labels_of_a_frame_come_over_different_links() {
    let (port, thread) = crate::common::loops::over_memory(Emulator::new(|_, _| {}));
    let (whole, expected) = fly(vec![(port, Roles::ALL)], mission(5));
    thread.join().unwrap();
    for names in [
        THREE,
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
            let opened_and_freed = 2;
            assert_eq!(emulator.resets, opened_and_freed, "{names:?}");
        }
    }
}

#[test]
fn each_link_is_asked_for_its_share_of_the_output() {
    let (links, thread) = over_memory(THREE, |_, _| {});
    let (report, seen) = fly(links, asking(WINDOWS, 3));
    assert_eq!((report.frames, report.contents.windows), (3, 60));
    assert!(seen.iter().all(|frame| frame.3 == 12), "{seen:?}");
    assert_eq!(report.totals.matched, 36);
    let requested: Vec<Output> = thread.join().unwrap().iter().map(|e| e.output).collect();
    // The truth's link brings no frames.
    let pixels = Output {
        labels: LabelLevel::None,
        ..WINDOWS
    };
    let labels = Output {
        pixels: PixelLevel::None,
        ..WINDOWS
    };
    assert_eq!(requested, [Output::default(), pixels, labels]);

    // Labels alone: the link for pixels brings nothing, and is not waited for.
    let (links, thread) = over_memory(&["truth+labels", "pixels"], |_, _| {});
    let (report, _) = fly(links, asking(labels, 3));
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

/// The labels of attitude 1 do not come.
fn without_labels(at: usize, emulator: &mut Emulator) {
    if at == 2 {
        emulator.mischief = |attitude, packets| {
            if attitude == 1 {
                packets.clear();
            }
        };
    }
}

#[test]
fn a_part_that_does_not_come_loses_the_frame_and_no_other() {
    let (links, thread) = over_memory(THREE, |at, emulator| {
        without_labels(at, emulator);
        emulator.resends = at != 2;
    });
    let mut lost = Vec::new();
    let report = on_links(links, within(Duration::from_secs(1), 3)).run(|event| {
        if let Event::Lost { sequence, loss } = event {
            let Loss::TimedOut { progress, cause } = loss else {
                panic!("{loss:?}");
            };
            assert!(progress.is_some() && cause.is_none(), "{cause:?}");
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
    let (links, thread) = over_memory(THREE, |at, emulator| {
        emulator.field.background_e += f64::from(u8::from(at == 2)) * 40.0;
    });
    let (report, _) = fly(links, within(Duration::from_secs(1), 2));
    assert_eq!((report.frames, report.lost), (0, 2));
    assert!(report.assembly.incomplete >= 2, "{:?}", report.assembly);
    thread.join().unwrap();
}

#[test]
fn a_part_of_which_nothing_came_is_asked_for_when_the_other_has_come() {
    let (links, thread) = over_memory(THREE, without_labels);
    let (report, seen) = fly(links, mission(3));
    thread.join().unwrap();
    assert_eq!((report.frames, report.lost, seen.len()), (3, 0, 3));
    assert!(report.recovery.requested >= 1, "{report}");
}

#[test]
fn every_link_mends_its_own_losses() {
    let (links, thread) = over_memory(THREE, |_, _| {});
    let links = (1..).zip(links);
    let links =
        links.map(|(seed, (port, roles))| (Lossy::new(port, seed, [0.05, 0.05, 0.0]), roles));
    let (report, _) = fly(links.collect(), mission(30));
    let ends = thread.join().unwrap();
    assert_eq!((report.frames, report.lost), (30, 0));
    assert!(ends[1].resent > 0 && ends[2].resent > 0);
    assert_eq!(ends[0].resent, 0);
}

#[test]
fn by_the_wall_clock_the_parts_find_each_other() {
    let (links, thread) = over_memory(THREE, |_, _| {});
    let (report, seen) = fly(links, by_wall(20.0, 10));
    assert_eq!((report.frames, report.lost), (10, 0));
    let whole = |(_, pixels, text, _): &Seen| !pixels.is_empty() && !text.is_empty();
    assert!(seen.iter().all(whole));
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
        let flown = crate::common::loops::fly(on_links(links, mission(1)));
        let error = flown.unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
        assert!(error.contains("add it to the roles="), "{error}");
        thread.join().unwrap();
    }
}

#[test]
fn roles_that_differ_at_both_ends_are_named_in_the_loss() {
    let apart = (["truth", "pixels+labels"], ["truth+pixels", "labels"]);
    for ((emulators, ours), output, parts) in [
        (
            apart,
            None,
            [
                "pixels come on a link (here roles=labels) and not on a link (here roles=truth+pixels)",
                "give a link roles=pixels+labels and a link roles=truth, or",
            ],
        ),
        // Where each link is told what to bring, the one that should bring the pixels brings nothing.
        (
            apart,
            Some(Output::default()),
            ["nothing of a frame has come on a link (here roles=truth+pixels)"; 2],
        ),
        // Frames that are whole without their pixels.
        (
            (apart.1, apart.0),
            None,
            ["pixels come on a link (here roles=truth) and not on"; 2],
        ),
    ] {
        let (links, thread) = over_memory(&emulators, |_, _| {});
        let links = links.into_iter().zip(ours);
        let links = links.map(|((port, _), ours)| (port, roles(ours)));
        let short = Mission {
            output,
            ..within(Duration::from_millis(500), 1)
        };
        let mut told = Vec::new();
        let flown = on_links(links.collect(), short).run(|event| {
            match event {
                Event::Lost { loss, .. } => told.push(loss.to_string()),
                Event::Problem(problem) => told.push(problem),
                _ => {}
            }
            ControlFlow::Continue(())
        });
        flown.unwrap();
        thread.join().unwrap();
        for part in parts {
            assert!(told[0].contains(part), "{told:?}");
        }
    }
}

#[test]
fn pixels_asked_for_that_no_link_brings_are_told_in_one_line() {
    // The roles here leave pixels out, or those of the emulator's end do, or none.
    for (ours, brings, warned) in [
        ("truth+labels", true, true),
        ("truth+pixels+labels", false, true),
        ("truth+pixels+labels", true, false),
    ] {
        let mut emulator = Emulator::new(|_, _| {});
        emulator.brings = (brings, true);
        let (port, thread) = crate::common::loops::over_memory(emulator);
        let (report, _) = fly(vec![(port, roles(ours))], asking(WINDOWS, 2));
        thread.join().unwrap();
        assert_eq!(report.frames, 2);
        let line = "asked for windows, but no link brings pixels: here a link roles=";
        let line = format!("{line}{ours}; ");
        let told = report.to_string().matches(&line).count();
        assert_eq!(told, usize::from(warned), "{report}");
    }
}
