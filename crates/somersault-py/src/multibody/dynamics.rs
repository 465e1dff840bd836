//! Inverse, forward and hybrid dynamics of trees.

use crate::core::convert::{a_type, entries};
use crate::core::error::Error;
use crate::multibody::model::Model;
use pyo3::prelude::*;
use somersault::multibody::Split;

impl Model {
    /// Which degrees of freedom are active: bodies by name, or a flag for each.
    pub(crate) fn split(&self, value: &Bound<'_, PyAny>) -> Result<Split, Error> {
        let n = self.model.n_velocities();
        if let Ok(names) = entries::<String>(value) {
            let names: Vec<_> = names.iter().map(String::as_str).collect();
            return Ok(Split::try_active(&self.model, &names)?);
        }
        match entries::<bool>(value) {
            Ok(flags) if flags.len() == n => Ok(Split::new(flags)),
            Ok(flags) => Err(Error::input(format!(
                "`active` must hold names of bodies or {n} booleans, found {} of them",
                flags.len()
            ))),
            Err(_) => Err(Error::input(format!(
                "`active` must hold names of bodies or {n} booleans, found {}",
                a_type(value)
            ))),
        }
    }
}

#[pymethods]
impl Model {
    /// Joint forces that produce an acceleration: τ = M(q) a + h(q, v) − Σ Jᵀ f.
    ///
    /// Parameters
    /// ----------
    /// q, v, a : array_like, shape (..., n)
    ///     Configuration, velocity and acceleration.
    /// wrenches : array_like, shape (..., n_bodies, 6), optional
    ///     Force, N, and moment about the origin of the body, N m, on every body, in its axes.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (..., n_velocities)
    ///     Forces, N for linear and N m for angular degrees of freedom.
    ///
    /// Examples
    /// --------
    /// The forces that move a cart at 1 m/s² while its pole stays upright:
    ///
    /// >>> from somersault import multibody
    /// >>> pole = multibody.cart_pendulum(cart_mass=2.0, mass=1.0)
    /// >>> pole.inverse_dynamics([0.0, 0.0], [0.0, 0.0], [1.0, 0.0])
    /// array([ 3., -1.])
    #[pyo3(signature = (q, v, a, wrenches=None))]
    fn inverse_dynamics<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        a: &Bound<'py, PyAny>,
        wrenches: Option<&Bound<'py, PyAny>>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (q, v, a, wrenches) =
            (self.q("q", q)?, self.v("v", v)?, self.v("a", a)?, self.wrenches(wrenches)?);
        let n = self.model.n_velocities();
        let torque = self.map_lanes(py, [&q, &v, &a, &wrenches], n, |data, [q, v, a, f], out| {
            self.model.inverse_dynamics_many(data, q, v, a, f, out)
        })?;
        Ok(torque.array(py, &[n])?)
    }

    /// Accelerations under joint forces: M(q) a = τ − h(q, v) + Σ Jᵀ f.
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
    /// ndarray, shape (..., n_velocities)
    ///
    /// Raises
    /// ------
    /// DynamicsError
    ///     If some motion of a joint moves no mass.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> pole = multibody.cart_pendulum(cart_mass=2.0, mass=1.0)
    /// >>> pole.forward_dynamics([0.0, 0.0], [0.0, 0.0], [6.0, 0.0])
    /// array([3., 3.])
    #[pyo3(signature = (q, v, torque, wrenches=None))]
    fn forward_dynamics<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        torque: &Bound<'py, PyAny>,
        wrenches: Option<&Bound<'py, PyAny>>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (q, v) = (self.q("q", q)?, self.v("v", v)?);
        let (torque, wrenches) = (self.v("torque", torque)?, self.wrenches(wrenches)?);
        let n = self.model.n_velocities();
        let a = self.map_lanes(py, [&q, &v, &torque, &wrenches], n, |data, [q, v, torque, f], out| {
            self.model.forward_dynamics_many(data, q, v, torque, f, out)
        })?;
        Ok(a.array(py, &[n])?)
    }

    /// Accelerations of passive and forces of active degrees of freedom.
    ///
    /// Parameters
    /// ----------
    /// q, v : array_like, shape (..., n)
    ///     Configuration and velocity.
    /// a : array_like, shape (..., n_velocities)
    ///     Accelerations of the active degrees of freedom; the others are not used.
    /// torque : array_like, shape (..., n_velocities)
    ///     Forces of the passive degrees of freedom; the others are not used.
    /// active : sequence of str, or array_like of bool, shape (n_velocities,)
    ///     Bodies whose joints are active, or a flag for each degree of freedom.
    /// wrenches : array_like, shape (..., n_bodies, 6), optional
    ///     As in `inverse_dynamics`.
    ///
    /// Returns
    /// -------
    /// a, torque : ndarray, shape (..., n_velocities)
    ///     Both complete, with M a + h = τ + Σ Jᵀ f.
    ///
    /// Raises
    /// ------
    /// DynamicsError
    ///     If some motion of a passive joint moves no mass.
    ///
    /// Examples
    /// --------
    /// The cart is moved at 1 m/s²; what force it takes, and how the pole falls:
    ///
    /// >>> from somersault import multibody
    /// >>> pole = multibody.cart_pendulum(cart_mass=2.0, mass=1.0)
    /// >>> a, torque = pole.hybrid_dynamics([0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 0.0], ["cart"])
    /// >>> a.round(6), torque.round(6)
    /// (array([1., 1.]), array([2., 0.]))
    #[pyo3(signature = (q, v, a, torque, active, wrenches=None))]
    fn hybrid_dynamics<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        a: &Bound<'py, PyAny>,
        torque: &Bound<'py, PyAny>,
        active: &Bound<'py, PyAny>,
        wrenches: Option<&Bound<'py, PyAny>>,
    ) -> Result<(Bound<'py, PyAny>, Bound<'py, PyAny>), Error> {
        let (q, v, a) = (self.q("q", q)?, self.v("v", v)?, self.v("a", a)?);
        let (torque, wrenches) = (self.v("torque", torque)?, self.wrenches(wrenches)?);
        let split = self.split(active)?;
        let n = self.model.n_velocities();
        let both =
            self.map(py, [&q, &v, &a, &torque, &wrenches], 2 * n, |w, [q, v, a, torque, f], out| {
                w.take_wrenches(f);
                let (acceleration, force) = out.split_at_mut(n);
                acceleration.copy_from_slice(a);
                force.copy_from_slice(torque);
                self.model.hybrid_dynamics(&mut w.data, &split, q, v, acceleration, force, &w.wrenches)
            })?;
        let [a, torque] = both.arrays(py, [&[n], &[n]])?;
        Ok((a, torque))
    }

    /// Mass matrix M(q).
    ///
    /// Parameters
    /// ----------
    /// q : array_like, shape (..., n_positions)
    ///     Configuration.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (..., n_velocities, n_velocities)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> arm = multibody.two_link_arm(masses=(3.0, 3.0), lengths=(1.0, 1.0))
    /// >>> arm.mass_matrix([0.0, 0.0]).round(3)
    /// array([[8. , 2.5],
    ///        [2.5, 1. ]])
    fn mass_matrix<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let (q, n) = (self.q("q", q)?, self.model.n_velocities());
        let m =
            self.map_lanes(py, [&q], n * n, |data, [q], out| self.model.mass_matrix_many(data, q, out))?;
        Ok(m.array(py, &[n, n])?)
    }

    /// Bias h(q, v): Coriolis and centrifugal forces, damping and weight.
    ///
    /// Parameters
    /// ----------
    /// q, v : array_like, shape (..., n)
    ///     Configuration and velocity.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (..., n_velocities)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> arm = multibody.two_link_arm(damping=(0.2, 0.1))
    /// >>> arm.bias([0.0, 0.0], [1.0, 2.0]).round(6)
    /// array([0.2, 0.2])
    fn bias<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (q, v, n) = (self.q("q", q)?, self.v("v", v)?, self.model.n_velocities());
        let at_rest = vec![0.0; n];
        let h = self.map_lanes(py, [&q, &v], n, |data, [q, v], out| {
            self.model.inverse_dynamics_many(data, q, v, &at_rest, &[], out)
        })?;
        Ok(h.array(py, &[n])?)
    }

    /// Joint forces that hold the tree at rest against gravity.
    ///
    /// Parameters
    /// ----------
    /// q : array_like, shape (..., n_positions)
    ///     Configuration.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (..., n_velocities)
    ///
    /// Examples
    /// --------
    /// >>> from somersault.multibody import Link, Model
    /// >>> pendulum = Model([Link("bob", "revolute", axis=(0, -1, 0), mass=2.0, center=(0.5, 0, 0))])
    /// >>> pendulum.gravity_forces([0.0])
    /// array([9.81])
    fn gravity_forces<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (q, n) = (self.q("q", q)?, self.model.n_velocities());
        let g = self.map(py, [&q], n, |w, [q], out| {
            out.copy_from_slice(self.model.gravity_forces(&mut w.data, q)?);
            Ok(())
        })?;
        Ok(g.array(py, &[n])?)
    }
}
