//! What a file holds: frames, people in them, and what it says of them all.

use super::super::{Place, ReadError, unexpected};
use super::order::natural;
use super::points::{Person, entry, is_body, is_point, is_points, points};
use super::text::{in_frame, is_empty, unexpected_value};
use serde_json::{Map, Value};
use std::collections::{HashMap, HashSet};

/// A frame with all that are seen in it.
#[derive(Default)]
pub(super) struct Frame {
    /// The name of its picture or its file, where it has one.
    pub(super) name: Option<String>,
    /// Its number, where the file has one.
    pub(super) number: Option<f64>,
    pub(super) time: Option<f64>,
    pub(super) people: Vec<Person>,
}

/// What is gathered of a file.
#[derive(Default)]
pub(super) struct File {
    pub(super) names: Option<Vec<String>>,
    pub(super) rate: Option<f64>,
    pub(super) frames: Vec<Frame>,
    /// What was decided where the file leaves it open.
    pub(super) decided: Vec<&'static str>,
    /// Whether the last number of a point may be COCO's visibility.
    is_annotated: bool,
}

const LISTS: [&str; 4] = ["instance_info", "frames", "data", "results"];
const PEOPLE: [&str; 8] =
    ["people", "instances", "persons", "poses", "predictions", "instance_info", "bodies", "pose"];
const WORLD: [&str; 4] = ["pose_world_landmarks", "poseWorldLandmarks", "world_landmarks", "worldLandmarks"];
const LANDMARKS: [&str; 5] =
    ["pose_landmarks", "poseLandmarks", "landmarks", "landmark", "keypoints_normalized"];
const POINTS: [&str; 7] = [
    "pose_keypoints_3d",
    "keypoints_3d",
    "keypoints3d",
    "pose_keypoints_2d",
    "keypoints",
    "pose_keypoints",
    "joints",
];
const PICTURE: [&str; 6] = ["image_id", "image", "image_name", "file_name", "image_path", "image_url"];
const NUMBER: [&str; 6] = ["frame_id", "frame", "frame_idx", "frame_index", "frame_number", "id"];
const SECONDS: [&str; 4] = ["timestamp", "time", "time_s", "t"];
const THOUSANDTHS: [&str; 3] = ["timestamp_ms", "timestampMs", "time_ms"];

/// The keys under which people and their points are looked for, for a message.
pub(super) fn keys_of_people() -> String {
    [&PEOPLE[..], &WORLD, &LANDMARKS, &POINTS].concat().join(", ")
}

impl File {
    /// Gathers the frames of a file.
    pub(super) fn collect(&mut self, root: &Value) -> Result<(), ReadError> {
        let object = match root {
            Value::Array(all) => return self.list(all),
            Value::Object(object) => object,
            Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => return Ok(()),
        };
        self.rate = entry(object, &["fps", "frame_rate", "frameRate", "rate"]).and_then(Value::as_f64);
        self.rate = self.rate.filter(|rate| *rate > 0.0);
        self.describe(object);
        if let Some(Value::Array(all)) = object.get("annotations") {
            self.names = names_in_categories(object, all);
            self.is_annotated = true;
            return self.frames(all, true);
        }
        if let Some(Value::Array(all)) = entry(object, &LISTS) {
            return self.list(all);
        }
        // frames may be called landmarks, as what they have is
        if let Some(Value::Array(all)) = entry(object, &LANDMARKS)
            && all.first().is_some_and(|one| one.is_object() && !is_point(one))
        {
            return self.list(all);
        }
        if let Some(keys) = Keys::of(object) {
            return self.named(object, keys);
        }
        let frame = self.frame(object)?;
        self.frames.extend(frame);
        Ok(())
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
        let Some(first) = all.iter().find(|value| !is_empty(value)) else {
            self.frames.extend(all.iter().map(|_| Frame::default()));
            return Ok(());
        };
        let is_frame = match first {
            Value::Object(object) => {
                let keys = [&PICTURE[..], &PEOPLE, &WORLD, &LANDMARKS, &NUMBER[..5], &SECONDS, &THOUSANDTHS];
                !is_point(first) && (keys.iter().any(|keys| entry(object, keys).is_some()) || is_body(object))
            }
            Value::Array(_) => !is_points(all),
            Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => false,
        };
        if is_frame {
            return self.frames(all, entry_of(first, &PICTURE).is_some());
        }
        let people = match is_points(all) {
            true => points(&Value::Array(all.to_vec()), None, None)?.into_iter().collect(),
            false => self.people(all)?,
        };
        if !people.is_empty() {
            self.frames.push(Frame { people, ..Frame::default() });
        }
        Ok(())
    }

    /// Frames. Several entries may be of one, where they name their picture or have the points and the number of a frame.
    fn frames(&mut self, all: &[Value], in_pictures: bool) -> Result<(), ReadError> {
        let mut frames = Vec::with_capacity(all.len());
        for (i, value) in all.iter().enumerate() {
            let found = match value {
                Value::Object(object) => self.frame(object),
                Value::Array(inner) if is_points(inner) => {
                    points(value, None, Some(4)).map(|one| Some(Frame::of(one.into_iter().collect())))
                }
                Value::Array(inner) => self.people(inner).map(|people| Some(Frame::of(people))),
                Value::Null => Ok(None),
                other => Err(unexpected_value("", other, "a frame")),
            };
            let frame = found.map_err(|error| in_frame(error, i, None))?.unwrap_or_default();
            if in_pictures && frame.name.is_none() {
                let allowed =
                    "a result with its `image_id`, or another name of its picture, as the first has";
                return Err(in_frame(unexpected_value("", value, allowed), i, None));
            }
            frames.push((frame, entry_of(value, &POINTS).is_some()));
        }
        let numbers: HashSet<u64> =
            frames.iter().filter_map(|(frame, _)| Some(frame.number?.to_bits())).collect();
        let mut known: HashMap<(Option<String>, [Option<u64>; 2]), usize> = HashMap::new();
        for (frame, is_person) in frames {
            // the name may be that of a film, with a number or a time for each frame
            let has_name = frame.name.is_some();
            let number = frame.number.filter(|_| has_name || is_person && numbers.len() > 1);
            let time = frame.time.filter(|_| has_name);
            let next = self.frames.len();
            let k = match has_name || number.is_some() {
                true => *known
                    .entry((frame.name.clone(), [number, time].map(|x| x.map(f64::to_bits))))
                    .or_insert(next),
                false => next,
            };
            match self.frames.get_mut(k) {
                Some(known) => known.people.extend(frame.people),
                None => self.frames.push(frame),
            }
        }
        let are_ordered = |of: fn(&Frame) -> Option<f64>| self.frames.iter().all(|frame| of(frame).is_some());
        if in_pictures && !are_ordered(|frame| frame.number) && !are_ordered(|frame| frame.time) {
            self.frames.sort_by_cached_key(|frame| frame.name.as_deref().map(natural));
        }
        Ok(())
    }

    /// Frames under the names of their pictures or files, or under their numbers or times.
    fn named(&mut self, object: &Map<String, Value>, keys: Keys) -> Result<(), ReadError> {
        let mut all: Vec<(&String, &Value)> = object.iter().collect();
        let number = |key: &str| key.parse::<f64>().unwrap_or(f64::NAN);
        match keys {
            Keys::Names => all.sort_by_cached_key(|(name, _)| natural(name)),
            Keys::Numbers | Keys::Times => all.sort_by(|(a, _), (b, _)| number(a).total_cmp(&number(b))),
        }
        match keys {
            Keys::Names => {}
            Keys::Numbers => self.decide("keys of an object are taken to be numbers of frames"),
            Keys::Times => self.decide("keys of an object are taken to be times of frames, s"),
        }
        for (i, (name, content)) in all.into_iter().enumerate() {
            let mut inner = Self::default();
            inner.collect(content).map_err(|error| in_frame(error, i, Some(name)))?;
            let found = match inner.frames.len() {
                0 | 1 => inner.frames.pop(),
                n => {
                    let found = format!("{n} frames");
                    let allowed = format!("one frame in each file or under each name, in `{name}`");
                    return Err(unexpected(Place::Line(i + 1), &found, allowed));
                }
            };
            if found.is_none() && !is_empty(content) {
                let allowed = format!("a frame with people or key points under {}", keys_of_people());
                return Err(in_frame(unexpected_value("", content, allowed), i, Some(name)));
            }
            let Frame { time, people, .. } = found.unwrap_or_default();
            let own = Frame { people, time, ..Frame::default() };
            self.frames.push(match keys {
                Keys::Names => Frame { name: Some(name.clone()), ..own },
                Keys::Numbers => Frame { number: Some(number(name)), ..own },
                Keys::Times => Frame { time: Some(number(name)), ..own },
            });
            self.names = self.names.take().or(inner.names);
            self.rate = self.rate.or(inner.rate);
            self.is_annotated |= inner.is_annotated;
            inner.decided.into_iter().for_each(|what| self.decide(what));
        }
        Ok(())
    }

    fn decide(&mut self, what: &'static str) {
        if !self.decided.contains(&what) {
            self.decided.push(what);
        }
    }

    /// An object that is a frame, if it has people.
    fn frame(&mut self, object: &Map<String, Value>) -> Result<Option<Frame>, ReadError> {
        let real = |value: &Value| value.as_f64().or_else(|| value.as_str()?.parse().ok());
        let name = entry(object, &PICTURE).filter(|value| value.is_string() || value.is_number());
        // a frame may have a name in the place of a number
        let named = || entry(object, &NUMBER).filter(|value| value.is_string() && real(value).is_none());
        let name = name.or_else(named);
        // what is of a picture has a number of its own
        let numbers = if name.is_some() { &NUMBER[..5] } else { &NUMBER };
        let number = entry(object, numbers).and_then(real);
        let thousandths = entry(object, &THOUSANDTHS).and_then(real).map(|time| time / 1000.0);
        let time = entry(object, &SECONDS).and_then(real).or(thousandths);
        let of = |people| Frame { name: name.map(text_of), number, time, people };
        let there = |keys: &[&str]| entry(object, keys).filter(|value| !is_empty(value));
        let found = match (there(&PEOPLE), there(&WORLD), there(&LANDMARKS)) {
            (Some(Value::Array(all)), ..) if object.contains_key("pose") && is_points(all) => landmarks(all)?,
            (Some(Value::Array(all)), ..) => self.people(all)?,
            (_, Some(Value::Array(all)), _) => landmarks(all)?,
            (_, _, Some(Value::Array(all))) => {
                self.decide(IN_PICTURE);
                landmarks(all)?
            }
            (_, None, Some(value @ Value::Object(one))) if one.values().all(is_point) => {
                self.decide(IN_PICTURE);
                points(value, None, Some(4))?.into_iter().collect()
            }
            (_, Some(value @ Value::Object(one)), _) if one.values().all(is_point) => {
                points(value, None, Some(4))?.into_iter().collect()
            }
            _ if entry(object, &POINTS).is_some() => self.person(object)?.into_iter().collect(),
            (Some(Value::Object(one)), ..)
            | (_, Some(Value::Object(one)), _)
            | (_, _, Some(Value::Object(one))) => match self.frame(one)? {
                Some(frame) => frame.people,
                None => return Ok(None),
            },
            _ if is_body(object) => {
                points(&Value::Object(object.clone()), None, Some(4))?.into_iter().collect()
            }
            _ if entry(object, &PEOPLE).or(entry(object, &WORLD)).or(entry(object, &LANDMARKS)).is_some() => {
                Vec::new()
            }
            _ if time.is_some() || number.is_some() || name.is_some() => Vec::new(),
            _ => return Ok(None),
        };
        Ok(Some(of(found)))
    }

    /// The persons of a list: objects or lists of points.
    fn people(&mut self, all: &[Value]) -> Result<Vec<Person>, ReadError> {
        let mut people = Vec::new();
        for value in all {
            match value {
                Value::Object(object) => people.extend(self.person(object)?),
                Value::Array(_) if is_point(value) => return Err(unexpected_value("", value, A_PERSON)),
                // MMPose has lists of one frame in a list
                Value::Array(inner) if !is_points(inner) => {
                    for value in inner {
                        match value {
                            Value::Object(object) => people.extend(self.person(object)?),
                            other => return Err(unexpected_value("", other, A_PERSON)),
                        }
                    }
                }
                Value::Array(_) => people.extend(points(value, None, None)?),
                // nobody was seen
                Value::Null => {}
                Value::Bool(_) | Value::Number(_) | Value::String(_) => {
                    return Err(unexpected_value("", value, A_PERSON));
                }
            }
        }
        Ok(people)
    }

    fn person(&mut self, object: &Map<String, Value>) -> Result<Option<Person>, ReadError> {
        let scores = entry(object, &["keypoint_scores", "scores", "keypoints_scores", "joints_vis"])
            .and_then(Value::as_array);
        let track = entry(object, &["track_id", "idx"]).and_then(Value::as_u64);
        let own = POINTS.map(|key| (key, if key.ends_with("3d") { 4 } else { 3 }));
        let landmarks = WORLD.iter().chain(&LANDMARKS).map(|key| (*key, 4));
        for (key, stride) in own.into_iter().chain(landmarks) {
            if let Some(value) = object.get(key).filter(|value| !is_empty(value)) {
                let mut found = points(value, scores, Some(stride))?;
                found.iter_mut().for_each(|person| person.track = track);
                return Ok(found);
            }
        }
        match entry(object, &["x", "y"]) {
            Some(_) => Err(unexpected_value("", &Value::Object(object.clone()), A_PERSON)),
            None => Ok(None),
        }
    }

    /// Halves COCO's visibility, which is 0, 1 or 2 and stands where others have a confidence.
    pub(super) fn halve_visibility(&mut self) {
        let people =
            || self.frames.iter().flat_map(|frame| &frame.people).filter(|person| person.is_weight_last);
        let is_visibility = |weight: f64| weight == 0.0 || weight == 1.0 || weight == 2.0;
        if self.is_annotated && people().flat_map(|person| &person.points).all(|point| is_visibility(point.2))
        {
            let people = self.frames.iter_mut().flat_map(|frame| &mut frame.people);
            let points = people.filter(|person| person.is_weight_last).flat_map(|person| &mut person.points);
            points.for_each(|point| point.2 *= 0.5);
        }
    }
}

/// What a message says of a person.
const A_PERSON: &str = "a person with key points";
/// What is said of landmarks that are no world landmarks.
const IN_PICTURE: &str = "coordinates are fractions of the width and the height of the picture";

impl Frame {
    fn of(people: Vec<Person>) -> Self {
        Self { people, ..Self::default() }
    }
}

/// What the keys of an object say of the frames under them.
#[derive(Clone, Copy)]
enum Keys {
    Names,
    Numbers,
    Times,
}

impl Keys {
    /// Endings of names of pictures, and of files of a folder.
    const ENDINGS: [&str; 8] = [".json", ".jpg", ".jpeg", ".png", ".bmp", ".webp", ".tif", ".tiff"];

    /// Those of an object of frames.
    fn of(object: &Map<String, Value>) -> Option<Self> {
        let is_name = |key: &String| {
            let key = key.to_ascii_lowercase();
            Self::ENDINGS.iter().any(|ending| key.ends_with(ending))
        };
        let is_number =
            |key: &String| key.starts_with(|c: char| c.is_ascii_digit()) && key.parse::<f64>().is_ok();
        if object.is_empty()
            || !object.values().all(|value| value.is_object() || value.is_array() || value.is_null())
        {
            return None;
        }
        if object.keys().all(is_name) {
            return Some(Self::Names);
        }
        if !object.keys().all(is_number) || is_body(object) {
            return None;
        }
        Some(if object.keys().any(|key| key.contains('.')) { Self::Times } else { Self::Numbers })
    }
}

/// The first of these entries of a value that is an object.
fn entry_of<'v>(value: &'v Value, keys: &[&str]) -> Option<&'v Value> {
    value.as_object().and_then(|object| entry(object, keys))
}

/// Names of the points of annotations: those of their category, or else of the only one that has some; none of several.
fn names_in_categories(object: &Map<String, Value>, annotations: &[Value]) -> Option<Vec<String>> {
    let used: HashSet<String> =
        annotations.iter().filter_map(|one| one.get("category_id")).map(Value::to_string).collect();
    let named = |category: &Value| -> Option<(bool, Vec<String>)> {
        let names: Vec<String> = category.get("keypoints")?.as_array()?.iter().map(text_of).collect();
        let is_used = category.get("id").is_some_and(|id| used.contains(&id.to_string()));
        (!names.is_empty()).then_some((is_used, names))
    };
    let all: Vec<(bool, Vec<String>)> =
        object.get("categories")?.as_array()?.iter().filter_map(named).collect();
    let are_used = all.iter().any(|(is_used, _)| *is_used);
    let mut of_these = all.into_iter().filter(|(is_used, _)| *is_used == are_used).map(|(_, names)| names);
    let first = of_these.next()?;
    // points of several models have no names in common
    Some(if of_these.all(|names| names == first) { first } else { Vec::new() })
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
