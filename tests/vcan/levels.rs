//! What fits a bus: windows and objects of each frame, the same as over memory.

use crate::support::client::Client;
use crate::support::line::Line;
use crate::support::{EPOCH, attitude, on_memory, scene};
use crate::{CLASSIC, FD, VCAN0, VCAN1, client, emulator};
use skyloop::config::Clock;
use skyloop_protocols::{Command, FrameHeader, LabelLevel, Output, PixelLevel};
use std::time::{Duration, Instant};

type Parcel = (FrameHeader, Vec<Vec<u8>>);

/// Headers and packets of a few frames, and the shortest time from the first packet to the last.
fn frames(mut client: Client<impl Line>) -> (Vec<Parcel>, Duration) {
    let output = Output {
        pixels: PixelLevel::Windows,
        labels: LabelLevel::Objects,
        ..Output::default()
    };
    client.done(Command::Output(output));
    let mut shortest = Duration::MAX;
    let frames = (0..5).map(|sequence| {
        client.point(attitude(sequence), EPOCH);
        let first = client.next(true);
        client.put_back(first);
        let begin = Instant::now();
        let parcel = client.parcel();
        shortest = shortest.min(begin.elapsed());
        parcel
    });
    (frames.collect(), shortest)
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn windows_and_objects_over_can_equal_those_over_memory() {
    let (_memory, line) = on_memory(scene(), Clock::Stepped);
    let (expected, _) = frames(Client::new(line));
    for (interface, rates) in [(VCAN1, CLASSIC), (VCAN0, CLASSIC), (VCAN0, FD)] {
        let emulator = emulator(interface, rates);
        let (got, took) = frames(client(interface, rates));
        assert!(got == expected, "{interface} {rates}");
        let octets: usize = got[0].1.iter().map(Vec::len).sum();
        println!("{octets} octets of windows and objects in {took:.1?} at {rates}");
        let counters = emulator.end();
        assert_eq!(
            (
                counters.incomplete,
                counters.sequence_gaps,
                counters.lost_outbound
            ),
            (0, 0, 0)
        );
    }
}
