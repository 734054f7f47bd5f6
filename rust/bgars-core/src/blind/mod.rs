//! Normals of a capture of unknown material without anything of known shape in view.
//!
//! The material is fitted *blind*, together with normals that are free too. That can go wrong where nothing but the data
//! speaks (a ring of lights trades slant against the width of the lobe), so it is guarded three times: it starts from the
//! normals of least squares and of the robust filter; it is used only where it predicts lights that it has not seen about as
//! well as these do or better ([`Predictions`]); and a pixel that the robust filter explains to within the noise while the material
//! cannot, keeps the robust filter's normal.

mod facet;
mod judge;
mod lobe;
mod material;
mod neighbours;
mod observation;
mod passes;
mod pixel;

use std::fmt;
use std::ops::ControlFlow;

use rayon::prelude::*;

use crate::normals::{self, Method, NormalMap, NormalMapMut};
use crate::readings::Capture;
use crate::{ImageStack, Lights, Pixel, Radiometry, Result};

pub use judge::{MIN_LIGHTS, Predictions};
pub use lobe::Material;
use material::Specimen;
use observation::{Reader, start};
use passes::Passes;

/// Pixels that the material is fitted to.
const SAMPLE_PIXELS: usize = 2000;

/// The same where methods are only compared.
const COMPARED_PIXELS: usize = 600;

/// Pixels among them on which the methods predict left-out lights.
const JUDGED_PIXELS: usize = 500;

/// Lights beyond which samples hold fewer pixels, so that the work of a fit is bounded.
const MANY_LIGHTS: usize = 32;

/// Up to this many times the cost of the better simpler method a material is used. More than 1: the prediction is made from one
/// light fewer and without neighbours, which costs the method that leans on these more than it costs the others.
const MARGIN: f64 = 1.1;

/// Fractions of the work that are done after the two classical estimates and after the fit of the material.
const AFTER_CLASSICAL: f64 = 0.05;
const AFTER_MATERIAL: f64 = 0.25;

/// Which method a capture was given to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// Least squares on all lights.
    Lambertian,
    /// The robust filter.
    RobustFilter,
    /// The fitted material, pixel by pixel beside the matte one and the robust filter.
    Reflectance,
}

/// What was chosen, and why.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// The method of the capture.
    pub choice: Choice,
    /// Mean cost of a left-out light; `None` with fewer than five lights, where none can be left out.
    pub predictions: Option<Predictions>,
    /// The fitted material; `None` with fewer than five lights.
    pub material: Option<Material>,
    /// Pixels of the fitted material, of the matte one, and of the robust filter; zeros unless [`Choice::Reflectance`].
    pub pixels: [usize; 3],
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (Some(predictions), Some(material)) = (self.predictions, self.material) else {
            return write!(f, "robust filter: fewer than {MIN_LIGHTS} lights, none can be left out to compare methods");
        };
        let name = match self.choice {
            Choice::Lambertian => "least squares",
            Choice::RobustFilter => "robust filter",
            Choice::Reflectance => "reflectance fitted blind",
        };
        let Predictions { lambertian, robust_filter, reflectance } = predictions;
        write!(
            f,
            "{name}: mean cost of a left-out light {lambertian:.3} (least squares), {robust_filter:.3} (robust filter), \
             {reflectance:.3} (reflectance, taken up to {MARGIN} times the better of these); lobe of strength {:.2}, \
             roughness {:.2}, tail {:.2}",
            material.strength, material.roughness, material.tail
        )?;
        if self.choice == Choice::Reflectance {
            let [glossy, matte, filtered] = self.pixels;
            write!(f, "; pixels: {glossy} with the lobe, {matte} without, {filtered} by the robust filter")?;
        }
        Ok(())
    }
}

/// Estimates normals with a material fitted to the capture itself; see the [module](self). After an error the content of `out`
/// means nothing.
///
/// # Inputs
/// Those of [`normals::estimate_into`].
///
/// # Method
/// 1. Least squares and robust filter on every pixel: starts, and what is to be beaten.
/// 2. On 2,000 pixels the material (one lobe, [`Material`]) is fitted together with normals and albedos, from four starts.
/// 3. On 500 of them each light is left out in turn and predicted: the capture goes to the method of least cost, a tenth in favour of the material.
/// 4. Every pixel is fitted under the fitted and under a matte material (the same robust loss, no lobe), from both starts;
///    then twice more with a weak pull to the median normal of its 5 x 5 neighbours, from that normal too. Least cost wins.
/// 5. Where the robust filter matches at least half of the lights within the noise and the fit misses more than a quarter,
///    the pixel gets the robust filter's normal.
///
/// The loss is Cauchy's on 2 % of the pixel's mean value or twice the measured noise; black values count a tenth (cast shadows), clipped ones are
/// one-sided.
///
/// # Errors
/// Those of [`normals::estimate_into`].
///
/// # Examples
/// ```
/// use bgars_core::{ImageStack, Lights, Radiometry, blind, normals::NormalMap};
/// let s = 0.5f64.sqrt();
/// let lights = Lights::directional(&[[s, 0.0, s], [0.0, s, s], [-s, 0.0, s], [0.0, -s, s]])?;
/// let stack = ImageStack::new(&[100u8; 4], 4, 1, 1)?;
/// let radiometry = Radiometry::linear(4, 255.0);
/// let mut map = NormalMap::zeros(1, 0);
/// let proceed = &mut |_| std::ops::ControlFlow::Continue(());
/// let report = blind::estimate_into(&stack, &lights, &radiometry, None, proceed, map.as_mut())?;
/// assert_eq!(report.choice, blind::Choice::RobustFilter); // four lights: none can be left out
/// assert!((map.normals[2] - 1.0).abs() < 1e-6);
/// # Ok::<(), bgars_core::Error>(())
/// ```
///
/// # Cost
/// Some 20 us a pixel on one thread with 8 lights, rayon over pixels; the same bits for any number of threads.
pub fn estimate_into<P: Pixel>(
    stack: &ImageStack<'_, P>,
    lights: &Lights,
    radiometry: &Radiometry<'_, P>,
    mask: Option<&[bool]>,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    mut out: NormalMapMut<'_>,
) -> Result<Report> {
    out.check(stack.pixels(), stack.lights(), true)?;
    let half = AFTER_CLASSICAL / 2.0;
    // The robust filter's result is the output already: what is chosen otherwise overwrites it.
    normals::estimate_into(
        stack,
        lights,
        radiometry,
        mask,
        Method::RobustFilter,
        &mut |done| progress(done * half),
        out.reborrow(),
    )?;
    let without = Report { choice: Choice::RobustFilter, predictions: None, material: None, pixels: [0; 3] };
    if stack.lights() < MIN_LIGHTS {
        return Ok(without);
    }
    let lambertian = normals::estimate(stack, lights, radiometry, mask, Method::Lambertian, false, &mut |done| {
        progress(half + done * half)
    })?;
    let capture = Capture { stack, radiometry };
    let mut reader = Reader::new(&capture, lights);
    let pixels = used(stack, mask);
    let (fitted, predictions) = fit(&mut reader, &pixels, SAMPLE_PIXELS, &lambertian, out.normals);
    if progress(AFTER_MATERIAL).is_break() {
        return Err(crate::Error::Cancelled);
    }
    let choice = choose(&predictions);
    let mut report = Report { choice, predictions: Some(predictions), material: Some(fitted), pixels: [0; 3] };
    match choice {
        Choice::RobustFilter => {}
        Choice::Lambertian => {
            let progress = &mut |done| progress(AFTER_MATERIAL + done * (1.0 - AFTER_MATERIAL));
            normals::estimate_into(stack, lights, radiometry, mask, Method::Lambertian, progress, out)?;
        }
        Choice::Reflectance => {
            let passes = Passes {
                reader: &reader,
                material: fitted,
                pixels: &pixels,
                shape: (stack.height(), stack.width()),
                lambertian: &lambertian.normals,
            };
            let progress = &mut |done| progress(AFTER_MATERIAL + done * (1.0 - AFTER_MATERIAL));
            report.pixels = passes.run(progress, &mut out)?;
        }
    }
    Ok(report)
}

/// Mean cost of a left-out light under each method over the pixels of a mask, and the standard deviation of a value that is reckoned
/// with, in grey levels of 255 at unit light intensity; `None` with fewer than five lights.
///
/// # Errors
/// Those of [`normals::estimate`].
pub fn predict<P: Pixel>(
    stack: &ImageStack<'_, P>,
    lights: &Lights,
    radiometry: &Radiometry<'_, P>,
    mask: Option<&[bool]>,
) -> Result<Option<(Predictions, f64)>> {
    if stack.lights() < MIN_LIGHTS {
        return Ok(None);
    }
    let [lambertian, filtered] = [Method::Lambertian, Method::RobustFilter].map(|method| {
        normals::estimate(stack, lights, radiometry, mask, method, false, &mut |_| ControlFlow::Continue(()))
    });
    let (lambertian, filtered) = (lambertian?, filtered?);
    let capture = Capture { stack, radiometry };
    let mut reader = Reader::new(&capture, lights);
    let (_, predictions) = fit(&mut reader, &used(stack, mask), COMPARED_PIXELS, &lambertian, &filtered.normals);
    Ok(Some((predictions, 255.0 * reader.albedo_scale * reader.noise)))
}

fn used<P: Pixel>(stack: &ImageStack<'_, P>, mask: Option<&[bool]>) -> Vec<usize> {
    (0..stack.pixels()).filter(|&pixel| mask.is_none_or(|mask| mask[pixel])).collect()
}

/// The material of at most `most` of some pixels, from the normals of both classical methods, and how well all three predict;
/// measures the noise.
fn fit(
    reader: &mut Reader<'_>,
    pixels: &[usize],
    most: usize,
    lambertian: &NormalMap,
    filtered: &[f32],
) -> (Material, Predictions) {
    let lights = reader.room().lights.len();
    let places = spread(pixels, bounded(most, lights));
    reader.measure_noise(&places, lambertian);
    let reader = &*reader;
    let one = |&pixel: &usize| {
        let mut observation = reader.room();
        reader.read(pixel, &mut observation);
        let starts = [&lambertian.normals[..], filtered].map(|normals| start(normals, pixel));
        Specimen { observation, starts }
    };
    let sample: Vec<Specimen> = places.par_iter().map(one).collect();
    let fitted = material::fit(&sample);
    let predictions = judge::predictions(&spread(&sample, bounded(JUDGED_PIXELS, lights)), &fitted);
    (fitted, predictions)
}

/// The method of the lowest prediction cost, with a margin in favour of the material.
fn choose(predictions: &Predictions) -> Choice {
    let classical = predictions.lambertian.min(predictions.robust_filter);
    if predictions.reflectance < MARGIN * classical {
        Choice::Reflectance
    } else if predictions.lambertian < predictions.robust_filter {
        Choice::Lambertian
    } else {
        Choice::RobustFilter
    }
}

/// So many pixels of a sample, fewer where there are very many lights: a pixel then tells as much as several of few.
fn bounded(pixels: usize, lights: usize) -> usize {
    (pixels * MANY_LIGHTS / lights.max(MANY_LIGHTS)).max(1)
}

/// At most `count` items, evenly spread.
fn spread<T: Clone>(items: &[T], count: usize) -> Vec<T> {
    let count = count.min(items.len());
    (0..count).map(|index| items[(2 * index + 1) * items.len() / (2 * count)].clone()).collect()
}
