//! Pointing of a run that makes its own attitudes: `look_at`, `up` and `roll_deg` of `[sequence]`
//! and of the command line.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};
use skyloop_base::load::{Check, ConfigError, Fixed, MEANT, TextOrList, advice, nearest};
use skyloop_orbit::{Loaded, Object};
use skyloop_render::sky::planets;
use std::ops::RangeInclusive;

/// A target and the roll about the line of sight to it.
#[derive(Debug, Clone)]
pub struct LookAt {
    /// The target of the boresight.
    pub target: Target,
    /// Reference direction for image up (-Y).
    pub up: Up,
    /// Position angle of -Y from `up`, in the sense from north through east, rad.
    pub roll_rad: f64,
}

/// A target that a boresight follows.
#[derive(Debug, Clone)]
pub enum Target {
    /// An apparent right ascension and declination (rad, ICRF), with aberration included.
    Direction([f64; 2]),
    /// The Sun's centre.
    Sun,
    /// The centre of the Moon's disc.
    Moon,
    /// A planet.
    Planet(&'static str),
    /// An object of the scene.
    Object(Box<Object>),
    /// A tangent point above the Earth's limb: height above WGS84 (m) and azimuth from the velocity
    /// to the right (rad).
    Limb([f64; 2]),
    /// The direction of the observer's geocentric velocity.
    Velocity,
}

/// Reference direction for image up, projected perpendicular to the line of sight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Up {
    /// ICRF +Z.
    North,
    /// The direction of the observer's geocentric velocity.
    Velocity,
    /// The Sun.
    Sun,
    /// Away from the Earth's centre.
    Zenith,
}

/// A target as text, or right ascension and declination in deg.
#[derive(JsonSchema)]
#[schemars(untagged)]
pub(super) enum RawTarget {
    Named(String),
    /// The catalogue number of an object.
    Number(u32),
    Direction(Fixed<f64, 2>),
}

impl<'de> Deserialize<'de> for RawTarget {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(TextOrList {
            expected: "\"Sun\", \"Moon\", a planet, an object's name or number, \"limb:HEIGHT_KM\", \"velocity\", or [ra, dec] in deg",
            text: RawTarget::Named,
            number: Some(RawTarget::Number),
            list: RawTarget::Direction,
        })
    }
}

/// Right ascensions and rolls, deg.
pub(super) const TURN_DEG: RangeInclusive<f64> = -360.0..=360.0;
/// Declinations, deg.
pub(super) const DEC_DEG: RangeInclusive<f64> = -90.0..=90.0;

/// The forms of a target.
const FORMS: &str = "Sun, Moon, a planet, an object's name or number, limb:HEIGHT_KM[,AZIMUTH_DEG], velocity, or RA,DEC in deg";
/// Names of targets that are neither planets nor objects.
const NAMES: &[&str] = &["Sun", "Moon", "velocity"];

impl Up {
    /// All directions by name.
    pub const ALL: [(&'static str, Up); 4] = [
        ("north", Up::North),
        ("velocity", Up::Velocity),
        ("sun", Up::Sun),
        ("zenith", Up::Zenith),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        let named = Up::ALL.iter().find(|(_, up)| *up == self);
        named.map_or("", |(name, _)| name)
    }
}

impl LookAt {
    /// `up` defaults to `zenith` for the limb and the velocity, else to `north`.
    pub fn new(target: Target, up: Option<Up>, roll_rad: f64) -> LookAt {
        let default = match target {
            Target::Limb(_) | Target::Velocity => Up::Zenith,
            _ => Up::North,
        };
        LookAt {
            target,
            up: up.unwrap_or(default),
            roll_rad,
        }
    }

    /// The reason why it needs an orbit, if it does.
    pub(crate) fn needs_orbit(&self) -> Option<&'static str> {
        match (&self.target, self.up) {
            (Target::Limb(_), _) => Some("the limb"),
            (Target::Velocity, _) => Some("the direction of the velocity"),
            (_, Up::Velocity) => Some("up = \"velocity\""),
            (_, Up::Zenith) => Some("up = \"zenith\""),
            _ => None,
        }
    }
}

impl Target {
    /// Parses a target; objects are those of a scene. The error has the allowed forms.
    pub fn parse(text: &str, objects: &[Object]) -> Result<Target, String> {
        let text = text.trim();
        let is = |name: &str| text.eq_ignore_ascii_case(name);
        if let Some((head, limb)) = text.split_at_checked("limb:".len())
            && head.eq_ignore_ascii_case("limb:")
        {
            return Target::limb(limb);
        }
        if let Some(planet) = planets::names().find(|name| is(name)) {
            return Ok(Target::Planet(planet));
        }
        match text {
            _ if is("sun") => return Ok(Target::Sun),
            _ if is("moon") => return Ok(Target::Moon),
            _ if is("velocity") => return Ok(Target::Velocity),
            _ => {}
        }
        if let Some((ra, dec)) = text.split_once(',')
            && let (Ok(ra), Ok(dec)) = (ra.trim().parse(), dec.trim().parse())
        {
            return Target::direction([ra, dec]);
        }
        let known: Vec<&str> = NAMES.iter().copied().chain(planets::names()).collect();
        if objects.is_empty() {
            let advice = advice(text, &known);
            return Err(format!(
                "{text:?} is none of {FORMS}{advice}; there are no objects here"
            ));
        }
        let all = Loaded {
            objects: objects.to_vec(),
            ..Loaded::default()
        };
        match all.find(Some(text)) {
            Ok(object) => Ok(Target::Object(Box::new(object.clone()))),
            Err(why) => {
                let meant = nearest(text, &known)
                    .map_or(String::new(), |meant| format!("{MEANT}{meant}`?"));
                Err(format!("{text:?} is none of {FORMS}{meant}; {why}"))
            }
        }
    }

    /// A right ascension and declination in deg.
    pub(crate) fn direction([ra, dec]: [f64; 2]) -> Result<Target, String> {
        if !TURN_DEG.contains(&ra) || !DEC_DEG.contains(&dec) {
            return Err(format!(
                "{ra},{dec}: must be a right ascension of -360 to 360 and a declination of -90 to 90 deg"
            ));
        }
        Ok(Target::Direction([ra, dec].map(f64::to_radians)))
    }

    /// `HEIGHT_KM` or `HEIGHT_KM,AZIMUTH_DEG`.
    fn limb(text: &str) -> Result<Target, String> {
        let (height, azimuth) = text.split_once(',').unwrap_or((text, "0"));
        let [height_km, azimuth_deg] = [height, azimuth].map(|text| text.trim().parse::<f64>());
        match (height_km, azimuth_deg) {
            (Ok(height_km), Ok(azimuth_deg))
                if (0.0..=1e5).contains(&height_km) && azimuth_deg.abs() <= 360.0 =>
            {
                Ok(Target::Limb([height_km * 1e3, azimuth_deg.to_radians()]))
            }
            _ => Err(format!(
                "limb:{text}: must be limb:HEIGHT_KM or limb:HEIGHT_KM,AZIMUTH_DEG, a height of 0 to 100000 km above WGS84 and an azimuth of -360 \
                 to 360 deg from the velocity, to the right"
            )),
        }
    }
}

impl RawTarget {
    pub(super) fn validate(
        &self,
        key: &str,
        objects: &[Object],
        check: &Check,
    ) -> Result<Target, ConfigError> {
        let target = match self {
            RawTarget::Named(text) => Target::parse(text, objects),
            RawTarget::Number(number) => Target::parse(&number.to_string(), objects),
            RawTarget::Direction(Fixed(angles)) => Target::direction(*angles),
        };
        target.map_err(|why| check.explain(key, why))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_are_read_and_refused_by_name() {
        for (text, expected) in [
            ("Sun", "Ok(Sun)"),
            ("moon", "Ok(Moon)"),
            (" MARS ", "Ok(Planet(\"Mars\"))"),
            ("velocity", "Ok(Velocity)"),
            ("180, -90", "Ok(Direction([3.14159"),
            ("limb:80", "Ok(Limb([80000.0, 0.0]))"),
            ("LIMB:80", "Ok(Limb([80000.0, 0.0]))"),
            ("limb:80,180", "Ok(Limb([80000.0, 3.14159"),
            ("180,-91", "declination of -90 to 90"),
            ("361,0", "right ascension of -360 to 360"),
            ("limb:-1", "a height of 0 to 100000 km"),
            ("limb:nan", "a height of 0 to 100000 km"),
            ("limb:80,", "limb:HEIGHT_KM"),
            ("Mooon", "did you mean `Moon`?"),
            ("25544", "no objects here"),
            ("", "no objects here"),
        ] {
            let found = format!("{:?}", Target::parse(text, &[]));
            assert!(found.contains(expected), "{text}: {found}");
        }
        // With objects a misspelt name has the same advice, before the list of objects.
        let objects = &crate::Config::builtin().unwrap().objects;
        let found = Target::parse("Mooon", objects).unwrap_err();
        let (_, after) = found.split_once(": did you mean `Moon`?; ").unwrap();
        assert!(after.starts_with("no object called"), "{found}");
    }
}
