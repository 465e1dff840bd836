//! Trees with a name in the literature: a function of `functions!` for each.

use crate::core::convert::array;
use crate::core::error::Error;
use crate::core::functions::functions;
use crate::core::value::{Pickled, by_restore, value};
use crate::multibody::model::Model;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};
use somersault::multibody::models::{self, CartPendulum, Dimension, Posture, TwoLinkArm};

/// A diver of a given size, as `diver_planar` and `diver_spatial` make them.
///
/// Bodies, axes and the senses of angles are those of thesis Tables 3.1 and 3.2; at q = 0 the diver stands
/// with flat feet and faces +x. Segments after de Leva (1996) for 65 kg and 1.70 m: lengths go with the
/// height, masses with the mass, inertias with mass times height squared.
#[pyclass(frozen, module = "somersault.multibody")]
pub(crate) struct Diver {
    pub(crate) diver: models::Diver,
    pub(crate) model: Py<Model>,
}

impl Diver {
    pub(crate) fn of(py: Python<'_>, diver: models::Diver) -> Result<Self, Error> {
        Ok(Self { diver, model: Py::new(py, Model::of(diver.model()?))? })
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
        /// tuple of str: Names of the degrees of freedom, in the order of v.
        dof_names: PyResult<Bound<'py, PyTuple>> = |own, py| PyTuple::new(py, own.diver.dof_names());
    }
}

#[pymethods]
impl Diver {
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
        let q = self.diver.configuration(posture.parse()?)?;
        Ok(numpy::PyArray1::from_vec(py, q).into_any())
    }

    /// The angles of the joints by their names, which are those of `dof_names` beside the root's.
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
        let names = &self.diver.dof_names()[root..];
        let found = PyDict::new(py);
        for (name, column) in names.iter().zip(width - names.len()..) {
            let values: Vec<f64> = all.chunks_exact(width).map(|row| row[column]).collect();
            let shape = if rows.is_many() { vec![values.len()] } else { vec![] };
            found.set_item(name, array(py, values, &shape)?)?;
        }
        Ok(found)
    }

    fn __repr__(&self) -> String {
        let kind = match self.diver.dimension {
            Dimension::Planar => "planar",
            Dimension::Spatial => "spatial",
        };
        format!("<Diver: {kind}, {} kg, {} m>", self.diver.mass, self.diver.height)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Pickled<'py> {
        let diver = &slf.get().diver;
        let planar = diver.dimension == Dimension::Planar;
        by_restore(slf, (planar, diver.mass, diver.height, diver.gravity))
    }

    /// A pickled diver.
    #[classmethod]
    fn _restore(
        _: &Bound<'_, PyType>,
        py: Python<'_>,
        planar: bool,
        mass: f64,
        height: f64,
        gravity: f64,
    ) -> Result<Self, Error> {
        if planar {
            diver_planar(py, mass, height, gravity)
        } else {
            diver_spatial(py, mass, height, gravity)
        }
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
}
