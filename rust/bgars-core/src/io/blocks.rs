//! Many small records to one file: encoded on all threads, written in order, never all of it in memory.

use std::io::Write;

use rayon::prelude::*;

/// Most pieces that are encoded while others are written.
const MAX_BATCH: usize = 16;

/// Writes the records of `pieces` pieces, in their order.
///
/// # Inputs
/// `encode` replaces the content of its buffer by the records of a piece; beyond the last, by nothing. It also gets scratch
/// memory, which it finds again as it left it.
///
/// # Method
/// One thread writes a batch of pieces while the others encode the next; buffers are used again. What is written does not
/// depend on the number of threads.
///
/// # Cost
/// Two batches of memory, at most 32 pieces, however many there are.
pub(super) fn write_pieces<S: Default + Clone + Send + Sync>(
    pieces: usize,
    encode: impl Fn(usize, &mut S, &mut Vec<u8>) + Sync,
    out: &mut (impl Write + Send),
) -> std::io::Result<()> {
    let batch = (2 * rayon::current_num_threads()).min(MAX_BATCH);
    let encode_batch = |first: usize, buffers: &mut [(S, Vec<u8>)]| {
        buffers
            .par_iter_mut()
            .enumerate()
            .for_each(|(index, (scratch, buffer))| encode(first + index, scratch, buffer));
    };
    // The scope moves the whole loop into the pool, which is cheaper than entering it for every batch.
    rayon::scope(|_| {
        let mut ready = vec![(S::default(), Vec::new()); batch];
        let mut next = ready.clone();
        encode_batch(0, &mut ready);
        for first in (0..pieces).step_by(batch) {
            let (written, ()) = rayon::join(
                || ready.iter().try_for_each(|(_, block)| out.write_all(block)),
                || encode_batch(first + batch, &mut next),
            );
            written?;
            std::mem::swap(&mut ready, &mut next);
        }
        Ok(())
    })
}
