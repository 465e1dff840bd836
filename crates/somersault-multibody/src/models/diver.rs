//! Divers: the planar one with 12 degrees of freedom (thesis Table 3.1) and the spatial one with 27
//! (Table 3.2), after Wooten and Hodgins.
//!
//! The torso floats; pelvis and legs, head and arms hang on it. At q = 0 the diver stands at attention
//! with flat feet and faces +x; y is to the left and z up, for the world and for the axes of all bodies.
//! Only the planar diver's bodies have other axes, those of the plane it moves in: x forward, y up,
//! z to the right. Its limbs are pairs: right and left move as one body of twice the mass, whose inertia
//! is that of both about the middle.
//!
//! | Degrees of freedom | | Positive | Range |
//! |---|---|---|---|
//! | `x`, `y`, `z`, `rotation_x`, … | free joint of the torso | | |
//! | `horizontal`, `vertical`, `rotation` | planar joint of the torso | forward; up; backwards, about −y | |
//! | `pelvis_twist` | pelvis against torso, about z | to the left | ±45° |
//! | `pelvis_bend` | then about −y | trunk flexion | −30° to 60° |
//! | `hip` | about −y | flexion | −30° to 140° |
//! | `knee` | about y | flexion | 0° to 155° |
//! | `ankle` | about y | plantar flexion | −30° to 70° |
//! | `toes` | about y | plantar flexion | −60° to 45° |
//! | `neck` | about y | chin to chest | ±60° |
//! | `shoulder`, `shoulder_flexion` | about −y | arm forward and up | −60° to 185° |
//! | `shoulder_abduction` | then about −x right, x left | arm sideways | −30° to 185° |
//! | `shoulder_rotation` | then about the arm, z right, −z left | inwards | ±90° |
//! | `elbow` | about −y | flexion | 0° to 155° |
//! | `wrist` | about −y | flexion | ±85° |
//!
//! Ranges are those of supple athletes, set here so that they hold all [`Posture`]s; they are recorded as
//! limits, not enforced. With an arm straight out sideways (abduction 90°) the first and the third axis
//! of the shoulder coincide and some motion of it moves no mass: dynamics there need the shoulders among
//! the active degrees of freedom, as in a prescribed dive.
//!
//! Segments: P. de Leva, *Adjustments to Zatsiorsky–Seluyanov's segment inertia parameters*, J. Biomech.
//! 29 (1996) 1223–1230, Table 4, male, for 65 kg and 1.70 m. Assumed beside it: the torso is upper and
//! middle trunk and meets the pelvis at the omphalion; half widths of 0.166 m at the shoulders and
//! 0.083 m at the hips; toes with 15 % of the mass and 28 % of the length of the foot; ankles 60 mm in
//! front of the heels; the centre of the head 20 mm forward. Lengths are between centres of joints and
//! do not add up to the height. For another height h and mass m lengths go with h, masses with m and
//! inertias with m h²; [`SegmentScales`] are for bodies of other proportions.

use super::posture::{Posture, PostureError};
use crate::builder::ModelBuilder;
use crate::error::ModelError;
use crate::joint::Joint;
use crate::link::{Link, MassProperties};
use crate::model::Model;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::f64::consts::FRAC_PI_2;

/// Where a diver can move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Dimension {
    /// In the vertical plane through x, limbs in pairs: 12 degrees of freedom.
    Planar,
    /// In space: 27 degrees of freedom.
    Spatial,
}

/// A diver of a given size.
///
/// ```
/// use somersault_multibody::Data;
/// use somersault_multibody::models::{Diver, Posture};
///
/// let diver = Diver { mass: 70.0, height: 1.75, ..Diver::planar() };
/// let model = diver.model()?;
/// let mut data = Data::new(&model);
/// // angular momentum about the centre of mass, per turn of the whole body
/// let mut inertia = |posture| -> Result<f64, Box<dyn std::error::Error>> {
///     let q = diver.configuration(posture)?;
///     Ok(-model.centroidal(&mut data, &q)?.matrix[(4, 2)])
/// };
/// assert!(inertia(Posture::A)? > 3.0 * inertia(Posture::H)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Diver {
    /// In the plane or in space.
    pub dimension: Dimension,
    /// Mass, kg.
    pub mass: f64,
    /// Stature, m.
    pub height: f64,
    /// g, m/s², along −z.
    pub gravity: f64,
    /// Sizes of the segments over those that follow from the height.
    #[cfg_attr(feature = "serde", serde(default))]
    pub segments: SegmentScales,
}

/// Sizes of the segments of a diver over those that follow from its height, both sides alike: along x forward, y outwards and z up as the diver
/// stands. Masses stay. Only a [`BallJointedDiver`](super::BallJointedDiver) with a thorax has an abdomen; of the others it is a part of the torso.
///
/// ```
/// use somersault_multibody::models::{Diver, SegmentScales};
///
/// let segments = SegmentScales::default().with("thigh", [1.05; 3])?.with("torso", [1.0, 1.1, 1.0])?;
/// let diver = Diver { segments, ..Diver::spatial() };
/// assert_eq!(diver.segments.of("left_thigh"), Some([1.05; 3]));
/// # Ok::<(), somersault_multibody::ModelError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SegmentScales([[f64; 3]; 11]);

impl Default for SegmentScales {
    /// As the height has them.
    fn default() -> Self {
        Self([[1.0; 3]; 11])
    }
}

impl SegmentScales {
    /// The segments.
    pub const NAMES: [&str; 11] = [
        "torso",
        "pelvis",
        "thigh",
        "shank",
        "foot",
        "toes",
        "head",
        "upper_arm",
        "forearm",
        "hand",
        "abdomen",
    ];

    /// The scales of a segment, or of a body of the diver that is one; none of what is neither.
    pub fn of(&self, name: &str) -> Option<[f64; 3]> {
        Self::number(name).map(|i| self.0[i])
    }

    /// The same with other scales of a segment; of a model they must be from 0.01 to 100.
    pub fn with(mut self, name: &str, scales: [f64; 3]) -> Result<Self, ModelError> {
        let unknown = || ModelError::UnknownSegment { name: name.to_owned(), known: Self::NAMES.join(", ") };
        self.0[Self::number(name).ok_or_else(unknown)?] = scales;
        Ok(self)
    }

    fn number(name: &str) -> Option<usize> {
        let part = SIDES.iter().find_map(|(side, _)| name.strip_prefix(side)?.strip_prefix('_'));
        let name = part.filter(|part| !IN_THE_MIDDLE.contains(part)).unwrap_or(name);
        Self::NAMES.iter().position(|known| *known == name)
    }
}

/// Segments of which there is one.
const IN_THE_MIDDLE: [&str; 4] = ["torso", "abdomen", "pelvis", "head"];

/// Mass and height to which the table of segments belongs.
const REFERENCE: (f64, f64) = (65.0, 1.70);

/// A segment of the reference diver, standing: SI units, x forward, z up.
pub(super) struct Segment {
    name: &'static str,
    /// Position of its joint in the parent, (x, z).
    joint: [f64; 2],
    /// Distance from the median plane.
    lateral: f64,
    /// −1 where the joint flexes about −y, 1 where it does so about y.
    sense: f64,
    mass: f64,
    /// Centre of mass, (x, z).
    center: [f64; 2],
    /// Principal moments about x, y and z.
    moments: [f64; 3],
    /// Range of the joint, degrees.
    pub(super) range: [f64; 2],
}

const TORSO: Segment = Segment {
    name: "torso",
    joint: [0.0, 0.0],
    lateral: 0.0,
    sense: 1.0,
    mass: 20.9885,
    center: [0.0, 0.22017],
    moments: [0.491442, 0.362711, 0.228296],
    range: [0.0, 0.0],
};

/// The part of the torso above the tip of the breastbone, where it has a joint.
pub(super) const THORAX: Segment = Segment {
    name: "torso",
    joint: [0.0, 0.0],
    lateral: 0.0,
    sense: 1.0,
    mass: 10.374,
    center: [0.0, 0.327064],
    moments: [0.147849, 0.059366, 0.125355],
    range: [0.0, 0.0],
};

/// The part of the torso below it.
pub(super) const ABDOMEN: Segment = Segment {
    name: "abdomen",
    joint: [0.0, 0.210425],
    lateral: 0.0,
    sense: -1.0,
    mass: 10.6145,
    center: [0.0, -0.094733],
    moments: [0.109191, 0.068943, 0.102940],
    range: [-30.0, 45.0],
};

pub(super) const PELVIS: Segment = Segment {
    name: "pelvis",
    joint: [0.0, 0.0],
    lateral: 0.0,
    sense: -1.0,
    mass: 7.2605,
    center: [0.0, -0.087],
    moments: [0.055582, 0.044616, 0.050636],
    range: [-30.0, 60.0],
};

pub(super) const HEAD: Segment = Segment {
    name: "head",
    joint: [0.0, 0.44682],
    lateral: 0.0,
    sense: 1.0,
    mass: 4.511,
    center: [0.01953, 0.11854],
    moments: [0.023298, 0.02518, 0.017287],
    range: [-60.0, 60.0],
};

/// From the pelvis outwards.
pub(super) const LEG: [Segment; 4] = [
    Segment {
        name: "thigh",
        joint: [0.0, -0.14227],
        lateral: 0.083,
        sense: -1.0,
        mass: 9.204,
        center: [0.0, -0.16882],
        moments: [0.169319, 0.169319, 0.034728],
        range: [-30.0, 140.0],
    },
    Segment {
        name: "shank",
        joint: [0.0, -0.41226],
        lateral: 0.083,
        sense: 1.0,
        mass: 2.8145,
        center: [0.0, -0.18895],
        moments: [0.032775, 0.031482, 0.005413],
        range: [0.0, 155.0],
    },
    Segment {
        name: "foot",
        joint: [0.0, -0.42993],
        lateral: 0.083,
        sense: 1.0,
        mass: 0.75693,
        center: [0.03469, -0.04101],
        moments: [0.000807, 0.001677, 0.002061],
        range: [-30.0, 70.0],
    },
    Segment {
        name: "toes",
        joint: [0.12287, -0.06054],
        lateral: 0.083,
        sense: 1.0,
        mass: 0.13357,
        center: [0.03175, 0.0],
        moments: [1.9e-5, 4.2e-5, 4.2e-5],
        range: [-60.0, 45.0],
    },
];

/// From the torso outwards.
pub(super) const ARM: [Segment; 3] = [
    Segment {
        name: "upper_arm",
        joint: [0.0, 0.36109],
        lateral: 0.166,
        sense: -1.0,
        mass: 1.7615,
        center: [0.0, -0.15877],
        moments: [0.010825, 0.009644, 0.003327],
        range: [-60.0, 185.0],
    },
    Segment {
        name: "forearm",
        joint: [0.0, -0.27507],
        lateral: 0.166,
        sense: -1.0,
        mass: 1.053,
        center: [0.0, -0.1201],
        moments: [0.00553, 0.005098, 0.001063],
        range: [0.0, 155.0],
    },
    Segment {
        name: "hand",
        joint: [0.0, -0.26257],
        lateral: 0.166,
        sense: -1.0,
        mass: 0.3965,
        center: [0.0, -0.06649],
        moments: [0.001107, 0.000737, 0.000452],
        range: [-85.0, 85.0],
    },
];

pub(super) const TWIST_RANGE: [f64; 2] = [-45.0, 45.0];
pub(super) const ABDUCTION_RANGE: [f64; 2] = [-30.0, 185.0];
pub(super) const ROTATION_RANGE: [f64; 2] = [-90.0, 90.0];

const PLANAR_NAMES: [&str; 12] = [
    "horizontal",
    "vertical",
    "rotation",
    "pelvis_bend",
    "hip",
    "knee",
    "ankle",
    "toes",
    "neck",
    "shoulder",
    "elbow",
    "wrist",
];

const SPATIAL_NAMES: [&str; 27] = [
    "x",
    "y",
    "z",
    "rotation_x",
    "rotation_y",
    "rotation_z",
    "pelvis_twist",
    "pelvis_bend",
    "right_hip",
    "right_knee",
    "right_ankle",
    "right_toes",
    "left_hip",
    "left_knee",
    "left_ankle",
    "left_toes",
    "neck",
    "right_shoulder_flexion",
    "right_shoulder_abduction",
    "right_shoulder_rotation",
    "right_elbow",
    "right_wrist",
    "left_shoulder_flexion",
    "left_shoulder_abduction",
    "left_shoulder_rotation",
    "left_elbow",
    "left_wrist",
];

pub(super) fn limited(link: Link, degrees: [f64; 2]) -> Link {
    link.with_limits(degrees[0].to_radians(), degrees[1].to_radians())
}

pub(super) fn about(axis: Vector3<f64>) -> Joint {
    Joint::Revolute { axis }
}

impl Diver {
    /// The planar diver of 65 kg and 1.70 m, g = 9.81 m/s².
    pub fn planar() -> Self {
        Self {
            dimension: Dimension::Planar,
            mass: REFERENCE.0,
            height: REFERENCE.1,
            gravity: 9.81,
            segments: SegmentScales::default(),
        }
    }

    /// The spatial diver of 65 kg and 1.70 m, g = 9.81 m/s².
    pub fn spatial() -> Self {
        Self { dimension: Dimension::Spatial, ..Self::planar() }
    }

    /// The names of the degrees of freedom, in the order of v: those of Table 3.1 or 3.2.
    pub fn dof_names(&self) -> &'static [&'static str] {
        match self.dimension {
            Dimension::Planar => &PLANAR_NAMES,
            Dimension::Spatial => &SPATIAL_NAMES,
        }
    }

    /// q with the joints in the given posture and the torso upright, its joint with the pelvis at the
    /// origin. The planar diver has the postures [`Posture::PLANAR`].
    pub fn configuration(&self, posture: Posture) -> Result<Vec<f64>, PostureError> {
        let (base, angles): (&[f64], Vec<f64>) = match self.dimension {
            Dimension::Planar => (&[0.0; 3], posture.planar()?.to_vec()),
            Dimension::Spatial => (&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], posture.spatial().to_vec()),
        };
        Ok(base.iter().copied().chain(angles).collect())
    }

    /// The tree: 10 bodies in the plane; in space 17 with mass and 5 without, between the axes of waist
    /// and shoulders.
    pub fn model(&self) -> Result<Model, ModelError> {
        for (argument, found) in [("mass", self.mass), ("height", self.height)] {
            if !(found > 0.0 && found.is_finite()) {
                return Err(ModelError::NotPositive { name: "diver".into(), argument, found });
            }
        }
        let mut builder = ModelBuilder::new().with_gravity(Vector3::new(0.0, 0.0, -self.gravity));
        let links = match self.dimension {
            Dimension::Planar => self.planar_links(),
            Dimension::Spatial => self.spatial_links(),
        };
        for link in links {
            builder.add(link)?;
        }
        self.scaled(builder.build()?)
    }

    /// A model whose bodies have the names of segments, with the segments of this diver.
    pub(super) fn scaled(&self, model: Model) -> Result<Model, ModelError> {
        let is_given = |name: &&str| self.segments.of(name) != Some([1.0; 3]);
        let mut given = SegmentScales::NAMES.into_iter().filter(is_given).peekable();
        if given.peek().is_none() {
            return Ok(model);
        }
        let has = |segment: &&str| model.links().iter().any(|link| link.name().ends_with(segment));
        if let Some(name) = given.find(|name| !has(name)) {
            let known: Vec<&str> = SegmentScales::NAMES.into_iter().filter(has).collect();
            return Err(ModelError::UnknownSegment { name: name.to_owned(), known: known.join(", ") });
        }
        let scale = |link: &Link| {
            let [x, y, z] = self.segments.of(link.name()).unwrap_or([1.0; 3]);
            match self.dimension {
                Dimension::Planar => Vector3::new(x, z, y),
                Dimension::Spatial => Vector3::new(x, y, z),
            }
        };
        model.scaled(&model.links().iter().map(scale).collect::<Vec<_>>())
    }

    fn planar_links(&self) -> Vec<Link> {
        // from the axes of the standing diver to those of the plane
        let turn = Rotation3::from_axis_angle(&Vector3::x_axis(), -FRAC_PI_2);
        let upright = UnitQuaternion::from_rotation_matrix(&turn.inverse());
        let mut links = vec![Link::root("torso", Joint::Planar, self.pair(&TORSO)).turned(upright)];
        let mut chain = |segments: &[Segment]| {
            let mut parent = if segments[0].name == "thigh" { "pelvis" } else { "torso" };
            for segment in segments {
                let joint = about(Vector3::z() * -segment.sense);
                let at = Vector3::new(segment.joint[0], segment.joint[1], 0.0) * self.stretch();
                let link = Link::child(segment.name, parent, joint, self.pair(segment)).at(at);
                links.push(limited(link, segment.range));
                parent = segment.name;
            }
        };
        chain(&[PELVIS]);
        chain(&LEG);
        chain(&[HEAD]);
        chain(&ARM);
        links
    }

    fn spatial_links(&self) -> Vec<Link> {
        let mut links = vec![Link::root("torso", Joint::Free, self.single(&TORSO))];
        let waist = Link::child("waist", "torso", about(Vector3::z()), MassProperties::massless());
        links.push(limited(waist, TWIST_RANGE));
        links.push(self.hinge("pelvis".into(), "waist".into(), &PELVIS, Vector3::zeros()));
        for (side, sign) in SIDES {
            let mut parent = "pelvis".to_owned();
            for (k, segment) in LEG.iter().enumerate() {
                let name = format!("{side}_{}", segment.name);
                let y = if k == 0 { sign * segment.lateral } else { 0.0 };
                links.push(self.hinge(name.clone(), parent, segment, self.joint_of(segment, y)));
                parent = name;
            }
        }
        links.push(self.hinge("head".into(), "torso".into(), &HEAD, self.joint_of(&HEAD, 0.0)));
        for (side, sign) in SIDES {
            self.arm(side, sign, &mut links);
        }
        links
    }

    fn arm(&self, side: &str, sign: f64, links: &mut Vec<Link>) {
        let [upper_arm, forearm, hand] = &ARM;
        let name = |part: &str| format!("{side}_{part}");
        let massless = |part: &str, parent: String, axis| {
            Link::child(name(part), parent, about(axis), MassProperties::massless())
        };
        let flexion = massless("shoulder_flexion", "torso".into(), -Vector3::y())
            .at(self.joint_of(upper_arm, sign * upper_arm.lateral));
        let abduction = massless("shoulder_abduction", name("shoulder_flexion"), Vector3::x() * sign);
        let rotation = Link::child(
            name("upper_arm"),
            name("shoulder_abduction"),
            about(Vector3::z() * -sign),
            self.single(upper_arm),
        );
        links.push(limited(flexion, upper_arm.range));
        links.push(limited(abduction, ABDUCTION_RANGE));
        links.push(limited(rotation, ROTATION_RANGE));
        for (segment, parent) in [(forearm, "upper_arm"), (hand, "forearm")] {
            let at = self.joint_of(segment, 0.0);
            links.push(self.hinge(name(segment.name), name(parent), segment, at));
        }
    }

    /// A segment of the spatial diver on its joint about the lateral axis.
    fn hinge(&self, name: String, parent: String, segment: &Segment, at: Vector3<f64>) -> Link {
        let joint = about(Vector3::y() * segment.sense);
        limited(Link::child(name, parent, joint, self.single(segment)).at(at), segment.range)
    }

    /// Position of a joint in the parent, `y` to the left.
    pub(super) fn joint_of(&self, segment: &Segment, y: f64) -> Vector3<f64> {
        Vector3::new(segment.joint[0], y, segment.joint[1]) * self.stretch()
    }

    /// Lengths of this diver over those of the reference.
    fn stretch(&self) -> f64 {
        self.height / REFERENCE.1
    }

    pub(super) fn single(&self, segment: &Segment) -> MassProperties {
        let mass = segment.mass * (self.mass / REFERENCE.0);
        let scale = self.mass / REFERENCE.0 * self.stretch().powi(2);
        MassProperties {
            mass,
            center: Vector3::new(segment.center[0], 0.0, segment.center[1]) * self.stretch(),
            inertia: Matrix3::from_diagonal(&Vector3::from(segment.moments)) * scale,
        }
    }

    /// In the axes of the plane, right and left together where there are two.
    fn pair(&self, segment: &Segment) -> MassProperties {
        let MassProperties { mass, center, inertia } = self.single(segment);
        let count = if segment.lateral > 0.0 { 2.0 } else { 1.0 };
        let shift = mass * (segment.lateral * self.stretch()).powi(2);
        let moments = Vector3::new(inertia.m11 + shift, inertia.m33 + shift, inertia.m22) * count;
        MassProperties {
            mass: mass * count,
            center: Vector3::new(center.x, center.z, 0.0),
            inertia: Matrix3::from_diagonal(&moments),
        }
    }
}

/// Name and sign of y.
pub(super) const SIDES: [(&str, f64); 2] = [("right", -1.0), ("left", 1.0)];
