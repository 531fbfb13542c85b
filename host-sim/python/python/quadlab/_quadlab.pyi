"""What of the package is compiled."""

import os
from collections.abc import Mapping
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__version__: str

class QuadlabError(ValueError):
    """What the program says in one line."""

def run(words: list[str]) -> tuple[str, bool, list[str]]: ...
def check_model(path: str | os.PathLike[str]) -> None: ...
def describe() -> str: ...
def read(path: str | os.PathLike[str]) -> list[tuple[str, dict[str, NDArray[np.float64]]]]: ...
def residuals(
    model: str | os.PathLike[str], flight: str | os.PathLike[str]
) -> dict[str, NDArray[np.float64]]: ...
def simulate(wanted: Mapping[str, Any]) -> tuple[str, dict[str, NDArray[np.float64]]]: ...
@final
class Crafts:
    def __new__(cls, wanted: Mapping[str, Any], count: int) -> Crafts: ...
    @property
    def numbers(self) -> int: ...
    @property
    def period_s(self) -> float: ...
    def reset(self, seeds: list[int], which: list[bool], observations: NDArray[np.float32]) -> None: ...
    def step(
        self,
        actions: NDArray[np.float32],
        observations: NDArray[np.float32],
        rewards: NDArray[np.float64],
        terminated: NDArray[np.bool_],
        truncated: NDArray[np.bool_],
        autoreset: bool,
    ) -> None: ...
