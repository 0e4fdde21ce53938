//! Formats of orbits and attitudes that are known by name and not read, with what to do about each.

use crate::lines;
use crate::omm::xml::{Tag, tags};

/// A format that is not read.
#[derive(Clone, Copy)]
struct Known {
    what: &'static str,
    remedy: &'static str,
    has_orbits: bool,
}

const fn orbits(what: &'static str, remedy: &'static str) -> Known {
    let has_orbits = true;
    Known {
        what,
        remedy,
        has_orbits,
    }
}

const fn attitudes(what: &'static str, remedy: &'static str) -> Known {
    let has_orbits = false;
    Known {
        what,
        remedy,
        has_orbits,
    }
}

const TO_OEM: &str = "export it as a CCSDS OEM in GCRF and UTC";
const TO_AEM: &str = "export it as a CCSDS AEM of type QUATERNION in keyword = value notation";
const OPM: Known = orbits("a CCSDS OPM, a single state", TO_OEM);
const OCM: Known = orbits("a CCSDS OCM", TO_OEM);
const CDM: Known = orbits("a CCSDS conjunction message", TO_OEM);
const APM: Known = attitudes("a CCSDS APM, a single attitude", TO_AEM);
const ACM: Known = attitudes("a CCSDS ACM", TO_AEM);
const AEM: Known = attitudes(
    "a CCSDS AEM, which holds attitudes",
    "give it as [sequence] attitude_file or to skyloop-fc --attitudes",
);
const AEM_XML: Known = attitudes("a CCSDS AEM in XML", "write it in keyword = value notation");
const SP3: Known = orbits(
    "an SP3 orbit file",
    "export it as a CCSDS OEM with REF_FRAME = ITRF and its time system",
);
const STARLINK: Known = orbits(
    "Starlink's ephemeris text",
    "write its states (km, km/s, mean equator and equinox of J2000) as a CCSDS OEM with REF_FRAME = EME2000 and TIME_SYSTEM = UTC",
);
const STK_ORBIT: Known = orbits("an STK ephemeris (.e)", TO_OEM);
const STK_ATTITUDE: Known = attitudes("an STK attitude file (.a)", TO_AEM);
const STK: Known = orbits("an STK file", TO_OEM);

/// First words of files.
const BEGINNINGS: [(&str, Known); 7] = [
    ("created:", STARLINK),
    ("CCSDS_OPM_VERS", OPM),
    ("CCSDS_OCM_VERS", OCM),
    ("CCSDS_CDM_VERS", CDM),
    ("CCSDS_AEM_VERS", AEM),
    ("CCSDS_APM_VERS", APM),
    ("CCSDS_ACM_VERS", ACM),
];

/// Tags of messages in XML.
const MESSAGES: [(&str, Known); 6] = [
    ("opm", OPM),
    ("ocm", OCM),
    ("cdm", CDM),
    ("aem", AEM_XML),
    ("apm", APM),
    ("acm", ACM),
];

/// What a text is that is in none of the formats that are read, and the remedy; nothing where it is unknown.
pub fn found(text: &str) -> Option<String> {
    let Known { what, remedy, .. } = known(text)?;
    Some(format!("{what}, which is not read: {remedy}"))
}

/// Whether such a text holds orbits.
pub(crate) fn has_orbits(text: &str) -> bool {
    known(text).is_some_and(|known| known.has_orbits)
}

fn known(text: &str) -> Option<Known> {
    let mut all = lines::numbered(text).map(|(_, line)| line.trim());
    // Of SP3 the first line begins with what others begin a remark with.
    let top = all.clone().find(|line| !line.is_empty())?;
    if let [b'#', b'a'..=b'd', b'P' | b'V', b'0'..=b'9', ..] = top.as_bytes() {
        return Some(SP3);
    }
    let first = all.find(|line| !lines::is_remark(line))?;
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
