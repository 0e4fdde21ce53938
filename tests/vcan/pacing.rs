//! A virtual bus loses frames that are sent too fast; ours are sent at the rate of the bus.

use crate::VCAN0;
use skyloop_firmware_sim::can::pacing::{Pace, Rates};
use skyloop_firmware_sim::can::settings::Settings;
use skyloop_firmware_sim::can::{Sending, socket};
use skyloop_protocols::can::CanFrame;
use std::time::{Duration, Instant};

const FRAMES: u32 = 10_000;
/// Work of the receiver per frame.
const WORK: Duration = Duration::from_micros(150);
const RATES: Rates = Rates {
    bitrate: 500_000,
    data_bitrate: 2_000_000,
    load: 1.0,
};

/// Sends numbered frames. Returns the number lost and the time.
fn lost(mut pace: Option<Pace>) -> (u32, Duration) {
    let mut settings = Settings::new(VCAN0);
    (settings.fd, settings.rates) = (true, RATES);
    let mut sender = socket::open(&settings).unwrap();
    let mut receiver = socket::open(&settings).unwrap();
    let receiving = std::thread::spawn(move || {
        let mut received = 0;
        while let Some(frame) = receiver.recv(Duration::from_secs(1)).unwrap() {
            assert_eq!((frame.len, frame.fd, frame.brs), (64, true, true));
            received += 1;
            let begin = Instant::now();
            while begin.elapsed() < WORK {}
        }
        received
    });
    let begin = Instant::now();
    for number in 0..FRAMES {
        let mut bytes = [0; 64];
        bytes[..4].copy_from_slice(&number.to_be_bytes());
        let frame = CanFrame::new(0x7F0, true, &bytes).unwrap();
        if let Some(pace) = &mut pace {
            while let Some(free) = pace.until(Instant::now()) {
                std::thread::sleep(free.saturating_duration_since(Instant::now()));
            }
            pace.sent(&frame, Instant::now());
        }
        while sender.send(&frame).unwrap() == Sending::Full {
            std::thread::sleep(Duration::from_micros(100));
        }
    }
    let took = begin.elapsed();
    (FRAMES - receiving.join().unwrap(), took)
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn paced_frames_are_not_lost() {
    let (unpaced, took) = lost(None);
    println!("unpaced: {unpaced} of {FRAMES} FD frames lost in {took:.1?}");
    let (paced, took) = lost(Some(Pace::new(RATES)));
    println!("at 0.5 and 2 Mbit/s: {paced} of {FRAMES} FD frames lost in {took:.1?}");
    assert_eq!(paced, 0);
    let frame = CanFrame::new(0x7F0, true, &[0; 64]).unwrap();
    let min = RATES.duration(&frame) * (FRAMES - 10);
    let tolerance = Duration::from_millis(2);
    assert!(took >= min - tolerance, "{took:?} {min:?}");
}
