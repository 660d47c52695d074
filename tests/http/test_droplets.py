"""Droplets that are new: prepared beside the renderer, computed once, kept on disk."""
import concurrent.futures
import itertools
import signal
import statistics
import threading
import time

import pytest

from conftest import in_some_try, send, wait_for

SMALL = {"width": 16, "height": 16}


def scene(gamma, **sections):
    """Small, with a coarse field, so that most of its work is the droplets'."""
    return {"dsd": {"gamma": gamma}, "clouds": {"resolution": 64}, "output": SMALL, **sections}


def computed(daemon):
    return daemon.metric('stratus_droplet_tables_total{source="computed"}')


def from_disk(daemon):
    return daemon.metric('stratus_droplet_tables_total{source="disk"}')


def warnings(daemon):
    return [line for line in daemon.log.read_text().splitlines() if " warning " in line and " droplets: " in line]


def together(daemon, scenes, **headers):
    with concurrent.futures.ThreadPoolExecutor(len(scenes)) as pool:
        return list(pool.map(lambda s: daemon.render(s, **headers), scenes))


@pytest.fixture
def restart(start_daemon, tmp_path):
    """Daemons one after the other with the same state directory."""
    running = []

    def start(*flags):
        if running:
            assert running.pop().stop() == 0
        running.append(start_daemon("--state-dir", str(tmp_path / "state"), *flags))
        return running[-1]

    start.folder = tmp_path / "state" / "droplets"
    return start


def test_computed_once(daemon):
    before = computed(daemon)
    assert daemon.render(scene(3.1)).status == 200
    one = computed(daemon) - before
    assert one >= 1
    answers = together(daemon, [scene(3.2)] * 6, Cache_Control="no-cache")
    assert {a.status for a in answers} == {200}
    assert len({a.body for a in answers}) == 1
    assert computed(daemon) - before == 2 * one
    assert daemon.metric("stratus_droplet_tables_bytes") > 2 * 15e6


def test_clear_sky_needs_none(daemon):
    before = computed(daemon)
    assert daemon.render(scene(3.25, clouds={"type": "none"})).status == 200
    assert daemon.render(scene(3.26, clouds={"thickness_m": 0})).status == 200
    assert computed(daemon) == before


@pytest.mark.parametrize("path", ["/v1/slab?optical_thickness=8&", "/v1/optics?"])
def test_calls_share_one_computation(daemon, path):
    before = computed(daemon)
    query = path + "dsd.gamma=3.27" + ("1" if "slab" in path else "2")
    with concurrent.futures.ThreadPoolExecutor(16) as pool:
        answers = list(pool.map(lambda _: daemon.get(query), range(16)))
    assert {a.status for a in answers} == {200}
    assert len({a.body for a in answers}) == 1
    assert computed(daemon) - before == (1 if "slab" in path else 2)  # tables, and the paper's fit


def test_pictures_go_on_beside_calls(daemon):
    """Encoding has threads of its own: calls that compute droplets do not keep pictures waiting."""
    stop, calls = threading.Event(), []

    def ask(k):
        for i in range(1000):
            if stop.is_set():
                return
            begin = time.monotonic()
            assert daemon.get(f"/v1/slab?optical_thickness=8&dsd.gamma={4 + k + i / 1000}").status == 200
            calls.append(time.monotonic() - begin)

    daemon.render(scene(3.1))
    threads = [threading.Thread(target=ask, args=(k,)) for k in range(8)]
    for thread in threads:
        thread.start()
    try:
        assert wait_for(lambda: len(calls) >= 8)  # now eight of them are under way all the time
        took = []
        for i in range(12):
            begin = time.monotonic()
            assert daemon.render(scene(3.1, camera={"azimuth_deg": 1 + i})).status == 200
            took.append(time.monotonic() - begin)
    finally:
        stop.set()
        for thread in threads:
            thread.join()
    # In one line with eight computations each would take as long as these do.
    assert statistics.median(took) < 0.6 * statistics.median(calls), (took, calls)


def test_optics_nobody_waits_for(daemon):
    before = computed(daemon)
    assert daemon.get("/v1/optics?dsd.gamma=3.29", **{"X-Timeout-Ms": "1"}).status == 504
    assert computed(daemon) - before <= 1  # and no fit after the tables


def test_timing_says_where_they_came_from(daemon):
    first, *others = [daemon.render(scene(3.3), Cache_Control="no-cache") for _ in range(4)]
    assert "desc" not in first.timing["optics"]
    assert float(first.timing["optics"]["dur"]) > 5
    assert all(other.timing["optics"]["desc"] == '"reused"' for other in others)
    assert min(float(other.timing["optics"]["dur"]) for other in others) < float(first.timing["optics"]["dur"]) / 2
    assert float(first.timing["total"]["dur"]) >= float(first.timing["optics"]["dur"])


def test_other_skies_go_on(daemon):
    """Pictures of known droplets keep coming while new ones are computed."""
    known, numbers = scene(3.4), itertools.count()
    assert daemon.render(known).status == 200

    def they_go_on():
        done, taken = threading.Event(), []

        def ask_on():
            while not done.is_set():
                begin = time.monotonic()
                assert daemon.render(known, Cache_Control="no-cache").status == 200
                taken.append(time.monotonic() - begin)

        with concurrent.futures.ThreadPoolExecutor(1) as pool:
            asking = pool.submit(ask_on)
            answers = [daemon.render(scene(4 + next(numbers) / 16)) for _ in range(8)]
            done.set()
            asking.result()
        assert {a.status for a in answers} == {200}
        computing = [float(a.timing["optics"]["dur"]) / 1000 for a in answers]
        print(f"{len(taken)} pictures of known droplets, median {statistics.median(taken):.3f} s, beside 8 computations of"
              f" {statistics.median(computing):.3f} s")
        return len(taken) > 3 * len(answers) and statistics.median(taken) < statistics.median(computing) / 2

    assert in_some_try(they_go_on)


def test_kept_on_disk(restart):
    daemon = restart()
    assert daemon.render(scene(2.5)).status == 200
    picture = daemon.render(scene(6.0)).body
    daemon = restart()
    again = daemon.render(scene(6.0))
    assert again.body == picture
    assert from_disk(daemon) >= 1
    assert computed(daemon) == 0
    assert "desc" not in again.timing["optics"]
    assert daemon.metric("stratus_droplet_files_damaged_total") == 0


def test_damaged_files_are_reported_and_replaced(restart):
    daemon = restart()
    picture = daemon.render(scene(6.5)).body
    restart.folder.joinpath("mine.txt").write_text("kept")
    daemon.stop()
    files = sorted(restart.folder.glob("*-*"))
    assert files
    for i, path in enumerate(files):
        data = bytearray(path.read_bytes())
        if i % 2:
            del data[-100:]
        else:
            data[len(data) // 2] ^= 4
        path.write_bytes(data)
    daemon = restart()
    assert daemon.render(scene(6.5)).body == picture
    bad = daemon.metric("stratus_droplet_files_damaged_total")
    assert bad >= 1
    assert len(warnings(daemon)) == bad
    assert all(str(restart.folder) in line for line in warnings(daemon))
    daemon = restart()
    assert daemon.render(scene(6.5)).body == picture
    assert computed(daemon) == 0 and from_disk(daemon) >= 1
    assert daemon.metric("stratus_droplet_files_damaged_total") == 0
    assert restart.folder.joinpath("mine.txt").read_text() == "kept"


def test_killed_at_any_moment(restart, start_daemon):
    """What is on disk afterwards is whole, and nothing else stays."""
    for i in range(3):
        daemon = start_daemon("--state-dir", str(restart.folder.parent))
        together(daemon, [scene(7 + i + k / 8) for k in range(3)])
        daemon.process.send_signal(signal.SIGKILL)
        assert daemon.process.wait(timeout=180) == -signal.SIGKILL
    daemon = restart()
    assert wait_for(lambda: not list(restart.folder.glob("*.*")))
    assert daemon.render(scene(7)).status == 200
    assert daemon.metric("stratus_droplet_files_damaged_total") == 0


def test_no_disk_is_a_warning(restart):
    restart.folder.parent.mkdir()
    restart.folder.write_text("a file")
    daemon = restart()
    assert {daemon.render(scene(8 + i)).status for i in range(3)} == {200}
    daemon.stop()
    assert len(warnings(daemon)) == 1
    assert str(restart.folder) in warnings(daemon)[0]


def test_disk_can_be_left_out(restart):
    daemon = restart("--droplets-disk-mb", "0")
    assert daemon.render(scene(9)).status == 200
    daemon.stop()
    assert not restart.folder.exists()


def test_bounds_of_memory_and_disk(restart):
    """Room for one distribution in memory, for two on disk; still all that are asked for at once come."""
    daemon = restart("--droplets-mb", "16", "--droplets-disk-mb", "32")
    answers = together(daemon, [scene(10 + i / 8) for i in range(8)])
    assert {a.status for a in answers} == {200}
    assert wait_for(lambda: daemon.metric("stratus_droplet_tables_bytes") <= 16 << 20)
    daemon.stop()
    files = list(restart.folder.iterdir())
    assert 1 <= len([f for f in files if f.stat().st_size > 1 << 20]) <= 2
    assert sum(f.stat().st_blocks * 512 for f in files) <= 32 << 20


def test_full_line(start_faulty):
    daemon = start_faulty("--queue-length", "2")  # one that is rendered has a place as well
    with concurrent.futures.ThreadPoolExecutor(12) as pool:
        with daemon.busy():
            running = [pool.submit(daemon.render, scene(11 + i / 16)) for i in range(12)]
            assert wait_for(lambda: daemon.metric('stratus_queue_rejected_total{reason="full"}') >= 1)
        answers = [r.result() for r in running]
    assert {a.status for a in answers} == {200, 503}
    refused = [a for a in answers if a.status == 503]
    for answer in refused:
        assert answer.json["type"] == "urn:stratus:problem:queue-full"
        assert int(answer.headers["Retry-After"]) >= 1
    assert daemon.metric('stratus_queue_rejected_total{reason="full"}') == len(refused)
    assert daemon.metric("stratus_queue_depth") == 0


def test_depth_counts_those_who_wait_for_droplets(daemon):
    depths = []
    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        running = [pool.submit(daemon.render, scene(12 + i / 16)) for i in range(8)]
        while not all(r.done() for r in running):
            depths.append(daemon.metric("stratus_queue_depth"))
    assert {r.result().status for r in running} == {200}
    assert max(depths) >= 2
    assert daemon.metric("stratus_queue_depth") == 0


def test_deadline_while_preparing(daemon):
    """Seen before the next computation, not at the end of the line."""
    before = computed(daemon)
    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        running = [pool.submit(daemon.render, scene(13 + i / 16)) for i in range(6)]
        assert wait_for(lambda: daemon.metric("stratus_queue_depth") >= 3 or all(r.done() for r in running))
        late = daemon.render(scene(14), X_Timeout_Ms="1")
        # Late, or foreseen to be.
        assert (late.status, late.json["type"]) in ((504, "urn:stratus:problem:deadline-passed"), (503, "urn:stratus:problem:predicted-late"))
        assert {r.result().status for r in running} == {200}
    one = (computed(daemon) - before) / 6
    assert one == int(one)  # nothing was computed for the late one
    assert daemon.render(scene(14)).status == 200


def test_clients_that_leave_while_preparing(start_faulty):
    """With room for the droplets of one picture no more are prepared than the renderer, which stands still, can take."""
    daemon = start_faulty("--droplets-mb", "16")
    before = computed(daemon)
    with daemon.busy():
        for client in [send(daemon, scene(15 + i / 16)) for i in range(8)]:
            client.close()
        # Those in work are given up when the renderer goes on.
        assert wait_for(lambda: daemon.metric('stratus_renders_ended_total{reason="abandoned"}') >= 5)
    daemon.settle()
    assert daemon.metric('stratus_renders_ended_total{reason="abandoned"}') == 8
    assert computed(daemon) - before <= 4
    assert daemon.render(scene(2)).status == 200


def test_shutdown_finishes_what_is_prepared(start_faulty):
    daemon = start_faulty()
    scenes = [scene(16 + i / 16) for i in range(6)]
    with concurrent.futures.ThreadPoolExecutor(len(scenes)) as pool:
        with daemon.holding():
            running = [pool.submit(daemon.render, s) for s in scenes]
            assert wait_for(lambda: daemon.metric("stratus_requests_in_flight") == 7)
            daemon.process.send_signal(signal.SIGTERM)
            assert wait_for(lambda: "SIGTERM: " in daemon.text)
        assert {r.result().status for r in running} == {200}
    assert daemon.process.wait(timeout=180) == 0
