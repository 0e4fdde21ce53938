//! `vectors/golden.txt`, hexadecimal digits, random numbers.
#![allow(dead_code, reason = "the fuzz targets use a part")]

use std::collections::BTreeMap;
use std::fmt::Debug;

/// One entry of the file: name, bytes, fields as text.
pub struct Vector {
    pub name: String,
    pub bytes: Vec<u8>,
    fields: BTreeMap<String, String>,
}

impl Vector {
    pub fn has(&self, key: &str) -> bool {
        self.fields.contains_key(key)
    }

    pub fn keys(&self) -> impl Iterator<Item = &str> {
        self.fields.keys().map(String::as_str)
    }

    pub fn text(&self, key: &str) -> &str {
        let value = self.fields.get(key);
        value.unwrap_or_else(|| panic!("golden.txt [{}]: no field {key}", self.name))
    }

    pub fn integer<T: TryFrom<u64, Error: Debug>>(&self, key: &str) -> T {
        T::try_from(number(self.text(key))).expect(key)
    }

    pub fn integers(&self, key: &str) -> Vec<u64> {
        self.text(key).split_whitespace().map(number).collect()
    }
}

fn number(text: &str) -> u64 {
    match text.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16).expect(text),
        None => text.parse().expect(text),
    }
}

/// Bytes from hexadecimal digits; ignores blanks and bars.
pub fn hex(text: &str) -> Vec<u8> {
    let digits = text.replace(|c: char| c.is_whitespace() || c == '|', "");
    let byte = |at| u8::from_str_radix(&digits[at..at + 2], 16).expect(text);
    (0..digits.len()).step_by(2).map(byte).collect()
}

/// All entries of the file.
pub fn golden() -> Vec<Vector> {
    let entries = include_str!("../../vectors/golden.txt")
        .split("\n[")
        .skip(1);
    let entry = |text: &str| {
        let (name, lines) = text.split_once("]\n").expect(text);
        let mut fields = BTreeMap::new();
        // Lines that begin with a blank continue a field.
        for line in lines
            .replace("\n ", " ")
            .lines()
            .filter(|line| !line.is_empty())
        {
            let (key, value) = line.split_once('=').expect(line);
            let before = fields.insert(key.trim().to_owned(), value.trim().to_owned());
            assert!(before.is_none(), "golden.txt [{name}]: {key} twice");
        }
        let (name, bytes) = (name.to_owned(), hex(&fields["hex"]));
        Vector {
            name,
            bytes,
            fields,
        }
    };
    entries.map(entry).collect()
}

/// splitmix64: the same numbers in every run.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    pub fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit.max(1) as u64) as usize
    }

    /// One time in `n`; never for 0.
    pub fn one_in(&mut self, n: usize) -> bool {
        n > 0 && self.below(n) == 0
    }
}
