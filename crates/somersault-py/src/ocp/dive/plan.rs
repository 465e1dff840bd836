//! What a dive is made of.

use super::Dive;
use crate::core::convert::{a_type, integer, real_numbers};
use crate::core::error::{Error, did_you_mean};
use crate::multibody::models::Diver;
use crate::ocp::arguments::{count, index, number, number_or_range};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use somersault::dives::{self, Channels, Clearance, KeyFrame, Range};
use somersault::multibody::models::{Dimension, Posture};

/// A dive in the making.
#[derive(Clone)]
pub(super) struct Plan {
    pub(super) dive: dives::Dive,
    pub(super) names: Vec<String>,
    pub(super) clearance_times: usize,
    /// Given by the user.
    pub(super) template: Option<Vec<KeyFrame>>,
    /// What it is where none is given.
    pub(super) course: Course,
    /// Whether the postures are the user's, and not those of a named dive.
    pub(super) own_postures: bool,
}

/// The named dive that a plan began with.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Course {
    /// None: without a template.
    Open,
    Pike,
    /// Postures and template follow the twists.
    Twisting,
}

impl Course {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Pike => "pike",
            Self::Twisting => "twisting",
        }
    }

    pub(super) fn of(name: &str) -> Result<Self, Error> {
        let known = [Self::Open, Self::Pike, Self::Twisting];
        let found = known.into_iter().find(|course| course.name() == name);
        found.ok_or_else(|| {
            Error::input(format!("`course` must be 'open', 'pike' or 'twisting', found '{name}'"))
        })
    }
}

/// What the mirror image of a letter that has none of its own is called.
const MIRRORED: &str = "mirrored ";

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
    /// Of a dive whose postures have no names yet.
    pub(super) fn new(dive: dives::Dive) -> Self {
        Self {
            dive,
            names: Vec::new(),
            clearance_times: CLEARANCE_TIMES,
            template: None,
            course: Course::Open,
            own_postures: false,
        }
    }

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
                Ok(name) => {
                    let (letter, is_mirrored) = match name.strip_prefix(MIRRORED) {
                        Some(letter) => (letter, true),
                        None => (name.as_str(), false),
                    };
                    let angles = diver.configuration(letter.parse()?)?[n_root..].to_vec();
                    let angles = if is_mirrored { dives::mirror_image(&diver, &angles)? } else { angles };
                    (name, angles)
                }
                Err(_) => (k.to_string(), real_numbers(&format!("postures[{k}]"), &posture)?),
            };
            self.names.push(name);
            self.dive.postures.push(angles);
        }
        Ok(())
    }

    /// The template, or that of the named dive.
    pub(super) fn key_frames_or_own(&self) -> Option<Vec<KeyFrame>> {
        self.template.clone().or_else(|| match self.course {
            Course::Open => None,
            Course::Pike => Some(dives::Dive::pike_template()),
            Course::Twisting => Some(dives::Dive::twisting_template(self.dive.twists)),
        })
    }

    /// The mirror image.
    pub(super) fn mirrored(&self) -> Result<Self, Error> {
        let dive = self.dive.mirrored()?;
        let postures = self.names.iter().zip(self.dive.postures.iter().zip(&dive.postures));
        let names = postures.map(
            |(name, (own, image))| {
                if own == image { name.clone() } else { name_of(name, image) }
            },
        );
        Ok(Self { names: names.collect(), dive, ..self.clone() })
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
            |_| Error::input("`template` must be tuples (fraction, posture), of which something is no tuple");
        let frames: Vec<(f64, Bound<'_, PyAny>)> = template.extract().map_err(refused)?;
        let frame = |(fraction, posture): (f64, Bound<'_, PyAny>)| {
            Ok(KeyFrame { fraction, posture: self.posture("template", &posture)? })
        };
        frames.into_iter().map(frame).collect()
    }

    pub(super) fn change(&mut self, changes: Option<&Bound<'_, PyDict>>) -> Result<(), Error> {
        let Some(changes) = changes else { return Ok(()) };
        // what the others are understood by comes first
        if let Some(diver) = changes.get_item("diver")? {
            let refused = |_| Error::input(format!("`diver` must be a Diver, found {}", a_type(&diver)));
            self.dive.diver = diver.cast::<Diver>().map_err(refused)?.get().hinged("diver")?;
        }
        if let Some(postures) = changes.get_item("postures")? {
            self.set_postures(&postures)?;
            self.own_postures = true;
        }
        for (name, value) in changes.iter() {
            let name: String = name.extract()?;
            self.set(&name, &value)?;
        }
        if self.course == Course::Twisting && !self.own_postures {
            let dives::Dive { somersaults, twists, .. } = self.dive;
            self.dive.postures = dives::Dive::twisting(somersaults, twists)?.postures;
            let named = TWISTING.iter().zip(&self.dive.postures);
            self.names = named.map(|(letter, angles)| name_of(letter, angles)).collect();
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
                let message = format!("a dive has no argument '{other}'; `Dive.options` has them all");
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

/// Postures of the twisting dive.
const TWISTING: [&str; 6] = ["C", "A", "D", "E", "I", "H"];

/// The letter with these angles in space.
fn letter_of(angles: &[f64]) -> Option<String> {
    Posture::ALL.into_iter().find(|posture| posture.spatial()[..] == *angles).map(|p| p.to_string())
}

/// What a letter's posture or its mirror image is called; angles without a letter keep their number.
fn name_of(name: &str, angles: &[f64]) -> String {
    letter_of(angles).unwrap_or_else(|| match name.parse::<Posture>() {
        Ok(_) => format!("{MIRRORED}{name}"),
        Err(_) => name.to_owned(),
    })
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
    let dive = dives::Dive::forward_pike()?;
    let names = ["A", "H"].map(str::to_owned).to_vec();
    let mut plan = Plan { names, course: Course::Pike, ..Plan::new(dive) };
    plan.change(changes)?;
    plan.build()
}

/// The forward three and a half somersaults with two twists, free, 5174D, in space (thesis 3.2).
///
/// Postures C, A, D, E, I and H, 2 s from the platform of 10 m into the water 2 m ahead. The search starts from a template:
/// somersault with the arms sideways, throw, twists with the arms overhead, square-out, pike, entry.
///
/// Postures and template follow the counts unless they are given: after an odd number of half twists the arms undo the tilt as
/// the mirror image of the throw in reverse, without twists they do not throw, and where twists and somersaults have opposite
/// signs all postures are mirror images. So ``twists=-2`` is the mirror image of ``twists=2``.
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
/// >>> ocp.dive_5174d(twists=-2).postures
/// ('C', 'A', 'E', 'D', 'mirrored I', 'H')
#[pyfunction]
#[pyo3(signature = (**changes))]
pub(crate) fn dive_5174d(changes: Option<&Bound<'_, PyDict>>) -> Result<Dive, Error> {
    let dive = dives::Dive::forward_twisting();
    let clearance_times = dive.clearance.map_or(CLEARANCE_TIMES, |clearance| clearance.n_times);
    let names = TWISTING.map(str::to_owned).to_vec();
    let mut plan = Plan { names, clearance_times, course: Course::Twisting, ..Plan::new(dive) };
    plan.change(changes)?;
    plan.build()
}

pub(super) const CLEARANCE_TIMES: usize = 35;
