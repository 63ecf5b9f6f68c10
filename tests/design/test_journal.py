"""Journals: damaged lines are ignored, and files that are no journals are refused in one line."""

import copy
import errno
import json
import os

import equinox as eqx
import numpy as np
import pytest

from fencejax.design import Journal

DATA = (np.asarray(1.0),)


def numbers(x):
    """Two objectives and one margin of two variables, counts of their statuses and rungs."""
    return [
        np.array([x, 2 * x]), np.array([1 - x]), np.array([[1.0, 0.0], [2.0, np.nan]]),
        np.array([[-1.0, 0.5]]), np.array([3, 0, 1]), np.array([4, 0]),
    ]  # fmt: skip


@pytest.fixture
def path(tmp_path):
    return tmp_path / "folder" / "evaluations.jsonl"


@pytest.fixture
def written(path):
    """A journal of five evaluations."""
    journal = Journal(path, "a")
    for x in range(5):
        journal.add([x, 0.0], DATA, numbers(float(x)))
    return path


def known(journal):
    """Which of the five are known, each bit by bit."""
    found = []
    for x in range(5):
        parts = journal.find([x, 0.0], DATA)
        if parts is not None:
            found.append(x)
            for part, wanted in zip(parts, numbers(float(x)), strict=True):
                np.testing.assert_array_equal(part, wanted)
    return found


@pytest.mark.parametrize(
    "tear",
    [
        lambda line: line[: len(line) // 2],
        lambda line: line[:-3],
        lambda line: b"\0" * len(line),
        lambda line: b"\xff\xfe" + line,
        lambda line: b"[1, 2]",
        lambda line: line.replace(b'"numbers": [[2.0, ', b'"numbers": [['),
        lambda line: line.replace(b"[3, 0, 1]", b"[3, 0, -1]"),
        lambda line: line.replace(b"[3, 0, 1]", b"[3" + b"0" * 400 + b"]"),
        lambda line: line.replace(b'"point": [2.0', b'"point": [2.0, 7.0'),
    ],
)
def test_a_torn_line_loses_one_evaluation(written, tear):
    lines = written.read_bytes().split(b"\n")
    torn = tear(lines[3])
    assert torn != lines[3]
    lines[3] = torn
    written.write_bytes(b"\n".join(lines))
    journal = Journal(written, "a")
    assert journal.torn == 1
    assert "1 torn lines" in str(journal)
    assert known(journal) == [0, 1, 3, 4]
    journal.add([2, 0.0], DATA, numbers(2.0))
    assert known(Journal(written, "a")) == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("cut", [1, 2, 30])
def test_a_line_cut_off_at_the_end_takes_none_with_it(written, cut):
    written.write_bytes(written.read_bytes()[:-cut])
    journal = Journal(written, "a")
    # Without its line's end alone, an evaluation is whole.
    there = [0, 1, 2, 3] + ([4] if cut == 1 else [])
    assert known(journal) == there
    journal.add([4, 0.0], DATA, numbers(4.0))
    assert known(Journal(written, "a")) == [0, 1, 2, 3, 4]


def test_an_empty_file_and_half_a_header_begin_anew(path):
    for text in ("", '{"fencejax jour'):
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        Journal(path, "a").add([0, 0.0], DATA, numbers(0.0))
        assert known(Journal(path, "a")) == [0]


@pytest.mark.parametrize(
    "content",
    [b"notes of mine", b"\x89PNG\r\n\x1a\n\0", b'{"fencejax journal": 2}\n', b"[]\n", b"\n\n"],
)
def test_foreign_files_are_refused_and_kept(path, content):
    path.parent.mkdir()
    path.write_bytes(content)
    with pytest.raises(ValueError, match="is none. Name another file or folder") as raised:
        Journal(path, "a")
    assert "\n" not in str(raised.value)
    assert path.read_bytes() == content


def test_other_problems_are_refused(written):
    with pytest.raises(ValueError, match="written with other settings"):
        Journal(written, "b")


@pytest.mark.parametrize("links", [True, False])
def test_of_two_problems_at_once_in_one_folder_one_is_refused(path, monkeypatch, links):
    """Both have seen no file when the first one creates it."""
    real, claimed = type(path).exists, []

    def exists(self, **settings):
        if self == path and not claimed:
            claimed.append(None)
            claimed.append(Journal(path, "a"))
            return False
        return real(self, **settings)

    def no_link(*places):
        raise OSError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(type(path), "exists", exists)
    if not links:
        monkeypatch.setattr(os, "link", no_link)
    with pytest.raises(ValueError, match="written with other settings"):
        Journal(path, "b")
    claimed[1].add([0, 0.0], DATA, numbers(0.0))
    assert known(Journal(path, "a")) == [0]
    assert [each.name for each in path.parent.iterdir()] == [path.name]


def test_lines_of_another_problem_are_passed_over(written, tmp_path):
    other = Journal(tmp_path / "other.jsonl", "b")
    other.add([2, 0.0], DATA, numbers(7.0))
    foreign = other.path.read_bytes().split(b"\n")[1]
    written.write_bytes(written.read_bytes() + foreign + b"\n")
    journal = Journal(written, "a")
    assert (journal.torn, journal.foreign) == (0, 1)
    assert "1 lines of another problem passed over" in str(journal)
    assert known(journal) == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    ("change", "by"),
    [
        ({"fencejax": "0.0.1, source 0123456789ab"}, "0.0.1, source 0123456789ab"),
        ({"fencejax": None}, "an earlier one"),
        ({"fencejax journal": 99}, None),
    ],
)
def test_journals_of_another_fencejax_are_refused_in_one_line_and_kept(written, change, by):
    first, *rest = written.read_text().split("\n")
    by = by or json.loads(first)["fencejax"]
    header = json.loads(first) | change
    header = {name: value for name, value in header.items() if value is not None}
    written.write_text("\n".join([json.dumps(header), *rest]))
    before = written.read_bytes()
    with pytest.raises(ValueError, match=rf"by another one \({by}\).* or remove this one") as no:
        Journal(written, "a")
    assert "\n" not in str(no.value)
    assert written.read_bytes() == before


class Labelled(eqx.Module):
    value: float
    label: str = eqx.field(static=True, default="a")


@pytest.mark.parametrize(
    ("data", "other"),
    [
        ({"length": np.array([0.3])}, {"breadth": np.array([0.3])}),
        ((np.ones(2), np.ones(3)), (np.ones((2, 1)), np.ones(3))),
        (((1.0, 2.0), 3.0), (1.0, (2.0, 3.0))),
        ((1.0, None), (None, 1.0)),
        (Labelled(1.0), Labelled(1.0, "b")),
        ([1.0], [float(np.nextafter(1.0, 2.0))]),
    ],
)
def test_evaluations_at_other_data_are_not_known(path, data, other):
    journal = Journal(path, "a")
    journal.add([0, 0.0], data, numbers(0.0))
    assert journal.find([0, 0.0], other) is None
    assert journal.find([1, 0.0], data) is None
    assert Journal(path, "a").find([0.0, 0.0], copy.deepcopy(data)) is not None


def test_a_file_that_cannot_be_opened_is_reported_in_one_line(tmp_path, path):
    (tmp_path / "file").write_text("")
    for place in (tmp_path / "file" / "j.jsonl", tmp_path):
        with pytest.raises(OSError, match="cannot be read or written .*name another folder") as no:
            Journal(place, "a")
        assert "\n" not in str(no.value)


@pytest.mark.parametrize("half", [True, False])
def test_a_full_disk_loses_nothing(written, monkeypatch, half):
    """A disk that takes half of the line, or fails in the sync."""
    journal, before = Journal(written, "a"), written.read_bytes()
    with monkeypatch.context() as patch:
        if half:
            real = open

            class Short:
                def __init__(self, *arguments, **settings):
                    self._file = real(*arguments, **settings)

                def __enter__(self):
                    return self

                def __exit__(self, *error):
                    self._file.close()

                def write(self, line):
                    return self._file.write(line[: len(line) // 2])

                def __getattr__(self, name):
                    return getattr(self._file, name)

            patch.setattr(type(written), "open", lambda *a, **s: Short(*a, **s))
        else:
            def full(descriptor):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

            patch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space left on device.*make room"):
            journal.add([5, 0.0], DATA, numbers(5.0))
    assert written.read_bytes() == before
    # Not kept: with room again, it is made again.
    assert journal.find([5, 0.0], DATA) is None
    journal.add([5, 0.0], DATA, numbers(5.0))
    assert len(Journal(written, "a")) == 6
