"""More calls than the examples have, with arguments that those leave out, for `mutated_calls`."""

import io
import json

import numpy as np

import somersault
from somersault import (
    contact,
    exact,
    exam,
    forces,
    ftla,
    integrators,
    motion,
    multibody,
    ocp,
    studies,
    sweep,
    viewer,
)

# Bodies, forces, contacts
body = somersault.RigidBody(2.0, (0.5, 0.9, 1.2))
somersault.RigidBody.sphere(1.0, 0.1)
somersault.RigidBody.ellipsoid(1.0, (0.1, 0.2, 0.3))
somersault.RigidBody.cylinder(1.0, 0.1, 0.4)
somersault.RigidBody.capsule(1.0, 0.1, 0.4)
somersault.RigidBody.shell(1.0, 0.1)
state = somersault.State((0.3, -0.2, 0.5), (0.1, -0.3, 0.5, 0.8), (0.4, 0.1, -0.7), (1.1, -0.6, 0.9))
somersault.State(angular_velocity_body=(1.0, 0.0, 2.0), orientation=np.eye(3))
spring = forces.Spring(3.0, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3), damping=0.2, rest_length=0.7)
spring.wrench(0.0, body, state)
forces.Gravity((0.0, 0.0, -9.81))
forces.Drag(0.1, 0.2, 0.3)
forces.Force((1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
forces.Torque((1.0, 2.0, 3.0), "body")
forces.ScheduledTorque([0.0, 1.0], [(1.0, 2.0, 3.0), (0.1, 0.2, 0.3)], "body")
forces.CentralGravity(2.0, (1.0, 2.0, 3.0))
gravitation = forces.Gravitation(2.0)
orbit = forces.Orbit(7e6, 0.1, 0.2, 0.3, 0.4, 0.5)
orbit.position([0.0, 1.0])
orbit.velocity(1.0)
orbit.frame(1.0)
plate = forces.Plate(2.0, (0.0, 0.0, 1.0), (0.1, 0.2, 0.3), 0.2, 0.3)
forces.GravityGradient(orbit)
forces.traced(lambda t, state: (-state.position, (0, 0, 0)))
forces.MagneticDipole((1.0, 2.0, 3.0), (0.1, 0.2, 0.3), orbit)
forces.AerodynamicDrag(orbit, [plate, plate], 1e-12, 2.2)
forces.SolarPressure((0.0, 0.0, 1.0), [plate], 4.5e-6)
wheels = forces.ReactionWheels(
    np.eye(3), 0.01, 0.3, [[0.1, 0.2, 0.3], [0.0, 0.1, 0.0]], [0.5, 2.0], body=body
)
wheels.momentum(1.0)
wheels.wheel_momenta([0.0, 1.0])
gyros = forces.ControlMomentGyros([(0.0, 0.0, 1.0)], [(1.0, 0.0, 0.0)], 0.5, 0.1, 0.2)
gyros.momentum(1.0)
gyros.gimbal_angles([0.0, 1.0])
law = contact.CompliantLaw(1e4, 3.0)
law.energy(-0.01)
law.force(-0.01, -0.1)
law.restitution(1.0)
contact.CompliantLaw.from_frequency(1.0, 20.0, 0.1)
contact.CompliantLaw.from_restitution(1.0, 1e4, 0.6)
hunt = contact.HuntCrossley(1e6, 0.1)
hunt.force(-0.01, -0.1)
hunt.energy(-0.01)
hunt.restitution(1.0)
contact.HuntCrossley.from_materials((1e9, 2e9), (0.3, 0.3), 0.1, 0.1)
contact.HuntCrossley.from_restitution(1e6, 0.6, 1.0)
contact.restitution(0.1)
contact.damping_ratio(0.6)
coulomb = contact.CoulombFriction(0.3, 1e4, 2.0)
creep = contact.CoulombFriction(0.3, 0.0, 50.0)
regular = contact.RegularisedFriction(0.3, 0.01)
resistance = contact.Resistance(1e-3, 2e-3, 0.1)
plane = contact.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
plane.signed_distance((0.0, 0.0, 1.0))
ball = contact.SphericalSurface((0.0, 0.0, -1.0), 0.5, "inside")
tube = contact.CylindricalSurface((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 3.0, "outside")
touch = contact.Contact((0.0, 0.0, -0.1), plane, law, friction=coulomb, resistance=None)
touch.gap(state)
rolls = contact.Contact.ball((0.0, 0.0, 0.0), 0.1, plane, law, friction=creep, resistance=resistance)
contact.Contact.rim((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 0.1, plane, law, friction=regular)
pair = contact.SpherePair((0, 1), (0.1, 0.2), law, centers=[(0, 0, 0), (0, 0, 0.1)], friction=creep)
contact.falling_box(1.0, (0.2, 0.4, 0.6), law, 1.0, 0.3, friction=coulomb)
contact.sliding_block(1.0, (0.2, 0.4, 0.6), law, coulomb, 1.0, 0.1)
contact.rolling_disk(1.0, 0.2, law, creep, 0.4, 2.0)
contact.tippe_top(0.015, 0.015, 0.002, (1e-6, 1e-6), law, 0.1, 100.0, 0.0, friction=creep)
contact.bouncing_ball(1.0, 0.1, law, 0.5)
somersault.integrate(
    body, state, (0.0, 0.1), dt=0.01, method="rkmk", forces=[spring], contacts=[touch], every=2
)
somersault.integrate(
    body, state, (0.0, 0.1), rtol=1e-6, atol=1e-9, first_step=0.01, max_step=0.1, max_steps=1000
)
somersault.integrate(
    [body, body], [state, somersault.State()], (0.0, 0.1), dt=0.01, pairs=[pair], contacts=[touch, None]
)
somersault.integrate([body, body], [state, somersault.State()], (0.0, 0.1), dt=0.01, interaction=gravitation)
somersault.integrate(
    body,
    state,
    (0.1, 0.0),
    dt=0.01,
    t_eval=[0.08, 0.01],
    events=[lambda t, state: t - 0.05, lambda t, state: 1.0],
)
somersault.integrate(
    body, state, (0.0, 0.1), dt=0.01, forces=lambda t, s: ((0, 0, 1.0), (0, 0, 0.1)), dense_output=True
)
somersault.integrate(
    body, state, (0.0, 0.1), dt=0.01, observer=lambda t, s: t > 0.05, start_up="ladder", method="ab4"
)
run = somersault.integrate(body, state, (0.0, 0.1), dt=0.05, dense_output=True, contacts=rolls)
run.sol([0.01, 0.02])
run.sol(0.01)
run[0]
contact.Event(0.1, 0, "touch_down", 0.1, state)
leg = contact.hopping_leg()
contact.LinkEvent(0.1, "slip", "foot", "shank", 0.0, leg.q, leg.v, (0, 0, 0), (0, 0, 1), (1, 0, 0))
foot = contact.LinkContact("foot", "shank", touch)
knees = contact.LinkPair(
    "knees", ("body", "shank"), (0.02, 0.02), law, centers=[(0, 0, 0), (0, 0, 0)], friction=creep
)
contact.LinkPair.of_shapes(
    "knees",
    ("body", "shank"),
    (("capsule", (0.02, 0.2)), ("sphere", [0.02])),
    law,
    positions=[(0, 0, 0), (0, 0, 0)],
    orientations=[(0, 0, 0, 1), (0, 0, 0, 1)],
    friction=creep,
)
touch.touch(state)
dome = contact.SphericalSurface((0, 0, 0), 1.0)
contact.Contact.capsule([(0, 0, 0), (1, 0, 0)], 0.1, dome, law, friction=creep)
contact.Contact.box((1.0, 1.0, 0.2), dome, law, center=(0, 0, 0), orientation=(0, 0, 0, 1), friction=creep)
belt = contact.Platform("belt", lambda t: ((t, 0, 0), (1, 0, 0), (0, 0, 0)), (0.0, 1.0))
scene = contact.TreeOnPlatforms(leg.model, [belt])
scene.start(leg.q, leg.v, 0.5)
scene.acceleration(0.5, leg.q, leg.v)
feet = contact.TreeContacts(leg.model, [foot, knees])
feet.forces(leg.q, leg.v, np.zeros((2, 3)))
feet.energies(leg.q, leg.v, "loaded")
feet.stiffest_rate(leg.q, leg.v, np.zeros((2, 3)))
feet.equilibrium((0.0, 0.649, 0.0, 0.0, 0.0), np.zeros(5))
feet.equilibrium((0.0, 0.649, 0.0, 0.0, 0.0), lambda t, q, v: np.zeros(5))
contact.shape_contacts(
    "foot",
    "box",
    (0.2, 0.1, 0.04),
    contact.HalfSpace(),
    law,
    friction=creep,
    position=(0.0, 0.0, -0.02),
    orientation=(0.0, 0.0, 0.0, 1.0),
    name="sole",
    on="board",
)
multibody.integrate_tree(
    leg.model,
    leg.q,
    leg.v,
    (0.0, 0.01),
    dt=1e-3,
    contacts=[foot, knees],
    stretches=np.zeros((2, 3)),
    max_event_rate=1e8,
    keep_events=True,
    graze=1e-6,
    max_substeps=100,
)
contact.differentiate_tree(
    leg.model,
    leg.q,
    leg.v,
    (0.0, 0.01),
    dt=1e-3,
    contacts=[foot, knees],
    torque=np.zeros(5),
    parameters=[("law.stiffness", 0), ("torque", 4)],
)
push = multibody.TorqueProfile([0.0, 0.1], np.zeros((2, 5)), between="line")
push(0.05)
contact.gradient_tree(
    leg.model,
    leg.q,
    leg.v,
    (0.0, 0.01),
    lambda q, v: (q[1], None, np.ones(5)),
    dt=1e-3,
    contacts=[foot, knees],
    running=lambda t, q, v: (v[0], None, None),
    event_cost=lambda t: (0.0, None),
    torque=push,
    active=["thigh"],
    acceleration=np.zeros(5),
    parameters=[
        ("mass", "thigh"),
        ("torque", 4, push),
        ("origin", "shank", (0, 0, 1)),
        ("inertia", "body", np.eye(3)),
    ],
)
contact.differentiate(
    body, state, (0.0, 0.05), dt=1e-3, contacts=[touch], parameters=["mass", ("law.stiffness", 0)]
)
somersault.Trajectory(
    body, [0.0, 1.0], np.zeros((2, 3)), np.tile([0, 0, 0, 1.0], (2, 1)), np.zeros((2, 3)), np.zeros((2, 3))
)
somersault.batch.integrate_batch(
    [body, body], [state, state], (0.0, 0.1), [0.01, 0.02], gravity=(0.0, 0.0, -9.81)
)
somersault.batch.integrate_arrays(
    np.ones((2, 3)),
    np.tile([0, 0, 0, 1.0], (2, 1)),
    np.ones((2, 3)),
    (0.0, 0.1),
    [0.01, 0.02],
    mass=[1.0, 2.0],
    position=np.ones((2, 3)),
    velocity=np.ones((2, 3)),
    gravity=(0.0, 0.0, -9.81),
    t_eval=[0.0, 0.05],
)
somersault.batch.integrate_arrays(
    np.ones((2, 3)),
    np.tile([0, 0, 0, 1.0], (2, 1)),
    np.ones((2, 3)),
    (0.0, 0.1),
    method="rkmk8_b",
    forces=[spring, None],
    rtol=1e-6,
    atol=1e-8,
    max_step=0.1,
    first_step=0.01,
    max_steps=1000,
)
free = exact.FreeBody(body, state, 0.0)
free([0.1, 0.2])
free(1.0)
gyrostat = exact.Gyrostat(body, (0.1, 0.2, 0.3), state, 0.0)
gyrostat([0.1, 0.2])
gyrostat(1.0)
several = np.linspace(0.0, 5.0, 20)
motion.estimate_inertia(several, free(several).quaternion, noise=0.01, level=0.9)
stepper = somersault.Stepper(body, state, 0.0, 1.0, dt=0.1, forces=[spring])
stepper.step()
stepper.dense_output()
stepper.set_state(state, stretches=None)
somersault.Stepper(body, state, 0.0, 1.0, dt=0.1, contacts=[touch], events=lambda t, now: t - 0.5)
stepper.set_forces([spring])
integrators.method("rkmk")
integrators.methods()["rkmk"]
integrators.methods()[0]

# Trees
links = [
    multibody.Link("cart", "prismatic", axis=(1.0, 0.0, 0.0), mass=2.0, damping=0.1, limits=(-1.0, 1.0)),
    multibody.Link(
        "pole", "revolute", parent="cart", axis=(0.0, 1.0, 0.0), body=body, origin=(0.0, 0.0, 0.1)
    ),
]
model = multibody.Model(links, gravity=(0.0, 0.0, -9.81))
text = model.to_urdf("cart")
multibody.Model.from_urdf(text, base="fixed", gravity=(0.0, 0.0, -9.81))
with open("cart.urdf", "w") as file:
    file.write(text)
multibody.Model.read_urdf("cart.urdf", base="free")
multibody.Robot.from_urdf(text, base="fixed", gravity=(0.0, 0.0, -9.81))
multibody.Robot.read_urdf("cart.urdf", base="free")
rod = "<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>"
multibody.Model.from_mjcf(rod, gravity=(0.0, 0.0, -9.81))
multibody.Robot.from_mjcf(rod, gravity=(0.0, 0.0, -9.81))
with open("rod.xml", "w") as file:
    file.write(rod)
multibody.Model.read_mjcf("rod.xml", gravity=(0.0, 0.0, -9.81))
multibody.Robot.read_mjcf("rod.xml")
q, v, a, tau = np.array([0.1, 0.2]), np.array([0.3, 0.4]), np.array([0.5, 0.6]), np.array([0.7, 0.8])
many = np.tile(q, (3, 1))
wrenches = np.zeros((2, 6))
model.body("pole")
model.positions_of("pole")
model.velocities_of(1)
model.neutral()
model.random(3)
model.displace(q, v)
model.difference(q, q + 0.1)
model.normalize(many)
model.inverse_dynamics(q, v, a, wrenches)
model.forward_dynamics(many, v, tau, wrenches)
model.hybrid_dynamics(q, v, a, tau, ["cart"], wrenches)
model.inverse_dynamics_partials(q, v, a, wrenches)
model.forward_dynamics_partials(q, v, tau)
model.hybrid_dynamics_partials(q, v, tau, [True, False])
model.momentum_partials(q, v)
model.mass_matrix(many)
model.bias(q, v)
model.gravity_forces(q)
model.jacobian(q, "pole", point=(0.0, 0.0, 0.1), orientation=np.eye(3), axes="frame")
model.poses(q)
model.velocities(q, v)
model.accelerations(q, v, a)
model.center_of_mass(q)
model.centroidal_momentum(q, v)
model.centroidal_matrix(q)
model.kinetic_energy(q, v)
model.potential_energy(many)
multibody.cart_pendulum(2.0, 1.0, 1.0, 9.81)
multibody.two_link_arm((0.5, 0.5), (1.0, 1.0), (0.1, 0.1))
planar, spatial = multibody.diver_planar(65.0, 1.7, 9.81), multibody.diver_spatial(65.0, 1.7, 9.81)
planar.model.flight_velocity_partials(planar.configuration("A"), np.zeros(12), (0.0, 60.0, 0.0))
spatial.configuration("A")
multibody.rollout(model, [q, q], v, (0.0, 0.1), 0.01, torque=np.zeros((2, 10, 2)), every=5)
swing = multibody.integrate_tree(model, q, v, (0.0, 0.1), dt=0.01, torque=[0.1, 0.0], dense_output=True)
swing.sol([0.01, 0.02])
multibody.integrate_tree(
    model, q, v, (0.0, 0.1), dt=0.01, active=["cart"], acceleration=lambda t, q, v: [0.1, 0.0], every=2
)
multibody.integrate_tree(
    model, q, v, (0.0, 0.1), rtol=1e-6, torque=lambda t, q, v: -v, observer=lambda t, q, v: None
)
stand, pike = planar.configuration("A"), planar.configuration("H")
pushed = np.zeros(planar.model.n_velocities)
multibody.fly(
    planar.model,
    stand,
    pushed,
    lambda t: (stand[3:] + t * (pike - stand)[3:], (pike - stand)[3:]),
    (0.0, 0.1),
    dt=0.01,
)

# Studies
graze = exam.scene("graze")
graze.rate("flight", 0.0, graze.y0.ravel())
graze.varied(1e-3)
exam.scenes("contact")
exam.engines()
steps = exam.engine("somersault:rkmk")
report = exam.audit(steps, ["graze"], [0.1, 0.05], tol=1e-3, gradients=True, name="steps")
report.table()
report.to_dict()
report["graze"].to_dict()
report.to_html(None)
problem = studies.Problem.case(2)
studies.Problem.asymmetric_body()
studies.Problem.spring_pendulum()
studies.Problem.damped_spring_pendulum()
studies.Problem(body, state, 0.3, reference=state, forces=[forces.Gravity()])
studies.convergence(problem, "heun", [0.1, 0.05, 0.02], start_up="ladder")
studies.work_precision(problem, "rkmk", [0.1], repeats=1)
studies.work_precision(problem, "rkmk5", tolerances=[1e-4], repeats=1)
studies.energy("euler", studies.prisms(2), angular_velocity=(1.0, 0.1, 0.1), dt=0.5, steps=[10, 20])
studies.stability_region("mp", start_up="ladder")
studies.spectral_radii("heun", [-1.0, -0.5], [0.0, 0.5])

# Optimal motions
case = ocp.CartPendulumProblem.case("A")
small = ocp.CartPendulumProblem(
    (0.0, 3.1, 0.0, 0.0),
    (0.0, 0.0, 0.0, 0.0),
    duration=1.0,
    n_steps=20,
    n_par=7,
    terminal_weights=(1.0, 1.0, 1.0, 1.0),
)
z = np.full(small.n_variables, 0.1)
small.cost(z)
small.gradient(z)
small.hessian(z)
small.solve(z, solver="sqp", tol=1e-6, max_iterations=3, max_time=1.0)
small.solve(z, solver="lbfgs", max_iterations=3, callback=lambda i, z, c, r: None)
small.search(2, seed=1, reach=0.5, distance_tol=1e-3)
small.carry_over(case, np.full(case.n_variables, 0.1))
small.motion(z)
small.verify(z).sentence(1e-3)
base = ocp.EigenpostureBase([[0.0, 0.0], [1.0, 2.0]])
base.positions([0.5])
base.project([0.5, 1.0])
spline = ocp.SplineMotion(2, 6, [("start", 0, 0.0), ("finish", 0, 1.0)], degree=5)
parameters = np.full(spline.n_parameters, 0.1)
spline.coefficients(parameters)
spline(parameters, [0.0, 0.5, 1.0], 1)
spline.fit(np.linspace(0.0, 1.0, 20), np.zeros((20, 2)))
arm = multibody.two_link_arm()
phase = ocp.Phase(spline, (0.5, 2.0), 20, n_segments=2)
terms = [
    ocp.entries("torque", [0, 1]),
    ocp.displacement([0.1, 0.2], [0, 1]),
    ocp.point_position(arm.names[1], (0.0, 0.0, 1.0)),
    ocp.axis_direction(arm.names[1], (0.0, 0.0, 1.0)),
    ocp.function(lambda node: node.velocity**2, 2, reads=["velocity"]),
]
ocp.momentum("angular")
ocp.body_orientation(planar.model.names[1], (0.0, 0.0, 0.0, 1.0))
ocp.function(lambda node: node.velocity, 2, gradient=lambda node: {"velocity": np.eye(2)})
cost = ocp.Cost(terms[0], [1.0, 1.0], [0.0, 0.0], at="path")
bound = ocp.Constraint(terms[1], [-1.0, -1.0], [1.0, 1.0], at="finish")
reach = ocp.MotionProblem(
    arm, [0.0, 0.0], [0.0, 0.0], [phase], active=[True, True], costs=[cost], constraints=[bound]
)
y = np.full(reach.n_variables, 0.1)
reach.cost(y)
reach.gradient(y)
reach.constraints(y)
reach.jacobian(y)
reach.verify(y)
reach.motion(y)
reach.solve(y, solver="sqp", tol=1e-6, max_iterations=3)
reach.search(2, z=y, seed=3, reach=0.1, max_iterations=3)
dive = ocp.dive_107b(n_steps=20)
dive.replace(somersaults=2.5, platform=3.0)
first = dive.start([(0.0, "A"), (0.3, "H"), (1.0, "A")])
found = dive.solve(max_iterations=2, max_time=1.0)
dive.search(2, seed=1, max_iterations=1)
found.verify()
found.literal(40)
found.literal_momentum(40)
ocp.dive_5174d(n_steps=20)
ocp.Dive(planar, ["A", "H"], somersaults=1.5, n_steps=20, template=[(0.0, "A"), (0.4, "H"), (1.0, "A")])
double = ocp.ControlProblem(
    multibody.Model([multibody.Link("mass", "prismatic", axis=(1, 0, 0), mass=1.0)], gravity=(0, 0, 0)),
    actuated=["mass"], initial=(0.0, 0.0), final=(1.0, 0.0), duration=1.0,
    bounds={"u_mass": (-10.0, 10.0), "q_mass": (None, 2.0)}, running_cost=lambda x, u: 0.5 * u[0] ** 2,
)  # fmt: skip
solved = double.solve(tol=1e-3, n_intervals=4, n_points=3, max_meshes=2, max_iterations=20)
solved.state([0.1, 0.2])
solved.costate([0.1, 0.2])
solved.control(0.1)
from somersault import expr  # noqa: E402

rates = expr.Function(lambda x, u, t: [u[0] - x[0]], x=1, u=1, t=())._compiled
effort = expr.Function(lambda x, u, t: [u[0] ** 2], x=1, u=1, t=())._compiled
free = expr.Function(lambda x, y, s, t: [0.0 * t], x=1, y=1, s=(), t=())._compiled
TracedPhase = somersault._somersault.ocp.TracedPhase
TracedProblem = somersault._somersault.ocp.TracedProblem
phase = TracedPhase(
    [(rates, []), (effort, []), (free, [])], None, [["x"], ["u"], []],
    [[(-9.0, 9.0)], [(-3.0, 3.0)], [], [(0.0, 0.0)], [(1.0, 1.0)], [], []], None, [(0.0, 0.0), (1.0, 1.0)],
)  # fmt: skip
TracedPhase.of_tree(double.model, ["mass"])
traced = TracedProblem([phase], [[(0.0, 0.0), (1.0, 1.0)]], None)
traced_result = traced.solve([], 1e-3, 4, 3, 2, 20, 1000, None, None, "raise")
traced.sensitivity(traced_result)
traced.polish(traced_result, 100, 1.0)
traced.search(2, 1, 1e-3, 4, 3, 2, 20, 1000, 1.0, "raise", "auto")
TracedProblem.solve_all([traced], [[]], 1e-3, 4, 3, 2, 20, 1000, 1.0, "raise", "auto")
traced.solve(traced_result, 1e-3, None, None, 2, 20, 1000, None, None, "raise")
TracedProblem(
    [phase, phase], [[(0.0, 0.0), (1.0, 1.0)], [(1.0, 1.0), (2.0, 2.0)]], [(0, 1, "time", 0, 0, (0.0, 0.0))]
)
thrown = ocp.ControlProblem(
    lambda x, u, t: [u[0] - x[0] * t], 1, 1, initial={"x0": 0.0}, final=[1.0],
    duration=(0.5, 2.0), start_time=0.5, bounds={"u0": (-3.0, 3.0)},
    running_cost=lambda x, u: u[0] ** 2, end_cost=lambda x, t: t,
    path=[(lambda x: x[0], None, 2.0)], ends=[(lambda x_0, x_f: x_f - x_0, 0.0, 2.0)],
    integrals=[(lambda x: x[0], None, 2.0)], scales={"x0": 1.0, "u0": 1.0},
)  # fmt: skip
thrown.replace(
    initial={"x0": 0.1}, final=[0.9], duration=(0.6, 2.0), start_time=0.4, bounds={"u0": (-2.0, 3.0)}
)
loop = ocp.ControlProblem(double.model, initial=[0, 0], final=[1, 0], running_cost=lambda x, u: u[0] ** 2)
loop.sensitivity(loop.solve(tol=1e-3, n_intervals=4)).predict({"final.q_mass": 0.1, "duration": 0.1})
polished = thrown.polish(thrown.solve(tol=1e-3, n_intervals=4, max_meshes=2), max_time=1.0)
for history in (polished.state, polished.control, polished.costate):
    history([0.6, 0.7])
for history in (polished.switching, polished.hamiltonian):
    history(0.6)
external = ocp.ExternalFunction(
    lambda x: x[0] ** 2,
    (),
    jacobian=lambda x: 2 * x[:1],
    vectorized=True,
    relative_error=1e-12,
    name="square",
)
external([0.5])
ocp.ControlProblem(
    lambda x, u: [u[0] - external(x)], 1, 1, initial=[0], final=[1], running_cost=lambda x, u: u[0] ** 2
).solve(tol=1e-3, n_intervals=4, max_meshes=2, max_iterations=20, max_evaluations=100, max_time=1.0)
thrown.search(2, seed=1, tol=1e-3, n_intervals=4, n_points=3, max_meshes=2, max_iterations=20, max_time=1.0)
ocp.solve_batch(
    [thrown], [None], tol=1e-3, n_intervals=4, n_points=3, max_meshes=2, max_iterations=20, max_time=1.0
)
thrown.solve({"x0": [0.0, 1.0]}, tol=1e-3, n_intervals=4, n_points=3, max_meshes=2, max_iterations=20)
ocp.MultiphaseProblem([double], None).solve(tol=1e-3, n_intervals=4, max_iterations=10)
ocp.MultiphaseProblem([double, double], [{"q_mass": None, "v_mass": (0.0, None)}])

# Hyper-sensitive problems
linear = ftla.linear_regulator()
ftla.cubic_regulator()
whole = ftla.arm(
    masses=(0.5, 0.5), lengths=(1.0, 1.0), damping=(0.1, 0.1), weights=(1.0, 1.0), torque_limits=(1.0, 1.0)
)
of_tree = ftla.tree(arm, [1.0, 0.5], torque_limits=(1.0, 1.0), passive=[1])
p2 = np.array([1.0, 0.4])
linear.field(p2)
linear.jacobian(p2)
linear.hamiltonian(p2)
linear.control(np.tile(p2, (3, 1)))
linear.running_cost(p2)
own = ftla.System(lambda p: np.array([p[1], -p[0]]), lambda p: np.array([[0.0, 1.0], [-1.0, 0.0]]), 2)
own.field(p2)
posed = ftla.state_costate(
    lambda x, u: np.array([x[1], u[0]]), lambda x, u: 0.5 * (u @ u), 2, 1,
    jacobian=lambda x, u: np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    gradient=lambda x, u: np.array([0.0, 0.0, u[0]]),
    hessian=lambda x, u, p: np.diag([0.0, 0.0, 1.0]),
)  # fmt: skip
flow = ftla.VariationalFlow(linear, rtol=1e-8, atol=1e-10, max_steps=10_000)
flow.state(p2, [0.5, -0.5])
flow.cost(p2, 1.0)
flow.transition(p2, 1.0)
flow.transitions(np.tile(p2, (3, 1)), 1.0)
flow.switches(p2, 1.0)
chain = flow.chain(p2, [0.5, 1.0], 100.0)
chain.spectrum(0)
chain[0]
forward, backward = flow.spectrum(p2, 2.0), flow.spectrum(p2, 2.0, "backward")
flow.spectra(p2, [1.0, 2.0], "forward")
slow = ftla.Subspace(np.eye(4)[:2])
slow.complement()
slow.intersection(slow)
slow.angles(slow)
slow.angle_to([1.0, 0.0, 0.0, 1.0])
splitting = ftla.Splitting(forward, backward, (1, 0, 1))
ftla.slow_subspace(forward, (1, 0, 1))
ftla.rank_held_costates(slow)
ftla.graded_times(10.0, 0.1, 1.0)
spectra = flow.spectra(p2, np.linspace(1.0, 8.0, 8))
diagnosis = ftla.diagnose(spectra, 20.0)
diagnosis.schedule()
placement = ftla.Placement((1, 0, 1), [], [1.0, 2.0, 4.0], method="newton", tol=1e-8, max_iterations=10)
placed = placement.place(flow, p2, "forward")
matching = ftla.Matching(flow, [1.0], [1.0], 10.0, placement, initial_costate=[0.4], final_costate=[-2.4])
matching.least_squares([], tol=1e-2, max_rounds=5)
matched = matching.grid_search(np.zeros((2, 0)), tol=1e-2, max_rounds=5)
matched.nodes([0.0, 5.0, 10.0])
times = np.linspace(0.0, 3.0, 7)
optimum = ftla.shoot(
    linear, [1.0], [1.0], times, np.tile([0.5, 0.1], (7, 1)), tol=1e-9, rtol=1e-10, atol=1e-12
)
optimum([0.1, 0.2])
optimum.control([0.1])
optimum.cost()
optimum.hamiltonian_range()
placement.following(flow, optimum, [1.0, 0.0], [1e-3, 1e-2], 0.1)
ftla.cold_start(linear, [1.0], [1.0], 3.0, tol=1e-9, first_step=0.5)
posed = ftla.system_of(
    ocp.ControlProblem(lambda x, u: u - x, 1, 1, running_cost=lambda x, u: x @ x + u @ u, initial=[1.0])
)
ftla.cold_start(posed, [1.0], [None], 3.0, tol=1e-9)
ftla.continue_through(linear, [([0.0], [0.0]), ([1.0], [1.0])], 2.0, [0.0, 0.5, 1.0], tol=1e-9)
travel_arm = somersault._somersault.ftla.travel_arm
travel_arm(ftla.arm(), (0.0, 0.1), (0.3, 0.2), 1.0, 0.1, tol=1e-8, max_iterations=10)
ftla.arm_extremals((0.0, 0.1, 0.0, 0.0), (0.3, 0.2, 0.0, 0.0), 1.0, folds=[np.pi], turns=[0])
ftla.follow(lambda s: (linear, [1.0 + s], [1.0], 3.0), optimum, tol=1e-9, first_step=0.5)

# Flows
pendulum_flow = ftla.VariationalFlow(ftla.vector_field(lambda x: (x.v, -np.sin(x.q)), ("q", "v")), rtol=1e-6)
analysis = somersault._somersault.ftla
analysis.long_run(pendulum_flow, [1.0, 0.0], 5.0, 0.2, 40, 1e-2, max_time=1.0, max_evaluations=10_000)
plane = np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]), axis=-1).reshape(-1, 2)
analysis.field_exponents(
    pendulum_flow, plane, 1.0, [(-3.0, 3.0), (-3.0, 3.0)], max_time=1.0, max_evaluations=10_000
)
heights = -np.add.outer(np.linspace(-1, 1, 5) ** 2, np.zeros(6))
analysis.grid_smoothed(heights, 0.5)
analysis.grid_ridges(heights, (0.0, 0.0), (0.1, 0.1), -1.0, 0.0, 0.0)
analysis.spectra_convergence(spectra, 0.1)

# Recorded motions
stamps = np.linspace(0.0, 1.0, 20)
shape = np.random.default_rng(0).normal(size=(20, 4, 3))
recording = motion.MarkerRecording(["a", "b", "c", "d"], stamps, shape, np.ones((20, 4), bool))
recording.track("a")
recording.select(["a", "b"])
recording.resample(n_frames=10)
recording.resample([0.1, 0.2])
recording.fill_gaps(0.1)
joints = [
    motion.SkeletonJoint("root", None, (0, 0, 0), turns=True, moves=True),
    motion.SkeletonJoint("knee", 0, (0, 0, -0.4)),
]
skeleton = motion.Skeleton(joints)
skeleton.model(60.0)
walked = motion.SkeletonRecording(skeleton, stamps, np.tile([0, 0, 0, 1.0], (20, 2, 1)), np.zeros((20, 1, 3)))
walked.joint_centres()
walked.resample(n_frames=10)
motion.write_csv("a.csv", recording, unit="m", up="z", forward="x")
motion.write_trc("a.trc", recording)
motion.write_c3d("a.c3d", recording)
motion.write_bvh("a.bvh", walked, unit="m")
motion.read_csv("a.csv", unit="m", up="z", forward="x", nan_is_gap=True)
motion.read_trc("a.trc")
motion.read_c3d("a.c3d")
motion.read_bvh("a.bvh", unit="m")
motion.read_file("a.bvh", unit="m", up="y", forward="z")
curves = motion.ChannelRecording(["knee", "hip"], stamps, shape[:, :2, 0], ["rad", "m"])
curves.track("knee")
curves.select(["hip"])
np.savez("a.npz", poses=np.zeros((3, 66)), trans=np.zeros((3, 3)), mocap_framerate=60.0)
motion.read_amass("a.npz", np.ones((22, 3)))
motion.write_glb("a.glb", recording)
motion.write_mot("a.mot", curves, in_degrees=True)
motion.read_mot("a.mot", strict=True)
with open("awards.csv", "w") as file:
    file.write("dd,awards\n2,7 8 7\n")
motion.read_awards("awards.csv", strict=True)
pictured = motion.KeypointRecording(["nose", "toe"], stamps, shape[:, :2, :2], np.ones((20, 2)))
pictured.markers(scale=0.01, up="-y", forward="x", threshold=0.5)
pictured.markers(scale=(0.01, 0.02))
with open("pose.json", "w") as file:
    json.dump([{"people": [{"pose_keypoints_2d": [1.0, 2.0, 0.5]}]}] * 2, file)
motion.read_pose("pose.json", rate=30.0, person=0, strict=False)
motion.read_c3d_channels("a.c3d")
motion.read_c3d_events("a.c3d")
motion.read_c3d_force_plates("a.c3d")
numbers = (
    [0.1, 0.0, 0.9, 0.0]
    + [1.0, 0.0, 0.0, 0.0] * 4
    + [0.5, *([1.0, 0.0, 0.0, 0.0] * 2), 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
)
frames = io.StringIO(json.dumps({"Loop": "none", "Frames": 2 * [numbers + [1.0, 0.0, 0.0, 0.0] * 2 + [0.0]]}))
animated = motion.read_joint_motion(frames, spatial)
motion.write_joint_motion("a.txt", animated)
motion.read_joint_motion("a.txt", spatial)
centres = motion.MarkerSet.joint_centres(spatial.model)
motion.MarkerSet(spatial.model, {"x": (1, (0.0, 0.0, 0.1))}, {"x": 1.0})
still = np.tile(spatial.configuration("A"), (5, 1))
seen = motion.place_markers(centres, np.linspace(0.0, 0.4, 5), still)
fitted = motion.MarkerFit(
    centres, scale=(0.8, 1.2), loss="huber", threshold=0.02, max_iterations=5, noise=0.01
).fit(seen)
fitted.covariance(0)
rows = np.random.default_rng(1).normal(size=(10, 4))
pca = motion.Pca(rows, 2)
pca.reconstruct(pca.scores(rows))
motion.common_eigenpostures([rows, rows + 1], 2)
motion.eigenpostures_per_motion([rows, rows + 1], 2)
motion.project(ocp.EigenpostureBase([[0.0, 0.0], [1.0, 2.0]]), [[0.5, 1.0], [0.2, 0.2]], bounds="none")
motion.Band(rows)
comparison = motion.GroupComparison({"a": [fitted], "b": [fitted]}, "marker_error", n_frames=10)
comparison.series("a")
comparison.bands()
motion.find_flight(4.0 * stamps - 4.905 * stamps**2, times=stamps, gravity=9.81)
motion.reconstruct_flight(
    motion.MarkerSet(
        somersault.Model([multibody.Link("body", "free", mass=1.0, inertia=np.eye(3))]), {"a": (0, (0, 0, 0))}
    ),
    recording,
    knot_spacing=0.2,
    scale=1.0,
    seek_gravity=True,
    threshold=4.0,
    noise=(0.1, 0.5, 0.1),
    interval=(float(stamps[0]), float(stamps[-1])),
    max_iterations=3,
)
straight = planar.configuration("A")
pushed[:3] = 1.0, 4.0, -2.6
turning = multibody.fly(
    planar.model, straight, pushed, lambda t: (straight[3:], 0 * straight[3:]), (0, 1), dt=0.05
)
paired_centres = motion.MarkerSet.joint_centres(planar.model)
places = motion.place_markers(paired_centres, turning.t, turning.q)
blurred = places.points + np.random.default_rng(1).normal(0.0, 0.005, places.points.shape)
fallen = motion.reconstruct_flight(
    paired_centres,
    motion.MarkerRecording(places.names, places.times, blurred),
    scale=1.0,
    interval=(0.0, 1.0),
)
motion.smooth_motion(
    paired_centres,
    motion.MarkerRecording(places.names, places.times, blurred),
    scale=1.0,
    threshold=4.0,
    noise=(0.005, 0.1, 0.1),
    freedom=3.0,
    max_iterations=2,
)
motion.scale_model(
    paired_centres,
    motion.MarkerRecording(places.names, places.times, blurred),
    groups={"legs": ["thigh", "shank"], "trunk": {"torso": "xy"}},
    size_deviation=0.1,
    group_deviation=0.05,
    offset_deviation=0.01,
    noise=0.005,
    threshold=4.0,
    max_frames=5,
    max_iterations=3,
)
tall = multibody.diver_spatial()
tall.scaled({"right_thigh": 1.05, "torso": (1.0, 1.1, 1.0)})
tall.model.scaled({"right_thigh": 1.05, "torso": (1.0, 1.1, 1.0)})
motion.what_if(
    fallen,
    opening=0.0,
    posture=0.1,
    momentum=0.1,
    height=0.1,
    phase=(0.1, 0.3, 0.6, 0.9),
    joints={"thigh": 1.0},
)
advised = motion.advise_flight(fallen, half_somersaults=1, facing="water", line_up=0.1, momentum_reach=0.1)
advised.to_dict()
advised.advice[0].to_dict()
motion.normalize_frames(stamps, np.zeros(20), 10)
motion.somersaults(spatial.model, still)
performances = [
    motion.Performance(
        stamps,
        list("abcdefghijkl"),
        np.random.default_rng(i).normal(size=(20, 12)),
        np.random.default_rng(i).normal(size=(20, 3)),
    )
    for i in range(8)
]
performances[0].labelled_synthetic()
motion.Performance.from_markers(recording)
options = motion.ScoringOptions(n_frames=10, n_eigenweights=2, path=True, duration=False, max_components=2)
scorer = motion.ScoringModel(performances, np.linspace(4.0, 9.0, 8), options)
scorer.score(performances[0])
scorer.save("scorer.json")
motion.ScoringModel.load("scorer.json")
motion.validate(performances, np.linspace(4.0, 9.0, 8), options, n_resamples=20, level=0.9, seed=1)
partial = motion.ScoringOptions(n_frames=10, n_eigenweights=2, method="pls", n_components=2)
motion.ScoringModel(performances, np.linspace(4.0, 9.0, 8), partial, groups=[0, 1, 2, 3, 0, 1, 2, 3])
ridge = motion.ScoringOptions(n_frames=10, n_eigenweights=2, method="ridge", penalty=0.1)
motion.validate(performances, np.linspace(4.0, 9.0, 8), ridge, groups=list("abcdabcd"), n_resamples=20)
motion.pearson([1.0, 2.0, 3.0], [1.0, 2.0, 4.0])
motion.spearman([1.0, 2.0, 3.0], [1.0, 2.0, 4.0])
faults = motion.DiveFaults(0.1, 0.1, 0.1, 0.1, 0.1)
judge = motion.SyntheticJudge(faults, entry_angle=1.0, noise=0.1, half_points=True)
judge.intended(faults)
nudge = motion.Perturbation(
    exit_delay=0.01, looseness=0.1, over_rotation=0.1, wobble=0.1, asymmetry=0.1, duration=0.01
)
flown = ocp.dive_107b().solve()
motion.DiveFaults.of(flown.dive.diver.model, flown.t, flown.q)
flight = motion.SyntheticFlight(flown.dive.diver.model, flown.t, flown.q)
flight.perturb(nudge)
made = motion.SyntheticSet(
    flight, motion.MarkerSet.joint_centres(flown.dive.diver.model), judge, n_dives=3, seed=1, greatest=nudge
)
made.performances()
judged = made.judged_set()
judged.save("judged")
motion.read_judged("judged/judged.csv", longest_gap=0.1)
judged.performances()


# Traced functions
ExpressionGraph = somersault._somersault.expr.ExpressionGraph
CompiledFunction = somersault._somersault.expr.CompiledFunction
graph = ExpressionGraph()
angle, rate = graph.input(), graph.input()
product = graph.apply("multiply", [graph.apply("sin", [angle]), graph.constant(2.0)])
graph.value(product)
compiled = CompiledFunction(graph, [("angle", []), ("rate", [1])], [product, rate])
compiled.insert_into(graph, [rate, angle])
compiled.values([0.1, 0.2])
compiled.jacobian([[0.1, 0.2], [0.3, 0.4]])
compiled.hessian([0.1, 0.2, 1.0, 1.0])
compiled.jacobian_pattern()
compiled.hessian_pattern()
compiled.derivative("angle")
forces.TracedForce(somersault.expr.Function(lambda x: x[:6], x=33)._compiled)


# Sweeps, files, pages
def square(x):
    return x * x


sweep.run(square, [{"x": 1.0}, {"x": 2.0}], directory="squares", workers=1, version="1")
sweep.run(square, sweep.grid(x=[1.0, 2.0]), version="1", retry_failures=True)
sweep.grid(x=[1, 2], y=["a"])
sweep.read("squares").table()
somersault.save("a.som", {"run": run, "model": model, "n": [1, 2.0, np.arange(3)]})
somersault.load("a.som")
page = viewer.Scene("A box").add(run, shapes=viewer.Box((0.2, 0.4, 0.6), checkered=True))
page.html()
page.write("page.html")

# Nonlinear programs
solve_program = somersault._somersault.nlp.solve_program
solve_program(
    "ipm", ([0.5], [], []), ([0.0], [1.0]), ([], []), ([0, 0], []), ([0, 1], [0]),
    (lambda x: (float(x[0] ** 2), np.empty(0)), lambda x: (2.0 * x, np.empty(0)),
     lambda x, s, y: np.array([2.0 * s])),
    tol=1e-6, max_iterations=20, max_evaluations=50, max_time=1.0, callback=lambda *_: None,
)  # fmt: skip
