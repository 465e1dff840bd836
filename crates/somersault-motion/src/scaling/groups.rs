//! Which bodies have one size.

use super::ScalingError;
use crate::fit::MarkerSet;
use nalgebra::Vector3;
use somersault_core::argument::expect_range;
use somersault_multibody::Model;

/// Bodies, or axes of bodies, that have one size over that of the model.
#[derive(Debug, Clone, PartialEq)]
pub struct ScaleGroup {
    name: String,
    /// Numbers of bodies, and which of their axes.
    parts: Vec<(usize, [bool; 3])>,
}

/// How names of bodies on the right are told from those on the left.
const SIDES: [[&str; 2]; 3] = [["right", "left"], ["Right", "Left"], ["R", "L"]];
/// Distances of joints from the middle that count as equal, in fractions.
const ALIKE: f64 = 1e-6;

impl ScaleGroup {
    /// Bodies of a model by their names, with those of their axes x, y and z that are scaled.
    pub fn try_new<N: AsRef<str>>(
        model: &Model,
        name: impl Into<String>,
        parts: impl IntoIterator<Item = (N, [bool; 3])>,
    ) -> Result<Self, ScalingError> {
        let name = name.into();
        let part = |(body, axes): (N, [bool; 3])| Ok::<_, ScalingError>((model.body(body.as_ref())?, axes));
        let parts = parts.into_iter().map(part).collect::<Result<Vec<_>, _>>()?;
        if parts.is_empty() || parts.iter().any(|(_, axes)| !axes.contains(&true)) {
            return Err(ScalingError::EmptyGroup { name });
        }
        Ok(Self { name, parts })
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Numbers of bodies, and which of their axes x, y and z.
    pub fn parts(&self) -> &[(usize, [bool; 3])] {
        &self.parts
    }

    /// The usual groups of a model: each body that carries a joint or a marker away from its origin, right and left of the same name as
    /// one; and, where a body carries a right and a left joint that are the same but along one axis, that axis by itself, which
    /// is its width.
    pub fn of_model(model: &Model, markers: &MarkerSet) -> Vec<Self> {
        let links = model.links();
        let has_size = |i: usize| {
            let carries = |j: usize| model.parent(j) == Some(i) && links[j].origin().amax() > 0.0;
            let holds = markers.markers().iter().any(|m| m.body == i && m.point.amax() > 0.0);
            (0..links.len()).any(carries) || holds
        };
        let mut groups: Vec<Self> = Vec::new();
        let mut add = |name: String, body: usize, axes: [bool; 3]| match groups
            .iter_mut()
            .find(|group| group.name == name)
        {
            Some(group) => group.parts.push((body, axes)),
            None => groups.push(Self { name, parts: vec![(body, axes)] }),
        };
        for i in (0..links.len()).filter(|i| has_size(*i)) {
            let name = without_side(model, links[i].name());
            let width = width_of(model, i);
            let axes = [0, 1, 2].map(|axis| width != Some(axis));
            add(name.clone(), i, axes);
            if width.is_some() {
                add(format!("{name} width"), i, axes.map(|is_other| !is_other));
            }
        }
        groups
    }

    /// For each body and axis the number of its group; fails where one is in two.
    pub(super) fn numbers(model: &Model, groups: &[Self]) -> Result<Vec<[Option<usize>; 3]>, ScalingError> {
        let mut numbers = vec![[None; 3]; model.n_bodies()];
        for (g, group) in groups.iter().enumerate() {
            if groups[..g].iter().any(|before| before.name == group.name) {
                return Err(ScalingError::DuplicateGroup { name: group.name.clone() });
            }
            for (body, axes) in &group.parts {
                let n = numbers.len() as f64;
                expect_range("bodies of a group", *body as f64, "bodies of the model", |x| x < n)?;
                for (axis, name) in ['x', 'y', 'z'].into_iter().enumerate().filter(|(axis, _)| axes[*axis]) {
                    if let Some(before) = numbers[*body][axis].replace(g) {
                        return Err(ScalingError::InTwoGroups {
                            body: model.name(*body).unwrap_or_default().to_owned(),
                            axis: name,
                            first: groups[before].name.clone(),
                            second: group.name.clone(),
                        });
                    }
                }
            }
        }
        Ok(numbers)
    }
}

/// The axis of a body along which right and left joints differ, and nothing else does; none without such joints.
fn width_of(model: &Model, body: usize) -> Option<usize> {
    let children = || (0..model.n_bodies()).filter(|j| model.parent(*j) == Some(body));
    let mut found = None;
    for right in children() {
        let link = &model.links()[right];
        let Some(left) = other_side(model, link.name()).filter(|left| model.parent(*left) == Some(body))
        else {
            continue;
        };
        let [p, q]: [&Vector3<f64>; 2] = [link.origin(), model.links()[left].origin()];
        let slack = ALIKE * p.amax().max(q.amax());
        let differs: Vec<usize> = (0..3).filter(|a| (p[*a] - q[*a]).abs() > slack).collect();
        match differs[..] {
            [axis] if (p[axis] + q[axis]).abs() <= slack && found.is_none_or(|known| known == axis) => {
                found = Some(axis);
            }
            _ => return None,
        }
    }
    found
}

/// The body of the same name on the other side.
fn other_side(model: &Model, name: &str) -> Option<usize> {
    names_by_side(name).find_map(|(_, other)| model.body(&other).ok())
}

/// The name of a body that has another on the other side without its side.
fn without_side(model: &Model, name: &str) -> String {
    let of_pair = names_by_side(name).find(|(_, other)| model.body(other).is_ok());
    of_pair.map_or_else(|| name.to_owned(), |(bare, _)| bare)
}

/// For each reading of a name that has a side: the name without it, and that of the other side.
fn names_by_side(name: &str) -> impl Iterator<Item = (String, String)> {
    let readings = SIDES.into_iter().flat_map(|[right, left]| {
        let lower = [right.to_lowercase(), left.to_lowercase()];
        let given = [right.to_owned(), left.to_owned()];
        [
            given.clone(),
            [given[1].clone(), given[0].clone()],
            lower.clone(),
            [lower[1].clone(), lower[0].clone()],
        ]
    });
    readings.flat_map(|[side, other]| {
        let in_front = name.strip_prefix(&side).filter(|bare| !bare.is_empty());
        let behind = name.strip_suffix(&side).filter(|bare| !bare.is_empty());
        let trim = |bare: &str| bare.trim_matches(|c: char| "_. :-".contains(c)).to_owned();
        [
            in_front.map(|bare| (trim(bare), format!("{other}{bare}"))),
            behind.map(|bare| (trim(bare), format!("{bare}{other}"))),
        ]
        .into_iter()
        .flatten()
        .collect::<Vec<_>>()
    })
}
