"""What can go wrong, by who can do something about it."""
from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Wrong:
    """One member that is wrong: where (a JSON pointer, /sun/elevation_deg) and what is."""

    pointer: str
    detail: str

    def __str__(self):
        return f"{self.pointer or '(the whole scene)'}: {self.detail}"


class StratusError(Exception):
    """Of everything here."""


class Unreachable(StratusError):
    """No connection, or it broke."""


class Refused(StratusError):
    """The daemon answered, and not with what was asked for."""

    def __init__(self, status: int, title: str = "", detail: str = "", errors: tuple[Wrong, ...] = (), request_id: str = "", retry_after_s: float = 0):
        self.status, self.title, self.detail, self.errors = status, title, detail, errors
        self.request_id, self.retry_after_s = request_id, retry_after_s
        super().__init__("\n  ".join([f"{status} {title}".strip() + (f": {detail}" if detail else ""), *map(str, errors)]))

    @property
    def pointers(self) -> list[str]:
        return [wrong.pointer for wrong in self.errors]


class InvalidScene(Refused):
    """400, 422: `errors` names every member that is wrong."""


class Denied(Refused):
    """401, 403: a key is missing, or wrong."""


class Busy(Refused):
    """429, 503, after as many attempts as the client makes: ask again after retry_after_s."""


class TimedOut(Refused):
    """504: the deadline passed."""


def of_answer(status: int, problem: dict, request_id: str, retry_after_s: float) -> Refused:
    kinds = {400: InvalidScene, 422: InvalidScene, 401: Denied, 403: Denied, 429: Busy, 503: Busy, 504: TimedOut}
    errors = tuple(Wrong(one.get("pointer", ""), one.get("detail", "")) for one in problem.get("errors", []))
    return kinds.get(status, Refused)(status, problem.get("title", ""), problem.get("detail", ""), errors, request_id, retry_after_s)
