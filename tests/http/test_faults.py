"""What becomes of requests, probes and the process when the GPU, its driver or the memory fail.

The daemon is build/stratusd-faulty: the delivered one, linked with tests/faults/faults.c, which makes what it calls fail when told to.
"""
import concurrent.futures
import contextlib
import http.client
import json
import os
import re
import shutil
import signal
import subprocess
import time

import pytest

from conftest import BUILD, KERNEL, ROOT, FaultyDaemon, in_some_try, send, wait_for

SMALL = {"width": 64, "height": 48}


@pytest.fixture(scope="module")
def faulty(tmp_path_factory):
    """One for all faults that a daemon survives."""
    daemon = FaultyDaemon(tmp_path_factory.mktemp("faulty"))
    yield daemon
    status = daemon.stop()
    daemon.assert_clean()
    assert status == 0


@pytest.fixture(scope="module", autouse=True)
def doomed(tmp_path_factory):
    """One whose device never comes back: it gives up after half a minute, while the other tests run. (daemon, running requests)"""
    daemon = FaultyDaemon(tmp_path_factory.mktemp("doomed"))
    pool = concurrent.futures.ThreadPoolExecutor(2)
    daemon.fail("gone")
    daemon.fail("gl-reset", 0)
    yield daemon, [pool.submit(daemon.render, {"clouds": {"seed": i}, "output": SMALL}) for i in range(2)]
    daemon.stop()
    pool.shutdown()
    daemon.assert_clean()


# --- the delivered program ---------------------------------------------------------------------------------------------------------


def test_the_delivered_program_knows_no_faults(tmp_path):
    result = subprocess.run([BUILD / "stratusd", "--faults", tmp_path], capture_output=True, text=True, timeout=300)
    assert result.returncode == 2 and "unknown flag '--faults'" in result.stderr
    assert "--faults" not in subprocess.run([BUILD / "stratusd", "--help"], capture_output=True, text=True, timeout=300).stdout
    words = (b"--faults", b"faulty_gl", b"host-memory", b"__wrap_")
    delivered, faulty = (BUILD / "stratusd").read_bytes(), (BUILD / "stratusd-faulty").read_bytes()
    assert not any(word in delivered for word in words)
    assert all(word in faulty for word in words)


# --- a lost context ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("after", [0, 3, 9])
def test_a_lost_context(faulty, after):
    """The picture comes out all the same, and is the same as before."""
    scene = {"clouds": {"seed": 40 + after}, "output": SMALL}
    expected = faulty.render(scene)
    resets, repeated = faulty.resets("guilty"), faulty.metric("stratus_renders_repeated_total")
    faulty.fail("gl-reset", after)
    answers = [faulty.render({**scene, "sun": {"elevation_deg": 30 + i}}) for i in range(3)]
    assert [a.status for a in answers] == [200] * 3
    assert faulty.has_failed("gl-reset")
    assert wait_for(lambda: faulty.resets("guilty") == resets + 1)
    assert wait_for(faulty.is_ready)
    again = faulty.render(scene)
    assert (again.status, again.body, again.headers["ETag"]) == (200, expected.body, expected.headers["ETag"])
    assert faulty.metric("stratus_renders_repeated_total") - repeated in (0, 1)  # 0: noticed between two of them


def test_a_context_lost_in_the_middle_of_a_picture(faulty):
    repeated = faulty.metric("stratus_renders_repeated_total")
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        with faulty.holding():
            running = pool.submit(faulty.render, {"sun": {"elevation_deg": 12.25}, "clouds": {"seed": 99}, "output": {"width": 320, "height": 240}})
            assert wait_for(faulty.is_held)
            faulty.fail("gl-reset", 2)  # the passes of a new sky ask more often
        assert running.result().status == 200
    assert faulty.metric("stratus_renders_repeated_total") == repeated + 1


def test_a_scene_that_loses_every_context(faulty):
    """It is given up after the second time, and others go on."""
    resets = faulty.resets("guilty")
    faulty.fail("poison", 333)
    answer = faulty.render({"output": {"width": 333, "height": 48}})
    assert answer.status == 500
    assert answer.json["type"] == "urn:stratus:problem:render-failed"
    faulty.heal("poison")
    assert wait_for(lambda: faulty.resets("guilty") == resets + 2)
    assert wait_for(faulty.is_ready)
    assert faulty.render({"output": {"width": 333, "height": 48}}).status == 200


def test_failures_on_end(faulty):
    """Of renders that fail without the driver's saying why each is answered so, and after the third the renderer is made anew."""
    scene = {"clouds": {"seed": 90}, "output": SMALL}
    faulty.render(scene)
    resets = faulty.resets("failures")
    for turn in range(3):
        assert faulty.resets("failures") == resets
        faulty.fail("gl-error")
        assert faulty.render({**scene, "camera": {"azimuth_deg": 10 * turn}}).status == 500
    assert wait_for(lambda: faulty.resets("failures") == resets + 1)
    assert wait_for(faulty.is_ready)
    assert faulty.render(scene, Cache_Control="no-cache").status == 200


def test_an_error_is_no_lack_of_memory(faulty):
    """Not even where memory is asked for, by a new sky and a picture of a new size."""
    scene = {"sun": {"elevation_deg": 17.75}, "output": {"width": 77, "height": 55}}
    faulty.fail("gl-error")
    answer = faulty.render(scene)
    assert faulty.has_failed("gl-error")
    assert (answer.status, answer.json["type"]) == (500, "urn:stratus:problem:render-failed")
    assert faulty.render(scene).status == 200


def test_many_requests_over_a_reset(faulty):
    """Whoever waits notices only that it takes longer."""
    with concurrent.futures.ThreadPoolExecutor(6) as pool:
        running = [pool.submit(faulty.render, {"clouds": {"seed": 60 + i}, "output": SMALL}) for i in range(6)]
        faulty.fail("gl-reset", 5)
        assert [r.result().status for r in running] == [200] * 6
    faulty.render({"clouds": {"seed": 70}, "output": SMALL})
    assert wait_for(lambda: faulty.has_failed("gl-reset"))
    assert wait_for(faulty.is_ready)


def test_a_reference_over_a_reset(faulty):
    """It begins again when the context is lost for another picture that passed it."""
    reference = {"model": {"name": "reference", "samples": 32, "seed": 8}, "output": {"width": 64, "height": 48}}
    resets, repeated = faulty.resets("guilty"), faulty.metric("stratus_renders_repeated_total")
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        with faulty.holding():
            running = pool.submit(faulty.render, reference)
            assert wait_for(faulty.is_held)
            faulty.fail("gl-reset", 12)  # its passes ask more often
        answer = running.result()
    assert answer.status == 200 and answer.headers["Stratus-Samples"] == "32"
    assert faulty.resets("guilty") == resets + 1
    assert faulty.metric("stratus_renders_repeated_total") == repeated + 1
    again = faulty.render(reference, Cache_Control="no-cache")
    assert again.body == answer.body


def test_a_device_that_is_gone_for_a_while(faulty):
    """Not ready, but alive; what is asked for meanwhile is answered when the device is back."""
    faulty.fail("gone")
    faulty.fail("gl-reset", 0)
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        running = [pool.submit(faulty.render, {"clouds": {"seed": 80 + i}, "output": SMALL}) for i in range(2)]
        assert wait_for(lambda: faulty.get("/readyz").json["status"] == "recovering")
        assert faulty.get("/readyz").status == 503
        assert faulty.get("/healthz").status == 200
        assert faulty.metric("stratus_ready") == 0
        assert faulty.get("/v1/presets").status == 200
        assert wait_for(lambda: "tries to bring it up again failed" in faulty.text)
        faulty.heal("gone")
        assert [r.result().status for r in running] == [200] * 2
    assert wait_for(faulty.is_ready)


# --- memory ------------------------------------------------------------------------------------------------------------------------


def check_no_memory(daemon, answer):
    assert answer.status == 503
    assert answer.json["type"] == "urn:stratus:problem:no-memory"
    assert int(answer.headers["Retry-After"]) >= 1
    assert daemon.get("/healthz").status == 200 and daemon.is_ready()


def test_no_memory_on_the_device(faulty):
    scene = {"sun": {"elevation_deg": 51.5}, "output": SMALL}
    faulty.fail("gl-memory")
    check_no_memory(faulty, faulty.render(scene))
    assert faulty.has_failed("gl-memory")
    assert faulty.render(scene).status == 200


def test_no_memory_on_the_host(faulty):
    scene = {"clouds": {"seed": 5}, "output": {"width": 512, "height": 384}}
    faulty.render({**scene, "output": SMALL})  # so that nothing but the picture itself is new
    faulty.fail("host-memory", 512 * 384 * 3)
    check_no_memory(faulty, faulty.render(scene))
    assert faulty.has_failed("host-memory")
    assert faulty.render(scene).status == 200


def golden(daemon, result):
    return daemon.metric(f'stratus_golden_renders_total{{result="{result}"}}')


WIDE = {"width": 3200, "height": 16}


def test_pictures_that_do_not_fit(faulty):
    """After each third on end the golden render decides; the daemon stays ready, and others go on."""
    passed, resets = golden(faulty, "passed"), {reason: faulty.resets(reason) for reason in ("golden", "failures")}
    faulty.fail("gl-full", 3000)
    for turn in range(1, 3):
        for i in range(3):
            answer = faulty.render({"camera": {"azimuth_deg": 10 * turn + i}, "output": WIDE})
            check_no_memory(faulty, answer)
        assert wait_for(lambda: golden(faulty, "passed") == passed + turn)
    assert faulty.render({"camera": {"azimuth_deg": 33}, "output": SMALL}).status == 200
    faulty.heal("gl-full")
    assert faulty.render({"camera": {"azimuth_deg": 34}, "output": WIDE}).status == 200
    assert {reason: faulty.resets(reason) for reason in resets} == resets


@pytest.mark.parametrize("width", [0, 100])
def test_no_memory_for_anything_new(faulty, width):
    """Not ready, until the golden render comes out again: that which is remembered of its sky helps it as little as others. It is 96 pixels wide."""
    resets, failed = faulty.resets("golden"), golden(faulty, "failed")
    assert faulty.render({"output": WIDE}).status == 200
    faulty.fail("gl-full", width)
    for i in range(3):
        assert faulty.render({"sun": {"elevation_deg": 21 + i + width / 1000}, "output": WIDE}).status == 503
    assert wait_for(lambda: not faulty.is_ready())
    assert golden(faulty, "failed") > failed
    faulty.heal("gl-full")
    assert wait_for(faulty.is_ready)
    assert faulty.resets("golden") == resets + 1
    assert faulty.render({"sun": {"elevation_deg": 21}, "output": WIDE}).status == 200


def test_no_memory_for_small_pictures(faulty):
    """What has none for these has none for any: the renderer is made anew, as after other failures on end."""
    resets = faulty.resets("failures")
    faulty.render({"output": SMALL})
    for i in range(3):
        assert faulty.resets("failures") == resets
        faulty.fail("gl-memory")
        assert faulty.render({"sun": {"elevation_deg": 61 + i}, "output": SMALL}).json["type"] == "urn:stratus:problem:no-memory"
    assert wait_for(lambda: faulty.resets("failures") == resets + 1)
    assert wait_for(faulty.is_ready)
    assert faulty.render({"sun": {"elevation_deg": 61}, "output": SMALL}).status == 200


def test_pictures_that_cannot_be_written(faulty):
    """Not ready once three could not on end, by itself ready again when one can."""
    scene = {"clouds": {"seed": 6200}, "output": SMALL}
    faulty.fail("encode")
    assert [faulty.render(scene).status for _ in range(2)] == [500] * 2
    assert faulty.is_ready()
    assert faulty.render(scene).status == 500
    assert wait_for(lambda: not faulty.is_ready())
    assert faulty.get("/readyz").json["status"] == "recovering"
    assert faulty.get("/healthz").status == 200 and faulty.render(scene).status == 500
    faulty.heal("encode")
    assert wait_for(faulty.is_ready)
    assert faulty.render(scene).status == 200


# --- a shader that is compiled when it is needed ---------------------------------------------------------------------------------------


def test_a_shader_that_does_not_compile(faulty):
    """Pictures that take it are answered 500, not that there is no memory; the log names it, and no renderer is made anew for it."""
    scene = {"camera": {"projection": "fisheye"}, "model": {"shading": "paper"}, "output": {"width": 48, "height": 48}}
    resets, before = faulty.resets("failures"), len(faulty.text)
    for seed in range(4):  # one more than failures on end that have the renderer made anew
        faulty.fail("shader")
        answer = faulty.render({**scene, "clouds": {"seed": 5000 + seed}})
        assert faulty.has_failed("shader")
        assert (answer.status, answer.json["type"]) == (500, "urn:stratus:problem:render-failed")
    lines = faulty.text[before:].splitlines()
    assert sum(bool(re.search(r" error +gl: compiling shaders/passes/[a-z_]+\.glsl failed", line)) for line in lines) == 4, lines
    assert not any("out of memory" in line for line in lines)
    assert faulty.render(scene).status == 200
    assert faulty.resets("failures") == resets


# --- the golden render ---------------------------------------------------------------------------------------------------------------


def test_a_device_that_draws_nothing(start_faulty):
    """It is noticed without a request, and so is that it draws again."""
    daemon = start_faulty("--golden-s", "1")
    assert wait_for(lambda: daemon.metric('stratus_golden_renders_total{result="passed"}') >= 2)
    scene = {"clouds": {"seed": 7}, "output": SMALL}
    daemon.fail("black")
    with concurrent.futures.ThreadPoolExecutor(1) as pool:
        early = pool.submit(daemon.render, scene)  # comes out wrong, or waits when the golden render was quicker
        assert wait_for(lambda: not daemon.is_ready())
        assert daemon.get("/healthz").status == 200
        assert wait_for(lambda: daemon.metric('stratus_golden_renders_total{result="failed"}') >= 1)
        daemon.heal("black")
        assert early.result().status == 200
    assert wait_for(daemon.is_ready)
    assert daemon.resets("golden") == 1
    assert "golden render: " in daemon.text
    assert daemon.render(scene).body == daemon.render(scene, Cache_Control="no-cache").body  # nothing of that time is kept


def test_a_device_that_draws_nothing_while_it_is_busy(start_faulty):
    """It is noticed though there is work throughout: one picture of many minutes."""
    daemon = start_faulty("--golden-s", "1")
    with send(daemon, {"model": {"name": "reference", "samples": 4096}, "output": {"width": 320, "height": 240}}):
        assert wait_for(lambda: daemon.metric("stratus_queue_taken") == 1)
        passed = golden(daemon, "passed")
        assert wait_for(lambda: golden(daemon, "passed") >= passed + 2)
        assert daemon.metric("stratus_queue_taken") == 1  # that one still
        daemon.fail("black")
        assert wait_for(lambda: not daemon.is_ready())
        daemon.heal("black")
        assert wait_for(daemon.is_ready)
        assert daemon.resets("golden") == 1


def start_in_vain(program, *flags, folder):
    result = subprocess.run(
        [BUILD / program, *flags, "--listen", "127.0.0.1:0", "--state-dir", folder / "state", "--kernel", KERNEL],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert result.returncode == 1
    assert result.stdout == ""
    return result.stderr


def test_start_on_a_device_that_draws_nothing(tmp_path):
    os.symlink("0", tmp_path / "black")
    error = start_in_vain("stratusd-faulty", "--faults", tmp_path, folder=tmp_path)
    assert "golden render: " in error and "does not render as it should" in error


def test_start_with_a_shader_that_does_not_compile(tmp_path):
    """The log names file and line."""
    shutil.copytree(ROOT / "shaders", tmp_path / "shaders")
    path = tmp_path / "shaders" / "lib" / "atmosphere.glsl"
    lines = path.read_text().split("\n")
    lines.insert(20, "this is no GLSL;")
    path.write_text("\n".join(lines))
    error = start_in_vain("stratusd", "--shader-dir", tmp_path / "shaders", folder=tmp_path)
    assert re.search(r" error +gl: shaders/lib/atmosphere.glsl:21: .*error", error), error
    assert "renderer: cannot start" in error


# --- a hang --------------------------------------------------------------------------------------------------------------------------


def test_a_device_that_hangs(start_faulty):
    """Not ready at once, what waits is refused, and the process ends with a status that has it started again."""
    daemon = start_faulty("--hang-ms", "6000")
    probe = daemon.connect()
    probe.request("GET", "/readyz")
    assert probe.getresponse().read()
    daemon.fail("hang", 3600)
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        hanging = pool.submit(daemon.render, {"clouds": {"seed": 1}, "output": SMALL})
        assert wait_for(lambda: daemon.has_failed("hang"))
        waiting = [pool.submit(daemon.render, {"clouds": {"seed": 2 + i}, "output": SMALL}) for i in range(3)]
        answers = [w.result() for w in waiting]
        assert [a.status for a in answers] == [503] * 3
        assert {a.json["type"] for a in answers} == {"urn:stratus:problem:renderer-unavailable"}
        assert daemon.process.wait(timeout=180) == 3
        with pytest.raises((ConnectionError, http.client.HTTPException)):
            hanging.result()
    assert "the renderer hangs or is gone" in daemon.text
    probe.close()


# --- growth --------------------------------------------------------------------------------------------------------------------------


def test_a_context_that_grows_is_made_anew(start_faulty):
    daemon = start_faulty("--recycle-mb", "400")
    before = daemon.metric("stratus_process_resident_memory_bytes")
    daemon.render({"output": SMALL})
    time.sleep(1.5)
    assert daemon.resets("memory") == 0
    daemon.fail("growth", 600)
    assert daemon.render({"sun": {"elevation_deg": 33}, "output": SMALL}).status == 200
    assert wait_for(lambda: daemon.resets("memory") == 1)
    assert wait_for(daemon.is_ready)
    assert daemon.metric("stratus_process_resident_memory_bytes") < before + 400e6
    assert daemon.render({"sun": {"elevation_deg": 34}, "output": SMALL}).status == 200
    time.sleep(1.5)
    assert daemon.resets("memory") == 1


# --- signals -------------------------------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def busy(daemon, pool, count=3):
    """So many accepted renders, the first of which stands still until this is left."""
    with daemon.holding():
        running = [pool.submit(daemon.render, {"clouds": {"seed": 20 + i}, "output": SMALL}) for i in range(count)]
        assert wait_for(lambda: daemon.is_held() and daemon.metric("stratus_requests_in_flight") == count + 1)
        yield running


def test_drain(start_faulty):
    """Readiness goes first, what was accepted is finished, and the status is 0."""
    daemon = start_faulty()
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        with busy(daemon, pool) as running:
            probe = daemon.connect()
            probe.request("GET", "/readyz")
            probe.getresponse().read()
            daemon.process.send_signal(signal.SIGTERM)
            assert wait_for(lambda: "SIGTERM: finishing accepted work" in daemon.text)
            probe.request("GET", "/readyz")
            answer = probe.getresponse()
            assert (answer.status, json.loads(answer.read())["status"]) == (503, "stopping")
            assert not any(r.done() for r in running)
        assert [r.result().status for r in running] == [200] * 3
    probe.close()
    assert daemon.process.wait(timeout=180) == 0


def test_a_second_signal_ends_at_once(start_faulty):
    """But for one within a second: a signal that comes twice is one."""

    def goes_on_after_both():
        daemon = start_faulty()
        with concurrent.futures.ThreadPoolExecutor(4) as pool:
            with busy(daemon, pool) as running:
                begin = time.monotonic()
                daemon.process.send_signal(signal.SIGTERM)
                assert wait_for(lambda: "SIGTERM: finishing accepted work" in daemon.text)
                daemon.process.send_signal(signal.SIGTERM)
                within = time.monotonic() - begin < 1
                time.sleep(1.2)
                went_on = daemon.process.poll() is None
                daemon.process.send_signal(signal.SIGTERM)
                assert daemon.process.wait(timeout=180) == 1
            for one in running:
                with pytest.raises((ConnectionError, http.client.HTTPException)):
                    one.result()
        assert "stopped at once by a second signal" in daemon.text
        return within and went_on

    assert in_some_try(goes_on_after_both)


def test_a_reset_while_draining(start_faulty):
    daemon = start_faulty()
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        with busy(daemon, pool) as running:
            daemon.fail("gl-reset", 1)
            daemon.process.send_signal(signal.SIGTERM)
            assert wait_for(lambda: "SIGTERM: finishing accepted work" in daemon.text)
        assert [r.result().status for r in running] == [200] * 3
    assert daemon.process.wait(timeout=180) == 0
    assert daemon.has_failed("gl-reset")


# --- a device that never comes back ----------------------------------------------------------------------------------------------------


def test_a_device_that_is_gone_for_good(doomed):
    """The tries are bounded; who waited is refused, and the process ends with a status that has it started again."""
    daemon, running = doomed
    answers = [r.result() for r in running]
    assert [a.status for a in answers] == [503] * 2
    assert {a.json["type"] for a in answers} == {"urn:stratus:problem:renderer-unavailable"}
    assert all(int(a.headers["Retry-After"]) >= 1 for a in answers)
    assert daemon.process.wait(timeout=180) == 3
    assert "8 of 8 tries to bring it up again failed" in daemon.text
