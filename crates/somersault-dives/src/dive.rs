//! What is asked of a dive.

use crate::error::{DiveError, expect_angle};
use somersault_core::argument::{ArgumentError, expect_finite, expect_not_negative, expect_positive};
use somersault_core::spline::UniformBasis;
use somersault_multibody::Model;
use somersault_multibody::joint_motion::{Condition, EigenpostureBase, End, SplineMotion};
use somersault_multibody::models::{Dimension, Diver};

/// What a number may be: a variable of the dive, or fixed where both are equal.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Range {
    /// Least value.
    pub lower: f64,
    /// Greatest value.
    pub upper: f64,
}

impl Range {
    /// One value.
    pub fn fixed(value: f64) -> Self {
        Self { lower: value, upper: value }
    }

    /// From `lower` to `upper`.
    pub fn new(lower: f64, upper: f64) -> Self {
        Self { lower, upper }
    }

    /// Whether there is but one value.
    pub fn is_fixed(&self) -> bool {
        self.lower == self.upper
    }
}

/// What the channels of the joint motion are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Channels {
    /// Weights of eigenpostures, not negative and with a sum of at most one.
    Weights,
    /// Joints, within their ranges: the dive without eigenpostures.
    Joints,
}

/// What a dive costs.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Penalties {
    /// a, of the squared angular momentum over L₀ = m h²/(1 s).
    pub momentum: f64,
    /// b, of squared rates of the weights, s. For joints, of their rates over ‖φ_1 − φ_0‖.
    pub rate: f64,
    /// c, of squared second rates, s³.
    pub acceleration: f64,
}

/// Steps of a dive: some hundred megabytes.
pub(crate) const MOST_STEPS: usize = 100_000;

/// How far apart capsules must be, at all times.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Clearance {
    /// Minimum distance of surfaces, m.
    pub distance: f64,
    /// At how many times between start and finish it is a constraint to begin with, at most 10 000; searches add those at
    /// which limbs come nearer in between.
    pub n_times: usize,
}

/// A dive to be found.
///
/// All fields are open; [`Dive::forward_pike`] and [`Dive::forward_twisting`] are those of the thesis.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Dive {
    /// Who dives, in the plane or in space.
    pub diver: Diver,
    /// Joint angles of the postures, rad, the fundamental one first.
    pub postures: Vec<Vec<f64>>,
    /// Number of the posture at take-off.
    pub first: usize,
    /// Number of the posture at the entry.
    pub last: usize,
    /// Weights or joints.
    pub channels: Channels,
    /// For each channel the fractions of the duration between which it may differ from zero; none: at all times.
    pub windows: Vec<Range>,
    /// Fraction of the duration at which twists and tilt must be what they are at the entry. Where the diver moves
    /// symmetrically from then on they stay so. Before the entry it takes twists that are a multiple of ½.
    pub square_out: f64,
    /// Coefficients of each spline, of degree 5: at least 6.
    pub n_par: usize,
    /// Somersaults to the entry, counted from the upright: 3.5 ends on the hands. Backward ones are negative, as is their
    /// momentum.
    pub somersaults: f64,
    /// Twists, to the left positive; none in the plane.
    pub twists: f64,
    /// Forward lean at take-off, rad.
    pub lean: Range,
    /// Lean past the vertical at the entry, rad.
    pub entry_lean: f64,
    /// Duration of the flight, s.
    pub duration: Range,
    /// Angular momentum about the lateral axis, forward, kg m²/s.
    pub momentum: Range,
    /// Height of the feet over the water at take-off, m; not negative.
    pub platform: f64,
    /// How far ahead of the toes' start the hands, or the feet where these are to enter first, enter the water, m.
    pub entry_distance: f64,
    /// Of the cost.
    pub penalties: Penalties,
    /// Of the limbs, in space only.
    pub clearance: Option<Clearance>,
    /// Steps of the orientation, rounded up to a multiple of the intervals of the spline; at most 100 000.
    pub n_steps: usize,
    /// Into how many pieces the intervals of the spline are cut for the bounds on the channels, at most 100.
    pub n_pieces: usize,
}

impl Dive {
    pub(crate) fn check(&self) -> Result<(), DiveError> {
        let n_postures = self.postures.len();
        for (argument, found) in [("first", self.first), ("last", self.last)] {
            if found >= n_postures {
                return Err(DiveError::NoSuchPosture { argument, n_postures, found });
            }
        }
        for (argument, range) in
            [("lean", self.lean), ("duration", self.duration), ("momentum", self.momentum)]
        {
            let Range { lower, upper } = range;
            if !(lower <= upper && lower.is_finite() && upper.is_finite()) {
                return Err(DiveError::Range { argument, lower, upper });
            }
        }
        expect_positive("duration", self.duration.lower)?;
        for range in &self.windows {
            let Range { lower, upper } = *range;
            if !(0.0 <= lower && lower < upper && upper <= 1.0) {
                let found = if (0.0..1.0).contains(&lower) { upper } else { lower };
                let allowed = "fractions with 0 ≤ lower < upper ≤ 1";
                return Err(ArgumentError::OutOfRange { argument: "windows", allowed, found }.into());
            }
        }
        if self.diver.dimension == Dimension::Planar && self.twists != 0.0 {
            let allowed = "0 in the plane";
            return Err(ArgumentError::OutOfRange { argument: "twists", allowed, found: self.twists }.into());
        }
        if self.diver.dimension == Dimension::Planar
            && let Some(Clearance { distance, .. }) = self.clearance
        {
            let allowed = "none in the plane, where limbs pass each other";
            return Err(ArgumentError::OutOfRange { argument: "clearance", allowed, found: distance }.into());
        }
        if self.square_out < 1.0 && self.twists.is_finite() && (2.0 * self.twists).fract() != 0.0 {
            // where the body is symmetric, its plane is that of the somersaults only then
            let allowed = "a multiple of ½ where `square_out` is before the entry";
            return Err(ArgumentError::OutOfRange { argument: "twists", allowed, found: self.twists }.into());
        }
        if !(self.square_out > 0.0 && self.square_out <= 1.0) {
            let (argument, found) = ("square_out", self.square_out);
            return Err(
                ArgumentError::OutOfRange { argument, allowed: "above 0 and at most 1", found }.into()
            );
        }
        for (argument, found) in [
            ("somersaults", self.somersaults),
            ("twists", self.twists),
            ("entry_distance", self.entry_distance),
        ] {
            expect_finite(argument, [&found])?;
        }
        let leans = [("lean", self.lean.lower), ("lean", self.lean.upper), ("entry_lean", self.entry_lean)];
        for (argument, found) in leans {
            expect_angle(argument, found)?;
        }
        expect_not_negative("platform", self.platform)?;
        self.check_sense()?;
        for (argument, found) in [
            ("penalties.momentum", self.penalties.momentum),
            ("penalties.rate", self.penalties.rate),
            ("penalties.acceleration", self.penalties.acceleration),
        ] {
            expect_not_negative(argument, found)?;
        }
        for (argument, found) in [("n_steps", self.n_steps), ("n_pieces", self.n_pieces)] {
            if found == 0 {
                return Err(ArgumentError::OutOfRange { argument, allowed: "at least 1", found: 0.0 }.into());
            }
        }
        let n_times = self.clearance.map_or(0, |clearance| clearance.n_times);
        for (argument, allowed, found, limit) in [
            ("n_steps", "at most 100000", self.n_steps, MOST_STEPS),
            ("n_pieces", "at most 100", self.n_pieces, 100),
            ("clearance.n_times", "at most 10000", n_times, 10_000),
        ] {
            if found > limit {
                return Err(ArgumentError::OutOfRange { argument, allowed, found: found as f64 }.into());
            }
        }
        if let Some(clearance) = self.clearance {
            expect_not_negative("clearance.distance", clearance.distance)?;
        }
        Ok(())
    }

    /// The joints alone turn a diver by less than once: more needs a momentum of that sense.
    fn check_sense(&self) -> Result<(), DiveError> {
        let Range { lower, upper } = self.momentum;
        let turns = |lean: f64| self.somersaults + (self.entry_lean - lean) / std::f64::consts::TAU;
        let (least, most) = (turns(self.lean.upper), turns(self.lean.lower));
        if least >= 1.0 && upper <= 0.0 {
            return Err(DiveError::Opposed { turns: least, lower, upper });
        }
        if most <= -1.0 && lower >= 0.0 {
            return Err(DiveError::Opposed { turns: most, lower, upper });
        }
        Ok(())
    }

    /// Splines of degree 5 for weights or joints, from the first posture to the last, at rest at both ends.
    pub(crate) fn motion(&self, model: &Model) -> Result<SplineMotion, DiveError> {
        let base = EigenpostureBase::try_new(&self.postures)?;
        self.check_joints(model, &base)?;
        let basis = UniformBasis::try_new(5, self.n_par)?;
        let ends = match self.channels {
            Channels::Weights => [self.first, self.last].map(|posture| {
                (1..self.postures.len()).map(|i| f64::from(u8::from(i == posture))).collect::<Vec<_>>()
            }),
            Channels::Joints => [self.first, self.last].map(|posture| self.postures[posture].clone()),
        };
        let base = match self.channels {
            Channels::Weights => base,
            Channels::Joints => EigenpostureBase::joints(base.n_joints()),
        };
        let conditions: Vec<[Condition; 4]> = ends[0]
            .iter()
            .zip(&ends[1])
            .map(|(first, last)| {
                let at = |end, derivative, value| Condition { end, derivative, value };
                [
                    at(End::Start, 0, *first),
                    at(End::Start, 1, 0.0),
                    at(End::Finish, 0, *last),
                    at(End::Finish, 1, 0.0),
                ]
            })
            .collect();
        Ok(SplineMotion::with_conditions(basis, base, &conditions)?)
    }

    /// Postures between the given ones are within the ranges of the joints if these are.
    fn check_joints(&self, model: &Model, base: &EigenpostureBase) -> Result<(), DiveError> {
        let n_root = model.velocities_of(0).len();
        if base.n_joints() != model.n_velocities() - n_root {
            let (expected, found) = (model.n_velocities() - n_root, base.n_joints());
            let argument = "postures";
            return Err(somersault_multibody::DynamicsError::from(ArgumentError::Length {
                argument,
                expected,
                found,
            })
            .into());
        }
        for (body, link) in model.links().iter().enumerate().skip(1) {
            let Some([lower, upper]) = model.limits(body) else { continue };
            for (posture, angles) in self.postures.iter().enumerate() {
                for dof in model.velocities_of(body) {
                    let found = angles[dof - n_root];
                    if !(lower..=upper).contains(&found) {
                        let joint = link.name().to_owned();
                        return Err(DiveError::JointLimit { posture, joint, found, lower, upper });
                    }
                }
            }
        }
        Ok(())
    }
}
