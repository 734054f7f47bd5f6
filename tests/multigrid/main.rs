//! The integrator's linear algebra: the reduced operator against a plain matrix, the preconditioner against its promises.
#![allow(clippy::unwrap_used, clippy::float_cmp, missing_docs)]

mod plain;

use std::ops::ControlFlow;

use bgars_core::integrate::{Difference, Params, Surface, System, integrate};
use bgars_suite::{on_threads, slits};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::matrix_free::InitialGuessStatus;
use faer::matrix_free::LinOp;
use faer::matrix_free::conjugate_gradient::{CgParams, conjugate_gradient, conjugate_gradient_scratch};
use faer::{Mat, Par};
use nalgebra::{DMatrix, DVector};
use plain::{disc_with_holes, mask, noise, slits, slow_system, wavy_normals};

fn solve(normals: &[f32], mask: &[bool], width: usize, relative_tolerance: f64) -> Surface {
    let params = Params { relative_tolerance, ..Params::default() };
    integrate(normals, mask, width, None, &params, &mut |_| ControlFlow::Continue(())).unwrap()
}

#[test]
fn heights_solve_the_plain_normal_equations() {
    // Odd and even sizes, single rows and columns, masks with a fifth of the pixels missing.
    for (height, width) in [(1, 1), (1, 9), (8, 1), (2, 2), (7, 9), (12, 10), (16, 17), (33, 35)] {
        let mut noise = noise(height as u64 * 100 + width as u64);
        let mut mask: Vec<bool> = (0..height * width).map(|_| noise() > -0.3).collect();
        mask[0] = true;
        let normals = wavy_normals(height, width, 5);
        let surface = solve(&normals, &mask, width, 1e-10);
        let (matrix, right) = slow_system(&normals, &mask, width);
        let heights = DVector::from_iterator(
            mask.len(),
            surface.height_px.iter().map(|&z| if z.is_nan() { 0.0 } else { f64::from(z) }),
        );
        // Heights are returned in f32.
        let error = (&matrix * heights - &right).amax();
        assert!(error <= 2e-5, "{height} x {width}: {error}");
    }
}

#[test]
fn the_operator_is_the_schur_complement_of_the_plain_matrix() {
    let (height, width) = (9, 12);
    let mut noise = noise(3);
    let mask: Vec<bool> = (0..height * width).map(|_| noise() > -0.35).collect();
    let normals = wavy_normals(height, width, 7);
    let system = System::new(&normals, &mask, width, None, Difference::Trapezoid).unwrap();
    let (matrix, right) = slow_system(&normals, &mask, width);
    let colour = |parity: usize| {
        (0..height * width).filter(|pixel| (pixel / width + pixel % width) % 2 == parity).collect::<Vec<usize>>()
    };
    let (reds, blacks) = (colour(0), colour(1));
    // A pixel without neighbours has an empty row: its inverse is taken as zero.
    let inverse = blacks.iter().map(|&b| if matrix[(b, b)] > 0.0 { 1.0 / matrix[(b, b)] } else { 0.0 });
    let inverse = DMatrix::from_diagonal(&DVector::from_iterator(blacks.len(), inverse));
    let block = |rows: &[usize], cols: &[usize]| {
        DMatrix::from_fn(rows.len(), cols.len(), |row, col| matrix[(rows[row], cols[col])])
    };
    let schur = block(&reds, &reds) - block(&reds, &blacks) * &inverse * block(&blacks, &reds);
    let x = DVector::from_fn(reds.len(), |_, _| noise());
    let expected = &schur * &x;
    let mut out = Mat::<f64>::zeros(reds.len(), 1);
    let vector = Mat::from_fn(reds.len(), 1, |row, _| x[row]);
    system.operator().apply(out.as_mut(), vector.as_ref(), Par::Seq, MemStack::new(&mut []));
    let pick = |pixels: &[usize]| DVector::from_iterator(pixels.len(), pixels.iter().map(|&pixel| right[pixel]));
    let expected_right = pick(&reds) - block(&reds, &blacks) * inverse * pick(&blacks);
    for row in 0..reds.len() {
        assert!((out[(row, 0)] - expected[row]).abs() < 1e-6, "red {row}");
        assert!((system.right_side()[row] - expected_right[row]).abs() < 1e-6, "red {row}");
    }
}

#[test]
fn the_preconditioner_is_symmetric_and_positive() {
    let easy = [
        ("rectangle", 96, mask(96, 96, |_, _| true)),
        ("disc with holes", 131, mask(131, 131, disc_with_holes)),
        ("slits", 160, mask(160, 160, slits(160))),
    ];
    // Grids alone, and graphs from every level on.
    let hard = slits::gallery(130).into_iter().map(|(name, mask)| (name, 130, mask));
    for (name, size, mask) in easy.into_iter().chain(hard) {
        let system = System::new(&wavy_normals(size, size, 1), &mask, size, None, Difference::Trapezoid).unwrap();
        let preconditioner = system.preconditioner();
        let n = system.right_side().len();
        let mut noise = noise(9);
        let apply = |x: &Mat<f64>| {
            let mut out = Mat::<f64>::zeros(n, 1);
            preconditioner.apply(out.as_mut(), x.as_ref(), Par::Seq, MemStack::new(&mut []));
            out
        };
        // In the range of the operator: residuals never have a part in a component's constant.
        let mut residual = || {
            let x = Mat::from_fn(n, 1, |_, _| noise());
            let mut out = Mat::<f64>::zeros(n, 1);
            system.operator().apply(out.as_mut(), x.as_ref(), Par::Seq, MemStack::new(&mut []));
            out
        };
        let (x, y) = (residual(), residual());
        let (m_x, m_y) = (apply(&x), apply(&y));
        let dot = |a: &Mat<f64>, b: &Mat<f64>| (0..n).map(|row| a[(row, 0)] * b[(row, 0)]).sum::<f64>();
        let scale = (dot(&m_x, &x) * dot(&m_y, &y)).sqrt();
        assert!(dot(&m_x, &x) > 0.0 && dot(&m_y, &y) > 0.0, "{name}");
        let asymmetry = (dot(&m_x, &y) - dot(&x, &m_y)).abs() / scale;
        assert!(asymmetry < 1e-5, "{name}: {asymmetry}");
    }
}

#[test]
fn faer_on_the_public_system_agrees_with_the_integrator() {
    let size = 150;
    let mask = mask(size, size, disc_with_holes);
    let normals = wavy_normals(size, size, 2);
    let system = System::new(&normals, &mask, size, None, Difference::Trapezoid).unwrap();
    let (operator, preconditioner) = (system.operator(), system.preconditioner());
    let right = Mat::from_fn(system.right_side().len(), 1, |row, _| system.right_side()[row]);
    let mut x = Mat::<f64>::zeros(right.nrows(), 1);
    // Not the default `Zero`: faer 0.24 then leaves its residual uninitialised.
    let params = CgParams {
        initial_guess: InitialGuessStatus::MaybeNonZero,
        rel_tolerance: 1e-9,
        max_iters: 50,
        ..CgParams::default()
    };
    let mut buffer = MemBuffer::new(conjugate_gradient_scratch(&preconditioner, &operator, 1, Par::Seq));
    let info = conjugate_gradient(
        x.as_mut(),
        &preconditioner,
        &operator,
        right.as_ref(),
        params,
        |_| {},
        Par::Seq,
        MemStack::new(&mut buffer),
    )
    .unwrap();
    let surface = solve(&normals, &mask, size, 1e-9);
    assert!(info.iter_count.abs_diff(surface.iterations) <= 1, "{} and {}", info.iter_count, surface.iterations);
    // Equal up to the constant of the component.
    let half = system.right_side().len() / size;
    let red = |pixel: usize| (pixel / size + pixel % size).is_multiple_of(2) && surface.labels[pixel] == 0;
    let differences: Vec<f64> = (0..size * size)
        .filter(|&pixel| red(pixel))
        .map(|pixel| x[(pixel / size * half + pixel % size / 2, 0)] - f64::from(surface.height_px[pixel]))
        .collect();
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    let worst = differences.iter().fold(0.0f64, |worst, difference| worst.max((difference - mean).abs()));
    assert!(worst < 1e-4, "{worst} px");
}

#[test]
fn a_millionth_takes_twelve_iterations_at_any_size_and_fifteen_with_slits() {
    for size in [64, 255, 512] {
        let normals = wavy_normals(size, size, 4);
        for (name, mask, limit) in [
            ("rectangle", mask(size, size, |_, _| true), 12),
            ("disc with holes", mask(size, size, disc_with_holes), 12),
            ("slits", mask(size, size, slits(size)), 15),
        ] {
            let surface = solve(&normals, &mask, size, 1e-6);
            assert!(surface.residual <= 1e-6);
            assert!(surface.iterations <= limit, "{name} of {size}: {} iterations", surface.iterations);
        }
    }
}

#[test]
fn large_smooth_surfaces_converge_to_the_default_tolerance() {
    // Large heights, a right side at the border alone: what rounding does to a component's constant shows here first.
    let size = 2048;
    let sphere = |row: usize, col: usize| {
        let [x, y] = [col, row].map(|place| (place as f64 + 0.5) / size as f64 - 0.5);
        [x, -y, (1.0 - x * x - y * y).sqrt()]
    };
    let plane = |_: usize, _: usize| [0.1, 0.0, 0.99f64.sqrt()];
    let normals = |of: &dyn Fn(usize, usize) -> [f64; 3]| -> Vec<f32> {
        (0..size * size).flat_map(|pixel| of(pixel / size, pixel % size).map(|component| component as f32)).collect()
    };
    for (name, normals) in [("plane", normals(&plane)), ("sphere", normals(&sphere))] {
        let surface = solve(&normals, &vec![true; size * size], size, Params::default().relative_tolerance);
        assert!(surface.residual <= Params::default().relative_tolerance);
        assert!(surface.iterations <= 14, "{name}: {} iterations", surface.iterations);
    }
}

#[test]
fn a_ten_billionth_is_reached_with_a_preconditioner_in_single_precision() {
    let size = 700;
    let params = Params { relative_tolerance: 1e-10, absolute_tolerance: 1e-15, ..Params::default() };
    let shapes = [("plane", [0.1, 0.0, 0.99f32.sqrt()].repeat(size * size)), ("waves", wavy_normals(size, size, 4))];
    for (shape, normals) in shapes {
        for (name, mask) in
            [("rectangle", mask(size, size, |_, _| true)), ("disc with holes", mask(size, size, disc_with_holes))]
        {
            let proceed = &mut |_| ControlFlow::Continue(());
            let surface = integrate(&normals, &mask, size, None, &params, proceed).unwrap();
            assert!(surface.residual <= 1e-10, "{shape}, {name}: {}", surface.residual);
            assert!(surface.iterations <= 20, "{shape}, {name}: {} iterations", surface.iterations);
        }
    }
}

#[test]
fn a_millionth_is_reached_on_thin_slits_of_any_kind() {
    // A lane of one pixel that winds through the whole image is the hardest: a coarse unknown sees its length alone.
    let limit = |name: &str| match name {
        "maze 1" | "maze 1, shifted" => 150,
        _ if name.starts_with("maze") || name.starts_with("serpentine") => 100,
        _ if name.starts_with("comb") || name.starts_with("spiral") || name.starts_with("islands") => 40,
        "percolation" => 30,
        _ => 20,
    };
    for size in [255, 512] {
        let normals = wavy_normals(size, size, 4);
        for (name, mask) in slits::gallery(size) {
            let surface = solve(&normals, &mask, size, 1e-6);
            assert!(surface.residual <= 1e-6);
            assert!(surface.iterations <= limit(name), "{name} of {size}: {} iterations", surface.iterations);
        }
    }
}

#[test]
fn a_millionth_takes_twenty_iterations_on_a_large_image_of_slits() {
    let size = 1500;
    let normals = wavy_normals(size, size, 4);
    for (name, mask) in [("dense cuts", slits::dense_cuts(size)), ("dense slanted cuts", slits::slanted_cuts(size))] {
        let surface = solve(&normals, &mask, size, 1e-6);
        assert!(surface.residual <= 1e-6);
        assert!(surface.iterations <= 20, "{name}: {} iterations", surface.iterations);
    }
}

#[test]
fn scattered_holes_take_fifteen_iterations() {
    let size = 512;
    let normals = wavy_normals(size, size, 4);
    for share in [0.01, 0.05, 0.2] {
        let surface = solve(&normals, &slits::holes(size, 1, share), size, 1e-6);
        assert!(surface.iterations <= 15, "{share}: {} iterations", surface.iterations);
    }
}

#[test]
fn thin_slits_under_weights_that_vary_by_ten_thousand_converge() {
    let size = 300;
    let normals = wavy_normals(size, size, 8);
    let weights: Vec<f32> = (0..size * size)
        .map(|pixel| [1.0, 1e-2, 1e-4, 0.3][(pixel / size / 37 * 7 + pixel % size / 37 * 3) % 4])
        .collect();
    let params = Params { relative_tolerance: 1e-6, ..Params::default() };
    for (name, mask) in slits::gallery(size) {
        let proceed = &mut |_| ControlFlow::Continue(());
        let surface = integrate(&normals, &mask, size, Some(&weights), &params, proceed).unwrap();
        assert!(surface.residual <= 1e-6, "{name}: {}", surface.residual);
    }
}

#[test]
fn heights_over_thin_slits_are_the_same_bits_on_any_number_of_threads() {
    let size = 400;
    let normals = wavy_normals(size, size, 3);
    for (name, mask) in slits::gallery(size) {
        let [one, three] = [1, 3].map(|threads| on_threads(threads, || solve(&normals, &mask, size, 1e-6).height_px));
        let same = one.iter().zip(&three).all(|(one, three)| one.to_bits() == three.to_bits());
        assert!(same, "{name}");
    }
}

#[test]
fn heights_over_narrow_lanes_solve_the_plain_normal_equations() {
    let size = 34;
    let normals = wavy_normals(size, size, 5);
    for (name, mask) in slits::gallery(size) {
        let surface = solve(&normals, &mask, size, 1e-10);
        let (matrix, right) = slow_system(&normals, &mask, size);
        let heights = DVector::from_iterator(
            mask.len(),
            surface.height_px.iter().map(|&z| if z.is_nan() { 0.0 } else { f64::from(z) }),
        );
        // Heights are returned in f32, and a lane can be a thousand pixels long.
        let scale = heights.amax().max(1.0);
        let error = (&matrix * heights - &right).amax();
        assert!(error <= 2e-6 * scale, "{name}: {error}");
    }
}

#[test]
fn the_two_sides_of_a_cut_do_not_feel_each_other() {
    // Two rectangles, apart by one column of pixels: the left one must come out the same whatever the right one holds.
    let (height, width, cut) = (70, 131, 66);
    let mask: Vec<bool> = (0..height * width).map(|pixel| pixel % width != cut).collect();
    let normals = wavy_normals(height, width, 6);
    let mut steeper = normals.clone();
    for pixel in (0..height * width).filter(|pixel| pixel % width > cut) {
        steeper[3 * pixel..3 * pixel + 3].copy_from_slice(&[-0.6, 0.0, 0.8]);
    }
    let (plain, changed) = (solve(&normals, &mask, width, 1e-10), solve(&steeper, &mask, width, 1e-10));
    for pixel in (0..height * width).filter(|pixel| pixel % width < cut) {
        let difference = plain.height_px[pixel] - changed.height_px[pixel];
        assert!(difference.abs() < 1e-5, "{difference} px at {pixel}");
    }
}
