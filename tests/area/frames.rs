//! Whole frames: what the paper's equations, geometry and the labels say of them.

use nalgebra::Vector3;
use skyloop::attitude::VehicleState;
use skyloop::camera::Camera;
use skyloop::config::Config;
use skyloop::effect::EFFECTS;
use skyloop::engine::{Emulator, Shot};
use skyloop::load::Folder;
use skyloop::sky::bodies::Bodies;
use skyloop::sky::{Corrections, Observer};
use std::f64::consts::PI;
use std::path::Path;

/// A frame of one scene with those effects alone.
fn shoot(scene: &str, frame: u32, effects: &[&str]) -> Shot {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/scenes");
    let mut config = Config::load(&folder.join(scene)).unwrap();
    let mission = skyloop::flight::mission(&config).unwrap();
    let vehicle = skyloop::flight::vehicle(&mission, frame).unwrap();
    let mut emulator = Emulator::new(&mut config);
    only(&mut emulator, effects);
    emulator.shoot(&vehicle, 0).unwrap()
}

pub fn only(emulator: &mut Emulator, effects: &[&str]) {
    emulator.keep_expected = true;
    let others = EFFECTS.iter().map(|effect| effect.name);
    let kept = |name: &&str| !effects.contains(name) && *name != "readout";
    emulator.choice.off = others.filter(kept).collect();
}

/// A frame of a small camera at the Earth's centre that looks along `direction`.
fn look(camera: Camera, epoch: &str, direction: Vector3<f64>, effects: &[&str]) -> Shot {
    let mut config = Config::defaults().unwrap();
    config.camera = camera;
    let mut emulator = Emulator::new(&mut config);
    only(&mut emulator, effects);
    let turn = nalgebra::UnitQuaternion::rotation_between(&direction, &Vector3::z()).unwrap();
    let q = [turn.i, turn.j, turn.k, turn.w];
    let vehicle = VehicleState::new(0, epoch.parse().unwrap(), q, [0.0; 3], None).unwrap();
    emulator.shoot(&vehicle, 0).unwrap()
}

fn rigel() -> Camera {
    let mut camera = Camera::load("rigel-l", &Folder::current()).unwrap();
    (camera.detector.width, camera.detector.height) = (64, 64);
    camera.optics.principal_px = [31.5, 31.5];
    camera
}

pub fn expected(shot: &Shot) -> &[f32] {
    shot.frame.expected_e.as_deref().unwrap()
}

/// Sum and centre of a frame's expected electrons.
pub fn moments(shot: &Shot) -> (f64, [f64; 2]) {
    let (mut sum, mut centre) = (0.0, [0.0; 2]);
    for (i, e) in expected(shot).iter().enumerate() {
        let e = f64::from(*e);
        sum += e;
        centre[0] += e * (i % shot.frame.width) as f64;
        centre[1] += e * (i / shot.frame.width) as f64;
    }
    (sum, centre.map(|c| c / sum))
}

/// The Sun as it is seen from the Earth's centre: ecliptic directions follow from it.
fn sun(epoch: &str) -> Vector3<f64> {
    let epoch = epoch.parse().unwrap();
    let observer = Observer {
        epoch,
        position_m: Vector3::zeros(),
        velocity_m_s: Vector3::zeros(),
        bodies: Bodies::at(epoch).unwrap(),
    };
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
    // X-Val: Leinert et al. 1998, Table 16 (Levasseur-Regourd & Dumont 1980): S10 at the pole, 90 and 180 deg from the Sun in the ecliptic.
    for (direction, s10) in [(pole, 60.0), (aside, 202.0), (-aside, 202.0), (anti, 180.0)] {
        let camera = rigel();
        let (optics, detector) = (&camera.optics, &camera.detector);
        // m = 27.78 - 2.5 log10(S10); L = E_zero 10^(-0.4 m) (180 / pi)^2 3600^2.
        let m = 10.0 + 2.5 * (3600.0f64 * 3600.0).log10() - 2.5 * f64::log10(s10);
        let radiance = optics.band.zero_point()
            * 10f64.powf(-0.4 * m)
            * (180.0 / PI).powi(2)
            * 3600.0
            * 3600.0;
        let ifov = detector.pitch_m / (optics.focal_px * detector.pitch_m);
        let area = PI * optics.aperture_m * optics.aperture_m / 4.0;
        let e = radiance
            * ifov
            * ifov
            * detector.quantum_efficiency
            * optics.transmission
            * area
            * camera.exposure_s;
        let shot = look(camera, EPOCH, direction, &["zodiacal light"]);
        let seen = f64::from(expected(&shot)[32 * 64 + 32]);
        // The Earth was 1.014 au from the Sun: 2.3 times that is 3 % less.
        assert!(
            (seen / e / 0.968 - 1.0).abs() < 0.02,
            "{s10}: {seen} e-, {e} by hand"
        );
        assert!(shot.label.background_e_px > 0.9 * seen);
    }
}

/// Albedo times the solar constant in the band, of a Lambert surface, as it is seen from straight above.
#[test]
fn the_day_earth_fills_a_frame_with_what_its_albedo_demands() {
    let shot = shoot("earth-by-day.toml", 0, &["earth", "limb"]);
    let camera = &shot.camera;
    let (optics, detector) = (&camera.optics, &camera.detector);
    // X-Val: Meftah et al. 2018 (A&A 611, A1): 1361 W/m^2, of which a black body of 5772 K has its photons.
    let planck =
        |w: f64| 2.0 * PI * 299_792_458.0 / w.powi(4) / (0.014_387_768_77 / (w * 5772.0)).exp_m1();
    let dilution = 1361.0 / (5.670_374e-8 * 5772f64.powi(4));
    let sun: f64 = (350..1050)
        .map(|nm| {
            let w = (f64::from(nm) + 0.5) * 1e-9;
            optics.band.response(w) * planck(w) * 1e-9 * dilution
        })
        .sum();
    // X-Val: 40.0 deg from the zenith at 2026-06-01 11:24 (astropy 7, sgp4 2.25); 1.0141 au.
    let cos = 40.0f64.to_radians().cos();
    let radiance = 0.3 * sun * cos / PI / (1.0141 * 1.0141);
    let area = PI * optics.aperture_m * optics.aperture_m / 4.0;
    let solid_angle = 1.0 / (optics.focal_px * optics.focal_px);
    let e = radiance
        * solid_angle
        * area
        * optics.transmission
        * detector.quantum_efficiency
        * camera.exposure_s;
    let middle = detector.height / 2 * detector.width + detector.width / 2;
    let seen = f64::from(expected(&shot)[middle]);
    assert!((seen / e - 1.0).abs() < 0.05, "{seen} e-, {e} by hand");
}

#[test]
fn the_moons_light_and_centre_are_its_labels() {
    for scene in ["moon-in-field.toml", "limb-by-night.toml"] {
        let shot = shoot(scene, 0, &["moon", "smear"]);
        let (sum, centre) = moments(&shot);
        let moon = shot
            .label
            .objects
            .iter()
            .find(|object| object.kind == "moon")
            .unwrap();
        let off = (centre[0] - moon.x_px).hypot(centre[1] - moon.y_px);
        assert!(off < 2e-3, "{scene}: {off} px");
        assert!((sum / moon.electrons - 1.0).abs() < 1e-4, "{scene}: {sum}");
        // Clark et al. 2021, Eqs. (1), (2).
        let e = shot.camera.electrons_per_second_at_zero()
            * 10f64.powf(-0.4 * moon.mag)
            * shot.camera.exposure_s;
        assert!((moon.electrons / e - 1.0).abs() < 1e-6);
    }
}

/// No light of the sky comes through the Earth, and stars below the limb are hidden.
#[test]
fn the_earth_hides_what_is_behind_it() {
    let shot = shoot(
        "limb-by-night.toml",
        0,
        &["zodiacal light", "starlight", "stars"],
    );
    let (width, height) = (shot.frame.width, shot.frame.height);
    let e = expected(&shot);
    // The lower rows see the ground.
    let ground: f32 = e[(height - 40) * width..].iter().sum();
    assert_eq!(ground, 0.0);
    assert!(e[..width].iter().all(|e| *e > 50.0));
    let hidden = shot
        .label
        .objects
        .iter()
        .filter(|star| star.reason.as_deref() == Some("behind the Earth"));
    let below = hidden.map(|star| star.y_px).fold(f64::INFINITY, f64::min);
    let seen = shot
        .label
        .objects
        .iter()
        .filter(|star| star.visible)
        .map(|star| star.y_px);
    let above = seen.fold(0.0, f64::max);
    // The limb is curved: over 128 px it falls some 20.
    assert!(
        below > 120.0 && (below - above).abs() < 30.0,
        "{below} {above}"
    );
}

#[test]
fn within_its_exclusion_angle_the_sun_fills_every_pixel_and_the_label_says_so() {
    let outside = shoot("near-sun.toml", 0, &["sunlight", "stars", "full well"]);
    assert!(!outside.label.sun_excluded && outside.label.sun_deg > 30.0);
    let inside = shoot("near-sun.toml", 7, &["sunlight", "stars", "full well"]);
    assert!(inside.label.sun_excluded && inside.label.sun_deg < 30.0);
    let detector = &inside.camera.detector;
    assert!(
        inside
            .frame
            .digits
            .iter()
            .all(|dn| *dn >= detector.saturation_dn())
    );
    assert!(
        outside
            .frame
            .digits
            .iter()
            .any(|dn| *dn < detector.saturation_dn())
    );
    // Nothing is seen in it.
    assert!(inside.label.objects.iter().all(|object| !object.visible));
    // The veil outside: the same on all pixels, E PST A QE t.
    let veil = shoot("near-sun.toml", 0, &["sunlight"]);
    let stray = &detector.pitch_m;
    let angle = veil.label.sun_deg.to_radians();
    let e = veil.camera.optics.band.sun_irradiance() / (1.0141 * 1.0141)
        * veil.camera.optics.stray.pst(angle)
        * stray
        * stray
        * detector.quantum_efficiency
        * veil.camera.exposure_s;
    let [first, last] = [expected(&veil)[0], expected(&veil)[511 * 512 + 511]].map(f64::from);
    assert!(
        (first / e - 1.0).abs() < 2e-3 && first == last,
        "{first} {last} {e}"
    );
}
