//! The embedded catalogue against published values. No light is counted twice.

use crate::reference::{number, rows};
use skyloop::sky::catalog::{Catalog, Selection, Star};
use std::array;
use std::collections::BTreeSet;
use std::f64::consts::PI;

/// One milliarcsecond, rad.
const MAS: f64 = PI / 648_000_000.0;

fn hipparcos() -> Catalog {
    Catalog::embedded(Selection::Hipparcos)
}

fn direction(star: &Star) -> [f64; 3] {
    let ((sa, ca), (sd, cd)) = (star.ra_rad.sin_cos(), star.dec_rad.sin_cos());
    [cd * ca, cd * sa, sd]
}

/// The angle between two close stars, arcsec.
fn separation(a: &Star, b: &Star) -> f64 {
    let (a, b) = (direction(a), direction(b));
    let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    square.sqrt() / (1000.0 * MAS)
}

/// The combined magnitude of these stars.
fn magnitude<'a>(stars: impl Iterator<Item = &'a Star>) -> f64 {
    let light = stars.map(|star| 10f64.powf(-0.4 * star.v_mag));
    -2.5 * light.sum::<f64>().log10()
}

/// The combined magnitude of all stars within `radius` (arcsec) of `star`.
fn light_around(catalog: &Catalog, star: &Star, radius: f64) -> f64 {
    let stars = catalog.stars().iter();
    magnitude(stars.filter(|s| separation(s, star) <= radius))
}

/// The entry with this HR number, as its principal or as a further name.
fn hr(catalog: &Catalog, hr: u16) -> Star {
    let name = format!("HR {hr}");
    let mut stars = catalog.stars().iter();
    let found = stars.find(|star| catalog.names(star).contains(&name));
    *found.unwrap_or_else(|| panic!("{name}"))
}

fn hip(catalog: &Catalog, hip: u32) -> Star {
    let found = catalog.stars().iter().find(|star| star.hip == hip);
    *found.unwrap_or_else(|| panic!("HIP {hip}"))
}

#[track_caller]
fn near(found: f64, published: f64, within: f64, hip: u32) {
    let is_near = (found - published).abs() < within;
    assert!(is_near, "HIP {hip}: {found}, not {published}");
}

#[test]
fn catalogue_sizes_are_those_of_the_build() {
    let all = hipparcos();
    // Statistics printed by the building tool.
    assert_eq!(all.stars().len(), 78_367);
    assert_eq!(all.stars().iter().filter(|s| s.hip == 0).count(), 27);
    let bsc = Catalog::embedded(Selection::Bsc);
    assert_eq!(bsc.stars().len(), 9_025);
    assert!(bsc.stars().iter().all(|s| s.hr != 0));
}

#[test]
fn every_bright_star_is_found_in_both_selections() {
    for catalog in [hipparcos(), Catalog::embedded(Selection::Bsc)] {
        let mut numbers = BTreeSet::new();
        for star in catalog.stars() {
            for name in catalog.names(star) {
                let number = name.strip_prefix("HR ").map(|n| n.parse::<u16>().unwrap());
                assert!(number.is_none_or(|n| numbers.insert(n)), "{name} twice");
            }
        }
        // X-Val: the Bright Star Catalogue holds 9,110 objects, 14 of them novae, clusters,
        // galaxies.
        assert_eq!(numbers.len(), 9_096);
        assert_eq!(numbers.last(), Some(&9_110));
    }
}

#[test]
fn principal_numbers_are_unique_and_come_first() {
    let catalog = hipparcos();
    let mut hips = BTreeSet::new();
    for star in catalog.stars() {
        assert!(star.hip == 0 || hips.insert(star.hip), "HIP {}", star.hip);
        let first = (star.hr != 0).then(|| format!("HR {}", star.hr));
        assert_eq!(catalog.names(star).first(), first.as_ref());
    }
}

#[test]
fn every_value_is_finite_and_in_range() {
    for star in hipparcos().stars() {
        let id = (star.hip, star.hr);
        assert!((0.0..2.0 * PI).contains(&star.ra_rad), "{id:?}");
        assert!(star.dec_rad.abs() <= PI / 2.0, "{id:?}");
        assert!((0.0..=800.0 * MAS).contains(&star.parallax_rad), "{id:?}");
        let pm = star.pm_ra_cosdec_rad_yr.hypot(star.pm_dec_rad_yr);
        assert!(pm <= 10_500.0 * MAS, "{id:?}");
        assert!((-1.5..11.0).contains(&star.v_mag), "{id:?} {}", star.v_mag);
        assert!((-0.4..=3.8).contains(&star.b_v), "{id:?} {}", star.b_v);
    }
}

#[test]
fn famous_stars_have_their_published_positions() {
    let catalog = hipparcos();
    // X-Val: SIMBAD, ICRS at J2000 (van Leeuwen 2007): RA, Dec (deg), parallax (mas), proper motion
    // (mas/yr), V.
    let published = "hip,ra,dec,parallax,pm_ra,pm_dec,v
32349,101.28715533,-16.71611586,379.21,-546.01,-1223.07,-1.46
91262,279.23473479,38.78368896,130.23,200.94,286.23,0.03
69673,213.91530029,19.18240916,88.83,-1093.39,-2000.06,-0.05";
    for row in rows(published) {
        let n: u32 = row[0].parse().unwrap();
        let [ra, dec, parallax, pm_ra, pm_dec, v] = array::from_fn(|k| number(&row, k + 1));
        let star = hip(&catalog, n);
        let years = 8.75;
        let dec_2000 = star.dec_rad + years * star.pm_dec_rad_yr;
        let ra_2000 = star.ra_rad + years * star.pm_ra_cosdec_rad_yr / star.dec_rad.cos();
        let [ra, dec] = [ra, dec].map(f64::to_radians);
        near((ra_2000 - ra) / MAS, 0.0, 5.0, n);
        near((dec_2000 - dec) / MAS, 0.0, 5.0, n);
        near(star.parallax_rad / MAS, parallax, 0.02, n);
        near(star.pm_ra_cosdec_rad_yr / MAS, pm_ra, 0.02, n);
        near(star.pm_dec_rad_yr / MAS, pm_dec, 0.02, n);
        near(star.v_mag, v, 0.05, n);
    }
    // Barnard's star, Hp 9.49, has no HR number and lies beyond the embedded catalogue.
    assert!(catalog.stars().iter().all(|star| star.hip != 87_937));
}

#[test]
fn rows_of_hipparcos_survive_the_quantisation() {
    let catalog = hipparcos();
    // X-Val: rows of hip2.dat: HIP, RA, Dec (rad, J1991.25), parallax (mas), proper motion
    // (mas/yr), B-V.
    let published = "hip,ra,dec,parallax,pm_ra,pm_dec,b_v
3,0.0000874051,0.6782224871,2.26,4.27,-3.43,-0.019
57939,3.1107451467,0.6585617448,109.99,4003.98,-5813.62,0.754
71683,3.8383352142,-1.0617735850,754.81,-3679.25,473.67,0.710
118322,6.2828151515,-1.1445359189,8.74,47.93,-22.95,-0.075";
    for row in rows(published) {
        let n: u32 = row[0].parse().unwrap();
        let [ra, dec, parallax, pm_ra, pm_dec, b_v] = array::from_fn(|k| number(&row, k + 1));
        let star = hip(&catalog, n);
        // Half a step of each field, and half the last printed digit of the row (0.01 mas).
        near((star.ra_rad - ra) / MAS, 0.0, 0.17, n);
        near((star.dec_rad - dec) / MAS, 0.0, 0.17, n);
        near(star.parallax_rad / MAS, parallax, 0.0063, n);
        near(star.pm_ra_cosdec_rad_yr / MAS, pm_ra, 1e-6, n);
        near(star.pm_dec_rad_yr / MAS, pm_dec, 1e-6, n);
        near(star.b_v, b_v, 1e-9, n);
    }
}

#[test]
fn variables_have_hipparcos_magnitudes() {
    let catalog = hipparcos();
    let t_crb = hr(&catalog, 5958);
    assert_eq!(t_crb.hip, 78_322);
    // X-Val: T CrB in quiescence, V 9.8 to 10.3 (AAVSO). The Bright Star Catalogue lists its
    // outburst, 2.0.
    assert!((9.8..10.3).contains(&t_crb.v_mag), "{}", t_crb.v_mag);
    // X-Val: Mira, V 2.0 to 10.1 (GCVS)
    assert!((4.0..8.0).contains(&hr(&catalog, 681).v_mag));
}

#[test]
fn doubles_in_one_entry_are_counted_once() {
    let catalog = hipparcos();
    let gamma_leo = hr(&catalog, 4057);
    assert_eq!(hr(&catalog, 4058), gamma_leo);
    assert_eq!(gamma_leo.hip, 50_583);
    // X-Val: SIMBAD, gamma Leo A and B together V 2.01; counted twice it would be 1.3
    let light = light_around(&catalog, &gamma_leo, 120.0);
    assert!((light - 2.01).abs() < 0.05, "{light}");

    // Both lines of the Bright Star Catalogue give the combined magnitude. X-Val: delta Ser 3.80,
    // epsilon Ari 4.63 (V/50).
    for (a, b, v) in [(5788, 5789, 3.80), (887, 888, 4.63)] {
        assert_eq!(hr(&catalog, a), hr(&catalog, b));
        assert!((hr(&catalog, a).v_mag - v).abs() < 0.05);
    }
    // X-Val: zeta Ori A 1.77 (SIMBAD) with B 3.77 is 1.61; the entry contains both.
    assert_eq!(hr(&catalog, 1948), hr(&catalog, 1949));
    assert!((hr(&catalog, 1948).v_mag - 1.7).abs() < 0.1);
}

#[test]
fn stars_missing_in_hipparcos_are_added_once() {
    let catalog = hipparcos();
    // X-Val: combined magnitudes, SIMBAD: xi UMa 3.79, xi Sco AB 4.17, theta1 Ori A to D 4.6.
    for (n, radius, v) in [(4374, 10.0, 3.86), (5977, 10.0, 4.16), (1895, 30.0, 4.66)] {
        let light = light_around(&catalog, &hr(&catalog, n), radius);
        assert!((light - v).abs() < 0.1, "HR {n}: {light}");
    }
    for n in [4374, 4375, 5977, 5978, 5055, 486, 4210] {
        let star = hr(&catalog, n);
        assert_eq!((star.hip, star.hr), (0, n));
        assert_eq!(catalog.id(&star), format!("HR {n}"));
    }
    // X-Val: SIMBAD: Mizar B V 3.88, 14.4 arcsec from A; p Eri 11.5 arcsec
    let mizar = separation(&hr(&catalog, 5054), &hr(&catalog, 5055));
    assert!((mizar - 14.4).abs() < 0.6, "{mizar}");
    let p_eridani = separation(&hr(&catalog, 487), &hr(&catalog, 486));
    assert!((p_eridani - 11.5).abs() < 0.6, "{p_eridani}");
}

#[test]
fn blended_photometry_is_not_counted_twice() {
    let catalog = hipparcos();
    // X-Val: SIMBAD: sigma Ori AB 3.80 with D 6.8 and E 6.6 is 3.66. Hipparcos' two entries as
    // printed give 3.0.
    let light = light_around(&catalog, &hip(&catalog, 26_549), 60.0);
    assert!((light - 3.67).abs() < 0.06, "{light}");
    // X-Val: SIMBAD: epsilon Equ AB 5.23 and C 7.35; 4.5 as printed
    let light = light_around(&catalog, &hip(&catalog, 103_569), 60.0);
    assert!((light - 5.08).abs() < 0.06, "{light}");
    // X-Val: SIMBAD: alpha Cen A 0.01, B 1.33
    assert!((hip(&catalog, 71_683).v_mag - 0.01).abs() < 0.02);
    assert!((hip(&catalog, 71_681).v_mag - 1.33).abs() < 0.02);
}

#[test]
fn fast_pairs_are_separate_entries() {
    let catalog = hipparcos();
    // X-Val: SIMBAD: 61 Cyg A HR 8085 HIP 104214, B HR 8086 HIP 104217; alpha Cen A HR 5459 HIP
    // 71683.
    for (n, number) in [
        (8085, 104_214),
        (8086, 104_217),
        (5459, 71_683),
        (5460, 71_681),
    ] {
        assert_eq!(hr(&catalog, n).hip, number);
    }
}

#[test]
fn stars_have_their_names() {
    let catalog = hipparcos();
    // X-Val: SIMBAD; the stars of the paper's Table A1
    for (n, number, name) in [
        (6111, 80_351, "21 Her"),
        (6158, 0, "28 Her"),
        (6195, 0, "37 Her"),
    ] {
        let star = hr(&catalog, n);
        assert_eq!(catalog.names(&star), [format!("HR {n}"), name.to_owned()]);
        if number != 0 {
            assert_eq!(catalog.id(&star), format!("HIP {number}"));
        }
    }
    for (n, names) in [
        (2491, "HR 2491, alpha CMa, 9 CMa, Sirius"),
        (
            4058,
            "HR 4057, HR 4058, gamma1 Leo, 41 Leo, Algieba, gamma2 Leo",
        ),
    ] {
        assert_eq!(catalog.names(&hr(&catalog, n)).join(", "), names);
    }
}

#[test]
fn star_counts_and_total_light_are_those_of_the_sky() {
    let catalog = hipparcos();
    let brighter = |v: f64| catalog.stars().iter().filter(|s| s.v_mag < v).count();
    // X-Val: Allen's Astrophysical Quantities, star counts: 4,800 to V 6.0, 14,000 to 7.0, 42,000
    // to 8.0; within a tenth.
    for (v, stars) in [
        (6.0, 4_400..5_400),
        (7.0, 12_800..15_800),
        (8.0, 38_000..46_000),
    ] {
        assert!(stars.contains(&brighter(v)), "{}", brighter(v));
    }
    // All light together, as printed by the building tool: magnitude -5.437.
    assert!((magnitude(catalog.stars().iter()) + 5.437).abs() < 0.001);
}
