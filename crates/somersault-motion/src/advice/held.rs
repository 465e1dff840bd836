//! The folded posture of a flight, and while it is held.

use crate::analysis::Landmarks;
use crate::identification::{Angles, HIP};
use crate::reconstruction::ReconstructedFlight;
use nalgebra::DVector;
use somersault_multibody::{Data, DynamicsError, Model};

/// While the body is folded.
#[derive(Debug, Clone, PartialEq)]
pub struct FoldedPhase {
    /// When it begins to fold, is folded, begins to open and is open, s.
    pub times: [f64; 4],
    /// How each joint after the root's moves where the posture is tighter: the joint that is farthest from the closed pike, or from the
    /// tuck, by 1.
    pub direction: Vec<f64>,
    /// By how much `direction` is more where the proportion of hips and knees is one standard deviation more than it is found to be.
    pub spread: Vec<f64>,
    /// How far that joint is from it, rad; not positive where the posture is as tight.
    pub reach: f64,
    /// Whether that joint is the knee.
    pub by_knees: bool,
}

/// Fractions of the way from the closed hip to the open one at which a posture counts as held, and the body as open.
const HELD: f64 = 0.25;
const OPEN: f64 = 0.85;
/// Angles of hip and knee in the closed pike and the tuck, rad: postures H and F of the diver.
const PIKE: [f64; 2] = [0.5121, std::f64::consts::PI];
const TUCK: [f64; 2] = [0.4929, std::f64::consts::FRAC_PI_4];
/// Angle of the knee between pike and tuck, rad.
const KNEE: f64 = 2.18;
/// Displacement by which the sense of a joint is found, rad.
const DISPLACEMENT: f64 = 1e-4;

impl FoldedPhase {
    /// That of a flight; none where the hip stays open, or the posture is held for less than two frames.
    pub(super) fn of(
        model: &Model,
        landmarks: &Landmarks,
        flight: &ReconstructedFlight,
    ) -> Result<Option<Self>, DynamicsError> {
        let angles = Angles::of(model, landmarks, flight)?;
        let closest = angles.closest();
        let least = angles.hip[closest];
        if least.is_nan() || least >= HIP {
            return Ok(None);
        }
        let last = angles.hip.len() - 1;
        let level = |fraction: f64, open: f64| least + fraction * (open - least);
        // how open the body is before, and after
        let widest = |range: &[f64]| range.iter().copied().fold(least, f64::max);
        let (before, after) = (widest(&angles.hip[..=closest]), widest(&angles.hip[closest..]));
        let back = |from: usize, level: f64| (0..=from).rev().find(|i| angles.hip[*i] > level);
        let ahead = |from: usize, level: f64| (from..=last).find(|i| angles.hip[*i] > level);
        let held = back(closest, level(HELD, before)).map_or(0, |i| i + 1);
        let left = ahead(closest, level(HELD, after)).map_or(last, |i| i - 1);
        let begins = back(held, level(OPEN, before)).unwrap_or(0);
        let ends = ahead(left, level(OPEN, after)).unwrap_or(last);
        if !(begins < held && held < left && left < ends) {
            return Ok(None);
        }
        let times = [begins, held, left, ends].map(|i| flight.frames[i].time);
        Ok(Some(Self { times, ..tighter(model, landmarks, &angles, &flight.frames[closest].q)? }))
    }
}

/// How joints move where the posture is tighter, by how much the first of them can, and whether that is the knee; without times.
fn tighter(
    model: &Model,
    landmarks: &Landmarks,
    angles: &Angles,
    q: &[f64],
) -> Result<FoldedPhase, DynamicsError> {
    let [hip, knee] = angles.least();
    let is_tuck = knee < KNEE;
    let [closed_hip, closed_knee] = if is_tuck { TUCK } else { PIKE };
    let apart = [hip - closed_hip, if is_tuck { knee - closed_knee } else { 0.0 }];
    let by_knees = apart[1] > apart[0];
    let most = apart[0].max(apart[1]);
    let n_root = model.velocities_of(0).len();
    let mut direction = vec![0.0; model.n_velocities() - n_root];
    let mut spread = direction.clone();
    // the joint that leads moves by 1, whatever the angles are
    let follows = usize::from(!by_knees);
    let of_proportion = if is_tuck && most > 0.0 {
        let [of_hip, of_knee] = angles.deviations;
        let [leading, following] = if by_knees { [of_knee, of_hip] } else { [of_hip, of_knee] };
        following.hypot(leading * apart[follows] / most) / most
    } else {
        0.0
    };
    let mut reach = most;
    let mut data = Data::new(model);
    for (k, bodies) in landmarks.hips_and_knees().into_iter().enumerate() {
        let weight = if most > 0.0 { (apart[k] / most).max(0.0) } else { [1.0, 0.0][k] };
        for body in bodies {
            let dofs = model.velocities_of(*body);
            // of a hinge ±1, of a ball a unit vector
            let mut sense = DVector::zeros(dofs.len());
            for (sense, dof) in sense.iter_mut().zip(dofs.clone()) {
                let mut step = vec![0.0; model.n_velocities()];
                let mut angle = |by: f64| {
                    step[dof] = by;
                    let mut moved = q.to_vec();
                    model.displace(q, &step, &mut moved)?;
                    match k {
                        0 => landmarks.hip_angle(model, &mut data, &moved),
                        _ => landmarks.knee_angle(model, &mut data, &moved),
                    }
                };
                *sense = angle(-DISPLACEMENT)? - angle(DISPLACEMENT)?;
            }
            if sense.try_normalize_mut(0.0).is_none() {
                continue;
            }
            for (sense, dof) in sense.iter().zip(dofs) {
                direction[dof - n_root] = sense * weight;
                spread[dof - n_root] = if k == follows { sense * of_proportion } else { 0.0 };
            }
            // joints have limits of their own
            if let (Some([lower, upper]), true) = (model.limits(*body), weight > 0.0) {
                let now = q[model.positions_of(*body).start];
                let left = if sense[0] > 0.0 { upper - now } else { now - lower };
                reach = reach.min(left / weight);
            }
        }
    }
    Ok(FoldedPhase { times: [f64::NAN; 4], direction, spread, reach, by_knees })
}

#[cfg(test)]
mod tests {
    use super::*;
    use somersault_multibody::models::{Diver, Posture};

    #[test]
    fn the_tightest_postures_are_those_of_the_diver() {
        // the hips of the spatial diver are beside its middle
        for (diver, tolerance) in [(Diver::planar(), 1e-3), (Diver::spatial(), 0.03)] {
            let model = diver.model().unwrap();
            let (landmarks, mut data) = (Landmarks::of(&model).unwrap(), Data::new(&model));
            for (posture, [hip, knee]) in [(Posture::H, PIKE), (Posture::F, TUCK)] {
                let q = diver.configuration(posture).unwrap();
                let found = landmarks.hip_angle(&model, &mut data, &q).unwrap();
                assert!((found - hip).abs() < tolerance, "{posture}: {found}");
                let found = landmarks.knee_angle(&model, &mut data, &q).unwrap();
                assert!((found - knee).abs() < tolerance, "{posture}: {found}");
            }
        }
    }
}
