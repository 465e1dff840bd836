//! What programs write that is not quite of their format: read, with each repair listed.

use crate::files::{BVH, Bytes, C3d, CSV, TRC};
use nalgebra::Vector3;
use somersault_motion::readers::{
    FORMATS, LoadError, Place, ReadError, ReadOptions, Recording, RecordingFile, Repair, c3d, csv, format_of,
    format_of_content, mot, read_file, read_named, trc,
};
use somersault_motion::recording::{Axis, ChannelRecording, KeypointRecording, LengthUnit, MarkerRecording};
use somersault_motion::writers;

pub(crate) fn read_with(text: &[u8], options: &ReadOptions) -> Result<RecordingFile, LoadError> {
    read_named("file", text, options)
}

fn read(text: &str) -> RecordingFile {
    read_with(text.as_bytes(), &ReadOptions::default()).unwrap()
}

fn markers(file: RecordingFile) -> (MarkerRecording, Vec<Repair>) {
    match file.recording {
        Recording::Markers(recording) => (recording, file.repairs),
        other => panic!("{other:?}"),
    }
}

fn channels(file: RecordingFile) -> (ChannelRecording, Vec<Repair>) {
    match file.recording {
        Recording::Channels(recording) => (recording, file.repairs),
        other => panic!("{other:?}"),
    }
}

pub(crate) fn keypoints(text: &str, rate: f64) -> (KeypointRecording, Vec<Repair>) {
    let options = ReadOptions { rate: Some(rate), ..ReadOptions::default() };
    let file = read_with(text.as_bytes(), &options).unwrap();
    match file.recording {
        Recording::Keypoints(recording) => (recording, file.repairs),
        other => panic!("{other:?}"),
    }
}

/// Read with a repair that says this, of this line, and refused by a strict reader.
fn repaired(text: &str, line: usize, says: &str) -> RecordingFile {
    let file = read(text);
    let found = file.repairs.iter().find(|repair| repair.what.contains(says));
    let found = found.unwrap_or_else(|| panic!("no `{says}` among {:?}", file.repairs));
    assert_eq!(found.place, Place::Line(line), "{found}");
    let strict = ReadOptions { strict: true, ..ReadOptions::default() };
    if !found.is_decision {
        assert!(read_with(text.as_bytes(), &strict).is_err(), "strict, but `{says}` is read");
    }
    file
}

/// A file of each kind, for tests that change them.
pub(crate) fn files() -> Vec<String> {
    let openpose = format!("{{\"people\":[{{\"pose_keypoints_2d\":{}}}]}}", flat(25, 3));
    let landmark = "{\"x\":0.1,\"y\":-0.5,\"z\":0.2,\"visibility\":0.8}";
    let mediapipe = format!("[{{\"timestamp\":0,\"pose_landmarks\":[{}]}}]", vec![landmark; 33].join(","));
    let instance = "{\"keypoints\":[[1,2],[3,4]],\"keypoint_scores\":[0.5,0.6]}";
    let mmpose = format!(
        "[{{\"frame_id\":0,\"instances\":[{instance}]}},{{\"frame_id\":1,\"instances\":[{instance}]}}]"
    );
    let coco =
        format!("[{{\"image_id\":1,\"keypoints\":{0}}},{{\"image_id\":2,\"keypoints\":{0}}}]", flat(17, 3));
    let named = format!("{{\"1.json\":{openpose},\"2.json\":{openpose}}}");
    let point = |id: usize| format!("{{\"id\":{id},\"name\":\"p{id}\",\"x\":0.1,\"y\":NaN}}");
    let numbered = format!("[{{\"frame\":0,\"keypoints\":[{},{}]}}]", point(3), point(7));
    let tracked = coco.replace("\"keypoints", "\"idx\":1,\"keypoints").replacen(":1,\"k", ":2,\"k", 1);
    let own = [MOT, MOTIVE, NEXUS, QTM].map(String::from);
    own.into_iter().chain([openpose, mediapipe, mmpose, coco, named, numbered, tracked]).collect()
}

#[test]
fn a_file_is_known_by_what_it_has() {
    let c3d_file = C3d { bytes: Bytes::Intel, float: true, n_frames: 3 }.write();
    let openpose = "{\"version\": 1.3, \"people\": []}";
    for (bytes, name) in [
        (c3d_file.as_slice(), "C3D"),
        (TRC.as_bytes(), "TRC"),
        (BVH.as_bytes(), "BVH"),
        (CSV.as_bytes(), "CSV or TSV"),
        (MOT.as_bytes(), "MOT or STO"),
        (openpose.as_bytes(), "key points (JSON)"),
        (crate::files::joint_motion(1).as_bytes(), "motions of DeepMimic"),
    ] {
        assert_eq!(format_of_content(bytes).unwrap().name, name);
    }
    let file = read_named("jump.csv", TRC.as_bytes(), &ReadOptions::default()).unwrap();
    assert_eq!(file.repairs[0].what, "the name is that of CSV or TSV, but the file is TRC");
    let found =
        read_with(b"\x89PNG\x0d\x0a\x1a\x0a\0\0\0\rIHDR", &ReadOptions::default()).unwrap_err().to_string();
    let known = "none of the known formats: C3D, TRC, BVH, motions of DeepMimic, key points (JSON), MOT or STO and CSV or TSV";
    assert!(found.ends_with(known), "{found}");
    assert!(FORMATS.iter().all(|format| format.endings.iter().all(|ending| format_of(ending).is_some())));
}

#[test]
fn a_trc_of_other_programs_is_read_and_its_repairs_are_said() {
    let (plain, repairs) = markers(read(TRC));
    // hip and knee do not show the vertical
    let [of_vertical] = &repairs[..] else { panic!("{repairs:?}") };
    assert!(of_vertical.is_decision && of_vertical.what.starts_with("y is taken to be up, as is usual"));
    let given = ReadOptions { up: Some(Axis::PlusY), ..ReadOptions::default() };
    assert_eq!(markers(read_with(TRC.as_bytes(), &given).unwrap()), (plain.clone(), vec![]));
    let same = |text: &str, line, says: &str| {
        let (found, _) = markers(repaired(text, line, says));
        assert_eq!(found, plain, "{says}");
    };
    // OpenSim's and Pose2Sim's own files after frames were cut out of them
    same(&TRC.replace("\t3\t2\tmm", "\t90\t2\tmm"), 3, "90 frames are declared, 3 are there");
    same(&TRC.replace("\t3\t2\tmm", "\t3\t40\tmm"), 3, "40 markers are declared, 2 are there");
    // spreadsheets
    let commas = TRC.replace('\t', ",");
    same(&commas, 4, "cells are not apart by tabs");
    let decimal = TRC.replace("10.5", "10,5").replace("0.010", "0,010");
    same(&decimal, 7, "numbers have a decimal comma");
    let tails: String = TRC.lines().map(|line| format!("{line}\t\t\t\t\n")).collect();
    assert_eq!(markers(read(&tails)).0, plain);
    // Vicon Nexus ends rows at the last marker that it saw
    let short = TRC.replace("\t-3\t\t\t\n", "\t-3\n");
    same(&short, 8, "a row ends early");
    // Cortex and Pose2Sim have NaN or nothing for markers that were not seen
    let nan = TRC.replace("\t-3\t\t\t\n", "\t-3\tNaN\tnan\t-nan\n");
    same(&nan, 8, "`nan_is_gap`");
    let asked = ReadOptions { nan_is_gap: true, strict: true, ..ReadOptions::default() };
    let asked = read_with(nan.as_bytes(), &asked).unwrap();
    assert_eq!((markers(asked.clone()).0, asked.repairs.len()), (plain.clone(), 0));
    let part = TRC.replace("\t-3\t\t\t\n", "\t-3\t1\t\t\n");
    same(&part, 8, "a marker that lacks a coordinate is missing");
    // OpenSim 4 leaves out the blank line, older programs the row of coordinates
    assert_eq!(markers(read(&TRC.replace("Z2\n\n", "Z2\n"))).0, plain);
    let bare: String =
        TRC.lines().enumerate().filter(|(i, _)| *i != 4).map(|(_, l)| format!("{l}\n")).collect();
    let (found, repairs) = markers(read(&bare.replace("\n\n", "\n")));
    assert_eq!((found, repairs[0].place), (plain.clone(), Place::Line(5)));
    // BTK: columns without a name, with coordinates and without; OpenSim's `std_` files: an empty column before the first
    let unnamed = TRC.replace("knee", "");
    let (found, _) = markers(repaired(&unnamed, 4, "markers without a name are numbered"));
    assert_eq!(found.names(), ["hip", "marker 2"]);
    let empty: String = TRC
        .lines()
        .map(|l| {
            if l.starts_with(|c: char| c.is_ascii_digit()) {
                format!("{l}\t\t\t\n")
            } else {
                format!("{l}\n")
            }
        })
        .collect();
    assert_eq!(markers(read(&empty)).0, plain);
    let lead = |line: &str| match line.splitn(3, '\t').collect::<Vec<_>>()[..] {
        [a, b, c] => format!("{a}\t{b}\t\t{c}\n"),
        _ => format!("{line}\n"),
    };
    let wide: String =
        TRC.lines().enumerate().map(|(i, l)| if i < 3 { format!("{l}\n") } else { lead(l) }).collect();
    same(&wide, 4, "empty columns stand before the first marker");
    // runs of tabs
    let runs: String = TRC
        .lines()
        .enumerate()
        .map(
            |(i, l)| {
                if i < 6 || i == 7 { format!("{l}\n") } else { format!("{}\n", l.replace('\t', "\t\t")) }
            },
        )
        .collect();
    let whole =
        runs.replace("2\t0.010\t10.6\t901\t-3\t\t\t\n", "2\t\t0.010\t\t10.6\t\t901\t\t-3\t\t1\t\t2\t\t3\n");
    let (found, _) = markers(repaired(&whole, 7, "runs of tabs"));
    assert_eq!(found.frame(2), plain.frame(2));
    // missing and repeated numbers and times are those of the rate
    same(&TRC.replace("\n2\t0.010", "\n\t"), 8, "a frame has no number");
    same(&TRC.replace("2\t0.010", "2\t0.000"), 8, "times do not rise");
    same(&TRC.replace("\t0.010\t", "\t\t"), 8, "frames without a time");
    let twice = TRC.replace("knee", "hip");
    assert_eq!(markers(repaired(&twice, 4, "markers of the same name")).0.names(), ["hip", "hip 2"]);
    // a number for each marker, and points that all end within
    for (row, cells) in [("\t10.5\t900", 4), ("\t10.5\t900\t3\t7", 6)] {
        let narrow: String = TRC.lines().enumerate().fold(String::new(), |text, (i, line)| {
            let start: Vec<&str> = line.split('\t').take(2).collect();
            text + &if i < 6 { format!("{line}\n") } else { format!("{}{row}\n", start.join("\t")) }
        });
        let found = read_with(narrow.as_bytes(), &ReadOptions::default()).unwrap_err().to_string();
        assert!(
            found.contains(&format!("line 7: found `{cells} cells`, allowed is 8 cells for 2 markers")),
            "{found}"
        );
    }
    // a file that was cut while it was written
    let cut = TRC.trim_end().strip_suffix("\t4").unwrap();
    let (found, _) = markers(repaired(cut, 9, "the last row is incomplete"));
    assert_eq!(found.n_frames(), 2);
}

#[test]
fn text_of_other_encodings_is_read() {
    let plain = markers(read(TRC)).0;
    let with = |mark: &[u8], order: fn(u16) -> [u8; 2]| -> Vec<u8> {
        mark.iter().copied().chain(TRC.encode_utf16().flat_map(order)).collect()
    };
    for (bytes, n_repairs) in [
        (with(&[0xff, 0xfe], u16::to_le_bytes), 1),
        (with(&[0xfe, 0xff], u16::to_be_bytes), 1),
        (with(&[], u16::to_le_bytes), 1),
        ([&[0xef, 0xbb, 0xbf], TRC.as_bytes()].concat(), 0),
        (TRC.replace('\n', "\r").into_bytes(), 0),
    ] {
        let given = ReadOptions { up: Some(Axis::PlusY), ..ReadOptions::default() };
        let (found, repairs) = markers(read_with(&bytes, &given).unwrap());
        assert_eq!((found, repairs.len()), (plain.clone(), n_repairs));
    }
    let mut latin = TRC.replace("knee", "kn@e").into_bytes();
    let at = latin.iter().position(|&b| b == b'@').unwrap();
    latin[at] = 0xe9;
    let (found, repairs) = markers(read_with(&latin, &ReadOptions::default()).unwrap());
    assert_eq!(found.names()[1], "knée");
    assert!(repairs[0].what.contains("Latin-1"));
}

#[test]
fn the_vertical_is_the_one_that_markers_show() {
    // TRC of a system with z up: a head above feet
    let standing = MarkerRecording::try_new(
        ["LHEAD", "RHEAD", "LTOE", "RTOE"].map(String::from).to_vec(),
        vec![0.0, 0.01],
        [1.7, 1.7, 0.1, 0.1, 1.7, 1.7, 0.1, 0.1].map(|z| Some(Vector3::new(0.1, -0.2, z))).to_vec(),
    )
    .unwrap();
    let z_up = somersault_motion::recording::Convention::z_up(LengthUnit::Millimetre);
    let text = writers::trc::write(&standing, "stand.trc", &z_up).unwrap();
    let (found, repairs) = markers(read(&text));
    assert!((found.frame(0).unwrap()[0].unwrap() - Vector3::new(0.1, -0.2, 1.7)).norm() < 1e-12);
    assert!(
        repairs[0].is_decision
            && repairs[0].what.starts_with("z is taken to be up, since heads are above feet")
    );
    // a strict reader, and a caller who says so, take y
    for options in [
        ReadOptions { strict: true, ..ReadOptions::default() },
        ReadOptions { up: Some(Axis::PlusY), ..ReadOptions::default() },
    ] {
        let (found, repairs) = markers(read_with(text.as_bytes(), &options).unwrap());
        assert_eq!(repairs, []);
        assert!((found.frame(0).unwrap()[0].unwrap().z + 0.2).abs() < 1e-12);
    }
    // a somersault shows it by its fall, in which the mean of markers is not quite a parabola
    let times: Vec<f64> = (0..80).map(|i| f64::from(i) / 80.0).collect();
    let points = times.iter().flat_map(|t| {
        let centre = Vector3::new(1.5 * t, 0.1, 3.0 + 4.0 * t - 4.905 * t * t);
        let arm = Vector3::new((5.0 * t).sin(), 0.0, (5.0 * t).cos());
        [Some(centre + 0.7 * arm), Some(centre - 0.7 * arm)]
    });
    let flight =
        MarkerRecording::try_new(vec!["a".into(), "b".into()], times.clone(), points.collect()).unwrap();
    let text = writers::trc::write(&flight, "flight.trc", &z_up).unwrap();
    let (found, repairs) = markers(read(&text));
    assert!(repairs[0].what.contains("markers fall along it"), "{repairs:?}");
    assert!((found.frame(0).unwrap()[0].unwrap().z - 3.7).abs() < 1e-12);
}

/// As opensim-models and SIMM write them: version line, remarks, padded with blanks or tabs.
const MOT: &str = "Coordinates
version=1
nRows=3
nColumns=4
inDegrees=yes

Units are S.I. units (second, meters, Newtons, ...)
Angles are in degrees.

endheader
time\tpelvis_ty\tknee_angle_r\t/jointset/hip_r/hip_flexion_r/speed
      0.00000000\t      0.95\t     90.00000000\t180
      0.01000000\t      0.94\t     45.00000000\t-180
      0.02000000\t      0.93\t      0.00000000\tNaN
";

#[test]
fn a_mot_is_read_and_degrees_become_radians() {
    let (found, repairs) = channels(read(MOT));
    assert_eq!(found.names(), ["pelvis_ty", "knee_angle_r", "/jointset/hip_r/hip_flexion_r/speed"]);
    assert_eq!(found.times(), [0.0, 0.01, 0.02]);
    assert_eq!(found.units(), ["", "rad", "rad"]);
    let pi = std::f64::consts::PI;
    assert_eq!(found.frame(0), Some(&[0.95, pi / 2.0, pi][..]));
    assert!(found.frame(2).unwrap()[2].is_nan());
    let [said, left] = &repairs[..] else { panic!("{repairs:?}") };
    assert!(said.is_decision && said.place == Place::Line(5), "{said}");
    assert!(said.what.starts_with("2 columns are converted from degrees to radians: knee_angle_r, "));
    assert!(left.is_decision && left.what == "1 columns are no angles by their names: pelvis_ty", "{left}");
    let (as_it_is, _) = channels(read(&MOT.replace("inDegrees=yes", "inDegrees=no")));
    assert_eq!(as_it_is.frame(0), Some(&[0.95, 90.0, 180.0][..]));
    assert_eq!(mot::read(MOT).unwrap().recording, found);
    // SIMM's header, blanks between cells, quotes and commas of spreadsheets
    let simm = "name jump.mot\ndatacolumns 2\ndatarows 2\nrange 0 0.1\nendheader\ntime knee\n0 1\n0.1 2\n";
    assert_eq!(channels(read(simm)).0.track("knee").unwrap().collect::<Vec<_>>(), [1.0, 2.0]);
    // a key that no program is known to write is listed
    let (_, repairs) = channels(read(&MOT.replace("inDegrees=yes", "inRadians=no")));
    let [said] = &repairs[..] else { panic!("{repairs:?}") };
    assert!(said.is_decision && said.place == Place::Line(5) && said.what.contains("`inRadians`"), "{said}");
    let sheet = "\"jump\",\nnRows=2,\nnColumns=2,\nendheader,\ntime,knee\n0,1\n0.1,2\n";
    let (found, _) = channels(repaired(sheet, 5, "cells are apart by commas"));
    assert_eq!(found.frame(1), Some(&[2.0][..]));
    // OpenSim 4: vectors in cells
    let vectors =
        "DataType=Vec3\nversion=3\nOpenSimVersion=4.1\nendheader\ntime\thip\n0\t1,2,3\n0.1\t4,5,6\n";
    let (found, _) = channels(read(vectors));
    assert_eq!(
        (found.names(), found.frame(1)),
        (&["hip_1", "hip_2", "hip_3"].map(String::from)[..], Some(&[4.0, 5.0, 6.0][..]))
    );
}

#[test]
fn angles_and_translations_of_a_mot_are_told_apart_by_their_names() {
    // of files of opensim-gui, opensim-models and opensim-core, and of SIMM
    let angles = [
        "r1_z",
        "r1_z_u",
        "ground_thorax_rot_x",
        "pelvis_rx_u",
        "RKnee_rz",
        "knee_angle_r",
        "pelvis_tilt",
        "q1_u",
        "box_rotX",
        "hip_flexion_r_speed",
        "/jointset/hip_r/hip_flexion_r/value",
        "femur_r_Ox",
        "sternoclavicular_r1",
    ];
    let others = [
        "tib_tx_r",
        "tib_ty_r",
        "pat_tx_r",
        "knee_tx_l",
        "/jointset/a/tib_tx_r/value",
        "pelvis_ty",
        "pelvis_ty_u",
        "tx",
        "ground_torque_r_z",
        "1_ground_force_vx",
        "1_ground_force_px",
        "femur_r_X",
        "center_of_mass_Y",
        "box_transX",
        "sphere1_TransZ_u",
        "soleus_r_activation",
        "V.Sacral_tx",
        "hip_r_z",
    ];
    for name in angles {
        assert!(mot::is_angle(name), "{name}");
    }
    for name in others {
        assert!(!mot::is_angle(name), "{name}");
    }
}

#[test]
fn a_mot_that_is_not_quite_one_is_repaired() {
    let plain = channels(read(MOT)).0;
    let rows =
        channels(repaired(&MOT.replace("nRows=3", "nRows=30"), 3, "30 rows are declared, 3 are there"));
    assert_eq!(rows.0, plain);
    let columns =
        repaired(&MOT.replace("nColumns=4", "nColumns=9"), 4, "9 columns are declared, 4 are there");
    assert_eq!(channels(columns).0, plain);
    // integrators write the end of a step twice at events
    let twice = MOT.replace("      0.01000000", "      0.00000000");
    let (found, _) = channels(repaired(&twice, 13, "of rows at the same time the last is kept"));
    assert_eq!((found.times(), found.frame(0).unwrap()[0]), (&[0.0, 0.02][..], 0.94));
    let cut = MOT.trim_end().strip_suffix("\tNaN").unwrap();
    assert_eq!(channels(repaired(cut, 14, "the last row is incomplete")).0.n_frames(), 2);
    let same = MOT.replace("knee_angle_r", "pelvis_ty");
    assert_eq!(channels(repaired(&same, 11, "columns of the same name")).0.names()[1], "pelvis_ty 2");
    for (text, says) in [
        (MOT.replace("time\t", "t\t"), "line 11: found `t`, allowed is time"),
        (MOT.replace("90.0", "9o"), "line 12: found `9o0000000`"),
        (MOT.replace("\t180\n", "\t180\t7\n"), "line 12: found `5 cells`, allowed is 4 cells"),
        (MOT.replace("nRows=3", "nRows=three"), "line 3: found `three`, allowed is a whole number"),
        (MOT.replace("inDegrees=yes", "inDegrees=maybe"), "line 5: found `maybe`, allowed is yes or no"),
        (MOT.replace("Coordinates", "DataType=Matrix"), "line 1: found `Matrix`"),
        (MOT.lines().take(11).collect::<Vec<_>>().join("\n"), "line 11: the file has no frames"),
    ] {
        let found = read_with(text.as_bytes(), &ReadOptions::default()).unwrap_err().to_string();
        assert!(found.contains(says), "{found}");
    }
}

#[test]
fn channels_come_back_from_a_mot() {
    let (found, _) = channels(read(MOT));
    for (in_degrees, tolerance) in [(false, 0.0), (true, 1e-15)] {
        let text = writers::mot::write(&found, "walk", in_degrees).unwrap();
        let again = mot::read(&text).unwrap().recording;
        assert_eq!((again.names(), again.times()), (found.names(), found.times()));
        for (a, b) in again.frames().flatten().zip(found.frames().flatten()) {
            assert!((a - b).abs() <= tolerance * b.abs().max(1.0) || (a.is_nan() && b.is_nan()));
        }
        assert!(text.contains(if in_degrees { "\t90\t" } else { "inDegrees=no" }));
    }
    let named = |name: &str| ChannelRecording::try_new(vec![name.into()], vec![0.0], vec![1.0]).unwrap();
    assert!(writers::mot::write(&named("a\tb"), "x", false).is_err());
    assert!(writers::mot::write(&named("a"), "x=1", false).is_err());
}

#[test]
fn tables_of_other_programs_are_read() {
    // with semicolons and decimal commas, as spreadsheets of many languages write them; a row of frames before the times
    let german = "Frame;Time;hip:X;hip:Y;hip:Z\n1;0,00;0,1;0,2;0,9\n2;0,01;;;\n";
    let (found, repairs) = markers(read(german));
    assert_eq!((found.names(), found.times()), (&["hip".to_owned()][..], &[0.0, 0.01][..]));
    assert_eq!(found.frame(0).unwrap()[0], Some(Vector3::new(0.1, 0.2, 0.9)));
    assert!(repairs[0].what.contains("decimal comma"), "{repairs:?}");
    // units in brackets, blanks before the coordinate, tabs, no times
    let tabs = "hip X (mm)\thip Y (mm)\thip Z (mm)\n100\t200\t900\n101\t200\t900\n";
    let options = ReadOptions { rate: Some(50.0), ..ReadOptions::default() };
    let (found, _) = markers(read_with(tabs.as_bytes(), &options).unwrap());
    assert_eq!(
        (found.times(), found.frame(1).unwrap()[0]),
        (&[0.0, 0.02][..], Some(Vector3::new(0.101, 0.2, 0.9)))
    );
    let without = read_with(tabs.as_bytes(), &ReadOptions::default()).unwrap_err().to_string();
    assert!(without.contains("`rate`, frames a second, must be given"), "{without}");
    // columns that are no coordinates
    let (found, _) = channels(read("Time,Force,Position\n0,0,0\n0.1,1,0.01\n0.2,NaN,\n"));
    assert_eq!(found.names(), ["Force", "Position"]);
    assert!(found.frame(2).unwrap().iter().all(|x| x.is_nan()));
}

/// As Motive 2 exports a take (its documentation, "Data Export: CSV").
const MOTIVE: &str = "Format Version,1.23,Take Name,jump,Capture Frame Rate,120.000000,Export Frame Rate,120.000000,Rotation Type,Quaternion,Length Units,Meters,Coordinate Space,Global

,,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Marker,Marker,Marker,Marker,Marker,Marker
,Name,Club,Club,Club,Club,Club,Club,Club,Anna:HIP,Anna:HIP,Anna:HIP,Anna:KNEE,Anna:KNEE,Anna:KNEE
,ID,7,7,7,7,7,7,7,8,8,8,9,9,9
,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Position,Position,Position,Position,Position,Position
Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,X,Y,Z,X,Y,Z
0,0.000000,0,0,0,1,5,6,7,0.1,0.9,0.2,0.1,0.5,0.2
1,0.008333,0,0,0,1,5,6,7,0.1,0.9,0.2,,,
";

/// As Nexus 2 exports a trial as ASCII (its documentation, "ASCII file format").
const NEXUS: &str = "Devices
1000
,,Force
Frame,Sub Frame,Fx,Fy
,,N,N
1,0,5,6
1,1,5,6

Trajectories
100
,,Anna:HIP,,,Anna:KNEE,,
Frame,Sub Frame,X,Y,Z,X,Y,Z
,,mm,mm,mm,mm,mm,mm
11,0,100,200,900,100,200,500
12,0,100,200,901,,,
";

/// As QTM exports TSV (its manual, "TSV file formats").
const QTM: &str = "NO_OF_FRAMES\t2
NO_OF_CAMERAS\t8
NO_OF_MARKERS\t2
FREQUENCY\t200
NO_OF_ANALOG\t0
DESCRIPTION\t--
TIME_STAMP\t2022-06-03, 10:47:36.627\t94247.45402301
DATA_INCLUDED\t3D
MARKER_NAMES\tHIP\tKNEE
TRAJECTORY_TYPES\tMeasured\tMeasured
1\t0.00000\t100.000\t200.000\t900.000\t100.000\t200.000\t500.000
2\t0.00500\t100.000\t200.000\t901.000\t0.000\t0.000\t0.000
";

#[test]
fn exports_of_motive_nexus_and_qtm_are_read() {
    // y up, the markers and not the rigid body
    let (found, repairs) = markers(read(&MOTIVE.replacen("\n,,Rigid", "\n,Type,Rigid", 1)));
    assert_eq!(found.names(), ["HIP", "KNEE"]);
    assert_eq!(found.frame(0).unwrap()[0], Some(Vector3::new(0.1, -0.2, 0.9)));
    assert_eq!(found.frame(1).unwrap()[1], None);
    assert_eq!(found.times(), [0.0, 0.008333]);
    assert!(repairs.iter().all(|repair| repair.is_decision), "{repairs:?}");
    let (found, decisions) = markers(read(MOTIVE));
    assert_eq!(found.names(), ["Club", "Anna:HIP", "Anna:KNEE"]);
    // a key that Motive is not known to write is listed, and places that are not those of the world are none of markers
    let (same, listed) = markers(read(&MOTIVE.replacen("Take Name", "Lens Model", 1)));
    assert_eq!((same.names(), listed.len()), (found.names(), decisions.len() + 1));
    let said = listed.iter().find(|repair| repair.what.contains("`Lens Model`")).unwrap();
    assert!(said.is_decision && said.place == Place::Line(1), "{said}");
    let local = MOTIVE.replacen("Global", "Local", 1);
    let refused = read_with(local.as_bytes(), &ReadOptions::default()).unwrap_err().to_string();
    assert!(refused.contains("Local") && refused.contains("Global"), "{refused}");
    // a unit that the file declares counts, and that of the caller where it has none
    let centimetres = ReadOptions { unit: Some(LengthUnit::Centimetre), ..ReadOptions::default() };
    assert_eq!(markers(read_with(MOTIVE.as_bytes(), &centimetres).unwrap()).0.frame(0), found.frame(0));
    let (seen, _) = markers(read_with(QTM.as_bytes(), &centimetres).unwrap());
    assert_eq!(seen.frame(0).unwrap()[0], Some(Vector3::new(1.0, 2.0, 9.0)));
    let (found, repairs) = markers(read(NEXUS));
    assert_eq!((found.names(), found.times()), (&["HIP", "KNEE"].map(String::from)[..], &[0.1, 0.11][..]));
    assert_eq!(found.frame(1).unwrap()[..], [Some(Vector3::new(0.1, 0.2, 0.901)), None]);
    assert!(repairs.iter().any(|repair| repair.what.contains("sections besides the trajectories")));
    let model = NEXUS.replace("Trajectories", "Model Outputs").replace("mm", "deg");
    let only = &model[model.find("Model").unwrap()..];
    let (found, _) = channels(read(only));
    assert_eq!(found.names()[..3], ["Anna:HIP_x", "Anna:HIP_y", "Anna:HIP_z"].map(String::from));
    assert!((found.frame(0).unwrap()[0] - 100_f64.to_radians()).abs() < 1e-15);
    for text in [
        QTM.to_owned(),
        QTM.replace("1\t0.00000\t", "").replace("2\t0.00500\t", ""),
        QTM.replace("1\t0.00000", "Frame\tTime\n1\t0.00000"),
    ] {
        let (found, repairs) = markers(read(&text));
        assert_eq!(
            (found.names(), found.times()),
            (&["HIP", "KNEE"].map(String::from)[..], &[0.0, 0.005][..])
        );
        assert_eq!(found.frame(1).unwrap()[..], [Some(Vector3::new(0.1, 0.2, 0.901)), None]);
        assert!(
            repairs.iter().any(|repair| repair.what.contains("a marker at 0, 0, 0 is missing")),
            "{repairs:?}"
        );
    }
}

pub(crate) fn flat(n: usize, stride: usize) -> String {
    let numbers = (0..n).flat_map(|k| {
        let point =
            if k == 1 { vec!["0".to_owned(); stride] } else { vec![format!("{}.5", 10 * k); stride - 1] };
        let weight = if k == 1 { vec![] } else { vec!["0.9".to_owned()] };
        point.into_iter().chain(weight)
    });
    format!("[{}]", numbers.collect::<Vec<_>>().join(","))
}

#[test]
fn key_points_of_each_program_are_read() {
    // OpenPose, doc/02_output.md: a file for each frame; two people, of whom the second is seen better
    let person = |pose: &str| {
        format!(
            "{{\"person_id\":[-1],\"pose_keypoints_2d\":{pose},\"face_keypoints_2d\":[],\"pose_keypoints_3d\":[]}}"
        )
    };
    let frame = |people: &[String]| format!("{{\"version\":1.3,\"people\":[{}]}}", people.join(","));
    let far = flat(25, 3).replace("0.9", "0.2").replace(".5", "e1");
    let one = frame(&[person(&far), person(&flat(25, 3))]);
    let other = frame(&[person(&flat(25, 3)), person(&far)]);
    let (found, repairs) = keypoints(&format!("[{one},{other},{}]", frame(&[])), 25.0);
    assert_eq!((found.n_frames(), found.n_dims(), &found.names()[8]), (3, 2, &"mid_hip".to_owned()));
    assert_eq!(found.times(), [0.0, 0.04, 0.08]);
    assert_eq!(found.points()[..50], found.points()[50..100], "the same person is followed");
    assert_eq!((found.weights()[0], found.weights()[1], found.weights()[50]), (0.9, 0.0, 0.0));
    assert!(repairs.iter().any(|repair| repair.what.contains("up to 2 people")));
    let second = ReadOptions { rate: Some(25.0), person: Some(1), ..ReadOptions::default() };
    let Recording::Keypoints(chosen) =
        read_with(format!("[{one},{other}]").as_bytes(), &second).unwrap().recording
    else {
        panic!()
    };
    assert_ne!(chosen.points()[..50], chosen.points()[50..100]);
    // COCO, "Results format", and AlphaPose with HALPE-26
    let coco = |k: usize, image: &str| {
        format!("{{\"image_id\":{image},\"category_id\":1,\"keypoints\":{},\"score\":2.5}}", flat(k, 3))
    };
    let (found, _) = keypoints(&format!("[{},{}]", coco(17, "3"), coco(17, "1")), 10.0);
    assert_eq!((found.times(), &found.names()[16]), (&[0.0, 0.2][..], &"right_ankle".to_owned()));
    let (found, _) = keypoints(&format!("[{},{}]", coco(26, "\"0.jpg\""), coco(26, "\"1.jpg\"")), 10.0);
    assert_eq!(&found.names()[25], "right_heel");
    let annotated = format!(
        "{{\"images\":[],\"annotations\":[{}],\"categories\":[{{\"keypoints\":[\"a\",\"b\"]}}]}}",
        coco(2, "7").replace("0.9", "2")
    );
    let (found, _) = keypoints(&annotated, 10.0);
    assert_eq!((found.names(), found.weights()), (&["a", "b"].map(String::from)[..], &[1.0, 0.0][..]));
    // MMPose, "Inference with existing models": 2-D and 3-D predictions of a video
    let points = |n_dims: usize| vec![format!("[{}]", vec!["1.5"; n_dims].join(",")); 17].join(",");
    let instance = |n_dims: usize| {
        format!("{{\"keypoints\":[{}],\"keypoint_scores\":[{}]}}", points(n_dims), vec!["0.7"; 17].join(","))
    };
    for n_dims in [2, 3] {
        let frames =
            [1, 2].map(|id| format!("{{\"frame_id\":{id},\"instances\":[{}]}}", instance(n_dims))).join(",");
        for text in [
            format!("[{frames}]"),
            format!("{{\"meta_info\":{{}},\"instance_info\":[{frames}]}}"),
            format!("[[{0}],[{0}]]", instance(n_dims)),
        ] {
            let (found, _) = keypoints(&text, 50.0);
            assert_eq!((found.n_dims(), found.times(), found.weights()[3]), (n_dims, &[0.0, 0.02][..], 0.7));
        }
    }
    // MediaPipe, "Pose landmark detection guide": in metres, or in fractions of the picture
    let landmark = "{\"x\":0.1,\"y\":-0.5,\"z\":0.2,\"visibility\":0.8}";
    let all = vec![landmark; 33].join(",");
    for (text, said) in [
        (
            format!(
                "{{\"frames\":[{{\"timestamp_ms\":0,\"worldLandmarks\":[[{all}]]}},{{\"timestamp_ms\":40,\"worldLandmarks\":[[{all}]]}}]}}"
            ),
            false,
        ),
        (
            format!("{{\"t\":0,\"pose_landmarks\":[{all}]}}\n{{\"t\":0.04,\"pose_landmarks\":[{all}]}}\n"),
            true,
        ),
        (
            format!(
                "{{\"fps\":25,\"landmarks\":[{{\"frame\":0,\"pose_landmarks\":[{all}]}},{{\"frame\":1,\"pose_landmarks\":[{all}]}}]}}"
            ),
            true,
        ),
        (
            format!(
                "[{{\"timestamp\":0,\"pose_landmarks\":[{all}]}},{{\"timestamp\":0.04,\"pose_landmarks\":[{all}]}}]"
            ),
            true,
        ),
    ] {
        let file = read(&text);
        let Recording::Keypoints(found) = file.recording else { panic!() };
        assert_eq!(
            (found.times(), found.n_dims(), &found.names()[32]),
            (&[0.0, 0.04][..], 3, &"right_foot_index".to_owned())
        );
        assert_eq!(file.repairs.iter().any(|repair| repair.what.contains("fractions")), said);
    }
}

#[test]
fn what_is_no_key_points_is_refused() {
    let refused =
        |text: &str, options: &ReadOptions| read_with(text.as_bytes(), options).unwrap_err().to_string();
    let own = ReadOptions { rate: Some(10.0), ..ReadOptions::default() };
    assert!(refused("{\"a\": 1}", &own).contains("allowed is key points of OpenPose"));
    assert!(refused("[{\"people\":[]}]", &own).contains("frames without a person"));
    assert!(
        refused("{\"people\":[{\"pose_keypoints_2d\":[1,2]}]}", &own).contains("a multiple of 3 numbers")
    );
    assert!(refused("{\"people\":[true]}", &own).contains("found `true`, allowed is a person"));
    let lost = format!("[{{\"image_id\":1,\"keypoints\":{}}},{{\"keypoints\":[]}}]", flat(17, 3));
    assert!(
        refused(&lost, &own)
            .contains("line 2: found `an object with keypoints`, allowed is a result with its `image_id`")
    );
    assert!(refused("{\"people\":[", &own).contains("the file ends where there must be"));
    let two = format!("[{0},{0}]", format!("{{\"people\":[{{\"pose_keypoints_2d\":{}}}]}}", flat(17, 3)));
    assert!(refused(&two, &ReadOptions::default()).contains("`rate`, frames a second, must be given"));
    assert!(refused(&two, &ReadOptions { person: Some(1), ..own }).contains("`person` must be below 1"));
    assert!(refused(&two, &ReadOptions { rate: Some(-1.0), ..own }).contains("`rate` must be positive"));
    let deep = format!("{{\"people\": {}", "[".repeat(100_000));
    assert!(refused(&deep, &own).contains("recursion limit"));
}

#[test]
fn a_folder_of_frames_is_read_in_the_order_of_their_numbers() {
    let folder = std::env::temp_dir().join(format!("somersault-frames-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for k in 1..=11 {
        let pose = flat(17, 3).replacen("0.5", &format!("{k}.25"), 1);
        let frame = format!("{{\"people\":[{{\"pose_keypoints_2d\":{pose}}}]}}");
        std::fs::write(folder.join(format!("cam_{k}_keypoints.json")), frame).unwrap();
    }
    let options = ReadOptions { rate: Some(10.0), ..ReadOptions::default() };
    let Recording::Keypoints(found) = read_file(&folder, &options).unwrap().recording else { panic!() };
    let first: Vec<f64> = found.points().iter().step_by(34).copied().collect();
    assert_eq!(first, (1..=11).map(|k| f64::from(k) + 0.25).collect::<Vec<_>>());
    std::fs::write(folder.join("cam_12.json"), "{").unwrap();
    assert!(matches!(read_file(&folder, &options), Err(LoadError::Read { .. })));
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_c3d_without_a_first_block_of_data_is_read() {
    for bytes in [Bytes::Intel, Bytes::Mips] {
        let mut file = C3d { bytes, float: true, n_frames: 4 }.write();
        let whole = markers(read_with(&file, &ReadOptions::default()).unwrap()).0;
        file[16..18].copy_from_slice(&[0, 0]);
        let (found, repairs) = markers(read_with(&file, &ReadOptions::default()).unwrap());
        assert_eq!(found, whole);
        assert!(repairs[0].what.contains("no first block of data is declared"), "{repairs:?}");
        assert!(matches!(c3d::read(&file, &c3d::C3dOptions::default()), Err(ReadError::Unexpected { .. })));
    }
}

#[test]
fn channels_of_a_c3d_are_read_on_every_processor() {
    for bytes in [Bytes::Intel, Bytes::Dec, Bytes::Mips] {
        for (float, value) in [(true, 1.5), (false, 77.0)] {
            let file = C3d { bytes, float, n_frames: 3 }.write();
            let found = c3d::channels(&file).unwrap().unwrap();
            assert_eq!((found.n_channels(), found.n_frames()), (1, 6));
            assert_eq!(found.times(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(|i| i / 400.0));
            assert!(found.frames().flatten().all(|x| *x == value));
            assert_eq!(c3d::events(&file).unwrap(), []);
            assert_eq!(c3d::force_plates(&file).unwrap(), []);
        }
    }
    let without = writers::c3d::write(
        &markers(read(TRC)).0,
        &somersault_motion::recording::Convention::z_up(LengthUnit::Metre),
    );
    assert_eq!(c3d::channels(&without.unwrap()).unwrap(), None);
}

#[test]
fn a_bvh_that_is_not_quite_one_is_repaired() {
    let options = ReadOptions { unit: Some(LengthUnit::Centimetre), ..ReadOptions::default() };
    let frames = |text: &str, says: &str| {
        let file = read_with(text.as_bytes(), &options).unwrap();
        assert!(file.repairs.iter().any(|repair| repair.what.contains(says)), "{:?}", file.repairs);
        let strict = ReadOptions { strict: true, ..options };
        assert!(read_with(text.as_bytes(), &strict).is_err());
        match file.recording {
            Recording::Skeleton(recording) => recording,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(frames(&BVH.replace("Frames: 2", "Frames: 7"), "7 frames are declared, 2").n_frames(), 2);
    assert_eq!(frames(&BVH.replace("Frames: 2", "Frames: 1"), "1 frames are declared, 2").n_frames(), 2);
    let cut = BVH.trim_end().strip_suffix("-4 1").unwrap();
    assert_eq!(frames(cut, "the last frame is incomplete").n_frames(), 1);
    let open = BVH.replace("}\nMOTION", "\nMOTION");
    assert!(open != BVH);
    assert_eq!(frames(&open, "joints without a closing brace").n_frames(), 2);
    assert_eq!(frames(&BVH.replace("MOTION\n", ""), "there is no line MOTION").n_frames(), 2);
    let twice = frames(&BVH.replace("JOINT LeftLeg", "JOINT Hips"), "joints of the same name");
    assert_eq!(twice.skeleton().joints()[2].name, "Hips 3");
}

/// A hierarchy with nine channels, and frames.
fn nine_channels(frames: &str) -> String {
    let root =
        "ROOT hips\n{\nOFFSET 0 0 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation";
    let knee = "JOINT knee\n{\nOFFSET 0 -40 0\nCHANNELS 3 Zrotation Xrotation Yrotation";
    let end = "End Site\n{\nOFFSET 0 -42 0\n}\n}\n}";
    format!("HIERARCHY\n{root}\n{knee}\n{end}\nMOTION\nFrames: 3\nFrame Time: 0.01\n{frames}")
}

#[test]
fn frames_of_a_bvh_begin_and_end_with_lines() {
    let row = |i: usize, n: usize| (0..n).map(|k| format!("{}", 10 * i + k)).collect::<Vec<_>>().join(" ");
    let rows = |counts: &[usize]| -> String {
        nine_channels(&counts.iter().enumerate().map(|(i, n)| row(i, *n) + "\n").collect::<String>())
    };
    let options = ReadOptions { unit: Some(LengthUnit::Metre), ..ReadOptions::default() };
    let read = |text: &str, strict: bool| read_with(text.as_bytes(), &ReadOptions { strict, ..options });
    let first_x = |text: &str| -> Vec<f64> {
        let Recording::Skeleton(found) = read(text, false).unwrap().recording else { panic!() };
        // z of the file is forward
        (0..found.n_frames()).map(|i| found.frame(i).unwrap().next().unwrap().0.y).collect()
    };
    assert_eq!(first_x(&rows(&[9, 9, 9])), [0.0, 10.0, 20.0]);
    // as many numbers as are declared, but not in each line; and lines of another hierarchy
    for (counts, line, found) in [
        (&[10, 8, 9][..], 19, "10 numbers"),
        (&[9, 8, 9], 20, "8 numbers"),
        (&[9, 9, 10], 21, "10 numbers"),
        (&[9, 4, 18], 20, "4 numbers"),
        (&[6, 6, 6], 19, "6 numbers"),
        (&[3, 3, 3, 3, 3, 3], 19, "3 numbers"),
    ] {
        for strict in [false, true] {
            let error = read(&rows(counts), strict).unwrap_err().to_string();
            let said = format!("line {line}: found `{found}`, allowed is 9 numbers, ");
            assert!(error.contains(&said), "{counts:?}: {error}");
        }
    }
    assert_eq!(first_x(&rows(&[9, 9, 8])), [0.0, 10.0]);
    assert!(read(&rows(&[9, 9, 8]), true).is_err());
    // frames that are wrapped, or in one line
    let all: String = (0..3).map(|i| row(i, 9) + " ").collect();
    for n in [0, 1, 5, 27] {
        assert_eq!(first_x(&nine_channels(&all.replacen(' ', "\n", n))), [0.0, 10.0, 20.0], "{n} line ends");
    }
}

#[test]
fn a_bvh_of_other_programs_is_read_without_a_repair() {
    let options = ReadOptions { strict: true, unit: Some(LengthUnit::Metre), ..ReadOptions::default() };
    let row = "1 2 3 4 5 6 7 8 9\n";
    let whole = nine_channels(&row.repeat(3));
    let read = |text: &str| read_with(text.as_bytes(), &options).map(|file| file.recording);
    let expected = read(&whole).unwrap();
    let (offset, channels) = ("OFFSET 0 -40 0\n", "CHANNELS 3 Zrotation Xrotation Yrotation\n");
    for (from, to) in [
        ("End Site", "End Site Head_end"),
        ("End Site", "End Site-7"),
        ("End Site\n{", "End Site toe {"),
        ("Frames: 3", "Frames:3"),
        ("Frame Time: 0.01", "Frame Time:0.01"),
        (&format!("{offset}{channels}"), &format!("{channels}{offset}")),
        ("OFFSET 0 -42 0", "OFFSET 0 -42 0\nCHANNELS 0"),
        ("9\n1", "9\n\n1"),
    ] {
        assert!(whole.contains(from));
        assert_eq!(read(&whole.replacen(from, to, 1)).unwrap(), expected, "{to}");
    }
    for end in ["\0\0", "\u{1a}", "\r\n\u{1a}\0"] {
        assert_eq!(read(&format!("{whole}{end}")).unwrap(), expected, "{end:?}");
    }
    let one = nine_channels(row).replace("Frames: 3", "Frames: 1").replace("0.01", "0");
    assert!(read(&one).is_ok());
    for (from, to, said) in [
        ("0.01", "-0.01", "a positive time of a frame"),
        ("End Site", "End Effector", "found `Effector`, allowed is Site"),
        ("OFFSET 0 -42 0\n", "", "allowed is OFFSET"),
        ("OFFSET 0 -42 0", "OFFSET 0 -42 0 CHANNELS 1 Xrotation", "no channel of an end site"),
        ("9\n", "9\u{1}\n", "found `9\\u{1}`, allowed is the value of a channel"),
    ] {
        let error = read(&whole.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
}

#[test]
fn strict_readers_take_what_this_library_writes() {
    let (found, _) = markers(read(CSV));
    let strict = ReadOptions { strict: true, ..ReadOptions::default() };
    assert_eq!(markers(read_with(CSV.as_bytes(), &strict).unwrap()).0, found);
    assert_eq!(csv::read(CSV, &Default::default()).unwrap(), found);
    assert_eq!(trc::read(TRC, &Default::default()).unwrap().n_frames(), 3);
}
