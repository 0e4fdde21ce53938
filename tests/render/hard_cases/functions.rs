//! Public functions of real numbers, with non-finite and extreme arguments. They return within a
//! bounded time and without a panic. Light is never negative; where it is not a number, the
//! function's documentation states it. Rows: `sky_functions`, `camera_functions`. Files, states,
//! lenses, lights and shadows: `entrances`. Whole frames under such settings: `settings`.
//!
//! Left out, because they only get values made by the tested functions: `plan`, `render`, `label`,
//! `effect` and most of `scene`, which take a `View` or a `Scene`; `measure`, `stats`, `cli`;
//! `output` except plots; and the loops of `kernels`, called by the footprints. Orbits have their
//! own tests (`src/orbit/tests`).

use nalgebra::Vector3;
use std::panic::{RefUnwindSafe, catch_unwind};
use std::time::Duration;

/// Non-finite numbers, zeros, negative numbers, the largest and the smallest, and an angle above
/// pi.
pub const EDGES: [f64; 13] = [
    NAN, INFINITE, -INFINITE, 0.0, -0.0, -1.0, 4.0, 1e300, -1e300, MAX, 1e-300, 5e-324, -1e-9,
];
const NAN: f64 = f64::NAN;
const INFINITE: f64 = f64::INFINITY;
const MAX: f64 = f64::MAX;

/// Time limit for all values of one row. They take milliseconds, or seconds on a slow machine.
const BOUND: Duration = Duration::from_secs(30);

/// Permitted results.
#[derive(Clone, Copy, PartialEq)]
pub enum Permitted {
    /// A non-negative number, possibly infinite.
    Light,
    /// The same or, as documented, NaN.
    LightOrNone,
    /// Finite numbers.
    Finite,
    /// Anything: the function returns.
    Anything,
}

pub type Row = (&'static str, Permitted, fn(f64) -> Vec<f64>);

/// Fails with every row that does not return, panics, or gives a result that is not permitted.
pub fn check(rows: &[Row]) {
    let wrong: Vec<String> = rows
        .iter()
        .filter_map(|&(name, gives, of)| fault(name, gives, of))
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The fault of the results of `of`, run in a thread of its own.
pub fn fault(
    name: &'static str,
    gives: Permitted,
    of: impl Fn(f64) -> Vec<f64> + RefUnwindSafe + Send + 'static,
) -> Option<String> {
    let (done, waits) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let wrong = EDGES.into_iter().find_map(|bad| {
            let Ok(values) = catch_unwind(|| of(bad)) else {
                return Some(format!("{name}: {bad:e} panics"));
            };
            let is_wrong = |value: &f64| match gives {
                Permitted::Light => value.is_nan() || *value < 0.0,
                Permitted::LightOrNone => *value < 0.0,
                Permitted::Finite => !value.is_finite(),
                Permitted::Anything => false,
            };
            let value = values.into_iter().find(is_wrong)?;
            Some(format!("{name}: {bad:e} gives {value:e}"))
        });
        // After a timeout the receiver is gone.
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
