//! The committed generated files are up to date.

use skyloop_schema::{NOTE, outputs, read};

#[test]
fn committed_files_equal_the_generated_ones() {
    let mut stale = Vec::new();
    for (path, text) in outputs().unwrap() {
        let committed = read(&path).unwrap_or_default();
        if committed.replace("\r\n", "\n") != text {
            let lines = committed.lines().zip(text.lines());
            let same = lines.take_while(|(a, b)| a == b).count();
            stale.push(format!("protocols/{path}, line {}", same + 1));
        }
        // The note tells a reader of a generated file where to change it.
        let mut head = text
            .lines()
            .take(if path == "docs/icd.md" { usize::MAX } else { 1 });
        assert!(head.any(|line| line.contains(NOTE)), "{path}");
    }
    assert!(
        stale.is_empty(),
        "stale: run `cargo run -p skyloop-schema` and commit\n{}",
        stale.join("\n")
    );
}
