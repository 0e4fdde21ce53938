//! Pixels of 12 bits, packed for the wire.

/// Pixels packed at a time, and their bytes.
const PIXELS: usize = 8;
const BYTES: usize = 12;

/// Packs pixels of 12 bits, first bit first (`AAAAAAAA AAAABBBB BBBBBBBB`), an odd last one into
/// two bytes. Four pixels are one number of 48 bits.
#[inline(always)]
pub(crate) fn body(pixels: &[u16], bytes: &mut [u8]) {
    let (blocks, rest) = pixels.as_chunks::<PIXELS>();
    let (whole, tail) = bytes.split_at_mut((blocks.len() * BYTES).min(bytes.len()));
    for (bytes, block) in whole.as_chunks_mut::<BYTES>().0.iter_mut().zip(blocks) {
        let mut pairs = [0u32; PIXELS / 2];
        for i in 0..PIXELS / 2 {
            pairs[i] = u32::from(block[2 * i]) << 12 | u32::from(block[2 * i + 1]);
        }
        let four = |i: usize| (u64::from(pairs[i]) << 24 | u64::from(pairs[i + 1])) << 16;
        let [first, second] = [four(0).to_be_bytes(), four(2).to_be_bytes()];
        // The last two bytes of the first are unused: the second overwrites them.
        bytes[..8].copy_from_slice(&first);
        bytes[6..].copy_from_slice(&second[..6]);
    }
    twin(rest, tail);
}

/// The same, pair by pair.
#[inline(always)]
pub(crate) fn twin(pixels: &[u16], bytes: &mut [u8]) {
    for (triple, pair) in bytes.chunks_mut(3).zip(pixels.chunks(2)) {
        let [a, b] = [pair[0], pair.get(1).copied().unwrap_or_default()];
        let packed = [(a >> 4) as u8, (a << 4 | b >> 8) as u8, b as u8];
        for (byte, packed) in triple.iter_mut().zip(packed) {
            *byte = packed;
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::kernels::pack_12;
    use skyloop_orbit::sgp4_batch::Level;

    #[test]
    fn all_levels_pack_as_the_wire_has_it() {
        // X-Val: by hand, from the bits.
        let mut bytes = [0xFF; 5];
        pack_12(None, &[0xABC, 0x123, 0xFED], &mut bytes);
        assert_eq!(bytes, [0xAB, 0xC1, 0x23, 0xFE, 0xD0]);
        for count in (0u32..70).chain([1023]) {
            let pixels: Vec<u16> = (0..count)
                .map(|i| (i.wrapping_mul(2_654_435_761) >> 20) as u16)
                .collect();
            let packed = |level: Option<Level>| {
                let mut bytes = vec![0xFF; (pixels.len() * 3).div_ceil(2)];
                pack_12(level, &pixels, &mut bytes);
                bytes
            };
            let twin = packed(None);
            for level in Level::available() {
                assert!(packed(Some(level)) == twin, "{level:?} {count}");
            }
        }
    }
}
