//! Frames full of light: a label without objects always gives the reason.

use super::frames::only;
use crate::fixtures::{Frames, camera, cropped, scene, towards};
use skyloop::attitude::VehicleState;
use skyloop::camera::{Camera, Stray};
use skyloop::config::Config;
use skyloop::engine::{Emulator, ExposedFrame};
use skyloop::load::CAMERAS;
use skyloop::sky::bodies::Bodies;

const EPOCH: &str = "2031-01-27T18:11:12.5 UTC";

/// A frame of a small part of a camera, 150 degrees from the Sun, whose optics scatter the fraction
/// `scatter` of its light.
fn expose(mut camera: Camera, scatter: f64, off: &[&'static str]) -> ExposedFrame {
    camera.optics.stray = Stray::new(&[[0.1, scatter], [3.1, scatter]], 0.0);
    let mut config = Config::defaults().unwrap();
    config.camera = cropped(camera, 64);
    let mut emulator = Emulator::new(&mut config);
    let lights = ["stars", "sunlight", "dark current"];
    let detector = ["shot noise", "full well", "read noise", "pixel response"];
    only(&mut emulator, &[&lights[..], &detector].concat());
    emulator.choice.off.extend(off);
    let epoch = EPOCH.parse().unwrap();
    let sun = Bodies::at(epoch).unwrap().sun_geocentric_m.normalize();
    let side = sun.cross(&nalgebra::Vector3::z()).normalize();
    let look = side * 0.5 - sun * 0.75_f64.sqrt();
    let vehicle = VehicleState::new(1, epoch, towards(&look), [0.0; 3], None).unwrap();
    emulator.expose(&vehicle, 0).unwrap()
}

/// Charge at which a pixel saturates, e-.
fn full_e(camera: &Camera) -> f64 {
    let detector = &camera.detector;
    let reach = (f64::from(detector.max_dn()) - detector.offset_dn) * detector.gain_e_per_dn;
    detector.full_well_e.min(reach)
}

/// Checks the rules of every label; `floods` is the effect that brings the light. The frame's
/// expected electrons, before any full well, show whether it is full.
fn check(exposed: &ExposedFrame, floods: &str, what: &str) {
    let label = &exposed.label;
    let expected = exposed.frame.expected_e.as_ref().unwrap();
    let min = f64::from(expected.iter().copied().fold(f32::INFINITY, f32::min));
    let is_full = min >= full_e(&exposed.camera);
    let flooded_by = is_full.then_some(floods);
    assert_eq!(label.flooded_by, flooded_by, "{what}: {min}");
    let is_empty = label.objects.is_empty();
    assert_eq!(label.no_objects.is_some(), is_empty, "{what}");
    assert_eq!(
        exposed.json.contains("\"no_objects\":\""),
        is_empty,
        "{what}"
    );
    let Some(why) = &label.no_objects else { return };
    let full = format!("every pixel is full: {floods}");
    let faint = "signal-to-noise ratio of 1 or more";
    assert_eq!(*why == full, is_full, "{what}: {why}");
    assert!(is_full || why.contains(faint), "{what}: {why}");
}

#[test]
fn a_label_without_objects_gives_the_reason() {
    let (mut blinded, mut seeing) = (0, 0);
    for name in CAMERAS {
        let camera = || camera(name);
        let full_e = full_e(&camera());
        let unit = expose(camera(), 1e-6, &[]).label.background_e_px;
        let none = expose(camera(), 0.0, &[]).label.background_e_px;
        let levels = [
            0.5, 0.8, 0.9, 0.97, 1.03, 1.1, 1.27, 1.5, 1.9, 2.1, 3.0, 4.0,
        ];
        for wells in levels {
            let scatter = 1e-6 * (wells * full_e - none) / (unit - none);
            let exposed = expose(camera(), scatter, &[]);
            let what = format!("{name} at {wells} full wells");
            check(&exposed, "sunlight", &what);
            let is_empty = exposed.label.objects.is_empty();
            blinded += u32::from(is_empty && (1.1..2.0).contains(&wells));
            seeing += u32::from(!is_empty && wells < 1.0);
        }
    }
    // The test must cover levels between one and two full wells, and labels with objects.
    assert!(blinded > 8 && seeing > 8, "{blinded} {seeing}");
}

/// Dark charge fills wells too. Of a partly full frame without objects the label gives the number
/// of full pixels.
#[test]
fn dark_charge_and_partly_full_frames_are_reported() {
    let mut camera = camera("cots-wide");
    for wells in [0.9, 1.1] {
        camera.exposure_s = wells * full_e(&camera) / camera.detector.dark_e_s;
        let exposed = expose(camera.clone(), 0.0, &["sunlight"]);
        let what = format!("dark charge of {wells} full wells");
        check(&exposed, "dark current", &what);
        assert_eq!(exposed.label.flooded_by.is_some(), wells > 1.0);
    }

    for (times, part) in [
        (1.0, "no object in the field has "),
        (3.0, " % of the pixels are full, "),
    ] {
        let mut config = scene("limb-by-day.toml");
        config.camera.exposure_s *= times;
        let exposed = Frames::of(config).expose(0);
        let why = exposed.label.no_objects.unwrap();
        assert!(why.contains(part), "{why}");
        assert_eq!(exposed.label.flooded_by, None);
    }
}
