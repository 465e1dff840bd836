//! What a dive is, judged by integrations that know nothing of how it was found.

use super::{DiveError, DiveProgram, PeakTorque};
use crate::attention::{Attention, GoOn};
use crate::flight::{BodyAngles, joints_active};
use crate::motion::SplineMotion;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use somersault_core::so3::angle_between;
use somersault_integrators::driver::Adaptive;
use somersault_integrators::methods::{Method, Options};
use somersault_integrators::solution::Recorder;
use somersault_multibody::Data;
use somersault_multibody::flight::{Flight, FlightSystem, TakeOff};
use somersault_multibody::motion::{MotionError, TreeMotion, TreeSystem};

/// A dive that was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DiveReport {
    /// L about the lateral axis, forward, kg m²/s.
    pub momentum: f64,
    /// T, s.
    pub duration: f64,
    /// Somersaults from the upright to the entry, by the reduced flight integrated to 1e-12 from start to end.
    pub somersaults: f64,
    /// Twists at the entry, likewise.
    pub twists: f64,
    /// Tilt at the entry, likewise, rad.
    pub tilt: f64,
    /// Angle of the body's long axis to the vertical at the entry, likewise, rad.
    pub entry_angle: f64,
    /// Greatest angle between that integration and the nodes of the program, rad.
    pub defect: f64,
    /// That angle at each node, rad.
    pub defects: Vec<f64>,
    /// What the full dynamics of the driven tree, integrated to 1e-14 without use of the reduction, changes the
    /// angular momentum by: |ΔL|/max(|L|, |h|, L₀/1000), where h is the largest momentum that the joints alone have at a
    /// node, with the torso at rest, and L₀ = m h²/(1 s). A dive with no momentum to speak of has that of its limbs for a
    /// scale.
    pub momentum_drift: f64,
    /// Angle between the orientations of full and reduced integration at the entry, rad.
    pub full_dynamics_defect: f64,
    /// Least channel at 1000 times.
    pub least_channel: f64,
    /// Greatest sum of channels at 1000 times.
    pub greatest_sum: f64,
    /// Least distance of limbs at 1000 times, m, and the limbs; none in the plane.
    pub least_distance: Option<(f64, [String; 2])>,
    /// The largest force of each joint at the nodes.
    pub peak_torques: Vec<PeakTorque>,
    /// Centre of mass at take-off, from the toes' end of the platform at the water's level, m.
    pub take_off: Vector3<f64>,
    /// Its velocity, m/s.
    pub take_off_velocity: Vector3<f64>,
}

/// Angle in rad, and momentum drift, that counts as agreement where nothing else is said.
pub const ALLOWED: f64 = 1e-3;

impl DiveReport {
    /// Whether both integrations agree with what was found: orientations to `allowed` rad at all nodes and at the entry, the
    /// angular momentum to this share of its scale.
    pub fn is_confirmed(&self, allowed: f64) -> bool {
        [self.defect, self.full_dynamics_defect, self.momentum_drift].iter().all(|x| *x <= allowed)
    }

    /// One sentence: what the dive is worth, given the angle that its use allows.
    pub fn sentence(&self, allowed: f64) -> String {
        let Self { defect, full_dynamics_defect: end, momentum_drift: drift, .. } = self;
        if self.is_confirmed(allowed) {
            format!(
                "The dive holds when integrated anew: defects ≤ {defect:.1e} rad, momentum to {drift:.1e}, full dynamics to {end:.1e} rad."
            )
        } else {
            format!(
                "The optimum lives off its discretisation: integrated anew it is up to {defect:.1e} rad away, the momentum drifts by {drift:.1e} and the full dynamics end {end:.1e} rad away."
            )
        }
    }
}

/// Times at which bounds are looked at.
const TIMES: usize = 1000;

impl DiveProgram {
    /// Judges the dive `z`.
    pub fn report(&self, z: &[f64]) -> Result<DiveReport, DiveJudgementError> {
        self.report_while(z, &mut || true)
    }

    /// The same for as long as `go_on`, which is asked at each step of the integrations; else
    /// [`DiveJudgementError::Interrupted`].
    pub fn report_while(&self, z: &[f64], go_on: GoOn<'_>) -> Result<DiveReport, DiveJudgementError> {
        let mut attention = Attention::new(go_on);
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
        let end = system.integrate_adaptive(
            Method::Rkmk8,
            Options::default(),
            &start,
            interval,
            &control,
            &mut (&mut recorder, &mut attention),
        )?;
        if attention.has_stopped {
            return Err(DiveJudgementError::Interrupted);
        }
        let solution = recorder.into_solution();
        let n_steps = program.path().n_steps();
        let mut defects = Vec::with_capacity(n_steps + 1);
        let mut orientations = Vec::with_capacity(n_steps + 1);
        let mut last_angle = first[0];
        for node in 0..=n_steps {
            let t = duration * node as f64 / n_steps as f64;
            let Some(state) = (if node == n_steps { Some(end.state.clone()) } else { solution.at(t) }) else {
                continue;
            };
            let numbers = state.configuration.as_slice();
            if is_planar {
                defects.push((numbers[0] - program.path().angles()[node]).abs());
                last_angle = numbers[0];
            } else {
                let orientation = quaternion(numbers);
                // as the path arrives: a restart changes it by less than the tolerance of the solver
                defects.push(angle_between(&orientation, program.path().arrival(node)));
                orientations.push(orientation);
            }
        }
        let tilt_of_axes = self.counting().axes.euler_angles().1;
        let angles = if is_planar {
            BodyAngles { somersault: tilt_of_axes - last_angle, ..BodyAngles::default() }
        } else {
            self.counting().along(&orientations).pop().unwrap_or_default()
        };
        let entry_angle = {
            let down = -(angles.somersault.cos() * angles.tilt.cos());
            let level = (1.0 - down * down).max(0.0).sqrt();
            level.atan2(down.abs())
        };
        let (momentum_drift, full_dynamics_defect) =
            self.full_dynamics(&system, &start, &end.state, &channels, &mut attention)?;
        let mut least_channel = f64::INFINITY;
        let mut greatest_sum = f64::NEG_INFINITY;
        let mut least_distance: Option<(f64, [&'static str; 2])> = None;
        let mut values = vec![0.0; motion.n_channels()];
        let mut q = model.neutral();
        let n_root = q.len() - motion.base().n_joints();
        let mut data = Data::new(model);
        for k in 0..TIMES {
            let share = k as f64 / (TIMES - 1) as f64;
            motion.channels_into(&coefficients, share, 0, &mut values);
            least_channel = values.iter().fold(least_channel, |least, w| least.min(*w));
            greatest_sum = greatest_sum.max(values.iter().sum());
            if let Some(clearance) = self.clearance() {
                motion.base().positions_into(&values, &mut q[n_root..]);
                let found = clearance.whole_body().nearest(model, &mut data, &q).map_err(DiveError::from)?;
                if least_distance.is_none_or(|(least, _)| found.0 < least) {
                    least_distance = Some(found);
                }
            }
        }
        Ok(DiveReport {
            momentum,
            duration,
            somersaults: angles.somersault / std::f64::consts::TAU,
            twists: angles.twist / std::f64::consts::TAU,
            tilt: angles.tilt,
            entry_angle,
            defect: defects.iter().copied().fold(0.0, f64::max),
            defects,
            momentum_drift,
            full_dynamics_defect,
            least_channel,
            greatest_sum,
            least_distance: least_distance.map(|(distance, limbs)| (distance, limbs.map(str::to_owned))),
            peak_torques: self.motion(z)?.peak_torques(model),
            take_off,
            take_off_velocity,
        })
    }

    /// Centre of mass and its velocity at take-off: feet on the platform's end at the start, hands at the water's level
    /// at the entry distance at the finish.
    pub(super) fn ballistics(
        &self,
        program: &Self,
        coefficients: &[f64],
        duration: f64,
    ) -> Result<(Vector3<f64>, Vector3<f64>), DiveError> {
        let (model, motion) = (self.path().model(), self.path().motion());
        let mut data = Data::new(model);
        let mut from = |share: f64, node: usize, part: &[&str]| -> Result<Vector3<f64>, DiveError> {
            let mut q = model.neutral();
            let mut channels = vec![0.0; motion.n_channels()];
            motion.channels_into(coefficients, share, 0, &mut channels);
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
        let n_steps = program.path().n_steps();
        let start = Vector3::new(0.0, 0.0, self.dive().platform) + from(0.0, 0, feet)?;
        let finish = Vector3::new(self.dive().entry_distance, 0.0, 0.0) + from(1.0, n_steps, hands)?;
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

    /// Change of the momentum over its scale, and of the orientation at the end, by the full dynamics.
    fn full_dynamics<S: somersault_multibody::flight::ShapeMotion>(
        &self,
        system: &FlightSystem<'_, S>,
        start: &somersault_multibody::motion::TreeState,
        end: &somersault_multibody::motion::TreeState,
        channels: &Channels<'_>,
        attention: &mut Attention<'_>,
    ) -> Result<(f64, f64), DiveJudgementError> {
        use somersault_integrators::system::System;
        let model = self.path().model();
        let duration = channels.duration;
        let mut w = system.workspace();
        let (q, v) = system.complete(&mut w, 0.0, start).map_err(DiveError::from)?;
        let full_start = model.state(q, v).map_err(DiveError::from)?;
        let n_root = model.velocities_of(0).len();
        let split = joints_active(model);
        let drive = |t: f64, _: &[f64], _: &[f64], a: &mut [f64]| channels.joints(t, 2, &mut a[n_root..]);
        let full = TreeSystem::new(model, ()).driven(split, drive).map_err(DiveError::from)?;
        let control = Adaptive { max_step: duration / 200.0, ..Adaptive::with_tolerances(1e-14, 1e-14) };
        let full_end = full
            .integrate_adaptive(
                Method::Rkmk8,
                Options::default(),
                &full_start,
                (0.0, duration),
                &control,
                attention,
            )?
            .state;
        if attention.has_stopped {
            return Err(DiveJudgementError::Interrupted);
        }
        let mut velocities = vec![0.0; model.n_velocities()];
        model.joint_velocities(&full_end, &mut velocities).map_err(DiveError::from)?;
        let mut data = Data::new(model);
        let centroidal =
            model.centroidal(&mut data, full_end.configuration.as_slice()).map_err(DiveError::from)?;
        let found = centroidal.momentum(&velocities).map_err(DiveError::from)?.angular;
        let wanted = system.flight().take_off().angular_momentum;
        let scale = wanted.norm().max(self.momentum_of_joints(channels)?).max(1e-3 * self.momentum_unit());
        let drift = (found - wanted).norm() / scale;
        let numbers = full_end.configuration.as_slice();
        let off = if self.path().is_planar() {
            (numbers[2] - end.configuration.as_slice()[0]).abs()
        } else {
            angle_between(&quaternion(&numbers[3..7]), &quaternion(end.configuration.as_slice()))
        };
        Ok((drift, off))
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

fn quaternion(numbers: &[f64]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::new(numbers[3], numbers[0], numbers[1], numbers[2]))
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
    Motion(#[from] MotionError),
    /// It was not to go on.
    #[error("the integration was interrupted")]
    Interrupted,
}
