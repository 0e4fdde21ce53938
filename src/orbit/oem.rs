//! CCSDS Orbit Ephemeris Messages in keyword = value notation (502.0-B).

use crate::ephemeris::{Ephemeris, Node, Segment};
use crate::identity::unnumbered_id;
use crate::load::{Loaded, Rejected};
use crate::{
    Identity, Object, Orbit, Register, StateVector, bounded_name, frames, is_placeholder, lines,
    time,
};
use hifitime::{Epoch, TimeScale};
use nalgebra::{Matrix3, Vector3};

/// Degree when the message names none; the standard leaves it to the reader.
const DEFAULT_DEGREE: usize = 7;
/// Highest degree accepted: beyond it equidistant nodes only amplify rounding.
const MAX_DEGREE: usize = 25;
/// Farthest and fastest state about the Earth; metres in place of kilometres lie beyond.
const FARTHEST_M: f64 = 4e9;
const FASTEST_M_S: f64 = 1e5;

/// Whether a text whose first line is this one is an OEM.
pub(crate) fn begins(line: &str) -> bool {
    line.starts_with("CCSDS_OEM_VERS")
}

/// Reads every segment; segments of one OBJECT_ID become one object.
///
/// Covariance sections, comments and accelerations are passed over. A segment
/// with a line that cannot be read is rejected whole, and the rest loads.
pub(crate) fn parse(text: &str, source: &str) -> Loaded {
    let mut reader = Reader {
        source,
        loaded: Loaded::default(),
        register: Register::default(),
        section: Section::Outside,
    };
    let mut last = 0;
    for (number, line) in lines::numbered(text) {
        last = number;
        let line = line.trim_start();
        if !line.is_empty() && line.split_whitespace().next() != Some("COMMENT") {
            reader.line(last, line);
        }
    }
    reader.close(last);
    reader.loaded
}

/// Whether a line is `KEYWORD = value`, as the header's are.
fn is_header(line: &str) -> bool {
    line.split_once('=').is_some_and(|(keyword, _)| {
        keyword
            .trim()
            .bytes()
            .all(|b| b.is_ascii_uppercase() || b == b'_')
    })
}

struct Reader<'a> {
    source: &'a str,
    loaded: Loaded,
    register: Register,
    section: Section,
}

/// Where in the message the reader is.
enum Section {
    /// In the header, or in a segment that was rejected.
    Outside,
    Meta(Meta),
    Data(Data),
    Covariance(Data),
}

/// A META block: the line it starts in, and its keywords with their lines.
struct Meta {
    line: usize,
    pairs: Vec<(String, String, usize)>,
}

/// A segment being read.
struct Data {
    line: usize,
    id: String,
    name: String,
    axes: Axes,
    scale: TimeScale,
    degree: usize,
    start: Epoch,
    stop: Epoch,
    nodes: Vec<Node>,
}

/// Axes of the states; the origin is always the Earth's centre.
enum Axes {
    /// GCRF or ICRF.
    Gcrf,
    /// Constant rotation to GCRF.
    Fixed(Matrix3<f64>),
    Teme,
}

/// A reason with the line it stands in.
type At<T> = Result<T, (usize, String)>;

impl Reader<'_> {
    fn line(&mut self, number: usize, line: &str) {
        let section = std::mem::replace(&mut self.section, Section::Outside);
        let next = match (line, section) {
            ("META_START", section) => {
                self.section = section;
                self.close(number);
                Ok(Section::Meta(Meta {
                    line: number,
                    pairs: Vec::new(),
                }))
            }
            // Another message, behind the first in one file.
            (line, section) if begins(line) => {
                self.section = section;
                self.close(number);
                Ok(Section::Outside)
            }
            ("META_STOP", Section::Meta(meta)) => meta.finish().map(Section::Data),
            ("COVARIANCE_START", Section::Data(data)) => Ok(Section::Covariance(data)),
            ("COVARIANCE_STOP", Section::Covariance(data)) => Ok(Section::Data(data)),
            // The rest of a segment that was rejected is passed over: one record, one reason.
            (_, Section::Outside) if !self.loaded.rejected.is_empty() => Ok(Section::Outside),
            (line, Section::Outside) if is_header(line) => Ok(Section::Outside),
            (_, Section::Outside) => Err((
                number,
                "a line outside of every segment; a segment starts with META_START".to_owned(),
            )),
            (_, Section::Covariance(data)) => Ok(Section::Covariance(data)),
            (_, Section::Meta(mut meta)) => meta.pair(number, line).map(|()| Section::Meta(meta)),
            (_, Section::Data(mut data)) => data.state(number, line).map(|()| Section::Data(data)),
        };
        match next {
            Ok(section) => self.section = section,
            Err((line, reason)) => self.reject(line, reason),
        }
    }

    /// Ends the section that is open, at line `number`.
    fn close(&mut self, number: usize) {
        match std::mem::replace(&mut self.section, Section::Outside) {
            Section::Outside => {}
            Section::Meta(_) => {
                let reason = "META_START without META_STOP; restore the metadata block";
                self.reject(number, reason.to_owned());
            }
            Section::Data(data) | Section::Covariance(data) => match data.finish() {
                Ok((id, name, segment)) => self.keep(id, name, segment),
                Err((line, reason)) => self.reject(line, reason),
            },
        }
    }

    fn keep(&mut self, id: String, name: String, segment: Segment) {
        let mut object = Object {
            identity: Identity::of_ephemeris(&id, &name),
            id: if is_placeholder(&id) {
                unnumbered_id(&id, &name)
            } else {
                id
            },
            names: Some(name)
                .filter(|name| !is_placeholder(name))
                .into_iter()
                .collect(),
            orbit: Orbit::Ephemeris(Ephemeris {
                segments: vec![segment],
            }),
        };
        let objects = &mut self.loaded.objects;
        let place = self.register.place(&object);
        if let Some(known) = place.and_then(|place| objects.get_mut(place)) {
            known.extend(object);
        } else {
            self.register.insert(&mut object, objects.len());
            objects.push(object);
        }
    }

    fn reject(&mut self, line: usize, reason: String) {
        let rejected = Rejected::new(self.source, line, &reason);
        self.loaded.rejected.push(rejected);
    }
}

impl Meta {
    fn pair(&mut self, number: usize, line: &str) -> At<()> {
        let (key, value) = line
            .split_once('=')
            .ok_or_else(|| (number, format!("'{}' is not KEY = VALUE", shorten(line))))?;
        let pair = (key.trim().to_owned(), value.trim().to_owned(), number);
        self.pairs.push(pair);
        Ok(())
    }

    fn find(&self, key: &str) -> Option<(&str, usize)> {
        self.pairs
            .iter()
            .find(|(k, _, _)| k == key)
            .map(|(_, value, line)| (value.as_str(), *line))
    }

    fn need(&self, key: &str) -> At<(&str, usize)> {
        let found = self.find(key).filter(|(value, _)| !value.is_empty());
        found.ok_or_else(|| (self.line, format!("the metadata have no {key}")))
    }

    /// Keywords of the object may be empty: whose the states are is then unknown.
    fn object(&self, key: &str) -> At<String> {
        let missing = || (self.line, format!("the metadata have no {key}"));
        let (text, _) = self.find(key).ok_or_else(missing)?;
        Ok(match bounded_name(text) {
            none if none.is_empty() => "UNKNOWN".to_owned(),
            text => text,
        })
    }

    fn finish(self) -> At<Data> {
        let (center, line) = self.need("CENTER_NAME")?;
        if !center.eq_ignore_ascii_case("EARTH") {
            return Err((line, format!("CENTER_NAME '{center}'; only EARTH is read")));
        }
        let scale = self.scale()?;
        let epoch = |key: &str| -> At<Option<Epoch>> {
            self.find(key)
                .map(|(text, line)| {
                    time::parse_ccsds(text, scale).ok_or_else(|| {
                        let why = time::why_not(text);
                        (
                            line,
                            format!("{key} '{}' is not a time{why}", shorten(text)),
                        )
                    })
                })
                .transpose()
        };
        let (_, _) = (self.need("START_TIME")?, self.need("STOP_TIME")?);
        let start = epoch("START_TIME")?;
        let stop = epoch("STOP_TIME")?;
        let missing = || (self.line, "the metadata have no interval".to_owned());
        let start = epoch("USEABLE_START_TIME")?.or(start).ok_or_else(missing)?;
        let stop = epoch("USEABLE_STOP_TIME")?.or(stop).ok_or_else(missing)?;
        Ok(Data {
            line: self.line,
            id: self.object("OBJECT_ID")?,
            name: self.object("OBJECT_NAME")?,
            axes: self.axes()?,
            scale,
            degree: self.degree()?,
            start,
            stop,
            nodes: Vec::new(),
        })
    }

    fn axes(&self) -> At<Axes> {
        let (name, line) = self.need("REF_FRAME")?;
        match name.to_ascii_uppercase().as_str() {
            "GCRF" | "ICRF" => Ok(Axes::Gcrf),
            "EME2000" => Ok(Axes::Fixed(frames::eme2000_to_gcrf())),
            "TEME" => Ok(Axes::Teme),
            _ => Err((
                line,
                format!("REF_FRAME '{name}'; read are GCRF, ICRF, EME2000 and TEME"),
            )),
        }
    }

    fn scale(&self) -> At<TimeScale> {
        let (name, line) = self.need("TIME_SYSTEM")?;
        match name.to_ascii_uppercase().as_str() {
            "UTC" => Ok(TimeScale::UTC),
            "TAI" => Ok(TimeScale::TAI),
            "TT" => Ok(TimeScale::TT),
            "GPS" => Ok(TimeScale::GPST),
            "TDB" => Ok(TimeScale::TDB),
            _ => Err((
                line,
                format!("TIME_SYSTEM '{name}'; read are UTC, TAI, TT, GPS and TDB"),
            )),
        }
    }

    /// All methods are carried out as Lagrange's of the stated degree.
    fn degree(&self) -> At<usize> {
        let method = self.find("INTERPOLATION");
        let by_default = match method.map(|(name, line)| (name.to_ascii_uppercase(), line)) {
            None => DEFAULT_DEGREE,
            Some((name, _)) if name == "LINEAR" => 1,
            Some((name, _)) if matches!(name.as_str(), "LAGRANGE" | "HERMITE") => DEFAULT_DEGREE,
            Some((name, line)) => {
                let reason =
                    format!("INTERPOLATION '{name}'; read are LAGRANGE, HERMITE and LINEAR");
                return Err((line, reason));
            }
        };
        let Some((text, line)) = self.find("INTERPOLATION_DEGREE") else {
            return Ok(by_default);
        };
        let degree = text.parse().ok();
        degree
            .filter(|degree| (1..=MAX_DEGREE).contains(degree))
            .ok_or_else(|| {
                let reason = format!("INTERPOLATION_DEGREE '{text}' is not 1 to {MAX_DEGREE}");
                (line, reason)
            })
    }
}

impl Data {
    /// `epoch x y z vx vy vz [ax ay az]`, km and km/s.
    fn state(&mut self, number: usize, line: &str) -> At<()> {
        let bad = |what: &str| (number, format!("{what} in '{}'", shorten(line)));
        let mut words = line.split_whitespace();
        let epoch = words
            .next()
            .and_then(|text| time::parse_ccsds(text, self.scale))
            .ok_or_else(|| bad("no epoch"))?;
        let numbers: Vec<f64> = words
            .map(|word| word.parse().ok().filter(|x: &f64| x.is_finite()))
            .collect::<Option<_>>()
            .ok_or_else(|| bad("a value that is not a number"))?;
        let (&[x, y, z, vx, vy, vz] | &[x, y, z, vx, vy, vz, _, _, _]) = numbers.as_slice() else {
            return Err(bad("not 6 values (or 9 with accelerations)"));
        };

        let tai_ns = epoch.to_tai_duration().total_nanoseconds();
        if self.nodes.last().is_some_and(|node| node.tai_ns >= tai_ns) {
            return Err(bad("an epoch that is not after the one before"));
        }
        let state = StateVector {
            position_m: Vector3::new(x, y, z) * 1e3,
            velocity_m_s: Vector3::new(vx, vy, vz) * 1e3,
        };
        let state = match &self.axes {
            Axes::Gcrf => state,
            Axes::Fixed(rotation) => state.rotated(rotation),
            Axes::Teme => state.rotated(&frames::teme_to_gcrf(epoch)),
        };
        // NaN lies within nothing.
        let within =
            state.position_m.norm() <= FARTHEST_M && state.velocity_m_s.norm() <= FASTEST_M_S;
        if !within {
            return Err(bad("beyond 4e6 km or 100 km/s (states are in km and km/s)"));
        }
        self.nodes.push(Node { tai_ns, state });
        Ok(())
    }

    fn finish(self) -> At<(String, String, Segment)> {
        let (Some(first), Some(last)) = (self.nodes.first(), self.nodes.last()) else {
            return Err((self.line, "the segment has no states".to_owned()));
        };
        // nothing is extrapolated: the states bound the stated interval
        let start_ns = self.start.to_tai_duration().total_nanoseconds();
        let stop_ns = self.stop.to_tai_duration().total_nanoseconds();
        let start_ns = start_ns.max(first.tai_ns);
        let stop_ns = stop_ns.min(last.tai_ns);
        if start_ns > stop_ns {
            let reason = "no state lies between the segment's start and stop time";
            return Err((self.line, reason.to_owned()));
        }
        let segment = Segment {
            nodes: self.nodes,
            degree: self.degree,
            start_ns,
            stop_ns,
        };
        Ok((self.id, self.name, segment))
    }
}

fn shorten(text: &str) -> String {
    text.chars().take(60).collect()
}
