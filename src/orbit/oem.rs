//! CCSDS Orbit Ephemeris Messages (502.0-B): segments of states, in keyword = value notation or in
//! XML.

pub(crate) mod xml;

use crate::ephemeris::{Ephemeris, Method, Node, Segment};
use crate::frames::Axes;
use crate::identity::{Key, unnumbered_id};
use crate::lines::Part;
use crate::meta::{Clock, Meta, overlap};
use crate::record::{At, check_version, shorten};
use crate::segments::{self, Message};
use crate::unite::Ids;
use crate::{Contents, Identity, Object, Orbit, StateVector, is_placeholder, time};
use hifitime::Epoch;
use nalgebra::Vector3;
use std::collections::HashMap;

/// Degree without a keyword; the standard leaves it to the reader.
const DEFAULT_DEGREE: usize = 7;
/// Highest degree: beyond it equidistant nodes only amplify rounding.
const MAX_DEGREE: usize = 25;
/// Limits of a state about the Earth. States in other units than km and km/s lie beyond.
const NEAREST_M: f64 = 1e6;
const FARTHEST_M: f64 = 4e9;
const FASTEST_M_S: f64 = 1e5;
/// Longest step, as a share of the radius, for the check of velocities against positions. On a
/// circle the mean of two velocities and the chord's differ by the share's square over 12, 2 %.
const SHORT_STEP: f64 = 0.5;
/// Shortest step for that check, m: positions may be rounded to 1 m.
const MIN_STEP_M: f64 = 1e3;
/// Largest difference, as a share of the speed. Inertial velocities in an Earth-fixed frame are 7 %
/// off.
const VELOCITY_TOLERANCE: f64 = 0.05;

const VERSION: &str = "CCSDS_OEM_VERS";

/// Whether a text with this first line is an OEM.
pub(crate) fn begins(line: &str) -> bool {
    line.starts_with(VERSION)
}

/// Reads every segment; segments with one OBJECT_ID become one object.
///
/// Covariance sections, comments and accelerations are skipped. An unreadable line rejects its
/// segment, and the rest loads.
pub(crate) fn read(part: &Part, contents: &mut Contents) {
    let mut messages = Messages::new(contents);
    // `Messages::reject` returns no error, so the reader never stops early.
    if segments::read(&mut messages, part.lines()).is_ok() {
        messages.finish();
    }
}

/// Whether a line is `KEYWORD = value`.
fn is_header(line: &str) -> bool {
    let keyword = line.split_once('=').map(|(keyword, _)| keyword.trim());
    let is_letter = |b: u8| b.is_ascii_uppercase() || b == b'_';
    keyword.is_some_and(|keyword| keyword.bytes().all(is_letter))
}

/// Reader of the messages of a text; it adds their segments to the contents.
struct Messages<'a> {
    contents: &'a mut Contents,
    /// Count of ephemerides in the contents before this text.
    before: usize,
    has_rejected: bool,
    /// Whether the current message has an unsupported version.
    is_unknown: bool,
    /// Indices of the objects in the contents.
    indices: HashMap<Key, usize>,
    ids: Ids,
}

/// A segment being read.
struct Data {
    id: String,
    name: String,
    axes: Axes,
    clock: Clock,
    in_covariance: bool,
    /// Line of INTERPOLATION_DEGREE.
    degree_line: Option<usize>,
    segment: Segment,
}

impl Message for Messages<'_> {
    type Segment = Data;
    const DATA_STOP: Option<&'static str> = None;

    fn restarts(&self, line: &str) -> bool {
        begins(line)
    }

    fn is_known(&self) -> bool {
        !self.is_unknown
    }

    fn header(&mut self, number: usize, line: &str) -> At<()> {
        if begins(line) {
            let version = line.split_once('=').map(|(_, version)| version);
            let checked = version.map_or(Ok(()), |text| check_version(VERSION, text));
            self.is_unknown = checked.is_err();
            return checked.map_err(|reason| (number, reason));
        }
        // One reason is enough for a record: the rest of a rejected segment is skipped.
        if self.is_unknown || self.has_rejected || is_header(line) {
            return Ok(());
        }
        let reason = "a line outside of every segment; a segment starts with META_START";
        Err((number, reason.to_owned()))
    }

    fn start(&mut self, meta: &Meta) -> At<Data> {
        Data::new(meta, &mut self.contents.first_start)
    }

    /// `epoch x y z vx vy vz [ax ay az]`, km and km/s.
    fn data(data: &mut Data, _: usize, line: &str) -> Result<(), String> {
        if data.in_covariance || line == "COVARIANCE_START" {
            data.in_covariance = line != "COVARIANCE_STOP";
            return Ok(());
        }
        if is_header(line) {
            let reason = "a keyword behind the states; another message starts with its CCSDS_..._VERS: \
                          add that, or split the file here";
            return Err(reason.to_owned());
        }
        let (epoch, numbers) = segments::epoch_and_numbers(line, data.clock)?;
        data.state(epoch, &numbers)
    }

    fn end(&mut self, data: Data, _: usize) -> At<()> {
        let (id, name, segment) = data.finish()?;
        self.add(id, name, segment);
        Ok(())
    }

    fn reject(&mut self, (line, reason): (usize, String)) -> At<()> {
        self.refuse(line, reason);
        Ok(())
    }
}

impl<'a> Messages<'a> {
    fn new(contents: &'a mut Contents) -> Self {
        Messages {
            before: contents.ephemerides.len(),
            contents,
            has_rejected: false,
            is_unknown: false,
            indices: HashMap::new(),
            ids: Ids::new(),
        }
    }

    /// Adds a remark where segments of an object overlap.
    fn finish(self) {
        for object in self.contents.ephemerides.iter_mut().skip(self.before) {
            let Orbit::Ephemeris(Ephemeris { segments }) = &mut object.orbit else {
                continue;
            };
            let spans = segments
                .iter()
                .map(|one| (one.start_ns, one.stop_ns, one.line));
            if let Some((line, remark)) = overlap(spans.collect())
                && let Some(segment) = segments.iter_mut().find(|segment| segment.line == line)
            {
                segment.remarks.push((line, remark));
            }
        }
    }

    fn refuse(&mut self, line: usize, reason: impl AsRef<str>) {
        self.has_rejected = true;
        self.contents.reject(line, reason);
    }

    fn add(&mut self, id: String, name: String, segment: Segment) {
        let mut object = Object {
            identity: Identity::of_ephemeris(&id, &name),
            id: if is_placeholder(&id) {
                unnumbered_id(&id, &name)
            } else {
                id
            },
            names: Vec::from_iter(Some(name).filter(|name| !is_placeholder(name))),
            orbit: Orbit::Ephemeris(Ephemeris {
                segments: vec![segment],
            }),
        };
        let objects = &mut self.contents.ephemerides;
        let index = *(self.indices.entry(Key::of_segment(&object))).or_insert(objects.len());
        if let Some(known) = objects.get_mut(index) {
            known.extend(object);
        } else {
            object.identify(None, &mut self.ids);
            objects.push(object);
        }
    }
}

impl Data {
    fn new(meta: &Meta, first_start: &mut Option<Epoch>) -> At<Data> {
        meta.check_once()?;
        let (center, line) = meta.need("CENTER_NAME")?;
        if !center.eq_ignore_ascii_case("EARTH") {
            let remedy = "only EARTH is read: give the states from the Earth's centre";
            return Err((line, format!("CENTER_NAME '{}'; {remedy}", shorten(center))));
        }
        let ut1 = meta.ut1(first_start)?;
        let clock = meta.clock(ut1)?;
        let (start, stop) = meta.span(clock)?;
        let (axes, assumed) = meta.axes("REF_FRAME", ut1)?;
        let assumed = assumed.into_iter().chain(meta.ut1_step(ut1, stop)?);
        let mut remarks: Vec<_> = assumed.map(|it| (meta.line, it)).collect();
        Ok(Data {
            id: meta.object("OBJECT_ID")?,
            name: meta.object("OBJECT_NAME")?,
            axes,
            clock,
            in_covariance: false,
            degree_line: meta.find("INTERPOLATION_DEGREE").map(|(_, line)| line),
            segment: Segment {
                line: meta.line,
                nodes: Vec::new(),
                method: method(meta, &mut remarks)?,
                start_ns: time::tai_ns(start),
                stop_ns: time::tai_ns(stop),
                remarks,
            },
        })
    }

    fn state(&mut self, epoch: Epoch, numbers: &[f64]) -> Result<(), String> {
        let (&[x, y, z, vx, vy, vz] | &[x, y, z, vx, vy, vz, _, _, _]) = numbers else {
            return Err("not 6 values (or 9 with accelerations)".to_owned());
        };
        let nodes = &mut self.segment.nodes;
        let tai_ns = time::tai_ns(epoch);
        if nodes.last().is_some_and(|node| node.tai_ns >= tai_ns) {
            return Err("an epoch that is not after the one before".to_owned());
        }
        let state = StateVector {
            position_m: Vector3::new(x, y, z) * 1e3,
            velocity_m_s: Vector3::new(vx, vy, vz) * 1e3,
        };
        let state = self.axes.state(epoch, state);
        let (radius_m, speed_m_s) = (state.position_m.norm(), state.velocity_m_s.norm());
        // NaN fails this test.
        let is_within = radius_m <= FARTHEST_M && speed_m_s <= FASTEST_M_S;
        if !is_within {
            return Err("beyond 4e6 km or 100 km/s (states are in km and km/s)".to_owned());
        }
        if radius_m < NEAREST_M {
            let reason = "nearer than 1000 km to the Earth's centre (states are in km and km/s)";
            return Err(reason.to_owned());
        }
        let node = Node { tai_ns, state };
        if let Some(last) = nodes.last() {
            agree(last, &node)?;
        }
        nodes.push(node);
        Ok(())
    }

    /// Limits the segment to its states: nothing is extrapolated.
    fn finish(self) -> At<(String, String, Segment)> {
        let mut segment = self.segment;
        let fault = |reason: &str| Err((segment.line, reason.to_owned()));
        let (first, last) = match segment.nodes.as_slice() {
            [] => return fault("the segment has no states"),
            [_] => {
                let rule = "nothing is extrapolated: give two at least";
                return fault(&format!("the segment has a single state, and {rule}"));
            }
            [first, .., last] => (first.tai_ns, last.tai_ns),
        };
        segment.start_ns = segment.start_ns.max(first);
        segment.stop_ns = segment.stop_ns.min(last);
        if segment.start_ns > segment.stop_ns {
            return fault("no state lies between the segment's start and stop time");
        }
        let has = segment.nodes.len();
        let (Method::Lagrange(count) | Method::Hermite(count)) = segment.method;
        if let Some(line) = self.degree_line.filter(|_| has < count) {
            let remark = format!(
                "INTERPOLATION_DEGREE takes {count} states, and the segment has {has}: the degree is lower"
            );
            segment.remarks.push((line, remark));
        }
        converge(&mut segment, self.degree_line);
        Ok((self.id, self.name, segment))
    }
}

/// Lowers the degree of the interpolation until it converges, with a remark.
fn converge(segment: &mut Segment, degree_line: Option<usize>) {
    let degree = segment.method.degree();
    let mut farthest_m = None;
    while let (Some(off_m), Some(method)) = (segment.divergence_m(), segment.method.lower()) {
        farthest_m = farthest_m.or(Some((off_m, method.degree())));
        segment.method = method;
    }
    let Some((off_m, lower)) = farthest_m else {
        return;
    };
    let remark = format!(
        "interpolation of degree {degree} does not converge on these states (half way between two it is {:.1} km off that of degree \
         {lower}): degree {} is taken; give states at even times, or a lower INTERPOLATION_DEGREE",
        off_m / 1e3,
        segment.method.degree()
    );
    let line = degree_line.unwrap_or(segment.line);
    segment.remarks.push((line, remark));
}

/// The interpolation of the metadata; the defaults are HERMITE and degree 7.
fn method(meta: &Meta, remarks: &mut Vec<(usize, String)>) -> At<Method> {
    let mut degree = DEFAULT_DEGREE;
    if let Some((text, line)) = meta.find("INTERPOLATION_DEGREE") {
        let given = text
            .parse()
            .ok()
            .filter(|degree| (1..=MAX_DEGREE).contains(degree));
        degree = given.ok_or_else(|| {
            let rule = format!("is not 1 to {MAX_DEGREE}: write one of these");
            (
                line,
                format!("INTERPOLATION_DEGREE '{}' {rule}", shorten(text)),
            )
        })?;
    }
    let (name, line) = meta.find("INTERPOLATION").unwrap_or(("HERMITE", meta.line));
    match name.to_ascii_uppercase().as_str() {
        "LINEAR" => {
            if degree > 1 && meta.find("INTERPOLATION_DEGREE").is_some() {
                let remark = format!("of degree 1, not {degree}: 1 is taken");
                remarks.push((line, format!("INTERPOLATION LINEAR is {remark}")));
            }
            Ok(Method::Lagrange(2))
        }
        "LAGRANGE" => Ok(Method::Lagrange(degree + 1)),
        "HERMITE" => {
            // n states give 2 n conditions: a polynomial of degree 2 n - 1.
            let states = (degree / 2 + 1).max(2);
            let taken = 2 * states - 1;
            if taken != degree {
                let remark = format!("of degree 3, 5, 7 and so on, not {degree}: {taken} is taken");
                remarks.push((line, format!("INTERPOLATION HERMITE is {remark}")));
            }
            Ok(Method::Hermite(states))
        }
        _ => {
            let known = "LAGRANGE, HERMITE and LINEAR: name one of them, or none for HERMITE";
            Err((
                line,
                format!("INTERPOLATION '{}'; expected {known}", shorten(name)),
            ))
        }
    }
}

/// Checks that the velocities of two neighbours agree with their positions.
fn agree(a: &Node, b: &Node) -> Result<(), String> {
    let step_m = b.state.position_m - a.state.position_m;
    let seconds = (b.tai_ns - a.tai_ns) as f64 / 1e9;
    let mean_m_s = (a.state.velocity_m_s + b.state.velocity_m_s) / 2.0;
    // The larger of both: after a full revolution the chord is short, too.
    let path_m = step_m.norm().max(mean_m_s.norm() * seconds);
    if path_m > SHORT_STEP * a.state.position_m.norm() || step_m.norm() < MIN_STEP_M {
        return Ok(());
    }
    let chord_m_s = step_m / seconds;
    let off = (mean_m_s - chord_m_s).norm() / chord_m_s.norm();
    if off <= VELOCITY_TOLERANCE {
        return Ok(());
    }
    Err(format!(
        "velocities {:.0} % off the mean rate of the positions since the previous state (states are in km and km/s, velocities \
         relative to the axes of REF_FRAME)",
        100.0 * off
    ))
}
