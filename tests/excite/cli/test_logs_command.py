"""``excite logs``: what it shows, the mapping that it writes, and that other commands take it as it stands."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from commands import run_command
from foreign_logs import Motion, motion, write_plotjuggler, write_rtde, write_table

import excite
