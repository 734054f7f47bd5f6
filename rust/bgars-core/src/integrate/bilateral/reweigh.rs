//! The weights of a surface: which side of each pixel it follows.

use multiversion::multiversion;
use rayon::prelude::*;

use super::super::checkerboard::BAND_ROWS;
use super::pixels::{Pixels, Shares};

/// Largest argument of the sigmoid, either way: beyond, one side has all but `e^-70`, which is still a normal number in `f32`.
const MAX_ARGUMENT: f64 = 70.0;
/// Sums of the energy in flight.
const LANES: usize = 8;

/// Both sides of every pixel alike: where the iteration starts.
pub(super) fn even(pixels: &Pixels) -> Shares {
    std::array::from_fn(|_| vec![0.5; pixels.len()])
}

/// Sets the shares by the surface `z` (row-major in the box) and returns the energy with them (Cao et al. 2022, eqs. 11 and 16).
///
/// Summed by bands of rows, in an order that does not depend on the threads.
pub(super) fn reweigh(pixels: &Pixels, z: &[f64], k: f64, shares: &mut Shares) -> f64 {
    let width = pixels.crop.grid.width;
    let chunk = BAND_ROWS * width;
    let [rightward, upward] = shares;
    let energies: Vec<f64> = rightward
        .par_chunks_mut(chunk)
        .zip(upward.par_chunks_mut(chunk))
        .enumerate()
        .map(|(band, (rightward, upward))| {
            let mut steps = Steps { right: vec![0.0; width + 1], up: vec![0.0; width], down: vec![0.0; width] };
            let rows = rightward.chunks_mut(width).zip(upward.chunks_mut(width)).enumerate();
            rows.map(|(row, (rightward, upward))| {
                let row = band * BAND_ROWS + row;
                reweigh_row(pixels, z, row * width, k, &mut steps, [rightward, upward])
            })
            .sum::<f64>()
        })
        .collect();
    energies.iter().sum::<f64>() / pixels.unit
}

/// Sets the shares of a row, from pixel `first` on, and returns their energy.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn reweigh_row(pixels: &Pixels, z: &[f64], first: usize, k: f64, steps: &mut Steps, shares: [&mut [f64]; 2]) -> f64 {
    let [rightward, upward] = shares;
    steps.load(pixels, z, first, rightward.len());
    let right = Side { ahead: &steps.right[1..], behind: &steps.right, axis: 0 };
    let up = Side { ahead: &steps.up, behind: &steps.down, axis: 1 };
    row_of(pixels, first, &right, k, rightward) + row_of(pixels, first, &up, k, upward)
}

/// Height differences along a row, zero where nothing is joined.
struct Steps {
    /// To the right of each pixel, after one zero for what is left of the first.
    right: Vec<f64>,
    /// From each pixel upward.
    up: Vec<f64>,
    /// From below up to each pixel.
    down: Vec<f64>,
}

impl Steps {
    /// `count` pixels of a row from `first` on.
    #[inline(always)]
    fn load(&mut self, pixels: &Pixels, z: &[f64], first: usize, count: usize) {
        let width = pixels.crop.grid.width;
        let [right, below] = &pixels.ties;
        let here = &z[first..first + count];
        let (steps, ties) = (&mut self.right[1..=count], &right[first..first + count]);
        for k in 0..count - 1 {
            steps[k] = ties[k] * (here[k + 1] - here[k]);
        }
        steps[count - 1] = 0.0;
        let (up, down) = (&mut self.up[..count], &mut self.down[..count]);
        if let Some(above) = first.checked_sub(width) {
            let (above, ties) = (&z[above..above + count], &below[above..above + count]);
            for k in 0..count {
                up[k] = ties[k] * (above[k] - here[k]);
            }
        } else {
            up.fill(0.0);
        }
        if let Some(under) = z.get(first + width..first + width + count) {
            let ties = &below[first..first + count];
            for k in 0..count {
                down[k] = ties[k] * (here[k] - under[k]);
            }
        } else {
            down.fill(0.0);
        }
    }
}

/// Differences on the two sides of a row's pixels, in the direction in which the axis grows.
struct Side<'a> {
    ahead: &'a [f64],
    behind: &'a [f64],
    axis: usize,
}

/// Sets the shares of a row along an axis and returns their energy.
#[inline(always)]
fn row_of(pixels: &Pixels, first: usize, side: &Side<'_>, k: f64, share: &mut [f64]) -> f64 {
    let width = share.len();
    let (n, g) = (&pixels.n[side.axis][first..][..width], &pixels.g[side.axis][first..][..width]);
    let trust = &pixels.trust[first..][..width];
    let (ahead, behind) = (&side.ahead[..width], &side.behind[..width]);
    for i in 0..width {
        let (ahead, behind) = (ahead[i] * g[i], behind[i] * g[i]);
        share[i] = sigmoid(k * (behind * behind - ahead * ahead));
    }
    let rows = [trust, share, ahead, behind, g, n];
    let mut lanes = [0.0; LANES];
    let [trust, share, ahead, behind, g, n] = rows.map(|row| row.as_chunks::<LANES>().0);
    for i in 0..width / LANES {
        for lane in 0..LANES {
            let row = [trust, share, ahead, behind, g, n].map(|row| row[i][lane]);
            lanes[lane] += term(row);
        }
    }
    let rest = (width - width % LANES..width).map(|i| term(rows.map(|row| row[i])));
    lanes.iter().sum::<f64>() + rest.sum::<f64>()
}

/// Energy of a pixel along an axis.
#[inline(always)]
fn term([trust, share, ahead, behind, g, n]: [f64; 6]) -> f64 {
    let (ahead, behind) = (ahead * g + n, behind * g + n);
    trust * (share * (ahead * ahead) + (1.0 - share) * (behind * behind))
}

#[inline(always)]
fn sigmoid(argument: f64) -> f64 {
    1.0 / (1.0 + (-argument.clamp(-MAX_ARGUMENT, MAX_ARGUMENT)).exp())
}
