//! What both programs do at a terminal: print, tell an error in one line, end at Ctrl-C.
//!
//! Names come from files, from the wire and from paths. None of them may move the cursor, change colours or turn the order
//! of letters: text is printed through [`printable`].

use std::borrow::Cow;
use std::error::Error;
use std::fmt::Display;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;

/// Whether a character steers a terminal (C0 and C1 controls) or the order of letters (Unicode Standard Annex 9).
fn steers(character: char) -> bool {
    character.is_control()
        || matches!(character, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Text that a terminal shows as it stands. Ends of lines and tabs stay; other controls and direction marks are written as
/// JSON escapes, such as `\u001b`, so that JSON keeps its meaning.
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, |character| {
        steers(character) && !matches!(character, '\n' | '\t')
    })
}

/// The same in one line.
#[must_use]
pub fn printable_line(text: &str) -> Cow<'_, str> {
    escaped(text, steers)
}

fn escaped(text: &str, is_escaped: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&is_escaped) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for character in text.chars() {
        match is_escaped(character) {
            true => shown += &format!("\\u{:04x}", u32::from(character)),
            false => shown.push(character),
        }
    }
    Cow::Owned(shown)
}

/// Prints text for people to standard output, as [`printable`]. That somebody has closed it is no error.
///
/// # Errors
/// What else the system says.
pub fn say(text: impl Display) -> io::Result<()> {
    write_out(printable(&text.to_string()))
}

/// Prints data for programs to standard output, unchanged but where that is a terminal; else as [`say`].
///
/// # Errors
/// As of [`say`].
pub fn write_out(text: impl Display) -> io::Result<()> {
    let mut out = io::stdout().lock();
    let text = text.to_string();
    let text = match out.is_terminal() {
        true => printable(&text),
        false => Cow::Borrowed(text.as_str()),
    };
    match write!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            let text = format!("cannot write to standard output: {error}");
            Err(io::Error::new(error.kind(), text))
        }
        _ => Ok(()),
    }
}

/// An error and its causes; a cause that the text before it already tells is left out.
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

/// Ends the program where its command line cannot be read, or asks for help.
pub fn refuse(error: &clap::Error) -> ! {
    if !error.use_stderr() {
        error.exit();
    }
    eprint!("{}", printable(&error.render().to_string()));
    std::process::exit(error.exit_code());
}

/// A flag that Ctrl-C, SIGTERM and SIGHUP (the terminal was closed) set; a second signal ends the process at once. `nohup` ignores SIGHUP, and
/// it stays ignored.
///
/// # Errors
/// The system refuses to watch for them.
pub fn stop_at_ctrl_c() -> io::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let hang_up = (!is_ignored(SIGHUP)).then_some(SIGHUP);
    for signal in [SIGINT, SIGTERM].into_iter().chain(hang_up) {
        // In this order: the first one finds the flag not set yet.
        flag::register_conditional_shutdown(signal, 130, Arc::clone(&stop))?;
        flag::register(signal, Arc::clone(&stop))?;
    }
    Ok(stop)
}

/// Whether the process was started with this signal ignored, as `nohup` does it (Linux: proc_pid_status(5), SigIgn: bit 0 is signal 1).
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_is_printed_steers_a_terminal() {
        for (text, shown) in [
            (
                "a plain line\n\tand é 🛰 שלום\n",
                "a plain line\n\tand é 🛰 שלום\n",
            ),
            ("\u{1b}[31mred\u{7}\r", "\\u001b[31mred\\u0007\\u000d"),
            // X-Val: ECMA-48, 8.3.16: CSI is 9B in eight bits.
            ("\u{9b}2J\u{85}\u{7f}", "\\u009b2J\\u0085\\u007f"),
            // X-Val: Unicode Standard Annex 9, table 1: explicit directional formatting characters.
            (
                "\u{202a}\u{202e}\u{2066}\u{2069}\u{200e}\u{200f}\u{61c}",
                "\\u202a\\u202e\\u2066\\u2069\\u200e\\u200f\\u061c",
            ),
        ] {
            assert_eq!(printable(text), shown);
        }
        assert_eq!(printable_line("a\nb"), "a\\u000ab");
        // JSON keeps its meaning.
        let json = serde_json::Value::from("a\u{202e}b\u{9b}c").to_string();
        let read: String = serde_json::from_str(&printable(&json)).unwrap();
        assert_eq!(read, "a\u{202e}b\u{9b}c");
    }
}
