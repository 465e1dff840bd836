//! Joints that follow others: the coordinate of a follower is q_j = m q_i + o.
//!
//! The kernels give every joint numbers of its own, the *tree coordinates*. The q and v of a model are the
//! *independent* ones among them, those of the joints that follow no other, and
//!
//! ```text
//! q_t = G q + o,  v_t = G v,  a_t = G a,   τ = Gᵀ τ_t,  M = Gᵀ M_t G,  ∂τ = Gᵀ ∂τ_t G
//! ```
//! exactly: G is constant, so that no velocity product and no derivative has a term of its own, and the power
//! τ·v is that of the tree. Columns of Jacobians and of the momentum matrix add up as those of M do. A model
//! without followers has no `Coupling`; then all of this returns its input.
//!
//! A follower in another branch than its leader couples the two, and M has entries that no tree of bodies
//! shows. They lie on the ways to the root of the elimination tree, in which the parent of k is the last j < k
//! that k is coupled to once all later ones are eliminated (Liu, *The role of elimination trees in sparse
//! factorization*, SIAM J. Matrix Anal. Appl. 11, 1990): with it in the place of the tree of joints the
//! sparse factorisation of M is the same.

use crate::error::ModelError;
use crate::link::Link;
use somersault_core::Scalar;
use std::collections::{BTreeSet, HashMap};

/// For each body where its numbers follow from: the body that leads in the end, the multiplier and the offset.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Source {
    pub(crate) body: usize,
    pub(crate) multiplier: f64,
    pub(crate) offset: f64,
}

/// Follows every joint to the one that follows no other. Leaders may come before or after their followers.
pub(crate) fn sources(links: &[Link]) -> Result<Vec<Source>, ModelError> {
    let numbers: HashMap<&str, usize> = links.iter().enumerate().map(|(i, l)| (l.name(), i)).collect();
    let mut found = Vec::with_capacity(links.len());
    for (i, link) in links.iter().enumerate() {
        let mut source = Source { body: i, multiplier: 1.0, offset: 0.0 };
        let mut steps = 0;
        while let Some(mimic) = &links[source.body].mimic {
            let (name, leader) = (link.name.clone(), mimic.leader.clone());
            let body = *numbers
                .get(leader.as_str())
                .ok_or_else(|| ModelError::UnknownLeader { name: name.clone(), leader: leader.clone() })?;
            if links[body].joint.n_velocities() != 1 {
                return Err(ModelError::NoSingleCoordinate { name: leader });
            }
            steps += 1;
            if steps > links.len() {
                return Err(ModelError::MimicCycle { name });
            }
            source = Source {
                body,
                multiplier: source.multiplier * mimic.multiplier,
                offset: source.offset + source.multiplier * mimic.offset,
            };
        }
        if !(source.multiplier.is_finite() && source.offset.is_finite()) {
            return Err(ModelError::NonFinite { name: link.name.clone(), argument: "mimic" });
        }
        found.push(source);
    }
    Ok(found)
}

/// One number of the tree: `factor` · independent number + `offset`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row<T> {
    pub(crate) at: usize,
    pub(crate) factor: T,
    pub(crate) offset: T,
}

/// G and o, with the elimination tree of M.
#[derive(Debug, Clone)]
pub(crate) struct Coupling<T> {
    pub(crate) positions: Vec<Row<T>>,
    pub(crate) velocities: Vec<Row<T>>,
    /// Parents in the elimination tree, in the place of the degree of freedom before each one.
    pub(crate) parents: Vec<Option<usize>>,
}

impl<T: Scalar> Coupling<T> {
    /// Of bodies with the given numbers of q and of v in the tree; `dof_parent` is of the tree.
    pub(crate) fn new(
        sources: &[Source],
        sizes: &[(usize, usize)],
        dof_parent: &[Option<usize>],
    ) -> Option<Self> {
        if sources.iter().enumerate().all(|(i, source)| source.body == i) {
            return None;
        }
        // where each leader has its independent numbers
        let (mut q, mut v) = (0, 0);
        let mut starts = vec![(0, 0); sizes.len()];
        for (i, (n_q, n_v)) in sizes.iter().enumerate().filter(|(i, _)| sources[*i].body == *i) {
            starts[i] = (q, v);
            q += n_q;
            v += n_v;
        }
        let (mut positions, mut velocities) = (Vec::new(), Vec::new());
        for (source, (n_q, n_v)) in sources.iter().zip(sizes) {
            let (q, v) = starts[source.body];
            let (factor, offset) = (nalgebra::convert(source.multiplier), nalgebra::convert(source.offset));
            positions.extend((0..*n_q).map(|k| Row { at: q + k, factor, offset }));
            velocities.extend((0..*n_v).map(|k| Row { at: v + k, factor, offset: T::zero() }));
        }
        let parents = elimination_tree(v, &velocities, dof_parent);
        Some(Self { positions, velocities, parents })
    }
}

/// Parents in the elimination tree of M, of which `dof_parent` says which of its entries in tree coordinates are
/// not zero.
fn elimination_tree<T>(n: usize, rows: &[Row<T>], dof_parent: &[Option<usize>]) -> Vec<Option<usize>> {
    let mut earlier: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); n];
    for (k, row) in rows.iter().enumerate() {
        for j in std::iter::successors(dof_parent[k], |&j| dof_parent[j]) {
            let (a, b) = (row.at.min(rows[j].at), row.at.max(rows[j].at));
            if a < b {
                earlier[b].insert(a);
            }
        }
    }
    let mut parents = vec![None; n];
    for k in (0..n).rev() {
        let mut carried = std::mem::take(&mut earlier[k]);
        parents[k] = carried.pop_last();
        if let Some(parent) = parents[k] {
            earlier[parent].append(&mut carried);
        }
    }
    parents
}
