//! Many small records to one file: encoded on all threads, written in order, never all of it in memory.

use std::io::Write;
use std::ops::Range;

use rayon::prelude::*;

/// Records encoded at a time: a block of them stays in the second-level cache.
pub(super) const BLOCK: usize = 1 << 14;

/// Most blocks that are encoded while others are written.
const MAX_BATCH: usize = 16;

/// Writes `count` records, in their order.
///
/// # Inputs
/// `encode` replaces the content of its buffer by the records of a range, which may be empty.
///
/// # Method
/// One thread writes a batch of blocks while the others encode the next; buffers are used again. What is written does not
/// depend on the number of threads.
///
/// # Cost
/// Two batches of memory, at most 32 blocks, whatever `count` is.
pub(super) fn write_blocks(
    count: usize,
    encode: impl Fn(Range<usize>, &mut Vec<u8>) + Sync,
    out: &mut (impl Write + Send),
) -> std::io::Result<()> {
    let batch = (2 * rayon::current_num_threads()).min(MAX_BATCH);
    let encode_batch = |first: usize, buffers: &mut [Vec<u8>]| {
        buffers.par_iter_mut().enumerate().for_each(|(index, buffer)| {
            let start = ((first + index) * BLOCK).min(count);
            encode(start..(start + BLOCK).min(count), buffer);
        });
    };
    // The scope moves the whole loop into the pool, which is cheaper than entering it for every batch.
    rayon::scope(|_| {
        let mut ready = vec![Vec::new(); batch];
        let mut next = ready.clone();
        encode_batch(0, &mut ready);
        for first in (0..count.div_ceil(BLOCK)).step_by(batch) {
            let (written, ()) = rayon::join(
                || ready.iter().try_for_each(|block| out.write_all(block)),
                || encode_batch(first + batch, &mut next),
            );
            written?;
            std::mem::swap(&mut ready, &mut next);
        }
        Ok(())
    })
}
