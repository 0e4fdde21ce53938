//! A frame's pixels as the detector gets them.

/// The pixels of one frame and what turns them into electrons: all that the detector may see.
#[derive(Clone, Copy, Debug)]
pub struct Image<'a> {
    /// The frame's number, to tell whose detections these are.
    pub frame: u32,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// DN, row by row, `width * height` of them.
    pub pixels: &'a [u16],
    /// Electrons a DN.
    pub gain_e_per_dn: f64,
    /// DN of no light.
    pub offset_dn: f64,
    /// The largest DN of the converter.
    pub full_scale_dn: u16,
}
