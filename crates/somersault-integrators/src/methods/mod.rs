//! The method table: each method is one file.
//!
//! A file of a method registers it: `register!` gives each of its rows a place in the table, the name in the enumeration, the
//! type and the variables it takes. `table!` collects the rows of the files, and `methods!` makes of them the enumeration
//! [`Method`], its list, its parser and the `match` that makes an [`Engine`] of a method, once per trajectory. Bindings, benchmarks,
//! documentation and tests iterate over it. A user-defined method is a type that implements [`Stepper`]; every driver and study
//! takes one.

pub use crate::adams::StartUp;
use crate::driver::{Adaptive, IntegrateError, Observer, Outcome, TimeGrid};
use crate::driver::{check_state, run_adaptive, run_fixed};
use crate::engine::{Engine, FormEngine};
use crate::state::{Configuration, State};
use crate::stepper::{EmbeddedStepper, MethodInfo, Scheme, StepError, Stepper, Variables};
use crate::system::{BodyForm, Form, MomentumForm, RigidSystem, StateOf, System, Unchanged};
use std::fmt;
use std::str::FromStr;

/// Rows of the table:
/// `PLACE [thesis] => Variant: Type [{ option, … }], variables[(name, title)][, embedded];`.
///
/// The table is in the order of the places, which leave room for others between them. `thesis` marks Table 7.3 of the thesis.
/// The method is the type's default, with the fields in braces taken from [`Options`].
/// The variables are `any` for a method that takes every system as it is, `world` for one that takes rigid bodies as they are,
/// and `momentum` or `body` for one that takes them in that form, with its name and title there. `embedded` says that the type
/// is an [`EmbeddedStepper`].
///
/// The rows become a macro of the file's module, `rows!`, which hands them on to `table!`.
macro_rules! register {
    // The dollar sign is an argument because a macro cannot write one into a macro that it defines.
    (@rows ($dollar:tt) $($row:tt)*) => {
        macro_rules! rows {
            ($dollar($dollar modules:ident)* => $dollar($dollar before:tt)*) => {
                table! { $dollar($dollar modules)* => $dollar($dollar before)* $($row)* }
            };
        }
        pub(super) use rows;
    };
    ($($row:tt)*) => { register! { @rows ($) $($row)* } };
}

pub mod ab2;
pub mod ab4;
pub mod aso;
pub mod cf4;
pub mod dmv2;
pub mod dmv2s;
pub mod euler;
pub mod heun;
pub mod imid;
pub mod lgvi;
pub mod mp;
pub mod pmv;
pub mod rk4;
pub mod rkmk;
pub mod rkmk_tableau;
pub mod siabm2;
pub mod siabm4;
pub mod sie;
pub mod sieg;
pub mod split2;
pub mod split4;
pub mod sv;
pub mod sv2;

/// Choices that some methods offer; the others ignore them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// How methods with history start.
    pub start_up: StartUp,
}

/// No method has this name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no method is named `{found}`; the methods are {}", names())]
pub struct UnknownMethod {
    /// The name asked for.
    pub found: String,
}

fn names() -> String {
    Method::ALL.map(|m| m.info().name).join(", ")
}

/// What to do with a method once its type is known.
pub trait Visitor<S: RigidSystem> {
    /// The result.
    type Output;
    /// Takes the bodies in the form the method integrates, and the method.
    fn visit<B: Form<S::Configuration>, M: Stepper<B>>(self, form: B, stepper: M) -> Self::Output;
}

/// As [`Visitor`], for methods that estimate their error.
pub trait EmbeddedVisitor<S: RigidSystem> {
    /// The result.
    type Output;
    /// Takes the bodies in the form the method integrates, and the method.
    fn visit<B: Form<S::Configuration>, M: EmbeddedStepper<B>>(self, form: B, stepper: M) -> Self::Output;
}

/// What to do with a method that takes any system, once its type is known.
pub trait SystemVisitor<S: System> {
    /// The result.
    type Output;
    /// Takes the method.
    fn visit<M: Stepper<S>>(self, stepper: M) -> Self::Output;
}

/// What to do with a method that takes any system, in the variables of the world or of the body, once its type is
/// known.
pub trait FrameVisitor<W: System, B: System> {
    /// The result.
    type Output;
    /// Takes a method in world variables.
    fn world<M: Stepper<W>>(self, stepper: M) -> Self::Output;
    /// Takes a method in body variables.
    fn body<M: Stepper<B>>(self, stepper: M) -> Self::Output;
}

/// As [`FrameVisitor`], for methods that estimate their error.
pub trait EmbeddedFrameVisitor<W: System, B: System> {
    /// The result.
    type Output;
    /// Takes a method in world variables.
    fn world<M: EmbeddedStepper<W>>(self, stepper: M) -> Self::Output;
    /// Takes a method in body variables.
    fn body<M: EmbeddedStepper<B>>(self, stepper: M) -> Self::Output;
}

/// As [`SystemVisitor`], for methods that estimate their error.
pub trait EmbeddedSystemVisitor<S: System> {
    /// The result.
    type Output;
    /// Takes the method.
    fn visit<M: EmbeddedStepper<S>>(self, stepper: M) -> Self::Output;
}

macro_rules! methods {
    ($(
        $place:literal $($thesis:ident)? => $variant:ident: $stepper:ty $({ $($option:ident),+ })?,
        $kind:ident $(($name:literal, $title:literal))? $(, $embedded:ident)?;
    )*) => {
        /// A method of the table, with its place there.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        #[repr(u16)]
        pub enum Method {
            $(#[doc = concat!("[`", stringify!($stepper), "`], ", methods!(@scope $kind), ".")] $variant = $place,)*
        }

        $(const _: () = assert!(
            <$stepper as Scheme>::INFO.embedded.is_some() == methods!(@is_embedded $($embedded)?),
            concat!("the row of ", stringify!($variant), " and its INFO differ in whether it is embedded"),
        );)*

        impl Method {
            /// All methods, in the order of the table.
            pub const ALL: [Self; [$(Self::$variant),*].len()] = in_order([$(Self::$variant),*]);

            /// Those of Table 7.3 of the thesis, in its order.
            pub const THESIS: [Self; [$($(stringify!($thesis),)?)*].len()] =
                in_order([$($(methods!(@$thesis $variant),)?)*]);

            /// The row of the table.
            pub const fn info(self) -> MethodInfo {
                match self {
                    $(Self::$variant => methods!(@info $stepper, $kind $(($name, $title))?),)*
                }
            }

            /// Enters code that knows the type of the method.
            pub fn visit<S: RigidSystem, V: Visitor<S>>(self, options: Options, system: &S, visitor: V) -> V::Output {
                match self {
                    $(Self::$variant => visitor.visit(methods!(@form system, $kind), methods!(@make options, $stepper $({ $($option),+ })?)),)*
                }
            }

            /// As [`visit`](Self::visit) for methods with an error estimate; `None` for the others.
            pub fn visit_embedded<S: RigidSystem, V: EmbeddedVisitor<S>>(
                self,
                options: Options,
                system: &S,
                visitor: V,
            ) -> Option<V::Output> {
                // No method with an estimate has a choice to make so far.
                let _ = options;
                match self {
                    $(Self::$variant => methods!(
                        @estimate $($embedded)? => Some(visitor.visit(
                            methods!(@form system, $kind),
                            methods!(@make options, $stepper $({ $($option),+ })?),
                        ))
                    ),)*
                }
            }

            /// As [`visit`](Self::visit) for any system; `None` for the methods that need rigid bodies.
            pub fn visit_system<S: System, V: SystemVisitor<S>>(self, options: Options, visitor: V) -> Option<V::Output> {
                match self {
                    $(Self::$variant => methods!(
                        @system visitor, methods!(@make options, $stepper $({ $($option),+ })?), $kind
                    ),)*
                }
            }

            /// As [`visit_system`](Self::visit_system) for a system written in two frames: methods for any system in the
            /// variables of the world or of the body; `None` for the others.
            pub fn visit_frames<W: System, B: System, V: FrameVisitor<W, B>>(
                self,
                options: Options,
                visitor: V,
            ) -> Option<V::Output> {
                match self {
                    $(Self::$variant => methods!(
                        @frames visitor, methods!(@make options, $stepper $({ $($option),+ })?), $kind
                    ),)*
                }
            }

            /// As [`visit_frames`](Self::visit_frames) for methods with an error estimate.
            pub fn visit_embedded_frames<W: System, B: System, V: EmbeddedFrameVisitor<W, B>>(
                self,
                options: Options,
                visitor: V,
            ) -> Option<V::Output> {
                let _ = options;
                match self {
                    $(Self::$variant => methods!(
                        @estimate $($embedded)? => methods!(
                            @frames visitor, methods!(@make options, $stepper $({ $($option),+ })?), $kind
                        )
                    ),)*
                }
            }

            /// As [`visit_system`](Self::visit_system) for methods with an error estimate.
            pub fn visit_embedded_system<S: System, V: EmbeddedSystemVisitor<S>>(
                self,
                options: Options,
                visitor: V,
            ) -> Option<V::Output> {
                let _ = options;
                match self {
                    $(Self::$variant => methods!(
                        @estimate $($embedded)? => methods!(
                            @system visitor, methods!(@make options, $stepper $({ $($option),+ })?), $kind
                        )
                    ),)*
                }
            }
        }
    };
    (@is_embedded) => { false };
    (@is_embedded embedded) => { true };
    (@thesis $variant:ident) => { Self::$variant };
    (@make $options:ident, $stepper:ty) => { <$stepper>::default() };
    (@make $options:ident, $stepper:ty { $($option:ident),+ }) => {{
        let mut method = <$stepper>::default();
        $(method.$option = $options.$option;)+
        method
    }};
    (@scope any) => { "any system" };
    (@scope $kind:ident) => { concat!("rigid bodies in ", stringify!($kind), " variables") };
    (@frames $visitor:ident, $make:expr, any) => { Some($visitor.world($make)) };
    (@frames $visitor:ident, $make:expr, body) => { Some($visitor.body($make)) };
    (@frames $visitor:ident, $make:expr, $kind:ident) => { None };
    (@system $visitor:ident, $make:expr, any) => { Some($visitor.visit($make)) };
    (@system $visitor:ident, $make:expr, $kind:ident) => { None };
    (@info $stepper:ty, any) => { <$stepper as Scheme>::INFO };
    (@info $stepper:ty, world) => { <$stepper as Scheme>::INFO };
    (@info $stepper:ty, momentum($name:literal, $title:literal)) => {
        <$stepper as Scheme>::INFO.in_variables($name, $title, Variables::Momentum)
    };
    (@info $stepper:ty, body($name:literal, $title:literal)) => {
        <$stepper as Scheme>::INFO.in_variables($name, $title, Variables::Body)
    };
    (@form $system:ident, any) => { $system };
    (@form $system:ident, world) => { $system };
    (@form $system:ident, momentum) => { MomentumForm($system) };
    (@form $system:ident, body) => { BodyForm($system) };
    (@estimate embedded => $found:expr) => { $found };
    (@estimate => $found:expr) => { None };
}

/// Collects the rows of the modules and hands them to `methods!`: `module … => row …` is what is left and what is collected.
macro_rules! table {
    ($module:ident $($modules:ident)* => $($row:tt)*) => {
        #[doc(inline)]
        pub use $module::*;
        $module::rows! { $($modules)* => $($row)* }
    };
    (=> $($row:tt)*) => { methods! { $($row)* } };
}

// `table! { module … => }` with the files beside this one: the modules above, which a macro cannot list and declare at once
// without hiding them from rustfmt.
include!(concat!(env!("OUT_DIR"), "/table.rs"));

/// Sorts methods by their places.
const fn in_order<const N: usize>(mut methods: [Method; N]) -> [Method; N] {
    let mut sorted = 0;
    while sorted < N {
        let mut i = sorted;
        while i > 0 && methods[i - 1] as u16 > methods[i] as u16 {
            methods.swap(i - 1, i);
            i -= 1;
        }
        sorted += 1;
    }
    methods
}

impl FromStr for Method {
    type Err = UnknownMethod;

    fn from_str(name: &str) -> Result<Self, UnknownMethod> {
        Self::ALL
            .into_iter()
            .find(|m| m.info().name == name)
            .ok_or_else(|| UnknownMethod { found: name.to_owned() })
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.info().name)
    }
}

/// Hands a method and the form that it integrates to a driver as an [`Engine`].
struct Engage<'a, Q: Configuration, R> {
    initial: &'a State<Q>,
    run: &'a mut dyn FnMut(&mut dyn Engine<Q>) -> R,
}

impl<S: RigidSystem, R> Visitor<S> for Engage<'_, S::Configuration, R> {
    type Output = Result<R, StepError>;

    fn visit<B: Form<S::Configuration>, M: Stepper<B>>(self, form: B, stepper: M) -> Self::Output {
        let encode = |x: &_| form.encode(x);
        let mut engine = FormEngine::start(&form, &stepper, form.decoder(), &encode, self.initial)?;
        Ok((self.run)(&mut engine))
    }
}

impl<S: RigidSystem, R> EmbeddedVisitor<S> for Engage<'_, S::Configuration, R> {
    type Output = Result<R, StepError>;

    fn visit<B: Form<S::Configuration>, M: EmbeddedStepper<B>>(self, form: B, stepper: M) -> Self::Output {
        let encode = |x: &_| form.encode(x);
        let engine = FormEngine::start(&form, &stepper, form.decoder(), &encode, self.initial)?;
        Ok((self.run)(&mut engine.with_estimate()))
    }
}

/// The same for a system that a method takes as it is.
struct EngageSystem<'a, S: System, R> {
    system: &'a S,
    initial: &'a StateOf<S>,
    run: &'a mut dyn FnMut(&mut dyn Engine<S::Configuration>) -> R,
}

impl<S: System, R> SystemVisitor<S> for EngageSystem<'_, S, R> {
    type Output = Result<R, StepError>;

    fn visit<M: Stepper<S>>(self, stepper: M) -> Self::Output {
        let Self { system, initial, run } = self;
        Ok(run(&mut FormEngine::start(system, &stepper, Unchanged, &StateOf::<S>::clone, initial)?))
    }
}

impl<S: System, R> EmbeddedSystemVisitor<S> for EngageSystem<'_, S, R> {
    type Output = Result<R, StepError>;

    fn visit<M: EmbeddedStepper<S>>(self, stepper: M) -> Self::Output {
        let Self { system, initial, run } = self;
        let engine = FormEngine::start(system, &stepper, Unchanged, &StateOf::<S>::clone, initial)?;
        Ok(run(&mut engine.with_estimate()))
    }
}

impl Method {
    /// Runs an engine of this method on bodies, started from a state.
    ///
    /// Errors where the method does not take the forces.
    pub fn engage<S: RigidSystem, R>(
        self,
        options: Options,
        system: &S,
        initial: &StateOf<S>,
        run: &mut dyn FnMut(&mut dyn Engine<S::Configuration>) -> R,
    ) -> Result<R, StepError> {
        self.visit(options, system, Engage { initial, run })
    }

    /// As [`engage`](Self::engage), with the method's estimate of its error.
    ///
    /// Errors with [`IntegrateError::NoErrorEstimate`] where it has none.
    pub fn engage_embedded<S: RigidSystem, R>(
        self,
        options: Options,
        system: &S,
        initial: &StateOf<S>,
        run: &mut dyn FnMut(&mut dyn Engine<S::Configuration>) -> R,
    ) -> Result<R, IntegrateError> {
        let engaged = self.visit_embedded(options, system, Engage { initial, run });
        Ok(engaged.ok_or(IntegrateError::NoErrorEstimate { method: self.info().name })??)
    }

    /// Integrates bodies over a grid of times with a fixed step, see [`crate::driver::integrate`].
    pub fn integrate<S: RigidSystem>(
        self,
        options: Options,
        system: &S,
        initial: &StateOf<S>,
        grid: &TimeGrid,
        observer: &mut dyn Observer<S::Configuration>,
    ) -> Result<Outcome<S::Configuration>, IntegrateError> {
        check_state(initial)?;
        self.engage(options, system, initial, &mut |engine| run_fixed(engine, initial, grid, observer))?
    }

    /// Integrates bodies with steps adapted to tolerances, see [`crate::driver::integrate_adaptive`].
    pub fn integrate_adaptive<S: RigidSystem>(
        self,
        options: Options,
        system: &S,
        initial: &StateOf<S>,
        interval: (f64, f64),
        control: &Adaptive,
        observer: &mut dyn Observer<S::Configuration>,
    ) -> Result<Outcome<S::Configuration>, IntegrateError> {
        check_state(initial)?;
        self.engage_embedded(options, system, initial, &mut |engine| {
            run_adaptive(engine, initial, interval, control, observer)
        })?
    }

    /// As [`integrate`](Self::integrate) for any system, say a tree of bodies.
    ///
    /// Errors with [`IntegrateError::RigidBodiesOnly`] where the method needs rigid bodies.
    pub fn integrate_system<S: System>(
        self,
        options: Options,
        system: &S,
        initial: &StateOf<S>,
        grid: &TimeGrid,
        observer: &mut dyn Observer<S::Configuration>,
    ) -> Result<Outcome<S::Configuration>, IntegrateError> {
        check_state(initial)?;
        let run = &mut |engine: &mut dyn Engine<_>| run_fixed(engine, initial, grid, observer);
        self.visit_system(options, EngageSystem { system, initial, run })
            .ok_or(IntegrateError::RigidBodiesOnly { method: self.info().name })??
    }

    /// As [`integrate_adaptive`](Self::integrate_adaptive) for any system.
    pub fn integrate_system_adaptive<S: System>(
        self,
        options: Options,
        system: &S,
        initial: &StateOf<S>,
        interval: (f64, f64),
        control: &Adaptive,
        observer: &mut dyn Observer<S::Configuration>,
    ) -> Result<Outcome<S::Configuration>, IntegrateError> {
        check_state(initial)?;
        let run =
            &mut |engine: &mut dyn Engine<_>| run_adaptive(engine, initial, interval, control, observer);
        self.visit_embedded_system(options, EngageSystem { system, initial, run }).ok_or_else(|| {
            let MethodInfo { name: method, embedded, .. } = self.info();
            match embedded {
                Some(_) => IntegrateError::RigidBodiesOnly { method },
                None => IntegrateError::NoErrorEstimate { method },
            }
        })??
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::RigidBody;
    use crate::stepper::Scope;
    use crate::system::RigidBodySystem;

    #[test]
    fn each_name_is_of_one_method() {
        for method in Method::ALL {
            assert_eq!(method.info().name.parse(), Ok(method));
        }
    }

    /// The name of the method it sees.
    struct Name;

    impl<S: System> SystemVisitor<S> for Name {
        type Output = &'static str;
        fn visit<M: Stepper<S>>(self, _: M) -> &'static str {
            M::INFO.name
        }
    }

    #[test]
    fn methods_for_any_system_are_those_of_that_scope() {
        type Free =
            RigidBodySystem<fn(f64, &RigidBody, &crate::state::RigidBodyState) -> crate::force::Wrench>;
        for method in Method::ALL {
            let info = method.info();
            let any = info.scope == Scope::AnySystem && info.variables == Variables::World;
            let found = method.visit_system::<Free, _>(Options::default(), Name);
            assert_eq!(found, any.then_some(info.name), "{method}");
        }
    }
}
