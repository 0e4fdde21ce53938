//! `skyloop loopback --link can`.

use std::path::Path;
use std::process::Command;

fn loopback(link: &str, frames: u32, out: &str) -> String {
    let words = format!("loopback --link {link} --frames {frames} --out {out}");
    let done = Command::new("skyloop")
        .args(words.split(' '))
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{link}: {error}");
    String::from_utf8(done.stdout).unwrap()
}

/// Whether two runs wrote equal files.
fn same(a: &str, b: &str, frames: u32) -> bool {
    let names = (0..frames).map(|n| format!("frame_{n:05}.fits"));
    names.chain(["labels.jsonl".to_string()]).all(|name| {
        let read = |folder: &str| std::fs::read(Path::new(folder).join(&name)).unwrap();
        read(a) == read(b)
    })
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn frames_over_can_equal_those_over_memory() {
    loopback("memory", 2, "memory");
    let table = loopback("can", 2, "can");
    assert!(
        table.contains("over can://vcan0?bitrate=1000000&fd=8000000"),
        "{table}"
    );
    assert!(same("memory", "can", 2));
    println!("{table}");
}
