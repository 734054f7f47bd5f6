//! Gram matrices of the kept lights, `sum of l l^T`, for a block of pixels.
//!
//! The kept lights of a pixel are the bits of a byte for every eight lights, so that an entry of the matrix is the sum of three
//! look-ups in tables of eight values: as many as a vector register of AVX2 holds and permutes at once.

use super::cutoff::{LANES, Lanes};

/// Lights in one byte of kept bits.
pub(super) const BYTE_LIGHTS: usize = 8;

/// Entries of a symmetric 3 x 3 matrix: xx, xy, xz, yy, yz, zz.
pub(super) const ENTRIES: usize = 6;

/// Lights of one look-up.
const GROUP_LIGHTS: usize = 3;
const GROUPS: usize = BYTE_LIGHTS.div_ceil(GROUP_LIGHTS);
const SUBSETS: usize = 1 << GROUP_LIGHTS;

/// What eight lights add to a Gram matrix.
#[derive(Clone, Debug)]
pub(super) struct GramTables {
    /// `l l^T` of each light; zero beyond the last.
    products: [[f32; ENTRIES]; BYTE_LIGHTS],
    /// Its sums over the subsets of each group of lights, by entry.
    sums: [[[f32; SUBSETS]; ENTRIES]; GROUPS],
}

impl GramTables {
    /// Tables of up to eight lights.
    pub fn new(directions: &[[f32; 3]]) -> Self {
        let mut products = [[0.0; ENTRIES]; BYTE_LIGHTS];
        for (product, &[x, y, z]) in products.iter_mut().zip(directions) {
            *product = [x * x, x * y, x * z, y * y, y * z, z * z];
        }
        let mut sums = [[[0.0; SUBSETS]; ENTRIES]; GROUPS];
        for (light, product) in products.iter().enumerate() {
            let bit = 1 << (light % GROUP_LIGHTS);
            for (sums, entry) in sums[light / GROUP_LIGHTS].iter_mut().zip(product) {
                for subset in (0..SUBSETS).filter(|subset| subset & bit != 0) {
                    sums[subset] += entry;
                }
            }
        }
        Self { products, sums }
    }

    /// `gram += l l^T` over the lights whose bits are set, by pixel.
    #[inline(always)]
    pub fn add(&self, kept: &Lanes<u8>, gram: &mut [Lanes<f32>; ENTRIES]) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            #[allow(unsafe_code)]
            unsafe {
                self.add_avx2(kept, gram);
            }
            return;
        }
        self.add_light_by_light(kept, gram);
    }

    /// The plain form.
    #[inline(always)]
    fn add_light_by_light(&self, kept: &Lanes<u8>, gram: &mut [Lanes<f32>; ENTRIES]) {
        for lane in 0..LANES {
            let mut sums: [f32; ENTRIES] = std::array::from_fn(|entry| gram[entry][lane]);
            for (light, product) in self.products.iter().enumerate() {
                let is_kept = kept[lane] >> light & 1 == 1;
                for (sum, product) in sums.iter_mut().zip(product) {
                    *sum += if is_kept { *product } else { 0.0 };
                }
            }
            for (gram, sum) in gram.iter_mut().zip(sums) {
                gram[lane] = sum;
            }
        }
    }

    /// Eight pixels and eight subsets at once; a compiler does not find this by itself.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn add_avx2(&self, kept: &Lanes<u8>, gram: &mut [Lanes<f32>; ENTRIES]) {
        use std::arch::x86_64::{
            _mm_cvtsi64_si128, _mm256_add_ps, _mm256_cvtepu8_epi32, _mm256_permutevar8x32_ps, _mm256_srli_epi32,
        };
        const WIDTH: usize = 8;
        for (step, kept) in kept.as_chunks::<WIDTH>().0.iter().enumerate() {
            // The permutation looks at the lowest three bits alone.
            let first = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(i64::from_le_bytes(*kept)));
            let groups = [first, _mm256_srli_epi32::<3>(first), _mm256_srli_epi32::<6>(first)];
            for (entry, gram) in gram.iter_mut().enumerate() {
                let place = &mut gram.as_chunks_mut::<WIDTH>().0[step];
                let mut sum = bytemuck::must_cast(*place);
                for (sums, subsets) in self.sums.iter().zip(groups) {
                    sum = _mm256_add_ps(sum, _mm256_permutevar8x32_ps(bytemuck::must_cast(sums[entry]), subsets));
                }
                *place = bytemuck::must_cast(sum);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_subset_has_the_sum_of_its_lights() {
        let ring: Vec<[f32; 3]> = (0..BYTE_LIGHTS)
            .map(|light| {
                let (y, x) = (light as f32 * 0.7).sin_cos();
                [0.6 * x, 0.6 * y, 0.8]
            })
            .collect();
        for lights in [3, 5, 8] {
            let tables = GramTables::new(&ring[..lights]);
            for first in (0..1 << lights).step_by(LANES) {
                let kept: Lanes<u8> = std::array::from_fn(|lane| ((first + lane) & ((1 << lights) - 1)) as u8);
                let [mut fast, mut slow] = [[[0.5f32; LANES]; ENTRIES]; 2];
                tables.add(&kept, &mut fast);
                tables.add_light_by_light(&kept, &mut slow);
                for lane in 0..LANES {
                    let plain = |row: usize, col: usize| {
                        let kept_lights =
                            ring[..lights].iter().enumerate().filter(|(light, _)| kept[lane] >> light & 1 == 1);
                        0.5 + kept_lights.map(|(_, light)| light[row] * light[col]).sum::<f32>()
                    };
                    let expected = [plain(0, 0), plain(0, 1), plain(0, 2), plain(1, 1), plain(1, 2), plain(2, 2)];
                    for entry in 0..ENTRIES {
                        assert!((fast[entry][lane] - expected[entry]).abs() < 1e-5);
                        assert!((slow[entry][lane] - expected[entry]).abs() < 1e-5);
                    }
                }
            }
        }
    }
}
