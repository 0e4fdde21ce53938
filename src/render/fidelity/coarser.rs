//! Steps of coarsening, for frames that would be late.

use super::tolerances::{Fidelity, TOLERANCES, Tolerance};
use super::value::Value;
use std::fmt;

/// A step of coarsening. It is stored as requested, not as the resulting setting: that depends on
/// the run's own tolerances, which a time budget may choose.
#[derive(Debug, Clone, Copy)]
pub enum Coarser {
    /// Every tolerance as in the preset of this name.
    Preset(&'static str, Fidelity),
    /// One tolerance with this value.
    Tolerance(&'static Tolerance, Value),
}

impl Coarser {
    /// `before` with each tolerance of the step, unless its value there is coarser already: no
    /// tolerance becomes finer.
    pub fn than(&self, before: &Fidelity) -> Fidelity {
        let mut after = *before;
        let mut raise = |tolerance: &Tolerance, value: Value| {
            if tolerance.is_coarser(value, (tolerance.get)(before)) {
                (tolerance.set)(&mut after, value);
            }
        };
        match self {
            Coarser::Preset(_, preset) => {
                TOLERANCES
                    .iter()
                    .for_each(|tolerance| raise(tolerance, (tolerance.get)(preset)));
            }
            Coarser::Tolerance(tolerance, value) => raise(tolerance, *value),
        }
        after
    }
}

impl fmt::Display for Coarser {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Coarser::Preset(name, _) => write!(f, "\"{name}\""),
            Coarser::Tolerance(tolerance, value) => write!(f, "\"{} = {value}\"", tolerance.name),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fidelity::{Orbits, PRESETS};

    fn preset(name: &'static str) -> Coarser {
        Coarser::Preset(name, Fidelity::preset(name).unwrap())
    }

    fn tolerance(name: &str, value: Value) -> Coarser {
        Coarser::Tolerance(Tolerance::named(name).unwrap(), value)
    }

    #[test]
    fn presets_raise_only_finer_tolerances() {
        for (i, (name, fidelity)) in PRESETS.iter().enumerate() {
            for (j, (_, before)) in PRESETS.iter().enumerate() {
                // From the coarsest to the finest.
                let expected = if i <= j { fidelity } else { before };
                assert_eq!(preset(name).than(before), *expected, "{i} {j}");
            }
        }
    }

    #[test]
    fn no_step_makes_a_tolerance_finer() {
        let before = Fidelity {
            wing_e: 1.0,
            orbits: Orbits::Exact,
            ..Fidelity::REALTIME
        };
        let expected = Fidelity {
            wing_e: 1.0,
            ..Fidelity::FAST
        };
        assert_eq!(preset("fast").than(&before), expected);
        for finer in [
            tolerance("wing_e", Value::Number(0.5)),
            tolerance("orbits", Value::Word("scalar")),
            preset("realtime"),
        ] {
            let after = finer.than(&before);
            let expected = Fidelity {
                orbits: after.orbits,
                ..before
            };
            assert_eq!(after, expected, "{finer}");
            assert_ne!(after.orbits, Orbits::Scalar, "{finer}");
        }
        let faster = tolerance("orbits", Value::Word("tracked")).than(&before);
        assert_eq!(faster.orbits, Orbits::Tracked);
    }

    #[test]
    fn steps_are_written_as_in_configuration_files() {
        let texts = [preset("fast"), tolerance("wing_e", Value::Number(0.5))];
        assert_eq!(
            texts.map(|step| step.to_string()),
            ["\"fast\"", "\"wing_e = 0.5\""]
        );
    }
}
