//! A busy machine: exposures end on the grid of their periods, each is a frame or counted as
//! missed, and scene time follows the client's clock.

use super::{EXPOSURE_S, mid_s, quick, rest};
use crate::support::{EPOCH, attitude, memory_client};
use skyloop::config::Clock;
use skyloop_protocols::Command;
use std::time::{Duration, Instant};

const RATE_HZ: f64 = 50.0;
/// Time during which two threads per processor are busy.
const LENGTH: Duration = Duration::from_secs(3);

#[test]
fn busy_machines_may_miss_but_never_shift_exposures() {
    let (emulator, mut client) = memory_client(quick(RATE_HZ), Clock::Wall);
    // Scene time begins at the first attitude, between these two instants.
    let before = Instant::now();
    client.point(attitude(1), EPOCH);
    client.status();
    let after = Instant::now();
    let mut frames = Vec::new();
    let threads = 2 * std::thread::available_parallelism().map_or(2, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while before.elapsed() < LENGTH {
                    std::hint::spin_loop();
                }
            });
        }
        while before.elapsed() < LENGTH {
            frames.push(client.frame());
        }
    });
    client.done(Command::FrameRate { hz: 1e-3 });
    let due = before.elapsed().as_secs_f64() * RATE_HZ;
    frames.extend(rest(&emulator, &mut client));
    let counters = client.counters();

    // X-Val: ICD, section 5.5: the first exposure ends one period after the attitude.
    let mut missed = 0;
    for frame in &frames {
        let periods = (mid_s(frame) + EXPOSURE_S / 2.0) * RATE_HZ;
        let whole = periods.round();
        assert!((periods - whole).abs() < 1e-5, "{periods}");
        // Earlier exposures are frames with numbers from 0 on, or missed.
        let until_then = (whole as u32).checked_sub(frame.header.frame + 1);
        assert!(until_then >= Some(missed), "{until_then:?} after {missed}");
        missed = until_then.unwrap_or_default();
    }
    assert!(missed <= counters.exposures_missed);
    let exposures = f64::from(counters.frames_rendered + counters.exposures_missed);
    assert!(exposures <= due, "{exposures} of {due}");
    // A single shot starts with its command. Wire and machine only widen the bounds.
    let requested = Instant::now();
    client.done(Command::SingleShot);
    let done = Instant::now();
    let start_s = mid_s(&client.frame()) - EXPOSURE_S / 2.0;
    let bounds = [requested - after, done - before].map(|bound| bound.as_secs_f64());
    println!(
        "{} frames, {missed} missed; {start_s} s in {bounds:?}",
        frames.len()
    );
    assert!(
        (bounds[0] - 1e-6..bounds[1] + 1e-6).contains(&start_s),
        "{start_s} s is not within {bounds:?}"
    );
}
