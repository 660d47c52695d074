"""What the classes of a scene are made of."""
from __future__ import annotations

import dataclasses


def member(limits=None, default=None):
    """A member that is left to the daemon unless it is set. limits: its range, or those of its elements; default: what the daemon takes."""
    return dataclasses.field(default=None, metadata={"limits": limits, "default": default})


@dataclasses.dataclass(slots=True)
class Section:
    """Members that can be left out, to and from JSON."""

    def to_json(self) -> dict:
        """What was set, as the body of a request has it."""
        found = {}
        for one in dataclasses.fields(self):
            value = getattr(self, one.name)
            if isinstance(value, Section):
                value = value.to_json() or None
            if value is not None:
                found[one.name] = plain(value)
        return found

    @classmethod
    def from_json(cls, data: dict):
        """The other way, for a scene from a file or a picture. ValueError names a member that there is not."""
        made = cls()
        names = {one.name for one in dataclasses.fields(cls)}
        for name, value in data.items():
            if name not in names:
                raise ValueError(f"{cls.__name__} has no member {name}")
            inner = getattr(made, name)
            setattr(made, name, type(inner).from_json(value) if isinstance(inner, Section) else value)
        return made

    def set(self, path: str, value):
        """Sets a dotted member: scene.set("sun.elevation_deg", 10)."""
        section, _, name = path.rpartition(".")
        owner = getattr(self, section) if section else self
        if name not in {one.name for one in dataclasses.fields(owner)}:
            raise AttributeError(f"{type(owner).__name__} has no member {name}")
        setattr(owner, name, value)
        return self


def plain(value):
    """As JSON knows it: numpy's numbers and arrays become Python's."""
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    if hasattr(value, "tolist"):
        return value.tolist()
    return value


def metadata(scene_class, path: str) -> dict:
    """{"limits", "default"} of a dotted member."""
    section, _, name = path.partition(".")
    sections = {one.name: one.default_factory for one in dataclasses.fields(scene_class)}
    if section in sections:
        for one in dataclasses.fields(sections[section]):
            if one.name == name:
                return dict(one.metadata)
    raise ValueError(f"a scene has no member {path}")
