//! Stretches that carry a load: how things are put down at rest.

use crate::encounters::{self, Encounters};
use crate::laws::{ContactLaw, Encounter, FrictionSpring};
use nalgebra::{DMatrix, DVector, Vector3};
use somersault_integrators::augmented::Augmented;
use somersault_integrators::force::Wrench;
use somersault_integrators::state::{Configuration, State};

/// What efforts of the contacts, by their numbers, laws and encounters, come to.
pub(crate) type Effort<'a> = &'a dyn Fn(usize, &ContactLaw, &Encounter) -> Wrench;

/// A state whose stretches carry the load, as far as friction can: the parts in the planes of contact of the least
/// forces at the contacts that leave the least acceleration by Gauss' measure, aᵀ M a, each within its cone.
///
/// `weighed` gives √M a under all forces with the efforts given.
pub(crate) fn loaded<Q: Configuration>(
    contacts: &impl Encounters<Q>,
    x: State<Q>,
    weighed: impl Fn(&State<Q>, Effort<'_>) -> DVector<f64>,
) -> State<Augmented<Q>> {
    let mut state = encounters::unstretched(contacts, x);
    let x = state.base();
    let mut units: Vec<(usize, Vector3<f64>)> = Vec::new();
    // Spring and normal of each contact that holds by a spring.
    let mut springs = vec![None; state.rate.variables.len()];
    contacts.each_encounter(&x.configuration, &x.rate, |i, law, at| {
        if !law.guard(at).is_inside() {
            return;
        }
        units.push((i, at.normal));
        let push = law.push(at.gap, at.rate);
        if let Some(spring) = law.friction().law().and_then(|friction| friction.spring(push)) {
            let first = at.normal.cross(&Vector3::ith(at.normal.iamin(), 1.0)).normalize();
            units.extend([(i, first), (i, at.normal.cross(&first))]);
            springs[i] = Some((spring, at.normal));
        }
    });
    let none = Vector3::zeros();
    let load = weighed(&x, &|_, law, at| law.effort_in(&law.mode(at, &none), at, &none));
    // The smooth forces act in each of the columns, and are taken out of them again.
    let smooth = weighed(&x, &|_, _, _| Wrench::default());
    let column = |(contact, unit): &(usize, Vector3<f64>)| {
        let force = |i| if i == *contact { *unit } else { Vector3::zeros() };
        weighed(&x, &|i, _, _| Wrench { force: force(i), torque: Vector3::zeros() }) - &smooth
    };
    let columns: Vec<_> = units.iter().map(column).collect();
    // Forces that are not numbers carry nothing.
    if columns.is_empty() || !columns.iter().chain([&load]).all(|of| of.iter().all(|x| x.is_finite())) {
        return state;
    }
    let svd = DMatrix::from_columns(&columns).svd(true, true);
    let Ok(forces) = svd.solve(&-load, 1e-12 * svd.singular_values.max()) else { return state };
    for ((i, unit), force) in units.iter().zip(forces.iter()) {
        if let Some((FrictionSpring { stiffness, .. }, _)) = springs[*i] {
            state.rate.variables[*i] -= unit * (force / stiffness);
        }
    }
    for (stretch, spring) in state.rate.variables.iter_mut().zip(springs) {
        let Some((FrictionSpring { longest, .. }, normal)) = spring else { continue };
        *stretch -= normal * normal.dot(stretch);
        let length = stretch.norm();
        if length > longest {
            *stretch *= longest / length;
        }
    }
    state
}
