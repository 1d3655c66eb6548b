"""What builds the documentation: docstrings become Markdown, and nothing is fetched."""

import importlib.util
from pathlib import Path

import pytest

HOOKS = Path(__file__).parent.parent / "docs" / "hooks"


def hook(name):
    """A module of the site's, which needs none of the site's packages for what is tested here."""
    spec = importlib.util.spec_from_file_location(f"docs_{name}", HOOKS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


as_markdown = hook("docstrings").as_markdown
fetched = hook("local").fetched


def test_a_formula_in_a_line_is_put_between_brackets_also_over_two_lines():
    assert as_markdown(r"With :math:`f_C` and :math:`\tau" "\n" r"_g`.") == (
        r"With \(f_C\) and \(\tau _g\)."
    )


def test_a_formula_of_its_own_is_put_between_brackets():
    text = "Text\n\n.. math:: a \\le\n    b\n\nwith more."
    assert as_markdown(text) == "Text\n\n\n\\[\na \\le\nb\n\\]\n\nwith more."


def test_a_formula_with_columns_is_aligned_and_keeps_its_indent():
    text = "- Item:\n\n  .. math::\n\n      a & b \\\\\n      c & d\n\n- Next"
    shown = as_markdown(text)
    assert "  \\[\n  \\begin{aligned}a & b \\\\\n  c & d\\end{aligned}\n  \\]" in shown
    assert shown.endswith("- Next")


def test_names_become_code_and_other_text_stays():
    assert (
        as_markdown("See :class:`sim.world.World` at `x`: y.") == "See `sim.world.World` at `x`: y."
    )
    assert as_markdown("Args:\n    x: [m].") == "Args:\n    x: [m]."


@pytest.mark.parametrize(
    "text",
    [
        '<script src="https://cdn.example/x.js">',
        "<script async src='//cdn.example/x.js'>",
        '<img alt="" src=http://example/x.png>',
        '<link rel="stylesheet" href="https://fonts.example/css">',
        "@import 'https://example/x.css';",
        "background: url(//example/x.png)",
    ],
)
def test_what_a_browser_would_fetch_is_found(text):
    assert len(fetched(f"<p>before</p>{text}<p>after</p>")) == 1


@pytest.mark.parametrize(
    "text",
    [
        '<a href="https://example.org">a link</a>',
        '<script src="assets/x.js">',
        '<link rel="canonical" href="https://example.org/x.html">',
        '<svg xmlns="http://www.w3.org/2000/svg">',
        "url(data:image/svg+xml;charset=utf-8,x)",
    ],
)
def test_links_and_files_of_the_site_are_not(text):
    assert fetched(text) == []
