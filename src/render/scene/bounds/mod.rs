//! Bounds of what leaving an effect out changes in the frame: the errors that plans and labels
//! declare.
//!
//! An effect may be skipped if no pixel's expected charge changes by more than a tolerance. Making
//! the frame twice would tell, at twice the cost, so the change is bounded instead:
//!
//! 1. The light of every source is bounded in cells of 8 x 8 pixels (`cells`, `brightest`): in each
//!    cell the sum of what each source gives to its brightest pixel there. What is kept is the
//!    greatest cell of each column of cells.
//! 2. An effect that adds light changes a pixel by its own light (`brightest`).
//! 3. An effect that shapes images changes each by its slope, bend and height (`image`). Where these
//!    bounds add up to too much, the other images are formed and compared (`compared`, `points`).
//!    Area light is compared, or bounded by its steepest step (`areas`).
//! 4. Pixels that fill up show less, and spill (`wells`): their columns are computed with the effect
//!    and without it.

pub mod areas;
pub mod brightest;
pub mod cells;
pub mod compared;
pub mod image;
pub mod points;
pub mod wells;

pub use areas::{areas_changed_e, areas_taken_e, straightened_e};
pub use brightest::{area_lit_e, lit_e, lit_where, transfer_smear_of};
pub use image::{
    BoundChange, Image, STEEPEST, STEEPEST_STREAK, dimming_px, lines_of_sight, rolled,
};
pub use points::changed_e;
pub use wells::{
    BELOW_NOISE, apart, find_blooming, greatest, held_e, held_of, is_below_noise, of_cells,
    shown_e, with_transfer_smear,
};
