//! NumPy arrays and SciPy rotations ↔ nalgebra.
//!
//! Whatever NumPy can make an array of real numbers from is accepted. An error names the argument,
//! the shape it must have and what was found.

use crate::core::error::Error;
use crate::core::memory::{copied, expect_room};
use numpy::prelude::*;
use numpy::{PyArrayDyn, PyReadonlyArrayDyn, PyUntypedArray};
use pyo3::exceptions::{PyMemoryError, PyOverflowError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyFloat, PyList, PySequence, PyString, PyTuple, PyType};
use somersault::integrators::nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};

/// How far RᵀR of a rotation matrix may be from the identity: what is left of one written to eight
/// digits.
const ORTHOGONAL: f64 = 1e-7;

/// An integer; one beyond 64 bits is the nearest of them.
pub(crate) fn integer(value: &Bound<'_, PyAny>) -> PyResult<i64> {
    match value.extract::<i64>() {
        Err(error) if error.is_instance_of::<PyOverflowError>(value.py()) => {
            Ok(if value.lt(0)? { i64::MIN } else { i64::MAX })
        }
        found => found,
    }
}

/// The same for an argument that may be None.
pub(crate) fn integer_or_none(value: &Bound<'_, PyAny>) -> PyResult<Option<i64>> {
    if value.is_none() { Ok(None) } else { integer(value).map(Some) }
}

/// The most entries of a sequence of Python objects: room for all is made before the first is looked at.
const MOST_ENTRIES: usize = 10_000_000;

/// Refuses sequences of more entries than can be meant; an array need not have memory for those it shows.
pub(crate) fn check_length(value: &Bound<'_, PyAny>) -> PyResult<()> {
    match value.len() {
        Ok(found) if found > MOST_ENTRIES => Err(PyTypeError::new_err(format!(
            "a sequence must have at most {MOST_ENTRIES} entries, found {found}"
        ))),
        // what has no length is refused by who reads it
        _ => Ok(()),
    }
}

/// The entries of a sequence.
pub(crate) fn entries<'py, T>(value: &Bound<'py, PyAny>) -> PyResult<Vec<T>>
where
    T: for<'a> FromPyObject<'a, 'py>,
{
    check_length(value)?;
    value.extract().map_err(|error: PyErr| {
        let py = value.py();
        // a number out of range is a wrong value, as any other
        if error.is_instance_of::<PyOverflowError>(py) {
            PyValueError::new_err(error.value(py).to_string())
        } else {
            error
        }
    })
}

/// The same for an argument that may be None.
pub(crate) fn entries_or_none<'py, T>(value: &Bound<'py, PyAny>) -> PyResult<Option<Vec<T>>>
where
    T: for<'a> FromPyObject<'a, 'py>,
{
    if value.is_none() { Ok(None) } else { entries(value).map(Some) }
}

/// A list or a tuple, or whatever else is a sequence but no text.
pub(crate) fn sequence<'a, 'py>(value: &'a Bound<'py, PyAny>) -> Option<&'a Bound<'py, PySequence>> {
    if value.is_instance_of::<PyString>() { None } else { value.cast::<PySequence>().ok() }
}

/// A name that is a key of the dictionary `argument`.
pub(crate) fn key_of(argument: &str, key: &Bound<'_, PyAny>) -> Result<String, Error> {
    let wrong = |_| Error::input(format!("`{argument}` must have names that are str, found {}", a_type(key)));
    key.extract().map_err(wrong)
}

/// The argument `interval`: its start and its end.
pub(crate) fn interval_of(value: &Bound<'_, PyAny>) -> PyResult<[f64; 2]> {
    let found = with_shape("interval", &[2], value)?;
    Ok([found[0], found[1]])
}

/// Real numbers in the order of C, with their shape.
struct Numbers {
    shape: Vec<usize>,
    values: Vec<f64>,
}

fn numbers(argument: &str, expected: &str, value: &Bound<'_, PyAny>) -> Result<Numbers, Error> {
    let array = contiguous(argument, expected, value)?;
    let values = copied(&format!("the numbers of `{argument}`"), array.as_slice().map_err(PyErr::from)?)?;
    Ok(Numbers { shape: array.shape().to_vec(), values })
}

/// Real numbers as an array in the order of C: the one given where it is such an array of float64, else a
/// copy.
pub(crate) fn contiguous<'py>(
    argument: &str,
    expected: &str,
    value: &Bound<'py, PyAny>,
) -> Result<PyReadonlyArrayDyn<'py, f64>, Error> {
    if let Ok(array) = value.cast::<PyArrayDyn<f64>>() {
        let array = array.try_readonly().map_err(PyErr::from)?;
        if array.is_c_contiguous() && array.as_slice().is_ok() {
            return Ok(array);
        }
    }
    let found = |what: String| Error::input(format!("`{argument}` must be {expected}, found {what}"));
    let numpy = value.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (value,)).map_err(|error| {
        if error.is_instance_of::<PyMemoryError>(value.py()) {
            too_many(argument)
        } else {
            found(format!("{} that is no array", a_type(value)))
        }
    })?;
    let dtype = array.cast::<PyUntypedArray>().map_err(PyErr::from)?.dtype();
    if !matches!(dtype.kind(), b'f' | b'i' | b'u') {
        return Err(found(format!("{} of dtype {dtype}", a_type(value))));
    }
    let array = array.call_method1("astype", ("float64", "C")).map_err(|error| {
        if error.is_instance_of::<PyMemoryError>(value.py()) { too_many(argument) } else { error.into() }
    })?;
    Ok(array.cast::<PyArrayDyn<f64>>().map_err(PyErr::from)?.try_readonly().map_err(PyErr::from)?)
}

fn too_many(argument: &str) -> Error {
    Error::input(format!("the numbers of `{argument}` need more memory than there is"))
}

/// The type of an object in a message: an int, a tuple of length 3, the class Gravity.
pub(crate) fn a_type(value: &Bound<'_, PyAny>) -> String {
    if let Ok(class) = value.cast::<PyType>() {
        return class.name().map_or_else(|_| "a class".to_owned(), |name| format!("the class {name}"));
    }
    if let Ok(tuple) = value.cast::<PyTuple>() {
        return format!("a tuple of length {}", tuple.len());
    }
    let name = value.get_type().name().map_or_else(|_| "?".to_owned(), |name| name.to_string());
    let vowel = name.starts_with(['a', 'e', 'i', 'o', 'u', 'A', 'E', 'I', 'O', 'U']);
    format!("{} {name}", if vowel { "an" } else { "a" })
}

/// A positive and finite number.
pub(crate) fn positive(argument: &str, value: f64) -> Result<f64, Error> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(Error::input(format!("`{argument}` must be positive and finite, found {value}")))
    }
}

/// Refuses numbers that are not finite.
pub(crate) fn check_finite<'a>(
    argument: &str,
    values: impl IntoIterator<Item = &'a f64>,
) -> Result<(), Error> {
    match values.into_iter().find(|x| !x.is_finite()) {
        None => Ok(()),
        Some(x) => Err(Error::input(format!("`{argument}` must be finite, found {x}"))),
    }
}

/// A shape in a message.
pub(crate) fn shape_text(shape: &[usize]) -> String {
    match shape {
        [n] => format!("({n},)"),
        [] => "()".to_owned(),
        _ => format!("({})", shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// Numbers of the given shape, which may be NaN or infinite.
pub(crate) fn with_shape(
    argument: &str,
    shape: &[usize],
    value: &Bound<'_, PyAny>,
) -> Result<Vec<f64>, Error> {
    in_shape(argument, shape, value, |values| Ok(values.to_vec()))
}

/// What is made of numbers of the given shape, which may be NaN or infinite, where they lie.
fn in_shape<T>(
    argument: &str,
    shape: &[usize],
    value: &Bound<'_, PyAny>,
    make: impl FnOnce(&[f64]) -> Result<T, Error>,
) -> Result<T, Error> {
    let expected = format!("real numbers of shape {}", shape_text(shape));
    let found = contiguous(argument, &expected, value)?;
    if found.shape() != shape {
        return Err(Error::input(format!(
            "`{argument}` must be {expected}, found shape {}",
            shape_text(found.shape())
        )));
    }
    let values = found.as_slice().map_err(PyErr::from)?;
    expect_room(&format!("the numbers of `{argument}`"), size_of_val(values))?;
    make(values)
}

/// A vector, which may be NaN or infinite.
pub(crate) fn any_vector(argument: &str, value: &Bound<'_, PyAny>) -> Result<Vector3<f64>, Error> {
    // Three numbers in a tuple or a list, as a force returns them in every evaluation.
    if (value.is_instance_of::<PyTuple>() || value.is_instance_of::<PyList>())
        && let Ok(v) = value.extract::<[f64; 3]>()
    {
        return Ok(v.into());
    }
    Ok(Vector3::from_column_slice(&with_shape(argument, &[3], value)?))
}

/// A finite vector.
pub(crate) fn vector(argument: &str, value: &Bound<'_, PyAny>) -> Result<Vector3<f64>, Error> {
    let v = any_vector(argument, value)?;
    check_finite(argument, v.as_slice())?;
    Ok(v)
}

/// As [`vector`], with a default for an argument left out.
pub(crate) fn vector_or(
    argument: &str,
    value: Option<&Bound<'_, PyAny>>,
    default: Vector3<f64>,
) -> Result<Vector3<f64>, Error> {
    value.map_or(Ok(default), |value| vector(argument, value))
}

/// Vectors in an array with the given axes before the last, which may be NaN or infinite.
pub(crate) fn any_vectors(
    argument: &str,
    axes: &[usize],
    value: &Bound<'_, PyAny>,
) -> Result<Vec<Vector3<f64>>, Error> {
    in_shape(argument, &[axes, &[3]].concat(), value, |values| {
        Ok(values.chunks_exact(3).map(Vector3::from_column_slice).collect())
    })
}

/// Quaternions in an array with the given axes before the last.
pub(crate) fn quaternions(
    argument: &str,
    axes: &[usize],
    value: &Bound<'_, PyAny>,
) -> Result<Vec<UnitQuaternion<f64>>, Error> {
    in_shape(argument, &[axes, &[4]].concat(), value, |values| {
        values.chunks_exact(4).map(|q| quaternion(argument, q)).collect()
    })
}

/// A finite number.
pub(crate) fn finite(argument: &str, value: f64) -> Result<f64, Error> {
    check_finite(argument, [&value])?;
    Ok(value)
}

/// Numbers that are finite.
pub(crate) fn finite_all(argument: &str, values: Vec<f64>) -> Result<Vec<f64>, Error> {
    check_finite(argument, &values)?;
    Ok(values)
}

/// Three principal moments, or a 3×3 tensor.
pub(crate) enum MomentsOrTensor {
    Moments(Vector3<f64>),
    Tensor(Matrix3<f64>),
}

/// Three principal moments, or a 3×3 tensor.
pub(crate) fn moments_or_tensor(argument: &str, value: &Bound<'_, PyAny>) -> Result<MomentsOrTensor, Error> {
    let expected = "real numbers of shape (3,) or (3, 3)";
    let found = numbers(argument, expected, value)?;
    match found.shape[..] {
        [3] => Ok(MomentsOrTensor::Moments(Vector3::from_column_slice(&found.values))),
        [3, 3] => Ok(MomentsOrTensor::Tensor(Matrix3::from_row_slice(&found.values))),
        _ => Err(Error::input(format!(
            "`{argument}` must be {expected}, found shape {}",
            shape_text(&found.shape)
        ))),
    }
}

fn rotation_class(py: Python<'_>) -> PyResult<&Bound<'_, PyType>> {
    static ROTATION: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    ROTATION.import(py, "scipy.spatial.transform", "Rotation")
}

/// A unit quaternion from the four numbers (x, y, z, w) that SciPy uses.
fn quaternion(argument: &str, values: &[f64]) -> Result<UnitQuaternion<f64>, Error> {
    check_finite(argument, values)?;
    let q = Quaternion::new(values[3], values[0], values[1], values[2]);
    let scale = q.coords.amax();
    if scale == 0.0 {
        return Err(Error::input(format!("`{argument}` must not be the quaternion zero")));
    }
    // A quaternion that is a unit one to rounding keeps its bits, so that what is written out and
    // read back is the same.
    if (q.norm_squared() - 1.0).abs() <= 4.0 * f64::EPSILON {
        return Ok(UnitQuaternion::new_unchecked(q));
    }
    Ok(UnitQuaternion::new_normalize(q / scale))
}

fn rotation_matrix(argument: &str, values: &[f64]) -> Result<UnitQuaternion<f64>, Error> {
    check_finite(argument, values)?;
    let m = Matrix3::from_row_slice(values);
    let defect = (m.transpose() * m - Matrix3::identity()).amax();
    if defect > ORTHOGONAL || m.determinant() <= 0.0 {
        return Err(Error::input(format!(
            "`{argument}` must be a rotation matrix, found |RᵀR − 1| = {defect:.1e} and determinant {:.3}",
            m.determinant()
        )));
    }
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(m));
    Ok(UnitQuaternion::new_normalize(q.into_inner()))
}

/// An orientation: a rotation object, a quaternion (x, y, z, w) or a matrix.
pub(crate) fn orientation(argument: &str, value: &Bound<'_, PyAny>) -> Result<UnitQuaternion<f64>, Error> {
    let quaternions;
    let value = if value.is_instance(rotation_class(value.py())?)? {
        quaternions = value.call_method0("as_quat")?;
        &quaternions
    } else {
        value
    };
    let expected = "a single Rotation, a quaternion (x, y, z, w) or a rotation matrix";
    let found = numbers(argument, expected, value)?;
    match found.shape[..] {
        [4] => quaternion(argument, &found.values),
        [3, 3] => rotation_matrix(argument, &found.values),
        _ => Err(Error::input(format!(
            "`{argument}` must be {expected}, found shape {}",
            shape_text(&found.shape)
        ))),
    }
}

/// The least length of a quaternion that tells a rotation, and how far RRᵀ of a measured rotation matrix may be from the identity.
const SHORT: f64 = 1e-6;
const NEARLY_ORTHOGONAL: f64 = 1e-3;

/// As many orientations: rotation objects, quaternions (x, y, z, w) of any length, or matrices that are orthogonal as measured ones are.
pub(crate) fn orientations(
    argument: &str,
    count: usize,
    value: &Bound<'_, PyAny>,
) -> Result<Vec<UnitQuaternion<f64>>, Error> {
    let expected = format!("{count} Rotations, quaternions (x, y, z, w) or matrices");
    let wrong = |shape: &[usize]| {
        let shape = shape_text(shape);
        Error::input(format!("`{argument}` must be {expected}, found shape {shape}"))
    };
    let is_rotation = value.is_instance(rotation_class(value.py())?)?;
    let found = if is_rotation {
        numbers(argument, &expected, &value.call_method0("as_quat")?)?
    } else {
        numbers(argument, &expected, value)?
    };
    let is_matrices = found.shape == [count, 3, 3];
    if !is_matrices && found.shape != [count, 4] {
        return Err(wrong(&found.shape));
    }
    check_finite(argument, &found.values)?;
    if is_matrices {
        return found.values.chunks_exact(9).map(|m| measured_matrix(argument, m)).collect();
    }
    let rotation = |values: &[f64]| {
        let q = Quaternion::new(values[3], values[0], values[1], values[2]);
        let length = q.norm();
        if length < SHORT {
            return Err(Error::input(format!(
                "`{argument}` must have quaternions of length 1, found one of {length:.3}"
            )));
        }
        quaternion(argument, values)
    };
    found.values.chunks_exact(4).map(rotation).collect()
}

/// The rotation nearest to a matrix that is nearly one.
fn measured_matrix(argument: &str, values: &[f64]) -> Result<UnitQuaternion<f64>, Error> {
    let m = Matrix3::from_row_slice(values);
    let off = (m * m.transpose() - Matrix3::identity()).amax();
    if off > NEARLY_ORTHOGONAL || m.determinant() < 0.0 {
        return Err(Error::input(format!(
            "`{argument}` must have rotation matrices, orthogonal, right-handed, found one off by {off:.1e} and of determinant {:.3}",
            m.determinant()
        )));
    }
    let guess = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(m));
    let guess = UnitQuaternion::new_normalize(guess.into_inner());
    Ok(UnitQuaternion::from_matrix_eps(&m, f64::EPSILON, 100, guess))
}

/// Times, and whether they are a single number.
pub(crate) fn times(argument: &str, value: &Bound<'_, PyAny>) -> Result<(bool, Vec<f64>), Error> {
    if let Ok(t) = value.cast::<PyFloat>() {
        return Ok((true, vec![t.extract()?]));
    }
    let expected = "a real number or numbers of shape (n,)";
    let found = numbers(argument, expected, value)?;
    match found.shape[..] {
        [] => Ok((true, found.values)),
        [_] => Ok((false, found.values)),
        _ => Err(Error::input(format!(
            "`{argument}` must be {expected}, found shape {}",
            shape_text(&found.shape)
        ))),
    }
}

/// A number, or numbers in one axis.
pub(crate) fn real_numbers(argument: &str, value: &Bound<'_, PyAny>) -> Result<Vec<f64>, Error> {
    times(argument, value).map(|(_, values)| values)
}

/// One number for each of `count` entries, from as many or from one for all.
pub(crate) fn numbers_or_one(
    argument: &str,
    count: usize,
    value: &Bound<'_, PyAny>,
) -> Result<Vec<f64>, Error> {
    let expected = format!("a real number or numbers of shape ({count},)");
    let found = numbers(argument, &expected, value)?;
    match found.shape[..] {
        [] => Ok(vec![found.values[0]; count]),
        [n] if n == count => Ok(found.values),
        _ => Err(Error::input(format!(
            "`{argument}` must be {expected}, found shape {}",
            shape_text(&found.shape)
        ))),
    }
}

/// An array of the given shape from numbers in the order of C.
pub(crate) fn array<'py>(
    py: Python<'py>,
    values: Vec<f64>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    numpy::PyArray1::from_vec(py, values).reshape(shape.to_vec())
}

/// Numbers as an array of one axis.
pub(crate) fn row(py: Python<'_>, values: Vec<f64>) -> PyResult<Bound<'_, PyArrayDyn<f64>>> {
    let shape = [values.len()];
    array(py, values, &shape)
}

/// A new array of one axis with the numbers of one that was pickled.
pub(crate) fn row_of_pickled(argument: &str, value: &Bound<'_, PyAny>) -> Result<Py<PyArrayDyn<f64>>, Error> {
    let numbers = with_shape(argument, &[value.len()?], value)?;
    Ok(row(value.py(), numbers)?.unbind())
}

/// A vector as an array of shape (3,).
pub(crate) fn vector_array<'py>(py: Python<'py>, v: &Vector3<f64>) -> Bound<'py, PyAny> {
    numpy::PyArray1::from_slice(py, v.as_slice()).into_any()
}

/// A matrix as an array of shape (3, 3).
pub(crate) fn matrix_array<'py>(py: Python<'py>, m: &Matrix3<f64>) -> PyResult<Bound<'py, PyAny>> {
    Ok(array(py, m.transpose().as_slice().to_vec(), &[3, 3])?.into_any())
}

/// The components (x, y, z, w) of a quaternion, as SciPy orders them.
pub(crate) fn components(q: &UnitQuaternion<f64>) -> [f64; 4] {
    [q.i, q.j, q.k, q.w]
}

/// A SciPy rotation, or a stack of them, from an array of quaternions (x, y, z, w).
pub(crate) fn rotation<'py>(quaternions: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    rotation_class(quaternions.py())?.call_method1("from_quat", (quaternions,))
}
