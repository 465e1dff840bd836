//! BVH, the Biovision hierarchy: a tree of joints, and channels for each frame.
//!
//! Any hierarchy and any order of channels. The rotations of a joint are about its own turned axes, in the order of
//! the channels: for `Zrotation Xrotation Yrotation` R = R_z R_x R_y. Position channels of a joint stand for
//! the components of its offset. An `End Site` is a joint that does not turn, named after its parent with `_end`,
//! further ones of the same parent with `_end2`, `_end3`, …. Joints keep their names, which must differ. Angles are in degrees; the format has no unit of length and no axes.
//!
//! A frame is a line. Frames that are wrapped over several lines, or share one, are read where their numbers are exactly those that
//! are declared; any other line with a wrong count of numbers is refused, but for a last one that is cut.
//!
//! [`read_repaired`] numbers joints of the same name, takes the frames that are there where another number is declared or the last is
//! cut, does without the line MOTION, and closes joints whose braces are missing before it.
//!
//! ```text
//! HIERARCHY
//! ROOT hips { OFFSET 0 0 0 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
//!   JOINT knee { OFFSET 0 -40 0 CHANNELS 1 Xrotation End Site { OFFSET 0 -42 0 } } }
//! MOTION
//! Frames: 1
//! Frame Time: 0.01
//! 0 90 0 0 0 0 15
//! ```
//!
//! Source: M. Meredith and S. Maddock, *Motion capture file formats explained*, University of Sheffield, CS-01-11, 2001.

use super::{Format, Place, ReadError, Recording, Repairs, decoded, distinct, number, unexpected};
use crate::recording::{Axis, Convention, RecordingError, Skeleton, SkeletonJoint, SkeletonRecording};
use nalgebra::{UnitQuaternion, Vector3};
use std::collections::HashSet;

/// The greatest angle, degrees: beyond, rounding alone turns a joint.
const MOST_DEGREES: f64 = 1e9;

/// A channel: what its number is to the joint.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Channel {
    Position(usize),
    Rotation(usize),
}

impl Channel {
    const NAMES: &'static str = "Xposition, Yposition, Zposition, Xrotation, Yrotation or Zrotation";

    fn named(name: &str) -> Option<Self> {
        let axis = match name.as_bytes().first()?.to_ascii_uppercase() {
            b'X' => 0,
            b'Y' => 1,
            b'Z' => 2,
            _ => return None,
        };
        match name.get(1..)?.to_ascii_lowercase().as_str() {
            "position" => Some(Self::Position(axis)),
            "rotation" => Some(Self::Rotation(axis)),
            _ => None,
        }
    }
}

/// A joint as the file has it.
struct BvhJoint {
    name: String,
    parent: Option<usize>,
    offset: Vector3<f64>,
    /// Whether its offset was read.
    has_offset: bool,
    channels: Vec<Channel>,
    /// Whether it is an end site.
    is_end: bool,
    /// End sites read so far.
    n_ends: usize,
    /// Where its name stands, or that of an end site its keyword.
    place: Place,
}

/// Words with their lines.
#[derive(Clone)]
struct Words<'a> {
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
    rest: &'a str,
    line: usize,
}

impl<'a> Words<'a> {
    fn new(text: &'a str) -> Self {
        Self { lines: text.lines().enumerate(), rest: "", line: 1 }
    }

    fn place(&self) -> Place {
        Place::Line(self.line)
    }

    /// Goes to the next line that has something on it.
    fn fill(&mut self) -> bool {
        loop {
            self.rest = self.rest.trim_start();
            if !self.rest.is_empty() {
                return true;
            }
            let Some((i, line)) = self.lines.next() else { return false };
            (self.line, self.rest) = (i + 1, line);
        }
    }

    fn next(&mut self) -> Option<&'a str> {
        if !self.fill() {
            return None;
        }
        let (word, rest) = self.rest.split_at(self.rest.find(char::is_whitespace).unwrap_or(self.rest.len()));
        self.rest = rest;
        Some(word)
    }

    /// The next word, which the format needs.
    fn need(&mut self, allowed: &str) -> Result<&'a str, ReadError> {
        let word = self.next();
        word.ok_or_else(|| ReadError::Truncated { place: self.place(), allowed: allowed.to_owned() })
    }

    /// Whether this is next, alone or with what follows it right behind its colon.
    fn is_next(&mut self, label: &str) -> bool {
        self.fill() && self.rest.get(..label.len()).is_some_and(|found| found.eq_ignore_ascii_case(label))
    }

    /// A keyword that ends with a colon, behind which a blank may be missing.
    fn require_label(&mut self, label: &str) -> Result<(), ReadError> {
        if !self.is_next(label) {
            return self.require(label);
        }
        self.rest = &self.rest[label.len()..];
        Ok(())
    }

    /// How many words each line has that is left and is not empty.
    fn counts(&self) -> Vec<(usize, usize)> {
        let lines = self.lines.clone().map(|(i, line)| (i + 1, line));
        let counts = std::iter::once((self.line, self.rest)).chain(lines);
        counts.map(|(i, line)| (i, line.split_whitespace().count())).filter(|(_, count)| *count > 0).collect()
    }

    fn require(&mut self, keyword: &str) -> Result<(), ReadError> {
        let found = self.need(keyword)?;
        if found.eq_ignore_ascii_case(keyword) {
            Ok(())
        } else {
            Err(unexpected(self.place(), found, keyword))
        }
    }

    fn number(&mut self, quantity: &'static str) -> Result<f64, ReadError> {
        let word = self.need(quantity)?;
        number(self.place(), word, quantity)
    }

    fn count(&mut self, quantity: &'static str) -> Result<usize, ReadError> {
        let word = self.need(quantity)?;
        word.parse().map_err(|_| unexpected(self.place(), word, format!("{quantity}, a whole number")))
    }

    fn vector(&mut self, quantity: &'static str) -> Result<Vector3<f64>, ReadError> {
        Ok(Vector3::new(self.number(quantity)?, self.number(quantity)?, self.number(quantity)?))
    }

    /// A name, to the end of the line or to the brace: names may have spaces.
    fn name(&mut self) -> Result<&'a str, ReadError> {
        if !self.fill() {
            return Err(ReadError::Truncated { place: self.place(), allowed: "a name".to_owned() });
        }
        let (name, rest) = self.rest.split_at(self.rest.find('{').unwrap_or(self.rest.len()));
        self.rest = rest;
        match name.trim() {
            "" => Err(unexpected(self.place(), rest, "a name")),
            name => Ok(name),
        }
    }
}

/// This format.
pub const FORMAT: Format = Format {
    name: "BVH",
    endings: &["bvh"],
    unit: None,
    up: Axis::PlusY,
    forward: Axis::PlusZ,
    knows: |_, text| text.get(..9).is_some_and(|word| word.eq_ignore_ascii_case("HIERARCHY")),
    parse: |bytes, choices, repairs| {
        let text = decoded(bytes, repairs)?;
        Ok(Recording::Skeleton(read_repaired(&text, &choices.convention, repairs)?).into())
    },
};

/// The recording in the `text` of a BVH file, the frames of which begin at t = 0.
pub fn read(text: &str, convention: &Convention) -> Result<SkeletonRecording, ReadError> {
    read_repaired(text, convention, &mut Repairs::refused())
}

/// The same with repairs.
pub fn read_repaired(
    text: &str,
    convention: &Convention,
    repairs: &mut Repairs,
) -> Result<SkeletonRecording, ReadError> {
    // programs of DOS end a file with the control character 26, others with zeros
    let mut words = Words::new(text.trim_end_matches(|c: char| c.is_whitespace() || "\0\u{1a}".contains(c)));
    let mut joints = hierarchy(&mut words, repairs)?;
    let mut seen = HashSet::new();
    if let Some(twice) =
        joints.iter().find(|joint| !seen.insert(joint.name.as_str())).map(|joint| joint.place)
    {
        let names = joints.iter_mut().map(|joint| std::mem::take(&mut joint.name)).collect();
        let names = distinct(names, "joint", twice, repairs)?;
        joints.iter_mut().zip(names).for_each(|(joint, name)| joint.name = name);
    }
    words.require_label("Frames:")?;
    let declared_at = words.place();
    let n_frames = words.count("a number of frames")?;
    words.require("Frame")?;
    words.require_label("Time:")?;
    let step_at = words.place();
    let step = words.number("the time of a frame")?;
    if n_frames == 0 {
        return Err(ReadError::NoFrames { place: declared_at });
    }

    let n_channels: usize = joints.iter().map(|j| j.channels.len()).sum();
    if n_channels == 0 {
        return Err(unexpected(declared_at, "no channel", "at least one channel in the hierarchy"));
    }
    let found = whole_frames(&words.counts(), n_channels, n_frames, repairs)?;
    // a single frame has no distance from the next
    if step < 0.0 || step == 0.0 && found > 1 {
        return Err(unexpected(step_at, &step.to_string(), "a positive time of a frame"));
    }
    let (mut times, mut rotations, mut places) = (Vec::new(), Vec::new(), Vec::new());
    let mut frames_at = Vec::new();
    for i in 0..found {
        words.fill();
        frames_at.push(words.place());
        frame(&joints, convention, &mut words, &mut rotations, &mut places)?;
        times.push(i as f64 * step);
    }
    if found != n_frames {
        let (place, quantity) = (declared_at, "frames");
        let error =
            ReadError::Misdeclared { place, quantity, declared: n_frames as u64, found: found as u64 };
        repairs.instead_of(error, format!("{n_frames} frames are declared, {found} are there"))?;
    }
    if found == 0 {
        return Err(ReadError::NoFrames { place: declared_at });
    }
    let joints = joints.into_iter().map(|joint| SkeletonJoint {
        parent: joint.parent,
        offset: convention.position(&joint.offset),
        turns: turns(&joint),
        moves: moves(&joint),
        name: joint.name,
    });
    let skeleton = Skeleton::try_new(joints.collect())
        .map_err(|source| ReadError::Recording { place: Place::Line(1), source })?;
    SkeletonRecording::try_new(skeleton, times, rotations, places).map_err(|error| match error {
        source @ RecordingError::NonFinite { argument: "times", .. } => {
            ReadError::Recording { place: step_at, source }
        }
        error => ReadError::recording(error, step_at, |frame| frames_at.get(frame).copied()),
    })
}

fn turns(joint: &BvhJoint) -> bool {
    joint.channels.iter().any(|c| matches!(c, Channel::Rotation(_)))
}

fn moves(joint: &BvhJoint) -> bool {
    joint.channels.iter().any(|c| matches!(c, Channel::Position(_)))
}

/// Adds what moves and what turns in the frame that is next.
fn frame(
    joints: &[BvhJoint],
    convention: &Convention,
    words: &mut Words,
    rotations: &mut Vec<UnitQuaternion<f64>>,
    places: &mut Vec<Vector3<f64>>,
) -> Result<(), ReadError> {
    for joint in joints {
        let (place, rotation) = pose(joint, words)?;
        if moves(joint) {
            places.push(convention.position(&place));
        }
        if turns(joint) {
            rotations.push(convention.rotation(&rotation));
        }
    }
    Ok(())
}

/// Place and rotation of a joint in the frame that is next.
fn pose(joint: &BvhJoint, words: &mut Words) -> Result<(Vector3<f64>, UnitQuaternion<f64>), ReadError> {
    let (mut place, mut rotation) = (joint.offset, UnitQuaternion::identity());
    for channel in &joint.channels {
        let value = words.number("the value of a channel")?;
        match *channel {
            Channel::Position(axis) => place[axis] = value,
            Channel::Rotation(_) if value.abs() > MOST_DEGREES => {
                return Err(unexpected(words.place(), &value.to_string(), "an angle of at most 1e9 degrees"));
            }
            Channel::Rotation(axis) => {
                let mut turn = Vector3::zeros();
                turn[axis] = value.to_radians();
                rotation *= UnitQuaternion::new(turn);
            }
        }
    }
    Ok((place, UnitQuaternion::new_normalize(rotation.into_inner())))
}

/// How many frames lines of so many words have. A frame is a line, unless the numbers of all lines are together those of the frames
/// that are declared.
fn whole_frames(
    lines: &[(usize, usize)],
    n_channels: usize,
    declared: usize,
    repairs: &mut Repairs,
) -> Result<usize, ReadError> {
    let total = lines.iter().map(|(_, count)| count).sum();
    if lines.len() != declared && declared.checked_mul(n_channels) == Some(total) {
        return Ok(declared);
    }
    let Some((&(last, count), before)) = lines.split_last() else { return Ok(0) };
    let is_cut = count < n_channels;
    if let Some((line, found)) =
        lines[..lines.len() - usize::from(is_cut)].iter().find(|(_, count)| *count != n_channels)
    {
        let allowed = format!("{n_channels} numbers, one for each channel of the hierarchy");
        return Err(unexpected(Place::Line(*line), &format!("{found} numbers"), allowed));
    }
    if is_cut {
        let allowed = "the value of a channel".to_owned();
        let error = ReadError::Truncated { place: Place::Line(last), allowed };
        if before.is_empty() {
            return Err(error);
        }
        repairs.instead_of(error, "the last frame is incomplete and left out")?;
    }
    Ok(lines.len() - usize::from(is_cut))
}

/// From HIERARCHY to MOTION.
fn hierarchy(words: &mut Words, repairs: &mut Repairs) -> Result<Vec<BvhJoint>, ReadError> {
    words.require("HIERARCHY")?;
    words.require("ROOT")?;
    let mut joints: Vec<BvhJoint> = Vec::new();
    // from the root to the joint whose braces are open
    let mut open: Vec<usize> = Vec::new();
    joint(words, &mut joints, &mut open, false)?;
    while let Some(&current) = open.last() {
        let here = &mut joints[current];
        let allowed = match (here.has_offset, here.is_end) {
            (false, _) => "OFFSET",
            (true, true) => "}",
            (true, false) => "CHANNELS, JOINT, End Site or }",
        };
        let word = words.need(allowed)?;
        match word.to_ascii_uppercase().as_str() {
            "OFFSET" if !here.has_offset => {
                here.offset = words.vector("a coordinate of an offset")?;
                here.has_offset = true;
            }
            "CHANNELS" if here.channels.is_empty() => {
                let n = words.count("a number of channels")?;
                if n > 0 && here.is_end {
                    return Err(unexpected(words.place(), &n.to_string(), "no channel of an end site"));
                }
                for _ in 0..n {
                    let name = words.need("the name of a channel")?;
                    let channel = Channel::named(name)
                        .ok_or_else(|| unexpected(words.place(), name, Channel::NAMES))?;
                    here.channels.push(channel);
                }
            }
            "}" if here.has_offset => drop(open.pop()),
            "JOINT" if here.has_offset && !here.is_end => joint(words, &mut joints, &mut open, false)?,
            "END" if here.has_offset && !here.is_end => {
                here.n_ends += 1;
                joint(words, &mut joints, &mut open, true)?;
            }
            "MOTION" if here.has_offset => {
                let error = unexpected(words.place(), word, allowed);
                repairs.instead_of(error, "joints without a closing brace are closed before MOTION")?;
                return Ok(joints);
            }
            _ => return Err(unexpected(words.place(), word, allowed)),
        }
    }
    if words.is_next("Frames:") {
        let error = unexpected(words.place(), "Frames:", "MOTION");
        repairs.instead_of(error, "there is no line MOTION before the frames")?;
        return Ok(joints);
    }
    words.require("MOTION")?;
    Ok(joints)
}

/// A joint or an end site up to its brace; what follows belongs to it until the brace closes.
fn joint(
    words: &mut Words,
    joints: &mut Vec<BvhJoint>,
    open: &mut Vec<usize>,
    is_end: bool,
) -> Result<(), ReadError> {
    let parent = open.last().copied();
    // programs add a name or a number to `End Site`
    let mut name = words.name()?.to_owned();
    if let Some(parent) = parent.filter(|_| is_end) {
        if !name.get(..4).is_some_and(|word| word.eq_ignore_ascii_case("Site")) {
            return Err(unexpected(words.place(), &name, "Site"));
        }
        name = match joints[parent].n_ends {
            1 => format!("{}_end", joints[parent].name),
            n => format!("{}_end{n}", joints[parent].name),
        };
    }
    let place = words.place();
    words.require("{")?;
    open.push(joints.len());
    let (offset, channels) = (Vector3::zeros(), Vec::new());
    joints.push(BvhJoint { name, parent, offset, has_offset: false, channels, is_end, n_ends: 0, place });
    Ok(())
}
