//! Which board pixels no ball hides, and how many balls shadow them under each light.

use multiversion::multiversion;
use rayon::prelude::*;

use super::model::{Ball, Board, Lamp, Shadow, norm};

/// Points of an outline that say which window of the map a shadow needs.
const OUTLINE_POINTS: usize = 24;
const WINDOW_MARGIN_PX: f64 = 2.0;

/// How much wider than predicted silhouettes and shadows are drawn, in pixels.
#[allow(missing_docs)] // the names say it
#[derive(Clone, Copy, Debug)]
pub struct Margins {
    pub silhouette_px: f64,
    pub shadow_px: f64,
}

/// Predicted silhouettes and shadows, one cell for `step` by `step` pixels.
#[allow(missing_docs)] // the names say it
#[derive(Clone, Debug)]
pub struct ShadowMap {
    pub rows: usize,
    pub cols: usize,
    /// `rows * cols`: whether a ball hides the board.
    pub hidden: Vec<bool>,
    /// `lights * rows * cols`: how many balls shadow it.
    pub count: Vec<u8>,
}

/// Where the cells of a map lie.
struct Grid {
    x0: f64,
    y0: f64,
    step: f64,
    rows: usize,
    cols: usize,
}

impl Grid {
    fn x(&self, col: usize) -> f64 {
        self.x0 + col as f64 * self.step
    }

    fn y(&self, row: usize) -> f64 {
        self.y0 - row as f64 * self.step
    }

    /// Rows and columns of the cells between two corners (low, high); may be empty.
    fn window(&self, x: [f64; 2], y: [f64; 2]) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let cell = |way: f64, cells: usize| (way / self.step).ceil().clamp(0.0, cells as f64) as usize;
        (
            cell(self.y0 - y[1], self.rows)..cell(self.y0 - y[0], self.rows),
            cell(x[0] - self.x0, self.cols)..cell(x[1] - self.x0, self.cols),
        )
    }
}

/// Draws silhouettes and shadows of all balls under all lights; lights are drawn in parallel.
///
/// `shape` is that of the images, `step` the size of a cell in pixels.
///
/// # Examples
/// ```
/// use bgars_core::shadows::{Margins, draw_shadows, model::{Board, Lamp}};
/// let ball = [0.0, 0.0, 10.0, 10.0, 1.0].into();
/// let lamp = Lamp { vector: [0.6, 0.0, 0.8], near: false };
/// let margins = Margins { silhouette_px: 0.0, shadow_px: 0.0 };
/// let map = draw_shadows(&[ball], &[lamp], &Board([0.0; 5]), [64, 64], 1, margins);
/// assert!(map.hidden[32 * 64 + 32]);
/// assert_eq!(map.count[32 * 64 + 14], 1); // 17.5 px away from the lamp: the shadow reaches to 7.5 + 12.5
/// assert_eq!(map.count[32 * 64 + 50], 0);
/// ```
#[must_use]
pub fn draw_shadows(
    balls: &[Ball],
    lamps: &[Lamp],
    board: &Board,
    shape: [usize; 2],
    step: usize,
    margins: Margins,
) -> ShadowMap {
    let [height, width] = shape;
    let (rows, cols) = (height.div_ceil(step), width.div_ceil(step));
    let middle = (step - 1) as f64 / 2.0;
    let grid = Grid {
        x0: middle + 0.5 - width as f64 / 2.0,
        y0: height as f64 / 2.0 - 0.5 - middle,
        step: step as f64,
        rows,
        cols,
    };
    let mut hidden = vec![false; rows * cols];
    for ball in balls {
        let reach = ball.radius + margins.silhouette_px;
        let (in_rows, in_cols) = grid.window([ball.x - reach, ball.x + reach], [ball.y - reach, ball.y + reach]);
        for row in in_rows {
            let across_y = grid.y(row) - ball.y;
            for col in in_cols.clone() {
                let across_x = grid.x(col) - ball.x;
                hidden[row * cols + col] |= across_x * across_x + across_y * across_y < reach * reach;
            }
        }
    }
    let mut count = vec![0u8; lamps.len() * rows * cols];
    count.par_chunks_mut((rows * cols).max(1)).zip(lamps).for_each(|(count, &lamp)| {
        for &ball in balls {
            draw(count, &grid, ball, lamp, board, margins.shadow_px);
        }
    });
    ShadowMap { rows, cols, hidden, count }
}

/// Counts the shadow of one ball under one light.
fn draw(count: &mut [u8], grid: &Grid, ball: Ball, lamp: Lamp, board: &Board, margin_px: f64) {
    let shadow = Shadow::new(ball, lamp, board);
    let (mut x, mut y) = ([ball.x; 2], [ball.y; 2]);
    for index in 0..OUTLINE_POINTS {
        let angle = std::f64::consts::TAU * index as f64 / OUTLINE_POINTS as f64;
        let point = shadow.edge(angle.sin(), angle.cos());
        x = [x[0].min(point.x), x[1].max(point.x)];
        y = [y[0].min(point.y), y[1].max(point.y)];
    }
    let margin = margin_px + WINDOW_MARGIN_PX;
    let (rows, cols) = grid.window([x[0] - margin, x[1] + margin], [y[0] - margin, y[1] + margin]);
    let reach = ball.radius + margin_px;
    for row in rows {
        let y = grid.y(row);
        let cells = &mut count[row * grid.cols..][cols.clone()];
        if lamp.near {
            for (cell, col) in cells.iter_mut().zip(cols.clone()) {
                let ray = shadow.ray(grid.x(col), y);
                *cell = cell.saturating_add(u8::from(ray.distance < reach && ray.along > 0.0));
            }
        } else {
            draw_row(cells, grid.x(cols.start), grid.step, y, &shadow, ball, lamp, reach);
        }
    }
}

/// A row of a distant light's shadow. The board is its tangent plane under the ball: a map has margins.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
#[allow(clippy::too_many_arguments)]
fn draw_row(cells: &mut [u8], x0: f64, step: f64, y: f64, shadow: &Shadow<'_>, ball: Ball, lamp: Lamp, reach: f64) {
    let (down, slope_x, slope_y) = shadow.tangent_plane();
    let [x, y_part, z] = [lamp.vector[0], lamp.vector[1], lamp.vector[2] / ball.q];
    let length = norm([x, y_part, z]);
    let [to_x, to_y, to_z] = [x / length, y_part / length, z / length];
    let across_y = y - ball.y;
    let (rise, way) = (slope_y * across_y - down, across_y * to_y + (slope_y * across_y - down) * to_z);
    for (index, cell) in cells.iter_mut().enumerate() {
        let across_x = x0 + f64::from(index as i32) * step - ball.x;
        let along = across_x * (to_x + slope_x * to_z) + way;
        let height = slope_x * across_x + rise;
        let square = across_x * across_x + across_y * across_y + height * height - along * along;
        *cell = cell.saturating_add(u8::from((square < reach * reach) & (along < 0.0)));
    }
}
