//! Pixel values in the format of the wire.

use skyloop_orbit::sgp4_batch::Level;
use skyloop_protocols::pixels::{pack, packed_length};
use skyloop_protocols::{EncodeError, Packing};
use skyloop_render::kernels;

/// [`pack`] with the processor's vector instructions.
pub(super) fn packed(packing: Packing, pixels: &[u16], data: &mut [u8]) -> Result<(), EncodeError> {
    let all = pixels.iter().fold(0, |all, pixel| all | pixel);
    if packing == Packing::Bits12
        && all >> 12 == 0
        && data.len() == packed_length(packing, pixels.len())
    {
        kernels::pack_12(Some(Level::best()), pixels, data);
        return Ok(());
    }
    // Pixels of two bytes, or arguments that are an error.
    pack(packing, pixels, data)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_packed_as_the_protocol_does() {
        let both = |packing: Packing, pixels: &[u16], length: usize| {
            [pack, packed].map(|pack| {
                let mut data = vec![0xFF; length];
                let result = pack(packing, pixels, &mut data).map_err(|error| error.to_string());
                (result, data)
            })
        };
        for packing in [Packing::Bits12, Packing::Bits16] {
            for count in (0u32..40).chain([1023]) {
                let pixels: Vec<u16> = (0..count)
                    .map(|i| (i.wrapping_mul(2_654_435_761) >> 20) as u16)
                    .collect();
                let length = packed_length(packing, pixels.len());
                let [plain, fast] = both(packing, &pixels, length);
                assert!(plain == fast && plain.0.is_ok(), "{packing:?} {count}");
                // Both report a wrong length.
                let [plain, fast] = both(packing, &pixels, length + 1);
                assert!(plain == fast && plain.0.is_err(), "{packing:?} {count}");
            }
        }
        let [plain, fast] = both(Packing::Bits12, &[4096], 2);
        assert!(plain == fast && plain.0.is_err());
    }
}
