//! Compressed pixels: compression ratio, round trips, refused input.

use crate::common::{Random, hex};
use proptest::collection::vec;
use proptest::prelude::*;
use skyloop_protocols::rice::{decode, encode};

/// Bytes of pixels in a packet.
const DATA: usize = 1368;

/// Gaussian noise in DN around 100 (1000 from 30 DN on): splitmix64 and Box-Muller.
fn noise(count: usize, sigma: f64, bits: u8) -> Vec<u16> {
    let mut random = Random(7);
    let mut uniform = || (random.next() >> 11) as f64 / (1_u64 << 53) as f64;
    let mean = if sigma < 30.0 { 100.0 } else { 1000.0 };
    let max = f64::from(u16::MAX >> (16 - bits));
    (0..count)
        .map(|_| {
            let radius = (-2.0 * (1.0 - uniform()).ln()).sqrt();
            let normal = radius * (std::f64::consts::TAU * uniform()).cos();
            (mean + sigma * normal).round().clamp(0.0, max) as u16
        })
        .collect()
}

/// Encodes all pixels, packet by packet, checks the decoded pixels, and returns the total length.
fn round_trip(pixels: &[u16], bits: u8) -> usize {
    let (mut rest, mut bytes) = (pixels, 0);
    while !rest.is_empty() {
        let mut data = [0xA5; DATA];
        let (taken, length) = encode(rest, bits, &mut data);
        assert!(taken >= rest.len().min(512), "{taken} pixels in a packet");
        let mut back = vec![0xFFFF; taken];
        decode(&data[..length], bits, &mut back).expect("decodes");
        assert_eq!(back, rest[..taken]);
        rest = &rest[taken..];
        bytes += length;
    }
    bytes
}

/// The table in `src/rice.rs`; `--nocapture` prints it.
#[test]
fn noisy_flat_fields_have_their_compression_ratio() {
    for (sigma, at_least) in [(1.0, 5.0), (2.0, 4.0), (4.0, 3.2), (8.0, 2.7), (60.0, 1.8)] {
        let pixels = noise(512 * 512, sigma, 16);
        let bytes = round_trip(&pixels, 16) as f64;
        let ratio = 2.0 * pixels.len() as f64 / bytes;
        println!(
            "sigma {sigma} DN: {:.2} bits a pixel, {ratio:.2} times smaller",
            16.0 / ratio
        );
        assert!(ratio >= at_least, "sigma {sigma}: {ratio}");
    }
}

#[test]
fn extremes_survive_the_round_trip() {
    for bits in 1..=16 {
        let max = u16::MAX >> (16 - bits);
        let alternating: Vec<u16> = (0..3000)
            .map(|i| if i % 2 == 0 { 0 } else { max })
            .collect();
        for pixels in [
            vec![0; 3000],
            vec![max; 3000],
            alternating,
            noise(3001, 60.0, bits),
        ] {
            round_trip(&pixels, bits);
        }
    }
}

#[test]
fn invalid_pixels_are_not_encoded() {
    let mut late = [5; 40];
    late[20] = 4096;
    // Pixels, bits, bytes of room, number of encoded pixels.
    let cases: [(&[u16], u8, usize, usize); 6] = [
        (&[], 12, DATA, 0),
        (&[5; 40], 0, DATA, 0),
        (&[5; 40], 17, DATA, 0),
        (&[4096; 40], 12, DATA, 0),
        (&late, 12, DATA, 16), // up to the block of the invalid pixel
        (&[5; 40], 12, 3, 0),
    ];
    for (pixels, bits, room, expected) in cases {
        let (taken, length) = encode(pixels, bits, &mut vec![0; room]);
        assert_eq!(
            (taken, length > 0),
            (expected, expected > 0),
            "{bits} bits: {pixels:?}"
        );
    }
    for bits in [0, 17] {
        assert!(decode(&[0; 4], bits, &mut [0; 4]).is_err(), "{bits} bits");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_pixels_survive_the_round_trip(bits in 1..=16_u8, pixels in vec(any::<u16>(), 1..3000), shift in 0..16_u32) {
        let pixels: Vec<u16> = pixels.iter().map(|p| (p >> shift) & (u16::MAX >> (16 - bits))).collect();
        round_trip(&pixels, bits);
    }

    #[test]
    fn other_bytes_never_decode_to_the_same_pixels(
        pixels in vec(90..110_u16, 1..200),
        at in any::<prop::sample::Index>(),
        bit in 0..8_u32,
        tail in vec(any::<u8>(), 1..4),
    ) {
        let mut data = [0; DATA];
        let (taken, length) = encode(&pixels, 12, &mut data);
        prop_assert_eq!(taken, pixels.len());
        let mut back = vec![0; taken];
        let mut longer = data[..length].to_vec();
        longer.extend_from_slice(&tail);
        prop_assert!(decode(&longer, 12, &mut back).is_err(), "trailing bytes");
        longer[length..].fill(0);
        prop_assert!(decode(&longer, 12, &mut back).is_err(), "trailing zeros");
        prop_assert!(decode(&data[..length - 1], 12, &mut back).is_err(), "a byte too few");
        data[at.index(length)] ^= 1_u8 << bit;
        if decode(&data[..length], 12, &mut back).is_ok() {
            prop_assert_ne!(back, pixels);
        }
    }
}

/// Six blocks of 12-bit pixels: three around 2000, one over the whole range, one near 0, a shorter
/// one near the maximum.
fn blocks_of_all_kinds() -> Vec<u16> {
    let mut state = 12345_u32;
    (0..91)
        .map(|i| {
            state = state.wrapping_mul(1_103_515_245).wrapping_add(12345) & 0x7FFF_FFFF;
            let r = (state >> 16) as u16;
            [
                2000 + r % 16,
                2000 + r % 64,
                1990 + r % 200,
                r % 4096,
                r % 8,
                4095 - r % 8,
            ][i / 16]
        })
        .collect()
}

/// X-Val: libaec 1.1.6 (`aec_encode` of Python's imagecodecs 2026.3.6; 12 bits a sample, blocks of
/// 16, one reference interval, DATA_PREPROCESS): the same bytes.
#[test]
fn another_coder_of_the_standard_gives_the_same_bytes() {
    let expected = "37dc193b2360bd588cd6b0d24ba6a4cb22cf96ce9630836b24c179a96ec0f28707580856e27b825293c18d790f5df8e8d44ca06f77ff8fcc24fac668b6fa5d1bd1c3e37b800000ffffcc21c20440010460021c1141800000001ffffec0880c2838e0c043000000000000";
    let mut data = [0; DATA];
    let pixels = blocks_of_all_kinds();
    let (taken, length) = encode(&pixels, 12, &mut data);
    assert_eq!((taken, &data[..length]), (91, &hex(expected)[..]));
}
