//! The immutable description of a tree.

use crate::coupling::{Coupling, Source, sources};
use crate::error::{DynamicsError, ModelError};
use crate::inertia::SpatialInertia;
use crate::joint::{Joint, Mechanism};
use crate::link::Link;
use crate::mimic::Mimic;
use crate::spatial::{Direction, Motion, Transform};
use nalgebra::Vector3;
use somersault_core::argument::{expect_length, expect_range};
use somersault_core::scalar::{Lift, Scalar};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// One body as the algorithms see it.
#[derive(Debug, Clone)]
pub(crate) struct Body<T> {
    /// Number of the parent; the root has none.
    pub(crate) parent: Option<usize>,
    pub(crate) mechanism: Mechanism<T>,
    pub(crate) inertia: SpatialInertia<T>,
    /// First number in q_t.
    pub(crate) q: usize,
    /// Degrees of freedom of the joint in v_t.
    pub(crate) dofs: Range<usize>,
}

/// Where a joint has its numbers in q and in v; nowhere if it follows another.
#[derive(Debug, Clone)]
pub(crate) struct Place {
    pub(crate) q: Range<usize>,
    pub(crate) dofs: Range<usize>,
}

/// A tree of rigid bodies: bodies are numbered so that a parent comes before its children.
///
/// Immutable; what an algorithm writes goes to a [`Data`](crate::Data). Joints may follow others ([`Mimic`]); q and v have the numbers
/// of those that follow none.
#[derive(Debug, Clone)]
pub struct Model<T = f64> {
    links: Arc<[Link]>,
    pub(crate) standard_gravity: Vector3<f64>,
    pub(crate) gravity: Vector3<T>,
    pub(crate) bodies: Vec<Body<T>>,
    pub(crate) places: Vec<Place>,
    /// Where the numbers of each joint come from.
    sources: Arc<[Source]>,
    /// Where joints follow others.
    pub(crate) coupling: Option<Coupling<T>>,
    /// The columns of all motion subspaces, in body axes.
    pub(crate) directions: Vec<Direction<T>>,
    /// Viscous friction of each degree of freedom.
    pub(crate) damping: Vec<T>,
    /// The degree of freedom before each one on the way to the root (Featherstone's λ, expanded).
    pub(crate) dof_parent: Vec<Option<usize>>,
    n_positions: usize,
    n_velocities: usize,
}

impl Model {
    pub(crate) fn from_links(links: Vec<Link>, gravity: Vector3<f64>) -> Result<Self, ModelError> {
        let sources = sources(&links)?;
        Ok(Self::compile(links.into(), sources.into(), gravity))
    }

    /// The same tree with bodies of other sizes, whose masses it keeps: body i is `scales[i]` times as long along each of its axes.
    ///
    /// With S_i = diag(`scales[i]`), joints that a body carries, and its centre of mass, go from p to S_i p; the second moments Σ of
    /// its mass about its centre to S_i Σ S_i. Where the joint of the root is in the world, coordinates of prismatic joints
    /// and all limits stay. Each number must be from 0.01 to 100.
    ///
    /// ```
    /// use nalgebra::Vector3;
    /// use somersault_multibody::models::Diver;
    ///
    /// let model = Diver::spatial().model()?;
    /// let mut scales = vec![Vector3::repeat(1.0); model.n_bodies()];
    /// scales[model.body("right_thigh")?].z = 1.1;
    /// let longer = model.scaled(&scales)?;
    /// let length = |of: &somersault_multibody::Model| of.links()[of.body("right_shank").unwrap()].origin().norm();
    /// assert!((length(&longer) / length(&model) - 1.1).abs() < 1e-12 && longer.mass() == model.mass());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn scaled(&self, scales: &[Vector3<f64>]) -> Result<Self, ModelError> {
        expect_length("scales", scales.len(), self.n_bodies())?;
        for scale in scales.iter().flatten() {
            expect_range("scales", *scale, "from 0.01 to 100", |x| (0.01..=100.0).contains(&x))?;
        }
        let link = |(i, link): (usize, &Link)| {
            let mut link = link.clone();
            link.mass = link.mass.scaled(&scales[i]);
            if let Some(parent) = self.bodies[i].parent {
                link.origin.component_mul_assign(&scales[parent]);
            }
            link.validate()
        };
        let links = self.links.iter().enumerate().map(link).collect::<Result<_, _>>()?;
        Self::from_links(links, self.standard_gravity)
    }
}

impl<T: Scalar> Model<T> {
    fn compile(links: Arc<[Link]>, sources: Arc<[Source]>, standard_gravity: Vector3<f64>) -> Self {
        let mut bodies: Vec<Body<T>> = Vec::with_capacity(links.len());
        let (mut directions, mut damping, mut dof_parent) = (Vec::new(), Vec::new(), Vec::new());
        // the last degree of freedom on the way from the root to each body
        let mut last_dof: Vec<Option<usize>> = Vec::with_capacity(links.len());
        let numbers: HashMap<&str, usize> =
            links.iter().enumerate().map(|(i, link)| (link.name.as_str(), i)).collect();
        let mut q = 0;
        for link in links.iter() {
            let parent = link.parent.as_deref().and_then(|p| numbers.get(p).copied());
            let first = directions.len();
            directions.extend((0..link.joint.n_velocities()).map(|k| link.joint.direction::<T>(k)));
            let dofs = first..directions.len();
            let mut last = parent.and_then(|p| last_dof[p]);
            for k in dofs.clone() {
                dof_parent.push(last);
                damping.push(nalgebra::convert(link.damping));
                last = Some(k);
            }
            last_dof.push(last);
            let placement = link.placement();
            let placement = Transform::new(
                nalgebra::convert(placement.rotation),
                nalgebra::convert(placement.translation),
            );
            bodies.push(Body {
                parent,
                mechanism: Mechanism::new(&link.joint, placement),
                inertia: SpatialInertia::new(
                    nalgebra::convert(link.mass.mass),
                    &nalgebra::convert(link.mass.center),
                    &nalgebra::convert(link.mass.inertia),
                ),
                q,
                dofs,
            });
            q += link.joint.n_positions();
        }
        let (mut q, mut v) = (0, 0);
        let place = |link: &Link| {
            let leads = usize::from(link.mimic.is_none());
            let (n_q, n_v) = (link.joint.n_positions() * leads, link.joint.n_velocities() * leads);
            (q, v) = (q + n_q, v + n_v);
            Place { q: q - n_q..q, dofs: v - n_v..v }
        };
        let places = links.iter().map(place).collect();
        let sizes: Vec<_> = links.iter().map(|l| (l.joint.n_positions(), l.joint.n_velocities())).collect();
        let coupling = Coupling::new(&sources, &sizes, &dof_parent);
        Self {
            links,
            standard_gravity,
            gravity: nalgebra::convert(standard_gravity),
            bodies,
            places,
            sources,
            coupling,
            directions,
            damping,
            dof_parent,
            n_positions: q,
            n_velocities: v,
        }
    }

    /// The same tree over another scalar, say dual numbers.
    pub fn cast<U: Scalar>(&self) -> Model<U> {
        Model::compile(self.links.clone(), self.sources.clone(), self.standard_gravity)
    }

    /// The bodies with their joints as they were given, in the order of their numbers; axes and rotations of
    /// unit length.
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// The joints that have numbers in q and v, in their order.
    pub(crate) fn own_joints(&self) -> impl Iterator<Item = &Joint> {
        self.links.iter().filter(|link| link.mimic.is_none()).map(|link| &link.joint)
    }

    /// Number of bodies.
    pub fn n_bodies(&self) -> usize {
        self.bodies.len()
    }

    /// Numbers in q.
    pub fn n_positions(&self) -> usize {
        self.n_positions
    }

    /// Degrees of freedom: numbers in v, in accelerations and in joint forces.
    pub fn n_velocities(&self) -> usize {
        self.n_velocities
    }

    /// Gravitational acceleration in the world frame, m/s².
    pub fn gravity(&self) -> &Vector3<T> {
        &self.gravity
    }

    /// The number of the body of this name.
    pub fn body(&self, name: &str) -> Result<usize, DynamicsError> {
        let number = self.links.iter().position(|l| l.name == name);
        number.ok_or_else(|| DynamicsError::UnknownBody { name: name.to_owned() })
    }

    /// Name of body `i`, if there is one.
    pub fn name(&self, i: usize) -> Option<&str> {
        self.links.get(i).map(|l| l.name.as_str())
    }

    /// Number of the parent of body `i`; the root has none.
    pub fn parent(&self, i: usize) -> Option<usize> {
        self.bodies.get(i).and_then(|b| b.parent)
    }

    /// The joint that carries body `i`, axes of unit length.
    pub fn joint(&self, i: usize) -> Option<&Joint> {
        self.links.get(i).map(|l| &l.joint)
    }

    /// Pose of the joint frame of body `i` in its parent, or in the world for the root.
    pub fn placement(&self, i: usize) -> Option<Transform<f64>> {
        self.links.get(i).map(Link::placement)
    }

    /// Where the joint of body `i` has its numbers in q; empty if it follows another joint, and if there is no such body.
    pub fn positions_of(&self, i: usize) -> Range<usize> {
        self.places.get(i).map_or(0..0, |place| place.q.clone())
    }

    /// Where the joint of body `i` has a quaternion (x, y, z, w) in q; `None` if it has none or there is no such body.
    pub fn quaternion_of(&self, i: usize) -> Option<Range<usize>> {
        let (first, found) = (self.places.get(i)?.q.start, self.joint(i)?.kind().quaternion()?);
        Some(first + found.start..first + found.end)
    }

    /// Where the joint of body `i` has its numbers in v; empty if it follows another joint, and if there is no such body.
    pub fn velocities_of(&self, i: usize) -> Range<usize> {
        self.places.get(i).map_or(0..0, |place| place.dofs.clone())
    }

    /// The same, and of the joint that leads it for one that follows.
    pub(crate) fn leading_velocities_of(&self, i: usize) -> Range<usize> {
        self.sources.get(i).map_or(0..0, |source| self.velocities_of(source.body))
    }

    /// Which joint that of body `i` follows, if it follows any.
    pub fn mimic(&self, i: usize) -> Option<&Mimic> {
        self.links.get(i).and_then(|l| l.mimic.as_ref())
    }

    /// For each body the one whose joint moves its own, with the multiplier between them.
    pub(crate) fn sources(&self) -> &[Source] {
        &self.sources
    }

    /// Lower and upper limit of the joint of body `i`, if it was given any.
    pub fn limits(&self, i: usize) -> Option<[f64; 2]> {
        self.links.get(i).and_then(|l| l.limits)
    }

    /// Spatial inertia of body `i` in body axes about its origin.
    pub fn inertia(&self, i: usize) -> Option<&SpatialInertia<T>> {
        self.bodies.get(i).map(|b| &b.inertia)
    }

    /// Mass of all bodies together, kg.
    pub fn mass(&self) -> T {
        self.bodies.iter().fold(T::zero(), |sum, b| sum + b.inertia.mass)
    }

    /// S v: the velocity of body `i` relative to its parent, in body axes.
    #[inline(always)]
    pub(crate) fn relative(&self, body: &Body<T>, v: &[T]) -> Motion<T> {
        self.relative_in((), body, v)
    }

    /// The same of the numbers of the joint alone.
    #[inline(always)]
    pub(crate) fn own_motion(&self, body: &Body<T>, v: &[T]) -> Motion<T> {
        self.own_motion_in((), body, v)
    }

    /// [`relative`](Self::relative) in other arithmetic.
    #[inline(always)]
    pub(crate) fn relative_in<N: Lift<T>>(&self, proof: N::Proof, body: &Body<T>, v: &[N]) -> Motion<N> {
        self.own_motion_in(proof, body, &v[body.dofs.clone()])
    }

    #[inline(always)]
    fn own_motion_in<N: Lift<T>>(&self, proof: N::Proof, body: &Body<T>, v: &[N]) -> Motion<N> {
        let mut motion = Motion::zero().lift(proof);
        for (direction, &rate) in self.directions[body.dofs.clone()].iter().zip(v) {
            direction.lift(proof).add_to(&mut motion, rate);
        }
        motion
    }

    pub(crate) fn expect_body(&self, i: usize) -> Result<&Body<T>, DynamicsError> {
        // made only where it is returned: to drop an error costs more than to look up a body
        self.bodies.get(i).ok_or_else(|| DynamicsError::NoSuchBody { found: i, n_bodies: self.n_bodies() })
    }
}
