//! Resident space objects: shapes by the laws of light, attitudes and glints, population files,
//! published magnitudes, the Earth's shadow, and light curves.

mod close;
mod facets;
mod faint;
mod glints;
mod population;
mod published;
mod ring;
mod shade;
mod twice;

// X-Val: Vallado et al. 2006, AIAA 2006-6753, verification sets 00005 and 06251.
const VANGUARD: &str = "VANGUARD 1\n\
    1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753\n\
    2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667\n";
const DELTA: &str = "DELTA 1 DEB\n\
    1 06251U 62025E   06176.82412014  .00008885  00000-0  12808-3 0  3985\n\
    2 06251  58.0579  54.0425 0030035 139.1568 221.1854 15.56387291  6774\n";
