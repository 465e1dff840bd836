//! LDLᵀ of a sparse symmetric matrix by dense blocks, in vector instructions.
//!
//! Columns of the factor that have nearly the same rows are one *supernode*, whose columns are stored as a dense matrix. The
//! method is multifrontal (Duff and Reid 1983): each supernode gathers the entries of its columns and what its children in the
//! elimination tree leave into a dense *front*, eliminates its own columns there, and leaves the rest to its parent. Supernodes
//! are merged with their parents where that adds few zeros, by the rule of CHOLMOD (Chen, Davis, Hager and Rajamanickam 2008).
//!
//! There are no pivots beyond the order given, as in a simplicial factorisation: the factors exist for any order where the
//! matrix is quasi-definite. All instruction sets give the same bits.

use crate::nlp::Pattern;
use somersault_core::lanes::{InstructionSet, Kernel, Lanes, WIDEST};
use std::ops::Range;

/// Columns that are eliminated at a time.
const PANEL: usize = 16;
/// Rows of a front are a multiple of it: two vectors of any width.
const ROWS: usize = 2 * WIDEST;
/// Columns that a block of rows is subtracted from at a time.
const COLUMNS: usize = 4;
/// Columns up to which supernodes are merged, and the fraction of zeros that they may then have.
const MERGED: [(usize, f64); 3] = [(16, 0.8), (48, 0.1), (usize::MAX, 0.05)];
/// Supernodes of so many columns together are merged whatever zeros that adds.
const SMALLEST: usize = 4;

/// Pattern and factors.
#[derive(Debug)]
pub(crate) struct SupernodalFactors {
    /// The row that is eliminated as the k-th.
    order: Vec<usize>,
    supernodes: Vec<Supernode>,
    /// By supernodes: rows below their columns, as numbers in the order.
    below: Vec<usize>,
    /// Where those stand in the front of the parent.
    in_parent: Vec<usize>,
    /// By supernodes: entries of the matrix, and where they stand in the front.
    entries: Vec<Entry>,
    /// The columns of the factor below the diagonal, each with all rows of its front and zeros elsewhere.
    lower: Vec<f64>,
    /// D.
    pivots: Vec<f64>,
    work: Work,
    instructions: InstructionSet,
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    value: usize,
    place: usize,
}

#[derive(Debug, Clone)]
struct Supernode {
    columns: Range<usize>,
    /// Rows below, in `below` and `in_parent`.
    below: Range<usize>,
    /// Distance of columns of the front.
    stride: usize,
    /// Where its columns are in `lower`.
    lower: usize,
    entries: Range<usize>,
    children: Vec<usize>,
    /// Where in the stack is what it leaves to its parent.
    left: usize,
}

impl Supernode {
    fn width(&self) -> usize {
        self.columns.len()
    }

    fn height(&self) -> usize {
        self.columns.len() + self.below.len()
    }

    /// Numbers of a column of the factor.
    fn length(&self) -> usize {
        self.height().next_multiple_of(WIDEST)
    }
}

#[derive(Debug, Default)]
struct Work {
    front: Vec<f64>,
    /// What fronts leave to those of their parents, the lower triangles of square matrices.
    stack: Vec<f64>,
    /// A panel of L by blocks of rows, in each column by column.
    panel: Vec<f64>,
    /// The rows of the panel times D by blocks of [`COLUMNS`], in each column by column.
    scaled: Vec<f64>,
    /// A right-hand side in the order.
    right: Vec<f64>,
    /// Its rows of one front.
    rows: Vec<f64>,
}

/// The entries of a symmetric matrix by their columns in the lower triangle, as it is eliminated.
struct Columns {
    starts: Vec<usize>,
    /// The row of each entry, at or below the diagonal.
    rows: Vec<usize>,
    /// Which entry of the pattern it is.
    values: Vec<usize>,
}

impl Columns {
    /// For rows that are eliminated as these.
    fn new(pattern: &Pattern, place: &[usize]) -> Self {
        let n = place.len();
        let ends = |i: usize, j: usize| (place[i].min(place[j]), place[i].max(place[j]));
        let mut starts = vec![0; n + 1];
        pattern.entries().for_each(|(_, i, j)| starts[ends(i, j).0 + 1] += 1);
        (0..n).for_each(|column| starts[column + 1] += starts[column]);
        let (mut rows, mut values) = (vec![0; pattern.n_entries()], vec![0; pattern.n_entries()]);
        let mut next = starts.clone();
        for (k, i, j) in pattern.entries() {
            let (column, row) = ends(i, j);
            (rows[next[column]], values[next[column]]) = (row, k);
            next[column] += 1;
        }
        Self { starts, rows, values }
    }

    fn of(&self, columns: Range<usize>) -> Range<usize> {
        self.starts[columns.start]..self.starts[columns.end]
    }
}

/// Where each row is in an order.
fn inverse(order: &[usize]) -> Vec<usize> {
    let mut place = vec![0; order.len()];
    order.iter().enumerate().for_each(|(k, row)| place[*row] = k);
    place
}

/// The elimination tree, and the sizes of the factor.
struct Tree {
    /// The number of columns for roots.
    parent: Vec<usize>,
    /// Entries of the columns of the factor, diagonals included.
    counts: Vec<usize>,
}

impl Tree {
    /// Of a matrix that is eliminated in the order in which `turned` has the rows from the last to the first.
    fn new(turned: &Columns) -> Self {
        let n = turned.starts.len() - 1;
        let (mut parent, mut counts, mut reached) = (vec![n; n], vec![1; n], vec![n; n]);
        for row in 0..n {
            reached[row] = row;
            // in the upper triangle of the matrix this is the row's column
            let of_row = turned.of(n - 1 - row..n - row);
            for entry in &turned.rows[of_row] {
                let mut column = n - 1 - entry;
                while reached[column] != row {
                    if parent[column] == n {
                        parent[column] = row;
                    }
                    counts[column] += 1;
                    reached[column] = row;
                    column = parent[column];
                }
            }
        }
        Self { parent, counts }
    }

    /// The columns with children before parents, and those of each subtree together.
    fn postorder(&self) -> Vec<usize> {
        let n = self.parent.len();
        // the first child of each column, and the next child of its parent
        let (mut first, mut next) = (vec![n; n + 1], vec![n; n]);
        for column in (0..n).rev() {
            next[column] = std::mem::replace(&mut first[self.parent[column]], column);
        }
        let (mut out, mut open) = (Vec::with_capacity(n), vec![n]);
        while let Some(column) = open.last().copied() {
            let child = first[column];
            if child < n {
                first[column] = next[child];
                open.push(child);
            } else {
                open.pop();
                out.extend((column < n).then_some(column));
            }
        }
        out
    }

    /// The same tree with its columns in another order, which has children before parents, too.
    fn reordered(&self, order: &[usize]) -> Self {
        let mut place = inverse(order);
        place.push(order.len());
        Self {
            parent: order.iter().map(|column| place[self.parent[*column]]).collect(),
            counts: order.iter().map(|column| self.counts[*column]).collect(),
        }
    }

    /// Columns of the supernodes, for columns in postorder.
    fn supernodes(&self) -> Vec<Range<usize>> {
        let (n, Self { parent, counts, .. }) = (self.parent.len(), self);
        let continues =
            |column: usize| parent[column - 1] == column && counts[column - 1] == counts[column] + 1;
        let mut starts: Vec<usize> = (0..n).filter(|column| *column == 0 || !continues(*column)).collect();
        starts.push(n);
        // by their first columns, last first: columns, rows of the first column, and zeros
        let mut merged: Vec<(Range<usize>, usize, usize)> = Vec::new();
        for pair in starts.windows(2).rev() {
            let (mut columns, mut height, mut zeros) = (pair[0]..pair[1], counts[pair[0]], 0);
            if let Some((next, next_height, next_zeros)) = merged.last()
                && next.contains(&parent[columns.end - 1])
            {
                let (width, next_width) = (columns.len(), next.len());
                let together = width + next_width;
                let joint_height = width + next_height;
                let joint_zeros = next_zeros + width * (joint_height - height);
                let size = together * (together + 1) / 2 + together * (next_height - next_width);
                let fraction = joint_zeros as f64 / size as f64;
                if together <= SMALLEST
                    || MERGED.iter().any(|(most, allowed)| together <= *most && fraction < *allowed)
                {
                    (columns.end, height, zeros) = (next.end, joint_height, joint_zeros);
                    merged.pop();
                }
            }
            merged.push((columns, height, zeros));
        }
        merged.into_iter().rev().map(|(columns, ..)| columns).collect()
    }
}

impl SupernodalFactors {
    /// For matrices whose upper triangle has this pattern, diagonal included, eliminated in the given order of rows.
    pub(crate) fn new(pattern: &Pattern, order: &[usize]) -> Self {
        let n = order.len();
        let turned: Vec<usize> = order.iter().rev().copied().collect();
        let tree = Tree::new(&Columns::new(pattern, &inverse(&turned)));
        let sorted = tree.postorder();
        let order: Vec<usize> = sorted.iter().map(|k| order[*k]).collect();
        let matrix = Columns::new(pattern, &inverse(&order));
        let columns = tree.reordered(&sorted).supernodes();
        let mut owner = vec![0; n];
        columns.iter().enumerate().for_each(|(s, columns)| owner[columns.clone()].fill(s));
        let (mut place, mut seen) = (vec![0; n], vec![usize::MAX; n]);
        let mut children = vec![Vec::new(); columns.len()];
        let mut factors = Self {
            order,
            supernodes: Vec::with_capacity(columns.len()),
            below: Vec::new(),
            in_parent: Vec::new(),
            entries: Vec::new(),
            lower: Vec::new(),
            pivots: vec![0.0; n],
            work: Work::default(),
            instructions: InstructionSet::detect(),
        };
        let (mut n_lower, mut top, mut highest, mut largest) = (0, 0, 0, 0);
        for (s, columns) in columns.into_iter().enumerate() {
            let Self { supernodes, below, in_parent, entries, .. } = &mut factors;
            let children_of_s = std::mem::take(&mut children[s]);
            let rows = rows_below(&columns, &matrix, &children_of_s, supernodes, below, &mut seen, s);
            columns.clone().chain(rows.iter().copied()).enumerate().for_each(|(k, row)| place[row] = k);
            let height = columns.len() + rows.len();
            let stride = height.next_multiple_of(ROWS);
            for child in &children_of_s {
                let rows = supernodes[*child].below.clone();
                in_parent[rows.clone()].iter_mut().zip(&below[rows]).for_each(|(k, row)| *k = place[*row]);
            }
            // what the children leave lies last in the stack, and what this one leaves replaces it
            let left = children_of_s.first().map_or(top, |child| supernodes[*child].left);
            top = left + rows.len() * rows.len();
            (highest, largest) = (top.max(highest), stride.max(largest));
            if let Some(row) = rows.first() {
                children[owner[*row]].push(s);
            }
            let n_entries = entries.len();
            for (k, column) in columns.clone().enumerate() {
                let of_column = matrix.of(column..column + 1);
                let placed = matrix.rows[of_column.clone()].iter().zip(&matrix.values[of_column]);
                entries.extend(
                    placed.map(|(row, value)| Entry { value: *value, place: place[*row] + k * stride }),
                );
            }
            let n_below = below.len();
            below.extend(rows);
            in_parent.resize(below.len(), 0);
            let width = columns.len();
            supernodes.push(Supernode {
                columns,
                below: n_below..below.len(),
                stride,
                lower: n_lower,
                entries: n_entries..entries.len(),
                children: children_of_s,
                left,
            });
            n_lower += width * height.next_multiple_of(WIDEST);
        }
        factors.lower = vec![0.0; n_lower];
        factors.work = Work {
            front: vec![0.0; largest * largest],
            stack: vec![0.0; highest],
            panel: vec![0.0; largest * PANEL],
            scaled: vec![0.0; largest * PANEL],
            right: vec![0.0; n],
            rows: vec![0.0; largest],
        };
        factors
    }

    /// Factors the matrix with these values. False where a pivot vanishes or is not finite.
    pub(crate) fn factor(&mut self, values: &[f64]) -> bool {
        let instructions = self.instructions;
        instructions.run(Factor { factors: self, values })
    }

    /// D, in the order of elimination.
    pub(crate) fn pivots(&self) -> &[f64] {
        &self.pivots
    }

    /// Replaces a right-hand side by the solution.
    pub(crate) fn solve(&mut self, x: &mut [f64]) {
        let instructions = self.instructions;
        self.work.right.iter_mut().zip(&self.order).for_each(|(to, row)| *to = x[*row]);
        instructions.run(Solve { factors: self });
        self.work.right.iter().zip(&self.order).for_each(|(from, row)| x[*row] = *from);
    }
}

/// Rows of a front below the columns that it eliminates, ascending: those of the matrix and of the children.
fn rows_below(
    columns: &Range<usize>,
    matrix: &Columns,
    children: &[usize],
    supernodes: &[Supernode],
    below: &[usize],
    seen: &mut [usize],
    number: usize,
) -> Vec<usize> {
    let of_matrix = matrix.rows[matrix.of(columns.clone())].iter().copied();
    let of_children =
        children.iter().flat_map(|child| below[supernodes[*child].below.clone()].iter().copied());
    let is_new = |row: &usize| *row >= columns.end && std::mem::replace(&mut seen[*row], number) != number;
    let mut rows: Vec<usize> = of_matrix.chain(of_children).filter(is_new).collect();
    rows.sort_unstable();
    rows
}

/// A factorisation.
struct Factor<'a> {
    factors: &'a mut SupernodalFactors,
    values: &'a [f64],
}

impl Kernel for Factor<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> bool {
        let SupernodalFactors { supernodes, in_parent, entries, lower, pivots, work, .. } = self.factors;
        for supernode in supernodes.iter() {
            let (width, height, stride) = (supernode.width(), supernode.height(), supernode.stride);
            let front = &mut work.front[..height.next_multiple_of(COLUMNS) * stride];
            // what lies above the diagonal is neither read nor kept
            for (k, column) in front.chunks_exact_mut(stride).enumerate() {
                column[k / ROWS * ROWS..].fill(0.0);
            }
            for entry in &entries[supernode.entries.clone()] {
                front[entry.place] += self.values[entry.value];
            }
            for child in &supernode.children {
                let child = &supernodes[*child];
                let places = &in_parent[child.below.clone()];
                let left = &work.stack[child.left..][..places.len() * places.len()];
                for (k, column) in left.chunks_exact(places.len()).enumerate() {
                    let to = &mut front[places[k] * stride..][..stride];
                    for (place, entry) in places[k..].iter().zip(&column[k..]) {
                        to[*place] += entry;
                    }
                }
            }
            let pivots = &mut pivots[supernode.columns.clone()];
            let (panel, scaled) = (&mut work.panel[..stride * PANEL], &mut work.scaled[..stride * PANEL]);
            for first in (0..width).step_by(PANEL) {
                let columns = first..width.min(first + PANEL);
                let own = &mut pivots[columns.clone()];
                if !eliminate(lanes, front, stride, columns.clone(), own, panel, scaled) {
                    return false;
                }
                subtract(lanes, front, stride, columns, height, panel, scaled);
            }
            let own =
                lower[supernode.lower..][..width * supernode.length()].chunks_exact_mut(supernode.length());
            for (k, (to, column)) in own.zip(front.chunks_exact(stride)).enumerate() {
                to[k + 1..height].copy_from_slice(&column[k + 1..height]);
            }
            let n_below = height - width;
            let left = &mut work.stack[supernode.left..][..n_below * n_below];
            for (k, to) in left.chunks_exact_mut(n_below.max(1)).enumerate() {
                let column = &front[(width + k) * stride + width..][..n_below];
                to[k..].copy_from_slice(&column[k..]);
            }
        }
        true
    }
}

/// Eliminates up to [`PANEL`] columns of a front, whose entries from before are there. Leaves L in them, and in the panel; L D in
/// `scaled`, zero for the panel's own columns. False where a pivot vanishes or is not finite.
#[inline(always)]
fn eliminate<L: Lanes>(
    lanes: L,
    front: &mut [f64],
    stride: usize,
    columns: Range<usize>,
    pivots: &mut [f64],
    panel: &mut [f64],
    scaled: &mut [f64],
) -> bool {
    let block = 2 * L::WIDTH;
    for (k, column) in columns.clone().enumerate() {
        let start = column / block * block;
        let mut weights = [0.0; PANEL];
        for (l, weight) in weights[..k].iter_mut().enumerate() {
            // L of this row times D
            *weight = front[(columns.start + l) * stride + column] * pivots[l];
        }
        let own = &mut front[column * stride..][..stride];
        for (rows, earlier) in
            own.chunks_exact_mut(block).zip(panel.chunks_exact(block * PANEL)).skip(start / block)
        {
            let (low, high) = rows.split_at_mut(L::WIDTH);
            let (mut a, mut b) = (lanes.load(low), lanes.load(high));
            for (l, weight) in earlier.chunks_exact(block).zip(&weights[..k]) {
                let weight = lanes.splat(*weight);
                a = lanes.neg_mul_add(lanes.load(l), weight, a);
                b = lanes.neg_mul_add(lanes.load(&l[L::WIDTH..]), weight, b);
            }
            lanes.store(a, low);
            lanes.store(b, high);
        }
        let pivot = own[column];
        if pivot == 0.0 || !pivot.is_finite() {
            return false;
        }
        pivots[k] = pivot;
        let inverse = lanes.splat(1.0 / pivot);
        for (rows, panel) in
            own.chunks_exact_mut(block).zip(panel.chunks_exact_mut(block * PANEL)).skip(start / block)
        {
            let to = &mut panel[k * block..][..block];
            let (low, high) = rows.split_at_mut(L::WIDTH);
            let (to_low, to_high) = to.split_at_mut(L::WIDTH);
            let a = lanes.mul(lanes.load(low), inverse);
            let b = lanes.mul(lanes.load(high), inverse);
            lanes.store(a, to_low);
            lanes.store(b, to_high);
            lanes.store(a, low);
            lanes.store(b, high);
        }
        // rows of the panel itself, which share a block with others, take nothing
        let (first, n_own) = (columns.end / COLUMNS, columns.end % COLUMNS);
        let blocks = scaled.chunks_exact_mut(COLUMNS * PANEL).zip(own.chunks_exact(COLUMNS)).skip(first);
        for (block, rows) in blocks {
            for (to, row) in block[k * COLUMNS..][..COLUMNS].iter_mut().zip(rows) {
                *to = row * pivot;
            }
        }
        if n_own > 0 {
            scaled[(first * PANEL + k) * COLUMNS..][..n_own].fill(0.0);
        }
    }
    true
}

/// Subtracts what eliminated columns take off the rest of a front: L (L D)ᵀ, at and below the diagonal.
#[inline(always)]
fn subtract<L: Lanes>(
    lanes: L,
    front: &mut [f64],
    stride: usize,
    columns: Range<usize>,
    height: usize,
    panel: &[f64],
    scaled: &[f64],
) {
    let block = 2 * L::WIDTH;
    let n = columns.len();
    let first = columns.end / COLUMNS;
    for (group, scaled) in scaled.chunks_exact(COLUMNS * PANEL).enumerate().skip(first) {
        let column = group * COLUMNS;
        if column >= height {
            break;
        }
        let scaled = &scaled[..n * COLUMNS];
        let four = &mut front[column * stride..][..COLUMNS * stride];
        let (c0, rest) = four.split_at_mut(stride);
        let (c1, rest) = rest.split_at_mut(stride);
        let (c2, c3) = rest.split_at_mut(stride);
        let rows = c0
            .chunks_exact_mut(block)
            .zip(c1.chunks_exact_mut(block))
            .zip(c2.chunks_exact_mut(block).zip(c3.chunks_exact_mut(block)));
        for (((r0, r1), (r2, r3)), panel) in rows.zip(panel.chunks_exact(block * PANEL)).skip(column / block)
        {
            let (mut a0, mut b0) = (lanes.load(r0), lanes.load(&r0[L::WIDTH..]));
            let (mut a1, mut b1) = (lanes.load(r1), lanes.load(&r1[L::WIDTH..]));
            let (mut a2, mut b2) = (lanes.load(r2), lanes.load(&r2[L::WIDTH..]));
            let (mut a3, mut b3) = (lanes.load(r3), lanes.load(&r3[L::WIDTH..]));
            for (l, factors) in panel.chunks_exact(block).zip(scaled.chunks_exact(COLUMNS)) {
                let (low, high) = (lanes.load(l), lanes.load(&l[L::WIDTH..]));
                let f = lanes.splat(factors[0]);
                (a0, b0) = (lanes.neg_mul_add(low, f, a0), lanes.neg_mul_add(high, f, b0));
                let f = lanes.splat(factors[1]);
                (a1, b1) = (lanes.neg_mul_add(low, f, a1), lanes.neg_mul_add(high, f, b1));
                let f = lanes.splat(factors[2]);
                (a2, b2) = (lanes.neg_mul_add(low, f, a2), lanes.neg_mul_add(high, f, b2));
                let f = lanes.splat(factors[3]);
                (a3, b3) = (lanes.neg_mul_add(low, f, a3), lanes.neg_mul_add(high, f, b3));
            }
            lanes.store(a0, r0);
            lanes.store(b0, &mut r0[L::WIDTH..]);
            lanes.store(a1, r1);
            lanes.store(b1, &mut r1[L::WIDTH..]);
            lanes.store(a2, r2);
            lanes.store(b2, &mut r2[L::WIDTH..]);
            lanes.store(a3, r3);
            lanes.store(b3, &mut r3[L::WIDTH..]);
        }
    }
}

/// A solve of the right-hand side in the workspace.
struct Solve<'a> {
    factors: &'a mut SupernodalFactors,
}

impl Kernel for Solve<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let SupernodalFactors { supernodes, below, lower, pivots, work: Work { right, rows, .. }, .. } =
            self.factors;
        for supernode in supernodes.iter() {
            let (width, length) = (supernode.width(), supernode.length());
            let rows = gather(right, rows, supernode, below);
            for (k, column) in lower[supernode.lower..][..width * length].chunks_exact(length).enumerate() {
                let factor = lanes.splat(rows[k]);
                let start = (k + 1) / WIDEST * WIDEST;
                let parts =
                    rows[start..].chunks_exact_mut(L::WIDTH).zip(column[start..].chunks_exact(L::WIDTH));
                for (rows, column) in parts {
                    let rest = lanes.neg_mul_add(lanes.load(column), factor, lanes.load(rows));
                    lanes.store(rest, rows);
                }
            }
            right[supernode.columns.clone()].copy_from_slice(&rows[..width]);
            for (row, value) in below[supernode.below.clone()].iter().zip(&rows[width..]) {
                right[*row] = *value;
            }
        }
        right.iter_mut().zip(pivots.iter()).for_each(|(x, pivot)| *x /= pivot);
        for supernode in supernodes.iter().rev() {
            let (width, length) = (supernode.width(), supernode.length());
            let rows = gather(right, rows, supernode, below);
            let columns = lower[supernode.lower..][..width * length].chunks_exact(length);
            for (k, column) in columns.enumerate().rev() {
                let start = (k + 1) / WIDEST * WIDEST;
                let mut sums = [lanes.splat(0.0); WIDEST];
                let parts = rows[start..].chunks_exact(WIDEST).zip(column[start..].chunks_exact(WIDEST));
                for (rows, column) in parts {
                    let parts = rows.chunks_exact(L::WIDTH).zip(column.chunks_exact(L::WIDTH));
                    for (sum, (x, l)) in sums.iter_mut().zip(parts) {
                        *sum = lanes.mul_add(lanes.load(x), lanes.load(l), *sum);
                    }
                }
                let mut numbers = [0.0; WIDEST];
                for (numbers, sum) in numbers.chunks_exact_mut(L::WIDTH).zip(sums) {
                    lanes.store(sum, numbers);
                }
                rows[k] -= numbers.iter().sum::<f64>();
            }
            right[supernode.columns.clone()].copy_from_slice(&rows[..width]);
        }
    }
}

/// The rows of one front, and zeros up to the length of its columns.
#[inline(always)]
fn gather<'a>(right: &[f64], rows: &'a mut [f64], supernode: &Supernode, below: &[usize]) -> &'a mut [f64] {
    let rows = &mut rows[..supernode.length()];
    let (own, rest) = rows.split_at_mut(supernode.width());
    own.copy_from_slice(&right[supernode.columns.clone()]);
    let (below_own, beyond) = rest.split_at_mut(supernode.below.len());
    below_own.iter_mut().zip(&below[supernode.below.clone()]).for_each(|(to, row)| *to = right[*row]);
    beyond.fill(0.0);
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use somersault_core::random::SplitMix64;

    /// A matrix by its upper triangle, and an order of its rows.
    struct Case {
        pattern: Pattern,
        values: Vec<f64>,
        order: Vec<usize>,
    }

    impl Case {
        /// With these entries beside the diagonal, quasi-definite: the diagonal of the first rows is positive, of the rest negative.
        fn new(n: usize, n_positive: usize, entries: Vec<(usize, usize)>, random: &mut SplitMix64) -> Self {
            let upper = entries.into_iter().map(|(i, j)| (i.min(j), i.max(j)));
            let pattern = Pattern::from_entries(n, n, upper.chain((0..n).map(|i| (i, i))));
            let mut values: Vec<f64> = pattern.rows.iter().map(|_| signed(random)).collect();
            let mut sums = vec![0.0; n];
            for (k, i, j) in pattern.entries().filter(|(_, i, j)| i != j) {
                // one block couples to the other as it likes
                if (i < n_positive) == (j < n_positive) {
                    sums[i] += values[k].abs();
                    sums[j] += values[k].abs();
                }
            }
            for (k, i, _) in pattern.entries().filter(|(_, i, j)| i == j) {
                let size = 0.1 + sums[i] + values[k].abs();
                values[k] = if i < n_positive { size } else { -size };
            }
            let mut keys: Vec<(u64, usize)> = (0..n).map(|i| (random.bits(), i)).collect();
            keys.sort_unstable();
            Self { pattern, values, order: keys.into_iter().map(|(_, row)| row).collect() }
        }

        fn matrix(&self) -> DMatrix<f64> {
            let n = self.order.len();
            let mut out = DMatrix::zeros(n, n);
            for (k, i, j) in self.pattern.entries() {
                out[(i, j)] = self.values[k];
                out[(j, i)] = self.values[k];
            }
            out
        }
    }

    /// Between −1 and 1.
    fn signed(random: &mut SplitMix64) -> f64 {
        2.0 * random.unit() - 1.0
    }

    /// Dense, banded, with dense blocks in a row, of separate parts, with a full last row, and without entries beside the diagonal.
    fn cases() -> Vec<Case> {
        let mut random = SplitMix64::new(28);
        let mut out = Vec::new();
        for n in [1, 2, 5, 16, 17, 33, 61, 130] {
            let all = |n: usize| (0..n).flat_map(move |j| (0..j).map(move |i| (i, j)));
            let mut shapes: Vec<Vec<(usize, usize)>> = vec![
                all(n).collect(),
                all(n).filter(|(i, j)| j - i <= 3).collect(),
                all(n).filter(|(i, j)| j / 20 - i / 20 <= 1 && (j / 20 == i / 20 || j % 20 < 5)).collect(),
                all(n).filter(|(i, j)| j / 7 == i / 7).collect(),
                all(n).filter(|(_, j)| j + 1 == n).collect(),
                Vec::new(),
            ];
            shapes.push(all(n).filter(|_| random.unit() < 3.0 / n as f64).collect());
            for entries in shapes {
                out.push(Case::new(n, n - n / 3, entries, &mut random));
            }
        }
        out
    }

    #[test]
    fn solutions_and_signs_of_pivots_are_those_of_the_dense_matrix() {
        let mut random = SplitMix64::new(3);
        for case in cases() {
            let n = case.order.len();
            let mut factors = SupernodalFactors::new(&case.pattern, &case.order);
            let matrix = case.matrix();
            let eigenvalues = matrix.symmetric_eigenvalues();
            // a second factorisation does not see the first
            for scale in [3.0, 1.0] {
                let values: Vec<f64> = case.values.iter().map(|x| scale * x).collect();
                assert!(factors.factor(&values));
            }
            let n_positive = factors.pivots().iter().filter(|d| **d > 0.0).count();
            assert_eq!(n_positive, eigenvalues.iter().filter(|x| **x > 0.0).count(), "{n} rows");
            let right = DVector::from_fn(n, |_, _| signed(&mut random));
            let mut x = right.clone();
            factors.solve(x.as_mut_slice());
            let residual = (&matrix * &x - &right).amax();
            let size = matrix.amax() * x.amax() + right.amax();
            assert!(residual <= 1e-13 * size, "{n} rows: {residual:e} of {size}");
        }
    }

    #[test]
    fn all_instruction_sets_give_the_same_bits() {
        for case in cases() {
            let found: Vec<(Vec<f64>, Vec<f64>)> = InstructionSet::supported()
                .map(|instructions| {
                    let mut factors = SupernodalFactors::new(&case.pattern, &case.order);
                    factors.instructions = instructions;
                    assert!(factors.factor(&case.values));
                    let mut x: Vec<f64> = (0..case.order.len()).map(|i| (i as f64).sin()).collect();
                    factors.solve(&mut x);
                    (factors.pivots, x)
                })
                .collect();
            assert!(found.iter().all(|other| *other == found[0]));
        }
    }

    #[test]
    fn a_pivot_that_vanishes_or_is_no_number_is_told_and_the_next_matrix_is_factored() {
        let pattern = Pattern::upper_triangle(3);
        let mut factors = SupernodalFactors::new(&pattern, &[0, 1, 2]);
        // by columns of the upper triangle
        let singular = [1.0, 1.0, 1.0, 0.0, 0.0, 1.0];
        assert!(!factors.factor(&singular));
        assert!(!factors.factor(&[f64::NAN, 0.0, 1.0, 0.0, 0.0, 1.0]));
        assert!(!factors.factor(&[f64::INFINITY, 0.0, 1.0, 0.0, 0.0, 1.0]));
        assert!(factors.factor(&[2.0, 0.0, 4.0, 0.0, 0.0, 8.0]));
        let mut x = [2.0, 4.0, 8.0];
        factors.solve(&mut x);
        assert_eq!(x, [1.0, 1.0, 1.0]);
    }

    #[test]
    fn nothing_of_a_matrix_that_is_no_number_is_left_for_the_next() {
        for case in cases() {
            for instructions in InstructionSet::supported() {
                let factored = |matrices: &[&[f64]]| {
                    let mut factors = SupernodalFactors::new(&case.pattern, &case.order);
                    factors.instructions = instructions;
                    let done: Vec<bool> = matrices.iter().map(|values| factors.factor(values)).collect();
                    let mut x: Vec<f64> = (0..case.order.len()).map(|i| (i as f64).cos()).collect();
                    factors.solve(&mut x);
                    (done.last().copied(), factors.pivots, x)
                };
                let mut random = SplitMix64::new(5);
                // not the first pivots, so that there is something to be left
                let is_diagonal: Vec<bool> = case.pattern.entries().map(|(_, i, j)| i == j).collect();
                let spoilt: Vec<f64> = case
                    .values
                    .iter()
                    .zip(&is_diagonal)
                    .map(|(x, is_diagonal)| if !is_diagonal && random.unit() < 0.3 { f64::NAN } else { *x })
                    .collect();
                assert_eq!(factored(&[&spoilt, &case.values]), factored(&[&case.values]));
            }
        }
    }

    #[test]
    fn columns_with_nearly_the_same_rows_are_one_supernode() {
        let dense = SupernodalFactors::new(&Pattern::upper_triangle(40), &(0..40).collect::<Vec<_>>());
        assert_eq!(dense.supernodes.len(), 1);
        let diagonal = Pattern::from_entries(40, 40, (0..40).map(|i| (i, i)));
        assert_eq!(SupernodalFactors::new(&diagonal, &(0..40).collect::<Vec<_>>()).supernodes.len(), 40);
    }
}
