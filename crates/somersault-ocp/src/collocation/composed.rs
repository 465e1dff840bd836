//! Traced functions that call functions that cannot be traced.
//!
//! With z the arguments and w what the calls return, call k has wₖ = gₖ(yₖ) with yₖ = Yₖ(z, w₁ … wₖ₋₁), and the function is F(z, w): F
//! and Yₖ are graphs, and gₖ takes few numbers as a rule. With D = ∂(z, w)/∂z, which grows call by call, and μ = ∂(λᵀF)/∂w, which is
//! completed from the last call to the first,
//!
//! ```text
//! f_z = F_(z,w) D,     ∇² λᵀf = Dᵀ (∇² λᵀF + Σ ∇² (μₖᵀGₖ) Yₖ) D + Σ Eₖᵀ ∇² (μₖᵀgₖ) Eₖ,     Gₖ = ∂gₖ/∂yₖ,  Eₖ = Yₖ,(z,w) D
//! ```

use super::error::{CollocationError, Untraced, expect_length};
use super::external::ExternalFunction;
use super::function::{RelativeErrors, VectorFunction};
use super::traced::TracedFunction;
use super::wrong_derivative::Labels;
use crate::WrongDerivative;
use nalgebra::{DMatrix, DVector};
use somersault_expr::ExprFunction;
use somersault_nlp::EvaluationError;

/// A traced function with calls of functions that are not.
pub struct ComposedFunction {
    outer: TracedFunction,
    calls: Vec<Call>,
    n: usize,
    /// (z, w).
    all: Vec<f64>,
}

/// One call.
struct Call {
    /// y of (z, w).
    arguments: TracedFunction,
    function: ExternalFunction,
    /// y as last evaluated.
    given: Vec<f64>,
    /// Where its w begins in (z, w).
    first: usize,
}

impl Call {
    /// w of this call, from those before it.
    fn evaluate(&mut self, all: &mut [f64]) -> Result<(), EvaluationError> {
        self.arguments.evaluate(all, &mut self.given)?;
        finite(&self.given, || format!("an argument of {}", self.function.labels().function))?;
        let w = &mut all[self.first..self.first + self.function.n_outputs()];
        self.function.evaluate(&self.given, w)?;
        finite(w, || format!("`{}`, which is not traced,", self.function.labels().function))
    }

    /// E = Y_(z,w) D.
    fn slopes(&mut self, all: &[f64], d: &DMatrix<f64>) -> Result<DMatrix<f64>, EvaluationError> {
        let mut by = DMatrix::zeros(self.given.len(), all.len());
        self.arguments.jacobian(all, &mut by)?;
        Ok(by * d)
    }

    /// G.
    fn jacobian(&mut self) -> Result<DMatrix<f64>, EvaluationError> {
        let mut jacobian = DMatrix::zeros(self.function.n_outputs(), self.given.len());
        self.function.jacobian(&self.given, &mut jacobian)?;
        Ok(jacobian)
    }
}

fn finite(values: &[f64], what: impl Fn() -> String) -> Result<(), EvaluationError> {
    if values.iter().all(|x| x.is_finite()) {
        Ok(())
    } else {
        Err(EvaluationError::Undefined { what: what() })
    }
}

impl ComposedFunction {
    /// F of (z, w), and for each call, in their order, y of (z, w) and the function called. Inputs of each graph are z, then what all
    /// calls return.
    pub fn try_new(
        outer: &ExprFunction,
        calls: Vec<(&ExprFunction, ExternalFunction)>,
    ) -> Result<Self, CollocationError> {
        let returned: usize = calls.iter().map(|(_, function)| function.n_outputs()).sum();
        let n_all = outer.n_inputs();
        let Some(n) = n_all.checked_sub(returned) else {
            let argument = "inputs of a function with calls";
            return Err(CollocationError::Length { phase: None, argument, expected: returned, found: n_all });
        };
        let (mut made, mut first) = (Vec::new(), n);
        for (arguments, function) in calls {
            expect_length(None, "inputs of the arguments of a call", arguments.n_inputs(), n_all)?;
            expect_length(None, "arguments of a call", arguments.n_outputs(), function.n_arguments())?;
            let n_outputs = function.n_outputs();
            let given = vec![0.0; function.n_arguments()];
            made.push(Call { arguments: TracedFunction::try_new(arguments)?, function, given, first });
            first += n_outputs;
        }
        Ok(Self { outer: TracedFunction::try_new(outer)?, calls: made, n, all: vec![0.0; n_all] })
    }

    /// Length of z.
    pub fn n_inputs(&self) -> usize {
        self.n
    }

    /// w at z.
    fn fill(&mut self, arguments: &[f64]) -> Result<(), EvaluationError> {
        self.all[..self.n].copy_from_slice(arguments);
        // what a graph does not depend on must be finite all the same
        self.all[self.n..].fill(0.0);
        self.calls.iter_mut().try_for_each(|call| call.evaluate(&mut self.all))
    }

    /// D at z, with each E and G.
    fn chain(&mut self, arguments: &[f64]) -> Result<(DMatrix<f64>, Slopes), EvaluationError> {
        self.fill(arguments)?;
        let mut d = DMatrix::identity(self.all.len(), self.n);
        let mut slopes = Vec::with_capacity(self.calls.len());
        for call in &mut self.calls {
            let (e, g) = (call.slopes(&self.all, &d)?, call.jacobian()?);
            d.rows_mut(call.first, g.nrows()).copy_from(&(&g * &e));
            slopes.push((e, g));
        }
        Ok((d, slopes))
    }

    /// Tells each call the typical sizes of its arguments.
    fn set_sizes_of_calls(&mut self, arguments: &[f64], sizes: &[f64]) -> Result<(), EvaluationError> {
        self.fill(arguments)?;
        let mut d = DMatrix::identity(self.all.len(), self.n);
        for call in &mut self.calls {
            let e = call.slopes(&self.all, &d)?;
            let size = |j: usize| {
                let moved: f64 = e.row(j).iter().zip(sizes).map(|(e, size)| (e * size).abs()).sum();
                let size = moved.max(call.given[j].abs());
                if size > 0.0 && size.is_finite() { size } else { 1.0 }
            };
            let of_call: Vec<f64> = (0..call.given.len()).map(size).collect();
            call.function.set_sizes(&call.given, &of_call)?;
            let g = call.jacobian()?;
            d.rows_mut(call.first, g.nrows()).copy_from(&(g * e));
        }
        Ok(())
    }
}

/// E and G of each call.
type Slopes = Vec<(DMatrix<f64>, DMatrix<f64>)>;

impl VectorFunction for ComposedFunction {
    fn n_outputs(&self) -> usize {
        self.outer.n_outputs()
    }

    fn evaluate(&mut self, arguments: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        self.fill(arguments)?;
        self.outer.evaluate(&self.all, values)
    }

    fn jacobian(&mut self, arguments: &[f64], jacobian: &mut DMatrix<f64>) -> Result<(), EvaluationError> {
        let (d, _) = self.chain(arguments)?;
        let mut by = DMatrix::zeros(self.outer.n_outputs(), self.all.len());
        self.outer.jacobian(&self.all, &mut by)?;
        by.mul_to(&d, jacobian);
        Ok(())
    }

    fn add_hessian(
        &mut self,
        arguments: &[f64],
        weights: &[f64],
        hessian: &mut DMatrix<f64>,
    ) -> Result<(), EvaluationError> {
        let (d, slopes) = self.chain(arguments)?;
        let n_all = self.all.len();
        let mut by = DMatrix::zeros(self.outer.n_outputs(), n_all);
        self.outer.jacobian(&self.all, &mut by)?;
        let mut mu = by.tr_mul(&DVector::from_column_slice(weights));
        let mut inner = DMatrix::zeros(n_all, n_all);
        self.outer.add_hessian(&self.all, weights, &mut inner)?;
        for (call, (e, g)) in self.calls.iter_mut().zip(&slopes).rev() {
            let own = mu.rows(call.first, g.nrows()).into_owned();
            let n_given = call.given.len();
            let mut bend = DMatrix::zeros(n_given, n_given);
            call.function.add_hessian(&call.given, own.as_slice(), &mut bend)?;
            bend.fill_lower_triangle_with_upper_triangle();
            *hessian += e.tr_mul(&(bend * e));
            let nu = g.tr_mul(&own);
            call.arguments.add_hessian(&self.all, nu.as_slice(), &mut inner)?;
            let mut by = DMatrix::zeros(n_given, n_all);
            call.arguments.jacobian(&self.all, &mut by)?;
            mu += by.tr_mul(&nu);
        }
        inner.fill_lower_triangle_with_upper_triangle();
        *hessian += d.tr_mul(&(inner * &d));
        Ok(())
    }

    fn expressions(&self, at: &[f64]) -> Result<ExprFunction, Untraced> {
        match self.calls.first() {
            Some(call) => Err(Untraced::Call { function: call.function.labels().function.clone() }),
            None => self.outer.expressions(at),
        }
    }

    fn set_sizes(&mut self, arguments: &[f64], sizes: &[f64]) -> Result<(), EvaluationError> {
        self.set_sizes_of_calls(arguments, sizes)
    }

    fn relative_errors(&self) -> RelativeErrors {
        self.calls
            .iter()
            .map(|call| call.function.relative_errors())
            .fold(RelativeErrors::default(), RelativeErrors::max)
    }

    fn brings_derivatives(&self) -> bool {
        self.calls.iter().any(|call| call.function.brings_derivatives())
    }

    fn wrong_derivative(
        &mut self,
        arguments: &[f64],
        _: &[f64],
        labels: &Labels,
    ) -> Result<Option<WrongDerivative>, EvaluationError> {
        self.fill(arguments)?;
        for call in &mut self.calls {
            let sizes = call.function.sizes().to_vec();
            let found = call.function.wrong_derivative(&call.given, &sizes, labels)?;
            if found.is_some() {
                return Ok(found);
            }
        }
        Ok(None)
    }
}
