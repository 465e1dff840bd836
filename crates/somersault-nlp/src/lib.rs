#![doc = include_str!("../README.md")]
//!
//! # How it works
//!
//! ```math
//! \min_z\ f(z) \quad\text{subject to}\quad l \le z \le u, \quad l_c \le c(z) \le u_c
//! ```
//! A program is a type that implements [`Nlp`]: its sizes and sparsity, values and derivatives. An equality is a constraint
//! whose bounds are equal; a bound that does not hold is infinite. The Lagrangian is L = f + yᵀ c + yᵀ_z z, with
//! multipliers positive at upper bounds and negative at lower ones.
//!
//! | Program | Solver | Cost of a step beside evaluations |
//! |---|---|---|
//! | few inequalities, or a warm start | [`Sqp`] | one sparse factorisation, sometimes a quadratic program |
//! | many inequalities or variables | [`InteriorPoint`] | one sparse factorisation |
//! | bounds only, many variables, no Hessian | [`Lbfgs`] | 4 n × memory |
//! | bounds only, for comparison | [`GradientDescent`] | n |
//! | several minima | [`MultiStart`] with any of them | |
//!
//! **Step.** [`Sqp`] takes Newton's step on its working set, a quadratic program with equalities, by one sparse
//! LDLᵀ factorisation (QDLDL, or dense blocks where columns are long), exchanging rows while bounds or signs of multipliers are violated. Where that does not
//! end, clarabel solves the program with inequalities and tells the working set (Morales, Nocedal & Wu 2012), from which
//! the primal active-set method exchanges rows one by one if need be. Where rows hardly differ, the step is stabilised: they are
//! met as far as multipliers stay near those of the last iteration (Wright 1998; Gill & Robinson 2013). Where
//! the linearised constraints contradict each other, or want multipliers beyond 10⁴ max(1, ‖∇f‖∞), the violations
//! are penalised instead (elastic mode; Gill, Murray & Saunders 2005), with a weight that is raised until they fall.
//! With [`Sqp::crossover`] the program goes to [`InteriorPoint`] once exchanging rows does not end, and the working set is that of its
//! solution.
//!
//! **Convexity.** clarabel takes convex programs, and a step of Newton is one of descent only where the Hessian is
//! positive definite along the constraints. A multiple σ of the unit matrix is added, the least of a geometric
//! sequence (Wächter & Biegler 2006, algorithm IC) that makes the number of positive pivots right: for Newton's step
//! that of the KKT matrix, so that σ = 0 where the reduced Hessian is positive definite and convergence is quadratic;
//! for clarabel that of the Hessian itself. The pattern stays what it is. A Gauss–Newton Hessian gets a term of
//! Levenberg and Marquardt that grows with short steps and vanishes with full ones. Without a Hessian there is a
//! quasi-Newton approximation: damped BFGS for one block of coupled variables, the symmetric rank-one formula by
//! blocks for several, shifted in the same way.
//!
//! **Globalisation.** A line search, either on the merit function f + ρ Σ violations (Nocedal & Wright 2006,
//! section 18.3) or with a filter (Fletcher & Leyffer 2002; switching condition and margins of Wächter & Biegler 2006),
//! both with second-order corrections: see [`Globalisation`]. Where the violation cannot be reduced along a step, or,
//! with the filter, the linearised constraints contradict each other, and before a solve gives up where it is not feasible,
//! feasibility is restored: Levenberg and Marquardt's method makes the sum of squared violations less within the bounds of
//! z, until a tenth of the violation is left, the second time until none is.
//! [`Status::Infeasible`] means that this sum is locally least though it is not zero. Iterates keep the bounds of z. Points
//! without a value are stepped back from. Where values differ by rounding only, residuals decide.
//!
//! **Interior point.** [`InteriorPoint`] is the method of Wächter & Biegler (2006): slacks for rows with inequalities, a
//! logarithmic barrier whose weight μ falls monotonically, δ_w and δ_c in the matrix, the filter of [`Sqp`], corrections of
//! second order, gradient-based scaling. It differs in three ways: bounds of z are never relaxed, a program is solved where the
//! residuals of its own, unscaled functions hold, and feasibility is restored on squares of violations, so that both solvers
//! call the same points infeasible. Without a Hessian it takes the same quasi-Newton approximations as [`Sqp`].
//!
//! **Sensitivity.** [`Sensitivity`] differentiates a solution with respect to the values of fixed variables, of equalities and of
//! other bounds that hold it, by the factors of one more KKT matrix (Fiacco 1983). [`negative_curvature`] says whether a solution is a
//! saddle, as where a start and a program are symmetric and a minimum is not, and in which direction it is left.
//!
//! **Advice.** A strong penalty on a nonlinear function, or a long integration, bends a narrow valley, along which
//! every method creeps. Make the function's value and the state at a few nodes variables, with equalities: the same
//! minimum then takes a fraction of the steps (7 instead of 171 for case A of the thesis' Table A.1, 9 for case G).
//!
//! References: J. Nocedal & S. Wright, Numerical Optimization (2006). A. Wächter & L. Biegler, Math. Program. 106
//! (2006) 25–57. R. Fletcher & S. Leyffer, Math. Program. 91 (2002) 239–269. J. Morales, J. Nocedal & Y. Wu, IMA J. Numer. Anal. 32 (2012) 553–579. P. Gill, W. Murray &
//! M. Saunders, SIAM Review 47 (2005) 99–131. S. Wright, Comput. Optim. Appl. 11 (1998) 253–275. P. Gill & D. Robinson, SIAM J. Optim.
//! 23 (2013) 1983–2010. M. Hintermüller, K. Ito & K. Kunisch, SIAM J. Optim. 13 (2002) 865–888.
//! P. Goulart & Y. Chen, Clarabel, arXiv:2405.12762 (2024). D. Janka, C. Kirches, S. Sager & A. Wächter, Math.
//! Program. Comput. 8 (2016) 435–459. A. Fiacco, Introduction to Sensitivity and Stability Analysis in Nonlinear Programming
//! (1983). D. Bertsekas, SIAM J. Control Optim. 20 (1982) 221–246.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::todo)
)]

mod best;
mod error;
mod filter;
mod first_order;
mod gradient_descent;
mod hessian;
mod interior_point;
mod kkt;
mod lbfgs;
mod multi_start;
mod nlp;
mod program;
mod quadratic;
mod report;
mod saddle;
mod sensitivity;
mod solver;
mod sqp;
mod subproblem;
mod supernodal;

pub use error::SolverError;
pub use first_order::Limits;
pub use gradient_descent::GradientDescent;
pub use interior_point::InteriorPoint;
pub use lbfgs::Lbfgs;
pub use multi_start::{
    Failure, FailureCause, Minimum, MultiStart, MultiStartReport, latin_hypercube, ranked, samples,
};
pub use nlp::{Bounds, Curvature, EvaluationError, Nlp, NoEntry, NoHessian, Pattern, Structure};
pub use program::Exhausted;
pub use report::{Counts, Iteration, KktResiduals, Report, Start, Status};
pub use sensitivity::{Derivative, Held, NoDerivative, Sensitivity, negative_curvature};
pub use solver::NlpSolver;
pub use somersault_core::cancel::Flow;
pub use sqp::{Globalisation, HessianSource, Sqp};
