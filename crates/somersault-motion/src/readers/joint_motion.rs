//! Motions in the format of DeepMimic: JSON with `Frames` of 44 numbers each.
//!
//! A frame is its duration, s; the position of the root, m, y up; and quaternions (w, x, y, z) or angles, rad:
//!
//! | Numbers | Joint |
//! |---|---|
//! | 1; 3; 4 | duration; position and rotation of the root |
//! | 4; 4 | chest; neck |
//! | 4; 1; 4 | right hip; right knee, about the lateral axis; right ankle |
//! | 4; 1 | right shoulder; right elbow, about the lateral axis |
//! | 4; 1; 4; 4; 1 | the same joints of the left side |
//!
//! **The recordings carry no lengths of segments.** They are those of a [`Diver`] of the caller's size, from
//! the segment table it cites. The root is the middle between the hips. Ends are the centre of mass of the
//! head, the wrists and the roots of the toes. Frame i is at the sum of the durations before it.
//!
//! Quaternions of such files were blended number by number: norms down to 0.81 occur in those that come with
//! DeepMimic, which brings them to one as this reader does. Norms outside of 0.5 to 2 are refused.
//!
//! Source: X. B. Peng, P. Abbeel, S. Levine and M. van de Panne, *DeepMimic*, ACM Trans. Graph. 37 (2018), 143.

use super::{Place, ReadError, unexpected};
use crate::recording::{Convention, LengthUnit, RecordingError, Skeleton, SkeletonJoint, SkeletonRecording};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
use somersault_multibody::models::{Dimension, Diver};

/// Numbers in a frame.
pub(crate) const WIDTH: usize = 44;
/// Where quaternions begin, in the order of the joints that turn, and where single angles stand.
pub(crate) const TURNS: [Turn; 13] = [
    Turn::Quaternion(4),
    Turn::Quaternion(8),
    Turn::Quaternion(12),
    Turn::Quaternion(16),
    Turn::Angle(20),
    Turn::Quaternion(21),
    Turn::Quaternion(25),
    Turn::Angle(29),
    Turn::Quaternion(30),
    Turn::Angle(34),
    Turn::Quaternion(35),
    Turn::Quaternion(39),
    Turn::Angle(43),
];

#[derive(Clone, Copy)]
pub(crate) enum Turn {
    Quaternion(usize),
    Angle(usize),
}

#[derive(serde::Deserialize)]
struct File {
    #[serde(rename = "Frames")]
    frames: Vec<Frame>,
}

/// The numbers of a frame, checked where the parser knows its line.
struct Frame([f64; WIDTH]);

impl<'de> Deserialize<'de> for Frame {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Numbers;
        impl<'de> Visitor<'de> for Numbers {
            type Value = Frame;

            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                write!(f, "a frame of {WIDTH} numbers")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Frame, A::Error> {
                let mut numbers = [0.0; WIDTH];
                for (i, number) in numbers.iter_mut().enumerate() {
                    *number = sequence.next_element()?.ok_or_else(|| A::Error::invalid_length(i, &self))?;
                }
                if sequence.next_element::<f64>()?.is_some() {
                    return Err(A::Error::custom(format!("more numbers than a frame of {WIDTH}")));
                }
                if numbers[0] < 0.0 {
                    return Err(A::Error::custom(format!("duration {} s, allowed is 0 or more", numbers[0])));
                }
                for turn in TURNS {
                    if let Turn::Quaternion(at) = turn {
                        let norm = numbers[at..at + 4].iter().fold(0.0_f64, |norm, x| norm.hypot(*x));
                        if !(0.5..=2.0).contains(&norm) {
                            let message =
                                format!("quaternion at number {at} of norm {norm}, allowed is 0.5 to 2");
                            return Err(A::Error::custom(message));
                        }
                    }
                }
                Ok(Frame(numbers))
            }
        }
        deserializer.deserialize_seq(Numbers)
    }
}

/// The recording in `text`, with the lengths of `diver`.
pub fn read(text: &str, diver: &Diver) -> Result<SkeletonRecording, ReadError> {
    let file: File = serde_json::from_str(text).map_err(|error| {
        let place = Place::Line(error.line());
        let allowed = format!("an object with Frames of {WIDTH} numbers each");
        match error.classify() {
            serde_json::error::Category::Eof => ReadError::Truncated { place, allowed },
            _ => unexpected(place, &error.to_string(), allowed),
        }
    })?;
    if file.frames.is_empty() {
        return Err(ReadError::NoFrames { place: Place::Line(1) });
    }
    let convention = Convention::y_up_x_forward(LengthUnit::Metre);
    let (mut times, mut rotations, mut places) = (Vec::new(), Vec::new(), Vec::new());
    let mut time = 0.0;
    for Frame(numbers) in &file.frames {
        times.push(time);
        time += numbers[0];
        places.push(convention.position(&Vector3::new(numbers[1], numbers[2], numbers[3])));
        rotations.extend(TURNS.map(|turn| {
            let rotation = match turn {
                Turn::Quaternion(at) => UnitQuaternion::new_normalize(Quaternion::new(
                    numbers[at],
                    numbers[at + 1],
                    numbers[at + 2],
                    numbers[at + 3],
                )),
                Turn::Angle(at) => UnitQuaternion::from_axis_angle(&Vector3::z_axis(), numbers[at]),
            };
            convention.rotation(&rotation)
        }));
    }
    let skeleton = skeleton(diver)?;
    Ok(SkeletonRecording::try_new(skeleton, times, rotations, places)?)
}

/// The joints of the format with the lengths of a diver, whose axes are those of the world.
fn skeleton(diver: &Diver) -> Result<Skeleton, RecordingError> {
    let model = Diver { dimension: Dimension::Spatial, ..*diver }.model()?;
    let link = |name: &str| model.links().iter().find(|link| link.name() == name);
    let origin = |name: &str| link(name).map_or(Vector3::zeros(), |link| *link.origin());
    let mut joints: Vec<SkeletonJoint> = Vec::new();
    let mut add = |name: String, parent: Option<usize>, offset: Vector3<f64>, turns: bool| {
        joints.push(SkeletonJoint { name, parent, offset, turns, moves: parent.is_none() });
        joints.len() - 1
    };
    let root = add("root".into(), None, Vector3::zeros(), true);
    // the chest turns where torso and pelvis of the diver meet
    let waist = -origin("right_thigh").z;
    let chest = add("chest".into(), Some(root), Vector3::new(0.0, 0.0, waist), true);
    let neck = add("neck".into(), Some(chest), origin("head"), true);
    let head = link("head").map_or(Vector3::zeros(), |link| link.mass_properties().center);
    add("head".into(), Some(neck), head, false);
    for side in ["right", "left"] {
        let of = |segment: &str| origin(&format!("{side}_{segment}"));
        let name = |joint: &str| format!("{side}_{joint}");
        let hip = Vector3::new(of("thigh").x, of("thigh").y, 0.0);
        let hip = add(name("hip"), Some(root), hip, true);
        let knee = add(name("knee"), Some(hip), of("shank"), true);
        let ankle = add(name("ankle"), Some(knee), of("foot"), true);
        add(name("toes"), Some(ankle), of("toes"), false);
        let shoulder = add(name("shoulder"), Some(chest), of("shoulder_flexion"), true);
        let elbow = add(name("elbow"), Some(shoulder), of("forearm"), true);
        add(name("wrist"), Some(elbow), of("hand"), false);
    }
    Skeleton::try_new(joints)
}
