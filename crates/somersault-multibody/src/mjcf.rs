//! Trees from MJCF, the format of MuJoCo.
//!
//! Read are bodies with their inertial or with the inertia of their geoms, joints of all types with position, axis, reference, range and
//! damping, frames, classes of defaults, included files, constraints between two joints, and geoms. A body has its name in the
//! document; q follows the joints as `qpos` does, depth first in the order of the document, but quaternions are
//! stored x, y, z, w, and velocities of free joints are in body axes. [`Robot::reference`](crate::robot::Robot::reference) is
//! `qpos0`.
//!
//! | MJCF | Here |
//! |---|---|
//! | hinge, slide, ball, free | [`Joint`](crate::Joint) `Revolute`, `Prismatic`, `Spherical`, `Free` |
//! | several joints in a body, or one whose `pos` is not zero | massless bodies in between, with the names of the joints |
//! | `ref`, `range`, `damping` | the coordinate in the reference configuration, limits, damping |
//! | `<equality><joint>` with a linear `polycoef` | [`Mimic`](crate::Mimic): exact, where MuJoCo has a spring |
//! | the same without `joint2` | a fixed joint |
//! | several bodies in the world | children of a body `world` |
//! | body without mass | massless |
//! | bodies and joints without name | `body 3`, with the number that MuJoCo gives it; `thigh joint 2` |
//! | `<geom>` | [`Geometry`], to be seen where `contype` and `conaffinity` are 0; planes, height fields and what is fitted to a mesh are not kept |
//! | `<option gravity>` | gravity of the model, unless [`MjcfOptions::gravity`] is given |
//! | `<compiler>` | respected, or refused: global coordinates and free joints that are aligned |
//!
//! The inertia of spheres, capsules, cylinders, boxes and ellipsoids is that of the solid. Meshes are not opened: a body that moves and
//! has the mass of one needs an inertial.
//!
//! Two lists say what of the document the tree has not. [`Robot::repairs`](crate::robot::Robot::repairs) has, as for
//! [URDF](crate::urdf), inertias that no distribution of mass has and joints that move no mass.
//! [`Robot::ignored`](crate::robot::Robot::ignored) has what acts on the tree: springs, dry friction and rotors of joints, other
//! constraints, tendons, fluids, compensated gravity, attributes that are not known; and what is done to it or measured of it:
//! contacts, actuators, sensors, keyframes. With [`MjcfOptions::strict`] repairs and what acts on the tree by
//! itself are refused.
//!
//! Documents may come from anywhere: what [URDF](crate::urdf) guards against is guarded against here. Only files in the folder of
//! the document, or in one below it, are included ([`MjcfFiles`]), each once, and none by [`read`]. Cost O(n) in the length of the
//! document.
//!
//! ```
//! use somersault_multibody::{Data, mjcf};
//!
//! let text = r#"<mujoco model="pendulum">
//!   <worldbody>
//!     <body name="rod">
//!       <joint type="hinge" axis="0 1 0"/>
//!       <geom type="sphere" size="0.1" mass="2" pos="0 0 -1"/>
//!     </body>
//!   </worldbody>
//! </mujoco>"#;
//! let model = mjcf::read(text, &mjcf::MjcfOptions::default())?.model;
//! let m = model.mass_matrix(&mut Data::new(&model), &[0.0])?[(0, 0)];
//! assert!((m - 2.008).abs() < 1e-15);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod assets;
mod body;
mod compiler;
mod defaults;
mod equality;
mod error;
mod geom;
mod joint;
mod library;
mod parts;
mod report;

use crate::robot::assembly::{assemble, possible};
use crate::robot::document::Element;
use crate::robot::findings::Findings;
use crate::robot::{Geometry, Robot};
use assets::Meshes;
use body::{Settings, World};
use compiler::{Compiler, Physics};
use defaults::{Defaults, Styled};
use geom::Geom;
use library::{Documents, Library};
use nalgebra::Vector3;
use parts::Parts;
use report::Report;
use std::collections::BTreeMap;

pub use error::MjcfError;
pub use library::MjcfFiles;

/// What a document does not say.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MjcfOptions {
    /// Gravitational acceleration, m/s², world axes, in the place of that of the document.
    pub gravity: Option<Vector3<f64>>,
    /// Refuses what else would be repaired, and what acts on the tree and would be ignored.
    pub strict: bool,
}

/// Sections of a document that act on a tree from outside, or measure it, with what is said of them.
const OUTSIDE: [(&str, &str); 6] = [
    ("contact", "contacts are no part of a tree"),
    ("actuator", "actuators are not read: joint forces are an argument"),
    ("sensor", "sensors are not read"),
    ("keyframe", "keyframes are not read"),
    ("deformable", "deformable bodies are not read"),
    ("extension", "plugins are not read"),
];

/// Sections that say nothing of the motion.
const WITHOUT_EFFECT: [&str; 4] = ["size", "visual", "statistic", "custom"];

/// What else defaults may be given for: read where it is used, or of elements that are not read.
const OF_DEFAULTS: [&str; 20] = [
    "mesh",
    "equality",
    "tendon",
    "pair",
    "site",
    "camera",
    "light",
    "material",
    "texture",
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
    "dcmotor",
    "plugin",
];

/// Attributes of a tendon that make it act by itself.
const OF_TENDONS: [&str; 5] = ["stiffness", "damping", "frictionloss", "armature", "springlength"];

/// The robot of an MJCF document that includes no files.
pub fn read(text: &str, options: &MjcfOptions) -> Result<Robot, MjcfError> {
    MjcfFiles { text: text.to_owned(), included: BTreeMap::new() }.read(options)
}

impl MjcfFiles {
    /// The robot of the document.
    pub fn read(&self, options: &MjcfOptions) -> Result<Robot, MjcfError> {
        let documents = Documents::parse(self)?;
        let library = Library::new(&documents)?;
        let included = self.included.iter().map(|(file, text)| (Some(file.as_str()), text.as_str()));
        let files = std::iter::once((None, self.text.as_str())).chain(included);
        let mut report = Report { strict: options.strict, findings: Findings::new(files) };
        let (root, sections) = (library.root(), library.children(&library.root()));
        let compiler = Compiler::read(&sections, &mut report)?;
        let physics = Physics::read(&sections, |section| library.children(section), &mut report)?;
        let defaults = Defaults::read(&sections, &library)?;
        for element in defaults.elements() {
            match element.tag() {
                "joint" => report.check_attributes(element, &[&joint::READ, &joint::WITHOUT_EFFECT])?,
                "geom" => report.check_attributes(element, &[&geom::READ, &geom::WITHOUT_EFFECT])?,
                tag if OF_DEFAULTS.contains(&tag) => {}
                _ => return Err(MjcfError::unknown_element(element, "default")),
            }
        }
        let meshes = Meshes::read(&sections, &library, &defaults)?;
        let settings =
            Settings { library: &library, defaults: &defaults, compiler: &compiler, meshes: &meshes };
        let world = World::read(&sections, &settings, &mut report)?;
        if world.bodies.is_empty() {
            return Err(MjcfError::NoBody);
        }
        let mut masses = world.masses(&compiler, &mut report)?;
        for (mass, body) in masses.iter_mut().zip(&world.bodies) {
            *mass = possible(*mass, &body.element, options.strict, &mut report.findings);
        }
        let mut parts = Parts::new(&root, &world.bodies, &masses, &physics)?;
        if physics.coupled {
            equality::couple(&mut parts, &sections, &library, &defaults, &mut report)?;
        }
        leave_out(&sections, &library, &defaults, &mut report)?;

        let gravity = options.gravity.unwrap_or(physics.gravity);
        let (model, numbers) =
            assemble(&root, &mut parts.list, gravity, options.strict, &mut report.findings)?;
        let mut reference = model.neutral();
        for (part, &body) in numbers.iter().enumerate() {
            let place = model.positions_of(body);
            if !place.is_empty() {
                reference[place].copy_from_slice(parts.reference(part));
            }
        }
        let joints = parts.named.iter().map(|&(name, part)| (name.to_owned(), numbers[part])).collect();
        let mut geometry: Vec<Geometry> = world.geoms.iter().filter_map(|geom| kept(geom, None)).collect();
        for (body, &part) in world.bodies.iter().zip(&parts.of_bodies) {
            geometry.extend(body.geoms.iter().filter_map(|geom| kept(geom, Some(numbers[part]))));
        }
        let Findings { repairs, ignored, .. } = report.findings;
        let name = root.name.unwrap_or_default().to_owned();
        Ok(Robot { name, model, reference, joints, repairs, ignored, geometry })
    }
}

fn kept(geom: &Geom, body: Option<usize>) -> Option<Geometry> {
    Some(Geometry {
        body,
        purpose: geom.purpose,
        name: geom.element.own.name.map(str::to_owned),
        position: geom.pose.position,
        orientation: geom.pose.orientation,
        shape: geom.shape()?.clone(),
    })
}

/// Lists the sections that are not read, and tendons.
fn leave_out<'a>(
    sections: &[Element<'a>],
    library: &Library<'a>,
    defaults: &'a Defaults<'a>,
    report: &mut Report<'a>,
) -> Result<(), MjcfError> {
    for section in sections {
        let tag = section.tag();
        if tag == "tendon" {
            for tendon in library.children(section) {
                let styled: Styled = defaults.styled(tendon, "tendon", defaults::MAIN)?;
                let acts = |attribute: &&'static str| {
                    Ok::<_, MjcfError>(styled.overlaid(attribute, [0.0; 8])?.iter().any(|x| *x != 0.0))
                };
                let reason = "tendons are not read";
                let acting = OF_TENDONS.iter().map(acts).collect::<Result<Vec<_>, _>>()?;
                match acting.contains(&true) {
                    true => report.acts(&tendon, reason)?,
                    false => report.ignore(&tendon, reason),
                }
            }
        } else if let Some((_, reason)) = OUTSIDE.iter().find(|(outside, _)| *outside == tag) {
            let count = library.children(section).len();
            if count > 0 {
                report.ignore(section, format!("{reason} ({count})"));
            }
        } else if !WITHOUT_EFFECT.contains(&tag)
            && !["compiler", "option", "default", "asset", "worldbody", "equality"].contains(&tag)
        {
            return Err(MjcfError::unknown_element(section, "mujoco"));
        }
    }
    Ok(())
}
