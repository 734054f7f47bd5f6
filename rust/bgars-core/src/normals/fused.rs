//! Products that are added without rounding between, where the processor does so in one step.

/// `sum + a b`.
#[inline(always)]
pub(super) fn add_product<const FMA: bool>(sum: f32, a: f32, b: f32) -> f32 {
    if FMA { a.mul_add(b, sum) } else { sum + a * b }
}

#[inline(always)]
pub(super) fn dot<const FMA: bool>([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> f32 {
    add_product::<FMA>(add_product::<FMA>(a * x, b, y), c, z)
}
