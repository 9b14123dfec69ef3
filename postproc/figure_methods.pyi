# Written by `python tests/support/figure_stub.py` from the declarations of the figures.
from collections.abc import Mapping, Sequence
from typing import Any, Literal, Optional, Union

import xarray as xr
from matplotlib.axes import Axes

class FigureMethods:
    _store: xr.Dataset
    def __init__(self, store: xr.Dataset) -> None: ...
    def basins(
        self,
        *,
        x: Optional[str] = ...,
        y: Optional[str] = ...,
        along: Optional[str] = ...,
        tolerance: float = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def bifurcation(
        self,
        signal: str = ...,
        *,
        along: Optional[str] = ...,
        color: Optional[Literal['regime', 'period', 'direction']] = ...,
        over: Optional[str] = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def bode(
        self,
        signal: str | Sequence[str] = ...,
        *,
        order: float = ...,
        over: Optional[str] = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def cascade(
        self,
        signal: str | None = ...,
        *,
        full: bool = ...,
        probes: tuple[str, str] | None = ...,
        node: Optional[int] = ...,
        stator: Optional[int] = ...,
        along: Optional[str] = ...,
        form: Literal['waterfall', 'intensity'] = ...,
        max: Union[float, str, None] = ...,
        orders: bool = ...,
        order_lines: str = ...,
        mark: Mapping[str, float | str] | None = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def centreline(
        self,
        *,
        probes: tuple[str, str] | None = ...,
        node: Optional[int] = ...,
        stator: Optional[int] = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def hht(
        self,
        signal: str | None = ...,
        *,
        contact: Optional[Literal['masked', 'kept']] = ...,
        revolutions: int = ...,
        mode: int = ...,
        max: Union[float, str, None] = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def indicators(
        self,
        *,
        noise: Sequence[float] = ...,
        draws: int = ...,
        false_alarms: float = ...,
        seed: int = ...,
        scores: Optional[str] = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def map(
        self,
        value: str = ...,
        *,
        x: Optional[str] = ...,
        y: Optional[str] = ...,
        facet: Union[str, Sequence[str]] = ...,
        contours: Optional[int] = ...,
        log: bool = ...,
        computed: bool = ...,
        events: Optional[str] = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def multipliers(
        self,
        *,
        branch: Optional[int] = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def orbit(
        self,
        *,
        revolutions: Optional[int] = ...,
        at: Union[float, str, None] = ...,
        over: Optional[str] = ...,
        probes: tuple[str, str] | None = ...,
        node: Optional[int] = ...,
        stator: Optional[int] = ...,
        frame: Literal['orbit', 'clearance', 'mean'] = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def polar(
        self,
        signal: str | None = ...,
        *,
        order: float = ...,
        over: Optional[str] = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def section(
        self,
        x: str = ...,
        y: str = ...,
        *,
        over: Optional[str] = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def sensitivity(
        self,
        measure: str = ...,
        *,
        confidence: float = ...,
        draws: int = ...,
        seed: int = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def spectrum(
        self,
        signal: str | None = ...,
        *,
        full: bool = ...,
        probes: tuple[str, str] | None = ...,
        node: Optional[int] = ...,
        stator: Optional[int] = ...,
        at: Union[float, str, None] = ...,
        orders: bool = ...,
        max: Union[float, str, None] = ...,
        lines: int = ...,
        log: bool = ...,
        over: Optional[str] = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def speed(
        self,
        *,
        over: Optional[str] = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def waterfall(
        self,
        signal: str | None = ...,
        *,
        full: bool = ...,
        probes: tuple[str, str] | None = ...,
        node: Optional[int] = ...,
        stator: Optional[int] = ...,
        form: Literal['waterfall', 'spectrogram'] = ...,
        window: int = ...,
        count: int = ...,
        max: Union[float, str, None] = ...,
        orders: bool = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
    def waveform(
        self,
        signal: str | Sequence[str] = ...,
        *,
        revolutions: int = ...,
        at: Union[float, str, None] = ...,
        over: Optional[str] = ...,
        ax: Axes | Sequence[Axes] | None = ...,
        **choice: Any,
    ) -> Axes | list[Axes]: ...
