//! Extreme numbers: each case with an independent reference (a closed form, mpmath's digits,
//! another library's numbers) and a stated tolerance. Cases of other files are not repeated here:
//!
//! | case | tested in |
//! |---|---|
//! | celestial poles, wrap of right ascension, boresight at +-Z | `pointing`; star groups around both poles: `src/render/sky/star_field.rs` |
//! | half turns, signs of quaternions, slerp near 0 and near pi | `pointing` |
//! | behind the camera, 90 deg off axis, last pixel's edge, straddling bands and corners | `field`; tracks that go behind the camera: `src/render/track/mod.rs` |
//! | fields of 0.1 to 180 deg | `field`; cones and corners: `tests/physics/optics/projection.rs`, wide fields that turn: `tests/render/truth/smear.rs` |
//! | rates from 0 through 1e-12 to 100 deg/s | `motion`; every length of a streak against integration: `tests/render/truth/smear.rs` |
//! | exposures of 0, 1e-9 and 10^4 s, ends below a nanosecond | `motion` |
//! | phase angle 0 and pi | `brightness` |
//! | object at 1 m, at the sensor's own position, at 10^6 km | `near`; at the observer's place without direction: `tests/physics/apparent.rs`, nearer than its own path: `tests/physics/rso/close.rs` |
//! | magnitudes -30 to +40 | `brightness` |
//! | PSF sigma 0.01 to 100 px | `brightness`; other profiles against GalSim and integration: `tests/physics/optics/psf.rs` |
//! | the costliest exposures, turns, spreads and particles under a limit of work | `work` |
//! | Poisson means 0 to 10^9 | all words: `src/base/tests`; digits against theory: `tests/physics/noise.rs` |
//! | full well, converter and 16-bit saturation | `charge`; with noise: `tests/physics/noise.rs`, blooming: `tests/physics/detector` |
//! | grazing penumbra | `near`; against rays on the ellipsoid, contact: `tests/physics/shadow.rs` |
//! | leap seconds, years 1950 to 2100 | `time`; a century of SGP4: `src/orbit/tests/batch_edges.rs`; epochs beyond the series: `tests/physics/apparent.rs` |
//! | 10^7 steps of clock and attitude | `time`, `pointing` |
//! | distortion's inverse near its fold | `field`; everywhere else: `src/render/camera/projection.rs`, against OpenCV: `tests/physics/optics/projection.rs` |
//! | accumulation order over 10^6 sources | `brightness` |
//! | NaN and infinity: cameras, scenes, states, lenses, tracks, shadows, orbits, searches | `entrances` |
//! | the same: every other public function of real numbers, with what is left out and why | `functions` |
//! | the same: settings that callers make and files refuse | `settings`; the wall clock: `src/live/serve/clock.rs`, points of streaks: `src/render/track/rule.rs` |
//! | the same: commands on the wire | `tests/wire/bad_packets.rs`, `live/wall_clock.rs`; any bytes: `protocols/tests/fuzz` |
//! | the same: element sets, OMM and OEM | `src/orbit/tests/` (`element_files`, `omm_files`, `ephemeris_messages`) |
//! | the same: populations, attitude lists, the command line | `tests/physics/rso/population.rs`, `firmware-sim/src/attitude_list.rs`, `tests/cli/inputs.rs` |
//! | properties of random scenes | `properties`, labels' centroids: `centroids`; those of the whole sky, area light and objects too: `whole_sky` |

mod brightness;
mod camera_functions;
mod centroids;
mod charge;
mod entrances;
mod field;
mod functions;
mod motion;
mod near;
mod pointing;
mod properties;
mod settings;
mod sky_functions;
mod stage;
mod time;
mod whole_sky;
mod work;
