//! Terminal functions of both programs: print, report an error in one line, stop at Ctrl-C.
//!
//! Names come from files, packets and paths. They must not move the cursor, change colours or
//! reverse the order of letters, so text is printed through [`printable`].

use std::borrow::Cow;
use std::error::Error;
use std::fmt::Display;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;

pub use skyloop_orbit::{printable, printable_line};

/// Prints text to standard output through [`printable`]. A closed pipe is no error.
///
/// # Errors
/// The system's error.
pub fn say(text: impl Display) -> io::Result<()> {
    write_out(printable(&text.to_string()))
}

/// Prints data to standard output: unchanged to a file or pipe, as [`say`] to a terminal.
pub fn write_out(text: impl Display) -> io::Result<()> {
    let mut out = io::stdout().lock();
    let text = text.to_string();
    let text = if out.is_terminal() {
        printable(&text)
    } else {
        Cow::Borrowed(text.as_str())
    };
    match write!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            let text = format!("cannot write to standard output: {error}");
            Err(io::Error::new(error.kind(), text))
        }
        _ => Ok(()),
    }
}

/// An error and its causes, without causes that the text already contains.
#[must_use]
pub fn in_one_line(error: &(dyn Error + 'static)) -> String {
    let mut line = error.to_string();
    let mut next = error.source();
    while let Some(cause) = next {
        let text = cause.to_string();
        if !line.contains(&text) {
            line = format!("{line}: {text}");
        }
        next = cause.source();
    }
    line
}

/// Ends the program after a wrong command line or a request for help.
pub fn refuse(error: &clap::Error) -> ! {
    if !error.use_stderr() {
        error.exit();
    }
    eprint!("{}", printable(&error.render().to_string()));
    std::process::exit(error.exit_code());
}

/// A flag set by Ctrl-C, SIGTERM and SIGHUP (closed terminal). A second signal ends the process at
/// once. SIGHUP stays ignored under `nohup`.
///
/// # Errors
/// The system refuses the signal handlers.
pub fn stop_at_ctrl_c() -> io::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let hang_up = (!is_ignored(SIGHUP)).then_some(SIGHUP);
    for signal in [SIGINT, SIGTERM].into_iter().chain(hang_up) {
        // Order matters: at the first signal, this handler still reads an unset flag.
        flag::register_conditional_shutdown(signal, 130, Arc::clone(&stop))?;
        flag::register(signal, Arc::clone(&stop))?;
    }
    Ok(stop)
}

/// Whether the process started with this signal ignored, as by `nohup` (Linux: proc_pid_status(5),
/// SigIgn: bit 0 is signal 1).
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}
