//! Steps that end where a field goes from one smooth piece to the next.
//!
//! A step stays in the piece that it began in. The margins of the piece are guards, and the first of them to change its sign
//! is found as any other event is ([`EventSearch`]): the step is made again in parts, so that a crossing has the accuracy of
//! any other point. The search steps the state alone, and is compiled once for all systems.

use super::rows::{ANY, combine};
use super::{Kernel, STAGES};
use crate::flow::FlowError;
use crate::system::{Piece, VectorField};
use somersault_integrators::events::{EventSearch, Guard, Retrace, Trail};
use somersault_integrators::tableau::Tableau;

/// The margins of the piece that a motion is in.
pub(super) struct Watch {
    seen: Seen,
    scratch: WatchScratch,
}

/// What has been seen of the margins.
struct Seen {
    /// Where the motion is.
    here: Vec<Guard>,
    /// At the end of the step that is looked at.
    then: Vec<Guard>,
    trail: Trail<Vec<Guard>>,
}

/// What margins are made of.
struct WatchScratch {
    /// At a point, ahead of it and behind it.
    margins: [Vec<f64>; 3],
    beside: Vec<f64>,
    point: Vec<f64>,
    /// At the point.
    slope: Vec<f64>,
    /// Those of the stages.
    slopes: Vec<f64>,
}

impl Watch {
    /// For a number of switches; where there are none, without any room.
    pub(super) fn new(switches: usize, dimension: usize) -> Self {
        let n = if switches > 0 { dimension } else { 0 };
        let guards = || vec![Guard::default(); switches];
        let zeros = |size: usize| vec![0.0; size];
        let seen = Seen { here: guards(), then: guards(), trail: Trail::new(guards()) };
        let margins = [zeros(switches), zeros(switches), zeros(switches)];
        let (beside, point, slope, slopes) = (zeros(n), zeros(n), zeros(n), zeros(STAGES * n));
        Self { seen, scratch: WatchScratch { margins, beside, point, slope, slopes } }
    }

    /// The step that was looked at last is made.
    pub(super) fn arrive(&mut self) {
        std::mem::swap(&mut self.seen.here, &mut self.seen.then);
    }
}

/// What a search asks of a field, and so all that is compiled of it for the search.
trait Pieces {
    fn field_in(&self, piece: &Piece, p: &[f64], h: &mut [f64]);
    fn margins_into(&self, piece: &Piece, p: &[f64], margins: &mut [f64]);
}

impl<S: VectorField> Pieces for S {
    fn field_in(&self, piece: &Piece, p: &[f64], h: &mut [f64]) {
        VectorField::field_in(self, piece, p, h);
    }

    fn margins_into(&self, piece: &Piece, p: &[f64], margins: &mut [f64]) {
        VectorField::margins_into(self, piece, p, margins);
    }
}

/// The state alone of a step, to be made again in any part.
struct StateStep<'a> {
    system: &'a dyn Pieces,
    piece: &'a Piece,
    tableau: &'static Tableau,
    t: f64,
    state: &'a [f64],
    /// At the start.
    slope: &'a [f64],
    /// Where the step led as it was made.
    next: &'a [f64],
    /// With the sign of the direction.
    h: f64,
    scratch: &'a mut WatchScratch,
}

impl StateStep<'_> {
    /// The margins at the start. The piece holds there, whatever the last digits of a margin say.
    fn look_at_start(&mut self, guards: &mut [Guard]) {
        self.scratch.point.copy_from_slice(self.state);
        self.scratch.slope.copy_from_slice(self.slope);
        self.look(guards);
        guards.iter_mut().for_each(|guard| guard.gap = guard.gap.max(f64::MIN_POSITIVE));
    }

    /// The margins at the end.
    fn look_at_end(&mut self, guards: &mut [Guard]) {
        self.scratch.point.copy_from_slice(self.next);
        self.look_along(guards);
    }

    /// The margins at the point in the scratch, whose slope is not known yet.
    fn look_along(&mut self, guards: &mut [Guard]) {
        let WatchScratch { point, slope, .. } = &mut *self.scratch;
        self.system.field_in(self.piece, point, slope);
        self.look(guards);
    }

    /// The margins at the point in the scratch and their rates, by central differences over 1e-5 of the step.
    fn look(&mut self, guards: &mut [Guard]) {
        let Self { system, piece, h, .. } = *self;
        let WatchScratch { margins: [here, ahead, behind], beside, point, slope, .. } = &mut *self.scratch;
        let mut look_beside = |reach: f64, margins: &mut [f64]| {
            let line = point.iter().zip(&*slope);
            beside.iter_mut().zip(line).for_each(|(q, (p, slope))| *q = p + slope * reach);
            system.margins_into(piece, beside, margins);
        };
        look_beside(1e-5 * h, ahead);
        look_beside(-1e-5 * h, behind);
        system.margins_into(piece, point, here);
        for (i, guard) in guards.iter_mut().enumerate() {
            // an infinite margin has no rate, and no cubic; where it is zero the piece holds
            let rate = if here[i].is_finite() { (ahead[i] - behind[i]) / (2e-5 * h.abs()) } else { 0.0 };
            let gap = if here[i] == 0.0 { f64::MIN_POSITIVE } else { here[i].min(f64::MAX) };
            *guard = Guard { gap, rate, lag: 0.0 };
        }
    }
}

impl Retrace for StateStep<'_> {
    type Point = Vec<Guard>;
    type Error = FlowError;

    fn guards(point: &Vec<Guard>) -> &[Guard] {
        point
    }

    fn room(&mut self) -> Vec<Guard> {
        vec![Guard::default(); self.scratch.margins[0].len()]
    }

    fn make(&mut self, size: f64, out: &mut Vec<Guard>) -> Result<(), FlowError> {
        let (n, h) = (self.state.len(), size.copysign(self.h));
        let WatchScratch { point, slopes, .. } = &mut *self.scratch;
        slopes[..n].copy_from_slice(self.slope);
        for i in 1..STAGES {
            combine::<pulp::Scalar, ANY>(Some(self.state), slopes, self.tableau.row(i), h, point);
            self.system.field_in(self.piece, point, &mut slopes[i * n..(i + 1) * n]);
        }
        combine::<pulp::Scalar, ANY>(Some(self.state), slopes, self.tableau.weights(), h, point);
        self.look_along(out);
        Ok(())
    }

    /// Never called: cubics, by which margins without bounds are judged, are doubted a few times only.
    fn unproved(&self, _h: f64, _parts: u32, _guard: usize) -> FlowError {
        FlowError::StepUnderflow { t: self.t, state: self.state.to_vec() }
    }
}

impl Seen {
    /// The part of a step that ends just beyond the end of the piece, if the piece ends in it.
    fn end_of_piece(&mut self, mut step: StateStep<'_>) -> Result<Option<f64>, FlowError> {
        let Self { here, then, trail } = self;
        step.look_at_end(then);
        let (t, h) = (step.t, step.h);
        let tolerance = 2.0 * f64::EPSILON * t.abs().max(h.abs());
        let mut search = EventSearch { step, trail, from: 0.0, before: here, graze: 0.0, tolerance };
        Ok(search.earliest(h.abs(), then)?.map(|size| size.copysign(h)))
    }
}

impl<S: VectorField, const MATRIX: bool> Kernel<'_, S, MATRIX> {
    /// Looks at the margins where the motion is.
    pub(super) fn watch_here(&mut self) {
        let (mut step, seen) = self.state_step(self.h);
        step.look_at_start(&mut seen.here);
    }

    /// The part of the step of `h` to `next` that ends just beyond the end of the piece, if the piece ends in it.
    // once, and not in the loops of every size
    #[inline(never)]
    pub(super) fn end_of_piece(&mut self, h: f64) -> Result<Option<f64>, FlowError> {
        let (step, seen) = self.state_step(h);
        seen.end_of_piece(step)
    }

    /// The state alone of the step of `h` from here, and what has been seen of the margins.
    fn state_step(&mut self, h: f64) -> (StateStep<'_>, &mut Seen) {
        let Watch { seen, scratch } = &mut self.watch;
        let (system, piece, t, x) = (self.system, &self.piece, self.t, &self.numbers);
        let (tableau, state, slope, next) = (x.tableau, &x.state, &x.slopes[..x.n], &x.next);
        (StateStep { system, piece, tableau, t, state, slope, next, h, scratch }, seen)
    }
}
