//! A pose at rest: where weight, forces and contacts are in equilibrium.
//!
//! Unknown are the positions q = q₀ ⊕ d. The stretch of friction is any that friction can hold; here it is the one that carries
//! the load at the guess, and what the contact moves from there, ξ = ξ₀ + (1 − n nᵀ) J(q₀) d. Newton's method solves
//!
//! ```text
//! τ(t, q, 0) − g(q) + Σ Jᵢᵀ Fᵢ(gap(q), 0, 0, ξᵢ) = 0
//! ```
//! with differences for its matrix, and the least d where the equations leave some of it open.

use super::system::{TouchingState, TreeInContact};
use crate::encounters::{ContactState, Encounters};
use crate::error::ContactError;
use crate::laws::ContactMode;
use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Vector3};
use somersault_integrators::force::Wrench;
use somersault_multibody::motion::{JointDrive, TreeForces, TreeState};

/// Most steps of Newton's method from one guess.
const MOST: u32 = 60;
/// Most guesses, each the pose that the one before led to, with the load on friction divided again.
const GUESSES: u32 = 20;
/// Halvings of a step that does not lessen what is left.
const HALVINGS: u32 = 8;

/// How far a joint is moved for a difference.
const MOVE: f64 = 1e-7;

/// The outcome of a search for a pose at rest.
#[derive(Debug, Clone)]
pub struct Equilibrium {
    /// The pose, at rest, with the stretches that hold it.
    pub state: TouchingState,
    /// The largest joint force that is left, N or N m.
    pub residual: f64,
    /// Whether that is zero to rounding, and every contact that is closed sticks.
    pub is_held: bool,
    /// Steps of Newton's method, from all guesses.
    pub iterations: u32,
}

impl<F: TreeForces, D: JointDrive> TreeInContact<'_, F, D> {
    /// A static equilibrium near the positions `q`, under the forces at time `t`. Its stability is not examined.
    ///
    /// If Newton's method does not converge, or friction cannot hold the pose, the result is the best iterate and
    /// [`is_held`](Equilibrium::is_held) is false. Friction forces of several contacts are not unique, and one division of the load
    /// is tried: near the angle of friction the result may be false although another division holds the pose. An integration from
    /// the iterate then comes to rest. Errors: positions that do not fit the tree.
    pub fn equilibrium(&self, t: f64, q: &[f64]) -> Result<Equilibrium, ContactError> {
        let mut best = self.equilibrium_from(t, q)?;
        let mut next = best.clone();
        for _ in 1..GUESSES {
            if best.is_held || !next.residual.is_finite() {
                break;
            }
            let iterations = next.iterations;
            next = self.equilibrium_from(t, next.state.configuration.0.as_slice())?;
            next.iterations += iterations;
            if next.is_held || next.residual < best.residual {
                best = next.clone();
            }
        }
        Ok(Equilibrium { iterations: next.iterations, ..best })
    }

    /// Newton's method from one guess, whose friction carries the load as far as it can.
    fn equilibrium_from(&self, t: f64, q: &[f64]) -> Result<Equilibrium, ContactError> {
        let n = self.model().n_velocities();
        let rest = vec![0.0; n];
        let guess = self.loaded(t, self.model().state(q, &rest)?)?;
        let sliding = self.sliding(&guess)?;
        let at = |d: &DVector<f64>| self.left(t, &self.moved(&guess, &sliding, d)?);
        let mut d = DVector::zeros(n);
        let (mut left, mut size) = at(&d)?;
        let mut iterations = 0;
        while left.amax() > 1e-14 * size && iterations < MOST {
            iterations += 1;
            let column = |k: usize| -> Result<DVector<f64>, ContactError> {
                let near = |sign: f64| {
                    let mut near = d.clone();
                    near[k] += sign * MOVE;
                    Ok::<_, ContactError>(at(&near)?.0)
                };
                Ok((near(1.0)? - near(-1.0)?) * (0.5 / MOVE))
            };
            let columns = (0..n).map(column).collect::<Result<Vec<_>, _>>()?;
            if columns.iter().any(|column| !column.iter().all(|x| x.is_finite())) {
                break;
            }
            let svd = DMatrix::from_columns(&columns).svd(true, true);
            let Ok(mut step) = svd.solve(&left, 1e-9 * svd.singular_values.max()) else { break };
            // A step of a pose, in m and rad: the forces are linear over little more than that.
            step *= (0.1 / step.amax()).min(1.0);
            let mut shorter = None;
            for _ in 0..=HALVINGS {
                let trial = &d - &step;
                let (found, scale) = at(&trial)?;
                if found.norm() < left.norm() {
                    shorter = Some((trial, found, scale));
                    break;
                }
                step *= 0.5;
            }
            let Some(next) = shorter else { break };
            (d, left, size) = next;
        }
        let state = self.moved(&guess, &sliding, &d)?;
        let sticks = self.touches(&state).iter().all(|touch| touch.mode != ContactMode::Slip);
        let residual = left.amax();
        Ok(Equilibrium { state, residual, is_held: residual <= 1e-10 * size && sticks, iterations })
    }

    /// How each contact that is closed moves in its plane by the joints.
    fn sliding(&self, guess: &TouchingState) -> Result<Vec<Matrix3xX<f64>>, ContactError> {
        let along = |touch: ContactState| {
            let plane = if touch.mode.is_open() {
                Matrix3::zeros()
            } else {
                Matrix3::identity() - touch.normal * touch.normal.transpose()
            };
            Ok(plane * self.contact_jacobian(touch.contact, guess)?)
        };
        self.touches(guess).into_iter().map(along).collect()
    }

    /// The guess with its joints moved by d, and its stretches with them.
    fn moved(
        &self,
        guess: &TouchingState,
        sliding: &[Matrix3xX<f64>],
        d: &DVector<f64>,
    ) -> Result<TouchingState, ContactError> {
        let (model, q0) = (self.model(), guess.configuration.0.as_slice());
        let mut q = q0.to_vec();
        model.displace(q0, d.as_slice(), &mut q)?;
        let state: TreeState = model.state(&q, &vec![0.0; model.n_velocities()])?;
        let moved = |(stretch, by): (&Vector3<f64>, &Matrix3xX<f64>)| stretch + by * d;
        self.stretched(state, guess.rate.variables.iter().zip(sliding).map(moved).collect())
    }

    /// The joint forces that are left at rest, and their size: that of the weight and of the contacts.
    fn left(&self, t: f64, x: &TouchingState) -> Result<(DVector<f64>, f64), ContactError> {
        let (model, q) = (self.model(), x.configuration.0.as_slice());
        let n = model.n_velocities();
        let mut left = DVector::zeros(n);
        let mut efforts: Vec<Wrench> = Vec::new();
        self.each_encounter(&x.configuration.0, &x.rate.base, |i, law, at| {
            let stretch = &x.rate.variables[i];
            efforts.push(law.effort_in(&law.mode(at, stretch), at, stretch));
        });
        let found = self.rest_forces(t, q, &efforts)?;
        left.as_mut_slice().copy_from_slice(&found);
        let size = model.mass() * model.gravity().norm()
            + efforts.iter().map(|effort| effort.force.norm()).sum::<f64>();
        Ok((left, size.max(f64::MIN_POSITIVE)))
    }
}
