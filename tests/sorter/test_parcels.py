"""The parcels of a sorter: lists, rows, files and distributions."""

import re

import numpy as np
import pytest

import fencejax as fj


def test_lists_and_rows_are_combined():
    parcels = fj.Sorter(parcels={
        "list": [{"mass": 1, "length": 0.2, "weight": 3}, {"mass": 9, "length": 0.5, "weight": 1}],
        "offset": [0.0, 0.1], "breadth": 0.25,
    }).parcels  # fmt: skip
    assert parcels.count == 4
    np.testing.assert_array_equal(parcels.columns["parcel.mass"], [1, 1, 9, 9])
    np.testing.assert_array_equal(parcels.columns["start.offset"], [0, 0.1, 0, 0.1])
    np.testing.assert_array_equal(parcels.columns["parcel.breadth"], np.full(4, 0.25))
    np.testing.assert_allclose(parcels.weights, [3 / 8, 3 / 8, 1 / 8, 1 / 8])
    assert parcels.text(3) == "9 kg, length 0.5 m, offset 0.1 m"


@pytest.mark.parametrize(
    "text",
    [
        "mass [g],length [mm],weight\n500,200,3\n30000,600,1\n",
        "\ufeffmass;length [cm];weight\n0,5;20;3\n30;60,0;1\n\n",
        "sep=;\nMass (g);Length [cm];Weight\n500;20;3\n30000;60,0;1\n;;\n",
        "\n# measured on Monday\nmass [kg]\tLENGTH\tweight\n0,5\t0,2\t3\n\n30\t0,6\t1\n",
        ";;\nmass;length;weight\n0.5;0.2;3\n30;0.6;1\n",
    ],
)
def test_parcels_from_a_file(tmp_path, text):
    (tmp_path / "parcels.csv").write_text(text, encoding="utf-8")
    (tmp_path / "mine.toml").write_text('[parcels]\nfile = "parcels.csv"\n')
    parcels = fj.Sorter.load(tmp_path / "mine.toml").parcels
    np.testing.assert_allclose(parcels.columns["parcel.mass"], [0.5, 30])
    np.testing.assert_allclose(parcels.columns["parcel.length"], [0.2, 0.6])
    np.testing.assert_allclose(parcels.weights, [0.75, 0.25])


def test_a_files_defects_are_reported_with_their_line(tmp_path):
    (tmp_path / "parcels.csv").write_text("mass [kg]\n1\nheavy\n")
    with pytest.raises(ValueError, match=r"parcels.csv:3.mass` \[kg\] must be a number"):
        fj.Sorter(parcels={"file": "parcels.csv"}, folder=tmp_path)
    (tmp_path / "parcels.csv").write_text("mas [kg]\n1\n")
    with pytest.raises(ValueError, match="unknown key `mas`. Did you mean `mass`"):
        fj.Sorter(parcels={"file": "parcels.csv"}, folder=tmp_path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mass [kg],mass [g],weight\n1,2,3\n", "line 1: must .* once, but names `mass` twice"),
        ("Mass;mass [g]\n1;2\n", "names `mass` twice"),
        ("mass [kg]\n\n# heavy ones\n1\nheavy\n", r"parcels.csv:5.mass` \[kg\] must be a number"),
        ("\n\nmass [kg],length\n1,2\n3\n", "line 5: must have 2 columns as the header, but has 1"),
        ("mass [g];weight\n1.600,5;1\n", "csv:2.mass` must .* decimal comma.* but is '1.600,5'"),
        ("mass [g];weight\n1,5;1\n1.600;1\n", "csv:3.mass` must .* comma.* but is '1.600'"),
        ("mass [g];weight\n1,600,5;1\n", "but is '1,600,5'"),
        ("mass [kg\n1\n", r"unknown key `mass \[kg`"),
        ("mass [kg]\n\n", "one parcel at least"),
        ("\n", "parcels.csv: must hold a header"),
    ],
)
def test_a_files_dialects_are_not_guessed(tmp_path, text, message):
    (tmp_path / "parcels.csv").write_text(text)
    with pytest.raises(ValueError, match=message):
        fj.Sorter(parcels={"file": "parcels.csv"}, folder=tmp_path)


def test_a_missing_file_is_named_with_its_key(tmp_path):
    (tmp_path / "mine.toml").write_text('[parcels]\nfile = "none.csv"\n')
    message = "mine.toml: Argument `parcels.file` must name a CSV file, but is .*none.csv': No such"
    with pytest.raises(ValueError, match=message):
        fj.Sorter.load(tmp_path / "mine.toml")


def test_an_implausible_number_is_named_where_it_is_written(tmp_path):
    (tmp_path / "parcels.csv").write_text("mass\n1\n\n5000\n2\n")
    file, rows = {"file": "parcels.csv"}, {"list": [{"mass": 1}, {"mass": 5000}]}
    for given, name in (
        (file, r"parcels.csv:4.mass"),
        (rows, r"`parcels.list\[1\].mass"),
        ({**file, "length": [0.1, 50]}, "`parcels.length` is 50 "),
    ):
        with pytest.warns(fj.sorter.ImplausibleNumberWarning) as warned:
            fj.Sorter(parcels={"offset": [0.1, 0.2], **given}, folder=tmp_path)
        assert any(re.search(name, str(each.message)) for each in warned)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_a_file_of_parcels_is_read_as_a_spreadsheet_saves_it(tmp_path, encoding):
    # A micro sign is one byte in the Windows encoding, with which no character of UTF-8 begins.
    text = "mass [kg];critical_velocity_change [\u00b5m/\u00b5s]\n1,5;2\n"
    (tmp_path / "parcels.csv").write_bytes(text.encode(encoding))
    columns = fj.Sorter(parcels={"file": "parcels.csv"}, folder=tmp_path).parcels.columns
    np.testing.assert_allclose(columns["parcel.mass"], [1.5])
    np.testing.assert_allclose(columns["parcel.critical_velocity_change"], [2.0])


def test_a_file_of_parcels_that_is_no_text_is_refused_with_its_byte(tmp_path):
    (tmp_path / "parcels.csv").write_bytes(b"mass [kg]\n\x00\xff\n")
    (tmp_path / "mine.toml").write_text('[parcels]\nfile = "parcels.csv"\n')
    message = "mine.toml: .*parcels.csv: must be text in UTF-8, but byte 11 is not"
    with pytest.raises(ValueError, match=message):
        fj.Sorter.load(tmp_path / "mine.toml")


def test_distributions_have_their_moments():
    parcels = fj.Sorter(parcels={
        "count": 1024,
        "mass": {"distribution": "lognormal", "median": "4 kg", "spread": 0.5},
        "length": {"distribution": "uniform", "lower": 0.2, "upper": 0.6},
        "breadth": {"distribution": "normal", "mean": 0.3, "deviation": "20 mm"},
        "stiffness": {"distribution": "logarithmic", "lower": 1e9, "upper": 4e9},
    }).parcels  # fmt: skip
    columns = parcels.columns
    assert parcels.count == 1024
    # A net of 1024 points has one point in each of 1024 equal intervals of every number, so that
    # quantiles are off by a share of 1/1024 at most: of the density there, 0.2 % of the medians;
    # the means of these smooth laws by the tails' last interval, below 1 %.
    assert np.median(columns["parcel.mass"]) == pytest.approx(4.0, rel=2e-3)
    assert np.mean(columns["parcel.mass"]) == pytest.approx(4 * np.exp(0.125), rel=1e-2)
    assert np.mean(columns["parcel.length"]) == pytest.approx(0.4, rel=1e-3)
    assert np.std(columns["parcel.breadth"]) == pytest.approx(0.02, rel=1e-2)
    assert np.median(columns["parcel.stiffness"]) == pytest.approx(2e9, rel=2e-3)
    cut = fj.Sorter(parcels={
        "mass": {"distribution": "normal", "mean": 5, "deviation": 3, "lower": 1, "upper": 6},
    }).parcels.columns["parcel.mass"]  # fmt: skip
    assert 1 <= np.min(cut) < 1.5
    assert 5.8 < np.max(cut) <= 6
