//! Contacts of trees: with surfaces, between links, and what they do.

use crate::contact::contacts::{Contact, GivenLaws};
use crate::contact::laws::{
    Resistance, friction_law, laws, normal_law, normal_law_repr, parts, resistance_law,
};
use crate::contact::shapes::shape_of;
use crate::contact::touches::Touches;
use crate::core::callable::Failure;
use crate::core::convert::{
    a_type, array, components, finite_all, orientation, real_numbers, row, sequence, vector_array, vector_or,
    with_shape,
};
use crate::core::error::Error;
use crate::core::value::{Pickled, brief, by_class, counted, few, value};
use crate::multibody::given::Given;
use crate::multibody::kinematics::write;
use crate::multibody::model::Model;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyTuple, PyType};
use somersault::contact::encounters::ContactState;
use somersault::contact::event::EventKind;
use somersault::contact::laws::ContactLaw;
use somersault::contact::shape::Shape;
use somersault::contact::tree::{self, MomentumLedger, TouchingState, TreeInContact};
use somersault::integrators::augmented::Augmented;
use somersault::integrators::events::{self, Hybrid};
use somersault::integrators::nalgebra::{UnitQuaternion, Vector3};
use somersault::multibody;
use somersault::multibody::motion::{Coordinates, JointDrive, TreeForces, TreeSystem};

/// A point, ball or rim of a link of a tree that touches a surface, with a name.
///
/// Parameters
/// ----------
/// name : str
///     Name of the contact.
/// link : str
///     The body of the model.
/// contact : Contact
///     What touches which surface and under which laws. Its lengths are in the frame of the link, from the
///     origin of that frame.
/// on : str, optional
///     The body of the model that carries the surface, in whose frame it is then: a board, a platform, a conveyor. The
///     surface stands in the world unless given.
///
/// Examples
/// --------
/// >>> from somersault import contact
/// >>> law = contact.CompliantLaw(1e4, 20.0)
/// >>> foot = contact.LinkContact("foot", "shank", contact.Contact((0, 0, -0.4), contact.HalfSpace(), law))
/// >>> foot.name, foot.link
/// ('foot', 'shank')
#[pyclass(frozen, module = "somersault.contact")]
pub(crate) struct LinkContact {
    name: String,
    link: String,
    contact: Py<Contact>,
    on: Option<String>,
}

value! {
    impl LinkContact(name, link, contact, on) {
        /// str: Name of the contact.
        name: &str = |own| &own.name;
        /// str: The body of the model.
        link: &str = |own| &own.link;
        /// Contact: What touches which surface and under which laws.
        contact: Py<Contact> = |own, py| own.contact.clone_ref(py);
        /// str or None: The body that carries the surface.
        on: Option<&str> = |own| own.on.as_deref();
        /// Surface or callable: The surface.
        surface: Py<PyAny> = |own, py| own.contact.get().surface(py);
    }
}

impl LinkContact {
    /// One of the library's, against a surface as it was given, which a body may carry.
    pub(crate) fn of(
        py: Python<'_>,
        own: &tree::LinkContact,
        surface: &Bound<'_, PyAny>,
        on: Option<&str>,
    ) -> Result<Self, Error> {
        let contact = Py::new(py, Contact::given(own.contact(), surface))?;
        Ok(Self { name: own.name().into(), link: own.link().into(), contact, on: on.map(Into::into) })
    }
}

#[pymethods]
impl LinkContact {
    #[new]
    #[pyo3(signature = (name, link, contact, on=None))]
    fn new(name: String, link: String, contact: Py<Contact>, on: Option<String>) -> Self {
        Self { name, link, contact, on }
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let contact = brief(&self.contact.bind(py).repr()?.to_cow()?, 60);
        let [name, link] = [&self.name, &self.link].map(|text| brief(text, 30));
        let on = self.on.as_ref().map_or_else(String::new, |on| format!(", on={:?}", brief(on, 30)));
        Ok(format!("LinkContact({name:?}, {link:?}, {contact}{on})"))
    }
}

/// Two spheres fixed on two links of a tree, which touch under some laws, with a name; by `of_shapes` capsules and boxes too.
///
/// Parameters
/// ----------
/// name : str
///     Name of the contact.
/// links : tuple of str
///     The two bodies of the model.
/// radii : tuple of float
///     Radii of the spheres, m.
/// law : CompliantLaw or HuntCrossley
///     Law of the normal force.
/// centers : tuple of array_like, shape (3,), optional
///     Centres of the spheres, each in the frame of its link, m; the origins unless given.
/// friction : CoulombFriction or RegularisedFriction, optional
///     Law of friction; none unless given.
/// resistance : Resistance, optional
///     Resistance to rolling and spinning; none unless given.
///
/// Examples
/// --------
/// >>> from somersault import contact
/// >>> knees = contact.LinkPair("knees", ("left", "right"), (0.05, 0.05), contact.CompliantLaw(1e4))
/// >>> knees.links
/// ('left', 'right')
#[pyclass(frozen, module = "somersault.contact")]
pub(crate) struct LinkPair {
    pair: tree::LinkPair,
    radii: [f64; 2],
    centers: [Vector3<f64>; 2],
    /// Names, sizes and orientations of shapes that are not spheres alone.
    shapes: Option<[GivenShape; 2]>,
    law: ContactLaw,
}

/// The name of a shape, its size, and how it is turned in its link, as a quaternion x, y, z, w.
type GivenShape = (String, Vec<f64>, [f64; 4]);
/// Name, links, radii, centres and shapes of a pair, as a file has them.
type GivenPair<'py> = (String, [String; 2], [f64; 2], [Bound<'py, PyAny>; 2], Option<[GivenShape; 2]>);

value! {
    impl LinkPair {
        /// str: Name of the contact.
        name: &str = |own| own.pair.name();
        /// tuple of str: The two bodies of the model.
        links: (&str, &str) = |own| own.pair.links().each_ref().map(String::as_str).into();
        /// tuple of float: Radii of the spheres or capsules, m; 0 of a box.
        radii: (f64, f64) = |own| own.radii.into();
        /// tuple of ndarray, shape (3,): Centres of the shapes, each in the frame of its link, m.
        centers: (Bound<'py, PyAny>, Bound<'py, PyAny>) =
            |own, py| own.centers.map(|center| vector_array(py, &center)).into();
        /// CompliantLaw or HuntCrossley: The law of the normal force.
        law: PyResult<Bound<'py, PyAny>> = |own, py| normal_law(py, &own.law);
        /// CoulombFriction, RegularisedFriction or None: The law of friction.
        friction: PyResult<Option<Bound<'py, PyAny>>> = |own, py| friction_law(py, &own.law);
        /// Resistance or None: The resistance to rolling and spinning.
        resistance: PyResult<Option<Bound<'py, Resistance>>> = |own, py| resistance_law(py, &own.law);
    }
}

#[pymethods]
impl LinkPair {
    #[new]
    #[pyo3(signature = (name, links, radii, law, *, centers=None, friction=None, resistance=None))]
    fn new(
        name: String,
        links: [String; 2],
        radii: [f64; 2],
        law: &Bound<'_, PyAny>,
        centers: Option<[Bound<'_, PyAny>; 2]>,
        friction: Option<&Bound<'_, PyAny>>,
        resistance: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        let center = |i: usize| vector_or("centers", centers.as_ref().map(|c| &c[i]), Vector3::zeros());
        let centers = [center(0)?, center(1)?];
        let law = laws(law, friction, resistance)?;
        let [first, second] = links;
        let [a, b] = [(first, centers[0], radii[0]), (second, centers[1], radii[1])];
        let pair = tree::LinkPair::try_new(name, a, b, law.clone())?;
        Ok(Self { pair, radii, centers, shapes: None, law })
    }

    /// A ball and a ball, a capsule or a box, or two capsules, fixed on two links.
    ///
    /// They touch at their nearest points. Where such a point passes from a face of a box to an edge, or to the end of a
    /// capsule, the second derivative of the gap jumps. The nearest points of two parallel capsules are not unique.
    /// The distance of a box from a capsule or a box is not smooth: such pairs are refused.
    ///
    /// Parameters
    /// ----------
    /// name : str
    ///     Name of the contact.
    /// links : tuple of str
    ///     The two bodies of the model.
    /// shapes : tuple of (str, array_like)
    ///     Each by its name, ``'sphere'``, ``'capsule'`` or ``'box'``, and its size, as of `shape_contacts`.
    /// law : CompliantLaw or HuntCrossley
    ///     Law of the normal force.
    /// positions : tuple of array_like, shape (3,), optional
    ///     Centres of the shapes, each in the frame of its link, m; the origins unless given.
    /// orientations : tuple of Rotation or array_like, shape (4,), optional
    ///     Rotations from the axes of the shapes to those of their links; none unless given.
    /// friction : CoulombFriction or RegularisedFriction, optional
    ///     Law of friction; none unless given.
    /// resistance : Resistance, optional
    ///     Resistance to rolling and spinning; none unless given.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import contact
    /// >>> shapes = (("capsule", (0.05, 0.4)), ("capsule", (0.06, 0.3)))
    /// >>> legs = contact.LinkPair.of_shapes("legs", ("left", "right"), shapes, contact.CompliantLaw(1e4))
    /// >>> legs.radii
    /// (0.05, 0.06)
    #[staticmethod]
    #[pyo3(signature = (name, links, shapes, law, *, positions=None, orientations=None, friction=None, resistance=None))]
    fn of_shapes(
        name: String,
        links: [String; 2],
        shapes: [(String, Bound<'_, PyAny>); 2],
        law: &Bound<'_, PyAny>,
        positions: Option<[Bound<'_, PyAny>; 2]>,
        orientations: Option<[Bound<'_, PyAny>; 2]>,
        friction: Option<&Bound<'_, PyAny>>,
        resistance: Option<&Bound<'_, PyAny>>,
    ) -> Result<Self, Error> {
        let law = laws(law, friction, resistance)?;
        let given = |i: usize| {
            let (shape, size) = &shapes[i];
            let at = vector_or("positions", positions.as_ref().map(|all| &all[i]), Vector3::zeros())?;
            let turn = orientations.as_ref().map(|all| orientation("orientations", &all[i])).transpose()?;
            Ok::<_, Error>((shape_of(shape, size)?, (at, turn.unwrap_or_default())))
        };
        let [(a, at_a), (b, at_b)] = [given(0)?, given(1)?];
        let pair = tree::LinkPair::of_shapes(name, links, [(&a, at_a), (&b, at_b)], law.clone())?;
        let named = |i: usize, turn: UnitQuaternion<f64>| {
            let (shape, size) = &shapes[i];
            Ok::<_, Error>((shape.clone(), real_numbers("shapes", size)?, components(&turn)))
        };
        let radii = pair.shapes().map(Shape::radius);
        let shapes = Some([named(0, at_a.1)?, named(1, at_b.1)?]);
        Ok(Self { pair, radii, centers: [at_a.0, at_b.0], shapes, law })
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let [a, b] = self.pair.links().each_ref().map(|link| brief(link, 30));
        let name = brief(self.pair.name(), 30);
        let ([r, s], law) = (self.radii, brief(&normal_law_repr(py, &self.law)?, 60));
        Ok(format!("LinkPair({name:?}, ({a:?}, {b:?}), ({r:?}, {s:?}), {law})"))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (py, own) = (slf.py(), slf.get());
        let spheres = (own.name(), own.links(), own.radii(), own.centers(py), own.shapes.clone());
        let arguments = (spheres, parts(py, &own.law)?).into_pyobject(py)?;
        Ok((slf.get_type().getattr("_restore")?, arguments))
    }

    /// A pickled pair.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        py: Python<'_>,
        spheres: GivenPair<'_>,
        laws: GivenLaws<'_>,
    ) -> Result<Self, Error> {
        let (name, links, radii, centers, shapes) = spheres;
        let (law, friction, resistance) = (&laws.0, laws.1.as_ref(), laws.2.as_ref());
        let Some([a, b]) = shapes else {
            return Self::new(name, links, radii, law, Some(centers), friction, resistance);
        };
        let list = |numbers: &[f64]| row(py, numbers.to_vec()).map(Bound::into_any);
        let orientations = Some([list(&a.2)?, list(&b.2)?]);
        let shapes = [(a.0, list(&a.1)?), (b.0, list(&b.1)?)];
        Self::of_shapes(name, links, shapes, law, Some(centers), orientations, friction, resistance)
    }
}

/// A change in a contact of a tree: its beginning, its end, the change between sticking and sliding.
///
/// Examples
/// --------
/// >>> from somersault import contact, multibody
/// >>> leg = contact.hopping_leg()
/// >>> motion = multibody.integrate_tree(
/// ...     leg.model, leg.q, leg.v, (0.0, 0.2), torque=leg.torque, contacts=leg.contacts)
/// >>> touch = motion.events[0]
/// >>> touch.kind, touch.contact, touch.link, round(touch.t, 4)
/// ('touch_down', 'foot', 'shank', 0.034)
#[pyclass(frozen, module = "somersault.contact")]
pub(crate) struct LinkEvent {
    t: f64,
    kind: String,
    contact: String,
    link: String,
    impulse: f64,
    q: Py<PyAny>,
    v: Py<PyAny>,
    point: Py<PyAny>,
    force: Py<PyAny>,
    sliding: Py<PyAny>,
}

value! {
    impl LinkEvent(t, kind, contact, link, impulse, q, v, point, force, sliding) {
        /// float: When, s.
        t: f64 = |own| own.t;
        /// str: What happened: ``'touch_down'``, ``'release'``, ``'re_engagement'``, where a point that was
        /// released below the surface is held again, ``'stick'`` or ``'slip'``.
        kind: &str = |own| &own.kind;
        /// str: Name of the contact.
        contact: &str = |own| &own.contact;
        /// str: The link, or the first of two.
        link: &str = |own| &own.link;
        /// float: Impulse of the normal force that a release completes, ∫ F dt, N s, to order 4; 0 for the others.
        impulse: f64 = |own| own.impulse;
        /// ndarray, shape (n_positions,): Configuration.
        q: Py<PyAny> = |own, py| own.q.clone_ref(py);
        /// ndarray, shape (n_velocities,): Velocity.
        v: Py<PyAny> = |own, py| own.v.clone_ref(py);
        /// ndarray, shape (3,): The point of contact, world frame, m.
        point: Py<PyAny> = |own, py| own.point.clone_ref(py);
        /// ndarray, shape (3,): Force on the link, world frame, N: that after a touch-down, zero at a release.
        force: Py<PyAny> = |own, py| own.force.clone_ref(py);
        /// ndarray, shape (3,): Velocity along the surface, or relative to the second link, world frame, m/s.
        sliding: Py<PyAny> = |own, py| own.sliding.clone_ref(py);
    }
}

#[pymethods]
impl LinkEvent {
    #[new]
    fn new(
        t: f64,
        kind: String,
        contact: String,
        link: String,
        impulse: f64,
        q: Py<PyAny>,
        v: Py<PyAny>,
        point: Py<PyAny>,
        force: Py<PyAny>,
        sliding: Py<PyAny>,
    ) -> Self {
        Self { t, kind, contact, link, impulse, q, v, point, force, sliding }
    }

    fn __repr__(&self) -> String {
        format!("<LinkEvent: {} of {:?} at t = {}>", self.kind, brief(&self.contact, 30), self.t)
    }
}

/// What contacts of a tree did during a run: one row for each state recorded.
pub(crate) struct TreeTouches {
    pub(crate) contacts: Py<PyAny>,
    pub(crate) events: Vec<Py<LinkEvent>>,
    /// Events, steps tried for them, and parts of divided steps.
    pub(crate) counts: (u64, u64, u64),
    pub(crate) stretches: Py<PyAny>,
    pub(crate) touches: Touches,
}

/// As a file has it.
pub(crate) type PickledTouches = (Py<PyAny>, Vec<Py<LinkEvent>>, (u64, u64, u64), [Py<PyAny>; 4], Py<PyAny>);

impl TreeTouches {
    pub(crate) fn pickled(&self, py: Python<'_>) -> PickledTouches {
        let Self { contacts, events, counts, stretches, touches } = self;
        let Touches { forces, points, gaps, elastic_energy } = touches;
        let arrays = [stretches, forces, points, gaps].map(|array| array.clone_ref(py));
        let events = events.iter().map(|event| event.clone_ref(py)).collect();
        (contacts.clone_ref(py), events, *counts, arrays, elastic_energy.clone_ref(py))
    }

    pub(crate) fn of_pickled(pickled: PickledTouches) -> Self {
        let (contacts, events, counts, [stretches, forces, points, gaps], elastic_energy) = pickled;
        let touches = Touches { forces, points, gaps, elastic_energy };
        Self { contacts, events, counts, stretches, touches }
    }

    /// Of the states and events of a run.
    pub(crate) fn of<F: TreeForces, D: JointDrive>(
        py: Python<'_>,
        system: &TreeInContact<'_, F, D>,
        given: &TreeContactList,
        states: &[TouchingState],
        events: &[events::Event<Augmented<Coordinates>, EventKind>],
        counts: (u64, u64, u64),
    ) -> Result<Self, Error> {
        let (n, count) = (states.len(), system.contacts().len());
        let stretches = states.iter().flat_map(|x| x.variables().iter().flatten().copied()).collect();
        let listed = events.iter().map(|event| Self::event(py, system, event));
        Ok(Self {
            contacts: given.listed(py)?,
            events: listed.collect::<Result<_, _>>()?,
            counts,
            stretches: array(py, stretches, &[n, count, 3])?.into_any().unbind(),
            touches: Touches::of(
                py,
                count,
                states.iter().map(|x| (system.touches(x), system.ledger(x).elastic)),
            )?,
        })
    }

    /// An event, with what its contact did.
    pub(crate) fn event<F: TreeForces, D: JointDrive>(
        py: Python<'_>,
        system: &TreeInContact<'_, F, D>,
        event: &events::Event<Augmented<Coordinates>, EventKind>,
    ) -> Result<Py<LinkEvent>, Error> {
        let (model, contacts) = (system.model(), system.contacts());
        let i = contacts.of_guard(event.guard);
        let (link, _) = contacts.links(i)?;
        let base = event.state.base();
        let mut v = vec![0.0; model.n_velocities()];
        model.joint_velocities(&base, &mut v)?;
        let touches = system.touches(&event.state);
        let of = |part: fn(&ContactState) -> Vector3<f64>| {
            vector_array(py, &touches.get(i).map_or_else(Vector3::zeros, part)).unbind()
        };
        let numbers =
            |numbers: &[f64]| -> PyResult<Py<PyAny>> { Ok(row(py, numbers.to_vec())?.into_any().unbind()) };
        let found = LinkEvent {
            t: event.t,
            kind: event.kind.name().to_owned(),
            contact: contacts.names()[i].clone(),
            link: model.name(link).unwrap_or_default().to_owned(),
            impulse: event.impulse,
            q: numbers(base.configuration.as_slice())?,
            v: numbers(&v)?,
            point: of(|touch| touch.point),
            force: of(|touch| touch.force),
            sliding: of(|touch| touch.sliding),
        };
        Ok(Py::new(py, found)?)
    }
}

/// Contacts as they were given.
#[derive(Default)]
pub(crate) struct TreeContactList {
    on_surfaces: Vec<Py<LinkContact>>,
    pairs: Vec<Py<LinkPair>>,
}

impl TreeContactList {
    /// One contact, or a sequence of them.
    pub(crate) fn extract(argument: &str, value: &Bound<'_, PyAny>) -> Result<Self, Error> {
        let mut found = Self { on_surfaces: Vec::new(), pairs: Vec::new() };
        let mut add = |entry: &Bound<'_, PyAny>| {
            if let Ok(contact) = entry.cast::<LinkContact>() {
                found.on_surfaces.push(contact.clone().unbind());
            } else if let Ok(pair) = entry.cast::<LinkPair>() {
                found.pairs.push(pair.clone().unbind());
            } else {
                let wrong = a_type(entry);
                return Err(Error::input(format!(
                    "`{argument}` must hold objects of LinkContact and LinkPair, found {wrong}"
                )));
            }
            Ok(())
        };
        match sequence(value) {
            Some(list) => list.try_iter()?.try_for_each(|entry| add(&entry?))?,
            None => add(value)?,
        }
        Ok(found)
    }

    /// Those with surfaces, then the pairs.
    pub(crate) fn listed(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let contacts = self.on_surfaces.iter().map(|contact| contact.clone_ref(py).into_any());
        let all = contacts.chain(self.pairs.iter().map(|pair| pair.clone_ref(py).into_any()));
        Ok(all.collect::<Vec<_>>().into_pyobject(py)?.into_any().unbind())
    }

    /// Whether a surface is a callable.
    pub(crate) fn calls_python(&self, py: Python<'_>) -> bool {
        self.on_surfaces.iter().any(|contact| !contact.get().contact.get().is_built_in(py))
    }

    /// A tree with them, for a run in which `failure` collects what Python code raises.
    pub(crate) fn on<'m, F: TreeForces, D: JointDrive>(
        &self,
        py: Python<'_>,
        tree: TreeSystem<'m, F, D>,
        failure: &Failure,
    ) -> Result<TreeInContact<'m, F, D>, Error> {
        let contact = |own: &Py<LinkContact>| {
            let LinkContact { name, link, contact, on } = own.get();
            let contact = contact.get().contact(py, failure);
            let contact = tree::LinkContact::new(name.clone(), link.clone(), contact);
            on.iter().fold(contact, |contact, base| contact.on(base))
        };
        let on_surfaces = self.on_surfaces.iter().map(contact).collect();
        let pairs = self.pairs.iter().map(|pair| pair.get().pair.clone()).collect();
        Ok(TreeInContact::try_new(tree, on_surfaces, pairs)?)
    }
}

/// The number of a contact that an argument names.
pub(crate) fn contact_named(argument: &str, name: &str, names: &[String]) -> Result<usize, Error> {
    names.iter().position(|known| known == name).ok_or_else(|| {
        let (names, found) = (few(names), brief(name, 40));
        Error::input(format!("`{argument}` must name one of the contacts {names}, found '{found}'"))
    })
}

/// A state with the stretches that an argument asks for.
pub(crate) fn stretched<F: TreeForces, D: JointDrive>(
    system: &TreeInContact<'_, F, D>,
    stretches: Option<&Bound<'_, PyAny>>,
    t: f64,
    x: multibody::motion::TreeState,
) -> Result<TouchingState, Error> {
    let Some(given) = stretches else { return Ok(system.unstretched(x)) };
    if given.extract::<&str>().is_ok_and(|word| word == "loaded") {
        return Ok(system.loaded(t, x)?);
    }
    let values = with_shape("stretches", &[system.contacts().len(), 3], given)?;
    let stretches = values.chunks_exact(3).map(Vector3::from_column_slice).collect();
    Ok(system.stretched(x, stretches)?)
}

/// The contacts of a tree, and what they do in a state.
///
/// `multibody.integrate_tree` takes the same contacts for a motion.
///
/// Parameters
/// ----------
/// model : Model
///     The tree.
/// contacts : LinkContact, LinkPair or sequence of them
///     Its contacts. Wherever contacts are counted those with surfaces come first, then the pairs.
///
/// Examples
/// --------
/// >>> from somersault import contact
/// >>> leg = contact.hopping_leg()
/// >>> feet = contact.TreeContacts(leg.model, leg.contacts)
/// >>> feet.names
/// ['foot']
#[pyclass(frozen, module = "somersault.contact")]
pub(crate) struct TreeContacts {
    model: Py<Model>,
    given: TreeContactList,
    names: Vec<String>,
}

value! {
    impl TreeContacts {
        /// Model: The tree.
        model: Py<Model> = |own, py| own.model.clone_ref(py);
        /// list of LinkContact and LinkPair: The contacts.
        contacts: PyResult<Py<PyAny>> = |own, py| own.given.listed(py);
        /// list of str: Names of the contacts.
        names: Vec<String> = |own| own.names.clone();
    }
}

impl TreeContacts {
    /// Shows the tree with its contacts in a state.
    fn with<R>(
        &self,
        py: Python<'_>,
        (q, v): (&Bound<'_, PyAny>, Option<&Bound<'_, PyAny>>),
        stretches: Option<&Bound<'_, PyAny>>,
        see: impl FnOnce(&TreeInContact<'_>, &TouchingState) -> Result<R, Error>,
    ) -> Result<R, Error> {
        let (model, failure) = (&self.model.get().model, Failure::default());
        let q = finite_all("q", with_shape("q", &[model.n_positions()], q)?)?;
        let v = match v {
            Some(v) => finite_all("v", with_shape("v", &[model.n_velocities()], v)?)?,
            None => vec![0.0; model.n_velocities()],
        };
        let system = self.given.on(py, TreeSystem::new(model, ()), &failure)?;
        let x = stretched(&system, stretches, 0.0, model.state(&q, &v)?)?;
        let found = see(&system, &x);
        match failure.get() {
            Some(error) => Err(error.clone_ref(py).into()),
            None => found,
        }
    }

    fn vectors<'py>(
        py: Python<'py>,
        touches: &[ContactState],
        of: impl Fn(&ContactState) -> Vector3<f64>,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let numbers = touches.iter().flat_map(|touch| <[f64; 3]>::from(of(touch))).collect();
        array(py, numbers, &[touches.len(), 3])
    }
}

#[pymethods]
impl TreeContacts {
    #[new]
    fn new(py: Python<'_>, model: Py<Model>, contacts: &Bound<'_, PyAny>) -> Result<Self, Error> {
        let given = TreeContactList::extract("contacts", contacts)?;
        let tree = TreeSystem::new(&model.get().model, ());
        let names = given.on(py, tree, &Failure::default())?.contacts().names().to_vec();
        Ok(Self { model, given, names })
    }

    /// Forces on the links, world frame; on the first link of a pair.
    ///
    /// Parameters
    /// ----------
    /// q, v : array_like, shape (n_positions,) and (n_velocities,)
    ///     Configuration and velocity.
    /// stretches : {'loaded'} or array_like, shape (contacts, 3), optional
    ///     Stretches of friction, m, world frame; unstretched unless given.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (contacts, 3)
    ///     N; zero of open contacts.
    ///
    /// Examples
    /// --------
    /// A foot 1 cm deep in ground of 20 kN/m:
    ///
    /// >>> import numpy as np
    /// >>> from somersault import contact
    /// >>> leg = contact.hopping_leg()
    /// >>> feet = contact.TreeContacts(leg.model, leg.contacts)
    /// >>> feet.forces((0, 0.64, 0, 0, 0), np.zeros(5)).round(6)
    /// array([[  0.,   0., 200.]])
    #[pyo3(signature = (q, v, stretches=None))]
    fn forces<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        stretches: Option<&Bound<'py, PyAny>>,
    ) -> Result<Bound<'py, PyArrayDyn<f64>>, Error> {
        self.with(py, (q, Some(v)), stretches, |system, x| {
            Ok(Self::vectors(py, &system.touches(x), |touch| touch.force)?)
        })
    }

    /// Points of contact, world frame.
    ///
    /// Parameters
    /// ----------
    /// q : array_like, shape (n_positions,)
    ///     Configuration.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (contacts, 3)
    ///     m.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import contact
    /// >>> leg = contact.hopping_leg()
    /// >>> feet = contact.TreeContacts(leg.model, leg.contacts)
    /// >>> feet.points((1.0, 0.75, 0, 0, 0)).round(6)
    /// array([[1. , 0. , 0.1]])
    fn points<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
    ) -> Result<Bound<'py, PyArrayDyn<f64>>, Error> {
        self.with(py, (q, None), None, |system, x| {
            Ok(Self::vectors(py, &system.touches(x), |touch| touch.point)?)
        })
    }

    /// Gaps and their rates.
    ///
    /// Parameters
    /// ----------
    /// q, v : array_like, shape (n_positions,) and (n_velocities,)
    ///     Configuration and velocity.
    ///
    /// Returns
    /// -------
    /// gaps, rates : ndarray, shape (contacts,)
    ///     m, negative inside the surface, and m/s.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import contact
    /// >>> leg = contact.hopping_leg()
    /// >>> feet = contact.TreeContacts(leg.model, leg.contacts)
    /// >>> gaps, rates = feet.gaps((0, 0.75, 0, 0, 0), (0, -2.0, 0, 0, 0))
    /// >>> gaps.round(6), rates
    /// (array([0.1]), array([-2.]))
    fn gaps<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
    ) -> Result<(Bound<'py, PyAny>, Bound<'py, PyAny>), Error> {
        self.with(py, (q, Some(v)), None, |system, x| {
            let touches = system.touches(x);
            let numbers = |of: fn(&ContactState) -> f64| -> PyResult<_> {
                Ok(array(py, touches.iter().map(of).collect(), &[touches.len()])?.into_any())
            };
            Ok((numbers(|touch| touch.gap)?, numbers(|touch| touch.rate)?))
        })
    }

    /// Jacobian of a contact: with the velocities of the joints it gives that of the link at the point of contact,
    /// relative to that of the second link of a pair, world axes.
    ///
    /// Parameters
    /// ----------
    /// q : array_like, shape (n_positions,)
    ///     Configuration.
    /// contact : str
    ///     Name of the contact.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (3, n_velocities)
    ///
    /// Examples
    /// --------
    /// Joint forces that hold a push of 100 N on the foot:
    ///
    /// >>> from somersault import contact
    /// >>> leg = contact.hopping_leg()
    /// >>> feet = contact.TreeContacts(leg.model, leg.contacts)
    /// >>> jacobian = feet.jacobian((0, 0.5, 0, 0.6, -1.2), "foot")
    /// >>> (jacobian.T @ (0, 0, 100.0)).round(2)
    /// array([  0.  , 100.  ,   0.  ,   0.  , -16.94])
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        contact: &str,
    ) -> Result<Bound<'py, PyArrayDyn<f64>>, Error> {
        let i = contact_named("contact", contact, &self.names)?;
        self.with(py, (q, None), None, |system, x| {
            let found = system.contact_jacobian(i, x)?;
            let mut numbers = vec![0.0; found.len()];
            write(&found, &mut numbers);
            Ok(array(py, numbers, &[found.nrows(), found.ncols()])?)
        })
    }

    /// How stiff the contacts are that touch in a state: an upper bound of |λ| of the springs and dampers of contacts and friction
    /// with the masses that they move.
    ///
    /// With k and c over the effective mass 1/(n J M⁻¹ Jᵀ n) it is √(k/m) where the contact oscillates, c/m where it is damped
    /// beyond that. Explicit methods are stable for steps of up to about 2.8 over it; `rkmk5` and `rkmk8` with ``rtol`` take no longer
    /// ones, and a fixed ``dt`` is divided. Where that makes many steps, take ``method='radau5'``, which needs none.
    ///
    /// Parameters
    /// ----------
    /// q, v : array_like, shape (n_positions,) and (n_velocities,)
    ///     Configuration and velocity.
    /// stretches : {'loaded'} or array_like, shape (contacts, 3), optional
    ///     Stretches of friction, m, world frame; unstretched unless given.
    ///
    /// Returns
    /// -------
    /// float
    ///     1/s; zero where nothing touches.
    ///
    /// Examples
    /// --------
    /// The foot of the leg, with 150 N s/m on a shank of 0.5 kg:
    ///
    /// >>> import numpy as np
    /// >>> from somersault import contact
    /// >>> leg = contact.hopping_leg()
    /// >>> feet = contact.TreeContacts(leg.model, leg.contacts)
    /// >>> rate = feet.stiffest_rate((0, 0.5, 0, 0.6, -1.2), np.zeros(5))
    /// >>> round(2.8 / rate, 4)
    /// 0.0029
    #[pyo3(signature = (q, v, stretches=None))]
    fn stiffest_rate<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        stretches: Option<&Bound<'py, PyAny>>,
    ) -> Result<f64, Error> {
        self.with(py, (q, Some(v)), stretches, |system, x| Ok(system.stiffest_rate(&system.mode(0.0, x), x)))
    }

    /// Kinetic energy, potential energy of the weight, and energy of the springs of contacts and friction.
    ///
    /// Parameters
    /// ----------
    /// q, v : array_like, shape (n_positions,) and (n_velocities,)
    ///     Configuration and velocity.
    /// stretches : {'loaded'} or array_like, shape (contacts, 3), optional
    ///     Stretches of friction, m, world frame; unstretched unless given.
    ///
    /// Returns
    /// -------
    /// kinetic, potential, elastic : float
    ///     J. Without torques their sum never grows, and what it loses is dissipated.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import contact
    /// >>> leg = contact.hopping_leg()
    /// >>> feet = contact.TreeContacts(leg.model, leg.contacts)
    /// >>> kinetic, potential, elastic = feet.energies((0, 0.64, 0, 0, 0), (2.0, 0, 0, 0, 0))
    /// >>> round(kinetic, 6), round(elastic, 6)
    /// (13.0, 1.0)
    #[pyo3(signature = (q, v, stretches=None))]
    fn energies<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        stretches: Option<&Bound<'py, PyAny>>,
    ) -> Result<(f64, f64, f64), Error> {
        self.with(py, (q, Some(v)), stretches, |system, x| {
            let ledger = system.ledger(x);
            Ok((ledger.kinetic, ledger.potential, ledger.elastic))
        })
    }

    /// Momentum of the tree, and its rate by weight and by contacts with surfaces that stand in the world.
    ///
    /// With a free base, and where no other forces act on links, this is the rate along the motion; other joints to the world
    /// add their reactions.
    ///
    /// Parameters
    /// ----------
    /// q, v : array_like, shape (n_positions,) and (n_velocities,)
    ///     Configuration and velocity.
    /// stretches : {'loaded'} or array_like, shape (contacts, 3), optional
    ///     Stretches of friction, m, world frame; unstretched unless given.
    ///
    /// Returns
    /// -------
    /// momentum, rate : ndarray, shape (2, 3)
    ///     The momentum, kg m/s, above the angular momentum about the centre of mass, kg m²/s, world frame,
    ///     and their rates, N and N m.
    ///
    /// Examples
    /// --------
    /// A leg of 6.5 kg in flight:
    ///
    /// >>> from somersault import contact
    /// >>> leg = contact.hopping_leg()
    /// >>> feet = contact.TreeContacts(leg.model, leg.contacts)
    /// >>> momentum, rate = feet.momentum_balance((0, 0.75, 0, 0, 0), (2.0, 0, 0, 0, 0))
    /// >>> momentum[0].round(6), rate[0].round(6)
    /// (array([13.,  0.,  0.]), array([  0.   ,   0.   , -63.765]))
    #[pyo3(signature = (q, v, stretches=None))]
    fn momentum_balance<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        stretches: Option<&Bound<'py, PyAny>>,
    ) -> Result<(Bound<'py, PyAny>, Bound<'py, PyAny>), Error> {
        self.with(py, (q, Some(v)), stretches, |system, x| {
            let MomentumLedger { linear, angular, weight, force, moment } = system.momentum(x)?;
            let rows = |first: Vector3<f64>, second: Vector3<f64>| -> PyResult<_> {
                Ok(array(py, [<[f64; 3]>::from(first), second.into()].concat(), &[2, 3])?.into_any())
            };
            Ok((rows(linear, angular)?, rows(weight + force, moment)?))
        })
    }

    /// Joint forces that accelerate the tree by a given acceleration: M(q) a + C(q, v) v + g(q) − Σ Jᵢᵀ Fᵢ.
    ///
    /// The forces of the contacts are those of their laws, or forces that were measured.
    ///
    /// Parameters
    /// ----------
    /// q, v : array_like, shape (n_positions,) and (n_velocities,)
    ///     Configuration and velocity.
    /// a : array_like, shape (n_velocities,)
    ///     Rates of the velocities.
    /// stretches : {'loaded'} or array_like, shape (contacts, 3), optional
    ///     Stretches of friction, m, world frame; unstretched unless given.
    /// measured : array_like, shape (contacts, 3), optional
    ///     Forces on the links at the points of contact, on the first link of a pair, world frame, N, in place of
    ///     those of the laws. Forces at other points are `wrenches` of `Model.inverse_dynamics`.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_velocities,)
    ///     N m, and N of joints that slide. Forces in the joint of a free base are residuals: with contact forces that fit the
    ///     motion they are zero.
    ///
    /// Examples
    /// --------
    /// A straight leg that stands on 63.765 N needs no joint forces:
    ///
    /// >>> import numpy as np
    /// >>> from somersault import contact
    /// >>> leg = contact.hopping_leg()
    /// >>> feet = contact.TreeContacts(leg.model, leg.contacts)
    /// >>> pose, still = (0, 0.65, 0, 0, 0), np.zeros(5)
    /// >>> feet.inverse_dynamics(pose, still, still, measured=[(0, 0, 6.5 * 9.81)]).round(9) + 0.0
    /// array([0., 0., 0., 0., 0.])
    #[pyo3(signature = (q, v, a, stretches=None, measured=None))]
    fn inverse_dynamics<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        a: &Bound<'py, PyAny>,
        stretches: Option<&Bound<'py, PyAny>>,
        measured: Option<&Bound<'py, PyAny>>,
    ) -> Result<Bound<'py, PyArrayDyn<f64>>, Error> {
        let n = self.model.get().model.n_velocities();
        let a = finite_all("a", with_shape("a", &[n], a)?)?;
        let forces = measured
            .map(|given| finite_all("measured", with_shape("measured", &[self.names.len(), 3], given)?))
            .transpose()?
            .map(|numbers| numbers.chunks_exact(3).map(Vector3::from_column_slice).collect::<Vec<_>>());
        self.with(py, (q, Some(v)), stretches, |system, x| {
            Ok(array(py, system.inverse_dynamics(0.0, x, &a, forces.as_deref())?, &[n])?)
        })
    }

    /// A static equilibrium near a configuration, by Newton's method. Its stability is not examined.
    ///
    /// Parameters
    /// ----------
    /// q : array_like, shape (n_positions,)
    ///     Initial guess, in which something touches.
    /// torque : array_like, shape (n_velocities,), or callable, optional
    ///     Joint forces, or ``f(t, q, v)`` that returns them, which is called at t = 0 and rest; none unless given.
    ///
    /// Returns
    /// -------
    /// q : ndarray, shape (n_positions,)
    ///     The pose, or the best iterate.
    /// stretches : ndarray, shape (contacts, 3)
    ///     Stretches of friction that hold it, m.
    /// success : bool
    ///     Whether it is at rest to rounding and friction holds it. Friction forces of several contacts are not unique, and one
    ///     division of the load is tried: near the angle of friction another may hold the pose.
    ///
    /// Examples
    /// --------
    /// The leg with straight joints stands upright, its foot 3.19 mm deep:
    ///
    /// >>> from somersault import contact
    /// >>> leg = contact.hopping_leg()
    /// >>> feet = contact.TreeContacts(leg.model, leg.contacts)
    /// >>> q, stretches, success = feet.equilibrium((0, 0.649, 0, 0, 0))
    /// >>> success, round(0.65 - float(q[1]), 5)
    /// (True, 0.00319)
    #[pyo3(signature = (q, torque=None))]
    fn equilibrium<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'py, PyAny>,
        torque: Option<&Bound<'py, PyAny>>,
    ) -> Result<(Bound<'py, PyAny>, Bound<'py, PyAny>, bool), Error> {
        let (model, failure) = (&self.model.get().model, Failure::default());
        let n = model.n_velocities();
        let q = finite_all("q", with_shape("q", &[model.n_positions()], q)?)?;
        let torque = Given::extract("torque", n, torque, &failure)?;
        let system = self.given.on(py, TreeSystem::new(model, &torque), &failure)?;
        let found = system.equilibrium(0.0, &q);
        if let Some(error) = failure.get() {
            return Err(error.clone_ref(py).into());
        }
        let tree::Equilibrium { state, is_held, .. } = found?;
        let pose = state.configuration.0.as_slice().to_vec();
        let stretches: Vec<f64> = state.rate.variables.iter().flat_map(|x| <[f64; 3]>::from(*x)).collect();
        let count = stretches.len() / 3;
        let pose = array(py, pose, &[model.n_positions()])?.into_any();
        Ok((pose, array(py, stretches, &[count, 3])?.into_any(), is_held))
    }

    fn __len__(&self) -> usize {
        self.names.len()
    }

    fn __repr__(&self) -> String {
        let contacts = counted(self.names.len(), "contact", "contacts");
        let names: Vec<String> = self.names.iter().map(|name| brief(name, 30)).collect();
        format!("<TreeContacts: {contacts}: {}>", few(&names))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let (py, own) = (slf.py(), slf.get());
        by_class(slf, (own.model(py), own.given.listed(py)?))
    }
}
