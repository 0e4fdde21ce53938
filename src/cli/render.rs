//! `skyloop render`: frames and labels in a folder, without a flight computer.

use super::budget::Budget;
use super::common::{Force, Orbits, Records, mission, progress};
use super::pointing::{Place, Pointing};
use super::session::Session;
use clap::{ArgGroup, Args as ClapArgs};
use hifitime::Epoch;
use skyloop::camera::Camera;
use skyloop::config::Config;
use skyloop::flight;
use skyloop::load::{Folder, orbits};
use skyloop::orbit::path_text;
use skyloop::orbit::time::parse_utc;
use skyloop::output::Writer;
use skyloop::stats::{Absent, RunStats, table};
use skyloop_firmware_sim::console::say;
use skyloop_firmware_sim::text::{decimal, whole};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

#[derive(ClapArgs)]
#[command(group = ArgGroup::new("looks").args(["scene", "attitude", "radec", "nadir", "look_at"]).required(true))]
pub struct Args {
    /// Scene file (see configs/default.toml); instead of --camera, --epoch, --attitude, --radec,
    /// --nadir, --look-at, --rates, --state, --orbit, --rso
    #[arg(long, value_name = "FILE", conflicts_with_all = ["camera", "epoch", "attitude", "radec", "nadir", "look_at", "rates", "state", "orbit", "rso"])]
    scene: Option<PathBuf>,
    /// Camera: fai-nir, fai-630, rigel-l, cots-wide, cmos-rolling, ccd-transfer, all-sky, horizon,
    /// or a camera file
    #[arg(long, value_name = "NAME|FILE", default_value = "fai-nir")]
    camera: String,
    /// Middle of the first exposure, such as 2019-06-15T23:35:50Z
    #[arg(long, value_name = "UTC", required_unless_present = "scene", value_parser = parse_utc)]
    epoch: Option<Epoch>,
    #[command(flatten)]
    pointing: Pointing,
    #[command(flatten)]
    place: Place,
    /// Objects from a TLE, 3LE, OMM or OEM file, or a folder of such files; may be repeated
    #[arg(long, value_name = "FILE")]
    rso: Vec<String>,
    /// Number of frames [default: 1, or the scene's]
    #[arg(long, value_name = "N", value_parser = whole(1..=1_000_000u32), allow_hyphen_values = true)]
    frames: Option<u32>,
    /// Seconds from one exposure to the next [default: 1, or the scene's]
    #[arg(long, value_name = "S", value_parser = decimal(1e-6..=1e6), allow_hyphen_values = true)]
    period: Option<f64>,
    /// Seed of the noise [default: 1, or the scene's]
    #[arg(long, value_name = "N", value_parser = whole(0..=u64::MAX), allow_hyphen_values = true)]
    seed: Option<u64>,
    /// Draw no noise, and write the expected electrons also (NAME_electrons.fits)
    #[arg(long)]
    no_noise: bool,
    /// Label objects with at least this signal-to-noise ratio [default: 1, or the scene's]
    #[arg(long, value_name = "SNR", value_parser = decimal(0.0..=1e9), allow_hyphen_values = true)]
    label_snr: Option<f64>,
    /// Refuse frames that need more than this many seconds of one core per megapixel; smaller
    /// frames count as one megapixel [default: no limit]
    #[arg(long, value_name = "S", value_parser = decimal(0.01..=1e6), allow_hyphen_values = true)]
    work_limit: Option<f64>,
    /// Folder for frames and labels, created if needed
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    records: Records,
    #[command(flatten)]
    orbits: Orbits,
    #[command(flatten)]
    budget: Budget,
}

pub fn run(args: Args) -> anyhow::Result<()> {
    let mut config = configure(&args)?;
    args.records.settle(&config)?;
    args.orbits.settle(&mut config);
    let mission = mission(&config, args.scene.as_deref())?;
    let mut session = Session::new(config);
    session.emulator.choice.noise = !args.no_noise;
    session.emulator.work_limit_s = args.work_limit;
    let never = AtomicBool::new(false);
    let chosen = session.settle_budget(&args.budget, Some(&mission), &never)?;
    let mut emulator = session.emulator;
    say(format_args!("{chosen}"))?;
    emulator.keep_expected = args.no_noise;
    let mut writer = Writer::create_over(&args.out, mission.frames, args.force.force)?;
    let mut stats = RunStats::default();
    let mut absent = Absent::default();
    let bar = progress(mission.frames, "frames");
    for number in 0..mission.frames {
        let vehicle = flight::vehicle(&mission, number)?;
        let exposed = emulator.expose(&vehicle, 0)?;
        bar.suspend(|| absent.report(&exposed));
        stats.add(&exposed);
        writer.write(&exposed)?;
        emulator.take_back(exposed);
        bar.inc(1);
    }
    writer.finish()?;
    bar.finish_and_clear();
    let table = table(&stats.rows());
    say(format_args!("{table}wrote {}\n", path_text(&args.out)))?;
    Ok(())
}

fn configure(args: &Args) -> anyhow::Result<Config> {
    let mut config = match &args.scene {
        Some(scene) => Config::load(scene)?,
        None => from_flags(args)?,
    };
    if let Some(sequence) = &mut config.sequence {
        sequence.frames = args.frames.unwrap_or(sequence.frames);
        sequence.period_s = args.period.unwrap_or(sequence.period_s);
    }
    config.seed = args.seed.unwrap_or(config.seed);
    config.label_snr = args.label_snr.unwrap_or(config.label_snr);
    Ok(config)
}

fn from_flags(args: &Args) -> anyhow::Result<Config> {
    let folder = Folder::current();
    let mut config = Config::defaults()?;
    config.camera = Camera::load(&args.camera, &folder)?;
    let mut findings = orbits::Findings::default();
    config.observer = args.place.observer(&mut findings)?;
    let mut pool = orbits::Pool::default();
    for file in &args.rso {
        pool.read(&folder, file, 0, &mut findings)?;
    }
    config.objects.extend(pool.unite(&mut findings).objects);
    if let Some(epoch) = args.epoch {
        config.sequence = args.pointing.sequence(epoch, &config)?;
    }
    config.rejected = findings.rejected;
    config.notices = findings.notices;
    Ok(config)
}
