"""Fixtures that run a test on usable OpenCL devices, and say in the end which ones did."""

import functools
import importlib
import os
import signal
from pathlib import Path

import hypothesis
import kept
import pytest

SOURCE = kept.key()  # before the package is imported

from simdtex.machine import devices as device_module  # noqa: E402
from simdtex.machine.devices import DeviceInfo  # noqa: E402

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell starts jobs in the background with it ignored

REQUIRE = "SIMDTEX_REQUIRE_OPENCL"
WHOLE_RUNS = ("test_conformance",)
"""Tests on every device; others take one of each platform, whose devices share a compiler, and compiling takes long."""
RAN = pytest.StashKey[dict[str, int]]()

# The same examples on every machine and every run; a first build on a device may take seconds.
hypothesis.settings.register_profile(
    "simdtex",
    derandomize=True,
    deadline=None,
    database=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("simdtex")


@functools.cache
def usable_devices() -> tuple[DeviceInfo, ...]:
    """Every usable OpenCL device but the simulators, best first."""
    real = [info for info in device_module.devices(probe=False) if info.handle is not None]
    probed = [device_module.probe(info) for info in real if not info.simulated]
    return tuple(info for info in probed if info.usable)


def pytest_configure(config):
    config.stash[RAN] = {}


def pytest_generate_tests(metafunc):
    if "cl_device" not in metafunc.fixturenames:
        return
    found = usable_devices()
    if metafunc.module.__name__ not in WHOLE_RUNS:
        first = {info.platform: info for info in reversed(found)}  # the best of each
        found = tuple(info for info in found if first[info.platform] is info)
    params = [pytest.param(info, id=f"{info.platform}-{info.index}".replace(" ", "-")) for info in found]
    nothing = pytest.param(None, id="no-device")
    metafunc.parametrize("cl_device", params or [nothing], indirect=True, scope="session")


def _take(info: DeviceInfo | None) -> DeviceInfo:
    """Hand a device to a test; where there is none, fail if one is required, else skip."""
    if info is None:
        message = "no usable OpenCL device here; `simdtex devices` says why"
        if os.environ.get(REQUIRE):
            pytest.fail(message)
        pytest.skip(message)
    return info


@pytest.fixture(scope="session")
def cl_device(request) -> DeviceInfo:
    """A usable OpenCL device of every platform in turn; every device in whole runs."""
    return _take(request.param)


@pytest.fixture(scope="session")
def machine(cl_device):
    """An OpenCL machine on each of these devices; its programs are built once a session."""
    from cases import opencl

    return opencl(cl_device)


@pytest.fixture(scope="session")
def any_device() -> DeviceInfo:
    """The usable OpenCL device that is preferred here."""
    return _take(next(iter(usable_devices()), None))


@pytest.fixture(scope="session")
def results(request) -> kept.Kept:
    """Results of whole runs, each computed once; pytest's cache keeps them until the source changes."""
    cache = getattr(request.config, "cache", None)  # None with -p no:cacheprovider
    return kept.Kept(cache and cache.mkdir("runs"), SOURCE, kept.key)


@pytest.fixture(scope="session")
def reference(results):
    """``reference(name)``: what a run of the table gives on the reference, its arrays and counts."""
    from runs import outcome

    return lambda name: results(name, lambda: outcome(name))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """Count a passed test for the device of its fixtures, direct or through other fixtures."""
    result = yield  # a test that raised or skipped does not come back here
    callspec = getattr(item, "callspec", None)
    info = callspec.params.get("cl_device") if callspec else None
    if info is None and "any_device" in item.fixturenames:
        info = next(iter(usable_devices()), None)
    if info is not None:
        ran = item.config.stash[RAN]
        ran[str(info)] = ran.get(str(info), 0) + 1
    return result


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    """Add what one of several processes counted, at its end."""
    ran = node.config.stash[RAN]
    for name, count in getattr(node, "workeroutput", {}).get("ran", {}).items():
        ran[name] = ran.get(name, 0) + count


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session, exitstatus):
    if hasattr(session.config, "workeroutput"):  # the process that began this one adds up
        session.config.workeroutput["ran"] = session.config.stash[RAN]
    elif os.environ.get(REQUIRE) and not session.config.option.collectonly:
        ran = session.config.stash[RAN]
        if not ran and exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter, config):
    ran = config.stash[RAN]
    if ran:
        each = ", ".join(f"{name}: {count} passed" for name, count in ran.items())
        terminalreporter.write_line(f"OpenCL devices that ran tests: {each}")
    else:
        failed = os.environ.get(REQUIRE)
        terminalreporter.write_line(
            f"No OpenCL device ran a test{f', and {REQUIRE} is set' if failed else ''}.",
            red=bool(failed),
        )


@pytest.fixture
def script(monkeypatch):
    """Return the function that imports a module of ``benchmarks/`` by its name."""
    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parent.parent / "benchmarks"))
    return importlib.import_module
