//! Coordinates of a tree that are as many as its degrees of freedom.
//!
//! Angles and lengths are their own. A spherical joint has the vector φ of its rotation exp φ̂ from the home position, a
//! free one its place and φ, a planar one place and angle. With ω in the axes of the child and ‖φ‖ < 2π,
//!
//! ```text
//! φ̇ = J_r⁻¹(φ) ω,   ẋ = R v,
//! ```
//! and a displacement δφ turns the child by J_r δφ; see [`so3`](somersault_core::lie::so3).

use nalgebra::{Vector2, Vector3};
use somersault_core::Scalar;
use somersault_core::lie::so2;
use somersault_core::lie::so3::{dexp_inv_partials, from_xyzw, right_jacobian, right_jacobian_inverse};
use somersault_multibody::{DynamicsError, Group, Model};
use std::ops::Range;

/// The joints whose coordinates do not change at the rate of their velocities.
#[derive(Debug)]
pub(super) struct Charts {
    joints: Vec<Chart>,
}

/// The coordinates of one joint.
#[derive(Debug)]
struct Chart {
    group: Group,
    dofs: Range<usize>,
    /// Linear numbers, the first ones of its degrees of freedom.
    n_linear: usize,
    /// Where its orientation is among the positions.
    orientation: usize,
}

/// Where positions are put together.
#[derive(Debug)]
pub(super) struct Scratch<T: Scalar> {
    home: Vec<T>,
    shifted: Vec<T>,
    part: Vec<T>,
    pub(super) positions: Vec<T>,
}

impl<T: Scalar> Scratch<T> {
    pub(super) fn new(model: &Model<T>) -> Self {
        let home = model.neutral();
        let (shifted, positions) = (home.clone(), home.clone());
        Self { home, shifted, part: vec![T::zero(); model.n_velocities()], positions }
    }
}

impl Charts {
    pub(super) fn of(model: &Model) -> Self {
        let chart = |i: usize| {
            let kind = model.joint(i)?.kind();
            let orientation = model.positions_of(i).start + kind.n_linear;
            let chart = Chart {
                group: kind.group(),
                dofs: model.velocities_of(i),
                n_linear: kind.n_linear,
                orientation,
            };
            (chart.group != Group::Vector).then_some(chart)
        };
        Self { joints: (0..model.n_bodies()).filter_map(chart).collect() }
    }

    /// Whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.joints.is_empty()
    }

    /// Positions at coordinates `c`: places first, then turns, so that a place is one in the axes of the parent.
    pub(super) fn place<T: Scalar>(
        &self,
        model: &Model<T>,
        c: &[T],
        scratch: &mut Scratch<T>,
    ) -> Result<(), DynamicsError> {
        if self.is_empty() {
            scratch.positions.copy_from_slice(c);
            return Ok(());
        }
        let Scratch { home, shifted, part, positions } = scratch;
        part.copy_from_slice(c);
        self.turns().for_each(|i| part[i] = T::zero());
        model.displace(home, part, shifted)?;
        part.fill(T::zero());
        self.turns().for_each(|i| part[i] = c[i]);
        model.displace(shifted, part, positions)
    }

    /// The degrees of freedom that turn in these joints.
    fn turns(&self) -> impl Iterator<Item = usize> + '_ {
        self.joints.iter().flat_map(|chart| chart.dofs.start + chart.n_linear..chart.dofs.end)
    }

    /// ċ, which holds v before, at positions that [`place`](Self::place) has found.
    pub(super) fn rates<T: Scalar>(&self, c: &[T], positions: &[T], rates: &mut [T]) {
        for Chart { group, dofs, orientation, .. } in &self.joints {
            let first = dofs.start;
            match group {
                Group::Vector => {}
                Group::Rotations => {
                    let turned = right_jacobian_inverse(&three(c, first)) * three(rates, first);
                    put(rates, first, &turned);
                }
                Group::PlanarMotions => {
                    let moved = so2::exp(c[first + 2]) * two(rates, first);
                    rates[first..first + 2].copy_from_slice(moved.as_slice());
                }
                Group::Motions => {
                    let moved = from_xyzw(&positions[*orientation..]) * three(rates, first);
                    let turned = right_jacobian_inverse(&three(c, first + 3)) * three(rates, first + 3);
                    put(rates, first, &moved);
                    put(rates, first + 3, &turned);
                }
            }
        }
    }

    /// From λ_c and the gradient g of λ_vᵀa along displacements in the axes of the children: into `g` the gradient of
    /// λᵀ(ċ, a) by c, and into `costate`, which holds λ_c before, (∂ċ/∂v)ᵀλ_c.
    pub(super) fn gradient<T: Scalar>(
        &self,
        c: &[T],
        v: &[T],
        positions: &[T],
        g: &mut [T],
        costate: &mut [T],
    ) {
        for Chart { group, dofs, orientation, .. } in &self.joints {
            let first = dofs.start;
            let turning = |at: usize, extra: Vector3<T>, g: &mut [T], costate: &mut [T]| {
                let (phi, lambda, omega) = (three(c, at), three(costate, at), three(v, at));
                let gradient = right_jacobian(&phi).tr_mul(&(three(g, at) + extra));
                // J_r⁻¹(φ) ω = dexp⁻¹₋φ(ω)
                let bent = dexp_inv_partials(&-phi, &omega).tr_mul(&lambda);
                put(g, at, &(gradient - bent));
                put(costate, at, &right_jacobian_inverse(&phi).tr_mul(&lambda));
            };
            match group {
                Group::Vector => {}
                Group::Rotations => turning(first, Vector3::zeros(), g, costate),
                Group::PlanarMotions => {
                    let turn = so2::exp(c[first + 2]);
                    let in_child = turn.inverse() * two(costate, first);
                    g[first + 2] += two(v, first).perp(&in_child);
                    let moved = turn * two(g, first);
                    g[first..first + 2].copy_from_slice(moved.as_slice());
                    costate[first..first + 2].copy_from_slice(in_child.as_slice());
                }
                Group::Motions => {
                    let rotation = from_xyzw(&positions[*orientation..]);
                    let in_child = rotation.inverse() * three(costate, first);
                    turning(first + 3, three(v, first).cross(&in_child), g, costate);
                    put(g, first, &(rotation * three(g, first)));
                    put(costate, first, &in_child);
                }
            }
        }
    }
}

fn two<T: Scalar>(x: &[T], at: usize) -> Vector2<T> {
    Vector2::new(x[at], x[at + 1])
}

fn three<T: Scalar>(x: &[T], at: usize) -> Vector3<T> {
    Vector3::new(x[at], x[at + 1], x[at + 2])
}

fn put<T: Scalar>(out: &mut [T], at: usize, x: &Vector3<T>) {
    out[at..at + 3].copy_from_slice(x.as_slice());
}
