//! The configuration manifold: q ⊕ v, its inverse, and the way back to unit quaternions.
//!
//! q ⊕ v moves each joint by the exponential of its group with v in the axes of the child (table in
//! [`joint`](crate::joint)). A curve q(t) with velocity v(t) therefore obeys
//! q(t + h) = q(t) ⊕ (h v + ½ h² v̇) + O(h³).
//!
//! As numbers, q̇ = N(q) v with N = ∂(q ⊕ ε)/∂ε. N keeps the norm of a quaternion, whatever that is, and an orientation is the
//! direction of its quaternion.

use crate::error::DynamicsError;
use crate::joint::Group;
use crate::model::Model;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector2, Vector3};
use somersault_core::argument::expect_length;
use somersault_core::lie::so3::from_xyzw;
use somersault_core::lie::{se2, se3, so2, so3};
use somersault_core::scalar::{Scalar, constant};

fn store<T: Scalar>(rotation: &UnitQuaternion<T>, out: &mut [T]) {
    out.copy_from_slice(rotation.coords.as_slice());
}

fn triple<T: Scalar>(numbers: &[T]) -> Vector3<T> {
    Vector3::new(numbers[0], numbers[1], numbers[2])
}

/// The pose stored in a position and a quaternion.
fn pose<T: Scalar>(q: &[T]) -> Isometry3<T> {
    Isometry3::from_parts(Translation3::from(triple(q)), so3::from_xyzw(&q[3..7]))
}

/// A quaternion (x, y, z, w) of any norm.
fn quaternion<T: Scalar>(q: &[T]) -> Quaternion<T> {
    from_xyzw(q).into_inner()
}

/// The rotation that is the direction of a quaternion.
fn direction<T: Scalar>(q: &[T]) -> UnitQuaternion<T> {
    let q = quaternion(q);
    UnitQuaternion::new_unchecked(q / q.norm())
}

/// The turn of the linear numbers of a group from its own axes to those of the joint frame; none where there is nothing to turn.
fn turn<T: Scalar>(group: Group, q: &[T]) -> Option<UnitQuaternion<T>> {
    match group {
        Group::Vector | Group::Rotations => None,
        Group::PlanarMotions => {
            // without the branch that an exponential takes near no turn
            let (sin, cos) = (q[2] * constant(0.5)).sin_cos();
            Some(UnitQuaternion::new_unchecked(Quaternion::new(cos, T::zero(), T::zero(), sin)))
        }
        Group::Motions => Some(direction(&q[3..7])),
    }
}

/// Linear numbers with zeros after them, as a vector.
fn padded<T: Scalar>(numbers: &[T]) -> Vector3<T> {
    Vector3::from_fn(|i, _| numbers.get(i).copied().unwrap_or_else(T::zero))
}

impl Group {
    /// Numbers that q and v begin with, which are those of a displacement along the axes of the joint frame and of the child.
    const fn n_linear(self) -> usize {
        match self {
            Self::Vector | Self::Rotations => 0,
            Self::PlanarMotions => 2,
            Self::Motions => 3,
        }
    }

    /// Linear numbers turned from the axes of the child to those of the joint frame, or back.
    fn turn_linear<T: Scalar>(self, q: &[T], numbers: &[T], is_back: bool, out: &mut [T]) {
        let Some(turn) = turn(self, q) else { return };
        let n = self.n_linear();
        let part = padded(&numbers[..n]);
        let turned = if is_back { turn.inverse() * part } else { turn * part };
        out[..n].copy_from_slice(&turned.as_slice()[..n]);
    }

    /// out ← N(q) v, the rates of the numbers q of a joint with velocity v.
    pub fn position_rates<T: Scalar>(self, q: &[T], v: &[T], out: &mut [T]) {
        let n = self.n_linear();
        self.turn_linear(q, v, false, out);
        match self {
            Self::Vector | Self::PlanarMotions => out[n..].copy_from_slice(&v[n..]),
            Self::Rotations | Self::Motions => {
                let spin = Quaternion::from_imag(triple(&v[n..]) * constant::<T>(0.5));
                out[n..].copy_from_slice((quaternion(&q[n..]) * spin).coords.as_slice());
            }
        }
    }

    /// out ← N(q)ᵀ g, the derivatives along q ⊕ ε e_k of what has the derivatives g by the numbers q.
    pub fn derivatives_along<T: Scalar>(self, q: &[T], g: &[T], out: &mut [T]) {
        let n = self.n_linear();
        self.turn_linear(q, g, true, out);
        match self {
            Self::Vector | Self::PlanarMotions => out[n..].copy_from_slice(&g[n..]),
            Self::Rotations | Self::Motions => {
                let turned = quaternion(&q[n..]).conjugate() * quaternion(&g[n..]);
                out[n..].copy_from_slice((turned.imag() * constant::<T>(0.5)).as_slice());
            }
        }
    }

    /// out ← the derivatives by the numbers q of what has the derivatives `along` q ⊕ ε e_k: of a function of the direction of a
    /// quaternion, so that they have no part along it.
    pub fn derivatives_by_numbers<T: Scalar>(self, q: &[T], along: &[T], out: &mut [T]) {
        let n = self.n_linear();
        self.turn_linear(q, along, false, out);
        match self {
            Self::Vector | Self::PlanarMotions => out[n..].copy_from_slice(&along[n..]),
            Self::Rotations | Self::Motions => {
                let q = quaternion(&q[n..]);
                let across = q * Quaternion::from_imag(triple(&along[n..]));
                out[n..]
                    .copy_from_slice((across * (constant::<T>(2.0) / q.norm_squared())).coords.as_slice());
            }
        }
    }
}

impl<T: Scalar> Model<T> {
    /// out ← N(q) v, the rates of the numbers of q.
    pub fn position_rates(&self, q: &[T], v: &[T], out: &mut [T]) -> Result<(), DynamicsError> {
        expect_length("q", q.len(), self.n_positions())?;
        expect_length("v", v.len(), self.n_velocities())?;
        expect_length("out", out.len(), self.n_positions())?;
        for (place, link) in self.places.iter().zip(self.links()) {
            let at = place.q.clone();
            link.joint.group().position_rates(&q[at.clone()], &v[place.dofs.clone()], &mut out[at]);
        }
        Ok(())
    }

    /// out ← N(q)ᵀ g: the derivatives along q ⊕ ε e_k, in the axes of the children, of what has the derivatives g by the numbers
    /// of q.
    pub fn derivatives_along(&self, q: &[T], g: &[T], out: &mut [T]) -> Result<(), DynamicsError> {
        expect_length("q", q.len(), self.n_positions())?;
        expect_length("g", g.len(), self.n_positions())?;
        expect_length("out", out.len(), self.n_velocities())?;
        for (place, link) in self.places.iter().zip(self.links()) {
            let at = place.q.clone();
            let out = &mut out[place.dofs.clone()];
            link.joint.group().derivatives_along(&q[at.clone()], &g[at], out);
        }
        Ok(())
    }

    /// The configuration with all angles and displacements zero and all frames aligned.
    pub fn neutral(&self) -> Vec<T> {
        let mut q = vec![T::zero(); self.n_positions()];
        for i in 0..self.n_bodies() {
            if let Some(quaternion) = self.quaternion_of(i) {
                q[quaternion.end - 1] = T::one();
            }
        }
        q
    }

    /// out ← q ⊕ v. `q` and `out` have [`n_positions`](Self::n_positions), `v` has
    /// [`n_velocities`](Self::n_velocities) entries.
    pub fn displace(&self, q: &[T], v: &[T], out: &mut [T]) -> Result<(), DynamicsError> {
        expect_length("q", q.len(), self.n_positions())?;
        expect_length("v", v.len(), self.n_velocities())?;
        expect_length("out", out.len(), self.n_positions())?;
        for (place, link) in self.places.iter().zip(self.links()) {
            let at = place.q.clone();
            let (q, v, out) = (&q[at.clone()], &v[place.dofs.clone()], &mut out[at]);
            match link.joint.group() {
                Group::Vector => {
                    out.iter_mut().zip(q.iter().zip(v)).for_each(|(out, (q, v))| *out = *q + *v);
                }
                Group::Rotations => store(&(so3::from_xyzw(q) * so3::exp(&triple(v))), out),
                Group::PlanarMotions => {
                    let moved = so2::exp(q[2]) * se2::translation(&Vector2::new(v[0], v[1]), v[2]);
                    (out[0], out[1], out[2]) = (q[0] + moved.x, q[1] + moved.y, q[2] + v[2]);
                }
                Group::Motions => {
                    let end = pose(q) * se3::exp(&triple(v), &triple(&v[3..]));
                    out[..3].copy_from_slice(end.translation.vector.as_slice());
                    store(&end.rotation, &mut out[3..]);
                }
            }
        }
        Ok(())
    }

    /// out ← the v of least rotation with `from ⊕ v = to`.
    ///
    /// Unique while rotations differ by less than a half turn; angles of planar joints must differ by
    /// less than a whole one.
    pub fn difference(&self, from: &[T], to: &[T], out: &mut [T]) -> Result<(), DynamicsError> {
        expect_length("from", from.len(), self.n_positions())?;
        expect_length("to", to.len(), self.n_positions())?;
        expect_length("out", out.len(), self.n_velocities())?;
        for (place, link) in self.places.iter().zip(self.links()) {
            let at = place.q.clone();
            let (from, to, out) = (&from[at.clone()], &to[at], &mut out[place.dofs.clone()]);
            match link.joint.group() {
                Group::Vector => {
                    out.iter_mut().zip(from.iter().zip(to)).for_each(|(out, (from, to))| *out = *to - *from);
                }
                Group::Rotations => {
                    let relative = so3::from_xyzw(from).inverse() * so3::from_xyzw(to);
                    out.copy_from_slice(so3::log(&relative).as_slice());
                }
                Group::PlanarMotions => {
                    let moved = Vector2::new(to[0] - from[0], to[1] - from[1]);
                    let angle = to[2] - from[2];
                    let rho = se2::linear_part(&(so2::exp(-from[2]) * moved), angle);
                    (out[0], out[1], out[2]) = (rho.x, rho.y, angle);
                }
                Group::Motions => {
                    let [rho, u] = se3::log(&pose(from).inv_mul(&pose(to)));
                    out[..3].copy_from_slice(rho.as_slice());
                    out[3..].copy_from_slice(u.as_slice());
                }
            }
        }
        Ok(())
    }

    /// Brings all quaternions in `q` to unit norm; fails on one that is zero or not finite.
    pub fn normalize(&self, q: &mut [T]) -> Result<(), DynamicsError> {
        expect_length("q", q.len(), self.n_positions())?;
        for (i, link) in self.links().iter().enumerate() {
            if let Some(quaternion) = self.quaternion_of(i) {
                let coordinates = &mut q[quaternion];
                let norm = so3::from_xyzw(coordinates).coords.norm();
                if !(norm > T::zero() && norm.is_finite()) {
                    return Err(DynamicsError::NoRotation { joint: link.name.clone() });
                }
                for x in coordinates {
                    *x /= norm;
                }
            }
        }
        Ok(())
    }
}
