//! The step of one SQP iteration.
//!
//! 1. Newton's step on the working set of the last iteration: the quadratic model with its true Hessian, shifted
//!    only as far as the null space of the set needs to be convex, constraints of the set as equalities. Rows are
//!    exchanged a few times where bounds or signs of multipliers are violated (a primal–dual active set method,
//!    Hintermüller, Ito & Kunisch 2002). What passes both tests is a local solution of the quadratic program.
//! 2. Else clarabel solves the program with its Hessian shifted until it is convex everywhere, and step 1 is
//!    tried with the rows that are active there (as in SQP+, Morales, Nocedal & Wu 2012), and then the primal active-set
//!    method from there. Where the shift is not zero it hides what bounds alone hold in place, such as a control that
//!    switches between its own: before that, rows come from a model that is nearly linear.
//! 3. Where rows hardly differ, as conditions at both ends do that an invariant of the equations of motion joins, exact steps
//!    have huge multipliers: then Newton's step is stabilised, J p − ε (y − y₀) = d with the multipliers y₀
//!    of the last iteration (Wright 1998; Gill & Robinson 2013), and meets all rows but for what makes them contradict each other.
//! 4. Where the linearised constraints contradict each other beyond that, or can be met only with huge multipliers, the
//!    elastic program with weight ρ has a solution.

mod restoration;

use crate::error::SolverError;
use crate::hessian::Hessian;
use crate::kkt::{Activity, Kkt};
use crate::nlp::{Pattern, Structure};
use crate::program::{Point, Program, is_past, max_norm};
use crate::quadratic::{Outcome, Quadratic, QuadraticSolver};
use std::time::Instant;

/// Exchanges of working sets before the interior-point method is asked.
const EXCHANGES: usize = 6;
/// Multipliers that are not trusted, relative to ‖∇f‖∞ (Gill, Murray & Saunders 2005 take the same).
const HUGE_MULTIPLIER: f64 = 1e4;
/// Sum of violations at which rows may contradict each other, and one that counts as zero.
const LITTLE: f64 = 1e-5;
const NOTHING: f64 = 1e-9;
/// Multiple of the last multipliers beyond which those of a step jump.
const JUMP: f64 = 2.0;
/// Exchanges of one row at a time, after clarabel.
const SINGLE_EXCHANGES: usize = 100;
/// Shift, relative to ‖H‖, that may hide what bounds hold.
const HIDING: f64 = 1e-2;
/// Multiple of the unit matrix, relative to ‖H‖, in a model that is to tell what bounds alone hold.
const FLAT: f64 = 1e-6;
/// Elastic weight at first, relative to ‖∇f‖∞, and at last.
const FIRST_WEIGHT: f64 = 10.0;
const LAST_WEIGHT: f64 = 1e8;

/// Those of δ that are tried, see [`Kkt`], where no row can be exchanged. Where rows can be, an inaccurate solve asks the interior-point method.
const REGULARISATIONS: [f64; 2] = [1e-9, 1e-7];

/// Where a step comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Origin {
    /// The working set; a second-order correction is possible.
    WorkingSet,
    /// The convex program, or the working set with rows that are met as far as their multipliers need not be huge.
    Convex,
    /// The elastic program.
    Elastic,
    /// Nowhere: exchanging rows has not found it, and no quadratic program was to be solved.
    Deferred,
}

/// Step, multipliers and everything needed to compute them.
pub(crate) struct Subproblem {
    structure: Structure,
    hessian_pattern: Pattern,
    kkt: Kkt,
    convex: Option<QuadraticSolver>,
    elastic: Option<QuadraticSolver>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    targets: Vec<f64>,
    trial_set: Vec<Activity>,
    /// The working set of the last iteration.
    last_set: Vec<Activity>,
    empty_set: Vec<Activity>,
    no_hessian: Vec<f64>,
    /// Interior-point solves after which a step is not computed where exchanging rows does not find it.
    pub(crate) most_quadratic_programs: usize,
    /// When no step is computed any more.
    pub(crate) deadline: Option<Instant>,
    /// What clarabel found, while a better step is tried.
    convex_p: Vec<f64>,
    convex_y: Vec<f64>,
    /// Where the active-set method is.
    feasible_p: Vec<f64>,
    feasible_jp: Vec<f64>,
    last_shift: f64,
    /// Step.
    pub(crate) p: Vec<f64>,
    /// J p.
    pub(crate) jp: Vec<f64>,
    /// Multipliers of bounds, then of constraints.
    pub(crate) y: Vec<f64>,
    /// The working set.
    pub(crate) active: Vec<Activity>,
    /// Multiple of the unit matrix in the model.
    pub(crate) shift: f64,
    /// pᵀ H p of the model without shift.
    pub(crate) curvature: f64,
    /// Weight of the elastic mode.
    pub(crate) weight: f64,
    /// Sum of violations that the linearised constraints leave.
    pub(crate) left_violation: f64,
    /// Interior-point solves so far.
    pub(crate) n_quadratic_programs: usize,
}

impl Subproblem {
    pub(crate) fn try_new(program: &Program<'_>, hessian: &Hessian) -> Result<Self, SolverError> {
        let (n, m) = (program.n_variables(), program.n_constraints());
        let structure = program.structure.clone();
        let Structure { variables, constraints, jacobian, .. } = &structure;
        let is_never_exchanged = |(lower, upper): (&f64, &f64)| {
            lower == upper || *lower == f64::NEG_INFINITY && *upper == f64::INFINITY
        };
        let has_one_set = [variables, constraints]
            .iter()
            .all(|bounds| bounds.lower.iter().zip(&bounds.upper).all(is_never_exchanged));
        let kkt = Kkt::try_new(&hessian.pattern, jacobian)?;
        Ok(Self {
            kkt: if has_one_set { kkt.with_regularisations(&REGULARISATIONS) } else { kkt },
            hessian_pattern: hessian.pattern.clone(),
            convex: None,
            elastic: None,
            lower: vec![0.0; n + m],
            upper: vec![0.0; n + m],
            targets: vec![0.0; n + m],
            trial_set: vec![Activity::Free; n + m],
            last_set: vec![Activity::Free; n + m],
            empty_set: vec![Activity::Free; n + m],
            no_hessian: vec![0.0; hessian.pattern.n_entries()],
            most_quadratic_programs: usize::MAX,
            deadline: None,
            convex_p: vec![0.0; n],
            convex_y: vec![0.0; n + m],
            feasible_p: vec![0.0; n],
            feasible_jp: vec![0.0; m],
            last_shift: 0.0,
            p: vec![0.0; n],
            jp: vec![0.0; m],
            y: vec![0.0; n + m],
            active: vec![Activity::Free; n + m],
            shift: 0.0,
            curvature: 0.0,
            weight: 0.0,
            left_violation: 0.0,
            n_quadratic_programs: 0,
            structure,
        })
    }

    pub(crate) fn n_factorisations(&self) -> usize {
        self.kkt.n_factorisations()
    }

    /// Bounds on the step and on the change of the constraints.
    fn set_bounds(&mut self, point: &Point) {
        let Structure { variables, constraints, .. } = &self.structure;
        let n = point.z.len();
        for (i, &z) in point.z.iter().enumerate() {
            self.lower[i] = variables.lower[i] - z;
            self.upper[i] = variables.upper[i] - z;
        }
        for (i, &c) in point.constraints.iter().enumerate() {
            self.lower[n + i] = constraints.lower[i] - c;
            self.upper[n + i] = constraints.upper[i] - c;
        }
    }

    /// Working set from multipliers of the constraints: equalities, and bounds that are nearer, relative to the largest
    /// multiplier, than the multiplier that points to them is large. Those of the bounds of z follow from the others.
    pub(crate) fn guess_set(&mut self, point: &Point, y: &[f64]) {
        self.set_bounds(point);
        let n = point.z.len();
        self.y[..n].copy_from_slice(&point.gradient);
        self.structure.jacobian.add_transposed_product(&point.jacobian, y, &mut self.y[..n]);
        self.y[..n].iter_mut().for_each(|slope| *slope = -*slope);
        self.y[n..].copy_from_slice(y);
        let size = max_norm(y).max(1.0);
        for i in 0..self.active.len() {
            let (lower, upper, multiplier) = (self.lower[i], self.upper[i], self.y[i]);
            self.active[i] = if lower == upper {
                Activity::Equal
            } else if multiplier > size * upper.abs() {
                Activity::Upper
            } else if -multiplier > size * lower.abs() {
                Activity::Lower
            } else {
                Activity::Free
            };
        }
    }

    /// Least-squares multipliers of the equalities, zero where they would be large.
    pub(crate) fn estimate_multipliers(&mut self, point: &Point, y: &mut [f64]) {
        self.set_bounds(point);
        for i in 0..self.active.len() {
            self.active[i] = if self.lower[i] == self.upper[i] { Activity::Equal } else { Activity::Free };
        }
        self.targets.fill(0.0);
        let zero = vec![0.0; self.hessian_pattern.n_entries()];
        let n = point.z.len();
        y.fill(0.0);
        self.p.fill(0.0);
        self.y.fill(0.0);
        if self.kkt.factor(&zero, 1.0, &point.jacobian, &self.active)
            && self.kkt.solve(&point.gradient, &self.targets, &mut self.p, &mut self.y)
            && max_norm(&self.y[n..]) < 1e3
        {
            y.copy_from_slice(&self.y[n..]);
        }
    }

    /// The step at a point with the multipliers `y`; `floor` is the least shift. None if no step can be computed.
    pub(crate) fn solve(
        &mut self,
        point: &Point,
        hessian: &Hessian,
        y: &[f64],
        floor: f64,
        violation: f64,
    ) -> Option<Origin> {
        self.set_bounds(point);
        let n = point.z.len();
        let slope = max_norm(&point.gradient).max(1.0);
        self.weight = self.weight.max(FIRST_WEIGHT * slope);
        self.last_set.copy_from_slice(&self.active);
        self.trial_set.copy_from_slice(&self.active);
        self.p.fill(0.0);
        self.y.fill(0.0);
        let is_tolerable = |y: &[f64]| max_norm(y) <= HUGE_MULTIPLIER * slope;
        // what is left of the violation may be that of equations which contradict each other by as little
        let is_nearly_feasible = violation <= LITTLE
            && self.active[n..].iter().all(|row| matches!(row, Activity::Equal | Activity::Free));
        let jumps = |own: &Self| max_norm(&own.y[n..]) > JUMP * max_norm(y).max(slope);
        let mut origin = self.newton(point, hessian, floor, EXCHANGES).then_some(Origin::WorkingSet);
        if is_nearly_feasible && origin.is_some() && jumps(self) {
            origin = if self.stabilised(point, hessian, y, floor, violation) {
                Some(Origin::Convex)
            } else {
                self.trial_set.copy_from_slice(&self.last_set);
                self.p.fill(0.0);
                self.y.fill(0.0);
                self.newton(point, hessian, floor, EXCHANGES).then_some(Origin::WorkingSet)
            };
        }
        if origin.is_none() && self.n_quadratic_programs >= self.most_quadratic_programs {
            self.active.copy_from_slice(&self.last_set);
            return Some(Origin::Deferred);
        }
        origin = origin.or_else(|| self.convex(point, hessian, floor));
        if origin.is_none() || violation > 0.0 && !is_tolerable(&self.y[n..]) {
            origin = self.elastic(point, hessian, floor, violation);
        }
        self.measure(point, hessian);
        origin
    }

    /// Newton's step from the working set of the last iteration, whose rows are met as far as multipliers stay near `y`. True if its
    /// set is the right one, its rows are met but for little, and multipliers do not jump.
    fn stabilised(
        &mut self,
        point: &Point,
        hessian: &Hessian,
        y: &[f64],
        floor: f64,
        violation: f64,
    ) -> bool {
        let n = point.z.len();
        self.trial_set.copy_from_slice(&self.last_set);
        let is_solved = self.exchanged(point, hessian, floor, EXCHANGES, |own| {
            own.p.fill(0.0);
            own.y[..n].fill(0.0);
            own.y[n..].copy_from_slice(y);
            own.kkt.solve_near(&point.gradient, &own.targets, &mut own.p, &mut own.y)
        });
        if !is_solved {
            return false;
        }
        self.measure(point, hessian);
        let largest = max_norm(y).max(max_norm(&point.gradient)).max(1.0);
        self.left_violation <= violation.max(NOTHING) && max_norm(&self.y[n..]) <= JUMP * largest
    }

    /// Newton's step on the set in `trial_set`, with exchanges. True if it solves the quadratic program.
    fn newton(&mut self, point: &Point, hessian: &Hessian, floor: f64, exchanges: usize) -> bool {
        self.exchanged(point, hessian, floor, exchanges, |own| {
            own.kkt.solve(&point.gradient, &own.targets, &mut own.p, &mut own.y)
        })
    }

    /// Solves on the set in `trial_set` by factors that are ready, and exchanges rows until none is to be. False if there is no solution, or
    /// no end.
    fn exchanged(
        &mut self,
        point: &Point,
        hessian: &Hessian,
        floor: f64,
        exchanges: usize,
        solve: impl Fn(&mut Self) -> bool,
    ) -> bool {
        let mut shift = floor;
        for _ in 0..=exchanges {
            self.set_targets();
            if !self.factor_convex(point, hessian, &mut shift, true) || !solve(self) {
                return false;
            }
            if !self.exchange(point) {
                self.shift = shift;
                self.active.copy_from_slice(&self.trial_set);
                return true;
            }
        }
        false
    }

    /// Raises the shift until the Hessian is positive definite, on the null space of `trial_set` or everywhere.
    fn factor_convex(&mut self, point: &Point, hessian: &Hessian, shift: &mut f64, on_set: bool) -> bool {
        let set = if on_set { &self.trial_set } else { &self.empty_set };
        let size = match max_norm(&hessian.values) {
            0.0 => 1.0,
            size => size,
        };
        let mut factor = if self.last_shift == 0.0 { 100.0 } else { 8.0 };
        let floor = *shift;
        while !self.kkt.factor(&hessian.values, *shift, &point.jacobian, set) {
            if is_past(self.deadline) {
                return false;
            }
            *shift = if *shift == floor && floor < self.last_shift.max(1e-4 * size) {
                if self.last_shift == 0.0 {
                    1e-4 * size
                } else {
                    (self.last_shift / 3.0).max(1e-20 * size).max(2.0 * floor)
                }
            } else {
                let next = *shift * factor;
                factor = 8.0;
                next
            };
            if *shift > 1e10 * size {
                return false;
            }
        }
        if *shift > floor {
            self.last_shift = *shift;
        }
        true
    }

    /// Takes violated rows into the set and those with multipliers of the wrong sign out of it. Whether any.
    fn exchange(&mut self, point: &Point) -> bool {
        let n = point.z.len();
        self.jp.fill(0.0);
        self.structure.jacobian.add_product(&point.jacobian, &self.p, &mut self.jp);
        let sign_tolerance = self.sign_tolerance(point);
        let reach = max_norm(&self.p);
        let mut changed = false;
        for i in 0..self.trial_set.len() {
            let value = if i < n { self.p[i] } else { self.jp[i - n] };
            let tolerance = row_tolerance(reach, value);
            let next = match self.trial_set[i] {
                Activity::Free if value > self.upper[i] + tolerance => Activity::Upper,
                Activity::Free if value < self.lower[i] - tolerance => Activity::Lower,
                Activity::Lower if self.y[i] > sign_tolerance => Activity::Free,
                Activity::Upper if self.y[i] < -sign_tolerance => Activity::Free,
                same => same,
            };
            changed |= next != self.trial_set[i];
            self.trial_set[i] = next;
        }
        changed
    }

    fn convex(&mut self, point: &Point, hessian: &Hessian, floor: f64) -> Option<Origin> {
        let mut shift = floor;
        if !self.factor_convex(point, hessian, &mut shift, false) {
            return None;
        }
        // A large shift hides what bounds alone hold in place, as they do a control that switches between its own.
        let size = max_norm(&hessian.values);
        if shift > floor.max(HIDING * size) {
            let flat = std::mem::take(&mut self.no_hessian);
            let is_solved = self.interior_point(point, &flat, FLAT * size);
            self.no_hessian = flat;
            if is_solved && self.newton_on_found(point, hessian, floor) {
                return Some(Origin::WorkingSet);
            }
        }
        if !self.interior_point(point, &hessian.values, shift) {
            return None;
        }
        self.shift = shift;
        self.convex_p.copy_from_slice(&self.p);
        self.convex_y.copy_from_slice(&self.y);
        if self.newton_on_found(point, hessian, floor) || self.settle(point, hessian, floor) {
            return Some(Origin::WorkingSet);
        }
        self.shift = shift;
        self.p.copy_from_slice(&self.convex_p);
        self.y.copy_from_slice(&self.convex_y);
        Some(Origin::Convex)
    }

    /// Leaves step, multipliers and set of clarabel for the model with these values and shift.
    fn interior_point(&mut self, point: &Point, hessian: &[f64], shift: f64) -> bool {
        let solver = self.convex.get_or_insert_with(|| {
            let Structure { variables, constraints, jacobian, .. } = &self.structure;
            QuadraticSolver::new(&self.hessian_pattern, jacobian, variables, constraints, false)
        });
        let data = Quadratic {
            gradient: &point.gradient,
            hessian,
            shift,
            jacobian: &point.jacobian,
            lower: &self.lower,
            upper: &self.upper,
            deadline: self.deadline,
        };
        self.n_quadratic_programs += 1;
        solver.solve(&data, 0.0, &mut self.p, &mut self.y, &mut self.active) == Outcome::Solved
    }

    /// Newton's step on the set that clarabel found.
    fn newton_on_found(&mut self, point: &Point, hessian: &Hessian, floor: f64) -> bool {
        self.trial_set.copy_from_slice(&self.active);
        self.newton(point, hessian, floor, 2)
    }

    /// The primal active-set method (Nocedal & Wright 2006, algorithm 16.3) from what clarabel found: one exchange at a time,
    /// which ends also where many rows hardly push and exchanging all of them at once goes in circles.
    fn settle(&mut self, point: &Point, hessian: &Hessian, floor: f64) -> bool {
        let n = point.z.len();
        let mut shift = floor;
        self.trial_set.copy_from_slice(&self.active);
        self.feasible_p.copy_from_slice(&self.convex_p);
        self.y.copy_from_slice(&self.convex_y);
        for _ in 0..SINGLE_EXCHANGES {
            self.set_targets();
            if !self.factor_convex(point, hessian, &mut shift, true)
                || !self.kkt.solve(&point.gradient, &self.targets, &mut self.p, &mut self.y)
            {
                return false;
            }
            self.jp.fill(0.0);
            self.structure.jacobian.add_product(&point.jacobian, &self.p, &mut self.jp);
            self.feasible_jp.fill(0.0);
            self.structure.jacobian.add_product(&point.jacobian, &self.feasible_p, &mut self.feasible_jp);
            let reach = max_norm(&self.p);
            let (mut length, mut blocking) = (1.0, None);
            for i in (0..self.trial_set.len()).filter(|i| self.trial_set[*i] == Activity::Free) {
                let (from, to) = if i < n {
                    (self.feasible_p[i], self.p[i])
                } else {
                    (self.feasible_jp[i - n], self.jp[i - n])
                };
                let tolerance = row_tolerance(reach, to);
                for (bound, side) in [(self.upper[i], Activity::Upper), (self.lower[i], Activity::Lower)] {
                    let beyond = if side == Activity::Upper { to - bound } else { bound - to };
                    let fraction = ((bound - from) / (to - from)).max(0.0);
                    if beyond > tolerance && fraction < length {
                        (length, blocking) = (fraction, Some((i, side)));
                    }
                }
            }
            for (feasible, p) in self.feasible_p.iter_mut().zip(&self.p) {
                *feasible += length * (p - *feasible);
            }
            if let Some((i, side)) = blocking {
                self.trial_set[i] = side;
                continue;
            }
            let allowed = self.sign_tolerance(point);
            let wrong = |i: &usize| match self.trial_set[*i] {
                Activity::Lower => self.y[*i],
                Activity::Upper => -self.y[*i],
                Activity::Free | Activity::Equal => 0.0,
            };
            let worst = (0..self.trial_set.len()).max_by(|a, b| wrong(a).total_cmp(&wrong(b)));
            match worst.filter(|i| wrong(i) > allowed) {
                Some(i) => self.trial_set[i] = Activity::Free,
                None => {
                    self.shift = shift;
                    self.active.copy_from_slice(&self.trial_set);
                    return true;
                }
            }
        }
        false
    }

    /// Multiplier of the wrong sign that counts as zero.
    fn sign_tolerance(&self, point: &Point) -> f64 {
        1e-10 * max_norm(&self.y).max(max_norm(&point.gradient))
    }

    /// Raises the weight until the step reduces the violation, or no weight does.
    fn elastic(&mut self, point: &Point, hessian: &Hessian, floor: f64, violation: f64) -> Option<Origin> {
        let mut shift = floor;
        if !self.factor_convex(point, hessian, &mut shift, false) {
            return None;
        }
        self.shift = shift;
        loop {
            let solver = self.elastic.get_or_insert_with(|| {
                let Structure { variables, constraints, jacobian, .. } = &self.structure;
                QuadraticSolver::new(&self.hessian_pattern, jacobian, variables, constraints, true)
            });
            let data = Quadratic {
                gradient: &point.gradient,
                hessian: &hessian.values,
                shift,
                jacobian: &point.jacobian,
                lower: &self.lower,
                upper: &self.upper,
                deadline: self.deadline,
            };
            self.n_quadratic_programs += 1;
            if solver.solve(&data, self.weight, &mut self.p, &mut self.y, &mut self.active) != Outcome::Solved
            {
                return None;
            }
            self.measure(point, hessian);
            if self.left_violation <= 0.9 * violation || self.weight >= LAST_WEIGHT {
                return Some(Origin::Elastic);
            }
            self.weight *= 10.0;
        }
    }

    fn set_targets(&mut self) {
        for (i, activity) in self.trial_set.iter().enumerate() {
            self.targets[i] = match activity {
                Activity::Free => 0.0,
                Activity::Lower => self.lower[i],
                Activity::Upper | Activity::Equal => self.upper[i],
            };
        }
    }

    /// J p, pᵀ H p and the violation that is left.
    fn measure(&mut self, point: &Point, hessian: &Hessian) {
        let n = point.z.len();
        self.jp.fill(0.0);
        self.structure.jacobian.add_product(&point.jacobian, &self.p, &mut self.jp);
        self.left_violation = (0..self.jp.len())
            .map(|i| (self.lower[n + i] - self.jp[i]).max(self.jp[i] - self.upper[n + i]).max(0.0))
            .sum();
        self.curvature = hessian
            .pattern
            .entries()
            .map(|(k, i, j)| {
                let twice = if i == j { 1.0 } else { 2.0 };
                twice * hessian.values[k] * self.p[i] * self.p[j]
            })
            .sum();
    }

    /// The step on the working set for constraints as they are at the end of the step, linearised where it
    /// begins (Nocedal & Wright 2006, section 18.3). Overwrites p and y.
    pub(crate) fn correct(&mut self, point: &Point, trial: &Point) -> bool {
        let n = point.z.len();
        let constraints = &self.structure.constraints;
        for i in 0..self.jp.len() {
            let bound = match self.active[n + i] {
                Activity::Free => continue,
                Activity::Lower => constraints.lower[i],
                Activity::Upper | Activity::Equal => constraints.upper[i],
            };
            self.targets[n + i] = bound - trial.constraints[i] + self.jp[i];
        }
        self.p.fill(0.0);
        self.y.fill(0.0);
        if !self.kkt.solve(&point.gradient, &self.targets, &mut self.p, &mut self.y) {
            return false;
        }
        for i in 0..n {
            self.p[i] = self.p[i].max(self.lower[i]).min(self.upper[i]);
        }
        true
    }

    /// Stationarity of the violation, relative to the Jacobian: ‖Jᵀ y‖∞ / ‖y‖∞ without what bounds hold, where y
    /// are elastic multipliers that mark violated constraints.
    pub(crate) fn infeasibility_stationarity(&self, program: &Program<'_>, point: &Point) -> f64 {
        let n = point.z.len();
        let y = &self.y[n..];
        let size = max_norm(y);
        let marked: f64 = (0..y.len())
            .map(|i| y[i] / size * (-self.upper[n + i]).max(0.0) - y[i] / size * self.lower[n + i].max(0.0))
            .sum();
        if size == 0.0 || marked < 0.5 * program.violation(&point.constraints) {
            return f64::INFINITY;
        }
        let mut slope = vec![0.0; n];
        self.structure.jacobian.add_transposed_product(&point.jacobian, y, &mut slope);
        let held =
            |i: usize| (slope[i] > 0.0 && self.lower[i] > -1e-8) || (slope[i] < 0.0 && self.upper[i] < 1e-8);
        (0..n).filter(|&i| !held(i)).fold(0.0, |s: f64, i| s.max(slope[i].abs())) / size
    }
}

/// Excess of a row that counts as none, in a step that is `reach` long.
fn row_tolerance(reach: f64, value: f64) -> f64 {
    1e-10 * reach.min(1.0).max(value.abs()).max(1e-2)
}
