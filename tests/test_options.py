"""Every option has a range: what is beyond it is said in one sentence, whatever is given."""

import re
from math import inf, nan

import click
import numpy as np
import pytest
from cases import assert_same_bits, ising
from click.testing import CliRunner

import simdtex
from simdtex.cli.command import reporting
from simdtex.jobs.studies.comparison import compare
from simdtex.jobs.studies.ising import torus_energy
from simdtex.machine.reference import Reference
from simdtex.methods import mrf
from simdtex.methods.multires import options as multires
from simdtex.methods.pyramid import options as pyramid
from simdtex.methods.pyramid import solid
from simdtex.options import GREATEST, MOST, UNSET, Number, Whole, resolve, table, within_32_bits

SAMPLE = np.random.default_rng(1).integers(0, 256, (9, 9), dtype=np.uint8)
STRANGE = [
    *(0, -1, 1, 2**31 - 1, 2**31, 2**32, 2**63, 2**64, -(2**63) - 1, 10**400, 10**5000, (), (0,), [], [[]], {}),
    *(nan, inf, -inf, 1e308, -1e308, 1e-320, 5e-324, -3e6, np.float32(3e38), np.int64(2**62), 1j),
    *(None, True, False, "", "x", "nan", "a" * 10**4, b"0", object(), np.zeros(0), np.zeros((2, 2))),
]
JOBS = {"synth", "fill", "extend", "simulate", "simulate 3-D", "simulate values", "simulate 3-D values", "schedules"}
METHODS = {"mrf": mrf, "multires": multires, "pyramid": pyramid, "solid": solid}


def test_any_value_of_an_option_is_taken_or_refused_in_one_sentence():
    for method, module in METHODS.items():
        for name in table(module.Options).keys() - {"schedule"}:  # any object may be one
            for value in STRANGE:
                try:
                    module.Options(**{name: value})
                except (TypeError, ValueError) as error:
                    text = str(error)
                    assert "\n" not in text and 10 < len(text) < 400, (method, name, value, text)
                    assert name.rstrip("s") in text or "array" in text, text


LARGEST = {
    "mrf": {
        **{name: GREATEST for name in ("bandwidth", "coherence", "balance", "structure", "novelty", "data_weight")},
        **{"finish": 16, "chance": 4096, "coarse_chance": 4096, "overview": MOST},
        **{"xi": -GREATEST, "guide_weight": GREATEST, "weights": (GREATEST,), "shares": (GREATEST,)},
    },
    "multires": {"alpha": 1e308, "beta": GREATEST, "orientations": 64},
}
SMALLEST = {
    "mrf": {"bandwidth": 1e-320, "coherence": 5e-324, "balance": 1e-320, "finish": 0.01},
    "multires": {"alpha": 1e-320, "beta": 1e-320},
}


def test_the_ends_of_every_range_work():
    for method, name, value in [(m, *item) for ends in (LARGEST, SMALLEST) for m in ends for item in ends[m].items()]:
        order = {"order": 1} if method == "mrf" else {}
        options = order | {name: value}
        made = simdtex.synthesize(SAMPLE, (5, 5), method=method, device="reference", rng=1, **options)
        assert made.shape == (5, 5), options


RUNS = {
    "mrf": lambda picture: simdtex.synthesize(picture, (9, 9), order=2, rng=1, device="reference"),
    "mix": lambda picture: simdtex.mix([picture, picture[::-1]], (16, 16), rng=1, device="reference"),
    "hard data": lambda picture: simdtex.place_hard_data([[0, 0, x] for x in picture[0]], (1, 1), several="mean").data,
}


def test_a_range_beyond_the_largest_double_does_not_overflow():
    picture = np.random.default_rng(0).uniform(-1.99, 1.99, (16, 16))
    for run in RUNS.values():
        assert_same_bits(run(picture * 2.0**1023), run(picture) * 2.0**1023)
    with pytest.raises(ValueError, match="values beyond 1e\\+100: give them in a larger unit"):
        compare(np.full((12, 12), 1.7e308), (9, 9), ["coloring"], device="reference")


def test_so_many_values_cannot_be_counted():
    for shape, what in (((2**16, 2**15), "rows x"), ((2**11, 2**10, 2**10), "a block of")):
        within_32_bits((*shape[:-1], shape[-1] - 1), 1)
        with pytest.raises(ValueError, match=f"{what}.* is beyond 2..31 values; give a smaller size"):
            within_32_bits(shape, 1)


def test_a_temperature_of_ising_has_a_range():
    for temperature in (0, -1, nan, inf, 1e7, 2**63):
        with pytest.raises(ValueError, match=r"temperature.*; give "):
            ising(Reference(), (4, 4), [temperature], "coloring", sweeps=1, burn_in=0, seeds=1)
        with pytest.raises(ValueError, match=r"temperature .*; give "):
            torus_energy(temperature, 4, 4)
    for temperature in (1e6, 5e-324):
        assert -2 <= torus_energy(temperature, 4, 5) <= 0
        run = ising(Reference(), (4, 4), [temperature], "coloring", sweeps=2, burn_in=0, seeds=1)
        assert np.isfinite(run.energy).all()


def test_memory_errors_are_said_in_one_sentence():
    @click.command()
    @reporting()
    def command():
        raise MemoryError

    result = CliRunner().invoke(command)
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)


def test_what_is_declared_is_complete_and_checked_and_its_docstring_says_it():
    for options in (module.Options for module in METHODS.values()):
        told = options.__doc__.partition("Parameters")[2]
        assert re.findall(r"^    (\w+) : ", told, re.MULTILINE) == list(table(options))
        for name, option in table(options).items():
            for value in (option.default, *option.jobs.values(), *([] if option.paper is UNSET else [option.paper])):
                option.check(name, value)
            kind = option.kind
            wrong = [object()] + [None] * (option.default is not None)
            if isinstance(kind, (Whole, Number)):
                wrong += [kind.least - 1] + ([] if kind.most == inf else [kind.most + 1])
            for value in wrong:
                with pytest.raises((TypeError, ValueError), match=name):
                    options(**{name: value})
            assert option.help[0].isupper() and option.help[-1] != "." and ". " not in option.help, name
            assert option.group and set(option.jobs) <= JOBS
            assert (option.default is None) == bool(option.none), f"{name} says what None stands for"
            said = " ".join(told.partition(f"    {name} : ")[2].partition("\n    " + name)[0].split())
            assert said.startswith(f"{kind}") and option.help in said


def test_a_near_miss_is_named():
    with pytest.raises(
        TypeError, match=r"unknown option 'coherense' of the method 'mrf' \(did you mean 'coherence'\?\); choose"
    ):
        resolve(mrf.Options, "synth", {"coherense": 1})
    for name, meant in (("seed", "rng"), ("rgn", "rng"), ("random_state", "rng"), ("chanel_axis", "channel_axis")):
        for method in (mrf, pyramid):
            with pytest.raises(TypeError, match=rf"unknown option '{name}' of .* \(did you mean '{meant}'\?\); choose"):
                resolve(method.Options, "synth", {name: 1})
    with pytest.raises(TypeError, match=r"unknown option 'zzzz' of the method 'pyramid'; choose from: preset, pyramid"):
        resolve(pyramid.Options, "synth", {"zzzz": 1})


def test_the_users_values_win_over_the_preset_over_the_job_over_the_method():
    def values(job, **given):
        found = resolve(mrf.Options, job, given)
        return found.balance, found.boundary, found.neighbourhood

    assert values("synth") == (0.5, "torus", 18)
    assert values("simulate") == (1.0, "open", 18)
    assert values("simulate", preset="default") == (1.0, "open", 18)
    assert values("simulate", preset="paper") == (0.0, "open", 18)
    assert values("simulate", preset="paper", balance=0.5, boundary="torus", order=8) == (0.5, "torus", 8)
    assert resolve(mrf.Options, "schedules", {}).search == "exact"
    assert resolve(mrf.Options, "synth", {"weights": [1, 2.5]}).weights == (1, 2.5)
    with pytest.raises(ValueError, match=r"^unknown preset 'papers'; choose one of: default, paper$"):
        resolve(mrf.Options, "synth", {"preset": "papers"})
    for options in (module.Options for module in METHODS.values()):
        paper = {name: one.default if one.paper is UNSET else one.paper for name, one in table(options).items()}
        assert vars(resolve(options, "synth", {"preset": "paper"})) == paper
