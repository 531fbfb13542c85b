"""How functions become commands, and what comes back."""

from __future__ import annotations

import json
import os
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path as _Path
from typing import TYPE_CHECKING, Any, Union

from quadlab import _quadlab

if TYPE_CHECKING:
    import pandas

    from quadlab.flight import Flight

Path = Union[str, "os.PathLike[str]"]
"""Name of a file or folder."""
Flights = Union[Path, "Flight", Sequence[Union[Path, "Flight"]]]
"""Flight files, logs of other programs, folders of them, or flights in memory."""


class Model:
    """An identified model: the text of its file.

    `Model("model.toml")` reads one; `identify`, `add` and `explain` make them.
    """

    def __init__(self, path: Path):
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

        `t` (s); `u`, `v`, `w` (m/s^2, body axes forward, right, down, without gravity) and `p`, `q`, `r` (rad/s^2) as
        measured; the same with `_predicted`. The rows are those that the model is fitted on.
        """
        with Files() as files:
            return _quadlab.residuals(files.model(self), files.flights(flight)[0])

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
    """Whether what the command checks holds."""
    refused: list[str] = field(default_factory=list)
    """Why inputs were refused while the job was done with the others."""
    model: Model | None = None
    """The model that the command made."""

    def __getitem__(self, key: str) -> Any:
        return self.document[key]

    def keys(self) -> list[str]:
        """What the document has."""
        return list(self.document)

    def frame(self, key: str) -> pandas.DataFrame:
        """A table of the document, such as `coefficients`, as a pandas DataFrame."""
        import pandas

        table = self.document[key]
        if isinstance(table, Mapping):
            return pandas.DataFrame.from_dict(dict(table), orient="index")
        return pandas.json_normalize(table)


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

    def flights(self, flights: Flights) -> list[str]:
        """The files of flights."""
        from quadlab.flight import Flight

        if isinstance(flights, (str, os.PathLike, Flight)):
            flights = [flights]
        return [self._flight(flight) if isinstance(flight, Flight) else os.fspath(flight) for flight in flights]

    def _flight(self, flight: Flight) -> str:
        path = self.new(_Path(flight.name).name or "flight.csv")
        flight.save(path)
        return str(path)

    def words(self, value: Any) -> list[str]:
        """A value of an option as words."""
        from quadlab.flight import Flight

        if isinstance(value, Flight):
            return self.flights(value)
        if isinstance(value, (str, os.PathLike)):
            return [os.fspath(value)]
        if isinstance(value, Model):
            return [self.model(value)]
        if isinstance(value, Sequence):
            return [word for one in value for word in self.words(one)]
        return [str(value)]


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
        text, holds, refused = _quadlab.run(words)
        document = json.loads(text) if has_json and text.strip() else text
        model = Model(out) if out is not None and out.exists() else None
        return Result(document, holds, refused, model)
