//! Words that neither pages nor code use.

/// A word, and what to write instead.
const AVOIDED: &[(&str, &str)] = &[
    ("asked", "requested"),
    ("beside", "next to, or a tolerance"),
    ("crew", "render pool"),
    ("dear", "expensive"),
    ("deaf", "muted"),
    ("departed", "sent"),
    ("drowned", "below the noise"),
    ("fleet", "population"),
    ("heard", "received"),
    ("hears", "receives"),
    ("judge", "assess"),
    ("kept", "stored, held or met"),
    ("knob", "tolerance"),
    ("laid", "placed"),
    ("nobody", "no client"),
    ("obey", "handle"),
    ("octet", "byte"),
    ("octets", "bytes"),
    ("patience", "timeout"),
    ("shoot", "expose"),
    ("spill", "blooming"),
    ("spoilt", "corrupted"),
    ("told", "reported"),
    ("wanderer", "planet"),
    ("who", "which"),
    ("whoever", "any client"),
];

/// The avoided words of a text, each with the plain one.
pub fn avoided(text: &str) -> impl Iterator<Item = (&'static str, &'static str)> {
    let text = text.to_lowercase();
    let is_used = move |word: &str| text.split(|c: char| !c.is_alphabetic()).any(|w| w == word);
    let rows = AVOIDED.iter().copied();
    rows.filter(move |(word, _)| is_used(word))
}
