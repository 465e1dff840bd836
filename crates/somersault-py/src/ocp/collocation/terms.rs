//! Costs and path constraints of a problem.

use somersault::core::Scalar;
use somersault::ocp::collocation::{Ends, Point, Terms};
use somersault::ocp::nalgebra::convert;

/// L = ½ Σ γᵢ uᵢ² + ½ Σ wᵢ (xᵢ − x*ᵢ)² + c, Φ = ½ Σ Wᵢ (xᵢ(t_f) − x*ᵢ)².
#[derive(Clone)]
pub(super) struct Quadratic {
    pub(super) control_weights: Vec<f64>,
    pub(super) state_weights: Vec<f64>,
    pub(super) final_weights: Vec<f64>,
    pub(super) target: Vec<f64>,
    pub(super) time_weight: f64,
    /// Rows over (x, u).
    pub(super) path: Vec<Vec<f64>>,
}

fn half_squares<T: Scalar>(weights: &[f64], values: &[T], target: impl Iterator<Item = f64>) -> T {
    weights.iter().zip(values).zip(target).fold(T::zero(), |sum, ((&w, &x), target)| {
        let apart = x - convert::<f64, T>(target);
        sum + apart * apart * convert::<f64, T>(0.5 * w)
    })
}

impl Terms for Quadratic {
    fn n_path_constraints(&self) -> usize {
        self.path.len()
    }

    fn path_constraints<T: Scalar>(&self, at: &Point<'_, T>, values: &mut [T]) {
        for (value, row) in values.iter_mut().zip(&self.path) {
            let numbers = at.state.iter().chain(at.control);
            *value = row.iter().zip(numbers).fold(T::zero(), |sum, (&a, &x)| sum + x * convert::<f64, T>(a));
        }
    }

    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        half_squares(&self.control_weights, at.control, std::iter::repeat(0.0))
            + half_squares(&self.state_weights, at.state, self.target.iter().copied())
            + convert::<f64, T>(self.time_weight)
    }

    fn end_cost<T: Scalar>(&self, ends: &Ends<'_, T>) -> T {
        half_squares(&self.final_weights, ends.final_state, self.target.iter().copied())
    }
}
