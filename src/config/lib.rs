//! Configuration of a run, from the files of `skyloop run --config` and `skyloop render --scene`.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod fidelity;
pub mod flight;
mod heads;
mod look_at;
mod objects;
mod realtime;
mod run;
mod sequence;
mod shapes;

use fidelity::RawFidelity;
pub use heads::Head;
use heads::RawHead;
pub use look_at::{LookAt, Target, Up};
use nalgebra::Vector3;
use objects::{Objects, RawObjects};
pub use realtime::Requested;
use run::RawRun;
pub use run::metrics_address;
pub use run::{Clock, Delay, OnOverrun, OnStale, OutOfOrder, Run, Staleness, Trigger};
use schemars::JsonSchema;
use sequence::RawSequence;
pub use sequence::{AttitudeFile, Sequence, TimedAttitude, attitude_of_radec};
use serde::Deserialize;
use skyloop_base::load::{
    Allowed, Check, ConfigError, DEFAULT_SCENE, Fixed, Folder, Limit, advice, one_of, orbits, read,
    schema_of, some_table, table, tables,
};
use skyloop_orbit::{Object, StateVector};
use skyloop_render::attitude::{MAX_POSITION, MAX_SPEED, MIN_POSITION, check_orbit};
use skyloop_render::camera::Camera;
use skyloop_render::effect::EFFECTS;
use skyloop_render::engine::{Setup, Sky};
use skyloop_render::fidelity::{Choice, Fidelity};
use skyloop_render::sky::Corrections;
use skyloop_render::sky::catalog::Selection;
use skyloop_render::sky::photometry::Sphere;
use skyloop_render::sky::population::{Appearances, Population};
use std::path::Path;
use std::sync::Arc;

/// A validated configuration.
#[derive(Debug)]
pub struct Config {
    /// Seed of all noise.
    pub seed: u64,
    /// The camera.
    pub camera: Camera,
    /// Error tolerances.
    pub fidelity: Fidelity,
    /// Selection of effects.
    pub choice: Choice,
    /// Smallest signal-to-noise ratio of labelled objects.
    pub label_snr: f64,
    /// Star catalogue, and corrections of direction and colour.
    pub sky: Sky,
    /// Resident space objects.
    pub objects: Vec<Object>,
    /// Records of the object files that were refused, one line each.
    pub rejected: Vec<String>,
    /// Skipped entries of object files, one line each.
    pub notices: Vec<String>,
    /// The default sphere of objects.
    pub sphere: Sphere,
    /// Shapes and spheres of other objects.
    pub looks: Appearances,
    /// The observer's orbit, for runs that make their own attitudes.
    pub observer: Option<Observer>,
    /// The exposures of an offline run.
    pub sequence: Option<Sequence>,
    /// Links, clock and limits of a live run.
    pub run: Run,
    /// Further cameras of the same vehicle, in a live run.
    pub cameras: Vec<Head>,
}

/// The orbit of the observer.
#[derive(Debug, Clone)]
pub enum Observer {
    /// On the orbit of an object.
    Object(Box<Object>),
    /// This state (GCRF) in the middle of the first exposure, propagated by two-body motion and J2.
    State(StateVector),
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Raw {
    /// Seed of all noise; the same seed and inputs give the same pixels
    #[serde(default = "one")]
    seed: u64,
    /// Camera: fai-nir, fai-630, rigel-l, cots-wide, cmos-rolling, ccd-transfer, all-sky, horizon,
    /// or a camera file
    #[serde(default = "default_camera")]
    camera: String,
    /// Error tolerances of the renderer: a preset such as `fidelity = "fast"`, or a table of a
    /// preset and the keys that differ from it
    #[serde(default)]
    fidelity: RawFidelity,
    /// Least signal-to-noise ratio of labelled objects
    #[serde(default = "default_label_snr")]
    label_snr: f64,
    /// Selection of effects. By default each effect runs where the scene needs it; `skyloop plan
    /// --scene FILE` shows which, and why
    #[serde(default, deserialize_with = "table")]
    effects: RawEffects,
    /// Star catalogue, and corrections of direction and colour.
    #[serde(default, deserialize_with = "table")]
    sky: RawSky,
    /// Objects in orbit.
    #[serde(default, deserialize_with = "table")]
    objects: RawObjects,
    /// Orbit of the observer in runs that make their own attitudes.
    #[serde(default, deserialize_with = "table")]
    observer: RawObserver,
    /// The exposures of runs that make their own attitudes
    #[serde(default, deserialize_with = "some_table")]
    sequence: Option<RawSequence>,
    /// Links, clock and limits of a live run.
    #[serde(default, deserialize_with = "table")]
    run: RawRun,
    /// Further cameras on the same vehicle, for `run` and `soak`
    #[serde(default, deserialize_with = "tables")]
    heads: Vec<RawHead>,
}

#[derive(Deserialize, Default, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct RawEffects {
    /// Effects that never run, such as ["zodiacal light", "starlight"]; `skyloop plan` shows the
    /// error that this causes
    off: Vec<String>,
    /// All other effects run, needed or not; frames are the same within the tolerances, but slower
    all: bool,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct RawSky {
    /// hipparcos: to magnitude Hp 9; bsc: only stars of the Bright Star Catalogue, 9 times fewer
    catalog: String,
    /// Band magnitude from the colour of a star; without it V, an error of up to 3 mag
    colour: bool,
    /// Proper motion from the catalogue epoch J1991.25; without it an error of up to 5 arcmin
    /// (Barnard's star)
    proper_motion: bool,
    /// Annual parallax; without it an error of up to 0.77 arcsec
    parallax: bool,
    /// Light deflection by the Sun; without it an error of 1.75 arcsec at its limb, 0.004 at 90 deg
    deflection: bool,
    /// Aberration of stars and objects; without it an error of up to 26 arcsec
    aberration: bool,
    /// Light time of objects; without it an error of up to 7 arcsec
    light_time: bool,
}

#[derive(Deserialize, Default, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RawObserver {
    /// Orbit of the observer: "FILE:NAME", or "FILE" with one object; without orbit and state the
    /// observer is at the Earth's centre
    orbit: Option<String>,
    /// Instead of orbit: position and velocity (km, km/s; GCRF) at the first exposure, propagated
    /// by two-body motion with J2
    state: Option<Fixed<f64, 6>>,
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
    /// Reads a file, or the `scene.toml` of a folder. File names in it are relative to its folder.
    pub fn load(path: &Path) -> Result<Config, ConfigError> {
        let (folder, file, text) = Folder::open(path)?;
        Config::parse(&file, &text, &folder)
    }

    /// The built-in scene: FAI on CASSIOPE, 15 June 2019.
    pub fn builtin() -> Result<Config, ConfigError> {
        Config::read(&Folder::Embedded(DEFAULT_SCENE.0), DEFAULT_SCENE.1)
    }

    /// The default configuration: no objects, no sequence.
    pub fn defaults() -> Result<Config, ConfigError> {
        Config::parse("defaults", "", &Folder::current())
    }

    /// The JSON Schema of scene and run files, which have the same keys.
    pub fn schema(title: &str) -> schemars::Schema {
        schema_of::<Raw>(title, LIMITS)
    }

    /// The JSON Schema of population files.
    pub fn population_schema() -> schemars::Schema {
        objects::schema()
    }

    /// Reads file `name` of `folder`.
    pub fn read(folder: &Folder, name: &str) -> Result<Config, ConfigError> {
        let (file, text) = folder.read(name)?;
        Config::parse(&file, &text, folder)
    }

    /// Takes the objects, with their shapes, out of the configuration.
    pub fn take_population(&mut self) -> Population {
        let objects = std::mem::take(&mut self.objects);
        Population::new(objects, self.sphere, std::mem::take(&mut self.looks))
    }

    /// The input of the emulator; takes the objects out of the configuration.
    pub(crate) fn setup(&mut self) -> Setup {
        Setup {
            camera: self.camera.clone(),
            fidelity: self.fidelity,
            choice: self.choice.clone(),
            seed: self.seed,
            label_snr: self.label_snr,
            sky: self.sky,
            population: Arc::new(self.take_population()),
            rejected_records: self.rejected.len() as u32,
        }
    }

    /// Parses a text; `file` is its name in messages.
    pub fn parse(file: &str, text: &str, folder: &Folder) -> Result<Config, ConfigError> {
        read(file, text, EXAMPLE, LIMITS, |raw: Raw, check| {
            raw.validate(check, folder)
        })
    }
}

impl From<&mut Config> for Setup {
    fn from(config: &mut Config) -> Setup {
        config.setup()
    }
}

/// A valid file with all required keys.
const EXAMPLE: &str = r#"
heads = [{ name = "B", camera = "fai-nir", link = "udp://127.0.0.1:4811" }]
[sequence]
epoch = "2026-01-01T00:00:00Z"
frames = 1
period_s = 1.0
nadir = true
[spare.sequence]
attitudes = [{ utc = "2026-01-01T00:00:00Z", q = [0.0, 0.0, 0.0, 1.0] }]
"#;

impl Raw {
    fn validate(self, check: &Check, folder: &Folder) -> Result<Config, ConfigError> {
        let raw = self;
        let Objects {
            objects,
            looks,
            mut findings,
            sphere,
        } = raw.objects.validate(check, folder)?;
        let observer = raw.observer.validate(check, folder, &mut findings)?;
        let camera = Camera::load(&raw.camera, folder);
        let camera = camera.map_err(|error| check.named("camera", error))?;
        let fidelity = raw.fidelity.validate(check)?;
        let sequence = raw.sequence;
        let sequence = sequence.map(|s| s.validate(&camera, &objects, check, folder));
        let sequence = sequence.transpose()?;
        let attitude_file = sequence.as_ref().and_then(|s| s.attitude_file.as_ref());
        let remarks = attitude_file.map(AttitudeFile::remarks);
        findings.notices.extend(remarks.unwrap_or_default());
        Ok(Config {
            seed: raw.seed,
            cameras: heads::validate(raw.heads, &camera, check, folder)?,
            camera,
            fidelity,
            choice: raw.effects.validate(check)?,
            label_snr: check.limit(OWN_LIMITS, "label_snr", raw.label_snr)?,
            sky: raw.sky.validate(check)?,
            objects,
            rejected: findings.rejected,
            notices: findings.notices,
            sphere,
            looks,
            observer,
            sequence,
            run: raw.run.validate(check)?,
        })
    }
}

/// Effects that cannot be switched off, since they make the pixel values.
const ALWAYS_ON: &[&str] = &["readout"];

fn can_be_off() -> Vec<&'static str> {
    let names = EFFECTS.iter().map(|effect| effect.name);
    names.filter(|name| !ALWAYS_ON.contains(name)).collect()
}

/// Parts of the star catalogue by name.
const CATALOGS: [(&str, Selection); 2] =
    [("hipparcos", Selection::Hipparcos), ("bsc", Selection::Bsc)];

fn catalogs() -> Vec<&'static str> {
    CATALOGS.map(|(name, _)| name).to_vec()
}

const OWN_LIMITS: &[Limit] = &[
    ("label_snr", Allowed::Number(0.0..=1e9)),
    ("effects.off[]", Allowed::Word(can_be_off)),
    ("sky.catalog", Allowed::Word(catalogs)),
    ("observer", Allowed::NotBoth(["state", "orbit"])),
];

const LIMITS: &[&[Limit]] = &[
    OWN_LIMITS,
    heads::LIMITS,
    run::LIMITS,
    sequence::LIMITS,
    shapes::SCENE_LIMITS,
];

impl RawEffects {
    fn validate(self, check: &Check) -> Result<Choice, ConfigError> {
        let mut off = Vec::new();
        for (i, name) in self.off.iter().enumerate() {
            let (key, given) = (format!("effects.off[{i}]"), format!("{name:?}"));
            let can = can_be_off();
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
        let found = CATALOGS.iter().find(|(name, _)| *name == self.catalog);
        let Some((_, selection)) = found else {
            let given = format!("{:?}", self.catalog);
            return Err(check.refuse("sky.catalog", given, one_of(&catalogs())));
        };
        let corrections = Corrections {
            proper_motion: self.proper_motion,
            parallax: self.parallax,
            deflection: self.deflection,
            aberration: self.aberration,
            light_time: self.light_time,
        };
        Ok(Sky {
            selection: *selection,
            corrections,
            colour: self.colour,
        })
    }
}

impl RawObserver {
    fn validate(
        &self,
        check: &Check,
        folder: &Folder,
        findings: &mut orbits::Findings,
    ) -> Result<Option<Observer>, ConfigError> {
        match (&self.orbit, self.state) {
            (None, None) => Ok(None),
            (Some(selector), _) => {
                let object = orbits::one(folder, selector, findings);
                let object = object.map_err(|error| check.explain("observer.orbit", error))?;
                Ok(Some(Observer::Object(Box::new(object))))
            }
            (None, Some(Fixed(state))) => match Observer::at_km(state) {
                Ok(observer) => Ok(Some(observer)),
                Err(why) => Err(check.explain("observer.state", why)),
            },
        }
    }
}

impl Observer {
    /// A state in km and km/s, GCRF.
    pub fn at_km([x, y, z, vx, vy, vz]: [f64; 6]) -> Result<Observer, String> {
        let state = StateVector {
            position_m: Vector3::new(x, y, z) * 1e3,
            velocity_m_s: Vector3::new(vx, vy, vz) * 1e3,
        };
        if check_orbit(&state).is_err() {
            return Err(format!(
                "{x},{y},{z},{vx},{vy},{vz}: {:.1} km from the Earth's centre at {:.3} km/s: must be {} to {} km from there, at most \
                 {} km/s; it is in km and km/s (GCRF)",
                state.position_m.norm() * 1e-3,
                state.velocity_m_s.norm() * 1e-3,
                MIN_POSITION * 1e-3,
                MAX_POSITION * 1e-3,
                MAX_SPEED * 1e-3,
            ));
        }
        Ok(Observer::State(state))
    }
}

#[cfg(test)]
mod tests;
