"""The F-16's equations of motion: conservation and symmetry, two roads to the derivatives, published numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bfi_cli.aircraft.f16 import AIRFRAME, BOOK_AIRFRAME, CONTROLS, STATES, Body, SteadyFlight, derivatives, trim
from bfi_cli.aircraft.f16.airframe import FOOT, IXX, IXZ, IYY, IZZ, SLUG_FT2
from bfi_cli.aircraft.f16.loads import conditions_at
from bfi_cli.errors import ConfigError

DEG = np.pi / 180.0
N = 60
INERTIA = SLUG_FT2 * np.array([[IXX, 0.0, -IXZ], [0.0, IYY, 0.0], [-IXZ, 0.0, IZZ]])
row = {name: i for i, name in enumerate(STATES)}

# Stevens and Lewis, table 3.5-2: centre of gravity 0.4, throttle 0.9, surfaces 20, -15, -20 degrees; feet and seconds.
CHECK_STATE = [500.0, 0.5, -0.2, -1.0, 1.0, -1.0, 0.7, -0.8, 0.9, 1000.0, 900.0, 10000.0, 90.0]
CHECK_CONTROLS = [20.0 * DEG, -15.0 * DEG, -20.0 * DEG, 0.9, 0.0, 0.0]
PUBLISHED = {
    "tas": -75.23724,
    "aoa": -0.8813491,
    "sideslip": -0.4759990,
    "roll": 2.505734,
    "pitch": 0.3250820,
    "yaw": 2.145926,
    "roll_rate": 12.62679,
    "pitch_rate": 0.9649671,
    "yaw_rate": 0.5809759,
    "north": 342.4439,
    "east": -266.7707,
    "altitude": 248.1241,
    "power": -58.68999,
}
FEET = np.array([FOOT if name in ("tas", "north", "east", "altitude") else 1.0 for name in STATES])


def flights(seed: int = 0, n: int = N) -> tuple[np.ndarray, np.ndarray]:
    """Return any states and controls within the tables."""
    rng = np.random.default_rng(seed)
    low = [80.0, -0.15, -0.5, -3.0, -1.4, -3.0, -2.0, -1.0, -1.0, -1e3, -1e3, 0.0, 1.0]
    high = [240.0, 0.75, 0.5, 3.0, 1.4, 3.0, 2.0, 1.0, 1.0, 1e3, 1e3, 12e3, 100.0]
    x = rng.uniform(low, high, (n, len(STATES))).T
    u = rng.uniform([-0.4, -0.35, -0.5, 0.0, -0.2, -0.2], [0.4, 0.35, 0.5, 1.0, 0.2, 0.2], (n, len(CONTROLS))).T
    return x, u


def loads(x: np.ndarray, u: np.ndarray, body: Body) -> tuple[np.ndarray, np.ndarray]:
    """Return accelerations with gravity, and moments."""
    at = conditions_at(x, body)
    C, F_T = at.coefficients(x[6:9], u), at.thrust_force(u)
    return at.accelerations(C, F_T), at.moments(C, F_T)


def velocity(x: np.ndarray) -> np.ndarray:
    tas, aoa, slip = x[:3]
    return tas * np.array([np.cos(aoa) * np.cos(slip), np.sin(slip), np.sin(aoa) * np.cos(slip)])


@pytest.mark.parametrize(("frame", "tolerance"), [(BOOK_AIRFRAME, 1e-6), (AIRFRAME, 5e-4)], ids=["book", "exact"])
@pytest.mark.parametrize("name", STATES)
def test_the_check_case_of_the_book(name: str, frame: object, tolerance: float):
    x, u = (np.array(CHECK_STATE) * FEET)[:, None], np.array(CHECK_CONTROLS)[:, None]
    change = derivatives(x, u, Body(airframe=frame, cg=0.4))[:, 0] / FEET
    assert change[row[name]] == pytest.approx(PUBLISHED[name], rel=tolerance)


def test_the_sign_printed_in_the_paper_misses_the_check_case():
    """Eq. 1 prints (r sin a - p cos a) tan b for alpha-dot."""
    x, u = (np.array(CHECK_STATE) * FEET)[:, None], np.array(CHECK_CONTROLS)[:, None]
    p, _, r = x[6:9, 0]
    ours = derivatives(x, u, Body(cg=0.4))[row["aoa"], 0]
    printed = ours + 2.0 * r * np.sin(x[1, 0]) * np.tan(x[2, 0])
    assert printed == pytest.approx(-1.0563, abs=5e-5)
    assert p != 0.0


def test_power_of_all_forces_is_the_change_of_energy():
    x, u = flights()
    body = Body(cg=0.3)
    change = derivatives(x, u, body)
    specific, _ = loads(x, u, body)
    at = conditions_at(x, body)
    done = np.sum((specific - at.weight) * velocity(x), axis=0)
    gained = x[0] * change[0] + AIRFRAME.gravity_m_s2 * change[row["altitude"]]
    np.testing.assert_allclose(gained, done, rtol=1e-11, atol=1e-8)


def test_only_moments_change_the_energy_of_rotation():
    """Neither the gyroscopic moment of the engine nor the coupling of the rates does work."""
    x, u = flights(1)
    body = Body(nozzle_arm_m=4.0)
    turned = np.sum(x[6:9] * (INERTIA @ derivatives(x, u, body)[6:9]), axis=0)
    np.testing.assert_allclose(turned, np.sum(x[6:9] * loads(x, u, body)[1], axis=0), rtol=1e-10, atol=1e-6)


def test_rates_obey_euler_with_the_engine_on_board():
    x, u = flights(2)
    rates, change = x[6:9], derivatives(x, u, Body())[6:9]
    momentum = INERTIA @ rates + np.array([[AIRFRAME.engine_momentum], [0.0], [0.0]])
    expected = loads(x, u, Body())[1] - np.cross(rates.T, momentum.T).T
    np.testing.assert_allclose(INERTIA @ change, expected, rtol=1e-10, atol=1e-5)


def test_wind_axes_and_body_axes_agree():
    """The book's form: u-dot = a - omega x v, then the angles of the velocity."""
    x, u = flights(3)
    change = derivatives(x, u, Body())
    v = velocity(x)
    a, b, c = loads(x, u, Body())[0] - np.cross(x[6:9].T, v.T).T
    tas_dot = (v[0] * a + v[1] * b + v[2] * c) / x[0]
    np.testing.assert_allclose(change[0], tas_dot, rtol=0, atol=1e-11)
    np.testing.assert_allclose(change[1], (v[0] * c - v[2] * a) / (v[0] ** 2 + v[2] ** 2), rtol=0, atol=1e-12)
    np.testing.assert_allclose(change[2], (b * x[0] - v[1] * tas_dot) / (x[0] ** 2 * np.cos(x[2])), rtol=0, atol=1e-12)


def test_attitude_turns_with_the_rates_and_the_velocity_points_there():
    x, u = flights(4)
    change = derivatives(x, u, Body())
    h = 1e-6
    to_earth = Rotation.from_euler("ZYX", x[[5, 4, 3]].T)
    later = Rotation.from_euler("ZYX", (x + h * change)[[5, 4, 3]].T)
    np.testing.assert_allclose((to_earth.inv() * later).as_rotvec().T / h, x[6:9], rtol=0, atol=2e-5)
    over_ground = to_earth.apply(velocity(x).T).T * np.array([[1.0], [1.0], [-1.0]])
    np.testing.assert_allclose(change[9:12], over_ground, rtol=0, atol=1e-11)


def test_a_mirrored_aircraft_flies_the_mirrored_flight():
    """With aileron and rudder at zero, whose published tables are not quite symmetric, and the engine at rest."""
    x, u = flights(5)
    u[1:3] = 0.0
    body = Body(airframe=replace(AIRFRAME, engine_momentum=0.0), cg=0.32)
    sides = np.ones((13, 1))
    sides[[2, 3, 5, 6, 8, 10]] = -1.0
    other = u.copy()
    other[4] *= -1.0
    np.testing.assert_allclose(
        derivatives(sides * x, other, body), sides * derivatives(x, u, body), rtol=1e-12, atol=1e-12
    )


def test_place_and_heading_do_not_matter():
    x, u = flights(6)
    moved = x.copy()
    moved[[9, 10]] += 1e4
    moved[5] += 1.0
    here, there = derivatives(x, u, Body()), derivatives(moved, u, Body())
    kept = [i for i in range(13) if i not in (9, 10)]
    np.testing.assert_allclose(there[kept], here[kept], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(np.hypot(*there[9:11]), np.hypot(*here[9:11]), rtol=1e-12)


def test_aircraft_side_by_side_fly_as_they_do_alone():
    x, u = flights(7, n=5)
    alone = np.hstack([derivatives(x[:, [i]], u[:, [i]], Body()) for i in range(5)])
    np.testing.assert_allclose(derivatives(x, u, Body()), alone, rtol=1e-13, atol=1e-13)


def test_variation_scales_the_aerodynamic_moments_and_nothing_else():
    x, u = flights(8)
    u[4:] = 0.0
    by = np.random.default_rng(8).uniform(-0.3, 0.3, (3, N))
    plain, varied = derivatives(x, u, Body()), derivatives(x, u, Body(), variation=by)
    np.testing.assert_array_equal(np.delete(varied, [6, 7, 8], axis=0), np.delete(plain, [6, 7, 8], axis=0))
    added = INERTIA @ (varied - plain)[6:9]
    np.testing.assert_allclose(added, by * loads(x, u, Body())[1], rtol=1e-8, atol=1e-5)


def test_the_nozzle_turns_the_thrust_about_the_centre_of_gravity():
    x, u = flights(9)
    at = conditions_at(x, Body(nozzle_arm_m=4.0))
    F_T = at.thrust_force(u)
    np.testing.assert_allclose(np.linalg.norm(F_T, axis=0), np.abs(at.thrust), rtol=1e-12)
    no_air = np.zeros((6, N))
    expected = np.cross(np.tile([-4.0, 0.0, 0.0], (N, 1)), F_T.T).T
    np.testing.assert_allclose(at.moments(no_air, F_T), expected, rtol=1e-12, atol=1e-9)


def test_inputs_are_not_changed():
    x, u = flights(10)
    kept = x.copy(), u.copy()
    derivatives(x, u, Body(), variation=np.full((3, N), 0.1))
    np.testing.assert_array_equal(x, kept[0])
    np.testing.assert_array_equal(u, kept[1])


# Stevens and Lewis, table 3.6-3: 502 ft/s at sea level; radians, throttle, degrees of elevator, aileron, rudder.
LEVEL = [
    (0.35, 0.03691, 0.1385, -0.7588),
    (0.30, 0.03936, 0.1485, -1.931),
    (0.38, 0.03544, 0.1325, -0.0559),
]


@pytest.mark.parametrize(("cg", "aoa", "throttle", "elevator"), LEVEL)
def test_level_trims_of_the_book(cg: float, aoa: float, throttle: float, elevator: float):
    found = trim(SteadyFlight(tas_m_s=502.0 * FOOT, altitude_m=0.0), Body(cg=cg))
    assert found.state[1] == pytest.approx(aoa, abs=5e-6)
    assert found.controls[3] == pytest.approx(throttle, abs=6e-5)
    assert found.controls[0] / DEG == pytest.approx(elevator, abs=5e-4)
    np.testing.assert_allclose([*found.state[2:4], *found.controls[1:3]], 0.0, rtol=0, atol=1e-12)


def test_turn_and_pull_up_of_the_book():
    flight = {"tas_m_s": 502.0 * FOOT, "altitude_m": 0.0}
    turn = trim(SteadyFlight(**flight, turn_rate=0.3), Body(cg=0.30))
    assert turn.state[1:3] == pytest.approx([0.2485, 4.8e-4], abs=5e-5)
    assert turn.state[2] == pytest.approx(4.8e-4, abs=5e-6)
    assert turn.controls[3] == pytest.approx(0.8499, abs=5e-5)
    assert turn.controls[:3] / DEG == pytest.approx([-6.256, 0.09891, -0.4218], abs=5e-4)
    pull = trim(SteadyFlight(**flight, pull_up_rate=0.3), Body(cg=0.30))
    assert pull.state[1:3] == pytest.approx([0.3006, 4.1e-5], abs=5e-5)
    assert pull.controls[3] == pytest.approx(1.023, abs=5e-4)
    assert pull.controls[:3] / DEG == pytest.approx([-7.082, -0.00062, 0.01655], abs=5e-4)


def test_the_trim_of_the_papers_condition():
    found = trim(SteadyFlight(), Body())
    assert found.state[1] / DEG == pytest.approx(5.72, abs=5e-3)
    assert found.controls[3] == pytest.approx(0.1624, abs=5e-5)
    assert found.controls[0] / DEG == pytest.approx(-0.536, abs=5e-4)


@pytest.mark.parametrize("flight", [{"climb_rad": 0.1}, {"turn_rate": 0.1}, {"pull_up_rate": 0.1}])
def test_in_trim_nothing_changes_but_the_place_and_the_heading(flight: dict[str, float]):
    asked = SteadyFlight(tas_m_s=200.0, **flight)
    found = trim(asked, Body(cg=0.3))
    change = derivatives(found.state[:, None], found.controls[:, None], Body(cg=0.3))[:, 0]
    np.testing.assert_allclose(change[[0, 1, 2, 6, 7, 8, 12]], 0.0, rtol=0, atol=1e-7)
    wanted = [0.0, asked.pull_up_rate, asked.turn_rate, 200.0 * np.sin(asked.climb_rad)]
    np.testing.assert_allclose(change[[3, 4, 5, 11]], wanted, rtol=0, atol=1e-6)


def test_no_steady_flight_is_said():
    with pytest.raises(ConfigError, match=r"f16: no steady flight at 20 m/s and 3000 m; change the airspeed"):
        trim(SteadyFlight(tas_m_s=20.0), Body())
