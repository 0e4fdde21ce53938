//! A frame from its request until all clients have it.

use super::clock::due::{Due, Sync};
use super::history::Pointing;
use super::label_timing::{LabelTiming, LiveTiming, parts};
use super::render_thread::RowBuffers;
use crate::stats::Request;
use crate::timing::spare_s;
use crc32fast::Hasher;
use skyloop_protocols::{FrameEnd, Overrun, Timing};
use skyloop_render::engine::{ExposedFrame, FrameInfo};
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Origin of a frame.
pub(super) struct FrameSource {
    pub due: Due,
    pub pointing: Pointing,
    pub sync: Sync,
    /// Level of tolerances, and lateness in its label.
    pub level: usize,
    pub overrun: Option<&'static str>,
    /// Whether its times are reported. Not with the stepped clock, whose runs are reproducible.
    pub is_timed: bool,
    /// The device sends nothing before this instant.
    pub release: Instant,
}

/// A frame that is rendered or sent.
pub(super) struct FrameJob {
    pub number: u32,
    pub source: FrameSource,
    pub opening: Option<FrameInfo>,
    pub exposed: Option<Box<ExposedFrame>>,
    /// Pixel values from the first pixel on, until the frame is complete.
    dn: Vec<u16>,
    /// Rows that were rendered before the rows above them, by their first pixel.
    ahead: BTreeMap<usize, Vec<u16>>,
    pub first_pixel: Option<Instant>,
    pub last_pixel: Option<Instant>,
    pub first_byte: Option<Instant>,
    /// End of the label as sent.
    tail: OnceLock<String>,
    /// Checksum of the present pixels.
    crc: Hasher,
    /// Number of links that still send it.
    pub open: usize,
    /// The request, until deliveries begin or the frame fails.
    pub request: Option<Request>,
    /// Whether all clients that requested it have all of it.
    pub whole: bool,
}

impl FrameJob {
    /// A new frame; `dn` is memory for its pixels.
    pub fn new(request: Request, number: u32, source: FrameSource, mut dn: Vec<u16>) -> FrameJob {
        dn.clear();
        FrameJob {
            number,
            source,
            opening: None,
            exposed: None,
            dn,
            ahead: BTreeMap::new(),
            first_pixel: None,
            last_pixel: None,
            first_byte: None,
            tail: OnceLock::new(),
            crc: Hasher::new(),
            open: 0,
            request: Some(request),
            whole: true,
        }
    }

    /// Adds rendered rows; their memory goes to `buffers`.
    pub fn add_rows(&mut self, first: usize, dn: Vec<u16>, at: Instant, buffers: &RowBuffers) {
        self.first_pixel.get_or_insert(at);
        self.ahead.insert(first, dn);
        while let Some(next) = self.ahead.remove(&self.dn.len()) {
            self.dn.extend_from_slice(&next);
            update_crc(&mut self.crc, &next);
            buffers.put(next);
        }
    }

    /// Adds the complete frame; returns the memory of its rows.
    pub fn complete(&mut self, exposed: Box<ExposedFrame>, at: Instant) -> Vec<u16> {
        self.first_pixel.get_or_insert(at);
        self.last_pixel = Some(at);
        self.opening.get_or_insert_with(|| exposed.opening());
        // The checksum already covers the rows that came before.
        let rest = exposed.frame.dn.get(self.dn.len()..);
        update_crc(&mut self.crc, rest.unwrap_or_default());
        self.exposed = Some(exposed);
        self.ahead.clear();
        std::mem::take(&mut self.dn)
    }

    /// The present pixel values, from the first pixel on.
    pub fn dn(&self) -> &[u16] {
        match &self.exposed {
            Some(exposed) => &exposed.frame.dn,
            None => &self.dn,
        }
    }

    /// Whether its deliveries have ended.
    pub fn is_done(&self) -> bool {
        self.request.is_none() && self.open == 0 && self.exposed.is_some()
    }

    /// Time from the trigger to an instant; 0 if there is none.
    pub fn since_trigger(&self, instant: Option<Instant>) -> Duration {
        let trigger = self.trigger();
        instant.map_or(Duration::ZERO, |at| at.saturating_duration_since(trigger))
    }

    /// Start of its latency: the end of the exposure, or the arrival of the attitude if that is
    /// later.
    pub fn trigger(&self) -> Instant {
        self.source
            .due
            .end
            .max(self.source.pointing.message.arrived)
    }

    /// Time to the deadline at an instant, s; below 0: late. 0 without a deadline.
    fn spare_s(&self, at: Instant) -> f64 {
        let deadline = self.source.due.deadline;
        deadline.map_or(0.0, |deadline| spare_s(deadline, at))
    }

    /// Its times for the wire. A packet queued `now` leaves after a `backlog`.
    fn timing(&self, now: Instant, backlog: Duration) -> Timing {
        let since = |instant| self.since_trigger(instant).as_secs_f32();
        let attitude_age_s = self.source.pointing.age_s as f32;
        if !self.source.is_timed {
            return Timing {
                attitude_age_s,
                ..Timing::default()
            };
        }
        Timing {
            attitude_age_s,
            first_pixel_s: since(self.first_pixel),
            last_pixel_s: since(self.last_pixel),
            first_octet_s: since(self.first_byte),
            last_octet_s: since(Some(now)),
            spare_s: self.spare_s(now + backlog) as f32,
        }
    }

    /// Its last packet, which leaves after a `backlog`.
    pub fn closing(&self, now: Instant, backlog: Duration) -> FrameEnd {
        let timing = self.timing(now, backlog);
        let in_time = !self.source.is_timed || timing.spare_s >= 0.0;
        FrameEnd {
            frame: self.number,
            pixels_crc32: self.crc.clone().finalize(),
            trigger: self.source.due.trigger,
            attitude_source: self.source.pointing.source,
            overrun: match self.source.overrun {
                Some("late") => Overrun::Late,
                Some("drop") => Overrun::Drop,
                Some("coarsen") => Overrun::Coarsen,
                _ if in_time => Overrun::None,
                _ => Overrun::Late,
            },
            sync: self.source.sync.state,
            in_time,
            timing,
            clock_offset_s: self.source.sync.offset_s,
        }
    }

    /// The end of the label. A packet queued `now` leaves after a `backlog`.
    fn label_tail(&self, now: Instant, backlog: Duration) -> String {
        let source = &self.source;
        let since = |instant| self.since_trigger(instant).as_secs_f64();
        let live = source.is_timed.then(|| LiveTiming {
            sync: source.sync,
            first_pixel_s: since(self.first_pixel),
            last_pixel_s: since(self.last_pixel),
            first_byte_s: since(self.first_byte),
            pixels_sent_s: since(Some(now)),
            spare_s: self.spare_s(now + backlog),
        });
        let timing = LabelTiming {
            attitude: source.pointing.source,
            attitude_age_s: source.pointing.age_s,
            trigger: source.due.trigger,
            out_of_order: source.pointing.message.out_of_order,
            live,
        };
        timing.tail()
    }

    /// The label as sent, in two parts. The first call fixes its times.
    pub fn text(&self, now: Instant, backlog: Duration) -> Option<[&str; 2]> {
        let opening = self.opening.as_ref()?;
        let tail = self.tail.get_or_init(|| self.label_tail(now, backlog));
        Some(parts(opening, tail))
    }

    /// Length of that label in bytes, before its times are fixed.
    pub fn text_length(&self) -> Option<usize> {
        let tail = self.label_tail(Instant::now(), Duration::ZERO);
        let parts = parts(self.opening.as_ref()?, &tail);
        Some(parts.iter().map(|part| part.len()).sum())
    }

    /// The exposed frame, with the label as sent.
    pub fn into_exposed(self) -> Option<Box<ExposedFrame>> {
        let mut exposed = self.exposed?;
        let Some(opening) = self.opening else {
            return Some(exposed);
        };
        let sent_tail = self.tail.into_inner().unwrap_or_default();
        let [head, tail] = parts(&opening, &sent_tail).map(|part| part.len());
        if tail > 0 {
            // Drops the other reference, so that the text is not copied.
            drop(opening);
            let json = Arc::make_mut(&mut exposed.json);
            json.truncate(head);
            json.push_str(&sent_tail);
        }
        Some(exposed)
    }
}

/// Updates the checksum with pixels as two bytes each, by the processor's CRC instructions;
/// `protocols::crc` uses tables.
fn update_crc(crc: &mut Hasher, pixels: &[u16]) {
    const CHUNK: usize = 1024;
    let mut bytes = [0; 2 * CHUNK];
    for pixels in pixels.chunks(CHUNK) {
        let bytes = &mut bytes[..2 * pixels.len()];
        for (two, pixel) in bytes.as_chunks_mut().0.iter_mut().zip(pixels) {
            *two = pixel.to_be_bytes();
        }
        crc.update(bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::crc::Crc32;

    #[test]
    fn checksum_equals_that_of_the_client() {
        let pixels: Vec<u16> = (0..5000_u32).map(|i| (i * i * 31 + 7) as u16).collect();
        for (first, last) in [(0, 0), (0, 1), (3, 1027), (1, 5000)] {
            let mut crc = Hasher::new();
            let pixels = &pixels[first..last];
            let (some, others) = pixels.split_at(pixels.len() / 3);
            for part in [some, others] {
                update_crc(&mut crc, part);
            }
            let other = Crc32::new().update_pixels(pixels).finish();
            assert_eq!(crc.finalize(), other, "{first}..{last}");
        }
    }

    use crate::serve::history::Latched;
    use hifitime::Epoch;
    use skyloop_protocols::{Header, WireTime};
    use skyloop_render::attitude::VehicleState;

    #[test]
    fn latency_starts_at_the_exposures_end_or_a_later_attitude() {
        let (zero, ms) = (Instant::now(), Duration::from_millis);
        let epoch = Epoch::from_gregorian_utc_hms(2026, 6, 1, 0, 0, 0);
        let job = |end: Instant, arrived: Instant| {
            let source = FrameSource {
                due: Due {
                    mid: epoch,
                    end,
                    deadline: Some(end + ms(30)),
                    trigger: 0,
                    latched: None,
                    camera: None,
                },
                pointing: Pointing::exact(&Latched {
                    vehicle: VehicleState::new(0, epoch, [0.0, 0.0, 0.0, 1.0], [0.0; 3], None)
                        .unwrap(),
                    header: Header {
                        apid: 0x101,
                        sequence_count: 0,
                        time: WireTime(0),
                    },
                    arrived,
                    number: 1,
                    out_of_order: false,
                }),
                sync: Sync::default(),
                level: 0,
                overrun: None,
                is_timed: true,
                release: end,
            };
            FrameJob::new(Request::default(), 7, source, Vec::new())
        };
        let (early, late) = (zero, zero + ms(5));
        for (end, arrived) in [(early, late), (late, early)] {
            let job = job(end, arrived);
            assert_eq!(job.since_trigger(Some(late + ms(10))), ms(10));
            assert_eq!(job.since_trigger(Some(early)), Duration::ZERO);
            // The deadline counts from the exposure's end in any case. The time of data still on
            // the line counts as well.
            let spare_s = (end + ms(30) - (late + ms(10))).as_secs_f32();
            let closing = |backlog| job.closing(late + ms(10), backlog);
            assert!((closing(Duration::ZERO).timing.spare_s - spare_s).abs() < 1e-6);
            assert!(closing(Duration::ZERO).in_time && !closing(ms(21)).in_time);
            assert_eq!(closing(ms(21)).overrun, Overrun::Late);
            assert_eq!(closing(Duration::ZERO).overrun, Overrun::None);
        }
    }
}
