//! Parts of a node by their names.

use crate::core::error::Error;
use somersault::ocp::term::Part;

const PARTS: [(&str, Part); 7] = [
    ("time", Part::Time),
    ("velocity", Part::Velocity),
    ("acceleration", Part::Acceleration),
    ("torque", Part::Torque),
    ("channel", Part::Channel),
    ("channel_rate", Part::ChannelRate),
    ("channel_second_rate", Part::ChannelSecondRate),
];

pub(super) fn part_of(name: &str) -> Result<Part, Error> {
    let found = PARTS.iter().find(|(known, _)| *known == name).map(|(_, part)| *part);
    found.ok_or_else(|| {
        let names: Vec<_> = PARTS.iter().map(|(name, _)| format!("'{name}'")).collect();
        Error::input(format!("`part` must be one of {}, found '{name}'", names.join(", ")))
    })
}

pub(super) fn name_of(part: Part) -> &'static str {
    PARTS.iter().find(|(_, known)| *known == part).map_or("", |(name, _)| *name)
}
