//! CCSDS Attitude Ephemeris Messages in keyword = value notation: versions 1.0 (504.0-B-1) and 2.0
//! (504.0-B-2).

use crate::frames::{Axes, FRAMES};
use crate::identity::Key;
use crate::meta::{Clock, Meta, Ut1, overlap};
use crate::record::{At, check_version, shorten};
use crate::segments::{self, Message};
use crate::{lines, time};
use hifitime::Epoch;
use nalgebra::{Quaternion, Rotation3, UnitQuaternion};

const VERSION: &str = "CCSDS_AEM_VERS";

/// Supported ATTITUDE_TYPEs, and the count of numbers after the quaternion in a data line.
const TYPES: [(&str, usize); 4] = [
    ("QUATERNION", 0),
    ("QUATERNION/DERIVATIVE", 4),
    ("QUATERNION/RATE", 3),
    ("QUATERNION/ANGVEL", 3),
];

/// The attitudes of an object.
#[derive(Clone, Debug, Default)]
pub struct AttitudeMessage {
    /// In the order of the file.
    pub segments: Vec<AttitudeSegment>,
    /// Line numbers and remarks: data that are ignored, values that are assumed.
    pub remarks: Vec<(usize, String)>,
}

/// Attitudes of one segment; interpolation stays within a segment.
#[derive(Clone, Debug)]
pub struct AttitudeSegment {
    /// Line of its META_START.
    pub line: usize,
    /// Start of the usable time.
    pub start: Epoch,
    /// End of the usable time.
    pub stop: Epoch,
    /// At increasing epochs.
    pub attitudes: Vec<TimedAttitude>,
}

/// An attitude at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimedAttitude {
    /// Line of the file.
    pub line: usize,
    /// Instant of the attitude.
    pub epoch: Epoch,
    /// `[x, y, z, w]`, Hamilton, ICRF to body: `v_body = q v_icrf q^-1`. The norm is that of the
    /// file, not 1.
    pub q_icrf_to_body: [f64; 4],
}

/// Whether a text is an AEM.
pub fn is_message(text: &str) -> bool {
    let first = text.get(lines::start(text)..);
    first.is_some_and(|text| text.starts_with(VERSION))
}

/// Reads a message. One unreadable line refuses the whole file: a missing attitude would leave a
/// gap.
///
/// # Errors
///
/// The line number and the fault.
pub fn parse(text: &str) -> Result<AttitudeMessage, (usize, String)> {
    let mut reader = Reader::default();
    let last = segments::read(&mut reader, lines::numbered(text))?;
    reader.check_overlap();
    if reader.message.segments.is_empty() {
        let reason = "no attitudes; a segment is META_START ... META_STOP and its attitudes";
        return Err((last, reason.to_owned()));
    }
    Ok(reader.message)
}

#[derive(Default)]
struct Reader {
    message: AttitudeMessage,
    /// Whether the message has version 2.0.
    is_second: bool,
    object: Option<Key>,
    /// The body frame, and its line.
    body: Option<(String, usize)>,
    /// START_TIME of the first segment.
    first_start: Option<Epoch>,
}

/// Format of the data lines of a segment, and the segment read so far.
struct Data {
    clock: Clock,
    axes: Axes,
    /// Whether the quaternion rotates from the body to the reference frame.
    is_from_body: bool,
    is_scalar_first: bool,
    /// Numbers in a line.
    columns: usize,
    segment: AttitudeSegment,
}

impl Message for Reader {
    type Segment = Data;
    const DATA_STOP: Option<&'static str> = Some("DATA_STOP");

    fn header(&mut self, number: usize, line: &str) -> At<()> {
        let Some((key, value)) = line.split_once('=') else {
            let rule = "a segment starts with META_START";
            let reason = format!("'{}' outside of every segment; {rule}", shorten(line));
            return Err((number, reason));
        };
        if key.trim() == VERSION {
            check_version(VERSION, value).map_err(|reason| (number, reason))?;
            self.is_second = value.trim().starts_with('2');
        }
        Ok(())
    }

    fn start(&mut self, meta: &Meta) -> At<Data> {
        self.segment(meta)
    }

    /// `epoch q q q q [rates]`.
    fn data(data: &mut Data, number: usize, line: &str) -> Result<(), String> {
        if line == "DATA_START" {
            return Ok(());
        }
        let (epoch, numbers) = segments::epoch_and_numbers(line, data.clock)?;
        data.add(number, epoch, &numbers)
    }

    fn end(&mut self, Data { segment, .. }: Data, number: usize) -> At<()> {
        let count = segment.attitudes.len();
        if count < 2 {
            let rule = "give two at least, nothing is extrapolated";
            return Err((number, format!("{count} attitudes in a segment; {rule}")));
        }
        self.message.segments.push(segment);
        Ok(())
    }

    fn reject(&mut self, error: (usize, String)) -> At<()> {
        Err(error)
    }
}

impl Reader {
    /// Adds a remark for segments whose usable times overlap.
    fn check_overlap(&mut self) {
        let spans = self.message.segments.iter().filter_map(|segment| {
            let (first, last) = (segment.attitudes.first()?, segment.attitudes.last()?);
            let start = segment.start.max(first.epoch);
            let stop = segment.stop.min(last.epoch);
            Some((time::tai_ns(start), time::tai_ns(stop), segment.line))
        });
        if let Some((line, remark)) = overlap(spans.collect()) {
            self.remark(line, remark);
        }
    }

    fn segment(&mut self, meta: &Meta) -> At<Data> {
        meta.check_once()?;
        let (id, line) = meta.need("OBJECT_ID")?;
        let name = meta.find("OBJECT_NAME").map_or("", |(name, _)| name);
        let object = Key::of_ephemeris(id, name);
        if *self.object.get_or_insert_with(|| object.clone()) != object {
            let reason = "another OBJECT_ID than before: give the attitudes of each object in a file of its own";
            return Err((line, reason.to_owned()));
        }
        let ut1 = meta.ut1(&mut self.first_start)?;
        let clock = meta.clock(ut1)?;
        let (start, stop) = meta.span(clock)?;
        // The type is checked before the keywords below: other types have others.
        let more = self.columns(meta)?;
        let (from_a, is_scalar_first) = self.order(meta)?;
        let (axes, a_is_body, assumed) = frames(meta, ut1)?;
        let body_key = if a_is_body {
            "REF_FRAME_A"
        } else {
            "REF_FRAME_B"
        };
        self.check_body(meta.need(body_key)?)?;
        for assumed in [assumed, meta.ut1_step(ut1, stop)?].into_iter().flatten() {
            self.remark(meta.line, assumed);
        }
        if let Some((method, line)) = meta.find("INTERPOLATION_METHOD")
            && !method.eq_ignore_ascii_case("LINEAR")
        {
            let method = shorten(method);
            let remark = format!(
                "INTERPOLATION_METHOD {method}: attitudes are slerped between neighbours instead, which is off by an eighth of \
                 the angular acceleration times the square of their distance in time at most"
            );
            self.remark(line, remark);
        }
        Ok(Data {
            clock,
            axes,
            is_from_body: from_a == a_is_body,
            is_scalar_first,
            columns: 4 + more,
            segment: AttitudeSegment {
                line: meta.line,
                start,
                stop,
                attitudes: Vec::new(),
            },
        })
    }

    /// Refuses a body frame other than that of the earlier segments.
    fn check_body(&mut self, (body, line): (&str, usize)) -> At<()> {
        let (known, first) = (self.body).get_or_insert_with(|| (body.to_ascii_uppercase(), line));
        if body.eq_ignore_ascii_case(known) {
            return Ok(());
        }
        let body = shorten(body);
        let reason = format!(
            "body frame '{body}', and {known} in line {first}: the rotation between them is unknown; give the attitudes of each in \
             a file of its own"
        );
        Err((line, reason))
    }

    /// The count of numbers after the quaternion in a data line.
    fn columns(&mut self, meta: &Meta) -> At<usize> {
        let (given, line) = meta.need("ATTITUDE_TYPE")?;
        let mut known = TYPES.iter();
        let Some((name, more)) = known.find(|(name, _)| given.eq_ignore_ascii_case(name)) else {
            let (given, names) = (shorten(given), TYPES.map(|(name, _)| name).join(", "));
            let remedy = "export the attitudes as QUATERNION";
            let reason = format!("ATTITUDE_TYPE '{given}'; expected {names}: {remedy}");
            return Err((line, reason));
        };
        if *more > 0 {
            let remark = format!(
                "ATTITUDE_TYPE {name}: attitudes are slerped and have the rates of the slerp, those of the file are not used"
            );
            self.remark(line, remark);
        }
        Ok(*more)
    }

    /// Adds a remark, once for all segments.
    fn remark(&mut self, line: usize, remark: String) {
        let remarks = &mut self.message.remarks;
        if remarks.iter().all(|(_, known)| *known != remark) {
            remarks.push((line, remark));
        }
    }

    /// Whether the quaternion rotates from REF_FRAME_A to REF_FRAME_B, and whether its scalar comes
    /// first. Version 1.0 has keywords for both; version 2.0 fixes A to B and the scalar last
    /// (504.0-B-2, tables 4-3 and 4-4).
    fn order(&self, meta: &Meta) -> At<(bool, bool)> {
        let one_of = |key: &str, yes: &str, no: &str| match meta.find(key) {
            None => Ok(None),
            Some((text, _)) if text.eq_ignore_ascii_case(yes) => Ok(Some(true)),
            Some((text, _)) if text.eq_ignore_ascii_case(no) => Ok(Some(false)),
            Some((text, line)) => {
                let text = shorten(text);
                Err((line, format!("{key} '{text}' is not {yes} or {no}")))
            }
        };
        let from_a = one_of("ATTITUDE_DIR", "A2B", "B2A")?;
        let is_scalar_first = one_of("QUATERNION_TYPE", "FIRST", "LAST")?;
        let missing = |key: &str| {
            let reason = format!("the metadata have no {key}, which version 1.0 needs");
            (meta.line, reason)
        };
        match (self.is_second, from_a, is_scalar_first) {
            (true, None | Some(true), None | Some(false)) => Ok((true, false)),
            (true, ..) => {
                let reason = "ATTITUDE_DIR B2A or QUATERNION_TYPE FIRST in version 2.0, which has A to B and the scalar last: \
                              if the keyword is right, write CCSDS_AEM_VERS = 1.0";
                Err((meta.line, reason.to_owned()))
            }
            (_, None, _) => Err(missing("ATTITUDE_DIR")),
            (_, _, None) => Err(missing("QUATERNION_TYPE")),
            (_, Some(from_a), Some(is_scalar_first)) => Ok((from_a, is_scalar_first)),
        }
    }
}

/// The axes of the reference frame, whether REF_FRAME_A is the body, and a remark on assumptions.
fn frames(meta: &Meta, ut1: Ut1) -> At<(Axes, bool, Option<String>)> {
    let ((a, _), (b, line)) = (meta.need("REF_FRAME_A")?, meta.need("REF_FRAME_B")?);
    let is_body = |name: &str| name.to_ascii_uppercase().starts_with("SC_BODY");
    let (key, a_is_body) = match (is_body(a), is_body(b)) {
        (false, true) => ("REF_FRAME_A", false),
        (true, false) => ("REF_FRAME_B", true),
        _ => {
            let (a, b) = (shorten(a), shorten(b));
            let reason = format!(
                "REF_FRAME_A '{a}' and REF_FRAME_B '{b}': one must be the body, SC_BODY or SC_BODY_1, and the other one of {FRAMES}; \
                 give the attitude of the body, not of an instrument"
            );
            return Err((line, reason));
        }
    };
    let (axes, assumed) = meta.axes(key, ut1)?;
    Ok((axes, a_is_body, assumed))
}

impl Data {
    fn add(&mut self, line: usize, epoch: Epoch, numbers: &[f64]) -> Result<(), String> {
        let &[first, second, third, fourth, ..] = numbers else {
            return Err("no quaternion".to_owned());
        };
        let (columns, count) = (self.columns, numbers.len());
        if count != columns {
            return Err(format!(
                "{count} values, not {columns} as ATTITUDE_TYPE says,"
            ));
        }
        let attitudes = &mut self.segment.attitudes;
        if attitudes.last().is_some_and(|last| last.epoch >= epoch) {
            return Err("an epoch that is not after the one before".to_owned());
        }
        let q = if self.is_scalar_first {
            Quaternion::new(first, second, third, fourth)
        } else {
            Quaternion::new(fourth, first, second, third)
        };
        // CCSDS: a quaternion from frame A to B transforms coordinates by v_B = q^-1 v_A q
        // (504.0-B-2, annex F2). This program: v_B = q v_A q^-1.
        let to_body = if self.is_from_body { q } else { q.conjugate() };
        // q_icrf_to_body = q_frame_to_body q_icrf_to_frame
        let from_icrf = Rotation3::from_matrix_unchecked(self.axes.to_gcrf(epoch).transpose());
        let q = to_body * UnitQuaternion::from_rotation_matrix(&from_icrf).into_inner();
        attitudes.push(TimedAttitude {
            line,
            epoch,
            q_icrf_to_body: [q.i, q.j, q.k, q.w],
        });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A message of two segments with these metadata.
    fn message(first: &str, second: &str) -> String {
        let segment = |of: &str, minute: u32| {
            let at = |second: u32| format!("2020-01-01T00:0{minute}:{second:02}");
            let (start, stop) = (at(0), at(30));
            format!(
                "META_START\n{of}REF_FRAME_A = ICRF\nTIME_SYSTEM = UTC\nSTART_TIME = {start}\nSTOP_TIME = {stop}\n\
                 ATTITUDE_TYPE = QUATERNION\nMETA_STOP\nDATA_START\n{start} 0 0 0 1\n{stop} 0 0 0 1\nDATA_STOP\n"
            )
        };
        let (first, second) = (segment(first, 0), segment(second, 1));
        format!("CCSDS_AEM_VERS = 2.0\n{first}{second}")
    }

    #[test]
    fn segments_are_of_one_object_and_one_body() {
        let of = |id: &str, body: &str| format!("OBJECT_ID = {id}\nREF_FRAME_B = {body}\n");
        let first = of("2020-001A", "SC_BODY_1");
        for (id, body, reason) in [
            ("2020-001A", "SC_BODY_1", None),
            ("2020-001-A", "sc_body_1", None),
            ("20001A", "SC_BODY_1", None),
            ("2020-001B", "SC_BODY_1", Some("another OBJECT_ID")),
            ("45000", "SC_BODY_1", Some("another OBJECT_ID")),
            ("2020-001A", "SC_BODY_2", Some("'SC_BODY_2', and SC_BODY_1")),
            ("2020-001A", "SC_BODY", Some("'SC_BODY', and SC_BODY_1")),
        ] {
            let read = parse(&message(&first, &of(id, body)));
            let found = read.err().map(|(_, reason)| reason);
            let is_as_expected = match (&found, reason) {
                (None, None) => true,
                (Some(found), Some(reason)) => found.contains(reason),
                _ => false,
            };
            assert!(is_as_expected, "{id} {body}: {found:?}");
        }
    }
}
