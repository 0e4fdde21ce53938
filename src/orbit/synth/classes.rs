//! The classes of synthetic objects: shares, orbits and sizes.
//!
//! Shares follow the catalogue of 2026, some 33,000 objects. Counts of high orbits, which change
//! little, are from the public catalogue of 7 September 2023, with few additions. It has 25,587
//! sets: 4,050 deep-space, of these 1,518 in the geostationary belt, 381 on half-day orbits, 1,942
//! with eccentricities from 0.25 on. Starlink has grown from 4,621 to 9,400, other low objects from
//! 16,207 to 18,700. So 12.3 % are deep-space and 6.3 % have eccentricities from 0.25 on (15.8 and
//! 8.0 in 2023, 20.7 and 10.8 in June 2019). Orbits and B* follow medians and quartiles of 2023 by
//! shell. Local times of nodes follow its 1,678 Sun-synchronous payloads below 650 km. Sizes of
//! fragments follow Johnson et al. 2001 (Adv. Space Res. 28(9), 1377), Eq. (2); those of whole
//! bodies are published dimensions, rounded.

/// A class of objects.
#[derive(Debug, PartialEq)]
pub struct Class {
    /// Name of the class.
    pub name: &'static str,
    /// Objects per thousand.
    pub share: f64,
    /// Size and shape of the orbits.
    pub(super) orbit: Orbit,
    /// Inclinations.
    pub(super) inclination: Inclination,
    /// Drag terms B*.
    pub(super) drag: Drag,
    /// Diameters.
    pub(super) size: Size,
}

/// Size and shape of orbits. Heights are above SGP4's radius of the Earth, km.
#[derive(Debug, PartialEq)]
pub(super) enum Orbit {
    /// Near-circular: the mean height, uniform; the eccentricity, log-normal: median and sigma.
    Round([f64; 2], (f64, f64)),
    /// Eccentric: the semi-major axis (km) and the height of the perigee, uniform.
    Long([f64; 2], [f64; 2]),
}

/// Inclinations, deg.
#[derive(Debug, PartialEq)]
pub(super) enum Inclination {
    /// Weighted normal bands: weight, mean, sigma. Never below 0.
    Bands(&'static [(f64, f64, f64)]),
    /// Normal about that of a circular Sun-synchronous orbit: sigma; local mean solar times (h) of
    /// the ascending node, in weighted bands, or empty for any time.
    SunSynchronous(f64, &'static [(f64, f64, f64)]),
    /// A geostationary orbit without station keeping: its pole precesses about that of the Laplace
    /// plane.
    Abandoned,
}

/// B*, 1/Earth radii.
#[derive(Debug, PartialEq)]
pub(super) enum Drag {
    /// None, as for most high orbits.
    None,
    /// Log-normal: median and sigma; the negative share (0 to 1), from manoeuvres and bad fits.
    Of((f64, f64), f64),
}

/// Diameters, m.
#[derive(Debug, PartialEq)]
pub(super) enum Size {
    /// Log-normal: median and sigma.
    Whole(f64, f64),
    /// Fragments above the least size: `N(> d) ~ d^-1.6` (Johnson et al. 2001, Eq. (2)); half are
    /// below 1.54 times the least.
    Fragments(f64),
}

/// Least fragment near the Earth, m: half are then below 10.8 cm.
const NEAR_M: f64 = 0.07;
/// Least fragment far from the Earth, where catalogues are less complete, m.
const FAR_M: f64 = 0.3;

/// Local times of nodes: mid-morning, early afternoon and the terminator, ascending or descending.
const NODES_H: &[(f64, f64, f64)] = &[
    (50.0, 22.0, 0.7),
    (12.0, 10.5, 0.5),
    (17.0, 1.5, 0.6),
    (6.0, 14.0, 0.6),
    (6.0, 6.0, 0.3),
    (9.0, 18.0, 0.4),
];

const fn bands(list: &'static [(f64, f64, f64)]) -> Inclination {
    Inclination::Bands(list)
}

const fn class(
    name: &'static str,
    share: f64,
    orbit: Orbit,
    inclination: Inclination,
    drag: Drag,
    size: Size,
) -> Class {
    Class {
        name,
        share,
        orbit,
        inclination,
        drag,
        size,
    }
}

use Drag::{None as NoDrag, Of};
use Inclination::{Abandoned, SunSynchronous};
use Orbit::{Long, Round};
use Size::{Fragments, Whole};

/// All classes. The sum of their shares is 1000, of which 123 are deep-space (periods from 225 min
/// on).
#[rustfmt::skip]
pub const CLASSES: &[Class] = &[
    // Near the Earth: constellations.
    class("STARLINK-53", 155.0, Round([540.0, 560.0], (1.4e-4, 0.25)), bands(&[(1.0, 53.1, 0.07)]), Of((3e-4, 0.9), 0.15), Whole(3.0, 0.2)),
    class("STARLINK-43", 80.0, Round([540.0, 560.0], (1.4e-4, 0.25)), bands(&[(1.0, 43.0, 0.02)]), Of((3e-4, 0.9), 0.15), Whole(3.0, 0.2)),
    class("STARLINK-70", 22.0, Round([565.0, 572.0], (1.4e-4, 0.25)), bands(&[(1.0, 70.0, 0.02)]), Of((3e-4, 0.9), 0.15), Whole(3.0, 0.2)),
    class("STARLINK-98", 28.0, Round([555.0, 565.0], (1.4e-4, 0.25)), bands(&[(1.0, 97.6, 0.03)]), Of((3e-4, 0.9), 0.15), Whole(3.0, 0.2)),
    class("ONEWEB", 20.0, Round([1190.0, 1225.0], (2e-4, 0.3)), bands(&[(1.0, 87.9, 0.03)]), Of((2e-4, 0.8), 0.3), Whole(1.3, 0.1)),
    // Other payloads, rocket bodies.
    class("SSO-PAYLOAD", 86.0, Round([450.0, 620.0], (1.2e-3, 0.8)), SunSynchronous(0.1, NODES_H), Of((4.5e-4, 0.8), 0.02), Whole(0.8, 0.9)),
    class("LEO-PAYLOAD", 44.0, Round([480.0, 1450.0], (1.3e-3, 0.9)), bands(&[(3.0, 45.0, 8.0), (3.0, 51.6, 0.1), (2.0, 74.0, 0.5), (2.0, 86.4, 0.1)]), Of((2e-4, 1.0), 0.1), Whole(1.2, 0.7)),
    class("LEO-ROCKET", 40.0, Round([560.0, 1050.0], (4e-3, 0.9)), bands(&[(4.0, 82.9, 0.3), (3.0, 74.0, 0.3), (3.0, 98.0, 0.6), (1.0, 65.8, 0.5)]), Of((1.5e-4, 1.0), 0.05), Whole(3.5, 0.4)),
    // Debris, by height.
    class("SSO-DEBRIS", 167.0, Round([700.0, 900.0], (5e-3, 0.9)), SunSynchronous(0.6, &[]), Of((8e-4, 1.4), 0.02), Fragments(NEAR_M)),
    class("LEO-DEBRIS", 98.0, Round([650.0, 1050.0], (5e-3, 0.9)), bands(&[(4.0, 74.0, 0.5), (3.0, 82.6, 0.6), (2.0, 65.0, 1.0), (1.0, 100.0, 1.5)]), Of((6e-4, 1.4), 0.03), Fragments(NEAR_M)),
    class("LEO-DEBRIS-1200", 36.0, Round([1050.0, 1400.0], (1e-2, 0.8)), bands(&[(3.0, 100.3, 0.8), (3.0, 90.0, 0.5), (2.0, 65.0, 1.0), (2.0, 82.0, 1.0)]), Of((7e-4, 1.4), 0.08), Fragments(NEAR_M)),
    class("LEO-DEBRIS-1450", 40.0, Round([1400.0, 1500.0], (4e-3, 0.9)), bands(&[(6.0, 82.6, 0.3), (2.0, 74.0, 0.2), (2.0, 101.5, 0.5)]), Of((2e-4, 1.5), 0.1), Fragments(NEAR_M)),
    // Low and decaying orbits.
    class("LEO-LOW", 24.0, Round([300.0, 450.0], (9e-4, 0.7)), bands(&[(6.0, 97.2, 0.5), (2.0, 51.6, 0.3), (1.0, 82.0, 1.0)]), Of((8e-4, 0.7), 0.0), Fragments(NEAR_M)),
    class("DECAYING", 8.0, Round([225.0, 300.0], (1.2e-3, 0.5)), bands(&[(6.0, 97.0, 0.5), (2.0, 51.6, 0.3), (1.0, 42.0, 1.0)]), Of((1e-3, 0.8), 0.0), Fragments(NEAR_M)),
    class("LOW-PERIGEE", 4.0, Long([6_650.0, 7_200.0], [125.0, 220.0]), bands(&[(1.0, 65.0, 2.0), (1.0, 51.6, 1.0), (1.0, 28.5, 1.0)]), Of((1e-4, 0.8), 0.0), Fragments(NEAR_M)),
    class("LEO-ECCENTRIC", 25.0, Long([7_800.0, 9_900.0], [350.0, 1_000.0]), bands(&[(4.0, 65.0, 1.5), (3.0, 51.0, 2.0), (2.0, 101.0, 1.0), (2.0, 25.0, 3.0)]), Of((7e-4, 1.5), 0.15), Fragments(NEAR_M)),
    // Deep space.
    class("GEO-ACTIVE", 18.0, Round([35_782.0, 35_790.0], (2.5e-4, 0.4)), bands(&[(1.0, 0.03, 0.02)]), NoDrag, Whole(4.0, 0.4)),
    class("GEO-DRIFTING", 30.0, Round([35_500.0, 36_200.0], (1e-3, 0.9)), Abandoned, NoDrag, Whole(3.5, 0.4)),
    class("GPS", 5.0, Round([20_160.0, 20_200.0], (8e-3, 0.5)), bands(&[(1.0, 55.2, 0.6)]), NoDrag, Whole(3.0, 0.3)),
    class("GLONASS", 4.0, Round([19_110.0, 19_150.0], (1.5e-3, 0.6)), bands(&[(1.0, 65.0, 0.7)]), NoDrag, Whole(2.5, 0.3)),
    class("GALILEO-BEIDOU", 3.0, Round([21_500.0, 23_250.0], (6e-4, 0.6)), bands(&[(1.0, 55.8, 0.8)]), NoDrag, Whole(2.5, 0.2)),
    class("MOLNIYA", 5.0, Long([26_500.0, 26_620.0], [700.0, 2_500.0]), bands(&[(1.0, 63.9, 0.8)]), NoDrag, Whole(3.0, 0.4)),
    class("GTO", 17.0, Long([24_200.0, 24_600.0], [190.0, 700.0]), bands(&[(4.0, 5.5, 1.0), (4.0, 26.0, 1.5), (2.0, 48.0, 1.0)]), Of((5e-4, 1.2), 0.1), Whole(3.0, 0.4)),
    class("O3B", 1.5, Round([8_050.0, 8_075.0], (2e-4, 0.5)), bands(&[(1.0, 0.05, 0.02)]), NoDrag, Whole(2.0, 0.2)),
    class("BELOW-GEO", 2.5, Round([33_300.0, 34_900.0], (9e-3, 0.9)), Abandoned, NoDrag, Whole(3.0, 0.4)),
    class("BEYOND-GEO", 2.0, Round([37_350.0, 39_500.0], (2e-2, 0.7)), Abandoned, NoDrag, Whole(3.5, 0.4)),
    class("HEO-DEBRIS", 21.0, Long([14_500.0, 23_500.0], [250.0, 1_500.0]), bands(&[(3.0, 6.0, 1.5), (3.0, 23.0, 2.0), (2.0, 48.0, 2.0), (2.0, 64.0, 2.0)]), Of((1e-3, 1.3), 0.1), Fragments(FAR_M)),
    class("HEO-HIGH", 13.0, Long([27_300.0, 29_500.0], [6_000.0, 9_500.0]), bands(&[(6.0, 12.5, 1.5), (2.0, 24.0, 2.5)]), NoDrag, Fragments(FAR_M)),
    class("FAR", 1.0, Long([60_000.0, 100_000.0], [2_000.0, 20_000.0]), bands(&[(2.0, 30.0, 8.0), (1.0, 66.0, 3.0)]), NoDrag, Whole(2.0, 0.5)),
];
