//! Reads `vectors/golden.txt`.
#![allow(dead_code, reason = "each test file uses its part")]

use std::collections::BTreeMap;
use std::str::FromStr;

/// One entry of the file: its name, its bytes, its fields as text.
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

    pub fn float(&self, key: &str) -> f64 {
        parse(self.text(key))
    }

    pub fn floats<const N: usize>(&self, key: &str) -> [f64; N] {
        let numbers: Vec<f64> = self.text(key).split_whitespace().map(parse).collect();
        numbers.try_into().expect(key)
    }

    pub fn integer<T: TryFrom<u64, Error: std::fmt::Debug>>(&self, key: &str) -> T {
        T::try_from(number(self.text(key))).expect(key)
    }

    pub fn integers(&self, key: &str) -> Vec<u64> {
        self.text(key).split_whitespace().map(number).collect()
    }
}

pub fn parse<T: FromStr<Err: std::fmt::Debug>>(text: &str) -> T {
    text.parse().expect(text)
}

fn number(text: &str) -> u64 {
    match text.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16).expect(text),
        None => parse(text),
    }
}

/// Octets from hexadecimal digits; blanks and bars are decoration.
pub fn hex(text: &str) -> Vec<u8> {
    let digits: String = text
        .chars()
        .filter(|c| !c.is_whitespace() && *c != '|')
        .collect();
    assert!(
        digits.len().is_multiple_of(2),
        "odd number of hexadecimal digits in {text}"
    );
    (0..digits.len())
        .step_by(2)
        .map(|at| u8::from_str_radix(&digits[at..at + 2], 16).expect(text))
        .collect()
}

/// All entries of the file.
pub fn golden() -> Vec<Vector> {
    let text = include_str!("../../vectors/golden.txt");
    let mut vectors: Vec<Vector> = Vec::new();
    let mut key = String::new();
    for line in text
        .lines()
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
    {
        if let Some(name) = line
            .strip_prefix('[')
            .and_then(|line| line.strip_suffix(']'))
        {
            vectors.push(Vector {
                name: name.into(),
                bytes: Vec::new(),
                fields: BTreeMap::new(),
            });
            continue;
        }
        let vector = vectors.last_mut().expect("a [name] first");
        if line.starts_with(' ') {
            vector
                .fields
                .get_mut(&key)
                .expect("a field first")
                .push_str(line);
        } else {
            let (name, value) = line.split_once('=').expect(line);
            key = name.trim().into();
            let before = vector.fields.insert(key.clone(), value.trim().into());
            assert!(
                before.is_none(),
                "golden.txt [{}]: {key} twice",
                vector.name
            );
        }
    }
    for vector in &mut vectors {
        vector.bytes = hex(vector.text("hex"));
    }
    vectors
}
