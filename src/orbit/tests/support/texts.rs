//! Tables of test cases, and texts of messages.

#![allow(dead_code)] // the unit tests of the crate use a part

/// The rows of a table: cells between bars; `\n` in a cell is a line break.
/// Blank lines and lines that begin with `//` are skipped.
pub fn rows<const N: usize>(table: &str) -> Vec<[String; N]> {
    let lines = table.lines().map(str::trim);
    let lines = lines.filter(|line| !line.is_empty() && !line.starts_with("//"));
    let row = |line: &str| {
        let cells = line.split('|').map(|cell| cell.trim().replace("\\n", "\n"));
        let cells: Vec<String> = cells.collect();
        cells
            .try_into()
            .unwrap_or_else(|_| panic!("cells of {line}"))
    };
    lines.map(row).collect()
}

/// A line of an element set with its checksum: the sum of the digits, a minus as one, modulo 10.
pub fn sealed(line: &str) -> String {
    let digit = |c: char| c.to_digit(10).unwrap_or((c == '-').into());
    format!("{line:<68}{}", line.chars().map(digit).sum::<u32>() % 10)
}

/// X-Val: Vallado et al. 2006, AIAA 2006-6753, verification set 00005.
pub const SET: &str = "\
1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753
2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667
";

/// An OEM with one segment. `meta` has keywords, a line each, that add to the defaults or replace
/// them.
pub fn oem(meta: &str, states: &[impl AsRef<str>]) -> String {
    let defaults = "OBJECT_NAME = MADE UP\nOBJECT_ID = 2019-001A\nCENTER_NAME = EARTH\n\
                    REF_FRAME = GCRF\nTIME_SYSTEM = UTC\nSTART_TIME = 2019-06-15T00:00:00\n\
                    STOP_TIME = 2019-06-15T00:00:30\n";
    let is_free = |line: &&str| {
        let key = line.split(" =").next().unwrap_or_default();
        !meta.lines().any(|line| line.starts_with(key))
    };
    let rest = defaults.split_inclusive('\n').filter(is_free);
    let states: String = states
        .iter()
        .map(|state| state.as_ref().to_owned() + "\n")
        .collect();
    let rest: String = rest.collect();
    format!("CCSDS_OEM_VERS = 2.0\nMETA_START\n{meta}{rest}META_STOP\n{states}")
}

/// A made-up object as an OMM in keyword = value notation, without its version.
pub const OMM: &str = "\
OBJECT_NAME = MADE UP
OBJECT_ID = 2026-101A
CENTER_NAME = EARTH
REF_FRAME = TEME
TIME_SYSTEM = UTC
MEAN_ELEMENT_THEORY = SGP4
EPOCH = 2026-07-12T03:04:05
MEAN_MOTION = 15.2 [rev/day]
ECCENTRICITY = 0.001
INCLINATION = 97.5 [deg]
RA_OF_ASC_NODE = 120 [deg]
ARG_OF_PERICENTER = 90 [deg]
MEAN_ANOMALY = 270 [deg]
NORAD_CAT_ID = 100001
BSTAR = 0.0001 [1/ER]
MEAN_MOTION_DOT = 1e-5 [rev/day**2]
MEAN_MOTION_DDOT = 0 [rev/day**3]
";

/// Keywords, values and units of a message in keyword = value notation.
fn fields(kvn: &str) -> impl Iterator<Item = (&str, &str, Option<&str>)> {
    let pairs = kvn.lines().filter_map(|line| line.split_once(" = "));
    pairs.map(
        |(key, value)| match value.trim_end_matches(']').split_once(" [") {
            Some((number, unit)) => (key, number, Some(unit)),
            None => (key, value, None),
        },
    )
}

/// The elements of such a message in XML, with units as attributes.
pub fn xml_elements(kvn: &str) -> String {
    let element = |(key, value, unit): (&str, &str, Option<&str>)| {
        let unit = unit.map_or(String::new(), |unit| format!(" units=\"{unit}\""));
        format!("<{key}{unit}>{value}</{key}>")
    };
    fields(kvn).map(element).collect()
}

/// Such an OMM in XML.
pub fn omm_xml(kvn: &str) -> String {
    format!("<omm>{}</omm>", xml_elements(kvn))
}

/// Such an OMM as a JSON object.
pub fn omm_json(kvn: &str) -> String {
    let pairs = fields(kvn).map(|(key, value, _)| format!("\"{key}\":\"{value}\""));
    format!("{{{}}}", pairs.collect::<Vec<_>>().join(","))
}

/// A state vector of an OEM in XML, second `second` of the default segment, along x at 1 km/s.
pub fn xml_state(second: u32, x_km: f64) -> String {
    format!(
        "<stateVector><EPOCH>2019-06-15T00:00:{second:02}</EPOCH><X units=\"km\">{x_km}</X>\
         <Y>0</Y><Z>0</Z>\n<X_DOT units=\"km/s\">1</X_DOT><Y_DOT>0</Y_DOT><Z_DOT>0</Z_DOT>\
         </stateVector>\n"
    )
}
