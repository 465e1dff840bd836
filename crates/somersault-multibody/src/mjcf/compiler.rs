//! Settings of a document: how it says angles, where inertia comes from, and what `<option>` says of the motion.

use super::MjcfError;
use super::defaults::Styled;
use super::report::Report;
use crate::robot::document::Element;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Attributes of `<compiler>` that change nothing here: textures, meshes, threads, what is saved, and what is merged for speed.
const WITHOUT_EFFECT: [&str; 12] = [
    "texturedir",
    "discardvisual",
    "usethread",
    "fusestatic",
    "saveinertial",
    "savecompiled",
    "savecanonical",
    "fitaabb",
    "convexhull",
    "exactmeshinertia",
    "conflict",
    "passthrough",
];

const READ: [&str; 15] = [
    "name",
    "angle",
    "eulerseq",
    "autolimits",
    "coordinate",
    "inertiafromgeom",
    "inertiagrouprange",
    "balanceinertia",
    "boundmass",
    "boundinertia",
    "settotalmass",
    "meshdir",
    "assetdir",
    "strippath",
    "alignfree",
];

/// Where the inertia of a body comes from.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum FromGeoms {
    Never,
    /// Where the body has no `<inertial>`.
    Missing,
    Always,
}

pub(super) struct Compiler<'a> {
    degree: bool,
    /// Of each rotation its axis, and whether that turns with those before.
    euler: [(usize, bool); 3],
    pub(super) auto_limits: bool,
    pub(super) from_geoms: FromGeoms,
    pub(super) groups: [f64; 2],
    pub(super) balance: bool,
    pub(super) bound_mass: f64,
    pub(super) bound_inertia: f64,
    pub(super) total_mass: f64,
    mesh_folder: &'a str,
    strip_path: bool,
}

impl<'a> Compiler<'a> {
    pub(super) fn read(sections: &[Element<'a>], report: &mut Report<'a>) -> Result<Self, MjcfError> {
        let mut found = Self {
            degree: true,
            euler: [(0, true), (1, true), (2, true)],
            auto_limits: true,
            from_geoms: FromGeoms::Missing,
            groups: [0.0, 5.0],
            balance: false,
            bound_mass: 0.0,
            bound_inertia: 0.0,
            total_mass: 0.0,
            mesh_folder: "",
            strip_path: false,
        };
        for section in sections.iter().filter(|section| section.tag() == "compiler") {
            report.check_attributes(section, &[&READ, &WITHOUT_EFFECT])?;
            found.update(section)?;
        }
        Ok(found)
    }

    fn update(&mut self, section: &Element<'a>) -> Result<(), MjcfError> {
        let flag =
            |attribute| Ok::<_, MjcfError>(section.word(attribute, &["false", "true"])?.map(|w| w == "true"));
        if let Some(angle) = section.word("angle", &["degree", "radian"])? {
            self.degree = angle == "degree";
        }
        if let Some(sequence) = section.attribute_or_none("eulerseq") {
            self.euler =
                euler(sequence).ok_or_else(|| section.bad_value("eulerseq", "three of x, y, z, X, Y, Z"))?;
        }
        self.auto_limits = flag("autolimits")?.unwrap_or(self.auto_limits);
        if section.word("coordinate", &["local", "global"])? == Some("global") {
            let reason = "global coordinates were removed from MuJoCo: save the model in local ones";
            return Err(MjcfError::refused(section, reason));
        }
        if let Some(word) = section.word("inertiafromgeom", &["false", "true", "auto"])? {
            self.from_geoms = match word {
                "false" => FromGeoms::Never,
                "true" => FromGeoms::Always,
                _ => FromGeoms::Missing,
            };
        }
        self.groups = section.finite("inertiagrouprange")?.unwrap_or(self.groups);
        self.balance = flag("balanceinertia")?.unwrap_or(self.balance);
        for (attribute, value) in [
            ("boundmass", &mut self.bound_mass),
            ("boundinertia", &mut self.bound_inertia),
            ("settotalmass", &mut self.total_mass),
        ] {
            *value = section.number_or_none(attribute)?.unwrap_or(*value);
        }
        for attribute in ["assetdir", "meshdir"] {
            self.mesh_folder = section.attribute_or_none(attribute).unwrap_or(self.mesh_folder);
        }
        self.strip_path = flag("strippath")?.unwrap_or(self.strip_path);
        if flag("alignfree")? == Some(true) {
            let reason = "`alignfree` moves the frames of free bodies: save the model without it";
            return Err(MjcfError::refused(section, reason));
        }
        Ok(())
    }

    /// rad for one unit of an angle.
    pub(super) fn angle(&self) -> f64 {
        if self.degree { 1.0_f64.to_radians() } else { 1.0 }
    }

    /// The path of a mesh.
    pub(super) fn mesh_path(&self, file: &str) -> String {
        let file = if self.strip_path { file.rsplit(['/', '\\']).next().unwrap_or(file) } else { file };
        match self.mesh_folder {
            "" => file.to_owned(),
            _ if file.starts_with('/') => file.to_owned(),
            folder => format!("{}/{file}", folder.trim_end_matches('/')),
        }
    }

    /// How an element is turned, if it or a default says so.
    pub(super) fn rotation(&self, element: &Styled) -> Result<Option<UnitQuaternion<f64>>, MjcfError> {
        let kinds = ["quat", "axisangle", "xyaxes", "zaxis", "euler"];
        let Some((at, kind, second)) = element.first_of(&kinds) else { return Ok(None) };
        if let Some(second) = second {
            let (element, line) = (at.to_string(), at.line());
            return Err(MjcfError::TwoRotations { element, line, first: kind, second });
        }
        let zero = || at.bad_value(kind, "axes that are not zero or parallel");
        let direction = |v: Vector3<f64>| v.try_normalize(0.0).filter(|v| v.iter().all(|x| x.is_finite()));
        let turn = match kind {
            "quat" => match at.finite(kind)? {
                Some([w, x, y, z]) => at.rotation(kind, [x, y, z, w])?,
                None => return Ok(None),
            },
            "axisangle" => {
                let [x, y, z, angle] = at.finite(kind)?.unwrap_or_default();
                let axis = direction(Vector3::new(x, y, z)).ok_or_else(zero)?;
                UnitQuaternion::from_scaled_axis(axis * (angle * self.angle()))
            }
            "xyaxes" => {
                let [a, b, c, d, e, f] = at.finite(kind)?.unwrap_or_default();
                let x = direction(Vector3::new(a, b, c)).ok_or_else(zero)?;
                let y = Vector3::new(d, e, f);
                let y = direction(y - x * x.dot(&y)).ok_or_else(zero)?;
                let axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
                UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes))
            }
            "zaxis" => {
                let z = direction(at.vector(kind)?.unwrap_or_default()).ok_or_else(zero)?;
                turned_to(&z)
            }
            _ => {
                let angles: [f64; 3] = at.finite(kind)?.unwrap_or_default();
                let mut turn = UnitQuaternion::identity();
                for ((axis, moves), angle) in self.euler.into_iter().zip(angles) {
                    let next = UnitQuaternion::from_scaled_axis(Vector3::ith(axis, angle * self.angle()));
                    turn = if moves { turn * next } else { next * turn };
                }
                turn
            }
        };
        Ok(Some(turn))
    }

    /// Where an element is, and how it is turned.
    pub(super) fn pose(&self, element: &Styled) -> Result<Pose, MjcfError> {
        let position = element.at("pos").vector("pos")?.unwrap_or_default();
        Ok(Pose { position, orientation: self.rotation(element)?.unwrap_or_default() })
    }
}

/// The sequence of `eulerseq`: lower case turns about axes that move.
fn euler(sequence: &str) -> Option<[(usize, bool); 3]> {
    let axis = |letter: char| match letter {
        'x' => Some((0, true)),
        'y' => Some((1, true)),
        'z' => Some((2, true)),
        'X' => Some((0, false)),
        'Y' => Some((1, false)),
        'Z' => Some((2, false)),
        _ => None,
    };
    sequence.chars().map(axis).collect::<Option<Vec<_>>>()?.try_into().ok()
}

/// The shortest rotation that brings z to a direction.
pub(super) fn turned_to(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    let across = Vector3::z().cross(direction);
    let axis = across.try_normalize(1e-10).unwrap_or(Vector3::x());
    UnitQuaternion::from_scaled_axis(axis * across.norm().atan2(direction.z))
}

/// Where something is, and how it is turned.
#[derive(Clone, Copy)]
pub(super) struct Pose {
    pub(super) position: Vector3<f64>,
    pub(super) orientation: UnitQuaternion<f64>,
}

impl Pose {
    pub(super) fn identity() -> Self {
        Self { position: Vector3::zeros(), orientation: UnitQuaternion::identity() }
    }

    /// The pose in the frame in which this is one.
    pub(super) fn of(&self, inner: &Self) -> Self {
        Self { position: self.place(&inner.position), orientation: self.orientation * inner.orientation }
    }

    pub(super) fn place(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.position + self.orientation * point
    }
}

/// What `<option>` says of the motion.
pub(super) struct Physics {
    pub(super) gravity: Vector3<f64>,
    /// Whether joints are damped.
    pub(super) damped: bool,
    /// Whether joints follow others.
    pub(super) coupled: bool,
}

impl Physics {
    pub(super) fn read<'a>(
        sections: &[Element<'a>],
        children: impl Fn(&Element<'a>) -> Vec<Element<'a>>,
        report: &mut Report<'a>,
    ) -> Result<Self, MjcfError> {
        let mut found = Self { gravity: Vector3::new(0.0, 0.0, -9.81), damped: true, coupled: true };
        let mut weightless = false;
        for section in sections.iter().filter(|section| section.tag() == "option") {
            found.gravity = section.vector("gravity")?.unwrap_or(found.gravity);
            for attribute in ["density", "viscosity"] {
                if section.number_or_none(attribute)?.is_some_and(|x| x != 0.0) {
                    report.acts(section, "forces of the medium around the bodies are not read")?;
                }
            }
            for flags in children(section).iter().filter(|child| child.tag() == "flag") {
                let off = |attribute| {
                    Ok::<_, MjcfError>(flags.word(attribute, &["enable", "disable"])? == Some("disable"))
                };
                weightless |= off("gravity")?;
                found.damped &= !(off("passive")? || off("damper")?);
                found.coupled &= !(off("equality")? || off("constraint")?);
            }
        }
        if weightless {
            found.gravity = Vector3::zeros();
        }
        Ok(found)
    }
}
