//! Key points of pose estimators, as JSON.
//!
//! | Program | A file is | Points of a person |
//! |---|---|---|
//! | OpenPose | a frame, `people`; or a folder of them ([`frames_in`]), or a list | `pose_keypoints_3d`, `pose_keypoints_2d`: x, y, (z,) confidence |
//! | COCO, AlphaPose | a list of results with `image_id`, or `annotations` with `categories`; an object of frames under the names of their pictures | `keypoints`, `joints`: x, y, confidence or visibility |
//! | MMPose | `instance_info`, or a list of frames with `instances` | `keypoints`, and `keypoint_scores` |
//! | MediaPipe | a frame or a list of them: landmarks with x, y, z, `visibility`, also under their names or numbers | world landmarks, or those of the picture |
//! | EasyMocap | a folder of lists of people | `keypoints3d`: x, y, z |
//!
//! Names are the file's, of annotations those of their category, and otherwise those of the number of points: 17 of COCO, 18 of
//! OpenPose's model of COCO, 25 of BODY_25, 26 of HALPE-26, 33 of MediaPipe. Points whose names in the file do not fit are numbered.
//! Points that have an `id` or a name of their own stand where that says, with weights of 0 for those that are absent. A point at the
//! origin of a confidence of 0 was not found. The weight of a point is its confidence; half of COCO's visibility, which is 0, 1 or 2 in
//! all of a file; 1 if the file has neither. Coordinates stay as they are: pixels, fractions of the picture, or metres;
//! [`KeypointRecording::markers`] makes markers of them.
//!
//! Pictures are in the order of their names, in which numbers count as such. Where names differ in one number only, that is the number
//! of the frame, and a frame that is not there leaves a gap; of other names frames are counted. Each file of a folder is one frame.
//!
//! The caller says the rate. Without it, times are a `timestamp` or `time` (s) or `timestamp_ms` of each frame, or follow from a rate,
//! `fps`, of all; frames that would be more than 5 s apart are refused, since their times are not in seconds.
//!
//! The caller chooses the person too; otherwise the one with the greatest weights in the first frame is followed: by `track_id` or
//! `idx` where these tell people apart, or else to the nearest by the median distance of the points. A frame in which the nearest is
//! farther away than half the diagonal of the greater of the two, for each frame gone by, has nobody. Each such frame is listed as a decision.
//!
//! Sources: OpenPose, `doc/02_output.md`; COCO, *Data format* and *Results format*; MMPose, *Inference with existing models*; MediaPipe,
//! *Pose landmark detection guide*; HALPE-FullBody, `README`.

mod content;
mod folder;
mod following;
mod models;
mod order;
mod points;
mod text;

use super::{Format, Place, ReadError, Recording, Repairs, decoded, distinct, unexpected};
use crate::recording::{Axis, KeypointRecording, LengthUnit};
use content::{File, Frame, keys_of_people};
pub use folder::frames_in;
pub(crate) use models::names_of;
use order::numbers_in;
use points::Person;
use text::{ALLOWED, unexpected_value};

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
    /// Frames a second; where it is given, times of the file are not used.
    pub rate: Option<f64>,
    /// Which person of each frame, from 0; none for the one who is followed.
    pub person: Option<usize>,
}

/// Times that are in seconds are not further apart, in the middle, s.
const LONGEST_STEP: f64 = 5.0;

/// The recording in `text`. Frames are all there is to say where they are: errors have the number of the frame as the line, from 1, of
/// a list, and the name of the file of a folder.
pub fn read(
    text: &str,
    options: &PoseOptions,
    repairs: &mut Repairs,
) -> Result<KeypointRecording, ReadError> {
    let root = text::value(text, repairs)?;
    let mut file = File::default();
    file.collect(&root)?;
    let head = Place::Line(1);
    if file.frames.is_empty() {
        let allowed = format!("{ALLOWED}, under {}", keys_of_people());
        return Err(unexpected_value("", &root, allowed));
    }
    let n_people = file.frames.iter().map(|frame| frame.people.len()).max().unwrap_or(0);
    if n_people == 0 {
        let allowed = format!("{ALLOWED}, under {}", keys_of_people());
        return Err(unexpected_value("frames without a person: ", &root, allowed));
    }
    if let Some(found) = options.person.filter(|person| *person >= n_people) {
        return Err(ReadError::Person { found, n_people });
    }
    for what in &file.decided {
        repairs.decide(head, *what);
    }
    file.halve_visibility();
    let mut people: Vec<&mut Person> = file.frames.iter_mut().flat_map(|frame| &mut frame.people).collect();
    let labels = points::align(&mut people, text.len())?;
    let (positions, reason) = positions(&file.frames);
    let chosen = match options.person {
        Some(k) => file.frames.iter().map(|frame| frame.people.get(k)).collect(),
        None => following::followed(&file.frames, &positions),
    };
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
    let names = match (file.names.or(labels), names_of(n)) {
        (Some(names), _) if names.len() == n => distinct(names, "point", head, repairs)?,
        (None, Some(names)) => names.iter().map(|name| (*name).to_owned()).collect(),
        (own, _) => {
            if own.is_some() {
                repairs.decide(head, "names of the file are not those of its points, which are numbered");
            }
            (1..=n).map(|k| format!("point {k}")).collect()
        }
    };
    // persons that have fewer points, or are not there, are filled up with weights of 0: that must not make a large recording of a small file
    if n.saturating_mul(file.frames.len()) > text.len() {
        return Err(unexpected(head, &format!("{n} points"), "as many points in each frame"));
    }
    let times = times(&file.frames, (&positions, reason), (options.rate, file.rate), repairs)?;
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for (i, (frame, person)) in file.frames.iter().zip(&chosen).enumerate() {
        let place = Place::Line(i + 1);
        let found = person.map(|person| person.points.as_slice()).unwrap_or_default();
        if found.is_empty() {
            repairs.decide(
                place,
                match (frame.people.is_empty(), options.person) {
                    (true, _) => "nobody is in a frame",
                    (false, Some(_)) => "there is no person of this number in a frame",
                    (false, None) => "the person who is followed is not among those in a frame",
                },
            );
        } else if found.len() != n {
            let wrong = unexpected(place, &format!("{} points", found.len()), format!("{n} points"));
            let wrong = text::in_frame(wrong, i, frame.name.as_deref());
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

/// Where frames stand in their sequence: at their numbers, or else one after another, with the reason where they have numbers or names.
fn positions(frames: &[Frame]) -> (Vec<f64>, Option<&'static str>) {
    let own: Option<Vec<f64>> = frames.iter().map(|frame| frame.number).collect();
    let names: Option<Vec<&str>> = frames.iter().map(|frame| frame.name.as_deref()).collect();
    let of_names = || numbers_in(names.as_deref()?);
    let reason = match own.or_else(of_names) {
        Some(numbers) => {
            let rise = numbers.windows(2).all(|pair| pair[1] > pair[0]);
            let span = numbers.last().zip(numbers.first()).map_or(0.0, |(last, first)| last - first);
            if rise && span <= 10.0 * frames.len() as f64 {
                return (numbers, None);
            }
            // identifiers of the pictures of a data set are not numbers of frames
            Some("numbers of pictures are no numbers of frames, which are counted")
        }
        None if names.is_some() => Some(
            "names of pictures differ in more than one number: frames are in the order of names, and are counted",
        ),
        None => None,
    };
    ((0..frames.len()).map(|i| i as f64).collect(), reason)
}

/// Times of the frames: those of their positions at the rate of the caller, or else the file's times, or positions at its rate.
fn times(
    frames: &[Frame],
    (positions, reason): (&[f64], Option<&'static str>),
    (given, declared): (Option<f64>, Option<f64>),
    repairs: &mut Repairs,
) -> Result<Vec<f64>, ReadError> {
    let head = Place::Line(1);
    let own: Vec<f64> = frames.iter().filter_map(|frame| frame.time).collect();
    let mut steps: Vec<f64> = own.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let has_times = own.len() == frames.len() && steps.iter().all(|step| *step > 0.0);
    if has_times && given.is_none() {
        steps.sort_by(f64::total_cmp);
        let step = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
        if step > LONGEST_STEP {
            let allowed = format!("times in s, at most {LONGEST_STEP} s apart; `rate` decides otherwise");
            return Err(unexpected(head, &format!("frames {step} s apart"), allowed));
        }
        return Ok(own);
    }
    if frames.len() == 1 {
        return Ok(vec![0.0]);
    }
    let Some(rate) = given.or(declared) else { return Err(ReadError::NoRate { format: FORMAT.name }) };
    if has_times {
        repairs.decide(head, "times of the file are not used, since `rate` is given");
    }
    if let Some(reason) = reason {
        repairs.decide(head, reason);
    }
    Ok(positions.iter().map(|position| (position - positions[0]) / rate).collect())
}
