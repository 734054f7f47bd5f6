//! Integration to a relative residual of 1e-6, and bilateral integration: pixels a second by shape, size and threads.

#![allow(missing_docs, clippy::unwrap_used)]

use std::ops::ControlFlow;

use bgars_core::integrate::{BilateralParams, Field, Params, Setting, integrate, integrate_bilateral};
use bgars_suite::masks::{disc_with_holes, rectangle, wavy_normals};
use bgars_suite::{THREADS, keep_short, on_threads};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

fn integration(criterion: &mut Criterion) {
    let params = Params { relative_tolerance: 1e-6, ..Params::default() };
    for side in [512, 1024, 2048] {
        let normals = wavy_normals(side);
        for (shape, mask) in [("rectangle", rectangle(side)), ("disc with holes", disc_with_holes(side))] {
            let mut group = criterion.benchmark_group(format!("integrate/{shape}, {side} x {side}"));
            keep_short(&mut group);
            group.throughput(Throughput::Elements((side * side) as u64));
            for threads in THREADS {
                group.bench_function(format!("{threads} threads"), |bencher| {
                    on_threads(threads, || {
                        bencher.iter(|| {
                            let proceed = &mut |_| ControlFlow::Continue(());
                            integrate(&normals, &mask, side, None, &params, proceed).unwrap()
                        });
                    });
                });
            }
        }
    }
}

/// Ten re-weightings, whatever the energy: the cost of a round.
fn bilateral(criterion: &mut Criterion) {
    let side = 512;
    let (normals, mask) = (wavy_normals(side), disc_with_holes(side));
    let field = Field { normals: &normals, mask: &mask, weights: None, regions: None, width: side };
    for (name, setting) in [("compatible", Setting::Compatible), ("converged", Setting::Converged)] {
        let params = BilateralParams { max_iters: 10, tolerance: 1e-300, setting, ..BilateralParams::default() };
        let mut group = criterion.benchmark_group(format!("bilateral/{name}, {side} x {side}"));
        keep_short(&mut group);
        group.throughput(Throughput::Elements((side * side) as u64));
        for threads in THREADS {
            group.bench_function(format!("{threads} threads"), |bencher| {
                on_threads(threads, || {
                    bencher.iter(|| {
                        let proceed = &mut |_| ControlFlow::Continue(());
                        integrate_bilateral(field, None, &params, proceed).unwrap()
                    });
                });
            });
        }
    }
}

criterion_group!(benches, integration, bilateral);
criterion_main!(benches);
