//! Bilateral integration through the public API: it can be stopped, between re-weightings and within a solve.
#![allow(missing_docs)]

use std::ops::ControlFlow;

use bgars_core::Error;
use bgars_core::integrate::{BilateralParams, Field, Progress, Setting, integrate_bilateral};

const SIDE: usize = 200;

/// Normals that no surface has, so that every system takes hundreds of iterations.
fn rough() -> Vec<f32> {
    let number = |seed: usize| ((seed * 2_654_435_761) >> 7) % 1000;
    let normal = |pixel: usize| {
        let (x, y) = (number(2 * pixel) as f32 / 1000.0 - 0.5, number(2 * pixel + 1) as f32 / 1000.0 - 0.5);
        let length = (x * x + y * y + 1.0).sqrt();
        [x / length, y / length, 1.0 / length]
    };
    (0..SIDE * SIDE).flat_map(normal).collect()
}

/// Breaks at the call `last`; returns the states that were told.
fn stopped_at(last: usize, setting: Setting) -> (Vec<Progress>, bool) {
    let (normals, mask) = (rough(), vec![true; SIDE * SIDE]);
    let field = Field { normals: &normals, mask: &mask, weights: None, regions: None, width: SIDE };
    let params = BilateralParams { setting, ..BilateralParams::default() };
    let mut told = Vec::new();
    let outcome = integrate_bilateral(field, None, &params, &mut |state| {
        told.push(state);
        if told.len() == last { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    (told, matches!(outcome, Err(Error::Cancelled)))
}

#[test]
fn a_break_ends_it_at_once_wherever_it_comes() {
    for setting in [Setting::Compatible, Setting::Converged] {
        for last in [1, 2] {
            let (told, cancelled) = stopped_at(last, setting);
            assert!(cancelled, "{setting:?}, call {last}");
            assert_eq!(told.len(), last, "{setting:?}: called again after a break");
        }
    }
}

#[test]
fn the_callback_is_asked_within_the_first_solve() {
    for setting in [Setting::Compatible, Setting::Converged] {
        let (told, _) = stopped_at(1, setting);
        assert_eq!(told[0].iteration, 0, "{setting:?}");
    }
}
