//! What is in a file is what is read, to the last digit; what is wrong is named with its place.

use crate::files::{BVH, Bytes, C3d, CSV, TRC, joint_motion};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use somersault_motion::readers::{
    LoadError, MarkerOptions, Place, ReadError, ReadOptions, Recording, Repairs, bvh, c3d, csv, format_of,
    joint_motion, load, read_file, text, trc,
};
use somersault_motion::recording::{Axis, Convention, LengthUnit, RecordingError};
use somersault_motion::writers;
use somersault_multibody::models::Diver;

fn file_axes() -> Convention {
    Convention::z_up(LengthUnit::Metre)
}

fn rotation(order: [Vector3<f64>; 3], degrees: [f64; 3]) -> UnitQuaternion<f64> {
    let turns = [0, 1, 2].map(|k| Rotation3::new(order[k] * degrees[k].to_radians()));
    UnitQuaternion::from_rotation_matrix(&(turns[0] * turns[1] * turns[2]))
}

#[test]
fn a_bvh_is_read_with_any_order_of_channels() {
    let recording = bvh::read(BVH, &file_axes()).unwrap();
    let skeleton = recording.skeleton();
    let names: Vec<&str> = skeleton.joints().iter().map(|j| j.name.as_str()).collect();
    assert_eq!(names, ["Hips", "LeftUpLeg", "LeftLeg", "LeftLeg_end", "Lower Back"]);
    let parents: Vec<_> = skeleton.joints().iter().map(|j| j.parent).collect();
    assert_eq!(parents, [None, Some(0), Some(1), Some(2), Some(0)]);
    assert_eq!(skeleton.joints()[1].offset, Vector3::new(1.36306, -1.79463, 0.83929));
    assert_eq!(recording.times(), [0.0, 0.0083333]);

    let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()];
    let frame: Vec<_> = recording.frame(1).unwrap().collect();
    assert_eq!(frame[0].0, Vector3::new(9.3722, 17.8693, -17.3198));
    assert_eq!(frame[4].0, Vector3::new(0.0, 0.25, -0.2), "a position channel stands for one component");
    let expected = [
        rotation([z, y, x], [-2.0146, -8.2765, 2.5]),
        rotation([z, y, x], [3.0, 25.0, -10.125]),
        rotation([x, z, y], [30.0, 5.0, -7.0]),
        UnitQuaternion::identity(),
        rotation([z, x, y], [12.0, -4.0, 1.0]),
    ];
    for ((_, found), expected) in frame.iter().zip(expected) {
        assert!((found.inverse() * expected).imag().norm() < 1e-15);
    }
}

#[test]
fn a_bvh_with_y_up_stands_in_a_world_with_z_up() {
    let plain = bvh::read(BVH, &file_axes()).unwrap().joint_centres().unwrap();
    let convention = Convention::y_up_z_forward(LengthUnit::Inch);
    let turned = bvh::read(BVH, &convention).unwrap().joint_centres().unwrap();
    for (plain, turned) in plain.frames().flatten().zip(turned.frames().flatten()) {
        let expected = plain.map(|p| Vector3::new(p.z, p.x, p.y) * 0.0254);
        assert!((turned.unwrap() - expected.unwrap()).norm() < 1e-15);
    }
}

#[test]
fn a_trc_is_read_to_the_last_digit() {
    let options = MarkerOptions {
        convention: Convention::y_up_x_forward(LengthUnit::Metre),
        ..MarkerOptions::default()
    };
    let recording = trc::read(TRC, &options).unwrap();
    assert_eq!(recording.names(), ["hip", "knee"]);
    assert_eq!(recording.times(), [0.0, 0.01, 0.02]);
    assert_eq!(recording.frame(0).unwrap()[0], Some(Vector3::new(0.0105, 0.003, 0.90025)));
    assert_eq!(recording.frame(1).unwrap()[1], None);
    assert_eq!(recording.frame(2).unwrap()[1], Some(Vector3::new(0.001, -0.004, 0.002)));
    assert_eq!(trc::read(&TRC.replace('\n', "\r\n"), &options), Ok(recording));
}

#[test]
fn a_csv_is_read_to_the_last_digit() {
    let recording = csv::read(CSV, &MarkerOptions::default()).unwrap();
    assert_eq!(recording.names(), ["hip", "knee"]);
    assert_eq!(recording.frame(0).unwrap()[1], Some(Vector3::new(0.01, -0.02, 0.5)));
    assert_eq!(recording.frame(1).unwrap()[1], None);
    let nan = CSV.replace(",,,", ",NaN,nan,NaN");
    let lenient = MarkerOptions { nan_is_gap: true, ..MarkerOptions::default() };
    assert_eq!(csv::read(&nan, &lenient), Ok(recording));
    let found = csv::read(&nan, &MarkerOptions::default());
    assert!(matches!(found, Err(ReadError::NonFinite { place: Place::Line(4), .. })), "{found:?}");
}

#[test]
fn a_c3d_of_every_processor_is_read_to_the_last_digit() {
    for bytes in [Bytes::Intel, Bytes::Dec, Bytes::Mips] {
        for float in [true, false] {
            let file = C3d { bytes, float, n_frames: 5 }.write();
            let recording = c3d::read(&file, &c3d::C3dOptions::default()).unwrap();
            assert_eq!(recording.names(), C3d::LABELS);
            assert_eq!(recording.times(), [0.0, 1.0, 2.0, 3.0, 4.0].map(|i| i / 200.0));
            for (i, frame) in recording.frames().enumerate() {
                for (k, point) in frame.iter().enumerate() {
                    let expected = Vector3::from_fn(|axis, _| C3d::coordinate(i, k, axis) / 1000.0);
                    let expected = (!C3d::missing(i, k)).then_some(expected);
                    assert_eq!(*point, expected, "{bytes:?}, float {float}: point {k} of frame {i}");
                }
            }
        }
    }
}

#[test]
fn a_joint_motion_has_the_lengths_of_the_diver() {
    let diver = Diver { height: 1.87, ..Diver::spatial() };
    let recording = joint_motion::read(&joint_motion(3), &diver).unwrap();
    let scale = 1.87 / 1.70;
    let times = [0.0, 0.05, 0.1];
    assert!(recording.times().iter().zip(times).all(|(a, b)| (a - b).abs() < 1e-15));
    let centres = recording.joint_centres().unwrap();
    let at = |name: &str| centres.frame(0).unwrap()[centres.marker(name).unwrap()].unwrap();
    assert_eq!(at("root"), Vector3::new(0.0, 0.0, 0.9));
    let chest = Vector3::new(0.0, 0.0, 0.9 + 0.14227 * scale);
    assert!((at("chest") - chest).norm() < 1e-15);
    assert!((at("left_shoulder") - chest - Vector3::new(0.0, 0.166, 0.36109) * scale).norm() < 1e-15);
    // the knee is bent by 0.5 backwards, the elbow by 0.25 forward
    let thigh = at("right_hip") - at("right_knee");
    assert!((thigh - Vector3::z() * 0.41226 * scale).norm() < 1e-15);
    let shank = Vector3::new(-0.5_f64.sin(), 0.0, -0.5_f64.cos()) * 0.42993 * scale;
    assert!((at("right_ankle") - at("right_knee") - shank).norm() < 1e-15);
    let forearm = Vector3::new(0.25_f64.sin(), 0.0, -0.25_f64.cos()) * 0.26257 * scale;
    assert!((at("right_wrist") - at("right_elbow") - forearm).norm() < 1e-15);
}

/// The line of the first error, if that has a line.
fn line_of<T: std::fmt::Debug>(found: Result<T, ReadError>) -> Option<usize> {
    let error = found.expect_err("a wrong file");
    match error.place()? {
        Place::Line(line) => {
            assert!(error.to_string().starts_with(&format!("line {line}: ")), "{error}");
            Some(line)
        }
        Place::Byte(_) => None,
    }
}

#[test]
fn a_wrong_bvh_is_named_with_its_line() {
    let change = |from: &str, to: &str| {
        assert!(BVH.contains(from));
        bvh::read(&BVH.replacen(from, to, 1), &file_axes())
    };
    assert_eq!(line_of(change("HIERARCHY", "HIERACHY")), Some(1));
    assert_eq!(line_of(change("Yrotation Xrotation", "Yrotation Wrotation")), Some(5));
    assert_eq!(line_of(change("CHANNELS 6", "CHANNELS 7")), Some(6));
    assert_eq!(line_of(change("CHANNELS 6", "CHANNELS -6")), Some(5));
    assert_eq!(line_of(change("OFFSET 1.36306", "OFFSET nan")), Some(8));
    assert_eq!(line_of(change("-10.125", "inf")), Some(30));
    assert_eq!(line_of(change("-4 1\n", "-4\n")), Some(30));
    assert_eq!(line_of(change("-4 1\n", "-4 1 7\n")), Some(30));
    assert_eq!(line_of(change("Frame Time: .0083333", "Frame Time: 0")), Some(28));
    let found = change("Frames: 2", "Frames: 3");
    let (place, quantity) = (Place::Line(27), "frames");
    assert_eq!(found, Err(ReadError::Misdeclared { place, quantity, declared: 3, found: 2 }));
    assert_eq!(change("Frames: 2", "Frames: 0"), Err(ReadError::NoFrames { place }));
    let found = change("JOINT LeftLeg", "JOINT Hips");
    let source = RecordingError::DuplicateName { name: "Hips".into() };
    assert_eq!(found, Err(ReadError::Recording { place: Place::Line(10), source }));
    assert_eq!(line_of(change("-10.125", "1e300")), Some(30));
    assert_eq!(line_of(change("-10.125", "-1.1e9")), Some(30));
    let slow = BVH.replace("Frame Time: .0083333", "Frame Time: 1e308");
    assert!(bvh::read(&slow, &file_axes()).is_ok());
    let third = BVH.lines().last().unwrap();
    let late = slow.replace("Frames: 2", "Frames: 4") + &format!("{third}\n{third}\n");
    assert_eq!(line_of(bvh::read(&late, &file_axes())), Some(28));
    for (i, _) in BVH.char_indices().filter(|(i, _)| *i < BVH.len() - 3) {
        assert!(bvh::read(&BVH[..i], &file_axes()).is_err(), "cut after {i} bytes");
    }
}

#[test]
fn a_wrong_trc_is_named_with_its_line() {
    let change = |from: &str, to: &str| {
        assert!(TRC.contains(from));
        trc::read(&TRC.replacen(from, to, 1), &MarkerOptions::default())
    };
    assert_eq!(line_of(change("PathFileType", "Path")), Some(1));
    assert_eq!(line_of(change("NumMarkers", "Markers")), Some(2));
    assert_eq!(line_of(change("mm", "furlong")), Some(3));
    assert_eq!(line_of(change("\t3\t2\tmm", "\tx\t2\tmm")), Some(3));
    assert_eq!(line_of(change("hip\t\t\tknee", "hip\t\tknee")), Some(4));
    assert_eq!(line_of(change("900.25", "9oo")), Some(7));
    assert_eq!(line_of(change("900.25", "nan")), Some(7));
    assert_eq!(line_of(change("\t3\n2\t", "\n2\t")), Some(7));
    assert_eq!(line_of(change("901", "")), Some(8));
    let place = Place::Line(3);
    let found = change("\t3\t2\tmm", "\t4\t2\tmm");
    assert_eq!(found, Err(ReadError::Misdeclared { place, quantity: "frames", declared: 4, found: 3 }));
    let found = change("\t3\t2\tmm", "\t3\t999999999999\tmm");
    let declared = 999_999_999_999;
    assert_eq!(found, Err(ReadError::Misdeclared { place, quantity: "markers", declared, found: 2 }));
    let header: String = TRC.split_inclusive('\n').take(6).collect();
    let found = trc::read(&header, &MarkerOptions::default());
    assert_eq!(found, Err(ReadError::NoFrames { place: Place::Line(6) }));
    let found = change("0.020", "0.010");
    let source = RecordingError::TimesNotGrowing { frame: 2, found: 0.01, before: 0.01 };
    assert_eq!(found, Err(ReadError::Recording { place: Place::Line(9), source }));
    assert_eq!(line_of(change("knee", "hip")), Some(4));
    assert_eq!(line_of(change("Time\thip\t\t\tknee", "Time\t\t\t\t")), Some(3));
}

#[test]
fn a_wrong_csv_is_named_with_its_line() {
    let change = |from: &str, to: &str| {
        assert!(CSV.contains(from));
        csv::read(&CSV.replacen(from, to, 1), &MarkerOptions::default())
    };
    assert_eq!(line_of(change("hip_y", "hip_z")), Some(2));
    assert_eq!(line_of(change(",knee_z", "")), Some(2));
    assert_eq!(line_of(change("time", "t")), Some(2));
    assert_eq!(line_of(change("0.11,", "")), Some(4));
    assert_eq!(line_of(change("0.52", "0.52,1")), Some(5));
    assert_eq!(line_of(change("0.52", "x")), Some(5));
    assert_eq!(line_of(change("0.52", "inf")), Some(5));
    assert_eq!(line_of(csv::read("", &MarkerOptions::default())), Some(1));
    assert_eq!(line_of(csv::read("time,a_x,a_y,a_z\n", &MarkerOptions::default())), Some(1));
    let found = csv::read("time\n0\n", &MarkerOptions::default());
    let source = RecordingError::Empty { argument: "markers" };
    assert_eq!(found, Err(ReadError::Recording { place: Place::Line(1), source }));
    assert_eq!(line_of(change("\n0.02,", "\n0.01,")), Some(5));
    assert_eq!(line_of(change("\n0.02,", "\n-1e300,")), Some(5));
    assert_eq!(line_of(change("knee_x,knee_y,knee_z", "hip_x,hip_y,hip_z")), Some(2));
}

#[test]
fn a_joint_of_a_bvh_may_have_several_ends() {
    let two = BVH.replace("\t\t\tEnd Site", "\t\t\tEnd Site\n{ OFFSET 1 2 3 }\n\t\t\tEnd Site");
    let recording = bvh::read(&two, &file_axes()).unwrap();
    let joints = recording.skeleton().joints();
    let ends: Vec<_> = joints.iter().filter(|j| j.parent == Some(2)).collect();
    assert_eq!(ends.iter().map(|j| j.name.as_str()).collect::<Vec<_>>(), ["LeftLeg_end", "LeftLeg_end2"]);
    assert_eq!(ends[0].offset, Vector3::new(1.0, 2.0, 3.0));
    assert_eq!(ends[1].offset, Vector3::new(2.5, -7.1, 0.0));
    let again = bvh::read(&writers::bvh::write(&recording, &file_axes()).unwrap(), &file_axes()).unwrap();
    assert_eq!(again.skeleton(), recording.skeleton());
}

#[test]
fn points_of_a_c3d_have_names_of_their_own() {
    let mut file = C3d { bytes: Bytes::Intel, float: true, n_frames: 1 }.write();
    let labels = file.windows(6).position(|w| w == b"LHIP  ").unwrap();
    file[labels..labels + 18].copy_from_slice(b"pointspointspoints");
    let read = |file: &[u8]| {
        let mut repairs = Repairs::allowed();
        let found = c3d::read_repaired(file, &c3d::C3dOptions::default(), &mut repairs).unwrap();
        (found.names().to_vec(), repairs.into_list())
    };
    // labels of which two are the same need a repair, points without any are numbered
    let (names, repairs) = read(&file);
    assert_eq!(names, ["points", "points 2", "points 3"]);
    assert!(
        !repairs[0].is_decision && repairs[0].what == "points of the same name are numbered",
        "{repairs:?}"
    );
    let found = c3d::read(&file, &c3d::C3dOptions::default());
    assert!(
        matches!(found, Err(ReadError::Recording { source: RecordingError::DuplicateName { .. }, .. })),
        "{found:?}"
    );
    // seven characters for each label: the first is what the second would be called
    let dimensions = labels - 2;
    file[dimensions..dimensions + 2].copy_from_slice(&[7, 2]);
    file[labels..labels + 14].copy_from_slice(b"point 2       ");
    let (names, repairs) = read(&file);
    assert_eq!(names, ["point 2", "point 2'", "point 3"]);
    assert!(
        repairs[0].is_decision && repairs[0].what == "points without a label are numbered: 2",
        "{repairs:?}"
    );
    // a file without a unit
    let unit = file.windows(5).position(|w| w == b"UNITS").unwrap();
    file[unit..unit + 5].copy_from_slice(b"UNIT_");
    let (_, repairs) = read(&file);
    assert!(
        repairs.iter().any(|one| one.is_decision && one.what == "no unit is declared, mm is taken"),
        "{repairs:?}"
    );
}

#[test]
fn nan_in_a_c3d_is_a_gap_if_asked_for() {
    let mut file = C3d { bytes: Bytes::Intel, float: true, n_frames: 2 }.write();
    let nan = |file: &mut [u8], k: usize| file[1536 + 4 * k..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let lenient = c3d::C3dOptions { nan_is_gap: true, ..c3d::C3dOptions::default() };
    nan(&mut file, 0);
    // a single coordinate is a fault
    let found = c3d::read(&file, &lenient);
    assert!(matches!(found, Err(ReadError::NonFinite { place: Place::Byte(1536), .. })), "{found:?}");
    nan(&mut file, 1);
    nan(&mut file, 2);
    let found = c3d::read(&file, &lenient).unwrap();
    assert_eq!(found.frame(0).unwrap().iter().map(Option::is_some).collect::<Vec<_>>(), [false, true, true]);
    assert!(c3d::read(&file, &c3d::C3dOptions::default()).is_err());
}

#[test]
fn a_wrong_c3d_is_named_with_its_byte() {
    let whole = C3d { bytes: Bytes::Intel, float: true, n_frames: 4 }.write();
    let read = |file: &[u8]| c3d::read(file, &c3d::C3dOptions::default());
    let change = |at: usize, to: &[u8]| {
        let mut file = whole.clone();
        file[at..at + to.len()].copy_from_slice(to);
        read(&file)
    };
    let mark = change(1, &[0]);
    assert!(matches!(mark, Err(ReadError::Unexpected { place: Place::Byte(1), .. })), "{mark:?}");
    let processor = change(515, &[83]);
    assert!(matches!(processor, Err(ReadError::Unexpected { place: Place::Byte(515), .. })), "{processor:?}");
    let block = change(16, &[9, 0]);
    assert!(matches!(block, Err(ReadError::Misdeclared { found: 0, declared: 4, .. })), "{block:?}");
    // where neither has what is there, that of the parameter is named, its data begin where it is declared
    let frames = whole.windows(6).position(|w| w == b"FRAMES").unwrap() + 10;
    let mut long = whole.clone();
    (long[8], long[frames]) = (9, 8);
    let (place, quantity) = (Place::Byte(frames), "frames");
    assert_eq!(read(&long), Err(ReadError::Misdeclared { place, quantity, declared: 8, found: 4 }));
    let unit = whole.windows(4).position(|w| w == b"mm  ").unwrap();
    let found = change(unit, b"fur ");
    assert!(matches!(found, Err(ReadError::Unexpected { place: Place::Byte(at), .. }) if at == unit));
    let nan = change(1536 + 4, &f32::NAN.to_le_bytes());
    assert!(matches!(nan, Err(ReadError::NonFinite { place: Place::Byte(1540), .. })), "{nan:?}");
    // the analog data of the last frame may be cut off, points may not
    assert!(read(&whole[..whole.len() - 8]).is_ok());
    for n in 0..whole.len() - 8 {
        assert!(read(&whole[..n]).is_err(), "cut after {n} bytes");
    }
}

#[test]
fn where_header_and_parameters_of_a_c3d_differ_the_length_of_the_file_decides() {
    for (bytes, float) in [(Bytes::Intel, true), (Bytes::Mips, false), (Bytes::Dec, true)] {
        let whole = C3d { bytes, float, n_frames: 40 }.write();
        let read = |file: &[u8]| c3d::read(file, &c3d::C3dOptions::default()).unwrap();
        let expected = read(&whole);
        assert_eq!(c3d::contradictions(&whole).unwrap(), []);
        let word = |x: u16| if bytes == Bytes::Mips { x.to_be_bytes() } else { x.to_le_bytes() };
        let place = |name: &str, nth: usize| {
            let places = whole.windows(name.len()).enumerate().filter(|(_, w)| *w == name.as_bytes());
            places.map(|(at, _)| at + name.len() + 4).nth(nth).unwrap()
        };
        // in the header and in the parameters: what is declared there, and what is true
        let wrong: [(&str, usize, u16, f64); 8] = [
            ("points", 2, 4, 3.0),
            ("points", place("USED", 0), 1, 3.0),
            ("analog values a frame", 4, 1, 2.0),
            ("analog values a frame", place("USED", 1), 7, 2.0),
            ("frames", 8, 39, 40.0),
            ("frames", 8, 41, 40.0),
            ("frames", place("FRAMES", 0), 38, 40.0),
            ("frames", place("FRAMES", 0), 400, 40.0),
        ];
        for (quantity, at, value, truth) in wrong {
            let mut file = whole.clone();
            file[at..at + 2].copy_from_slice(&word(value));
            assert_eq!(read(&file), expected, "{bytes:?}: {quantity} {value} at byte {at}");
            let found = c3d::contradictions(&file).unwrap();
            let [found] = found[..] else { panic!("{bytes:?}: {quantity} {value} at byte {at}: {found:?}") };
            assert_eq!((found.quantity, found.used), (quantity, truth));
            assert_eq!(found.decided, c3d::Decision::Length);
            assert!(found.header != found.parameter && found.to_string().contains(quantity), "{found}");
        }
        // the sign of the scale, which says whether numbers are floats
        let mut file = whole.clone();
        file[if bytes == Bytes::Intel { 15 } else { 13 }] ^= if bytes == Bytes::Mips { 0 } else { 0x80 };
        file[12] ^= if bytes == Bytes::Mips { 0x80 } else { 0 };
        assert_eq!(read(&file), expected, "{bytes:?}");
        assert_eq!(c3d::contradictions(&file).unwrap()[0].quantity, "scale");
    }
}

#[test]
fn blanks_in_the_last_block_of_a_c3d_are_no_points() {
    let mut file = C3d { bytes: Bytes::Intel, float: true, n_frames: 4 }.write();
    file.resize(file.len().next_multiple_of(512), 0);
    let read = |file: &[u8]| c3d::read(file, &c3d::C3dOptions::default()).unwrap();
    let expected = read(&file);
    // four frames of four points would end nearer to the end of the file
    file[2] = 4;
    assert_eq!(read(&file), expected);
    let used = c3d::contradictions(&file).unwrap()[0];
    assert_eq!((used.quantity, used.used, used.header), ("points", 3.0, 4.0));
}

#[test]
fn a_c3d_whose_parameters_end_nowhere_or_whose_unit_is_cut_is_read() {
    let whole = C3d { bytes: Bytes::Mips, float: false, n_frames: 4 }.write();
    let read = |file: &[u8]| c3d::read(file, &c3d::C3dOptions::default()).unwrap();
    let mut file = whole.clone();
    // the distance from the last parameter, in the order of bytes of another processor
    let last = whole.windows(4).rposition(|w| w == b"RATE").unwrap();
    file[last + 4..last + 6].copy_from_slice(&[0x3f, 0x01]);
    assert_eq!(read(&file), read(&whole));
    let unit = whole.windows(4).position(|w| w == b"mm  ").unwrap();
    file[unit..unit + 4].copy_from_slice(b"mete");
    assert_eq!(
        read(&file).frame(0).unwrap()[0].unwrap(),
        read(&whole).frame(0).unwrap()[0].unwrap() * 1000.0
    );
}

#[test]
fn the_first_frame_of_a_c3d_is_at_the_time_of_its_number() {
    let mut file = C3d { bytes: Bytes::Intel, float: true, n_frames: 4 }.write();
    (file[6], file[8]) = (101, 104);
    let found = c3d::read(&file, &c3d::C3dOptions::default()).unwrap();
    assert_eq!(found.times(), [0.5, 0.505, 0.51, 0.515]);
    assert_eq!(c3d::contradictions(&file).unwrap(), []);
}

#[test]
fn a_wrong_joint_motion_is_named_with_its_line() {
    let diver = Diver::spatial();
    let whole = joint_motion(3);
    let change = |from: &str, to: &str| {
        assert!(whole.contains(from));
        joint_motion::read(&whole.replacen(from, to, 1), &diver)
    };
    assert_eq!(line_of(change(", 0.25", "")), Some(5));
    assert_eq!(line_of(change(", 0.25", ", 0.25, 1")), Some(5));
    assert_eq!(line_of(change("0.25", "NaN")), Some(5));
    assert_eq!(line_of(change("0.25", "1e999")), Some(5));
    assert_eq!(line_of(change("1, 0, 0", "2, 1, 0")), Some(5));
    assert_eq!(line_of(change("0.05", "-0.05")), Some(5));
    assert_eq!(line_of(change("0.25", "1e300")), Some(5));
    // the second frame is at the time of the first, or too far from it
    assert_eq!(line_of(change("0.05", "0")), Some(6));
    assert_eq!(line_of(joint_motion::read(&whole.replace("0.05", "1e308"), &diver)), Some(7));
    let found = change("1, 0, 0", "0.1, 0, 0").unwrap_err().to_string();
    let expected = "line 5: quaternion at number 4 of norm 0.1, allowed is 0.5 to 2 (column ";
    assert!(found.starts_with(expected), "{found}");
    let none = joint_motion::read("motion", &diver).unwrap_err().to_string();
    let allowed = "a motion is an object with Frames of 44 numbers each, as JSON";
    assert_eq!(none, format!("line 1: expected value; {allowed} (column 1)"));
    let long = format!("{{\"Frames\": \"{}\"}}", "x".repeat(1000));
    let Err(ReadError::Malformed { reason: found, .. }) = joint_motion::read(&long, &diver) else { panic!() };
    assert!(found.chars().count() == 121 && found.ends_with('…'), "{found}");
    let nobody = Diver { height: -1.0, ..diver };
    assert!(matches!(joint_motion::read(&whole, &nobody), Err(ReadError::Diver(_))));
    assert_eq!(line_of(joint_motion::read("{\"Frames\": []}", &diver)), Some(1));
    let deep = format!("{{\"Frames\": {}", "[".repeat(100_000));
    assert_eq!(line_of(joint_motion::read(&deep, &diver)), Some(1));
    for i in 0..whole.len() - 1 {
        assert!(joint_motion::read(&whole[..i], &diver).is_err(), "cut after {i} bytes");
    }
}

#[test]
fn paths_are_named() {
    let found = load("no such file", |bytes| csv::read(text(bytes)?, &MarkerOptions::default()));
    assert!(found.unwrap_err().to_string().contains("no such file"));
    let found = text(&[b'a', 0xff]);
    assert_eq!(found, Err(ReadError::Encoding { place: Place::Byte(1) }));
}

#[test]
fn a_file_is_read_whatever_its_ending_says() {
    let c3d_file = C3d { bytes: Bytes::Intel, float: true, n_frames: 3 }.write();
    let motion = joint_motion(2);
    let centimetres = ReadOptions { unit: Some(LengthUnit::Centimetre), ..ReadOptions::default() };
    let y_up = MarkerOptions {
        convention: Convention::y_up_x_forward(LengthUnit::Metre),
        ..MarkerOptions::default()
    };
    let skeleton = |text: &str| {
        bvh::read(text, &Convention::y_up_z_forward(LengthUnit::Centimetre)).map(Recording::Skeleton)
    };
    let folder = std::env::temp_dir().join(format!("somersault-endings-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let read = |name: &str, bytes: &[u8], options: &ReadOptions| {
        let path = folder.join(name);
        std::fs::write(&path, bytes).unwrap();
        read_file(path, options).map(|found| found.recording)
    };
    let markers = Recording::Markers;
    let own = ReadOptions::default();
    for (name, bytes, options, expected) in [
        ("a.csv", CSV.as_bytes(), own, csv::read(CSV, &MarkerOptions::default()).map(markers)),
        ("a.TRC", TRC.as_bytes(), centimetres, trc::read(TRC, &y_up).map(markers)),
        ("a.c3d", &c3d_file, centimetres, c3d::read(&c3d_file, &c3d::C3dOptions::default()).map(markers)),
        ("a.bvh", BVH.as_bytes(), centimetres, skeleton(BVH)),
        (
            "a.txt",
            motion.as_bytes(),
            own,
            joint_motion::read(&motion, &Diver::spatial()).map(Recording::Skeleton),
        ),
    ] {
        assert_eq!(read(name, bytes, &options), Ok(expected.unwrap()), "{name}");
    }
    let unknown = read("a.mov", b"moov", &own).unwrap_err();
    assert!(matches!(unknown, LoadError::UnknownFormat { .. }));
    assert!(
        unknown.to_string().contains("begins with `moov` and has none of the known formats: C3D, TRC"),
        "{unknown}"
    );
    std::fs::remove_dir_all(&folder).unwrap();
    let bvh = format_of("bvh").unwrap();
    assert_eq!(bvh.read(BVH.as_bytes(), &own), Err(ReadError::NoUnit { format: "BVH" }));
    let parallel = ReadOptions { up: Some(Axis::PlusZ), ..centimetres };
    assert!(matches!(bvh.read(BVH.as_bytes(), &parallel), Err(ReadError::Axes(_))));
}

/// What the caller leaves open is what the reader of the format takes by itself, so that both say the same.
#[test]
fn a_format_has_the_conventions_of_its_reader() {
    let convention = |ending: &str, unit: LengthUnit| {
        let format = format_of(ending).unwrap();
        assert!(format.unit.is_none_or(|own| own == unit));
        Convention::try_new(unit, format.up, format.forward).unwrap()
    };
    assert_eq!(convention("csv", LengthUnit::Metre), MarkerOptions::default().convention);
    assert_eq!(convention("c3d", LengthUnit::Millimetre), c3d::C3dOptions::default().convention);
    assert_eq!(convention("trc", LengthUnit::Metre), Convention::y_up_x_forward(LengthUnit::Metre));
    assert_eq!(convention("bvh", LengthUnit::Inch), Convention::y_up_z_forward(LengthUnit::Inch));
}
