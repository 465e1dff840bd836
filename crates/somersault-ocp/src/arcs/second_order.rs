//! Conditions of second order.
//!
//! Where all controls are at bounds, durations of arcs and free initial states are all that can change: the Hessian of the Lagrangian
//! in them must be positive on the tangent space of the end conditions, and no switching function may touch zero but at a switch, with
//! a slope (Osmolovskii and Maurer, *Applications to Regular and Bang-Bang Control*, SIAM 2012). Where controls are continuous and
//! H_uu is positive on those that are not at bounds, no point before the end may be conjugate to the start, det ∂x(t)/∂λ₀ ≠ 0, and
//! what is left of the second variation at the end must be positive in the directions that are free there.
//!
//! Variations of an orientation are rotations about body axes, δq = ½ q θ, and those of its costate are covectors of these: of the four
//! numbers of each the part along q means nothing, and no motion depends on it ([`Directions`]).

use super::ends::EndValues;
use super::flow::follow;
use super::kind::ControlKind;
use super::samples::{SLACK, Sample};
use super::shooting::{Iterate, Shooting};
use super::verdict::Verdict;
use crate::collocation::{WIDTH, body_axes};
use nalgebra::{DMatrix, DVector, RowDVector};

/// Eigenvalues this small, relative to the matrix, are neither positive nor negative.
const FLAT: f64 = 1e-9;
/// Smallest part of a family's variations that states have where their determinant has a sign beyond rounding.
const CLEAR: f64 = 1e-9;
const UNCLEAR: &str = "next to an end the linearised equations do not reach all states clearly enough to exclude a conjugate point";
const UNREACHED: &str =
    "the linearised equations do not reach all states, so that conjugate points have no meaning";
/// Divisions of an interval around a conjugate point.
const DIVISIONS: usize = 60;
/// Part of its neighbours that the smallest singular value of the states has at the sample next to a point where it vanishes, at most:
/// a third where it is linear on both sides.
const DIP: f64 = 0.5;
/// The same part where it counts as zero.
const TOUCH: f64 = 1e-6;
/// Golden section.
const GOLDEN: f64 = 0.618_033_988_749_895;
const DIPPED: &str = "the linearised equations hardly reach some states on the way, so that a point may be conjugate to the end in two directions at once";

fn undecided(reason: &str) -> Verdict {
    Verdict::FirstOrder { reason: reason.to_owned() }
}

/// The verdict on an extremal.
pub(super) fn verdict(
    shooting: &mut Shooting<'_>,
    at: &Iterate,
    samples: &[Vec<Sample>],
    ends: &EndValues,
) -> Verdict {
    let kinds = || shooting.plan.arcs.iter().map(|(kind, ..)| kind);
    let controls = || kinds().flat_map(|kind| kind.controls.iter());
    if kinds().any(|kind| kind.contact.is_some()) || shooting.plan.junctions.iter().any(|j| j.jump.is_some())
    {
        return undecided("no test of second order is known here for motions along bounds of the state");
    }
    if controls().any(|control| *control == ControlKind::Singular) {
        return undecided("no test of second order is known here for singular arcs");
    }
    if shooting.ends.start.is_none() {
        return undecided("no test of second order is known here where the initial time is free");
    }
    if controls().all(|control| control.is_at_bound()) {
        return switching_times(shooting, at, samples, ends);
    }
    let jumps = |i: usize| {
        kinds().collect::<Vec<_>>().windows(2).any(|w| {
            let (a, b) = (w[0].controls[i], w[1].controls[i]);
            a != b && a.is_at_bound() && b.is_at_bound()
        })
    };
    if (0..shooting.hamiltonian.m).any(jumps) {
        return undecided(
            "no test of second order is known here where some controls jump and others are interior",
        );
    }
    conjugate_points(shooting, at, samples, ends)
}

/// A basis of what all rows map to zero.
fn null_space(rows: &DMatrix<f64>) -> DMatrix<f64> {
    let n = rows.ncols();
    if rows.nrows() == 0 {
        return DMatrix::identity(n, n);
    }
    // padded to a square, so that all right singular vectors are there
    let mut square = DMatrix::zeros(rows.nrows().max(n), n);
    for (i, row) in rows.row_iter().enumerate() {
        let size = row.norm();
        square.row_mut(i).copy_from(&if size > 0.0 { row / size } else { row.into_owned() });
    }
    let svd = square.svd(false, true);
    let Some(v) = svd.v_t else { return DMatrix::zeros(n, 0) };
    let free: Vec<usize> = (0..n).filter(|&k| svd.singular_values[k] < FLAT).collect();
    DMatrix::from_fn(n, free.len(), |i, k| v[(free[k], i)])
}

/// The verdict on a quadratic form on the tangent space of rows.
fn definiteness(form: &DMatrix<f64>, rows: &DMatrix<f64>, what: &str) -> Verdict {
    let basis = null_space(rows);
    if basis.ncols() == 0 {
        return Verdict::StrictMinimum;
    }
    let reduced = basis.transpose() * form * &basis;
    let symmetric = 0.5 * (&reduced + reduced.transpose());
    let (size, least) = (form.amax(), symmetric.symmetric_eigenvalues().min());
    if least > FLAT * size {
        Verdict::StrictMinimum
    } else if least < -SLACK * size {
        Verdict::NotMinimum { reason: format!("the cost falls to second order along {what}") }
    } else {
        undecided(&format!("to second order the cost is flat along {what}"))
    }
}

/// The Hessian in the durations of arcs, whose controls are all at bounds.
fn switching_times(
    shooting: &mut Shooting<'_>,
    at: &Iterate,
    samples: &[Vec<Sample>],
    ends: &EndValues,
) -> Verdict {
    let hamiltonian = shooting.hamiltonian;
    let (n, n_original) = (hamiltonian.n, hamiltonian.n_original);
    if hamiltonian.time.is_some() {
        return undecided("the test of switching times is for problems that do not name the time");
    }
    if let Err(reason) = strict_switches(shooting, samples) {
        return undecided(&reason);
    }
    let n_parameters = shooting.ends.parameters.len();
    let held = shooting.ends.initial.iter().chain(&shooting.ends.parameters);
    let free: Vec<usize> = held.enumerate().filter(|(_, held)| held.is_none()).map(|(i, _)| i).collect();
    let arcs = at.durations.len();
    let unknowns = free.len() + arcs;
    let duration = |k: usize| free.len() + k;
    // forward: variations of the states at the ends of arcs
    let mut dx = DMatrix::zeros(n, unknowns);
    free.iter().enumerate().for_each(|(c, &i)| dx[(i, c)] = 1.0);
    let (mut starts, mut finishes, mut transitions) = (Vec::new(), Vec::new(), Vec::new());
    for (k, arc) in samples.iter().enumerate() {
        let mut transition = DMatrix::identity(2 * n, 2 * n);
        arc.iter().for_each(|sample| transition = &sample.transition * &transition);
        starts.push(dx.clone());
        dx = transition.view((0, 0), (n, n)) * dx;
        if let Some(last) = arc.last() {
            (0..n).for_each(|i| dx[(i, duration(k))] += last.rates[i]);
        }
        finishes.push(dx.clone());
        transitions.push(transition);
    }
    // of the arguments of the end terms
    let n_arguments = ends.gradient.len();
    let mut arguments = DMatrix::zeros(n_arguments, unknowns);
    for i in 0..n_original {
        arguments.row_mut(i).copy_from(&starts[0].row(i));
        arguments.row_mut(n_original + i).copy_from(&dx.row(i));
    }
    for k in 0..n_parameters {
        arguments.row_mut(2 * n_original + k).copy_from(&starts[0].row(n_original + k));
    }
    (0..arcs).for_each(|k| arguments[(n_arguments - 1, duration(k))] = 1.0);
    let bent = &ends.hessian * &arguments;
    // back: of the costates, and the rows of the Hessian
    let mut form = DMatrix::zeros(unknowns, unknowns);
    let mut dl = DMatrix::zeros(n, unknowns);
    (0..n_original).for_each(|i| dl.row_mut(i).copy_from(&bent.row(n_original + i)));
    for k in (0..arcs).rev() {
        let Some(last) = samples[k].last() else { continue };
        let mut row = bent.row(n_arguments - 1).into_owned();
        for i in 0..n {
            row += last.rates[i] * dl.row(i) - last.rates[n + i] * finishes[k].row(i);
        }
        form.row_mut(duration(k)).copy_from(&row);
        let transition = &transitions[k];
        let mut right = &dl - transition.view((n, 0), (n, n)) * &starts[k];
        (0..n).for_each(|i| right[(i, duration(k))] -= last.rates[n + i]);
        let Some(before) = transition.view((n, n), (n, n)).into_owned().lu().solve(&right) else {
            return undecided("transition matrices are singular to rounding");
        };
        dl = before;
    }
    for (c, &i) in free.iter().enumerate() {
        let argument = if i < n_original { i } else { n_original + i };
        form.row_mut(c).copy_from(&(dl.row(i) + bent.row(argument)));
    }
    let mut rows = Vec::new();
    for (i, held) in shooting.ends.last.iter().enumerate() {
        if held.is_some() {
            rows.push(dx.row(i).into_owned());
        }
    }
    for &(k, _) in &shooting.ends.constraints {
        rows.push(ends.by.row(1 + k) * &arguments);
    }
    if shooting.ends.finish.is_some() {
        rows.push(arguments.row(n_arguments - 1).into_owned());
    }
    let rows = DMatrix::from_fn(rows.len(), unknowns, |i, j| rows[i][j]);
    definiteness(&form, &rows, "changes of the switching times")
}

/// Whether switching functions are zero at switches only, not at an end of the motion either, and have a slope there.
fn strict_switches(shooting: &Shooting<'_>, samples: &[Vec<Sample>]) -> Result<(), String> {
    let places = shooting.hamiltonian.observables();
    let duration = samples.last().and_then(|arc| arc.last()).map_or(1.0, |sample| sample.time);
    for i in 0..shooting.hamiltonian.m {
        let most = samples.iter().flatten().map(|s| s.observed[places.slope(i)].abs()).fold(0.0, f64::max);
        let kind = |k: usize| shooting.plan.arcs.get(k).map(|(kind, ..)| kind.controls[i]);
        // after arc k
        let switches_after = |k: usize| kind(k + 1).is_some_and(|next| Some(next) != kind(k));
        for (k, arc) in samples.iter().enumerate() {
            let switches = switches_after(k);
            let first = usize::from(k > 0 && switches_after(k - 1));
            let inner = &arc[first..arc.len() - usize::from(switches)];
            if inner.iter().any(|sample| sample.observed[places.slope(i)].abs() <= FLAT * most) {
                return Err(format!("the switching function of control {i} touches zero on arc {k}"));
            }
            let steep = arc.last().map_or(0.0, |sample| sample.observed[places.slope_rate(i)].abs());
            if switches && steep * duration <= SLACK * most {
                return Err(format!(
                    "the switching function of control {i} has no slope at its switch after arc {k}"
                ));
            }
        }
    }
    Ok(())
}

/// In which directions states vary: along each that is a number, and of a quaternion along the rotations about body axes. All in
/// units of the sizes, which are one for quaternions.
struct Directions {
    /// The states and parameters that vary; the states of the problem come first.
    varied: Vec<usize>,
    /// First number of each quaternion.
    quaternions: Vec<usize>,
}

impl Directions {
    fn count(&self) -> usize {
        self.varied.len() - self.quaternions.len()
    }

    /// An orthonormal basis where the states are `point`: what varies by directions.
    fn basis(&self, point: &[f64]) -> DMatrix<f64> {
        let mut basis = DMatrix::zeros(self.varied.len(), self.count());
        let (mut row, mut column) = (0, 0);
        while row < self.varied.len() {
            if self.quaternions.contains(&row) {
                let axes = body_axes(&point[row..row + WIDTH]);
                basis.view_mut((row, column), (WIDTH, WIDTH - 1)).copy_from(&axes);
                (row, column) = (row + WIDTH, column + WIDTH - 1);
            } else {
                basis[(row, column)] = 1.0;
                (row, column) = (row + 1, column + 1);
            }
        }
        basis
    }

    /// Variations of the states at a point.
    fn of_states(&self, family: &Family, point: &[f64]) -> DMatrix<f64> {
        self.basis(point).transpose() * family.rows(&self.varied)
    }
}

/// A family of neighbouring extremals: variations of states and costates, columns orthonormal in the sizes of their rows.
#[derive(Clone)]
struct Family {
    variations: DMatrix<f64>,
}

impl Family {
    /// All variations of the states at a point with the same costates.
    fn of_states(directions: &Directions, point: &[f64], n: usize) -> Self {
        let mut variations = DMatrix::zeros(2 * n, directions.count());
        let basis = directions.basis(point);
        directions.varied.iter().zip(basis.row_iter()).for_each(|(&i, row)| variations.set_row(i, &row));
        Self { variations }
    }

    /// Carries on, and makes the columns orthonormal again without a change of the sign of any determinant.
    fn carried(&self, transition: &DMatrix<f64>) -> Self {
        let qr = (transition * &self.variations).qr();
        let (mut q, r) = (qr.q(), qr.r());
        for (k, mut column) in q.column_iter_mut().enumerate() {
            if r[(k, k)] < 0.0 {
                column.neg_mut();
            }
        }
        Self { variations: q }
    }

    fn rows(&self, rows: &[usize]) -> DMatrix<f64> {
        DMatrix::from_fn(rows.len(), self.variations.ncols(), |i, j| self.variations[(rows[i], j)])
    }
}

/// A transition matrix in units of the sizes.
fn in_units(transition: &DMatrix<f64>, sizes: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(sizes.len(), sizes.len(), |i, j| transition[(i, j)] * sizes[j] / sizes[i])
}

fn conjugate_points(
    shooting: &mut Shooting<'_>,
    at: &Iterate,
    samples: &[Vec<Sample>],
    ends: &EndValues,
) -> Verdict {
    let hamiltonian = shooting.hamiltonian;
    let (n, n_original) = (hamiltonian.n, hamiltonian.n_original);
    let n_parameters = shooting.ends.parameters.len();
    let sizes = shooting.sizes.to_vec();
    let held = |i: usize| {
        if i < n_original {
            shooting.ends.initial[i].is_some()
        } else {
            shooting.ends.parameters[i - n_original].is_some()
        }
    };
    // the time and fixed parameters do not vary
    let varied: Vec<usize> = (0..n_original + n_parameters).filter(|&i| i < n_original || !held(i)).collect();
    let argument = |i: usize| if i < n_original { i } else { n_original + i };
    let at_end: Vec<usize> = (n_original..2 * n_original).chain([ends.gradient.len() - 1]).collect();
    for &i in varied.iter().filter(|&&i| !held(i)) {
        let joined = at_end.iter().any(|&a| ends.hessian[(argument(i), a)] != 0.0);
        let constrained =
            shooting.ends.constraints.iter().any(|&(k, _)| ends.by[(1 + k, argument(i))] != 0.0);
        if joined || constrained {
            return undecided("the end terms join both ends, for which no test of second order is made");
        }
    }
    let mut variations = DMatrix::zeros(2 * n, varied.len());
    for (column, &i) in varied.iter().enumerate() {
        if held(i) {
            variations[(n + i, column)] = 1.0;
            continue;
        }
        variations[(i, column)] = 1.0;
        for &j in varied.iter().filter(|&&j| !held(j)) {
            let bent = ends.hessian[(argument(j), argument(i))];
            variations[(n + j, column)] = -bent * sizes[i] / sizes[n + j];
        }
    }
    let quaternions = shooting.hamiltonian.quaternions.clone();
    let directions = &Directions { varied, quaternions };
    let variations = variations * directions.basis(at.first());
    if scales_alone(shooting, samples, &sizes) {
        let is_fixed = (0..n_original + n_parameters).all(held);
        return if hamiltonian.time.is_none() && is_fixed && shooting.ends.finish.is_none() {
            least_time(shooting, at, samples, ends, directions, &sizes)
        } else if is_fixed && shooting.ends.finish.is_some() {
            from_the_end(shooting, samples, ends, directions, &sizes)
        } else {
            undecided(
                "the control depends on the direction of the costates alone, and ends are free for which no test is made",
            )
        };
    }
    let family = match scan(shooting, at, samples, Family { variations }, directions, false) {
        Ok(family) => family,
        Err(verdict) => return verdict,
    };
    let Some(last) = samples.last().and_then(|arc| arc.last()) else { return undecided("there is no arc") };
    end_form(shooting, last, ends, &family, directions, &sizes)
}

/// Whether the control depends on the direction of the costates alone, as where the cost is one of the end or of the time: a multiple
/// of the costates is the same motion.
fn scales_alone(shooting: &Shooting<'_>, samples: &[Vec<Sample>], sizes: &[f64]) -> bool {
    let n = shooting.hamiltonian.n;
    let Some(first) = samples.first().and_then(|arc| arc.first()) else { return false };
    let mut variation = DVector::zeros(2 * n);
    for i in (0..n).filter(|&i| Some(i) != shooting.hamiltonian.time) {
        variation[n + i] = first.point[n + i] / sizes[n + i];
    }
    for sample in samples.iter().flatten() {
        variation = in_units(&sample.transition, sizes) * variation;
        if variation.rows(0, n).amax() > SLACK * variation.amax() {
            return false;
        }
    }
    true
}

/// The matrix whose determinant is zero at a conjugate point: variations of the states, and the rate of
/// the motion where time is free.
fn states(
    family: &Family,
    directions: &Directions,
    sample: &Sample,
    sizes: &[f64],
    with_motion: bool,
) -> DMatrix<f64> {
    let mut states = directions.of_states(family, &sample.point);
    if with_motion {
        let last = states.ncols();
        states = states.insert_column(last, 0.0);
        let varied = directions.varied.iter();
        let rates =
            DVector::from_iterator(directions.varied.len(), varied.map(|&i| sample.rates[i] / sizes[i]));
        states.set_column(last, &(directions.basis(&sample.point).transpose() * rates));
    }
    states
}

/// A family from one sample to the next.
struct Step<'s> {
    arc: usize,
    ends: [&'s Sample; 2],
    /// At the first of them.
    family: Family,
    /// The smallest singular value of the states at the second.
    least: f64,
}

/// Where smallest singular values may vanish between three samples, though no determinant changes its sign: the middle ones.
fn dips(least: &[f64]) -> impl Iterator<Item = usize> {
    least.windows(3).enumerate().filter_map(|(k, values)| {
        let [before, here, after] = [values[0], values[1], values[2]];
        (here <= before && here <= after && here <= DIP * before.max(after)).then_some(k + 1)
    })
}

/// The first time at which a family has no states in an even number of directions at once, as geodesics of a sphere do: its determinant
/// keeps the sign.
fn touched(
    shooting: &mut Shooting<'_>,
    at: &Iterate,
    steps: &[Step<'_>],
    directions: &Directions,
    with_motion: bool,
) -> Option<f64> {
    let least: Vec<f64> = steps.iter().map(|step| step.least).collect();
    for k in dips(&least).collect::<Vec<_>>() {
        let size = least[k - 1].max(least[k + 1]);
        for step in &steps[k..=k + 1] {
            let mut value = |duration: f64| {
                let states = states_after(shooting, at, step, directions, with_motion, duration)?;
                Some(states.singular_values().min())
            };
            let (mut low, mut high) = (0.0, step.ends[1].time - step.ends[0].time);
            for _ in 0..DIVISIONS {
                let inner = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
                if value(inner[0])? <= value(inner[1])? { high = inner[1] } else { low = inner[0] }
            }
            let middle = 0.5 * (low + high);
            if value(middle)? <= TOUCH * size {
                return Some(step.ends[0].time + middle);
            }
        }
    }
    None
}

/// Carries a family from the start to the end, where it arrives; a conjugate point on the way is a verdict. Next to the start, where
/// the family has no determinant to rounding, a companion shows that nothing is conjugate there.
fn scan(
    shooting: &mut Shooting<'_>,
    at: &Iterate,
    samples: &[Vec<Sample>],
    mut family: Family,
    directions: &Directions,
    with_motion: bool,
) -> Result<Family, Verdict> {
    let sizes = shooting.sizes.to_vec();
    let mut companion = Family::of_states(directions, at.first(), shooting.hamiltonian.n);
    let mut last_sign = None;
    let mut steps: Vec<Step<'_>> = Vec::new();
    for (a, arc) in samples.iter().enumerate() {
        for (k, sample) in arc.iter().enumerate().skip(1) {
            let transition = in_units(&sample.transition, &sizes);
            let next = family.carried(&transition);
            let matrix = states(&next, directions, sample, &sizes, with_motion);
            let sign = matrix.determinant().signum();
            let least = matrix.singular_values().min();
            let is_clear = least > CLEAR;
            let step = Step { arc: a, ends: [&arc[k - 1], sample], family, least };
            match last_sign {
                None => {
                    companion = companion.carried(&transition);
                    let others = directions.of_states(&companion, &sample.point);
                    if others.determinant() <= 0.0 || others.singular_values().min() <= CLEAR {
                        return Err(undecided(UNCLEAR));
                    }
                }
                Some(last) if is_clear && last != sign => {
                    let time = touched(shooting, at, &steps, directions, with_motion)
                        .unwrap_or_else(|| located(shooting, at, &step, directions, with_motion));
                    return Err(Verdict::ConjugatePoint { time: at.start + time });
                }
                Some(_) => {}
            }
            if is_clear {
                last_sign = Some(sign);
            }
            // what has not reached all states yet has rounding for its smallest singular value
            if last_sign.is_some() {
                steps.push(step);
            }
            family = next;
        }
    }
    if let Some(time) = touched(shooting, at, &steps, directions, with_motion) {
        return Err(Verdict::ConjugatePoint { time: at.start + time });
    }
    if last_sign.is_some() { Ok(family) } else { Err(undecided(UNREACHED)) }
}

/// Conjugate points where the time is what is made small, or as good as: costates are taken on one level of the Hamiltonian, and the
/// motion itself is a variation (Bonnard, Caillau and Trélat, ESAIM: COCV 13 (2007)).
fn least_time(
    shooting: &mut Shooting<'_>,
    at: &Iterate,
    samples: &[Vec<Sample>],
    ends: &EndValues,
    directions: &Directions,
    sizes: &[f64],
) -> Verdict {
    let (n, n_original, count) =
        (shooting.hamiltonian.n, shooting.hamiltonian.n_original, directions.count());
    let varied = &directions.varied;
    let (Some(first), Some(last)) =
        (samples.first().and_then(|arc| arc.first()), samples.last().and_then(|arc| arc.last()))
    else {
        return undecided(UNREACHED);
    };
    let at_start = directions.basis(&first.point);
    let level = DMatrix::from_fn(1, varied.len(), |_, j| first.rates[varied[j]] * sizes[n + varied[j]]);
    let basis = &at_start * null_space(&(level * &at_start));
    let mut variations = DMatrix::zeros(2 * n, basis.ncols());
    for (row, &i) in varied.iter().enumerate() {
        variations.row_mut(n + i).copy_from(&basis.row(row));
    }
    let family = match scan(shooting, at, samples, Family { variations }, directions, true) {
        Ok(family) => family,
        Err(verdict) => return verdict,
    };
    let Some(inverse) = states(&family, directions, last, sizes, true).try_inverse() else {
        return undecided("the end is conjugate to the start");
    };
    // of a variation of the end: the time it takes, and the costates it leads to
    let time = inverse.row(count - 1).into_owned();
    let costates = varied.iter().map(|i| n + i).collect::<Vec<_>>();
    let falls =
        DVector::from_iterator(varied.len(), varied.iter().map(|&i| last.rates[n + i] / sizes[n + i]));
    let bent = family.rows(&costates) * inverse.rows(0, count - 1) + falls * &time;
    let place = |k: usize| n_original + varied[k];
    let finish = ends.gradient.len() - 1;
    let at_end = directions.basis(&last.point);
    let along = |of: &dyn Fn(usize) -> f64| {
        RowDVector::from_fn(varied.len(), |_, k| of(k) * sizes[varied[k]]) * &at_end
    };
    let of = |row: usize, column: usize| ends.hessian[(row, column)];
    let of_states = DMatrix::from_fn(varied.len(), varied.len(), |i, j| {
        of(place(i), place(j)) * sizes[varied[i]] * sizes[varied[j]]
    });
    let pushed =
        DMatrix::from_fn(varied.len(), count, |i, j| sizes[varied[i]] * bent[(i, j)] * sizes[n + varied[i]]);
    let with_time = along(&|k| of(place(k), finish));
    let form = at_end.transpose() * (of_states * &at_end - pushed)
        + with_time.transpose() * &time
        + time.transpose() * with_time
        + time.transpose() * &time * of(finish, finish);
    let mut rows = Vec::new();
    for k in (0..varied.len()).filter(|&k| shooting.ends.last[varied[k]].is_some()) {
        rows.push(at_end.row(k).into_owned());
    }
    for &(constraint, _) in &shooting.ends.constraints {
        let by = |a: usize| ends.by[(1 + constraint, a)];
        rows.push(along(&|k| by(place(k))) + &time * by(finish));
    }
    let rows = DMatrix::from_fn(rows.len(), count, |i, j| rows[i][j]);
    definiteness(&form, &rows, "what is free at the end")
}

/// Points conjugate to the end conditions, where start and times are fixed: the family of extremals that end as they must is carried
/// back, and its states must be independent at all times before the end.
fn from_the_end(
    shooting: &Shooting<'_>,
    samples: &[Vec<Sample>],
    ends: &EndValues,
    directions: &Directions,
    sizes: &[f64],
) -> Verdict {
    let (n, n_original, count) =
        (shooting.hamiltonian.n, shooting.hamiltonian.n_original, directions.count());
    let varied = &directions.varied;
    let place = |k: usize| n_original + varied[k];
    let Some(last) = samples.last().and_then(|arc| arc.last()) else { return undecided(UNREACHED) };
    let basis = directions.basis(&last.point);
    let mut rows = Vec::new();
    for k in (0..varied.len()).filter(|&k| shooting.ends.last[varied[k]].is_some()) {
        rows.push(DVector::from_fn(varied.len(), |j, _| f64::from(u8::from(j == k))));
    }
    for &(constraint, _) in &shooting.ends.constraints {
        rows.push(DVector::from_fn(varied.len(), |j, _| ends.by[(1 + constraint, place(j))]));
    }
    let normals = DMatrix::from_fn(rows.len(), varied.len(), |i, j| rows[i][j]);
    // in units of the states
    let scaled = DMatrix::from_fn(rows.len(), varied.len(), |i, j| normals[(i, j)] * sizes[varied[j]]);
    let free = null_space(&(scaled * &basis));
    if free.ncols() + normals.nrows() != count {
        return undecided("the end conditions depend on each other");
    }
    let tangents = &basis * free;
    let mut variations = DMatrix::zeros(2 * n, count);
    let bent = DMatrix::from_fn(varied.len(), varied.len(), |i, j| {
        ends.hessian[(place(i), place(j))] * sizes[varied[j]]
    }) * &tangents;
    for (row, &i) in varied.iter().enumerate() {
        for column in 0..tangents.ncols() {
            variations[(i, column)] = tangents[(row, column)];
            variations[(n + i, column)] = bent[(row, column)] / sizes[n + i];
        }
        for normal in 0..normals.nrows() {
            variations[(n + i, tangents.ncols() + normal)] = normals[(normal, row)] / sizes[n + i];
        }
    }
    let mut companion = Family::of_states(directions, &last.point, n);
    let mut family = Family { variations };
    let mut last_sign = None;
    let mut all_least = Vec::new();
    for pair in samples.iter().rev().flat_map(|arc| arc.windows(2).rev()) {
        let [before, sample] = pair else { continue };
        let Some(back) = in_units(&sample.transition, sizes).try_inverse() else { return undecided(UNCLEAR) };
        family = family.carried(&back);
        let matrix = directions.of_states(&family, &before.point);
        let sign = matrix.determinant().signum();
        let least = matrix.singular_values().min();
        let is_clear = least > CLEAR;
        match last_sign {
            None => {
                companion = companion.carried(&back);
                let others = directions.of_states(&companion, &before.point);
                if others.determinant() <= 0.0 || others.singular_values().min() <= CLEAR {
                    return undecided(UNCLEAR);
                }
            }
            Some(last) if is_clear && last != sign => {
                return Verdict::NotMinimum {
                    reason: "a point of it is conjugate to the end conditions".to_owned(),
                };
            }
            Some(_) => {}
        }
        if is_clear {
            last_sign = Some(sign);
        }
        if last_sign.is_some() {
            all_least.push(least);
        }
    }
    if dips(&all_least).next().is_some() {
        return undecided(DIPPED);
    }
    if last_sign.is_some() { Verdict::StrictMinimum } else { undecided(UNREACHED) }
}

/// The states of the family of a step, so long after its first sample.
fn states_after(
    shooting: &mut Shooting<'_>,
    at: &Iterate,
    step: &Step<'_>,
    directions: &Directions,
    with_motion: bool,
    duration: f64,
) -> Option<DMatrix<f64>> {
    let flow = &mut shooting.flows[step.arc];
    flow.set_guess(&at.guesses[step.arc][0]);
    let arrival = follow(flow, shooting.sizes, &step.ends[0].point, duration, true, shooting.token)?;
    let rates = flow.rates_at(&arrival.point);
    let transition = arrival.transition?;
    let carried = step.family.carried(&in_units(&transition, shooting.sizes));
    let there = Sample { time: 0.0, point: arrival.point, observed: Vec::new(), rates, transition };
    Some(states(&carried, directions, &there, shooting.sizes, with_motion))
}

/// When the determinant of a family is zero between two samples.
fn located(
    shooting: &mut Shooting<'_>,
    at: &Iterate,
    step: &Step<'_>,
    directions: &Directions,
    with_motion: bool,
) -> f64 {
    let [before, after] = step.ends;
    let mut determinant = |duration: f64| {
        states_after(shooting, at, step, directions, with_motion, duration).map(|states| states.determinant())
    };
    let (mut low, mut high) = (0.0, after.time - before.time);
    let Some(at_high) = determinant(high) else { return after.time };
    for _ in 0..DIVISIONS {
        let middle = 0.5 * (low + high);
        match determinant(middle) {
            Some(d) if d.signum() == at_high.signum() => high = middle,
            Some(_) => low = middle,
            None => return after.time,
        }
        if high - low <= f64::EPSILON * after.time {
            break;
        }
    }
    before.time + 0.5 * (low + high)
}

/// What is left of the second variation at the end, in the directions that are free there.
fn end_form(
    shooting: &Shooting<'_>,
    last: &Sample,
    ends: &EndValues,
    family: &Family,
    directions: &Directions,
    sizes: &[f64],
) -> Verdict {
    let hamiltonian = shooting.hamiltonian;
    let varied = &directions.varied;
    let (n, n_original, count) = (hamiltonian.n, hamiltonian.n_original, varied.len());
    let basis = directions.basis(&last.point);
    let is_open = shooting.ends.finish.is_none();
    // variations of the states at the end, then of the final time
    let unknowns = count + usize::from(is_open);
    let costates: Vec<usize> = varied.iter().map(|i| n + i).collect();
    let Some(inverse) = directions.of_states(family, &last.point).try_inverse() else {
        return undecided("the end is conjugate to the start");
    };
    let slope = family.rows(&costates) * inverse * basis.transpose();
    // P in the units of the problem
    let p = DMatrix::from_fn(count, count, |i, j| slope[(i, j)] * sizes[n + varied[i]] / sizes[varied[j]]);
    let rates = DVector::from_iterator(count, varied.iter().map(|&i| last.rates[i]));
    let falls = DVector::from_iterator(count, varied.iter().map(|&i| last.rates[n + i]));
    let argument = |k: usize| {
        if k == count {
            Some(ends.gradient.len() - 1)
        } else {
            (varied[k] < n_original).then(|| n_original + varied[k])
        }
    };
    let mut form = DMatrix::zeros(unknowns, unknowns);
    for column in 0..unknowns {
        let mut dx = DVector::zeros(count);
        let open = if column == count { 1.0 } else { 0.0 };
        if column < count {
            dx[column] = 1.0;
        }
        let dl = &p * (&dx - &rates * open) + &falls * open;
        let by_time = hamiltonian.time.map_or(0.0, |time| -last.rates[n + time]) * open;
        let dh = rates.dot(&dl) - falls.dot(&dx) + by_time;
        for row in 0..unknowns {
            let bent = match (argument(row), argument(column)) {
                (Some(a), Some(b)) => ends.hessian[(a, b)],
                (Some(_) | None, Some(_) | None) => 0.0,
            };
            form[(row, column)] = bent + if row < count { -dl[row] } else { dh };
        }
    }
    let mut rows = Vec::new();
    let size = |k: usize| if k < count { sizes[varied[k]] } else { last.time };
    for (k, &i) in varied.iter().enumerate() {
        if i < n_original && shooting.ends.last[i].is_some() {
            rows.push(DVector::from_fn(unknowns, |j, _| f64::from(u8::from(j == k))));
        }
    }
    for &(constraint, _) in &shooting.ends.constraints {
        rows.push(DVector::from_fn(unknowns, |j, _| {
            argument(j).map_or(0.0, |a| ends.by[(1 + constraint, a)]) * size(j)
        }));
    }
    let rows = DMatrix::from_fn(rows.len(), unknowns, |i, j| rows[i][j]);
    // in units, so that eigenvalues can be compared
    let scaled = DMatrix::from_fn(unknowns, unknowns, |i, j| form[(i, j)] * size(i) * size(j));
    let mut free = DMatrix::identity(unknowns, unknowns - directions.quaternions.len());
    free.view_mut((0, 0), basis.shape()).copy_from(&basis);
    if is_open {
        free.view_mut((0, basis.ncols()), (count, 1)).fill(0.0);
        free[(count, basis.ncols())] = 1.0;
    }
    let form = free.transpose() * scaled * &free;
    definiteness(&form, &(rows * free), "what is free at the end")
}
