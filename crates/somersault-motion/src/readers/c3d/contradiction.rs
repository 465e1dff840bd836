//! What a file declares in two places.

use crate::readers::Place;

/// What decides between header and parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decision {
    /// The length of the file: with the other its frames do not end where the file does.
    Length,
    /// The length says nothing of it; the user guide has the parameters rule.
    Parameters,
}

/// Something that the header of a file and its parameters declare differently.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contradiction {
    /// Where the parameters declare it.
    pub place: Place,
    /// What is declared.
    pub quantity: &'static str,
    /// By the header.
    pub header: f64,
    /// By the parameters.
    pub parameter: f64,
    /// What the file was read with.
    pub used: f64,
    /// Why.
    pub decided: Decision,
}

impl std::fmt::Display for Contradiction {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { quantity, header, parameter, used, decided, .. } = self;
        let why = match decided {
            Decision::Length => "by the length of the file",
            Decision::Parameters => "since parameters take precedence",
        };
        write!(
            f,
            "{quantity}: the header declares {header}, the parameters {parameter}; {used} is used, {why}"
        )
    }
}
