//! Postures of divers and trampolinists (thesis Figure 2.2, after Frohlich).
//!
//! The text of the thesis fixes A and H, and the parts that C and E play in a twisting dive. Its figure is
//! not in the text: the roles of the other letters, and the angles of all of them, are definitions of
//! this project.

use std::fmt;
use std::str::FromStr;

/// A posture of the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Posture {
    /// Layout, arms overhead: fundamental in the plane, and for the entry.
    A,
    /// Layout, arms at the sides.
    B,
    /// Layout, arms sideways: fundamental in space, before the throw and at the square-out.
    C,
    /// Layout, right arm up, left arm down: the mirror image of the throw.
    D,
    /// Layout, left arm up, right arm down: the throw that starts a twist.
    E,
    /// Tuck.
    F,
    /// Open pike: arms sideways, or forward in the plane.
    G,
    /// Closed pike, arms round the legs.
    H,
    /// Wrapped for a twist: left arm over the head, right arm across the chest.
    I,
}

/// Why there is no configuration for a posture.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PostureError {
    /// Not a letter from A to I.
    #[error("no posture is named `{name}`; there are A to I")]
    UnknownName {
        /// The name.
        name: String,
    },
    /// The arms differ or leave the plane.
    #[error("posture {posture} is not planar; those are A, B, F, G and H")]
    NotPlanar {
        /// The posture.
        posture: Posture,
    },
}

/// Degrees: pelvis bend, hip, knee, ankle, toes, neck.
const LAYOUT: [f64; 6] = [0.0, 0.0, 0.0, 60.0, 20.0, 0.0];
const TUCK: [f64; 6] = [35.0, 125.0, 135.0, 45.0, 20.0, 30.0];
const OPEN_PIKE: [f64; 6] = [20.0, 95.0, 0.0, 60.0, 20.0, 15.0];
const CLOSED_PIKE: [f64; 6] = [40.0, 120.0, 0.0, 60.0, 20.0, 35.0];

/// Degrees: shoulder flexion, abduction and rotation, elbow, wrist.
const UP: [f64; 5] = [175.0, 0.0, 0.0, 0.0, 0.0];
const DOWN: [f64; 5] = [5.0, 0.0, 0.0, 0.0, 0.0];
const FORWARD: [f64; 5] = [90.0, 0.0, 0.0, 0.0, 0.0];
const SIDEWAYS: [f64; 5] = [0.0, 90.0, 0.0, 0.0, 0.0];
const ROUND_SHANKS: [f64; 5] = [35.0, 0.0, 0.0, 60.0, 0.0];
const ROUND_LEGS: [f64; 5] = [80.0, 0.0, 0.0, 60.0, 0.0];
const ACROSS_CHEST: [f64; 5] = [25.0, 10.0, 60.0, 130.0, 0.0];
const OVER_HEAD: [f64; 5] = [60.0, 150.0, 60.0, 130.0, 0.0];

impl Posture {
    /// All of them.
    pub const ALL: [Self; 9] =
        [Self::A, Self::B, Self::C, Self::D, Self::E, Self::F, Self::G, Self::H, Self::I];

    /// Those that the planar diver has.
    pub const PLANAR: [Self; 5] = [Self::A, Self::B, Self::F, Self::G, Self::H];

    fn trunk_and_legs(self) -> [f64; 6] {
        match self {
            Self::F => TUCK,
            Self::G => OPEN_PIKE,
            Self::H => CLOSED_PIKE,
            Self::A | Self::B | Self::C | Self::D | Self::E | Self::I => LAYOUT,
        }
    }

    /// Right, left.
    fn arms(self) -> [[f64; 5]; 2] {
        match self {
            Self::A => [UP, UP],
            Self::B => [DOWN, DOWN],
            Self::C | Self::G => [SIDEWAYS, SIDEWAYS],
            Self::D => [UP, DOWN],
            Self::E => [DOWN, UP],
            Self::F => [ROUND_SHANKS, ROUND_SHANKS],
            Self::H => [ROUND_LEGS, ROUND_LEGS],
            Self::I => [ACROSS_CHEST, OVER_HEAD],
        }
    }

    /// The joint angles of the planar diver, rad: degrees of freedom 4 to 12 of Table 3.1.
    pub fn planar(self) -> Result<[f64; 9], PostureError> {
        let [bend, hip, knee, ankle, toes, neck] = self.trunk_and_legs();
        let arm = match self {
            Self::A | Self::B | Self::F | Self::H => self.arms()[0],
            Self::G => FORWARD,
            Self::C | Self::D | Self::E | Self::I => {
                return Err(PostureError::NotPlanar { posture: self });
            }
        };
        Ok([bend, hip, knee, ankle, toes, neck, arm[0], arm[3], arm[4]].map(f64::to_radians))
    }

    /// The joint angles of the spatial diver, rad: degrees of freedom 7 to 27 of Table 3.2.
    pub fn spatial(self) -> [f64; 21] {
        let [bend, hip, knee, ankle, toes, neck] = self.trunk_and_legs();
        let mut angles = [0.0; 21];
        angles[1] = bend;
        angles[2..6].copy_from_slice(&[hip, knee, ankle, toes]);
        angles[6..10].copy_from_slice(&[hip, knee, ankle, toes]);
        angles[10] = neck;
        let [right, left] = self.arms();
        angles[11..16].copy_from_slice(&right);
        angles[16..21].copy_from_slice(&left);
        angles.map(f64::to_radians)
    }
}

impl fmt::Display for Posture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self:?}")
    }
}

impl FromStr for Posture {
    type Err = PostureError;

    /// From its letter.
    fn from_str(name: &str) -> Result<Self, PostureError> {
        let found = Self::ALL.into_iter().find(|p| p.to_string() == name);
        found.ok_or_else(|| PostureError::UnknownName { name: name.to_owned() })
    }
}
