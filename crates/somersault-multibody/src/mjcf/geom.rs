//! Shapes of bodies: where they are, how large, and how heavy.

use super::MjcfError;
use super::assets::Meshes;
use super::compiler::{Compiler, Pose, turned_to};
use super::defaults::Styled;
use crate::link::MassProperties;
use crate::robot::{GeometryPurpose, GeometryShape};
use nalgebra::Vector3;
use somersault_core::Inertia;
use std::f64::consts::PI;

/// Attributes that are read.
pub(super) const READ: [&str; 20] = [
    "name",
    "class",
    "type",
    "contype",
    "conaffinity",
    "group",
    "size",
    "fromto",
    "pos",
    "quat",
    "axisangle",
    "xyaxes",
    "zaxis",
    "euler",
    "mass",
    "density",
    "shellinertia",
    "mesh",
    "hfield",
    "fitscale",
];

/// Attributes of contacts, of fluids and of the view, of which a tree has none.
pub(super) const WITHOUT_EFFECT: [&str; 17] = [
    "condim",
    "priority",
    "friction",
    "solmix",
    "solref",
    "solimp",
    "margin",
    "gap",
    "material",
    "rgba",
    "user",
    "fluidshape",
    "fluidcoef",
    "castshadow",
    "surfacevel",
    "adhesion",
    "solreffriction",
];

/// What a geom is made of.
enum Solid {
    /// A shape with a volume that its sizes say.
    Known(GeometryShape),
    /// A surface around a volume that stands elsewhere; the shape if that is only a mesh.
    Elsewhere(Option<GeometryShape>),
    /// A plane or a height field.
    Open,
}

pub(super) struct Geom<'a> {
    pub(super) element: Styled<'a>,
    pub(super) pose: Pose,
    pub(super) purpose: GeometryPurpose,
    pub(super) group: f64,
    solid: Solid,
}

impl<'a> Geom<'a> {
    pub(super) fn read(
        element: Styled<'a>,
        frame: &Pose,
        compiler: &Compiler,
        meshes: &Meshes,
    ) -> Result<Self, MjcfError> {
        let types = ["sphere", "capsule", "ellipsoid", "cylinder", "box", "plane", "hfield", "mesh", "sdf"];
        let kind = element.at("type").word("type", &types)?.unwrap_or("sphere");
        let mut pose = compiler.pose(&element)?;
        let mut size: [f64; 3] = element.overlaid("size", [0.0; 3])?;
        let at = element.at("fromto");
        if let Some([a, b, c, d, e, f]) = at.finite::<6>("fromto")? {
            let (from, to) = (Vector3::new(a, b, c), Vector3::new(d, e, f));
            let half = (from - to).norm() / 2.0;
            if !matches!(kind, "capsule" | "cylinder" | "ellipsoid" | "box") {
                return Err(MjcfError::refused(
                    &at,
                    "`fromto` is for capsules, cylinders, ellipsoids and boxes",
                ));
            }
            if pose.position != Vector3::zeros() {
                return Err(MjcfError::refused(&element.own, "it is placed by both `pos` and `fromto`"));
            }
            if !(half > 1e-10 && half.is_finite()) {
                return Err(at.bad_value("fromto", "two points that are apart").into());
            }
            size = match kind {
                "ellipsoid" | "box" => [size[0], size[0], half],
                _ => [size[0], half, 0.0],
            };
            pose =
                Pose { position: (from + to) / 2.0, orientation: turned_to(&((from - to) / (2.0 * half))) };
        }
        let needed = match kind {
            "sphere" => 1,
            "capsule" | "cylinder" => 2,
            "ellipsoid" | "box" => 3,
            _ => 0,
        };
        let fitted = element.has("mesh") && kind != "mesh";
        if !fitted && size[..needed].iter().any(|x| *x <= 0.0) {
            let allowed = format!("{needed} positive number(s)");
            return Err(element.at("size").bad_value("size", allowed).into());
        }
        let [a, b, c] = size;
        let solid = match kind {
            _ if fitted => Solid::Elsewhere(None),
            "sphere" => Solid::Known(GeometryShape::Sphere { radius: a }),
            "capsule" => Solid::Known(GeometryShape::Capsule { radius: a, length: 2.0 * b }),
            "cylinder" => Solid::Known(GeometryShape::Cylinder { radius: a, length: 2.0 * b }),
            "ellipsoid" => Solid::Known(GeometryShape::Ellipsoid { radii: Vector3::new(a, b, c) }),
            "box" => Solid::Known(GeometryShape::Box { size: Vector3::new(a, b, c) * 2.0 }),
            "mesh" => Solid::Elsewhere(meshes.shape(&element, compiler)?),
            "sdf" => Solid::Elsewhere(None),
            _ => Solid::Open,
        };
        let touches =
            |attribute| Ok::<_, MjcfError>(element.at(attribute).number_or_none(attribute)? != Some(0.0));
        let purpose = match touches("contype")? || touches("conaffinity")? {
            true => GeometryPurpose::Collision,
            false => GeometryPurpose::Visual,
        };
        let group = element.at("group").number_or_none("group")?.unwrap_or(0.0);
        Ok(Self { element, pose: frame.of(&pose), purpose, group, solid })
    }

    /// The shape, if a file or the document says it.
    pub(super) fn shape(&self) -> Option<&GeometryShape> {
        match &self.solid {
            Solid::Known(shape) => Some(shape),
            Solid::Elsewhere(shape) => shape.as_ref(),
            Solid::Open => None,
        }
    }

    /// Mass and inertia in the axes of the body; none where they follow from a mesh.
    pub(super) fn mass(&self) -> Result<Option<MassProperties>, MjcfError> {
        let number = |attribute| {
            let at = self.element.at(attribute);
            match at.number_or_none(attribute)? {
                Some(x) if x < 0.0 => Err(MjcfError::from(at.bad_value(attribute, "not negative"))),
                found => Ok(found),
            }
        };
        let (mass, density) = (number("mass")?, number("density")?.unwrap_or(1000.0));
        let shape = match &self.solid {
            Solid::Known(shape) => shape,
            Solid::Elsewhere(_) if mass.unwrap_or(density) == 0.0 => {
                return Ok(Some(MassProperties::massless()));
            }
            Solid::Elsewhere(_) => return Ok(None),
            Solid::Open => return Ok(Some(MassProperties::massless())),
        };
        let shell = self.element.at("shellinertia");
        if shell.word("shellinertia", &["false", "true"])? == Some("true") {
            return Err(MjcfError::refused(
                &self.element.own,
                "inertia of shells is not read: give the body an <inertial>",
            ));
        }
        let mass = mass.unwrap_or(density * volume(shape));
        let refused =
            |reason: somersault_core::InertiaError| MjcfError::refused(&self.element.own, reason.to_string());
        let inertia = if mass == 0.0 { None } else { inertia(shape, mass).transpose().map_err(refused)? };
        let turn = self.pose.orientation.to_rotation_matrix().into_inner();
        let inertia =
            inertia.map_or_else(Default::default, |inertia| turn * inertia.tensor() * turn.transpose());
        let center = self.pose.position;
        Ok(Some(MassProperties { mass, center, inertia: (inertia + inertia.transpose()) * 0.5 }))
    }
}

/// m³.
fn volume(shape: &GeometryShape) -> f64 {
    match shape {
        GeometryShape::Box { size } => size.product(),
        GeometryShape::Cylinder { radius, length } => PI * radius * radius * length,
        GeometryShape::Capsule { radius, length } => PI * radius * radius * (length + 4.0 / 3.0 * radius),
        GeometryShape::Sphere { radius } => 4.0 / 3.0 * PI * radius.powi(3),
        GeometryShape::Ellipsoid { radii } => 4.0 / 3.0 * PI * radii.product(),
        GeometryShape::Mesh { .. } => 0.0,
    }
}

/// About the centre, along the axes of the shape.
fn inertia(shape: &GeometryShape, mass: f64) -> Option<Result<Inertia, somersault_core::InertiaError>> {
    match shape {
        GeometryShape::Box { size } => Some(Inertia::try_box(mass, *size)),
        GeometryShape::Cylinder { radius, length } => Some(Inertia::try_cylinder(mass, *radius, *length)),
        GeometryShape::Capsule { radius, length } => Some(Inertia::try_capsule(mass, *radius, *length)),
        GeometryShape::Sphere { radius } => Some(Inertia::try_sphere(mass, *radius)),
        GeometryShape::Ellipsoid { radii } => Some(Inertia::try_ellipsoid(mass, *radii)),
        GeometryShape::Mesh { .. } => None,
    }
}

/// Bodies that move as one, as one body.
pub(super) fn together(parts: &[MassProperties]) -> MassProperties {
    if let [only] = parts {
        return *only;
    }
    let mass: f64 = parts.iter().map(|part| part.mass).sum();
    if mass == 0.0 {
        return MassProperties::massless();
    }
    let center = parts.iter().map(|part| part.center * part.mass).sum::<Vector3<f64>>() / mass;
    let mut whole = MassProperties::point(mass, center);
    for part in parts {
        let arm = part.center - center;
        let shift = nalgebra::Matrix3::from_diagonal_element(arm.norm_squared()) - arm * arm.transpose();
        whole.inertia += part.inertia + shift * part.mass;
    }
    whole
}
