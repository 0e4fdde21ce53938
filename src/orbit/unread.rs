//! Unsupported formats of orbits and attitudes that are recognised, each with a remedy.

use crate::format::Format;
use crate::lines;
use crate::lines::Part;
use crate::xml::{Tag, tags};
use memchr::memmem;
use std::collections::BTreeMap;

/// An unsupported format.
#[derive(Clone, Copy)]
struct Known {
    what: &'static str,
    remedy: &'static str,
    has_orbits: bool,
}

const fn orbits(what: &'static str, remedy: &'static str) -> Known {
    Known {
        what,
        remedy,
        has_orbits: true,
    }
}

const fn others(what: &'static str, remedy: &'static str) -> Known {
    Known {
        what,
        remedy,
        has_orbits: false,
    }
}

const TO_OEM: &str = "export it as a CCSDS OEM in GCRF and UTC";
const TO_AEM: &str = "export it as a CCSDS AEM of type QUATERNION in keyword = value notation";
const OPM: Known = orbits("a CCSDS OPM, a single state", TO_OEM);
const OCM: Known = orbits("a CCSDS OCM", TO_OEM);
const CDM: Known = orbits("a CCSDS conjunction message", TO_OEM);
const APM: Known = others("a CCSDS APM, a single attitude", TO_AEM);
const ACM: Known = others("a CCSDS ACM", TO_AEM);
const AEM: Known = others(
    "a CCSDS AEM, which holds attitudes",
    "give it as [sequence] attitude_file or to skyloop-fc --attitudes",
);
const AEM_XML: Known = others("a CCSDS AEM in XML", "write it in keyword = value notation");
const SP3: Known = orbits(
    "an SP3 orbit file",
    "export it as a CCSDS OEM with REF_FRAME = ITRF and its time system",
);
const STARLINK: Known = orbits(
    "Starlink's ephemeris text",
    "write its states (km, km/s, mean equator and equinox of J2000) as a CCSDS OEM with REF_FRAME = EME2000 and TIME_SYSTEM = UTC",
);
const STK_ORBIT: Known = orbits("an STK ephemeris (.e)", TO_OEM);
const STK_ATTITUDE: Known = others("an STK attitude file (.a)", TO_AEM);
const STK: Known = orbits("an STK file", TO_OEM);

const TDM: Known = others("a CCSDS TDM, tracking data without an orbit", TO_OEM);
const RDM: Known = others("a CCSDS RDM, a reentry message", TO_OEM);
const HORIZONS: Known = orbits(
    "an answer of JPL Horizons",
    "write its vectors (km, km/s, ICRF axes, from the Earth's centre) as a CCSDS OEM with REF_FRAME = ICRF and TIME_SYSTEM = TDB",
);
const RINEX: Known = orbits(
    "a RINEX file",
    "export its orbits as a CCSDS OEM with REF_FRAME = ITRF and TIME_SYSTEM = GPS",
);
const HTTP: Known = orbits(
    "a server's answer with its HTTP header",
    "remove the lines up to the first blank one, or fetch the file again without the header (curl without -i)",
);

/// Bytes in which the first table of a Horizons file is searched for.
const HEADER: usize = 1 << 16;

/// First words of files.
const BEGINNINGS: [(&str, Known); 9] = [
    ("CCSDS_TDM_VERS", TDM),
    ("CCSDS_RDM_VERS", RDM),
    ("created:", STARLINK),
    ("CCSDS_OPM_VERS", OPM),
    ("CCSDS_OCM_VERS", OCM),
    ("CCSDS_CDM_VERS", CDM),
    ("CCSDS_AEM_VERS", AEM),
    ("CCSDS_APM_VERS", APM),
    ("CCSDS_ACM_VERS", ACM),
];

/// Tags of messages in XML.
const MESSAGES: [(&str, Known); 8] = [
    ("tdm", TDM),
    ("rdm", RDM),
    ("opm", OPM),
    ("ocm", OCM),
    ("cdm", CDM),
    ("aem", AEM_XML),
    ("apm", APM),
    ("acm", ACM),
];

/// The kind of a text in an unsupported format, and the remedy; none where it is unknown.
pub fn found(text: &str) -> Option<String> {
    known(text).map(Known::text)
}

/// The kind of a text that is not attitudes, and the remedy: unsupported, or orbits.
pub fn not_attitudes(text: &str) -> Option<String> {
    let orbits = || {
        let what = match Format::of(text)? {
            Format::Tle | Format::ThreeLine => "two-line element sets",
            Format::OmmKvn | Format::OmmXml | Format::OmmJson | Format::OmmCsv => "a CCSDS OMM",
            Format::OemKvn | Format::OemXml => "a CCSDS OEM",
        };
        Some(format!(
            "{what}, which holds orbits: give it under [objects] files, and attitudes as a CCSDS AEM or lines of UTC x y z w"
        ))
    };
    found(text).or_else(orbits)
}

impl Known {
    fn text(self) -> String {
        let Known { what, remedy, .. } = self;
        format!("{what}, which is not read: {remedy}")
    }
}

/// Unsupported messages: for each kind the count and the first line.
pub(crate) type Unread = BTreeMap<String, (usize, usize)>;

/// Adds the unsupported messages of an XML text.
pub(crate) fn add_messages(part: &Part, all: &mut Unread) {
    let mut finder = part.finder();
    for tag in tags(part.text, 0).filter(|tag| tag.name.len() == 3 && !tag.closing) {
        if let Some((_, known)) = MESSAGES.iter().find(|(name, _)| tag.opens(name)) {
            let first = (0, finder.line(tag.start));
            all.entry(known.text()).or_insert(first).0 += 1;
        }
    }
}

/// The kind of a text by its header, even if later lines look like a supported format.
pub(crate) fn by_header(text: &str) -> Option<String> {
    header(text).map(Known::text)
}

fn header(text: &str) -> Option<Known> {
    let start = text.trim_start();
    let first = lines::numbered(start).next().map_or("", |(_, line)| line);
    let is_http = first
        .strip_prefix("HTTP/")
        .is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
    let is_table = || {
        let head = start.as_bytes().get(..HEADER).unwrap_or(start.as_bytes());
        memmem::find(head, b"$$SOE").is_some()
    };
    if is_http {
        Some(HTTP)
    } else if first.ends_with("RINEX VERSION / TYPE") {
        Some(RINEX)
    } else {
        is_table().then_some(HORIZONS)
    }
}

/// Whether a text in an unsupported format holds orbits.
pub(crate) fn has_orbits(text: &str) -> bool {
    known(text).is_some_and(|known| known.has_orbits)
}

fn known(text: &str) -> Option<Known> {
    if let Some(known) = header(text) {
        return Some(known);
    }
    let mut all = lines::numbered(text).map(|(_, line)| line.trim());
    // The first line of an SP3 begins with the comment mark of other formats.
    let top = all.clone().find(|line| !line.is_empty())?;
    if let [b'#', b'a'..=b'd', b'P' | b'V', b'0'..=b'9', ..] = top.as_bytes() {
        return Some(SP3);
    }
    let first = all.find(|line| !lines::is_comment(line))?;
    if let Some((_, known)) = BEGINNINGS
        .iter()
        .find(|(begins, _)| first.starts_with(begins))
    {
        return Some(*known);
    }
    if first.starts_with("stk.v.") {
        let has = |block: &str| {
            let mut lines = lines::numbered(text).map(|(_, line)| line.to_ascii_lowercase());
            lines.any(|line| line.split_whitespace().eq(["begin", block]))
        };
        return Some(match (has("ephemeris"), has("attitude")) {
            (true, _) => STK_ORBIT,
            (_, true) => STK_ATTITUDE,
            _ => STK,
        });
    }
    if first.starts_with('<') {
        let message = |tag: Tag| MESSAGES.iter().find(|(name, _)| tag.opens(name));
        return tags(text, 0).find_map(message).map(|(_, known)| *known);
    }
    None
}
