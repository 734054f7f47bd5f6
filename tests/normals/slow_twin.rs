//! The estimators word for word, slowly: every light asked, every window solved by SVD.

use bgars_core::normals::Method;
use nalgebra::{DMatrix, DVector};

/// The published filter, word for word: sort, walk up from the third value, cut at the first gap over the threshold.
fn slow_specular_filter(values: &[f32], gap: f32) -> Vec<bool> {
    let mut ranked: Vec<(f32, usize)> = values.iter().copied().zip(0..).collect();
    ranked.sort_by(|a, b| a.0.partial_cmp(&b.0).unwrap().then(a.1.cmp(&b.1)));
    let mut count = ranked.len();
    for rank in 3..ranked.len() {
        if ranked[rank].0 - ranked[rank - 1].0 > gap {
            count = rank;
            break;
        }
    }
    let mut kept = vec![false; values.len()];
    for &(_, light) in &ranked[..count] {
        kept[light] = true;
    }
    kept
}

/// Least squares by SVD; `None` where the kept lights do not fix a normal, or it faces away.
pub fn slow_solve(values: &[f32], directions: &[[f64; 3]], kept: &[bool]) -> Option<(DVector<f64>, f64)> {
    let rows: Vec<usize> = (0..values.len()).filter(|&light| kept[light]).collect();
    let lights = DMatrix::from_fn(rows.len(), 3, |row, col| directions[rows[row]][col]);
    let right = DVector::from_fn(rows.len(), |row, _| f64::from(values[rows[row]]));
    let svd = lights.svd(true, true);
    let squares = svd.singular_values.map(|value| value * value);
    if rows.len() < 3 || 27.0 * squares.product() < 1e-6 * squares.sum().powi(3) {
        return None;
    }
    let solution = svd.solve(&right, 1e-12).unwrap();
    let albedo = solution.norm();
    if albedo > 0.0 && solution[2] > 0.0 { Some((solution / albedo, albedo)) } else { None }
}

/// The robust filter, word for word from docs/method.md: every window solved by SVD, every light asked.
fn slow_robust_filter(
    values: &[f32],
    clipped: &[bool],
    directions: &[[f64; 3]],
    full_scale: f64,
    noise_level: f64,
) -> Vec<bool> {
    let lights = values.len();
    let noise = noise_level / 255.0 * full_scale;
    let mut sorted: Vec<f64> = values.iter().map(|&value| f64::from(value)).collect();
    sorted.sort_by(f64::total_cmp);
    let median = f64::midpoint(sorted[(lights - 1) / 2], sorted[lights / 2]);
    let mut order: Vec<usize> = (0..lights).collect();
    order.sort_by(|&a, &b| clipped[a].cmp(&clipped[b]).then(values[a].total_cmp(&values[b])).then(a.cmp(&b)));
    let steps = lights.min(8);
    let edge = |step: usize| (step as f64 * lights as f64 / steps as f64 + 0.5).floor() as usize;
    let mut best = (true, f64::INFINITY, 0..lights);
    for size in (1..=steps).rev() {
        for start in 0..=steps - size {
            let window = edge(start)..edge(start + size);
            let kept = window.len();
            if kept < 3 || 3 * kept < lights {
                continue;
            }
            let rows = DMatrix::from_fn(kept, 3, |row, col| directions[order[window.start + row]][col]);
            let right = DVector::from_fn(kept, |row, _| f64::from(values[order[window.start + row]]));
            if (rows.transpose() * &rows).determinant() <= 3e-3 {
                continue;
            }
            let facet = rows.svd(true, true).solve(&right, 0.0).unwrap();
            let rho = facet.norm();
            if facet[2] <= 0.0 {
                continue;
            }
            let mut total = 0.7 * noise * noise;
            for (rank, &light) in order.iter().enumerate() {
                let value = f64::from(values[light]);
                let predicted: f64 = (0..3).map(|axis| directions[light][axis] * facet[axis]).sum();
                if window.contains(&rank) {
                    total += (value - predicted).powi(2);
                } else if value > 2.0 * noise {
                    let mut difference = value - predicted.max(0.0);
                    if clipped[light] {
                        difference = difference.max(0.0);
                    }
                    if difference < 0.0 || rank < window.start {
                        total += 0.1 * difference.powi(2);
                    }
                }
            }
            let cost = total / (kept as f64 - 3.0 + 0.7) / rho.sqrt()
                * (lights as f64 / kept as f64).powi(4)
                * (rho / full_scale).powi(2).max(1.0);
            if (rho < median, cost) < (best.0, best.1) || best.1 == f64::INFINITY {
                best = (rho < median, cost, window);
            }
        }
    }
    let mut kept = vec![false; lights];
    for &light in &order[best.2] {
        kept[light] = true;
    }
    kept
}

pub fn slow_kept(method: Method, values: &[f32], directions: &[[f64; 3]], full_scale: f32) -> Vec<bool> {
    match method {
        Method::Lambertian => vec![true; values.len()],
        Method::SpecularFilter { threshold } => slow_specular_filter(values, threshold * full_scale / 255.0),
        Method::RobustFilter => {
            let clipped: Vec<bool> = values.iter().map(|&value| value >= full_scale).collect();
            slow_robust_filter(values, &clipped, directions, f64::from(full_scale), 1.0)
        }
    }
}
