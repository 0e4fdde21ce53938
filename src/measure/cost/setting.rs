//! The measured settings.

use skyloop_render::fidelity::{Fidelity, PRESETS, TOLERANCES, Value};

/// A setting to measure.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// The preset's name, or the tolerance and its value: `wing_e = 0.2`.
    pub name: String,
    /// The tolerance that differs from `realtime`, and its value.
    pub moved: Option<(&'static str, Value)>,
    /// All its tolerances.
    pub fidelity: Fidelity,
}

/// The presets, and `realtime` with each tolerance changed alone to its value in another preset.
pub fn settings() -> Vec<Setting> {
    let presets = PRESETS.iter().map(|(name, fidelity)| Setting {
        name: name.to_string(),
        moved: None,
        fidelity: *fidelity,
    });
    let moved = TOLERANCES.iter().flat_map(|tolerance| {
        let mut values: Vec<Value> = [Fidelity::FAST, Fidelity::REFERENCE]
            .iter()
            .map(tolerance.get)
            .collect();
        values.retain(|value| *value != (tolerance.get)(&Fidelity::REALTIME));
        values.dedup();
        values.into_iter().map(|value| {
            let mut fidelity = Fidelity::REALTIME;
            (tolerance.set)(&mut fidelity, value);
            Setting {
                name: format!("{} = {value}", tolerance.name),
                moved: Some((tolerance.name, value)),
                fidelity,
            }
        })
    });
    presets.chain(moved).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_tolerance_is_changed_alone() {
        let all = settings();
        for setting in all.iter().skip(PRESETS.len()) {
            let (name, value) = setting.moved.unwrap();
            let other = |tolerance: &&skyloop_render::fidelity::Tolerance| {
                !tolerance.is_same(&setting.fidelity, &Fidelity::REALTIME)
            };
            let others: Vec<_> = TOLERANCES.iter().filter(other).collect();
            assert_eq!(others.len(), 1, "{}", setting.name);
            assert_eq!(
                (others[0].name, (others[0].get)(&setting.fidelity)),
                (name, value)
            );
        }
        for tolerance in TOLERANCES {
            let moves = all.iter().filter_map(|setting| setting.moved);
            assert!(
                moves.filter(|(name, _)| *name == tolerance.name).count() >= 1,
                "{}",
                tolerance.name
            );
        }
    }
}
