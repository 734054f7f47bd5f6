//! The lights that a block of pixels keeps.

use super::cutoff::{LANES, Lanes};
use super::lane_solve::BYTE_LIGHTS;
use crate::Pixel;

/// The lights that a block keeps.
pub(super) struct Kept<K> {
    /// The keys; of a light that is dropped, zero.
    pub keys: Vec<Lanes<K>>,
    /// A bit a light, a byte for every eight; set where nothing was chosen.
    pub bits: Vec<Lanes<u8>>,
}

impl<K: Pixel> Kept<K> {
    pub fn new(lights: usize) -> Self {
        Self { keys: vec![[K::ZERO; LANES]; lights], bits: vec![[u8::MAX; LANES]; lights.div_ceil(BYTE_LIGHTS)] }
    }

    /// Takes the keys up to the cutoffs.
    #[inline(always)]
    pub fn choose(&mut self, keys: &[&Lanes<K>], cutoffs: &Lanes<K>) {
        let bytes = keys.chunks(BYTE_LIGHTS).zip(self.keys.chunks_mut(BYTE_LIGHTS)).zip(&mut self.bits);
        for ((keys, kept_keys), bits) in bytes {
            // Written to once, so that the compiler need not ask what overlaps.
            let mut wide = [K::Bits::from(0); LANES];
            for (light, (&&key, kept_key)) in keys.iter().zip(kept_keys).enumerate() {
                let mut kept = key;
                for lane in 0..LANES {
                    let keep = is_kept(key[lane], cutoffs[lane]);
                    kept[lane] = if keep { key[lane] } else { K::ZERO };
                    let bit = K::Bits::from(if keep { 1 << light } else { 0 });
                    wide[lane] = wide[lane] | bit;
                }
                *kept_key = kept;
            }
            *bits = wide.map(K::byte);
        }
    }

    /// Takes the keys of up to eight lights whose bits are set.
    #[inline(always)]
    pub fn choose_bits(&mut self, keys: &[&Lanes<K>], bits: Lanes<u8>) {
        for (light, (&&key, kept_key)) in keys.iter().zip(&mut self.keys).enumerate() {
            let mut kept = key;
            for lane in 0..LANES {
                kept[lane] = if bits[lane] >> light & 1 == 1 { key[lane] } else { K::ZERO };
            }
            *kept_key = kept;
        }
        self.bits[0] = bits;
    }

    /// True where a lane keeps a light.
    pub fn holds(&self, light: usize, lane: usize) -> bool {
        self.bits[light / BYTE_LIGHTS][lane] >> (light % BYTE_LIGHTS) & 1 == 1
    }

    /// How many they are.
    #[inline(always)]
    pub fn counts(&self) -> Lanes<u16> {
        let mut counts = [0; LANES];
        for bits in &self.bits {
            for lane in 0..LANES {
                counts[lane] += bits[lane].count_ones() as u16;
            }
        }
        counts
    }
}

/// True for a light that is kept.
#[inline(always)]
fn is_kept<K: Pixel>(key: K, cutoff: K) -> bool {
    !key.is_over(cutoff, K::gap(0.0))
}
