//! Where the bodies of trees are and how they move, their momentum and energy.

use crate::core::convert::{orientation, vector_or};
use crate::core::error::Error;
use crate::multibody::model::{Model, Which};
use pyo3::prelude::*;
use somersault::integrators::nalgebra::{DMatrix, UnitQuaternion, Vector3};
use somersault::multibody::{Axes, Motion, Transform};

/// Writes a matrix in the order of C.
pub(crate) fn write(matrix: &DMatrix<f64>, out: &mut [f64]) {
    for (row, out) in matrix.row_iter().zip(out.chunks_exact_mut(matrix.ncols().max(1))) {
        for (x, out) in row.iter().zip(out) {
            *out = *x;
        }
    }
}

fn write_motion(motion: &Motion<f64>, out: &mut [f64]) {
    out[..3].copy_from_slice(motion.linear.as_slice());
    out[3..].copy_from_slice(motion.angular.as_slice());
}

#[pymethods]
impl Model {
    /// Jacobian J of a frame fixed in a body: J v is the velocity of its origin, and below it its angular
    /// velocity.
    ///
    /// Parameters
    /// ----------
    /// q : array_like, shape (..., n_positions)
    ///     Configuration.
    /// body : str or int
    ///     Name or number of the body.
    /// point : array_like, shape (3,), optional
    ///     Origin of the frame in the body, m.
    /// orientation : Rotation or array_like, shape (4,) or (3, 3), optional
    ///     Rotation from the frame to the body.
    /// axes : {'world', 'frame'}, optional
    ///     The axes that J v is in.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (..., 6, n_velocities)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> arm = multibody.two_link_arm(lengths=(1.0, 1.0))
    /// >>> arm.jacobian([0.0, 0.0], "lower", point=(1.0, 0.0, 0.0))[:2].round(6)
    /// array([[0., 0.],
    ///        [2., 1.]])
    #[pyo3(signature = (q, body, *, point=None, orientation=None, axes="world"))]
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        body: Which,
        point: Option<&Bound<'py, PyAny>>,
        orientation: Option<&Bound<'py, PyAny>>,
        axes: &str,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (q, i, n) = (self.q("q", q)?, self.which(body)?, self.model.n_velocities());
        let turn =
            orientation.map_or(Ok(UnitQuaternion::identity()), |o| self::orientation("orientation", o))?;
        let frame = Transform::from_parts(&turn, vector_or("point", point, Vector3::zeros())?);
        let axes = match axes {
            "world" => Axes::World,
            "frame" => Axes::Frame,
            _ => return Err(Error::input(format!("`axes` must be 'world' or 'frame', found '{axes}'"))),
        };
        let jacobian = self.map(py, [&q], 6 * n, |w, [q], out| {
            self.model.positions(&mut w.data, q)?.jacobian_into(i, &frame, axes, &mut w.jacobian)?;
            write(&w.jacobian, out);
            Ok(())
        })?;
        Ok(jacobian.array(py, &[6, n])?)
    }

    /// Poses of all bodies in the world, as homogeneous matrices [[R, p], [0, 1]].
    ///
    /// Parameters
    /// ----------
    /// q : array_like, shape (..., n_positions)
    ///     Configuration.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (..., n_bodies, 4, 4)
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import multibody
    /// >>> arm = multibody.two_link_arm(lengths=(1.0, 1.0))
    /// >>> arm.poses([np.pi / 2, 0.0])[1, :3, 3].round(6)
    /// array([0., 1., 0.])
    fn poses<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let (q, n) = (self.q("q", q)?, self.model.n_bodies());
        let poses = self.map(py, [&q], 16 * n, |w, [q], out| {
            let positions = self.model.positions(&mut w.data, q)?;
            for (i, out) in out.chunks_exact_mut(16).enumerate() {
                let pose = positions.pose(i)?;
                for r in 0..3 {
                    for c in 0..3 {
                        out[4 * r + c] = pose.rotation[(r, c)];
                    }
                    out[4 * r + 3] = pose.translation[r];
                }
                out[15] = 1.0;
            }
            Ok(())
        })?;
        Ok(poses.array(py, &[n, 4, 4])?)
    }

    /// Velocities of all bodies: of the origin, m/s, and angular, rad/s, in the axes of the body.
    ///
    /// Parameters
    /// ----------
    /// q, v : array_like, shape (..., n)
    ///     Configuration and velocity.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (..., n_bodies, 6)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> arm = multibody.two_link_arm(lengths=(1.0, 1.0))
    /// >>> arm.velocities([0.0, 0.0], [2.0, 0.0])[1].round(6)
    /// array([0., 2., 0., 0., 0., 2.])
    fn velocities<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (q, v, n) = (self.q("q", q)?, self.v("v", v)?, self.model.n_bodies());
        let velocities = self.map(py, [&q, &v], 6 * n, |w, [q, v], out| {
            let velocities = self.model.velocities(&mut w.data, q, v)?;
            for (i, out) in out.chunks_exact_mut(6).enumerate() {
                write_motion(&velocities.velocity(i)?, out);
            }
            Ok(())
        })?;
        Ok(velocities.array(py, &[n, 6])?)
    }

    /// Spatial accelerations of all bodies, in the axes of the body: the rates of `velocities` in an inertial
    /// frame that coincides with the body.
    ///
    /// The origin itself accelerates with the linear part and ω × v.
    ///
    /// Parameters
    /// ----------
    /// q, v, a : array_like, shape (..., n)
    ///     Configuration, velocity and acceleration.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (..., n_bodies, 6)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> arm = multibody.two_link_arm(lengths=(1.0, 1.0))
    /// >>> arm.accelerations([0.0, 0.0], [0.0, 0.0], [2.0, 0.0])[1].round(6)
    /// array([0., 2., 0., 0., 0., 2.])
    fn accelerations<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        a: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (q, v, a, n) = (self.q("q", q)?, self.v("v", v)?, self.v("a", a)?, self.model.n_bodies());
        let accelerations = self.map(py, [&q, &v, &a], 6 * n, |w, [q, v, a], out| {
            let accelerations = self.model.accelerations(&mut w.data, q, v, a)?;
            for (i, out) in out.chunks_exact_mut(6).enumerate() {
                write_motion(&accelerations.acceleration(i)?, out);
            }
            Ok(())
        })?;
        Ok(accelerations.array(py, &[n, 6])?)
    }

    /// Centre of mass of the tree in the world, m.
    ///
    /// Parameters
    /// ----------
    /// q : array_like, shape (..., n_positions)
    ///     Configuration.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (..., 3)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> arm = multibody.two_link_arm(masses=(1.0, 1.0), lengths=(1.0, 1.0))
    /// >>> arm.center_of_mass([0.0, 0.0])
    /// array([1., 0., 0.])
    fn center_of_mass<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let q = self.q("q", q)?;
        let center = self.map(py, [&q], 3, |w, [q], out| {
            out.copy_from_slice(self.model.positions(&mut w.data, q)?.center_of_mass().as_slice());
            Ok(())
        })?;
        Ok(center.array(py, &[3])?)
    }

    /// Momentum of the tree: linear, kg m/s, and angular about the centre of mass, kg m²/s, world axes.
    ///
    /// Parameters
    /// ----------
    /// q, v : array_like, shape (..., n)
    ///     Configuration and velocity.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (..., 6)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> arm = multibody.two_link_arm(masses=(1.0, 1.0), lengths=(1.0, 1.0))
    /// >>> arm.centroidal_momentum([0.0, 0.0], [1.0, 0.0]).round(6)
    /// array([0.      , 2.      , 0.      , 0.      , 0.      , 0.666667])
    fn centroidal_momentum<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (q, v) = (self.q("q", q)?, self.v("v", v)?);
        let momentum = self.map(py, [&q, &v], 6, |w, [q, v], out| {
            let momentum = self.model.centroidal(&mut w.data, q)?.momentum(v)?;
            out[..3].copy_from_slice(momentum.linear.as_slice());
            out[3..].copy_from_slice(momentum.angular.as_slice());
            Ok(())
        })?;
        Ok(momentum.array(py, &[6])?)
    }

    /// The matrix A with A v the `centroidal_momentum`.
    ///
    /// Parameters
    /// ----------
    /// q : array_like, shape (..., n_positions)
    ///     Configuration.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (..., 6, n_velocities)
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import multibody
    /// >>> arm, q, v = multibody.two_link_arm(), [0.1, 0.2], np.array([1.0, -2.0])
    /// >>> np.allclose(arm.centroidal_matrix(q) @ v, arm.centroidal_momentum(q, v))
    /// True
    fn centroidal_matrix<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (q, n) = (self.q("q", q)?, self.model.n_velocities());
        let matrix = self.map(py, [&q], 6 * n, |w, [q], out| {
            write(self.model.centroidal(&mut w.data, q)?.matrix, out);
            Ok(())
        })?;
        Ok(matrix.array(py, &[6, n])?)
    }

    /// Kinetic energy, J.
    ///
    /// Parameters
    /// ----------
    /// q, v : array_like, shape (..., n)
    ///     Configuration and velocity.
    ///
    /// Returns
    /// -------
    /// float or ndarray, shape (n,)
    ///
    /// Examples
    /// --------
    /// One configuration, or many at once:
    ///
    /// >>> from somersault import multibody
    /// >>> cart = multibody.cart_pendulum(cart_mass=2.0, mass=1.0)
    /// >>> cart.kinetic_energy([0.0, 0.0], [2.0, 0.0])
    /// 6.0
    /// >>> cart.kinetic_energy([0.0, 0.0], [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    /// array([0. , 1.5, 6. ])
    fn kinetic_energy<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (q, v) = (self.q("q", q)?, self.v("v", v)?);
        let energy = self.map(py, [&q, &v], 1, |w, [q, v], out| {
            out[0] = self.model.velocities(&mut w.data, q, v)?.kinetic_energy();
            Ok(())
        })?;
        Ok(energy.scalars(py)?)
    }

    /// Potential energy in gravity, J; zero at the origin of the world.
    ///
    /// Parameters
    /// ----------
    /// q : array_like, shape (..., n_positions)
    ///     Configuration.
    ///
    /// Returns
    /// -------
    /// float or ndarray, shape (n,)
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import multibody
    /// >>> cart = multibody.cart_pendulum(mass=1.0, length=1.0)
    /// >>> cart.potential_energy([[0.0, 0.0], [0.0, np.pi]]).round(6)
    /// array([ 9.81, -9.81])
    fn potential_energy<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let q = self.q("q", q)?;
        let energy = self.map(py, [&q], 1, |w, [q], out| {
            out[0] = self.model.positions(&mut w.data, q)?.potential_energy();
            Ok(())
        })?;
        Ok(energy.scalars(py)?)
    }
}
