//! Integration of a hemisphere: pixels a second by size.

#![allow(missing_docs, clippy::unwrap_used)]

use std::ops::ControlFlow;

use bgars_core::integrate::{Params, integrate};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};

fn hemisphere(side: usize) -> (Vec<f32>, Vec<bool>) {
    let radius = side as f64 * 0.45;
    let mut normals = Vec::with_capacity(side * side * 3);
    let mut mask = Vec::with_capacity(side * side);
    for pixel in 0..side * side {
        let x = ((pixel % side) as f64 + 0.5 - side as f64 / 2.0) / radius;
        let y = (side as f64 / 2.0 - (pixel / side) as f64 - 0.5) / radius;
        let squared = 1.0 - x * x - y * y;
        mask.push(squared > 0.0);
        normals.extend([x as f32, y as f32, squared.max(0.0).sqrt() as f32]);
    }
    (normals, mask)
}

fn integration(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("integrate/hemisphere");
    group.sample_size(10);
    for side in [128usize, 256, 512] {
        let (normals, mask) = hemisphere(side);
        group.throughput(Throughput::Elements((side * side) as u64));
        group.bench_with_input(BenchmarkId::from_parameter(side), &side, |bencher, &side| {
            bencher.iter(|| {
                let proceed = &mut |_| ControlFlow::Continue(());
                integrate(&normals, &mask, side, None, &Params::default(), proceed).unwrap()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, integration);
criterion_main!(benches);
