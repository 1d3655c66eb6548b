import json
from itertools import pairwise

import numpy as np
import pytest

from fulcrum.scenarios.cli import main

QUICK = ["--points", "20"]


def planned(tmp_path, *arguments):
    code = main(["plan", *arguments, *QUICK, "--out", str(tmp_path / "plan")])
    file = tmp_path / "plan" / "plan.json"
    return code, json.loads(file.read_text()) if file.exists() else None


def test_plan_prints_draws_and_writes_the_plan(tmp_path, capsys):
    code, content = planned(tmp_path, "box-tilt", "--objective", "least-time")
    said = capsys.readouterr().out
    assert code == 0
    assert f"{content['duration_s']:.4f} s" in said
    assert "speed of left_e1" in said
    assert said.count("[deg]") == 2  # in both tables; Rich would take it for markup
    assert (tmp_path / "plan" / "plan.png").read_bytes().startswith(b"\x89PNG")
    grid, stations = content["grid"], content["stations"]
    assert grid["t_s"][-1] == pytest.approx(content["duration_s"])
    assert grid["tilt_deg"][-1] == pytest.approx(90.0)
    assert np.shape(grid["q"]) == (20, 14)
    assert np.shape(stations["wrench_contact_axes"]) == (1, 38, 4, 6)
    assert np.shape(stations["torque"]) == (1, 38, 14)
    assert content["residuals"]["primal"] < 1e-6
    active = content["active"]
    assert active[0]["from_deg"] == 0.0
    assert active[-1]["to_deg"] == pytest.approx(90.0)
    for before, after in pairwise(active):
        assert before["to_deg"] == after["from_deg"]
        assert set(before["limits"]) != set(after["limits"])


def test_a_plan_takes_its_margins_from_the_scenario_where_none_are_given(tmp_path):
    _, content = planned(tmp_path, "cylinder-tilt")
    assert content["margins"]["friction_factor"] == 0.85
    assert content["margins"]["grip_min"] == 10.0


def test_a_robust_plan_says_how_much_of_the_set_it_serves(tmp_path, capsys):
    code, content = planned(tmp_path, "box-tilt", "--robust")
    assert code == 0
    assert content["share_of_uncertainty"] == 1.0
    # Mass and centre of mass have 16 corners, hands with opposite normals 4 extreme places.
    assert content["loads"] == 1 + 16 * 4
    assert np.shape(content["stations"]["torque"]) == (65, 38, 14)
    assert "65 worlds: in 100 %" in capsys.readouterr().out
    # The certain plan takes 1.07 s on this grid.
    assert 1.1 < content["duration_s"] < 1.15


def test_a_plan_can_be_stretched(tmp_path):
    _, content = planned(tmp_path, "box-tilt", "--stretch", "2")
    assert 2.0 < content["duration_s"] < 2.3


def test_other_objectives_stay_within_the_duration(tmp_path):
    arguments = ["box-tilt", "--objective", "friction-margin", "--duration", "1.4"]
    _, content = planned(tmp_path, *arguments)
    assert content["duration_s"] < 1.4001
    assert content["value"] < 0.9


def test_where_there_is_no_plan_one_sentence_says_why(tmp_path, capsys):
    code, content = planned(tmp_path, "box-tilt", "--grip-max", "20")
    said = capsys.readouterr().out
    assert (code, content) == (1, None)
    assert said.count("\n") == 1
    assert "f_n_max of" in said
    assert " deg" in said
    assert not (tmp_path / "plan").exists()


@pytest.mark.parametrize(
    "wrong",
    [
        ["--objective", "most-time"],
        ["--duration", "-1"],
        ["--friction-factor", "1.5"],
        ["--limits", "0"],
        ["--grip-max", "1"],
        ["--stretch", "0"],
    ],
)
def test_bad_options_are_refused_in_one_line(tmp_path, capsys, wrong):
    code, content = planned(tmp_path, "box-tilt", *wrong)
    assert (code, content) == (2, None)
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert wrong[0] in message


def test_a_folder_with_something_in_it_is_left_alone(tmp_path):
    (tmp_path / "plan").mkdir()
    (tmp_path / "plan" / "kept").write_text("")
    assert planned(tmp_path, "box-tilt") == (2, None)
