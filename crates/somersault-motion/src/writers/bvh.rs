//! Skeletons as BVH: the format of [`readers::bvh`](crate::readers::bvh).
//!
//! Rotations have the channels Z, X, Y. A skeleton of which no joint turns or moves has no channels, and so no
//! frames that the format could hold: that is refused. Ends that neither turn nor move, have no children and are named after
//! their parent with `_end` are end sites; other joints that stay have no channels. Joints come in the order of
//! the tree, each with all that hangs on it; the first frame is at t = 0 for readers of the file.

use super::{WriteError, expect_name, file_position, time_step};
use crate::recording::{Convention, SkeletonJoint, SkeletonRecording};
use nalgebra::UnitQuaternion;

/// `recording` as text.
pub fn write(recording: &SkeletonRecording, convention: &Convention) -> Result<String, WriteError> {
    let joints = recording.skeleton().joints();
    if !joints.iter().any(|joint| joint.turns || joint.moves) {
        return Err(WriteError::NoChannels);
    }
    for joint in joints {
        expect_name(&joint.name, &['{', '}'], "names without brace, line break or blanks around them")?;
    }
    let step = time_step(recording.times())?;
    let mut text = "HIERARCHY\n".to_owned();
    let mut children = vec![Vec::new(); joints.len()];
    for (i, joint) in joints.iter().enumerate() {
        if let Some(parent) = joint.parent {
            children[parent].push(i);
        }
    }
    let mut order = Vec::with_capacity(joints.len());
    // a joint, or the closing of one
    let mut open = vec![(Some(0), 0)];
    while let Some((joint, depth)) = open.pop() {
        let Some(k) = joint else {
            text.push_str(&format!("{}}}\n", "\t".repeat(depth)));
            continue;
        };
        order.push(k);
        head(&mut text, joints, k, children[k].is_empty(), depth, convention)?;
        open.push((None, depth));
        open.extend(children[k].iter().rev().map(|&i| (Some(i), depth + 1)));
    }
    text.push_str(&format!("MOTION\nFrames: {}\nFrame Time: {step}\n", recording.n_frames()));
    for (i, frame) in recording.frames().enumerate() {
        let poses: Vec<_> = frame.collect();
        let mut numbers = Vec::new();
        for &k in &order {
            let (place, rotation) = &poses[k];
            if joints[k].moves {
                numbers.extend_from_slice(file_position(convention, "a place", place, i)?.as_slice());
            }
            if joints[k].turns {
                numbers.extend(angles(&convention.file_rotation(rotation)).map(f64::to_degrees));
            }
        }
        let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
        text.push_str(&numbers.join(" "));
        text.push('\n');
    }
    Ok(text)
}

/// From the keyword of a joint to its channels.
fn head(
    text: &mut String,
    joints: &[SkeletonJoint],
    k: usize,
    is_leaf: bool,
    depth: usize,
    convention: &Convention,
) -> Result<(), WriteError> {
    let joint = &joints[k];
    let is_end = match joint.parent {
        Some(p) => !joint.turns && !joint.moves && is_leaf && joint.name == format!("{}_end", joints[p].name),
        None => false,
    };
    let name = match (joint.parent, is_end) {
        (_, true) => "End Site".to_owned(),
        (None, _) => format!("ROOT {}", joint.name),
        _ => format!("JOINT {}", joint.name),
    };
    let indent = "\t".repeat(depth);
    let offset = file_position(convention, "an offset", &joint.offset, 0)?;
    let [x, y, z] = [offset.x, offset.y, offset.z];
    text.push_str(&format!("{indent}{name}\n{indent}{{\n{indent}\tOFFSET {x} {y} {z}\n"));
    if is_end {
        return Ok(());
    }
    let n = 3 * (usize::from(joint.moves) + usize::from(joint.turns));
    let moves = if joint.moves { " Xposition Yposition Zposition" } else { "" };
    let turns = if joint.turns { " Zrotation Xrotation Yrotation" } else { "" };
    text.push_str(&format!("{indent}\tCHANNELS {n}{moves}{turns}\n"));
    Ok(())
}

/// a, b and c of R = R_z(a) R_x(b) R_y(c). c is taken from what a leaves, so that the product is right at b =
/// ±π/2 too.
fn angles(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let r = rotation.to_rotation_matrix();
    let a = (-r[(0, 1)]).atan2(r[(1, 1)]);
    let b = r[(2, 1)].atan2(r[(0, 1)].hypot(r[(1, 1)]));
    let (sine, cosine) = a.sin_cos();
    let left = |column: usize| cosine * r[(0, column)] + sine * r[(1, column)];
    [a, b, left(2).atan2(left(0))]
}
