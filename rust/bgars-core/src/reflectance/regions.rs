//! The regions of an image that are estimated together: one a ball, and the free pixels.

use rayon::prelude::*;

use super::ball::{Ball, BallWork, Scratch, Search};
use super::ball_normal::BallPixel;
use super::flat_top::flat_top;
use super::observe::Reader;
use super::odd::odd_places;
use super::samples::{FIT_MIN_N_Z, spaced};
use super::spread::{Residual, Spread};
use super::table::Signatures;
use crate::median::median;
use crate::normals::{NormalMapMut, confidence_of};
use crate::{Lights, Result};

/// Pixels that the spread is learnt on, in all and of each region at least.
const SPREAD_PIXELS: usize = 4000;
const SPREAD_PIXELS_OF_REGION: usize = 60;

/// Pixels of a ball that tell how it differs from a sphere.
const SHAPE_PIXELS: usize = 600;

/// Smallest standard deviation of a bent level.
const MIN_SIGMA: f32 = 0.05;

/// Angle between a ball's normals and its circle's that the estimate allows for at least and at most, in degrees.
const PRIOR_LIMITS_DEG: (f32, f32) = (0.4, 5.0);

/// The same where nothing tells.
const FIRST_PRIOR_DEG: f32 = 1.0;

/// Pixels whose data fix the normal as well as this tell how far a ball is from its sphere.
const TELLING_DEG: f32 = 1.0;

/// Fewest pixels that say anything about a ball.
const ENOUGH_PIXELS: usize = 20;

/// Share of a normal distribution within one standard deviation.
const ONE_SIGMA: f32 = 0.683;

/// Limits of the factor between true and stated errors.
const CALIBRATION_LIMITS: (f32, f32) = (0.5, 4.0);

/// A normal is measured where the data alone fix it as well as this.
const MEASURED_DEG: f32 = 2.0;

/// Free pixels are of the material where their mean loss of a light is below this.
const FREE_LOSS: f32 = 2.0;

/// A normal this far from its circle's, in radian (10 degrees), must be shared by so many of its eight neighbours.
const LONE_RAD: f32 = 0.175;
const FRIENDS: usize = 3;

/// Regions between two calls of the progress callback.
const BATCH: usize = 16;

/// Pixels that are estimated together, with one model.
#[derive(Debug)]
pub struct Region {
    pub ball: Ball,
    pub pixels: Vec<usize>,
    /// True for pixels that may be something else, too.
    pub free: bool,
}

/// All regions with their tables.
pub struct Regions<'a> {
    reader: &'a Reader<'a>,
    clip: &'a [f32],
    /// The balls in their order, then the free pixels.
    pub all: Vec<Region>,
    tables: Vec<Signatures>,
    table_of: Vec<usize>,
}

impl<'a> Regions<'a> {
    /// Tabulates the signatures: one table for all balls of one material under distant lights, else one a ball.
    pub fn new(reader: &'a Reader<'a>, lights: &Lights, clip: &'a [f32], regions: Vec<Region>) -> Self {
        let near = matches!(lights, Lights::Near { .. });
        let mut firsts: Vec<usize> = Vec::new();
        let mut base_of = Vec::with_capacity(regions.len());
        for (index, region) in regions.iter().enumerate() {
            let same = |&first: &usize| !near && regions[first].ball.material == region.ball.material;
            let base = firsts.iter().position(same).unwrap_or(firsts.len());
            if base == firsts.len() {
                firsts.push(index);
            }
            base_of.push(base);
        }
        let bases: Vec<Signatures> = firsts.par_iter().map(|&first| regions[first].ball.signatures(lights)).collect();
        if regions.iter().all(|region| region.ball.correction.is_none()) {
            return Self { reader, clip, all: regions, tables: bases, table_of: base_of };
        }
        let tables = regions
            .par_iter()
            .zip(&base_of)
            .map(|(region, &base)| match &region.ball.correction {
                Some(correction) => {
                    bases[base].corrected(lights.len(), |place, levels| correction.add_middle(place, levels))
                }
                None => bases[base].clone(),
            })
            .collect();
        let table_of = (0..regions.len()).collect();
        Self { reader, clip, all: regions, tables, table_of }
    }

    fn work<'s>(&'s self, region: usize, spread: &'s Spread) -> BallWork<'s> {
        let (ball, table) = (&self.all[region].ball, &self.tables[self.table_of[region]]);
        BallWork { reader: self.reader, ball, table, spread, clip: self.clip }
    }

    /// The spread of observations by their level, at normals found with the spread so far.
    pub fn learn_spread(&self, spread: &Spread) -> Spread {
        let count = (SPREAD_PIXELS / self.all.len().max(1)).max(SPREAD_PIXELS_OF_REGION);
        let residuals: Vec<Vec<Residual>> = (0..self.all.len())
            .into_par_iter()
            .map(|index| {
                let work = self.work(index, spread);
                let mut scratch = Scratch::new(self.reader.lights());
                let mut residuals = Vec::new();
                for &pixel in spaced(&self.all[index].pixels, count) {
                    work.residuals(pixel, &mut scratch, &mut residuals);
                }
                residuals
            })
            .collect();
        Spread::from_residuals(&residuals.concat(), MIN_SIGMA)
    }

    /// Learns how far the balls are from their spheres where the data tell, and returns the spread with which stated errors
    /// are true ones.
    pub fn learn_deviations(&mut self, spread: &Spread) -> Spread {
        for region in &mut self.all {
            region.ball.prior_rad = f32::INFINITY;
        }
        let balls = self.all.iter().filter(|region| !region.free).count();
        let found: Vec<Vec<BallPixel>> = (0..balls)
            .into_par_iter()
            .map(|index| {
                let work = self.work(index, spread);
                let mut scratch = Scratch::new(self.reader.lights());
                spaced(&self.all[index].pixels, SHAPE_PIXELS)
                    .map(|&p| work.estimate(p, Search::Deepest, &mut scratch))
                    .collect()
            })
            .collect();
        let telling: Vec<Vec<BallPixel>> =
            found.iter().map(|pixels| pixels.iter().filter(|pixel| tells(pixel)).copied().collect()).collect();
        let factor = calibration(&telling);
        let common = deviation(&telling.concat(), factor);
        let (least, most) = PRIOR_LIMITS_DEG;
        for (((region, found), odd), telling) in self.all.iter_mut().zip(&found).zip(odd_places(&found)).zip(&telling) {
            let ball = &mut region.ball;
            let told = deviation(telling, factor).or(common);
            let (own, error) = told.unwrap_or((FIRST_PRIOR_DEG.to_radians(), 0.0));
            ball.flat = flat_top(found);
            ball.odd = odd.filter(|_| ball.flat.is_none());
            // Where nothing tells, a ball is let go farther than it is expected to be: its roundness is in its circle's doubt.
            ball.deviation_rad = told.map_or(least.to_radians(), |_| own);
            ball.prior_rad = own.max(error).clamp(least.to_radians(), most.to_radians());
        }
        spread.scaled(factor)
    }

    /// Estimates every pixel.
    pub fn estimate(
        &self,
        spread: &Spread,
        out: &mut NormalMapMut<'_>,
        report: &mut dyn FnMut(f64) -> Result<()>,
    ) -> Result<()> {
        let indices: Vec<usize> = (0..self.all.len()).collect();
        for batch in indices.chunks(BATCH) {
            let found: Vec<Vec<BallPixel>> = batch
                .par_iter()
                .map(|&index| {
                    let work = self.work(index, spread);
                    let region = &self.all[index];
                    let pixels = region.pixels.par_iter();
                    let mut found: Vec<BallPixel> = pixels
                        .map_init(
                            || Scratch::new(self.reader.lights()),
                            |scratch, &pixel| work.estimate(pixel, Search::Deepest, scratch),
                        )
                        .collect();
                    if !region.free {
                        let mut scratch = Scratch::new(self.reader.lights());
                        for lone in lone_pixels(&found, self.reader.size().1) {
                            found[lone] = work.estimate(found[lone].pixel, Search::Nearest, &mut scratch);
                        }
                    }
                    found
                })
                .collect();
            for (&index, found) in batch.iter().zip(&found) {
                let region = &self.all[index];
                let albedo = (region.ball.material.diffuse / 255.0) as f32;
                for pixel in found.iter().filter(|pixel| !region.free || pixel.cost < FREE_LOSS) {
                    write(pixel, region.ball.prior_rad, albedo, self.reader.lights(), out);
                }
            }
            report((batch[batch.len() - 1] + 1) as f64 / indices.len() as f64)?;
        }
        Ok(())
    }
}

/// Pixels far from their circle's normal with whom too few neighbours agree: a reflection of another ball, a speck.
fn lone_pixels(found: &[BallPixel], width: usize) -> Vec<usize> {
    let far = |pixel: &BallPixel| pixel.off_circle_rad > LONE_RAD;
    let agree = |a: &BallPixel, b: &BallPixel| {
        let dot: f32 = a.normal.iter().zip(&b.normal).map(|(a, b)| a * b).sum();
        dot > LONE_RAD.cos()
    };
    let at = |pixel: usize| found.binary_search_by_key(&pixel, |found| found.pixel).ok().map(|index| &found[index]);
    (0..found.len())
        .filter(|&index| far(&found[index]))
        .filter(|&index| {
            let pixel = found[index].pixel;
            let rows = [pixel.wrapping_sub(width), pixel, pixel + width];
            let around = rows.into_iter().flat_map(|row| [row.wrapping_sub(1), row, row + 1]).filter(|&at| at != pixel);
            around.filter_map(at).filter(|other| far(other) && agree(&found[index], other)).count() < FRIENDS
        })
        .collect()
}

/// Writes a pixel's normal. A prior is trusted no more than the estimate allows balls to differ from their spheres.
fn write(found: &BallPixel, prior_rad: f32, albedo: f32, lights: usize, out: &mut NormalMapMut<'_>) {
    let pixel = found.pixel;
    let measured = found.data_error_rad.to_degrees() < MEASURED_DEG;
    let error_rad = if measured { found.error_rad } else { found.error_rad.max(prior_rad) };
    out.normals[3 * pixel..3 * pixel + 3].copy_from_slice(&found.normal);
    out.albedo[pixel] = albedo;
    out.mask[pixel] = true;
    out.confidence[pixel] = confidence_of(f64::from(error_rad.to_degrees()));
    out.measured[pixel] = measured;
    out.lights_kept[pixel] = lights as u16;
    if !out.kept_sets.is_empty() {
        out.kept_sets[pixel * lights..(pixel + 1) * lights].fill(true);
    }
}

fn tells(pixel: &BallPixel) -> bool {
    pixel.data_error_rad.to_degrees() < TELLING_DEG && pixel.normal[2] > FIT_MIN_N_Z as f32
}

/// By how much errors are larger than stated: the share of a normal distribution's deviations from the circles within one
/// standard error; 1 where too few pixels tell.
fn calibration(found: &[Vec<BallPixel>]) -> f32 {
    let mut ratios: Vec<f32> = found.iter().flatten().map(|p| p.off_circle_rad / p.data_error_rad).collect();
    if ratios.len() < ENOUGH_PIXELS {
        return 1.0;
    }
    let rank = (ONE_SIGMA * ratios.len() as f32) as usize;
    ratios.select_nth_unstable_by(rank, f32::total_cmp).1.clamp(CALIBRATION_LIMITS.0, CALIBRATION_LIMITS.1)
}

/// Root mean square angle of a ball to its sphere, its error removed, and that error; `None` where too few pixels tell.
fn deviation(found: &[BallPixel], factor: f32) -> Option<(f32, f32)> {
    if found.len() < ENOUGH_PIXELS {
        return None;
    }
    let middle =
        |value: &dyn Fn(&BallPixel) -> f32| median(&mut found.iter().map(value).collect::<Vec<f32>>(), f32::total_cmp);
    let off2 = middle(&|p| p.off_circle_rad.powi(2));
    let error2 = middle(&|p| p.data_error_rad.powi(2)) * factor * factor;
    // The median of the squared length of a normal vector with two components is ln 2 of its mean.
    Some(((off2 / std::f32::consts::LN_2 - error2).max(0.0).sqrt(), error2.sqrt()))
}
