//! Statistics of a run: percentiles of times, counts, and the table at the end.

mod frames;

use crate::timing::Latencies;
pub use crate::timing::{row, text as times};
pub use frames::FrameCounters;
pub(crate) use frames::{Pending, Request};
use skyloop_firmware_sim::times::Times;
use skyloop_render::effect::counted;
use skyloop_render::engine::ExposedFrame;
use std::collections::BTreeMap;

/// Statistics of a run.
#[derive(Debug, Clone, Default)]
pub struct RunStats {
    /// Number of frames.
    pub frames: u32,
    /// From the vehicle's state to pixels and label.
    pub render: Times,
    /// The first link that carries frames.
    pub link: String,
    /// Latencies of that link, from each frame's trigger to its last packet.
    pub latencies: Latencies,
    /// The same of the other links that carry frames.
    pub further: Vec<(String, Latencies)>,
    /// Number of objects in orbit.
    pub objects: usize,
    /// Stars labelled. This and the following are sums over the frames.
    pub stars: usize,
    /// Stars visible.
    pub stars_visible: usize,
    /// RSOs labelled.
    pub rsos: usize,
    /// RSOs visible.
    pub rsos_visible: usize,
    /// Objects in the field that labels omit, by reason.
    pub unseen: BTreeMap<&'static str, usize>,
    /// Frame counters of the links that carry frames, by address.
    pub frame_counters: Vec<(String, FrameCounters)>,
    /// Frames in which one light source saturates every pixel.
    pub flooded: u32,
    /// Objects without a state at some frame.
    pub without_state: usize,
    /// Frames rendered more coarsely to meet their deadlines.
    pub coarsened: u32,
    /// Exposures that were dropped because their frames would have been late.
    pub dropped: u32,
}

impl RunStats {
    /// Adds one frame.
    pub fn add(&mut self, exposed: &ExposedFrame) {
        self.frames += 1;
        self.render.add(exposed.render_time);
        self.flooded += u32::from(exposed.label.flooded_by.is_some());
        self.without_state += exposed.unknown.notices.len();
        self.objects = exposed.population;
        for (why, count) in &exposed.label.unseen_counts {
            *self.unseen.entry(why).or_default() += count;
        }
        for object in &exposed.label.objects {
            let (labelled, visible) = match object.kind {
                "star" => (&mut self.stars, &mut self.stars_visible),
                "rso" => (&mut self.rsos, &mut self.rsos_visible),
                _ => continue,
            };
            *labelled += 1;
            *visible += usize::from(object.visible);
        }
    }

    /// The common first rows of a run's table.
    pub fn rows(&self) -> Vec<(String, String)> {
        let labelled = |all, visible| format!("{all} ({visible} visible)");
        let mut rows = vec![
            row("frames", self.frames.to_string()),
            row(
                "render time p50 / p99 / max",
                times(&self.render, &[0.5, 0.99, 1.0]),
            ),
            row("stars labelled", labelled(self.stars, self.stars_visible)),
            row("RSOs labelled", labelled(self.rsos, self.rsos_visible)),
        ];
        if self.objects > 0 {
            rows.insert(2, row("objects", self.objects.to_string()));
            rows.push(row("RSOs unseen", by_reason(&self.unseen)));
        }
        rows.extend(self.withheld_rows());
        if self.flooded > 0 {
            rows.push(row("frames full of light", self.flooded.to_string()));
        }
        for (name, count) in [
            ("frames late", self.late()),
            ("frames coarsened", self.coarsened),
            ("exposures dropped", self.dropped),
        ] {
            if count > 0 {
                rows.push(row(name, count.to_string()));
            }
        }
        if self.without_state > 0 {
            let count = self.without_state.to_string();
            rows.push(row("objects without a state", count));
        }
        rows
    }

    /// Rows of withheld frames, by link if there are several.
    pub fn withheld_rows(&self) -> Vec<(String, String)> {
        let links = self.frame_counters.iter();
        let some = links.filter(|(_, account)| !account.withheld.is_empty());
        let rows = some.map(|(link, account)| {
            let (requested, delivered) = (account.requested, account.delivered);
            let mut text = by_reason(&account.withheld);
            text += &format!("; {requested} requested, {delivered} delivered");
            if self.frame_counters.len() > 1 {
                text += &format!(", over {link}");
            }
            row("frames withheld", text)
        });
        rows.collect()
    }

    /// Frames that were late or incomplete, over all links.
    fn late(&self) -> u32 {
        let further = self.further.iter().map(|(_, latencies)| latencies.missed);
        further.fold(self.latencies.missed, u64::saturating_add) as u32
    }

    /// Rows of latencies, by link if there are several.
    pub fn latency_rows(&self, deadlines: bool) -> Vec<(String, String)> {
        let of = |latencies: &Latencies| {
            if deadlines {
                latencies.rows()
            } else {
                latencies.stage_rows()
            }
        };
        let mut rows = of(&self.latencies);
        if !self.further.is_empty() {
            rows.insert(0, row("over", self.link.clone()));
        }
        for (link, latencies) in &self.further {
            rows.push(row("over", link.clone()));
            rows.extend(of(latencies));
        }
        rows
    }
}

/// A sum with its reasons: `5 (3 behind the Earth, 2 too faint)`.
fn by_reason(counts: &BTreeMap<&'static str, usize>) -> String {
    let all: usize = counts.values().sum();
    let reasons = counts.iter().map(|(why, count)| format!("{count} {why}"));
    match all {
        0 => "0".to_string(),
        _ => format!("{all} ({})", reasons.collect::<Vec<_>>().join(", ")),
    }
}

/// Objects without a state, and conditions that are logged once: old elements, objects near the
/// observer, too many particles, light that saturates the frame.
#[derive(Debug, Clone, Default)]
pub struct Absent {
    /// Number of objects without a state, summed over the frames.
    pub count: u32,
    named: usize,
    crowded: bool,
    flooded: bool,
    near: bool,
}

impl Absent {
    /// Maximum number of objects named in the log.
    const NAMED: usize = 5;
    /// Distance (km) within which element sets cannot distinguish a docked vehicle from a
    /// neighbour.
    const NEAR_KM: f64 = 10.0;

    /// Counts the objects of a frame without a state, and logs each condition once.
    pub fn report(&mut self, exposed: &ExposedFrame) {
        if let Some(more) = exposed.label.particles_left_out.filter(|_| !self.crowded) {
            self.crowded = true;
            tracing::warn!(
                "frame {}: {more:.0} more particles than can be drawn would cross the detector in an exposure; labels report \
                 it (particles_left_out): shorten timing.exposure_s or radiation.readout_s",
                exposed.number
            );
        }
        if let Some(light) = exposed.label.flooded_by.filter(|_| !self.flooded) {
            self.flooded = true;
            tracing::warn!(
                "frame {}: {light} fills every pixel, nothing else is visible; labels report it (flooded_by): turn away, shorten \
                 timing.exposure_s, or give the camera a better baffle (optics.stray)",
                exposed.number
            );
        }
        if let Some(ages) = &exposed.old {
            tracing::warn!("frame {}: {ages}", exposed.number);
        }
        if let Some(near) = near_observer(exposed).filter(|_| !self.near) {
            self.near = true;
            tracing::warn!("frame {}: {near}", exposed.number);
        }
        self.count = self.count.wrapping_add(exposed.unknown.count as u32);
        let mut more = 0;
        for error in &exposed.unknown.notices {
            self.named += 1;
            if self.named <= Self::NAMED {
                tracing::warn!("frame {}: not rendered: {error}", exposed.number);
            } else {
                tracing::info!("frame {}: not rendered: {error}", exposed.number);
                more += 1;
            }
        }
        if more > 0 {
            tracing::warn!(
                "frame {}: {} more without a state, not rendered; -v names them",
                exposed.number,
                counted(more, "object")
            );
        }
    }
}

/// Objects in the field that may be docked to the observer.
fn near_observer(exposed: &ExposedFrame) -> Option<String> {
    let near = exposed.label.objects.iter().filter_map(|object| {
        let range_km = object.rso.as_ref()?.range_km;
        let name = object.names.first().unwrap_or(&object.id);
        (range_km < Absent::NEAR_KM).then(|| format!("{name} at {range_km:.3} km"))
    });
    let near: Vec<String> = near.collect();
    let some = near.get(..Absent::NAMED).unwrap_or(&near).join(", ");
    let more = if near.len() > Absent::NAMED {
        ", ..."
    } else {
        ""
    };
    (!near.is_empty()).then(|| {
        format!(
            "{} in the field within {} km of the observer ({some}{more}): a vehicle docked to the observer fills the field with light: \
             remove it from the files of objects",
            counted(near.len(), "object"),
            Absent::NEAR_KM
        )
    })
}

/// Rows as text, with aligned values.
pub fn table(rows: &[(String, String)]) -> String {
    let width = rows
        .iter()
        .map(|(name, _)| name.chars().count())
        .max()
        .unwrap_or(0);
    rows.iter()
        .map(|(name, value)| format!("  {name:width$}  {value}\n"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_objects_and_withheld_frames_appear_if_there_are_any() {
        let names = |stats: &RunStats| -> Vec<String> {
            stats.rows().into_iter().map(|(name, _)| name).collect()
        };
        let mut stats = RunStats::default();
        assert!(
            !names(&stats)
                .iter()
                .any(|name| name == "objects" || name == "RSOs unseen")
        );
        stats.objects = 9;
        assert_eq!(stats.rows()[2], row("objects", "9".to_string()));
        assert_eq!(
            stats.rows().pop(),
            Some(row("RSOs unseen", "0".to_string()))
        );
        stats.unseen = [("too faint", 2), ("behind the Earth", 3)].into();
        let text = "5 (3 behind the Earth, 2 too faint)".to_string();
        assert_eq!(stats.rows().pop(), Some(row("RSOs unseen", text)));
        let account = |delivered, withheld: &[_]| FrameCounters {
            requested: 9,
            delivered,
            withheld: withheld.iter().copied().collect(),
        };
        let one = account(7, &[("no credit", 2)]);
        stats.frame_counters = vec![("a".to_string(), one)];
        let text = "2 (2 no credit); 9 requested, 7 delivered".to_string();
        assert_eq!(
            stats.rows().pop(),
            Some(row("frames withheld", text.clone()))
        );
        let others = [account(9, &[]), account(0, &[("refused", 9)])];
        let others = ["b", "c"].map(str::to_string).into_iter().zip(others);
        stats.frame_counters.extend(others);
        let rows = stats.rows();
        let rows = rows.iter().rev().take(2).rev().map(|(_, value)| &value[..]);
        assert_eq!(
            rows.collect::<Vec<_>>(),
            [
                &format!("{text}, over a"),
                "9 (9 refused); 9 requested, 0 delivered, over c"
            ]
        );
    }
}
