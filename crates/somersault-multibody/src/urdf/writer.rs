//! A tree as URDF.

use super::UrdfError;
use crate::joint::Joint;
use crate::link::Link;
use crate::mimic::Mimic;
use crate::model::Model;
use crate::robot::document::shorten;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::fmt::Write;

/// The root hangs on this link unless a [`Base`](super::Base) says how it moves.
const WORLD: &str = "world";

/// The document of a tree; joints are named as the links they carry.
///
/// A root that is fixed at the world's origin, or floats from there, is the root link: reading it back
/// takes the same [`Base`](super::Base). Any other hangs on a massless link `world`. Gravity is not part
/// of the format. Fails for spherical joints, which URDF does not have, and for names that XML
/// cannot hold. What a [`Robot`](crate::robot::Robot) has besides its tree is not written.
pub fn write(model: &Model, name: &str) -> Result<String, UrdfError> {
    let mut out = format!("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n", escaped(name)?);
    let links = model.links();
    for link in links {
        let (parent, floats) = match &link.parent {
            Some(parent) => (parent.as_str(), false),
            None => (WORLD, matches!(link.joint, Joint::Fixed | Joint::Planar | Joint::Free)),
        };
        if !floats || link.origin != Vector3::zeros() || link.orientation != UnitQuaternion::identity() {
            if link.parent.is_none() {
                if links.iter().any(|l| l.name == WORLD) {
                    return Err(unwritable(&link.name, "there is a link `world` already"));
                }
                put(&mut out, format_args!("  <link name=\"{WORLD}\"/>\n"));
            }
            joint(&mut out, link, parent)?;
        }
        body(&mut out, link)?;
    }
    out.push_str("</robot>\n");
    Ok(out)
}

fn unwritable(name: &str, reason: &'static str) -> UrdfError {
    UrdfError::NotRepresentable { element: format!("link `{}`", shorten(name)), reason }
}

/// Writing to a string does not fail.
fn put(out: &mut String, text: std::fmt::Arguments) {
    let _ = out.write_fmt(text);
}

fn joint(out: &mut String, link: &Link, parent: &str) -> Result<(), UrdfError> {
    let (kind, axis) = match link.joint {
        Joint::Fixed => ("fixed", None),
        Joint::Revolute { axis } if link.limits.is_none() => ("continuous", Some(axis)),
        Joint::Revolute { axis } => ("revolute", Some(axis)),
        Joint::Prismatic { axis } => ("prismatic", Some(axis)),
        Joint::Planar => ("planar", Some(Vector3::z())),
        Joint::Free => ("floating", None),
        Joint::Spherical => return Err(unwritable(&link.name, "URDF has no spherical joint")),
    };
    let (name, parent) = (escaped(&link.name)?, escaped(parent)?);
    put(out, format_args!("  <joint name=\"{name}\" type=\"{kind}\">\n"));
    origin(out, &link.origin, &link.orientation);
    put(out, format_args!("    <parent link=\"{parent}\"/>\n    <child link=\"{name}\"/>\n"));
    if let Some(axis) = axis {
        put(out, format_args!("    <axis xyz=\"{}\"/>\n", words(&axis)));
    }
    if matches!(kind, "revolute" | "prismatic") {
        // the format has no word for infinity
        let [lower, upper] =
            link.limits.unwrap_or([-f64::MAX, f64::MAX]).map(|x| x.clamp(-f64::MAX, f64::MAX));
        let most = f64::MAX;
        put(
            out,
            format_args!(
                "    <limit lower=\"{lower:?}\" upper=\"{upper:?}\" effort=\"{most:?}\" velocity=\"{most:?}\"/>\n"
            ),
        );
    }
    if link.damping > 0.0 {
        put(out, format_args!("    <dynamics damping=\"{:?}\"/>\n", link.damping));
    }
    if let Some(Mimic { leader, multiplier, offset }) = link.mimic() {
        let leader = escaped(leader)?;
        put(
            out,
            format_args!(
                "    <mimic joint=\"{leader}\" multiplier=\"{multiplier:?}\" offset=\"{offset:?}\"/>\n"
            ),
        );
    }
    out.push_str("  </joint>\n");
    Ok(())
}

fn body(out: &mut String, link: &Link) -> Result<(), UrdfError> {
    let name = escaped(&link.name)?;
    if link.mass.mass == 0.0 {
        put(out, format_args!("  <link name=\"{name}\"/>\n"));
        return Ok(());
    }
    put(out, format_args!("  <link name=\"{name}\">\n  <inertial>\n"));
    origin(out, &link.mass.center, &UnitQuaternion::identity());
    let i = &link.mass.inertia;
    put(out, format_args!("    <mass value=\"{:?}\"/>\n", link.mass.mass));
    put(out, format_args!("    <inertia ixx=\"{:?}\" ixy=\"{:?}\" ixz=\"{:?}\"", i.m11, i.m12, i.m13));
    put(out, format_args!(" iyy=\"{:?}\" iyz=\"{:?}\" izz=\"{:?}\"/>\n", i.m22, i.m23, i.m33));
    out.push_str("  </inertial>\n  </link>\n");
    Ok(())
}

fn words(v: &Vector3<f64>) -> String {
    format!("{:?} {:?} {:?}", v.x, v.y, v.z)
}

fn origin(out: &mut String, position: &Vector3<f64>, orientation: &UnitQuaternion<f64>) {
    let turn = roll_pitch_yaw(&orientation.to_rotation_matrix().into_inner());
    put(out, format_args!("    <origin xyz=\"{}\" rpy=\"{}\"/>\n", words(position), words(&turn)));
}

/// Angles of R = R_z(yaw) R_y(pitch) R_x(roll). The roll is read after the yaw has been undone, so that
/// the three together are accurate also where each alone is not, at a pitch of ±90°.
fn roll_pitch_yaw(r: &Matrix3<f64>) -> Vector3<f64> {
    let yaw = r.m21.atan2(r.m11);
    let (s, c) = yaw.sin_cos();
    let pitch = (-r.m31).atan2(c * r.m11 + s * r.m21);
    let roll = (s * r.m13 - c * r.m23).atan2(c * r.m22 - s * r.m12);
    Vector3::new(roll, pitch, yaw)
}

/// A name as the value of an attribute.
fn escaped(name: &str) -> Result<String, UrdfError> {
    let mut out = String::with_capacity(name.len());
    for c in name.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '"' => out.push_str("&quot;"),
            '\t' | '\n' | '\r' => put(&mut out, format_args!("&#{};", u32::from(c))),
            '\0'..='\x1f' | '\u{fffe}' | '\u{ffff}' => {
                return Err(unwritable(name, "XML has no such character"));
            }
            _ => out.push(c),
        }
    }
    Ok(out)
}
