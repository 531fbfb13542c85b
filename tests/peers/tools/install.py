#!/usr/bin/env python3
"""Install other people's simulators and design tools into a folder of their own: install.py FOLDER"""

import pathlib
import subprocess
import sys
import venv

folder = pathlib.Path(sys.argv[1])
requirements = pathlib.Path(__file__).with_name("requirements.txt")
venv.create(folder, with_pip=True, clear=True)
pip = [str(folder / "bin" / "python"), "-m", "pip", "--quiet", "--disable-pip-version-check"]
sys.exit(subprocess.call([*pip, "install", "--requirement", str(requirements)]))
