//! Finite-time Lyapunov exponents and vectors, and what they say of a problem.

use super::dimension::{dims_of, expect_square, matrix_array, vector};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, few, value};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::ftla::nalgebra::DMatrix;
use somersault::ftla::placement::Schedule;
use somersault::ftla::spectrum::{self, SplittingDims, TimeDirection, Unknown, Verdict};

/// A direction of time by its name.
pub(crate) fn direction_of(name: &str) -> Result<TimeDirection, Error> {
    match name {
        "forward" => Ok(TimeDirection::Forward),
        "backward" => Ok(TimeDirection::Backward),
        other => Err(Error::input(format!("`direction` must be 'forward' or 'backward', found '{other}'"))),
    }
}

pub(crate) fn name_of(direction: TimeDirection) -> &'static str {
    match direction {
        TimeDirection::Forward => "forward",
        TimeDirection::Backward => "backward",
    }
}

/// Exponents and vectors at one point for one averaging time.
///
/// With Φ(T, p) = N Σ Lᵀ and σᵢ = exp(μᵢT) the exponents are μᵢ = ln σᵢ / T and the vectors the columns of L (thesis
/// (9.1)–(9.4), with their misprints corrected), counted from the most stable to the most unstable direction of forward time.
#[pyclass(frozen, module = "somersault.ftla")]
#[derive(Clone)]
pub(crate) struct Spectrum {
    pub(crate) spectrum: spectrum::Spectrum,
}

impl Spectrum {
    pub(crate) fn dimension(&self) -> usize {
        self.spectrum.exponents.len()
    }
}

value! {
    impl Spectrum {
        /// str: ``'forward'`` or ``'backward'``.
        direction: &'static str = |own| name_of(own.spectrum.direction);
        /// float: Averaging time T, s.
        time: f64 = |own| own.spectrum.time;
        /// ndarray, shape (dimension,): μ, 1/s, ascending forward and descending backward.
        exponents: Bound<'py, PyAny> =
            |own, py| PyArray1::from_slice(py, own.spectrum.exponents.as_slice()).into_any();
        /// ndarray, shape (dimension, dimension): lᵢ as columns, orthonormal.
        vectors: PyResult<Bound<'py, PyAny>> = |own, py| matrix_array(py, &own.spectrum.vectors);
        /// ndarray, shape (dimension,): The exponents with costates in the unit in which states act on them as much as they on states,
        /// as `diagnose` takes them: those of a finite time depend on units, these not on that of the cost.
        balanced: Bound<'py, PyAny> =
            |own, py| PyArray1::from_slice(py, own.spectrum.balanced.as_slice()).into_any();
        /// ndarray, shape (dimension,): Exponents in forward order whatever the direction, backward ones with their sign changed.
        rates: Bound<'py, PyAny> =
            |own, py| PyArray1::from_slice(py, own.spectrum.rates().as_slice()).into_any();
        /// float: max |μᵢ + μ_{2n+1−i}|, zero for a Hamiltonian system.
        pairing_defect: f64 = |own| own.spectrum.pairing_defect();
    }
}

#[pymethods]
impl Spectrum {
    fn __repr__(&self) -> String {
        let exponents: Vec<_> = self.spectrum.exponents.iter().map(|mu| digits(*mu)).collect();
        format!("<Spectrum: {} over {} s, [{}] 1/s>", self.direction(), self.time(), few(&exponents))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let columns = PyArray1::from_slice(py, own.spectrum.vectors.as_slice());
        by_restore(slf, (own.direction(), own.time(), own.exponents(py), columns, own.balanced(py)))
    }

    /// A pickled spectrum.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        direction: &str,
        time: f64,
        exponents: Vec<f64>,
        vectors: Vec<f64>,
        balanced: Vec<f64>,
    ) -> Result<Self, Error> {
        expect_square("vectors", &vectors, exponents.len())?;
        if balanced.len() != exponents.len() {
            return Err(Error::input(format!(
                "`balanced` must have {} entries, found {}",
                exponents.len(),
                balanced.len()
            )));
        }
        let n = exponents.len();
        let spectrum = spectrum::Spectrum {
            direction: direction_of(direction)?,
            time,
            exponents: vector(&exponents),
            vectors: DMatrix::from_column_slice(n, n, &vectors),
            balanced: vector(&balanced),
        };
        Ok(Self { spectrum })
    }
}

/// A number in a short text: four digits after the point, or four in all where those would not show it.
fn digits(x: f64) -> String {
    if x == 0.0 || (1e-2..1e5).contains(&x.abs()) { format!("{x:.4}") } else { format!("{x:.3e}") }
}

/// What the exponents at a point say about a problem with a given horizon, as `diagnose` finds it.
///
/// `str` puts it in words.
#[pyclass(frozen, module = "somersault.ftla")]
pub(crate) struct Diagnosis {
    pub(crate) diagnosis: spectrum::Diagnosis,
}

value! {
    impl Diagnosis {
        /// str: ``'complete'`` or ``'partial'`` where the problem is hyper-sensitive in all or in some directions, ``'insensitive'``
        /// where no rates are fast against the horizon, ``'undetermined'`` where the averaging times do not tell, and
        /// ``'not_hamiltonian'`` where the flow is that of no optimal control problem. ``str`` of the diagnosis says why.
        verdict: &'static str = |own| verdict_name(&own.diagnosis.verdict);
        /// bool: Whether fast rates act in both directions for many time constants on the horizon.
        is_hyper_sensitive: bool = |own| own.diagnosis.is_hyper_sensitive();
        /// bool: Whether it is so in some directions only.
        is_partially_hyper_sensitive: bool = |own| own.diagnosis.is_partially_hyper_sensitive();
        /// float: Averaging time that shows the splitting best, s.
        time: f64 = |own| own.diagnosis.time;
        /// tuple of float: Slowest of the fast contracting and of the fast expanding rates, 1/s.
        fast_rates: (f64, f64) = |own| own.diagnosis.fast_rates.into();
        /// tuple of float: The same of the balanced exponents, which the verdict is about.
        balanced_rates: (f64, f64) = |own| own.diagnosis.balanced_rates.into();
        /// float: Largest |μ| of the centre, 1/s.
        center_rate: f64 = |own| own.diagnosis.center_rate;
        /// tuple of float: Gaps between stable and centre and between centre and unstable exponents, 1/s.
        gaps: (f64, f64) = |own| own.diagnosis.gaps.into();
        /// float: The smaller gap times the averaging time: how far the subspaces have converged.
        time_constants: f64 = |own| own.diagnosis.time_constants;
        /// tuple of float: Longest range of averaging times over which the splitting has these dimensions, s.
        window: (f64, f64) = |own| own.diagnosis.window.into();
        /// float: The horizon, s.
        horizon: f64 = |own| own.diagnosis.horizon;
    }
}

#[pymethods]
impl Diagnosis {
    /// tuple of int: (n^s, n^c, n^u); all in the centre where no gap is wide enough.
    #[getter]
    fn dims(&self) -> (usize, usize, usize) {
        let SplittingDims { stable, center, unstable } = self.diagnosis.dims;
        (stable, center, unstable)
    }

    /// Averaging times to place with: steps of 0.7 time constants of the slowest fast rate, to eight constants of the gap.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (m,)
    ///
    /// Examples
    /// --------
    /// >>> from somersault import ftla
    /// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
    /// >>> diagnosis = ftla.diagnose(flow.spectra([1.0, 0.4], [1.0, 2.0, 4.0]), 40.0)
    /// >>> diagnosis.schedule().round(2)
    /// array([0.49, 0.99, 1.48, 1.98, 2.47, 2.83])
    fn schedule<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyAny>, Error> {
        let schedule = Schedule::of_diagnosis(&self.diagnosis)?;
        Ok(PyArray1::from_slice(py, schedule.times()).into_any())
    }

    fn __str__(&self) -> String {
        self.diagnosis.to_string()
    }

    fn __repr__(&self) -> String {
        let ((stable, center, unstable), horizon) = (self.dims(), self.horizon());
        format!("<Diagnosis: {}, {stable}/{center}/{unstable}, horizon {horizon} s>", self.verdict())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        let spectrum::Diagnosis { time, center_rate, time_constants, horizon, .. } = own.diagnosis;
        let numbers = (time, center_rate, time_constants, horizon);
        let verdict = match own.diagnosis.verdict {
            Verdict::Undetermined(why) => (own.verdict(), Some(why.to_string()), None),
            Verdict::NotHamiltonian { defect } => (own.verdict(), None, Some(defect)),
            Verdict::Complete | Verdict::Partial | Verdict::Insensitive => (own.verdict(), None, None),
        };
        let rates = (own.fast_rates(), own.balanced_rates());
        by_restore(slf, (verdict, own.dims(), numbers, rates, own.gaps(), own.window()))
    }

    /// A pickled diagnosis.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        verdict: (String, Option<String>, Option<f64>),
        dims: (usize, usize, usize),
        numbers: (f64, f64, f64, f64),
        rates: ((f64, f64), (f64, f64)),
        gaps: (f64, f64),
        window: (f64, f64),
    ) -> Result<Self, Error> {
        let (time, center_rate, time_constants, horizon) = numbers;
        let (fast_rates, balanced_rates) = rates;
        Ok(Self {
            diagnosis: spectrum::Diagnosis {
                verdict: verdict_of(verdict)?,
                dims: dims_of(dims),
                time,
                fast_rates: fast_rates.into(),
                balanced_rates: balanced_rates.into(),
                center_rate,
                gaps: gaps.into(),
                time_constants,
                window: window.into(),
                horizon,
            },
        })
    }
}

/// What Python calls a verdict.
fn verdict_name(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::Complete => "complete",
        Verdict::Partial => "partial",
        Verdict::Insensitive => "insensitive",
        Verdict::Undetermined(_) => "undetermined",
        Verdict::NotHamiltonian { .. } => "not_hamiltonian",
    }
}

/// A pickled verdict: its name, why averaging times do not tell, and how far pairs of exponents are off.
fn verdict_of((name, why, defect): (String, Option<String>, Option<f64>)) -> Result<Verdict, Error> {
    let unknown = [Unknown::Span, Unknown::Unsettled, Unknown::Short];
    let known = match (name.as_str(), why, defect) {
        ("complete", None, None) => Some(Verdict::Complete),
        ("partial", None, None) => Some(Verdict::Partial),
        ("insensitive", None, None) => Some(Verdict::Insensitive),
        ("not_hamiltonian", None, Some(defect)) => Some(Verdict::NotHamiltonian { defect }),
        ("undetermined", Some(why), None) => {
            unknown.into_iter().find(|each| each.to_string() == why).map(Verdict::Undetermined)
        }
        (_, _, _) => None,
    };
    known.ok_or_else(|| Error::input(format!("`verdict` is not known: '{name}'")))
}

/// Chooses (n^s, n^c, n^u) from spectra at one point, and says what they tell about the problem.
///
/// A gap between exponents splits rates if it has three time constants at the longest averaging time T and gains three between
/// T/2 and T, more than between T/4 and T/2, while the rate over the second half of T is at most three tenths above the mean. Growth like a power of time, whose exponents are like ln T/T, gains as much in each doubling. That a problem is not
/// hyper-sensitive is said only if the averaging times reach half of the horizon or the largest rate is slow against it; that
/// it is, only if paired exponents add up to zero, as those of a control problem do.
///
/// Parameters
/// ----------
/// spectra : sequence of Spectrum
///     At one point, for ascending averaging times that span a factor of four at least.
/// horizon : float
///     Of the problem, s.
///
/// Returns
/// -------
/// Diagnosis
///
/// Examples
/// --------
/// >>> from somersault import ftla
/// >>> flow = ftla.VariationalFlow(ftla.linear_regulator())
/// >>> diagnosis = ftla.diagnose(flow.spectra([1.0, 0.4], [1.0, 2.0, 4.0]), 40.0)
/// >>> diagnosis.dims, diagnosis.is_hyper_sensitive
/// ((1, 0, 1), True)
#[pyfunction]
pub(crate) fn diagnose(spectra: Vec<Bound<'_, Spectrum>>, horizon: f64) -> Result<Diagnosis, Error> {
    let n = spectra.first().map_or(2, |s| s.get().dimension());
    if spectra.iter().any(|s| s.get().dimension() != n) {
        return Err(Error::input("`spectra` must be of one dimension"));
    }
    let spectra: Vec<_> = spectra.iter().map(|s| s.get().spectrum.clone()).collect();
    Ok(Diagnosis { diagnosis: spectrum::diagnose(&spectra, horizon)? })
}
