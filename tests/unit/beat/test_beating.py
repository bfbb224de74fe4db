"""A heart in a loop: against an independent integration with events, energy, and what goes wrong."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from limo.beat.bands import Members
from limo.beat.circulations import read_circulations
from limo.beat.loop import ATMOSPHERE
from limo.beat.periodic import MMHG, NOT_PERIODIC, PERIODIC_STATE, beating
from limo.beat.surface import Surface, read_surfaces
from limo.beat.sweep import held, swept, with_keys
from limo.config.yaml_file import parse, read_yaml
from limo.errors import ConfigError, LimoError
from limo.schema.beat import Beat

#: of a linear device with one potential: dV_v/dP_v, dV_v/dP_a = dV_a/dP_v, dV_a/dP_a in ml/kPa
COMPLIANCE = 6.0, -1.4, 1.2


def linear(rest: float = 250.0) -> Surface:
    p_v, p_a = np.linspace(0, 40, 9), np.linspace(0, 120, 25)
    x, y = np.meshgrid(p_v, p_a, indexing="ij")
    one = np.stack([rest + COMPLIANCE[0] * x + COMPLIANCE[1] * y, 60 + COMPLIANCE[1] * x + COMPLIANCE[2] * y])
    return Surface("linear", p_v, p_a, np.stack([one, one]))


@pytest.fixture(scope="module")
def healthy(root) -> Beat:
    file = root / "config/beats/healthy.yaml"
    return parse(Beat, read_yaml(file), file)


def reference(beat: Beat, beats: int) -> np.ndarray:
    """Stroke volume, and largest, least and mean arterial pressure of the last beat: volumes and air as unknowns, by LSODA.

    Ejection and filling, and the switch of the driver, begin and end at events, at which the integration starts anew.
    """
    c, d = beat.systemic, beat.driver
    period, a, b, e = 60 / d.rate, *COMPLIANCE
    inverse = np.linalg.inv([[a, b], [b, e]])

    def pressures(v_v, air):
        """P_v and P_a of a volume and of the air in ml at one atmosphere: a quadratic equation for P_a."""
        # V_v - 250 = a P_v + b P_a; V_a = 60 + b P_v + e P_a; (P_a + P_0)(V_a + V_d) = P_0 n
        k0, k1 = 60 + d.dead_volume + b * (v_v - 250) / a, e - b * b / a
        p, q = k0 + k1 * ATMOSPHERE, ATMOSPHERE * (k0 - air)
        p_a = (-p + np.sqrt(p * p - 4 * k1 * q)) / (2 * k1)
        return (v_v - 250 - b * p_a) / a, p_a

    def flows(y):
        p_v, p_a = pressures(y[0], y[1])
        return max(0.0, y[3] - p_v) / c.inlet_resistance, max(0.0, p_v - y[2]) / c.outlet_resistance, p_v, p_a

    def rates(_, y, source):
        q_in, q_out, _, p_a = flows(y)
        peripheral = (y[2] - y[3]) / c.peripheral_resistance
        return [
            q_in - q_out,
            (source - p_a) / d.line_resistance,
            (q_out - peripheral) / c.arterial_compliance,
            (peripheral - q_in) / c.venous_compliance,
            q_out,
            y[2],
        ]

    events = [lambda t, y, s: pressures(y[0], y[1])[0] - y[2], lambda t, y, s: y[3] - pressures(y[0], y[1])[0]]
    for event in events:
        event.terminal = True
    start = np.array([c.venous_pressure, 0.0])
    v_v, v_a = np.array([250.0, 60.0]) + np.linalg.inv(inverse) @ start
    y = np.array([v_v, v_a + d.dead_volume, c.arterial_pressure, c.venous_pressure, 0.0, 0.0])
    for _ in range(beats):
        y[4:], arteries = 0.0, []
        for begin, end, source in ((0, d.duty * period, d.source_pressure), (d.duty * period, period, d.vent_pressure)):
            t = begin
            while t < end - 1e-12:
                found = solve_ivp(
                    rates, (t, end), y, args=(source,), method="LSODA", events=events, rtol=1e-9, atol=1e-9, max_step=5e-3
                )
                arteries.append(found.y[2])
                y, t = found.y[:, -1].copy(), found.t[-1]
                if found.status == 1:  # past the event
                    step = solve_ivp(rates, (t, min(t + 1e-7, end)), y, args=(source,), rtol=1e-9, atol=1e-12)
                    y, t = step.y[:, -1].copy(), step.t[-1]
        pressure = np.concatenate(arteries)
    return np.array([y[4], pressure.max(), pressure.min(), y[5] / period])


def test_a_beat_is_that_of_an_independent_integration_with_events(healthy):
    found = beating(linear(), healthy)
    assert found.status == PERIODIC_STATE, found.reason
    names = ("stroke_volume", "arterial_systolic", "arterial_diastolic", "arterial_mean")
    np.testing.assert_allclose([found.numbers[n][0] for n in names], reference(healthy, found.beats), rtol=1e-3)


def test_a_device_without_losses_gives_to_the_blood_what_the_air_gives_to_it(healthy):
    found = beating(linear(), healthy)
    assert found.numbers["pouch_efficiency"][0] == pytest.approx(1.0, rel=5e-3)
    assert found.numbers["stroke_volume"][0] > 20
    p_v, _, v_v, *_ = found.traces[0]
    assert found.numbers["blood_work"][0] == pytest.approx(-np.trapezoid([*p_v, p_v[0]], [*v_v, v_v[0]]))


def test_blood_is_neither_made_nor_lost(healthy):
    found = beating(linear(), healthy)
    c = healthy.systemic
    volume = found.traces[0, 2] + c.arterial_compliance * found.vessels[0] + c.venous_compliance * found.vessels[1]
    assert np.ptp(volume) < 1e-3 * np.ptp(found.traces[0, 2])


def test_two_devices_pump_the_same_around_two_circuits(healthy):
    pulmonary = healthy.systemic.model_copy(
        update={"peripheral_resistance": 0.01, "arterial_compliance": 30.0, "arterial_pressure": 2.0, "venous_pressure": 1.5}
    )
    right = healthy.driver.model_copy(update={"source_pressure": 40.0})
    both = healthy.model_copy(update={"pulmonary": pulmonary, "right_driver": right})
    found = beating(linear(), both)
    assert found.status == PERIODIC_STATE, found.reason
    strokes = found.numbers["stroke_volume"]
    assert strokes[0] == pytest.approx(strokes[1], rel=2e-2)
    assert found.numbers["arterial_mean"][0] > 2 * found.numbers["arterial_mean"][1]


def test_a_band_is_as_wide_as_one_pressure_decides(healthy):
    """Any places give a linear device; V_v that is 15 ml more at one P_v of a beat shows in the band, and not without it."""
    plain, beat = linear(), healthy
    low, high = Members(plain).bands(beat)["stroke_volume"]
    whole = float(beating(plain, beat).numbers["stroke_volume"][0])
    assert low <= whole <= high
    assert high - low < 1e-3 * whole
    volumes = plain.volumes.copy()
    volumes[:, 0, 2] += 15.0  # at 10 kPa
    odd = Members(Surface("odd", plain.ventricular, plain.actuation, volumes))
    low, high = odd.bands(beat)["stroke_volume"]
    assert high - low > 1.0
    lacking = beating(odd.surfaces[2], beat).numbers["stroke_volume"][0]
    assert lacking == pytest.approx(whole, rel=1e-3)


def test_a_band_with_a_member_that_does_not_beat_is_no_number(healthy):
    """Without the largest P_a of it no surface is wide enough: the band has no ends, rather than those of fewer surfaces."""
    strong = with_keys(healthy, {"driver.source_pressure": 200.0})
    assert np.isnan(Members(linear()).bands(strong)["stroke_volume"]).all()


def test_two_devices_of_the_project_pump_the_same(root):
    beat = read_circulations(root / "config/beats")["two_devices"]
    found = beating(read_surfaces(root / "docs/data/surfaces.nc")[8], beat)
    assert found.status == PERIODIC_STATE, found.reason
    left, right = found.numbers["stroke_volume"]
    assert left == pytest.approx(right, rel=1e-2)
    assert found.numbers["arterial_mean"][1] < 0.4 * found.numbers["arterial_mean"][0]


def test_what_cannot_beat_says_why(healthy):
    outside = beating(linear(), with_keys(healthy, {"driver.source_pressure": 200.0}))
    assert outside.status == "outside_surface"
    assert "0 to 120 kPa" in outside.reason
    assert np.isnan(outside.numbers["stroke_volume"]).all()
    weak = beating(linear(), with_keys(healthy, {"driver.source_pressure": 0.5}))
    assert weak.status == "no_output"
    assert "cannot deliver" in weak.reason
    short = beating(linear(), healthy, most_beats=2)
    assert short.status == NOT_PERIODIC


def test_a_sweep_has_a_status_for_every_set(healthy):
    dataset = swept(linear(), healthy, {"driver.rate": [50.0, 100.0], "driver.source_pressure": [60.0, 300.0]})
    assert dataset.status.values.tolist() == [["periodic", "outside_surface"]] * 2
    assert np.isfinite(dataset.stroke_volume[:, 0]).all()
    assert np.isnan(dataset.stroke_volume[:, 1]).all()
    assert dataset.arterial_mean.attrs["units"] == "kPa"


def test_a_pressure_that_holds_an_output_is_found(healthy):
    target = float(beating(linear(), healthy).numbers["cardiac_output"][0])
    weaker = with_keys(healthy, {"systemic.peripheral_resistance": 1.5 * healthy.systemic.peripheral_resistance})
    pressure = held(linear(), weaker, "cardiac_output", target, "driver.source_pressure", 20.0, 110.0)
    assert pressure > healthy.driver.source_pressure
    again = beating(linear(), with_keys(weaker, {"driver.source_pressure": pressure}))
    assert again.numbers["cardiac_output"][0] == pytest.approx(target, rel=5e-3)
    assert np.isnan(held(linear(), weaker, "cardiac_output", 100.0, "driver.source_pressure", 20.0, 110.0))


def test_every_circulation_that_is_shipped_can_be_read(root):
    for file in sorted((root / "config/beats").glob("*.yaml")):
        beat = parse(Beat, read_yaml(file), file)
        assert beat.description
        assert 60 * MMHG < beat.systemic.arterial_pressure < 130 * MMHG


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("rate", 80, "with its unit"),
        ("source_pressure", 60.0, "with its unit"),
        ("rate", "80 kPa", "with its unit"),
        ("rate", "800 1/min", "5 to 300"),
        ("line_resistance", "-1 kPa s/ml", "1e-05 to 10"),
        ("duty", 1.0, "less than 1"),
    ],
)
def test_numbers_without_a_unit_or_out_of_range_are_refused(root, key, value, expected):
    file = root / "config/beats/healthy.yaml"
    data = read_yaml(file)
    data["driver"][key] = value
    with pytest.raises(ConfigError, match=expected) as caught:
        parse(Beat, data, file)
    assert caught.value.key == f"driver.{key}"
    assert caught.value.example


def test_keys_that_are_none_are_named(healthy):
    with pytest.raises(LimoError, match=r"driver.source_pressure"):
        with_keys(healthy, {"driver.source": 1.0})
    with pytest.raises(ConfigError, match="5 to 300"):
        with_keys(healthy, {"driver.rate": 400.0})
    again = with_keys(healthy, {"driver.duty": 0.4, "driver.rate": healthy.driver.rate})
    assert again == healthy.model_copy(update={"driver": healthy.driver.model_copy(update={"duty": 0.4})})
