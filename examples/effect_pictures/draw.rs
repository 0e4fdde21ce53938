//! Draws a picture: without the effect on the left, with it on the right. Both have stars, objects,
//! readout and the picture's `others`; all other effects are switched off.

use crate::pictures::{CAMERA, Picture, SCENE, Tone};
use image::{GrayImage, Luma};
use nalgebra::Vector3;
use skyloop::camera::{Camera, Optics, Projection};
use skyloop::config::{Config, Observer};
use skyloop::effect::EFFECTS;
use skyloop::engine::Emulator;
use skyloop::flight;
use skyloop::frame::Frame;
use skyloop::load::Folder;
use skyloop::orbit::StateVector;
use std::error::Error;

/// Columns and rows of the square that is cut from the middle of a frame.
const SIDE: usize = 96;

/// Both sides of a picture as PNG.
pub fn png(picture: &Picture) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut config = match picture.effect {
        // The satellites of the built-in scene.
        "rsos" => Config::builtin()?,
        _ => config(picture)?,
    };
    let mission = flight::mission(&config)?;
    let mut emulator = Emulator::new(&mut config);
    let vehicle = flight::vehicle(&mission, mission.frames / 2)?;
    let always_on = ["stars", "rsos", "readout", picture.effect];
    let is_on = |name: &str| always_on.contains(&name) || picture.others.contains(&name);
    let effects = EFFECTS.iter().map(|effect| effect.name);
    emulator.choice.off = effects.filter(|name| !is_on(name)).collect();
    emulator.choice.all = true;
    let with = emulator.expose(&vehicle, 0)?.frame;
    emulator.choice.off.push(picture.effect);
    let without = emulator.expose(&vehicle, 0)?.frame;
    let detector = &emulator.camera().detector;
    let corner = [detector.width, detector.height].map(|pixels| (pixels - SIDE) / 2);
    let electrons = |frame: Frame| -> Vec<f64> {
        let rows = frame.dn.chunks_exact(frame.width);
        let rows = rows.skip(corner[1]).take(SIDE);
        let dn = rows.flat_map(|row| &row[corner[0]..corner[0] + SIDE]);
        let charge = |dn: &u16| (f64::from(*dn) - detector.offset_dn) * detector.gain_e_per_dn;
        dn.map(charge).collect()
    };
    let sides = [electrons(without), electrons(with)];
    let mut image = side_by_side(&sides, picture);
    let optics = &emulator.camera().optics;
    match picture.effect {
        "distortion" => {
            draw_grid(&mut image, 0, optics, &optics.projection.ideal());
            draw_grid(&mut image, 1, optics, &optics.projection);
        }
        "non-linearity" => draw_profiles(&mut image, &sides, picture.levels_e[1]),
        _ => {}
    }
    let mut file = std::io::Cursor::new(Vec::new());
    image.write_to(&mut file, image::ImageFormat::Png)?;
    Ok(file.into_inner())
}

fn config(picture: &Picture) -> Result<Config, Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let merged = |base: &str, more: &str| -> Result<String, Box<dyn Error>> {
        let mut table: toml::Table = base.parse()?;
        merge(&mut table, more.parse()?);
        Ok(toml::to_string(&table)?)
    };
    std::fs::write(
        folder.path().join("camera.toml"),
        merged(CAMERA, picture.camera)?,
    )?;
    let scene = merged(SCENE, picture.scene)?;
    let file = folder.path().join("scene.toml");
    let mut config = Config::parse("scene.toml", &scene, &Folder::of(&file))?;
    config.camera = Camera::load("camera.toml", &Folder::of(&file))?;
    let [x, y, z, vx, vy, vz] = picture.observer.map(|km| km * 1e3);
    if picture.observer != [0.0; 6] {
        config.observer = Some(Observer::State(StateVector {
            position_m: Vector3::new(x, y, z),
            velocity_m_s: Vector3::new(vx, vy, vz),
        }));
    }
    Ok(config)
}

/// Sets `more`'s keys in `table`, recursively in tables.
fn merge(table: &mut toml::Table, more: toml::Table) {
    for (key, value) in more {
        match (table.get_mut(&key), value) {
            (Some(toml::Value::Table(inner)), toml::Value::Table(more)) => merge(inner, more),
            (_, value) => {
                table.insert(key, value);
            }
        }
    }
}

/// Width of a frame's pixel in the picture.
const SCALE: usize = 3;
/// Columns between the two sides.
const GAP: usize = 6;

/// Two frames side by side.
fn side_by_side(frames: &[Vec<f64>; 2], picture: &Picture) -> GrayImage {
    let (columns, rows) = (2 * SIDE * SCALE + GAP, SIDE * SCALE);
    let [black, white] = picture.levels_e;
    let stretch = |part: f64| match picture.tone {
        Tone::Stretched => (10.0 * part).asinh() / 10f64.asinh(),
        Tone::Linear => part,
    };
    let grey = |e: f64| (255.0 * stretch((e - black) / (white - black))).clamp(0.0, 255.0) as u8;
    let mut image = GrayImage::from_pixel(columns as u32, rows as u32, Luma([255]));
    for (side, frame) in frames.iter().enumerate() {
        for y in 0..rows {
            for x in 0..SIDE * SCALE {
                let level = grey(frame[y / SCALE * SIDE + x / SCALE]);
                let column = x + side * (SIDE * SCALE + GAP);
                image.put_pixel(column as u32, y as u32, Luma([level]));
            }
        }
    }
    image
}

/// Draws the image of a grid of straight lines, which are 12 px apart in a pinhole camera.
fn draw_grid(image: &mut GrayImage, side: usize, optics: &Optics, projection: &Projection) {
    const APART_PX: f64 = 12.0;
    const LEVEL: u8 = 90;
    const LINES: i32 = 12;
    let step = APART_PX / optics.focal_px;
    for line in -LINES..=LINES {
        for part in -LINES * 100..=LINES * 100 {
            let (across, along) = (f64::from(line) * step, f64::from(part) * step / 100.0);
            for [x, y] in [[across, along], [along, across]] {
                let at = optics.project_by(projection, &Vector3::new(x, y, 1.0));
                // The centre of a pixel has integer coordinates.
                let at = at.map(|at| at.map(|px| ((px + 0.5) * SCALE as f64).floor()));
                let inside =
                    |at: &[f64; 2]| at.iter().all(|x| (0.0..(SIDE * SCALE) as f64).contains(x));
                if let Some([column, row]) = at.filter(inside) {
                    let column = column as usize + side * (SIDE * SCALE + GAP);
                    let pixel = image.get_pixel_mut(column as u32, row as u32);
                    pixel.0[0] = pixel.0[0].max(LEVEL);
                }
            }
        }
    }
}

/// Plots the electrons of the row with the fullest pixel, along the lower edge. The right side also
/// has the plot of the left side.
fn draw_profiles(image: &mut GrayImage, frames: &[Vec<f64>; 2], full_e: f64) {
    const HEIGHT: f64 = 100.0;
    const OTHER: u8 = 120;
    const OWN: u8 = 255;
    let rows = || frames[0].chunks_exact(SIDE);
    let max = |row: &[f64]| row.iter().copied().fold(0.0, f64::max);
    let fullest = rows().map(max).fold(0.0, f64::max);
    let row = rows().position(|row| max(row) == fullest).unwrap_or(0);
    let height = |frame: &[f64], x: usize| {
        let column = (x / SCALE).min(SIDE - 1);
        (HEIGHT * (frame[row * SIDE + column] / full_e).clamp(0.0, 1.0)) as usize
    };
    for (side, frame, level) in [(0, 0, OWN), (1, 0, OTHER), (1, 1, OWN)] {
        for x in 0..SIDE * SCALE {
            let (this, next) = (height(&frames[frame], x), height(&frames[frame], x + 1));
            for up in this.min(next)..=this.max(next) {
                let column = x + side * (SIDE * SCALE + GAP);
                let row = SIDE * SCALE - 2 - up;
                image.put_pixel(column as u32, row as u32, Luma([level]));
            }
        }
    }
}
