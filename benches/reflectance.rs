//! The reflectance estimator: pixels of balls a second, material fit and learning included, by threads.

#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;
use std::ops::ControlFlow;

use bgars_core::normals::NormalMap;
use bgars_core::reflectance::{Request, estimate_into};
use bgars_core::{ImageStack, Radiometry};
use bgars_suite::balls::{grid, photograph, solder};
use bgars_suite::stacks::wavy;
use bgars_suite::{THREADS, keep_short, on_threads};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

/// Radius of the balls in pixels.
const RADIUS_PX: f64 = 45.0;

fn reflectance(criterion: &mut Criterion) {
    for (side, balls_a_row) in [(512, 4), (1024, 8)] {
        let (_, lights) = wavy(8, 4, |value| (value * 255.0) as u8);
        let circles = grid(side, balls_a_row, RADIUS_PX);
        let material = solder(8);
        let images = photograph(side, &lights, &circles, &material, |_, normal| normal);
        let stack = ImageStack::new(&images, 8, side, side).unwrap();
        let radiometry = Radiometry::linear(8, 255.0);
        let pixels = circles.len() as f64 * std::f64::consts::PI * RADIUS_PX * RADIUS_PX;
        for (name, given) in [("fitted", None), ("given material", Some(&material))] {
            let mut group = criterion.benchmark_group(format!("reflectance/{} balls, {name}", circles.len()));
            keep_short(&mut group);
            group.throughput(Throughput::Elements(pixels as u64));
            for threads in THREADS {
                group.bench_function(format!("{threads} threads"), |bencher| {
                    on_threads(threads, || {
                        let mut map = NormalMap::zeros(side * side, 0);
                        let request =
                            Request { mask: None, circles: &circles, free: None, wanted: None, material: given };
                        bencher.iter(|| {
                            let proceed = &mut |_| ControlFlow::Continue(());
                            let out = map.as_mut();
                            estimate_into(black_box(&stack), &lights, &radiometry, request, proceed, out).unwrap()
                        });
                    });
                });
            }
        }
    }
}

criterion_group!(benches, reflectance);
criterion_main!(benches);
