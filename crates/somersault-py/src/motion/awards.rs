//! Tables of judges' awards.

use super::matrix::{numbers_array, same_length};
use super::readers::{Failed, bytes_of, warn};
use super::repair::Repair;
use crate::core::convert::with_shape;
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::core::waiting::leave_on_signal;
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};
use somersault::motion::readers::awards::{self, AwardedDive};
use somersault::motion::scoring::panel_score;

/// Dives with the awards of their judges, as `read_awards` reads them.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct AwardTable {
    dives: Vec<AwardedDive>,
    repairs: Vec<Repair>,
}

impl AwardTable {
    fn numbers<'py>(&self, py: Python<'py>, of: impl Fn(&AwardedDive) -> f64) -> Bound<'py, PyAny> {
        numbers_array(py, &self.dives.iter().map(of).collect::<Vec<_>>())
    }
}

value! {
    impl AwardTable {
        /// tuple of tuple of float: The award of each judge, for each dive.
        awards: PyResult<Bound<'py, PyTuple>> = |own, py| {
            let of_dive = |dive: &AwardedDive| PyTuple::new(py, &dive.awards);
            PyTuple::new(py, own.dives.iter().map(of_dive).collect::<PyResult<Vec<_>>>()?)
        };
        /// tuple of tuple of bool: Whether the award of each judge counts (`panel_score`).
        counts: PyResult<Bound<'py, PyTuple>> = |own, py| {
            let of_dive = |dive: &AwardedDive| PyTuple::new(py, &dive.panel.counts);
            PyTuple::new(py, own.dives.iter().map(of_dive).collect::<PyResult<Vec<_>>>()?)
        };
        /// ndarray, shape (n_dives,): Degrees of difficulty.
        difficulty: Bound<'py, PyAny> = |own, py| own.numbers(py, |dive| dive.difficulty);
        /// ndarray, shape (n_dives,): Points, by the awards that count and the difficulty.
        points: Bound<'py, PyAny> = |own, py| own.numbers(py, |dive| dive.panel.points);
        /// ndarray, shape (n_dives,): Points that the table states, NaN where it does not.
        stated: Bound<'py, PyAny> = |own, py| own.numbers(py, |dive| dive.stated.unwrap_or(f64::NAN));
        /// ndarray, shape (n_dives,): Mean of the awards that count, from 0 to 10; scores for `ScoringModel`, which do not depend on the
        /// difficulty.
        scores: Bound<'py, PyAny> = |own, py| own.numbers(py, AwardedDive::score);
        /// tuple of str or None: The athlete of each dive.
        athletes: PyResult<Bound<'py, PyTuple>> =
            |own, py| PyTuple::new(py, own.dives.iter().map(|dive| dive.athlete.as_deref()));
        /// tuple of str or None: The number of each dive, as the table has it.
        dives: PyResult<Bound<'py, PyTuple>> =
            |own, py| PyTuple::new(py, own.dives.iter().map(|dive| dive.dive.as_deref()));
        /// list of int: Line of each dive in the table, from 1.
        lines: Vec<usize> = |own| own.dives.iter().map(|dive| dive.line).collect();
        /// list of Repair: What was put right or left out when the table was read.
        repairs: Vec<Repair> = |own| own.repairs.clone();
    }
}

#[pymethods]
impl AwardTable {
    fn __len__(&self) -> usize {
        self.dives.len()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let texts = (own.athletes(py)?, own.dives(py)?);
        by_restore(
            slf,
            (own.awards(py)?, own.difficulty(py), own.stated(py), texts, own.lines(), own.repairs()),
        )
    }

    /// A pickled table.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        awards: Vec<Vec<f64>>,
        difficulty: &Bound<'_, PyAny>,
        stated: &Bound<'_, PyAny>,
        texts: (Vec<Option<String>>, Vec<Option<String>>),
        lines: Vec<usize>,
        repairs: Vec<Repair>,
    ) -> Result<Self, Error> {
        let n = awards.len();
        let (difficulty, stated) =
            (with_shape("difficulty", &[n], difficulty)?, with_shape("stated", &[n], stated)?);
        for (argument, found) in
            [("athletes", texts.0.len()), ("dives", texts.1.len()), ("lines", lines.len())]
        {
            same_length(argument, found, n)?;
        }
        let dive = |(k, awards): (usize, Vec<f64>)| {
            Ok(AwardedDive {
                panel: panel_score(&awards, difficulty[k])?,
                awards,
                difficulty: difficulty[k],
                stated: (!stated[k].is_nan()).then_some(stated[k]),
                athlete: texts.0[k].clone(),
                dive: texts.1[k].clone(),
                line: lines[k],
            })
        };
        let dives = awards.into_iter().enumerate().map(dive).collect::<Result<_, Error>>()?;
        Ok(Self { dives, repairs })
    }

    fn __repr__(&self) -> String {
        let judges = self.dives.iter().map(|dive| dive.awards.len());
        let judges = match (judges.clone().min(), judges.max()) {
            (Some(least), Some(most)) if least == most => most.to_string(),
            (least, most) => format!("{} to {}", least.unwrap_or(0), most.unwrap_or(0)),
        };
        format!("<AwardTable: {} dives, {judges} judges>", self.dives.len())
    }
}

/// Reads a table of judges' awards, as results of competitions and the lists of public judged sets have them.
///
/// The first line names the columns, in any order. Awards are in a column for each judge, whose name ends in a number (``J1``, ``judge 2``),
/// or in one column ``judge_scores`` as a list, ``[7.5, 8.0, 7.5]``. There must be a ``difficulty`` (``dd``, ``tariff``); ``points``
/// (``dive_score``, ``final_score``), ``athlete`` (``diver``, ``name``) and ``dive`` (``action_type``) may be left out. Cells are separated by
/// commas, semicolons or tabs, with decimal points or commas; text is UTF-8, UTF-16 or Latin-1.
///
/// Dives of other numbers of judges than 3, 5 or 7, as in synchronised diving, are left out. Points are computed; where the table states
/// others, or has been repaired otherwise, `AwardTable.repairs` says so, and a `somersault.errors.ReadWarning` does.
///
/// Parameters
/// ----------
/// source : path or file
/// strict : bool, optional
///     Whether a table that needs a repair is refused.
///
/// Returns
/// -------
/// AwardTable
///
/// Raises
/// ------
/// ReadError
///     If the table is not one; the attribute ``line`` says where.
/// OSError
///     If the file cannot be opened.
///
/// Examples
/// --------
/// >>> import io
/// >>> from somersault import motion
/// >>> text = "diver;dive;DD;J1;J2;J3;J4;J5;points\nAnn;107B;3,1;7,5;8;7,5;7;8;71,3\n"
/// >>> import warnings
/// >>> with warnings.catch_warnings():
/// ...     warnings.simplefilter("ignore")
/// ...     table = motion.read_awards(io.StringIO(text))
/// >>> table.points, table.athletes, str(table.repairs[0])
/// (array([71.3]), ('Ann',), 'line 2: numbers have a decimal comma (4 times)')
#[pyfunction]
#[pyo3(signature = (source, *, strict=false))]
pub(crate) fn read_awards(source: &Bound<'_, PyAny>, strict: bool) -> Result<AwardTable, Error> {
    let py = source.py();
    let (bytes, name) = bytes_of(source)?;
    let table =
        leave_on_signal(py, move |_| awards::read(&bytes, strict).map_err(|error| Failed { error, name }))?;
    for repair in table.repairs.iter().filter(|repair| !repair.is_decision) {
        warn(py, &repair.to_string())?;
    }
    Ok(AwardTable { dives: table.dives, repairs: Repair::all(table.repairs) })
}
