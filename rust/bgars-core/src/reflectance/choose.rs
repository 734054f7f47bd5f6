//! How complicated a material is: decided by how much better it explains the balls.

use super::fit::{Free, MaterialFit, fit_from};
use super::material::{Lobe, Masking, Material};
use super::samples::Samples;
use super::scale::unbend;

/// A second lobe, or the loss at grazing angles, must lower the cost by this share.
const EVIDENCE: f64 = 0.15;

/// Pixels on which the starts compete.
const RACE_PIXELS: usize = 500;

/// Steps of the race and of the final fit.
const RACE_STEPS: usize = 25;
const FINAL_STEPS: usize = 60;

/// The best material of balls of known shape, no more complicated than the observations demand.
pub fn best_material(samples: &Samples) -> MaterialFit {
    let some = samples.thinned((samples.len() / RACE_PIXELS).max(1));
    let simple = Free { grazing: false, tails_and_gains: true };
    let grazing = Free { grazing: true, ..simple };
    let one = fit_from(samples, &winner(&some, &starts(samples), simple).material, simple, FINAL_STEPS);
    let of_one = fit_from(&some, &one.material, simple, 0).cost;
    let mut best = one.clone();
    for (starts, free) in [(with_second_lobe(&one.material), simple), (vec![one.material.clone()], grazing)] {
        let start = winner(&some, &starts, free);
        // What is far from enough on some of the pixels is not enough on all.
        if start.cost > (1.0 - EVIDENCE / 2.0) * of_one {
            continue;
        }
        let fit = fit_from(samples, &start.material, free, FINAL_STEPS);
        if fit.cost < (1.0 - EVIDENCE) * best.cost {
            best = fit;
            let more = fit_from(samples, &best.material, grazing, FINAL_STEPS);
            if more.cost < (1.0 - EVIDENCE) * best.cost {
                best = more;
            }
        }
    }
    best
}

/// The best fit from some starts.
fn winner(samples: &Samples, starts: &[Material], free: Free) -> MaterialFit {
    let mut best = fit_from(samples, &starts[0], free, RACE_STEPS);
    for start in &starts[1..] {
        let fit = fit_from(samples, start, free, RACE_STEPS);
        if fit.cost < best.cost {
            best = fit;
        }
    }
    best
}

/// One lobe: roughness x share of diffuse light x geometric attenuation.
fn starts(samples: &Samples) -> Vec<Material> {
    let mut levels: Vec<f64> = samples.values.iter().map(|&bent| unbend(bent)).collect();
    levels.sort_by(f64::total_cmp);
    let at = |share: f64| levels.get((share * levels.len() as f64) as usize).copied().unwrap_or(1.0).max(1.0);
    let (middle, top) = (at(0.5), at(0.99));
    let mut starts = Vec::new();
    for masking in [Masking::CookTorrance, Masking::Smith] {
        for roughness in [0.1, 0.2, 0.35] {
            for share in [1.0, 0.2] {
                starts.push(Material {
                    diffuse: 2.0 * share * middle,
                    grazing: 0.0,
                    ambient: 0.0,
                    lobes: vec![Lobe { strength: top, roughness, tail: 0.3 }],
                    masking,
                    gains: vec![1.0; samples.lights],
                });
            }
        }
    }
    starts
}

/// A material with a second, wider or narrower lobe beside its own.
fn with_second_lobe(material: &Material) -> Vec<Material> {
    let Some(&lobe) = material.lobes.first() else { return vec![material.clone()] };
    let both = |narrow: f64, wide: f64, share: f64| {
        let lobes = vec![
            Lobe { roughness: (narrow * lobe.roughness).max(0.03), strength: (1.0 - share) * lobe.strength, tail: 0.5 },
            Lobe { roughness: (wide * lobe.roughness).min(0.7), strength: share * lobe.strength, tail: 0.5 },
        ];
        Material { lobes, ..material.clone() }
    };
    vec![both(0.8, 1.6, 0.3), both(0.6, 1.2, 0.5), both(1.0, 2.5, 0.2)]
}
