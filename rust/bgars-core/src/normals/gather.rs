//! Images that crowd the caches, brought together a stretch of pixels at a time.
//!
//! A cache looks for a line in the few places that the line's address allows. Where images lie a power of two apart, the same pixel
//! of all of them wants the same places, and each image drives out another before it is read again.

use std::ops::Range;

use super::cutoff::{LANES, Lanes};
use crate::Pixel;
use crate::stream;

/// Bytes of one image in a stretch, at most: a page, which is as far as processors read ahead by themselves.
const MOST_RUN_BYTES: usize = 1 << 12;

/// Bytes of a stretch, at most: it is to stay in the second cache.
const MOST_BYTES: usize = 1 << 18;

/// More images than this with the same place are a crowd: first caches hold 8 to 12 such lines.
const MOST_IN_PLACE: usize = 12;

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

/// Blocks of a stretch of so many images.
pub(super) fn stretch_blocks<K>(lights: usize) -> usize {
    (MOST_RUN_BYTES.min(MOST_BYTES / lights) / size_of::<Lanes<K>>()).max(1)
}

/// Brings a stretch of blocks of the images together.
pub(super) fn bring<'a, K: Pixel>(
    images: &[&[Lanes<K>]],
    stretch: &Range<usize>,
    memory: &'a mut Vec<Lanes<K>>,
) -> Vec<&'a [Lanes<K>]> {
    // One block more than needed, so that these lie no power of two apart.
    let stride = stretch.len() + 1;
    memory.resize(stride * images.len(), [K::ZERO; LANES]);
    let mut brought = Vec::with_capacity(images.len());
    for (light, to) in memory.chunks_exact_mut(stride).enumerate() {
        let next = images.get(light + 1).map_or(&[][..], |image| &image[stretch.clone()]);
        for (number, (to, from)) in to.iter_mut().zip(&images[light][stretch.clone()]).enumerate() {
            // While one image is copied, the next one is fetched.
            if let Some(next) = next.get(number) {
                stream::prefetch(next, 0);
            }
            *to = *from;
        }
        brought.push(&to[..stretch.len()]);
    }
    brought
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_brought_is_what_the_images_hold() {
        let mut memory = Vec::new();
        // In turn, so that what one task leaves behind meets the next.
        for (lights, blocks) in [(96, 70), (13, 200), (24, 1), (24, 64), (24, 65), (3000, 5)] {
            let pixel = |light: usize, at: usize| (light * 31 + at * 7) as u16;
            let images: Vec<Vec<Lanes<u16>>> = (0..lights)
                .map(|light| {
                    (0..blocks).map(|block| std::array::from_fn(|lane| pixel(light, block * LANES + lane))).collect()
                })
                .collect();
            let images: Vec<&[Lanes<u16>]> = images.iter().map(Vec::as_slice).collect();
            let run = stretch_blocks::<u16>(lights);
            for first in (0..blocks).step_by(run) {
                let stretch = first..blocks.min(first + run);
                let expected: Vec<_> = images.iter().map(|image| &image[stretch.clone()]).collect();
                assert_eq!(bring(&images, &stretch, &mut memory), expected, "{lights} lights, {stretch:?} of {blocks}");
            }
        }
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
