//! What the numbers of a file mean: unit of length and directions of the axes.

use super::RecordingError;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::fmt;

/// Units of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LengthUnit {
    /// 1 m.
    Metre,
    /// 0.1 m.
    Decimetre,
    /// 0.01 m.
    Centimetre,
    /// 0.001 m.
    Millimetre,
    /// 0.0254 m.
    Inch,
    /// 0.3048 m.
    Foot,
}

impl LengthUnit {
    /// What [`from_name`](Self::from_name) knows.
    pub const NAMES: &'static str = "m, dm, cm, mm, in, ft or their English names";

    /// The unit of this name or abbreviation, in any case.
    pub fn from_name(name: &str) -> Option<Self> {
        Some(match name.trim().to_ascii_lowercase().as_str() {
            "m" | "meter" | "meters" | "metre" | "metres" => Self::Metre,
            "dm" | "decimeter" | "decimeters" | "decimetre" | "decimetres" => Self::Decimetre,
            "cm" | "centimeter" | "centimeters" | "centimetre" | "centimetres" => Self::Centimetre,
            "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => Self::Millimetre,
            "in" | "inch" | "inches" => Self::Inch,
            "ft" | "foot" | "feet" => Self::Foot,
            _ => return None,
        })
    }

    /// The unit of a name that a field of so many letters has cut: at least four letters of a known one.
    pub fn from_cut_name(name: &str) -> Option<Self> {
        let name = name.trim().to_ascii_lowercase();
        const WHOLE: [&str; 9] = [
            "metres",
            "meters",
            "decimetres",
            "decimeters",
            "centimetres",
            "centimeters",
            "millimetres",
            "millimeters",
            "inches",
        ];
        let known = WHOLE.iter().find(|whole| name.len() >= 4 && whole.starts_with(&name));
        known.and_then(|whole| Self::from_name(whole))
    }

    /// The abbreviation that files have.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Decimetre => "dm",
            Self::Centimetre => "cm",
            Self::Millimetre => "mm",
            Self::Inch => "in",
            Self::Foot => "ft",
        }
    }

    /// `x` m in this unit.
    pub fn from_metres(self, x: f64) -> f64 {
        match self {
            Self::Metre => x,
            Self::Decimetre => x * 10.0,
            Self::Centimetre => x * 100.0,
            Self::Millimetre => x * 1000.0,
            Self::Inch => x / 0.0254,
            Self::Foot => x / 0.3048,
        }
    }

    /// `x` of this unit in m. Decimal units are divided, so that decimal numbers stay the nearest ones.
    pub fn to_metres(self, x: f64) -> f64 {
        match self {
            Self::Metre => x,
            Self::Decimetre => x / 10.0,
            Self::Centimetre => x / 100.0,
            Self::Millimetre => x / 1000.0,
            Self::Inch => x * 0.0254,
            Self::Foot => x * 0.3048,
        }
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::PlusX => "x",
            Self::MinusX => "-x",
            Self::PlusY => "y",
            Self::MinusY => "-y",
            Self::PlusZ => "z",
            Self::MinusZ => "-z",
        })
    }
}

/// A coordinate axis of a file, or its opposite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Axis {
    PlusX,
    MinusX,
    PlusY,
    MinusY,
    PlusZ,
    MinusZ,
}

impl Axis {
    /// The six.
    pub(crate) const ALL: [Self; 6] =
        [Self::PlusX, Self::PlusY, Self::PlusZ, Self::MinusX, Self::MinusY, Self::MinusZ];

    /// The line of an axis of this number, from 0.
    pub(crate) fn number(self) -> usize {
        self.direction().iamax()
    }

    fn direction(self) -> Vector3<f64> {
        match self {
            Self::PlusX => Vector3::x(),
            Self::MinusX => -Vector3::x(),
            Self::PlusY => Vector3::y(),
            Self::MinusY => -Vector3::y(),
            Self::PlusZ => Vector3::z(),
            Self::MinusZ => -Vector3::z(),
        }
    }
}

/// Unit and right-handed axes of a file: x_world = C x_file in m, the world having x forward and z up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Convention {
    unit: LengthUnit,
    up: Axis,
    forward: Axis,
    turn: UnitQuaternion<f64>,
    permutation: Matrix3<f64>,
}

impl Convention {
    /// Lengths in `unit`; `up` becomes z, `forward` becomes x.
    pub fn try_new(unit: LengthUnit, up: Axis, forward: Axis) -> Result<Self, RecordingError> {
        let (z, x) = (up.direction(), forward.direction());
        if z.dot(&x) != 0.0 {
            return Err(RecordingError::ParallelAxes { up, forward });
        }
        let permutation = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
        let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(permutation));
        Ok(Self { unit, up, forward, turn, permutation })
    }

    /// z up and x forward, as here.
    pub fn z_up(unit: LengthUnit) -> Self {
        let (up, forward) = (Axis::PlusZ, Axis::PlusX);
        let (turn, permutation) = (UnitQuaternion::identity(), Matrix3::identity());
        Self { unit, up, forward, turn, permutation }
    }

    /// y up and x forward, as in TRC files and in animation.
    pub fn y_up_x_forward(unit: LengthUnit) -> Self {
        Self::y_up(unit, Axis::PlusX, Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0))
    }

    /// y up and z forward, as in most BVH files.
    pub fn y_up_z_forward(unit: LengthUnit) -> Self {
        Self::y_up(unit, Axis::PlusZ, Matrix3::new(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0))
    }

    fn y_up(unit: LengthUnit, forward: Axis, permutation: Matrix3<f64>) -> Self {
        let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(permutation));
        Self { unit, up: Axis::PlusY, forward, turn, permutation }
    }

    /// The same axes with another unit.
    pub fn with_unit(self, unit: LengthUnit) -> Self {
        Self { unit, ..self }
    }

    /// The unit of length.
    pub fn unit(&self) -> LengthUnit {
        self.unit
    }

    /// The file's axis that points up.
    pub fn up(&self) -> Axis {
        self.up
    }

    /// The file's axis that points forward.
    pub fn forward(&self) -> Axis {
        self.forward
    }

    /// A position of the file in the world, m. A permutation of the coordinates: no rounding but the unit's.
    pub fn position(&self, x: &Vector3<f64>) -> Vector3<f64> {
        let metres = x.map(|c| self.unit.to_metres(c));
        Vector3::from_fn(|i, _| {
            let row = self.permutation.row(i);
            let k = row.transpose().iamax();
            row[k] * metres[k]
        })
    }

    /// A position of the world, m, in the file's axes and unit.
    pub fn file_position(&self, x: &Vector3<f64>) -> Vector3<f64> {
        let turned = Vector3::from_fn(|i, _| {
            let column = self.permutation.column(i);
            let k = column.iamax();
            column[k] * x[k]
        });
        turned.map(|c| self.unit.from_metres(c))
    }

    /// The axis of the file that is this one of the world.
    pub(crate) fn file_axis(&self, world: Axis) -> Axis {
        let direction = self.permutation.tr_mul(&world.direction());
        Axis::ALL.into_iter().find(|axis| axis.direction() == direction).unwrap_or(self.up)
    }

    /// A rotation between frames with x forward and z up as one between frames of the file: Cᵀ R C.
    pub fn file_rotation(&self, r: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        let axis = self.permutation.tr_mul(&r.imag());
        UnitQuaternion::new_unchecked(nalgebra::Quaternion::from_parts(r.w, axis))
    }

    /// A rotation between frames of the file as one between frames with x forward and z up: C R Cᵀ.
    pub fn rotation(&self, r: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        let axis = self.permutation * r.imag();
        UnitQuaternion::new_unchecked(nalgebra::Quaternion::from_parts(r.w, axis))
    }

    /// C as a rotation: file axes → world axes.
    pub fn turn(&self) -> &UnitQuaternion<f64> {
        &self.turn
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_becomes_z_and_forward_x() {
        let found = Convention::try_new(LengthUnit::Millimetre, Axis::PlusY, Axis::MinusZ).unwrap();
        assert_eq!(found.position(&Vector3::new(1.0, 2.0, 3.0)), Vector3::new(-0.003, -0.001, 0.002));
        for named in [Convention::y_up_x_forward, Convention::y_up_z_forward, Convention::z_up] {
            let named = named(LengthUnit::Inch);
            assert_eq!(Convention::try_new(named.unit(), named.up(), named.forward()), Ok(named));
        }
        let parallel = Convention::try_new(LengthUnit::Metre, Axis::PlusY, Axis::MinusY);
        assert_eq!(parallel, Err(RecordingError::ParallelAxes { up: Axis::PlusY, forward: Axis::MinusY }));
    }

    #[test]
    fn turned_rotations_turn_turned_vectors() {
        let convention = Convention::y_up_z_forward(LengthUnit::Metre);
        let r = UnitQuaternion::from_euler_angles(0.3, -0.8, 2.0);
        let x = Vector3::new(0.2, -0.5, 0.9);
        let moved = convention.rotation(&r) * convention.position(&x);
        assert!((moved - convention.position(&(r * x))).norm() < 1e-15);
        assert!((convention.turn() * x - convention.position(&x)).norm() < 1e-15);
        assert_eq!(convention.file_position(&convention.position(&x)), x);
        assert_eq!(convention.file_rotation(&convention.rotation(&r)), r);
    }

    #[test]
    fn decimal_millimetres_stay_the_nearest_numbers() {
        assert_eq!(LengthUnit::Millimetre.to_metres(1234.5), 1.2345);
        assert_eq!(LengthUnit::from_name(" MM"), Some(LengthUnit::Millimetre));
        assert_eq!(LengthUnit::from_name("furlong"), None);
        assert_eq!(LengthUnit::from_cut_name("mete"), Some(LengthUnit::Metre));
        assert_eq!(LengthUnit::from_cut_name("Milli"), Some(LengthUnit::Millimetre));
        assert!(["met", "mega", "m", ""].iter().all(|name| LengthUnit::from_cut_name(name).is_none()));
        use LengthUnit::{Centimetre, Decimetre, Foot, Inch, Metre, Millimetre};
        for unit in [Metre, Decimetre, Centimetre, Millimetre, Inch, Foot] {
            assert_eq!(LengthUnit::from_name(unit.symbol()), Some(unit));
            assert!((unit.from_metres(unit.to_metres(1.25)) - 1.25).abs() < 1e-15);
        }
    }
}
