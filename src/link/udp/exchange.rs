//! Who the emulator talks with over UDP: one client at a time.

use crate::link::{Options, Tally, count};
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Instant;

/// Who the emulator talks with.
pub(super) struct Exchange {
    pub number: u32,
    client: Option<Client>,
    /// Whether the log names a stranger already.
    told: bool,
    options: Options,
    pub tally: Arc<Tally>,
}

struct Client {
    address: SocketAddr,
    /// Whether it has sent a valid packet, and no Reset since. Without, anybody may take its place.
    proven: bool,
    heard: Instant,
}

impl Exchange {
    /// Nobody yet.
    pub fn new(options: Options, tally: Arc<Tally>) -> Exchange {
        Exchange {
            number: 0,
            client: None,
            told: false,
            options,
            tally,
        }
    }

    /// Whether a packet from `from` that has come `now` belongs to the exchange; opens a new one if it may.
    pub fn admit(&mut self, from: SocketAddr, packet: &[u8], now: Instant) -> bool {
        let valid = (self.options.personality.decode_command)(packet).is_ok();
        if let Some(client) = &mut self.client {
            if client.address == from {
                client.proven |= valid;
                client.heard = now;
                return true;
            }
            let idle = now.saturating_duration_since(client.heard) >= self.options.idle;
            if client.proven && !(idle && valid) {
                return false;
            }
        }
        self.number = self.number.wrapping_add(1);
        self.told = false;
        self.client = Some(Client {
            address: from,
            proven: valid,
            heard: now,
        });
        true
    }

    /// Counts a packet of a stranger, and says why it is not answered.
    pub fn ignore(&mut self, from: SocketAddr) {
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

    pub fn release(&mut self, number: u32, asked: Instant) {
        if let Some(client) = &mut self.client
            && number == self.number
            && client.heard <= asked
        {
            client.proven = false;
        }
    }

    pub fn client_of(&self, number: u32) -> Option<SocketAddr> {
        self.client
            .as_ref()
            .filter(|_| number == self.number)
            .map(|client| client.address)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::personality::NATIVE;
    use skyloop_protocols::{Command, MAX_PACKET, WireTime};
    use std::time::Duration;

    fn at(port: u16) -> SocketAddr {
        SocketAddr::from(([127, 0, 0, 1], port))
    }

    #[test]
    fn an_exchange_stands_until_it_is_idle_or_released() {
        let options = Options {
            idle: Duration::from_millis(40),
            personality: &NATIVE,
            bus: None,
        };
        let mut buffer = [0; MAX_PACKET];
        let length = Command::Ping.encode(0, WireTime(0), &mut buffer).unwrap();
        let (good, bad) = (&buffer[..length], &buffer[..length - 1]);
        let tally = Arc::new(Tally::default());
        let mut exchange = Exchange::new(options, tally);
        let begun = Instant::now();
        let ms = |ms| begun + Duration::from_millis(ms);
        assert!(
            exchange.admit(at(1), bad, ms(0)),
            "anybody may be told that a first packet is bad"
        );
        assert!(exchange.admit(at(2), bad, ms(0)), "and the next one too");
        assert!(exchange.admit(at(2), good, ms(0)));
        assert_eq!(
            (exchange.client_of(1), exchange.client_of(2)),
            (None, Some(at(2)))
        );
        let stands = !exchange.admit(at(1), good, ms(39));
        assert!(stands, "a good one makes it stand");
        assert!(exchange.admit(at(2), bad, ms(39)));
        assert!(!exchange.admit(at(1), good, ms(78)));
        assert!(!exchange.admit(at(1), bad, ms(79)));
        assert!(exchange.admit(at(1), good, ms(79)), "until it is idle");
        exchange.release(2, ms(80));
        let stands = !exchange.admit(at(2), good, ms(80));
        assert!(stands, "another's release is none");
        assert!(exchange.admit(at(1), good, ms(81)));
        exchange.release(3, ms(80));
        let stands = !exchange.admit(at(2), good, ms(82));
        assert!(stands, "nor one that its client has gone on from");
        exchange.release(3, ms(81));
        assert!(exchange.admit(at(2), bad, ms(82)), "or released");
        assert!(exchange.admit(at(3), good, ms(82)));
        assert_eq!(exchange.client_of(5), Some(at(3)));
    }
}
