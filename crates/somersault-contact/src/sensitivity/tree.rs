//! A tree in contact, differentiated.

use super::differentiable::{At, Collected, Differentiable};
use super::link::LinkLinearization;
use super::outcome::{SensitivityError, TreeSensitivities};
use super::parameter::Parameter;
use crate::carrier::Frame;
use crate::laws::{ContactMode, Encounter};
use crate::surface::SurfaceFault;
use crate::tree::{TreeInContact, frame};
use nalgebra::DMatrix;
use somersault_integrators::augmented::AugmentedRate;
use somersault_integrators::events::{Energy, Guard, Sweep};
use somersault_integrators::force::Wrench;
use somersault_integrators::state::Rate;
use somersault_integrators::system::{Fault, OneForm, System};
use somersault_integrators::variation::Tangent;
use somersault_multibody::motion::{Coordinates, Rates, TreeForces, TreeState, TreeVariation, TreeWorkspace};

/// Room for a tree linearised in a state.
#[derive(Debug)]
pub struct TreeRoom {
    tree: TreeWorkspace,
    variation: TreeVariation,
    frames: Vec<Frame>,
    contacts: Vec<Option<LinkLinearization>>,
}

impl<F: TreeForces> Differentiable for TreeInContact<'_, F> {
    type Moved = Coordinates;
    type Forms = OneForm;
    type Workspace = TreeRoom;
    type Sensitivities = TreeSensitivities;

    fn room(&self) -> TreeRoom {
        TreeRoom {
            tree: self.workspace(),
            variation: self.tree().variation(),
            frames: Vec::with_capacity(self.model().n_bodies()),
            contacts: Vec::with_capacity(self.contacts().len()),
        }
    }

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

    fn refuse(&self, parameter: &Parameter) -> Option<SensitivityError> {
        let not_of = |of| Some(SensitivityError::NotOf { found: format!("{parameter:?}"), of });
        match parameter {
            Parameter::Mass | Parameter::InertiaScale | Parameter::Force(_) => not_of("a tree"),
            Parameter::JointForce(found) if *found >= self.model().n_velocities() => {
                Some(SensitivityError::NoJoint { n: self.model().n_velocities(), found: *found })
            }
            Parameter::Normal(..) | Parameter::Friction(..) | Parameter::JointForce(_) => None,
        }
    }

    fn linearize(
        &self,
        w: &mut TreeRoom,
        (mode, all): (&[ContactMode], bool),
        t: f64,
        (q, p): At<'_, Self>,
        out: &mut AugmentedRate<Rates>,
    ) {
        let TreeRoom { tree, variation, frames, contacts } = w;
        self.acceleration_at(mode, tree, t, (q, p), out);
        if !self.tree().linearize(tree, variation, &q.0) {
            out.base.scale(f64::NAN);
        }
        contacts.clear();
        if !all && mode.iter().all(|mode| mode.is_open()) {
            return;
        }
        frames.clear();
        self.seen((&q.0, &p.base), |bodies| {
            frames.extend((0..self.model().n_bodies()).map(|link| frame(bodies, link)));
            let parts = self.contacts().parts().zip(mode).enumerate();
            contacts.extend(parts.map(|(i, (part, mode))| {
                (all || !mode.is_open()).then(|| {
                    let met = self.contacts().meet(i, &part, bodies);
                    LinkLinearization::new(self.contacts(), i, &part, frames, met)
                })
            }));
        });
    }

    fn met<'w>(&self, w: &'w TreeRoom, contact: usize) -> Option<&'w Encounter> {
        w.contacts.get(contact)?.as_ref().map(|of| &of.at)
    }

    fn vary(
        &self,
        w: &mut TreeRoom,
        t: f64,
        (q, _): At<'_, Self>,
        tangent: (&Rates, &Rates),
        parameter: Option<&Parameter>,
    ) {
        self.tree().vary(&mut w.variation, t, &q.0, tangent);
        if let Some(Parameter::JointForce(k)) = parameter
            && let Some(torque) = w.variation.torque_mut().get_mut(*k)
        {
            *torque += 1.0;
        }
    }

    fn change(&self, w: &mut TreeRoom, contact: usize) -> Encounter {
        match (w.contacts.get(contact), self.contacts().part(contact)) {
            (Some(Some(of)), Ok(part)) => of.along(&part, &w.frames, w.variation.links()),
            (Some(_) | None, _) => Encounter::ZERO,
        }
    }

    fn press(&self, w: &mut TreeRoom, contact: usize, effort: (&Wrench, &Wrench), change: &Encounter) {
        let TreeRoom { variation, frames, contacts, .. } = w;
        let Some(Some(of)) = contacts.get(contact) else { return };
        let mut pushed = [None; 2];
        let mut rest = pushed.iter_mut();
        of.press(effort, change, frames, variation.links(), |link, _, change| {
            if let Some(place) = rest.next() {
                *place = Some((link, change));
            }
        });
        for (link, change) in pushed.into_iter().flatten() {
            variation.push(link, &change);
        }
    }

    fn acceleration_change(
        &self,
        w: &mut TreeRoom,
        (q, _): At<'_, Self>,
        _: Option<&Parameter>,
        out: &mut Rates,
    ) {
        self.tree().acceleration_change(&mut w.variation, &q.0, out);
    }

    fn response(
        &self,
        w: &mut TreeRoom,
        contact: usize,
        (q, _): At<'_, Self>,
        effort: &Wrench,
        out: &mut Rates,
    ) {
        let TreeRoom { variation, frames, contacts, .. } = w;
        variation.rest();
        if let Some(Some(of)) = contacts.get(contact) {
            let mut pushed = [None; 2];
            let mut rest = pushed.iter_mut();
            let still = (&Wrench::default(), &Encounter::ZERO);
            of.press((effort, still.0), still.1, frames, variation.links(), |link, wrench, _| {
                if let Some(place) = rest.next() {
                    *place = Some((link, wrench));
                }
            });
            for (link, wrench) in pushed.into_iter().flatten() {
                variation.push(link, &wrench);
            }
        }
        self.tree().acceleration_change(variation, &q.0, out);
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
