"""Faults of a pressure line and of a scale: one fault, every channel that follows, as the recorder shows it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_logs import made_log

from bfi_cli.airdata import (
    DEPENDS_ON,
    air_data_of,
    altitude_of,
    calibrated_airspeed,
    channels_of,
    fault_distribution,
    impact_pressure_of_mach,
    isa_temperature,
    pressure_at,
    total_temperature,
)
from bfi_cli.commands import run_command
from bfi_cli.errors import DictionaryError, LogError
from bfi_cli.faults import Fault
from bfi_cli.faults.filters import Filter, response_of
from bfi_cli.flightlog import FlightLog, inject, read_log, write_log
from bfi_cli.quantities.channels import STANDARD
from bfi_cli.report.log import log_lines

RATE_HZ, N, ONSET_S, OFFSET_S = 10.0, 1200, 1040.0, 1080.0
T = 1000.0 + np.arange(N) / RATE_HZ
SINCE = np.maximum(T - ONSET_S, 0.0)
AFTER = T >= ONSET_S - 1e-6
FILTER = Filter(kind="gaussian", edge_hz=0.748, rate_hz=RATE_HZ)
AIR_CHANNELS = ("altitude", "altitude_rate", "cas", "mach", "tas", "sat")
SHAPES = {
    "pitot_blocked": {},
    "pitot_leak": {"time_constant_s": 5.0},
    "pitot_icing": {"magnitude": 0.0025},
    "pitot_water": {"magnitude": 0.025, "frequency_hz": 0.3},
    "static_blocked": {},
    "static_leak": {"time_constant_s": 5.0, "cabin_altitude_m": 1000.0},
}


def true_air():
    """Return static and impact pressure and total temperature of a flight that climbs and accelerates."""
    altitude = 3000.0 + 4.0 * (T - T[0]) + 30.0 * np.sin(0.2 * T)
    p_static = pressure_at(altitude)
    mach = 0.4 + 0.03 * np.sin(0.1 * T)
    tat = total_temperature(isa_temperature(altitude) + 8.0, mach)
    return p_static, impact_pressure_of_mach(mach, p_static), tat


def log_of(p_static, q_impact, tat, *names: str) -> FlightLog:
    made = {**channels_of(p_static, q_impact, tat, rate_of=T), "tat": tat, "pitch": 0.05 * np.sin(0.2 * T)}
    signals = {name: made[name] for name in (*(names or AIR_CHANNELS), "tat", "pitch")}
    return made_log(T, {name: STANDARD[name].unit for name in signals}, **signals)


P_STATIC, Q_IMPACT, TAT = true_air()
LOG = log_of(P_STATIC, Q_IMPACT, TAT)


def fault(shape: str, **keys: object) -> Fault:
    return Fault(**{"shape": shape, "onset_s": ONSET_S, **SHAPES.get(shape, {}), **keys})


def air_of(log: FlightLog):
    return air_data_of({name: log.channel(name).values for name in ("altitude", "cas", "tat")})


def expected_pressures(shape: str):
    """Return static and total pressure in the lines, written out anew."""
    total = P_STATIC + Q_IMPACT
    onset = int(np.argmax(AFTER))
    gone = 1.0 - np.exp(-SINCE / 5.0)
    cabin = float(pressure_at(1000.0))
    static = {
        "static_blocked": np.where(AFTER, P_STATIC[onset], P_STATIC),
        "static_leak": P_STATIC + gone * (cabin - P_STATIC),
    }
    pitot = {
        "pitot_blocked": np.where(AFTER, total[onset], total),
        "pitot_leak": P_STATIC + (1.0 - gone) * Q_IMPACT,
        "pitot_icing": P_STATIC + (1.0 - 0.0025 * SINCE) * Q_IMPACT,
        "pitot_water": P_STATIC + (1.0 + 0.025 * np.sin(2.0 * np.pi * 0.3 * SINCE)) * Q_IMPACT,
    }
    return static.get(shape, P_STATIC), pitot.get(shape, total)


@pytest.mark.parametrize("shape", SHAPES)
def test_every_channel_shows_the_pressures_in_the_lines(shape):
    faulty = inject(LOG, [fault(shape)])
    p_static, p_total = expected_pressures(shape)
    shown = channels_of(p_static, np.maximum(p_total - p_static, 0.0), TAT)
    for name in ("altitude", "cas", "mach", "tas", "sat"):
        # A static leak of 20 hPa takes all of the airspeed: near nothing a square root loses half of the digits.
        np.testing.assert_allclose(faulty.channel(name).values, shown[name], rtol=1e-9, atol=1e-5, err_msg=name)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_channels_that_follow_from_the_pressure_change_and_no_other(shape):
    faulty = inject(LOG, [fault(shape)])
    moved = "p_static" if shape.startswith("static") else "p_total"
    follow = {name for name in LOG.channels if moved in DEPENDS_ON.get(name, ())}
    assert faulty.truth is not None
    assert set(faulty.truth.clean) == follow
    assert ("altitude" in follow) == (moved == "p_static")
    for name in LOG.channels:
        same = np.array_equal(faulty.channel(name).values, LOG.channel(name).values)
        assert same == (name not in follow), name
    for name, clean in faulty.truth.clean.items():
        np.testing.assert_array_equal(clean, LOG.channel(name).values)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("offset_s", [None, OFFSET_S])
def test_it_acts_from_its_onset_to_its_offset(shape, offset_s):
    faulty = inject(LOG, [fault(shape, offset_s=offset_s)])
    outside = ~AFTER | (OFFSET_S - 1e-6 <= T) if offset_s else ~AFTER
    for name in AIR_CHANNELS:
        np.testing.assert_array_equal(faulty.channel(name).values[outside], LOG.channel(name).values[outside])
    assert np.abs(faulty.channel("cas").values - LOG.channel("cas").values)[~outside].max() > 0.3


def test_a_trapped_line_is_still_whatever_recorder_the_log_went_through():
    recorded = replace(LOG, filters=(FILTER,))
    after = T >= ONSET_S + 1.5
    pitot = air_of(inject(recorded, [fault("pitot_blocked")])).p_total[after]
    static = inject(recorded, [fault("static_blocked")])
    assert np.ptp(pitot) < 1e-6
    assert np.ptp(static.channel("altitude").values[after]) < 1e-6
    assert np.abs(static.channel("altitude_rate").values[after]).max() < 1e-6
    assert np.ptp(air_of(recorded).p_total[after]) > 1000.0


def test_an_oscillation_of_its_first_sample_changes_nothing_through_a_recorder():
    p_static, q_impact, tat = true_air()
    made = channels_of(p_static, q_impact, tat, rate_of=T)
    log = made_log(T, {"altitude": "m", "tat": "K"}, altitude=made["altitude"], cas=made["cas"], tat=tat)
    water = Fault(shape="pitot_water", magnitude=0.1, frequency_hz=0.02, onset_s=ONSET_S, offset_s=ONSET_S + 0.1)
    with pytest.raises(DictionaryError, match="changes no channel of the log"):
        inject(log, [water], response=response_of([FILTER], RATE_HZ))


def test_the_offsets_and_the_noise_of_the_log_stay():
    rng = np.random.default_rng(4)
    noisy = replace(
        LOG,
        channels={
            **LOG.channels,
            "tas": replace(
                LOG.channels["tas"], values=LOG.channel("tas").values + 0.15 + 0.01 * rng.standard_normal(N)
            ),
        },
    )
    faulty, clean = inject(noisy, [fault("pitot_icing")]), inject(LOG, [fault("pitot_icing")])
    np.testing.assert_allclose(
        faulty.channel("tas").values - noisy.channel("tas").values,
        clean.channel("tas").values - LOG.channel("tas").values,
        rtol=0,
        atol=1e-12,
    )


def test_a_small_fault_is_the_linear_distribution_of_the_thesis():
    faulty = inject(LOG, [fault("pitot_icing", magnitude=1e-6)])
    loss = -1e-6 * SINCE * Q_IMPACT
    for name in ("tas", "cas", "mach", "sat"):
        slope = fault_distribution(name, P_STATIC, P_STATIC + Q_IMPACT, TAT)[:, 1]
        change = faulty.channel(name).values - LOG.channel(name).values
        np.testing.assert_allclose(change, slope * loss, rtol=0, atol=1e-4 * np.abs(slope * loss).max())


@pytest.mark.parametrize("shape", SHAPES)
def test_the_log_shows_what_a_fault_before_the_recorder_would_have_made_of_it(shape):
    """To a hundredth of the change: the flight, the lines and the computer first, the low-pass last."""
    response = response_of([FILTER], RATE_HZ)

    def stored(log: FlightLog) -> FlightLog:
        def low_passed(values):
            return response.filtered(np.pad(values, (response.after, response.before), mode="edge"))

        channels = {name: replace(one, values=low_passed(one.values)) for name, one in log.channels.items()}
        return replace(log, channels=channels, filters=(FILTER,))

    real = stored(inject(replace(LOG, filters=()), [fault(shape, offset_s=OFFSET_S)]))
    injected = inject(stored(LOG), [fault(shape, offset_s=OFFSET_S)])
    amid = (T[0] + 3.0 < T) & (T[-1] - 3.0 > T) & (np.abs(T - OFFSET_S) > 2.0)
    for name in ("cas", "mach", "tas", "altitude"):
        change = np.abs(real.channel(name).values - stored(LOG).channel(name).values).max()
        error = np.abs(injected.channel(name).values - real.channel(name).values)[amid].max()
        assert error <= 0.01 * change + 1e-9, name


@pytest.mark.parametrize(
    "names", [("tas", "altitude"), ("cas", "altitude"), ("q_impact", "p_static"), ("ias", "altitude")]
)
def test_any_set_of_channels_that_tells_the_pressures_will_do(names):
    log = log_of(P_STATIC, Q_IMPACT, TAT, *names)
    faulty, whole = inject(log, [fault("pitot_blocked")]), inject(LOG, [fault("pitot_blocked")])
    air, expected = air_data_of({n: faulty.channel(n).values for n in (*names, "tat")}), air_of(whole)
    np.testing.assert_allclose(air.p_total, expected.p_total, rtol=1e-9)


def test_a_blocked_static_port_needs_no_airspeed():
    log = log_of(P_STATIC, Q_IMPACT, TAT, "altitude", "altitude_rate")
    faulty = inject(log, [fault("static_blocked")])
    assert faulty.truth is not None
    assert set(faulty.truth.clean) == {"altitude", "altitude_rate"}
    assert np.ptp(faulty.channel("altitude").values[AFTER]) < 1e-6


def test_a_scale_is_a_share_of_the_channels_own_reading():
    scaled = inject(LOG, [fault("scale", channel="tas", magnitude=0.02, offset_s=OFFSET_S)])
    factor = np.where(AFTER & (OFFSET_S - 1e-6 > T), 1.02, 1.0)
    np.testing.assert_allclose(scaled.channel("tas").values, factor * LOG.channel("tas").values, rtol=1e-14)
    assert scaled.truth is not None
    assert set(scaled.truth.clean) == {"tas"}


def test_a_frozen_sensor_keeps_its_reading_at_the_onset_noise_and_all():
    noisy = LOG.channel("tas").values + np.random.default_rng(0).standard_normal(N)
    log = replace(LOG, channels={**LOG.channels, "tas": replace(LOG.channels["tas"], values=noisy)})
    frozen = inject(log, [fault("frozen", channel="tas", offset_s=OFFSET_S)])
    held = AFTER & (OFFSET_S - 1e-6 > T)
    kept = frozen.channel("tas").values
    np.testing.assert_allclose(kept, np.where(held, noisy[np.argmax(held)], noisy), rtol=1e-12)
    assert frozen.truth is not None
    assert [*frozen.truth.clean] == ["tas"]


def test_faults_follow_one_another_and_the_clean_signal_is_that_before_the_first():
    first, second = fault("static_blocked"), fault("bias", channel="cas", magnitude=2.0, onset_s=1060.0)
    both = inject(LOG, [first, second])
    assert both.truth is not None
    assert both.truth.faults == (first, second)
    np.testing.assert_array_equal(both.truth.clean["cas"], LOG.channel("cas").values)
    alone = inject(LOG, [first]).channel("cas").values
    np.testing.assert_allclose(both.channel("cas").values - alone, np.where(T >= 1060.0 - 1e-6, 2.0, 0.0), atol=1e-12)


def test_missing_samples_stay_missing_and_do_not_spread():
    cas = LOG.channel("cas").values.copy()
    cas[700:705] = np.nan
    log = replace(LOG, channels={**LOG.channels, "cas": replace(LOG.channels["cas"], values=cas)})
    faulty, whole = inject(log, [fault("pitot_blocked")]), inject(LOG, [fault("pitot_blocked")])
    for name in ("cas", "tas", "mach"):
        made, bridged = faulty.channel(name).values, np.isin(np.arange(N), range(700, 705))
        np.testing.assert_array_equal(made[~bridged], whole.channel(name).values[~bridged])
        if name == "cas":
            assert np.isnan(made[bridged]).all()
        else:
            np.testing.assert_allclose(made[bridged], whole.channel(name).values[bridged], atol=0.01)


def spoilt(**values: float) -> FlightLog:
    channels = dict(LOG.channels)
    for name, value in values.items():
        changed = channels[name].values.copy()
        changed[700] = value
        channels[name] = replace(channels[name], values=changed)
    return replace(LOG, channels=channels)


@pytest.mark.parametrize(
    ("log", "wanted", "error", "message"),
    [
        (
            spoilt(cas=400.0),
            fault("pitot_blocked"),
            LogError,
            "'cas' is 400 m/s at 1070 s, 0 to 340.3 m/s, the equations",
        ),
        (spoilt(altitude=-9000.0), fault("static_blocked"), LogError, "'altitude' is -9000 m at 1070 s, known between"),
        (spoilt(cas=400.0), fault("pitot_blocked", offset_s=1060.0), None, ""),
        (
            log_of(P_STATIC, Q_IMPACT, TAT, "altitude"),
            fault("pitot_blocked"),
            LogError,
            "q_impact needs one of q_impact, p_total, cas, mach, ias, tas; the log has: altitude,",
        ),
        (
            log_of(P_STATIC, Q_IMPACT, TAT, "cas"),
            fault("static_leak"),
            LogError,
            "fault 'static_leak': p_static needs one of p_static, altitude; the log has: cas, pitch, tat; map one with",
        ),
        (
            LOG,
            fault("pitot_blocked", onset_s=2000.0),
            DictionaryError,
            "'pitot_blocked': never active in the log, got from",
        ),
        (LOG, fault("pitot_icing", magnitude=0.0), DictionaryError, "never active in the log, got magnitude 0 from"),
        (
            log_of(np.full(N, 9e4), np.full(N, 5e3), np.full(N, 280.0)),
            fault("pitot_blocked"),
            DictionaryError,
            "fault 'pitot_blocked': changes no channel of the log",
        ),
        (
            LOG,
            fault("static_leak", cabin_altitude_m=30_000.0),
            DictionaryError,
            "fault 'static_leak': cabin_altitude_m: altitude: the standard atmosphere is known between",
        ),
        (
            LOG,
            fault("pitot_water", magnitude=30.0),
            DictionaryError,
            "out of what the equations hold for, q_impact / p_static: the equations hold below Mach 1",
        ),
    ],
)
def test_what_cannot_be_injected_is_said_in_a_line(log, wanted, error, message):
    if error is None:
        assert inject(log, [wanted]).truth is not None
        return
    with pytest.raises(error) as refusal:
        inject(log, [wanted])
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rng = np.random.default_rng(1)
    elevator = 0.02 * np.sin(0.7 * T) + 0.01 * np.sin(1.9 * T)
    noise = {name: 1e-4 * np.abs(one.values).mean() * rng.standard_normal(N) for name, one in LOG.channels.items()}
    channels = {name: replace(one, values=one.values + noise[name]) for name, one in LOG.channels.items()}
    channels["elevator"] = replace(LOG.channels["pitch"], name="elevator", source="elevator", values=elevator)
    place = tmp_path_factory.mktemp("pressure") / "flight.h5"
    write_log(replace(LOG, channels=channels, filters=()), place)
    return place


SPECS = {
    "pitot_blocked": ("pitot_blocked,onset_s=1040", "pitot_blocked, from 1040 s"),
    "pitot_leak": ("pitot_leak,onset_s=1040,time_constant_s=2", "pitot_leak, from 1040 s"),
    "pitot_icing": ("pitot_icing,onset_s=1040,magnitude=0.0025", "pitot_icing, magnitude 0.0025 1/s, from 1040 s"),
    "pitot_water": (
        "pitot_water,onset_s=1040,magnitude=0.025,frequency_hz=0.3",
        "pitot_water, magnitude 0.025, from 1040 s",
    ),
    "static_blocked": ("static_blocked,onset_s=1040,offset_s=1080", "static_blocked, from 1040 s until 1080 s"),
    "static_leak": ("static_leak,onset_s=1040,time_constant_s=10", "static_leak, from 1040 s"),
    "scale": ("scale,channel=cas,onset_s=1040,magnitude=0.02", "scale on cas, magnitude 0.02, from 1040 s"),
}


@pytest.mark.first_rows(11)
@pytest.mark.parametrize("shape", SPECS)
@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_the_file_holds_the_truth_of_every_channel_that_changed(shape, suffix, path: Path, tmp_path: Path):
    spec, words = SPECS[shape]
    out = tmp_path / f"faulty{suffix}"
    assert run_command(["inject", str(path), "--fault", spec, "-o", str(out)]) == 0
    clean, faulty = read_log(path), read_log(out)
    assert faulty.truth is not None
    assert [one.shape for one in faulty.truth.faults] == [shape]
    assert log_lines(faulty)[1] == f"fault: {words}"
    changed = {n for n in clean.channels if not np.array_equal(clean.channel(n).values, faulty.channel(n).values)}
    assert changed == set(faulty.truth.clean)
    for name, values in faulty.truth.clean.items():
        np.testing.assert_array_equal(values, clean.channel(name).values)


@pytest.mark.first_rows(1)
@pytest.mark.usefixtures("undrawn", "unscanned")
@pytest.mark.parametrize("shape", ["static_blocked", "scale"])
@pytest.mark.parametrize("command", ["identify", "start-time"])
def test_an_analysis_counts_it_among_what_was_injected(
    command, shape, path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    faulty, dictionary = tmp_path / "faulty.h5", tmp_path / "dictionary.yaml"
    dictionary.write_text("atoms: [{name: step, shape: bias, channel: cas, onset_s: 1090}]\n")
    assert run_command(["inject", str(path), "--fault", SPECS[shape][0], "-o", str(faulty)]) == 0
    capsys.readouterr()
    names = (
        ["--output", "cas", "--shape", "bias"]
        if command == "start-time"
        else ["-d", str(dictionary), "--output", "cas"]
    )
    assert (
        run_command([command, str(faulty), "--input", "elevator", *names, "--json", "--out", str(tmp_path / "out")])
        == 0
    )
    truth = json.loads(capsys.readouterr().out)["truth"]
    if command == "identify":
        assert truth["isolated"] is False
        assert truth["missed"] == [f"{shape}{', channel=cas' * (shape == 'scale')}, onset_s=1040"]
    else:
        assert truth[0]["shape"] == shape
        assert (truth[0]["channel"] is None) == (shape == "static_blocked")


def test_the_altitude_of_a_leak_ends_at_that_of_the_cabin():
    faulty = inject(LOG, [fault("static_leak", time_constant_s=2.0)])
    assert faulty.channel("altitude").values[-1] == pytest.approx(1000.0, abs=1e-6)
    at_sea_level = inject(LOG, [replace(fault("static_leak", time_constant_s=2.0), cabin_altitude_m=None)])
    assert at_sea_level.channel("altitude").values[-1] == pytest.approx(0.0, abs=1e-6)
    assert altitude_of(pressure_at(1000.0)) == pytest.approx(1000.0)
    assert calibrated_airspeed(0.0) == at_sea_level.channel("cas").values[-1]
