//! The atmosphere's light against an independent radiative transfer model and physical laws.

use std::f64::consts::PI;
use std::sync::Arc;

use crate::earth::{axes, earth};
use crate::reference::{number, rows, vector};
use nalgebra::Vector3;
use skyloop::camera::Band;
use skyloop::sky::atmosphere::air::{Air, cross_section_m2};
use skyloop::sky::bodies::AU_M;
use skyloop::sky::shadow::EARTH_RADIUS_M;
use skyloop::sky::{Atmosphere, EarthDisc, Limb};

fn band(from_nm: f64, to_nm: f64) -> (Band, Arc<Atmosphere>) {
    let band = Band::top_hat(from_nm * 1e-9, to_nm * 1e-9);
    let atmosphere = Arc::new(Atmosphere::of(&band));
    (band, atmosphere)
}

/// A line along the equator past the Earth, its tangent point above `x`: the observer at
/// `altitude_m`, and the direction.
fn past(tangent_m: f64, altitude_m: f64) -> (Vector3<f64>, Vector3<f64>) {
    let [x, y, _] = axes();
    let (p, r) = (EARTH_RADIUS_M + tangent_m, EARTH_RADIUS_M + altitude_m);
    (x * p - y * (r * r - p * p).sqrt(), y)
}

/// The Sun over `x`: zenith distance and azimuth from the line of sight, deg.
fn sun(zenith_deg: f64, azimuth_deg: f64) -> Vector3<f64> {
    let [x, y, pole] = axes();
    let (sin, cos) = zenith_deg.to_radians().sin_cos();
    let (across, along) = azimuth_deg.to_radians().sin_cos();
    (x * cos + (y * along + pole * across) * sin) * AU_M
}

/// Scattered light and airglow in a band, ph/s/m^2/sr.
fn parts(
    atmosphere: &Arc<Atmosphere>,
    (observer, direction): (Vector3<f64>, Vector3<f64>),
    sun_m: Vector3<f64>,
) -> [f64; 2] {
    let limb = Limb::new(atmosphere, observer, sun_m, earth()).unwrap();
    limb.parts(&direction)
}

#[test]
fn the_day_limb_is_that_of_a_full_calculation() {
    let mut bands = std::collections::BTreeMap::new();
    let (mut sum, mut count) = (0.0, 0);
    for row in rows(include_str!("../reference/limb.csv")) {
        let nm = number(&row, 0);
        let (band, atmosphere) = bands
            .entry(nm as i64)
            .or_insert_with(|| band(nm - 1.0, nm + 1.0));
        let line = past(number(&row, 4), 600e3);
        let [x, y, pole] = axes();
        let [up, along, across] = vector(&row, 1).into();
        let sun_m = (x * up + y * along + pole * across) * AU_M;
        let [scattered, _] = parts(atmosphere, line, sun_m);
        let ratio = scattered / band.sun_irradiance() / number(&row, 5);
        // Multiple scattering is only partly included; most is missing in the blue.
        let min = if nm < 500.0 { 0.75 } else { 0.82 };
        assert!((min..1.05).contains(&ratio), "{row:?}: {ratio}");
        sum += ratio;
        count += 1;
    }
    println!("mean of {count}: {:.3}", sum / f64::from(count));
    assert!((sum / f64::from(count) - 0.92).abs() < 0.02 && count == 288);
}

#[test]
fn above_the_thick_air_the_limb_falls_by_e_a_scale_height() {
    let (_, atmosphere) = band(795.0, 805.0);
    let at = |tangent_m| parts(&atmosphere, past(tangent_m, 800e3), sun(50.0, 70.0))[0];
    // X-Val: US Standard Atmosphere 1976: 2.135e22, 6.439e21 and 1.722e21 1/m^3 at 50, 60 and 70
    // km. The scale height changes by 10 to 15 % between them; the path length goes with its root.
    assert!((at(50e3) / at(60e3) / (2.135 / 0.6439) - 1.0).abs() < 0.08);
    assert!((at(60e3) / at(70e3) / (6.439 / 1.722) - 1.0).abs() < 0.08);
    // Grazing, optically thin, without light from below: E s P / (4 pi) n sqrt(2 pi r H), H = 7.5
    // km from the densities about 60 km.
    let (band, atmosphere) = band(799.0, 801.0);
    let dusk = parts(&atmosphere, past(60e3, 800e3), sun(90.0, 90.0))[0];
    let column = 6.439e21 * (2.0 * PI * (EARTH_RADIUS_M + 60e3) * 7.9e3).sqrt();
    // X-Val: cross-section at 800 nm 9.88e-32 m^2 by Bates, phase function across 0.7603.
    let law = band.sun_irradiance() * 9.88e-32 * 0.7603 / (4.0 * PI) * column;
    assert!((dusk / law - 1.0).abs() < 0.08, "{}", dusk / law);
}

#[test]
fn straight_down_by_day_the_air_adds_its_optical_depth() {
    let [x, y, _] = axes();
    let (band, atmosphere) = band(795.0, 805.0);
    // X-Val: 2.1532e29 1/m^2 of air at 9.88e-32 m^2: 0.02127.
    let depth = Air::standard().column(0.0, 1.0) * cross_section_m2(800e-9);
    assert!((depth / 0.02127 - 1.0).abs() < 0.01, "{depth}");
    for zenith_deg in [0.0f64, 35.0, 60.0] {
        let (sin, cos) = zenith_deg.to_radians().sin_cos();
        let observer = x * (EARTH_RADIUS_M + 900e3);
        let [scattered, _] = parts(&atmosphere, (observer, -x), (x * cos + y * sin) * AU_M);
        // Single scattering in thin air: tau P / (4 pi); plus the day side's light from half the
        // sky: tau 2 A cos / (4 pi).
        let phase = 0.7603 + (1.4794 - 0.7603) * cos * cos;
        let law = depth / (4.0 * PI) * (phase + 2.0 * 0.3 * cos);
        let ratio = scattered / band.sun_irradiance() / law;
        // Margin for attenuation and for the curvature of the ground seen from 8 km.
        assert!((0.9..1.0).contains(&ratio), "{zenith_deg}: {ratio}");
    }
}

#[test]
fn with_its_air_the_day_side_keeps_its_albedo() {
    let [x, y, _] = axes();
    let observer = x * (EARTH_RADIUS_M + 600e3);
    let named = |name| Band::named(name).unwrap();
    for band in [named("silicon"), named("v"), Band::top_hat(650e-9, 1100e-9)] {
        let atmosphere = Arc::new(Atmosphere::of(&band));
        for sun_deg in [0.0f64, 30.0, 55.0, 70.0] {
            let (sin, cos) = sun_deg.to_radians().sin_cos();
            let sun = (x * cos + y * sin) * AU_M;
            let limb = Limb::new(&atmosphere, observer, sun, earth()).unwrap();
            let disc = EarthDisc::new(observer, sun, earth()).unwrap();
            for (view_deg, max) in [(0.0f64, 0.05), (20.0, 0.08), (40.0, 0.18)] {
                let (side, down) = view_deg.to_radians().sin_cos();
                if sun_deg + view_deg > 100.0 {
                    continue; // air outshines the ground there
                }
                let direction = -x * down - y * side;
                let ground = disc.reflectance(&direction) * band.sun_irradiance();
                let seen =
                    ground * limb.ground_transmission(&direction) + limb.radiance(&direction);
                let (ratio, name) = (seen / ground, band.name());
                let is_met = (ratio - 1.0).abs() < max;
                assert!(is_met, "{name} {sun_deg} {view_deg}: {ratio}");
            }
        }
    }
}

#[test]
fn twilight_climbs_and_night_has_airglow_alone() {
    let (_, atmosphere) = band(600.0, 700.0);
    // The Sun across the line, 6 deg below the local horizon: its shadow reaches up to a (1 / cos 6
    // deg - 1) = 35 km.
    let at =
        |tangent_m: f64, zenith| parts(&atmosphere, past(tangent_m, 900e3), sun(zenith, 90.0))[0];
    let day = |tangent_m| at(tangent_m, 70.0);
    let [low, high] = [20e3, 70e3].map(|tangent_m| at(tangent_m, 96.0) / day(tangent_m));
    assert!(low < 0.02 && high > 0.5, "{low} {high}");
    // At 30 deg below the horizon all is dark up to 700 km.
    assert_eq!(at(50e3, 150.0), 0.0);
    let mut before = f64::INFINITY;
    for tenths in 850..1100 {
        let now = at(40e3, f64::from(tenths) / 10.0);
        assert!(now <= before * 1.0001, "{tenths}: {before:e} {now:e}");
        let is_even = before - now < 0.05 * day(40e3) || before.is_infinite();
        assert!(is_even, "{tenths}");
        before = now;
    }
    let [scattered, airglow] = parts(&atmosphere, past(88e3, 900e3), sun(150.0, 0.0));
    assert!(scattered == 0.0 && airglow > 0.0);
}

#[test]
fn airglow_is_brightest_at_the_limb_of_its_layer_and_follows_van_rhijn() {
    let night = sun(160.0, 0.0);
    let [x, ..] = axes();
    for (from_nm, to_nm, peaks_m) in [(629.0, 631.0, 180e3..260e3), (650.0, 1100.0, 82e3..90e3)] {
        let (_, atmosphere) = band(from_nm, to_nm);
        let glow = |tangent_m| parts(&atmosphere, past(tangent_m, 1_200e3), night)[1];
        let zenith = atmosphere.airglow().zenith();
        let heights = (0..350).map(|km| f64::from(km) * 1e3);
        let brightest = heights
            .max_by(|a, b| glow(*a).total_cmp(&glow(*b)))
            .unwrap();
        assert!(peaks_m.contains(&brightest), "{brightest}");
        // Straight down each layer counts once.
        let observer = x * (EARTH_RADIUS_M + 1_200e3);
        let nadir = parts(&atmosphere, (observer, -x), night)[1];
        assert!((nadir / zenith - 1.0).abs() < 0.02, "{}", nadir / zenith);
        // Van Rhijn's law for a layer above the tangent point: each altitude counts twice over its
        // cosine, sqrt(1 - (p / r)^2).
        let p = EARTH_RADIUS_M + 45e3;
        let layer = |k: i32| {
            let h = (f64::from(k) + 0.5) * 100.0;
            let part = p / (EARTH_RADIUS_M + h);
            atmosphere.airglow().emission(h) * 100.0 * 2.0 / (1.0 - part * part).sqrt()
        };
        let ratio = glow(45e3) / (500..7_000).map(layer).sum::<f64>();
        assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
    }
}

#[test]
fn the_a_band_airglow_follows_einsteins_coefficients() {
    // X-Val: 344 R of the (0-1) band by PALACE, times 18.65: 6.4 kR in the zenith. 1 R is 7.958e8
    // ph/s/m^2/sr.
    let (_, atmosphere) = band(759.0, 769.0);
    let zenith = atmosphere.airglow().zenith() / 7.958e8;
    assert!((6_300.0..6_700.0).contains(&zenith), "{zenith}");
    let glow = |tangent_m| parts(&atmosphere, past(tangent_m, 700e3), sun(160.0, 0.0))[1];
    // A Chapman layer of scale height H seen on edge: about zenith / (e H) sqrt(2 pi r H)
    // e^(1/2)...: between 50 and 100 times the zenith.
    let edge = glow(91e3) / 7.958e8 / zenith;
    assert!((50.0..100.0).contains(&edge), "{edge}");
}

#[test]
fn light_is_even_and_finite_from_any_altitude() {
    let [x, y, pole] = axes();
    let (_, atmosphere) = band(650.0, 1100.0);
    for position in [x, pole, (x + pole).normalize()] {
        for altitude in [100e3, 325e3, 699e3, 701e3, 1_500e3, 35_786e3, 384_400e3] {
            for sun_m in [position + y * 0.2, y, y - position * 0.1, -position] {
                let observer = position * (EARTH_RADIUS_M + altitude);
                let limb =
                    Limb::new(&atmosphere, observer, sun_m.normalize() * AU_M, earth()).unwrap();
                let [_, greatest] = limb.edge();
                let inside = greatest == PI;
                let is_low = altitude < 690e3 || (altitude < 700e3 && position == x);
                assert_eq!(inside, is_low, "{altitude}");
                let side = position.cross(&(x * 0.3 + y * 0.7)).normalize();
                let ahead = |angle: f64| side * angle.sin() - position * angle.cos();
                let end = greatest.min(3.0);
                // The largest step of a scan, except for steps across the ground's edge, where the
                // line continues behind it. A line to the ground shortens with the root of the
                // angle from the edge: with steps eight times finer its changes are at least 2.8
                // times smaller.
                let jump = |steps: u32| {
                    let at = |k: u32| ahead(end * f64::from(k) / f64::from(steps));
                    let mut before = (limb.radiance(&at(0)), true);
                    let mut jump = 0.0f64;
                    for k in 1..=steps {
                        let light = limb.radiance(&at(k));
                        assert!(light.is_finite() && light >= 0.0);
                        let ground = earth().occults_direction(observer, at(k));
                        if ground == before.1 {
                            jump = jump.max((light - before.0).abs());
                        }
                        before = (light, ground);
                    }
                    jump
                };
                let (coarse, fine) = (jump(8_000), jump(64_000));
                let is_even = coarse > 0.0 && fine < 0.5 * coarse;
                assert!(is_even, "{altitude}: {coarse:e} {fine:e}");
                if !inside {
                    assert_eq!(limb.radiance(&ahead(greatest + 1e-6)), 0.0);
                }
            }
        }
    }
    assert!(Limb::new(&atmosphere, Vector3::zeros(), x * AU_M, earth()).is_none());
}

#[test]
fn views_just_inside_and_outside_the_top_agree() {
    let (_, atmosphere) = band(620.0, 640.0);
    for sun_m in [sun(40.0, 60.0), sun(97.0, 20.0)] {
        for tangent in [0.5e3, 15e3, 47e3, 88e3, 160e3, 300e3] {
            let [inside, outside] = [699.9e3, 700.1e3].map(|altitude| {
                let (observer, _) = past(60e3, altitude);
                let limb = Limb::new(&atmosphere, observer, sun_m, earth()).unwrap();
                // The same line, about the observer's own nadir.
                let (up, y) = (observer.normalize(), axes()[1]);
                let flat = (y - up * y.dot(&up)).normalize();
                let sin = (EARTH_RADIUS_M + tangent) / observer.norm();
                limb.parts(&(flat * sin - up * (1.0 - sin * sin).sqrt()))
            });
            for k in [0, 1] {
                let even = (inside[k] - outside[k]).abs() <= 0.03 * outside[k];
                assert!(even, "{tangent}: {inside:?} {outside:?}");
            }
        }
    }
}
