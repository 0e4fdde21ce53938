//! UDP: one packet a datagram, answers only to the client of the exchange. One thread with its own runtime.

mod exchange;

use super::pace::Pace;
use super::{
    Airtime, BothEnds, Inbound, Intake, Link, LinkError, LinkUrl, Options, Outbound, Outbox, QUEUE,
    Tally, Wire, count, inbox::inbox, thread,
};
use bytes::Bytes;
use exchange::Exchange;
use skyloop_firmware_sim::burst::Burst;
use skyloop_firmware_sim::datagram::{Datagram, Datagrams};
use skyloop_firmware_sim::udp::UdpPort;
use std::net::{SocketAddr, UdpSocket as SystemSocket};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use tokio::io::Interest;
use tokio::net::UdpSocket;
use tokio::sync::mpsc::{Receiver, Sender, channel, error::TrySendError as TryQueue};

/// UDP.
pub const UDP: Link = Link {
    scheme: "udp",
    example: "udp://127.0.0.1:4810",
    is_bus: false,
    keys: &["rate_mbit"],
    open,
    loopback,
};

fn open(url: &LinkUrl, options: &Options) -> Result<Wire, LinkError> {
    let address: SocketAddr = url
        .target
        .parse()
        .map_err(|_| url.refuse(format!("{:?} is not an address and a port", url.target)))?;
    Ok(listen(url, address, options)?.0)
}

fn loopback(url: &LinkUrl, options: &Options) -> Result<BothEnds, LinkError> {
    let (wire, address) = listen(url, SocketAddr::from(([127, 0, 0, 1], 0)), options)?;
    let port = UdpPort::connect(address).map_err(|error| {
        let error = std::io::Error::other(error);
        url.failed(
            "open the client's socket",
            error,
            "check that 127.0.0.1 is up",
        )
    })?;
    Ok((wire, Box::new(port)))
}

/// Mbit/s that a limit may be.
const RATES_MBIT: std::ops::RangeInclusive<f64> = 0.01..=100_000.0;

/// The limit of a URL, in octets of packets (UDP, IP and Ethernet add 66 to each) a second.
fn limit(url: &LinkUrl) -> Result<Option<f64>, LinkError> {
    let rate = url.decimal_in("rate_mbit", RATES_MBIT)?;
    Ok(rate.map(|mbit| mbit * 1e6 / 8.0))
}

fn airtime(octets_per_s: f64) -> Airtime {
    Arc::new(move |octets| Duration::from_secs_f64(octets as f64 / octets_per_s))
}

fn listen(
    url: &LinkUrl,
    address: SocketAddr,
    options: &Options,
) -> Result<(Wire, SocketAddr), LinkError> {
    let (socket, datagrams, local) = bind(url, address)?;
    Ok((start(url, options, socket, datagrams, local)?, local))
}

/// A socket that receives from now on, and its address.
fn bind(
    url: &LinkUrl,
    address: SocketAddr,
) -> Result<(SystemSocket, Datagrams, SocketAddr), LinkError> {
    let failed = |action, remedy| move |source| url.failed(action, source, remedy);
    let socket = SystemSocket::bind(address).map_err(failed(
        "listen",
        "choose a free port and an address of this machine (port 0 takes any free port)",
    ))?;
    let local = socket
        .local_addr()
        .map_err(failed("read its address", "try again"))?;
    let datagrams = socket
        .set_nonblocking(true)
        .and_then(|()| Datagrams::of(&socket))
        .map_err(failed("set it up", "try again"))?;
    Ok((socket, datagrams, local))
}

/// Carries what comes to the socket `local`, and what leaves it.
fn start(
    url: &LinkUrl,
    options: &Options,
    socket: SystemSocket,
    datagrams: Datagrams,
    local: SocketAddr,
) -> Result<Wire, LinkError> {
    let limit = limit(url)?;
    let tally = Arc::new(Tally::default());
    let (arrivals, inbox) = inbox(tally.clone());
    let (outbox, departures) = channel(QUEUE);
    let exchange = Exchange::new(options.clone(), tally.clone());
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_io()
        .enable_time()
        .build()
        .map_err(|source| {
            let remedy = "check the limits of this process";
            url.failed("start its thread", source, remedy)
        })?;
    let sender = thread(url, "udp", move || {
        let carried = carry(socket, datagrams, arrivals, departures, exchange, limit);
        if let Err(error) = runtime.block_on(carried) {
            tracing::error!(%error, "the udp link has ended");
        }
    })?;
    let address = format!("udp://{local}");
    let outbox = UdpOutbox {
        queue: outbox,
        tally: tally.clone(),
        address: address.clone(),
    };
    Ok(Wire {
        address,
        inbox,
        outbox: Box::new(outbox),
        tally,
        airtime: limit.map(airtime),
        sender: Some(sender),
    })
}

struct UdpOutbox {
    queue: Sender<Outbound>,
    tally: Arc<Tally>,
    address: String,
}

impl Outbox for UdpOutbox {
    fn offer(&mut self, what: Outbound) -> Result<Option<Outbound>, LinkError> {
        let is_packet = matches!(what, Outbound::Packet { .. });
        let try_send = || self.queue.try_send(what);
        let sent = if is_packet {
            self.tally.queue(try_send)
        } else {
            try_send()
        };
        match sent {
            Ok(()) => Ok(None),
            Err(TryQueue::Full(what)) => Ok(Some(what)),
            Err(TryQueue::Closed(_)) => Err(LinkError::Closed(self.address.clone())),
        }
    }
}

/// What a limited link may catch up at once, after a timer that came late: timers here go by milliseconds.
const BURST: Duration = Duration::from_millis(5);

/// Waits for `next`; for nothing if there is none.
async fn until(next: Option<Instant>) {
    if let Some(next) = next {
        tokio::time::sleep_until(next.into()).await;
    }
}

/// Packets that are taken from the queue at a time.
const TOGETHER: usize = 64;

/// Carries packets until the emulator drops its end.
async fn carry(
    socket: SystemSocket,
    mut datagrams: Datagrams,
    arrivals: Intake,
    mut departures: Receiver<Outbound>,
    mut exchange: Exchange,
    limit: Option<f64>,
) -> std::io::Result<()> {
    let mut pace = limit.map(|octets_per_s| Pace::new(octets_per_s, BURST));
    // Where a limit says when the next may leave, they go one by one.
    let most = if pace.is_some() { 1 } else { TOGETHER };
    let mut next = None;
    let (mut burst, sending) = (Burst::default(), socket.try_clone()?);
    let mut taken = Vec::with_capacity(most);
    let socket = UdpSocket::from_std(socket)?;
    // Longer than any packet: a longer datagram is refused for its length.
    let mut buffer = vec![0; 1 << 16];
    loop {
        tokio::select! {
            received = socket.async_io(Interest::READABLE, || datagrams.receive(&mut buffer)) => {
                // An error here answers an earlier datagram to a client that has gone.
                let Ok(Datagram { length, from, lost, .. }) = received else { continue };
                exchange.tally.dropped.fetch_add(lost, Ordering::Relaxed);
                let packet = &buffer[..length];
                let arrived = Instant::now();
                if !exchange.admit(from, packet, arrived) {
                    exchange.ignore(from);
                    continue;
                }
                let packet = Bytes::copy_from_slice(packet);
                let inbound = Inbound { exchange: exchange.number, packet, arrived };
                if arrivals.push(inbound).is_err() {
                    return Ok(());
                }
            }
            () = until(next), if next.is_some() => next = None,
            count = departures.recv_many(&mut taken, most), if next.is_none() => {
                if count == 0 {
                    return Ok(());
                }
                let mut batch = Batch::default();
                for departure in taken.drain(..) {
                    match departure {
                        Outbound::Release { exchange: number, asked } => {
                            batch.send(&mut exchange, &socket, &sending, &mut burst).await;
                            exchange.release(number, asked);
                        }
                        Outbound::Packet { exchange: number, packet } => {
                            if batch.exchange != number {
                                batch.send(&mut exchange, &socket, &sending, &mut burst).await;
                            }
                            batch.exchange = number;
                            batch.packets.push(packet);
                        }
                    }
                }
                let octets = batch.send(&mut exchange, &socket, &sending, &mut burst).await;
                let now = Instant::now();
                let free = pace.as_mut().filter(|_| octets > 0).map(|pace| pace.pass(octets, now));
                next = free.filter(|free| *free > now);
            }
        }
    }
}

/// Packets of one exchange, in order.
#[derive(Default)]
struct Batch {
    exchange: u32,
    packets: Vec<Bytes>,
}

impl Batch {
    /// Sends what there is, if its exchange still stands; what the system refuses is lost, and counted. The octets that have left.
    async fn send(
        &mut self,
        exchange: &mut Exchange,
        socket: &UdpSocket,
        sending: &SystemSocket,
        burst: &mut Burst,
    ) -> usize {
        let tally = exchange.tally.clone();
        let client = exchange.client_of(self.exchange);
        let (mut at, mut octets) = (0, 0);
        while let Some(rest) = self.packets.get(at..).filter(|rest| !rest.is_empty()) {
            let sent = match client {
                Some(to) => {
                    let sent = socket
                        .async_io(Interest::WRITABLE, || burst.send(sending, rest, to))
                        .await;
                    sent.ok()
                }
                None => None,
            };
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
        self.packets.clear();
        octets
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::link::Standstill;
    use skyloop_protocols::personality::NATIVE;

    fn at(port: u16) -> SocketAddr {
        SocketAddr::from(([127, 0, 0, 1], port))
    }

    /// Octets a second that a client gets of a second full of numbered packets; lost ones have been sent, too.
    fn delivered(mbit: f64) -> f64 {
        const OCTETS: usize = 1250;
        let patience = Duration::from_secs(20);
        let options = Options {
            idle: patience,
            personality: &NATIVE,
            bus: None,
        };
        let url = LinkUrl::parse(&format!("udp://127.0.0.1:0?rate_mbit={mbit}")).unwrap();
        let (mut wire, address) = listen(&url, at(0), &options).unwrap();
        let client = SystemSocket::bind("127.0.0.1:0").unwrap();
        client.send_to(b"hello", address).unwrap();
        wire.inbox.recv_timeout(patience).unwrap();
        let packets = (mbit * 1e6 / 8.0 / OCTETS as f64) as u32;
        let began = Instant::now();
        let sender = std::thread::spawn(move || {
            for number in 0..=packets {
                let mut packet = vec![0; OCTETS];
                packet[..4].copy_from_slice(&number.to_be_bytes());
                let packet = Bytes::from(packet);
                let mut waiting = wire.outbox.offer(Outbound::Packet {
                    exchange: 1,
                    packet,
                });
                while let Ok(Some(packet)) = waiting {
                    std::thread::sleep(Duration::from_micros(200));
                    waiting = wire.outbox.offer(packet);
                }
            }
            // Whoever listens must not wait for a last packet that was lost.
            wire.close(Standstill::of(&wire.tally, patience));
        });
        client
            .set_read_timeout(Some(Duration::from_millis(500)))
            .unwrap();
        let mut buffer = [0; 2 * OCTETS];
        let mut arrivals = Vec::new();
        while client.recv(&mut buffer).is_ok() {
            let number = u32::from_be_bytes(*buffer.first_chunk().unwrap());
            arrivals.push((f64::from(number) * OCTETS as f64, Instant::now()));
        }
        sender.join().unwrap();
        let ((from, begin), (to, end)) = (arrivals[0], arrivals[arrivals.len() - 1]);
        // Never more than the rate allows since it began, and what a late timer may catch up.
        let most = mbit * 1e6 / 8.0 * (end - began + BURST).as_secs_f64();
        assert!(to <= most, "{to} of {most}");
        (to - from) / (end - begin).as_secs_f64()
    }

    #[test]
    fn a_limited_link_sends_at_its_rate() {
        for mbit in [1.0, 10.0, 100.0] {
            let nominal = mbit * 1e6 / 8.0;
            let close = |rate: &f64| (rate / nominal - 1.0).abs() <= 0.02;
            // A machine that is busy with other things may keep the timer waiting: the best of many.
            let mut rates = Vec::new();
            while rates.len() < 25 && !rates.last().is_some_and(close) {
                rates.push(delivered(mbit));
            }
            println!("{mbit} Mbit/s: {rates:.0?} octets/s of {nominal}");
            assert!(rates.last().is_some_and(close), "{mbit}: {rates:?}");
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn datagrams_that_found_no_room_are_counted() {
        const SENT: u32 = 20_000;
        let patience = Duration::from_secs(20);
        let options = Options {
            idle: patience,
            personality: &NATIVE,
            bus: None,
        };
        let url = LinkUrl::parse("udp://127.0.0.1:0").unwrap();
        // Nobody reads while they come: most find the system's buffer full.
        let (socket, datagrams, local) = bind(&url, at(0)).unwrap();
        let client = SystemSocket::bind("127.0.0.1:0").unwrap();
        for _ in 0..SENT {
            client.send_to(&[0; 1400], local).unwrap();
        }
        let wire = start(&url, &options, socket, datagrams, local).unwrap();
        let mut taken = 0;
        while wire.inbox.recv_timeout(Duration::from_millis(200)).is_ok() {
            taken += 1;
        }
        client.send_to(b"next", local).unwrap();
        wire.inbox.recv_timeout(patience).unwrap();
        // Each was taken, or found the system's buffer or the inbound queue full.
        let counters = wire.tally.counters();
        assert_eq!(taken + counters.overflows, SENT);
        assert!(taken < SENT / 2, "{taken} found room");
        let others = skyloop_protocols::Counters {
            overflows: 0,
            ..counters
        };
        assert_eq!(others, skyloop_protocols::Counters::default());
    }

    #[test]
    fn a_limited_packet_takes_its_time() {
        let url = LinkUrl::parse("udp://127.0.0.1:0?rate_mbit=2.5").unwrap();
        let airtime = limit(&url).unwrap().map(airtime).unwrap();
        // 1250 octets are 10,000 bits.
        assert_eq!(airtime(1250), Duration::from_millis(4));
        let url = LinkUrl::parse("udp://127.0.0.1:0?rate_mbit=0").unwrap();
        assert!(limit(&url).is_err());
    }
}
