//! States of a tree, and the rates of its coordinates for the velocities of its joints.
//!
//! The two differ in the linear part u of planar and free joints only: v = Rᵀu, with R the orientation
//! of the child in the joint frame and ω its angular velocity in child axes, hence u̇ = R(v̇ + ω × v).

use crate::coordinates::{Coordinates, Factor, Layout, Rates};
use crate::error::DynamicsError;
use crate::joint::{Group, Joint, JointKind, Turning};
use crate::model::{Body, Model, Place};
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::argument::expect_length;
use somersault_core::lie::so3::from_xyzw;
use somersault_integrators::state::State;

/// Positions of a tree and their rates; see [`motion`](crate::motion).
pub type TreeState = State<Coordinates>;

impl Model {
    /// The state with positions `q` and joint velocities `v`, ready to be integrated. Quaternions are
    /// brought to unit norm.
    pub fn state(&self, q: &[f64], v: &[f64]) -> Result<TreeState, DynamicsError> {
        expect_length("v", v.len(), self.n_velocities())?;
        let mut q = q.to_vec();
        self.normalize(&mut q)?;
        let mut rates = v.to_vec();
        self.turn_linear_parts(&q, &mut rates, |turn, part, _| turn * part);
        let layout = Layout::new(self.own_joints().flat_map(factors));
        let (configuration, rate) = layout.state(q, rates);
        Ok(State { configuration, rate })
    }

    /// out ← v, the joint velocities of a state.
    pub fn joint_velocities(&self, x: &TreeState, out: &mut [f64]) -> Result<(), DynamicsError> {
        self.joint_velocities_at((&x.configuration, &x.rate), out)
    }

    /// The same of a state in its two parts.
    pub fn joint_velocities_at(
        &self,
        (q, p): (&Coordinates, &Rates),
        out: &mut [f64],
    ) -> Result<(), DynamicsError> {
        let (q, rates) = (q.as_slice(), p.as_slice());
        expect_length("positions of x", q.len(), self.n_positions())?;
        expect_length("rates of x", rates.len(), self.n_velocities())?;
        expect_length("out", out.len(), self.n_velocities())?;
        out.copy_from_slice(rates);
        self.turn_linear_parts(q, out, |turn, part, _| turn.inverse() * part);
        Ok(())
    }

    /// out ← the rates of the rates for joint velocities `v` and accelerations `a`; lengths must fit.
    pub(crate) fn second_rates(&self, q: &[f64], v: &[f64], a: &[f64], out: &mut [f64]) {
        out.copy_from_slice(a);
        self.turn_linear_parts(q, out, |turn, part, (body, place)| {
            let velocity = self.own_motion(body, &v[place.dofs.clone()]);
            turn * (part + velocity.angular.cross(&velocity.linear))
        });
    }

    /// Replaces the linear part of every planar and free joint by `map`(R, part, body).
    fn turn_linear_parts(
        &self,
        q: &[f64],
        numbers: &mut [f64],
        map: impl Fn(&UnitQuaternion<f64>, Vector3<f64>, (&Body<f64>, &Place)) -> Vector3<f64>,
    ) {
        for ((body, place), link) in self.bodies.iter().zip(&self.places).zip(self.links()) {
            let kind = link.joint.kind();
            let n_linear = kind.n_linear;
            let orientation = place.q.start + n_linear;
            let turn = match kind.group() {
                Group::Vector | Group::Rotations => continue,
                Group::PlanarMotions => UnitQuaternion::from_axis_angle(&Vector3::z_axis(), q[orientation]),
                Group::Motions => from_xyzw(&q[orientation..]),
            };
            let part = self.own_motion(body, &numbers[place.dofs.clone()]).linear;
            let mapped = map(&turn, part, (body, place));
            numbers[place.dofs.clone()][..n_linear].copy_from_slice(&mapped.as_slice()[..n_linear]);
        }
    }
}

/// The factors of the group of a joint, in the order of its numbers.
fn factors(joint: &Joint) -> impl Iterator<Item = Factor> {
    let JointKind { n_linear, turning, .. } = joint.kind();
    let turning = match turning {
        Turning::None => None,
        Turning::Angle => Some(Factor::Angle),
        Turning::Rotation => Some(Factor::Rotation),
    };
    (n_linear > 0).then_some(Factor::Linear(n_linear)).into_iter().chain(turning)
}
