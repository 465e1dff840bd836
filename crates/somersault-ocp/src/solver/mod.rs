//! Three methods to solve one problem, and one that starts the second from the first.
//!
//! | [`SolutionMethod`] | Unknowns | Takes | Leaves |
//! |---|---|---|---|
//! | `Shooting` | splines of the joints of a tree, or of controls | one phase with controls, a start time that is given | a motion and its re-integration; no costates |
//! | `Collocation` | states and controls at points | everything | states, controls, costates, estimated errors |
//! | `Indirect` | states, costates and times at which arcs join | one phase of a tree, or of functions with expressions | an extremal to 10⁻¹⁰ and what it is |
//! | `Auto` | those of collocation | everything | the same |
//!
//! A coarse mesh leaves room between its points for motions that are cheap and false, and Newton's method finds them where many
//! joints are driven. Splines of joints have no such room: what the joints exert follows by inverse dynamics at more nodes than the
//! splines have coefficients, so that their minimum is a motion, though not yet the best. On a mesh of the intervals of the splines it
//! satisfies the equations of collocation to rounding. `Auto` starts there where a tree has three driven joints or more, its duration is
//! given, and nothing says where to start: from splines of sixteen intervals, eight where some joints are integrated, and from finer ones
//! where a program takes many steps. The verdict is that of collocation: its estimated errors, and the integration of its controls.
//!
//! ```
//! use somersault_core::Scalar;
//! use somersault_core::cancel::CancellationToken;
//! use somersault_nlp::Flow;
//! use somersault_ocp::collocation::{CollocationStatus, Dynamics, Phase, Point, Problem, Terms};
//! use somersault_ocp::solver::{Solver, StartFrom, SolutionMethod};
//!
//! /// ẋ = u, cost ½ ∫ x² + u² dt.
//! struct Pull;
//! impl Dynamics for Pull {
//!     fn n_states(&self) -> usize { 1 }
//!     fn n_controls(&self) -> usize { 1 }
//!     fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
//!         rates[0] = at.control[0];
//!     }
//! }
//! impl Terms for Pull {
//!     fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
//!         let [x, u] = [at.state[0], at.control[0]];
//!         (x * x + u * u) * nalgebra::convert::<f64, T>(0.5)
//!     }
//! }
//!
//! for method in [SolutionMethod::Shooting, SolutionMethod::Collocation] {
//!     let phase = Phase::new(Pull, Pull).initial_state([1.0]).final_state([0.0]).horizon(0.0, 1.0);
//!     let mut problem = Problem::try_new(phase)?;
//!     let solver = Solver { method, ..Solver::default() };
//!     let token = CancellationToken::new();
//!     let found = solver.solve(&mut problem, StartFrom::Guess, &mut |_| Flow::Continue, &token)?;
//!     assert_eq!(found.report.status, CollocationStatus::Converged);
//!     assert!((found.report.cost - 0.5 / 1f64.tanh()).abs() < 1e-6);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod first_order;
mod methods;
mod point;
mod spline_program;
mod splines;

pub use methods::{SolutionMethod, Solver, SolverResult, StartFrom};
pub use splines::Splines;
