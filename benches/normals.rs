//! Normal estimation: megapixels a second by method and pixel type.

#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;
use std::ops::ControlFlow;

use bgars_core::normals::{Method, RobustParams, estimate};
use bgars_core::{ImageStack, Lights, Pixel, Radiometry};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

const SIDE: usize = 1024;
const LIGHTS: usize = 8;

/// A wavy Lambertian surface, so that no branch is always taken the same way.
fn stack<P>(convert: impl Fn(f64) -> P) -> (Vec<P>, Lights) {
    let directions: Vec<[f64; 3]> = (0..LIGHTS)
        .map(|light| {
            let azimuth = std::f64::consts::TAU * light as f64 / LIGHTS as f64;
            let s = 0.5f64.sqrt();
            [s * azimuth.cos(), s * azimuth.sin(), s]
        })
        .collect();
    let mut images = Vec::with_capacity(LIGHTS * SIDE * SIDE);
    for [lx, ly, lz] in &directions {
        for pixel in 0..SIDE * SIDE {
            let (x, y) = ((pixel % SIDE) as f64 / 40.0, (pixel / SIDE) as f64 / 55.0);
            let (p, q) = (x.sin(), y.cos());
            images.push(convert(((lx * p + ly * q + lz) / (1.0 + p * p + q * q).sqrt()).max(0.0)));
        }
    }
    (images, Lights::directional(&directions).unwrap())
}

fn measure<P: Pixel>(criterion: &mut Criterion, dtype: &str, full_scale: f32, convert: impl Fn(f64) -> P) {
    let (images, lights) = stack(convert);
    let stack = ImageStack::new(&images, LIGHTS, SIDE, SIDE).unwrap();
    let radiometry = Radiometry::linear(LIGHTS, full_scale);
    let mut group = criterion.benchmark_group(format!("normals/{dtype}"));
    group.throughput(Throughput::Elements((SIDE * SIDE) as u64)).sample_size(10);
    for (name, method) in [
        ("lambertian", Method::Lambertian),
        ("specular-filter", Method::SpecularFilter { threshold: 50.0 }),
        ("robust-filter", Method::RobustFilter(RobustParams::DEFAULT)),
    ] {
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let proceed = &mut |_| ControlFlow::Continue(());
                estimate(black_box(&stack), &lights, &radiometry, None, method, false, proceed).unwrap()
            });
        });
    }
}

fn normals(criterion: &mut Criterion) {
    measure(criterion, "u8", 255.0, |value| (value * 200.0) as u8);
    measure(criterion, "u16", 65535.0, |value| (value * 50_000.0) as u16);
    measure(criterion, "f32", 1.0, |value| (value * 0.8) as f32);
}

criterion_group!(benches, normals);
criterion_main!(benches);
