//! The minute of `tests/minute.rs` over SocketCAN, through two real sockets and the kernel.

use crate::flight::{Course, Flight, compare, fly, fly_between, options};
use crate::tools::run;
use crate::{CLASSIC, FD, VCAN0, VCAN1};
use skyloop::link;
use skyloop::link::fault::{FaultLog, Plan};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, LazyLock, Mutex};
use std::time::{Duration, Instant};

/// A small part of the detector, because the emulated guest renders some twenty times slower.
const MINUTE: Course = Course {
    frames: 600,
    side: 64,
};

static REFERENCE: LazyLock<Flight> = LazyLock::new(|| fly(MINUTE, "memory", "windows", ""));

/// Runs over an interface, with a socket at each end.
fn fly_over(
    course: Course,
    (interface, rates): (&str, &str),
    faults: Option<(Plan, Arc<Mutex<FaultLog>>)>,
    seen: impl FnMut(u32),
) -> Flight {
    let url = format!("can://{interface}?{rates}");
    let wire = link::open(&url, &options(faults)).unwrap();
    let port = skyloop_firmware_sim::link::open(&url).unwrap().0;
    fly_between(course, &url, (wire, port), "windows", seen)
}

/// Runs `work`. Also returns the longest delay of a ready thread on this machine meanwhile.
fn watched<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    const NAP: Duration = Duration::from_millis(5);
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let watch = scope.spawn(|| {
            let mut longest = Duration::ZERO;
            while !done.load(Ordering::Relaxed) {
                let begin = Instant::now();
                std::thread::sleep(NAP);
                longest = longest.max(begin.elapsed() - NAP);
            }
            longest
        });
        let result = work();
        done.store(true, Ordering::Relaxed);
        (result, watch.join().unwrap())
    })
}

/// All frames are complete, and the bus was no faster than its bit rate. `delay`: see [`watched`].
fn whole(flight: &Flight, bits_us: f64, delay: Duration) {
    compare(flight, &REFERENCE);
    assert_eq!(flight.report.frames, MINUTE.frames);
    let (counters, report) = (&flight.counters, &flight.report);
    let losses = [
        u64::from(counters.sequence_gaps),
        u64::from(counters.incomplete),
        u64::from(counters.lost_outbound),
        report.dropped,
        report.missing_packets,
    ];
    // The bus loses nothing. A socket whose reader does not run holds 212,992 bytes
    // (net.core.rmem_default): some 270 frames, 30 ms of a busy bus. After a longer delay a few
    // packets are sent again.
    let pauses = delay > Duration::from_millis(30);
    assert!(
        losses == [0; 5] || pauses && losses.iter().all(|lost| *lost < 10),
        "{losses:?}, with threads delayed by up to {delay:?}"
    );
    // Each interval includes an exposure, but a sender may catch up 1 ms.
    let min = (bits_us - 1000.0) * 1e-6 * f64::from(MINUTE.frames - 1);
    let took = flight.took.as_secs_f64();
    println!("the bits take {min:.1} s, it took {took:.1} s");
    assert!(took >= min, "{took} s, and the bits take {min} s");
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn a_minute_over_can_equals_the_minute_in_memory() {
    // X-Val: by hand as in src/live/serve/budget.rs, without stuff bits and without the last frame,
    // which counts from its beginning. The packets' 86, 4 x 1260, 673 and 65 bytes take 12 + 720 +
    // 96 + 9 frames of 111 us, 4 of 63, one of 79 and one of 71; on FD 81 + 10 + 1 of 97.75 us, 4
    // of 35.125, one of 65.75 and one of 81.75.
    let classic = 837.0 * 111.0 + 4.0 * 63.0 + 79.0 + 71.0;
    let fd = 92.0 * 97.75 + 4.0 * 35.125 + 65.75 + 81.75;
    let ((quick, slow), delay) = watched(|| {
        std::thread::scope(|scope| {
            // The slow run mostly waits for its bus, while the others render.
            let slow = scope.spawn(|| fly_over(MINUTE, (VCAN1, CLASSIC), None, |_| {}));
            LazyLock::force(&REFERENCE);
            let quick = fly_over(MINUTE, (VCAN0, FD), None, |_| {});
            (quick, slow.join().unwrap())
        })
    });
    println!("ready threads waited for up to {delay:.1?}");
    whole(&quick, fd, delay);
    whole(&slow, classic, delay);
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn losses_on_a_bad_bus_are_counted_and_requested_again() {
    // Some 90 frames per reply: one reply in six loses a frame.
    let plan = "[[faults]]\ndirection = \"in\"\nkind = \"drop\"\nvalue = 0.002\n\
                [[faults]]\ndirection = \"out\"\nkind = \"drop\"\nvalue = 0.002\n";
    let plan = Plan::parse("faults", plan, true).unwrap();
    let book = Arc::new(Mutex::new(FaultLog::default()));
    let course = Course {
        frames: 120,
        ..MINUTE
    };
    let (to_fault, seen) = channel();
    let fault = std::thread::spawn(move || {
        while seen.recv().unwrap() != 60 {}
        // The next reply is in transmission.
        std::thread::sleep(Duration::from_millis(50));
        run("ip link set vcan0 down");
        std::thread::sleep(Duration::from_millis(300));
        run("ip link set vcan0 up");
    });
    let faults = Some((plan, book.clone()));
    let flight = fly_over(course, (VCAN0, FD), faults, |sequence| {
        let _ = to_fault.send(sequence);
    });
    fault.join().unwrap();
    compare(&flight, &REFERENCE);
    let (report, counters) = (&flight.report, &flight.counters);
    let book = book.lock().unwrap().summary();
    println!("{book}");
    assert!(
        book.contains("in: drop") && book.contains("out: drop"),
        "{book}"
    );
    assert_eq!(counters.reconnects, 1);
    // Losses at both ends, and resent packets.
    assert!(report.dropped + u64::from(counters.lost_outbound + counters.incomplete) > 0);
    assert!(counters.resent_blocks > 0);
    assert_eq!(report.frames, course.frames, "all frames arrive");
}
