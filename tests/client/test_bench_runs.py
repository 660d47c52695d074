"""stratus bench over more than one load: the sweep to the knee, and two runs held against each other, with numpy's resampling beside."""
import json
import os
import shutil
import signal
import subprocess
import threading
import time

import numpy
import pytest

from conftest import BUILD

SLOW_S = 0.4  # of an answer: what a busy machine adds does not matter beside it


def sweep(stratus, service, *options):
    return stratus(service, "bench", "--sweep", "--duration", "0.4", "--warm-up", "0", "--get", "/x", *options)


def late(good):
    """Answers after a while, from the one numbered `good` on every other time by a refusal."""

    def reply(handler, number, body):
        time.sleep(SLOW_S)
        handler.problem(503) if number >= good and number % 2 else handler.picture()

    return reply


@pytest.mark.skipif(not shutil.which("gnuplot"), reason="gnuplot is not installed")
def test_a_sweep_ends_between_what_is_borne_and_what_is_not(service, stratus, tmp_path):
    service.reply = late(20 + 30)  # all of the first two steps
    done = sweep(stratus, service, "--rate", "50", "--json", tmp_path / "s.json", "--plot", tmp_path / "s.png")
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "s.json").read_text())
    assert found["knee_per_s"] == 75 and found["beyond_per_s"] == pytest.approx(75 * 1.5 ** (1 / 8))
    rates = [step["rate_per_s"] for step in found["steps"]]
    assert rates == sorted(rates) and [step["borne"] for step in found["steps"]] == [True, True] + [False] * 4
    assert [step["report"]["asked"] for step in found["steps"][:2]] == [20, 30]
    assert "knee: 75 requests/s are borne" in done.stdout and done.stdout.count("not borne") == 4
    assert (tmp_path / "s.png").read_bytes().startswith(b"\x89PNG") and sorted(os.listdir(tmp_path)) == ["s.json", "s.png"]


def test_a_sweep_goes_down_where_it_begins_too_high(service, stratus, tmp_path):
    service.reply = lambda handler, number, body: handler.problem(503) if number < 8 else late(10**9)(handler, number, body)
    done = sweep(stratus, service, "--rate", "20", "--json", tmp_path / "s.json", "-q")
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "s.json").read_text())
    assert found["steps"][0]["rate_per_s"] == 10 and found["steps"][0]["borne"] and found["beyond_per_s"] == 20
    assert 10 < found["knee_per_s"] < 20


def test_a_sweep_that_finds_nothing_says_so(service, stratus):
    service.reply = lambda handler, *_: handler.problem(503)
    done = sweep(stratus, service, "--rate", "100", "--duration", "0.1")
    assert done.returncode == 1 and "not even" in done.stderr
    done = sweep(stratus, service)
    assert done.returncode == 1 and "nothing is answered well" in done.stderr


def test_a_bound_of_latency_ends_a_sweep(service, stratus):
    service.reply = late(10**9)
    done = sweep(stratus, service, "--rate", "20", "--within-ms", "100", "--duration", "0.1")
    assert done.returncode == 1 and "not even" in done.stderr


# --- results that would be lost ---------------------------------------------------------------------------------------------------------------

FOREVER = ["--duration", "3600", "--warm-up", "0", "--get", "/x"]


@pytest.mark.parametrize("options", [["--json", "no/a.json"], ["--json", "."], ["--sweep", "--json", "no/a.json"], ["--sweep", "--plot", "no/a.png"]])
def test_what_has_no_place_is_told_before_the_load(service, stratus, tmp_path, options):
    done = stratus(service, "bench", *FOREVER, *options, cwd=tmp_path, timeout=60)
    assert done.returncode == 4 and (f"{options[-1]}: " in done.stderr or "gnuplot" in done.stderr)
    assert not service.asked and os.listdir(tmp_path) == []


def test_no_gnuplot_is_told_before_the_load(service, stratus, tmp_path):
    done = stratus(service, "bench", "--sweep", *FOREVER, "--plot", tmp_path / "a.png", env={"PATH": str(tmp_path)}, timeout=60)
    assert done.returncode == 4 and "gnuplot" in done.stderr
    assert not service.asked and os.listdir(tmp_path) == []


def test_old_results_survive_the_look_at_their_place(service, stratus, tmp_path):
    (tmp_path / "a.json").write_text("old")
    service.reply = lambda handler, *_: handler.problem(503)
    assert sweep(stratus, service, "--rate", "100", "--duration", "0.1", "--json", tmp_path / "a.json").returncode == 1
    assert (tmp_path / "a.json").read_text() == "old" and os.listdir(tmp_path) == ["a.json"]


@pytest.mark.parametrize("options", [["--duration", "0.2"], ["--duration", "0.1", "--sweep", "--rate", "50"]])
def test_tables_that_nobody_gets_are_an_error(service, options):
    service.reply = late(5)  # all of a sweep's first step
    with open("/dev/full", "w") as full:
        command = [BUILD / "stratus", "bench", "--server", service.url, "--warm-up", "0", "--get", "/x", *options]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=180)
    assert done.returncode == 4 and "standard output" in done.stderr, done.stderr


def interrupted(service, asked, *options):
    """A load on a service that answers no more after some requests, interrupted as soon as `asked` have come."""
    command = [BUILD / "stratus", "bench", "--server", service.url, "--warm-up", "0", "--get", "/x", *map(str, options)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        for _ in range(6000):
            if len(service.asked) >= asked or process.poll() is not None:
                break
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
    return process.returncode, out, err


def held(end, answered):
    def reply(handler, number, body):
        if number >= answered:
            end.wait(120)
        handler.picture()

    return reply


def test_a_load_that_is_interrupted_tells_what_it_measured(service, tmp_path):
    end = threading.Event()
    service.reply = held(end, 30)
    try:
        # Three clients that ask when they were answered: at the 33rd request 30 answers have come, and three have not.
        status, out, err = interrupted(service, 33, "--duration", 3600, "--connections", 3, "--json", tmp_path / "a.json")
    finally:
        end.set()
    assert status == 130 and "interrupted" in err and "3 requests had no answer" in err, err
    found = json.loads((tmp_path / "a.json").read_text())
    assert found["asked"] == found["good"]["count"] == 30 and found["unanswered"] == 3 and found["errors"] == 0
    assert 0 < found["measured_s"] < 3600 and found["asked_per_s"] == pytest.approx(30 / found["measured_s"], rel=1e-6)
    assert "200: 30" in out


def test_a_sweep_that_is_interrupted_keeps_its_whole_steps(service, tmp_path):
    end = threading.Event()
    service.reply = held(end, 10)  # all of the first step
    try:
        status, out, err = interrupted(service, 11, "--sweep", "--rate", 50, "--duration", 0.2, "--json", tmp_path / "a.json")
    finally:
        end.set()
    assert status == 130 and "1 whole steps" in err, err
    steps = json.loads((tmp_path / "a.json").read_text())["steps"]
    assert [step["report"]["good"]["count"] for step in steps] == [10] and "knee" in out


# --- two runs --------------------------------------------------------------------------------------------------------------------------------


def run_of(path, seconds, **more):
    values, counts = numpy.unique(numpy.round(seconds * 1e9).astype(int), return_counts=True)
    histogram = [[int(value), int(count)] for value, count in zip(values, counts)]
    good = {"count": len(seconds), "mean_s": float(seconds.mean()), "deviation_s": float(seconds.std()), "histogram": histogram}
    path.write_text(json.dumps({"load": {"kind": "open"}, "good": good, "good_per_s": 100.0, "status": {"200": len(seconds)}, "error": {"broken": 3}, **more}))
    return path


def compared(stratus, old, new):
    done = stratus(None, "bench", "--compare", old, new, "--json", "-")
    assert done.returncode == 0, done.stderr
    return {row["name"]: row for row in json.loads(done.stdout)}


def test_intervals_are_those_of_resampling(stratus, tmp_path):
    random = numpy.random.default_rng(1)
    old, new = random.lognormal(0, 0.5, 4000) * 0.01, random.lognormal(0, 0.5, 3000) * 0.012
    rows = compared(stratus, run_of(tmp_path / "a", old), run_of(tmp_path / "b", new))
    for name, share in (("p50 ms", 0.5), ("p90 ms", 0.9), ("p99 ms", 0.99)):
        quantile = lambda values: numpy.quantile(values, share, method="inverted_cdf")
        again = [quantile(random.choice(new, len(new))) / quantile(random.choice(old, len(old))) for _ in range(1500)]
        low, high = numpy.quantile(again, [0.025, 0.975])
        row = rows[name]
        assert row["old"] == pytest.approx(1000 * quantile(old), rel=1e-6) and row["ratio"] == pytest.approx(quantile(new) / quantile(old), rel=1e-6)
        width = high - low
        assert row["low"] == pytest.approx(low, abs=0.15 * width) and row["high"] == pytest.approx(high, abs=0.15 * width)
    assert rows["mean ms"]["ratio"] == pytest.approx(new.mean() / old.mean(), rel=1e-6)
    errors = numpy.hypot(old.std() / old.mean() / 4000**0.5, new.std() / new.mean() / 3000**0.5)
    assert (rows["mean ms"]["high"] - rows["mean ms"]["low"]) / rows["mean ms"]["ratio"] == pytest.approx(2 * 1.96 * errors, rel=0.1)
    assert rows["p99.99 ms"]["verdict"] == "too few"


def test_verdicts(stratus, tmp_path):
    random = numpy.random.default_rng(2)
    seconds = random.lognormal(0, 0.5, 20000) * 0.01
    a = run_of(tmp_path / "a", seconds)
    assert {row["verdict"] for name, row in compared(stratus, a, a).items() if name != "p99.99 ms"} == {"no difference seen"}
    b = run_of(tmp_path / "b", 1.1 * seconds, good_per_s=90.0)
    rows = compared(stratus, a, b)
    assert rows["good per s"]["verdict"] == "less" and all(rows[name]["verdict"] == "more" for name in ("mean ms", "p50 ms", "p90 ms", "p99 ms"))
    assert compared(stratus, b, a)["p50 ms"]["verdict"] == "less"
    text = stratus(None, "bench", "--compare", a, b)
    assert "broken: 3" in text.stdout and "200: 20000" in text.stdout and text.stderr == ""
    other = run_of(tmp_path / "c", seconds, load={"kind": "closed"})
    assert "not the same" in stratus(None, "bench", "--compare", a, other).stderr


def test_a_run_is_what_was_measured(service, stratus, tmp_path):
    for name in ("a", "b"):
        assert stratus(service, "bench", "--rate", "100", "--duration", "0.5", "--warm-up", "0", "--get", "/x", "-q", "--json", tmp_path / name).returncode == 0
    report = json.loads((tmp_path / "a").read_text())
    assert sum(count for _, count in report["good"]["histogram"]) == report["good"]["count"] == 50
    assert report["good"]["histogram"][-1][0] == pytest.approx(report["good"]["max_s"] * 1e9, abs=1)
    rows = compared(stratus, tmp_path / "a", tmp_path / "b")
    assert rows["p50 ms"]["old"] == pytest.approx(1000 * report["good"]["p50_s"], rel=1e-6)


@pytest.mark.parametrize("options", [["--compare", "a"], ["--compare", "no", "no"], ["--plot", "a.png"], ["--within-ms", "3"], ["--sweep", "--plot", "a.jpg"]])
def test_usage(stratus, tmp_path, options):
    assert stratus(None, "bench", *options, cwd=tmp_path).returncode == 2


def test_what_is_no_run(stratus, tmp_path):
    (tmp_path / "a").write_text("{}")
    done = stratus(None, "bench", "--compare", tmp_path / "a", tmp_path / "a")
    assert done.returncode == 2 and "no run" in done.stderr
