//! Signal-to-noise ratios of labels: sources by the scatter over frames, particles and defects by
//! hand.

use std::collections::HashMap;

use skyloop::camera::Camera;
use skyloop::label::ObjectLabel;

use super::{emulator, expose, mean, text};

/// A star's matched filter, and its amplitudes in the frames.
struct Filter {
    snr: f64,
    /// Index, response to the star in read electrons, signal without it, weight.
    pixels: Vec<(usize, f64, f64, f64)>,
    hot: bool,
    blind: bool,
    amplitudes: Vec<f64>,
}

impl Filter {
    /// The filter of the star of `snr` at `at`, by hand from the expected charge of the pixels.
    fn new(snr: f64, at: [f64; 2], camera: &Camera, expected: &[f32]) -> Filter {
        let detector = &camera.detector;
        let (well, share) = (detector.full_well_e, detector.nonlinearity);
        let (read_e, gain) = (detector.read_noise_e, detector.gain_e_per_dn);
        let (cx, cy) = (at[0].round() as usize, at[1].round() as usize);
        let (mut pixels, mut hot, mut blind) = (Vec::new(), false, false);
        for y in cy - 6..=cy + 6 {
            for x in cx - 6..=cx + 6 {
                let i = y * 256 + x;
                let held = f64::from(expected[i]);
                let b = detector.pattern.dark_e_s_of(i) * camera.exposure_s;
                let core = x.abs_diff(cx) <= 1 && y.abs_diff(cy) <= 1;
                hot |= core && b > 2000.0;
                let pattern = &detector.pattern;
                let lists = [pattern.dead(), pattern.stuck()];
                let is_blind = lists.iter().any(|list| list.contains(&(i as u32)));
                blind |= core && is_blind;
                if is_blind || held >= well {
                    continue;
                }
                let read = |e: f64| e * (1.0 - share * e / well);
                let slope = 1.0 - 2.0 * share * held / well;
                let signal = read(held) - read(b);
                let variance = slope * slope * held + read_e * read_e + gain * gain / 12.0;
                pixels.push((i, signal, read(b), signal / variance));
            }
        }
        Filter {
            snr,
            pixels,
            hot,
            blind,
            amplitudes: Vec::new(),
        }
    }

    /// The labelled ratio times the scatter of the amplitudes; expected to be 1.
    fn ratio(&self) -> f64 {
        let n = self.amplitudes.len() as f64;
        let centre = mean(self.amplitudes.iter().copied());
        let variance = mean(self.amplitudes.iter().map(|a| (a - centre) * (a - centre)));
        let scatter = (variance * n / (n - 1.0)).sqrt();
        // Curvature and clipped tails bias the mean by some thousandths.
        let bound = 5.0 * scatter / n.sqrt() + 0.01;
        assert!((centre - 1.0).abs() < bound, "{centre}");
        self.snr * scatter
    }
}

/// Checks the ratios of isolated stars on a detector over `frames` frames: the matched-filter
/// amplitude of each star scatters by 1 / snr.
fn check_scatter(keys: &str, exposure_s: f64, frames: u32) -> Vec<Filter> {
    let mut emulator = emulator(&text(true, keys, ""));
    emulator.camera_mut().exposure_s = exposure_s;
    emulator.keep_expected = true;
    emulator.choice.noise = false;
    let still = expose(&mut emulator, 0);
    emulator.keep_expected = false;
    emulator.choice.noise = true;
    let expected = still.frame.expected_e.unwrap();
    let detector = &still.camera.detector;
    let (offset_dn, gain) = (detector.offset_dn, detector.gain_e_per_dn);
    let objects = &still.label.objects;
    let alone = |at: [f64; 2], own: f64| {
        let is_near = |o: &&ObjectLabel| (o.x_px - at[0]).hypot(o.y_px - at[1]) < 12.0;
        let near = objects.iter().filter(is_near);
        near.map(|o| o.electrons).sum::<f64>() - own < 2e-3 * own
    };
    let mut filters = Vec::new();
    for star in objects.iter().filter(|o| o.in_frame && o.snr > 4.0) {
        let at = [star.x_px, star.y_px];
        let inside = (8.0..247.0).contains(&at[0]) && (8.0..191.0).contains(&at[1]);
        if inside && alone(at, star.electrons) {
            filters.push(Filter::new(star.snr, at, &still.camera, &expected));
        }
    }
    assert!(filters.len() > 20, "{}", filters.len());
    for sequence in 1..=frames {
        let dn = expose(&mut emulator, sequence).frame.dn;
        for filter in &mut filters {
            let (mut top, mut bottom) = (0.0, 0.0);
            for (i, signal, without, weight) in &filter.pixels {
                top += weight * ((f64::from(dn[*i]) - offset_dn) * gain - without);
                bottom += weight * signal;
            }
            filter.amplitudes.push(top / bottom);
        }
    }
    // The scatter of one star is known to this part.
    let error = 1.0 / (2.0 * f64::from(frames)).sqrt();
    let ratios: Vec<f64> = filters.iter().map(Filter::ratio).collect();
    let all = mean(ratios.iter().copied());
    println!("{} stars, snr x scatter {all:.4}", ratios.len());
    for (filter, ratio) in filters.iter().zip(&ratios) {
        let what = (filter.snr, filter.hot, filter.blind);
        let is_met = (ratio - 1.0).abs() < 4.5 * error;
        assert!(is_met, "{ratio}: snr, hot, blind {what:?}");
    }
    let bound = 4.0 * error / (ratios.len() as f64).sqrt() + 0.005;
    assert!((all - 1.0).abs() < bound, "{all}");
    filters
}

#[test]
#[ignore = "long: minutes of work; tests/run all runs it"]
fn long_labels_signal_to_noise_is_the_scatter_over_frames() {
    let keys = "dark_e_s = 300.0
dark_nonuniformity = 0.5
hot_fraction = 0.03
hot_e_s = 4000.0
prnu = 0.15
dead_fraction = 0.01
stuck_fraction = 0.005
nonlinearity = 0.2
read_noise_e = 10.0
full_well_e = 12000.0
gain_e_per_dn = 20.0
offset_dn = 100.0";
    let filters = check_scatter(keys, 1.0, 600);
    // One star lies on a hot pixel, another one on a blind pixel.
    assert!(filters.iter().any(|f| f.hot) && filters.iter().any(|f| f.blind));
}

/// Faint stars: of a dark pixel's variance of 976 e-^2, read noise makes 576 and quantisation with
/// 60 e-/DN makes 300. Charge that differs from pixel to pixel decorrelates the quantisation
/// errors.
#[test]
fn snr_includes_read_noise_and_quantisation() {
    let keys = "dark_e_s = 2000.0
dark_nonuniformity = 0.5
read_noise_e = 24.0
full_well_e = 100000.0
gain_e_per_dn = 60.0
offset_dn = 100.0";
    check_scatter(keys, 0.05, 150);
}

/// Hand calculation: `e / sqrt(b + 9^2 + 12^2 / 12)` with 9 e- read noise, 12 e-/DN and each
/// pixel's own background b.
#[test]
fn artifact_snr_is_charge_over_pixel_noise() {
    let keys = "dark_e_s = 100.0
read_noise_e = 9.0
full_well_e = 150000.0
gain_e_per_dn = 12.0
offset_dn = 200.0
hot_fraction = 0.01
hot_e_s = 2000.0
dead_fraction = 0.01
stuck_fraction = 0.01
stuck_dn = 500.0";
    let table = "[radiation]\nflux_cm2_s = 300.0\nthickness_um = 20.0\ndiffusion_um = 8.0";
    let mut emulator = emulator(&text(true, keys, table));
    emulator.keep_expected = true;
    let exposed = expose(&mut emulator, 3);
    let expected = exposed.frame.expected_e.unwrap();
    let pattern = &exposed.camera.detector.pattern;
    let hot: HashMap<usize, f64> = (pattern.hot().iter())
        .map(|(pixel, excess)| (*pixel as usize, f64::from(*excess)))
        .collect();
    let artifacts = &exposed.label.objects.artifacts;
    let mut struck = vec![0.0; expected.len()];
    let index = |[x, y, _]: &[i64; 3]| (y * 256 + x) as usize;
    for artifact in artifacts
        .iter()
        .filter(|artifact| artifact.kind == "radiation")
    {
        for pixel in &artifact.pixels {
            struck[index(pixel)] += pixel[2] as f64;
        }
    }
    let noise = |b: f64| (b + 81.0 + 12.0).sqrt();
    let (mut lit, mut hit, mut seen) = (0, 0, HashMap::<&str, u32>::new());
    for artifact in artifacts {
        let of = |pixel: &[i64; 3]| {
            let i = index(pixel);
            let excess = hot.get(&i).copied().unwrap_or(0.0);
            (100.0 + excess, f64::from(expected[i]) + struck[i])
        };
        let (background, held) = of(&artifact.pixels[0]);
        let name = artifact.id.split(' ').next().unwrap();
        let snr = match name {
            "particle" => {
                let part = |pixel: &[i64; 3]| (pixel[2] as f64 / noise(of(pixel).0)).powi(2);
                artifact.pixels.iter().map(part).sum::<f64>().sqrt()
            }
            "dead" => held / noise(held),
            // (500 - 200) 12.
            "stuck" => (3600.0 - held).abs() / noise(held),
            _ => (background - 100.0) / noise(background),
        };
        let (id, labelled) = (&artifact.id, artifact.snr);
        let is_met = (labelled / snr - 1.0).abs() < 1e-5;
        assert!(is_met, "{id}: {labelled} in the label, {snr} by hand");
        let pixel = index(&artifact.pixels[0]);
        lit +=
            u32::from(artifact.kind == "defect" && f64::from(expected[pixel]) > background + 20.0);
        hit += u32::from(artifact.kind == "defect" && struck[pixel] > 20.0);
        *seen.entry(name).or_default() += 1;
    }
    // Some hundred of each kind; some of the defects lie under stars and particles.
    let kinds = ["particle", "dead", "stuck", "hot"];
    assert!(kinds.iter().all(|kind| seen[kind] > 50), "{seen:?}");
    assert!(lit > 5 && hit > 5, "{lit} {hit}");
}
