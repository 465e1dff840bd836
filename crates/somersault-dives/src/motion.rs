//! What a dive looks like: its states at the nodes of its path.

use crate::{DiveError, DiveProgram};
use nalgebra::Vector3;
use somersault_multibody::counting::BodyAngles;
use somersault_multibody::flight::{Flight, FlightData, TakeOff};
use somersault_multibody::{Data, Model, Split};

/// A dive at equidistant times from take-off to entry, rows one after the other.
#[derive(Debug, Clone, PartialEq)]
pub struct DiveMotion {
    /// s.
    pub times: Vec<f64>,
    /// Configurations q; the origin is at the water's level below the end of the platform.
    pub positions: Vec<f64>,
    /// Velocities v.
    pub velocities: Vec<f64>,
    /// Accelerations of all degrees of freedom.
    pub accelerations: Vec<f64>,
    /// Joint forces that the motion takes, N m, of all degrees of freedom: zero for those of the root.
    pub torques: Vec<f64>,
    /// Weights of the postures but the fundamental one, or joints.
    pub channels: Vec<f64>,
    /// Their rates, 1/s.
    pub channel_rates: Vec<f64>,
    /// Somersault, tilt and twist, rad, whole turns counted.
    pub angles: Vec<BodyAngles>,
    /// Their rates, rad/s.
    pub angle_rates: Vec<BodyAngles>,
    /// About the centre of mass, world axes, kg m²/s: of q and v, not of what the path was made with.
    pub angular_momentum: Vec<Vector3<f64>>,
}

/// The largest force of a joint in a dive.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PeakTorque {
    /// The body that the joint transports.
    pub joint: String,
    /// With its sign, N m.
    pub torque: f64,
    /// When, s.
    pub time: f64,
}

impl DiveMotion {
    /// For each joint of `model`, the diver of this motion, the largest force at the times of the motion.
    pub fn peak_torques(&self, model: &Model) -> Vec<PeakTorque> {
        let n = model.n_velocities();
        let mut peaks = Vec::with_capacity(n);
        for (body, link) in model.links().iter().enumerate().skip(1) {
            for dof in model.velocities_of(body) {
                let joint = link.name().to_owned();
                let mut peak = PeakTorque { joint, torque: 0.0, time: 0.0 };
                for (time, torques) in self.times.iter().zip(self.torques.chunks_exact(n)) {
                    if torques[dof].abs() > peak.torque.abs() {
                        (peak.torque, peak.time) = (torques[dof], *time);
                    }
                }
                peaks.push(peak);
            }
        }
        peaks
    }
}

impl DiveProgram {
    /// The motion that `z` is.
    pub fn motion(&self, z: &[f64]) -> Result<DiveMotion, DiveError> {
        let mut program = self.clone();
        program.fly(z, false)?;
        let (path, duration, coefficients) = (program.path(), self.duration(z), self.coefficients(z));
        let (model, motion) = (path.model(), path.motion());
        let (center_of_mass, velocity) = self.ballistics(&program, &coefficients, duration)?;
        let angular_momentum = Vector3::new(0.0, self.momentum(z), 0.0);
        let take_off = TakeOff { time: 0.0, center_of_mass, velocity, angular_momentum };
        let flight = Flight::try_new(model, take_off)?;
        let (mut room, mut data) = (FlightData::new(model), Data::new(model));
        let (mut q, mut v) = (model.neutral(), vec![0.0; model.n_velocities()]);
        let (mut acceleration, mut torque) = (v.clone(), v.clone());
        let split = Split::all_but_root(model);
        let n_joints = motion.base().n_joints();
        let (q_root, v_root) = (q.len() - n_joints, v.len() - n_joints);
        let mut channels = vec![0.0; motion.n_channels()];
        let mut found = DiveMotion {
            times: Vec::new(),
            positions: Vec::new(),
            velocities: Vec::new(),
            accelerations: Vec::new(),
            torques: Vec::new(),
            channels: Vec::new(),
            channel_rates: Vec::new(),
            angles: self.angles(z)?,
            angle_rates: Vec::new(),
            angular_momentum: Vec::new(),
        };
        for node in 0..=path.n_steps() {
            let fraction = node as f64 / path.n_steps() as f64;
            motion.channels_into(&coefficients, fraction, 0, &mut channels);
            motion.base().positions_into(&channels, &mut q[q_root..]);
            found.channels.extend_from_slice(&channels);
            motion.channels_into(&coefficients, fraction, 1, &mut channels);
            channels.iter_mut().for_each(|rate| *rate /= duration);
            motion.base().rates_into(&channels, &mut v[v_root..]);
            found.channel_rates.extend_from_slice(&channels);
            if path.is_planar() {
                q[2] = path.angles()[node];
            } else {
                q[3..7].copy_from_slice(path.arrival(node).coords.as_slice());
            }
            flight.complete(&mut room, duration * fraction, &mut q, &mut v)?;
            motion.channels_into(&coefficients, fraction, 2, &mut channels);
            channels.iter_mut().for_each(|rate| *rate /= duration * duration);
            motion.base().rates_into(&channels, &mut acceleration[v_root..]);
            torque.fill(0.0);
            model.hybrid_dynamics(&mut data, &split, &q, &v, &mut acceleration, &mut torque, &[])?;
            found.accelerations.extend_from_slice(&acceleration);
            found.torques.extend_from_slice(&torque);
            found.angle_rates.push(if path.is_planar() {
                BodyAngles { somersault: -v[2], ..BodyAngles::default() }
            } else {
                self.counting().rates(path.arrival(node), &Vector3::new(v[3], v[4], v[5]))
            });
            found.angular_momentum.push(model.centroidal(&mut data, &q)?.momentum(&v)?.angular);
            found.times.push(duration * fraction);
            found.positions.extend_from_slice(&q);
            found.velocities.extend_from_slice(&v);
        }
        Ok(found)
    }
}
