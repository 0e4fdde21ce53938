//! Whole frames against the paper's equations, geometry and the labels.

use crate::fixtures::{self, Frames, camera, cropped, towards};
use nalgebra::Vector3;
use skyloop::attitude::VehicleState;
use skyloop::camera::Camera;
use skyloop::config::Config;
use skyloop::effect::EFFECTS;
use skyloop::engine::{Emulator, ExposedFrame};
use skyloop::label::ObjectLabel;
use skyloop::sky::bodies::Bodies;
use skyloop::sky::{Corrections, Observer};
use std::f64::consts::PI;

/// A frame of one scene with these effects only.
fn expose(scene: &str, frame: u32, effects: &[&str]) -> ExposedFrame {
    let mut frames = Frames::of(fixtures::scene(scene));
    only(&mut frames.emulator, effects);
    frames.expose(frame)
}

pub fn only(emulator: &mut Emulator, effects: &[&str]) {
    emulator.keep_expected = true;
    let others = EFFECTS.iter().map(|effect| effect.name);
    let is_off = |name: &&str| !effects.contains(name) && *name != "readout";
    emulator.choice.off = others.filter(is_off).collect();
}

/// A frame of a small camera at the Earth's centre, pointed along `direction`.
fn expose_towards(
    camera: Camera,
    epoch: &str,
    direction: Vector3<f64>,
    effects: &[&str],
) -> ExposedFrame {
    let mut config = Config::defaults().unwrap();
    config.camera = camera;
    let mut emulator = Emulator::new(&mut config);
    only(&mut emulator, effects);
    let (epoch, q) = (epoch.parse().unwrap(), towards(&direction));
    let vehicle = VehicleState::new(0, epoch, q, [0.0; 3], None).unwrap();
    emulator.expose(&vehicle, 0).unwrap()
}

/// An observer at rest at a position (GCRF, m).
pub fn observer(epoch: &str, position_m: Vector3<f64>) -> Observer {
    let epoch = epoch.parse().unwrap();
    Observer {
        epoch,
        position_m,
        velocity_m_s: Vector3::zeros(),
        bodies: Bodies::at(epoch).unwrap(),
    }
}

/// Electrons of a pixel on the boresight of a pinhole, for a radiance (ph/s/m^2/sr).
fn of_radiance(radiance: f64, camera: &Camera) -> f64 {
    let (optics, detector) = (&camera.optics, &camera.detector);
    let area = PI * optics.aperture_m * optics.aperture_m / 4.0;
    let solid_angle = 1.0 / (optics.focal_px * optics.focal_px);
    let passes = optics.transmission * detector.quantum_efficiency;
    radiance * solid_angle * area * passes * camera.exposure_s
}

pub fn moon(exposed: &ExposedFrame) -> &ObjectLabel {
    let mut objects = exposed.label.objects.iter();
    objects.find(|object| object.kind == "moon").unwrap()
}

/// Electrons of all the Moon's light, by the label's magnitude: Clark et al. 2021, Eqs. (1), (2).
pub fn all_e(exposed: &ExposedFrame) -> f64 {
    let camera = &exposed.camera;
    let light = 10f64.powf(-0.4 * moon(exposed).mag);
    camera.electrons_per_second_at_zero() * light * camera.exposure_s
}

fn rigel() -> Camera {
    cropped(camera("rigel-l"), 64)
}

pub fn expected(exposed: &ExposedFrame) -> &[f32] {
    exposed.frame.expected_e.as_deref().unwrap()
}

/// Sum and centre of a frame's expected electrons.
pub fn moments(exposed: &ExposedFrame) -> (f64, [f64; 2]) {
    let (mut sum, mut centre) = (0.0, [0.0; 2]);
    for (i, e) in expected(exposed).iter().enumerate() {
        let e = f64::from(*e);
        sum += e;
        centre[0] += e * (i % exposed.frame.width) as f64;
        centre[1] += e * (i / exposed.frame.width) as f64;
    }
    (sum, centre.map(|c| c / sum))
}

/// The Sun seen from the Earth's centre; ecliptic directions follow from it.
fn sun(epoch: &str) -> Vector3<f64> {
    let observer = observer(epoch, Vector3::zeros());
    observer.sun_m(&Corrections::default()).normalize()
}

/// Clark et al. 2021, Eqs. (3) to (5), by hand for one pixel on the boresight of a pinhole.
#[test]
fn zodiacal_light_is_the_tables_in_electrons() {
    const EPOCH: &str = "2026-06-01T00:00:00 UTC";
    // X-Val: obliquity of J2000.0, 84381.406 arcsec (IAU 2006).
    let (sin, cos) = (84_381.406 / 3600.0f64).to_radians().sin_cos();
    let pole = Vector3::new(0.0, -sin, cos);
    let sun = sun(EPOCH);
    let aside = pole.cross(&sun).normalize();
    let anti = -(sun - pole * sun.dot(&pole)).normalize();
    // X-Val: Leinert et al. 1998, Table 16 (Levasseur-Regourd & Dumont 1980): S10 at the pole, 90
    // and 180 deg from the Sun in the ecliptic.
    for (direction, s10) in [(pole, 60.0), (aside, 202.0), (-aside, 202.0), (anti, 180.0)] {
        let camera = rigel();
        // m = 27.78 - 2.5 log10(S10); L = E_zero 10^(-0.4 m) (180 / pi)^2 3600^2.
        let m = 10.0 + 2.5 * (3600.0f64 * 3600.0).log10() - 2.5 * f64::log10(s10);
        let arcsec2 = (180.0 * 3600.0 / PI).powi(2);
        let radiance = camera.optics.band.zero_point() * 10f64.powf(-0.4 * m) * arcsec2;
        let e = of_radiance(radiance, &camera);
        let exposed = expose_towards(camera, EPOCH, direction, &["zodiacal light"]);
        let seen = f64::from(expected(&exposed)[32 * 64 + 32]);
        // The Earth was at 1.014 au from the Sun: to the power of 2.3, that is 3 % less.
        let is_met = (seen / e / 0.968 - 1.0).abs() < 0.02;
        assert!(is_met, "{s10}: {seen} e-, {e} by hand");
        assert!(exposed.label.background_e_px > 0.9 * seen);
    }
}

/// A Lambert surface seen from straight above: albedo times the solar constant in the band.
#[test]
fn the_day_earth_has_the_radiance_of_its_albedo() {
    let exposed = expose("earth-by-day.toml", 0, &["earth", "limb"]);
    let (camera, detector) = (&exposed.camera, &exposed.camera.detector);
    // X-Val: Meftah et al. 2018 (A&A 611, A1): 1361 W/m^2, with the photons of a black body of 5772
    // K.
    let planck =
        |w: f64| 2.0 * PI * 299_792_458.0 / w.powi(4) / (0.014_387_768_77 / (w * 5772.0)).exp_m1();
    let dilution = 1361.0 / (5.670_374e-8 * 5772f64.powi(4));
    let light = |nm: i32| {
        let w = (f64::from(nm) + 0.5) * 1e-9;
        camera.optics.band.response(w) * planck(w) * 1e-9 * dilution
    };
    let sun: f64 = (350..1050).map(light).sum();
    // X-Val: 40.0 deg from the zenith at 2026-06-01 11:24 (astropy 7, sgp4 2.25); 1.0141 au.
    let cos = 40.0f64.to_radians().cos();
    let radiance = 0.3 * sun * cos / PI / (1.0141 * 1.0141);
    let e = of_radiance(radiance, camera);
    let middle = detector.height / 2 * detector.width + detector.width / 2;
    let seen = f64::from(expected(&exposed)[middle]);
    assert!((seen / e - 1.0).abs() < 0.05, "{seen} e-, {e} by hand");
}

#[test]
fn the_moons_light_and_centre_are_its_labels() {
    for scene in ["moon-in-field.toml", "limb-by-night.toml"] {
        let exposed = expose(scene, 0, &["moon", "smear"]);
        let (sum, centre) = moments(&exposed);
        let moon = moon(&exposed);
        let off = (centre[0] - moon.x_px).hypot(centre[1] - moon.y_px);
        assert!(off < 2e-3, "{scene}: {off} px");
        assert!((sum / moon.electrons - 1.0).abs() < 1e-4, "{scene}: {sum}");
        assert!((moon.electrons / all_e(&exposed) - 1.0).abs() < 1e-6);
    }
}

/// The Earth blocks all light of the sky; stars below the limb are hidden.
#[test]
fn the_earth_occults_the_sky_behind_it() {
    let effects = ["zodiacal light", "starlight", "stars"];
    let exposed = expose("limb-by-night.toml", 0, &effects);
    let (width, height) = (exposed.frame.width, exposed.frame.height);
    let e = expected(&exposed);
    // The lower rows see the ground.
    let ground: f32 = e[(height - 40) * width..].iter().sum();
    assert_eq!(ground, 0.0);
    assert!(e[..width].iter().all(|e| *e > 50.0));
    let stars = || exposed.label.objects.iter();
    let hidden = stars().filter(|star| star.reason.as_deref() == Some("behind the Earth"));
    let below = hidden.map(|star| star.y_px).fold(f64::INFINITY, f64::min);
    let seen = stars().filter(|star| star.visible);
    let above = seen.map(|star| star.y_px).fold(0.0, f64::max);
    // The limb is curved: over 128 px it falls by some 20 px.
    let is_curved = below > 120.0 && (below - above).abs() < 30.0;
    assert!(is_curved, "{below} {above}");
}

#[test]
fn the_sun_within_the_exclusion_angle_saturates_the_frame() {
    let effects = ["sunlight", "stars", "full well"];
    let [outside, inside] = [0, 7].map(|frame| expose("near-sun.toml", frame, &effects));
    let detector = &inside.camera.detector;
    for (exposed, is_inside) in [(&outside, false), (&inside, true)] {
        let label = &exposed.label;
        assert_eq!(
            (label.sun_excluded, label.sun_deg < 30.0),
            (is_inside, is_inside)
        );
        let full = exposed
            .frame
            .dn
            .iter()
            .all(|dn| *dn >= detector.saturation_dn());
        assert_eq!(full, is_inside);
    }
    // No object is visible in it.
    assert!(inside.label.objects.iter().all(|object| !object.visible));
    // The veil outside: the same on all pixels, E PST A QE t.
    let veil = expose("near-sun.toml", 0, &["sunlight"]);
    let optics = &veil.camera.optics;
    let scattered = optics.stray.pst(veil.label.sun_deg.to_radians());
    let sunlight = optics.band.sun_irradiance() / (1.0141 * 1.0141) * scattered;
    let area = detector.pitch_m * detector.pitch_m;
    let e = sunlight * area * detector.quantum_efficiency * veil.camera.exposure_s;
    let [first, last] = [0, 511 * 512 + 511].map(|pixel| f64::from(expected(&veil)[pixel]));
    let is_met = (first / e - 1.0).abs() < 2e-3 && first == last;
    assert!(is_met, "{first} {last} {e}");
}
