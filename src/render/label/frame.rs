//! The label of one frame.

use super::coordinates::km;
use super::fidelity::FidelityLabel;
use super::object::{ObjectLabel, object};
use super::objects::{BYTES, Objects};
use super::rounded::{e4, e6, some_bound, some_e4, some_short};
use super::visible::is_listed;
use super::{artifact, empty, unseen};
use crate::attitude::{VehicleState, degrees_of_turn};
use crate::camera::Camera;
use crate::effect::{Decision, name_of};
use crate::plan::{Plan, Step};
use crate::scene::{EffectId, Scene, Source, World, flooded_by};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;
use skyloop_orbit::time::utc_text;
use std::collections::BTreeMap;

/// Minimum number of objects whose labels one thread makes.
const TASK: usize = 64;
/// Number of labels between two checks for cancellation: some 10 ms.
const PART: usize = 1024;

/// The label of one frame. [`Label::to_json`] writes its text; serde alone would leave out the
/// objects.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Label {
    /// Number of the frame in its run, from 0.
    pub frame: u32,
    /// Seed of the run.
    pub seed: u64,
    /// Name of the camera.
    pub camera: String,
    /// Columns of the frame.
    pub columns: usize,
    /// Rows of the frame.
    pub rows: usize,
    /// Start of the exposure, UTC.
    pub epoch_start: String,
    /// Middle of the exposure, UTC: the time of attitude, state, ranges and positions.
    pub epoch_mid: String,
    /// End of the exposure, UTC.
    pub epoch_end: String,
    /// Exposure time.
    pub exposure_s: f64,
    /// Unit quaternion from ICRF to body axes, `[x, y, z, w]`.
    pub q_icrf_to_body: [f64; 4],
    /// Unit quaternion from body to camera axes, `[x, y, z, w]`.
    pub q_body_to_camera: [f64; 4],
    /// Body rates, body axes.
    pub rates_rad_s: [f64; 3],
    /// Position (km) and velocity (km/s) of the observer, GCRF.
    pub state_gcrf_km: [f64; 6],
    /// Rotation matrix from ICRF to camera axes, row by row.
    pub r_icrf_to_camera: [[f64; 3]; 3],
    /// Right ascension of the boresight, the camera's +Z at mid-exposure: geometric (without
    /// aberration), ICRF, from 0 to below 360.
    pub ra_deg: f64,
    /// Declination of the boresight.
    pub dec_deg: f64,
    /// Position angle of up in the image (the camera's -Y) at the boresight, from north through
    /// east, from 0 to below 360.
    pub roll_deg: f64,
    /// Expected electrons of a pixel without objects, dark charge included, averaged over the
    /// frame.
    #[serde(serialize_with = "e4")]
    pub background_e_px: f64,
    /// Angle of the Sun from the boresight at mid-exposure.
    #[serde(serialize_with = "e6")]
    pub sun_deg: f64,
    /// Whether the Sun is within its exclusion angle and not behind the Earth; then the frame is
    /// saturated.
    pub sun_excluded: bool,
    /// Effect with the most charge, if the background alone saturates every pixel.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flooded_by: Option<&'static str>,
    /// Reason for an empty list of objects.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_objects: Option<String>,
    /// Error tolerances of the frame.
    pub fidelity: FidelityLabel,
    /// Policy that was applied because a frame would have been late.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overrun: Option<&'static str>,
    /// Effects in physical order: simulated or not, and why.
    pub effects: Vec<EffectLabel>,
    /// Number of particles and defects that are not listed: those beyond 10,000, or beyond 200,000
    /// pixels, with the lowest signal-to-noise ratios.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spots_left_out: Option<usize>,
    /// Greatest signal-to-noise ratio among these.
    #[serde(serialize_with = "some_e4", skip_serializing_if = "Option::is_none")]
    pub spots_left_out_snr: Option<f64>,
    /// Mean number of particles above the limit of an exposure, which are not drawn.
    #[serde(serialize_with = "some_short", skip_serializing_if = "Option::is_none")]
    pub particles_left_out: Option<f64>,
    /// Ids of objects in the field that are not in `objects`, by reason.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub unseen: BTreeMap<&'static str, Vec<String>>,
    /// Number of these objects, by reason.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub unseen_counts: BTreeMap<&'static str, usize>,
    /// Number of these objects that are not listed, because there are too many.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unseen_left_out: Option<usize>,
    /// The content of the frame; the last member of the text.
    #[serde(skip)]
    pub objects: Objects,
}

/// Decision of the planner on one effect.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct EffectLabel {
    /// Name of the effect.
    pub effect: &'static str,
    /// Whether it was simulated.
    pub run: bool,
    /// Reason.
    pub why: String,
    /// Greatest error of a pixel without it: expected electrons, or rms if it is random; null if it
    /// ran or is switched off.
    #[serde(serialize_with = "some_bound")]
    pub error_e: Option<f64>,
    /// Greatest error of the position of an image, or of an end of its track, without it; null if
    /// it ran or is switched off.
    #[serde(serialize_with = "some_bound")]
    pub error_px: Option<f64>,
    /// Estimated time on one core; null if it did not run.
    #[serde(serialize_with = "some_short")]
    pub price_ms: Option<f64>,
}

impl EffectLabel {
    /// The decision of one step of a plan.
    pub fn new(plan: &Plan<'_>, step: &Step<'_>) -> EffectLabel {
        let (why, error, price_ms) = match &step.decision {
            Decision::Off { why } => (*why, None, None),
            Decision::Skip { why } => (&**why, plan.error(step), None),
            Decision::Run {
                because,
                estimated_ms: price_ms,
                ..
            } => (&**because, None, Some(*price_ms)),
        };
        EffectLabel {
            effect: step.effect.name,
            run: price_ms.is_some(),
            why: why.to_string(),
            error_e: error.map(|error| error.e),
            error_px: error.map(|error| error.px),
            price_ms,
        }
    }
}

impl Label {
    /// The label of `scene`. It lists objects whose signal-to-noise ratio, if neither hidden nor
    /// shaded, is at least `label_snr`.
    pub fn new(frame: u32, scene: &Scene, plan: &Plan<'_>, world: &World, label_snr: f64) -> Label {
        Label::new_in(Vec::new(), frame, scene, plan, world, label_snr)
    }

    /// The same, reusing the memory of an earlier label's objects.
    pub(crate) fn new_in(
        memory: Vec<ObjectLabel>,
        frame: u32,
        scene: &Scene,
        plan: &Plan<'_>,
        world: &World,
        label_snr: f64,
    ) -> Label {
        let view = &scene.view;
        let Camera { name, mounting, .. } = view.camera.as_ref();
        let (vehicle, exposure) = (&view.vehicle, &view.exposure);
        let pointing = view.pointing(0.0);
        let matrix = pointing.matrix();
        let [ra, dec, roll] = pointing.ra_dec_roll();
        let flooded_by = flooded_by(scene).map(name_of);
        let artifacts = artifact::artifacts(scene, label_snr);
        let beyond = scene.particles_left_out;
        let unseen = unseen::listed(scene, world, label_snr);
        let steps = plan.steps.iter();
        let (effects, objects) = rayon::join(
            || steps.map(|step| EffectLabel::new(plan, step)).collect(),
            || object_labels(memory, scene, world, label_snr),
        );
        Label {
            frame,
            seed: view.key.seed,
            camera: name.clone(),
            columns: view.camera.detector.width,
            rows: view.camera.detector.height,
            epoch_start: utc_text(exposure.start),
            epoch_mid: utc_text(exposure.mid),
            epoch_end: utc_text(exposure.end),
            exposure_s: exposure.duration_s,
            q_icrf_to_body: vehicle.attitude.xyzw(),
            q_body_to_camera: mounting.xyzw(),
            rates_rad_s: vehicle.rates.into(),
            state_gcrf_km: state_km(vehicle),
            r_icrf_to_camera: [0, 1, 2].map(|i| matrix.row(i).transpose().into()),
            ra_deg: degrees_of_turn(ra),
            dec_deg: dec.to_degrees(),
            roll_deg: degrees_of_turn(roll),
            background_e_px: scene.background_e(),
            sun_deg: view.sun.angle.to_degrees(),
            sun_excluded: view.sun.excluded && scene.simulated.has(EffectId::Sunlight),
            flooded_by,
            no_objects: objects
                .is_empty()
                .then(|| empty::why_no_objects(scene, label_snr, flooded_by)),
            fidelity: (&scene.fidelity).into(),
            overrun: None,
            effects,
            spots_left_out: (artifacts.left_out > 0).then_some(artifacts.left_out),
            spots_left_out_snr: artifacts.left_out_snr,
            particles_left_out: (beyond > 0.0).then_some(beyond),
            unseen: unseen.ids,
            unseen_counts: unseen.counts,
            unseen_left_out: (unseen.left_out > 0).then_some(unseen.left_out),
            objects: Objects {
                sources: objects,
                artifacts: artifacts.listed,
            },
        }
    }

    /// The text on the wire; `labels.jsonl` adds the frame's files to it.
    pub fn to_json(&self) -> String {
        self.to_json_in(String::new())
    }

    /// The same, reusing the memory of an earlier text.
    pub(crate) fn to_json_in(&self, memory: String) -> String {
        let mut text = memory.into_bytes();
        text.clear();
        text.reserve(4096 + BYTES * self.objects.len());
        let text = match self.write(&mut text) {
            Ok(()) => String::from_utf8(text).map_err(|error| error.to_string()),
            Err(error) => Err(error.to_string()),
        };
        text.unwrap_or_else(|error| format!("{{\"error\":\"{error}\"}}"))
    }

    fn write(&self, text: &mut Vec<u8>) -> serde_json::Result<()> {
        serde_json::to_writer(&mut *text, self)?;
        // Objects follow all other members.
        text.pop();
        text.extend_from_slice(b",\"objects\":");
        self.objects.write(text)?;
        text.push(b'}');
        Ok(())
    }
}

/// Position (km) and velocity (km/s) in GCRF; zeros without an orbit.
fn state_km(vehicle: &VehicleState) -> [f64; 6] {
    let Some(state) = &vehicle.orbit else {
        return [0.0; 6];
    };
    let (r, v) = (km(&state.position_m), km(&state.velocity_m_s));
    [r[0], r[1], r[2], v[0], v[1], v[2]]
}

/// The labels of the listed sources, in the memory of an earlier label's.
fn object_labels(
    memory: Vec<ObjectLabel>,
    scene: &Scene,
    world: &World,
    label_snr: f64,
) -> Vec<ObjectLabel> {
    // A filtered iterator has no length; the parallel one below must have one.
    let sources = scene.sources.iter();
    let sources: Vec<&Source> = sources
        .filter(|source| is_listed(source, scene, label_snr))
        .collect();
    let mut objects = memory;
    objects.clear();
    objects.reserve(sources.len());
    // The label of a cancelled frame is not used.
    let parts = sources.chunks(PART);
    for part in parts.take_while(|_| !scene.view.limit.is_cancelled()) {
        let part = part.par_iter().with_min_len(TASK);
        objects.par_extend(part.map(|source| object(source, scene, world)));
    }
    objects
}
