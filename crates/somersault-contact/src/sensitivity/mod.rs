//! Sensitivities: the derivative of a motion through its events.
//!
//! Between events the columns of the derivative obey the variational equations; see
//! [`somersault_integrators::variation`] for the frames. At an event where a guard g ends mode − and mode +
//! begins, the time of the event moves with the motion and the columns jump by the *saltation matrix*:
//! ```text
//! δt = −(∇g · δ + ∂g/∂p)/ġ,      δ⁺ = δ⁻ − (f⁺ − f⁻) δt,      ġ = ∇g · f⁻ + ∂g/∂t,
//! ```
//! with the equations of motion f before and after at the state of the event, which is itself continuous.
//! Under the law (7.10) the force jumps at a touch-down by −c Δẋ along the normal, and since position and
//! orientation do not jump, only δv and δω do. At a release and a re-engagement the force is continuous:
//! there the columns do not jump. Points that touch down at once jump one after the other; their guards'
//! rates are continuous, so that the order does not matter. Between stick and slip force and rate of stretch are
//! continuous, both ways, and nothing jumps, unless a static coefficient above the kinetic one lets the force fall at
//! break-away. The stretches of friction have columns of their own, which a touch-down and a release reset with the
//! stretches.
//!
//! The columns are integrated beside the state by the same method in the same steps, cut at the same events:
//! they have the method's own order, and in world variables the motion equals that without them bit for bit.
//!
//! **Where there is no derivative.** A point that touches its surface with no speed is touched or missed by
//! motions next to it: the derivative from one side differs from that from the other unless c = 0. Such a
//! run ends in [`SensitivityError::Grazing`], whether it touches or just misses; it keeps what was integrated, and
//! says in a [`Side`] whose one-sided derivatives the columns are. [`Differentiation::grazing`] is the bound.
//!
//! ```
//! use somersault_contact::models::SpinningTop;
//! use somersault_contact::sensitivity::{Differentiation, Parameter, SensitivityRun};
//! use somersault_integrators::driver::TimeGrid;
//! use somersault_integrators::methods::Method;
//!
//! let top = SpinningTop::thesis()?;
//! let by = Differentiation::by([Parameter::normal(0, "stiffness"), Parameter::Mass]);
//! let grid = TimeGrid::try_new(0.0, 0.1, 1e-4)?;
//! let found = SensitivityRun::new(&top.system, &by, Method::Rkmk, grid).from(&top.start)?;
//! // A top that starts higher touches down later, by δz/ż.
//! assert!(found.event_times[(0, 2)] > 0.0);
//! // The height reached by the height of the start, and by the mass.
//! let (by_height, by_mass) = (found.state[(2, 2)], found.parameters[(2, 1)]);
//! # assert!(by_height.is_finite() && by_mass != 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Trees
//!
//! A [`TreeInContact`](crate::tree::TreeInContact), with joints that may be [driven](somersault_multibody::motion::Driven), is
//! differentiated by the same columns and jumps. Between events
//! ```text
//! δv̇ = ∂v̇/∂q ξ + ∂v̇/∂v δv + M⁻¹ (δτ + Σ Jᵢᵀ δFᵢ),
//! ```
//! with the analytic partials of forward dynamics, the changes of the contacts' wrenches in the axes of their links, and of
//! other forces by central differences; at a touch-down δv jumps by −M⁻¹ Jᵀ (F⁺ − F⁻) δt. Derivatives are by motions of the
//! joints along q ⊕ ε e_k, by their velocities, by constants of the laws, by joint forces that are constant
//! ([`Parameter::JointForce`]) or given at knots ([`Parameter::JointForceAt`]), and by masses, centres of mass, inertias and
//! placements of joints ([`Parameter::Tree`]); what is left are [`TreeSensitivities`]. There are none after the nearest point
//! of a capsule or a box passed to another part of its shape while it touched with friction: the rate of the stretch jumps there, without an
//! event ([`SensitivityError::Feature`]).
//!
//! ```
//! use somersault_contact::models::HoppingLeg;
//! use somersault_contact::sensitivity::{Differentiation, Parameter, SensitivityRun};
//! use somersault_integrators::{driver::TimeGrid, methods::Method};
//!
//! let leg = HoppingLeg::example()?.system()?;
//! let system = leg.in_contact()?;
//! let by = Differentiation::by([Parameter::friction(0, "coefficient"), Parameter::JointForce(4)]);
//! let grid = TimeGrid::try_new(0.0, 0.2, 1e-3)?;
//! let found = SensitivityRun::new(&system, &by, Method::Rkmk8, grid).from(&leg.start()?)?;
//! assert_eq!(found.state.shape(), (10, 10));
//! // A leg whose knee is pushed straighter touches down at another time.
//! assert!(found.event_times[(0, 11)] != 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! For many parameters and one cost there is the adjoint, [`SensitivityRun::recorded_from`]:
//!
//! ```
//! use somersault_contact::models::HoppingLeg;
//! use somersault_contact::sensitivity::{Differentiation, EndCost, Parameter, SensitivityRun};
//! use somersault_integrators::driver::{Flow, TimeGrid};
//! use somersault_integrators::methods::Method;
//! use somersault_multibody::motion::{Between, Knots};
//!
//! let leg = HoppingLeg::example()?.system()?;
//! let system = leg.in_contact()?;
//! let times: Vec<f64> = (0..100).map(|i| 0.002 * f64::from(i)).collect();
//! let knots = Knots::try_new(&times, Between::Line)?;
//! let by = Differentiation::by(Parameter::joint_forces_at(4, &knots).collect::<Vec<_>>());
//! let grid = TimeGrid::try_new(0.0, 0.2, 1e-3)?;
//! let run = SensitivityRun::new(&system, &by, Method::Rkmk8, grid);
//! let mut recorded = run.recorded_from(&leg.start()?).map_err(|refused| refused.reason)?;
//! // The angle of the knee at the end, by its torque at each of the knots.
//! let cost = EndCost { by_motion: &[0.0, 0.0, 0.0, 0.0, 1.0], by_velocity: &[0.0; 5], by_event_times: &[] };
//! let gradient = recorded.gradient(&cost, None, &mut |_| Flow::Continue)?;
//! assert_eq!((gradient.state.len(), gradient.parameters.len()), (10, 100));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! M. A. Aizerman and F. R. Gantmakher, *On the stability of periodic motions*, J. Appl. Math. Mech. 22
//! (1958) 1065; I. A. Hiskens and M. A. Pai, *Trajectory sensitivity analysis of hybrid systems*, IEEE Trans.
//! Circuits Syst. I 47 (2000) 204; M. di Bernardo, C. Budd, A. Champneys and P. Kowalczyk,
//! *Piecewise-smooth Dynamical Systems* (2008), section 2.5.

mod adjoint;
mod body;
mod collect;
mod differentiable;
mod forms;
mod grazing;
mod outcome;
mod parameter;
mod record;
mod run;
mod system;
mod transposed;
mod tree;

pub use adjoint::{EndCost, RecordedResult, RecordedRun, RunningCost, TreeGradient};
pub use differentiable::{Collected, Differentiable, VariedOf};
pub use forms::{VariedForms, VariedPose, VariedState};
pub use grazing::{Grazing, Side};
pub use outcome::{Sensitivities, SensitivityError, TreeSensitivities, Undifferentiated};
pub use parameter::{Differentiation, Parameter, WrenchDerivative};
pub use run::{SensitivityResult, SensitivityRun};
pub use system::Variational;
