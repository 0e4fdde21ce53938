//! Smear from zero to thousands of pixels, about every axis, against integration from the label
//! alone.

use skyloop::attitude::VehicleState;
use skyloop::engine::ExposedFrame;
use skyloop::fidelity::Fidelity;
use skyloop::sky::catalog::Selection;

use super::brute::{emulator, epoch, expose, maximum, verdict};
use super::light::Tally;

/// A frame of `camera` with another focal length (px), turning by `turn_deg` about body axes during
/// the exposure.
fn turned(camera: &str, focal_px: f64, turn_deg: [f64; 3]) -> ExposedFrame {
    let mut emulator = emulator(camera, Selection::Bsc, Vec::new(), Fidelity::REALTIME);
    emulator.camera_mut().optics.focal_px = focal_px;
    let exposure_s = emulator.camera().exposure_s;
    let rates = turn_deg.map(|turn| turn / exposure_s);
    let at = epoch("2024-05-06T07:08:09.1");
    expose(&mut emulator, at, [0.6, -0.5, 0.3, 0.4], rates, None)
}

fn longest(exposed: &ExposedFrame) -> f64 {
    let objects = exposed.label.objects.iter();
    maximum(objects.map(|o| (o.x1_px - o.x0_px).hypot(o.y1_px - o.y0_px)))
}

/// Across, slanted, and about the boresight; the first of these moves images by `px` in the middle
/// of the field.
fn axes(px: f64, focal_px: f64) -> [[f64; 3]; 3] {
    let turn = (px / focal_px).to_degrees();
    [
        [turn, 0.0, 0.0],
        [0.5 * turn, -0.7 * turn, 0.3 * turn],
        [0.0, 0.0, turn],
    ]
}

#[test]
#[ignore = "long: minutes of work; tests/run all runs it"]
fn long_every_length_keeps_its_light_its_centre_and_its_profile() {
    // 1024 x 1024 pixels in 10 degrees: 5000 px are 48 degrees.
    for px in [0.0, 1e-3, 0.1, 1.0, 10.0, 100.0, 1000.0, 5000.0] {
        let mut tally = Tally::default();
        let mut longest_px = 0.0f64;
        for turn in axes(px, 6000.0) {
            let exposed = turned("rigel-l", 6000.0, turn);
            longest_px = longest_px.max(longest(&exposed));
            tally.add(&exposed);
        }
        println!("{px} px ({longest_px:.4}): {tally:?}");
        assert!(longest_px >= 0.9 * px, "{longest_px}");
        // The centre of a star at rest has an error of at most half of skip_px; its light has none.
        assert!(tally.worst_centroid_px <= 1e-3, "{px}: {tally:?}");
        assert!(tally.worst_light <= 1e-4, "{px}: {tally:?}");
        assert!(tally.worst_part <= 1e-4, "{px}: {tally:?}");
        // Of the brightest pixel: 2e-5 of the profile at its ends, and 1e-5 of the reference
        // integration. Light spread over thousands of pixels is so faint on each that `track_e`
        // exceeds this.
        assert!(tally.worst_beyond <= 5e-5, "{px}: {tally:?}");
        assert!(px > 1000.0 || tally.worst_pixel <= 5e-5, "{px}: {tally:?}");
    }
}

/// The ends of a star's track in 100 s at rest are its positions at rest at these times.
#[test]
fn stars_drift_as_the_observers_velocity_turns() {
    let orbit = Some(([2.1e6, -5.4e6, 3.9e6], [6.3e3, 3.7e3, 1.8e3]));
    let mut emulator = emulator("rigel-l", Selection::Bsc, Vec::new(), Fidelity::REALTIME);
    emulator.camera_mut().optics.focal_px = 6000.0;
    let mid = epoch("2024-05-06T07:08:09.1");
    let vehicle = VehicleState::new(5, mid, [0.5, -0.5, 0.5, 0.5], [0.0; 3], orbit).unwrap();
    let mut at = |dt_s: f64, exposure_s: f64| {
        emulator.camera_mut().exposure_s = exposure_s;
        let epoch = mid + hifitime::Duration::from_seconds(dt_s);
        emulator.expose(&vehicle.at(epoch), 0).unwrap().label
    };
    let [before, after] = [-50.0, 50.0].map(|dt_s| at(dt_s, 1e-3));
    let long = at(0.0, 100.0);
    let drift = verdict(&emulator, &vehicle, "aberration drift");
    assert!(drift.run, "{drift:?}");
    let (mut compared, mut furthest) = (0, 0.0f64);
    for o in &long.objects {
        for (label, x, y) in [(&before, o.x0_px, o.y0_px), (&after, o.x1_px, o.y1_px)] {
            let Some(still) = label.objects.iter().find(|other| other.id == o.id) else {
                continue;
            };
            let off = (still.x_px - x).hypot(still.y_px - y);
            // The Earth's own acceleration in 50 s, 0.3 m/s, is 6e-6 px.
            assert!(off < 2e-5, "{off} {o:?}");
            furthest = furthest.max((x - o.x_px).hypot(y - o.y_px));
            compared += 1;
        }
    }
    assert!(compared > 10);
    // The declared error is its motion, not much more.
    let declared = drift.error_px.unwrap();
    println!("{furthest} of {declared}");
    assert!(furthest > 5e-3 && furthest <= declared && declared < 2.0 * furthest);
}

#[test]
fn corner_images_of_a_wide_field_move_faster() {
    // 256 pixels at a focal length of 180: 45 degrees to the corners, where the scale is twice as
    // large.
    let mut tally = Tally::default();
    for turn in [[12.0, 0.0, 0.0], [4.0, -6.0, 9.0]] {
        tally.add(&turned("fai-nir", 180.0, turn));
    }
    println!("wide: {tally:?}");
    assert!(tally.worst_pixel <= 1e-4, "{tally:?}");
}
