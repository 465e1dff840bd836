//! Whether what was polished is an extremal, and whether that is a minimum.
//!
//! On a grid along the arcs are checked: bounds of controls and of the state, signs of H_u where controls are at bounds, Legendre and
//! Clebsch's condition where they are not, Kelley's where they are singular, signs of the multipliers of bounds of the state,
//! (−d/dt)^q η ≥ 0 and π ≥ 0, and of what holds at the ends, and H, constant but for H_t.

use super::ends::EndValues;
use super::hamiltonian::Observables;
use super::kind::ControlKind;
use super::samples::{SLACK, Sample, samples};
use super::second_order;
use super::shooting::{Iterate, Shooting};
use super::verdict::Verdict;
use crate::collocation::{Interval, Phase};
use nalgebra::DMatrix;

/// What the Hamiltonian may drift by, relative to the terms it is made of.
const DRIFT: f64 = 1e-8;
/// Residual of an extremal at most.
const RESIDUAL: f64 = 1e-9;

/// The verdict on an iterate that Newton's method left.
pub(super) fn verdict(shooting: &mut Shooting<'_>, at: &Iterate, residual: f64, phase: &Phase) -> Verdict {
    let refused = |reason: String| Verdict::Refused { reason };
    if residual.is_nan() || residual > RESIDUAL {
        return refused(format!("its equations are left with a residual of {residual:.1e}"));
    }
    let Some(samples) = samples(shooting, at) else {
        return refused("an arc cannot be followed".to_owned());
    };
    let arguments = shooting.end_arguments(at);
    let Some(ends) = shooting.terms.evaluate(&arguments, &at.multipliers) else {
        return refused("the end cost has no value".to_owned());
    };
    if let Err(reason) = first_order(shooting, at, &samples, phase, &ends) {
        return refused(reason);
    }
    second_order::verdict(shooting, at, &samples, &ends)
}

/// Conditions of first order; a sentence where one does not hold.
fn first_order(
    shooting: &Shooting<'_>,
    at: &Iterate,
    samples: &[Vec<Sample>],
    phase: &Phase,
    ends: &EndValues,
) -> Result<(), String> {
    if let Some(k) = at.durations.iter().position(|&duration| duration <= 0.0) {
        return Err(format!("arc {k} has a duration of {:.1e}", at.durations[k]));
    }
    controls(shooting, at, samples)?;
    state_bounds(shooting, at, samples)?;
    drift(shooting, samples)?;
    end_signs(shooting, at, samples, phase, ends)
}

fn sentence_time(at: &Iterate, sample: &Sample) -> String {
    format!("at t = {:.6}", at.start + sample.time)
}

fn controls(shooting: &Shooting<'_>, at: &Iterate, samples: &[Vec<Sample>]) -> Result<(), String> {
    let hamiltonian = shooting.hamiltonian;
    let places = hamiltonian.observables();
    for i in 0..hamiltonian.m {
        let Interval { lower, upper } = hamiltonian.control_bounds[i];
        let of =
            |place: usize| samples.iter().flatten().map(move |s| s.observed[place].abs()).fold(0.0, f64::max);
        let (slope, size) = (of(places.slope(i)), of(places.control(i)).max(1e-300));
        for ((kind, ..), arc) in shooting.plan.arcs.iter().zip(samples) {
            for sample in arc {
                let (u, sigma) = (sample.observed[places.control(i)], sample.observed[places.slope(i)]);
                let time = sentence_time(at, sample);
                if u < lower - SLACK * size || u > upper + SLACK * size {
                    return Err(format!("control {i} is {u:.6} {time}, outside of its bounds"));
                }
                let wrong = match kind.controls[i] {
                    ControlKind::Lower => sigma < -SLACK * slope,
                    ControlKind::Upper => sigma > SLACK * slope,
                    ControlKind::Interior | ControlKind::Singular => false,
                };
                if wrong && lower < upper {
                    return Err(format!(
                        "the switching function of control {i} has the wrong sign {time}: another control is better there"
                    ));
                }
                if kind.controls[i] == ControlKind::Singular {
                    let most = of(places.kelley(i));
                    if sample.observed[places.kelley(i)] > SLACK * most {
                        return Err(format!(
                            "Kelley's condition fails for control {i} {time}: the singular arc is no minimum"
                        ));
                    }
                }
            }
        }
    }
    for ((kind, ..), arc) in
        shooting.plan.arcs.iter().zip(samples).filter(|((kind, ..), _)| kind.contact.is_none())
    {
        let free: Vec<usize> =
            (0..hamiltonian.m).filter(|&i| kind.controls[i] == ControlKind::Interior).collect();
        for sample in arc.iter().filter(|_| !free.is_empty()) {
            let curvature = DMatrix::from_fn(free.len(), free.len(), |a, b| {
                sample.observed[places.curvature(free[a], free[b])]
            });
            let size = curvature.amax();
            let least = curvature.symmetric_eigenvalues().min();
            // at an end, H may cease to depend on the control
            if least < -SLACK * size {
                return Err(format!(
                    "Legendre and Clebsch's condition fails {}: H is no minimum over the controls",
                    sentence_time(at, sample)
                ));
            }
        }
    }
    Ok(())
}

fn state_bounds(shooting: &Shooting<'_>, at: &Iterate, samples: &[Vec<Sample>]) -> Result<(), String> {
    let hamiltonian = shooting.hamiltonian;
    let places = hamiltonian.observables();
    for (b, bound) in hamiltonian.bounds.iter().enumerate() {
        let place = places.bound(b, 0);
        let size = samples.iter().flatten().map(|s| s.observed[place].abs()).fold(0.0, f64::max);
        for sample in samples.iter().flatten() {
            if sample.observed[place] > SLACK * size {
                return Err(format!(
                    "{} exceeds its bound by {:.1e} {}: it holds there, and no arc of it was found",
                    bound.name,
                    sample.observed[place],
                    sentence_time(at, sample)
                ));
            }
        }
    }
    for ((kind, ..), arc) in shooting.plan.arcs.iter().zip(samples) {
        let Some(b) = kind.contact else { continue };
        let bound = &hamiltonian.bounds[b];
        let eta: Vec<f64> = arc.iter().map(|sample| sample.observed[places.multiplier()]).collect();
        let size = eta.iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        let differences = |x: &[f64]| x.windows(2).map(|w| w[1] - w[0]).collect::<Vec<_>>();
        let first = differences(&eta);
        // (−d/dt)^q η
        let pushes: Vec<f64> =
            if bound.order() == 1 { first.iter().map(|x| -x).collect() } else { differences(&first) };
        if let Some(k) = pushes.iter().position(|&push| push < -SLACK * size) {
            return Err(format!(
                "the multiplier of the bound of {} has the wrong sign {}: the cost falls where the bound is left",
                bound.name,
                sentence_time(at, &arc[k])
            ));
        }
    }
    let costate = shooting.sizes[hamiltonian.n..].iter().fold(0.0, |a: f64, b| a.max(*b));
    for (k, jumps) in at.jumps.iter().enumerate() {
        if let Some(jump) = jumps.iter().find(|jump| **jump < -SLACK * costate) {
            return Err(format!(
                "costates jump the wrong way after arc {k}, by {jump:.3e}: the bound of the state pulls"
            ));
        }
    }
    Ok(())
}

fn drift(shooting: &Shooting<'_>, samples: &[Vec<Sample>]) -> Result<(), String> {
    let hamiltonian = shooting.hamiltonian;
    let (n, time) = (hamiltonian.n, hamiltonian.time);
    let (mut least, mut most, mut size) = (f64::INFINITY, f64::NEG_INFINITY, 0.0f64);
    for sample in samples.iter().flatten() {
        // λ_t makes up for what the time changes
        let total = sample.observed[Observables::HAMILTONIAN] + time.map_or(0.0, |t| sample.point[n + t]);
        let terms = (0..n).map(|i| (sample.point[n + i] * sample.rates[i]).abs());
        size = terms.chain([sample.rates[2 * n].abs()]).fold(size, f64::max);
        (least, most) = (least.min(total), most.max(total));
    }
    if most - least <= DRIFT * size {
        Ok(())
    } else {
        Err(format!("the Hamiltonian changes by {:.1e} more than the time makes it change", most - least))
    }
}

/// Multipliers of what a bound, not an equation, holds at the ends.
fn end_signs(
    shooting: &Shooting<'_>,
    at: &Iterate,
    samples: &[Vec<Sample>],
    phase: &Phase,
    ends: &EndValues,
) -> Result<(), String> {
    let hamiltonian = shooting.hamiltonian;
    let (n, n_original, n_parameters) =
        (hamiltonian.n, hamiltonian.n_original, shooting.ends.parameters.len());
    let costate = shooting.sizes[n..].iter().fold(0.0, |a: f64, b| a.max(*b));
    let gradient = &ends.gradient;
    let sign = |interval: &Interval, held: Option<f64>, slope: f64, size: f64, what: String| {
        let Some(value) = held.filter(|_| !interval.is_fixed()) else { return Ok(()) };
        let wrong = if value == interval.lower { slope < -SLACK * size } else { slope > SLACK * size };
        if wrong {
            Err(format!("{what} is held by a bound, and the cost falls where it leaves it"))
        } else {
            Ok(())
        }
    };
    let bounds = &phase.bounds;
    for i in 0..n_original {
        let start = at.first()[n + i] + gradient[i];
        sign(
            &bounds.initial_state[i],
            shooting.ends.initial[i],
            start,
            costate,
            format!("state {i} at the start"),
        )?;
        let end = gradient[n_original + i] - at.last()[n + i];
        sign(&bounds.final_state[i], shooting.ends.last[i], end, costate, format!("state {i} at the end"))?;
    }
    for k in 0..n_parameters {
        let slope = at.first()[n + n_original + k] + gradient[2 * n_original + k];
        sign(&bounds.parameters[k], shooting.ends.parameters[k], slope, costate, format!("parameter {k}"))?;
    }
    let value = |sample: Option<&Sample>| sample.map_or(0.0, |s| s.observed[Observables::HAMILTONIAN]);
    let (first, last) =
        (samples.first().and_then(|arc| arc.first()), samples.last().and_then(|arc| arc.last()));
    let place = 2 * n_original + n_parameters;
    let size =
        value(first).abs().max(value(last).abs()).max(gradient[place].abs()).max(gradient[place + 1].abs());
    let start = gradient[place] - value(first);
    sign(&bounds.initial_time, shooting.ends.start, start, size, "the initial time".to_owned())?;
    let end = gradient[place + 1] + value(last);
    sign(&bounds.final_time, shooting.ends.finish, end, size, "the final time".to_owned())?;
    for &(k, held) in &shooting.ends.constraints {
        sign(&bounds.end[k], Some(held), -at.multipliers[k], costate, format!("end constraint {k}"))?;
    }
    Ok(())
}
