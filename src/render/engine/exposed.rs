//! A rendered exposure, and what is known of it before its pixels are.

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
    /// What is in them.
    pub label: Label,
    /// The label as one line of JSON.
    pub json: Arc<String>,
    /// When it was exposed.
    pub exposure: Exposure,
    /// The camera, as it was set.
    pub camera: Arc<Camera>,
    /// What its noise is keyed by.
    pub key: NoiseKey,
    /// Objects without an image because their orbit has no position at this time.
    pub unknown: Unknown,
    /// Objects of the population, wherever they are.
    pub population: usize,
    /// The ages of element sets, if most are of another time and that has not been reported before.
    pub old: Option<Ages>,
    /// From the vehicle's state to pixels and label.
    pub render_time: Duration,
}

/// What is known of a frame before its pixels.
#[derive(Debug, Clone)]
pub struct Opening {
    /// Number of the frame in the run, from 0.
    pub number: u32,
    /// The label as one line of JSON.
    pub json: Arc<String>,
    /// When it is exposed.
    pub exposure: Exposure,
    /// The camera, as it is set.
    pub camera: Arc<Camera>,
    /// What its noise is keyed by.
    pub key: NoiseKey,
}

impl ExposedFrame {
    /// What was known of it before its pixels.
    pub fn opening(&self) -> Opening {
        Opening {
            number: self.number,
            json: self.json.clone(),
            exposure: self.exposure,
            camera: self.camera.clone(),
            key: self.key,
        }
    }
}

/// Observes a frame while it is made, on the thread that makes it.
pub trait FrameObserver: Sync {
    /// The label is complete.
    fn labelled(&self, _: Opening) {}

    /// Rows are complete: the first pixel (row-major), and the pixel values from there on. Not
    /// called if all rows complete together.
    fn rows_done(&self, _first: usize, _digits: &[u16]) {}
}

/// Observes nothing.
impl FrameObserver for () {}
