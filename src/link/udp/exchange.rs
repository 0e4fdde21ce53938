//! The client of a UDP link: one at a time.

use super::proof::{Party, Proof, Prover};
use crate::every::Every;
use crate::kind::Options;
use crate::tally::{Tally, count, is_of_frame};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long a client without proof keeps others out that have none either.
const GRACE: Duration = Duration::from_secs(1);

/// Who the emulator talks with.
pub(super) struct Exchange {
    pub number: u32,
    client: Option<Client>,
    prover: Prover,
    /// A Challenge for an address that is not the client's. It leaves before any other.
    for_other: Option<(SocketAddr, Vec<u8>)>,
    /// Messages about strangers.
    strangers: Every,
    options: Options,
    pub tally: Arc<Tally>,
}

struct Client {
    address: SocketAddr,
    /// Whether it has sent a valid packet. Without, any packet of another address takes its place.
    is_valid: bool,
    /// Whether it has sent Reset and nothing valid since: any valid packet replaces it.
    released: bool,
    opened: Instant,
    /// When it sent a packet last. Challenges that it returned do not count.
    heard: Instant,
    proof: Proof,
}

/// What a datagram is.
#[derive(Debug, PartialEq)]
pub(super) enum ExchangeEvent {
    /// A packet of this exchange.
    Packet(u32),
    /// A Challenge that was returned.
    Proof,
    /// A packet of somebody else.
    Stranger,
}

/// Whether a packet may leave.
#[derive(Debug, PartialEq)]
pub(super) enum Permit {
    /// It and all behind it, to this address.
    All(SocketAddr),
    /// It alone: the address is not proved.
    One(SocketAddr),
    /// Not before the address is proved.
    Wait,
    /// Its client has gone, or it must not leave without proof.
    Never,
}

impl Exchange {
    /// Nobody yet. `proves`: addresses are to be proved.
    pub fn new(options: Options, tally: Arc<Tally>, proves: bool) -> Exchange {
        Exchange {
            number: 0,
            client: None,
            prover: Prover::new(proves, options.idle),
            for_other: None,
            strangers: Every::default(),
            options,
            tally,
        }
    }

    /// Takes a datagram; opens a new exchange if it may. The sender of a returned Challenge only
    /// replaces a client that has proved nothing.
    pub fn receive(&mut self, from: SocketAddr, packet: &[u8], now: Instant) -> ExchangeEvent {
        let returned = self.prover.returned(from, packet, now);
        let valid = returned.is_some() || (self.options.personality.decode_command)(packet).is_ok();
        match &self.client {
            Some(client) if client.address == from => {}
            Some(client) if returned == Some(Party::Other) && !self.is_proved(client, now) => {
                // No packet of the new client says so yet.
                self.tally.end(self.number);
                self.open(from, now);
            }
            // It may be late, of an exchange that has ended.
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
        client.heard = now;
        if valid {
            (client.is_valid, client.released) = (true, false);
        }
        // A proof may have lapsed since the last packet.
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

    /// Whether a packet of another address, `valid` or not, takes the client's place.
    fn yields(&self, client: &Client, valid: bool, now: Instant) -> bool {
        // One that is not valid never does: after a Reset the client may go on taking frames.
        !client.is_valid || (valid && (client.released || !self.stands(client, now)))
    }

    /// Whether a client that has sent a valid packet, and no Reset since, keeps others out.
    fn stands(&self, client: &Client, now: Instant) -> bool {
        let within = |since, limit| now.saturating_duration_since(since) < limit;
        let idle = self.options.idle;
        if self.is_proved(client, now) {
            let returned = client.proof.returned_at();
            within(returned.unwrap_or(client.heard).max(client.heard), idle)
        } else {
            within(client.opened, GRACE.min(idle))
        }
    }

    fn open(&mut self, from: SocketAddr, now: Instant) {
        // 0 is no exchange's number.
        self.number = self.number.wrapping_add(1).max(1);
        self.tally.await_proof(self.prover.is_on());
        self.client = Some(Client {
            address: from,
            is_valid: false,
            released: false,
            opened: now,
            heard: now,
            proof: Proof::default(),
        });
    }

    /// The client, if it has proved its address and sent a valid packet.
    pub fn established(&self, now: Instant) -> Option<SocketAddr> {
        let client = self.client.as_ref();
        let client = client.filter(|one| one.is_valid && self.prover.holds(&one.proof, now));
        client.map(|client| client.address)
    }

    /// The client's address.
    pub fn address(&self) -> Option<SocketAddr> {
        self.client.as_ref().map(|client| client.address)
    }

    /// Whether a client keeps others out now.
    pub fn is_held(&self, now: Instant) -> bool {
        let client = self.client.as_ref();
        client.is_some_and(|client| !self.yields(client, true, now))
    }

    /// Counts a packet of a stranger; logs the reason from time to time.
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

    /// Whether exchange `number` is this one, and its client is there.
    pub fn stands_as(&self, number: u32) -> bool {
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

    /// The next Challenge and its address, if it is time for one.
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

    /// Nobody listens at the client's address any more: its exchange ends.
    pub fn end(&mut self, address: SocketAddr) {
        let Some(client) = self.client.take_if(|client| client.address == address) else {
            return;
        };
        self.tally.end(self.number);
        self.tally.await_proof(false);
        if client.is_valid && !client.released {
            tracing::warn!(
                "{address} has closed its socket without a Reset: its exchange has ended, what waits for it is lost"
            );
        }
    }

    pub fn release(&mut self, number: u32, requested: Instant) {
        if let Some(client) = &mut self.client
            && number == self.number
            && client.heard <= requested
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

    /// An exchange, and a valid packet and one that is not. Times are ms since `begun`.
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

        /// Hears a valid packet.
        fn good(&mut self, port: u16, ms: u64) -> ExchangeEvent {
            self.receive(port, &self.good.clone(), ms)
        }

        /// Hears one that is not.
        fn bad(&mut self, port: u16, ms: u64) -> ExchangeEvent {
            self.receive(port, &self.bad.clone(), ms)
        }

        fn permit(&mut self, number: u32, packet: &[u8], ms: u64) -> Permit {
            let now = self.ms(ms);
            self.exchange.permit(number, packet, now)
        }

        /// The port that gets a Challenge, and that.
        fn challenge(&mut self, ms: u64) -> Option<(u16, Vec<u8>)> {
            let (to, packet) = self.exchange.challenge(self.ms(ms))?;
            Some((to.port(), packet))
        }

        fn release(&mut self, number: u32, ms: u64) {
            let requested = self.ms(ms);
            self.exchange.release(number, requested);
        }
    }

    /// Zeros behind the packet's APID (ICD, section 2): version 0, with a secondary header.
    fn of_apid(apid: u16, length: usize) -> Vec<u8> {
        let mut packet = vec![0; length];
        packet[..2].copy_from_slice(&(0x800 | apid).to_be_bytes());
        packet
    }

    #[test]
    fn an_exchange_stands_until_it_is_idle_or_released() {
        let mut rig = Rig::new(40, false);
        assert_eq!(rig.bad(1, 0), Packet(1));
        assert_eq!(rig.bad(2, 0), Packet(2));
        // A good one makes it stand, until it is idle.
        assert_eq!(rig.good(2, 0), Packet(2));
        assert_eq!(rig.good(1, 39), Stranger);
        assert_eq!(rig.bad(2, 39), Packet(2));
        assert_eq!(rig.good(1, 78), Stranger);
        assert_eq!(rig.bad(1, 79), Stranger);
        assert_eq!(rig.good(1, 79), Packet(3));
        assert_eq!(rig.permit(2, b"-", 80), Permit::Never);
        assert_eq!(rig.permit(3, b"-", 80), Permit::All(at(1)));
        // Another's release is none, nor one that its client has gone on from.
        rig.release(2, 80);
        assert_eq!(rig.good(2, 80), Stranger);
        assert_eq!(rig.good(1, 81), Packet(3));
        rig.release(3, 80);
        assert_eq!(rig.good(2, 82), Stranger);
        rig.release(3, 81);
        // What is no valid packet takes no client's place.
        assert_eq!(rig.bad(2, 82), Stranger);
        assert_eq!(rig.receive(2, b"junk", 9000), Stranger);
        assert_eq!(rig.good(3, 9000), Packet(4));
    }

    #[test]
    fn a_client_without_proof_gets_little_and_keeps_nobody_out_for_long() {
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
        // What another returns proves nothing of the client.
        assert_eq!(rig.receive(2, &challenge, 999), Stranger);
        assert_eq!(rig.receive(1, &challenge, 999), Returned);
        assert!(!rig.exchange.tally.awaits_proof());
        assert_eq!(rig.permit(1, &of_frame, 999), Permit::All(at(1)));
        assert_eq!(rig.exchange.established(rig.ms(999)), Some(at(1)));
        // Its packets go on, which anybody can forge, and no Challenge comes back.
        for when in [2000, 4000, 5900] {
            assert_eq!(rig.good(1, when), Packet(1));
            assert_eq!(rig.good(2, when), Stranger);
        }
        assert_eq!(rig.permit(1, &of_frame, 5998), Permit::All(at(1)));
        // Bytes sent with proof do not pay now: the queue is dropped until more comes.
        assert_eq!(rig.permit(1, &of_frame, 5999), Permit::Never);
        assert_eq!(rig.permit(1, &answer, 5999), Permit::Never);
        assert_eq!(rig.exchange.tally.unproved(), 2);
        assert_eq!(rig.good(1, 5999), Packet(1));
        assert!(rig.challenge(5999).is_some());
        assert_eq!(rig.permit(1, &of_frame, 5999), Permit::Never);
        assert_eq!(rig.permit(1, &answer, 5999), Permit::One(at(1)));
        assert_eq!(rig.permit(1, &long_answer, 5999), Permit::Wait);
        assert_eq!(rig.good(2, 5999), Packet(2));
        // Without proof that one is out after 1 s, and what proves the next comes first.
        assert_eq!(rig.good(3, 6998), Stranger);
        assert_eq!(rig.good(3, 6999), Packet(3));
    }

    /// Forged packets of other addresses delay a client by no more than one returned Challenge.
    #[test]
    fn an_address_that_returns_its_challenge_takes_the_place_of_one_that_has_proved_nothing() {
        // Whether the client of the exchange returns its own Challenge first.
        for is_proved in [false, true] {
            let mut rig = Rig::new(5000, true);
            assert_eq!(rig.good(1, 0), Packet(1));
            let (_, own) = rig.challenge(0).unwrap();
            // What is no valid packet is not answered.
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
            let heard = rig.receive(2, &challenge, 40);
            assert_eq!(heard == Stranger, is_proved);
            let client = if is_proved { 1 } else { 2 };
            assert_eq!(rig.exchange.established(rig.ms(40)), Some(at(client)));
            assert_eq!(rig.exchange.tally.has_ended(1), !is_proved);
            // From now on others are not answered.
            while rig.challenge(40).is_some() {}
            assert_eq!(rig.good(3, 50), Stranger);
            assert_eq!(rig.challenge(50), None);
            assert_eq!(rig.good(client, 60), Packet(client.into()));
        }
    }

    /// A client that sends Reset first, and then takes frames only (ICD, section 5.1).
    #[test]
    fn a_client_that_takes_frames_after_its_reset_goes_on_until_a_valid_packet_of_another() {
        // When the Challenge comes back; the Reset is handled at 10 ms. None: no proof of
        // addresses.
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
    fn a_challenge_that_comes_back_late_opens_no_exchange_and_keeps_none() {
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
    fn a_client_that_has_gone_leaves_the_place_free() {
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
