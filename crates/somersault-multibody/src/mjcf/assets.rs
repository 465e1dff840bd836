//! Meshes by their names.

use super::MjcfError;
use super::compiler::Compiler;
use super::defaults::{Defaults, MAIN, Styled};
use super::library::Library;
use crate::robot::GeometryShape;
use crate::robot::document::Element;
use nalgebra::Vector3;
use std::collections::HashMap;

pub(super) struct Meshes<'a> {
    named: HashMap<&'a str, Styled<'a>>,
}

impl<'a> Meshes<'a> {
    pub(super) fn read(
        sections: &[Element<'a>],
        library: &Library<'a>,
        defaults: &'a Defaults<'a>,
    ) -> Result<Self, MjcfError> {
        let mut named = HashMap::new();
        for section in sections.iter().filter(|section| section.tag() == "asset") {
            for mesh in library.children(section).into_iter().filter(|asset| asset.tag() == "mesh") {
                // without a name it has that of its file
                let file = mesh
                    .attribute_or_none("file")
                    .map(|file| file.rsplit(['/', '\\']).next().unwrap_or(file));
                let stem = file.map(|file| file.rsplit_once('.').map_or(file, |(stem, _)| stem));
                if let Some(name) = mesh.name.or(stem) {
                    named.insert(name, defaults.styled(mesh, "mesh", MAIN)?);
                }
            }
        }
        Ok(Self { named })
    }

    /// The mesh of a geom; none if its surface stands in the document.
    pub(super) fn shape(
        &self,
        geom: &Styled,
        compiler: &Compiler,
    ) -> Result<Option<GeometryShape>, MjcfError> {
        let name = geom.text("mesh").ok_or_else(|| geom.own.missing("mesh"))?;
        let mesh = self.named.get(name).ok_or_else(|| MjcfError::unknown_name(&geom.own, "mesh", name))?;
        let scale = mesh.at("scale").vector("scale")?.unwrap_or(Vector3::repeat(1.0));
        Ok(mesh.text("file").map(|file| GeometryShape::Mesh { file: compiler.mesh_path(file), scale }))
    }
}
