//! Faults of dives, and a SYNTHETIC judge of them.

use super::matrix::matrix;
use crate::core::convert::real_numbers;
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, value};
use crate::multibody::model::Model;
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::motion::analysis;
use somersault::motion::synthetic;

/// What a dive is marked down for, as numbers.
///
/// Parameters
/// ----------
/// entry_angle : float
///     Of the line from the feet to the hands against the vertical in the last frame, rad.
/// hip_opening : float
///     Least angle between trunk and thigh, rad.
/// exit_fraction : float
///     Fraction of the duration after which the hip stays more than half open.
/// asymmetry : float
///     Root mean square of left against right joint angles, rad; 0 in the plane.
/// roughness : float
///     Log dimensionless jerk of the hip's angle.
///
/// Raises
/// ------
/// InputError
///     If a fault is not finite.
///
/// Examples
/// --------
/// >>> from somersault import motion
/// >>> faults = motion.DiveFaults(entry_angle=0.1, hip_opening=0.4, exit_fraction=0.7, asymmetry=0.0, roughness=8.0)
/// >>> motion.SyntheticJudge(faults).intended(faults)
/// 10.0
#[pyclass(frozen, module = "somersault.motion")]
#[derive(Clone, Copy)]
pub(crate) struct DiveFaults {
    pub(super) faults: analysis::DiveFaults,
}

value! {
    impl DiveFaults(entry_angle, hip_opening, exit_fraction, asymmetry, roughness) {
        /// float: Angle of the long axis to the vertical at the entry, rad.
        entry_angle: f64 = |own| own.faults.entry_angle;
        /// float: Least angle between trunk and thigh, rad.
        hip_opening: f64 = |own| own.faults.hip_opening;
        /// float: Fraction of the duration after which the hip stays more than half open.
        exit_fraction: f64 = |own| own.faults.exit_fraction;
        /// float: Root mean square difference between left and right joints, rad.
        asymmetry: f64 = |own| own.faults.asymmetry;
        /// float: Log dimensionless jerk of the hip.
        roughness: f64 = |own| own.faults.roughness;
    }
}

#[pymethods]
impl DiveFaults {
    #[new]
    fn new(
        entry_angle: f64,
        hip_opening: f64,
        exit_fraction: f64,
        asymmetry: f64,
        roughness: f64,
    ) -> Result<Self, Error> {
        let faults = analysis::DiveFaults { entry_angle, hip_opening, exit_fraction, asymmetry, roughness };
        faults.validate()?;
        Ok(Self { faults })
    }

    /// The faults of a motion of a diver, planar or spatial.
    ///
    /// Parameters
    /// ----------
    /// model : Model
    ///     Whose bodies have the names of a diver's.
    /// times : array_like, shape (n,)
    /// q : array_like, shape (n, n_positions)
    ///
    /// Returns
    /// -------
    /// DiveFaults
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import motion, multibody
    /// >>> diver = multibody.diver_planar()
    /// >>> t = np.linspace(0.0, 1.0, 30)
    /// >>> fold = np.sin(np.pi * t)[:, None]
    /// >>> q = (1 - fold) * diver.configuration("A") + fold * diver.configuration("H")
    /// >>> faults = motion.DiveFaults.of(diver.model, t, q)
    /// >>> round(faults.hip_opening, 2), round(faults.exit_fraction, 2), faults.asymmetry
    /// (0.52, 0.83, 0.0)
    #[classmethod]
    fn of(
        _: &Bound<'_, PyType>,
        model: &Bound<'_, Model>,
        times: &Bound<'_, PyAny>,
        q: &Bound<'_, PyAny>,
    ) -> Result<Self, Error> {
        let (model, times) = (&model.get().model, real_numbers("times", times)?);
        Ok(Self { faults: analysis::DiveFaults::of(model, &times, &configurations(model, q)?)? })
    }

    fn __repr__(&self) -> String {
        let f = &self.faults;
        format!(
            "DiveFaults(entry_angle={:.4}, hip_opening={:.4}, exit_fraction={:.4}, asymmetry={:.4}, \
             roughness={:.3})",
            f.entry_angle, f.hip_opening, f.exit_fraction, f.asymmetry, f.roughness
        )
    }
}

/// Configurations one after the other, of a model.
pub(super) fn configurations(
    model: &somersault::multibody::Model,
    q: &Bound<'_, PyAny>,
) -> Result<Vec<f64>, Error> {
    let q = matrix("q", q)?;
    let n = model.n_positions();
    if n == 0 {
        return Err(Error::input("`model` must have joints that move, found none"));
    }
    if q.ncols() != n {
        return Err(Error::input(format!("`q` must have {n} columns, found {}", q.ncols())));
    }
    Ok(q.transpose().as_slice().to_vec())
}

/// A SYNTHETIC judge, who gives 10 − Σ p max(0, f − r) + σ ε to a dive with faults f. No judge was asked.
///
/// Parameters
/// ----------
/// reference : DiveFaults
///     r, faults that are taken for none.
/// entry_angle, hip_opening, asymmetry : float, optional
///     p, points/rad.
/// exit_fraction : float, optional
///     Points for the whole duration.
/// roughness : float, optional
///     Points for a factor of e in the squared jerk.
/// noise : float, optional
///     σ, points.
/// half_points : bool, optional
///     Whether he gives half points only.
///
/// Raises
/// ------
/// InputError
///     If a deduction or the noise is negative, or a fault is not finite.
///
/// Examples
/// --------
/// >>> from somersault import motion
/// >>> best = motion.DiveFaults(entry_angle=0.0, hip_opening=0.3, exit_fraction=0.6, asymmetry=0.0, roughness=8.0)
/// >>> judge = motion.SyntheticJudge(best, entry_angle=5.0)
/// >>> late = motion.DiveFaults(entry_angle=0.2, hip_opening=0.3, exit_fraction=0.6, asymmetry=0.0, roughness=8.0)
/// >>> round(judge.intended(late), 6)
/// 9.0
#[pyclass(frozen, module = "somersault.motion")]
#[derive(Clone, Copy)]
pub(crate) struct SyntheticJudge {
    pub(super) judge: synthetic::SyntheticJudge,
}

value! {
    impl SyntheticJudge {
        /// DiveFaults: Faults that are taken for none.
        reference: DiveFaults = |own| DiveFaults { faults: own.judge.reference };
        /// dict of str to float: What a unit of each fault costs, points.
        deductions: std::collections::BTreeMap<&'static str, f64> = |own| own.prices().into();
        /// float: Standard deviation of the noise, points.
        noise: f64 = |own| own.judge.noise;
        /// bool: Whether he gives half points only.
        half_points: bool = |own| own.judge.half_points;
    }
}

#[pymethods]
impl SyntheticJudge {
    #[new]
    #[pyo3(signature = (
        reference, *, entry_angle=None, hip_opening=None, exit_fraction=None, asymmetry=None, roughness=None, noise=None,
        half_points=false
    ))]
    fn new(
        reference: &Bound<'_, DiveFaults>,
        entry_angle: Option<f64>,
        hip_opening: Option<f64>,
        exit_fraction: Option<f64>,
        asymmetry: Option<f64>,
        roughness: Option<f64>,
        noise: Option<f64>,
        half_points: bool,
    ) -> Result<Self, Error> {
        let usual = synthetic::SyntheticJudge::with_reference(reference.get().faults);
        let judge = synthetic::SyntheticJudge {
            entry_angle: entry_angle.unwrap_or(usual.entry_angle),
            hip_opening: hip_opening.unwrap_or(usual.hip_opening),
            exit_fraction: exit_fraction.unwrap_or(usual.exit_fraction),
            asymmetry: asymmetry.unwrap_or(usual.asymmetry),
            roughness: roughness.unwrap_or(usual.roughness),
            noise: noise.unwrap_or(usual.noise),
            half_points,
            ..usual
        };
        judge.validate()?;
        Ok(Self { judge })
    }

    /// The score without noise and rounding.
    ///
    /// Parameters
    /// ----------
    /// faults : DiveFaults
    ///
    /// Returns
    /// -------
    /// float
    ///
    /// Examples
    /// --------
    /// >>> from somersault import motion
    /// >>> best = motion.DiveFaults(entry_angle=0.0, hip_opening=0.3, exit_fraction=0.6, asymmetry=0.0, roughness=8.0)
    /// >>> motion.SyntheticJudge(best, noise=0.5).intended(best)
    /// 10.0
    fn intended(&self, faults: &Bound<'_, DiveFaults>) -> Result<f64, Error> {
        Ok(self.judge.intended(&faults.get().faults)?)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let own = slf.get();
        let [a, b, c, d, e] = own.prices().map(|(_, points)| points);
        let numbers = [a, b, c, d, e, own.judge.noise];
        by_restore(slf, (own.reference(), numbers, own.judge.half_points))
    }

    /// A pickled judge.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        reference: &Bound<'_, DiveFaults>,
        numbers: [f64; 6],
        half_points: bool,
    ) -> Result<Self, Error> {
        let [a, b, c, d, e, f] = numbers.map(Some);
        Self::new(reference, a, b, c, d, e, f, half_points)
    }

    fn __repr__(&self) -> String {
        format!("<SyntheticJudge: SYNTHETIC, noise {} points>", self.judge.noise)
    }
}

impl SyntheticJudge {
    /// What a unit of each fault costs, in the order of the arguments.
    fn prices(&self) -> [(&'static str, f64); 5] {
        let judge = &self.judge;
        [
            ("entry_angle", judge.entry_angle),
            ("hip_opening", judge.hip_opening),
            ("exit_fraction", judge.exit_fraction),
            ("asymmetry", judge.asymmetry),
            ("roughness", judge.roughness),
        ]
    }
}
