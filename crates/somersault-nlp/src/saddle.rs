//! The matrix of a quadratic program with equalities, and its factors.
//!
//! ```text
//! | H   Jᵀ |
//! | J   D  |
//! ```
//! The pattern has the whole diagonal and never changes, so that ordering (AMD) and symbolic analysis happen once. The factors
//! are LDLᵀ without pivoting: they exist for any ordering where the matrix is quasi-definite, and where D is only slightly
//! negative refinement takes out what that costs. Where columns of L are short they are made one entry after the other (QDLDL, as
//! clarabel brings it), where they are long by dense [blocks](crate::supernodal).

use crate::error::SolverError;
use crate::nlp::Pattern;
use crate::supernodal::SupernodalFactors;
use clarabel::algebra::CscMatrix;
use clarabel::qdldl::{QDLDLFactorisation, QDLDLSettings};

/// Operations for each entry of L from which dense blocks are quicker.
const DENSE: f64 = 30.0;

/// Pattern, values and factors.
pub(crate) struct Saddle {
    pattern: Pattern,
    factors: Factors,
    /// Of the upper triangle, written by who uses it.
    pub(crate) values: Vec<f64>,
    /// Where each entry of the Hessian, of the Jacobian and of the diagonal is.
    pub(crate) hessian_at: Vec<usize>,
    pub(crate) jacobian_at: Vec<usize>,
    pub(crate) diagonal_at: Vec<usize>,
    /// Factorisations so far.
    pub(crate) count: usize,
}

enum Factors {
    Simplicial {
        factors: QDLDLFactorisation<f64>,
        /// The numbers of all entries.
        entries: Vec<usize>,
    },
    Supernodal(SupernodalFactors),
}

impl Saddle {
    /// For a Hessian and a Jacobian of these patterns.
    pub(crate) fn try_new(hessian: &Pattern, jacobian: &Pattern) -> Result<Self, SolverError> {
        let (n, m) = (jacobian.n_columns(), jacobian.n_rows);
        let diagonal = (0..n + m).map(|i| (i, i)).collect();
        let upper_left = hessian.entries().map(|(_, i, j)| (i, j)).collect();
        let upper_right = jacobian.entries().map(|(_, i, j)| (j, n + i)).collect();
        let (pattern, [diagonal_at, hessian_at, jacobian_at]) =
            Pattern::with_places_of(n + m, n + m, [diagonal, upper_left, upper_right]);
        let n_entries = pattern.n_entries();
        let settings = QDLDLSettings { logical: true, regularize_enable: false, ..QDLDLSettings::default() };
        let (columns, rows) = (pattern.columns.clone(), pattern.rows.clone());
        let matrix = CscMatrix::new(n + m, n + m, columns, rows, vec![1.0; n_entries]);
        let factors = QDLDLFactorisation::new(&matrix, Some(settings)).map_err(|error| {
            SolverError::Factorisation { n_variables: n, n_constraints: m, reason: error.to_string() }
        })?;
        let lengths = factors.L.colptr.windows(2).map(|ends| (ends[1] - ends[0] + 1) as f64);
        let (n_lower, operations) = lengths.fold((0.0, 0.0), |(sum, squares), l| (sum + l, squares + l * l));
        // QDLDL panics where there is no column
        let factors = if operations > DENSE * n_lower || n + m == 0 {
            Factors::Supernodal(SupernodalFactors::new(&pattern, &factors.perm))
        } else {
            Factors::Simplicial { factors, entries: (0..n_entries).collect() }
        };
        Ok(Self {
            pattern,
            factors,
            values: vec![0.0; n_entries],
            hessian_at,
            jacobian_at,
            diagonal_at,
            count: 0,
        })
    }

    /// Factors the values. False where a pivot vanishes.
    pub(crate) fn factor(&mut self) -> bool {
        match &mut self.factors {
            Factors::Simplicial { factors, entries } => {
                factors.update_values(entries, &self.values);
                factors.refactor().is_ok()
            }
            Factors::Supernodal(factors) => factors.factor(&self.values),
        }
    }

    fn pivots(&self) -> &[f64] {
        match &self.factors {
            Factors::Simplicial { factors, .. } => &factors.D,
            Factors::Supernodal(factors) => factors.pivots(),
        }
    }

    /// Positive pivots of the last factorisation: as many as the matrix has positive eigenvalues (Sylvester).
    pub(crate) fn n_positive(&self) -> usize {
        self.pivots().iter().filter(|d| **d > 0.0).count()
    }

    /// The least positive pivot.
    pub(crate) fn smallest_positive(&self) -> f64 {
        self.pivots().iter().fold(f64::INFINITY, |s, &d| if d > 0.0 { s.min(d) } else { s })
    }

    /// Replaces a right-hand side by what the factors make of it.
    pub(crate) fn solve(&mut self, x: &mut [f64]) {
        match &mut self.factors {
            Factors::Simplicial { factors, .. } => factors.solve(x),
            Factors::Supernodal(factors) => factors.solve(x),
        }
    }

    /// out += K x.
    pub(crate) fn add_product(&self, x: &[f64], out: &mut [f64]) {
        self.pattern.add_symmetric_product(&self.values, x, out);
    }
}
