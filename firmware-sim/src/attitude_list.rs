//! A list of attitudes at given epochs, slerped between neighbours.

use hifitime::Epoch;
use nalgebra::UnitQuaternion;
use skyloop_orbit::aem::{self, AttitudeMessage, AttitudeSegment};
use skyloop_orbit::not_attitudes;
use skyloop_orbit::time::{parse_utc, utc_text};
use thiserror::Error;

use crate::pointing::{Pointing, rate_between};
use crate::text::{parse_quaternion, quaternion};

/// Attitudes at increasing epochs, in one or more segments.
#[derive(Clone, Debug)]
pub struct AttitudeList {
    /// In file order. If two segments cover an epoch, the first one is used.
    segments: Vec<Segment>,
    remarks: Vec<String>,
}

/// At least two attitudes, interpolated by slerp.
#[derive(Clone, Debug)]
struct Segment {
    first: Epoch,
    last: Epoch,
    attitudes: Vec<(Epoch, UnitQuaternion<f64>)>,
}

/// Errors of a list of attitudes.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum ListError {
    #[error(
        "{name}:{line}: {reason}; a line holds UTC x y z w, such as 2019-06-15T23:35:50 0 0 0 1"
    )]
    Line {
        name: String,
        line: usize,
        reason: String,
    },
    #[error("{name}:{line}: {reason}")]
    Message {
        name: String,
        line: usize,
        reason: String,
    },
    #[error("{name}: {found}")]
    Unread { name: String, found: String },
    #[error(
        "{name}: a list needs two attitudes at least, this has {count}; to hold one, write it at two times"
    )]
    TooShort { name: String, count: usize },
    #[error(
        "{name}: the attitude at {} does not come after the one before it; sort the list by time",
        utc_text(*epoch)
    )]
    NotIncreasing { name: String, epoch: Epoch },
}

/// The list does not cover an epoch.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error(
    "no attitude at {}: the list covers {} to {}; give attitudes on both sides of every frame, or choose fewer frames",
    utc_text(*epoch), utc_text(*first), utc_text(*last)
)]
pub struct OutsideList {
    /// Requested epoch.
    pub epoch: Epoch,
    /// First epoch of the list.
    pub first: Epoch,
    /// Last epoch of the list.
    pub last: Epoch,
}

impl AttitudeList {
    /// A list from attitudes at strictly increasing epochs; `name` is for error messages.
    ///
    /// # Errors
    /// [`ListError::TooShort`], [`ListError::NotIncreasing`].
    pub fn new(
        attitudes: Vec<(Epoch, UnitQuaternion<f64>)>,
        name: &str,
    ) -> Result<Self, ListError> {
        if attitudes.len() < 2 {
            return Err(ListError::TooShort {
                name: name.into(),
                count: attitudes.len(),
            });
        }
        if let Some(pair) = attitudes.windows(2).find(|pair| pair[1].0 <= pair[0].0) {
            let (name, epoch) = (name.into(), pair[1].0);
            return Err(ListError::NotIncreasing { name, epoch });
        }
        let segment = Segment {
            first: attitudes[0].0,
            last: attitudes[attitudes.len() - 1].0,
            attitudes,
        };
        Ok(Self {
            segments: vec![segment],
            remarks: Vec::new(),
        })
    }

    /// Reads a CCSDS AEM, or lines of `UTC x y z w` (separated by blanks or commas; `#` starts a
    /// comment).
    ///
    /// # Errors
    /// [`ListError`] with file and line.
    pub fn parse(text: &str, name: &str) -> Result<Self, ListError> {
        if aem::is_message(text) {
            return Self::of_message(text, name);
        }
        if let Some(found) = not_attitudes(text) {
            let name = name.into();
            return Err(ListError::Unread { name, found });
        }
        let mut attitudes = Vec::new();
        for (index, line) in text.lines().enumerate() {
            let content = line.split('#').next().unwrap_or_default().trim();
            if content.is_empty() {
                continue;
            }
            let entry = parse_line(content);
            attitudes.push(entry.map_err(|reason| ListError::Line {
                name: name.into(),
                line: index + 1,
                reason,
            })?);
        }
        Self::new(attitudes, name)
    }

    fn of_message(text: &str, name: &str) -> Result<Self, ListError> {
        let refused = |(line, reason)| ListError::Message {
            name: name.into(),
            line,
            reason,
        };
        let AttitudeMessage { segments, remarks } = aem::parse(text).map_err(refused)?;
        let segments = segments.iter();
        let segments = segments.map(|segment| Segment::of(segment).map_err(refused));
        let remarks = remarks.iter();
        let remarks = remarks.map(|(line, remark)| format!("{name}:{line}: {remark}"));
        Ok(Self {
            segments: segments.collect::<Result<_, _>>()?,
            remarks: remarks.collect(),
        })
    }

    /// One line for each part of the file that is ignored or assumed.
    #[must_use]
    pub fn remarks(&self) -> &[String] {
        &self.remarks
    }

    /// Attitude and rates at `epoch`.
    pub fn at(&self, epoch: Epoch) -> Result<Pointing, OutsideList> {
        let holds = |segment: &&Segment| (segment.first..=segment.last).contains(&epoch);
        if let Some(segment) = self.segments.iter().find(holds) {
            return Ok(segment.at(epoch));
        }
        let distance = |segment: &&Segment| (segment.first - epoch).max(epoch - segment.last);
        let nearest = self.segments.iter().min_by_key(distance);
        let (first, last) = nearest.map_or((epoch, epoch), |segment| (segment.first, segment.last));
        Err(OutsideList { epoch, first, last })
    }
}

impl Segment {
    /// Converts a segment of a message. The error has the line and the reason.
    fn of(segment: &AttitudeSegment) -> Result<Self, (usize, String)> {
        let unit = segment.attitudes.iter().map(|timed| {
            let attitude = quaternion(timed.q_icrf_to_body);
            Ok((timed.epoch, attitude.map_err(|why| (timed.line, why))?))
        });
        let attitudes: Vec<_> = unit.collect::<Result<_, _>>()?;
        let (Some((first, _)), Some((last, _))) = (attitudes.first(), attitudes.last()) else {
            return Err((segment.line, "no attitudes".into()));
        };
        let (first, last) = (segment.start.max(*first), segment.stop.min(*last));
        if first > last {
            let why = "no attitude lies between the segment's start and stop time";
            return Err((segment.line, why.into()));
        }
        Ok(Self {
            first,
            last,
            attitudes,
        })
    }

    /// Attitude and rates at an epoch within the segment.
    fn at(&self, epoch: Epoch) -> Pointing {
        // Index of the first entry after the epoch. The last epoch belongs to the last pair.
        let after = self.attitudes.partition_point(|(at, _)| *at <= epoch);
        let after = after.clamp(1, self.attitudes.len() - 1);
        let ((t0, q0), (t1, q1)) = (self.attitudes[after - 1], self.attitudes[after]);
        let at_start = Pointing {
            attitude: q0,
            rates_rad_s: rate_between(&q0, &q1, (t1 - t0).to_seconds()),
        };
        at_start.after((epoch - t0).to_seconds())
    }
}

fn parse_line(content: &str) -> Result<(Epoch, UnitQuaternion<f64>), String> {
    let fields = content.split_once([' ', ',', '\t']);
    let (time, numbers) = fields.ok_or("only one field")?;
    Ok((parse_utc(time)?, parse_quaternion(numbers)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_lists_are_refused_with_file_and_line() {
        let at = "2019-06-15T23:35:50";
        for (text, part) in [
            (
                format!("{at} 0 0 0 1\nnot-a-time 0 0 0 1"),
                "a.txt:2: \"not-a-time\"",
            ),
            (format!("{at} 0 0 0"), "a.txt:1: 3 numbers where 4 belong"),
            (format!("{at} 0 0 0 1.1"), "norm is 1.1"),
            (format!("{at} 0 0 0 nan"), "\"nan\" is no finite number"),
            (at.into(), "only one field"),
            (format!("{at} 0 0 0 1"), "this has 1; to hold one"),
            (format!("{at} 0 0 0 1\n{at} 0 0 0 1"), "sort the list"),
        ] {
            let error = AttitudeList::parse(&text, "a.txt").unwrap_err().to_string();
            assert!(error.contains(part), "{text:?}: {error}");
        }
    }
}
