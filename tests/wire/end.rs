//! The end of a run: what is under way is sent or counted.

use crate::support::client::{Client, counted};
use crate::support::line::{MemoryLine, PtyLine};
use crate::support::{
    attitude, await_that, fetched, options, quick, scene, serial_client, with_metrics,
};
use skyloop::config::Clock;
use skyloop::engine::Emulator;
use skyloop::link::{self, LinkError, Outbound, Outbox, Roles};
use skyloop::serve::{Ended, Server};
use skyloop_protocols::Command;
use skyloop_protocols::personality::NATIVE;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

#[test]
fn what_a_client_never_reads_is_lost_and_counted() {
    const PINGS: u32 = 640;
    // The inbound queue holds 256.
    const AT_ONCE: u32 = 128;
    let (line, device) = PtyLine::new();
    let wire = link::open(&format!("serial://{device}?baud=921600"), &options(5.0)).unwrap();
    let (emulator, metrics) = with_metrics(scene(), Clock::Stepped, wire);
    let mut client = Client::new(line);
    for round in 1..=PINGS / AT_ONCE {
        for _ in 0..AT_ONCE {
            client.send(Command::Ping);
        }
        // Nothing can be asked of a client that does not read. A run that has not begun has no
        // metrics.
        await_that("they are received", || {
            std::thread::sleep(Duration::from_millis(20));
            let commands = fetched(metrics.address()).remove("skyloop_commands_total");
            commands == Some(f64::from(round * AT_ONCE))
        });
    }
    let counters = emulator.end();
    counted(&counters, &[("commands", PINGS), ("overflows", 0)]);
    // Two answers each, 256 in the queue and 1024 behind it (ICD, 5.2): all of these are lost at the
    // end but for the some 20 KiB that the pseudo-terminal takes, 250 answers at most.
    let answers = 2 * PINGS;
    let lost = counters.lost_outbound;
    assert!((answers - 250..answers).contains(&lost), "{lost}");
}

#[test]
fn what_a_client_reads_at_last_is_not_lost() {
    let (emulator, mut client) = serial_client(quick(1.0), Clock::Stepped);
    client.window = None;
    client.send(Command::Attitude(attitude(0)));
    // Some 40 kB in the link's queue, of which the pseudo-terminal swallows 20.
    emulator.exposed();
    let ending = std::thread::spawn(move || emulator.end());
    std::thread::sleep(Duration::from_millis(300));
    client.frame();
    assert_eq!(ending.join().unwrap().lost_outbound, 0);
}

/// A way out that takes so many packets, and then has ended; the way in never says so.
struct EndsAfter(usize);

impl Outbox for EndsAfter {
    fn offer(&mut self, _: Outbound) -> Result<Option<Outbound>, LinkError> {
        let left = self.0.checked_sub(1);
        self.0 = left.ok_or_else(|| LinkError::Closed("memory".to_string()))?;
        Ok(None)
    }
}

#[test]
fn a_link_that_ends_while_something_is_sent_ends_the_run_like_any_other() {
    // The acknowledgement of the credit, the frame's header, a packet in its middle.
    for packets in [0, 1, 20] {
        let mut config = scene();
        let (mut wire, port) = link::loopback("memory", &options(5.0)).unwrap();
        wire.outbox = Box::new(EndsAfter(packets));
        let (links, output) = ([(wire, Roles::ALL)], config.run.output);
        let emulator = Emulator::new(&mut config);
        let mut server = Server::new(emulator, links, output, Clock::Stepped, &NATIVE);
        let mut client = Client::new(MemoryLine(port));
        client.send(Command::Credit { packets: 100 });
        client.send(Command::Attitude(attitude(1)));
        let ended = server.run(&AtomicBool::new(false), None, |_| ());
        assert_eq!(ended, Ended::LinkGone, "after {packets} packets");
        assert_eq!(server.gone(), Some("memory"));
        let counters = server.counters();
        assert_eq!(counters.frames_delivered, 0);
        assert_eq!(counters.frames_abandoned, counters.frames_rendered);
    }
}
