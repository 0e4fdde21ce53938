//! The shutter: timing of the rows and of the readout.

/// Timing of the exposure's begin and end.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Shutter {
    /// All rows together.
    #[default]
    Global,
    /// Row after row, from row 0 on: row r collects light for the exposure time around
    /// `mid + (r - (rows - 1) / 2) row_s`.
    Rolling {
        /// Time from one row to the next, s.
        row_s: f64,
    },
    /// All rows together without a shutter: the image is shifted row by row below a cover, and
    /// collects light during the shift.
    FrameTransfer {
        /// Time to shift the image by one row, s.
        row_s: f64,
    },
}

/// Names in camera files.
pub(crate) const SHUTTERS: [&str; 3] = ["global", "rolling", "frame-transfer"];

impl Shutter {
    /// The shutter called `name`; `row_s` is the time from row to row.
    pub fn named(name: &str, row_s: f64) -> Option<Shutter> {
        match name {
            "global" => Some(Shutter::Global),
            "rolling" => Some(Shutter::Rolling { row_s }),
            "frame-transfer" => Some(Shutter::FrameTransfer { row_s }),
            _ => None,
        }
    }

    /// Time from the opening of the first row to that of the last row, s.
    pub fn readout_s(&self, rows: usize) -> f64 {
        match self {
            Shutter::Rolling { row_s } => rows.saturating_sub(1) as f64 * row_s,
            Shutter::Global | Shutter::FrameTransfer { .. } => 0.0,
        }
    }

    /// The shortest time (s) from one exposure of `exposure_s` to the next. Exposures do not
    /// overlap, a frame's rows are read before those of the next, and an image is not shifted
    /// during its exposure.
    pub fn period_s(&self, rows: usize, exposure_s: f64) -> f64 {
        match self {
            Shutter::Global => exposure_s,
            Shutter::Rolling { row_s } => exposure_s.max(rows as f64 * row_s),
            Shutter::FrameTransfer { row_s } => exposure_s + rows as f64 * row_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn period_contains_exposure_and_readout() {
        let rolling = Shutter::Rolling { row_s: 1e-5 };
        let transfer = Shutter::FrameTransfer { row_s: 1e-5 };
        assert!((rolling.readout_s(1001) - 0.01).abs() < 1e-15);
        assert_eq!(transfer.readout_s(1001), 0.0);
        assert_eq!(rolling.period_s(1000, 0.1), 0.1);
        assert!((rolling.period_s(1000, 0.001) - 0.01).abs() < 1e-15);
        assert!((transfer.period_s(1000, 0.1) - 0.11).abs() < 1e-15);
        assert_eq!(Shutter::Global.period_s(1000, 0.1), 0.1);
    }
}
