//! Trees of bodies and their dynamics, at one configuration or at many.

use crate::convert::{a_type, orientation, vector_array, vector_or};
use crate::error::Error;
use crate::forces::sequence;
use crate::link::Link;
use crate::rows::{self, Results, Rows, Workspaces};
use pyo3::prelude::*;
use pyo3::types::{PyList, PySlice, PyTuple, PyType};
use somersault::integrators::nalgebra::{DMatrix, Quaternion, UnitQuaternion, Vector3};
use somersault::multibody::{self, Axes, Data, DynamicsError, Force, Joint, Motion, Split, Transform};
use std::f64::consts::PI;
use std::ops::Range;

/// How far the norm of a quaternion may be from one: what is left of one in single precision.
const UNIT: f64 = 1e-6;

/// Where an evaluation computes.
struct Workspace {
    data: Data,
    wrenches: Vec<Force<f64>>,
    jacobian: DMatrix<f64>,
}

impl Workspace {
    fn new(model: &multibody::Model) -> Self {
        Self {
            data: Data::new(model),
            wrenches: Vec::with_capacity(model.n_bodies()),
            jacobian: DMatrix::zeros(6, model.n_velocities()),
        }
    }

    /// Takes six numbers for each body, or none.
    fn take_wrenches(&mut self, numbers: &[f64]) {
        let force = |f: &[f64]| Force::new(Vector3::new(f[0], f[1], f[2]), Vector3::new(f[3], f[4], f[5]));
        self.wrenches.clear();
        self.wrenches.extend(numbers.chunks_exact(6).map(force));
    }
}

/// Tree of rigid bodies.
///
/// Every function takes one configuration or many: where arguments have an axis in front, the result has it
/// too, and arguments without it stand for all. Many are computed in parallel while other Python threads
/// run, and each as it would be alone, to the last bit. Arrays of float64 in the order of C are read in
/// place.
///
/// q has `n_positions` numbers, v, accelerations and joint forces `n_velocities`, by joints in the order of
/// the bodies (see `Link`). Velocities of a joint are in the axes of its body, linear before angular.
/// Quaternions are of unit length.
///
/// Parameters
/// ----------
/// links : sequence of Link
///     The bodies: the root first, every other after its parent.
/// gravity : array_like, shape (3,), optional
///     Acceleration, m/s²; 9.81 along −z unless given.
///
/// Raises
/// ------
/// ModelError
///     If the bodies make no tree.
///
/// Examples
/// --------
/// A pendulum of 1 kg and 1 m, held out level:
///
/// >>> from somersault.multibody import Link, Model
/// >>> bob = Link("bob", "revolute", axis=(0, -1, 0), mass=1.0, center=(1, 0, 0))
/// >>> pendulum = Model([bob], gravity=(0, 0, -9.81))
/// >>> pendulum.forward_dynamics([0.0], [0.0], [0.0])
/// array([-9.81])
#[pyclass(frozen, eq, module = "somersault.multibody")]
pub(crate) struct Model {
    model: multibody::Model,
    workspaces: Workspaces<Workspace>,
}

impl PartialEq for Model {
    fn eq(&self, other: &Self) -> bool {
        self.model.links() == other.model.links() && self.model.gravity() == other.model.gravity()
    }
}

/// A body by its name or its number.
#[derive(FromPyObject)]
enum Which {
    Name(String),
    Number(usize),
}

impl Model {
    pub(crate) fn of(model: multibody::Model) -> Self {
        Self { model, workspaces: Workspaces::default() }
    }

    fn which(&self, body: Which) -> Result<usize, Error> {
        let n_bodies = self.model.n_bodies();
        match body {
            Which::Name(name) => Ok(self.model.body(&name)?),
            Which::Number(i) if i < n_bodies => Ok(i),
            Which::Number(found) => Err(DynamicsError::NoSuchBody { found, n_bodies }.into()),
        }
    }

    /// Configurations, whose quaternions must be of unit length.
    fn q<'py>(&self, name: &'static str, value: &Bound<'py, PyAny>) -> Result<Rows<'py>, Error> {
        let rows = Rows::extract(name, &[self.model.n_positions()], value)?;
        let quaternions = (0..self.model.n_bodies())
            .filter(|i| matches!(self.model.joint(*i), Some(Joint::Spherical | Joint::Free)))
            .map(|i| (i, self.model.positions_of(i).end - 4));
        let all = rows.all()?;
        for (i, start) in quaternions {
            for (n, row) in all.chunks_exact(self.model.n_positions()).enumerate() {
                let norm = row[start..start + 4].iter().map(|x| x * x).sum::<f64>().sqrt();
                if (norm - 1.0).abs() > UNIT {
                    let error = Error::input(format!(
                        "`{name}` must have a unit quaternion at joint '{}', found one of norm {norm}; see `Model.normalize`",
                        self.model.name(i).unwrap_or_default()
                    ));
                    return Err(if rows.is_many() { error.in_row(n) } else { error });
                }
            }
        }
        Ok(rows)
    }

    /// Velocities, accelerations or joint forces.
    fn v<'py>(&self, name: &'static str, value: &Bound<'py, PyAny>) -> Result<Rows<'py>, Error> {
        Rows::extract(name, &[self.model.n_velocities()], value)
    }

    fn wrenches<'py>(&self, value: Option<&Bound<'py, PyAny>>) -> Result<Rows<'py>, Error> {
        Rows::extract_or_empty("wrenches", &[self.model.n_bodies(), 6], value)
    }

    /// Evaluates at every row; `length` is that of a row of the result.
    fn map<const N: usize>(
        &self,
        py: Python<'_>,
        arguments: [&Rows<'_>; N],
        length: usize,
        evaluate: impl Fn(&mut Workspace, [&[f64]; N], &mut [f64]) -> Result<(), DynamicsError> + Sync,
    ) -> Result<Results, Error> {
        let workspace = || Workspace::new(&self.model);
        rows::map(py, arguments, length, self.model.n_bodies(), &self.workspaces, workspace, evaluate)
    }

    /// Which degrees of freedom are active: bodies by name, or a flag for each.
    fn split(&self, value: &Bound<'_, PyAny>) -> Result<Split, Error> {
        let n = self.model.n_velocities();
        if let Ok(names) = value.extract::<Vec<String>>() {
            let names: Vec<_> = names.iter().map(String::as_str).collect();
            return Ok(Split::try_active(&self.model, &names)?);
        }
        match value.extract::<Vec<bool>>() {
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

/// Writes a matrix in the order of C.
fn write(matrix: &DMatrix<f64>, out: &mut [f64]) {
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

fn slice(py: Python<'_>, range: Range<usize>) -> Bound<'_, PySlice> {
    PySlice::new(py, range.start as isize, range.end as isize, 1)
}

#[pymethods]
impl Model {
    #[new]
    #[pyo3(signature = (links, *, gravity=None))]
    fn new(links: &Bound<'_, PyAny>, gravity: Option<&Bound<'_, PyAny>>) -> Result<Self, Error> {
        let wrong =
            |found: String| Error::input(format!("`links` must be a sequence of Link, found {found}"));
        let list = sequence(links).ok_or_else(|| wrong(a_type(links)))?;
        let mut builder = multibody::ModelBuilder::new();
        for entry in list.try_iter()? {
            let entry = entry?;
            let Link(link) = entry.extract().map_err(|_| wrong(format!("{} in it", a_type(&entry))))?;
            builder.add(link)?;
        }
        let gravity = vector_or("gravity", gravity, Vector3::new(0.0, 0.0, -9.81))?;
        Ok(Self::of(builder.with_gravity(gravity).build()?))
    }

    /// list of Link: The bodies with their joints, in their order.
    #[getter]
    fn links<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        PyList::new(py, self.model.links().iter().cloned().map(Link))
    }

    /// list of str: Names of the bodies.
    #[getter]
    fn names(&self) -> Vec<&str> {
        self.model.links().iter().map(multibody::Link::name).collect()
    }

    /// int: Number of bodies.
    #[getter]
    fn n_bodies(&self) -> usize {
        self.model.n_bodies()
    }

    /// int: Numbers in q.
    #[getter]
    fn n_positions(&self) -> usize {
        self.model.n_positions()
    }

    /// int: Degrees of freedom: numbers in v, in accelerations and in joint forces.
    #[getter]
    fn n_velocities(&self) -> usize {
        self.model.n_velocities()
    }

    /// ndarray, shape (3,): Gravitational acceleration, m/s².
    #[getter]
    fn gravity<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        vector_array(py, self.model.gravity())
    }

    /// float: Mass of all bodies, kg.
    #[getter]
    fn mass(&self) -> f64 {
        self.model.mass()
    }

    /// Number of a body.
    ///
    /// Parameters
    /// ----------
    /// name : str
    ///     Its name.
    ///
    /// Raises
    /// ------
    /// DynamicsInputError
    ///     If no body has this name.
    fn body(&self, name: &str) -> Result<usize, Error> {
        Ok(self.model.body(name)?)
    }

    /// Where the joint of a body has its numbers in q.
    ///
    /// Parameters
    /// ----------
    /// body : str or int
    ///     Name or number of the body.
    ///
    /// Returns
    /// -------
    /// slice
    fn positions_of<'py>(&self, py: Python<'py>, body: Which) -> Result<Bound<'py, PySlice>, Error> {
        Ok(slice(py, self.model.positions_of(self.which(body)?)))
    }

    /// Where the joint of a body has its numbers in v.
    ///
    /// Parameters
    /// ----------
    /// body : str or int
    ///     Name or number of the body.
    ///
    /// Returns
    /// -------
    /// slice
    fn velocities_of<'py>(&self, py: Python<'py>, body: Which) -> Result<Bound<'py, PySlice>, Error> {
        Ok(slice(py, self.model.velocities_of(self.which(body)?)))
    }

    /// The configuration with all angles and displacements zero.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_positions,)
    fn neutral<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        numpy::PyArray1::from_vec(py, self.model.neutral()).into_any()
    }

    /// A random configuration.
    ///
    /// Rotations are uniform on SO(3). A coordinate with limits is uniform between them; without, an angle is
    /// uniform within ±π and a displacement within ±1 m.
    ///
    /// Parameters
    /// ----------
    /// seed : int or numpy.random.Generator, optional
    ///     Where the numbers come from, as `numpy.random.default_rng` takes it.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_positions,)
    #[pyo3(signature = (seed=None))]
    fn random<'py>(&self, py: Python<'py>, seed: Option<Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let random = py.import("numpy.random")?.call_method1("default_rng", (seed,))?;
        let uniform = |lower: f64, upper: f64| -> PyResult<f64> {
            random.call_method1("uniform", (lower, upper))?.extract()
        };
        let mut q = Vec::with_capacity(self.model.n_positions());
        for (i, link) in self.model.links().iter().enumerate() {
            let within = |most: f64| {
                let [lower, upper] = self.model.limits(i).unwrap_or([-most, most]);
                uniform(
                    if lower.is_finite() { lower } else { -most },
                    if upper.is_finite() { upper } else { most },
                )
            };
            match link.joint() {
                Joint::Fixed => {}
                Joint::Revolute { .. } => q.push(within(PI)?),
                Joint::Prismatic { .. } => q.push(within(1.0)?),
                Joint::Planar => q.extend([uniform(-1.0, 1.0)?, uniform(-1.0, 1.0)?, uniform(-PI, PI)?]),
                Joint::Spherical | Joint::Free => {
                    if *link.joint() == Joint::Free {
                        q.extend([uniform(-1.0, 1.0)?, uniform(-1.0, 1.0)?, uniform(-1.0, 1.0)?]);
                    }
                    // Normal in ℝ⁴ is uniform in direction.
                    let x: [f64; 4] = random.call_method1("standard_normal", (4,))?.extract()?;
                    let turn = UnitQuaternion::new_normalize(Quaternion::from(x));
                    q.extend(turn.coords.iter());
                }
            }
        }
        Ok(numpy::PyArray1::from_vec(py, q).into_any())
    }

    /// q ⊕ v: moves every joint by the exponential of its group.
    ///
    /// Parameters
    /// ----------
    /// q : array_like, shape (..., n_positions)
    ///     Configuration.
    /// v : array_like, shape (..., n_velocities)
    ///     Velocity times time.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (..., n_positions)
    fn integrate<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (q, v) = (self.q("q", q)?, self.v("v", v)?);
        let n = self.model.n_positions();
        let moved = self.map(py, [&q, &v], n, |_, [q, v], out| self.model.integrate(q, v, out))?;
        Ok(moved.array(py, &[n])?)
    }

    /// The v of least rotation with start ⊕ v = end.
    ///
    /// Unique while rotations differ by less than a half turn.
    ///
    /// Parameters
    /// ----------
    /// start, end : array_like, shape (..., n_positions)
    ///     Configurations.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (..., n_velocities)
    fn difference<'py>(
        &self,
        py: Python<'py>,
        start: &Bound<'py, PyAny>,
        end: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (start, end) = (self.q("start", start)?, self.q("end", end)?);
        let n = self.model.n_velocities();
        let v = self.map(py, [&start, &end], n, |_, [a, b], out| self.model.difference(a, b, out))?;
        Ok(v.array(py, &[n])?)
    }

    /// The configuration with its quaternions brought to unit length.
    ///
    /// Parameters
    /// ----------
    /// q : array_like, shape (..., n_positions)
    ///     Configuration.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (..., n_positions)
    fn normalize<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let n = self.model.n_positions();
        let q = Rows::extract("q", &[n], q)?;
        let normal = self.map(py, [&q], n, |_, [q], out| {
            out.copy_from_slice(q);
            self.model.normalize(out)
        })?;
        Ok(normal.array(py, &[n])?)
    }

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
        let torque = self.map(py, [&q, &v, &a, &wrenches], n, |w, [q, v, a, f], out| {
            w.take_wrenches(f);
            out.copy_from_slice(self.model.inverse_dynamics(&mut w.data, q, v, a, &w.wrenches)?);
            Ok(())
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
        let a = self.map(py, [&q, &v, &torque, &wrenches], n, |w, [q, v, torque, f], out| {
            w.take_wrenches(f);
            out.copy_from_slice(self.model.forward_dynamics(&mut w.data, q, v, torque, &w.wrenches)?);
            Ok(())
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
    fn mass_matrix<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let (q, n) = (self.q("q", q)?, self.model.n_velocities());
        let m = self.map(py, [&q], n * n, |w, [q], out| {
            // Symmetric, so that the order does not matter.
            out.copy_from_slice(self.model.mass_matrix(&mut w.data, q)?.as_slice());
            Ok(())
        })?;
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
    fn bias<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (q, v, n) = (self.q("q", q)?, self.v("v", v)?, self.model.n_velocities());
        let h = self.map(py, [&q, &v], n, |w, [q, v], out| {
            out.copy_from_slice(self.model.bias(&mut w.data, q, v)?);
            Ok(())
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

    fn __repr__(&self) -> String {
        let (bodies, n) = (self.model.n_bodies(), self.model.n_velocities());
        let root = self.model.name(0).unwrap_or_default();
        format!("<Model: {bodies} bodies from '{root}', {n} degrees of freedom, {} kg>", self.model.mass())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, model) = (slf.py(), slf.get());
        let arguments = (model.links(py)?, model.gravity(py)).into_pyobject(py)?;
        Ok((slf.get_type().getattr("_restore")?, arguments))
    }

    /// A pickled model.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        links: &Bound<'_, PyAny>,
        gravity: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        Self::new(links, Some(gravity))
    }
}
