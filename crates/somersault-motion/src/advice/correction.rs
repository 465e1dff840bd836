//! What brings the entry to the vertical, ranked.

use super::AdviceError;
use super::what_if::{AGREEMENT, WhatIfFlight};
use crate::identification::{FlightReport, IdentificationStatus};
use crate::noise::standard_deviation;
use crate::phases::WithInterval;
use crate::reconstruction::ReconstructedFlight;
use nalgebra::{Matrix3, SMatrix, Vector3};
use serde::{Deserialize, Serialize};
use somersault_core::argument::{ArgumentError, expect_not_negative, expect_range};
use somersault_core::cancel::CancellationToken;
use somersault_core::roots::bracket;
use somersault_multibody::Model;
use somersault_multibody::flight::{FlightChange, HeldPosture, JointCurves, KnownFlight, TakeOff};
use std::f64::consts::PI;

/// What a diver can do about an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Correction {
    /// Leave the folded posture later.
    OpenLater,
    /// Leave it earlier.
    OpenEarlier,
    /// Hold it tighter.
    Tighter,
    /// Leave the board with more angular momentum.
    MoreMomentum,
    /// With less.
    LessMomentum,
}

impl Correction {
    /// All there are, and their names.
    pub const ALL: [(Self, &'static str); 5] = [
        (Self::OpenLater, "open_later"),
        (Self::OpenEarlier, "open_earlier"),
        (Self::Tighter, "tighter"),
        (Self::MoreMomentum, "more_momentum"),
        (Self::LessMomentum, "less_momentum"),
    ];

    /// The change that is this by an amount.
    fn change(self, amount: f64) -> FlightChange {
        let none = FlightChange::default();
        match self {
            Self::OpenLater => FlightChange { opening: amount, ..none },
            Self::OpenEarlier => FlightChange { opening: -amount, ..none },
            Self::Tighter => FlightChange { posture: amount, ..none },
            Self::MoreMomentum => FlightChange { momentum: amount, ..none },
            Self::LessMomentum => FlightChange { momentum: -amount, ..none },
        }
    }

    /// Which derivative it has, and its sign.
    fn slope(self) -> (usize, f64) {
        match self {
            Self::OpenLater => (0, 1.0),
            Self::OpenEarlier => (0, -1.0),
            Self::Tighter => (1, 1.0),
            Self::MoreMomentum => (2, 1.0),
            Self::LessMomentum => (2, -1.0),
        }
    }

    fn is_of_the_board(self) -> bool {
        matches!(self, Self::MoreMomentum | Self::LessMomentum)
    }
}

/// What is within reach of a diver.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reach {
    /// How long the body must be straight before the entry, s.
    pub line_up: f64,
    /// By which fraction the angular momentum can be another.
    pub momentum: f64,
}

impl Default for Reach {
    /// 0.15 s, 0.15.
    fn default() -> Self {
        Self { line_up: 0.15, momentum: 0.15 }
    }
}

/// One piece of advice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Advice {
    /// What to do.
    pub correction: Correction,
    /// By how much, for a vertical entry: s, rad of the joint that moves most, or a fraction of the momentum; not negative.
    pub amount: WithInterval,
    /// How much of it is within reach.
    pub reach: f64,
    /// Which fraction of the angle at the entry is within reach, from 0 to 1.
    pub covers: f64,
    /// Change of the angle at the entry by what is within reach of the amount, flown, rad.
    pub flown: f64,
    /// The same by the exact derivative.
    pub linear: f64,
    /// Whether both differ by at most a tenth.
    pub agrees: bool,
    /// Whether the joint that moves most is the knee.
    pub by_knees: bool,
}

/// Why there is advice, or none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum AdviceStatus {
    /// There is advice.
    Given,
    /// The interval of the angle at the entry holds the vertical.
    Vertical,
    /// Nothing that the diver can change has an effect whose sign is sure.
    NothingSure,
    /// The number of somersaults is not sure, and was not given.
    NoTarget,
    /// The flight turned by more than three quarters of a turn less or more than the number given.
    FarFromTarget,
    /// Gravity in the recording is not that of the model.
    OtherGravity,
    /// The reconstruction is no success.
    NotReconstructed,
    /// Frames are so far apart that the flight cannot be flown again.
    FramesApart,
}

impl AdviceStatus {
    /// All there are, and their names.
    pub const ALL: [(Self, &'static str); 8] = [
        (Self::Given, "given"),
        (Self::Vertical, "vertical"),
        (Self::NothingSure, "nothing_sure"),
        (Self::NoTarget, "no_target"),
        (Self::FarFromTarget, "far_from_target"),
        (Self::OtherGravity, "other_gravity"),
        (Self::NotReconstructed, "not_reconstructed"),
        (Self::FramesApart, "frames_apart"),
    ];
}

/// Advice on a flight.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlightAdvice {
    /// Why there is some, or none.
    pub status: AdviceStatus,
    /// Angle at the entry beyond the vertical for the number of somersaults that it is about, rad.
    pub entry_angle: WithInterval,
    /// That number of half somersaults.
    pub half_somersaults: i32,
    /// The first comes first.
    pub advice: Vec<Advice>,
    /// What was withheld: its interval spans zero, its effect is not sure, or what is in reach of it covers less than a twentieth.
    pub withheld: Vec<Correction>,
}

/// Probability of a number of somersaults that is sure.
const SURE: f64 = 0.9;
/// Half the width of a 95 % interval, in standard deviations.
const SIDE: f64 = 1.959_963_984_540_054;
/// Part of the error from which on what can be done in flight comes first.
const HALF: f64 = 0.5;
/// How closely an amount is solved, in its unit.
const TOLERANCE: f64 = 1e-5;
/// Half somersaults of a dive, at most.
const MOST: i32 = 11;
/// Angle at the entry beyond which a flight is another dive, or not all of it, rad.
const FAR: f64 = 1.5 * PI;
/// Part of the error below which a correction is out of reach.
const NOTHING: f64 = 0.05;

/// Advice for the entry of a flight, which turns to the number of half somersaults that it was found to have, or to the one given.
pub fn advise_flight(
    model: &Model,
    flight: &ReconstructedFlight,
    report: &FlightReport,
    half_somersaults: Option<i32>,
    reach: &Reach,
    token: &CancellationToken,
) -> Result<FlightAdvice, AdviceError> {
    expect_not_negative("line_up", reach.line_up)?;
    expect_range("momentum_reach", reach.momentum, "above 0 and at most 0.5", |x| x > 0.0 && x <= 0.5)?;
    if let Some(n) = half_somersaults
        && !(1..=MOST.unsigned_abs()).contains(&n.unsigned_abs())
    {
        let (argument, allowed) = ("half_somersaults", "from 1 to 11, forwards positive");
        return Err(ArgumentError::OutOfRange { argument, allowed, found: f64::from(n) }.into());
    }
    let sense = if report.somersaults.value < 0.0 { -1.0 } else { 1.0 };
    let own = report.half_somersaults.value;
    let target = half_somersaults.unwrap_or(own);
    let further = sense * PI * f64::from(target - own);
    let moved = |x: f64| x - further;
    let WithInterval { value, lower, upper } = report.entry_angle;
    let entry_angle = WithInterval { value: moved(value), lower: moved(lower), upper: moved(upper) };
    let mut found = FlightAdvice {
        status: AdviceStatus::Given,
        entry_angle,
        half_somersaults: target,
        advice: Vec::new(),
        withheld: Vec::new(),
    };
    let is_sure = half_somersaults.is_some() || report.half_somersaults.probability >= SURE && own != 0;
    let refused = match report.status {
        IdentificationStatus::OtherGravity => Some(AdviceStatus::OtherGravity),
        IdentificationStatus::NotReconstructed => Some(AdviceStatus::NotReconstructed),
        _ if !flight.success() => Some(AdviceStatus::NotReconstructed),
        _ if !is_sure => Some(AdviceStatus::NoTarget),
        _ if entry_angle.value.abs() > FAR => Some(AdviceStatus::FarFromTarget),
        _ if entry_angle.lower <= 0.0 && entry_angle.upper >= 0.0 => Some(AdviceStatus::Vertical),
        _ => None,
    };
    if let Some(status) = refused {
        found.status = status;
        return Ok(found);
    }
    let again = match WhatIfFlight::try_new(model, flight, report, None) {
        Err(AdviceError::FramesApart { .. }) => {
            found.status = AdviceStatus::FramesApart;
            return Ok(found);
        }
        again => again?,
    };
    let deviations = again.slope_deviations(model, flight, token)?;
    let of_entry = (entry_angle.upper - entry_angle.lower) / (2.0 * SIDE);
    for (correction, allowed) in again.possible(flight, entry_angle.value, reach) {
        if token.is_cancelled() {
            return Err(AdviceError::Interrupted);
        }
        match again.advice(correction, allowed, entry_angle.value, of_entry, &deviations)? {
            Some(advice) if advice.amount.lower > 0.0 && advice.covers >= NOTHING => {
                found.advice.push(advice)
            }
            _ => found.withheld.push(correction),
        }
    }
    // what is done in flight and covers half, then what is brought from the board, then the rest
    let rank = |advice: &Advice| match advice.correction {
        correction if correction.is_of_the_board() => 1,
        _ if advice.covers >= HALF => 0,
        _ => 2,
    };
    let used = |advice: &Advice| advice.amount.value / advice.reach;
    found.advice.sort_by(|a, b| {
        rank(a).cmp(&rank(b)).then(b.covers.total_cmp(&a.covers)).then(used(a).total_cmp(&used(b)))
    });
    if found.advice.is_empty() {
        found.status = AdviceStatus::NothingSure;
    }
    Ok(found)
}

impl WhatIfFlight<'_> {
    /// What can be done about an angle at the entry, and how much of it.
    fn possible(&self, flight: &ReconstructedFlight, entry: f64, reach: &Reach) -> Vec<(Correction, f64)> {
        let is_short = entry < 0.0;
        let mut found = Vec::new();
        if let Some(folded) = &self.folded {
            let [.., ends] = folded.times;
            let last = flight.frames.last().map_or(ends, |frame| frame.time);
            let longest = self.known.longest_delay();
            if is_short {
                let later = (last - ends - reach.line_up).min(longest);
                found.extend([(Correction::OpenLater, later), (Correction::Tighter, folded.reach)]);
            } else {
                found.push((Correction::OpenEarlier, longest));
            }
            found.retain(|(_, reach)| *reach > 0.0);
        }
        let board = if is_short { Correction::MoreMomentum } else { Correction::LessMomentum };
        found.push((board, reach.momentum));
        found
    }

    /// The amount of a correction for a vertical entry; none where it turns the other way.
    fn advice(
        &self,
        correction: Correction,
        reach: f64,
        entry: f64,
        of_entry: f64,
        deviations: &[f64; 3],
    ) -> Result<Option<Advice>, AdviceError> {
        let (k, sign) = correction.slope();
        let slope = sign * self.own_slopes()?[k].entry_angle;
        let deviation = deviations[k];
        // an effect whose sign is not sure, or that leads away from the vertical
        if !(slope.abs() > SIDE * deviation && slope * entry < 0.0) {
            return Ok(None);
        }
        let after =
            |amount: f64| Ok::<_, AdviceError>(entry + self.entry_change(&correction.change(amount))?);
        let most = after(reach)?;
        let guess = -entry / slope;
        let amount = if most * entry <= 0.0 {
            let (near, far) = bracket(after, (0.0, entry), (reach, most), guess, TOLERANCE)?;
            0.5 * (near + far)
        } else {
            // beyond the reach at the rate that is flown within
            reach * entry / (entry - most)
        };
        if !(amount > 0.0 && amount.is_finite()) {
            return Ok(None);
        }
        let made = amount.min(reach);
        let flown = if made < amount { most - entry } else { after(made)? - entry };
        let linear = slope * made;
        let of_amount = (of_entry / slope).hypot(amount * deviation / slope);
        Ok(Some(Advice {
            correction,
            amount: WithInterval::normal(amount, of_amount),
            reach,
            covers: (flown / -entry).clamp(0.0, 1.0),
            flown,
            linear,
            agrees: (flown - linear).abs() <= AGREEMENT * flown.abs(),
            by_knees: self.folded.as_ref().is_some_and(|folded| folded.by_knees),
        }))
    }

    /// Standard deviations of the changes of the angle at the entry by opening, posture and momentum: of flights with momentum and joints displaced by
    /// a standard deviation to either side along each principal axis of their covariances, and with the direction in which a tuck is tighter.
    fn slope_deviations(
        &self,
        model: &Model,
        flight: &ReconstructedFlight,
        token: &CancellationToken,
    ) -> Result<[f64; 3], AdviceError> {
        let own = *self.known.take_off();
        let mut variances = [0.0; 3];
        let held = self.known.held();
        let mut add = |flights: [(TakeOff, JointCurves, HeldPosture); 2]| -> Result<(), AdviceError> {
            if token.is_cancelled() {
                return Err(AdviceError::Interrupted);
            }
            let mut found = [[0.0; 3]; 2];
            for (out, (take_off, curves, held)) in found.iter_mut().zip(flights) {
                let at = model.joint(0).map_or(0..0, |joint| joint.kind().orientation());
                let orientation = &flight.frames[0].q[at];
                let known = KnownFlight::try_new(model, take_off, orientation, curves, held)?;
                let slopes = self.slopes(&known.fly(&FlightChange::default())?)?;
                *out = slopes.map(|slope| slope.entry_angle);
            }
            for (variance, (more, less)) in variances.iter_mut().zip(found[0].iter().zip(&found[1])) {
                *variance += (0.5 * (more - less)).powi(2);
            }
            Ok(())
        };
        // L/s², of which both have a covariance
        let scale = flight.scale[0];
        let mut by = SMatrix::<f64, 3, 11>::zeros();
        by.fixed_view_mut::<3, 3>(0, 0).copy_from(&(Matrix3::identity() / scale.powi(2)));
        by.set_column(9, &(own.angular_momentum * (-2.0 / scale)));
        let covariance = by * &flight.covariance * by.transpose();
        let parts = covariance.fixed_view::<3, 3>(0, 0).into_owned().symmetric_eigen();
        for (value, axis) in parts.eigenvalues.iter().zip(parts.eigenvectors.column_iter()) {
            let step: Vector3<f64> = axis * standard_deviation(*value);
            if step.norm() > 1e-9 * own.angular_momentum.norm() {
                add([step, -step].map(|step| {
                    let moved = TakeOff { angular_momentum: own.angular_momentum + step, ..own };
                    (moved, self.curves.clone(), held.clone())
                }))?;
            }
        }
        // joints, as far from where they are in all frames
        let n_root = model.velocities_of(0).len();
        for step in flight.frames[flight.frames.len() / 2].joint_displacements(n_root) {
            let back: Vec<f64> = step.iter().map(|x| -x).collect();
            let [more, less] = [self.curves.displaced(&step)?, self.curves.displaced(&back)?];
            add([(own, more, held.clone()), (own, less, held.clone())])?;
        }
        // a direction that was given is as it is
        let found = self.folded.as_ref().filter(|folded| folded.direction == held.direction);
        if let Some(folded) = found.filter(|folded| folded.spread.iter().any(|x| *x != 0.0)) {
            add([1.0, -1.0].map(|sign| {
                let along = folded.direction.iter().zip(&folded.spread);
                let direction = along.map(|(x, by)| x + sign * by).collect();
                (own, self.curves.clone(), HeldPosture { direction, ..held.clone() })
            }))?;
        }
        Ok(variances.map(f64::sqrt))
    }
}

impl Advice {
    /// What to do, by how much, and what comes of it.
    pub fn words(&self) -> String {
        let half = 0.5 * (self.amount.upper - self.amount.lower);
        let of = |factor: f64, unit: &str| {
            let value = factor * self.amount.value;
            // digits that the interval has
            let digits = usize::from(factor * half < 1.0);
            format!("{value:.digits$} ± {:.digits$}{unit}", factor * half)
        };
        let degrees = |angle: f64| format!("{:.0}°", angle.abs().to_degrees());
        let joint = if self.by_knees { "knees" } else { "hips" };
        let (what, amount, reached, part) = match self.correction {
            Correction::OpenLater => {
                ("Open later", of(1e3, " ms"), format!("{:.0} ms", 1e3 * self.reach), 0.01)
            }
            Correction::OpenEarlier => {
                ("Open earlier", of(1e3, " ms"), format!("{:.0} ms", 1e3 * self.reach), 0.01)
            }
            Correction::Tighter => ("Fold tighter", of(180.0 / PI, "°"), degrees(self.reach), PI / 180.0),
            Correction::MoreMomentum => (
                "Take more angular momentum from the board",
                of(100.0, " %"),
                format!("{:.0} %", 100.0 * self.reach),
                0.01,
            ),
            Correction::LessMomentum => (
                "Take less angular momentum from the board",
                of(100.0, " %"),
                format!("{:.0} %", 100.0 * self.reach),
                0.01,
            ),
        };
        let place =
            if self.correction == Correction::Tighter { format!(" at the {joint}") } else { String::new() };
        let turned = if self.flown > 0.0 { "further" } else { "less far" };
        let mut words = format!("{what} by {amount}{place} for a vertical entry");
        if self.amount.value > self.reach {
            words +=
                &format!("; {reached} are within reach and turn the body {} {turned}", degrees(self.flown));
        } else {
            words += &format!(": the body turns {} {turned}", degrees(self.flown));
        }
        if self.agrees {
            let made = self.amount.value.min(self.reach);
            let unit = match self.correction {
                Correction::Tighter => "1°",
                Correction::MoreMomentum | Correction::LessMomentum => "1 %",
                Correction::OpenLater | Correction::OpenEarlier => "10 ms",
            };
            words += &format!(", {:.1}° for {unit}", (self.linear / made * part).abs().to_degrees());
        }
        words + "."
    }
}

impl FlightAdvice {
    /// The angle at the entry and, where no advice is given, the reason.
    pub fn message(&self) -> String {
        let WithInterval { value, lower, upper } = self.entry_angle;
        let half = 0.5 * (upper - lower).to_degrees();
        let side = if value < 0.0 { "short of" } else { "beyond" };
        // digits that the interval has
        let digits = usize::from(half < 1.0);
        let angle = value.abs().to_degrees();
        let entry = format!("the entry is {angle:.digits$} ± {half:.digits$}° {side} the vertical");
        match self.status {
            AdviceStatus::Given => entry,
            AdviceStatus::Vertical => format!("{entry}, which is within the interval: there is nothing to correct"),
            AdviceStatus::NothingSure => {
                format!("{entry}, but no change is known well enough to have a sure effect")
            }
            AdviceStatus::NoTarget => {
                "the number of half somersaults is not sure: give the one that was intended".to_owned()
            }
            AdviceStatus::FarFromTarget => format!(
                "{entry}: the number of half somersaults given is not that of this flight, or the flight is not all of the dive"
            ),
            AdviceStatus::OtherGravity => {
                "no advice: gravity in the recording is not that of the model, so the rate or the unit is wrong".to_owned()
            }
            AdviceStatus::NotReconstructed => "no advice: the flight was not reconstructed".to_owned(),
            AdviceStatus::FramesApart => {
                format!("{entry}, but frames are too far apart to fly the flight again: no advice")
            }
        }
    }
}
