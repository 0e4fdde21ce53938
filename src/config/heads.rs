//! Further cameras of the same vehicle: the tables `[[heads]]`.

use super::run::{OneOrMore, link_form};
use schemars::JsonSchema;
use serde::Deserialize;
use skyloop_base::load::Allowed::{Count, Form, Number};
use skyloop_base::load::{Check, ConfigError, Folder, Limit};
use skyloop_render::camera::{Camera, RATE_HZ};

/// A further camera with its own links. Mounting and misalignment are those of its camera file.
#[derive(Debug)]
pub struct Head {
    /// Its name.
    pub name: String,
    /// The camera.
    pub camera: Camera,
    /// Whether its rate differs from that of its camera file.
    pub has_own_rate: bool,
    /// URLs of the links for its frames. None has the role truth, which is the first camera's.
    pub links: Vec<String>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawHead {
    /// Name of the camera in tables and verdicts
    name: String,
    /// Built-in camera or camera file, with its own mounting and misalignment
    camera: String,
    /// Frame rate, Hz; default: that of the camera file
    rate_hz: Option<f64>,
    /// Link for its frames, or a list of links; attitudes come over the links of the first camera
    link: OneOrMore,
}

pub(super) const LIMITS: &[Limit] = &[
    ("heads[].rate_hz", Number(RATE_HZ)),
    ("heads[].link", Count(1..=usize::MAX)),
    ("heads[].link", Form(link_form)),
    ("heads[].link[]", Form(link_form)),
];

impl RawHead {
    fn validate(self, at: usize, check: &Check, folder: &Folder) -> Result<Head, ConfigError> {
        let key = |name: &str| format!("heads[{at}].{name}");
        let camera = Camera::load(&self.camera, folder);
        let mut camera = camera.map_err(|error| check.named(&key("camera"), error))?;
        if let Some(rate_hz) = self.rate_hz {
            camera.rate_hz = check.limit(LIMITS, &key("rate_hz"), rate_hz)?;
            let max = 1.0 / camera.period_s(camera.exposure_s);
            if camera.rate_hz > max {
                let allowed = format!("at most {max} Hz, or exposures of its camera would overlap");
                let error = check.refuse(&key("rate_hz"), rate_hz.to_string(), allowed);
                return Err(error.needs(&[&key("camera")]));
            }
        }
        if self.name.trim().is_empty() {
            let allowed = "a name, which its figures and verdicts have";
            return Err(check.refuse(&key("name"), format!("{:?}", self.name), allowed));
        }
        Ok(Head {
            name: self.name,
            camera,
            has_own_rate: self.rate_hz.is_some(),
            links: self.link.validate(&key("link"), check)?,
        })
    }
}

/// The further cameras; all names differ, also from that of the first `camera`.
pub(super) fn validate(
    raw: Vec<RawHead>,
    camera: &Camera,
    check: &Check,
    folder: &Folder,
) -> Result<Vec<Head>, ConfigError> {
    let cameras = raw.into_iter().enumerate();
    let cameras: Vec<Head> = cameras
        .map(|(at, head)| head.validate(at, check, folder))
        .collect::<Result<_, _>>()?;
    for (at, head) in cameras.iter().enumerate() {
        let mut others = cameras.iter().take(at);
        let other = others.position(|other| other.name == head.name);
        if head.name == camera.name || other.is_some() {
            let key = format!("heads[{at}].name");
            let allowed = "a name that no other camera has";
            let error = check.refuse(&key, format!("{:?}", head.name), allowed);
            let other = other.map(|other| format!("heads[{other}].name"));
            return Err(error.needs(&[other.as_deref().unwrap_or("camera")]));
        }
    }
    Ok(cameras)
}
