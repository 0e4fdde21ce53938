//! Public functions that take real numbers, and numbers that are none or at their ends: they come back within a bounded time and without a panic; light is never negative, and where it is
//! no number the function's documentation says so. The rows: `sky_functions`, `camera_functions`. Files, states, lenses, lights and shadows: `entrances`; whole frames under such settings: `settings`.
//!
//! Left out, because nothing but what these have made reaches them: `plan`, `render`, `label`, `effect` and most of `scene`, which take a `View` or a `Scene`; `measure`, `stats`, `cli`, and of `output`
//! all but plots; the loops of `kernels`, which the footprints call. Orbits have tests of their own (`src/orbit/tests`).

use nalgebra::Vector3;
use std::panic::{RefUnwindSafe, catch_unwind};
use std::time::Duration;

/// No numbers, none at all and less than none, the greatest and the least, and an angle beyond pi.
pub const EDGES: [f64; 13] = [
    NAN, ENDLESS, -ENDLESS, 0.0, -0.0, -1.0, 4.0, 1e300, -1e300, MAX, 1e-300, 5e-324, -1e-9,
];
const NAN: f64 = f64::NAN;
const ENDLESS: f64 = f64::INFINITY;
const MAX: f64 = f64::MAX;

/// How long the values of one row may take together: all take milliseconds, of a slow machine's seconds.
const BOUND: Duration = Duration::from_secs(30);

/// What may come out.
#[derive(Clone, Copy, PartialEq)]
pub enum Gives {
    /// A number from 0 up, infinite perhaps.
    Light,
    /// That or, as documented, no number.
    LightOrNone,
    /// Finite numbers.
    Finite,
    /// Anything: it comes back.
    Anything,
}

pub type Row = (&'static str, Gives, fn(f64) -> Vec<f64>);

/// Fails with every row that does not come back, panics, or gives what it must not.
pub fn check(rows: &[Row]) {
    let wrong: Vec<String> = rows
        .iter()
        .filter_map(|&(name, gives, of)| fault(name, gives, of))
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// What is wrong with what `of` gives, tried in a thread of its own.
pub fn fault(
    name: &'static str,
    gives: Gives,
    of: impl Fn(f64) -> Vec<f64> + RefUnwindSafe + Send + 'static,
) -> Option<String> {
    let (done, waits) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let wrong = EDGES.into_iter().find_map(|bad| {
            let Ok(values) = catch_unwind(|| of(bad)) else {
                return Some(format!("{name}: {bad:e} panics"));
            };
            let is_wrong = |value: &f64| match gives {
                Gives::Light => value.is_nan() || *value < 0.0,
                Gives::LightOrNone => *value < 0.0,
                Gives::Finite => !value.is_finite(),
                Gives::Anything => false,
            };
            let value = values.into_iter().find(is_wrong)?;
            Some(format!("{name}: {bad:e} gives {value:e}"))
        });
        // Nobody waits any more where it took too long.
        let _ = done.send(wrong);
    });
    let late = |_| Some(format!("{name} takes more than {BOUND:?}"));
    waits.recv_timeout(BOUND).unwrap_or_else(late)
}

/// `good` with each of its components in turn, and all of them, replaced.
pub fn corrupted(good: Vector3<f64>, bad: f64) -> [Vector3<f64>; 4] {
    let with = |axis: usize| {
        let mut v = good;
        v[axis] = bad;
        v
    };
    [with(0), with(1), with(2), Vector3::repeat(bad)]
}
