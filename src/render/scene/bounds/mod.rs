//! Bounds of the error without an effect, for plans and labels.
//!
//! An effect may be skipped if no pixel's expected charge changes by more than a tolerance.
//! Rendering the frame twice would double the cost, so the change is bounded instead:
//!
//! 1. Light is bounded in cells of 8 x 8 pixels (`cells`, `brightest`): in each cell the sum over
//!    sources of their brightest pixel. The greatest cell of each column of cells counts.
//! 2. An effect that adds light changes a pixel by its own light (`brightest`).
//! 3. An effect that shapes images changes each by its slope, bend and height (`image`). Where the
//!    sum of these bounds is too large, the other images are formed and compared (`compared`,
//!    `points`). Area light is compared, or bounded by its steepest step (`areas`).
//! 4. Columns that saturate or bloom are computed with the effect and without it (`wells`).

pub mod areas;
pub mod brightest;
pub mod cells;
pub mod compared;
pub mod image;
pub mod points;
pub mod wells;

pub use areas::{areas_changed_e, areas_transmission_change_e, full_pixel_error_e};
pub use brightest::{area_lit_e, lit_e, lit_where, transfer_smear_of};
pub use image::{
    BoundChange, Image, STEEPEST, STEEPEST_STREAK, dimming_px, lines_of_sight, rolled,
};
pub use points::changed_e;
pub use wells::{
    ALL_FULL, final_change_e, find_blooming, greatest, held_e, held_of, is_flooded_without,
    max_difference, of_cells, with_transfer_smear,
};
