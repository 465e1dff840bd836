//! The wrenches on several bodies at once.

use super::{ForceModel, Wrench};
use crate::body::RigidBody;
use crate::state::RigidBodyState;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use somersault_core::lanes::WIDEST;

/// Up to [`WIDEST`] bodies, each at a time and in a state of its own, each number of all of them side by side, as vector instructions take
/// them. Entries behind the last body are zero.
#[derive(Debug, Clone)]
pub struct StatesInLanes<'a> {
    bodies: &'a [&'a RigidBody],
    /// Times, s.
    pub times: [f64; WIDEST],
    /// Positions of the centres of mass, world axes, m.
    pub position: [[f64; WIDEST]; 3],
    /// Unit quaternions (x, y, z, w), body frame to world.
    pub orientation: [[f64; WIDEST]; 4],
    /// Velocities of the centres of mass, world axes, m/s.
    pub velocity: [[f64; WIDEST]; 3],
    /// Angular velocities, world axes, rad/s.
    pub angular_velocity: [[f64; WIDEST]; 3],
}

impl<'a> StatesInLanes<'a> {
    /// Of these bodies, the first [`WIDEST`] of them, with zeros for their states.
    pub fn new(bodies: &'a [&'a RigidBody]) -> Self {
        let zero = [0.0; WIDEST];
        Self {
            bodies: &bodies[..bodies.len().min(WIDEST)],
            times: zero,
            position: [zero; 3],
            orientation: [zero; 4],
            velocity: [zero; 3],
            angular_velocity: [zero; 3],
        }
    }

    /// The bodies.
    pub fn bodies(&self) -> &'a [&'a RigidBody] {
        self.bodies
    }

    /// The state of the body in a lane.
    pub fn state(&self, lane: usize) -> RigidBodyState {
        let vector = |rows: &[[f64; WIDEST]; 3]| Vector3::from(rows.each_ref().map(|row| row[lane]));
        let [x, y, z, w] = self.orientation.each_ref().map(|row| row[lane]);
        RigidBodyState::new(
            vector(&self.position),
            UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z)),
            vector(&self.velocity),
            vector(&self.angular_velocity),
        )
    }

    /// The body in a lane alone, in the first lane.
    pub fn alone(&self, lane: usize) -> Self {
        let mut alone = Self::new(&self.bodies[lane..=lane]);
        alone.times[0] = self.times[lane];
        let rows = [
            (&mut alone.position[..], &self.position[..]),
            (&mut alone.orientation, &self.orientation),
            (&mut alone.velocity, &self.velocity),
            (&mut alone.angular_velocity, &self.angular_velocity),
        ];
        for (to, from) in rows {
            to.iter_mut().zip(from).for_each(|(to, from)| to[0] = from[lane]);
        }
        alone
    }
}

/// Forces (N) on several bodies and torques about their centres of mass (N m), world axes, each component of all of them side by side.
#[derive(Debug, Clone, Default)]
pub struct WrenchesInLanes {
    /// N.
    pub force: [[f64; WIDEST]; 3],
    /// N m.
    pub torque: [[f64; WIDEST]; 3],
}

impl WrenchesInLanes {
    /// Adds one on the body in a lane.
    pub fn add(&mut self, lane: usize, wrench: &Wrench) {
        for i in 0..3 {
            self.force[i][lane] += wrench.force[i];
            self.torque[i][lane] += wrench.torque[i];
        }
    }

    /// What acts on the body in a lane.
    pub fn wrench(&self, lane: usize) -> Wrench {
        let vector = |rows: &[[f64; WIDEST]; 3]| Vector3::from(rows.each_ref().map(|row| row[lane]));
        Wrench { force: vector(&self.force), torque: vector(&self.torque) }
    }
}

/// Adds the wrenches of a model one after the other.
pub(crate) fn add_one_by_one(
    model: &(impl ForceModel + ?Sized),
    on: &StatesInLanes<'_>,
    sums: &mut WrenchesInLanes,
) {
    add_by_times(on, sums, |t| t, |t, body, x| model.wrench(*t, body, x));
}

/// Adds wrenches by something that depends on the time alone, which is found once for neighbours that are at the same time.
pub(crate) fn add_by_times<T>(
    on: &StatesInLanes<'_>,
    sums: &mut WrenchesInLanes,
    at: impl Fn(f64) -> T,
    wrench: impl Fn(&T, &RigidBody, &RigidBodyState) -> Wrench,
) {
    let mut known: Option<(f64, T)> = None;
    for (lane, body) in on.bodies.iter().enumerate() {
        let t = on.times[lane];
        let now = match known {
            Some((then, found)) if then == t => found,
            Some(_) | None => at(t),
        };
        sums.add(lane, &wrench(&now, body, &on.state(lane)));
        known = Some((t, now));
    }
}
