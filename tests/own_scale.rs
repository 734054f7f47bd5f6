//! Floats whose full scale is their own largest value give what they give when that value is told.
#![allow(clippy::unwrap_used, missing_docs)]

use std::ops::ControlFlow;

use bgars_core::normals::{Method, NormalMap, estimate};
use bgars_core::{Error, ImageStack, Lights, Pixel, Radiometry, Result};
use bgars_suite::stacks::tilted_ring;

const METHODS: [Method; 2] = [Method::Lambertian, Method::SpecularFilter { threshold: 50.0 }];

/// Pixels of one image: so many that the search is part of the kernel, and some behind the last whole block.
const PIXELS: usize = (1 << 17) + 7;

fn estimate_with<P: Pixel>(images: &[P], lights: usize, full_scale: Option<f32>, method: Method) -> Result<NormalMap> {
    let stack = ImageStack::new(images, lights, 1, images.len() / lights)?;
    let radiometry = Radiometry { full_scale, ..Radiometry::linear(lights, f32::INFINITY) };
    let lights = Lights::directional(&tilted_ring(lights, 40.0))?;
    estimate(&stack, &lights, &radiometry, None, method, true, &mut |_| ControlFlow::Continue(()))
}

fn assert_same(found: &NormalMap, expected: &NormalMap) {
    let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    assert!(bits(&found.normals) == bits(&expected.normals));
    assert!(bits(&found.albedo) == bits(&expected.albedo));
    assert!(bits(&found.confidence) == bits(&expected.confidence));
    assert!(found.mask == expected.mask && found.measured == expected.measured);
    assert!(found.lights_kept == expected.lights_kept && found.kept_sets == expected.kept_sets);
}

/// Grey levels from 0 to `most`, a third of them dark.
fn random_images(lights: usize, most: f32) -> Vec<f32> {
    let value = |at: usize| {
        let random = (at * 2_654_435_761) >> 9 & 0xffff;
        most * random as f32 / 65535.0 * if random.is_multiple_of(3) { 0.3 } else { 1.0 }
    };
    (0..lights * PIXELS).map(value).collect()
}

/// One bright pixel, which no sample is likely to see, widens the gap that cuts: a little, or over most steps.
#[test]
fn the_largest_value_may_be_told_or_found() {
    for lights in [4, 8, 13, 24, 32] {
        for hot in [100.0, 101.0, 250.0, 900.0] {
            let mut images = random_images(lights, 100.0);
            images[2 * PIXELS + 1000] = hot;
            for method in METHODS {
                let expected = estimate_with(&images, lights, Some(hot), method).unwrap();
                assert_same(&estimate_with(&images, lights, None, method).unwrap(), &expected);
            }
        }
    }
}

#[test]
fn a_hot_pixel_behind_the_last_block_counts() {
    let mut images = random_images(8, 100.0);
    images[PIXELS - 1] = 400.0;
    for method in METHODS {
        let expected = estimate_with(&images, 8, Some(400.0), method).unwrap();
        assert_same(&estimate_with(&images, 8, None, method).unwrap(), &expected);
    }
}

#[test]
fn images_without_light_have_no_normals() {
    for value in [0.0, -1.0] {
        let images = vec![value; 8 * PIXELS];
        for method in METHODS {
            let map = estimate_with(&images, 8, None, method).unwrap();
            assert!(map.mask.iter().all(|&solved| !solved));
        }
    }
}

#[test]
fn integers_are_of_the_scale_of_their_type() {
    let images: Vec<u16> = (0..8 * 200).map(|at| (at * 7919 % 60_000) as u16).collect();
    let method = METHODS[1];
    let expected = estimate_with(&images, 8, Some(65535.0), method).unwrap();
    assert_same(&estimate_with(&images, 8, None, method).unwrap(), &expected);
}

#[test]
fn what_is_not_finite_is_refused_and_work_can_be_cancelled() {
    for lights in [8, 24, 32] {
        for (value, pixel) in [(f32::NAN, 70), (f32::INFINITY, 99_999), (f32::NEG_INFINITY, PIXELS - 1)] {
            let mut images = random_images(lights, 100.0);
            images[PIXELS + pixel] = value;
            for method in METHODS {
                let error = estimate_with(&images, lights, None, method).unwrap_err();
                assert!(
                    matches!(error, Error::NonFinitePixel { image: 1, row: 0, col, count: 1 } if col == pixel),
                    "{error}"
                );
            }
        }
    }
    let images = random_images(8, 100.0);
    let stack = ImageStack::new(&images, 8, 1, PIXELS).unwrap();
    let radiometry = Radiometry { full_scale: None, ..Radiometry::linear(8, f32::INFINITY) };
    let lights = Lights::directional(&tilted_ring(8, 40.0)).unwrap();
    for allowed in [0, 1] {
        let mut calls = 0;
        let stopped = estimate(&stack, &lights, &radiometry, None, METHODS[1], false, &mut |_| {
            calls += 1;
            if calls > allowed { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert!(matches!(stopped.unwrap_err(), Error::Cancelled), "after {allowed} calls");
    }
}
