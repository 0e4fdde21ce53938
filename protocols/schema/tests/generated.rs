//! What is committed is what the descriptions ask for.

use skyloop_schema::{NOTE, outputs, read};

#[test]
fn the_committed_files_are_those_of_the_schema() {
    let mut stale = Vec::new();
    for (path, text) in outputs().unwrap() {
        let committed = read(&path).unwrap_or_default();
        if committed.replace("\r\n", "\n") != text {
            let lines = committed.lines().zip(text.lines());
            let same = lines.take_while(|(a, b)| a == b).count();
            stale.push(format!("protocols/{path}, line {}", same + 1));
        }
        // A reader of a generated file learns at once where to change it.
        let mut head = text
            .lines()
            .take(if path == "docs/icd.md" { usize::MAX } else { 1 });
        assert!(head.any(|line| line.contains(NOTE)), "{path}");
    }
    assert!(
        stale.is_empty(),
        "not what protocols/schema says: run `cargo run -p skyloop-schema` and commit\n{}",
        stale.join("\n")
    );
}
