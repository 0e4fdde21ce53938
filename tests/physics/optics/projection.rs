//! Projections against OpenCV, and forward against backward.

use super::cameras::{GAUSSIAN, load, text};
use crate::reference::{number, rows, vector};
use nalgebra::Vector3;
use skyloop::camera::{Camera, Model, Projection};

const OPENCV: &str = include_str!("../../reference/projection.csv");

#[test]
fn distortion_is_that_of_opencv() {
    let mut camera = load(&text(GAUSSIAN, "")).unwrap();
    // X-Val: the focal length and principal point of projection.py.
    camera.optics.focal_px = 2650.0;
    camera.optics.principal_px = [511.5, 498.25];
    let mut seen = 0;
    for row in rows(OPENCV) {
        let c: Vec<f64> = (1..6).map(|k| number(&row, k)).collect();
        camera.optics.projection = Projection::new(match row[0] {
            "brown" => Model::BrownConrady {
                k: [c[0], c[1], c[2]],
                p: [c[3], c[4]],
            },
            _ => Model::Fisheye {
                k: [c[0], c[1], c[2], c[3]],
            },
        });
        let direction = vector(&row, 6);
        let [x, y] = camera.optics.project(&direction).unwrap();
        let miss = (x - number(&row, 9)).hypot(y - number(&row, 10));
        assert!(miss < 1e-6, "{row:?} {miss:e}");

        let pixel = [11, 12].map(|k| number(&row, k));
        let back = camera.optics.direction(pixel);
        let theirs = Vector3::new(number(&row, 13), number(&row, 14), 1.0).normalize();
        // 1e-6 px of 2,650 px, in rad.
        assert!((back - theirs).norm() < 1e-6 / 2650.0, "{row:?}");
        seen += 1;
    }
    assert_eq!(seen, 7 * 54);
}

/// Camera models of this file: name and keys.
const LENSES: &[&str] = &[
    "model = \"pinhole\"",
    "model = \"brown-conrady\"\nk = [-0.28, 0.09, -0.01]\np = [3e-4, -2e-4]",
    "model = \"brown-conrady\"\nk = [1.4, 0.3]\np = [-2e-3, 3e-3]\nstrength = 0.7",
    "model = \"fisheye\"\nk = [0.0]",
    "model = \"fisheye\"\nk = [-0.02, 3e-3, -8e-4, 4e-5]",
];

fn cameras() -> Vec<Camera> {
    let shape = |lens: &str, focal: &str| {
        let text = text(GAUSSIAN, &format!("[optics.projection]\n{lens}"));
        load(&text.replace("focal_length_mm = 20.0", focal)).unwrap()
    };
    let lenses = LENSES.iter();
    let cameras = lenses.map(|lens| shape(lens, "focal_length_mm = 2.0"));
    let mut cameras: Vec<Camera> = cameras.collect();
    // 73 degrees from the boresight at the middle of a side, 116 in the corners.
    cameras.push(shape(LENSES[3], "focal_length_mm = 0.63"));
    cameras
}

#[test]
fn forward_and_inverse_agree_on_the_detector_and_beyond_its_corners() {
    for camera in cameras() {
        let optics = &camera.optics;
        for i in 0..=60 {
            for j in 0..=60 {
                let pixel = [-8.0 + f64::from(i) * 3.6, -8.0 + f64::from(j) * 2.9];
                if !optics.sees(pixel) {
                    let outside = !camera.detector.contains(pixel);
                    assert!(outside, "{pixel:?} {:?}", optics.projection);
                    continue;
                }
                let [x, y] = optics.project(&optics.direction(pixel)).unwrap();
                let miss = (x - pixel[0]).hypot(y - pixel[1]);
                assert!(miss < 1e-6, "{pixel:?} {miss:e} {:?}", optics.projection);
            }
        }
    }
}

#[test]
fn the_cone_holds_every_pixel_and_little_more() {
    for camera in cameras() {
        // With its distortion and without: the planner may leave it out.
        let mut ideal = camera.optics.clone();
        ideal.projection = ideal.projection.ideal();
        let widest = |margin_px: f64| {
            let angle = |pixel| {
                let both = [&camera.optics, &ideal].map(|optics| optics.direction(pixel));
                let [a, b] = both.map(|seen| Vector3::z().angle(&seen));
                a.max(b)
            };
            let edge = camera.detector.edge(margin_px);
            edge.map(angle).fold(0.0, f64::max)
        };
        // For a pinhole the margin moves the corners outwards, not each side.
        let cone = camera.cone_rad(5.0);
        assert!(cone >= widest(3.5), "{cone} {}", widest(3.5));
        assert!(cone < 1.02 * widest(5.0), "{cone} {}", widest(5.0));
    }
}

#[test]
fn strength_scales_the_coefficients_and_zero_is_pinhole() {
    let lens = |strength: &str| {
        let lens = "model = \"brown-conrady\"\nk = [-0.2, 0.04]\np = [1e-3, 2e-3]";
        let keys = format!("[optics.projection]\n{lens}\n{strength}");
        load(&text(GAUSSIAN, &keys)).unwrap().optics
    };
    let model = *lens("strength = 0.25").projection.model();
    let expected = Model::BrownConrady {
        k: [-0.05, 0.01, 0.0],
        p: [2.5e-4, 5e-4],
    };
    assert_eq!(model, expected);
    let at = Vector3::new(0.03, -0.02, 1.0);
    let none = lens("strength = 0.0").project(&at).unwrap();
    let plain = load(&text(GAUSSIAN, "")).unwrap();
    let plain = plain.optics.project(&at).unwrap();
    assert_eq!(none, plain);
    let full = lens("");
    assert!((full.project(&at).unwrap()[0] - plain[0]).abs() > 0.005);
    let ideal = full.project_by(&full.projection.ideal(), &at).unwrap();
    assert_eq!(ideal, plain);
}
