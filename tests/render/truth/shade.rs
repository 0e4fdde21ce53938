//! The Earth's shadow and occultation by the Earth, in frames and labels.

use crate::fixtures::{dark, noise_free};
use nalgebra::Vector3;
use skyloop::config::Config;
use skyloop::engine::ExposedFrame;
use skyloop::label::ObjectLabel;
use skyloop::orbit::Object;
use skyloop::sky::bodies::{Bodies, SUN_RADIUS_M};

use super::brute::{apparent, epoch, expose, falling, look_at, oem, orbit};

const AT: &str = "2019-06-15T23:35:50";
const EQUATOR_KM: f64 = 6378.137;
const POLE_KM: f64 = 6356.752;

/// Unit vector to the Sun, and one across it near the plane of the equator.
fn sun() -> (Vector3<f64>, Vector3<f64>) {
    let sun = Bodies::at(epoch(AT)).unwrap().sun_apparent_m().normalize();
    (sun, sun.cross(&Vector3::z()).normalize())
}

/// FAI at `from`, pointed at `target` (km, km/s); labels as by default. With the paper's sphere.
fn expose_target(
    from: (Vector3<f64>, Vector3<f64>),
    target: (Vector3<f64>, Vector3<f64>),
    roll: f64,
) -> (ExposedFrame, ObjectLabel) {
    let objects = oem("TARGET", epoch(AT), falling(target.0, target.1));
    let exposed = expose_objects(from, objects, target.0 - from.0, roll);
    let objects = &exposed.label.objects;
    let target = objects.iter().find(|o| o.id == "TARGET").cloned();
    let target = target.expect("objects that would be bright are listed, lit or not");
    (exposed, target)
}

fn expose_objects(
    from: (Vector3<f64>, Vector3<f64>),
    objects: Vec<Object>,
    aim: Vector3<f64>,
    roll: f64,
) -> ExposedFrame {
    let defaults = Config::defaults().unwrap();
    let label_snr = defaults.label_snr;
    let config = Config {
        objects,
        label_snr,
        ..dark(defaults)
    };
    let mut emulator = noise_free(config);
    let (q, orbit) = (look_at(aim, roll), orbit(from.0, from.1));
    expose(&mut emulator, epoch(AT), q, [0.0; 3], orbit)
}

/// Expected electrons of the pixel that holds the label's centroid, background included.
fn pixel(exposed: &ExposedFrame, o: &ObjectLabel) -> f64 {
    let (column, row) = (o.x_px.round() as usize, o.y_px.round() as usize);
    f64::from(exposed.frame.expected_e.as_ref().unwrap()[row * exposed.frame.width + column])
}

#[test]
fn in_the_umbra_there_is_no_light_and_a_reason() {
    let (sun, across) = sun();
    let velocity = across * 7.5;
    let from = (-sun * 7000.0, velocity);
    let (exposed, o) = expose_target(from, (-sun * 7300.0 + across * 40.0, velocity), 0.1);
    let rso = o.rso.as_ref().unwrap();
    let light = (rso.illumination, o.electrons, o.snr, o.band_mag);
    assert_eq!(light, (0.0, 0.0, 0.0, None));
    assert!(o.in_frame && !o.visible && o.mag.is_finite());
    assert_eq!(o.reason.as_deref(), Some("in the Earth's shadow"));
    assert!(exposed.json.contains("\"band_mag\":null"));
    let light = pixel(&exposed, &o) - exposed.label.background_e_px;
    assert!(light.abs() < 0.5, "light without a star");
    // The same object on the other side of the Earth shines.
    let target = (sun * 7000.0 + across * 40.0, velocity);
    let (exposed, o) = expose_target((sun * 7300.0, velocity), target, 0.1);
    assert!(o.rso.unwrap().illumination == 1.0 && o.electrons > 1e3);
    assert!(!exposed.json.contains("Earth's shadow"));
}

/// The part of the Sun's disc seen past the ellipsoid from `at` (km), ray by ray.
fn sunlit_part(at: Vector3<f64>) -> f64 {
    let sun = Bodies::at(epoch(AT)).unwrap().sun_apparent_m() * 1e-3;
    let line = sun - at;
    let (u, radius) = (line.cross(&Vector3::z()).normalize(), SUN_RADIUS_M * 1e-3);
    let v = u.cross(&line).normalize();
    // Stretched along the axis (here the GCRF's: 0.1 degree from the pole of date, some 40 m at the
    // limb).
    let stretch = |p: Vector3<f64>| Vector3::new(p.x, p.y, p.z * EQUATOR_KM / POLE_KM);
    let (mut free, mut all) = (0, 0);
    const N: i32 = 400;
    for i in -N..=N {
        for j in -N..=N {
            if i * i + j * j > N * N {
                continue;
            }
            let ray = line + (u * f64::from(i) + v * f64::from(j)) * (radius / f64::from(N));
            let (p, d) = (stretch(at), stretch(ray));
            let nearest = p.cross(&d).norm() / d.norm();
            all += 1;
            free += i32::from(p.dot(&d) >= 0.0 || nearest > EQUATOR_KM);
        }
    }
    f64::from(free) / f64::from(all)
}

#[test]
fn in_the_penumbra_the_light_is_a_part_of_the_whole() {
    let (sun, across) = sun();
    let velocity = sun.cross(&across) * 7.5;
    let (mut partial, mut last) = (0, 1.0);
    let at = |offset: f64| {
        let position = -sun * 2500.0 + across * offset;
        let from = (position + (across - sun).normalize() * 300.0, velocity);
        let (exposed, o) = expose_target(from, (position, velocity), 0.4);
        (position, exposed, o)
    };
    // The penumbra is 23 km wide there.
    for step in 0..14 {
        let offset = 6400.0 - 5.0 * f64::from(step);
        let (position, exposed, o) = at(offset);
        let rso = o.rso.as_ref().unwrap();
        let miss = rso.illumination - sunlit_part(position);
        assert!(miss.abs() < 5e-3, "{offset}");
        let whole = exposed.camera.electrons_per_second_at_zero()
            * 10f64.powf(-0.4 * o.mag)
            * exposed.label.exposure_s;
        assert!((o.electrons - whole * rso.illumination).abs() <= 1e-9 * whole);
        assert!(rso.illumination <= last);
        last = rso.illumination;
        if rso.illumination > 0.0 && rso.illumination < 1.0 {
            partial += 1;
            let dimmed = o.band_mag.unwrap() - o.mag;
            assert!((dimmed + 2.5 * rso.illumination.log10()).abs() < 1e-9);
            assert!(pixel(&exposed, &o) > exposed.label.background_e_px + 0.15 * o.electrons);
        }
    }
    assert!(partial >= 2 && last == 0.0, "{partial} {last}");

    // Almost in the umbra the object is too faint, and the label gives the reason.
    let (mut dark, mut lit) = (6335.0, 6400.0);
    let faint = (0..40).find_map(|_| {
        let middle = 0.5 * (dark + lit);
        let o = at(middle).2;
        let illumination = o.rso.as_ref().unwrap().illumination;
        let side = if illumination > 0.0 {
            &mut lit
        } else {
            &mut dark
        };
        *side = middle;
        (illumination > 0.0).then_some(o).filter(|o| o.snr < 3.0)
    });
    let reason = faint.expect("some light remains").reason.unwrap();
    let expected = "too faint, in the Earth's penumbra: snr ";
    assert!(reason.starts_with(expected), "{reason}");
}

#[test]
fn behind_the_earth_there_is_neither_object_nor_star() {
    let (sun, across) = sun();
    let velocity = sun.cross(&across) * 7.5;
    // The Earth's disc is 140 degrees wide from this position: it fills the frame.
    let from = (across * 6800.0, velocity);
    let target = -across * 7000.0 + sun * 2000.0;
    let objects = oem("TARGET", epoch(AT), falling(target, velocity));
    let exposed = expose_objects(from, objects, target - from.0, 1.0);
    assert!(exposed.label.objects.iter().all(|o| o.id != "TARGET"));
    assert_eq!(exposed.label.unseen["behind the Earth"], ["TARGET"]);
    let stars = || exposed.label.objects.iter().filter(|o| o.kind == "star");
    assert!(stars().count() > 20);
    for star in stars() {
        assert_eq!((star.electrons, star.visible), (0.0, false));
        assert!(!star.in_frame || star.reason.as_deref() == Some("behind the Earth"));
    }
    let dark = exposed.label.background_e_px as f32;
    assert!(exposed.frame.expected_e.unwrap().iter().all(|e| *e == dark));
}

#[test]
fn across_the_limb_the_frame_has_stars_on_one_side_only() {
    let (sun, across) = sun();
    let from = (across * 7000.0, sun * 7.5);
    // The limb, 65.7 degrees from the nadir: asin(6378 / 7000), 6357 at the poles.
    let dip = (EQUATOR_KM / 7000.0f64).asin();
    let aim = -across * dip.cos() + sun * dip.sin();
    let target = oem("TARGET", epoch(AT), falling(from.0 + aim * 300.0, from.1));
    let exposed = expose_objects(from, target, aim, 0.0);
    let (mut hidden, mut seen) = (0, 0);
    for star in exposed.label.objects.iter().filter(|o| o.kind == "star") {
        let depth = apparent(star).angle(&-across) - dip;
        // The ellipsoid and aberration leave a rim of 0.5 degree undecided.
        if depth.abs() > 0.01 {
            assert_eq!(star.electrons > 0.0, depth > 0.0, "{star:?}");
            if depth > 0.0 { seen += 1 } else { hidden += 1 }
        }
    }
    assert!(hidden > 20 && seen > 20, "{hidden} {seen}");
}
