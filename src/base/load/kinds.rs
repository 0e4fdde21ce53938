//! Tables whose keys depend on what kind of thing they are.

use super::{Check, ConfigError, Kind, one_of};

/// Refuses an unknown kind of a table, keys that it does not take, and a lack of those that it needs.
/// `[table, key, kind]`: the table, its key that names the kind, and the kind; `given`: the other
/// keys, and whether they are given.
pub fn only_its_keys(
    [table, key, kind]: [&str; 3],
    kinds: &[Kind],
    given: &[(&str, bool)],
    check: &Check,
) -> Result<(), ConfigError> {
    let named = format!("{table}.{key}");
    let Some((_, needed, others)) = kinds.iter().find(|(known, ..)| *known == kind) else {
        let known: Vec<&str> = kinds.iter().map(|(known, ..)| *known).collect();
        return Err(check.refuse(&named, format!("{kind:?}"), one_of(&known)));
    };
    let rule = |name: &str, reason: String| {
        let error = check.explain(&format!("{table}.{name}"), reason);
        Err(error.needs(&[&named]))
    };
    let takes = [*needed, *others].concat();
    let is_given = |name: &str| given.contains(&(name, true));
    if let Some((name, _)) = given
        .iter()
        .find(|(name, is_given)| *is_given && !takes.contains(name))
    {
        let takes = takes.join(", ");
        return rule(
            name,
            format!("means nothing to {key} {kind:?}, which takes {takes}"),
        );
    }
    if let Some(name) = needed.iter().find(|name| !is_given(name)) {
        let needed = needed.join(", ");
        return rule(
            name,
            format!("the key `{name}` is missing: {key} {kind:?} needs {needed}"),
        );
    }
    Ok(())
}
