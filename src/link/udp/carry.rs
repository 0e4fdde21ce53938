//! Both directions of the socket on one thread: arrivals are stamped and passed on while departures
//! wait.

use super::exchange::{Exchange, ExchangeEvent, Permit};
use super::own::Own;
use crate::inbox::{Inbound, Intake};
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

/// Burst of a limited link after a late timer, which has a resolution of milliseconds.
pub(super) const BURST: Duration = Duration::from_millis(5);
/// Datagrams that are taken in a row.
const IN_A_ROW: u64 = 16;
/// Packets that are taken from the queue at a time.
const TOGETHER: usize = 64;
/// Datagrams of strangers read in each [`PAUSE`] while a client has its own socket. The rest
/// overflow the system's buffer, at no cost here.
const STRANGERS: u32 = 64;
const PAUSE: Duration = Duration::from_millis(50);
/// Datagrams that may have come before a client got its own socket: more than the system buffers.
const BEFORE: u32 = 1024;
/// How often it is looked whether a Challenge is due.
const LOOK: Duration = Duration::from_millis(100);

/// Carries packets until the emulator drops its end; `limit` octets a second leave at most.
pub(super) async fn carry(
    socket: SystemSocket,
    datagrams: Datagrams,
    arrivals: Intake,
    departures: Receiver<Outbound>,
    exchange: Exchange,
    limit: Option<f64>,
) -> io::Result<()> {
    let shared = &Shared {
        sending: socket.try_clone()?,
        socket: UdpSocket::from_std(socket)?,
        exchange: RefCell::new(exchange),
        own: RefCell::default(),
        changed: Notify::new(),
    };
    let way_out = TxPath {
        shared,
        burst: Burst::default(),
    };
    tokio::select! {
        () = receive(shared, datagrams, arrivals) => {}
        () = send(way_out, departures, limit) => {}
        () = prove(shared) => {}
    }
    Ok(())
}

/// What both ways use.
struct Shared {
    /// Where everybody's datagrams come, but those of a client that has a socket of its own.
    socket: UdpSocket,
    /// The same socket, as calls take it that send several datagrams.
    sending: SystemSocket,
    exchange: RefCell<Exchange>,
    /// The client's own socket.
    own: RefCell<Option<Rc<Own>>>,
    /// Another client has come, or this one has proved its address or has gone.
    changed: Notify,
}

impl Shared {
    fn own(&self) -> Option<Rc<Own>> {
        self.own.borrow().clone()
    }

    /// Nobody listens at the address of a client's own socket.
    fn end(&self, own: &Own) {
        self.exchange.borrow_mut().end(own.peer);
        let mut present = self.own.borrow_mut();
        present.take_if(|one| std::ptr::eq(&**one, own));
        self.changed.notify_waiters();
    }

    /// Gives an established client its own socket, and closes that of a client that lost the
    /// exchange; whether there is a new one.
    fn settle(&self, datagrams: &Datagrams, now: Instant) -> bool {
        let (address, established) = {
            let exchange = self.exchange.borrow();
            (exchange.address(), exchange.established(now))
        };
        let peer = self.own.borrow().as_ref().map(|own| own.peer);
        if peer.is_some() && peer != address {
            // What the last client sent meanwhile is a stranger's.
            if let Some(own) = self.own.take() {
                let left = own.leftover();
                let tally = &self.exchange.borrow().tally;
                tally.foreign.fetch_add(left, Ordering::Relaxed);
            }
        }
        let Some(peer) = established.filter(|established| peer != Some(*established)) else {
            return false;
        };
        // Where the system gives none the common socket does.
        match Own::of(datagrams, peer) {
            Ok(own) => {
                self.own.replace(Some(Rc::new(own)));
                true
            }
            Err(error) => {
                tracing::debug!(%error, "no socket for the client alone");
                false
            }
        }
    }

    /// Sends a Challenge, if it is time.
    fn challenge(&self, now: Instant) {
        let due = self.exchange.borrow_mut().challenge(now);
        if let Some((to, packet)) = due {
            // One that is lost is sent again.
            let _ = self.sending.send_to(&packet, to);
        }
    }
}

/// Repeats Challenges, without end.
async fn prove(shared: &Shared) {
    loop {
        tokio::time::sleep(LOOK).await;
        shared.challenge(Instant::now());
    }
}

/// Where a datagram was read.
#[derive(Clone, Copy, PartialEq)]
enum Origin {
    /// On the common socket.
    All,
    /// There, while a client has its own: it is a stranger's.
    Strangers,
    /// On the client's own socket.
    Own,
}

/// What comes on both sockets.
struct Reader {
    datagrams: Datagrams,
    /// Longer than any packet: a longer datagram is refused for its length.
    buffer: Vec<u8>,
    own_buffer: Vec<u8>,
    strangers: Strangers,
    /// How many may have come before a client got its own socket.
    before: u32,
}

impl Reader {
    /// The next datagram; none where there is none, and it is to be looked for again.
    async fn next(&mut self, shared: &Shared) -> Option<(Datagram, Origin)> {
        if self.before > 0 {
            self.before -= 1;
            let received = self.datagrams.receive(&mut self.buffer).ok();
            if received.is_none() {
                self.before = 0;
            }
            return received.map(|datagram| (datagram, Origin::All));
        }
        let own = shared.own();
        let is_guarded = own.is_some() && shared.exchange.borrow().is_held(Instant::now());
        let (datagrams, buffer) = (&mut self.datagrams, &mut self.buffer);
        let (own_buffer, strangers) = (&mut self.own_buffer, &mut self.strangers);
        let of_own = async {
            match &own {
                Some(own) => own.receive(own_buffer).await,
                None => pending().await,
            }
        };
        let of_all = async {
            if is_guarded {
                strangers.wait().await;
            }
            let receive = || datagrams.receive(buffer);
            shared.socket.async_io(Interest::READABLE, receive).await
        };
        let (received, origin) = tokio::select! {
            biased;
            received = of_own => (received, Origin::Own),
            received = of_all => (received, if is_guarded { Origin::Strangers } else { Origin::All }),
        };
        match (received, own) {
            (Ok(datagram), _) => {
                if origin == Origin::Strangers {
                    self.strangers.took();
                }
                Some((datagram, origin))
            }
            (Err(error), Some(own)) if origin == Origin::Own => {
                if error.kind() == io::ErrorKind::ConnectionRefused {
                    shared.end(&own);
                }
                None
            }
            // An error here answers an earlier datagram to a client that has gone.
            (Err(_), _) => None,
        }
    }

    fn packet(&self, datagram: &Datagram, origin: Origin) -> &[u8] {
        let buffer = match origin {
            Origin::Own => &self.own_buffer,
            Origin::All | Origin::Strangers => &self.buffer,
        };
        buffer.get(..datagram.length).unwrap_or_default()
    }
}

/// Hands on what comes from the exchange's client, until nobody takes it.
async fn receive(shared: &Shared, datagrams: Datagrams, arrivals: Intake) {
    let mut reader = Reader {
        datagrams,
        buffer: vec![0; 1 << 16],
        own_buffer: vec![0; 1 << 16],
        strangers: Strangers::default(),
        before: 0,
    };
    for number in 1_u64.. {
        // What leaves is not to wait for a flood's end.
        if number.is_multiple_of(IN_A_ROW) {
            tokio::task::yield_now().await;
        }
        let Some((datagram, origin)) = reader.next(shared).await else {
            continue;
        };
        let packet = reader.packet(&datagram, origin);
        let is_stranger = origin == Origin::Strangers;
        if !hand_on(shared, &arrivals, datagram, packet, is_stranger) {
            return;
        }
        if shared.settle(&reader.datagrams, Instant::now()) {
            reader.before = BEFORE;
        }
    }
}

/// Takes a datagram; `is_stranger`: from the common socket. False when the emulator has closed.
fn hand_on(
    shared: &Shared,
    arrivals: &Intake,
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
    let heard = exchange.receive(from, packet, arrived);
    let is_new = exchange.number != number;
    let taken = match heard {
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
    if heard == ExchangeEvent::Proof || is_new {
        shared.changed.notify_waiters();
    }
    shared.challenge(arrived);
    taken
}

/// How many datagrams of strangers are read: [`STRANGERS`] in each [`PAUSE`].
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

    fn took(&mut self) {
        if self.read == 0 {
            self.since = Some(Instant::now());
        }
        self.read += 1;
    }
}

/// Sends what is queued, until nothing can come any more.
async fn send(mut out: TxPath<'_>, mut departures: Receiver<Outbound>, limit: Option<f64>) {
    let mut pace = limit.map(|bytes_per_s| Pace::new(bytes_per_s, BURST));
    // Where a limit says when the next may leave, they go one by one.
    let most = if pace.is_some() { 1 } else { TOGETHER };
    let mut taken = Vec::with_capacity(most);
    while departures.recv_many(&mut taken, most).await > 0 {
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
struct TxPath<'a> {
    shared: &'a Shared,
    burst: Burst,
}

impl TxPath<'_> {
    /// Sends packets whose exchange still stands; refused ones are lost, and counted. Returns the
    /// bytes sent.
    async fn send(&mut self, batch: &mut Batch) -> usize {
        let tally = self.shared.exchange.borrow().tally.clone();
        let (mut at, mut bytes) = (0, 0);
        while let Some(rest) = batch.packets.get(at..).filter(|rest| !rest.is_empty()) {
            let sent = match self.permit(batch.exchange, rest).await {
                Ok((rest, to)) => self.hand_over(rest, to).await,
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

    /// Waits until packets of an exchange may leave: those and their address, or why the first
    /// never may.
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
                Permit::Never if self.shared.exchange.borrow().stands_as(exchange) => {
                    return Err(Unsent::NotProved);
                }
                Permit::Never => return Err(Unsent::ClientGone),
                // More of what it sends allows more, too.
                Permit::Wait => drop(tokio::time::timeout(LOOK, changed).await),
            }
        }
    }

    /// Hands the first of `packets` to the system; how many it took, or why it refuses the first.
    async fn hand_over(&mut self, packets: &[Bytes], to: SocketAddr) -> Result<usize, Unsent> {
        let own = self.shared.own().filter(|own| own.peer == to);
        let (socket, sending) = match &own {
            Some(own) => (&own.socket, &own.sending),
            None => (&self.shared.socket, &self.shared.sending),
        };
        let burst = &mut self.burst;
        let send = || burst.send(sending, packets, to);
        let sent = socket.async_io(Interest::WRITABLE, send).await;
        sent.map_err(|error| match (error.kind(), &own) {
            (io::ErrorKind::ConnectionRefused, Some(own)) => {
                self.shared.end(own);
                Unsent::ClientGone
            }
            _ => Unsent::Failed,
        })
    }
}
