//! Frame counters of one link: requests, and how each of them ended.
//!
//! After a run, requested = delivered + withheld on each link. The types enforce it: only a
//! [`Request`] opens an entry, and its [`Pending`] can be neither copied nor used twice.

use std::collections::BTreeMap;

/// A request for a frame: an Attitude, a Trigger, or an exposure of the cadence. Each link opens an
/// entry for it when deliveries begin or the frame fails.
#[derive(Debug, Default)]
#[must_use = "each link opens an entry for a request"]
pub(crate) struct Request(());

/// An open entry.
#[derive(Debug)]
#[must_use = "an entry ends as delivered or as withheld"]
pub(crate) struct Pending(());

/// The frames of one link.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct FrameCounters {
    /// All requests so far.
    pub requested: usize,
    /// Frames whose last packet has left the link, even if it was lost later.
    pub delivered: usize,
    /// Frames that were not sent completely, by cause.
    pub withheld: BTreeMap<&'static str, usize>,
}

impl FrameCounters {
    /// Opens the entry of this link for a request.
    pub(crate) fn open(&mut self, _: &Request) -> Pending {
        self.requested += 1;
        Pending(())
    }

    /// Ends an entry: the frame's last packet has left the link.
    pub(crate) fn deliver(&mut self, Pending(()): Pending) {
        self.delivered += 1;
    }

    /// Ends an entry: the frame was not sent completely.
    pub(crate) fn withhold(&mut self, Pending(()): Pending, cause: &'static str) {
        *self.withheld.entry(cause).or_default() += 1;
    }

    /// Adds requests without a frame that were counted elsewhere.
    #[must_use]
    pub(crate) fn with(mut self, withheld: usize, cause: &'static str) -> FrameCounters {
        if withheld > 0 {
            self.requested += withheld;
            *self.withheld.entry(cause).or_default() += withheld;
        }
        self
    }
}
