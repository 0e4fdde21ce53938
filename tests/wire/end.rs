//! End of a run: packets in flight are sent or counted.

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
fn packets_never_read_are_counted_as_lost() {
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
        // A client that does not read gets no Status. A run that has not started has no metrics.
        await_that("the Pings are received", || {
            std::thread::sleep(Duration::from_millis(20));
            let commands = fetched(metrics.address()).remove("skyloop_commands_total");
            commands == Some(f64::from(round * AT_ONCE))
        });
    }
    let counters = emulator.end();
    counted(&counters, &[("commands", PINGS), ("overflows", 0)]);
    // Two replies each, 256 in the queue and 1024 behind it (ICD, 5.2). All are lost at the end
    // except some 20 KiB in the pseudo-terminal, 250 replies at most.
    let replies = 2 * PINGS;
    let lost = counters.lost_outbound;
    assert!((replies - 250..replies).contains(&lost), "{lost}");
}

#[test]
fn packets_read_at_the_end_are_not_lost() {
    let (emulator, mut client) = serial_client(quick(1.0), Clock::Stepped);
    client.window = None;
    client.send(Command::Attitude(attitude(0)));
    // Some 40 kB in the link's queue, 20 of them in the pseudo-terminal.
    emulator.exposed();
    let ending = std::thread::spawn(move || emulator.end());
    std::thread::sleep(Duration::from_millis(300));
    client.frame();
    assert_eq!(ending.join().unwrap().lost_outbound, 0);
}

/// An outbox that accepts this number of packets and then ends, unnoticed by the inbox.
struct EndsAfter(usize);

impl Outbox for EndsAfter {
    fn offer(&mut self, _: Outbound) -> Result<Option<Outbound>, LinkError> {
        let left = self.0.checked_sub(1);
        self.0 = left.ok_or_else(|| LinkError::Closed("memory".to_string()))?;
        Ok(None)
    }
}

#[test]
fn links_that_end_during_a_send_end_the_run() {
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
