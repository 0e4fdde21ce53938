//! Contents of each picture: a small camera with exaggerated values, and a scene with the effect.

/// One picture.
pub struct Picture {
    /// Name of the effect in plans.
    pub effect: &'static str,
    /// Keys of the camera file in addition to those of [`CAMERA`], as TOML.
    pub camera: &'static str,
    /// Keys of the scene, as TOML.
    pub scene: &'static str,
    /// State of the observer: km and km/s, GCRF; zeros for the Earth's centre.
    pub observer: [f64; 6],
    /// Effects that run on both sides.
    pub others: &'static [&'static str],
    /// Electrons of a black pixel and of a white pixel.
    pub levels_e: [f64; 2],
    /// Greys between them.
    pub tone: Tone,
}

/// Relation of greys to electrons.
#[derive(Clone, Copy)]
pub enum Tone {
    /// Asinh: faint light is visible, and bright light does not saturate.
    Stretched,
    /// Proportional.
    Linear,
}

/// Five degrees of sky: 96 x 96 pixels of a milliradian.
pub const CAMERA: &str = r#"
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

/// A scene of the Pleiades.
pub const SCENE: &str = r#"
[sequence]
epoch = "2026-12-01T00:00:00Z"
frames = 1
period_s = 1.0
attitudes = [{ q = [0.521170458, -0.155615307, 0.240084982, 0.80406743] }]
"#;

/// A scene of Orion.
const ORION: &str = "sky.catalog = \"bsc\"\nsequence.attitudes = \
    [{ q = [0.712272964, -0.037328644, 0.036682757, 0.699948693] }]\n";

/// The Pleiades from the Earth's centre.
const PLAIN: Picture = Picture {
    effect: "",
    camera: "",
    scene: "",
    observer: [0.0; 6],
    others: &[],
    levels_e: [0.0, 3000.0],
    tone: Tone::Stretched,
};

/// In the order of [`EFFECTS`](skyloop::effect::EFFECTS).
pub const PICTURES: &[Picture] = &[
    Picture {
        effect: "distortion",
        camera: "optics.focal_length_mm = 4.0\noptics.projection = { model = \"brown-conrady\", k = [-1.6, 1.5] }\n",
        scene: ORION,
        levels_e: [0.0, 20000.0],
        ..PLAIN
    },
    Picture {
        effect: "aberration drift",
        camera: "optics.focal_length_mm = 8000.0\noptics.principal_px = [12.0, 24.0]\ntiming = { exposure_s = 1500.0, rate_hz = 0.0005 }\noptics.aperture_mm = 1.0\n",
        scene: "sequence.epoch = \"2026-06-01T00:00:00Z\"\nsequence.attitudes = [{ q = [0.52129861, -0.15505349, 0.239241716, 0.80434419] }]\n",
        observer: [5862.1, -3825.7, 0.0, 1.685, 2.582, -6.892],
        others: &["smear"],
        levels_e: [0.0, 60000.0],
        ..PLAIN
    },
    Picture {
        effect: "smear",
        scene: "sequence.rates_deg_s = [2.0, 1.5, 40.0]\n",
        ..PLAIN
    },
    Picture {
        effect: "rolling shutter",
        camera: "timing = { exposure_s = 0.01, rate_hz = 1.0, shutter = \"rolling\", row_us = 1000.0 }\n",
        scene: "sequence.rates_deg_s = [0.0, 30.0, 0.0]\n",
        others: &["smear"],
        levels_e: [0.0, 200.0],
        ..PLAIN
    },
    Picture {
        effect: "vignetting",
        camera: "optics.focal_length_mm = 4.0\noptics.vignetting.table = [[0.0, 1.0], [4.0, 0.9], [12.0, 0.1], [16.0, 0.0]]\n",
        scene: ORION,
        levels_e: [0.0, 20000.0],
        ..PLAIN
    },
    Picture {
        effect: "stars",
        ..PLAIN
    },
    Picture {
        effect: "rsos",
        ..PLAIN
    },
    Picture {
        effect: "zodiacal light",
        camera: "optics.focal_length_mm = 3.0\n",
        scene: "sky.catalog = \"bsc\"\nsequence.attitudes = [{ q = [0.280912147, 0.718125401, -0.471391238, 0.427988989] }]\n",
        levels_e: [0.0, 40000.0],
        ..PLAIN
    },
    Picture {
        effect: "starlight",
        camera: "optics.focal_length_mm = 1.6\n",
        scene: "sky.catalog = \"bsc\"\nsequence.epoch = \"2026-06-01T00:00:00Z\"\nsequence.attitudes = [{ q = [-0.175655294, -0.843245370, 0.502859761, 0.072211663] }]\n",
        levels_e: [0.0, 30000.0],
        ..PLAIN
    },
    Picture {
        effect: "planets",
        scene: "sequence.epoch = \"2026-11-16T00:00:00Z\"\nsequence.attitudes = [{ q = [0.536221362, 0.298269567, -0.383836663, 0.690051688] }]\n",
        ..PLAIN
    },
    Picture {
        effect: "moon",
        camera: "optics.focal_length_mm = 86.0\ntiming = { exposure_s = 1e-5, rate_hz = 1.0 }\n",
        scene: "sequence.epoch = \"2026-12-06T00:00:00Z\"\nsequence.attitudes = [{ q = [0.372720962, 0.725737426, -0.514387794, 0.264176969] }]\n",
        levels_e: [0.0, 1500.0],
        ..PLAIN
    },
    Picture {
        effect: "earth",
        camera: "optics.focal_length_mm = 3.0\noptics.aperture_mm = 1.0\ntiming = { exposure_s = 1e-5, rate_hz = 1.0 }\n",
        scene: "sequence.attitudes = [{ q = [0.603811727, 0.266249618, -0.303142477, 0.687478857] }]\n",
        observer: [19313.020, -17641.407, -3403.951, 2.630, 2.880, 0.0],
        levels_e: [0.0, 35000.0],
        tone: Tone::Linear,
        ..PLAIN
    },
    Picture {
        effect: "limb",
        camera: "optics.focal_length_mm = 11.0\noptics.aperture_mm = 5.0\n",
        scene: "sky.catalog = \"bsc\"\nsequence.attitudes = [{ q = [-0.586422610, 0.658015982, -0.317254794, 0.349961264] }]\n",
        observer: [6652.709, 1734.507, 1682.566, 1.098, 2.547, -6.968],
        levels_e: [0.0, 15000.0],
        ..PLAIN
    },
    Picture {
        effect: "sunlight",
        camera: "optics.stray.pst = [[40.0, 3e-9]]\n",
        scene: "sequence.epoch = \"2026-04-10T00:00:00Z\"\n",
        ..PLAIN
    },
    Picture {
        effect: "moonglow",
        camera: "optics.stray.pst = [[8.0, 2e-3]]\n",
        scene: "sequence.epoch = \"2026-12-22T12:00:00Z\"\n",
        ..PLAIN
    },
    Picture {
        effect: "earthshine",
        camera: "optics.stray.pst = [[80.0, 2e-8]]\n",
        scene: "sequence.epoch = \"2026-04-10T00:00:00Z\"\n",
        observer: [3680.329, 5639.337, 3014.621, -6.113, 3.990, 0.0],
        ..PLAIN
    },
    Picture {
        effect: "pixel response",
        camera: "optics.psf.sigma_px = 8.0\ndetector.prnu = 0.15\n",
        levels_e: [0.0, 300.0],
        ..PLAIN
    },
    Picture {
        effect: "frame transfer",
        camera: "timing = { exposure_s = 0.02, rate_hz = 1.0, shutter = \"frame-transfer\", row_us = 100.0 }\n",
        levels_e: [0.0, 60.0],
        ..PLAIN
    },
    Picture {
        effect: "dark current",
        camera: "detector.dark_e_s = 200.0\ndetector.dark_nonuniformity = 0.3\ndetector.hot_fraction = 0.02\ndetector.hot_e_s = 2000.0\n",
        levels_e: [0.0, 500.0],
        ..PLAIN
    },
    Picture {
        effect: "shot noise",
        camera: "detector.dark_e_s = 200.0\n",
        others: &["dark current"],
        levels_e: [0.0, 300.0],
        ..PLAIN
    },
    Picture {
        effect: "radiation",
        camera: "[radiation]\nflux_cm2_s = 1500.0\nthickness_um = 30.0\ndiffusion_um = 5.0\n",
        levels_e: [0.0, 5000.0],
        ..PLAIN
    },
    Picture {
        effect: "full well",
        camera: "detector.full_well_e = 3000.0\ndetector.blooming = \"column\"\ntiming.exposure_s = 1.0\n",
        levels_e: [0.0, 4000.0],
        ..PLAIN
    },
    Picture {
        effect: "dead pixels",
        camera: "detector.dark_e_s = 500.0\ndetector.dead_fraction = 0.03\n",
        others: &["dark current"],
        levels_e: [0.0, 300.0],
        ..PLAIN
    },
    Picture {
        effect: "non-linearity",
        camera: "detector.nonlinearity = 0.5\ndetector.full_well_e = 1800.0\noptics.psf.sigma_px = 3.0\n",
        levels_e: [0.0, 1800.0],
        tone: Tone::Linear,
        ..PLAIN
    },
    Picture {
        effect: "read noise",
        camera: "detector.read_noise_e = 30.0\n",
        levels_e: [-100.0, 500.0],
        ..PLAIN
    },
    Picture {
        effect: "readout",
        camera: "detector.gain_e_per_dn = 200.0\ndetector.adc_bits = 4\ndetector.offset_dn = 0.0\noptics.psf.sigma_px = 4.0\n",
        ..PLAIN
    },
    Picture {
        effect: "stuck pixels",
        camera: "detector.stuck_fraction = 0.01\n",
        ..PLAIN
    },
];

impl Picture {
    /// File name.
    pub fn file(&self) -> String {
        format!("{}.png", self.effect.replace(' ', "-"))
    }
}
