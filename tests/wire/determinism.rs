//! The same seed and inputs give the same pixels and labels, whatever carries and computes them.


use crate::fixtures::Frames;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use skyloop::config::{Clock, Config};
use skyloop::engine::Emulator;
use skyloop::flight;
use skyloop::link::{self, LINKS, Options, Roles};
use skyloop::serve::Server;
use skyloop_firmware_sim::event::Event;
use skyloop_firmware_sim::flight_computer::FlightComputer;
use skyloop_protocols::personality::NATIVE;

const FRAMES: u32 = 3;

/// Pixels and label text of a frame.
type Seen = (Vec<u16>, String);

/// The built-in scene, turning, with every correction, through `camera`.
fn config(camera: &str) -> Config {
    let mut config = Config::builtin().unwrap();
    config.camera = crate::fixtures::camera(camera);
    config.sky.corrections = skyloop::sky::Corrections::default();
    if let Some(sequence) = &mut config.sequence {
        sequence.frames = FRAMES;
    }
    config
}

fn offline(camera: &str) -> Vec<Seen> {
    let mut frames = Frames::of(config(camera));
    let shots = (0..FRAMES).map(|number| frames.shoot(number));
    shots
        .map(|shot| (shot.frame.digits, shot.json.to_string()))
        .collect()
}

/// What a flight computer receives over `scheme`, and how often it lost its patience and sent an attitude again.
fn over(scheme: &str, camera: &str) -> (Vec<Seen>, u64) {
    let mut config = config(camera);
    let mission = flight::mission(&config).unwrap();
    let options = Options {
        idle: Duration::from_secs(5),
        personality: &NATIVE,
        bus: None,
    };
    let (wire, port) = link::loopback(scheme, &options).unwrap();
    let (links, output) = ([(wire, Roles::ALL)], config.run.output);
    let emulator = Emulator::new(&mut config);
    let mut server = Server::new(emulator, links, output, Clock::Stepped, &NATIVE);
    let stop = AtomicBool::new(false);
    let (mut seen, mut again) = (Vec::new(), 0);
    std::thread::scope(|scope| {
        let serving = scope.spawn(|| server.run(&stop, None, |_| ()));
        let report = FlightComputer::new(port, mission).run(|event| {
            match event {
                Event::Frame { frame, labels, .. } => {
                    let labels = labels.unwrap_or_default().to_string();
                    seen.push((frame.pixels().to_vec(), labels));
                }
                other => println!("{scheme}: {other:?}"),
            }
            ControlFlow::Continue(())
        });
        stop.store(true, Ordering::Relaxed);
        assert_ne!(serving.join().unwrap(), skyloop::serve::Ended::Panicked);
        let report = report.unwrap();
        assert_eq!(report.frames, FRAMES, "{scheme}");
        again = report.recovery.attitudes;
    });
    (seen, again)
}

/// A label without the frame's number: of an attitude that came twice there are two frames, which differ in that alone.
fn without_number(label: &str) -> &str {
    let found = label.split_once(",\"seed\":");
    found.map_or(label, |(_, rest)| rest)
}

#[test]
fn every_link_carries_what_is_rendered_offline() {
    // The kernel that `tests/vcan/run` boots has CAN; this one need not.
    let links = LINKS.iter().map(|link| link.scheme);
    let links: Vec<&str> = links.filter(|scheme| *scheme != "can").collect();
    // A frame of the second takes seconds on a slow line.
    for (camera, schemes) in [
        ("fai-nir", &links[..]),
        ("cmos-rolling", &["memory", "udp"]),
    ] {
        let expected = offline(camera);
        for scheme in schemes {
            let (received, again) = over(scheme, camera);
            for (number, (a, b)) in received.iter().zip(&expected).enumerate() {
                let [a_label, b_label] = [a, b].map(|(_, label)| match again {
                    0 => label,
                    _ => without_number(label),
                });
                let what = format!("frame {number} of {camera} over {scheme}");
                assert_eq!(a_label, b_label, "label of {what}");
                assert!(a.0 == b.0, "pixels of {what}");
            }
            assert_eq!(received.len(), expected.len());
        }
    }
}
