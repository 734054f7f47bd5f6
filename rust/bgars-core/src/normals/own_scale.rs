//! Floats whose full scale is their own largest value, found while the kernel works: a search of its own reads the images twice.
//!
//! Full scale enters in two places. The albedo is divided by it, which can be done later. The gap of the specular filter is in
//! proportion to it: with that of a sample, which is at most the true one, some steps are cut that the true gap lets pass.
//! Where the smallest step that a block cuts is over the true gap as well, its cutoffs stay; other blocks are worked on again.

use std::ops::ControlFlow;

use super::Method;
use super::checks::check_finite;
use super::cutoff::LANES;
use super::kernel::{Kernel, Scratch, gap};
use super::lanes::Left;
use super::out::Out;
use crate::radiometry::full_scale_from;
use crate::{Error, ImageStack, Pixel, Radiometry, Result};

/// Fraction of the work after which full scale is known.
const DRAFT_SHARE: f64 = 0.95;

/// True where it pays: the images are many floats, all of them are read as they are, and the method can do without at first.
pub(super) fn serves<P: Pixel>(
    stack: &ImageStack<'_, P>,
    radiometry: &Radiometry<'_, P>,
    mask: Option<&[bool]>,
    method: Method,
) -> bool {
    let is_asked_for = P::CODES.is_none() && radiometry.full_scale.is_none() && mask.is_none() && stack.is_large();
    is_asked_for
        && radiometry.is_plain()
        && !radiometry.has_offsets()
        && matches!(method, Method::Lambertian | Method::SpecularFilter { .. })
}

/// The largest finite value of a sample, a full scale that is at most the true one.
pub(super) fn sampled<P: Pixel>(stack: &ImageStack<'_, P>) -> f32 {
    /// Values that are looked at together: a few cache lines.
    const RUN: usize = 64;
    /// One run of so many values.
    const EVERY: usize = 1 << 16;
    let runs = (0..stack.lights()).flat_map(|light| stack.plane(light).chunks(EVERY));
    let values = runs.flat_map(|values| &values[..values.len().min(RUN)]).map(|value| value.to_f32());
    full_scale_from(values.filter(|value| value.is_finite()).fold(0.0, f32::max))
}

/// Estimates every pixel; `draft` has the full scale of a sample.
pub(super) fn estimate<P: Pixel>(
    mut draft: Kernel<'_, P>,
    out: Out<'_>,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<()> {
    draft.is_draft = true;
    let mut report = |done| if progress(done).is_break() { Err(Error::Cancelled) } else { Ok(()) };
    let mut tasks = draft.tasks(out);
    let mut found = Vec::with_capacity(tasks.len());
    let work = |(first, out): &mut (usize, Out<'_>), scratch: &mut Scratch<P>| draft.lanes(*first, out, scratch);
    draft.in_bands(&mut tasks, &work, &mut |left: Vec<Left>, done| {
        if !left.iter().all(|left| left.finite) {
            check_finite(draft.stack, None)?;
        }
        found.extend(left);
        report(DRAFT_SHARE * done)
    })?;
    let full_scale = full_scale_from(found.iter().map(|left| left.largest).fold(0.0, f32::max));
    let kernel = Kernel::new(draft.stack, draft.lights, draft.radiometry, full_scale, None, draft.method);
    let mut tasks: Vec<_> = tasks.into_iter().zip(found).collect();
    let work = |((first, out), left): &mut ((usize, Out<'_>), Left), scratch: &mut Scratch<P>| {
        for albedo in &mut *out.albedo {
            *albedo *= 1.0 / full_scale;
        }
        kernel.rest(*first, left, out, scratch);
        if let Method::SpecularFilter { threshold } = kernel.method {
            redo(&kernel, gap(threshold, full_scale), *first, left, out, scratch);
        }
    };
    kernel.in_bands(&mut tasks, &work, &mut |_, done| report(DRAFT_SHARE + (1.0 - DRAFT_SHARE) * done))
}

/// Works again on the blocks of a task that cut steps within the true gap.
fn redo<P: Pixel>(
    kernel: &Kernel<'_, P>,
    gap: f32,
    first: usize,
    left: &Left,
    out: &mut Out<'_>,
    scratch: &mut Scratch<P>,
) {
    let mut rest = out.reborrow();
    let mut done = first;
    for &(block, _) in left.cuts.iter().filter(|(_, step)| *step <= gap) {
        rest.take(block - done);
        let mut part = rest.take(LANES);
        done = block + LANES;
        let left = kernel.lanes(block, &mut part, scratch);
        kernel.rest(block, &left, &mut part, scratch);
    }
}
