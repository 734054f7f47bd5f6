//! The published specular filter on a block of pixels: one cutoff a pixel instead of a sorted list.
//!
//! Values up to the cutoff are kept. Ties need no care: a gap over the threshold lies between different values.

use super::lanes::{GROUP, LANES, Lanes};

/// How far up each pixel keeps its values.
pub(super) struct Cutoffs {
    /// The largest kept value: from the darkest up, the one below the first step over the gap that leaves at least 3.
    pub largest: Lanes<f32>,
    /// True where no pixel drops a value.
    pub keep_all: bool,
}

// Not f32::min and f32::max: these take care of NaN, which costs three instructions instead of one.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn largest(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The cutoffs of values, one entry a light, at least 3.
#[inline(always)]
pub(super) fn cutoffs(values: &[Lanes<f32>], gap: f32) -> Cutoffs {
    match values.try_into() {
        Ok(eight) => sorted_cutoffs(eight, gap),
        Err(_) => grown_cutoffs(values, gap),
    }
}

/// Of eight lights, by a network of 19 exchanges (Knuth, The Art of Computer Programming 3, section 5.3.4).
#[inline(always)]
fn sorted_cutoffs(values: &[Lanes<f32>; 8], gap: f32) -> Cutoffs {
    let (mut cutoffs, mut dropped) = (Lanes::of(0.0), false);
    for lane in 0..LANES {
        let [a, b, c, d, e, f, g, h] = values;
        let mut s = [a[lane], b[lane], c[lane], d[lane], e[lane], f[lane], g[lane], h[lane]];
        macro_rules! exchange {
            ($($a:literal $b:literal),*) => {$( (s[$a], s[$b]) = (least(s[$a], s[$b]), largest(s[$a], s[$b])); )*};
        }
        // Literal places, or the values do not stay in registers.
        exchange!(0 1, 2 3, 4 5, 6 7, 0 2, 1 3, 4 6, 5 7, 1 2, 5 6, 0 4, 1 5, 2 6, 3 7, 2 4, 3 5, 1 2, 3 4, 5 6);
        let mut cutoff = s[7];
        for kept in (3..8).rev() {
            cutoff = if s[kept] - s[kept - 1] > gap { s[kept - 1] } else { cutoff };
        }
        cutoffs[lane] = cutoff;
        dropped |= s[7] > cutoff;
    }
    Cutoffs { keep_all: !dropped, largest: cutoffs }
}

/// Of any number of lights without sorting: begin at the third darkest, and take in what is within the gap until nothing is.
#[inline(always)]
fn grown_cutoffs(values: &[Lanes<f32>], gap: f32) -> Cutoffs {
    let (mut cutoffs, brightest) = extremes(values);
    // Each round reaches further in at least one pixel, or is the last.
    for _ in 3..=values.len() {
        for lane in 0..LANES {
            // Where the brightest is within the gap, so is all between.
            let is_far = brightest[lane] - cutoffs[lane] > gap;
            cutoffs[lane] = if is_far { cutoffs[lane] } else { brightest[lane] };
        }
        if !is_any_over(&brightest, &cutoffs) {
            break;
        }
        let before = cutoffs;
        let (groups, rest) = values.as_chunks::<GROUP>();
        for values in groups {
            reach(values, gap, &mut cutoffs);
        }
        for value in rest {
            reach(std::array::from_ref(value), gap, &mut cutoffs);
        }
        // Not a question of equality: NaN outside the mask must not go round for ever.
        if !is_any_over(&cutoffs, &before) {
            break;
        }
    }
    Cutoffs { keep_all: !is_any_over(&brightest, &cutoffs), largest: cutoffs }
}

/// The third darkest and the brightest values.
#[inline(always)]
fn extremes(values: &[Lanes<f32>]) -> (Lanes<f32>, Lanes<f32>) {
    let [mut first, mut second, mut third] = [Lanes::of(f32::INFINITY); 3];
    let mut brightest = Lanes::of(f32::NEG_INFINITY);
    for value in values {
        for lane in 0..LANES {
            let value = value[lane];
            let over_first = largest(first[lane], value);
            let over_second = largest(second[lane], over_first);
            first[lane] = least(first[lane], value);
            second[lane] = least(second[lane], over_first);
            third[lane] = least(third[lane], over_second);
            brightest[lane] = largest(brightest[lane], value);
        }
    }
    (third, brightest)
}

/// Raises the cutoffs to the largest of some values within the gap.
#[inline(always)]
fn reach<const COUNT: usize>(values: &[Lanes<f32>; COUNT], gap: f32, cutoffs: &mut Lanes<f32>) {
    for lane in 0..LANES {
        let cutoff = cutoffs[lane];
        let mut reached = cutoff;
        for light in 0..COUNT {
            let value = values[light][lane];
            reached = largest(reached, if value - cutoff > gap { cutoff } else { value });
        }
        cutoffs[lane] = reached;
    }
}

/// True where a value of the first is over that of the second.
#[inline(always)]
fn is_any_over(values: &Lanes<f32>, others: &Lanes<f32>) -> bool {
    let mut over = false;
    for lane in 0..LANES {
        over |= values[lane] > others[lane];
    }
    over
}

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    use super::super::lanes::Vector;
    use super::*;

    /// Word for word: sort, walk up, stop at the first gap.
    fn slow_cutoff(values: &[f32], gap: f32) -> f32 {
        let mut sorted = values.to_vec();
        sorted.sort_unstable_by(f32::total_cmp);
        let kept = (3..sorted.len()).find(|&kept| sorted[kept] - sorted[kept - 1] > gap).unwrap_or(sorted.len());
        sorted[kept - 1]
    }

    fn check(lights: usize, gap: f32, mut level: impl FnMut(usize, usize) -> f32) {
        let of_light = |light: usize| Vector(std::array::from_fn(|lane| level(light, lane)));
        let values: Vec<Lanes<f32>> = (0..lights).map(of_light).collect();
        let Cutoffs { largest: found, keep_all } = cutoffs(&values, gap);
        let dropped = (0..LANES).any(|lane| values.iter().any(|value| value[lane] > found[lane]));
        assert_eq!(keep_all, !dropped, "{lights} lights, gap {gap}");
        for lane in 0..LANES {
            let values: Vec<f32> = values.iter().map(|value| value[lane]).collect();
            assert_eq!(found[lane], slow_cutoff(&values, gap), "{values:?}, gap {gap}");
        }
    }

    /// Stairs of steps as high as the gap, each pixel's begun at another light: darkest first one round takes them all, darkest
    /// last each round takes one.
    #[test]
    fn stairs_are_climbed_in_any_order_of_the_lights() {
        for lights in [8, 9, 24, 96] {
            for (descends, step) in [(false, 1), (true, 1), (false, 2), (true, 2)] {
                check(lights, 1.0, |light, lane| {
                    let place = (light + lane) % lights;
                    (step * (if descends { lights - 1 - place } else { place })) as f32
                });
            }
        }
    }
}
