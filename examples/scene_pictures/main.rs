//! Draws the pictures of docs/explanation/scenes.md: one frame of each scene.
//! `cargo run --release --example scene_pictures`.
//!
//! Grey, up to [`WIDEST_PX`] wide, stretched so that faint light is visible. Two lines point at
//! each object in orbit.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{GrayImage, Luma};
use skyloop::config::Config;
use skyloop::engine::Emulator;
use skyloop::flight;
use skyloop::frame::Frame;
use std::error::Error;
use std::path::Path;

/// Largest width of a picture.
const WIDEST_PX: usize = 512;
/// Greys follow asinh(SOFT x), where x is the light, 0 at black and 1 at white.
const SOFT: f64 = 5.0;
/// Smallest range from black to white, DN.
const MIN_DN: f64 = 20.0;
/// Scenes with light over the whole field; in their pictures, black is the offset of the detector.
const FULL: &[&str] = &["earth-by-day"];
/// Scenes whose picture is not of their first frame, and the number of the frame.
const FRAMES: &[(&str, u32)] = &[
    ("near-sun", 3),
    ("rcm-2019-06-15", 20),
    ("tumbling-rocket-body", 7),
];

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let out = root.join("docs/scenes");
    std::fs::create_dir_all(&out)?;
    for entry in std::fs::read_dir(root.join("configs/scenes"))? {
        let path = entry?.path();
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let scene = match path.extension() {
            Some(extension) if extension == "toml" => path.clone(),
            Some(_) => continue,
            None => path.join("scene.toml"),
        };
        let file = out.join(format!("{name}.png"));
        let frame = FRAMES.iter().find(|(known, _)| *known == name);
        draw(&name, &scene, frame.map_or(0, |(_, frame)| *frame), &file)?;
        println!("{}", file.display());
    }
    Ok(())
}

fn draw(name: &str, scene: &Path, number: u32, file: &Path) -> Result<(), Box<dyn Error>> {
    let mut config = Config::load(scene)?;
    let mission = flight::mission(&config)?;
    let mut emulator = Emulator::new(&mut config);
    let exposed = emulator.expose(&flight::vehicle(&mission, number)?, 0)?;
    let step = exposed.frame.width.div_ceil(WIDEST_PX);
    let offset_dn = exposed.camera.detector.offset_dn;
    let black = FULL.contains(&name).then_some(offset_dn);
    let mut picture = stretched(&exposed.frame, step, black);
    for object in &exposed.label.objects.sources {
        if object.kind == "rso" && object.visible {
            let at = [object.x_px, object.y_px].map(|px| ((px + 0.5) / step as f64) as i64);
            mark(&mut picture, at);
        }
    }
    let out = std::fs::File::create(file)?;
    picture.write_with_encoder(PngEncoder::new_with_quality(
        out,
        CompressionType::Best,
        FilterType::Adaptive,
    ))?;
    Ok(())
}

/// Means of `step` by `step` pixels. Black is `black`, or the lower quartile; white is the 0.999
/// quantile.
fn stretched(frame: &Frame, step: usize, black: Option<f64>) -> GrayImage {
    let (columns, rows) = (frame.width / step, frame.height / step);
    let mean = |x: usize, y: usize| {
        let pixels =
            (0..step * step).map(|i| (y * step + i / step) * frame.width + x * step + i % step);
        let sum: f64 = pixels.map(|pixel| f64::from(frame.dn[pixel])).sum();
        sum / (step * step) as f64
    };
    let values: Vec<f64> = (0..columns * rows)
        .map(|i| mean(i % columns, i / columns))
        .collect();
    let mut sorted = values.clone();
    sorted.sort_by(f64::total_cmp);
    let quantile = |part: f64| sorted[((sorted.len() - 1) as f64 * part) as usize];
    let (dark, white) = (quantile(0.25), quantile(0.999));
    let black = black.unwrap_or(dark);
    let grey = |value: f64| {
        let part = (value - black) / (white - black).max(MIN_DN);
        (255.0 * (SOFT * part).asinh() / SOFT.asinh()).clamp(0.0, 255.0) as u8
    };
    GrayImage::from_fn(columns as u32, rows as u32, |x, y| {
        Luma([grey(values[y as usize * columns + x as usize])])
    })
}

/// Two lines that point at an object from the left and from above.
fn mark(picture: &mut GrayImage, [x, y]: [i64; 2]) {
    for away in 6..14 {
        for [x, y] in [[x - away, y], [x, y - away]] {
            if let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y))
                && let Some(pixel) = picture.get_pixel_mut_checked(x, y)
            {
                *pixel = Luma([255]);
            }
        }
    }
}
