//! The run's configuration: what `skyloop run --config` and `skyloop render --scene` read.

mod fidelity;
mod heads;
mod objects;
mod run;
mod shapes;

use crate::attitude::Attitude;
use crate::camera::Camera;
use crate::effect::EFFECTS;
use crate::fidelity::{Choice, Fidelity};
use crate::load::{
    Check, ConfigError, DEFAULT_SCENE, Fixed, Folder, RawTime, advice, orbits, parse,
};
use crate::sky::Corrections;
use crate::sky::catalog::Selection;
use crate::sky::photometry::Sphere;
use crate::sky::population::{Looks, Population};
use fidelity::RawFidelity;
pub use heads::Head;
use heads::RawHead;
use hifitime::Epoch;
use objects::{Objects, RawObjects};
use run::RawRun;
pub use run::{Clock, Delay, OnOverrun, OnStale, OutOfOrder, Run, Staleness, Trigger};
use serde::Deserialize;
use skyloop_orbit::aem;
use skyloop_orbit::time::parse_utc;
use skyloop_orbit::{Object, StateVector};
use std::path::Path;

/// A validated configuration.
#[derive(Debug)]
pub struct Config {
    /// Seed of all noise.
    pub seed: u64,
    /// The camera.
    pub camera: Camera,
    /// Error tolerances.
    pub fidelity: Fidelity,
    /// Which effects may run.
    pub choice: Choice,
    /// The faintest object that labels list, as signal-to-noise ratio.
    pub label_snr: f64,
    /// Which stars, and what moves and colours them.
    pub sky: Sky,
    /// Resident space objects.
    pub objects: Vec<Object>,
    /// Records of the object files that were refused, one line each.
    pub rejected: Vec<String>,
    /// What was passed over of the object files, one line each.
    pub notices: Vec<String>,
    /// What an object reflects where nothing is known of it.
    pub sphere: Sphere,
    /// What is known of others.
    pub looks: Looks,
    /// The observer's own orbit, for runs that make their own attitudes.
    pub observer: Option<Observer>,
    /// The exposures of an offline run.
    pub sequence: Option<Sequence>,
    /// How a live run listens and keeps time.
    pub run: Run,
    /// Further cameras of the same vehicle, in a live run.
    pub heads: Vec<Head>,
}

/// Where a run's observer is.
#[derive(Debug, Clone)]
pub enum Observer {
    /// On the orbit of an object.
    Object(Box<Object>),
    /// At this state (GCRF) in the middle of the first exposure, carried on by two-body motion and J2.
    State(StateVector),
}

/// The stars and what is done to their directions.
#[derive(Debug, Clone)]
pub struct Sky {
    /// Which part of the catalogue.
    pub selection: Selection,
    /// Corrections from catalogue to apparent place.
    pub corrections: Corrections,
    /// Whether stars carry their colour into the band (else the band magnitude is V).
    pub colour: bool,
}

/// The exposures of an offline run and the attitudes they are made with.
#[derive(Debug, Clone)]
pub struct Sequence {
    /// Middle of the first exposure.
    pub epoch: Epoch,
    /// Exposures.
    pub frames: u32,
    /// From one exposure's middle to the next, s.
    pub period_s: f64,
    /// Slerp between them; of several, the exposures must lie within their span. Without any, which no file can have: +Z to the Earth's
    /// centre, +X towards the velocity.
    pub attitudes: Vec<TimedAttitude>,
    /// A file of attitudes instead.
    pub attitude_file: Option<AttitudeFile>,
    /// Body rates (rad/s) of a single attitude.
    pub rates: [f64; 3],
}

/// A file of attitudes: a CCSDS AEM, or lines `UTC x y z w`.
#[derive(Debug, Clone)]
pub struct AttitudeFile {
    /// As messages name it.
    pub name: String,
    /// What it holds.
    pub text: String,
}

/// An attitude at an instant.
#[derive(Debug, Clone, Copy)]
pub struct TimedAttitude {
    /// When.
    pub epoch: Epoch,
    /// ICRF to body.
    pub attitude: Attitude,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    #[serde(default = "one")]
    seed: u64,
    #[serde(default = "default_camera")]
    camera: String,
    #[serde(default)]
    fidelity: RawFidelity,
    #[serde(default = "default_label_snr")]
    label_snr: f64,
    #[serde(default)]
    effects: RawEffects,
    #[serde(default)]
    sky: RawSky,
    #[serde(default)]
    objects: RawObjects,
    #[serde(default)]
    observer: RawObserver,
    sequence: Option<RawSequence>,
    #[serde(default)]
    run: RawRun,
    #[serde(default)]
    heads: Vec<RawHead>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct RawEffects {
    off: Vec<String>,
    all: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawSky {
    catalog: String,
    colour: bool,
    proper_motion: bool,
    parallax: bool,
    deflection: bool,
    aberration: bool,
    light_time: bool,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct RawObserver {
    orbit: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSequence {
    epoch: RawTime,
    frames: u32,
    period_s: f64,
    #[serde(default)]
    attitudes: Vec<RawAttitude>,
    attitude_file: Option<String>,
    rates_deg_s: Option<Fixed<f64, 3>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawAttitude {
    utc: Option<RawTime>,
    q: Fixed<f64, 4>,
}

fn one() -> u64 {
    1
}

fn default_camera() -> String {
    "fai-nir".to_string()
}

fn default_label_snr() -> f64 {
    1.0
}

impl Default for RawSky {
    fn default() -> Self {
        RawSky {
            catalog: "hipparcos".to_string(),
            colour: true,
            proper_motion: true,
            parallax: true,
            deflection: true,
            aberration: true,
            light_time: true,
        }
    }
}

impl Config {
    /// Reads a file, of a folder its `scene.toml`; names in it are relative to its folder.
    pub fn load(path: &Path) -> Result<Config, ConfigError> {
        let (folder, file, text) = Folder::open(path)?;
        Config::parse(&file, &text, &folder)
    }

    /// The built-in scene: FAI on CASSIOPE, 15 June 2019.
    pub fn builtin() -> Result<Config, ConfigError> {
        Config::read(&Folder::Embedded(DEFAULT_SCENE.0), DEFAULT_SCENE.1)
    }

    /// Everything at its default: no objects, no sequence.
    pub fn defaults() -> Result<Config, ConfigError> {
        Config::parse("defaults", "", &Folder::current())
    }

    /// Reads file `name` of `folder`.
    pub fn read(folder: &Folder, name: &str) -> Result<Config, ConfigError> {
        let (file, text) = folder.read(name)?;
        Config::parse(&file, &text, folder)
    }

    /// The objects and what they look like; takes them out of the configuration.
    pub fn take_population(&mut self) -> Population {
        let objects = std::mem::take(&mut self.objects);
        Population::new(objects, self.sphere, std::mem::take(&mut self.looks))
    }

    /// From text; `file` is its name in messages.
    pub fn parse(file: &str, text: &str, folder: &Folder) -> Result<Config, ConfigError> {
        let raw: Raw = parse(file, text)?;
        let check = Check { file };
        let Objects {
            objects,
            looks,
            mut findings,
            sphere,
        } = raw.objects.validate(&check, folder)?;
        let observer = match &raw.observer.orbit {
            None => None,
            Some(selector) => {
                let object = orbits::one(folder, selector, &mut findings);
                let object = object.map_err(|error| check.explain("observer.orbit", error))?;
                Some(Observer::Object(Box::new(object)))
            }
        };
        let camera = Camera::load(&raw.camera, folder);
        let camera = camera.map_err(|error| check.named("camera", error))?;
        let fidelity = raw.fidelity.validate(&check)?;
        let sequence = raw.sequence.map(|s| s.validate(&check, folder));
        let sequence = sequence.transpose()?;
        let attitude_file = sequence.as_ref().and_then(|s| s.attitude_file.as_ref());
        let remarks = attitude_file.map(AttitudeFile::remarks);
        findings.notices.extend(remarks.unwrap_or_default());
        Ok(Config {
            seed: raw.seed,
            heads: heads::validate(raw.heads, &camera, &check, folder)?,
            camera,
            fidelity,
            choice: raw.effects.validate(&check)?,
            label_snr: check.range("label_snr", raw.label_snr, 0.0..=1e9)?,
            sky: raw.sky.validate(&check)?,
            objects,
            rejected: findings.rejected,
            notices: findings.notices,
            sphere,
            looks,
            observer,
            sequence,
            run: raw.run.validate(&check)?,
        })
    }
}

/// Effects without which there would be no digits.
const ALWAYS_ON: &[&str] = &["readout"];

impl RawEffects {
    fn validate(self, check: &Check) -> Result<Choice, ConfigError> {
        let mut off = Vec::new();
        for (i, name) in self.off.iter().enumerate() {
            let (key, given) = (format!("effects.off[{i}]"), format!("{name:?}"));
            let can = EFFECTS.iter().map(|effect| effect.name);
            let can: Vec<&str> = can.filter(|name| !ALWAYS_ON.contains(name)).collect();
            match can.iter().find(|known| *known == name) {
                Some(known) => off.push(*known),
                None if ALWAYS_ON.contains(&name.as_str()) => {
                    let reason = format!(
                        "{given} cannot be switched off; these can: {}",
                        can.join(", ")
                    );
                    return Err(check.explain(&key, reason));
                }
                None => {
                    let allowed = format!("one of the effects{}", advice(name, &can));
                    return Err(check.refuse(&key, given, allowed));
                }
            }
        }
        Ok(Choice {
            noise: true,
            off,
            all: self.all,
        })
    }
}

impl RawSky {
    fn validate(self, check: &Check) -> Result<Sky, ConfigError> {
        let selection = match self.catalog.as_str() {
            "hipparcos" => Selection::Hipparcos,
            "bsc" => Selection::Bsc,
            other => {
                return Err(check.refuse(
                    "sky.catalog",
                    format!("{other:?}"),
                    "\"hipparcos\" or \"bsc\"",
                ));
            }
        };
        let corrections = Corrections {
            proper_motion: self.proper_motion,
            parallax: self.parallax,
            deflection: self.deflection,
            aberration: self.aberration,
            light_time: self.light_time,
        };
        Ok(Sky {
            selection,
            corrections,
            colour: self.colour,
        })
    }
}

impl AttitudeFile {
    /// What of it is not used, or was assumed: a line each. What is wrong with it shows when it is flown.
    fn remarks(&self) -> Vec<String> {
        let Some(Ok(message)) = aem::is_message(&self.text).then(|| aem::parse(&self.text)) else {
            return Vec::new();
        };
        let remarks = message.remarks.iter();
        let shown = remarks.map(|(line, remark)| format!("{}:{line}: {remark}", self.name));
        shown.collect()
    }
}

impl RawSequence {
    fn validate(self, check: &Check, folder: &Folder) -> Result<Sequence, ConfigError> {
        let attitude_file = attitude_file(&self, check, folder)?;
        let epoch = utc(check, "sequence.epoch", &self.epoch)?;
        let mut attitudes = Vec::new();
        for (i, raw) in self.attitudes.iter().enumerate() {
            let key = format!("sequence.attitudes[{i}]");
            attitudes.push(TimedAttitude {
                epoch: match &raw.utc {
                    Some(time) => utc(check, &format!("{key}.utc"), time)?,
                    None if self.attitudes.len() == 1 => epoch,
                    None => {
                        let reason = "no utc; each of several attitudes needs one";
                        return Err(check.explain(&key, reason));
                    }
                },
                attitude: Attitude::from_xyzw(raw.q.0)
                    .map_err(|error| check.explain(&format!("{key}.q"), error))?,
            });
        }
        if attitudes.is_empty() && attitude_file.is_none() {
            return Err(check.refuse(
                "sequence.attitudes",
                "[]",
                "at least one { utc, q = [x, y, z, w] }, or sequence.attitude_file given",
            ));
        }
        if attitudes.windows(2).any(|w| w[1].epoch <= w[0].epoch) {
            let reason =
                "the utc of an attitude is not after that of the one before it: sort them by time";
            return Err(check.explain("sequence.attitudes", reason));
        }
        let rates = self.rates_deg_s.map_or([0.0; 3], |Fixed(rates)| rates);
        if attitudes.len() > 1 && rates != [0.0; 3] {
            let reason =
                "given beside several attitudes, whose slerp has its own rates: leave it out";
            return Err(check.explain("sequence.rates_deg_s", reason));
        }
        let rates = check.each("sequence.rates_deg_s", rates, -36000.0..=36000.0)?;
        Ok(Sequence {
            epoch,
            frames: check.range("sequence.frames", f64::from(self.frames), 1.0..=1e6)? as u32,
            period_s: check.range("sequence.period_s", self.period_s, 1e-6..=1e6)?,
            attitudes,
            attitude_file,
            rates: rates.map(f64::to_radians),
        })
    }
}

/// The file that a sequence names for its attitudes.
fn attitude_file(
    raw: &RawSequence,
    check: &Check,
    folder: &Folder,
) -> Result<Option<AttitudeFile>, ConfigError> {
    let (key, Some(file)) = ("sequence.attitude_file", &raw.attitude_file) else {
        return Ok(None);
    };
    if !raw.attitudes.is_empty() || raw.rates_deg_s.is_some() {
        let reason = "given beside sequence.attitudes or rates_deg_s: keep one of them";
        return Err(check.explain(key, reason));
    }
    let read = folder
        .read(file)
        .map_err(|error| check.explain(key, error))?;
    let (name, text) = read;
    Ok(Some(AttitudeFile { name, text }))
}

fn utc(check: &Check, key: &str, time: &RawTime) -> Result<Epoch, ConfigError> {
    let text = time.to_string();
    parse_utc(&text).map_err(|why| check.explain(key, why))
}
