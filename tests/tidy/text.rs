//! What no file may say: unsafe code outside of its places, folders of one machine.

use super::{files, is_rust, name, root};

/// The compiler refuses unsafe code; this keeps it told to, but for system calls that no crate wraps and for the kernels.
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

/// No file may name a folder of the machine that it was written on.
#[test]
fn no_machine_paths() {
    // In pieces, so that this file does not hold them.
    let folders = ["work", "tmp", "home", "root", "Users"].map(|folder| format!("/{folder}/"));
    for path in files(root()) {
        let Ok(text) = std::fs::read_to_string(&path) else {
            continue;
        };
        for (number, line) in (1..).zip(text.lines()) {
            let starts = |folder: &String| {
                line.match_indices(folder.as_str()).any(|(at, _)| {
                    // `a/home/b` is a path below a, not one of the machine.
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

/// What `cargo test` leaves out is run by a script, which its words name. What holds something to the clock is among that: a busy machine fails no ordinary test.
#[test]
fn what_is_ignored_is_run_by_a_script() {
    // By hand: other numbers in every run, and as many as somebody has time for.
    const BY_HAND: [&str; 2] = ["other_sets_than_before", "ten_million"];
    let all = std::fs::read_to_string(root().join("tests/run")).unwrap();
    assert!(all.contains("-- --ignored --test-threads=1 timed_"));
    let mark = concat!("#[ign", "ore = \"");
    let mut timed = 0;
    for path in files(root()).iter().filter(|path| is_rust(path)) {
        let text = std::fs::read_to_string(path).unwrap();
        for piece in text.split(mark).skip(1) {
            let (why, rest) = piece.split_once('"').unwrap();
            let function = rest.split("fn ").nth(1).unwrap();
            let function = function.split('(').next().unwrap();
            let is_timed = function.starts_with("timed_");
            assert_eq!(is_timed, why.starts_with("timed: "), "{function}: {why}");
            timed += u32::from(is_timed);
            let script = ["tests/run", "tests/vcan/run"]
                .iter()
                .find(|script| why.contains(**script));
            assert_eq!(
                script.is_none(),
                BY_HAND.contains(&function),
                "{}: {function}: {why}",
                name(path)
            );
        }
    }
    assert!(timed > 0);
}
