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

use super::{Format, Place, ReadError, Recording, decoded, shorten};
use crate::recording::{Axis, Convention, LengthUnit, Skeleton, SkeletonJoint, SkeletonRecording};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::de::{Deserialize, DeserializeSeed, Deserializer, Error, SeqAccess, Visitor};
use somersault_multibody::ModelError;
use somersault_multibody::models::{Dimension, Diver};

/// The greatest angle: beyond, rounding alone turns a joint.
const MOST_RADIANS: f64 = 1e7;
/// Characters of a message of the parser that are kept.
const LONGEST_MESSAGE: usize = 120;
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
#[serde(expecting = "an object with Frames")]
struct File {
    #[serde(rename = "Frames")]
    frames: Frames,
}

/// Frames and their times, s.
struct Frames(Vec<(f64, [f64; WIDTH])>);

impl<'de> Deserialize<'de> for Frames {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct All;
        impl<'de> Visitor<'de> for All {
            type Value = Frames;

            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str("an array of frames")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Frames, A::Error> {
                let mut frames: Vec<(f64, [f64; WIDTH])> = Vec::new();
                let mut next = Frame { time: 0.0, before: None };
                while let Some(numbers) = sequence.next_element_seed(next)? {
                    frames.push((next.time, numbers));
                    next = Frame { time: next.time + numbers[0], before: Some(next.time) };
                }
                Ok(Frames(frames))
            }
        }
        deserializer.deserialize_seq(All)
    }
}

/// The frame at a time, and that before it. Its numbers are checked where the parser knows their line.
#[derive(Clone, Copy)]
struct Frame {
    time: f64,
    before: Option<f64>,
}

impl<'de> DeserializeSeed<'de> for Frame {
    type Value = [f64; WIDTH];

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Frame {
    type Value = [f64; WIDTH];

    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        write!(f, "a frame of {WIDTH} numbers")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Self::Value, A::Error> {
        let mut numbers = [0.0; WIDTH];
        for (i, number) in numbers.iter_mut().enumerate() {
            *number = sequence.next_element()?.ok_or_else(|| A::Error::invalid_length(i, &self))?;
        }
        if sequence.next_element::<f64>()?.is_some() {
            return Err(A::Error::custom(format!("more numbers than a frame of {WIDTH}")));
        }
        match self.fault(&numbers) {
            Some(fault) => Err(A::Error::custom(fault)),
            None => Ok(numbers),
        }
    }
}

impl Frame {
    fn fault(self, numbers: &[f64; WIDTH]) -> Option<String> {
        if numbers[0] < 0.0 {
            return Some(format!("duration {} s, allowed is 0 or more", numbers[0]));
        }
        let grows = |before| self.time > before && self.time.is_finite();
        if let Some(before) = self.before.filter(|before| !grows(*before)) {
            return Some(format!("a frame at {} s after one at {before} s, times must grow", self.time));
        }
        TURNS.iter().find_map(|turn| match *turn {
            Turn::Quaternion(at) => {
                let norm = numbers[at..at + 4].iter().fold(0.0_f64, |norm, x| norm.hypot(*x));
                let message = || format!("quaternion at number {at} of norm {norm}, allowed is 0.5 to 2");
                (!(0.5..=2.0).contains(&norm)).then(message)
            }
            Turn::Angle(at) => {
                let angle = numbers[at];
                let message = || format!("angle at number {at} of {angle} rad, allowed is at most 1e7");
                (angle.abs() > MOST_RADIANS).then(message)
            }
        })
    }
}

/// This format.
pub const FORMAT: Format = Format {
    name: "motions of DeepMimic",
    endings: &["json", "txt"],
    unit: Some(LengthUnit::Metre),
    up: Axis::PlusY,
    forward: Axis::PlusX,
    knows: |_, text| text.starts_with('{') && text.contains("\"Frames\""),
    parse: |bytes, choices, repairs| {
        Ok(Recording::Skeleton(read(&decoded(bytes, repairs)?, &choices.given.diver)?).into())
    },
};

/// The recording in `text`, with the lengths of `diver`.
pub fn read(text: &str, diver: &Diver) -> Result<SkeletonRecording, ReadError> {
    let file: File = serde_json::from_str(text).map_err(|error| {
        let place = Place::Line(error.line());
        let allowed = format!("an object with Frames of {WIDTH} numbers each");
        let message = error.to_string();
        // where it is, is said before
        let message = message.rsplit_once(" at line ").map_or(message.as_str(), |(message, _)| message);
        let mut reason = shorten(message, LONGEST_MESSAGE);
        match error.classify() {
            serde_json::error::Category::Eof => return ReadError::Truncated { place, allowed },
            serde_json::error::Category::Data => {}
            _ => reason = format!("{reason}; a motion is {allowed}, as JSON"),
        }
        ReadError::Malformed { place, column: error.column(), reason }
    })?;
    let Frames(frames) = file.frames;
    if frames.is_empty() {
        return Err(ReadError::NoFrames { place: Place::Line(1) });
    }
    let convention = Convention::y_up_x_forward(LengthUnit::Metre);
    let (mut times, mut rotations, mut places) = (Vec::new(), Vec::new(), Vec::new());
    for (time, numbers) in &frames {
        times.push(*time);
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
    let nowhere = |error| ReadError::recording(error, Place::Line(1), |_| None);
    let skeleton = Skeleton::try_new(joints(diver)?).map_err(nowhere)?;
    SkeletonRecording::try_new(skeleton, times, rotations, places).map_err(nowhere)
}

/// The joints of the format with the lengths of a diver, whose axes are those of the world.
fn joints(diver: &Diver) -> Result<Vec<SkeletonJoint>, ModelError> {
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
    Ok(joints)
}
