"""How functions become commands, and what comes back."""

from __future__ import annotations

import json
import logging
import os
import re
import tempfile
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path as _Path
from typing import TYPE_CHECKING, Any, Union

from quadlab import _quadlab

if TYPE_CHECKING:
    import pandas

    from quadlab.flight import Flight

_logger = logging.getLogger("quadlab")

Path = Union[str, "os.PathLike[str]"]
"""Name of a file or folder."""
Flights = Union[Path, "Flight", "pandas.DataFrame", Iterable[Union[Path, "Flight", "pandas.DataFrame"]]]
"""Flight files, logs of other programs, folders of them, or flights and tables in memory."""


class Model:
    """An identified model: the text of its file.

    `Model("model.toml")` reads one; `identify`, `add` and `explain` make them.
    """

    def __init__(self, path: Path):
        _quadlab.check_model(os.fspath(path))
        self.text = _Path(path).read_text()

    @classmethod
    def from_text(cls, text: str) -> Model:
        """A model from the text of a model file."""
        model = cls.__new__(cls)
        model.text = text
        return model

    def save(self, path: Path) -> None:
        """Writes the model file."""
        _Path(path).write_text(self.text)

    @property
    def document(self) -> dict[str, Any]:
        """The model file as a dictionary."""
        return tomllib.loads(self.text)

    def predict(self, flight: Path | Flight) -> dict[str, Any]:
        """Measured and predicted accelerations of a flight, as NumPy arrays.

        `t` (s); `u`, `v`, `w` (m/s^2, specific force along the body axes forward, right, down) and `p`, `q`, `r`
        (rad/s^2) as measured; the same with `_predicted`. There are rows where the model is fitted, fewer than the flight
        has: match them by `t`.
        """
        with Files() as files:
            names = files.words(flight)
            if len(names) != 1:
                raise _quadlab.QuadlabError(f"predict: takes one flight, and {len(names)} are given; call it for each")
            return _quadlab.residuals(files.model(self), names[0])

    def frame(self) -> pandas.DataFrame:
        """Its coefficients with their standard errors and units, as a pandas DataFrame."""
        import pandas

        rows = [
            {"effect": effect["id"], **coefficient}
            for effect in self.document.get("effect", [])
            for coefficient in effect.get("coefficient", [])
        ]
        return pandas.DataFrame(rows).reindex(columns=["effect", "name", "value", "std_error", "unit"])

    @property
    def effects(self) -> list[str]:
        """The identifiers of its effects."""
        return [effect["id"] for effect in self.document.get("effect", [])]

    def __repr__(self) -> str:
        return f"Model({self.document['vehicle']['name']!r}, {', '.join(self.effects)})"


@dataclass
class Result:
    """What a command hands back."""

    document: Any
    """The document that the command prints with `--json`; its text where it has none."""
    holds: bool = True
    """False where the program would end with exit status 1: a check or a requirement does not hold."""
    refused: list[str] = field(default_factory=list)
    """Why inputs were refused while the job was done with the others."""
    model: Model | None = None
    """The model that the command made."""

    def __getitem__(self, key: str) -> Any:
        return self.document[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self.document)

    def __contains__(self, key: object) -> bool:
        return key in self.document

    def __repr__(self) -> str:
        told = ", ".join(self.keys()) if isinstance(self.document, Mapping) else str(self.document).strip()
        holds = "" if self.holds else ", holds=False"
        model = "" if self.model is None else f", model={self.model!r}"
        return f"Result({told}{holds}{model})"

    def keys(self) -> list[str]:
        """What the document has."""
        return list(self.document)

    def frame(self, key: str) -> pandas.DataFrame:
        """A table of the document, such as `coefficients`, as a pandas DataFrame."""
        import pandas

        table = self.document[key]
        if isinstance(table, Mapping) and all(isinstance(row, Mapping) for row in table.values()):
            return pandas.DataFrame.from_dict(dict(table), orient="index")
        if isinstance(table, list) and all(isinstance(row, Mapping) for row in table):
            return pandas.json_normalize(table)
        raise _quadlab.QuadlabError(f"{key}: is no table; take result[{key!r}]")


class Files:
    """Names of files for what is in memory, as long as a command runs."""

    def __enter__(self) -> Files:
        self._folder = tempfile.TemporaryDirectory(prefix="quadlab-")
        self._count = 0
        return self

    def __exit__(self, *_: object) -> None:
        self._folder.cleanup()

    def new(self, name: str) -> _Path:
        """A name that no other file has."""
        self._count += 1
        folder = _Path(self._folder.name) / str(self._count)
        folder.mkdir()
        return folder / name

    def model(self, model: Model | Path) -> str:
        """The file of a model."""
        if not isinstance(model, Model):
            return os.fspath(model)
        path = self.new("model.toml")
        model.save(path)
        return str(path)

    def flight(self, flight: Any) -> str:
        """The file of a flight or of a table."""
        from quadlab.flight import Flight

        flight = flight if isinstance(flight, Flight) else Flight(flight)
        path = self.new(_Path(flight.name).name or "flight.csv")
        flight.save(path)
        return str(path)

    def words(self, value: Any) -> list[str]:
        """A value of an option as words: what is in memory becomes a file."""
        if isinstance(value, (str, os.PathLike)):
            return [os.fspath(value)]
        if isinstance(value, Model):
            return [self.model(value)]
        # Tables of pandas and polars, and flights.
        if hasattr(value, "columns") and hasattr(value, "__getitem__"):
            return [self.flight(value)]
        if isinstance(value, Iterable):
            return [word for one in value for word in self.words(one)]
        return [str(value)]

    def without_folder(self, sentence: str) -> str:
        """A sentence about files that the user never saw, by their own names."""
        return re.sub(re.escape(self._folder.name) + r"/\d+/", "", sentence)


def run(words: list[str], options: Mapping[str, tuple[str | None, Any]], *, has_json: bool, makes_model: bool) -> Result:
    """Runs a command with its options: the flag and the value of each."""
    words = list(words)
    with Files() as files:
        out = None
        trailing: list[str] = []
        for name, (flag, value) in options.items():
            if makes_model and name == "out":
                out = value = files.new("model.toml") if value is None else _Path(value)
            if value is None or value is False:
                continue
            told = [] if value is True else files.words(value)
            if flag is None:
                trailing += told
            elif value is True or told:
                words += [f"--{flag}", *told]
        words += ["--json"] if has_json else []
        # A name that begins with a hyphen is no option.
        words += ["--", *trailing] if trailing else []
        try:
            text, holds, refused = _quadlab.run(words)
        except _quadlab.QuadlabError as told:
            raise _quadlab.QuadlabError(files.without_folder(str(told))) from None
        if not holds:
            _logger.warning("%s: a check or a requirement does not hold: holds is False in the result", " ".join(words[:2]))
        document = json.loads(text) if has_json and text.strip() else text
        model = Model(out) if out is not None and out.exists() else None
        return Result(document, holds, refused, model)
