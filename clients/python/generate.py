"""Writes stratus/scene.py, the classes of a scene, from openapi.yaml: python3 generate.py [--check]. Wants python3-yaml."""
import pathlib
import sys
import textwrap

import yaml

HERE = pathlib.Path(__file__).resolve().parent
SCHEMA = HERE.parents[1] / "openapi.yaml"
MADE = HERE / "stratus" / "scene.py"

HEAD = '''"""Scenes, typed. Made from openapi.yaml by generate.py (make scene-classes): change that, not this.

Every member may be left out (None): the daemon's default then holds, which the comment says. What is out of range the daemon refuses, naming
the member; `limits` tells ranges, for drawing scenes at random.
"""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from stratus.members import Section, member
'''


def choices(values):
    return "Literal[" + ", ".join(repr(value) for value in values) + "]"


def type_of(schema):
    if "oneOf" in schema:
        return " | ".join(type_of(one) for one in schema["oneOf"])
    if "const" in schema:
        return choices([schema["const"]])
    if "enum" in schema:
        return choices(schema["enum"])
    if schema["type"] == "array":
        items = schema.get("prefixItems") or [schema["items"]]
        inner = type_of(items[0])
        count = schema.get("maxItems")
        return f"tuple[{', '.join([inner] * count)}]" if count and count == schema.get("minItems") else f"list[{inner}]"
    return {"number": "float", "integer": "int", "string": "str", "boolean": "bool"}[schema["type"]]


def range_of(schema):
    for one in [schema, *schema.get("oneOf", []), *([schema["items"]] if "items" in schema else [])]:
        if "minimum" in one and "maximum" in one:
            return one["minimum"], one["maximum"]
    return None


def ranges_of(schema):
    """Of each element where they differ."""
    return [(one["minimum"], one["maximum"]) for one in schema["prefixItems"]] if "prefixItems" in schema else range_of(schema)


def comment_of(schema):
    parts = []
    ranges = ranges_of(schema)
    if isinstance(ranges, tuple):
        parts.append("%g to %g" % ranges if max(map(abs, ranges)) < 1e6 else "%d to %d" % ranges)
    elif ranges:
        parts.append("; ".join("%.10g to %.10g" % one for one in ranges))
    if "default" in schema:
        parts.append(f"default {schema['default']}")
    if "description" in schema:
        parts.append(" ".join(schema["description"].split()))
    return ". ".join(parts)


def write_member(name, schema):
    options = [f"{option}={value!r}" for option, value in (("limits", ranges_of(schema)), ("default", schema.get("default"))) if value is not None]
    comment = textwrap.wrap(comment_of(schema), 130, initial_indent="    # ", subsequent_indent="    # ")
    return "\n".join([*comment, f"    {name}: {type_of(schema)} | None = member({', '.join(options)})"])


def write_section(name, schema):
    lines = [f"@dataclass(slots=True, kw_only=True)\nclass {name.capitalize()}(Section):"]
    about = " ".join(schema.get("description", f"The member {name} of a scene.").split())
    lines.append(textwrap.indent("\n".join(textwrap.wrap(f'"""{about}"""', 130)), "    ") + "\n")
    lines += [write_member(member, one) for member, one in schema["properties"].items()]
    return "\n".join(lines) + "\n"


def write_scene(sections):
    lines = ['@dataclass(slots=True, kw_only=True)\nclass Scene(Section):\n    """What is rendered. `Scene()` is the daemon\'s default sky."""\n']
    lines += [f"    {name}: {name.capitalize()} = field(default_factory={name.capitalize()})" for name in sections]
    return "\n".join(lines) + "\n"


def write_all():
    sections = yaml.safe_load(SCHEMA.read_text())["components"]["schemas"]["Scene"]["properties"]
    parts = [HEAD, *(write_section(name, schema) for name, schema in sections.items()), write_scene(sections)]
    return "\n\n".join(parts)


if __name__ == "__main__":
    if "--check" in sys.argv[1:]:
        sys.exit(0 if MADE.read_text() == write_all() else "stratus/scene.py is not what openapi.yaml says: make scene-classes")
    MADE.write_text(write_all())
