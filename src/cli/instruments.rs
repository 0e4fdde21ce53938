//! Faults and recordings between a link and the emulator, for `run` and `loopback`.

use anyhow::{Error, anyhow, bail};
use clap::Args;
use skyloop::engine::Emulator;
use skyloop::link::capture::{Capture, Origin, remedy_of};
use skyloop::link::fault::{BusFaults, FaultLog, LOG_MARK, Needs, Plan, Stop, wrap};
use skyloop::link::{self, BusInstruments, LinkError, Roles, Wire};
use skyloop::orbit::path_text;
use skyloop::orbit::{Input, OutputFile, inputs, is_same_file};
use skyloop::output::is_of_run;
use skyloop::stats::row;
use skyloop_firmware_sim::console::in_one_line;
use skyloop_protocols::Output;
use skyloop_protocols::can::isotp::Parameters;
use skyloop_protocols::personality::NATIVE;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Arguments of both commands.
#[derive(Args)]
pub struct Choice {
    /// Inject the faults of this TOML file, and those that the client requests
    #[arg(long, value_name = "FILE")]
    faults: Option<PathBuf>,
    /// Write the injected faults as JSON lines, with or without --faults
    #[arg(long, value_name = "FILE")]
    fault_log: Option<PathBuf>,
    /// Record the packets of both directions, for Wireshark (CAN: can-utils) and `skyloop replay`
    #[arg(long, value_name = "FILE")]
    capture: Option<PathBuf>,
}

/// The instruments of a link.
#[derive(Default)]
pub struct Instruments {
    faults: Option<(Plan, Arc<Mutex<FaultLog>>)>,
    capture: Option<Capture>,
    /// The fault log. The threads of links write it.
    log: Option<(PathBuf, OutputFile)>,
    /// The input files of the run.
    inputs: Vec<Input>,
    /// For each link, whether it is a CAN bus: faults are then injected at the bus.
    buses: Vec<bool>,
}

impl Choice {
    /// Opens the files, without changes before [`Instruments::begin`]. `force` accepts files that
    /// skyloop did not write.
    pub fn prepare(&self, links: &[String], force: bool) -> anyhow::Result<Instruments> {
        // Listed before the fault file is read: a replay does not need that file.
        let inputs = inputs();
        let buses: Vec<bool> = links.iter().map(|link| link::is_bus(link)).collect();
        let plan = match &self.faults {
            Some(file) => Some(Plan::load(file, buses.iter().all(|bus| *bus))?),
            None => self.fault_log.as_ref().map(|_| Plan::default()),
        };
        let (fault_log, log) = match &self.fault_log {
            Some(file) => {
                let opened = OutputFile::open(file, LOG_MARK, force).and_then(|output| {
                    let fault_log = FaultLog::writing(file, &output)?;
                    Ok((fault_log, Some((file.clone(), output))))
                });
                opened.map_err(|why| unwritten(file, &why))?
            }
            None => (FaultLog::default(), None),
        };
        let capture = match &self.capture {
            Some(file) if records_frames(&buses) => Some(Capture::frames(file, force)?),
            Some(file) => Some(Capture::packets(file, force, links)?),
            None => None,
        };
        Ok(Instruments {
            faults: plan.map(|plan| (plan, Arc::new(Mutex::new(fault_log)))),
            capture,
            log,
            inputs,
            buses,
        })
    }
}

fn unwritten(file: &Path, why: &std::io::Error) -> anyhow::Error {
    anyhow!("--fault-log {}: {why}{}", path_text(file), remedy_of(why))
}

/// The settings of a run that are not in its files, for recordings.
pub fn settings(output: Output, emulator: &Emulator) -> Vec<(String, String)> {
    let level = (output.pixels, output.labels);
    let level = Output::PRESETS
        .into_iter()
        .find(|(_, pixels, labels)| level == (*pixels, *labels));
    let output = level.map_or(format!("{output:?}"), |(name, ..)| name.to_string());
    let (preset, tolerances) = emulator.fidelity().nearest_preset();
    let tolerances = tolerances
        .iter()
        .map(|(name, value)| format!(", {name} = {value}"));
    let fidelity = preset.to_string() + &tolerances.collect::<String>();
    let version = env!("CARGO_PKG_VERSION").to_string();
    let settings = [
        ("version", version),
        ("--output", output),
        ("fidelity", fidelity),
    ];
    settings
        .map(|(name, value)| (name.to_string(), value))
        .to_vec()
}

impl Choice {
    fn outputs(&self) -> Vec<(&'static str, &Path)> {
        let files = [
            ("--fault-log", &self.fault_log),
            ("--capture", &self.capture),
        ];
        files
            .into_iter()
            .filter_map(|(name, file)| Some((name, file.as_deref()?)))
            .collect()
    }

    /// Refuses outputs that name the same file, an input, or a file in the output folder `out`.
    /// `input` and `output` are further files of the command.
    pub fn check_files(
        &self,
        input: Option<(&'static str, &Path)>,
        output: Option<(&'static str, &Path)>,
        out: Option<&Path>,
    ) -> anyhow::Result<()> {
        let faults = self.faults.as_deref().map(|file| ("--faults", file));
        let outputs: Vec<_> = output.into_iter().chain(self.outputs()).collect();
        let inputs = input.into_iter().chain(faults);
        are_different(&inputs.chain(outputs.iter().copied()).collect::<Vec<_>>())?;
        out.map_or(Ok(()), |out| are_outside(out, &outputs))
    }
}

/// Refuses two options that name the same file.
pub fn are_different(given: &[(&str, &Path)]) -> anyhow::Result<()> {
    for (index, (name, file)) in given.iter().enumerate() {
        if let Some((other, _)) = given[..index]
            .iter()
            .find(|(_, other)| is_same_file(other, file))
        {
            bail!(
                "{name} {}: {other} names the same file; choose another",
                path_text(file)
            );
        }
    }
    Ok(())
}

/// Refuses options that name a file in the output folder.
fn are_outside(out: &Path, given: &[(&str, &Path)]) -> anyhow::Result<()> {
    if let Some((name, file)) = given.iter().find(|(_, file)| is_same_file(out, file)) {
        bail!(
            "{name} {}: --out names it too, as a folder; choose another",
            path_text(file)
        );
    }
    match given.iter().find(|(_, file)| is_of_run(out, file)) {
        None => Ok(()),
        Some((name, file)) => bail!(
            "{name} {}: --out {} has a file of this name; choose another",
            path_text(file),
            path_text(out)
        ),
    }
}

pub fn both(first: Option<Error>, second: Option<Error>) -> Option<Error> {
    match (first, second) {
        (Some(first), Some(second)) => {
            let [first, second] = [first, second].map(|error| in_one_line(error.as_ref()));
            Some(anyhow!("{first}; {second}"))
        }
        (first, second) => first.or(second),
    }
}

/// Whether a recording holds CAN frames and not packets: the only link is a CAN bus.
fn records_frames(buses: &[bool]) -> bool {
    buses == [true]
}

impl Instruments {
    /// The instruments between a CAN bus and its link. The recorder is between the faults and the
    /// emulator, so it records exactly the frames that the emulator receives.
    pub fn bus(&self) -> BusInstruments {
        let faults = self.faults.clone();
        let capture = self.capture.as_ref();
        let capture = capture.filter(|_| records_frames(&self.buses));
        let recorder = capture.map(Capture::recorder);
        BusInstruments {
            faults: faults.is_some(),
            at: Arc::new(move |address, tally| {
                let faults = faults.as_ref();
                let faults = faults.map(|(plan, fault_log)| {
                    BusFaults::new(address, tally, plan, &NATIVE, fault_log)
                });
                let recorder = recorder.clone();
                Box::new(move |bus| {
                    let bus = match &faults {
                        Some(faults) => faults.around(bus),
                        None => bus,
                    };
                    match &recorder {
                        Some(recorder) => recorder.around(bus),
                        None => bus,
                    }
                })
            }),
        }
    }

    /// Adds the instruments to the open links, except those of [`bus`](Self::bus).
    pub fn around(&self, links: Vec<(Wire, Roles)>) -> Result<Vec<(Wire, Roles)>, LinkError> {
        let mut around = Vec::with_capacity(links.len());
        for (number, ((mut wire, roles), on_bus)) in (0..).zip(links.into_iter().zip(&self.buses)) {
            if let (Some((plan, fault_log)), false) = (&self.faults, on_bus) {
                wire = wrap(wire, plan, &NATIVE, fault_log)?;
            }
            if let Some(capture) = self
                .capture
                .as_ref()
                .filter(|_| !records_frames(&self.buses))
            {
                capture.tap(&mut wire, number);
            }
            around.push((wire, roles));
        }
        Ok(around)
    }

    /// Starts the files, and replaces earlier ones. Call it after all other checks.
    pub fn begin(&mut self, settings: Vec<(String, String)>) -> anyhow::Result<()> {
        if let Some((file, output)) = &mut self.log {
            output.begin().map_err(|why| unwritten(file, &why))?;
        }
        let inputs = std::mem::take(&mut self.inputs);
        let Some(capture) = &mut self.capture else {
            return Ok(());
        };
        capture
            .begin(&Origin { settings, inputs })
            .inspect_err(|_| {
                let log = self.log.iter_mut();
                log.for_each(|(_, output)| output.discard_empty());
            })?;
        Ok(())
    }

    /// The fault that blocks all packets; none if it met no packet after `since`, or has ended.
    pub fn stopped(&self, since: Instant, needs: Needs) -> Option<Stop> {
        let (_, fault_log) = self.faults.as_ref()?;
        let fault_log = fault_log.lock().unwrap_or_else(PoisonError::into_inner);
        // On CAN each long packet waits for its flow control.
        let flow_control = Duration::from_micros(Parameters::FD.timeout_us);
        let timeout = if self.buses.contains(&true) {
            needs.timeout.min(flow_control)
        } else {
            needs.timeout
        };
        fault_log.stopped(since, &Needs { timeout, ..needs })
    }

    /// The row in the table of the run.
    pub fn row(&self) -> Option<(String, String)> {
        self.faults().map(|done| row("faults injected", done))
    }

    /// A summary of the injected faults, if there are any.
    pub fn faults(&self) -> Option<String> {
        let (_, fault_log) = self.faults.as_ref()?;
        let fault_log = fault_log.lock().unwrap_or_else(PoisonError::into_inner);
        Some(fault_log.summary())
    }

    /// Runs `body`, and then ends the files in any case. Both errors are reported.
    pub fn finish_after<T>(
        self,
        body: impl FnOnce(&Instruments) -> anyhow::Result<T>,
    ) -> (Option<T>, Option<Error>) {
        let done = body(&self);
        let finished = self.finish();
        match done {
            Ok(done) => (Some(done), finished.err()),
            Err(error) => (None, both(Some(error), finished.err())),
        }
    }

    /// Ends the files; an error names those that are incomplete.
    fn finish(mut self) -> anyhow::Result<()> {
        let captured = self.capture.map_or(Ok(0), Capture::finish);
        let logged = self.faults.map_or(Ok(()), |(_, fault_log)| {
            let mut fault_log = fault_log.lock().unwrap_or_else(PoisonError::into_inner);
            fault_log.finish().map_err(|why| {
                let log = self.log.iter_mut();
                log.for_each(|(_, output)| output.discard_empty());
                anyhow!("--fault-log {why}")
            })
        });
        both(logged.err(), captured.err().map(Error::from)).map_or(Ok(()), Err)
    }
}
