//! Who is followed from frame to frame, of several people.

use super::content::Frame;
use super::points::{Person, Point};
use std::collections::HashSet;

/// How far a person may move from one frame to the next, in diagonals of the greater box around the points.
const REACH: f64 = 0.5;

/// The person of each frame: the one with the greatest weights in the first, and from then on the one whom the tracker of the program
/// gave the same number, or else the nearest. None where the nearest is too far to be the same, by the frames between their positions.
pub(super) fn followed<'f>(frames: &'f [Frame], positions: &[f64]) -> Vec<Option<&'f Person>> {
    let is_crowd = frames.iter().any(|frame| frame.people.len() > 1);
    let has_tracks = are_tracked(frames);
    let mut before: Option<(&Person, f64)> = None;
    // numbers of those who were seen beside the one who is followed
    let mut others: HashSet<u64> = HashSet::new();
    let mut chosen = Vec::with_capacity(frames.len());
    for (frame, &position) in frames.iter().zip(positions) {
        let found = match before {
            None => frame.people.iter().max_by(|a, b| sure(a).total_cmp(&sure(b))),
            Some((before, at)) => {
                let same = frame.people.iter().find(|person| has_tracks && person.track == before.track);
                let reach = |person: &Person| match extent(before).max(extent(person)) {
                    extent if is_crowd && extent > 0.0 => REACH * (position - at) * extent,
                    _ => f64::INFINITY,
                };
                // a tracker that loses a person continues with a new number
                let may_be = |person: &&Person| {
                    !(has_tracks && person.track.is_some_and(|track| others.contains(&track)))
                };
                let near = |person: &Person| {
                    let (median, common) = distance(before, person);
                    (median <= reach(person)).then_some(median / common)
                };
                let candidates = frame.people.iter().filter(may_be);
                let nearest = candidates
                    .filter_map(|person| Some((near(person)?, person)))
                    .min_by(|(a, _), (b, _)| a.total_cmp(b));
                same.or(nearest.map(|(_, person)| person))
            }
        };
        // one without a point says nothing of where the person is
        if let Some(found) = found.filter(|person| sure(person) > 0.0) {
            before = Some((found, position));
            others.extend(frame.people.iter().filter_map(|p| p.track).filter(|t| Some(*t) != found.track));
        }
        chosen.push(found);
    }
    chosen
}

/// Whether numbers of a tracker tell people apart: all have one, those of a frame differ, and there are several.
fn are_tracked(frames: &[Frame]) -> bool {
    let mut all = HashSet::new();
    for frame in frames {
        let tracks: HashSet<u64> = frame.people.iter().filter_map(|person| person.track).collect();
        if tracks.len() < frame.people.len() {
            return false;
        }
        all.extend(tracks);
    }
    all.len() > 1
}

/// The sum of the weights.
fn sure(person: &Person) -> f64 {
    person.points.iter().map(|(.., weight)| weight).filter(|weight| weight.is_finite()).sum()
}

/// Whether a point was found.
fn is_there((x, _, weight): &Point) -> bool {
    *weight > 0.0 && x.iter().all(|x| x.is_finite())
}

/// The diagonal of the box around the points.
fn extent(person: &Person) -> f64 {
    let range = |axis: usize| {
        let x = person.points.iter().filter(|point| is_there(point)).map(|(x, ..)| x[axis]);
        let (least, greatest) = x.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        (greatest - least).max(0.0)
    };
    (0..3).map(|axis| range(axis).powi(2)).sum::<f64>().sqrt()
}

/// The middle of the points.
fn centre(person: &Person) -> [f64; 3] {
    let (mut sum, mut n) = ([0.0; 3], 0.0);
    for (x, ..) in person.points.iter().filter(|point| is_there(point)) {
        sum.iter_mut().zip(x).for_each(|(sum, x)| *sum += x);
        n += 1.0;
    }
    sum.map(|sum| sum / f64::max(n, 1.0))
}

fn length(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
}

/// The median distance of the points that two persons have, and the fraction of the weights of the first that these have in both. Of
/// persons without a common point it is the distance of their middles.
fn distance(a: &Person, b: &Person) -> (f64, f64) {
    let pairs = a.points.iter().zip(&b.points).filter(|(p, q)| is_there(p) && is_there(q));
    let mut common = 0.0;
    let mut all: Vec<f64> = pairs
        .map(|((x, _, v), (y, _, w))| {
            common += v.min(*w);
            length(x, y)
        })
        .collect();
    let least = 1e-3;
    if all.is_empty() {
        return (length(&centre(a), &centre(b)), least);
    }
    let middle = all.len() / 2;
    let (_, median, _) = all.select_nth_unstable_by(middle, f64::total_cmp);
    (*median, (common / sure(a)).max(least))
}
