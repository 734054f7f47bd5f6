//! Normals are the same wherever a pixel lies: on any thread, in any block, beside anything.
#![allow(clippy::unwrap_used, missing_docs)]

use std::ops::ControlFlow;

use bgars_core::normals::{Method, NormalMap, estimate};
use bgars_core::{Error, ImageStack, Lights, Pixel, Radiometry};
use bgars_suite::stacks::{estimate_row, tilted_ring};

#[test]
fn the_bits_are_the_same_for_one_and_two_threads() {
    let (count, height, width) = (8, 61, 97);
    let images: Vec<u8> = (0..count * height * width).map(|index| ((index * 2_654_435_761) >> 13) as u8).collect();
    let lights = Lights::directional(&tilted_ring(count, 40.0)).unwrap();
    let stack = ImageStack::new(&images, count, height, width).unwrap();
    let on_threads = |threads, method| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let radiometry = Radiometry::linear(count, 255.0);
        let map = pool.install(|| {
            estimate(&stack, &lights, &radiometry, None, method, true, &mut |_| ControlFlow::Continue(())).unwrap()
        });
        let bits: Vec<u32> = map.normals.iter().chain(&map.confidence).map(|value| value.to_bits()).collect();
        (bits, map.kept_sets)
    };
    for method in [Method::Lambertian, Method::SpecularFilter { threshold: 50.0 }, Method::RobustFilter] {
        assert_eq!(on_threads(1, method), on_threads(2, method));
    }
}

#[test]
fn an_image_of_several_bands_equals_its_two_halves() {
    let (count, half) = (4, 1 << 19);
    let images: Vec<u8> = (0..count * 2 * half).map(|index| ((index * 2_654_435_761) >> 13) as u8).collect();
    let lights = Lights::directional(&tilted_ring(count, 40.0)).unwrap();
    let mask: Vec<bool> = (0..2 * half).map(|pixel| pixel % 1001 > 3).collect();
    let method = Method::SpecularFilter { threshold: 50.0 };
    let whole = estimate_row(&images, &lights, Some(&mask), method, 255.0);
    for part in [0..half, half..2 * half] {
        let planes = images.chunks_exact(2 * half).flat_map(|plane| plane[part.clone()].to_vec());
        let map = estimate_row(&planes.collect::<Vec<u8>>(), &lights, Some(&mask[part.clone()]), method, 255.0);
        let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<u32>>();
        assert!(bits(&map.normals) == bits(&whole.normals[3 * part.start..3 * part.end]));
        assert!(bits(&map.albedo) == bits(&whole.albedo[part.clone()]));
        assert!(bits(&map.confidence) == bits(&whole.confidence[part.clone()]));
        assert!(map.mask == whole.mask[part.clone()] && map.lights_kept == whole.lights_kept[part]);
    }
}

#[test]
fn images_a_power_of_two_apart_give_the_same_bits() {
    apart_gives_the_same_bits(|value| value as u8);
    apart_gives_the_same_bits(|value| value as u16);
    apart_gives_the_same_bits(|value| value as f32);
}

fn apart_gives_the_same_bits<P: Pixel>(pixel: impl Fn(usize) -> P) {
    // More than one task.
    const PIXELS: usize = 3 * 4096;
    const LIGHTS: usize = 24;
    let stack = |apart: usize| -> Vec<P> {
        let value = |at: usize| match (at / apart, at % apart) {
            (_, pixel) if pixel >= PIXELS => 0,
            // By turns half a block of which every pixel drops a light, and half a block of which none does.
            (light, pixel) if pixel / 32 % 2 == 0 => (light * 37 + pixel * 101) % 251,
            (light, pixel) => 60 + (light * 7 + pixel * 3) % 90,
        };
        (0..LIGHTS * apart).map(|at| pixel(value(at))).collect()
    };
    let lights = Lights::directional(&tilted_ring(LIGHTS, 40.0)).unwrap();
    let (crowded, spread) = (stack(PIXELS), stack(PIXELS + 64));
    let middle: Vec<bool> = (0..PIXELS + 64).map(|pixel| (10_000..10_100).contains(&pixel)).collect();
    let method = Method::SpecularFilter { threshold: 20.0 };
    let cases = [
        (Method::Lambertian, None, 0.0),
        (Method::Lambertian, None, 5.0),
        (method, None, 0.0),
        (method, Some(&middle[..]), 0.0),
        (method, None, 5.0),
    ];
    for (method, mask, black_level) in cases {
        let radiometry = Radiometry { black_level, ..Radiometry::linear(LIGHTS, 255.0) };
        let estimate = |images: &[P], mask: Option<&[bool]>| {
            let stack = ImageStack::new(images, LIGHTS, 1, images.len() / LIGHTS).unwrap();
            let proceed = &mut |_| ControlFlow::Continue(());
            estimate(&stack, &lights, &radiometry, mask, method, true, proceed).unwrap()
        };
        let crowded = estimate(&crowded, mask.map(|mask| &mask[..PIXELS]));
        let spread = estimate(&spread, mask);
        assert!(crowded.mask.iter().any(|&solved| solved));
        if method != Method::Lambertian && mask.is_none() {
            let dropping = crowded.lights_kept.iter().filter(|&&kept| usize::from(kept) < LIGHTS).count();
            assert_eq!(dropping, PIXELS / 2);
        }
        let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&crowded.normals), bits(&spread.normals[..3 * PIXELS]));
        assert_eq!(bits(&crowded.albedo), bits(&spread.albedo[..PIXELS]));
        assert_eq!(bits(&crowded.confidence), bits(&spread.confidence[..PIXELS]));
        assert_eq!(crowded.mask, spread.mask[..PIXELS]);
        assert_eq!(crowded.measured, spread.measured[..PIXELS]);
        assert_eq!(crowded.lights_kept, spread.lights_kept[..PIXELS]);
        assert_eq!(crowded.kept_sets, spread.kept_sets[..PIXELS * LIGHTS]);
    }
}

#[test]
fn a_black_level_counts_like_images_less_it() {
    for (lights, pixels) in [(9, 70), (24, 4096), (48, 200)] {
        let value = |at: usize| 60 + (at / pixels * 7 + at % pixels * 3) % 90;
        let directions = Lights::directional(&tilted_ring(lights, 40.0)).unwrap();
        let images: Vec<f32> = (0..lights * pixels).map(|at| value(at) as f32).collect();
        let less: Vec<f32> = images.iter().map(|value| value - 5.0).collect();
        let stack = ImageStack::new(&images, lights, 1, pixels).unwrap();
        let radiometry = Radiometry { black_level: 5.0, ..Radiometry::linear(lights, 255.0) };
        for method in [Method::Lambertian, Method::SpecularFilter { threshold: 20.0 }] {
            let proceed = &mut |_| ControlFlow::Continue(());
            let found = estimate(&stack, &directions, &radiometry, None, method, true, proceed).unwrap();
            let expected = estimate_row(&less, &directions, None, method, 255.0);
            let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            assert!(bits(&found.normals) == bits(&expected.normals), "{lights} lights, {method:?}");
            assert!(bits(&found.confidence) == bits(&expected.confidence), "{lights} lights, {method:?}");
            assert_eq!(found.kept_sets, expected.kept_sets);
        }
    }
}

#[test]
fn a_value_that_is_not_finite_is_found_wherever_it_is_and_harms_no_other_pixel() {
    let proceed = &mut |_| ControlFlow::Continue(());
    // Two whole blocks of the fast kernel and some pixels behind them.
    let pixels = 2 * 64 + 7;
    for count in [4, 8, 24, 48] {
        let directions = tilted_ring(count, 40.0);
        let positions: Vec<[f64; 3]> = directions.iter().map(|light| light.map(|along| 5000.0 * along)).collect();
        let images: Vec<f32> = (0..count * pixels).map(|at| (10 + at * 37 % 251) as f32).collect();
        for lights in
            [Lights::directional(&directions).unwrap(), Lights::near(&positions, &vec![5000.0; count]).unwrap()]
        {
            for method in [Method::Lambertian, Method::SpecularFilter { threshold: 20.0 }, Method::RobustFilter] {
                let clean = estimate_row(&images, &lights, None, method, 255.0);
                for (bad, value, bad_image) in [
                    (0, f32::NAN, count - 1),
                    (63, f32::INFINITY, 0),
                    (99, f32::INFINITY, count / 2),
                    (100, f32::NEG_INFINITY, 1),
                    (130, f32::NAN, count - 1),
                ] {
                    let mut images = images.clone();
                    images[bad_image * pixels + bad] = value;
                    let stack = ImageStack::new(&images, count, 1, pixels).unwrap();
                    let radiometry = Radiometry::linear(count, 255.0);
                    let error = estimate(&stack, &lights, &radiometry, None, method, false, proceed).unwrap_err();
                    assert!(
                        matches!(error, Error::NonFinitePixel { image, row: 0, col, count: 1 } if (image, col) == (bad_image, bad)),
                        "{count} lights, {method:?}, pixel {bad}: {error}"
                    );
                    let mask: Vec<bool> = (0..pixels).map(|pixel| pixel != bad).collect();
                    let masked = estimate_row(&images, &lights, Some(&mask), method, 255.0);
                    assert!(!masked.mask[bad]);
                    let normals = |map: &NormalMap, pixel: usize| {
                        map.normals[3 * pixel..][..3].iter().map(|v| v.to_bits()).collect::<Vec<_>>()
                    };
                    for pixel in (0..pixels).filter(|&pixel| pixel != bad) {
                        assert_eq!(
                            normals(&masked, pixel),
                            normals(&clean, pixel),
                            "{count} lights, {method:?}, pixel {pixel}"
                        );
                    }
                }
            }
        }
    }
}
