//! Sums over any of eight elements by look-ups in tables that a vector register holds and permutes at once.

/// Elements of a byte.
const BYTE_BITS: usize = 8;

/// Elements of one look-up: their subsets are as many as the floats of a register of AVX2. Wider registers use the same, so that
/// sums have the same bits everywhere.
pub(super) const GROUP: usize = 3;

/// Floats of the widest register.
const WIDEST: usize = 16;

/// Sums over the subsets of up to eight elements with `ENTRIES` values each.
#[derive(Clone, Debug)]
pub struct SubsetSums<const ENTRIES: usize> {
    /// For each group of elements and each entry: the sums by the bits of the subset, twice over where a register is wider.
    pub(super) tables: [[[f32; WIDEST]; ENTRIES]; BYTE_BITS.div_ceil(GROUP)],
}

impl<const ENTRIES: usize> SubsetSums<ENTRIES> {
    /// Tables of up to eight elements.
    pub fn new(elements: &[[f32; ENTRIES]]) -> Self {
        let mut tables = [[[0.0; WIDEST]; ENTRIES]; BYTE_BITS.div_ceil(GROUP)];
        for (index, element) in elements.iter().enumerate() {
            let bit = 1 << (index % GROUP);
            for (table, value) in tables[index / GROUP].iter_mut().zip(element) {
                for subset in (0..WIDEST).filter(|subset| subset & bit != 0) {
                    table[subset] += value;
                }
            }
        }
        Self { tables }
    }
}
