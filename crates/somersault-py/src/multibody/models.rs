//! Trees with a name in the literature: a function of `functions!` for each.

use crate::core::convert::array;
use crate::core::error::Error;
use crate::core::functions::functions;
use crate::core::value::{Pickled, by_restore, value};
use crate::multibody::model::{Model, sizes_of};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::integrators::nalgebra::Vector3;
use somersault::multibody::models::{
    self, BallJointedDiver, CartPendulum, Dimension, Posture, SegmentScales, TwoLinkArm,
};
use std::collections::HashMap;

/// A diver of a given size, as `diver_planar`, `diver_spatial` and `diver_ball_jointed` make them.
///
/// Bodies, axes and the senses of angles are those of thesis Tables 3.1 and 3.2, beside those of balls; at q = 0 the diver stands
/// with flat feet and faces +x. Segments after de Leva (1996) for 65 kg and 1.70 m: lengths go with the
/// height, masses with the mass, inertias with mass times height squared.
#[pyclass(frozen, module = "somersault.multibody")]
pub(crate) struct Diver {
    /// Size and, where it has hinges, how it moves.
    diver: models::Diver,
    has_balls: bool,
    has_thorax: bool,
    pub(crate) model: Py<Model>,
}

impl Diver {
    /// One with hinges.
    pub(crate) fn of(py: Python<'_>, diver: models::Diver) -> Result<Self, Error> {
        Self::made(py, diver, false, false)
    }

    fn made(py: Python<'_>, diver: models::Diver, has_balls: bool, has_thorax: bool) -> Result<Self, Error> {
        let model =
            if has_balls { BallJointedDiver { size: diver, has_thorax }.model()? } else { diver.model()? };
        Ok(Self { diver, has_balls, has_thorax, model: Py::new(py, Model::of(model))? })
    }

    /// The diver with ball joints, if it is one.
    pub(crate) fn ball_jointed(&self) -> Option<BallJointedDiver> {
        let Self { diver: size, has_thorax, .. } = *self;
        self.has_balls.then_some(BallJointedDiver { size, has_thorax })
    }

    /// Its lengths and masses, however its joints turn.
    pub(crate) fn size(&self) -> models::Diver {
        self.diver
    }

    /// The segments that it has.
    fn segments(&self) -> impl Iterator<Item = &'static str> {
        let has_thorax = self.has_thorax;
        SegmentScales::NAMES.into_iter().filter(move |name| has_thorax || *name != "abdomen")
    }

    /// The diver with hinges, which `argument` must be.
    pub(crate) fn hinged(&self, argument: &str) -> Result<models::Diver, Error> {
        if self.has_balls {
            let message =
                "must have hinges, as those of `diver_planar` and `diver_spatial`, found ball joints";
            return Err(Error::input(format!("`{argument}` {message}")));
        }
        Ok(self.diver)
    }
}

value! {
    impl Diver {
        /// Model: The tree.
        model: Py<Model> = |own, py| own.model.clone_ref(py);
        /// float: Mass, kg.
        mass: f64 = |own| own.diver.mass;
        /// float: Stature, m.
        height: f64 = |own| own.diver.height;
    }
}

#[pymethods]
impl Diver {
    /// tuple of str: Names of the degrees of freedom, in the order of v. A ball has those of its body with ``_x``, ``_y`` and ``_z``, about whose axes it turns.
    #[getter]
    fn dof_names<'py>(&self, py: Python<'py>) -> Result<Bound<'py, PyTuple>, Error> {
        Ok(match self.ball_jointed() {
            Some(diver) => PyTuple::new(py, diver.dof_names()?)?,
            None => PyTuple::new(py, self.diver.dof_names())?,
        })
    }

    /// tuple of str: The postures that this diver has, of thesis Figure 2.2.
    #[getter]
    fn postures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        let postures: &[Posture] = match self.diver.dimension {
            Dimension::Planar => &Posture::PLANAR,
            Dimension::Spatial => &Posture::ALL,
        };
        PyTuple::new(py, postures.iter().map(Posture::to_string))
    }

    /// The configuration in a posture, the torso upright with its joint with the pelvis at the origin.
    ///
    /// Parameters
    /// ----------
    /// posture : str
    ///     Its letter: A, layout with arms overhead; B, arms at the sides; C, arms sideways; D, right arm up;
    ///     E, left arm up; F, tuck; G, open pike; H, closed pike; I, wrapped for a twist.
    ///
    /// Returns
    /// -------
    /// ndarray, shape (n_positions,)
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If there is no such posture, or it is not one in the plane.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> diver = multibody.diver_planar()
    /// >>> straight, pike = diver.configuration("A"), diver.configuration("H")
    /// >>> hip = diver.model.positions_of("thigh")
    /// >>> (pike - straight)[hip].round(2)
    /// array([2.09])
    fn configuration<'py>(&self, py: Python<'py>, posture: &str) -> Result<Bound<'py, PyAny>, Error> {
        let posture = posture.parse()?;
        let q = match self.ball_jointed() {
            Some(diver) => diver.configuration(posture)?,
            None => self.diver.configuration(posture)?,
        };
        Ok(numpy::PyArray1::from_vec(py, q).into_any())
    }

    /// The angles of the joints by their names, which are those of `dof_names` beside the root's; of a ball three, one after the other.
    ///
    /// A ball at a hip has ``right_hip``, its flexion, then ``right_hip_abduction`` sideways and ``right_hip_rotation`` inwards, one at a shoulder those of
    /// the spatial diver, the waist ``pelvis_twist``, ``pelvis_bend`` and ``pelvis_lean``, below a thorax ``abdomen_bend`` and ``abdomen_lean``, the neck ``neck``, ``neck_lean`` and ``neck_turn``. Of the two triples
    /// that make a rotation that one is given which people reach. Where the second is ±90° the third is taken as zero.
    ///
    /// Parameters
    /// ----------
    /// q : array_like, shape (n_positions,) or (n, n_positions)
    ///     A configuration, or those of a motion, such as `MotionFit.q`.
    ///
    /// Returns
    /// -------
    /// dict of str to ndarray, shape () or (n,)
    ///     Angles, rad.
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If a shape does not fit, a number is not finite, or the quaternion of the root is not of unit length.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import multibody
    /// >>> diver = multibody.diver_spatial()
    /// >>> angles = diver.angles([diver.configuration("A"), diver.configuration("F")])
    /// >>> np.degrees(angles["right_knee"]).round(1)
    /// array([  0., 135.])
    fn angles<'py>(&self, py: Python<'py>, q: &Bound<'py, PyAny>) -> Result<Bound<'py, PyDict>, Error> {
        let tree = self.model.get();
        let rows = tree.q("q", q)?;
        let (all, width) = (rows.all()?, tree.model.n_positions());
        let root = tree.model.velocities_of(0).len();
        let columns: Vec<(String, Vec<f64>)> = match self.ball_jointed() {
            Some(diver) => diver.angles(all)?,
            None => {
                let names = &self.diver.dof_names()[root..];
                let column = |k: usize| all.chunks_exact(width).map(|row| row[k]).collect();
                let of = |(name, k): (&&str, usize)| ((*name).to_owned(), column(k));
                names.iter().zip(width - names.len()..).map(of).collect()
            }
        };
        let found = PyDict::new(py);
        for (name, values) in columns {
            let shape = if rows.is_many() { vec![values.len()] } else { vec![] };
            found.set_item(name, array(py, values, &shape)?)?;
        }
        Ok(found)
    }

    /// The same diver with segments of other sizes, whose masses it keeps, right and left alike.
    ///
    /// Parameters
    /// ----------
    /// scales : dict of str to float or array_like, shape (3,)
    ///     For some segments the size over that of this diver: one number, or one along each axis of the body. Names are those of
    ///     `segment_scales` or of bodies, such as ``'right_thigh'``, of which both sides must be alike: those of `ScaledModel.body_scales` are
    ///     among them. From 0.01 to 100.
    ///
    /// Returns
    /// -------
    /// Diver
    ///
    /// Raises
    /// ------
    /// InputError
    ///     If there is no such segment, sides differ, or a number is not allowed.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> tall = multibody.diver_spatial().scaled({"thigh": 1.05, "torso": (1.0, 1.1, 1.0)})
    /// >>> tall.segment_scales["thigh"], tall.segment_scales["torso"], tall.mass
    /// ((1.05, 1.05, 1.05), (1.0, 1.1, 1.0), 65.0)
    fn scaled(&self, py: Python<'_>, scales: &Bound<'_, PyDict>) -> Result<Self, Error> {
        let known = self.diver.segments;
        let mut segments = known;
        let mut given: HashMap<&str, Vector3<f64>> = HashMap::new();
        for (name, size) in sizes_of(scales)? {
            let segment = self.segments().find(|segment| name.ends_with(segment));
            let Some(of_this) = known.of(&name).filter(|_| segment.is_some()) else {
                // frames between the axes of a joint have no size
                if self.model.get().model.body(&name).is_ok() {
                    continue;
                }
                let names = self.segments().collect::<Vec<_>>().join(", ");
                return Err(Error::input(format!("`scales` must name segments, {names}, found '{name}'")));
            };
            let other = segment.and_then(|segment| given.insert(segment, size));
            if other.is_some_and(|other| (other - size).amax() > 1e-9 * size.amax()) {
                return Err(Error::input(format!(
                    "`scales` must be alike on both sides, but are not for `{name}`; those of `Model.scaled` may differ"
                )));
            }
            let of_standing = standing(self.diver.dimension, size.into());
            segments = segments.with(&name, [0, 1, 2].map(|k| of_this[k] * of_standing[k]))?;
        }
        Self::made(py, models::Diver { segments, ..self.diver }, self.has_balls, self.has_thorax)
    }

    /// dict of str to tuple of float: Sizes of the segments, along the axes of their bodies, over those that follow from the height.
    #[getter]
    fn segment_scales<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = PyDict::new(py);
        for name in self.segments() {
            let size = self.diver.segments.of(name).unwrap_or([1.0; 3]);
            found.set_item(name, <(f64, f64, f64)>::from(standing(self.diver.dimension, size)))?;
        }
        Ok(found)
    }

    fn __repr__(&self) -> String {
        let kind = match self.diver.dimension {
            Dimension::Planar => "planar",
            Dimension::Spatial if self.has_thorax => "ball-jointed with a thorax",
            Dimension::Spatial if self.has_balls => "ball-jointed",
            Dimension::Spatial => "spatial",
        };
        format!("<Diver: {kind}, {} kg, {} m>", self.diver.mass, self.diver.height)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let Self { diver, has_balls, has_thorax, .. } = slf.get();
        let planar = diver.dimension == Dimension::Planar;
        let segments: Vec<_> = SegmentScales::NAMES.iter().map(|name| diver.segments.of(name)).collect();
        let models::Diver { mass, height, gravity, .. } = *diver;
        by_restore(slf, (planar, mass, height, gravity, segments, *has_balls, *has_thorax))
    }

    /// A pickled diver; those of files before there were sizes of segments, balls and thoraxes have none.
    #[classmethod]
    #[pyo3(signature = (planar, mass, height, gravity, segments=vec![], has_balls=false, has_thorax=false))]
    fn _restore(
        _: &Bound<'_, PyType>,
        py: Python<'_>,
        planar: bool,
        mass: f64,
        height: f64,
        gravity: f64,
        segments: Vec<[f64; 3]>,
        has_balls: bool,
        has_thorax: bool,
    ) -> Result<Self, Error> {
        let mut scales = SegmentScales::default();
        for (name, scale) in SegmentScales::NAMES.into_iter().zip(segments) {
            scales = scales.with(name, scale)?;
        }
        let diver = if planar { models::Diver::planar() } else { models::Diver::spatial() };
        let segments = scales;
        Self::made(py, models::Diver { mass, height, gravity, segments, ..diver }, has_balls, has_thorax)
    }
}

/// Numbers along the axes of bodies, which for the planar diver are x forward, y up and z to the right, along those of the standing diver, x forward,
/// y outwards and z up; and the other way round.
fn standing(dimension: Dimension, [x, y, z]: [f64; 3]) -> [f64; 3] {
    match dimension {
        Dimension::Planar => [x, z, y],
        Dimension::Spatial => [x, y, z],
    }
}

functions! {
    /// The pendulum on a cart (thesis appendix A).
    ///
    /// q = (r, θ) with r along x and θ from the upright towards −x.
    ///
    /// Parameters
    /// ----------
    /// cart_mass, mass : float, optional
    ///     Masses of the cart and of the point at the end of the pendulum, kg.
    /// length : float, optional
    ///     Length of the pendulum, m.
    /// gravity : float, optional
    ///     Acceleration along −z, m/s².
    ///
    /// Returns
    /// -------
    /// Model
    ///     Bodies ``'cart'`` and ``'pendulum'``.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> multibody.cart_pendulum().mass_matrix([0.0, 0.0])
    /// array([[ 3., -1.],
    ///        [-1.,  1.]])
    #[pyo3(signature = (cart_mass=2.0, mass=1.0, length=1.0, gravity=9.81))]
    fn cart_pendulum(cart_mass: f64, mass: f64, length: f64, gravity: f64) -> Result<Model, Error> {
        Ok(Model::of(CartPendulum { cart_mass, mass, length, gravity }.model()?))
    }

    /// The two-link robot arm on a horizontal plane (thesis 8.2).
    ///
    /// q = (θ₁, θ₂) about z; the links lie along x at q = 0 and are uniform rods.
    ///
    /// Parameters
    /// ----------
    /// masses : tuple of float, optional
    ///     m₁, m₂, kg.
    /// lengths : tuple of float, optional
    ///     L₁, L₂, m.
    /// damping : tuple of float, optional
    ///     c₁, c₂, N m s.
    ///
    /// Returns
    /// -------
    /// Model
    ///     Bodies ``'upper'`` and ``'lower'``.
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> arm = multibody.two_link_arm(masses=(1.0, 0.5), lengths=(0.4, 0.3))
    /// >>> arm.names, arm.mass
    /// (['upper', 'lower'], 1.5)
    #[pyo3(signature = (masses=[0.5, 0.5], lengths=[2.0, 0.5], damping=[0.2, 0.0]))]
    fn two_link_arm(masses: [f64; 2], lengths: [f64; 2], damping: [f64; 2]) -> Result<Model, Error> {
        Ok(Model::of(TwoLinkArm { masses, lengths, damping }.model()?))
    }

    /// The planar diver, with 12 degrees of freedom (thesis Table 3.1): limbs move in pairs.
    ///
    /// Parameters
    /// ----------
    /// mass, height : float, optional
    ///     Mass, kg, and stature, m.
    /// gravity : float, optional
    ///     Acceleration along −z, m/s².
    ///
    /// Returns
    /// -------
    /// Diver
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> diver = multibody.diver_planar(mass=60.0, height=1.65)
    /// >>> diver.model.n_velocities, diver.postures
    /// (12, ('A', 'B', 'F', 'G', 'H'))
    #[pyo3(signature = (mass=65.0, height=1.7, gravity=9.81))]
    fn diver_planar(py: Python<'_>, mass: f64, height: f64, gravity: f64) -> Result<Diver, Error> {
        Diver::of(py, models::Diver { mass, height, gravity, ..models::Diver::planar() })
    }

    /// The spatial diver, with 27 degrees of freedom (thesis Table 3.2).
    ///
    /// With an arm straight out sideways, as in postures C and G, two axes of the shoulder coincide: dynamics
    /// there need the shoulders among the active degrees of freedom.
    ///
    /// Parameters
    /// ----------
    /// mass, height : float, optional
    ///     Mass, kg, and stature, m.
    /// gravity : float, optional
    ///     Acceleration along −z, m/s².
    ///
    /// Returns
    /// -------
    /// Diver
    ///
    /// Examples
    /// --------
    /// >>> from somersault import multibody
    /// >>> diver = multibody.diver_spatial(mass=58.0, height=1.62)
    /// >>> diver.model.n_velocities, round(diver.model.mass, 6)
    /// (27, 58.0)
    #[pyo3(signature = (mass=65.0, height=1.7, gravity=9.81))]
    fn diver_spatial(py: Python<'_>, mass: f64, height: f64, gravity: f64) -> Result<Diver, Error> {
        Diver::of(py, models::Diver { mass, height, gravity, ..models::Diver::spatial() })
    }

    /// The spatial diver with balls at waist, neck, hips and shoulders, with 34 degrees of freedom: for recordings of people, whose legs spread and turn.
    ///
    /// Bodies, masses and the other joints are those of `diver_spatial`. Balls have no limits. Optimal dives and eigenpostures need hinges.
    ///
    /// Parameters
    /// ----------
    /// mass, height : float, optional
    ///     Mass, kg, and stature, m.
    /// gravity : float, optional
    ///     Acceleration along −z, m/s².
    /// thorax : bool, optional
    ///     Whether the trunk bends and leans at the tip of the breastbone too, by two hinges: 36 degrees of freedom. The body ``'torso'`` then is the thorax
    ///     alone, with head and arms, and the body ``'abdomen'`` is between it and the pelvis. At q = 0 all points are where they are without. For markers
    ///     on thorax and pelvis, as of Plug-in Gait.
    ///
    /// Returns
    /// -------
    /// Diver
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from somersault import multibody
    /// >>> diver = multibody.diver_ball_jointed(mass=58.0, height=1.62)
    /// >>> diver.model.n_velocities, diver.model.links[2].name, diver.model.links[2].joint
    /// (34, 'right_thigh', 'spherical')
    /// >>> angles = diver.angles(diver.configuration("F"))
    /// >>> (np.degrees([angles["right_hip"], angles["right_hip_abduction"]]).round(6) + 0.0).tolist()
    /// [125.0, 0.0]
    #[pyo3(signature = (mass=65.0, height=1.7, gravity=9.81, *, thorax=false))]
    fn diver_ball_jointed(
        py: Python<'_>,
        mass: f64,
        height: f64,
        gravity: f64,
        thorax: bool,
    ) -> Result<Diver, Error> {
        Diver::made(py, models::Diver { mass, height, gravity, ..models::Diver::spatial() }, true, thorax)
    }
}
