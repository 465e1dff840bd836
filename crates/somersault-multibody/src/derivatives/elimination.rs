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

use super::{DerivativeData, DerivativeTables, Partials, Tables};
use crate::articulated::{AllPassive, Roles, Split};
use crate::data::TreeData;
use crate::error::DynamicsError;
use crate::model::Model;
use crate::spatial::Force;
use somersault_core::argument::expect_length;
use somersault_core::scalar::{Arithmetic, Lift, Scalar, constant};

/// out ← out − Σ c x, for terms (k, l) with x column k of `columns` and c = `coefficients[l]`.
///
/// Four at a time, so that `out` is read and written once for four.
#[inline(always)]
fn subtract<N: Arithmetic>(
    out: &mut [N],
    columns: &[N],
    coefficients: &[N],
    terms: impl Iterator<Item = (usize, usize)>,
) {
    let n = out.len();
    let column = |k: usize| &columns[k * n..][..n];
    let mut terms = terms.fuse();
    while let Some((k, l)) = terms.next() {
        let x = column(k);
        let three = (terms.next(), terms.next(), terms.next());
        if let (Some((k1, l1)), Some((k2, l2)), Some((k3, l3))) = three {
            let (x1, x2, x3) = (column(k1), column(k2), column(k3));
            let [c, c1, c2, c3] = [l, l1, l2, l3].map(|l| coefficients[l]);
            for i in 0..n {
                out[i] -= (x[i] * c + x1[i] * c1) + (x2[i] * c2 + x3[i] * c3);
            }
        } else {
            for (k, l) in std::iter::once((k, l)).chain(three.0).chain(three.1) {
                let (x, c) = (column(k), coefficients[l]);
                for i in 0..n {
                    out[i] -= x[i] * c;
                }
            }
        }
    }
}

/// Those on the way from `first` to the root, itself among them.
#[inline(always)]
pub(super) fn way(above: &[Option<usize>], first: Option<usize>) -> impl Iterator<Item = usize> {
    std::iter::successors(first, |&k| above[k])
}

/// out ← (0, D_a) − W D_p, all by columns.
#[inline(always)]
fn apply<N: Arithmetic>(
    zero: N,
    roles: &impl Roles,
    relatives: &[Vec<usize>],
    w: &[N],
    d: &[N],
    out: &mut [N],
) {
    let n = relatives.len();
    for (j, relatives) in relatives.iter().enumerate() {
        let (d, out) = (&d[j * n..][..n], &mut out[j * n..][..n]);
        for k in 0..n {
            out[k] = if roles.is_active(k) { d[k] } else { zero };
        }
        subtract(out, w, d, relatives.iter().filter(|&&k| !roles.is_active(k)).map(|&k| (k, k)));
    }
}

/// M_pp = LᵀL (Featherstone 2008, table 6.3), L by rows that start at their diagonal; `above` becomes the nearest passive
/// degree of freedom on each one's way to the root.
///
/// Lanes fail together, where any of them does.
#[inline(always)]
fn factorize_in<T: Scalar, N: Lift<T>>(
    proof: N::Proof,
    model: &Model<T>,
    roles: &impl Roles,
    mass: &[N],
    above: &mut [Option<usize>],
    factor: &mut [N],
) -> Result<(), DynamicsError> {
    let (n, parents) = (above.len(), model.elimination_parents());
    for k in 0..n {
        above[k] = parents[k].and_then(|p| if roles.is_active(p) { above[p] } else { Some(p) });
        for (at, entry) in way(above, Some(k)).zip(&mut factor[k * n..]) {
            *entry = mass[k * n + at];
        }
    }
    let (one, rounding) = (N::lift(proof, T::one()), N::lift(proof, constant(4.0 * f64::EPSILON)));
    for k in (0..n).rev().filter(|&k| !roles.is_active(k)) {
        let (inner, row) = factor.split_at_mut(k * n);
        let length = way(above, Some(k)).count();
        let row = &mut row[..length];
        let square = row[0];
        if !square.exceeds(mass[k * n + k] * rounding) {
            return Err(singular(model, k));
        }
        let inverse = one / square.square_root();
        for x in row.iter_mut() {
            *x = *x * inverse;
        }
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

/// [`factorize_in`] of one state.
pub(crate) fn factorize<T: Scalar>(
    model: &Model<T>,
    roles: &impl Roles,
    mass: &[T],
    above: &mut [Option<usize>],
    factor: &mut [T],
) -> Result<(), DynamicsError> {
    factorize_in((), model, roles, mass, above, factor)
}

/// No inertia meets degree of freedom `k`.
#[cold]
fn singular<T: Scalar>(model: &Model<T>, k: usize) -> DynamicsError {
    let joint = (0..model.n_bodies()).find(|&i| model.velocities_of(i).contains(&k));
    DynamicsError::Singular { joint: joint.and_then(|i| model.name(i)).unwrap_or_default().to_owned() }
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
        work.tables.forward.value.copy_from_slice(found);
        self.eliminate(&AllPassive, work, q, v, wrenches)?;
        let DerivativeTables { forward: Tables { value, q, v }, response, .. } = &work.tables;
        Ok(Partials { value, q, v, input: response })
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
        let DerivativeData { tables, acceleration, torque, .. } = &mut *work;
        for (k, value) in tables.forward.value.iter_mut().enumerate() {
            *value = if split.is_active(k) { torque[k] } else { acceleration[k] };
        }
        self.eliminate(split, work, q, v, wrenches)?;
        let n = self.n_velocities();
        let DerivativeData { data, tables: DerivativeTables { relatives, response, .. }, input, .. } =
            &mut *work;
        let mass = self.gathered(&data.tree.mass_matrix, &data.room.mass_matrix);
        apply(T::zero(), split, relatives, response.as_slice(), mass.as_slice(), input.as_mut_slice());
        for k in (0..n).filter(|&k| !split.is_active(k)) {
            input.column_mut(k).copy_from(&response.column(k));
        }
        let Tables { value, q, v } = &work.tables.forward;
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
        let DerivativeData { data, tables, gathered, .. } = work;
        let mass = self.gathered(&data.tree.mass_matrix, &data.room.mass_matrix);
        let DerivativeTables { inverse, relatives, above, factor, response, forward, .. } = tables;
        let by = [(&inverse.q, &gathered.q), (&inverse.v, &gathered.v)];
        let by = by.map(|(tree, room)| self.gathered(tree, room).as_slice());
        let out = [forward.q.as_mut_slice(), forward.v.as_mut_slice()];
        let room = (&mut above[..], factor.as_mut_slice());
        self.solve((), roles, relatives, room, mass.as_slice(), by, response.as_mut_slice(), out)
    }

    /// [`eliminate`](Self::eliminate) for all states in lanes with accelerations `a`, where no joint follows another; poses must be up
    /// to date.
    #[inline(always)]
    pub(crate) fn forward_partials_in<N: Lift<T>>(
        &self,
        proof: N::Proof,
        tree: &mut TreeData<N>,
        tables: &mut DerivativeTables<N>,
        v: &[N],
        a: &[N],
        wrenches: &[Force<N>],
    ) -> Result<(), DynamicsError> {
        self.differentiate_in(proof, tree, tables, v, a, wrenches);
        let DerivativeTables { inverse, relatives, above, factor, response, forward, .. } = tables;
        let by = [inverse.q.as_slice(), inverse.v.as_slice()];
        let out = [forward.q.as_mut_slice(), forward.v.as_mut_slice()];
        let room = (&mut above[..], factor.as_mut_slice());
        let mass = tree.mass_matrix.as_slice();
        self.solve(proof, &AllPassive, relatives, room, mass, by, response.as_mut_slice(), out)
    }

    /// From M and the partials `by` of joint forces: W, whose columns belong to the passive degrees of freedom, and the partials
    /// of the result.
    #[inline(always)]
    fn solve<N: Lift<T>>(
        &self,
        proof: N::Proof,
        roles: &impl Roles,
        relatives: &[Vec<usize>],
        (above, factor): (&mut [Option<usize>], &mut [N]),
        mass: &[N],
        by: [&[N]; 2],
        w: &mut [N],
        out: [&mut [N]; 2],
    ) -> Result<(), DynamicsError> {
        factorize_in(proof, self, roles, mass, above, factor)?;
        let (n, parents) = (self.n_velocities(), self.elimination_parents());
        let (zero, one) = (N::lift(proof, T::zero()), N::lift(proof, T::one()));
        for (at, entry) in w.iter_mut().enumerate() {
            *entry = if at % (n + 1) == 0 { one } else { zero };
        }
        // M_pp⁻¹ is symmetric: its rows are treated as columns, which lie in one piece. Row k of L⁻ᵀ starts at k.
        for k in (0..n).rev().filter(|&k| !roles.is_active(k)) {
            let (inner, row) = w.split_at_mut(k * n);
            let row = &mut row[k..n];
            let factor = &factor[k * n..];
            let inverse = one / factor[0];
            for x in row.iter_mut() {
                *x = *x * inverse;
            }
            for (at, &c) in way(above, above[k]).zip(&factor[1..]) {
                for (out, &x) in inner[at * n + k..(at + 1) * n].iter_mut().zip(&*row) {
                    *out -= x * c;
                }
            }
        }
        for k in (0..n).filter(|&k| !roles.is_active(k)) {
            let (inner, row) = w.split_at_mut(k * n);
            let row = &mut row[..n];
            let factor = &factor[k * n..][..n];
            subtract(row, inner, factor, way(above, above[k]).zip(1..));
            let inverse = one / factor[0];
            for x in row.iter_mut() {
                *x = *x * inverse;
            }
        }
        for k in 0..n {
            for j in way(parents, parents[k]) {
                let (active, passive) = if roles.is_active(k) { (k, j) } else { (j, k) };
                if roles.is_active(active) && !roles.is_active(passive) {
                    let coupling = mass[k * n + j];
                    for column in w.chunks_exact_mut(n) {
                        let reached = column[passive] * coupling;
                        column[active] += reached;
                    }
                }
            }
        }
        for (d, out) in by.into_iter().zip(out) {
            apply(zero, roles, relatives, w, d, out);
        }
        Ok(())
    }
}
