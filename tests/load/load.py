"""How the daemon at STRATUS_SERVER bears more than it can do: load.py BUILD_DIR QUEUE_LENGTH. scripts/load.sh starts the daemon.

What it can do is measured by a closed load; then an open load offers 0.5, 1, 2 and 4 times that. Whatever is offered, those who are taken must be
answered within the time that a full queue takes, the rest must be told so at once, and the work that gets done must stay the same.

A machine that does other things as well, or gets warm, is faster at one time than at another. So all loads are offered in turn, ROUNDS times, each round
goes by a capacity of its own, and what a picture takes under an overload is measured in that overload: the renderer is never idle then, so it is the time
over the pictures that were made in it. That such a time is no longer than without overload is the last check. What is judged is the median of the
rounds. LOAD_SECONDS (20) is how long each load is measured in all rounds together. Fails when a bound is broken.
"""
import json
import os
import pathlib
import shutil
import statistics
import subprocess
import sys

ROUNDS = 3
SECONDS = float(os.environ.get("LOAD_SECONDS", "20")) / ROUNDS
WARM_UP = 3
MIX = pathlib.Path(__file__).parent / "mix.jsonl"
KEPT = pathlib.Path("out/load")
OFFERED = (0.5, 1, 2, 4)
CLIENTS = 8
# A refusal is one HTTP answer; on two processors that render it may wait for some turns of the scheduler.
AT_ONCE_S = 0.25
GOODPUT_LOSS = 0.10
# Random arrivals are not as many as planned; so few would be no such load.
OFFERED_LEAST = 0.8


def bench(build, name, *options):
    kept = KEPT / f"{name}.json"
    command = [build + "/stratus", "bench", "--mix", MIX, "--duration", f"{SECONDS:.3f}", "--warm-up", str(WARM_UP), "--json", kept, "-q", *options]
    command += ["--seed", str(len(list(KEPT.glob("*.json"))) + 1)]  # no scene twice: what is kept would be found
    subprocess.run(command, check=False)  # at an overload no good answer at all is a result, too
    return json.loads(kept.read_text())


def row(name, found):
    good, refused = found["good"], found["refused"]
    ms = lambda latency, share: f"{1000 * latency[share]:.0f}" if latency["count"] else ""
    print(
        f"{name:>8} {found['asked_per_s']:9.1f} {found['good_per_s']:9.1f} {ms(good, 'p50_s'):>8} {ms(good, 'p99_s'):>8} {refused['count']:9d}"
        f" {ms(refused, 'p50_s'):>8} {ms(refused, 'p99_s'):>8} {found['errors'] + found['other']['count']:7d}",
        flush=True,
    )


def measure(build, number):
    """A round: {0: closed load, 0.5: open load, ...}."""
    found = {0: bench(build, f"{number}-closed", "--connections", str(CLIENTS))}
    row("closed", found[0])
    capacity = found[0]["good_per_s"]
    if capacity <= 0:
        sys.exit("no picture was made")
    for offered in OFFERED:
        found[offered] = bench(build, f"{number}-open-{offered:g}", "--rate", f"{offered * capacity:.3f}", "--random")
        row(f"{offered:g} x", found[offered])
    return found


def service_s(found, offered):
    """What a picture takes: in the load itself where the renderer is never idle, else as the closed load says."""
    return 1 / max(found[offered if offered > 1 else 0]["good_per_s"], 1e-3)


def judge(rounds, queue):
    """[(whether it holds, text)], of all bounds."""
    checks = []
    middle = lambda figure: statistics.median(figure(found) for found in rounds)
    for offered in OFFERED:
        asked = middle(lambda found: found[offered]["asked_per_s"] / found[0]["good_per_s"])
        checks.append((asked >= OFFERED_LEAST * offered, f"{offered:g} x: {asked:.2f} x was offered"))
        p99, limit = middle(lambda found: found[offered]["good"].get("p99_s", float("inf"))), queue * middle(lambda found: service_s(found, offered))
        share = middle(lambda found: found[offered]["good"].get("p99_s", float("inf")) / (queue * service_s(found, offered)))
        checks.append((share <= 1, f"{offered:g} x: p99 of those taken is {share:.2f} of the queue's time, {p99:.2f} s of {limit:.2f} s"))
        refused = [found[offered]["refused"] for found in rounds]
        if all(latency["count"] for latency in refused):
            p50, p99 = (statistics.median(latency[name] for latency in refused) for name in ("p50_s", "p99_s"))
            checks.append((p99 <= AT_ONCE_S, f"{offered:g} x: refusals take {1000 * p50:.1f} ms, p99 {1000 * p99:.0f} ms <= {1000 * AT_ONCE_S:.0f} ms"))
        others = sum(found[offered]["errors"] + found[offered]["other"]["count"] for found in rounds)
        checks.append((others == 0, f"{offered:g} x: {others} answers that are neither a picture nor a refusal"))
    ratio = middle(lambda found: found[4]["good_per_s"] / found[1]["good_per_s"])
    checks.append((ratio >= 1 - GOODPUT_LOSS, f"goodput at 4 x is {ratio:.3f} of that at 1 x, at least {1 - GOODPUT_LOSS:.1f}"))
    return checks


def main():
    build, queue = sys.argv[1], int(sys.argv[2])
    shutil.rmtree(KEPT, ignore_errors=True)
    KEPT.mkdir(parents=True)
    print(f"{'offered':>8} {'asked/s':>9} {'good/s':>9} {'p50 ms':>8} {'p99 ms':>8} {'refused':>9} {'p50 ms':>8} {'p99 ms':>8} {'errors':>7}")
    rounds = [measure(build, number) for number in range(ROUNDS)]
    capacities = [found[0]["good_per_s"] for found in rounds]
    print(f"\na queue of {queue}; capacity {', '.join(f'{capacity:.1f}' for capacity in capacities)} pictures/s in the {ROUNDS} rounds")
    checks = judge(rounds, queue)
    for holds, text in checks:
        print(("  holds   " if holds else "  BROKEN  ") + text)
    return 0 if all(holds for holds, _ in checks) else 1


if __name__ == "__main__":
    sys.exit(main())
