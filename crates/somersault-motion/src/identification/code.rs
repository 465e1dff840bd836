//! Numbers of dives, by the rules of World Aquatics.

use super::count::below;
use super::position::Position;
use serde::{Deserialize, Serialize};

/// Where a diver faces at take-off.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Facing {
    /// The water.
    Water,
    /// The board.
    Board,
}

impl Facing {
    /// All there are, and their names.
    pub const ALL: [(Self, &'static str); 2] = [(Self::Water, "water"), (Self::Board, "board")];
}

/// The sense of the somersaults, and where the diver faces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Direction {
    /// Forwards, facing the water.
    Forward,
    /// Backwards, facing the board.
    Back,
    /// Backwards, facing the water.
    Reverse,
    /// Forwards, facing the board.
    Inward,
}

impl Direction {
    /// All there are, and their names, in the order of their digits.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::Forward, "forward"),
        (Self::Back, "back"),
        (Self::Reverse, "reverse"),
        (Self::Inward, "inward"),
    ];

    fn digit(self) -> u32 {
        match self {
            Self::Forward => 1,
            Self::Back => 2,
            Self::Reverse => 3,
            Self::Inward => 4,
        }
    }
}

/// The group of a dive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Group {
    /// Without twists, from the feet.
    Somersaults,
    /// With twists, from the feet.
    Twisting,
    /// From an armstand.
    Armstand,
}

impl Group {
    /// All there are, and their names.
    pub const ALL: [(Self, &'static str); 3] =
        [(Self::Somersaults, "somersaults"), (Self::Twisting, "twisting"), (Self::Armstand, "armstand")];
}

/// Velocity away from the board that a diver may lack, m/s.
const TRAVEL: f64 = 0.15;

/// The directions of a flight with their probabilities. `travel` is the velocity to the front of the body, m/s, with its
/// standard deviation; from an armstand to the side to which the feet fall.
pub(super) fn directions(
    is_forwards: bool,
    is_armstand: bool,
    facing: Option<Facing>,
    travel: [f64; 2],
) -> Vec<(Direction, f64)> {
    let [velocity, deviation] = travel;
    let away = below(velocity / deviation.hypot(TRAVEL));
    if is_armstand {
        // the feet fall to the back where these are forwards: a diver who faces the board then travels to the water
        return match (is_forwards, facing) {
            (true, _) => vec![(Direction::Forward, 1.0)],
            (false, Some(Facing::Water)) => vec![(Direction::Back, 1.0)],
            (false, Some(Facing::Board)) => vec![(Direction::Reverse, 1.0)],
            (false, None) => vec![(Direction::Back, away), (Direction::Reverse, 1.0 - away)],
        };
    }
    let water = match facing {
        Some(Facing::Water) => 1.0,
        Some(Facing::Board) => 0.0,
        None => away,
    };
    let [facing_water, facing_board] = if is_forwards {
        [Direction::Forward, Direction::Inward]
    } else {
        [Direction::Reverse, Direction::Back]
    };
    let all = [(facing_water, water), (facing_board, 1.0 - water)];
    all.into_iter().filter(|(_, probability)| *probability > 0.0).collect()
}

/// The number of a dive; none where the rules have none.
pub(super) fn number(
    direction: Direction,
    is_armstand: bool,
    is_flying: bool,
    half_somersaults: i32,
    half_twists: i32,
    position: Position,
) -> Option<String> {
    let (somersaults, twists) = (half_somersaults.abs(), half_twists.abs());
    if somersaults == 0 || somersaults > 11 {
        return None;
    }
    let (digit, letter) = (direction.digit(), position.letter());
    match (is_armstand, twists) {
        (true, 0) => Some(format!("6{digit}{somersaults}{letter}")),
        (true, _) => Some(format!("6{digit}{somersaults}{twists}{letter}")),
        (false, 0) if is_flying => Some(format!("{digit}1{somersaults}{letter}")),
        (false, 0) => Some(format!("{digit}0{somersaults}{letter}")),
        (false, _) => Some(format!("5{digit}{somersaults}{twists}{letter}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_rules() {
        use Direction::{Back, Forward, Inward, Reverse};
        use Position::{Free, Pike, Straight, Tuck};
        // World Aquatics, Diving Rules, table of dive numbers
        for (expected, direction, is_armstand, is_flying, somersaults, twists, position) in [
            ("107B", Forward, false, false, 7, 0, Pike),
            ("113B", Forward, false, true, 3, 0, Pike),
            ("201A", Back, false, false, -1, 0, Straight),
            ("305C", Reverse, false, false, -5, 0, Tuck),
            ("405C", Inward, false, false, 5, 0, Tuck),
            ("5174D", Forward, false, false, 7, -4, Free),
            ("5253B", Back, false, false, -5, 3, Pike),
            ("612B", Forward, true, false, 2, 0, Pike),
            ("6243D", Back, true, false, -4, 3, Free),
        ] {
            let found = number(direction, is_armstand, is_flying, somersaults, twists, position);
            assert_eq!(found.as_deref(), Some(expected));
        }
        assert_eq!(number(Forward, false, false, 0, 0, Straight), None);
    }

    #[test]
    fn directions_follow_from_the_sense_and_from_where_the_diver_faces() {
        let found = |is_forwards, facing| directions(is_forwards, false, facing, [1.0, 0.01]);
        assert_eq!(found(true, Some(Facing::Board)), [(Direction::Inward, 1.0)]);
        assert_eq!(found(false, Some(Facing::Board)), [(Direction::Back, 1.0)]);
        assert_eq!(found(false, Some(Facing::Water)), [(Direction::Reverse, 1.0)]);
        assert!(found(false, None)[0].0 == Direction::Reverse && found(false, None)[0].1 > 0.999);
        // a velocity that does not say
        let [(_, water), (_, board)] = directions(true, false, None, [0.0, 0.01])[..] else { panic!() };
        assert!((water - 0.5).abs() < 1e-12 && (board - 0.5).abs() < 1e-12);
        assert_eq!(directions(true, true, None, [1.0, 0.01]), [(Direction::Forward, 1.0)]);
        assert_eq!(directions(false, true, None, [5.0, 0.01])[0].0, Direction::Back);
    }
}
