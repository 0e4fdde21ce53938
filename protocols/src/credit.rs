//! Flow control of frame packets: the client grants a total number, and the emulator never exceeds
//! it.
//!
//! The number is cumulative, so the next `Credit` packet makes up for a lost or repeated one.

use crate::packet::apid;

/// The APIDs of frame packets, which use credit.
pub const CREDITED_APIDS: [u16; 7] = [
    apid::FRAME_HEADER,
    apid::PIXEL_BLOCK,
    apid::LABELS,
    apid::WINDOWS,
    apid::OBJECTS,
    apid::COMPRESSED,
    apid::FRAME_END,
];

/// Credit for frame packets ([`CREDITED_APIDS`]) in one exchange.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CreditAccount {
    granted: Option<u32>,
    sent: u32,
}

impl CreditAccount {
    /// A new exchange: nothing sent, no limit.
    pub const fn new() -> Self {
        Self {
            granted: None,
            sent: 0,
        }
    }

    /// Applies the number of a `Credit` command. Ignores one behind an earlier grant (a late
    /// datagram).
    ///
    /// Returns false for any other number that is not 0 to 2^31 - 1 ahead of the packets sent. Such
    /// a number has no effect.
    pub fn grant(&mut self, packets: u32) -> bool {
        let mut earlier = self.granted.into_iter();
        let is_late = earlier.any(|granted| !is_ahead(packets, granted));
        let is_in_range = packets == self.sent || is_ahead(packets, self.sent);
        if is_in_range && !is_late {
            self.granted = Some(packets);
        }
        is_in_range || is_late
    }

    /// The last accepted grant, 0 before the first.
    pub fn granted(&self) -> u32 {
        self.granted.unwrap_or(0)
    }

    /// Whether one more frame packet may be sent. Always true before the first `Credit`.
    pub fn may_send(&self) -> bool {
        self.granted
            .is_none_or(|granted| is_ahead(granted, self.sent))
    }

    /// Counts one frame packet as sent.
    pub fn spend(&mut self) {
        self.sent = self.sent.wrapping_add(1);
    }

    /// Frame packets sent in this exchange, modulo 2^32.
    pub const fn sent(&self) -> u32 {
        self.sent
    }
}

/// Whether `a` is ahead of `b`, modulo 2^32.
const fn is_ahead(a: u32, b: u32) -> bool {
    a.wrapping_sub(b) as i32 > 0
}

#[cfg(test)]
mod tests {
    use super::CreditAccount;

    /// ICD, section 5.3: at most 2^31 - 1 ahead of the number sent, here 9.
    #[test]
    fn grants_out_of_range_have_no_effect() {
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
    fn credit_continues_over_the_wrap() {
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
