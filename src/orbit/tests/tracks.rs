//! Interpolated positions against SGP4, frame by frame.

use crate::support::{answers, distance, samples};
use hifitime::{Duration, Epoch, Unit};
use skyloop_orbit::cone::Cone;
use skyloop_orbit::elements::Elements;
use skyloop_orbit::sgp4_batch::{BLOCK, Batch, Level, NO_OBJECT, States};
use skyloop_orbit::synth::population;
use skyloop_orbit::tracks::{BOUND_KM, Look, Places, Tracks};
use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Position, TEME, km; or the failure code.
type Place = Result<[f64; 3], u8>;

/// Finds every object.
struct All(Cone);

impl Look for All {
    type Found = (usize, Place);

    fn cone(&self) -> &Cone {
        &self.0
    }

    fn look(&self, places: &Places<'_>, found: &mut Vec<Self::Found>) -> bool {
        for i in (0..BLOCK).filter(|i| places.objects[*i] != NO_OBJECT) {
            let place = match places.code[i] {
                0 => Ok([0, 1, 2].map(|axis| places.position_km[axis][i])),
                code => Err(code),
            };
            found.push((places.objects[i] as usize, place));
        }
        true
    }
}

/// The positions of all objects, in the order of the sets.
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

/// A realistic population, and every kind of orbit in SGP4. Orbits that pass the Earth's centre
/// within seconds are left out: failures between two instants of a segment are not detected.
fn sets(objects: usize) -> Vec<Elements> {
    let today = population(objects, 6, samples::epoch()).into_iter();
    // Their own epochs extend over half a century.
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

/// Computes positions at all times, and compares every `stride`th frame with SGP4.
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

/// `count` frames from `start` on, `step` s apart.
fn frames(start: Epoch, step: f64, count: usize) -> impl Iterator<Item = Epoch> {
    (0..count).map(move |i| start + Duration::from_seconds(i as f64 * step))
}

#[test]
fn all_objects_are_within_the_bound() {
    let sets = sets(1000);
    // Prime strides cover all phases of segments.
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
fn positions_after_jumps_in_time_are_within_the_bound() {
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
fn exact_positions_equal_those_of_sgp4_to_the_last_bit() {
    let sets = sets(500);
    let (mut tracks, mut batch) = (Tracks::new(&sets).unwrap(), Batch::new(&sets).unwrap());
    let mut states = States::default();
    // Exact frames, interpolated ones, and exact ones again.
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
fn a_step_of_the_resonance_integrator_makes_no_jump() {
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

/// Where the inclination passes 0.2 rad, the perturbation of node and perigee changes its form, and
/// SGP4's positions jump.
#[test]
fn segments_with_a_jump_of_sgp4_are_not_interpolated() {
    let epoch = samples::epoch();
    let mut jumps = 0;
    for i in 0..40 {
        let set = Elements {
            norad: i,
            epoch,
            inclination: 0.2 + (f64::from(i) - 20.0) * 5e-5,
            node: f64::from(i) * 0.31,
            eccentricity: 0.01,
            perigee: 1.0,
            mean_anomaly: 2.0,
            // One revolution a day.
            mean_motion: 0.004_375,
            drag: 0.0,
        };
        let Some(jump) = jump(&set) else {
            continue;
        };
        jumps += 1;
        // The same object in every slot of a block, and in a second one.
        hold(
            &[set; 9],
            frames(epoch + Unit::Minute * jump - Unit::Second * 30, 0.1, 600),
            1,
        );
    }
    println!("{jumps} jumps");
    assert!(jumps >= 5);
}

/// Minutes from the epoch to a jump of more than a metre within 2 s, in the first 20 days.
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
    // Short-period terms shift the passage by up to an hour.
    let steps = (0..9000).map(|step| near - 120.0 + f64::from(step) * STEP_MIN);
    steps.into_iter().find(|minutes| {
        let (a, b) = (state(*minutes), state(minutes + STEP_MIN));
        let path = (a.velocity_m_s + b.velocity_m_s) / 2.0 * STEP_MIN * 60.0;
        (b.position_m - a.position_m - path).norm() > 1.0
    })
}

/// Finds objects that are in a cone or have no position, and counts the searched blocks.
struct Within {
    cone: Cone,
    searched: AtomicUsize,
}

impl Look for Within {
    type Found = (u32, bool);

    fn cone(&self) -> &Cone {
        &self.cone
    }

    fn look(&self, places: &Places<'_>, found: &mut Vec<Self::Found>) -> bool {
        self.searched.fetch_add(1, Ordering::Relaxed);
        let [x, y, z] = &places.position_km;
        let mut any_inside = false;
        for i in (0..BLOCK).filter(|i| places.objects[*i] != NO_OBJECT) {
            let inside = self.cone.holds([x[i], y[i], z[i]]);
            any_inside |= inside;
            if inside || places.code[i] != 0 {
                found.push((places.objects[i], places.code[i] != 0));
            }
        }
        any_inside
    }
}

/// Motions of a cone. Columns: number of frames and their distance in s; then start and change per
/// frame of the observer (km), of the axis from +x (rad), of half the cone's angle (rad); margin,
/// km.
const MOTIONS: [[f64; 9]; 11] = [
    [300.0, 0.5, 7000.0, 0.0, 0.4, 0.0, 0.3, 0.0, 1.0],
    [600.0, 0.5, 7000.0, 0.0, 0.4, 0.0, 0.1, 0.0, 94.0],
    // The observer moves at constant time.
    [300.0, 0.0, 7000.0, 15.0, 0.4, 0.0, 0.3, 0.0, 1.0],
    [300.0, 0.5, 42_000.0, -3.0, 0.4, 0.0, 0.1, 0.0, 1.0],
    // A slow rotation, a fast one, jumps.
    [300.0, 0.0, 7000.0, 0.0, 1.0, 1e-3, 0.3, 0.0, 1.0],
    [100.0, 0.5, 7000.0, 0.0, 1.0, 0.03, 0.3, 0.0, 1.0],
    [30.0, 0.5, 7000.0, 0.0, 0.0, 2.1, 0.3, 0.0, 1.0],
    // The cone opens beyond a half space, and closes again.
    [300.0, 0.0, 7000.0, 0.0, 0.4, 0.0, 0.1, 0.01, 1.0],
    [300.0, -0.5, 7000.0, 0.0, 0.4, 0.0, 3.1, -0.01, 1.0],
    // Steps near the length of a segment.
    [50.0, 9.0, 7000.0, 0.0, 0.4, 0.0, 0.3, 0.0, 1.0],
    [300.0, 0.5, 7000.0, 0.0, 0.4, 0.0, 0.3, 0.0, 1.0],
];

/// Low objects with so much drag that they decay one after another, from a day after their epoch
/// on.
fn decaying() -> impl Iterator<Item = Elements> {
    let set = |i: u32, drag: f64| Elements {
        norad: i,
        epoch: samples::epoch() - Unit::Day * 1,
        inclination: 1.0,
        node: f64::from(i),
        eccentricity: 0.001,
        perigee: 1.0,
        mean_anomaly: f64::from(i) * 0.7,
        // 16 revolutions a day.
        mean_motion: 0.0698,
        drag,
    };
    (0..100).map(move |i| {
        let minutes = 1440.0 + f64::from(i) / 6.0;
        let (mut flying, mut decayed) = (0.0, 0.1);
        for _ in 0..40 {
            let mid = (flying + decayed) / 2.0;
            match set(i, mid).state_teme_after(minutes) {
                Ok(_) => flying = mid,
                Err(_) => decayed = mid,
            }
        }
        set(i, decayed)
    })
}

/// A moving cone finds the same objects as when all objects are evaluated in each frame.
#[test]
fn a_moving_cone_misses_no_object() {
    let sets: Vec<Elements> = sets(4000).into_iter().chain(decaying()).collect();
    let (mut tracks, mut exact) = (Tracks::new(&sets).unwrap(), Tracks::new(&sets).unwrap());
    exact.exact = true;
    let (mut t, mut searched, mut all) = (samples::epoch(), 0, 0);
    let (mut inside, mut failed) = (BTreeSet::new(), BTreeSet::new());
    let (mut first, mut failed_at_first) = (true, BTreeSet::new());
    let frames = MOTIONS
        .iter()
        .flat_map(|motion| (0..motion[0] as usize).map(move |i| (motion, i)));
    for (
        [
            _,
            step_s,
            start_km,
            moved,
            axis,
            turned,
            angle,
            opened,
            margin_km,
        ],
        frame,
    ) in frames
    {
        t += Unit::Second * *step_s;
        let now = |start: &f64, change: &f64| start + change * frame as f64;
        let (sin, cos) = now(axis, turned).sin_cos();
        let within = |margin_km: f64| Within {
            cone: Cone::new(
                [0.0, now(start_km, moved), 500.0],
                [cos, sin, 0.0],
                now(angle, opened),
                margin_km,
            ),
            searched: AtomicUsize::new(0),
        };
        let find = |tracks: &mut Tracks, look: &Within| -> BTreeSet<(u32, bool)> {
            tracks.at(t, look).into_iter().collect()
        };
        let ours = within(*margin_km);
        let found = find(&mut tracks, &ours);
        // Near the surface tracks and SGP4 may differ, up to the bound.
        let some = find(&mut exact, &within(margin_km - BOUND_KM));
        let more = find(&mut exact, &within(margin_km + BOUND_KM));
        assert!(some.is_subset(&found), "{t} {frame}: {:?}", &some - &found);
        assert!(found.is_subset(&more), "{t} {frame}: {:?}", &found - &more);
        searched += ours.searched.into_inner();
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
    let decayed = failed.difference(&failed_at_first).count();
    let entered = inside.len();
    println!("{searched} of {all} blocks searched; {entered} objects found, {decayed} decayed");
    assert!(decayed > 20, "{decayed}");
    assert!(2 * searched < all && entered > 1000);
}
