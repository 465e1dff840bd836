//! Coordinates of a tree that are as many as its degrees of freedom.
//!
//! Angles and lengths are their own. A spherical joint has the vector φ of its rotation exp φ̂ from the home position, a
//! free one its place and φ, a planar one place and angle. With ω in the axes of the child, θ = ‖φ‖ < 2π and
//! k = (1 − (θ/2) cot(θ/2))/θ²,
//!
//! ```text
//! φ̇ = J⁻¹(φ) ω,   J⁻¹ = 1 + ½ φ̂ + k φ̂²,   ẋ = R v,
//! ∂(λᵀJ⁻¹ω)/∂φ = ½ ω × λ + k (λ φᵀω + ω φᵀλ − 2 φ λᵀω) + 2k' φ (λᵀφ φᵀω − θ² λᵀω),   k' = dk/dθ²,
//! ```
//! and a displacement δφ turns the child by J δφ. Source: A. Iserles et al., *Lie-group methods*, Acta Numerica 9 (2000).

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector2, Vector3, convert};
use somersault_multibody::joint::Joint;
use somersault_multibody::{DynamicsError, Model, Scalar, cotangent_ratio};
use std::ops::Range;

/// The joints whose coordinates do not change at the rate of their velocities.
#[derive(Debug)]
pub(super) struct Charts {
    joints: Vec<(Kind, Range<usize>)>,
    /// Of each quaternion, where it is among the positions.
    quaternions: Vec<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Spherical,
    Planar,
    Free,
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
        let mut charts = Self { joints: Vec::new(), quaternions: Vec::new() };
        for i in 0..model.n_bodies() {
            let kind = match model.joint(i) {
                Some(Joint::Spherical) => Kind::Spherical,
                Some(Joint::Planar) => Kind::Planar,
                Some(Joint::Free) => Kind::Free,
                // one coordinate for each velocity, or none
                Some(Joint::Fixed | Joint::Revolute { .. } | Joint::Prismatic { .. }) | None => continue,
            };
            charts.joints.push((kind, model.velocities_of(i)));
            charts.quaternions.push(model.positions_of(i).end.saturating_sub(4));
        }
        charts
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
        model.integrate(home, part, shifted)?;
        part.fill(T::zero());
        self.turns().for_each(|i| part[i] = c[i]);
        model.integrate(shifted, part, positions)
    }

    /// The degrees of freedom that turn in these joints.
    fn turns(&self) -> impl Iterator<Item = usize> + '_ {
        self.joints.iter().flat_map(|(kind, dofs)| match kind {
            Kind::Spherical => dofs.clone(),
            Kind::Planar => dofs.start + 2..dofs.end,
            Kind::Free => dofs.start + 3..dofs.end,
        })
    }

    /// ċ, which holds v before, at positions that [`place`](Self::place) has found.
    pub(super) fn rates<T: Scalar>(&self, c: &[T], positions: &[T], rates: &mut [T]) {
        for ((kind, dofs), &at) in self.joints.iter().zip(&self.quaternions) {
            let first = dofs.start;
            match kind {
                Kind::Spherical => {
                    let turned = inverse_jacobian(&three(c, first)) * three(rates, first);
                    put(rates, first, &turned);
                }
                Kind::Planar => {
                    let moved = turn(c[first + 2], [rates[first], rates[first + 1]]);
                    rates[first..first + 2].copy_from_slice(&moved);
                }
                Kind::Free => {
                    let moved = rotation(positions, at) * three(rates, first);
                    let turned = inverse_jacobian(&three(c, first + 3)) * three(rates, first + 3);
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
        for ((kind, dofs), &at) in self.joints.iter().zip(&self.quaternions) {
            let first = dofs.start;
            let turning = |at: usize, extra: Vector3<T>, g: &mut [T], costate: &mut [T]| {
                let (phi, lambda, omega) = (three(c, at), three(costate, at), three(v, at));
                let inverse = inverse_jacobian(&phi);
                // singular at a whole turn only, where nothing is finite any more
                let jacobian = inverse.try_inverse().unwrap_or_else(|| inverse * convert::<f64, T>(f64::NAN));
                let along = jacobian.tr_mul(&(three(g, at) + extra)) + bent(&phi, &lambda, &omega);
                put(g, at, &along);
                put(costate, at, &inverse.tr_mul(&lambda));
            };
            match kind {
                Kind::Spherical => turning(first, Vector3::zeros(), g, costate),
                Kind::Planar => {
                    let angle = c[first + 2];
                    let [x, y] = turn(-angle, [costate[first], costate[first + 1]]);
                    g[first + 2] += v[first] * y - v[first + 1] * x;
                    let moved = turn(angle, [g[first], g[first + 1]]);
                    g[first..first + 2].copy_from_slice(&moved);
                    costate[first..first + 2].copy_from_slice(&[x, y]);
                }
                Kind::Free => {
                    let rotation = rotation(positions, at);
                    let in_child = rotation.inverse() * three(costate, first);
                    turning(first + 3, three(v, first).cross(&in_child), g, costate);
                    put(g, first, &(rotation * three(g, first)));
                    put(costate, first, &in_child);
                }
            }
        }
    }
}

fn three<T: Scalar>(x: &[T], at: usize) -> Vector3<T> {
    Vector3::new(x[at], x[at + 1], x[at + 2])
}

fn put<T: Scalar>(out: &mut [T], at: usize, x: &Vector3<T>) {
    out[at..at + 3].copy_from_slice(x.as_slice());
}

fn turn<T: Scalar>(angle: T, [x, y]: [T; 2]) -> [T; 2] {
    let (sin, cos) = angle.sin_cos();
    let turned = Vector2::new(cos * x - sin * y, sin * x + cos * y);
    [turned.x, turned.y]
}

fn rotation<T: Scalar>(positions: &[T], at: usize) -> UnitQuaternion<T> {
    let [x, y, z, w] = [0, 1, 2, 3].map(|k| positions[at + k]);
    UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z))
}

fn inverse_jacobian<T: Scalar>(phi: &Vector3<T>) -> Matrix3<T> {
    let (hat, [k, _]) = (phi.cross_matrix(), cotangent_ratio(phi.norm_squared()));
    Matrix3::identity() + hat * convert::<f64, T>(0.5) + hat * hat * k
}

/// ∂(λᵀJ⁻¹ω)/∂φ.
fn bent<T: Scalar>(phi: &Vector3<T>, lambda: &Vector3<T>, omega: &Vector3<T>) -> Vector3<T> {
    let two = convert::<f64, T>(2.0);
    let square = phi.norm_squared();
    let [k, slope] = cotangent_ratio(square);
    let (a, b, both) = (phi.dot(omega), phi.dot(lambda), lambda.dot(omega));
    omega.cross(lambda) * convert::<f64, T>(0.5)
        + (lambda * a + omega * b - phi * (both * two)) * k
        + phi * ((a * b - square * both) * slope * two)
}
