//! Vertices of the convex hull of a mesh, from an STL or OBJ file.
//!
//! Only vertices are read from a file, in double precision: triangles, normals, groups and materials do not change the hull.

use crate::error::UntouchableShape;
use nalgebra::{Matrix3, Vector3};
use std::collections::{BTreeMap, HashSet};

/// How many different places a mesh may have.
const MOST_PLACES: usize = 50_000;
/// How many vertices its convex hull may have: each is a contact.
const MOST_VERTICES: usize = 512;

/// Of an STL file: a header of 80 bytes, the number of its triangles, and 50 bytes for each.
const STL_HEADER: usize = 84;
const STL_TRIANGLE: usize = 50;

/// How far from a face a place is within it, over the size of the mesh; and what the normals of the faces of a vertex differ by, squared.
const DIGITS: f64 = 1e-9;

/// The vertices of the convex hull of a mesh, by the content of its file and its name, which ends in `.stl` or `.obj`, with its axes
/// scaled.
///
/// Places that lie within a face or an edge of the hull to nine digits are left out.
pub(super) fn hull_vertices(
    content: &[u8],
    file: &str,
    scale: &Vector3<f64>,
) -> Result<Vec<Vector3<f64>>, UntouchableShape> {
    let unreadable = |reason: String| UntouchableShape::Unreadable { file: file.to_owned(), reason };
    let places = match file.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase()).as_deref() {
        Some("stl") => stl(content).map_err(unreadable)?,
        Some("obj") => lines(content, "v").map_err(unreadable)?,
        Some(_) | None => return Err(unreadable("it must end in .stl or .obj".to_owned())),
    };
    let mut seen = HashSet::new();
    // Zero has two signs.
    let bits = |place: &Vector3<f64>| place.map(|x| (x + 0.0).to_bits());
    let places = places.into_iter().map(|place| place.component_mul(scale));
    let places: Vec<Vector3<f64>> = places.filter(|place| seen.insert(bits(place))).collect();
    if places.len() > MOST_PLACES {
        return Err(unreadable(format!(
            "it has {} different vertices, more than {MOST_PLACES}",
            places.len()
        )));
    }
    let vertices = extreme(&places).map_err(unreadable)?;
    if vertices.len() > MOST_VERTICES {
        return Err(unreadable(too_many()));
    }
    Ok(vertices)
}

fn too_many() -> String {
    format!("its convex hull has more than {MOST_VERTICES} vertices")
}

/// A face of a hull, whose corners go round its outward normal.
struct Face {
    corners: [usize; 3],
    /// Of unit length; zero where the corners are in one line.
    normal: Vector3<f64>,
    offset: f64,
}

impl Face {
    fn new(corners: [usize; 3], places: &[Vector3<f64>]) -> Self {
        let [a, b, c] = corners.map(|k| places[k]);
        let normal = (b - a).cross(&(c - a)).try_normalize(f64::MIN_POSITIVE).unwrap_or_default();
        Self { corners, normal, offset: normal.dot(&a) }
    }

    fn height(&self, place: &Vector3<f64>) -> f64 {
        self.normal.dot(place) - self.offset
    }

    fn edges(&self) -> [(usize, usize); 3] {
        let [a, b, c] = self.corners;
        [(a, b), (b, c), (c, a)]
    }
}

/// The vertices of the convex hull of places, which grows by one place after another: the faces that a place sees give way to those
/// between it and their rim. Those far from the middle come first, so that most of the others are found inside.
fn extreme(places: &[Vector3<f64>]) -> Result<Vec<Vector3<f64>>, String> {
    let flat = || "its vertices have no convex hull with a volume".to_owned();
    let middle = places.iter().sum::<Vector3<f64>>() / places.len().max(1) as f64;
    let size = places.iter().fold(0.0_f64, |size, place| size.max((place - middle).norm()));
    let within = size * DIGITS;
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by(|a, b| (places[*b] - middle).norm().total_cmp(&(places[*a] - middle).norm()));
    let farthest = |from: &dyn Fn(&Vector3<f64>) -> f64| {
        let found = (0..places.len()).max_by(|a, b| from(&places[*a]).total_cmp(&from(&places[*b])));
        found.filter(|k| from(&places[*k]) > within).ok_or_else(flat)
    };
    let a = *order.first().ok_or_else(flat)?;
    let b = farthest(&|place| (place - places[a]).norm())?;
    let along = (places[b] - places[a]).normalize();
    let c = farthest(&|place| along.cross(&(place - places[a])).norm())?;
    let base = Face::new([a, b, c], places);
    let d = farthest(&|place| base.height(place).abs())?;
    let [b, c] = if base.height(&places[d]) > 0.0 { [c, b] } else { [b, c] };
    let mut faces: Vec<Face> =
        [[a, b, c], [a, d, b], [b, d, c], [c, d, a]].map(|corners| Face::new(corners, places)).into();
    for k in order {
        let sees = |face: &Face| face.height(&places[k]) > within;
        if !faces.iter().any(sees) {
            continue;
        }
        let (seen, hidden): (Vec<Face>, Vec<Face>) = faces.into_iter().partition(sees);
        faces = hidden;
        let edges: HashSet<(usize, usize)> = seen.iter().flat_map(Face::edges).collect();
        let rim = seen.iter().flat_map(Face::edges).filter(|(from, to)| !edges.contains(&(*to, *from)));
        faces.extend(rim.map(|(from, to)| Face::new([from, to, k], places)));
        // Of a hull with n vertices it has 2 n − 4; those within faces and edges are left out at the end.
        if faces.len() > 8 * MOST_VERTICES {
            return Err(too_many());
        }
    }
    if faces.iter().any(|face| places.iter().any(|place| face.height(place) > 10.0 * within)) {
        return Err("its convex hull is not determined by nine digits".to_owned());
    }
    Ok(corners(&faces, places))
}

/// The vertices whose faces have three different directions.
fn corners(faces: &[Face], places: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut spread: BTreeMap<usize, Matrix3<f64>> = BTreeMap::new();
    for Face { corners, normal, .. } in faces {
        for k in corners {
            *spread.entry(*k).or_default() += normal * normal.transpose();
        }
    }
    let is_corner = |spread: &Matrix3<f64>| spread.symmetric_eigenvalues().min() > DIGITS;
    spread.iter().filter(|(_, spread)| is_corner(spread)).map(|(k, _)| places[*k]).collect()
}

/// The places of an STL file, binary or text.
fn stl(content: &[u8]) -> Result<Vec<Vector3<f64>>, String> {
    let count = content.get(STL_HEADER - 4..STL_HEADER).and_then(|bytes| <[u8; 4]>::try_from(bytes).ok());
    let triangles = count.map_or(0, |bytes| u32::from_le_bytes(bytes) as usize);
    let is_binary = count.is_some()
        && triangles.checked_mul(STL_TRIANGLE).and_then(|size| size.checked_add(STL_HEADER))
            == Some(content.len());
    if !is_binary {
        return if content.trim_ascii_start().starts_with(b"solid") {
            lines(content, "vertex")
        } else {
            Err(format!("it is no text and its {} bytes are not those of its triangles", content.len()))
        };
    }
    let mut places = Vec::with_capacity(3 * triangles);
    for triangle in content[STL_HEADER..].chunks_exact(STL_TRIANGLE) {
        for place in triangle[12..48].chunks_exact(12) {
            let number = |k: usize| {
                let bytes = <[u8; 4]>::try_from(&place[4 * k..4 * k + 4]).unwrap_or_default();
                f64::from(f32::from_le_bytes(bytes))
            };
            places.push(finite(Vector3::new(number(0), number(1), number(2)))?);
        }
    }
    Ok(places)
}

/// The places of the lines of a text that begin with a word.
fn lines(content: &[u8], word: &str) -> Result<Vec<Vector3<f64>>, String> {
    let text = std::str::from_utf8(content).map_err(|error| format!("it is no text: {error}"))?;
    let mut places = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split_ascii_whitespace();
        if words.next() != Some(word) {
            continue;
        }
        let mut place = Vector3::zeros();
        for coordinate in place.iter_mut() {
            let found = words.next().unwrap_or_default();
            *coordinate = found
                .parse()
                .map_err(|_| format!("line {} must have three numbers, found {found:?}", number + 1))?;
        }
        places.push(finite(place)?);
    }
    Ok(places)
}

fn finite(place: Vector3<f64>) -> Result<Vector3<f64>, String> {
    if place.iter().all(|x| x.is_finite()) {
        Ok(place)
    } else {
        Err(format!("its vertices must be finite, found {:?}", place.as_slice()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    fn some(k: usize, axis: usize) -> f64 {
        f64::sin((37.0 + 11.3 * axis as f64) * k as f64 + 5.0 * axis as f64)
    }

    fn vector(k: usize) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| some(k, axis))
    }

    #[test]
    fn a_hull_reaches_as_far_as_its_places_in_every_direction() {
        let balls: Vec<_> = (0..300).map(|k| vector(k).normalize() * 0.3).collect();
        let cloud: Vec<_> = (0..3000).map(|k| vector(k) * 20.0 + Vector3::x() * 500.0).collect();
        assert_eq!(extreme(&balls).unwrap().len(), 300);
        for places in [balls, cloud] {
            let found = extreme(&places).unwrap();
            assert!(found.iter().all(|vertex| places.contains(vertex)));
            for k in 0..300 {
                let way = vector(7 * k + 3).normalize();
                let [hull, all] = [&found, &places]
                    .map(|of| of.iter().map(|place| way.dot(place)).fold(f64::NEG_INFINITY, f64::max));
                assert!(hull <= all && all - hull < 1e-7, "{k}: {hull} {all}");
            }
        }
    }

    /// Places on faces and edges are no vertices, also where rounding puts them outside.
    #[test]
    fn a_grid_on_a_box_that_is_turned_has_eight_vertices() {
        let turn = UnitQuaternion::new(Vector3::new(0.3, -0.7, 0.4));
        let grid = |k: usize| Vector3::new((k % 11) as f64, (k / 11 % 11) as f64, (k / 121) as f64) * 0.1;
        let places: Vec<_> = (0..1331).map(|k| turn * grid(k) + Vector3::repeat(3.0)).collect();
        let found = extreme(&places).unwrap();
        let corners = [0, 10, 110, 120, 1210, 1220, 1320, 1330].map(|k| places[k]);
        assert!(found.len() == 8 && corners.iter().all(|corner| found.contains(corner)), "{found:?}");
        let flat: Vec<_> = places[..121].to_vec();
        assert_eq!(extreme(&flat).unwrap_err(), "its vertices have no convex hull with a volume");
    }

    #[test]
    fn a_mesh_is_scaled_before_its_hull_is_sought() {
        let of = |scale: [f64; 3]| {
            hull_vertices(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n", "a.obj", &scale.into())
                .map_err(|error| error.to_string())
        };
        assert!(of([1.0, -2.0, 3.0]).unwrap().contains(&Vector3::new(0.0, -2.0, 0.0)));
        for scale in [[1.0, 1.0, 0.0], [0.0; 3], [f64::NAN, 1.0, 1.0], [1e308, 1e-308, 1.0]] {
            assert!(of(scale).unwrap_err().ends_with("its vertices have no convex hull with a volume"));
        }
    }

    #[test]
    fn hulls_with_too_many_vertices_are_refused() {
        let places: Vec<_> = (0..6000).map(|k| vector(k).normalize()).collect();
        assert_eq!(extreme(&places).unwrap_err(), "its convex hull has more than 512 vertices");
        assert!(extreme(&[]).is_err() && extreme(&places[..3]).is_err());
    }
}
