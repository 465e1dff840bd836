//! A tree in contact, linearised in a state.

use super::contacts::frame;
use super::linearization::{LinkLinearization, TreeRoom};
use super::system::TreeInContact;
use crate::laws::{ContactMode, Encounter};
use crate::linearized::{At, Linearized};
use somersault_integrators::augmented::AugmentedRate;
use somersault_integrators::force::Wrench;
use somersault_integrators::state::Rate;
use somersault_multibody::motion::{Coordinates, JointDrive, Rates, TreeForces};

impl<F: TreeForces, D: JointDrive> Linearized for TreeInContact<'_, F, D> {
    type Moved = Coordinates;
    type Room = TreeRoom;

    fn room(&self) -> TreeRoom {
        TreeRoom {
            tree: self.tree().workspace_for_wrenches(),
            variation: self.tree().variation(),
            frames: Vec::with_capacity(self.model().n_bodies()),
            contacts: Vec::with_capacity(self.contacts().len()),
        }
    }

    fn accelerate(
        &self,
        w: &mut TreeRoom,
        mode: &[ContactMode],
        t: f64,
        x: At<'_, Self>,
        out: &mut AugmentedRate<Rates>,
    ) {
        self.acceleration_at(mode, &mut w.tree, t, x, out);
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

    fn vary(&self, w: &mut TreeRoom, t: f64, (q, _): At<'_, Self>, tangent: (&Rates, &Rates)) {
        self.tree().vary(&mut w.variation, t, &q.0, tangent);
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

    fn acceleration_change(&self, w: &mut TreeRoom, (q, _): At<'_, Self>, out: &mut Rates) {
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
}
