//! Frame times: noise and whole frames against their own reference methods, two threads against
//! one.
//!
//! All values of a report are ratios from one run, measured alternately.

use super::population::scene_with_population;
use super::ratio::{MS, Machine, Row, pools, row, with_threads};
use super::smear::smear;
use hifitime::Unit;
use serde::Serialize;
use skyloop_base::load::{ConfigError, Folder};
use skyloop_base::rng::NoiseKey;
use skyloop_base::rng::poisson::Switch;
use skyloop_orbit::sgp4_batch::Level;
use skyloop_render::attitude::VehicleState;
use skyloop_render::camera::Camera;
use skyloop_render::engine::Emulator;
use skyloop_render::fidelity::Orbits;
use skyloop_render::kernels::{self, Converter};
use std::fmt;
use std::hint::black_box;

const OBJECTS: usize = 20_000;
/// Columns and rows of the noise frame, and pixels drawn at a time, as in the renderer.
const SIDE: usize = 1024;
const RUN: usize = 2048;
/// Mean of its pixels, e-.
const MEAN_E: f32 = 50.0;
/// Read noise of its pixels, e-.
pub const READ_E: f32 = 3.0;
/// Rounds of the medians: of noise, and of frames.
const ROUNDS: usize = 21;
const FRAMES: usize = 16;
/// Frames before those: the first sixteen build the segments of orbits (`orbit::tracks`).
const WARM: usize = 18;
/// Consecutive frames on several threads before the single thread's: threads that slept start late
/// on the first one.
const STREAM: usize = 4;
const STEP_S: f64 = 0.1;

/// Measurements.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// The machine.
    #[serde(flatten)]
    pub machine: Machine,
    /// Noise, ns a pixel.
    pub noise: Vec<Row>,
    /// Whole frames, ms.
    pub frames: Vec<Row>,
}

impl super::Report for Report {
    const PARTS: u32 = 5;

    fn measure(mut on_part: impl FnMut(&str)) -> Result<Report, ConfigError> {
        let machine = Machine::this();
        on_part("noise");
        let noise = Level::available().into_iter().map(|level| {
            let alone = |round, light: &[f32], dn: &mut [u16]| draw(None, round, light, dn);
            noise(level, "each pixel alone", None, alone)
        });
        let noise = noise.collect();
        let mut frames = Vec::new();
        for (camera, name) in [("rigel-l", "1024 x 1024"), ("fai-nir", "FAI, 256 x 256")] {
            on_part(name);
            let mut ours = Work::new(camera, None, Some(Level::best()))?;
            let mut plain = Work::new(camera, None, None)?;
            let turns = || {
                let work = format!("whole frame, {name}");
                let against = "each object and pixel alone";
                let min_ratio = Some(8.0);
                row(
                    work,
                    against,
                    min_ratio,
                    FRAMES,
                    [MS; 2],
                    |_| ours.frame(),
                    |_| plain.frame(),
                )
            };
            frames.push(with_threads(1, turns));
        }
        on_part("smeared stars");
        frames.push(with_threads(1, smear)?);
        on_part("2 threads");
        let mut two = Work::new("rigel-l", Some(2 * SIDE), Some(Level::best()))?;
        let mut one = Work::new("rigel-l", Some(2 * SIDE), Some(Level::best()))?;
        if let Some([pair, single]) = pools() {
            let (work, against) = ("whole frame, 2048 x 2048, 2 threads", "1 thread");
            let (ours, theirs) = (
                |_| pair.install(|| (0..STREAM).for_each(|_| two.frame())),
                |_| single.install(|| (0..STREAM).for_each(|_| one.frame())),
            );
            frames.push(row(
                work.to_string(),
                against,
                Some(1.6),
                FRAMES,
                [STREAM * MS; 2],
                ours,
                theirs,
            ));
        }
        Ok(Report {
            machine,
            noise,
            frames,
        })
    }

    fn broken(&self) -> Vec<String> {
        let rows = self.noise.iter().chain(&self.frames);
        rows.filter_map(Row::broken).collect()
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.machine)?;
        for (unit, rows) in [("ns a pixel", &self.noise), ("ms", &self.frames)] {
            writeln!(f, "\n{}", Row::head(unit))?;
            rows.iter().try_for_each(|row| writeln!(f, "{row}"))?;
        }
        Ok(())
    }
}

/// Conversion of electrons to DN.
pub const CONVERTER: Converter = Converter {
    per_electron: 0.5,
    offset: 100.0,
    max: 4095,
};

/// Shot noise, read noise and DN of uniform light by a level's kernels, against `theirs`, on one
/// thread. `theirs` gets the round, the mean electrons of pixels, and the DN to fill.
pub fn noise(
    level: Level,
    against: &'static str,
    min_ratio: Option<f64>,
    mut theirs: impl FnMut(usize, &[f32], &mut [u16]) + Send,
) -> Row {
    let light = vec![MEAN_E; SIDE * SIDE];
    let [mut dn, mut others] = [(); 2].map(|()| vec![0u16; SIDE * SIDE]);
    let turns = || {
        row(
            format!("noise, {SIDE} x {SIDE}, mean {MEAN_E} e-, {level}"),
            against,
            min_ratio,
            ROUNDS,
            [SIDE * SIDE; 2],
            |round| {
                draw(Some(level), round, &light, &mut dn);
                black_box(&dn);
            },
            |round| {
                theirs(round, black_box(&light), &mut others);
                black_box(&others);
            },
        )
    };
    with_threads(1, turns)
}

/// Converts light to DN in runs of pixels; without a level pixel by pixel.
fn draw(level: Option<Level>, round: usize, light: &[f32], dn: &mut [u16]) {
    let key = NoiseKey {
        seed: 1,
        sequence: round as u32,
        repeat: 0,
    };
    let switch = Switch::within(1e-4);
    let mut electrons = [0.0; RUN];
    let runs = light.chunks(RUN).zip(dn.chunks_mut(RUN));
    for (run, (light, dn)) in runs.enumerate() {
        let electrons = &mut electrons[..light.len()];
        electrons.copy_from_slice(light);
        kernels::shot_noise(level, key, 1, run * RUN, switch, electrons);
        kernels::read_noise(level, key, 2, run * RUN, READ_E, electrons);
        kernels::digitise(level, &CONVERTER, electrons, dn);
    }
}

/// A camera under stars, a synthetic population and all other content of the built-in scene.
struct Work {
    emulator: Emulator,
    vehicle: VehicleState,
    made: u32,
}

impl Work {
    /// With a square detector of `side` pixels, if given; without a `level` by the scalar SGP4.
    /// Renders some frames beforehand.
    fn new(camera: &str, side: Option<usize>, level: Option<Level>) -> Result<Work, ConfigError> {
        let (mut config, vehicle) = scene_with_population(OBJECTS)?;
        config.camera = Camera::load(camera, &Folder::current())?;
        if let Some(side) = side {
            (config.camera.detector.width, config.camera.detector.height) = (side, side);
        }
        if level.is_none() {
            config.fidelity.orbits = Orbits::Scalar;
        }
        let mut emulator = Emulator::new(&mut config);
        emulator.level = level;
        let mut work = Work {
            emulator,
            vehicle,
            made: 0,
        };
        (0..WARM).for_each(|_| work.frame());
        Ok(work)
    }

    fn frame(&mut self) {
        let later = Unit::Second * (STEP_S * f64::from(self.made));
        self.made += 1;
        let vehicle = self.vehicle.at(self.vehicle.epoch + later);
        if let Ok(exposed) = self.emulator.expose(&vehicle, 0) {
            black_box(&exposed);
            self.emulator.take_back(exposed);
        }
    }
}
