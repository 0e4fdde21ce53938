//! Inputs, what they do that is new, and the bounds that they must keep.

use crate::common::Random;
use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// One decoder and what it is fed.
pub struct Target {
    pub name: &'static str,
    /// Inputs beside those in `corpus/<name>`.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Takes an input; panics where the decoder does what it must not.
    pub run: fn(&[u8], &mut Seen),
}

/// Longest input in octets.
const LONGEST: usize = 3000;
/// Most inputs that are kept to be mutated.
const POOL: usize = 1000;
/// No input may take longer; machines are slow at times.
const HANG: Duration = Duration::from_secs(5);
/// Memory may not grow more while a target runs, KiB.
const GROWTH_KIB: u64 = 16 * 1024;
/// Most features that are told apart.
const FEATURES: usize = 1 << 14;

/// What decoders have done so far: an input that does something new is kept.
#[derive(Default)]
pub struct Seen {
    features: HashSet<u64>,
    notices: bool,
}

impl Seen {
    pub fn note(&mut self, feature: impl Hash) {
        let mut hasher = DefaultHasher::new();
        feature.hash(&mut hasher);
        if self.features.len() < FEATURES && self.features.insert(hasher.finish()) {
            self.notices = true;
        }
    }

    /// A text without its numbers.
    pub fn note_text(&mut self, text: &str) {
        let letters = text.bytes().filter(|octet| !octet.is_ascii_hexdigit());
        let words = letters.fold(5381, |hash: u64, octet| {
            hash.wrapping_mul(33).wrapping_add(octet.into())
        });
        self.note(words);
    }
}

/// A random size below `2^bits`: small ones are as likely as great ones.
fn size(random: &mut Random, bits: usize) -> usize {
    let limit = 1 << random.below(bits);
    random.below(limit)
}

/// Prints the input if its run panics.
struct Witness<'a>(&'a str, &'a [u8]);

impl Drop for Witness<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let digits: String = self.1.iter().map(|octet| format!("{octet:02x}")).collect();
            eprintln!("{}: this input fails: {digits}", self.0);
        }
    }
}

/// Feeds a target its corpus, its seeds, and then `inputs` others; how many in all.
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
                // The seeds stay.
                let place = known + random.below(POOL.saturating_sub(known));
                if let Some(kept) = pool.get_mut(place) {
                    kept.clone_from(&input);
                }
            }
        }
    }
    let after = resident_kib().now;
    println!(
        "{:>16}: {inputs} inputs in {:.1} s, {} features, {} kept; resident {before} to {after} KiB",
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
        keep(target, &pool[corpus.len()..]);
    }
    given + inputs
}

/// Runs one input; whether it did something new.
fn feed(target: &Target, input: &[u8], seen: &mut Seen) -> bool {
    let witness = Witness(target.name, input);
    let start = Instant::now();
    seen.notices = false;
    (target.run)(input, seen);
    assert!(
        start.elapsed() < HANG,
        "{}: took {:?}",
        target.name,
        start.elapsed()
    );
    drop(witness);
    seen.notices
}

/// One input in eight is random octets, the others are one of the pool with up to eight mutations.
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
    let Some(octet) = input.get_mut(at) else {
        input.push(random.next() as u8);
        return;
    };
    match random.below(10) {
        0 => *octet ^= 1 << random.below(8),
        1 => *octet = random.next() as u8,
        2 => *octet = EDGES[random.below(EDGES.len())],
        3 => *octet = octet.wrapping_add([1, 0xFF][random.below(2)]),
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
            // The end of another one.
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

/// Writes the shortest inputs that together do all that the others did.
fn keep(target: &Target, pool: &[Vec<u8>]) {
    let mut pool: Vec<&Vec<u8>> = pool.iter().filter(|input| input.len() <= 1500).collect();
    pool.sort_by_key(|input| input.len());
    let mut seen = Seen::default();
    let notices: Vec<_> = pool
        .into_iter()
        .filter(|input| feed(target, input, &mut seen))
        .collect();
    std::fs::create_dir_all(folder(target.name)).expect("a folder");
    for input in notices.iter().step_by(notices.len().div_ceil(24)) {
        let mut hasher = DefaultHasher::new();
        input.hash(&mut hasher);
        let name = format!("{:016x}", hasher.finish());
        std::fs::write(folder(target.name).join(name), input).expect("written");
    }
}

/// Memory of this process, KiB; 0 where the system does not tell.
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
