//! Segments of CCSDS ephemeris messages in keyword = value notation. The reader serves orbits (OEM)
//! and attitudes (AEM).

use crate::meta::{Clock, Meta, is_significant};
use crate::record::{At, shorten};
use hifitime::Epoch;

/// A kind of message, with the segments read so far.
pub(crate) trait Message {
    /// A segment whose data lines are being read.
    type Segment;
    /// The line that ends the data of a segment, if the standard has one.
    const DATA_STOP: Option<&'static str>;

    /// Whether another message starts with this line, in any section.
    fn restarts(&self, _line: &str) -> bool {
        false
    }

    /// Whether the version of the message is supported; else its segments are skipped.
    fn is_known(&self) -> bool {
        true
    }

    /// Reads a line outside of every segment.
    fn header(&mut self, number: usize, line: &str) -> At<()>;

    /// Starts a segment from its metadata block.
    fn start(&mut self, meta: &Meta) -> At<Self::Segment>;

    /// Reads a data line. The caller adds the line's text to the error.
    fn data(segment: &mut Self::Segment, number: usize, line: &str) -> Result<(), String>;

    /// Adds a segment that ends before line `number`.
    fn end(&mut self, segment: Self::Segment, number: usize) -> At<()>;

    /// Handles an error. Reading goes on after the segment, unless this returns the error.
    fn reject(&mut self, error: (usize, String)) -> At<()>;
}

/// Position of the reader in the message.
enum Section<S> {
    /// In the header, or in a segment that was rejected.
    Outside,
    Meta(Meta),
    Data(S),
}

/// Reads the lines of a text into a message. Returns the number of the last line.
pub(crate) fn read<'a, M: Message>(
    message: &mut M,
    lines: impl Iterator<Item = (usize, &'a str)>,
) -> At<usize> {
    let mut section = Section::Outside;
    let mut last = 0;
    for (number, line) in lines {
        last = number;
        let line = line.trim_start();
        if !is_significant(line, matches!(section, Section::Meta(_))) {
            continue;
        }
        let starts = line == "META_START" && message.is_known();
        let stops = M::DATA_STOP == Some(line) && matches!(section, Section::Data(_));
        if starts || stops || message.restarts(line) {
            let open = std::mem::replace(&mut section, Section::Outside);
            close(message, open, number).or_else(|error| message.reject(error))?;
        }
        section = match section {
            Section::Outside if starts => Section::Meta(Meta::new(number)),
            Section::Outside if stops => Section::Outside,
            section => match step(message, section, number, line) {
                Ok(next) => next,
                Err(error) => {
                    message.reject(error)?;
                    Section::Outside
                }
            },
        };
    }
    close(message, section, last).or_else(|error| message.reject(error))?;
    Ok(last)
}

fn step<M: Message>(
    message: &mut M,
    section: Section<M::Segment>,
    number: usize,
    line: &str,
) -> At<Section<M::Segment>> {
    match section {
        Section::Outside => message.header(number, line).map(|()| Section::Outside),
        Section::Meta(meta) if line == "META_STOP" => message.start(&meta).map(Section::Data),
        Section::Meta(mut meta) => {
            meta.add(number, line)?;
            Ok(Section::Meta(meta))
        }
        Section::Data(mut segment) => {
            M::data(&mut segment, number, line)
                .map_err(|fault| (number, format!("{fault} in '{}'", shorten(line))))?;
            Ok(Section::Data(segment))
        }
    }
}

/// Ends the open section before line `number`.
fn close<M: Message>(message: &mut M, section: Section<M::Segment>, number: usize) -> At<()> {
    match section {
        Section::Outside => Ok(()),
        Section::Meta(meta) => {
            let reason = "META_START without META_STOP; restore the metadata block";
            Err((meta.line, reason.to_owned()))
        }
        Section::Data(segment) => message.end(segment, number),
    }
}

pub(crate) fn epoch_and_numbers(line: &str, clock: Clock) -> Result<(Epoch, Vec<f64>), String> {
    let mut words = line.split_whitespace();
    let epoch = words.next().and_then(|text| clock.read(text));
    let epoch = epoch.ok_or("no epoch")?;
    let numbers = words.map(|word| word.parse().ok().filter(|x: &f64| x.is_finite()));
    let numbers: Option<Vec<f64>> = numbers.collect();
    Ok((epoch, numbers.ok_or("a value that is not a number")?))
}
