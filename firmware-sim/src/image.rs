//! Input of the detector.

/// Pixels of one frame and their conversion to electrons: the complete input of the detector.
#[derive(Clone, Copy, Debug)]
pub struct Image<'a> {
    /// Frame number, which identifies the detections.
    pub frame: u32,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// DN, row by row, `width * height` values.
    pub pixels: &'a [u16],
    /// Gain, e-/DN.
    pub gain_e_per_dn: f64,
    /// DN without light.
    pub offset_dn: f64,
    /// The largest DN of the converter.
    pub full_scale_dn: u16,
}
