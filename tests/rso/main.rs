//! Resident space objects: shapes by the laws of light, attitudes and glints, population files, published magnitudes, the Earth's shadow,
//! and light curves.

mod close;
mod facets;
mod faint;
mod glints;
mod lightcurve;
mod population;
mod published;
mod ring;
mod shade;
mod twice;

#[allow(dead_code, reason = "tables of vectors are for other tests")]
#[path = "../reference/mod.rs"]
mod reference;
