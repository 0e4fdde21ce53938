//! What is rendered where a frame would be late: coarser and coarser, whatever a run's setting is.

use super::tolerances::{Fidelity, TOLERANCES, Tolerance};
use super::value::Value;
use std::fmt;

/// A step of coarsening. It is kept as requested, not as the setting that it comes to: that
/// depends on the run's, which a budget of time may choose.
#[derive(Debug, Clone, Copy)]
pub enum Coarser {
    /// Every knob to where the preset of this name has it.
    Preset(&'static str, Fidelity),
    /// One knob to this value.
    Tolerance(&'static Tolerance, Value),
}

impl Coarser {
    /// What stands `before` with each knob of the step where the step has it, or where it was if
    /// that is coarser: nothing is made finer.
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
    fn presets_coarsen_those_that_are_finer_and_no_others() {
        for (i, (name, fidelity)) in PRESETS.iter().enumerate() {
            for (j, (_, before)) in PRESETS.iter().enumerate() {
                // From the coarsest to the finest.
                let wanted = if i <= j { fidelity } else { before };
                assert_eq!(preset(name).than(before), *wanted, "{i} {j}");
            }
        }
    }

    #[test]
    fn no_step_makes_a_knob_finer() {
        let before = Fidelity {
            wing_e: 1.0,
            orbits: Orbits::Exact,
            ..Fidelity::REALTIME
        };
        let wanted = Fidelity {
            wing_e: 1.0,
            ..Fidelity::FAST
        };
        assert_eq!(preset("fast").than(&before), wanted);
        for finer in [
            tolerance("wing_e", Value::Number(0.5)),
            tolerance("orbits", Value::Word("scalar")),
            preset("realtime"),
        ] {
            let after = finer.than(&before);
            let wanted = Fidelity {
                orbits: after.orbits,
                ..before
            };
            assert_eq!(after, wanted, "{finer}");
            assert_ne!(after.orbits, Orbits::Scalar, "{finer}");
        }
        let faster = tolerance("orbits", Value::Word("tracked")).than(&before);
        assert_eq!(faster.orbits, Orbits::Tracked);
    }

    #[test]
    fn steps_are_told_as_files_have_them() {
        let texts = [preset("fast"), tolerance("wing_e", Value::Number(0.5))];
        assert_eq!(
            texts.map(|step| step.to_string()),
            ["\"fast\"", "\"wing_e = 0.5\""]
        );
    }
}
