//! The parameter section: groups, and in them named arrays of numbers or text.

use super::{BLOCK, bytes};
use crate::readers::{Place, ReadError, unexpected};
use std::collections::HashMap;

/// Whose numbers they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Processor {
    /// Little endian, IEEE.
    Intel,
    /// Little endian words, floats of the VAX.
    Dec,
    /// Big endian, IEEE.
    Mips,
}

impl Processor {
    fn from_code(code: u8, place: Place) -> Result<Self, ReadError> {
        match code {
            84 => Ok(Self::Intel),
            85 => Ok(Self::Dec),
            86 => Ok(Self::Mips),
            _ => Err(unexpected(place, &code.to_string(), "processor 84 (Intel), 85 (DEC) or 86 (MIPS)")),
        }
    }

    pub(super) fn u16(self, bytes: [u8; 2]) -> u16 {
        match self {
            Self::Intel | Self::Dec => u16::from_le_bytes(bytes),
            Self::Mips => u16::from_be_bytes(bytes),
        }
    }

    pub(super) fn i16(self, bytes: [u8; 2]) -> i16 {
        self.u16(bytes) as i16
    }

    pub(super) fn f32(self, [a, b, c, d]: [u8; 4]) -> f32 {
        match self {
            Self::Intel => f32::from_le_bytes([a, b, c, d]),
            Self::Mips => f32::from_be_bytes([a, b, c, d]),
            // the upper word comes first, and the exponent is larger by two: a quarter of the IEEE number
            Self::Dec => f32::from_le_bytes([c, d, a, b]) / 4.0,
        }
    }
}

/// An array in the file.
struct Parameter<'a> {
    /// Where its data begins.
    place: Place,
    /// −1 text, 1 bytes, 2 words, 4 floats.
    kind: i8,
    dimensions: &'a [u8],
    data: &'a [u8],
}

/// All parameters by the names of group and parameter, in upper case.
pub(super) struct Parameters<'a> {
    pub(super) processor: Processor,
    /// The block behind the section, from 1.
    pub(super) next_block: usize,
    arrays: HashMap<(String, String), Parameter<'a>>,
}

impl<'a> Parameters<'a> {
    /// The section that begins with block number `first`, from 1, of a file that has a header.
    pub(super) fn read(file: &'a [u8], first: u8) -> Result<Self, ReadError> {
        if first == 0 {
            return Err(unexpected(Place::Byte(0), "0", "the number of a block, from 1"));
        }
        let start = (usize::from(first) - 1) * BLOCK;
        let head = bytes(file, start, 4, "the head of the parameters")?;
        let processor = Processor::from_code(head[3], Place::Byte(start + 3))?;
        // nothing that begins among the data is a parameter: some files end their list with a distance to nowhere
        let data = usize::from(processor.u16([file[16], file[17]])).saturating_sub(1) * BLOCK;
        let end = if data > start { data } else { file.len() };
        let mut groups: HashMap<i8, String> = HashMap::new();
        let mut found: Vec<(i8, String, Parameter)> = Vec::new();
        let mut at = start + 4;
        // each round continues by at least the five bytes it reads
        loop {
            let lengths = bytes(file, at, 2, "a parameter")?;
            let (length, id) = (usize::from((lengths[0] as i8).unsigned_abs()), lengths[1] as i8);
            if length == 0 || id == 0 {
                break;
            }
            let name = latin(bytes(file, at + 2, length, "the name of a parameter")?).to_ascii_uppercase();
            let link = at + 2 + length;
            let offset = bytes(file, link, 2, "the place of the next parameter")?;
            let offset = usize::from(processor.u16([offset[0], offset[1]]));
            if id < 0 {
                groups.insert(id, name);
            } else {
                found.push((-id, name, parameter(file, link + 2)?));
            }
            if offset == 0 {
                break;
            }
            if offset < 2 {
                let allowed = "0 or the distance to the next parameter, at least 2";
                return Err(unexpected(Place::Byte(link), &offset.to_string(), allowed));
            }
            at = link + offset;
            if at >= end {
                break;
            }
        }
        // parameters may come before their group
        let named = found
            .into_iter()
            .filter_map(|(group, name, parameter)| Some(((groups.get(&group)?.clone(), name), parameter)));
        let counted = usize::from(head[2]);
        let n_blocks = if counted > 0 { counted } else { (at - start).div_ceil(BLOCK).max(1) };
        Ok(Self { processor, next_block: usize::from(first) + n_blocks, arrays: named.collect() })
    }

    fn get(&self, group: &str, name: &str) -> Option<&Parameter<'a>> {
        self.arrays.get(&(group.to_owned(), name.to_owned()))
    }

    /// A single number; words count without sign, since counts use all their bits.
    pub(super) fn number(&self, group: &str, name: &str) -> Option<(Place, f64)> {
        let parameter = self.get(group, name)?;
        let number = match (parameter.kind, parameter.data) {
            (2, [a, b, ..]) => f64::from(self.processor.u16([*a, *b])),
            (4, [a, b, c, d, ..]) => f64::from(self.processor.f32([*a, *b, *c, *d])),
            (1, [a, ..]) => f64::from(*a),
            _ => return None,
        };
        Some((parameter.place, number))
    }

    /// All numbers of an array; 16-bit words are unsigned if `is_unsigned`.
    pub(super) fn numbers(&self, group: &str, name: &str, is_unsigned: bool) -> Vec<f64> {
        let Some(parameter) = self.get(group, name) else { return Vec::new() };
        let word = |w: &[u8]| match is_unsigned {
            true => f64::from(self.processor.u16([w[0], w[1]])),
            false => f64::from(self.processor.i16([w[0], w[1]])),
        };
        match parameter.kind {
            1 => parameter.data.iter().map(|&b| f64::from(b)).collect(),
            2 => parameter.data.chunks_exact(2).map(word).collect(),
            4 => parameter
                .data
                .chunks_exact(4)
                .map(|w| f64::from(self.processor.f32([w[0], w[1], w[2], w[3]])))
                .collect(),
            _ => Vec::new(),
        }
    }

    /// The lengths of an array in each direction, the quickest first.
    pub(super) fn dimensions(&self, group: &str, name: &str) -> Vec<usize> {
        let found = self.get(group, name).map(|parameter| parameter.dimensions).unwrap_or_default();
        found.iter().map(|&d| usize::from(d)).collect()
    }

    /// The strings of an array and of its continuations, NAME2, NAME3, …; at most so many.
    pub(super) fn many_texts(&self, group: &str, name: &str, at_most: usize) -> Vec<String> {
        let mut texts = self.texts(group, name, at_most);
        for k in 2.. {
            let more = self.texts(group, &format!("{name}{k}"), at_most - texts.len());
            if more.is_empty() {
                break;
            }
            texts.extend(more);
        }
        texts
    }

    /// All words of an array.
    pub(super) fn words(&self, group: &str, name: &str) -> Option<(Place, Vec<u16>)> {
        let parameter = self.get(group, name).filter(|p| p.kind == 2)?;
        let words = parameter.data.chunks_exact(2).map(|w| self.processor.u16([w[0], w[1]]));
        Some((parameter.place, words.collect()))
    }

    /// Text as one string, without the blanks around it.
    pub(super) fn text(&self, group: &str, name: &str) -> Option<(Place, String)> {
        let parameter = self.get(group, name).filter(|p| p.kind == -1)?;
        // an array of strings is its first one
        let length = parameter.dimensions.first().map_or(1, |d| usize::from(*d));
        let text = parameter.data.get(..length.min(parameter.data.len())).unwrap_or_default();
        Some((parameter.place, latin(text)))
    }

    /// The first strings of an array, without the blanks around them. Arrays of a hostile file may overlap: without
    /// a bound they would add up to more than the file.
    pub(super) fn texts(&self, group: &str, name: &str, at_most: usize) -> Vec<String> {
        let Some(parameter) = self.get(group, name).filter(|p| p.kind == -1) else { return Vec::new() };
        let length = parameter.dimensions.first().map_or(1, |d| usize::from(*d));
        if length == 0 {
            return Vec::new();
        }
        parameter.data.chunks(length).take(at_most).map(latin).collect()
    }
}

/// The array whose type stands at byte `at`.
fn parameter(file: &[u8], at: usize) -> Result<Parameter<'_>, ReadError> {
    let head = bytes(file, at, 2, "the type of a parameter")?;
    let kind = head[0] as i8;
    if ![-1, 1, 2, 4].contains(&kind) {
        return Err(unexpected(Place::Byte(at), &kind.to_string(), "type −1, 1, 2 or 4"));
    }
    let n_dimensions = usize::from(head[1]);
    if n_dimensions > 7 {
        return Err(unexpected(Place::Byte(at + 1), &n_dimensions.to_string(), "at most 7 dimensions"));
    }
    let dimensions = bytes(file, at + 2, n_dimensions, "the dimensions of a parameter")?;
    let size = dimensions.iter().fold(usize::from(kind.unsigned_abs()), |n, d| n.saturating_mul((*d).into()));
    let start = at + 2 + n_dimensions;
    let data = bytes(file, start, size, "the data of a parameter")?;
    Ok(Parameter { place: Place::Byte(start), kind, dimensions, data })
}

/// Text of one byte a character, without what surrounds it.
fn latin(text: &[u8]) -> String {
    let text: String = text.iter().map(|&b| char::from(b)).collect();
    text.trim_matches(|c: char| c.is_whitespace() || c == '\0').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_three_processors() {
        // 1.0 and −2.5 on a VAX: 0x4080 and 0xc120 in the first word (VAX architecture reference manual, F_floating)
        assert_eq!(Processor::Dec.f32([0x80, 0x40, 0, 0]), 1.0);
        assert_eq!(Processor::Dec.f32([0x20, 0xc1, 0, 0]), -2.5);
        assert_eq!(Processor::Intel.f32([0, 0, 0x80, 0x3f]), 1.0);
        assert_eq!(Processor::Mips.f32([0x3f, 0x80, 0, 0]), 1.0);
        assert_eq!(Processor::Mips.i16([0xff, 0xfe]), -2);
        assert_eq!(Processor::Dec.u16([1, 2]), 0x0201);
    }
}
