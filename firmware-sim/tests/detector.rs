//! The detector against star fields whose truth is known.

mod common;

use common::{Field, Noise, Star};
use skyloop_firmware_sim::detector::{Detection, DetectorSettings, detect};

/// Detections of the stars that were found, with the stars; and how many detections belong to none.
fn find(
    field: &Field,
    stars: &[Star],
    smear: (f64, f64),
    noise: Option<&mut Noise>,
) -> (Vec<(Star, Detection)>, usize) {
    let electrons = field.electrons(stars, smear);
    let pixels = match noise {
        Some(noise) => field.expose(&electrons, noise),
        None => {
            // No noise at all, and steps of 1/16 e-: what is left is the method's own error.
            let fine = Field {
                gain_e_per_dn: 1.0 / 16.0,
                offset_dn: 0.0,
                bits: 16,
                ..*field
            };
            let dn = electrons
                .iter()
                .map(|e| (e * 16.0).round().min(65_535.0) as u16)
                .collect::<Vec<u16>>();
            let detections = detect(&fine.image(0, &dn), &DetectorSettings::default());
            return pair(stars, detections.list());
        }
    };
    let detections = detect(&field.image(0, &pixels), &DetectorSettings::default());
    pair(stars, detections.list())
}

fn pair(stars: &[Star], found: &[Detection]) -> (Vec<(Star, Detection)>, usize) {
    let near = |star: &Star, at: &Detection| (at.x_px - star.x).hypot(at.y_px - star.y) < 2.0;
    let pairs = stars.iter().filter_map(|star| {
        found
            .iter()
            .find(|at| near(star, at))
            .map(|at| (*star, *at))
    });
    let strays = found
        .iter()
        .filter(|at| !stars.iter().any(|star| near(star, at)))
        .count();
    (pairs.collect(), strays)
}

/// Root mean square of the distance and mean of the offsets, px.
fn residual(pairs: &[(Star, Detection)]) -> (f64, f64, f64) {
    let count = pairs.len() as f64;
    let offsets = || {
        pairs
            .iter()
            .map(|(star, at)| (at.x_px - star.x, at.y_px - star.y))
    };
    let rms = (offsets().map(|(x, y)| x * x + y * y).sum::<f64>() / count).sqrt();
    (
        rms,
        offsets().map(|o| o.0).sum::<f64>() / count,
        offsets().map(|o| o.1).sum::<f64>() / count,
    )
}

#[test]
fn without_noise_the_centroid_is_that_of_the_light() {
    for (psf_px, limit) in [(0.6, 0.01), (0.7, 0.005), (1.0, 0.005), (1.5, 0.005)] {
        let field = Field {
            psf_px,
            ..Field::default()
        };
        let stars = field.grid(16, 6000.0, &mut Noise::new(1));
        let (pairs, strays) = find(&field, &stars, (0.0, 0.0), None);
        let (rms, ..) = residual(&pairs);
        println!("psf {psf_px}: {} stars, rms {rms:.5} px", pairs.len());
        assert_eq!((pairs.len(), strays), (stars.len(), 0));
        assert!(rms < limit, "psf {psf_px}: rms {rms}");
    }
}

#[test]
fn centroid_errors_stay_near_the_limit_of_the_noise() {
    let field = Field::default();
    for (electrons, snr_near, limit) in [
        (800.0, 20.0, 0.08),
        (1300.0, 30.0, 0.055),
        (4000.0, 60.0, 0.03),
        (9000.0, 92.0, 0.02),
    ] {
        let mut noise = Noise::new(7);
        let (mut all, mut wanted, mut strays) = (Vec::new(), 0, 0);
        for _ in 0..4 {
            let stars = field.grid(16, electrons, &mut noise);
            wanted += stars.len();
            let (pairs, stray) = find(&field, &stars, (0.0, 0.0), Some(&mut noise));
            all.extend(pairs);
            strays += stray;
        }
        let snr = field.snr(Star {
            x: 128.2,
            y: 128.3,
            electrons,
        });
        let (rms, bias_x, bias_y) = residual(&all);
        println!(
            "snr {snr:.1}: rms {rms:.4} px, bias {bias_x:+.4} {bias_y:+.4} px, {}/{wanted} found, {strays} strays",
            all.len()
        );
        assert!((snr / snr_near - 1.0).abs() < 0.1, "snr {snr}");
        assert!(rms < limit, "snr {snr}: rms {rms}");
        assert!(
            bias_x.hypot(bias_y) < 4.0 * rms / (all.len() as f64).sqrt(),
            "bias {bias_x} {bias_y}"
        );
        assert!(
            all.len() * 1000 >= wanted * 995 && strays <= 2,
            "{}/{wanted}, {strays}",
            all.len()
        );
        let mean = all.iter().map(|(_, at)| at.snr).sum::<f64>() / all.len() as f64;
        assert!(
            (mean / snr - 1.0).abs() < 0.25,
            "measured snr {mean}, true {snr}"
        );
        let flux = all.iter().map(|(_, at)| at.flux_e).sum::<f64>() / all.len() as f64;
        assert!(
            (flux / electrons - 1.0).abs() < 0.05,
            "flux {flux} of {electrons}"
        );
    }
}

#[test]
fn a_star_of_snr_10_is_nearly_always_found() {
    let field = Field::default();
    let mut noise = Noise::new(3);
    let stars = field.grid(12, 345.0, &mut noise);
    let snr = field.snr(stars[0]);
    let (pairs, strays) = find(&field, &stars, (0.0, 0.0), Some(&mut noise));
    println!(
        "snr {snr:.1}: {}/{} found, rms {:.3} px, {strays} strays",
        pairs.len(),
        stars.len(),
        residual(&pairs).0
    );
    assert!((9.0..11.0).contains(&snr), "{snr}");
    assert!(
        pairs.len() * 100 >= stars.len() * 97,
        "{}/{}",
        pairs.len(),
        stars.len()
    );
}

#[test]
fn an_empty_sky_gives_hardly_a_false_detection() {
    let field = Field::default();
    let mut noise = Noise::new(11);
    let strays: usize = (0..10)
        .map(|_| find(&field, &[], (0.0, 0.0), Some(&mut noise)).1)
        .sum();
    println!("{strays} false detections in 10 frames of 65,536 pixels");
    assert!(strays <= 3, "{strays}");
}

#[test]
fn a_smeared_star_keeps_its_centre() {
    let field = Field::default();
    let mut noise = Noise::new(5);
    for smear in [(1.0, 0.0), (3.0, 2.0), (-4.0, 5.0)] {
        let stars = field.grid(24, 6000.0, &mut noise);
        let (pairs, _) = find(&field, &stars, smear, Some(&mut noise));
        let (rms, ..) = residual(&pairs);
        println!(
            "smear {smear:?}: {}/{} found, rms {rms:.3} px",
            pairs.len(),
            stars.len()
        );
        assert_eq!(pairs.len(), stars.len());
        assert!(rms < 0.12, "{smear:?}: {rms}");
    }
}

#[test]
fn a_sloping_background_does_not_pull() {
    let field = Field::default();
    let mut noise = Noise::new(13);
    let stars = field.grid(16, 4000.0, &mut noise);
    let mut electrons = field.electrons(&stars, (0.0, 0.0));
    for (index, e) in electrons.iter_mut().enumerate() {
        *e += 4.0 * (index % field.width) as f64;
    }
    let pixels = field.expose(&electrons, &mut noise);
    let detections = detect(&field.image(0, &pixels), &DetectorSettings::default());
    let (pairs, strays) = pair(&stars, detections.list());
    let (rms, bias_x, _) = residual(&pairs);
    println!("slope 4 e-/px: rms {rms:.3}, bias {bias_x:+.4} px");
    assert!(
        pairs.len() == stars.len() && strays <= 1 && rms < 0.07 && bias_x.abs() < 0.02,
        "{rms} {bias_x} {strays}"
    );
}

#[test]
fn two_stars_that_run_together_are_two() {
    let field = Field::default();
    let mut noise = Noise::new(19);
    for distance in [4.0, 6.0, 8.0] {
        let mut stars = field.grid(32, 6000.0, &mut noise);
        for mut star in stars.clone() {
            star.x += distance * 0.8;
            star.y -= distance * 0.6;
            star.electrons *= 0.6;
            stars.push(star);
        }
        let (pairs, strays) = find(&field, &stars, (0.0, 0.0), Some(&mut noise));
        let (rms, ..) = residual(&pairs);
        println!(
            "{distance} px apart: {}/{} found, rms {rms:.3} px",
            pairs.len(),
            stars.len()
        );
        assert_eq!((pairs.len(), strays), (stars.len(), 0));
        assert!(rms < 0.1, "{distance}: {rms}");
    }
}

#[test]
fn edges_and_saturation_are_flagged() {
    let field = Field::default();
    let star = |x, y, electrons| Star { x, y, electrons };
    let stars = [
        star(1.0, 100.0, 5000.0),
        star(100.0, 254.6, 5000.0),
        star(60.0, 60.0, 200_000.0),
        star(120.0, 80.0, 5000.0),
    ];
    let (pairs, strays) = find(&field, &stars, (0.0, 0.0), Some(&mut Noise::new(17)));
    let flags: Vec<(bool, bool)> = pairs
        .iter()
        .map(|(_, at)| (at.edge, at.saturated))
        .collect();
    assert_eq!(
        flags,
        [(true, false), (true, false), (false, true), (false, false)]
    );
    assert_eq!(strays, 0);
}

#[test]
fn odd_images_do_no_harm() {
    let settings = DetectorSettings::default();
    for (width, height) in [(1, 1), (1, 70), (70, 1), (3, 2), (33, 65), (0, 0), (0, 5)] {
        let field = Field {
            width,
            height,
            ..Field::default()
        };
        for value in [0, 100, 4095, 65_535] {
            let pixels = vec![value; width * height];
            assert!(
                detect(&field.image(1, &pixels), &settings)
                    .list()
                    .is_empty()
            );
        }
        let mut noise = Noise::new(width as u64 + 1);
        let pixels: Vec<u16> = (0..width * height).map(|_| noise.bits() as u16).collect();
        let _ = detect(&field.image(1, &pixels), &settings);
        // A buffer that does not fill the image.
        assert!(
            detect(&field.image(1, &vec![0; width * height + 1]), &settings)
                .list()
                .is_empty()
        );
    }
    // Numbers that no header should hold.
    let pixels = vec![7; 64 * 64];
    for (gain, offset) in [
        (f64::NAN, 0.0),
        (f64::INFINITY, 1.0),
        (0.0, 0.0),
        (-1.0, f64::NAN),
        (1e300, -1e300),
    ] {
        let field = Field {
            width: 64,
            height: 64,
            gain_e_per_dn: gain,
            offset_dn: offset,
            ..Field::default()
        };
        let _ = detect(&field.image(1, &pixels), &settings);
    }
}
