"""The proofs under load judge rightly: what they are told of is made up here."""
import copy
import datetime
import importlib.util
import json

import pytest

from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]


def load_module(path, *arguments, monkeypatch):
    monkeypatch.setattr("sys.argv", [str(path), *arguments])
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# --- make load -----------------------------------------------------------------------------------------------------------------------


@pytest.fixture
def load(monkeypatch):
    return load_module(TESTS / "load" / "load.py", "build", "32", monkeypatch=monkeypatch)


def answers(good_per_s, asked_per_s, p99_s, refused=0):
    latency = {"count": refused, "p50_s": 0.001, "p99_s": 0.02} if refused else {"count": 0}
    return {"good_per_s": good_per_s, "asked_per_s": asked_per_s, "good": {"count": 100, "p99_s": p99_s}, "refused": latency, "errors": 0, "other": {"count": 0}}


def fair_round(speed=1.0):
    """40 pictures a second at speed 1, a queue of 32 takes 0.8 s; each load at a speed of its own would do as well."""
    rate = 40 * speed
    return {
        0: answers(rate, rate, 0.2 / speed), 0.5: answers(rate / 2, rate / 2, 0.1 / speed), 1: answers(0.95 * rate, rate, 0.5 / speed),
        2: answers(rate, 2 * rate, 0.75 / speed, 100), 4: answers(rate, 4 * rate, 0.78 / speed, 300),
    }


def broken(load, rounds):
    return [text for holds, text in load.judge(rounds, 32) if not holds]


def test_bounds_that_hold(load):
    assert broken(load, [fair_round(), fair_round(0.4), fair_round(1.7)]) == []


def test_one_round_is_disturbed(load):
    """The machine stood still for a while, in one round of three."""
    disturbed = fair_round()
    disturbed[4] = answers(8, 160, 3.9, 300)
    assert broken(load, [fair_round(), disturbed, fair_round()]) == []
    assert len(broken(load, [disturbed, copy.deepcopy(disturbed), fair_round()])) == 1  # of goodput: the pictures took so long


@pytest.mark.parametrize(
    "offered, change, word",
    [
        (4, {"good": {"count": 100, "p99_s": 0.9}}, "p99 of those taken"),
        (2, {"good": {"count": 0}}, "p99 of those taken"),
        (1, {"good": {"count": 100, "p99_s": 0.81}}, "p99 of those taken"),
        (2, {"refused": {"count": 50, "p50_s": 0.1, "p99_s": 0.3}}, "refusals"),
        (0.5, {"errors": 1}, "neither a picture nor a refusal"),
        (4, {"other": {"count": 1}}, "neither a picture nor a refusal"),
        (4, {"good_per_s": 33}, "goodput"),
        (4, {"asked_per_s": 90}, "was offered"),
    ],
)
def test_bounds_that_are_broken(load, offered, change, word):
    rounds = [fair_round() for _ in range(3)]
    for found in rounds:
        found[offered].update(change)
    found = broken(load, rounds)
    assert len(found) == 1 and word in found[0], found


# --- make soak -----------------------------------------------------------------------------------------------------------------------


@pytest.fixture
def soak(monkeypatch):
    return load_module(TESTS / "soak" / "soak.py", "build", monkeypatch=monkeypatch)


NOON = datetime.datetime(2026, 6, 1, 12, tzinfo=datetime.timezone.utc)


def line(ended_s, duration_s, status, problem=None, scene="a"):
    """Of a request that ended so many seconds after noon."""
    time = (NOON + datetime.timedelta(seconds=ended_s)).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    entry = {"time": time, "event": "request", "id": f"{ended_s}", "status": status, "duration_ms": 1000 * duration_s, "scene": scene}
    return json.dumps({**entry, "problem": problem} if problem else entry)


def unexplained(soak, lines, *faults):
    """faults: (name, seconds after noon at which it struck, or None)."""
    made = [soak.Fault(name, at if at is None else (NOON.timestamp() + at - 0.05, NOON.timestamp() + at)) for name, at in faults]
    return len(soak.unexplained(lines, made)[0])


def test_a_picture_is_given_up_for_a_fault_of_its_kind(soak):
    failed = line(10, 2, 500, "render-failed")
    assert unexplained(soak, [failed], ("gl-error", 9)) == 0
    assert unexplained(soak, [failed]) == unexplained(soak, [failed], ("gl-error", None)) == 1
    assert unexplained(soak, [failed], ("gl-memory", 9), ("gl-reset", 9), ("host-memory", 9)) == 1
    assert unexplained(soak, [failed], ("gl-error", 7)) == unexplained(soak, [failed], ("gl-error", 11)) == 1
    assert unexplained(soak, [line(10, 2, 503, "no-memory")], ("gl-memory", 9)) == 0
    assert unexplained(soak, [line(10, 2, 503, "no-memory")], ("gl-error", 9)) == 1


def test_a_fault_gives_up_one_picture(soak):
    first, other = line(10, 2, 500, "render-failed"), line(10.2, 2, 500, "render-failed", scene="b")
    assert unexplained(soak, [first, other], ("gl-error", 9)) == 1
    assert unexplained(soak, [first, other], ("gl-error", 9), ("gl-error", 9.5)) == 0
    assert unexplained(soak, [first, first], ("gl-error", 9)) == 0  # two had waited for one picture


def test_delays_follow_faults(soak):
    late = line(40, 5, 504, "deadline-passed")
    assert unexplained(soak, [late], ("gone", 20)) == 0
    assert unexplained(soak, [late], ("gone", 4)) == unexplained(soak, [late], ("gone", 41)) == 1
    assert unexplained(soak, [line(40, 5, 503, "renderer-unavailable")], ("gone", 39)) == 1  # it comes back


def test_what_is_no_failure(soak):
    assert unexplained(soak, [line(10, 1, 200), line(10, 1, 422, "invalid"), line(10, 1, 499), '{"level":"error","message":"gl: error"}']) == 0
    assert unexplained(soak, ["Segmentation fault"]) == 1
    assert unexplained(soak, [line(10, 1, 500, "internal")], ("gl-error", 9.5)) == 1
