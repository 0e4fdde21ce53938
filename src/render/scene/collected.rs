//! The part of a track's light that the camera collects after vignetting and shutter.

use crate::camera::psf::square;
use crate::camera::{Camera, Stamp};
use crate::fidelity::Fidelity;
use crate::footprint::Light;
use crate::track::{Lit, Sample, Track};

/// The collected light of a track, on the unbounded plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Collected {
    /// In units of the light that arrives at the aperture in the exposure (1).
    pub light: f64,
    /// Its centre on the pixels, px: it may differ from the image of the point.
    pub centre: [f64; 2],
}

impl Collected {
    /// Adds up the samples; with a rolling shutter row by row.
    ///
    /// With w the samples' weights and f the part of the light around (x, y) that falls on open
    /// rows r,
    ///
    /// ```text
    /// light = sum w f
    /// centre = sum w (x f, y f + sum_open (r - y) s_r - f sum_all (r - y) s_r) / light
    /// ```
    ///
    /// with the share s_r of a row. The last term removes the effect of pixelation on the centre of
    /// a fully lit image.
    pub fn of(
        track: &Track,
        camera: &Camera,
        fidelity: &Fidelity,
        source_light: &Light,
    ) -> Collected {
        let (mut light, mut moments) = (0.0, [0.0; 2]);
        let mut stamp = Stamp::default();
        for sample in &track.samples {
            let weight = sample.weight;
            let (part, shift) = open(sample, camera, fidelity, source_light, &mut stamp);
            let [x, y] = camera.optics.lit(sample.at);
            light += weight * part;
            // Relative to the start, for precision far from the origin.
            moments[0] += weight * part * (x - track.start[0]);
            moments[1] += weight * (part * (y - track.start[1]) + shift);
        }
        let centre = [0, 1].map(|k| track.start[k] + moments[k] / light.max(f64::MIN_POSITIVE));
        Collected { light, centre }
    }
}

/// The part of a sample's light on open rows, and the shift of its first moment, px.
fn open(
    sample: &Sample,
    camera: &Camera,
    fidelity: &Fidelity,
    source_light: &Light,
    stamp: &mut Stamp,
) -> (f64, f64) {
    let at = &sample.at;
    if sample.lit == Lit::ALL {
        return (1.0, 0.0);
    }
    let psf = camera.optics.psf_at(*at, source_light.wavelength_ratio);
    let reach = psf.drawn_px(fidelity, source_light.electrons);
    let [columns, rows] = square(*at, reach);
    if sample.lit.among(&rows) == rows {
        return (1.0, 0.0);
    }
    psf.spread_on_rows(*at, columns, rows.clone(), stamp);
    let (mut all, mut part) = ([0.0; 2], [0.0; 2]);
    let mut collected = Vec::new();
    sample.shares(&rows, &mut collected);
    for (row, (share, collected)) in rows.zip(stamp.light.iter().zip(collected)) {
        let moment = share * (row as f64 - at[1]);
        all = [all[0] + share, all[1] + moment];
        part = [part[0] + collected * share, part[1] + collected * moment];
    }
    let open = part[0] / all[0].max(f64::MIN_POSITIVE);
    (
        open,
        (part[1] - open * all[1]) / all[0].max(f64::MIN_POSITIVE),
    )
}
