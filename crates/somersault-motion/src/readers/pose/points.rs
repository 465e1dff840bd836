//! The points of a person, in the ways in which programs write them.

use super::super::{Place, ReadError, unexpected};
use super::models::is_of_a_model;
use super::text::unexpected_value;
use serde_json::{Map, Value};
use std::collections::{HashMap, HashSet};

/// Points that a person may have, more than any model has.
const MOST_POINTS: usize = 2048;

/// A point: its coordinates, how many of them there are, and its weight.
pub(super) type Point = ([f64; 3], usize, f64);

/// Which point is which, where a person's points say so.
#[derive(PartialEq)]
enum Labels {
    /// By their order.
    Order,
    /// By their numbers in the model.
    Numbers(Vec<usize>),
    Names(Vec<String>),
}

/// The points of a person.
pub(super) struct Person {
    pub(super) points: Vec<Point>,
    labels: Labels,
    /// Whether a weight is the last of the numbers of its point.
    pub(super) is_weight_last: bool,
    /// The number that a tracker gave the person.
    pub(super) track: Option<u64>,
}

/// The first of these entries that an object has.
pub(super) fn entry<'v>(object: &'v Map<String, Value>, keys: &[&str]) -> Option<&'v Value> {
    keys.iter().find_map(|key| object.get(*key))
}

/// The entry of a point, in lower case or as a name: `x`, `X`, `Visibility`.
fn part<'v>(point: &'v Map<String, Value>, keys: &[&str]) -> Option<&'v Value> {
    let of = |key: &str| point.iter().find(|(k, _)| k.eq_ignore_ascii_case(key)).map(|(_, value)| value);
    keys.iter().find_map(|key| of(key))
}

/// Whether a value is a point: an object with x and y and no lists, or a list of two to four numbers.
pub(super) fn is_point(value: &Value) -> bool {
    match value {
        Value::Object(point) => {
            let is_plain = |value: &Value| !value.is_array() && !value.is_object();
            ["x", "y"].iter().all(|key| part(point, &[*key]).is_some()) && point.values().all(is_plain)
        }
        Value::Array(point) => (2..=4).contains(&point.len()) && point.iter().all(Value::is_number),
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => false,
    }
}

/// Whether a list is one of points, or of their numbers; any but the first that is there may be missing.
pub(super) fn is_points(all: &[Value]) -> bool {
    all.iter().find(|value| !value.is_null()).is_some_and(|first| first.is_number() || is_point(first))
}

/// Whether an object has points, under their numbers or under names of which one is that of a model.
pub(super) fn is_body(object: &Map<String, Value>) -> bool {
    let numbered = || object.keys().all(|key| key.parse::<usize>().is_ok());
    let named = || object.keys().any(|key| is_of_a_model(key));
    object.len() > 1 && object.values().all(is_point) && (numbered() || named())
}

/// The points of a person; of flat lists with `stride` numbers for each, of which the last is a confidence.
pub(super) fn points(
    value: &Value,
    scores: Option<&Vec<Value>>,
    stride: Option<usize>,
) -> Result<Option<Person>, ReadError> {
    let all: Vec<&Value> = match value {
        Value::Array(all) => all.iter().collect(),
        Value::Object(all) => all.values().collect(),
        _ => return Ok(None),
    };
    let score = |k: usize| scores.and_then(|scores| scores.get(k)).map(real);
    let mut points: Vec<Point> = Vec::new();
    let mut is_weight_last = false;
    if all.iter().find(|value| !value.is_null()).is_some_and(|first| first.is_number()) {
        let stride = stride.unwrap_or(3);
        if !all.len().is_multiple_of(stride) {
            let allowed = format!("a multiple of {stride} numbers");
            return Err(unexpected(Place::Line(1), &format!("{} numbers", all.len()), allowed));
        }
        if let Some(other) = all.iter().find(|value| !value.is_number() && !value.is_null()) {
            return Err(unexpected_value("", other, "a number or null"));
        }
        for (k, row) in all.chunks_exact(stride).enumerate() {
            let mut x = [0.0; 3];
            x.iter_mut().zip(&row[..stride - 1]).for_each(|(x, value)| *x = real(value));
            is_weight_last |= score(k).is_none();
            points.push((x, stride - 1, score(k).unwrap_or(real(row[stride - 1]))));
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
                    is_weight_last |= own.is_some() && score(k).is_none();
                    points.push((x, n_dims, score(k).or(own).unwrap_or(1.0)));
                }
                Value::Object(row) if is_point(value) => {
                    let z = part(row, &["z"]).map(real);
                    let x = ["x", "y"].map(|key| part(row, &[key]).map_or(f64::NAN, real));
                    let weight = part(row, &["visibility", "score", "confidence", "presence", "likelihood"]);
                    let weight = score(k).or(weight.map(real)).unwrap_or(1.0);
                    points.push(([x[0], x[1], z.unwrap_or(0.0)], 2 + usize::from(z.is_some()), weight));
                }
                Value::Null => points.push(([0.0; 3], 2, 0.0)),
                other => return Err(unexpected_value("", other, "a point: x, y, z and a confidence")),
            }
        }
    }
    if points.len() > MOST_POINTS {
        let found = points.len().to_string();
        return Err(unexpected(Place::Line(1), &found, "at most 2048 points of a person"));
    }
    // negative confidences of points that were not found
    points.iter_mut().for_each(|point| point.2 = point.2.max(0.0));
    let labels = labels(value, &all);
    Ok((!points.is_empty()).then_some(Person { points, labels, is_weight_last, track: None }))
}

/// A number, or NaN.
fn real(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// Names of points, or else their numbers: the keys of an object, or what each point of a list has.
fn labels(value: &Value, all: &[&Value]) -> Labels {
    let number = |number: u64| usize::try_from(number).ok().filter(|number| *number < MOST_POINTS);
    let of = |keys: &[&str]| -> Option<Vec<&Value>> {
        all.iter().map(|point| part(point.as_object()?, keys)).collect()
    };
    let (names, numbers): (Option<Vec<String>>, Option<Vec<usize>>) = match value {
        Value::Object(object) => (
            Some(object.keys().cloned().collect()),
            object.keys().map(|key| number(key.parse().ok()?)).collect(),
        ),
        _ => (
            of(&["name", "part"])
                .and_then(|names| names.iter().map(|name| Some(name.as_str()?.to_owned())).collect()),
            of(&["id", "index"])
                .and_then(|numbers| numbers.iter().map(|value| number(value.as_u64()?)).collect()),
        ),
    };
    let numbers = numbers.filter(|numbers| numbers.iter().collect::<HashSet<_>>().len() == numbers.len());
    match (names, numbers) {
        (Some(_), Some(numbers)) if value.is_object() => Labels::Numbers(numbers),
        (Some(names), _) if !names.is_empty() => Labels::Names(names),
        (_, Some(numbers)) if !numbers.is_empty() => Labels::Numbers(numbers),
        _ => Labels::Order,
    }
}

/// Brings the points of all persons into one order, and returns the names that they have. There are `most` numbers at most to hold
/// them, so that a few high numbers of points make no large recording.
pub(super) fn align(people: &mut [&mut Person], most: usize) -> Result<Option<Vec<String>>, ReadError> {
    let Some((first, others)) = people.split_first() else { return Ok(None) };
    if others.iter().all(|person| person.labels == first.labels) {
        match &first.labels {
            Labels::Order => return Ok(None),
            Labels::Names(names) => return Ok(Some(names.clone())),
            Labels::Numbers(_) => {}
        }
    }
    let mut columns: HashMap<&str, usize> = HashMap::new();
    let mut names: Vec<String> = Vec::new();
    let mut slots: Vec<Vec<usize>> = Vec::with_capacity(people.len());
    let (mut least, mut greatest, mut n_named) = (usize::MAX, 0, 0);
    for person in people.iter() {
        match &person.labels {
            Labels::Numbers(numbers) => {
                least = numbers.iter().copied().fold(least, usize::min);
                greatest = numbers.iter().copied().fold(greatest, usize::max);
                slots.push(numbers.clone());
            }
            Labels::Names(own) => {
                n_named += 1;
                let mut slot = Vec::with_capacity(own.len());
                for name in own {
                    let column = *columns.entry(name).or_insert(names.len());
                    if column == names.len() {
                        names.push(name.clone());
                    }
                    slot.push(column);
                }
                if slot.iter().collect::<HashSet<_>>().len() < slot.len() {
                    return Err(unexpected(Place::Line(1), "points of the same name", "names that differ"));
                }
                slots.push(slot);
            }
            Labels::Order => slots.push(Vec::new()),
        }
    }
    let n_unlabelled = people.iter().filter(|person| person.labels == Labels::Order).count();
    if n_unlabelled > 0 || n_named != 0 && n_named != people.len() {
        let allowed = "points of which all have a name, or all a number";
        return Err(unexpected(Place::Line(1), "points with and without a name or a number", allowed));
    }
    // a model has a point 0: numbers that begin later are names
    let has_names = n_named > 0 || least > 0;
    if n_named == 0 && least > 0 {
        names = (least..=greatest).map(|number| format!("point {number}")).collect();
        slots.iter_mut().flatten().for_each(|slot| *slot -= least);
    }
    let n = if has_names { names.len() } else { greatest + 1 };
    if n > MOST_POINTS || n.saturating_mul(people.len()) > most {
        return Err(unexpected(Place::Line(1), &format!("{n} points"), "as many points of each person"));
    }
    for (person, slots) in people.iter_mut().zip(slots) {
        let mut points = vec![([0.0; 3], 2, 0.0); n];
        for (slot, point) in slots.into_iter().zip(&person.points) {
            points[slot] = *point;
        }
        person.points = points;
    }
    Ok(has_names.then_some(names))
}
