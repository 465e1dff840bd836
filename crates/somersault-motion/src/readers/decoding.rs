//! Bytes as text: UTF-8, UTF-16 and Latin-1, as spreadsheets and acquisition programs write them.

use super::{Place, ReadError, Repairs, text};
use std::borrow::Cow;

/// A word of two bytes.
type Word = fn([u8; 2]) -> u16;

/// The order of bytes of a text in UTF-16, and where it begins: known by a mark, or by zeros in every second byte.
fn utf_16(bytes: &[u8]) -> Option<(Word, usize)> {
    match bytes {
        [0xff, 0xfe, ..] => Some((u16::from_le_bytes, 2)),
        [0xfe, 0xff, ..] => Some((u16::from_be_bytes, 2)),
        [a, 0, b, 0, ..] if *a != 0 && *b != 0 => Some((u16::from_le_bytes, 0)),
        [0, a, 0, b, ..] if *a != 0 && *b != 0 => Some((u16::from_be_bytes, 0)),
        _ => None,
    }
}

/// The text of a file, in which lines end with a line feed. UTF-8 is read without a repair. UTF-16 is known by its byte
/// order mark or its zeros; whatever else is no UTF-8 is read as Latin-1, one character a byte.
pub(super) fn decoded<'a>(bytes: &'a [u8], repairs: &mut Repairs) -> Result<Cow<'a, str>, ReadError> {
    let place = Place::Byte(0);
    if let Some((word, start)) = utf_16(bytes) {
        repairs.instead_of(ReadError::Encoding { place }, "the text is UTF-16 and not UTF-8")?;
        let words = bytes[start..].chunks_exact(2).map(|pair| word([pair[0], pair[1]]));
        let text = char::decode_utf16(words).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
        return Ok(Cow::Owned(lines_of(text)));
    }
    match text(bytes) {
        Ok(text) if !text.contains('\n') && text.contains('\r') => Ok(Cow::Owned(text.replace('\r', "\n"))),
        Ok(text) => Ok(Cow::Borrowed(text)),
        Err(error) => {
            repairs.instead_of(error, "the text is not UTF-8 and is read as Latin-1")?;
            Ok(Cow::Owned(lines_of(bytes.iter().map(|&b| char::from(b)).collect())))
        }
    }
}

/// The beginning of a file as text, by which its format is known; empty where there are control characters of no text.
pub(super) fn beginning(bytes: &[u8]) -> String {
    const ENOUGH: usize = 1 << 16;
    let head = &bytes[..bytes.len().min(ENOUGH)];
    let text = match decoded(head, &mut Repairs::allowed()) {
        Ok(text) => text.into_owned(),
        Err(_) => String::new(),
    };
    let binary = |c: char| c.is_control() && !c.is_whitespace();
    if text.chars().take(256).any(binary) { String::new() } else { text.trim_start().to_owned() }
}

/// Old files end lines with a carriage return alone.
fn lines_of(text: String) -> String {
    if !text.contains('\n') && text.contains('\r') { text.replace('\r', "\n") } else { text }
}
