//! Joints of bodies.

use super::MjcfError;
use super::compiler::{Compiler, Pose};
use super::defaults::Styled;
use super::report::Report;
use crate::joint::Joint;
use nalgebra::{UnitQuaternion, Vector3};

/// Attributes that are read.
pub(super) const READ: [&str; 15] = [
    "name",
    "class",
    "type",
    "pos",
    "axis",
    "ref",
    "limited",
    "range",
    "damping",
    "armature",
    "stiffness",
    "springdamper",
    "frictionloss",
    "align",
    "springref",
];

/// Attributes of limits, of actuators and of the view.
pub(super) const WITHOUT_EFFECT: [&str; 11] = [
    "group",
    "user",
    "margin",
    "springyield",
    "solreflimit",
    "solimplimit",
    "solreffriction",
    "solimpfriction",
    "actuatorfrcrange",
    "actuatorfrclimited",
    "actuatorgravcomp",
];

/// What moves how.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Free,
    Ball,
    Slide,
    Hinge,
}

pub(super) struct BodyJoint<'a> {
    pub(super) element: Styled<'a>,
    pub(super) kind: Kind,
    /// In the body, m.
    pub(super) anchor: Vector3<f64>,
    axis: Vector3<f64>,
    /// Its coordinate where the document shows it, rad or m.
    pub(super) reference: f64,
    pub(super) limits: Option<[f64; 2]>,
    pub(super) damping: f64,
}

impl<'a> BodyJoint<'a> {
    pub(super) fn read(
        element: Styled<'a>,
        frame: &Pose,
        compiler: &Compiler,
        report: &mut Report,
    ) -> Result<Self, MjcfError> {
        let own = &element.own;
        let kind = match element.at("type").word("type", &["hinge", "slide", "ball", "free"])? {
            _ if own.tag() == "freejoint" => Kind::Free,
            Some("slide") => Kind::Slide,
            Some("ball") => Kind::Ball,
            Some("free") => Kind::Free,
            _ => Kind::Hinge,
        };
        if element.at("align").word("align", &["false", "true", "auto"])? == Some("true") {
            let reason = "`align` moves the frame of the body: save the model without it";
            return Err(MjcfError::refused(own, reason));
        }
        let scalar = |attribute: &'static str| element.at(attribute).number_or_none(attribute);
        let unit = if kind == Kind::Hinge { compiler.angle() } else { 1.0 };
        let [damping, higher @ ..] = element.overlaid("damping", [0.0; 8])?;
        if higher.iter().any(|x| *x != 0.0) {
            report.acts(own, "damping that is not linear is not read")?;
        }
        for (attribute, reason) in [
            ("stiffness", "springs of joints are not read"),
            ("springdamper", "springs of joints are not read"),
            ("frictionloss", "dry friction of joints is not read"),
            ("armature", "the inertia of rotors is not read"),
        ] {
            if element.overlaid(attribute, [0.0; 8])?.iter().any(|x| *x != 0.0) {
                report.acts(own, reason)?;
            }
        }
        Ok(Self {
            element,
            kind,
            anchor: frame.place(&element.at("pos").vector("pos")?.unwrap_or_default()),
            axis: frame.orientation * element.at("axis").vector("axis")?.unwrap_or(Vector3::z()),
            reference: scalar("ref")?.unwrap_or(0.0) * unit,
            limits: limits(&element, kind, unit, compiler, report)?,
            damping,
        })
    }

    /// The joint of the tree.
    pub(super) fn joint(&self) -> Joint {
        match self.kind {
            Kind::Free => Joint::Free,
            Kind::Ball => Joint::Spherical,
            Kind::Slide => Joint::Prismatic { axis: self.axis },
            Kind::Hinge => Joint::Revolute { axis: self.axis },
        }
    }

    /// Where the joint frame is, so that the body is at `pose` where the coordinate is the reference.
    pub(super) fn placed(&self, pose: &Pose) -> Pose {
        let back = self.axis.try_normalize(0.0).unwrap_or_default() * -self.reference;
        match self.kind {
            Kind::Free | Kind::Ball => *pose,
            Kind::Slide => Pose { position: pose.place(&back), orientation: pose.orientation },
            Kind::Hinge => Pose {
                position: pose.position,
                orientation: pose.orientation * UnitQuaternion::from_scaled_axis(back),
            },
        }
    }
}

/// The range, if there is one that the tree can record.
fn limits(
    element: &Styled,
    kind: Kind,
    unit: f64,
    compiler: &Compiler,
    report: &mut Report,
) -> Result<Option<[f64; 2]>, MjcfError> {
    let at = element.at("range");
    let range = at.numbers::<2>("range")?;
    let [lower, upper] = range.unwrap_or_default();
    let limited = match element.at("limited").word("limited", &["false", "true", "auto"])? {
        Some("true") => true,
        Some("false") => false,
        _ if compiler.auto_limits => lower < upper,
        _ if range.is_some_and(|range| range != [0.0, 0.0]) => {
            let reason = "it has a range, but without `autolimits` `limited` must be said";
            return Err(MjcfError::refused(&element.own, reason));
        }
        _ => false,
    };
    if !limited || kind == Kind::Free {
        return Ok(None);
    }
    if kind == Kind::Ball {
        report.ignore(&element.own, "the range of a ball joint is not recorded");
        return Ok(None);
    }
    if lower >= upper {
        return Err(at.bad_value("range", "an interval").into());
    }
    Ok(Some([lower * unit, upper * unit]))
}
