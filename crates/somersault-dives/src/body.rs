//! The shape of a diver: capsules, and which of them must keep apart.
//!
//! Radii are those of cylinders with a segment's length, mass and density, r = √(m/(π ρ l)); the axis ends a radius
//! before either end of the segment. What is shorter than it is thick is a sphere of the same volume about its centre
//! of mass. Masses and lengths are the diver's own ([`Diver`](somersault_multibody::models::Diver)); densities are those
//! of W. T. Dempster, *Space requirements of the seated operator*, WADC TR-55-159 (1955), as D. A. Winter gives them in
//! *Biomechanics and Motor Control of Human Movement*, Wiley 2005, Table 4.1; those of head and limbs were also compared
//! with the set "Dempster" of the package yeadon, which has them from M. R. Yeadon, J. Biomech. 23 (1990) 67–74.
//!
//! | Segment | ρ, kg/l | r, mm at 65 kg and 1.70 m |
//! |---|---|---|
//! | torso, pelvis | 1.03 | 120, sphere 119 |
//! | head | 1.11 | sphere 99 |
//! | thigh, shank, foot | 1.05, 1.09, 1.10 | 82, 44, sphere 55 |
//! | upper arm, forearm, hand | 1.07, 1.13, 1.16 | 44, 34, 24 |

use crate::capsule::{Capsule, nearest_points};
use nalgebra::Vector3;
use somersault_multibody::{DynamicsError, Model, Positions};
use std::f64::consts::PI;

/// Name, density in kg/m³, and the joint at the far end.
const SEGMENTS: [(&str, f64, End); 15] = {
    use End::{Joint, None, Span};
    [
        ("torso", 1030.0, Joint("head")),
        ("pelvis", 1030.0, None),
        ("head", 1110.0, None),
        ("right_thigh", 1050.0, Joint("right_shank")),
        ("right_shank", 1090.0, Joint("right_foot")),
        ("right_foot", 1100.0, None),
        ("left_thigh", 1050.0, Joint("left_shank")),
        ("left_shank", 1090.0, Joint("left_foot")),
        ("left_foot", 1100.0, None),
        ("right_upper_arm", 1070.0, Joint("right_forearm")),
        ("right_forearm", 1130.0, Joint("right_hand")),
        ("right_hand", 1160.0, Span(0.3624)),
        ("left_upper_arm", 1070.0, Joint("left_forearm")),
        ("left_forearm", 1130.0, Joint("left_hand")),
        ("left_hand", 1160.0, Span(0.3624)),
    ]
};

/// Where a segment ends.
enum End {
    /// At the joint of this body.
    Joint(&'static str),
    /// Its centre of mass lies at this fraction of its length (de Leva 1996, Table 4).
    Span(f64),
    /// It is a sphere.
    None,
}

/// Capsules of a tree and the pairs of them that must keep apart.
#[derive(Debug, Clone)]
pub struct Body {
    capsules: Vec<Capsule>,
    pairs: Vec<[usize; 2]>,
    /// For each body its hinges on the way to the root: body, degree of freedom after the root's, axis.
    hinges: Vec<Vec<(usize, usize, Vector3<f64>)>>,
}

impl Body {
    /// Of a spatial `diver`. Exempt are segments joined to each other, legs against legs and hands against legs.
    pub fn try_new(model: &Model) -> Result<Self, DynamicsError> {
        let mut capsules = Vec::with_capacity(SEGMENTS.len());
        for (name, density, end) in &SEGMENTS {
            let body = model.body(name)?;
            let inertia =
                model.inertia(body).ok_or(DynamicsError::NoSuchBody { found: body, n_bodies: 0 })?;
            let center = inertia.first_moment() / inertia.mass();
            let far = match end {
                End::Joint(child) => {
                    let placement = model.placement(model.body(child)?);
                    placement.map(|p| Vector3::new(0.0, 0.0, p.translation.z))
                }
                End::Span(fraction) => Some(center / *fraction),
                End::None => None,
            };
            let volume = inertia.mass() / density;
            capsules.push(match far {
                Some(far) => {
                    let length = far.norm();
                    let radius = (volume / (PI * length)).sqrt();
                    let inset = far * (radius / length).min(0.5);
                    Capsule { body, ends: [inset, far - inset], radius }
                }
                None => {
                    let radius = (volume * 3.0 / (4.0 * PI)).cbrt();
                    Capsule { body, ends: [center, center], radius }
                }
            });
        }
        let kind = |k: usize| SEGMENTS[k].0;
        let is_leg = |k: usize| ["thigh", "shank", "foot"].iter().any(|part| kind(k).ends_with(part));
        let is_hand = |k: usize| kind(k).ends_with("hand");
        let mut pairs = Vec::new();
        for i in 0..capsules.len() {
            for j in i + 1..capsules.len() {
                let exempt = is_joined(model, capsules[i].body, capsules[j].body)
                    || is_leg(i) && is_leg(j)
                    || is_hand(i) && is_leg(j)
                    || is_leg(i) && is_hand(j);
                if !exempt {
                    pairs.push([i, j]);
                }
            }
        }
        let hinges = (0..model.n_bodies()).map(|i| hinges_of(model, i)).collect();
        Ok(Self { capsules, pairs, hinges })
    }

    /// The capsules.
    pub fn capsules(&self) -> &[Capsule] {
        &self.capsules
    }

    /// The pairs that must keep apart, by the numbers of their capsules.
    pub fn pairs(&self) -> &[[usize; 2]] {
        &self.pairs
    }

    /// For each pair the sum of both radii, m.
    pub(crate) fn radii(&self) -> impl Iterator<Item = f64> {
        self.pairs.iter().map(|[i, j]| self.capsules[*i].radius + self.capsules[*j].radius)
    }

    /// Names of the segments of a pair.
    pub(crate) fn names(&self, pair: usize) -> [&'static str; 2] {
        self.pairs[pair].map(|capsule| SEGMENTS[capsule].0)
    }

    /// For each pair and each degree of freedom after the root's, one row for each pair, no less than what a radian of
    /// it changes the distance by, m/rad, in any configuration: the length of the chain from its hinge to the far end.
    pub(crate) fn reaches(&self, model: &Model) -> Vec<f64> {
        let n_root = model.velocities_of(0).len();
        let n = model.n_velocities() - n_root;
        let mut reaches = vec![0.0; self.pairs.len() * n];
        for (row, [i, j]) in reaches.chunks_exact_mut(n.max(1)).zip(&self.pairs) {
            let capsules = [&self.capsules[*i], &self.capsules[*j]];
            let hinges = capsules.map(|capsule| &self.hinges[capsule.body]);
            for (capsule, own, other) in
                [(capsules[0], hinges[0], hinges[1]), (capsules[1], hinges[1], hinges[0])]
            {
                let mut reach = capsule.ends.iter().map(|end| end.norm()).fold(0.0, f64::max);
                let mut at = Some(capsule.body);
                while let Some(body) = at {
                    // a hinge that transports both moves them as one
                    for (_, dof, _) in own.iter().filter(|(hinge, ..)| *hinge == body) {
                        if !other.iter().any(|(hinge, ..)| *hinge == body) {
                            row[*dof] += reach;
                        }
                    }
                    reach += model.placement(body).map_or(0.0, |placement| placement.translation.norm());
                    at = model.parent(body);
                }
            }
        }
        reaches
    }

    /// Distance of the surfaces of a pair, m; negative where they overlap.
    pub(crate) fn distance(&self, positions: &Positions<'_>, pair: usize) -> Result<f64, DynamicsError> {
        let [a, b] = self.pairs[pair].map(|capsule| &self.capsules[capsule]);
        let (pose_a, pose_b) = (positions.pose(a.body)?, positions.pose(b.body)?);
        let found = nearest_points(&a.ends.map(|e| pose_a.point(&e)), &b.ends.map(|e| pose_b.point(&e)), 0.0);
        Ok(found.distance - a.radius - b.radius)
    }

    /// Leaves out the pairs for which `keep` is false.
    pub fn retain_pairs(&mut self, mut keep: impl FnMut(usize) -> bool) {
        let mut k = 0;
        self.pairs.retain(|_| {
            k += 1;
            keep(k - 1)
        });
    }

    /// Distances of the surfaces of all pairs, m; negative where they overlap. With room for them, their gradients by
    /// the joints as well, one row of degrees of freedom after the root's for each pair.
    ///
    /// With a `preference` above 0 m they are the smooth ones of [`nearest_points`].
    pub fn distances(
        &self,
        positions: &Positions<'_>,
        preference: f64,
        distances: &mut [f64],
        mut gradients: Option<&mut [f64]>,
    ) -> Result<(), DynamicsError> {
        let n = gradients.as_ref().map_or(0, |g| g.len() / self.pairs.len().max(1));
        for (k, [i, j]) in self.pairs.iter().enumerate() {
            let (a, b) = (&self.capsules[*i], &self.capsules[*j]);
            let (pose_a, pose_b) = (positions.pose(a.body)?, positions.pose(b.body)?);
            let found = nearest_points(
                &a.ends.map(|e| pose_a.point(&e)),
                &b.ends.map(|e| pose_b.point(&e)),
                preference,
            );
            distances[k] = found.distance - a.radius - b.radius;
            let Some(gradients) = &mut gradients else { continue };
            let row = &mut gradients[k * n..(k + 1) * n];
            row.fill(0.0);
            if found.distance == 0.0 {
                continue;
            }
            let normal = (found.first - found.second) / found.distance;
            for (body, point, sign) in [(a.body, found.first, 1.0), (b.body, found.second, -1.0)] {
                for (hinge, dof, axis) in &self.hinges[body] {
                    let pose = positions.pose(*hinge)?;
                    let turned = (pose.rotation * axis).cross(&(point - pose.translation));
                    row[*dof] += sign * normal.dot(&turned);
                }
            }
        }
        Ok(())
    }
}

/// Whether one body transports the other, bodies without mass aside.
fn is_joined(model: &Model, a: usize, b: usize) -> bool {
    let carrier = |mut i: usize| loop {
        match model.parent(i) {
            Some(parent) if model.inertia(parent).is_some_and(|inertia| inertia.mass() == 0.0) => i = parent,
            parent => return parent,
        }
    };
    carrier(a) == Some(b) || carrier(b) == Some(a)
}

fn hinges_of(model: &Model, body: usize) -> Vec<(usize, usize, Vector3<f64>)> {
    let n_root = model.velocities_of(0).len();
    let mut hinges = Vec::new();
    let mut at = Some(body);
    while let Some(i) = at {
        if let Some(axis) = model.joint(i).and_then(somersault_multibody::Joint::hinge) {
            hinges.push((i, model.velocities_of(i).start - n_root, *axis));
        }
        at = model.parent(i);
    }
    hinges
}
