//! Frames that give way to newer ones. On a link of which no byte leaves the cause is not known at once: it is slow, or its client does not read.

use super::Server;
use super::channel::Channel;
use super::withheld::{CLIENT_GONE, name, standstill, unless_blocked};
use crate::stats::Pending;
use skyloop_protocols::Withheld;
use std::time::Duration;

/// A link of which no byte has left for so long is not read.
const UNREAD: Duration = Duration::from_millis(100);

/// For [`Channel::withhold`]: the cause is found later.
pub(super) const NOT_KNOWN: &str = "not known yet";

/// Frames of a link that gave way, and whose cause is not known yet.
#[derive(Debug, Default)]
pub(super) struct Passed {
    entries: Vec<Pending>,
    /// The last one, and the bytes that had left the link then.
    frame: u32,
    bytes: u32,
}

impl Channel {
    /// Counts a frame that is withheld, or leaves open why it has given way.
    pub fn withhold(&mut self, frame: u32, entry: Pending, cause: &'static str) {
        if cause != NOT_KNOWN {
            let cause = unless_blocked(self, cause);
            return self.frames.withhold(entry, cause);
        }
        if self.passed.entries.is_empty() {
            self.passed.bytes = self.wire.tally.bytes();
        }
        self.passed.frame = frame;
        self.passed.entries.push(entry);
    }

    /// Counts the frames whose cause was left open.
    pub fn count_open(&mut self, cause: &'static str) {
        for entry in std::mem::take(&mut self.passed.entries) {
            self.frames.withhold(entry, cause);
        }
    }

    /// Why a frame gives way on this link; none: that is not known yet.
    fn of_passed(&self) -> Option<(Withheld, String)> {
        let found = standstill(self, !self.exchange.credit.may_send());
        let is_open = found.0 == Withheld::NotRead
            && !self.wire.tally.is_held_back()
            && !self.stands_still(UNREAD);
        (!is_open).then_some(found)
    }
}

impl Server {
    /// Why a frame gives way to a newer one, which is reported where it is known.
    pub(super) fn report_passed(&mut self, at: usize, frame: u32) -> &'static str {
        match self.channels[at].of_passed() {
            Some((why, detail)) => {
                self.report(at, why, &gives_way(frame, &detail));
                name(why)
            }
            None => NOT_KNOWN,
        }
    }

    /// Counts and reports the frames whose cause was left open, once it is known.
    pub(super) fn count_passed(&mut self, at: usize) {
        let channel = &mut self.channels[at];
        if channel.passed.entries.is_empty() {
            return;
        }
        if channel.has_gone(channel.exchange.number) {
            channel.count_open(CLIENT_GONE);
            return;
        }
        // What is no longer in the queue has left it, or was given up there.
        let has_moved =
            channel.wire.tally.bytes() != channel.passed.bytes || !channel.carries_frames();
        let found = match has_moved {
            true => Some((
                Withheld::SlowLink,
                "the one before still leaves".to_string(),
            )),
            false => channel.of_passed(),
        };
        let Some((why, detail)) = found else { return };
        let frame = channel.passed.frame;
        channel.count_open(name(why));
        self.report(at, why, &gives_way(frame, &detail));
    }
}

fn gives_way(frame: u32, detail: &str) -> String {
    format!("frame {frame} gives way to a newer one: {detail}")
}
