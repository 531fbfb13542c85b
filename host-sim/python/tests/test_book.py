"""The examples of the book's page on Python run, one after the other."""

import pathlib
import re
import shutil

PAGE = pathlib.Path(__file__).parents[2] / "book/src/python.md"


def test_examples_of_the_book_run(flights, vehicle, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(vehicle, "vehicle.toml")
    for name, flight in zip("ABCDE", flights):
        flight.save(f"{name}.csv")
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert len(blocks) >= 4
    names = {}
    for block in blocks:
        exec(compile(block, str(PAGE), "exec"), names)
    assert (tmp_path / "windy.csv").is_file()
    assert names["observations"].shape == (64, 11)
