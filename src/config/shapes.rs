//! Spheres, shapes and attitudes of population files.

use nalgebra::{Unit, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;
use skyloop_base::load::Allowed::{Count, Number, Word};
use skyloop_base::load::{
    Allowed, Check, ConfigError, Fixed, Kind, Limit, RawTime, one_of, tables,
};
use skyloop_render::attitude::Attitude;
use skyloop_render::sky::body_attitude::BodyAttitude;
use skyloop_render::sky::photometry::Sphere;
use skyloop_render::sky::shape::{Ends, Lobe, Plate, Shape, Surface};
use std::ops::RangeInclusive;

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct RawSphere {
    /// Diameter, m
    pub diameter_m: f64,
    /// Fraction of the light that is reflected (Eqs. 7 and 8)
    pub reflectance: f64,
    /// Diffuse part of the reflected light (B_diff)
    pub diffuse: f64,
    /// Specular part of the reflected light (B_spec)
    pub specular: f64,
}

impl Default for RawSphere {
    fn default() -> Self {
        let sphere = Sphere::default();
        RawSphere {
            diameter_m: sphere.diameter_m,
            reflectance: sphere.reflectance,
            diffuse: sphere.diffuse,
            specular: sphere.specular,
        }
    }
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawShape {
    /// Parts of the shape
    #[serde(deserialize_with = "tables")]
    parts: Vec<RawPart>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RawPart {
    /// Form of the part
    kind: String,
    /// Area of one side of a plate, m^2
    area_m2: Option<f64>,
    /// Normal of the front of a plate, body axes, of any length
    normal: Option<Fixed<f64, 3>>,
    /// The back of a plate reflects, too; default: false
    two_sided: Option<bool>,
    /// Axis about which a plate turns to face the Sun, not along its normal; default: fixed
    sun_axis: Option<Fixed<f64, 3>>,
    /// Edges of a box along the body axes, m
    size_m: Option<Fixed<f64, 3>>,
    /// Direction from base to top, body axes, of any length
    axis: Option<Fixed<f64, 3>>,
    /// Diameter, m; of a cone that of its base
    diameter_m: Option<f64>,
    /// Diameter of the top of a cone, m; default: 0
    top_diameter_m: Option<f64>,
    /// Length of a cylinder or cone, m
    length_m: Option<f64>,
    /// Closed ends; default: both
    ends: Option<String>,
    /// Fraction of the light that is reflected; default: 0.2
    reflectance: Option<f64>,
    /// Diffuse (Lambert) part of the reflected light (B_diff, Hejduk's Eq. 6); diffuse and specular
    /// are at most 1 together; default: 1
    diffuse: Option<f64>,
    /// Specular part of the reflected light (B_spec, Hejduk's Eq. 6); needs a smaller diffuse;
    /// default: 0
    specular: Option<f64>,
    /// Half width of the specular lobe around the mirror direction, deg, not for spheres; default:
    /// a mirror, with the Sun's disc of 0.27 deg
    lobe_deg: Option<f64>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawAttitude {
    /// inertial: fixed among the stars; nadir: turning with the orbit; spin: turning at constant
    /// rates
    mode: String,
    /// Unit quaternion [x, y, z, w] from ICRF to body; of spin at utc; of nadir from orbit axes to
    /// body (+Z to the Earth's centre, +X towards the velocity), by default identity
    q: Option<Fixed<f64, 4>>,
    /// spin: time of q
    utc: Option<RawTime>,
    /// spin: body rates, deg/s, body axes
    rates_deg_s: Option<Fixed<f64, 3>>,
}

/// The keys of each kind of part, in addition to those of all parts: required ones, then optional
/// ones.
const KINDS: &[Kind] = &[
    ("plate", &["area_m2", "normal"], &["two_sided", "sun_axis"]),
    ("box", &["size_m"], &[]),
    ("cylinder", &["axis", "diameter_m", "length_m"], &["ends"]),
    (
        "cone",
        &["axis", "diameter_m", "length_m"],
        &["top_diameter_m", "ends"],
    ),
    ("sphere", &["diameter_m"], &[]),
];

/// The modes of attitudes: required keys, then optional ones.
const MODES: &[Kind] = &[
    ("inertial", &["q"], &[]),
    ("nadir", &[], &["q"]),
    ("spin", &["q", "utc", "rates_deg_s"], &[]),
];

/// Lengths of parts, m.
const LENGTHS: RangeInclusive<f64> = 1e-3..=1e4;
/// Fractions of light.
const SHARES: RangeInclusive<f64> = 0.0..=1.0;
/// Diameters of objects' spheres, m.
const SPHERES: RangeInclusive<f64> = 1e-6..=1e6;
/// Components of directions.
const AXES: RangeInclusive<f64> = -1e6..=1e6;
/// Half widths of lobes, deg.
const LOBES: RangeInclusive<f64> = Lobe::NARROWEST * 180.0 / std::f64::consts::PI..=90.0;

/// Limits of the keys of scenes.
pub(crate) const SCENE_LIMITS: &[Limit] = &[
    ("objects.diameter_m", Number(SPHERES)),
    ("objects.reflectance", Number(SHARES)),
    ("objects.diffuse", Number(SHARES)),
    ("objects.specular", Number(SHARES)),
];

/// Limits of the keys of population files.
pub(crate) const LIMITS: &[Limit] = &[
    ("objects[].sphere.diameter_m", Number(SPHERES)),
    ("objects[].sphere.reflectance", Number(SHARES)),
    ("objects[].sphere.diffuse", Number(SHARES)),
    ("objects[].sphere.specular", Number(SHARES)),
    (
        "objects[].attitude.rates_deg_s[]",
        Number(-36000.0..=36000.0),
    ),
    ("objects[].attitude", Allowed::Kind("mode", MODES)),
    ("shapes.*.parts", Count(1..=MAX_PARTS)),
    ("shapes.*.parts[].area_m2", Number(1e-6..=1e6)),
    ("shapes.*.parts[].size_m[]", Number(LENGTHS)),
    ("shapes.*.parts[].diameter_m", Number(LENGTHS)),
    ("shapes.*.parts[].length_m", Number(LENGTHS)),
    ("shapes.*.parts[].top_diameter_m", Number(0.0..=1e4)),
    ("shapes.*.parts[].normal[]", Number(AXES)),
    ("shapes.*.parts[].sun_axis[]", Number(AXES)),
    ("shapes.*.parts[].axis[]", Number(AXES)),
    ("shapes.*.parts[].reflectance", Number(SHARES)),
    ("shapes.*.parts[].diffuse", Number(SHARES)),
    ("shapes.*.parts[].specular", Number(SHARES)),
    ("shapes.*.parts[].lobe_deg", Number(LOBES)),
    ("shapes.*.parts[].ends", Word(ends)),
    ("shapes.*.parts[]", Allowed::Kind("kind", KINDS)),
];

/// Closed ends of a cylinder or a cone: base and top.
const ENDS: [(&str, [bool; 2]); 4] = [
    ("both", [true, true]),
    ("base", [true, false]),
    ("top", [false, true]),
    ("none", [false, false]),
];

fn ends() -> Vec<&'static str> {
    ENDS.iter().map(|(name, _)| *name).collect()
}

/// Directions at a smaller angle (rad) count as parallel.
const ALONG: f64 = 1e-6;
/// Largest number of parts: a frame may need their light at hundreds of instants.
const MAX_PARTS: usize = 200;

impl RawSphere {
    pub fn validate(
        &self,
        key: &str,
        limits: &[Limit],
        check: &Check,
    ) -> Result<Sphere, ConfigError> {
        let of = |name: &str| format!("{key}.{name}");
        let sphere = Sphere {
            diameter_m: check.limit(limits, &of("diameter_m"), self.diameter_m)?,
            reflectance: check.limit(limits, &of("reflectance"), self.reflectance)?,
            diffuse: check.limit(limits, &of("diffuse"), self.diffuse)?,
            specular: check.limit(limits, &of("specular"), self.specular)?,
        };
        no_more_than_all(key, [sphere.diffuse, sphere.specular], "sphere", check)?;
        Ok(sphere)
    }
}

fn no_more_than_all(
    key: &str,
    [diffuse, specular]: [f64; 2],
    what: &str,
    check: &Check,
) -> Result<(), ConfigError> {
    if diffuse + specular <= 1.0 + 1e-9 {
        return Ok(());
    }
    let more = format!(
        "diffuse + specular is above 1 ({diffuse} + {specular}): the {what} would return more light than it takes; diffuse is {} where it is \
         not given: give both",
        Sphere::default().diffuse
    );
    let needs = ["diffuse", "specular"].map(|name| format!("{key}.{name}"));
    Err(check
        .explain(key, more)
        .needs(&needs.each_ref().map(String::as_str)))
}

impl RawShape {
    pub fn validate(self, key: &str, check: &Check) -> Result<Shape, ConfigError> {
        let key = format!("{key}.parts");
        if !(1..=MAX_PARTS).contains(&self.parts.len()) {
            let allowed = format!("1 to {MAX_PARTS} parts, such as {{ kind = \"plate\", ... }}");
            let given = format!("{} parts", self.parts.len());
            return Err(check.refuse(&key, given, allowed));
        }
        let mut shape = Shape::default();
        for (i, part) in self.parts.iter().enumerate() {
            part.add(&mut shape, &format!("{key}[{i}]"), check)?;
        }
        Ok(shape)
    }
}

impl RawPart {
    fn add(&self, shape: &mut Shape, key: &str, check: &Check) -> Result<(), ConfigError> {
        let surface = self.surface(key, check)?;
        let length = |name: &str, value: Option<f64>| {
            check.limit(LIMITS, &format!("{key}.{name}"), value.unwrap_or(0.0))
        };
        match self.kind.as_str() {
            "plate" => {
                let area = self.area_m2.unwrap_or(0.0);
                let of = format!("{key}.area_m2");
                let normal = direction(&format!("{key}.normal"), &self.normal, check)?;
                let plate = Plate {
                    area_m2: check.limit(LIMITS, &of, area)?,
                    normal,
                    two_sided: self.two_sided.unwrap_or(false),
                    hinge: self.hinge(key, &normal, check)?,
                };
                shape.plate(plate, surface);
            }
            "box" => {
                let Fixed(size) = self.size_m.unwrap_or(Fixed([0.0; 3]));
                shape.cuboid(
                    check.each_limit(LIMITS, &format!("{key}.size_m"), size)?,
                    surface,
                );
            }
            "sphere" => shape.sphere(length("diameter_m", self.diameter_m)?, surface),
            kind => {
                let axis = direction(&format!("{key}.axis"), &self.axis, check)?;
                let base_m = length("diameter_m", self.diameter_m)?;
                let top_m = if kind == "cylinder" {
                    base_m
                } else {
                    let of = format!("{key}.top_diameter_m");
                    check.limit(LIMITS, &of, self.top_diameter_m.unwrap_or(0.0))?
                };
                let length_m = length("length_m", self.length_m)?;
                let ends = self.ends(key, check)?;
                shape.cone(axis, [base_m, top_m], length_m, ends, surface);
            }
        }
        Ok(())
    }

    fn surface(&self, key: &str, check: &Check) -> Result<Surface, ConfigError> {
        let default = Sphere::default();
        let share = |name: &str, value: Option<f64>, default: f64| {
            let of = format!("{key}.{name}");
            check.limit(LIMITS, &of, value.unwrap_or(default))
        };
        let surface = Surface {
            reflectance: share("reflectance", self.reflectance, default.reflectance)?,
            diffuse: share("diffuse", self.diffuse, default.diffuse)?,
            specular: share("specular", self.specular, default.specular)?,
            lobe: match self.lobe_deg {
                Some(deg) => {
                    let of = format!("{key}.lobe_deg");
                    let deg = check.limit(LIMITS, &of, deg)?;
                    Lobe::Smooth(deg.to_radians())
                }
                None => Lobe::Mirror,
            },
        };
        no_more_than_all(key, [surface.diffuse, surface.specular], "part", check)?;
        if self.lobe_deg.is_some() && (surface.specular == 0.0 || self.kind == "sphere") {
            let reason = match surface.specular {
                0.0 => "means nothing where nothing is mirrored: give specular, or leave it out",
                _ => "means nothing to a sphere, which mirrors the same to all sides: leave it out",
            };
            let error = check.explain(&format!("{key}.lobe_deg"), reason);
            return Err(error.needs(&[&format!("{key}.specular"), &format!("{key}.kind")]));
        }
        Ok(surface)
    }

    /// The axis that a plate turns about. It must not be the plate's normal: a turn about that does
    /// not change what the plate faces.
    fn hinge(
        &self,
        key: &str,
        normal: &Unit<Vector3<f64>>,
        check: &Check,
    ) -> Result<Option<Unit<Vector3<f64>>>, ConfigError> {
        let Some(Fixed(axes)) = self.sun_axis else {
            return Ok(None);
        };
        let hinge = direction(&format!("{key}.sun_axis"), &self.sun_axis, check)?;
        if hinge.cross(normal).norm() < ALONG {
            let allowed = "at an angle to the normal: a turn about the normal does not point the plate at the Sun; give the hinge axis, or leave it out";
            let error = check.refuse(&format!("{key}.sun_axis"), format!("{axes:?}"), allowed);
            return Err(error.needs(&[&format!("{key}.normal")]));
        }
        Ok(Some(hinge))
    }

    fn ends(&self, key: &str, check: &Check) -> Result<Ends, ConfigError> {
        let name = self.ends.as_deref().unwrap_or(ENDS[0].0);
        let Some((_, [base, top])) = ENDS.into_iter().find(|(known, _)| *known == name) else {
            let allowed = format!("{}: which are closed", one_of(&ends()));
            return Err(check.refuse(&format!("{key}.ends"), format!("{name:?}"), allowed));
        };
        Ok(Ends { base, top })
    }
}

impl RawAttitude {
    pub fn validate(&self, key: &str, check: &Check) -> Result<BodyAttitude, ConfigError> {
        let attitude = match self.q {
            Some(Fixed(q)) => {
                Attitude::from_xyzw(q).map_err(|error| check.explain(&format!("{key}.q"), error))?
            }
            None => Attitude::identity(),
        };
        let (Some(time), Some(Fixed(rates))) = (&self.utc, self.rates_deg_s) else {
            return Ok(match self.mode.as_str() {
                "nadir" => BodyAttitude::Nadir(attitude),
                _ => BodyAttitude::Inertial(attitude),
            });
        };
        let rates = check.each_limit(LIMITS, &format!("{key}.rates_deg_s"), rates)?;
        Ok(BodyAttitude::Spin {
            epoch: time.utc(check, &format!("{key}.utc"))?,
            attitude,
            rates: Vector3::from(rates.map(f64::to_radians)),
        })
    }
}

/// A direction from a vector of any length except 0.
fn direction(
    key: &str,
    given: &Option<Fixed<f64, 3>>,
    check: &Check,
) -> Result<Unit<Vector3<f64>>, ConfigError> {
    let Fixed(axes) = given.unwrap_or(Fixed([0.0; 3]));
    let axes = check.each_limit(LIMITS, key, axes)?;
    Unit::try_new(Vector3::from(axes), 1e-9).ok_or_else(|| {
        let allowed = "a direction [x, y, z] in body axes, not zero; any length";
        check.refuse(key, format!("{axes:?}"), allowed)
    })
}
