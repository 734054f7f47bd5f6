//! The passes over all pixels under a fitted material.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::facet::{Facet, Pull};
use super::lobe::Material;
use super::neighbours::median_normal;
use super::observation::{Reader, start};
use super::pixel::{Source, best_facet, filter_knows_better, trust};
use crate::normals::NormalMapMut;
use crate::{Error, Result};

/// Passes with a pull to the neighbours, after the one without.
const NEIGHBOUR_PASSES: usize = 2;

/// Pixels between two calls of the progress callback.
const BAND_PIXELS: usize = 1 << 13;

/// Pixels of one task.
const TASK_PIXELS: usize = 64;

/// Most steps of a pixel's fit in the first pass, and in those after it.
const MAX_ITERS: [usize; 2] = [20, 12];

/// Strength and width of the pull to the neighbours' median: worth one light that misses by 1.3 times the scale of the loss,
/// over about 6 degrees.
const PULL: (f64, f64) = (1.0, 0.1);

/// Everything that the passes read.
pub(super) struct Passes<'a> {
    pub reader: &'a Reader<'a>,
    pub material: Material,
    /// The pixels asked for, ascending.
    pub pixels: &'a [usize],
    /// Rows and columns.
    pub shape: (usize, usize),
    /// Normals of least squares.
    pub lambertian: &'a [f32],
}

/// A pixel after a pass.
type Found = (Facet, Source);

impl Passes<'_> {
    /// Runs all passes, from and over the robust filter's result in `out`; the number of pixels of each source.
    pub fn run(
        &self,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
        out: &mut NormalMapMut<'_>,
    ) -> Result<[usize; 3]> {
        let passes = NEIGHBOUR_PASSES + 2;
        let mut part = |pass: usize, done: f64| {
            if progress((pass as f64 + done) / passes as f64).is_break() { Err(Error::Cancelled) } else { Ok(()) }
        };
        let filtered: &[f32] = out.normals;
        let mut found = self.banded(&mut |done| part(0, done), &|_, pixel| {
            let mut observation = self.reader.room();
            self.reader.read(pixel, &mut observation);
            let starts = [(start(self.lambertian, pixel), None), (start(filtered, pixel), None)];
            best_facet(&observation, &self.material, &starts, None, MAX_ITERS[0])
        })?;
        let mut normals = vec![f32::NAN; out.normals.len()];
        for pass in 1..=NEIGHBOUR_PASSES {
            for (&pixel, (facet, _)) in self.pixels.iter().zip(&found) {
                normals[3 * pixel..3 * pixel + 3].copy_from_slice(facet.normal.map(|value| value as f32).as_slice());
            }
            let next = self.banded(&mut |done| part(pass, done), &|index, pixel| {
                let mut observation = self.reader.room();
                self.reader.read(pixel, &mut observation);
                let (Facet { normal: before, .. }, source) = found[index];
                let starts = |toward| [(before, Some(source)), (toward, None)];
                let toward = median_normal(&normals, self.shape, pixel).unwrap_or(before);
                let pull = Pull { toward, strength: PULL.0, width: PULL.1 };
                best_facet(&observation, &self.material, &starts(toward), Some(&pull), MAX_ITERS[1])
            })?;
            found = next;
        }
        self.write(&found, &mut |done| part(NEIGHBOUR_PASSES + 1, done), out)
    }

    /// One value a pixel asked for, in parallel, with progress between bands.
    fn banded<T: Send>(
        &self,
        progress: &mut dyn FnMut(f64) -> Result<()>,
        work: &(dyn Fn(usize, usize) -> T + Sync),
    ) -> Result<Vec<T>> {
        let mut values = Vec::with_capacity(self.pixels.len());
        for (band, pixels) in self.pixels.chunks(BAND_PIXELS).enumerate() {
            let first = band * BAND_PIXELS;
            values.par_extend(
                pixels
                    .par_iter()
                    .enumerate()
                    .with_min_len(TASK_PIXELS)
                    .map(|(index, &pixel)| work(first + index, pixel))
                    .collect::<Vec<T>>(),
            );
            progress(values.len() as f64 / self.pixels.len() as f64)?;
        }
        Ok(values)
    }

    /// Writes normals, albedo and trust, but leaves what the robust filter knows better.
    fn write(
        &self,
        found: &[Found],
        progress: &mut dyn FnMut(f64) -> Result<()>,
        out: &mut NormalMapMut<'_>,
    ) -> Result<[usize; 3]> {
        let lights = self.reader.room().lights.len();
        let (filtered, albedo, valid) = (&*out.normals, &*out.albedo, &*out.mask);
        let written = self.banded(progress, &|index, pixel| {
            let (facet, source) = found[index];
            let mut observation = self.reader.room();
            self.reader.read(pixel, &mut observation);
            let material = source.material(&self.material);
            let scaled = start(filtered, pixel) * (f64::from(albedo[pixel]) / self.reader.albedo_scale);
            if valid[pixel] && filter_knows_better(&observation, &scaled, &facet, material) {
                return None;
            }
            let mut used = vec![false; lights];
            let trust = trust(&observation, material, &facet, &mut used);
            Some((trust, used))
        })?;
        let mut counts = [0; 3];
        for ((&pixel, (facet, source)), written) in self.pixels.iter().zip(found).zip(written) {
            let Some((trust, used)) = written else {
                counts[Source::RobustFilter as usize] += 1;
                continue;
            };
            counts[*source as usize] += 1;
            out.normals[3 * pixel..3 * pixel + 3].copy_from_slice(facet.normal.map(|value| value as f32).as_slice());
            out.albedo[pixel] = (facet.log_albedo.exp() * self.reader.albedo_scale) as f32;
            out.mask[pixel] = true;
            out.confidence[pixel] = trust.confidence;
            out.measured[pixel] = trust.measured;
            out.lights_kept[pixel] = used.iter().filter(|&&used| used).count() as u16;
            if !out.kept_sets.is_empty() {
                out.kept_sets[pixel * lights..(pixel + 1) * lights].copy_from_slice(&used);
            }
        }
        Ok(counts)
    }
}
