//! Direct collocation at Legendre–Gauss–Radau points, with meshes refined to a tolerance.
//!
//! A [`Problem`] has one or several [`Phase`]s: equations ẋ = f(x, u, p, t), costs, path and end constraints,
//! bounds, ends and horizons that are fixed or free. On a [`Mesh`] a [`Transcription`] makes a sparse nonlinear
//! program of it, with exact Jacobian and Hessian; [`Collocation`] solves programs and refines meshes until the
//! estimated errors of states, cost, costates, Hamiltonian and bounds are below its tolerance ([`Accuracy`]), and integrates
//! what it found again ([`confirm`]).
//!
//! | Symbol | Meaning | Here |
//! |---|---|---|
//! | x, u, p | states, controls, parameters that are constant in time | [`Point`], [`PhaseSolution`] |
//! | L, Φ | running cost, end cost | [`Terms::running_cost`], [`Terms::end_cost`] |
//! | g, b | path constraints, end constraints | [`Terms::path_constraints`], [`Terms::end_constraints`] |
//! | λ | costates: ∂(lowest cost from here on)/∂x | [`PhaseRows::costates`] |
//! | H | L + λᵀf | [`PhaseRows::hamiltonian`] |
//!
//! Equations and costs are written once over a scalar ([`Dynamics`], [`Terms`]) and differentiated by dual numbers;
//! trees of bodies are [`TreeDynamics`]; functions that bring their derivatives are [`VectorFunction`]s.
//!
//! ```
//! use somersault_core::Scalar;
//! use somersault_ocp::collocation::{Collocation, Dynamics, Mesh, Phase, Point, Problem, Terms};
//! use somersault_nlp::Flow;
//!
//! /// ẋ = −x + u, cost ∫ x² + u² dt.
//! struct Decay;
//! impl Dynamics for Decay {
//!     fn n_states(&self) -> usize { 1 }
//!     fn n_controls(&self) -> usize { 1 }
//!     fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
//!         rates[0] = at.control[0] - at.state[0];
//!     }
//! }
//! impl Terms for Decay {
//!     fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
//!         at.state[0] * at.state[0] + at.control[0] * at.control[0]
//!     }
//! }
//!
//! let phase = Phase::new(Decay, Decay).initial_state([1.0]).final_state([1.5]).horizon(0.0, 40.0);
//! let mut problem = Problem::try_new(phase)?;
//! let found = Collocation::default().solve(&mut problem, &[Mesh::try_uniform(10, 4)?], &mut |_| Flow::Continue)?;
//! // at first the state decays as e^{−√2 t}
//! assert!((found.phases[0].state(1.0)[0] - (-2f64.sqrt()).exp()).abs() < 1e-5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Where the program is not convex a step needs a convex model: the Hessian is forwarded as it is, and
//! [`Sqp`](somersault_nlp::Sqp) shifts it as far as the null space of the active constraints needs. Next to a solution that
//! is not at all, and convergence is quadratic.
//!
//! Bounds and path constraints hold at the collocation points. Between them states and path constraints that do not depend on
//! the controls exceed theirs by the tolerance at most where a search converged; a control that switches exceeds its own in the
//! short interval where it does, and [`Confirmation`] says by how much. Nothing is collocated at the end of a phase, where a control is extrapolated. A start
//! mesh should resolve what is expected to be fast: on a coarse one a program often has solutions that are no
//! motions, and the refinement follows them.
//!
//! Sources: D. Garg et al., *Direct trajectory optimization and costate estimation of finite-horizon and
//! infinite-horizon optimal control problems using a Radau pseudospectral method*, Comput. Optim. Appl. 49 (2011);
//! M. A. Patterson, W. W. Hager and A. V. Rao, *A ph mesh refinement method for optimal control*, Optim. Control
//! Appl. Methods 36 (2015); R. Becker and R. Rannacher, *An optimal control approach to a posteriori error estimation in
//! finite element methods*, Acta Numerica 10 (2001); F. Liu, W. W. Hager and A. V. Rao, *Adaptive mesh refinement method for optimal control
//! using decay rates of Legendre polynomial coefficients*, IEEE Trans. Control Syst. Technol. 26 (2018).

mod bounds;
mod composed;
mod confirmation;
mod entries;
mod error;
mod external;
mod feasible_start;
mod function;
mod given_derivatives;
mod guess;
mod horizon;
mod interval;
mod layout;
mod limited;
mod linkage;
mod mesh;
mod objective;
mod optimality;
mod problem;
mod quaternions;
pub mod radau;
mod refinement;
mod sensitivity;
mod shared;
mod solution;
mod solve;
mod stacked;
mod starts;
mod traced;
mod transcription;
mod tree;
mod vector;
mod view;
mod winding;
mod wrong_derivative;

pub use bounds::PhaseBounds;
pub use composed::ComposedFunction;
pub use confirmation::{Confirmation, PhaseConfirmation, confirm, confirm_cancellable};
pub use error::{CollocationError, Entry, Untraced};
pub use external::ExternalFunction;
pub use function::{Dynamics, Ends, Point, RelativeErrors, Terms, VectorFunction};
pub use guess::Guess;
pub use interval::Interval;
pub(crate) use limited::Limited;
pub use linkage::{End, Linkage, Place, Quantity};
pub use mesh::Mesh;
pub use optimality::Accuracy;
pub use problem::{Phase, Problem};
pub use quaternions::AtUnitQuaternions;
pub(crate) use quaternions::{WIDTH, body_axes};
pub use radau::Radau;
pub use sensitivity::{PhaseDerivative, SolutionDerivative, SolutionSensitivity};
pub(crate) use shared::Shared;
pub use solution::{PhaseRows, PhaseSolution};
pub use solve::{Collocation, CollocationReport, CollocationStatus, MeshRecord, SearchError};
pub(crate) use solve::{NO_MOTION, Origin, USABLE, is_ended};
pub use stacked::Stacked;
pub use starts::{distinct, ranked};
pub use traced::TracedFunction;
pub use transcription::Transcription;
pub use tree::TreeDynamics;
pub(crate) use vector::Vector;
pub use wrong_derivative::Labels;
