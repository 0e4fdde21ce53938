//! Options and exit codes of `skyloop-fc` at commit 3edfec3. Like `tests/contract` of the emulator,
//! they must not change.

use crate::cli::skyloop_fc;

const OPTIONS: &str = "--attitudes --drift --epoch --fault --focal-px --force --frames --help --hold --junit \
    --limb-stare --link --listen --loop --max-centroid-rms --max-error --max-false --max-latency-p99-ms --max-missed \
    --nadir --objects --orbit --output --pause --period --positions --rate --scan --slew --timeout --ut1-utc --version \
    --wall --window-size --windows";

const EXIT_CODES: [(i32, &str); 8] = [
    (0, "--help"),
    (0, "--version"),
    (2, ""),
    (2, "--no-such-option"),
    (2, "--link udp://127.0.0.1:1 --hold 0,0,0,1"),
    (
        1,
        "--link smoke://x --hold 0,0,0,1 --epoch 2026-06-01T00:00:00Z",
    ),
    (
        1,
        "--link udp://127.0.0.1:1 --attitudes no-such --epoch 2026-06-01T00:00:00Z",
    ),
    (
        1,
        "--link serial:///dev/no-such --hold 0,0,0,1 --epoch 2026-06-01T00:00:00Z",
    ),
];

#[test]
fn options_are_unchanged() {
    let help = String::from_utf8(skyloop_fc("--help").stdout).unwrap();
    // The line of an option begins with its names; its help follows behind or below.
    let names = help.lines().flat_map(|line| {
        let names = line
            .split_whitespace()
            .take_while(|word| word.starts_with('-'));
        names.filter(|word| word.starts_with("--"))
    });
    let mut names: Vec<&str> = names.collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.join(" "), OPTIONS);
}

#[test]
fn exit_codes_are_unchanged() {
    for (code, arguments) in EXIT_CODES {
        let output = skyloop_fc(arguments);
        let log = String::from_utf8_lossy(&output.stderr);
        assert_eq!(
            output.status.code(),
            Some(code),
            "skyloop-fc {arguments}: {log}"
        );
    }
}
