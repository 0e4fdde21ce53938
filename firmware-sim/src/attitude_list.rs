//! A list of attitudes at given epochs, slerped between neighbours.

use hifitime::Epoch;
use nalgebra::UnitQuaternion;
use skyloop_orbit::time::{parse_utc, utc_text};
use thiserror::Error;

use crate::pointing::{Pointing, rate_between, turn};
use crate::text::parse_quaternion;

/// Attitudes at increasing epochs, two at least.
#[derive(Clone, Debug)]
pub struct AttitudeList(Vec<(Epoch, UnitQuaternion<f64>)>);

/// Why a list of attitudes is refused.
#[derive(Debug, Error)]
pub enum ListError {
    /// A line that is not `UTC x y z w`.
    #[error(
        "{name}:{line}: {reason}; a line holds UTC x y z w, such as 2019-06-15T23:35:50 0 0 0 1"
    )]
    Line {
        /// The file or other origin.
        name: String,
        /// Line number, from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// Fewer than two attitudes.
    #[error("{name}: {count} attitudes; a list needs two at least (for one attitude, hold it)")]
    TooShort {
        /// The file or other origin.
        name: String,
        /// How many there are.
        count: usize,
    },
    /// Epochs do not increase.
    #[error(
        "{name}: the attitude at {} does not come after the one before it; sort the list by time",
        utc_text(*epoch)
    )]
    NotIncreasing {
        /// The file or other origin.
        name: String,
        /// The epoch that is out of order.
        epoch: Epoch,
    },
}

/// There is no attitude at an epoch: the list does not cover it.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error(
    "no attitude at {}: the list covers {} to {}; give attitudes on both sides of every frame, or ask for fewer frames",
    utc_text(*epoch), utc_text(*first), utc_text(*last)
)]
pub struct OutsideList {
    /// The epoch asked for.
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
        match attitudes.windows(2).find(|pair| pair[1].0 <= pair[0].0) {
            Some(pair) => Err(ListError::NotIncreasing {
                name: name.into(),
                epoch: pair[1].0,
            }),
            None => Ok(Self(attitudes)),
        }
    }

    /// Reads lines of `UTC x y z w` (blanks or commas between; `#` starts a comment).
    ///
    /// # Errors
    /// [`ListError`] with file and line.
    pub fn parse(text: &str, name: &str) -> Result<Self, ListError> {
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

    /// Attitude and rates at `epoch`.
    ///
    /// # Errors
    /// [`OutsideList`].
    pub fn at(&self, epoch: Epoch) -> Result<Pointing, OutsideList> {
        // The segment whose end is the first entry after the epoch; the last entry belongs to the last segment.
        let after = self
            .0
            .partition_point(|(at, _)| *at <= epoch)
            .min(self.0.len() - 1);
        let outside = OutsideList {
            epoch,
            first: self.0[0].0,
            last: self.0[self.0.len() - 1].0,
        };
        let (Some(&(t0, q0)), Some(&(t1, q1))) =
            (self.0.get(after.wrapping_sub(1)), self.0.get(after))
        else {
            return Err(outside);
        };
        if epoch > t1 {
            return Err(outside);
        }
        let rates_rad_s = rate_between(&q0, &q1, (t1 - t0).to_seconds());
        let attitude = turn(rates_rad_s * (epoch - t0).to_seconds()) * q0;
        Ok(Pointing {
            attitude,
            rates_rad_s,
        })
    }
}

fn parse_line(content: &str) -> Result<(Epoch, UnitQuaternion<f64>), String> {
    let (time, numbers) = content
        .split_once([' ', ',', '\t'])
        .ok_or("only one field")?;
    let epoch = parse_utc(time)?;
    Ok((epoch, parse_quaternion(numbers)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_lists_are_refused_with_file_and_line() {
        for (text, part) in [
            (
                "2019-06-15T23:35:50 0 0 0 1\nnot-a-time 0 0 0 1",
                "a.txt:2: \"not-a-time\"",
            ),
            (
                "2019-06-15T23:35:50 0 0 0",
                "a.txt:1: 3 numbers where 4 belong",
            ),
            ("2019-06-15T23:35:50 0 0 0 1.1", "norm is 1.1"),
            (
                "2019-06-15T23:35:50 0 0 0 nan",
                "\"nan\" is no finite number",
            ),
            ("2019-06-15T23:35:50", "only one field"),
            ("2019-06-15T23:35:50 0 0 0 1", "two at least"),
            (
                "2019-06-15T23:35:51 0 0 0 1\n2019-06-15T23:35:50 0 0 0 1",
                "sort the list",
            ),
        ] {
            let error = AttitudeList::parse(text, "a.txt").unwrap_err().to_string();
            assert!(error.contains(part), "{text:?}: {error}");
        }
    }
}
