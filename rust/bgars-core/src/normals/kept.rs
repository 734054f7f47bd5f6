//! The lights that a block of pixels keeps.

use super::cutoff::{LANES, Lanes};
use super::lane_solve::BYTE_LIGHTS;
use crate::Pixel;

/// Pixels whose bytes are compared at once.
const EIGHT: usize = 8;

/// The lights that a block keeps.
pub(super) struct Kept<K> {
    /// The keys; of a light that is dropped, zero.
    pub keys: Vec<Lanes<K>>,
    /// A bit a light, a byte for every eight; set where nothing was chosen.
    pub bits: Vec<Lanes<u8>>,
    /// The same of eight pixels that keep every light.
    all: Vec<u64>,
}

impl<K: Pixel> Kept<K> {
    pub fn new(lights: usize) -> Self {
        let bytes = (0..lights).step_by(BYTE_LIGHTS);
        let bytes = bytes.map(|first| u8::MAX >> (BYTE_LIGHTS - (lights - first).min(BYTE_LIGHTS)));
        Self {
            keys: vec![[K::ZERO; LANES]; lights],
            bits: bytes.clone().map(|byte| [byte; LANES]).collect(),
            all: bytes.map(|byte| u64::from_ne_bytes([byte; EIGHT])).collect(),
        }
    }

    /// Drops none; the keys are left as they are.
    #[inline(always)]
    pub fn keep_all(&mut self) {
        for (bits, all) in self.bits.iter_mut().zip(&self.all) {
            *bits = bytemuck::must_cast([*all; LANES / EIGHT]);
        }
    }

    /// Takes the keys up to the cutoffs.
    #[inline(always)]
    pub fn choose(&mut self, keys: &[&Lanes<K>], cutoffs: &Lanes<K>) {
        let kept_keys = self.keys[..keys.len()].chunks_mut(BYTE_LIGHTS);
        let bytes = keys.chunks(BYTE_LIGHTS).zip(kept_keys).zip(&mut self.bits);
        for ((keys, kept_keys), bits) in bytes {
            // Written to once, so that the compiler need not ask what overlaps.
            let mut wide = [K::Bits::from(0); LANES];
            for (light, (&&key, kept_key)) in keys.iter().zip(kept_keys).enumerate() {
                let mut kept = key;
                for lane in 0..LANES {
                    let keep = is_kept(key[lane], cutoffs[lane]);
                    kept[lane] = if keep { key[lane] } else { K::ZERO };
                    wide[lane] = if keep { wide[lane] + K::Bits::from(1 << light) } else { wide[lane] };
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
    fn holds(&self, light: usize, lane: usize) -> bool {
        self.bits[light / BYTE_LIGHTS][lane] >> (light % BYTE_LIGHTS) & 1 == 1
    }

    /// The lights themselves, a flag a light for one lane after the other; asked for seldom.
    #[inline(never)]
    pub fn write_sets(&self, used: Option<&[bool]>, sets: &mut [bool]) {
        for (lane, sets) in sets.chunks_exact_mut(self.keys.len()).enumerate() {
            let here = used.is_none_or(|used| used[lane]);
            for (light, set) in sets.iter_mut().enumerate() {
                *set = here && self.holds(light, lane);
            }
        }
    }

    /// True where so many pixels, a multiple of eight of them, keep every light from the one at `at` on.
    #[inline(always)]
    pub fn are_whole(&self, lights: usize, at: usize, pixels: usize) -> bool {
        let bytes = lights.div_ceil(BYTE_LIGHTS);
        let mut whole = true;
        for (bits, &all) in self.bits[..bytes].iter().zip(&self.all[..bytes]) {
            for &eight in bits[at..at + pixels].as_chunks::<EIGHT>().0 {
                whole &= u64::from_ne_bytes(eight) == all;
            }
        }
        whole
    }

    /// How many they are.
    #[inline(always)]
    pub fn counts(&self, lights: usize) -> Lanes<u16> {
        let mut counts = [0; LANES];
        for bits in &self.bits[..lights.div_ceil(BYTE_LIGHTS)] {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_whole_when_each_holds_every_light() {
        for lights in [3, 8, 11, 16] {
            let mut kept = Kept::<u8>::new(lights);
            assert!(kept.are_whole(lights, 0, LANES));
            for (light, lane) in [(0, 7), (lights - 1, 8), (1, 63)] {
                let mut keys = vec![[1; LANES]; lights];
                keys[light][lane] = 9;
                kept.choose(&keys.iter().collect::<Vec<_>>(), &[1; LANES]);
                for at in (0..LANES).step_by(2 * EIGHT) {
                    let has_it = (at..at + 2 * EIGHT).contains(&lane);
                    assert_eq!(
                        kept.are_whole(lights, at, 2 * EIGHT),
                        !has_it,
                        "{lights} lights, light {light} of pixel {lane} is dropped, from pixel {at} on"
                    );
                }
                assert!(!kept.holds(light, lane));
                assert_eq!(
                    kept.counts(lights).iter().map(|&count| usize::from(count)).sum::<usize>(),
                    LANES * lights - 1
                );
            }
        }
    }
}
