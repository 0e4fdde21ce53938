//! The first frame of a run that exceeded a limit, and by how much.

use serde::{Serialize, Serializer};
use std::time::Duration;

/// The first frame of a run that missed its deadline.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Miss {
    /// The frame's number.
    pub frame: u32,
    /// By how much, s; `None` if the frame was incomplete.
    pub late_s: Option<f64>,
    /// `before it` or `after it` if an exposure without a frame missed its deadline.
    pub unexposed: Option<&'static str>,
}

/// The first frame of a run above the watched time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Slow {
    /// The frame's number.
    pub frame: u32,
    /// From the trigger to its last byte, s; `None` if the frame was incomplete.
    #[serde(rename = "last_octet_s", serialize_with = "maybe_seconds")]
    pub last_byte: Option<Duration>,
    /// See [`Miss`].
    pub unexposed: Option<&'static str>,
}

impl Miss {
    /// `late by 4.20 ms`, `incomplete`, or `an exposure before it has no frame`.
    #[must_use]
    pub(crate) fn describe(&self) -> String {
        let late = self.late_s.map(|s| format!("late by {:.2} ms", s * 1e3));
        time_text(late, self.unexposed)
    }
}

impl Slow {
    /// `14.2 ms`, else as [`Miss::describe`].
    #[must_use]
    pub(crate) fn describe(&self) -> String {
        let took = |time: Duration| format!("{:.1} ms", time.as_secs_f64() * 1e3);
        time_text(self.last_byte.map(took), self.unexposed)
    }
}

fn time_text(time: Option<String>, unexposed: Option<&str>) -> String {
    let none = unexposed.map(|side| format!("an exposure {side} has no frame"));
    none.or(time).unwrap_or_else(|| "incomplete".to_string())
}

/// A time in s, or null.
pub(super) fn maybe_seconds<S: Serializer>(
    time: &Option<Duration>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    time.map(|time| time.as_secs_f64()).serialize(serializer)
}
