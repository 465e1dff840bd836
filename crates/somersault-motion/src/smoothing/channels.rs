//! The numbers by which a frame is described, and how a configuration moves along them.
//!
//! Linear numbers of a joint are added in its frame in the parent, angles are added, rotations are multiplied, R ⊕ φ = R exp φ. Those of a
//! root that moves freely are thus along the axes of the world, in which a body that nothing pushes keeps its velocity. Joints that no marker
//! sees have none.

use super::chain::Covariance;
use super::motion::Deviations;
use crate::noise::standard_deviation;
use nalgebra::{DMatrix, Matrix3, SMatrix, Vector3};
use somersault_core::lie::so3;
use somersault_multibody::{Model, Turning};
use std::ops::Range;

/// One number, or the three of a rotation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    /// First place in q.
    pub(super) position: usize,
    /// First of its numbers.
    pub(super) first: usize,
    pub(super) is_rotation: bool,
}

/// A joint whose linear numbers are along axes that it turns, in the model's velocities.
#[derive(Debug, Clone)]
struct Carried {
    positions: Range<usize>,
    velocities: Range<usize>,
    n_linear: usize,
    /// First of its linear numbers, and of those by which it turns.
    linear: usize,
    turning: usize,
}

/// The numbers of all joints that markers see.
#[derive(Debug, Clone)]
pub(super) struct Channels {
    pub(super) parts: Vec<Part>,
    carried: Vec<Carried>,
    /// The place in v of each number.
    velocities: Vec<usize>,
    /// Rotations about axes that no marker sees, of joints that turn about others that some sees.
    pub(super) is_vague: Vec<bool>,
    /// Limits that the model states.
    pub(super) limits: Vec<Option<[f64; 2]>>,
    n_velocities: usize,
}

/// A frame.
#[derive(Debug, Clone)]
pub(super) struct State {
    /// Configuration of the model.
    pub(super) q: Vec<f64>,
    /// First and second derivatives of the numbers.
    pub(super) rates: Vec<f64>,
    pub(super) accelerations: Vec<f64>,
    /// Correlated errors of the coordinates of all markers, over their standard deviations.
    pub(super) errors: Vec<f64>,
}

impl Channels {
    /// Those of `model`, of whose velocities some marker sees `seen`.
    pub(super) fn new(model: &Model, seen: &[bool]) -> Self {
        let mut found = Self {
            parts: Vec::new(),
            carried: Vec::new(),
            velocities: Vec::new(),
            is_vague: Vec::new(),
            limits: Vec::new(),
            n_velocities: model.n_velocities(),
        };
        for i in 0..model.n_bodies() {
            let Some(joint) = model.joint(i) else { continue };
            let kind = joint.kind();
            let (positions, velocities) = (model.positions_of(i), model.velocities_of(i));
            let turns_axes = kind.n_linear > 1 && kind.turning != Turning::None;
            let is_seen = |k: usize| seen[velocities.start + k];
            // what turns the axes of seen numbers is needed for them
            let all_seen = turns_axes && (0..velocities.len()).any(is_seen);
            let first = found.velocities.len();
            for k in 0..kind.n_linear {
                if all_seen || is_seen(k) {
                    found.add(model, i, positions.start + k, velocities.start + k, 1, seen);
                }
            }
            let turning = found.velocities.len();
            let n_turning = velocities.len() - kind.n_linear;
            if n_turning > 0 && (all_seen || (kind.n_linear..velocities.len()).any(is_seen)) {
                let (at, rate) = (positions.start + kind.n_linear, velocities.start + kind.n_linear);
                found.add(model, i, at, rate, n_turning, seen);
            }
            if all_seen {
                let n_linear = kind.n_linear;
                found.carried.push(Carried { positions, velocities, n_linear, linear: first, turning });
            }
        }
        found
    }

    fn add(&mut self, model: &Model, body: usize, position: usize, velocity: usize, n: usize, seen: &[bool]) {
        let first = self.velocities.len();
        self.parts.push(Part { position, first, is_rotation: n == 3 });
        let is_single = model.velocities_of(body).len() == 1;
        let limits = if is_single { model.limits(body) } else { None };
        for k in velocity..velocity + n {
            self.velocities.push(k);
            self.is_vague.push(!seen[k]);
            self.limits.push(limits);
        }
    }

    /// How many they are.
    pub(super) fn n(&self) -> usize {
        self.velocities.len()
    }

    /// Whether a part is an angle that counts whole turns: of a hinge without limits, or of a root that moves in a plane.
    pub(super) fn counts_turns(&self, model: &Model, part: &Part) -> bool {
        let has_it = |i: &usize| model.positions_of(*i).contains(&part.position);
        let joint = (0..model.n_bodies()).find(has_it).and_then(|i| Some((i, model.joint(i)?.kind())));
        joint.is_some_and(|(i, kind)| {
            kind.turning == Turning::Angle
                && model.limits(i).is_none()
                && part.position == model.positions_of(i).start + kind.n_linear
        })
    }

    /// The numbers that are as rough as another, so that it does not matter along which axes they are: those of its rotation, or of the
    /// place of its joint.
    pub(super) fn alike(&self, number: usize) -> Range<usize> {
        let of_place = self.carried.iter().map(|carried| carried.linear..carried.linear + carried.n_linear);
        let of_rotation =
            self.parts.iter().filter(|part| part.is_rotation).map(|part| part.first..part.first + 3);
        of_place.chain(of_rotation).find(|range| range.contains(&number)).unwrap_or(number..number + 1)
    }

    /// Gives `q` what no marker sees of `from`.
    pub(super) fn keep_unseen(&self, model: &Model, from: &[f64], q: &mut [f64]) {
        for i in 0..model.n_bodies() {
            let positions = model.positions_of(i);
            let is_moved = |part: &Part| positions.contains(&part.position);
            if !self.parts.iter().any(is_moved) {
                q[positions.clone()].copy_from_slice(&from[positions]);
            }
        }
    }

    /// Places in v of what no marker sees.
    pub(super) fn unseen(&self) -> Vec<usize> {
        let is_vague = |k: &usize| {
            self.velocities
                .iter()
                .position(|velocity| velocity == k)
                .is_none_or(|number| self.is_vague[number])
        };
        (0..self.n_velocities).filter(is_vague).collect()
    }

    /// `state` moved by `step`: the axes of a rotation carry its rates and accelerations along, before their own steps are added.
    pub(super) fn advance(&self, state: &State, step: &[f64]) -> State {
        let mut moved = state.clone();
        for Part { position, first, is_rotation } in &self.parts {
            if *is_rotation {
                let turn = so3::exp(&Vector3::from_fn(|k, _| step[Self::place(0, first + k)]));
                let turned = so3::normalized_xyzw(&state.q[*position..position + 4]) * turn;
                moved.q[*position..position + 4].copy_from_slice(turned.coords.as_slice());
                for numbers in [&mut moved.rates, &mut moved.accelerations] {
                    let carried = turn.inverse() * Vector3::from_column_slice(&numbers[*first..first + 3]);
                    numbers[*first..first + 3].copy_from_slice(carried.as_slice());
                }
            } else {
                moved.q[*position] += step[Self::place(0, *first)];
            }
        }
        for (order, numbers) in [(1, &mut moved.rates), (2, &mut moved.accelerations)] {
            numbers.iter_mut().enumerate().for_each(|(k, x)| *x += step[Self::place(order, k)]);
        }
        moved.errors.iter_mut().zip(&step[3 * self.n()..]).for_each(|(x, step)| *x += step);
        moved
    }

    /// The place among the unknowns of a frame of a derivative of a number. Those of a number lie together, so that a step joins to an unknown
    /// what is near it in the next frame.
    pub(super) fn place(order: usize, number: usize) -> usize {
        3 * number + order
    }

    /// The displacement of a part from one configuration to another; its first number alone counts where it is no rotation.
    pub(super) fn difference(part: &Part, from: &[f64], to: &[f64]) -> Vector3<f64> {
        let at = part.position;
        if part.is_rotation {
            let [from, to] = [from, to].map(|q| so3::normalized_xyzw(&q[at..at + 4]));
            so3::log(&(from.inverse() * to))
        } else {
            Vector3::x() * (to[at] - from[at])
        }
    }

    /// Rotation by a joint that carries the axes of its linear numbers.
    fn turn(carried: &Carried, q: &[f64]) -> Matrix3<f64> {
        let orientation = &q[carried.positions.start + carried.n_linear..carried.positions.end];
        if orientation.len() == 4 {
            so3::matrix_of_xyzw(orientation)
        } else {
            nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), orientation[0]).into_inner()
        }
    }

    /// Writes the derivatives of a point by the numbers to `out`, from those by the velocities of the model, whose linear part is the
    /// first three rows of `of_point`.
    pub(super) fn derivatives(&self, q: &[f64], of_point: &DMatrix<f64>, out: &mut [Vector3<f64>]) {
        for (out, k) in out.iter_mut().zip(&self.velocities) {
            *out = of_point.fixed_view::<3, 1>(0, *k).into_owned();
        }
        for carried in &self.carried {
            let turn = Self::turn(carried, q);
            let linear = &mut out[carried.linear..carried.linear + carried.n_linear];
            let own: [Vector3<f64>; 3] = std::array::from_fn(|k| linear.get(k).copied().unwrap_or_default());
            for (k, out) in linear.iter_mut().enumerate() {
                *out = own[0] * turn[(k, 0)] + own[1] * turn[(k, 1)] + own[2] * turn[(k, 2)];
            }
        }
    }

    /// Velocity and acceleration of the model. What no marker sees rests.
    pub(super) fn motion(&self, state: &State) -> [Vec<f64>; 2] {
        let mut found = [vec![0.0; self.n_velocities], vec![0.0; self.n_velocities]];
        for (k, place) in self.velocities.iter().enumerate() {
            found[0][*place] = state.rates[k];
            found[1][*place] = state.accelerations[k];
        }
        for carried in &self.carried {
            let (turn, [velocity, acceleration, rate]) = self.carried_motion(carried, state);
            let along = turn.tr_mul(&velocity);
            let change = turn.tr_mul(&acceleration) - rate.cross(&along);
            for k in 0..carried.n_linear {
                found[0][carried.velocities.start + k] = along[k];
                found[1][carried.velocities.start + k] = change[k];
            }
        }
        found
    }

    /// Rotation by a joint that carries the axes of its linear numbers; its velocity and acceleration in the parent, and its angular
    /// velocity.
    fn carried_motion(&self, carried: &Carried, state: &State) -> (Matrix3<f64>, [Vector3<f64>; 3]) {
        let vector = |numbers: &[f64]| Vector3::from_fn(|k, _| numbers.get(k).copied().unwrap_or(0.0));
        let linear = carried.linear..carried.linear + carried.n_linear;
        let n_turning = carried.velocities.len() - carried.n_linear;
        let turning = &state.rates[carried.turning..carried.turning + n_turning];
        let rate = if n_turning == 1 { Vector3::z() * turning[0] } else { vector(turning) };
        let (velocity, acceleration) = (&state.rates[linear.clone()], &state.accelerations[linear]);
        (Self::turn(carried, &state.q), [vector(velocity), vector(acceleration), rate])
    }

    /// Standard deviations along v of configuration, velocity and acceleration, where `covariance` is that of the numbers, their first
    /// and their second derivatives. Infinite where no marker sees.
    pub(super) fn deviations(&self, state: &State, covariance: &Covariance) -> Deviations {
        let mut found = [(); 3].map(|()| vec![f64::INFINITY; self.n_velocities]);
        for (order, deviations) in found.iter_mut().enumerate() {
            for (k, place) in self.velocities.iter().enumerate() {
                if !self.is_vague[k] {
                    let k = Self::place(order, k);
                    deviations[*place] = standard_deviation(covariance.entry(k, k));
                }
            }
        }
        for part in self.parts.iter().filter(|part| part.is_rotation) {
            // of what turns and what is added to what it carries along
            for (order, numbers) in [(1, &state.rates), (2, &state.accelerations)] {
                let first = part.first;
                let turned = so3::hat(&Vector3::from_column_slice(&numbers[first..first + 3]));
                let by = SMatrix::<f64, 3, 6>::from_fn(|i, j| {
                    if j < 3 { turned[(i, j)] } else { f64::from(u8::from(i + 3 == j)) }
                });
                let place = |k: usize| Self::place(if k < 3 { 0 } else { order }, first + k % 3);
                let of = SMatrix::<f64, 6, 6>::from_fn(|i, j| covariance.entry(place(i), place(j)));
                let whole = by * of * by.transpose();
                for k in (0..3).filter(|k| !self.is_vague[first + k]) {
                    found[order][self.velocities[first + k]] = standard_deviation(whole[(k, k)]);
                }
            }
        }
        for carried in &self.carried {
            let (turn, [velocity, acceleration, rate]) = self.carried_motion(carried, state);
            let back = turn.transpose();
            let (along, pushed) = (back * velocity, back * acceleration);
            // by place, rotation, velocity, angular velocity and acceleration
            let mut by = SMatrix::<f64, 9, 15>::zeros();
            let mut set = |row: usize, column: usize, matrix: Matrix3<f64>| {
                by.fixed_view_mut::<3, 3>(3 * row, 3 * column).copy_from(&matrix);
            };
            let hat = so3::hat::<f64>;
            set(0, 0, back);
            set(1, 1, hat(&along));
            set(1, 2, back);
            // an angular velocity of three numbers is carried along by their axes
            let carried_rate =
                if carried.velocities.len() - carried.n_linear == 3 { hat(&rate) } else { Matrix3::zeros() };
            set(2, 1, hat(&pushed) - hat(&rate) * hat(&along) + hat(&along) * carried_rate);
            set(2, 2, -hat(&rate) * back);
            set(2, 3, hat(&along));
            set(2, 4, back);
            let n_turning = carried.velocities.len() - carried.n_linear;
            let place = |k: usize| {
                let (of, axis) = (k / 3, k % 3);
                let linear = (axis < carried.n_linear).then_some(carried.linear + axis);
                let turning = if n_turning == 3 {
                    Some(carried.turning + axis)
                } else {
                    (axis == 2).then_some(carried.turning)
                };
                let (order, number) = [(0, linear), (0, turning), (1, linear), (1, turning), (2, linear)][of];
                number.map(|number| Self::place(order, number))
            };
            // a joint in the plane neither moves along its axis nor turns about others, which is certain
            let entry = |i: usize, j: usize| match (place(i), place(j)) {
                (Some(i), Some(j)) => covariance.entry(i, j),
                (Some(_) | None, None) | (None, Some(_)) => 0.0,
            };
            let of_numbers = SMatrix::<f64, 15, 15>::from_fn(entry);
            let of_motion = by * of_numbers * by.transpose();
            for (order, deviations) in found.iter_mut().enumerate() {
                for k in 0..carried.n_linear {
                    let at = 3 * order + k;
                    deviations[carried.velocities.start + k] = standard_deviation(of_motion[(at, at)]);
                }
            }
        }
        let [positions, velocities, accelerations] = found;
        Deviations { positions, velocities, accelerations }
    }
}
