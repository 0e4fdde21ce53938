//! What is in a frame, as one array of the label's text.

use super::{ObjectLabel, SpotLabel};
use rayon::prelude::*;
use serde::ser::{Error, SerializeSeq};
use serde::{Serialize, Serializer};
use serde_json::value::{RawValue, to_raw_value};
use std::ops::{Deref, DerefMut};

/// What is in a frame: sources of light, and beside them, in the same array of the text, what is none. As a list it is
/// that of the sources.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Objects {
    /// The stars and RSOs in the frame or with light on the detector.
    pub sources: Vec<ObjectLabel>,
    /// Particles and defective pixels.
    pub spots: Vec<SpotLabel>,
}

impl From<Vec<ObjectLabel>> for Objects {
    fn from(sources: Vec<ObjectLabel>) -> Self {
        let spots = Vec::new();
        Objects { sources, spots }
    }
}

impl Deref for Objects {
    type Target = Vec<ObjectLabel>;

    fn deref(&self) -> &Self::Target {
        &self.sources
    }
}

impl DerefMut for Objects {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.sources
    }
}

impl<'a> IntoIterator for &'a Objects {
    type Item = &'a ObjectLabel;
    type IntoIter = std::slice::Iter<'a, ObjectLabel>;

    fn into_iter(self) -> Self::IntoIter {
        self.sources.iter()
    }
}

impl Serialize for Objects {
    /// They are most of a label: their texts are made side by side where there are threads for it, which only JSON has a way for.
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        if rayon::current_num_threads() == 1 {
            let mut seq = to.serialize_seq(Some(self.sources.len() + self.spots.len()))?;
            for source in &self.sources {
                seq.serialize_element(source)?;
            }
            for spot in &self.spots {
                seq.serialize_element(spot)?;
            }
            return seq.end();
        }
        fn texts<T: Serialize + Sync>(all: &[T]) -> serde_json::Result<Vec<Box<RawValue>>> {
            all.par_iter().map(to_raw_value).collect()
        }
        let sources = texts(&self.sources).map_err(S::Error::custom)?;
        let spots = texts(&self.spots).map_err(S::Error::custom)?;
        to.collect_seq(sources.iter().chain(&spots))
    }
}
