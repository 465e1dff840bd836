//! States of a tree, and the rates of its coordinates for the velocities of its joints.
//!
//! The two differ in the linear part u of planar and free joints only: v = Rᵀu, with R the orientation
//! of the child in the joint frame and ω its angular velocity in child axes, hence u̇ = R(v̇ + ω × v).

use crate::coordinates::{Coordinates, Factor, Layout, Rates};
use crate::error::DynamicsError;
use crate::joint::{Group, Joint, JointKind, Turning};
use crate::model::{Body, Model, Place};
use crate::spatial::{Force, Motion};
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::argument::expect_length;
use somersault_core::lie::so3::from_xyzw;
use somersault_integrators::state::State;
use somersault_integrators::variation::Tangent;

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
        self.rates_of(&q, &mut rates);
        let (configuration, rate) = Layout::new(self.factors()).state(q, rates);
        Ok(State { configuration, rate })
    }

    /// The factors of the group of positions, in the order of q.
    pub(crate) fn factors(&self) -> impl Iterator<Item = Factor> {
        self.own_joints().flat_map(factors)
    }

    /// Turns joint velocities into rates; lengths must fit.
    pub(crate) fn rates_of(&self, q: &[f64], v: &mut [f64]) {
        self.turn_linear_parts(q, v, |turn, part, _| turn * part);
    }

    /// Turns rates into joint velocities; lengths must fit.
    pub(crate) fn joint_velocities_of(&self, q: &[f64], rates: &mut [f64]) {
        self.turn_linear_parts(q, rates, |turn, part, _| turn.inverse() * part);
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
        self.joint_velocities_of(q, out);
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

    /// The tangent (δq, δp) to a state in which the joints move by `way`, along q ⊕ ε e_k, and their velocities change by
    /// `change`.
    pub fn tangent(
        &self,
        x: &TreeState,
        way: &[f64],
        change: &[f64],
    ) -> Result<Tangent<Rates>, DynamicsError> {
        let (n, q) = (self.n_velocities(), x.configuration.as_slice());
        expect_length("way", way.len(), n)?;
        expect_length("change", change.len(), n)?;
        let mut v = vec![0.0; n];
        self.joint_velocities(x, &mut v)?;
        let [mut displacement, mut rate] = [way, change].map(|numbers| {
            let mut out = x.rate.clone();
            out.as_mut_slice().copy_from_slice(numbers);
            out
        });
        self.turn_linear_parts(q, displacement.as_mut_slice(), |turn, part, _| turn * part);
        self.turn_linear_parts(q, rate.as_mut_slice(), |turn, part, (body, place)| {
            let [moved, velocity] =
                [way, &v].map(|numbers| self.own_motion(body, &numbers[place.dofs.clone()]));
            turn * (part + moved.angular.cross(&velocity.linear))
        });
        Ok(Tangent { displacement, rate })
    }

    /// The motion of the joints and the change of their velocities along a tangent (δq, δp) to a state: the inverse of
    /// [`tangent`](Self::tangent).
    pub fn joint_tangent(
        &self,
        x: &TreeState,
        tangent: (&Rates, &Rates),
    ) -> Result<[Vec<f64>; 2], DynamicsError> {
        let mut v = vec![0.0; self.n_velocities()];
        self.joint_velocities(x, &mut v)?;
        expect_length("displacement", tangent.0.as_slice().len(), v.len())?;
        expect_length("rate", tangent.1.as_slice().len(), v.len())?;
        let (mut way, mut change) = (v.clone(), v.clone());
        self.joint_tangent_into((x.configuration.as_slice(), &v), tangent, (&mut way, &mut change));
        Ok([way, change])
    }

    /// The same in a state of joint velocities `v`; lengths must fit.
    pub(crate) fn joint_tangent_into(
        &self,
        (q, v): (&[f64], &[f64]),
        (displacement, rate): (&Rates, &Rates),
        (way, change): (&mut [f64], &mut [f64]),
    ) {
        way.copy_from_slice(displacement.as_slice());
        self.turn_linear_parts(q, way, |turn, part, _| turn.inverse() * part);
        change.copy_from_slice(rate.as_slice());
        self.turn_linear_parts(q, change, |turn, part, (body, place)| {
            let [moved, velocity] =
                [&*way, v].map(|numbers| self.own_motion(body, &numbers[place.dofs.clone()]));
            turn.inverse() * part - moved.angular.cross(&velocity.linear)
        });
    }

    /// out ← the change of [`second_rates`](Self::second_rates) at `v` and `a` along a motion of the joints and changes of v
    /// and a; lengths must fit.
    pub(crate) fn second_rates_change(
        &self,
        q: &[f64],
        (v, a): (&[f64], &[f64]),
        (way, rate, change): (&[f64], &[f64], &[f64]),
        out: &mut [f64],
    ) {
        out.copy_from_slice(change);
        self.turn_linear_parts(q, out, |turn, part, (body, place)| {
            let [velocity, acceleration, moved, faster] =
                [v, a, way, rate].map(|numbers| self.own_motion(body, &numbers[place.dofs.clone()]));
            let whole = acceleration.linear + velocity.angular.cross(&velocity.linear);
            let gained = faster.angular.cross(&velocity.linear) + velocity.angular.cross(&faster.linear);
            turn * (part + gained + moved.angular.cross(&whole))
        });
    }

    /// out ← the displacement by a motion of the joints; lengths must fit.
    pub(crate) fn displacement_into(&self, q: &[f64], way: &[f64], out: &mut Rates) {
        out.as_mut_slice().copy_from_slice(way);
        self.turn_linear_parts(q, out.as_mut_slice(), |turn, part, _| turn * part);
    }

    /// The transpose of [`joint_tangent_into`](Self::joint_tangent_into): adds to `displacement` and `rate` the covectors on the motion of
    /// the joints and on the change of their velocities, pulled back to a tangent to the state; lengths must fit.
    pub(crate) fn pull_joint_tangent(
        &self,
        (q, v): (&[f64], &[f64]),
        (way, change): (&mut [f64], &mut [f64]),
        (displacement, rate): (&mut Rates, &mut Rates),
    ) {
        for (turn, body, place) in self.turned_joints(q) {
            let dofs = place.dofs.clone();
            let [of_way, of_change] =
                [&*way, &*change].map(|numbers| self.own_motion(body, &numbers[dofs.clone()]));
            let linear = of_change.linear;
            let velocity = self.own_motion(body, &v[dofs.clone()]).linear;
            let turned = Force::new(turn * of_way.linear, of_way.angular - velocity.cross(&linear));
            self.write_own_covector(body, &turned, &mut way[dofs.clone()]);
            let turned = Force::new(turn * linear, of_change.angular);
            self.write_own_covector(body, &turned, &mut change[dofs]);
        }
        for (out, found) in [(displacement, way), (rate, change)] {
            out.as_mut_slice().iter_mut().zip(&*found).for_each(|(out, x)| *out += x);
        }
    }

    /// The transpose of [`second_rates_change`](Self::second_rates_change): pulls a covector on the rates of the rates back to a motion of
    /// the joints and the changes of v and a; lengths must fit.
    pub(crate) fn pull_second_rates_change(
        &self,
        q: &[f64],
        (v, a): (&[f64], &[f64]),
        covector: &[f64],
        [way, rate, change]: [&mut [f64]; 3],
    ) {
        way.fill(0.0);
        rate.fill(0.0);
        change.copy_from_slice(covector);
        for (turn, body, place) in self.turned_joints(q) {
            let dofs = place.dofs.clone();
            let [velocity, acceleration, of_change] =
                [v, a, covector].map(|numbers| self.own_motion(body, &numbers[dofs.clone()]));
            let part = turn.inverse() * of_change.linear;
            let whole = acceleration.linear + velocity.angular.cross(&velocity.linear);
            let of_way = Force::new(Vector3::zeros(), whole.cross(&part));
            let of_rate = Force::new(part.cross(&velocity.angular), velocity.linear.cross(&part));
            self.write_own_covector(body, &of_way, &mut way[dofs.clone()]);
            self.write_own_covector(body, &of_rate, &mut rate[dofs.clone()]);
            self.write_own_covector(body, &Force::new(part, of_change.angular), &mut change[dofs]);
        }
    }

    /// The planar and free joints with the rotations of their bodies.
    fn turned_joints<'a>(
        &'a self,
        q: &'a [f64],
    ) -> impl Iterator<Item = (UnitQuaternion<f64>, &'a Body<f64>, &'a Place)> {
        self.bodies.iter().zip(&self.places).zip(self.links()).filter_map(|((body, place), link)| {
            let kind = link.joint.kind();
            let orientation = place.q.start + kind.n_linear;
            let turn = match kind.group() {
                Group::Vector | Group::Rotations => return None,
                Group::PlanarMotions => UnitQuaternion::from_axis_angle(&Vector3::z_axis(), q[orientation]),
                Group::Motions => from_xyzw(&q[orientation..]),
            };
            Some((turn, body, place))
        })
    }

    /// Replaces the linear part of every planar and free joint by `map`(R, part, body).
    fn turn_linear_parts(
        &self,
        q: &[f64],
        numbers: &mut [f64],
        map: impl Fn(&UnitQuaternion<f64>, Vector3<f64>, (&Body<f64>, &Place)) -> Vector3<f64>,
    ) {
        for (turn, body, place) in self.turned_joints(q) {
            let Motion { linear, angular } = self.own_motion(body, &numbers[place.dofs.clone()]);
            let mapped = Force::new(map(&turn, linear, (body, place)), angular);
            self.write_own_covector(body, &mapped, &mut numbers[place.dofs.clone()]);
        }
    }

    /// numbers ← a covector on the motion of a joint, by its degrees of freedom.
    fn write_own_covector(&self, body: &Body<f64>, covector: &Force<f64>, numbers: &mut [f64]) {
        for (number, direction) in numbers.iter_mut().zip(&self.directions[body.dofs.clone()]) {
            *number = direction.dot(covector);
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
