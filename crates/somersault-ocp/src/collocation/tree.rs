//! Trees of bodies as equations of motion.
//!
//! x = (q, v), u the joint forces of the actuated degrees of freedom: q̇ = N(q) v, v̇ = a from forward dynamics, with q as the
//! model has it, quaternions included. Of a quaternion forward dynamics sees the direction, and N keeps its norm. Jacobians
//! are the analytic partials of the tree. With inverse dynamics τ = ID(q, v, a) the Hessian of μᵀa is
//!
//! ```text
//! −Sᵀ ∇²(wᵀ ID) S,   w = M⁻¹ μ,   S = ∂(q, v, a)/∂(q, v, u)
//! ```
//! whose inner part is the derivatives of the partials of inverse dynamics along several directions at a time: exact, one direction
//! for each position and velocity. Derivatives along q ⊕ ε become derivatives by the numbers of q joint by joint.
//!
//! As expressions the equations are forward dynamics over [`Traced`] numbers: a tree is data, so that its graph is that of the recursions
//! without what is multiplied by zeros of its axes.

use super::error::{CollocationError, Untraced};
use super::function::{VectorFunction, arguments};
use super::quaternions::{WIDTH, normalize};
use nalgebra::DMatrix;
use num_dual::{Dual64, HyperDual64};
use somersault_core::Scalar;
use somersault_expr::{ExprFunction, Traced};
use somersault_multibody::{
    Data, DerivativeData, DynamicsError, Group, Model, Partials, SecondDerivativeData, Turning,
};
use somersault_nlp::EvaluationError;
use std::ops::Range;

/// Numbers of a joint in q or v, at most.
const MOST: usize = 7;

/// Forward dynamics of a tree.
#[derive(Debug, Clone)]
pub struct TreeDynamics {
    actuated: Vec<usize>,
    model: Model,
    data: Data,
    derivatives: DerivativeData,
    torque: Vec<f64>,
    coordinates: Coordinates,
    /// q with quaternions of unit norm.
    unit: Vec<f64>,
    second: SecondDerivativeData,
    /// a, while derivatives of the partials are found.
    acceleration: Vec<f64>,
    /// Rows of (dq, dv, da), one for each number of x.
    directions: Vec<f64>,
    second_rows: Vec<f64>,
    /// The model over dual numbers, for the norm of quaternions, and q along one direction.
    dual: Model<Dual64>,
    dual_q: Vec<Dual64>,
    /// ∂a by q, v, u.
    slopes: DMatrix<f64>,
    /// w.
    lever: Vec<f64>,
    /// Second derivatives by each number of q and the one that moves.
    direct: Vec<f64>,
}

/// How numbers of q and v belong together.
#[derive(Debug, Clone)]
struct Coordinates {
    n_positions: usize,
    n_velocities: usize,
    /// Of each number of q whose rate is a number of v, that one.
    rate_of: Vec<Option<usize>>,
    /// The joints of which that is not so.
    groups: Vec<GroupJoint>,
}

/// A joint whose displacements are not added.
#[derive(Debug, Clone)]
struct GroupJoint {
    group: Group,
    q: Range<usize>,
    v: Range<usize>,
    /// The orientation, within q.
    orientation: Range<usize>,
}

impl Coordinates {
    fn new(model: &Model) -> Self {
        let (n_positions, n_velocities) = (model.n_positions(), model.n_velocities());
        let (mut rate_of, mut groups) = (vec![None; n_positions], Vec::new());
        for (body, link) in model.links().iter().enumerate() {
            let (kind, q, v) = (link.joint().kind(), model.positions_of(body), model.velocities_of(body));
            match kind.group() {
                Group::Vector => q.zip(v).for_each(|(q, v)| rate_of[q] = Some(v)),
                group => {
                    let orientation = q.start + kind.orientation().start..q.start + kind.orientation().end;
                    groups.push(GroupJoint { group, q, v, orientation });
                }
            }
        }
        Self { n_positions, n_velocities, rate_of, groups }
    }

    fn n_states(&self) -> usize {
        self.n_positions + self.n_velocities
    }

    /// ∂v̇ₖ by all arguments, into row `k` of `out` from row `first` on.
    fn store_row(
        &self,
        partials: &Partials<'_>,
        actuated: &[usize],
        q: &[f64],
        k: usize,
        first: usize,
        out: &mut DMatrix<f64>,
    ) {
        let row = first + k;
        for (j, rate) in self.rate_of.iter().enumerate() {
            if let Some(rate) = rate {
                out[(row, j)] = partials.q[(k, *rate)];
            }
        }
        for joint in &self.groups {
            let (mut along, mut by) = ([0.0; MOST], [0.0; MOST]);
            let (n, m) = (joint.v.len(), joint.q.len());
            along.iter_mut().zip(joint.v.clone()).for_each(|(to, v)| *to = partials.q[(k, v)]);
            joint.group.derivatives_by_numbers(&q[joint.q.clone()], &along[..n], &mut by[..m]);
            joint.q.clone().zip(by).for_each(|(j, by)| out[(row, j)] = by);
        }
        for j in 0..self.n_velocities {
            out[(row, self.n_positions + j)] = partials.v[(k, j)];
        }
        for (j, &dof) in actuated.iter().enumerate() {
            out[(row, self.n_states() + j)] = partials.input[(k, dof)];
        }
    }
}

impl GroupJoint {
    /// Numbers of the joint among the arguments on which its rates depend in a nonlinear way: the orientation, then v, with their
    /// places in the joint and among all arguments.
    fn places(&self, n_positions: usize) -> impl Iterator<Item = (usize, usize)> {
        let (first, n, v) = (self.q.start, self.q.len(), self.v.start);
        let of_q = self.orientation.clone().map(move |i| (i - first, i));
        of_q.chain(self.v.clone().map(move |i| (n + i - v, n_positions + i)))
    }

    /// The rates N(q) v over another scalar that carries derivatives by the numbers of q and v; `seed` says which.
    fn rates<T: Scalar>(&self, q: &[f64], v: &[f64], mut seed: impl FnMut(usize, &mut T)) -> [T; MOST] {
        let mut numbers = [T::zero(); 2 * MOST];
        let given = q[self.q.clone()].iter().chain(&v[self.v.clone()]);
        for (i, (number, given)) in numbers.iter_mut().zip(given).enumerate() {
            *number = nalgebra::convert(*given);
            seed(i, number);
        }
        let (n, m) = (self.q.len(), self.v.len());
        let mut rates = [T::zero(); MOST];
        self.group.position_rates(&numbers[..n], &numbers[n..n + m], &mut rates[..n]);
        rates
    }
}

impl TreeDynamics {
    /// The tree with forces at the degrees of freedom `actuated`, in the order of the controls.
    pub fn try_new(model: &Model, actuated: &[usize]) -> Result<Self, CollocationError> {
        let n = model.n_velocities();
        for (i, &k) in actuated.iter().enumerate() {
            if k >= n || actuated[..i].contains(&k) {
                return Err(CollocationError::Actuated { n, found: k });
            }
        }
        let dual: Model<Dual64> = model.cast();
        let coordinates = Coordinates::new(model);
        let (n_positions, n_states) = (model.n_positions(), coordinates.n_states());
        Ok(Self {
            actuated: actuated.to_vec(),
            data: Data::new(model),
            derivatives: DerivativeData::new(model),
            torque: vec![0.0; n],
            unit: vec![0.0; n_positions],
            second: SecondDerivativeData::default(),
            acceleration: vec![0.0; n],
            directions: vec![0.0; n_states * (n_states + n)],
            second_rows: vec![0.0; (n_states + 1) * 3 * n],
            dual_q: vec![Dual64::from_re(0.0); n_positions],
            slopes: DMatrix::zeros(n, n_states + actuated.len()),
            direct: vec![0.0; n_positions],
            coordinates,
            lever: vec![0.0; n],
            dual,
            model: model.clone(),
        })
    }

    /// Every degree of freedom actuated.
    pub fn try_fully_actuated(model: &Model) -> Result<Self, CollocationError> {
        let all: Vec<usize> = (0..model.n_velocities()).collect();
        Self::try_new(model, &all)
    }

    /// The tree.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The degrees of freedom with a force, in the order of the controls.
    pub fn actuated(&self) -> &[usize] {
        &self.actuated
    }

    /// Length of x.
    pub fn n_states(&self) -> usize {
        self.coordinates.n_states()
    }

    /// Length of u.
    pub fn n_controls(&self) -> usize {
        self.actuated.len()
    }

    /// Where x has a quaternion (x, y, z, w): the number of the first entry of each.
    pub fn quaternions(&self) -> Vec<usize> {
        let bodies = 0..self.model.n_bodies();
        bodies.filter_map(|body| self.model.quaternion_of(body)).map(|found| found.start).collect()
    }

    /// States, then controls, that are entries of one vector, in m, rad, or their rates: they are of one size.
    pub(super) fn vectors(&self) -> [Vec<Vec<usize>>; 2] {
        let (mut states, mut controls) = (Vec::new(), Vec::new());
        let n = self.coordinates.n_positions;
        for GroupJoint { q, v, orientation, .. } in &self.coordinates.groups {
            let middle = v.start + orientation.start - q.start;
            states.push((q.start..orientation.start).collect());
            for part in [v.start..middle, middle..v.end] {
                states.push(part.clone().map(|i| n + i).collect());
                let forces = self.actuated.iter().enumerate().filter(|(_, dof)| part.contains(dof));
                controls.push(forces.map(|(i, _)| i).collect());
            }
        }
        [states, controls]
    }

    /// Brings those quaternions of x to unit norm all of whose entries are given.
    pub fn normalize_given(&self, x: &mut [f64], is_given: impl Fn(usize) -> bool) {
        let given: Vec<usize> = self.quaternions();
        let given = given.into_iter().filter(|&first| (first..first + WIDTH).all(&is_given));
        normalize(&given.collect::<Vec<_>>(), x);
    }

    /// What each entry of x is: `q_` or `v_` with the body that a joint moves. Of a joint with several entries of q follow `px`, `py`, `pz`
    /// for its position, `x`, `y`, `z`, `w` for its quaternion, `angle` for its angle; of v a number.
    pub fn state_names(&self) -> Vec<String> {
        let positions = self.named(|body| {
            let kind = self.model.joint(body).map(|joint| joint.kind());
            let n_linear = kind.map_or(0, |kind| kind.n_linear);
            let turning: &[&str] = match kind.map(|kind| kind.turning) {
                None | Some(Turning::None) => &[],
                Some(Turning::Angle) => &["angle"],
                Some(Turning::Rotation) => &["x", "y", "z", "w"],
            };
            let all = ["px", "py", "pz"].iter().take(n_linear).chain(turning);
            let several = self.model.positions_of(body).len() > 1;
            let of_body = self.model.positions_of(body).zip(all);
            of_body.map(|(_, part)| several.then(|| (*part).to_owned())).collect()
        });
        let rates = self.degrees_of_freedom();
        let named = [("q", positions), ("v", rates)];
        named.iter().flat_map(|(kind, all)| all.iter().map(move |name| format!("{kind}_{name}"))).collect()
    }

    /// What each entry of u is: `u_` with the body that the joint moves, and a number after it where a joint has several.
    pub fn control_names(&self) -> Vec<String> {
        let bodies = self.degrees_of_freedom();
        self.actuated.iter().map(|k| format!("u_{}", bodies[*k])).collect()
    }

    fn degrees_of_freedom(&self) -> Vec<String> {
        self.named(|body| match self.model.velocities_of(body).len() {
            1 => vec![None],
            n => (0..n).map(|k| Some(k.to_string())).collect(),
        })
    }

    /// Names of bodies with their parts, as parts of names of variables; numbers where that is no name for each.
    fn named(&self, parts: impl Fn(usize) -> Vec<Option<String>>) -> Vec<String> {
        let mut names = Vec::new();
        for body in 0..self.model.n_bodies() {
            let name = self.model.name(body).unwrap_or_default();
            let name: String =
                name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
            names.extend(
                parts(body)
                    .into_iter()
                    .map(|part| part.map_or_else(|| name.clone(), |part| format!("{name}_{part}"))),
            );
        }
        let mut sorted = names.clone();
        sorted.sort();
        if sorted.windows(2).any(|pair| pair[0] == pair[1]) {
            names.iter_mut().enumerate().for_each(|(k, name)| *name = k.to_string());
        }
        names
    }

    /// q as forward dynamics takes it.
    fn normalize(&mut self, q: &[f64]) -> Result<(), EvaluationError> {
        self.unit.copy_from_slice(q);
        self.model.normalize(&mut self.unit).map_err(undefined)
    }
}

/// q, v and the joint forces of all degrees of freedom.
fn split<'a, T: Scalar>(
    coordinates: &Coordinates,
    arguments: &'a [T],
    actuated: &[usize],
    torque: &mut [T],
) -> (&'a [T], &'a [T]) {
    let (state, control) = arguments.split_at(coordinates.n_states());
    for (u, &dof) in control.iter().zip(actuated) {
        torque[dof] = *u;
    }
    state.split_at(coordinates.n_positions)
}

/// A tree that cannot accelerate has no value there.
fn undefined(error: DynamicsError) -> EvaluationError {
    EvaluationError::Undefined { what: error.to_string() }
}

/// Numbers of q of which the one at `j` moves.
fn seed(dual: &mut [Dual64], q: &[f64], j: usize) {
    for (k, (dual, &re)) in dual.iter_mut().zip(q).enumerate() {
        *dual = Dual64::new(re, f64::from(u8::from(k == j)));
    }
}

impl VectorFunction for TreeDynamics {
    fn n_outputs(&self) -> usize {
        self.n_states()
    }

    fn evaluate(&mut self, arguments: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        let (q, v) = split(&self.coordinates, arguments, &self.actuated, &mut self.torque);
        self.normalize(q)?;
        let a = self.model.forward_dynamics(&mut self.data, &self.unit, v, &self.torque, &[]);
        let (rates, accelerations) = values.split_at_mut(q.len());
        accelerations.copy_from_slice(a.map_err(undefined)?);
        self.model.position_rates(q, v, rates).map_err(undefined)
    }

    fn jacobian(&mut self, arguments: &[f64], jacobian: &mut DMatrix<f64>) -> Result<(), EvaluationError> {
        let (q, v) = split(&self.coordinates, arguments, &self.actuated, &mut self.torque);
        self.normalize(q)?;
        let Self { model, derivatives, unit, torque, coordinates, actuated, .. } = self;
        let partials =
            model.forward_dynamics_partials(derivatives, unit, v, torque, &[]).map_err(undefined)?;
        jacobian.fill(0.0);
        let n = coordinates.n_positions;
        for (i, rate) in coordinates.rate_of.iter().enumerate() {
            if let Some(rate) = rate {
                jacobian[(i, n + rate)] = 1.0;
            }
        }
        for joint in &coordinates.groups {
            for (place, argument) in joint.places(n) {
                let seed = |i: usize, number: &mut Dual64| number.eps = f64::from(i == place);
                let rates = joint.rates::<Dual64>(q, v, seed);
                joint.q.clone().zip(rates).for_each(|(i, rate)| jacobian[(i, argument)] = rate.eps);
            }
        }
        for k in 0..coordinates.n_velocities {
            coordinates.store_row(&partials, actuated, q, k, n, jacobian);
        }
        Ok(())
    }

    fn expressions(&self, at: &[f64]) -> Result<ExprFunction, Untraced> {
        let Self { model, coordinates, actuated, .. } = self;
        let model: Model<Traced> = model.cast();
        ExprFunction::record(arguments(at.len()), at, |inputs| {
            let mut torque = vec![nalgebra::convert(0.0); model.n_velocities()];
            let (q, v) = split(coordinates, inputs, actuated, &mut torque);
            let mut values = vec![nalgebra::convert(0.0); q.len()];
            model.position_rates(q, v, &mut values)?;
            let mut unit = q.to_vec();
            model.normalize(&mut unit)?;
            values.extend(model.forward_dynamics(&mut Data::new(&model), &unit, v, &torque, &[])?);
            Ok(values)
        })
    }

    fn add_hessian(
        &mut self,
        arguments: &[f64],
        weights: &[f64],
        hessian: &mut DMatrix<f64>,
    ) -> Result<(), EvaluationError> {
        let (q, v) = split(&self.coordinates, arguments, &self.actuated, &mut self.torque);
        self.normalize(q)?;
        let Self { actuated, slopes, lever, coordinates, unit, acceleration, directions, .. } = self;
        let partials = self
            .model
            .forward_dynamics_partials(&mut self.derivatives, unit, v, &self.torque, &[])
            .map_err(undefined)?;
        let (n_positions, n, n_states) = (q.len(), v.len(), coordinates.n_states());
        for k in 0..n {
            coordinates.store_row(&partials, actuated, q, k, 0, slopes);
            lever[k] = (0..n).map(|i| partials.input[(i, k)] * weights[n_positions + i]).sum();
        }
        acceleration.copy_from_slice(partials.value);
        // accelerations are linear in the forces, so no force is moved
        for (j, direction) in directions.chunks_exact_mut(n_states + n).enumerate() {
            direction[..n_states].fill(0.0);
            direction[j] = 1.0;
            direction[n_states..].copy_from_slice(slopes.column(j).as_slice());
        }
        if !coordinates.groups.is_empty() {
            for (j, direction) in directions.chunks_exact_mut(n_states + n).take(n_positions).enumerate() {
                seed(&mut self.dual_q, q, j);
                self.dual.normalize(&mut self.dual_q).map_err(undefined)?;
                direction.iter_mut().zip(&self.dual_q).for_each(|(to, q)| *to = q.eps);
            }
        }
        self.model
            .inverse_dynamics_second_derivatives(
                &mut self.second,
                unit,
                v,
                acceleration,
                &[],
                lever,
                directions,
                &mut self.second_rows,
            )
            .map_err(undefined)?;
        let (of_state, rows) = self.second_rows.split_at(3 * n);
        for (j, row) in rows.chunks_exact(3 * n).enumerate() {
            let (by_q, rest) = row.split_at(n);
            let (by_v, by_a) = rest.split_at(n);
            for joint in coordinates.groups.iter().filter(|joint| joint.q.start <= j) {
                let (mut along, mut by) = ([Dual64::from_re(0.0); MOST], [Dual64::from_re(0.0); MOST]);
                for (to, v) in along.iter_mut().zip(joint.v.clone()) {
                    *to = Dual64::new(of_state[v], by_q[v]);
                }
                let (along, by) = (&along[..joint.v.len()], &mut by[..joint.q.len()]);
                seed(&mut self.dual_q, q, j);
                joint.group.derivatives_by_numbers(&self.dual_q[joint.q.clone()], along, by);
                self.direct[joint.q.clone()].iter_mut().zip(by).for_each(|(to, by)| *to = by.eps);
            }
            for i in (0..=j).chain(n_states..n_states + actuated.len()) {
                let direct = match i {
                    _ if i < n_positions => {
                        coordinates.rate_of[i].map_or_else(|| self.direct[i], |rate| by_q[rate])
                    }
                    _ if i < n_states => by_v[i - n_positions],
                    _ => 0.0,
                };
                let through: f64 = by_a.iter().zip(slopes.column(i).iter()).map(|(by, s)| by * s).sum();
                hessian[(i.min(j), i.max(j))] -= direct + through;
            }
        }
        for joint in &coordinates.groups {
            // numbers of the orientation come first, and nothing bends along two others
            for (first, row) in joint.places(n_positions).take(joint.orientation.len()) {
                for (second, column) in joint.places(n_positions).filter(|(_, column)| *column >= row) {
                    let seed = |i: usize, number: &mut HyperDual64| {
                        (number.eps1, number.eps2) = (f64::from(i == first), f64::from(i == second));
                    };
                    let rates = joint.rates::<HyperDual64>(q, v, seed);
                    let weights = &weights[joint.q.clone()];
                    hessian[(row, column)] +=
                        rates.iter().zip(weights).map(|(rate, w)| rate.eps1eps2 * w).sum::<f64>();
                }
            }
        }
        Ok(())
    }
}
