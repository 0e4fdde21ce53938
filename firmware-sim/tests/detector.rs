//! The detector on star fields with known positions.

use crate::common::{Field, Noise, Star};
use skyloop_firmware_sim::detector::{Detection, DetectorSettings, detect};

/// Stars with their detections, and the number of detections without a star.
type Found = (Vec<(Star, Detection)>, usize);

const NO_SMEAR: (f64, f64) = (0.0, 0.0);

/// Detects with noise, or without noise in steps of 1/16 e-, for the error of the method itself.
fn find(field: &Field, stars: &[Star], smear: (f64, f64), noise: Option<&mut Noise>) -> Found {
    let electrons = field.electrons(stars, smear);
    let Some(noise) = noise else {
        let fine = Field {
            gain_e_per_dn: 1.0 / 16.0,
            offset_dn: 0.0,
            bits: 16,
            ..*field
        };
        let dn = electrons.iter();
        let dn: Vec<u16> = dn
            .map(|e| (e * 16.0).round().min(65_535.0) as u16)
            .collect();
        return found_in(&fine, &dn, stars);
    };
    found_in(field, &field.expose(&electrons, noise), stars)
}

fn found_in(field: &Field, pixels: &[u16], stars: &[Star]) -> Found {
    let detections = detect(&field.image(0, pixels), &DetectorSettings::default());
    let found = detections.list();
    let near = |star: &Star, at: &Detection| (at.x_px - star.x).hypot(at.y_px - star.y) < 2.0;
    let pairs = stars.iter().filter_map(|star| {
        let at = found.iter().find(|at| near(star, at))?;
        Some((*star, *at))
    });
    let is_stray = |at: &&Detection| !stars.iter().any(|star| near(star, at));
    (pairs.collect(), found.iter().filter(is_stray).count())
}

/// Root mean square of the distance and mean of the offsets, px.
fn residual(pairs: &[(Star, Detection)]) -> (f64, f64, f64) {
    let offset = |(star, at): &(Star, Detection)| (at.x_px - star.x, at.y_px - star.y);
    let mean = |of: fn((f64, f64)) -> f64| {
        let sum: f64 = pairs.iter().map(|pair| of(offset(pair))).sum();
        sum / pairs.len() as f64
    };
    (
        mean(|(x, y)| x * x + y * y).sqrt(),
        mean(|o| o.0),
        mean(|o| o.1),
    )
}

#[test]
fn noiseless_centroids_are_accurate() {
    for (psf_px, limit) in [(0.6, 0.01), (0.7, 0.005), (1.0, 0.005), (1.5, 0.005)] {
        let field = Field {
            psf_px,
            ..Field::default()
        };
        let stars = field.grid(16, 6000.0, &mut Noise::new(1));
        let (pairs, strays) = find(&field, &stars, NO_SMEAR, None);
        let (rms, ..) = residual(&pairs);
        println!("psf {psf_px}: {} stars, rms {rms:.5} px", pairs.len());
        assert_eq!((pairs.len(), strays), (stars.len(), 0));
        assert!(rms < limit, "psf {psf_px}: rms {rms}");
    }
}

#[test]
fn centroid_errors_stay_near_the_noise_limit() {
    let field = Field::default();
    for (electrons, snr_near, limit) in [
        (800.0, 20.0, 0.08),
        (1300.0, 30.0, 0.055),
        (4000.0, 60.0, 0.03),
        (9000.0, 92.0, 0.02),
    ] {
        let mut noise = Noise::new(7);
        let (mut all, mut expected, mut strays) = (Vec::new(), 0, 0);
        for _ in 0..4 {
            let stars = field.grid(16, electrons, &mut noise);
            expected += stars.len();
            let (pairs, stray) = find(&field, &stars, NO_SMEAR, Some(&mut noise));
            all.extend(pairs);
            strays += stray;
        }
        let snr = field.snr(Star {
            x: 128.2,
            y: 128.3,
            electrons,
        });
        let (rms, bias_x, bias_y) = residual(&all);
        let count = all.len();
        println!(
            "snr {snr:.1}: rms {rms:.4} px, bias {bias_x:+.4} {bias_y:+.4} px, {count}/{expected} found, {strays} strays"
        );
        assert!((snr / snr_near - 1.0).abs() < 0.1, "snr {snr}");
        assert!(rms < limit, "snr {snr}: rms {rms}");
        let max = 4.0 * rms / (count as f64).sqrt();
        assert!(bias_x.hypot(bias_y) < max, "bias {bias_x} {bias_y}");
        assert!(count * 1000 >= expected * 995 && strays <= 2, "{count}");
        let mean = |of: fn(&Detection) -> f64| {
            all.iter().map(|(_, at)| of(at)).sum::<f64>() / count as f64
        };
        let (found_snr, flux) = (mean(|at| at.snr), mean(|at| at.flux_e));
        assert!((found_snr / snr - 1.0).abs() < 0.25, "{found_snr}");
        assert!((flux / electrons - 1.0).abs() < 0.05, "flux {flux}");
    }
}

#[test]
fn stars_of_snr_10_are_almost_always_found() {
    let field = Field::default();
    let mut noise = Noise::new(3);
    let stars = field.grid(12, 345.0, &mut noise);
    let snr = field.snr(stars[0]);
    let (pairs, strays) = find(&field, &stars, NO_SMEAR, Some(&mut noise));
    let (found, all, rms) = (pairs.len(), stars.len(), residual(&pairs).0);
    println!("snr {snr:.1}: {found}/{all} found, rms {rms:.3} px, {strays} strays");
    assert!((9.0..11.0).contains(&snr), "{snr}");
    assert!(found * 100 >= all * 97, "{found}/{all}");
}

#[test]
fn empty_fields_give_almost_no_false_detections() {
    let field = Field::default();
    let mut noise = Noise::new(11);
    let strays: usize = (0..10)
        .map(|_| find(&field, &[], NO_SMEAR, Some(&mut noise)).1)
        .sum();
    println!("{strays} false detections in 10 frames of 65,536 pixels");
    assert!(strays <= 3, "{strays}");
}

#[test]
fn smear_does_not_shift_centroids() {
    let field = Field::default();
    let mut noise = Noise::new(5);
    for smear in [(1.0, 0.0), (3.0, 2.0), (-4.0, 5.0)] {
        let stars = field.grid(24, 6000.0, &mut noise);
        let (pairs, _) = find(&field, &stars, smear, Some(&mut noise));
        let (rms, ..) = residual(&pairs);
        assert_eq!(pairs.len(), stars.len());
        assert!(rms < 0.12, "{smear:?}: {rms}");
    }
}

#[test]
fn background_gradients_do_not_bias_centroids() {
    let field = Field::default();
    let mut noise = Noise::new(13);
    let stars = field.grid(16, 4000.0, &mut noise);
    let mut electrons = field.electrons(&stars, (0.0, 0.0));
    for (index, e) in electrons.iter_mut().enumerate() {
        *e += 4.0 * (index % field.width) as f64;
    }
    let (pairs, strays) = found_in(&field, &field.expose(&electrons, &mut noise), &stars);
    let (rms, bias_x, _) = residual(&pairs);
    assert!(pairs.len() == stars.len() && strays <= 1, "{strays}");
    assert!(rms < 0.07 && bias_x.abs() < 0.02, "{rms} {bias_x}");
}

#[test]
fn merged_stars_are_split() {
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
        let (pairs, strays) = find(&field, &stars, NO_SMEAR, Some(&mut noise));
        let (rms, ..) = residual(&pairs);
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
    let (pairs, strays) = find(&field, &stars, NO_SMEAR, Some(&mut Noise::new(17)));
    let flags = pairs.iter().map(|(_, at)| (at.edge, at.saturated));
    let flags: Vec<(bool, bool)> = flags.collect();
    let edge = (true, false);
    assert_eq!(flags, [edge, edge, (false, true), (false, false)]);
    assert_eq!(strays, 0);
}

#[test]
fn degenerate_images_are_handled() {
    let finds = |field: &Field, pixels: &[u16]| {
        let detections = detect(&field.image(1, pixels), &DetectorSettings::default());
        !detections.list().is_empty()
    };
    for (width, height) in [(1, 1), (1, 70), (70, 1), (3, 2), (33, 65), (0, 0), (0, 5)] {
        let field = Field {
            width,
            height,
            ..Field::default()
        };
        for value in [0, 100, 4095, 65_535] {
            assert!(!finds(&field, &vec![value; width * height]));
        }
        let mut noise = Noise::new(width as u64 + 1);
        let pixels: Vec<u16> = (0..width * height).map(|_| noise.bits() as u16).collect();
        finds(&field, &pixels);
        // A buffer of the wrong size.
        assert!(!finds(&field, &vec![0; width * height + 1]));
    }
    // Values that no valid header has.
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
        finds(&field, &pixels);
    }
}
