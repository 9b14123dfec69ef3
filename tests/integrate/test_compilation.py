"""What users read of compilations."""

from rubhpc.integrate import compilation
from rubhpc.kernels import _jit


def test_each_part_is_announced_once(monkeypatch):
    monkeypatch.setattr(compilation, "_announced", set())
    before, texts = _jit.compilation.began, []
    with compilation.announced_by(texts.append):
        for name in ("enter", "advance", "carry_along", "enter", "carry_along", "advance_by_steps"):
            _jit.compilation.began(name)
    assert _jit.compilation.began is before
    common = "once after an installation: up to a minute"
    assert texts == [
        f"compiling kernels, {common}",
        f"compiling kernels for neighbouring motions, which distinguish chaos from order, {common}",
        f"compiling kernels for contact in short steps, {common}",
    ]


def test_parts_are_names_of_kernels():
    from rubhpc.kernels import curved_loop, flow, friction_pieces, piece_loop, stepping_loop, tangent

    modules = flow, tangent, stepping_loop, curved_loop, friction_pieces, piece_loop
    kernels = {name for module in modules for name in vars(module)}
    assert all(name in kernels for name in compilation._PARTS)


def test_no_garbage_is_looked_for_while_kernels_are_compiled():
    import gc

    import numba
    from numba.core import event

    collects = []

    class Watching(event.Listener):
        def on_start(self, event):
            collects.append(gc.isenabled())

        def on_end(self, event):
            pass

    with event.install_listener("numba:compile", Watching()):
        assert numba.njit(lambda x: x + 1.0)(1.0) == 2.0
    assert collects
    assert not any(collects)
    assert gc.isenabled()
