//! A sequence of images with labels, written as by `skyloop render`, and its time.

use anyhow::Context;
use skyloop::attitude::VehicleState;
use skyloop::config::{Config, Observer, Sequence, TimedAttitude};
use skyloop::engine::Emulator;
use skyloop::flight;
use skyloop::load::Folder;
use skyloop::load::orbits::{Findings, Pool};
use skyloop::orbit::Object;
use skyloop::orbit::synth::{Synthetic, population};
use skyloop::output::Writer;
use skyloop::stats::{Absent, RunStats};
use std::path::Path;
use std::time::Instant;

/// Number of synthetic objects without a file: the paper's section 4.2 counts "over 20,000" in
/// orbit.
const OBJECTS: usize = 20_000;
/// Time between images, s. The paper gives no cadence.
pub const PERIOD_S: f64 = 1.0;
/// Seed of the synthetic population.
const SEED: u64 = 1;

/// Times of a sequence.
pub struct SequenceTimes {
    /// Number of images.
    pub images: u32,
    /// Time to load the scene and to prepare camera and sky, s.
    pub ready_s: f64,
    /// From the first image's attitude to the last file written, s.
    pub total_s: f64,
    /// Statistics of the rendering.
    pub stats: RunStats,
}

/// All objects of an element file except the observer; without a file a synthetic population.
///
/// # Errors
///
/// The scene has no valid mission, or the file cannot be read or holds no object.
pub fn catalogue(file: Option<&str>) -> anyhow::Result<Vec<Object>> {
    let config = Config::builtin()?;
    let Some(file) = file else {
        let made_up = population(OBJECTS, SEED, start(&config)?.epoch);
        return Ok(made_up.iter().map(Synthetic::object).collect());
    };
    let (mut pool, mut findings) = (Pool::default(), Findings::default());
    if let Some(Observer::Object(observer)) = &config.observer {
        pool.push(Object::clone(observer), 0);
    }
    let first = pool.len();
    let read = pool.read(&Folder::current(), file, 1, &mut findings);
    read.context("--tle")?;
    let united = pool.unite(&mut findings);
    let sources = united.sources.iter();
    let others = united.objects.into_iter().zip(sources);
    let others = others.filter(|(_, source)| **source >= first);
    let objects = others.map(|(object, _)| object).collect();
    if let Some(first) = findings.rejected.first() {
        let count = findings.rejected.len();
        tracing::warn!(
            "refused: {first}; {count} in all, which `skyloop catalog check {file}` names"
        );
    }
    for notice in findings.notices {
        tracing::warn!("{notice}");
    }
    Ok(objects)
}

/// The scene's vehicle at its first image.
fn start(config: &Config) -> anyhow::Result<VehicleState> {
    Ok(flight::vehicle(&flight::mission(config)?, 0)?)
}

/// The built-in scene with another population, and its first attitude for all images. Its orbit
/// file covers one minute, so the orbit is propagated from the first image on.
fn scene(objects: &[Object], images: u32) -> anyhow::Result<Config> {
    let mut config = Config::builtin()?;
    let VehicleState {
        epoch,
        attitude,
        orbit,
        ..
    } = start(&config)?;
    config.objects = objects.to_vec();
    config.observer = orbit.map(Observer::State);
    config.sequence = Some(Sequence {
        epoch,
        frames: images,
        period_s: PERIOD_S,
        attitudes: vec![TimedAttitude { epoch, attitude }],
        look_at: None,
        attitude_file: None,
        rates: [0.0; 3],
    });
    Ok(config)
}

/// Renders a number of images, and writes them with their labels into a folder.
///
/// # Errors
///
/// The scene has no valid mission, or a file cannot be written.
pub fn render(objects: &[Object], images: u32, folder: &Path) -> anyhow::Result<SequenceTimes> {
    let started = Instant::now();
    let mut config = scene(objects, images)?;
    let mission = flight::mission(&config)?;
    let mut emulator = Emulator::new(&mut config);
    let mut writer = Writer::create(folder, images)?;
    let ready_s = started.elapsed().as_secs_f64();

    let (mut stats, mut absent) = (RunStats::default(), Absent::default());
    let started = Instant::now();
    for number in 0..images {
        let exposed = emulator.expose(&flight::vehicle(&mission, number)?, 0)?;
        absent.report(&exposed);
        stats.add(&exposed);
        writer.write(&exposed)?;
        emulator.recycle(exposed.frame);
    }
    writer.finish()?;
    Ok(SequenceTimes {
        images,
        ready_s,
        total_s: started.elapsed().as_secs_f64(),
        stats,
    })
}
