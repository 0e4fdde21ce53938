//! The schedule of faults, a TOML file.

use super::rule::{Rule, SEED};
use schemars::JsonSchema;
use serde::Deserialize;
use skyloop_base::load::{Allowed, Check, ConfigError, Folder, Limit, one_of, read, tables};
use skyloop_protocols::{Direction, Fault, FaultKind};
use std::ops::RangeInclusive;
use std::path::Path;
use std::time::Duration;

/// Faults with their times.
#[derive(Debug, Clone, Default)]
pub struct Plan {
    pub(super) rules: Vec<Rule>,
}

/// The name of a kind.
pub fn name(kind: FaultKind) -> &'static str {
    FaultKind::NAMES
        .iter()
        .find(|(_, known)| *known == kind)
        .map_or("", |(name, _)| name)
}

/// Why a fault cannot be injected into a link of whole packets; `None` if it can.
pub fn impossible(kind: FaultKind) -> Option<&'static str> {
    (kind == FaultKind::BusOff).then_some("only a CAN bus goes off: on other links use down")
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Raw {
    #[serde(default = "default_seed")]
    seed: u64,
    #[serde(default, deserialize_with = "tables")]
    faults: Vec<RawFault>,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RawFault {
    #[serde(default)]
    at_s: f64,
    for_s: Option<f64>,
    direction: String,
    kind: String,
    value: Option<f64>,
    seed: Option<u64>,
}

/// A valid schedule with all keys that have no default.
const EXAMPLE: &str = r#"faults = [{ direction = "in", kind = "drop", value = 1.0 }]"#;

fn default_seed() -> u64 {
    SEED
}

/// Range of start times, s.
const TIMES_S: RangeInclusive<f64> = 0.0..=1e6;

/// Range of durations, s: a fault of 0 s would do nothing.
const LENGTHS_S: RangeInclusive<f64> = f64::MIN_POSITIVE..=1e6;

/// Limits of the keys; the upper limit of `value` depends on `kind`.
const LIMITS: &[Limit] = &[
    ("faults[].at_s", Allowed::Number(TIMES_S)),
    ("faults[].for_s", Allowed::Number(LENGTHS_S)),
    ("faults[].direction", Allowed::Word(directions)),
    ("faults[].kind", Allowed::Word(kinds)),
];

fn directions() -> Vec<&'static str> {
    vec!["in", "out"]
}

fn kinds() -> Vec<&'static str> {
    FaultKind::NAMES.iter().map(|(name, _)| *name).collect()
}

impl Plan {
    /// Reads the schedule for a CAN bus (`can`) or a link of whole packets.
    pub fn load(file: &Path, can: bool) -> Result<Plan, ConfigError> {
        let (name, text) = Folder::current().read(&file.to_string_lossy())?;
        Plan::parse(&name, &text, can)
    }

    /// Reads the text of a schedule called `file`.
    pub fn parse(file: &str, text: &str, can: bool) -> Result<Plan, ConfigError> {
        read(file, text, EXAMPLE, &[LIMITS], |raw: Raw, check| {
            let rules = raw.faults.iter().enumerate();
            let rules = rules.map(|(index, fault)| rule(check, index, fault, raw.seed, can));
            Ok(Plan {
                rules: rules.collect::<Result<_, _>>()?,
            })
        })
    }

    /// Whether it has no faults.
    pub fn is_empty(&self) -> bool {
        self.rules.is_empty()
    }
}

/// Checks fault `index` of a file.
fn rule(
    check: &Check<'_>,
    index: usize,
    raw: &RawFault,
    seed: u64,
    can: bool,
) -> Result<Rule, ConfigError> {
    let key = |name: &str| format!("faults[{index}].{name}");
    let direction = match raw.direction.as_str() {
        "in" => Direction::In,
        "out" => Direction::Out,
        other => {
            return Err(check.refuse(
                &key("direction"),
                format!("{other:?}"),
                "\"in\" (towards the emulator) or \"out\"",
            ));
        }
    };
    let Some((_, kind)) = FaultKind::NAMES.iter().find(|(name, _)| *name == raw.kind) else {
        return Err(check.refuse(&key("kind"), format!("{:?}", raw.kind), one_of(&kinds())));
    };
    if let Some(why) = impossible(*kind).filter(|_| !can) {
        return Err(check.explain(&key("kind"), format!("{:?}: {why}", raw.kind)));
    }
    let at_s = check.limit(LIMITS, &key("at_s"), raw.at_s)?;
    if raw.for_s == Some(0.0) {
        let why = "0 s: the fault would do nothing; leave for_s out for a fault without an end";
        return Err(check.explain(&key("for_s"), why));
    }
    let for_s = match raw.for_s {
        Some(for_s) => Some(check.limit(LIMITS, &key("for_s"), for_s)?),
        None => None,
    };
    let value = value(check, key, raw, *kind)?;
    let from = Duration::from_secs_f64(at_s);
    Ok(Rule::new(
        Fault {
            kind: *kind,
            direction,
            value,
            seconds: for_s.unwrap_or(0.0),
        },
        raw.seed.unwrap_or(seed),
        index as u32,
        from,
        for_s.map(|for_s| from + Duration::from_secs_f64(for_s)),
    ))
}

/// A probability, or seconds of delay and jitter; 1 for a fault that is on or off.
fn value(
    check: &Check<'_>,
    key: impl Fn(&str) -> String,
    raw: &RawFault,
    kind: FaultKind,
) -> Result<f64, ConfigError> {
    let needs_kind = |error: ConfigError| error.needs(&[&key("kind")]);
    let key = key("value");
    let value = match raw.value {
        Some(value) => value,
        None if kind.is_switch() => 1.0,
        None => {
            let why = "missing: a probability, or seconds of delay and jitter";
            return Err(needs_kind(check.explain(&key, why)));
        }
    };
    if value == 0.0 {
        let why = "0: the fault would do nothing; an earlier one ends by its for_s";
        return Err(check.explain(&key, why));
    }
    if kind.is_switch() && value != 1.0 {
        let allowed = format!("1, as {} is on or off", raw.kind);
        return Err(needs_kind(check.refuse(&key, value, allowed)));
    }
    let max = match kind {
        FaultKind::Delay | FaultKind::Jitter => 60.0,
        _ => 1.0,
    };
    let inside = check.range(&key, value, f64::MIN_POSITIVE..=max);
    inside.map_err(needs_kind)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Plan, String> {
        Plan::parse("faults.toml", text, false).map_err(|error| error.to_string())
    }

    #[test]
    fn a_schedule_is_read() {
        let plan = parse(
            "seed = 9\n[[faults]]\nat_s = 1.5\nfor_s = 2.0\ndirection = \"in\"\nkind = \"drop\"\nvalue = 0.05\n\
             [[faults]]\ndirection = \"out\"\nkind = \"down\"\nseed = 3\n",
        )
        .unwrap();
        let (drop, down) = (&plan.rules[0], &plan.rules[1]);
        assert_eq!((drop.fault.kind, drop.fault.value), (FaultKind::Drop, 0.05));
        assert_eq!(drop.from, Duration::from_millis(1500));
        assert_eq!(drop.until, Some(Duration::from_millis(3500)));
        assert_eq!((drop.seed, down.seed), (9, 3));
        assert_eq!(
            (down.fault.direction, down.fault.value),
            (Direction::Out, 1.0)
        );
        assert_eq!((down.from, down.until), (Duration::ZERO, None));
        assert!(parse("").unwrap().is_empty());
    }

    #[test]
    fn invalid_schedules_are_refused_by_key() {
        let of = |kind, keys| format!("[[faults]]\ndirection = \"in\"\nkind = \"{kind}\"\n{keys}");
        let up = of("drop", "value = 0.5").replace("\"in\"", "\"up\"");
        let types = of("drop", "value = \"a\"\nat_s = \"b\"\nfor_s = true");
        let types = types.replace("\"in\"", "7") + "\n[[faults]]\n";
        let list = "faults = [7, { direction = \"in\", kind = 3, value = 1 }, [1], \
                    { direction = \"up\", kind = \"drop\", at_s = -1 }]";
        let cases: [(String, &[&str]); 15] = [
            (
                of("drop", "value = 1.5"),
                &["faults[0].value = 1.5", "above 0, at most 1"],
            ),
            (of("drop", ""), &["faults[0].value", "missing"]),
            (
                of("drop", "value = 0.5\nat_s = -1.0"),
                &["faults[0].at_s = -1"],
            ),
            (of("drop", "value = nan"), &["faults[0].value = NaN"]),
            (of("drop", "value = 0.5\nlength = 1"), &["length", "for_s"]),
            (up, &["faults[0].direction = \"up\"", "\"out\""]),
            (
                of("lose", "value = 0.5"),
                &["faults[0].kind = \"lose\"", "bit_flips"],
            ),
            (
                of("bus_off", "value = 1"),
                &["faults[0].kind", "bus_off", "CAN", "use down"],
            ),
            (
                of("stuck", "value = 0.5"),
                &["faults[0].value = 0.5", "must be 1, as stuck"],
            ),
            (
                of("drop", "value = 0"),
                &["faults[0].value", "do nothing", "for_s"],
            ),
            (
                of("stuck", "value = -0.0"),
                &["faults[0].value", "do nothing", "for_s"],
            ),
            (
                of("drop", "value = 0.5\nfor_s = 0"),
                &["faults[0].for_s", "do nothing", "leave for_s out"],
            ),
            (of("delay", "value = 61.0"), &["above 0, at most 60"]),
            (
                types,
                &[
                    "6 faults",
                    "faults[0].direction: must be one of \"in\", \"out\", not 7",
                    "faults[0].value: must be a number, not \"a\"",
                    "faults[0].at_s: must be 0 to 1000000 s, not \"b\"",
                    "faults[0].for_s: must be above 0, at most 1000000 s, not true",
                    "faults[1]: the key `direction` is missing",
                    "faults[1]: the key `kind` is missing",
                ],
            ),
            (
                list.to_string(),
                &[
                    "6 faults",
                    "faults[0]: must be a table of keys, not 7",
                    "faults[1].kind: must be one of \"bit_flips\", \"drop\"",
                    "faults[2]: must be a table of keys, not a list",
                    "faults[3].direction = \"up\"",
                    "faults[3].at_s = -1: must be 0 to 1000000 s",
                    "faults[3].value: missing",
                ],
            ),
        ];
        for (text, expected) in cases {
            let refused = parse(&text).unwrap_err();
            for word in expected.iter().chain(&["faults.toml"]) {
                assert!(refused.contains(word), "no {word:?} in {refused}");
            }
        }
        assert!(Plan::parse("faults.toml", &of("bus_off", "value = 1.0"), true).is_ok());
    }
}
