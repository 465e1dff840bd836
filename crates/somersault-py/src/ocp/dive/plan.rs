//! What a dive is made of.

use super::Dive;
use crate::convert::{a_type, did_you_mean, real_numbers};
use crate::error::Error;
use crate::named_models::Diver;
use crate::ocp::arguments::{count, index, integer, number, number_or_range};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use somersault::multibody::models::Dimension;
use somersault::ocp::dive::{self, Channels, Clearance, KeyFrame, Range};

/// A dive in the making.
#[derive(Clone)]
pub(super) struct Plan {
    pub(super) dive: dive::Dive,
    pub(super) names: Vec<String>,
    pub(super) clearance_times: usize,
    pub(super) template: Option<Vec<KeyFrame>>,
}

/// Names that the library has for arguments of a dive.
pub(super) const NAMES: [(&str, &str); 8] = [
    ("penalties.momentum", "momentum_penalty"),
    ("penalties.rate", "rate_penalty"),
    ("penalties.acceleration", "acceleration_penalty"),
    ("clearance.distance", "clearance"),
    ("clearance.n_times", "clearance_times"),
    ("n_times", "clearance_times"),
    ("key_frames", "template"),
    ("n_coefficients", "n_par"),
];

impl Plan {
    /// Joint angles and names of postures.
    pub(super) fn set_postures(&mut self, postures: &Bound<'_, PyAny>) -> Result<(), Error> {
        let diver = self.dive.diver;
        let n_root = match diver.dimension {
            Dimension::Planar => 3,
            Dimension::Spatial => 7,
        };
        self.names.clear();
        self.dive.postures.clear();
        let refused = |_| {
            let found = a_type(postures);
            Error::input(format!("`postures` must be letters or joint angles, found {found}"))
        };
        for (k, posture) in postures.try_iter().map_err(refused)?.enumerate() {
            let posture = posture?;
            let (name, angles) = match posture.extract::<String>() {
                Ok(letter) => {
                    let q = diver.configuration(letter.parse()?)?;
                    (letter, q[n_root..].to_vec())
                }
                Err(_) => (k.to_string(), real_numbers(&format!("postures[{k}]"), &posture)?),
            };
            self.names.push(name);
            self.dive.postures.push(angles);
        }
        Ok(())
    }

    /// A posture by its name, or its number.
    fn posture(&self, argument: &str, posture: &Bound<'_, PyAny>) -> Result<usize, Error> {
        let Ok(name) = posture.extract::<String>() else {
            let refused = |_| {
                let found = a_type(posture);
                Error::input(format!("`{argument}` must name a posture or be its number, found {found}"))
            };
            return index(argument, integer(posture).map_err(refused)?);
        };
        self.names.iter().position(|known| *known == name).ok_or_else(|| {
            let known = self.names.join(", ");
            let meant = did_you_mean(&name, self.names.iter().map(String::as_str));
            Error::input(format!("`{argument}` must be one of the postures {known}, found '{name}'{meant}"))
        })
    }

    pub(super) fn key_frames(&self, template: &Bound<'_, PyAny>) -> Result<Vec<KeyFrame>, Error> {
        let refused =
            |_| Error::input("`template` must be tuples (share, posture), of which something is no tuple");
        let frames: Vec<(f64, Bound<'_, PyAny>)> = template.extract().map_err(refused)?;
        let frame = |(share, posture): (f64, Bound<'_, PyAny>)| {
            Ok(KeyFrame { share, posture: self.posture("template", &posture)? })
        };
        frames.into_iter().map(frame).collect()
    }

    pub(super) fn change(&mut self, changes: Option<&Bound<'_, PyDict>>) -> Result<(), Error> {
        let Some(changes) = changes else { return Ok(()) };
        // what the others are understood by comes first
        if let Some(diver) = changes.get_item("diver")? {
            let refused = |_| Error::input(format!("`diver` must be a Diver, found {}", a_type(&diver)));
            self.dive.diver = diver.cast::<Diver>().map_err(refused)?.get().diver;
        }
        if let Some(postures) = changes.get_item("postures")? {
            self.set_postures(&postures)?;
        }
        for (name, value) in changes.iter() {
            let name: String = name.extract()?;
            self.set(&name, &value)?;
        }
        Ok(())
    }

    fn set(&mut self, name: &str, value: &Bound<'_, PyAny>) -> Result<(), Error> {
        let range = || number_or_range(name, value).map(|(lower, upper)| Range::new(lower, upper));
        let float = || number(name, value);
        let refused = |_| Error::input(format!("`{name}` has the wrong type: found {}", a_type(value)));
        let whole = || count(name, integer(value).map_err(refused)?, 1);
        match name {
            "diver" | "postures" => {}
            "first" => self.dive.first = self.posture("first", value)?,
            "last" => self.dive.last = self.posture("last", value)?,
            "channels" => self.dive.channels = channels_of(&value.extract::<String>().map_err(refused)?)?,
            "windows" => {
                let windows: Vec<Bound<'_, PyAny>> = value.extract().map_err(refused)?;
                let window = |window| number_or_range(name, &window);
                let windows = windows.into_iter().map(window).collect::<Result<Vec<_>, Error>>()?;
                self.dive.windows = windows.into_iter().map(|(a, b)| Range::new(a, b)).collect();
            }
            "square_out" => self.dive.square_out = float()?,
            "n_par" => self.dive.n_par = whole()?,
            "somersaults" => self.dive.somersaults = float()?,
            "twists" => self.dive.twists = float()?,
            "lean" => self.dive.lean = range()?,
            "entry_lean" => self.dive.entry_lean = float()?,
            "duration" => self.dive.duration = range()?,
            "momentum" => self.dive.momentum = range()?,
            "platform" => self.dive.platform = float()?,
            "entry_distance" => self.dive.entry_distance = float()?,
            "momentum_penalty" => self.dive.penalties.momentum = float()?,
            "rate_penalty" => self.dive.penalties.rate = float()?,
            "acceleration_penalty" => self.dive.penalties.acceleration = float()?,
            "clearance" => {
                let distance = if value.is_none() { None } else { Some(float()?) };
                let n_times = self.clearance_times;
                self.dive.clearance = distance.map(|distance| Clearance { distance, n_times });
            }
            "clearance_times" => {
                self.clearance_times = whole()?;
                if let Some(clearance) = &mut self.dive.clearance {
                    clearance.n_times = self.clearance_times;
                }
            }
            "n_steps" => self.dive.n_steps = whole()?,
            "n_pieces" => self.dive.n_pieces = whole()?,
            "template" => self.template = Some(self.key_frames(value)?),
            other => {
                let message = format!("a dive has no argument '{other}'");
                return Err(PyTypeError::new_err(message).into());
            }
        }
        Ok(())
    }

    pub(super) fn build(self) -> Result<Dive, Error> {
        let program = self.dive.program().map_err(|error| Error::from(error).with_names(&NAMES))?;
        Ok(Dive { program, plan: self })
    }
}

fn channels_of(name: &str) -> Result<Channels, Error> {
    match name {
        "weights" => Ok(Channels::Weights),
        "joints" => Ok(Channels::Joints),
        other => Err(Error::input(format!("`channels` must be 'weights' or 'joints', found '{other}'"))),
    }
}

fn letters(names: &str) -> Vec<String> {
    names.chars().map(String::from).collect()
}

/// The forward three and a half somersaults in pike position, 107B, in the plane (thesis 3.1).
///
/// Postures A and H, ten coefficients of which six are free, 1.7 s from the platform of 10 m; ``n_par=19`` has the
/// thesis' count of 16 free parameters, 15 coefficients and the momentum. What the thesis leaves open is 10° of lean at
/// take-off, an entry 2 m ahead, a = 1 and b = 10⁻³ s.
///
/// Parameters
/// ----------
/// **changes
///     Arguments of `Dive` that are to be different.
///
/// Returns
/// -------
/// Dive
///
/// Examples
/// --------
/// >>> from somersault import ocp
/// >>> dive = ocp.dive_107b().solve()
/// >>> round(float(dive.somersaults[-1]), 6)
/// 3.5
#[pyfunction]
#[pyo3(signature = (**changes))]
pub(crate) fn dive_107b(changes: Option<&Bound<'_, PyDict>>) -> Result<Dive, Error> {
    let dive = dive::Dive::forward_pike()?;
    let template = Some(dive::Dive::pike_template());
    let mut plan = Plan { dive, names: letters("AH"), clearance_times: CLEARANCE_TIMES, template };
    plan.change(changes)?;
    plan.build()
}

/// The forward three and a half somersaults with two twists, free, 5174D, in space (thesis 3.2).
///
/// Postures C, A, D, E, I and H, 2 s from the platform of 10 m into the water 2 m ahead. The search starts from a template:
/// somersault with the arms sideways, throw, twists with the arms overhead, square-out, pike, entry.
///
/// Parameters
/// ----------
/// **changes
///     Arguments of `Dive` that are to be different.
///
/// Returns
/// -------
/// Dive
#[pyfunction]
#[pyo3(signature = (**changes))]
pub(crate) fn dive_5174d(changes: Option<&Bound<'_, PyDict>>) -> Result<Dive, Error> {
    let dive = dive::Dive::forward_twisting();
    let clearance_times = dive.clearance.map_or(CLEARANCE_TIMES, |clearance| clearance.n_times);
    let template = Some(dive::Dive::twisting_template());
    let mut plan = Plan { dive, names: letters("CADEIH"), clearance_times, template };
    plan.change(changes)?;
    plan.build()
}

pub(super) const CLEARANCE_TIMES: usize = 35;
