//! A tree in contact, differentiated.

use super::differentiable::{Collected, Differentiable};
use super::outcome::{SensitivityError, TreeSensitivities};
use super::parameter::Parameter;
use crate::laws::ContactMode;
use crate::linearized::At;
use crate::shape::Feature;
use crate::surface::SurfaceFault;
use crate::tree::{TreeInContact, TreeRoom};
use nalgebra::DMatrix;
use somersault_integrators::events::{Energy, Guard, Sweep};
use somersault_integrators::system::{Fault, OneForm, System};
use somersault_integrators::variation::Tangent;
use somersault_multibody::motion::{Coordinates, JointDrive, Rates, TreeForces, TreeState};

impl<F: TreeForces, D: JointDrive> Differentiable for TreeInContact<'_, F, D> {
    type Forms = OneForm;
    type Sensitivities = TreeSensitivities;

    fn tangents(&self, x: &TreeState) -> Vec<Tangent<Rates>> {
        let n = self.model().n_velocities();
        let unit = |i: usize| {
            let mut numbers = vec![0.0; 2 * n];
            numbers[i] = 1.0;
            let (way, change) = numbers.split_at(n);
            // A state of another tree has none; the run says so.
            self.model().tangent(x, way, change).ok()
        };
        (0..2 * n).filter_map(unit).collect()
    }

    fn without_derivative(&self) -> Option<SensitivityError> {
        (self.tree().is_driven() && self.tree().split().is_none()).then_some(SensitivityError::Drive)
    }

    fn refuse(&self, parameter: &Parameter) -> Option<SensitivityError> {
        let not_of = |of| Some(SensitivityError::NotOf { found: format!("{parameter:?}"), of });
        let n = self.model().n_velocities();
        match parameter {
            Parameter::Mass | Parameter::InertiaScale | Parameter::Force(_) => not_of("a tree"),
            Parameter::JointForce(found) | Parameter::JointForceAt(found, ..) if *found >= n => {
                Some(SensitivityError::NoJoint { n, found: *found })
            }
            Parameter::JointForceAt(_, knots, found) if *found >= knots.times().len() => {
                Some(SensitivityError::NoKnot { n: knots.times().len(), found: *found })
            }
            Parameter::Tree(parameter) => self.tree().check_parameter(parameter).err().map(Into::into),
            Parameter::Normal(..)
            | Parameter::Friction(..)
            | Parameter::JointForce(_)
            | Parameter::JointForceAt(..) => None,
        }
    }

    fn vary_by(&self, w: &mut TreeRoom, t: f64, _: At<'_, Self>, parameter: &Parameter) {
        match parameter {
            Parameter::JointForce(dof) => w.add_joint_force(*dof, 1.0),
            Parameter::JointForceAt(dof, knots, knot) => w.add_joint_force(*dof, knots.weight(*knot, t)),
            Parameter::Tree(parameter) => self.tree().vary_parameter(&mut w.variation, parameter),
            Parameter::Normal(..)
            | Parameter::Friction(..)
            | Parameter::Mass
            | Parameter::InertiaScale
            | Parameter::Force(_) => {}
        }
    }

    fn add_change_by(&self, _: &mut TreeRoom, _: &Parameter, _: &mut Rates) {}

    fn each_feature(&self, (q, p): At<'_, Self>, mut see: impl FnMut(usize, Feature)) {
        let contacts = self.contacts();
        if contacts.parts().any(|part| part.has_features()) {
            self.seen((&q.0, &p.base), |bodies| {
                for (i, part) in contacts.parts().enumerate().filter(|(_, part)| part.has_features()) {
                    see(i, contacts.feature(i, &part, bodies));
                }
            });
        }
    }

    fn collect(&self, collected: Collected<Coordinates>) -> TreeSensitivities {
        let Collected { run, columns, event_times } = collected;
        let end = run.state.base();
        let n = self.model().n_velocities();
        let column = |tangent: &Tangent<Rates>| {
            let found = self.model().joint_tangent(&end, (&tangent.displacement, &tangent.rate));
            found.map_or_else(|_| vec![f64::NAN; 2 * n], |[way, change]| [way, change].concat())
        };
        let numbers: Vec<Vec<f64>> = columns.iter().map(column).collect();
        let of = |from: usize, count: usize| {
            DMatrix::from_fn(2 * n, count, |row, k| numbers.get(from + k).map_or(f64::NAN, |c| c[row]))
        };
        TreeSensitivities {
            state: of(0, 2 * n),
            parameters: of(2 * n, columns.len().saturating_sub(2 * n)),
            event_times,
            run,
        }
    }

    fn sweeps_between(
        &self,
        _: &Vec<ContactMode>,
        _: f64,
        h: f64,
        ends: [At<'_, Self>; 2],
        out: &mut Vec<Sweep>,
    ) {
        self.sweeps_at(h, ends, out);
    }

    fn clear_time_from(
        &self,
        mode: &Vec<ContactMode>,
        _: f64,
        x: At<'_, Self>,
        guards: &[Guard],
        horizon: f64,
    ) -> f64 {
        self.clear_time_at(mode, x, guards, horizon)
    }

    fn next_stop_between(&self, t: f64, end: f64) -> Option<f64> {
        self.next_stop(t, end)
    }

    fn examine_in(&self, guard: usize, x: At<'_, Self>) -> Result<(), SurfaceFault> {
        self.examine_at(guard, x)
    }

    fn stiffest_rate_in(&self, mode: &Vec<ContactMode>, x: At<'_, Self>) -> f64 {
        self.stiffest_rate_at(mode, x)
    }

    fn energy_in(&self, x: At<'_, Self>) -> Option<Energy> {
        self.energy_at(x)
    }

    fn fault(&self) -> Option<Fault> {
        self.take_fault()
    }
}
