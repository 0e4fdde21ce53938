//! Labels: what is in a frame, exactly. One JSON object a frame; its names are the contract of the README.

mod empty;
mod fidelity;
mod objects;
mod rounded;
mod schema;
mod spot;
mod text;
mod unseen;
mod visible;
mod wanderer;

pub use fidelity::FidelityLabel;
pub use objects::Objects;
pub use schema::schema;
pub use spot::{MOST_SPOT_PIXELS, MOST_SPOTS, SpotLabel};
pub use unseen::MOST_UNSEEN;
pub use visible::why_hidden;
pub use wanderer::WandererLabel;

use objects::OCTETS;
use rounded::{e4, e6, some_bound, some_e4, some_short};

use crate::attitude::degrees_of_turn;
use crate::camera::Camera;
use crate::effect::{Verdict, name_of};
use crate::plan::{Plan, Step};
use crate::scene::{Body, EffectId, Scene, SeenWanderer, Source, World, flooded_by};
use crate::sky::population::SeenObject;
use nalgebra::Vector3;
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;
use skyloop_orbit::StateVector;
use skyloop_orbit::time::utc_text;
use std::collections::BTreeMap;

/// Objects of which one thread makes the labels at least.
const TASK: usize = 64;
/// And of which labels are made before it is asked whether the frame is cancelled: some 10 ms.
const PART: usize = 1024;

/// Kinds of objects.
const STAR: &str = "star";
const RSO: &str = "rso";

/// Objects of a lower signal-to-noise ratio count as not visible.
pub const VISIBLE_SNR: f64 = 3.0;

/// The label of one frame. Its text is [`Label::to_json`]; as serde has it, it lacks its objects.
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
    /// UTC.
    pub epoch_start: String,
    /// UTC; what attitude, state, ranges and positions hold for.
    pub epoch_mid: String,
    /// UTC.
    pub epoch_end: String,
    /// Exposure time.
    pub exposure_s: f64,
    /// `[x, y, z, w]`.
    pub q_icrf_to_body: [f64; 4],
    /// `[x, y, z, w]`.
    pub q_body_to_camera: [f64; 4],
    /// Body axes.
    pub rates_rad_s: [f64; 3],
    /// Position (km) and velocity (km/s) of the observer, GCRF.
    pub state_gcrf_km: [f64; 6],
    /// Row by row.
    pub r_icrf_to_camera: [[f64; 3]; 3],
    /// Right ascension of the boresight, the camera's +Z at mid-exposure: geometric (without aberration), ICRF, from 0 to below 360.
    pub ra_deg: f64,
    /// Declination of the boresight.
    pub dec_deg: f64,
    /// Position angle of up in the image (the camera's -Y) at the boresight, from north through east, from 0 to below 360.
    pub roll_deg: f64,
    /// Expected electrons of a pixel that no object lights, dark charge included, averaged over the frame.
    #[serde(serialize_with = "e4")]
    pub background_e_px: f64,
    /// The Sun from the boresight at mid-exposure.
    #[serde(serialize_with = "e6")]
    pub sun_deg: f64,
    /// Whether the Sun is within its exclusion angle and not behind the Earth: the frame saturates.
    pub sun_excluded: bool,
    /// The effect that adds the most charge, where every pixel is full without a star or an object in it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub flooded_by: Option<&'static str>,
    /// Why there are no objects; none where there are some.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_objects: Option<String>,
    /// By which tolerances it was rendered.
    pub fidelity: FidelityLabel,
    /// What was done because a frame would have been late.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overrun: Option<&'static str>,
    /// What was simulated and what was not, and why, in physical order.
    pub effects: Vec<EffectLabel>,
    /// Particles and defects that are not listed, for there are more than [`MOST_SPOTS`], or they have more pixels than [`MOST_SPOT_PIXELS`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spots_left_out: Option<usize>,
    /// The greatest signal-to-noise ratio among those.
    #[serde(serialize_with = "some_e4", skip_serializing_if = "Option::is_none")]
    pub spots_left_out_snr: Option<f64>,
    /// Particles that would have crossed the detector, on average, beyond the most that are drawn.
    #[serde(serialize_with = "some_short", skip_serializing_if = "Option::is_none")]
    pub particles_left_out: Option<f64>,
    /// Objects in the field that are not among `objects`, by why: their ids.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub unseen: BTreeMap<&'static str, Vec<String>>,
    /// How many there are, by why.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub unseen_counts: BTreeMap<&'static str, usize>,
    /// Those of them that are not listed, for there are more than [`MOST_UNSEEN`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unseen_left_out: Option<usize>,
    /// What is in the frame; in the text it is the last.
    #[serde(skip)]
    pub objects: Objects,
}

/// The plan's verdict on one effect.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct EffectLabel {
    /// Its name.
    pub effect: &'static str,
    /// Whether it ran.
    pub run: bool,
    /// Why, or why not.
    pub why: String,
    /// What leaving it out costs at most: e- of a pixel's expectation, or rms where it is random; null where it
    /// ran or is switched off.
    #[serde(serialize_with = "some_bound")]
    pub error_e: Option<f64>,
    /// px that an image or the end of its track is off without it, at most; null where it ran or is switched off.
    #[serde(serialize_with = "some_bound")]
    pub error_px: Option<f64>,
    /// What it is expected to take, ms on one core; null where it did not run.
    #[serde(serialize_with = "some_short")]
    pub price_ms: Option<f64>,
}

impl EffectLabel {
    /// The verdict of one of a plan's steps.
    pub fn new(plan: &Plan<'_>, step: &Step<'_>) -> EffectLabel {
        let (why, error, price_ms) = match &step.verdict {
            Verdict::Off { why } => (*why, None, None),
            Verdict::Skip { why } => (&**why, plan.error(step), None),
            Verdict::Run {
                because, price_ms, ..
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

/// One object in a frame. Its text has no more digits than it is exact to.
#[derive(Debug, Clone, PartialEq, JsonSchema)]
pub struct ObjectLabel {
    /// `star`, `rso`, `moon` or `planet`.
    #[schemars(extend("enum" = [STAR, RSO, SeenWanderer::MOON_KIND, SeenWanderer::PLANET_KIND]))]
    pub kind: &'static str,
    /// `HIP 80351`, `HR n` where there is no HIP, `NORAD 44322`, an OEM's OBJECT_ID, or a name such as `Moon`.
    pub id: String,
    /// Other names.
    pub names: Vec<String>,
    /// Centroid of all its light over the exposure, column.
    pub x_px: f64,
    /// Centroid, row.
    pub y_px: f64,
    /// At the exposure's start.
    pub x0_px: f64,
    /// At the exposure's start.
    pub y0_px: f64,
    /// At the exposure's end.
    pub x1_px: f64,
    /// At the exposure's end.
    pub y1_px: f64,
    /// `(x1 - x0) / exposure`.
    pub vx_px_s: f64,
    /// `(y1 - y0) / exposure`.
    pub vy_px_s: f64,
    /// V; of an RSO by Clark et al. 2021, Eq. (9), in full sunlight, mean over the exposure.
    pub mag: f64,
    /// `-2.5 log10(E / E_zero)` of the light that arrives; null where none does.
    pub band_mag: Option<f64>,
    /// Expected electrons of the whole exposure, on and off the detector.
    pub electrons: f64,
    /// Signal-to-noise ratio on the detector.
    pub snr: f64,
    /// Apparent right ascension of the centre of its light that arrives, ICRF axes, from 0 to below 360.
    pub ra_deg: f64,
    /// Its apparent declination.
    pub dec_deg: f64,
    /// Whether the centroid lies on the detector.
    pub in_frame: bool,
    /// In frame, lit, not occulted, and of a signal-to-noise ratio of at least [`VISIBLE_SNR`].
    pub visible: bool,
    /// Why it is not visible.
    #[schemars(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// What only an RSO has.
    #[schemars(flatten)]
    pub rso: Option<RsoLabel>,
    /// What only the Moon and planets have.
    #[schemars(flatten)]
    pub wanderer: Option<WandererLabel>,
}

/// What a label says of an RSO alone; geometric, at mid-exposure.
#[derive(Debug, Clone, PartialEq, JsonSchema)]
pub struct RsoLabel {
    /// Distance from the observer.
    pub range_km: f64,
    /// Its rate; positive when receding.
    pub range_rate_km_s: f64,
    /// Angle Sun - object - observer.
    pub phase_deg: f64,
    /// Part of the Sun's disc that lights it, 0..1.
    pub illumination: f64,
    /// GCRF.
    pub position_gcrf_km: [f64; 3],
    /// GCRF.
    pub velocity_gcrf_km_s: [f64; 3],
}

impl Label {
    /// The label of `scene`, listing objects whose signal-to-noise ratio, were they neither hidden nor
    /// shaded, is at least `label_snr`.
    pub fn new(frame: u32, scene: &Scene, plan: &Plan<'_>, world: &World, label_snr: f64) -> Label {
        Label::new_in(Vec::new(), frame, scene, plan, world, label_snr)
    }

    /// Likewise, in the memory of an earlier label's objects.
    pub fn new_in(
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
        let centre = StateVector {
            position_m: Vector3::zeros(),
            velocity_m_s: Vector3::zeros(),
        };
        let state = vehicle.orbit.as_ref().unwrap_or(&centre);
        let (r, v) = (km(&state.position_m), km(&state.velocity_m_s));
        let pointing = view.pointing(0.0);
        let matrix = pointing.matrix();
        let [ra, dec, roll] = pointing.ra_dec_roll();
        let flooded_by = flooded_by(scene).map(name_of);
        let spots = spot::spots(scene, label_snr);
        let beyond = scene.particles_left_out;
        let unseen = unseen::listed(scene, world, label_snr);
        // Of those whose number is known each label is made in its place.
        let sources = scene.sources.iter();
        let sources: Vec<&Source> = sources
            .filter(|source| is_listed(source, scene, label_snr))
            .collect();
        let mut objects = memory;
        objects.clear();
        objects.reserve(sources.len());
        let steps = &plan.steps;
        let (effects, ()) = rayon::join(
            || {
                steps
                    .iter()
                    .map(|step| EffectLabel::new(plan, step))
                    .collect()
            },
            || {
                // The label of a cancelled frame is not used.
                let parts = sources.chunks(PART);
                for part in parts.take_while(|_| !view.limit.is_cancelled()) {
                    let part = part.par_iter().with_min_len(TASK);
                    objects.par_extend(part.map(|source| object(source, scene, world)));
                }
            },
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
            state_gcrf_km: [r[0], r[1], r[2], v[0], v[1], v[2]],
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
            fidelity: scene.fidelity().into(),
            overrun: None,
            effects,
            spots_left_out: (spots.left_out > 0).then_some(spots.left_out),
            spots_left_out_snr: spots.left_out_snr,
            particles_left_out: (beyond > 0.0).then_some(beyond),
            unseen: unseen.ids,
            unseen_counts: unseen.counts,
            unseen_left_out: (unseen.left_out > 0).then_some(unseen.left_out),
            objects: Objects {
                sources: objects,
                spots: spots.listed,
            },
        }
    }

    /// The text that travels on the wire; `labels.jsonl` adds the frame's files to it.
    pub fn to_json(&self) -> String {
        self.to_json_in(String::new())
    }

    /// Likewise, in the memory of an earlier text.
    pub fn to_json_in(&self, memory: String) -> String {
        let mut text = memory.into_bytes();
        text.clear();
        text.reserve(4096 + OCTETS * self.objects.len());
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

/// Whether labels list a source as an object.
fn is_listed(source: &Source, scene: &Scene, label_snr: f64) -> bool {
    source.clear_snr >= label_snr || scene.fills_all(source)
}

fn object(source: &Source, scene: &Scene, world: &World) -> ObjectLabel {
    let [x_px, y_px] = source.centroid;
    let ([x0_px, y0_px], [x1_px, y1_px]) = (source.start, source.end);
    let exposure_s = scene.view.exposure.duration_s;
    let rate = |a: f64, b: f64| {
        if exposure_s > 0.0 {
            (b - a) / exposure_s
        } else {
            0.0
        }
    };
    let (kind, id, names, mag, direction, rso) = match &source.body {
        Body::Star(seen) => {
            let catalog = world.stars.catalog();
            let star = &catalog.stars()[seen.index];
            (
                STAR,
                catalog.id(star),
                catalog.names(star),
                star.v_mag,
                seen.direction,
                None,
            )
        }
        Body::Rso(seen) => {
            let object = &world.population.objects()[seen.index];
            let (id, names) = (object.id.clone(), object.names.clone());
            (
                RSO,
                id,
                names,
                seen.mag,
                seen.apparent.direction,
                Some(rso_label(seen)),
            )
        }
        Body::Wanderer(seen) => (
            seen.kind(),
            seen.name.to_string(),
            Vec::new(),
            seen.mag,
            seen.directions[1],
            None,
        ),
    };
    let wanderer = match &source.body {
        Body::Wanderer(seen) => Some(WandererLabel::new(seen, source, scene)),
        Body::Star(_) | Body::Rso(_) => None,
    };
    let [ra_deg, dec_deg] = ra_dec_deg(&direction);
    let in_frame = scene.view.camera.detector.contains([x_px, y_px]);
    let reason = visible::why_not_visible(source, scene, in_frame);
    let irradiance =
        source.arriving_e / (scene.view.camera.electrons_per_second_at_zero() * exposure_s);
    ObjectLabel {
        kind,
        id,
        names,
        x_px,
        y_px,
        x0_px,
        y0_px,
        x1_px,
        y1_px,
        vx_px_s: rate(x0_px, x1_px),
        vy_px_s: rate(y0_px, y1_px),
        mag,
        band_mag: (irradiance > 0.0).then(|| -2.5 * libm::log10(irradiance)),
        electrons: source.electrons,
        snr: source.snr,
        ra_deg,
        dec_deg,
        in_frame,
        visible: reason.is_none(),
        reason,
        rso,
        wanderer,
    }
}

fn rso_label(seen: &SeenObject) -> RsoLabel {
    let state = &seen.apparent.state;
    RsoLabel {
        range_km: seen.apparent.range_m * 1e-3,
        range_rate_km_s: seen.apparent.range_rate_m_s * 1e-3,
        phase_deg: seen.phase.to_degrees(),
        illumination: seen.illumination,
        position_gcrf_km: km(&state.position_m),
        velocity_gcrf_km_s: km(&state.velocity_m_s),
    }
}

/// Right ascension (from 0 to below 360) and declination of a direction, deg.
fn ra_dec_deg(direction: &Vector3<f64>) -> [f64; 2] {
    let dec = libm::atan2(direction.z, libm::hypot(direction.x, direction.y));
    let ra = libm::atan2(direction.y, direction.x);
    [degrees_of_turn(ra), dec.to_degrees()]
}

fn km(v: &Vector3<f64>) -> [f64; 3] {
    (v * 1e-3).into()
}
