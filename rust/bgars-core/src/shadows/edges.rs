//! Pixels on lines across the predicted edge of every shadow, and what they say.
//!
//! Method and model: `python/bgars/inspection/shadow_edges.py`. One shadow at a time, so that its pixels stay in the cache.

use rayon::prelude::*;

use super::model::{Ball, Board, Lamp, Shadow};
use super::stretch::{COLUMNS, Line, Part, Pixel, Stretch, fit};
use crate::{ImageStack, Radiometry};

const MIN_LIGHTS_LIT: usize = 2;
/// Tangent points lower than this share of the radius are left out: there the ball meets the board.
const LOWEST_TANGENT: f64 = 0.08;

/// How edges are looked for.
#[derive(Clone, Debug)]
pub struct EdgeSettings {
    /// Spread of a sharp edge, pixels.
    pub spread_px: f64,
    /// Growth of the spread along the ray, one for each of `angles_rad`: lamps may be wider than high.
    pub lamp_spread_rad: Vec<f64>,
    /// Distance to look to on both sides, one for each of `angles_rad`.
    pub reach_px: Vec<f64>,
    /// How far profiles reach, in spreads, one for each of `angles_rad`.
    pub limit: Vec<f64>,
    /// By light, then by `angles_rad`, then `nodes`: share of the light across an edge, and its growth per spread.
    pub profiles: Vec<[f64; 2]>,
    /// Places from -`limit` to `limit` at which a profile is known.
    pub nodes: usize,
    /// Distance of pixels on a line.
    pub stride_px: usize,
    /// By area instead of by shape: finds edges up to half of `reach_px` away.
    pub coarse: bool,
    /// Angles of the lines' tangent points, ascending.
    pub angles_rad: Vec<f64>,
    /// Stretches that the lines of a shadow are shared out to.
    pub sectors: usize,
}

/// What hides or shadows the board: a [`super::ShadowMap`], borrowed, and the mask of the capture.
#[derive(Clone, Copy, Debug)]
pub struct Silhouettes<'a> {
    /// Pixels a cell of the map, in each direction.
    pub step: usize,
    /// Columns of the map.
    pub cols: usize,
    /// Cells: whether a ball hides the board.
    pub hidden: &'a [bool],
    /// Lights by cells: how many balls shadow it.
    pub count: &'a [u8],
    /// Pixels to use; `None` for all.
    pub mask: Option<&'a [bool]>,
}

/// Stretches of all shadows: by ball, then light, then sector; and the noise of each shadow, by ball, then light.
#[derive(Clone, Debug)]
pub struct Edges {
    /// `balls * lights * sectors`.
    pub stretches: Vec<Stretch>,
    /// `balls * lights`, grey levels of the capture.
    pub noise: Vec<f64>,
}

/// Measures the edges of the shadows of all balls under all lights, in parallel over the shadows.
///
/// `gains`: relative irradiance of the board, `balls * lights`. Lengths that do not fit each other panic: the binding
/// makes all of them from the same capture.
#[must_use]
#[allow(clippy::too_many_arguments)]
pub fn measure_edges<P: crate::Pixel>(
    stack: &ImageStack<'_, P>,
    radiometry: &Radiometry<'_, P>,
    silhouettes: Silhouettes<'_>,
    balls: &[Ball],
    lamps: &[Lamp],
    board: &Board,
    gains: &[f32],
    settings: &EdgeSettings,
) -> Edges {
    let lights = lamps.len();
    let shadows = balls.len() * lights;
    let mut stretches = vec![Stretch::default(); shadows * settings.sectors];
    let mut noise = vec![0.0; shadows];
    let scene = Scene { stack, radiometry, silhouettes, board, settings };
    stretches.par_chunks_mut(settings.sectors).zip(&mut noise).enumerate().for_each_init(
        Scratch::default,
        |scratch, (index, (out, noise))| {
            let (ball, light) = (index / lights, index % lights);
            *noise = scene.shadow(balls[ball], light, lamps[light], &gains[ball * lights..][..lights], scratch, out);
        },
    );
    Edges { stretches, noise }
}

/// Memory of one shadow, used again for the next.
#[derive(Default)]
struct Scratch {
    pixels: Vec<Pixel>,
    lines: Vec<Line>,
    /// Pixels of each stretch, and whether any of its lines was looked at.
    counts: Vec<(usize, bool)>,
}

/// A pixel, and the cell of the map of shadows that it lies in.
#[derive(Clone, Copy)]
struct Place {
    pixel: usize,
    cell: usize,
}

/// How the board brightens across an edge; places in spreads.
#[derive(Clone, Copy)]
struct Profile<'a> {
    limit: f64,
    nodes: &'a [[f64; 2]],
}

impl Profile<'_> {
    /// Share of the light and its growth: the cubic through values and slopes of two nodes.
    fn at(&self, scaled: f64) -> [f64; 2] {
        let cells = (self.nodes.len() - 1) as f64;
        let place = (scaled / self.limit + 1.0) * 0.5 * cells;
        if !(place > 0.0 && place < cells) {
            let end = if place > 0.0 { self.nodes[self.nodes.len() - 1] } else { self.nodes[0] };
            return [end[0], 0.0];
        }
        let step = 2.0 * self.limit / cells;
        let (node, t) = (place as usize, place.fract());
        let ([low, rise], [high, fall]) = (self.nodes[node], self.nodes[node + 1]);
        let (way, rise, fall) = (high - low, rise * step, fall * step);
        let (square, cube) = (3.0 * way - 2.0 * rise - fall, rise + fall - 2.0 * way);
        [low + t * (rise + t * (square + t * cube)), (rise + t * (2.0 * square + 3.0 * t * cube)) / step]
    }
}

struct Scene<'a, P> {
    stack: &'a ImageStack<'a, P>,
    radiometry: &'a Radiometry<'a, P>,
    silhouettes: Silhouettes<'a>,
    board: &'a Board,
    settings: &'a EdgeSettings,
}

impl<P: crate::Pixel> Scene<'_, P> {
    /// Measures one shadow into `out`; returns its noise.
    fn shadow(
        &self,
        ball: Ball,
        light: usize,
        lamp: Lamp,
        gains: &[f32],
        scratch: &mut Scratch,
        out: &mut [Stretch],
    ) -> f64 {
        let settings = self.settings;
        let Scratch { pixels, lines, counts } = scratch;
        pixels.clear();
        lines.clear();
        counts.clear();
        counts.resize(settings.sectors, (0, false));
        let shadow = Shadow::new(ball, lamp, self.board);
        for (place, &angle_rad) in settings.angles_rad.iter().enumerate() {
            let (sine, cosine) = angle_rad.sin_cos();
            let point = shadow.edge(sine, cosine);
            let ray = shadow.ray(point.x, point.y);
            let (row, col) = self.nearest(point.x, point.y);
            let low = !(point.tangent_height > LOWEST_TANGENT * ball.radius && ray.along > 0.0);
            let Some(at) = self.place(row, col) else { continue };
            if low || self.silhouettes.hidden[at.cell] {
                continue;
            }
            let way_px = ray.along / ray.slope();
            let spread_px = settings.spread_px.hypot(settings.lamp_spread_rad[place] * way_px);
            let reach_px = settings.reach_px[place];
            let profile = self.profile(light, place);
            let nearby = shadow.near_edge(point.x, point.y, &ray);
            let before = pixels.len();
            // Pixels on the row or column that crosses the edge more steeply.
            let along_cols = ray.gradient[0].abs() >= ray.gradient[1].abs();
            let steps = (reach_px / settings.stride_px as f64).ceil() as i64;
            for offset in (-steps..=steps).map(|step| step * settings.stride_px as i64) {
                let (row, col) = if along_cols { (row, col + offset) } else { (row + offset, col) };
                let Some(at) = self.place(row, col) else { continue };
                let across_px = nearby.distance(self.x(col) - point.x, self.y(row) - point.y);
                if across_px.abs() > reach_px {
                    continue;
                }
                if let Some((value, texture)) = self.read(at, light, gains) {
                    let columns = self.columns(across_px, spread_px, reach_px, texture, profile);
                    let scaled = across_px / spread_px;
                    pixels.push(Pixel { columns, value, texture, scaled, across_px, line: lines.len(), weight: 1.0 });
                }
            }
            lines.push(Line { angle_rad, way_px, spread_px });
            let sector = &mut counts[place * settings.sectors / settings.angles_rad.len()];
            *sector = (sector.0 + pixels.len() - before, true);
        }
        let mut rest = &mut pixels[..];
        let mut parts = Vec::with_capacity(settings.sectors);
        for &(count, present) in &*counts {
            let (pixels, after) = rest.split_at_mut(count);
            rest = after;
            parts.push(Part { pixels, present });
        }
        if settings.coarse { fit::<3>(&mut parts, lines, false, out) } else { fit::<4>(&mut parts, lines, true, out) }
    }

    /// The profile of the edge at one of `angles_rad` under a light.
    fn profile(&self, light: usize, place: usize) -> Profile<'_> {
        let EdgeSettings { limit, profiles, nodes, angles_rad, .. } = self.settings;
        Profile { limit: limit[place], nodes: &profiles[(light * angles_rad.len() + place) * nodes..][..*nodes] }
    }

    /// Columns of the model: shadow, light, displacement, spread.
    fn columns(
        &self,
        across_px: f64,
        spread_px: f64,
        reach: f64,
        texture: f64,
        profile: Profile<'_>,
    ) -> [f64; COLUMNS] {
        if self.settings.coarse {
            let lit = if across_px >= 0.0 { texture } else { 0.0 };
            let box_ = if across_px.abs() < 0.5 * reach { texture / reach } else { 0.0 };
            return [texture - lit, lit, box_, 0.0];
        }
        let scaled = across_px / spread_px;
        let [lit, growth] = profile.at(scaled);
        let bell = growth / spread_px * texture;
        [texture * (1.0 - lit), texture * lit, bell, bell * scaled]
    }

    /// Value under the shadow's light, and texture: the mean of the lights that reach the pixel, each over its gain.
    /// `None` where a ball hides it, where two balls shadow it, where it is clipped, or where too few lights reach it.
    #[inline]
    fn read(&self, at: Place, light: usize, gains: &[f32]) -> Option<(f64, f64)> {
        let silhouettes = &self.silhouettes;
        let Place { pixel, cell } = at;
        let cells = silhouettes.hidden.len();
        if silhouettes.hidden[cell]
            || silhouettes.count[light * cells + cell] > 1
            || silhouettes.mask.is_some_and(|mask| !mask[pixel])
        {
            return None;
        }
        let offset = self.radiometry.offset(pixel);
        let value = self.value(light, pixel, offset)?;
        let (mut total, mut gain, mut lit) = (0.0f32, 0.0f32, 0);
        for (other, &own) in gains.iter().enumerate() {
            if silhouettes.count[other * cells + cell] == 0
                && let Some(value) = self.value(other, pixel, offset)
            {
                total += value;
                gain += own;
                lit += 1;
            }
        }
        let texture = f64::from(total / gain.max(1e-9));
        (lit >= MIN_LIGHTS_LIT && texture > 0.0).then_some((f64::from(value), texture))
    }

    /// Linear grey level; `None` where clipped.
    #[inline]
    fn value(&self, light: usize, pixel: usize, offset: f32) -> Option<f32> {
        let code = self.stack.plane(light)[pixel];
        (code.to_f32() < self.radiometry.saturation).then(|| self.radiometry.linearise(code) - offset)
    }

    /// A pixel of the image; `None` outside.
    fn place(&self, row: i64, col: i64) -> Option<Place> {
        let (row, col) = (u32::try_from(row).ok()?, u32::try_from(col).ok()?);
        let (height, width) = (self.stack.height(), self.stack.width());
        let step = self.silhouettes.step as u32;
        ((row as usize) < height && (col as usize) < width).then(|| Place {
            pixel: row as usize * width + col as usize,
            cell: (row / step) as usize * self.silhouettes.cols + (col / step) as usize,
        })
    }

    /// Row and column nearest to a place.
    fn nearest(&self, x: f64, y: f64) -> (i64, i64) {
        let row = (self.stack.height() as f64 / 2.0 - 0.5) - y;
        let col = x + (self.stack.width() as f64 / 2.0 - 0.5);
        (row.round_ties_even() as i64, col.round_ties_even() as i64)
    }

    fn x(&self, col: i64) -> f64 {
        col as f64 + (0.5 - self.stack.width() as f64 / 2.0)
    }

    fn y(&self, row: i64) -> f64 {
        (self.stack.height() as f64 / 2.0 - 0.5) - row as f64
    }
}
