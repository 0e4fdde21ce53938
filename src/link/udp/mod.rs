//! UDP: one packet per datagram, answers only to the present client. One thread with its own
//! runtime.

mod carry;
mod exchange;
mod own;
mod proof;

use super::error::{LinkError, OpenError};
use super::inbox::{QUEUE, inbox};
use super::kind::{BothEnds, Link, Options, thread};
use super::outbox::QueueOutbox;
use super::tally::{Airtime, Tally};
use super::wire::Wire;
use carry::carry;
use exchange::Exchange;
use skyloop_firmware_sim::address::Address;
use skyloop_firmware_sim::datagram::Datagrams;
use skyloop_firmware_sim::udp::UdpPort;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket as SystemSocket};
use std::sync::Arc;
use std::sync::mpsc::TrySendError;
use std::time::Duration;
use tokio::sync::mpsc::{channel, error::TrySendError as TryQueue};

/// UDP.
pub(crate) const UDP: Link = Link {
    scheme: "udp",
    example: "udp://127.0.0.1:4810",
    is_bus: false,
    keys: &["rate_mbit", "proof"],
    open,
    loopback,
};

fn open(url: &Address, options: &Options) -> Result<Wire, OpenError> {
    let wrong = |_| format!("{:?} is not an address and a port", url.target);
    let address = url.target.parse().map_err(wrong)?;
    Ok(listen(url, address, options)?.0)
}

/// Any free port on the loopback interface.
const ANY: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 0);

fn loopback(url: &Address, options: &Options) -> Result<BothEnds, OpenError> {
    let (wire, address) = listen(url, ANY, options)?;
    let port = UdpPort::connect(address);
    let port = port.map_err(|error| LinkError::no_client(url, error))?;
    Ok((wire, Box::new(port)))
}

/// Range of a rate limit, Mbit/s.
const RATES_MBIT: std::ops::RangeInclusive<f64> = 0.01..=100_000.0;

/// The rate limit of a URL, bytes/s of packets. UDP, IP and Ethernet add 66 bytes to each.
fn limit(url: &Address) -> Result<Option<f64>, String> {
    let rate = url.decimal_in("rate_mbit", RATES_MBIT)?;
    Ok(rate.map(|mbit| mbit * 1e6 / 8.0))
}

/// Whether clients must prove their addresses.
fn proves(url: &Address) -> Result<bool, String> {
    match url.value("proof") {
        None | Some("on") => Ok(true),
        Some("off") => Ok(false),
        Some(other) => Err(format!("proof = {other}: on or off")),
    }
}

fn airtime(bytes_per_s: f64) -> Airtime {
    Arc::new(move |bytes| Duration::from_secs_f64(bytes as f64 / bytes_per_s))
}

fn listen(
    url: &Address,
    address: SocketAddr,
    options: &Options,
) -> Result<(Wire, SocketAddr), OpenError> {
    let (socket, datagrams, local) = bind(url, address)?;
    Ok((start(url, options, socket, datagrams, local)?, local))
}

/// A receiving socket and its address.
fn bind(
    url: &Address,
    address: SocketAddr,
) -> Result<(SystemSocket, Datagrams, SocketAddr), LinkError> {
    let failed =
        |action, remedy| move |source| LinkError::refused(url.text.clone(), action, source, remedy);
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

/// Starts the link of a socket with address `local`.
fn start(
    url: &Address,
    options: &Options,
    socket: SystemSocket,
    datagrams: Datagrams,
    local: SocketAddr,
) -> Result<Wire, OpenError> {
    let limit = limit(url)?;
    let tally = Arc::new(Tally::default());
    let (arrivals, inbox) = inbox(tally.clone());
    let (queue, departures) = channel(QUEUE);
    let exchange = Exchange::new(options.clone(), tally.clone(), proves(url)?);
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_io()
        .enable_time()
        .build()
        .map_err(|source| {
            let remedy = "check the limits of this process";
            LinkError::refused(url.text.clone(), "start its thread", source, remedy)
        })?;
    let sender = thread(url, "udp", move || {
        let carried = carry(socket, datagrams, arrivals, departures, exchange, limit);
        if let Err(error) = runtime.block_on(carried) {
            tracing::error!(%error, "the udp link has ended");
        }
    })?;
    let address = format!("udp://{local}");
    let try_send = move |what| {
        queue.try_send(what).map_err(|error| match error {
            TryQueue::Full(what) => TrySendError::Full(what),
            TryQueue::Closed(what) => TrySendError::Disconnected(what),
        })
    };
    let outbox = QueueOutbox::new(&address, &tally, try_send);
    Ok(Wire {
        airtime: limit.map(airtime),
        sender: Some(sender),
        ..Wire::new(address, inbox, outbox, tally)
    })
}

#[cfg(test)]
mod tests {
    use super::carry::BURST;
    use super::*;
    use crate::fixture::{TIMEOUT, options};
    use crate::outbox::Outbound;
    use crate::tally::Standstill;
    use bytes::Bytes;
    use skyloop_protocols::Counters;
    use std::time::Instant;

    /// Rate in bytes/s at the client for packets of one second; lost ones count as sent.
    fn delivered(mbit: f64) -> f64 {
        const BYTES: usize = 1250;
        let url = Address::parse(&format!("udp://127.0.0.1:0?rate_mbit={mbit}&proof=off")).unwrap();
        let (mut wire, address) = listen(&url, ANY, &options()).unwrap();
        let client = SystemSocket::bind("127.0.0.1:0").unwrap();
        client.send_to(b"hello", address).unwrap();
        wire.inbox.recv_timeout(TIMEOUT).unwrap();
        let packets = (mbit * 1e6 / 8.0 / BYTES as f64) as u32;
        let began = Instant::now();
        let sender = std::thread::spawn(move || {
            for number in 0..=packets {
                let mut packet = vec![0; BYTES];
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
            // The receiver must not wait for a lost last packet.
            wire.close(Standstill::of(&wire.tally, TIMEOUT));
        });
        client
            .set_read_timeout(Some(Duration::from_secs(2)))
            .unwrap();
        let mut buffer = [0; 2 * BYTES];
        let mut arrivals = Vec::new();
        while client.recv(&mut buffer).is_ok() {
            let number = u32::from_be_bytes(*buffer.first_chunk().unwrap());
            arrivals.push((f64::from(number) * BYTES as f64, Instant::now()));
        }
        sender.join().unwrap();
        // Never faster than the rate, apart from the burst after a late timer.
        for (bytes, at) in &arrivals {
            let max = mbit * 1e6 / 8.0 * (*at - began + BURST).as_secs_f64();
            assert!(*bytes <= max, "{bytes} of {max}");
        }
        let ((from, begin), (to, end)) = (arrivals[0], arrivals[arrivals.len() - 1]);
        (to - from) / (end - begin).as_secs_f64()
    }

    #[test]
    #[ignore = "timed: tests/run all runs it alone; cargo test -- --ignored timed_"]
    fn timed_a_limited_link_sends_at_its_rate() {
        for mbit in [1.0, 10.0, 100.0] {
            let nominal = mbit * 1e6 / 8.0;
            let close = |rate: &f64| (rate / nominal - 1.0).abs() <= 0.02;
            // Other load of the machine may delay the timer: the best of many runs counts.
            let mut rates = Vec::new();
            while rates.len() < 25 && !rates.last().is_some_and(close) {
                rates.push(delivered(mbit));
            }
            println!("{mbit} Mbit/s: {rates:.0?} bytes/s of {nominal}");
            assert!(rates.last().is_some_and(close), "{mbit}: {rates:?}");
        }
    }

    #[test]
    fn limited_link_never_exceeds_its_rate() {
        // Asserted at each arrival.
        delivered(1.0);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn datagrams_lost_to_a_full_buffer_are_counted() {
        const SENT: u32 = 20_000;
        let url = Address::parse("udp://127.0.0.1:0").unwrap();
        // No thread reads yet: most find the system's buffer full.
        let (socket, datagrams, local) = bind(&url, ANY).unwrap();
        let client = SystemSocket::bind("127.0.0.1:0").unwrap();
        for _ in 0..SENT {
            client.send_to(&[0; 1400], local).unwrap();
        }
        let wire = start(&url, &options(), socket, datagrams, local).unwrap();
        let mut taken = 0;
        while wire.inbox.recv_timeout(Duration::from_secs(2)).is_ok() {
            taken += 1;
        }
        client.send_to(b"next", local).unwrap();
        wire.inbox.recv_timeout(TIMEOUT).unwrap();
        // Each was received, or found the system's buffer or the inbound queue full.
        let counters = wire.tally.counters();
        assert_eq!(taken + counters.overflows, SENT);
        assert!(taken < SENT / 2, "{taken} were received");
        let overflows = counters.overflows;
        let expected = Counters {
            overflows,
            ..Counters::default()
        };
        assert_eq!(counters, expected);
    }

    #[test]
    fn packet_of_a_limited_link_takes_its_airtime() {
        let url = Address::parse("udp://127.0.0.1:0?rate_mbit=2.5").unwrap();
        let airtime = limit(&url).unwrap().map(airtime).unwrap();
        // 1250 bytes are 10,000 bits.
        assert_eq!(airtime(1250), Duration::from_millis(4));
        let url = Address::parse("udp://127.0.0.1:0?rate_mbit=0").unwrap();
        assert!(limit(&url).is_err());
    }
}
