//! The functions that make terms.

use super::function::UserFunction;
use super::part::{name_of, part_of};
use super::{Term, numbers_of};
use crate::core::convert::{
    components, entries_or_none, finite_all, integer, orientation, real_numbers, vector, vector_or,
};
use crate::core::error::Error;
use crate::core::functions::functions;
use crate::ocp::arguments::integers_or_none;
use pyo3::prelude::*;
use somersault::integrators::nalgebra::Vector3;
use somersault::ocp::term::{self, MomentumPart};

functions! {
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
    ///
    /// Examples
    /// --------
    /// The diver enters upside down:
    ///
    /// >>> from somersault import ocp
    /// >>> ocp.Constraint(ocp.axis_direction("torso", (0, 0, 1)), [-1, -1, -1], [1, 1, -0.99], at="finish")
    /// <Constraint: axis direction from [-1, -1, -1] to [1, 1, -0.99], at 'finish'>
    fn axis_direction(py: Python<'_>, body: String, axis: &Bound<'_, PyAny>) -> PyResult<Term> {
        let axis = vector("axis", axis)?;
        if axis.amax() == 0.0 {
            return Err(Error::input("`axis` must not be zero").into());
        }
        let arguments = (body.clone(), axis.as_slice().to_vec());
        Term::of(("axis_direction", "axis direction"), py, arguments, move |_, tree, _| {
            Ok(term::AxisDirection::try_new(tree.model().clone(), &body, axis)?)
        })
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> ocp.Cost(ocp.body_orientation("torso", (0.0, 0.0, 0.0, 1.0)), 100.0, at="finish")
    /// <Cost: squares of body orientation, at 'finish'>
    fn body_orientation(py: Python<'_>, body: String, target: &Bound<'_, PyAny>) -> PyResult<Term> {
        let target = orientation("target", target)?;
        let arguments = (body.clone(), components(&target));
        Term::of(("body_orientation", "body orientation"), py, arguments, move |_, tree, _| {
            Ok(term::BodyOrientation::try_new(tree.model().clone(), &body, target)?)
        })
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> ocp.Cost(ocp.displacement([0.0, 0.0], [1]), 1e3, at="finish")
    /// <Cost: squares of displacement, at 'finish'>
    #[pyo3(signature = (reference, dofs=None))]
    fn displacement(
        py: Python<'_>,
        reference: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = integers_or_none)] dofs: Option<Vec<i64>>,
    ) -> PyResult<Term> {
        let reference = finite_all("reference", real_numbers("reference", reference)?)?;
        let dofs = numbers_of("dofs", dofs)?;
        let arguments = (reference.clone(), dofs.clone());
        Term::of(("displacement", "displacement"), py, arguments, move |_, tree, _| {
            let all: Vec<usize> = (0..tree.model().n_velocities()).collect();
            Ok(term::Displacement::try_new(tree.clone(), &reference, dofs.as_ref().unwrap_or(&all))?)
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> ocp.Constraint(ocp.entries("torque", [0]), -20.0, 20.0)
    /// <Constraint: torque from -20.0 to 20.0, at 'path'>
    #[pyo3(signature = (part, indices=None))]
    fn entries(
        py: Python<'_>,
        part: &str,
        #[pyo3(from_py_with = integers_or_none)] indices: Option<Vec<i64>>,
    ) -> PyResult<Term> {
        let (part, indices) = (part_of(part)?, numbers_of("indices", indices)?);
        let name = name_of(part);
        Term::of(("entries", name), py, (name, indices.clone()), move |_, _, sizes| match &indices {
            Some(indices) => {
                let made = term::Entries::try_new(sizes, part, indices);
                made.map_err(|error| Error::from(error).within("indices"))
            }
            None => Ok(term::Entries::all(sizes, part)),
        })
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> power = ocp.function(lambda node: node.torque[0] * node.velocity[0], reads=("torque", "velocity"))
    /// >>> ocp.Constraint(power, -100.0, 100.0)
    /// <Constraint: function from -100.0 to 100.0, at 'path'>
    #[pyo3(signature = (f, n_rows=1, *, gradient=None, reads=None))]
    fn function(
        f: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = integer)] n_rows: i64,
        gradient: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = entries_or_none)] reads: Option<Vec<String>>,
    ) -> PyResult<Term> {
        UserFunction::try_new(f, n_rows, gradient, reads)?.term(f.py(), "function")
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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> ocp.Constraint(ocp.momentum("angular"), 0.0, 0.0)
    /// <Constraint: angular momentum from 0.0 to 0.0, at 'path'>
    fn momentum(py: Python<'_>, part: &str) -> PyResult<Term> {
        let (of, what) = match part {
            "angular" => (MomentumPart::Angular, "angular momentum"),
            "linear" => (MomentumPart::Linear, "linear momentum"),
            "center_of_mass" => (MomentumPart::CenterOfMass, "centre of mass"),
            other => {
                let allowed = "'angular', 'linear' or 'center_of_mass'";
                return Err(Error::input(format!("`part` must be {allowed}, found '{other}'")).into());
            }
        };
        Term::of(("momentum", what), py, (part,), move |_, tree, _| {
            Ok(term::Momentum::new(tree.model().clone(), of))
        })
    }

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
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ocp
    /// >>> ocp.Cost(ocp.point_position("lower", (0.5, 0.0, 0.0)), 1e3, target=(1.0, 1.0, 0.0), at="finish")
    /// <Cost: squares of point position, at 'finish'>
    #[pyo3(signature = (body, point=None))]
    fn point_position(py: Python<'_>, body: String, point: Option<&Bound<'_, PyAny>>) -> PyResult<Term> {
        let point = vector_or("point", point, Vector3::zeros())?;
        let arguments = (body.clone(), point.as_slice().to_vec());
        Term::of(("point_position", "point position"), py, arguments, move |_, tree, _| {
            Ok(term::PointPosition::try_new(tree.model().clone(), &body, point)?)
        })
    }
}
