//! A force that was traced: a function of Python that is evaluated, and differentiated, without the interpreter.

use crate::core::error::Error;
use crate::expr::compiled::CompiledFunction;
use crate::integrators::forces::models::{ForceModel, build};
use pyo3::prelude::*;
use somersault::expr::{Evaluator, ExprFunction, Expression, LANES};
use somersault::integrators::body::RigidBody;
use somersault::integrators::force::{self, StatesInLanes, Wrench, WrenchesInLanes};
use somersault::integrators::nalgebra::{Matrix3, Quaternion, Vector3};
use somersault::integrators::state::{RigidBodyState, Twist};
use somersault::integrators::variation::Tangent;
use std::cell::RefCell;
use std::ops::Range;
use std::sync::Arc;
use thread_local::ThreadLocal;

/// Numbers that the function takes: time, position, rotation matrix by rows, quaternion (x, y, z, w), velocity, angular velocity, mass, and
/// the tensor of inertia by rows.
const INPUTS: usize = 33;
/// The first numbers of them.
const POSITION: usize = 1;
const ROTATION: usize = 4;
const QUATERNION: usize = 13;
const VELOCITY: usize = 17;
const ANGULAR_VELOCITY: usize = 20;
const MASS: usize = 23;
const INERTIA: usize = 24;
/// Numbers that it gives: force and torque.
const OUTPUTS: usize = 6;

/// A force and a torque as expressions of time, state and body. A clone has memory of its own.
struct ExpressionForce {
    function: ExprFunction,
    /// Evaluate the function, and the entries of its Jacobian matrix into numbers, in each thread.
    values: ThreadLocal<RefCell<Evaluator>>,
    slopes: ThreadLocal<RefCell<(Evaluator, Vec<f64>)>>,
    /// Rows and columns of the entries.
    entries: Arc<[(usize, usize)]>,
    /// Whether the function reads the matrix, and mass or inertia.
    reads_rotation: bool,
    reads_body: bool,
}

impl Clone for ExpressionForce {
    fn clone(&self) -> Self {
        Self {
            function: self.function.clone(),
            values: ThreadLocal::new(),
            slopes: ThreadLocal::new(),
            entries: self.entries.clone(),
            ..*self
        }
    }
}

impl ExpressionForce {
    fn try_new(function: ExprFunction) -> Result<Self, Error> {
        let (n, m) = (function.n_inputs(), function.n_outputs());
        if (n, m) != (INPUTS, OUTPUTS) {
            return Err(Error::input(format!(
                "`function` must have {INPUTS} inputs and {OUTPUTS} outputs, found {n} and {m}"
            )));
        }
        let entries = function.jacobian()?.sparsity().entries().collect();
        let evaluator = function.evaluator();
        let reads = |mut inputs: Range<usize>| inputs.any(|input| evaluator.reads(input));
        let (reads_rotation, reads_body) = (reads(ROTATION..QUATERNION), reads(MASS..INPUTS));
        let (values, slopes) = (ThreadLocal::new(), ThreadLocal::new());
        Ok(Self { function, values, slopes, entries, reads_rotation, reads_body })
    }

    /// Whether outputs are the number 0.
    fn are_zero(&self, outputs: &[Expression]) -> bool {
        outputs.iter().all(|output| self.function.graph().as_constant(*output) == Some(0.0))
    }

    /// The inputs of several bodies, those that are read.
    fn inputs_in_lanes(&self, on: &StatesInLanes<'_>) -> [[f64; LANES]; INPUTS] {
        let mut inputs = [[0.0; LANES]; INPUTS];
        inputs[0] = on.times;
        inputs[POSITION..ROTATION].copy_from_slice(&on.position);
        inputs[QUATERNION..VELOCITY].copy_from_slice(&on.orientation);
        inputs[VELOCITY..ANGULAR_VELOCITY].copy_from_slice(&on.velocity);
        inputs[ANGULAR_VELOCITY..MASS].copy_from_slice(&on.angular_velocity);
        if self.reads_rotation {
            let [x, y, z, w] = &on.orientation;
            for lane in 0..LANES {
                let (x, y, z, w) = (x[lane], y[lane], z[lane], w[lane]);
                let entries = [
                    [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
                    [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
                    [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
                ];
                for (row, entry) in inputs[ROTATION..QUATERNION].iter_mut().zip(entries.as_flattened()) {
                    row[lane] = *entry;
                }
            }
        }
        if self.reads_body {
            for (lane, body) in on.bodies().iter().enumerate() {
                inputs[MASS][lane] = body.mass();
                let tensor = body.inertia().tensor().transpose();
                for (row, entry) in inputs[INERTIA..].iter_mut().zip(&tensor) {
                    row[lane] = *entry;
                }
            }
        }
        inputs
    }

    /// The derivative of force and torque along a direction.
    fn slope(&self, inputs: &[f64; INPUTS], along: &[f64; INPUTS]) -> Wrench {
        let Ok(jacobian) = self.function.jacobian() else { return NAN };
        let made = || RefCell::new((jacobian.evaluator(), vec![0.0; self.entries.len()]));
        let (evaluator, values) = &mut *self.slopes.get_or(made).borrow_mut();
        if evaluator.evaluate(inputs, values).is_err() {
            return NAN;
        }
        let mut slope = [0.0; OUTPUTS];
        for (&(row, column), value) in self.entries.iter().zip(values) {
            slope[row] += *value * along[column];
        }
        wrench(&slope)
    }
}

/// What is not a number, where an evaluator does not take what it is given.
const NAN: Wrench = Wrench {
    force: Vector3::new(f64::NAN, f64::NAN, f64::NAN),
    torque: Vector3::new(f64::NAN, f64::NAN, f64::NAN),
};

fn wrench(outputs: &[f64; OUTPUTS]) -> Wrench {
    let vector = |first: usize| Vector3::from_column_slice(&outputs[first..first + 3]);
    Wrench { force: vector(0), torque: vector(3) }
}

fn put(into: &mut [f64; INPUTS], first: usize, numbers: &[f64]) {
    into[first..first + numbers.len()].copy_from_slice(numbers);
}

/// A matrix by rows.
fn put_matrix(into: &mut [f64; INPUTS], first: usize, matrix: &Matrix3<f64>) {
    put(into, first, matrix.transpose().as_slice());
}

fn inputs(t: f64, body: &RigidBody, x: &RigidBodyState) -> [f64; INPUTS] {
    let mut inputs = [0.0; INPUTS];
    inputs[0] = t;
    put(&mut inputs, POSITION, x.position().as_slice());
    put_matrix(&mut inputs, ROTATION, x.orientation().to_rotation_matrix().matrix());
    put(&mut inputs, QUATERNION, x.orientation().coords.as_slice());
    put(&mut inputs, VELOCITY, x.velocity().as_slice());
    put(&mut inputs, ANGULAR_VELOCITY, x.angular_velocity().as_slice());
    inputs[MASS] = body.mass();
    put_matrix(&mut inputs, INERTIA, body.inertia().tensor());
    inputs
}

impl force::ForceModel for ExpressionForce {
    fn wrench(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        let evaluator = self.values.get_or(|| RefCell::new(self.function.evaluator()));
        let mut outputs = [0.0; OUTPUTS];
        let evaluated = evaluator.borrow_mut().evaluate(&inputs(t, body, x), &mut outputs);
        evaluated.map_or(NAN, |()| wrench(&outputs))
    }
    fn add_in_lanes(&self, on: &StatesInLanes<'_>, sums: &mut WrenchesInLanes) {
        let evaluator = self.values.get_or(|| RefCell::new(self.function.evaluator()));
        let mut outputs = [[0.0; LANES]; OUTPUTS];
        let evaluated = evaluator.borrow_mut().evaluate_lanes(&self.inputs_in_lanes(on), &mut outputs);
        if evaluated.is_err() {
            outputs = [[f64::NAN; LANES]; OUTPUTS];
        }
        for (row, output) in sums.force.iter_mut().chain(&mut sums.torque).zip(&outputs) {
            row.iter_mut().zip(output).for_each(|(sum, x)| *sum += x);
        }
    }
    fn is_free(&self) -> bool {
        self.are_zero(self.function.outputs())
    }
    fn is_torque_free(&self) -> bool {
        self.are_zero(&self.function.outputs()[3..])
    }
    fn depends_on_velocity(&self) -> bool {
        self.entries.iter().any(|(_, column)| (VELOCITY..MASS).contains(column))
    }
    fn wrench_variation(
        &self,
        t: f64,
        body: &RigidBody,
        x: &RigidBodyState,
        along: &Tangent<Twist>,
    ) -> Wrench {
        let (q, turned) = (x.orientation(), along.displacement.angular);
        let mut direction = [0.0; INPUTS];
        put(&mut direction, POSITION, along.displacement.linear.as_slice());
        put_matrix(&mut direction, ROTATION, &(turned.cross_matrix() * q.to_rotation_matrix().matrix()));
        let half_turned = Quaternion::from_imag(turned * 0.5) * q.quaternion();
        put(&mut direction, QUATERNION, half_turned.coords.as_slice());
        put(&mut direction, VELOCITY, along.rate.linear.as_slice());
        put(&mut direction, ANGULAR_VELOCITY, along.rate.angular.as_slice());
        self.slope(&inputs(t, body, x), &direction)
    }
    fn mass_derivative(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        let mut direction = [0.0; INPUTS];
        direction[MASS] = 1.0;
        self.slope(&inputs(t, body, x), &direction)
    }
}

/// Force and torque of a function that `traced` has recorded.
///
/// It is evaluated without the interpreter, and its derivatives are exact.
///
/// Parameters
/// ----------
/// function : CompiledFunction
///     The recorded function, from the 33 numbers of time, state and body to force and torque.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> wind = somersault.forces.traced(lambda t, state: (0.1 * ((2.0, 1.0, 3.0) - state.velocity), (0, 0, 0)))
/// >>> force, torque = wind.wrench(0.0, somersault.RigidBody.sphere(1.0, 0.1), somersault.State())
/// >>> force
/// array([0.2, 0.1, 0.3])
#[pyclass(frozen, extends = ForceModel, module = "somersault.forces")]
pub(crate) struct TracedForce(ExpressionForce);

#[pymethods]
impl TracedForce {
    #[new]
    fn new(function: &Bound<'_, CompiledFunction>) -> Result<PyClassInitializer<Self>, Error> {
        Ok(build(ExpressionForce::try_new(function.get().function.clone())?, Self))
    }

    /// int: Instructions for force and torque in one state.
    #[getter]
    fn n_instructions(&self) -> usize {
        self.0.function.n_instructions()
    }

    fn __repr__(&self) -> String {
        format!("<TracedForce: {} instructions>", self.n_instructions())
    }
}
