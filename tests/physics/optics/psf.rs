//! Point spread functions against GalSim and against integration; conservation of light.

use super::cameras::{load, load_in, text};
use crate::reference::{number, rows};
use skyloop::abort::WorkLimit;
use skyloop::camera::psf::{Airy, FURTHEST_PX, Image, Images, Moffat, Shape, Variation};
use skyloop::camera::{Camera, Psf, Stamp};
use skyloop::fidelity::Fidelity;
use skyloop::footprint::{Footprint, Light};
use skyloop::load::Folder;
use skyloop::track::{Place, Track};
use std::f64::consts::PI;
use std::sync::Arc;

const GALSIM: &str = include_str!("../../reference/psf.csv");
const IMAGE: &str = include_str!("../../reference/psf_image.csv");

fn shape(kind: &str, a: f64, b: f64) -> Shape {
    match kind {
        "gaussian" => Shape::Gaussian(a),
        "moffat" => Shape::Moffat(Arc::new(Moffat::new(b)), a),
        "airy" => Shape::Airy(Arc::new(Airy::new(b, &[(1.0, 1.0)])), a),
        _ => {
            let rows: Vec<Vec<f64>> = IMAGE
                .lines()
                .filter(|line| !line.starts_with('#'))
                .map(|line| line.split(',').map(|s| s.parse().unwrap()).collect())
                .collect();
            let image = Image::new(&rows).unwrap();
            let images = Images::new(a, [vec![0.0], vec![0.0]], vec![image]).unwrap();
            Shape::Images(Arc::new(images))
        }
    }
}

fn psf(kind: &str, a: f64, b: f64) -> Psf {
    Psf::new(shape(kind, a, b), Variation::default())
}

/// Shares on `2 n + 1` pixels per axis, centred on pixel 0, of a source at `at` in the middle of
/// the field.
fn shares(psf: &Psf, n: i64, at: [f64; 2]) -> Vec<f64> {
    let mut stamp = Stamp::default();
    psf.at([0.0; 2], 1.0)
        .spread(1.0, at, -n..n + 1, -n..n + 1, &mut stamp);
    stamp.light
}

/// The maximum difference, as a part of the brightest pixel of `truth`.
fn off(image: &[f64], truth: &[f64]) -> f64 {
    assert_eq!(image.len(), truth.len());
    let apart = image.iter().zip(truth).map(|(a, b)| (a - b).abs());
    apart.fold(0.0, f64::max) / truth.iter().copied().fold(0.0, f64::max)
}

#[test]
fn pixels_are_those_of_galsim() {
    let mut worst = std::collections::BTreeMap::new();
    for row in rows(GALSIM) {
        let psf = psf(row[0], number(&row, 1), number(&row, 2));
        let at = [number(&row, 3), number(&row, 4)];
        let theirs: Vec<f64> = (5..row.len()).map(|k| number(&row, k)).collect();
        let miss = off(&shares(&psf, 5, at), &theirs);
        let bound = if row[0] == "airy" { 2e-5 } else { 1e-5 };
        assert!(miss < bound, "{:?} {at:?}: {miss:e}", &row[..3]);
        let kind: &mut (f64, usize) = worst.entry(row[0].to_string()).or_default();
        *kind = (kind.0.max(miss), kind.1 + 1);
    }
    assert_eq!(worst.len(), 4, "{worst:?}");
    println!("worst, in units of the peak: {worst:?}");
}

/// `I(x)` of an obscured aperture, 1 at the centre.
fn diffraction(e: f64, x: f64) -> f64 {
    let jinc = |x: f64| if x < 1e-6 { 1.0 } else { 2.0 * libm::j1(x) / x };
    ((jinc(x) - e * e * jinc(e * x)) / (1.0 - e * e)).powi(2)
}

/// Five points of Gauss's rule on -1..1.
const GAUSS: [(f64, f64); 5] = [
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683, 0.478_628_670_499_366_5),
    (-0.538_469_310_105_683, 0.478_628_670_499_366_5),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
    (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
];

/// A density integrated over pixel `[i, j]` in `parts` parts per axis.
fn integral(density: &dyn Fn(f64) -> f64, i: i64, j: i64, at: [f64; 2], parts: usize) -> f64 {
    let nodes: Vec<(f64, f64)> = (0..parts)
        .flat_map(|k| GAUSS.map(|(x, w)| (((k as f64 + 0.5 + x / 2.0) / parts as f64) - 0.5, w)))
        .collect();
    let mut sum = 0.0;
    for (x, wx) in &nodes {
        for (y, wy) in &nodes {
            sum += wx * wy * density((i as f64 + x - at[0]).hypot(j as f64 + y - at[1]));
        }
    }
    sum / (2 * parts * 2 * parts) as f64
}

fn near_the_integral(psf: &Psf, density: &dyn Fn(f64) -> f64, parts: usize, what: &str) {
    for at in [[0.0, 0.0], [0.27, -0.43]] {
        let pixels = (-4..=4).flat_map(|j| (-4..=4).map(move |i| (i, j)));
        let truth = pixels.map(|(i, j)| integral(density, i, j, at, parts));
        let miss = off(&shares(psf, 4, at), &truth.collect::<Vec<f64>>());
        assert!(miss < 1e-4, "{what} {at:?}: {miss:e}");
    }
}

#[test]
fn the_tables_are_within_a_ten_thousandth_of_the_peak_of_integration() {
    for e in [0.0, 0.3, 0.6, 0.9] {
        let airy = Arc::new(Airy::new(e, &[(1.0, 1.0)]));
        for width in [0.3, 1.0, 4.0, 20.0] {
            let psf = Psf::new(Shape::Airy(airy.clone(), width), Variation::default());
            let norm = PI / 4.0 * (1.0 - e * e) / (width * width);
            let density = |r: f64| norm * diffraction(e, PI * r / width);
            let parts = (6.0 / width).ceil() as usize;
            near_the_integral(&psf, &density, parts, &format!("airy {e} {width}"));
        }
    }
    for beta in [1.5, 2.5, 4.765, 20.0] {
        let moffat = Arc::new(Moffat::new(beta));
        for width in [0.1, 0.7, 4.0, 20.0] {
            let psf = Psf::new(Shape::Moffat(moffat.clone(), width), Variation::default());
            let alpha = width / 2.0 / (2f64.powf(1.0 / beta) - 1.0).sqrt();
            let norm = (beta - 1.0) / (PI * alpha * alpha);
            let density = |r: f64| norm * (1.0 + (r / alpha).powi(2)).powf(-beta);
            let parts = (4.0 / width).ceil() as usize;
            near_the_integral(&psf, &density, parts, &format!("moffat {beta} {width}"));
        }
    }
}

/// The light within a square of half side `half` around the origin, of a source at `at`, from its
/// encircled energy: `1/(2 pi) int E(r(phi)) dphi` to the square's edge, by the midpoint rule from
/// corner to corner.
fn inside(energy: &dyn Fn(f64) -> f64, half: f64, at: [f64; 2]) -> f64 {
    const STEPS: usize = 4000;
    let sides = [half - at[0], half - at[1], half + at[0], half + at[1]];
    let mut sum = 0.0;
    for k in 0..4 {
        // This side, and the positions of its two corners along it.
        let (near, left, right) = (sides[k], sides[(k + 3) % 4], sides[(k + 1) % 4]);
        let (from, to) = (-(left / near).atan(), (right / near).atan());
        let step = (to - from) / STEPS as f64;
        for i in 0..STEPS {
            let phi = from + (i as f64 + 0.5) * step;
            sum += step * energy(near / phi.cos());
        }
    }
    sum / (2.0 * PI)
}

/// The drawn light plus the light outside, by the profile's own formula, is the total, for every
/// width and position.
#[test]
fn no_light_is_lost_or_made() {
    let positions = [[0.0, 0.0], [0.5, 0.5], [-0.31, 0.12], [0.499, -0.001]];
    let check = |psf: &Psf, energy: &dyn Fn(f64) -> f64, what: &str| {
        for at in positions {
            let n = 24;
            let sum: f64 = shares(psf, n, at).iter().sum();
            let outside = 1.0 - inside(energy, n as f64 + 0.5, at);
            let is_all = (sum + outside - 1.0).abs() < 1e-4;
            assert!(is_all, "{what} {at:?}: {sum} {outside}");
            assert!(shares(psf, 5, at).iter().all(|share| *share >= 0.0));
        }
    };
    for sigma in [0.01, 0.3, 1.0, 10.0] {
        let energy = |r: f64| 1.0 - (-0.5 * (r / sigma).powi(2)).exp();
        let psf = psf("gaussian", sigma, 0.0);
        check(&psf, &energy, &format!("gaussian {sigma}"));
    }
    for (fwhm, beta) in [(0.02, 1.5), (0.5, 2.5), (3.0, 4.765), (20.0, 2.0)] {
        let alpha = fwhm / 2.0 / (2f64.powf(1.0 / beta) - 1.0).sqrt();
        let energy = |r: f64| 1.0 - (1.0 + (r / alpha).powi(2)).powf(1.0 - beta);
        let psf = psf("moffat", fwhm, beta);
        check(&psf, &energy, &format!("moffat {fwhm} {beta}"));
    }
    for width in [0.02, 0.4, 1.7, 6.0, 20.0] {
        // Rayleigh: 1 - J0^2 - J1^2.
        let energy = |r: f64| {
            let x = PI * r / width;
            1.0 - libm::j0(x).powi(2) - libm::j1(x).powi(2)
        };
        check(&psf("airy", width, 0.0), &energy, &format!("airy {width}"));
    }
    for at in positions {
        let sum: f64 = shares(&psf("image", 4.0, 0.0), 5, at).iter().sum();
        assert!((sum - 1.0).abs() < 1e-12);
    }
}

/// Obscured aperture: the light outside of a large circle is `2 / (pi^2 (1 - e) r)`, averaged over
/// the rings.
#[test]
fn the_wings_of_an_obscured_aperture_have_their_light() {
    for e in [0.0, 0.3, 0.5, 0.8] {
        let psf = psf("airy", 1.0, e);
        let sum: f64 = shares(&psf, 150, [0.2, 0.1]).iter().sum();
        let energy = |r: f64| 1.0 - 2.0 / (PI * PI * (1.0 - e) * r);
        let outside = 1.0 - inside(&energy, 150.5, [0.2, 0.1]);
        assert!((sum + outside - 1.0).abs() < 1e-4, "{e}: {sum} {outside}");
    }
}

/// The light of a point at rest in the middle of a large detector.
fn drawn(camera: &Camera, at: [f64; 2], electrons: f64, fidelity: &Fidelity) -> Vec<f64> {
    let wavelength_ratio = 1.0;
    let light = Light {
        electrons,
        wavelength_ratio,
    };
    let track = Track::still(Place { at, light: 1.0 });
    let footprint = Footprint::of(
        &WorkLimit::default(),
        &track,
        camera,
        fidelity,
        &light,
        None,
    );
    let (width, height) = (camera.detector.width, camera.detector.height);
    let mut image = vec![0.0; width * height];
    for (row, column, shares) in footprint.rows(0..height) {
        for (i, share) in shares.iter().enumerate() {
            image[row * width + column + i] = f64::from(*share);
        }
    }
    image
}

fn moments(image: &[f64], width: usize) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for (i, share) in image.iter().enumerate() {
        let at = [1.0, (i % width) as f64, (i / width) as f64];
        sums = [0, 1, 2].map(|k| sums[k] + share * at[k]);
    }
    [sums[0], sums[1] / sums[0], sums[2] / sums[0]]
}

/// Wings too faint to be drawn in their pixels are spread over the drawn ones. No light is lost (a
/// Gaussian loses up to 0.001 e-), and no pixel changes by much.
#[test]
fn faint_sources_keep_their_light_and_their_centre() {
    let mut camera = Camera::load("cmos-rolling", &Folder::current()).unwrap();
    (camera.detector.width, camera.detector.height) = (560, 560);
    let at = [279.62, 280.31];
    for (kind, a, b) in [
        ("gaussian", 0.7, 0.0),
        ("moffat", 1.8, 3.5),
        ("moffat", 1.5, 2.5),
        ("moffat", 1.0, 1.5),
        ("airy", 0.3, 0.3),
        ("airy", 1.0, 0.0),
        ("image", 4.0, 0.0),
    ] {
        camera.optics.psf = psf(kind, a, b);
        let all = drawn(&camera, at, f64::INFINITY, &Fidelity::REALTIME);
        let [all_light, x, y] = moments(&all, 560);
        for electrons in [5.0, 150.0, 1e4] {
            let faint = drawn(&camera, at, electrons, &Fidelity::REALTIME);
            let [light, faint_x, faint_y] = moments(&faint, 560);
            let what = format!("{kind} {a} {b} {electrons} e-");
            for light in [light, all_light] {
                assert!((light - 1.0).abs() < 1e-4, "{what}: {light}");
            }
            if kind == "gaussian" {
                // 0.001 e-, at most a ten-thousandth and at least a millionth.
                let max = (1e-3 / electrons).clamp(1e-6, 1e-4);
                assert!(1.0 - light < max, "{what}: {light}");
            }
            // A stamp cut at 256 px moves the centre by the light of its last columns.
            let from = |[x, y]: [f64; 2]| (faint_x - x).hypot(faint_y - y);
            let moved = from(at).min(from([x, y]));
            println!("{what}: light {:.1e}, {moved:.1e} px", light - all_light);
            // Pixel sampling of a core narrower than a pixel shifts the centre more than the wings
            // do.
            let max = if a < 0.5 { 1e-2 } else { 1e-3 };
            assert!(moved < max, "{what}: {faint_x} {faint_y}, of all {x} {y}");
            let pairs = faint.iter().zip(&all);
            let off = pairs.map(|(a, b)| (a - b).abs() * electrons);
            let off = off.fold(0.0, f64::max);
            println!("{what}: {off:.1e} e-");
            assert!(off < 2.0 * Fidelity::REALTIME.wing_e, "{what}: {off} e-");
        }
    }
}

#[test]
fn the_reach_bounds_the_light_outside() {
    let cases = [
        ("gaussian", 0.7, 0.0),
        ("moffat", 1.5, 2.5),
        ("moffat", 1.0, 4.765),
        ("airy", 0.05, 0.0),
        ("airy", 0.4, 0.4),
        ("image", 4.0, 0.0),
    ];
    for (kind, a, b) in cases {
        let psf = psf(kind, a, b);
        let local = psf.at([0.0; 2], 1.0);
        for loss in [1e-2, 3e-3, 1e-3] {
            let reach = local.reach_px(loss);
            assert!(reach < FURTHEST_PX);
            let n = (reach + 0.5).ceil() as i64;
            let outside = 1.0 - shares(&psf, n, [0.0; 2]).iter().sum::<f64>();
            assert!(outside < loss, "{kind} {a} {b} {loss}: {outside:e}");
        }
        for share in [1e-3, 1e-5].into_iter().filter(|_| kind != "gaussian") {
            let faint = Fidelity {
                psf_loss: 1e-30,
                wing_e: share,
                ..Fidelity::REALTIME
            };
            let n = (local.drawn_px(&faint, 1.0) + 0.5).ceil() as i64;
            let light = shares(&psf, n + 3, [0.0; 2]);
            let side = (2 * (n + 3) + 1) as usize;
            let outside = light.iter().enumerate().filter(|(i, _)| {
                let (x, y) = ((i % side) as i64 - n - 3, (i / side) as i64 - n - 3);
                x.abs().max(y.abs()) > n
            });
            let max = outside.map(|(_, light)| *light).fold(0.0, f64::max);
            assert!(max < 2.0 * share, "{kind} {a} {b} {share}: {max:e}");
        }
        assert!(local.reach_px(1e-30) <= FURTHEST_PX);
    }
}

#[test]
fn an_airy_camera_has_the_width_of_its_wavelength_and_focal_ratio() {
    let camera = load(&text("psf = { kind = \"airy\", obscuration = 0.3 }", "")).unwrap();
    let width = camera.optics.band.reference_m() * 2.0 / 10e-6;
    // X-Val: 0.598 um (between 500 and 700 nm) at f/2 on 10 um: 0.12 px.
    assert!((width - 0.12).abs() < 0.003, "{width}");
    // X-Val: GalSim 2.8.5, twice the radius at which Airy(lam_over_diam=1, obscuration=0.3).xValue
    // halves: 0.98111.
    let mono = psf("airy", 1.0, 0.3).core_px() * 2.354_820_045;
    assert!((mono - 0.981_11).abs() < 1e-4, "{mono}");
    // The blue end dominates the mean over a band.
    let core = camera.optics.psf.at([0.0; 2], 1.0).core_px() * 2.354_820_045;
    assert!((0.93..0.98).contains(&(core / width)), "{}", core / width);
    // Redder light spreads wider, in proportion.
    let red = camera.optics.psf.at([0.0; 2], 1.05).core_px() * 2.354_820_045;
    assert!((red / core - 1.05).abs() < 1e-12);
    // The polychromatic profile is the mean of the monochromatic ones.
    let [a, b] = [0.9, 1.1].map(|w| shares(&psf("airy", 3.0 * w, 0.3), 12, [0.3, 0.2]));
    let both = Airy::new(0.3, &[(0.9, 1.0), (1.1, 1.0)]);
    let both = Psf::new(Shape::Airy(Arc::new(both), 3.0), Variation::default());
    let mean = a.iter().zip(&b).map(|(a, b)| (a + b) / 2.0);
    let mean: Vec<f64> = mean.collect();
    assert!(off(&shares(&both, 12, [0.3, 0.2]), &mean) < 3e-5);
}

#[test]
fn the_width_goes_with_field_and_colour() {
    let keys = "[optics.psf]\nkind = \"moffat\"\nfwhm_px = 1.5\nbeta = 3.0\nwavelength_exponent = -0.2\n\
        width_by_field = [[0.0, 1.0], [2.0, 1.2], [4.0, 2.0]]";
    let camera = load(&text("", keys)).unwrap();
    let core = |deg: f64, ratio: f64| {
        // X-Val: 20 mm over 10 um: 2,000 px.
        let px = 2000.0 * deg.to_radians().tan();
        let at = [99.5 + 0.6 * px, 79.5 - 0.8 * px];
        camera.optics.psf_at(at, ratio).core_px() * 2.354_820_045
    };
    for (deg, fwhm) in [(0.0, 1.5), (2.0, 1.8), (4.0, 3.0), (8.0, 3.0)] {
        let found = core(deg, 1.0);
        assert!((found - fwhm).abs() < 1e-9, "{deg} {found}");
    }
    assert!((core(2.0, 1.3) / core(2.0, 1.0) - 1.3f64.powf(-0.2)).abs() < 1e-12);
    let psf = &camera.optics.psf;
    let [blue, red] = camera.optics.band.wavelength_ratios();
    assert!((psf.core_px() / core(0.0, red) * 2.354_820_045 - 1.0).abs() < 1e-9);
    let widest = camera.optics.psf.at([0.0, 500.0], blue).reach_px(1e-3);
    assert!((psf.reach_px(1e-3) / widest - 1.0).abs() < 1e-9);
}

/// Linear in angle; the distance in pixels grows with the tangent.
#[test]
fn the_width_is_straight_between_the_angles_of_its_table() {
    let keys = "[optics.psf]\nkind = \"gaussian\"\nsigma_px = 1.0\nwidth_by_field = [[0.0, 1.0], [40.0, 2.0]]";
    let camera = load(&text("", keys)).unwrap();
    for deg in [5.0, 20.1, 31.6] {
        // X-Val: 20 mm over 10 um: 2,000 px.
        let at = [99.5 + 2000.0 * f64::to_radians(deg).tan(), 79.5];
        let width = camera.optics.psf_at(at, 1.0).core_px();
        let expected = 1.0 + deg / 40.0;
        assert!((width - expected).abs() < 1e-5, "{deg} deg: {width}");
    }
}

#[test]
fn images_are_interpolated_between_their_positions() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("dot.csv", "# one pixel\n1.0\n");
    write("wide.csv", "0, 0.2, 0\n0.2 0.2\t0.2\n0, 0.2, 0 # end\n");
    let keys = "[optics.psf]\nkind = \"image\"\noversampling = 1\nimages = [\n\
        { file = \"wide.csv\", at_px = [150.0, 20.0] }, { file = \"dot.csv\", at_px = [50.0, 20.0] },\n\
        { file = \"dot.csv\", at_px = [50.0, 140.0] }, { file = \"wide.csv\", at_px = [150.0, 140.0] }]";
    let camera = load_in(folder.path(), &text("", keys)).unwrap();
    for (x, wide) in [
        (0.0, 0.0),
        (50.0, 0.0),
        (75.0, 0.25),
        (150.0, 1.0),
        (190.0, 1.0),
    ] {
        let mut stamp = Stamp::default();
        let psf = camera.optics.psf_at([x, 100.0], 1.0);
        psf.spread(2.0, [7.0, 8.0], 6..9, 7..10, &mut stamp);
        // Corner, edge and middle.
        let due = [0.0, 0.4 * wide, 2.0 * (1.0 - wide * 0.8)];
        for (found, due) in [0, 1, 4].map(|i| stamp.light[i]).into_iter().zip(due) {
            assert!((found - due).abs() < 1e-12, "{x}: {found} {due}");
        }
    }
}
