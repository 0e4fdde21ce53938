//! `look_at`: the boresight meets the target, the roll rule sets the image orientation, and the
//! rates follow.

use crate::fixtures::{Frames, unit};

use crate::table::check_refusals;
use nalgebra::{Rotation3, Vector3};
use skyloop::config::{Config, LookAt, Target, Up};
use skyloop::flight;
use skyloop::label::{Label, ObjectLabel};
use skyloop::load::Folder;

/// Above the equator, 770 km high, moving along it (km, km/s).
const EQUATOR: &str = "[7150.0, 0.0, 0.0, 0.0, 7.466, 0.0]";
/// 770 km high, above RA 129 and Dec -26 deg (km, km/s).
const SOUTH: &str = "[-4000.0, 5000.0, -3186.0, -5.0, -4.87, -1.37]";
/// 770 km high, above RA 309 and Dec 26 deg (km, km/s).
const INCLINED: &str = "[4000.0, -5000.0, 3186.0, 5.0, 4.87, 1.37]";

/// The label of frame `frame` of a scene with this pointing.
fn label(epoch: &str, state: &str, pointing: &str, frame: u32) -> Label {
    let text = format!(
        "camera = \"cots-wide\"\n[observer]\nstate = {state}\n[sequence]\nepoch = \"{epoch}\"\nframes = 3\nperiod_s = 60.0\n{pointing}\n"
    );
    let config = Config::parse("scene.toml", &text, &Folder::current());
    expose(config.unwrap_or_else(|error| panic!("{error}")), frame)
}

fn expose(config: Config, frame: u32) -> Label {
    Frames::of(config).expose(frame).label
}

fn object<'a>(label: &'a Label, id: &str) -> &'a ObjectLabel {
    let found = label.objects.iter().find(|object| object.id == id);
    found.unwrap_or_else(|| panic!("{id} is not in {:?}", label.objects.len()))
}

/// Distance from the middle of `cots-wide`, where its boresight is, px.
fn off_px(object: &ObjectLabel) -> f64 {
    (object.x_px - 639.5).hypot(object.y_px - 511.5)
}

fn moved_px(object: &ObjectLabel) -> f64 {
    (object.x1_px - object.x0_px).hypot(object.y1_px - object.y0_px)
}

fn row(label: &Label, axis: usize) -> Vector3<f64> {
    Vector3::from(label.r_icrf_to_camera[axis])
}

#[test]
fn a_body_lies_on_the_boresight_in_every_frame_of_a_sequence() {
    // Jupiter is a point of the same series: only its motion in the exposure remains. The Moon's
    // centre of light is not that of its disc: near full Moon (2026-06-29T23:57, Espenak's table)
    // they differ by less than a tenth of its radius of 0.26 deg, 15 px of 61 arcsec.
    for (epoch, state, target, id, tolerance_px) in [
        ("2026-03-10T06:00:00Z", SOUTH, "Jupiter", "Jupiter", 0.01),
        ("2026-03-10T06:00:00Z", SOUTH, "uranus", "Uranus", 0.01),
        ("2026-06-29T23:57:00Z", INCLINED, "Moon", "Moon", 1.5),
    ] {
        for frame in [0, 2] {
            let pointing = format!("look_at = \"{target}\"\nup = \"velocity\"");
            let label = label(epoch, state, &pointing, frame);
            let seen = object(&label, id);
            let (off, moved) = (off_px(seen), moved_px(seen));
            let is_near = off < tolerance_px && moved < tolerance_px;
            assert!(is_near, "{target} {frame}: {off} px off, moved {moved} px");
        }
    }
    let label = label("2026-03-10T06:00:00Z", INCLINED, "look_at = \"Sun\"", 1);
    assert!(label.sun_deg < 1e-6, "{}", label.sun_deg);
}

#[test]
fn an_object_is_followed_without_a_streak() {
    for name in ["RCM-1", "RCM-2"] {
        let mut config = Config::builtin().unwrap();
        let target = Target::parse(name, &config.objects).unwrap();
        let Target::Object(wanted) = &target else {
            panic!("{target:?}");
        };
        let id = wanted.id.clone();
        let sequence = config.sequence.as_mut().unwrap();
        sequence.attitudes.clear();
        sequence.look_at = Some(LookAt::new(target, Some(Up::Sun), 0.2));
        let camera = &config.camera;
        let middle = camera.optics.principal_px;
        let mounting = camera.mounting;
        let label = expose(config, 7);
        let seen = object(&label, &id);
        let off = (seen.x_px - middle[0]).hypot(seen.y_px - middle[1]);
        let moved = moved_px(seen);
        assert!(
            off < 0.01 && moved < 0.01,
            "{name}: {off} px off, moved {moved} px"
        );
        assert_eq!(mounting.xyzw(), label.q_body_to_camera);
    }
}

#[test]
fn directions_velocity_and_the_limb_are_met() {
    let epoch = "2026-03-10T06:00:00Z";
    // X-Val: RA 60, Dec 30 by hand.
    let direction = Vector3::new(3f64.sqrt() / 4.0, 0.75, 0.5);
    let found = row(&label(epoch, INCLINED, "look_at = [60.0, 30.0]", 1), 2);
    assert!((found - direction).norm() < 1e-12, "{found}");
    let same = label(epoch, INCLINED, "look_at = \"60,30\"\nroll_deg = 25.0", 0);
    let radec = label(epoch, INCLINED, "radec = [60.0, 30.0, 25.0]", 0);
    let apart = (row(&same, 0) - row(&radec, 0)).norm();
    assert!(apart < 1e-12, "roll_deg is that of radec: {apart}");

    let label_of = |pointing: &str| label(epoch, EQUATOR, pointing, 0);
    let ahead = label_of("look_at = \"velocity\"");
    assert!((row(&ahead, 2) - Vector3::y()).norm() < 1e-12);
    // Up is the zenith.
    assert!((row(&ahead, 1) + Vector3::x()).norm() < 1e-12);
    let down = label_of("nadir = true");
    assert!((row(&down, 2) + Vector3::x()).norm() < 1e-12);

    // Along the equator the ellipsoid's section is a circle: the line's distance from the centre is
    // its radius (WGS84, 6,378,137 m) plus the height. The pole of date is 0.15 deg from ICRF +Z:
    // 0.15 m of flattening.
    for (height_km, azimuth_deg) in [(80.0, 0.0), (0.0, 0.0), (300.0, 180.0)] {
        let pointing = format!("look_at = \"limb:{height_km},{azimuth_deg}\"");
        let label = label_of(&pointing);
        let position = Vector3::new(7_150e3, 0.0, 0.0);
        let line = row(&label, 2);
        let tangent_m = position.cross(&line).norm();
        let wanted_m = 6_378_137.0 + height_km * 1e3;
        assert!(
            (tangent_m - wanted_m).abs() < 2.0,
            "{pointing}: {tangent_m}"
        );
        let is_ahead = if azimuth_deg == 0.0 { 1.0 } else { -1.0 };
        assert!(
            line.y * is_ahead > 0.5 && line.x < 0.0,
            "{pointing}: {line}"
        );
    }
}

#[test]
fn the_roll_rule_sets_the_image_orientation() {
    let epoch = "2026-03-10T06:00:00Z";
    let [x, y] = [Vector3::x(), Vector3::y()];
    // X-Val: the Sun's RA and Dec on 2026-03-10 at 6 h, Astronomical Almanac's low-precision
    // formulas (0.01 deg), precessed to J2000: 350.174, -4.231 deg.
    let sun = unit(350.174f64.to_radians(), -4.231f64.to_radians());
    for (rule, up, tolerance) in [
        ("north", Vector3::z(), 1e-12),
        ("velocity", y, 1e-12),
        ("zenith", x, 1e-12),
        ("sun", sun, 1e-3),
    ] {
        for roll_deg in [0.0, 40.0] {
            let pointing =
                format!("look_at = [60.0, 30.0]\nup = \"{rule}\"\nroll_deg = {roll_deg}");
            let label = label(epoch, EQUATOR, &pointing, 0);
            let line = row(&label, 2);
            let across = (up - line * up.dot(&line)).normalize();
            // From north through east is a right turn about the line of sight, seen from behind it:
            // a negative turn about the direction.
            let turn = Rotation3::new(-line * f64::to_radians(roll_deg));
            let apart = (-row(&label, 1) - turn * across).norm();
            assert!(apart < tolerance, "{rule} {roll_deg}: {apart}");
        }
    }
}

/// Keys of a sequence. For `roll` only the advice about the name is checked; the intended key is in
/// no line of the file.
const REFUSED: &str = r#"
# none | s.toml:1:1: sequence: give one of
nadir = true\nradec = [0, 0, 0] | sequence.nadir: given with sequence.radec
look_at = "Sun"\nnadir = true | sequence.look_at: given with sequence.nadir
nadir = true\nup = "sun" | sequence.up: goes with sequence.look_at
look_at = "Sun"\nup = "left" | sequence.up: must be one of "north"
look_at = "Sun"\nrates_deg_s = [0, 0, 1] | sequence.rates_deg_s: given with sequence.look_at
look_at = "Sum" | sequence.look_at: "Sum" is none of
radec = [0, 0, 0]\nroll = 1 | sequence.roll: unknown key `roll`: did you mean `roll_deg`?
look_at = [0, 91] | a declination of -90 to 90 deg
look_at = 5 | sequence.look_at: "5" is none of Sun
look_at = true | sequence.look_at: must be "Sun"
radec = [0, 91, 0] | sequence.radec: 0,91,0: must be RA -360 to 360
nadir = true | nadir pointing needs an orbit: give [observer] state or orbit in the scene
look_at = "limb:80" | the limb needs an orbit
look_at = "velocity" | the direction of the velocity needs an orbit
look_at = "Sun"\nup = "zenith" | up = "zenith" needs an orbit
nadir = true\n[observer]\nstate = [1, 2, 3, 4, 5, 6] | observer.state: 1,2,3,4,5,6: 3.7 km from the Earth's centre
"#;

#[test]
fn a_sequence_has_exactly_one_pointing() {
    let head = "[sequence]\nepoch = \"2026-03-10T06:00:00Z\"\nframes = 1\nperiod_s = 1.0\n";
    let parse =
        |keys: &str| Config::parse("s.toml", &format!("{head}{keys}\n"), &Folder::current());
    check_refusals(REFUSED, |keys| {
        let error = match parse(keys).map(|config| flight::mission(&config).map(drop)) {
            Err(error) => error.to_string(),
            Ok(Err(error)) => error.to_string(),
            Ok(Ok(())) => panic!("{keys}"),
        };
        assert!(!error.contains("sequence.roll_deg:"), "{keys}: {error}");
        error
    });
    // From the Earth's centre any target with a direction is accepted.
    let config = parse("look_at = \"Moon\"").unwrap();
    let middle = config.camera.optics.principal_px;
    let label = expose(config, 0);
    let moon = object(&label, "Moon");
    // Distance to the Moon's centre of light, px of 389 arcsec.
    assert!((moon.x_px - middle[0]).hypot(moon.y_px - middle[1]) < 15.0);
}
