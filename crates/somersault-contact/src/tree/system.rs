//! A tree in contact as a system with modes.

use super::contacts::{LinkContact, LinkPair, TreeContacts, frame};
use super::linearization::TreeRoom;
use crate::bodies::{Part, SpherePair};
use crate::contacts::is_free;
use crate::encounters::{self, Encounters, Stretched, reset};
use crate::error::ContactError;
use crate::event::EventKind;
use crate::laws::{ContactLaw, ContactMode, ContactRate, Encounter, Mobility};
use crate::linearized::{Linearized, LinearizedRoom};
use crate::load;
use crate::surface::SurfaceFault;
use crate::sweep::PointSweep;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, Vector3};
use somersault_integrators::augmented::{Augmented, AugmentedRate};
use somersault_integrators::driver::IntegrateError;
use somersault_integrators::events::{Energy, Guard, Hybrid, Sweep};
use somersault_integrators::force::Wrench;
use somersault_integrators::partials::Partials;
use somersault_integrators::state::State;
use somersault_integrators::system::{Fault, OneForm, System};
use somersault_multibody::motion::{
    BodyWrenches, Coordinates, JointDrive, LinkBound, LinkBounds, Rates, TreeForces, TreeState, TreeSystem,
    TreeWorkspace,
};
use somersault_multibody::{Axes, Data, DynamicsError, Force, Model, Transform, Velocities};
use std::cell::RefCell;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Positions of a tree and their rates, and the stretches of its contacts beside the rates.
pub type TouchingState = State<Augmented<Coordinates>>;
/// The rate of one.
pub type TouchingRate = AugmentedRate<Rates>;

/// A tree in contact: see the [module](crate::tree).
///
/// As a [`System`] in its own right it switches each contact by its state, which costs any method its order, and keeps the
/// stretches of contacts that have ended: friction with a stretch needs a run that locates events.
#[derive(Debug)]
pub struct TreeInContact<'m, F = (), D = ()> {
    tree: TreeSystem<'m, F, D>,
    contacts: TreeContacts,
    /// How fast the root of the energy grows at most by the weight, √J/s.
    growth: f64,
    between: Mutex<Room>,
}

/// Room for the equations of a tree in contact.
#[derive(Debug)]
pub struct TouchingWorkspace {
    tree: TreeWorkspace,
    /// For derivatives, made where they are first wanted.
    linearized: Option<Box<LinearizedRoom<TreeRoom>>>,
}

/// The turn of links within a part of a step, rad, up to which the motion is as smooth as estimates of its acceleration take it to be.
const SHORT_TURN: f64 = 0.1;

/// Room for what is asked between steps.
#[derive(Debug)]
struct Room {
    data: Data,
    v: Vec<f64>,
    bounds: LinkBounds,
}

impl<'m, F: TreeForces, D: JointDrive> TreeInContact<'m, F, D> {
    /// A tree, its contacts with surfaces, and those between its links.
    pub fn try_new(
        tree: TreeSystem<'m, F, D>,
        on_surfaces: Vec<LinkContact>,
        pairs: Vec<LinkPair>,
    ) -> Result<Self, ContactError> {
        let model = tree.model();
        let contacts = TreeContacts::try_new(model, on_surfaces, pairs)?;
        let between = Mutex::new(Room {
            data: Data::new(model),
            v: vec![0.0; model.n_velocities()],
            bounds: LinkBounds::new(model),
        });
        let growth = model.gravity().norm() * (0.5 * model.mass()).sqrt();
        Ok(Self { tree, contacts, growth, between })
    }

    /// The tree.
    pub fn model(&self) -> &Model {
        self.tree.model()
    }

    /// The tree without its contacts.
    pub fn tree(&self) -> &TreeSystem<'m, F, D> {
        &self.tree
    }

    /// The contacts.
    pub fn contacts(&self) -> &TreeContacts {
        &self.contacts
    }

    /// A state with unstretched contacts.
    pub fn unstretched(&self, x: TreeState) -> TouchingState {
        encounters::unstretched(self, x)
    }

    /// A state with given stretches, m, of which the part in the plane of contact counts; none of open contacts.
    pub fn stretched(
        &self,
        x: TreeState,
        stretches: Vec<Vector3<f64>>,
    ) -> Result<TouchingState, ContactError> {
        encounters::stretched(self, x, stretches)
    }

    /// A state whose stretches carry the load at time t, as far as friction can, as of
    /// [`WithStretches::loaded`](crate::stretches::WithStretches::loaded).
    pub fn loaded(&self, t: f64, x: TreeState) -> Result<TouchingState, ContactError> {
        let Some(factor) = self.factor(x.configuration.as_slice())? else { return Ok(self.unstretched(x)) };
        let upper = factor.l().transpose();
        let w = RefCell::new(self.tree.workspace_for_wrenches());
        Ok(load::loaded(self, x, |x, effort| {
            let pressing =
                Pressing { contacts: &self.contacts, effort: RefCell::new(effort), is_open: &|_| false };
            let (q, p) = (&x.configuration, &x.rate);
            match self.tree.dynamics_under(&mut w.borrow_mut(), t, (q, p), Some(&pressing)) {
                Ok(found) => &upper * DVector::from_column_slice(found.acceleration),
                Err(_) => DVector::from_element(upper.ncols(), f64::NAN),
            }
        }))
    }

    /// τ(t, q, 0) − g(q) + Σ Jᵀ F: the joint forces that are left of the tree at rest under efforts of its contacts.
    pub(super) fn rest_forces(
        &self,
        t: f64,
        q: &[f64],
        efforts: &[Wrench],
    ) -> Result<Vec<f64>, DynamicsError> {
        let rest = vec![0.0; self.model().n_velocities()];
        let mut torque = rest.clone();
        self.tree.forces().add_torque(t, q, &rest, &mut torque);
        let needed = self.forces_for(t, (q, &rest, &rest), |i, _, _| efforts[i])?;
        torque.iter_mut().zip(needed).for_each(|(torque, needed)| *torque -= needed);
        Ok(torque)
    }

    /// M(q) a + C(q, v) v + g(q) − Σ Jᵀ F: the joint forces of an acceleration under efforts of the contacts and the wrenches of
    /// the forces.
    pub(super) fn forces_for(
        &self,
        t: f64,
        (q, v, a): (&[f64], &[f64], &[f64]),
        effort: impl FnMut(usize, &ContactLaw, &Encounter) -> Wrench,
    ) -> Result<Vec<f64>, DynamicsError> {
        let model = self.model();
        let mut data = Data::new(model);
        let mut wrenches = vec![Force::zero(); model.n_bodies()];
        let bodies = model.velocities(&mut data, q, v)?;
        if let Some(forces) = self.tree.forces().wrenches() {
            forces.add_wrenches(t, &bodies, &mut wrenches);
        }
        let pressing =
            Pressing { contacts: &self.contacts, effort: RefCell::new(effort), is_open: &|_| false };
        pressing.add_wrenches(t, &bodies, &mut wrenches);
        Ok(model.inverse_dynamics(&mut data, q, v, a, &wrenches)?.to_vec())
    }

    /// The factor of the mass matrix, unless that is singular.
    pub(super) fn factor(&self, q: &[f64]) -> Result<Option<Cholesky<f64, Dyn>>, DynamicsError> {
        Ok(self.model().mass_matrix(&mut Data::new(self.model()), q)?.clone().cholesky())
    }

    fn between(&self) -> MutexGuard<'_, Room> {
        self.between.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Shows the poses and velocities of the links; `None` where the state is of another tree.
    pub(crate) fn seen<R>(
        &self,
        (q, p): (&Coordinates, &Rates),
        see: impl FnOnce(&Velocities<'_>) -> R,
    ) -> Option<R> {
        let model = self.model();
        let Room { data, v, .. } = &mut *self.between();
        model.joint_velocities_at((q, p), v).ok()?;
        model.velocities(data, q.as_slice(), v).ok().map(|bodies| see(&bodies))
    }

    /// Energy of the springs of contacts, friction, and the potential of the forces; `None` where that may give energy.
    fn energy_of(&self, bodies: &Velocities<'_>, (q, p): Stretched<'_, Coordinates>) -> Option<Energy> {
        let potential = self.tree.potential(q.0.as_slice())? + bodies.positions().potential_energy();
        let springs = self.springs(bodies, &p.variables);
        Some(Energy { kinetic: bodies.kinetic_energy(), springs, potential })
    }

    /// Energy of the springs of contacts and friction, J.
    pub(super) fn springs(&self, bodies: &Velocities<'_>, stretches: &[Vector3<f64>]) -> f64 {
        let of = |(i, (part, stretch)): (usize, (Part<'_>, &Vector3<f64>))| {
            part.law().energy(self.contacts.meet(i, &part, bodies).0.gap, stretch)
        };
        self.contacts.parts().zip(stretches).enumerate().map(of).sum()
    }

    /// The root of the energy that can become motion, √J: kinetic energy, springs and the potential of the forces, none of
    /// which is negative. By the weight it grows at √(M/2) g at most, since no more than all of it moves the centre of mass.
    fn root_of_energy(&self, bodies: &Velocities<'_>, (q, p): Stretched<'_, Coordinates>) -> Option<f64> {
        let potential = self.tree.potential(q.0.as_slice())?;
        let energy = bodies.kinetic_energy() + self.springs(bodies, &p.variables) + potential;
        Some(energy.max(0.0).sqrt())
    }

    /// The sweep of the gap of a contact, given the bounds of the links, the largest root of the energy if it is known, and whether no link
    /// turns by more than [`SHORT_TURN`].
    ///
    /// The energy bounds the speed of a light link far above what it is, but over steps of any length. Where no link turns far the
    /// estimated speed counts as well.
    fn sweep(
        &self,
        i: usize,
        part: &Part<'_>,
        bodies: &Velocities<'_>,
        links: &[LinkBound],
        (root, is_short): (Option<f64>, bool),
        h: f64,
    ) -> Sweep {
        let proved = root.map(|root| root * self.contacts.mobility(i)).filter(|speed| speed.is_finite());
        let speed_of = |proved: Option<f64>, estimated: f64| match proved {
            Some(proved) if is_short => proved.min(estimated),
            Some(proved) => proved,
            None => estimated,
        };
        match part {
            Part::Surface(link, contact) => {
                let (shape, at, bound) = (contact.shape(), frame(bodies, *link), &links[*link]);
                let lever = shape.reach();
                let mut point = PointSweep {
                    centre: at.origin + at.rotation * shape.centre(),
                    time: h,
                    speed: bound.speed_at(lever),
                    acceleration: bound.acceleration_at(lever),
                    size: at.origin.amax() + lever,
                };
                if let Some(base) = self.contacts.base(i) {
                    point = point.seen_from(&frame(bodies, base), &links[base]);
                }
                let sweep = contact.sweep_of(&point);
                let constant = contact.surface().lipschitz();
                Sweep { speed: speed_of(proved.map(|speed| constant * speed), sweep.speed), ..sweep }
            }
            Part::Pair(pair) => {
                let ends = pair.spheres().each_ref().map(|sphere| {
                    let (bound, lever) = (&links[sphere.body()], sphere.shape().reach());
                    let size = frame(bodies, sphere.body()).origin.amax() + lever;
                    (bound.speed_at(lever), bound.acceleration_at(lever), size)
                });
                let [a, b] = ends;
                let fall = if pair.is_of_balls() { a.1 + b.1 } else { f64::INFINITY };
                Sweep { speed: speed_of(proved, a.0 + b.0), fall, size: a.2 + b.2 }
            }
        }
    }

    /// The velocity of the first relative to the second at the point of contact `i`, by the velocities of the joints: linear
    /// and angular part, world axes, 6 × [`n_velocities`](Model::n_velocities).
    pub(super) fn relative_jacobian(
        &self,
        i: usize,
        bodies: &Velocities<'_>,
    ) -> Result<DMatrix<f64>, ContactError> {
        let (at, hold) = self.contacts.meet(i, &self.contacts.part(i)?, bodies);
        let n = self.model().n_velocities();
        let of = |link: usize| {
            let positions = bodies.positions();
            let pose = positions.pose(link)?;
            let point = pose.rotation.tr_mul(&(at.point - pose.translation));
            let mut out = DMatrix::zeros(6, n);
            positions.jacobian_into(link, &Transform::translation(point), Axes::World, &mut out)?;
            Ok::<_, ContactError>(out)
        };
        let first = of(hold.first.0)?;
        match hold.second {
            Some((link, _)) => Ok(first - of(link)?),
            None => Ok(first),
        }
    }
}

/// The mobility of a contact: J M⁻¹ Jᵀ in the directions that laws act in.
fn mobility(jacobian: &DMatrix<f64>, factor: &Cholesky<f64, Dyn>, normal: &Vector3<f64>) -> Mobility {
    let solved = factor.solve(&jacobian.transpose());
    let whole = jacobian * solved;
    let block = |at: usize| -> Matrix3<f64> { whole.fixed_view::<3, 3>(at, at).into() };
    let largest = |matrix: &Matrix3<f64>| ((matrix + matrix.transpose()) * 0.5).symmetric_eigenvalues().max();
    let (linear, angular) = (block(0), block(3));
    Mobility {
        normal: normal.dot(&(linear * normal)),
        tangential: largest(&linear),
        turning: largest(&angular),
    }
}

/// The efforts of contacts as wrenches on links.
struct Pressing<'a, E> {
    contacts: &'a TreeContacts,
    effort: RefCell<E>,
    is_open: &'a dyn Fn(usize) -> bool,
}

impl<E: FnMut(usize, &ContactLaw, &Encounter) -> Wrench> BodyWrenches for Pressing<'_, E> {
    fn add_wrenches(&self, _: f64, bodies: &Velocities<'_>, wrenches: &mut [Force<f64>]) {
        let mut effort = self.effort.borrow_mut();
        for (i, part) in self.contacts.parts().enumerate() {
            if (self.is_open)(i) {
                continue;
            }
            let (at, hold) = self.contacts.meet(i, &part, bodies);
            hold.press(&effort(i, part.law(), &at), |link, wrench| {
                let turn = frame(bodies, link).rotation;
                wrenches[link] += Force::new(turn.tr_mul(&wrench.force), turn.tr_mul(&wrench.torque));
            });
        }
    }
}

impl<F: TreeForces, D: JointDrive> Encounters<Coordinates> for TreeInContact<'_, F, D> {
    fn laws(&self) -> impl Iterator<Item = &ContactLaw> {
        self.contacts.laws()
    }

    fn each_encounter(
        &self,
        q: &Coordinates,
        p: &Rates,
        mut see: impl FnMut(usize, &ContactLaw, &Encounter),
    ) {
        self.seen((q, p), |bodies| {
            for (i, part) in self.contacts.parts().enumerate() {
                see(i, part.law(), &self.contacts.meet(i, &part, bodies).0);
            }
        });
    }
}

impl<F: TreeForces, D: JointDrive> System for TreeInContact<'_, F, D> {
    type Configuration = Augmented<Coordinates>;
    type Forms = OneForm;
    type Workspace = TouchingWorkspace;

    fn workspace(&self) -> TouchingWorkspace {
        TouchingWorkspace { tree: self.tree.workspace_for_wrenches(), linearized: None }
    }

    fn acceleration(&self, w: &mut TouchingWorkspace, t: f64, x: &TouchingState, out: &mut TouchingRate) {
        self.acceleration_in(&self.mode(t, x), w, t, x, out);
    }

    fn partials(
        &self,
        w: &mut TouchingWorkspace,
        t: f64,
        x: &TouchingState,
        out: &mut Partials<Augmented<Coordinates>>,
    ) {
        self.partials_in(&self.mode(t, x), w, t, x, out);
    }

    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        self.tree.next_stop(t, end)
    }

    fn take_fault(&self) -> Option<Fault> {
        self.tree.take_fault()
    }
}

/// The two parts of a state.
fn parts(x: &TouchingState) -> Stretched<'_, Coordinates> {
    (&x.configuration, &x.rate)
}

/// What [`Hybrid`] asks, of a state in its two parts.
impl<F: TreeForces, D: JointDrive> TreeInContact<'_, F, D> {
    pub(crate) fn sweeps_at(&self, h: f64, ends: [Stretched<'_, Coordinates>; 2], out: &mut Vec<Sweep>) {
        let Room { data, bounds, .. } = &mut *self.between();
        let [before, _] = ends;
        let ends = ends.map(|(q, p)| (&q.0, &p.base));
        let Ok((bodies, links)) = bounds.between(self.model(), data, ends, h) else { return };
        let root = self.root_of_energy(&bodies, before);
        let root = root.map(|root| root + self.growth * h);
        let is_short = links.iter().all(|link| link.spin * h < SHORT_TURN);
        let parts = self.contacts.parts().enumerate();
        out.extend(parts.map(|(i, part)| self.sweep(i, &part, &bodies, links, (root, is_short), h)));
    }

    pub(crate) fn clear_time_at(
        &self,
        mode: &[ContactMode],
        (q, p): Stretched<'_, Coordinates>,
        guards: &[Guard],
        horizon: f64,
    ) -> f64 {
        if !is_free(mode) {
            return 0.0;
        }
        let root = self.seen((&q.0, &p.base), |bodies| self.root_of_energy(bodies, (q, p)));
        let Some(root) = root.flatten().map(|root| root + self.growth * horizon) else { return 0.0 };
        self.contacts.parts().zip(guards).enumerate().fold(horizon, |least, (i, (part, guard))| {
            let constant = match part {
                Part::Surface(_, contact) => contact.surface().lipschitz(),
                Part::Pair(_) => 1.0,
            };
            let speed = constant * root * self.contacts.mobility(i);
            least.min(Sweep { speed, ..Sweep::UNKNOWN }.clear_time(guard.gap))
        })
    }

    pub(crate) fn examine_at(
        &self,
        guard: usize,
        (q, p): Stretched<'_, Coordinates>,
    ) -> Result<(), SurfaceFault> {
        let Ok(part) = self.contacts.part(guard) else { return Ok(()) };
        let examined = self.seen((&q.0, &p.base), |bodies| match &part {
            Part::Surface(link, contact) => {
                let carrier = frame(bodies, *link);
                let base = self.contacts.base(guard).map(|base| frame(bodies, base));
                contact.examine_on(&base.map_or(carrier, |base| carrier.seen_from(&base)))
            }
            Part::Pair(_) => SpherePair::examine_at(&self.contacts.meet(guard, &part, bodies).0),
        });
        examined.unwrap_or(Ok(()))
    }

    pub(crate) fn stiffest_rate_at(&self, mode: &[ContactMode], (q, p): Stretched<'_, Coordinates>) -> f64 {
        if is_free(mode) {
            return 0.0;
        }
        // Where the mass matrix is singular the equations say so themselves.
        let Ok(Some(factor)) = self.factor(q.0.as_slice()) else { return 0.0 };
        let rates = self.seen((&q.0, &p.base), |bodies| {
            let closed = self.contacts.parts().zip(mode).enumerate().filter(|(_, (_, mode))| !mode.is_open());
            let rate = |(i, (part, _)): (usize, (Part<'_>, &ContactMode))| {
                let (at, _) = self.contacts.meet(i, &part, bodies);
                let jacobian = self.relative_jacobian(i, bodies).ok()?;
                Some(part.law().rate(&at, &mobility(&jacobian, &factor, &at.normal)))
            };
            closed.filter_map(rate).sum::<ContactRate>()
        });
        rates.unwrap_or_default().bound()
    }

    pub(crate) fn energy_at(&self, (q, p): Stretched<'_, Coordinates>) -> Option<Energy> {
        self.seen((&q.0, &p.base), |bodies| self.energy_of(bodies, (q, p))).flatten()
    }

    pub(crate) fn acceleration_at(
        &self,
        mode: &[ContactMode],
        w: &mut TreeWorkspace,
        t: f64,
        (q, p): Stretched<'_, Coordinates>,
        AugmentedRate { base, variables }: &mut TouchingRate,
    ) {
        variables.fill(Vector3::zeros());
        let at = (&q.0, &p.base);
        if is_free(mode) {
            self.tree.acceleration_under(w, t, at, None, base);
            return;
        }
        let stretches = &p.variables;
        let effort = |i: usize, law: &ContactLaw, at: &Encounter| {
            let (wrench, stretch_rate) = law.response_in(&mode[i], at, &stretches[i]);
            variables[i] = stretch_rate;
            wrench
        };
        let is_open = |i: usize| mode[i].is_open();
        let pressing = Pressing { contacts: &self.contacts, effort: RefCell::new(effort), is_open: &is_open };
        self.tree.acceleration_under(w, t, at, Some(&pressing), base);
    }
}

#[deny(clippy::missing_trait_methods)]
impl<F: TreeForces, D: JointDrive> Hybrid for TreeInContact<'_, F, D> {
    type Mode = Vec<ContactMode>;
    type Kind = EventKind;
    type Fault = SurfaceFault;
    const RESETS: bool = true;

    fn check(&self) -> Result<(), IntegrateError> {
        Ok(())
    }

    fn mode(&self, _: f64, x: &TouchingState) -> Vec<ContactMode> {
        encounters::modes(self, (&x.configuration, &x.rate))
    }

    fn next_mode(&self, before: &Vec<ContactMode>, _: f64, x: &TouchingState) -> Vec<ContactMode> {
        encounters::next_modes(self, before, (&x.configuration, &x.rate))
    }

    fn event_kind(
        &self,
        guard: usize,
        before: &Guard,
        after: &Guard,
        modes: (&Vec<ContactMode>, &Vec<ContactMode>),
    ) -> EventKind {
        EventKind::of_guard(modes.0.len(), guard, before, after)
    }

    fn guards(&self, mode: &Vec<ContactMode>, _: f64, x: &TouchingState, out: &mut Vec<Guard>) {
        encounters::guards(self, mode, (&x.configuration, &x.rate), out);
    }

    fn sweeps(
        &self,
        _: &Vec<ContactMode>,
        _: f64,
        h: f64,
        (before, after): (&TouchingState, &TouchingState),
        out: &mut Vec<Sweep>,
    ) {
        self.sweeps_at(h, [parts(before), parts(after)], out);
    }

    fn clear_time(
        &self,
        mode: &Vec<ContactMode>,
        _: f64,
        x: &TouchingState,
        guards: &[Guard],
        horizon: f64,
    ) -> f64 {
        self.clear_time_at(mode, parts(x), guards, horizon)
    }

    fn examine(&self, guard: usize, x: &TouchingState) -> Result<(), SurfaceFault> {
        self.examine_at(guard, parts(x))
    }

    fn stiffest_rate(&self, mode: &Vec<ContactMode>, x: &TouchingState) -> f64 {
        self.stiffest_rate_at(mode, parts(x))
    }

    fn energy(&self, x: &TouchingState) -> Option<Energy> {
        self.energy_at(parts(x))
    }

    fn acceleration_in(
        &self,
        mode: &Vec<ContactMode>,
        w: &mut TouchingWorkspace,
        t: f64,
        x: &TouchingState,
        out: &mut TouchingRate,
    ) {
        self.acceleration_at(mode, &mut w.tree, t, parts(x), out);
    }

    /// Analytic as those of the tree without contacts, and of laws that have derivatives; by differences where a law has none
    /// or joints are driven otherwise than by accelerations.
    fn partials_in(
        &self,
        mode: &Vec<ContactMode>,
        w: &mut TouchingWorkspace,
        t: f64,
        x: &TouchingState,
        out: &mut Partials<Augmented<Coordinates>>,
    ) {
        let TouchingWorkspace { linearized, .. } = w;
        let room = linearized.get_or_insert_with(|| Box::new(LinearizedRoom::new(self.room())));
        let at = parts(x);
        room.linearize(self, mode, t, at, out.room_mut());
        out.by_columns(|(displacement, change), slope| {
            let AugmentedRate { base, variables } = slope;
            room.vary(self, mode, t, at, (&displacement.base, change), |_| {}, |_| None, variables);
            self.acceleration_change(&mut room.system, at, base);
        });
        if !out.is_finite() {
            out.by_differences(x, |x, slope| self.acceleration_in(mode, w, t, x, slope));
        }
    }

    /// Contacts begin and end without stretch.
    fn reset(&self, _: f64, before: &Vec<ContactMode>, after: &Vec<ContactMode>, x: &mut TouchingState) {
        reset(before, after, &mut x.rate.variables);
    }

    fn impulse(&self, guard: usize, h: f64, before: &Guard, after: &Guard) -> f64 {
        self.contacts.laws().nth(guard).map_or(0.0, |law| law.normal().impulse(h, before, after))
    }
}
