//! Key points of pose estimators, as JSON.
//!
//! | Program | A file is | Points of a person |
//! |---|---|---|
//! | OpenPose | a frame, `people`; or a folder of them ([`frames_in`]), or a list | `pose_keypoints_3d`, `pose_keypoints_2d`: x, y, (z,) confidence |
//! | COCO, AlphaPose | a list of results with `image_id`, or `annotations` with `categories` | `keypoints`: x, y, confidence or visibility |
//! | MMPose | `instance_info`, or a list of frames with `instances` | `keypoints`, and `keypoint_scores` |
//! | MediaPipe | a frame or a list of them: landmarks with x, y, z, `visibility` | world landmarks, or those of the picture |
//!
//! Names are the file's, where it has them, and otherwise those of the number of points: 17 of COCO, 18 of OpenPose's model of COCO, 25
//! of BODY_25, 26 of HALPE-26, 33 of MediaPipe. A point at the origin of a confidence of 0 was not found. The weight of a point
//! is its confidence, or half of COCO's visibility; 1 if the file has neither. Coordinates stay as they are: pixels, fractions of the
//! picture, or metres; [`KeypointRecording::markers`] makes markers of them.
//!
//! Files have no times, but for a `timestamp` or `time` (s) or `timestamp_ms` of each frame, or a rate, `fps`, of all: the caller
//! says the rate. The caller chooses the person too; otherwise the one with the greatest weights in the first frame is followed, from
//! frame to frame to the nearest.
//!
//! Sources: OpenPose, `doc/02_output.md`; COCO, *Data format* and *Results format*; MMPose, *Inference with existing models*; MediaPipe,
//! *Pose landmark detection guide*; HALPE-FullBody, `README`.

use super::{
    Format, LoadError, Place, ReadError, Recording, Repairs, bytes_at, decoded, shorten, unexpected,
};
use crate::recording::{Axis, KeypointRecording, LengthUnit};
use serde_json::{Map, Value};
use std::path::Path;

/// What a message says of a file that has no key points.
const ALLOWED: &str = "key points of OpenPose, COCO, MMPose or MediaPipe";
/// Points that a person may have, more than any model has.
const MOST_POINTS: usize = 2048;

/// This format.
pub const FORMAT: Format = Format {
    name: "key points (JSON)",
    endings: &["json", "jsonl"],
    unit: Some(LengthUnit::Metre),
    up: Axis::MinusY,
    forward: Axis::PlusX,
    knows: |_, text| text.starts_with(['{', '[']),
    parse: |bytes, choices, repairs| {
        let text = decoded(bytes, repairs)?;
        let choice = PoseOptions { rate: choices.given.rate, person: choices.given.person };
        Ok(Recording::Keypoints(read(&text, &choice, repairs)?).into())
    },
};

/// What a file does not say.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PoseOptions {
    /// Frames a second.
    pub rate: Option<f64>,
    /// Which person of each frame, from 0; none for the one who is followed.
    pub person: Option<usize>,
}

const COCO: [&str; 17] = [
    "nose",
    "left_eye",
    "right_eye",
    "left_ear",
    "right_ear",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_ankle",
    "right_ankle",
];
const OPENPOSE_COCO: [&str; 18] = [
    "nose",
    "neck",
    "right_shoulder",
    "right_elbow",
    "right_wrist",
    "left_shoulder",
    "left_elbow",
    "left_wrist",
    "right_hip",
    "right_knee",
    "right_ankle",
    "left_hip",
    "left_knee",
    "left_ankle",
    "right_eye",
    "left_eye",
    "right_ear",
    "left_ear",
];
const BODY_25: [&str; 25] = [
    "nose",
    "neck",
    "right_shoulder",
    "right_elbow",
    "right_wrist",
    "left_shoulder",
    "left_elbow",
    "left_wrist",
    "mid_hip",
    "right_hip",
    "right_knee",
    "right_ankle",
    "left_hip",
    "left_knee",
    "left_ankle",
    "right_eye",
    "left_eye",
    "right_ear",
    "left_ear",
    "left_big_toe",
    "left_small_toe",
    "left_heel",
    "right_big_toe",
    "right_small_toe",
    "right_heel",
];
const HALPE_26: [&str; 26] = [
    "nose",
    "left_eye",
    "right_eye",
    "left_ear",
    "right_ear",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_ankle",
    "right_ankle",
    "head",
    "neck",
    "mid_hip",
    "left_big_toe",
    "right_big_toe",
    "left_small_toe",
    "right_small_toe",
    "left_heel",
    "right_heel",
];
const MEDIAPIPE: [&str; 33] = [
    "nose",
    "left_eye_inner",
    "left_eye",
    "left_eye_outer",
    "right_eye_inner",
    "right_eye",
    "right_eye_outer",
    "left_ear",
    "right_ear",
    "mouth_left",
    "mouth_right",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_pinky",
    "right_pinky",
    "left_index",
    "right_index",
    "left_thumb",
    "right_thumb",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_ankle",
    "right_ankle",
    "left_heel",
    "right_heel",
    "left_foot_index",
    "right_foot_index",
];

/// Names of so many points, in the order of the model that has that many.
pub(crate) fn names_of(n: usize) -> Option<&'static [&'static str]> {
    Some(match n {
        17 => &COCO,
        18 => &OPENPOSE_COCO,
        25 => &BODY_25,
        26 => &HALPE_26,
        33 => &MEDIAPIPE,
        _ => return None,
    })
}

/// The frames of a folder, the JSON files in the order of the numbers in their names, as one list. Fails if there are none.
pub fn frames_in(folder: impl AsRef<Path>) -> Result<Vec<u8>, LoadError> {
    let folder = folder.as_ref();
    let io = |error: std::io::Error| LoadError::Io { path: folder.to_owned(), reason: error.to_string() };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json")) {
            files.push(path);
        }
    }
    files.sort_by_key(|path| natural(&path.file_name().unwrap_or_default().to_string_lossy()));
    let mut all = Vec::new();
    for path in &files {
        let bytes = bytes_at(path)?;
        if let Err(error) = serde_json::from_slice::<serde::de::IgnoredAny>(&bytes) {
            return Err(LoadError::Read { path: path.clone(), source: fault(&error) });
        }
        all.push(if all.is_empty() { b'[' } else { b',' });
        all.extend(bytes);
    }
    if all.is_empty() {
        return Err(LoadError::NoFrames { path: folder.to_owned() });
    }
    all.push(b']');
    Ok(all)
}

/// A name with its numbers as such, so that frame 10 comes after frame 9.
fn natural(name: &str) -> Vec<(String, u64)> {
    let mut parts = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        let text = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let digits = rest[text..].find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len() - text);
        let number = rest[text..text + digits].parse().unwrap_or(u64::MAX);
        parts.push((rest[..text].to_owned(), number));
        rest = &rest[text + digits..];
    }
    parts
}

fn fault(error: &serde_json::Error) -> ReadError {
    let place = Place::Line(error.line().max(1));
    if error.is_eof() {
        return ReadError::Truncated { place, allowed: format!("{ALLOWED}, as JSON") };
    }
    let message = error.to_string();
    let message = message.rsplit_once(" at line ").map_or(message.as_str(), |(message, _)| message);
    let reason = format!("{}; allowed are {ALLOWED}, as JSON", shorten(message, 120));
    ReadError::Malformed { place, column: error.column(), reason }
}

/// A point: its coordinates, how many of them there are, and its weight.
type Point = ([f64; 3], usize, f64);

/// The points of a person.
struct Person {
    points: Vec<Point>,
    names: Option<Vec<String>>,
}

/// A frame with all that are seen in it.
#[derive(Default)]
struct Frame {
    /// Its number, where the file has one.
    number: Option<f64>,
    time: Option<f64>,
    people: Vec<Person>,
}

/// The recording in `text`. Frames are all there is to say where they are: errors have the number of the frame as the line, from 1, of
/// a list.
pub fn read(
    text: &str,
    options: &PoseOptions,
    repairs: &mut Repairs,
) -> Result<KeypointRecording, ReadError> {
    let root = value(text, repairs)?;
    let mut file = File { names: None, rate: None, frames: Vec::new(), in_picture: false };
    file.collect(&root)?;
    let head = Place::Line(1);
    if file.frames.is_empty() {
        return Err(unexpected(head, &text.chars().take(60).collect::<String>(), ALLOWED));
    }
    if file.in_picture {
        repairs.decide(head, "coordinates are fractions of the width and the height of the picture");
    }
    let n_people = file.frames.iter().map(|frame| frame.people.len()).max().unwrap_or(0);
    if n_people == 0 {
        return Err(unexpected(head, "frames without a person", ALLOWED));
    }
    if let Some(found) = options.person.filter(|person| *person >= n_people) {
        return Err(ReadError::Person { found, n_people });
    }
    let chosen = choose(&file.frames, options.person);
    if n_people > 1 {
        repairs.decide(
            head,
            match options.person {
                Some(k) => format!("there are up to {n_people} people in a frame, number {k} is read"),
                None => {
                    format!("there are up to {n_people} people in a frame, one is followed; `person` chooses")
                }
            },
        );
    }
    let n = chosen.iter().flatten().map(|person| person.points.len()).max().unwrap_or(0);
    let n_dims = chosen.iter().flatten().flat_map(|p| &p.points).map(|point| point.1).max().unwrap_or(2);
    let names = file.names.or_else(|| chosen.iter().flatten().find_map(|person| person.names.clone()));
    let names = match names.filter(|names| names.len() == n) {
        Some(names) => super::distinct(names, "point", head, repairs)?,
        None => match names_of(n) {
            Some(names) => names.iter().map(|name| (*name).to_owned()).collect(),
            None => (1..=n).map(|k| format!("point {k}")).collect(),
        },
    };
    // persons that have fewer points, or are not there, are filled up with weights of 0: that must not make a large recording of a small file
    if n.saturating_mul(file.frames.len()) > text.len() {
        return Err(unexpected(head, &format!("{n} points"), "as many points in each frame"));
    }
    let times = times(&file.frames, options.rate.or(file.rate), repairs)?;
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for (i, person) in chosen.iter().enumerate() {
        let place = Place::Line(i + 1);
        let found = person.map(|person| person.points.as_slice()).unwrap_or_default();
        if found.is_empty() {
            repairs.decide(place, "nobody is in a frame");
        } else if found.len() != n {
            let wrong = unexpected(place, &format!("{} points", found.len()), format!("{n} points"));
            repairs.instead_of(wrong, "a person lacks points")?;
        }
        for k in 0..n {
            let (x, _, weight) = found.get(k).copied().unwrap_or(([0.0; 3], n_dims, 0.0));
            let there = x.iter().all(|x| x.is_finite()) && weight > 0.0 && weight.is_finite();
            points.extend(x[..n_dims].iter().map(|x| if there { *x } else { 0.0 }));
            weights.push(if there { weight } else { 0.0 });
        }
    }
    KeypointRecording::try_new(names, times, n_dims, points, weights)
        .map_err(|error| ReadError::recording(error, head, |frame| Some(Place::Line(frame + 1))))
}

/// The value of a text, or a list of the values that stand one after another, as programs write them line by line.
fn value(text: &str, repairs: &mut Repairs) -> Result<Value, ReadError> {
    let values: Result<Vec<Value>, _> = serde_json::Deserializer::from_str(text).into_iter().collect();
    let mut values = values.map_err(|error| fault(&error))?;
    if values.len() > 1 {
        let error = unexpected(Place::Line(1), "values one after another", "one value");
        repairs.instead_of(error, "values one after another are read as a list")?;
        return Ok(Value::Array(values));
    }
    let nothing = || ReadError::Truncated { place: Place::Line(1), allowed: format!("{ALLOWED}, as JSON") };
    values.pop().ok_or_else(nothing)
}

/// The person of each frame.
fn choose(frames: &[Frame], number: Option<usize>) -> Vec<Option<&Person>> {
    if let Some(k) = number {
        return frames.iter().map(|frame| frame.people.get(k)).collect();
    }
    let sure = |person: &Person| person.points.iter().map(|(.., weight)| weight).sum::<f64>();
    let mut before: Option<&Person> = None;
    let mut chosen = Vec::with_capacity(frames.len());
    for frame in frames {
        let found = match before {
            None => frame.people.iter().max_by(|a, b| sure(a).total_cmp(&sure(b))),
            Some(before) => {
                let far = |person: &Person| distance(before, person);
                frame.people.iter().min_by(|a, b| far(a).total_cmp(&far(b)))
            }
        };
        before = found.or(before);
        chosen.push(found);
    }
    chosen
}

/// The mean distance of the points that two persons have; infinite where they have none in common.
fn distance(a: &Person, b: &Person) -> f64 {
    let (mut sum, mut n) = (0.0, 0.0);
    for ((x, _, v), (y, _, w)) in a.points.iter().zip(&b.points) {
        if *v > 0.0 && *w > 0.0 {
            sum += (0..3).map(|i| (x[i] - y[i]).powi(2)).sum::<f64>().sqrt();
            n += 1.0;
        }
    }
    if n > 0.0 { sum / n } else { f64::INFINITY }
}

/// Times of the frames: the file's, or those of their numbers at a rate.
fn times(frames: &[Frame], rate: Option<f64>, repairs: &mut Repairs) -> Result<Vec<f64>, ReadError> {
    let own: Vec<f64> = frames.iter().filter_map(|frame| frame.time).collect();
    if own.len() == frames.len() && own.windows(2).all(|pair| pair[1] > pair[0]) {
        return Ok(own);
    }
    if frames.len() == 1 {
        return Ok(vec![0.0]);
    }
    let Some(rate) = rate else { return Err(ReadError::NoRate { format: FORMAT.name }) };
    let numbers: Vec<f64> = frames.iter().filter_map(|frame| frame.number).collect();
    let rise = numbers.len() == frames.len() && numbers.windows(2).all(|pair| pair[1] > pair[0]);
    // identifiers of the pictures of a data set are not numbers of frames
    let span = if rise { numbers[numbers.len() - 1] - numbers[0] } else { f64::INFINITY };
    if span > 10.0 * frames.len() as f64 {
        if !numbers.is_empty() {
            repairs.decide(Place::Line(1), "numbers of pictures are no numbers of frames, which are counted");
        }
        return Ok((0..frames.len()).map(|i| i as f64 / rate).collect());
    }
    Ok(numbers.iter().map(|number| (number - numbers[0]) / rate).collect())
}

/// What is gathered of a file.
struct File {
    names: Option<Vec<String>>,
    rate: Option<f64>,
    frames: Vec<Frame>,
    /// Whether points are in fractions of the picture.
    in_picture: bool,
}

/// The first of these entries that an object has.
fn entry<'v>(object: &'v Map<String, Value>, keys: &[&str]) -> Option<&'v Value> {
    keys.iter().find_map(|key| object.get(*key))
}

/// A number, or one that ends a name: `000012.jpg`.
fn number_in(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => number.as_f64(),
        Value::String(name) => {
            let stem = name.rsplit_once('.').map_or(name.as_str(), |(stem, _)| stem);
            let digits = stem.len() - stem.trim_end_matches(|c: char| c.is_ascii_digit()).len();
            stem[stem.len() - digits..].parse().ok()
        }
        _ => None,
    }
}

const PEOPLE: [&str; 6] = ["people", "instances", "persons", "poses", "predictions", "instance_info"];
const WORLD: [&str; 4] = ["pose_world_landmarks", "poseWorldLandmarks", "world_landmarks", "worldLandmarks"];
const PICTURE: [&str; 5] =
    ["pose_landmarks", "poseLandmarks", "landmarks", "landmark", "keypoints_normalized"];
const POINTS: [&str; 5] =
    ["pose_keypoints_3d", "keypoints_3d", "pose_keypoints_2d", "keypoints", "pose_keypoints"];
const NUMBER: [&str; 6] = ["frame_id", "frame", "frame_idx", "frame_index", "frame_number", "id"];

impl File {
    /// Gathers the frames of a file.
    fn collect(&mut self, root: &Value) -> Result<(), ReadError> {
        match root {
            Value::Object(object) => {
                self.rate =
                    entry(object, &["fps", "frame_rate", "frameRate", "rate"]).and_then(Value::as_f64);
                self.rate = self.rate.filter(|rate| *rate > 0.0);
                self.describe(object);
                if let Some(Value::Array(all)) = object.get("annotations") {
                    let categories =
                        object.get("categories").and_then(|all| all.get(0)?.get("keypoints")?.as_array());
                    self.names = categories.map(|names| names.iter().map(text_of).collect());
                    return self.results(all, 0.5);
                }
                if let Some(Value::Array(all)) =
                    entry(object, &["instance_info", "frames", "data", "results"])
                {
                    return self.list(all);
                }
                // frames may be called landmarks, as what they have is
                if let Some(Value::Array(all)) = entry(object, &PICTURE)
                    && all.first().and_then(Value::as_object).is_some_and(|one| !one.contains_key("x"))
                {
                    return self.list(all);
                }
                let frame = self.frame(object)?;
                self.frames.extend(frame);
                Ok(())
            }
            Value::Array(all) => self.list(all),
            _ => Ok(()),
        }
    }

    /// Names that MMPose has in `meta_info`.
    fn describe(&mut self, object: &Map<String, Value>) {
        let Some(Value::Object(names)) =
            object.get("meta_info").and_then(|meta| meta.get("keypoint_id2name"))
        else {
            return;
        };
        let mut numbered: Vec<(usize, String)> =
            names.iter().filter_map(|(id, name)| Some((id.parse().ok()?, text_of(name)))).collect();
        numbered.sort();
        self.names = Some(numbered.into_iter().map(|(_, name)| name).collect());
    }

    /// A list: of frames, of results of pictures, or of the persons or the points of one frame.
    fn list(&mut self, all: &[Value]) -> Result<(), ReadError> {
        let first = all.first();
        let has = |keys: &[&str]| {
            first.and_then(Value::as_object).is_some_and(|object| entry(object, keys).is_some())
        };
        if has(&["image_id"]) {
            return self.results(all, 1.0);
        }
        let is_frames = has(&PEOPLE)
            || has(&WORLD)
            || has(&PICTURE)
            || has(&NUMBER[..5])
            || has(&["timestamp", "time", "t"]);
        if is_frames || first.is_some_and(Value::is_array) && !is_points(all) {
            for (i, value) in all.iter().enumerate() {
                let frame = match value {
                    Value::Object(object) => self.frame(object)?,
                    Value::Array(inner) => Some(Frame { people: self.people(inner)?, ..Frame::default() }),
                    Value::Null => None,
                    other => {
                        return Err(unexpected(Place::Line(i + 1), &other.to_string(), "a frame"));
                    }
                };
                self.frames.push(frame.unwrap_or_default());
            }
            return Ok(());
        }
        let people = self.people(all)?;
        if !people.is_empty() {
            self.frames.push(Frame { people, ..Frame::default() });
        }
        Ok(())
    }

    /// Results that name their picture, several of which may be of one.
    fn results(&mut self, all: &[Value], visibility: f64) -> Result<(), ReadError> {
        let mut order: std::collections::HashMap<String, usize> = std::collections::HashMap::new();
        for (i, value) in all.iter().enumerate() {
            let Some(picture) = value.get("image_id") else {
                let found: String = value.to_string().chars().take(60).collect();
                return Err(unexpected(Place::Line(i + 1), &found, "a result with its `image_id`"));
            };
            let mut people = self.people(std::slice::from_ref(value))?;
            people.iter_mut().flat_map(|p| &mut p.points).for_each(|point| point.2 *= visibility);
            let k = *order.entry(text_of(picture)).or_insert(self.frames.len());
            if k == self.frames.len() {
                self.frames.push(Frame { number: number_in(picture), ..Frame::default() });
            }
            self.frames[k].people.extend(people);
        }
        if self.frames.iter().all(|frame| frame.number.is_some()) {
            let number = |frame: &Frame| frame.number.unwrap_or(0.0);
            self.frames.sort_by(|a, b| number(a).total_cmp(&number(b)));
        }
        Ok(())
    }

    /// An object that is a frame, if it has people.
    fn frame(&mut self, object: &Map<String, Value>) -> Result<Option<Frame>, ReadError> {
        let seconds = entry(object, &["timestamp", "time", "time_s", "t"]).and_then(Value::as_f64);
        let thousandths = entry(object, &["timestamp_ms", "timestampMs", "time_ms"]).and_then(Value::as_f64);
        let number = entry(object, &NUMBER).and_then(number_in);
        let time = seconds.or(thousandths.map(|t| t / 1000.0));
        let people = match (entry(object, &PEOPLE), entry(object, &WORLD), entry(object, &PICTURE)) {
            (Some(Value::Array(all)), ..) => self.people(all)?,
            (_, Some(Value::Array(all)), _) if !all.is_empty() => landmarks(all)?,
            (_, _, Some(Value::Array(all))) => {
                self.in_picture |= !all.is_empty();
                landmarks(all)?
            }
            _ if entry(object, &POINTS).is_some() => self.person(object)?.into_iter().collect(),
            (None, Some(Value::Object(one)), _) | (None, None, Some(Value::Object(one))) => {
                return self.frame(one).map(|found| found.map(|frame| Frame { number, time, ..frame }));
            }
            _ if time.is_some() || number.is_some() => Vec::new(),
            _ => return Ok(None),
        };
        Ok(Some(Frame { number, time, people }))
    }

    /// The persons of a list: objects, lists of points, or the points of one.
    fn people(&mut self, all: &[Value]) -> Result<Vec<Person>, ReadError> {
        if is_points(all) {
            return Ok(points(&Value::Array(all.to_vec()), None, None)?.into_iter().collect());
        }
        let mut people = Vec::new();
        for value in all {
            match value {
                Value::Object(object) => people.extend(self.person(object)?),
                // MMPose has lists of one frame in a list
                Value::Array(inner) if !is_points(inner) => {
                    for value in inner {
                        match value {
                            Value::Object(object) => people.extend(self.person(object)?),
                            other => return Err(unexpected(Place::Line(1), &other.to_string(), "a person")),
                        }
                    }
                }
                Value::Array(_) => people.extend(points(value, None, None)?),
                // nobody was seen
                Value::Null => {}
                Value::Bool(_) | Value::Number(_) | Value::String(_) => {
                    return Err(unexpected(Place::Line(1), &value.to_string(), "a person"));
                }
            }
        }
        Ok(people)
    }

    fn person(&mut self, object: &Map<String, Value>) -> Result<Option<Person>, ReadError> {
        let scores = entry(object, &["keypoint_scores", "scores", "keypoints_scores"]);
        for key in POINTS {
            let Some(value) = object.get(key) else { continue };
            if value.as_array().is_some_and(Vec::is_empty) {
                continue;
            }
            let stride = if key.ends_with("3d") { 4 } else { 3 };
            return points(value, scores.and_then(Value::as_array), Some(stride));
        }
        for key in WORLD.iter().chain(&PICTURE) {
            if let Some(value @ Value::Array(_)) = object.get(*key) {
                return points(value, scores.and_then(Value::as_array), Some(4));
            }
        }
        Ok(None)
    }
}

/// The persons of landmarks: the points of one, or a list of such.
fn landmarks(all: &[Value]) -> Result<Vec<Person>, ReadError> {
    if is_points(all) {
        return Ok(points(&Value::Array(all.to_vec()), None, Some(4))?.into_iter().collect());
    }
    let mut people = Vec::new();
    for value in all {
        people.extend(points(value, None, Some(4))?);
    }
    Ok(people)
}

fn text_of(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// Whether a list is one of points: objects with x and y, lists of up to four numbers, or numbers.
fn is_points(all: &[Value]) -> bool {
    match all.first() {
        Some(Value::Object(point)) => point.contains_key("x") && point.contains_key("y"),
        Some(Value::Array(point)) => (2..=4).contains(&point.len()) && point.iter().all(Value::is_number),
        Some(Value::Number(_)) => true,
        _ => false,
    }
}

/// The points of a person; of flat lists with `stride` numbers for each, of which the last is a confidence.
fn points(
    value: &Value,
    scores: Option<&Vec<Value>>,
    stride: Option<usize>,
) -> Result<Option<Person>, ReadError> {
    let Value::Array(all) = value else { return Ok(None) };
    let wrong = |found: &Value, allowed: &str| Err(unexpected(Place::Line(1), &found.to_string(), allowed));
    let real = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let score = |k: usize| scores.and_then(|scores| scores.get(k)).map(real);
    let mut points: Vec<Point> = Vec::new();
    let mut names = Vec::new();
    if all.first().is_some_and(Value::is_number) {
        let stride = stride.unwrap_or(3);
        if all.len() % stride != 0 {
            let allowed = format!("a multiple of {stride} numbers");
            return Err(unexpected(Place::Line(1), &format!("{} numbers", all.len()), allowed));
        }
        for (k, row) in all.chunks_exact(stride).enumerate() {
            let mut x = [0.0; 3];
            x.iter_mut().zip(&row[..stride - 1]).for_each(|(x, value)| *x = real(value));
            points.push((x, stride - 1, score(k).unwrap_or(real(&row[stride - 1]))));
        }
    } else {
        for (k, value) in all.iter().enumerate() {
            match value {
                Value::Array(row) if (2..=4).contains(&row.len()) => {
                    // of landmarks, and where scores are given, a third number is a coordinate, otherwise a confidence
                    let is_place = score(k).is_some() || stride == Some(4) || row.len() == 2;
                    let n_dims = if is_place { row.len().min(3) } else { row.len() - 1 };
                    let mut x = [0.0; 3];
                    x.iter_mut().zip(&row[..n_dims]).for_each(|(x, value)| *x = real(value));
                    let own = row.get(n_dims).map(real);
                    points.push((x, n_dims, score(k).or(own).unwrap_or(1.0)));
                }
                Value::Object(row) if row.contains_key("x") && row.contains_key("y") => {
                    let z = row.get("z").map(real);
                    let x = ["x", "y"].map(|key| row.get(key).map_or(f64::NAN, real));
                    let weight = entry(row, &["visibility", "score", "confidence", "presence", "likelihood"])
                        .map(real);
                    points.push((
                        [x[0], x[1], z.unwrap_or(0.0)],
                        2 + usize::from(z.is_some()),
                        weight.unwrap_or(1.0),
                    ));
                    names.extend(row.get("name").and_then(Value::as_str).map(str::to_owned));
                }
                Value::Null => points.push(([0.0; 3], 2, 0.0)),
                other => return wrong(other, "a point: x, y, z and a confidence"),
            }
        }
    }
    if points.len() > MOST_POINTS {
        return wrong(&Value::from(points.len()), "at most 2048 points of a person");
    }
    // negative confidences of points that were not found
    points.iter_mut().for_each(|point| point.2 = point.2.max(0.0));
    let named = names.len() == points.len() && !names.is_empty();
    Ok((!points.is_empty()).then_some(Person { points, names: named.then_some(names) }))
}
