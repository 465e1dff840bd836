//! Guesses for a search from many starts, and which of their solutions are the same.

use super::feasible_start::horizons;
use super::guess::Guess;
use super::interval::Interval;
use super::problem::{Phase, Problem};
use super::quaternions::{normalize, wind};
use super::solution::PhaseSolution;
use super::solve::{CollocationReport, CollocationStatus};
use nalgebra::Vector3;
use somersault_core::random::SplitMix64;
use somersault_nlp::Report;
use std::f64::consts::PI;

/// Times of a random guess, and sines of each state along it.
const NODES: usize = 33;
const SINES: usize = 3;
/// Fractions of the duration at which solutions are compared, and how far apart, relative to their sizes, they are the same.
const FRACTIONS: usize = 33;
const SAME: f64 = 1e-3;

/// A random number between −1 and 1.
fn signed(random: &mut SplitMix64) -> f64 {
    2.0 * random.unit() - 1.0
}

/// How far a quantity may be from its guess: half of its finite range, else its size.
fn reach(bounds: &Interval, size: f64) -> f64 {
    let half = 0.5 * (bounds.upper - bounds.lower);
    if half.is_finite() { half } else { size }
}

impl Phase {
    /// A guess about `own`, on a horizon of its own: states leave it by sines, controls run between two values, and half of all
    /// orientations, where they `may_wind`, take a whole turn more about a random axis.
    fn random_guess(
        &self,
        own: &Guess,
        horizon: (f64, f64),
        may_wind: bool,
        random: &mut SplitMix64,
    ) -> Guess {
        let (bounds, sizes) = (&self.bounds, self.sizes);
        let mut turn = || {
            let axis = Vector3::from_fn(|_, _| signed(random)).try_normalize(f64::EPSILON);
            axis.filter(|_| signed(random) > 0.0 && may_wind)
        };
        let turns: Vec<_> = self.quaternions.iter().map(|_| turn()).collect();
        let mut waves = |bounds: &Interval, size: f64| {
            let reach = reach(bounds, size);
            [0; SINES].map(|_| reach * signed(random))
        };
        let states: Vec<_> =
            bounds.state.iter().zip(&self.scales.state).map(|(b, size)| waves(b, *size)).collect();
        let mut between = |bounds: &Interval, size: f64, middle: f64| {
            let (lower, upper) = (bounds.lower.max(middle - size), bounds.upper.min(middle + size));
            lower + (upper - lower) * random.unit()
        };
        let controls: Vec<[f64; 2]> = (0..sizes.controls)
            .map(|j| {
                let (bound, size) = (&bounds.control[j], self.scales.control[j]);
                [0; 2].map(|_| between(bound, reach(bound, size).max(size), own.controls[0][j]))
            })
            .collect();
        let parameters = bounds.parameters.iter().zip(&own.parameters);
        let parameters =
            parameters.map(|(bound, p)| between(bound, reach(bound, p.abs().max(1.0)), *p)).collect();
        let mut guess = Guess { parameters, ..Guess::default() };
        let (mut x, mut u) = (vec![0.0; sizes.states], vec![0.0; sizes.controls]);
        for i in 0..NODES {
            let s = i as f64 / (NODES - 1) as f64;
            own.at_fraction(s, &mut x, &mut u);
            for ((x, waves), bound) in x.iter_mut().zip(&states).zip(&bounds.state) {
                let sines =
                    waves.iter().zip(1..).map(|(a, k)| a * (f64::from(k) * PI * s).sin() / f64::from(k));
                *x = bound.clamp(*x + sines.sum::<f64>());
            }
            normalize(&self.quaternions, &mut x);
            let turned = self.quaternions.iter().zip(&turns);
            turned.for_each(|(first, axis)| wind(*first, &mut x, axis.as_ref(), s));
            u.iter_mut().zip(&controls).for_each(|(u, [from, to])| *u = from + s * (to - from));
            guess.times.push(horizon.0 + s * (horizon.1 - horizon.0));
            guess.states.push(x.clone());
            guess.controls.push(u.clone());
        }
        guess
    }
}

impl Problem {
    /// Guesses for a search, each with one for each phase, the same for the same seed. The first are the problem's own. In the others
    /// states leave these by sines, as far as bounds or their sizes allow, controls run between two random values, and free horizons
    /// are half to twice as long. In a problem of one phase about half of all orientations go round the other way.
    pub fn random_guesses(&self, n_starts: usize, seed: u64) -> Vec<Vec<Guess>> {
        let mut random = SplitMix64::new(seed);
        let own: Vec<Guess> = self.phases.iter().filter_map(|phase| phase.guess.clone()).collect();
        let mut all = vec![own.clone(); n_starts.min(1)];
        while all.len() < n_starts {
            let horizons = horizons(self, 2f64.powf(signed(&mut random)));
            let phases = self.phases.iter().zip(&own).zip(horizons);
            let guesses = phases.map(|((phase, own), horizon)| {
                // bounds may leave no time at all
                let horizon = if horizon.0 < horizon.1 { horizon } else { own.interval() };
                phase.random_guess(own, horizon, self.phases.len() == 1, &mut random)
            });
            all.push(guesses.collect());
        }
        all
    }
}

impl CollocationReport {
    /// Whether another solution of the same problem is the same motion: states, parameters and horizons to three digits.
    fn is_same(&self, other: &Self) -> bool {
        self.phases.len() == other.phases.len()
            && self.phases.iter().zip(&other.phases).all(|(a, b)| is_same_phase(a, b))
    }
}

fn is_same_phase(a: &PhaseSolution, b: &PhaseSolution) -> bool {
    let row = |solution: &PhaseSolution, i: usize| {
        let (start, end) = solution.horizon();
        let [state, ..] = solution.at_fraction(i as f64 / (FRACTIONS - 1) as f64);
        let mut row = state;
        row.extend(&solution.parameters);
        row.extend([start, end]);
        row
    };
    let rows = |solution| (0..FRACTIONS).map(|i| row(solution, i)).collect::<Vec<_>>();
    let (a, b) = (rows(a), rows(b));
    let size = |j: usize| a.iter().chain(&b).fold(1.0, |size: f64, row| size.max(row[j].abs()));
    let sizes: Vec<f64> = (0..a[0].len()).map(size).collect();
    let is_near = |(a, b): (&Vec<f64>, &Vec<f64>)| {
        a.iter().zip(b).zip(&sizes).all(|((a, b), size)| (a - b).abs() <= SAME * size)
    };
    a[0].len() == b[0].len() && a.iter().zip(&b).all(is_near)
}

/// Distinct solutions of one problem, that of lowest cost first, each with the numbers of the starts that led to it.
pub fn distinct<R: AsRef<CollocationReport>>(found: Vec<(usize, R)>) -> Vec<(R, Vec<usize>)> {
    let mut found = found;
    found.sort_by(|(_, a), (_, b)| a.as_ref().cost.total_cmp(&b.as_ref().cost));
    let mut all: Vec<(R, Vec<usize>)> = Vec::new();
    for (start, report) in found {
        match all.iter_mut().find(|(other, _)| other.as_ref().is_same(report.as_ref())) {
            Some((_, starts)) => starts.push(start),
            None => all.push((report, vec![start])),
        }
    }
    for (_, starts) in &mut all {
        starts.sort_unstable();
    }
    all
}

/// Solutions that did not converge, best first by the merit of their programs ([`somersault_nlp::ranked`]); those that are no motions
/// come last.
pub fn ranked<R: AsRef<CollocationReport>>(found: Vec<(usize, R)>) -> Vec<(usize, R)> {
    let programs: Vec<&Report> = found.iter().map(|(_, report)| &report.as_ref().program).collect();
    let mut place = vec![0; found.len()];
    for (rank, k) in somersault_nlp::ranked(&programs).into_iter().enumerate() {
        place[k] = rank;
    }
    let mut all: Vec<_> = place.into_iter().zip(found).collect();
    let is_false = |report: &R| report.as_ref().status == CollocationStatus::FalseConvergence;
    all.sort_by_key(|(place, (_, report))| (is_false(report), *place));
    all.into_iter().map(|(_, found)| found).collect()
}
