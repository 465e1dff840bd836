//! Trees of bodies and their dynamics, at one configuration or at many.

use crate::core::convert::{a_type, key_of, sequence, vector, vector_array, vector_or};
use crate::core::error::{Error, did_you_mean};
use crate::core::rows::{self, Block, Results, Rows, Workspaces};
use crate::core::value::{Pickled, brief, by_restore, counted, digits, few, value};
use crate::multibody::link::Link;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PySlice, PyType};
use somersault::integrators::nalgebra::{DMatrix, Quaternion, UnitQuaternion, Vector3};
use somersault::multibody::flight::FlightShapes;
use somersault::multibody::{
    self, Data, DerivativeData, DynamicsError, Force, JointKind, LaneData, LaneDerivativeData, Turning,
};
use std::f64::consts::PI;
use std::ops::Range;

/// How far the norm of a quaternion may be from one: what is left of one in single precision.
const UNIT: f64 = 1e-6;

/// Where an evaluation computes.
pub(crate) struct Workspace {
    pub(crate) data: Data,
    pub(crate) wrenches: Vec<Force<f64>>,
    pub(crate) jacobian: DMatrix<f64>,
    /// Made when they are first needed.
    pub(crate) derivatives: Option<DerivativeData>,
    lanes: Option<LaneData>,
    lane_derivatives: Option<LaneDerivativeData>,
    flights: FlightShapes,
}

impl Workspace {
    fn new(model: &multibody::Model) -> Self {
        Self {
            data: Data::new(model),
            wrenches: Vec::with_capacity(model.n_bodies()),
            jacobian: DMatrix::zeros(6, model.n_velocities()),
            derivatives: None,
            lanes: None,
            lane_derivatives: None,
            flights: FlightShapes::default(),
        }
    }

    /// Takes six numbers for each body, or none.
    pub(crate) fn take_wrenches(&mut self, numbers: &[f64]) {
        let force = |f: &[f64]| Force::new(Vector3::new(f[0], f[1], f[2]), Vector3::new(f[3], f[4], f[5]));
        self.wrenches.clear();
        self.wrenches.extend(numbers.chunks_exact(6).map(force));
    }
}

/// Tree of rigid bodies.
///
/// Every function takes one configuration or many: where arguments have an axis in front, the result has it
/// too, and arguments without it stand for all. Many are computed in parallel while other Python threads
/// run, and each as it would be alone, to the last bit; of inverse and forward dynamics, their partial derivatives, the
/// mass matrix and the bias several at a time in vector instructions. Arrays of float64 in the order of C are read in place.
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
/// InputError
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
    pub(crate) model: multibody::Model,
    workspaces: Workspaces<Workspace>,
}

impl PartialEq for Model {
    fn eq(&self, other: &Self) -> bool {
        self.model.links() == other.model.links() && self.model.gravity() == other.model.gravity()
    }
}

/// A body by its name or its number.
#[derive(FromPyObject)]
pub(crate) enum Which {
    Name(String),
    Number(usize),
}

impl Model {
    pub(crate) fn of(model: multibody::Model) -> Self {
        Self { model, workspaces: Workspaces::default() }
    }

    fn body_of(&self, name: &str) -> Result<usize, Error> {
        self.model.body(name).map_err(|error| {
            let known: Vec<&str> = self.model.links().iter().map(multibody::Link::name).collect();
            let meant = match did_you_mean(name, known.iter().copied()) {
                meant if meant.is_empty() => format!("; the bodies are {}", few(&known)),
                meant => meant,
            };
            Error::from(error).followed_by(&meant)
        })
    }

    pub(crate) fn which(&self, body: Which) -> Result<usize, Error> {
        let n_bodies = self.model.n_bodies();
        match body {
            Which::Name(name) => self.body_of(&name),
            Which::Number(i) if i < n_bodies => Ok(i),
            Which::Number(found) => Err(DynamicsError::NoSuchBody { found, n_bodies }.into()),
        }
    }

    /// Configurations, whose quaternions must be of unit length.
    pub(crate) fn q<'py>(&self, name: &'static str, value: &Bound<'py, PyAny>) -> Result<Rows<'py>, Error> {
        let rows = Rows::extract(name, &[self.model.n_positions()], value)?;
        let quaternions = (0..self.model.n_bodies()).filter_map(|i| Some((i, self.model.quaternion_of(i)?)));
        let all = rows.all()?;
        for (i, quaternion) in quaternions {
            for (n, row) in all.chunks_exact(self.model.n_positions()).enumerate() {
                let norm = row[quaternion.clone()].iter().map(|x| x * x).sum::<f64>().sqrt();
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
    pub(crate) fn v<'py>(&self, name: &'static str, value: &Bound<'py, PyAny>) -> Result<Rows<'py>, Error> {
        Rows::extract(name, &[self.model.n_velocities()], value)
    }

    pub(crate) fn wrenches<'py>(&self, value: Option<&Bound<'py, PyAny>>) -> Result<Rows<'py>, Error> {
        Rows::extract_or_empty("wrenches", &[self.model.n_bodies(), 6], value)
    }

    /// Evaluates at every row; `length` is that of a row of the result.
    pub(crate) fn map<const N: usize>(
        &self,
        py: Python<'_>,
        arguments: [&Rows<'_>; N],
        length: usize,
        evaluate: impl Fn(&mut Workspace, [&[f64]; N], &mut [f64]) -> Result<(), DynamicsError> + Sync,
    ) -> Result<Results, Error> {
        let workspace = || Workspace::new(&self.model);
        rows::map(py, arguments, length, self.model.n_bodies(), &self.workspaces, workspace, evaluate)
    }

    /// Evaluates at every row, several in lanes; `length` is that of a row of the result.
    pub(crate) fn map_lanes<const N: usize>(
        &self,
        py: Python<'_>,
        arguments: [&Rows<'_>; N],
        length: usize,
        evaluate: impl Fn(&mut LaneData, [&[f64]; N], &mut [f64]) -> Result<(), DynamicsError> + Sync,
    ) -> Result<Results, Error> {
        self.map_rows(py, arguments, length, |w, numbers, out| {
            evaluate(w.lanes.get_or_insert_with(|| LaneData::new(&self.model)), numbers, out)
        })
    }

    /// The same with a workspace for partials, whose rows have a result and its three matrices.
    pub(crate) fn map_partials<const N: usize>(
        &self,
        py: Python<'_>,
        arguments: [&Rows<'_>; N],
        evaluate: impl Fn(&mut LaneDerivativeData, [&[f64]; N], &mut [f64]) -> Result<(), DynamicsError> + Sync,
    ) -> Result<Results, Error> {
        let n = self.model.n_velocities();
        self.map_rows(py, arguments, n + 3 * n * n, |w, numbers, out| {
            let work = w.lane_derivatives.get_or_insert_with(|| LaneDerivativeData::new(&self.model));
            evaluate(work, numbers, out)
        })
    }

    /// The same with a workspace for flights; `length` is that of a row of the result.
    pub(crate) fn map_flights<const N: usize>(
        &self,
        py: Python<'_>,
        arguments: [&Rows<'_>; N],
        length: usize,
        evaluate: impl Fn(&mut FlightShapes, [&[f64]; N], &mut [f64]) -> Result<(), DynamicsError> + Sync,
    ) -> Result<Results, Error> {
        self.map_rows(py, arguments, length, |w, numbers, out| evaluate(&mut w.flights, numbers, out))
    }

    /// Evaluates blocks of rows.
    fn map_rows<const N: usize>(
        &self,
        py: Python<'_>,
        arguments: [&Rows<'_>; N],
        length: usize,
        evaluate: impl Fn(&mut Workspace, [&[f64]; N], &mut [f64]) -> Result<(), DynamicsError> + Sync,
    ) -> Result<Results, Error> {
        let workspace = || Workspace::new(&self.model);
        let evaluate = |w: &mut Workspace, blocks: [Block<'_>; N], out: &mut [f64]| {
            evaluate(w, blocks.map(|block| block.numbers), out).map_err(|error| match error {
                DynamicsError::InState { index, source } => (index, *source),
                error => (0, error),
            })
        };
        let (work, size) = (self.model.n_bodies(), (length, LaneData::MOST));
        rows::map_blocks(py, arguments, size, work, &self.workspaces, workspace, evaluate)
    }
}

/// Sizes by names: one for all axes, or one along each.
pub(crate) fn sizes_of(scales: &Bound<'_, PyDict>) -> Result<Vec<(String, Vector3<f64>)>, Error> {
    let size = |(name, size): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let name = key_of("scales", &name)?;
        let of_all = size.extract::<f64>().ok();
        let size = match of_all {
            Some(size) => Vector3::repeat(size),
            None => vector(&format!("scales['{name}']"), &size)?,
        };
        Ok((name, size))
    };
    scales.iter().map(size).collect()
}

fn slice(py: Python<'_>, range: Range<usize>) -> Bound<'_, PySlice> {
    PySlice::new(py, range.start as isize, range.end as isize, 1)
}

value! {
    impl Model {
        /// list of Link: The bodies with their joints, in their order.
        links: PyResult<Bound<'py, PyList>> =
            |own, py| PyList::new(py, own.model.links().iter().cloned().map(Link));
        /// list of str: Names of the bodies.
        names: Vec<&str> = |own| own.model.links().iter().map(multibody::Link::name).collect();
        /// int: Number of bodies.
        n_bodies: usize = |own| own.model.n_bodies();
        /// int: Numbers in q.
        n_positions: usize = |own| own.model.n_positions();
        /// int: Degrees of freedom: numbers in v, in accelerations and in joint forces.
        n_velocities: usize = |own| own.model.n_velocities();
        /// ndarray, shape (3,): Gravitational acceleration, m/s².
        gravity: Bound<'py, PyAny> = |own, py| vector_array(py, own.model.gravity());
        /// float: Mass of all bodies, kg.
        mass: f64 = |own| own.model.mass();
    }
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

    /// Number of a body.
    ///
    /// Parameters
    /// ----------
    /// name : str
    ///     Its name.
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If no body has this name.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> multibody.cart_pendulum().body("pendulum")
    /// 1
    fn body(&self, name: &str) -> Result<usize, Error> {
        self.body_of(name)
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> model = multibody.diver_planar().model
    /// >>> model.positions_of("thigh")
    /// slice(4, 5, 1)
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> multibody.cart_pendulum().velocities_of("pendulum")
    /// slice(1, 2, 1)
    fn velocities_of<'py>(&self, py: Python<'py>, body: Which) -> Result<Bound<'py, PySlice>, Error> {
        Ok(slice(py, self.model.velocities_of(self.which(body)?)))
    }

    /// The same tree with bodies of other sizes, whose masses it keeps.
    ///
    /// Joints that a body carries, and its centre of mass, go from p to S p, the second moments Σ of its mass about its centre to
    /// S Σ S, where S is the diagonal matrix of the sizes. Limits stay, and so do coordinates of prismatic joints.
    ///
    /// Parameters
    /// ----------
    /// scales : dict of str to float or array_like, shape (3,)
    ///     For some bodies, by their names, the size over that of this model: one number, or one along each axis of the body. From
    ///     0.01 to 100.
    ///
    /// Returns
    /// -------
    /// Model
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If the model has no such body, or a number is not allowed.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> arm = multibody.two_link_arm()
    /// >>> longer = arm.scaled({"upper": 1.5})
    /// >>> arm.links[1].origin, longer.links[1].origin, longer.mass == arm.mass
    /// (array([2., 0., 0.]), array([3., 0., 0.]), True)
    fn scaled(&self, scales: &Bound<'_, PyDict>) -> Result<Self, Error> {
        let mut sizes = vec![Vector3::repeat(1.0); self.model.n_bodies()];
        for (name, size) in sizes_of(scales)? {
            sizes[self.body_of(&name)?] = size;
        }
        Ok(Self::of(self.model.scaled(&sizes)?))
    }

    /// The configuration with all angles and displacements zero.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_positions,)
    ///
    /// Examples
    /// --------
    /// >>> from somersault.multibody import Link, Model
    /// >>> Model([Link("satellite", "free", mass=1.0, inertia=(1, 1, 1))]).neutral()
    /// array([0., 0., 0., 0., 0., 0., 1.])
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> arm = multibody.two_link_arm()
    /// >>> bool((arm.random(seed=1) == arm.random(seed=1)).all())
    /// True
    #[pyo3(signature = (seed=None))]
    fn random<'py>(&self, py: Python<'py>, seed: Option<Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let random = py.import("numpy.random")?.call_method1("default_rng", (seed,))?;
        let uniform = |lower: f64, upper: f64| -> PyResult<f64> {
            random.call_method1("uniform", (lower, upper))?.extract()
        };
        let mut q = Vec::with_capacity(self.model.n_positions());
        for (i, link) in self.model.links().iter().enumerate().filter(|(_, link)| link.mimic().is_none()) {
            let within = |most: f64| {
                let [lower, upper] = self.model.limits(i).unwrap_or([-most, most]);
                uniform(
                    if lower.is_finite() { lower } else { -most },
                    if upper.is_finite() { upper } else { most },
                )
            };
            let JointKind { n_linear, turning, .. } = link.joint().kind();
            // A joint of one number has limits.
            let one = n_linear + usize::from(turning == Turning::Angle) == 1;
            for _ in 0..n_linear {
                q.push(if one { within(1.0)? } else { uniform(-1.0, 1.0)? });
            }
            match turning {
                Turning::None => {}
                Turning::Angle => q.push(if one { within(PI)? } else { uniform(-PI, PI)? }),
                Turning::Rotation => {
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
    ///
    /// Examples
    /// --------
    /// A quarter turn about the own x axis:
    ///
    /// >>> import numpy as np
    /// >>> from somersault.multibody import Link, Model
    /// >>> satellite = Model([Link("satellite", "free", mass=1.0, inertia=(1, 1, 1))])
    /// >>> satellite.displace(satellite.neutral(), [0, 0, 0, np.pi / 2, 0, 0]).round(6)
    /// array([0.      , 0.      , 0.      , 0.707107, 0.      , 0.      ,
    ///        0.707107])
    fn displace<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyAny>, Error> {
        let (q, v) = (self.q("q", q)?, self.v("v", v)?);
        let n = self.model.n_positions();
        let moved = self.map(py, [&q, &v], n, |_, [q, v], out| self.model.displace(q, v, out))?;
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
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault.multibody import Link, Model
    /// >>> satellite = Model([Link("satellite", "free", mass=1.0, inertia=(1, 1, 1))])
    /// >>> turned = [0.0, 0.0, 0.0, 0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]
    /// >>> satellite.difference(satellite.neutral(), turned).round(6)
    /// array([0.      , 0.      , 0.      , 0.      , 0.      , 1.570796])
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault.multibody import Link, Model
    /// >>> ball = Model([Link("ball", "spherical", mass=1.0, inertia=(1, 1, 1))])
    /// >>> ball.normalize([0.0, 0.0, 0.0, 2.0])
    /// array([0., 0., 0., 1.])
    fn normalize<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let n = self.model.n_positions();
        let q = Rows::extract("q", &[n], q)?;
        let normal = self.map(py, [&q], n, |_, [q], out| {
            out.copy_from_slice(q);
            self.model.normalize(out)
        })?;
        Ok(normal.array(py, &[n])?)
    }

    fn __repr__(&self) -> String {
        let bodies = counted(self.model.n_bodies(), "body", "bodies");
        let freedom = counted(self.model.n_velocities(), "degree", "degrees");
        let root = brief(self.model.name(0).unwrap_or_default(), 40);
        format!("<Model: {bodies} from '{root}', {freedom} of freedom, {} kg>", digits(self.model.mass()))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, model) = (slf.py(), slf.get());
        by_restore(slf, (model.links(py)?, model.gravity(py)))
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
