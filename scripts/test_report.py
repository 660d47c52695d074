"""What a run of pytest came to: test_report.py REPORT.xml AGAIN. Prints "PASSED FAILED"; of the tests that failed and may be run once more,
alone, it counts none, and writes their names into AGAIN, one a line.

Those are the ones whose own words failed, be it that a neighbour on the machine took their time. What a fixture found (a daemon that ended
badly, a sanitizer's report in its log) stays a failure, and so does whatever shows such a report.
"""
import re
import sys
import xml.etree.ElementTree as tree

MOST = 12  # more than that fail for a reason of their own
REPORT_OF_SANITIZER = re.compile("Sanitizer|runtime error:")


def name_of(case):
    return case.get("classname").replace(".", "/") + ".py::" + case.get("name")


def main(report, again):
    passed, failed, repeatable = 0, set(), set()
    for case in tree.parse(report).iter("testcase"):
        failure = case.find("failure")
        if case.find("error") is not None:
            failed.add(name_of(case))
        elif failure is not None:
            text = failure.get("message", "") + (failure.text or "")
            (failed if REPORT_OF_SANITIZER.search(text) else repeatable).add(name_of(case))
        else:
            passed += case.find("skipped") is None
    repeatable -= failed
    if len(repeatable) > MOST:
        failed, repeatable = failed | repeatable, set()
    with open(again, "a") as file:
        file.writelines(name + "\n" for name in sorted(repeatable))
    print(passed, len(failed))


main(*sys.argv[1:])
