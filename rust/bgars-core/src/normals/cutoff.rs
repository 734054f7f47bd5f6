//! The published specular filter on many pixels at once: one cutoff a pixel instead of a sorted list.
//!
//! Values up to the cutoff are kept. Ties need no care: a gap over the threshold lies between different values.

use std::borrow::Borrow;

use super::networks::{sort_eight, sort_sixteen, sort_twenty_four};
use crate::Pixel;
use crate::key::Key;

/// Pixels worked on at once.
pub(super) const LANES: usize = 64;

/// One quantity of a block of pixels.
pub(super) type Lanes<T> = [T; LANES];

/// How far up each pixel keeps its keys.
pub(super) struct Cutoffs<K> {
    /// The largest kept key: from the darkest up, the one below the first step over the gap that leaves at least 3.
    pub largest: Lanes<K>,
    /// The largest key.
    pub brightest: Lanes<K>,
    /// True where it is known that no pixel drops a key.
    pub keep_all: bool,
}

impl<K: Pixel> Cutoffs<K> {
    /// The smallest step from a cutoff to the next key, over the pixels; infinite where none drops a key.
    #[inline(always)]
    pub fn least_cut(&self, keys: &[&Lanes<K>]) -> f32 {
        let mut next = [K::LARGEST; LANES];
        for &&key in keys {
            for lane in 0..LANES {
                let is_dropped = key[lane].is_over(self.largest[lane], K::gap(0.0));
                next[lane] = if is_dropped { next[lane].least(key[lane]) } else { next[lane] };
            }
        }
        next.iter()
            .zip(&self.largest)
            .fold(f32::INFINITY, |cut, (next, largest)| cut.min(next.to_f32() - largest.to_f32()))
    }
}

/// The cutoffs of keys, one entry a light, at least 3; `holds_blocks` as of [`crate::vector::Vector`].
#[inline(always)]
pub(super) fn cutoffs<K: Key>(keys: &[&Lanes<K>], gap: K, holds_blocks: bool) -> Cutoffs<K> {
    if let Ok(keys) = keys.try_into() {
        sort_by_eight(keys, gap)
    } else if holds_blocks && are_sorted::<K>(keys.len()) {
        sorted_cutoffs(keys, gap)
    } else {
        grown_cutoffs(keys, gap, None)
    }
}

/// The same of keys whose extremes are known.
#[inline(always)]
pub(super) fn cutoffs_from<K: Key>(keys: &[&Lanes<K>], gap: K, extremes: &Extremes<K, LANES>) -> Cutoffs<K> {
    grown_cutoffs(keys, gap, Some(extremes))
}

/// True where more than eight lights are sorted: bytes, of which a register holds a block. Of 9 and 10, rounds are as fast
/// (`benches/results.tsv`).
pub(super) fn are_sorted<K>(lights: usize) -> bool {
    size_of::<K>() == 1 && (11..=MOST_SORTED).contains(&lights)
}

/// Most lights that are sorted: their keys stay in registers.
const MOST_SORTED: usize = 24;

/// Puts pairs of places into their order.
macro_rules! exchange {
    ($array:ident: $($a:literal $b:literal),*) => {$(
        ($array[$a], $array[$b]) = ($array[$a].least($array[$b]), $array[$a].largest($array[$b]));
    )*};
}

/// Defines the cutoffs by sorting so many places of each pixel.
macro_rules! sort_by {
    ($name:ident, $count:literal, $network:ident) => {
        #[inline(always)]
        fn $name<K: Key>(places: &[&Lanes<K>; $count], gap: K) -> Cutoffs<K> {
            // Floats from one array instead of many places, or the compiler does not vectorise them.
            let copies;
            let keys: [&Lanes<K>; $count] = if size_of::<K>() < size_of::<f32>() {
                *places
            } else {
                copies = places.map(|key| *key);
                std::array::from_fn(|light| &copies[light])
            };
            let [mut largest, mut brightest] = [[K::LEAST; LANES]; 2];
            for lane in 0..LANES {
                let mut s: [K; $count] = std::array::from_fn(|light| keys[light][lane]);
                $network!(exchange s:);
                let mut cutoff = s[$count - 1];
                for kept in (3..$count).rev() {
                    cutoff = if s[kept].is_over(s[kept - 1], gap) { s[kept - 1] } else { cutoff };
                }
                (largest[lane], brightest[lane]) = (cutoff, s[$count - 1]);
            }
            Cutoffs { largest, brightest, keep_all: !is_over_any(&brightest, &largest) }
        }
    };
}
sort_by!(sort_by_eight, 8, sort_eight);
sort_by!(sort_by_sixteen, 16, sort_sixteen);
sort_by!(sort_by_twenty_four, 24, sort_twenty_four);

/// Of as many lights as [`are_sorted`] says.
#[inline(always)]
fn sorted_cutoffs<K: Key>(keys: &[&Lanes<K>], gap: K) -> Cutoffs<K> {
    // Whole networks by themselves: places that are put together first cost a tenth.
    if let Ok(keys) = keys.try_into() {
        return sort_by_sixteen(keys, gap);
    }
    if let Ok(keys) = keys.try_into() {
        return sort_by_twenty_four(keys, gap);
    }
    // Places without a light hold the brightest key once more, which drops nothing.
    let brightest = brightest_of(keys);
    let mut places = [&brightest; MOST_SORTED];
    places[..keys.len()].copy_from_slice(keys);
    match places.first_chunk() {
        Some(first) if keys.len() < first.len() => sort_by_sixteen(first, gap),
        _ => sort_by_twenty_four(&places, gap),
    }
}

/// The largest keys.
#[inline(always)]
fn brightest_of<K: Key>(keys: &[&Lanes<K>]) -> Lanes<K> {
    let mut brightest = [K::LEAST; LANES];
    for &&key in keys {
        for lane in 0..LANES {
            brightest[lane] = brightest[lane].largest(key[lane]);
        }
    }
    brightest
}

/// True where a key of the first is over that of the second.
#[inline(always)]
fn is_over_any<K: Key, const N: usize>(keys: &[K; N], others: &[K; N]) -> bool {
    let mut over = false;
    for lane in 0..N {
        over |= keys[lane].is_over(others[lane], K::gap(0.0));
    }
    over
}

/// Any number of lights without sorting, as many pixels at once as the registers hold; extremes are looked for unless given.
#[inline(always)]
fn grown_cutoffs<K: Key>(keys: &[&Lanes<K>], gap: K, extremes: Option<&Extremes<K, LANES>>) -> Cutoffs<K> {
    const HALF: usize = LANES / 2;
    if size_of::<K>() < size_of::<f32>() {
        grow_by::<K, LANES>(keys, gap, extremes)
    } else {
        grow_by::<K, HALF>(keys, gap, extremes)
    }
}

/// `N` pixels at a time.
#[inline(always)]
fn grow_by<K: Key, const N: usize>(keys: &[&Lanes<K>], gap: K, extremes: Option<&Extremes<K, LANES>>) -> Cutoffs<K> {
    let [mut largest, mut brightest] = [[K::LARGEST; LANES]; 2];
    let parts = largest.as_chunks_mut::<N>().0.iter_mut().zip(brightest.as_chunks_mut::<N>().0);
    let mut keep_all = true;
    for (part, (largest, brightest)) in parts.enumerate() {
        let extremes = match extremes {
            Some(extremes) => extremes.part(part),
            None => Extremes::of(keys, part),
        };
        *brightest = extremes.brightest;
        keep_all &= grow(keys, part, gap, &extremes, largest);
    }
    Cutoffs { largest, brightest, keep_all }
}

/// Lights that are looked at together, in code written out. In a round they are compared with the same cutoff: what they reach
/// serves the next ones. With every light for itself, each would wait for the one before.
const AT_ONCE: usize = 8;

/// The cutoffs of a part of a block; true where it keeps all. Start at the third darkest, and take in what is within the gap
/// until nothing is.
#[inline(always)]
fn grow<K: Key, const N: usize>(
    keys: &[&Lanes<K>],
    part: usize,
    gap: K,
    extremes: &Extremes<K, N>,
    largest: &mut [K; N],
) -> bool {
    let (many, others) = keys.as_chunks::<AT_ONCE>();
    let Extremes { darkest: [_, _, third], brightest } = extremes;
    let (mut cutoffs, mut keep_all) = (*third, false);
    // Each round reaches further in at least one pixel, or is the last.
    for _ in 3..=keys.len() {
        let mut is_over = false;
        for lane in 0..N {
            // Where the brightest is within the gap, so is all between.
            let is_far = brightest[lane].is_over(cutoffs[lane], gap);
            cutoffs[lane] = if is_far { cutoffs[lane] } else { brightest[lane] };
            is_over |= is_far;
        }
        keep_all = !is_over;
        if keep_all {
            break;
        }
        let before = cutoffs;
        for keys in many {
            reach(&parts(keys, part), gap, &mut cutoffs);
        }
        for &key in others {
            reach(&parts(&[key], part), gap, &mut cutoffs);
        }
        // Not a question of equality: NaN outside the mask must not go round for ever.
        if !is_over_any(&cutoffs, &before) {
            break;
        }
    }
    *largest = cutoffs;
    keep_all
}

/// A part of blocks.
#[inline(always)]
fn parts<K: Key, const N: usize, const COUNT: usize>(keys: &[&Lanes<K>; COUNT], part: usize) -> [[K; N]; COUNT] {
    keys.map(|key| key.as_chunks::<N>().0[part])
}

/// The ends of sorted lists that are not sorted.
#[derive(Clone)]
pub(super) struct Extremes<K, const N: usize> {
    /// The darkest keys, in order.
    darkest: [[K; N]; 3],
    brightest: [K; N],
}

impl<K: Key> Extremes<K, LANES> {
    /// Those of a part of the pixels.
    #[inline(always)]
    fn part<const N: usize>(&self, part: usize) -> Extremes<K, N> {
        let [first, second, third] = &self.darkest;
        let of = |keys: &Lanes<K>| keys.as_chunks::<N>().0[part];
        Extremes { darkest: [of(first), of(second), of(third)], brightest: of(&self.brightest) }
    }
}

impl<K: Key, const N: usize> Extremes<K, N> {
    /// Of no keys.
    pub const NOTHING: Self = Self { darkest: [[K::LARGEST; N]; 3], brightest: [K::LEAST; N] };

    /// Of a part of all keys.
    #[inline(always)]
    fn of(keys: &[&Lanes<K>], part: usize) -> Self {
        let (many, others) = keys.as_chunks::<AT_ONCE>();
        let mut extremes = Self::NOTHING;
        for keys in many {
            extremes.see(&parts(keys, part));
        }
        for &key in others {
            extremes.see(&parts(&[key], part));
        }
        extremes
    }

    /// Takes in some more keys.
    #[inline(always)]
    pub fn see<B: Borrow<[K; N]>, const COUNT: usize>(&mut self, keys: &[B; COUNT]) {
        let [first, second, third] = &mut self.darkest;
        for lane in 0..N {
            // Single values, or the compiler does not keep them in registers.
            let (mut a, mut b, mut c, mut most) = (first[lane], second[lane], third[lane], self.brightest[lane]);
            for light in 0..COUNT {
                let key = keys[light].borrow()[lane];
                let over_a = a.largest(key);
                a = a.least(key);
                let over_b = b.largest(over_a);
                b = b.least(over_a);
                c = c.least(over_b);
                most = most.largest(key);
            }
            (first[lane], second[lane], third[lane], self.brightest[lane]) = (a, b, c, most);
        }
    }
}

/// Raises the cutoffs to the largest keys within the gap; of as many lights as [`Key::reached`] takes.
#[inline(always)]
fn reach<K: Key, const N: usize, const COUNT: usize>(keys: &[[K; N]; COUNT], gap: K, cutoffs: &mut [K; N]) {
    for lane in 0..N {
        let keys = std::array::from_fn(|light| keys[light][lane]);
        cutoffs[lane] = K::reached::<COUNT>(keys, cutoffs[lane], gap);
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
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
        (0..lights).map(|_| std::array::from_fn(|_| next())).collect()
    }

    /// Stairs of steps as high as the gap, each pixel's begun at another light: darkest first one round takes them all, darkest
    /// last each round takes one.
    #[test]
    fn stairs_are_climbed_in_any_order_of_the_lights() {
        const GAP: u8 = 1;
        for lights in [9, 24, 96] {
            for (descends, step) in [(false, GAP), (true, GAP), (false, GAP + 1), (true, GAP + 1)] {
                let level = |light: usize, lane: usize| {
                    let place = (light + lane) % lights;
                    step * (if descends { lights - 1 - place } else { place }) as u8
                };
                let keys: Vec<Lanes<u8>> =
                    (0..lights).map(|light| std::array::from_fn(|lane| level(light, lane))).collect();
                for holds_blocks in [false, true] {
                    let found = cutoffs(&keys.iter().collect::<Vec<_>>(), GAP, holds_blocks).largest;
                    for lane in 0..LANES {
                        let values: Vec<u8> = keys.iter().map(|key| key[lane]).collect();
                        assert_eq!(found[lane], slow_cutoff(&values, GAP), "{values:?}");
                    }
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
                let (keys, sorts) = (random_keys(lights, seed), seed % 2 == 0);
                let Cutoffs { largest: found, keep_all, .. } = cutoffs(&keys.iter().collect::<Vec<_>>(), gap, sorts);
                let dropped = (0..LANES).any(|lane| keys.iter().any(|key| key[lane] > found[lane]));
                assert_eq!(keep_all, !dropped, "{lights} lights, gap {gap}");
                let wide: Vec<Lanes<u16>> = keys.iter().map(|key| key.map(word)).collect();
                let float: Vec<Lanes<f32>> = keys.iter().map(|key| key.map(f32::from)).collect();
                let of_words = cutoffs(&wide.iter().collect::<Vec<_>>(), word(gap), sorts);
                assert_eq!((of_words.largest, of_words.keep_all), (found.map(word), keep_all));
                let of_floats = cutoffs(&float.iter().collect::<Vec<_>>(), f32::from(gap), sorts);
                assert_eq!((of_floats.largest, of_floats.keep_all), (found.map(f32::from), keep_all));
                for lane in 0..LANES {
                    let values: Vec<u8> = keys.iter().map(|key| key[lane]).collect();
                    assert_eq!(found[lane], slow_cutoff(&values, gap), "{values:?}, gap {gap}");
                }
            }
        }
    }
}
