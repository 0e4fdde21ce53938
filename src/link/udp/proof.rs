//! Proof of address (ICD, section 5.1). Source addresses can be forged. So a client gets a
//! Challenge that only the receiver at its address can return. Without a recent proof it gets
//! little more than it has sent.

use skyloop_protocols::packet::{apid, identify};
use skyloop_protocols::{Challenge, MAX_PACKET, Personality, Reply, WireTime};
use std::hash::{BuildHasher, RandomState};
use std::net::SocketAddr;
use std::time::{Duration, Instant};

/// Bytes sent to an unproved address for each byte from it, IP and UDP headers included (as in
/// QUIC: RFC 9000, section 8).
const FACTOR: usize = 3;
/// Minimum lifetime of a proof, however short `idle_s` is: an answer takes time.
const MIN_LIFETIME: Duration = Duration::from_secs(1);
/// Interval at which an unreturned Challenge is repeated.
const RETRY: Duration = Duration::from_millis(200);

/// Makes and recognizes Challenges.
pub(super) struct Prover {
    /// Whether clients must prove their addresses.
    is_on: bool,
    secret: RandomState,
    begun: Instant,
    lifetime: Duration,
}

/// Addressee of a Challenge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Party {
    /// The client of the exchange.
    Client,
    /// Another address while the client's is not proved.
    Other,
}

/// Proof of one address.
#[derive(Debug, Default)]
pub(super) struct Proof {
    /// When it last returned a Challenge; `None` if never, or if a packet came after the proof had
    /// lapsed.
    returned: Option<Instant>,
    /// When it last got a Challenge, and how many in total.
    challenged: Option<Instant>,
    challenges: u16,
    /// Bytes received and sent without proof. Between a lapse and the next packet, only the last
    /// returned Challenge counts as received.
    received: usize,
    sent: usize,
}

/// Bytes of a datagram with its headers (IPv4 20, IPv6 40, UDP 8).
fn datagram(address: SocketAddr, length: usize) -> usize {
    length + if address.is_ipv4() { 28 } else { 48 }
}

impl Prover {
    pub fn new(is_on: bool, idle: Duration) -> Prover {
        Prover {
            is_on,
            secret: RandomState::new(),
            begun: Instant::now(),
            lifetime: idle.max(MIN_LIFETIME),
        }
    }

    /// Whether clients must prove their addresses.
    pub fn is_on(&self) -> bool {
        self.is_on
    }

    /// Index of the lifetime at `now`: a token is valid in its own and the next one.
    fn epoch(&self, now: Instant) -> u64 {
        let since = now.saturating_duration_since(self.begun);
        (since.as_nanos() / self.lifetime.as_nanos()) as u64
    }

    /// A keyed hash with a key known only to this process.
    fn token(&self, party: Party, address: SocketAddr, epoch: u64) -> u64 {
        self.secret.hash_one((party, address, epoch))
    }

    /// Addressee of the Challenge, if `packet` is one that `from` has returned in time.
    pub fn returned(&self, from: SocketAddr, packet: &[u8], now: Instant) -> Option<Party> {
        if identify(packet).is_none_or(|(apid, _)| apid != apid::CHALLENGE) {
            return None;
        }
        let Ok((_, Reply::Challenge(Challenge { token }))) = Reply::decode(packet) else {
            return None;
        };
        let epoch = self.epoch(now);
        let epochs = [epoch, epoch.saturating_sub(1)];
        let is_of = |party: &Party| {
            epochs
                .map(|at| self.token(*party, from, at))
                .contains(&token)
        };
        [Party::Client, Party::Other].into_iter().find(is_of)
    }

    fn packet(
        &self,
        party: Party,
        address: SocketAddr,
        count: u16,
        now: Instant,
        personality: &Personality,
    ) -> Option<Vec<u8>> {
        let token = self.token(party, address, self.epoch(now));
        let (reply, mut buffer) = (Reply::Challenge(Challenge { token }), [0; MAX_PACKET]);
        let encode = personality.encode_reply;
        let length = encode(&reply, count, WireTime(0), &mut buffer).ok()?;
        buffer.get(..length).map(<[u8]>::to_vec)
    }

    /// A Challenge for another address, in answer to a valid packet. No state is needed: even the
    /// shortest command allows an answer of this length.
    pub fn challenge_other(
        &self,
        address: SocketAddr,
        now: Instant,
        personality: &Personality,
    ) -> Option<Vec<u8>> {
        self.packet(Party::Other, address, 0, now, personality)
    }

    /// Whether the proof of an address has lapsed without a packet since.
    pub fn has_lapsed(&self, proof: &Proof, now: Instant) -> bool {
        proof.returned.is_some() && !self.holds(proof, now)
    }

    /// Whether the proof of an address is valid.
    pub fn holds(&self, proof: &Proof, now: Instant) -> bool {
        let fresh = |at| now.saturating_duration_since(at) < self.lifetime;
        !self.is_on || proof.returned.is_some_and(fresh)
    }

    /// The next Challenge for an address, if it is due and the received bytes allow it. A silent
    /// address gets only a few.
    pub fn challenge(
        &self,
        proof: &mut Proof,
        address: SocketAddr,
        now: Instant,
        personality: &Personality,
    ) -> Option<Vec<u8>> {
        let holds = self.holds(proof, now);
        let wait = match proof.returned {
            Some(_) => self.lifetime / 4,
            None => RETRY,
        };
        let waits = |at| now.saturating_duration_since(at) < wait;
        if !self.is_on || proof.challenged.is_some_and(waits) {
            return None;
        }
        let packet = self.packet(Party::Client, address, proof.challenges, now, personality)?;
        if !holds && !proof.spend(address, packet.len()) {
            return None;
        }
        (proof.challenged, proof.challenges) = (Some(now), proof.challenges.wrapping_add(1));
        Some(packet)
    }
}

impl Proof {
    /// Notes a returned Challenge of `length` bytes.
    pub fn returned(&mut self, from: SocketAddr, length: usize, now: Instant) {
        self.returned = Some(now);
        (self.received, self.sent) = (datagram(from, length), 0);
    }

    /// When a Challenge was last returned, unless a packet came after the proof had lapsed.
    pub fn returned_at(&self) -> Option<Instant> {
        self.returned
    }

    /// Counts a packet received without proof.
    pub fn received(&mut self, from: SocketAddr, length: usize) {
        if self.returned.take().is_some() {
            (self.received, self.sent) = (0, 0);
        }
        self.received = self.received.saturating_add(datagram(from, length));
    }

    /// Counts a packet sent without proof; false if it exceeds the limit.
    pub fn spend(&mut self, to: SocketAddr, length: usize) -> bool {
        let sent = self.sent.saturating_add(datagram(to, length));
        let fits = sent <= self.received.saturating_mul(FACTOR);
        if fits {
            self.sent = sent;
        }
        fits
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::personality::NATIVE;

    fn at(port: u16) -> SocketAddr {
        SocketAddr::from(([127, 0, 0, 1], port))
    }

    #[test]
    fn challenge_proves_its_address_for_its_lifetime() {
        let prover = Prover::new(true, Duration::from_secs(4));
        let (mut proof, begin) = (Proof::default(), prover.begun);
        let s = |s| begin + Duration::from_millis((s * 1e3) as u64);
        proof.received(at(1), 18);
        let packet = prover.challenge(&mut proof, at(1), s(0.0), &NATIVE);
        let packet = packet.unwrap();
        let again = prover.challenge(&mut proof, at(1), s(0.1), &NATIVE);
        assert!(again.is_none(), "too early");
        let other = prover.challenge_other(at(1), s(0.0), &NATIVE).unwrap();
        for (from, when, holds) in [
            (at(1), 0.1, true),
            (at(1), 7.9, true),
            (at(1), 8.0, false),
            (at(2), 0.1, false),
        ] {
            for (packet, party) in [(&packet, Party::Client), (&other, Party::Other)] {
                let returned = prover.returned(from, packet, s(when));
                assert_eq!(returned, holds.then_some(party), "{when}");
            }
        }
        let mut forged = packet.clone();
        // A bit of the token: the CRC does not match.
        forged[20] ^= 1;
        assert_eq!(prover.returned(at(1), &forged, s(0.1)), None);
        let another = Prover::new(true, Duration::from_secs(4));
        assert_eq!(another.returned(at(1), &packet, s(0.1)), None);
        assert!(!prover.holds(&proof, s(0.1)));
        proof.returned(at(1), packet.len(), s(0.1));
        assert!(prover.holds(&proof, s(4.0)) && !prover.holds(&proof, s(4.1)));
        assert!(
            prover
                .challenge(&mut proof, at(1), s(1.0), &NATIVE)
                .is_some()
        );
    }

    /// X-Val: ICD, section 5.1: a Challenge takes 25 + 28 bytes, and three times as many may be
    /// sent for the last returned one.
    #[test]
    fn after_a_lapse_three_challenges_are_sent_and_more_only_after_a_packet() {
        let prover = Prover::new(true, Duration::from_secs(4));
        let (mut proof, begin) = (Proof::default(), prover.begun);
        let ms = |ms| begin + Duration::from_millis(ms);
        let challenges = |proof: &mut Proof, from: u64, to: u64| -> Vec<u64> {
            let mut due = |when| prover.challenge(proof, at(1), ms(when), &NATIVE).is_some();
            let times = (from..to).step_by(100);
            times.filter(|when| due(*when)).collect()
        };
        proof.returned(at(1), 25, ms(0));
        // Every quarter of 4 s, also while the proof is valid.
        assert_eq!(
            challenges(&mut proof, 500, 20_000),
            [500, 1500, 2500, 3500, 4500, 5500, 6500]
        );
        // A Ping takes 46 bytes: three times as many allow two Challenges.
        proof.received(at(1), 18);
        assert_eq!(challenges(&mut proof, 20_000, 25_000), [20_000, 20_200]);
    }

    /// X-Val: RFC 9000, section 8.1: three times the received bytes. A Ping of 18 bytes takes 46
    /// with its headers, so 138 are allowed.
    #[test]
    fn without_proof_three_bytes_are_sent_per_received_byte() {
        let mut proof = Proof::default();
        assert!(!proof.spend(at(1), 0));
        proof.received(at(1), 18);
        assert!(proof.spend(at(1), 100) && !proof.spend(at(1), 0));
        let mut proof = Proof::default();
        proof.received(at(1), 18);
        assert!(
            proof.spend(at(1), 25) && proof.spend(at(1), 21),
            "Challenge and Ack"
        );
        assert!(!proof.spend(at(1), 264), "no Status");
    }
}
