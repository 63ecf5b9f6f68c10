"""Recordings in files: written ones are read back, and files as machines write them are read."""

import re

import numpy as np
import pytest

from fencejax.study import Recording, read_recording, write_recording


def test_files_come_back(tmp_path):
    generator = np.random.default_rng(1)
    signals = {name: generator.normal(size=100) for name in ("force", "tip_deflection")}
    recording = Recording(np.linspace(0.0, 0.05, 101)[1:], signals)
    write_recording(tmp_path / "a.csv", recording)
    again = read_recording(tmp_path / "a.csv")
    np.testing.assert_array_equal(again.time, recording.time)
    np.testing.assert_array_equal(again.values, recording.values)
    assert read_recording(tmp_path / "a.csv", ["force"]).names == ("force",)


def test_units_comments_and_separators(tmp_path):
    path = tmp_path / "b.csv"
    rows = "\n".join(f"{k};{0.1 * k};{-2.0 * k};note {k}" for k in range(6))
    path.write_text(
        f"\ufeffsep=;\n# made by hand\nTime (ms);Force [kN];Tip deflection [mm];what\n\n{rows}\n"
    )
    found = read_recording(path)
    assert found.time == pytest.approx(1e-3 * np.arange(6))
    assert found.signals["force"] == pytest.approx(100.0 * np.arange(6))
    assert found.signals["tip_deflection"] == pytest.approx(-2e-3 * np.arange(6))


def test_german_files_with_titles_of_their_own(tmp_path):
    path = tmp_path / "messung.csv"
    rows = [f"{0.5 * k:.1f};{1000.25 + k:.2f};{2 * k}" for k in range(6)]
    german = [row.replace(".", ",").replace("1000", "1.000") for row in rows]
    # Units in a line of their own, the encoding of a German Windows, samples that are missing.
    german[2] = german[2].partition(";")[0] + ";;4"
    german.insert(3, ";7,0;1")
    text = "\n".join(["Zeit;Kraft;Winkel [\u00b0]", "ms;N;\u00b0", *german])
    path.write_bytes(text.encode("cp1252"))
    columns = {"time": "Zeit", "force": "kraft", "angle": "Winkel"}
    found = read_recording(path, columns=columns)
    assert found.time == pytest.approx(5e-4 * np.arange(6))
    expected = 1000.25 + np.arange(6)
    expected[2] = np.nan
    np.testing.assert_allclose(found.signals["force"], expected)
    assert found.signals["angle"] == pytest.approx(np.deg2rad(2.0 * np.arange(6)))
    assert (found.missing, found.untimed) == ({"force": 1}, 1)
    # Back in the package's own form, with what is missing.
    write_recording(tmp_path / "own.csv", found)
    again = read_recording(tmp_path / "own.csv")
    np.testing.assert_array_equal(again.values, found.values)
    for wrong, text in (
        ({"time": "Zeiten"}, "must have one column 'Zeiten' for `time`.* Did you mean 'Zeit'"),
        ({"weight": "Kraft"}, "`columns` must name columns of time and force"),
        ({"force": "Kraft"}, "must name a column `time"),
    ):
        with pytest.raises(ValueError, match=text):
            read_recording(path, columns=wrong)


_GOOD = ["0.00,1.0,0.1", "0.01,2.0,0.2", "0.02,3.0,0.3", "0.03,2.0,0.2", "0.04,1.0,0.1"]


@pytest.mark.parametrize(
    ("header", "rows", "text"),
    [
        ("", [], "is empty"),
        ("t [s],force [N]", ["0,1"], "line 1: must name a column `time [s]`"),
        ("time [s],load [N]", ["0,1"], "line 1: must name a column of"),
        ("time [s],force [lbf]", ["0,1"], "line 1, column `force [lbf]`: the unit must be one of"),
        ("time [s],force [N],force [kN]", ["0,1,1"], "line 1: names the column `force` twice"),
        ("time [s],force [N],x [m]", ["0.0,1.0"], "line 2: must have 3 columns"),
        ("", ["0.0,high,1"], "column `force [N]`: must be a number, but is 'high'"),
        ("", ["0.0,1,inf"], "line 2, column `x [m]`: must be finite"),
        ("", [*_GOOD[:3], "0.02,3.0,0.3"], "line 5, column `time [s]`: times must rise"),
        ("", _GOOD[:4], "at least 5 rows"),
        ("time [s];force [N]", ["0,1;1,5", "0.2;2,5"], "line 3, column `time [s]`: must be writ"),
        ("time [s],force [N]", ["0,0,1,5"], "If these are decimal commas, separate columns by"),
        ("", [*_GOOD[:4], "0.05,,1.0"], "`force` must hold at least 5 samples, but has 4"),
        ("", ['0.0,"1.0,1'], "line 2: cannot be read as CSV"),
    ],
)
def test_bad_files(tmp_path, header, rows, text):
    path = tmp_path / "bad.csv"
    head = header or ("time [s],force [N],x [m]" if rows else "")
    path.write_text("\n".join([head, *rows]))
    with pytest.raises(ValueError, match=re.escape(text)) as refused:
        read_recording(path)
    assert str(path) in str(refused.value)


def test_files_that_are_no_text(tmp_path):
    path = tmp_path / "bad.csv"
    path.write_bytes(b"time [s],force [N]\n\x81\x00")
    with pytest.raises(ValueError, match="UTF-8"):
        read_recording(path)
    with pytest.raises(FileNotFoundError):
        read_recording(tmp_path / "none.csv")
    path.write_text("\n".join(["time [s],force [N],x [m]", *_GOOD]))
    with pytest.raises(ValueError, match="line 1: must name a column `y`"):
        read_recording(path, ["y"])
