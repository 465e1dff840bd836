//! Where the points are in a file, from header and parameters, which may contradict each other.
//!
//! Both declare the number of points, the analog values of a frame, the first block of data, the type of numbers and the
//! number of frames. Of all combinations of what they declare the one is used whose frames end where the file does: at its last
//! byte, or in its last block with one byte repeated behind them, as much of that as there is. Where there is
//! no such one, it is that whose frames end nearest to the end of the file; where two are equal, that of the parameters.

use super::parameters::{Parameters, Processor};
use super::{BLOCK, Contradiction, Decision};
use crate::readers::{Place, ReadError, unexpected};

/// Where points are in the file and how they are stored.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layout {
    pub(super) n_points: usize,
    pub(super) n_frames: usize,
    /// First byte of the first frame.
    pub(super) start: usize,
    /// Bytes of a frame, with its analog data.
    pub(super) stride: usize,
    /// Floats for 0 or less, else what integers are multiplied by.
    pub(super) scale: f64,
    pub(super) rate: f64,
    /// Time of the first frame, s.
    pub(super) first_time: f64,
    /// Analog values of a frame.
    pub(super) n_analog: usize,
    /// Where no first block of data is declared, which is that behind the parameters then.
    pub(super) undeclared_start: Option<Place>,
    /// Where more frames are declared than there are, and how many.
    pub(super) missing: Option<(Place, usize)>,
}

impl Layout {
    /// Bytes of the points of a frame.
    pub(super) fn points_width(&self) -> usize {
        self.n_points * if self.scale > 0.0 { 8 } else { 16 }
    }
}

/// The group and the parameter that hold the time of the first frame where its number cannot.
pub(crate) const FIRST_TIME: [&str; 2] = ["SOMERSAULT", "FIRST_TIME"];
/// What 16 bits cannot count is declared so.
const SATURATED: usize = 0xffff;
/// Single precision, relative.
const ROUNDING: f64 = 1e-6;

/// The words of the header, numbered from 1 as in the user guide.
struct Header<'a> {
    bytes: &'a [u8],
    processor: Processor,
}

impl Header<'_> {
    fn word(&self, k: usize) -> usize {
        usize::from(self.processor.u16([self.bytes[2 * k - 2], self.bytes[2 * k - 1]]))
    }

    fn float(&self, k: usize) -> f64 {
        let four = [0, 1, 2, 3].map(|i| self.bytes[2 * k - 2 + i]);
        f64::from(self.processor.f32(four))
    }
}

/// What is declared of one quantity, the parameters' first; what is not allowed counts as not declared.
struct Declared<T> {
    quantity: &'static str,
    place: Place,
    parameter: Option<T>,
    header: Option<T>,
}

impl<T: Copy + PartialEq> Declared<T> {
    fn candidates(&self) -> impl Iterator<Item = T> + Clone + use<T> {
        let header = self.header.filter(|_| self.parameter != self.header);
        self.parameter.into_iter().chain(header)
    }

    fn contradiction(&self, used: T, decided: Decision, number: impl Fn(T) -> f64) -> Option<Contradiction> {
        let (parameter, header) = (self.parameter?, self.header?);
        let [parameter, header, used] = [parameter, header, used].map(number);
        let (place, quantity) = (self.place, self.quantity);
        (parameter != header).then_some(Contradiction { place, quantity, parameter, header, used, decided })
    }
}

/// The layout, and what was contradictory.
pub(super) fn layout(
    file: &[u8],
    header: &[u8],
    parameters: &Parameters,
) -> Result<(Layout, Vec<Contradiction>), ReadError> {
    let header = Header { bytes: header, processor: parameters.processor };
    let number = |name: &str| parameters.number("POINT", name);
    let declared = |quantity, name: &str, word: usize, of_header: f64, allowed: fn(&f64) -> bool| Declared {
        quantity,
        place: number(name).map_or(Place::Byte(2 * word - 2), |(place, _)| place),
        parameter: number(name).map(|(_, x)| x).filter(allowed),
        header: Some(of_header).filter(allowed),
    };
    let positive = |x: &f64| *x > 0.0 && x.is_finite();
    let mut points = declared("points", "USED", 2, header.word(2) as f64, positive);
    let rates = declared("frames a second", "RATE", 11, header.float(11), positive);
    let scales = declared("scale", "SCALE", 7, header.float(7), |x| *x != 0.0 && x.is_finite());
    let mut blocks = declared("first block of data", "DATA_START", 9, header.word(9) as f64, positive);
    let refuse = |place, found: &str, allowed: &str| Err(unexpected(place, found, allowed));
    let Some(rate) = rates.candidates().next() else {
        let found = number("RATE").map_or(header.float(11), |(_, x)| x).to_string();
        return refuse(rates.place, &found, "a positive number of frames a second");
    };
    if scales.candidates().next().is_none() {
        let found = number("SCALE").map_or(header.float(7), |(_, x)| x).to_string();
        return refuse(scales.place, &found, "a scale other than 0");
    }
    let undeclared_start = blocks.candidates().next().is_none().then_some(blocks.place);
    if undeclared_start.is_some() {
        blocks.parameter = Some(parameters.next_block as f64);
    }
    let analog = analog(&header, parameters, rate);
    if points.candidates().next().is_none() {
        // a file may have analog channels alone
        if analog.candidates().all(|n| n == 0) {
            return refuse(points.place, "0 points", "at least one point or analog channel");
        }
        points.parameter = Some(0.0);
    }
    let frames = frames(&header, parameters);
    if frames.candidates().all(|n| n == 0) {
        return Err(ReadError::NoFrames { place: frames.place });
    }

    let mut best: Option<(Ending, Chosen)> = None;
    let mut first = None;
    for n_points in points.candidates() {
        for n_analog in analog.candidates() {
            for scale in scales.candidates() {
                for block in blocks.candidates() {
                    for n_frames in frames.candidates().filter(|n| *n > 0) {
                        let chosen = Chosen { n_points, n_analog, scale, block, n_frames };
                        first.get_or_insert(chosen);
                        let Some(ending) = chosen.ending(file) else { continue };
                        if best.as_ref().is_none_or(|(nearest, _)| ending < *nearest) {
                            best = Some((ending, chosen));
                        }
                    }
                }
            }
        }
    }
    let (chosen, missing) = match (best, first) {
        (Some((_, chosen)), _) => (chosen, None),
        // what is there of a file that was cut
        (None, Some(chosen)) if chosen.room_for(file.len()) > 0 => {
            let declared = chosen.n_frames;
            (Chosen { n_frames: chosen.room_for(file.len()), ..chosen }, Some((frames.place, declared)))
        }
        (None, chosen) => {
            let (place, quantity) = (frames.place, "frames");
            let declared = chosen.map_or(0, |c| c.n_frames as u64);
            return Err(ReadError::Misdeclared { place, quantity, declared, found: 0 });
        }
    };
    let numbers = first_frame(&header, parameters);
    let number = numbers.parameter.or(numbers.header).unwrap_or(1);
    let first_time = match first_time(parameters)? {
        Some(time) => time,
        None => number.saturating_sub(1) as f64 / rate,
    };
    // of two positive scales the length of the file says nothing, nor of two negative ones, which scale no point
    let same_sign = scales.candidates().all(|x| x.is_sign_positive() == chosen.scale.is_sign_positive());
    let of_scale = scales
        .contradiction(
            chosen.scale,
            if same_sign { Decision::Parameters } else { Decision::Length },
            std::convert::identity,
        )
        .filter(|c| c.used > 0.0 || !same_sign)
        .filter(differs);
    let contradictions = [
        points.contradiction(chosen.n_points, Decision::Length, std::convert::identity),
        analog.contradiction(chosen.n_analog, Decision::Length, |n| n as f64),
        of_scale,
        blocks.contradiction(chosen.block, Decision::Length, std::convert::identity),
        frames.contradiction(chosen.n_frames, Decision::Length, |n| n as f64).filter(|_| missing.is_none()),
        rates.contradiction(rate, Decision::Parameters, std::convert::identity).filter(differs),
        numbers.contradiction(number, Decision::Parameters, |n| n as f64),
    ];
    let layout = Layout {
        n_points: chosen.n_points as usize,
        n_frames: chosen.n_frames,
        start: chosen.start(),
        stride: chosen.stride(),
        scale: chosen.scale,
        rate,
        first_time,
        n_analog: chosen.n_analog,
        undeclared_start,
        missing,
    };
    Ok((layout, contradictions.into_iter().flatten().collect()))
}

/// By more than single precision.
fn differs(c: &Contradiction) -> bool {
    (c.header - c.parameter).abs() > ROUNDING * c.header.abs().max(c.parameter.abs())
}

/// Where frames end in a file, the best first.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Ending {
    /// At its end, or in its last block before so many blanks.
    Filled { blanks: std::cmp::Reverse<usize> },
    /// So many bytes from its end.
    Off { bytes: usize },
}

/// One of the combinations that are declared.
#[derive(Clone, Copy)]
struct Chosen {
    n_points: f64,
    n_analog: usize,
    scale: f64,
    block: f64,
    n_frames: usize,
}

impl Chosen {
    fn start(&self) -> usize {
        (self.block as usize - 1).saturating_mul(BLOCK)
    }

    /// Bytes of a number.
    fn width(&self) -> usize {
        if self.scale > 0.0 { 2 } else { 4 }
    }

    fn points(&self) -> usize {
        (self.n_points as usize).saturating_mul(4 * self.width())
    }

    fn stride(&self) -> usize {
        self.points().saturating_add(self.n_analog.saturating_mul(self.width()))
    }

    /// Frames that are there; the last may lack its analog data, but no point.
    fn room_for(&self, length: usize) -> usize {
        let room = length.saturating_sub(self.start());
        match self.points() {
            0 => room / self.stride().max(1),
            points if room < points => 0,
            points => (room - points) / self.stride() + 1,
        }
    }

    /// Where the frames end; none where some are missing.
    fn ending(&self, file: &[u8]) -> Option<Ending> {
        if self.room_for(file.len()) < self.n_frames {
            return None;
        }
        let end = self.start().saturating_add(self.stride().saturating_mul(self.n_frames));
        let rest = file.get(end..).filter(|rest| rest.len() < BLOCK);
        match rest.filter(|rest| rest.windows(2).all(|pair| pair[0] == pair[1])) {
            Some(blank) => Some(Ending::Filled { blanks: std::cmp::Reverse(blank.len()) }),
            None => Some(Ending::Off { bytes: file.len().abs_diff(end) }),
        }
    }
}

/// Analog values of a frame: those of the header, and channels times samples a frame of the parameters, where the rates
/// are in a whole ratio or the header has the samples.
fn analog(header: &Header, parameters: &Parameters, rate: f64) -> Declared<usize> {
    let used = parameters.number("ANALOG", "USED");
    let samples = match parameters.number("ANALOG", "RATE").map(|(_, analog)| analog / rate) {
        Some(ratio) if ratio >= 0.5 && (ratio - ratio.round()).abs() < ROUNDING * ratio => ratio.round(),
        _ => header.word(10) as f64,
    };
    // what the header has is 16 bits, and more is no frame
    let product = used.map(|(_, used)| used * samples).filter(|n| *n >= 0.0 && *n <= SATURATED as f64);
    Declared {
        quantity: "analog values a frame",
        place: used.map_or(Place::Byte(4), |(place, _)| place),
        parameter: product.map(|n| n as usize),
        header: Some(header.word(3)),
    }
}

/// The two words of a field of TRIAL.
fn field(parameters: &Parameters, name: &str) -> Option<(Place, usize)> {
    let (place, words) = parameters.words("TRIAL", name)?;
    let [low, high] = words[..] else { return None };
    Some((place, usize::from(low) | usize::from(high) << 16))
}

/// Whether a number of 16 bits is all that these can say of `whole`.
fn agrees(word: usize, whole: usize) -> bool {
    word == whole & SATURATED || word == SATURATED
}

/// The number of frames. The header and POINT:FRAMES have 16 bits, two words of TRIAL 32.
fn frames(header: &Header, parameters: &Parameters) -> Declared<usize> {
    let quantity = "frames";
    let (first, last) = (header.word(4), header.word(5));
    let of_header = (last + 1).saturating_sub(first);
    let point = parameters.number("POINT", "FRAMES").filter(|(_, n)| *n > 0.0);
    let trial = field(parameters, "ACTUAL_START_FIELD").zip(field(parameters, "ACTUAL_END_FIELD"));
    if let Some(((place, first), (_, end))) = trial {
        let whole = (end + 1).saturating_sub(first);
        let point = point.map(|(_, n)| n as usize).filter(|n| !agrees(*n, whole));
        let of_header = Some(of_header).filter(|n| *n > 0 && last != SATURATED && !agrees(*n, whole));
        return Declared { quantity, place, parameter: Some(whole), header: point.or(of_header) };
    }
    match point {
        Some((place, n)) => {
            let n = n as usize;
            let header = Some(of_header).filter(|n| *n > 0 && last != SATURATED);
            Declared { quantity, place, parameter: Some(n), header }
        }
        None => Declared { quantity, place: Place::Byte(6), parameter: None, header: Some(of_header) },
    }
}

/// The number of the first frame, from 1.
fn first_frame(header: &Header, parameters: &Parameters) -> Declared<usize> {
    let trial = field(parameters, "ACTUAL_START_FIELD");
    let place = trial.map_or(Place::Byte(6), |(place, _)| place);
    let (parameter, word) = (trial.map(|(_, first)| first), header.word(4));
    let header = Some(word).filter(|word| parameter.is_none_or(|whole| !agrees(*word, whole)));
    Declared { quantity: "number of the first frame", place, parameter, header }
}

/// The time of the first frame, if the file has it apart from its number.
fn first_time(parameters: &Parameters) -> Result<Option<f64>, ReadError> {
    let [group, name] = FIRST_TIME;
    let Some((place, text)) = parameters.text(group, name) else { return Ok(None) };
    crate::readers::number(place, &text, "the time of the first frame").map(Some)
}
