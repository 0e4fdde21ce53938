//! Options of `skyloop-fc`; this file has the options for the content of frames.

mod closed;
mod faults;
mod profile;

pub use closed::LoopArgs;
pub use faults::parse_fault;
pub use profile::ProfileArgs;

use std::time::Duration;

use anyhow::{Result, anyhow, bail};
use clap::{Args, ValueEnum};
use skyloop_firmware_sim::flight_computer::Pause;
use skyloop_firmware_sim::text::whole;
use skyloop_protocols::output::{MAX_POSITIONS, MAX_WINDOW};
use skyloop_protocols::{LabelLevel, Output, PixelLevel, Positions};

/// Requested content of frames.
#[derive(Clone, Debug, Args)]
pub(crate) struct OutputArgs {
    /// Content of frames to request [default: the emulator's]
    #[arg(long, value_enum)]
    output: Option<Level>,
    /// Number of windows, around the brightest stars [default: 20]
    #[arg(long, value_name = "K", requires = "output", value_parser = whole(0..=u8::MAX))]
    windows: Option<u8>,
    /// Width and height of a window, px [default: 11]
    #[arg(long, value_name = "N", requires = "output", value_parser = whole(1..=MAX_WINDOW))]
    window_size: Option<u8>,
    /// Windows around these pixels instead of the brightest stars
    #[arg(long, value_name = "x,y;x,y...", requires = "output", value_parser = parse_positions)]
    positions: Option<Positions>,
    /// Number of labelled objects, the brightest [default: 12]
    #[arg(long, value_name = "K", requires = "output", value_parser = whole(0..=u16::MAX))]
    objects: Option<u16>,
}

/// One level of output. No help for each: it would turn all of `--help` into paragraphs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Level {
    // All pixels and the label text.
    Frame,
    // All pixels losslessly compressed, and the label text.
    Compressed,
    // Windows, and the brightest objects as numbers.
    Windows,
    // No pixels; the brightest objects as numbers.
    Labels,
}

impl OutputArgs {
    /// The requested output, and the window positions.
    pub fn requested(&self) -> Result<(Option<Output>, Option<Positions>)> {
        let Some(level) = self.output else {
            return Ok((None, None));
        };
        let windows = level == Level::Windows;
        let objects = windows || level == Level::Labels;
        for (given, option) in [
            (self.windows.is_some(), "--windows"),
            (self.window_size.is_some(), "--window-size"),
            (self.positions.is_some(), "--positions"),
        ] {
            if given && !windows {
                bail!("{option} is for --output windows only: leave it out, or choose that");
            }
        }
        if self.objects.is_some() && !objects {
            bail!(
                "--objects is for --output windows or --output labels only: leave it out, or choose that"
            );
        }
        if self.windows.is_some() && self.positions.is_some() {
            bail!("--windows and --positions both say where windows lie: give one of them");
        }
        let (pixels, labels) = match level {
            Level::Frame => (PixelLevel::Frame, LabelLevel::Text),
            Level::Compressed => (PixelLevel::Compressed, LabelLevel::Text),
            Level::Windows => (PixelLevel::Windows, LabelLevel::Objects),
            Level::Labels => (PixelLevel::None, LabelLevel::Objects),
        };
        let usual = Output::default();
        let output = Output {
            pixels,
            labels,
            window_size: self.window_size.unwrap_or(usual.window_size),
            windows: self.windows.unwrap_or(usual.windows),
            objects: self.objects.unwrap_or(usual.objects),
        };
        // Without positions: the brightest stars, even if another client has set positions.
        let positions = match (windows, self.positions) {
            (true, None) => Positions::new(&[]),
            (_, positions) => positions,
        };
        Ok((Some(output), positions))
    }
}

fn parse_positions(text: &str) -> Result<Positions> {
    let centres: Option<Vec<[u16; 2]>> = text
        .split(';')
        .map(|pair| {
            let (x, y) = pair.split_once(',')?;
            Some([x.trim().parse().ok()?, y.trim().parse().ok()?])
        })
        .collect();
    let centres = centres.ok_or_else(|| {
        anyhow!("\"{text}\" is not column,row;column,row... in whole pixels, as 128,96;20,40")
    })?;
    let count = centres.len();
    Positions::new(&centres)
        .ok_or_else(|| anyhow!("{count} positions where at most {MAX_POSITIONS} may be given"))
}

/// Reads `AFTER:S`, both in seconds.
pub(crate) fn parse_pause(text: &str) -> Result<Pause> {
    /// Long enough for any run.
    const MAX_S: f64 = 1e6;
    let time = |text: &str| {
        let seconds: f64 = text.trim().parse().ok()?;
        let fits = (0.0..=MAX_S).contains(&seconds);
        fits.then(|| Duration::from_secs_f64(seconds))
    };
    let times = text.split_once(':');
    let times = times.and_then(|(after, lasts)| Some((time(after)?, time(lasts)?)));
    let (after, lasts) =
        times.ok_or_else(|| anyhow!("\"{text}\" is not AFTER:S, both 0 to {MAX_S} s, as 5:30"))?;
    Ok(Pause { after, lasts })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_are_read() {
        let pause = parse_pause("5:0.25").unwrap();
        assert_eq!(pause.after, Duration::from_secs(5));
        assert_eq!(pause.lasts, Duration::from_millis(250));
        for wrong in [
            "", "5", "5:", ":5", "-1:5", "1:-5", "nan:1", "1:inf", "1e7:1", "1:2:3",
        ] {
            let error = parse_pause(wrong).unwrap_err().to_string();
            assert!(
                error.contains("AFTER:S") && error.contains("5:30"),
                "{error}"
            );
        }
    }
}
