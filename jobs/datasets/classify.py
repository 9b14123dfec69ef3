"""Train a classifier of rub and test it on one machine or more: `python classify.py disc disc turbine`.

Each argument is a directory that `rubhpc dataset` has made: the first is trained on (several joined by
commas), the others are tested. Needs pandas, pyarrow and scikit-learn, not rubhpc.
"""

from __future__ import annotations

import sys

import numpy as np
import pandas as pd
from sklearn.ensemble import RandomForestClassifier
from sklearn.metrics import accuracy_score, confusion_matrix

ORDERS = (-3, -2, -1, -0.5, 0, 0.5, 2, 3)  # forward whirl is above 0; 1X is what they are compared with


def features(window: pd.Series) -> list[float]:
    """Return lines of the full spectrum over 1X, and what is left of the whirl, none of which has a unit."""
    pulses = np.flatnonzero(np.diff(window["key_phasor"]) > 0) + 1
    n_turn = (len(pulses) - 1) // 2 * 2  # whole periods of the half order
    inside = slice(pulses[0], pulses[n_turn])
    turns = np.interp(np.arange(len(window["key_phasor"]))[inside], pulses, np.arange(len(pulses)))
    whirl = (np.array(window["probe_left"]) + 1j * np.array(window["probe_right"]))[inside]
    whirl = whirl - whirl.mean()
    line = {order: np.mean(whirl * np.exp(-2j * np.pi * order * turns)) for order in (1, *ORDERS)}
    rest = whirl - sum(size * np.exp(2j * np.pi * order * turns) for order, size in line.items())
    sizes = [abs(line[order]) for order in ORDERS if order] + [np.sqrt(np.mean(abs(rest) ** 2))]
    return [*np.log10(np.array(sizes) / abs(line[1])), np.ptp(abs(whirl)) / np.mean(abs(whirl))]


def read(directory: str, split: str) -> tuple[np.ndarray, np.ndarray]:
    """Return features (n_window, n_feature) and whether the rotor touches its stator, (n_window,)."""
    windows = pd.read_parquet(f"{directory}/{split}.parquet")
    return np.array([features(window) for _, window in windows.iterrows()]), windows["contact"].to_numpy()


def main(learned: str, *tested: str) -> None:
    """Print accuracy and confusion matrix on cases that were not trained on."""
    forest = RandomForestClassifier(n_estimators=300, min_samples_leaf=5, random_state=1)
    x, y = zip(*(read(directory, "train") for directory in learned.split(",")), strict=True)
    forest.fit(np.concatenate(x), np.concatenate(y))
    for directory in tested:
        x, y = read(directory, "test")
        guess = forest.predict(x)
        (right_free, false_alarm), (missed, right_rub) = confusion_matrix(y, guess)
        print(f"{directory}: {accuracy_score(y, guess):.1%} of {len(y)} windows are right")
        print(f"  without contact: {right_free} right, {false_alarm} taken for rub")
        print(f"  with contact:    {right_rub} right, {missed} missed")


if __name__ == "__main__":
    main(*sys.argv[1:])
