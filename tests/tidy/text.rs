//! No unsafe code outside of its files, no paths of one machine, no ignored test without a script.

use super::{files, is_rust, name, root};

/// The lint against unsafe code is active, except for system calls without a crate and for kernels.
#[test]
fn nothing_is_unsafe() {
    const UNSAFE: &[&str] = &["src/render/kernels.rs", "src/link/low_latency.rs"];
    let lint = concat!("unsafe", "_code");
    for path in files(root()) {
        let Ok(text) = std::fs::read_to_string(&path) else {
            continue;
        };
        if is_rust(&path) {
            let allowed = [format!("allow({lint}"), format!("expect({lint}")];
            let allowed = allowed.iter().any(|a| text.contains(a));
            let expected = UNSAFE.contains(&name(&path).as_str());
            assert_eq!(allowed, expected, "{}", name(&path));
            let (calls, reasons) = (
                text.matches("unsafe {").count(),
                text.matches("// SAFETY: ").count(),
            );
            assert!(
                !expected || (calls > 0 && calls == reasons),
                "{}",
                name(&path)
            );
        }
        if path.ends_with("Cargo.toml") {
            assert!(
                text.contains("[lints]\nworkspace = true"),
                "{}",
                name(&path)
            );
        }
    }
    let manifest = std::fs::read_to_string(root().join("Cargo.toml")).unwrap();
    assert!(manifest.contains(&format!("{lint} = \"deny\"")));
}

#[test]
fn no_machine_paths() {
    // Composed, so that this file does not contain them.
    let folders = ["work", "tmp", "home", "root", "Users"].map(|folder| format!("/{folder}/"));
    for path in files(root()) {
        let Ok(text) = std::fs::read_to_string(&path) else {
            continue;
        };
        for (number, line) in (1..).zip(text.lines()) {
            let starts = |folder: &String| {
                line.match_indices(folder.as_str()).any(|(at, _)| {
                    // `a/home/b` is a relative path.
                    !line[..at].ends_with(|c: char| c.is_alphanumeric() || "._-".contains(c))
                })
            };
            assert!(
                !folders.iter().any(starts),
                "{}:{number}: {line}",
                name(&path)
            );
        }
    }
}

/// Each ignored test has a script that runs it. The prefix of its name selects it there, and the
/// reason starts with the same word.
#[test]
fn ignored_tests_are_run_by_a_script() {
    // Run by hand: random input of any duration.
    const BY_HAND: [&str; 2] = ["other_sets_than_before", "ten_million"];
    const KINDS: [&str; 3] = ["timed", "tools", "long"];
    let script = std::fs::read_to_string(root().join("tests/run")).unwrap();
    assert!(script.contains("-- --ignored long_ tools_"));
    assert!(script.contains("-- --ignored --test-threads=1 timed_"));
    let mark = concat!("#[ign", "ore = \"");
    let mut found = [0; KINDS.len()];
    for path in files(root()).iter().filter(|path| is_rust(path)) {
        let text = std::fs::read_to_string(path).unwrap();
        for piece in text.split(mark).skip(1) {
            let (reason, rest) = piece.split_once('"').unwrap();
            let function = rest.split("fn ").nth(1).unwrap();
            let function = function.split('(').next().unwrap();
            let what = format!("{}: {function}: {reason}", name(path));
            for (kind, count) in KINDS.iter().zip(&mut found) {
                let is_named = function.starts_with(&format!("{kind}_"));
                assert_eq!(is_named, reason.starts_with(&format!("{kind}: ")), "{what}");
                assert!(!is_named || reason.contains("tests/run all"), "{what}");
                *count += u32::from(is_named);
            }
            let is_by_hand = BY_HAND.contains(&function);
            let is_scripted = ["tests/run all", "tests/vcan/run"]
                .iter()
                .any(|script| reason.contains(script));
            assert_ne!(is_by_hand, is_scripted, "{what}");
        }
    }
    assert!(found.iter().all(|count| *count > 0), "{found:?}");
}
