//! Hybrid dynamics: some degrees of freedom move as prescribed, the others as their joint forces let them.
//!
//! ```text
//! M_pp a_p + M_pa a_a + h_p = τ_p,    M_ap a_p + M_aa a_a + h_a = τ_a          (thesis C.24)
//! ```
//! Of every degree of freedom one of acceleration and joint force is *known*, the force of the passive and the
//! acceleration of the active ones, and the other is *found*. Any tree does this ([`Tree`]), with any division into
//! passive and active; the pendulum on a cart also does it in closed form ([`CartPendulumDynamics`]).

mod cart_pendulum;
mod group;
mod tree;

pub use cart_pendulum::CartPendulumDynamics;
pub(crate) use group::GroupTransport;
pub use tree::Tree;
pub(crate) use tree::undefined;

use nalgebra::Matrix6;
use somersault_nlp::EvaluationError;
use std::ops::Range;

/// The degrees of freedom of a system.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Dofs {
    /// Numbers in q.
    pub n_positions: usize,
    /// For each degree of freedom, whether its acceleration is prescribed.
    pub active: Vec<bool>,
    /// For each degree of freedom its place in q, if it is the only one of its joint.
    pub positions: Vec<Option<usize>>,
    /// The degrees of freedom of each joint whose displacements do not commute; at most six.
    pub groups: Vec<Range<usize>>,
}

impl Dofs {
    /// Numbers in v.
    pub fn n_velocities(&self) -> usize {
        self.active.len()
    }

    /// The active degrees of freedom, ascending.
    pub fn active_dofs(&self) -> Vec<usize> {
        (0..self.active.len()).filter(|k| self.active[*k]).collect()
    }

    /// The passive degrees of freedom, ascending.
    pub fn passive_dofs(&self) -> Vec<usize> {
        (0..self.active.len()).filter(|k| !self.active[*k]).collect()
    }
}

/// A system whose degrees of freedom are passive or active, with its workspace.
///
/// Displacements and velocities act from the right, q(t + h) ≈ q(t) ⊕ h v. Nothing allocates after construction.
pub trait HybridDynamics: Send {
    /// Its degrees of freedom.
    fn dofs(&self) -> &Dofs;

    /// Writes what is found for (q, v, known).
    fn calc(&mut self, q: &[f64], v: &[f64], known: &[f64], found: &mut [f64])
    -> Result<(), EvaluationError>;

    /// Writes the partials of what is found by displacements of q, by v and by what is known: three square matrices one
    /// after the other, by columns.
    fn calc_diff(
        &mut self,
        q: &[f64],
        v: &[f64],
        known: &[f64],
        partials: &mut [f64],
    ) -> Result<(), EvaluationError>;

    /// Its second derivatives; none where displacements do not commute, or nobody has written them.
    fn second_derivatives(&mut self) -> Option<&mut dyn HybridSecondDerivatives>;

    /// out ← q ⊕ d; where displacements commute the sum, as by default.
    fn displace(&self, q: &[f64], d: &[f64], out: &mut [f64]) -> Result<(), EvaluationError> {
        out.iter_mut().zip(q.iter().zip(d)).for_each(|(out, (q, d))| *out = q + d);
        Ok(())
    }

    /// out ← the d of least rotation with `from` ⊕ d = `to`; where displacements commute the difference, as by default.
    fn difference(&self, from: &[f64], to: &[f64], out: &mut [f64]) -> Result<(), EvaluationError> {
        out.iter_mut().zip(from.iter().zip(to)).for_each(|(out, (from, to))| *out = to - from);
        Ok(())
    }

    /// A and J of a displacement `d` of all degrees of freedom, in group number `group` of [`Dofs::groups`]:
    /// (q ⊕ ε) ⊕ d = (q ⊕ d) ⊕ A ε and q ⊕ (d + ε) = (q ⊕ d) ⊕ J ε + O(ε²); both have ones on the diagonal beyond the degrees of
    /// freedom of the group. Where displacements commute they are ones, as by default.
    fn displacement_maps(&self, _group: usize, _d: &[f64]) -> [Matrix6<f64>; 2] {
        [Matrix6::identity(); 2]
    }
}

/// Second derivatives of [`HybridDynamics`] whose displacements commute.
pub trait HybridSecondDerivatives {
    /// Adds Σ w_i ∂²found_i to `out`: second derivatives by q, by v and by what is known, one square matrix of three times
    /// the degrees of freedom.
    fn add_second_derivatives(
        &mut self,
        q: &[f64],
        v: &[f64],
        known: &[f64],
        weights: &[f64],
        out: &mut [f64],
    ) -> Result<(), EvaluationError>;
}
