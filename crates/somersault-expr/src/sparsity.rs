//! Where a matrix may be other than zero.

/// Where a sparse matrix may be other than zero: compressed columns, rows ascending in each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sparsity {
    /// Number of rows.
    pub n_rows: usize,
    /// Start of each column in `rows`, and the end of the last one.
    pub columns: Vec<usize>,
    /// Row of each entry.
    pub rows: Vec<usize>,
}

impl Sparsity {
    /// Number of columns.
    pub fn n_columns(&self) -> usize {
        self.columns.len().saturating_sub(1)
    }

    /// The entries as (row, column), in the order of the values.
    pub fn entries(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..self.n_columns()).flat_map(move |column| {
            self.rows[self.columns[column]..self.columns[column + 1]].iter().map(move |&row| (row, column))
        })
    }
}
