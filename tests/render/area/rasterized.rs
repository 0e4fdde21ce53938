//! Radiances known in closed form, rasterized on the pixels of real cameras.

use crate::fixtures::camera;
use nalgebra::Vector3;
use skyloop::attitude::VehicleState;
use skyloop::camera::{Camera, Vignetting};
use skyloop::config::Config;
use skyloop::engine::Emulator;
use skyloop::fidelity::{Choice, Fidelity};
use skyloop::scene::{Area, AreaLight, Edge, EffectId, EffectSet, Full, Radiance, View, lit_by};
use std::sync::Arc;

/// ph/s/m^2/sr; gives pixels some thousand electrons.
pub const LEVEL: f64 = 1e13;

/// A disc of uniform light around a direction; the whole sky is its extreme case. Its light grows
/// by `slope` per radian from its middle.
#[derive(Debug)]
struct Disc {
    axis: Vector3<f64>,
    radius: f64,
    slope: f64,
}

impl Radiance for Disc {
    fn toward(&self, direction: &Vector3<f64>) -> f64 {
        let off = direction.angle(&self.axis);
        if off <= self.radius {
            LEVEL * (1.0 + self.slope * off * off)
        } else {
            0.0
        }
    }

    fn edge(&self) -> Option<&dyn Edge> {
        (self.radius < 3.0).then_some(self)
    }
}

impl Edge for Disc {
    fn angle(&self, direction: &Vector3<f64>) -> f64 {
        direction.angle(&self.axis) - self.radius
    }

    fn radius(&self) -> f64 {
        f64::INFINITY
    }
}

pub fn view(camera: Camera, rates: [f64; 3]) -> View {
    let emulator = Emulator::new(&mut Config::defaults().unwrap());
    let epoch = "2026-06-01T00:00:00 UTC".parse().unwrap();
    let q = [0.1, -0.2, 0.3, (1.0f64 - 0.14).sqrt()];
    let vehicle = VehicleState::new(0, epoch, q, rates, None).unwrap();
    let scene = emulator.scene(&Arc::new(camera), &vehicle, 0, &Choice::default());
    scene.unwrap().view
}

pub fn lit(view: &View, radiance: impl Radiance + 'static, simulated: &EffectSet) -> AreaLight {
    let area = Area {
        effect: EffectId::ZodiacalLight,
        unlit: "it is dark",
        radiance: Ok(Arc::new(radiance)),
        peak_e: 1e5,
    };
    lit_by(
        view,
        &area,
        simulated,
        &Full::default(),
        &Fidelity::REALTIME,
    )
}

/// Electrons of one pixel per steradian at [`LEVEL`].
pub fn scale_e(view: &View) -> f64 {
    let (camera, seconds) = (&view.camera, view.exposure.duration_s);
    let optics = &camera.optics;
    let passes = camera.detector.quantum_efficiency * optics.transmission;
    LEVEL * passes * optics.aperture_area_m2() * seconds
}

fn pixel_e(light: &AreaLight, pixel: usize) -> f64 {
    f64::from(light.e()[pixel])
}

fn boresight(view: &View) -> Vector3<f64> {
    view.pointing(0.0).matrix().transpose() * Vector3::z()
}

/// The effects that shape area light.
fn shapes() -> EffectSet {
    let all = [EffectId::Distortion, EffectId::Vignetting, EffectId::Smear];
    all.into_iter().fold(EffectSet::default(), EffectSet::with)
}

/// A pixel of a pinhole covers `cos^3 / f^2` sr; times `cos^4`, the law of the thin lens.
#[test]
fn an_even_sky_gives_each_pixel_its_solid_angle() {
    for (cos4, power) in [(false, 3), (true, 4)] {
        let mut camera = camera("fai-nir");
        if cos4 {
            camera.optics.vignetting = Vignetting::Cos4;
        }
        let view = view(camera, [0.0; 3]);
        let even = Disc {
            axis: boresight(&view),
            radius: 4.0,
            slope: 0.0,
        };
        let light = lit(&view, even, &shapes());
        let f = view.camera.optics.focal_px;
        for (x, y) in [(127, 127), (0, 0), (255, 17), (128, 250), (33, 99)] {
            let off = [x as f64 - 127.5, y as f64 - 127.5];
            let cos = f / (f * f + off[0] * off[0] + off[1] * off[1]).sqrt();
            let expected = scale_e(&view) * cos.powi(power) / (f * f);
            let e = pixel_e(&light, y * 256 + x);
            assert!((e / expected - 1.0).abs() < 5e-4, "{x} {y}: {e} {expected}");
        }
    }
}

/// The light of a disc is that of `2 pi (1 - cos r)` sr, its centre in the middle, in any
/// projection.
#[test]
fn a_disc_keeps_its_light_and_its_centre() {
    for (name, radius, at) in [
        ("fai-nir", 0.05, [100.3, 140.2]),
        ("fai-nir", 0.004, [30.7, 200.1]),
        ("cmos-rolling", 0.02, [300.2, 222.9]),
        ("all-sky", 0.3, [255.5, 255.5]),
        ("all-sky", 0.2, [400.5, 155.5]),
    ] {
        let view = view(camera(name), [0.0; 3]);
        let to_sky = view.pointing(0.0).matrix().transpose();
        let axis = to_sky * view.camera.optics.direction(at);
        let no_vignetting = shapes().without(EffectId::Vignetting);
        let slope = 0.0;
        let disc = Disc {
            axis,
            radius,
            slope,
        };
        let light = lit(&view, disc, &no_vignetting);
        let expected = scale_e(&view) * 2.0 * std::f64::consts::PI * (1.0 - radius.cos());
        // Edges are straight within a pixel: a disc of r px gets `1 / 12 r^2` too much.
        let radius_px = radius * view.camera.optics.focal_px;
        let off = (light.electrons / expected - 1.0).abs();
        let allowed = 3e-4 + 1.2 / (12.0 * radius_px * radius_px);
        assert!(off < allowed, "{name}: {off} of {allowed}");
        let width = view.camera.detector.width;
        let mut centre = [0.0; 2];
        for (row, e) in light.e().chunks_exact(width).enumerate() {
            for (column, e) in e.iter().enumerate() {
                centre[0] += f64::from(*e) * column as f64 / light.electrons;
                centre[1] += f64::from(*e) * row as f64 / light.electrons;
            }
        }
        assert_eq!(light.e().len() % width, 0);
        // Off the boresight, projections move the centre of an area slightly.
        let off = (centre[0] - at[0]).hypot(centre[1] - at[1]);
        let allowed = if name == "all-sky" && at[0] > 300.0 {
            0.05 * radius_px
        } else {
            0.02 + 2.0 * radius * radius * radius_px
        };
        assert!(off < allowed, "{name}: {off} px of {radius_px}");
    }
}

/// The grid adapts to uneven light.
#[test]
fn uneven_light_equals_its_value_at_pixel_centres() {
    let mut camera = camera("cmos-rolling");
    camera.optics.vignetting = Vignetting::Table(vec![[0.0, 1.0], [0.3, 0.5]]);
    let view = view(camera, [0.0; 3]);
    let axis = view.pointing(0.0).matrix().transpose() * Vector3::new(0.1, 0.05, 1.0).normalize();
    let uneven = || Disc {
        axis,
        radius: 4.0,
        slope: 300.0,
    };
    let light = lit(&view, uneven(), &shapes());
    let plane = |x: f64, y: f64| view.camera.optics.direction([x, y]);
    let to_sky = view.pointing(0.0).matrix().transpose();
    let mut worst = 0.0f64;
    let columns = (0..512).step_by(37);
    for (x, y) in columns.flat_map(|x| (0..512).step_by(29).map(move |y| (x, y))) {
        let (fx, fy) = (x as f64, y as f64);
        let across = plane(fx + 0.5, fy) - plane(fx - 0.5, fy);
        let down = plane(fx, fy + 0.5) - plane(fx, fy - 0.5);
        let seen = plane(fx, fy);
        let passes = view.camera.optics.vignetting.transmission(&seen);
        let taken = across.cross(&down).norm() * passes;
        let radiance = uneven().toward(&(to_sky * seen));
        let expected = scale_e(&view) / LEVEL * radiance * taken;
        let off = (pixel_e(&light, y * 512 + x) / expected - 1.0).abs();
        worst = worst.max(off);
    }
    assert!(worst < 1e-3, "{worst}");
}

/// An edge that crosses n pixels gives a ramp n pixels long: the mean over the exposure.
#[test]
fn an_edge_is_smeared_evenly() {
    let mut camera = camera("fai-nir");
    camera.exposure_s = 0.5;
    let f = camera.optics.focal_px;
    // About the camera's y axis: images move along rows, 20 px in the middle of the field.
    let view = view(camera, [0.0, 20.0 / f / 0.5, 0.0]);
    let to_sky = view.pointing(0.0).matrix().transpose();
    // Half of the sky, its edge in the middle of the field.
    let half = Disc {
        axis: to_sky * Vector3::x(),
        radius: std::f64::consts::FRAC_PI_2,
        slope: 0.0,
    };
    let light = lit(&view, half, &shapes());
    let level = scale_e(&view) / (f * f);
    for dx in [-14, -8, -3, 0, 5, 9, 14] {
        let x = 127.5 + f64::from(dx) + 0.5;
        let expected = ((x - 127.5) / 20.0 + 0.5).clamp(0.0, 1.0);
        let e = pixel_e(&light, 128 * 256 + x as usize) / level;
        assert!((e - expected).abs() < 0.01, "{dx}: {e} {expected}");
    }
}
