//! Connected parts of a mask: each keeps its own unknown constant.

use memchr::memchr;
use rayon::prelude::*;

use super::reduction::sum;
use crate::memory::zeros;

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

/// Pixels of the mask that follow each other in a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Run {
    pub row: usize,
    pub start: usize,
    pub end: usize,
    pub component: usize,
}

/// A mask as runs in reading order (each within one region), and the components that they form.
#[derive(Debug)]
pub(super) struct Runs {
    width: usize,
    all: Vec<Run>,
    /// First run of each row, and the end.
    row_starts: Vec<usize>,
    pub components: Vec<Component>,
}

impl Runs {
    /// # Cost
    /// Linear in the number of pixels, in parallel, and nearly linear in the number of runs (union-find).
    pub fn new(mask: &[bool], regions: Option<&[i32]>, width: usize) -> Self {
        let height = mask.len() / width;
        let region = |row: usize, col: usize| regions.map_or(0, |regions| regions[row * width + col]);
        let row_runs = |(row, mask)| {
            let regions = regions.map(|regions| &regions[row * width..(row + 1) * width]);
            RowRuns { row, mask: bytemuck::must_cast_slice::<bool, u8>(mask), regions, col: 0 }
        };
        let mut runs: Vec<Run> = mask.par_chunks(width).enumerate().flat_map_iter(row_runs).collect();
        let mut row_starts = vec![0; height + 1];
        for run in &runs {
            row_starts[run.row + 1] += 1;
        }
        for row in 0..height {
            row_starts[row + 1] += row_starts[row];
        }
        let mut parents: Vec<usize> = (0..runs.len()).collect();
        for row in 1..height {
            let (mut above, end_above) = (row_starts[row - 1], row_starts[row]);
            for run in row_starts[row]..row_starts[row + 1] {
                while above < end_above && runs[above].end <= runs[run].start {
                    above += 1;
                }
                // The last run above may reach over the next one here, too.
                let mut touching = above;
                while touching < end_above && runs[touching].start < runs[run].end {
                    if region(row, runs[run].start) == region(row - 1, runs[touching].start) {
                        unite(&mut parents, run, touching);
                    }
                    touching += 1;
                }
            }
        }
        let mut components = Vec::new();
        for index in 0..runs.len() {
            let root = find(&mut parents, index);
            let Run { row, start, end, .. } = runs[index];
            // The root is the first run of its component: it has its number already.
            let component = if root == index {
                components.push(Component { pixels: 0, first_row: row, first_col: start });
                components.len() - 1
            } else {
                runs[root].component
            };
            runs[index].component = component;
            components[component].pixels += end - start;
        }
        Self { width, all: runs, row_starts, components }
    }

    /// The runs of a row.
    pub fn row(&self, row: usize) -> &[Run] {
        &self.all[self.row_starts[row]..self.row_starts[row + 1]]
    }

    /// Index of each pixel's component, row-major; -1 outside the mask.
    pub fn labels(&self) -> Vec<i32> {
        let mut labels = zeros((self.row_starts.len() - 1) * self.width);
        self.write_labels(&mut labels);
        labels
    }

    /// [`Self::labels`] into memory that is there already.
    pub fn write_labels(&self, labels: &mut [i32]) {
        labels.par_chunks_mut(self.width).enumerate().for_each(|(row, labels)| {
            labels.fill(-1);
            for run in self.row(row) {
                // At most one component a pixel, and images of 2^31 pixels are refused where they are read.
                labels[run.start..run.end].fill(run.component as i32);
            }
        });
    }

    /// Mean of the values of each component; `fill` writes the values of a row, of its runs at least.
    ///
    /// Summed in an order that does not depend on the threads.
    pub fn means(&self, fill: impl Fn(usize, &mut [f64]) + Sync) -> Vec<f64> {
        let row_sums = |values: &mut Vec<f64>, row: usize| -> Vec<f64> {
            let runs = self.row(row);
            if !runs.is_empty() {
                fill(row, values);
            }
            runs.iter().map(|run| sum(&values[run.start..run.end])).collect()
        };
        let rows = (0..self.row_starts.len() - 1).into_par_iter();
        let run_sums: Vec<f64> = rows.map_init(|| vec![0.0; self.width], row_sums).flatten_iter().collect();
        let mut means = vec![0.0; self.components.len()];
        for (run, sum) in self.all.iter().zip(run_sums) {
            means[run.component] += sum;
        }
        for (mean, component) in means.iter_mut().zip(&self.components) {
            *mean /= component.pixels as f64;
        }
        means
    }
}

/// The runs of one row of a mask.
struct RowRuns<'a> {
    row: usize,
    /// 0 or 1 a pixel.
    mask: &'a [u8],
    regions: Option<&'a [i32]>,
    col: usize,
}

impl Iterator for RowRuns<'_> {
    type Item = Run;

    fn next(&mut self) -> Option<Run> {
        let start = self.col + memchr(1, &self.mask[self.col..])?;
        let rest = &self.mask[start..];
        let mut end = start + memchr(0, rest).unwrap_or(rest.len());
        if let Some(regions) = self.regions {
            let rest = &regions[start..end];
            end = start + rest.iter().position(|&region| region != rest[0]).unwrap_or(rest.len());
        }
        self.col = end;
        Some(Run { row: self.row, start, end, component: 0 })
    }
}

/// The first run of the component of `run`.
fn find(parents: &mut [usize], mut run: usize) -> usize {
    while parents[run] != run {
        parents[run] = parents[parents[run]];
        run = parents[run];
    }
    run
}

fn unite(parents: &mut [usize], a: usize, b: usize) {
    let (a, b) = (find(parents, a), find(parents, b));
    parents[a.max(b)] = a.min(b);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn diagonal_neighbours_are_apart() {
        let mask = [true, false, false, true, false, true];
        let runs = Runs::new(&mask, None, 2);
        assert_eq!(runs.labels(), [0, -1, -1, 1, -1, 1]);
        let sizes: Vec<usize> = runs.components.iter().map(|component| component.pixels).collect();
        assert_eq!(sizes, [1, 2]);
        assert_eq!((runs.components[1].first_row, runs.components[1].first_col), (1, 1));
    }

    #[test]
    fn rows_do_not_wrap_around() {
        assert_eq!(Runs::new(&[false, true, true, false], None, 2).components.len(), 2);
    }

    #[test]
    fn arms_that_meet_further_down_are_one_component() {
        // A comb: three teeth on one beam, and a pixel of its own.
        let rows = ["#.#.#", "#.#.#", "#####", ".....", "..#.."];
        let mask: Vec<bool> = rows.concat().chars().map(|mark| mark == '#').collect();
        let runs = Runs::new(&mask, None, 5);
        let sizes: Vec<usize> = runs.components.iter().map(|component| component.pixels).collect();
        assert_eq!(sizes, [11, 1]);
    }

    #[test]
    fn regions_split_rows_and_stacks() {
        // Two regions side by side, a third below both.
        let regions = [1, 1, 2, 2, 1, 3, 3, 2];
        let runs = Runs::new(&[true; 8], Some(&regions), 4);
        assert_eq!(runs.labels(), [0, 0, 1, 1, 0, 2, 2, 1]);
        let sizes: Vec<usize> = runs.components.iter().map(|component| component.pixels).collect();
        assert_eq!(sizes, [3, 3, 2]);
    }

    #[test]
    fn means_are_taken_a_component() {
        let mask = [true, true, false, true, false, false];
        let means = Runs::new(&mask, None, 3).means(|row, values| {
            for (col, value) in values.iter_mut().enumerate() {
                *value = (10 * row + col) as f64;
            }
        });
        // Row 0: columns 0 and 1; row 1: column 0, below column 0.
        assert_eq!(means, [(0.0 + 1.0 + 10.0) / 3.0]);
    }
}
