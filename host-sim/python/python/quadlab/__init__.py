"""Model-based flight control for quadcopters: identify, compare, diagnose, add, design.

    import quadlab

    flight = quadlab.read("log.ulg")
    identified = quadlab.identify(train=["A.csv", "B.csv", "C.csv"], validate=["D.csv", "E.csv"])
    explained = quadlab.explain(train=["A.csv", "B.csv", "C.csv"], validate=["D.csv", "E.csv"])
    explained.model.save("model.toml")

Each function runs the command of the same name, with the same options and rules. What the program would print as an error
is a `QuadlabError` with the same sentence; warnings go to the logger `quadlab`. Ctrl-C stops long work.
"""

from quadlab._quadlab import QuadlabError
from quadlab.commands import *  # noqa: F403
from quadlab.commands import __all__ as _commands
from quadlab.commands import diagnose as _diagnose
from quadlab import plot
from quadlab._quadlab import __version__
from quadlab.flight import Flight, read, read_all, simulate
from quadlab.running import Flights, Model, Path, Result

__all__ = ["Flight", "Flights", "Model", "QuadlabError", "Result", "__version__", "changed", "plot", "read", "read_all", "simulate", *_commands]


def changed(model: Model | Path, flights: Flights) -> Result:
    """What has changed on the craft since the model was fitted: a heavier craft, a weak motor, wind, or nothing."""
    return _diagnose(model=model, changed=flights)
