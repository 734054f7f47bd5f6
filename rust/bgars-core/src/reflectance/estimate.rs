//! From circles and images to normals: fit the material, learn what it does not explain, estimate every pixel.

use std::ops::ControlFlow;

use super::anchor::{Circle, Shape};
use super::ball::Ball;
use super::ball_pixels::{core_of, inside, paired, samples, with_shape};
use super::choose::best_material;
use super::fit::{Free, MaterialFit, fit_from};
use super::flat_top::FlatTop;
use super::left_out::{LeftOut, left_out};
use super::material::Material;
use super::observe::Reader;
use super::regions::{Region, Regions};
use super::residuals::learnt_corrections;
use super::samples::{FIT_MIN_N_Z, Samples};
use super::scale::bend;
use super::shape::{CommonShape, EVIDENCE, PRIOR, common_shape};
use super::spread::Spread;
use super::variation::ball_materials;
use crate::error::{check_length, check_rule};
use crate::normals::{NormalMapMut, check_finite};
use crate::readings::Capture;
use crate::{Error, ImageStack, Lights, Pixel, Radiometry, Result};

/// Fewest lights: two unknowns of a normal and its brightness, and one value beyond them.
pub const MIN_LIGHTS: usize = 4;

/// Pixels that a material is fitted on, in all and at least of each ball.
const FIT_PIXELS: usize = 3000;
const FIT_PIXELS_OF_BALL: usize = 20;

/// Pixels that the residuals are learnt on: in all, and of each ball at least and at most.
const RESIDUAL_PIXELS: usize = 40_000;
const RESIDUAL_PIXELS_OF_BALL: (usize, usize) = (300, 1200);

/// Smallest n_z of these.
const RESIDUAL_MIN_N_Z: f64 = 0.1;

/// Mean loss of a light above which a material explains nothing.
pub const MAX_LOSS: f64 = 2.0;

/// Pixels that a shape is told by, at least of each ball.
const SHAPE_PIXELS: usize = 1500;

/// Mean loss of a light above which other methods may know better: a grey level of residual.
const DOUBTED_LOSS: f64 = 0.1;

/// Rounds in which the spread is learnt.
const SPREAD_ROUNDS: usize = 2;

/// Standard deviation of a bent level before anything is known.
const FIRST_SIGMA: f32 = 2.0;

/// What there is to work on.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Pixels to use, `None` for all.
    pub mask: Option<&'a [bool]>,
    /// Balls of known silhouette.
    pub circles: &'a [Circle],
    /// Pixels of the same material without a known shape, such as a bridge between two balls; `None` for none.
    pub free: Option<&'a [bool]>,
    /// Pixels, among those to use, whose normals are written; `None` for all. What is learnt does not depend on it.
    pub wanted: Option<&'a [bool]>,
    /// A material that was fitted before; `None`: fit it on the balls.
    pub material: Option<&'a Material>,
}

/// What was learnt on the way.
#[derive(Clone, Debug)]
pub struct Findings {
    /// The material of all balls, with its fit where it was fitted.
    pub material: Material,
    /// Its fit; `None` where the material was given.
    pub fit: Option<MaterialFit>,
    /// The shape that the balls have in common.
    pub shape: CommonShape,
    /// Mean loss of a light over the pixels of known normal, with the material alone.
    pub loss: f64,
    /// Predictions of lights left out, where the loss leaves room for doubt.
    pub left_out: Vec<LeftOut>,
    /// False where that is too bad: then nothing was written.
    pub accepted: bool,
    /// True for balls with a material of their own.
    pub own_material: Vec<bool>,
    /// True where residuals were learnt from the other balls.
    pub residuals_learnt: bool,
    /// Root mean square angle between each ball's normals and those of its circle, in degrees; NaN where refused.
    pub deviation_deg: Vec<f32>,
    /// Flat tops.
    pub flat_tops: Vec<Option<FlatTop>>,
}

/// Estimates the normals of balls, and of free pixels of the same material, into arrays that hold another estimate already:
/// other pixels stay as they are, and so do free pixels that the material does not explain.
///
/// # Inputs
/// `stack`, `lights`, `radiometry` as for [`crate::normals::estimate_into`]; at least [`MIN_LIGHTS`]. Circles in pixels, x
/// right and y up from the image centre.
///
/// # Method
/// 1. The material is fitted to pixels of known normal, `n_xy = (p - c) / R`: [`best_material`]; again where all balls are
///    something flatter than spheres: [`common_shape`]; to each ball its own where that explains clearly more:
///    [`ball_materials`].
/// 2. Residuals of the other balls, as a smooth table over the normals: [`learnt_corrections`].
/// 3. How far observations lie from the model, and normals from the circles: [`Regions`].
/// 4. Each pixel: `sum log(1 + (r / 3 s)^2)` over the lights and a weak pull to the circle's normal, minimised by
///    Levenberg and Marquardt's method on tabulated signatures: [`super::refine::deepest`].
///
/// # Errors
/// Those of the least-squares estimators; too few lights; neither circles nor material; [`Error::Cancelled`].
///
/// # Examples
/// ```
/// use bgars_core::normals::NormalMap;
/// use bgars_core::reflectance::{Lobe, Masking, Material, Request, estimate_into};
/// use bgars_core::{ImageStack, Lights, Radiometry};
/// // A pixel of a material that was fitted before, as bright under four lights around it: it faces the camera.
/// let lights = Lights::directional(&[[0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [-0.6, 0.0, 0.8], [0.0, -0.6, 0.8]])?;
/// let lobes = vec![Lobe { strength: 300.0, roughness: 0.3, tail: 0.0 }];
/// let (diffuse, masking, gains) = (120.0, Masking::Smith, vec![1.0; 4]);
/// let solder = Material { diffuse, grazing: 0.0, ambient: 0.0, lobes, masking, gains };
/// let level = solder.radiance(0, &nalgebra::Vector3::z(), &lights.at(0, 0.0, 0.0).0, 1.0) as f32;
/// let images = [level; 4];
/// let stack = ImageStack::new(&images, 4, 1, 1)?;
/// let mut map = NormalMap::zeros(1, 0);
/// let request = Request { mask: None, circles: &[], free: Some(&[true]), wanted: None, material: Some(&solder) };
/// let proceed = &mut |_| std::ops::ControlFlow::Continue(());
/// let found = estimate_into(&stack, &lights, &Radiometry::linear(4, 255.0), request, proceed, map.as_mut())?;
/// assert!(found.accepted && map.normals[2] > 0.999);
/// # Ok::<(), bgars_core::Error>(())
/// ```
///
/// # Cost
/// Half a second of one thread for the material, then about a microsecond a pixel and light octet (`cargo bench --bench
/// reflectance`), rayon over balls and pixels; the same bits for any number of threads.
pub fn estimate_into<P: Pixel>(
    stack: &ImageStack<'_, P>,
    lights: &Lights,
    radiometry: &Radiometry<'_, P>,
    request: Request<'_>,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    out: NormalMapMut<'_>,
) -> Result<Findings> {
    let capture = Capture { stack, radiometry };
    check(&capture, lights, &request)?;
    out.check(stack.pixels(), stack.lights(), true)?;
    estimate_readings(&Reader::new(&capture), lights, request, progress, out)
}

/// The same for all types of pixels.
fn estimate_readings(
    reader: &Reader<'_>,
    lights: &Lights,
    request: Request<'_>,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    mut out: NormalMapMut<'_>,
) -> Result<Findings> {
    let mut report = |done: f64| if progress(done).is_break() { Err(Error::Cancelled) } else { Ok(()) };
    let clip = reader.clip_levels();
    let inside: Vec<Vec<usize>> = request
        .circles
        .iter()
        .map(|circle| inside(circle, reader.size(), |pixel| request.mask.is_none_or(|mask| mask[pixel])))
        .collect();
    let core = core_of(request.circles, &inside, reader.size());
    let balls = request.circles.len();
    let sampled = |circles: &[Circle], pixels: &[Vec<usize>], count: usize, min_n_z: f64| {
        samples(reader, lights, circles, pixels, &clip, count, min_n_z)
    };
    let Fitted { some, fit, shape, circles } = fitted(&request, &inside, &core, &sampled);
    let material = request.material.or(fit.as_ref().map(|fit| &fit.material)).cloned().ok_or(Error::NoMaterial)?;
    let loss = fit_from(&some, &material, Free::NOTHING, 0).cost;
    let refused = Findings {
        material,
        fit,
        shape,
        loss,
        left_out: Vec::new(),
        accepted: false,
        own_material: vec![false; balls],
        residuals_learnt: false,
        deviation_deg: vec![f32::NAN; balls],
        flat_tops: vec![None; balls],
    };
    if loss > MAX_LOSS {
        return Ok(refused);
    }
    let (material, is_fitted) = (&refused.material, refused.fit.is_some());
    report(0.2)?;
    let (least, most) = RESIDUAL_PIXELS_OF_BALL;
    let many = sampled(&circles, &inside, (RESIDUAL_PIXELS / balls.max(1)).clamp(least, most), RESIDUAL_MIN_N_Z);
    let materials = if is_fitted { ball_materials(&many, material, balls) } else { vec![material.clone(); balls] };
    let corrections = learnt_corrections(&many, &materials);
    let residuals_learnt = corrections.is_some();
    report(0.3)?;

    let own_material: Vec<bool> = materials.iter().map(|own| own != material).collect();
    let mut corrections = corrections.into_iter().flatten();
    let mut known: Vec<Region> = Vec::with_capacity(balls + 1);
    let clip: Vec<f32> = clip.iter().map(|&level| bend(level) as f32).collect();
    let left_out =
        if loss > DOUBTED_LOSS { left_out(reader, lights, &clip, material, &circles, &core) } else { Vec::new() };
    for ((&circle, own), pixels) in circles.iter().zip(materials).zip(inside) {
        known.push(Region { ball: Ball::new(circle, own, corrections.next()), pixels, free: false });
    }
    let free = free_pixels(&request, &known);
    if !free.is_empty() {
        known.push(Region { ball: Ball::new(Circle::NOWHERE, material.clone(), None), pixels: free, free: true });
    }
    let mut regions = Regions::new(reader, lights, &clip, known);
    let mut spread = Spread::constant(FIRST_SIGMA);
    for _ in 0..SPREAD_ROUNDS {
        spread = regions.learn_spread(&spread);
    }
    report(0.4)?;
    spread = regions.learn_deviations(&spread);
    report(0.5)?;
    if let Some(wanted) = request.wanted {
        regions.all.iter_mut().for_each(|region| region.pixels.retain(|&pixel| wanted[pixel]));
    }
    regions.estimate(&spread, &mut out, &mut |done| report(0.5 + 0.5 * done))?;
    let known = &regions.all[..balls];
    Ok(Findings {
        left_out,
        accepted: true,
        own_material,
        residuals_learnt,
        deviation_deg: known.iter().map(|region| region.ball.deviation_rad.to_degrees()).collect(),
        flat_tops: known.iter().map(|region| region.ball.flat).collect(),
        ..refused
    })
}

/// Material and shape of the balls, and the pixels that tell the material.
struct Fitted {
    some: Samples,
    /// `None` where the material is given, or no ball is.
    fit: Option<MaterialFit>,
    shape: CommonShape,
    circles: Vec<Circle>,
}

/// Reads samples of circles: of some of these pixels, about so many of each, with at least this n_z.
type Sampler<'a> = dyn Fn(&[Circle], &[Vec<usize>], usize, f64) -> Samples + 'a;

/// Fits the material, as spheres and as the shape under which it explains the balls best.
fn fitted(request: &Request<'_>, inside: &[Vec<usize>], core: &[Vec<usize>], sampled: &Sampler<'_>) -> Fitted {
    let balls = request.circles.len();
    let of_each = (FIT_PIXELS / balls.max(1)).max(FIT_PIXELS_OF_BALL);
    let to_fit = |circles: &[Circle]| sampled(circles, inside, of_each, FIT_MIN_N_Z);
    let of = |shape: Shape, u_ratio: f64| CommonShape { shape, u_ratio };
    let some = to_fit(request.circles);
    if request.material.is_some() || balls == 0 {
        return Fitted { some, fit: None, shape: of(Shape::SPHERE, 0.0), circles: request.circles.to_vec() };
    }
    let of_spheres = best_material(&some);
    let count = (SHAPE_PIXELS / balls).max(FIT_PIXELS_OF_BALL);
    let pairs: Vec<Vec<usize>> = core.iter().map(|pixels| paired(pixels, count / 2)).collect();
    let shaped =
        |shape: Shape| sampled(&with_shape(request.circles, of(shape, 0.0)), &pairs, usize::MAX, f64::NEG_INFINITY);
    let squares = request.circles.iter().map(|circle| (circle.u_radius_px / circle.radius_px).powi(2));
    let u_radius = (squares.sum::<f64>() / balls as f64).sqrt();
    let shape = common_shape(&shaped, &of_spheres.material, u_radius);
    let circles = with_shape(request.circles, shape);
    if shape.shape == Shape::SPHERE {
        return Fitted { some, fit: Some(of_spheres), shape, circles };
    }
    let some_shaped = to_fit(&circles);
    let of_shape = best_material(&some_shaped);
    // To the rim, too.
    if of_shape.cost < (1.0 - EVIDENCE) * of_spheres.cost {
        return Fitted { some: some_shaped, fit: Some(of_shape), shape, circles };
    }
    let shape = of(Shape::SPHERE, PRIOR.hypot(u_radius));
    Fitted { some, fit: Some(of_spheres), shape, circles: with_shape(request.circles, shape) }
}

fn check<P: Pixel>(capture: &Capture<'_, P>, lights: &Lights, request: &Request<'_>) -> Result<()> {
    capture.check(lights, &[("mask", request.mask), ("free", request.free), ("wanted", request.wanted)])?;
    let (count, rule) = (lights.len(), "at least 4 for the reflectance estimator");
    check_rule("lights", rule, count as f64, count >= MIN_LIGHTS)?;
    check_length("material.gains", count, request.material.map_or(count, |material| material.gains.len()))?;
    for &Circle { x_px, y_px, radius_px, .. } in request.circles {
        check_rule("circles", "finite x", x_px, x_px.is_finite())?;
        check_rule("circles", "finite y", y_px, y_px.is_finite())?;
        let holds = (MIN_RADIUS_PX..f64::MAX).contains(&radius_px);
        check_rule("circles", "radius at least 3 pixels", radius_px, holds)?;
    }
    check_finite(capture.stack, request.mask)
}

/// Smallest radius of a ball in pixels: below, no pixel is free of the rim.
const MIN_RADIUS_PX: f64 = 3.0;

/// Free pixels that are usable and in no circle.
fn free_pixels(request: &Request<'_>, known: &[Region]) -> Vec<usize> {
    let Some(free) = request.free else { return Vec::new() };
    let mut wanted = free.to_vec();
    for region in known {
        for &pixel in &region.pixels {
            wanted[pixel] = false;
        }
    }
    (0..wanted.len()).filter(|&pixel| wanted[pixel] && request.mask.is_none_or(|mask| mask[pixel])).collect()
}
