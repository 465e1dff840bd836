//! A torque that is given in time.

use super::{
    ConstantTorque, ForceModel, Reach, StatesInLanes, Wrench, WrenchBound, WrenchesInLanes, add_by_times,
};
use crate::body::RigidBody;
use crate::rotors::LinearSchedule;
use crate::state::{RigidBodyState, Twist};
use crate::variation::Tangent;
use nalgebra::Vector3;
use somersault_core::interval::nearest;

/// A torque about the centre of mass that is linear between given times, fixed in the world or in the body.
///
/// Adapted steps end at these times, and so do all steps of runs that locate events; with other fixed steps a method keeps its order where
/// the times are points of the grid.
#[derive(Debug, Clone, PartialEq)]
pub struct ScheduledTorque {
    /// The three components, N m.
    pub components: [LinearSchedule; 3],
    /// Whether they are those in body axes, else in world axes.
    pub is_in_body: bool,
}

impl ScheduledTorque {
    /// The torque at a time.
    fn at(&self, t: f64) -> ConstantTorque {
        let torque = Vector3::from(self.components.each_ref().map(|component| component.value(t)));
        if self.is_in_body { ConstantTorque::Body(torque) } else { ConstantTorque::World(torque) }
    }
}

impl ForceModel for ScheduledTorque {
    #[inline]
    fn wrench(&self, t: f64, body: &RigidBody, x: &RigidBodyState) -> Wrench {
        self.at(t).wrench(t, body, x)
    }
    fn add_in_lanes(&self, on: &StatesInLanes<'_>, sums: &mut WrenchesInLanes) {
        add_by_times(on, sums, |t| self.at(t), |torque, body, x| torque.wrench(0.0, body, x));
    }
    fn depends_on_velocity(&self) -> bool {
        false
    }
    fn next_stop(&self, t: f64, end: f64) -> Option<f64> {
        nearest(t, self.components.iter().map(|component| component.next_kink(t, end)))
    }
    fn bound(&self, _: &RigidBody, _: &Reach) -> Option<WrenchBound> {
        let largest = Vector3::from(self.components.each_ref().map(LinearSchedule::largest));
        Some(WrenchBound { force: 0.0, torque: largest.norm() })
    }
    fn wrench_variation(
        &self,
        t: f64,
        body: &RigidBody,
        x: &RigidBodyState,
        along: &Tangent<Twist>,
    ) -> Wrench {
        self.at(t).wrench_variation(t, body, x, along)
    }
    #[inline]
    fn mass_derivative(&self, _: f64, _: &RigidBody, _: &RigidBodyState) -> Wrench {
        Wrench::default()
    }
}
