//! Arcs of a collocation solution, and where the multiple shooting of them starts.
//!
//! Labels are put on the intervals of the mesh. A control within 2 % of a bound at all points of an interval is at it. Else it is
//! interior where H is not affine in it. Where it is, one or two such intervals, or any number in a brief time, are a switch, at the
//! time that keeps ∫ u dt, and more are a singular arc: a coarse singular control oscillates between its bounds, so that how it looks
//! is no sign. A bound of the state holds where c exceeds −0.3 % of its range and multipliers push; in one or two intervals it is a
//! touch where c is of order 2.

use super::hamiltonian::{BoundedRow, Hamiltonian, MOST_ORDER};
use super::kind::{ArcKind, ControlKind};
use super::shooting::{Condition, Iterate, Junction, Plan, Side, n_segments};
use crate::collocation::PhaseSolution;

/// Distance to a bound of a control, relative to its range, at which it is at it.
const AT_BOUND: f64 = 0.02;
/// Distance to a bound of the state, relative to the range of what is bounded, at which it may hold.
const NEAR: f64 = 3e-3;
/// Impulse of a bound's multipliers, relative to the costates, below which it does not push.
const NO_PUSH: f64 = 1e-4;
/// Part of the largest multiplier of a contact, or of its largest impulse, that its first and last points have: a mesh that is graded
/// towards the ends of a contact has small impulses there, one that is not has them alone where a bound of order 2 holds.
const PUSHING: f64 = 0.01;
/// Part of a switch below which an arc is not tried.
const SLIVER: f64 = 0.02;
/// Intervals of a switch or a touch at most.
const SHORT: usize = 2;
/// Part of the duration of a switch at most, in any number of intervals: a mesh that is graded towards a junction has many there.
const BRIEF: f64 = 1e-3;

/// What pushes: multipliers of bounds of the state at the points, times what each point stands for.
pub(super) struct Impulses {
    /// Of states, by points; positive at upper bounds.
    pub(super) states: Vec<Vec<f64>>,
    /// Of path constraints, by points.
    pub(super) path: Vec<Vec<f64>>,
    /// The values of the path constraints at the points.
    pub(super) path_values: Vec<Vec<f64>>,
}

/// Why no arcs are made of a solution.
pub(super) struct Obstacle {
    pub(super) reason: String,
    /// Whether it lies in the problem, so that no finer solution is without it.
    pub(super) is_lasting: bool,
}

impl Obstacle {
    fn lasting(reason: String) -> Self {
        Self { reason, is_lasting: true }
    }
}

impl From<String> for Obstacle {
    fn from(reason: String) -> Self {
        Self { reason, is_lasting: false }
    }
}

/// A stretch of the motion, in parts of the duration.
#[derive(Debug, Clone, PartialEq)]
struct Piece<T> {
    start: f64,
    end: f64,
    what: T,
}

/// Where a bound of the state holds.
struct Contact {
    bound: usize,
    start: f64,
    end: f64,
    /// π of c, ċ, … as the multipliers of collocation have them.
    jumps: Vec<f64>,
}

/// Arcs, and where their shooting starts.
pub(super) struct Found {
    pub(super) plan: Plan,
    pub(super) iterate: Iterate,
}

struct Labels<'a> {
    solution: &'a PhaseSolution,
    /// Part of the duration and interval of each point.
    places: Vec<(f64, usize)>,
    /// Parts at which intervals end.
    mesh: &'a [f64],
}

impl Labels<'_> {
    fn n_intervals(&self) -> usize {
        self.mesh.len() - 1
    }

    /// The label of a control in each interval: at a bound, or none.
    fn at_bounds(&self, control: usize, hamiltonian: &Hamiltonian) -> Vec<Option<ControlKind>> {
        let bounds = hamiltonian.control_bounds[control];
        let values: Vec<f64> = self.solution.controls.iter().map(|u| u[control]).collect();
        let (least, most) =
            values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &u| (a.min(u), b.max(u)));
        let range = bounds.upper - bounds.lower;
        let near = AT_BOUND * if range.is_finite() { range } else { most - least };
        let mut labels = vec![None; self.n_intervals()];
        for (k, label) in labels.iter_mut().enumerate() {
            let mut inside =
                self.places.iter().zip(&values).filter(|((_, interval), _)| *interval == k).map(|(_, u)| *u);
            if inside.clone().all(|u| u - bounds.lower <= near) {
                *label = Some(ControlKind::Lower);
            } else if inside.all(|u| bounds.upper - u <= near) {
                *label = Some(ControlKind::Upper);
            }
        }
        labels
    }

    /// The pieces of a control.
    fn pieces(
        &self,
        control: usize,
        hamiltonian: &Hamiltonian,
        contacts: &[Contact],
    ) -> Vec<Piece<ControlKind>> {
        let labels = self.at_bounds(control, hamiltonian);
        let affine = hamiltonian.is_affine[control];
        let other = if affine { ControlKind::Singular } else { ControlKind::Interior };
        let mut pieces: Vec<Piece<ControlKind>> = Vec::new();
        for (k, label) in labels.iter().enumerate() {
            let (start, end, what) = (self.mesh[k], self.mesh[k + 1], label.unwrap_or(other));
            match pieces.last_mut() {
                Some(piece) if piece.what == what => piece.end = end,
                Some(_) | None => pieces.push(Piece { start, end, what }),
            }
        }
        if affine {
            for contact in contacts.iter().filter(|c| hamiltonian.bounds[c.bound].controls.contains(&control))
            {
                pieces = overlaid(pieces, contact, ControlKind::Interior);
            }
            self.close_switches(control, hamiltonian, &mut pieces);
        }
        pieces
    }

    /// Intervals that a piece covers.
    fn length<T>(&self, piece: &Piece<T>) -> usize {
        let inside = |k: &usize| {
            let middle = 0.5 * (self.mesh[*k] + self.mesh[*k + 1]);
            piece.start <= middle && middle < piece.end
        };
        (0..self.n_intervals()).filter(inside).count()
    }

    /// Takes short singular pieces for what stands around them.
    fn close_switches(
        &self,
        control: usize,
        hamiltonian: &Hamiltonian,
        pieces: &mut Vec<Piece<ControlKind>>,
    ) {
        let mut k = 0;
        while k < pieces.len() {
            let piece = &pieces[k];
            let short = piece.what == ControlKind::Singular
                && (self.length(piece) <= SHORT || piece.end - piece.start < BRIEF)
                && pieces.len() > 1;
            if !short {
                k += 1;
                continue;
            }
            let gap = pieces.remove(k);
            let before = k.checked_sub(1).map(|k| pieces[k].what);
            let after = pieces.get(k).map(|piece| piece.what);
            let upper = self.upper_part(control, hamiltonian, &gap);
            let of = |what: ControlKind| if what == ControlKind::Upper { upper } else { 1.0 - upper };
            let length = gap.end - gap.start;
            // what stands in the gap: its parts, and how long each is
            let parts: Vec<(ControlKind, f64)> = match (before, after) {
                (Some(a), Some(b)) if a.is_at_bound() && b.is_at_bound() && a != b => {
                    vec![(a, of(a)), (b, of(b))]
                }
                (Some(a), Some(b)) if a == b && a.is_at_bound() => {
                    vec![(a, 0.5 * of(a)), (opposite(a), 1.0 - of(a)), (a, 0.5 * of(a))]
                }
                (Some(a), None) if a.is_at_bound() => vec![(a, of(a)), (opposite(a), 1.0 - of(a))],
                (None, Some(b)) if b.is_at_bound() => vec![(opposite(b), 1.0 - of(b)), (b, of(b))],
                (Some(_), Some(ControlKind::Interior)) => before.map(|a| (a, 1.0)).into_iter().collect(),
                (None | Some(_), Some(b)) => vec![(b, 1.0)],
                (Some(a), None) => vec![(a, 1.0)],
                (None, None) => Vec::new(),
            };
            let mut start = gap.start;
            for (place, (what, part)) in parts.into_iter().filter(|(_, part)| *part > SLIVER).enumerate() {
                pieces.insert(k + place, Piece { start, end: start + part * length, what });
                start += part * length;
            }
            *pieces = joined(pieces);
            k = 0;
        }
    }

    /// The part of a stretch for which a control that only has its bounds must be at the upper one, so that its integral stays.
    fn upper_part(&self, control: usize, hamiltonian: &Hamiltonian, gap: &Piece<ControlKind>) -> f64 {
        let bounds = hamiltonian.control_bounds[control];
        let measures = self.solution.measures();
        let (mut sum, mut weight) = (0.0, 0.0);
        for (i, (fraction, _)) in self.places.iter().enumerate() {
            if gap.start <= *fraction && *fraction < gap.end {
                sum += measures[i] * self.solution.controls[i][control];
                weight += measures[i];
            }
        }
        let part = (sum / weight - bounds.lower) / (bounds.upper - bounds.lower);
        if part.is_finite() { part.clamp(0.0, 1.0) } else { 0.5 }
    }

    /// Where bounds of the state hold, unless one of too high an order does.
    fn contacts(&self, hamiltonian: &Hamiltonian, impulses: &Impulses) -> Result<Vec<Contact>, Obstacle> {
        let costates = self.solution.costates.iter().flatten().fold(0.0, |a: f64, b| a.max(b.abs()));
        let mut contacts = Vec::new();
        for (number, bound) in hamiltonian.bounds.iter().enumerate() {
            let (values, pushes): (Vec<f64>, Vec<f64>) = match bound.row {
                BoundedRow::State(i) => {
                    let values = self.solution.states[..self.places.len()].iter().map(|x| x[i]);
                    (values.collect(), impulses.states.iter().map(|y| y[i]).collect())
                }
                BoundedRow::Path(i) => (
                    impulses.path_values.iter().map(|g| g[i]).collect(),
                    impulses.path.iter().map(|y| y[i]).collect(),
                ),
            };
            let sign = if bound.is_upper { 1.0 } else { -1.0 };
            let pushes: Vec<f64> = pushes.iter().map(|y| (sign * y).max(0.0)).collect();
            if pushes.iter().sum::<f64>() < NO_PUSH * costates {
                continue;
            }
            let most = values.iter().map(|x| sign * x).fold(f64::NEG_INFINITY, f64::max);
            let least = values.iter().map(|x| sign * x).fold(f64::INFINITY, f64::min);
            let is_near = |i: &usize| sign * values[*i] >= most - NEAR * (most - least);
            let mut runs: Vec<(usize, usize)> = Vec::new();
            for i in (0..values.len()).filter(is_near) {
                match runs.last_mut() {
                    Some(run) if self.places[i].1 <= self.places[run.1].1 + 1 => run.1 = i,
                    Some(_) | None => runs.push((i, i)),
                }
            }
            for (first, last) in runs {
                let run = first..=last;
                if pushes[run.clone()].iter().sum::<f64>() < NO_PUSH * costates {
                    continue;
                }
                if bound.order() > MOST_ORDER - usize::from(bound.controls.is_empty()) {
                    return Err(Obstacle::lasting(format!(
                        "{} holds, and no control appears in its first two derivatives; bounds of the state of order 3 and more are \
                         not made arcs of",
                        bound.name
                    )));
                }
                contacts.push(self.contact(number, bound.order(), &pushes, first, last));
            }
        }
        contacts.sort_by(|a, b| a.start.total_cmp(&b.start));
        Ok(contacts)
    }

    fn contact(&self, bound: usize, order: usize, pushes: &[f64], first: usize, last: usize) -> Contact {
        let measures = self.solution.measures();
        let most = |of: &dyn Fn(usize) -> f64| (first..=last).map(of).fold(0.0, f64::max);
        let density = |i: usize| pushes[i] / measures[i];
        let (impulse, multiplier) = (PUSHING * most(&|i| pushes[i]), PUSHING * most(&density));
        let pushing: Vec<usize> =
            (first..=last).filter(|&i| pushes[i] > impulse || density(i) > multiplier).collect();
        let ends = (pushing.first().copied().unwrap_or(first), pushing.last().copied().unwrap_or(last));
        let (mut start, mut end) = (self.places[ends.0].0, self.places[ends.1].0);
        let intervals = self.places[ends.1].1 - self.places[ends.0].1 + 1;
        let duration = self.solution.horizon().1 - self.solution.horizon().0;
        let total: f64 = pushes[first..=last].iter().sum();
        let moment = |from: f64| -> f64 {
            (first..=last).map(|i| pushes[i] * (self.places[i].0 - from) * duration).sum()
        };
        if order == MOST_ORDER && intervals <= SHORT {
            start += moment(start) / total / duration;
            return Contact { bound, start, end: start, jumps: vec![total] };
        }
        if end <= start {
            let interval = self.places[ends.0].1;
            (start, end) = (self.mesh[interval], self.mesh[interval + 1]);
        }
        let jumps = if order == 1 { vec![total] } else { vec![total, moment(start)] };
        Contact { bound, start, end, jumps }
    }
}

/// The other bound.
fn opposite(kind: ControlKind) -> ControlKind {
    match kind {
        ControlKind::Lower => ControlKind::Upper,
        ControlKind::Upper => ControlKind::Lower,
        ControlKind::Interior | ControlKind::Singular => kind,
    }
}

/// Pieces without gaps, neighbours of one kind joined.
fn joined(pieces: &[Piece<ControlKind>]) -> Vec<Piece<ControlKind>> {
    let mut all: Vec<Piece<ControlKind>> = Vec::new();
    for piece in pieces {
        match all.last_mut() {
            Some(last) if last.what == piece.what => last.end = piece.end,
            Some(last) => {
                last.end = piece.start;
                all.push(piece.clone());
            }
            None => all.push(Piece { start: 0.0, ..piece.clone() }),
        }
    }
    if let Some(last) = all.last_mut() {
        last.end = 1.0;
    }
    all
}

/// Pieces with another one laid over them.
fn overlaid(
    pieces: Vec<Piece<ControlKind>>,
    contact: &Contact,
    what: ControlKind,
) -> Vec<Piece<ControlKind>> {
    if contact.end <= contact.start {
        return pieces;
    }
    let mut all = Vec::new();
    let mut is_laid = false;
    for piece in pieces {
        if piece.start < contact.start {
            all.push(Piece { end: piece.end.min(contact.start), ..piece.clone() });
        }
        if !is_laid && piece.end > contact.start {
            is_laid = true;
            all.push(Piece { start: contact.start, end: contact.end, what });
        }
        if piece.end > contact.end {
            all.push(Piece { start: piece.start.max(contact.end), ..piece });
        }
    }
    all
}

/// What junctions two kinds of arcs have: conditions and jumps; a sentence where that is not known.
pub(super) fn junction(
    hamiltonian: &Hamiltonian,
    before: &ArcKind,
    after: &ArcKind,
    touch: Option<usize>,
    grip: &[f64],
) -> Result<Junction, String> {
    let mut junction = Junction::default();
    let conditions = &mut junction.conditions;
    if let Some(bound) = touch {
        conditions.extend([Condition::Bound(bound, 0), Condition::Bound(bound, 1)]);
        junction.jump = Some((bound, 1));
        return Ok(junction);
    }
    let tightest = || (0..grip.len()).max_by(|&a, &b| grip[a].total_cmp(&grip[b])).unwrap_or(0);
    match (before.contact, after.contact) {
        (Some(a), Some(b)) if a != b => {
            return Err("two bounds of the state hold one directly after the other".to_owned());
        }
        (None, Some(bound)) => {
            let order = hamiltonian.bounds[bound].order();
            conditions.extend((0..order).map(|d| Condition::Bound(bound, d)));
            junction.jump = Some((bound, order));
            let controls = &hamiltonian.bounds[bound].controls;
            let freed = controls.iter().find(|&&i| before.controls[i] != after.controls[i]);
            match freed.map(|&i| (i, before.controls[i])) {
                Some((i, ControlKind::Lower | ControlKind::Upper)) => {
                    conditions.push(Condition::Slope(Side::Before, i));
                }
                Some((_, ControlKind::Singular)) => {}
                Some((_, ControlKind::Interior)) | None => conditions.push(Condition::Continuous(tightest())),
            }
            return Ok(junction);
        }
        (Some(bound), None) => {
            let controls = &hamiltonian.bounds[bound].controls;
            let freed = controls.iter().find(|&&i| before.controls[i] != after.controls[i]);
            match freed.map(|&i| (i, after.controls[i])) {
                Some((i, ControlKind::Lower | ControlKind::Upper)) => {
                    conditions.push(Condition::Slope(Side::After, i));
                }
                Some((i, ControlKind::Singular)) => {
                    conditions
                        .extend([Condition::Slope(Side::After, i), Condition::SlopeRate(Side::After, i)]);
                }
                Some((_, ControlKind::Interior)) | None => conditions.push(Condition::Continuous(tightest())),
            }
            return Ok(junction);
        }
        (Some(_), Some(_)) | (None, None) => {}
    }
    for i in 0..hamiltonian.m {
        use ControlKind::{Interior, Lower, Singular, Upper};
        match (before.controls[i], after.controls[i]) {
            (a, b) if a == b => {}
            (Lower | Upper, Lower | Upper | Interior) => conditions.push(Condition::Slope(Side::Before, i)),
            (Interior, Lower | Upper) => conditions.push(Condition::Slope(Side::After, i)),
            (Lower | Upper, Singular) => {
                conditions.extend([Condition::Slope(Side::Before, i), Condition::SlopeRate(Side::Before, i)]);
            }
            (Singular, Lower | Upper) => {}
            (Interior | Singular, Interior | Singular) => {
                return Err("a singular arc joins an interior one of the same control".to_owned());
            }
        }
    }
    Ok(junction)
}

/// All inputs of the Hamiltonian at a part of the duration of a collocation solution.
fn inputs_at(
    hamiltonian: &Hamiltonian,
    solution: &PhaseSolution,
    time_costate: &dyn Fn(f64) -> f64,
    fraction: f64,
) -> Vec<f64> {
    let [state, control, costate] = solution.at_fraction(fraction);
    let (n, m) = (hamiltonian.n, hamiltonian.m);
    let mut inputs = vec![0.0; 2 * n + m + 1];
    inputs[..state.len()].copy_from_slice(&state);
    inputs[state.len()..state.len() + solution.parameters.len()].copy_from_slice(&solution.parameters);
    inputs[n..n + costate.len()].copy_from_slice(&costate);
    if let Some(time) = hamiltonian.time {
        let (start, end) = solution.horizon();
        inputs[time] = start + fraction * (end - start);
        inputs[n + time] = time_costate(fraction);
    }
    for (i, (u, bounds)) in control.iter().zip(&hamiltonian.control_bounds).enumerate() {
        inputs[2 * n + i] = u.max(bounds.lower).min(bounds.upper);
    }
    inputs
}

/// A place where a bound of the state of order 2 is touched.
#[derive(Debug, Clone)]
struct Touch {
    fraction: f64,
    bound: usize,
    jump: f64,
}

/// Arcs as they are tried, with the parts of the duration that have passed at their ends.
#[derive(Debug, Clone)]
pub(super) struct Sketch {
    arcs: Vec<(ArcKind, f64, f64)>,
    touches: Vec<Touch>,
}

/// Labels of a collocation solution.
pub(super) struct Structure<'a> {
    labels: Labels<'a>,
    impulses: &'a Impulses,
    contacts: Vec<Contact>,
}

impl<'a> Structure<'a> {
    /// Labels, if arcs can be made of them.
    pub(super) fn try_new(
        hamiltonian: &Hamiltonian,
        solution: &'a PhaseSolution,
        impulses: &'a Impulses,
    ) -> Result<Self, Obstacle> {
        let labels = Labels { solution, places: solution.places(), mesh: solution.mesh().bounds() };
        let mut contacts = labels.contacts(hamiltonian, impulses)?;
        // where all controls that could hold the state are at bounds, these hold it
        contacts.retain(|contact| {
            let middle = 0.5 * (contact.start + contact.end);
            let held = |i: &usize| {
                let k = labels.mesh.partition_point(|&b| b <= middle).clamp(1, labels.n_intervals()) - 1;
                contact.end > contact.start && labels.at_bounds(*i, hamiltonian)[k].is_some()
            };
            !hamiltonian.bounds[contact.bound].controls.iter().all(held)
        });
        Ok(Self { labels, impulses, contacts })
    }

    /// Arcs as the labels have them.
    pub(super) fn sketch(&self, hamiltonian: &Hamiltonian) -> Sketch {
        let pieces: Vec<_> =
            (0..hamiltonian.m).map(|i| self.labels.pieces(i, hamiltonian, &self.contacts)).collect();
        let mut marks: Vec<f64> = pieces.iter().flatten().map(|piece| piece.start).collect();
        marks.extend(self.contacts.iter().flat_map(|contact| [contact.start, contact.end]));
        marks.retain(|&t| t > 0.0 && t < 1.0);
        marks.extend([0.0, 1.0]);
        marks.sort_by(f64::total_cmp);
        marks.dedup();
        let arc = |ends: &[f64]| {
            let middle = 0.5 * (ends[0] + ends[1]);
            let control = |pieces: &Vec<Piece<ControlKind>>| {
                let inside = pieces.iter().find(|piece| piece.start <= middle && middle < piece.end);
                inside.map_or(ControlKind::Interior, |piece| piece.what)
            };
            let contact = self.contacts.iter().find(|c| c.start <= middle && middle < c.end);
            let controls = pieces.iter().map(control).collect();
            (ArcKind { controls, contact: contact.map(|c| c.bound) }, ends[0], ends[1])
        };
        let touches = self.contacts.iter().filter(|c| c.start == c.end);
        Sketch {
            arcs: marks.windows(2).map(arc).collect(),
            touches: touches.map(|c| Touch { fraction: c.start, bound: c.bound, jump: c.jumps[0] }).collect(),
        }
    }

    /// How arcs join, and where their shooting starts, if that is known.
    pub(super) fn found(&self, hamiltonian: &mut Hamiltonian, sketch: &Sketch) -> Result<Found, Obstacle> {
        let solution = self.labels.solution;
        let (mut junctions, mut jumps) = (Vec::new(), Vec::new());
        if sketch.arcs.first().is_some_and(|(kind, ..)| kind.contact.is_some()) {
            return Err("a bound of the state holds from the start on".to_owned().into());
        }
        for pair in sketch.arcs.windows(2) {
            let ((before, ..), (after, from, to)) = (&pair[0], &pair[1]);
            let touch = sketch.touches.iter().find(|touch| touch.fraction == *from);
            let inputs = inputs_at(hamiltonian, solution, &|_| 0.0, *from);
            let grip = match after.contact.or(before.contact) {
                Some(bound) => hamiltonian.grip(bound, &inputs).map_err(|error| error.to_string())?,
                None => Vec::new(),
            };
            let junction = junction(hamiltonian, before, after, touch.map(|touch| touch.bound), &grip)?;
            let entered = self.contact(after, *from, *to);
            let pushes = touch
                .map(|touch| vec![touch.jump])
                .or_else(|| entered.map(|contact| contact.jumps.clone()))
                .unwrap_or_default();
            jumps.push(junction.jump.map_or(Vec::new(), |(_, count)| {
                (0..count).map(|k| pushes.get(k).copied().unwrap_or(0.0)).collect()
            }));
            junctions.push(junction);
        }
        let plan = Plan { arcs: sketch.arcs.clone(), junctions };
        check(hamiltonian, solution, &plan)?;
        let iterate = self.start(hamiltonian, &plan, jumps);
        Ok(Found { plan, iterate })
    }

    /// The contact that an arc is made of.
    fn contact(&self, kind: &ArcKind, from: f64, to: f64) -> Option<&Contact> {
        let middle = 0.5 * (from + to);
        let of_bound = self.contacts.iter().filter(|contact| Some(contact.bound) == kind.contact);
        of_bound.min_by(|a, b| {
            let distance = |c: &Contact| (0.5 * (c.start + c.end) - middle).abs();
            distance(a).total_cmp(&distance(b))
        })
    }
}

impl Sketch {
    /// The same without an arc that has vanished, between the times that shooting has found: a contact of order 2 becomes a touch.
    pub(super) fn without(
        &self,
        vanished: usize,
        durations: &[f64],
        hamiltonian: &Hamiltonian,
    ) -> Option<Self> {
        if self.arcs.len() < 2 {
            return None;
        }
        let whole: f64 = durations.iter().sum();
        let (mut arcs, mut passed): (Vec<(ArcKind, f64, f64)>, f64) = (Vec::new(), 0.0);
        let mut touches = Vec::new();
        for (k, (kind, start, _)) in self.arcs.iter().enumerate() {
            let from = passed / whole;
            touches.extend(
                self.touches
                    .iter()
                    .filter(|t| t.fraction == *start)
                    .map(|t| Touch { fraction: from, ..t.clone() }),
            );
            if k == vanished {
                if let Some(bound) = kind.contact
                    && hamiltonian.bounds[bound].order() == MOST_ORDER
                {
                    touches.push(Touch { fraction: from, bound, jump: 0.0 });
                }
                continue;
            }
            passed += durations[k];
            let (from, to) = (arcs.last().map_or(0.0, |arc| arc.2), passed / whole);
            match arcs.last_mut() {
                Some((before, _, end)) if before == kind && !touches.iter().any(|t| t.fraction == from) => {
                    *end = to
                }
                Some(_) | None => arcs.push((kind.clone(), from, to)),
            }
        }
        arcs.last_mut()?.2 = 1.0;
        Some(Self { arcs, touches })
    }
}

/// Whether all arcs are of kinds that are known.
fn check(hamiltonian: &mut Hamiltonian, solution: &PhaseSolution, plan: &Plan) -> Result<(), Obstacle> {
    for (kind, start, end) in &plan.arcs {
        let free = kind.controls.iter().filter(|control| !control.is_at_bound()).count();
        let Some(singular) = kind.controls.iter().position(|&control| control == ControlKind::Singular)
        else {
            continue;
        };
        let (t0, t1) = (solution.horizon().0, solution.horizon().1);
        let times = format!("between {:.4} and {:.4}", t0 + start * (t1 - t0), t0 + end * (t1 - t0));
        if free > 1 || kind.contact.is_some() {
            return Err(format!(
                "control {singular} is singular {times} while another one is not at a bound either; such arcs are not polished"
            )
            .into());
        }
        let samples: Vec<_> =
            (1..8).map(|k| solution.at_fraction(start + (end - start) * f64::from(k) / 8.0)).collect();
        let places = hamiltonian.places_near(&samples, &solution.parameters, t0);
        let size = hamiltonian.second_order(singular, &places).map_err(|error| error.to_string())?;
        if size < 1e-9 {
            return Err(Obstacle::lasting(format!(
                "control {singular} is singular of order 2 or more {times}: it does not appear in the second derivative of the \
                 switching function, and junctions of such an arc chatter"
            )));
        }
    }
    Ok(())
}

impl Structure<'_> {
    /// Numbers of the collocation solution at the nodes of the arcs.
    fn start(&self, hamiltonian: &Hamiltonian, plan: &Plan, jumps: Vec<Vec<f64>>) -> Iterate {
        let Self { labels, impulses, .. } = self;
        let solution = labels.solution;
        let (n, m) = (hamiltonian.n, hamiltonian.m);
        let horizon = solution.horizon();
        let duration = horizon.1 - horizon.0;
        // λ_t = −H
        let points = labels.places.len();
        let time_costate = |fraction: f64| {
            let k = labels.places.partition_point(|(f, _)| *f <= fraction).clamp(1, points) - 1;
            -solution.hamiltonian[k]
        };
        let (mut nodes, mut guesses, mut durations) = (Vec::new(), Vec::new(), Vec::new());
        for (kind, from, to) in &plan.arcs {
            let segments = n_segments(to - from);
            durations.push((to - from) * duration);
            let (mut arc_nodes, mut arc_guesses) = (Vec::new(), Vec::new());
            for s in 0..=segments {
                let fraction = from + (to - from) * s as f64 / segments as f64;
                // controls just within the arc
                let inside = fraction.clamp(from + 0.01 * (to - from), to - 0.01 * (to - from));
                let mut point = inputs_at(hamiltonian, solution, &time_costate, fraction);
                let mut guess = inputs_at(hamiltonian, solution, &time_costate, inside).split_off(2 * n);
                let contact = kind.contact.and_then(|_| self.contact(kind, *from, *to));
                if let Some(contact) = contact {
                    lift(hamiltonian, impulses, labels, contact, fraction, duration, &mut point, &mut guess);
                }
                point.truncate(2 * n);
                guess.truncate(m + 1);
                arc_nodes.push(point);
                arc_guesses.push(guess);
            }
            nodes.push(arc_nodes);
            guesses.push(arc_guesses);
        }
        Iterate { start: horizon.0, durations, nodes, guesses, jumps, multipliers: Vec::new() }
    }
}

/// Turns costates of collocation, which a multiplier of c pushes along the whole contact, into those that jump at its start:
/// λ − μ̄₁ c_x − μ̄₂ ċ_x with μ̄_k = ∫_t (s − t)^(k−1) μ ds.
fn lift(
    hamiltonian: &Hamiltonian,
    impulses: &Impulses,
    labels: &Labels<'_>,
    contact: &Contact,
    fraction: f64,
    duration: f64,
    point: &mut [f64],
    guess: &mut [f64],
) {
    let bound = &hamiltonian.bounds[contact.bound];
    let sign = if bound.is_upper { 1.0 } else { -1.0 };
    let push = |i: usize| match bound.row {
        BoundedRow::State(s) => sign * impulses.states[i][s],
        BoundedRow::Path(p) => sign * impulses.path[i][p],
    };
    let later: Vec<usize> = (0..labels.places.len())
        .filter(|&i| labels.places[i].0 >= fraction && labels.places[i].0 <= contact.end + 1e-12)
        .collect();
    let rest = [
        later.iter().map(|&i| push(i)).sum::<f64>(),
        later.iter().map(|&i| push(i) * (labels.places[i].0 - fraction) * duration).sum::<f64>(),
    ];
    if let Some(gradients) = hamiltonian.bound_gradients_at(contact.bound, point) {
        for (d, gradient) in gradients.iter().enumerate() {
            for (i, c) in gradient.iter().enumerate() {
                point[hamiltonian.n + i] -= rest[d] * c;
            }
        }
    }
    guess[hamiltonian.m] = rest[bound.order() - 1];
}
