//! What a dive is, verified by integrations that are independent of the search.
//!
//! The full equations of the driven tree are integrated from take-off to entry, without use of the conserved momentum and in
//! steps of their own. Somersaults, tilt and twist are counted along that flight, whole turns without jumps, and compared
//! with those requested; its orientations are compared with the nodes of the program, and with a second, accurate
//! integration of the reduced flight.

use crate::nearest::{Approach, Approaches};
use crate::program::requested;
use crate::{DiveError, DiveProgram, PeakTorque};
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::cancel::CancellationToken;
use somersault_core::lie::so3::{angle_between, normalized_xyzw};
use somersault_integrators::driver::{Adaptive, IntegrateError, Steps};
use somersault_integrators::methods::{Dop853, RungeKuttaMuntheKaas};
use somersault_integrators::run::Run;
use somersault_integrators::solution::{Recorder, Solution};
use somersault_multibody::counting::BodyAngles;
use somersault_multibody::flight::{Flight, FlightSystem, TakeOff};
use somersault_multibody::joint_motion::SplineMotion;
use somersault_multibody::motion::{Coordinates, TreeState, TreeSystem};
use somersault_multibody::{Data, Split};
use somersault_ocp::verification::Holds;

/// A dive that was found.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DiveReport {
    /// L about the lateral axis, forward, kg m²/s.
    pub momentum: f64,
    /// T, s.
    pub duration: f64,
    /// Somersaults from the upright to the entry, counted along the full dynamics integrated from take-off to entry.
    pub somersaults: f64,
    /// Twists at the entry, likewise.
    pub twists: f64,
    /// Tilt at the entry, likewise, rad.
    pub tilt: f64,
    /// Angle of the body's long axis to the vertical at the entry, likewise, rad.
    pub entry_angle: f64,
    /// Greatest difference of somersault, tilt and twist at the entry, likewise, from those requested, rad.
    pub entry_defect: f64,
    /// Greatest angle between the reduced flight, integrated to 1e-12 from take-off to entry, and the nodes of the program, rad.
    pub defect: f64,
    /// That angle at each node, rad; where the program restarts its orientation, with that before the restart or after it,
    /// whichever is farther.
    pub defects: Vec<f64>,
    /// What the full dynamics of the driven tree, integrated to 1e-14 without use of the reduction, changes the
    /// angular momentum by: |ΔL|/max(|L|, |h|, L₀/1000), where h is the largest momentum that the joints alone have at a
    /// node, with the torso at rest, and L₀ = m h²/(1 s). A dive with no momentum to speak of has that of its limbs for a
    /// scale.
    pub momentum_drift: f64,
    /// Greatest angle between the orientations of full and reduced integration at the nodes, rad.
    pub full_dynamics_defect: f64,
    /// Least channel at 1000 times.
    pub least_channel: f64,
    /// Greatest sum of channels at 1000 times.
    pub greatest_sum: f64,
    /// Limbs nearest to each other at any time of the flight; none without a clearance.
    pub nearest: Option<Nearest>,
    /// The largest force of each joint at the nodes.
    pub peak_torques: Vec<PeakTorque>,
    /// Centre of mass at take-off, from the toes' end of the platform at the water's level, m.
    pub take_off: Vector3<f64>,
    /// Its velocity, m/s.
    pub take_off_velocity: Vector3<f64>,
}

/// Limbs that come nearest to each other.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Nearest {
    /// No distance of surfaces is smaller at any time, and one is at most 10 μm greater, m. Found with bounds on the rate of
    /// the distances between samples.
    pub distance: f64,
    /// The segments.
    pub limbs: [String; 2],
    /// When, s.
    pub time: f64,
    /// Distance requested, m.
    pub clearance: f64,
}

/// Angle in rad, and momentum drift, that counts as agreement where nothing else is said.
pub const ALLOWED: f64 = 1e-3;

impl Holds for DiveReport {
    /// [Confirmed](DiveReport::is_confirmed) to [`ALLOWED`].
    fn holds(&self) -> bool {
        self.is_confirmed(ALLOWED)
    }
}

impl DiveReport {
    /// Whether it is the dive requested, given the angle in rad that its use allows: [`flies`](Self::flies),
    /// [`enters`](Self::enters) and [`is_clear`](Self::is_clear).
    pub fn is_confirmed(&self, allowed: f64) -> bool {
        self.flies(allowed) && self.enters(allowed) && self.is_clear()
    }

    /// Whether the orientations of both integrations agree to `allowed` rad with the nodes and with each other, and the angular
    /// momentum is kept to this fraction of its scale.
    pub fn flies(&self, allowed: f64) -> bool {
        [self.defect, self.full_dynamics_defect, self.momentum_drift].iter().all(|x| *x <= allowed)
    }

    /// Whether somersault, tilt and twist at the entry are those requested to `allowed` rad, whole turns counted.
    pub fn enters(&self, allowed: f64) -> bool {
        self.entry_defect <= allowed
    }

    /// Whether limbs keep the distance requested at all times.
    pub fn is_clear(&self) -> bool {
        self.nearest.as_ref().is_none_or(Nearest::is_clear)
    }

    /// Whether the dive is confirmed, given the angle that its use allows: one sentence, or one for each thing that is wrong.
    pub fn sentence(&self, allowed: f64) -> String {
        let Self { defect, full_dynamics_defect: full, momentum_drift: drift, entry_defect: miss, .. } = self;
        if self.is_confirmed(allowed) {
            return format!(
                "The dive holds when re-integrated: defects ≤ {defect:.1e} rad, momentum to {drift:.1e}, full dynamics to {full:.1e} rad, entry to {miss:.1e} rad."
            );
        }
        let mut sentences = Vec::new();
        if !self.flies(allowed) {
            sentences.push(format!(
                "The optimum exploits its discretisation: on re-integration it is up to {defect:.1e} rad away, the momentum drifts by {drift:.1e} and the full dynamics are up to {full:.1e} rad away."
            ));
        }
        if !self.enters(allowed) {
            sentences.push(format!(
                "The flight ends {miss:.1e} rad from the requested entry, with {:.4} somersaults, {:.4} twists and {:.2}° of tilt.",
                self.somersaults,
                self.twists,
                self.tilt.to_degrees()
            ));
        }
        if let Some(nearest) = self.nearest.as_ref().filter(|nearest| !nearest.is_clear()) {
            let Nearest { distance, limbs: [a, b], time, clearance } = nearest;
            sentences.push(format!(
                "{a} and {b} come within {:.2} mm of each other at {time:.3} s, where {:.2} mm are requested.",
                1e3 * distance,
                1e3 * clearance
            ));
        }
        sentences.join(" ")
    }
}

impl Nearest {
    /// Whether that is no less than requested.
    pub fn is_clear(&self) -> bool {
        self.distance >= self.clearance
    }
}

/// Times at which bounds are looked at.
const TIMES: usize = 1000;
/// Fractions of the duration this near to each other are not added together: the first of them moves the others.
const APART: f64 = 1e-3;
/// Fractions of the duration that are the same time.
const SAME: f64 = 1e-6;
/// Times at which turns are counted, at least.
const SAMPLES: usize = 1000;

impl DiveProgram {
    /// Judges the dive `z`.
    pub fn report(&self, z: &[f64]) -> Result<DiveReport, DiveJudgementError> {
        self.report_cancellable(z, &CancellationToken::new())
    }

    /// The same until it is cancelled, which is looked for at each step of the integrations; then
    /// [`DiveJudgementError::Interrupted`].
    pub fn report_cancellable(
        &self,
        z: &[f64],
        token: &CancellationToken,
    ) -> Result<DiveReport, DiveJudgementError> {
        let mut program = self.clone();
        program.fly(z, false)?;
        let (momentum, duration) = (self.momentum(z), self.duration(z));
        let coefficients = self.coefficients(z);
        let motion = self.path().motion();
        let model = self.path().model();
        let channels = Channels { motion, coefficients: &coefficients, duration };
        let (take_off, take_off_velocity) = self.ballistics(&program, &coefficients, duration)?;
        let flight = Flight::try_new(
            model,
            TakeOff {
                time: 0.0,
                center_of_mass: take_off,
                velocity: take_off_velocity,
                angular_momentum: Vector3::new(0.0, momentum, 0.0),
            },
        )
        .map_err(DiveError::from)?;
        let shape = |t: f64, q: &mut [f64], v: &mut [f64]| {
            channels.joints(t, 0, q);
            channels.joints(t, 1, v);
        };
        let system = FlightSystem::new(flight, &shape);
        let is_planar = program.path().is_planar();
        let first: Vec<f64> = if is_planar {
            vec![program.path().angles()[0]]
        } else {
            program.path().orientations()[0].coords.as_slice().to_vec()
        };
        let start = system.state(&first).map_err(DiveError::from)?;
        let interval = (0.0, duration);
        let control = Adaptive { max_step: duration / 40.0, ..Adaptive::with_tolerances(1e-12, 1e-12) };
        let mut recorder = Recorder::new(0.0, &start, 1).with_dense_output();
        let end = Run::by_embedded_stepper(
            &system,
            &RungeKuttaMuntheKaas(Dop853),
            Steps::adapted(interval, control),
        )
        .observed_by(&mut (&mut recorder, token))
        .from(&start)?;
        if token.is_cancelled() {
            return Err(DiveJudgementError::Interrupted);
        }
        let reduced =
            Flown { is_planar, first: 0, duration, solution: recorder.into_solution(), end: end.state };
        let (full, momentum_drift) = self.full_dynamics(&system, &start, &channels, token)?;
        let path = program.path();
        let n_steps = path.n_steps();
        let mut defects = Vec::with_capacity(n_steps + 1);
        let mut full_dynamics_defect: f64 = 0.0;
        for node in 0..=n_steps {
            let fraction = node as f64 / n_steps as f64;
            let (flown, by_full) = (reduced.at(fraction)?, full.at(fraction)?);
            full_dynamics_defect = full_dynamics_defect.max(flown.apart(&by_full));
            defects.push(if is_planar {
                flown.apart(&Attitude::Angle(path.angles()[node]))
            } else {
                // before and after a restart
                let sides = [path.arrival(node), &path.orientations()[node]];
                sides.iter().map(|side| flown.apart(&Attitude::Rotation(**side))).fold(0.0, f64::max)
            });
        }
        let angles = self.count(&full)?;
        let requested = requested(self.dive());
        let entry_defect = [
            angles.somersault - requested.somersault,
            angles.tilt - requested.tilt,
            angles.twist - requested.twist,
        ]
        .iter()
        .fold(0.0, |most: f64, miss| most.max(miss.abs()));
        let entry_angle = {
            let down = -(angles.somersault.cos() * angles.tilt.cos());
            let level = (1.0 - down * down).max(0.0).sqrt();
            level.atan2(down.abs())
        };
        let mut least_channel = f64::INFINITY;
        let mut greatest_sum = f64::NEG_INFINITY;
        let mut values = vec![0.0; motion.n_channels()];
        for k in 0..TIMES {
            let fraction = k as f64 / (TIMES - 1) as f64;
            motion.channels_into(&coefficients, fraction, 0, &mut values);
            least_channel = values.iter().fold(least_channel, |least, w| least.min(*w));
            greatest_sum = greatest_sum.max(values.iter().sum());
        }
        Ok(DiveReport {
            momentum,
            duration,
            somersaults: angles.somersault / std::f64::consts::TAU,
            twists: angles.twist / std::f64::consts::TAU,
            tilt: angles.tilt,
            entry_angle,
            entry_defect,
            defect: defects.iter().copied().fold(0.0, f64::max),
            defects,
            momentum_drift,
            full_dynamics_defect,
            least_channel,
            greatest_sum,
            nearest: self.nearest(&coefficients, duration)?,
            peak_torques: self.motion(z)?.peak_torques(model),
            take_off,
            take_off_velocity,
        })
    }

    /// Somersaults, tilt and twists along a flight, whole turns counted: the angles at its end.
    fn count(&self, flown: &Flown) -> Result<BodyAngles, DiveError> {
        let upright = self.counting().axes.euler_angles().1;
        // nodes may be so few that the body turns by more than half between two
        let n_samples = self.path().n_steps().max(SAMPLES);
        let mut angles = BodyAngles::default();
        for k in 0..=n_samples {
            angles = match flown.at(k as f64 / n_samples as f64)? {
                // forward turns are negative about the normal of the plane
                Attitude::Angle(angle) => BodyAngles { somersault: upright - angle, ..BodyAngles::default() },
                Attitude::Rotation(orientation) => self.counting().unwrapped(&orientation, &angles),
            };
        }
        Ok(angles)
    }

    /// Fractions of the duration at which limbs are nearer to each other than requested, but for those at which the clearance is a
    /// constraint already.
    pub(crate) fn breaches(&self, z: &[f64]) -> Result<Vec<f64>, DiveError> {
        let (Some(rows), Some(clearance)) = (self.clearance(), self.dive().clearance) else {
            return Ok(Vec::new());
        };
        let (path, coefficients) = (self.path(), self.coefficients(z));
        let found = Approaches::new(rows.whole_body(), path.model(), path.motion(), &coefficients)
            .below(clearance.distance)?;
        let mut fractions: Vec<f64> = found.iter().map(|approach| approach.fraction).collect();
        fractions.sort_unstable_by(f64::total_cmp);
        fractions.dedup_by(|a, b| (*a - *b).abs() < APART);
        fractions.retain(|fraction| rows.fractions().iter().all(|known| (fraction - known).abs() > SAME));
        Ok(fractions)
    }

    /// Limbs nearest to each other, where the dive has a clearance.
    fn nearest(&self, coefficients: &[f64], duration: f64) -> Result<Option<Nearest>, DiveError> {
        let (Some(rows), Some(clearance)) = (self.clearance(), self.dive().clearance) else {
            return Ok(None);
        };
        let body = rows.whole_body();
        let path = self.path();
        let least = Approaches::new(body, path.model(), path.motion(), coefficients).least()?;
        Ok(least.map(|Approach { distance, pair, fraction }| Nearest {
            distance,
            limbs: body.names(pair).map(str::to_owned),
            time: fraction * duration,
            clearance: clearance.distance,
        }))
    }

    /// Centre of mass and its velocity at take-off: feet on the platform's end at the start, and at the finish the end of
    /// the body that is to enter first, hands or feet, at the water's level at the entry distance.
    pub(crate) fn ballistics(
        &self,
        program: &Self,
        coefficients: &[f64],
        duration: f64,
    ) -> Result<(Vector3<f64>, Vector3<f64>), DiveError> {
        let (model, motion) = (self.path().model(), self.path().motion());
        let mut data = Data::new(model);
        let mut from = |fraction: f64, node: usize, part: &[&str]| -> Result<Vector3<f64>, DiveError> {
            let mut q = model.neutral();
            let mut channels = vec![0.0; motion.n_channels()];
            motion.channels_into(coefficients, fraction, 0, &mut channels);
            let n_root = q.len() - motion.base().n_joints();
            motion.base().positions_into(&channels, &mut q[n_root..]);
            if program.path().is_planar() {
                q[2] = program.path().angles()[node];
            } else {
                q[3..7].copy_from_slice(program.path().orientations()[node].coords.as_slice());
            }
            let positions = model.positions(&mut data, &q)?;
            let mut point = Vector3::zeros();
            for name in part {
                point += positions.pose(model.body(name)?)?.translation / part.len() as f64;
            }
            Ok(positions.center_of_mass() - point)
        };
        let (feet, hands): (&[&str], &[&str]) = if program.path().is_planar() {
            (&["toes"], &["hand"])
        } else {
            (&["right_toes", "left_toes"], &["right_hand", "left_hand"])
        };
        let enters_first = if requested(self.dive()).somersault.cos() > 0.0 { feet } else { hands };
        let n_steps = program.path().n_steps();
        let start = Vector3::new(0.0, 0.0, self.dive().platform) + from(0.0, 0, feet)?;
        let finish = Vector3::new(self.dive().entry_distance, 0.0, 0.0) + from(1.0, n_steps, enters_first)?;
        let velocity = (finish - start) / duration - model.gravity() * (0.5 * duration);
        Ok((start, velocity))
    }

    /// Largest angular momentum about the centre of mass that the joints have at a node while the torso is at rest.
    fn momentum_of_joints(&self, channels: &Channels<'_>) -> Result<f64, DiveError> {
        let model = self.path().model();
        let mut data = Data::new(model);
        let (mut q, mut v) = (model.neutral(), vec![0.0; model.n_velocities()]);
        let n_root = (q.len() - channels.motion.base().n_joints(), model.velocities_of(0).len());
        let n_steps = self.path().n_steps();
        let mut largest: f64 = 0.0;
        for node in 0..=n_steps {
            let t = channels.duration * node as f64 / n_steps as f64;
            channels.joints(t, 0, &mut q[n_root.0..]);
            channels.joints(t, 1, &mut v[n_root.1..]);
            largest = largest.max(model.centroidal(&mut data, &q)?.momentum(&v)?.angular.norm());
        }
        Ok(largest)
    }

    /// The flight by the full dynamics, and the change of its momentum over its scale.
    fn full_dynamics<S: somersault_multibody::flight::ShapeMotion>(
        &self,
        system: &FlightSystem<'_, S>,
        start: &TreeState,
        channels: &Channels<'_>,
        token: &CancellationToken,
    ) -> Result<(Flown, f64), DiveJudgementError> {
        use somersault_integrators::system::System;
        let model = self.path().model();
        let duration = channels.duration;
        let mut w = system.workspace();
        let (q, v) = system.complete(&mut w, 0.0, start).map_err(DiveError::from)?;
        let full_start = model.state(q, v).map_err(DiveError::from)?;
        let n_root = model.velocities_of(0).len();
        let split = Split::all_but_root(model);
        let drive = |t: f64, _: &[f64], _: &[f64], a: &mut [f64]| channels.joints(t, 2, &mut a[n_root..]);
        let full = TreeSystem::new(model, ()).driven(split, drive).map_err(DiveError::from)?;
        let control = Adaptive { max_step: duration / 200.0, ..Adaptive::with_tolerances(1e-14, 1e-14) };
        let mut recorder = Recorder::new(0.0, &full_start, 1).with_dense_output();
        let end = Run::by_embedded_stepper(
            &full,
            &RungeKuttaMuntheKaas(Dop853),
            Steps::adapted((0.0, duration), control),
        )
        .observed_by(&mut (&mut recorder, token))
        .from(&full_start)?
        .state;
        if token.is_cancelled() {
            return Err(DiveJudgementError::Interrupted);
        }
        let mut velocities = vec![0.0; model.n_velocities()];
        model.joint_velocities(&end, &mut velocities).map_err(DiveError::from)?;
        let mut data = Data::new(model);
        let centroidal =
            model.centroidal(&mut data, end.configuration.as_slice()).map_err(DiveError::from)?;
        let found = centroidal.momentum(&velocities).map_err(DiveError::from)?.angular;
        let wanted = system.flight().take_off().angular_momentum;
        let scale = wanted.norm().max(self.momentum_of_joints(channels)?).max(1e-3 * self.momentum_unit());
        let drift = (found - wanted).norm() / scale;
        let is_planar = self.path().is_planar();
        // past the place of the root
        let first = if is_planar { 2 } else { 3 };
        Ok((Flown { is_planar, first, duration, solution: recorder.into_solution(), end }, drift))
    }
}

/// Orientation of the torso.
enum Attitude {
    /// In the plane, whole turns counted, rad.
    Angle(f64),
    Rotation(UnitQuaternion<f64>),
}

impl Attitude {
    /// The angle between them, rad.
    fn apart(&self, other: &Self) -> f64 {
        match (self, other) {
            (Self::Angle(a), Self::Angle(b)) => (a - b).abs(),
            (Self::Rotation(a), Self::Rotation(b)) => angle_between(a, b),
            (Self::Angle(_), Self::Rotation(_)) | (Self::Rotation(_), Self::Angle(_)) => f64::INFINITY,
        }
    }
}

/// A flight that was integrated.
struct Flown {
    is_planar: bool,
    /// Where its configurations have the orientation of the torso.
    first: usize,
    duration: f64,
    solution: Solution<Coordinates>,
    end: TreeState,
}

impl Flown {
    fn at(&self, fraction: f64) -> Result<Attitude, DiveError> {
        let within = (fraction < 1.0).then(|| self.solution.at(self.duration * fraction));
        let state = match within {
            Some(state) => state.ok_or_else(|| DiveError::Undefined("the integration ended early".into()))?,
            None => self.end.clone(),
        };
        let numbers = &state.configuration.as_slice()[self.first..];
        Ok(if self.is_planar {
            Attitude::Angle(numbers[0])
        } else {
            Attitude::Rotation(normalized_xyzw(numbers))
        })
    }
}

/// The joint motion by time.
struct Channels<'a> {
    motion: &'a SplineMotion,
    coefficients: &'a [f64],
    duration: f64,
}

impl Channels<'_> {
    /// Joint positions, velocities or accelerations.
    fn joints(&self, t: f64, derivative: usize, out: &mut [f64]) {
        let mut channels = vec![0.0; self.motion.n_channels()];
        self.motion.channels_into(self.coefficients, t / self.duration, derivative, &mut channels);
        let scale = self.duration.powi(-(derivative as i32));
        channels.iter_mut().for_each(|c| *c *= scale);
        if derivative == 0 {
            self.motion.base().positions_into(&channels, out);
        } else {
            self.motion.base().rates_into(&channels, out);
        }
    }
}

/// Why a dive could not be judged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DiveJudgementError {
    /// The dive itself.
    #[error(transparent)]
    Dive(#[from] DiveError),
    /// An integration.
    #[error(transparent)]
    Motion(#[from] IntegrateError),
    /// It was not to continue.
    #[error("the integration was interrupted")]
    Interrupted,
}
