//! The flight of a record, and what is doubtful in it.

use super::PhaseError;
use super::moment::{End, Moment, REACH};
use super::record::{LEAST_FRAMES, Record};
use super::spread::{noise_of, weighed};
use super::stretch::{Stretch, best, curvature, settled};
use crate::noise::MarkerNoise;
use serde::{Deserialize, Serialize};
use somersault_core::argument::expect_positive;
use std::fmt;
use std::ops::Range;

/// A number with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WithInterval {
    /// The number.
    pub value: f64,
    /// Where the interval begins.
    pub lower: f64,
    /// Where it ends.
    pub upper: f64,
}

/// Standard deviations to either side that hold 95 % of a normal number.
const SIDE: f64 = 1.959_963_984_540_054;

impl WithInterval {
    /// A normal number.
    pub fn normal(value: f64, deviation: f64) -> Self {
        Self { value, lower: value - SIDE * deviation, upper: value + SIDE * deviation }
    }

    /// A number that does not exist.
    pub fn none() -> Self {
        Self { value: f64::NAN, lower: f64::NAN, upper: f64::NAN }
    }
}

/// How the search for a flight ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum PhaseStatus {
    /// One flight, whose curvature is that of gravity, with take-off and entry within the record.
    Found,
    /// A flight of which something is doubtful.
    Uncertain,
    /// A stretch keeps to a parabola, but not to that of gravity.
    OtherGravity,
    /// No stretch can be told from rest, or from a push.
    NotFound,
}

impl PhaseStatus {
    /// All there are, and their names.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::Found, "found"),
        (Self::Uncertain, "uncertain"),
        (Self::OtherGravity, "other_gravity"),
        (Self::NotFound, "not_found"),
    ];
}

/// What is doubtful in a flight.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum PhaseDoubt {
    /// The first frame may be in flight.
    BeginsInFlight,
    /// The last frame may be.
    EndsInFlight,
    /// There is another flight, s.
    OtherFlight {
        /// Its beginning.
        start: f64,
        /// Its end.
        end: f64,
    },
    /// Frames are missing near the take-off or the entry, s.
    Gap {
        /// From here.
        start: f64,
        /// To here.
        end: f64,
    },
    /// The curvature within the flight, m/s², is not that of gravity, though no other parabola fits longer.
    Curvature {
        /// The curvature.
        found: f64,
    },
    /// The interval of the take-off or the entry is longer than 0.2 s: the noise is too large.
    Wide {
        /// Its length, s.
        width: f64,
    },
}

impl fmt::Display for PhaseDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BeginsInFlight => write!(f, "the record may begin in flight"),
            Self::EndsInFlight => write!(f, "the record may end in flight"),
            Self::OtherFlight { start, end } => {
                write!(f, "there is another flight, from {start:.2} to {end:.2} s")
            }
            Self::Gap { start, end } => {
                write!(
                    f,
                    "no heights are known from {start:.2} to {end:.2} s, where the flight begins or ends"
                )
            }
            Self::Curvature { found } => {
                write!(
                    f,
                    "heights fall with {found:.2} m/s², and not with gravity: noise, rate or unit are other than they seem"
                )
            }
            Self::Wide { width } => {
                write!(f, "the noise is so large that the flight begins or ends within {width:.2} s")
            }
        }
    }
}

/// When a body flies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlightPhase {
    /// Whether it was found.
    pub status: PhaseStatus,
    /// s; NaN where no flight was found. Where the record may begin in flight the interval has no beginning.
    pub take_off: WithInterval,
    /// s; where the record may end in flight the interval has no end.
    pub entry: WithInterval,
    /// Of the flight, s.
    pub duration: WithInterval,
    /// Curvature of the heights within the flight, downwards, m/s²: that of gravity where rate and unit are right.
    pub gravity: WithInterval,
    /// Gravity as it was given, m/s².
    pub given_gravity: f64,
    /// The noise of the heights.
    pub noise: MarkerNoise,
    /// What is doubtful.
    pub doubts: Vec<PhaseDoubt>,
}

/// What a parabola that is free must fit better by, in squares of standard deviations, to be looked at.
const MARGIN: f64 = 12.0;
/// Standard deviations, and fraction of gravity, by which a curvature is not that of gravity.
const OTHER: (f64, f64) = (5.0, 0.04);
/// And fraction of gravity by which a stretch that keeps to it as well as noise lets it is no flight.
const PUSH: f64 = 0.5;
/// Fraction of gravity that the deviation of the curvature must not exceed.
const TOLD: f64 = 0.2;
/// Of the score of a flight, at which there are two.
const SECOND: f64 = 0.5;
/// How much of either end of a stretch is left out where noise is estimated: s, and fraction of it.
const TRIMMED: (f64, f64) = (0.1, 0.15);
/// Rounds in which take-off and entry are sought in turn.
const ROUNDS: usize = 3;
/// How far beyond the stretch they are sought at most, but for a step, s.
const FARTHEST: f64 = 0.6;
/// Chance of take-off or entry at the edge of the interval that was searched, from which on they count as not located.
const NOT_LOCATED: f64 = 0.025;
/// The longest interval, and the longest gap, that are not doubtful, s.
const WIDE: f64 = 0.2;
const GAP: f64 = 0.06;
/// Chance of a moment outside of the record from which on the record may begin or end in flight: that of an outlier of six standard
/// deviations in the first frame. Rest, a push or water leave much less of it.
const OUTSIDE: f64 = 1e-8;

/// Take-off and entry of a body whose centre of mass is at these heights, m, at these times, s, where gravity is as given, m/s².
///
/// ```
/// use somersault_motion::phases::{PhaseStatus, find_flight};
///
/// // at rest, a push of 0.3 s, a flight of 1 s, and water that stops the body; rounded to 5 mm
/// let height = |t: f64| match t {
///     t if t < 0.5 => 0.0,
///     t if t < 0.8 => 0.5 * 16.35 * (t - 0.5).powi(2),
///     t if t < 1.8 => 0.736 + 4.905 * (t - 0.8) - 4.905 * (t - 0.8).powi(2),
///     t => 0.736 - 4.905 * (t - 1.8) + 12.0 * (t - 1.8).powi(2),
/// };
/// let times: Vec<f64> = (0..200).map(|i| 0.01 * f64::from(i)).collect();
/// let heights: Vec<_> = times.iter().map(|t| Some((height(*t) * 200.0).round() / 200.0)).collect();
/// let flight = find_flight(&times, &heights, 9.81)?;
/// assert_eq!(flight.status, PhaseStatus::Found);
/// assert!((flight.take_off.value - 0.8).abs() < 0.02 && (flight.entry.value - 1.8).abs() < 0.02);
/// # Ok::<(), somersault_motion::phases::PhaseError>(())
/// ```
pub fn find_flight(times: &[f64], heights: &[Option<f64>], gravity: f64) -> Result<FlightPhase, PhaseError> {
    expect_positive("gravity", gravity)?;
    let record = Record::try_new(times, heights)?;
    let Some(Candidate { mut stretch, size, curve }) = candidate(&record, gravity) else {
        return Ok(FlightPhase::not_found(gravity));
    };
    let Some(([take_off, entry], noise)) = moments(&record, &mut stretch, curve) else {
        return Ok(FlightPhase::not_found(gravity));
    };
    let inside = trimmed(&record, &stretch.frames);
    let own = curvature(&weighed(&record, inside, &noise).0);
    let [own, deviation] = own.unwrap_or([f64::NAN; 2]);
    let is_told = deviation <= TOLD * curve;
    let is_other = is_another(own, deviation, gravity);
    let mut phase = FlightPhase {
        gravity: WithInterval::normal(own, deviation),
        noise,
        ..FlightPhase::not_found(gravity)
    };
    let is_push = is_other && curve == gravity && (own - gravity).abs() > PUSH * gravity;
    if !is_told || is_push {
        return Ok(phase);
    }
    if is_other && curve == gravity {
        phase.doubts.push(PhaseDoubt::Curvature { found: own });
    }
    phase.take_off = at(&record, &take_off);
    phase.entry = at(&record, &entry);
    if take_off.outside > OUTSIDE {
        phase.take_off.lower = f64::NEG_INFINITY;
        phase.take_off.value = phase.take_off.value.max(record.origin + record.times[0]);
        phase.doubts.push(PhaseDoubt::BeginsInFlight);
    }
    if entry.outside > OUTSIDE {
        phase.entry.upper = f64::INFINITY;
        phase.entry.value = phase.entry.value.min(record.origin + record.times[record.times.len() - 1]);
        phase.doubts.push(PhaseDoubt::EndsInFlight);
    }
    let deviation = take_off.deviation.hypot(entry.deviation);
    phase.duration = WithInterval::normal(phase.entry.value - phase.take_off.value, deviation);
    if take_off.outside.max(entry.outside) > OUTSIDE {
        phase.duration.upper = f64::INFINITY;
    }
    phase.doubts.extend(doubts(&record, &stretch, size, curve, [&take_off, &entry]));
    phase.status = match phase.doubts.is_empty() {
        _ if is_other && curve != gravity => PhaseStatus::OtherGravity,
        true => PhaseStatus::Found,
        false => PhaseStatus::Uncertain,
    };
    Ok(phase)
}

/// Take-off and entry of a flight to which a stretch belongs, and its noise. Slow noise may end a stretch within the flight: then the
/// stretch becomes longer, and tells more of the noise.
fn moments(record: &Record, stretch: &mut Stretch, curve: f64) -> Option<([Moment; 2], MarkerNoise)> {
    let [first, last] = [stretch.frames.start, stretch.frames.end - 1].map(|i| record.times[i]);
    let frames_of = |start: f64, end: f64| {
        record.times.partition_point(|t| *t < start)..record.times.partition_point(|t| *t <= end)
    };
    let mut noise = noise_of(record, trimmed(record, &stretch.frames), curve);
    let mut found = [first, last].map(|mean| Moment {
        mean,
        deviation: 0.5 * TRIMMED.0,
        bounds: [mean; 2],
        at_edge: 0.0,
        outside: 0.0,
    });
    let mut ends = [(End::TakeOff, first), (End::Entry, last)];
    for _ in 0..ROUNDS {
        let mut is_longer = false;
        for (k, (end, near)) in ends.iter_mut().enumerate() {
            let margin = 1.5 * found[1 - k].deviation;
            let mut reach = REACH;
            loop {
                let (frames, is_whole) = match end {
                    End::TakeOff => {
                        let frames = frames_of(*near - reach, found[1].mean - margin);
                        (frames.clone(), frames.start == 0)
                    }
                    End::Entry => {
                        let frames = frames_of(found[0].mean + margin, *near + reach);
                        (frames.clone(), frames.end == record.times.len())
                    }
                };
                found[k] = Moment::sought(record, frames, *end, (*near, reach), curve, &noise)?;
                if found[k].at_edge <= OUTSIDE || is_whole || reach > FARTHEST {
                    break;
                }
                reach += REACH;
            }
            if reach > REACH {
                is_longer = true;
                *near = found[k].mean;
            }
        }
        let frames = frames_of(found[0].mean, found[1].mean);
        if is_longer && frames.len() >= LEAST_FRAMES {
            stretch.frames = frames;
            noise = noise_of(record, trimmed(record, &stretch.frames), curve);
        }
    }
    Some((found, noise))
}

/// A stretch, the size of its residuals, and the curvature that it has.
struct Candidate {
    stretch: Stretch,
    size: f64,
    curve: f64,
}

/// The stretch of gravity, or that of another curvature where it keeps to a parabola for clearly longer.
fn candidate(record: &Record, gravity: f64) -> Option<Candidate> {
    let known = settled(record, Some(gravity)).filter(|(stretch, _)| stretch.score > 0.0);
    let free = match &known {
        Some((stretch, size)) => best(record, 0..record.times.len(), None, *size)
            .filter(|free| free.score > stretch.score + MARGIN)
            .map(|free| (free, *size)),
        None => settled(record, None).filter(|(stretch, _)| stretch.score > 0.0),
    };
    if let Some((stretch, size)) = free {
        let frames = trimmed(record, &stretch.frames);
        let noise = noise_of(record, frames.clone(), stretch.gravity);
        if let Some([own, deviation]) = curvature(&weighed(record, frames, &noise).0)
            && own > 0.0
            && is_another(own, deviation, gravity)
        {
            return Some(Candidate { stretch, size, curve: own });
        }
    }
    known.map(|(stretch, size)| Candidate { stretch, size, curve: gravity })
}

fn is_another(own: f64, deviation: f64, gravity: f64) -> bool {
    (own - gravity).abs() > (OTHER.0 * deviation).max(OTHER.1 * gravity)
}

/// Frames of a stretch that are surely in flight.
fn trimmed(record: &Record, frames: &Range<usize>) -> Range<usize> {
    let (start, end) = (record.times[frames.start], record.times[frames.end - 1]);
    let trim = TRIMMED.0.min(TRIMMED.1 * (end - start));
    let first = record.times.partition_point(|t| *t < start + trim);
    let last = record.times.partition_point(|t| *t <= end - trim);
    if last >= first + LEAST_FRAMES / 2 { first..last } else { frames.clone() }
}

/// In the time of the record.
fn at(record: &Record, moment: &Moment) -> WithInterval {
    let [value, lower, upper] = [moment.mean, moment.bounds[0], moment.bounds[1]].map(|t| t + record.origin);
    WithInterval { value, lower, upper }
}

/// Other flights, gaps, and wide intervals.
fn doubts(
    record: &Record,
    stretch: &Stretch,
    size: f64,
    curve: f64,
    moments: [&Moment; 2],
) -> Vec<PhaseDoubt> {
    let mut found = Vec::new();
    let spacing = record.spacing();
    let longest_gap = GAP.max(2.5 * spacing);
    for pair in record.times.windows(2) {
        let near =
            |moment: &&Moment| pair[0] < moment.bounds[1] + spacing && pair[1] > moment.bounds[0] - spacing;
        if pair[1] - pair[0] > longest_gap && moments.iter().any(near) {
            let [start, end] = [pair[0], pair[1]].map(|t| t + record.origin);
            found.push(PhaseDoubt::Gap { start, end });
        }
    }
    for moment in moments {
        let width = moment.bounds[1] - moment.bounds[0];
        // probable at the edge of the interval that was searched, and within the record
        if (width > WIDE || moment.at_edge > NOT_LOCATED) && moment.outside <= OUTSIDE {
            found.push(PhaseDoubt::Wide { width });
        }
    }
    let rest = [0..stretch.frames.start, stretch.frames.end..record.times.len()];
    for frames in rest {
        let other = best(record, frames, Some(curve), size);
        if let Some(other) = other.filter(|other| other.score > SECOND * stretch.score) {
            let [start, end] =
                [other.frames.start, other.frames.end - 1].map(|i| record.times[i] + record.origin);
            found.push(PhaseDoubt::OtherFlight { start, end });
        }
    }
    found
}

impl FlightPhase {
    fn not_found(gravity: f64) -> Self {
        Self {
            status: PhaseStatus::NotFound,
            take_off: WithInterval::none(),
            entry: WithInterval::none(),
            duration: WithInterval::none(),
            gravity: WithInterval::none(),
            given_gravity: gravity,
            noise: MarkerNoise { size: f64::NAN, correlated: f64::NAN, time: f64::NAN },
            doubts: Vec::new(),
        }
    }

    /// Whether one flight was found without a doubt.
    pub fn success(&self) -> bool {
        self.status == PhaseStatus::Found
    }

    /// First and last time that belong to the flight, s, without an end where the record has none; none without a flight.
    pub fn interval(&self) -> Option<(f64, f64)> {
        let is_doubtful = |doubt: PhaseDoubt| self.doubts.contains(&doubt);
        let start =
            if is_doubtful(PhaseDoubt::BeginsInFlight) { f64::NEG_INFINITY } else { self.take_off.value };
        let end = if is_doubtful(PhaseDoubt::EndsInFlight) { f64::INFINITY } else { self.entry.value };
        (self.status != PhaseStatus::NotFound).then_some((start, end))
    }

    /// What was found, or why nothing was.
    pub fn message(&self) -> String {
        let flight = format!("a flight from {:.3} to {:.3} s", self.take_off.value, self.entry.value);
        let doubts = self.doubts.iter().map(|doubt| format!("; {doubt}")).collect::<String>();
        match self.status {
            PhaseStatus::Found | PhaseStatus::Uncertain => flight + &doubts,
            PhaseStatus::OtherGravity => {
                let gravity = gravity_message(&self.gravity, self.given_gravity);
                format!("{flight}; {gravity}{doubts}")
            }
            PhaseStatus::NotFound if self.gravity.value.is_finite() => format!(
                "no flight was found: the stretch most like one falls with {:.2} m/s² (from {:.2} to {:.2}), which cannot be told to be gravity",
                self.gravity.value, self.gravity.lower, self.gravity.upper
            ),
            PhaseStatus::NotFound => {
                "no flight was found: no stretch of the record keeps to a parabola".to_owned()
            }
        }
    }
}

/// Units of length, and metres read as them.
const UNITS: [(f64, &str); 5] = [
    (1000.0, "lengths are in mm and were read as m"),
    (100.0, "lengths are in cm and were read as m"),
    (1.0 / 0.3048, "lengths are in feet and were read as m"),
    (0.01, "lengths are in m and were read as cm"),
    (0.001, "lengths are in m and were read as mm"),
];

/// What a gravity that is another than the given one says of the rate of the frames and of the unit.
pub fn gravity_message(found: &WithInterval, given: f64) -> String {
    let factor = found.value / given;
    let spread = ((found.upper - found.lower) / found.value).abs().max(0.03);
    let unit = UNITS.iter().find(|(size, _)| (factor / size - 1.0).abs() < spread);
    let rate = factor.abs().sqrt();
    let unit = unit.map_or(String::new(), |(_, unit)| format!("{unit}, or "));
    let [times, direction] = if rate > 1.0 { [rate, 1.0] } else { [1.0 / rate, -1.0] };
    let direction = if direction > 0.0 { "high" } else { "low" };
    format!(
        "gravity is found to be {:.4} m/s² (from {:.4} to {:.4}) and not {given:.4}: {unit}the declared rate of the frames is {times:.3} times too {direction}",
        found.value, found.lower, found.upper
    )
}
