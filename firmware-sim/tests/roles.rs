//! Several links with their roles: attitudes on one, pixels and labels on others.

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

/// An emulator with several links, as one small emulator each; all receive every attitude.
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
        // Ends when the flight computer drops its port.
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
                    // The flight computer may have ended.
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

/// Content of a frame: attitude number, pixels, label text, number of objects.
type Seen = (u32, Vec<u16>, String, usize);

/// Runs a mission. Returns the report, the content of each frame, and the result of the thread.
fn run<P: Port + Send + 'static, T>(
    (links, thread): (Vec<(P, Roles)>, JoinHandle<T>),
    mission: Mission,
) -> (Report, Vec<Seen>, T) {
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
    (report, seen, thread.join().unwrap())
}

const WINDOWS: Output = Output {
    pixels: PixelLevel::Windows,
    labels: LabelLevel::Objects,
    window_size: 11,
    windows: 20,
    objects: 12,
};

fn with_output(output: Output, frames: u32) -> Mission {
    Mission {
        output: Some(output),
        ..mission(frames)
    }
}

#[test]
fn pixels_and_labels_of_a_frame_come_over_different_links() {
    let (port, thread) = crate::common::loops::over_memory(Emulator::new(|_, _| {}));
    let (whole, expected, _) = run((vec![(port, Roles::ALL)], thread), mission(5));
    for names in [
        THREE,
        &["truth+labels", "pixels"],
        &["labels", "pixels", "truth"],
        &["pixels+labels", "truth"],
    ] {
        let (report, seen, emulators) = run(over_memory(names, |_, _| {}), mission(5));
        assert_eq!(seen, expected, "{names:?}");
        assert_eq!((report.frames, report.lost, report.refused), (5, 0, 0));
        assert_eq!(report.totals.matched, whole.totals.matched);
        assert_eq!(report.missing_packets, 0);
        // Each exchange is opened and freed by a Reset.
        let are_reset = emulators.iter().all(|emulator| emulator.resets == 2);
        assert!(are_reset, "{names:?}");
    }
}

#[test]
fn each_link_gets_its_share_of_the_output() {
    let links = over_memory(THREE, |_, _| {});
    let (report, seen, emulators) = run(links, with_output(WINDOWS, 3));
    assert_eq!((report.frames, report.contents.windows), (3, 60));
    assert!(seen.iter().all(|frame| frame.3 == 12), "{seen:?}");
    assert_eq!(report.totals.matched, 36);
    let requested: Vec<Output> = emulators.iter().map(|emulator| emulator.output).collect();
    // The truth link carries no frames.
    let pixels = Output {
        labels: LabelLevel::None,
        ..WINDOWS
    };
    let labels = Output {
        pixels: PixelLevel::None,
        ..WINDOWS
    };
    assert_eq!(requested, [Output::default(), pixels, labels]);

    // Labels alone: the pixel link carries nothing, and frames do not wait for it.
    let links = over_memory(&["truth+labels", "pixels"], |_, _| {});
    let (report, ..) = run(links, with_output(labels, 3));
    assert_eq!((report.frames, report.contents.objects), (3, 36));
}

#[test]
fn duplicate_frames_of_two_links_count_once() {
    let links = over_memory(&["truth+pixels+labels", "pixels+labels"], |_, _| {});
    let (report, seen, _) = run(links, mission(5));
    assert_eq!((report.frames, seen.len(), report.late), (5, 5, 0));
    // The duplicate of the last frame may be in flight at the end.
    assert!(report.recovery.duplicates >= 4, "{report}");
}

/// Drops the labels of attitude 1.
fn without_labels(at: usize, emulator: &mut Emulator) {
    if at == 2 {
        emulator.alter = |attitude, packets| {
            if attitude == 1 {
                packets.clear();
            }
        };
    }
}

#[test]
fn a_missing_part_loses_only_its_frame() {
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
fn parts_with_different_pixels_are_not_joined() {
    let links = over_memory(THREE, |at, emulator| {
        emulator.field.background_e += f64::from(u8::from(at == 2)) * 40.0;
    });
    let (report, ..) = run(links, within(Duration::from_secs(1), 2));
    assert_eq!((report.frames, report.lost), (0, 2));
    assert!(report.assembly.incomplete >= 2, "{:?}", report.assembly);
}

#[test]
fn missing_parts_are_requested_after_the_other_part() {
    let (report, seen, _) = run(over_memory(THREE, without_labels), mission(3));
    assert_eq!((report.frames, report.lost, seen.len()), (3, 0, 3));
    assert!(report.recovery.requested >= 1, "{report}");
}

#[test]
fn each_link_recovers_its_losses() {
    let (links, thread) = over_memory(THREE, |_, _| {});
    let links = (1..).zip(links);
    let links =
        links.map(|(seed, (port, roles))| (Lossy::new(port, seed, [0.05, 0.05, 0.0]), roles));
    let (report, _, ends) = run((links.collect(), thread), mission(30));
    assert_eq!((report.frames, report.lost), (30, 0));
    assert!(ends[1].resent > 0 && ends[2].resent > 0);
    assert_eq!(ends[0].resent, 0);
}

#[test]
fn wall_clock_parts_are_joined() {
    let (report, seen, _) = run(over_memory(THREE, |_, _| {}), by_wall(20.0, 10));
    assert_eq!((report.frames, report.lost), (10, 0));
    let whole = |(_, pixels, text, _): &Seen| !pixels.is_empty() && !text.is_empty();
    assert!(seen.iter().all(whole));
}

#[test]
fn links_without_a_role_are_refused() {
    for (names, part) in [
        (&["pixels", "labels"][..], "no link has the role truth"),
        (&["truth"], "no link has the role pixels or labels"),
        (&[], "no link has the role truth"),
    ] {
        let (links, thread) = over_memory(names, |_, _| {});
        let result = crate::common::loops::run_and_print(on_links(links, mission(1)));
        let error = result.unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
        assert!(error.contains("add it to the roles="), "{error}");
        thread.join().unwrap();
    }
}

#[test]
fn losses_name_roles_that_differ_between_ends() {
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
        // With an explicit output for each link, the pixel link carries nothing.
        (
            apart,
            Some(Output::default()),
            ["nothing of a frame has come on a link (here roles=truth+pixels)"; 2],
        ),
        // Frames complete without their pixels.
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
        let mut events = Vec::new();
        let result = on_links(links.collect(), short).run(|event| {
            match event {
                Event::Lost { loss, .. } => events.push(loss.to_string()),
                Event::Problem(problem) => events.push(problem),
                _ => {}
            }
            ControlFlow::Continue(())
        });
        result.unwrap();
        thread.join().unwrap();
        for part in parts {
            assert!(events[0].contains(part), "{events:?}");
        }
    }
}

#[test]
fn requested_pixels_without_a_link_give_one_warning() {
    // Pixels are missing in the roles of this end, of the emulator's end, or not.
    for (ours, brings, warned) in [
        ("truth+labels", true, true),
        ("truth+pixels+labels", false, true),
        ("truth+pixels+labels", true, false),
    ] {
        let mut emulator = Emulator::new(|_, _| {});
        emulator.brings = (brings, true);
        let (port, thread) = crate::common::loops::over_memory(emulator);
        let links = vec![(port, roles(ours))];
        let (report, ..) = run((links, thread), with_output(WINDOWS, 2));
        assert_eq!(report.frames, 2);
        let line = "windows are requested, but no link carries pixels: here a link roles=";
        let line = format!("{line}{ours}; ");
        let lines = report.to_string().matches(&line).count();
        assert_eq!(lines, usize::from(warned), "{report}");
    }
}
