//! Timing in the label of a frame. The length of a label is in the first packet of its frame, and
//! some times follow later. So each number has a fixed width, padded with spaces, which JSON
//! allows.

use super::clock::due::Sync;
use skyloop_protocols::{AttitudeSource, SyncState};
use skyloop_render::engine::FrameInfo;

/// Timing of a frame as its label states it.
pub(super) struct LabelTiming {
    pub attitude: AttitudeSource,
    pub attitude_age_s: f64,
    pub trigger: u32,
    pub out_of_order: bool,
    /// None for the stepped clock, whose labels do not depend on real time.
    pub live: Option<LiveTiming>,
}

/// Times that depend on the clock, s.
pub(super) struct LiveTiming {
    pub sync: Sync,
    pub first_pixel_s: f64,
    pub last_pixel_s: f64,
    pub first_byte_s: f64,
    pub pixels_sent_s: f64,
    pub spare_s: f64,
}

impl LabelTiming {
    /// The end of the label, which replaces its last brace. Empty if a stepped frame shows an
    /// attitude in order at its own time.
    pub fn tail(&self) -> String {
        if self.live.is_none() && self.trigger == 0 && !self.out_of_order {
            return String::new();
        }
        let mut text = format!(
            ",\"timing\":{{\"attitude\":{:?},\"attitude_age_s\":{},\"trigger\":{}",
            source(self.attitude),
            padded(self.attitude_age_s),
            self.trigger,
        );
        if self.out_of_order {
            text += ",\"out_of_order\":true";
        }
        if let Some(live) = &self.live {
            let ms = |s: f64| padded(s * 1e3);
            text += &format!(
                ",\"sync\":{:?},\"clock_offset_s\":{},\"first_pixel_ms\":{},\"last_pixel_ms\":{},\"first_octet_ms\":{},\"pixels_sent_ms\":{},\
                 \"spare_ms\":{}",
                sync(live.sync.state),
                padded(live.sync.offset_s),
                ms(live.first_pixel_s),
                ms(live.last_pixel_s),
                ms(live.first_byte_s),
                ms(live.pixels_sent_s),
                ms(live.spare_s),
            );
        }
        text + "}}"
    }
}

/// Both parts of a label's text.
pub(super) fn parts<'a>(opening: &'a FrameInfo, tail: &'a str) -> [&'a str; 2] {
    match opening.json.strip_suffix('}') {
        Some(head) if !tail.is_empty() => [head, tail],
        _ => [&opening.json, ""],
    }
}

/// A number with 6 decimals in 16 columns, clamped to 1e8.
fn padded(number: f64) -> String {
    const MAX: f64 = 99_999_999.0;
    format!("{:>16.6}", number.clamp(-MAX, MAX) + 0.0)
}

/// How an attitude was derived, in labels.
fn source(source: AttitudeSource) -> &'static str {
    match source {
        AttitudeSource::Exact => "exact",
        AttitudeSource::Interpolated => "interpolated",
        AttitudeSource::Extrapolated => "extrapolated",
        AttitudeSource::Held => "held",
        AttitudeSource::Stale => "stale",
        AttitudeSource::Invalid => "invalid",
        AttitudeSource::Future => "future",
    }
}

fn sync(state: SyncState) -> &'static str {
    match state {
        SyncState::Free => "free",
        SyncState::Waiting => "waiting",
        SyncState::Locked => "locked",
        SyncState::Holdover => "holdover",
        SyncState::Paused => "paused",
    }
}
