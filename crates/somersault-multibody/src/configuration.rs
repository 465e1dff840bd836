//! The configuration manifold: q ⊕ v, its inverse, and the way back to unit quaternions.
//!
//! q ⊕ v moves each joint by the exponential of its group with v in the axes of the child (table in
//! [`joint`](crate::joint)). A curve q(t) with velocity v(t) therefore obeys
//! q(t + h) = q(t) ⊕ (h v + ½ h² v̇) + O(h³).

use crate::error::DynamicsError;
use crate::joint::{Joint, quaternion};
use crate::lie;
use crate::model::Model;
use crate::scalar::Scalar;
use nalgebra::{Quaternion, UnitQuaternion, Vector2, Vector3};
use somersault_core::argument::expect_length;

fn store<T: Scalar>(q: &Quaternion<T>, out: &mut [T]) {
    out.copy_from_slice(q.coords.as_slice());
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
    pub fn integrate(&self, q: &[T], v: &[T], out: &mut [T]) -> Result<(), DynamicsError> {
        expect_length("q", q.len(), self.n_positions())?;
        expect_length("v", v.len(), self.n_velocities())?;
        expect_length("out", out.len(), self.n_positions())?;
        for (body, link) in self.bodies.iter().zip(self.links()) {
            let at = body.q..body.q + link.joint.n_positions();
            let (q, v, out) = (&q[at.clone()], &v[body.dofs.clone()], &mut out[at]);
            match link.joint {
                Joint::Fixed => {}
                Joint::Revolute { .. } | Joint::Prismatic { .. } => out[0] = q[0] + v[0],
                Joint::Spherical => {
                    store(&(quaternion(q) * lie::exp_so3(&Vector3::new(v[0], v[1], v[2]))), out);
                }
                Joint::Planar => {
                    let (s, c) = q[2].sin_cos();
                    let p = lie::exp_se2_translation(&Vector2::new(v[0], v[1]), v[2]);
                    out[0] = q[0] + c * p.x - s * p.y;
                    out[1] = q[1] + s * p.x + c * p.y;
                    out[2] = q[2] + v[2];
                }
                Joint::Free => {
                    let (rho, u) = (Vector3::new(v[0], v[1], v[2]), Vector3::new(v[3], v[4], v[5]));
                    let r = quaternion(&q[3..7]);
                    let moved = UnitQuaternion::new_unchecked(r) * lie::exp_se3_translation(&rho, &u);
                    for k in 0..3 {
                        out[k] = q[k] + moved[k];
                    }
                    store(&(r * lie::exp_so3(&u)), &mut out[3..7]);
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
        for (body, link) in self.bodies.iter().zip(self.links()) {
            let at = body.q..body.q + link.joint.n_positions();
            let (from, to, out) = (&from[at.clone()], &to[at], &mut out[body.dofs.clone()]);
            match link.joint {
                Joint::Fixed => {}
                Joint::Revolute { .. } | Joint::Prismatic { .. } => out[0] = to[0] - from[0],
                Joint::Spherical => {
                    let relative = quaternion(from).conjugate() * quaternion(to);
                    out.copy_from_slice(lie::log_so3(&relative).as_slice());
                }
                Joint::Planar => {
                    let (s, c) = from[2].sin_cos();
                    let (x, y, angle) = (to[0] - from[0], to[1] - from[1], to[2] - from[2]);
                    let p = Vector2::new(c * x + s * y, c * y - s * x);
                    let rho = lie::log_se2_translation(&p, angle);
                    (out[0], out[1], out[2]) = (rho.x, rho.y, angle);
                }
                Joint::Free => {
                    let start = quaternion(&from[3..7]);
                    let u = lie::log_so3(&(start.conjugate() * quaternion(&to[3..7])));
                    let moved = Vector3::new(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
                    let p = UnitQuaternion::new_unchecked(start.conjugate()) * moved;
                    out[..3].copy_from_slice(lie::log_se3_translation(&p, &u).as_slice());
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
                let norm = self::quaternion(coordinates).norm();
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
