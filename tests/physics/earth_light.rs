//! The Earth's disc against the Lambert sphere's closed form, the solar constant, and the limb of
//! the shadow model.

use std::f64::consts::PI;

use crate::earth::{axes, earth};
use nalgebra::Vector3;
use skyloop::camera::{Band, SUN_MAGNITUDE};
use skyloop::sky::EarthDisc;
use skyloop::sky::bodies::AU_M;
use skyloop::sky::earth_light::EARTH_ALBEDO;
use skyloop::sky::photometry::{diffuse_phase, photon_irradiance};
use skyloop::sky::shadow::{EARTH_FLATTENING, EARTH_RADIUS_M};

/// Irradiance of the whole disc over the Sun's at 1 au.
fn total(disc: &EarthDisc, patches: usize) -> f64 {
    disc.patches(patches).iter().map(|p| p.irradiance).sum()
}

#[test]
fn from_afar_the_earth_is_a_lambert_sphere_at_every_phase() {
    let [x, y, _] = axes();
    // In the equator plane the outline has the area pi a b.
    let observer = x * 4e9;
    let area = PI * EARTH_RADIUS_M * EARTH_RADIUS_M * (1.0 - EARTH_FLATTENING);
    for phase_deg in [0.5f64, 30.0, 60.0, 90.0, 120.0, 150.0] {
        let (sin, cos) = phase_deg.to_radians().sin_cos();
        let disc = EarthDisc::new(observer, (x * cos + y * sin) * AU_M, earth()).unwrap();
        // The paper's Eq. (7), (2/3)[(pi - a) cos a + sin a] / pi^2, times albedo and area, over
        // the squared distance.
        let expected = EARTH_ALBEDO * area * diffuse_phase(phase_deg.to_radians()) / 4e9f64.powi(2);
        let magnitudes = -2.5 * (total(&disc, 20_000) / expected).log10();
        println!("phase {phase_deg}: {magnitudes:+.4} mag");
        // The flattening changes the area by 0.004 mag, and a narrow crescent by more.
        assert!(magnitudes.abs() < 0.02, "{phase_deg}: {magnitudes}");
        // The number of patches that stray light uses.
        let few = total(&disc, 400) / expected;
        assert!((few - 1.0).abs() < 0.05, "{phase_deg}: {few}");
    }
}

#[test]
fn from_low_orbit_the_irradiance_is_that_of_a_sphere_seen_from_near() {
    // Sun and observer above the pole: L = A / pi cos(i) over the visible cap, on a surface that
    // faces the centre. With the sphere's i and the observer's nadir angle n, sin(n) = (R/r) sin(n
    // + i): numerically, in steps of cos(n).
    let [_, _, pole] = axes();
    let r = EARTH_RADIUS_M + 700e3;
    let disc = EarthDisc::new(pole * r, pole * AU_M, earth()).unwrap();
    let facing = |p: &skyloop::sky::earth_light::Patch| p.irradiance * -p.direction.dot(&pole);
    let got: f64 = disc.patches(5_000).iter().map(facing).sum();
    let b = EARTH_RADIUS_M * (1.0 - EARTH_FLATTENING);
    let steps = 100_000;
    let max = (b / r).asin();
    let ring = |k: i32| {
        let n = (f64::from(k) + 0.5) * max / f64::from(steps);
        let i = (r / b * n.sin()).min(1.0).asin() - n;
        EARTH_ALBEDO / PI * i.cos() * n.cos() * 2.0 * PI * n.sin() * max / f64::from(steps)
    };
    let sum: f64 = (0..steps).map(ring).sum();
    // The pole lies 21 km deeper than the equator and the surface is flatter: 2 % more is visible
    // than of a sphere with the polar radius.
    assert!((got / sum - 1.0).abs() < 0.025, "{got} {sum}");
}

#[test]
fn a_frame_full_of_day_has_the_radiance_of_albedo_and_solar_constant() {
    // X-Val: a black body of 5772 K that gives 1361 W/m^2 (IAU 2015 Resolution B3), integrated in
    // photons: 1.9047e21 ph/s/m^2 over 650-1100 nm, 1.0084e19 over 629-631 nm. Fraunhofer lines
    // remove some per cent of the latter.
    let bands = [(650.0, 1100.0, 1.9047e21), (629.0, 631.0, 1.0084e19)];
    let [x, y, _] = axes();
    let observer = x * (EARTH_RADIUS_M + 600e3);
    for incidence_deg in [0.0f64, 40.0, 75.0] {
        let (sin, cos) = incidence_deg.to_radians().sin_cos();
        let disc = EarthDisc::new(observer, (x * cos + y * sin) * AU_M, earth()).unwrap();
        let reflectance = disc.reflectance(&-x);
        for (from, to, solar) in bands {
            let band = Band::top_hat(from * 1e-9, to * 1e-9);
            let radiance = reflectance * band.sun_irradiance();
            let ratio = radiance / (0.3 * solar * cos / PI);
            assert!((ratio - 1.0).abs() < 0.05, "{from}: {ratio}");
            // The paper's Eq. (3): magnitude per square arcsecond, and back.
            let arcsec2 = (PI / 648_000.0f64).powi(2);
            let magnitude = SUN_MAGNITUDE - 2.5 * (reflectance * arcsec2).log10();
            let back = photon_irradiance(band.zero_point(), magnitude) / arcsec2;
            assert!((back / radiance - 1.0).abs() < 1e-12);
            // X-Val: by hand: -26.73 - 2.5 log10(0.3 / pi / 206264.8^2) = 2.392 mag/arcsec^2 with
            // the Sun in the zenith.
            let in_zenith = magnitude + 2.5 * cos.log10();
            assert!((in_zenith - 2.392).abs() < 0.001, "{magnitude}");
        }
    }
}

#[test]
fn shading_follows_the_ellipsoids_normal_and_the_suns_distance() {
    let [x, _, pole] = axes();
    // The Sun in the zenith of geodetic latitude 45 deg: the normal leans 0.19 deg from the radius.
    let latitude = PI / 4.0;
    let normal = x * latitude.cos() + pole * latitude.sin();
    // The ellipsoid in geodetic latitude: (N cos, N (1 - f)^2 sin).
    let e2 = EARTH_FLATTENING * (2.0 - EARTH_FLATTENING);
    let n = EARTH_RADIUS_M / (1.0 - e2 * latitude.sin().powi(2)).sqrt();
    let ground = x * (n * latitude.cos()) + pole * (n * (1.0 - e2) * latitude.sin());
    assert!(earth().normal(ground).angle(&normal) < 1e-8);
    let observer = ground + normal * 500e3;
    let met = earth().meets(observer, -normal * 3.0).unwrap();
    assert!((met - ground).norm() < 1e-6, "{}", (met - ground).norm());

    let radiance = |sun: Vector3<f64>| {
        let disc = EarthDisc::new(observer, sun, earth()).unwrap();
        disc.reflectance(&-normal)
    };
    // 85 deg from the zenith, toward the equator and away from it: equal. About the radius they
    // would differ by 4 %.
    let tilt = |deg: f64| {
        let (sin, cos) = deg.to_radians().sin_cos();
        let side = x * -latitude.sin() + pole * latitude.cos();
        (normal * cos + side * sin) * AU_M
    };
    assert!((radiance(tilt(85.0)) / radiance(tilt(-85.0)) - 1.0).abs() < 1e-3);
    assert_eq!(radiance(tilt(91.0)), 0.0);
    let far = radiance(normal * (2.0 * AU_M)) / radiance(normal * AU_M);
    assert!((far - 0.25).abs() < 1e-4);
}

#[test]
fn light_ends_at_the_limb_from_any_position() {
    let [x, y, pole] = axes();
    let lean = (x * 0.5 + pole).normalize();
    for zenith in [x, pole, lean] {
        for altitude in [100e3, 600e3, 35_786e3, 384_400e3] {
            let observer = zenith * (EARTH_RADIUS_M + altitude);
            let disc = EarthDisc::new(observer, (zenith + y * 0.3) * AU_M, earth()).unwrap();
            let [inner_limit, outer_limit] = disc.edge();
            let side = zenith.cross(&(x * 0.3 + y)).normalize();
            let (mut inner, mut outer) = (PI, 0.0f64);
            for k in 0..1_000 {
                let turn = k as f64 * 2.0 * PI / 1e3;
                let out = side * turn.cos() + zenith.cross(&side) * turn.sin();
                let at = |angle: f64| out * angle.sin() - zenith * angle.cos();
                assert!(!earth().occults_direction(observer, at(outer_limit + 1e-9)));
                assert!(earth().occults_direction(observer, at(inner_limit - 1e-9)));
                // The limb by bisection.
                let (mut hit, mut miss) = (inner_limit, outer_limit);
                for _ in 0..40 {
                    let middle = (hit + miss) / 2.0;
                    match earth().meets(observer, at(middle)) {
                        Some(_) => hit = middle,
                        None => miss = middle,
                    }
                }
                (inner, outer) = (inner.min(hit), outer.max(hit));
                assert_eq!(disc.reflectance(&at(miss + 1e-9)), 0.0);
            }
            let is_tight = inner - inner_limit < 3e-5 && outer_limit - outer < 3e-5;
            assert!(is_tight, "{altitude}");
        }
    }
}

#[test]
fn patches_cover_the_disc_and_its_dark_side_is_dark() {
    let [x, y, _] = axes();
    let observer = x * 7e6;
    let disc = EarthDisc::new(observer, (x + y) * AU_M, earth()).unwrap();
    let patches = disc.patches(500);
    assert!(patches.len() <= 500 && patches.len() > 400);
    for patch in &patches {
        assert!((patch.direction.norm() - 1.0).abs() < 1e-12 && patch.irradiance > 0.0);
        assert!(earth().occults_direction(observer, patch.direction));
    }
    let night = EarthDisc::new(observer, x * -AU_M, earth()).unwrap();
    assert!(night.patches(500).is_empty() && night.reflectance(&-x) == 0.0);
    assert!(EarthDisc::new(Vector3::zeros(), x * AU_M, earth()).is_none());
    assert_eq!(disc.reflectance(&x), 0.0);
}
