//! A frame from the moment that it is asked for until all have it: what is there of it, and when what came.

use super::clock::{Due, Sync};
use super::shooter::Spare;
use super::told;
use crate::stats::Request;
use crate::timing::spare_s;
use crc32fast::Hasher;
use skyloop_protocols::{AttitudeSource, FrameEnd, Header, Overrun, Timing};
use skyloop_render::engine::{Opening, Shot};
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// Why and of what a frame is made.
pub(super) struct Asked {
    pub due: Due,
    /// Of the attitude's packet.
    pub header: Header,
    /// When that came.
    pub arrived: Instant,
    /// Its number.
    pub message: u64,
    pub source: AttitudeSource,
    pub age_s: f64,
    /// Whether its attitude came after one of a later time.
    pub out_of_order: bool,
    pub sync: Sync,
    /// By which level of tolerances, and what is said of it.
    pub level: usize,
    pub overrun: Option<&'static str>,
    /// Whether its times are told: not in step, where frames are the same every time.
    pub is_timed: bool,
    /// Before this moment the device gives nothing out.
    pub release: Instant,
}

/// A frame that is being made or sent.
pub(super) struct Picture {
    pub number: u32,
    pub asked: Asked,
    pub opening: Option<Opening>,
    pub shot: Option<Box<Shot>>,
    /// Digits from the first pixel on, while the shot is not there.
    digits: Vec<u16>,
    /// Digits that lie beyond them, by their first pixel.
    ahead: BTreeMap<usize, Vec<u16>>,
    pub first_pixel: Option<Instant>,
    pub last_pixel: Option<Instant>,
    pub first_octet: Option<Instant>,
    /// How the label ends that clients get.
    tail: OnceLock<String>,
    /// Of the pixels that are there.
    crc: Hasher,
    /// Links that it has not left yet.
    pub open: usize,
    /// The request for it, until it is put on its way or is known to fail.
    pub request: Option<Request>,
    /// Whether all who wanted it have all of it.
    pub whole: bool,
}

impl Picture {
    /// Frame `number` among those that are made or sent.
    pub fn of(pictures: &mut [Picture], number: u32) -> Option<&mut Picture> {
        pictures.iter_mut().find(|picture| picture.number == number)
    }

    /// A frame that is asked for; `digits` is memory for its pixels.
    pub fn new(request: Request, number: u32, asked: Asked, mut digits: Vec<u16>) -> Picture {
        digits.clear();
        Picture {
            number,
            asked,
            opening: None,
            shot: None,
            digits,
            ahead: BTreeMap::new(),
            first_pixel: None,
            last_pixel: None,
            first_octet: None,
            tail: OnceLock::new(),
            crc: Hasher::new(),
            open: 0,
            request: Some(request),
            whole: true,
        }
    }

    /// Takes rows that are done; their memory goes to `spare`.
    pub fn develop(&mut self, first: usize, digits: Vec<u16>, at: Instant, spare: &Spare) {
        self.first_pixel.get_or_insert(at);
        self.ahead.insert(first, digits);
        while let Some(next) = self.ahead.remove(&self.digits.len()) {
            self.digits.extend_from_slice(&next);
            sum_up(&mut self.crc, &next);
            spare.give(next);
        }
    }

    /// Takes all of it; gives the memory back that was for its pixels.
    pub fn complete(&mut self, shot: Box<Shot>, at: Instant) -> Vec<u16> {
        self.first_pixel.get_or_insert(at);
        self.last_pixel = Some(at);
        self.opening.get_or_insert_with(|| shot.opening());
        // What came before the rest has been summed up as it came.
        let rest = shot.frame.digits.get(self.digits.len()..);
        sum_up(&mut self.crc, rest.unwrap_or_default());
        self.shot = Some(shot);
        self.ahead.clear();
        std::mem::take(&mut self.digits)
    }

    /// The digits that are there, from the first pixel on.
    pub fn digits(&self) -> &[u16] {
        match &self.shot {
            Some(shot) => &shot.frame.digits,
            None => &self.digits,
        }
    }

    /// From the trigger, the exposure's end or the attitude's arrival if that is later, to a moment, s.
    pub fn since_trigger(&self, moment: Option<Instant>) -> Duration {
        let trigger = self.trigger();
        moment.map_or(Duration::ZERO, |moment| {
            moment.saturating_duration_since(trigger)
        })
    }

    /// When its latency begins.
    pub fn trigger(&self) -> Instant {
        self.asked.due.end.max(self.asked.arrived)
    }

    /// Time left at a moment, s; below 0: late by so much. 0 where there is no deadline.
    pub fn spare_s(&self, at: Instant) -> f64 {
        let deadline = self.asked.due.deadline;
        deadline.map_or(0.0, |deadline| spare_s(deadline, at))
    }

    /// Its times as the wire has them, at a moment; what is given to its link then has left after a `backlog`.
    pub fn timing(&self, now: Instant, backlog: Duration) -> Timing {
        let since = |moment| self.since_trigger(moment).as_secs_f32();
        let attitude_age_s = self.asked.age_s as f32;
        if !self.asked.is_timed {
            return Timing {
                attitude_age_s,
                ..Timing::default()
            };
        }
        Timing {
            attitude_age_s,
            first_pixel_s: since(self.first_pixel),
            last_pixel_s: since(self.last_pixel),
            first_octet_s: since(self.first_octet),
            last_octet_s: since(Some(now)),
            spare_s: self.spare_s(now + backlog) as f32,
        }
    }

    /// The packet that closes it, which leaves its link after a `backlog`.
    pub fn closing(&self, now: Instant, backlog: Duration) -> FrameEnd {
        let timing = self.timing(now, backlog);
        let in_time = !self.asked.is_timed || timing.spare_s >= 0.0;
        FrameEnd {
            frame: self.number,
            pixels_crc32: self.crc.clone().finalize(),
            trigger: self.asked.due.trigger,
            attitude_source: self.asked.source,
            overrun: match self.asked.overrun {
                Some("late") => Overrun::Late,
                Some("drop") => Overrun::Drop,
                Some("coarsen") => Overrun::Coarsen,
                _ if in_time => Overrun::None,
                _ => Overrun::Late,
            },
            sync: self.asked.sync.state,
            in_time,
            timing,
            clock_offset_s: self.asked.sync.offset_s,
        }
    }

    /// The label as clients get it, in two parts: settled when the first of them gets its first part.
    pub fn text(&self, now: Instant, backlog: Duration) -> Option<[&str; 2]> {
        let opening = self.opening.as_ref()?;
        let tail = self.tail.get_or_init(|| told::tail(self, now, backlog));
        Some(told::text(opening, tail))
    }

    /// Octets of that label, before it is settled.
    pub fn text_length(&self) -> Option<usize> {
        let tail = told::tail(self, Instant::now(), Duration::ZERO);
        let parts = told::text(self.opening.as_ref()?, &tail);
        Some(parts.iter().map(|part| part.len()).sum())
    }

    /// The shot, its label as clients have it.
    pub fn into_shot(self) -> Option<Box<Shot>> {
        let mut shot = self.shot?;
        let told_tail = self.tail.into_inner().unwrap_or_default();
        let Some(opening) = self.opening else {
            return Some(shot);
        };
        let [head, tail] = told::text(&opening, &told_tail).map(|part| part.len());
        if tail > 0 {
            // The shot's is the only one left: nothing is copied.
            drop(opening);
            let json = Arc::make_mut(&mut shot.json);
            json.truncate(head);
            json.push_str(&told_tail);
        }
        Some(shot)
    }
}

/// Carries the checksum of a frame's pixels on, each two octets as on the wire: by the processor's own instructions, where `protocols::crc` goes by tables.
fn sum_up(crc: &mut Hasher, pixels: &[u16]) {
    const PIECE: usize = 1024;
    let mut octets = [0; 2 * PIECE];
    for pixels in pixels.chunks(PIECE) {
        let octets = &mut octets[..2 * pixels.len()];
        for (two, pixel) in octets.as_chunks_mut().0.iter_mut().zip(pixels) {
            *two = pixel.to_be_bytes();
        }
        crc.update(octets);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::crc::Crc32;

    #[test]
    fn pixels_are_summed_up_as_the_other_end_does_it() {
        let pixels: Vec<u16> = (0..5000_u32).map(|i| (i * i * 31 + 7) as u16).collect();
        for (first, last) in [(0, 0), (0, 1), (3, 1027), (1, 5000)] {
            let mut crc = Hasher::new();
            let pixels = &pixels[first..last];
            let (some, others) = pixels.split_at(pixels.len() / 3);
            for part in [some, others] {
                sum_up(&mut crc, part);
            }
            let other = Crc32::new().update_pixels(pixels).finish();
            assert_eq!(crc.finalize(), other, "{first}..{last}");
        }
    }

    use hifitime::Epoch;
    use skyloop_protocols::WireTime;

    #[test]
    fn latency_counts_from_the_exposures_end_or_the_attitudes_arrival_if_that_is_later() {
        let (zero, ms) = (Instant::now(), Duration::from_millis);
        let picture = |end: Instant, arrived: Instant| {
            let asked = Asked {
                due: Due {
                    mid: Epoch::from_gregorian_utc_hms(2026, 6, 1, 0, 0, 0),
                    end,
                    deadline: Some(end + ms(30)),
                    trigger: 0,
                    latched: None,
                    camera: None,
                },
                header: Header {
                    apid: 0x101,
                    sequence_count: 0,
                    time: WireTime(0),
                },
                arrived,
                message: 1,
                source: AttitudeSource::Exact,
                age_s: 0.0,
                out_of_order: false,
                sync: Sync::default(),
                level: 0,
                overrun: None,
                is_timed: true,
                release: end,
            };
            Picture::new(Request::default(), 7, asked, Vec::new())
        };
        let (early, late) = (zero, zero + ms(5));
        for (end, arrived) in [(early, late), (late, early)] {
            let picture = picture(end, arrived);
            assert_eq!(picture.since_trigger(Some(late + ms(10))), ms(10));
            assert_eq!(picture.since_trigger(Some(early)), Duration::ZERO);
            // The deadline counts from the exposure's end, whatever comes late; and what waits on the line counts.
            let spare_s = (end + ms(30) - (late + ms(10))).as_secs_f32();
            let told = |backlog| picture.closing(late + ms(10), backlog);
            assert!((told(Duration::ZERO).timing.spare_s - spare_s).abs() < 1e-6);
            assert!(told(Duration::ZERO).in_time && !told(ms(21)).in_time);
            assert_eq!(told(ms(21)).overrun, Overrun::Late);
            assert_eq!(told(Duration::ZERO).overrun, Overrun::None);
        }
    }
}
