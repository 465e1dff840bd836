//! Steps of fixed size.

use super::LocatedResult;
use super::run::{Run, Span, check_start, run};
use super::stiff::Stiff;
use super::worker::{Encode, Worker};
use crate::event::{Interruption, Location};
use crate::hybrid::{Frozen, Hybrid, HybridBodies};
use somersault_integrators::driver::{Flow, Observer, Status, TimeGrid};
use somersault_integrators::methods::{Method, Options, Visitor};
use somersault_integrators::stepper::Stepper;
use somersault_integrators::system::{Decoder, Form, StateOf, System, Unchanged};

/// Integrates bodies with modes by a method of the table, with a fixed step, locating events.
///
/// The steps have the size of the grid, counted anew from each event. While a contact is closed that a step is too
/// long for they are divided, and further where the energy grows; see
/// [`StiffSteps`](crate::event::StiffSteps). The observer sees every committed
/// step, those that end at events among them, with its curve.
///
/// Cost: the guards once a step, and about eight steps for each event. A step of the spinning top in contact
/// takes 1.05 to 1.3 times as long as one in flight, whatever the method, but for `imid`: 2.5 times, since its
/// iteration takes five or six evaluations where two do in free fall. Beside the same top without a ground, in
/// the driver without events, it takes 1.3 (`split2`, `split4`, `rkmk8`) to 1.7 times as long by most one-step
/// methods of order 4 and above, and 1.7 to 2.8 times by methods whose steps are about as short as the guards
/// and by `rkmk_b` and `cf4_b`, which without a ground need no orientation within a step
/// (`cargo bench --bench contact`).
pub fn integrate_located<H, O>(
    method: Method,
    options: Options,
    system: &H,
    initial: &StateOf<H>,
    grid: &TimeGrid,
    location: &Location,
    observer: &mut O,
) -> LocatedResult<H::Configuration>
where
    H: HybridBodies,
    O: Observer<H::Configuration>,
{
    check_start(system, grid.time(0), initial, location)?;
    let frozen = Frozen::new(system, grid.time(0), initial);
    method.visit(options, &frozen, Visit { frozen: &frozen, initial, grid, location, observer })
}

/// Integrates any system with modes by any stepper, with a fixed step, locating events; see
/// [`integrate_located`].
pub fn integrate_hybrid<H, M, O>(
    frozen: &Frozen<H>,
    stepper: &M,
    initial: &StateOf<H>,
    grid: &TimeGrid,
    location: &Location,
    observer: &mut O,
) -> LocatedResult<H::Configuration>
where
    H: Hybrid,
    M: Stepper<Frozen<H>>,
    O: Observer<H::Configuration>,
{
    let form = (frozen, &StateOf::<H>::clone as Encode<'_, H, Frozen<H>>, Unchanged);
    integrate_hybrid_form(frozen, form, stepper, initial, grid, location, observer)
}

/// The same with the system in other variables: a form, and the ways to its variables and back.
pub(crate) fn integrate_hybrid_form<H, B, M, D, O>(
    frozen: &Frozen<H>,
    (form, encode, decoder): (&B, Encode<'_, H, B>, D),
    stepper: &M,
    initial: &StateOf<H>,
    grid: &TimeGrid,
    location: &Location,
    observer: &mut O,
) -> LocatedResult<H::Configuration>
where
    H: Hybrid,
    B: System,
    M: Stepper<B>,
    D: Decoder<B::Configuration, H::Configuration> + Clone + Send + Sync + 'static,
    O: Observer<H::Configuration>,
{
    check_start(frozen.system(), grid.time(0), initial, location)?;
    frozen.freeze(grid.time(0), initial);
    let worker = Worker { frozen, form, stepper, decoder, encode };
    run(worker, (grid.time(0), initial), location, observer, |run| steps(run, *grid))
}

struct Visit<'a, H: Hybrid, O> {
    frozen: &'a Frozen<&'a H>,
    initial: &'a StateOf<H>,
    grid: &'a TimeGrid,
    location: &'a Location,
    observer: &'a mut O,
}

impl<'a, H, O> Visitor<Frozen<&'a H>> for Visit<'a, H, O>
where
    H: HybridBodies,
    O: Observer<H::Configuration>,
{
    type Output = LocatedResult<H::Configuration>;

    fn visit<B: Form<H::Configuration>, M: Stepper<B>>(self, form: B, stepper: M) -> Self::Output {
        let Self { frozen, initial, grid, location, observer } = self;
        let (decoder, encode) = (form.decoder(), &|x: &_| form.encode(x));
        let worker = Worker { frozen, form: &form, stepper: &stepper, decoder, encode };
        run(worker, (grid.time(0), initial), location, observer, |run| steps(run, *grid))
    }
}

fn steps<H, B, M, D, O>(run: &mut Run<'_, H, B, M, D, O>, mut grid: TimeGrid) -> Result<Status, Interruption>
where
    H: Hybrid,
    B: System,
    M: Stepper<B>,
    D: Decoder<B::Configuration, H::Configuration> + Clone + Send + Sync + 'static,
    O: Observer<H::Configuration>,
{
    let end = grid.time(grid.steps());
    let mut stiff = Stiff::new(run.location.stiff, &M::INFO, grid.dt());
    stiff.enter(run.worker.frozen, run.so_far.t, &run.before.outer)?;
    if stiff.parts > 1 {
        grid = TimeGrid::try_new(run.so_far.t, end, stiff.part())?;
    }
    let mut n = 0;
    while run.so_far.t < end {
        let t = run.so_far.t;
        let h = if n < grid.full_steps() { grid.dt() } else { end - t };
        if n == grid.full_steps() {
            run.worker.stepper.restart(&mut run.memory);
        }
        run.worker.step(t, &run.before.inner, h, &mut run.memory, &mut run.after)?;
        n += 1;
        // A step that throws the bodies off is not searched for what it meets on the way.
        let mut stands = stiff.holds(run.worker.frozen, t, &run.after.outer)?;
        let mut span = Span { h, t_after: grid.time(n), is_event: false };
        if stands {
            span = run.locate(h, span.t_after)?;
            stands = stiff.accepts(run.worker.frozen, t, &run.after.outer)?;
        }
        if !stands {
            run.so_far.trials += 1;
            run.worker.stepper.restart(&mut run.memory);
            (grid, n) = (TimeGrid::try_new(t, end, stiff.part())?, 0);
            continue;
        }
        run.so_far.substeps += u64::from(stiff.parts > 1);
        let flow = run.commit(span)?;
        if span.is_event && span.t_after < end {
            stiff.enter(run.worker.frozen, span.t_after, &run.before.outer)?;
            (grid, n) = (TimeGrid::try_new(span.t_after, end, stiff.part())?, 0);
        }
        if flow == Flow::Stop && span.t_after < end {
            return Ok(Status::Stopped);
        }
    }
    Ok(Status::Finished)
}
