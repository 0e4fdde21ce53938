//! What no file may say: unsafe code outside of its places, folders of one machine.

use super::{files, is_rust, name, root};

/// The compiler refuses unsafe code; this keeps it told to, but for system calls that no crate wraps and for the kernels.
#[test]
fn nothing_is_unsafe() {
    const UNSAFE: &[&str] = &["src/kernels.rs", "src/link/low_latency.rs"];
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
