//! The configuration manifold: q ⊕ v, its inverse, and the way back to unit quaternions.
//!
//! q ⊕ v moves each joint by the exponential of its group with v in the axes of the child (table in
//! [`joint`](crate::joint)). A curve q(t) with velocity v(t) therefore obeys
//! q(t + h) = q(t) ⊕ (h v + ½ h² v̇) + O(h³).

use crate::error::DynamicsError;
use crate::joint::Group;
use crate::model::Model;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector2, Vector3};
use somersault_core::Scalar;
use somersault_core::argument::expect_length;
use somersault_core::lie::{se2, se3, so2, so3};

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

impl<T: Scalar> Model<T> {
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
