//! Which frame was the first to break a limit of a run, and by how much.

use serde::{Serialize, Serializer};
use std::time::Duration;

/// The first frame of a run that missed its deadline.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Miss {
    /// The frame's number.
    pub frame: u32,
    /// By how much, s; `None` where the frame did not leave whole.
    pub late_s: Option<f64>,
    /// `before it` or `after it` where what missed its deadline was an exposure without a frame.
    pub unexposed: Option<&'static str>,
}

/// The first frame of a run that took longer than what is watched for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Slow {
    /// The frame's number.
    pub frame: u32,
    /// From the trigger to its last octet, s; `None` where the frame did not leave whole.
    #[serde(rename = "last_octet_s", serialize_with = "maybe_seconds")]
    pub last_octet: Option<Duration>,
    /// See [`Miss`].
    pub unexposed: Option<&'static str>,
}

impl Miss {
    /// `late by 4.20 ms`, `not whole`, or `an exposure before it has no frame`.
    #[must_use]
    pub fn told(&self) -> String {
        let late = self.late_s.map(|s| format!("late by {:.2} ms", s * 1e3));
        told(late, self.unexposed)
    }
}

impl Slow {
    /// `14.2 ms`, and what [`Miss::told`] says of what has no time.
    #[must_use]
    pub fn told(&self) -> String {
        let took = |time: Duration| format!("{:.1} ms", time.as_secs_f64() * 1e3);
        told(self.last_octet.map(took), self.unexposed)
    }
}

fn told(time: Option<String>, unexposed: Option<&str>) -> String {
    let none = unexposed.map(|side| format!("an exposure {side} has no frame"));
    none.or(time).unwrap_or_else(|| "not whole".to_string())
}

/// A time in s, or null.
pub(super) fn maybe_seconds<S: Serializer>(
    time: &Option<Duration>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    time.map(|time| time.as_secs_f64()).serialize(serializer)
}
