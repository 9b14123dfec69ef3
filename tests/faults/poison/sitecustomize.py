"""Poisons the processes that a poisoned one starts."""

import os

import poison

poison.install(os.environ["POISON"])
