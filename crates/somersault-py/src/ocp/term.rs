//! Terms of costs and constraints: what Python says of them, and what the library makes of it.

use super::arguments::{count, finite_all, index, integers_or_none};
use crate::core::callable::check_callable;
use crate::core::convert::{
    a_type, components, entries_or_none, integer, orientation, real_numbers, vector, with_shape,
};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::integrators::nalgebra::{UnitQuaternion, Vector3};
use somersault::multibody;
use somersault::ocp::dynamics::{HybridDynamics, Tree};
use somersault::ocp::term::{
    self, AxisDirection, BodyOrientation, Displacement, Entries, Function, Momentum, MomentumPart, Node,
    NodeGradient, Part, PointPosition, UserError,
};
use somersault::ocp::transcription::NodeSizes;

/// Rows of numbers made of a motion at one time: what costs and constraints are made of.
///
/// Made by the functions of `somersault.ocp`: `entries`, `displacement`, `momentum`, `point_position`,
/// `axis_direction`, `body_orientation` and `function`.
#[pyclass(frozen, module = "somersault.ocp")]
pub(crate) struct Term(Kind);

enum Kind {
    Entries { part: Part, entries: Option<Vec<usize>> },
    Displacement { reference: Vec<f64>, dofs: Option<Vec<usize>> },
    Momentum(MomentumPart),
    PointPosition { body: String, point: Vector3<f64> },
    AxisDirection { body: String, axis: Vector3<f64> },
    BodyOrientation { body: String, target: UnitQuaternion<f64> },
    Function { callable: Py<PyAny>, gradient: Option<Py<PyAny>>, n_rows: usize, reads: Vec<Read> },
}

/// A part of a node that a function reads.
#[derive(Clone, Copy, PartialEq)]
enum Read {
    Position,
    Part(Part),
}

const PARTS: [(&str, Part); 7] = [
    ("time", Part::Time),
    ("velocity", Part::Velocity),
    ("acceleration", Part::Acceleration),
    ("torque", Part::Torque),
    ("channel", Part::Channel),
    ("channel_rate", Part::ChannelRate),
    ("channel_second_rate", Part::ChannelSecondRate),
];

fn part_of(name: &str) -> Result<Part, Error> {
    let found = PARTS.iter().find(|(known, _)| *known == name).map(|(_, part)| *part);
    found.ok_or_else(|| {
        let names: Vec<_> = PARTS.iter().map(|(name, _)| format!("'{name}'")).collect();
        Error::input(format!("`part` must be one of {}, found '{name}'", names.join(", ")))
    })
}

/// Numbers of the motion as they are.
///
/// Parameters
/// ----------
/// part : {'time', 'velocity', 'acceleration', 'torque', 'channel', 'channel_rate', 'channel_second_rate'}
///     Of which part: joint velocities, accelerations and forces of the whole tree; channels are the weights of
///     eigenpostures, or the driven joints.
/// indices : sequence of int, optional
///     Which of them; all unless given.
///
/// Returns
/// -------
/// Term
#[pyfunction]
#[pyo3(signature = (part, indices=None))]
pub(crate) fn entries(
    part: &str,
    #[pyo3(from_py_with = integers_or_none)] indices: Option<Vec<i64>>,
) -> Result<Term, Error> {
    Ok(Term(Kind::Entries { part: part_of(part)?, entries: numbers_of("indices", indices)? }))
}

/// Which degrees of freedom or entries; not none of them.
fn numbers_of(argument: &str, numbers: Option<Vec<i64>>) -> Result<Option<Vec<usize>>, Error> {
    let Some(numbers) = numbers else { return Ok(None) };
    if numbers.is_empty() {
        return Err(Error::input(format!("`{argument}` must have at least one entry, found none")));
    }
    numbers.into_iter().map(|k| index(argument, k)).collect::<Result<Vec<_>, _>>().map(Some)
}

/// Displacement of the positions from a reference: differences, and rotation vectors where joints rotate freely.
///
/// Parameters
/// ----------
/// reference : array_like, shape (n_positions,)
/// dofs : sequence of int, optional
///     Degrees of freedom; all unless given.
///
/// Returns
/// -------
/// Term
#[pyfunction]
#[pyo3(signature = (reference, dofs=None))]
pub(crate) fn displacement(
    reference: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = integers_or_none)] dofs: Option<Vec<i64>>,
) -> Result<Term, Error> {
    let reference = finite_all("reference", real_numbers("reference", reference)?)?;
    Ok(Term(Kind::Displacement { reference, dofs: numbers_of("dofs", dofs)? }))
}

/// Centre of mass or momentum of the whole tree, three numbers in world axes.
///
/// Parameters
/// ----------
/// part : {'angular', 'linear', 'center_of_mass'}
///     Angular momentum about the centre of mass, kg m²/s; linear momentum, kg m/s; or the centre of mass, m.
///
/// Returns
/// -------
/// Term
#[pyfunction]
pub(crate) fn momentum(part: &str) -> Result<Term, Error> {
    match MOMENTA.iter().find(|(name, _)| *name == part) {
        Some((_, part)) => Ok(Term(Kind::Momentum(*part))),
        None => Err(Error::input(format!(
            "`part` must be 'angular', 'linear' or 'center_of_mass', found '{part}'"
        ))),
    }
}

const MOMENTA: [(&str, MomentumPart); 3] = [
    ("angular", MomentumPart::Angular),
    ("linear", MomentumPart::Linear),
    ("center_of_mass", MomentumPart::CenterOfMass),
];

/// Position of a point of a body in the world, m.
///
/// Parameters
/// ----------
/// body : str
/// point : array_like, shape (3,), optional
///     In the axes of the body, m; its origin unless given.
///
/// Returns
/// -------
/// Term
#[pyfunction]
#[pyo3(signature = (body, point=None))]
pub(crate) fn point_position(body: String, point: Option<&Bound<'_, PyAny>>) -> Result<Term, Error> {
    let point = crate::core::convert::vector_or("point", point, Vector3::zeros())?;
    Ok(Term(Kind::PointPosition { body, point }))
}

/// Direction of an axis of a body in the world.
///
/// Parameters
/// ----------
/// body : str
/// axis : array_like, shape (3,)
///     In the axes of the body.
///
/// Returns
/// -------
/// Term
#[pyfunction]
pub(crate) fn axis_direction(body: String, axis: &Bound<'_, PyAny>) -> Result<Term, Error> {
    let axis = vector("axis", axis)?;
    if axis.amax() == 0.0 {
        return Err(Error::input("`axis` must not be zero"));
    }
    Ok(Term(Kind::AxisDirection { body, axis }))
}

/// Rotation of a body from a wanted orientation, as a rotation vector in body axes, rad.
///
/// Parameters
/// ----------
/// body : str
/// target : Rotation or array_like, shape (4,) or (3, 3)
///     From the body to the world.
///
/// Returns
/// -------
/// Term
#[pyfunction]
pub(crate) fn body_orientation(body: String, target: &Bound<'_, PyAny>) -> Result<Term, Error> {
    Ok(Term(Kind::BodyOrientation { body, target: orientation("target", target)? }))
}

/// Rows that a callable computes, with a gradient that another one computes, or by central differences.
///
/// Parameters
/// ----------
/// f : callable
///     ``f(node)`` that returns `n_rows` numbers. `node` has the arrays ``position``, ``velocity``, ``acceleration``,
///     ``torque``, ``channel``, ``channel_rate``, ``channel_second_rate`` and the float ``time``. Numbers that are not
///     finite make a solver step back; an exception ends the solve.
/// n_rows : int, optional
/// gradient : callable, optional
///     ``gradient(node)`` that returns a dict from the names of parts to arrays of shape (n_rows, size of the part);
///     parts that are missing count as zero. For ``'position'`` a column stands for a displacement of a degree of
///     freedom.
/// reads : sequence of str, optional
///     The parts by which differences are taken where no gradient is given; ``('position', 'velocity')`` unless given.
///
/// Returns
/// -------
/// Term
#[pyfunction]
#[pyo3(signature = (f, n_rows=1, *, gradient=None, reads=None))]
pub(crate) fn function(
    f: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = integer)] n_rows: i64,
    gradient: Option<&Bound<'_, PyAny>>,
    #[pyo3(from_py_with = entries_or_none)] reads: Option<Vec<String>>,
) -> Result<Term, Error> {
    let n_rows = count("n_rows", n_rows, 1)?;
    check_callable("f", "f(node)", f)?;
    if let Some(gradient) = gradient {
        check_callable("gradient", "gradient(node)", gradient)?;
    }
    let named = |name: String| match name.as_str() {
        "position" => Ok(Read::Position),
        other => Ok(Read::Part(part_of(other).map_err(|error| error.with_names(&[("part", "reads")]))?)),
    };
    let reads = match reads {
        Some(reads) if reads.is_empty() && gradient.is_none() => {
            return Err(Error::input("`reads` must have at least one part, found none"));
        }
        Some(reads) => reads.into_iter().map(named).collect::<Result<Vec<_>, Error>>()?,
        None => vec![Read::Position, Read::Part(Part::Velocity)],
    };
    Ok(Term(Kind::Function {
        callable: f.clone().unbind(),
        gradient: gradient.map(|g| g.clone().unbind()),
        n_rows,
        reads,
    }))
}

#[pymethods]
impl Term {
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let py = slf.py();
        let name = |part: &Part| PARTS.iter().find(|(_, known)| known == part).map_or("", |(name, _)| *name);
        // the function of this module that makes it, and its arguments
        let made: (&str, Bound<'py, PyTuple>) = match &slf.get().0 {
            Kind::Entries { part, entries } => ("entries", (name(part), entries.clone()).into_pyobject(py)?),
            Kind::Displacement { reference, dofs } => {
                ("displacement", (reference.clone(), dofs.clone()).into_pyobject(py)?)
            }
            Kind::Momentum(part) => {
                let found = MOMENTA.iter().find(|(_, known)| known == part).map_or("", |(name, _)| *name);
                ("momentum", (found,).into_pyobject(py)?)
            }
            Kind::PointPosition { body, point } => {
                ("point_position", (body, point.as_slice().to_vec()).into_pyobject(py)?)
            }
            Kind::AxisDirection { body, axis } => {
                ("axis_direction", (body, axis.as_slice().to_vec()).into_pyobject(py)?)
            }
            Kind::BodyOrientation { body, target } => {
                ("body_orientation", (body, components(target)).into_pyobject(py)?)
            }
            Kind::Function { callable, gradient, n_rows, reads } => {
                let names = reads.iter().map(|read| match read {
                    Read::Position => "position",
                    Read::Part(part) => name(part),
                });
                let reads: Vec<_> = names.collect();
                ("function", (callable, *n_rows, gradient, reads).into_pyobject(py)?)
            }
        };
        by_restore(slf, made)
    }

    /// A pickled term.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, kind: &str, arguments: &Bound<'_, PyTuple>) -> Result<Self, Error> {
        let none =
            || Error::input(format!("`arguments` of a term '{kind}' are too few: {}", arguments.len()));
        let at = |k: usize| arguments.get_item(k).map_err(|_| none());
        Ok(match kind {
            "entries" => {
                let part: String = at(0)?.extract()?;
                entries(&part, at(1)?.extract()?)?
            }
            "displacement" => displacement(&at(0)?, at(1)?.extract()?)?,
            "momentum" => momentum(&at(0)?.extract::<String>()?)?,
            "point_position" => point_position(at(0)?.extract()?, Some(&at(1)?))?,
            "axis_direction" => axis_direction(at(0)?.extract()?, &at(1)?)?,
            "body_orientation" => body_orientation(at(0)?.extract()?, &at(1)?)?,
            "function" => {
                let gradient = at(2)?;
                let gradient = if gradient.is_none() { None } else { Some(&gradient) };
                function(&at(0)?, at(1)?.extract()?, gradient, Some(at(3)?.extract()?))?
            }
            other => return Err(Error::input(format!("`kind` must be that of a term, found '{other}'"))),
        })
    }

    fn __repr__(&self) -> String {
        let what = match &self.0 {
            Kind::Entries { part, .. } => {
                PARTS.iter().find(|(_, known)| known == part).map_or("entries", |(name, _)| name)
            }
            Kind::Displacement { .. } => "displacement",
            Kind::Momentum(MomentumPart::Angular) => "angular momentum",
            Kind::Momentum(MomentumPart::Linear) => "linear momentum",
            Kind::Momentum(MomentumPart::CenterOfMass) => "centre of mass",
            Kind::PointPosition { .. } => "point position",
            Kind::AxisDirection { .. } => "axis direction",
            Kind::BodyOrientation { .. } => "body orientation",
            Kind::Function { .. } => "function",
        };
        format!("<Term: {what}>")
    }
}

impl Term {
    /// Whether evaluations call Python.
    pub(crate) fn calls_python(&self) -> bool {
        matches!(self.0, Kind::Function { .. })
    }

    /// The term for nodes of the given sizes.
    pub(crate) fn build(
        &self,
        py: Python<'_>,
        dynamics: &Tree,
        sizes: &NodeSizes,
    ) -> Result<Box<dyn term::Term>, Error> {
        let model: &multibody::Model = dynamics.model();
        Ok(match &self.0 {
            Kind::Entries { part, entries: Some(entries) } => {
                let made = Entries::try_new(sizes, *part, entries);
                Box::new(made.map_err(|error| Error::from(error).within("indices"))?)
            }
            Kind::Entries { part, entries: None } => Box::new(Entries::all(sizes, *part)),
            Kind::Displacement { reference, dofs } => {
                let all: Vec<usize> = (0..model.n_velocities()).collect();
                let dofs = dofs.as_ref().unwrap_or(&all);
                Box::new(Displacement::try_new(dynamics.clone(), reference, dofs)?)
            }
            Kind::Momentum(part) => Box::new(Momentum::new(model.clone(), *part)),
            Kind::PointPosition { body, point } => {
                Box::new(PointPosition::try_new(model.clone(), body, *point)?)
            }
            Kind::AxisDirection { body, axis } => {
                Box::new(AxisDirection::try_new(model.clone(), body, *axis)?)
            }
            Kind::BodyOrientation { body, target } => {
                Box::new(BodyOrientation::try_new(model.clone(), body, *target)?)
            }
            Kind::Function { callable, gradient, n_rows, reads } => {
                let rows = rows_of(callable.clone_ref(py), *n_rows);
                match gradient {
                    Some(gradient) => {
                        let pull_back = pull_back_of(gradient.clone_ref(py), *n_rows);
                        Box::new(Function::new("function", *n_rows, rows, pull_back))
                    }
                    None => {
                        let parts: Vec<Part> = reads
                            .iter()
                            .filter_map(|read| match read {
                                Read::Position => None,
                                Read::Part(part) => Some(*part),
                            })
                            .collect();
                        let by_position = reads.contains(&Read::Position);
                        let tree = dynamics.clone();
                        Box::new(Function::by_differences(
                            "function",
                            *n_rows,
                            tree,
                            by_position,
                            &parts,
                            rows,
                        ))
                    }
                }
            }
        })
    }
}

/// A node as Python sees it.
fn seen<'py>(py: Python<'py>, node: &Node<'_>) -> PyResult<Bound<'py, PyAny>> {
    let seen = PyDict::new(py);
    seen.set_item("time", node.time)?;
    let array = |values: &[f64]| numpy::PyArray1::from_slice(py, values);
    seen.set_item("position", array(node.position))?;
    seen.set_item("velocity", array(node.velocity))?;
    seen.set_item("acceleration", array(node.acceleration))?;
    seen.set_item("torque", array(node.torque))?;
    seen.set_item("channel", array(node.channel))?;
    seen.set_item("channel_rate", array(node.channel_rate))?;
    seen.set_item("channel_second_rate", array(node.channel_second_rate))?;
    py.import("types")?.getattr("SimpleNamespace")?.call((), Some(&seen))
}

fn rows_of(
    callable: Py<PyAny>,
    n_rows: usize,
) -> impl FnMut(&Node<'_>, &mut [f64]) -> Result<(), UserError> + Send + 'static {
    move |node, out| {
        Python::attach(|py| {
            let found = callable.call1(py, (seen(py, node)?,))?.into_bound(py);
            if let Ok(number) = found.extract::<f64>()
                && n_rows == 1
            {
                out[0] = number;
                return Ok(());
            }
            let rows = with_shape("f(node)", &[n_rows], &found).map_err(PyErr::from)?;
            out.copy_from_slice(&rows);
            Ok(())
        })
        .map_err(|error: PyErr| Box::new(error) as UserError)
    }
}

fn pull_back_of(
    callable: Py<PyAny>,
    n_rows: usize,
) -> impl FnMut(&Node<'_>, &[f64], &mut NodeGradient) -> Result<(), UserError> + Send + 'static {
    move |node, y, gradient| {
        Python::attach(|py| {
            let found = callable.call1(py, (seen(py, node)?,))?.into_bound(py);
            let found = found.cast_into::<PyDict>().map_err(|error| {
                let found = a_type(&error.into_inner());
                PyErr::from(Error::input(format!("`gradient(node)` must return a dict, found {found}")))
            })?;
            for (name, matrix) in found.iter() {
                let name: String = name.extract()?;
                let out: &mut [f64] = match name.as_str() {
                    "time" => std::slice::from_mut(&mut gradient.time),
                    "position" => &mut gradient.position,
                    "velocity" => &mut gradient.velocity,
                    "acceleration" => &mut gradient.acceleration,
                    "torque" => &mut gradient.torque,
                    "channel" => &mut gradient.channel,
                    "channel_rate" => &mut gradient.channel_rate,
                    "channel_second_rate" => &mut gradient.channel_second_rate,
                    other => {
                        return Err(Error::input(format!(
                            "`gradient(node)` must have names of parts as keys, found '{other}'"
                        ))
                        .into());
                    }
                };
                let shape = [n_rows, out.len()];
                let rows =
                    with_shape(&format!("gradient(node)['{name}']"), &shape, &matrix).map_err(PyErr::from)?;
                for (row, y) in rows.chunks_exact(out.len().max(1)).zip(y) {
                    out.iter_mut().zip(row).for_each(|(out, x)| *out += x * y);
                }
            }
            Ok(())
        })
        .map_err(|error: PyErr| Box::new(error) as UserError)
    }
}

/// What the nodes of a shooting of this tree hold.
pub(crate) fn sizes_of(dynamics: &Tree, n_channels: usize) -> NodeSizes {
    let dofs = dynamics.dofs();
    let n = dofs.n_velocities();
    NodeSizes { n_positions: dofs.n_positions, n_velocities: n, n_accelerations: n, n_torques: n, n_channels }
}
