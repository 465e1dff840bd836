//! The problem that collocation solves, with the derivatives that its state–costate system needs.

use super::rooms::Rooms;
use super::state_costate::{DifferentiatedProblem, ProblemDerivatives};
use super::{StateCostate, SystemError};
use nalgebra::DMatrix;
use somersault_expr::{Block, Evaluator, ExprError, ExprFunction, Expression, Graph};
use somersault_ocp::collocation::{CollocationError, Interval, Phase, PhaseBounds, Problem};

/// Dynamics, running cost and bounds of the controls of a [`Problem`], by expressions: f, ℓ and all derivatives of K = λᵀf + ℓ are
/// exact, and evaluated by tapes.
///
/// The problem has one phase, whose functions have expressions and do not name the time; its parameters are given. States and path
/// constraints are without bounds, and the ends without a cost: an extremal with them obeys other equations, those of
/// [`arcs`](somersault_ocp::arcs).
///
/// A formula over a generic scalar that branches on the value of a number is recorded as it is in the middle of the guess, and wrong
/// where it would take another branch. Functions that Python traced have no such branches.
#[derive(Debug)]
pub struct PosedProblem {
    n: usize,
    m: usize,
    bounds: PhaseBounds,
    names: [Vec<String>; 2],
    /// f, L and Φ as collocation takes them, without parameters.
    functions: [ExprFunction; 3],
    /// Row and column of each entry of ∂f/∂(x, u), and of ∂K_x/∂(x, u).
    places: [Vec<(usize, usize)>; 2],
    rooms: Rooms<Room>,
}

/// Tapes over (x, λ, u), with their memory.
struct Room {
    rate: Evaluator,
    cost: Evaluator,
    /// K, K_u, then the rows of K_uu.
    by_control: Evaluator,
    /// K_x.
    by_state: Evaluator,
    /// The entries of both derivatives.
    second: Evaluator,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
}

impl Room {
    /// What a tape makes of the inputs, NaN where it cannot.
    fn evaluate(tape: &mut Evaluator, inputs: &[f64], outputs: &mut [f64]) {
        if tape.evaluate(inputs, outputs).is_err() {
            outputs.fill(f64::NAN);
        }
    }
}

fn none(reason: impl Into<String>) -> SystemError {
    SystemError::NoStateCostate { reason: reason.into() }
}

fn is_bounded(interval: &Interval) -> bool {
    interval.lower.is_finite() || interval.upper.is_finite()
}

/// What the equations of extremals would have to take account of and do not, in a sentence: bounds, quaternions, free parameters.
fn hindrance(phase: &Phase) -> Option<String> {
    let (n, m, bounds) = (phase.n_states(), phase.n_controls(), phase.bounds());
    let states = bounds.state.iter().enumerate();
    let rows = states.chain(bounds.path.iter().enumerate().map(|(k, bound)| (n + m + k, bound)));
    let found = rows.into_iter().find(|(_, bound)| is_bounded(bound));
    found
        .map(|(row, _)| format!("`{}` has bounds", phase.name_of_row(row)))
        .or_else(|| bounds.end.iter().any(is_bounded).then(|| "it has end constraints".to_owned()))
        .or_else(|| {
            (!phase.quaternion_places().is_empty()).then(|| "quaternions are among its states".to_owned())
        })
        .or_else(|| {
            let free = bounds.parameters.iter().position(|bound| !bound.is_fixed());
            free.map(|k| format!("parameter {k} is not given"))
        })
}

/// Whether an expression reads any of the inputs.
fn reads(
    function: &ExprFunction,
    outputs: &[Expression],
    mut inputs: impl Iterator<Item = usize>,
) -> Result<bool, ExprError> {
    let evaluator =
        ExprFunction::new(function.graph().clone(), function.blocks().to_vec(), outputs.to_vec())?
            .evaluator();
    Ok(inputs.any(|input| evaluator.reads(input)))
}

impl PosedProblem {
    /// Records the functions of a problem and differentiates them.
    pub fn try_new(problem: &Problem) -> Result<Self, SystemError> {
        let [phase] = problem.phases() else { return Err(none("it has several phases")) };
        if let Some(reason) = hindrance(phase) {
            return Err(none(reason));
        }
        let functions = phase.expressions_of_guess().ok_or_else(|| none("it has no guess"))?;
        let [dynamics, path, ends] = functions.map_err(|error| none(error.to_string()))?;
        let (n, m, bounds) = (phase.n_states(), phase.n_controls(), phase.bounds().clone());
        if m == 0 {
            return Err(none("it has no controls"));
        }
        let time = n + m + bounds.parameters.len();
        for (what, function) in [("dynamics", &dynamics), ("running cost", &path)] {
            let outputs = if what == "dynamics" { function.outputs() } else { &function.outputs()[..1] };
            if reads(function, outputs, time..=time)? {
                return Err(none(format!("its {what} depends on time")));
            }
        }
        if reads(&ends, &ends.outputs()[..1], 0..ends.n_inputs())? {
            return Err(none("it has an end cost"));
        }
        let parameters: Vec<f64> = bounds.parameters.iter().map(|bound| bound.lower).collect();
        let recorded = Recorded::new([&dynamics, &path], [n, m], &parameters)?;
        let names = [0..n, n..n + m].map(|rows| rows.map(|row| phase.name_of_row(row)).collect());
        let functions = functions_of([&dynamics, &path], [n, m], &parameters)?;
        let Recorded { tapes: [rate, cost, by_control, by_state, second], places } = recorded;
        let rooms = Rooms::new(|| Room {
            rate: rate.evaluator(),
            cost: cost.evaluator(),
            by_control: by_control.evaluator(),
            by_state: by_state.evaluator(),
            second: second.evaluator(),
            inputs: vec![0.0; 2 * n + m],
            outputs: vec![0.0; second.n_outputs().max(1 + m + m * m)],
        });
        Ok(Self { n, m, bounds, names, functions, places, rooms })
    }

    /// x(t₀) as the problem has it, none where free. Fails where a state lies between bounds.
    pub fn initial_state(&self) -> Result<Vec<Option<f64>>, SystemError> {
        self.end("initial", &self.bounds.initial_state)
    }

    /// x(t_f), likewise.
    pub fn final_state(&self) -> Result<Vec<Option<f64>>, SystemError> {
        self.end("final", &self.bounds.final_state)
    }

    fn end(&self, name: &str, bounds: &[Interval]) -> Result<Vec<Option<f64>>, SystemError> {
        let each = bounds.iter().zip(&self.names[0]);
        each.map(|(bound, state)| match (bound.is_fixed(), is_bounded(bound)) {
            (true, _) => Ok(Some(bound.lower)),
            (false, false) => Ok(None),
            (false, true) => Err(none(format!("`{state}` of the {name} state is neither given nor free"))),
        })
        .collect()
    }

    /// The duration as the problem has it. Fails where a time is not given.
    pub fn horizon(&self) -> Result<f64, SystemError> {
        let PhaseBounds { initial_time, final_time, .. } = &self.bounds;
        if initial_time.is_fixed() && final_time.is_fixed() {
            Ok(final_time.lower - initial_time.lower)
        } else {
            Err(none("its duration is not given"))
        }
    }

    /// The problem between other ends, over another duration, for collocation.
    pub(crate) fn between(
        &self,
        [initial, last]: [&[Option<f64>]; 2],
        horizon: f64,
    ) -> Result<Problem, CollocationError> {
        let [dynamics, path, ends] = &self.functions;
        let of = |end: &[Option<f64>]| -> Vec<Interval> {
            end.iter().map(|x| x.map_or(Interval::FREE, Interval::fixed)).collect()
        };
        let phase = Phase::try_traced([dynamics, path, ends], self.m, 0)?
            .names(self.names[0].clone(), self.names[1].clone())
            .control_bounds(self.bounds.control.clone())
            .initial_state(of(initial))
            .final_state(of(last))
            .horizon(0.0, horizon);
        Problem::try_new(phase)
    }

    /// Evaluates in the room of this thread at a point.
    fn at<T>(&self, [x, costate, u]: [&[f64]; 3], work: impl FnOnce(&mut Room) -> T) -> T {
        let n = self.n;
        self.rooms.at(|room| {
            room.inputs[..n].copy_from_slice(x);
            room.inputs[n..2 * n].copy_from_slice(costate);
            room.inputs[2 * n..].copy_from_slice(u);
            work(room)
        })
    }
}

impl StateCostate<PosedProblem> {
    /// The state–costate system of a problem of collocation.
    pub fn of_problem(problem: &Problem) -> Result<Self, SystemError> {
        Self::try_new(PosedProblem::try_new(problem)?)
    }
}

/// Functions of (x, λ, u).
struct Recorded {
    tapes: [ExprFunction; 5],
    places: [Vec<(usize, usize)>; 2],
}

impl Recorded {
    fn new(
        [dynamics, path]: [&ExprFunction; 2],
        [n, m]: [usize; 2],
        parameters: &[f64],
    ) -> Result<Self, ExprError> {
        let mut graph = Graph::new();
        let inputs: Vec<Expression> = (0..2 * n + m).map(|_| graph.input()).collect();
        let (states, costates, controls) = (&inputs[..n], &inputs[n..2 * n], &inputs[2 * n..]);
        let time = graph.constant(0.0);
        let arguments = arguments_of(&mut graph, states, controls, parameters, time);
        let rates = graph.insert(dynamics.graph(), dynamics.outputs(), &arguments)?;
        let cost = graph.insert(path.graph(), &path.outputs()[..1], &arguments)?[0];
        let mut k = cost;
        for (&costate, &rate) in costates.iter().zip(&rates) {
            let product = graph.multiply(costate, rate);
            k = graph.add(k, product);
        }
        let by_state = graph.gradient(k, states)?;
        let slopes = graph.gradient(k, controls)?;
        let mut by_control = vec![k];
        by_control.extend(&slopes);
        for &slope in &slopes {
            by_control.extend(graph.gradient(slope, controls)?);
        }
        let with = [states, controls].concat();
        let (of_rates, mut second) = graph.jacobian(&rates, &with)?;
        let (of_slopes, entries) = graph.jacobian(&by_state, &with)?;
        second.extend(entries);
        let function = |outputs| {
            ExprFunction::new(graph.clone(), vec![Block::new("arguments", [inputs.len()])], outputs)
        };
        Ok(Self {
            tapes: [
                function(rates)?,
                function(vec![cost])?,
                function(by_control)?,
                function(by_state)?,
                function(second)?,
            ],
            places: [of_rates.entries().collect(), of_slopes.entries().collect()],
        })
    }
}

/// (x, u, p, t).
fn arguments_of(
    graph: &mut Graph,
    states: &[Expression],
    controls: &[Expression],
    parameters: &[f64],
    time: Expression,
) -> Vec<Expression> {
    let parameters = parameters.iter().map(|&p| graph.constant(p)).collect::<Vec<_>>();
    [states, controls, &parameters, &[time]].concat()
}

/// f and L over (x, u, t), and no cost of the ends.
fn functions_of(
    [dynamics, path]: [&ExprFunction; 2],
    [n, m]: [usize; 2],
    parameters: &[f64],
) -> Result<[ExprFunction; 3], ExprError> {
    let of = |function: &ExprFunction, outputs: &[Expression]| {
        let mut graph = Graph::new();
        let inputs: Vec<Expression> = (0..n + m + 1).map(|_| graph.input()).collect();
        let arguments = arguments_of(&mut graph, &inputs[..n], &inputs[n..n + m], parameters, inputs[n + m]);
        let outputs = graph.insert(function.graph(), outputs, &arguments)?;
        ExprFunction::new(graph, vec![Block::new("point", [n + m + 1])], outputs)
    };
    let mut graph = Graph::new();
    (0..2 * n + 2).for_each(|_| {
        graph.input();
    });
    let nothing = graph.constant(0.0);
    let ends = ExprFunction::new(graph, vec![Block::new("ends", [2 * n + 2])], vec![nothing])?;
    Ok([of(dynamics, dynamics.outputs())?, of(path, &path.outputs()[..1])?, ends])
}

impl DifferentiatedProblem for PosedProblem {
    fn sizes(&self) -> [usize; 2] {
        [self.n, self.m]
    }

    fn rate_into(&self, x: &[f64], u: &[f64], f: &mut [f64]) {
        // f does not read the costates
        self.at([x, x, u], |Room { rate, inputs, .. }| Room::evaluate(rate, inputs, f));
    }

    fn cost(&self, x: &[f64], u: &[f64]) -> f64 {
        let mut value = [0.0];
        self.at([x, x, u], |Room { cost, inputs, .. }| Room::evaluate(cost, inputs, &mut value));
        value[0]
    }

    fn by_control_into(
        &self,
        x: &[f64],
        costate: &[f64],
        u: &[f64],
        gradient: &mut [f64],
        hessian: &mut DMatrix<f64>,
    ) -> f64 {
        let m = self.m;
        self.at([x, costate, u], |Room { by_control, inputs, outputs, .. }| {
            let outputs = &mut outputs[..1 + m + m * m];
            Room::evaluate(by_control, inputs, outputs);
            gradient.copy_from_slice(&outputs[1..=m]);
            hessian.copy_from_slice(&outputs[1 + m..]);
            outputs[0]
        })
    }

    fn by_state_into(&self, x: &[f64], costate: &[f64], u: &[f64], slope: &mut [f64]) {
        self.at([x, costate, u], |Room { by_state, inputs, .. }| Room::evaluate(by_state, inputs, slope));
    }

    fn derivatives(&self, x: &[f64], costate: &[f64], u: &[f64]) -> ProblemDerivatives {
        let (n, m) = (self.n, self.m);
        let mut d = ProblemDerivatives {
            f_x: DMatrix::zeros(n, n),
            f_u: DMatrix::zeros(n, m),
            k_xx: DMatrix::zeros(n, n),
            k_xu: DMatrix::zeros(n, m),
        };
        let [of_rates, of_slopes] = &self.places;
        self.at([x, costate, u], |Room { second, inputs, outputs, .. }| {
            let outputs = &mut outputs[..of_rates.len() + of_slopes.len()];
            Room::evaluate(second, inputs, outputs);
            let (rates, slopes) = outputs.split_at(of_rates.len());
            let both =
                [(of_rates, rates, &mut d.f_x, &mut d.f_u), (of_slopes, slopes, &mut d.k_xx, &mut d.k_xu)];
            for (places, entries, by_x, by_u) in both {
                for (&(row, column), &entry) in places.iter().zip(entries) {
                    match column.checked_sub(n) {
                        None => by_x[(row, column)] = entry,
                        Some(control) => by_u[(row, control)] = entry,
                    }
                }
            }
        });
        d
    }

    fn control_bounds(&self) -> [Vec<f64>; 2] {
        let of = |bound: fn(&Interval) -> f64| self.bounds.control.iter().map(bound).collect();
        [of(|interval| interval.lower), of(|interval| interval.upper)]
    }
}
