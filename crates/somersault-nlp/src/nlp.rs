//! A nonlinear program: bounds, sparsity, values and derivatives.

use std::error::Error;
use std::time::Instant;

/// Lower and upper bounds, one pair for each entry.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Bounds {
    /// −∞ where there is none.
    pub lower: Vec<f64>,
    /// ∞ where there is none.
    pub upper: Vec<f64>,
}

impl Bounds {
    /// `n` entries without bounds.
    pub fn free(n: usize) -> Self {
        Self { lower: vec![f64::NEG_INFINITY; n], upper: vec![f64::INFINITY; n] }
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.lower.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.lower.is_empty()
    }

    /// Appends one entry.
    pub fn push(&mut self, lower: f64, upper: f64) {
        self.lower.push(lower);
        self.upper.push(upper);
    }
}

/// Where a sparse matrix may be other than zero: compressed columns, rows ascending in each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pattern {
    /// Number of rows.
    pub n_rows: usize,
    /// Start of each column in `rows`, and the end of the last one.
    pub columns: Vec<usize>,
    /// Row of each entry.
    pub rows: Vec<usize>,
}

impl Pattern {
    /// All entries: values are then the matrix column by column.
    pub fn dense(n_rows: usize, n_columns: usize) -> Self {
        Self {
            n_rows,
            columns: (0..=n_columns).map(|j| j * n_rows).collect(),
            rows: (0..n_columns).flat_map(|_| 0..n_rows).collect(),
        }
    }

    /// The upper triangle of a symmetric matrix, diagonal included.
    pub fn upper_triangle(n: usize) -> Self {
        Self {
            n_rows: n,
            columns: (0..=n).map(|j| j * (j + 1) / 2).collect(),
            rows: (0..n).flat_map(|j| 0..=j).collect(),
        }
    }

    /// The pattern that holds the given entries (row, column), in any order, repetitions allowed.
    pub fn from_entries(
        n_rows: usize,
        n_columns: usize,
        entries: impl IntoIterator<Item = (usize, usize)>,
    ) -> Self {
        Self::with_places(n_rows, n_columns, entries).0
    }

    /// The same, and for each entry where its value is. Who writes to entries has their places from here, where none can be
    /// missing.
    pub fn with_places(
        n_rows: usize,
        n_columns: usize,
        entries: impl IntoIterator<Item = (usize, usize)>,
    ) -> (Self, Vec<usize>) {
        let mut order: Vec<(usize, usize, usize)> =
            entries.into_iter().enumerate().map(|(k, (row, column))| (column, row, k)).collect();
        order.sort_unstable();
        let (mut columns, mut rows) = (vec![0; n_columns + 1], Vec::new());
        let mut places = vec![0; order.len()];
        let mut last = None;
        for (column, row, k) in order {
            if last.replace((row, column)) != Some((row, column)) {
                rows.push(row);
                columns[column + 1] += 1;
            }
            places[k] = rows.len() - 1;
        }
        (0..n_columns).for_each(|column| columns[column + 1] += columns[column]);
        (Self { n_rows, columns, rows }, places)
    }

    /// The same for several lists of entries, with the places of each.
    pub fn with_places_of<const N: usize>(
        n_rows: usize,
        n_columns: usize,
        lists: [Vec<(usize, usize)>; N],
    ) -> (Self, [Vec<usize>; N]) {
        let (pattern, places) = Self::with_places(n_rows, n_columns, lists.iter().flatten().copied());
        let mut rest = places.into_iter();
        (pattern, lists.map(|entries| rest.by_ref().take(entries.len()).collect()))
    }

    /// Number of columns.
    pub fn n_columns(&self) -> usize {
        self.columns.len() - 1
    }

    /// Number of entries.
    pub fn n_entries(&self) -> usize {
        self.rows.len()
    }

    /// An entry of the matrix that has these values; zero outside of the pattern.
    pub fn value(&self, values: &[f64], row: usize, column: usize) -> f64 {
        self.position(row, column).map_or(0.0, |k| values[k])
    }

    /// Adds to an entry of the matrix that has these values; one outside of the pattern is an error.
    pub fn add(&self, values: &mut [f64], row: usize, column: usize, value: f64) -> Result<(), NoEntry> {
        let place = self.position(row, column).ok_or(NoEntry { row, column })?;
        values[place] += value;
        Ok(())
    }

    /// Where the value of an entry is; none outside of the pattern. Not for others: a default in its place would be an entry.
    fn position(&self, row: usize, column: usize) -> Option<usize> {
        let start = self.columns[column];
        let rows = &self.rows[start..self.columns[column + 1]];
        rows.binary_search(&row).ok().map(|k| start + k)
    }

    /// Each entry as (index of its value, row, column).
    pub fn entries(&self) -> impl Iterator<Item = (usize, usize, usize)> + '_ {
        (0..self.n_columns())
            .flat_map(move |j| (self.columns[j]..self.columns[j + 1]).map(move |k| (k, self.rows[k], j)))
    }

    /// out += A x.
    pub fn add_product(&self, values: &[f64], x: &[f64], out: &mut [f64]) {
        for j in 0..self.n_columns() {
            let x = x[j];
            self.column(j, values).for_each(|(i, value)| out[i] += value * x);
        }
    }

    /// out += Aᵀ x.
    pub fn add_transposed_product(&self, values: &[f64], x: &[f64], out: &mut [f64]) {
        for j in 0..self.n_columns() {
            out[j] = self.column(j, values).fold(out[j], |sum, (i, value)| sum + value * x[i]);
        }
    }

    /// out += A x, A symmetric and given by its upper triangle.
    pub fn add_symmetric_product(&self, values: &[f64], x: &[f64], out: &mut [f64]) {
        for j in 0..self.n_columns() {
            let mut sum = out[j];
            for (i, value) in self.column(j, values) {
                sum += value * x[i];
                if i != j {
                    out[i] += value * x[j];
                }
            }
            out[j] = sum;
        }
    }

    /// Rows and values of a column.
    fn column<'a>(&'a self, j: usize, values: &'a [f64]) -> impl Iterator<Item = (usize, f64)> + 'a {
        let of_column = self.columns[j]..self.columns[j + 1];
        self.rows[of_column.clone()].iter().copied().zip(values[of_column].iter().copied())
    }
}

/// What a solver needs to know before it starts.
#[derive(Debug, Clone, PartialEq)]
pub struct Structure {
    /// Of z.
    pub variables: Bounds,
    /// Of c.
    pub constraints: Bounds,
    /// ∂c/∂z.
    pub jacobian: Pattern,
    /// Upper triangle of the Hessian of the Lagrangian.
    pub hessian: Pattern,
}

/// What a Hessian that a program offers is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Curvature {
    /// None is offered: the solver builds its own from gradients.
    None,
    /// The second derivatives of σ f + yᵀ c, possibly indefinite.
    Exact,
    /// Positive semi-definite by construction, near the second derivatives where residuals are small.
    GaussNewton,
}

/// Why a program has no value somewhere.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluationError {
    /// A number is not finite, or cannot be computed there: a solver steps back.
    #[error("{what} has no finite value")]
    Undefined {
        /// What has none.
        what: String,
    },
    /// A user's function failed: a solver stops and hands it on.
    #[error(transparent)]
    Failed(Box<dyn Error + Send + Sync>),
}

/// A derivative has an entry that the pattern of its matrix leaves out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("entry ({row}, {column}) is outside of the pattern of its matrix")]
pub struct NoEntry {
    /// Its row.
    pub row: usize,
    /// Its column.
    pub column: usize,
}

/// A Hessian was asked of a program that offers none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the program offers no Hessian")]
pub struct NoHessian;

impl From<NoHessian> for EvaluationError {
    fn from(error: NoHessian) -> Self {
        Self::Failed(Box::new(error))
    }
}

impl From<NoEntry> for EvaluationError {
    fn from(error: NoEntry) -> Self {
        Self::Failed(Box::new(error))
    }
}

/// A nonlinear program. Its methods write into slices that fit [`Structure`] and allocate nothing.
pub trait Nlp {
    /// Sizes, bounds and patterns, the same at all times.
    fn structure(&self) -> &Structure;

    /// f(z), and c(z) into `constraints`.
    fn evaluate(&mut self, z: &[f64], constraints: &mut [f64]) -> Result<f64, EvaluationError>;

    /// ∇f and the values of ∂c/∂z, at the z of the last [`evaluate`](Self::evaluate).
    fn differentiate(
        &mut self,
        z: &[f64],
        gradient: &mut [f64],
        jacobian: &mut [f64],
    ) -> Result<(), EvaluationError>;

    /// What [`hessian`](Self::hessian) writes.
    fn curvature(&self) -> Curvature;

    /// The values of the Hessian of σ f + yᵀ c, at the z of the last [`differentiate`](Self::differentiate). A program of
    /// [`Curvature::None`] needs none, and answers [`NoHessian`].
    fn hessian(
        &mut self,
        z: &[f64],
        cost_factor: f64,
        multipliers: &[f64],
        hessian: &mut [f64],
    ) -> Result<(), EvaluationError>;

    /// When a solver is to end at the latest, whatever limit of time it has itself: that of a longer search, of which this program is a
    /// part.
    fn deadline(&self) -> Option<Instant> {
        None
    }
}
