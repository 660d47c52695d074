"""What the load generator costs itself: stratus bench beside wrk and hey, on pages that the daemon has ready (a daemon at STRATUS_SERVER).

    agreement.py BUILD_DIR [ROUNDS [SECONDS [CONNECTIONS [PID]]]]

All ask by as many connections from one thread (hey has as many as it likes), one after the other in every round, in an order that turns, so that what
else the machine does falls on all alike. Told is the median over the rounds of the ratio of rates within a round, and its interval of 95 % by resampling;
and what a request cost each of them of a processor. With the daemon's process number, it is held to one processor and who asks to another, so that none
of them is measured by how the kernel happens to place the two.
"""
import json
import os
import random
import re
import resource
import statistics
import subprocess
import sys

URL = os.environ.get("STRATUS_SERVER", "http://127.0.0.1:8080")
PAGES = ("/healthz", "/openapi.yaml")


def output(*command):
    """Of a command; keeps the processor time that it took."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        return run(*command)
    finally:
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def run(*command):
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, check=True, preexec_fn=hold).stdout


def hold():
    """Keeps who asks off the daemon's processor."""
    if pid:
        os.sched_setaffinity(0, {1})


def by_stratus(page):
    return json.loads(output(f"{build}/stratus", "bench", "--server", URL, "--get", page, "--connections", connections, "--duration", seconds, "--warm-up", 0.2, "-q", "--json", "-"))["good_per_s"]


def by_wrk(page):
    return float(re.search(r"Requests/sec:\s*([\d.]+)", output("wrk", "-t1", f"-c{connections}", f"-d{seconds}s", URL + page))[1])


def by_hey(page):
    return float(re.search(r"Requests/sec:\s*([\d.]+)", output("hey", "-c", connections, "-z", f"{seconds}s", "-disable-compression", URL + page))[1])


build, rounds, seconds, connections, pid = (sys.argv[1:] + [None] * 5)[:5]
rounds, seconds, connections = int(rounds or 12), int(seconds or 2), int(connections or 4)
spent = []  # s of a processor, by commands
TOOLS = {"stratus bench": by_stratus, "wrk": by_wrk, "hey": by_hey}


def interval(values):
    draws = random.Random(1)
    medians = sorted(statistics.median(draws.choices(values, k=len(values))) for _ in range(4000))
    return medians[100], medians[3900]


def main():
    if pid:
        for thread in os.listdir(f"/proc/{pid}/task"):
            os.sched_setaffinity(int(thread), {0})
    for page in PAGES:
        rates, costs = {name: [] for name in TOOLS}, {name: [] for name in TOOLS}
        for number in range(rounds):
            names = list(TOOLS)
            for name in names[number % 3 :] + names[: number % 3]:
                rates[name].append(TOOLS[name](page))
                costs[name].append(1e6 * spent[-1] / (rates[name][-1] * seconds))
        print(f"{page}, {rounds} rounds of {seconds} s, {connections} connections" + (", a processor each" if pid else ""))
        for name in TOOLS:
            ratios = [ours / theirs for ours, theirs in zip(rates["stratus bench"], rates[name])]
            low, high = interval(ratios)
            print(f"  {name:14} {statistics.median(rates[name]):7.0f}/s   stratus bench over it {statistics.median(ratios):.3f} ({low:.3f} .. {high:.3f})   {statistics.median(costs[name]):5.1f} us of a processor a request", flush=True)


if __name__ == "__main__":
    main()
