//! The images of point sources: a candidate's track over the detector plane, and where its light falls.

use super::view::{Candidate, View};
use super::{Simulated, Source, background_e};
use crate::fidelity::Fidelity;
use crate::footprint::Footprint;
use crate::track::Track;

impl View {
    /// The image of `candidate`; none if nothing of it can touch the detector.
    pub(super) fn image(
        &self,
        candidate: &Candidate,
        simulated: &Simulated,
        fidelity: &Fidelity,
    ) -> Option<Source> {
        let camera = &self.camera;
        let optics = &camera.optics;
        // Pieces that turn by less than 3 degrees each are nearly straight.
        let turn = self.vehicle.rates.norm() * self.exposure.duration_s + candidate.swing();
        let pieces = (turn / 0.05).ceil().clamp(2.0, 1e4) as usize;
        let at = |part: f64| optics.project(&self.pointing(part).rotate(&candidate.line(part)));
        let window = Footprint::window(camera, fidelity);
        let track = if simulated.smear {
            Track::sample(at, pieces, optics.psf.core_px(), &window, fidelity)
        } else {
            at(0.5).map(|mid| Track::still(mid, at(0.0), at(1.0)))
        }?;
        let footprint = Footprint::new(&track, camera, fidelity);
        let centroid = track.centroid();
        if footprint.shares().is_empty() && !camera.detector.contains(centroid) {
            return None;
        }
        let electrons = candidate.electrons();
        Some(Source {
            snr: self.snr(&footprint, electrons, simulated),
            clear_snr: self.snr(&footprint, candidate.clear_e, simulated),
            body: candidate.body.clone(),
            start: track.start,
            end: track.end,
            centroid,
            footprint,
            electrons,
            hidden: candidate.hidden,
        })
    }

    /// `sqrt(sum s^2 / (s + b + read^2))` over the pixels: the best that any weighting of them can reach.
    fn snr(&self, footprint: &Footprint, electrons: f64, simulated: &Simulated) -> f64 {
        let read = if simulated.read {
            self.camera.detector.read_noise_e
        } else {
            0.0
        };
        let background = background_e(self, simulated);
        let variance = |s: f64| {
            let shot = if simulated.shot { s + background } else { 0.0 };
            shot + read * read
        };
        let sum: f64 = footprint
            .shares()
            .iter()
            .map(|share| f64::from(*share) * electrons)
            .filter(|s| *s > 0.0)
            .map(|s| s * s / variance(s).max(f64::MIN_POSITIVE))
            .sum();
        // An empty sum is -0.
        sum.abs().sqrt()
    }
}
