//! The method table: each method is one file.
//!
//! A file of a method registers it: `register!` gives each of its rows a place in the table, the name in the enumeration, the
//! type and the variables it takes. `table!` collects the rows of the files, and `methods!` makes of them the enumeration
//! [`Method`], its list, its parser and the `match` that makes an [`Engine`] of a method, once per trajectory. Bindings, benchmarks,
//! documentation and tests iterate over it. A user-defined method is a type that implements [`Stepper`]; every run and study
//! takes one.
//!
//! Which methods take a system, and in which variables, says the system itself ([`System::Forms`]).

pub use crate::adams::StartUp;
use crate::doubling::{check_adaptive, hand_over};
use crate::engine::{Engine, FormEngine};
use crate::error::IntegrateError;
use crate::state::{Configuration, State};
use crate::stepper::{EmbeddedStepper, MethodInfo, Scheme, StepError, Stepper, Variables};
use crate::system::{BodyForm, Form, MomentumForm, OneForm, RigidForms, RigidSystem, StateOf, System};
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
pub mod radau5;
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
pub mod taylor;

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
    /// The name requested.
    pub found: String,
}

fn names() -> String {
    Method::ALL.map(|m| m.info().name).join(", ")
}

/// What to do with a method once its type is known, for systems with configurations `Q`.
pub trait Visitor<Q: Configuration>: Sized {
    /// The result.
    type Output;
    /// Takes the system in the form that the method integrates, and the method.
    fn visit<B: Form<Q>, M: Stepper<B>>(self, form: B, stepper: M) -> Self::Output;
    /// The same for a method that estimates its error, where that makes a difference.
    fn visit_embedded<B: Form<Q>, M: EmbeddedStepper<B>>(self, form: B, stepper: M) -> Self::Output {
        self.visit(form, stepper)
    }
}

/// How the methods of the table take systems: what [`System::Forms`] names.
pub trait Forms<S: System> {
    /// Enters code that knows the type of a method and of the form that it integrates; `None` for a method without one.
    fn visit<V: Visitor<S::Configuration>>(
        method: Method,
        options: Options,
        system: &S,
        visitor: V,
    ) -> Option<V::Output>;
}

impl<S: System> Forms<S> for OneForm {
    fn visit<V: Visitor<S::Configuration>>(
        method: Method,
        options: Options,
        system: &S,
        visitor: V,
    ) -> Option<V::Output> {
        method.visit_system(options, system, visitor)
    }
}

impl<S: RigidSystem> Forms<S> for RigidForms {
    fn visit<V: Visitor<S::Configuration>>(
        method: Method,
        options: Options,
        system: &S,
        visitor: V,
    ) -> Option<V::Output> {
        Some(method.visit(options, system, visitor))
    }
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

            /// Enters code that knows the type of the method, and the form of the bodies that it integrates.
            pub fn visit<S: RigidSystem, V: Visitor<S::Configuration>>(
                self,
                options: Options,
                system: &S,
                visitor: V,
            ) -> V::Output {
                match self {
                    $(Self::$variant => methods!(
                        @visit visitor($($embedded)?)
                        methods!(@form system, $kind), methods!(@make options, $stepper $({ $($option),+ })?)
                    ),)*
                }
            }

            /// As [`visit`](Self::visit) for any system; `None` for the methods that need rigid bodies.
            pub fn visit_system<S: System, V: Visitor<S::Configuration>>(
                self,
                options: Options,
                system: &S,
                visitor: V,
            ) -> Option<V::Output> {
                match self {
                    $(Self::$variant => methods!(
                        @system $kind visitor($($embedded)?)
                        system, methods!(@make options, $stepper $({ $($option),+ })?)
                    ),)*
                }
            }

            /// As [`visit_system`](Self::visit_system) for a system written in two frames: methods for any system in the
            /// variables of the world, or of the body in another form; `None` for the others.
            pub fn visit_frames<S: System, B: Form<S::Configuration>, V: Visitor<S::Configuration>>(
                self,
                options: Options,
                world: &S,
                body: B,
                visitor: V,
            ) -> Option<V::Output> {
                match self {
                    $(Self::$variant => methods!(
                        @frames $kind visitor($($embedded)?)
                        world, body, methods!(@make options, $stepper $({ $($option),+ })?)
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
    (@visit $visitor:ident() $form:expr, $make:expr) => { $visitor.visit($form, $make) };
    (@visit $visitor:ident(embedded) $form:expr, $make:expr) => { $visitor.visit_embedded($form, $make) };
    (@system any $visitor:ident($($embedded:ident)?) $system:ident, $make:expr) => {
        Some(methods!(@visit $visitor($($embedded)?) $system, $make))
    };
    (@system $kind:ident $visitor:ident($($embedded:ident)?) $system:ident, $make:expr) => { None };
    (@frames any $visitor:ident($($embedded:ident)?) $world:ident, $body:ident, $make:expr) => {
        Some(methods!(@visit $visitor($($embedded)?) $world, $make))
    };
    (@frames body $visitor:ident($($embedded:ident)?) $world:ident, $body:ident, $make:expr) => {
        Some(methods!(@visit $visitor($($embedded)?) $body, $make))
    };
    (@frames $kind:ident $visitor:ident($($embedded:ident)?) $world:ident, $body:ident, $make:expr) => { None };
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
    /// Whether steps are to be adapted, for which those of a method without estimate are doubled.
    is_adapted: bool,
    run: &'a mut dyn FnMut(&mut dyn Engine<Q>) -> R,
}

impl<Q: Configuration, R> Visitor<Q> for Engage<'_, Q, R> {
    type Output = Result<R, StepError>;

    fn visit<B: Form<Q>, M: Stepper<B>>(self, form: B, stepper: M) -> Self::Output {
        let encode = |x: &_, out: &mut _| form.encode_into(x, out);
        let initial = form.encode(self.initial);
        let mut engine = FormEngine::start(&form, &stepper, form.decoder(), &encode, initial)?;
        hand_over(&mut engine, self.is_adapted, self.initial, self.run)
    }

    fn visit_embedded<B: Form<Q>, M: EmbeddedStepper<B>>(self, form: B, stepper: M) -> Self::Output {
        let encode = |x: &_, out: &mut _| form.encode_into(x, out);
        let initial = form.encode(self.initial);
        let engine = FormEngine::start(&form, &stepper, form.decoder(), &encode, initial)?;
        Ok((self.run)(&mut engine.with_estimate()))
    }
}

impl Method {
    /// Runs an engine of this method on a system, started from a state, with the method's estimate of its error where it has
    /// one.
    ///
    /// Errors where the method does not take the system, with [`IntegrateError::RigidBodiesOnly`], or its forces.
    pub fn engage<S: System<Forms: Forms<S>>, R>(
        self,
        options: Options,
        system: &S,
        initial: &StateOf<S>,
        run: &mut dyn FnMut(&mut dyn Engine<S::Configuration>) -> R,
    ) -> Result<R, IntegrateError> {
        self.engage_with(options, system, Engage { initial, is_adapted: false, run })
    }

    /// As [`engage`](Self::engage) for adapted steps, which are [doubled](crate::doubling) where the method has no estimate of its error.
    ///
    /// Errors besides with [`IntegrateError::NoErrorEstimate`] where the method remembers previous steps.
    pub fn engage_adapted<S: System<Forms: Forms<S>>, R>(
        self,
        options: Options,
        system: &S,
        initial: &StateOf<S>,
        run: &mut dyn FnMut(&mut dyn Engine<S::Configuration>) -> R,
    ) -> Result<R, IntegrateError> {
        check_adaptive(&self.info())?;
        self.engage_with(options, system, Engage { initial, is_adapted: true, run })
    }

    fn engage_with<S: System<Forms: Forms<S>>, R>(
        self,
        options: Options,
        system: &S,
        engage: Engage<'_, S::Configuration, R>,
    ) -> Result<R, IntegrateError> {
        let engaged = S::Forms::visit(self, options, system, engage);
        Ok(engaged.ok_or(IntegrateError::RigidBodiesOnly { method: self.info().name })??)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::RigidBody;
    use crate::stepper::Scope;
    use crate::system::RigidBodySystem;
    use nalgebra::Vector3;

    #[test]
    fn each_name_is_of_one_method() {
        for method in Method::ALL {
            assert_eq!(method.info().name.parse(), Ok(method));
        }
    }

    /// The name of the method it sees.
    struct Name;

    impl<Q: Configuration> Visitor<Q> for Name {
        type Output = &'static str;
        fn visit<B: Form<Q>, M: Stepper<B>>(self, _: B, _: M) -> &'static str {
            M::INFO.name
        }
    }

    #[test]
    fn methods_for_any_system_are_those_of_that_scope() {
        let free = RigidBodySystem::free(RigidBody::try_principal(1.0, Vector3::repeat(1.0)).unwrap());
        for method in Method::ALL {
            let info = method.info();
            let any = info.scope == Scope::AnySystem && info.variables == Variables::World;
            let found = method.visit_system(Options::default(), &free, Name);
            assert_eq!(found, any.then_some(info.name), "{method}");
        }
    }
}
