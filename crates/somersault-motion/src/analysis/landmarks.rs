//! Bodies by which a motion of a diver is seen.

use nalgebra::Vector3;
use somersault_multibody::{Data, DynamicsError, Model};

/// Of the right and the left side or of both at once, by the names of [`Diver`](somersault_multibody::models::Diver).
pub(crate) struct Landmarks {
    head: usize,
    thighs: Vec<usize>,
    shanks: Vec<usize>,
    ankles: Vec<usize>,
    feet: Vec<usize>,
    hands: Vec<usize>,
}

impl Landmarks {
    pub(crate) fn of(model: &Model) -> Result<Self, DynamicsError> {
        let sides = |part: &str| match model.body(part) {
            Ok(body) => Ok(vec![body]),
            Err(_) => ["right", "left"].iter().map(|side| model.body(&format!("{side}_{part}"))).collect(),
        };
        Ok(Self {
            head: model.body("head")?,
            thighs: sides("thigh")?,
            shanks: sides("shank")?,
            ankles: sides("foot")?,
            feet: [sides("foot")?, sides("toes")?].concat(),
            hands: sides("hand")?,
        })
    }

    /// The bodies whose joints are the hips, and those whose joints are the knees.
    pub(crate) fn hips_and_knees(&self) -> [&[usize]; 2] {
        [&self.thighs, &self.shanks]
    }

    /// Between the directions from the middle of the hips to the head and to the middle of the knees, rad: legs that are spread alike close it by
    /// nothing.
    pub(crate) fn hip_angle(&self, model: &Model, data: &mut Data, q: &[f64]) -> Result<f64, DynamicsError> {
        let positions = model.positions(data, q)?;
        let origin = |body| positions.pose(body).map(|pose| pose.translation);
        let middle = |bodies: &[usize]| -> Result<Vector3<f64>, DynamicsError> {
            let sum = bodies
                .iter()
                .try_fold(Vector3::zeros(), |sum, body| Ok::<_, DynamicsError>(sum + origin(*body)?))?;
            Ok(sum / bodies.len() as f64)
        };
        let hip = middle(&self.thighs)?;
        Ok(angle(&(origin(self.head)? - hip), &(middle(&self.shanks)? - hip)))
    }

    /// Between the directions from shank to thigh and from shank to foot, rad, the mean of both sides.
    pub(crate) fn knee_angle(&self, model: &Model, data: &mut Data, q: &[f64]) -> Result<f64, DynamicsError> {
        let positions = model.positions(data, q)?;
        let origin = |body| positions.pose(body).map(|pose| pose.translation);
        let mut mean = 0.0;
        for ((&thigh, &shank), &foot) in self.thighs.iter().zip(&self.shanks).zip(&self.ankles) {
            let knee = origin(shank)?;
            mean += angle(&(origin(thigh)? - knee), &(origin(foot)? - knee)) / self.thighs.len() as f64;
        }
        Ok(mean)
    }

    /// From the centre of mass of the feet to that of the hands, m.
    pub(crate) fn long_axis(
        &self,
        model: &Model,
        data: &mut Data,
        q: &[f64],
    ) -> Result<Vector3<f64>, DynamicsError> {
        let positions = model.positions(data, q)?;
        let center = |bodies: &[usize]| -> Result<Vector3<f64>, DynamicsError> {
            let (mut moment, mut mass) = (Vector3::zeros(), 0.0);
            for &body in bodies {
                let properties = model.links()[body].mass_properties();
                moment += positions.pose(body)?.point(&properties.center) * properties.mass;
                mass += properties.mass;
            }
            Ok(moment / mass)
        };
        Ok(center(&self.hands)? - center(&self.feet)?)
    }
}

fn angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b))
}
