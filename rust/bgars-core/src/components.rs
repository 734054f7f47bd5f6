//! Connected parts of a mask: each keeps its own unknown constant.

use std::ops::Range;

use rayon::prelude::*;

/// One connected component of the mask (4-neighbourhood).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Component {
    /// Number of pixels.
    pub pixels: usize,
    /// Row of its first pixel in reading order.
    pub first_row: usize,
    /// Column of that pixel.
    pub first_col: usize,
}

/// Pixels of the mask that follow each other in a row: from a column up to another. Images of 2^31 pixels are refused where
/// they are read.
#[derive(Clone, Copy, Debug)]
struct Run {
    start: u32,
    end: u32,
}

impl Run {
    fn cols(self) -> Range<usize> {
        self.start as usize..self.end as usize
    }
}

/// A mask as runs in reading order (each within one region), and the components that they form.
#[derive(Debug)]
pub(crate) struct Runs {
    width: usize,
    all: Vec<Run>,
    component_of: Vec<u32>,
    /// First run of each row, and the end.
    row_starts: Vec<usize>,
    pub components: Vec<Component>,
}

impl Runs {
    /// # Cost
    /// Linear in the number of pixels, in parallel, and nearly linear in the number of runs (union-find).
    pub fn new(mask: &[bool], regions: Option<&[i32]>, width: usize) -> Self {
        let height = mask.len() / width;
        let region = |row: usize, run: Run| regions.map_or(0, |regions| regions[row * width + run.start as usize]);
        let rows: Vec<Vec<Run>> = mask
            .par_chunks(width)
            .enumerate()
            .map(|(row, mask)| row_runs(mask, regions.map(|regions| &regions[row * width..(row + 1) * width])))
            .collect();
        let all = rows.concat();
        let mut row_starts = vec![0; height + 1];
        for (row, runs) in rows.iter().enumerate() {
            row_starts[row + 1] = row_starts[row] + runs.len();
        }
        drop(rows);
        let mut parents: Vec<u32> = (0..all.len() as u32).collect();
        for row in 1..height {
            let (mut above, end_above) = (row_starts[row - 1], row_starts[row]);
            for run in row_starts[row]..row_starts[row + 1] {
                while above < end_above && all[above].end <= all[run].start {
                    above += 1;
                }
                // The last run above may reach over the next one here, too.
                let mut touching = above;
                while touching < end_above && all[touching].start < all[run].end {
                    if region(row, all[run]) == region(row - 1, all[touching]) {
                        unite(&mut parents, run, touching);
                    }
                    touching += 1;
                }
            }
        }
        let mut components: Vec<Component> = Vec::new();
        let mut component_of = parents;
        for row in 0..height {
            for index in row_starts[row]..row_starts[row + 1] {
                let run = all[index];
                // A parent comes before its runs and is in their component: it has its number already.
                let parent = component_of[index] as usize;
                if parent == index {
                    component_of[index] = components.len() as u32;
                    components.push(Component { pixels: 0, first_row: row, first_col: run.start as usize });
                } else {
                    component_of[index] = component_of[parent];
                }
                components[component_of[index] as usize].pixels += run.cols().len();
            }
        }
        Self { width, all, component_of, row_starts, components }
    }

    /// The columns of the runs of a row, and the component of each.
    pub fn row(&self, row: usize) -> impl Iterator<Item = (Range<usize>, usize)> {
        let runs = self.row_starts[row]..self.row_starts[row + 1];
        let cols = self.all[runs.clone()].iter().map(|run| run.cols());
        cols.zip(self.component_of[runs].iter().map(|&component| component as usize))
    }

    /// The columns before, between and after the runs of a row, as far as there are any.
    pub fn gaps(&self, row: usize) -> impl Iterator<Item = Range<usize>> {
        let mut done = 0;
        let ends = self.row(row).map(|(cols, _)| cols).chain(std::iter::once(self.width..self.width));
        ends.map(move |cols| std::mem::replace(&mut done, cols.end)..cols.start)
    }

    /// Index of each pixel's component, row-major; -1 outside the mask.
    pub fn labels(&self) -> Vec<i32> {
        let mut labels = vec![0; (self.row_starts.len() - 1) * self.width];
        self.write_labels(&mut labels);
        labels
    }

    /// [`Self::labels`] into memory that is there already.
    pub fn write_labels(&self, labels: &mut [i32]) {
        labels.par_chunks_mut(self.width).enumerate().for_each(|(row, labels)| {
            for (cols, component) in self.row(row) {
                labels[cols].fill(component as i32);
            }
            for cols in self.gaps(row) {
                labels[cols].fill(-1);
            }
        });
    }

    /// Mean of the values of each component; `sum` adds up those of some columns of a row.
    ///
    /// Summed in an order that does not depend on the threads.
    pub fn means(&self, sum: impl Fn(usize, Range<usize>) -> f64 + Sync) -> Vec<f64> {
        let row_sums = |row: usize| -> Vec<f64> { self.row(row).map(|(cols, _)| sum(row, cols)).collect() };
        let run_sums: Vec<Vec<f64>> = (0..self.row_starts.len() - 1).into_par_iter().map(row_sums).collect();
        let mut means = vec![0.0; self.components.len()];
        for (&component, sum) in self.component_of.iter().zip(run_sums.iter().flatten()) {
            means[component as usize] += sum;
        }
        for (mean, component) in means.iter_mut().zip(&self.components) {
            *mean /= component.pixels as f64;
        }
        means
    }
}

/// The runs of one row of a mask.
fn row_runs(mask: &[bool], regions: Option<&[i32]>) -> Vec<Run> {
    let number = |col: usize| regions.map_or(0, |regions| regions[col]);
    let mut runs: Vec<Run> = Vec::new();
    for col in (0..mask.len()).filter(|&col| mask[col]) {
        match runs.last_mut() {
            Some(run) if run.end as usize == col && number(col) == number(col - 1) => run.end += 1,
            _ => runs.push(Run { start: col as u32, end: col as u32 + 1 }),
        }
    }
    runs
}

/// The first run of the component of `run`.
fn find(parents: &mut [u32], mut run: usize) -> usize {
    while parents[run] as usize != run {
        parents[run] = parents[parents[run] as usize];
        run = parents[run] as usize;
    }
    run
}

fn unite(parents: &mut [u32], a: usize, b: usize) {
    let (a, b) = (find(parents, a), find(parents, b));
    parents[a.max(b)] = a.min(b) as u32;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Word for word: from each pixel without a number to all that it is joined to.
    fn flooded(mask: &[bool], regions: &[i32], width: usize) -> Vec<i32> {
        let mut labels = vec![-1; mask.len()];
        let mut count = 0;
        for first in 0..mask.len() {
            if !mask[first] || labels[first] >= 0 {
                continue;
            }
            let mut reached = vec![first];
            labels[first] = count;
            while let Some(pixel) = reached.pop() {
                let col = pixel % width;
                let beside = [(col > 0, 1_usize.wrapping_neg()), (col + 1 < width, 1)];
                for (there, step) in beside.into_iter().chain([(true, width.wrapping_neg()), (true, width)]) {
                    let next = pixel.wrapping_add(step);
                    let is_joined = there && next < mask.len() && mask[next] && regions[next] == regions[pixel];
                    if is_joined && labels[next] < 0 {
                        labels[next] = count;
                        reached.push(next);
                    }
                }
            }
            count += 1;
        }
        labels
    }

    #[test]
    fn labels_are_those_of_flooding() {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state >> 24
        };
        for (width, height, used, kinds) in [(37, 41, 150, 1), (64, 30, 170, 2), (1, 50, 128, 1), (50, 1, 200, 3)] {
            let mask: Vec<bool> = (0..width * height).map(|_| next() < used).collect();
            let regions: Vec<i32> = (0..width * height).map(|_| (next() % kinds) as i32).collect();
            let runs = Runs::new(&mask, Some(&regions), width);
            let expected = flooded(&mask, &regions, width);
            assert_eq!(runs.labels(), expected, "{width} x {height}");
            for (number, component) in runs.components.iter().enumerate() {
                assert_eq!(component.pixels, expected.iter().filter(|&&label| label == number as i32).count());
            }
        }
    }
}
