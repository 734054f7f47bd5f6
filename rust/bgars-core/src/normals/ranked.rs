//! Lights in the order of their values, for some pixels at once.

use super::lane_solve::BYTE_LIGHTS;
use super::networks::sort_eight;

/// Pixels worked on at once: their sums over all windows fit into the nearest cache.
pub(super) const WIDTH: usize = 16;

/// One quantity of these.
pub(super) type Row<T> = [T; WIDTH];

/// Flag of a clipped light beside its number.
pub(super) const CLIPPED: u32 = 1 << 8;

/// The lights of some pixels by their rank: the clipped last, else the darker first, of equal values the lower number.
///
/// Aligned, and with it the stack that it lives on, for vectors that go there for want of registers (as in `lanes::Task`).
#[repr(align(64))]
pub(super) struct Ranked {
    pub lights: usize,
    pub values: [Row<f32>; BYTE_LIGHTS],
    pub directions: [[Row<f32>; 3]; BYTE_LIGHTS],
    /// Number of the light, and whether it is clipped.
    pub codes: [Row<u32>; BYTE_LIGHTS],
}

impl Ranked {
    pub fn new() -> Self {
        Self {
            lights: 0,
            values: [[0.0; WIDTH]; BYTE_LIGHTS],
            directions: [[[0.0; WIDTH]; 3]; BYTE_LIGHTS],
            codes: [[0; WIDTH]; BYTE_LIGHTS],
        }
    }

    /// Takes the lights of some pixels; returns the medians of their values.
    #[inline(always)]
    pub fn fill(
        &mut self,
        directions: &[[f32; 3]],
        value_of: impl Fn(usize, usize) -> f32,
        clipped: impl Fn(usize) -> u8,
    ) -> Row<f32> {
        self.lights = directions.len();
        for light in 0..BYTE_LIGHTS {
            // Places without a light rank last.
            let there = light < self.lights;
            let direction = if there { directions[light] } else { [0.0; 3] };
            for lane in 0..WIDTH {
                self.values[light][lane] = if there { value_of(light, lane) } else { f32::INFINITY };
                let flag = if !there || clipped(lane) >> light & 1 == 1 { CLIPPED } else { 0 };
                self.codes[light][lane] = light as u32 | flag;
            }
            self.directions[light] = direction.map(|component| [component; WIDTH]);
        }
        let medians = self.medians();
        macro_rules! exchange {
            ($($one:literal $other:literal),*) => {$( self.exchange::<$one, $other>(); )*};
        }
        sort_eight!(exchange);
        medians
    }

    /// True where every value is zero.
    #[inline(always)]
    pub fn is_black(&self) -> Row<bool> {
        let sizes = self.values[..self.lights].iter();
        let sums = sizes
            .fold([0.0; WIDTH], |sums: Row<f32>, values| std::array::from_fn(|lane| sums[lane] + values[lane].abs()));
        sums.map(|sum| sum == 0.0)
    }

    /// The medians of the values, clipped or not; of an even number the mean of the two in the middle.
    #[inline(always)]
    fn medians(&self) -> Row<f32> {
        let mut sorted = self.values;
        macro_rules! exchange {
            ($($one:literal $other:literal),*) => {$(
                for lane in 0..WIDTH {
                    let (a, b) = (sorted[$one][lane], sorted[$other][lane]);
                    (sorted[$one][lane], sorted[$other][lane]) = if b < a { (b, a) } else { (a, b) };
                }
            )*};
        }
        sort_eight!(exchange);
        let (lower, upper) = (sorted[(self.lights - 1) / 2], sorted[self.lights / 2]);
        std::array::from_fn(|lane| 0.5 * (lower[lane] + upper[lane]))
    }

    /// Puts two ranks into their order.
    #[inline(always)]
    fn exchange<const ONE: usize, const OTHER: usize>(&mut self) {
        for lane in 0..WIDTH {
            let (a, b) = (self.values[ONE][lane], self.values[OTHER][lane]);
            let (code, next) = (self.codes[ONE][lane], self.codes[OTHER][lane]);
            let (clipped, next_clipped) = (code & CLIPPED, next & CLIPPED);
            // Numbers, since a lazy `&&` would be a branch.
            let by_value = u32::from(b < a) | u32::from(b <= a) & u32::from(next < code);
            let swap = u32::from(clipped > next_clipped) | (u32::from(clipped == next_clipped) & by_value);
            let swap = swap != 0;
            (self.values[ONE][lane], self.values[OTHER][lane]) = if swap { (b, a) } else { (a, b) };
            (self.codes[ONE][lane], self.codes[OTHER][lane]) = if swap { (next, code) } else { (code, next) };
            for axis in 0..3 {
                let (a, b) = (self.directions[ONE][axis][lane], self.directions[OTHER][axis][lane]);
                (self.directions[ONE][axis][lane], self.directions[OTHER][axis][lane]) =
                    if swap { (b, a) } else { (a, b) };
            }
        }
    }
}
