//! Why a valid packet is refused.

use skyloop_protocols::Reason;

/// Reason code and detail of a `Nack`.
#[derive(Debug)]
pub(super) struct Refusal {
    pub reason: Reason,
    pub detail: String,
}

impl Refusal {
    fn new(reason: Reason, detail: impl Into<String>) -> Refusal {
        Refusal {
            reason,
            detail: detail.into(),
        }
    }

    /// A value is out of range.
    pub fn value(detail: impl Into<String>) -> Refusal {
        Refusal::new(Reason::ValueOutOfRange, detail)
    }

    /// The command is possible, but not now.
    pub fn busy(detail: impl Into<String>) -> Refusal {
        Refusal::new(Reason::Busy, detail)
    }

    /// The command has no meaning on this link or with this clock.
    pub fn not_supported(detail: impl Into<String>) -> Refusal {
        Refusal::new(Reason::NotSupported, detail)
    }
}
