//! `[sequence]`: exposures and pointing of an offline run.

use super::look_at::{DEC_DEG, LookAt, RawTarget, TURN_DEG, Up};
use hifitime::Epoch;
use schemars::JsonSchema;
use serde::Deserialize;
use skyloop_base::load::Allowed::{EachOfSeveral, Needs, NotBoth, NotWithSeveral, Number, OneOf};
use skyloop_base::load::{Check, ConfigError, Fixed, Folder, Limit, RawTime, some_word, tables};
use skyloop_orbit::time::seconds;
use skyloop_orbit::{LARGEST_TABLE, Object, aem};
use skyloop_render::attitude::Attitude;
use skyloop_render::camera::Camera;
use skyloop_render::sky::bodies::Bodies;

/// The exposures of an offline run, and their attitudes.
#[derive(Debug, Clone)]
pub struct Sequence {
    /// Middle of the first exposure.
    pub epoch: Epoch,
    /// Number of exposures.
    pub frames: u32,
    /// Time between the middles of exposures, s.
    pub period_s: f64,
    /// Attitudes for slerp; exposures must lie within the span of several. Without any: +Z to the
    /// Earth's centre and +X along the velocity, or `look_at`.
    pub attitudes: Vec<TimedAttitude>,
    /// Target that the camera follows, instead of attitudes.
    pub look_at: Option<LookAt>,
    /// A file of attitudes, instead of attitudes.
    pub attitude_file: Option<AttitudeFile>,
    /// Body rates (rad/s) of a single attitude.
    pub rates: [f64; 3],
}

/// A file of attitudes: a CCSDS AEM, or lines `UTC x y z w`.
#[derive(Debug, Clone)]
pub struct AttitudeFile {
    /// Name in messages.
    pub name: String,
    /// Contents.
    pub text: String,
}

/// An attitude at an instant.
#[derive(Debug, Clone, Copy)]
pub struct TimedAttitude {
    /// Time of the attitude.
    pub epoch: Epoch,
    /// ICRF to body.
    pub attitude: Attitude,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSequence {
    /// Middle of the first exposure, UTC
    epoch: RawTime,
    /// Number of exposures
    frames: u32,
    /// Time between the middles of exposures, s
    period_s: f64,
    /// Attitudes, interpolated by slerp
    #[serde(default, deserialize_with = "tables")]
    attitudes: Vec<RawAttitude>,
    /// Instead of attitudes: an attitude file, a CCSDS AEM (KVN) or lines `UTC x y z w`
    attitude_file: Option<String>,
    /// Instead of attitudes: right ascension and declination of the boresight and position angle of
    /// image up (-Y), deg, ICRF
    radec: Option<Fixed<f64, 3>>,
    /// Instead of attitudes: body +Z to the Earth's centre, +X towards the velocity
    #[serde(default)]
    #[expect(dead_code, reason = "rules between keys read it")]
    nadir: bool,
    /// Instead of attitudes: target that the boresight follows: "Sun", "Moon", a planet, name or
    /// number of an object, "limb:HEIGHT_KM,AZIMUTH_DEG", "velocity", or [ra, dec] in deg
    look_at: Option<RawTarget>,
    /// Reference direction for image up (-Y) with look_at; default: north; zenith for limb and
    /// velocity
    #[serde(default, deserialize_with = "some_word")]
    up: Option<Up>,
    /// Position angle of -Y from up, in the sense from north through east, deg; default: 0
    roll_deg: Option<f64>,
    /// Body rates of a single attitude, deg/s, body axes
    rates_deg_s: Option<Fixed<f64, 3>>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RawAttitude {
    /// Time of the attitude; required for each of several attitudes
    utc: Option<RawTime>,
    /// Unit quaternion [x, y, z, w] from ICRF to body
    q: Fixed<f64, 4>,
}

/// The keys that give the pointing, with their forms.
const POINTINGS: [(&str, &str); 5] = [
    ("attitudes", "attitudes = [{ utc, q = [x, y, z, w] }]"),
    ("attitude_file", "attitude_file = \"FILE\""),
    ("radec", "radec = [ra, dec, roll]"),
    ("nadir", "nadir = true"),
    ("look_at", "look_at = \"Moon\""),
];

pub(super) const LIMITS: &[Limit] = &[
    ("sequence", OneOf(&POINTINGS)),
    ("sequence", Needs(["up", "look_at"])),
    ("sequence", Needs(["roll_deg", "look_at"])),
    ("sequence", NotBoth(["rates_deg_s", "nadir"])),
    ("sequence", NotBoth(["rates_deg_s", "look_at"])),
    ("sequence", NotBoth(["rates_deg_s", "attitude_file"])),
    ("sequence", NotWithSeveral(["rates_deg_s", "attitudes"])),
    ("sequence", EachOfSeveral(["attitudes", "utc"])),
    ("sequence.frames", Number(1.0..=1e6)),
    ("sequence.period_s", Number(1e-6..=1e6)),
    ("sequence.roll_deg", Number(TURN_DEG)),
    ("sequence.rates_deg_s[]", Number(-36000.0..=36000.0)),
    ("sequence.radec[0]", Number(TURN_DEG)),
    ("sequence.radec[1]", Number(DEC_DEG)),
    ("sequence.radec[2]", Number(TURN_DEG)),
    ("sequence.look_at[0]", Number(TURN_DEG)),
    ("sequence.look_at[1]", Number(DEC_DEG)),
];

/// The body attitude that gives the boresight of `camera` this right ascension and declination, and
/// the image this roll, deg.
pub fn attitude_of_radec([ra, dec, roll]: [f64; 3], camera: &Camera) -> Result<Attitude, String> {
    if !(DEC_DEG.contains(&dec) && TURN_DEG.contains(&ra) && TURN_DEG.contains(&roll)) {
        return Err(format!(
            "{ra},{dec},{roll}: must be RA -360 to 360, DEC -90 to 90, ROLL -360 to 360, in deg"
        ));
    }
    let [ra, dec, roll] = [ra, dec, roll].map(f64::to_radians);
    Ok(Attitude::towards(ra, dec, roll).then(&camera.mounting.inverse()))
}

impl RawSequence {
    pub(super) fn validate(
        self,
        camera: &Camera,
        objects: &[Object],
        check: &Check,
        folder: &Folder,
    ) -> Result<Sequence, ConfigError> {
        // Single keys before rules between keys, whose repair would hide other faults.
        let epoch = self.epoch.utc(check, "sequence.epoch")?;
        let frames = check.limit(LIMITS, "sequence.frames", f64::from(self.frames))? as u32;
        let period_s = check.limit(LIMITS, "sequence.period_s", self.period_s)?;
        let last = epoch + seconds(period_s * f64::from(frames - 1));
        Bodies::at(last).map_err(|error| {
            let error = check.explain(
                "sequence.frames",
                format!("{frames}: the last exposure: {error}"),
            );
            error.needs(&["sequence.epoch", "sequence.period_s"])
        })?;
        let rates = self.rates_deg_s.map_or([0.0; 3], |Fixed(rates)| rates);
        let rates = check.each_limit(LIMITS, "sequence.rates_deg_s", rates)?;
        let attitudes = match self.radec {
            Some(Fixed(angles)) => {
                let attitude = attitude_of_radec(angles, camera)
                    .map_err(|why| check.explain("sequence.radec", why))?;
                vec![TimedAttitude { epoch, attitude }]
            }
            None => self.attitudes(epoch, check)?,
        };
        let attitude_file = match &self.attitude_file {
            Some(file) => {
                let read = folder.read_within(file, LARGEST_TABLE);
                let (name, text) =
                    read.map_err(|error| check.explain("sequence.attitude_file", error))?;
                Some(AttitudeFile { name, text })
            }
            None => None,
        };
        let look_at = match &self.look_at {
            Some(raw) => {
                let target = raw.validate("sequence.look_at", objects, check)?;
                let roll = self.roll_deg.unwrap_or(0.0);
                let roll = check.limit(LIMITS, "sequence.roll_deg", roll)?;
                Some(LookAt::new(target, self.up, roll.to_radians()))
            }
            None => None,
        };
        Ok(Sequence {
            epoch,
            frames,
            period_s,
            attitudes,
            attitude_file,
            look_at,
            rates: rates.map(f64::to_radians),
        })
    }

    fn attitudes(&self, epoch: Epoch, check: &Check) -> Result<Vec<TimedAttitude>, ConfigError> {
        let mut attitudes = Vec::new();
        for (i, raw) in self.attitudes.iter().enumerate() {
            let key = format!("sequence.attitudes[{i}]");
            let attitude = Attitude::from_xyzw(raw.q.0)
                .map_err(|error| check.explain(&format!("{key}.q"), error))?;
            let epoch = match &raw.utc {
                Some(time) => time.utc(check, &format!("{key}.utc"))?,
                None => epoch,
            };
            attitudes.push(TimedAttitude { epoch, attitude });
        }
        // A rule between keys refuses several attitudes without times.
        let are_timed = self.attitudes.iter().all(|raw| raw.utc.is_some());
        if are_timed && attitudes.windows(2).any(|w| w[1].epoch <= w[0].epoch) {
            let reason =
                "the utc of an attitude is not after that of the one before it: sort them by time";
            let key = "sequence.attitudes";
            return Err(check.explain(key, reason).needs(&[key]));
        }
        Ok(attitudes)
    }
}

impl AttitudeFile {
    /// Remarks on the file: ignored data and assumptions, a line each. Faults are reported when the
    /// file is used.
    pub(super) fn remarks(&self) -> Vec<String> {
        let Some(Ok(message)) = aem::is_message(&self.text).then(|| aem::parse(&self.text)) else {
            return Vec::new();
        };
        let remarks = message.remarks.iter();
        let lines = remarks.map(|(line, remark)| format!("{}:{line}: {remark}", self.name));
        lines.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Config, LIMITS};
    use skyloop_base::load::{DEFAULT_TOML, Folder, agree, both};

    fn load(text: &str) -> Option<String> {
        let read = Config::parse("scene.toml", text, &Folder::current());
        read.err().map(|error| error.to_string())
    }

    /// A scene with this pointing.
    fn scene(pointing: &str) -> String {
        format!(
            r#"
label_snr = 1.0
[objects]
diameter_m = 1.0
reflectance = 0.2
diffuse = 0.5
specular = 0.1
[effects]
off = ["starlight"]
[sky]
catalog = "bsc"
[run]
latency_s = 1.0
idle_s = 1.0
delay_s = 1.0
jitter_s = 1.0
work_limit_s = 1.0
stale_s = 1.0
holdover_s = 1.0
window_px = 9
priority = 9
cpus = [0]
coarsen = ["fast"]
output = "frame"
link = ["udp://127.0.0.1:4810"]
metrics = "9464"
[[heads]]
name = "B"
camera = "cots-wide"
rate_hz = 1.0
link = ["udp://127.0.0.1:4811"]
[sequence]
epoch = "2026-01-01T00:00:00Z"
frames = 1
period_s = 1.0
{pointing}
"#
        )
    }

    const BY_RADEC: &str = "radec = [1.0, 2.0, 3.0]\nrates_deg_s = [0.0, 0.0, 0.0]";
    const BY_TARGET: &str = "look_at = [1.0, 2.0]\nroll_deg = 1.0";

    #[test]
    fn the_schema_has_the_loaders_limits() {
        let bases = [BY_RADEC, BY_TARGET].map(scene);
        let schema = Config::schema("scene");
        // JSON has no limit of integers.
        let max = schema.pointer("/properties/seed/maximum");
        assert_eq!(max.and_then(|max| max.as_u64()), Some(u64::MAX));
        agree(&schema, LIMITS, &bases.each_ref().map(String::as_str), load);
    }

    /// Asserts whether schema and loader accept this scene.
    fn check(text: &str, is_valid: bool) {
        both(&Config::schema("scene"), text, load, is_valid);
    }

    #[test]
    fn schema_and_loader_agree_on_the_forms_of_texts() {
        for (key, value, is_valid) in [
            (
                "coarsen",
                r#"["fast", "wing_e = 0.5", " wing_e=5e-1 "]"#,
                true,
            ),
            ("coarsen", r#"["profiles = \"exact\""]"#, false),
            ("coarsen", r#"["faster"]"#, false),
            ("coarsen", r#"["wing_ee = 0.5"]"#, false),
            ("coarsen", r#"["wing_e = much"]"#, false),
            ("coarsen", r#"["wing_e"]"#, false),
            ("link", r#""udp://127.0.0.1:4810""#, true),
            ("link", r#"["can://vcan0?roles=truth", "pty://"]"#, true),
            ("link", r#""127.0.0.1:4810""#, false),
            ("link", r#"["tcp://127.0.0.1:4810"]"#, false),
        ] {
            check(&format!("[run]\n{key} = {value}"), is_valid);
        }
        let valid = "9464 127.0.0.1:9464 [::1]:9464 0 065535 255.249.199.99:65535 [::]:9464 [1:2:3:4:5:6:7:8]:9464
            [1:2:3:4:5:6:7::]:9464 [::2:3:4:5:6:7:8]:9464 [1:2::5:6]:9464";
        let invalid = "65536 +9464 -1 256.0.0.1:9464 127.0.0.01:9464 127.0.0.1:70000 127.0.0.1 [1:2:3:4:5:6:7]:9464
            [1:2:3:4::5:6:7:8]:9464 [1:2:3:4:5:6:7:8:9]:9464 [1::2::3]:9464 [12345::]:9464 [:::]:9464
            [fe80::1%1]:9464 [::127.0.0.1]:9464 ::1:9464 localhost:9464 http://127.0.0.1:9464";
        for (addresses, is_valid) in [(valid, true), (invalid, false)] {
            for address in addresses.split_whitespace() {
                check(&format!("[run]\nmetrics = {address:?}"), is_valid);
            }
        }
        // A list is not a table.
        for table in ["run", "sky", "effects", "objects", "observer"] {
            check(&format!("[{table}]\n"), true);
            check(&format!("[[{table}]]\n"), false);
            check(&format!("{table} = []\n"), false);
        }
    }

    #[test]
    fn schema_and_loader_agree_on_pointings() {
        both(&Config::schema("scene"), DEFAULT_TOML, |_| None, true);
        let one = [
            "attitudes = [{ q = [0.0, 0.0, 0.0, 1.0] }]",
            "attitude_file = \"Cargo.toml\"",
            "radec = [1.0, 2.0, 3.0]",
            "nadir = true",
            "look_at = \"Moon\"",
        ];
        for (index, pointing) in one.iter().enumerate() {
            check(&scene(pointing), true);
            for other in &one[index + 1..] {
                check(&scene(&format!("{pointing}\n{other}")), false);
            }
        }
        let turns = "rates_deg_s = [0.0, 0.0, 1.0]";
        let rests = "rates_deg_s = [0.0, 0.0, 0.0]";
        let moving = "q = [0.0, 0.0, 0.0, 1.0], utc = \"2026-01-01T00:00:0";
        let two = format!("attitudes = [{{ {moving}0Z\" }}, {{ {moving}1Z\" }}]");
        for (pointing, is_valid) in [
            ("", false),
            ("nadir = false", false),
            ("attitudes = []", false),
            ("attitudes = []\nnadir = true", true),
            ("nadir = false\nlook_at = \"Sun\"", true),
            ("look_at = \"Sun\"\nup = \"north\"", true),
            ("nadir = true\nup = \"north\"", false),
            ("nadir = true\nroll_deg = 1.0", false),
            (&format!("nadir = true\n{turns}"), false),
            (&format!("nadir = true\n{rests}"), true),
            (&format!("look_at = \"Sun\"\n{turns}"), false),
            (&format!("{}\n{turns}", one[1]), false),
            (&two, true),
            (&format!("{two}\n{rests}"), true),
            (&format!("{two}\n{turns}"), false),
            (&format!("attitudes = [{{ {moving}0Z\" }}]\n{turns}"), true),
            (
                &format!("attitudes = [{{ {moving}0Z\" }}, {{ q = [0.0, 0.0, 0.0, 1.0] }}]"),
                false,
            ),
            (
                "attitudes = [[\"2026-01-01T00:00:00Z\", [0.0, 0.0, 0.0, 1.0]]]",
                false,
            ),
        ] {
            check(&scene(pointing), is_valid);
        }
        let state = "[observer]\nstate = [7000.0, 0.0, 0.0, 0.0, 7.5, 0.0]\n";
        check(state, true);
        check(&format!("{state}orbit = \"x.tle\"\n"), false);
    }
}
