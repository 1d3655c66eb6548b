"""Turns LaTeX into MathML when the site is built, so that pages need no script for it."""

from __future__ import annotations

import html
import re
from typing import Any

from math_core import LatexToMathML
from mkdocs.exceptions import PluginError

_CONVERTER = LatexToMathML(fancy_error=False)
# What pymdownx.arithmatex leaves of a formula in the page.
_FORMULA = re.compile(
    r'<(?P<tag>span|div) class="arithmatex">\\[(\[](?P<latex>.*?)\\[)\]]</(?P=tag)>', re.DOTALL
)
# Where a backslash is meant, and a command of LaTeX that no formula took up.
_CODE = re.compile(r"<(?P<tag>pre|code)\b.*?</(?P=tag)>", re.DOTALL)
_LEFT_OVER = re.compile(r"\\[a-zA-Z]+|:math:|\.\. math::")


def on_page_content(content: str, page: Any, **_: Any) -> str:
    """The page with MathML; a formula that cannot be read ends the build."""
    made = _FORMULA.sub(_mathml, content)
    left_over = _LEFT_OVER.search(_CODE.sub("", made))
    if left_over:
        raise PluginError(f"{page.file.src_path}: {left_over.group()} is in no formula")
    return made


def _mathml(found: re.Match[str]) -> str:
    latex, block = html.unescape(found["latex"]), found["tag"] == "div"
    mathml = _CONVERTER.convert_with_local_state(latex, displaystyle=block)
    return f'<div class="formula">{mathml}</div>' if block else mathml
