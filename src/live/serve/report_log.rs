//! Log messages about one link, limited in rate.

use super::reasons::remedy;
use skyloop_link::{FaultEffect, LogRateLimit};
use skyloop_protocols::Withheld;
use std::collections::BTreeMap;
use std::time::Instant;

/// Messages of one link, and the conditions that are reported once.
#[derive(Debug, Default)]
pub(super) struct ReportLog {
    limits: BTreeMap<u8, LogRateLimit>,
    /// Since when attitudes come without a required Trigger, and whether that is logged.
    pub untriggered: Option<(Instant, bool)>,
    /// Packets granted and sent, since when they are unchanged, and whether that is reported.
    pub silent: Option<([u32; 2], Instant, bool)>,
}

impl ReportLog {
    /// Whether this reason was logged.
    pub fn has(&self, why: Withheld) -> bool {
        self.limits.contains_key(&why.code())
    }

    /// Logs a message with the remedy, unless the same reason was logged shortly before.
    pub fn log(
        &mut self,
        address: &str,
        why: Withheld,
        message: &str,
        effects: [Option<FaultEffect>; 2],
    ) {
        let limit = self.limits.entry(why.code()).or_default();
        let Some(times) = limit.count(Instant::now()) else {
            return;
        };
        let before = if times == 1 {
            String::new()
        } else {
            format!(" ({times} times since the last message)")
        };
        let remedy = remedy(why, address, effects);
        tracing::warn!("{address}: {message}; {remedy}{before}");
    }
}
