//! The report of a flight.

use super::IdentificationError;
use super::code::{Direction, Facing, Group, directions, number};
use super::count::Count;
use super::position::{Angles, Position};
use crate::analysis::Landmarks;
use crate::noise::standard_deviation;
use crate::phases::{WithInterval, gravity_message};
use crate::reconstruction::{
    FlightFrame, ReconstructedFlight, ReconstructionStatus, counting_of, read_orientation, travelling,
};
use serde::{Deserialize, Serialize};
use somersault_multibody::{Data, DynamicsError, Model};
use std::f64::consts::{PI, TAU};

/// How an identification ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum IdentificationStatus {
    /// One dive number has at least 90 %.
    Identified,
    /// No dive number has 90 %.
    Between,
    /// Gravity in the recording is not that of the model: a rate or a unit is wrong.
    OtherGravity,
    /// The reconstruction is no success.
    NotReconstructed,
}

impl IdentificationStatus {
    /// All there are, and their names.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::Identified, "identified"),
        (Self::Between, "between"),
        (Self::OtherGravity, "other_gravity"),
        (Self::NotReconstructed, "not_reconstructed"),
    ];
}

/// What a flight was. Angles are in rad.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FlightReport {
    /// Whether it was identified.
    pub status: IdentificationStatus,
    /// How the reconstruction ended, and whether it is a success.
    pub reconstruction: (ReconstructionStatus, bool),
    /// What its checks found.
    pub reason: String,
    /// The dive number, where one has at least 90 %.
    pub number: Option<String>,
    /// Dive numbers with their probabilities, the most probable first, down to 1 %: of a flight that was reconstructed.
    pub alternatives: Vec<(String, f64)>,
    /// The group.
    pub group: Group,
    /// Directions with their probabilities.
    pub directions: Vec<(Direction, f64)>,
    /// Positions with their probabilities, the most probable first.
    pub positions: Vec<(Position, f64)>,
    /// Half somersaults, forwards positive.
    pub half_somersaults: Count,
    /// Half twists, to the left positive.
    pub half_twists: Count,
    /// Somersaults from the first to the last frame.
    pub somersaults: WithInterval,
    /// Twists.
    pub twists: WithInterval,
    /// Duration of the flight, s.
    pub duration: WithInterval,
    /// How far the centre of mass rises above its place at take-off, m.
    pub height: WithInterval,
    /// Speed of the centre of mass at take-off, m/s.
    pub speed: WithInterval,
    /// Angle of this velocity above the horizontal.
    pub take_off_angle: WithInterval,
    /// Size of the angular momentum about the centre of mass, kg m²/s.
    pub angular_momentum: WithInterval,
    /// Least moment of inertia about its axis, kg m².
    pub least_inertia: WithInterval,
    /// Greatest.
    pub greatest_inertia: WithInterval,
    /// Angle of the hip where it is closed most, in the mean over frames in which it is as closed within three standard deviations: π where it is straight.
    pub hip: WithInterval,
    /// Angle of the knee there.
    pub knee: WithInterval,
    /// Angle of the line from feet to hands beyond the vertical in the last frame, in the sense of the somersaults: negative where the
    /// dive is short.
    pub entry_angle: WithInterval,
    /// Gravity as the recording has it, m/s².
    pub gravity: WithInterval,
    /// That of the model, m/s².
    pub given_gravity: f64,
}

/// Probability of a dive number that is said.
const SURE: f64 = 0.9;
/// Probability down to which alternatives are listed.
const LISTED: f64 = 0.01;
/// How far dives enter from the vertical, and end their twists from half ones, rad.
const ENTRY: f64 = 0.52;
const TWIST: f64 = 0.44;
/// Standard deviations, and fraction of it, by which gravity is another.
const OTHER_GRAVITY: (f64, f64) = (5.0, 0.04);

/// What a flight of a diver was: of a model whose bodies have the names of [`Diver`](somersault_multibody::models::Diver). Where the diver faced
/// at take-off is not in a recording; unless it is given, the diver is taken to travel away from the board.
pub fn identify_flight(
    model: &Model,
    flight: &ReconstructedFlight,
    facing: Option<Facing>,
) -> Result<FlightReport, IdentificationError> {
    let (Some(first), Some(last)) = (flight.frames.first(), flight.frames.last()) else {
        return Err(IdentificationError::NoFrames);
    };
    let landmarks = Landmarks::of(model)?;
    let angles = Angles::of(model, &landmarks, flight)?;
    let [end, end_deviation] = inclination(model, &landmarks, flight, first, last)?;
    // upside down in the first frame
    let is_armstand = first.inclination.abs() > 2.0 * PI / 3.0;
    let base = if is_armstand { PI.copysign(first.inclination) } else { 0.0 };
    let half_somersaults = Count::of_half_turns(end - base, end_deviation, ENTRY);
    let twisted = TAU * last.twists;
    let half_twists = Count::of_half_turns(twisted, TAU * flight.turns_deviation[1], TWIST);
    let group = match half_twists.value {
        _ if is_armstand => Group::Armstand,
        0 => Group::Somersaults,
        _ => Group::Twisting,
    };
    let is_forwards = end > base;
    let travel = travel(model, flight, first, is_armstand)?;
    let directions = directions(is_forwards, is_armstand, facing, travel);
    let positions = angles.positions(flight, half_twists.value != 0);
    let flying = if group == Group::Somersaults { angles.flying(flight) } else { 0.0 };
    let is_success = flight.success();
    let gravity = model.gravity().norm();
    let [seen, seen_deviation] = flight.seen_gravity.map(|x| x * gravity);
    let is_other_gravity =
        (seen - gravity).abs() > (OTHER_GRAVITY.0 * seen_deviation).max(OTHER_GRAVITY.1 * gravity);
    let mut alternatives = Vec::new();
    for (direction, of_direction) in &directions {
        for (n, of_somersaults) in half_somersaults.candidates() {
            for (m, of_twists) in half_twists.candidates() {
                for (position, of_position) in &positions {
                    for (is_flying, of_flying) in [(false, 1.0 - flying), (true, flying)] {
                        let chance = of_direction * of_somersaults * of_twists * of_position * of_flying;
                        let named = number(*direction, is_armstand, is_flying, n, m, *position);
                        alternatives.extend(named.filter(|_| chance >= LISTED).map(|name| (name, chance)));
                    }
                }
            }
        }
    }
    alternatives.sort_by(|a, b| b.1.total_cmp(&a.1));
    let best = alternatives.first().filter(|(_, chance)| *chance >= SURE);
    let status = match best {
        _ if is_other_gravity => IdentificationStatus::OtherGravity,
        _ if !is_success => IdentificationStatus::NotReconstructed,
        Some(_) => IdentificationStatus::Identified,
        None => IdentificationStatus::Between,
    };
    let number = best.filter(|_| status == IdentificationStatus::Identified).map(|(name, _)| name.clone());
    if matches!(status, IdentificationStatus::OtherGravity | IdentificationStatus::NotReconstructed) {
        alternatives.clear();
    }
    let inertia = |frame: &FlightFrame| {
        WithInterval::normal(frame.moment_of_inertia, frame.moment_of_inertia_deviation)
    };
    let by_inertia = |a: &&FlightFrame, b: &&FlightFrame| a.moment_of_inertia.total_cmp(&b.moment_of_inertia);
    let [hip, knee] = angles.least();
    let [of_hip, of_knee] = angles.deviations;
    let momentum = &flight.angular_momentum;
    let size = momentum.value.norm();
    let along = momentum.value.try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
    let of_momentum = quadratic(flight, 0, along.as_slice());
    let beyond = (end - base - PI * f64::from(half_somersaults.value)) * if is_forwards { 1.0 } else { -1.0 };
    let TakeOff { duration, height, speed, angle } = take_off(model, flight);
    Ok(FlightReport {
        status,
        reconstruction: (flight.status, is_success),
        reason: flight.message(),
        number,
        alternatives,
        group,
        directions,
        positions,
        half_somersaults,
        half_twists,
        somersaults: WithInterval::normal(flight.somersaults(), flight.turns_deviation[0]),
        twists: WithInterval::normal(flight.twists(), flight.turns_deviation[1]),
        duration,
        height,
        speed,
        take_off_angle: angle,
        angular_momentum: WithInterval::normal(size, of_momentum),
        least_inertia: flight.frames.iter().min_by(by_inertia).map_or_else(WithInterval::none, inertia),
        greatest_inertia: flight.frames.iter().max_by(by_inertia).map_or_else(WithInterval::none, inertia),
        hip: WithInterval::normal(hip, of_hip),
        knee: WithInterval::normal(knee, of_knee),
        entry_angle: WithInterval::normal(beyond, end_deviation),
        gravity: WithInterval::normal(seen, seen_deviation),
        given_gravity: gravity,
    })
}

/// The deviation of what depends on three numbers of the covariance, from `start` on, by this gradient.
fn quadratic(flight: &ReconstructedFlight, start: usize, gradient: &[f64]) -> f64 {
    let mut sum = 0.0;
    for (i, a) in gradient.iter().enumerate() {
        for (j, b) in gradient.iter().enumerate() {
            sum += a * b * flight.covariance[(start + i, start + j)];
        }
    }
    standard_deviation(sum)
}

/// The angle of the line from feet to hands from the vertical in a frame, whole turns counted as those of the body's long axis, and its standard
/// deviation.
fn inclination(
    model: &Model,
    landmarks: &Landmarks,
    flight: &ReconstructedFlight,
    first: &FlightFrame,
    frame: &FlightFrame,
) -> Result<[f64; 2], DynamicsError> {
    let mut data = Data::new(model);
    let twist = TAU * frame.twists;
    let momentum = &flight.angular_momentum.value;
    let counting = counting_of(model);
    let is_planar = model.positions_of(0).len() == 3;
    // the first frame decides where the flight travels, and turns are counted from the frame itself
    let seen = |q: &[f64]| {
        let orientations = [&first.q[..], q].map(|q| read_orientation(is_planar, q));
        travelling(model, momentum, orientations)[1]
    };
    let own = seen(&frame.q);
    let mut ahead = |q: &[f64]| -> Result<f64, DynamicsError> {
        let turned = counting.along(&[own, seen(q)]);
        let further = turned[1].somersault - turned[0].somersault;
        Ok(further + line_ahead(model, landmarks, &mut data, q, twist)?)
    };
    let angle = ahead(&frame.q)?;
    let deviation = frame.deviation_of(model, |q| Ok(angle + remainder(ahead(q)? - angle)))?;
    Ok([frame.inclination + angle, deviation])
}

/// A difference of angles between −π and π.
fn remainder(difference: f64) -> f64 {
    difference - TAU * (difference / TAU).round()
}

/// How far the line from feet to hands leans forward of the body's long axis, rad, seen in the body turned back by its twist.
pub(crate) fn line_ahead(
    model: &Model,
    landmarks: &Landmarks,
    data: &mut Data,
    q: &[f64],
    twist: f64,
) -> Result<f64, DynamicsError> {
    let line = landmarks.long_axis(model, data, q)?;
    let turn = model.positions(data, q)?.pose(0)?.rotation;
    let own = counting_of(model).axes.inverse() * turn.tr_mul(&line);
    let front = own.x * twist.cos() - own.y * twist.sin();
    Ok(front.atan2(own.z))
}

/// The velocity to the front of the body in the first frame, with its standard deviation.
fn travel(
    model: &Model,
    flight: &ReconstructedFlight,
    first: &FlightFrame,
    is_armstand: bool,
) -> Result<[f64; 2], DynamicsError> {
    let mut data = Data::new(model);
    let turn = model.positions(&mut data, &first.q)?.pose(0)?.rotation;
    let front = turn * (counting_of(model).axes * nalgebra::Vector3::x());
    let mut level = nalgebra::Vector3::new(front.x, front.y, 0.0).try_normalize(1e-6).unwrap_or_default();
    if is_armstand {
        // upside down the front of the body is turned to the other side
        level = -level;
    }
    let velocity = flight.velocity.value.dot(&level);
    let sign = if is_armstand { -1.0 } else { 1.0 };
    Ok([velocity * sign, quadratic(flight, 6, level.as_slice())])
}

/// What is known of the take-off.
struct TakeOff {
    duration: WithInterval,
    height: WithInterval,
    speed: WithInterval,
    angle: WithInterval,
}

/// At the take-off as it was found; at the first frame where it was not sought.
fn take_off(model: &Model, flight: &ReconstructedFlight) -> TakeOff {
    let down = model.gravity() * flight.gravity[0];
    let gravity = down.norm();
    let start = flight.frames.first().map_or(f64::NAN, |frame| frame.time);
    let end = flight.frames.last().map_or(f64::NAN, |frame| frame.time);
    let found = flight.phase.as_ref().filter(|phase| phase.interval().is_some());
    let found = found.filter(|phase| phase.take_off.lower.is_finite());
    // how long before the first frame, and how surely
    let (before, of_time) = found.map_or((0.0, 0.0), |phase| {
        (start - phase.take_off.value, (phase.take_off.upper - phase.take_off.lower) / 3.92)
    });
    let duration = match &flight.phase {
        Some(phase) if phase.duration.value.is_finite() => phase.duration,
        _ => WithInterval { value: end - start, lower: end - start, upper: f64::INFINITY },
    };
    let velocity = flight.velocity.value - down * before;
    let up = -velocity.dot(&down) / gravity;
    let of_up = quadratic(flight, 6, (-down / gravity).as_slice()).hypot(gravity * of_time);
    let rise = up.max(0.0);
    let height = WithInterval::normal(rise * rise / (2.0 * gravity), rise * of_up / gravity);
    let speed = velocity.norm();
    let along = velocity / speed;
    let of_speed = quadratic(flight, 6, along.as_slice()).hypot(along.dot(&down) * of_time);
    let level = (speed * speed - up * up).max(0.0).sqrt();
    // the angle turns with what is across the velocity
    let across = (-down / gravity - along * (up / speed)).try_normalize(1e-9).unwrap_or_default();
    let of_across = quadratic(flight, 6, across.as_slice()).hypot(across.dot(&down) * of_time);
    TakeOff {
        duration,
        height,
        speed: WithInterval::normal(speed, of_speed),
        angle: WithInterval::normal(up.atan2(level), of_across / speed),
    }
}

impl FlightReport {
    /// Whether one dive number has at least 90 %, the reconstruction is a success, and gravity is that of the model.
    pub fn success(&self) -> bool {
        self.status == IdentificationStatus::Identified
    }

    /// What the flight was, or why that is not said.
    pub fn message(&self) -> String {
        let listed = |n: usize| {
            let texts = self.alternatives.iter().take(n);
            texts
                .map(|(name, chance)| format!("{name} ({:.0} %)", 100.0 * chance))
                .collect::<Vec<_>>()
                .join(", ")
        };
        match self.status {
            IdentificationStatus::Identified => listed(1),
            IdentificationStatus::Between if self.alternatives.is_empty() => {
                "no dive number is near: the flight lies between".to_owned()
            }
            IdentificationStatus::Between => {
                format!("no dive number has 90 %: {}", listed(4))
            }
            IdentificationStatus::OtherGravity => gravity_message(&self.gravity, self.given_gravity),
            IdentificationStatus::NotReconstructed => {
                let (status, _) = self.reconstruction;
                let named = ReconstructionStatus::ALL.iter().find(|(known, _)| *known == status);
                let name = named.map_or("", |(_, name)| name);
                format!("the flight was not reconstructed ({name}): {}", self.reason)
            }
        }
    }

    /// A page of text, values with half their 95 % intervals.
    pub fn page(&self) -> String {
        let plus = |x: &WithInterval, factor: f64, digits: usize| {
            let half = 0.5 * (x.upper - x.lower) * factor;
            if half.is_finite() {
                format!("{:.digits$} ± {half:.digits$}", x.value * factor)
            } else {
                format!("{:.digits$} (at least)", x.value * factor)
            }
        };
        // digits that the interval has
        let degrees =
            |x: &WithInterval| plus(x, 180.0 / PI, usize::from(0.5 * (x.upper - x.lower).to_degrees() < 1.0));
        let names = |texts: Vec<String>| texts.join(", ");
        let directions = self.directions.iter().map(|(direction, chance)| {
            let name =
                Direction::ALL.iter().find(|(known, _)| known == direction).map_or("", |(_, name)| name);
            format!("{name} ({:.0} %)", 100.0 * chance)
        });
        let positions =
            self.positions.iter().filter(|(_, chance)| *chance >= LISTED).map(|(position, chance)| {
                let name =
                    Position::ALL.iter().find(|(known, _)| known == position).map_or("", |(_, name)| name);
                format!("{name} ({:.0} %)", 100.0 * chance)
            });
        let count = |count: &Count| {
            let (next, chance) = count.neighbour;
            format!(
                "{} ({:.0} %; {next}: {:.0} %; between: {:.0} %)",
                count.value,
                100.0 * count.probability,
                100.0 * chance,
                100.0 * count.between
            )
        };
        let title = if self.success() { "Dive" } else { "No dive number" };
        let rows = [
            (title, self.message()),
            ("Direction", names(directions.collect())),
            ("Position", names(positions.collect())),
            ("Half somersaults", count(&self.half_somersaults)),
            ("Half twists", count(&self.half_twists)),
            ("Somersaults", plus(&self.somersaults, 1.0, 2)),
            ("Twists", plus(&self.twists, 1.0, 2)),
            ("Flight time", format!("{} s", plus(&self.duration, 1.0, 2))),
            ("Height above take-off", format!("{} m", plus(&self.height, 1.0, 2))),
            ("Take-off speed", format!("{} m/s", plus(&self.speed, 1.0, 2))),
            ("Take-off angle", format!("{}° above the horizontal", degrees(&self.take_off_angle))),
            ("Angular momentum", format!("{} kg m²/s", plus(&self.angular_momentum, 1.0, 1))),
            ("Moment of inertia, least", format!("{} kg m²", plus(&self.least_inertia, 1.0, 2))),
            ("Moment of inertia, greatest", format!("{} kg m²", plus(&self.greatest_inertia, 1.0, 2))),
            ("Hip, most closed", format!("{}°", degrees(&self.hip))),
            ("Knee, there", format!("{}°", degrees(&self.knee))),
            ("Entry beyond the vertical", format!("{}°", degrees(&self.entry_angle))),
            ("Gravity in the recording", format!("{} m/s²", plus(&self.gravity, 1.0, 2))),
        ];
        let lines = rows.iter().map(|(name, value)| format!("{name:<28} {value}\n"));
        lines.collect::<String>() + "Values are ± half of their 95 % intervals, for the given masses.\n"
    }
}
