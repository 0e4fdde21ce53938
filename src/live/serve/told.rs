//! What a label tells of its frame's times. A label's length stands in the frame's first packet, and some of its times come later: each
//! number has its columns, filled up with spaces, which JSON allows between a name and its number.

use super::picture::Picture;
use skyloop_protocols::{AttitudeSource, SyncState};
use skyloop_render::engine::Opening;
use std::time::{Duration, Instant};

/// What stands in place of a label's last brace: its times at a moment, on a link that has what it gets then on its way after a `backlog`, and the brace. Nothing
/// where there is nothing to tell of them.
pub(super) fn tail(picture: &Picture, now: Instant, backlog: Duration) -> String {
    match says_more(picture) {
        true => format!(",\"timing\":{}}}", timing(picture, now, backlog)),
        false => String::new(),
    }
}

/// Both parts of a label's text.
pub(super) fn text<'a>(opening: &'a Opening, tail: &'a str) -> [&'a str; 2] {
    match opening.json.strip_suffix('}') {
        Some(head) if !tail.is_empty() => [head, tail],
        _ => [&opening.json, ""],
    }
}

/// In step with attitudes in their order there is nothing to say: a frame is that of the attitude's own moment.
fn says_more(picture: &Picture) -> bool {
    let asked = &picture.asked;
    asked.is_timed || asked.due.trigger > 0 || asked.out_of_order
}

fn timing(picture: &Picture, now: Instant, backlog: Duration) -> String {
    let asked = &picture.asked;
    let mut text = format!(
        "{{\"attitude\":{:?},\"attitude_age_s\":{},\"trigger\":{}",
        source(asked.source),
        columns(asked.age_s),
        asked.due.trigger,
    );
    if asked.out_of_order {
        text += ",\"out_of_order\":true";
    }
    if asked.is_timed {
        let ms = |moment| columns(picture.since_trigger(moment).as_secs_f64() * 1e3);
        text += &format!(
            ",\"sync\":{:?},\"clock_offset_s\":{},\"first_pixel_ms\":{},\"last_pixel_ms\":{},\"first_octet_ms\":{},\"pixels_sent_ms\":{},\
             \"spare_ms\":{}",
            sync(asked.sync.state),
            columns(asked.sync.offset_s),
            ms(picture.first_pixel),
            ms(picture.last_pixel),
            ms(picture.first_octet),
            ms(Some(now)),
            columns(picture.spare_s(now + backlog) * 1e3),
        );
    }
    text + "}"
}

/// A number to the microsecond or millionth in 16 columns: up to 1e8, either way.
fn columns(number: f64) -> String {
    const MOST: f64 = 99_999_999.0;
    format!("{:>16.6}", number.clamp(-MOST, MOST) + 0.0)
}

/// How an attitude was got, as labels say it.
pub(super) fn source(source: AttitudeSource) -> &'static str {
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
