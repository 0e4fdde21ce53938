//! What the tests rely on, and the emulator does not: the kernel's tools talk with each other.

use std::io::Write;
use std::process::{Command, Stdio};

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn the_kernel_segments_messages() {
    let receiver = Command::new("isotprecv")
        .args(["-s", "220", "-d", "120", "vcan0"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(std::time::Duration::from_millis(300));
    let mut sender = Command::new("isotpsend")
        .args(["-s", "120", "-d", "220", "vcan0"])
        .stdin(Stdio::piped())
        .spawn()
        .unwrap();
    let message: Vec<String> = (0..100).map(|octet| format!("{octet:02X}")).collect();
    let message = message.join(" ");
    let mut input = sender.stdin.take().unwrap();
    input.write_all(message.as_bytes()).unwrap();
    drop(input);
    assert!(sender.wait().unwrap().success());
    let received = receiver.wait_with_output().unwrap();
    assert_eq!(String::from_utf8(received.stdout).unwrap().trim(), message);
}
