//! Both directions of the socket on one thread: received packets are stamped and queued while
//! outgoing ones wait.

use super::exchange::{Exchange, ExchangeEvent, Permit};
use super::own::ClientSocket;
use crate::inbox::{Inbound, InboxSender};
use crate::outbox::Outbound;
use crate::pace::Pace;
use crate::tx_complete::Unsent;
use bytes::Bytes;
use skyloop_firmware_sim::burst::Burst;
use skyloop_firmware_sim::datagram::{Datagram, Datagrams};
use std::cell::RefCell;
use std::future::pending;
use std::io;
use std::net::{SocketAddr, UdpSocket as SystemSocket};
use std::rc::Rc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use tokio::io::Interest;
use tokio::net::UdpSocket;
use tokio::sync::Notify;
use tokio::sync::mpsc::Receiver;

/// Maximum lag that a rate-limited link makes up for: the timers resolve milliseconds.
pub(super) const BURST: Duration = Duration::from_millis(5);
/// Datagrams received before the task yields.
const RECEIVE_BATCH: u64 = 16;
/// Packets taken from the queue at a time.
const SEND_BATCH: usize = 64;
/// Maximum number of strangers' datagrams read per [`PAUSE`] while a client has its own socket. The
/// rest overflow the system's buffer, at no cost here.
const STRANGERS: u32 = 64;
const PAUSE: Duration = Duration::from_millis(50);
/// Datagrams possibly received before a client got its own socket: more than the system buffers.
const MAX_BEFORE: u32 = 1024;
/// Interval of checks for a due Challenge.
const CHECK_INTERVAL: Duration = Duration::from_millis(100);

/// Carries packets until the emulator closes its end; `limit` is the maximum rate, bytes/s.
pub(super) async fn carry(
    socket: SystemSocket,
    datagrams: Datagrams,
    arrivals: InboxSender,
    departures: Receiver<Outbound>,
    exchange: Exchange,
    limit: Option<f64>,
) -> io::Result<()> {
    let shared = &Shared {
        sending: socket.try_clone()?,
        socket: UdpSocket::from_std(socket)?,
        exchange: RefCell::new(exchange),
        client_socket: RefCell::default(),
        changed: Notify::new(),
    };
    let tx_path = TxPath {
        shared,
        burst: Burst::default(),
    };
    tokio::select! {
        () = receive(shared, datagrams, arrivals) => {}
        () = send(tx_path, departures, limit) => {}
        () = prove(shared) => {}
    }
    Ok(())
}

struct Shared {
    /// Receives all datagrams except those of a client with its own socket.
    socket: UdpSocket,
    /// The same socket, for calls that send several datagrams.
    sending: SystemSocket,
    exchange: RefCell<Exchange>,
    /// The client's own socket.
    client_socket: RefCell<Option<Rc<ClientSocket>>>,
    /// Signals a new client, a proof of address, or a client that has gone.
    changed: Notify,
}

impl Shared {
    fn client_socket(&self) -> Option<Rc<ClientSocket>> {
        self.client_socket.borrow().clone()
    }

    /// Ends the exchange: the client's address refuses datagrams.
    fn end(&self, client_socket: &ClientSocket) {
        self.exchange.borrow_mut().end(client_socket.peer);
        let mut present = self.client_socket.borrow_mut();
        present.take_if(|one| std::ptr::eq(&**one, client_socket));
        self.changed.notify_waiters();
    }

    /// Opens a socket for an established client, and closes that of a client that lost the
    /// exchange. Returns whether there is a new one.
    fn settle(&self, datagrams: &Datagrams, now: Instant) -> bool {
        let (address, established) = {
            let exchange = self.exchange.borrow();
            (exchange.address(), exchange.established(now))
        };
        let peer = self.client_socket.borrow().as_ref().map(|own| own.peer);
        if peer.is_some() && peer != address {
            // Unread datagrams of the former client count as foreign.
            if let Some(client_socket) = self.client_socket.take() {
                let left = client_socket.drain();
                let tally = &self.exchange.borrow().tally;
                tally.foreign.fetch_add(left, Ordering::Relaxed);
            }
        }
        let Some(peer) = established.filter(|established| peer != Some(*established)) else {
            return false;
        };
        // Without a socket of its own the client uses the common one.
        match ClientSocket::of(datagrams, peer) {
            Ok(client_socket) => {
                self.client_socket.replace(Some(Rc::new(client_socket)));
                true
            }
            Err(error) => {
                tracing::debug!(%error, "no socket for the client alone");
                false
            }
        }
    }

    /// Sends a Challenge, if one is due.
    fn challenge(&self, now: Instant) {
        let due = self.exchange.borrow_mut().challenge(now);
        if let Some((to, packet)) = due {
            // A lost Challenge is repeated.
            let _ = self.sending.send_to(&packet, to);
        }
    }
}

/// Sends due Challenges forever.
async fn prove(shared: &Shared) {
    loop {
        tokio::time::sleep(CHECK_INTERVAL).await;
        shared.challenge(Instant::now());
    }
}

/// The socket of a datagram.
#[derive(Clone, Copy, PartialEq)]
enum Origin {
    /// The common socket.
    All,
    /// The common socket while a client has its own: the sender is a stranger.
    Strangers,
    /// The client's own socket.
    ClientSocket,
}

/// Reads both sockets.
struct Reader {
    datagrams: Datagrams,
    /// Longer than any packet: longer datagrams are refused by their length.
    buffer: Vec<u8>,
    client_buffer: Vec<u8>,
    strangers: Strangers,
    /// Number of datagrams possibly received before a client got its own socket.
    before: u32,
}

impl Reader {
    /// The next datagram; `None`: call again.
    async fn next(&mut self, shared: &Shared) -> Option<(Datagram, Origin)> {
        if self.before > 0 {
            self.before -= 1;
            let received = self.datagrams.receive(&mut self.buffer).ok();
            if received.is_none() {
                self.before = 0;
            }
            return received.map(|datagram| (datagram, Origin::All));
        }
        let client_socket = shared.client_socket();
        let is_guarded =
            client_socket.is_some() && shared.exchange.borrow().is_held(Instant::now());
        let (datagrams, buffer) = (&mut self.datagrams, &mut self.buffer);
        let (client_buffer, strangers) = (&mut self.client_buffer, &mut self.strangers);
        let from_client = async {
            match &client_socket {
                Some(client_socket) => client_socket.receive(client_buffer).await,
                None => pending().await,
            }
        };
        let from_all = async {
            if is_guarded {
                strangers.wait().await;
            }
            let receive = || datagrams.receive(buffer);
            shared.socket.async_io(Interest::READABLE, receive).await
        };
        let (received, origin) = tokio::select! {
            biased;
            received = from_client => (received, Origin::ClientSocket),
            received = from_all => (received, if is_guarded { Origin::Strangers } else { Origin::All }),
        };
        match (received, client_socket) {
            (Ok(datagram), _) => {
                if origin == Origin::Strangers {
                    self.strangers.count();
                }
                Some((datagram, origin))
            }
            (Err(error), Some(client_socket)) if origin == Origin::ClientSocket => {
                if error.kind() == io::ErrorKind::ConnectionRefused {
                    shared.end(&client_socket);
                }
                None
            }
            // An earlier datagram to a closed client caused this error.
            (Err(_), _) => None,
        }
    }

    fn packet(&self, datagram: &Datagram, origin: Origin) -> &[u8] {
        let buffer = match origin {
            Origin::ClientSocket => &self.client_buffer,
            Origin::All | Origin::Strangers => &self.buffer,
        };
        buffer.get(..datagram.length).unwrap_or_default()
    }
}

/// Queues the packets of the exchange's client until the emulator closes its end.
async fn receive(shared: &Shared, datagrams: Datagrams, arrivals: InboxSender) {
    let mut reader = Reader {
        datagrams,
        buffer: vec![0; 1 << 16],
        client_buffer: vec![0; 1 << 16],
        strangers: Strangers::default(),
        before: 0,
    };
    for number in 1_u64.. {
        // Outgoing packets must not wait for the end of a flood.
        if number.is_multiple_of(RECEIVE_BATCH) {
            tokio::task::yield_now().await;
        }
        let Some((datagram, origin)) = reader.next(shared).await else {
            continue;
        };
        let packet = reader.packet(&datagram, origin);
        let is_stranger = origin == Origin::Strangers;
        if !handle_datagram(shared, &arrivals, datagram, packet, is_stranger) {
            return;
        }
        if shared.settle(&reader.datagrams, Instant::now()) {
            reader.before = MAX_BEFORE;
        }
    }
}

/// Handles a datagram; false when the emulator has closed its end.
fn handle_datagram(
    shared: &Shared,
    arrivals: &InboxSender,
    datagram: Datagram,
    packet: &[u8],
    is_stranger: bool,
) -> bool {
    let Datagram { from, lost, .. } = datagram;
    let arrived = Instant::now();
    let mut exchange = shared.exchange.borrow_mut();
    let tally = &exchange.tally;
    let counter = if is_stranger {
        &tally.foreign
    } else {
        &tally.dropped
    };
    counter.fetch_add(lost, Ordering::Relaxed);
    let number = exchange.number;
    let event = exchange.receive(from, packet, arrived);
    let is_new = exchange.number != number;
    let taken = match event {
        ExchangeEvent::Stranger => {
            exchange.ignore(from, arrived);
            true
        }
        ExchangeEvent::Proof => true,
        ExchangeEvent::Packet(exchange) => arrivals
            .push(Inbound::new(exchange, packet, arrived))
            .is_ok(),
    };
    drop(exchange);
    if event == ExchangeEvent::Proof || is_new {
        shared.changed.notify_waiters();
    }
    shared.challenge(arrived);
    taken
}

/// Limits strangers' datagrams to [`STRANGERS`] per [`PAUSE`].
#[derive(Default)]
struct Strangers {
    read: u32,
    since: Option<Instant>,
}

impl Strangers {
    /// Waits until one more may be read.
    async fn wait(&mut self) {
        if self.read >= STRANGERS
            && let Some(since) = self.since
        {
            tokio::time::sleep_until((since + PAUSE).into()).await;
            self.read = 0;
        }
    }

    fn count(&mut self) {
        if self.read == 0 {
            self.since = Some(Instant::now());
        }
        self.read += 1;
    }
}

/// Sends queued packets until the emulator closes its end.
async fn send(mut out: TxPath<'_>, mut departures: Receiver<Outbound>, limit: Option<f64>) {
    let mut pace = limit.map(|bytes_per_s| Pace::new(bytes_per_s, BURST));
    // With a limit, packets are paced one by one.
    let max = if pace.is_some() { 1 } else { SEND_BATCH };
    let mut taken = Vec::with_capacity(max);
    while departures.recv_many(&mut taken, max).await > 0 {
        let (mut batch, mut bytes) = (Batch::default(), 0);
        for departure in taken.drain(..) {
            match departure {
                Outbound::Release {
                    exchange,
                    requested,
                } => {
                    bytes += out.send(&mut batch).await;
                    out.shared
                        .exchange
                        .borrow_mut()
                        .release(exchange, requested);
                }
                Outbound::Packet { exchange, packet } => {
                    if batch.exchange != exchange {
                        bytes += out.send(&mut batch).await;
                    }
                    batch.exchange = exchange;
                    batch.packets.push(packet);
                }
            }
        }
        bytes += out.send(&mut batch).await;
        let now = Instant::now();
        let free = pace.as_mut().filter(|_| bytes > 0);
        match free.map(|pace| pace.pass(bytes, now)) {
            Some(free) if free > now => tokio::time::sleep_until(free.into()).await,
            // The line lags behind its rate: send at once.
            Some(_) => {}
            // Received datagrams must not wait for the whole queue.
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
struct TxPath<'a> {
    shared: &'a Shared,
    burst: Burst,
}

impl TxPath<'_> {
    /// Sends packets of a current exchange; refused ones count as lost. Returns the bytes sent.
    async fn send(&mut self, batch: &mut Batch) -> usize {
        let tally = self.shared.exchange.borrow().tally.clone();
        let (mut at, mut bytes) = (0, 0);
        while let Some(rest) = batch.packets.get(at..).filter(|rest| !rest.is_empty()) {
            let sent = match self.permit(batch.exchange, rest).await {
                Ok((rest, to)) => self.send_now(rest, to).await,
                Err(why) => Err(why),
            };
            let gone = rest.iter().take(sent.unwrap_or(1).max(1));
            for packet in gone {
                at += 1;
                match sent {
                    Ok(_) => {
                        bytes += packet.len();
                        tally.moved(packet.len());
                        tally.done();
                    }
                    Err(why) => tally.lose(packet, why),
                }
            }
        }
        batch.packets.clear();
        bytes
    }

    /// Waits until packets of an exchange may leave; returns them and their address. Errors: why
    /// the first one never may.
    async fn permit<'p>(
        &self,
        exchange: u32,
        rest: &'p [Bytes],
    ) -> Result<(&'p [Bytes], SocketAddr), Unsent> {
        let (packet, _) = rest.split_first().ok_or(Unsent::Failed)?;
        loop {
            let changed = self.shared.changed.notified();
            let permit = {
                let mut exchanges = self.shared.exchange.borrow_mut();
                if let Some(why) = exchanges.tally.why_given_up() {
                    return Err(why);
                }
                exchanges.permit(exchange, packet, Instant::now())
            };
            match permit {
                Permit::All(to) => return Ok((rest, to)),
                Permit::One(to) => return Ok((rest.get(..1).unwrap_or(rest), to)),
                Permit::Never if self.shared.exchange.borrow().is_current(exchange) => {
                    return Err(Unsent::NotProved);
                }
                Permit::Never => return Err(Unsent::ClientGone),
                // Further packets of the client also raise its limit.
                Permit::Wait => drop(tokio::time::timeout(CHECK_INTERVAL, changed).await),
            }
        }
    }

    /// Passes `packets` to the system; returns the number sent. Errors: why it refused the first.
    async fn send_now(&mut self, packets: &[Bytes], to: SocketAddr) -> Result<usize, Unsent> {
        let client_socket = self.shared.client_socket().filter(|own| own.peer == to);
        let (socket, sending) = match &client_socket {
            Some(client_socket) => (&client_socket.socket, &client_socket.sending),
            None => (&self.shared.socket, &self.shared.sending),
        };
        let burst = &mut self.burst;
        let send = || burst.send(sending, packets, to);
        let sent = socket.async_io(Interest::WRITABLE, send).await;
        sent.map_err(|error| match (error.kind(), &client_socket) {
            (io::ErrorKind::ConnectionRefused, Some(client_socket)) => {
                self.shared.end(client_socket);
                Unsent::ClientGone
            }
            _ => Unsent::Failed,
        })
    }
}
