//! What is in each picture: a small camera with exaggerated figures, without the effect on the left and with it on the
//! right; all other effects but stars, objects and readout (and those beside it) are switched off in both.

use skyloop::attitude::Attitude;
use skyloop::camera::Camera;
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
epoch = "2026-06-01T00:00:00Z"
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
        camera: "optics.focal_length_mm = 4.0\noptics.projection = { model = \"brown-conrady\", k = [-0.9] }\n",
        scene: ORION,
        beside: &[],
        levels_e: [0.0, 40000.0],
    },
    Picture {
        effect: "aberration drift",
        camera: "optics.focal_length_mm = 4000.0\ntiming = { exposure_s = 1500.0, rate_hz = 0.0005 }\noptics.aperture_mm = 1.0\n",
        scene: "sequence.attitudes = [{ q = [0.52129861, -0.15505349, 0.239241716, 0.80434419] }]\n",
        beside: &["smear"],
        levels_e: [0.0, 60000.0],
    },
    Picture {
        effect: "smear",
        camera: "",
        scene: "sequence.rates_deg_s = [2.0, 1.5, 40.0]\n",
        beside: &[],
        levels_e: [0.0, 3000.0],
    },
    Picture {
        effect: "rolling shutter",
        camera: "timing = { exposure_s = 0.01, rate_hz = 1.0, shutter = \"rolling\", row_us = 1000.0 }\n",
        scene: "sequence.rates_deg_s = [0.0, 30.0, 0.0]\n",
        beside: &["smear"],
        levels_e: [0.0, 200.0],
    },
    Picture {
        effect: "vignetting",
        camera: "optics.focal_length_mm = 4.0\noptics.vignetting.table = [[0.0, 1.0], [6.0, 0.9], [14.0, 0.1], [25.0, 0.0]]\n",
        scene: ORION,
        beside: &[],
        levels_e: [0.0, 40000.0],
    },
    Picture {
        effect: "stars",
        camera: "",
        scene: "",
        beside: &[],
        levels_e: [0.0, 3000.0],
    },
    Picture {
        effect: "rsos",
        camera: "",
        scene: "",
        beside: &[],
        levels_e: [0.0, 3000.0],
    },
    Picture {
        effect: "pixel response",
        camera: "optics.psf.sigma_px = 8.0\ndetector.prnu = 0.15\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 300.0],
    },
    Picture {
        effect: "frame transfer",
        camera: "timing = { exposure_s = 0.02, rate_hz = 1.0, shutter = \"frame-transfer\", row_us = 20.0 }\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 60.0],
    },
    Picture {
        effect: "dark current",
        camera: "detector.dark_e_s = 200.0\ndetector.dark_nonuniformity = 0.3\ndetector.hot_fraction = 0.02\ndetector.hot_e_s = 2000.0\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 500.0],
    },
    Picture {
        effect: "shot noise",
        camera: "detector.dark_e_s = 200.0\n",
        scene: "",
        beside: &["dark current"],
        levels_e: [0.0, 300.0],
    },
    Picture {
        effect: "radiation",
        camera: "[radiation]\nflux_cm2_s = 1500.0\nthickness_um = 30.0\ndiffusion_um = 5.0\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 5000.0],
    },
    Picture {
        effect: "full well",
        camera: "detector.full_well_e = 3000.0\ndetector.blooming = \"column\"\ntiming.exposure_s = 1.0\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 4000.0],
    },
    Picture {
        effect: "dead pixels",
        camera: "detector.dark_e_s = 500.0\ndetector.dead_fraction = 0.03\n",
        scene: "",
        beside: &["dark current"],
        levels_e: [0.0, 300.0],
    },
    Picture {
        effect: "non-linearity",
        camera: "detector.nonlinearity = 0.4\ndetector.full_well_e = 3000.0\noptics.psf.sigma_px = 4.0\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 3000.0],
    },
    Picture {
        effect: "read noise",
        camera: "detector.read_noise_e = 30.0\n",
        scene: "",
        beside: &[],
        levels_e: [-100.0, 500.0],
    },
    Picture {
        effect: "readout",
        camera: "detector.gain_e_per_dn = 200.0\ndetector.adc_bits = 4\ndetector.offset_dn = 0.0\noptics.psf.sigma_px = 4.0\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 3000.0],
    },
    Picture {
        effect: "stuck pixels",
        camera: "detector.stuck_fraction = 0.01\n",
        scene: "",
        beside: &[],
        levels_e: [0.0, 3000.0],
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
    beside([electrons(without), electrons(with)], picture.levels_e)
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

/// Two frames beside each other, each pixel three wide, as PNG.
fn beside(frames: [Vec<f64>; 2], [black, white]: [f64; 2]) -> Result<Vec<u8>, Box<dyn Error>> {
    const SCALE: usize = 3;
    const GAP: usize = 6;
    let (columns, rows) = (2 * SIDE * SCALE + GAP, SIDE * SCALE);
    // Faint light shows, and bright light does not all look alike.
    let grey = |e: f64| {
        let stretch = |part: f64| (10.0 * part).asinh();
        (255.0 * stretch((e - black) / (white - black)) / stretch(1.0)).clamp(0.0, 255.0) as u8
    };
    let mut image = image::GrayImage::from_pixel(columns as u32, rows as u32, image::Luma([255]));
    for (side, frame) in frames.iter().enumerate() {
        for y in 0..rows {
            for x in 0..SIDE * SCALE {
                let level = grey(frame[y / SCALE * SIDE + x / SCALE]);
                let column = x + side * (SIDE * SCALE + GAP);
                image.put_pixel(column as u32, y as u32, image::Luma([level]));
            }
        }
    }
    let mut file = std::io::Cursor::new(Vec::new());
    image.write_to(&mut file, image::ImageFormat::Png)?;
    Ok(file.into_inner())
}
