//! SYNTHETIC dives and scores.

use super::faults::{DiveFaults, SyntheticJudge, configurations};
use super::fit::MarkerSet;
use super::judged::JudgedSet;
use super::markers::MarkerRecording;
use super::matrix::{self, count, numbers_array};
use super::scoring::Performance;
use crate::core::convert::{array, real_numbers, vector, vector_array};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_class, by_restore, value};
use crate::core::waiting::leave_on_signal;
use crate::multibody::model::Model;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::motion::analysis;
use somersault::motion::synthetic::{self, SyntheticOptions};

/// What is changed about a flight to make a SYNTHETIC dive.
///
/// Parameters
/// ----------
/// exit_delay : float, optional
///     How much later the fold opens, s; negative earlier.
/// looseness : float, optional
///     Fraction by which the fold is smaller.
/// over_rotation : float, optional
///     How much farther the body turns till the entry, rad; negative: short.
/// wobble, wobble_frequency, wobble_phase : float, optional
///     Amplitude as a fraction of the fold, frequency, Hz, and phase, rad, of a wobble.
/// asymmetry : float, optional
///     Fraction by which joints on the right fold more and those on the left less.
/// duration : float, optional
///     Fraction by which the flight lasts longer.
///
/// Raises
/// ------
/// InputError
///     If a number is not finite, or a fraction not below 1.
///
/// Examples
/// --------
/// >>> from somersault import motion
/// >>> late = motion.Perturbation(exit_delay=0.05, looseness=0.1)
/// >>> late.exit_delay, late.over_rotation
/// (0.05, 0.0)
#[pyclass(frozen, module = "somersault.motion")]
#[derive(Clone, Copy)]
pub(crate) struct Perturbation {
    perturbation: synthetic::Perturbation,
}

value! {
    impl Perturbation {
        /// float: How much later the fold opens, s.
        exit_delay: f64 = |own| own.perturbation.exit_delay;
        /// float: Fraction by which the fold is smaller.
        looseness: f64 = |own| own.perturbation.looseness;
        /// float: How much farther the body turns till the entry, rad.
        over_rotation: f64 = |own| own.perturbation.over_rotation;
        /// float: Amplitude of the wobble as a fraction of the fold.
        wobble: f64 = |own| own.perturbation.wobble;
        /// float: Frequency of the wobble, Hz.
        wobble_frequency: f64 = |own| own.perturbation.wobble_frequency;
        /// float: Phase of the wobble, rad.
        wobble_phase: f64 = |own| own.perturbation.wobble_phase;
        /// float: Fraction by which joints on the right fold more and those on the left less.
        asymmetry: f64 = |own| own.perturbation.asymmetry;
        /// float: Fraction by which the flight lasts longer.
        duration: f64 = |own| own.perturbation.duration;
    }
}

#[pymethods]
impl Perturbation {
    #[new]
    #[pyo3(signature = (
        *, exit_delay=0.0, looseness=0.0, over_rotation=0.0, wobble=0.0, wobble_frequency=6.0, wobble_phase=0.0,
        asymmetry=0.0, duration=0.0
    ))]
    fn new(
        exit_delay: f64,
        looseness: f64,
        over_rotation: f64,
        wobble: f64,
        wobble_frequency: f64,
        wobble_phase: f64,
        asymmetry: f64,
        duration: f64,
    ) -> Result<Self, Error> {
        let perturbation = synthetic::Perturbation {
            exit_delay,
            looseness,
            over_rotation,
            wobble,
            wobble_frequency,
            wobble_phase,
            asymmetry,
            duration,
        };
        perturbation.validate()?;
        Ok(Self { perturbation })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        by_restore(slf, (slf.get().numbers().map(|(_, number)| number),))
    }

    /// A pickled perturbation.
    #[classmethod]
    fn _restore(_: &Bound<'_, PyType>, numbers: [f64; 8]) -> Result<Self, Error> {
        let [a, b, c, d, e, f, g, h] = numbers;
        Self::new(a, b, c, d, e, f, g, h)
    }

    fn __repr__(&self) -> String {
        let numbers = self.numbers().map(|(name, number)| format!("{name}={number:.4}"));
        format!("Perturbation({})", numbers.join(", "))
    }
}

impl Perturbation {
    /// Its numbers by the names of the arguments, in their order.
    fn numbers(&self) -> [(&'static str, f64); 8] {
        let p = &self.perturbation;
        [
            ("exit_delay", p.exit_delay),
            ("looseness", p.looseness),
            ("over_rotation", p.over_rotation),
            ("wobble", p.wobble),
            ("wobble_frequency", p.wobble_frequency),
            ("wobble_phase", p.wobble_phase),
            ("asymmetry", p.asymmetry),
            ("duration", p.duration),
        ]
    }
}

/// A flight that SYNTHETIC dives are made of.
///
/// Joints are perturbed in what they depart by from the straight way between their end postures; the flight is then
/// flown again, with constant angular momentum, which is found such that the root turns as far as in the given flight.
///
/// Parameters
/// ----------
/// model : Model
///     With a floating or planar root, and other joints of one coordinate.
/// times : array_like, shape (n,)
///     At least five, s.
/// q : array_like, shape (n, n_positions)
///     Less than a half turn apart.
///
/// Raises
/// ------
/// InputError
///     If the flight cannot be perturbed; the message says why.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import motion, multibody
/// >>> diver = multibody.diver_planar()
/// >>> t = np.linspace(0.0, 1.0, 30)
/// >>> fold = np.sin(np.pi * t)[:, None] ** 2
/// >>> q = (1 - fold) * diver.configuration("A") + fold * diver.configuration("H")
/// >>> q[:, 2] = 4.0 * t
/// >>> motion.SyntheticFlight(diver.model, t, q)
/// <SyntheticFlight: SYNTHETIC, 10 bodies>
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct SyntheticFlight {
    flight: synthetic::SyntheticFlight,
    model: Py<Model>,
    faults: analysis::DiveFaults,
    times: Vec<f64>,
    positions: Vec<f64>,
}

value! {
    impl SyntheticFlight {
        /// Model: The model.
        model: Py<Model> = |own, py| own.model.clone_ref(py);
        /// DiveFaults: The faults of the flight itself.
        faults: DiveFaults = |own| DiveFaults { faults: own.faults };
    }
}

#[pymethods]
impl SyntheticFlight {
    #[new]
    fn new(model: &Bound<'_, Model>, times: &Bound<'_, PyAny>, q: &Bound<'_, PyAny>) -> Result<Self, Error> {
        let tree = &model.get().model;
        let (times, positions) = (real_numbers("times", times)?, configurations(tree, q)?);
        let flight = synthetic::SyntheticFlight::try_new(tree, &times, &positions)?;
        let faults = analysis::DiveFaults::of(tree, &times, &positions)?;
        Ok(Self { flight, model: model.clone().unbind(), faults, times, positions })
    }

    /// Flies the flight again with a perturbation.
    ///
    /// Parameters
    /// ----------
    /// perturbation : Perturbation
    ///
    /// Returns
    /// -------
    /// SyntheticDive
    ///
    /// Examples
    /// --------
    /// A looser fold of the same somersault, which then takes more angular momentum:
    ///
    /// >>> import numpy as np
    /// >>> from somersault import motion, multibody
    /// >>> diver = multibody.diver_planar()
    /// >>> t = np.linspace(0.0, 1.0, 30)
    /// >>> fold = np.sin(np.pi * t)[:, None] ** 2
    /// >>> q = (1 - fold) * diver.configuration("A") + fold * diver.configuration("H")
    /// >>> q[:, 2] = 4.0 * t
    /// >>> flight = motion.SyntheticFlight(diver.model, t, q)
    /// >>> loose = flight.perturb(motion.Perturbation(looseness=0.1))
    /// >>> loose.times.shape, bool(abs(loose.q[-1, 2] - q[-1, 2]) < 0.01)
    /// ((30,), True)
    fn perturb(
        &self,
        py: Python<'_>,
        perturbation: &Bound<'_, Perturbation>,
    ) -> Result<SyntheticDive, Error> {
        let (flight, perturbation) = (self.flight.clone(), perturbation.get().perturbation);
        let dive = leave_on_signal(py, move |_| flight.perturb(&perturbation))?;
        Ok(SyntheticDive { model: self.model(py), dive })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let q = frames_array(py, &own.positions, own.times.len())?;
        by_class(slf, (own.model(py), numbers_array(py, &own.times), q))
    }

    fn __repr__(&self) -> String {
        format!("<SyntheticFlight: SYNTHETIC, {} bodies>", self.flight.model().n_bodies())
    }
}

/// Configurations, one after the other, as an array with a row for each.
fn frames_array<'py>(py: Python<'py>, positions: &[f64], n_frames: usize) -> PyResult<Bound<'py, PyAny>> {
    let n_positions = positions.len().checked_div(n_frames).unwrap_or(0);
    Ok(array(py, positions.to_vec(), &[n_frames, n_positions])?.into_any())
}

/// A SYNTHETIC dive.
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct SyntheticDive {
    model: Py<Model>,
    dive: synthetic::SyntheticDive,
}

value! {
    impl SyntheticDive {
        /// Model: The diver.
        model: Py<Model> = |own, py| own.model.clone_ref(py);
        /// ndarray, shape (n,): Times, s.
        times: Bound<'py, PyAny> = |own, py| numbers_array(py, &own.dive.times);
        /// ndarray, shape (n, n_positions): Configurations.
        q: PyResult<Bound<'py, PyAny>> =
            |own, py| frames_array(py, &own.dive.positions, own.dive.times.len());
        /// Perturbation: What made it.
        perturbation: Perturbation = |own| Perturbation { perturbation: own.dive.perturbation };
        /// ndarray, shape (3,): Angular momentum about the centre of mass, world axes, kg m²/s.
        angular_momentum: Bound<'py, PyAny> = |own, py| vector_array(py, &own.dive.angular_momentum);
    }
}

#[pymethods]
impl SyntheticDive {
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let rows = (own.times(py), own.q(py)?);
        by_restore(slf, (own.model(py), rows, own.perturbation(), own.angular_momentum(py)))
    }

    /// A pickled dive.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        model: Py<Model>,
        rows: (Bound<'_, PyAny>, Bound<'_, PyAny>),
        perturbation: &Bound<'_, Perturbation>,
        angular_momentum: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        let dive = synthetic::SyntheticDive {
            times: real_numbers("times", &rows.0)?,
            positions: matrix::matrix("q", &rows.1)?.transpose().as_slice().to_vec(),
            perturbation: perturbation.get().perturbation,
            angular_momentum: vector("angular_momentum", angular_momentum)?,
        };
        Ok(Self { model, dive })
    }

    fn __repr__(&self) -> String {
        format!("<SyntheticDive: SYNTHETIC, {} frames>", self.dive.times.len())
    }
}

/// SYNTHETIC dives with the scores of a SYNTHETIC judge: what is learnt from them says nothing about dives or judges.
///
/// Parameters
/// ----------
/// flight : SyntheticFlight
/// markers : MarkerSet
///     On the model of the flight.
/// judge : SyntheticJudge, optional
///     One to whom the flight itself has no faults unless given.
/// n_dives : int, optional
/// seed : int, optional
///     Of all that is drawn.
/// least, greatest : Perturbation, optional
///     Each number is drawn uniformly in between, the phase of the wobble from a turn. Unless given: exits up to 60 ms late,
///     pikes up to 12 % loose, up to 0.25 rad over, wobbles of up to 4 %, 2 % shorter to 2 % longer, on the right up to
///     5 % more than on the left.
/// marker_noise : float, optional
///     Standard deviation of the noise in each coordinate of the markers, m.
///
/// Raises
/// ------
/// InputError
///     If an argument is out of range, or no such dive can be flown.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from somersault import motion, multibody
/// >>> diver = multibody.diver_planar()
/// >>> t = np.linspace(0.0, 1.0, 30)
/// >>> fold = np.sin(np.pi * t)[:, None] ** 2
/// >>> q = (1 - fold) * diver.configuration("A") + fold * diver.configuration("H")
/// >>> q[:, 2] = 4.0 * t
/// >>> flight = motion.SyntheticFlight(diver.model, t, q)
/// >>> markers = motion.MarkerSet.joint_centres(diver.model)
/// >>> made = motion.SyntheticSet(flight, markers, n_dives=4, seed=1)
/// >>> made, bool((made.scores < 10.0).all())
/// (<SyntheticSet: 4 SYNTHETIC dives>, True)
#[pyclass(frozen, module = "somersault.motion")]
pub(crate) struct SyntheticSet {
    model: Py<Model>,
    set: synthetic::SyntheticSet,
    judge: synthetic::SyntheticJudge,
}

value! {
    impl SyntheticSet {
        /// SyntheticJudge: Who gave the scores.
        judge: SyntheticJudge = |own| SyntheticJudge { judge: own.judge };
        /// list of SyntheticDive: The dives.
        dives: Vec<SyntheticDive> = |own, py| {
            let of = |dive| SyntheticDive { model: own.model.clone_ref(py), dive };
            own.set.dives.iter().cloned().map(of).collect()
        };
        /// list of DiveFaults: The faults of each.
        faults: Vec<DiveFaults> =
            |own| own.set.faults.iter().map(|faults| DiveFaults { faults: *faults }).collect();
        /// list of MarkerRecording: The markers of each, with noise.
        markers: Vec<MarkerRecording> =
            |own| own.set.markers.iter().cloned().map(MarkerRecording::from).collect();
        /// ndarray, shape (n_dives,): What the judge means to give, without noise.
        intended: Bound<'py, PyAny> = |own, py| numbers_array(py, &own.set.intended);
        /// ndarray, shape (n_dives,): What he gives.
        scores: Bound<'py, PyAny> = |own, py| numbers_array(py, &own.set.scores);
    }
}

#[pymethods]
impl SyntheticSet {
    #[new]
    #[pyo3(signature = (flight, markers, judge=None, *, n_dives=16, seed=0, least=None, greatest=None, marker_noise=0.005))]
    fn new(
        py: Python<'_>,
        flight: &Bound<'_, SyntheticFlight>,
        markers: &Bound<'_, MarkerSet>,
        judge: Option<&Bound<'_, SyntheticJudge>>,
        n_dives: i128,
        seed: i128,
        least: Option<&Bound<'_, Perturbation>>,
        greatest: Option<&Bound<'_, Perturbation>>,
        marker_noise: f64,
    ) -> Result<Self, Error> {
        let (n_dives, seed) = (count("n_dives", n_dives)?, matrix::seed(seed)?);
        let mut options = SyntheticOptions { seed, marker_noise, ..SyntheticOptions::of(n_dives) };
        for (end, given) in options.perturbations.iter_mut().zip([least, greatest]) {
            if let Some(given) = given {
                *end = given.get().perturbation;
            }
        }
        let flight = flight.get();
        let model = flight.model(py);
        let judge = judge.map_or_else(
            || synthetic::SyntheticJudge::with_reference(flight.faults),
            |judge| judge.get().judge,
        );
        let (flight, markers) = (flight.flight.clone(), markers.get().markers.clone());
        let set = leave_on_signal(py, move |token| {
            synthetic::SyntheticSet::generate_cancellable(&flight, &markers, &judge, &options, token)
        })?;
        Ok(Self { model, set, judge })
    }

    /// The dives as motions to be scored, by their markers, labelled synthetic.
    ///
    /// Returns
    /// -------
    /// list of Performance
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import motion, multibody
    /// >>> diver = multibody.diver_planar()
    /// >>> t = np.linspace(0.0, 1.0, 30)
    /// >>> fold = np.sin(np.pi * t)[:, None] ** 2
    /// >>> q = (1 - fold) * diver.configuration("A") + fold * diver.configuration("H")
    /// >>> q[:, 2] = 4.0 * t
    /// >>> flight = motion.SyntheticFlight(diver.model, t, q)
    /// >>> made = motion.SyntheticSet(flight, motion.MarkerSet.joint_centres(diver.model), n_dives=2, seed=1)
    /// >>> [performance.synthetic for performance in made.performances()]
    /// [True, True]
    fn performances(&self) -> Result<Vec<Performance>, Error> {
        let found = self.set.performances()?;
        Ok(found.into_iter().map(|performance| Performance { performance }).collect())
    }

    /// The dives as a judged set, labelled synthetic, to be saved.
    ///
    /// Returns
    /// -------
    /// JudgedSet
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import motion, multibody
    /// >>> diver = multibody.diver_planar()
    /// >>> t = np.linspace(0.0, 1.0, 30)
    /// >>> fold = np.sin(np.pi * t)[:, None] ** 2
    /// >>> q = (1 - fold) * diver.configuration("A") + fold * diver.configuration("H")
    /// >>> q[:, 2] = 4.0 * t
    /// >>> flight = motion.SyntheticFlight(diver.model, t, q)
    /// >>> made = motion.SyntheticSet(flight, motion.MarkerSet.joint_centres(diver.model), n_dives=2, seed=1)
    /// >>> made.judged_set()
    /// <JudgedSet: 2 motions, 2 of them SYNTHETIC>
    fn judged_set(&self) -> JudgedSet {
        JudgedSet { set: self.set.judged_set() }
    }

    fn __len__(&self) -> usize {
        self.set.dives.len()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        let arguments = (
            own.model.clone_ref(py),
            own.judge(),
            own.dives(py),
            own.faults(),
            own.markers(),
            own.intended(py),
            own.scores(py),
        );
        by_restore(slf, arguments)
    }

    /// A pickled set.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        model: Py<Model>,
        judge: &Bound<'_, SyntheticJudge>,
        dives: Vec<Bound<'_, SyntheticDive>>,
        faults: Vec<Bound<'_, DiveFaults>>,
        markers: Vec<Bound<'_, MarkerRecording>>,
        intended: &Bound<'_, PyAny>,
        scores: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        let set = synthetic::SyntheticSet {
            dives: dives.iter().map(|dive| dive.get().dive.clone()).collect(),
            faults: faults.iter().map(|faults| faults.get().faults).collect(),
            markers: markers.iter().map(|markers| markers.get().recording.clone()).collect(),
            intended: real_numbers("intended", intended)?,
            scores: real_numbers("scores", scores)?,
        };
        let n = set.dives.len();
        for (argument, found) in [
            ("faults", set.faults.len()),
            ("markers", set.markers.len()),
            ("intended", set.intended.len()),
            ("scores", set.scores.len()),
        ] {
            matrix::same_length(argument, found, n)?;
        }
        Ok(Self { model, set, judge: judge.get().judge })
    }

    fn __repr__(&self) -> String {
        format!("<SyntheticSet: {} SYNTHETIC dives>", self.set.dives.len())
    }
}
