//! Bodies of the world, from the outermost inwards.

use super::MjcfError;
use super::assets::Meshes;
use super::compiler::{Compiler, FromGeoms, Pose};
use super::defaults::{Defaults, MAIN, Styled};
use super::geom::{self, Geom, together};
use super::joint::{self, BodyJoint, Kind};
use super::library::Library;
use super::report::Report;
use crate::link::MassProperties;
use crate::robot::document::Element;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

const READ: [&str; 10] =
    ["name", "childclass", "pos", "quat", "axisangle", "xyaxes", "zaxis", "euler", "mocap", "gravcomp"];
const WITHOUT_EFFECT: [&str; 5] = ["user", "sleep", "simple", "fuse", "explicitinertial"];
const OF_INERTIAL: [&str; 9] =
    ["pos", "quat", "axisangle", "xyaxes", "zaxis", "euler", "mass", "diaginertia", "fullinertia"];

/// Of principal moments, relative.
const ROUNDING: f64 = 1e-14;

pub(super) struct Body<'a> {
    pub(super) element: Element<'a>,
    /// Number of the body that carries it; none if that is the world.
    pub(super) parent: Option<usize>,
    pub(super) pose: Pose,
    /// `pos`, without the frames around the body.
    own_position: Vector3<f64>,
    pub(super) joints: Vec<BodyJoint<'a>>,
    inertial: Option<MassProperties>,
    pub(super) geoms: Vec<Geom<'a>>,
}

/// All bodies, a parent before its children, and the shapes of the world.
pub(super) struct World<'a> {
    pub(super) bodies: Vec<Body<'a>>,
    pub(super) geoms: Vec<Geom<'a>>,
}

/// An element that is still to be read, and where it stands.
struct Open<'a> {
    element: Element<'a>,
    body: Option<usize>,
    frame: Pose,
    class: usize,
}

/// What reading a body takes.
pub(super) struct Settings<'a, 'r> {
    pub(super) library: &'r Library<'a>,
    pub(super) defaults: &'a Defaults<'a>,
    pub(super) compiler: &'r Compiler<'a>,
    pub(super) meshes: &'r Meshes<'a>,
}

impl<'a> World<'a> {
    pub(super) fn read(
        sections: &[Element<'a>],
        settings: &Settings<'a, '_>,
        report: &mut Report<'a>,
    ) -> Result<Self, MjcfError> {
        let mut world = Self { bodies: Vec::new(), geoms: Vec::new() };
        let mut open = Vec::new();
        for section in sections.iter().rev().filter(|section| section.tag() == "worldbody") {
            let class = settings.defaults.named(section, "childclass")?.unwrap_or(MAIN);
            push(&mut open, section, None, Pose::identity(), class, settings);
        }
        while let Some(next) = open.pop() {
            world.add(next, &mut open, settings, report)?;
        }
        Ok(world)
    }

    fn add(
        &mut self,
        next: Open<'a>,
        open: &mut Vec<Open<'a>>,
        settings: &Settings<'a, '_>,
        report: &mut Report<'a>,
    ) -> Result<(), MjcfError> {
        let Open { element, body, frame, class } = next;
        let Settings { defaults, compiler, meshes, .. } = *settings;
        match element.tag() {
            "body" => {
                report.check_attributes(&element, &[&READ, &WITHOUT_EFFECT])?;
                if element.number_or_none("gravcomp")?.is_some_and(|x| x != 0.0) {
                    report.acts(&element, "compensation of gravity is not read")?;
                }
                if element.word("mocap", &["false", "true"])? == Some("true") {
                    report.acts(&element, "a body that is moved from outside stands still here")?;
                }
                let class = defaults.named(&element, "childclass")?.unwrap_or(class);
                let own = compiler.pose(&Styled::plain(element))?;
                let (pose, own_position) = (frame.of(&own), own.position);
                let number = self.bodies.len();
                push(open, &element, Some(number), Pose::identity(), class, settings);
                let (joints, geoms) = (Vec::new(), Vec::new());
                self.bodies.push(Body {
                    element,
                    parent: body,
                    pose,
                    own_position,
                    joints,
                    inertial: None,
                    geoms,
                });
            }
            "frame" => {
                report.check_attributes(&element, &[&READ[..8]])?;
                let class = defaults.named(&element, "childclass")?.unwrap_or(class);
                let frame = frame.of(&compiler.pose(&Styled::plain(element))?);
                push(open, &element, body, frame, class, settings);
            }
            "geom" => {
                report.check_attributes(&element, &[&geom::READ, &geom::WITHOUT_EFFECT])?;
                let found = Geom::read(defaults.styled(element, "geom", class)?, &frame, compiler, meshes)?;
                self.geoms_of(body).push(found);
            }
            "joint" | "freejoint" => {
                let Some(body) = body else {
                    return Err(MjcfError::refused(&element, "the world has no joints"));
                };
                report.check_attributes(&element, &[&joint::READ, &joint::WITHOUT_EFFECT])?;
                // classes style joints, and no free ones
                let styled = if element.tag() == "joint" {
                    defaults.styled(element, "joint", class)?
                } else {
                    Styled::plain(element)
                };
                let found = BodyJoint::read(styled, &frame, compiler, report)?;
                self.bodies[body].add_joint(found)?;
            }
            "inertial" => {
                let Some(body) = body else {
                    return Err(MjcfError::refused(&element, "the world has no inertia"));
                };
                report.check_attributes(&element, &[&OF_INERTIAL])?;
                let found = inertial(&element, &frame, compiler)?;
                if self.bodies[body].inertial.replace(found).is_some() {
                    return Err(MjcfError::refused(&element, "its body has another <inertial>"));
                }
            }
            "site" | "camera" | "light" => {}
            "plugin" => report.acts(&element, "plugins are not read")?,
            "composite" | "flexcomp" | "replicate" | "attach" => {
                let reason = "what is generated is not read: save the model from MuJoCo, which writes it out";
                return Err(MjcfError::refused(&element, reason));
            }
            _ => return Err(MjcfError::unknown_element(&element, "body")),
        }
        Ok(())
    }

    fn geoms_of(&mut self, body: Option<usize>) -> &mut Vec<Geom<'a>> {
        match body {
            Some(body) => &mut self.bodies[body].geoms,
            None => &mut self.geoms,
        }
    }

    /// The mass of each body.
    pub(super) fn masses(
        &self,
        compiler: &Compiler,
        report: &mut Report<'a>,
    ) -> Result<Vec<MassProperties>, MjcfError> {
        let mut still = Vec::with_capacity(self.bodies.len());
        let mut masses = Vec::with_capacity(self.bodies.len());
        for body in &self.bodies {
            let stands = body.joints.is_empty() && body.parent.is_none_or(|parent| still[parent]);
            still.push(stands);
            masses.push(compiler.settled(body.mass(stands, compiler, report)?));
        }
        let whole: f64 = masses.iter().map(|body| body.mass).sum();
        if compiler.total_mass > 0.0 && whole > 0.0 {
            for body in &mut masses {
                body.mass *= compiler.total_mass / whole;
                body.inertia *= compiler.total_mass / whole;
            }
        }
        Ok(masses)
    }
}

/// Puts what an element holds on the stack, its first child on top.
fn push<'a>(
    open: &mut Vec<Open<'a>>,
    parent: &Element<'a>,
    body: Option<usize>,
    frame: Pose,
    class: usize,
    settings: &Settings<'a, '_>,
) {
    let children = settings.library.children(parent).into_iter().rev();
    open.extend(children.map(|element| Open { element, body, frame, class }));
}

impl<'a> Body<'a> {
    fn add_joint(&mut self, joint: BodyJoint<'a>) -> Result<(), MjcfError> {
        let turns = |kind: Kind| matches!(kind, Kind::Ball | Kind::Hinge);
        let has = |kind: Kind| self.joints.iter().any(|joint| joint.kind == kind);
        let reason = match joint.kind {
            Kind::Free if self.parent.is_some() => Some("free joints are for bodies of the world"),
            Kind::Free if !self.joints.is_empty() => Some("a free joint has no other beside it"),
            _ if has(Kind::Free) => Some("a free joint has no other beside it"),
            kind if turns(kind) && has(Kind::Ball) => Some("no rotation follows a ball joint in a body"),
            Kind::Free | Kind::Ball | Kind::Slide | Kind::Hinge => None,
        };
        if let Some(reason) = reason {
            return Err(MjcfError::refused(&joint.element.own, reason));
        }
        self.joints.push(joint);
        Ok(())
    }

    /// From `<inertial>` or from geoms. The meshes of what stands still need no mass.
    fn mass(
        &self,
        stands: bool,
        compiler: &Compiler,
        report: &mut Report<'a>,
    ) -> Result<MassProperties, MjcfError> {
        let from_geoms = match compiler.from_geoms {
            FromGeoms::Never => false,
            FromGeoms::Missing => self.inertial.is_none(),
            FromGeoms::Always => true,
        };
        let [first, last] = compiler.groups;
        let heavy = self.geoms.iter().filter(|geom| from_geoms && (first..=last).contains(&geom.group));
        let heavy: Vec<&Geom> = heavy.collect();
        if heavy.is_empty() {
            // MuJoCo has the mass of `boundmass` at `pos`, as if that were in the body
            let bound = if compiler.bound_mass > 0.0 { self.own_position } else { Vector3::zeros() };
            return Ok(self.inertial.unwrap_or(MassProperties::point(0.0, bound)));
        }
        let mut parts = Vec::with_capacity(heavy.len());
        for geom in heavy {
            match geom.mass()? {
                Some(mass) => parts.push(mass),
                None if stands => {
                    report.ignore(&geom.element.own, "the mass of a mesh that does not move is not read")
                }
                None => {
                    let reason =
                        "its mass is that of a mesh, which is not opened: give the body an <inertial>";
                    return Err(MjcfError::refused(&geom.element.own, reason));
                }
            }
        }
        Ok(together(&parts))
    }
}

fn inertial(element: &Element, frame: &Pose, compiler: &Compiler) -> Result<MassProperties, MjcfError> {
    let mass = element.number("mass")?;
    let center = frame.place(&element.vector("pos")?.ok_or_else(|| element.missing("pos"))?);
    let turn = compiler.rotation(&Styled::plain(*element))?;
    let tensor = match (element.vector("diaginertia")?, element.finite::<6>("fullinertia")?) {
        (None, Some([xx, yy, zz, xy, xz, yz])) if turn.is_none() => {
            Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
        }
        (_, Some(_)) => {
            let reason = "`fullinertia` stands alone: in the axes of the body, without `diaginertia`";
            return Err(MjcfError::refused(element, reason));
        }
        (Some(moments), None) => Matrix3::from_diagonal(&moments),
        (None, None) => return Err(element.missing("diaginertia").into()),
    };
    let turn = frame.orientation * turn.unwrap_or_default();
    let turn = turn.to_rotation_matrix().into_inner();
    let inertia = turn * tensor * turn.transpose();
    Ok(MassProperties { mass, center, inertia: (inertia + inertia.transpose()) * 0.5 })
}

impl Compiler<'_> {
    /// What `boundmass`, `boundinertia` and `balanceinertia` make of a body.
    fn settled(&self, found: MassProperties) -> MassProperties {
        let mass = found.mass.max(self.bound_mass);
        if !found.inertia.iter().all(|x| x.is_finite()) || self.bound_inertia <= 0.0 && !self.balance {
            return MassProperties { mass, ..found };
        }
        let mut principal = SymmetricEigen::new(found.inertia);
        let least = principal.eigenvalues.min();
        principal.eigenvalues.iter_mut().for_each(|moment| *moment = moment.max(self.bound_inertia));
        let moments = principal.eigenvalues;
        if self.balance && 2.0 * moments.max() > moments.sum() * (1.0 + ROUNDING) {
            let inertia = Matrix3::from_diagonal_element(moments.mean());
            return MassProperties { mass, inertia, ..found };
        }
        let inertia = if least < self.bound_inertia { principal.recompose() } else { found.inertia };
        MassProperties { mass, inertia: (inertia + inertia.transpose()) * 0.5, ..found }
    }
}
