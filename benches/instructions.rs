//! One kernel, run a given number of times, for counting its instructions: `instructions NAME TIMES`.
//! `benches/count_instructions.py` calls it under callgrind.
#![allow(clippy::unwrap_used, missing_docs)]

use std::ops::ControlFlow;

use bgars_core::integrate::{Params, integrate};
use bgars_core::normals::{Method, RobustParams, estimate, estimate_into};
use bgars_core::{ImageStack, Lights, Pixel, Radiometry};

const SIDE: usize = 256;

/// Grey levels that a fixed congruence makes: dark, bright, and some highlights.
fn levels(lights: usize) -> Vec<u8> {
    let mut state = 1u32;
    (0..lights * SIDE * SIDE)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let level = (state >> 24) as u8;
            if level > 240 { level } else { 60 + level / 8 }
        })
        .collect()
}

fn estimate_times<P: Pixel>(images: &[P], full_scale: f32, method: Method, times: usize) {
    let count = images.len() / (SIDE * SIDE);
    let ring: Vec<[f64; 3]> = (0..count)
        .map(|light| {
            let (y, x) = (light as f64 * std::f64::consts::TAU / count as f64).sin_cos();
            [x * 0.5f64.sqrt(), y * 0.5f64.sqrt(), 0.5f64.sqrt()]
        })
        .collect();
    let lights = Lights::directional(&ring).unwrap();
    let stack = ImageStack::new(images, count, SIDE, SIDE).unwrap();
    let radiometry = Radiometry::linear(count, full_scale);
    let mut map =
        estimate(&stack, &lights, &radiometry, None, method, false, &mut |_| ControlFlow::Continue(())).unwrap();
    for _ in 1..times {
        let proceed = &mut |_| ControlFlow::Continue(());
        estimate_into(&stack, &lights, &radiometry, None, method, proceed, map.as_mut()).unwrap();
    }
    std::hint::black_box(&map);
}

fn integrate_waves(times: usize) {
    let normals: Vec<f32> = (0..SIDE * SIDE)
        .flat_map(|pixel| {
            let (u, v) = ((pixel % SIDE) as f32 * 0.1, (pixel / SIDE) as f32 * 0.13);
            let (p, q) = (0.5 * u.sin() * v.cos(), 0.4 * (u + v).cos());
            let length = (1.0 + p * p + q * q).sqrt();
            [-p / length, -q / length, 1.0 / length]
        })
        .collect();
    let mask: Vec<bool> = (0..SIDE * SIDE).map(|pixel| pixel % 61 != 0).collect();
    // A fixed amount of work: so many iterations, converged or not.
    let params = Params { relative_tolerance: 1e-15, absolute_tolerance: 1e-300, max_iters: 6, ..Params::default() };
    for _ in 0..times {
        let outcome = integrate(&normals, &mask, SIDE, None, &params, &mut |_| ControlFlow::Continue(()));
        assert!(outcome.is_err(), "six iterations are not enough for 1e-15");
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().filter(|argument| argument != "--bench").collect();
    let [_, name, times] = arguments.as_slice() else {
        // `cargo bench` and `cargo test --benches` start every bench; there is nothing to time here.
        return;
    };
    let times = times.parse().unwrap();
    let filter = Method::SpecularFilter { threshold: 50.0 };
    let levels = levels(if name == "normals-u8-24-lights" { 24 } else { 8 });
    match name.as_str() {
        "lambertian-u8" => estimate_times(&levels, 255.0, Method::Lambertian, times),
        // 24 images of this size crowd: they are looked over, and brought together.
        "normals-u8" | "normals-u8-24-lights" => estimate_times(&levels, 255.0, filter, times),
        "normals-u16" => {
            let wide: Vec<u16> = levels.iter().map(|&level| u16::from(level) * 257).collect();
            estimate_times(&wide, 65535.0, filter, times);
        }
        "normals-f32" => {
            let floats: Vec<f32> = levels.iter().map(|&level| f32::from(level)).collect();
            estimate_times(&floats, 255.0, filter, times);
        }
        "normals-robust-u8" => estimate_times(&levels, 255.0, Method::RobustFilter(RobustParams::default()), times),
        "integrate-6-iterations" => integrate_waves(times),
        other => panic!("unknown kernel {other}"),
    }
}
