//! From digits to grey levels: scaled to a panel's size, stretched so that faint stars show.

/// Longer side of a panel, px.
const PANEL_PX: usize = 512;
/// Grey levels go by asinh((DN - median) / (SOFT sigma)) ...
const SOFT: f64 = 2.5;
/// ... from this many sigma (black) ...
const BLACK: f64 = -1.5;
/// ... to this many (white).
const WHITE: f64 = 250.0;

/// Size of the panel for a camera of `size` columns and rows: a whole multiple of a small camera,
/// a large one scaled down to [`PANEL_PX`].
pub fn panel_size(size: [usize; 2]) -> [usize; 2] {
    let longer = size[0].max(size[1]).max(1);
    if longer <= PANEL_PX {
        size.map(|n| n * (PANEL_PX / longer))
    } else {
        size.map(|n| (n * PANEL_PX).div_ceil(longer))
    }
}

/// The digits at the panel's size: neighbours repeated up, areas averaged down.
pub fn scaled(digits: &[u16], from: [usize; 2], to: [usize; 2]) -> Vec<f32> {
    let rows: Vec<f32> = digits
        .chunks_exact(from[0].max(1))
        .flat_map(|row| resampled(from[0], to[0], |i| f32::from(row[i])))
        .collect();
    let mut out = vec![0.0; to[0] * to[1]];
    for x in 0..to[0] {
        let column = resampled(from[1], to[1], |y| rows[y * to[0] + x]);
        for (y, value) in column.enumerate() {
            out[y * to[0] + x] = value;
        }
    }
    out
}

/// `to` means over equal parts of `from` values; where a part lies in one value, that value.
fn resampled(from: usize, to: usize, value: impl Fn(usize) -> f32) -> impl Iterator<Item = f32> {
    let step = from as f64 / to as f64;
    (0..to).map(move |i| {
        let (start, end) = (i as f64 * step, (i + 1) as f64 * step);
        let last = ((end - 1e-9) as usize).min(from - 1);
        let sum: f64 = (start as usize..=last)
            .map(|j| {
                let overlap = end.min((j + 1) as f64) - start.max(j as f64);
                overlap * f64::from(value(j))
            })
            .sum();
        (sum / step) as f32
    })
}

/// Grey levels of the values: black just below the background, whose level and spread are the median
/// and the median deviation (stars do not move them), but no less spread than `sigma`. As far as the background is on its way from the first
/// to the second of `range`, all is so much nearer to white: a frame that is full of light is white.
pub fn grey(values: &[f32], sigma: f64, range: [f64; 2]) -> Vec<u8> {
    let level = median(values.to_vec());
    let way = (f64::from(level) - range[0]) / (range[1] - range[0]).max(1e-9);
    let lit = way.clamp(0.0, 1.0);
    let deviation = median(values.iter().map(|v| (v - level).abs()).collect());
    // 1.4826 makes the median deviation of a normal distribution its sigma.
    let sigma = sigma.max(1.4826 * f64::from(deviation)).max(1e-9);
    let curve = |z: f64| libm::asinh(z / SOFT);
    let (black, white) = (curve(BLACK), curve(WHITE));
    values
        .iter()
        .map(|v| {
            let part = (curve(f64::from(v - level) / sigma) - black) / (white - black);
            let part = part.clamp(0.0, 1.0);
            ((lit + (1.0 - lit) * part) * 255.0).round() as u8
        })
        .collect()
}

fn median(mut values: Vec<f32>) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_fit_any_camera() {
        assert_eq!(panel_size([256, 256]), [512, 512]);
        assert_eq!(panel_size([1280, 1024]), [512, 410]);
        assert_eq!(panel_size([300, 200]), [300, 200]);
        assert_eq!(panel_size([8192, 1]), [512, 1]);
        assert_eq!(panel_size([1, 1]), [512, 512]);
    }

    #[test]
    fn scaling_repeats_up_and_averages_down() {
        assert_eq!(
            scaled(&[1, 2], [2, 1], [4, 2]),
            [1., 1., 2., 2., 1., 1., 2., 2.]
        );
        assert_eq!(scaled(&[1, 2, 3, 4, 5, 6], [3, 2], [1, 1]), [3.5]);
        // Half of the middle one each: (1 + 0.5 * 4) / 1.5 and (0.5 * 4 + 7) / 1.5.
        assert_eq!(scaled(&[1, 4, 7], [3, 1], [2, 1]), [2.0, 6.0]);
        let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len() as f32;
        let digits: Vec<u16> = (0..1280 * 1024u64)
            .map(|i| (i * 7919 % 4096) as u16)
            .collect();
        let small = scaled(&digits, [1280, 1024], [512, 410]);
        assert!((mean(&small) - 2047.5).abs() < 0.5);
    }

    #[test]
    fn a_flat_noise_free_frame_is_dark_and_a_bright_star_white() {
        let mut values = vec![100.0; 1000];
        values[5] = 4000.0;
        let dark = grey(&values, 2.0, [100.0, 4095.0]);
        assert!(dark[0] > 5 && dark[0] < 60 && dark[5] == 255);
        // The same where 100 is the most that a pixel tells.
        assert!(grey(&values, 2.0, [0.0, 100.0]) == [255; 1000]);
    }
}
