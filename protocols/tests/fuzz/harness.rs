//! Generates inputs, keeps those with new features, and checks the limits of time and memory.

use crate::common::Random;
use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// One decoder and its inputs.
pub struct Target {
    pub name: &'static str,
    /// Inputs in addition to those in `corpus/<name>`.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Processes an input; panics if the decoder breaks a rule.
    pub run: fn(&[u8], &mut Seen),
}

/// Longest input in bytes.
const LONGEST: usize = 3000;
/// Largest number of inputs for mutation.
const POOL: usize = 1000;
/// Longest time of an input, with a margin for slow machines.
const HANG: Duration = Duration::from_secs(5);
/// Largest growth of memory while a target runs, KiB.
const GROWTH_KIB: u64 = 16 * 1024;
/// Largest number of distinct features.
const FEATURES: usize = 1 << 14;

/// Features of all inputs so far. An input with a new feature is stored.
#[derive(Default)]
pub struct Seen {
    features: HashSet<u64>,
    is_new: bool,
}

impl Seen {
    pub fn note(&mut self, feature: impl Hash) {
        let mut hasher = DefaultHasher::new();
        feature.hash(&mut hasher);
        if self.features.len() < FEATURES && self.features.insert(hasher.finish()) {
            self.is_new = true;
        }
    }

    /// Notes a text without its numbers.
    pub fn note_text(&mut self, text: &str) {
        let letters = text.bytes().filter(|byte| !byte.is_ascii_hexdigit());
        let words = letters.fold(5381, |hash: u64, byte| {
            hash.wrapping_mul(33).wrapping_add(byte.into())
        });
        self.note(words);
    }
}

/// A random size below `2^bits`, uniform in its order of magnitude.
fn size(random: &mut Random, bits: usize) -> usize {
    let limit = 1 << random.below(bits);
    random.below(limit)
}

/// Prints the input if its run panics.
struct PanicReport<'a>(&'a str, &'a [u8]);

impl Drop for PanicReport<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let digits: String = self.1.iter().map(|byte| format!("{byte:02x}")).collect();
            eprintln!("{}: failing input: {digits}", self.0);
        }
    }
}

/// Runs a target with its corpus, its seeds and `inputs` mutations; returns the number of inputs.
pub fn fuzz(target: &Target, inputs: u64) -> u64 {
    let seed = std::env::var("SKYLOOP_FUZZ_SEED").map_or(1, |text| text.parse().expect("a seed"));
    let mut random = Random(seed);
    let mut seen = Seen::default();
    let corpus = corpus(target.name);
    assert!(!corpus.is_empty(), "no corpus of {}", target.name);
    let mut pool = corpus.clone();
    pool.extend((target.seeds)());
    for input in &pool {
        feed(target, input, &mut seen);
    }
    let (known, given) = (pool.len(), pool.len() as u64);
    let (start, before) = (Instant::now(), resident_kib().now);
    let mut input = Vec::with_capacity(2 * LONGEST);
    for _ in 0..inputs {
        make(&mut input, &pool, &mut random);
        if feed(target, &input, &mut seen) {
            if pool.len() < POOL {
                pool.push(input.clone());
            } else {
                // Seeds are never replaced.
                let index = known + random.below(POOL.saturating_sub(known));
                if let Some(stored) = pool.get_mut(index) {
                    stored.clone_from(&input);
                }
            }
        }
    }
    let after = resident_kib().now;
    println!(
        "{:>16}: {inputs} inputs in {:.1} s, {} features, {} stored; resident {before} to {after} KiB",
        target.name,
        start.elapsed().as_secs_f64(),
        seen.features.len(),
        pool.len() - known,
    );
    assert!(
        after < before + GROWTH_KIB,
        "{}: memory grows from {before} to {after} KiB",
        target.name
    );
    if std::env::var_os("SKYLOOP_FUZZ_KEEP").is_some() {
        store(target, &pool[corpus.len()..]);
    }
    given + inputs
}

/// Runs one input and returns whether it has a new feature.
fn feed(target: &Target, input: &[u8], seen: &mut Seen) -> bool {
    let report = PanicReport(target.name, input);
    let start = Instant::now();
    seen.is_new = false;
    (target.run)(input, seen);
    assert!(
        start.elapsed() < HANG,
        "{}: took {:?}",
        target.name,
        start.elapsed()
    );
    drop(report);
    seen.is_new
}

/// One input in eight is random bytes, the others are one of the pool with up to eight mutations.
fn make(input: &mut Vec<u8>, pool: &[Vec<u8>], random: &mut Random) {
    input.clear();
    if random.below(8) == 0 {
        let length = size(random, 11);
        input.extend((0..length).map(|_| random.next() as u8));
        return;
    }
    input.extend_from_slice(&pool[random.below(pool.len())]);
    for _ in 0..=random.below(8) {
        mutate(input, pool, random);
    }
    input.truncate(LONGEST);
}

fn mutate(input: &mut Vec<u8>, pool: &[Vec<u8>], random: &mut Random) {
    const EDGES: [u8; 16] = [
        0, 1, 2, 7, 8, 0x0D, 0x0F, 0x10, 0x20, 0x30, 0x7F, 0x80, 0xC0, 0xDB, 0xFE, 0xFF,
    ];
    let at = random.below(input.len());
    let end = (at + 1 + size(random, 8)).min(input.len());
    let Some(byte) = input.get_mut(at) else {
        input.push(random.next() as u8);
        return;
    };
    match random.below(10) {
        0 => *byte ^= 1 << random.below(8),
        1 => *byte = random.next() as u8,
        2 => *byte = EDGES[random.below(EDGES.len())],
        3 => *byte = byte.wrapping_add([1, 0xFF][random.below(2)]),
        4 => input.insert(at, random.next() as u8),
        5 => drop(input.drain(at..end)),
        6 => {
            let part = input[at..end].to_vec();
            let to = random.below(input.len());
            input.splice(to..to, part);
        }
        7 => input[at..end].fill(EDGES[random.below(EDGES.len())]),
        8 => input.truncate(at),
        _ => {
            // The end of another input.
            let other = &pool[random.below(pool.len())];
            input.truncate(at);
            input.extend_from_slice(&other[random.below(other.len())..]);
        }
    }
}

fn folder(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "tests", "corpus", name]
        .iter()
        .collect()
}

/// The committed inputs, in the order of their names.
fn corpus(name: &str) -> Vec<Vec<u8>> {
    let Ok(entries) = std::fs::read_dir(folder(name)) else {
        return Vec::new();
    };
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("a file").path()).collect();
    paths.sort();
    paths
        .iter()
        .map(|path| std::fs::read(path).expect("a file"))
        .collect()
}

/// Writes the shortest inputs that together have all features.
fn store(target: &Target, pool: &[Vec<u8>]) {
    let mut pool: Vec<&Vec<u8>> = pool.iter().filter(|input| input.len() <= 1500).collect();
    pool.sort_by_key(|input| input.len());
    let mut seen = Seen::default();
    let needed: Vec<_> = pool
        .into_iter()
        .filter(|input| feed(target, input, &mut seen))
        .collect();
    std::fs::create_dir_all(folder(target.name)).expect("a folder");
    for input in needed.iter().step_by(needed.len().div_ceil(24)) {
        let mut hasher = DefaultHasher::new();
        input.hash(&mut hasher);
        let name = format!("{:016x}", hasher.finish());
        std::fs::write(folder(target.name).join(name), input).expect("written");
    }
}

/// Memory of this process, KiB; 0 if unknown.
pub struct Resident {
    pub now: u64,
    pub peak: u64,
}

pub fn resident_kib() -> Resident {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let field = |name| {
        let line = status
            .lines()
            .find_map(|line: &str| line.strip_prefix(name));
        line.and_then(|rest| rest.trim().split(' ').next()?.parse().ok())
            .unwrap_or(0)
    };
    Resident {
        now: field("VmRSS:"),
        peak: field("VmHWM:"),
    }
}
