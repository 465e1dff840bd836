//! Motions in the format of DeepMimic: that of [`readers::joint_motion`](crate::readers::joint_motion).

use super::WriteError;
use crate::readers::joint_motion::{TURNS, Turn, WIDTH};
use crate::recording::{Convention, LengthUnit, SkeletonRecording};

/// The joints of the format that turn, in the order of its numbers.
const JOINTS: [&str; 13] = [
    "root",
    "chest",
    "neck",
    "right_hip",
    "right_knee",
    "right_ankle",
    "right_shoulder",
    "right_elbow",
    "left_hip",
    "left_knee",
    "left_ankle",
    "left_shoulder",
    "left_elbow",
];

/// `recording`, of a skeleton with the joints of the format, as JSON. Knees and elbows must turn about the
/// lateral axis alone. Lengths are not written; the last frame lasts as long as the one before.
pub fn write(recording: &SkeletonRecording) -> Result<String, WriteError> {
    let turning: Vec<&str> =
        recording.skeleton().joints().iter().filter(|j| j.turns).map(|j| j.name.as_str()).collect();
    for (joint, expected) in JOINTS.into_iter().enumerate() {
        let found = turning.get(joint).copied().unwrap_or_default();
        if found != expected {
            return Err(WriteError::Joint { joint, expected, found: found.to_owned() });
        }
    }
    let convention = Convention::y_up_x_forward(LengthUnit::Metre);
    let times = recording.times();
    let durations: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    let mut frames = Vec::with_capacity(times.len());
    for (i, frame) in recording.frames().enumerate() {
        let mut numbers = [0.0; WIDTH];
        numbers[0] = durations.get(i).or(durations.last()).copied().unwrap_or_default();
        let poses = frame.zip(recording.skeleton().joints());
        let mut turns = TURNS.iter().zip(JOINTS);
        for (k, ((place, rotation), joint)) in poses.enumerate() {
            if k == 0 {
                numbers[1..4].copy_from_slice(convention.file_position(&place).as_slice());
            }
            let Some((turn, name)) = joint.turns.then(|| turns.next()).flatten() else { continue };
            let q = convention.file_rotation(&rotation);
            match *turn {
                Turn::Quaternion(at) => numbers[at..at + 4].copy_from_slice(&[q.w, q.i, q.j, q.k]),
                Turn::Angle(at) => {
                    if q.i.hypot(q.j) > 1e-9 {
                        return Err(WriteError::Hinge { joint: name, frame: i });
                    }
                    numbers[at] = 2.0 * q.k.atan2(q.w);
                }
            }
        }
        let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
        frames.push(format!("[{}]", numbers.join(", ")));
    }
    Ok(format!("{{\n\"Loop\": \"none\",\n\"Frames\":\n[\n{}\n]\n}}\n", frames.join(",\n")))
}
