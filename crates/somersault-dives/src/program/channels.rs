//! The channels within their windows and bounds.

use crate::bounds::bezier_points;
use crate::{Channels, Dive, DiveError, Range};
use somersault_core::argument::expect_length;
use somersault_multibody::Model;
use somersault_multibody::joint_motion::SplineMotion;
use somersault_nlp::Bounds;

/// Σ factors z, without the constant that its bounds have taken in.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LinearRow {
    pub(super) factors: Vec<(usize, f64)>,
}

/// What is below this in a row does not depend on the parameters.
const NO_DEPENDENCE: f64 = 1e-12;

/// The motion with the parameters on which no channel depends outside of its window.
pub(super) fn within_windows(dive: &Dive, motion: SplineMotion) -> Result<SplineMotion, DiveError> {
    if !dive.windows.is_empty() {
        expect_length("windows", dive.windows.len(), motion.n_channels())?;
    }
    let (n, degree) = (motion.basis().n_coefficients(), motion.basis().degree());
    let n_intervals = motion.basis().n_intervals() as f64;
    let mut is_free = vec![true; motion.n_parameters()];
    for (coefficient, parameter, _) in motion.dependences() {
        let Some(window) = dive.windows.get(coefficient / n) else { continue };
        let j = (coefficient % n) as f64;
        let from = ((j - degree as f64) / n_intervals).max(0.0);
        let to = ((j + 1.0) / n_intervals).min(1.0);
        is_free[parameter] &= from >= window.lower - NO_DEPENDENCE && to <= window.upper + NO_DEPENDENCE;
    }
    let motion = motion.retain_parameters(|parameter| is_free[parameter]);
    let mut moves = vec![false; motion.n_channels()];
    motion.dependences().for_each(|(coefficient, ..)| moves[coefficient / n] = true);
    if let Some(channel) = moves.iter().position(|moves| !moves)
        && let Some(&Range { lower, upper }) = dive.windows.get(channel)
    {
        return Err(DiveError::EmptyWindow { channel, lower, upper });
    }
    if motion.n_parameters() == 0 { Err(DiveError::NothingFree) } else { Ok(motion) }
}

/// The bounds of the channels at all times, by their Bézier points.
pub(super) fn channel_rows(
    dive: &Dive,
    model: &Model,
    motion: &SplineMotion,
    bounds: &mut Bounds,
) -> Vec<LinearRow> {
    let (n, n_channels) = (motion.basis().n_coefficients(), motion.n_channels());
    let mut dependences = vec![Vec::new(); motion.n_coefficients()];
    for (coefficient, parameter, factor) in motion.dependences() {
        dependences[coefficient].push((parameter, factor));
    }
    let mut rows = Vec::new();
    let mut dense = vec![0.0; motion.n_parameters()];
    let mut add = |coefficients: &mut dyn Iterator<Item = (usize, f64)>, lower: f64, upper: f64| {
        dense.fill(0.0);
        let mut constant = 0.0;
        for (coefficient, factor) in coefficients {
            constant += factor * motion.offset()[coefficient];
            for (parameter, fraction) in &dependences[coefficient] {
                dense[*parameter] += factor * fraction;
            }
        }
        let of_weight = |(_, factor): &(usize, f64)| factor.abs() > NO_DEPENDENCE;
        let factors: Vec<_> = dense.iter().copied().enumerate().filter(of_weight).collect();
        // what the conditions at the ends fix is within its bounds by them
        if !factors.is_empty() {
            rows.push(LinearRow { factors });
            bounds.push(lower - constant, upper - constant);
        }
    };
    let n_root = model.velocities_of(0).len();
    for point in bezier_points(motion.basis(), dive.n_pieces) {
        let of = |channel: usize| {
            let first = channel * n + point.first;
            point.factors.iter().enumerate().map(move |(j, factor)| (first + j, *factor))
        };
        match dive.channels {
            Channels::Weights if n_channels == 1 => add(&mut of(0), 0.0, 1.0),
            Channels::Weights => {
                (0..n_channels).for_each(|channel| add(&mut of(channel), 0.0, f64::INFINITY));
                add(&mut (0..n_channels).flat_map(of), f64::NEG_INFINITY, 1.0);
            }
            Channels::Joints => {
                for body in 1..model.n_bodies() {
                    let Some([lower, upper]) = model.limits(body) else { continue };
                    model.velocities_of(body).for_each(|dof| add(&mut of(dof - n_root), lower, upper));
                }
            }
        }
    }
    rows
}
