//! What a dive is made of.

use super::Dive;
use crate::convert::real_numbers;
use crate::error::Error;
use crate::named_models::Diver;
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

/// A number, or a range.
#[derive(FromPyObject)]
enum NumberOrRange {
    Number(f64),
    Ends(f64, f64),
}

impl From<NumberOrRange> for Range {
    fn from(value: NumberOrRange) -> Self {
        match value {
            NumberOrRange::Number(value) => Self::fixed(value),
            NumberOrRange::Ends(lower, upper) => Self::new(lower, upper),
        }
    }
}

/// A posture by its name, or its number.
#[derive(FromPyObject)]
enum NameOrNumber {
    Number(usize),
    Name(String),
}

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
        for (k, posture) in postures.try_iter()?.enumerate() {
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

    fn posture(&self, argument: &'static str, posture: NameOrNumber) -> Result<usize, Error> {
        match posture {
            NameOrNumber::Number(number) => Ok(number),
            NameOrNumber::Name(name) => self.names.iter().position(|known| *known == name).ok_or_else(|| {
                let known = self.names.join(", ");
                Error::input(format!("`{argument}` must be one of the postures {known}, found '{name}'"))
            }),
        }
    }

    pub(super) fn key_frames(&self, template: &Bound<'_, PyAny>) -> Result<Vec<KeyFrame>, Error> {
        let frames: Vec<(f64, NameOrNumber)> = template.extract()?;
        let frame = |(share, posture)| Ok(KeyFrame { share, posture: self.posture("template", posture)? });
        frames.into_iter().map(frame).collect()
    }

    pub(super) fn change(&mut self, changes: Option<&Bound<'_, PyDict>>) -> Result<(), Error> {
        let Some(changes) = changes else { return Ok(()) };
        // what the others are understood by comes first
        if let Some(diver) = changes.get_item("diver")? {
            self.dive.diver = diver.cast::<Diver>().map_err(PyErr::from)?.get().diver;
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
        let range = || Ok::<Range, PyErr>(value.extract::<NumberOrRange>()?.into());
        match name {
            "diver" | "postures" => {}
            "first" => self.dive.first = self.posture("first", value.extract()?)?,
            "last" => self.dive.last = self.posture("last", value.extract()?)?,
            "channels" => self.dive.channels = channels_of(&value.extract::<String>()?)?,
            "windows" => {
                let windows: Vec<NumberOrRange> = value.extract()?;
                self.dive.windows = windows.into_iter().map(Range::from).collect();
            }
            "square_out" => self.dive.square_out = value.extract()?,
            "n_par" => self.dive.n_par = value.extract()?,
            "somersaults" => self.dive.somersaults = value.extract()?,
            "twists" => self.dive.twists = value.extract()?,
            "lean" => self.dive.lean = range()?,
            "entry_lean" => self.dive.entry_lean = value.extract()?,
            "duration" => self.dive.duration = range()?,
            "momentum" => self.dive.momentum = range()?,
            "platform" => self.dive.platform = value.extract()?,
            "entry_distance" => self.dive.entry_distance = value.extract()?,
            "momentum_penalty" => self.dive.penalties.momentum = value.extract()?,
            "rate_penalty" => self.dive.penalties.rate = value.extract()?,
            "acceleration_penalty" => self.dive.penalties.acceleration = value.extract()?,
            "clearance" => {
                let distance: Option<f64> = value.extract()?;
                let n_times = self.clearance_times;
                self.dive.clearance = distance.map(|distance| Clearance { distance, n_times });
            }
            "clearance_times" => {
                self.clearance_times = value.extract()?;
                if let Some(clearance) = &mut self.dive.clearance {
                    clearance.n_times = self.clearance_times;
                }
            }
            "n_steps" => self.dive.n_steps = value.extract()?,
            "n_pieces" => self.dive.n_pieces = value.extract()?,
            "template" => self.template = Some(self.key_frames(value)?),
            other => {
                let message = format!("a dive has no argument '{other}'");
                return Err(PyTypeError::new_err(message).into());
            }
        }
        Ok(())
    }

    pub(super) fn build(self) -> Result<Dive, Error> {
        Ok(Dive { program: self.dive.program()?, plan: self })
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
/// Postures A and H, ten coefficients, 1.7 s from the platform of 10 m. What the thesis leaves open is 10° of lean at
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
/// somersault with the arms sideways, throw, twists wrapped, square-out, pike, entry.
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
