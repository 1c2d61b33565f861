"""Tests look into modules and replace parts of them, which only interpreted ones allow."""

import os

os.environ["HIL_COMPILED"] = "off"
