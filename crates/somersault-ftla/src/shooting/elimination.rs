//! The linear system of multiple shooting, by orthogonal elimination from the left.
//!
//! Unknown are the corrections δ₀ … δ_K; given C₀δ₀ = b₀ (n rows), Φ_kδ_k − δ_{k+1} = r_k and C_Kδ_K = b_K (n rows). With
//! n rows known of δ_k,
//!
//! ```text
//! ( C_k  0 )        ( R  E       )
//! ( Φ_k −1 )  =  Q  ( 0  C_{k+1} )
//! ```
//! leaves n rows on δ_{k+1}. Householder reflections keep growing and decaying directions apart whatever Φ_k does, which a
//! product of the Φ_k does not: S. J. Wright, *Stable parallel algorithms for two-point boundary value problems*, SIAM J.
//! Sci. Stat. Comput. 13 (1992). Cost O(K N³).

use super::End;
use crate::flow::Transition;
use nalgebra::DVector;

/// The factorisation; kept, so that several right-hand sides can be solved.
#[derive(Debug)]
pub(super) struct Elimination {
    /// N.
    dimension: usize,
    /// For each interval, n + N rows by 2N columns, column by column: reflectors and R, then E over C.
    blocks: Vec<f64>,
    /// 2/vᵀv of each reflector.
    scales: Vec<f64>,
    /// The last N by N block, with its reflectors.
    last: Vec<f64>,
    last_scales: Vec<f64>,
    ends: Option<[End; 2]>,
    rhs: Vec<f64>,
    /// Of each entry of p: the unknowns and the rows are divided by it, so that units do not matter.
    scale: DVector<f64>,
    intervals: usize,
}

/// A diagonal entry of R below rounding: the boundary values do not determine the motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Singular;

impl Elimination {
    pub(super) fn new(dimension: usize) -> Self {
        Self {
            dimension,
            blocks: Vec::new(),
            scales: Vec::new(),
            last: Vec::new(),
            last_scales: Vec::new(),
            ends: None,
            rhs: Vec::new(),
            scale: DVector::repeat(dimension, 1.0),
            intervals: 0,
        }
    }

    pub(super) fn factor(
        &mut self,
        links: &[Transition],
        ends: &[End; 2],
        scale: &DVector<f64>,
    ) -> Result<(), Singular> {
        let dim = self.dimension;
        let (n, rows) = (dim / 2, dim + dim / 2);
        self.scale.copy_from(scale);
        let size = rows * 2 * dim;
        self.intervals = links.len();
        self.ends = Some(ends.clone());
        self.blocks.clear();
        self.blocks.resize(links.len() * size, 0.0);
        self.scales.clear();
        self.scales.resize(links.len() * dim, 0.0);
        let mut known = vec![0.0; n * dim];
        for i in 0..n {
            known[ends[0].columns[i] * n + i] = 1.0;
        }
        for (k, link) in links.iter().enumerate() {
            let block = &mut self.blocks[k * size..(k + 1) * size];
            for j in 0..dim {
                let column = &mut block[j * rows..(j + 1) * rows];
                column[..n].copy_from_slice(&known[j * n..(j + 1) * n]);
                for i in 0..dim {
                    column[n + i] = link.matrix[(i, j)] * scale[j] / scale[i];
                }
                block[(dim + j) * rows + n + j] = -1.0;
            }
            triangularise(block, rows, dim, 2 * dim, &mut self.scales[k * dim..(k + 1) * dim])?;
            for j in 0..dim {
                known[j * n..(j + 1) * n]
                    .copy_from_slice(&block[(dim + j) * rows + dim..(dim + j + 1) * rows]);
            }
        }
        self.last.clear();
        self.last.resize(dim * dim, 0.0);
        self.last_scales.clear();
        self.last_scales.resize(dim, 0.0);
        for j in 0..dim {
            self.last[j * dim..j * dim + n].copy_from_slice(&known[j * n..(j + 1) * n]);
        }
        for i in 0..n {
            self.last[ends[1].columns[i] * dim + n + i] = 1.0;
        }
        triangularise(&mut self.last, dim, dim, dim, &mut self.last_scales)
    }

    /// Corrections for the defects and the boundary residuals of `nodes`, such that nodes plus
    /// corrections solve the linearised equations.
    pub(super) fn solve(
        &mut self,
        defects: &[DVector<f64>],
        nodes: &[DVector<f64>],
        out: &mut Vec<DVector<f64>>,
    ) {
        let dim = self.dimension;
        let (n, rows) = (dim / 2, dim + dim / 2);
        let (size, intervals) = (rows * 2 * dim, self.intervals);
        let Some(ends) = &self.ends else { return };
        self.rhs.clear();
        self.rhs.resize(intervals * dim, 0.0);
        let mut known = vec![0.0; rows];
        for i in 0..n {
            let column = ends[0].columns[i];
            known[i] = (ends[0].values[i] - nodes[0][column]) / self.scale[column];
        }
        for k in 0..intervals {
            let block = &self.blocks[k * size..(k + 1) * size];
            for i in 0..dim {
                known[n + i] = -defects[k][i] / self.scale[i];
            }
            reflect(block, rows, &self.scales[k * dim..(k + 1) * dim], &mut known);
            self.rhs[k * dim..(k + 1) * dim].copy_from_slice(&known[..dim]);
            known.copy_within(dim.., 0);
        }
        for i in 0..n {
            let column = ends[1].columns[i];
            known[n + i] = (ends[1].values[i] - nodes[intervals][column]) / self.scale[column];
        }
        let mut tail = known[..dim].to_vec();
        reflect(&self.last, dim, &self.last_scales, &mut tail);
        out.clear();
        out.resize(intervals + 1, DVector::zeros(dim));
        out[intervals].copy_from_slice(&tail);
        back_substitute(&self.last, dim, out[intervals].as_mut_slice());
        for k in (0..intervals).rev() {
            let block = &self.blocks[k * size..(k + 1) * size];
            let (before, after) = out.split_at_mut(k + 1);
            let (delta, next) = (&mut before[k], &after[0]);
            delta.copy_from_slice(&self.rhs[k * dim..(k + 1) * dim]);
            for j in 0..dim {
                let coupling = &block[(dim + j) * rows..(dim + j) * rows + dim];
                for i in 0..dim {
                    delta[i] -= coupling[i] * next[j];
                }
            }
            back_substitute(block, rows, delta.as_mut_slice());
        }
        out.iter_mut().for_each(|delta| delta.component_mul_assign(&self.scale));
    }
}

/// Householder reflections on the first `pivots` of `columns` columns. The reflectors take the place of what they remove;
/// their first entries are moved aside, the diagonal of R is stored in their place, and `scales` holds what applies them.
fn triangularise(
    block: &mut [f64],
    rows: usize,
    pivots: usize,
    columns: usize,
    scales: &mut [f64],
) -> Result<(), Singular> {
    for j in 0..pivots {
        let (head, tail) = block.split_at_mut((j + 1) * rows);
        let pivot = &mut head[j * rows..];
        let norm = pivot[j..].iter().map(|x| x * x).sum::<f64>().sqrt();
        let size = pivot.iter().map(|x| x * x).sum::<f64>().sqrt();
        if norm.is_nan() || norm <= 1e-15 * size {
            return Err(Singular);
        }
        let diagonal = -norm.copysign(pivot[j]);
        // v normalised to a first entry of one needs no room for it
        let first = pivot[j] - diagonal;
        pivot[j + 1..].iter_mut().for_each(|x| *x /= first);
        scales[j] = -first / diagonal;
        pivot[j] = diagonal;
        for column in tail.chunks_exact_mut(rows).take(columns - j - 1) {
            apply(&pivot[j + 1..], scales[j], &mut column[j..]);
        }
    }
    Ok(())
}

/// x −= s v (vᵀx) with v = (1, `rest`).
#[inline(always)]
fn apply(rest: &[f64], scale: f64, x: &mut [f64]) {
    let dot = x[0] + rest.iter().zip(&x[1..]).map(|(v, x)| v * x).sum::<f64>();
    let factor = scale * dot;
    x[0] -= factor;
    for (v, x) in rest.iter().zip(&mut x[1..]) {
        *x -= factor * v;
    }
}

fn reflect(block: &[f64], rows: usize, scales: &[f64], x: &mut [f64]) {
    for (j, &scale) in scales.iter().enumerate() {
        apply(&block[j * rows + j + 1..(j + 1) * rows], scale, &mut x[j..]);
    }
}

fn back_substitute(block: &[f64], rows: usize, x: &mut [f64]) {
    for j in (0..x.len()).rev() {
        x[j] /= block[j * rows + j];
        for i in 0..j {
            x[i] -= block[j * rows + i] * x[j];
        }
    }
}
