//! Derivatives of a solution with respect to the values that hold it, and whether it is a saddle.
//!
//! Where z solves a program with multipliers y and the active set A does not change, the conditions of Karush, Kuhn and Tucker
//! are equations, and the theorem on implicit functions differentiates them (Fiacco 1983, theorem 3.2.2):
//!
//! ```text
//! | H   Aᵀ |  | dz |   |  0 |
//! | A   0  |  | dy | = | dv |        H = ∇²(f + yᵀ c),  A: the active rows of c and the bounds,  dv: how their values move
//! ```
//! The matrix is that of the last step of a solver, factored once for all derivatives. The cost changes by −y dv.

use crate::error::SolverError;
use crate::kkt::{Activity, Kkt};
use crate::nlp::{Curvature, EvaluationError, Nlp, Structure};
use crate::program::{Point, Program, check_vector, max_norm};
use crate::report::Start;
use somersault_core::random::SplitMix64;

/// KKT residual above which a point is no solution.
const SOLVED: f64 = 1e-5;
/// Multipliers and distances to the bound, relative to their sizes, that are both below this leave open whether it acts.
const WEAK: f64 = 1e-6;
/// Curvature along the active constraints, relative to the largest entry of the Hessian, below which a minimum is not isolated.
const FLAT: f64 = 1e-10;
/// What may be added to the Hessian, relative to its size, where a pivot vanishes; refinement takes it out again.
const REGULARISATIONS: [f64; 4] = [1e-9, 1e-8, 1e-7, 1e-6];
const INVERSE_ITERATIONS: usize = 3;
/// Curvature, relative to the largest entry of the Hessian, that is clearly negative; factors by which shifts rise, and the largest one.
const CLEAR: f64 = 1e-6;
const SHIFT_RISE: f64 = 10.0;
const MOST_SHIFT: f64 = 1e4;
/// Steps of inverse iteration, and the relative change of the curvature at which there are enough.
const DESCENT_ITERATIONS: usize = 30;
const SETTLED: f64 = 0.1;
/// Derivatives beyond this, relative to the point, are those of constraints that depend on each other but for rounding.
const STEEPEST: f64 = 1e5;

/// What holds a solution, and whose value may move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Held {
    /// The bound that a variable is at.
    Variable(usize),
    /// The bound that a constraint is at.
    Constraint(usize),
}

/// Why a point has no derivatives.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NoDerivative {
    /// The program or the point is none.
    #[error(transparent)]
    Solver(#[from] SolverError),
    /// A function has no value there, or failed.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// The program offers no exact Hessian.
    #[error(
        "derivatives of a solution need the exact Hessian of the Lagrangian, which the program does not offer"
    )]
    NoHessian,
    /// The conditions of a minimum do not hold.
    #[error(
        "the point is no solution of the program: its KKT residual is {residual:.1e}, allowed is {SOLVED:e}"
    )]
    NotSolved {
        /// The largest one.
        residual: f64,
    },
    /// The second-order condition does not hold.
    #[error(
        "the solution is no isolated minimum: the Hessian of the Lagrangian is not positive definite along the active constraints"
    )]
    NotIsolated,
    /// A value that holds nothing.
    #[error("{0:?} is at no bound, so that moving one changes nothing")]
    NotHeld(Held),
    /// The active constraints contradict each other in first order.
    #[error("the active constraints depend on each other there, so that {0:?} cannot move")]
    Dependent(Held),
}

/// How a solution moves with one of the values that hold it.
#[derive(Debug, Clone, PartialEq)]
pub struct Derivative {
    /// Of the cost.
    pub cost: f64,
    /// Of the variables.
    pub z: Vec<f64>,
    /// Of the multipliers of the constraints.
    pub constraint_multipliers: Vec<f64>,
}

/// The conditions of Karush, Kuhn and Tucker at a solution.
struct Conditions {
    structure: Structure,
    hessian: Vec<f64>,
    jacobian: Vec<f64>,
    /// ∇f + Jᵀ y.
    slope: Vec<f64>,
    active: Vec<Activity>,
    weak: Vec<Held>,
}

impl Conditions {
    fn try_new(nlp: &mut dyn Nlp, z: &[f64], y: &[f64]) -> Result<Self, NoDerivative> {
        let mut program = Program::new(nlp)?;
        if program.curvature() != Curvature::Exact {
            return Err(NoDerivative::NoHessian);
        }
        check_vector("y", y, program.n_constraints())?;
        let mut point = program.start(&Start::from(z))?;
        program.evaluate(&mut point)?;
        program.differentiate(&mut point)?;
        let mut slope = point.gradient.clone();
        program.structure.jacobian.add_transposed_product(&point.jacobian, y, &mut slope);
        let mut held = vec![0.0; program.n_variables()];
        let residual = program.residuals(&point, y, max_norm(&point.gradient), &mut held).max();
        if residual.is_nan() || residual > SOLVED {
            return Err(NoDerivative::NotSolved { residual });
        }
        let mut hessian = vec![0.0; program.structure.hessian.n_entries()];
        program.hessian(z, 1.0, y, &mut hessian)?;
        let (active, weak) = activities(&program, &point, &held, y);
        Ok(Self { structure: program.structure, hessian, jacobian: point.jacobian, slope, active, weak })
    }

    fn kkt(&self) -> Result<Kkt, SolverError> {
        let Structure { hessian, jacobian, .. } = &self.structure;
        Ok(Kkt::try_new(hessian, jacobian)?.with_regularisations(&REGULARISATIONS))
    }
}

/// A solution, ready to be differentiated.
pub struct Sensitivity {
    kkt: Kkt,
    active: Vec<Activity>,
    /// ∇f + Jᵀ y.
    slope: Vec<f64>,
    multipliers: Vec<f64>,
    weak: Vec<Held>,
    /// Largest entry of the point, at least 1.
    size: f64,
    targets: Vec<f64>,
    linear: Vec<f64>,
}

impl Sensitivity {
    /// At a solution with the multipliers of its constraints: one factorisation.
    pub fn try_new(nlp: &mut dyn Nlp, z: &[f64], y: &[f64]) -> Result<Self, NoDerivative> {
        let conditions = Conditions::try_new(nlp, z, y)?;
        let (n, m) = (z.len(), y.len());
        let mut kkt = conditions.kkt()?;
        let Conditions { hessian, jacobian, slope, active, weak, .. } = conditions;
        if !kkt.factor(&hessian, 0.0, &jacobian, &active)
            || is_flat(&mut kkt, n, n + m, FLAT * max_norm(&hessian))
        {
            return Err(NoDerivative::NotIsolated);
        }
        let (targets, linear) = (vec![0.0; n + m], vec![0.0; n]);
        let size = max_norm(z).max(1.0);
        Ok(Self { kkt, active, slope, multipliers: y.to_vec(), weak, size, targets, linear })
    }

    /// Bounds that hold by a multiplier near zero, or nearly hold: derivatives are those of one side there.
    pub fn weakly_active(&self) -> &[Held] {
        &self.weak
    }

    /// How the solution moves with a value that holds it: one solve with the factors.
    pub fn derivative(&mut self, held: Held) -> Result<Derivative, NoDerivative> {
        let n = self.linear.len();
        let (row, cost) = match held {
            Held::Variable(i) => (i, self.slope.get(i).copied()),
            Held::Constraint(i) => (n + i, self.multipliers.get(i).map(|y| -y)),
        };
        let Some(cost) = cost.filter(|_| self.active[row] != Activity::Free) else {
            return Err(NoDerivative::NotHeld(held));
        };
        let (mut z, mut y) = (vec![0.0; n], vec![0.0; self.active.len()]);
        self.targets[row] = 1.0;
        let done = self.kkt.solve(&self.linear, &self.targets, &mut z, &mut y);
        self.targets[row] = 0.0;
        if !done || max_norm(&z) > STEEPEST * self.size {
            return Err(NoDerivative::Dependent(held));
        }
        Ok(Derivative { cost, z, constraint_multipliers: y.split_off(n) })
    }
}

/// A direction along the active constraints in which the Lagrangian curves downwards at a solution z with the multipliers y, its largest
/// entry one: what is left of the cost falls along it and against it, so that the point is a saddle and no minimum. None where there is
/// no such direction, or none beyond rounding.
///
/// The shift that makes the Hessian positive definite along the active constraints is found by factorisations (Sylvester), and the
/// direction by inverse iteration with that of the last.
pub fn negative_curvature(nlp: &mut dyn Nlp, z: &[f64], y: &[f64]) -> Result<Option<Vec<f64>>, NoDerivative> {
    let conditions = Conditions::try_new(nlp, z, y)?;
    let mut kkt = conditions.kkt()?;
    let Conditions { hessian, jacobian, active, .. } = conditions;
    let (n, size) = (z.len(), max_norm(&hessian));
    let mut shift = 0.0;
    while !kkt.factor(&hessian, shift, &jacobian, &active) {
        shift = (SHIFT_RISE * shift).max(CLEAR * size);
        if size == 0.0 || shift > MOST_SHIFT * size {
            return Ok(None);
        }
    }
    // with the first shift nothing curves downwards clearly
    if shift <= CLEAR * size {
        return Ok(None);
    }
    let mut random = SplitMix64::new(0);
    let mut slope: Vec<f64> = (0..n).map(|_| random.unit() - 0.5).collect();
    let targets = vec![0.0; n + y.len()];
    let (mut found, mut last) = (None, 0.0);
    for _ in 0..DESCENT_ITERATIONS {
        let (mut p, mut multipliers) = (vec![0.0; n], vec![0.0; n + y.len()]);
        if !kkt.solve(&slope, &targets, &mut p, &mut multipliers) {
            break;
        }
        let [along, squared] = [&slope, &p].map(|x| x.iter().zip(&p).map(|(a, b)| a * b).sum::<f64>());
        if squared == 0.0 {
            break;
        }
        let (length, largest) = (squared.sqrt(), max_norm(&p));
        // pᵀ (H + σ 1) p = −qᵀ p
        let curvature = -along / squared - shift;
        if curvature < -CLEAR * size {
            found = Some(p.iter().map(|p| p / largest).collect());
            if (curvature - last).abs() <= SETTLED * curvature.abs() {
                break;
            }
        }
        last = curvature;
        slope.iter_mut().zip(&p).for_each(|(q, p)| *q = p / length);
    }
    Ok(found)
}

/// Whether the least curvature along the active constraints, by inverse iteration from a random slope, is below `least`.
fn is_flat(kkt: &mut Kkt, n: usize, size: usize, least: f64) -> bool {
    let mut random = SplitMix64::new(0);
    let mut slope: Vec<f64> = (0..n).map(|_| random.unit() - 0.5).collect();
    let targets = vec![0.0; size];
    for _ in 0..INVERSE_ITERATIONS {
        let (mut p, mut y) = (vec![0.0; n], vec![0.0; size]);
        if !kkt.solve(&slope, &targets, &mut p, &mut y) {
            return true;
        }
        let [along, squared] = [&slope, &p].map(|x| x.iter().zip(&p).map(|(a, b)| a * b).sum::<f64>());
        if squared == 0.0 {
            // nothing is free
            return false;
        }
        // pᵀ H p = −qᵀ p
        if -along <= least * squared {
            return true;
        }
        let length = squared.sqrt();
        slope.iter_mut().zip(&p).for_each(|(q, p)| *q = p / length);
    }
    false
}

/// Which bounds hold variables and constraints, and where that is open.
fn activities(program: &Program<'_>, point: &Point, held: &[f64], y: &[f64]) -> (Vec<Activity>, Vec<Held>) {
    let (mut active, mut weak) = (Vec::new(), Vec::new());
    let structure = &program.structure;
    let of_variables = (0..point.z.len()).map(Held::Variable);
    let of_constraints = (0..y.len()).map(Held::Constraint);
    let size = held.iter().chain(y).fold(1e-300, |a: f64, b| a.max(b.abs()));
    for place in of_variables.chain(of_constraints) {
        let (lower, upper, value, multiplier) = match place {
            Held::Variable(i) => {
                (structure.variables.lower[i], structure.variables.upper[i], point.z[i], held[i])
            }
            Held::Constraint(i) => {
                (structure.constraints.lower[i], structure.constraints.upper[i], point.constraints[i], y[i])
            }
        };
        let activity = if lower == upper {
            Activity::Equal
        } else {
            let (side, distance) = if multiplier > 0.0 || (multiplier == 0.0 && upper - value < value - lower)
            {
                (Activity::Upper, upper - value)
            } else {
                (Activity::Lower, value - lower)
            };
            if distance.abs() <= WEAK * value.abs().max(1.0) && multiplier.abs() <= WEAK * size {
                weak.push(place);
            }
            if multiplier.abs() > distance { side } else { Activity::Free }
        };
        active.push(activity);
    }
    (active, weak)
}
