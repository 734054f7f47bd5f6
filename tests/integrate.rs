//! Integration against surfaces known in closed form.
#![allow(clippy::unwrap_used, clippy::float_cmp, missing_docs)]

use std::ops::ControlFlow;

use bgars_core::Error;
use bgars_core::integrate::{Difference, Params, Progress, Surface, integrate};

/// A surface sampled at pixel centres: height, normals, mask.
struct Sample {
    height: Vec<f64>,
    normals: Vec<f32>,
    mask: Vec<bool>,
    width: usize,
}

/// `surface(x, y)` gives height and slopes (dz/dx, dz/dy), or nothing outside the mask; y grows upward.
fn sample(rows: usize, cols: usize, surface: impl Fn(f64, f64) -> Option<(f64, f64, f64)>) -> Sample {
    let mut sample = Sample { height: vec![], normals: vec![], mask: vec![], width: cols };
    for row in 0..rows {
        for col in 0..cols {
            let x = col as f64 + 0.5 - cols as f64 / 2.0;
            let y = rows as f64 / 2.0 - row as f64 - 0.5;
            let value = surface(x, y);
            let (z, p, q) = value.unwrap_or((f64::NAN, f64::NAN, f64::NAN));
            let length = (1.0 + p * p + q * q).sqrt();
            sample.height.push(z);
            sample.mask.push(value.is_some());
            sample.normals.extend([-p / length, -q / length, 1.0 / length].map(|component| component as f32));
        }
    }
    sample
}

fn solve(sample: &Sample, params: &Params) -> Surface {
    integrate(&sample.normals, &sample.mask, sample.width, None, params, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// Root mean square difference in pixels, each component's mean removed.
fn rmse_px(sample: &Sample, surface: &Surface) -> f64 {
    let mut sum = 0.0;
    let mut count = 0;
    for label in 0..surface.components.len() {
        let errors: Vec<f64> = (0..sample.mask.len())
            .filter(|&pixel| surface.labels[pixel] == label as i32)
            .map(|pixel| f64::from(surface.height_px[pixel]) - sample.height[pixel])
            .collect();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        sum += errors.iter().map(|error| (error - mean).powi(2)).sum::<f64>();
        count += errors.len();
    }
    (sum / f64::from(count as u32)).sqrt()
}

fn hemisphere(radius: f64, x: f64, y: f64) -> Option<(f64, f64, f64)> {
    let squared = radius * radius - x * x - y * y;
    (squared > 0.0).then(|| {
        let z = squared.sqrt();
        (z, -x / z, -y / z)
    })
}

#[test]
fn a_hemisphere_of_90_pixels_comes_back_within_three_hundredths_of_a_pixel() {
    let sample = sample(200, 200, |x, y| hemisphere(90.0, x, y));
    let error = rmse_px(&sample, &solve(&sample, &Params::default()));
    assert!(error <= 0.03, "{error} px");
}

#[test]
fn the_printed_forward_scheme_shifts_the_hemisphere_by_about_half_a_pixel() {
    let sample = sample(200, 200, |x, y| hemisphere(90.0, x, y));
    let params = Params { difference: Difference::Forward, ..Params::default() };
    let error = rmse_px(&sample, &solve(&sample, &params));
    assert!((1.0..1.4).contains(&error), "{error} px, 1.2 is known");
}

#[test]
fn a_plane_is_exact() {
    let sample = sample(40, 70, |x, y| Some((0.3 * x - 0.7 * y, 0.3, -0.7)));
    let error = rmse_px(&sample, &solve(&sample, &Params::default()));
    assert!(error <= 1e-5, "{error} px");
}

#[test]
fn a_saddle_is_second_order() {
    let saddle = |scale: f64| {
        let size = (40.0 * scale) as usize;
        let sample = sample(size, size, |x, y| {
            let (u, v) = (x / scale, y / scale);
            Some((scale * 0.01 * u * v * (1.0 + 0.02 * u), 0.01 * v * (1.0 + 0.04 * u), 0.01 * u * (1.0 + 0.02 * u)))
        });
        // Back to the units of the surface: a finer grid has more pixels to a unit.
        rmse_px(&sample, &solve(&sample, &Params::default())) / scale
    };
    let (coarse, fine) = (saddle(1.0), saddle(2.0));
    assert!(coarse < 0.01, "{coarse} px");
    assert!(fine < 0.3 * coarse, "{fine} is not a quarter of {coarse}");
}

#[test]
fn a_ring_with_a_hole_is_one_component_and_right() {
    let sample = sample(120, 120, |x, y| {
        let r = x.hypot(y);
        (20.0..55.0).contains(&r).then_some((0.002 * r * r, 0.004 * x, 0.004 * y))
    });
    let surface = solve(&sample, &Params::default());
    assert_eq!(surface.components.len(), 1);
    let error = rmse_px(&sample, &surface);
    assert!(error <= 0.01, "{error} px");
}

#[test]
fn two_islands_and_a_lonely_pixel_have_zero_mean_each() {
    let sample = sample(50, 120, |x, y| {
        if x == -0.5 && y == 20.5 {
            return Some((7.0, 0.1, 0.1));
        }
        hemisphere(20.0, x - 30.0, y).or_else(|| hemisphere(20.0, x + 30.0, y).map(|(z, p, q)| (z + 100.0, p, q)))
    });
    let surface = solve(&sample, &Params::default());
    let sizes: Vec<usize> = surface.components.iter().map(|component| component.pixels).collect();
    assert_eq!(sizes.len(), 3);
    assert_eq!(sizes.iter().sum::<usize>(), sample.mask.iter().filter(|&&used| used).count());
    for label in 0..3 {
        let mean: f64 = (0..sample.mask.len())
            .filter(|&pixel| surface.labels[pixel] == label)
            .map(|pixel| f64::from(surface.height_px[pixel]))
            .sum::<f64>()
            / sizes[label as usize] as f64;
        assert!(mean.abs() < 1e-5, "component {label} has mean {mean}");
    }
    assert!(rmse_px(&sample, &surface) <= 0.03);
    assert!(surface.height_px.iter().zip(&sample.mask).all(|(z, &used)| z.is_finite() == used));
}

#[test]
fn parts_far_apart_come_out_as_each_would_alone() {
    // Rows without a pixel, and parts at other columns of other rows: no kernel walks along all of them.
    let dish = |radius: f64, x: f64, y: f64| {
        (x.hypot(y) < radius).then(|| (0.004 * (x * x - 2.0 * y * y), 0.008 * x, -0.016 * y))
    };
    let parts = [(40.0, -300.0, 180.0), (12.0, 250.0, 130.0), (60.0, 10.0, -150.0)];
    let place = |x: f64, y: f64| parts.iter().find_map(|&(radius, right, up)| dish(radius, x - right, y - up));
    let (rows, cols) = (500, 800);
    let all = solve(&sample(rows, cols, place), &Params::default());
    assert_eq!(all.components.len(), parts.len());
    for (radius, right, up) in parts {
        let side = 2 * radius as usize;
        let alone = sample(side, side, |x, y| dish(radius, x, y));
        let surface = solve(&alone, &Params::default());
        let (first_row, first_col) = (rows as f64 / 2.0 - up - radius, cols as f64 / 2.0 + right - radius);
        for pixel in (0..side * side).filter(|&pixel| alone.mask[pixel]) {
            let (row, col) = (first_row as usize + pixel / side, first_col as usize + pixel % side);
            let difference = surface.height_px[pixel] - all.height_px[row * cols + col];
            assert!(difference.abs() < 1e-4, "{difference} px at ({row}, {col})");
        }
    }
}

#[test]
fn the_residual_is_the_true_one_and_the_iterations_are_bounded() {
    let sample = sample(100, 100, |x, y| hemisphere(45.0, x, y));
    let surface = solve(&sample, &Params::default());
    assert!(surface.residual <= 1e-8, "{}", surface.residual);
    assert!(surface.iterations <= 13, "{}", surface.iterations);
}

#[test]
fn the_bits_are_the_same_for_one_and_two_threads() {
    let sample = sample(90, 130, |x, y| hemisphere(44.0, x, y));
    let on_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let surface = pool.install(|| solve(&sample, &Params::default()));
        surface.height_px.iter().map(|z| z.to_bits()).collect::<Vec<u32>>()
    };
    assert_eq!(on_threads(1), on_threads(2));
}

#[test]
fn weights_decide_between_contradicting_pixels() {
    // One row: all normals say flat, but the middle one says steep. Without trust in it, the row stays flat.
    let mut sample = sample(3, 9, |_, _| Some((0.0, 0.0, 0.0)));
    for row in 0..3 {
        let middle = (row * 9 + 4) * 3;
        sample.normals[middle..middle + 3].copy_from_slice(&[-0.8, 0.0, 0.6]);
    }
    let mut weights = vec![1.0f32; 27];
    let params = Params::default();
    let span = |weights: &[f32]| {
        let proceed = &mut |_| ControlFlow::Continue(());
        let surface = integrate(&sample.normals, &sample.mask, 9, Some(weights), &params, proceed).unwrap();
        surface.height_px[8] - surface.height_px[0]
    };
    let trusted = span(&weights);
    for row in 0..3 {
        weights[row * 9 + 4] = 0.0;
    }
    let ignored = span(&weights);
    assert!(trusted > 0.7 && ignored.abs() < 1e-5, "{trusted} {ignored}");
}

#[test]
fn too_few_iterations_raise_with_their_number_and_residual() {
    let sample = sample(60, 60, |x, y| hemisphere(28.0, x, y));
    let params = Params { max_iters: 5, ..Params::default() };
    let outcome = integrate(&sample.normals, &sample.mask, 60, None, &params, &mut |_| ControlFlow::Continue(()));
    match outcome.unwrap_err() {
        Error::NoConvergence { iterations: 5, residual, .. } => {
            assert!(residual > 1e-8 && residual < 10.0, "{residual}");
        }
        other => panic!("{other}"),
    }
}

#[test]
fn the_callback_sees_the_residual_fall_and_can_stop_the_solver() {
    let sample = sample(60, 60, |x, y| hemisphere(28.0, x, y));
    let mut seen = Vec::new();
    let mut record = |progress: Progress| {
        seen.push(progress);
        if progress.iteration == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let outcome = integrate(&sample.normals, &sample.mask, 60, None, &Params::default(), &mut record);
    assert!(matches!(outcome.unwrap_err(), Error::Cancelled));
    assert_eq!(seen.len(), 3, "nothing runs on after the stop");
    assert!(seen[2].residual < seen[0].residual);
}

#[test]
fn bad_input_is_named() {
    let params = Params::default();
    let proceed = &mut |_| ControlFlow::Continue(());
    let up = [0.0f32, 0.0, 1.0];
    let normals = up.repeat(4);
    let call = |normals: &[f32], mask: &[bool], weights: Option<&[f32]>, params: &Params| {
        integrate(normals, mask, 2, weights, params, &mut |_| ControlFlow::Continue(())).unwrap_err()
    };
    assert!(matches!(call(&normals, &[false; 4], None, &params), Error::EmptyMask));
    let error = call(&normals[..9], &[true; 4], None, &params);
    assert!(matches!(error, Error::LengthMismatch { argument: "normals", expected: 12, actual: 9 }), "{error}");
    let mut bad = normals.clone();
    bad[3 * 3 + 2] = -0.5;
    let error = call(&bad, &[true; 4], None, &params);
    assert!(matches!(error, Error::BadNormal { row: 1, col: 1, .. }), "{error}");
    let error = call(&normals, &[true; 4], Some(&[1.0, f32::NAN, 1.0, 1.0]), &params);
    assert!(matches!(error, Error::BadWeight { row: 0, col: 1, .. }), "{error}");
    let error = call(&normals, &[true; 4], None, &Params { max_iters: 0, ..params });
    assert!(matches!(error, Error::OutOfRange { argument: "max_iters", .. }), "{error}");
    let error = call(&normals, &[true; 4], None, &Params { relative_tolerance: 0.0, ..params });
    assert!(matches!(error, Error::OutOfRange { argument: "relative_tolerance", .. }), "{error}");
    // A flat field has a zero right side: solved at once, not for ever.
    assert_eq!(integrate(&normals, &[true; 4], 2, None, &params, proceed).unwrap().iterations, 0);
}
