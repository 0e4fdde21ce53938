//! The record of injected faults: counts, and a log file with one line of JSON each.

use super::injection::{Damage, Event, Injection};
use super::plan::name;
use super::stopped::{LastingEffects, Needs, Stop, Stopped};
use skyloop_orbit::path_text;
use skyloop_orbit::{Mark, OutputFile};
use skyloop_protocols::Direction;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Injected faults so far.
#[derive(Default)]
pub struct FaultLog {
    counts: BTreeMap<(bool, &'static str), u64>,
    stopped: Stopped,
    log: Option<Log>,
    /// The wall clock's time at the engine's zero, since 1970.
    zero: Duration,
}

/// The log file.
struct Log {
    name: String,
    file: BufWriter<File>,
    /// Why a write failed; nothing is written after that.
    failed: Option<String>,
}

/// Marks of a fault log of skyloop.
pub const MARK: Mark = &["{\"t_s\":", ",\"unix_s\":"];

/// Maximum number of listed inverted bits per packet; further ones are only counted.
const MAX_BITS: usize = 64;

impl FaultLog {
    /// A log that also writes to `output` at `path`.
    pub fn writing(path: &Path, output: &OutputFile) -> std::io::Result<FaultLog> {
        Ok(FaultLog {
            log: Some(Log {
                name: path_text(path),
                file: BufWriter::new(output.file()?),
                failed: None,
            }),
            ..FaultLog::default()
        })
    }

    /// Sets the engine's zero to now.
    pub(super) fn start(&mut self) {
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        self.zero = now.unwrap_or_default();
    }

    /// Records injections into the link at `address`.
    pub(super) fn note(&mut self, address: &str, injections: &[Injection]) {
        for injection in injections {
            let out = injection.direction == Direction::Out;
            if let Event::Item { .. } = injection.event {
                *self.counts.entry((out, name(injection.kind))).or_default() += 1;
            }
            if let Some(log) = &mut self.log {
                log.write(&line(address, injection, self.zero));
            }
        }
    }

    /// Number of injections, of all kinds and both directions.
    pub fn total(&self) -> u64 {
        self.counts.values().sum()
    }

    /// The counts as text: `in: drop 3, jitter 7; out: none`.
    pub fn summary(&self) -> String {
        let of = |out| {
            let own = self.counts.iter().filter(|((o, _), _)| *o == out);
            let counts: Vec<String> = own.map(|((_, name), n)| format!("{name} {n}")).collect();
            if counts.is_empty() {
                "none".to_string()
            } else {
                counts.join(", ")
            }
        };
        format!("in: {}; out: {}", of(false), of(true))
    }

    /// Adds the effects of lasting faults on packets in and out.
    pub(super) fn add_lasting(&mut self, [inbound, outbound]: [LastingEffects; 2]) {
        self.stopped.add(Direction::In, inbound);
        self.stopped.add(Direction::Out, outbound);
    }

    /// The lasting fault that stops all packets, such as `stuck, out`, and the number of affected
    /// packets (on CAN: frames). `None` if it affected none after `since`, or has ended.
    pub fn stopped(&self, since: Instant, needs: &Needs) -> Option<Stop> {
        self.stopped.since(since, Instant::now(), needs)
    }

    /// Flushes the log to its file.
    pub(crate) fn flush(&mut self) {
        if let Some(log) = &mut self.log {
            log.attempt(|file| file.flush());
        }
    }

    /// Errors: the log file is incomplete; the reason.
    pub fn finish(&mut self) -> Result<(), String> {
        self.flush();
        let failed = self.log.as_mut().and_then(|log| log.failed.take());
        failed.map_or(Ok(()), Err)
    }
}

impl Log {
    fn write(&mut self, line: &str) {
        self.attempt(|file| file.write_all(line.as_bytes()));
    }

    fn attempt(&mut self, act: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>) {
        if self.failed.is_some() {
            return;
        }
        if let Err(error) = act(&mut self.file) {
            let why = format!(
                "{}: {error}; make room for the log of the faults",
                self.name
            );
            tracing::warn!("{why}");
            self.failed = Some(why);
        }
    }
}

fn line(address: &str, injection: &Injection, zero: Duration) -> String {
    let direction = match injection.direction {
        Direction::In => "in",
        Direction::Out => "out",
    };
    let seconds = |t: Duration| format!("{}.{:09}", t.as_secs(), t.subsec_nanos());
    let mut text = format!(
        "{{\"t_s\":{},\"unix_s\":{},\"link\":{},\"direction\":\"{direction}\",\"kind\":\"{}\"",
        seconds(injection.at),
        seconds(zero + injection.at),
        serde_json::Value::from(address),
        name(injection.kind)
    );
    // Writing to a string cannot fail.
    let _ = match &injection.event {
        Event::Begins(value) => write!(text, ",\"event\":\"begins\",\"value\":{value}"),
        Event::Ends => write!(text, ",\"event\":\"ends\""),
        Event::Item {
            number,
            length,
            members,
            damage,
        } => {
            let comma = if members.is_empty() { "" } else { "," };
            let _ = write!(
                text,
                ",\"event\":\"injected\",\"item\":{number},\"octets\":{length}{comma}{members}"
            );
            match damage {
                Damage::ByKind => Ok(()),
                Damage::CutTo(left) => write!(text, ",\"cut_to\":{left}"),
                Damage::Later(by) => write!(text, ",\"later_s\":{}", seconds(*by)),
                Damage::Bits(bits) => write!(
                    text,
                    ",\"flipped\":{},\"bits\":{:?}",
                    bits.len(),
                    &bits[..bits.len().min(MAX_BITS)]
                ),
            }
        }
    };
    text.push_str("}\n");
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::FaultKind;

    /// Device names may contain any characters.
    #[test]
    fn every_address_gives_a_valid_line() {
        for address in [
            "udp://127.0.0.1:4810",
            "pty://a \"b\" \\ c",
            "pty://\u{1}\t\u{7f}\u{e9}\u{200b}\u{1f680}",
        ] {
            let injection = Injection {
                at: Duration::from_millis(1500),
                direction: Direction::In,
                kind: FaultKind::Drop,
                event: Event::Begins(1e-7),
            };
            let line = line(address, &injection, Duration::from_secs(10));
            let value: serde_json::Value = serde_json::from_str(&line).unwrap();
            assert_eq!(value["link"], address);
            assert_eq!(
                (&value["t_s"], &value["unix_s"]),
                (&1.5.into(), &11.5.into())
            );
            assert_eq!(
                (&value["event"], &value["value"]),
                (&"begins".into(), &1e-7.into())
            );
            assert_eq!(line.lines().count(), 1);
        }
    }
}
