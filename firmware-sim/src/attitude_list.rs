//! A list of attitudes at given epochs, slerped between neighbours, and the text forms of epochs and quaternions.

use hifitime::Epoch;
use nalgebra::{Quaternion, UnitQuaternion};
use skyloop_orbit::time::{parse_utc, utc_text};
use thiserror::Error;

use crate::profile::{Pointing, ProfileError, rate_between, turn};

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

    pub(crate) fn at(&self, epoch: Epoch) -> Result<Pointing, ProfileError> {
        // The segment whose end is the first entry after the epoch; the last entry belongs to the last segment.
        let after = self
            .0
            .partition_point(|(at, _)| *at <= epoch)
            .min(self.0.len() - 1);
        let outside = ProfileError::OutsideList {
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

/// Numbers from text, with commas or blanks between.
///
/// # Errors
/// Says which item is not a finite number, or how many there are instead of N.
pub fn parse_numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let items = text.split([' ', ',', '\t']).filter(|item| !item.is_empty());
    let numbers = items
        .map(|item| match item.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(format!("\"{item}\" is no finite number")),
        })
        .collect::<Result<Vec<f64>, String>>()?;
    let count = numbers.len();
    numbers
        .try_into()
        .map_err(|_| format!("{count} numbers where {N} belong"))
}

/// A unit quaternion from `x y z w`, normalised when its norm is within 1e-3 of 1.
///
/// # Errors
/// Says what is wrong with the numbers or the norm.
pub fn parse_quaternion(text: &str) -> Result<UnitQuaternion<f64>, String> {
    quaternion(parse_numbers::<4>(text)?)
}

/// A unit quaternion from `[x, y, z, w]`, normalised when its norm is within 1e-3 of 1.
///
/// # Errors
/// Says the norm.
pub fn quaternion([x, y, z, w]: [f64; 4]) -> Result<UnitQuaternion<f64>, String> {
    let q = Quaternion::new(w, x, y, z);
    let norm = q.norm();
    if (norm - 1.0).abs() <= 1e-3 {
        Ok(UnitQuaternion::from_quaternion(q))
    } else {
        Err(format!(
            "the quaternion's norm is {norm:.6}, not 1 within 0.001"
        ))
    }
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
