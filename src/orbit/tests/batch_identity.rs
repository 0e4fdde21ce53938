//! The batch's results are the same to the last bit for any number of threads, any instructions,
//! any other objects in the batch, and any earlier call.

use crate::support::{Answer, answers, samples};
use skyloop_orbit::elements::Elements;
use skyloop_orbit::sgp4_batch::{Batch, Level, States};

/// Minutes after the epochs: small and large, of both signs.
const MINUTES: [f64; 8] = [
    0.0, 700.0, -730.0, 10_000.0, -43_200.0, 525_600.0, -525_600.0, 5.2e6,
];

/// All sets of the tests: every kind of orbit, also failures.
fn sets() -> Vec<Elements> {
    let cases = samples::verification().into_iter().map(|case| case.set);
    let synthetic = samples::synthetic().into_iter().map(|one| one.set);
    cases.chain(synthetic).collect()
}

/// Bits of a state, so that even zeros of both signs differ.
fn bits(answer: &Answer) -> Result<[u64; 6], u8> {
    answer.map(|(p, v)| [p[0], p[1], p[2], v[0], v[1], v[2]].map(f64::to_bits))
}

fn after(batch: &mut Batch, minutes: f64) -> Vec<Result<[u64; 6], u8>> {
    let mut states = States::default();
    batch.propagate_after(minutes, &mut states);
    answers(batch, &states).iter().map(bits).collect()
}

/// The expected bits: portable instructions, and a new batch.
fn reference(minutes: f64) -> Vec<Result<[u64; 6], u8>> {
    let mut batch = Batch::new(&sets()).unwrap();
    batch.set_level(Level::Portable);
    after(&mut batch, minutes)
}

#[test]
fn every_level_on_any_number_of_threads_gives_the_same_bits() {
    let levels = Level::available();
    println!("levels of this processor: {levels:?}");
    assert!(levels.contains(&Level::Portable));
    let batch = Batch::new(&sets()).unwrap();
    for minutes in MINUTES {
        let expected = reference(minutes);
        assert!(expected.iter().filter(|answer| answer.is_ok()).count() > 100);
        for level in &levels {
            for threads in [1, 2, 4] {
                let mut batch = batch.clone();
                batch.set_level(*level);
                assert_eq!(batch.level(), *level);
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
                let found = pool.build().unwrap().install(|| after(&mut batch, minutes));
                assert!(
                    found == expected,
                    "{level} on {threads} threads at {minutes} min"
                );
            }
        }
    }
}

#[test]
fn an_object_does_not_depend_on_the_rest_of_the_batch() {
    let sets = sets();
    for minutes in [700.0, -43_200.0] {
        let expected = reference(minutes);
        for level in Level::available() {
            // One object in the batch.
            for (set, expected) in sets.iter().zip(&expected) {
                let mut batch = Batch::new(&[*set]).unwrap();
                batch.set_level(level);
                assert_eq!(
                    after(&mut batch, minutes),
                    [*expected],
                    "{set:?} at {minutes} min"
                );
            }
            // Other orders; no step has a common divisor with the number of sets.
            for step in [1, 7, 101, 397].map(|step| coprime(step, sets.len())) {
                let order: Vec<usize> = (0..sets.len())
                    .map(|i| (i * step + 5) % sets.len())
                    .collect();
                let shuffled: Vec<Elements> = order.iter().map(|i| sets[*i]).collect();
                let mut batch = Batch::new(&shuffled).unwrap();
                batch.set_level(level);
                let found = after(&mut batch, minutes);
                assert_eq!(found.len(), order.len());
                for (found, i) in found.into_iter().zip(order) {
                    assert_eq!(found, expected[i], "{:?} at {minutes} min", sets[i]);
                }
            }
        }
    }
}

/// A failing set in every other slot, one of each kind of failure.
#[test]
fn failures_do_not_change_other_objects() {
    let sets = sets();
    for minutes in [700.0, -43_200.0, 525_600.0] {
        let expected = reference(minutes);
        let valid: Vec<usize> = (0..sets.len()).filter(|i| expected[*i].is_ok()).collect();
        let failing = (0..sets.len()).filter(|i| expected[*i].is_err());
        let one_of_each = failing.fold(Vec::<usize>::new(), |mut kinds, i| {
            if kinds.iter().all(|k| expected[*k] != expected[i]) {
                kinds.push(i);
            }
            kinds
        });
        for bad in one_of_each {
            let order: Vec<usize> = valid.iter().flat_map(|i| [*i, bad]).collect();
            let mixed: Vec<Elements> = order.iter().map(|i| sets[*i]).collect();
            let found = after(&mut Batch::new(&mixed).unwrap(), minutes);
            assert_eq!(found.len(), order.len());
            for (found, i) in found.into_iter().zip(order) {
                assert_eq!(found, expected[i], "{:?} at {minutes} min", sets[i]);
            }
        }
    }
}

#[test]
fn earlier_calls_do_not_change_results() {
    let days = [
        0.0, 3.0, 2.5, -4.0, 30.0, 30.0, 0.1, -365.0, 365.0, -0.1, 1000.0, 1.0, -1000.0, 0.0,
    ];
    // As in a run: steps shorter than the integrator's, forward and back.
    let steps = (0..100).chain((0..100).rev());
    let minutes = days.into_iter().map(|day| day * 1440.0);
    let minutes = minutes.chain(steps.map(|step| f64::from(step) * 73.0 - 3000.0));

    let fresh = Batch::new(&sets()).unwrap();
    let mut used: Vec<Batch> = Vec::new();
    for level in Level::available() {
        used.push(fresh.clone());
        used.last_mut().unwrap().set_level(level);
    }
    for minutes in minutes {
        let expected = after(&mut fresh.clone(), minutes);
        for batch in &mut used {
            let found = after(batch, minutes);
            assert!(found == expected, "{} at {minutes} min", batch.level());
        }
    }
}

fn coprime(step: usize, of: usize) -> usize {
    let divisor = |mut a: usize, mut b: usize| {
        while b != 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    (step..).find(|step| divisor(*step, of) == 1).unwrap()
}

/// Objects one by one, at several instants each.
#[test]
fn single_objects_at_several_instants_equal_the_whole_batch() {
    let sets = sets();
    let t = hifitime::Epoch::from_gregorian_utc_at_midnight(2010, 6, 1);
    let instants = [0.0, -0.05, 0.05, 1e7, 3600.0].map(|s| t + hifitime::Unit::Second * s);
    for level in Level::available() {
        let mut batch = Batch::new(&sets).unwrap();
        batch.set_level(level);
        // Unordered, some twice, and one index without an object.
        let requested = (0..2 * sets.len()).map(|i| (i * 37) % (sets.len() + 1));
        let requested: Vec<usize> = requested.collect();
        let mut alone = Vec::new();
        batch.states_at(&requested, &instants, |states| alone.push(states));
        assert_eq!(alone.len(), requested.len());
        let mut states = States::default();
        let mut valid = 0;
        for (k, t) in instants.into_iter().enumerate() {
            batch.propagate(t, &mut states);
            for (object, alone) in requested.iter().zip(&alone) {
                assert_eq!(alone[k], states.get(*object), "{level} {object} {k}");
                assert_eq!(batch.state(*object, t), states.get(*object));
                valid += usize::from(alone[k].is_ok());
            }
        }
        assert!(valid > requested.len(), "{valid}");
    }
}
