"""The files of real cells, on small synthetic ones in the same layout."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from enhsim_tf.common.errors import InputError
from studies.reference_or_source.real_cells import (
    JUDGED,
    KNOWN,
    NUM_KNOWN,
    ODD,
    load_cells,
    read_discharges,
)

REAL = Path(__file__).parents[4] / "shared" / "data" / "nasa_cells"


def recorded(hours=0.5, amperes=2.0, step_s=7.0, volts=None):
    """A discharge at constant current between two rests, with a ramp of voltage and temperature."""
    loaded = np.arange(0, 3600 * hours + 1e-9, step_s)
    seconds = np.concatenate([[0.0, 9.0], 20.0 + loaded, 20.0 + loaded[-1] + [10.0, 20.0]])
    current = np.where((seconds >= 20) & (seconds <= 20 + loaded[-1]), -amperes, 0.0)
    return {
        "Voltage_measured": 4.0 - seconds / 3600 if volts is None else np.full_like(seconds, volts),
        "Current_measured": current,
        "Temperature_measured": 24 + seconds / 600,
        "Time": seconds,
    }


def write_csv(path, discharges):
    tables = [pd.DataFrame(columns).assign(cycle_idx=n) for n, columns in enumerate(discharges, 1)]
    pd.concat(tables).to_csv(path, index=False)


def write_matlab(path, discharges):
    cycles = [{"type": "discharge", "data": columns} for columns in discharges]
    cycles.insert(1, {"type": "charge", "data": {"Time": np.zeros(3)}})
    savemat(path, {path.stem: {"cycle": np.array(cycles, dtype=object)}})


@pytest.mark.parametrize(("name", "write"), [("B0005.csv", write_csv), ("B0029.mat", write_matlab)])
def test_a_discharge_is_put_on_the_grid_from_the_first_to_the_last_sample_under_load(
    tmp_path, name, write
):
    write(tmp_path / name, [recorded(), recorded()])
    discharges = read_discharges(tmp_path / name)
    assert [discharge.number for discharge in discharges] == [0, 1]
    values, seconds = discharges[0].values, 20 + 10 * np.arange(180)
    # 257 steps of 7 s: the last sample under load is at 1,799 s
    assert values == pytest.approx(
        np.stack([4 - seconds / 3600, 24 + seconds / 600, np.full(180, 2.0)], axis=1)
    )
    assert discharges[0].capacity_ah == pytest.approx(2 * 1799 / 3600)


def test_a_discharge_without_a_window_is_left_out(tmp_path):
    write_csv(tmp_path / "B0005.csv", [recorded(0.1), recorded()])
    assert [discharge.number for discharge in read_discharges(tmp_path / "B0005.csv")] == [1]


@pytest.mark.parametrize("change", [{"volts": 4.5}, {"step_s": 70.0}])
def test_impossible_values_and_long_gaps_are_noticed(tmp_path, change):
    write_csv(tmp_path / "B0005.csv", [recorded(), recorded(**change)])
    possible = [each.is_possible for each in read_discharges(tmp_path / "B0005.csv")]
    assert possible == [True, False]


def test_collapsed_first_runs_and_impossible_discharges_are_not_known(tmp_path):
    hours = [0.2, 0.3, *np.linspace(0.5, 0.4, 28)]
    discharges = [recorded(each) for each in hours]
    discharges[5] = recorded(0.5, volts=4.5)
    for name in ("B0033.csv", "B0036.csv"):
        write_csv(tmp_path / name, discharges)
    cell = load_cells(tmp_path)[0]
    assert [each.number for each in cell.of_use(ODD)] == [0, 1, 5]
    known = [each.number for each in cell.of_use(KNOWN)]
    assert known == [2, 3, 4, 6, 7, 8, 9, 10, 11, 12] and len(known) == NUM_KNOWN
    assert [each.number for each in cell.of_use(JUDGED)] == list(range(13, 30))


def test_loss_is_relative_to_the_mean_of_the_known_discharges(tmp_path):
    for name in ("B0005.csv", "B0006.csv"):
        write_csv(tmp_path / name, [recorded(step_s=10.0)] * 10 + [recorded(0.45, step_s=10.0)] * 2)
    cell = load_cells(tmp_path)[1]
    assert cell.loss(cell.discharges[-1]) == pytest.approx(0.1)


def test_files_of_another_kind_are_refused_in_one_line(tmp_path):
    with pytest.raises(InputError, match="Expected files of cells"):
        load_cells(tmp_path)
    write_csv(tmp_path / "B0005.csv", [recorded()])
    with pytest.raises(InputError, match="Expected two or more cells"):
        load_cells(tmp_path)
    savemat(tmp_path / "B0029.mat", {"B0029": 1.0})
    with pytest.raises(InputError, match="Expected a cell of NASA"):
        read_discharges(tmp_path / "B0029.mat")
    pd.DataFrame({"Time": [1.0]}).to_csv(tmp_path / "B0006.csv")
    with pytest.raises(InputError, match="cycle_idx"):
        read_discharges(tmp_path / "B0006.csv")


@pytest.mark.skipif(not REAL.is_dir(), reason="the cells are not part of the project")
def test_the_real_cells_have_their_published_capacities():
    cells = {cell.name: cell for cell in load_cells(REAL)}
    assert len(cells) >= 11
    capacities = [each.capacity_ah for each in cells["B0005"].discharges]
    assert max(capacities) == pytest.approx(1.856, abs=0.01)  # published
    assert capacities[-1] == pytest.approx(1.325, abs=0.01)
    assert cells["B0033"].of_use(KNOWN)[0].number == 7
