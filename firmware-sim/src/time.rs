//! Converts between wire time (CUC seconds since 1958-01-01 TAI) and `Epoch`.

use hifitime::{Duration, Epoch};
use skyloop_protocols::time::{TAI_1900_TO_1958_S, WireTime};

/// From hifitime's reference (1900-01-01 TAI) to the wire's (1958-01-01 TAI), ns.
const CCSDS_EPOCH_NS: i128 = TAI_1900_TO_1958_S as i128 * 1_000_000_000;

/// Wire time of an epoch; `None` outside 1958 to 2094, the range of four bytes of seconds.
#[must_use]
pub fn to_wire(epoch: Epoch) -> Option<WireTime> {
    let since_1958 = epoch.to_tai_duration().total_nanoseconds() - CCSDS_EPOCH_NS;
    WireTime::from_tai_nanoseconds(u64::try_from(since_1958).ok()?)
}

/// Epoch of a wire time, to the nanosecond.
#[must_use]
pub fn to_epoch(time: WireTime) -> Epoch {
    let since_1900 = i128::from(time.tai_nanoseconds()) + CCSDS_EPOCH_NS;
    Epoch::from_tai_duration(Duration::from_total_nanoseconds(since_1900))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn utc_text_survives_the_wire_to_the_nanosecond() {
        for text in [
            "2019-06-15T23:35:50.000000001 UTC",
            "1999-12-31T23:59:59.999999999 UTC",
            "2090-01-01T00:00:00.123456789 UTC",
        ] {
            let epoch: Epoch = text.parse().unwrap();
            assert_eq!(to_epoch(to_wire(epoch).unwrap()), epoch, "{text}");
        }
    }

    #[test]
    fn the_wire_counts_from_1958() {
        // X-Val: 1970-01-01 TAI is 4,383 days after 1958-01-01 (modified Julian days 40587 and
        // 36204).
        let epoch = Epoch::from_gregorian_tai_at_midnight(1970, 1, 1);
        assert_eq!(
            to_wire(epoch).unwrap().tai_nanoseconds(),
            4_383 * 86_400 * 1_000_000_000
        );
        assert!(to_wire(Epoch::from_gregorian_tai_at_midnight(1957, 12, 31)).is_none());
        assert!(to_wire(Epoch::from_gregorian_tai_at_midnight(2095, 1, 1)).is_none());
    }
}
