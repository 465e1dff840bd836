//! The forms of a body with columns.

use somersault_integrators::augmented::{Augmented, AugmentedRate};
use somersault_integrators::methods::{Forms, Method, Options, Visitor};
use somersault_integrators::state::{InBody, Pose, Rate, RigidBodyState, State, Twist};
use somersault_integrators::system::{Decoder, Form, OneForm, System};
use somersault_integrators::variation::{Tangent, Varied};

/// A pose with columns, and stretches beside both their rates.
pub type VariedPose = Varied<Augmented<Pose>, AugmentedRate<Twist>>;
/// Its rate.
type VariedRate = Varied<AugmentedRate<Twist>>;
/// A state with its columns.
pub type VariedState = State<VariedPose>;

/// A state with columns whose base is in body axes; the columns stay in those of the world.
type BodyVariedPose = Varied<Augmented<InBody<Pose>>, AugmentedRate<Twist>>;

/// The forms of a body with columns: in the variables of the world, and with its rotation in body axes. Methods for any
/// system take both.
#[derive(Debug, Clone, Copy)]
pub struct VariedForms;

impl<S: System<Configuration = VariedPose>> Forms<S> for VariedForms {
    fn visit<V: Visitor<VariedPose>>(
        method: Method,
        options: Options,
        system: &S,
        visitor: V,
    ) -> Option<V::Output> {
        method.visit_frames(options, system, InBodyAxes(system), visitor)
    }
}

/// A body with columns, its rotation in body axes.
struct InBodyAxes<'a, S>(&'a S);

/// Turns states with columns whose base is in body axes into those of the world.
#[derive(Debug, Clone, Copy)]
struct FromBodyAxes;

impl Decoder<BodyVariedPose, VariedPose> for FromBodyAxes {
    fn decode(&self, x: &State<BodyVariedPose>, out: &mut VariedState) {
        let (pose, rate) = (x.configuration.base.0.0, &x.rate.base.base.0);
        out.configuration.base.0 = pose;
        out.rate.base.base = Twist { linear: rate.linear, angular: pose.orientation * rate.angular };
        out.rate.base.variables.copy_from_slice(&x.rate.base.variables);
        out.configuration.columns.assign(&x.configuration.columns);
        out.rate.columns.assign(&x.rate.columns);
    }
}

impl<S: System<Configuration = VariedPose>> Form<VariedPose> for InBodyAxes<'_, S> {
    type Decoder = FromBodyAxes;
    fn encode(&self, x: &VariedState) -> State<BodyVariedPose> {
        State {
            configuration: Varied {
                base: Augmented(InBody(x.configuration.base.0)),
                columns: x.configuration.columns.clone(),
            },
            rate: rate_in_body_axes(&x.configuration.base.0, &x.rate),
        }
    }
    fn decoder(&self) -> FromBodyAxes {
        FromBodyAxes
    }
}

fn rate_in_body_axes(
    pose: &Pose,
    rate: &VariedRate,
) -> Varied<AugmentedRate<InBody<Twist>>, AugmentedRate<Twist>> {
    let Twist { linear, angular } = rate.base.base;
    let angular = pose.orientation.inverse_transform_vector(&angular);
    let base =
        AugmentedRate { base: InBody(Twist { linear, angular }), variables: rate.base.variables.clone() };
    Varied { base, columns: rate.columns.clone() }
}

impl<S: System<Configuration = VariedPose>> System for InBodyAxes<'_, S> {
    type Configuration = BodyVariedPose;
    type Forms = OneForm;
    type Workspace = (S::Workspace, Option<(VariedState, VariedRate)>);
    const IS_WATCHED: bool = S::IS_WATCHED;
    fn workspace(&self) -> Self::Workspace {
        (self.0.workspace(), None)
    }

    fn velocity(
        &self,
        _: &mut Self::Workspace,
        _: f64,
        x: &State<BodyVariedPose>,
        out: &mut Varied<AugmentedRate<InBody<Twist>>, AugmentedRate<Twist>>,
    ) {
        out.assign(&x.rate);
        let (pose, rate) = (&x.configuration.base.0.0, &x.rate.base.base.0);
        let angular = pose.orientation * rate.angular;
        for (column, displacement) in out.columns.iter_mut().zip(&x.configuration.columns) {
            column.base.angular += angular.cross(&displacement.base.angular);
        }
    }

    fn acceleration(
        &self,
        (w, room): &mut Self::Workspace,
        t: f64,
        x: &State<BodyVariedPose>,
        out: &mut Varied<AugmentedRate<InBody<Twist>>, AugmentedRate<Twist>>,
    ) {
        let (world, slope) = room.get_or_insert_with(|| {
            let pose = x.configuration.base.0.0;
            let base = State::augmented(
                RigidBodyState { configuration: pose, rate: Twist::default() },
                x.rate.base.variables.clone(),
            );
            let columns = x.configuration.columns.iter().zip(&x.rate.columns);
            let columns = columns.map(|(displacement, rate)| Tangent {
                displacement: displacement.clone(),
                rate: rate.clone(),
            });
            let world = VariedState::varied(base, columns);
            let slope = world.rate.clone();
            (world, slope)
        });
        FromBodyAxes.decode(x, world);
        self.0.acceleration(w, t, world, slope);
        let Twist { linear, angular } = slope.base.base;
        let angular = world.configuration.base.0.orientation.inverse_transform_vector(&angular);
        out.base.base = InBody(Twist { linear, angular });
        out.base.variables.copy_from_slice(&slope.base.variables);
        out.columns.assign(&slope.columns);
    }
}
