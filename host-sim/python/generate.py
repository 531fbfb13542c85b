#!/usr/bin/env python3
"""Write `python/quadlab/commands.py`, the functions that run quadlab's commands, from what the program says of its options.

    generate.py          write it
    generate.py --check  say whether it is what would be written, with the exit status

It needs the compiled module: run it where `import quadlab` works.
"""

import json
import pathlib
import re
import sys
import textwrap

from quadlab import _quadlab

# What only makes sense in a terminal, and what starts copies of the program.
LEFT_OUT = {"lab", "ground", "demo", "campaign_submit"}
# A word that Python or its users would misread.
RENAMED = {"import": "import_log", "from": "from_s"}
# Commands whose --out is a model: without it, the result has the model all the same.
MODELS = {"identify", "add", "explain"}
# What a value is, by the word that stands for it in the help.
TYPES = {
    "CSV": "Flights", "FLIGHTS": "Flights", "LOG": "Flights", "N": "int", "SAMPLES": "int", "COUNT": "int", "CASE": "int",
    "I": "int", "1..4": "int", "EFFECT": "str", "NAME": "str", "COEFFICIENT": "str", "SIGNAL": "str", "S": "float", "SHARE": "float", "PERCENT": "float", "HZ": "float", "DATE": "str", "COMMAND": "float",
}
HEAD = '''"""The commands of quadlab as functions: each takes the options of the command of the same name.

Written by `generate.py` from what the program says of its options; do not edit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from quadlab.running import Flights, Model, Path, Result, run
'''


def name_of(command):
    name = "_".join(command["words"]).replace("-", "_")
    return RENAMED.get(name, name)


def parameter(option):
    name = (option["flag"] or option["name"]).replace("-", "_")
    if name == "to" and option["value"] == "S":
        return "to_s"
    return RENAMED.get(name, name)


def type_of(option):
    if option["takes"] == "nothing":
        return "bool"
    if option["values"]:
        # Without a value, the option stands for its first.
        also = "bool | " if option["flag"] == "refine" else ""
        one = f"{also}Literal[{', '.join(json.dumps(value) for value in option['values'])}]"
    elif option["flag"] == "model":
        one = "Model | Path"
    elif option["flag"] in ("out", "html"):
        one = "Path"
    else:
        one = TYPES.get(option["value"], "Path")
    return f"{one} | Sequence[{one}]" if option["takes"] == "many" and one != "Flights" else one


def signature(command, options):
    has_model = name_of(command) in MODELS
    required = lambda option: option["is_required"] and not (has_model and option["flag"] == "out")
    lines = [f"def {name_of(command)}("]
    leading = [option for option in options if option["flag"] is None]
    named = [option for option in options if option["flag"] is not None]
    for option in leading + [None] + named:
        if option is None:
            lines += ["    *,"] if named else []
        elif required(option):
            lines.append(f"    {parameter(option)}: {type_of(option)},")
        elif option["takes"] == "nothing":
            lines.append(f"    {parameter(option)}: bool = False,")
        else:
            lines.append(f"    {parameter(option)}: {type_of(option)} | None = None,")
    return "\n".join([*lines, ") -> Result:"])


def flag_of(option):
    return "None" if option["flag"] is None else json.dumps(option["flag"])


def in_python(text):
    """Help of an option as people call it from Python: without examples of the command line."""
    text = re.sub(r",? ?([Ff]or example|such as):? --.*$", "", " ".join(text.split()))
    text = text.replace("Exit status 1 if", "`holds` is False if").replace("Exit status 2 if a log is refused", "`refused` says why logs are refused")
    text = re.sub(r"--([a-z][a-z-]*)", lambda flag: RENAMED.get(flag[1], flag[1]).replace("-", "_"), text)
    return text.rstrip(". ") + "."


def function(command):
    options = [option for option in command["options"] if option["flag"] != "json"]
    has_json = len(options) < len(command["options"])
    about = [textwrap.fill(in_python(paragraph), 100) for paragraph in command["about"].split("\n\n")]
    told = [
        textwrap.fill(f"{parameter(option)}: {in_python(option['help'] or '')}", 100, subsequent_indent="    ")
        for option in options
    ]
    if name_of(command) in MODELS:
        told = [line + " Without it, only the result has the model." if line.startswith("out:") else line for line in told]
    doc = "\n\n".join([*about, "\n".join(told)])
    flags = [f'        "{parameter(option)}": ({flag_of(option)}, {parameter(option)}),\n' for option in options]
    words = ", ".join(json.dumps(word) for word in command["words"])
    makes_model = name_of(command) in MODELS
    body = f"    options = {{\n{''.join(flags)}    }}\n    return run([{words}], options, {has_json=}, {makes_model=})"
    quoted = textwrap.indent(f'"""{doc}\n"""', "    ", lambda line: bool(line.strip()))
    return f"{signature(command, options)}\n{quoted}\n{body}\n".replace("\\", "\\\\")


def text():
    commands = [command for command in json.loads(_quadlab.describe()) if name_of(command) not in LEFT_OUT]
    names = "".join(f"    {json.dumps(name_of(command))},\n" for command in commands)
    return "\n\n".join([HEAD + f"\n__all__ = [\n{names}]\n", *map(function, commands)])


if __name__ == "__main__":
    path = pathlib.Path(__file__).parent / "python/quadlab/commands.py"
    if "--check" in sys.argv[1:]:
        if path.read_text() != text():
            sys.exit(f"{path}: is not what the program says of its options: run generate.py")
    else:
        path.write_text(text())
