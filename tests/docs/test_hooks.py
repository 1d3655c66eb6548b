"""What builds the documentation: docstrings become Markdown, and nothing is fetched."""

import importlib.util
from pathlib import Path

import pytest

HOOKS = Path(__file__).parents[2] / "docs" / "hooks"


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
        as_markdown("See :class:`sim.world.world.World` at `x`: y.")
        == "See `sim.world.world.World` at `x`: y."
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


# --- the reference of scenario files ---

SCHEMA = {
    "anyOf": [{"$ref": "#/$defs/CrateFile"}],
    "$defs": {
        "CrateFile": {
            "description": "A crate.",
            "type": "object",
            "required": ["lid"],
            "properties": {
                "lid": {"oneOf": [{"$ref": "#/$defs/FlatTable"}, {"$ref": "#/$defs/RoundTable"}]},
                "pads": {"patternProperties": {"^[a-z]+$": {"$ref": "#/$defs/PadTable"}}},
                "feet": {"type": "array", "items": {"$ref": "#/$defs/PadTable"}},
                "mass_kg": {
                    "anyOf": [{"type": "number", "exclusiveMinimum": 0.0}, {"type": "null"}],
                    "default": None,
                    "description": "What `it` weighs | or not [kg].",
                },
                "size_m": {"type": "array", "minItems": 2, "maxItems": 2, "default": [1.0, 2.0]},
            },
        },
        "FlatTable": {
            "description": "A flat lid.",
            "type": "object",
            "properties": {
                "kind": {"const": "flat"},
                "tight": {"type": "boolean", "default": True},
            },
        },
        "RoundTable": {
            "description": "A round lid.",
            "type": "object",
            "properties": {
                "kind": {"const": "round"},
                "tight": {"type": "boolean", "default": True},
            },
        },
        "PadTable": {
            "description": "A pad.",
            "type": "object",
            "properties": {"side": {"type": "string", "enum": ["left", "right"]}},
        },
    },
}


def test_every_table_of_a_schema_has_a_section_under_its_header():
    text = hook("schema").reference(SCHEMA)
    sections = [line for line in text.splitlines() if line.startswith("#")]
    assert sections == [
        "## crate file",
        "### `[lid]`",
        "### `[pads.NAME]`",
        "### `[[feet]]`",
    ]


def test_keys_have_type_range_default_and_description():
    text = hook("schema").reference(SCHEMA)
    assert r"| `mass_kg` | number &gt; 0 |  | What `it` weighs \| or not \[kg\]. |" in text
    assert "| `lid` | table | must be there |  |" in text
    assert '| `side` | "left" or "right" |  |  |' in text
    assert "1.0, 2.0" in text


def test_keys_that_all_kinds_of_a_table_have_stand_there_once():
    text = hook("schema").reference(SCHEMA)
    assert text.count("| `tight` | true or false | true |") == 1
    assert text.index("`tight`") < text.index("**A flat lid.**") < text.index("**A round lid.**")
    assert '| `kind` | "round" |' in text[text.index("**A round lid.**") :]
