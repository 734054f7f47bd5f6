//! Sums over any of eight elements by look-ups in tables that a vector register holds and permutes at once.

/// Elements of a byte.
const BYTE_BITS: usize = 8;

/// Sums over the subsets of up to eight elements with `ENTRIES` values each.
#[derive(Clone, Debug)]
pub struct SubsetSums<const ENTRIES: usize> {
    /// For each three elements and each entry: the sums by the bits of the subset. A register of AVX2 holds such a table.
    pub(super) of_three: [[[f32; 8]; ENTRIES]; BYTE_BITS.div_ceil(3)],
    /// The same for each four elements; a register of AVX-512 holds such a table.
    #[cfg(target_arch = "x86_64")]
    pub(super) of_four: [[[f32; 16]; ENTRIES]; BYTE_BITS / 4],
}

impl<const ENTRIES: usize> SubsetSums<ENTRIES> {
    /// Tables of up to eight elements.
    pub fn new(elements: &[[f32; ENTRIES]]) -> Self {
        Self {
            of_three: tables(elements),
            #[cfg(target_arch = "x86_64")]
            of_four: tables(elements),
        }
    }
}

/// Tables of `SUBSETS` sums, for as many elements at a time as have so many subsets.
fn tables<const SUBSETS: usize, const ENTRIES: usize, const TABLES: usize>(
    elements: &[[f32; ENTRIES]],
) -> [[[f32; SUBSETS]; ENTRIES]; TABLES] {
    let mut tables = [[[0.0; SUBSETS]; ENTRIES]; TABLES];
    for (tables, elements) in tables.iter_mut().zip(elements.chunks(SUBSETS.ilog2() as usize)) {
        for (index, element) in elements.iter().enumerate() {
            for (table, value) in tables.iter_mut().zip(element) {
                for subset in (0..SUBSETS).filter(|subset| subset >> index & 1 == 1) {
                    table[subset] += value;
                }
            }
        }
    }
    tables
}
