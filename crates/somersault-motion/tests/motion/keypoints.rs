//! Key points are those of one person in the right order of frames, with the right names and weights, or are refused.

use crate::dialects::{keypoints, read_with};
use somersault_motion::readers::{ReadOptions, Recording, read_file, read_named};
use somersault_motion::recording::KeypointRecording;

/// Numbers of so many points, of which the first is at x, in a flat list with a confidence.
fn flat(x: f64, n: usize, weight: f64) -> String {
    let point = |k: usize| format!("{},{},{weight}", x + k as f64, 2 * k + 1);
    format!("[{}]", (0..n).map(point).collect::<Vec<_>>().join(","))
}

/// The same points as objects, which begin with what is given.
fn objects(x: f64, beginnings: &[&str]) -> String {
    let point = |(k, beginning): (usize, &&str)| {
        format!("{{{beginning}\"x\":{},\"y\":{},\"confidence\":0.5}}", x + k as f64, 2 * k + 1)
    };
    format!("[{}]", beginnings.iter().enumerate().map(point).collect::<Vec<_>>().join(","))
}

/// A person of COCO or AlphaPose in the picture of this name, with more entries.
fn result(picture: &str, x: f64, more: &str) -> String {
    format!("{{\"image_id\":\"{picture}\",\"category_id\":1,\"keypoints\":{}{more}}}", flat(x, 17, 0.9))
}

fn list(all: &[String]) -> String {
    format!("[{}]", all.join(","))
}

/// A frame of OpenPose, with persons at these places.
fn openpose(places: &[f64]) -> String {
    let person = |x: &f64| format!("{{\"pose_keypoints_2d\":{}}}", flat(*x, 25, 0.9 - x / 1e4));
    format!("{{\"people\":{}}}", list(&places.iter().map(person).collect::<Vec<_>>()))
}

/// Where the first point is in each frame.
fn first_x(found: &KeypointRecording) -> Vec<f64> {
    found.points().iter().step_by(found.n_keypoints() * found.n_dims()).copied().collect()
}

fn first_weights(found: &KeypointRecording) -> Vec<f64> {
    found.weights().iter().step_by(found.n_keypoints()).copied().collect()
}

fn options() -> ReadOptions {
    ReadOptions { rate: Some(10.0), ..ReadOptions::default() }
}

fn refused(text: &str) -> String {
    read_with(text.as_bytes(), &options()).expect_err(text).to_string()
}

/// Whether it is refused by a strict reader.
fn is_repaired(text: &str) -> bool {
    read_with(text.as_bytes(), &ReadOptions { strict: true, ..options() }).is_err()
}

/// What is read of a folder with files of these names.
fn folder(name: &str, files: &[(&str, String)]) -> Result<(KeypointRecording, Vec<String>), String> {
    let folder = std::env::temp_dir().join(format!("somersault-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for (name, text) in files {
        std::fs::write(folder.join(name), text).unwrap();
    }
    let found = read_file(&folder, &options());
    std::fs::remove_dir_all(&folder).unwrap();
    let found = found.map_err(|error| error.to_string())?;
    let Recording::Keypoints(recording) = found.recording else { panic!() };
    Ok((recording, found.repairs.iter().map(ToString::to_string).collect()))
}

#[test]
fn pictures_are_in_the_order_of_their_whole_names() {
    let of = |pictures: &[&str]| {
        let all: Vec<String> =
            pictures.iter().enumerate().map(|(i, picture)| result(picture, i as f64, "")).collect();
        keypoints(&list(&all), 10.0)
    };
    // the last number is one of microseconds, which begin again with each second
    let stamps = ["17.738369", "17.990509", "18.036632"].map(|s| format!("2018-07-04T12_04_{s}.png"));
    let (found, repairs) = of(&stamps.each_ref().map(String::as_str));
    assert_eq!(first_x(&found), [0.0, 1.0, 2.0]);
    assert_eq!(found.times(), [0.0, 0.1, 0.2]);
    assert!(repairs.iter().any(|r| r.what.contains("differ in more than one number")), "{repairs:?}");
    // two cameras are not interleaved
    let (found, _) = of(&["a_0000.png", "a_0001.png", "b_0000.png", "b_0001.png"]);
    assert_eq!(first_x(&found), [0.0, 1.0, 2.0, 3.0]);
    let (found, _) = of(&["cam_2_f9.png", "cam_2_f10.png", "cam_2_f12.png"]);
    assert_eq!((first_x(&found), found.times()), (vec![0.0, 1.0, 2.0], &[0.0, 0.1, 0.3][..]));
    let (found, _) = of(&["10.jpg", "9.jpg", "8.jpg"]);
    assert_eq!((first_x(&found), found.times()), (vec![2.0, 1.0, 0.0], &[0.0, 0.1, 0.2][..]));
}

#[test]
fn a_person_who_is_absent_is_not_replaced_by_another() {
    let frames = [&[100.0, 900.0][..], &[902.0], &[104.0, 904.0], &[906.0, 106.0]].map(openpose);
    let (found, repairs) = keypoints(&list(&frames), 10.0);
    assert_eq!(first_x(&found), [100.0, 0.0, 104.0, 106.0]);
    assert_eq!(first_weights(&found)[..2], [0.89, 0.0]);
    let absent = repairs.iter().find(|repair| repair.what.contains("is not among those in a frame"));
    assert_eq!(absent.map(|repair| repair.count), Some(1), "{repairs:?}");
    // one of whom a single point was found is found again
    let mut frames = [&[100.0, 900.0][..], &[100.0, 900.0], &[104.0, 904.0]].map(openpose);
    let hidden = format!("[100,1,0.89{}]", ",0,0,0".repeat(24));
    frames[1] = frames[1].replacen(&flat(100.0, 25, 0.89), &hidden, 1);
    assert_eq!(first_x(&keypoints(&list(&frames), 10.0).0), [100.0, 100.0, 104.0]);
    // of the first frame no point was found
    frames[0] = format!("{{\"people\":[{{\"pose_keypoints_2d\":[0,0,0{}]}}]}}", ",0,0,0".repeat(24));
    frames[1] = openpose(&[100.0, 900.0]);
    assert_eq!(first_x(&keypoints(&list(&frames), 10.0).0), [0.0, 100.0, 104.0]);
    // one person alone may be anywhere
    let (found, _) = keypoints(&list(&[&[100.0][..], &[902.0]].map(openpose)), 10.0);
    assert_eq!(first_x(&found), [100.0, 902.0]);
}

#[test]
fn a_person_with_wrong_legs_is_nearer_than_a_ghost() {
    // legs of the right person are exchanged and far away, another has few points near the place before
    let body = |leg: f64| {
        let point = |k: usize| format!("{},{},0.9", if k < 15 { k as f64 } else { leg }, 3 * k);
        format!("[{}]", (0..25).map(point).collect::<Vec<_>>().join(","))
    };
    let ghost = (0..25).map(|k| if k < 7 { format!("{},{},0.2", k + 20, 3 * k) } else { "0,0,0".to_owned() });
    let ghost = format!("[{}]", ghost.collect::<Vec<_>>().join(","));
    let frame = |people: &[&String]| {
        let person = |pose: &&String| format!("{{\"pose_keypoints_2d\":{pose}}}");
        format!("{{\"people\":{}}}", list(&people.iter().map(person).collect::<Vec<_>>()))
    };
    let frames = [frame(&[&body(10.0)]), frame(&[&ghost, &body(90.0)])];
    let (found, _) = keypoints(&list(&frames), 10.0);
    assert_eq!(found.weights().iter().filter(|weight| **weight == 0.9).count(), 50);
}

#[test]
fn numbers_of_a_tracker_are_followed_where_they_tell_people_apart() {
    let frames = |idx: fn(usize) -> String| {
        let place = [[100.0, 90.0], [91.0, 99.0], [98.0, 92.0]];
        let all = (0..3).flat_map(|i| (0..2).map(move |k| (i, k)));
        let person = |(i, k): (usize, usize)| {
            result(&format!("{i}.jpg"), place[i][k], &format!(",\"idx\":{}", idx(k)))
        };
        list(&all.map(person).collect::<Vec<_>>())
    };
    // the first is seen best; the tracker says that people changed places
    let (found, _) = keypoints(&frames(|k| (k + 1).to_string()).replacen("0.9", "0.95", 17), 10.0);
    assert_eq!(first_x(&found), [100.0, 91.0, 98.0]);
    // AlphaPose without a tracker
    let (found, _) = keypoints(&frames(|_| "[0.0]".to_owned()).replacen("0.9", "0.95", 17), 10.0);
    assert_eq!(first_x(&found), [100.0, 99.0, 98.0]);
    // the tracker loses the person, who goes on under a new number
    let all = [("0.jpg", 100.0, 1), ("0.jpg", 130.0, 2), ("1.jpg", 101.0, 3), ("1.jpg", 102.0, 2)];
    let all = all.map(|(picture, x, idx)| result(picture, x, &format!(",\"idx\":{idx}")));
    let (found, _) = keypoints(&list(&all).replacen("0.9", "0.95", 17), 10.0);
    assert_eq!(first_x(&found), [100.0, 101.0]);
}

#[test]
fn pictures_that_have_a_name_are_frames() {
    for key in ["image", "image_name", "file_name", "image_path", "image_url"] {
        let frame = |i: usize| format!("{{\"{key}\":\"{i}.jpg\",\"keypoints\":{}}}", flat(i as f64, 17, 0.9));
        let (found, repairs) = keypoints(&list(&[0, 1, 3].map(frame)), 10.0);
        assert_eq!((first_x(&found), found.times()), (vec![0.0, 1.0, 3.0], &[0.0, 0.1, 0.3][..]), "{key}");
        assert_eq!(repairs, []);
        // two people of one picture
        let two = list(&[frame(1), frame(1).replace("[1,", "[8,")]);
        assert_eq!(keypoints(&two, 10.0).0.n_frames(), 1);
    }
    // a film with a number or a time for each frame
    for (key, step) in [("frame", 1.0), ("frame_id", 1.0), ("time", 0.1)] {
        let frame = |i: usize| {
            let people = format!("[{{\"keypoints\":{}}}]", flat(i as f64, 17, 0.9));
            format!("{{\"file_name\":\"dive.mp4\",\"{key}\":{},\"people\":{people}}}", i as f64 * step)
        };
        assert_eq!(first_x(&keypoints(&list(&[0, 1, 2].map(frame)), 10.0).0), [0.0, 1.0, 2.0], "{key}");
    }
    // a detection has the place of its box beside its key points
    let boxed = format!("[{{\"x\":5,\"y\":6,\"width\":2,\"keypoints\":{}}}]", objects(7.0, &[""; 17]));
    for text in [boxed.clone(), format!("{{\"predictions\":{boxed}}}")] {
        assert_eq!(first_x(&keypoints(&text, 10.0).0), [7.0]);
    }
    // persons of a flat list that have the number of their frame
    let person = |i: usize, x: f64| format!("{{\"frame\":{i},\"keypoints\":{}}}", flat(x, 17, 0.9 - x / 1e5));
    let all = [person(0, 100.0), person(0, 900.0), person(1, 901.0), person(1, 101.0)];
    let (found, _) = keypoints(&list(&all), 10.0);
    assert_eq!(first_x(&found), [100.0, 101.0]);
}

#[test]
fn each_file_of_a_folder_is_one_frame() {
    let one = |i: usize| {
        format!("{{\"image_name\":\"f_{i}.jpg\",\"bbox\":[],\"keypoints\":{}}}", flat(i as f64, 17, 0.9))
    };
    let names = ["frame_0.json", "frame_1.json", "frame_3.json"];
    let files = |of: &dyn Fn(usize) -> String| [0, 1, 2].map(|i| (names[i], of(i)));
    let (found, repairs) = folder("objects", &files(&one)).unwrap();
    assert_eq!((first_x(&found), found.times()), (vec![0.0, 1.0, 2.0], &[0.0, 0.1, 0.3][..]));
    assert_eq!(repairs, [""; 0]);
    // EasyMocap: a list of people in each file
    let people = |i: usize| {
        let point = |k: usize| format!("[{},{k},2.5]", i + k);
        let points = (0..25).map(point).collect::<Vec<_>>().join(",");
        format!("[{{\"id\":0,\"keypoints3d\":[{points}]}}]")
    };
    let (found, _) = folder("people", &files(&people)).unwrap();
    assert_eq!((found.n_frames(), found.n_dims(), first_weights(&found)), (3, 3, vec![1.0; 3]));
    // recordings of their own, and a file that is no frame
    let several = |i: usize| list(&[result("0.jpg", i as f64, ""), result("1.jpg", 0.0, "")]);
    let error = folder("several", &files(&several)).unwrap_err();
    assert!(error.contains("line 1: found `2 frames`, allowed is one frame"), "{error}");
    assert!(error.contains("in `frame_0.json`"), "{error}");
    let error = folder("stray", &[("0.json", one(0)), ("zsettings.json", "{\"a\":1}".into())]).unwrap_err();
    assert!(error.contains("line 2: found `an object with a`") && error.contains("in `zsettings.json`"));
    // what is wrong with a frame is said with the name of its file
    let whole = openpose(&[0.0]);
    let cut = whole.replace("24,49,0.9]", "24,49]");
    let error = folder("cut", &[("0.json", whole), ("1.json", cut)]);
    let error = error.unwrap_err();
    assert!(error.contains("line 2: found `74 numbers`") && error.contains("in `1.json`"), "{error}");
}

#[test]
fn names_are_those_of_the_category_of_the_annotations() {
    let names: Vec<String> = (0..18).map(|k| format!("\"kp{k}\"")).collect();
    let body = format!("{{\"id\":1,\"keypoints\":[{}]}}", names.join(","));
    let of = |categories: &str, category: usize, n: usize| {
        let one =
            format!("{{\"image_id\":1,\"category_id\":{category},\"keypoints\":{}}}", flat(1.0, n, 2.0));
        keypoints(&format!("{{\"annotations\":[{one}],\"categories\":[{categories}]}}"), 10.0)
    };
    let objects = "{\"id\":0,\"name\":\"objects\"}";
    for category in [0, 1] {
        let (found, _) = of(&format!("{objects},{body}"), category, 18);
        assert_eq!(found.names()[17], "kp17");
    }
    let hand = "{\"id\":2,\"keypoints\":[\"wrist\"]}";
    assert_eq!(of(&format!("{hand},{body}"), 1, 18).0.names()[0], "kp0");
    // names that do not fit are not those of another model
    let (found, repairs) = of(&body, 1, 17);
    assert_eq!(found.names()[0], "point 1");
    assert!(repairs.iter().any(|r| r.what.contains("names of the file are not those")), "{repairs:?}");
    assert_eq!(of("", 1, 17).0.names()[0], "nose");
}

#[test]
fn points_with_a_number_or_a_name_stand_where_they_say() {
    let frames = |first: &[&str], second: &[&str]| {
        let frame = |i: usize, points: &[&str]| {
            format!("{{\"frame\":{i},\"keypoints\":{}}}", objects(10.0 * i as f64, points))
        };
        list(&[frame(0, first), frame(1, second)])
    };
    let all: Vec<String> = (0..17).map(|k| format!("\"id\":{k},")).collect();
    let all: Vec<&str> = all.iter().map(String::as_str).collect();
    let (found, repairs) = keypoints(&frames(&["\"id\":9,", "\"id\":13,"], &all), 10.0);
    let at = |name: &str| found.names().iter().position(|n| n == name).unwrap();
    assert_eq!(found.points()[2 * at("left_wrist")], 0.0);
    assert_eq!(found.points()[2 * at("left_knee")], 1.0);
    assert_eq!((found.weights()[at("nose")], found.weights()[at("left_wrist")]), (0.0, 0.5));
    assert_eq!(found.points()[34 + 2 * at("left_knee")], 23.0);
    assert!(!repairs.iter().any(|repair| repair.what.contains("lacks points")), "{repairs:?}");
    // numbers that begin later are those of no model that is known
    let (found, _) = keypoints(&frames(&["\"id\":11,", "\"id\":12,"], &["\"id\":13,", "\"id\":11,"]), 10.0);
    assert_eq!(found.names(), ["point 11", "point 12", "point 13"]);
    assert_eq!(found.weights(), [0.5, 0.5, 0.0, 0.5, 0.0, 0.5]);
    // names in another order
    for key in ["name", "part"] {
        let [a, b, c] = ["hip", "knee", "foot"].map(|name| format!("\"{key}\":\"{name}\","));
        let (found, _) = keypoints(&frames(&[&a, &b], &[&c, &a]), 10.0);
        assert_eq!(found.names(), ["hip", "knee", "foot"]);
        assert_eq!(
            (found.points()[0], found.points()[2], found.points()[6], found.points()[10]),
            (0.0, 1.0, 11.0, 10.0)
        );
    }
    assert!(refused(&frames(&["\"id\":0,", "\"id\":1,"], &["", ""])).contains("points with and without"));
    // a few high numbers make no large recording
    let high =
        |i: usize| format!("{{\"frame\":{i},\"keypoints\":[{{\"id\":{},\"x\":1,\"y\":1}}]}}", 2047 * (i % 2));
    assert!(refused(&list(&(0..40).map(high).collect::<Vec<_>>())).contains("as many points"));
}

#[test]
fn only_visibility_is_halved() {
    let annotated = |points: &str, more: &str| {
        let one = format!("{{\"image_id\":1,\"category_id\":1,{more}\"keypoints\":{points}}}");
        first_weights(&keypoints(&format!("{{\"annotations\":[{one}],\"categories\":[]}}"), 10.0).0)[0]
    };
    assert_eq!(annotated(&flat(1.0, 17, 2.0), ""), 1.0);
    assert_eq!(annotated(&flat(1.0, 17, 1.0), ""), 0.5);
    assert_eq!(annotated(&flat(1.0, 17, 0.041), ""), 0.041);
    let pairs = format!("[{}]", vec!["[1,2]"; 17].join(","));
    assert_eq!(annotated(&pairs, ""), 1.0);
    let places = format!("\"keypoints_3d\":[{}],", vec!["[1,2,3]"; 17].join(","));
    assert_eq!(annotated(&pairs, &places), 1.0);
}

#[test]
fn the_rate_of_the_caller_decides_over_times() {
    let frames = |step: f64| {
        let frame = |i: usize| {
            format!("{{\"timestamp\":{},\"landmarks\":{}}}", step * i as f64, objects(0.1, &[""; 33]))
        };
        list(&[0, 1, 2].map(frame))
    };
    let own = |step: f64| read_with(frames(step).as_bytes(), &ReadOptions::default());
    let Recording::Keypoints(found) = own(0.04).unwrap().recording else { panic!() };
    assert_eq!(found.times(), [0.0, 0.04, 0.08]);
    // thousandths or millionths of a second
    assert!(own(33.0).unwrap_err().to_string().contains("frames 33 s apart"));
    let (found, repairs) = keypoints(&frames(33333.0), 10.0);
    assert_eq!(found.times(), [0.0, 0.1, 0.2]);
    assert!(repairs.iter().any(|repair| repair.what.contains("times of the file are not used")));
}

#[test]
fn places_of_a_robot_are_no_points_of_a_person() {
    let place = "{\"time\":1,\"x\":0.5,\"y\":1,\"yaw\":0}";
    let error = refused(&format!("{{\"error\":\"none\",\"poses\":[{place},{place}]}}"));
    assert!(error.contains("found `an object with time, x, y, yaw`, allowed is a person"), "{error}");
}

#[test]
fn objects_of_frames_and_of_points_are_read() {
    // AlphaPose, docs/output.md: formats cmu and open; PoseFlow
    let frames = |one: &dyn Fn(f64) -> String| {
        let frame = |i: usize| format!("\"{}.jpg\":{}", 9 + i, one(i as f64));
        format!("{{{}}}", [0, 1, 3].map(frame).join(","))
    };
    let cmu =
        frames(&|x| format!("{{\"version\":\"0.3\",\"bodies\":[{{\"joints\":{}}}]}}", flat(x, 18, 0.9)));
    let open = frames(&|x| openpose(&[x]));
    let poseflow = frames(&|x| format!("[{{\"keypoints\":{},\"scores\":3.0,\"idx\":1}}]", flat(x, 17, 0.9)));
    for text in [cmu, open, poseflow] {
        let (found, _) = keypoints(&text, 10.0);
        assert_eq!((first_x(&found), found.times()), (vec![0.0, 1.0, 3.0], &[0.0, 0.1, 0.3][..]), "{text}");
    }
    // MediaPipe, point for point under its name, its number, or with capital letters; under times
    let point = "{\"x\":0.5,\"y\":0.25,\"z\":0.1,\"visibility\":0.75}";
    let named =
        format!("[{{\"NOSE\":{point},\"LEFT_EYE\":{point}}},{{\"NOSE\":{point},\"LEFT_EYE\":{point}}}]");
    let numbers: Vec<String> =
        (0..33).map(|k| format!("\"{k}\":{}", point.replace("0.5", &format!("{k}")))).collect();
    let numbered = format!("[{{{0}}},{{{0}}}]", numbers.join(","));
    let under = format!(
        "[{{\"frame_number\":0,\"landmarks\":{{}}}},{{\"frame_number\":1,\"landmarks\":{{{}}}}}]",
        numbers.join(",")
    );
    let (found, _) = keypoints(&named, 10.0);
    assert_eq!((found.names(), found.weights()[0]), (&["LEFT_EYE", "NOSE"].map(String::from)[..], 0.75));
    let (found, _) = keypoints(&numbered, 10.0);
    assert_eq!(
        (found.names()[32].as_str(), found.points()[3 * 32], found.n_frames()),
        ("right_foot_index", 32.0, 2)
    );
    let (found, _) = keypoints(&under, 10.0);
    assert_eq!((found.n_frames(), first_weights(&found)), (2, vec![0.0, 0.75]));
    let upper = point.replace("\"x", "\"X").replace("\"y", "\"Y").replace("\"z", "\"Z").replace("\"v", "\"V");
    let all = vec![upper; 33].join(",");
    let timed = format!("{{\"6.5\":[{all}],\"4.5\":[{all}]}}");
    let file = read_with(timed.as_bytes(), &ReadOptions::default()).unwrap();
    let Recording::Keypoints(found) = file.recording else { panic!() };
    assert_eq!((found.times(), found.weights()[0], found.n_dims()), (&[4.5, 6.5][..], 0.75, 3));
    // a frame under `pose`
    let person = format!("{{\"person_id\":1,\"keypoints\":{}}}", objects(1.0, &[""; 17]));
    let (found, _) = keypoints(&list(&vec![format!("{{\"pose\":[{person}]}}"); 2]), 10.0);
    assert_eq!((found.n_frames(), found.names()[0].as_str()), (2, "nose"));
}

#[test]
fn numbers_that_are_missing_are_points_of_weight_0() {
    let null = openpose(&[0.0]).replace("[0,1,0.9", "[null,null,null");
    let (found, _) = keypoints(&null, 10.0);
    assert_eq!((found.weights()[0], found.weights()[1]), (0.0, 0.9));
    let nan = openpose(&[0.0])
        .replace("[0,1,0.9", "[NaN,-Infinity,NaN")
        .replace("{\"p", "{\"a\":\"NaN \\\" NaN\",\"p");
    let (found, repairs) = keypoints(&nan, 10.0);
    assert_eq!((found.weights()[0], found.weights()[1]), (0.0, 0.9));
    assert!(repairs.iter().any(|repair| repair.what.contains("NaN or infinite")) && is_repaired(&nan));
    assert!(!is_repaired(&null));
}

#[test]
fn what_is_sought_and_what_is_there_is_said() {
    let error = refused("[{\"frame\":0,\"bones\":[]},{\"frame\":1,\"bones\":[1]}]");
    assert!(error.contains("frames without a person: a list, in it an object with bones, frame"), "{error}");
    assert!(error.contains("allowed is key points") && error.contains("people, instances"), "{error}");
    // a file that is of no format has the error of key points, and not that of motions of DeepMimic
    let error = read_named("a.json", b"// made by hand\n{}", &options()).unwrap_err().to_string();
    assert!(error.contains("expected value; allowed are key points"), "{error}");
    let error = refused("[\n  {\n \"a\": 1}\n]");
    assert!(error.contains("found `a list, in it an object with a`"), "{error}");
}

#[test]
fn points_that_an_annotation_of_mpii_does_not_see_have_no_weight() {
    let text = "[{\"image\":\"a.jpg\",\"joints\":[[1,2],[-1,-1],[5,6]],\"joints_vis\":[1,0,1]}]";
    let (found, _) = keypoints(text, 10.0);
    assert_eq!((found.n_keypoints(), found.weights()), (3, &[1.0, 0.0, 1.0][..]));
}
