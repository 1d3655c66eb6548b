"""Docstrings as Markdown: the roles and directives that they are written with."""

from __future__ import annotations

import re
import textwrap
from typing import Any

try:
    from griffe import Extension
except ImportError:  # the tests read this module without the site's packages
    Extension = object  # type: ignore[assignment,misc]

_DIRECTIVE = re.compile(
    r"^(?P<indent> *)\.\. math::(?P<first>[^\n]*)\n(?P<rest>(?:(?:(?P=indent) +[^\n]*)?\n)*)",
    re.MULTILINE,
)
_MATH = re.compile(r":math:`([^`]*)`")
_ROLE = re.compile(r":(?:attr|class|func|meth|mod):`([^`]*)`")


def as_markdown(docstring: str) -> str:
    """The docstring with formulas as LaTeX between brackets, and names as code."""
    text = _DIRECTIVE.sub(_block, docstring + "\n")
    text = _MATH.sub(lambda found: rf"\({' '.join(found[1].split())}\)", text)
    return _ROLE.sub(r"`\1`", text).rstrip("\n")


def _block(found: re.Match[str]) -> str:
    latex = textwrap.dedent(f"{found['first'].strip()}\n{textwrap.dedent(found['rest'])}").strip()
    if "&" in latex:
        latex = rf"\begin{{aligned}}{latex}\end{{aligned}}"
    formula = f"\\[\n{latex}\n\\]\n"
    return "\n" + textwrap.indent(formula, found["indent"]) + "\n"


class Roles(Extension):
    """Rewrites every docstring as it is read, and lists the members of enumerations in it."""

    def on_instance(self, *, obj: Any, **_: Any) -> None:
        """Rewrites that of one object."""
        if obj.docstring is not None:
            obj.docstring.value = as_markdown(obj.docstring.value)

    def on_class_members(self, *, cls: Any, **_: Any) -> None:
        """Lists the values of an enumeration."""
        if cls.docstring is not None and any("Enum" in str(base) for base in cls.bases):
            values = (m.value for m in cls.attributes.values() if m.value is not None)
            listed = ", ".join(f"`{value}`" for value in values)
            cls.docstring.value += f"\n\nValues: {listed}."
