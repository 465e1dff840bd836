//! The front door: integration of one body or of several.

use crate::core::callable::{Failure, callable_name, check_callable, noted};
use crate::core::convert::{integer, integer_or_none, interval_of};
use crate::core::error::Error;
use crate::core::waiting::returns_interrupted;
use crate::integrators::forces::models::Reader;
use crate::integrators::methods;
use crate::integrators::monitor::{Finish, Monitor, ProgressBar, Watch};
use crate::integrators::plan::{self, Plan, StepArguments, start_up_of};
use crate::integrators::problem::{Problem, Stretches, Use};
use crate::integrators::seen::Seen;
use crate::integrators::solve::{Bodies, Ended};
use crate::integrators::trajectory::{Cast, Given, Report, Solution};
use crate::integrators::watching::EventFunctions;
use pyo3::prelude::*;
use somersault::integrators::events::Location;
use somersault::integrators::methods::{Method, Options};
use somersault::integrators::state::State;

/// Why a run with contacts goes forwards.
pub(crate) const FORWARD_WITH_CONTACTS: &str = "`interval` must run forward where there are contacts: they dissipate, and many motions lead to one state";

/// A run as Python asks for it.
struct Requested<'py> {
    py: Python<'py>,
    cast: Cast,
    /// But for whether forces call Python.
    plan: Plan,
    observer: Option<Py<PyAny>>,
    events: Option<EventFunctions>,
    progress: bool,
    failure: Failure,
    given: Given,
}

impl Use for Requested<'_> {
    type Output = Py<Solution>;

    fn with<B: Bodies>(
        self,
        bodies: B,
        initial: State<B::Configuration>,
        calls_python: bool,
    ) -> Result<Py<Solution>, Error> {
        let Self { py, cast, plan, observer, events, progress, failure, given } = self;
        let plan = Plan { calls_python, ..plan };
        let (start, end) = plan.interval();
        let bar = if progress { Some(ProgressBar::open(py, start, end)?) } else { None };
        let watch = observer.map(|observer| -> Watch<B::Configuration> {
            let name = callable_name(observer.bind(py));
            Box::new(move |py, t, x| {
                let answer = observer.call1(py, (t, B::Configuration::to_python(py, x)?));
                let answer = noted(py, answer, || format!("the observer {name} at t = {t}"))?;
                answer.bind(py).is_truthy()
            })
        });
        let monitor = Monitor::try_new(&plan, &initial, 13 * cast.bodies.len(), watch, bar, failure)?;
        let mut monitor = monitor.looking_for(py, events, || {
            Box::new(|py, t, x| Ok((t, B::Configuration::to_python(py, x)?).into_pyobject(py)?.unbind()))
        });
        let Ended { status, rejected, events } =
            monitor.supervise(py, &plan, |monitor| bodies.solve(&initial, &plan, monitor))?;
        let nfev = bodies.evaluations(&plan, monitor.steps + rejected);
        let Finish { recorded, curves, watched, steps, status, message, failed } = monitor.finish(py, status);
        let report = Report { status, message, nfev, n_steps: steps, n_rejected: rejected };
        let curves = plan.dense.then_some(curves);
        let solution = Solution::create(py, cast, recorded, curves, watched, report, events, given)?;
        plan.deliver(py, failed, solution)
    }
}

/// Motion of one rigid body, or of several, under forces.
///
/// Integrates m r̈ = F, Ṙ = ω̂ R and I ω̇ = M − ω × I ω from `state` over `interval`, with a fixed step
/// `dt` or, where `dt` is left out, with steps adapted to `rtol` and `atol`: by an estimate of the method's own, or, for other
/// one-step methods, by step doubling.
///
/// Parameters
/// ----------
/// body : RigidBody or sequence of RigidBody
///     The body, or the bodies.
/// state : State or sequence of State
///     State at the start, one for each body.
/// interval : tuple of float
///     Start and end time, s. Where the end is before the start the motion is followed back in time, under forces without contacts.
/// dt : float, optional
///     Step, s. Where it does not divide the interval the last step is shorter.
/// method : str or MethodInfo, optional
///     A method of the table that `somersault.methods` returns; ``"rkmk"`` unless given, or ``"rkmk8_b"``
///     where the steps are adapted.
/// forces : force model, callable, or sequence of them, optional
///     What acts on the body; the models of a sequence add up. A callable ``f(t, state)`` returns force
///     and torque about the centre of mass, world frame. For several bodies a sequence has one entry
///     for each of them, itself a model, a sequence or None; a single model acts on every body.
/// interaction : Gravitation or callable, optional
///     What acts between several bodies. A callable ``f(t, states)`` returns forces and torques, each of
///     shape (bodies, 3).
/// contacts : Contact or sequence of Contact, optional
///     Where the body touches surfaces. For several bodies a sequence has one entry for each of them,
///     itself a contact, a sequence or None.
/// pairs : SpherePair or sequence of SpherePair, optional
///     Where several bodies touch each other.
/// stretches : {'loaded'} or array_like, shape (contacts, 3), optional
///     Stretches of the friction of the contacts at the start, m, world frame; those of pairs follow those of
///     surfaces. ``'loaded'`` lets them carry the load as far as friction can, so that a body at rest on a
///     slope stays at rest from the start. Unstretched unless given.
/// locate : bool, optional
///     Whether to cut steps where a contact begins or ends, so that the method keeps its order, and to log
///     these events. Otherwise the forces of contacts switch within steps.
/// max_event_rate : float, optional
///     Most events per second and contact, averaged over the last 64, 1e9 unless given; more are an error.
/// keep_events : bool, optional
///     Whether to keep the events; they are counted in any case.
/// graze : float, optional
///     Depth below which a hit on a rim or on a surface without a known `concavity` may be missed, m; 1e-6 unless
///     given. Hits on all others are found whatever their depth.
/// max_substeps : int or None, optional
///     Most parts that a fixed step is divided into for the contacts closed; 100 000 unless given. 1 refuses steps
///     that are too long for a contact with `IntegrationError`; None makes steps as they are given, for studies of
///     methods.
/// rtol, atol : float, optional
///     Relative and absolute tolerance of an adaptive step, 1e-8 and 1e-10 unless given. Each vector is
///     weighed by its length; an orientation counts as one radian.
/// max_step, first_step : float, optional
///     Largest and first step of an adaptive run, s.
/// max_steps : int, optional
///     Largest number of steps of an adaptive run, 10 million unless given.
/// start_up : {'one_step', 'ladder'}, optional
///     How the Adams methods make their first steps: by a one-step method of order 4, or by their own
///     family with as many steps as there are.
/// dense_output : bool, optional
///     Whether to keep the curves between the steps, for ``solution.sol(t)``.
/// t_eval : array_like, shape (n,), optional
///     Times of the states to record, s, within the interval and in the direction of the run, each once; the states after
///     every step unless given. They do not change the steps: the states are read from the curve of a step where that is of the order
///     of the method (`MethodInfo.dense_order`), and otherwise the method makes the step to each of them. A run that ends early has
///     those up to its end.
/// events : callable or sequence of callable, optional
///     Functions ``event(t, state) -> float`` of which changes of sign are looked for, ``event(t, states)`` for several bodies. A
///     function may have attributes as in SciPy: with ``terminal`` true the run ends at its first event, with a number n at the n-th;
///     with ``direction`` 1 only changes from negative to positive along the run are events, with -1 only those from positive to
///     negative. With ``lipschitz`` a bound L of \|dg/dt\| along the motion, in the unit of the function per second, none is missed. The
///     attributes `t_events` and `y_events` of the solution have the events, `certified` whether none can have been missed. See the notes.
/// every : int, optional
///     Record every so many steps. The last is always recorded.
/// observer : callable, optional
///     ``f(t, state)``, called after every step; the run stops where it returns something true.
/// on_interrupt : {'raise', 'return'}, optional
///     At Ctrl-C, raise KeyboardInterrupt or return what was recorded with status −1.
/// progress : bool, optional
///     Whether to show a progress bar, for which tqdm must be installed.
///
/// Returns
/// -------
/// Solution
///     Times, states and what is derived from them.
///
/// Raises
/// ------
/// InputError
///     If an argument is not allowed: no method has this name, the method accepts no torque, or a surface is not fit to be
///     touched, which may be found on the way.
/// IntegrationError
///     If the run cannot continue: the state stopped being finite, a tolerance cannot be met, the equation
///     of an implicit step was not solved, events follow each other too fast (`ChatteringError`), a step is too long for a
///     contact or the method gains energy in it.
///
/// Notes
/// -----
/// Events of functions are located as those of contacts are: the method makes the step again up to the event, so that its time has
/// the accuracy of the method. Other events than terminal ones leave the steps as they are. A step at whose ends a function has the
/// same sign is searched where its values and rates there suggest that it goes through zero and comes back. A zero at the start is no
/// event, a zero at the end of a step one, and a touch without a crossing none. Functions are called about three times a step, also
/// at states a little off the motion, and a few dozen times for each event. What one returns must be finite.
///
/// A function with a bound L (``lipschitz``) has no zero between two times h apart where \|g\| at one and \|g\| at the other exceed L h
/// together. A step of which this does not hold is divided until it holds of all its parts, which takes about 35 L / \|dg/dt\| parts
/// before an event and as many after it. Where 20 000 parts do not suffice, as for a function that touches zero, `certified` is False and
/// `unproved` has the step. A bound that two values contradict raises InputError.
///
/// Backwards in time any method makes the steps that it would make with a negative step: it integrates forwards under forces of reversed
/// time, and with reversed velocities.
///
/// Other Python threads run meanwhile unless a callable is given. What a callable raises stops the run
/// and comes out as it is. Every exception that stops a run has what was recorded before in its attribute
/// `solution`.
///
/// Examples
/// --------
/// >>> import somersault
/// >>> body = somersault.RigidBody.box(1.0, (0.2, 0.4, 0.6))
/// >>> start = somersault.State(velocity=(0.0, 0.0, 5.0), angular_velocity=(0.0, 8.0, 0.1))
/// >>> gravity = somersault.forces.Gravity()
/// >>> motion = somersault.integrate(body, start, (0.0, 1.0), dt=0.01, forces=gravity)
/// >>> motion.position.shape
/// (101, 3)
/// >>> round(float(motion.position[-1, 2]), 6)
/// 0.095
///
/// The highest point, and the end at a height of 1 m on the way down:
///
/// >>> def top(t, state):
/// ...     return state.velocity[2]
/// >>> def down(t, state):
/// ...     return state.position[2] - 1.0
/// >>> down.terminal, down.direction = True, -1
/// >>> motion = somersault.integrate(body, start, (0.0, 2.0), dt=0.01, forces=gravity, events=[top, down])
/// >>> motion.status, [times.round(6) for times in motion.t_events]
/// (1, [array([0.509684]), array([0.746125])])
///
/// States at given times, on the way back from there:
///
/// >>> back = somersault.integrate(body, motion[-1], (motion.t[-1], 0.0), forces=gravity, t_eval=[0.5, 0.0])
/// >>> bool(abs(back.position[-1] - start.position).max() < 1e-9)
/// True
#[pyfunction]
#[pyo3(signature = (
    body, state, interval, *, dt=None, method=None, forces=None, interaction=None, contacts=None, pairs=None, stretches=None, locate=true,
    max_event_rate=1e9, keep_events=true, graze=1e-6, max_substeps=Some(100_000), rtol=None, atol=None, max_step=None, first_step=None, max_steps=None, start_up="one_step", dense_output=false, t_eval=None, events=None, every=1,
    observer=None, on_interrupt="raise", progress=false
))]
pub(crate) fn integrate<'py>(
    py: Python<'py>,
    body: &Bound<'py, PyAny>,
    state: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = interval_of)] interval: [f64; 2],
    dt: Option<f64>,
    method: Option<&Bound<'py, PyAny>>,
    forces: Option<&Bound<'py, PyAny>>,
    interaction: Option<&Bound<'py, PyAny>>,
    contacts: Option<&Bound<'py, PyAny>>,
    pairs: Option<&Bound<'py, PyAny>>,
    stretches: Option<&Bound<'py, PyAny>>,
    locate: bool,
    max_event_rate: f64,
    keep_events: bool,
    graze: f64,
    #[pyo3(from_py_with = integer_or_none)] max_substeps: Option<i64>,
    rtol: Option<f64>,
    atol: Option<f64>,
    max_step: Option<f64>,
    first_step: Option<f64>,
    #[pyo3(from_py_with = integer_or_none)] max_steps: Option<i64>,
    start_up: &str,
    dense_output: bool,
    t_eval: Option<&Bound<'py, PyAny>>,
    events: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = integer)] every: i64,
    observer: Option<Bound<'py, PyAny>>,
    on_interrupt: &str,
    progress: bool,
) -> Result<Py<Solution>, Error> {
    let interval = (interval[0], interval[1]);
    let cast = Cast::extract("body", body)?;
    let initial = cast.states("state", state)?;
    let default = if dt.is_some() { Method::Rkmk } else { Method::Rkmk8B };
    let method = method.map_or(Ok(default), |m| methods::extract("method", m))?;
    let options = Options { start_up: start_up_of(start_up)? };
    let arguments = StepArguments { dt, rtol, atol, max_step, first_step, max_steps };
    let (steps, backwards) = arguments.either_way(method, interval)?;
    let (t_eval, every) = plan::kept(t_eval, every)?;
    let return_interrupted = returns_interrupted(on_interrupt)?;
    if let Some(observer) = &observer {
        check_callable("observer", "f(t, state)", observer)?;
    }
    let events = events.map(|events| EventFunctions::extract("f(t, state)", events)).transpose()?;
    if backwards && (contacts.is_some() || pairs.is_some()) {
        return Err(Error::input(FORWARD_WITH_CONTACTS));
    }
    let failure = Failure::default();
    let reader = Reader { failure: failure.clone(), calls_python: observer.is_some() || events.is_some() };
    let none = py.None().into_bound(py);
    let plan = Plan {
        method,
        options,
        steps,
        backwards,
        every,
        t_eval,
        dense: dense_output,
        calls_python: true,
        return_interrupted,
    };
    let problem = Problem {
        cast: &cast,
        forces: forces.unwrap_or(&none),
        interaction,
        contacts,
        pairs,
        locate,
        location: Location { max_event_rate, keep_events, graze, stiff: plan::stiff_of(max_substeps)? },
        backwards,
    };
    let given = Given::of(py, cast.single, contacts, pairs)?;
    let observer = observer.map(Bound::unbind);
    let requested = Requested { py, cast: cast.clone(), plan, observer, events, progress, failure, given };
    problem.using(reader, interval.0, &initial, &Stretches::Argument(stretches), requested)
}
