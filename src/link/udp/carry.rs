//! The socket's two ways, which one thread carries side by side: what comes is stamped and handed on while what leaves waits for room.

use super::exchange::Exchange;
use crate::link::pace::Pace;
use crate::link::{Inbound, Intake, Outbound, count};
use bytes::Bytes;
use skyloop_firmware_sim::burst::Burst;
use skyloop_firmware_sim::datagram::{Datagram, Datagrams};
use std::cell::RefCell;
use std::io;
use std::net::UdpSocket as SystemSocket;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use tokio::io::Interest;
use tokio::net::UdpSocket;
use tokio::sync::mpsc::Receiver;

/// What a limited link may catch up at once, after a timer that came late: timers here go by milliseconds.
pub(super) const BURST: Duration = Duration::from_millis(5);
/// Datagrams that are taken in a row.
const IN_A_ROW: u64 = 16;
/// Packets that are taken from the queue at a time.
const TOGETHER: usize = 64;

/// Carries packets until the emulator drops its end; `limit` octets a second leave at most.
pub(super) async fn carry(
    socket: SystemSocket,
    datagrams: Datagrams,
    arrivals: Intake,
    departures: Receiver<Outbound>,
    exchange: Exchange,
    limit: Option<f64>,
) -> io::Result<()> {
    let way_out = WayOut {
        sending: socket.try_clone()?,
        socket: &UdpSocket::from_std(socket)?,
        exchange: &RefCell::new(exchange),
        burst: Burst::default(),
    };
    let come = receive(way_out.socket, datagrams, arrivals, way_out.exchange);
    tokio::select! {
        () = come => {}
        () = send(way_out, departures, limit) => {}
    }
    Ok(())
}

/// Hands on what comes from the exchange's client, until nobody takes it.
async fn receive(
    socket: &UdpSocket,
    mut datagrams: Datagrams,
    arrivals: Intake,
    exchange: &RefCell<Exchange>,
) {
    // Longer than any packet: a longer datagram is refused for its length.
    let mut buffer = vec![0; 1 << 16];
    for datagram in 1_u64.. {
        // What leaves is not to wait for a flood's end.
        if datagram.is_multiple_of(IN_A_ROW) {
            tokio::task::yield_now().await;
        }
        let received = socket.async_io(Interest::READABLE, || datagrams.receive(&mut buffer));
        // An error here answers an earlier datagram to a client that has gone.
        let Ok(Datagram {
            length, from, lost, ..
        }) = received.await
        else {
            continue;
        };
        let (packet, arrived) = (&buffer[..length], Instant::now());
        let mut exchange = exchange.borrow_mut();
        exchange.tally.dropped.fetch_add(lost, Ordering::Relaxed);
        if !exchange.admit(from, packet, arrived) {
            exchange.ignore(from);
            continue;
        }
        let inbound = Inbound {
            exchange: exchange.number,
            packet: Bytes::copy_from_slice(packet),
            arrived,
        };
        if arrivals.push(inbound).is_err() {
            return;
        }
    }
}

/// Sends what is queued, until nothing can come any more.
async fn send(mut out: WayOut<'_>, mut departures: Receiver<Outbound>, limit: Option<f64>) {
    let mut pace = limit.map(|octets_per_s| Pace::new(octets_per_s, BURST));
    // Where a limit says when the next may leave, they go one by one.
    let most = if pace.is_some() { 1 } else { TOGETHER };
    let mut taken = Vec::with_capacity(most);
    while departures.recv_many(&mut taken, most).await > 0 {
        let (mut batch, mut octets) = (Batch::default(), 0);
        for departure in taken.drain(..) {
            match departure {
                Outbound::Release { exchange, asked } => {
                    octets += out.send(&mut batch).await;
                    out.exchange.borrow_mut().release(exchange, asked);
                }
                Outbound::Packet { exchange, packet } => {
                    if batch.exchange != exchange {
                        octets += out.send(&mut batch).await;
                    }
                    batch.exchange = exchange;
                    batch.packets.push(packet);
                }
            }
        }
        octets += out.send(&mut batch).await;
        let now = Instant::now();
        let free = pace.as_mut().filter(|_| octets > 0);
        match free.map(|pace| pace.pass(octets, now)) {
            Some(free) if free > now => tokio::time::sleep_until(free.into()).await,
            // A line that is behind its time catches up.
            Some(_) => {}
            // What has come meanwhile is not to wait for all that is queued.
            None => tokio::task::yield_now().await,
        }
    }
}

/// Packets of one exchange, in order.
#[derive(Default)]
struct Batch {
    exchange: u32,
    packets: Vec<Bytes>,
}

/// From the queue to the exchange's client.
struct WayOut<'a> {
    socket: &'a UdpSocket,
    /// The same socket, as calls take it that send several datagrams.
    sending: SystemSocket,
    exchange: &'a RefCell<Exchange>,
    burst: Burst,
}

impl WayOut<'_> {
    /// Sends what there is, if its exchange still stands; what the system refuses is lost, and counted. The octets that have left.
    async fn send(&mut self, batch: &mut Batch) -> usize {
        let tally = self.exchange.borrow().tally.clone();
        let (mut at, mut octets) = (0, 0);
        while let Some(rest) = batch.packets.get(at..).filter(|rest| !rest.is_empty()) {
            let sent = self.socket.async_io(Interest::WRITABLE, || {
                // Another client may have come while this one's packets waited for room.
                let client = self.exchange.borrow().client_of(batch.exchange);
                let to = client.ok_or(io::ErrorKind::NotConnected)?;
                self.burst.send(&self.sending, rest, to)
            });
            let sent = sent.await.ok();
            let gone = rest.iter().take(sent.unwrap_or(1).max(1));
            for packet in gone {
                at += 1;
                if sent.is_some() {
                    octets += packet.len();
                    tally.moved(packet.len());
                } else {
                    count(&tally.lost);
                }
                tally.done();
            }
        }
        batch.packets.clear();
        octets
    }
}
