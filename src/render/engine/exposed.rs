//! A rendered exposure, and its data before the pixels exist.

use crate::camera::Camera;
use crate::frame::Frame;
use crate::label::Label;
use crate::scene::{Exposure, Unknown};
use skyloop_base::rng::NoiseKey;
use skyloop_orbit::Ages;
use std::sync::Arc;
use std::time::Duration;

/// One exposure, rendered.
#[derive(Debug, Clone)]
pub struct ExposedFrame {
    /// Number of the frame in the run, from 0.
    pub number: u32,
    /// The pixels.
    pub frame: Frame,
    /// The label.
    pub label: Label,
    /// The label as one line of JSON.
    pub json: Arc<String>,
    /// The instants of the exposure.
    pub exposure: Exposure,
    /// The camera with its settings for this exposure.
    pub camera: Arc<Camera>,
    /// The key of its noise.
    pub key: NoiseKey,
    /// Objects without an image because their orbit has no position at this time.
    pub unknown: Unknown,
    /// Number of objects in the population.
    pub population: usize,
    /// The ages of element sets, if most are old and this was not reported before.
    pub old: Option<Ages>,
    /// Time from the vehicle's state to pixels and label.
    pub render_time: Duration,
}

/// The data of a frame before its pixels exist.
#[derive(Debug, Clone)]
pub struct FrameInfo {
    /// Number of the frame in the run, from 0.
    pub number: u32,
    /// The label as one line of JSON.
    pub json: Arc<String>,
    /// The instants of the exposure.
    pub exposure: Exposure,
    /// The camera with its settings for this exposure.
    pub camera: Arc<Camera>,
    /// The key of its noise.
    pub key: NoiseKey,
}

impl ExposedFrame {
    /// Its data without pixels.
    pub fn opening(&self) -> FrameInfo {
        FrameInfo {
            number: self.number,
            json: self.json.clone(),
            exposure: self.exposure,
            camera: self.camera.clone(),
            key: self.key,
        }
    }
}

/// Observes the rendering of a frame, on the rendering thread.
pub trait FrameObserver: Sync {
    /// The label is complete.
    fn labelled(&self, _: FrameInfo) {}

    /// Rows are complete: the first pixel (row-major), and the pixel values from there on. Not
    /// called if all rows complete together.
    fn rows_done(&self, _first: usize, _dn: &[u16]) {}
}

impl FrameObserver for () {}
