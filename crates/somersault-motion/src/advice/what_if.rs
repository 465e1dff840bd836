//! A reconstructed flight flown again with a change.

use super::AdviceError;
use super::held::FoldedPhase;
use crate::analysis::Landmarks;
use crate::identification::{FlightReport, IdentificationError, line_ahead};
use crate::reconstruction::{ReconstructedFlight, counting_of, travelling};
use nalgebra::{Matrix3, Vector3};
use somersault_multibody::flight::{
    ChangedFlight, FlightChange, HeldPosture, JointCurves, KnownFlight, N_CHANGES, TakeOff,
};
use somersault_multibody::{Data, Model};
use std::f64::consts::{PI, TAU};
use std::ops::{Add, Mul, Sub};

/// What a flight comes to.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Outcome {
    /// Somersaults, forwards positive.
    pub somersaults: f64,
    /// Twists, to the left positive.
    pub twists: f64,
    /// Angle of the line from feet to hands beyond the vertical at the end, in the sense of the somersaults, rad: negative where the
    /// dive is short.
    pub entry_angle: f64,
}

impl Outcome {
    fn with(self, other: Self, of: impl Fn(f64, f64) -> f64) -> Self {
        Self {
            somersaults: of(self.somersaults, other.somersaults),
            twists: of(self.twists, other.twists),
            entry_angle: of(self.entry_angle, other.entry_angle),
        }
    }
}

impl Add for Outcome {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        self.with(other, |a, b| a + b)
    }
}

impl Sub for Outcome {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self.with(other, |a, b| a - b)
    }
}

impl Mul<f64> for Outcome {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        self.with(self, |a, _| a * factor)
    }
}

/// A flight with a change.
#[derive(Debug, Clone, PartialEq)]
pub struct WhatIf {
    /// The change.
    pub change: FlightChange,
    /// Times, s, as many as the flight has frames.
    pub times: Vec<f64>,
    /// Configurations, one after the other; places of the root are in m and not scaled.
    pub positions: Vec<f64>,
    /// What it comes to.
    pub outcome: Outcome,
    /// By how much this is more than without the change, flown.
    pub flown: Outcome,
    /// The same by derivatives.
    pub linear: Outcome,
    /// Whether the angles at the entry, and the twists, of both differ by at most a tenth.
    pub agrees: bool,
}

/// Part of the flown difference by which the linear one may be off where it is used in words.
pub(super) const AGREEMENT: f64 = 0.1;
/// Angles, rad, and twists that count as none for that comparison: noise lets a body twist that does not.
const NOTHING_TURNED: f64 = 1e-3;
const NOTHING_TWISTED: f64 = 0.01;
/// Angle at the entry, rad, by which the flight flown again may be off where its interval is shorter.
const ALLOWED: f64 = 0.01;
/// Somersaults from which on their sense is that of the flight.
const TURNED: f64 = 0.25;
/// Displacements for derivatives by the height, m, and of the line from feet to hands, rad.
const HIGHER: f64 = 5e-3;
const DISPLACEMENT: f64 = 1e-5;
/// Gravity and height of a flight whose height cannot be changed have no derivative.
const NONE: Outcome = Outcome { somersaults: f64::NAN, twists: f64::NAN, entry_angle: f64::NAN };

/// A reconstructed flight that is flown again.
pub struct WhatIfFlight<'m> {
    pub(super) model: &'m Model,
    pub(super) known: KnownFlight<'m>,
    pub(super) curves: JointCurves,
    /// The folded posture, where one is held.
    pub(super) folded: Option<FoldedPhase>,
    /// Whether `known` has a posture that can be changed.
    is_held: bool,
    landmarks: Landmarks,
    scale: f64,
    /// 1 forwards.
    sense: f64,
    base: ChangedFlight,
    /// As flown again without a change.
    unchanged: Outcome,
}

impl<'m> WhatIfFlight<'m> {
    /// The flight of `report`. Opening and posture change the folded phase that the flight has, or the one that is given.
    pub fn try_new(
        model: &'m Model,
        flight: &ReconstructedFlight,
        report: &FlightReport,
        held: Option<HeldPosture>,
    ) -> Result<Self, AdviceError> {
        let Some(first) = flight.frames.first() else { return Err(IdentificationError::NoFrames.into()) };
        let landmarks = Landmarks::of(model)?;
        let (root_q, root_v) = (model.positions_of(0).len(), model.velocities_of(0).len());
        let n = model.n_velocities() - root_v;
        let frames = &flight.frames;
        let curves = JointCurves::try_new(
            model,
            frames.iter().map(|frame| frame.time).collect(),
            frames.iter().flat_map(|frame| frame.q[root_q..].iter().copied()).collect(),
            frames.iter().flat_map(|frame| frame.v[root_v..].iter().copied()).collect(),
        )?;
        let folded = FoldedPhase::of(model, &landmarks, flight)?;
        let own = folded
            .as_ref()
            .map(|phase| HeldPosture { times: phase.times, direction: phase.direction.clone() });
        let is_held = held.is_some() || own.is_some();
        let [start, end] = curves.interval();
        let nothing = || HeldPosture {
            times: [0.0, 0.25, 0.75, 1.0].map(|x| start + x * (end - start)),
            direction: vec![0.0; n],
        };
        let held = held.or(own).unwrap_or_else(nothing);
        let take_off = TakeOff {
            time: first.time,
            center_of_mass: flight.center_of_mass.value,
            velocity: flight.velocity.value,
            // of the body of the model's size, which turns likewise
            angular_momentum: flight.angular_momentum.value / flight.scale[0].powi(2),
        };
        let at = model.joint(0).map_or(0..0, |joint| joint.kind().orientation());
        let known = KnownFlight::try_new(model, take_off, &first.q[at], curves.clone(), held)?;
        let base = known.fly(&FlightChange::default())?;
        let mut found = Self {
            model,
            known,
            curves,
            folded,
            is_held,
            landmarks,
            scale: flight.scale[0],
            sense: 1.0,
            base,
            unchanged: Outcome::default(),
        };
        // the angle at the entry is that of the report, but for the upright and the halves of turns that the report takes off
        let nearest = |angle: f64| angle + ((report.entry_angle.value - angle) / PI).round() * PI;
        let from = |angle: f64| (nearest(angle) - report.entry_angle.value).abs();
        found.unchanged = found.outcome_of(&found.base)?;
        let Outcome { somersaults, entry_angle: flown, .. } = found.unchanged;
        // without a somersault the report's sense is that of the line from feet to hands
        let is_backward =
            if somersaults.abs() > TURNED { somersaults < 0.0 } else { from(-flown) < from(flown) };
        if is_backward {
            found.sense = -1.0;
        }
        found.unchanged.entry_angle = nearest(found.sense * flown);
        // what joints do between frames that are far apart is not in the frames
        let off = from(found.unchanged.entry_angle);
        let half = 0.5 * (report.entry_angle.upper - report.entry_angle.lower);
        if off > half.max(ALLOWED) {
            let apart = frames.windows(2).map(|pair| pair[1].time - pair[0].time).fold(0.0, f64::max);
            return Err(AdviceError::FramesApart { apart, off });
        }
        Ok(found)
    }

    /// What the flight comes to as it is, flown again.
    pub fn unchanged(&self) -> &Outcome {
        &self.unchanged
    }

    /// The folded posture and while it is held; none where the flight has none.
    pub fn folded(&self) -> Option<&FoldedPhase> {
        self.folded.as_ref()
    }

    /// Times at which the diver starts to fold, is folded, starts to open and is open, s; `None` if the flight has no folded phase.
    pub fn held(&self) -> Option<[f64; 4]> {
        self.is_held.then(|| self.known.held().times)
    }

    /// Angle of the line at the end without the upright of its take-off, rad.
    fn outcome_of(&self, flown: &ChangedFlight) -> Result<Outcome, AdviceError> {
        let momentum = self.known.take_off().angular_momentum;
        let travelling = travelling(self.model, &momentum, flown.path.iter().copied());
        let angles = counting_of(self.model).along(&travelling);
        let (first, last) = (&angles[0], &angles[angles.len() - 1]);
        let twist = last.twist - first.twist;
        let q = &flown.positions[flown.positions.len() - self.model.n_positions()..];
        let ahead = line_ahead(self.model, &self.landmarks, &mut Data::new(self.model), q, twist)?;
        Ok(Outcome {
            somersaults: (last.somersault - first.somersault) / TAU,
            twists: twist / TAU,
            entry_angle: self.sense * (last.somersault + ahead),
        })
    }

    /// Derivatives of the outcome by opening, posture and momentum in a flight.
    pub(super) fn slopes(&self, flown: &ChangedFlight) -> Result<[Outcome; N_CHANGES], AdviceError> {
        let model = self.model;
        let momentum = self.known.take_off().angular_momentum;
        let travelling = travelling(model, &momentum, flown.path.iter().copied());
        let counting = counting_of(model);
        let angles = counting.along(&travelling);
        let last = travelling.len() - 1;
        let twist = angles[last].twist - angles[0].twist;
        let [by_somersault, _, by_twist] = counting.gradients(&travelling[last]);
        let q = &flown.positions[flown.positions.len() - model.n_positions()..];
        let mut data = Data::new(model);
        let n_root = model.velocities_of(0).len();
        let mut found = [Outcome::default(); N_CHANGES];
        for (k, out) in found.iter_mut().enumerate() {
            let turn = &flown.by_change[k];
            let (somersault, twisted) = (by_somersault.dot(turn), by_twist.dot(turn));
            let mut step = vec![0.0; model.n_velocities()];
            if let Some(joints) = flown.joints_by_change.get(k) {
                step[n_root..].copy_from_slice(joints);
            }
            let size = step.iter().fold(1.0_f64, |size, x| size.max(x.abs()));
            let h = DISPLACEMENT / size;
            let mut moved = q.to_vec();
            let mut at = |h: f64| -> Result<f64, AdviceError> {
                let along: Vec<f64> = step.iter().map(|x| x * h).collect();
                model.displace(q, &along, &mut moved)?;
                Ok(line_ahead(model, &self.landmarks, &mut data, &moved, twist + twisted * h)?)
            };
            let of_line = (at(h)? - at(-h)?) / (2.0 * h);
            *out = Outcome {
                somersaults: somersault / TAU,
                twists: twisted / TAU,
                entry_angle: self.sense * (somersault + of_line),
            };
        }
        Ok(found)
    }

    /// The flight with a change, which must not ask for what the flight does not have.
    pub fn fly(&self, change: &FlightChange) -> Result<WhatIf, AdviceError> {
        for (argument, size) in [("opening", change.opening), ("posture", change.posture)] {
            if size != 0.0 && !self.is_held {
                return Err(AdviceError::NotFolded { argument });
            }
        }
        let flown = self.known.fly(change)?;
        let difference = self.difference(&flown)?;
        let [opening, posture, momentum] = self.slopes(&self.base)?;
        let mut linear = opening * change.opening + posture * change.posture + momentum * change.momentum;
        if change.height != 0.0 {
            linear = linear + self.by_height()? * change.height;
        }
        let is_near = |flown: f64, linear: f64, nothing: f64| {
            (flown - linear).abs() <= (AGREEMENT * flown.abs()).max(nothing)
        };
        let agrees = is_near(difference.entry_angle, linear.entry_angle, NOTHING_TURNED)
            && is_near(difference.twists, linear.twists, NOTHING_TWISTED);
        Ok(WhatIf {
            change: *change,
            positions: self.placed(&flown)?,
            times: flown.times,
            outcome: self.unchanged + difference,
            flown: difference,
            linear,
            agrees,
        })
    }

    /// By how much the angle at the entry is more with a change, flown.
    pub(super) fn entry_change(&self, change: &FlightChange) -> Result<f64, AdviceError> {
        Ok(self.difference(&self.known.fly(change)?)?.entry_angle)
    }

    fn difference(&self, flown: &ChangedFlight) -> Result<Outcome, AdviceError> {
        Ok(self.outcome_of(flown)? - self.outcome_of(&self.base)?)
    }

    /// The derivatives by opening, posture and momentum of the flight as it is.
    pub(super) fn own_slopes(&self) -> Result<[Outcome; N_CHANGES], AdviceError> {
        self.slopes(&self.base)
    }

    fn by_height(&self) -> Result<Outcome, AdviceError> {
        let at = |height: f64| -> Result<Outcome, AdviceError> {
            self.outcome_of(&self.known.fly(&FlightChange { height, ..FlightChange::default() })?)
        };
        // a flight that rises by less than the displacement has no central difference
        match (at(HIGHER), at(-HIGHER)) {
            (Ok(more), Ok(less)) => Ok((more - less) * (0.5 / HIGHER)),
            _ => Ok(NONE),
        }
    }

    /// Configurations of the body in its size.
    fn placed(&self, flown: &ChangedFlight) -> Result<Vec<f64>, AdviceError> {
        let (model, n_q) = (self.model, self.model.n_positions());
        let mut data = Data::new(model);
        let axes = model.placement(0).map_or(Matrix3::identity(), |placement| placement.rotation);
        let n_linear = model.joint(0).map_or(0, |joint| joint.kind().n_linear);
        let mut positions = flown.positions.clone();
        for q in positions.chunks_exact_mut(n_q) {
            let placed = model.positions(&mut data, q)?;
            let arm: Vector3<f64> = placed.pose(0)?.translation - placed.center_of_mass();
            let moved = axes.tr_mul(&(arm * (self.scale - 1.0)));
            for k in 0..n_linear {
                q[k] += moved[k];
            }
        }
        Ok(positions)
    }
}
