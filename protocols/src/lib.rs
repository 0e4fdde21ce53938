//! Wire formats of skyloop.
#![no_std]
