//! A diver with ball joints, for recordings of people: legs spread and turn, and trunk and head lean.

use super::diver::{
    ABDOMEN, ABDUCTION_RANGE, ARM, Diver, HEAD, LEG, PELVIS, ROTATION_RANGE, SIDES, SegmentScales, THORAX,
    TWIST_RANGE, about, limited,
};
use super::posture::Posture;
use crate::builder::ModelBuilder;
use crate::error::ModelError;
use crate::joint::Joint;
use crate::link::{Link, MassProperties};
use crate::model::Model;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3, Vector4};
use somersault_core::argument::{expect_finite, expect_length};
use std::f64::consts::{PI, TAU};

/// The spatial diver with balls in the place of the hinges of waist, neck, hips and shoulders: 17 bodies with 34 degrees of freedom.
///
/// Bodies, their axes and their masses are those of [`Diver::spatial`]; knees, ankles, toes, elbows and wrists are its hinges, with their limits. Balls have
/// none.
///
/// [With a thorax](Self::with_thorax) the trunk bends and leans at the tip of the breastbone too, by two hinges with limits: 18 bodies with mass and 36 degrees
/// of freedom. The body `torso` then is the thorax alone, with the head and the arms, and between it and the pelvis is the body `abdomen`. Upper and middle trunk
/// of de Leva's table together are the torso of the other divers, so that at q = 0 all points and all mass are where they are without a thorax; the axes of
/// `torso` are the same, with the origin at the omphalion of the straight trunk. The trunk twists at the waist only: markers on thorax and pelvis do not tell
/// where between them it does.
///
/// | Ball | Angles, one after the other | Positive |
/// |---|---|---|
/// | waist | `pelvis_twist`, `pelvis_bend`, `pelvis_lean` about z, −y, x | of the pelvis: to the left, trunk flexion, … |
/// | neck | `neck`, `neck_lean`, `neck_turn` about y, x, z | chin to chest, to the right, to the left |
/// | hips | `hip`, `hip_abduction`, `hip_rotation` about −y, then −x right or x left, then z right or −z left | flexion, sideways, inwards |
/// | shoulders | `shoulder_flexion`, `shoulder_abduction`, `shoulder_rotation` about the same axes | forward and up, sideways, inwards |
/// | *hinges below a thorax* | `abdomen_bend`, `abdomen_lean` about −y, x | of the abdomen: as of the waist |
///
/// ```
/// use somersault_multibody::models::{BallJointedDiver, Diver, Posture};
///
/// let diver = BallJointedDiver::new(Diver::spatial());
/// let pike = diver.configuration(Posture::H)?;
/// let angles = diver.angles(&pike)?;
/// let (_, hip) = angles.iter().find(|(name, _)| name == "right_hip").unwrap();
/// assert!((hip[0].to_degrees() - 120.0).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BallJointedDiver {
    /// Its size; the dimension is not looked at.
    pub size: Diver,
    /// Whether the thorax moves against the abdomen.
    pub has_thorax: bool,
}

/// A ball: the body it carries, names of its angles, the axes about which these turn one after the other, and usual ranges, degrees.
struct Ball {
    body: String,
    angles: [String; 3],
    axes: [Vector3<f64>; 3],
    ranges: [[f64; 2]; 3],
}

impl BallJointedDiver {
    /// One whose torso is rigid.
    pub fn new(size: Diver) -> Self {
        Self { size, has_thorax: false }
    }

    /// The same with joints between thorax and abdomen.
    pub fn with_thorax(self) -> Self {
        Self { has_thorax: true, ..self }
    }

    /// The tree.
    pub fn model(&self) -> Result<Model, ModelError> {
        let diver = self.spatial();
        let hinged = Diver { segments: SegmentScales::default(), ..diver }.model()?;
        let mut builder = ModelBuilder::new().with_gravity(*hinged.gravity());
        let balls = balls();
        let (thorax, abdomen) = (diver.single(&THORAX), diver.single(&ABDOMEN));
        let tip = diver.joint_of(&ABDOMEN, 0.0);
        for (i, link) in hinged.links().iter().enumerate() {
            if link.mass_properties().mass == 0.0 {
                continue;
            }
            let link = on_ball(&hinged, i, link, &balls);
            match link.name() {
                "torso" if self.has_thorax => {
                    builder.add(Link::root("torso", Joint::Free, thorax))?;
                    let bend = Link::child(
                        "abdomen_bend",
                        "torso",
                        about(-Vector3::y()),
                        MassProperties::massless(),
                    );
                    builder.add(limited(bend.at(tip), ABDOMEN.range))?;
                    let lean = Link::child("abdomen", "abdomen_bend", about(Vector3::x()), abdomen);
                    builder.add(limited(lean, LEAN_RANGE))?;
                }
                "pelvis" if self.has_thorax => {
                    let origin = link.origin() - tip;
                    builder.add(link.carried_by("abdomen").at(origin))?;
                }
                _ => {
                    builder.add(link)?;
                }
            }
        }
        diver.scaled(builder.build()?)
    }

    /// q with the joints in a posture and the torso upright, its joint with the pelvis at the origin, and the abdomen in line with the thorax.
    pub fn configuration(&self, posture: Posture) -> Result<Vec<f64>, ModelError> {
        let hinged = Diver::spatial().model()?;
        let balls = balls();
        let mut q = vec![0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        if self.has_thorax {
            q.extend([0.0; 2]);
        }
        // what frames without mass turned
        let mut turned = UnitQuaternion::identity();
        for (link, angle) in hinged.links()[1..].iter().zip(posture.spatial()) {
            if let Joint::Revolute { axis } = link.joint() {
                turned *= UnitQuaternion::new(axis * angle);
            }
            if link.mass_properties().mass > 0.0 {
                if balls.iter().any(|ball| ball.body == link.name()) {
                    q.extend(turned.coords.iter());
                } else {
                    q.push(angle);
                }
                turned = UnitQuaternion::identity();
            }
        }
        Ok(q)
    }

    /// The names of the degrees of freedom, in the order of v: of a ball those of its body with `_x`, `_y` and `_z`, about whose axes it
    /// turns.
    pub fn dof_names(&self) -> Result<Vec<String>, ModelError> {
        let model = self.model()?;
        let root = &self.spatial().dof_names()[..6];
        let mut names: Vec<String> = root.iter().map(|name| (*name).to_owned()).collect();
        let angles = angle_names(&model);
        for ((link, own), ball) in model.links()[1..].iter().zip(angles).zip(balls_of(&model)) {
            match ball {
                Some(_) => names.extend(["x", "y", "z"].map(|axis| format!("{}_{axis}", link.name()))),
                None => names.extend(own),
            }
        }
        Ok(names)
    }

    /// The angles of the joints, rad, by their names, in each of some configurations that `q` has one after the other. Of the two triples that make the rotation
    /// of a ball, that one is given which people reach. Where the second angle is ±90° the first and the third are about one axis, and the third is
    /// taken as zero.
    pub fn angles(&self, q: &[f64]) -> Result<Vec<(String, Vec<f64>)>, ModelError> {
        let model = self.model()?;
        let width = model.n_positions();
        expect_length("q", q.len(), q.len().next_multiple_of(width))?;
        expect_finite("q", q)?;
        let mut found = Vec::with_capacity(model.n_velocities());
        let names = angle_names(&model);
        for ((i, names), ball) in (1..model.n_bodies()).zip(names).zip(balls_of(&model)) {
            let of_joint = |row: &[f64]| -> [f64; 3] {
                let own = &row[model.positions_of(i)];
                match &ball {
                    Some(ball) => {
                        let turn = Quaternion::from_vector(Vector4::from_column_slice(own));
                        ball.angles_of(&UnitQuaternion::new_normalize(turn))
                    }
                    None => [own[0], 0.0, 0.0],
                }
            };
            let rows: Vec<[f64; 3]> = q.chunks_exact(width).map(of_joint).collect();
            let of_name = |(k, name)| (name, rows.iter().map(|angles| angles[k]).collect());
            found.extend(names.into_iter().enumerate().map(of_name));
        }
        Ok(found)
    }

    fn spatial(&self) -> Diver {
        Diver { dimension: super::Dimension::Spatial, ..self.size }
    }
}

fn balls() -> Vec<Ball> {
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let ball = |body: &str, angles: [&str; 3], axes, ranges| Ball {
        body: body.to_owned(),
        angles: angles.map(str::to_owned),
        axes,
        ranges,
    };
    let waist = [TWIST_RANGE, PELVIS.range, LEAN_RANGE];
    let neck = [HEAD.range, [-45.0, 45.0], [-90.0, 90.0]];
    let mut all = vec![
        ball("pelvis", ["pelvis_twist", "pelvis_bend", "pelvis_lean"], [z, -y, x], waist),
        ball("head", ["neck", "neck_lean", "neck_turn"], [y, x, z], neck),
    ];
    let of_hip = [LEG[0].range, [-30.0, 90.0], [-60.0, 60.0]];
    let of_shoulder = [ARM[0].range, ABDUCTION_RANGE, ROTATION_RANGE];
    for (side, sign) in SIDES {
        let axes = [-y, x * sign, z * -sign];
        let named = |names: [&str; 3]| names.map(|name| format!("{side}_{name}"));
        let hip = named(["hip", "hip_abduction", "hip_rotation"]);
        let shoulder = named(["shoulder_flexion", "shoulder_abduction", "shoulder_rotation"]);
        all.push(Ball { body: format!("{side}_thigh"), angles: hip, axes, ranges: of_hip });
        all.push(Ball { body: format!("{side}_upper_arm"), angles: shoulder, axes, ranges: of_shoulder });
    }
    all
}

/// For each body but the root the ball that carries it.
fn balls_of(model: &Model) -> Vec<Option<Ball>> {
    let of = |link: &Link| balls().into_iter().find(|ball| ball.body == link.name());
    model.links()[1..].iter().map(of).collect()
}

/// For each body but the root the names of the angles of its joint.
fn angle_names(model: &Model) -> Vec<Vec<String>> {
    let hinge = |body: &str| match body {
        body if body.ends_with("shank") => body.replace("shank", "knee"),
        body if body.ends_with("foot") => body.replace("foot", "ankle"),
        body if body.ends_with("forearm") => body.replace("forearm", "elbow"),
        body if body.ends_with("hand") => body.replace("hand", "wrist"),
        "abdomen" => "abdomen_lean".to_owned(),
        body => body.to_owned(),
    };
    let of = |(link, ball): (&Link, Option<Ball>)| match ball {
        Some(ball) => ball.angles.to_vec(),
        None => vec![hinge(link.name())],
    };
    model.links()[1..].iter().zip(balls_of(model)).map(of).collect()
}

/// A segment on the joint it has here, below the next segment with mass.
fn on_ball(hinged: &Model, i: usize, link: &Link, balls: &[Ball]) -> Link {
    let mass = *link.mass_properties();
    let mut origin = *link.origin();
    // the axes of a joint of several hinges are at one place
    let mut above = hinged.parent(i);
    while let Some(frame) = above.filter(|i| hinged.links()[*i].mass_properties().mass == 0.0) {
        origin += hinged.links()[frame].origin();
        above = hinged.parent(frame);
    }
    let Some(parent) = above else {
        return Link::root(link.name(), Joint::Free, mass);
    };
    let is_ball = balls.iter().any(|ball| ball.body == link.name());
    let joint = if is_ball { Joint::Spherical } else { *link.joint() };
    let made = Link::child(link.name(), hinged.links()[parent].name(), joint, mass).at(origin);
    match link.limits().filter(|_| !is_ball) {
        Some([lower, upper]) => made.with_limits(lower, upper),
        None => made,
    }
}

impl Ball {
    /// The angles about its axes, one after the other, that make a rotation.
    fn angles_of(&self, turn: &UnitQuaternion<f64>) -> [f64; 3] {
        let handed = Matrix3::from_columns(&self.axes).determinant().signum();
        let basis = Matrix3::from_columns(&[self.axes[0], self.axes[1], self.axes[2] * handed]);
        let r = basis.transpose() * turn.to_rotation_matrix().matrix() * basis;
        let second = r.m13.clamp(-1.0, 1.0).asin();
        if r.m11.hypot(r.m12) < COINCIDE {
            return [r.m32.atan2(r.m22), second, 0.0];
        }
        let near = [(-r.m23).atan2(r.m33), second, handed * (-r.m12).atan2(r.m11)];
        let far = [near[0] + PI, PI - second, near[2] + PI];
        let [near, far] = [near, far].map(|angles| self.nearest_turns(angles));
        if self.beyond(&far) < self.beyond(&near) { far } else { near }
    }

    /// The same angles without the whole turns that lead away from the middles of the ranges.
    fn nearest_turns(&self, angles: [f64; 3]) -> [f64; 3] {
        let middle = |k: usize| 0.5 * (self.ranges[k][0] + self.ranges[k][1]).to_radians();
        [0, 1, 2].map(|k| angles[k] - TAU * ((angles[k] - middle(k)) / TAU).round())
    }

    /// How far angles are beyond their ranges, together, rad.
    fn beyond(&self, angles: &[f64; 3]) -> f64 {
        let of = |(angle, range): (&f64, &[f64; 2])| {
            let [lower, upper] = range.map(f64::to_radians);
            (angle - angle.clamp(lower, upper)).abs()
        };
        angles.iter().zip(&self.ranges).map(of).sum()
    }
}

/// Degrees.
const LEAN_RANGE: [f64; 2] = [-45.0, 45.0];
/// Cosine of the second angle at which the first axis and the third are one.
const COINCIDE: f64 = 1e-9;
