//! Orbits of skyloop.
