//! Normal estimation: pixels a second by pixel type, number of lights, size, method and threads.

#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;
use std::ops::ControlFlow;

use bgars_core::normals::{Method, estimate};
use bgars_core::{ImageStack, Lights, Pixel, Radiometry};
use bgars_suite::stacks::wavy;
use bgars_suite::{THREADS, keep_short, on_threads};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

const FILTER: Method = Method::SpecularFilter { threshold: 50.0 };

/// What one bench runs on.
struct Case<'a, P> {
    images: &'a [P],
    lights: &'a Lights,
    side: usize,
    full_scale: f32,
    method: Method,
}

/// One line a number of threads.
fn measure<P: Pixel>(criterion: &mut Criterion, name: &str, case: &Case<'_, P>) {
    let Case { images, lights, side, full_scale, method } = *case;
    let stack = ImageStack::new(images, lights.len(), side, side).unwrap();
    let radiometry = Radiometry::linear(lights.len(), full_scale);
    let mut group = criterion.benchmark_group(format!("normals/{name}"));
    keep_short(&mut group);
    group.throughput(Throughput::Elements((side * side) as u64));
    for threads in THREADS {
        group.bench_function(format!("{threads} threads"), |bencher| {
            on_threads(threads, || {
                bencher.iter(|| {
                    let proceed = &mut |_| ControlFlow::Continue(());
                    estimate(black_box(&stack), lights, &radiometry, None, method, false, proceed).unwrap()
                });
            });
        });
    }
}

/// The published filter by number of lights, for one pixel type.
fn by_lights<P: Pixel>(criterion: &mut Criterion, dtype: &str, full_scale: f32, convert: impl Fn(f32) -> P) {
    let side = 512;
    for count in [4, 8, 16, 96] {
        let (images, lights) = wavy(count, side, &convert);
        let case = Case { images: &images, lights: &lights, side, full_scale, method: FILTER };
        measure(criterion, &format!("{dtype}, {count} lights, {side} x {side}"), &case);
    }
}

fn normals(criterion: &mut Criterion) {
    let to_u8 = |value: f32| (value * 255.0) as u8;
    by_lights(criterion, "u8", 255.0, to_u8);
    by_lights(criterion, "u16", 65535.0, |value| (value * 65535.0) as u16);
    by_lights(criterion, "f32", 1.0, |value| value);
    for side in [1024, 2048] {
        let (images, lights) = wavy(8, side, to_u8);
        let case = Case { images: &images, lights: &lights, side, full_scale: 255.0, method: FILTER };
        measure(criterion, &format!("u8, 8 lights, {side} x {side}"), &case);
    }
    let side = 512;
    let (images, lights) = wavy(8, side, to_u8);
    for (name, method) in [("lambertian", Method::Lambertian), ("robust-filter", Method::RobustFilter)] {
        let case = Case { images: &images, lights: &lights, side, full_scale: 255.0, method };
        measure(criterion, &format!("{name}, u8, 8 lights, {side} x {side}"), &case);
    }
}

criterion_group!(benches, normals);
criterion_main!(benches);
