"""The listing, the check and the choice of devices, also with broken platforms."""

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from simdtex.general import render
from simdtex.machine import devices
from simdtex.machine.devices import DeviceError, DeviceInfo


def fake(index, name, platform="Acme OpenCL", kind="cpu", usable=True, **more):
    reason = "" if usable else "it does not build"
    return DeviceInfo(index, platform, name, kind, usable=usable, reason=reason, **more)


LISTING = [
    fake(0, "Turbo 4090", kind="gpu", usable=False),
    fake(1, "Slow 10", kind="gpu"),
    fake(2, "pthread-epyc", "Portable Computing Language", version="OpenCL 3.0 PoCL HSTR"),
    fake(3, "pthread-epyc", "Portable Computing Language", usable=False),
    fake(4, "reference", "NumPy", "reference"),
]


@pytest.fixture(autouse=True)
def no_variable(monkeypatch):
    monkeypatch.delenv(devices.VARIABLE, raising=False)


CHOSEN = {
    **{None: 1, "slow": 1, "SLOW 10": 1},  # None: the first usable
    **{"pocl": 2, "portable": 2, "pthread-epyc": 2},  # by the version; of two matches the only usable one
    **{"2": 2, " 2 ": 2, "10": 1, "4": 4, "refer": 4},  # there is no index 10, so it is a part of a name
}
REFUSED = {
    "nonesuch": '"nonesuch"; choose one of: 1 = Slow 10 (Acme OpenCL), 2 = ',
    "99": 'No device matches "99"; choose one of: 1 = ',
    "": "choose one of",
    "turbo": "cannot be used (Turbo 4090 (Acme OpenCL): it does not build); choose one of: 1 = Slow 10",
    "0": "it does not build); choose one of: 1 = Slow 10",
    "e": "matches several devices; give the index of one of: 1 = Slow 10 (Acme OpenCL), 2 =",
}


def test_choose():
    assert {text: devices.choose(text, LISTING).index for text in CHOSEN} == CHOSEN
    listing = [fake(0, "Ultra"), fake(1, "Ultra Max"), fake(2, "cpu-Intel(R) Xeon", "PoCL"), fake(3, "Xeon", "Intel")]
    for text, index in (("ultra", 0), ("ultra max (acme opencl)", 1), (str(listing[2]), 2), ("intel", 3)):
        assert devices.choose(text, listing) is listing[index], "the whole name, then the platform"


def test_a_failed_choice_lists_the_devices():
    for text, words in REFUSED.items():
        with pytest.raises(DeviceError) as said:
            devices.choose(text, LISTING)
        assert words in str(said.value) and str(said.value).endswith(".") and "\n" not in str(said.value)
    with pytest.raises(ValueError) as said:
        devices.choose(None, [LISTING[0], LISTING[4]])
    remedies = ("pip install simdtex[cpu]", "apt install pocl-opencl-icd", "driver of your GPU", 'device="reference"')
    assert all(words in str(said.value) for words in ("Turbo 4090: it does not build", *remedies))


def test_a_device_that_is_refused_is_not_offered():
    """The listing is not probed, and only the devices that match are."""
    listing = [replace(info, usable=False, reason="not probed") for info in LISTING[:3]]
    with pytest.raises(DeviceError, match=r"choose one of: 1 = [^=]*, 2 = [^=]*$"):
        devices.choose("turbo", listing, lambda info: replace(info, reason="it does not build"))


def test_choose_probes_no_further_than_needed():
    for text, expected in ((None, [0, 1]), ("slow", [1])):
        probed = []
        devices.choose(text, LISTING, lambda info, probed=probed: probed.append(info.index) or info)
        assert probed == expected


def test_simulators_and_single_threads_come_last():
    infos = [
        fake(0, "", "Hollow"),
        fake(0, "Oclgrind Simulator", "Oclgrind", "gpu"),
        fake(0, "llvmpipe (LLVM 15)", "rusticl"),
        fake(0, "board", kind="accelerator"),
        fake(0, "basic-epyc", "Portable Computing Language"),
        fake(0, "pthread-epyc", "Portable Computing Language"),
        fake(0, "Turbo", kind="gpu"),
    ]
    names = [info.name for info in sorted(infos, key=devices._preference)]
    assert names == ["Turbo", "pthread-epyc", "basic-epyc", "board", "Oclgrind Simulator", "llvmpipe (LLVM 15)", ""]


def handle(name, bits, units, unified):
    """A device of a runtime; 2 is a CPU, 4 a GPU."""
    texts = {"name": name, "version": "OpenCL 3.0", "driver_version": "1"}
    sizes = {"type": bits, "max_compute_units": units, "global_mem_size": 2**30, "max_mem_alloc_size": 2**28}
    return SimpleNamespace(**texts, **sizes, host_unified_memory=unified)


def test_a_gpu_with_its_own_memory_and_more_units_comes_first(platforms):
    one = [handle("cores", 2, 256, True), handle("on the board", 4, 96, True), handle("half", 4, 40, False)]
    two = [handle("whole", 4, 80, False), handle("other cores", 2, 300, True)]
    platforms(*(SimpleNamespace(name=name, get_devices=lambda of=of: of) for name, of in (("A", one), ("B", two))))
    listing = devices.devices(probe=False)
    names = ["whole", "half", "on the board", "cores", "other cores", "reference"]
    assert [info.name for info in listing] == names
    assert [info.integrated for info in listing] == [False, False, True, False, False, False]
    assert listing[0].largest == 2**28


def test_find_reads_the_variable_only_when_nothing_is_asked(monkeypatch):
    monkeypatch.setattr(devices, "devices", lambda probe: list(LISTING))
    monkeypatch.setattr(devices, "probe", lambda info: info)
    assert devices.find().index == 1
    monkeypatch.setenv(devices.VARIABLE, "portable")
    assert devices.find().index == 2
    assert devices.find("slow").index == 1
    assert devices.find(2).index == 2
    monkeypatch.setenv(devices.VARIABLE, "")
    assert devices.find().index == 1
    monkeypatch.setenv(devices.VARIABLE, "Reference")
    assert devices.find().kind == "reference"
    monkeypatch.setenv(devices.VARIABLE, "nonesuch")
    with pytest.raises(DeviceError, match="nonesuch"):
        devices.find()


def test_find_takes_a_line_of_the_listing_and_asks_no_runtime_for_the_reference(monkeypatch):
    assert devices.find(LISTING[1]) is LISTING[1]
    with pytest.raises(DeviceError, match="it does not build"):
        devices.find(LISTING[0])
    monkeypatch.setattr(devices, "devices", lambda probe: pytest.fail("a runtime was asked"))
    found = devices.find("reference")
    assert found.usable and found.handle is None


def test_ensure_accepts_a_simulator_only_by_name(monkeypatch):
    monkeypatch.setattr(devices, "find", lambda: fake(0, "Oclgrind"))
    assert devices.main() == 1
    monkeypatch.setenv(devices.VARIABLE, "oclgrind")
    assert devices.main() == 0


class Broken:
    """A platform or device of which every attribute raises."""

    def __getattr__(self, name):
        raise RuntimeError(f"broken {name}\nlog:\nerror: unknown target CPU")


class NoDevices(SimpleNamespace):
    def get_devices(self):
        raise RuntimeError("CL_OUT_OF_HOST_MEMORY")


@pytest.fixture
def platforms(monkeypatch):
    devices._enumerate.cache_clear()
    yield lambda *found: monkeypatch.setattr(devices, "platforms", lambda: list(found))
    devices._enumerate.cache_clear()


def test_a_reason_keeps_the_error_of_a_long_message():
    name = "clBuildProgram failed: BUILD_PROGRAM_FAILURE"
    message = f"{name} - {name} - {name}\n\nCompilation started\n1438:3:16: error: a parameter is missing\nfailed\n"
    assert devices.one_line(ValueError(message)) == f"{name} - 1438:3:16: error: a parameter is missing"
    assert devices.one_line(ValueError()) == "ValueError"


def test_a_broken_platform_does_not_stop_the_working_one(any_device, platforms):
    hollow = SimpleNamespace(name=" Hollow\0", get_devices=list)
    sick = SimpleNamespace(name="AAA", get_devices=lambda: [Broken()])
    platforms(Broken(), NoDevices(name="Sick"), hollow, sick, any_device.handle.platform)
    listing = devices.devices(probe=False)
    reasons = {info.platform: info.reason for info in listing if not info.name}
    assert reasons == {
        "AAA": "broken type - error: unknown target CPU",
        "Hollow": "the platform reports no device",
        "Sick": "CL_OUT_OF_HOST_MEMORY",
        "platform 0": "broken name - error: unknown target CPU",
    }
    assert [info.index for info in listing] == list(range(len(listing))) and listing[-1].kind == "reference"
    assert not any(devices.probe(info).usable for info in listing if not info.name)
    assert devices.find().name == any_device.name


WRONG = {
    "fma rounds twice": ("fma(x, x, -(1.0f + 0x1p-11f))", "0.0f"),
    "a product and a sum are contracted to an fma": ("x * x - (1.0f + 0x1p-11f)", "fma(x, x, -(1.0f + 0x1p-11f))"),
    "denormal numbers become 0": ("y * y", "0.0f"),
    "mul_hi of 64-bit integers is wrong": ("mul_hi(b[i], b[i])", "(ulong)mul_hi((uint)b[i], (uint)b[i])"),
}


def test_a_device_that_cannot_build_or_has_wrong_bits_is_not_usable(any_device, monkeypatch):
    right, info = devices._SOURCE, any_device
    try:
        for reason, (words, wrong) in WRONG.items():
            assert words in right
            monkeypatch.setattr(devices, "_SOURCE", right.replace(words, wrong))
            devices.failure.cache_clear()
            assert devices.probe(info).reason == f"a tiny program gave wrong bits: {reason}"
        monkeypatch.setattr(devices, "_SOURCE", "__kernel void probe(nonsense)")
        devices.failure.cache_clear()
        line = devices.probe(info)
        assert not line.usable and "rror" in line.reason and "\n" not in line.reason
    finally:
        devices.failure.cache_clear()


def test_a_runtime_that_crashes_or_hangs_is_a_reason(monkeypatch):
    run = subprocess.run
    monkeypatch.setattr(devices, "_SECONDS", 1.0)
    for code, reason in (
        ("print('noise\\nsimdtex-probe:', flush=True)", ""),
        ("print('simdtex-probe:it does not build')", "it does not build"),
        ("import os; os.abort()", "the runtime crashed on a tiny program (SIGABRT)"),
        ("raise SystemExit(7)", "the runtime crashed on a tiny program (exit code 7)"),
        ("import time; time.sleep(60)", "a tiny program did not finish within 1 seconds"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(devices.subprocess, "run", lambda words, code=code, **how: run([words[0], "-c", code], **how))
            assert devices.failures([0]) == [reason]


def run_with_icds(folder: Path, *args: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *args],
        env={**os.environ, "OCL_ICD_VENDORS": str(folder)},
        capture_output=True,
        text=True,
        timeout=120,
    )


SAY = """
from simdtex.machine import devices
try:
    print(devices.find().kind)
except devices.DeviceError as error:
    print(error)
print(devices.find("reference").kind)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the loader reads .icd files on Linux only")
def test_an_icd_that_names_no_library(tmp_path):
    (tmp_path / "broken.icd").write_text("/nonexistent/libbroken.so\n")
    alone = run_with_icds(tmp_path, "-c", SAY)
    assert alone.returncode == 0, alone.stderr
    assert alone.stdout.startswith("No usable OpenCL device was found: install")
    assert alone.stdout.endswith("\nreference\n")
    assert run_with_icds(tmp_path, "-m", "simdtex.machine.devices", "--ensure").returncode == 1


@pytest.fixture
def intel(monkeypatch, tmp_path):
    library = tmp_path / "lib" / "libintelocl.so"
    library.parent.mkdir()
    library.touch()
    monkeypatch.setattr(devices.sys, "prefix", str(tmp_path))
    monkeypatch.setattr(devices.sys, "platform", "linux")
    for name in devices._ICD_VARIABLES:
        monkeypatch.delenv(name, raising=False)
    return library


def test_the_intel_runtime_is_added_to_the_icd_files(intel, monkeypatch, tmp_path):
    conda = tmp_path / "etc" / "OpenCL" / "vendors"
    conda.mkdir(parents=True)
    (conda / "named.icd").write_text("libnamed.so.1\n")
    (conda / "intel-cpu.icd").write_text("/wrong/place/libintelocl.so\n")
    (conda / "text.icd").write_bytes(b"\xff\xfe\xff")
    assert devices.intel_library() == intel
    with devices._icd_folder():
        folder = Path(os.environ["OCL_ICD_VENDORS"])
        lines = [icd.read_text().strip() for icd in folder.iterdir()]
        assert str(intel) in lines
        assert "libnamed.so.1" in lines
        assert not any("wrong" in line for line in lines)
    assert "OCL_ICD_VENDORS" not in os.environ
    assert not folder.exists()
    monkeypatch.setenv("OCL_ICD_VENDORS", "/my/own")
    with devices._icd_folder():
        assert os.environ["OCL_ICD_VENDORS"] == "/my/own", "a folder that the user has set is used"


def test_every_usable_device_is_in_the_isolated_listing(cl_device):
    line = devices.devices()[cl_device.index]
    assert replace(line, handle=None) == replace(cl_device, handle=None)
    assert line.compute_units > 0 and line.memory > 0 and line.version.startswith("OpenCL ")
    assert devices.find(cl_device.index) == cl_device


def test_render(capsys):
    listing = [*LISTING[:3], fake(3, "Oclgrind [bold]"), fake(4, "", "Hollow", usable=False)]
    render(listing)
    lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert lines[0].split() == ["index", "platform", "device", "kind", "OpenCL", "units", "memory", "usable"]
    assert lines[1].endswith("no: it does not build")
    assert lines[2].split()[:2] == ["*", "1"]
    assert lines[4].endswith("yes (simulator)")
    assert "[bold]" in lines[4]
    assert lines[5].split()[1:4] == ["Hollow", "-", "-"]
    assert lines[-1] == "Chosen by default: Slow 10 (Acme OpenCL)"


def test_threads_list_the_platforms_one_after_another(intel, monkeypatch):
    import pyopencl

    seen = []

    def get_platforms():
        seen.append(os.environ["OCL_ICD_VENDORS"])
        time.sleep(0.02)
        return []

    monkeypatch.setattr(pyopencl, "get_platforms", get_platforms)
    with ThreadPoolExecutor(6) as pool:
        assert list(pool.map(lambda _: devices.platforms(), range(6))) == [[]] * 6
    assert len(set(seen)) == 6, "each has its own folder"
    assert "OCL_ICD_VENDORS" not in os.environ
