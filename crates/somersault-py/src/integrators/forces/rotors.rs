//! Reaction wheels and control moment gyros.

use crate::core::convert::{any_vectors, array, check_finite, finite, numbers_or_one, times};
use crate::core::error::Error;
use crate::core::value::{Pickled, by_restore, counted, value};
use crate::integrators::bodies::RigidBody;
use crate::integrators::forces::models::{ForceModel, build_for};
use crate::integrators::forces::scheduled::{rows, schedules};
use pyo3::prelude::*;
use pyo3::types::PyType;
use somersault::integrators::nalgebra::Vector3;
use somersault::integrators::rotors::{
    self, ControlMomentGyro, LinearSchedule, ReactionWheel, RotorMomentum, Rotors,
};

/// Finite vectors, as many as there are.
fn axes(argument: &str, value: &Bound<'_, PyAny>) -> Result<Vec<Vector3<f64>>, Error> {
    let axes = any_vectors(argument, &[value.len().unwrap_or(0)], value)?;
    check_finite(argument, axes.iter().flatten())?;
    Ok(axes)
}

/// One number for each rotor, zero unless given.
fn one_each(argument: &str, count: usize, value: Option<&Bound<'_, PyAny>>) -> Result<Vec<f64>, Error> {
    value.map_or(Ok(vec![0.0; count]), |value| numbers_or_one(argument, count, value))
}

/// A schedule for each rotor: constant, or with a row of values for each of the times.
fn schedules_or_constants(
    argument: &str,
    count: usize,
    values: Option<&Bound<'_, PyAny>>,
    times: Option<&Bound<'_, PyAny>>,
) -> Result<Vec<LinearSchedule>, Error> {
    let Some(times) = times else {
        let values = one_each(argument, count, values)?;
        check_finite(argument, &values)?;
        return Ok(values.into_iter().map(LinearSchedule::constant).collect());
    };
    let Some(values) = values else {
        return Err(Error::input(format!("`times` are those of `{argument}`, which are not given")));
    };
    schedules(argument, count, values, times)
}

/// Numbers of several columns at one time, shape (n,), or at several, shape (times, n).
fn columns_at<'py>(
    t: &Bound<'py, PyAny>,
    count: usize,
    values: impl Fn(f64) -> Vec<f64>,
) -> Result<Bound<'py, PyAny>, Error> {
    let (scalar, times) = times("t", t)?;
    for t in &times {
        finite("t", *t)?;
    }
    let numbers: Vec<_> = times.iter().flat_map(|t| values(*t)).collect();
    let shape: &[usize] = if scalar { &[count] } else { &[times.len(), count] };
    Ok(array(t.py(), numbers, shape)?.into_any())
}

/// Reaction wheels: the torque of rotors that exchange angular momentum with the body.
///
/// With axes a_i, moments J_i about them, speeds Ω_i relative to the body and torques u_i of their motors, h_i = J_i (Ω_i + a_i·ω) obeys
/// h_i′ = u_i, and (I − Σ J_i a_i a_iᵀ) ω′ = L × ω − Σ a_i u_i + M with L = I ω + Σ J_i Ω_i a_i, body frame. `carrier` is the body of the
/// inertia on the left, which is the one to integrate: on a body of another inertia the wheels refuse to act. R L is constant where there is
/// no other torque, whatever the motors do.
///
/// Parameters
/// ----------
/// axes : array_like, shape (n, 3)
///     a_i, body frame, of any length.
/// inertias : float or array_like, shape (n,)
///     J_i, kg m².
/// momenta : float or array_like, shape (n,), optional
///     h_i at t = 0, N m s.
/// torques : float or array_like, shape (n,) or (k, n), optional
///     u_i, N m: constant, or a row for each of `times`, linear between them and constant outside.
/// times : array_like, shape (k,), optional
///     Times of the rows of `torques`, increasing, s.
/// body : RigidBody, optional
///     The body with its wheels, of the inertia I. It may be left out where `inertias` are zero; then they act on any body.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed, or the moments of the wheels are too large for the body.
///
/// Notes
/// -----
/// Adapted steps end at `times`, and so do all steps where contacts are located; with other fixed steps a method keeps its order where
/// `times` are points of the grid. Source: P. C. Hughes, Spacecraft Attitude Dynamics, Wiley 1986, §3.5.
///
/// Examples
/// --------
/// A wheel brought to speed turns a satellite:
///
/// >>> import somersault
/// >>> satellite = somersault.RigidBody(12.0, (0.3, 0.2, 0.4))
/// >>> wheels = somersault.forces.ReactionWheels(
/// ...     [(0, 0, 1)], 1e-3, torques=[[0], [2e-3], [0]], times=[0, 5, 10], body=satellite)
/// >>> motion = somersault.integrate(wheels.carrier, somersault.State(), (0.0, 10.0), dt=0.5, forces=wheels)
/// >>> motion.angular_velocity_body[-1].round(6) + 0.0
/// array([ 0.      ,  0.      , -0.025063])
/// >>> wheels.momentum(10.0)
/// array([0.  , 0.  , 0.01])
#[pyclass(frozen, extends = ForceModel, module = "somersault.forces")]
pub(crate) struct ReactionWheels {
    wheels: rotors::ReactionWheels,
    body: Option<RigidBody>,
    carrier: Option<RigidBody>,
}

value! {
    impl ReactionWheels {
        /// RigidBody or None: The body with its wheels.
        body: Option<RigidBody> = |own| own.body;
        /// RigidBody or None: The body that the wheels act on, with the inertia I − Σ J a aᵀ; None where no body was given.
        carrier: Option<RigidBody> = |own| own.carrier;
    }
}

#[pymethods]
impl ReactionWheels {
    #[new]
    #[pyo3(signature = (axes, inertias, momenta=None, torques=None, times=None, *, body=None))]
    fn new(
        axes: &Bound<'_, PyAny>,
        inertias: &Bound<'_, PyAny>,
        momenta: Option<&Bound<'_, PyAny>>,
        torques: Option<&Bound<'_, PyAny>>,
        times: Option<&Bound<'_, PyAny>>,
        body: Option<RigidBody>,
    ) -> Result<PyClassInitializer<Self>, Error> {
        let axes = self::axes("axes", axes)?;
        let inertias = numbers_or_one("inertias", axes.len(), inertias)?;
        let momenta = one_each("momenta", axes.len(), momenta)?;
        let torques = schedules_or_constants("torques", axes.len(), torques, times)?;
        let names = [("axis", "axes"), ("inertia", "inertias"), ("momentum", "momenta")];
        let wheels = (axes.into_iter().zip(inertias)).zip(momenta.into_iter().zip(torques));
        let wheels = wheels.map(|((axis, inertia), (momentum, torque))| {
            ReactionWheel::try_new(axis, inertia, momentum, torque)
                .map_err(|error| Error::from(error).with_names(&names))
        });
        let wheels = rotors::ReactionWheels(wheels.collect::<Result<_, _>>()?);
        if body.is_none() && wheels.0.iter().any(|wheel| wheel.inertia() > 0.0) {
            return Err(Error::input(
                "`body` must be given where `inertias` are not zero: wheels act on its `carrier`, which is the body without them",
            ));
        }
        let carrier = body.map(|body| wheels.carrier(&body.0)).transpose();
        let carrier = carrier.map_err(|error| Error::from(error).within("body"))?;
        let wrap = |Rotors(wheels)| Self { wheels, body, carrier: carrier.map(RigidBody) };
        Ok(build_for(carrier, Rotors(wheels), wrap))
    }

    /// Sum of the angular momenta of the wheels about their axes, H = Σ a_i h_i.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (m,)
    ///     Time, s.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (3,) or (m, 3)
    ///     H, body frame, N m s.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> satellite = somersault.RigidBody(12.0, (0.3, 0.2, 0.4))
    /// >>> somersault.forces.ReactionWheels([(1, 0, 0)], 0.05, 0.2, torques=0.1, body=satellite).momentum(3.0)
    /// array([0.5, 0. , 0. ])
    fn momentum<'py>(&self, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        columns_at(t, 3, |t| self.wheels.momentum(t).0.as_slice().to_vec())
    }

    /// Angular momentum of each wheel about its axis, h_i; its speed is Ω_i = h_i/J_i − a_i·ω.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (m,)
    ///     Time, s.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n,) or (m, n)
    ///     h_i, N m s.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> satellite = somersault.RigidBody(12.0, (0.3, 0.2, 0.4))
    /// >>> wheels = somersault.forces.ReactionWheels([(1, 0, 0)], 0.05, 0.2, torques=0.1, body=satellite)
    /// >>> wheels.wheel_momenta([0.0, 3.0])
    /// array([[0.2],
    ///        [0.5]])
    fn wheel_momenta<'py>(&self, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let wheels = &self.wheels.0;
        columns_at(t, wheels.len(), |t| wheels.iter().map(|wheel| wheel.momentum(t)).collect())
    }

    fn __repr__(&self) -> String {
        format!("<ReactionWheels: {}>", counted(self.wheels.0.len(), "wheel", "wheels"))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let wheels = &slf.get().wheels.0;
        let axes: Vec<[f64; 3]> = wheels.iter().map(|wheel| (*wheel.axis()).into()).collect();
        let inertias: Vec<_> = wheels.iter().map(ReactionWheel::inertia).collect();
        let momenta: Vec<_> = wheels.iter().map(|wheel| wheel.momentum(0.0)).collect();
        let (times, torques) = rows(wheels.iter().map(ReactionWheel::torque));
        by_restore(slf, (axes, inertias, momenta, torques, times, slf.get().body))
    }

    /// Pickled wheels.
    #[classmethod]
    fn _restore(
        cls: &Bound<'_, PyType>,
        axes: &Bound<'_, PyAny>,
        inertias: &Bound<'_, PyAny>,
        momenta: &Bound<'_, PyAny>,
        torques: &Bound<'_, PyAny>,
        times: &Bound<'_, PyAny>,
        body: Option<RigidBody>,
    ) -> Result<Py<Self>, Error> {
        Ok(Py::new(cls.py(), Self::new(axes, inertias, Some(momenta), Some(torques), Some(times), body)?)?)
    }
}

/// Control moment gyros on single gimbals: rotors of constant angular momentum that are turned in the body.
///
/// With axes g_i of the gimbals, axes s_i of the rotors at the angle 0, angular momenta h_i of the rotors and angles γ_i,
/// H = Σ h_i (s_i cos γ_i + (g_i × s_i) sin γ_i) and I ω′ = (I ω + H) × ω − H′ + M, body frame; the inertia of the gimbals is neglected.
/// R (I ω + H) is constant where there is no other torque.
///
/// Parameters
/// ----------
/// gimbals : array_like, shape (n, 3)
///     g_i, body frame, of any length.
/// spins : array_like, shape (n, 3)
///     s_i, perpendicular to g_i within 1e-9, body frame, of any length.
/// momenta : float or array_like, shape (n,)
///     h_i, N m s.
/// angles : float or array_like, shape (n,), optional
///     γ_i at t = 0, rad.
/// rates : float or array_like, shape (n,) or (k, n), optional
///     γ_i′, rad/s: constant, or a row for each of `times`, linear between them and constant outside.
/// times : array_like, shape (k,), optional
///     Times of the rows of `rates`, increasing, s.
/// body : RigidBody, optional
///     The body with its gyros. Where it is given they refuse to act on a body of another inertia.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> import somersault
/// >>> satellite = somersault.RigidBody(12.0, (0.3, 0.2, 0.4))
/// >>> gyro = somersault.forces.ControlMomentGyros([(0, 0, 1)], [(1, 0, 0)], 0.5, rates=0.1, body=satellite)
/// >>> gyro.momentum(5 * np.pi).round(6) + 0.0
/// array([0. , 0.5, 0. ])
/// >>> turning = somersault.integrate(satellite, somersault.State(), (0.0, 1.0), dt=0.1, forces=gyro)
#[pyclass(frozen, extends = ForceModel, module = "somersault.forces")]
pub(crate) struct ControlMomentGyros {
    gyros: rotors::ControlMomentGyros,
    carrier: Option<RigidBody>,
}

value! {
    impl ControlMomentGyros {
        /// RigidBody or None: The body that the gyros act on, which is the body with them; None where it was not given.
        carrier: Option<RigidBody> = |own| own.carrier;
    }
}

#[pymethods]
impl ControlMomentGyros {
    #[new]
    #[pyo3(signature = (gimbals, spins, momenta, angles=None, rates=None, times=None, *, body=None))]
    fn new(
        gimbals: &Bound<'_, PyAny>,
        spins: &Bound<'_, PyAny>,
        momenta: &Bound<'_, PyAny>,
        angles: Option<&Bound<'_, PyAny>>,
        rates: Option<&Bound<'_, PyAny>>,
        times: Option<&Bound<'_, PyAny>>,
        body: Option<RigidBody>,
    ) -> Result<PyClassInitializer<Self>, Error> {
        let gimbals = axes("gimbals", gimbals)?;
        let count = gimbals.len();
        let spins = any_vectors("spins", &[count], spins)?;
        check_finite("spins", spins.iter().flatten())?;
        let momenta = numbers_or_one("momenta", count, momenta)?;
        let angles = one_each("angles", count, angles)?;
        let rates = schedules_or_constants("rates", count, rates, times)?;
        let names = [("gimbal", "gimbals"), ("spin", "spins"), ("momentum", "momenta"), ("angle", "angles")];
        let gyros = gimbals.into_iter().zip(spins).zip(momenta.into_iter().zip(angles)).zip(rates);
        let gyros = gyros.map(|(((gimbal, spin), (momentum, angle)), rate)| {
            ControlMomentGyro::try_new(gimbal, spin, momentum, angle, rate)
                .map_err(|error| Error::from(error).with_names(&names))
        });
        let gyros = rotors::ControlMomentGyros(gyros.collect::<Result<_, _>>()?);
        let wrap = |Rotors(gyros)| Self { gyros, carrier: body };
        Ok(build_for(body.map(|body| body.0), Rotors(gyros), wrap))
    }

    /// Sum of the angular momenta of the rotors, H.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (m,)
    ///     Time, s.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (3,) or (m, 3)
    ///     H, body frame, N m s.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> somersault.forces.ControlMomentGyros([(0, 0, 1)], [(1, 0, 0)], 0.5).momentum(0.0)
    /// array([0.5, 0. , 0. ])
    fn momentum<'py>(&self, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        columns_at(t, 3, |t| self.gyros.momentum(t).0.as_slice().to_vec())
    }

    /// Angles of the gimbals, γ_i.
    ///
    /// Parameters
    /// ----------
    /// t : float or array_like, shape (m,)
    ///     Time, s.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n,) or (m, n)
    ///     γ_i, rad.
    ///
    /// Examples
    /// --------
    /// >>> import somersault
    /// >>> gyro = somersault.forces.ControlMomentGyros([(0, 0, 1)], [(1, 0, 0)], 0.5, 0.25, rates=0.1)
    /// >>> gyro.gimbal_angles(5.0)
    /// array([0.75])
    fn gimbal_angles<'py>(&self, t: &Bound<'py, PyAny>) -> Result<Bound<'py, PyAny>, Error> {
        let gyros = &self.gyros.0;
        columns_at(t, gyros.len(), |t| gyros.iter().map(|gyro| gyro.angle(t)).collect())
    }

    fn __repr__(&self) -> String {
        format!("<ControlMomentGyros: {}>", counted(self.gyros.0.len(), "gyro", "gyros"))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let gyros = &slf.get().gyros.0;
        let vectors = |axis: fn(&ControlMomentGyro) -> &Vector3<f64>| -> Vec<[f64; 3]> {
            gyros.iter().map(|gyro| (*axis(gyro)).into()).collect()
        };
        let momenta: Vec<_> = gyros.iter().map(ControlMomentGyro::momentum).collect();
        let angles: Vec<_> = gyros.iter().map(|gyro| gyro.angle(0.0)).collect();
        let (times, rates) = rows(gyros.iter().map(ControlMomentGyro::rate));
        let axes = (vectors(ControlMomentGyro::gimbal), vectors(ControlMomentGyro::spin));
        by_restore(slf, (axes.0, axes.1, momenta, angles, rates, times, slf.get().carrier))
    }

    /// Pickled gyros.
    #[classmethod]
    fn _restore(
        cls: &Bound<'_, PyType>,
        gimbals: &Bound<'_, PyAny>,
        spins: &Bound<'_, PyAny>,
        momenta: &Bound<'_, PyAny>,
        angles: &Bound<'_, PyAny>,
        rates: &Bound<'_, PyAny>,
        times: &Bound<'_, PyAny>,
        body: Option<RigidBody>,
    ) -> Result<Py<Self>, Error> {
        let gyros = Self::new(gimbals, spins, momenta, Some(angles), Some(rates), Some(times), body)?;
        Ok(Py::new(cls.py(), gyros)?)
    }
}
