//! Functions of one configuration or of many: arguments and results with an axis in front where there
//! are many.

use crate::core::convert::{contiguous, shape_text};
use crate::core::error::Error;
use crate::core::memory::zeros;
use crate::core::waiting::together;
use numpy::PyReadonlyArrayDyn;
use numpy::prelude::*;
use pyo3::prelude::*;
use rayon::prelude::*;
use std::sync::Mutex;

/// How many units of work lie between two looks at signals: a fraction of a second.
const WORK_PER_LOOK: usize = 1 << 18;

/// How many units of work a core takes at once.
const WORK_PER_BLOCK: usize = 1 << 9;

/// An argument of finite numbers: one row, which stands for all, or many. Nothing is copied from an array
/// of float64 in the order of C.
pub(crate) struct Rows<'py> {
    name: &'static str,
    /// None where the argument was left out: rows are empty.
    array: Option<PyReadonlyArrayDyn<'py, f64>>,
    length: usize,
    count: Option<usize>,
}

impl<'py> Rows<'py> {
    /// Numbers of the given shape, or with an axis more in front.
    pub(crate) fn extract(
        name: &'static str,
        shape: &[usize],
        value: &Bound<'py, PyAny>,
    ) -> Result<Self, Error> {
        let inner: Vec<_> = shape.iter().map(usize::to_string).collect();
        let expected = format!("real numbers of shape {} or (n, {})", shape_text(shape), inner.join(", "));
        let array = contiguous(name, &expected, value)?;
        let count = match array.shape() {
            found if found == shape => None,
            [n, found @ ..] if found == shape => Some(*n),
            found => {
                let found = shape_text(found);
                return Err(Error::input(format!("`{name}` must be {expected}, found shape {found}")));
            }
        };
        let rows = Self { name, length: shape.iter().product(), count, array: Some(array) };
        let numbers = rows.all()?;
        match numbers.iter().position(|x| !x.is_finite()) {
            None => Ok(rows),
            Some(at) => {
                let row = count.map_or(String::new(), |_| format!(" in row {}", at / rows.length));
                Err(Error::input(format!("`{name}` must be finite, found {}{row}", numbers[at])))
            }
        }
    }

    /// As [`extract`](Self::extract), for an argument that may be left out.
    pub(crate) fn extract_or_empty(
        name: &'static str,
        shape: &[usize],
        value: Option<&Bound<'py, PyAny>>,
    ) -> Result<Self, Error> {
        match value {
            Some(value) => Self::extract(name, shape, value),
            None => Ok(Self { name, array: None, length: 0, count: None }),
        }
    }

    /// All rows, one after the other.
    pub(crate) fn all(&self) -> Result<&[f64], Error> {
        match &self.array {
            Some(array) => array.as_slice().map_err(|error| Error::Raised(error.into())),
            None => Ok(&[]),
        }
    }

    /// How many rows were given, where it is not one that stands for all.
    pub(crate) fn count(&self) -> Option<usize> {
        self.count
    }

    /// Whether rows were given as many.
    pub(crate) fn is_many(&self) -> bool {
        self.count.is_some()
    }
}

/// Workspaces that wait for the next single evaluation.
pub(crate) struct Workspaces<W>(Mutex<Vec<W>>);

impl<W> Default for Workspaces<W> {
    fn default() -> Self {
        Self(Mutex::default())
    }
}

impl<W> Workspaces<W> {
    fn take(&self) -> Option<W> {
        self.0.lock().ok()?.pop()
    }

    fn give_back(&self, workspace: W) {
        if let Ok(mut waiting) = self.0.lock() {
            waiting.push(workspace);
        }
    }
}

/// What the rows of a result are.
pub(crate) struct Results {
    values: Vec<f64>,
    count: Option<usize>,
    length: usize,
}

impl Results {
    /// As one array, whose last axes have the given shape.
    pub(crate) fn array<'py>(self, py: Python<'py>, shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
        let shape: Vec<_> = self.count.into_iter().chain(shape.iter().copied()).collect();
        Ok(crate::core::convert::array(py, self.values, &shape)?.into_any())
    }

    /// As a float, or an array of them.
    pub(crate) fn scalars<'py>(self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match self.count {
            None => Ok(pyo3::types::PyFloat::new(py, self.values[0]).into_any()),
            Some(_) => self.array(py, &[]),
        }
    }

    /// As several arrays: each row is cut into parts of these shapes.
    pub(crate) fn arrays<'py, const N: usize>(
        self,
        py: Python<'py>,
        shapes: [&[usize]; N],
    ) -> PyResult<[Bound<'py, PyAny>; N]> {
        let mut start = 0;
        let parts = shapes.map(|shape| {
            let length: usize = shape.iter().product();
            let at = start..start + length;
            start += length;
            let mut values = Vec::with_capacity(self.count.unwrap_or(1) * length);
            for i in 0..self.count.unwrap_or(1) {
                let row = i * self.length;
                values.extend_from_slice(&self.values[row + at.start..row + at.end]);
            }
            Results { values, count: self.count, length }.array(py, shape)
        });
        let mut arrays = Vec::with_capacity(N);
        for part in parts {
            arrays.push(part?);
        }
        Ok(std::array::from_fn(|i| arrays[i].clone()))
    }
}

/// The rows of one argument in a block of them, or the one that stands for all.
#[derive(Clone, Copy)]
pub(crate) struct Block<'a> {
    pub(crate) numbers: &'a [f64],
    length: usize,
    many: bool,
}

impl<'a> Block<'a> {
    fn row(&self, i: usize) -> &'a [f64] {
        self.rows(i, 1).numbers
    }

    /// Some of them.
    fn rows(&self, first: usize, count: usize) -> Self {
        if !self.many {
            return *self;
        }
        Self { numbers: &self.numbers[first * self.length..(first + count) * self.length], ..*self }
    }
}

/// Evaluates a function at every row of its arguments, many in parallel and without the interpreter.
///
/// `length` is that of a row of the result, `work` measures an evaluation: bodies, say. Results do not
/// depend on how many rows there are. Of several failures the first row's is reported.
pub(crate) fn map<W, E, const N: usize>(
    py: Python<'_>,
    arguments: [&Rows<'_>; N],
    length: usize,
    work: usize,
    workspaces: &Workspaces<W>,
    make: impl Fn() -> W + Sync,
    evaluate: impl Fn(&mut W, [&[f64]; N], &mut [f64]) -> Result<(), E> + Sync,
) -> Result<Results, Error>
where
    E: Into<Error> + Send,
{
    map_blocks(
        py,
        arguments,
        (length, 1),
        work,
        workspaces,
        make,
        |w: &mut W, blocks: [Block<'_>; N], out| {
            out.chunks_mut(length.max(1)).enumerate().try_for_each(|(i, out)| {
                evaluate(w, blocks.map(|block| block.row(i)), out).map_err(|error| (i, error))
            })
        },
    )
}

/// The same with a function of a block of rows, which says what is wrong with which; blocks have a multiple of `lanes` rows
/// but for the last one.
pub(crate) fn map_blocks<W, E, const N: usize>(
    py: Python<'_>,
    arguments: [&Rows<'_>; N],
    (length, lanes): (usize, usize),
    work: usize,
    workspaces: &Workspaces<W>,
    make: impl Fn() -> W + Sync,
    evaluate: impl Fn(&mut W, [Block<'_>; N], &mut [f64]) -> Result<(), (usize, E)> + Sync,
) -> Result<Results, Error>
where
    E: Into<Error> + Send,
{
    let count = common_count(&arguments)?;
    let mut numbers = [&[][..]; N];
    for (numbers, rows) in numbers.iter_mut().zip(&arguments) {
        *numbers = rows.all()?;
    }
    // Python objects stay here; threads see what the rows are made of.
    let all: [_; N] = std::array::from_fn(|k| Block {
        numbers: numbers[k],
        length: arguments[k].length,
        many: arguments[k].is_many(),
    });
    let mut values = zeros("the results of so many rows", &[count.unwrap_or(1), length])?;
    let Some(n) = count else {
        let mut workspace = workspaces.take().unwrap_or_else(make);
        let evaluated = evaluate(&mut workspace, all, &mut values);
        workspaces.give_back(workspace);
        evaluated.map_err(|(_, error)| error.into())?;
        return Ok(Results { values, count, length });
    };
    let per_look = (WORK_PER_LOOK / work.max(1)).max(1).next_multiple_of(lanes);
    let per_block = (WORK_PER_BLOCK / work.max(1)).max(1).next_multiple_of(lanes);
    let mut first = 0;
    while first < n && length > 0 {
        let last = (first + per_look).min(n);
        let part = &mut values[first * length..last * length];
        let block = |w: &mut W, (b, out): (usize, &mut [f64])| {
            let start = first + b * per_block;
            let blocks = all.map(|block| block.rows(start, out.len() / length));
            evaluate(w, blocks, out).err().map(|(i, error)| (start + i, error))
        };
        let failure = together(py, || {
            let blocks = part.par_chunks_mut(per_block * length).enumerate();
            blocks.map_init(&make, block).find_map_first(|failure| failure)
        })?;
        if let Some((i, error)) = failure {
            return Err(error.into().in_row(i));
        }
        py.check_signals()?;
        first = last;
    }
    Ok(Results { values, count, length })
}

/// How many rows the arguments have; None where each has one.
fn common_count(arguments: &[&Rows<'_>]) -> Result<Option<usize>, Error> {
    let mut many = arguments.iter().filter_map(|rows| Some((rows.name, rows.count?)));
    let Some((name, n)) = many.next() else { return Ok(None) };
    match many.find(|(_, m)| *m != n) {
        None => Ok(Some(n)),
        Some((other, m)) => {
            Err(Error::input(format!("`{other}` must have one row or as many as `{name}`, {n}, found {m}")))
        }
    }
}
