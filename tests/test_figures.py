"""Figures of a small made-up run: which there are, what they show, and that they repeat to the byte."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from made_up_run import EVERYTHING, made_up_run
from matplotlib.figure import Figure

from analysis import figures, run_figures
from analysis.trajectory import Run, Trajectory
from fmu_src.quantities import STATES


def test_each_figure_names_its_number_in_the_paper(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_figures, "render", lambda subject: b"")
    run, controlled = made_up_run(), made_up_run(enabled=True)

    def numbers(run: Run, counterpart: Run | None) -> list[str]:
        entries = run_figures.draw_all(run, counterpart, tmp_path)
        assert all((tmp_path / "figures" / entry.file).is_file() for entry in entries)
        return [entry.caption.split(" of the paper")[0].split(".")[0] for entry in entries]

    always = [f"As figure {number}" for number in (2, 3, 4, 5, 6)]
    ours = ["Not in the paper"] * 2
    assert numbers(run, None) == [*always, *ours]
    assert numbers(controlled, None) == [*always, "As figure 10", *ours]
    assert numbers(run, controlled) == numbers(controlled, run) == [*always, "As figure 9", "As figure 10", *ours]
    assert numbers(run, run) == numbers(run, None)  # a counterpart that is none


@pytest.mark.parametrize("horizon", ["finite", "infinite"])
def test_figures_9_and_10_say_that_the_weights_are_a_choice_and_which(horizon: str) -> None:
    controlled, run = made_up_run(enabled=True), made_up_run(enabled=False)
    controlled.record["parameters"]["controller"].update({"lambda": 3e9, "H1": 1.5, "T": 1.9, "horizon": horizon})
    end = "T = 1.9 s" if horizon == "finite" else "infinite horizon"
    for made in (run_figures.subjects(controlled, run), run_figures.subjects(run, controlled)):
        captions = [s.caption() for s in made if s.caption().startswith(("As figure 9 ", "As figure 10 "))]
        assert len(captions) == 2
        for caption in captions:
            assert f"λ = 3e+09 N²/m², H1 = 1.5 m, {end} and the car's data are this project's choice" in caption


def test_the_comparison_draws_the_controlled_car_in_red_whichever_run_it_is() -> None:
    run, controlled = made_up_run(), made_up_run(enabled=True)
    controlled.trajectory.values[:] *= 2.0
    for pair in ((run, controlled), (controlled, run)):
        subject = next(s for s in run_figures.subjects(*pair) if "09" in s.file)
        for panel, name in zip(subject.panels, ("body.heave", "body.pitch", "body.roll"), strict=True):
            red, blue = panel(Figure().subplots()).get_lines()
            assert (red.get_color(), blue.get_color()) == (figures.RED, figures.BLUE)
            np.testing.assert_allclose(red.get_ydata(), 1e3 * controlled.trajectory[name])
            np.testing.assert_allclose(blue.get_ydata(), 1e3 * run.trajectory[name])


def test_beside_both_the_comparison_draws_the_other_design() -> None:
    run, controlled, other = made_up_run(), made_up_run(enabled=True), made_up_run(enabled=True)
    other.trajectory.values[:] *= 3.0
    other.record["parameters"]["controller"]["design"] = "full-car"
    subject = next(s for s in run_figures.subjects(run, controlled, other) if "09" in s.file)
    assert "Purple: full-car design." in subject.caption()
    for panel, name in zip(subject.panels, ("body.heave", "body.pitch", "body.roll"), strict=True):
        *_, last = panel(Figure().subplots()).get_lines()
        assert last.get_color() == figures.PURPLE
        np.testing.assert_allclose(last.get_ydata(), 1e3 * other.trajectory[name])


def test_the_same_data_give_the_same_bytes_whatever_style_the_user_has_set() -> None:
    subject = run_figures.subjects(made_up_run(), None)[4]
    before = dict(matplotlib.rcParams)
    image = figures.render(subject)
    assert dict(matplotlib.rcParams) == before
    with matplotlib.rc_context({"lines.linewidth": 9.0, "xtick.color": "red", "svg.fonttype": "none"}):
        assert figures.render(run_figures.subjects(made_up_run(), None)[4]) == image
    root = ElementTree.fromstring(image)
    assert root.tag.endswith("svg") and not any(e.tag.endswith(("text", "date")) for e in root.iter())


def test_labels_come_from_the_table_and_values_are_in_their_unit() -> None:
    trajectory = made_up_run().trajectory
    ax = Figure().subplots()
    assert figures.plot_quantities(trajectory, STATES[3:5], ax) is ax
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$t$ [s]", "$z_{11}$, $z_{12}$ [mm]")
    np.testing.assert_allclose(ax.get_lines()[0].get_ydata(), 1e3 * trajectory["wheel_fl.heave"])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == [
        "$z_{11}$ front left wheel heave",
        "$z_{12}$ front right wheel heave",
    ]


def test_the_excitations_are_shown_where_the_road_is_not_flat() -> None:
    trajectory = made_up_run().trajectory
    assert figures.uneven(trajectory, wave=0.1) == pytest.approx((0.0, 0.4))
    endless = replace(trajectory, names=EVERYTHING, values=np.sin(20 * np.pi * trajectory.time)[:, None] * np.ones(66))
    assert figures.uneven(endless, wave=0.1) == pytest.approx((0.0, 0.5))  # four waves and a quarter
    assert figures.uneven(replace(trajectory, values=0.0 * trajectory.values), wave=0.1) == (0.0, 2.0)


def test_time_axes_end_a_quarter_after_all_has_settled() -> None:
    time = np.linspace(0.0, 10.0, 1001)
    values = np.where(time < 2.0, np.cos(time), 3.0)
    trajectory = Trajectory(time=time, names=("body.heave",), values=values[:, None])
    assert figures.eventful([trajectory], STATES[:1]) == pytest.approx((0.0, 2.5))
    still = replace(trajectory, values=np.ones((1001, 1)))
    assert figures.eventful([trajectory, still], STATES[:1]) == (0.0, 10.0)


def test_a_long_run_gives_a_small_figure_that_keeps_its_peaks() -> None:
    n = 200_001
    time = np.linspace(0.0, 200.0, n)
    values = np.sin(60.0 * time)
    values[123_457], values[150_001] = 5.0, -4.0
    (line,) = Figure().subplots().plot(time, values)
    figures.thin(line, (0.0, 200.0))
    x, y = (np.asarray(each) for each in line.get_data())
    assert len(x) == 2 * figures.COLUMNS
    assert (y.max(), y.min()) == (5.0, -4.0)
    assert x[y.argmax()] == pytest.approx(time[123_457], abs=200.0 / figures.COLUMNS)


def test_where_the_displacements_end_is_said_beside_the_papers_shift() -> None:
    run = made_up_run()
    four = run_figures.subjects(run, None)[2]
    assert f"body heave {figures.readable(1e3 * run.trajectory['body.heave'][-1], 2)} mm" in four.caption()
    assert "vibrational shift" in four.caption()
    run.trajectory.values[-1, EVERYTHING.index("h_rr")] = 0.01  # the road does not end level: nothing to compare
    assert "vibrational shift" not in four.caption()
