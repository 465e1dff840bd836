//! Units and axes by their names.

use crate::core::error::Error;
use somersault::motion::recording::{Axis, Convention, LengthUnit};

fn axis(argument: &str, name: &str) -> Result<Axis, Error> {
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

/// What the numbers of a file mean.
pub(super) fn convention(unit: &str, up: &str, forward: &str) -> Result<Convention, Error> {
    let known = LengthUnit::from_name(unit);
    let unit = known.ok_or_else(|| {
        Error::input(format!("`unit` must be one of {}, found '{unit}'", LengthUnit::NAMES))
    })?;
    Ok(Convention::try_new(unit, axis("up", up)?, axis("forward", forward)?)?)
}
