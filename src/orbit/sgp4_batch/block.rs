//! The states of a block, and failure codes.

use super::lanes::{BLOCK, Row};
use crate::StateVector;
use nalgebra::Vector3;

/// The reference's code for a position inside the Earth.
pub const DECAYED: u8 = 6;
/// Not a code of the reference: farther from the epoch than
/// [`MAX_ELAPSED_DAYS`](crate::elements::MAX_ELAPSED_DAYS).
pub const TOO_FAR: u8 = 7;
/// Not a code of the reference: numbers that are not finite.
pub const UNKNOWN: u8 = 8;

/// Marks the unused slots of a block.
pub const NO_OBJECT: u32 = u32::MAX;

/// The states of a block, TEME; zero where the code is not 0.
#[derive(Clone, Debug, Default)]
#[repr(align(64))]
pub struct BlockStates {
    /// x, y, z, km.
    pub position_km: [Row; 3],
    /// x, y, z, km/s.
    pub velocity_km_s: [Row; 3],
    /// 0, or a failure code, see `States::get`.
    pub code: Row,
}

impl BlockStates {
    /// Before the propagation.
    pub(crate) const NONE: BlockStates = BlockStates {
        position_km: [[0.0; BLOCK]; 3],
        velocity_km_s: [[0.0; BLOCK]; 3],
        code: [UNKNOWN as f64; BLOCK],
    };

    pub(super) fn get(&self, i: usize) -> Result<StateVector, u8> {
        let vector = |rows: &[Row; 3]| Vector3::from_fn(|axis, _| rows[axis][i] * 1e3);
        match self.code[i] as u8 {
            0 => Ok(StateVector {
                position_m: vector(&self.position_km),
                velocity_m_s: vector(&self.velocity_km_s),
            }),
            code => Err(code),
        }
    }
}
