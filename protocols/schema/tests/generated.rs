//! What is committed is what the descriptions ask for.

#[test]
fn the_committed_files_are_those_of_the_schema() {
    let mut stale = Vec::new();
    for output in skyloop_schema::outputs().unwrap() {
        let committed = skyloop_schema::read(&output.path).unwrap_or_default();
        if committed.replace("\r\n", "\n") != output.text {
            let same = committed
                .lines()
                .zip(output.text.lines())
                .take_while(|(a, b)| a == b);
            stale.push(format!(
                "protocols/{}, line {}",
                output.path.display(),
                same.count() + 1
            ));
        }
    }
    assert!(
        stale.is_empty(),
        "not what protocols/schema says: run `cargo run -p skyloop-schema` and commit\n{}",
        stale.join("\n")
    );
}

/// A reader of a generated file learns at once where to change it.
#[test]
fn generated_files_say_so() {
    for output in skyloop_schema::outputs().unwrap() {
        let says = match output.path.to_str() {
            Some("docs/icd.md") => output.text.contains(skyloop_schema::NOTE),
            _ => output
                .text
                .lines()
                .next()
                .unwrap_or_default()
                .contains(skyloop_schema::NOTE),
        };
        assert!(says, "{}", output.path.display());
    }
}
