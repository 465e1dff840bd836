//! Building a model, body by body, from the root outwards.
//!
//! A body names its parent, which must have been added before: cycles cannot be written down. Files hold what a model is built
//! from.

use crate::error::ModelError;
use crate::joint::Joint;
use crate::link::Link;
use crate::model::Model;
use nalgebra::Vector3;
use std::collections::HashSet;

/// Collects the bodies of a model.
#[derive(Debug, Clone)]
pub struct ModelBuilder {
    links: Vec<Link>,
    names: HashSet<String>,
    gravity: Vector3<f64>,
}

impl Default for ModelBuilder {
    fn default() -> Self {
        Self { links: Vec::new(), names: HashSet::new(), gravity: Vector3::new(0.0, 0.0, -9.81) }
    }
}

impl ModelBuilder {
    /// No body yet; gravity (0, 0, −9.81) m/s².
    pub fn new() -> Self {
        Self::default()
    }

    /// Gravitational acceleration in the world frame, m/s².
    pub fn with_gravity(mut self, gravity: Vector3<f64>) -> Self {
        self.gravity = gravity;
        self
    }

    /// Adds a body. The root comes first; every other body after its parent.
    pub fn add(&mut self, link: Link) -> Result<&mut Self, ModelError> {
        if self.names.contains(&link.name) {
            return Err(ModelError::DuplicateName { name: link.name });
        }
        match (&link.parent, self.links.first()) {
            (None, Some(root)) => {
                return Err(ModelError::SecondRoot { name: link.name, root: root.name.clone() });
            }
            (Some(parent), _) if !self.names.contains(parent) => {
                return Err(ModelError::UnknownParent { parent: parent.clone(), name: link.name });
            }
            (None, None) | (Some(_), _) => {}
        }
        let link = link.validate()?;
        self.names.insert(link.name.clone());
        self.links.push(link);
        Ok(self)
    }

    /// The model.
    pub fn build(self) -> Result<Model, ModelError> {
        if self.links.is_empty() {
            return Err(ModelError::Empty);
        }
        if !self.gravity.iter().all(|g| g.is_finite()) {
            let name = self.links[0].name.clone();
            return Err(ModelError::NonFinite { name, argument: "gravity" });
        }
        let model = Model::from_links(self.links, self.gravity)?;
        let mut carried: Vec<f64> = model.links().iter().map(|l| l.mass.mass).collect();
        for i in (0..carried.len()).rev() {
            if let Some(parent) = model.parent(i) {
                carried[parent] += carried[i];
            }
        }
        // a coordinate moves what its joint and all that follow it carry
        let mut moved = vec![0.0; carried.len()];
        for (source, carried) in model.sources().iter().zip(carried) {
            if source.multiplier != 0.0 {
                moved[source.body] += carried;
            }
        }
        for (i, link) in model.links().iter().enumerate().rev() {
            if moved[i] == 0.0 && link.joint != Joint::Fixed && link.mimic.is_none() {
                return Err(ModelError::CarriesNoMass { name: link.name.clone() });
            }
        }
        Ok(model)
    }
}

impl Model {
    /// Starts an empty model with gravity (0, 0, −9.81) m/s².
    pub fn builder() -> ModelBuilder {
        ModelBuilder::new()
    }
}

/// A model as files hold it.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
struct Parts {
    gravity: Vector3<f64>,
    links: Vec<Link>,
}

#[cfg(feature = "serde")]
impl Parts {
    fn build(self) -> Result<Model, ModelError> {
        let mut builder = Model::builder().with_gravity(self.gravity);
        for link in self.links {
            builder.add(link)?;
        }
        builder.build()
    }
}

#[cfg(feature = "serde")]
impl serde::Serialize for Model {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Parts { gravity: self.standard_gravity, links: self.links().to_vec() }.serialize(serializer)
    }
}

#[cfg(feature = "serde")]
impl<'de> serde::Deserialize<'de> for Model {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Parts::deserialize(deserializer)?.build().map_err(serde::de::Error::custom)
    }
}
