//! Interpolated positions against SGP4 itself, frame by frame.

use crate::support::{answers, distance, samples};
use hifitime::{Duration, Epoch, Unit};
use skyloop_orbit::cone::Cone;
use skyloop_orbit::elements::Elements;
use skyloop_orbit::sgp4_batch::{BLOCK, Batch, Level, NOBODY, States};
use skyloop_orbit::synth::population;
use skyloop_orbit::tracks::{BOUND_KM, Look, Places, Tracks};
use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Where an object is, TEME, km; or the code of its failure.
type Place = Result<[f64; 3], u8>;

/// Finds everybody before it.
struct All(Cone);

impl Look for All {
    type Found = (usize, Place);

    fn cone(&self) -> &Cone {
        &self.0
    }

    fn look(&self, places: &Places<'_>, found: &mut Vec<Self::Found>) -> bool {
        for i in (0..BLOCK).filter(|i| places.objects[*i] != NOBODY) {
            let place = match places.code[i] {
                0 => Ok([0, 1, 2].map(|axis| places.position_km[axis][i])),
                code => Err(code),
            };
            found.push((places.objects[i] as usize, place));
        }
        true
    }
}

/// Everybody's place, in the order of the sets.
fn places(tracks: &mut Tracks, t: Epoch) -> Vec<Place> {
    let mut found = tracks.at(t, &All(Cone::new([0.0; 3], [0.0, 0.0, 1.0], PI, 0.0)));
    assert_eq!(found.len(), tracks.len());
    found.sort_by_key(|(object, _)| *object);
    found.into_iter().map(|(_, place)| place).collect()
}

fn exact(batch: &mut Batch, t: Epoch) -> Vec<Place> {
    let mut states = States::default();
    batch.propagate(t, &mut states);
    let answers = answers(batch, &states).into_iter();
    answers
        .map(|answer| answer.map(|(position, _)| position))
        .collect()
}

fn bits(places: &[Place]) -> Vec<Result<[u64; 3], u8>> {
    let bits = |place: &Place| place.map(|place| place.map(f64::to_bits));
    places.iter().map(bits).collect()
}

/// A population of today, and every kind of orbit that SGP4 tells apart, but for those that pass the Earth's centre within
/// seconds: failures that come and go between two of a segment's instants are not seen.
fn sets(objects: usize) -> Vec<Elements> {
    let today = population(objects, 6, samples::epoch()).into_iter();
    // their epochs are all over half a century
    let any = (samples::synthetic().into_iter()).filter(|one| one.kind != samples::CORE);
    let any = any.map(|one| Elements {
        epoch: samples::epoch() - Unit::Day * 1,
        ..one.set
    });
    today.map(|one| one.elements).chain(any).collect()
}

#[derive(Debug, Default)]
struct Worst {
    km: f64,
    compared: usize,
    interpolated: usize,
    failures: usize,
}

/// Asks for a place at every time, and compares every `stride`th answer with SGP4's.
fn hold(sets: &[Elements], times: impl Iterator<Item = Epoch>, stride: usize) -> Worst {
    let (mut tracks, mut batch) = (Tracks::new(sets).unwrap(), Batch::new(sets).unwrap());
    let mut worst = Worst::default();
    for (frame, t) in times.enumerate() {
        let found = places(&mut tracks, t);
        if frame % stride != 0 {
            continue;
        }
        for (i, (found, exact)) in found.iter().zip(exact(&mut batch, t)).enumerate() {
            let (Ok(found), Ok(exact)) = (found, exact) else {
                assert_eq!(found.err(), exact.err(), "{t}: {:?}", sets[i]);
                worst.failures += 1;
                continue;
            };
            let (km, _) = distance(&(*found, [0.0; 3]), &(exact, [0.0; 3]));
            assert!(km <= BOUND_KM, "{t}: {km:e} km: {:?}", sets[i]);
            worst.km = worst.km.max(km);
            worst.compared += 1;
            worst.interpolated += usize::from(*found != exact);
        }
    }
    println!("{worst:?}");
    worst
}

/// Frames from `start` on, `step` s apart.
fn frames(start: Epoch, step: f64, count: usize) -> impl Iterator<Item = Epoch> {
    (0..count).map(move |i| start + Duration::from_seconds(i as f64 * step))
}

#[test]
fn everybody_is_within_the_bound() {
    let sets = sets(1000);
    // prime strides meet all phases of segments
    for (step, count, stride) in [(0.1, 900, 13), (0.5, 600, 17), (2.0, 1800, 29)] {
        let worst = hold(&sets, frames(samples::epoch(), step, count), stride);
        assert!(2 * worst.interpolated > worst.compared);
        assert!(worst.failures > 100);
    }
}

#[test]
fn the_catalogues_are_within_the_bound() {
    for (name, sets) in samples::catalogues() {
        println!("{name}, {} sets", sets.len());
        let epochs = sets.iter().map(|set| set.epoch);
        let newest = epochs.max().unwrap();
        let worst = hold(&sets, frames(newest, 0.1, 300), 7);
        assert!(2 * worst.interpolated > worst.compared);
        hold(&sets, frames(newest, 2.0, 400), 11);
    }
}

#[test]
fn jumps_in_time_are_followed() {
    let start = samples::epoch();
    let jumps = [
        0.0, 3.0, -2.0, 3600.0, -86_400.0, 1e6, 0.05, -0.05, 10.0, 9.9, 30.0,
    ];
    let times = jumps.into_iter().flat_map(|to| {
        let (on, back) = (
            frames(start + Unit::Second * to, 0.7, 60),
            frames(start + Unit::Second * to, -0.7, 60),
        );
        on.chain(back)
    });
    let worst = hold(&sets(500), times, 7);
    assert!(2 * worst.interpolated > worst.compared);
}

#[test]
fn where_exactness_is_asked_for_the_bits_are_those_of_sgp4() {
    let sets = sets(500);
    let (mut tracks, mut batch) = (Tracks::new(&sets).unwrap(), Batch::new(&sets).unwrap());
    let mut states = States::default();
    // exact frames, others, and exact ones again
    for (frame, t) in frames(samples::epoch(), 0.1, 150).enumerate() {
        tracks.exact = !(50..100).contains(&frame);
        let found = places(&mut tracks, t);
        batch.propagate(t, &mut states);
        let same = found.iter().enumerate().filter(|(i, found)| {
            let metres = found.map(|place| place.map(|km| km * 1e3));
            metres == states.get(*i).map(|state| state.position_m.into())
        });
        let same = same.count();
        assert!(
            (same == sets.len()) == tracks.exact,
            "frame {frame}: {same}"
        );
    }
}

#[test]
fn levels_and_threads_give_the_same_bits() {
    let sets = sets(500);
    let run = |level: Level, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let mut tracks = Tracks::new(&sets).unwrap();
            tracks.set_level(level);
            let times = frames(samples::epoch(), 0.3, 120);
            times
                .map(|t| bits(&places(&mut tracks, t)))
                .collect::<Vec<_>>()
        })
    };
    let expected = run(Level::Portable, 1);
    for level in Level::available() {
        for threads in [1, 2, 4] {
            assert!(
                run(level, threads) == expected,
                "{level} on {threads} threads"
            );
        }
    }
}

/// The resonance's integrator takes a step every 720 min from the epoch.
#[test]
fn a_step_of_the_integrator_is_no_jump() {
    let sets = sets(500);
    let epoch = sets.last().unwrap().epoch;
    for step in [1, -1, 2] {
        let start = epoch + Unit::Minute * (720 * step) - Unit::Second * 30;
        let ours: Vec<Elements> = sets
            .iter()
            .filter(|set| set.epoch == epoch)
            .copied()
            .collect();
        let worst = hold(&ours, frames(start, 0.1, 600), 3);
        assert!(2 * worst.interpolated > worst.compared);
    }
}

/// Where the inclination passes 0.2 rad node and perigee are perturbed in another way, and SGP4's positions jump.
#[test]
fn jumps_of_the_model_are_asked_of_it() {
    let epoch = samples::epoch();
    let mut met = 0;
    for i in 0..40 {
        let set = Elements {
            norad: i,
            epoch,
            inclination: 0.2 + (f64::from(i) - 20.0) * 5e-5,
            node: f64::from(i) * 0.31,
            eccentricity: 0.01,
            perigee: 1.0,
            mean_anomaly: 2.0,
            // a day
            mean_motion: 0.004_375,
            drag: 0.0,
        };
        let Some(jump) = jump(&set) else {
            continue;
        };
        met += 1;
        // company in the block, and the same object in every place of it
        hold(
            &[set; 9],
            frames(epoch + Unit::Minute * jump - Unit::Second * 30, 0.1, 600),
            1,
        );
    }
    println!("{met} jumps");
    assert!(met >= 5);
}

/// Minutes from the epoch to a jump of more than a metre, within 2 s; of sets that have one within 20 days.
fn jump(set: &Elements) -> Option<f64> {
    const STEP_MIN: f64 = 1.0 / 30.0;
    let state = |minutes: f64| set.state_teme_after(minutes).unwrap();
    let inclination = |minutes: f64| {
        let normal = state(minutes)
            .position_m
            .cross(&state(minutes).velocity_m_s);
        (normal.z / normal.norm()).acos()
    };
    let hours = (0..480).map(|hour| f64::from(hour) * 60.0);
    let is_below = |minutes: f64| inclination(minutes) < 0.2;
    let near = hours
        .clone()
        .find(|hour| is_below(*hour) != is_below(hour + 60.0))?;
    // short-period terms move the passage by up to an hour
    let steps = (0..9000).map(|step| near - 120.0 + f64::from(step) * STEP_MIN);
    steps.into_iter().find(|minutes| {
        let (a, b) = (state(*minutes), state(minutes + STEP_MIN));
        let way = (a.velocity_m_s + b.velocity_m_s) / 2.0 * STEP_MIN * 60.0;
        (b.position_m - a.position_m - way).norm() > 1.0
    })
}

/// Finds whoever is in a cone or has no place, and counts the blocks that it is shown.
struct Within {
    cone: Cone,
    shown: AtomicUsize,
}

impl Look for Within {
    type Found = (u32, bool);

    fn cone(&self) -> &Cone {
        &self.cone
    }

    fn look(&self, places: &Places<'_>, found: &mut Vec<Self::Found>) -> bool {
        self.shown.fetch_add(1, Ordering::Relaxed);
        let [x, y, z] = &places.position_km;
        let mut met = false;
        for i in (0..BLOCK).filter(|i| places.objects[*i] != NOBODY) {
            let inside = self.cone.holds([x[i], y[i], z[i]]);
            met |= inside;
            if inside || places.code[i] != 0 {
                found.push((places.objects[i], places.code[i] != 0));
            }
        }
        met
    }
}

/// Motions of a cone. Columns: number of frames and s from one to the next; then start and change a
/// frame of the observer (km), of the axis from +x (rad), of half the cone's angle (rad); margin,
/// km.
const MOTIONS: [[f64; 9]; 11] = [
    [300.0, 0.5, 7000.0, 0.0, 0.4, 0.0, 0.3, 0.0, 1.0],
    [600.0, 0.5, 7000.0, 0.0, 0.4, 0.0, 0.1, 0.0, 94.0],
    // The observer alone, while time stands still.
    [300.0, 0.0, 7000.0, 15.0, 0.4, 0.0, 0.3, 0.0, 1.0],
    [300.0, 0.5, 42_000.0, -3.0, 0.4, 0.0, 0.1, 0.0, 1.0],
    // A slow turn, a fast one, leaps.
    [300.0, 0.0, 7000.0, 0.0, 1.0, 1e-3, 0.3, 0.0, 1.0],
    [100.0, 0.5, 7000.0, 0.0, 1.0, 0.03, 0.3, 0.0, 1.0],
    [30.0, 0.5, 7000.0, 0.0, 0.0, 2.1, 0.3, 0.0, 1.0],
    // The cone opens beyond a half space, and closes again.
    [300.0, 0.0, 7000.0, 0.0, 0.4, 0.0, 0.1, 0.01, 1.0],
    [300.0, -0.5, 7000.0, 0.0, 0.4, 0.0, 3.1, -0.01, 1.0],
    // As long as a segment holds, and longer.
    [50.0, 9.0, 7000.0, 0.0, 0.4, 0.0, 0.3, 0.0, 1.0],
    [300.0, 0.5, 7000.0, 0.0, 0.4, 0.0, 0.3, 0.0, 1.0],
];

/// Those who are low, and brake so much that they come down one after another, from a day after their epoch on.
fn decaying() -> impl Iterator<Item = Elements> {
    let set = |i: u32, drag: f64| Elements {
        norad: i,
        epoch: samples::epoch() - Unit::Day * 1,
        inclination: 1.0,
        node: f64::from(i),
        eccentricity: 0.001,
        perigee: 1.0,
        mean_anomaly: f64::from(i) * 0.7,
        // 16 a day
        mean_motion: 0.0698,
        drag,
    };
    (0..100).map(move |i| {
        let minutes = 1440.0 + f64::from(i) / 6.0;
        let (mut stays, mut falls) = (0.0, 0.1);
        for _ in 0..40 {
            let mid = (stays + falls) / 2.0;
            match set(i, mid).state_teme_after(minutes) {
                Ok(_) => stays = mid,
                Err(_) => falls = mid,
            }
        }
        set(i, falls)
    })
}

/// A moving cone finds the same objects as when all objects are evaluated in each frame.
#[test]
fn nobody_comes_into_a_cone_unseen() {
    let sets: Vec<Elements> = sets(4000).into_iter().chain(decaying()).collect();
    let (mut tracks, mut exact) = (Tracks::new(&sets).unwrap(), Tracks::new(&sets).unwrap());
    exact.exact = true;
    let (mut t, mut shown, mut all) = (samples::epoch(), 0, 0);
    let (mut inside, mut failed) = (BTreeSet::new(), BTreeSet::new());
    let (mut first, mut failed_at_first) = (true, BTreeSet::new());
    let frames = MOTIONS
        .iter()
        .flat_map(|motion| (0..motion[0] as usize).map(move |i| (motion, i)));
    for (
        [
            _,
            step_s,
            place,
            moved,
            axis,
            turned,
            angle,
            opened,
            path_km,
        ],
        frame,
    ) in frames
    {
        t += Unit::Second * *step_s;
        let now = |start: &f64, change: &f64| start + change * frame as f64;
        let (sin, cos) = now(axis, turned).sin_cos();
        let within = |path_km: f64| Within {
            cone: Cone::new(
                [0.0, now(place, moved), 500.0],
                [cos, sin, 0.0],
                now(angle, opened),
                path_km,
            ),
            shown: AtomicUsize::new(0),
        };
        let find = |tracks: &mut Tracks, look: &Within| -> BTreeSet<(u32, bool)> {
            tracks.at(t, look).into_iter().collect()
        };
        let ours = within(*path_km);
        let found = find(&mut tracks, &ours);
        // An object may count as either where tracks and SGP4 put it on two sides of the surface.
        let some = find(&mut exact, &within(path_km - BOUND_KM));
        let more = find(&mut exact, &within(path_km + BOUND_KM));
        assert!(some.is_subset(&found), "{t} {frame}: {:?}", &some - &found);
        assert!(found.is_subset(&more), "{t} {frame}: {:?}", &found - &more);
        shown += ours.shown.into_inner();
        all += sets.len().div_ceil(BLOCK);
        for (object, has_failed) in found {
            match has_failed {
                true if first => failed_at_first.insert(object),
                true => failed.insert(object),
                false => inside.insert(object),
            };
        }
        first = false;
    }
    let came_down = failed.difference(&failed_at_first).count();
    let met = inside.len();
    println!("{shown} of {all} blocks shown; {met} objects met, {came_down} came down");
    assert!(came_down > 20, "{came_down}");
    assert!(2 * shown < all && met > 1000);
}
