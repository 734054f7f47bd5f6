//! When and how far images are brought together: where they crowd the caches or are very many.
//!
//! A cache looks for a line in the few places that the line's address allows. Where images lie a power of two apart, the same pixel
//! of all of them wants the same places, and each image drives out another before it is read again.

use super::cutoff::Lanes;

/// More images than this with the same place are a crowd: first caches hold 8 to 12 such lines.
const MOST_IN_PLACE: usize = 12;

/// True where it pays to bring images together: where they crowd, or are very many.
pub(super) fn should_bring<K>(images: &[&[K]]) -> bool {
    // Measured: of floats 24 lose and 32 gain, of words and bytes 32 lose and 48 gain.
    let many = if size_of::<K>() == size_of::<f32>() { 24 } else { 40 };
    images.len() > many || are_crowded(images)
}

/// True where many images begin at the same place of the first cache.
pub(super) fn are_crowded<K>(images: &[&[K]]) -> bool {
    /// Bytes of a cache line.
    const LINE: usize = 64;
    /// Places for them, of first caches as common as not.
    const PLACES: usize = 64;
    let mut counts = [0; PLACES];
    for image in images {
        counts[image.as_ptr().addr() / LINE % PLACES] += 1;
    }
    counts.iter().any(|&count| count > MOST_IN_PLACE)
}

/// Blocks of a stretch, of which so many images are brought together.
pub(super) fn stretch_blocks<K>(images: usize) -> usize {
    /// Bytes of one image, at most: a page, which is as far as processors read ahead by themselves.
    const MOST_RUN_BYTES: usize = 1 << 12;
    /// Bytes of all copies, at most: with 1 to 2 KiB found of each block, they are to stay in the second cache.
    const MOST_BYTES: usize = 1 << 18;
    (MOST_RUN_BYTES.min(MOST_BYTES / images.max(1)) / size_of::<Lanes<K>>()).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn very_many_images_are_brought_together_anyway() {
        let memory = vec![0_u16; 96 * 65];
        let images: Vec<&[u16]> = memory.chunks(65).collect();
        assert!(!are_crowded(&images));
        assert!(should_bring(&images));
        assert!(should_bring(&images[..41]) && !should_bring(&images[..40]));
        let floats = vec![0.0_f32; 25 * 65];
        let images: Vec<&[f32]> = floats.chunks(65).collect();
        assert!(should_bring(&images) && !should_bring(&images[..24]));
    }

    #[test]
    fn images_crowd_where_many_are_a_power_of_two_apart() {
        let memory = vec![0_u8; 24 * 8192];
        let images = |count: usize, stride: usize| -> Vec<&[u8]> {
            (0..count).map(|light| &memory[light * stride..][..stride]).collect()
        };
        assert!(are_crowded(&images(24, 8192)));
        assert!(are_crowded(&images(13, 4096)));
        assert!(!are_crowded(&images(12, 4096)));
        assert!(!are_crowded(&images(24, 2048)), "in two places, twelve each");
        assert!(!are_crowded(&images(24, 4096 + 64)));
    }
}
