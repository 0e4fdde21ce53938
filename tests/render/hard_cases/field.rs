//! Edges of the field: directions behind and next to the camera, corners of pixels, bands and
//! detectors, fields from a tenth of a degree to half of the sky, and lenses close to their fold.

use super::stage::{
    Light, alone, behind, camera, emulator, epoch, light, moments, noon, share_along, square,
    starry, still, unit, vehicle,
};
use nalgebra::Vector3;
use skyloop::attitude::Attitude;
use skyloop::camera::{Camera, Model, Projection};
use skyloop::fidelity::Fidelity;
use std::f64::consts::{FRAC_PI_2, PI};

/// A Gaussian's share of the square from -1/2 to 1/2 around `off`, of that width: closed form.
fn share(off: [f64; 2], sigma: f64) -> f64 {
    off.map(|x| share_along(x, sigma)).iter().product()
}

/// Unit vector `angle` rad from the boresight, in the direction `around` (rad from +X).
fn off_axis(angle: f64, around: f64) -> Vector3<f64> {
    let ((sin, cos), (y, x)) = (angle.sin_cos(), around.sin_cos());
    Vector3::new(sin * x, sin * y, cos)
}

/// Sources behind the camera or across its boresight give no light, however bright. Reference:
/// zero.
#[test]
fn light_behind_or_across_a_pinhole_is_excluded() {
    let camera = camera("");
    let emulator = emulator(camera, Fidelity::REALTIME, |_| {});
    let attitude = Attitude::identity();
    let mut directions = vec![-Vector3::z(), Vector3::x(), -Vector3::y()];
    for beyond in [-1e-9, -1e-16, 0.0, 1e-16, 2.0 - FRAC_PI_2, FRAC_PI_2 - 1e-9] {
        directions.extend([0.0, 1.0, 4.0].map(|around| off_axis(FRAC_PI_2 + beyond, around)));
    }
    let lights = directions.into_iter();
    let lights: Vec<Light> = lights.map(|to| Light::new(to, 1e12)).collect();
    for rates in [[0.0; 3], [1e-9, 0.0, 0.0], [300.0, 200.0, 100.0]] {
        let lit = light(&emulator, &vehicle(&attitude, rates), &lights);
        assert!(lit.expected_e.iter().all(|e| *e == 0.0), "{rates:?}");
    }
}

/// A source that enters the field from behind during an exposure gives light for its time in the
/// field. Reference: 64 px at 2,000 px per radian are a field of 1.83 deg. At 300 deg/s for 0.1 s
/// any crossing star gives `64 / (2000 * 0.5236)` of its light.
#[test]
fn a_star_that_sweeps_the_field_gives_its_share_of_light() {
    let camera = camera("");
    let emulator = emulator(camera.clone(), Fidelity::REALTIME, |_| {});
    let attitude = Attitude::identity();
    // Across the columns, through the middle of the field at mid-exposure.
    let vehicle = vehicle(&attitude, [0.0, 300.0, 0.0]);
    let lit = alone(&emulator, &vehicle, Vector3::z(), 1e6);
    let sum: f64 = lit.expected_e.iter().sum();
    // Equal steps of time are equal steps of angle: 64 px subtend 2 atan(32 / 2000).
    let expected = 1e6 * 2.0 * (32.0_f64 / 2000.0).atan() / (0.1 * 300_f64.to_radians());
    assert!((sum / expected - 1.0).abs() < 1e-5, "{sum} {expected}");
}

/// Lights on corners and edges of pixels, on the seams of bands (32 rows) and on the detector's
/// edges. Reference: the Gaussian integrated in closed form over every pixel. Tolerance: a
/// millionth of the light, `psf_loss`, and f32.
#[test]
fn lights_on_seams_and_corners_have_the_shares_of_the_closed_form() {
    let camera = camera("detector.width_px = 70; detector.height_px = 66");
    let emulator = emulator(camera.clone(), Fidelity::REALTIME, |_| {});
    let attitude = Attitude::towards(1.0, 0.5, 0.0);
    for at in [
        [31.5, 31.5],
        [31.5, 32.0],
        [32.0, 63.5],
        [0.0, 0.0],
        [-0.5, -0.5],
        [69.5, 65.5],
        [69.499_999_999, 0.0],
        [69.500_000_001, 65.0],
        [69.0, -0.5],
        [34.5, 31.5 + 1e-12],
    ] {
        let direction = behind(&camera, &attitude, at);
        let lit = alone(&emulator, &still(&attitude), direction, 1e6);
        for (i, e) in lit.expected_e.iter().enumerate() {
            let off = [(i % 70) as f64 - at[0], (i / 70) as f64 - at[1]];
            let expected = 1e6 * share(off, 0.8);
            let miss = (e - expected).abs();
            assert!(
                miss < 0.1 + 1e-6 * expected,
                "{at:?} pixel {i}: {e} {expected}"
            );
        }
        let source = &lit.scene.sources[0];
        let inside = camera.detector.contains(at);
        // To the last digit of a position on the detector.
        let [x, y] = source.centroid;
        assert!((x - at[0]).hypot(y - at[1]) < 1e-11, "{at:?}");
        assert!(inside || at[0] >= 69.5, "{at:?}");
    }
}

/// A star one last digit beyond the upper edge is not in the frame; one on the lower edge is.
/// Reference: the contract, `[-0.5, columns - 0.5)`.
#[test]
fn the_last_pixels_edge_belongs_to_no_pixel() {
    let detector = camera("").detector;
    assert!(detector.contains([-0.5, 63.5_f64.next_down()]));
    assert!(!detector.contains([63.5, 0.0]) && !detector.contains([(-0.5_f64).next_down(), 0.0]));
}

/// Cameras of fields from a tenth of a degree to half of the sky: 512 px each.
fn cameras() -> Vec<(f64, Camera)> {
    let of = |mm: f64, keys: &str| {
        let optics = format!("optics.focal_length_mm = {mm:?}; optics.aperture_mm = 1.0; {keys}");
        square(512, &optics)
    };
    let half = |deg: f64| (deg / 2.0).to_radians();
    let fisheye = "optics.projection = { model = \"fisheye\", k = [0.0] }";
    let narrow = [0.1, 1.0, 10.0, 60.0, 120.0].map(|deg| (deg, of(2.56 / half(deg).tan(), "")));
    let wide = [120.0, 180.0].map(|deg| (deg, of(2.56 / half(deg), fisheye)));
    narrow.into_iter().chain(wide).collect()
}

/// Reference: the projections' closed forms, `f tan` and `f` times the angle; 1e-9 px, and 1e-16
/// rad times the scale of the narrowest.
#[test]
fn fields_of_a_tenth_of_a_degree_to_half_the_sky_image_as_their_formula() {
    for (deg, camera) in cameras() {
        let emulator = emulator(camera.clone(), Fidelity::REALTIME, |_| {});
        let attitude = Attitude::identity();
        let f = camera.optics.focal_px;
        for (part, around) in [(0.0, 0.0_f64), (0.3, 1.0), (0.9, 2.5), (0.99, -2.0)] {
            let angle = part * (deg / 2.0_f64).to_radians();
            let (sin, cos) = around.sin_cos();
            let direction = off_axis(angle, around);
            let radius = match camera.optics.projection.model() {
                Model::Fisheye { .. } => f * angle,
                _ => f * angle.tan(),
            };
            let at = [255.5 + radius * cos, 255.5 + radius * sin];
            let lit = alone(&emulator, &still(&attitude), direction, 1e5);
            let [x, y] = lit.scene.sources[0].centroid;
            let miss = (x - at[0]).hypot(y - at[1]);
            assert!(miss < 1e-9 + 4e-16 * f, "{deg} deg, {part}: {miss:e} px");
            let (sum, [x, y]) = moments(&lit.expected_e, 512);
            let miss = (x - at[0]).hypot(y - at[1]);
            assert!(
                (sum / 1e5 - 1.0).abs() < 2e-6 && miss < 1e-4,
                "{deg} deg, {part}"
            );
        }
    }
}

/// At half the field angle the image is on the detector's edge, which gets half of its light.
/// Reference: the same closed forms, and a half. Tolerance: `psf_loss` and f32.
#[test]
fn at_half_the_field_an_image_stands_on_the_detectors_edge() {
    for (deg, camera) in cameras() {
        let emulator = emulator(camera.clone(), Fidelity::REALTIME, |_| {});
        let angle = (deg / 2.0_f64).to_radians();
        for (x, y) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
            let direction = Vector3::new(angle.sin() * x, angle.sin() * y, angle.cos());
            let lit = alone(&emulator, &still(&Attitude::identity()), direction, 1e5);
            let [column, row] = lit.scene.sources[0].centroid;
            let miss = (column - 255.5 - 256.0 * x).hypot(row - 255.5 - 256.0 * y);
            let bound = 1e-9 + 4e-16 * camera.optics.focal_px;
            assert!(miss < bound, "{deg} deg: {miss:e} px");
            let sum: f64 = lit.expected_e.iter().sum();
            assert!((sum / 1e5 - 0.5).abs() < 2e-6, "{deg} deg: {sum}");
        }
    }
}

/// The scale decides whether images move; its error is an error of smear. Reference: a pinhole's
/// scale is f in the middle and `f (1 + tan^2)` at the corners; 1e-6.
#[test]
fn the_scale_of_a_narrow_field_is_its_focal_length() {
    for mm in ["20.0", "1000.0", "20000.0", "1e6"] {
        let keys = format!("optics.focal_length_mm = {mm}; optics.aperture_mm = 500.0");
        let camera = camera(&keys);
        let f = camera.optics.focal_px;
        let tan = 32.0 * std::f64::consts::SQRT_2 / f;
        let (scale, corner) = camera.scale_and_corner_px();
        let miss = scale / (f * (1.0 + tan * tan)) - 1.0;
        assert!(miss.abs() < 1e-5, "{mm} mm: {scale}");
        assert!((corner - 32.0 * std::f64::consts::SQRT_2).abs() < 1e-9);
    }
}

/// A frame of half the sky contains all stars that the closed form puts on its detector, and no
/// other. Reference: the catalogue's apparent directions, one by one.
#[test]
fn half_the_sky_has_all_its_stars() {
    let (_, camera) = cameras().pop().unwrap();
    let emulator = starry(camera.clone(), Fidelity::REALTIME);
    let attitude = Attitude::towards(0.0, FRAC_PI_2, 0.0);
    let vehicle = still(&attitude);
    let scene = emulator
        .scene(&emulator.camera(), &vehicle, 0, &emulator.choice)
        .unwrap();
    let corrections = &emulator.world().corrections;
    let all = emulator
        .world()
        .stars
        .in_cone(&Vector3::z(), 4.0, &scene.view.observer, corrections);
    // From the middle of the detector, px.
    let image = |direction: &Vector3<f64>| {
        let d = attitude.rotate(direction);
        let across = d.x.hypot(d.y);
        let scale = camera.optics.focal_px * across.atan2(d.z) / across;
        [d.x * scale, d.y * scale]
    };
    let on = |centroid: [f64; 2]| camera.detector.contains(centroid);
    let expected = all.iter();
    let expected = expected.filter(|star| on(image(&star.direction).map(|x| 255.5 + x)));
    let found = scene.sources.iter().filter(|source| on(source.centroid));
    let found: Vec<usize> = found.map(|source| source.body.identity().1).collect();
    assert_eq!(found, expected.map(|star| star.index).collect::<Vec<_>>());
    // X-Val: the catalogue's own positions with proper motion, one by one. The neglected aberration
    // (20.5 arcsec), parallax and light deflection are less than 30 arcsec, a fortieth of a pixel.
    let years = (noon() - epoch("1991-04-02T13:30:00")).to_unit(hifitime::Unit::Century) * 100.0;
    let stars = emulator.world().stars.catalog().stars().iter();
    let margins = stars.map(|star| {
        let ra = star.ra_rad + star.pm_ra_cosdec_rad_yr * years / star.dec_rad.cos();
        let dec = star.dec_rad + star.pm_dec_rad_yr * years;
        // Distance (px) beyond the nearest edge.
        let [x, y] = image(&unit(ra, dec));
        x.abs().max(y.abs()) - 256.0
    });
    assert!(found.is_sorted());
    for (index, beyond) in margins.enumerate() {
        let is_found = found.binary_search(&index).is_ok();
        assert!(
            beyond.abs() <= 0.03 || is_found == (beyond < 0.0),
            "{index}: {beyond} px"
        );
    }
}

/// Up to the last digit before the fold, an image has a direction with that image. Beyond it there
/// is no direction.
///
/// Reference: the image, to 1e-13 focal lengths; and the direction. The image's last digits, `e =
/// eps (1 + r)`, are worth `e / r'`. At the fraction d of the range from the fold the image turns
/// as a parabola, `r' = 2 d r / end`: `e / (2 r d)` of the range, and at most `(e / r)^(1/2)` next
/// to the fold. (The other root, as far behind the fold, is off by `2 d`.)
#[test]
fn the_inverse_is_exact_next_to_the_fold() {
    let mut worst = 0.0_f64;
    let brown = |k, p| Projection::new(Model::BrownConrady { k, p });
    let fisheye = |k| Projection::new(Model::Fisheye { k });
    for lens in [
        brown([-0.4, 0.0, 0.0], [0.0; 2]),
        brown([-0.28, 0.09, -0.01], [3e-4, -2e-4]),
        brown([0.0; 3], [0.02, -0.01]),
        brown([-1e6, 0.0, 0.0], [0.0; 2]),
        brown([1e6, -1e6, 1e6], [1e6, -1e6]),
        fisheye([-0.1, 0.0, 0.0, 0.0]),
        fisheye([-1e6, 0.0, 0.0, 0.0]),
        fisheye([1e6, -1e6, 1e6, -1e6]),
        fisheye([0.0; 4]),
    ] {
        let end = lens.end_rad();
        for i in 1..=15 {
            let angle = end * (1.0 - 10f64.powi(-i));
            for around in [0.11, 1.97, 3.83, 5.69_f64] {
                let direction = off_axis(angle, around);
                let what = format!("{lens:?} at 1 - 1e-{i}");
                let at = lens.image(&direction).expect(&what);
                let back = lens.direction(at).expect(&what);
                let again = lens.image(&back).unwrap();
                let miss = (again[0] - at[0]).hypot(again[1] - at[1]);
                let radius = at[0].hypot(at[1]);
                assert!(miss <= 1e-13 * (1.0 + radius), "{what}: {miss:e}");
                let off = (back - direction).norm();
                let dn = f64::EPSILON * (1.0 + radius) / radius;
                let bound = (dn / (2.0 * 10f64.powi(-i))).min(dn.sqrt());
                worst = worst.max(off / end / bound);
                assert!(off <= 4.0 * bound * end, "{what}: {off:e}");
            }
        }
        // Beyond the fold, none.
        for around in [0.0, 0.11, 1.97, 3.83, 5.69_f64] {
            let edge = lens.image(&off_axis(end * (1.0 - 1e-9), around));
            // At 180 deg nothing lies beyond.
            let beyond = lens.image(&off_axis(end * (1.0 + 1e-9), around));
            assert!(beyond.is_none() || end == PI, "{lens:?} {beyond:?}");
            for further in [1.0001, 1.1, 2.0, 1e3, 1e300] {
                let none = lens.direction(edge.unwrap().map(|x| further * x));
                assert_eq!(none, None, "{lens:?} {further}");
            }
        }
    }
    println!("{worst:.1} of what the last digits are worth");
}
