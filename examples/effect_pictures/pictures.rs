//! What is in each picture: a small camera with exaggerated figures, without the effect on the left and with it on the
//! right; all other effects but stars, objects and readout (and those beside it) are switched off in both.

use image::{GrayImage, Luma};
use nalgebra::Vector3;
use skyloop::attitude::Attitude;
use skyloop::camera::{Camera, Optics, Projection};
use skyloop::config::{Config, Observer};
use skyloop::effect::EFFECTS;
use skyloop::engine::Emulator;
use skyloop::flight;
use skyloop::frame::Frame;
use skyloop::load::Folder;
use skyloop::orbit::StateVector;
use std::error::Error;

/// One picture.
pub struct Picture {
    /// The effect, as plans name it.
    pub effect: &'static str,
    /// Keys of the camera file beside those of [`CAMERA`], as TOML.
    camera: &'static str,
    /// Keys of the scene, as TOML.
    scene: &'static str,
    /// Effects that run on both sides.
    beside: &'static [&'static str],
    /// Electrons that are black and white.
    levels_e: [f64; 2],
    /// How greys follow electrons between them.
    tone: Tone,
}

/// How greys follow electrons.
#[derive(Clone, Copy)]
enum Tone {
    /// Faint light shows, and bright light does not all look alike.
    Stretched,
    /// Twice the electrons are twice the grey.
    Linear,
}

/// Columns and rows of a picture's middle that are shown.
const SIDE: usize = 96;

/// Five degrees of sky: 96 x 96 pixels of a milliradian.
const CAMERA: &str = r#"
name = "picture"
[optics]
focal_length_mm = 20.0
aperture_mm = 20.0
transmission = 0.9
band = "silicon"
[optics.psf]
kind = "gaussian"
sigma_px = 0.9
[detector]
width_px = 96
height_px = 96
pixel_um = 20.0
quantum_efficiency = 0.6
dark_e_s = 0.0
read_noise_e = 0.0
full_well_e = 60000.0
gain_e_per_dn = 1.0
offset_dn = 100.0
adc_bits = 16
[timing]
exposure_s = 0.2
rate_hz = 1.0
"#;

/// The Pleiades.
const SCENE: &str = r#"
[sequence]
epoch = "2026-12-01T00:00:00Z"
frames = 1
period_s = 1.0
attitudes = [{ q = [0.521170458, -0.155615307, 0.240084982, 0.80406743] }]
"#;

/// Orion.
const ORION: &str = "sky.catalog = \"bsc\"\nsequence.attitudes = \
    [{ q = [0.712272964, -0.037328644, 0.036682757, 0.699948693] }]\n";

/// In the order of [`EFFECTS`].
pub const PICTURES: &[Picture] = &[
    Picture {
        effect: "distortion",
        camera: "optics.focal_length_mm = 4.0\noptics.projection = { model = \"brown-conrady\", k = [-1.6, 1.5] }\n",
        scene: ORION,
        beside: &[],
        levels_e: [0.0, 20000.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "aberration drift",
        camera: "optics.focal_length_mm = 8000.0\noptics.principal_px = [12.0, 24.0]\ntiming = { exposure_s = 1500.0, rate_hz = 0.0005 }\noptics.aperture_mm = 1.0\n",
        scene: "sequence.attitudes = [{ q = [0.52129861, -0.15505349, 0.239241716, 0.80434419] }]\n",
        beside: &["smear"],
        levels_e: [0.0, 60000.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "smear",
        camera: "",
        scene: "sequence.rates_deg_s = [2.0, 1.5, 40.0]\n",
        beside: &[],
        levels_e: [0.0, 3000.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "rolling shutter",
        camera: "timing = { exposure_s = 0.01, rate_hz = 1.0, shutter = \"rolling\", row_us = 1000.0 }\n",
        scene: "sequence.rates_deg_s = [0.0, 30.0, 0.0]\n",
        beside: &["smear"],
        levels_e: [0.0, 200.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "vignetting",
        camera: "optics.focal_length_mm = 4.0\noptics.vignetting.table = [[0.0, 1.0], [4.0, 0.9], [12.0, 0.1], [16.0, 0.0]]\n",
        scene: ORION,
        beside: &[],
        levels_e: [0.0, 20000.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "stars",
        camera: "",
        scene: "",
        beside: &[],
        levels_e: [0.0, 3000.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "rsos",
        camera: "",
        scene: "",
        beside: &[],
        levels_e: [0.0, 3000.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "pixel response",
        camera: "optics.psf.sigma_px = 8.0\ndetector.prnu = 0.15\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 300.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "frame transfer",
        camera: "timing = { exposure_s = 0.02, rate_hz = 1.0, shutter = \"frame-transfer\", row_us = 100.0 }\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 60.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "dark current",
        camera: "detector.dark_e_s = 200.0\ndetector.dark_nonuniformity = 0.3\ndetector.hot_fraction = 0.02\ndetector.hot_e_s = 2000.0\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 500.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "shot noise",
        camera: "detector.dark_e_s = 200.0\n",
        scene: "",
        beside: &["dark current"],
        levels_e: [0.0, 300.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "radiation",
        camera: "[radiation]\nflux_cm2_s = 1500.0\nthickness_um = 30.0\ndiffusion_um = 5.0\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 5000.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "full well",
        camera: "detector.full_well_e = 3000.0\ndetector.blooming = \"column\"\ntiming.exposure_s = 1.0\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 4000.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "dead pixels",
        camera: "detector.dark_e_s = 500.0\ndetector.dead_fraction = 0.03\n",
        scene: "",
        beside: &["dark current"],
        levels_e: [0.0, 300.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "non-linearity",
        camera: "detector.nonlinearity = 0.5\ndetector.full_well_e = 1800.0\noptics.psf.sigma_px = 3.0\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 1800.0],
        tone: Tone::Linear,
    },
    Picture {
        effect: "read noise",
        camera: "detector.read_noise_e = 30.0\n",
        scene: "",
        beside: &[],
        levels_e: [-100.0, 500.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "readout",
        camera: "detector.gain_e_per_dn = 200.0\ndetector.adc_bits = 4\ndetector.offset_dn = 0.0\noptics.psf.sigma_px = 4.0\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 3000.0],
        tone: Tone::Stretched,
    },
    Picture {
        effect: "stuck pixels",
        camera: "detector.stuck_fraction = 0.01\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 3000.0],
        tone: Tone::Stretched,
    },
];

impl Picture {
    /// Its file's name.
    pub fn file(&self) -> String {
        format!("{}.png", self.effect.replace(' ', "-"))
    }
}

/// Both sides of a picture as a PNG file.
pub fn png(picture: &Picture) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut config = match picture.effect {
        // The satellites of the built-in scene.
        "rsos" => Config::builtin()?,
        _ => config(picture)?,
    };
    let mission = flight::mission(&config)?;
    let mut emulator = Emulator::new(&mut config);
    let vehicle = flight::vehicle(&mission, mission.frames / 2)?;
    let kept = ["stars", "rsos", "readout", picture.effect];
    let kept = |name: &str| kept.contains(&name) || picture.beside.contains(&name);
    let effects = EFFECTS.iter().map(|effect| effect.name);
    emulator.choice.off = effects.filter(|name| !kept(name)).collect();
    emulator.choice.all = true;
    let with = emulator.shoot(&vehicle, 0)?.frame;
    emulator.choice.off.push(picture.effect);
    let without = emulator.shoot(&vehicle, 0)?.frame;
    let detector = &emulator.camera().detector;
    let corner = [detector.width, detector.height].map(|pixels| (pixels - SIDE) / 2);
    let electrons = |frame: Frame| -> Vec<f64> {
        let rows = frame.digits.chunks_exact(frame.width);
        let rows = rows.skip(corner[1]).take(SIDE);
        let digits = rows.flat_map(|row| &row[corner[0]..corner[0] + SIDE]);
        let charge = |dn: &u16| (f64::from(*dn) - detector.offset_dn) * detector.gain_e_per_dn;
        digits.map(charge).collect()
    };
    let sides = [electrons(without), electrons(with)];
    let mut image = beside(&sides, picture);
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
    let here = folder.path().join("scene.toml");
    let mut config = Config::parse("scene.toml", &scene, &Folder::of(&here))?;
    config.camera = Camera::load("camera.toml", &Folder::of(&here))?;
    if picture.effect == "aberration drift" {
        config.observer = Some(Observer::State(orbit_around_the_boresight(&config)));
    }
    Ok(config)
}

/// A low orbit whose plane is across the line of sight: aberration turns without the Earth in the way.
fn orbit_around_the_boresight(config: &Config) -> StateVector {
    let attitudes = config.sequence.iter().flat_map(|s| &s.attitudes);
    let attitude = attitudes.map(|a| a.attitude).next();
    let across = |axis: usize| {
        let matrix = attitude.unwrap_or(Attitude::identity()).matrix();
        matrix.row(axis).transpose()
    };
    StateVector {
        position_m: across(0) * 7.0e6,
        velocity_m_s: across(1) * 7.55e3,
    }
}

/// Sets `more`'s keys in `table`, those of tables one by one.
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

/// Each pixel of a frame is as many wide.
const SCALE: usize = 3;
/// Columns between the two sides.
const GAP: usize = 6;

/// Two frames beside each other.
fn beside(frames: &[Vec<f64>; 2], picture: &Picture) -> GrayImage {
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

/// Draws where a lens puts straight lines: a grid whose lines are 12 px apart behind a pinhole.
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
                // A pixel's middle has whole numbers.
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

/// Draws, along the lower edge, the electrons of the row with the fullest pixel; on the right those of the left as well.
fn draw_profiles(image: &mut GrayImage, frames: &[Vec<f64>; 2], full_e: f64) {
    const HEIGHT: f64 = 100.0;
    const OTHER: u8 = 120;
    const OWN: u8 = 255;
    let rows = || frames[0].chunks_exact(SIDE);
    let most = |row: &[f64]| row.iter().copied().fold(0.0, f64::max);
    let fullest = rows().map(most).fold(0.0, f64::max);
    let row = rows().position(|row| most(row) == fullest).unwrap_or(0);
    let height = |frame: &[f64], x: usize| {
        let column = (x / SCALE).min(SIDE - 1);
        (HEIGHT * (frame[row * SIDE + column] / full_e).clamp(0.0, 1.0)) as usize
    };
    for (side, frame, level) in [(0, 0, OWN), (1, 0, OTHER), (1, 1, OWN)] {
        for x in 0..SIDE * SCALE {
            let (here, next) = (height(&frames[frame], x), height(&frames[frame], x + 1));
            for up in here.min(next)..=here.max(next) {
                let column = x + side * (SIDE * SCALE + GAP);
                let row = SIDE * SCALE - 2 - up;
                image.put_pixel(column as u32, row as u32, Luma([level]));
            }
        }
    }
}
