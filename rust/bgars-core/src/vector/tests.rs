//! Every vector does what its values would do one by one.

#![allow(clippy::float_cmp)]

use super::subset_sums::SubsetSums;
use super::{One, Packed, Pair, Portable, PortableDouble, ROW, RowTable, Vector};

/// More than the widest vector needs.
const VALUES: usize = 32;

fn values<V: Vector>(vector: V) -> Vec<f32> {
    let mut out = [f32::NAN; VALUES];
    vector.write(&mut out);
    assert!(out[V::WIDTH..].iter().all(|value| value.is_nan()), "written past the end");
    out[..V::WIDTH].to_vec()
}

/// `vector` holds `expected(k)` at place k.
fn assert_values<V: Vector>(vector: V, expected: impl Fn(usize) -> f32) {
    for (lane, &value) in values(vector).iter().enumerate() {
        let expected = expected(lane);
        assert!(value == expected || value.is_nan() && expected.is_nan(), "{lane}: {value}, expected {expected}");
    }
}

fn check<V: Vector>() {
    let a: [f32; VALUES] = std::array::from_fn(|lane| lane as f32 - 3.0);
    let b: [f32; VALUES] = std::array::from_fn(|lane| [0.5, -2.0, 7.0, f32::NAN][lane % 4]);
    let c: [f32; VALUES] = std::array::from_fn(|lane| 0.5 * lane as f32);
    let (x, y) = (V::load(&a), V::load(&b));
    assert_values(x / y, |lane| a[lane] / b[lane]);
    let w = V::load(&c);
    assert_values(x.times_minus(w, x), |lane| a[lane] * c[lane] - a[lane]); // exact for these values
    assert_values((x * x).root(), |lane| a[lane].abs());
    assert_values(V::splat(-1.0).root(), |_| f32::NAN);
    check_roots::<V>();
    assert_values(V::pick(x.is_over(y), x, V::splat(0.0)), |lane| if a[lane] > b[lane] { a[lane] } else { 0.0 });
    assert_values(y.at_least(V::splat(0.0)), |lane| if b[lane] > 0.0 { b[lane] } else { 0.0 });
    let both = V::both(x.is_over(y), x.is_over(V::splat(4.0)));
    assert_values(V::pick(both, x, y), |lane| if a[lane] > b[lane] && a[lane] > 4.0 { a[lane] } else { b[lane] });
    let bits = (0..V::WIDTH).filter(|&lane| a[lane] > b[lane]).fold(0, |bits, lane| bits | 1 << lane);
    assert_eq!(V::bits(x.is_over(y)), bits);
    assert!(!V::all(both) && V::all(V::splat(1.0).is_over(V::splat(0.5))));
    let but_one: [f32; VALUES] = std::array::from_fn(|lane| if lane + 1 == V::WIDTH { 0.0 } else { 1.0 });
    let but_one = V::load(&but_one).is_over(V::splat(0.5));
    let (all, none) = (V::splat(1.0).is_over(V::splat(0.5)), V::splat(0.5).is_over(V::splat(1.0)));
    assert!(!V::all(but_one) && V::any(but_one) && !V::any(none));
    assert!(V::any(V::either(none, but_one)) && !V::all(V::either(none, but_one)) && V::all(V::either(all, none)));
    assert_values(x.with_sign_of(y), |lane| a[lane].copysign(b[lane]));

    let bytes: [u8; VALUES] = std::array::from_fn(|lane| (lane * 37 % 256) as u8);
    let words: [u16; VALUES] = std::array::from_fn(|lane| (lane * 4099) as u16);
    assert_values(V::from_bytes(&bytes), |lane| f32::from(bytes[lane]));
    assert_values(V::from_words(&words), |lane| f32::from(words[lane]));
    for bit in 0..8 {
        assert_values(x.where_bit(&bytes, bit), |lane| if bytes[lane] >> bit & 1 == 1 { a[lane] } else { 0.0 });
    }
}

fn check_flags<V: Vector>() {
    let bytes = (0..=u8::MAX).map(|byte| u64::from(byte) * 0x0101_0101_0101_0101);
    for bits in bytes.chain((0..64).map(|bit| 1 << bit)).chain([0x0123_4567_89ab_cdef, !0x0123_4567_89ab_cdef]) {
        for (place, flag) in V::flags(bits).into_iter().enumerate() {
            assert_eq!(flag, bits >> place & 1 == 1, "bit {place} of {bits:#x}");
        }
    }
}

fn check_roots<V: Vector>() {
    const ERROR: f64 = 2.0 * f32::EPSILON as f64;
    for exponent in -99..=99 {
        let squares: [f32; VALUES] =
            std::array::from_fn(|lane| (1.0 + lane as f32 / VALUES as f32) * f32::powi(2.0, exponent));
        for (inverse, square) in values(V::load(&squares).inverse_root()).into_iter().zip(squares) {
            let exact = f64::from(square).sqrt();
            assert!((f64::from(inverse) * exact - 1.0).abs() < ERROR, "one over the root of {square}: {inverse}");
        }
    }
    assert_values(V::splat(-2.0).inverse_root(), |_| f32::NAN);
    for zero in [0.0, -0.0] {
        assert!(values(V::splat(zero).inverse_root()).into_iter().all(|inverse| !inverse.is_finite()));
    }
}

fn check_packed<V: Packed>()
where
    V::Number: From<f32> + PartialEq + std::fmt::Debug + Default,
{
    let number = |value: f32| V::Number::from(value);
    let a: [V::Number; VALUES] = std::array::from_fn(|lane| number(lane as f32 - 3.0));
    let b: [V::Number; VALUES] = std::array::from_fn(|lane| number([0.5, -2.0, 7.0][lane % 3]));
    let (x, y, two) = (V::load(&a), V::load(&b), V::splat(number(2.0)));
    let assert_numbers = |vector: V, expected: &dyn Fn(f32, f32) -> f32| {
        let mut out = [number(f32::MAX); VALUES];
        vector.write(&mut out);
        for (lane, out) in out.into_iter().enumerate() {
            let expected = expected(lane as f32 - 3.0, [0.5, -2.0, 7.0][lane % 3]);
            assert_eq!(out, number(if lane < V::WIDTH { expected } else { f32::MAX }), "{lane}");
        }
    };
    assert_numbers(x, &|a, _| a);
    assert_numbers(two, &|_, _| 2.0);
    assert_numbers(x + y, &|a, b| a + b);
    assert_numbers(x - y, &|a, b| a - b);
    assert_numbers(x * y, &|a, b| a * b);
    assert_numbers(x.times_plus(y, two), &|a, b| a * b + 2.0); // exact for these values
    assert_numbers(y.magnitude(), &|_, b| b.abs());
    assert_numbers(x.where_positive(y), &|a, b| if b > 0.0 { a } else { 0.0 });
    let powers: [V::Number; VALUES] = std::array::from_fn(|lane| number([0.0, -4.0, 0.25, 8.0][lane % 4]));
    let mut out = [number(f32::MAX); VALUES];
    V::splat(number(3.0)).over(V::load(&powers)).write(&mut out);
    for (lane, out) in out[..V::WIDTH].iter().enumerate() {
        assert_eq!(*out, number([0.0, 0.0, 12.0, 0.375][lane % 4]), "{lane}");
    }

    let sum: f32 = (0..V::WIDTH).map(|lane| lane as f32 - 3.0).sum();
    assert!((x.sum() - f64::from(sum)).abs() == 0.0);

    // Shifted by one place, between two vectors.
    for (shifted, place) in [(x.after_last_of(y), V::WIDTH - 1), (y.before_first_of(x), 1)] {
        let numbers = [&b[..V::WIDTH], &a[..V::WIDTH]].concat();
        let mut out = [number(f32::MAX); VALUES];
        shifted.write(&mut out);
        assert_eq!(out[..V::WIDTH], numbers[place..][..V::WIDTH]);
    }

    // The second of two vectors of a row.
    let row: Vec<f32> = (0..=2 * V::WIDTH).map(|place| place as f32).collect();
    let numbers: Vec<V::Number> = row.iter().map(|&value| number(value)).collect();
    let signed: Vec<f32> = row.iter().map(|&value| value - 1.5 * V::WIDTH as f32).collect();
    let mut positive = vec![number(-1.0); V::WIDTH];
    V::widen_positive(&V::floats(&signed, 2)[1]).put(&mut V::chunks_mut(&mut positive, 1)[0]);
    for (positive, &signed) in positive.iter().zip(&signed[V::WIDTH..]) {
        assert_eq!(*positive, number(signed.max(0.0)));
    }
    let mut copy = vec![number(-1.0); 2 * V::WIDTH + 1];
    let chunks = V::chunks_mut(&mut copy, 2);
    V::read(&V::chunks(&numbers, 2)[1]).put(&mut chunks[0]);
    V::widen(&V::floats(&row, 2)[1]).put(&mut chunks[1]);
    for (place, copied) in copy.into_iter().enumerate() {
        let expected = if place < 2 * V::WIDTH { (V::WIDTH + place % V::WIDTH) as f32 } else { -1.0 };
        assert_eq!(copied, number(expected), "{place}");
    }
}

fn check_sums<V: Vector>() {
    for elements in [3, 5, 8] {
        // Whole numbers: sums are exact in any order.
        let table: Vec<[f32; 2]> = (0..elements).map(|index| [(1 << index) as f32, -(index as f32)]).collect();
        let sums = SubsetSums::new(&table);
        for first in (0..1 << elements).step_by(V::WIDTH) {
            let bytes: [u8; VALUES] = std::array::from_fn(|lane| ((first + lane) & ((1 << elements) - 1)) as u8);
            for (entry, found) in V::sums_of(&bytes, &sums).into_iter().enumerate() {
                assert_values(found, |lane| {
                    let kept = table.iter().enumerate().filter(|(index, _)| bytes[lane] >> index & 1 == 1);
                    kept.map(|(_, element)| element[entry]).sum::<f32>()
                });
            }
        }
    }
}

fn check_rows<V: Vector>() {
    let number = |byte: usize, entry: usize| (ROW * byte + entry) as f32 - 77.0;
    let table = RowTable::new((0..200).map(|byte| std::array::from_fn(|entry| number(byte, entry))));
    let bytes: [u8; VALUES] = std::array::from_fn(|lane| (lane * 37 % 256) as u8);
    for (entry, found) in V::rows(&bytes, &table).into_iter().enumerate() {
        assert_values(found, |lane| if bytes[lane] < 200 { number(usize::from(bytes[lane]), entry) } else { 0.0 });
    }
}

fn check_stores<V: Vector>() {
    #[repr(align(64))]
    struct Lines([f32; 4 * VALUES]);
    let planes: [[f32; VALUES]; 3] = [0, 1, 2].map(|plane| std::array::from_fn(|lane| (3 * lane + plane) as f32));
    for (start, streamed) in [(0, true), (0, false), (1, true), (5, false)] {
        let mut out = Lines([-1.0; 4 * VALUES]);
        let vectors = V::interleaved(planes.map(|plane| V::load(&plane)));
        for (vector, to) in vectors.into_iter().zip(out.0[start..].chunks_mut(V::WIDTH)) {
            if streamed {
                vector.stream(to);
            } else {
                vector.write(to);
            }
        }
        crate::stream::finish();
        for (at, &value) in out.0.iter().enumerate() {
            let inside = (start..start + 3 * V::WIDTH).contains(&at);
            assert_eq!(value, if inside { (at - start) as f32 } else { -1.0 });
        }
    }
}

fn check_blocks<V: Vector>() {
    #[repr(align(64))]
    struct Lines([u16; 160]);
    let from: [u16; 64] = std::array::from_fn(|place| place as u16);
    for start in [0, 1, 8, 32] {
        let mut out = Lines([u16::MAX; 160]);
        V::stream_block(&from, out.0[start..].first_chunk_mut().expect("room for the block"));
        V::stream_block(&[7; 5], out.0[start + 64..].first_chunk_mut().expect("room for five"));
        crate::stream::finish();
        for (at, &value) in out.0.iter().enumerate() {
            let expected = match at.checked_sub(start) {
                Some(place @ 0..64) => place as u16,
                Some(64..69) => 7,
                _ => u16::MAX,
            };
            assert_eq!(value, expected, "at {at}, from {start} on");
        }
    }
}

fn check_vector<V: Vector>() {
    check::<V>();
    check_flags::<V>();
    check_sums::<V>();
    check_rows::<V>();
    check_stores::<V>();
    check_blocks::<V>();
}

fn check_all<V: Vector + Packed, Double: Packed<Number = f64>>() {
    check_packed::<V>();
    check_packed::<Double>();
    check_vector::<V>();
    check_vector::<Pair<V>>();
}

#[test]
fn one() {
    check_packed::<One<f32>>();
    check_packed::<One<f64>>();
}

#[test]
fn portable() {
    check_all::<Portable, PortableDouble>();
}

#[test]
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
fn avx2() {
    #[target_feature(enable = "avx2,fma")]
    fn checked() {
        check_all::<super::Avx2, super::Avx2Double>();
    }
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        // SAFETY: the processor has the instructions.
        unsafe { checked() }
    }
}

#[test]
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
fn avx512() {
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,fma")]
    fn checked() {
        check_all::<super::Avx512, super::Avx512Double>();
    }
    if is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("fma")
    {
        // SAFETY: the processor has the instructions.
        unsafe { checked() }
    }
}
