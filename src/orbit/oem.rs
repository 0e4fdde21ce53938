//! CCSDS Orbit Ephemeris Messages (502.0-B): segments of states, in keyword = value notation or in XML.

pub(crate) mod xml;

use crate::ephemeris::{Ephemeris, Method, Node, Segment};
use crate::frames::Axes;
use crate::identity::{Key, unnumbered_id};
use crate::meta::{Clock, Meta, overlap};
use crate::parts::Part;
use crate::record::{At, check_version, shorten};
use crate::unite::Ids;
use crate::{Contents, Identity, Object, Orbit, StateVector, is_placeholder, meta};
use hifitime::Epoch;
use nalgebra::Vector3;
use std::collections::HashMap;

/// Degree where the message names none; the standard leaves it to the reader.
const DEFAULT_DEGREE: usize = 7;
/// Highest degree accepted: beyond it equidistant nodes only amplify rounding.
const MAX_DEGREE: usize = 25;
/// Nearest, farthest and fastest state about the Earth; other units than km and km/s lie beyond.
const NEAREST_M: f64 = 1e6;
const FARTHEST_M: f64 = 4e9;
const FASTEST_M_S: f64 = 1e5;
/// Longest step, as a share of the radius, for which velocities are compared with positions: on a
/// circle the mean of two velocities and the chord differ by its square over 12, here 2 %.
const SHORT_STEP: f64 = 0.5;
/// Steps must be longer than this, m, to tell it: positions may be rounded to 1 m.
const LEAST_STEP_M: f64 = 1e3;
/// Share of the speed by which they may differ at most. Velocities against inertial axes in an Earth-fixed frame are 7 % off.
const VELOCITY_TOLERANCE: f64 = 0.05;

/// The keyword that every message starts with.
const VERSION: &str = "CCSDS_OEM_VERS";

/// Whether a text whose first line is this one is an OEM.
pub(crate) fn begins(line: &str) -> bool {
    line.starts_with(VERSION)
}

/// Reads every segment; segments of one OBJECT_ID become one object.
///
/// Covariance sections, comments and accelerations are skipped. A segment with a line that cannot
/// be read is rejected as a whole, and the rest loads.
pub(crate) fn read(part: &Part, contents: &mut Contents) {
    let mut reader = Reader {
        read: Segments::new(contents),
        section: Section::Outside,
        is_unknown: false,
    };
    let mut last = part.lines_before;
    for (number, line) in part.lines() {
        last = number;
        let line = line.trim_start();
        if meta::is_significant(line, matches!(reader.section, Section::Meta(_))) {
            reader.line(last, line);
        }
    }
    reader.close(last);
    reader.read.finish();
}

/// Whether a line is `KEYWORD = value`, as the header's are.
fn is_header(line: &str) -> bool {
    let keyword = line.split_once('=').map(|(keyword, _)| keyword.trim());
    let is_letter = |b: u8| b.is_ascii_uppercase() || b == b'_';
    keyword.is_some_and(|keyword| keyword.bytes().all(is_letter))
}

struct Reader<'a> {
    read: Segments<'a>,
    section: Section,
    /// Whether the message is of a version that is not read.
    is_unknown: bool,
}

/// Adds the segments of a text to its contents.
struct Segments<'a> {
    contents: &'a mut Contents,
    /// Ephemerides in the contents before those of this text.
    before: usize,
    has_rejected: bool,
    /// Places of the objects in the contents.
    places: HashMap<Key, usize>,
    ids: Ids,
}

/// Where in the message the reader is.
#[derive(Default)]
enum Section {
    /// In the header, or in a segment that was rejected.
    #[default]
    Outside,
    Meta(Meta),
    Data(Data),
    Covariance(Data),
}

/// A segment being read.
struct Data {
    line: usize,
    id: String,
    name: String,
    axes: Axes,
    clock: Clock,
    method: Method,
    start: Epoch,
    stop: Epoch,
    nodes: Vec<Node>,
    /// Line of INTERPOLATION_DEGREE.
    degree_line: Option<usize>,
    /// Lines, and what was assumed there.
    remarks: Vec<(usize, String)>,
}

impl Reader<'_> {
    fn line(&mut self, number: usize, line: &str) {
        if begins(line) || line == "META_START" && !self.is_unknown {
            self.close(number);
        }
        let next = match (line, std::mem::take(&mut self.section)) {
            ("META_START", _) if !self.is_unknown => Ok(Section::Meta(Meta::new(number))),
            // Another message, behind the first in one file.
            (line, _) if begins(line) => {
                let version = line.split_once('=').map(|(_, version)| version);
                let checked = version.map_or(Ok(()), |text| check_version(VERSION, text));
                self.is_unknown = checked.is_err();
                checked
                    .map(|()| Section::Outside)
                    .map_err(|reason| (number, reason))
            }
            (_, section) if self.is_unknown => Ok(section),
            ("META_STOP", Section::Meta(meta)) => {
                Data::new(&meta, &mut self.read.contents.first_start).map(Section::Data)
            }
            ("COVARIANCE_START", Section::Data(data)) => Ok(Section::Covariance(data)),
            ("COVARIANCE_STOP", Section::Covariance(data)) => Ok(Section::Data(data)),
            // The rest of a segment that was rejected is passed over: one record, one reason.
            (_, Section::Outside) if self.read.has_rejected => Ok(Section::Outside),
            (line, Section::Outside) if is_header(line) => Ok(Section::Outside),
            (_, Section::Outside) => Err((
                number,
                "a line outside of every segment; a segment starts with META_START".to_owned(),
            )),
            (_, Section::Covariance(data)) => Ok(Section::Covariance(data)),
            (_, Section::Meta(mut meta)) => meta.add(number, line).map(|()| Section::Meta(meta)),
            (_, Section::Data(mut data)) => data.line(number, line).map(|()| Section::Data(data)),
        };
        match next {
            Ok(section) => self.section = section,
            Err((line, reason)) => self.read.reject(line, &reason),
        }
    }

    /// Ends the section that is open, at line `number`.
    fn close(&mut self, number: usize) {
        match std::mem::take(&mut self.section) {
            Section::Outside => {}
            Section::Meta(_) => {
                let reason = "META_START without META_STOP; restore the metadata block";
                self.read.reject(number, reason);
            }
            Section::Data(data) | Section::Covariance(data) => self.read.add(data),
        }
    }
}

impl<'a> Segments<'a> {
    fn new(contents: &'a mut Contents) -> Self {
        Segments {
            before: contents.ephemerides.len(),
            contents,
            has_rejected: false,
            places: HashMap::new(),
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

    /// Adds a segment whose states are all read.
    fn add(&mut self, data: Data) {
        match data.finish() {
            Ok((id, name, segment)) => self.keep(id, name, segment),
            Err((line, reason)) => self.reject(line, &reason),
        }
    }

    fn keep(&mut self, id: String, name: String, segment: Segment) {
        let mut object = Object {
            identity: Identity::of_ephemeris(&id, &name),
            id: match is_placeholder(&id) {
                true => unnumbered_id(&id, &name),
                false => id,
            },
            names: Vec::from_iter(Some(name).filter(|name| !is_placeholder(name))),
            orbit: Orbit::Ephemeris(Ephemeris {
                segments: vec![segment],
            }),
        };
        let objects = &mut self.contents.ephemerides;
        let place = *(self.places.entry(Key::of_segment(&object))).or_insert(objects.len());
        if let Some(known) = objects.get_mut(place) {
            known.extend(object);
        } else {
            object.identify(None, &mut self.ids);
            objects.push(object);
        }
    }

    fn reject(&mut self, line: usize, reason: &str) {
        self.has_rejected = true;
        self.contents.reject(line, reason);
    }
}

impl Data {
    /// The segment that metadata begin.
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
            line: meta.line,
            id: meta.object("OBJECT_ID")?,
            name: meta.object("OBJECT_NAME")?,
            axes,
            clock,
            method: method(meta, &mut remarks)?,
            degree_line: meta.find("INTERPOLATION_DEGREE").map(|(_, line)| line),
            start,
            stop,
            nodes: Vec::new(),
            remarks,
        })
    }

    /// `epoch x y z vx vy vz [ax ay az]`, km and km/s.
    fn line(&mut self, number: usize, line: &str) -> At<()> {
        let bad = |what: &str| (number, format!("{what} in '{}'", shorten(line)));
        if is_header(line) {
            return Err(bad(
                "a keyword behind the states; another message starts with its CCSDS_..._VERS: add \
                 that, or split the file here",
            ));
        }
        let mut words = line.split_whitespace();
        let epoch = words.next().unwrap_or_default();
        let numbers = words.map(|word| word.parse().ok().filter(|x: &f64| x.is_finite()));
        let numbers: Option<Vec<f64>> = numbers.collect();
        let numbers = numbers.ok_or_else(|| bad("a value that is not a number"))?;
        self.state(epoch, &numbers).map_err(|what| bad(&what))
    }

    /// Adds a state, or says what is wrong with it.
    fn state(&mut self, epoch: &str, numbers: &[f64]) -> Result<(), String> {
        let epoch = self.clock.read(epoch).ok_or("no epoch")?;
        let (&[x, y, z, vx, vy, vz] | &[x, y, z, vx, vy, vz, _, _, _]) = numbers else {
            return Err("not 6 values (or 9 with accelerations)".to_owned());
        };
        let tai_ns = epoch.to_tai_duration().total_nanoseconds();
        if self.nodes.last().is_some_and(|node| node.tai_ns >= tai_ns) {
            return Err("an epoch that is not after the one before".to_owned());
        }
        let state = StateVector {
            position_m: Vector3::new(x, y, z) * 1e3,
            velocity_m_s: Vector3::new(vx, vy, vz) * 1e3,
        };
        let state = self.axes.state(epoch, state);
        let (radius_m, speed_m_s) = (state.position_m.norm(), state.velocity_m_s.norm());
        // NaN lies within nothing.
        let is_within = radius_m <= FARTHEST_M && speed_m_s <= FASTEST_M_S;
        if !is_within {
            return Err("beyond 4e6 km or 100 km/s (states are in km and km/s)".to_owned());
        }
        if radius_m < NEAREST_M {
            let reason = "nearer than 1000 km to the Earth's centre (states are in km and km/s)";
            return Err(reason.to_owned());
        }
        let node = Node { tai_ns, state };
        if let Some(last) = self.nodes.last() {
            agree(last, &node)?;
        }
        self.nodes.push(node);
        Ok(())
    }

    fn finish(mut self) -> At<(String, String, Segment)> {
        let (Some(first), Some(last)) = (self.nodes.first(), self.nodes.last()) else {
            return Err((self.line, "the segment has no states".to_owned()));
        };
        if self.nodes.len() == 1 {
            let rule = "nothing is extrapolated: give two at least";
            return Err((
                self.line,
                format!("the segment has a single state, and {rule}"),
            ));
        }
        // nothing is extrapolated: the states bound the stated interval
        let start_ns = self.start.to_tai_duration().total_nanoseconds();
        let stop_ns = self.stop.to_tai_duration().total_nanoseconds();
        let start_ns = start_ns.max(first.tai_ns);
        let stop_ns = stop_ns.min(last.tai_ns);
        if start_ns > stop_ns {
            let reason = "no state lies between the segment's start and stop time";
            return Err((self.line, reason.to_owned()));
        }
        let (Method::Lagrange(count) | Method::Hermite(count), has) =
            (self.method, self.nodes.len());
        if let Some(line) = self.degree_line.filter(|_| has < count) {
            let remark = format!(
                "INTERPOLATION_DEGREE takes {count} states, and the segment has {has}: the degree is lower"
            );
            self.remarks.push((line, remark));
        }
        let mut segment = Segment {
            line: self.line,
            nodes: self.nodes,
            method: self.method,
            start_ns,
            stop_ns,
            remarks: self.remarks,
        };
        let degree = segment.method.degree();
        let mut farthest_m = None;
        while let (Some(off_m), Some(method)) = (segment.divergence_m(), segment.method.lower()) {
            farthest_m = farthest_m.or(Some((off_m, method.degree())));
            segment.method = method;
        }
        if let Some((off_m, lower)) = farthest_m {
            let remark = format!(
                "interpolation of degree {degree} does not converge on these states (half way between two it is {:.1} km off that of degree \
                 {lower}): degree {} is taken; give states at even times, or a lower INTERPOLATION_DEGREE",
                off_m / 1e3,
                segment.method.degree()
            );
            let line = self.degree_line.unwrap_or(self.line);
            segment.remarks.push((line, remark));
        }
        Ok((self.id, self.name, segment))
    }
}

/// The interpolation that metadata ask for: without INTERPOLATION Hermite's, without a degree that of 7.
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
            // Each state gives two conditions: n of them a polynomial of degree 2 n - 1.
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
                format!("INTERPOLATION '{}'; read are {known}", shorten(name)),
            ))
        }
    }
}

/// Whether the velocities of two neighbours belong to their positions.
fn agree(a: &Node, b: &Node) -> Result<(), String> {
    let step_m = b.state.position_m - a.state.position_m;
    let seconds = (b.tai_ns - a.tai_ns) as f64 / 1e9;
    let mean_m_s = (a.state.velocity_m_s + b.state.velocity_m_s) / 2.0;
    // Either may be the wrong one: a long way round ends near where it began, too.
    let way_m = step_m.norm().max(mean_m_s.norm() * seconds);
    if way_m > SHORT_STEP * a.state.position_m.norm() || step_m.norm() < LEAST_STEP_M {
        return Ok(());
    }
    let chord_m_s = step_m / seconds;
    let off = (mean_m_s - chord_m_s).norm() / chord_m_s.norm();
    if off <= VELOCITY_TOLERANCE {
        return Ok(());
    }
    Err(format!(
        "velocities {:.0} % off what the positions move by since the state before (states are in km and km/s, velocities \
         against the axes of REF_FRAME)",
        100.0 * off
    ))
}
