//! The published specular filter on a block of pixels: one cutoff a pixel instead of a sorted list.
//!
//! Values up to the cutoff are kept. Ties need no care: a gap over the threshold lies between different values.

use super::lanes::{GROUP, LANES, Lanes};
use crate::key::Key;

/// How far up each pixel keeps its keys.
pub(super) struct Cutoffs<K> {
    /// The largest kept key: from the darkest up, the one below the first step over the gap that leaves at least 3.
    pub largest: Lanes<K>,
    /// True where no pixel drops a key.
    pub keep_all: bool,
}

/// The cutoffs of keys, one entry a light, at least 3.
#[inline(always)]
pub(super) fn cutoffs<K: Key>(keys: &[Lanes<K>], gap: K) -> Cutoffs<K> {
    match keys.try_into() {
        Ok(eight) => sorted_cutoffs(eight, gap),
        Err(_) => grown_cutoffs(keys, gap),
    }
}

/// Of eight lights, by a network of 19 exchanges (Knuth, The Art of Computer Programming 3, section 5.3.4).
#[inline(always)]
fn sorted_cutoffs<K: Key>(keys: &[Lanes<K>; 8], gap: K) -> Cutoffs<K> {
    let [mut largest, mut brightest] = [Lanes::of(K::LEAST); 2];
    for lane in 0..LANES {
        let mut s = [
            keys[0][lane],
            keys[1][lane],
            keys[2][lane],
            keys[3][lane],
            keys[4][lane],
            keys[5][lane],
            keys[6][lane],
            keys[7][lane],
        ];
        macro_rules! exchange {
            ($($a:literal $b:literal),*) => {$( (s[$a], s[$b]) = (s[$a].least(s[$b]), s[$a].largest(s[$b])); )*};
        }
        // Literal places, or the values do not stay in registers.
        exchange!(0 1, 2 3, 4 5, 6 7, 0 2, 1 3, 4 6, 5 7, 1 2, 5 6, 0 4, 1 5, 2 6, 3 7, 2 4, 3 5, 1 2, 3 4, 5 6);
        let mut cutoff = s[7];
        for kept in (3..8).rev() {
            cutoff = if s[kept].is_over(s[kept - 1], gap) { s[kept - 1] } else { cutoff };
        }
        (largest[lane], brightest[lane]) = (cutoff, s[7]);
    }
    Cutoffs { keep_all: !is_any_over(&brightest, &largest, K::gap(0.0)), largest }
}

/// Of any number of lights without sorting: begin at the third darkest, and take in what is within the gap until nothing is.
#[inline(always)]
fn grown_cutoffs<K: Key>(keys: &[Lanes<K>], gap: K) -> Cutoffs<K> {
    let (mut cutoffs, brightest) = extremes(keys);
    // Each round reaches further in at least one pixel, or is the last.
    for _ in 3..=keys.len() {
        for lane in 0..LANES {
            // Where the brightest is within the gap, so is all between.
            let is_far = brightest[lane].is_over(cutoffs[lane], gap);
            cutoffs[lane] = if is_far { cutoffs[lane] } else { brightest[lane] };
        }
        if !is_any_over(&brightest, &cutoffs, K::gap(0.0)) {
            break;
        }
        let before = cutoffs;
        let (groups, rest) = keys.as_chunks::<GROUP>();
        for keys in groups {
            reach(keys, gap, &mut cutoffs);
        }
        for key in rest {
            reach(std::array::from_ref(key), gap, &mut cutoffs);
        }
        // Not a question of equality: NaN outside the mask must not go round for ever.
        if !is_any_over(&cutoffs, &before, K::gap(0.0)) {
            break;
        }
    }
    Cutoffs { keep_all: !is_any_over(&brightest, &cutoffs, K::gap(0.0)), largest: cutoffs }
}

/// The third darkest and the brightest keys.
#[inline(always)]
fn extremes<K: Key>(keys: &[Lanes<K>]) -> (Lanes<K>, Lanes<K>) {
    let [mut first, mut second, mut third] = [Lanes::of(K::LARGEST); 3];
    let mut brightest = Lanes::of(K::LEAST);
    for key in keys {
        for lane in 0..LANES {
            let key = key[lane];
            let over_first = first[lane].largest(key);
            let over_second = second[lane].largest(over_first);
            first[lane] = first[lane].least(key);
            second[lane] = second[lane].least(over_first);
            third[lane] = third[lane].least(over_second);
            brightest[lane] = brightest[lane].largest(key);
        }
    }
    (third, brightest)
}

/// Raises the cutoffs to the largest of some keys within the gap.
#[inline(always)]
fn reach<K: Key, const COUNT: usize>(keys: &[Lanes<K>; COUNT], gap: K, cutoffs: &mut Lanes<K>) {
    for lane in 0..LANES {
        let cutoff = cutoffs[lane];
        let mut reached = cutoff;
        for light in 0..COUNT {
            let key = keys[light][lane];
            let within = if key.is_over(cutoff, gap) { cutoff } else { key };
            reached = reached.largest(within);
        }
        cutoffs[lane] = reached;
    }
}

/// True where a key of the first is over that of the second by more than the gap.
#[inline(always)]
fn is_any_over<K: Key>(keys: &Lanes<K>, others: &Lanes<K>, gap: K) -> bool {
    let mut over = false;
    for lane in 0..LANES {
        over |= keys[lane].is_over(others[lane], gap);
    }
    over
}

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    use super::super::lanes::Vector;
    use super::*;

    /// Word for word: sort, walk up, stop at the first gap.
    fn slow_cutoff(values: &[u8], gap: u8) -> u8 {
        let mut sorted = values.to_vec();
        sorted.sort_unstable();
        let kept = (3..sorted.len()).find(|&kept| sorted[kept] - sorted[kept - 1] > gap).unwrap_or(sorted.len());
        sorted[kept - 1]
    }

    fn random_keys(lights: usize, seed: u32) -> Vec<Lanes<u8>> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let level = (state >> 24) as u8;
            // Half of the values in a dark cluster, so that gaps occur.
            if state & 1 == 0 { level / 5 } else { level }
        };
        (0..lights).map(|_| Vector(std::array::from_fn(|_| next()))).collect()
    }

    /// Stairs of steps as high as the gap, each pixel's begun at another light: darkest first one round takes them all, darkest
    /// last each round takes one.
    #[test]
    fn stairs_are_climbed_in_any_order_of_the_lights() {
        const GAP: u8 = 1;
        for lights in [8, 9, 24, 96] {
            for (descends, step) in [(false, GAP), (true, GAP), (false, GAP + 1), (true, GAP + 1)] {
                let level = |light: usize, lane: usize| {
                    let place = (light + lane) % lights;
                    step * (if descends { lights - 1 - place } else { place }) as u8
                };
                let keys: Vec<Lanes<u8>> =
                    (0..lights).map(|light| Vector(std::array::from_fn(|lane| level(light, lane)))).collect();
                let found = cutoffs(&keys, GAP).largest;
                for lane in 0..LANES {
                    let values: Vec<u8> = keys.iter().map(|key| key[lane]).collect();
                    assert_eq!(found[lane], slow_cutoff(&values, GAP), "{values:?}");
                }
            }
        }
    }

    #[test]
    fn cutoffs_are_those_of_a_sorted_list() {
        // From 0 to the largest.
        let word = |byte: u8| u16::from(byte) * (u16::MAX / u16::from(u8::MAX));
        let few = [(3, 0), (4, 20), (5, 50), (8, 0), (8, 50), (8, 255), (13, 20), (16, 40), (17, 20), (25, 15)];
        let many = [(9, 30), (24, 10), (24, 130), (24, 255), (96, 0), (96, 3)];
        for (lights, gap) in few.into_iter().chain(many) {
            for seed in 0..50 {
                let keys = random_keys(lights, seed);
                let Cutoffs { largest: found, keep_all } = cutoffs(&keys, gap);
                let dropped = (0..LANES).any(|lane| keys.iter().any(|key| key[lane] > found[lane]));
                assert_eq!(keep_all, !dropped, "{lights} lights, gap {gap}");
                let wide: Vec<Lanes<u16>> = keys.iter().map(|key| Vector(key.map(word))).collect();
                let float: Vec<Lanes<f32>> = keys.iter().map(|key| Vector(key.map(f32::from))).collect();
                let of_words = cutoffs(&wide, word(gap));
                assert_eq!((of_words.largest, of_words.keep_all), (Vector(found.map(word)), keep_all));
                let of_floats = cutoffs(&float, f32::from(gap));
                assert_eq!((of_floats.largest, of_floats.keep_all), (Vector(found.map(f32::from)), keep_all));
                for lane in 0..LANES {
                    let values: Vec<u8> = keys.iter().map(|key| key[lane]).collect();
                    assert_eq!(found[lane], slow_cutoff(&values, gap), "{values:?}, gap {gap}");
                }
            }
        }
    }
}
