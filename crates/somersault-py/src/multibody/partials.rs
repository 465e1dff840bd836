//! Derivatives of the dynamics of trees.

use crate::core::convert::vector;
use crate::core::error::Error;
use crate::multibody::kinematics::write;
use crate::multibody::model::Model;
use pyo3::prelude::*;
use somersault::integrators::nalgebra::{DMatrix, Vector3};
use somersault::multibody::flight::{Flight, TakeOff};
use somersault::multibody::{DerivativeData, Partials};

/// Writes a result and its partials, one after the other.
fn write_all(found: &Partials<'_>, out: &mut [f64]) {
    let n = found.value.len();
    let (value, matrices) = out.split_at_mut(n);
    value.copy_from_slice(found.value);
    let parts: [&DMatrix<f64>; 3] = [found.q, found.v, found.input];
    for (matrix, out) in parts.into_iter().zip(matrices.chunks_exact_mut((n * n).max(1))) {
        write(matrix, out);
    }
}

/// An array for each of four results.
type Four<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>);

/// An array for each of five.
type Five<'py> =
    (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>);

#[pymethods]
impl Model {
    /// `inverse_dynamics` and its partial derivatives.
    ///
    /// Derivatives with respect to q are along q ⊕ ε e_k, one column for each k; wrenches are held fixed in
    /// their bodies.
    ///
    /// Parameters
    /// ----------
    /// q, v, a : array_like, shape (..., n)
    ///     Configuration, velocity and acceleration.
    /// wrenches : array_like, shape (..., n_bodies, 6), optional
    ///     As in `inverse_dynamics`.
    ///
    /// Returns
    /// -------
    /// torque : ndarray, shape (..., n_velocities)
    ///     The joint forces.
    /// torque_q, torque_v : ndarray, shape (..., n_velocities, n_velocities)
    ///     ∂τ/∂q and ∂τ/∂v.
    /// torque_a : ndarray, shape (..., n_velocities, n_velocities)
    ///     ∂τ/∂a, the mass matrix.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import multibody
    /// >>> arm = multibody.two_link_arm()
    /// >>> q, v, a = [0.1, 0.2], [1.0, -1.0], [0.5, 0.0]
    /// >>> torque, torque_q, torque_v, torque_a = arm.inverse_dynamics_partials(q, v, a)
    /// >>> np.allclose(torque, arm.inverse_dynamics(q, v, a)), np.allclose(torque_a, arm.mass_matrix(q))
    /// (True, True)
    #[pyo3(signature = (q, v, a, wrenches=None))]
    fn inverse_dynamics_partials<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        a: &Bound<'py, PyAny>,
        wrenches: Option<&Bound<'py, PyAny>>,
    ) -> Result<Four<'py>, Error> {
        let (q, v, a, wrenches) =
            (self.q("q", q)?, self.v("v", v)?, self.v("a", a)?, self.wrenches(wrenches)?);
        let n = self.model.n_velocities();
        let found = self.map_partials(py, [&q, &v, &a, &wrenches], |work, [q, v, a, f], out| {
            self.model.inverse_dynamics_partials_many(work, q, v, a, f, out)
        })?;
        Ok(found.arrays(py, [&[n], &[n, n], &[n, n], &[n, n]])?.into())
    }

    /// `forward_dynamics` and its partial derivatives.
    ///
    /// Derivatives with respect to q are along q ⊕ ε e_k, one column for each k; wrenches are held fixed in
    /// their bodies.
    ///
    /// Parameters
    /// ----------
    /// q, v, torque : array_like, shape (..., n)
    ///     Configuration, velocity and joint forces.
    /// wrenches : array_like, shape (..., n_bodies, 6), optional
    ///     As in `inverse_dynamics`.
    ///
    /// Returns
    /// -------
    /// a : ndarray, shape (..., n_velocities)
    ///     The accelerations.
    /// a_q, a_v : ndarray, shape (..., n_velocities, n_velocities)
    ///     ∂a/∂q and ∂a/∂v.
    /// a_torque : ndarray, shape (..., n_velocities, n_velocities)
    ///     ∂a/∂τ, the inverse of the mass matrix.
    ///
    /// Examples
    /// --------
    /// The pole on a cart, linearised about the upright:
    ///
    /// >>> from somersault import multibody
    /// >>> pole = multibody.cart_pendulum()
    /// >>> a, a_q, a_v, a_torque = pole.forward_dynamics_partials([0.0, 0.0], [0.0, 0.0], [0.0, 0.0])
    /// >>> a_q.round(4)
    /// array([[ 0.   ,  4.905],
    ///        [ 0.   , 14.715]])
    /// >>> a_torque.round(4)
    /// array([[0.5, 0.5],
    ///        [0.5, 1.5]])
    #[pyo3(signature = (q, v, torque, wrenches=None))]
    fn forward_dynamics_partials<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        torque: &Bound<'py, PyAny>,
        wrenches: Option<&Bound<'py, PyAny>>,
    ) -> Result<Four<'py>, Error> {
        let (q, v) = (self.q("q", q)?, self.v("v", v)?);
        let (torque, wrenches) = (self.v("torque", torque)?, self.wrenches(wrenches)?);
        let n = self.model.n_velocities();
        let found = self.map_partials(py, [&q, &v, &torque, &wrenches], |work, [q, v, torque, f], out| {
            self.model.forward_dynamics_partials_many(work, q, v, torque, f, out)
        })?;
        Ok(found.arrays(py, [&[n], &[n, n], &[n, n], &[n, n]])?.into())
    }

    /// Angular velocity of the root in the air, and its partial derivatives.
    ///
    /// In flight the angular momentum L about the centre of mass is constant. With positions s and velocities ṡ of the
    /// joints it leaves one angular velocity to the root in an orientation R: ω = I(s)⁻¹ (Rᵀ L − A(s) ṡ), with the inertia I
    /// about the centre of mass and the momentum A ṡ of the joints' motion. Derivatives with respect to q are along
    /// q ⊕ ε e_k, one column for each k. `fly` integrates the orientation.
    ///
    /// Parameters
    /// ----------
    /// q, v : array_like, shape (..., n)
    ///     Configuration and velocity. The position of the root and its velocity do not count.
    /// angular_momentum : array_like, shape (3,)
    ///     L, axes of the world, kg m²/s.
    ///
    /// Returns
    /// -------
    /// omega : ndarray, shape (..., 3)
    ///     ω, axes of the root, rad/s.
    /// omega_q, omega_v : ndarray, shape (..., 3, n_velocities)
    ///     ∂ω/∂q and ∂ω/∂v.
    /// omega_momentum : ndarray, shape (..., 3, 3)
    ///     ∂ω/∂L.
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If the joint of the root is neither free nor planar, or damped.
    /// DynamicsError
    ///     If the tree has no inertia about some axis.
    ///
    /// Examples
    /// --------
    /// A diver with 60 kg m²/s, straight and in a pike:
    ///
    /// >>> import numpy as np
    /// >>> from somersault import multibody
    /// >>> diver = multibody.diver_spatial()
    /// >>> q = [diver.configuration("A"), diver.configuration("H")]
    /// >>> omega, *partials = diver.model.flight_velocity_partials(q, np.zeros(27), [0.0, 60.0, 0.0])
    /// >>> bool(np.linalg.norm(omega[1]) > 2 * np.linalg.norm(omega[0]))
    /// True
    fn flight_velocity_partials<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        angular_momentum: &Bound<'py, PyAny>,
    ) -> Result<Four<'py>, Error> {
        let (q, v) = (self.q("q", q)?, self.v("v", v)?);
        let angular_momentum = vector("angular_momentum", angular_momentum)?;
        let zero = Vector3::zeros();
        let take_off = TakeOff { time: 0.0, center_of_mass: zero, velocity: zero, angular_momentum };
        let flight = Flight::try_new(&self.model, take_off)?;
        let n = self.model.n_velocities();
        let found = self.map_flights(py, [&q, &v], 6 * n + 12, |shapes, [q, v], out| {
            flight.derivatives_many(shapes, q, v, out)
        })?;
        let shapes: [&[usize]; 4] = [&[3], &[3, n], &[3, n], &[3, 3]];
        Ok(found.arrays(py, shapes)?.into())
    }

    /// `hybrid_dynamics` and its partial derivatives.
    ///
    /// Derivatives with respect to q are along q ⊕ ε e_k, one column for each k; wrenches are held fixed in
    /// their bodies.
    ///
    /// Parameters
    /// ----------
    /// q, v : array_like, shape (..., n)
    ///     Configuration and velocity.
    /// known : array_like, shape (..., n_velocities)
    ///     Of each degree of freedom the joint force if it is passive, the acceleration if it is active.
    /// active : sequence of str, or array_like of bool, shape (n_velocities,)
    ///     As in `hybrid_dynamics`.
    /// wrenches : array_like, shape (..., n_bodies, 6), optional
    ///     As in `inverse_dynamics`.
    ///
    /// Returns
    /// -------
    /// found : ndarray, shape (..., n_velocities)
    ///     Of each degree of freedom the acceleration if it is passive, the joint force if it is active.
    /// found_q, found_v, found_known : ndarray, shape (..., n_velocities, n_velocities)
    ///     Its derivatives with respect to q, v and what was known.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> pole = multibody.cart_pendulum()
    /// >>> found, found_q, found_v, found_known = pole.hybrid_dynamics_partials(
    /// ...     [0.0, 0.0], [0.0, 0.0], [1.0, 0.0], ["cart"])
    /// >>> found.round(4), found_known.round(4)
    /// (array([2., 1.]), array([[ 2., -1.],
    ///        [ 1.,  1.]]))
    #[pyo3(signature = (q, v, known, active, wrenches=None))]
    fn hybrid_dynamics_partials<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        known: &Bound<'py, PyAny>,
        active: &Bound<'py, PyAny>,
        wrenches: Option<&Bound<'py, PyAny>>,
    ) -> Result<Four<'py>, Error> {
        let (q, v) = (self.q("q", q)?, self.v("v", v)?);
        let (known, wrenches) = (self.v("known", known)?, self.wrenches(wrenches)?);
        let (split, n) = (self.split(active)?, self.model.n_velocities());
        let found =
            self.map(py, [&q, &v, &known, &wrenches], n + 3 * n * n, |w, [q, v, known, f], out| {
                w.take_wrenches(f);
                let work = w.derivatives.get_or_insert_with(|| DerivativeData::new(&self.model));
                write_all(&self.model.hybrid_dynamics_partials(work, &split, q, v, known, &w.wrenches)?, out);
                Ok(())
            })?;
        Ok(found.arrays(py, [&[n], &[n, n], &[n, n], &[n, n]])?.into())
    }

    /// The centre of mass, the centroidal momentum and their partial derivatives.
    ///
    /// Derivatives with respect to q are along q ⊕ ε e_k, one column for each k.
    ///
    /// Parameters
    /// ----------
    /// q, v : array_like, shape (..., n)
    ///     Configuration and velocity.
    ///
    /// Returns
    /// -------
    /// center : ndarray, shape (..., 3)
    ///     Centre of mass, m.
    /// center_q : ndarray, shape (..., 3, n_velocities)
    ///     Its derivative with respect to q.
    /// momentum : ndarray, shape (..., 6)
    ///     Linear momentum, and angular momentum about the centre of mass, world axes.
    /// momentum_q, momentum_v : ndarray, shape (..., 6, n_velocities)
    ///     Its derivatives with respect to q and v; the latter is `centroidal_matrix`.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import multibody
    /// >>> arm, q, v = multibody.two_link_arm(), [0.1, 0.2], [1.0, -2.0]
    /// >>> center, center_q, momentum, momentum_q, momentum_v = arm.momentum_partials(q, v)
    /// >>> np.allclose(momentum_v, arm.centroidal_matrix(q)), center_q.shape
    /// (True, (3, 2))
    fn momentum_partials<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
    ) -> Result<Five<'py>, Error> {
        let (q, v, n) = (self.q("q", q)?, self.v("v", v)?, self.model.n_velocities());
        let found = self.map(py, [&q, &v], 9 + 15 * n, |w, [q, v], out| {
            let work = w.derivatives.get_or_insert_with(|| DerivativeData::new(&self.model));
            let found = self.model.momentum_partials(work, q, v)?;
            out[..3].copy_from_slice(found.center_of_mass.as_slice());
            write(found.center_of_mass_q, &mut out[3..3 + 3 * n]);
            let out = &mut out[3 + 3 * n..];
            out[..3].copy_from_slice(found.momentum.linear.as_slice());
            out[3..6].copy_from_slice(found.momentum.angular.as_slice());
            write(found.q, &mut out[6..6 + 6 * n]);
            write(found.v, &mut out[6 + 6 * n..]);
            Ok(())
        })?;
        Ok(found.arrays(py, [&[3], &[3, n], &[6], &[6, n], &[6, n]])?.into())
    }
}
