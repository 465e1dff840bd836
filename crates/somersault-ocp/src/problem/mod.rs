//! Motion problems: costs and constraints composed of terms, over any transcription.
//!
//! ```text
//! minimise  Σ Φ(r(x_k)) + Σ ∫ L(r(x)) dt
//! subject to  l ≤ r(x_k) ≤ u,   l ≤ ∫ r dt ≤ u,   l ≤ A z ≤ u,   defects and bounds of the transcription
//! ```
//! Each r is a [`Term`] and Φ, L are a [`Loss`]. A constraint at every node is a path constraint (thesis 2.23). The
//! problem is an [`Nlp`](somersault_nlp::Nlp): its gradient is one adjoint sweep, its Jacobian one sweep for each row or one
//! forward sweep for all variables, whichever is less, and its Hessian that of Gauss and Newton, which drops the
//! curvature of the terms and of the constraints, unless the exact one is requested.

mod jacobian;
mod loss;
mod program;

pub use jacobian::Sweep;
pub use loss::{At, Loss};

use crate::error::{OcpError, expect_below, expect_bounds};
use crate::term::{NodeGradient, Term};
use crate::transcription::{Outline, RolloutGradient, Transcription};
use somersault_core::argument::{expect_finite, expect_length, expect_positive};
use somersault_nlp::{Bounds, Pattern, Structure};

/// What the Hessian has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Model {
    /// The curvature of losses.
    GaussNewton,
    /// That of terms too.
    Terms,
    /// That of the motion too.
    Exact,
}

/// A term, and the nodes at which it is taken.
struct SampledTerm {
    term: Box<dyn Term>,
    nodes: Vec<usize>,
}

/// Part of the cost.
struct Cost {
    sampled: SampledTerm,
    loss: Loss,
    /// With quadrature weights.
    integrated: bool,
}

/// Rows of the constraints: for each node, or one set for the integral over all of them.
struct Constraint {
    sampled: SampledTerm,
    bounds: Bounds,
    integrated: bool,
    first_row: usize,
}

/// Σ factor z_variable.
struct LinearConstraint {
    name: String,
    factors: Vec<(usize, f64)>,
}

/// Collects costs and constraints.
pub struct MotionProblemBuilder<T> {
    transcription: T,
    costs: Vec<Cost>,
    constraints: Vec<Constraint>,
    linear: Vec<LinearConstraint>,
    linear_bounds: Bounds,
    variables: Bounds,
    sweep: Option<Sweep>,
    model: Model,
}

/// Costs and constraints over a transcription; an [`Nlp`](somersault_nlp::Nlp).
pub struct MotionProblem<T> {
    transcription: T,
    costs: Vec<Cost>,
    constraints: Vec<Constraint>,
    linear: Vec<LinearConstraint>,
    structure: Structure,
    sweep: Sweep,
    model: Model,
    rows: jacobian::Rows,
    work: Work,
}

/// Room for one term at one node, and for a sweep.
struct Work {
    value: Vec<f64>,
    seed: Vec<f64>,
    node: NodeGradient,
    rollout: RolloutGradient,
    /// One entry for each variable.
    variables: Vec<f64>,
    defects: Vec<f64>,
    /// Of the numbers that a curved term depends on, and the same times its second derivatives.
    tangents: Vec<f64>,
    bent: Vec<f64>,
}

impl<T: Transcription> MotionProblem<T> {
    /// A problem over `transcription`, which so far costs nothing.
    pub fn builder(transcription: T) -> MotionProblemBuilder<T> {
        let variables = transcription.outline().variables.clone();
        MotionProblemBuilder {
            transcription,
            costs: Vec::new(),
            constraints: Vec::new(),
            linear: Vec::new(),
            linear_bounds: Bounds::default(),
            variables,
            sweep: None,
            model: Model::GaussNewton,
        }
    }

    /// The transcription, which holds the motion of the last evaluation.
    pub fn transcription(&self) -> &T {
        &self.transcription
    }

    /// The transcription, to roll out another motion, say.
    pub fn transcription_mut(&mut self) -> &mut T {
        &mut self.transcription
    }

    /// How the Jacobian is made.
    pub fn sweep(&self) -> Sweep {
        self.sweep
    }

    /// A name for each row of the constraints.
    pub fn constraint_names(&self) -> Vec<String> {
        let mut names: Vec<String> = (0..self.outline().n_defects()).map(|i| format!("defect {i}")).collect();
        for constraint in &self.constraints {
            let SampledTerm { term, nodes } = &constraint.sampled;
            let rows = |place: String| {
                (0..term.n_rows()).map(move |i| format!("{} {i} {place}", term.name())).collect::<Vec<_>>()
            };
            if constraint.integrated {
                names.extend(rows("over time".to_owned()));
            } else {
                names.extend(nodes.iter().flat_map(|k| rows(format!("at node {k}"))));
            }
        }
        names.extend(self.linear.iter().map(|l| l.name.clone()));
        names
    }

    fn outline(&self) -> &Outline {
        self.transcription.outline()
    }
}

impl<T: Transcription> MotionProblemBuilder<T> {
    /// The transcription.
    pub fn transcription(&self) -> &T {
        &self.transcription
    }

    /// Mayer term: adds the loss at each of the nodes.
    pub fn mayer(mut self, at: At, term: impl Term + 'static, loss: Loss) -> Result<Self, OcpError> {
        self.add_cost(at, Box::new(term), loss, false)?;
        Ok(self)
    }

    /// Lagrange term: adds the integral of the loss over the whole motion.
    pub fn lagrange(self, term: impl Term + 'static, loss: Loss) -> Result<Self, OcpError> {
        self.lagrange_over(At::EveryNode, term, loss)
    }

    /// Lagrange term over the given nodes, those of a phase, say.
    pub fn lagrange_over(mut self, at: At, term: impl Term + 'static, loss: Loss) -> Result<Self, OcpError> {
        self.add_cost(at, Box::new(term), loss, true)?;
        Ok(self)
    }

    /// Keeps the rows of a term within bounds at each of the nodes.
    pub fn constrain(mut self, at: At, term: impl Term + 'static, bounds: Bounds) -> Result<Self, OcpError> {
        self.add_constraint(at, Box::new(term), bounds, false)?;
        Ok(self)
    }

    /// Keeps the integrals of the rows of a term over the given nodes within bounds.
    pub fn constrain_integral(
        mut self,
        at: At,
        term: impl Term + 'static,
        bounds: Bounds,
    ) -> Result<Self, OcpError> {
        self.add_constraint(at, Box::new(term), bounds, true)?;
        Ok(self)
    }

    /// Keeps Σ factor z_variable within bounds.
    pub fn constrain_variables(
        mut self,
        name: &str,
        factors: &[(usize, f64)],
        lower: f64,
        upper: f64,
    ) -> Result<Self, OcpError> {
        for (variable, factor) in factors {
            expect_below(name, *variable, self.variables.len())?;
            expect_finite("factors", [factor])?;
        }
        self.linear_bounds.push(lower, upper);
        expect_bounds(name, &self.linear_bounds)?;
        self.linear.push(LinearConstraint { name: name.to_owned(), factors: factors.to_vec() });
        Ok(self)
    }

    /// Narrows the bounds of a variable.
    pub fn bound_variable(mut self, variable: usize, lower: f64, upper: f64) -> Result<Self, OcpError> {
        expect_below("variable", variable, self.variables.len())?;
        let Bounds { lower: lowers, upper: uppers } = &mut self.variables;
        // NaN must not be lost in a maximum
        if lower.is_nan() || upper.is_nan() {
            (lowers[variable], uppers[variable]) = (lower, upper);
        } else {
            lowers[variable] = lowers[variable].max(lower);
            uppers[variable] = uppers[variable].min(upper);
        }
        expect_bounds("variables", &self.variables)?;
        Ok(self)
    }

    /// Asks for one way to make the Jacobian instead of the cheaper one.
    pub fn with_sweep(mut self, sweep: Sweep) -> Self {
        self.sweep = Some(sweep);
        self
    }

    /// Asks for the exact Hessian of the Lagrangian in place of that of Gauss and Newton. It takes a transcription with
    /// second derivatives and terms that are linear in the node or have second derivatives too.
    pub fn with_exact_hessian(mut self) -> Self {
        self.model = Model::Exact;
        self
    }

    /// Adds to the Hessian of Gauss and Newton the curvature of terms in the numbers of their nodes, and leaves that of the motion out.
    /// It takes terms that are linear in the node or have second derivatives; costs are to be convex.
    pub fn with_curved_terms(mut self) -> Self {
        self.model = Model::Terms;
        self
    }

    /// Fails where something has no second derivatives.
    fn expect_curvature(&mut self) -> Result<(), OcpError> {
        if self.model == Model::Exact && self.transcription.second_derivatives().is_none() {
            return Err(OcpError::NoCurvature { what: "the transcription".to_owned() });
        }
        let sampled = self
            .costs
            .iter_mut()
            .map(|c| &mut c.sampled)
            .chain(self.constraints.iter_mut().map(|c| &mut c.sampled));
        let is_missing = |term: &mut Box<dyn Term>| !term.is_linear() && term.second_derivatives().is_none();
        match sampled.map(|sampled| &mut sampled.term).find_map(|term| is_missing(term).then_some(term)) {
            Some(term) => Err(OcpError::NoCurvature { what: term.name().to_owned() }),
            None => Ok(()),
        }
    }

    /// Fails where there is nothing to choose.
    fn expect_variables(&self) -> Result<(), OcpError> {
        let Bounds { lower, upper } = &self.variables;
        match lower.len() {
            0 => Err(OcpError::NoVariables),
            n_variables if lower == upper => Err(OcpError::NothingFree { n_variables }),
            _ => Ok(()),
        }
    }

    /// The problem.
    pub fn build(mut self) -> Result<MotionProblem<T>, OcpError> {
        self.expect_variables()?;
        if self.model != Model::GaussNewton {
            self.expect_curvature()?;
        }
        let Self { transcription, costs, mut constraints, linear, linear_bounds, variables, sweep, model } =
            self;
        let is_curved = model != Model::GaussNewton;
        let outline = transcription.outline();
        let mut bounds = outline.defects.clone();
        for constraint in &mut constraints {
            constraint.first_row = bounds.len();
            let sets = if constraint.integrated { 1 } else { constraint.sampled.nodes.len() };
            for _ in 0..sets {
                for (lower, upper) in constraint.bounds.lower.iter().zip(&constraint.bounds.upper) {
                    bounds.push(*lower, *upper);
                }
            }
        }
        let n_swept = bounds.len();
        for (lower, upper) in linear_bounds.lower.iter().zip(&linear_bounds.upper) {
            bounds.push(*lower, *upper);
        }
        let (rows, jacobian) = jacobian::Rows::new(&transcription, &costs, &constraints, &linear, is_curved);
        let n = outline.n_variables();
        let curved: Vec<Vec<usize>> = if is_curved {
            (0..outline.n_nodes()).map(|k| transcription.variables_of_node(k)).collect()
        } else {
            let nodes =
                costs.iter().filter(|cost| cost.loss.is_curved()).flat_map(|cost| &cost.sampled.nodes);
            nodes.map(|k| transcription.variables_of_node(*k)).collect()
        };
        let hessian = if curved.iter().any(|variables| variables.len() == n) {
            Pattern::upper_triangle(n)
        } else {
            let pairs = curved.iter().flat_map(|v| v.iter().flat_map(|j| v.iter().map(|i| (*i, *j))));
            Pattern::from_entries(n, n, pairs.filter(|(i, j)| i <= j))
        };
        let n_rows = costs.iter().map(|c| &c.sampled).chain(constraints.iter().map(|c| &c.sampled));
        let n_rows = n_rows.map(|sampled| sampled.term.n_rows()).max().unwrap_or(0);
        let work = Work {
            value: vec![0.0; n_rows],
            seed: vec![0.0; n_rows],
            node: outline.sizes.gradient(),
            rollout: RolloutGradient::new(outline),
            variables: vec![0.0; n],
            defects: vec![0.0; rows.n_defect_entries()],
            tangents: Vec::new(),
            bent: Vec::new(),
        };
        // an adjoint sweep costs about as much as one tangent in a forward sweep
        let cheaper = if n_swept < n { Sweep::Adjoint } else { Sweep::Forward };
        let structure = Structure { variables, constraints: bounds, jacobian, hessian };
        let sweep = sweep.unwrap_or(cheaper);
        Ok(MotionProblem { transcription, costs, constraints, linear, structure, sweep, model, rows, work })
    }

    fn add_cost(
        &mut self,
        at: At,
        term: Box<dyn Term>,
        loss: Loss,
        integrated: bool,
    ) -> Result<(), OcpError> {
        let nodes = at.nodes(self.transcription.outline())?;
        loss.expect_for(term.n_rows())?;
        self.costs.push(Cost { sampled: SampledTerm { term, nodes }, loss, integrated });
        Ok(())
    }

    fn add_constraint(
        &mut self,
        at: At,
        term: Box<dyn Term>,
        bounds: Bounds,
        integrated: bool,
    ) -> Result<(), OcpError> {
        let nodes = at.nodes(self.transcription.outline())?;
        expect_positive("n_rows", term.n_rows() as f64)?;
        expect_length("bounds", bounds.len(), term.n_rows())?;
        expect_bounds("bounds", &bounds)?;
        self.constraints.push(Constraint {
            sampled: SampledTerm { term, nodes },
            bounds,
            integrated,
            first_row: 0,
        });
        Ok(())
    }
}
