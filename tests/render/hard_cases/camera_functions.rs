//! The camera's functions, and those of tracks and footprints, with non-finite numbers: see
//! `functions`.

use super::functions::Permitted::{self, Anything, Finite, LightOrNone};
use super::functions::{check, corrupted};
use super::stage::camera;
use nalgebra::Vector3;
use skyloop::abort::WorkLimit;
use skyloop::camera::psf::{Airy, Image, Images, Moffat, Psf, Shape as Spread, Variation};
use skyloop::camera::{
    Band, Flux, Pattern, PatternStats, Radiation, Shutter, Stamp, Stray, Vignetting,
};
use skyloop::fidelity::Fidelity;
use skyloop::footprint::{self, Footprint};
use skyloop::rng::{NoiseKey, PixelStream};
use skyloop::track::{Even, Place, Rows, Track, TrackSpec, Window};
use std::sync::{Arc, LazyLock};

/// All functions of a point spread function, at extreme positions and sources too.
fn requested(psf: &Psf, bad: f64) -> Vec<f64> {
    let mut stamp = Stamp::default();
    let fidelity = Fidelity::REALTIME;
    let mut answers = vec![
        psf.sharpness(),
        psf.peak(),
        psf.core_px(),
        psf.reach_px(1e-6),
        psf.reach_px(bad),
        psf.drawn_px(&fidelity, 1e4),
        psf.drawn_px(&fidelity, bad),
        psf.circle_px(&fidelity, bad).unwrap_or(0.0),
    ];
    for local in [psf.at([1.0, 2.0], 1.0), psf.at([bad, 2.0], bad)] {
        answers.extend([local.core_px(), local.reach_px(bad)]);
        answers.push(local.drawn_px(&fidelity, bad));
        for at in [[1.2, 1.4], [bad, 1.4], [1.2, bad]] {
            local.spread(1.0, at, 0..4, 0..4, &mut stamp);
            answers.extend(&stamp.light);
            answers.push(local.on_pixel([at[0], 0.0], &mut stamp));
        }
    }
    answers
}

const KEY: NoiseKey = NoiseKey {
    seed: 1,
    sequence: 2,
    repeat: 0,
};

/// A point spread function constant over the field.
fn even(shape: Spread) -> Psf {
    Psf::new(shape, Variation::default())
}

#[test]
fn spreads_with_non_finite_widths() {
    check(&[
        ("Psf::new, Gaussian", LightOrNone, |bad| {
            let widths = [bad, 0.01, 1.0, 100.0].into_iter();
            widths
                .flat_map(|sigma| requested(&even(Spread::Gaussian(sigma)), bad))
                .collect()
        }),
        ("Psf::new, Moffat and Airy", LightOrNone, |bad| {
            static TABLES: LazyLock<(Arc<Moffat>, Arc<Airy>)> = LazyLock::new(|| {
                let airy = Airy::new(0.3, &[(1.0, 1.0)]);
                (Arc::new(Moffat::new(2.5)), Arc::new(airy))
            });
            let (moffat, airy) = TABLES.clone();
            let shapes = [Spread::Moffat(moffat, bad), Spread::Airy(airy, bad)];
            let answers = shapes.map(|shape| requested(&even(shape), bad));
            answers.concat()
        }),
        ("Psf::new, that varies", LightOrNone, |bad| {
            let variation = |by_field, wavelength_exponent, ratio| Variation {
                by_field,
                wavelength_exponent,
                wavelength_ratios: [ratio, 1.1],
            };
            let all = [
                variation(vec![[0.0, bad]], 0.0, 0.9),
                variation(vec![[0.0, 1.0], [bad, 2.0]], 0.0, 0.9),
                variation(Vec::new(), bad, 0.9),
                variation(Vec::new(), 1.0, bad),
            ];
            let psfs = all.map(|variation| Psf::new(Spread::Gaussian(0.7), variation));
            psfs.iter().flat_map(|psf| requested(psf, bad)).collect()
        }),
        ("Moffat::new", LightOrNone, |bad| {
            let moffat = Arc::new(Moffat::new(bad));
            requested(&even(Spread::Moffat(moffat, 2.0)), 0.5)
        }),
        ("Airy::new", LightOrNone, |bad| {
            let airies = [
                Airy::new(bad, &[(1.0, 1.0)]),
                Airy::new(0.0, &[(bad, 1.0), (1.0, 1.0)]),
                Airy::new(0.0, &[(1.0, bad), (1.1, 1.0)]),
            ];
            let psfs = airies.map(|airy| even(Spread::Airy(Arc::new(airy), 2.0)));
            psfs.each_ref().map(|psf| requested(psf, 0.5)).concat()
        }),
        ("Footprint, of any tolerance", Permitted::Light, |bad| {
            // A constant Gaussian, and one that depends on the wavelength: drawn in lines, and in
            // squares.
            let varied = Variation {
                wavelength_exponent: 1.0,
                ..Variation::default()
            };
            let mut cameras = [camera(""), camera("")];
            cameras[1].optics.psf = Psf::new(Spread::Gaussian(0.8), varied);
            let (at, light) = ([30.2, 31.4], 1.0);
            let track = Track::still(Place { at, light });
            let set: [fn(&mut Fidelity) -> &mut f64; 3] =
                [|f| &mut f.psf_loss, |f| &mut f.loss_e, |f| &mut f.wing_e];
            let mut light = Vec::new();
            for camera in &cameras {
                for set in set {
                    for base in [Fidelity::REALTIME, Fidelity::REFERENCE] {
                        let mut fidelity = base;
                        *set(&mut fidelity) = bad;
                        Footprint::window(camera, &fidelity);
                        for electrons in [1e4, f64::INFINITY, bad] {
                            let source = footprint::Light {
                                electrons,
                                wavelength_ratio: 1.0,
                            };
                            let footprint = Footprint::of(
                                &WorkLimit::default(),
                                &track,
                                camera,
                                &fidelity,
                                &source,
                                None,
                            );
                            let shares = footprint.shares().iter().map(|s| f64::from(*s));
                            // With zero loss, and with the smallest, all light is drawn.
                            let all: f64 = shares.clone().sum();
                            let is_lost = bad > 0.0 || electrons.to_bits() == bad.to_bits();
                            assert!(is_lost || (all - 1.0).abs() < 1e-3, "{bad:e} {all}");
                            light.extend(shares);
                        }
                    }
                }
            }
            light
        }),
    ]);
}

/// The light shares of a track of 60 px through the frame.
fn drawn(change: impl FnOnce(&mut TrackSpec, &mut Fidelity)) -> Vec<f64> {
    drawn_along(|t| ([2.0 + 60.0 * t, 30.0 + 3.0 * t * t], 1.0), 1.0, change)
}

/// The light shares of any track of positions and intensities, of a source of `electrons`.
fn drawn_along(
    along: impl Fn(f64) -> ([f64; 2], f64),
    electrons: f64,
    change: impl FnOnce(&mut TrackSpec, &mut Fidelity),
) -> Vec<f64> {
    static CAMERA: LazyLock<skyloop::camera::Camera> = LazyLock::new(|| camera(""));
    let mut fidelity = Fidelity::REALTIME;
    let mut course = TrackSpec {
        pieces: 2,
        even: None,
        step_px: 0.4,
        panel_px: 0.4,
        point_px: 0.0,
        reach_px: 4.0,
        window: Footprint::window(&CAMERA, &fidelity),
        rows: Rows::together(64),
    };
    change(&mut course, &mut fidelity);
    let position = |t: f64| {
        let (at, light) = along(t);
        Some(Place { at, light })
    };
    let Some(track) = Track::sample(position, &course, &fidelity) else {
        return Vec::new();
    };
    let light = footprint::Light {
        electrons,
        ..footprint::Light::default()
    };
    let footprint = Footprint::of(
        &WorkLimit::default(),
        &track,
        &CAMERA,
        &Fidelity::REALTIME,
        &light,
        None,
    );
    footprint.shares().iter().map(|s| f64::from(*s)).collect()
}

#[test]
fn tracks_with_non_finite_steps() {
    check(&[
        ("Course.step_px", Permitted::Light, |bad| {
            drawn(|course, _| course.step_px = bad)
        }),
        ("Course.step_px, rows in turn", Permitted::Light, |bad| {
            drawn(|course, _| {
                course.rows = Rows::in_turn(64, 0.1, 0.02);
                // Each row has its own share of each panel.
                course.step_px = if bad > 0.0 { bad.max(0.1) } else { 0.1 };
                course.reach_px = bad;
            })
        }),
        ("Track::sample, places", Permitted::Light, |bad| {
            let rows = [Rows::together(64), Rows::in_turn(64, 0.1, 0.02)];
            let paths = [[bad, bad], [20.0, bad], [bad, 20.0], [bad, -bad]];
            let mut light = Vec::new();
            for (rows, [from, to]) in rows.iter().flat_map(|rows| paths.map(|path| (rows, path))) {
                let x = |t: f64| if t < 0.4 { from } else { to };
                for electrons in [1.0, bad] {
                    let along = |t: f64| ([x(t), 31.0], 1.0);
                    light.extend(drawn_along(along, electrons, |course, _| {
                        course.rows = *rows
                    }));
                }
                // Non-finite light on the second part of the track.
                let along = |t: f64| ([20.0 + 5.0 * t, 30.0], if t > 0.4 { bad } else { 1.0 });
                light.extend(drawn_along(along, 1.0, |course, _| course.rows = *rows));
            }
            // Infinite parameters do not give infinite light.
            if !bad.is_finite() {
                let infinite = light.iter_mut().filter(|e| e.is_infinite());
                infinite.for_each(|e| *e = f64::NAN);
            }
            light
        }),
        ("Course.panel_px, point_px", Permitted::Light, |bad| {
            let panel = drawn(|course, _| course.panel_px = bad);
            [panel, drawn(|course, _| course.point_px = bad)].concat()
        }),
        ("Course.window", Permitted::Light, |bad| {
            let low = drawn(|course, _| course.window.low = [bad; 2]);
            let high = drawn(|course, _| course.window.high = [bad; 2]);
            let (from, to) = ([-bad; 2], [bad; 2]);
            let both = drawn(|course, _| {
                course.window = Window {
                    low: from,
                    high: to,
                }
            });
            [low, high, both].concat()
        }),
        ("Even", Permitted::Light, |bad| {
            let even = |sigma_px, height_e| {
                drawn(move |course, _| course.even = Some(Even { sigma_px, height_e }))
            };
            [even(bad, 1e3), even(0.7, bad), even(bad, bad)].concat()
        }),
        ("Fidelity of a track", Permitted::Light, |bad| {
            let even = Some(Even {
                sigma_px: 0.7,
                height_e: 1e3,
            });
            let set: [fn(&mut Fidelity) -> &mut f64; 3] = [
                |f| &mut f.track_step_sigma,
                |f| &mut f.track_e,
                |f| &mut f.skip_px,
            ];
            let tracks = set.map(|set| {
                drawn(|course, fidelity| {
                    course.even = even;
                    *set(fidelity) = bad;
                })
            });
            tracks.concat()
        }),
        ("Rows::in_turn", Permitted::Light, |bad| {
            let rows = |exposure_s, readout_s| {
                drawn(move |course, _| course.rows = Rows::in_turn(64, exposure_s, readout_s))
            };
            [rows(bad, 0.02), rows(0.1, bad), rows(bad, bad)].concat()
        }),
    ]);
}

#[test]
fn detectors_with_non_finite_numbers() {
    check(&[
        ("Pattern::new", Finite, |bad| {
            let plain = PatternStats {
                serial: 3,
                width: 16,
                height: 16,
                prnu: 0.01,
                dark_e_s: 1.0,
                dark_nonuniformity: 0.1,
                hot_fraction: 0.05,
                hot_e_s: 100.0,
                dead_fraction: 0.01,
                dead_px: vec![[1, 2]],
                stuck_fraction: 0.01,
                stuck_px: vec![[3, 4]],
            };
            let set: [fn(&mut PatternStats) -> &mut f64; 7] = [
                |f| &mut f.prnu,
                |f| &mut f.dark_e_s,
                |f| &mut f.dark_nonuniformity,
                |f| &mut f.hot_fraction,
                |f| &mut f.hot_e_s,
                |f| &mut f.dead_fraction,
                |f| &mut f.stuck_fraction,
            ];
            let mut figures = Vec::new();
            for set in set {
                let mut corrupted = plain.clone();
                *set(&mut corrupted) = bad;
                let pattern = Pattern::new(&corrupted);
                assert!(pattern.dark_mean_e_s() >= 0.0 && pattern.dark_max_e_s() >= 0.0);
                figures.push(pattern.worst_response());
                for pixel in 0..256 {
                    let [response, dark] = [pattern.response_of(pixel), pattern.dark_e_s_of(pixel)];
                    assert!(response >= 0.0 && dark >= 0.0, "{bad:e}");
                    figures.extend([response, dark]);
                }
            }
            figures
        }),
        ("Radiation", Anything, |bad| {
            let detector = camera("").detector;
            let plain = Radiation {
                flux: Flux::Fixed(1.0),
                thickness_um: 10.0,
                energy_mev: 500.0,
                diffusion_um: 5.0,
                readout_s: 0.1,
            };
            let set: [fn(&mut Radiation) -> &mut f64; 4] = [
                |r| &mut r.thickness_um,
                |r| &mut r.energy_mev,
                |r| &mut r.diffusion_um,
                |r| &mut r.readout_s,
            ];
            for set in set {
                let mut corrupted = plain.clone();
                *set(&mut corrupted) = bad;
                corrupted.expected_events(&detector, 1.0, 0.1);
                corrupted.charge_e(10.0, 0.3);
                corrupted.events(&detector, 20.0, KEY);
            }
            plain.charge_e(bad, 0.3);
            plain.charge_e(10.0, bad);
            plain.expected_events(&detector, bad, bad);
            let none = plain.events(&detector, f64::NAN, KEY);
            assert!(none.is_empty());
            Vec::new()
        }),
        ("Stray", LightOrNone, |bad| {
            let stray = Stray::new(&[[0.1, 1e-3], [bad, 1e-5], [1.0, bad]], bad);
            let plain = Stray::new(&[[0.1, 1e-3], [1.0, 1e-5]], 0.3);
            vec![stray.pst(0.4), stray.pst(bad), plain.pst(bad)]
        }),
        ("Shutter, PixelStream", Anything, |bad| {
            for shutter in [
                Shutter::Global,
                Shutter::Rolling { row_s: bad },
                Shutter::FrameTransfer { row_s: bad },
            ] {
                shutter.readout_s(64);
                shutter.period_s(64, bad);
            }
            let draw = PixelStream::new(KEY, 9, 3).poisson(bad);
            assert!(draw.is_finite() && draw >= 0.0);
            Vec::new()
        }),
    ]);
}

#[test]
fn cameras_with_non_finite_numbers() {
    check(&[
        ("Band::top_hat", Finite, |bad| {
            let light = |from_m: f64, to_m: f64| {
                let band = Band::top_hat(from_m, to_m);
                let v = Band::named("v").unwrap();
                assert!(band.zero_point() >= 0.0 && band.response(6e-7) >= 0.0);
                let [min, max] = band.wavelength_ratios();
                vec![
                    band.zero_point(),
                    band.reference_m(),
                    band.colour_term(0.3, &v),
                    min,
                    max,
                ]
            };
            [light(bad, 7e-7), light(6e-7, bad), light(bad, bad)].concat()
        }),
        ("Band, of any colour", LightOrNone, |bad| {
            let band = Band::top_hat(5e-7, 7e-7);
            band.colour_term(bad, &band);
            vec![band.response(bad), band.wavelength_ratio(bad)]
        }),
        ("Camera, Detector", Anything, |bad| {
            let mut camera = camera("");
            camera.cone_rad(bad);
            camera.sides(bad);
            camera.period_s(bad);
            let detector = &camera.detector;
            assert_eq!(detector.edge(bad).count(), 68);
            detector.response_e(bad);
            detector.dark_e(bad);
            assert!(!detector.contains([bad, f64::NAN]));
            camera.optics.focal_px = bad;
            camera.scale_and_corner_px();
            camera.cone_rad(1.0);
            camera.sides(1.0);
            camera.optics.seen_at([3.0, 4.0]);
            Vec::new()
        }),
        ("Vignetting", LightOrNone, |bad| {
            let tables = [[[0.0, 1.0], [bad, 0.5]], [[0.0, 1.0], [0.4, bad.max(0.0)]]];
            let laws = tables.map(|table| Vignetting::Table(table.to_vec()));
            let laws = laws.into_iter().chain([Vignetting::Cos4]);
            let light = laws.flat_map(|law| {
                law.end();
                law.change_across(&Vector3::new(0.1, 0.2, 1.0), bad);
                law.range(bad);
                let directions = corrupted(Vector3::new(0.1, 0.2, 1.0), bad);
                directions.map(|direction| law.transmission(&direction))
            });
            light.collect()
        }),
        ("Images::new", LightOrNone, |bad| {
            let image = || Image::new(&vec![vec![0.0625; 4]; 4]).unwrap();
            assert!(Image::new(&[vec![bad, 1.0]]).is_err() || bad.abs() < 1e-8);
            let made = [
                Images::new(bad, [vec![0.0], vec![0.0]], vec![image()]),
                Images::new(2.0, [vec![0.0, bad], vec![0.0]], vec![image(), image()]),
            ];
            let psfs = made.into_iter().flatten();
            let psfs = psfs.map(|images| even(Spread::Images(Arc::new(images))));
            psfs.flat_map(|psf| requested(&psf, bad)).collect()
        }),
    ]);
}
