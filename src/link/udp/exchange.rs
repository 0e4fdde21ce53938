//! The client of a UDP link: one at a time.

use super::proof::{Party, Proof, Prover};
use crate::kind::Options;
use crate::log_rate_limit::LogRateLimit;
use crate::tally::{Tally, count, is_of_frame};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Time for which a client without proof of address excludes others without proof.
const GRACE: Duration = Duration::from_secs(1);

/// The exchange with the present client.
pub(super) struct Exchange {
    pub number: u32,
    client: Option<Client>,
    prover: Prover,
    /// A Challenge for another address than the client's. It is sent before any other.
    for_other: Option<(SocketAddr, Vec<u8>)>,
    strangers: LogRateLimit,
    options: Options,
    pub tally: Arc<Tally>,
}

struct Client {
    address: SocketAddr,
    /// Whether it has sent a valid packet. Before that, any packet of another address replaces it.
    is_valid: bool,
    /// Whether it has sent Reset and nothing valid since: any valid packet replaces it.
    released: bool,
    opened: Instant,
    /// When it last sent a packet. Returned Challenges do not count.
    received_at: Instant,
    proof: Proof,
}

/// Meaning of a datagram.
#[derive(Debug, PartialEq)]
pub(super) enum ExchangeEvent {
    /// A packet of this exchange.
    Packet(u32),
    /// A returned Challenge.
    Proof,
    /// A packet of another sender.
    Stranger,
}

/// Whether a packet may leave.
#[derive(Debug, PartialEq)]
pub(super) enum Permit {
    /// It and all following packets, to this address.
    All(SocketAddr),
    /// Only this packet: the address is not proved.
    One(SocketAddr),
    /// Not before the client has sent more or proved its address.
    Wait,
    /// No: its client has gone, or it requires a proof.
    Never,
}

impl Exchange {
    /// No client yet. `proves`: clients must prove their addresses.
    pub fn new(options: Options, tally: Arc<Tally>, proves: bool) -> Exchange {
        Exchange {
            number: 0,
            client: None,
            prover: Prover::new(proves, options.idle),
            for_other: None,
            strangers: LogRateLimit::default(),
            options,
            tally,
        }
    }

    /// Handles a datagram, which may open a new exchange. The sender of a returned Challenge only
    /// replaces a client without proof.
    pub fn receive(&mut self, from: SocketAddr, packet: &[u8], now: Instant) -> ExchangeEvent {
        let returned = self.prover.returned(from, packet, now);
        let valid = returned.is_some() || (self.options.personality.decode_command)(packet).is_ok();
        match &self.client {
            Some(client) if client.address == from => {}
            Some(client) if returned == Some(Party::Other) && !self.is_proved(client, now) => {
                // No packet of the new client reports the change yet.
                self.tally.end(self.number);
                self.open(from, now);
            }
            // A late Challenge may belong to an ended exchange.
            _ if returned.is_some() => return ExchangeEvent::Stranger,
            Some(client) if !self.yields(client, valid, now) => {
                if valid && !self.is_proved(client, now) {
                    let personality = self.options.personality;
                    let challenge = self.prover.challenge_other(from, now, personality);
                    self.for_other = challenge.map(|challenge| (from, challenge));
                }
                return ExchangeEvent::Stranger;
            }
            _ => self.open(from, now),
        }
        let Some(client) = &mut self.client else {
            return ExchangeEvent::Stranger;
        };
        if returned.is_some() {
            client.is_valid |= returned == Some(Party::Other);
            client.proof.returned(from, packet.len(), now);
            self.tally.await_proof(false);
            return ExchangeEvent::Proof;
        }
        client.received_at = now;
        if valid {
            (client.is_valid, client.released) = (true, false);
        }
        // The proof may have lapsed since the last packet.
        let holds = self.prover.holds(&client.proof, now);
        if !holds {
            client.proof.received(from, packet.len());
        }
        self.tally.await_proof(!holds);
        ExchangeEvent::Packet(self.number)
    }

    fn is_proved(&self, client: &Client, now: Instant) -> bool {
        self.prover.holds(&client.proof, now)
    }

    /// Whether a packet of another address, `valid` or not, replaces the client.
    fn yields(&self, client: &Client, valid: bool, now: Instant) -> bool {
        // An invalid one does not replace a valid client: after a Reset it may still take frames.
        !client.is_valid || (valid && (client.released || !self.stands(client, now)))
    }

    /// Whether a client with a valid packet and no Reset since excludes others.
    fn stands(&self, client: &Client, now: Instant) -> bool {
        let within = |since, limit| now.saturating_duration_since(since) < limit;
        let idle = self.options.idle;
        if self.is_proved(client, now) {
            let returned = client.proof.returned_at();
            within(
                returned
                    .unwrap_or(client.received_at)
                    .max(client.received_at),
                idle,
            )
        } else {
            within(client.opened, GRACE.min(idle))
        }
    }

    fn open(&mut self, from: SocketAddr, now: Instant) {
        // 0 is not a valid number.
        self.number = self.number.wrapping_add(1).max(1);
        self.tally.await_proof(self.prover.is_on());
        self.client = Some(Client {
            address: from,
            is_valid: false,
            released: false,
            opened: now,
            received_at: now,
            proof: Proof::default(),
        });
    }

    /// The client, if it has proved its address and sent a valid packet.
    pub fn established(&self, now: Instant) -> Option<SocketAddr> {
        let client = self.client.as_ref();
        let client = client.filter(|one| one.is_valid && self.prover.holds(&one.proof, now));
        client.map(|client| client.address)
    }

    pub fn address(&self) -> Option<SocketAddr> {
        self.client.as_ref().map(|client| client.address)
    }

    /// Whether the client excludes others now.
    pub fn is_held(&self, now: Instant) -> bool {
        let client = self.client.as_ref();
        client.is_some_and(|client| !self.yields(client, true, now))
    }

    /// Counts a packet of a stranger; logs the reason at intervals.
    pub fn ignore(&mut self, from: SocketAddr, now: Instant) {
        count(&self.tally.foreign);
        if let Some(client) = &self.client
            && let Some(packets) = self.strangers.count(now)
        {
            let more = match packets {
                1 => String::new(),
                more => format!(" ({more} others before them)"),
            };
            let idle = self.options.idle;
            let until = if client.released {
                "a valid packet comes from another address".to_string()
            } else if self.is_proved(client, now) {
                format!("it sends Reset or nothing for {} s", idle.as_secs_f64())
            } else {
                let s = GRACE.min(idle).as_secs_f64();
                format!("another address returns its Challenge, or for {s} s")
            };
            tracing::warn!(
                "packets from {from} are ignored{more}: {} is the client until {until}",
                client.address,
            );
        }
    }

    /// Whether `number` is the present exchange with a client.
    pub fn is_current(&self, number: u32) -> bool {
        number == self.number && self.client.is_some()
    }

    /// Whether a packet of exchange `number` may leave. Without proof of address no frame leaves.
    pub fn permit(&mut self, number: u32, packet: &[u8], now: Instant) -> Permit {
        let Some(client) = self.client.as_mut().filter(|_| number == self.number) else {
            return Permit::Never;
        };
        let is_of_frame = is_of_frame(packet);
        let permit = if self.prover.holds(&client.proof, now) {
            Permit::All(client.address)
        } else if is_of_frame || self.prover.has_lapsed(&client.proof, now) {
            if is_of_frame {
                self.tally.withhold();
            }
            Permit::Never
        } else if client.proof.spend(client.address, packet.len()) {
            Permit::One(client.address)
        } else {
            Permit::Wait
        };
        self.tally.await_proof(!matches!(permit, Permit::All(_)));
        permit
    }

    /// The next due Challenge and its address.
    pub fn challenge(&mut self, now: Instant) -> Option<(SocketAddr, Vec<u8>)> {
        if let Some(for_other) = self.for_other.take() {
            return Some(for_other);
        }
        let client = self.client.as_mut().filter(|client| client.is_valid)?;
        let (proof, address) = (&mut client.proof, client.address);
        self.tally.await_proof(!self.prover.holds(proof, now));
        let personality = self.options.personality;
        let packet = self.prover.challenge(proof, address, now, personality)?;
        Some((address, packet))
    }

    /// Ends the exchange of a client whose address refuses datagrams.
    pub fn end(&mut self, address: SocketAddr) {
        let Some(client) = self.client.take_if(|client| client.address == address) else {
            return;
        };
        self.tally.end(self.number);
        self.tally.await_proof(false);
        if client.is_valid && !client.released {
            tracing::warn!(
                "{address} has closed its socket without a Reset: its exchange has ended, waiting packets are lost"
            );
        }
    }

    pub fn release(&mut self, number: u32, requested: Instant) {
        if let Some(client) = &mut self.client
            && number == self.number
            && client.received_at <= requested
        {
            client.released = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::ExchangeEvent::{Packet, Proof as Returned, Stranger};
    use super::*;
    use crate::fixture::options;
    use skyloop_protocols::{Command, MAX_PACKET, WireTime, apid};

    fn at(port: u16) -> SocketAddr {
        SocketAddr::from(([127, 0, 0, 1], port))
    }

    /// An exchange with a valid and an invalid packet. Times are ms since `begun`.
    struct Rig {
        exchange: Exchange,
        begun: Instant,
        good: Vec<u8>,
        bad: Vec<u8>,
    }

    impl Rig {
        fn new(idle_ms: u64, proves: bool) -> Rig {
            let idle = Duration::from_millis(idle_ms);
            let options = Options { idle, ..options() };
            let mut buffer = [0; MAX_PACKET];
            let length = Command::Ping.encode(0, WireTime(0), &mut buffer).unwrap();
            Rig {
                exchange: Exchange::new(options, Arc::default(), proves),
                begun: Instant::now(),
                good: buffer[..length].to_vec(),
                bad: buffer[..length - 1].to_vec(),
            }
        }

        fn ms(&self, ms: u64) -> Instant {
            self.begun + Duration::from_millis(ms)
        }

        fn receive(&mut self, port: u16, packet: &[u8], ms: u64) -> ExchangeEvent {
            let now = self.ms(ms);
            self.exchange.receive(at(port), packet, now)
        }

        /// Receives a valid packet.
        fn good(&mut self, port: u16, ms: u64) -> ExchangeEvent {
            self.receive(port, &self.good.clone(), ms)
        }

        /// Receives an invalid packet.
        fn bad(&mut self, port: u16, ms: u64) -> ExchangeEvent {
            self.receive(port, &self.bad.clone(), ms)
        }

        fn permit(&mut self, number: u32, packet: &[u8], ms: u64) -> Permit {
            let now = self.ms(ms);
            self.exchange.permit(number, packet, now)
        }

        /// The next Challenge and its port.
        fn challenge(&mut self, ms: u64) -> Option<(u16, Vec<u8>)> {
            let (to, packet) = self.exchange.challenge(self.ms(ms))?;
            Some((to.port(), packet))
        }

        fn release(&mut self, number: u32, ms: u64) {
            let requested = self.ms(ms);
            self.exchange.release(number, requested);
        }
    }

    /// Zeros after the APID (ICD, section 2): version 0, with a secondary header.
    fn of_apid(apid: u16, length: usize) -> Vec<u8> {
        let mut packet = vec![0; length];
        packet[..2].copy_from_slice(&(0x800 | apid).to_be_bytes());
        packet
    }

    #[test]
    fn exchange_lasts_until_it_is_idle_or_released() {
        let mut rig = Rig::new(40, false);
        assert_eq!(rig.bad(1, 0), Packet(1));
        assert_eq!(rig.bad(2, 0), Packet(2));
        // A valid packet establishes it until it is idle.
        assert_eq!(rig.good(2, 0), Packet(2));
        assert_eq!(rig.good(1, 39), Stranger);
        assert_eq!(rig.bad(2, 39), Packet(2));
        assert_eq!(rig.good(1, 78), Stranger);
        assert_eq!(rig.bad(1, 79), Stranger);
        assert_eq!(rig.good(1, 79), Packet(3));
        assert_eq!(rig.permit(2, b"-", 80), Permit::Never);
        assert_eq!(rig.permit(3, b"-", 80), Permit::All(at(1)));
        // A release of another exchange is ignored, and one before a later packet of the client.
        rig.release(2, 80);
        assert_eq!(rig.good(2, 80), Stranger);
        assert_eq!(rig.good(1, 81), Packet(3));
        rig.release(3, 80);
        assert_eq!(rig.good(2, 82), Stranger);
        rig.release(3, 81);
        // An invalid packet replaces no client.
        assert_eq!(rig.bad(2, 82), Stranger);
        assert_eq!(rig.receive(2, b"junk", 9000), Stranger);
        assert_eq!(rig.good(3, 9000), Packet(4));
    }

    #[test]
    fn client_without_proof_gets_little_and_is_soon_replaced() {
        let mut rig = Rig::new(5000, true);
        assert_eq!(rig.good(1, 0), Packet(1));
        let [answer, long_answer] = [21, 264].map(|length| of_apid(apid::ACK, length));
        let of_frame = of_apid(apid::FRAME_HEADER, 17);
        let (to, challenge) = rig.challenge(0).unwrap();
        assert_eq!(to, 1);
        assert_eq!(rig.exchange.established(rig.ms(0)), None);
        assert_eq!(rig.permit(1, &answer, 0), Permit::One(at(1)));
        assert_eq!(rig.permit(1, &long_answer, 0), Permit::Wait);
        assert_eq!(rig.permit(1, &of_frame, 0), Permit::Never);
        assert_eq!(rig.exchange.tally.unproved(), 1);
        assert!(rig.exchange.tally.awaits_proof());
        assert_eq!(rig.good(2, 999), Stranger);
        // A Challenge returned by another address does not prove the client's.
        assert_eq!(rig.receive(2, &challenge, 999), Stranger);
        assert_eq!(rig.receive(1, &challenge, 999), Returned);
        assert!(!rig.exchange.tally.awaits_proof());
        assert_eq!(rig.permit(1, &of_frame, 999), Permit::All(at(1)));
        assert_eq!(rig.exchange.established(rig.ms(999)), Some(at(1)));
        // Its packets continue, which can be forged, and no Challenge is returned.
        for when in [2000, 4000, 5900] {
            assert_eq!(rig.good(1, when), Packet(1));
            assert_eq!(rig.good(2, when), Stranger);
        }
        assert_eq!(rig.permit(1, &of_frame, 5998), Permit::All(at(1)));
        // Bytes sent with proof no longer count: the queue is dropped until more arrives.
        assert_eq!(rig.permit(1, &of_frame, 5999), Permit::Never);
        assert_eq!(rig.permit(1, &answer, 5999), Permit::Never);
        assert_eq!(rig.exchange.tally.unproved(), 2);
        assert_eq!(rig.good(1, 5999), Packet(1));
        assert!(rig.challenge(5999).is_some());
        assert_eq!(rig.permit(1, &of_frame, 5999), Permit::Never);
        assert_eq!(rig.permit(1, &answer, 5999), Permit::One(at(1)));
        assert_eq!(rig.permit(1, &long_answer, 5999), Permit::Wait);
        assert_eq!(rig.good(2, 5999), Packet(2));
        // Without proof that client is replaced after 1 s.
        assert_eq!(rig.good(3, 6998), Stranger);
        assert_eq!(rig.good(3, 6999), Packet(3));
    }

    /// Forged packets of other addresses delay a client by at most one returned Challenge.
    #[test]
    fn proved_address_replaces_an_unproved_one() {
        // Whether the client of the exchange returns its own Challenge first.
        for is_proved in [false, true] {
            let mut rig = Rig::new(5000, true);
            assert_eq!(rig.good(1, 0), Packet(1));
            let (_, own) = rig.challenge(0).unwrap();
            // An invalid packet gets no Challenge.
            assert_eq!(rig.bad(2, 10), Stranger);
            assert_eq!(rig.challenge(10), None);
            assert_eq!(rig.good(2, 10), Stranger);
            let (to, challenge) = rig.challenge(10).unwrap();
            assert_eq!(to, 2);
            for forged in [3, 4, 5] {
                assert_eq!(rig.good(forged, 20), Stranger);
                assert_eq!(rig.receive(forged, &challenge, 20), Stranger);
            }
            if is_proved {
                assert_eq!(rig.receive(1, &own, 30), Returned);
            }
            let event = rig.receive(2, &challenge, 40);
            assert_eq!(event == Stranger, is_proved);
            let client = if is_proved { 1 } else { 2 };
            assert_eq!(rig.exchange.established(rig.ms(40)), Some(at(client)));
            assert_eq!(rig.exchange.tally.has_ended(1), !is_proved);
            // From now on others get no Challenge.
            while rig.challenge(40).is_some() {}
            assert_eq!(rig.good(3, 50), Stranger);
            assert_eq!(rig.challenge(50), None);
            assert_eq!(rig.good(client, 60), Packet(client.into()));
        }
    }

    /// A client that sends Reset first, and then only takes frames (ICD, section 5.1).
    #[test]
    fn client_gets_frames_after_its_reset_until_a_valid_packet_of_another() {
        // Time of the returned Challenge; the Reset is handled at 10 ms. `None`: no proof required.
        for returned in [Some(5), Some(20), None] {
            let mut rig = Rig::new(5000, returned.is_some());
            rig.good(1, 0);
            let challenge = rig.challenge(0);
            if returned != Some(5) {
                rig.release(1, 0);
            }
            if let (Some((_, challenge)), Some(ms)) = (challenge, returned) {
                assert_eq!(rig.receive(1, &challenge, ms), Returned);
            }
            if returned == Some(5) {
                rig.release(1, 0);
            }
            let is_challenged = rig.challenge(1300).is_some();
            assert_eq!(is_challenged, returned.is_some(), "{returned:?}");
            let of_frame = of_apid(apid::FRAME_HEADER, 17);
            assert_eq!(rig.permit(1, &of_frame, 1300), Permit::All(at(1)));
            assert_eq!(rig.bad(2, 1300), Stranger);
            assert_eq!(rig.good(2, 1300), Packet(2));
        }
    }

    #[test]
    fn late_challenge_neither_opens_nor_extends_an_exchange() {
        let mut rig = Rig::new(5000, true);
        assert_eq!(rig.good(1, 0), Packet(1));
        let (_, challenge) = rig.challenge(0).unwrap();
        rig.release(1, 1);
        assert_eq!(rig.receive(1, &challenge, 2), Returned);
        assert_eq!(rig.good(2, 3), Packet(2));
        assert_eq!(rig.receive(1, &challenge, 4), Stranger);
        rig.exchange.end(at(2));
        assert_eq!(rig.receive(1, &challenge, 5), Stranger);
        assert!(!rig.exchange.is_held(rig.ms(5)));
    }

    #[test]
    fn closed_client_is_replaced() {
        let mut rig = Rig::new(5000, false);
        assert_eq!(rig.good(1, 0), Packet(1));
        rig.exchange.end(at(2));
        assert!(rig.exchange.is_held(rig.ms(0)) && !rig.exchange.tally.has_ended(1));
        rig.exchange.end(at(1));
        assert!(rig.exchange.tally.has_ended(1));
        assert_eq!(rig.permit(1, b"-", 0), Permit::Never);
        assert_eq!(rig.good(2, 0), Packet(2));
    }
}
