//! Images brought together a stretch of pixels at a time, where they crowd the caches or are very many.
//!
//! A cache looks for a line in the few places that the line's address allows. Where images lie a power of two apart, the same pixel
//! of all of them wants the same places, and each image drives out another before it is read again.

use std::ops::Range;

use super::cutoff::{LANES, Lanes};
use crate::Pixel;
use crate::stream;

/// Bytes of one image in a stretch, at most: a page, which is as far as processors read ahead by themselves.
const MOST_RUN_BYTES: usize = 1 << 12;

/// Bytes of the stretches that are held, at most: they are to stay in the second cache.
const MOST_BYTES: usize = 1 << 18;

/// More images than this with the same place are a crowd: first caches hold 8 to 12 such lines.
const MOST_IN_PLACE: usize = 12;

/// True where it pays to bring images together: where they crowd, or a block of all of them takes much of the first cache.
pub(super) fn should_bring<K>(images: &[&[K]]) -> bool {
    /// Measured, like the next one: from 80 images of 16 bit and 64 of floats on it pays.
    const MANY: usize = 64;
    const MUCH: usize = 1 << 13;
    are_crowded(images) || images.len() > MANY && images.len() * size_of::<Lanes<K>>() > MUCH
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

/// Blocks of a stretch of so many images, of which so many stretches are held at a time.
pub(super) fn stretch_blocks<K>(lights: usize, stretches: usize) -> usize {
    (MOST_RUN_BYTES.min(MOST_BYTES / stretches / lights) / size_of::<Lanes<K>>()).max(1)
}

/// Brings a stretch of blocks of the images together: all images of the first block, then of the second.
#[inline(always)]
pub(super) fn bring<K: Pixel>(images: &[&[Lanes<K>]], stretch: &Range<usize>, memory: &mut Vec<Lanes<K>>) {
    memory.resize(stretch.len() * images.len(), [K::ZERO; LANES]);
    Share { images, stretch, blocks: 0..memory.len(), memory }.part(0, 1);
}

/// True where it pays to bring the next stretch together while this one is worked on: of bytes the work is soon done, and of very
/// many floats too much is brought at a time (measured).
pub(super) fn should_share<K>(images: &[&[K]]) -> bool {
    const MUCH: usize = 1 << 14;
    size_of::<K>() > 1 && images.len() * size_of::<Lanes<K>>() <= MUCH
}

/// Blocks of a stretch to be brought together: all of them at once, or a share while something else is worked on.
pub(super) struct Share<'a, K> {
    pub images: &'a [&'a [Lanes<K>]],
    pub stretch: &'a Range<usize>,
    /// Which ones, counted image by image.
    pub blocks: Range<usize>,
    /// Where all of the stretch goes.
    pub memory: &'a mut [Lanes<K>],
}

impl<K: Pixel> Share<'_, K> {
    /// Bytes that are fetched ahead: far less than a first cache (measured).
    const AHEAD_BYTES: usize = if size_of::<K>() == 1 { 10 << 10 } else { 6 << 10 };

    /// Brings one of so many parts. In turn with it, blocks are fetched that come later: many at once would be waited for.
    #[inline(always)]
    pub fn part(&mut self, part: usize, parts: usize) {
        let (lights, row_len) = (self.images.len(), self.stretch.len());
        let place = |part: usize| self.blocks.start + part * self.blocks.len() / parts;
        let mut at = InRows::new(place(part), row_len);
        let mut ahead = InRows::new(place(part) + Self::AHEAD_BYTES / size_of::<Lanes<K>>(), row_len);
        for _ in place(part)..place(part + 1) {
            // Behind the last image come the first ones of the next stretch.
            let (image, blocks_on) = if ahead.row < lights { (ahead.row, 0) } else { (ahead.row % lights, row_len) };
            stream::prefetch(&self.images[image][self.stretch.start + ahead.column], blocks_on);
            self.memory[at.column * lights + at.row] = self.images[at.row][self.stretch.start + at.column];
            at.step();
            ahead.step();
        }
    }
}

/// A place in rows of equal length.
struct InRows {
    row: usize,
    column: usize,
    row_len: usize,
}

impl InRows {
    #[inline(always)]
    fn new(place: usize, row_len: usize) -> Self {
        Self { row: place / row_len, column: place % row_len, row_len }
    }

    #[inline(always)]
    fn step(&mut self) {
        self.column += 1;
        if self.column == self.row_len {
            (self.row, self.column) = (self.row + 1, 0);
        }
    }
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
            let run = stretch_blocks::<u16>(lights, 1);
            for first in (0..blocks).step_by(run) {
                let stretch = first..blocks.min(first + run);
                let expected: Vec<_> =
                    stretch.clone().flat_map(|block| images.iter().map(move |image| image[block])).collect();
                bring(&images, &stretch, &mut memory);
                assert_eq!(memory, expected, "{lights} lights, {stretch:?} of {blocks}");
                memory.fill([0; LANES]);
                for (count, parts) in [(1, 1), (3, 4), (stretch.len(), 4)] {
                    let place = |share: usize| share * expected.len() / count;
                    for share in 0..count {
                        let blocks = place(share)..place(share + 1);
                        let mut share = Share { images: &images, stretch: &stretch, blocks, memory: &mut memory };
                        (0..parts).for_each(|part| share.part(part, parts));
                    }
                    assert_eq!(memory, expected, "{lights} lights, {stretch:?} of {blocks} in {count} shares");
                    memory.fill([0; LANES]);
                }
            }
        }
    }

    #[test]
    fn very_many_images_are_brought_together_anyway() {
        let memory = vec![0_u16; 96 * 65];
        let images: Vec<&[u16]> = memory.chunks(65).collect();
        assert!(!are_crowded(&images));
        assert!(should_bring(&images));
        assert!(!should_bring(&images[..48]));
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
