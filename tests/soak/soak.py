"""Twenty minutes of everything at once, with faults: soak.py BUILD_DIR. SOAK_MINUTES=N for another time.

A mixed open load (mix.jsonl), less of it where the machine is slow, clients that leave while they are worked for, uploads and deletions, comparisons; every ten seconds a fault of the
GPU or the memory. Afterwards the daemon's log must hold no answer of status 500 and above that no fault explains, memory must be flat (the last third
within 5 % of the middle third) and file descriptors too, and the daemon must end with status 0. Fails otherwise.

When a fault strikes is seen to a twentieth of a second. A picture that is given up is explained by a fault of its kind alone that struck while it was
asked for, and one fault gives up one picture. To be refused, or late, is what may happen for a while after any fault.
"""
import collections
import concurrent.futures
import dataclasses
import datetime
import http.client
import itertools
import json
import os
import pathlib
import random
import signal
import statistics
import subprocess
import sys
import tempfile
import time

BUILD = pathlib.Path(sys.argv[1])
SECONDS = 60 * float(os.environ.get("SOAK_MINUTES", "20"))
# Requests a second, and the share of what the machine can do that this is at most: it has renderers to make anew, too.
RATE, SHARE = float(os.environ.get("SOAK_RATE", "4")), 0.3
FAULT_EVERY_S = 10
# A renderer that is made anew takes seconds on processors, and works off meanwhile what has come.
EXPLAINED_S = 30
# How often is looked whether a fault has struck, and what times of lines and of that may differ by.
LOOK_S = 0.05
SLACK_S = 0.1
# What faults of a kind may do to the one picture that they strike.
GIVEN_UP = {"render-failed": {"gl-error"}, "no-memory": {"gl-memory", "host-memory"}}
# What any fault may do to those that come during and after it.
DELAYED = {"queue-full", "predicted-late", "memory-limit", "deadline-passed"}
HERE = pathlib.Path(__file__).parent
KEPT = pathlib.Path("out/soak")
# Faults of the program for tests (tests/faults/faults.c): name, number, seconds until it is taken back (None: it happens once).
FAULTS = [("gl-reset", 0, None), ("host-memory", 100000, None), ("gl-memory", 1, None), ("black", 1, 3), ("gl-reset", 40, None), ("gl-error", 1, None),
          ("gone", 1, 2), ("growth", 700, None)]


@dataclasses.dataclass
class Fault:
    name: str
    happened: tuple | None = None  # (after this time, before that); None: not yet
    scene: str | None = None  # of the picture that was given up for it


class Daemon:
    def __init__(self, folder):
        self.faults = folder / "faults"
        self.faults.mkdir()
        self.log = folder / "log"
        command = [BUILD / "stratusd-faulty", "--faults", self.faults, "--listen", "127.0.0.1:0", "--state-dir", folder / "state", "--kernel", "build/mie.kernel",
                   "--log-format", "json", "--golden-s", "5", "--recycle-mb", "500",
                   # Small, so that they are full before memory is looked at.
                   "--images-mb", "8", "--droplets-mb", "48", "--cache-mb", "64"]
        self.process = subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, stderr=self.log.open("w"), text=True)
        line = self.process.stdout.readline()
        assert line.startswith("stratusd listening on "), self.log.read_text()
        self.port = int(line.rsplit(":", 1)[1])

    def ask(self, method, path, body=None, headers=None, wait=True):
        """Leaves after a moment unless it is to wait. The status, or None."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=90)
        try:
            connection.request(method, path, body, headers or {})
            if not wait:
                time.sleep(random.uniform(0, 0.3))
                return None
            answer = connection.getresponse()
            answer.read()
            return answer.status
        except (OSError, http.client.HTTPException):
            return None
        finally:
            connection.close()

    def resident(self):
        """Bytes, and descriptors."""
        status = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        kilobytes = int(status.split("VmRSS:")[1].split()[0])
        return kilobytes * 1024, len(os.listdir(f"/proc/{self.process.pid}/fd"))


def bench(daemon, kept, seconds, *options):
    server = f"http://127.0.0.1:{daemon.port}"
    return [BUILD / "stratus", "bench", "--server", server, "--mix", HERE / "mix.jsonl", "--duration", str(seconds), "--json", kept, "-q", *options]


def capacity(daemon):
    """Requests a second that the machine can do."""
    kept = KEPT / "capacity.json"
    subprocess.run(bench(daemon, kept, 10, "--connections", "4", "--seed", "2"), check=True)
    return json.loads(kept.read_text())["good_per_s"]


def until(end, *actions):
    for action in itertools.cycle(actions):
        if time.monotonic() >= end:
            return
        action()


def visitors(daemon, end):
    """What a load of whole answers does not do."""
    json_type = {"Content-Type": "application/json"}
    scene = lambda: json.dumps({"clouds": {"seed": random.randrange(10**6)}, "output": {"width": 800, "height": 600}})
    png = (HERE.parent / "fuzz/seeds/picture/grey-8.png").read_bytes()
    compare = json.dumps({"scene": {"output": {"width": 64, "height": 48}}, "variants": [{}, {"model": {"shading": "paper"}}]})
    until(
        end,
        lambda: [daemon.ask("POST", "/v1/render", scene(), json_type, wait=False) for _ in range(5)],
        lambda: daemon.ask("PUT", "/v1/assets/soak.png", png, {"Content-Type": "image/png"}),
        lambda: daemon.ask("GET", "/v1/render?clouds.map=soak.png&output.width=64&output.height=48"),
        lambda: daemon.ask("DELETE", "/v1/assets/soak.png"),
        lambda: daemon.ask("POST", "/v1/compare", compare, json_type),
        lambda: daemon.ask("POST", "/v1/render", "{" * 1000, json_type),
        lambda: time.sleep(2),
    )


def await_fault(link, fault, until):
    """Until it has struck, or it is time for the next."""
    seen = time.time()
    while time.monotonic() < until:
        time.sleep(LOOK_S)
        now = time.time()
        if not fault.happened and not os.path.lexists(link):
            fault.happened = (seen, now)
        seen = now


def inject(daemon, end, faults):
    waiting = {}
    for name, number, seconds in itertools.cycle(FAULTS):
        began = time.monotonic()
        if began >= end - EXPLAINED_S:
            return
        link = daemon.faults / name
        if not os.path.lexists(link):
            waiting[name] = Fault(name)
            faults.append(waiting[name])
            os.symlink(str(number), link)
        if seconds:
            since = time.time()
            time.sleep(seconds)
            link.unlink()
            waiting[name].happened = (since, time.time())
        await_fault(link, waiting[name], began + FAULT_EVERY_S)


def watch(daemon, end):
    samples = []
    while time.monotonic() < end and daemon.process.poll() is None:
        samples.append(daemon.resident())
        time.sleep(1)
    return samples


def is_given_up_for(fault, began, ended, scene):
    """One fault strikes one picture, which several may have waited for."""
    if not fault.happened or not (began - SLACK_S <= fault.happened[1] and fault.happened[0] <= ended + SLACK_S):
        return False
    if fault.scene is not None and fault.scene != scene:
        return False
    fault.scene = scene
    return True


def is_explained(entry, faults):
    ended = datetime.datetime.fromisoformat(entry["time"].replace("Z", "+00:00")).timestamp()
    began = ended - float(entry["duration_ms"]) / 1000
    problem = entry.get("problem")
    if problem in GIVEN_UP:
        scene = entry.get("scene", entry["id"])
        return any(fault.name in GIVEN_UP[problem] and is_given_up_for(fault, began, ended, scene) for fault in faults)
    return problem in DELAYED and any(fault.happened and began - EXPLAINED_S <= fault.happened[1] and fault.happened[0] <= ended for fault in faults)


def unexplained(lines, faults):
    """Lines that tell of a failure that no fault explains, or that are none of the daemon's; and all failures by kind."""
    found, failures = [], collections.Counter()
    for line in lines:
        try:
            entry = json.loads(line)
        except ValueError:
            found.append(line)
            continue
        if int(entry.get("status", 0)) < 500:
            continue
        failures[entry.get("problem", entry["status"])] += 1
        if not is_explained(entry, faults):
            found.append(line)
    return found, failures


def thirds(values, figure=statistics.median):
    third = len(values) // 3
    return figure(values[third : 2 * third]), figure(values[2 * third :])


def check(broken, holds, text):
    print(("  holds   " if holds else "  BROKEN  ") + text, flush=True)
    if not holds:
        broken.append(text)


def main():
    KEPT.mkdir(parents=True, exist_ok=True)
    broken, faults = [], []
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(2) as pool:
        daemon = Daemon(pathlib.Path(folder))
        rate = min(RATE, SHARE * capacity(daemon))
        end = time.monotonic() + SECONDS
        load = subprocess.Popen(bench(daemon, KEPT / "load.json", SECONDS, "--warm-up", "0", "--rate", f"{max(rate, 0.1):.3f}", "--random"))
        others = [pool.submit(visitors, daemon, end), pool.submit(inject, daemon, end, faults)]
        samples = watch(daemon, end)
        for other in others:
            other.result()
        load.wait()
        daemon.process.send_signal(signal.SIGTERM)
        status = daemon.process.wait(timeout=120)
        log = daemon.log.read_text()
        (KEPT / "log").write_text(log)
    found, failures = unexplained(log.splitlines(), faults)
    report = json.loads((KEPT / "load.json").read_text())
    memory, descriptors = zip(*samples)
    before, after = thirds(memory)
    happened = collections.Counter(fault.name for fault in faults if fault.happened)
    print(f"{report['asked']} requests of the load, {rate:.1f}/s: {report['status']}, errors {report['error']}")
    print(f"faults that struck: {dict(happened)}; answers of 500 and above: {dict(failures)}")
    check(broken, status == 0, f"the daemon ended with status {status}")
    check(broken, len(samples) > 0.9 * SECONDS, "it lived to the end")
    # One that waits for a large allocation may wait for long.
    check(broken, sum(happened.values()) >= 0.8 * len(faults), f"{sum(happened.values())} of {len(faults)} faults struck")
    check(broken, not found, f"{len(found)} failures that no fault explains" + "".join("\n            " + line for line in found[:5]))
    check(broken, report["errors"] == 0, f"{report['errors']} requests without any answer")
    check(broken, abs(after / before - 1) <= 0.05, f"resident memory {before / 2**20:.0f} MiB in the middle third, {after / 2**20:.0f} MiB in the last")
    before, after = thirds(descriptors, min)  # connections come and go, and what leaks stays
    check(broken, abs(after - before) <= 3, f"{before} descriptors and more in the middle third, {after} in the last")
    check(broken, report["kind"]["hot"]["count"] > 0 and report["good"]["count"] > 0.8 * report["asked"] * 24 / 26, f"{report['good']['count']} good answers")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
