//! Arcs found in a collocation solution, polished and certified.
//!
//! A motion that is optimal is made of arcs. On each of them a control is at a bound, or minimises the Hamiltonian in between, or is
//! singular, or holds the state at a bound; where arcs join, switching functions or bounds say when. Collocation knows these times to
//! the length of its intervals. Here they are unknowns of their own ([`Polish`]):
//!
//! 1. **Labels** of the intervals of the mesh give arcs, junctions and a start.
//! 2. **Multi-arc multiple shooting** of (x, λ) makes them exact to rounding: to 10⁻¹⁰ and better.
//! 3. **A certificate** says what the result is: a [`Verdict`].
//!
//! ```math
//! \dot x = f, \qquad \dot\lambda = -H_x - \eta\, c^{(q)}_x, \qquad H = L + \lambda^T f
//! ```
//!
//! | Arc | Control | Junction at its start |
//! |---|---|---|
//! | bang | at a bound | ``H_u = 0`` |
//! | interior | ``H_u = 0`` | ``H_u = 0`` at the bound that is left |
//! | singular, of order 1 | ``\ddot H_u = 0`` | ``H_u = \dot H_u = 0``; nothing at its end |
//! | bound of the state c ≤ 0 of order q | ``c^{(q)} = 0`` | ``c = … = c^{(q-1)} = 0``, jumps ``\lambda^+ = \lambda^- - \sum \pi_k c^{(k)}_x``, and u is continuous, or ``H_u = 0`` after a bang |
//! | touch of order 2 | | ``c = \dot c = 0``, jump ``\pi c_x`` |
//!
//! The Hamiltonian, its derivatives along its own flow and those of c are expressions, differentiated exactly. Functions of a phase have
//! [expressions](crate::collocation::VectorFunction::expressions) where they were traced, are written over a generic scalar, or are
//! the equations of a tree: those are recorded once, as forward dynamics computes them.
//!
//! An orientation is a unit quaternion q with a costate λ that is orthogonal to it: ½ Im(q̄ λ) is the covector of rotations about body
//! axes. The flow keeps the norm of the one and λᵀq of the other, so that neither needs an equation; variations are rotations.
//!
//! What is refused, with a reason and the collocation solution as the best motion: several phases; singular arcs of order 2 and more,
//! whose junctions chatter; bounds of the state of order 3 and more, path constraints that name a control; a bound of the state that
//! holds from the start on; several controls that change at the same time. A structure that is wrong gives no solution, or one that
//! the certificate finds wrong.
//!
//! Sources: A. E. Bryson and Y.-C. Ho, *Applied Optimal Control* (1975), sections 3.11, 6 and 8; H. Maurer, *On optimal control problems with
//! bounded state variables and control appearing linearly*, SIAM J. Control Optim. 15 (1977); N. P. Osmolovskii and H. Maurer,
//! *Applications to Regular and Bang-Bang Control*, SIAM (2012); P. Deuflhard, *Newton Methods for Nonlinear Problems* (2004).

mod certificate;
mod ends;
mod flow;
mod hamiltonian;
mod kind;
mod polish;
mod samples;
mod second_order;
mod shooting;
mod structure;
mod verdict;

pub use kind::{ArcKind, ControlKind};
pub(crate) use polish::is_hopeless;
pub use polish::{Arc, Instant, Polish, Polished};
pub use verdict::Verdict;
