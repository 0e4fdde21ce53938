//! A sky without what the tests of stars, objects and detectors have not reckoned with.

/// The names of the effects that are light, but for stars and objects in orbit.
pub const DARK_SKY: [&str; 9] = [
    "zodiacal light",
    "starlight",
    "planets",
    "moon",
    "earth",
    "limb",
    "sunlight",
    "moonglow",
    "earthshine",
];
