"""The dashboard and the alert rules in ops/ ask for what the daemon exports, and for nothing else.

Names of series, labels and their values are compared with a scrape after a render; whether the expressions are PromQL, and whether the alerts
fire when they should, is asked of Prometheus's promtool.
"""
import json
import re
import subprocess

import pytest
import yaml
from prometheus_client.openmetrics.parser import text_string_to_metric_families

from conftest import ROOT, measures

pytestmark = measures
OPS = ROOT / "ops"
SMALL = {"output": {"width": 32, "height": 24}}
# What a scraper adds of its own.
SCRAPER_LABELS = {"instance", "job"}
SCRAPER_SERIES = {"up": {}}


@pytest.fixture(scope="module")
def exported(daemon):
    """{sample: {label: values seen}} after a render and a few errors."""
    daemon.render(SMALL)
    daemon.render("{")
    daemon.get("/nowhere")
    daemon.get("/v1/optics")
    series = {name: {label: set(values) for label, values in labels.items()} for name, labels in SCRAPER_SERIES.items()}
    for family in text_string_to_metric_families(daemon.get("/metrics").body.decode()):
        for sample in family.samples:
            labels = series.setdefault(sample.name, {})
            for label, value in sample.labels.items():
                labels.setdefault(label, set()).add(value)
    return series


@pytest.fixture(scope="module")
def statuses():
    """Of the contract, and the one of clients that left."""
    contract = yaml.safe_load((ROOT / "openapi.yaml").read_text())
    calls = [call for path in contract["paths"].values() for call in path.values() if "responses" in call]
    return {str(status) for call in calls for status in call["responses"]} | {"499"}


def alerts():
    rules = yaml.safe_load((OPS / "prometheus-alerts.yml").read_text())
    return [rule for group in rules["groups"] for rule in group["rules"]]


def dashboard():
    return json.loads((OPS / "grafana-dashboard.json").read_text())


def panels():
    return [panel for panel in dashboard()["panels"] if panel["type"] != "row"]


EXPRESSIONS = [(rule["alert"], rule["expr"], "") for rule in alerts()] + [
    (panel["title"], target["expr"], target["legendFormat"]) for panel in panels() for target in panel["targets"]
]


def selectors(expression):
    """(series, [(label, operator, value)]) of each selector."""
    for name, matchers in re.findall(r"\b(stratus_\w+|up)\b(?:\{([^}]*)\})?", expression):
        parts = re.findall(r'(\w+)\s*(=~|!~|!=|=)\s*"([^"]*)"', matchers)
        assert re.sub(r'(\w+)\s*(=~|!~|!=|=)\s*"([^"]*)"|[\s,]', "", matchers) == "", matchers
        yield name, parts


def words_of(pattern):
    """The alternatives of a pattern such as /v1/(a|b) or a|b."""
    match = re.fullmatch(r"(.*)\(([^()]*)\)", pattern)
    prefix, inner = match.groups() if match else ("", pattern)
    return [prefix + word for word in inner.split("|")]


@pytest.mark.parametrize("title, expression, legend", EXPRESSIONS, ids=[f"{i}-{e[0]}" for i, e in enumerate(EXPRESSIONS)])
def test_asks_for_what_is_exported(exported, statuses, title, expression, legend):
    found = list(selectors(expression))
    assert found
    known = set(SCRAPER_LABELS)
    for name, matchers in found:
        assert name in exported, f"{title}: no such series: {name}"
        known |= set(exported[name])
        for label, operator, value in matchers:
            if label in SCRAPER_LABELS:
                continue
            assert label in exported[name], f"{title}: {name} has no label {label}"
            values = statuses if label == "status" else {"0", "1"} if label == "software" else exported[name][label]
            for word in words_of(value) if "~" in operator else [value]:
                if label == "route" and word.startswith("/"):
                    continue  # below: those that were not asked for have no series yet
                assert word in values, f'{title}: {name} never has {label}="{word}"'
    grouped = {label.strip() for labels in re.findall(r"\bby\s*\(([^)]*)\)", expression) for label in labels.split(",")}
    assert grouped <= known, f"{title}: groups by {grouped - known}"
    # After an aggregation nothing but what it groups by is left for the legend.
    shown = set(re.findall(r"\{\{\s*(\w+)\s*\}\}", legend))
    assert shown <= (grouped if grouped else known), f"{title}: the legend shows {shown}"


def test_routes_exist(exported):
    routes = exported["stratus_response_bytes_total"]["route"]
    for title, expression, _ in EXPRESSIONS:
        for _, matchers in selectors(expression):
            for label, operator, value in matchers:
                if label == "route":
                    assert set(words_of(value)) <= routes, title


def test_annotations_show_labels_that_alerts_have(exported):
    for rule in alerts():
        assert set(rule) <= {"alert", "expr", "for", "labels", "annotations"}
        assert rule["labels"]["severity"] in ("page", "ticket")
        assert rule["annotations"].keys() == {"summary", "description"}
        labels = set(SCRAPER_LABELS)
        for name, _ in selectors(rule["expr"]):
            labels |= set(exported[name])
        grouped = re.findall(r"\bby\s*\(([^)]*)\)", rule["expr"])
        if grouped:
            labels = {label.strip() for label in ",".join(grouped).split(",")} - {"le"}
        for text in rule["annotations"].values():
            assert set(re.findall(r"\$labels\.(\w+)", text)) <= labels, rule["alert"]


def test_dashboard_is_laid_out():
    board = dashboard()
    cells, seen = set(), set()
    for panel in board["panels"]:
        assert panel["id"] not in seen and not seen.add(panel["id"])
        grid = panel["gridPos"]
        assert grid["x"] + grid["w"] <= 24
        covered = {(x, y) for x in range(grid["x"], grid["x"] + grid["w"]) for y in range(grid["y"], grid["y"] + grid["h"])}
        assert not covered & cells, panel["title"]
        cells |= covered
    variables = {variable["name"] for variable in board["templating"]["list"]}
    used = set(re.findall(r"\$\{?(\w+)", json.dumps(board["panels"]))) - {"__rate_interval"}
    assert used == variables


def test_every_family_is_watched(exported):
    """A metric that nobody looks at is missing from the dashboard, or need not be there."""
    watched = {name for _, expression, _ in EXPRESSIONS for name, _ in selectors(expression)}
    families = {re.sub(r"_(bucket|count|sum)$", "", name) for name in watched}
    unseen = {re.sub(r"_(bucket|count|sum)$", "", name) for name in exported} - families
    assert unseen <= {"stratus_assets", "stratus_tracings_limit"}


# --- by Prometheus's own tool ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def promtool():
    tool = subprocess.run([ROOT / "scripts" / "promtool.sh", ROOT / "build" / "tools"], capture_output=True, text=True)
    if tool.returncode:
        pytest.skip("promtool is not here and could not be fetched: " + tool.stderr[-300:])
    return tool.stdout.strip()


def run(*command):
    result = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def test_alert_rules_are_rules(promtool):
    assert f"SUCCESS: {len(alerts())} rules found" in run(promtool, "check", "rules", OPS / "prometheus-alerts.yml")


def test_alerts_fire(promtool):
    run(promtool, "test", "rules", OPS / "prometheus-alerts.test.yml")
    cases = yaml.safe_load((OPS / "prometheus-alerts.test.yml").read_text())["tests"]
    fired = {case["alertname"] for test in cases for case in test["alert_rule_test"] if case["exp_alerts"]}
    assert fired == {rule["alert"] for rule in alerts()}


def test_expressions_of_the_dashboard(promtool, tmp_path):
    """As recording rules, which must be PromQL."""
    expressions = [target["expr"] for panel in panels() for target in panel["targets"]]
    rules = [
        {"record": f"panel:{i}", "expr": e.replace("[$__rate_interval]", "[5m]").replace("$instance", ".*")}
        for i, e in enumerate(expressions)
    ]
    path = tmp_path / "dashboard.yml"
    path.write_text(yaml.safe_dump({"groups": [{"name": "dashboard", "rules": rules}]}))
    assert f"SUCCESS: {len(expressions)} rules found" in run(promtool, "check", "rules", path)


def test_scrape_configuration(promtool, tmp_path):
    """The scrape configuration of the documentation is one."""
    text = (ROOT / "docs" / "operations.md").read_text()
    (example,) = re.findall(r"```yaml\n(scrape_configs:.*?)```", text, re.S)
    path = tmp_path / "prometheus.yml"
    path.write_text(example.replace("/etc/prometheus/rules", str(OPS)))
    assert "SUCCESS" in run(promtool, "check", "config", path)
    assert "prometheus-alerts.yml" in example


def test_documentation_names_what_is_exported(exported):
    """The page on operation has every family, every alert, and nothing else."""
    page = (ROOT / "docs" / "operations.md").read_text()
    table = re.search(r"\| series .*?\n\n", page, re.S)[0]
    named = {}
    for name, labels in re.findall(r"`([a-z_]+)(?:\{([a-z,]+)\})?`", "".join(row.split("|")[1] for row in table.strip().splitlines()[2:])):
        named["stratus_" + name] = set(labels.split(",")) if labels else set()
    families = {}
    for name, labels in exported.items():
        if name.startswith("stratus_"):
            families.setdefault(re.sub(r"_(bucket|count|sum)$", "", name), set()).update(set(labels) - {"le"})
    assert named == families
    rows = re.search(r"\| alert .*?\n\n", page, re.S)[0]
    assert set(re.findall(r"\bStratus[A-Z]\w+", rows)) == {rule["alert"] for rule in alerts()}
