//! What is done for the next blocks while one is worked on: memory is slow, and would be waited for.

use super::cutoff::Lanes;
use super::lane_solve::BYTE_LIGHTS;
use crate::{Pixel, stream};

/// What is done for the next blocks.
pub(super) enum Ahead<'a, K> {
    /// Of these, what lies so many blocks on in memory is fetched.
    Fetch(&'a [&'a Lanes<K>], usize),
    /// Nothing is.
    Nothing,
}

impl<K: Pixel> Ahead<'_, K> {
    /// In so many parts: of many reads at once the last ones wait, and the work with them.
    #[inline(always)]
    pub fn parts(&self, vectors: usize) -> usize {
        match self {
            Self::Fetch(keys, _) if K::CODES.is_some() && keys.len() <= BYTE_LIGHTS => 1, // so little is fetched at once
            Self::Fetch(..) => 2 + vectors,
            Self::Nothing => 1,
        }
    }

    /// Does a part of it; nothing beyond the last one.
    #[inline(always)]
    pub fn part(&self, part: usize, parts: usize) {
        if part >= parts {
            return;
        }
        match self {
            Self::Fetch(keys, blocks_on) => {
                for key in &keys[part * keys.len() / parts..(part + 1) * keys.len() / parts] {
                    stream::prefetch(key, *blocks_on);
                }
            }
            Self::Nothing => {}
        }
    }
}

/// How far on so many images are to be fetched. Streams of floats, or of many lights, are more than processors follow by themselves;
/// so are eight of bytes where a block lies across two cache lines, as in most arrays (`benches/results.tsv`).
pub(super) fn blocks_on<K>(images: usize) -> usize {
    /// Half of a first cache: what is fetched farther ahead is driven out again before it is read.
    const MOST_BYTES: usize = 1 << 14;
    const MOST_BLOCKS: usize = 16;
    (MOST_BYTES / (images * size_of::<Lanes<K>>()).max(1)).clamp(1, MOST_BLOCKS)
}
