//! Pacing: the client says how many frame packets it can take in all, the emulator never sends more.
//!
//! The number is cumulative, so a lost or repeated `Credit` packet does no harm: the next one repairs it.

use crate::packet::apid;

/// The APIDs of frame packets: those that credit pays for.
pub const PAID: [u16; 7] = [
    apid::FRAME_HEADER,
    apid::PIXEL_BLOCK,
    apid::LABELS,
    apid::WINDOWS,
    apid::OBJECTS,
    apid::COMPRESSED,
    apid::FRAME_END,
];

/// The emulator's account of frame packets ([`PAID`]) in one exchange.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CreditAccount {
    granted: Option<u32>,
    sent: u32,
}

impl CreditAccount {
    /// A new exchange: nothing sent, not paced.
    pub const fn new() -> Self {
        Self {
            granted: None,
            sent: 0,
        }
    }

    /// Takes a `Credit` command's number; one that lies behind an earlier one (a late datagram) is ignored.
    ///
    /// False for any other one that lies behind the packets sent, or 2^31 or more ahead of them, which is the same: it
    /// is not taken.
    pub fn grant(&mut self, packets: u32) -> bool {
        let mut earlier = self.granted.into_iter();
        let is_late = earlier.any(|granted| !is_ahead(packets, granted));
        let is_in_range = packets == self.sent || is_ahead(packets, self.sent);
        if is_in_range && !is_late {
            self.granted = Some(packets);
        }
        is_in_range || is_late
    }

    /// The last grant taken, 0 before the first.
    pub fn granted(&self) -> u32 {
        self.granted.unwrap_or(0)
    }

    /// Whether one more frame packet may be sent. Always, until the first `Credit`.
    pub fn may_send(&self) -> bool {
        self.granted
            .is_none_or(|granted| is_ahead(granted, self.sent))
    }

    /// Books one frame packet as sent.
    pub fn spend(&mut self) {
        self.sent = self.sent.wrapping_add(1);
    }

    /// Frame packets sent in this exchange, modulo 2^32.
    pub const fn sent(&self) -> u32 {
        self.sent
    }
}

/// Whether `a` lies ahead of `b` on the circle of 2^32 numbers.
const fn is_ahead(a: u32, b: u32) -> bool {
    a.wrapping_sub(b) as i32 > 0
}

#[cfg(test)]
mod tests {
    use super::CreditAccount;

    /// ICD, section 5.3: at most 2^31 - 1 ahead of the number sent, here 9.
    #[test]
    fn a_grant_is_late_or_at_most_half_the_circle_ahead_of_what_was_sent() {
        const MAX: u32 = 9 + 0x7FFF_FFFF;
        for (before, packets, taken, granted) in [
            (None, 9, true, 9),
            (None, MAX, true, MAX),
            (None, MAX + 1, false, 0),
            (None, 8, false, 0),
            (Some(20), MAX, true, MAX),
            (Some(20), MAX + 1, false, 20),
            (Some(20), 19, true, 20),
            (Some(20), 5, true, 20),
            (Some(MAX), 9, true, MAX),
            (Some(MAX), 8, true, MAX),
            (Some(MAX), 5, false, MAX),
            (Some(MAX), MAX + 1, false, MAX),
            (Some(MAX), u32::MAX, false, MAX),
        ] {
            let mut account = CreditAccount {
                granted: before,
                sent: 9,
            };
            let found = (account.grant(packets), account.granted());
            assert_eq!(found, (taken, granted), "{packets} after {before:?}");
        }
    }

    #[test]
    fn credit_goes_on_over_the_wrap() {
        let mut account = CreditAccount {
            granted: Some(u32::MAX),
            sent: u32::MAX - 1,
        };
        account.spend();
        assert!(!account.may_send());
        account.grant(1);
        account.spend();
        assert_eq!((account.sent(), account.may_send()), (0, true));
        account.spend();
        assert_eq!((account.sent(), account.may_send()), (1, false));
    }
}
