//! The label's fields: their names, and each against its definition.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use nalgebra::Vector3;
use serde_json::Value;
use skyloop::attitude::{Attitude, VehicleState};
use skyloop::config::Config;
use skyloop::engine::{Emulator, ExposedFrame};
use skyloop::fidelity::Fidelity;
use skyloop::flight;
use skyloop::label::ObjectLabel;
use skyloop::sky::bodies::Bodies;
use skyloop::sky::catalog::Selection;

use super::brute::{apparent, builtin, emulator, epoch, expose, in_camera, matrix, stamp, turning};

// The contract: the names in docs/explanation/labels.md.
const FRAME_KEYS: &str = "frame seed camera columns rows epoch_start epoch_mid epoch_end exposure_s fidelity q_icrf_to_body q_body_to_camera \
    rates_rad_s state_gcrf_km sun_deg sun_excluded r_icrf_to_camera ra_deg dec_deg roll_deg background_e_px effects objects";
const OBJECT_KEYS: &str = "kind id names x_px y_px x0_px y0_px x1_px y1_px vx_px_s vy_px_s mag band_mag electrons snr \
    ra_deg dec_deg in_frame visible";
const RSO_KEYS: &str =
    "range_km range_rate_km_s phase_deg illumination position_gcrf_km velocity_gcrf_km_s";

fn near(a: f64, b: f64, bound: f64, what: &str) {
    assert!((a - b).abs() <= bound, "{what}: {a} against {b}");
}

/// Checks the rules for every object of every frame.
fn check(exposed: &ExposedFrame) {
    let (label, camera) = (&exposed.label, &exposed.camera);
    let dark = camera.detector.dark_e_s * label.exposure_s;
    near(label.background_e_px, dark, 1e-9, "background");
    let turned = matrix(label.q_body_to_camera) * matrix(label.q_icrf_to_body);
    for (i, row) in label.r_icrf_to_camera.iter().enumerate() {
        assert!((turned.row(i).transpose() - Vector3::from(*row)).norm() < 1e-14);
    }
    for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
        assert!((turned * axis - Vector3::from(in_camera(label, axis.into(), 0.0))).norm() < 1e-14);
    }
    // The inverse of `--radec`.
    let angles = [label.ra_deg, label.dec_deg, label.roll_deg].map(f64::to_radians);
    let [ra, dec, roll] = angles;
    assert!((Attitude::towards(ra, dec, roll).matrix() - turned).norm() < 1e-13);
    assert!(label.ra_deg < 360.0 && label.roll_deg < 360.0 && ra >= 0.0 && roll >= 0.0);
    let size = [camera.detector.width, camera.detector.height];
    assert_eq!([label.columns, label.rows], size);
    for object in &label.objects {
        check_object(exposed, object);
    }
    check_json(exposed);
}

fn check_object(exposed: &ExposedFrame, o: &ObjectLabel) {
    let (label, camera) = (&exposed.label, &exposed.camera);
    let [dx, dy] = [o.x1_px - o.x0_px, o.y1_px - o.y0_px];
    near(o.vx_px_s, dx / label.exposure_s, 1e-9, "vx");
    near(o.vy_px_s, dy / label.exposure_s, 1e-9, "vy");
    let length = dx.hypot(dy);
    let pad = 1e-3 + 0.01 * length;
    assert!(o.x_px > o.x0_px.min(o.x1_px) - pad && o.x_px < o.x0_px.max(o.x1_px) + pad);
    assert!(o.y_px > o.y0_px.min(o.y1_px) - pad && o.y_px < o.y0_px.max(o.y1_px) + pad);

    // E = electrons / (QE tau A t), E_zero of the band (Clark et al. 2021, Eqs. (1), (2)).
    let area = PI * camera.optics.aperture_m.powi(2) / 4.0;
    let gathered = camera.detector.quantum_efficiency * camera.optics.transmission * area;
    let irradiance = o.electrons / (gathered * label.exposure_s);
    match o.band_mag {
        Some(band_mag) => {
            let expected = -2.5 * (irradiance / camera.optics.band.zero_point()).log10();
            near(band_mag, expected, 1e-9, "band_mag");
        }
        None => assert_eq!(o.electrons, 0.0),
    }

    // sqrt(sum s^2 / (s + b + read^2 + gain^2 / 12)) over the unsaturated pixels of the detector.
    let detector = &camera.detector;
    let quantisation = detector.gain_e_per_dn.powi(2) / 12.0;
    let floor = label.background_e_px + detector.read_noise_e.powi(2) + quantisation;
    let reach = (f64::from(detector.max_dn()) - detector.offset_dn) * detector.gain_e_per_dn;
    let full = reach.min(detector.full_well_e) - label.background_e_px;
    let (_, light) = stamp(label, o, camera);
    let lit = light.iter().filter(|s| **s < full);
    let sum: f64 = lit.map(|s| s * s / (s + floor)).sum();
    near(o.snr, sum.sqrt(), 1e-4 * sum.sqrt() + 1e-5, &o.id);

    let (w, h) = (camera.detector.width as f64, camera.detector.height as f64);
    let in_frame = o.x_px >= -0.5 && o.x_px < w - 0.5 && o.y_px >= -0.5 && o.y_px < h - 0.5;
    assert_eq!(o.in_frame, in_frame);
    let shines = o.electrons > 0.0;
    assert_eq!(o.visible, in_frame && shines && o.snr >= 3.0, "{o:?}");
    assert_eq!(o.reason.is_none(), o.visible);
    if let Some(reason) = &o.reason {
        let fits = match reason.as_str() {
            "its centroid is outside the frame" => !in_frame,
            "behind the Earth" | "in the Earth's shadow" => !shines,
            faint => {
                let dimmed = o.rso.as_ref().is_some_and(|rso| rso.illumination < 1.0);
                let is_dim = faint.starts_with("too faint") && faint.contains("penumbra") == dimmed;
                is_dim && shines && o.snr < 3.0
            }
        };
        assert!(fits, "{o:?}");
    }

    // The apparent direction at mid-exposure, projected by the label's own matrix.
    let d = apparent(o);
    let seen = label.r_icrf_to_camera.map(|row| Vector3::from(row).dot(&d));
    let at =
        [0, 1].map(|k| camera.optics.principal_px[k] + camera.optics.focal_px * seen[k] / seen[2]);
    // At rest it is the centroid; the bend of a track moves it off the mean.
    near(at[0], o.x_px, 1e-6 + 1e-2 * length, "x of ra, dec");
    near(at[1], o.y_px, 1e-6 + 1e-2 * length, "y of ra, dec");
    assert!((0.0..360.0).contains(&o.ra_deg) && o.dec_deg.abs() <= 90.0);

    let Some(rso) = &o.rso else { return };
    let [x, y, z, vx, vy, vz] = label.state_gcrf_km;
    let line = Vector3::from(rso.position_gcrf_km) - Vector3::new(x, y, z);
    let relative = Vector3::from(rso.velocity_gcrf_km_s) - Vector3::new(vx, vy, vz);
    near(rso.range_km, line.norm(), 1e-9, "range");
    let rate = line.dot(&relative) / line.norm();
    near(rso.range_rate_km_s, rate, 1e-9, "range rate");
    // Eqs. (7), (9) with the paper's sphere. Light time moves the object by metres.
    let sun = Bodies::at(exposed.exposure.mid).unwrap().sun_apparent_m() * 1e-3;
    let to_sun = sun - Vector3::from(rso.position_gcrf_km);
    let phi = to_sun.angle(&-line);
    near(rso.phase_deg, phi.to_degrees(), 2e-3, "phase");
    let f = 2.0 / (3.0 * PI * PI) * ((PI - phi) * phi.cos() + phi.sin());
    let reflected = 0.2 * PI * 25.0 * f;
    // 1 au^2 of the two distances cancels the reflector's: m = -26.73 - 2.5 log10(rho A F / d^2) +
    // 5 log10(D / au).
    let d2 = (line.norm() * 1e3).powi(2);
    let au = 149_597_870.7;
    let mag = -26.73 - 2.5 * (reflected / d2).log10() + 5.0 * (to_sun.norm() / au).log10();
    near(o.mag, mag, 1e-4, "mag by Eq. 9");
    if rso.illumination == 1.0 && shines {
        near(o.band_mag.unwrap(), o.mag, 1e-9, "in full light");
    }
}

/// The JSON line has the contract's names, and the values except for their last decimals.
fn check_json(exposed: &ExposedFrame) {
    let json: Value = serde_json::from_str(&exposed.json).unwrap();
    let keys = |value: &Value| -> BTreeSet<String> {
        let keys = value.as_object().unwrap().keys();
        keys.cloned().collect()
    };
    let wanted = |lists: &[&str]| -> BTreeSet<String> {
        let keys = lists.iter().flat_map(|list| list.split_whitespace());
        keys.map(String::from).collect()
    };
    assert_eq!(keys(&json), wanted(&[FRAME_KEYS]));
    let listed = json["objects"].as_array().unwrap();
    assert_eq!(listed.len(), exposed.label.objects.len());
    for (text, o) in listed.iter().zip(&exposed.label.objects) {
        let reason = if o.visible { "" } else { "reason" };
        let rso = if o.rso.is_some() { RSO_KEYS } else { "" };
        assert_eq!(keys(text), wanted(&[OBJECT_KEYS, reason, rso]));
        let number = |key: &str| text[key].as_f64().unwrap();
        assert_eq!(text["kind"], o.kind);
        assert_eq!(text["id"], o.id.as_str());
        near(number("x_px"), o.x_px, 1e-6, "x_px");
        let bound = 1e-4 * (1.0 + o.electrons);
        near(number("electrons"), o.electrons, bound, "electrons");
        near(number("snr"), o.snr, 1e-4, "snr");
        near(number("ra_deg"), o.ra_deg, 1e-8, "ra_deg");
        assert_eq!(text["band_mag"].as_f64().is_some(), o.band_mag.is_some());
    }
}

#[test]
fn every_field_matches_its_definition() {
    let orbit = Some(([2.1e6, -5.4e6, 3.9e6], [6.3e3, 3.7e3, 1.8e3]));
    for camera in ["fai-nir", "fai-630", "rigel-l", "cots-wide"] {
        let mut emulator = emulator(camera, Selection::Bsc, Vec::new(), Fidelity::REALTIME);
        for (i, rates) in [[0.0; 3], [-1.0, 2.0, 3.0]].into_iter().enumerate() {
            let q = [0.1, 0.2 + i as f64, -0.3, 0.9];
            let at = epoch("2026-02-11T18:22:41.25");
            let exposed = expose(&mut emulator, at, q, rates, orbit);
            assert!(exposed.label.objects.len() > 10);
            check(&exposed);
        }
    }
}

#[test]
fn objects_in_orbit_are_geometric_at_mid_exposure_and_their_range_rate_is_a_derivative() {
    let mut config = builtin();
    let objects = config.objects.clone();
    let mission = flight::mission(&config).unwrap();
    let mut emulator = Emulator::new(&mut config);
    for number in [1, 30] {
        let vehicle = flight::vehicle(&mission, number).unwrap();
        let exposed = emulator.expose(&vehicle, 0).unwrap();
        check(&exposed);
        let state = vehicle.orbit.as_ref().unwrap();
        let label = &exposed.label;
        assert_eq!(label.state_gcrf_km[0], state.position_m.x * 1e-3);
        assert_eq!(label.state_gcrf_km[5], state.velocity_m_s.z * 1e-3);
        let half = label.exposure_s / 2.0;
        for (text, dt) in [
            (&label.epoch_start, -half),
            (&label.epoch_mid, 0.0),
            (&label.epoch_end, half),
        ] {
            let off = epoch(text.trim_end_matches('Z')) - vehicle.epoch;
            near(off.to_seconds(), dt, 1e-9, "epochs");
        }
        // A tenth of a second to either side: an error of h^2/6 of the third derivative, and
        // rounding.
        let step = hifitime::Duration::from_seconds(0.1);
        let [before, after] = [-step, step].map(|dt| {
            let mut moved: VehicleState = vehicle.at(vehicle.epoch + dt);
            moved.sequence += 1000;
            emulator.expose(&moved, 0).unwrap()
        });
        let range = |exposed: &ExposedFrame, id: &str| {
            let found = exposed.label.objects.iter().find(|o| o.id == id);
            found.and_then(|o| o.rso.as_ref()).unwrap().range_km
        };
        let mut compared = 0;
        for o in label.objects.iter().filter(|o| o.kind == "rso") {
            let rso = o.rso.as_ref().unwrap();
            let object = objects.iter().find(|object| object.id == o.id).unwrap();
            let expected = object.state(vehicle.epoch).unwrap();
            for (label, state) in [
                (rso.position_gcrf_km, expected.position_m),
                (rso.velocity_gcrf_km_s, expected.velocity_m_s),
            ] {
                assert!((state * 1e-3 - Vector3::from(label)).norm() < 1e-12);
            }
            let rate = (range(&after, &o.id) - range(&before, &o.id)) / 0.2;
            near(rso.range_rate_km_s, rate, 3e-5, "range rate");
            compared += 1;
        }
        assert_eq!(compared, 3);
    }
}

#[test]
fn the_list_ends_at_the_requested_snr() {
    assert_eq!(Config::defaults().unwrap().label_snr, 1.0);
    let list = |snr: f64| {
        let mut config = Config {
            label_snr: snr,
            ..Config::defaults().unwrap()
        };
        let mut emulator = Emulator::new(&mut config);
        emulator
            .expose(&turning([0.0; 3]), 0)
            .unwrap()
            .label
            .objects
    };
    let (all, some) = (list(0.0), list(5.0));
    let bright: Vec<_> = all.iter().filter(|o| o.snr >= 5.0).cloned().collect();
    assert!(!some.is_empty() && some.len() < all.len());
    assert_eq!(some, bright.into());
}
