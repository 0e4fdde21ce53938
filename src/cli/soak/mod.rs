//! `skyloop soak`: a live run of several minutes against skyloop's own clients, and verdicts about
//! deadlines and latencies.

mod args;
mod joining;
mod live_run;
mod outputs;

use super::common::mission;
use super::instruments::are_different;
use super::live;
use super::session::{Session, configure};
use anyhow::{Context, bail};
pub use args::Args;
use live_run::{LiveRun, open_links};
use outputs::Outputs;
use skyloop::config::{Clock, Config, Trigger};
use skyloop::flight;
use skyloop::host::Host;
use skyloop::orbit::path_text;
use skyloop::soak::Report;
use skyloop::stats::{row, table};
use skyloop_firmware_sim::console::{in_one_line, say, stop_at_ctrl_c};
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::profile::Profile;
use skyloop_firmware_sim::verdict;
use std::sync::atomic::Ordering;
use std::time::Instant;

pub fn run(args: Args) -> anyhow::Result<()> {
    are_different(&args.files())?;
    let mut outputs = Outputs::open(&args)?;
    let done = soak(&args, &mut outputs);
    if let Err(error) = &done {
        outputs.fail(&args, &in_one_line(error.as_ref()))?;
    }
    done
}

fn soak(args: &Args, outputs: &mut Outputs) -> anyhow::Result<()> {
    let started = Instant::now();
    let file = Some(args.config.as_path());
    let output = args.output.as_deref();
    let config = configure(file, &args.records, &args.orbits, output)?;
    let rate_hz = args.rate.unwrap_or(2.0 * config.camera.rate_hz);
    check(args, &config, rate_hz)?;
    let interrupted = stop_at_ctrl_c().context("cannot watch for Ctrl-C")?;
    // Until the verdicts are known, the files state a failed run.
    outputs.begin(args)?;
    let mission = mission(&config, file)?;
    let first = flight::vehicle(&mission, 0)?;
    let mission = endless(mission, rate_hz)?;
    let services = live::services(&config, args.metrics.as_deref())?;
    let session = Session::new(config);
    let (links, ports) = open_links(&args.link, &session.config)?;
    let (config, cameras) = session.live(links, Some(&first), &services)?;
    say(format_args!(
        "{services}{} ({} x {}) at {} Hz over {} for {} min\n",
        config.camera.name,
        config.camera.detector.width,
        config.camera.detector.height,
        config.camera.rate_hz,
        args.link,
        args.minutes
    ))?;
    let host = Host::now();
    let run = LiveRun::new(&config, args.limits(), args.minutes, &interrupted);
    let flown = run.fly(cameras, ports, mission)?;
    let minutes = flown.minutes();
    let stopped = interrupted
        .load(Ordering::Relaxed)
        .then(|| format!("stopped after {} of {} min", short(minutes), args.minutes));
    let withheld = flown.withheld_rows(&config);
    let reached_hz = f64::from(flown.attitudes()) / (60.0 * minutes);
    let counts = flown.counters();
    let report = Report::new(
        path_text(&args.config),
        minutes,
        args.limits(),
        flown.measured(&config, started, stopped),
        Host::now().since(&host),
        services.granted,
        counts,
    );
    let rate = format!("{reached_hz:.1} a second, of {rate_hz} requested");
    print(&report, rate, withheld)?;
    outputs.finish(&report)?;
    verdict::broken(&report.verdicts).map_or(Ok(()), |broken| bail!(broken))
}

/// Errors: the configuration does not allow a soak.
fn check(args: &Args, config: &Config, rate_hz: f64) -> anyhow::Result<()> {
    let name = path_text(&args.config);
    if config.run.clock == Clock::Stepped {
        bail!(
            "{name}: run.clock is \"stepped\", where frames have no deadlines; set it to \"wall\" or \"external\""
        );
    }
    if config.run.trigger == Trigger::Packet {
        bail!(
            "{name}: run.trigger is \"packet\", and the client of a soak sends none; leave it out, so that frames come at the camera's rate"
        );
    }
    // A soak does not use the links of the file, but refuses the same ones as `run`.
    live::check_links(config, &args.config)?;
    if args.link == "can" && !config.cameras.is_empty() {
        bail!(
            "--link can: there is one virtual bus, and the {} cameras of {name} need one each; give --link udp, pty or slcan",
            1 + config.cameras.len()
        );
    }
    let attitudes = rate_hz * 60.0 * args.minutes;
    if attitudes > f64::from(u32::MAX) {
        bail!(
            "--minutes {}: {attitudes:.2e} attitudes, at {rate_hz} a second, are more than can be numbered (4.29e9); ask for less",
            args.minutes
        );
    }
    Ok(())
}

/// The mission with the wall clock, without an end. A list of attitudes becomes a slew from the
/// first one, with its rates.
fn endless(mission: Mission, rate_hz: f64) -> anyhow::Result<Mission> {
    let (start, orbit) = (mission.start, mission.orbit.as_ref());
    let profile = match &mission.profile {
        Profile::List(_) => {
            let first = mission.profile.at(start, orbit)?;
            Profile::Slew {
                start,
                attitude: first.attitude,
                rates_rad_s: first.rates_rad_s,
            }
        }
        other => other.clone(),
    };
    Ok(Mission {
        frames: u32::MAX,
        pace: Pace::Wall { rate_hz },
        profile,
        ..mission
    })
}

/// Minutes to two decimals; below 0.1 to four.
fn short(minutes: f64) -> String {
    if minutes < 0.1 {
        format!("{minutes:.4}")
    } else {
        format!("{minutes:.2}")
    }
}

/// Prints the table, with the rate of attitudes and the frames that were withheld, and the
/// verdicts.
fn print(report: &Report, rate: String, withheld: Vec<(String, String)>) -> anyhow::Result<()> {
    let mut rows = vec![row("minutes", short(report.minutes))];
    rows.extend(report.rows());
    rows.push(row("attitudes", rate));
    rows.extend(withheld);
    rows.extend(report.host.rows());
    let counts: Vec<String> = report
        .counters
        .iter()
        .map(|(name, count)| format!("{name} {count}"))
        .collect();
    rows.push(row("counters", counts.join(", ")));
    say(format_args!("\n{}", table(&rows)))?;
    say(verdict::table(&report.verdicts))?;
    Ok(())
}
