//! Units and axes by their names.

use crate::core::error::Error;
use somersault::motion::recording::{Axis, Convention, LengthUnit};

pub(super) fn axis(argument: &str, name: &str) -> Result<Axis, Error> {
    Ok(match name {
        "x" | "+x" => Axis::PlusX,
        "-x" => Axis::MinusX,
        "y" | "+y" => Axis::PlusY,
        "-y" => Axis::MinusY,
        "z" | "+z" => Axis::PlusZ,
        "-z" => Axis::MinusZ,
        _ => {
            let message =
                format!("`{argument}` must be 'x', 'y' or 'z', or one of them with a sign, found '{name}'");
            return Err(Error::input(message));
        }
    })
}

pub(super) fn length_unit(name: &str) -> Result<LengthUnit, Error> {
    LengthUnit::from_name(name)
        .ok_or_else(|| Error::input(format!("`unit` must be one of {}, found '{name}'", LengthUnit::NAMES)))
}

/// What the numbers of a file mean.
pub(super) fn convention(unit: &str, up: &str, forward: &str) -> Result<Convention, Error> {
    Ok(Convention::try_new(length_unit(unit)?, axis("up", up)?, axis("forward", forward)?)?)
}
