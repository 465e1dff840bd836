//! Forward and hybrid dynamics: elimination of the passive accelerations from the partials of the joint forces.
//!
//! Let D be the partials of the joint forces at fixed accelerations with respect to q, to v or, with D = M,
//! to active accelerations. Sorted into passive and active degrees of freedom the result (a_p, τ_a) changes by
//!
//! ∂a_p = −M_pp⁻¹ D_p,  ∂τ_a = D_a + M_ap ∂a_p,  and with the passive joint forces by  W = (M_pp⁻¹, M_ap M_pp⁻¹).
//!
//! M_pp = LᵀL keeps the zeros of M (Featherstone 2008, section 6.5), and D has entries only between degrees
//! of freedom on one way to the root: the cost is n² × depth. Thesis (D.37)–(D.43), corrected, are these for
//! its own split.

use super::{DerivativeData, Partials, Tables};
use crate::articulated::{AllPassive, Roles, Split};
use crate::error::DynamicsError;
use crate::model::Model;
use crate::spatial::Force;
use somersault_core::argument::expect_length;
use somersault_core::scalar::{Scalar, constant};

/// out ← out − Σ c x, with each x given by the number of a column of `columns`.
///
/// Four at a time, so that `out` is read and written once for four.
#[inline(always)]
fn subtract<T: Scalar>(out: &mut [T], columns: &[T], terms: impl Iterator<Item = (usize, T)>) {
    let n = out.len();
    let column = |k: usize| &columns[k * n..][..n];
    let mut terms = terms.fuse();
    while let Some((k, c)) = terms.next() {
        let x = column(k);
        let three = (terms.next(), terms.next(), terms.next());
        if let (Some((k1, c1)), Some((k2, c2)), Some((k3, c3))) = three {
            let (x1, x2, x3) = (column(k1), column(k2), column(k3));
            for i in 0..n {
                out[i] -= (x[i] * c + x1[i] * c1) + (x2[i] * c2 + x3[i] * c3);
            }
        } else {
            for (k, c) in std::iter::once((k, c)).chain(three.0).chain(three.1) {
                for (out, &x) in out.iter_mut().zip(column(k)) {
                    *out -= x * c;
                }
            }
        }
    }
}

/// Those on the way from `first` to the root, itself among them.
fn way(above: &[Option<usize>], first: Option<usize>) -> impl Iterator<Item = usize> {
    std::iter::successors(first, |&k| above[k])
}

/// out ← (0, D_a) − W D_p, all by columns.
fn apply<T: Scalar>(roles: &impl Roles, relatives: &[Vec<usize>], w: &[T], d: &[T], out: &mut [T]) {
    let n = relatives.len();
    for (j, relatives) in relatives.iter().enumerate() {
        let (d, out) = (&d[j * n..][..n], &mut out[j * n..][..n]);
        for k in 0..n {
            out[k] = if roles.is_active(k) { d[k] } else { T::zero() };
        }
        subtract(out, w, relatives.iter().filter(|&&k| !roles.is_active(k)).map(|&k| (k, d[k])));
    }
}

/// M_pp = LᵀL (Featherstone 2008, table 6.3), L by rows that start at their diagonal; `above` becomes the nearest passive
/// degree of freedom on each one's way to the root.
pub(crate) fn factorize<T: Scalar>(
    model: &Model<T>,
    roles: &impl Roles,
    mass: &[T],
    above: &mut [Option<usize>],
    factor: &mut [T],
) -> Result<(), DynamicsError> {
    let (n, parents) = (above.len(), model.elimination_parents());
    for k in 0..n {
        above[k] = parents[k].and_then(|p| if roles.is_active(p) { above[p] } else { Some(p) });
        for (at, entry) in way(above, Some(k)).zip(&mut factor[k * n..]) {
            *entry = mass[k * n + at];
        }
    }
    for k in (0..n).rev().filter(|&k| !roles.is_active(k)) {
        let (inner, row) = factor.split_at_mut(k * n);
        let length = way(above, Some(k)).count();
        let row = &mut row[..length];
        let square = row[0];
        let rounding = mass[k * n + k] * constant(4.0 * f64::EPSILON);
        if !(square > rounding && square.is_finite()) {
            let joint = (0..model.n_bodies()).find(|&i| model.velocities_of(i).contains(&k));
            let joint = joint.and_then(|i| model.name(i)).unwrap_or_default().to_owned();
            return Err(DynamicsError::Singular { joint });
        }
        let inverse = T::one() / square.sqrt();
        row.iter_mut().for_each(|x| *x *= inverse);
        // the way from an ancestor is the rest of the way from k
        for (at, rest) in way(above, above[k]).zip(1..) {
            let c = row[rest];
            for (entry, &x) in inner[at * n..].iter_mut().zip(&row[rest..]) {
                *entry -= x * c;
            }
        }
    }
    Ok(())
}

impl<T: Scalar> Model<T> {
    /// [`forward_dynamics`](Self::forward_dynamics) and its partials: −M⁻¹ ∂τ/∂q, −M⁻¹ ∂τ/∂v and M⁻¹, where
    /// the joint forces are those of inverse dynamics. Cost O(n² × depth).
    pub fn forward_dynamics_partials<'d>(
        &self,
        work: &'d mut DerivativeData<T>,
        q: &[T],
        v: &[T],
        torque: &[T],
        wrenches: &[Force<T>],
    ) -> Result<Partials<'d, T>, DynamicsError> {
        let found = self.forward_dynamics(&mut work.data, q, v, torque, wrenches)?;
        work.acceleration.copy_from_slice(found);
        work.forward.value.copy_from_slice(found);
        self.eliminate(&AllPassive, work, q, v, wrenches)?;
        let Tables { value, q, v } = &work.forward;
        Ok(Partials { value, q, v, input: &work.response })
    }

    /// [`hybrid_dynamics`](Self::hybrid_dynamics) and its partials.
    ///
    /// Of each degree of freedom `known` holds the joint force if it is passive, the acceleration if it is
    /// active; the result holds the other one. Column k of `input` is the change with `known[k]`.
    /// Cost O(n² × depth).
    pub fn hybrid_dynamics_partials<'d>(
        &self,
        work: &'d mut DerivativeData<T>,
        split: &Split,
        q: &[T],
        v: &[T],
        known: &[T],
        wrenches: &[Force<T>],
    ) -> Result<Partials<'d, T>, DynamicsError> {
        expect_length("known", known.len(), self.n_velocities())?;
        let DerivativeData { data, acceleration, torque, .. } = work;
        if acceleration.len() != known.len() {
            return Err(DynamicsError::ForeignData);
        }
        acceleration.copy_from_slice(known);
        torque.copy_from_slice(known);
        self.hybrid_dynamics(data, split, q, v, acceleration, torque, wrenches)?;
        for k in 0..known.len() {
            work.forward.value[k] = if split.is_active(k) { work.torque[k] } else { work.acceleration[k] };
        }
        self.eliminate(split, work, q, v, wrenches)?;
        let n = self.n_velocities();
        let DerivativeData { data, relatives, response, input, .. } = &mut *work;
        let mass = self.gathered(&data.tree.mass_matrix, &data.room.mass_matrix);
        apply(split, relatives, response.as_slice(), mass.as_slice(), input.as_mut_slice());
        for k in (0..n).filter(|&k| !split.is_active(k)) {
            input.column_mut(k).copy_from(&response.column(k));
        }
        let Tables { value, q, v } = &work.forward;
        Ok(Partials { value, q, v, input: &work.input })
    }

    /// Fills `forward` and `response` at the accelerations in the workspace.
    fn eliminate(
        &self,
        roles: &impl Roles,
        work: &mut DerivativeData<T>,
        q: &[T],
        v: &[T],
        wrenches: &[Force<T>],
    ) -> Result<(), DynamicsError> {
        let acceleration = std::mem::take(&mut work.acceleration);
        let done = self.inverse_dynamics_partials(work, q, v, &acceleration, wrenches).map(|_| ());
        work.acceleration = acceleration;
        done?;
        let DerivativeData { data, above, factor, .. } = &mut *work;
        let mass = self.gathered(&data.tree.mass_matrix, &data.room.mass_matrix);
        factorize(self, roles, mass.as_slice(), above, factor.as_mut_slice())?;
        self.respond(roles, work);
        let DerivativeData { relatives, inverse, gathered, forward, response, .. } = work;
        let (by_q, by_v) = (self.gathered(&inverse.q, &gathered.q), self.gathered(&inverse.v, &gathered.v));
        apply(roles, relatives, response.as_slice(), by_q.as_slice(), forward.q.as_mut_slice());
        apply(roles, relatives, response.as_slice(), by_v.as_slice(), forward.v.as_mut_slice());
        Ok(())
    }

    /// W, whose columns belong to the passive degrees of freedom.
    fn respond(&self, roles: &impl Roles, work: &mut DerivativeData<T>) {
        let n = self.n_velocities();
        let DerivativeData { data, above, factor, response, .. } = work;
        let (parents, mass) =
            (self.elimination_parents(), self.gathered(&data.tree.mass_matrix, &data.room.mass_matrix));
        response.fill_with_identity();
        let (mass, factor, w) = (mass.as_slice(), factor.as_slice(), response.as_mut_slice());
        // M_pp⁻¹ is symmetric: its rows are treated as columns, which lie in one piece. Row k of L⁻ᵀ starts at k.
        for k in (0..n).rev().filter(|&k| !roles.is_active(k)) {
            let (inner, row) = w.split_at_mut(k * n);
            let row = &mut row[k..n];
            let factor = &factor[k * n..];
            let inverse = T::one() / factor[0];
            row.iter_mut().for_each(|x| *x *= inverse);
            for (at, &c) in way(above, above[k]).zip(&factor[1..]) {
                for (out, &x) in inner[at * n + k..(at + 1) * n].iter_mut().zip(&*row) {
                    *out -= x * c;
                }
            }
        }
        for k in (0..n).filter(|&k| !roles.is_active(k)) {
            let (inner, row) = w.split_at_mut(k * n);
            let row = &mut row[..n];
            let factor = &factor[k * n..];
            subtract(row, inner, way(above, above[k]).zip(factor[1..].iter().copied()));
            let inverse = T::one() / factor[0];
            row.iter_mut().for_each(|x| *x *= inverse);
        }
        for k in 0..n {
            let mut ancestor = parents[k];
            while let Some(j) = ancestor {
                let (active, passive) = if roles.is_active(k) { (k, j) } else { (j, k) };
                if roles.is_active(active) && !roles.is_active(passive) {
                    let coupling = mass[k * n + j];
                    for column in w.chunks_exact_mut(n) {
                        let reached = column[passive] * coupling;
                        column[active] += reached;
                    }
                }
                ancestor = parents[j];
            }
        }
    }
}
