//! Bad input gives an error that names it; trouble in a search gives a status and the best motion.

use nalgebra::DMatrix;
use somersault_core::Scalar;
use somersault_core::argument::ArgumentError;
use somersault_multibody::models::CartPendulum;
use somersault_nlp::{EvaluationError, Flow, Sqp, Status};
use somersault_ocp::collocation::{
    Collocation, CollocationError, CollocationStatus, Dynamics, End, Entry, Guess, Interval, Linkage, Mesh,
    Phase, Place, Point, Problem, Quantity, SearchError, Terms, Transcription, TreeDynamics, VectorFunction,
};

/// ẋ = u, cost ∫ u² dt.
struct Line;

impl Dynamics for Line {
    fn n_states(&self) -> usize {
        1
    }
    fn n_controls(&self) -> usize {
        1
    }
    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        rates[0] = at.control[0];
    }
}

impl Terms for Line {
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        at.control[0] * at.control[0]
    }
}

fn line() -> Phase {
    Phase::new(Line, Line).initial_state([0.0]).final_state([1.0])
}

fn mesh() -> Mesh {
    Mesh::try_uniform(2, 3).unwrap()
}

fn refused(phase: Phase) -> CollocationError {
    Problem::try_new(phase).err().expect("bad input was taken")
}

#[test]
fn bad_bounds_are_refused_by_name() {
    use CollocationError as E;
    let cases = [
        (line().state_bounds([Interval::new(1.0, 0.0)]), "state_bounds"),
        (line().control_bounds([Interval::new(f64::NAN, 0.0)]), "control_bounds"),
        (line().initial_state([f64::NAN]), "initial_state"),
        (line().final_state([f64::INFINITY]), "final_state"),
    ];
    for (phase, name) in cases {
        let error = refused(phase);
        assert!(matches!(error, E::Bounds { .. }), "{error}");
        assert!(error.to_string().contains(name), "{error}");
    }
    assert!(matches!(refused(line().initial_state([0.0, 1.0])), E::Length { expected: 1, found: 2, .. }));
    assert!(matches!(refused(line().path_bounds([Interval::FREE])), E::Length { expected: 0, found: 1, .. }));
    let outside = line().state_bounds([Interval::new(0.0, 0.5)]);
    assert!(matches!(
        refused(outside),
        E::BoundaryOutside { argument: "final_state", entry: Entry { index: 0, .. }, .. }
    ));
    assert!(matches!(refused(line().horizon(1.0, 0.5)), E::Horizon { .. }));
    assert!(matches!(
        refused(line().scales([0.0], [1.0])),
        E::Argument(ArgumentError::NotPositive { argument: "scales", .. })
    ));
    assert!(matches!(Problem::try_of_phases(Vec::new(), Vec::new()), Err(E::NoPhase)));
    let place = |quantity| Place { phase: 0, end: End::Start, quantity };
    let link = Linkage {
        left: place(Quantity::State(0)),
        right: place(Quantity::State(1)),
        difference: Interval::FREE,
    };
    assert!(matches!(Problem::try_of_phases(vec![line()], vec![link]), Err(E::Linkage { linkage: 0, .. })));
}

#[test]
fn a_problem_whose_bounds_leave_nothing_free_is_refused() {
    let still = || line().final_state([0.0]).state_bounds([Interval::fixed(0.0)]);
    let resting = || still().control_bounds([Interval::fixed(0.0)]);
    assert!(matches!(refused(resting()), CollocationError::NothingFree));
    for phases in [vec![resting(), still()], vec![resting().horizon(0.0, Interval::new(1.0, 2.0))]] {
        assert!(Problem::try_of_phases(phases, Vec::new()).is_ok());
    }
    // one point of one interval has the ends for all its states
    let mut problem = Problem::try_new(line().control_bounds([Interval::fixed(0.0)])).unwrap();
    let coarse = [Mesh::try_uniform(1, 1).unwrap()];
    assert!(matches!(Transcription::try_new(&mut problem, &coarse), Err(CollocationError::NothingFree)));
    assert!(Transcription::try_new(&mut problem, &[mesh()]).is_ok());
}

#[test]
fn bad_guesses_are_refused_by_name() {
    let guess = |times: &[f64], state: f64| Guess {
        times: times.to_vec(),
        states: vec![vec![state]; 2],
        controls: vec![vec![0.0]; 2],
        parameters: Vec::new(),
    };
    use CollocationError as E;
    assert!(matches!(refused(line().guess(guess(&[1.0, 0.0], 0.0))), E::GuessTimes { entry: 1, .. }));
    assert!(matches!(refused(line().guess(guess(&[0.0, 1.0], f64::NAN))), E::NonFinite { .. }));
    assert!(matches!(
        refused(line().guess(guess(&[0.0, 0.5, 1.0], 0.0))),
        E::Length { expected: 3, found: 2, .. }
    ));
}

#[test]
fn bad_meshes_and_options_are_refused() {
    assert!(Mesh::try_uniform(0, 3).is_err());
    assert!(Mesh::try_uniform(3, 0).is_err());
    for bounds in [vec![0.0, 0.5], vec![0.0, 0.6, 0.5, 1.0], vec![0.0, f64::NAN, 1.0], vec![0.1, 1.0]] {
        let points = vec![3; bounds.len() - 1];
        assert!(Mesh::try_new(bounds, points).is_err());
    }
    let mut problem = Problem::try_new(line()).unwrap();
    assert!(matches!(Transcription::try_new(&mut problem, &[]), Err(CollocationError::Length { .. })));
    for collocation in [
        Collocation { tolerance: f64::NAN, ..Collocation::default() },
        Collocation { max_meshes: 0, ..Collocation::default() },
        Collocation { min_points: 9, max_points: 8, ..Collocation::default() },
    ] {
        assert!(collocation.solve(&mut problem, &[mesh()], &mut |_| Flow::Continue).is_err());
    }
}

#[test]
fn degrees_of_freedom_that_are_none_or_come_twice_are_refused() {
    let cart = CartPendulum::default().model().unwrap();
    for actuated in [[0, 0], [0, 2]] {
        assert!(matches!(
            TreeDynamics::try_new(&cart, &actuated),
            Err(CollocationError::Actuated { n: 2, .. })
        ));
    }
}

/// A function that fails, or has no value, from a number of calls on.
struct Failing {
    left: usize,
    error: fn() -> EvaluationError,
}

impl VectorFunction for Failing {
    fn n_outputs(&self) -> usize {
        1
    }
    fn evaluate(&mut self, arguments: &[f64], values: &mut [f64]) -> Result<(), EvaluationError> {
        self.left = self.left.checked_sub(1).ok_or_else(self.error)?;
        values[0] = arguments[1].sin() * arguments[1];
        Ok(())
    }
    fn jacobian(&mut self, arguments: &[f64], jacobian: &mut DMatrix<f64>) -> Result<(), EvaluationError> {
        jacobian.fill(0.0);
        jacobian[(0, 1)] = arguments[1].cos() * arguments[1] + arguments[1].sin();
        Ok(())
    }
    fn add_hessian(
        &mut self,
        u: &[f64],
        weights: &[f64],
        hessian: &mut DMatrix<f64>,
    ) -> Result<(), EvaluationError> {
        hessian[(1, 1)] += weights[0] * (2.0 * u[1].cos() - u[1].sin() * u[1]);
        Ok(())
    }
}

#[test]
fn errors_of_the_user_come_out() {
    let error = || EvaluationError::Failed("the user's own words".into());
    for left in [0, 10] {
        let dynamics = Box::new(Failing { left, error });
        let phase = Phase::with_derivatives(dynamics, 1, 0, Line).initial_state([0.0]).final_state([1.0]);
        let mut problem = Problem::try_new(phase).unwrap();
        let failed =
            Collocation::default().solve(&mut problem, &[mesh()], &mut |_| Flow::Continue).unwrap_err();
        assert!(failed.to_string().contains("the user's own words"), "{failed}");
        let SearchError::Failed { report, .. } = failed else { panic!("{failed:?}") };
        assert_eq!(report.status, CollocationStatus::NotSolved(Status::Failed));
        assert!(report.phases[0].states.iter().flatten().all(|x| x.is_finite()));
    }
}

#[test]
fn a_guess_without_a_value_is_an_error_that_says_so() {
    let error = || EvaluationError::Undefined { what: "the rate".into() };
    let phase =
        Phase::with_derivatives(Box::new(Failing { left: 0, error }), 1, 0, Line).initial_state([0.0]);
    let mut problem = Problem::try_new(phase).unwrap();
    let failed = Collocation::default().solve(&mut problem, &[mesh()], &mut |_| Flow::Continue).unwrap_err();
    let SearchError::Collocation(failed) = failed else { panic!("{failed:?}") };
    assert!(matches!(failed, CollocationError::Evaluation(EvaluationError::Undefined { .. })), "{failed:?}");
}

#[test]
fn limits_and_stops_are_statuses_with_the_best_motion() {
    let solver = Sqp { max_iterations: 0, ..Sqp::default() };
    let mut problem = Problem::try_new(line()).unwrap();
    let limited = Collocation { solver, ..Collocation::default() };
    let report = limited.solve(&mut problem, &[mesh()], &mut |_| Flow::Continue).unwrap();
    assert_eq!(report.status, CollocationStatus::NotSolved(Status::IterationLimit));
    assert_eq!(report.phases[0].states.len(), 7);
    let stopped = Collocation::default().solve(&mut problem, &[mesh()], &mut |_| Flow::Stop).unwrap();
    assert_eq!(stopped.status, CollocationStatus::NotSolved(Status::Stopped));
    // |u| ≤ ½ does not reach 1 in a second
    let phase = line().control_bounds([Interval::new(-0.5, 0.5)]);
    let mut problem = Problem::try_new(phase).unwrap();
    let report = Collocation::default().solve(&mut problem, &[mesh()], &mut |_| Flow::Continue).unwrap();
    assert_eq!(report.status, CollocationStatus::NotSolved(Status::Infeasible), "{:?}", report.history);
}

/// A path constraint that is announced and not written.
struct Forgotten;

impl Terms for Forgotten {
    fn n_path_constraints(&self) -> usize {
        1
    }
}

#[test]
fn a_constraint_that_is_not_written_is_no_zero() {
    let phase = Phase::new(Line, Forgotten).path_bounds([Interval::new(-1.0, 1.0)]);
    let mut problem = Problem::try_new(phase).unwrap();
    let failed = Collocation::default().solve(&mut problem, &[mesh()], &mut |_| Flow::Continue).unwrap_err();
    assert!(failed.to_string().contains("path constraint"), "{failed}");
}

/// ẍ = u, cost ∫ u² dt, with x twice as a path constraint.
struct Block;

impl Dynamics for Block {
    fn n_states(&self) -> usize {
        2
    }
    fn n_controls(&self) -> usize {
        1
    }
    fn rates<T: Scalar>(&self, at: &Point<'_, T>, rates: &mut [T]) {
        rates[0] = at.state[1];
        rates[1] = at.control[0];
    }
}

impl Terms for Block {
    fn n_path_constraints(&self) -> usize {
        2
    }
    fn path_constraints<T: Scalar>(&self, at: &Point<'_, T>, values: &mut [T]) {
        values.fill(at.state[0]);
    }
    fn running_cost<T: Scalar>(&self, at: &Point<'_, T>) -> T {
        at.control[0] * at.control[0]
    }
}

#[test]
fn motions_that_contradict_their_constraints_are_infeasible() {
    let (least, most) = (Interval::at_least(0.5), Interval::at_most(0.2));
    // between two bounds that exclude each other; and below ½ until the last point, without the speed to be at 1 then
    for path in [[least, most], [Interval::FREE, Interval::at_most(0.5)]] {
        let phase = Phase::new(Block, Block)
            .initial_state([0.0, 0.0])
            .final_state([1.0, 0.0])
            .state_bounds([Interval::FREE, Interval::new(-3.0, 3.0)])
            .path_bounds(path);
        let mut problem = Problem::try_new(phase).unwrap();
        let mesh = Mesh::try_uniform(40, 4).unwrap();
        let report = Collocation::default().solve(&mut problem, &[mesh], &mut |_| Flow::Continue).unwrap();
        assert_eq!(report.status, CollocationStatus::NotSolved(Status::Infeasible), "{:?}", report.history);
        assert!(report.program.residuals.feasibility > 0.1, "{:?}", report.program.residuals);
        // of the interior-point method, and of sequential quadratic programming where it has no solution
        assert!(report.program.iterations < 200, "{:?}", report.history);
    }
}
