//! Normal estimation against a slow plain twin: pseudo-inverse by SVD, selection spelled out.
#![allow(clippy::unwrap_used, clippy::float_cmp, missing_docs)]

mod slow_twin;

use std::ops::ControlFlow;

use bgars_core::normals::{Method, NormalMap, NormalMapMut, estimate, estimate_into};
use bgars_core::{Error, ImageStack, Lights, Pixel, Radiometry, blind};
use bgars_suite::stacks::{estimate_row, tilted_ring};
use nalgebra::DVector;
use proptest::prelude::*;
use slow_twin::{slow_kept, slow_solve};

fn compare<P: Pixel>(images: &[P], directions: &[[f64; 3]], mask: &[bool], method: Method, full_scale: f32) {
    let lights = Lights::directional(directions).unwrap();
    let map = estimate_row(images, &lights, Some(mask), method, full_scale);
    let pixels = mask.len();
    for pixel in 0..pixels {
        if !mask[pixel] {
            assert!(!map.mask[pixel] && map.normals[pixel * 3].is_nan() && map.lights_kept[pixel] == 0);
            continue;
        }
        let values: Vec<f32> = (0..lights.len()).map(|light| images[light * pixels + pixel].to_f32()).collect();
        let kept = slow_kept(method, &values, directions, full_scale);
        assert_eq!(&map.kept_sets[pixel * lights.len()..(pixel + 1) * lights.len()], kept, "kept set of {values:?}");
        assert_eq!(usize::from(map.lights_kept[pixel]), kept.iter().filter(|&&kept| kept).count());
        match slow_solve(&values, directions, &kept) {
            Some((normal, albedo)) => {
                let fast = DVector::from_fn(3, |axis, _| f64::from(map.normals[pixel * 3 + axis]));
                if !map.mask[pixel] {
                    // A normal seen exactly edge-on may fall to either side in rounding.
                    assert!(normal[2] < 1e-6, "no normal, expected {normal}");
                    continue;
                }
                let angle_deg = (&fast - &normal).norm().to_degrees();
                assert!(angle_deg < 1e-3, "{angle_deg} deg between {fast} and {normal}");
                let expected = (albedo / f64::from(full_scale)) as f32;
                approx::assert_relative_eq!(map.albedo[pixel], expected, max_relative = 1e-4);
                assert!(map.confidence[pixel] > 0.0 && map.confidence[pixel] <= 1.0);
            }
            None => assert!(!map.mask[pixel] || map.normals[pixel * 3 + 2] < 1e-6),
        }
    }
}

/// A whole block of the fast kernel, and one that is filled up.
const BLOCKS: [usize; 2] = [64, 6];
const PIXELS: usize = BLOCKS[0] + BLOCKS[1];

/// One pixel's values as those of [`PIXELS`] pixels.
fn repeated<P: Copy>(values: &[P]) -> Vec<P> {
    values.iter().flat_map(|&value| [value; PIXELS]).collect()
}

/// The normals of the first pixel of each block.
fn of_both(map: &NormalMap) -> [nalgebra::Vector3<f64>; 2] {
    [0, BLOCKS[0]].map(|pixel| nalgebra::Vector3::from_column_slice(&map.normals[3 * pixel..3 * pixel + 3]).cast())
}

const METHODS: [Method; 3] = [Method::Lambertian, Method::SpecularFilter { threshold: 50.0 }, Method::RobustFilter];

/// Numbers of lights: few, and so many that the fast kernel looks over them first.
fn counts() -> impl Strategy<Value = usize> {
    prop_oneof![4 => 3usize..=16, 1 => Just(31), 1 => Just(50)]
}

/// The methods that the fast kernel serves with so many lights.
fn methods(count: usize) -> impl Iterator<Item = Method> {
    METHODS.into_iter().filter(move |method| count <= 16 || !matches!(method, Method::RobustFilter))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn u8_stacks_equal_the_twin(
        (count, values, mask) in counts().prop_flat_map(|count| (
            Just(count), prop::collection::vec(any::<u8>(), count * PIXELS), prop::collection::vec(any::<bool>(), PIXELS),
        )),
        elevation_deg in 20.0..60.0,
    ) {
        prop_assume!(mask.contains(&true));
        for method in methods(count) {
            compare(&values, &tilted_ring(count, elevation_deg), &mask, method, 255.0);
        }
    }

    #[test]
    fn u16_stacks_equal_the_twin(
        (count, values) in counts().prop_flat_map(|count| (
            Just(count), prop::collection::vec(any::<u16>(), count * PIXELS),
        )),
        elevation_deg in 20.0..60.0,
    ) {
        for method in methods(count) {
            compare(&values, &tilted_ring(count, elevation_deg), &[true; PIXELS], method, 65535.0);
        }
    }

    #[test]
    fn f32_stacks_equal_the_twin(
        (count, values) in counts().prop_flat_map(|count| (
            Just(count), prop::collection::vec(0.0f32..1.0, count * PIXELS),
        )),
        elevation_deg in 20.0..60.0,
    ) {
        for method in methods(count) {
            compare(&values, &tilted_ring(count, elevation_deg), &[true; PIXELS], method, 1.0);
        }
    }

    #[test]
    fn a_lambertian_pixel_gives_its_normal_back_by_every_method(
        count in 4usize..=16, x in -0.4f64..0.4, y in -0.4f64..0.4, albedo in 0.2f64..0.9,
    ) {
        let normal = nalgebra::Vector3::new(x, y, 1.0).normalize();
        let directions = tilted_ring(count, 45.0);
        let values: Vec<f32> =
            directions.iter().map(|&light| (albedo * nalgebra::Vector3::from(light).dot(&normal)) as f32).collect();
        prop_assume!(values.iter().all(|&value| value > 0.05));
        let lights = Lights::directional(&directions).unwrap();
        for method in [Method::Lambertian, Method::RobustFilter] {
            let map = estimate_row(&repeated(&values), &lights, None, method, 1.0);
            for found in of_both(&map) {
                prop_assert!((found - normal).norm().to_degrees() < 1e-3, "{method:?}: {found} is not {normal}");
            }
        }
    }
}

#[test]
fn a_block_that_is_filled_up_reads_its_own_pixels() {
    // As far from the first pixel to the last as a whole block reaches, with gaps between.
    let mask: Vec<bool> = (0..PIXELS).map(|pixel| pixel < BLOCKS[0] && pixel % 3 == 0).collect();
    assert!(mask[0] && mask[BLOCKS[0] - 1]);
    let values: Vec<u8> = (0..8 * PIXELS).map(|place| (place * 37 % 200) as u8).collect();
    for method in METHODS {
        compare(&values, &tilted_ring(8, 45.0), &mask, method, 255.0);
    }
}

#[test]
fn near_lights_give_back_the_normal_of_a_board_point_off_the_centre() {
    let positions: Vec<[f64; 3]> = tilted_ring(8, 45.0).iter().map(|direction| direction.map(|v| v * 300.0)).collect();
    let reference: Vec<f64> = vec![300.0; 8];
    let lights = Lights::near(&positions, &reference).unwrap();
    let (height, width) = (40, 60);
    let normal = nalgebra::Vector3::new(0.1, -0.2, 1.0).normalize();
    let mut images = vec![0f32; 8 * height * width];
    for light in 0..8 {
        for row in 0..height {
            for col in 0..width {
                let x = col as f64 + 0.5 - width as f64 / 2.0;
                let y = height as f64 / 2.0 - row as f64 - 0.5;
                let to_light = nalgebra::Vector3::from(positions[light]) - nalgebra::Vector3::new(x, y, 0.0);
                let irradiance = (300.0 / to_light.norm()).powi(2) * to_light.normalize().dot(&normal);
                images[light * height * width + row * width + col] = irradiance as f32;
            }
        }
    }
    let stack = ImageStack::new(&images, 8, height, width).unwrap();
    for method in [Method::Lambertian, Method::RobustFilter] {
        let radiometry = Radiometry { saturation: f32::INFINITY, ..Radiometry::linear(8, 1.0) };
        let map =
            estimate(&stack, &lights, &radiometry, None, method, false, &mut |_| ControlFlow::Continue(())).unwrap();
        for pixel in map.normals.chunks(3) {
            let found = nalgebra::Vector3::new(pixel[0], pixel[1], pixel[2]).cast::<f64>();
            assert!((found - normal).norm().to_degrees() < 1e-3, "{found}");
        }
    }
}

#[test]
fn dark_frame_response_and_intensities_are_undone() {
    let directions = tilted_ring(6, 45.0);
    let lights = Lights::directional(&directions).unwrap();
    let normal = nalgebra::Vector3::new(0.2, 0.1, 1.0).normalize();
    let intensities = vec![1.0, 0.8, 1.2, 0.9, 1.1, 0.7];
    // The camera squares nothing: it takes the root, so the table squares the code again.
    let response: Vec<f32> = (0..65536u32).map(|code| (f64::from(code).powi(2) / 65535.0) as f32).collect();
    let encode = |linear: f64| (linear * 65535.0).sqrt().round() as u16;
    let dark_level = 900.0;
    let images: Vec<u16> = directions
        .iter()
        .zip(&intensities)
        .map(|(&light, e)| encode(dark_level + 30_000.0 * e * nalgebra::Vector3::from(light).dot(&normal)))
        .collect();
    let (images, dark) = (repeated(&images), [encode(dark_level); PIXELS]);
    let stack = ImageStack::new(&images, 6, 1, PIXELS).unwrap();
    let radiometry =
        Radiometry { response: Some(&response), dark: Some(&dark), intensities, ..Radiometry::linear(6, 65535.0) };
    let map =
        estimate(&stack, &lights, &radiometry, None, Method::Lambertian, false, &mut |_| ControlFlow::Continue(()))
            .unwrap();
    for found in of_both(&map) {
        assert!((found - normal).norm().to_degrees() < 0.01, "{found}");
    }
    for albedo in [map.albedo[0], map.albedo[BLOCKS[0]]] {
        approx::assert_relative_eq!(albedo, 30_000.0 / 65535.0, max_relative = 1e-3);
    }
}

#[test]
fn a_black_pixel_and_a_coplanar_kept_set_have_no_normal() {
    let s = 0.5f64.sqrt();
    // Lights 0, 1, 2 are coplanar; the filter keeps just these when 3 and 4 are highlights.
    let lights = Lights::directional(&[[s, 0.0, s], [0.0, 0.0, 1.0], [-s, 0.0, s], [0.0, s, s], [0.0, -s, s]]).unwrap();
    for (values, kept) in [([0; 5], 5), ([10, 12, 11, 200, 201], 3)] {
        let map =
            estimate_row(&repeated::<u8>(&values), &lights, None, Method::SpecularFilter { threshold: 50.0 }, 255.0);
        assert_eq!(map.mask, [false; PIXELS]);
        assert!(map.normals.iter().all(|value| value.is_nan()));
        assert_eq!(map.lights_kept, [kept; PIXELS]);
    }
}

/// The arrays of a map but for what is measured.
fn without_measured(map: &mut NormalMap) -> NormalMapMut<'_> {
    NormalMapMut { measured: &mut [], ..map.as_mut() }
}

#[test]
fn what_is_measured_may_be_left_out() {
    let lights = Lights::directional(&tilted_ring(8, 45.0)).unwrap();
    let proceed = &mut |_| ControlFlow::Continue(());
    let radiometry = Radiometry::linear(8, 255.0);
    // Whole blocks, some pixels behind these, highlights, and black ones that have no normal.
    let pixels = 3 * 64 + 5;
    let value = |place: usize| if place % pixels == 70 { 0 } else { 40 + (place * 37 % 151) as u8 };
    let images: Vec<u8> = (0..8 * pixels).map(value).collect();
    let stack = ImageStack::new(&images, 8, 1, pixels).unwrap();
    let used: Vec<bool> = (0..pixels).map(|pixel| pixel % 7 != 3).collect();
    for method in [Method::Lambertian, Method::SpecularFilter { threshold: 50.0 }] {
        for mask in [None, Some(&used[..])] {
            let whole = estimate(&stack, &lights, &radiometry, mask, method, false, proceed).unwrap();
            assert_eq!(whole.measured, whole.mask);
            assert!(whole.mask.contains(&true) && !whole.mask[70]);
            let mut map = NormalMap::zeros(pixels, 0);
            estimate_into(&stack, &lights, &radiometry, mask, method, proceed, without_measured(&mut map)).unwrap();
            assert_eq!(map.mask, whole.mask);
            assert_eq!(map.lights_kept, whole.lights_kept);
            assert_eq!(map.measured, vec![false; pixels], "nobody wrote to it");
        }
    }
    let mut map = NormalMap::zeros(pixels, 0);
    let found = blind::estimate_into(&stack, &lights, &radiometry, None, proceed, without_measured(&mut map));
    assert!(matches!(found, Err(Error::LengthMismatch { argument: "measured", actual: 0, .. })), "{found:?}");
}

#[test]
fn bad_input_is_named() {
    let lights = Lights::directional(&tilted_ring(4, 45.0)).unwrap();
    let proceed = &mut |_| ControlFlow::Continue(());
    let images = [0f32; 8];
    let radiometry = Radiometry::linear(4, 1.0);
    let stack = ImageStack::new(&images, 4, 1, 2).unwrap();
    let method = Method::Lambertian;

    let three = ImageStack::new(&images[..6], 3, 1, 2).unwrap();
    let error = estimate(&three, &lights, &radiometry, None, method, false, proceed).unwrap_err();
    assert!(matches!(error, Error::LightCountMismatch { images: 3, lights: 4 }), "{error}");

    let error = estimate(&stack, &lights, &radiometry, Some(&[false; 2]), method, false, proceed).unwrap_err();
    assert!(matches!(error, Error::EmptyMask), "{error}");

    let error = estimate(&stack, &lights, &radiometry, Some(&[true; 3]), method, false, proceed).unwrap_err();
    assert!(matches!(error, Error::LengthMismatch { argument: "mask", expected: 2, actual: 3 }), "{error}");

    let mut with_nan = images;
    with_nan[5] = f32::NAN;
    let bad = ImageStack::new(&with_nan, 4, 1, 2).unwrap();
    let error = estimate(&bad, &lights, &radiometry, None, method, false, proceed).unwrap_err();
    assert!(matches!(error, Error::NonFinitePixel { image: 2, row: 0, col: 1, count: 1 }), "{error}");
    let masked = estimate(&bad, &lights, &radiometry, Some(&[true, false]), method, false, proceed);
    assert!(masked.is_ok(), "NaN outside the mask does no harm");

    let error =
        estimate(&stack, &lights, &radiometry, None, Method::SpecularFilter { threshold: -1.0 }, false, proceed);
    assert!(matches!(error.unwrap_err(), Error::OutOfRange { argument: "threshold", .. }));

    let stopped = estimate(&stack, &lights, &radiometry, None, method, false, &mut |_| ControlFlow::Break(()));
    assert!(matches!(stopped.unwrap_err(), Error::Cancelled));
}
