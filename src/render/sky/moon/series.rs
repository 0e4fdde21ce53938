//! Position of the Moon: SOFA's `moon98` (Meeus 1998, the 60 largest terms of ELP 2000-82 in each
//! coordinate) and the largest of the omitted terms.
//!
//! Over 1991 to 2060 `moon98` alone differs from JPL DE440 by up to 17.7 arcsec (rms 2.9). With the
//! terms below it is 7.9 arcsec (rms 1.6), and 13 km in distance, over 10,789 epochs.
//!
//! Reference: ELP/MPP02 (Chapront & Francou 2003, A&A 404, 735), amplitudes, phases and rates of
//! the series in longitude and latitude that are constant in time, with the constants fitted to
//! DE405, as npm `astronomia` 4.2.0 lists them (`elpMppDeFull.js`). The selected terms have at
//! least 0.25 arcsec and appear fully in the difference of `moon98` and DE440
//! (`tests/reference/moon_terms.py`).

use std::f64::consts::PI;

use hifitime::Epoch;
use nalgebra::Vector3;

use crate::sky::constants::{AU_M, DAY_S, J2000_JD, tt_days_since_j2000};
use crate::sky::ecliptic;

const ARCSEC: f64 = PI / 648_000.0;
const DAYS_PER_CENTURY: f64 = 36_525.0;

/// Terms in ecliptic longitude: amplitude (arcsec), phase at J2000.0 (rad), rate (rad a Julian
/// century).
const LONGITUDE: [[f64; 3]; 46] = [
    [0.990, 0.3003, 40738.3780],
    [0.948, 0.9747, -17772.0114],
    [0.876, 1.8692, -0.3523],
    [0.822, 4.5644, 393.0210],
    [0.752, 0.2724, 22614.8418],
    [0.669, 2.3150, -24357.7723],
    [0.644, 2.8844, 8393.1258],
    [0.639, 1.1754, 575.3385],
    [0.635, 2.6872, 23385.1191],
    [0.584, 0.4848, 24428.7600],
    [0.583, 5.0842, -9095.5552],
    [0.572, 1.3470, 29970.8800],
    [0.561, 5.5716, -17981.5609],
    [0.557, 2.1000, 7143.0752],
    [0.546, 3.8819, 25614.3762],
    [0.536, 5.8000, 15752.3038],
    [0.493, 4.8868, -8294.9344],
    [0.491, 3.3147, 8362.4485],
    [0.478, 3.3734, -10071.6219],
    [0.454, 2.4275, 15333.2048],
    [0.426, 1.9155, 23452.6932],
    [0.420, 0.2284, 33733.8646],
    [0.413, 3.2127, 17495.2343],
    [0.404, 3.0290, 23314.1314],
    [0.395, 3.7025, 38299.5714],
    [0.382, 4.2711, 31781.3846],
    [0.375, 0.1150, 6376.2114],
    [0.361, 5.4383, 16833.1753],
    [0.358, 0.3317, 15056.4277],
    [0.350, 0.4442, -8257.7037],
    [0.344, 5.8034, 157.7344],
    [0.340, 4.2431, 13657.8484],
    [0.329, 0.8977, 41853.0066],
    [0.309, 5.9582, 21500.2132],
    [0.302, 2.8489, 786.0419],
    [0.302, 0.6287, -24567.3218],
    [0.301, 2.6161, 5889.8848],
    [0.294, 5.7721, -2371.2325],
    [0.293, 5.2746, 21642.1886],
    [0.290, 5.6401, 32828.4391],
    [0.289, 5.0428, 31713.8105],
    [0.283, 4.3430, 38785.8980],
    [0.274, 0.6303, 15613.7420],
    [0.263, 5.5682, 25823.9257],
    [0.254, 2.1711, 24638.3095],
    [0.253, 2.9148, 6447.1991],
];

/// Terms in ecliptic latitude, with the same columns.
const LATITUDE: [[f64; 3]; 13] = [
    [0.352, 4.5427, 14880.6653],
    [0.339, 1.2598, 30561.9814],
    [0.329, 3.1577, -18086.3356],
    [0.326, 2.5870, 8467.2232],
    [0.315, 3.4724, 14390.9251],
    [0.313, 6.1817, 8852.2186],
    [0.305, 2.1872, 6551.9739],
    [0.301, 0.0153, -7595.6147],
    [0.299, 3.4450, 7143.0452],
    [0.291, 4.7272, -1428.9528],
    [0.269, 0.2165, -2476.0072],
    [0.263, 4.7669, 41748.2319],
    [0.254, 4.9582, -1009.8538],
];

/// Geocentric position (m) and velocity (m/s) of the Moon's centre at `t`, geometric, GCRF. Takes
/// some 5 microseconds.
pub(crate) fn state(t: Epoch) -> (Vector3<f64>, Vector3<f64>) {
    let days = tt_days_since_j2000(t);
    let [position, velocity] = sofars::eph::moon98(J2000_JD, days).map(|v| Vector3::from(v) * AU_M);

    // A rotation by the small angles dl cos(b) along the ecliptic and db toward its pole:
    //     r' = r + dl (k x r) + db |r| (k - (k . u) u) / cos(b)
    // The ecliptic of J2000.0 replaces that of date: 47 arcsec per century, which is negligible for
    // angles of 10 arcsec.
    let centuries = days / DAYS_PER_CENTURY;
    let (distance, k) = (position.norm(), ecliptic::POLE);
    let u = position / distance;
    let (along, up) = (k.cross(&u), k - u * k.dot(&u));
    let turned = along * sum(&LONGITUDE, centuries) + up * (sum(&LATITUDE, centuries) / up.norm());
    (position + turned * distance, velocity / DAY_S)
}

/// Sum of `a sin(phase + rate T)` over `terms`, `T` in Julian centuries; rad.
fn sum(terms: &[[f64; 3]], centuries: f64) -> f64 {
    let term = |[a, phase, rate]: &[f64; 3]| a * libm::sin(phase + rate * centuries);
    terms.iter().map(term).sum::<f64>() * ARCSEC
}
