"""The proofs under load judge rightly: what they are told of is made up here."""
import copy
import importlib.util

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
