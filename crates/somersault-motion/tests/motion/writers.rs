//! What is written is read again.

use crate::files::{BVH, CSV, TRC, joint_motion};
use nalgebra::{UnitQuaternion, Vector3};
use somersault_core::lie::so3::angle_between;
use somersault_motion::readers::{self, MarkerOptions};
use somersault_motion::recording::{
    Axis, Convention, LengthUnit, MarkerRecording, Skeleton, SkeletonJoint, SkeletonRecording,
};
use somersault_motion::writers::{self, WriteError};
use somersault_multibody::models::Diver;

/// Digits that no short decimal has, a gap, and a name with blanks and umlauts inside.
fn markers() -> MarkerRecording {
    let names = vec!["left knee".into(), "höhe".into(), "c".into()];
    let times: Vec<f64> = (0..7).map(|i| 0.1 * f64::from(i) / 3.0).collect();
    let point = |k: usize| {
        let x = (k as f64 * 0.7).sin();
        (k != 10).then(|| Vector3::new(x, 1.0 / (k as f64 + 3.0), -1e-9 * x))
    };
    MarkerRecording::try_new(names, times, (0..21).map(point).collect()).unwrap()
}

fn largest_difference(a: &MarkerRecording, b: &MarkerRecording) -> f64 {
    assert_eq!((a.names(), a.n_frames()), (b.names(), b.n_frames()));
    let pairs = a.frames().flatten().zip(b.frames().flatten());
    pairs.fold(0.0, |largest, (a, b)| match (a, b) {
        (Some(a), Some(b)) => (a - b).amax().max(largest),
        (None, None) => largest,
        _ => f64::NAN,
    })
}

#[test]
fn markers_in_metres_keep_all_their_digits_as_text() {
    let (markers, metres) = (markers(), Convention::z_up(LengthUnit::Metre));
    let text = writers::csv::write(&markers, &metres).unwrap();
    assert_eq!(readers::csv::read(&text, &MarkerOptions::default()).unwrap(), markers);
    let text = writers::trc::write(&markers, "a.trc", &metres).unwrap();
    assert_eq!(readers::trc::read(&text, &MarkerOptions::default()).unwrap(), markers);
    // and those of the files that other tests read
    let options = MarkerOptions::default();
    let csv = readers::csv::read(CSV, &options).unwrap();
    let again = writers::csv::write(&csv, &metres).unwrap();
    assert_eq!(readers::csv::read(&again, &options).unwrap(), csv);
    let convention = Convention::y_up_x_forward(LengthUnit::Millimetre);
    let options = MarkerOptions { convention, ..options };
    let trc = readers::trc::read(TRC, &options).unwrap();
    let again = writers::trc::write(&trc, "jump.trc", &convention).unwrap();
    assert_eq!(readers::trc::read(&again, &options).unwrap(), trc);
}

#[test]
fn conventions_come_back_to_rounding() {
    let markers = markers();
    for unit in [LengthUnit::Millimetre, LengthUnit::Inch] {
        let convention = Convention::try_new(unit, Axis::PlusY, Axis::MinusZ).unwrap();
        let options = MarkerOptions { convention, ..MarkerOptions::default() };
        for again in [
            readers::csv::read(&writers::csv::write(&markers, &convention).unwrap(), &options).unwrap(),
            readers::trc::read(&writers::trc::write(&markers, "x", &convention).unwrap(), &options).unwrap(),
        ] {
            assert!(largest_difference(&markers, &again) < 1e-15);
        }
    }
}

#[test]
fn c3d_comes_back_in_single_precision() {
    let read = |file: &[u8]| readers::c3d::read(file, &readers::c3d::C3dOptions::default()).unwrap();
    let markers = markers();
    let names: Vec<String> = ["left knee", "b", "c"].map(String::from).to_vec();
    let points: Vec<_> = markers.frames().flatten().copied().collect();
    let markers = MarkerRecording::try_new(names, markers.times().to_vec(), points).unwrap();
    let again = read(&writers::c3d::write(&markers, &Convention::z_up(LengthUnit::Metre)).unwrap());
    assert!(largest_difference(&markers, &again) < 1e-7);
    let times = markers.times().iter().zip(again.times());
    assert!(times.into_iter().all(|(a, b)| (a - b).abs() < 1e-7 * b.max(0.1)));

    // more points than an array has labels, more frames than sixteen bits count
    let (n_points, n_frames) = (300, 3);
    let names = (0..n_points).map(|k| format!("marker {k}")).collect();
    let points = (0..n_points * n_frames).map(|k| Some(Vector3::repeat(k as f64 / 8.0))).collect();
    let times = (0..n_frames).map(|i| i as f64 / 128.0).collect();
    let wide = MarkerRecording::try_new(names, times, points).unwrap();
    assert_eq!(read(&writers::c3d::write(&wide, &Convention::z_up(LengthUnit::Metre)).unwrap()), wide);
    let n_frames = 70_000;
    let times = (0..n_frames).map(|i| i as f64 / 128.0).collect();
    let points = (0..n_frames).map(|i| Some(Vector3::repeat(i as f64 / 8.0))).collect();
    let long = MarkerRecording::try_new(vec!["a".into()], times, points).unwrap();
    assert_eq!(read(&writers::c3d::write(&long, &Convention::z_up(LengthUnit::Metre)).unwrap()), long);
}

fn assert_same_motion(a: &SkeletonRecording, b: &SkeletonRecording) {
    assert_eq!(a.skeleton(), b.skeleton());
    for i in 0..a.n_frames() {
        assert!((a.times()[i] - b.times()[i]).abs() < 1e-12);
        for (a, b) in a.frame(i).unwrap().zip(b.frame(i).unwrap()) {
            assert!((a.0 - b.0).norm() < 1e-13 && angle_between(&a.1, &b.1) < 1e-13, "frame {i}");
        }
    }
}

#[test]
fn bvh_comes_back_to_rounding() {
    let convention = Convention::y_up_z_forward(LengthUnit::Centimetre);
    let recording = readers::bvh::read(BVH, &convention).unwrap();
    let text = writers::bvh::write(&recording, &convention).unwrap();
    assert_same_motion(&readers::bvh::read(&text, &convention).unwrap(), &recording);

    // rotations anywhere, and where the first and the third axis coincide
    let joint = |name: &str, parent, turns, moves| SkeletonJoint {
        name: name.into(),
        parent,
        offset: Vector3::new(0.0, 0.1, -0.4),
        turns,
        moves,
    };
    let skeleton = Skeleton::try_new(vec![
        joint("hips", None, true, true),
        joint("left leg", Some(0), true, false),
        joint("left leg_end", Some(1), false, false),
        joint("rigid", Some(0), false, false),
        joint("slider", Some(3), true, true),
    ])
    .unwrap();
    let n = 200;
    let rotation = |k: usize| {
        let x = k as f64;
        match k % 4 {
            // R_z(a) R_x(±π/2) R_y(c) in the axes of the file, nearly or exactly
            0 => {
                let up = UnitQuaternion::from_scaled_axis(
                    Vector3::x() * (std::f64::consts::FRAC_PI_2 - 1e-9 * (x % 3.0)),
                );
                let [a, c] =
                    [Vector3::z() * x, Vector3::y() * (0.3 * x)].map(UnitQuaternion::from_scaled_axis);
                convention.rotation(&(a * up * c))
            }
            _ => UnitQuaternion::from_euler_angles(0.9 * x, (1.7 * x).sin(), -2.3 * x),
        }
    };
    let times: Vec<f64> = (0..n).map(|i| i as f64 / 120.0).collect();
    let places = (0..2 * n).map(|k| Vector3::new((k as f64).sin(), 0.1, 0.3)).collect();
    let recording =
        SkeletonRecording::try_new(skeleton, times, (0..3 * n).map(rotation).collect(), places).unwrap();
    let metres = Convention::y_up_z_forward(LengthUnit::Metre);
    let text = writers::bvh::write(&recording, &metres).unwrap();
    assert_same_motion(&readers::bvh::read(&text, &metres).unwrap(), &recording);
}

#[test]
fn joint_motions_come_back_to_rounding() {
    let diver = Diver::spatial();
    let recording = readers::joint_motion::read(&joint_motion(5), &diver).unwrap();
    let text = writers::joint_motion::write(&recording).unwrap();
    assert_same_motion(&readers::joint_motion::read(&text, &diver).unwrap(), &recording);
    if let Some(recording) = crate::recorded::motion("backflip") {
        let text = writers::joint_motion::write(&recording).unwrap();
        assert_same_motion(&readers::joint_motion::read(&text, &diver).unwrap(), &recording);
    }
}

#[test]
fn what_a_format_cannot_hold_is_refused() {
    let metres = Convention::z_up(LengthUnit::Metre);
    let named =
        |name: &str| MarkerRecording::try_new(vec![name.into()], vec![0.0, 0.1, 0.3], vec![None; 3]).unwrap();
    assert!(matches!(writers::csv::write(&named("a,b"), &metres), Err(WriteError::Name { .. })));
    assert!(matches!(writers::trc::write(&named("a\tb"), "x", &metres), Err(WriteError::Name { .. })));
    assert!(matches!(writers::trc::write(&named("a"), "x\ny", &metres), Err(WriteError::Name { .. })));
    assert!(matches!(writers::csv::write(&named(" a"), &metres), Err(WriteError::Name { .. })));
    let uneven = writers::c3d::write(&named("a"), &metres);
    assert!(matches!(uneven, Err(WriteError::UnevenTimes { frame: 2, found: 0.3, .. })), "{uneven:?}");
    let even = |name: &str| MarkerRecording::try_new(vec![name.into()], vec![0.0], vec![None]).unwrap();
    assert!(matches!(writers::c3d::write(&even("höhe"), &metres), Err(WriteError::Name { .. })));
    assert!(matches!(writers::c3d::write(&even(&"a".repeat(256)), &metres), Err(WriteError::Name { .. })));
    let bvh = readers::bvh::read(BVH, &metres).unwrap();
    let found = writers::joint_motion::write(&bvh);
    let expected = WriteError::Joint { joint: 0, expected: "root", found: "Hips".into() };
    assert_eq!(found, Err(expected));
}

#[test]
fn numbers_that_a_format_cannot_hold_are_refused() {
    let (millimetres, metres) =
        (Convention::z_up(LengthUnit::Millimetre), Convention::z_up(LengthUnit::Metre));
    let at = |x: f64, times: Vec<f64>| {
        let points = times.iter().map(|_| Some(Vector3::new(0.0, -x, 0.0))).collect();
        MarkerRecording::try_new(vec!["a".into()], times, points).unwrap()
    };
    let beyond = |x: f64| Err(WriteError::OutOfRange { quantity: "a coordinate", found: x, frame: 0 });
    // 1e40 mm is beyond single precision, 1e309 mm beyond double
    assert_eq!(writers::c3d::write(&at(1e37, vec![0.0]), &millimetres), beyond(1e37).map(|()| vec![]));
    assert!(writers::c3d::write(&at(1e37, vec![0.0]), &metres).is_ok());
    let text = |x: f64| beyond(x).map(|()| String::new());
    assert_eq!(writers::csv::write(&at(1e306, vec![0.0]), &millimetres), text(1e306));
    assert_eq!(writers::trc::write(&at(1e306, vec![0.0]), "a", &millimetres), text(1e306));
    assert!(writers::csv::write(&at(1e306, vec![0.0]), &metres).is_ok());
    for times in [vec![0.0, 1e-320], vec![-1e308, 1e308]] {
        let c3d = writers::c3d::write(&at(1.0, times.clone()), &metres);
        assert!(matches!(c3d, Err(WriteError::OutOfRange { .. })), "{times:?}: {c3d:?}");
        let trc = writers::trc::write(&at(1.0, times.clone()), "a", &metres);
        assert!(matches!(trc, Err(WriteError::OutOfRange { .. })), "{times:?}: {trc:?}");
    }
    let joint = |turns| SkeletonJoint {
        name: "a".into(),
        parent: None,
        offset: Vector3::new(1e306, 0.0, 0.0),
        turns,
        moves: false,
    };
    let skeleton = |turns: bool| {
        let rotations = vec![UnitQuaternion::identity(); usize::from(turns)];
        let skeleton = Skeleton::try_new(vec![joint(turns)]).unwrap();
        SkeletonRecording::try_new(skeleton, vec![0.0], rotations, vec![]).unwrap()
    };
    let found = writers::bvh::write(&skeleton(true), &millimetres);
    assert!(matches!(found, Err(WriteError::OutOfRange { quantity: "an offset", .. })), "{found:?}");
    assert!(writers::bvh::write(&skeleton(true), &metres).is_ok());
    assert_eq!(writers::bvh::write(&skeleton(false), &metres), Err(WriteError::NoChannels));
}

#[test]
fn markers_keep_the_time_of_their_first_frame() {
    let metres = Convention::z_up(LengthUnit::Metre);
    // a number of frames, a number beyond 16 bits and one beyond 32, a part of a frame, and before zero
    for first in [0.0, 2.0, 40_000.5, 1e12, 0.1234, 2.0 / 3.0, -0.75, -1e-300] {
        let times = vec![first, first + 0.5, first + 1.0];
        let shifted =
            MarkerRecording::try_new(vec!["a".into()], times, vec![Some(Vector3::zeros()); 3]).unwrap();
        let c3d = writers::c3d::write(&shifted, &metres).unwrap();
        assert_eq!(readers::c3d::contradictions(&c3d).unwrap(), [], "{first} s");
        let again = readers::c3d::read(&c3d, &readers::c3d::C3dOptions::default()).unwrap();
        assert_eq!(again.times(), shifted.times(), "{first} s");
        let trc = writers::trc::write(&shifted, "a", &metres).unwrap();
        assert_eq!(readers::trc::read(&trc, &MarkerOptions::default()).unwrap().times(), shifted.times());
    }
}

/// The document and the numbers of a GLB.
fn glb(file: &[u8]) -> (serde_json::Value, impl Fn(usize) -> Vec<f32> + use<>) {
    let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&file[..4], word(4), word(8)), (&b"glTF"[..], 2, file.len()));
    let n = word(12);
    assert_eq!((&file[16..20], &file[24 + n..28 + n]), (&b"JSON"[..], &b"BIN\0"[..]));
    let document: serde_json::Value = serde_json::from_slice(&file[20..20 + n]).unwrap();
    let (bytes, copy) = (file[28 + n..].to_vec(), document.clone());
    let numbers = move |accessor: usize| {
        let accessor = &copy["accessors"][accessor];
        let view = &copy["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let [start, length] = ["byteOffset", "byteLength"].map(|key| view[key].as_u64().unwrap() as usize);
        bytes[start..start + length]
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
            .collect()
    };
    (document, numbers)
}

#[test]
fn nodes_of_a_glb_are_where_joints_and_markers_are() {
    let convention = Convention::y_up_z_forward(LengthUnit::Inch);
    let recording = readers::bvh::read(BVH, &convention).unwrap();
    let (document, numbers) = glb(&writers::glb::write_skeleton(&recording).unwrap());
    let nodes = document["nodes"].as_array().unwrap();
    let centres = recording.joint_centres().unwrap();
    // the pose of each node in the second frame, from the root down: children come after their parents
    let three = |value: &serde_json::Value| {
        value.as_array().map(|v| Vector3::from_iterator(v.iter().map(|x| x.as_f64().unwrap())))
    };
    let four = |x: &[f64]| UnitQuaternion::new_normalize(nalgebra::Quaternion::new(x[3], x[0], x[1], x[2]));
    let mut poses = vec![(Vector3::zeros(), UnitQuaternion::identity()); nodes.len()];
    let mut seen = 0;
    for (k, node) in nodes.iter().enumerate() {
        let mut place = three(&node["translation"]).unwrap_or_default();
        let mut turn = UnitQuaternion::identity();
        if let Some(own) = node["rotation"].as_array() {
            turn = four(&own.iter().map(|x| x.as_f64().unwrap()).collect::<Vec<_>>());
        }
        for channel in document["animations"][0]["channels"].as_array().unwrap() {
            if channel["target"]["node"] == k {
                let sampler =
                    &document["animations"][0]["samplers"][channel["sampler"].as_u64().unwrap() as usize];
                let all: Vec<f64> = numbers(sampler["output"].as_u64().unwrap() as usize)
                    .into_iter()
                    .map(f64::from)
                    .collect();
                match channel["target"]["path"].as_str().unwrap() {
                    "translation" => place = Vector3::from_column_slice(&all[3..6]),
                    _ => turn = four(&all[4..8]),
                }
            }
        }
        let parent = (0..k).find(|&p| nodes[p]["children"].as_array().is_some_and(|c| c.contains(&k.into())));
        if let Some(parent) = parent {
            let (origin, axes) = poses[parent];
            (place, turn) = (origin + axes * place, axes * turn);
        }
        poses[k] = (place, turn);
        if let Some(marker) = node["name"].as_str().and_then(|name| centres.marker(name).ok()) {
            let p = centres.frame(1).unwrap()[marker].unwrap();
            // forward is z, left x, up y
            assert!((place - Vector3::new(p.y, p.z, p.x)).norm() < 1e-6, "{node}");
            seen += 1;
        }
    }
    assert_eq!(seen, centres.n_markers());

    let (document, numbers) = glb(&writers::glb::write_markers(&markers()).unwrap());
    // the second marker is missing in one frame, in which it has no size
    assert_eq!(document["animations"][0]["channels"].as_array().unwrap().len(), 4);
    let times = numbers(4);
    assert_eq!(times.len(), 7);
    let bounds = &document["accessors"][4];
    assert_eq!(
        (bounds["min"][0].as_f64(), bounds["max"][0].as_f64()),
        (Some(0.0), Some(f64::from(times[6])))
    );
    let far =
        MarkerRecording::try_new(vec!["a".into()], vec![0.0], vec![Some(Vector3::repeat(1e39))]).unwrap();
    assert!(matches!(writers::glb::write_markers(&far), Err(WriteError::OutOfRange { frame: 0, .. })));
    let still = MarkerRecording::try_new(vec!["a".into()], vec![0.0, 1e-60], vec![None; 2]).unwrap();
    assert!(matches!(writers::glb::write_markers(&still), Err(WriteError::OutOfRange { frame: 1, .. })));
}
