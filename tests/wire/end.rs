//! The end of a run: what is under way is sent or counted.

use crate::support::client::Client;
use crate::support::{attitude, await_that, on_memory, on_serial, scene};
use skyloop::config::Clock;
use skyloop_protocols::Command;
use std::time::Duration;

#[test]
fn attitudes_that_wait_are_abandoned() {
    let (emulator, line) = on_memory(scene(), Clock::Stepped);
    let mut client = Client::new(line);
    client.send(Command::Credit { packets: 0 });
    for sequence in 0..6 {
        client.send(Command::Attitude(attitude(sequence)));
    }
    await_that("they have come", || client.status().counters.attitudes == 6);
    let counters = emulator.end();
    // The frame under way, and five that were never made.
    assert_eq!(counters.frames_abandoned, 6);
    assert_eq!(counters.frames_rendered, 1);
}

#[test]
fn what_a_client_never_reads_is_lost_and_counted() {
    let (emulator, line) = on_serial(scene(), Clock::Stepped);
    let mut client = Client::new(line);
    const PINGS: u32 = 640;
    for _ in 0..PINGS / 20 {
        for _ in 0..20 {
            client.send(Command::Ping);
        }
        // The inbound queue holds 256: a busy machine may pause for half a second.
        std::thread::sleep(Duration::from_millis(40));
    }
    // Nothing can be asked of a client that does not read.
    std::thread::sleep(Duration::from_secs(1));
    let counters = emulator.end();
    assert_eq!((counters.commands, counters.overflows), (PINGS, 0));
    // Two answers each, 256 in the queue and 1024 behind it (ICD, 5.2): all of these are lost at the end but for
    // the some 20 KiB that the pseudo-terminal swallows, 250 answers at most.
    let answers = 2 * PINGS;
    assert!(
        (answers - 250..answers).contains(&counters.lost_outbound),
        "{counters:?}"
    );
}

#[test]
fn what_a_client_reads_at_last_is_not_lost() {
    let mut config = scene();
    (config.camera.detector.width, config.camera.detector.height) = (64, 64);
    let (emulator, line) = on_serial(config, Clock::Stepped);
    let mut client = Client::new(line);
    client.window = None;
    client.send(Command::Attitude(attitude(0)));
    // Some 40 kB in the link's queue, of which the pseudo-terminal swallows 20.
    emulator.shot();
    let ending = std::thread::spawn(move || emulator.end());
    std::thread::sleep(Duration::from_millis(300));
    client.frame();
    assert_eq!(ending.join().unwrap().lost_outbound, 0);
}
