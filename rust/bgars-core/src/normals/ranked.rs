//! Lights in the order of their values, for some pixels at once.

use super::lanes::{Lanes, Vector, dot};

/// Pixels worked on at once: their sums over all windows fit into the nearest cache.
pub(super) const WIDTH: usize = 16;

/// One quantity of these.
pub(super) type Row<T> = Vector<T, WIDTH>;

/// What lifts a clipped value over all that are not: a power of two, which rounds nothing.
const LIFT: f32 = (1u128 << 64) as f32;

/// The lights of some pixels by their rank: the clipped last, else the darker first, of equal values the lower number.
pub(super) struct Ranks {
    pub of_lights: Vec<Row<u32>>,
    /// The lights in that order.
    pub lights: Vec<Ranked>,
    /// Medians of the values, clipped or not; of an even number the mean of the two in the middle.
    pub medians: Row<f32>,
    /// True where every value is zero.
    pub black: Row<bool>,
    /// True where a clipped value cannot be lifted over the others.
    pub unsure: Row<bool>,
    /// What is compared.
    keys: Vec<Row<f32>>,
}

/// A light in its rank.
#[derive(Clone, Copy)]
pub(super) struct Ranked {
    pub value: Row<f32>,
    pub direction: [Row<f32>; 3],
    /// 1 where it is clipped, else 0.
    pub clipped: Row<u32>,
}

impl Ranked {
    const ZERO: Self = Self { value: Row::of(0.0), direction: [Row::of(0.0); 3], clipped: Row::of(0) };

    /// What a facet would show under it.
    #[inline(always)]
    pub fn predicted<const FMA: bool>(&self, facets: &[Row<f32>; 3], lane: usize) -> f32 {
        let direction = [self.direction[0][lane], self.direction[1][lane], self.direction[2][lane]];
        dot::<FMA>(direction, [facets[0][lane], facets[1][lane], facets[2][lane]])
    }
}

impl Ranks {
    pub fn new(lights: usize) -> Self {
        Self {
            of_lights: vec![Row::of(0); lights],
            lights: vec![Ranked::ZERO; lights],
            medians: Row::of(0.0),
            black: Row::of(false),
            unsure: Row::of(false),
            keys: vec![Row::of(0.0); lights],
        }
    }

    /// Takes the lights of the pixels from `first` on.
    #[inline(always)]
    pub fn fill(&mut self, directions: &[[f32; 3]], values: &[Lanes<f32>], clipped: &[Lanes<bool>], first: usize) {
        let (mut sizes, mut unsure, mut clips) = (Row::of(0.0), Row::of(0), false);
        for ((key, value), clipped) in self.keys.iter_mut().zip(values).zip(clipped) {
            for lane in 0..WIDTH {
                let (value, clipped) = (value[first + lane], clipped[first + lane]);
                key[lane] = value;
                sizes[lane] += value.abs();
                unsure[lane] |= u32::from(clipped & (value <= 0.0));
                clips |= clipped;
            }
        }
        for lane in 0..WIDTH {
            self.black[lane] = sizes[lane] == 0.0;
            self.unsure[lane] = unsure[lane] != 0;
        }
        self.rank();
        self.find_medians();
        if clips {
            for (key, clipped) in self.keys.iter_mut().zip(clipped) {
                for lane in 0..WIDTH {
                    key[lane] = if clipped[first + lane] { key[lane] * LIFT } else { key[lane] };
                }
            }
            self.rank();
        }
        for (light, direction) in directions.iter().enumerate() {
            let (ranks, value, clipped) = (&self.of_lights[light], &values[light], &clipped[light]);
            for lane in 0..WIDTH {
                let ranked = &mut self.lights[ranks[lane] as usize];
                ranked.value[lane] = value[first + lane];
                for axis in 0..3 {
                    ranked.direction[axis][lane] = direction[axis];
                }
                ranked.clipped[lane] = u32::from(clipped[first + lane]);
            }
        }
    }

    /// Ranks by the keys: every pair is compared once.
    #[inline(always)]
    fn rank(&mut self) {
        for light in 0..self.keys.len() {
            let key = self.keys[light];
            let mut rank = Row::of(0u32);
            for before in 0..light {
                // Copies, or the compiler has to ask what overlaps.
                let (other, mut other_rank) = (self.keys[before], self.of_lights[before]);
                for lane in 0..WIDTH {
                    let is_behind = other[lane] <= key[lane];
                    rank[lane] = if is_behind { rank[lane] + 1 } else { rank[lane] };
                    other_rank[lane] = if is_behind { other_rank[lane] } else { other_rank[lane] + 1 };
                }
                self.of_lights[before] = other_rank;
            }
            self.of_lights[light] = rank;
        }
    }

    #[inline(always)]
    fn find_medians(&mut self) {
        let lights = self.keys.len();
        let (below, above) = (((lights - 1) / 2) as u32, (lights / 2) as u32);
        let [mut lower, mut upper] = [Row::of(0.0); 2];
        for (key, rank) in self.keys.iter().zip(&self.of_lights) {
            for lane in 0..WIDTH {
                lower[lane] = if rank[lane] == below { key[lane] } else { lower[lane] };
                upper[lane] = if rank[lane] == above { key[lane] } else { upper[lane] };
            }
        }
        for lane in 0..WIDTH {
            self.medians[lane] = 0.5 * (lower[lane] + upper[lane]);
        }
    }
}
