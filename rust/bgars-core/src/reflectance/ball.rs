//! The pixels of one ball: its signatures, and the normal of each pixel from them.

use nalgebra::{Matrix2, Vector3};

use super::anchor::Circle;
use super::ball_normal::BallPixel;
use super::cells::CellTable;
use super::disc::{from_disc, metric, to_disc};
use super::flat_top::FlatTop;
use super::material::Material;
use super::observe::Reader;
use super::refine::{Minimum, Observation, Prior, deepest, nearest};
use super::scale::bend;
use super::spread::{Residual, Spread};
use super::table::{GROUP, Signatures};
use crate::Lights;

/// Angle between a ball's normals and its circle's before anything is known: 1 degree.
const FIRST_RAD: f32 = 0.0175;

/// Components of a direction.
const COMPONENTS: f32 = 2.0;

/// Radian for one unit of the disc, near its centre.
const DISC_RADIAN: f32 = std::f32::consts::SQRT_2;

/// Pixels this near to the edge of a flat top show two normals at once: they are not looked at.
const FLAT_EDGE_PX: f64 = 1.5;

/// Share of the expected angle between normal and circle that a pixel not looked at is allowed.
const UNSEEN_SHARE: f32 = 0.1;

/// Information that keeps a direction without data finite: a standard deviation of a radian.
const MIN_INFORMATION: f64 = 1.0;

/// Leverages above this leave a residual that says nothing.
const MAX_LEVERAGE: f32 = 0.9;

/// Everything known about one ball before its pixels are looked at.
#[derive(Debug)]
pub struct Ball {
    pub circle: Circle,
    pub material: Material,
    /// What the other balls show beyond their materials.
    pub correction: Option<CellTable>,
    /// Where it is no sphere, what to add to the normals of its circle.
    pub odd: Option<CellTable>,
    pub flat: Option<FlatTop>,
    /// Root mean square angle between its normals and its circle's that the estimate allows for, in radian; infinite for
    /// no expectation.
    pub prior_rad: f32,
    /// The same as it was measured, which the stated error rests on.
    pub deviation_rad: f32,
}

impl Ball {
    /// A sphere as far as is known.
    pub fn new(circle: Circle, material: Material, correction: Option<CellTable>) -> Self {
        Self { circle, material, correction, odd: None, flat: None, prior_rad: FIRST_RAD, deviation_rad: FIRST_RAD }
    }

    /// Tabulates what every normal of the ball looks like, without its correction.
    pub fn signatures(&self, lights: &Lights) -> Signatures {
        Signatures::tabulate(lights.len(), |normal: &Vector3<f64>, levels: &mut [f32]| {
            let point = self.circle.point(normal);
            for (light, level) in levels.iter_mut().enumerate() {
                let (direction, irradiance) = lights.at_point(light, &point);
                *level = bend(self.material.radiance(light, normal, &direction, irradiance)) as f32;
            }
        })
    }
}

/// Which minimum of a pixel is wanted.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Search {
    Deepest,
    /// To what is expected: for pixels whose deepest minimum no neighbour shares.
    Nearest,
}

/// What is expected of a pixel, on the disc.
#[derive(Clone, Copy)]
enum Expected {
    /// Its normal is near this, and its light tells more.
    At([f32; 2]),
    /// Its light is a mixture that tells nothing.
    Unseen([f32; 2]),
}

/// One ball's pixels, ready to be estimated.
pub struct BallWork<'a> {
    pub reader: &'a Reader<'a>,
    pub ball: &'a Ball,
    /// From [`Ball::signatures`].
    pub table: &'a Signatures,
    pub spread: &'a Spread,
    pub clip: &'a [f32],
}

impl BallWork<'_> {
    /// The normal of a pixel, and why it may be trusted.
    pub fn estimate(&self, pixel: usize, search: Search, scratch: &mut Scratch) -> BallPixel {
        let best = &self.minimum(pixel, search, scratch);
        let normal = from_disc(best.point.map(f64::from));
        let deviation = self.ball.deviation_rad / DISC_RADIAN;
        let off = scratch.anchor.map_or(0.0, |anchor| angle(&from_disc(anchor.map(f64::from)), &normal));
        let error_rad = direction_error(best, best.prior_information, deviation * deviation / COMPONENTS);
        // The material was fitted on the normals of the circles: where all radii err alike, so do normals that agree with it.
        // What centres err by differs from ball to ball, and the material is theirs in common.
        let circle_rad = scratch.anchor.map_or(0.0, |_| self.ball.circle.error_rad(&normal) as f32);
        BallPixel {
            pixel,
            normal: [normal.x as f32, normal.y as f32, normal.z as f32],
            point: best.point,
            circle_point: scratch.anchor.unwrap_or([f32::NAN; 2]),
            error_rad: error_rad.hypot(circle_rad),
            data_error_rad: direction_error(best, 0.0, 0.0),
            off_circle_rad: off as f32,
            cost: best.data_cost / self.reader.lights() as f32,
        }
    }

    /// The bent level of one light by the normal that the others give.
    pub fn predicted(&self, pixel: usize, light: usize, scratch: &mut Scratch) -> f32 {
        self.look_at(pixel, scratch);
        let (group, lane) = (light / GROUP, light % GROUP);
        scratch.seen.weight[group][lane] = 0.0;
        let best = self.minimum_of_seen(Search::Deepest, scratch);
        self.table.at::<false>(best.point, group).value[lane]
    }

    fn minimum(&self, pixel: usize, search: Search, scratch: &mut Scratch) -> Minimum {
        self.look_at(pixel, scratch);
        self.minimum_of_seen(search, scratch)
    }

    fn look_at(&self, pixel: usize, scratch: &mut Scratch) {
        let (x, y) = self.reader.centre(pixel);
        scratch.anchor = self.ball.circle.normal(x, y).map(|normal| to_disc(&normal).map(|v| v as f32));
        self.observe(pixel, scratch);
    }

    fn minimum_of_seen(&self, search: Search, scratch: &mut Scratch) -> Minimum {
        let lights = self.reader.lights();
        // The disc is 1 / sqrt 2 of a radian at its centre.
        let weight = COMPONENTS.sqrt() * DISC_RADIAN / self.ball.prior_rad;
        let mut best: Option<Minimum> = None;
        for expected in scratch.anchor.map(|point| self.expected(point)).into_iter().flatten().flatten() {
            let found = match expected {
                Expected::Unseen(point) => Minimum::unseen(point, weight / UNSEEN_SHARE),
                Expected::At(point) if search == Search::Nearest => {
                    nearest(self.table, &scratch.seen, Prior { point, weight })
                }
                Expected::At(point) => {
                    deepest(self.table, &scratch.seen, lights, Prior { point, weight }, &mut scratch.distances)
                }
            };
            if best.is_none_or(|best| found.cost < best.cost) {
                best = Some(found);
            }
        }
        best.unwrap_or_else(|| {
            let prior = Prior { point: [0.0; 2], weight: 0.0 };
            deepest(self.table, &scratch.seen, lights, prior, &mut scratch.distances)
        })
    }

    /// Where a normal may be expected: on the sphere of the circle, on a flat top, or where many pixels of an odd ball
    /// agree.
    fn expected(&self, circle_point: [f32; 2]) -> [Option<Expected>; 2] {
        if let Some(flat) = self.ball.flat {
            let normal = from_disc(circle_point.map(f64::from));
            let inside = flat.radius - normal.x.hypot(normal.y) as f32;
            let edge = (FLAT_EDGE_PX / self.ball.circle.radius_px) as f32;
            let point = if inside > 0.0 { flat.point } else { circle_point };
            return [Some(if inside.abs() < edge { Expected::Unseen(point) } else { Expected::At(point) }), None];
        }
        let shift_of = |odd: &CellTable| {
            let mut shift = [0.0; 3];
            odd.add_middle(circle_point.map(f64::from), &mut shift);
            [shift[0], shift[1]]
        };
        let shift = self.ball.odd.as_ref().map(shift_of).filter(|[a, b]| *a != 0.0 || *b != 0.0);
        let moved = |shift: [f32; 2]| Expected::At(std::array::from_fn(|axis| circle_point[axis] + shift[axis]));
        [Some(Expected::At(circle_point)), shift.map(moved)]
    }

    fn observe(&self, pixel: usize, scratch: &mut Scratch) {
        let lights = self.reader.lights();
        let seen = &mut scratch.seen;
        let [bent, weight, clip] =
            [&mut seen.bent, &mut seen.weight, &mut seen.clip].map(|of| &mut of.as_flattened_mut()[..lights]);
        self.reader.read(pixel, bent);
        clip.copy_from_slice(self.clip);
        for light in 0..lights {
            bent[light] = bent[light].min(clip[light]);
            weight[light] = self.spread.at(bent[light]).powi(2);
        }
        // What differs from ball to ball, where it was learnt.
        if let (Some(correction), Some(point)) = (&self.ball.correction, scratch.anchor) {
            correction.add_variance(point.map(f64::from), weight);
        }
        for variance in weight {
            *variance = variance.sqrt().recip();
        }
    }

    /// Residuals at the minimum of a pixel, each divided by what the fit leaves of it: sqrt(1 - leverage).
    pub fn residuals(&self, pixel: usize, scratch: &mut Scratch, residuals: &mut Vec<Residual>) {
        let best = self.minimum(pixel, Search::Deepest, scratch);
        let [haa, hab, hbb] = best.information;
        let (haa, hbb) = (haa + best.prior_information, hbb + best.prior_information);
        let determinant = (haa * hbb - hab * hab).max(1e-12);
        for group in 0..self.table.groups() {
            let signature = self.table.at::<false>(best.point, group);
            for lane in 0..GROUP.min(self.reader.lights() - group * GROUP) {
                let (bent, clip) = (scratch.seen.bent[group][lane], scratch.seen.clip[group][lane]);
                if bent >= clip || signature.value[lane] >= clip {
                    continue;
                }
                let weight = scratch.seen.weight[group][lane];
                let (ja, jb) = (signature.along_a[lane] * weight, signature.along_b[lane] * weight);
                let leverage = (hbb * ja * ja - 2.0 * hab * ja * jb + haa * jb * jb) / determinant;
                if leverage < MAX_LEVERAGE {
                    residuals.push(Residual {
                        level: bent,
                        size: (bent - signature.value[lane]) / (1.0 - leverage.max(0.0)).sqrt(),
                    });
                }
            }
        }
    }
}

/// Memory of one thread, reused from pixel to pixel.
#[derive(Debug)]
pub struct Scratch {
    seen: Observation,
    distances: Vec<f32>,
    anchor: Option<[f32; 2]>,
}

impl Scratch {
    /// For so many lights.
    pub fn new(lights: usize) -> Self {
        let groups = lights.div_ceil(GROUP);
        Self {
            seen: Observation {
                bent: vec![[0.0; GROUP]; groups],
                weight: vec![[0.0; GROUP]; groups],
                clip: vec![[f32::INFINITY; GROUP]; groups],
            },
            distances: Vec::new(),
            anchor: None,
        }
    }
}

/// Root mean square angle in radian between the estimate and the truth.
///
/// With information H of the data and P of the expectation, the estimate moves by `(H + P)^-1 H` of an error of the data
/// and by `(H + P)^-1 P` of the true normal's deviation from the expected one.
fn direction_error(minimum: &Minimum, pull: f32, deviation_variance: f32) -> f32 {
    let [haa, hab, hbb] = minimum.information.map(f64::from);
    let (pull, deviation_variance) = (f64::from(pull), f64::from(deviation_variance));
    let data = Matrix2::new(haa, hab, hab, hbb);
    let floor = Matrix2::identity() * MIN_INFORMATION;
    let Some(inverse) = (data + Matrix2::identity() * pull + floor).try_inverse() else { return f32::INFINITY };
    let covariance = inverse * (data + floor + Matrix2::identity() * (pull * pull * deviation_variance)) * inverse;
    let [g0, g1, g2] = metric(minimum.point.map(f64::from));
    (g0 * covariance[(0, 0)] + 2.0 * g1 * covariance[(0, 1)] + g2 * covariance[(1, 1)]).max(0.0).sqrt() as f32
}

fn angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b))
}
