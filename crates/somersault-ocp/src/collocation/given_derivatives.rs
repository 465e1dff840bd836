//! Derivatives of a problem's functions, compared with differences: those that a user wrote before a solve, all of them where it did
//! not converge.

use super::error::CollocationError;
use super::function::{RelativeErrors, Sizes, VectorFunction};
use super::guess::Guess;
use super::problem::{Phase, Problem};
use super::solution::PhaseSolution;
use super::wrong_derivative::Labels;
use crate::WrongDerivative;
use somersault_core::random::SplitMix64;
use somersault_nlp::EvaluationError;

/// Random points near the guess, beside its middle, and places along a solution.
const POINTS: usize = 4;
/// How far random points are from the guess, relative to the sizes of states and controls.
const NEAR: f64 = 0.1;

/// A function with its arguments, their sizes and names.
type Candidate<'a> = (&'a mut dyn VectorFunction, &'a [f64], &'a [f64], &'a Labels);

/// Arguments of both kinds of functions of a phase.
struct Place {
    point: Vec<f64>,
    ends: Vec<f64>,
}

impl Phase {
    /// Typical sizes of (x, u, p, t).
    fn sizes_at_point(&self, parameters: &[f64], duration: f64) -> Vec<f64> {
        let parameters = parameters.iter().map(|p| if *p == 0.0 { 1.0 } else { p.abs() });
        let own = self.scales.state.iter().chain(&self.scales.control).copied();
        own.chain(parameters).chain([duration]).collect()
    }

    /// Those of (x(t₀), x(t_f), p, t₀, t_f).
    fn sizes_at_ends(&self, of_point: &[f64]) -> Vec<f64> {
        let Sizes { states, controls, .. } = self.sizes;
        let (state, rest) = of_point.split_at(states);
        let (duration, parameters) = rest[controls..].split_last().map_or((1.0, &[][..]), |(t, p)| (*t, p));
        [state, state, parameters, &[duration; 2]].concat()
    }

    /// Labels of f, of L and g, and of Φ and b.
    fn labels(&self) -> [Labels; 3] {
        let Sizes { states, controls, parameters } = self.sizes;
        let state: Vec<String> = (0..states).map(|k| self.name_of_row(k)).collect();
        let control: Vec<String> = (states..states + controls).map(|k| self.name_of_row(k)).collect();
        let parameter: Vec<String> = (0..parameters).map(|k| format!("parameter {k}")).collect();
        let at_point = [&state[..], &control, &parameter, &["t".to_owned()]].concat();
        let of = |end: &str| state.iter().map(|name| format!("{end} {name}")).collect::<Vec<_>>();
        let times = ["t_0", "t_f"].map(str::to_owned);
        let at_ends = [&of("initial")[..], &of("final"), &parameter, &times].concat();
        let outputs = |cost: &str, constraint: &str, n: usize| {
            let constraints = (1..n).map(|k| format!("{constraint} {}", k - 1));
            std::iter::once(cost.to_owned()).chain(constraints).collect()
        };
        [
            Labels {
                function: "dynamics".to_owned(),
                outputs: state.iter().map(|name| format!("rate of {name}")).collect(),
                arguments: at_point.clone(),
            },
            Labels {
                function: "running cost and path".to_owned(),
                outputs: outputs("running cost", "path constraint", self.path.n_outputs()),
                arguments: at_point,
            },
            Labels {
                function: "end cost and ends".to_owned(),
                outputs: outputs("end cost", "end constraint", self.ends.n_outputs()),
                arguments: at_ends,
            },
        ]
    }

    /// The middle of a guess, and random points near it.
    fn places_near(&self, guess: &Guess, sizes: &[f64], random: &mut SplitMix64) -> Vec<Place> {
        let Sizes { states, controls, .. } = self.sizes;
        let (start, end) = guess.interval();
        let at = |fraction: f64, near: f64, random: &mut SplitMix64| {
            let (mut x, mut u) = (vec![0.0; states], vec![0.0; controls]);
            guess.at_fraction(fraction, &mut x, &mut u);
            let bounds = self.bounds.state.iter().chain(&self.bounds.control);
            let moved = x.iter().chain(&u).zip(sizes).zip(bounds);
            let mut point: Vec<f64> = moved
                .map(|((x, size), bound)| bound.clamp(x + near * size * (2.0 * random.unit() - 1.0)))
                .collect();
            point.extend(&guess.parameters);
            point.push(start + fraction * (end - start));
            point
        };
        (0..=POINTS)
            .map(|k| {
                let (near, fraction) = if k == 0 { (0.0, 0.5) } else { (NEAR, random.unit()) };
                let point = at(fraction, near, random);
                let (first, last) = (at(0.0, near, random), at(1.0, near, random));
                let ends = [&first[..states], &last[..states], &guess.parameters, &[start, end]].concat();
                Place { point, ends }
            })
            .collect()
    }

    /// Points along a solution.
    fn places_along(&self, solution: &PhaseSolution) -> Vec<Place> {
        let (start, end) = solution.horizon();
        let n = solution.controls.len();
        let last = &solution.states[solution.states.len() - 1];
        let ends = [&solution.states[0][..], last, &solution.parameters, &[start, end]].concat();
        (0..=POINTS)
            .map(|k| {
                let i = k * n.saturating_sub(1) / POINTS;
                let time = [solution.times[i]];
                let point = [&solution.states[i][..], &solution.controls[i], &solution.parameters, &time];
                Place { point: point.concat(), ends: ends.clone() }
            })
            .collect()
    }

    pub(super) fn relative_errors(&self) -> RelativeErrors {
        self.dynamics.relative_errors().max(self.path.relative_errors()).max(self.ends.relative_errors())
    }

    /// The first derivative that is wrong at one of the places.
    fn wrong_derivative(
        &mut self,
        places: &[Place],
        sizes: &[f64],
        everything: bool,
    ) -> Result<Option<WrongDerivative>, EvaluationError> {
        let at_ends = self.sizes_at_ends(sizes);
        let [of_dynamics, of_path, of_ends] = self.labels();
        for place in places {
            let functions: [Candidate<'_>; 3] = [
                (&mut self.dynamics, &place.point, sizes, &of_dynamics),
                (&mut self.path, &place.point, sizes, &of_path),
                (&mut self.ends, &place.ends, &at_ends, &of_ends),
            ];
            for (function, at, sizes, labels) in functions {
                if !(everything || function.brings_derivatives()) {
                    continue;
                }
                match function.wrong_derivative(at, sizes, labels) {
                    Ok(None) | Err(EvaluationError::Undefined { .. }) => {}
                    found => return found,
                }
            }
        }
        Ok(None)
    }
}

impl Problem {
    /// Tells functions how large their arguments are, and compares derivatives that were brought with differences, at the guess and at
    /// random points near it. One that is wrong is an error.
    pub(crate) fn expect_derivatives(&mut self) -> Result<(), CollocationError> {
        let mut random = SplitMix64::new(1);
        for phase in &mut self.phases {
            let Some(guess) = phase.guess.clone() else { continue };
            let (start, end) = guess.interval();
            let sizes = phase.sizes_at_point(&guess.parameters, end - start);
            let at_ends = phase.sizes_at_ends(&sizes);
            let places = phase.places_near(&guess, &sizes, &mut random);
            let Place { point, ends } = &places[0];
            let told = [
                phase.dynamics.set_sizes(point, &sizes),
                phase.path.set_sizes(point, &sizes),
                phase.ends.set_sizes(ends, &at_ends),
            ];
            for told in told {
                if let Err(error @ EvaluationError::Failed(_)) = told {
                    return Err(error.into());
                }
            }
            if let Some(wrong) = phase.wrong_derivative(&places, &sizes, false)? {
                return Err(CollocationError::WrongDerivative(wrong));
            }
        }
        Ok(())
    }

    /// The first derivative that differences contradict along a solution, exact ones excepted: what may be behind a solve that did
    /// not converge.
    pub fn wrong_derivative(
        &mut self,
        solution: &[PhaseSolution],
    ) -> Result<Option<WrongDerivative>, CollocationError> {
        for (phase, solution) in self.phases.iter_mut().zip(solution) {
            let (start, end) = solution.horizon();
            let sizes = phase.sizes_at_point(&solution.parameters, end - start);
            let found = phase.wrong_derivative(&phase.places_along(solution), &sizes, true)?;
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }

    /// Relative errors of the functions of all phases: zero where values and derivatives are right to rounding.
    pub fn relative_errors(&self) -> RelativeErrors {
        self.phases.iter().map(Phase::relative_errors).fold(RelativeErrors::default(), RelativeErrors::max)
    }
}
