//! A minute of attitudes at 10 Hz over each wire, at an output level that fits. Received frames
//! equal those of the in-process link, and losses are counted. `tests/vcan/minute.rs` does the same
//! over CAN.

#[path = "support/flight.rs"]
mod flight;

use std::sync::LazyLock;

use flight::{Flight, MINUTE, compare, without_number};

fn run(link: &str, level: &str, plan: &str) -> Flight {
    flight::fly(MINUTE, link, level, plan)
}

#[test]
#[ignore = "long: waits for wires for minutes; tests/run all runs it"]
fn long_a_minute_over_every_wire_equals_the_minute_in_memory() {
    let windows = LazyLock::new(|| run("memory", "windows", ""));
    std::thread::scope(|scope| {
        // Wires mostly wait: each one starts at once, while frames for others are rendered.
        let narrow = scope.spawn(|| run("pty?baud=115200", "labels", ""));
        let middle = [
            "pty?baud=921600",
            "slcan?bitrate=1000000&load=1&baud=3000000",
        ];
        let middle = middle.map(|link| {
            let windows = &windows;
            scope.spawn(move || {
                let flight = run(link, "windows", "");
                compare(&flight, windows);
                assert_eq!(flight.report.frames, MINUTE.frames);
                // The shortest frame interval: the exposure adds some ms to the airtime, and a
                // late thread may catch up 1 ms.
                let ratio = flight.shortest.as_secs_f64() / flight.windows_airtime().as_secs_f64();
                assert!((0.97..1.5).contains(&ratio), "{link}: {ratio}");
            })
        });
        let lossy = "[[faults]]\ndirection = \"in\"\nkind = \"drop\"\nvalue = 0.05\n\
                     [[faults]]\ndirection = \"in\"\nkind = \"reorder\"\nvalue = 0.05\n\
                     [[faults]]\ndirection = \"out\"\nkind = \"drop\"\nvalue = 0.05\n\
                     [[faults]]\ndirection = \"out\"\nkind = \"reorder\"\nvalue = 0.05\n";
        let lossy = scope.spawn(move || without_number(run("udp", "frame", lossy)));
        let labels = run("memory", "labels", "");
        let reference = without_number(run("memory", "frame", ""));
        let flight = lossy.join().unwrap();
        compare(&flight, &reference);
        // Lost packets are requested again: all frames arrive.
        assert_eq!(flight.report.frames, MINUTE.frames);
        assert!(flight.counters.sequence_gaps > 0 && flight.counters.resent_blocks > 1000);
        // Windows agree with the whole frames in memory.
        for (sequence, frame) in &windows.frames {
            let whole = &reference.frames[sequence];
            assert_eq!(frame.pixels_crc32, whole.pixels_crc32);
            for window in &frame.windows {
                let (first, size) = (usize::from(window.row), usize::from(window.size));
                let rows = whole.pixels.chunks(MINUTE.side).skip(first).take(size);
                let column = usize::from(window.column);
                let crop: Vec<u16> = rows
                    .flat_map(|row| row[column..column + size].to_vec())
                    .collect();
                assert_eq!(window.pixels, crop, "attitude {sequence}");
            }
        }
        let flight = narrow.join().unwrap();
        compare(&flight, &labels);
        assert_eq!(flight.report.frames, MINUTE.frames);
        for flight in middle {
            flight.join().unwrap();
        }
    });
}
