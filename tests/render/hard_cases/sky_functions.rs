//! The sky's functions, attitudes and plots, with non-finite numbers: see `functions`.

use super::functions::Permitted::{self, Anything, Finite, LightOrNone};
use super::functions::{check, corrupted};
use super::stage::{noon, oem};
use nalgebra::{Unit, Vector3};
use skyloop::attitude::{Attitude, angle_between, degrees_of_turn};
use skyloop::camera::Band;
use skyloop::config::Config;
use skyloop::light_curve::{Point, Span, point_from};
use skyloop::orbit::StateVector;
use skyloop::output::{Dot, Scatter, write_light_curve, write_scatter};
use skyloop::scene::{Exposure, turn_at};
use skyloop::sky::apparent::{Sight, StarMotion, StarPlace};
use skyloop::sky::atmosphere::air::{Air, chapman, cross_section_m2, phase_function};
use skyloop::sky::bodies::{AU_M, Bodies, aberrate};
use skyloop::sky::body_attitude::BodyAttitude;
use skyloop::sky::catalog::{Catalog, Selection};
use skyloop::sky::moon::MoonDisc;
use skyloop::sky::photometry::{
    Sphere, diffuse_phase, magnitude, photon_irradiance, photon_radiance,
};
use skyloop::sky::planets::seen_by;
use skyloop::sky::radiation::flux;
use skyloop::sky::shadow::Earth;
use skyloop::sky::shape::{Ends, Lobe, Plate, Shape, Surface};
use skyloop::sky::starlight::StarLight;
use skyloop::sky::zodiacal::{ZodiacalLight, distance_factor};
use skyloop::sky::{Atmosphere, Corrections, EarthDisc, Limb, Observer, Population, StarField};
use std::sync::{Arc, LazyLock};

fn earth() -> Earth {
    Earth::at(noon())
}

fn sun_m() -> Vector3<f64> {
    Bodies::at(noon()).unwrap().sun_apparent_m()
}

/// 500 km above the ground.
fn observer_m() -> Vector3<f64> {
    Vector3::new(6.87e6, 1e5, 2e5)
}

/// Two vectors, with one or the other corrupted.
fn either_corrupted(
    a: Vector3<f64>,
    b: Vector3<f64>,
    bad: f64,
) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let first = corrupted(a, bad).map(|corrupted| (corrupted, b));
    [first, corrupted(b, bad).map(|corrupted| (a, corrupted))].concat()
}

/// Lines of sight to an Earth, a Moon or an atmosphere.
fn lines_of_sight() -> [Vector3<f64>; 4] {
    let down = -observer_m().normalize();
    [
        down,
        Vector3::new(0.1, 0.9, 0.4),
        Vector3::z(),
        down + Vector3::y() * 2.3,
    ]
}

#[test]
fn photometry_with_non_finite_numbers() {
    check(&[
        ("diffuse_phase", Permitted::Light, |bad| {
            vec![diffuse_phase(bad)]
        }),
        ("Sphere::reflective_area", Permitted::Light, |bad| {
            let mut areas = vec![Sphere::default().reflective_area(bad)];
            let set: [fn(&mut Sphere) -> &mut f64; 4] = [
                |sphere| &mut sphere.diameter_m,
                |sphere| &mut sphere.reflectance,
                |sphere| &mut sphere.diffuse,
                |sphere| &mut sphere.specular,
            ];
            for set in set {
                let mut sphere = Sphere::default();
                *set(&mut sphere) = bad;
                areas.push(sphere.reflective_area(1.0));
            }
            areas
        }),
        ("magnitude", LightOrNone, |bad| {
            let light = |m: f64| photon_irradiance(1e10, m);
            vec![
                light(magnitude(bad, AU_M, 1e6)),
                light(magnitude(1.0, bad, 1e6)),
                light(magnitude(1.0, AU_M, bad)),
            ]
        }),
        ("photon_irradiance, photon_radiance", LightOrNone, |bad| {
            vec![photon_irradiance(1e10, bad), photon_radiance(1e10, bad)]
        }),
    ]);
}

#[test]
fn sky_light_with_non_finite_positions() {
    check(&[
        ("EarthDisc", Permitted::Light, |bad| {
            let mut light = Vec::new();
            for (at, sun) in either_corrupted(observer_m(), sun_m(), bad) {
                let Some(disc) = EarthDisc::new(at, sun, earth()) else {
                    continue;
                };
                light.extend(lines_of_sight().map(|line| disc.reflectance(&line)));
                light.extend(disc.patches(20).iter().map(|patch| patch.irradiance));
                disc.edge();
            }
            let disc = EarthDisc::new(observer_m(), sun_m(), earth()).unwrap();
            light.extend(corrupted(lines_of_sight()[0], bad).map(|line| disc.reflectance(&line)));
            light
        }),
        ("Limb", LightOrNone, |bad| {
            static AIR: LazyLock<Arc<Atmosphere>> =
                LazyLock::new(|| Arc::new(Atmosphere::of(&Band::named("v").unwrap())));
            let mut light = Vec::new();
            let mut evaluate = |limb: &Limb, line: &Vector3<f64>| {
                light.extend(limb.parts(line));
                light.extend([limb.radiance(line), limb.ground_transmission(line)]);
            };
            for (at, sun) in either_corrupted(observer_m(), sun_m(), bad) {
                if let Some(limb) = Limb::new(&AIR, at, sun, earth()) {
                    lines_of_sight()
                        .iter()
                        .for_each(|line| evaluate(&limb, line));
                    limb.edge();
                }
            }
            let limb = Limb::new(&AIR, observer_m(), sun_m(), earth()).unwrap();
            let lines_of_sight = corrupted(lines_of_sight()[3], bad);
            lines_of_sight.iter().for_each(|line| evaluate(&limb, line));
            light
        }),
        ("Air, Airglow", LightOrNone, |bad| {
            let air = Air::standard();
            let glow = Atmosphere::of(&Band::named("v").unwrap());
            vec![
                air.at(bad).molecules_m3,
                air.column(bad, 0.3),
                air.column(1e4, bad),
                glow.airglow().emission(bad),
                phase_function(bad),
            ]
        }),
        ("chapman, cross_section_m2", Anything, |bad| {
            vec![
                chapman(bad, 0.3),
                chapman(800.0, bad),
                cross_section_m2(bad),
            ]
        }),
        ("MoonDisc", Permitted::Light, |bad| {
            let moon_m = Vector3::new(3.8e8, 1e7, 0.0);
            let mut light = Vec::new();
            for (moon_m, sun_m) in either_corrupted(moon_m, sun_m(), bad) {
                let disc = MoonDisc::new(moon_m, sun_m);
                disc.magnitude();
                light.extend([Vector3::x(), Vector3::y()].map(|at| disc.brightness(&at)));
            }
            let disc = MoonDisc::new(moon_m, sun_m());
            light.extend(corrupted(Vector3::x(), bad).map(|at| disc.brightness(&at)));
            light
        }),
        ("ZodiacalLight, of any Sun", Finite, |bad| {
            let light = |sun: Vector3<f64>| ZodiacalLight::new(&sun).s10(&Vector3::y());
            corrupted(sun_m(), bad).map(light).to_vec()
        }),
        ("ZodiacalLight, StarLight", LightOrNone, |bad| {
            let (zodiac, stars) = (
                ZodiacalLight::new(&sun_m()),
                StarLight::new(Selection::Hipparcos),
            );
            let lines_of_sight = corrupted(Vector3::y(), bad);
            let light = lines_of_sight.map(|line| [zodiac.s10(&line), stars.s10(&line)]);
            [light.as_flattened(), &[distance_factor(bad)]].concat()
        }),
        ("sky::radiation::flux", Permitted::Light, |bad| {
            corrupted(observer_m(), bad)
                .map(|at| flux(&at, noon()))
                .to_vec()
        }),
    ]);
    // For a non-finite position, as documented.
    assert_eq!(flux(&Vector3::repeat(f64::NAN), noon()), 1.8);
}

/// A cylinder with ends, a box, a hinged plate and a ball, of that surface.
fn body(length_m: f64, surface: Surface) -> Shape {
    let mut shape = Shape::default();
    let ends = Ends {
        base: true,
        top: true,
    };
    shape.cone(Vector3::z_axis(), [2.0, 1.0], length_m, ends, surface);
    shape.cone(Vector3::x_axis(), [length_m, 1.0], 3.0, ends, surface);
    shape.cuboid([1.0, length_m, 2.0], surface);
    shape.sphere(length_m, surface);
    let mut plate = Plate::new(length_m, Vector3::x_axis());
    plate.two_sided = true;
    plate.hinge = Some(Vector3::y_axis());
    shape.plate(plate, surface);
    shape
}

#[test]
fn shapes_and_light_curves_with_non_finite_numbers() {
    const PAINT: Surface = Surface {
        reflectance: 0.2,
        diffuse: 0.7,
        specular: 0.3,
        lobe: Lobe::Smooth(0.1),
    };
    check(&[
        ("sky::shape", Permitted::Light, |bad| {
            let [sun, seen] = [Vector3::new(0.6, 0.0, 0.8), Vector3::new(0.0, 0.6, 0.8)];
            let mut light = vec![body(bad, PAINT).reflective_area(&sun, &seen, 5e-3)];
            let set: [fn(&mut Surface, f64); 4] = [
                |surface, bad| surface.reflectance = bad,
                |surface, bad| surface.diffuse = bad,
                |surface, bad| surface.specular = bad,
                |surface, bad| surface.lobe = Lobe::Smooth(bad),
            ];
            for set in set {
                for lobe in [PAINT.lobe, Lobe::Mirror] {
                    let mut surface = Surface { lobe, ..PAINT };
                    set(&mut surface, bad);
                    let shape = body(2.0, surface);
                    light.push(shape.reflective_area(&sun, &seen, 5e-3));
                    assert!(shape.detail(5e-3) >= 0.0);
                }
            }
            let shape = body(2.0, PAINT);
            shape.detail(bad);
            light.push(shape.reflective_area(&sun, &seen, bad));
            for corrupted in corrupted(sun, bad) {
                light.push(shape.reflective_area(&corrupted, &seen, 5e-3));
                light.push(shape.reflective_area(&seen, &corrupted, 5e-3));
            }
            let skewed = Unit::new_unchecked(Vector3::new(bad, 0.0, 1.0));
            let mut shape = Shape::default();
            shape.plate(Plate::new(1.0, skewed), PAINT);
            light.push(shape.reflective_area(&sun, &seen, 5e-3));
            light
        }),
        ("light_curve::point_from", Anything, |bad| {
            let mut config = Config::defaults().unwrap();
            let (r, v) = (Vector3::new(7500.0, 0.0, 0.0), Vector3::new(0.0, 7.3, 0.0));
            config.objects = oem("PASSER", noon(), |s| (r + v * s, v));
            let population: Population = config.take_population();
            let at = |position_m, velocity_m_s, exposure_s: f64| {
                let state = StateVector {
                    position_m,
                    velocity_m_s,
                };
                let corrections = &config.sky.corrections;
                point_from(&population, 0, state, corrections, noon(), exposure_s)
            };
            let v = Vector3::new(0.0, 7.5e3, 0.0);
            let mut points = vec![at(observer_m(), v, bad)];
            points.extend(corrupted(observer_m(), bad).map(|r| at(r, v, 0.1)));
            points.extend(corrupted(v, bad).map(|v| at(observer_m(), v, 0.1)));
            for point in points.into_iter().flatten() {
                let seen = [point.range_m, point.phase, point.illumination];
                assert!(seen.iter().all(|x| *x >= 0.0), "{bad:e}: {point:?}");
                assert!(point.band_mag().is_none_or(f64::is_finite), "{point:?}");
            }
            Vec::new()
        }),
    ]);
}

#[test]
fn attitudes_and_angles_with_non_finite_numbers() {
    check(&[
        ("Attitude::towards, turned", Finite, |bad| {
            let base = Attitude::towards(0.3, 0.4, 0.5);
            let mut all = vec![
                Attitude::towards(bad, 0.4, 0.5),
                Attitude::towards(0.3, bad, 0.5),
                Attitude::towards(0.3, 0.4, bad),
                base.turned(&Vector3::x(), bad),
            ];
            all.extend(corrupted(Vector3::x(), bad).map(|rates| base.turned(&rates, 2.0)));
            let norms = all.iter().map(|attitude| {
                let norm = attitude.rotate(&Vector3::z()).norm();
                assert!((norm - 1.0).abs() < 1e-12, "{bad:e}: {attitude:?}");
                norm
            });
            norms.collect()
        }),
        ("Exposure, turn_at", Anything, |bad| {
            let exposure = Exposure::around(noon(), bad);
            assert!(exposure.start <= exposure.end || bad < 0.0);
            let turns = corrupted(Vector3::x(), bad).map(|rates| turn_at(rates, 0.1));
            let turns = turns.into_iter().chain([turn_at(Vector3::x() * 0.1, bad)]);
            assert!(turns.flatten().all(|turn| turn >= 0.0 || turn.is_nan()));
            Vec::new()
        }),
        ("angle_between, degrees_of_turn", LightOrNone, |bad| {
            let apart = corrupted(Vector3::x(), bad).map(|v| angle_between(&v, &Vector3::y()));
            [&apart[..], &[degrees_of_turn(bad)]].concat()
        }),
    ]);
}

#[test]
fn directions_with_non_finite_positions() {
    check(&[
        ("sky::apparent, planets, StarField", Anything, |bad| {
            static STARS: LazyLock<StarField> = LazyLock::new(|| {
                let catalog = Catalog::embedded(Selection::Bsc);
                StarField::new(catalog, &Band::named("v").unwrap(), true)
            });
            let bodies = Bodies::at(noon()).unwrap();
            let (v, corrections) = (Vector3::new(0.0, 7.5e3, 0.0), Corrections::default());
            for (position_m, velocity_m_s) in either_corrupted(observer_m(), v, bad) {
                let observer = Observer {
                    epoch: noon(),
                    position_m,
                    velocity_m_s,
                    bodies: bodies.after(bad),
                };
                seen_by(&observer, &corrections);
                observer.sun_m(&corrections);
                observer.moon_m(&corrections);
                STARS.in_cone(&Vector3::x(), 0.1, &observer, &corrections);
                aberrate(Vector3::x(), velocity_m_s);
            }
            let observer = Observer {
                epoch: noon(),
                position_m: observer_m(),
                velocity_m_s: v,
                bodies,
            };
            STARS.in_cone(&Vector3::x(), bad, &observer, &corrections);
            for axis in corrupted(Vector3::x(), bad) {
                STARS.in_cone(&axis, 0.1, &observer, &corrections);
            }
            for k in 0..5 {
                let mut figures = [1.0, 0.5, 1e-6, 1e-6, 1e-6];
                figures[k] = bad;
                let [ra_rad, dec_rad, parallax_rad, east, north] = figures;
                let star_place = StarPlace {
                    ra_rad,
                    dec_rad,
                    parallax_rad,
                    pm_ra_cosdec_rad_yr: east,
                    pm_dec_rad_yr: north,
                };
                Sight::of(&observer, &corrections).of_star(&StarMotion::of(&star_place));
            }
            Vec::new()
        }),
        ("BodyAttitude", Anything, |bad| {
            let state = |position_m, velocity_m_s| StateVector {
                position_m,
                velocity_m_s,
            };
            let v = Vector3::new(0.0, 7.5e3, 0.0);
            for bad in corrupted(v, bad) {
                let spin = BodyAttitude::Spin {
                    epoch: noon(),
                    attitude: Attitude::identity(),
                    rates: bad,
                };
                for attitude in [spin, BodyAttitude::Nadir(Attitude::identity())] {
                    for state in [state(bad, v), state(observer_m(), bad)] {
                        let later = noon() + hifitime::Unit::Day * 9;
                        attitude.matrix(later, &state);
                        attitude.rate(&state);
                    }
                }
            }
            Vec::new()
        }),
    ]);
}

#[test]
fn plots_with_non_finite_numbers() {
    check(&[
        ("write_light_curve, Span", Anything, |bad| {
            let folder = tempfile::tempdir().unwrap();
            let span = Span {
                from: noon(),
                step_s: bad,
                points: 3,
                exposure_s: bad,
            };
            let points = span.epochs().enumerate().map(|(i, epoch)| Point {
                epoch,
                mag: if i == 1 { bad } else { 5.0 },
                range_m: bad,
                phase: bad,
                illumination: bad,
                hidden: None,
            });
            let points: Vec<Point> = points.collect();
            write_light_curve(folder.path(), "none", &points).unwrap();
            Vec::new()
        }),
        ("write_scatter", Anything, |bad| {
            let folder = tempfile::tempdir().unwrap();
            let dot = |at| Dot {
                at,
                name: "dot".to_string(),
                is_large: true,
                is_front: true,
            };
            let plot = Scatter {
                title: "none".to_string(),
                axes: ["across", "up"],
                dots: vec![dot([1.0, 2.0]), dot([bad, 3.0]), dot([4.0, bad])],
                limit: Some((bad, "limit".to_string())),
            };
            write_scatter(folder.path(), "none.svg", &plot).unwrap();
            Vec::new()
        }),
    ]);
}
