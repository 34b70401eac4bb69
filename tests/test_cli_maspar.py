"""``simdtex maspar``, as its user meets it."""

from cases import assert_same_bits, texture
from click.testing import CliRunner

from simdtex.cli import main
from simdtex.io.image import read, write


def test_the_command_writes_what_synth_writes_and_prints_the_times_of_1998(tmp_path):
    write(tmp_path / "sample.png", texture((14, 13)))
    common = [str(tmp_path / "sample.png"), "--order", "2", "--seed", "3", "--size", "12x10", "--device", "reference"]
    ours = ["maspar", *common, "-o", str(tmp_path / "ours.png"), "--array", "4x4", "--mapping", "hierarchical"]
    done = CliRunner().invoke(main, ours)
    assert done.exit_code == 0, done.output
    assert f"{tmp_path / 'ours.png'}: 12x10 from 13x14 in " in done.output
    for word in ("A MasPar MP-1 of 4x4 PEs", "distance", "x-net", "all"):
        assert word in done.output
    theirs = ["synth", *common, "-o", str(tmp_path / "theirs.png"), "--preset", "paper"]
    assert CliRunner().invoke(main, theirs).exit_code == 0
    assert_same_bits(*(read(tmp_path / f"{name}.png").pixels for name in ("ours", "theirs")))
    quiet = CliRunner().invoke(main, [*ours, "-q", "--array", "1k"])
    assert (quiet.exit_code, quiet.output) == (0, "")
