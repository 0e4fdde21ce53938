//! UDP: one packet a datagram, answers only to the client of the exchange. One thread with its own runtime.

use super::{
    BothEnds, Inbound, Intake, Link, LinkError, LinkUrl, Options, Outbound, Outbox, QUEUE, Tally,
    Wire, count, inbox::inbox,
};
use bytes::Bytes;
use skyloop_firmware_sim::udp::UdpPort;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Instant;
use tokio::net::UdpSocket;
use tokio::sync::mpsc::{Receiver, Sender, channel, error::TrySendError as TryQueue};

/// UDP.
pub const UDP: Link = Link {
    scheme: "udp",
    example: "udp://127.0.0.1:4810",
    open,
    loopback,
};

fn open(url: &LinkUrl, options: &Options) -> Result<Wire, LinkError> {
    url.only(&[])?;
    let address: SocketAddr = url
        .target
        .parse()
        .map_err(|_| url.refuse(format!("{:?} is not an address and a port", url.target)))?;
    Ok(listen(address, &url.text, options)?.0)
}

fn loopback(options: &Options) -> Result<BothEnds, LinkError> {
    const TEXT: &str = "udp://127.0.0.1:0";
    let (wire, address) = listen(SocketAddr::from(([127, 0, 0, 1], 0)), TEXT, options)?;
    let port = UdpPort::connect(address).map_err(|error| LinkError::Io {
        url: format!("udp://{address}"),
        action: "open the client's socket",
        source: std::io::Error::other(error),
        remedy: "check that 127.0.0.1 is up",
    })?;
    Ok((wire, Box::new(port)))
}

fn listen(
    address: SocketAddr,
    text: &str,
    options: &Options,
) -> Result<(Wire, SocketAddr), LinkError> {
    let failed = |action, remedy| {
        move |source| LinkError::Io {
            url: text.to_string(),
            action,
            source,
            remedy,
        }
    };
    let socket = std::net::UdpSocket::bind(address).map_err(failed(
        "listen",
        "choose a free port and an address of this machine (port 0 takes any free port)",
    ))?;
    let local = socket
        .local_addr()
        .map_err(failed("read its address", "try again"))?;
    socket
        .set_nonblocking(true)
        .map_err(failed("set it up", "try again"))?;

    let tally = Arc::new(Tally::default());
    let (arrivals, inbox) = inbox(tally.clone());
    let (outbox, departures) = channel(QUEUE);
    let exchange = Exchange {
        number: 0,
        client: None,
        told: false,
        options: *options,
        tally: tally.clone(),
    };
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_io()
        .build()
        .map_err(failed(
            "start its thread",
            "check the limits of this process",
        ))?;
    let sender = std::thread::Builder::new()
        .name("udp".to_string())
        .spawn(move || {
            let ended = runtime.block_on(carry(socket, arrivals, departures, exchange));
            if let Err(error) = ended {
                tracing::error!(%error, "the udp link has ended");
            }
        })
        .map_err(failed(
            "start its thread",
            "check the limits of this process",
        ))?;
    let address = format!("udp://{local}");
    let outbox = UdpOutbox {
        queue: outbox,
        tally: tally.clone(),
        address: address.clone(),
    };
    Ok((
        Wire {
            address,
            inbox,
            outbox: Box::new(outbox),
            tally,
            airtime: None,
            sender: Some(sender),
        },
        local,
    ))
}

struct UdpOutbox {
    queue: Sender<Outbound>,
    tally: Arc<Tally>,
    address: String,
}

impl Outbox for UdpOutbox {
    fn offer(&mut self, what: Outbound) -> Result<Option<Outbound>, LinkError> {
        let is_packet = matches!(what, Outbound::Packet { .. });
        match self.queue.try_send(what) {
            Ok(()) if is_packet => self.tally.queued(),
            Ok(()) => {}
            Err(TryQueue::Full(what)) => return Ok(Some(what)),
            Err(TryQueue::Closed(_)) => return Err(LinkError::Closed(self.address.clone())),
        }
        Ok(None)
    }
}

/// Carries packets until the emulator drops its end.
async fn carry(
    socket: std::net::UdpSocket,
    arrivals: Intake,
    mut departures: Receiver<Outbound>,
    mut exchange: Exchange,
) -> std::io::Result<()> {
    let socket = UdpSocket::from_std(socket)?;
    // Longer than any packet: a longer datagram is refused for its length.
    let mut buffer = vec![0; 1 << 16];
    loop {
        tokio::select! {
            received = socket.recv_from(&mut buffer) => {
                // An error here answers an earlier datagram to a client that has gone.
                let Ok((length, from)) = received else { continue };
                let packet = &buffer[..length];
                if !exchange.admit(from, packet) {
                    exchange.ignore(from);
                    continue;
                }
                let packet = Bytes::copy_from_slice(packet);
                let inbound = Inbound { exchange: exchange.number, packet, arrived: Instant::now() };
                if arrivals.push(inbound).is_err() {
                    return Ok(());
                }
            }
            departure = departures.recv() => match departure {
                None => return Ok(()),
                Some(Outbound::Release { exchange: number, asked }) => exchange.release(number, asked),
                Some(Outbound::Packet { exchange: number, packet }) => {
                    let sent = match exchange.client_of(number) {
                        Some(client) => socket.send_to(&packet, client).await.is_ok(),
                        None => false,
                    };
                    if sent {
                        exchange.tally.moved(packet.len());
                    } else {
                        count(&exchange.tally.lost);
                    }
                    exchange.tally.done();
                }
            }
        }
    }
}

/// Who the emulator talks with.
struct Exchange {
    number: u32,
    client: Option<Client>,
    /// Whether the log names a stranger already.
    told: bool,
    options: Options,
    tally: Arc<Tally>,
}

struct Client {
    address: SocketAddr,
    /// Whether it has sent a valid packet, and no Reset since. Without, anybody may take its place.
    proven: bool,
    heard: Instant,
}

impl Exchange {
    /// Whether a packet from `from` belongs to the exchange; opens a new one if it may.
    fn admit(&mut self, from: SocketAddr, packet: &[u8]) -> bool {
        let valid = (self.options.personality.decode_command)(packet).is_ok();
        if let Some(client) = &mut self.client {
            if client.address == from {
                client.proven |= valid;
                client.heard = Instant::now();
                return true;
            }
            let idle = client.heard.elapsed() >= self.options.idle;
            if client.proven && !(idle && valid) {
                return false;
            }
        }
        self.number = self.number.wrapping_add(1);
        self.told = false;
        self.client = Some(Client {
            address: from,
            proven: valid,
            heard: Instant::now(),
        });
        true
    }

    /// Counts a packet of a stranger, and says why it is not answered.
    fn ignore(&mut self, from: SocketAddr) {
        count(&self.tally.foreign);
        if let Some(client) = &self.client
            && !std::mem::replace(&mut self.told, true)
        {
            tracing::warn!(
                "packets from {from} are ignored: {} is the client until it sends Reset or nothing for {} s",
                client.address,
                self.options.idle.as_secs_f64()
            );
        }
    }

    fn release(&mut self, number: u32, asked: Instant) {
        if let Some(client) = &mut self.client
            && number == self.number
            && client.heard <= asked
        {
            client.proven = false;
        }
    }

    fn client_of(&self, number: u32) -> Option<SocketAddr> {
        self.client
            .as_ref()
            .filter(|_| number == self.number)
            .map(|client| client.address)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::MAX_PACKET;
    use skyloop_protocols::personality::NATIVE;
    use skyloop_protocols::{Command, WireTime};
    use std::time::Duration;

    fn at(port: u16) -> SocketAddr {
        SocketAddr::from(([127, 0, 0, 1], port))
    }

    #[test]
    fn an_exchange_stands_until_it_is_idle_or_released() {
        let options = Options {
            idle: Duration::from_millis(40),
            personality: &NATIVE,
        };
        let mut buffer = [0; MAX_PACKET];
        let length = Command::Ping.encode(0, WireTime(0), &mut buffer).unwrap();
        let (good, bad) = (&buffer[..length], &buffer[..length - 1]);
        let tally = Arc::new(Tally::default());
        let mut exchange = Exchange {
            number: 0,
            client: None,
            told: false,
            options,
            tally,
        };
        assert!(
            exchange.admit(at(1), bad),
            "anybody may be told that a first packet is bad"
        );
        assert!(exchange.admit(at(2), bad), "and the next one too");
        assert!(exchange.admit(at(2), good));
        assert_eq!(
            (exchange.client_of(1), exchange.client_of(2)),
            (None, Some(at(2)))
        );
        assert!(!exchange.admit(at(1), good), "a good one makes it stand");
        assert!(exchange.admit(at(2), bad));
        std::thread::sleep(Duration::from_millis(60));
        assert!(!exchange.admit(at(1), bad));
        assert!(exchange.admit(at(1), good), "until it is idle");
        let asked = Instant::now();
        exchange.release(2, asked);
        assert!(!exchange.admit(at(2), good), "another's release is none");
        assert!(exchange.admit(at(1), good));
        exchange.release(3, asked);
        assert!(
            !exchange.admit(at(2), good),
            "nor one that its client has gone on from"
        );
        exchange.release(3, Instant::now());
        assert!(exchange.admit(at(2), bad), "or released");
        assert!(exchange.admit(at(3), good));
        assert_eq!(exchange.client_of(5), Some(at(3)));
    }
}
