//! A minute of attitudes at 10 Hz over each wire, at the output level that fits it: what arrives is what the in-process
//! link brings for the same attitude, and what does not arrive is counted. `tests/vcan/minute.rs` does the same over CAN.

#[path = "support/flight.rs"]
mod flight;

use std::sync::LazyLock;

use flight::{Flight, MINUTE, compare, without_number};

fn fly(link: &str, level: &str, plan: &str) -> Flight {
    flight::fly(MINUTE, link, level, plan)
}

#[test]
#[ignore = "long: waits for wires for minutes; tests/run all runs it"]
fn long_a_minute_over_every_wire_is_the_minute_in_memory() {
    let windows = LazyLock::new(|| fly("memory", "windows", ""));
    std::thread::scope(|scope| {
        // Wires mostly wait: each is flown from the beginning, while others are rendered.
        let narrow = scope.spawn(|| fly("pty?baud=115200", "labels", ""));
        let middle = [
            "pty?baud=921600",
            "slcan?bitrate=1000000&load=1&baud=3000000",
        ];
        let middle = middle.map(|link| {
            let windows = &windows;
            scope.spawn(move || {
                let flight = fly(link, "windows", "");
                compare(&flight, windows);
                assert_eq!(flight.report.frames, MINUTE.frames);
                // The quickest of them: its exposure takes some ms more, and a thread that wakes late makes up for 1 ms.
                let ratio = flight.shortest.as_secs_f64() / flight.windows_airtime().as_secs_f64();
                assert!((0.97..1.5).contains(&ratio), "{link}: {ratio}");
            })
        });
        let lossy = "[[faults]]\ndirection = \"in\"\nkind = \"drop\"\nvalue = 0.05\n\
                     [[faults]]\ndirection = \"in\"\nkind = \"reorder\"\nvalue = 0.05\n\
                     [[faults]]\ndirection = \"out\"\nkind = \"drop\"\nvalue = 0.05\n\
                     [[faults]]\ndirection = \"out\"\nkind = \"reorder\"\nvalue = 0.05\n";
        let lossy = scope.spawn(move || without_number(fly("udp", "frame", lossy)));
        let labels = fly("memory", "labels", "");
        let reference = without_number(fly("memory", "frame", ""));
        let flight = lossy.join().unwrap();
        compare(&flight, &reference);
        // What is lost is asked for again: all frames come in the end.
        assert_eq!(flight.report.frames, MINUTE.frames);
        assert!(flight.counters.sequence_gaps > 0 && flight.counters.resent_blocks > 1000);
        // The pixels in memory are the light that the narrow levels show.
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
        for flown in middle {
            flown.join().unwrap();
        }
    });
}
