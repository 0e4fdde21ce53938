//! Times of frames against their limits: the statistics of `skyloop bench frame`, and noise against
//! `rand_distr`.
//!
//! `cargo bench --bench frame`, on a quiet machine. Exits with 1 where a limit is not met.

mod support;

use rand::SeedableRng;
use rand::rngs::SmallRng;
use rand_distr::{Distribution, Normal, Poisson};
use skyloop::measure::Row;
use skyloop::measure::frames::{CONVERTER, READ_E, Report, noise};
use skyloop::orbit::sgp4_batch::Level;

fn main() -> std::process::ExitCode {
    support::report::<Report>(&[against_rand_distr()])
}

/// Noise with the best vector instructions, against a Poisson and a normal draw of `rand_distr` per
/// pixel.
fn against_rand_distr() -> Row {
    let mut random = SmallRng::seed_from_u64(1);
    let against = "rand_distr, a pixel at a time";
    noise(Level::best(), against, Some(10.0), |_, light, dn| {
        for (dn, mean) in dn.iter_mut().zip(light) {
            let shot = Poisson::new(f64::from(*mean)).map_or(0.0, |it| it.sample(&mut random));
            let read = Normal::new(0.0, f64::from(READ_E));
            let read = read.map_or(0.0, |it| it.sample(&mut random));
            *dn = CONVERTER.dn((shot + read) as f32);
        }
    })
}
