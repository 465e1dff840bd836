//! Recordings as GLB, the binary form of glTF 2.0, which viewers, engines and browsers play: a stick figure, or a point for each marker.
//!
//! Each joint is a node with its rotations and places as an animation, and a bone from its parent; each marker is a node with its
//! places, scaled to zero while it is missing. Lengths are in m. A node above all turns the world of recordings into that of glTF:
//! forward is z, left is x, up is y. Numbers have single precision.
//!
//! Source: *glTF 2.0 Specification*, Khronos Group, 2021.

use super::WriteError;
use crate::recording::{MarkerRecording, SkeletonRecording};
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::{Value, json};

/// Half the size of a joint or a marker, m, and the width of a bone of unit length.
const SIZE: f32 = 0.02;
const WIDTH: f32 = 0.06;
/// The corners of an octahedron, and the three of each of its faces, seen from outside.
const CORNERS: [[f32; 3]; 6] =
    [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
const FACES: [[u16; 3]; 8] =
    [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
/// Numbers of single precision, and of 16 bits, by the names that glTF has for them.
const FLOAT: u32 = 5126;
const SHORT: u32 = 5123;

/// What is gathered of a file.
#[derive(Default)]
struct Scene {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    nodes: Vec<Value>,
    samplers: Vec<Value>,
    channels: Vec<Value>,
}

impl Scene {
    /// A scene with the node that turns the world, the two meshes and the times of the frames, which are accessor 4.
    fn new(times: &[f64]) -> Result<Self, WriteError> {
        let mut scene = Self::default();
        let joint = CORNERS.map(|corner| corner.map(|x| SIZE * x));
        // from the origin to (0, 0, 1), thickest near its beginning
        let bone = CORNERS.map(|[x, y, z]| match z {
            0.0 => [WIDTH * x, WIDTH * y, 0.15],
            _ => [0.0, 0.0, 0.5 * (z + 1.0)],
        });
        for mesh in [joint, bone] {
            let all = mesh.as_flattened();
            scene.floats(all, "VEC3", true);
            let indices: Vec<u8> = FACES.as_flattened().iter().flat_map(|i| i.to_le_bytes()).collect();
            let view = scene.view(&indices);
            let n = 3 * FACES.len();
            scene
                .accessors
                .push(json!({"bufferView": view, "componentType": SHORT, "count": n, "type": "SCALAR"}));
        }
        // times start at zero, where players start
        let shifted = |(frame, t): (usize, &f64)| single("a time", t - times[0], frame);
        let times = times.iter().enumerate().map(shifted).collect::<Result<Vec<f32>, _>>()?;
        if let Some(i) = times.windows(2).position(|pair| pair[1] <= pair[0]) {
            let found = f64::from(times[i + 1]);
            return Err(WriteError::OutOfRange { quantity: "a time", found, frame: i + 1 });
        }
        scene.floats(&times, "SCALAR", true);
        scene.nodes.push(json!({"name": "world", "rotation": [-0.5, -0.5, -0.5, 0.5], "children": []}));
        Ok(scene)
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.bytes.len();
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}));
        self.views.len() - 1
    }

    /// An accessor of numbers, with their bounds where the format wants them.
    fn floats(&mut self, numbers: &[f32], kind: &str, with_bounds: bool) -> usize {
        let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        let view = self.view(&bytes);
        let width = match kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            _ => 4,
        };
        let count = numbers.len() / width;
        let mut accessor = json!({"bufferView": view, "componentType": FLOAT, "count": count, "type": kind});
        if with_bounds {
            let bound = |start: f32, choose: fn(f32, f32) -> f32| -> Vec<f32> {
                (0..width)
                    .map(|k| numbers.iter().skip(k).step_by(width).copied().fold(start, choose))
                    .collect()
            };
            accessor["min"] = json!(bound(f32::INFINITY, f32::min));
            accessor["max"] = json!(bound(f32::NEG_INFINITY, f32::max));
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Moves a node: its translation, rotation or scale in each frame.
    fn animate(&mut self, node: usize, path: &str, kind: &str, numbers: &[f32], interpolation: &str) {
        let output = self.floats(numbers, kind, false);
        let sampler = self.samplers.len();
        self.samplers.push(json!({"input": 4, "output": output, "interpolation": interpolation}));
        self.channels.push(json!({"sampler": sampler, "target": {"node": node, "path": path}}));
    }

    /// A node below another.
    fn node(&mut self, parent: usize, node: Value) -> usize {
        let number = self.nodes.len();
        self.nodes.push(node);
        match &mut self.nodes[parent]["children"] {
            Value::Array(children) => children.push(json!(number)),
            none => *none = json!([number]),
        }
        number
    }

    /// The bytes of the file.
    fn file(mut self) -> Result<Vec<u8>, WriteError> {
        if self.nodes[0]["children"].as_array().is_some_and(Vec::is_empty) {
            self.nodes[0] = json!({"name": "world"});
        }
        let mesh =
            |k: usize| json!({"primitives": [{"attributes": {"POSITION": 2 * k}, "indices": 2 * k + 1}]});
        let mut document = json!({
            "asset": {"version": "2.0", "generator": "somersault"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": self.nodes,
            "meshes": [mesh(0), mesh(1)],
            "buffers": [{"byteLength": self.bytes.len()}],
            "bufferViews": self.views,
            "accessors": self.accessors,
        });
        if !self.channels.is_empty() {
            document["animations"] = json!([{"samplers": self.samplers, "channels": self.channels}]);
        }
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let length = 12 + 8 + text.len() + 8 + self.bytes.len();
        let most = u32::MAX as usize;
        let word = |n: usize| {
            let fits = u32::try_from(n).map(u32::to_le_bytes);
            fits.map_err(|_| WriteError::TooMany { quantity: "bytes", found: n, most })
        };
        let mut file = Vec::with_capacity(length);
        file.extend(b"glTF");
        file.extend(2_u32.to_le_bytes());
        file.extend(word(length)?);
        for (kind, chunk) in [(b"JSON", text), (b"BIN\0", self.bytes)] {
            file.extend(word(chunk.len())?);
            file.extend(kind);
            file.extend(chunk);
        }
        Ok(file)
    }
}

/// A number in single precision.
fn single(quantity: &'static str, x: f64, frame: usize) -> Result<f32, WriteError> {
    let found = x as f32;
    if found.is_finite() { Ok(found) } else { Err(WriteError::OutOfRange { quantity, found: x, frame }) }
}

fn singles(quantity: &'static str, x: &Vector3<f64>, frame: usize) -> Result<[f32; 3], WriteError> {
    Ok([single(quantity, x.x, frame)?, single(quantity, x.y, frame)?, single(quantity, x.z, frame)?])
}

/// `recording` as the bytes of a file, with a bone to each joint.
pub fn write_skeleton(recording: &SkeletonRecording) -> Result<Vec<u8>, WriteError> {
    let joints = recording.skeleton().joints();
    let mut scene = Scene::new(recording.times())?;
    let mut numbers = Vec::with_capacity(joints.len());
    for joint in joints {
        let offset = singles("an offset", &joint.offset, 0)?;
        let parent = joint.parent.map_or(0, |p| numbers[p]);
        let length = joint.offset.norm();
        if joint.parent.is_some() && length > 0.0 {
            // the shortest turn from z
            let turn = UnitQuaternion::rotation_between(&Vector3::z(), &joint.offset);
            let turn = turn
                .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
            let rotation = turn.coords.map(|x| x as f32);
            let scale = [length as f32; 3];
            let bone = json!({"mesh": 1, "rotation": rotation.as_slice(), "scale": scale});
            scene.node(parent, bone);
        }
        numbers.push(scene.node(parent, json!({"name": joint.name, "mesh": 0, "translation": offset})));
    }
    let mut places = vec![Vec::new(); joints.len()];
    let mut rotations = vec![Vec::<f32>::new(); joints.len()];
    for (i, frame) in recording.frames().enumerate() {
        for (k, (place, rotation)) in frame.enumerate() {
            if joints[k].moves {
                places[k].extend(singles("a place", &place, i)?);
            }
            if joints[k].turns {
                // of a rotation and its opposite the nearer, since players interpolate
                let x = rotation.coords.map(|x| x as f32);
                let before = rotations[k]
                    .rchunks_exact(4)
                    .next()
                    .map(|b| b.iter().zip(&x).map(|(a, b)| a * b).sum::<f32>());
                let sign = if before.is_some_and(|dot| dot < 0.0) { -1.0 } else { 1.0 };
                rotations[k].extend(x.iter().map(|x| sign * x));
            }
        }
    }
    for (k, node) in numbers.into_iter().enumerate() {
        if joints[k].moves {
            scene.animate(node, "translation", "VEC3", &places[k], "LINEAR");
        }
        if joints[k].turns {
            scene.animate(node, "rotation", "VEC4", &rotations[k], "LINEAR");
        }
    }
    scene.file()
}

/// `recording` as the bytes of a file, with a point for each marker.
pub fn write_markers(recording: &MarkerRecording) -> Result<Vec<u8>, WriteError> {
    let mut scene = Scene::new(recording.times())?;
    for (k, name) in recording.names().iter().enumerate() {
        let node = scene.node(0, json!({"name": name, "mesh": 0}));
        let (mut places, mut scales) = (Vec::new(), Vec::new());
        let mut last = [0.0; 3];
        for (i, frame) in recording.frames().enumerate() {
            if let Some(point) = &frame[k] {
                last = singles("a coordinate", point, i)?;
            }
            places.extend(last);
            scales.extend([if frame[k].is_some() { 1.0 } else { 0.0 }; 3]);
        }
        scene.animate(node, "translation", "VEC3", &places, "LINEAR");
        if scales.contains(&0.0) {
            scene.animate(node, "scale", "VEC3", &scales, "STEP");
        }
    }
    scene.file()
}
