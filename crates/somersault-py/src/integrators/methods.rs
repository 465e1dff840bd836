//! The method table.

use crate::core::error::Error;
use crate::core::value::value;
use pyo3::exceptions::{PyIndexError, PyKeyError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyIterator, PyList, PyString};
use somersault::integrators::methods::{Method, UnknownMethod};
use somersault::integrators::stepper::{self, Orders, Scope, Variables};

/// A method of integration: a row of the table.
///
/// Instances come from `somersault.methods`, and `somersault.integrate` takes them as well as names.
#[pyclass(frozen, eq, hash, from_py_object, module = "somersault")]
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct MethodInfo(Method);

value! {
    impl MethodInfo {
        /// str: The name by which it is requested.
        name: &'static str = |own| own.0.info().name;
        /// str: The name in words.
        title: &'static str = |own| own.0.info().title;
        /// str: Where it comes from.
        citation: &'static str = |own| own.0.info().citation;
        /// dict: Powers of the step in the global error of position and orientation.
        ///
        /// ``"translation"`` is the order of the position where forces depend on the position only,
        /// ``"translation_with_velocity"`` where they depend on the velocity too, ``"translation_with_orientation"``
        /// where they depend on the orientation; ``"rotation"`` is that of the orientation of a free body and
        /// ``"rotation_with_torque"`` of one under torque, None where the method takes none. A motion of several of these
        /// kinds, say under a spring attached off the centre of mass, has the least of their orders.
        orders: PyResult<Bound<'py, PyDict>> = |own, py| orders_dict(py, &own.0.info().orders);
        /// dict: The same for velocity and angular velocity.
        rate_orders: PyResult<Bound<'py, PyDict>> = |own, py| orders_dict(py, &own.0.info().rate_orders);
        /// int: Power of the step in the error that dense output adds: between the ends of a step the order is the lower of
        /// this and the order there.
        dense_order: u8 = |own| own.0.info().dense_order;
        /// float or None: The angle in rad that a body may turn in a step, where the method has a limit; a longer step is
        /// refused.
        angle_limit: Option<f64> = |own| own.0.info().angle_limit;
        /// int: Evaluations of the equations of motion per step, once started; for an implicit method, per
        /// iteration.
        evaluations: u8 = |own| own.0.info().evaluations;
        /// int: How many previous steps it remembers.
        history: u8 = |own| own.0.info().history;
        /// bool: Whether its steps can be adapted: by its own estimate of the error, or, if it remembers no previous steps, by step
        /// doubling, where each step is made whole and as two halves.
        adaptive: bool = |own| own.0.info().is_adaptive();
        /// int or None: Order of the error estimate of its own; None for a method without one.
        embedded_order: Option<u8> = |own| own.0.info().embedded;
        /// bool: Whether each step solves an equation.
        implicit: bool = |own| own.0.info().implicit;
        /// bool: Whether it is L-stable: steps may be far longer than the times of the springs and dampers of a system, whose
        /// motion it then damps.
        l_stable: bool = |own| own.0.info().l_stable;
        /// str: What it conserves, and how well.
        conserves: &'static str = |own| own.0.info().conserves;
        /// str: What it is unsuitable for, and what it refuses.
        limitations: &'static str = |own| own.0.info().limitations;
    }
}

#[pymethods]
impl MethodInfo {
    /// str: ``"any system"``, ``"rigid bodies"``, ``"torque-free"`` for rigid bodies without torque, or
    /// ``"forces with series"`` for rigid bodies under forces whose Taylor series are known.
    #[getter]
    fn scope(&self) -> &'static str {
        match self.0.info().scope {
            Scope::AnySystem => "any system",
            Scope::RigidBodies => "rigid bodies",
            Scope::TorqueFree => "torque-free",
            Scope::ForcesWithSeries => "forces with series",
        }
    }

    /// str: What it integrates for the rotation: angular velocity in the ``"world"`` frame or in the
    /// ``"body"`` frame, or angular ``"momentum"`` in the world frame.
    #[getter]
    fn variables(&self) -> &'static str {
        match self.0.info().variables {
            Variables::World => "world",
            Variables::Momentum => "momentum",
            Variables::Body => "body",
        }
    }

    fn __repr__(&self) -> String {
        let info = self.0.info();
        format!(
            "<MethodInfo '{}': {}, order {} on R^3 and {} on SO(3)>",
            info.name, info.title, info.orders.translation, info.orders.rotation
        )
    }

    fn __str__(&self) -> &'static str {
        self.name()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (&'static str,))> {
        Ok((py.import("somersault.integrators")?.getattr("method")?, (self.name(),)))
    }
}

fn orders_dict<'py>(py: Python<'py>, orders: &Orders) -> PyResult<Bound<'py, PyDict>> {
    let Orders {
        translation,
        translation_with_velocity,
        translation_with_orientation,
        rotation,
        rotation_with_torque,
    } = *orders;
    let dict = PyDict::new(py);
    dict.set_item("translation", translation)?;
    dict.set_item("translation_with_velocity", translation_with_velocity)?;
    dict.set_item("translation_with_orientation", translation_with_orientation)?;
    dict.set_item("rotation", rotation)?;
    dict.set_item("rotation_with_torque", rotation_with_torque)?;
    Ok(dict)
}

/// An order, and in brackets the one of the general case where it is another; after a semicolon the same of the rates.
fn order(benign: [u8; 2], general: [Option<u8>; 2]) -> String {
    let of = |benign: u8, general: Option<u8>| match general {
        Some(general) if general != benign => format!("{benign} ({general})"),
        Some(_) | None => benign.to_string(),
    };
    let [of_configuration, of_rate] = [0, 1].map(|i| of(benign[i], general[i]));
    if of_rate == of_configuration { of_configuration } else { format!("{of_configuration}; {of_rate}") }
}

/// How steps are chosen.
fn steps(info: &stepper::MethodInfo) -> &'static str {
    match (info.embedded, info.is_adaptive()) {
        (Some(_), _) => "fixed, adaptive",
        (None, true) => "fixed, doubled",
        (None, false) => "fixed",
    }
}

fn on_r3(info: &stepper::MethodInfo) -> String {
    let orders = [info.orders, info.rate_orders];
    let general = orders.map(|o| Some(o.translation_with_velocity.min(o.translation_with_orientation)));
    order(orders.map(|o| o.translation), general)
}

fn on_so3(info: &stepper::MethodInfo) -> String {
    let orders = [info.orders, info.rate_orders];
    order(orders.map(|o| o.rotation), orders.map(|o| o.rotation_with_torque))
}

/// The table of methods, in its order: by index, by name, and to iterate over.
#[pyclass(frozen, module = "somersault")]
pub(crate) struct MethodTable;

#[pymethods]
impl MethodTable {
    /// list of str: The names.
    #[getter]
    fn names(&self) -> Vec<&'static str> {
        Method::ALL.iter().map(|m| m.info().name).collect()
    }

    fn __len__(&self) -> usize {
        Method::ALL.len()
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        PyList::new(py, Method::ALL.map(MethodInfo))?.try_iter()
    }

    fn __contains__(&self, name: &Bound<'_, PyAny>) -> bool {
        match name.extract::<String>() {
            Ok(name) => name.parse::<Method>().is_ok(),
            Err(_) => name.is_instance_of::<MethodInfo>(),
        }
    }

    fn __getitem__(&self, key: &Bound<'_, PyAny>) -> PyResult<MethodInfo> {
        if let Ok(name) = key.cast::<PyString>() {
            return parse(name.to_cow()?.as_ref())
                .map(MethodInfo)
                .map_err(|error| PyKeyError::new_err(Error::from(error).message()));
        }
        let index: isize = key.extract()?;
        let from_start = if index < 0 { index + Method::ALL.len() as isize } else { index };
        usize::try_from(from_start).ok().and_then(|i| Method::ALL.get(i)).map(|m| MethodInfo(*m)).ok_or_else(
            || PyIndexError::new_err(format!("there are {} methods, found index {index}", Method::ALL.len())),
        )
    }

    fn __repr__(&self) -> String {
        format!("<MethodTable: {} methods; print it to see them>", Method::ALL.len())
    }

    fn __str__(&self) -> String {
        let header =
            ["name", "title", "R^3", "SO(3)", "within steps", "evaluations", "variables", "step", "scope"];
        let rows: Vec<[String; 9]> = Method::ALL
            .iter()
            .map(|m| {
                let (row, info) = (MethodInfo(*m), m.info());
                [
                    info.name.to_owned(),
                    info.title.to_owned(),
                    on_r3(&info),
                    on_so3(&info),
                    info.dense_order.to_string(),
                    info.evaluations.to_string(),
                    row.variables().to_owned(),
                    steps(&info).to_owned(),
                    row.scope().to_owned(),
                ]
            })
            .collect();
        let width = |i: usize| {
            rows.iter().map(|row| row[i].chars().count()).chain([header[i].len()]).max().unwrap_or(0)
        };
        let widths: [usize; 9] = std::array::from_fn(width);
        let line = |cells: [&str; 9]| {
            let padded: Vec<_> = cells.iter().zip(widths).map(|(cell, w)| format!("{cell:w$}")).collect();
            padded.join("  ").trim_end().to_owned()
        };
        let body = rows.iter().map(|row| line(row.each_ref().map(String::as_str)));
        std::iter::once(line(header)).chain(body).collect::<Vec<_>>().join("\n")
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, ())> {
        Ok((py.import("somersault")?.getattr("methods")?, ()))
    }
}

/// The table of methods.
///
/// Orders in brackets hold where forces depend on the velocity or the orientation, or under torque; after a semicolon stand
/// those of the velocities, where they are others. Within steps, by dense output, the order is the lower of the two. Steps are adapted
/// by an estimate of the method's own, or by step doubling.
///
/// Returns
/// -------
/// MethodTable
///     To iterate over, to index by number or by name, and to print.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> somersault.methods()["rkmk"].orders["rotation"]
/// 4
#[pyfunction]
pub(crate) fn methods() -> MethodTable {
    MethodTable
}

/// The method of a name.
///
/// Parameters
/// ----------
/// name : str
///     A name of the table.
///
/// Raises
/// ------
/// InputError
///     If there is none; the message lists the names.
///
/// Examples
/// --------
/// >>> from somersault import integrators
/// >>> rkmk = integrators.method("rkmk")
/// >>> rkmk.evaluations, rkmk.orders["rotation"]
/// (4, 4)
#[pyfunction]
pub(crate) fn method(name: &str) -> Result<MethodInfo, Error> {
    Ok(MethodInfo(parse(name)?))
}

fn parse(name: &str) -> Result<Method, UnknownMethod> {
    name.parse()
}

/// A method given by its name or by its row.
pub(crate) fn extract(argument: &str, value: &Bound<'_, PyAny>) -> Result<Method, Error> {
    if let Ok(MethodInfo(method)) = value.extract::<MethodInfo>() {
        return Ok(method);
    }
    let name = value.cast::<PyString>().map_err(|_| {
        Error::input(format!(
            "`{argument}` must be a name or a row of the method table, found {}",
            crate::core::convert::a_type(value)
        ))
    })?;
    Ok(parse(name.to_cow()?.as_ref())?)
}
