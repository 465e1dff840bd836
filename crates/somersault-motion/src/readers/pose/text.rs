//! Text as JSON, and what is said where it is not what it should be.

use super::super::{Place, ReadError, Repairs, shorten, unexpected};
use serde_json::Value;

/// What a message says of a file that has no key points.
pub(super) const ALLOWED: &str = "key points of OpenPose, COCO, MMPose or MediaPipe";
/// Characters of what a message says of a value.
const LONGEST: usize = 160;

/// The value of a text, or a list of the values that stand one after another, as programs write them line by line.
pub(super) fn value(text: &str, repairs: &mut Repairs) -> Result<Value, ReadError> {
    let all = |text: &str| serde_json::Deserializer::from_str(text).into_iter().collect();
    let (mut values, refused): (Vec<Value>, _) = parsed(text, all)?;
    if let Some(error) = refused {
        repairs.instead_of(error, "values that are NaN or infinite are missing")?;
    }
    if values.len() > 1 {
        let error = unexpected(Place::Line(1), "values one after another", "one value");
        repairs.instead_of(error, "values one after another are read as a list")?;
        return Ok(Value::Array(values));
    }
    let nothing = || ReadError::Truncated { place: Place::Line(1), allowed: format!("{ALLOWED}, as JSON") };
    values.pop().ok_or_else(nothing)
}

/// What a text has; where that is JSON only once NaN and infinity, as Python writes them, are null, with the error instead of which
/// it is returned.
pub(super) fn parsed<T>(
    text: &str,
    parse: impl Fn(&str) -> Result<T, serde_json::Error>,
) -> Result<(T, Option<ReadError>), ReadError> {
    match parse(text) {
        Ok(found) => Ok((found, None)),
        Err(error) => match parse(&without_nan(text)) {
            Ok(found) => Ok((found, Some(fault(&error)))),
            Err(_) => Err(fault(&error)),
        },
    }
}

/// The text with null in the place of NaN and infinity.
fn without_nan(text: &str) -> String {
    // what is between quotes stays; a quote behind a backslash ends nothing
    let mut out = String::with_capacity(text.len());
    let (mut in_string, mut rest) = (false, text);
    while let Some(c) = rest.chars().next() {
        let word = ["NaN", "Infinity", "-Infinity"].into_iter().find(|word| rest.starts_with(word));
        let escaped = rest.strip_prefix('\\').filter(|_| in_string).and_then(|rest| rest.chars().next());
        let length = match (word.filter(|_| !in_string), escaped) {
            (Some(word), _) => word.len(),
            (None, Some(escaped)) => 1 + escaped.len_utf8(),
            (None, None) => c.len_utf8(),
        };
        in_string ^= c == '"';
        out.push_str(if word.is_some() && !in_string { "null" } else { &rest[..length] });
        rest = &rest[length..];
    }
    out
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

/// What a value is: its keys, or those of the first of a list.
fn described(value: &Value) -> String {
    match value {
        Value::Object(object) if object.is_empty() => "an empty object".to_owned(),
        Value::Object(object) => {
            let keys: Vec<&str> = object.keys().map(String::as_str).collect();
            format!("an object with {}", keys.join(", "))
        }
        Value::Array(all) => match all.iter().find(|one| !is_empty(one)) {
            Some(one) => format!("a list, in it {}", described(one)),
            None => "an empty list".to_owned(),
        },
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::String(_) => value.to_string(),
    }
}

/// The error of a value that is not allowed.
pub(super) fn unexpected_value(what: &str, value: &Value, allowed: impl Into<String>) -> ReadError {
    let found = shorten(&format!("{what}{}", described(value)), LONGEST);
    ReadError::Unexpected { place: Place::Line(1), found, allowed: allowed.into() }
}

/// The same error in the frame of this number, from 0, and of a file of a folder.
pub(super) fn in_frame(error: ReadError, frame: usize, file: Option<&str>) -> ReadError {
    match error {
        ReadError::Unexpected { found, allowed, .. } => {
            let allowed = match file {
                Some(file) => format!("{allowed}, in `{file}`"),
                None => allowed,
            };
            ReadError::Unexpected { place: Place::Line(frame + 1), found, allowed }
        }
        other => other,
    }
}

/// Whether there is nothing in a value.
pub(super) fn is_empty(value: &Value) -> bool {
    match value {
        Value::Null => true,
        Value::Array(all) => all.is_empty(),
        Value::Object(object) => object.is_empty(),
        Value::Bool(_) | Value::Number(_) | Value::String(_) => false,
    }
}
