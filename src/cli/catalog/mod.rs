//! `skyloop catalog`: commands for orbit files. A subcommand is a file here and a line in
//! [`Command`].

mod check;
mod info;
mod source;
mod synth;

use anyhow::bail;
use clap::Subcommand;
use skyloop::orbit::{Format, LARGEST_FILE};

#[derive(Subcommand)]
pub enum Command {
    /// Report the contents of orbit files, and each unusable record with line and reason
    Check(check::Args),
    /// Count the objects by type of orbit, or print one object
    Info(info::Args),
    /// Generate a synthetic population with the mix of the real one, for scale tests
    Synth(synth::Args),
}

/// Refuses a file of `bytes` that is too long to be read again; the error has the `remedy`.
fn fits(what: &str, format: Format, bytes: f64, remedy: &str) -> anyhow::Result<()> {
    const GIB: f64 = (1 << 30) as f64;
    if bytes > LARGEST_FILE as f64 {
        bail!(
            "{what} would take {:.1} GiB as {format}, and files of at most {:.0} GiB are read: {remedy}",
            bytes / GIB,
            LARGEST_FILE as f64 / GIB
        );
    }
    Ok(())
}

pub fn run(command: Command) -> anyhow::Result<()> {
    match command {
        Command::Check(args) => check::run(args),
        Command::Info(args) => info::run(args),
        Command::Synth(args) => synth::run(args),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_too_long_to_read_are_not_written() {
        // X-Val: docs/how-to/install.md: files of up to 2 GiB are read.
        let max = 2.0 * 1024.0 * 1024.0 * 1024.0;
        let fits = |bytes| super::fits("9 objects", Format::OmmXml, bytes, "write .csv");
        assert!(fits(max).is_ok());
        let error = fits(1.3 * max).unwrap_err().to_string();
        for word in [
            "9 objects would take 2.6 GiB as omm-xml",
            "at most 2 GiB",
            ": write .csv",
        ] {
            assert!(error.contains(word), "{error}");
        }
    }
}
